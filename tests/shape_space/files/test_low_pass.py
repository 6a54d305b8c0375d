"""The low-pass filter of recordings: against SciPy's own, its response in closed form, and exact rotations."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import TrajectoryError

DIVER = sp.load_body("diver")
LEFT, RIGHT = DIVER.joint_names
RATE, CUT_OFF = 100.0, 6.0
TIMES = np.arange(401) / RATE
MIDDLE = slice(150, 251)
"""More than ten periods of the cut-off from both ends."""
AXIS = np.array([1.0, -2.0, 2.0]) / 3.0
QUATERNION = ["base_qx", "base_qy", "base_qz", "base_qw"]


def response(frequency, cut_off=CUT_OFF, rate=RATE):
    """Response of both passes of a digital Butterworth filter of second order, 1/sqrt(2) at the cut-off."""
    ratio = np.tan(np.pi * frequency / rate) / np.tan(np.pi * cut_off / rate)
    return 1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * ratio**4)


def by_scipy(values, cut_off=CUT_OFF, rate=RATE):
    """That filter by SciPy, each pass with Winter's cut-off."""
    each = rate / np.pi * np.arctan(np.tan(np.pi * cut_off / rate) / (np.sqrt(2.0) - 1.0) ** 0.25)
    return sosfiltfilt(butter(2, each, fs=rate, output="sos"), values, axis=0, padlen=len(values) - 1)


def frame(shapes, times=TIMES, **more):
    return pd.DataFrame({"time": times, LEFT: shapes[:, 0], RIGHT: shapes[:, 1], **more})


def base_of(turns):
    return dict(zip(QUATERNION, turns.as_quat().T, strict=True))


def swinging(*frequencies):
    return np.stack([np.sin(2.0 * np.pi * f * TIMES + 0.3) for f in frequencies], axis=1)


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """A body with one ball joint."""
    link = '<link name="{}"><inertial><mass value="2"/><inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/>'
    links = "".join((link + "</inertial></link>").format(name) for name in ("trunk", "arm"))
    joint = '<joint name="shoulder" type="spherical"><parent link="trunk"/><child link="arm"/></joint>'
    file = tmp_path_factory.mktemp("ball") / "b.urdf"
    file.write_text(f'<robot name="b">{links}{joint}</robot>')
    return sp.load_body(file)


def of_ball(turns):
    found = pd.DataFrame(turns.as_quat(), columns=[f"shoulder.{part}" for part in "xyzw"])
    found.insert(0, "time", TIMES)
    return found


