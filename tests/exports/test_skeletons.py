"""Motions of skeletons, replayed: by OpenSim itself, by our reader of its files, and by the definition of BVH."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from shapephase.examples import kane_scher
from support import osim_models
from support.ball_bodies import BALLS
from support.independent import apart, body_of, random_loop, random_rotation
from support.opensim_oracle import replayed

FALL = {"start": [0.5, -0.2, 3.0], "velocity": [1.0, 0.3, 2.0], "gravity": [0.0, -9.81, 0.0]}
TIMES = np.linspace(0.0, 2.0, 23)
SHIFTED = "<translation>0 0.1 0</translation>"
"""Where the model has its joint with the ground: places of the base count from there."""
UP = {"x": [2, 0, 1], "y": [0, 1, 2], "z": [1, 2, 0]}
"""Axes of the motion that become x, y, z of a BVH file."""


def motion_of(body, *, size=0.5):
    loop = random_loop(91, body.n_shape, size=size)
    lower, upper = body.joint_limits.T
    middle = np.where(lower > -size, lower + 3.0 * size, np.where(upper < size, upper - 3.0 * size, 0.0))
    deformation = sp.articulated(body, replace(loop, mean=middle).path)
    return sp.reconstruct(deformation, 0.3 * np.ones(3), random_rotation(92))


def world_poses(motion, body, link, times):
    """(N, 4, 4) in inertial axes."""
    base = np.tile(np.eye(4), (len(times), 1, 1))
    base[:, :3, :3], base[:, :3, 3] = motion.attitude(times), motion.base_position(times, **FALL)
    return base @ body.link_pose(motion.deformation.description.path.shape(times), link)


# ---- OpenSim --------------------------------------------------------------------------------------------------------


@pytest.mark.full
@pytest.mark.skipif(find_spec("opensim") is None, reason="opensim is not installed")
def test_opensim_has_pelvis_and_hands_where_the_motion_has_them(tmp_path):
    """Its own reader, its own kinematics; of links above the coupled joints, which only its assembly would move."""
    model = tmp_path / "gait.osim"
    model.write_text(osim_models.gait().replace(SHIFTED, SHIFTED.replace("0.1", "0")), encoding="utf-8")
    body = sp.load_body(model)
    motion = motion_of(body, size=0.05)
    sp.exports.write_opensim_motion(motion, tmp_path / "flight.mot", TIMES, **FALL)
    links = ["pelvis", "torso", "femur_r", "femur_l"]
    found = replayed(model, tmp_path / "flight.mot", links)
    np.testing.assert_allclose(found["times"], TIMES, rtol=0, atol=1e-15)
    for link in links:
        ours = world_poses(motion, body, link, TIMES)
        np.testing.assert_allclose(found["poses"][link], ours, rtol=0, atol=1e-13, err_msg=link)
    again = sp.read_recorded_motion(tmp_path / "flight.mot", body, close=False)
    assert apart(again.base_attitude, motion.attitude(TIMES)) < 1e-14
    np.testing.assert_allclose(again.base_position, motion.base_position(TIMES, **FALL), rtol=0, atol=1e-14)


def test_our_reader_has_the_base_of_a_body_that_opensim_has_not(tmp_path):
    """As a pelvis, x forward, y up, z right, where the body has x forward, y left, z up."""
    body = body_of("cat_two_halves")
    motion = sp.reconstruct(sp.articulated(body, kane_scher(0.3, 0.5, duration=2.0)), [0.0, 0.01, 0.005])
    sp.exports.write_opensim_motion(motion, tmp_path / "flight.mot", TIMES, **FALL)
    found = sp.read_recorded_motion(tmp_path / "flight.mot", body, close=False)
    assert apart(found.base_attitude, motion.attitude(TIMES)) < 1e-14
    shapes = motion.deformation.description.path.shape(TIMES)
    np.testing.assert_allclose(found.path.shape(TIMES), shapes, rtol=0, atol=1e-14)
    # The pelvis of somebody who lies as the ground does: its z is the body's right, -y.
    lying = sp.reconstruct(motion.deformation, np.zeros(3), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
    sp.exports.write_opensim_motion(lying, tmp_path / "lying.mot", [0.0])
    assert np.abs(np.array((tmp_path / "lying.mot").read_text().split("\n")[7].split()[1:4], float)).max() < 1e-15


# ---- BVH ------------------------------------------------------------------------------------------------------------


def bones(file):
    """Of a BVH file by its definition: names, parents, poses of all bones in all frames (N, b, 4, 4), the frame time.

    A bone's place is its offset, or its channels of position where it has these; its channels of rotation are applied
    in their order.
    """
    words, rows = file.read_text().split("MOTION")
    lines = [line.split() for line in words.splitlines() if line.strip()]
    found, above, current, ended = [], [], None, False
    for line in lines[1:]:
        if line[0] in ("ROOT", "JOINT"):
            current = {"name": line[1], "parent": above[-1] if above else None}
            found.append(current)
        elif line[0] == "End":
            ended = True
        elif line[0] == "{":
            above.append(None if ended else len(found) - 1)
        elif line[0] == "}":
            above.pop()
            ended = False
        elif line[0] == "OFFSET" and not ended:
            current["offset"] = np.array(line[1:], float)
        elif line[0] == "CHANNELS":
            assert int(line[1]) == len(line[2:])
            current["channels"] = line[2:]
    assert above == []
    frames, time, *values = rows.strip().splitlines()
    values = np.array([row.split() for row in values], float)
    assert int(frames.split()[1]) == len(values)
    poses, column = np.tile(np.eye(4), (len(values), len(found), 1, 1)), 0
    for number, bone in enumerate(found):
        pose = np.tile(np.eye(4), (len(values), 1, 1))
        pose[:, :3, 3] = bone["offset"]
        for channel in bone["channels"]:
            here, axis = values[:, column], channel[0].lower()
            if channel.endswith("position"):
                pose[:, "xyz".index(axis), 3] = here
            else:
                pose[:, :3, :3] = pose[:, :3, :3] @ Rotation.from_euler(axis, here[:, None], degrees=True).as_matrix()
            column += 1
        poses[:, number] = pose if bone["parent"] is None else poses[:, bone["parent"]] @ pose
    assert column == values.shape[1]
    return [bone["name"] for bone in found], poses, float(time.split()[2])


@pytest.mark.parametrize(
    ("name", "up", "scale"), [("satellite", "z", 100.0), ("cat", "y", 1.0), ("astronaut", "x", 1.0)]
)
def test_a_skeleton_moves_as_the_body_does(tmp_path, name, up, scale):
    """Every bone begins at its joint; bones are turned from where they are at zero as the links are."""
    body = body_of(name)
    motion = motion_of(body)
    sp.exports.write_bvh(motion, tmp_path / "flight.bvh", rate=10.0, up=up, scale=scale, **FALL)
    names, poses, step = bones(tmp_path / "flight.bvh")
    assert set(names) == {body.name, *body.chain.names}
    assert names[0] == body.name
    times = step * np.arange(len(poses))
    assert times[-1] == motion.duration
    axes = np.eye(3)[UP[up]]
    for joint, name in enumerate(body.chain.names):
        frame = joint + 1
        link, inside = next((one, pose) for one, (at, pose) in body.chain.link_frames.items() if at == frame)
        ours = world_poses(motion, body, link, times) @ np.linalg.inv(inside)
        rest = (body.link_pose(np.zeros(body.n_shape), link) @ np.linalg.inv(inside))[:3, :3]
        theirs = poses[:, names.index(name)]
        reach = np.abs(ours[:, :3, 3]).max()
        np.testing.assert_allclose(theirs[:, :3, 3] / scale @ axes, ours[:, :3, 3], rtol=0, atol=1e-13 * reach)
        assert apart(axes.T @ theirs[:, :3, :3] @ axes @ rest, ours[:, :3, :3]) < 1e-13


def test_a_skeleton_with_ball_joints(tmp_path, load_urdf):
    """A ball joint moves one bone, named as it is; files of OpenSim have no place for quaternions."""
    body = load_urdf(BALLS)
    loop = random_loop(91, 9, size=0.3)
    deformation = sp.articulated(body, replace(loop, mean=loop.mean + body.shape()).path)
    motion = sp.reconstruct(deformation, 0.3 * np.ones(3), random_rotation(92))
    sp.exports.write_bvh(motion, tmp_path / "flight.bvh", rate=10.0, up="y", scale=1.0, **FALL)
    names, poses, step = bones(tmp_path / "flight.bvh")
    for link, bone in (("arm", "shoulder"), ("hand", "elbow"), ("head", "neck")):
        ours = world_poses(motion, body, link, step * np.arange(len(poses)))
        rest = body.link_pose(body.shape(), link)[:3, :3]
        theirs = poses[:, names.index(bone)]
        np.testing.assert_allclose(theirs[:, :3, 3], ours[:, :3, 3], rtol=0, atol=1e-13 * np.abs(ours).max())
        assert apart(theirs[:, :3, :3] @ rest, ours[:, :3, :3]) < 1e-13
    with pytest.raises(ShapeError, match="shoulder"):
        sp.exports.write_opensim_motion(motion, tmp_path / "turn.mot")


def test_what_no_skeleton_can_be_is_refused(tmp_path):
    motion = motion_of(body_of("cat_two_halves"))
    for words, kind, said in (
        ({"path": tmp_path / "turn.txt"}, UnknownNameError, ".bvh"),
        ({"path": tmp_path / "turn.bvh", "up": "w"}, UnknownNameError, "axis"),
        ({"path": tmp_path / "turn.bvh", "rate": 0.0}, TrajectoryError, "rate"),
        ({"path": tmp_path / "turn.bvh", "rate": 1e9}, ShapeError, "frames"),
    ):
        with pytest.raises(kind, match=said):
            sp.exports.write_bvh(motion, **words)
    with pytest.raises(UnknownNameError, match=r"\.mot"):
        sp.exports.write_opensim_motion(motion, tmp_path / "turn.csv")
    assert list(tmp_path.iterdir()) == []
