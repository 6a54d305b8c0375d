"""Wheels whose momentum or speed is given in time: against MuJoCo's momenta and against the same wheel as a joint."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError
from support import mujoco_momenta
from support.independent import FourierLoop, apart, random_rotation, random_vector
from support.random_chains import wheel_chain

DURATION = 1.5
TIMES = np.linspace(0.0, DURATION, 7)
JOINTS = ["j0", "j1"]


def loop_of(seed):
    rng = np.random.default_rng([11, seed])
    cosines, sines = rng.uniform(-0.4, 0.4, (2, 2, 2)) / np.arange(1, 3)
    return FourierLoop(rng.uniform(-0.3, 0.3, 2), cosines, sines, DURATION)


def fourier(loop, names=JOINTS):
    return sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=names)


def value(t):
    """A wheel that runs up and down again, in any unit."""
    return 1.2 + 0.8 * np.sin(2.0 * np.pi * t / DURATION) - 0.3 * np.cos(4.0 * np.pi * t / DURATION)


SERIES = sp.ShapePath.fourier([1.2], [[0.0, -0.3]], [[0.8, 0.0]], DURATION)
KNOTS = np.linspace(0.0, DURATION, 401)


def as_function(times):
    step = 1e-5
    return value(times)[:, None], ((value(times + step) - value(times - step)) / (2.0 * step))[:, None]


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    file = tmp_path_factory.mktemp("body") / "wheel.urdf"
    file.write_text(wheel_chain(2).urdf)
    return sp.load_body(file)


@pytest.mark.parametrize("given", [SERIES, (KNOTS, value(KNOTS))], ids=["series", "samples"])
@pytest.mark.parametrize("kind", ["rotors", "rotor_speeds"])
def test_a_wheel_given_in_time_turns_the_body_as_mujocos_momenta_do(body, kind, given):
    momentum, start, loop = random_vector(2, 0.5), random_rotation(2), loop_of(2)
    size = 1.0 if kind == "rotors" else 20.0  # 20 rad/s of 0.05 kg m^2 store 1 kg m^2/s
    if kind == "rotor_speeds":
        given = (given[0], size * given[1]) if isinstance(given, tuple) else sp.ShapePath.fourier(
            [size * 1.2], [[0.0, -0.3 * size]], [[0.8 * size, 0.0]], DURATION
        )  # fmt: skip
    deformation = sp.articulated(body, fourier(loop), **{kind: {"j2": given}})
    motion = sp.reconstruct(deformation, momentum, start, tolerance=1e-10)
    reference = mujoco_momenta.attitudes(
        wheel_chain(2).mjcf, loop, JOINTS, momentum, start, TIMES,
        **{"momenta" if kind == "rotors" else "speeds": {"j2": lambda t: size * value(t)}},
    )  # fmt: skip
    assert apart(motion.attitude(TIMES), reference) < 1e-8
    even = sp.articulated(body, fourier(loop), **{kind: {"j2": 1.2 * size}})
    assert apart(sp.reconstruct(even, momentum, start).attitude(TIMES), reference) > 0.05, "its change must matter"


def test_stored_momentum_speeds_and_energy_follow_the_value_in_time(body):
    loop = loop_of(2)
    kept, held = (sp.articulated(body, fourier(loop), **{kind: {"j2": SERIES}}) for kind in ("rotors", "rotor_speeds"))
    times = np.linspace(0.0, DURATION, 11)
    axle = np.array([0.48, 0.6, 0.64])
    for deformation, size in ((kept, 1.0), (held, 0.05)):
        turned = deformation.description.link_frames(times, "l3")[0]
        np.testing.assert_allclose(
            deformation.stored_momentum(times), size * value(times)[:, None] * (turned @ axle), rtol=0, atol=1e-12
        )
    motion = sp.reconstruct(held, [0.1, 0.2, -0.3])
    np.testing.assert_allclose(sp.dynamics.wheel_speeds(motion, times)[:, 0], value(times), rtol=0, atol=1e-12)
    # Absolute momentum of a kept wheel, from its speed and the turn of the wheel in space.
    moved = sp.reconstruct(kept, [0.1, 0.2, -0.3])
    turns, spin = kept.description.link_frames(times, "l3")
    along = np.sum((turns @ axle) * (moved.angular_velocity(times) + spin), axis=-1)
    spins = sp.dynamics.wheel_speeds(moved, times)[:, 0]
    np.testing.assert_allclose(0.05 * (along + spins), value(times), rtol=0, atol=1e-12)
    # The whole path, with the wheel's speed in it, has the same energy.
    for k in (0, 3, 7):
        shape, rate = body.shape(), np.zeros(body.n_shape)
        for name, q, v in zip(JOINTS, loop.shape(times[k]), loop.rate(times[k]), strict=True):
            shape[body.joint_index(name)], rate[body.joint_index(name)] = q, v
        shape[body.joint_index("j2")], rate[body.joint_index("j2")] = 0.7, value(times[k])
        omega = motion.angular_velocity(times[k])
        whole = body.kinetic_energy(shape[None], rate[None], omega[None, None])
        assert held.kinetic_energy(times[k], omega) == pytest.approx(float(whole[0, 0]), rel=1e-12)


def test_a_value_by_a_function_is_scanned_and_one_by_samples_brings_its_breaks(body):
    path = fourier(loop_of(2))
    by_series = sp.articulated(body, path, rotors={"j2": SERIES})
    assert by_series.scan is None
    assert by_series.breaks.tolist() == [0.0, DURATION]
    by_samples = sp.articulated(body, path, rotors={"j2": (KNOTS + 3.0, value(KNOTS))})
    np.testing.assert_allclose(by_samples.breaks, KNOTS, rtol=0, atol=1e-14)
    function = sp.articulated(body, path, rotors={"j2": sp.ShapePath.function(as_function, DURATION)})
    assert function.scan is not None
    ends = [sp.reconstruct(one, [0.1, 0.0, 0.2]).final_attitude for one in (by_series, by_samples, function)]
    assert apart(ends[0], ends[1]) < 1e-8
    assert apart(ends[0], ends[2]) < 2e-9
    again = pickle.loads(pickle.dumps(copy.deepcopy(by_samples)))
    np.testing.assert_array_equal(sp.reconstruct(again, [0.1, 0.0, 0.2]).final_attitude, ends[1])


def test_loops_of_the_joints_stay_loops_only_where_the_wheel_repeats_too(body):
    twice = fourier(loop_of(2)).repeated(2)
    assert sp.articulated(body, twice, rotors={"j2": 1.0}).loops == 2
    assert sp.articulated(body, twice, rotors={"j2": SERIES.repeated(2)}).loops == 2
    ramp = sp.ShapePath.waypoints([0.0, 2 * DURATION], [[0.0], [2.0]])
    once = sp.articulated(body, twice, rotors={"j2": ramp})
    assert once.loops == 1
    motion = sp.reconstruct(once, [0.1, 0.0, 0.2], tolerance=1e-10)
    checked = sp.reconstruct(once, [0.1, 0.0, 0.2], method="dop853")
    assert apart(motion.final_attitude, checked.final_attitude) < 1e-8


def test_wrong_values_in_time_are_refused(body):
    path = fourier(loop_of(2))
    for wrong, words, kind in (
        ((KNOTS, np.append(KNOTS, 1.0)), "rotors, j2: as many values as times", ShapeError),
        ((2.0 * KNOTS, KNOTS), "last 3 s, the path 1.5 s", TrajectoryError),
        ((KNOTS[::-1], KNOTS), "ascend|increas", TrajectoryError),
        ((KNOTS, np.full(401, np.nan)), "rotors, j2: values", ShapeError),
        (fourier(loop_of(2)), "one column", ShapeError),
        ([1.0, 2.0], "a pair of times and values", ShapeError),
        ("fast", "rotors, j2", ShapeError),
        (None, "rotors, j2", ShapeError),
    ):
        with pytest.raises(kind, match=words):
            sp.articulated(body, path, rotors={"j2": wrong})
