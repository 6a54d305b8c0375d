"""Exported vectors in the simulators themselves: their momenta, inverse dynamics and differences of configurations."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, UnknownNameError, WrongObjectError
from support.independent import (
    BODIES,
    apart,
    body_of,
    free_flyer_model,
    mujoco_model,
    random_loop,
    random_rotation,
    random_vector,
)
from support.long_runs import full_but

TIMES = np.linspace(0.0, 2.0, 7)
FALL = {"start": [0.5, -0.2, 3.0], "velocity": [1.0, 0.3, 2.0], "gravity": [0.1, 0.0, -9.81]}
EPS = np.finfo(float).eps


@cache
def motion_of(name: str) -> sp.Motion:
    """A satellite among them, one of whose joints slides while another turns without end."""
    body = body_of(name)
    momentum, attitude = random_vector(61, BODIES[name]), random_rotation(62)
    return sp.reconstruct(sp.articulated(body, random_loop(63, body.n_shape).path), momentum, attitude)


def centre(t: float) -> np.ndarray:
    start, velocity, gravity = (np.array(FALL[name]) for name in ("start", "velocity", "gravity"))
    return start + velocity * t + 0.5 * gravity * t**2


@pytest.mark.parametrize("name", full_but(BODIES, "satellite", "cat"))
def test_mujoco_finds_the_momentum_and_the_fall_in_qpos_and_qvel(name):
    """Its own sums over the links, at the arrays as they are; joints in the order of its model."""
    import mujoco

    motion, model = motion_of(name), mujoco_model(name)
    found = sp.exports.mujoco_arrays(motion, TIMES, model=model, **FALL)
    data = mujoco.MjData(model)
    scale = np.linalg.norm(motion.momentum)
    for t, qpos, qvel in zip(TIMES, found.qpos, found.qvel, strict=True):
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        np.testing.assert_allclose(data.subtree_com[1], centre(t), rtol=0, atol=1e-12)
        speed = np.array(FALL["velocity"]) + t * np.array(FALL["gravity"])
        np.testing.assert_allclose(data.subtree_linvel[1], speed, rtol=0, atol=1e-11)
        np.testing.assert_allclose(data.subtree_angmom[1], motion.momentum, rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("name", full_but(BODIES, "satellite", "cat"))
def test_pinocchio_needs_no_force_on_the_base(name):
    """Newton and Euler's equations at q, v, a, in the order of Pinocchio's own reader: gravity alone moves the base."""
    motion, model = motion_of(name), free_flyer_model(name).copy()
    model.gravity.linear = np.array(FALL["gravity"])
    data = model.createData()
    found = sp.exports.pinocchio_arrays(motion, TIMES, model=model, **FALL)
    for t, q, v, a in zip(TIMES, found.q, found.v, found.a, strict=True):
        efforts = pin.rnea(model, data, q, v, a)
        pin.computeCentroidalMomentum(model, data, q, v)
        scale = np.linalg.norm(efforts[6:]) + 9.81 * pin.computeTotalMass(model)
        np.testing.assert_allclose(efforts[:6], 0.0, rtol=0, atol=1e-10 * scale)
        np.testing.assert_allclose(data.com[0], centre(t), rtol=0, atol=1e-12)
        size = np.linalg.norm(motion.momentum)
        np.testing.assert_allclose(data.hg.angular, motion.momentum, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("name", ["satellite", "cat"])
def test_velocities_and_accelerations_are_the_rates_of_what_comes_before(name):
    """Central differences of order four, by Pinocchio's own difference of configurations."""
    motion, model = motion_of(name), free_flyer_model(name)
    step = 1e-3
    times = (TIMES[1:-1, None] + step * np.array([-2, -1, 0, 1, 2])).ravel()
    found = sp.exports.pinocchio_arrays(motion, times, model=model, **FALL)
    weights = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * step)
    for row in range(0, len(times), 5):
        here = row + 2
        ways = np.array([pin.difference(model, found.q[here], found.q[row + k]) for k in range(5)])
        np.testing.assert_allclose(weights @ ways, found.v[here], rtol=0, atol=1e-7 * np.abs(found.v).max())
        slopes = weights @ found.v[row : row + 5]
        np.testing.assert_allclose(slopes, found.a[here], rtol=0, atol=1e-7 * np.abs(found.a).max())


