"""Designs: hidden members are found, their phases hold by another integrator, and what is excluded is not there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shapephase as sp
from shapephase import so3
from shapephase.errors import DesignNotFound, ShapeError, WrongObjectError
from shapephase.examples import dipole_antenna, furniture, homothety, printed_antenna, pulsation
from support.long_runs import full_but

TOLERANCE = 1e-9
DOP853_ERROR = 1e-10  # at the tolerances below, over a few turns


def antenna(x):
    return dipole_antenna(3, tip_mass=0.3, reach=1.2, extension_time=x[0], coast=10.0 - x[0]).deformation


def printed(x):
    return printed_antenna(3, extension_time=x[0], coast=8.0 - x[0]).deformation


def walk(x):
    return furniture(20.0, radius=x[0], height=0.7).deformation


def longer_walk(x):
    return furniture(x[2], radius=x[0], height=x[1]).deformation


def stretch(x):
    return homothety(pulsation(x[0], x[1]), duration=4.0).deformation


def pulse(x):
    return sp.prescribed(
        lambda t: np.stack([0.0 * t + 1.0, 0.0 * t + 1.5, 2.0 + x[0] * np.sin(x[1] * t)], -1)[:, :, None] * np.eye(3),
        None,
        6.0,
    )


FAMILIES = {
    "antenna": (antenna, [0.3, 0.4, 0.9], [[1.0, 8.0]], ("theta", "dynamic")),
    "walk": (walk, [8.0, 0.0, 30.0], [[0.5, 2.5]], ("theta", "dynamic")),
    "stretch": (stretch, [0.6, 0.5, 3.0], [[0.1, 0.8], [1.5, 5.0]], ("theta", "dynamic")),
    "longer walk": (longer_walk, [8.0, 0.0, 30.0], [[0.5, 2.5], [-1.0, 1.0], [10.0, 30.0]], ("theta", "attitude")),
}


def phases_by_dop853(deformation, momentum):
    """Dynamic and Montgomery phase in the horizontal gauge, and the attitude, from SciPy and quadrature alone."""
    length = np.linalg.norm(momentum)

    def rate(t, state):
        attitude, lift = state[:9].reshape(3, 3), state[9:18].reshape(3, 3)
        inertia, internal = deformation.inertia(t), deformation.internal_momentum(t)
        pi = attitude.T @ momentum
        drift, spin = np.linalg.solve(inertia, internal), np.linalg.solve(inertia, pi)
        seen = lift @ pi / length
        turning = lift @ np.cross(pi, spin) / length
        area = np.cross(seen, turning)[2] / (1.0 + seen[2])
        return np.concatenate(
            [
                (attitude @ so3.hat(spin - drift)).ravel(),
                (lift @ so3.hat(-drift)).ravel(),
                [pi @ spin / length, area],
            ]
        )

    state = np.concatenate([np.eye(3).ravel(), np.eye(3).ravel(), np.zeros(2)])
    for begin, end in zip(deformation.breaks[:-1], deformation.breaks[1:], strict=True):
        inside = 1e-13 * (end - begin)
        state = solve_ivp(rate, (begin + inside, end - inside), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    attitude, lift = state[:9].reshape(3, 3), state[9:18].reshape(3, 3)
    first, last, pole = momentum / length, lift @ attitude.T @ momentum / length, np.array([0.0, 0.0, 1.0])
    triangle = 2.0 * np.arctan2(np.linalg.det([pole, last, first]), 1.0 + pole @ last + last @ first + first @ pole)
    return state[18], state[18] - (state[19] + triangle), attitude


def goal_and_design(name, seed):
    """A goal that a hidden member meets, and its design."""
    family, momentum, box, goals = FAMILIES[name]
    rng = np.random.default_rng(seed)
    goal, (low, high) = goals[seed % len(goals)], np.transpose(box)
    motion = sp.reconstruct(family(low + rng.random(len(box)) * (high - low)), momentum, tolerance=1e-11)
    parts = sp.split(motion)
    wanted = {"theta": parts.montgomery_phase, "dynamic": parts.dynamic_phase, "attitude": motion.final_attitude}[goal]
    return goal, wanted, sp.design(family, momentum, box, **{goal: wanted})


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.full) for k in range(2, 13))])
def test_a_member_that_is_there_is_found(name, seed):
    """To 1e-9 rad by the library, and by another integrator."""
    goal, wanted, found = goal_and_design(name, seed)
    again = sp.reconstruct(FAMILIES[name][0](found.parameters), FAMILIES[name][1], tolerance=1e-11)
    dynamic, theta, attitude = phases_by_dop853(found.deformation, np.array(FAMILIES[name][1]))
    both = {
        "theta": (sp.split(again).montgomery_phase, theta),
        "dynamic": (sp.split(again).dynamic_phase, dynamic),
        "attitude": (again.final_attitude, attitude),
    }[goal]
    for value, allowed in zip(both, (TOLERANCE + found.error + 1e-11, TOLERANCE + DOP853_ERROR), strict=True):
        if goal == "attitude":
            gap = so3.angle(value @ wanted.T)
        else:
            gap = abs(so3.wrap(value - wanted) if goal == "theta" else value - wanted)
        assert gap <= allowed
    assert found.miss <= TOLERANCE


@pytest.mark.parametrize("theta", full_but([3.9, 4.2, 5.5], 5.5))
def test_a_phase_that_no_member_has_is_excluded(theta):
    """The boxes cover the family, and no member of one comes as near as it says."""
    momentum = [0.3, 0.4, 0.9]
    with pytest.raises(DesignNotFound, match="exclude all") as refused:
        sp.design(printed, momentum, [[1.0, 7.0]], theta=theta)
    cover = refused.value.cover
    ends = cover.boxes[np.argsort(cover.boxes[:, 0, 0]), 0]
    assert ends[0, 0] == 1.0
    assert ends[-1, 1] == 7.0
    assert np.array_equal(ends[1:, 0], ends[:-1, 1])
    assert np.all(cover.least > 0.0)
    rng = np.random.default_rng(3)
    for k in rng.choice(len(cover.least), 8):
        for x in (*cover.boxes[k, 0], rng.uniform(*cover.boxes[k, 0])):
            phase = sp.split(sp.reconstruct(printed([x]), momentum)).montgomery_phase
            assert abs(so3.wrap(phase - theta)) >= cover.least[k] - TOLERANCE
    assert refused.value.best.miss >= cover.least.min()


def test_a_regime_is_certified_with_the_widest_margin():
    """No member of a grid has a wider one; the opposite regime is excluded by the energy at the start."""
    momentum, box = [1.0, 0.2, 1.07], [[-0.45, 0.45], [0.5, 2.0]]
    found = sp.design(pulse, momentum, box, regime="about axis 1")
    assert found.certificate.regime == "about axis 1"
    grid = [(a, b) for a in np.linspace(*box[0], 5) for b in np.linspace(*box[1], 4)]
    margins = []
    for x in grid:
        motion = sp.reconstruct(pulse(x), momentum)
        times = motion.solution.times
        above = sp.bounds.energy_along(motion, times)
        above = above - sp.bounds.homoclinic_energy(motion.deformation, times, np.linalg.norm(momentum))
        margins.append(above.min())
    assert found.certificate.margin >= max(margins) - 2e-4  # the certificate's enclosures are that much wider
    with pytest.raises(DesignNotFound, match="exclude all") as refused:
        sp.design(pulse, momentum, box, regime="about axis 3")
    # At the start the shape is the same for all: the energy is above the homoclinic one by this much.
    energy = sp.bounds.momentum_energy(np.diag([1.0, 1.5, 2.0]), momentum) - np.dot(momentum, momentum) / 3.0
    assert refused.value.cover.least.min() == pytest.approx(energy, rel=1e-9)


def test_two_goals_hold_together():
    """Phase and regime of one member."""
    momentum = [1.0, 0.2, 1.07]
    theta = sp.split(sp.reconstruct(pulse([-0.2, 0.8]), momentum)).montgomery_phase
    found = sp.design(pulse, momentum, [[-0.45, 0.45], [0.5, 2.0]], theta=theta, regime="about axis 1")
    assert abs(so3.wrap(found.phases.montgomery_phase - theta)) <= TOLERANCE
    assert found.certificate.certain


def test_where_nothing_is_shown_the_message_says_so():
    """Too few members: there may be one."""
    with pytest.raises(DesignNotFound, match="there may be one") as refused:
        sp.design(printed, [0.3, 0.4, 0.9], [[1.0, 7.0]], theta=5.5, members=12)
    assert refused.value.cover is None
    assert refused.value.best.members == 12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"theta": None}, "a goal is needed"),
        ({"box": [[2.0, 1.0]]}, "box"),
        ({"start": [9.0]}, "start"),
        ({"momentum": [0.0, 0.0, 0.0]}, "momentum"),
        ({"momentum": np.ones((2, 3))}, "momentum"),
        ({"regime": "about axis 2"}, "regime"),
        ({"gauge": "principal"}, "gauge"),
        ({"theta": np.nan}, "theta"),
    ],
)
def test_what_makes_no_sense_is_refused(change, message):
    """The message names the argument."""
    given = {"family": printed, "momentum": [0.3, 0.4, 0.9], "box": [[1.0, 7.0]], "theta": 4.1} | change
    with pytest.raises((ShapeError, sp.errors.UnknownNameError), match=message):
        sp.design(given.pop("family"), given.pop("momentum"), given.pop("box"), **given)


def test_a_family_returns_deformations():
    """Not a motion, and it is a function."""
    with pytest.raises(WrongObjectError, match="Deformation"):
        sp.design(lambda x: x, [0.3, 0.4, 0.9], [[1.0, 7.0]], theta=4.1)
    with pytest.raises(WrongObjectError, match="family"):
        sp.design(3.0, [0.3, 0.4, 0.9], [[1.0, 7.0]], theta=4.1)
