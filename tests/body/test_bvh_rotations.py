"""BVH files that write the same poses otherwise: orders of Euler angles, gimbal locks, nodes above the base, own axes.

The poses are rotations of SciPy, and what the files ought to give is computed of these.
"""

from __future__ import annotations

import itertools
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import IgnoredElementWarning, TrajectoryWarning
from support import bvh_files
from support.bvh_files import load

ORDERS = ["".join(axes) for axes in itertools.product("XYZ", repeat=3) if axes[0] != axes[1] != axes[2]]
MOVING = ("Spine", "LeftArm", "RightForeArm", "LeftUpLeg", "RightLeg")
BONES = bvh_files.bones()


def turns_of(order):
    return tuple(f"{axis}rotation" for axis in order)


def euler_angles(rotation, order, branches):
    """In degrees, of each frame on one of its two branches, as no program would choose them: (N, 3)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        angles = rotation.as_euler(order, degrees=True)
    mirrored = -angles[:, 1] if order[0] == order[2] else 180.0 - angles[:, 1]
    other = np.stack([angles[:, 0] + 180.0, mirrored, angles[:, 2] - 180.0], axis=1)
    return np.where(branches[:, None], other, angles)


def random_walk(seed, rate, frames):
    """Rotations of some bones, the base among them, in frames: angular velocities that change little by little.

    The left arm starts where the second axis of many orders locks.
    """
    generator = np.random.default_rng(seed)
    poses = {}
    for bone in ("Hips", *MOVING):
        rates = np.cumsum(generator.standard_normal((frames, 3)), axis=0) * 4.0 / np.sqrt(rate)
        steps = Rotation.from_rotvec(np.clip(rates, -6.0, 6.0) / rate)
        start = (
            Rotation.from_euler("YZ", [90.0, 90.0], degrees=True)
            if bone == "LeftArm"
            else Rotation.random(rng=generator)
        )
        found = [start]
        for step in steps[1:]:
            found.append(found[-1] * step)
        poses[bone] = Rotation.concatenate(found)
    return poses


def written(poses, order, rate, branches, nodes=None):
    """The text of a file with these rotations; of nodes above the root, rotations and places (N, 3) [units]."""
    count = len(poses["Hips"])
    places, hips = np.zeros((count, 3)), poses["Hips"]
    columns = []
    for turn, place in (nodes or {}).values():
        columns += [place, euler_angles(turn, order, branches)]
        # The base is where it was, seen from the node.
        places, hips = turn.inv().apply(places - place), turn.inv() * hips
    columns += [places]
    for name, *_ in BONES:
        rotation = hips if name == "Hips" else poses.get(name, Rotation.identity(count))
        columns.append(euler_angles(rotation, order, branches))
    rows = np.round(np.hstack(columns), 6)
    return bvh_files.bvh_text(rows, 1.0 / rate, turns_of(order), tuple(nodes or ()))


def exact_path(body, poses, times):
    """Through the quaternions of the rotations themselves."""
    shapes = np.tile(body.shape(), (len(times), 1))
    for bone in MOVING:
        first = body.joint_index(f"{bone}.x")
        shapes[:, first : first + 4] = poses[bone].as_quat()
    return sp.ShapePath.spline(times, shapes, periodic=False, joint_names=body.joint_names)


def turn_between(first, second):
    return sp.so3.angle(first.T @ second)


WALKS = {
    "seed": st.integers(0, 2**32 - 1),
    "order": st.sampled_from(ORDERS),
    "rate": st.sampled_from([25.0, 30.0, 60.0, 120.0, 240.0]),
    "nodes": st.sampled_from(["none", "one at rest", "two that move"]),
}


@settings(max_examples=3, derandomize=True, deadline=None)
@given(**WALKS)
def test_one_split_however_rotations_are_written(seed, order, rate, nodes, tmp_path_factory):
    """Any order, branches at random, nodes above the base: attitude and recorded base of the rotations themselves.

    Six decimals of a degree are 1e-8 rad, of each of three angles; splits follow them to 1e-6.
    """
    check_walk(seed, order, rate, nodes, tmp_path_factory)


@pytest.mark.full
@settings(max_examples=100, derandomize=True, deadline=None)
@given(**WALKS)
def test_one_split_of_a_hundred_walks(seed, order, rate, nodes, tmp_path_factory):
    check_walk(seed, order, rate, nodes, tmp_path_factory)


def check_walk(seed, order, rate, nodes, tmp_path_factory):
    frames = 24
    poses = random_walk(seed, rate, frames)
    generator = np.random.default_rng(seed)
    branches = generator.random(frames) < 0.5
    still = Rotation.random(rng=generator)
    walking = random_walk(seed + 1, rate, frames)["Hips"]
    above = {
        "none": {},
        "one at rest": {"Reference": (Rotation.concatenate([still] * frames), np.tile([3.0, -2.0, 0.5], (frames, 1)))},
        "two that move": {
            "Reference": (walking, generator.standard_normal((frames, 3))),
            "Trajectory": (poses["Spine"], np.zeros((frames, 3))),
        },
    }[nodes]
    file = bvh_files.write(tmp_path_factory.mktemp("walk") / "walk.bvh", written(poses, order, rate, branches, above))
    body = load(file)
    recorded = sp.read_recorded_motion(file, body, close=False)
    np.testing.assert_allclose(recorded.base_attitude, poses["Hips"].as_matrix(), rtol=0, atol=1e-7)
    np.testing.assert_allclose(recorded.base_position, np.zeros((frames, 3)), rtol=0, atol=1e-6)
    momentum = [0.3, 2.0, -1.0]
    found, exact = (
        sp.split(sp.reconstruct(sp.articulated(body, path), momentum))
        for path in (recorded.path, exact_path(body, poses, recorded.times))
    )
    for rotation in ("total_rotation", "holonomy", "dynamical_rotation"):
        assert turn_between(getattr(found, rotation), getattr(exact, rotation)) < 1e-6, rotation
    assert found.dynamic_phase == pytest.approx(exact.dynamic_phase, abs=1e-6)


CHAIN = {  # a bone and what hangs on it: offsets in axes of the room, while the person stands
    "Hips": (None, (0.0, 0.0, 0.0)),
    "Spine": ("Hips", (0.0, 10.0, 0.0)),
    "Chest": ("Spine", (0.0, 20.0, 0.0)),
    "Head": ("Chest", (0.0, 25.0, 0.0)),
    "LeftArm": ("Chest", (18.0, 18.0, 0.0)),
    "LeftForeArm": ("LeftArm", (28.0, 0.0, 0.0)),
    "LeftHand": ("LeftForeArm", (25.0, 0.0, 0.0)),
    "RightArm": ("Chest", (-18.0, 18.0, 0.0)),
    "RightForeArm": ("RightArm", (-28.0, 0.0, 0.0)),
    "RightHand": ("RightForeArm", (-25.0, 0.0, 0.0)),
    "LeftUpLeg": ("Hips", (9.0, -5.0, 0.0)),
    "LeftLeg": ("LeftUpLeg", (0.0, -42.0, 0.0)),
    "LeftFoot": ("LeftLeg", (0.0, -42.0, 0.0)),
    "RightUpLeg": ("Hips", (-9.0, -5.0, 0.0)),
    "RightLeg": ("RightUpLeg", (0.0, -42.0, 0.0)),
    "RightFoot": ("RightLeg", (0.0, -42.0, 0.0)),
}
ENDS = {"Head": (0.0, 20.0, 0.0), **dict.fromkeys(("LeftFoot", "RightFoot"), (0.0, -4.0, 15.0)),
        "LeftHand": (8.0, 0.0, 0.0), "RightHand": (-8.0, 0.0, 0.0)}  # fmt: skip
CENTIMETRE = {"length_unit": 0.01}


def person(axes, poses, count, step=0.01):
    """A file of a person whose bones have these axes, standing; posed by turns in axes of the room, of each bone.

    axes : rotation of each bone's axes, in those of the room
    poses : of some bones, turns (N) against the bone that they hang on, seen in axes of the room when standing
    """
    order, lines = [], ["HIERARCHY"]

    def write(bone):
        parent, offset = CHAIN[bone]
        order.append(bone)
        own = axes.get(parent, Rotation.identity()).inv().apply(offset)
        places = "6 Xposition Yposition Zposition" if parent is None else "3"
        lines.extend([f"{'JOINT' if parent else 'ROOT'} {bone}", "{", "OFFSET " + " ".join(map(repr, own.tolist()))])
        lines.append(f"CHANNELS {places} Zrotation Yrotation Xrotation")
        for below, (above, _) in CHAIN.items():
            if above == bone:
                write(below)
        if bone in ENDS:
            tip = axes.get(bone, Rotation.identity()).inv().apply(ENDS[bone])
            lines.extend(["End Site", "{", "OFFSET " + " ".join(map(repr, tip.tolist())), "}"])
        lines.append("}")

    write("Hips")
    columns = [np.tile([0.0, 100.0, 0.0], (count, 1))]
    for bone in order:
        above = axes.get(CHAIN[bone][0], Rotation.identity())
        turn = above.inv() * poses.get(bone, Rotation.identity(count)) * axes.get(bone, Rotation.identity())
        columns.append(turn.as_euler("ZYX", degrees=True))
    rows = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in np.hstack(columns).tolist())
    return "\n".join([*lines, "MOTION", f"Frames: {count}", f"Frame Time: {step}", rows]) + "\n"


def about(axis, degrees):
    """Turns about an axis: (N,) degrees."""
    return Rotation.from_rotvec(np.outer(np.radians(degrees), np.eye(3)["xyz".index(axis)]))


def squats(count):
    """Knees and hips bend and stretch, arms hang; in the frame in the middle the legs are straight."""
    bend = 70.0 * np.cos(np.linspace(0.0, np.pi, count)) ** 2
    poses = {f"{side}UpLeg": about("x", -bend) for side in ("Left", "Right")}
    poses |= {f"{side}Leg": about("x", 1.5 * bend) for side in ("Left", "Right")}
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        poses[f"{side}Arm"] = about("z", np.full(count, sign * 80.0))
    return poses


def loaded(path, text):
    file = bvh_files.write(path, text)
    body = load(file, **CENTIMETRE)
    return body, sp.read_recorded_motion(file, body, close=False)


def test_the_axes_of_bones_have_no_part_in_inertia(tmp_path):
    """Random axes of every bone: in every frame the inertia, and where the centre of mass is, in axes of the room.

    Six decimals of an angle are 1e-8 rad of each of a dozen turns, of inertias up to 15 kg m^2.
    """
    poses = squats(9)
    turned = {bone: Rotation.random(rng=np.random.default_rng(k)) for k, bone in enumerate(CHAIN)}
    bodies = [loaded(tmp_path / f"{k}.bvh", person(axes, poses, 9)) for k, axes in enumerate(({}, turned))]
    seen = []
    for body, recorded in bodies:
        shapes, attitude = recorded.path.shape(recorded.times), recorded.base_attitude
        inertia = attitude @ body.locked_inertia(shapes) @ attitude.transpose(0, 2, 1)
        centre = sp.so3.apply(attitude, body.centre_of_mass(shapes))
        seen.append((inertia, centre))
    np.testing.assert_allclose(seen[1][0], seen[0][0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(seen[1][1], seen[0][1], rtol=0, atol=1e-7)


def test_segments_are_laid_out_in_the_straightest_frame_and_in_a_t_pose(tmp_path):
    """The legs are straight in the middle of the squats; the arms are sideways in one frame only, if there is one."""
    poses, count = squats(9), 9
    with pytest.warns(IgnoredElementWarning, match="person"):
        sp.load_body(bvh_files.write(tmp_path / "squats.bvh", person({}, poses, count)), **CENTIMETRE)
    with pytest.warns(IgnoredElementWarning, match="length-unit"):
        sp.load_body(tmp_path / "squats.bvh", length_unit=0.001)
    # Standing with hanging arms in frames 3 to 5, in the last of which they are raised.
    upright = {bone: turn for bone, turn in poses.items() if bone.endswith("Arm")}
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        upright[f"{side}Arm"] = about("z", sign * np.array([80.0, 70, 60, 30, 0.0, 40, 60, 70, 80]))
    with pytest.warns(IgnoredElementWarning, match="frame"):
        sp.load_body(bvh_files.write(tmp_path / "arms.bvh", person({}, upright, count)), **CENTIMETRE)


def swinging(count, rate):
    """Hanging arms that swing a little."""
    times = np.arange(count) / rate
    swing = 20.0 * np.sin(2.0 * np.pi * times)
    return {
        f"{side}Arm": Rotation.from_euler("zx", np.stack([np.full(count, sign * 75.0), swing], axis=1), degrees=True)
        for side, sign in (("Left", -1.0), ("Right", 1.0))
    }


def preceded(poses, by):
    return {bone: Rotation.concatenate([by, turn]) for bone, turn in poses.items()}


def test_a_first_pose_of_zero_angles_is_left_out(tmp_path):
    """The path of the file with it is that of the file without, and the frame is named."""
    poses, count, rate = swinging(61, 60.0), 61, 60.0
    without = loaded(tmp_path / "without.bvh", person({}, poses, count, 1.0 / rate))[1]
    text = person({}, preceded(poses, Rotation.identity()), count + 1, 1.0 / rate)
    with pytest.warns(TrajectoryWarning, match="LeftArm"):
        body, found = loaded(tmp_path / "with.bvh", text)
    np.testing.assert_allclose(found.times, without.times, rtol=0, atol=1e-15)
    starts = without.path.shape(without.path.breaks)
    np.testing.assert_allclose(found.path.shape(found.path.breaks), starts, rtol=0, atol=1e-15)
    # Cut off by the caller, there is nothing to say.
    trimmed = sp.read_recorded_motion(tmp_path / "with.bvh", body, close=False, trim=(0.5 / rate, 2.0))
    np.testing.assert_allclose(trimmed.path.shape(trimmed.path.breaks), starts, rtol=0, atol=1e-15)


def test_a_motion_that_starts_at_zero_angles_keeps_its_first_frame(tmp_path):
    poses = {"LeftArm": about("z", 40.0 * np.sin(np.arange(61) / 20.0))}
    _, found = loaded(tmp_path / "swing.bvh", person({}, poses, 61, 1.0 / 60.0))
    assert len(found.times) == 61


def test_other_first_poses_are_named_and_stay(tmp_path):
    """One degree off zero in a BVH file, and a column of a table."""
    poses = preceded(swinging(61, 60.0), Rotation.from_euler("x", 1.0, degrees=True))
    with pytest.warns(TrajectoryWarning, match="LeftArm"):
        _, found = loaded(tmp_path / "other.bvh", person({}, poses, 62, 1.0 / 60.0))
    assert len(found.times) == 62
    cat = sp.load_body("cat_two_halves")
    times = np.arange(50) / 50.0
    pitch = 0.5 + 0.1 * np.sin(times)
    pitch[0] = 0.0
    table = tmp_path / "home.csv"
    rows = [f"{time},{value},0,0" for time, value in zip(times, pitch, strict=True)]
    table.write_text("\n".join(["time,waist_pitch,waist_yaw,waist_roll", *rows]))
    with pytest.warns(TrajectoryWarning, match="waist_pitch"):
        assert len(sp.read_recorded_motion(table, cat).times) == 50
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sp.read_recorded_motion(table, cat, trim=(0.01, 1.0))


def test_a_bone_that_turns_faster_than_frames_tell_is_named(tmp_path):
    """By 170 degrees from one frame to the next: it may have been 190 the other way."""
    angles = np.radians(10.0 * np.arange(9))
    angles[5:] += np.radians(160.0)
    poses = {"LeftArm": Rotation.from_rotvec(np.outer(angles, [0.6, 0.0, 0.8]))}
    with pytest.warns(TrajectoryWarning, match="LeftArm"):
        loaded(tmp_path / "fast.bvh", person({}, poses, 9))


def test_what_hangs_beside_the_base_is_no_part_of_the_body(tmp_path):
    """A node above the base carries a prop, too, of which nothing has mass; the prop moves along."""
    plain = person({}, squats(9), 9)
    top = "HIERARCHY\nROOT Reference\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Yrotation Xrotation\n"
    prop = "JOINT Ball\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\n}\n"
    skeleton, motion = plain.split("MOTION\n")
    frames = motion.rstrip().split("\n")
    turn = Rotation.from_euler("ZYX", [-90.0, 0.0, 90.0], degrees=True)
    with_prop = [f"-90 0 90 {frame} {k} {k} {k}" for k, frame in enumerate(frames[2:])]
    text = skeleton.replace("HIERARCHY\n", top).replace("ROOT Hips", "JOINT Hips") + prop
    text += "\n".join(["MOTION", *frames[:2], *with_prop]) + "\n"
    (body, found), (same, expected) = loaded(tmp_path / "prop.bvh", text), loaded(tmp_path / "plain.bvh", plain)
    assert body.link_names == same.link_names
    np.testing.assert_allclose(found.base_attitude, turn.as_matrix() @ expected.base_attitude, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.base_position, turn.apply(expected.base_position), rtol=0, atol=1e-14)
    np.testing.assert_allclose(body.locked_inertia(body.shape()), same.locked_inertia(same.shape()), atol=1e-14)


def test_what_is_written_of_a_person_is_read_back(tmp_path):
    """A motion exported, with one bone for a ball joint by its name: the same person in the same motion."""
    body, recorded = loaded(tmp_path / "squats.bvh", person({}, squats(9), 9))
    motion = sp.reconstruct(sp.articulated(body, recorded.path), [1.0, 2.0, 3.0])
    sp.exports.write_bvh(motion, tmp_path / "again.bvh", rate=100.0, up="y", scale=100.0)
    again = load(tmp_path / "again.bvh", **CENTIMETRE)
    found = sp.read_recorded_motion(tmp_path / "again.bvh", again, close=False)
    assert again.joint_names == body.joint_names
    np.testing.assert_allclose(again.locked_inertia(again.shape()), body.locked_inertia(body.shape()), atol=1e-12)
    np.testing.assert_allclose(found.path.shape(found.times), recorded.path.shape(found.times), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.base_attitude, motion.attitude(found.times), rtol=0, atol=1e-14)


CASES = Path(__file__).parents[1] / "cases"
SQUAT_TURN = (-0.00294847, -0.08212917, -0.01447316)
"""[rad] By steps of fourth order in NumPy and SciPy: quaternions of bones splined, momenta of segments summed."""


@pytest.mark.parametrize(
    ("name", "samples", "turn"),
    [
        ("bvh_plain", 25, SQUAT_TURN),
        ("bvh_across_gimbal_lock", 25, SQUAT_TURN),
        ("bvh_node_above", 25, SQUAT_TURN),
        ("bvh_axes_of_bones", 25, SQUAT_TURN),
        ("bvh_first_pose", 25, (-0.00366069, 0.0, 0.0)),
    ],
)
def test_what_the_shape_alone_does_in_files_of_one_kind_each(name, samples, turn):
    """Of one motion in four spellings, and of another behind a first pose; to the differences of that integration."""
    body = load(CASES / f"{name}.bvh", **CENTIMETRE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TrajectoryWarning)
        recorded = sp.read_recorded_motion(CASES / f"{name}.bvh", body)
    assert len(recorded.times) == samples
    motion = sp.reconstruct(sp.articulated(body, recorded.path), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(sp.so3.log(motion.attitude(motion.duration)), turn, rtol=0, atol=3e-8)
