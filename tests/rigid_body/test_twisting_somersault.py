"""The diver with a rotor: closed form against integration, landings, the phase formula and the kick model."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, TrajectoryError
from shapephase.rigid_body import rotor_dive, rotor_dive_lasting, tilt_of_ratio

# Moments, momentum, rotor, time that it is on, somersaults and twists: y intermediate, largest, and equal to x.
DIVES = (
    ([12.0, 11.0, 1.0], 70.0, 50.0, 0.12, 1.5, 2.0),
    ([12.0, 11.0, 1.0], 70.0, 60.0, 0.1, 1.5, 1.5),
    ([12.0, 11.0, 1.0], 90.0, -40.0, 0.1, 2.5, 1.0),
    ([11.0, 12.0, 1.0], 80.0, 60.0, 0.15, 1.5, 3.0),
    ([21.0, 20.0, 1.0], 80.0, 90.0, 0.12, 1.5, 5.0),
    ([21.0, 21.0, 1.0], 80.0, 180.0, 0.06, 1.5, 0.5),
)
FULL = pytest.mark.full
TILT = np.radians(25.0)


def dive_of(case):
    moments, momentum, rotor, kick, somersaults, twists = case
    return rotor_dive(moments, momentum, rotor, kick, somersaults=somersaults, twists=twists)


def reconstructed(dive):
    """The same dive for the integrator: a constant inertia, and what the rotor has."""

    def inertia(t):
        return np.broadcast_to(np.diag(dive.moments), (len(t), 3, 3))

    deformation = sp.prescribed(inertia, dive.rotor_momentum, dive.duration, dive.times[1:-1])
    return sp.reconstruct(deformation, [0.0, dive.momentum, 0.0], tolerance=1e-9)


@pytest.mark.parametrize("case", DIVES)
def test_it_is_what_reconstruct_integrates_and_it_lands_f10(case):
    """To 1e-10, though the somersault about the intermediate axis is unstable and magnifies errors some 1e4 times."""
    dive = dive_of(case)
    motion, times = reconstructed(dive), np.linspace(0.0, dive.duration, 241)
    assert np.abs(motion.attitude(times) - dive.attitude(times)).max() < 1e-10
    assert motion.body_momentum(times) == pytest.approx(dive.body_momentum(times), abs=1e-10 * dive.momentum)
    assert np.abs(dive.attitude(dive.duration) - dive.landing).max() < 1e-13
    assert np.abs(motion.final_attitude - dive.landing).max() < 1e-10
    # Counted along the integrated motion, without the closed form: the long axis about y, the momentum about z.
    fine = np.linspace(0.0, dive.duration, 4001)
    attitude = motion.attitude(fine)
    long_axis, pi = attitude[:, :, 2], attitude[:, 1, :]
    somersault = np.unwrap(np.arctan2(long_axis[:, 0], long_axis[:, 2]))
    twist = np.unwrap(np.arctan2(pi[:, 0], pi[:, 1]))
    assert somersault[-1] == pytest.approx(2.0 * np.pi * dive.somersaults, abs=1e-9)
    assert twist[-1] == pytest.approx(2.0 * np.pi * dive.twists * np.sign(dive.rotor), abs=1e-9)
    assert dive.somersault(fine[::20]) == pytest.approx(somersault[::20], abs=1e-9)
    assert dive.twist(fine[::20]) == pytest.approx(twist[::20], abs=1e-9)


@pytest.mark.parametrize("case", DIVES)
def test_stages_and_the_reversing_symmetry_f10(case):
    """Turns add up; and the second half is the first one backwards, with Pi_x and for half a twist Pi_y reversed."""
    dive = dive_of(case)
    assert dive.turns.sum() == pytest.approx(2.0 * np.pi * dive.somersaults, rel=1e-14)
    assert dive.turns[0] == pytest.approx(dive.momentum / dive.moments[1] * dive.times[1], rel=1e-14)
    ends = dive.somersault(dive.times)
    assert np.diff(ends) == pytest.approx(dive.turns, abs=1e-12)
    half = -1.0 if dive.twists % 1.0 else 1.0
    times = np.linspace(0.0, dive.duration, 51)[1:-1]
    mirrored = dive.body_momentum(dive.duration - times) * np.array([-half, half, 1.0])
    assert dive.body_momentum(times) == pytest.approx(mirrored, abs=1e-11 * dive.momentum)
    middle = dive.body_momentum(0.5 * dive.duration)
    assert np.arcsin(middle[2] / dive.momentum) == pytest.approx(dive.tilt, abs=1e-12)


def test_it_is_cabreras_phase_f10():
    """For whole twists shape and momentum close: 2 pi m is the dynamic phase less the solid angle."""
    dive = dive_of(DIVES[0])
    split = sp.split(reconstructed(dive), "base")
    assert so3.wrap(split.montgomery_phase - 2.0 * np.pi * dive.somersaults) == pytest.approx(0.0, abs=1e-9)
    assert so3.wrap(split.dynamic_phase - split.solid_angle - np.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_strong_short_rotor_is_the_kick_model_f10():
    """As the shape change takes no time, h kick/I_x is the tilt, and m/n the top's rotation number."""
    moments = [12.0, 11.0, 1.0]
    top = sp.EulerTop.principal(moments, [0.0, np.cos(TILT), np.sin(TILT)])
    ratio = top.long_axis_precession_per_period / (2.0 * np.pi)
    assert tilt_of_ratio(moments, ratio) == pytest.approx(TILT, abs=1e-12)
    errors = []
    for kick in (1e-3, 1e-4):
        dive = rotor_dive(moments, 70.0, 12.0 * TILT / kick, kick, somersaults=1.5, twists=2.0)
        turned = dive.turns[2] / (2.0 * np.pi * 2.0)
        errors.append([dive.tilt - TILT, turned - ratio, dive.turns[1]])
    assert np.all(np.abs(errors[1]) < 0.11 * np.abs(errors[0]))
    # And the tilt with which two twists are all of half a somersault: nothing is left for somersaults alone.
    exact = tilt_of_ratio(moments, 0.5 / 2.0)
    short = rotor_dive(moments, 70.0, 12.0 * (exact + 1e-3) / 1e-6, 1e-6, somersaults=0.5, twists=2.0)
    assert 0.0 < short.turns[0] < 0.01
    for moments in ([11.0, 12.0, 1.0], [12.0, 12.0, 1.0]):
        tilt = tilt_of_ratio(moments, 0.2)
        top = sp.EulerTop.principal(moments, [0.0, np.cos(tilt), np.sin(tilt)])
        assert top.long_axis_precession_per_period == pytest.approx(0.4 * np.pi, abs=1e-11)


