"""Arrays of simulators without names of joints: MuJoCo compiles the file itself, and its order is the truth."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import ShapeError, TrajectoryError, TrajectoryWarning

LEGS = Path(__file__).parents[2] / "cases" / "right_before_left.urdf"
# By hand, of that file: level by level.
BREADTH = ("right_hip", "left_hip", "right_knee", "left_knee")
BY_NAME = ("left_hip", "right_hip", "left_knee", "right_knee")
TIMES = np.linspace(0.0, 1.0, 40)
INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'


def random_tree(rng):
    """A URDF of eight links joined at random, a third of them fixed, elements and names in random order."""
    names = rng.permutation(list("abcdefgh")).tolist()
    text = []
    for child, name in enumerate(names):
        text.append(f'<link name="{name}">{INERTIAL}</link>')
        if child:
            kind = rng.choice(["revolute", "continuous", "fixed"], p=[0.4, 0.3, 0.3])
            mimic = f'<mimic joint="j{names[1]}" multiplier="2"/>' if child == 7 and kind == "revolute" else ""
            kind = "revolute" if child == 1 else kind
            text.append(
                f'<joint name="j{name}" type="{kind}"><parent link="{names[rng.integers(child)]}"/>'
                f'<child link="{name}"/>'
                f'<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>{mimic}</joint>'
            )
    return f'<robot name="r">{"".join(rng.permutation(text))}</robot>'


def in_mujoco(path):
    """The model of a URDF with a free joint, as it compiles it."""
    written = mujoco.MjSpec.from_file(str(path))
    written.compiler.fusestatic = False
    written.worldbody.first_body().add_freejoint()
    return written.compile()


@pytest.mark.parametrize("seed", range(12))
def test_qpos_is_in_the_order_in_which_mujoco_compiles_the_file(seed, tmp_path):
    rng = np.random.default_rng(seed)
    path = tmp_path / "r.urdf"
    path.write_text(random_tree(rng))
    model, body = in_mujoco(path), sp.load_body(path)
    names = [model.joint(k).name for k in range(1, model.njnt)]
    joints = rng.uniform(-1.0, 1.0, (len(TIMES), len(names)))
    place = np.tile([0.1, 0.2, 0.3, 0.5, -0.5, 0.5, 0.5], (len(TIMES), 1))
    np.savez(tmp_path / "m.npz", time=TIMES, qpos=np.hstack([place, joints]))
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", body)
    expected = joints[:, [names.index(name) for name in body.joint_names]]
    np.testing.assert_allclose(recorded.path.shape(TIMES), expected, atol=1e-12)
    assert recorded.record["joint_order"]["joints"] == names
    np.testing.assert_array_equal(sp.read_trajectory(tmp_path / "m.npz", body).shapes, expected)
    # Without the followers, as people leave them out, and in columns.
    own = [k for k, name in enumerate(names) if name in body.joint_names]
    labels = ",".join(["time", *(f"qpos_{k}" for k in range(7 + len(own)))])
    table = np.column_stack([TIMES, place, joints[:, own]])
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header=labels, comments="")
    np.testing.assert_allclose(sp.read_trajectory(tmp_path / "m.csv", body).shapes, expected, atol=1e-15)


def recorded_by(order, first=0, quaternions="wxyz"):
    """Arrays as Isaac Lab's: joints and bodies in an order, where MuJoCo has the bodies at these joints."""
    model = in_mujoco(LEGS)
    data = mujoco.MjData(model)
    names = [model.joint(k).name for k in range(1, model.njnt)]
    links = ["trunk", *(name.replace("hip", "thigh").replace("knee", "shank") for name in order)]
    joints = np.stack([0.5 + 0.4 * np.sin(3.0 * TIMES + first + k) for k in range(len(order))], axis=1)
    turned = Rotation.from_rotvec(np.outer(TIMES, [0.5, -1.0, 0.7]))
    places = np.empty((len(TIMES), len(links), 3))
    for row, values in enumerate(joints):
        data.qpos[:3], data.qpos[3:7] = [1.0, 2.0, row / 10.0], np.roll(turned[row].as_quat(), 1)
        data.qpos[7:] = [values[order.index(name)] for name in names]
        mujoco.mj_kinematics(model, data)
        places[row] = [data.body(link).xpos for link in links]
    base = turned.as_quat() if quaternions == "xyzw" else np.roll(turned.as_quat(), 1, axis=1)
    return {
        "fps": np.array([39]),
        "joint_pos": joints.astype(np.float32),
        "joint_vel": np.zeros_like(joints),
        "body_pos_w": places.astype(np.float32),
        "body_quat_w": np.repeat(base[:, None], len(links), axis=1).astype(np.float32),
    }, turned


