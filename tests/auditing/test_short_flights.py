"""Audits of flights of few samples: momentum, its drift and the fall with bars, and no causes."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import TrajectoryError

DIVER = sp.load_body("diver")
MOMENTUM = np.array([20.0, 30.0, 3.0])
GRAVITY = np.array([0.0, 0.0, -9.81])


def flown(count, rate, noise=0.0, seed=0, torque=0.0):
    """A flight of the diver with known momentum, its arms swinging; `torque` about the vertical alone [N m]."""
    times = np.arange(count) / rate
    arms = np.stack([0.6 + 0.5 * np.sin(5.0 * times), 0.5 * np.cos(4.0 * times)], axis=1)
    path = sp.ShapePath.spline(times, arms, False, joint_names=DIVER.joint_names)
    motion = sp.reconstruct(sp.articulated(DIVER, path), MOMENTUM)
    turns = Rotation.from_matrix(motion.attitude(times))
    if torque:
        # A turn about one axis of a body at rest in shape: its rate goes up evenly.
        arms = np.zeros_like(arms)
        inertia = DIVER.locked_inertia(arms[0])[2, 2]
        angles = 30.0 / inertia * times + 0.5 * torque / inertia * times**2
        turns = Rotation.from_rotvec(angles[:, None] * np.array([0.0, 0.0, 1.0]))
    rng = np.random.default_rng(seed)
    turns = turns * Rotation.from_rotvec(noise * rng.normal(size=(count, 3)))
    centres = np.array([0.3, 0.0, 3.0]) * times[:, None] + 0.5 * GRAVITY * times[:, None] ** 2
    places = centres - turns.apply(DIVER.centre_of_mass(arms)) + 0.2 * noise * rng.normal(size=(count, 3))
    return sp.FloatingTrajectory(
        times=times, quaternion=turns.as_quat(), shapes=arms, position=places, name="a flight", captured=True
    )


@pytest.mark.parametrize(("count", "rate"), [(8, 25.0), (17, 30.0), (23, 50.0)])
def test_a_short_flight_has_momentum_drift_and_fall_with_bars(count, rate):
    found = sp.audit(DIVER, flown(count, rate, 0.005))
    (run,) = found.runs
    assert found.right
    off = run.momentum.mean(axis=0) - MOMENTUM
    # Four standard deviations; a spline through few samples of the arms is off by less than a tenth of that.
    assert (np.abs(off) < 4.0 * np.array(run.momentum_bars)).all()
    assert np.linalg.norm(run.momentum_bars) < 0.1 * np.linalg.norm(MOMENTUM)
    assert np.linalg.norm(np.array(run.airborne.acceleration) - GRAVITY) < 4.0 * run.fall_bar
    assert found.cause == found.hypotheses == ()
    assert "±" in found.table()


def test_a_momentum_that_changes_is_told_without_a_cause():
    found = sp.audit(DIVER, flown(20, 30.0, 0.002, torque=10.0))
    (run,) = found.runs
    assert not found.right
    assert "so few samples do not tell causes apart" in found.verdict
    # 10 N m for 19/30 s; half of that about the mean.
    assert run.momentum_drift == pytest.approx(0.5 * 10.0 * 19.0 / 30.0, rel=0.1)
    assert run.record["momentum_bars_kg_m2_s"] is not None


def test_fewer_samples_than_eight_are_refused():
    with pytest.raises(TrajectoryError, match="8 or more"):
        flown(7, 30.0)


@pytest.fixture(scope="module")
def two_jumps():
    """A recording with two flights of 0.5 and 0.7 s, the second of them with another momentum."""
    rate = 100.0
    times = np.arange(251) / rate
    height = np.zeros_like(times)
    for take_off, lasts in ((0.4, 0.5), (1.5, 0.7)):
        speed = 0.5 * 9.81 * lasts
        push = 0.2
        before, since, after = times - take_off + push, times - take_off, times - take_off - lasts
        rise = 0.5 * speed * push
        height += np.select(
            [before < 0.0, since < 0.0, after < 0.0, after < push],
            [
                0.0,
                0.5 * speed / push * before**2,
                rise + speed * since - 0.5 * 9.81 * since**2,
                rise - speed * after + 0.5 * speed / push * after**2,
            ],
        )
    angles = np.where(times < 1.2, 2.0 * times, 2.4 + 5.0 * (times - 1.2))
    turns = Rotation.from_rotvec(angles[:, None] * np.array([0.0, 0.0, 1.0]))
    arms = np.zeros((len(times), 2))
    places = np.stack([0.0 * times, 0.0 * times, height], axis=1) - turns.apply(DIVER.centre_of_mass(arms))
    return pd.DataFrame(
        np.column_stack([times, arms, turns.as_quat(), places]),
        columns=["time", *DIVER.joint_names, *(f"base_q{part}" for part in "xyzw"), "base_x", "base_y", "base_z"],
    )


def test_flights_are_counted_in_time(two_jumps, tmp_path):
    first, second, longest = (
        sp.read_recorded_motion(two_jumps, DIVER, flight=flight).flight for flight in ("auto:1", "auto:2", "auto")
    )
    assert (longest.first_time, longest.last_time) == (second.first_time, second.last_time)
    for flight, ends in ((first, (0.4, 0.9)), (second, (1.5, 2.2))):
        np.testing.assert_allclose([flight.first_time, flight.last_time], ends, rtol=0.0, atol=0.07)
        assert flight.all_times == ((first.first_time, first.last_time), (second.first_time, second.last_time))
    with pytest.raises(TrajectoryError, match="auto:2"):
        sp.read_recorded_motion(two_jumps, DIVER, flight="auto:3")
    two_jumps.to_csv(tmp_path / "jumps.csv", index=False)
    trajectory = sp.read_trajectory(tmp_path / "jumps.csv", DIVER)
    for number, flight in ((1, first), (2, second)):
        (run,) = sp.audit(DIVER, trajectory, flight=f"auto:{number}").runs
        assert (run.first_time, run.last_time) == pytest.approx((flight.first_time, flight.last_time), abs=0.03)
    with pytest.raises(TrajectoryError, match="number 3"):
        sp.audit(DIVER, trajectory, flight="auto:3")


def test_all_flights_are_listed(two_jumps, tmp_path, capfd):
    two_jumps.to_csv(tmp_path / "jumps.csv", index=False)
    for options in ((), ("--flight", "auto:1")):
        main(["check", "diver", str(tmp_path / "jumps.csv"), *options])
        (line,) = [line for line in capfd.readouterr().out.splitlines() if line.startswith("flights ")]
        assert "1: 0.4" in line
        assert "2: 1.5" in line


@pytest.mark.parametrize("count", [20, 101])
def test_a_filtered_flight_keeps_the_noise_of_its_samples(count, tmp_path):
    """With the noise that a filter leaves from sample to sample, slow noise would be taken for a drift."""
    flight = flown(count, 100.0 if count > 24 else 30.0, 0.01, seed=3)
    frame = pd.DataFrame(
        np.column_stack([flight.times, flight.shapes, flight.quaternion, flight.position]),
        columns=["time", *DIVER.joint_names, *(f"base_q{part}" for part in "xyzw"), "base_x", "base_y", "base_z"],
    )
    frame.loc[5, "base_qx"] = np.nan
    frame.to_csv(tmp_path / "flight.csv", index=False)
    with pytest.raises(TrajectoryError, match="--fill"):
        sp.read_trajectory(tmp_path / "flight.csv", DIVER)
    trajectory = sp.read_trajectory(tmp_path / "flight.csv", DIVER, fill="0.1s", lowpass=6)
    (run,) = sp.audit(DIVER, trajectory, tolerance=1e-6, flight="all").runs
    assert run.right
    assert trajectory.noise.attitude == pytest.approx(0.01, rel=0.3)
    assert run.momentum.mean(axis=0) == pytest.approx(MOMENTUM, abs=1.5)