def test_both_have_the_same_base_and_the_order_of_their_program_without_a_model():
    motion = motion_of("satellite")
    ours, theirs = sp.exports.pinocchio_arrays(motion, **FALL), sp.exports.mujoco_arrays(motion, **FALL)
    assert ours.joint_names == body_of("satellite").joint_names
    compiled = mujoco_model("satellite")
    names = [compiled.joint(k).name for k in range(compiled.njnt)]
    assert list(theirs.joint_names) == [name for name in names if name in theirs.joint_names]
    np.testing.assert_array_equal(ours.q[:, :3], theirs.qpos[:, :3])
    np.testing.assert_array_equal(ours.q[:, 3:7], theirs.qpos[:, [4, 5, 6, 3]])
    np.testing.assert_array_equal(theirs.qpos[:, :3], motion.base_position(ours.time, **FALL))
    assert apart(sp.so3.matrix_from_quat(ours.q[:, 3:7]), motion.attitude(ours.time)) < 8 * EPS
    # One sign of the quaternions throughout, and the wheel as its cosine and sine.
    assert np.all(np.sum(ours.q[1:, 3:7] * ours.q[:-1, 3:7], axis=1) > 0.9)
    wheel = body_of("satellite").joint_index("wheel_spin")
    assert ours.q.shape[1] == theirs.qpos.shape[1] + np.count_nonzero(body_of("satellite").continuous)
    np.testing.assert_array_equal(
        theirs.qpos[:, 7 + theirs.joint_names.index("wheel_spin")],
        motion.deformation.description.path.shape(ours.time)[:, wheel],
    )


def test_another_gauge_is_the_same_motion():
    motion = motion_of("cat")
    turned = sp.mean_body_gauge(motion.deformation)
    frame = turned.frame(0.0)
    again = sp.reconstruct(turned, motion.momentum, motion.initial_attitude @ frame.T, tolerance=1e-11)
    ours, theirs = (sp.exports.pinocchio_arrays(one, TIMES) for one in (motion, again))
    for name in ("q", "v", "a"):
        size = np.abs(getattr(ours, name)).max()
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=0, atol=1e-7 * size)


def test_a_torque_from_outside_is_what_the_base_needs():
    body, push = body_of("cat"), np.array([0.02, -0.01, 0.03])
    deformation = sp.articulated(body, random_loop(63, body.n_shape).path)
    motion = sp.reconstruct(deformation, [0.0, 0.02, 0.0], torque=sp.ExternalTorque(lambda _: push))
    model = free_flyer_model("cat").copy()
    model.gravity.linear = np.zeros(3)
    found = sp.exports.pinocchio_arrays(motion, TIMES, model=model)
    for q, v, a in zip(found.q, found.v, found.a, strict=True):
        efforts = pin.rnea(model, model.createData(), q, v, a)
        # A torque alone would move the centre of mass not at all.
        np.testing.assert_allclose(efforts[3:6], push, rtol=0, atol=1e-9 * np.abs(efforts).max())


def test_models_of_other_bodies_are_refused():
    motion = motion_of("cat")
    with pytest.raises(UnknownNameError, match="joints"):
        sp.exports.mujoco_arrays(motion, model=mujoco_model("satellite"))
    with pytest.raises(UnknownNameError, match="joint"):
        sp.exports.pinocchio_arrays(motion, model=pin.Model())
    with pytest.raises(WrongObjectError, match="export"):
        sp.exports.pinocchio_arrays(sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0]))
    batch = sp.reconstruct(motion.deformation, np.zeros((2, 3)))
    with pytest.raises(ShapeError, match="batch"):
        sp.exports.mujoco_arrays(batch)