def test_inside_it_is_scipys_filter():
    noisy = swinging(1.0, 9.0) + 0.1 * np.random.default_rng(5).normal(size=(401, 2))
    path = sp.read_shape_path(frame(noisy), DIVER, lowpass=CUT_OFF)
    np.testing.assert_allclose(path.shape(TIMES[MIDDLE]), by_scipy(noisy)[MIDDLE], rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("frequency", [0.5, 4.0, 6.0, 12.0, 30.0])
def test_the_frequency_response_is_that_of_both_passes(frequency):
    shapes = swinging(frequency, 2.0)
    path = sp.read_shape_path(frame(shapes), DIVER, lowpass=CUT_OFF)
    expected = shapes[MIDDLE] * response(np.array([frequency, 2.0]))
    np.testing.assert_allclose(path.shape(TIMES[MIDDLE]), expected, rtol=0.0, atol=1e-11)
    assert response(CUT_OFF) == pytest.approx(1.0 / np.sqrt(2.0), rel=1e-15)


def test_lines_come_through_up_to_the_ends():
    shapes = np.stack([0.1 + 0.5 * TIMES, 1.0 - 0.2 * TIMES], axis=1)
    motion = sp.read_recorded_motion(frame(shapes), DIVER, lowpass=0.5)
    np.testing.assert_allclose(motion.path.shape(TIMES), shapes, rtol=0.0, atol=1e-11)
    assert max(motion.record["lowpass"]["noise"].values()) < 1e-9


def test_a_constant_rate_about_a_tilted_axis_comes_through_up_to_the_ends():
    turns = Rotation.from_rotvec([0.3, 1.0, -2.0]) * Rotation.from_rotvec(8.0 * TIMES[:, None] * AXIS)
    places = {f"base_{axis}": slope * TIMES for axis, slope in zip("xyz", (1.0, -2.0, 0.5), strict=True)}
    motion = sp.read_recorded_motion(frame(swinging(1.0, 1.0), **base_of(turns), **places), DIVER, lowpass=CUT_OFF)
    np.testing.assert_allclose(motion.base_attitude, turns.as_matrix(), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(motion.base_position, np.stack(list(places.values()), axis=1), rtol=0.0, atol=1e-11)


def test_a_wobble_of_the_base_has_the_response_of_its_own_frequency():
    wobble = 1e-5 * np.sin(2.0 * np.pi * 5.0 * TIMES)[:, None] * np.array([2.0, 1.0, 0.0])
    steady = Rotation.from_rotvec(8.0 * TIMES[:, None] * AXIS)
    motion = sp.read_recorded_motion(
        frame(swinging(1.0, 1.0), **base_of(steady * Rotation.from_rotvec(wobble))), DIVER, lowpass=CUT_OFF
    )
    left = (steady.inv() * Rotation.from_matrix(motion.base_attitude)).as_rotvec()
    # The mean rate of turn is known to the wobble divided by the duration.
    np.testing.assert_allclose(left[MIDDLE], response(5.0) * wobble[MIDDLE], rtol=0.0, atol=1e-8)


def test_a_wobble_of_a_ball_joint_is_filtered_half_a_turn_rate_aside(ball):
    rate, frequency = 8.0, 5.0
    across = np.array([2.0, 1.0, 0.0]) / np.sqrt(5.0)
    phase = 2.0 * np.pi * frequency * TIMES[:, None]
    steady = Rotation.from_rotvec(rate * TIMES[:, None] * AXIS)
    path = sp.read_shape_path(of_ball(steady * Rotation.from_rotvec(1e-5 * np.cos(phase) * across)), ball, lowpass=6)
    left = (steady.inv() * Rotation.from_quat(path.shape(TIMES))).as_rotvec()
    aside = rate / (4.0 * np.pi)
    below, above, still = response(frequency - aside), response(frequency + aside), response(aside)
    kept, turned = (above + below) / (2.0 * still), (above - below) / (2.0 * still)
    expected = 1e-5 * (kept * np.cos(phase) * across + turned * np.sin(phase) * np.cross(AXIS, across))
    np.testing.assert_allclose(left[MIDDLE], expected[MIDDLE], rtol=0.0, atol=1e-9)


def test_a_ball_joint_at_a_constant_rate_is_off_at_the_ends_alone(ball):
    turns = Rotation.from_rotvec(8.0 * TIMES[:, None] * AXIS)
    path = sp.read_shape_path(of_ball(turns), ball, lowpass=CUT_OFF)
    off = (turns.inv() * Rotation.from_quat(path.shape(TIMES))).magnitude()
    assert off[MIDDLE].max() < 1e-11
    # An open end has the weights of a natural spline, which miss what bends there: (f/cut_off)^2 of its size.
    assert 1e-4 < off.max() < (8.0 / (4.0 * np.pi) / CUT_OFF) ** 2
    with pytest.raises(TrajectoryError, match="lowpass"):
        sp.read_shape_path(of_ball(turns), ball, lowpass=0.3)


def test_bars_hold_the_noise_that_passes():
    rng = np.random.default_rng(7)
    clean = swinging(1.0, 2.0)
    weights = by_scipy(np.eye(401))[200]
    paths = [
        sp.read_shape_path(frame(clean + 0.01 * rng.normal(size=clean.shape)), DIVER, lowpass=CUT_OFF)
        for _ in range(25)
    ]
    errors = sp.path_errors(paths[0], TIMES, 0.01)
    np.testing.assert_allclose(errors.shape[200], 0.01 * np.linalg.norm(weights), rtol=1e-9)
    at = np.array([0.0, 0.05, 4.0])
    expected = sp.path_errors(paths[0], at, 0.01)
    off = np.array([path.shape(at) for path in paths])
    spread = np.sqrt(((off - off.mean(axis=0)) ** 2).sum(axis=(0, 2)) / 48.0)
    # 48 squares know a variance to sqrt(2/48); four of these deviations.
    np.testing.assert_allclose(spread**2, expected.shape[:, 0] ** 2, rtol=4.0 * np.sqrt(2.0 / 48.0))
    assert (errors.shape[[0, -1]] > 1.5 * errors.shape[200]).all()


def test_the_noise_is_what_is_above_twice_the_cut_off():
    clean = swinging(1.0, 2.0)
    noisy = clean + np.array([0.01, 0.002]) * np.random.default_rng(2).normal(size=clean.shape)
    motion = sp.read_recorded_motion(frame(noisy), DIVER, lowpass=CUT_OFF)
    found = np.array(list(motion.record["lowpass"]["noise"].values()))
    # About 300 of 401 squares are above.
    np.testing.assert_allclose(found, [0.01, 0.002], rtol=4.0 / np.sqrt(600.0))
    unstated = sp.path_errors(motion.path, [2.0])
    np.testing.assert_allclose(unstated.shape, sp.path_errors(motion.path, [2.0], found).shape, rtol=1e-12)


def test_what_may_be_lost_is_on_record():
    motion = sp.read_recorded_motion(frame(swinging(1.0, 7.0)), DIVER, lowpass=CUT_OFF, close=False)
    record = json.loads(json.dumps(motion.record))["lowpass"]
    twice = RATE / np.pi * np.arctan(2.0 * np.tan(np.pi * CUT_OFF / RATE))
    assert record["twice_the_cut_off_hz"] == pytest.approx(twice, rel=1e-12)
    lost = (response(7.0, twice) - response(7.0)) / np.sqrt(2.0)
    assert record["rms_up_to_twice_the_cut_off"][RIGHT] == pytest.approx(lost, rel=0.01)
    assert record["affected_at_ends_s"] == pytest.approx([0.7 / 6.0] * 2, rel=1e-12)


def test_a_stretch_is_filtered_with_all_around_it():
    noisy = swinging(1.0, 2.0) + 0.01 * np.random.default_rng(4).normal(size=(401, 2))
    turns = Rotation.from_euler("xyz", swinging(1.0, 0.5, 0.7))
    table = frame(noisy, **base_of(turns))
    whole = sp.read_recorded_motion(table, DIVER, lowpass=CUT_OFF)
    for part in (
        sp.read_recorded_motion(table, DIVER, lowpass=CUT_OFF, trim=(1.0, 3.0)),
        sp.read_recorded_motion(table, DIVER, lowpass=CUT_OFF, flight=(1.0, 3.0)),
    ):
        np.testing.assert_allclose(part.path.shape(part.times), whole.path.shape(1.0 + part.times), rtol=0, atol=1e-13)
        np.testing.assert_allclose(part.base_attitude, whole.base_attitude[100:301], rtol=0.0, atol=1e-13)
        assert part.record["lowpass"]["affected_at_ends_s"] == [0.0, 0.0]


def test_a_loop_is_filtered_all_the_way_round():
    shapes = np.sin(2.0 * np.pi * np.outer(TIMES, [1.0, 7.0]))
    shapes[-1] = shapes[0]
    path = sp.read_shape_path(frame(shapes), DIVER, lowpass=CUT_OFF)
    np.testing.assert_allclose(path.shape(TIMES), shapes * response(np.array([1.0, 7.0])), rtol=0.0, atol=1e-11)


def test_uneven_samples_are_put_on_even_times_first():
    uneven = np.cumsum(np.where(np.arange(401) % 2, 0.009, 0.011))
    shapes = np.stack([np.sin(uneven), np.cos(uneven)], axis=1)
    turns = Rotation.from_rotvec(8.0 * uneven[:, None] * AXIS)
    table = frame(shapes, uneven, **base_of(turns))
    with pytest.raises(TrajectoryError, match="--resample"):
        sp.read_recorded_motion(table, DIVER, lowpass=CUT_OFF)
    with pytest.raises(TrajectoryError, match="--resample"):
        sp.read_recorded_motion(table, DIVER, lowpass=CUT_OFF, resample=200)
    motion = sp.read_recorded_motion(table, DIVER, lowpass=CUT_OFF, resample=100)
    at = uneven[0] + motion.times
    np.testing.assert_allclose(np.diff(motion.times), 0.01, rtol=1e-10)
    np.testing.assert_allclose(
        motion.base_attitude, Rotation.from_rotvec(8.0 * at[:, None] * AXIS).as_matrix(), rtol=0.0, atol=1e-9
    )
    expected = np.stack([np.sin(at), np.cos(at)], axis=1) * response(0.5 / np.pi)
    np.testing.assert_allclose(motion.path.shape(motion.times)[MIDDLE], expected[MIDDLE], rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"lowpass": 6, "smooth": 0.01}, "--smooth"),
        ({"lowpass": 6, "smooth_penalty": 1e-9}, "--smooth-penalty"),
        ({"lowpass": 50}, "--lowpass"),
        ({"lowpass": 0}, "lowpass"),
        ({"lowpass": "fast"}, "lowpass"),
        ({"lowpass": 6, "trim": (1.0, 9.0), "rest": {LEFT: 0.0}}, "rest"),
    ],
)
def test_wrong_calls_say_what_to_type(options, words):
    with pytest.raises((TrajectoryError, ValueError), match=words):
        sp.read_shape_path(frame(swinging(1.0, 2.0)), DIVER, **options)
