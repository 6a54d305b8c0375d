"""The logs that come with the bodies: they are what the simulation makes, and hold what it put in."""

import numpy as np
import pandas as pd
import pytest

import shapephase as sp
from support.places import ROBOTS
from support.robot_logs import LOGS, RPM
from support.simulated_dive import files


@pytest.mark.parametrize("name", LOGS)
def test_the_file_is_what_the_simulation_makes(name):
    log = LOGS[name]()
    lines = (ROBOTS / name).read_text(encoding="utf-8").splitlines()
    assert lines[:2] == [f"# {line}" for line in log.about.splitlines()]
    assert lines[2] == ",".join(log.columns())
    stored = pd.read_csv(ROBOTS / name, comment="#")
    for column, samples in log.columns().items():
        last_digit = 0.1 if "rpm" in column else 1e-6 if "rad/s" in column else 1e-5
        # Half of the last digit, and rounding that differs between processors.
        assert np.abs(stored[column].to_numpy() - samples).max() < 0.51 * last_digit, column
    assert (ROBOTS / name).stat().st_size < 400_000


def test_the_dive_is_what_mujoco_simulates():
    """To 0.001 [degrees, m, rad or kg m^2/s], which versions of MuJoCo may differ by."""
    for name, text in files().items():
        stored, made = (
            (lines[0], np.loadtxt(lines[1:], delimiter=lines[0][4]))
            for lines in (whole.split("endheader\n")[-1].splitlines() for whole in ((ROBOTS / name).read_text(), text))
        )
        assert stored[0] == made[0]
        assert np.abs(stored[1] - made[1]).max() < 1e-3


def test_the_astronaut_s_log_gives_the_momentum_and_the_turn_back():
    """Ten circles of the arms turn by 118.25 degrees (F8); the momentum is that of the simulation."""
    body = sp.load_body("astronaut")
    recorded = sp.read_recorded_motion(ROBOTS / "astronaut_log.csv", body, smooth=2e-3, close=0.01)
    motion = sp.motion_from_recording(body, recorded)
    deviation = motion.fitted.momentum - [0.1, 0.2, -0.05]
    assert (
        deviation @ np.linalg.solve(motion.fitted.momentum_covariance, deviation) < 16.3
    )  # chi-squared of 3, 1 in 1000
    turn = sp.so3.angle(sp.split(motion.motion).holonomy)
    assert np.degrees(turn) == pytest.approx(118.25049, abs=0.05)


def test_the_satellite_s_wheel_and_joints_leave_the_logged_attitude():
    """The wheel's angle, integrated from its speed, is a joint like any other; the gyro's bias is what is left."""
    body, log = sp.load_body("satellite"), LOGS["satellite_log.csv"]()
    stored = pd.read_csv(ROBOTS / "satellite_log.csv", comment="#")
    times, rpm = stored["time [s]"].to_numpy(), stored["wheel_spin [rpm]"].to_numpy()
    wheel = np.concatenate([[0.0], np.cumsum(np.diff(times) * 0.5 * (rpm[1:] + rpm[:-1]) * RPM)])
    shapes = np.column_stack([wheel if n == "wheel_spin" else stored[n].to_numpy() for n in body.joint_names])
    path, _ = sp.shape_space.files.smoothed_path(times, shapes, 1e-4, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), log.motion.momentum)
    logged = sp.so3.matrix_from_quat(stored[[f"base_q{axis}" for axis in "xyzw"]].to_numpy())
    assert sp.so3.angle(np.swapaxes(motion.attitude(times), -1, -2) @ logged).max() < 2e-3
    gyro = stored[[f"gyro_{axis} [rad/s]" for axis in "xyz"]].to_numpy()
    left = (gyro - motion.angular_velocity(times)).mean(axis=0)
    assert left == pytest.approx(log.bias, abs=5e-6)
