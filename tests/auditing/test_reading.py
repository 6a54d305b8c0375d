"""Trajectories of several programs, read: all of one motion, so that all have to be the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import TrajectoryError
from support.flown_bodies import Flown, body_of, flown

NAME = "diver"
CLOSE = 1e-9


@pytest.fixture(scope="module")
def motion() -> Flown:
    return flown(NAME, seed=4, step=0.001, every=5, duration=0.3)


def same(run: sp.FloatingTrajectory, motion: Flown, *, rates: bool) -> None:
    turns = Rotation.from_quat(motion.qpos[:, [4, 5, 6, 3]])
    order = [motion.joint_names.index(joint) for joint in body_of(NAME).joint_names]
    assert (Rotation.from_quat(run.quaternion).inv() * turns).magnitude().max() < CLOSE
    assert run.position is not None
    np.testing.assert_allclose(run.times, motion.times, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(run.position, motion.qpos[:, :3], rtol=0, atol=CLOSE)
    np.testing.assert_allclose(run.shapes, motion.qpos[:, 7:][:, order], rtol=0, atol=CLOSE)
    if rates:
        assert run.world_velocity is not None
        np.testing.assert_allclose(run.world_velocity, motion.qvel[:, :3], rtol=0, atol=1e-8)
        np.testing.assert_allclose(run.base_rate, motion.qvel[:, 3:6], rtol=0, atol=1e-8)
        np.testing.assert_allclose(run.joint_rates, motion.qvel[:, 6:][:, order], rtol=0, atol=CLOSE)
    else:
        assert run.rate is None


def test_mujoco_arrays(motion: Flown, tmp_path: Path):
    file, names = tmp_path / "run.npz", np.array(motion.joint_names)
    np.savez(file, qpos=motion.qpos, qvel=motion.qvel, time=motion.times, joint_names=names, timestep=0.001)
    run = sp.read_trajectory(file, body_of(NAME))
    same(run, motion, rates=True)
    assert run.integrator_step == 0.001


def test_mujoco_columns(motion: Flown, tmp_path: Path):
    labels = ["time", *(f"qpos_{k}" for k in range(9)), *(f"qvel_{k}" for k in range(8))]
    rows = np.column_stack([motion.times, motion.qpos, motion.qvel])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=",".join(labels), comments="", fmt="%.17g")
    same(sp.read_trajectory(tmp_path / "run.csv", body_of(NAME)), motion, rates=True)


def test_pinocchio_arrays(motion: Flown, tmp_path: Path):
    turns = Rotation.from_quat(motion.qpos[:, [4, 5, 6, 3]])
    q = np.column_stack([motion.qpos[:, :3], turns.as_quat(), motion.qpos[:, 7:]])
    v = np.column_stack([turns.inv().apply(motion.qvel[:, :3]), motion.qvel[:, 3:]])
    np.savez(tmp_path / "run.npz", q=q, v=v, timestep=0.005, joint_names=np.array(motion.joint_names))
    same(sp.read_trajectory(tmp_path / "run.npz", body_of(NAME)), motion, rates=True)


def test_biorbd_arrays(motion: Flown, tmp_path: Path):
    """SciPy makes the angles, and their rates follow from its inverse Jacobian by differences of a step."""
    turns = Rotation.from_quat(motion.qpos[:, [4, 5, 6, 3]])
    angles = turns.as_euler("XYZ")
    step = 1e-6
    ahead = (turns * Rotation.from_rotvec(step * motion.qvel[:, 3:6])).as_euler("XYZ")
    behind = (turns * Rotation.from_rotvec(-step * motion.qvel[:, 3:6])).as_euler("XYZ")
    slopes = np.angle(np.exp(1j * (ahead - behind))) / (2.0 * step)
    order = [motion.joint_names.index(joint) for joint in body_of(NAME).joint_names]
    stored = np.column_stack([motion.qpos[:, :3], angles, motion.qpos[:, 7:][:, order]])
    rates = np.column_stack([motion.qvel[:, :3], slopes, motion.qvel[:, 6:][:, order]])
    np.savez(tmp_path / "run.npz", Q=stored.T, Qdot=rates.T, time=motion.times)
    run = sp.read_trajectory(tmp_path / "run.npz", body_of(NAME))
    assert run.base_rate is not None
    np.testing.assert_allclose(run.base_rate, motion.qvel[:, 3:6], rtol=0, atol=1e-7)
    assert (Rotation.from_quat(run.quaternion).inv() * turns).magnitude().max() < CLOSE


def test_a_table_with_the_pose_of_the_base(motion: Flown, tmp_path: Path):
    turns = Rotation.from_quat(motion.qpos[:, [4, 5, 6, 3]])
    labels = ["time", "base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw", *motion.joint_names]
    rows = np.column_stack([motion.times, motion.qpos[:, :3], turns.as_quat(), motion.qpos[:, 7:]])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=",".join(labels), comments="", fmt="%.17g")
    same(sp.read_trajectory(tmp_path / "run.csv", body_of(NAME)), motion, rates=False)


def test_faults_of_files_are_named(motion: Flown, tmp_path: Path):
    body = body_of(NAME)
    np.savez(tmp_path / "run.npz", qpos=motion.qpos)
    with pytest.raises(sp.errors.TrajectoryError, match="timestep"):
        sp.read_trajectory(tmp_path / "run.npz", body)
    np.savez(tmp_path / "run.npz", qpos=motion.qpos[:, :-1], time=motion.times)
    with pytest.raises(sp.errors.TrajectoryError, match="qpos"):
        sp.read_trajectory(tmp_path / "run.npz", body)
    with pytest.raises(sp.errors.InputFileNotFoundError):
        sp.read_trajectory(tmp_path / "other.npz", body)
    rows = np.column_stack([motion.times, motion.qpos[:, 7:]])
    header = ",".join(["time", *motion.joint_names])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=header, comments="")
    with pytest.raises(sp.errors.TrajectoryError, match="attitude"):
        sp.read_trajectory(tmp_path / "run.csv", body)


@pytest.mark.parametrize("field", ["shapes", "joint_rates"])
def test_joints_that_are_in_no_unit_of_ours_are_asked_for_theirs(field):
    count = 9
    given = {
        "times": np.linspace(0.0, 1.0, count),
        "quaternion": np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        "shapes": np.zeros((count, 1)),
        "rate": np.zeros((count, 3)),
        "joint_rates": np.zeros((count, 1)),
    }
    given[field] = np.linspace(0.0, 2e6, count)[:, None]
    with pytest.raises(TrajectoryError, match=rf"{field}.*millimetres"):
        sp.FloatingTrajectory(**given)