@pytest.mark.parametrize(
    ("somersaults", "twists"), [(1.5, 2.5), pytest.param(1.5, 1.0, marks=FULL), pytest.param(2.5, 2.0, marks=FULL)]
)
def test_the_momentum_for_a_duration_f10(somersaults, twists):
    dive = rotor_dive_lasting([12.0, 11.0, 1.0], 1.5, 60.0, 0.12, somersaults=somersaults, twists=twists)
    assert dive.duration == pytest.approx(1.5, abs=1e-13)
    assert np.abs(dive.attitude(1.5) - dive.landing).max() < 1e-10
    # All scales with the momentum: twice as fast with twice the momentum and the rotor, in half the time.
    fast = rotor_dive(dive.moments, 2.0 * dive.momentum, 120.0, 0.06, somersaults=somersaults, twists=twists)
    assert fast.times == pytest.approx(0.5 * dive.times, rel=1e-12)


def test_what_is_no_dive_gets_a_sentence():
    good = {"somersaults": 1.5, "twists": 2.0}
    moments = [12.0, 11.0, 1.0]
    for arguments, words in (
        (([1.0, 11.0, 12.0], 70.0, 50.0, 0.12, good), "smallest"),
        ((moments, -1.0, 50.0, 0.12, good), "momentum"),
        ((moments, 70.0, 0.0, 0.12, good), "rotor"),
        ((moments, 70.0, 50.0, [0.1], good), "kick"),
        ((moments, 70.0, 50.0, 0.12, good | {"twists": 0.75}), "half"),
    ):
        with pytest.raises(ShapeError, match=words):
            rotor_dive(*arguments[:4], **arguments[4])
    for arguments, words in (
        ((moments, 70.0, 50.0, 0.12, {"somersaults": 0.5, "twists": 2.0}), "somersaults, more than"),
        ((moments, 70.0, 50.0, 0.35, {"somersaults": 1.5, "twists": 0.5}), "turns each time|does not circle"),
        ((moments, 0.01, 500.0, 0.3, good), "circle"),
    ):
        with pytest.raises(TrajectoryError, match=words):
            rotor_dive(*arguments[:4], **arguments[4])
    with pytest.raises(TrajectoryError, match="momentum"):
        rotor_dive_lasting(moments, 1.5, 5000.0, 0.3, somersaults=1.5, twists=2.0)
    with pytest.raises(TrajectoryError, match="possible"):
        tilt_of_ratio(moments, 0.01)
    with pytest.raises(ShapeError, match="dive"):
        dive_of(DIVES[0]).attitude(9.0)
