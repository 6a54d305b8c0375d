"""Logs with a gyro and a star tracker on the command line; MuJoCo has simulated the flight: its momentum is known."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from shapephase.cli.main import main
from support.motion_writers import write_delimited
from support.recorded_flights import JOINTS, MOMENTUM, Dive, simulated

# What is computed is the same with and without machine code, which is quicker.

NOISE, RATE_NOISE, BIAS = np.radians(0.3), np.radians(1.0), np.radians([0.5, -1.0, 0.8])
GYRO = tuple(f"gyro_{axis} [deg/s]" for axis in "xyz")
SIGMA = tuple(f"sigma_{axis}" for axis in "123")


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    """Joints, rates [rad/s] and MRPs, as a tracker gives them: of the turn from inertial axes to the body's."""
    times, motion = simulated()
    times, rng = times[::3], np.random.default_rng(4)
    shape = len(times), 3
    turns = Rotation.from_matrix(motion.attitude[::3]) * Rotation.from_rotvec(NOISE * rng.normal(size=shape))
    return {
        "times": times,
        "joints": np.array([Dive().shape(t) for t in times]),
        "rates": motion.angular_velocity[::3] + RATE_NOISE * rng.normal(size=shape) + BIAS,
        "sigma": turns.inv().as_mrp(),
    }


def log(file, columns, *parts: tuple[tuple[str, ...], np.ndarray]):
    values = np.column_stack([columns["joints"], *(values for _, values in parts)])
    write_delimited(file, [*JOINTS, *(name for names, _ in parts for name in names)], columns["times"], values)
    return file


def split(capsys, *arguments) -> dict:
    main(["split", "diver", *map(str, arguments), "--tolerance", "1e-7", "--json"])
    return json.loads(capsys.readouterr().out)


def square(found: dict) -> float:
    error = np.array(found["momentum_kg_m2_s"]) - MOMENTUM
    return float(error @ np.linalg.solve(found["momentum_fit"]["momentum_covariance"], error))


def test_a_gyro_and_a_star_tracker(columns, tmp_path, capsys):
    """The tracker's direction follows from the gyro; momentum, noise and bias are within their bars."""
    file = log(tmp_path / "m.csv", columns, (GYRO, np.degrees(columns["rates"])), (SIGMA, columns["sigma"]))
    found = split(capsys, file)
    fit = found["momentum_fit"]
    assert square(found) < chi2.ppf(1.0 - 1e-6, 3)
    off = np.array(fit["rate_bias_rad_s"]) - BIAS
    assert off @ np.linalg.solve(fit["rate_bias_covariance_rad2_s2"], off) < chi2.ppf(1.0 - 1e-6, 3)
    assert fit["noise_rad"] == pytest.approx(NOISE, rel=0.2)
    assert fit["rate_noise_rad_s"] == pytest.approx(RATE_NOISE, rel=0.2)
    main(["split", "diver", str(file), "--tolerance", "1e-7", "--joint-noise", "0.1deg"])
    text = capsys.readouterr().out
    for words in (
        "51 attitudes with 0.",
        "deg and 51 rates with ",
        "bias of the rates",
        "sigma_1, sigma_2, sigma_3: the inverse of base axes to the recorder's, by the rates",
        "gyro_x [deg/s], gyro_y [deg/s], gyro_z [deg/s], read in deg/s; in base axes",
    ):
        assert words in text, words


@pytest.mark.full
def test_a_star_tracker_alone_is_asked_for_its_direction(columns, tmp_path, capsys):
    file = log(tmp_path / "m.csv", columns, (SIGMA, columns["sigma"]))
    assert square(split(capsys, file, "--base-inverse")) < chi2.ppf(1.0 - 1e-6, 3)
    with pytest.raises(SystemExit):
        split(capsys, file)
    assert "read as its inverse, it is one: base_inverse=True (--base-inverse)" in capsys.readouterr().err
    right = log(tmp_path / "r.csv", columns, (SIGMA, Rotation.from_mrp(columns["sigma"]).inv().as_mrp()))
    main(["split", "diver", str(right), "--tolerance", "1e-7"])
    assert "sigma_3: base axes to the recorder's, --base-inverse for the inverse" in capsys.readouterr().out


@pytest.mark.full
def test_a_gyro_alone_starts_at_a_given_attitude(columns, tmp_path, capsys):
    file = log(tmp_path / "m.csv", columns, (GYRO, np.degrees(columns["rates"])))
    start = Rotation.from_matrix(simulated()[1].attitude[0]).as_quat()
    found = split(capsys, file, "--attitude", *start)
    assert square(found) < chi2.ppf(1.0 - 1e-6, 3)
    assert "recorded_base_difference_rad" not in found
    np.testing.assert_allclose(found["initial_attitude_quat_xyzw"], start, atol=1e-12)
    main(["split", "diver", str(file), "--tolerance", "1e-7", "--flight", "all"])
    assert "to the recorded base    51 rates with " in capsys.readouterr().out


@pytest.mark.full
def test_a_rate_at_a_time_states_the_momentum(columns, tmp_path, capsys):
    """The simulator's own rate, in degrees; also in place of a fit to the recorded base."""
    times, motion = simulated()
    sample = 60
    words = " ".join(f"{value:.15g}" for value in np.degrees(motion.angular_velocity[sample]))
    start = Rotation.from_matrix(motion.attitude[0]).as_quat()
    options = ("--rate", f"{words} deg/s", "--rate-time", times[sample], "--attitude", *start)
    for parts in ((), ((SIGMA, columns["sigma"]),)):
        found = split(capsys, log(tmp_path / "m.csv", columns, *parts), *options)
        np.testing.assert_allclose(found["momentum_kg_m2_s"], MOMENTUM, atol=1e-3 * np.linalg.norm(MOMENTUM))
        assert "momentum_fit" not in found
