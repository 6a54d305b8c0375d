"""Gaps of a recording: refused by column and time, bridged where they are short, cut off at the ends."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import TrajectoryError

DIVER = sp.load_body("diver")
LEFT, RIGHT = DIVER.joint_names
TIMES = 0.02 * np.arange(41)
JOINTS = np.stack([np.sin(3.0 * TIMES), 0.3 + TIMES - 2.0 * TIMES**3], axis=1)
AXIS = np.array([1.0, -2.0, 2.0]) / 3.0
TURNS = Rotation.from_rotvec(4.0 * TIMES[:, None] * AXIS)
PLACES = np.stack([TIMES, 1.0 - TIMES**2, TIMES**3], axis=1)
QUATERNION = ["base_qx", "base_qy", "base_qz", "base_qw"]
HEADER = ["time", LEFT, RIGHT, *QUATERNION, "base_x", "base_y", "base_z"]


def table(**gaps):
    """The recording as a data frame, with gaps: column -> samples."""
    frame = pd.DataFrame(np.column_stack([TIMES, JOINTS, TURNS.as_quat(), PLACES]), columns=HEADER)
    for column, samples in gaps.items():
        frame.loc[list(samples), column] = np.nan
    return frame


def test_without_fill_a_gap_is_refused_by_column_and_time_with_what_to_type():
    with pytest.raises(TrajectoryError, match="gap") as caught:
        sp.read_shape_path(table(**{LEFT: range(10, 13), RIGHT: [20]}), DIVER)
    said = str(caught.value)
    for words in (
        f"'{LEFT}' from 0.18 to 0.26 s (rows 10 to 12, 0.08 s)",
        f"'{RIGHT}' from 0.38 to 0.42 s",
        "fill=0.08",
        "--fill 0.08s",
    ):
        assert words in said
    assert sp.read_shape_path(table(**{LEFT: range(10, 13), RIGHT: [20]}), DIVER, fill=0.08).duration == TIMES[-1]


def test_joints_and_places_go_on_by_a_cubic():
    gone = range(10, 14)
    motion = sp.read_recorded_motion(table(**{LEFT: gone, RIGHT: gone, "base_y": gone}), DIVER, fill="0.1s")
    there = np.delete(np.arange(41), list(gone))
    expected = CubicSpline(TIMES[there], JOINTS[there])(TIMES)
    np.testing.assert_allclose(motion.path.shape(TIMES), expected, rtol=0.0, atol=1e-14)
    # Cubics themselves come through as they are.
    np.testing.assert_allclose(motion.path.shape(TIMES)[:, 1], JOINTS[:, 1], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(motion.base_position, PLACES, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("part", QUATERNION)
def test_a_constant_rate_about_a_tilted_axis_comes_through_a_gap(part):
    motion = sp.read_recorded_motion(table(**{part: range(15, 20)}), DIVER, fill=0.2)
    np.testing.assert_allclose(motion.base_attitude, TURNS.as_matrix(), rtol=0.0, atol=1e-12)
    (filled,) = motion.record["gaps"]["filled"]
    assert (filled["columns"], filled["by"]) == (QUATERNION, "rotation spline")


def test_three_angles_have_one_gap():
    frame = table().drop(columns=QUATERNION)
    frame[["base_roll", "base_pitch", "base_yaw"]] = TURNS.as_euler("ZYX")[:, ::-1]
    frame.loc[[7, 8], "base_pitch"] = np.nan
    motion = sp.read_recorded_motion(frame, DIVER, fill=0.1)
    np.testing.assert_allclose(motion.base_attitude, TURNS.as_matrix(), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("columns", [("x", "y", "z", "w"), ("rz", "rx", "ry")])
def test_a_ball_joint_goes_on_as_a_rotation(tmp_path, columns):
    link = '<link name="{}"><inertial><mass value="2"/><inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/>'
    links = "".join((link + "</inertial></link>").format(name) for name in ("trunk", "arm"))
    ball = '<joint name="shoulder" type="spherical"><parent link="trunk"/><child link="arm"/></joint>'
    (tmp_path / "b.urdf").write_text(f'<robot name="b">{links}{ball}</robot>')
    body = sp.load_body(tmp_path / "b.urdf")
    values = TURNS.as_quat() if len(columns) == 4 else TURNS.as_euler("ZXY")
    frame = pd.DataFrame(values, columns=[f"shoulder.{part}" for part in columns])
    frame.insert(0, "time", TIMES)
    frame.loc[[5, 6], f"shoulder.{columns[1]}"] = np.nan
    path = sp.read_shape_path(frame, body, fill="60ms")
    off = Rotation.from_quat(path.shape(TIMES)) * TURNS.inv()
    assert off.magnitude().max() < 1e-12


def test_what_was_filled_is_on_record():
    motion = sp.read_recorded_motion(table(**{LEFT: [3, 4]}), DIVER, fill="70 ms")
    gaps = json.loads(json.dumps(motion.record["gaps"]))
    assert gaps["cut"] == []
    (filled,) = gaps["filled"]
    assert (filled["columns"], filled["samples"], filled["by"]) == ([LEFT], 2, "cubic spline")
    np.testing.assert_allclose([filled["after"], filled["until"], filled["seconds"]], [0.04, 0.1, 0.06], atol=1e-15)
    assert sp.read_recorded_motion(table(), DIVER, fill="70 ms").record["gaps"] is None


def test_longer_gaps_are_refused_by_time_and_length():
    with pytest.raises(TrajectoryError, match="--fill"):
        sp.read_shape_path(table(**{LEFT: range(10, 15), RIGHT: [20]}), DIVER, fill=0.1)


def test_gaps_at_the_ends_are_cut_off():
    frame = table(**{LEFT: range(4), RIGHT: [39, 40]})
    with pytest.raises(TrajectoryError, match="start"):
        sp.read_shape_path(frame, DIVER)
    motion = sp.read_recorded_motion(frame, DIVER, fill=0.05)
    np.testing.assert_array_equal(motion.path.shape(motion.times), JOINTS[4:39])
    assert (motion.record["first_time"], motion.record["last_time"]) == (TIMES[4], TIMES[38])
    assert [(cut["columns"], cut["at"], cut["samples"]) for cut in motion.record["gaps"]["cut"]] == [
        ([LEFT], "start", 4),
        ([RIGHT], "end", 2),
    ]


def test_words_infinities_and_missing_times_stay_errors(tmp_path):
    for column, entry, words in ((RIGHT, "x", "row 5, column.*'x'"), (LEFT, "inf", "row 5"), ("time", "", "row 5")):
        frame = table().astype(object)
        frame.loc[3, column] = entry
        frame.to_csv(tmp_path / "m.csv", index=False)
        with pytest.raises(TrajectoryError, match=words):
            sp.read_shape_path(tmp_path / "m.csv", DIVER, fill=0.1)


def test_a_turn_that_may_have_gone_either_way_is_refused():
    frame = table()
    frame[QUATERNION] = Rotation.from_rotvec(30.0 * TIMES[:, None] * AXIS).as_quat()
    frame.loc[range(10, 14), QUATERNION] = np.nan
    with pytest.raises(TrajectoryError, match="--flight"):
        sp.read_recorded_motion(frame, DIVER, fill=0.2)


def test_a_column_without_numbers_is_named():
    with pytest.raises(TrajectoryError, match="--names"):
        sp.read_shape_path(table(**{LEFT: range(41)}), DIVER, fill=9.0)


def test_bridges_of_a_stretch_know_what_is_smoothed_around_it():
    frame = table(**{LEFT: [20]})
    cut = sp.read_recorded_motion(frame, DIVER, fill=0.1, trim=(0.2, 0.6), smooth=1e-3)
    whole = sp.read_recorded_motion(frame, DIVER, fill=0.1, smooth=1e-3)
    assert abs(cut.path.shape(0.2) - whole.path.shape(0.4)).max() < 1e-5


@pytest.mark.parametrize("fill", [0, -1.0, "1 apple", True, "soon", np.nan])
def test_a_wrong_length_is_refused(fill):
    with pytest.raises(TrajectoryError, match="fill"):
        sp.read_shape_path(table(), DIVER, fill=fill)


def test_limits_are_told_in_one_line_and_not_for_the_last_digits(recwarn):
    frame = table()
    limits = DIVER.joint_limits
    frame[LEFT], frame[RIGHT] = limits[0, 1] * (1.0 + 5e-7), limits[1, 0]
    sp.read_shape_path(frame, DIVER)
    assert not recwarn.list
    frame.loc[5, LEFT], frame.loc[7, RIGHT] = limits[0, 1] + 0.1, limits[1, 0] - 0.2
    sp.read_shape_path(frame, DIVER)
    (warning,) = recwarn.list
    assert f"row 7: joint {RIGHT}" in str(warning.message)
    assert f"by 0.2 rad (in 1 of 41 rows); beyond theirs, too: {LEFT}" in str(warning.message)
