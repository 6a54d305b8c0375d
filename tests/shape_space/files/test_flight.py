"""The flight of a jump is found by the fall of the centre of mass, whose acceleration is prescribed here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files import read_recorded_motion
from shapephase.shape_space.free_fall import free_fall
from support.motion_writers import write_delimited, write_opensim

DIVER = sp.load_body("diver")
G = 9.81
TAKE_OFF, LANDING, END = 0.75, 1.75, 2.5


def height(times: np.ndarray) -> np.ndarray:
    """At rest, pushed off evenly for a quarter of a second, free for a second, and caught as evenly."""
    speed = 0.5 * G * (LANDING - TAKE_OFF)
    push = 0.25
    before, after = times - (TAKE_OFF - push), times - LANDING
    pushed = np.where(before > 0.0, 0.5 * speed / push * before**2, 0.0)
    flown = 0.5 * speed * push + speed * (times - TAKE_OFF) - 0.5 * G * (times - TAKE_OFF) ** 2
    caught = np.where(after < push, 0.5 * speed * push - speed * after + 0.5 * speed / push * after**2, 0.0)
    return np.select([times < TAKE_OFF, times < LANDING], [pushed, flown], caught)


def centres(times: np.ndarray, noise: float, seed: int, axis: int = 1, sign: float = 1.0) -> np.ndarray:
    found = noise * np.random.default_rng(seed).normal(size=(len(times), 3))
    found[:, axis] += sign * height(times)
    found[:, (axis + 1) % 3] += 0.8 * np.clip(times - TAKE_OFF, 0.0, LANDING - TAKE_OFF)
    return found


@pytest.mark.parametrize("rate", [60.0, 200.0])
@pytest.mark.parametrize("noise", [0.0, 0.001, 0.005])
def test_the_flight_is_found_whichever_axis_is_up(rate: float, noise: float):
    """Nothing of the contact is in it, and no more is lost than a contact by g may last unseen, twice, and a sample."""
    times = np.arange(round(END * rate)) / rate
    lost = 2.0 * np.sqrt(2.0 * 2.0 * np.hypot(noise, 0.002) / G) + 1.0 / rate
    for seed in range(4):
        axis, sign = seed % 3, 1.0 - 2.0 * (seed % 2)
        motion = centres(times, noise, seed, axis, sign)
        if sign < 0.0:
            # That an axis points down has to be said: else this is a push-off, twice as hard.
            with pytest.raises(TrajectoryError, match=f"--up -{'xyz'[axis]}"):
                free_fall(times, motion, "a file")
        found = free_fall(times, motion, "a file", up=f"-{'xyz'[axis]}" if sign < 0.0 else None)
        first, last = times[found.first], times[found.last]
        assert found.up == f"{'+' if sign > 0.0 else '-'}{'xyz'[axis]}"
        assert TAKE_OFF - 1e-9 <= first <= TAKE_OFF + lost, (seed, first)
        assert LANDING + 1e-9 >= last >= LANDING - lost, (seed, last)
        assert found.off == pytest.approx(noise, rel=0.15, abs=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.005, 0.02])
def test_who_stands_or_walks_does_not_fall(noise: float):
    times = np.arange(600) / 100.0
    errors = noise * np.random.default_rng(5).normal(size=(len(times), 3))
    walk = np.column_stack([1.3 * times, 0.03 * np.sin(4.0 * np.pi * times), 0.02 * np.sin(2.0 * np.pi * times)])
    for motion in (errors, walk + errors):
        with pytest.raises(TrajectoryError, match="nowhere"):
            free_fall(times, motion, "a file")


def test_a_recording_that_is_nothing_but_flight_is_kept_whole():
    times = np.sort(np.random.default_rng(2).uniform(0.0, 0.9, 80))
    fall = np.column_stack([times, 4.0 * times - 0.5 * G * times**2, 0.0 * times])
    found = free_fall(times, fall + 0.003 * np.random.default_rng(3).normal(size=fall.shape), "a file")
    assert found.ends == (0, 79)


@pytest.mark.parametrize("up", [None, "z"])
def test_a_push_off_is_no_flight_upside_down(up: str | None):
    """A net g upwards for 0.4 s, then somebody holds the body at once."""
    times = np.arange(240) / 120.0
    motion = np.zeros((240, 3))
    pushed = np.clip(times - 0.8, 0.0, 0.4)
    motion[:, 2] = 0.5 * G * pushed**2 + 0.05 * G * 0.4 * -np.expm1(-np.clip(times - 1.2, 0.0, None) / 0.05)
    with pytest.raises(TrajectoryError, match="lands" if up is None else "nowhere"):
        free_fall(times, motion, "a file", up=up)


def recorded(file, up: int, scale: float = 1.0, speed: float = 1.0):
    """A jump of the diver, turning, with the axis y or z up, written by its pelvis."""
    times = 12.0 + np.arange(250) / 100.0
    arms = np.column_stack([1.0 + 0.5 * np.sin(times), 2.0 - np.sin(2.0 * times)])
    upright = Rotation.from_rotvec([-0.5 * np.pi if up == 1 else 0.0, 0.0, 0.0])
    turns = upright * Rotation.from_rotvec(np.outer(times - 12.0, [0.4, 7.0, 0.2]))
    # The centre of mass of the three parts from the pelvis: theory.md A1, with the numbers of the file.
    mass, arm = 58.801, 3.106
    centre = mass * np.array([0.0, 0.0, 0.0941])
    for side, angle in ((1.0, arms[:, 0]), (-1.0, arms[:, 1])):
        hanging = np.column_stack([0.0 * angle, np.sin(angle), -np.cos(angle)])
        centre = centre + arm * (np.array([-0.0205, side * 0.1875, 0.4719]) + 0.233088 * hanging)
    centre = centre / (mass + 2.0 * arm)
    places = centres(times - 12.0, 0.001, 1, up) - turns.apply(centre)
    if file.suffix == ".csv":
        labels = [*(f"base_q{part}" for part in "xyzw"), "base_x", "base_y", "base_z", *DIVER.joint_names]
        write_delimited(file, labels, speed * times, np.column_stack([turns.as_quat(), scale * places, arms]))
        return file
    pelvis = turns * Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    angles = pelvis.as_euler("ZXY", degrees=True)
    labels = ["pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz"]
    write_opensim(file, [*labels, *DIVER.joint_names], times, np.column_stack([angles, places, np.degrees(arms)]), True)
    return file


@pytest.mark.parametrize(("name", "up"), [("take.mot", 1), ("take.csv", 2)])
def test_a_file_keeps_its_flight_only(name: str, up: int, tmp_path):
    file = recorded(tmp_path / name, up)
    motion = read_recorded_motion(file, DIVER, flight="auto")
    flight = motion.flight
    assert flight.by == "auto"
    assert flight.fall.up == "+" + "xyz"[up]
    assert flight.fall.off == pytest.approx(0.001, rel=0.15)
    assert TAKE_OFF <= flight.first_time - 12.0 <= TAKE_OFF + 0.1
    assert LANDING - 0.1 <= flight.last_time - 12.0 <= LANDING
    assert motion.times[0] == 0.0
    assert len(motion.base_attitude) == len(motion.base_position) == len(motion.times) == motion.record["samples"]
    assert motion.path.duration == pytest.approx(flight.last_time - flight.first_time)
    assert motion.record["flight"] == flight.record
    given = read_recorded_motion(file, DIVER, flight=(flight.first_time, flight.last_time))
    cut = read_recorded_motion(file, DIVER, trim=(flight.first_time, flight.last_time))
    for other in (given, cut):
        np.testing.assert_array_equal(other.path.shape(other.times), motion.path.shape(motion.times))
        np.testing.assert_array_equal(other.base_attitude, motion.base_attitude)
    assert given.flight.by == "times"
    assert cut.flight is None
    with pytest.warns(TrajectoryWarning, match="parabola"):
        assert read_recorded_motion(file, DIVER, flight="all").flight.last_time == pytest.approx(14.49)


@pytest.mark.parametrize(
    ("scale", "speed", "words"),
    [
        (1.0 / 2.54, 1.0, "lengths in in were read as cm"),
        (2.54, 1.0, "lengths in cm were read as in"),
        (0.3048, 1.0, "lengths in m were read as ft"),
        (1.0, 4.0, "100 frames a second were read as 25"),
        (1.0, 0.5, "100 frames a second were read as 200"),
    ],
)
def test_a_fall_by_another_gravity_names_the_slip(scale: float, speed: float, words: str, tmp_path):
    file = recorded(tmp_path / "take.csv", 2, scale, speed)
    with pytest.raises(TrajectoryError, match=words):
        read_recorded_motion(file, DIVER, flight="recorded")


def test_gravity_can_be_said_or_left_open(tmp_path):
    """As on Mars, filmed so: a clock that is slow by the root of 9.81 / 3.7."""
    slow = float(np.sqrt(G / 3.7))
    file = recorded(tmp_path / "take.csv", 2, speed=slow)
    found = [read_recorded_motion(file, DIVER, flight="auto", gravity=said).flight for said in (3.7, "any")]
    for flight in found:
        assert flight.fall.gravity == pytest.approx(3.7, abs=4.0 * flight.fall.gravity_bar)
        assert (flight.last_time - 12.0 * slow) / slow <= LANDING
    inside = (found[0].first_time, found[0].last_time)
    with pytest.raises(TrajectoryError, match="gravity=3"):
        read_recorded_motion(file, DIVER, flight=inside)
    assert read_recorded_motion(file, DIVER, flight=inside, gravity="any").flight.by == "times"
    with pytest.raises(ShapeError, match="gravity"):
        read_recorded_motion(file, DIVER, flight="auto", gravity="moon")


def test_what_a_flight_needs(tmp_path):
    file = recorded(tmp_path / "take.csv", 2)
    with pytest.raises(TrajectoryError, match="attitude"):
        read_recorded_motion(file, DIVER, flight="all", names={f"base_q{part}": None for part in "xyzw"})
    with pytest.raises(TrajectoryError, match="position"):
        read_recorded_motion(file, DIVER, flight="auto", names={f"base_{axis}": None for axis in "xyz"})
    with pytest.raises(TrajectoryError, match="axes"):
        read_recorded_motion(file, DIVER, flight="auto", base_axes="estimate")
    with pytest.raises(TrajectoryError, match=r"14\.49"):
        read_recorded_motion(file, DIVER, flight=(12.5, 12.515))
    with pytest.raises(ShapeError, match="'auto:2'"):
        read_recorded_motion(file, DIVER, flight="never")
    with pytest.raises(ShapeError, match="flight"):
        read_recorded_motion(file, DIVER, flight=(13.0, 12.0))
