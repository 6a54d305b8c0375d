"""Exports of a satellite with a wheel left out of its path: in MuJoCo, in Pinocchio, and in tables as they are read."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from support.independent import body_of, free_flyer_model, mujoco_model, random_loop, random_rotation

TIMES = np.linspace(0.0, 2.0, 41)
MOMENTUM = np.array([3.0, -1.0, 2.0])
WHEEL = "wheel_spin"


IN_TIME = (np.linspace(0.0, 2.0, 6), [30.0, 10.0, -5.0, 0.0, 12.0, 20.0])


@pytest.fixture(scope="module", params=[("rotors", 30.0), ("rotor_speeds", 30.0), ("rotor_speeds", IN_TIME)])
def motion(request):
    body = body_of("satellite")
    others = [name for name in body.joint_names if name != WHEEL]
    loop = random_loop(91, len(others))
    middle = np.where(np.array(others) == "boom_extension", 0.9, loop.mean)
    path = sp.ShapePath.fourier(middle, loop.cosines, loop.sines, loop.duration, joint_names=others)
    kind, value = request.param
    deformation = sp.articulated(body, path, **{kind: {WHEEL: value}})
    return sp.reconstruct(deformation, MOMENTUM, random_rotation(92))


@pytest.fixture(scope="module")
def angles(motion):
    """Integrals of the wheel's speed by 100 Gauss points on each tenth of the way from the start to each time."""
    places, weights = np.polynomial.legendre.leggauss(100)
    parts = (np.arange(10)[:, None] + 0.5 * (1.0 + places)).ravel() / 10.0
    speeds = sp.dynamics.wheel_speeds(motion, TIMES[:, None] * parts)[..., 0]
    return TIMES * (speeds @ np.tile(weights, 10)) / 20.0


def test_mujoco_finds_the_momentum_and_the_wheel_turned_by_its_speed(motion, angles):
    import mujoco

    model = mujoco_model("satellite")
    found = sp.exports.mujoco_arrays(motion, TIMES, model=model)
    data, wheel = mujoco.MjData(model), found.joint_names.index(WHEEL)
    np.testing.assert_allclose(found.qpos[:, 7 + wheel], angles, rtol=0, atol=1e-9)
    for qpos, qvel in zip(found.qpos, found.qvel, strict=True):
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        np.testing.assert_allclose(data.subtree_angmom[1], MOMENTUM, rtol=0, atol=1e-10)


def test_pinocchio_needs_no_force_on_the_base_and_the_torques_of_the_joints(motion):
    model = free_flyer_model("satellite").copy()
    model.gravity.linear = np.zeros(3)
    data, torques = model.createData(), sp.joint_torques(motion, TIMES)
    found = sp.exports.pinocchio_arrays(motion, TIMES, model=model)
    order = [found.joint_names.index(name) for name in body_of("satellite").joint_names]
    for row, state in enumerate(zip(found.q, found.v, found.a, strict=True)):
        efforts = pin.rnea(model, data, *state)
        size = np.abs(efforts).max()
        np.testing.assert_allclose(efforts[:6], 0.0, rtol=0, atol=1e-10 * size)
        np.testing.assert_allclose(efforts[6:][order], torques.torque[row], rtol=0, atol=1e-10 * size)


def test_tables_have_angle_and_speed_of_the_wheel_and_are_read(motion, angles, tmp_path):
    sp.export_motion(motion, tmp_path / "motion.csv", TIMES)
    header = (tmp_path / "motion.csv").read_text().splitlines()[0].split(",")
    columns = np.loadtxt(tmp_path / "motion.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(columns[:, header.index(f"{WHEEL} [rad]")], angles, rtol=0, atol=1e-9)
    speeds = sp.dynamics.wheel_speeds(motion, TIMES)
    np.testing.assert_array_equal(columns[:, [header.index(f"{WHEEL}_speed_rad_s")]], speeds)
    data = motion.to_xarray(TIMES)
    np.testing.assert_array_equal(data.wheel_speeds.sel(wheel=WHEEL), speeds[:, 0])
    recorded = sp.read_recorded_motion(tmp_path / "motion.csv", body_of("satellite"))
    assert recorded.path.joint_names == body_of("satellite").joint_names
    np.testing.assert_allclose(recorded.base_attitude, motion.attitude(TIMES), rtol=0, atol=1e-14)
