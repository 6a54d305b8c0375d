"""Audits of bodies with ball joints, of trajectories that MuJoCo simulates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import shapephase as sp

mujoco = pytest.importorskip("mujoco")

MODEL = """<mujoco><option timestep="0.002" gravity="0 0 0" integrator="RK4"/><worldbody><body name="trunk"><freejoint/>
<geom type="box" size=".1 .05 .2" mass="3"/>
<body name="leg" pos="0 0 -.2"><joint name="knee" type="hinge" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".05" mass="2"/></body>
<body name="arm" pos=".1 0 .2"><joint name="shoulder" type="ball"/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/></body></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The body and a trajectory, quaternions with any sign.

    The derivative of a quaternion is half of itself times the angular velocity in axes of the child.
    """
    file = tmp_path_factory.mktemp("ball") / "ball.xml"
    file.write_text(MODEL)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qvel[3:] = 2.0 * np.random.default_rng(1).standard_normal(model.nv - 3)
    times, places, rates = [], [], []
    for step in range(480):
        if step % 4 == 0:
            times.append(data.time)
            places.append(data.qpos.copy())
            rates.append(data.qvel.copy())
        mujoco.mj_step(model, data)
    qpos, qvel = np.array(places), np.array(rates)
    w, x, y, z = qpos[:, 8:12].T
    a, b, c = qvel[:, 7:10].T
    shoulder = np.stack([x, y, z, w], axis=1)
    turning = 0.5 * np.stack([w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a,
                              -x * a - y * b - z * c], axis=1)  # fmt: skip
    body = sp.load_body(file)
    assert body.joint_names == ("knee", *(f"shoulder.{part}" for part in "xyzw"))
    shapes, joint_rates = np.hstack([qpos[:, [7]], shoulder]), np.hstack([qvel[:, [6]], turning])
    signs = np.ones_like(shapes)
    signs[::3, 1:] = -1.0
    trajectory = sp.FloatingTrajectory(
        times=np.array(times),
        position=qpos[:, :3],
        quaternion=np.roll(qpos[:, 3:7], -1, axis=1),
        shapes=signs * shapes,
        velocity=qvel[:, :3],
        rate=qvel[:, 3:6],
        joint_rates=signs * joint_rates,
    )
    return body, trajectory


@pytest.mark.parametrize("rates", ["given", "of the samples"])
def test_what_mujoco_simulates_is_right_and_a_wrong_mass_is_found(flight, rates):
    """A fourth of the arm's mass too much: to have MuJoCo's, a fifth of it has to go."""
    body, run = flight
    if rates == "of the samples":
        run = replace(run, rate=None, velocity=None, joint_rates=None)
    assert sp.audit(body, run).right
    heavier = body.with_inertias(masses={"arm": 1.25}, inertias={"arm": body.moving_parts[2].inertia})
    found = sp.audit(heavier, run)
    assert not found.right
    assert found.cause[0].name == "mass of arm"
    assert found.cause[0].values["mass"].value == pytest.approx(-20.0, abs=1e-4)
