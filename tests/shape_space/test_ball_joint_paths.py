"""Paths of ball joints: curves through quaternions, their joins and loops, and files."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.texts.result_text import body_lines
from shapephase.errors import OpenPathError, ShapeError, TrajectoryError, TrajectoryWarning
from shapephase.plots.pages.motion_data import body_data
from support.ball_bodies import BALLS, THREE_HINGES, Hinges

MOMENTUM = [0.3, -0.1, 0.2]


@pytest.fixture
def body(load_urdf):
    return load_urdf(BALLS)


def swing(times):
    """Angles of the three hinges of both balls and of the elbow, which run once through gimbal lock: (N, 7)."""
    t = np.asarray(times)[..., None]
    sizes = np.array([0.7, 1.9, 0.5, 0.4, 0.6, 0.3, 0.8])
    return sizes * np.sin(2.0 * np.pi * t * [1, 1, 1, 1, 1, 1, 1] + [0.3, -0.2, 1.0, 0.0, 0.5, 1.5, 0.8])


def shapes_of(angles):
    """Of the body with ball joints: (N, 7) -> (N, 9)."""
    return np.concatenate(
        [Hinges.quaternions(angles[:, :3]), Hinges.quaternions(angles[:, 3:6]), angles[:, 6:]], axis=1
    )


def samples(count):
    times = np.linspace(0.0, 1.0, count)
    shapes = shapes_of(swing(times))
    # What SciPy gives has any sign; so have files.
    shapes[::3, :4] *= -1.0
    shapes[1::4, 4:8] *= -1.0
    return times, shapes


def test_a_spline_takes_the_short_way_whatever_the_signs(body):
    times, shapes = samples(41)
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    found = path.shape(times)
    np.testing.assert_allclose(np.abs(np.sum(found[:, :4] * shapes[:, :4], axis=1)), 1.0, rtol=0, atol=1e-14)
    # Between samples it follows the motion, to the order of a spline, and its rates are those of the turn.
    between = times[:-1] + 0.4 * np.diff(times)
    exact = Rotation.from_quat(shapes_of(swing(between))[:, :4])
    off = (exact.inv() * Rotation.from_quat(path.shape(between)[:, :4])).magnitude()
    assert off.max() < 2e-4
    rates = body.joint_rates(path.shape(between), path.rate(between))
    step = 1e-5
    ahead, behind = (Rotation.from_quat(path.shape(between + side * step)[:, :4]) for side in (1.0, -1.0))
    np.testing.assert_allclose((behind.inv() * ahead).as_rotvec() / (2.0 * step), rates[:, :3], rtol=0, atol=1e-7)
    # Twice differentiable: rates of the joints and their derivatives do not jump at a sample.
    near = 1e-7
    sides = [body.joint_rates(path.shape(t), path.rate(t)) for t in (times[10] - near, times[10], times[10] + near)]
    bend = [(sides[1] - sides[0]) / near, (sides[2] - sides[1]) / near]
    np.testing.assert_allclose(bend[0], bend[1], rtol=0, atol=1e-4 * np.abs(bend[0]).max())
    bare = sp.ShapePath.spline(times, shapes)
    with pytest.raises(TrajectoryError, match="shoulder"):
        sp.articulated(body, bare)


def test_turned_frames_turn_the_curve(body):
    """Multiplied by a fixed turn from either side, samples give the multiplied curve."""
    times, shapes = samples(21)
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    before, after = Rotation.from_euler("XYZ", [0.4, -1.0, 0.2]), Rotation.from_euler("XYZ", [1.0, 0.3, 2.0])
    turned = shapes.copy()
    turned[:, :4] = (before * Rotation.from_quat(shapes[:, :4]) * after).as_quat()
    other = sp.ShapePath.spline(times, turned, joint_names=body.joint_names)
    t = np.linspace(0.0, 1.0, 57)
    expected = (before * Rotation.from_quat(path.shape(t)[:, :4]) * after).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(other.shape(t)[:, :4]).as_matrix(), expected, rtol=0, atol=1e-12)


def test_waypoints_go_on_great_circles_from_rest_to_rest(body):
    ends = np.array([body.shape(), body.shape({"shoulder": [0.0, 0.0, -np.sin(0.9), -np.cos(0.9)], "elbow": 1.0})])
    path = sp.ShapePath.waypoints([0.0, 2.0], ends, joint_names=body.joint_names)
    turns = Rotation.from_quat(path.shape(np.linspace(0.0, 2.0, 11))[:, :4]).as_rotvec()
    assert np.abs(turns[:, :2]).max() < 1e-15
    assert turns[-1, 2] == pytest.approx(1.8, rel=1e-14)
    assert np.all(np.diff(turns[:, 2]) > 0.0)
    np.testing.assert_allclose(path.rate([0.0, 2.0]), 0.0, rtol=0, atol=1e-14)


def test_joins_loops_and_reversals(body):
    """The attitude at the end of both halves is that of the whole; there and back without momentum is nothing."""
    times, shapes = samples(31)
    names = body.joint_names
    whole = sp.ShapePath.spline(times, shapes, joint_names=names)
    flipped = shapes[30:] * np.concatenate([np.full(4, -2.0), np.ones(5)])
    back = sp.ShapePath.waypoints([0.0, 1.0], np.concatenate([flipped, shapes[:1]]), joint_names=names)
    both = whole.then(back)
    ends = [sp.horizontal_lift(body, path, 1e-11).end for path in (whole, back, both)]
    np.testing.assert_allclose(ends[0] @ ends[1], ends[2], rtol=0, atol=1e-10)
    np.testing.assert_allclose(sp.holonomy(body, whole.then(whole.reversed()), 1e-11), np.eye(3), rtol=0, atol=1e-10)
    accelerations = both.acceleration([1.2, 1.7])
    step = 1e-4
    expected = (both.rate(np.array([1.2, 1.7]) + step) - both.rate(np.array([1.2, 1.7]) - step)) / (2.0 * step)
    np.testing.assert_allclose(accelerations, expected, rtol=0, atol=1e-4)
    with pytest.raises(TrajectoryError, match="shoulder"):
        whole.then(sp.ShapePath.waypoints([0.0, 1.0], shapes[[4, 8]], joint_names=names))


def test_a_whole_turn_is_a_loop_although_the_quaternion_changes_its_sign(body):
    """The shoulder goes round once about a fixed axis: -p at the end is the same turn, and smooth there."""
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    shapes = np.tile(body.shape({"neck": [0.1, 0.2, 0.0, 1.0]}), (25, 1))
    shapes[:, 0], shapes[:, 1], shapes[:, 3] = 0.6 * np.sin(0.5 * angle), 0.8 * np.sin(0.5 * angle), np.cos(0.5 * angle)
    shapes[:, 8] = 0.3 * np.sin(angle)
    loop = sp.ShapePath.spline(angle / 6.0, shapes, joint_names=body.joint_names)
    (start, end), rates = loop.curve(np.array([0.0, loop.duration]))
    np.testing.assert_allclose(end[:4], -start[:4], rtol=0, atol=1e-15)
    np.testing.assert_allclose(rates[1, :4], -rates[0, :4], rtol=0, atol=1e-13)
    np.testing.assert_allclose(rates[1, 4:], rates[0, 4:], rtol=0, atol=1e-13)
    deformation = sp.articulated(body, loop)
    assert deformation.closure is not None
    turn = sp.holonomy(body, loop, 1e-11)
    twice = sp.horizontal_lift(body, loop.repeated(2), 1e-11)
    np.testing.assert_allclose(twice.end, turn @ turn, rtol=0, atol=1e-10)
    np.testing.assert_allclose(sp.horizontal_lift(body, loop.then(loop), 1e-11).end, turn @ turn, rtol=0, atol=1e-10)
    summary = sp.path_summary(body, loop)
    assert summary.is_loop
    with pytest.raises(OpenPathError, match="shoulder"):
        sp.holonomy(body, sp.ShapePath.spline(angle[:20], shapes[:20], joint_names=body.joint_names))


@pytest.mark.parametrize("gauge", ["base", "horizontal", "principal", "mean_body"])
def test_split_in_gauges_through_gimbal_lock(body, gauge):
    times, shapes = samples(25)
    shapes[-1] = shapes[0]
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), MOMENTUM, tolerance=1e-10)
    found = sp.split(motion, gauge=gauge)
    assert found.residual < 1e-7


# ---- Files ----------------------------------------------------------------------------------------------------------


def written(tmp_path, header, rows):
    file = tmp_path / "motion.csv"
    np.savetxt(file, rows, delimiter=",", header=",".join(header), comments="")
    return file


def test_a_file_of_quaternions_is_read_back(body, tmp_path):
    times, shapes = samples(21)
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    sp.write_shape_path(path, tmp_path / "path.csv")
    again = sp.read_shape_path(tmp_path / "path.csv", body)
    t = np.linspace(0.0, 1.0, 33)
    np.testing.assert_array_equal(again.shape(t), path.shape(t))
    shuffled = ["time", *(f"neck.{part}" for part in "wxyz"), "elbow_deg", *(f"shoulder.{part}" for part in "wzyx")]
    rows = np.column_stack([times, shapes[:, [7, 4, 5, 6]], np.degrees(shapes[:, 8]), shapes[:, [3, 2, 1, 0]]])
    found = sp.read_recorded_motion(written(tmp_path, shuffled, rows), body)
    np.testing.assert_allclose(found.path.shape(t), path.shape(t), rtol=0, atol=1e-12)


@pytest.mark.parametrize("order", ["xyz", "zxy", "yzx"])
def test_angles_are_turns_in_the_order_of_their_columns(body, tmp_path, order):
    times, shapes = samples(21)
    turns = Rotation.from_quat(shapes[:, :4]).as_euler(order.upper(), degrees=True)
    header = ["time", *(f"shoulder.r{axis}_deg" for axis in order), *body.joint_names[4:]]
    found = sp.read_recorded_motion(written(tmp_path, header, np.column_stack([times, turns, shapes[:, 4:]])), body)
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    t = np.linspace(0.0, 1.0, 33)
    seen, expected = (Rotation.from_quat(one.shape(t)[:, :4]).as_matrix() for one in (found.path, path))
    np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-9)
    assert found.record["columns"]["shoulder.w"] == ", ".join(f"shoulder.r{axis}_deg" for axis in order)


def test_noise_of_joints_is_that_of_their_turns(body):
    """A ball joint and a hinge whose samples are off by so much about each axis: one number, and an array by column.

    The quaternion of a turn by d, near that of no turn, is off by d/2 in each of its numbers that change.
    """
    times, shapes = samples(21)
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), MOMENTUM)
    by_column = np.array([0.005] * 8 + [0.01])
    bars = [np.diag(sp.uncertainty(motion, joints=noise).final_attitude) for noise in (0.01, "0.01rad", by_column)]
    np.testing.assert_allclose(bars[0], bars[2], rtol=1e-12)
    np.testing.assert_allclose(bars[1], bars[2], rtol=1e-12)


def test_channels_of_bvh_files_name_angles_of_a_table(body, tmp_path):
    times, shapes = samples(21)
    turns = Rotation.from_quat(shapes[:, :4]).as_euler("YZX", degrees=True)
    header = ["time", *(f"shoulder_{axis}rotation_deg" for axis in "YZX"), *body.joint_names[4:]]
    found = sp.read_recorded_motion(written(tmp_path, header, np.column_stack([times, turns, shapes[:, 4:]])), body)
    seen = Rotation.from_quat(found.path.shape(times)[:, :4]).as_matrix()
    np.testing.assert_allclose(seen, Rotation.from_quat(shapes[:, :4]).as_matrix(), rtol=0, atol=1e-12)


def test_three_hinges_go_on_where_angles_of_a_rotation_jump(load_urdf, tmp_path):
    """Angles as SciPy chooses them, the second within a right angle: the motion whose second goes up to 1.9 rad."""
    hinges = load_urdf(THREE_HINGES)
    times = np.linspace(0.0, 1.0, 61)
    angles = swing(times)
    for ball in (slice(0, 3), slice(3, 6)):
        angles[:, ball] = Rotation.from_euler("XYZ", angles[:, ball]).as_euler("XYZ")
    names = [*(f"shoulder{axis}" for axis in "xyz"), *(f"neck{axis}" for axis in "xyz"), "elbow"]
    header = ["time", *(f"{name}_deg" for name in names)]
    file = written(tmp_path, header, np.column_stack([times, np.degrees(angles)]))
    with pytest.warns(TrajectoryWarning, match="shoulderz"):
        recorded = sp.read_recorded_motion(file, hinges)
    columns = [hinges.joint_index(name) for name in names]
    found = recorded.path.shape(times)[:, columns]
    np.testing.assert_allclose(found - found[0], swing(times) - swing(times)[0], rtol=0, atol=1e-12)


def test_commands_and_exports_know_them(body, tmp_path):
    """The table of a check, a page with the body's ball joints, and an export that is read back."""
    assert body_lines(sp.body_summary(body))[0].endswith("3 joints")
    assert not [doubt for doubt in sp.body.implausible(body) if "limited" in doubt]
    times, shapes = samples(21)
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), MOMENTUM)
    sp.exports.export_motion(motion, tmp_path / "motion.csv", times)
    again = sp.read_shape_path(tmp_path / "motion.csv", body)
    np.testing.assert_allclose(again.shape(times), path.shape(times), rtol=0, atol=1e-15)
    assert body_data(body)["chain"]["balls"] == [{"row": 0, "column": 0}, {"row": 3, "column": 4}]
    q = sp.exports.pinocchio_arrays(motion, times).q
    np.testing.assert_allclose(np.linalg.norm(q[:, 7:11], axis=1), 1.0, rtol=0, atol=1e-14)
    with pytest.raises(ShapeError, match="shoulder"):
        sp.exports.mujoco_arrays(motion)
    with pytest.raises(ShapeError, match="shoulder"):
        sp.optimal_control.extremal(body, shapes[0], np.zeros(9), [0.0, 0.0, 1.0], 1.0)


