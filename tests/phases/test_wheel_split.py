"""Turns of bodies with wheels: the shape's part at any pace, and the parts of stored and of total momentum."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from support import mujoco_momenta
from support.independent import FourierLoop, apart, random_rotation, random_vector
from support.random_chains import wheel_chain

JOINTS = ["j0", "j1"]
STORED = 1.3


def loop_of(duration):
    rng = np.random.default_rng([11, 2])
    cosines, sines = rng.uniform(-0.4, 0.4, (2, 2, 2)) / np.arange(1, 3)
    return FourierLoop(rng.uniform(-0.3, 0.3, 2), cosines, sines, duration)


def fourier(loop):
    return sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=JOINTS)


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    file = tmp_path_factory.mktemp("body") / "wheel.urdf"
    file.write_text(wheel_chain(2).urdf)
    return sp.load_body(file)


@pytest.mark.parametrize("kind", ["rotors", "rotor_speeds"])
@pytest.mark.parametrize("size", [0.0, 0.5])
def test_at_three_paces_the_holonomy_is_one_and_the_stored_part_grows(body, kind, size):
    momentum, start = size * random_vector(2, 1.0), random_rotation(2)
    value = 0.05 if kind == "rotors" else 1.0  # 1 rad/s of 0.05 kg m^2
    splits = []
    for duration in (1.0, 2.0, 4.0):
        deformation = sp.articulated(body, fourier(loop_of(duration)), **{kind: {"j2": value}})
        splits.append(sp.split(sp.reconstruct(deformation, momentum, start, tolerance=1e-11)))
    for found in splits[1:]:
        assert apart(found.holonomy, splits[0].holonomy) < 1e-9
    turns = [float(so3.angle(found.wheel_rotation)) for found in splits]
    assert turns[1] == pytest.approx(2.0 * turns[0], rel=0.2)
    assert turns[2] == pytest.approx(4.0 * turns[0], rel=0.3)
    for found in splits:
        product = found.momentum_rotation @ found.wheel_rotation @ found.holonomy
        assert apart(product, found.total_rotation) < 1e-14 + (size == 0.0) * 1e-10
        if size == 0.0:
            np.testing.assert_array_equal(found.momentum_rotation, np.eye(3))
            assert found.error_estimates.momentum_rotation == 0.0


@pytest.mark.parametrize("in_time", [False, True])
def test_each_part_is_a_simulation_with_the_rest_left_out(body, in_time):
    """The holonomy by MuJoCo with nothing stored, both parts by what stored and total momentum change there."""
    loop, momentum, start = loop_of(1.5), random_vector(2, 0.5), random_rotation(2)
    series = sp.ShapePath.fourier([STORED], [[0.4]], [[0.2]], 1.5)

    def stored(t):
        return STORED + in_time * (0.4 * np.cos(2 * np.pi * t / 1.5) + 0.2 * np.sin(2 * np.pi * t / 1.5))

    def turn(size, wheel):
        end = mujoco_momenta.attitudes(
            wheel_chain(2).mjcf, loop, JOINTS, size * momentum, start, np.array([0.0, 1.5]), momenta={"j2": wheel}
        )
        return end[-1] @ start.T

    shape, with_wheel, whole = turn(0.0, lambda _t: 0.0), turn(0.0, stored), turn(1.0, stored)
    deformation = sp.articulated(body, fourier(loop), rotors={"j2": series if in_time else STORED})
    found = sp.split(sp.reconstruct(deformation, momentum, start, tolerance=1e-10))
    assert apart(found.holonomy, shape) < 1e-8
    assert apart(found.wheel_rotation, with_wheel @ shape.T) < 1e-8
    assert apart(found.momentum_rotation, whole @ with_wheel.T) < 1e-8
    assert min(so3.angle(turned) for turned in (shape, found.wheel_rotation, found.momentum_rotation)) > 0.05


@pytest.mark.parametrize("size", [0.0, 0.5])
def test_error_estimates_hold_for_every_part(body, size):
    times = np.linspace(0.0, 1.5, 40)
    value = (times, STORED + 0.5 * np.sin(2.0 * np.pi * times / 1.5))
    deformation = sp.articulated(body, fourier(loop_of(1.5)), rotors={"j2": value})
    loose, tight = (
        sp.split(sp.reconstruct(deformation, size * random_vector(2, 1.0), tolerance=goal)) for goal in (1e-5, 1e-12)
    )
    for field in fields(loose.error_estimates):
        if field.name.endswith("_rotation") or field.name == "holonomy":
            off = apart(getattr(loose, field.name), getattr(tight, field.name))
            allowed = getattr(loose.error_estimates, field.name) + getattr(tight.error_estimates, field.name)
            assert off <= allowed < 1e-4


def test_the_table_names_each_part_and_what_depends_on_the_pace(body):
    deformation = sp.articulated(body, fourier(loop_of(1.5)), rotors={"j2": STORED})
    without, with_momentum = (sp.split(sp.reconstruct(deformation, m)) for m in ([0.0, 0.0, 0.0], [0.1, 0.0, 0.2]))
    for found in (without, with_momentum):
        text = " ".join(str(found).split())
        assert "the shape alone turns the body" not in text
        assert f"stored wheel momentum {np.degrees(so3.angle(found.wheel_rotation)):.6f}" in text
        assert "The holonomy is the same at any pace" in text
        assert found.to_dict()["momentum_rotation"] == found.momentum_rotation.tolist()
    assert "total momentum 0" not in " ".join(str(without).split())
    turned = np.degrees(so3.angle(with_momentum.momentum_rotation))
    assert f"total momentum {turned:.6f}" in " ".join(str(with_momentum).split())
    assert "stored wheel momentum" in repr(with_momentum)


@pytest.mark.full
def test_a_minute_of_samples_is_split(body):
    """More steps than a frame may add by turning fast: 6,001 samples, as a log at 100 Hz has them."""
    times, loop = np.linspace(0.0, 60.0, 6001), loop_of(60.0)
    path = sp.ShapePath.spline(times, loop.at(times)[0], joint_names=JOINTS)
    smooth, sampled = (
        sp.split(sp.reconstruct(sp.articulated(body, route, rotor_speeds={"j2": 0.1}), [0.0, 0.1, 0.2]))
        for route in (fourier(loop), path)
    )
    assert apart(sampled.holonomy, smooth.holonomy) < 1e-9
    assert float(sampled.montgomery_phase) == pytest.approx(float(smooth.montgomery_phase), abs=1e-8)
