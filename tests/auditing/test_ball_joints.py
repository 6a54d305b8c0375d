"""Audits of bodies with ball joints, of trajectories that MuJoCo simulates."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import UnknownNameError

mujoco = pytest.importorskip("mujoco")

MODEL = """<mujoco><option timestep="0.002" gravity="0 0 0" integrator="RK4"/><worldbody><body name="trunk"><freejoint/>
<geom type="box" size=".1 .05 .2" mass="3"/>
<body name="leg" pos="0 0 -.2"><joint name="knee" type="hinge" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".05" mass="2"/></body>
<body name="arm" pos=".1 0 .2"><joint name="shoulder" type="ball"/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/></body></body></worldbody></mujoco>"""
NAMES = ("shoulder", "knee")
"""In another order than the model's."""


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The body, times, qpos and qvel with the shoulder before the knee, quaternions with any sign."""
    file = tmp_path_factory.mktemp("ball") / "ball.xml"
    file.write_text(MODEL)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qvel[3:] = 2.0 * np.random.default_rng(1).standard_normal(model.nv - 3)
    times, places, rates = [], [], []
    for step in range(480):
        if step % 4 == 0:
            times.append(data.time)
            places.append(data.qpos[[*range(7), 8, 9, 10, 11, 7]])
            rates.append(data.qvel[[*range(6), 7, 8, 9, 6]])
        mujoco.mj_step(model, data)
    qpos = np.array(places)
    qpos[::3, 7:11] *= -1.0
    return sp.load_body(file), np.array(times), qpos, np.array(rates)


@pytest.mark.parametrize("rates", ["given", "of the samples"])
def test_what_mujoco_simulates_is_right_and_a_wrong_mass_is_found(flight, rates):
    """A fourth of the arm's mass too much: to have MuJoCo's, a fifth of it has to go."""
    body, times, qpos, qvel = flight
    given = qvel if rates == "given" else None
    run = sp.FloatingTrajectory.from_mujoco(body, times, qpos, given, joint_names=NAMES)
    assert sp.audit(body, run).right
    heavier = body.with_inertias(masses={"arm": 1.25}, inertias={"arm": body.moving_parts[2].inertia})
    found = sp.audit(heavier, run)
    assert not found.right
    assert found.cause[0].name == "mass of arm"
    assert found.cause[0].values["mass"].value == pytest.approx(-20.0, abs=1e-4)


def test_arrays_of_pinocchio_and_of_mujoco_are_one_trajectory(flight):
    """The angular velocity of the joint is that of the quaternion's derivative, 2 Vec(p* p') in axes of the child."""
    body, times, qpos, qvel = flight
    q = np.hstack([qpos[:, :3], np.roll(qpos[:, 3:7], -1, axis=1), np.roll(qpos[:, 7:11], -1, axis=1), qpos[:, 11:]])
    run = sp.FloatingTrajectory.from_mujoco(body, times, qpos, qvel, joint_names=NAMES)
    same = sp.FloatingTrajectory.from_pinocchio(body, times, q, qvel, joint_names=NAMES)
    np.testing.assert_array_equal(run.shapes, same.shapes)
    np.testing.assert_array_equal(run.joint_rates, same.joint_rates)
    columns = [body.rate_names.index(name) for name in ("shoulder.wx", "shoulder.wy", "shoulder.wz", "knee")]
    assert run.joint_rates is not None
    np.testing.assert_allclose(body.joint_rates(run.shapes, run.joint_rates)[:, columns], qvel[:, 6:], atol=1e-14)
    with pytest.raises(UnknownNameError, match="joint among joint_names 'shoulder'"):
        sp.FloatingTrajectory.from_mujoco(body, times, qpos, joint_names=("knee", "shoulder.x"))