@pytest.mark.parametrize("order", [BREADTH, BY_NAME, ("right_hip", "right_knee", "left_hip", "left_knee")])
@pytest.mark.parametrize("quaternions", ["wxyz", "xyzw"])
def test_isaacs_order_is_the_one_in_which_links_lie_at_the_bodies(order, quaternions, tmp_path):
    body = sp.load_body(LEGS)
    arrays, turned = recorded_by(order, quaternions=quaternions)
    np.savez(tmp_path / "m.npz", **arrays)
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", body)
    expected = arrays["joint_pos"][:, [order.index(name) for name in body.joint_names]]
    np.testing.assert_allclose(recorded.path.shape(TIMES), expected, atol=1e-6)
    np.testing.assert_allclose(recorded.base_attitude, turned.as_matrix(), atol=1e-6)
    np.testing.assert_allclose(recorded.base_position, arrays["body_pos_w"][:, 0], atol=1e-6)
    np.testing.assert_allclose(recorded.times, TIMES, atol=1e-12)
    # The same places beside qpos overrule MuJoCo's order, which is a default.
    place = np.column_stack([arrays["body_pos_w"][:, 0], np.roll(turned.as_quat(), 1, axis=1)])
    rest = {"time": TIMES, "body_pos_w": arrays["body_pos_w"]}
    np.savez(tmp_path / "q.npz", qpos=np.hstack([place, arrays["joint_pos"]]), **rest)
    assert sp.read_recorded_motion(tmp_path / "q.npz", body).record["joint_order"]["joints"] == list(order)
    np.testing.assert_allclose(sp.read_trajectory(tmp_path / "q.npz", body).shapes, expected, atol=1e-6)


def test_an_order_is_asked_for_by_its_name(tmp_path, capsys):
    body = sp.load_body(LEGS)
    joints = np.column_stack([np.sin((k + 1) * TIMES) for k in range(4)])
    np.savez(tmp_path / "m.npz", time=TIMES, qpos=joints)
    for word, names in (("isaac-by-name", BY_NAME), ("body", body.joint_names)):
        path = sp.read_shape_path(tmp_path / "m.npz", body, joint_order=word)
        np.testing.assert_allclose(path.shape(TIMES), joints[:, [names.index(name) for name in body.joint_names]])
    with pytest.warns(TrajectoryWarning, match="isaac-by-name"):
        path = sp.read_shape_path(tmp_path / "m.npz", body, joint_order="isaac")
    np.testing.assert_allclose(path.shape(TIMES), joints[:, [BREADTH.index(name) for name in body.joint_names]])
    main(["check", str(LEGS), str(tmp_path / "m.npz")])
    assert "compiles the body's file (mujoco): right_hip, right_knee, left_hip, left_knee" in capsys.readouterr().out
    with pytest.raises(sp.errors.UnknownNameError, match="joint_order"):
        sp.read_shape_path(tmp_path / "m.npz", body, joint_order="drake")


def test_what_cannot_be_told_is_asked(tmp_path):
    body = sp.load_body(LEGS)
    arrays, _ = recorded_by(BREADTH)
    for change, words in (
        ({"body_pos_w": None}, "joint_pos does not say the order.*--joint-order isaac"),
        ({"body_pos_w": 2.0 * arrays["body_pos_w"]}, "in no order of the joints do the links"),
        ({"body_pos_w": arrays["body_pos_w"][:, :3], "body_quat_w": arrays["body_quat_w"][:, :3]}, "cannot be told"),
        ({"fps": np.array([0.0])}, "fps: one number above 0"),
    ):
        np.savez(tmp_path / "m.npz", **{k: v for k, v in (arrays | change).items() if v is not None})
        with pytest.raises(TrajectoryError, match=words):
            sp.read_shape_path(tmp_path / "m.npz", body)
    (tmp_path / "m.csv").write_text("time,right_hip,right_knee,left_hip,left_knee\n0,0,0,0,0\n0.5,1,0,0,0\n1,0,0,0,0\n")
    with pytest.raises(TrajectoryError, match="joint_order"):
        sp.read_shape_path(tmp_path / "m.csv", body, joint_order="isaac")
    qpos = np.tile([0.0, 0.0, 0.0, 1.0] + 7 * [0.0], (20, 1))
    with pytest.raises(ShapeError, match="joint_order"):
        sp.FloatingTrajectory.from_mujoco(body, TIMES[:20], qpos, joint_names=BREADTH, joint_order="body")


def test_what_is_written_for_mujoco_fits_what_it_compiles():
    body, model = sp.load_body(LEGS), in_mujoco(LEGS)
    path = sp.ShapePath.spline(
        TIMES, np.column_stack([np.sin(k * TIMES) for k in range(4)]), joint_names=body.joint_names
    )
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0])
    plain, named = (sp.exports.mujoco_arrays(motion, [0.5], model=one) for one in (None, model))
    assert plain.joint_names == named.joint_names
    np.testing.assert_array_equal(plain.qpos, named.qpos)


def test_numbers_of_a_ball_joint_begin_with_w(tmp_path):
    """MuJoCo writes w x y z, and the shape has x y z w."""
    inertial = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.2 0.2"/>'
    (tmp_path / "b.xml").write_text(
        f'<mujoco><worldbody><body name="trunk"><freejoint/>{inertial}<body name="arm"><joint name="ball" type="ball"/>'
        f"{inertial}</body></body></worldbody></mujoco>"
    )
    turned = Rotation.from_rotvec(np.outer(TIMES, [0.1, 0.7, -0.4]))
    place = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(TIMES), 1))
    np.savez(tmp_path / "m.npz", time=TIMES, qpos=np.hstack([place, np.roll(turned.as_quat(), 1, axis=1)]))
    body = sp.load_body(tmp_path / "b.xml")
    path = sp.read_shape_path(tmp_path / "m.npz", body)
    poses = body.link_pose(path.shape(TIMES), "arm")[:, :3, :3]
    np.testing.assert_allclose(poses, turned.as_matrix(), atol=1e-12)