def test_orbits_close(body):
    """Momenta whose direction comes back: by the degree of the return map at least two; without machine code."""
    times, shapes = samples(21)
    shapes[-1] = shapes[0]
    path = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    deformation = sp.articulated(body, path)
    found = sp.fixed_points(deformation, 0.3)
    assert found.complete
    assert found.index_sum == 2
    for direction in found.directions:
        end = sp.reconstruct(deformation, 0.3 * direction, tolerance=1e-11).body_momentum(deformation.duration)
        np.testing.assert_allclose(end, 0.3 * direction, rtol=0, atol=1e-9)


def test_faults_of_columns_of_ball_joints(body, tmp_path):
    times, shapes = samples(11)
    good = ["time", *body.joint_names]
    long = np.column_stack([times, shapes])
    long[3, 1:5] *= 1.3
    with pytest.raises(TrajectoryError, match="shoulder"):
        sp.read_shape_path(written(tmp_path, good, long), body)
    with pytest.raises(TrajectoryError, match="unit"):
        sp.read_shape_path(written(tmp_path, ["time", "shoulder.x_deg", *good[2:]], long), body)
    angles = np.column_stack([times, np.zeros((11, 3)), shapes[:, 4:]])
    names = ["time", "shoulder.rx", "shoulder.ry", "shoulder.rz", *body.joint_names[4:]]
    with pytest.raises(TrajectoryError, match=r"shoulder\.ry"):
        sp.read_shape_path(written(tmp_path, [n for n in names if n != "shoulder.ry"], np.delete(angles, 2, 1)), body)
    wide = angles.copy()
    wide[4, 2] = 80.0
    with pytest.raises(TrajectoryError, match="degrees"):
        sp.read_shape_path(written(tmp_path, names, wide), body)
    assert sp.read_shape_path(written(tmp_path, names, wide), body, degrees=False).n_shape == 9
    twice = np.column_stack([angles, shapes[:, 0]])
    with pytest.raises(TrajectoryError, match="twice"):
        sp.read_shape_path(written(tmp_path, [*names, "shoulder.x"], twice), body)
    rest = sp.read_shape_path(
        written(tmp_path, ["time", "elbow"], np.column_stack([times, times])), body, rest_missing=True
    )
    np.testing.assert_allclose(rest.shape(0.5)[[3, 7]], 1.0, rtol=0, atol=1e-15)
