"""A wheel taken out of a link: the whole stays as it was, and turns as MuJoCo and the closed gyrostat have it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from support import mujoco_momenta
from support.ball_bodies import BALLS
from support.bodies import random_shapes
from support.independent import FourierLoop, apart, random_rotation, random_vector
from support.random_chains import random_chain

AXIS = np.array([0.48, 0.6, 0.64])


@pytest.mark.parametrize(
    ("name", "link", "size"), [("cat", None, 1e-5), ("satellite", None, 0.5), ("cat", "trunk_rear", 1e-5)]
)
def test_a_wheel_changes_neither_mass_nor_locked_inertia(name, link, size):
    body = sp.load_body(name)
    wheeled = body.with_wheel(2.0 * AXIS, size, link=link)
    assert wheeled.joint_names == (*body.joint_names, "wheel_1")
    assert wheeled.continuous[-1]
    assert wheeled.mass == pytest.approx(body.mass, rel=1e-14)
    shapes = random_shapes(body, np.random.default_rng(3), 5)
    spun = np.column_stack([shapes, [0.0, 1.0, -2.0, 5.0, 100.0]])
    inertia = body.locked_inertia(shapes)
    np.testing.assert_allclose(wheeled.locked_inertia(spun), inertia, rtol=0, atol=1e-13 * inertia.max())
    np.testing.assert_allclose(wheeled.centre_of_mass(spun), body.centre_of_mass(shapes), rtol=0, atol=1e-14)
    matrix = wheeled.momentum_matrix(spun)
    scale = np.abs(matrix).max()
    np.testing.assert_allclose(matrix[..., :-1], body.momentum_matrix(shapes), rtol=0, atol=1e-13 * scale)
    carrier = body.link_names[0] if link is None else link
    turned = body.link_pose(shapes, carrier)[:, :3, :3] @ AXIS
    np.testing.assert_allclose(matrix[..., -1], size * turned, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(
        wheeled.link_pose(spun[:1], "wheel_1")[0, :3, :3], body.link_pose(shapes[:1], carrier)[0, :3, :3], atol=1e-14
    )


@pytest.mark.parametrize("link", [0, 2])
def test_a_body_with_a_wheel_turns_as_mujocos_momenta_do(tmp_path, link):
    """MuJoCo is given the wheel as one more link, with inertias taken apart here."""
    chain, size = random_chain(1), 0.02
    wheel = 0.5 * size * (np.eye(3) + np.outer(AXIS, AXIS))
    inertias = chain.inertias.copy()
    inertias[link] -= wheel
    masses = np.append(chain.masses, 0.3)
    masses[link] -= 0.3
    count = len(chain.parents)
    apart_chain = replace(
        chain,
        parents=(*chain.parents, link),
        kinds=(*chain.kinds, "continuous"),
        axes=np.array([*chain.axes, AXIS]),
        places=np.array([*chain.places, chain.centres[link]]),
        turns=np.array([*chain.turns, np.zeros(3)]),
        masses=masses,
        centres=np.array([*chain.centres, np.zeros(3)]),
        inertias=np.array([*inertias, wheel]),
    )
    file = tmp_path / "body.urdf"
    file.write_text(chain.urdf)
    body = sp.load_body(file).with_wheel(AXIS, size, name="rw", link=f"l{link}")
    rng = np.random.default_rng(5)
    cosines, sines = rng.uniform(-0.3, 0.3, (2, count, 2))
    loop = FourierLoop(rng.uniform(-0.3, 0.3, count), cosines, sines, 1.2)
    path = sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=chain.names)
    momentum, start, times = random_vector(4, 0.4), random_rotation(4), np.linspace(0.0, 1.2, 4)
    for kind, options, value in (("momenta", "rotors", 0.7), ("speeds", "rotor_speeds", 35.0)):
        motion = sp.reconstruct(sp.articulated(body, path, **{options: {"rw": value}}), momentum, start)
        reference = mujoco_momenta.attitudes(
            apart_chain.mjcf, loop, chain.names, momentum, start, times, **{kind: {f"j{count}": lambda _t, v=value: v}}
        )
        assert apart(motion.attitude(times), reference) < 1e-8
    still = sp.reconstruct(sp.articulated(body, path, rotor_speeds={"rw": 0.0}), momentum, start)
    assert apart(still.attitude(times), reference) > 0.1, "the wheel must matter"


@pytest.mark.parametrize("kind", ["rotors", "rotor_speeds"])
def test_a_wheel_in_a_rigid_body_is_the_closed_gyrostat(kind):
    satellite = sp.load_body("satellite")
    size, stored = 0.4, 1.7
    body = satellite.with_wheel(AXIS, size)
    rest = [name for name in body.joint_names if name != "wheel_1"]
    still = sp.ShapePath.waypoints([0.0, 30.0], np.zeros((2, len(rest))), joint_names=rest)
    value = stored if kind == "rotors" else stored / size
    momentum, start = np.array([0.9, -0.4, 1.1]), random_rotation(7)
    motion = sp.reconstruct(sp.articulated(body, still, **{kind: {"wheel_1": value}}), momentum, start)
    inertia = satellite.locked_inertia(satellite.shape())
    if kind == "rotors":
        inertia = inertia - size * np.outer(AXIS, AXIS)
    times = np.linspace(0.0, 30.0, 9)
    closed = sp.Gyrostat(inertia, stored * AXIS, momentum, start).attitude(times)
    assert apart(motion.attitude(times), closed) < 1e-8


def test_what_is_left_of_the_link_can_exist_up_to_the_wheel_that_the_error_names(tmp_path):
    file = tmp_path / "body.urdf"
    file.write_text(random_chain(3).urdf)
    body = sp.load_body(file)
    with pytest.raises(ShapeError, match="can hold; up to") as refused:
        body.with_wheel(AXIS, 1.0)
    largest = float(re.search(r"up to (\S+) kg", str(refused.value)).group(1))
    with pytest.raises(ShapeError, match="can hold"):
        body.with_wheel(AXIS, 1.001 * largest)
    base, *_, wheel = body.with_wheel(AXIS, 0.999 * largest).moving_parts
    for part in (base, wheel):
        moments = np.linalg.eigvalsh(part.inertia)
        assert moments[2] <= (moments[0] + moments[1]) * (1.0 + 1e-12)
        assert part.mass > 0.0
    # The largest leaves nothing of the second moment in some direction.
    moments = np.linalg.eigvalsh(base.inertia)
    assert moments[2] > 0.99 * (moments[0] + moments[1])


def test_a_wheel_turns_on_a_body_with_ball_joints(tmp_path):
    file = tmp_path / "balls.urdf"
    file.write_text(BALLS)
    balls = sp.load_body(file)
    body = balls.with_wheel(AXIS, 1e-3)
    still = sp.ShapePath.waypoints([0.0, 1.0], np.tile(balls.shape(), (2, 1)), joint_names=balls.joint_names)
    stored = sp.articulated(body, still, rotors={"wheel_1": 0.2}).stored_momentum(0.5)
    np.testing.assert_allclose(stored, 0.2 * AXIS, rtol=0, atol=1e-15)


def test_wrong_wheels_are_refused():
    cat = sp.load_body("cat_two_halves")
    for axis, size, options, words, kind in (
        ([0.0, 0.0, 0.0], 1e-3, {}, "zero", ShapeError),
        ([0.0, 1.0], 1e-3, {}, "axis", ShapeError),
        (AXIS, -1.0, {}, "above 0", TrajectoryError),
        (AXIS, np.nan, {}, "inertia", ShapeError),
        (AXIS, 1e-3, {"link": "tail"}, "tail", UnknownNameError),
        (AXIS, 1e-3, {"name": "waist_yaw"}, "waist_yaw", ShapeError),
        (AXIS, 1e-3, {"name": ""}, "name", ShapeError),
    ):
        with pytest.raises(kind, match=words):
            cat.with_wheel(axis, size, **options)
    with pytest.raises(ShapeError, match="wheel_1"):
        cat.with_wheel(AXIS, 1e-4).with_wheel(AXIS, 1e-4)
