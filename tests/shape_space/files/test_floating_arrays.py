"""Arrays of a whole floating body as programs make them: what the program itself computes of them is the truth."""

from __future__ import annotations

import json
import locale
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import TrajectoryError, TrajectoryWarning
from support.ball_bodies import BALLS

pytestmark = pytest.mark.usefixtures("warm_engines")
URDF = Path(__file__).parents[2] / "cases" / "boughs.urdf"
BODY = sp.load_body(URDF)
TIMES = np.linspace(0.0, 1.0, 41)
JOINTS = ("right_shoulder", "left_shoulder", "right_elbow")
ANGLES = np.column_stack([np.sin(3.0 * TIMES), 0.5 * np.cos(2.0 * TIMES), 0.3 + 0.4 * TIMES**2])
TURNS = Rotation.from_rotvec(np.column_stack([2.0 * TIMES, 0.5 + TIMES**2, -TIMES]))
PLACES = np.column_stack([0.3 * TIMES, 1.0 - TIMES, 2.0 + TIMES - 4.9 * TIMES**2])
SHAPES = ANGLES[:, [JOINTS.index(name) for name in BODY.joint_names]]


def momentum(run):
    """Angular momentum about the centre of mass from coordinates and rates, world axes, by MuJoCo."""
    spec = mujoco.MjSpec.from_file(str(URDF))
    spec.compiler.fusestatic = False
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    order = [model.joint(k).name for k in range(1, model.njnt)]
    own = [BODY.joint_names.index(name) for name in order]
    found = np.empty((len(run.times), 3))
    for k in range(len(run.times)):
        data.qpos[:] = [*run.position[k], *np.roll(run.quaternion[k], 1), *run.shapes[k, own]]
        data.qvel[:] = [*run.world_velocity[k], *run.base_rate[k], *run.joint_rates[k, own]]
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        found[k] = data.subtree_angmom[1]
    return found


def in_pinocchio():
    model = pin.buildModelFromUrdf(str(URDF), pin.JointModelFreeFlyer())
    names = list(model.names)[2:]
    q = np.column_stack([PLACES, TURNS.as_quat(), ANGLES[:, [JOINTS.index(name) for name in names]]])
    v = np.random.default_rng(3).normal(size=(len(TIMES), model.nv))
    data = model.createData()
    return q, v, np.stack([pin.computeCentroidalMomentum(model, data, *row).angular for row in zip(q, v, strict=True)])


def in_drake():
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(URDF))
    plant.Finalize()
    assert [name.removeprefix("boughs_") for name in plant.GetPositionNames()][7:] == [
        "right_shoulder_q",
        "right_elbow_q",
        "left_shoulder_q",
    ]
    q = np.column_stack([np.roll(TURNS.as_quat(), 1, axis=1), PLACES, ANGLES[:, [0, 2, 1]]])
    v = np.random.default_rng(4).normal(size=(len(TIMES), plant.num_velocities()))
    context, found = plant.CreateDefaultContext(), np.empty((len(TIMES), 3))
    for k in range(len(TIMES)):
        plant.SetPositions(context, q[k])
        plant.SetVelocities(context, v[k])
        centre = plant.CalcCenterOfMassPositionInWorld(context)
        found[k] = plant.CalcSpatialMomentumInWorldAboutPoint(context, centre).rotational()
    return q, v, found


@pytest.mark.parametrize("program", [in_pinocchio, in_drake])
@pytest.mark.parametrize("axis", [0, 1])
def test_q_and_v_have_the_momentum_that_their_program_computes(program, axis, tmp_path):
    """Rates at random: whatever axes were mistaken, the momentum would be another."""
    q, v, expected = program()
    np.savez(tmp_path / "m.npz", q=q.T if axis else q, v=v.T if axis else v, time=TIMES)
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", BODY)
    np.testing.assert_allclose(recorded.path.shape(TIMES), SHAPES, atol=1e-12)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_position, PLACES, atol=1e-12)
    run = sp.read_trajectory(tmp_path / "m.npz", BODY)
    np.testing.assert_allclose(run.shapes, SHAPES, atol=1e-12)
    np.testing.assert_allclose(momentum(run), expected, atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_joints_that_turn_without_end_are_cosine_and_sine_in_pinocchio(axis, tmp_path):
    text = URDF.read_text().replace('name="right_elbow" type="revolute"', 'name="right_elbow" type="continuous"')
    (tmp_path / "endless.urdf").write_text(text)
    model = pin.buildModelFromUrdf(str(tmp_path / "endless.urdf"), pin.JointModelFreeFlyer())
    body, elbow = sp.load_body(tmp_path / "endless.urdf"), 9.0 * TIMES
    q, v = np.empty((41, model.nq)), np.random.default_rng(7).normal(size=(41, model.nv))
    q[:, :7] = np.column_stack([PLACES, TURNS.as_quat()])
    for name, angle in zip(JOINTS, (*ANGLES[:, :2].T, elbow), strict=True):
        joint = model.joints[model.getJointId(name)]
        q[:, joint.idx_q : joint.idx_q + joint.nq] = np.stack(
            [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        ).T
    data = model.createData()
    expected = [pin.computeCentroidalMomentum(model, data, *row).angular for row in zip(q, v, strict=True)]
    np.savez(tmp_path / "m.npz", q=q.T if axis else q, v=v.T if axis else v, time=TIMES)
    run = sp.read_trajectory(tmp_path / "m.npz", body)
    assert body.joint_names == BODY.joint_names
    np.testing.assert_allclose(run.shapes[:, body.joint_index("right_elbow")], elbow, atol=1e-12)
    np.testing.assert_allclose(momentum(run), expected, atol=1e-9)


def test_what_fits_two_orders_is_refused_with_the_names_that_say_which(tmp_path):
    """Quaternions of length one in both places."""
    q = np.column_stack([np.tile([0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5], (41, 1)), ANGLES])
    np.savez(tmp_path / "m.npz", q=q, time=TIMES)
    for read in (sp.read_shape_path, sp.read_trajectory):
        with pytest.raises(TrajectoryError, match="base_quat_xyzw"):
            read(tmp_path / "m.npz", BODY)
    np.savez(tmp_path / "m.npz", q=2.0 * q, time=TIMES)
    with pytest.raises(TrajectoryError, match="qpos"):
        sp.read_shape_path(tmp_path / "m.npz", BODY)
    # Six and three: three angles, of which nothing says the order.
    np.savez(tmp_path / "m.npz", q=q[:, :9], time=TIMES)
    with pytest.raises(TrajectoryError, match="joint_names"):
        sp.read_shape_path(tmp_path / "m.npz", BODY)


def test_ball_joints_of_qpos_have_rates_in_axes_of_their_links(tmp_path):
    """Differences of the coordinates along MuJoCo's own integration of its rates."""
    (tmp_path / "balls.urdf").write_text(BALLS)
    body = sp.load_body(tmp_path / "balls.urdf")
    order = body.joint_orders[0].joints
    text = "".join(
        f'<body name="b{k}"><joint name="{name}" type="ball"/><geom size="0.1"/></body>'
        for k, name in enumerate(dict.fromkeys(joint.removesuffix(".w") for joint in order if joint.endswith(".w")))
    )
    hinges = [joint for joint in order if "." not in joint]
    text += "".join(f'<body><joint name="{name}"/><geom size="0.1"/></body>' for name in hinges)
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body><freejoint/><geom size='1'/>{text}</body></worldbody></mujoco>"
    )
    # Its joints stand in another order than those of the file; here only numbers of a ball joint are of interest.
    names = [f"{name}.{part}" for name in body.ball_joints for part in "wxyz"] + hinges
    rng = np.random.default_rng(5)
    qpos, qvel, step = np.empty((13, model.nq)), rng.normal(size=(13, model.nv)), 1e-6
    ahead = np.empty_like(qpos)
    for k in range(len(qpos)):
        row = rng.normal(size=model.nq)
        mujoco.mj_normalizeQuat(model, row)
        qpos[k], ahead[k] = row, row
        mujoco.mj_integratePos(model, ahead[k], qvel[k], step)
    run = sp.FloatingTrajectory.from_mujoco(body, np.arange(13.0), qpos, qvel, joint_names=names)
    slopes = ((ahead - qpos) / step)[:, 7:][:, [names.index(name) for name in body.joint_names]]
    np.testing.assert_allclose(run.joint_rates, slopes, atol=1e-5)


ROOTED = """version 4
segment Trunk
    translations xyz
    rotations zxy
    mass 5
    com 0.02 0.01 0.05
    inertia
        0.3 0.01 0.02
        0.01 0.4 0
        0.02 0 0.2
endsegment
segment Right
    parent Trunk
    rt 0 0 0 xyz 0.2 0 0.4
    rotations x
    mass 1
    com 0 0 -0.2
    inertia
        0.02 0 0
        0 0.03 0
        0 0 0.01
endsegment
segment Left
    parent Trunk
    rt 0 0 0 xyz -0.2 0 0.4
    rotations y
    mass 1.2
    com 0 0.02 -0.2
    inertia
        0.02 0 0
        0 0.03 0
        0 0 0.01
endsegment
segment Hand
    parent Right
    rt 0 0 0 xyz 0 0 -0.4
    rotations y
    mass 0.5
    com 0 0 -0.1
    inertia
        0.004 0 0
        0 0.005 0
        0 0 0.002
endsegment
"""


@pytest.fixture(scope="module")
def rooted(tmp_path_factory):
    """The body of a bioMod, coordinates with rates, and biorbd's angular momentum."""
    biorbd = pytest.importorskip("biorbd")
    before = locale.setlocale(locale.LC_ALL)
    file = tmp_path_factory.mktemp("rooted") / "boughs.bioMod"
    file.write_text(ROOTED)
    model = biorbd.Model(str(file))
    angles = TURNS.as_euler("ZXY")
    q = np.column_stack([PLACES, angles, ANGLES])
    slopes = CubicSpline(TIMES, q)(TIMES, 1)
    found = np.stack([model.angularMomentum(*row).to_array() for row in zip(q, slopes, strict=True)])
    # Which biorbd has set.
    locale.setlocale(locale.LC_ALL, before)
    return sp.load_body(file), q, slopes, found


@pytest.mark.parametrize("names", [("Q", "Qdot"), ("q", "qdot")])
@pytest.mark.parametrize("axis", [0, 1])
def test_coordinates_of_biorbd_and_bioptim_have_biorbds_momentum(names, axis, rooted, tmp_path):
    body, q, slopes, expected = rooted
    arrays = dict(zip(names, (q.T, slopes.T) if axis else (q, slopes), strict=True))
    # bioptim has times as a column.
    np.savez(tmp_path / "m.npz", time=TIMES[:, None] if axis else TIMES, **arrays)
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", body)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_position, PLACES, atol=1e-12)
    shape = dict(zip(body.joint_names, recorded.path.shape(TIMES).T, strict=True))
    np.testing.assert_allclose(shape["Right_RotX"], ANGLES[:, 0], atol=1e-12)
    np.testing.assert_allclose(shape["Hand_RotY"], ANGLES[:, 2], atol=1e-12)
    run = sp.read_trajectory(tmp_path / "m.npz", body)
    order = ["Right_RotX", "Left_RotY", "Hand_RotY"]
    turned = [body.joint_names.index(name) for name in order]
    own = [
        order.index(
            name.replace("right_shoulder", "Right_RotX")
            .replace("left_shoulder", "Left_RotY")
            .replace("right_elbow", "Hand_RotY")
        )
        for name in BODY.joint_names
    ]
    same = sp.FloatingTrajectory(
        times=run.times, quaternion=run.quaternion, shapes=run.shapes[:, turned][:, own], position=run.position,
        rate=run.base_rate, velocity=run.world_velocity, joint_rates=run.joint_rates[:, turned][:, own],
    )  # fmt: skip
    np.testing.assert_allclose(momentum(same), expected, atol=1e-9)


def test_translations_of_a_root_stand_in_the_order_of_its_file(rooted, tmp_path):
    _, q, *_ = rooted
    (tmp_path / "zyx.bioMod").write_text(ROOTED.replace("translations xyz", "translations zyx"))
    np.savez(tmp_path / "m.npz", Q=q, time=TIMES)
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", sp.load_body(tmp_path / "zyx.bioMod"))
    np.testing.assert_allclose(recorded.base_position, PLACES[:, ::-1], atol=1e-12)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)


def test_as_many_samples_as_coordinates_are_refused(rooted, tmp_path):
    body, q, *_ = rooted
    np.savez(tmp_path / "m.npz", Q=q[:9], time=TIMES[:9])
    with pytest.raises(TrajectoryError, match="last"):
        sp.read_shape_path(tmp_path / "m.npz", body)


def test_numbered_columns_of_a_table_are_read_by_every_command(tmp_path, capsys):
    q, v, expected = in_drake()
    names = ["t", *(f"q[{k}]" for k in range(10)), *(f"v[{k}]" for k in range(9))]
    rows = np.column_stack([1e3 * TIMES, q, v])
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header=",".join(names).replace("t,", "t [ms],", 1), comments="")
    recorded = sp.read_recorded_motion(tmp_path / "m.csv", BODY)
    np.testing.assert_allclose(recorded.path.shape(TIMES), SHAPES, atol=1e-12)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(momentum(sp.read_trajectory(tmp_path / "m.csv", BODY)), expected, atol=1e-9)
    main(["check", str(URDF), str(tmp_path / "m.csv")])
    assert "right_shoulder, right_elbow, left_shoulder" in capsys.readouterr().out


def in_isaac(quaternions, links, names):
    """Arrays as Isaac Lab's, of bodies and joints in an order; MuJoCo has the kinematics."""
    spec = mujoco.MjSpec.from_file(str(URDF))
    spec.compiler.fusestatic = False
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    order = [model.joint(k).name for k in range(1, model.njnt)]
    slopes = CubicSpline(TIMES, ANGLES)(TIMES, 1)
    found = {name: np.empty((len(TIMES), 4, size)) for name, size in (("pos", 3), ("quat", 4), ("ang_vel", 3))}
    spins = CubicSpline(TIMES, TURNS.as_quat())(TIMES, 1)
    for k in range(len(TIMES)):
        quaternion = TURNS.as_quat()[k]
        x, y, z, w = quaternion
        rate = 2.0 * np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]) @ spins[k]
        data.qpos[:] = [*PLACES[k], *np.roll(quaternion, 1), *(ANGLES[k, JOINTS.index(name)] for name in order)]
        data.qvel[:] = [0.0, 0.0, 0.0, *rate, *(slopes[k, JOINTS.index(name)] for name in order)]
        mujoco.mj_forward(model, data)
        for number, link in enumerate(links):
            body = data.body(link)
            found["pos"][k, number], found["quat"][k, number] = body.xpos, body.xquat
            velocity = np.empty(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, model.body(link).id, velocity, 0)
            found["ang_vel"][k, number] = velocity[:3]
    if quaternions == "xyzw":
        found["quat"] = np.roll(found["quat"], -1, axis=-1)
    columns = [JOINTS.index(name) for name in names]
    return {
        "fps": np.array([40]), "joint_pos": ANGLES[:, columns], "joint_vel": slopes[:, columns],
        **{f"body_{name}_w": values for name, values in found.items()},
    }  # fmt: skip


LEVELS = ("trunk", "right", "left", "right_hand")


@pytest.mark.parametrize("quaternions", ["wxyz", "xyzw"])
def test_isaac_labs_order_follows_from_places_and_rates(quaternions, tmp_path):
    arrays = in_isaac(quaternions, LEVELS, JOINTS)
    for named in (False, True):
        names = {"joint_names": np.array(JOINTS)} if named else {}
        np.savez(tmp_path / "motion.npz", **arrays, **names)
        run = sp.read_trajectory(tmp_path / "motion.npz", BODY)
        np.testing.assert_allclose(run.shapes, SHAPES, atol=1e-12)
        assert (Rotation.from_quat(run.quaternion).inv() * TURNS).magnitude().max() < 1e-9
        np.testing.assert_allclose(run.rate, arrays["body_ang_vel_w"][:, 0], atol=1e-12)


def test_what_places_of_isaac_lab_leave_open_its_rates_decide(tmp_path):
    """A base alone: its place shows no turn."""
    (tmp_path / "rigid.urdf").write_text(
        URDF.read_text().split("<joint")[0].split('<link name="right"')[0] + "</robot>"
    )
    body = sp.load_body(tmp_path / "rigid.urdf")
    arrays = in_isaac("wxyz", LEVELS, JOINTS)
    alone = {name: values[:, :1] for name, values in arrays.items() if name.startswith("body")}
    rest = {"fps": np.array([40]), "joint_pos": np.zeros((41, 0)), **alone}
    np.savez(tmp_path / "m.npz", **rest)
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", body)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-9)
    np.savez(tmp_path / "m.npz", **{name: each for name, each in rest.items() if name != "body_ang_vel_w"})
    with pytest.raises(TrajectoryError, match="body_ang_vel_w"):
        sp.read_recorded_motion(tmp_path / "m.npz", body)
    np.savez(tmp_path / "m.npz", **{**rest, "body_ang_vel_w": -rest["body_ang_vel_w"]})
    with pytest.raises(TrajectoryError, match="contradicts"):
        sp.read_recorded_motion(tmp_path / "m.npz", body)


def humanoid(folder):
    """A body with the joints of DeepMimic's humanoid."""
    parts = [("chest", "root"), ("neck", "chest"), ("right_hip", "root"), ("right_knee", "right_hip")]
    parts += [("right_ankle", "right_knee"), ("right_shoulder", "chest"), ("right_elbow", "right_shoulder")]
    parts += [(name.replace("right", "left"), above.replace("right", "left")) for name, above in parts[2:]]
    inertial = '<inertial pos="0 0.1 0" mass="2" diaginertia="0.1 0.2 0.2"/>'
    inside = {"root": ""}
    for name, _ in parts:
        kind = 'axis="0 0 1"' if name.endswith(("knee", "elbow")) else 'type="ball"'
        inside[name] = f'<body name="{name}_link" pos="0 0.2 0.1"><joint name="{name}" {kind}/>{inertial}'
    for name, above in reversed(parts):
        inside[above] += inside[name] + "</body>"
    (folder / "humanoid.xml").write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body name="root"><freejoint/>'
        f"{inertial}{inside['root']}</body></worldbody></mujoco>"
    )
    return sp.load_body(folder / "humanoid.xml")


def test_frames_of_deepmimic_move_the_links_as_their_quaternions_say(tmp_path):
    body, rng = humanoid(tmp_path), np.random.default_rng(6)
    counts = {"chest": 4, "neck": 4, "right_hip": 4, "right_knee": 1, "right_ankle": 4, "right_shoulder": 4}
    counts |= {"right_elbow": 1, "left_hip": 4, "left_knee": 1, "left_ankle": 4, "left_shoulder": 4, "left_elbow": 1}
    swing = 0.4 * np.sin(3.0 * TIMES[:20, None, None] + rng.uniform(0.0, 3.0, (len(counts), 3)))
    frames, turns = [np.full((20, 1), 0.025), PLACES[:20], np.roll(TURNS[:20].as_quat(), 1, axis=1)], {}
    for number, (name, count) in enumerate(counts.items()):
        turned = Rotation.from_rotvec(swing[:, number] * ([1.0, 1.0, 1.0] if count == 4 else [0.0, 0.0, 1.0]))
        turns[name] = turned.as_matrix()
        frames.append(np.roll(turned.as_quat(), 1, axis=1) if count == 4 else swing[:, number, 2:])
    file = tmp_path / "spin.json"
    file.write_text(json.dumps({"Loop": "wrap", "Frames": np.hstack(frames).tolist()}))
    recorded = sp.read_recorded_motion(file, body)
    shapes = recorded.path.shape(recorded.times)
    np.testing.assert_allclose(recorded.times, TIMES[:20], atol=1e-12)
    np.testing.assert_allclose(recorded.base_attitude, TURNS[:20].as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_position, PLACES[:20], atol=1e-12)
    hand = turns["chest"] @ turns["left_shoulder"] @ turns["left_elbow"]
    np.testing.assert_allclose(body.link_pose(shapes, "left_elbow_link")[:, :3, :3], hand, atol=1e-12)
    foot = turns["right_hip"] @ turns["right_knee"] @ turns["right_ankle"]
    np.testing.assert_allclose(body.link_pose(shapes, "right_ankle_link")[:, :3, :3], foot, atol=1e-12)
    longer = np.hstack([column * (1.1 if column.shape[1] == 4 else 1.0) for column in frames])
    (tmp_path / "spin.txt").write_text(json.dumps({"Loop": "wrap", "Frames": longer.tolist()}))
    with pytest.warns(TrajectoryWarning, match="divided"):
        alike = sp.read_recorded_motion(tmp_path / "spin.txt", body)
    np.testing.assert_allclose(alike.path.shape(alike.times), shapes, atol=1e-12)
    np.testing.assert_allclose(alike.base_attitude, TURNS[:20].as_matrix(), atol=1e-12)
    with pytest.raises(sp.errors.UnknownColumnError, match="chest"):
        sp.read_recorded_motion(file, BODY)
    file.write_text(json.dumps({"Frames": [[0.1] * 4 + [0.0] * 40] * 3}))
    with pytest.raises(TrajectoryError, match="zero"):
        sp.read_recorded_motion(file, body)
    file.write_text(json.dumps({"Frames": [[0.1, 1.0], [0.1, 2.0]]}))
    with pytest.raises(TrajectoryError, match="44"):
        sp.read_recorded_motion(file, body)


def test_a_table_without_a_header_says_no_scalar_part(tmp_path):
    """Numbers do not show whether a quaternion is x y z w, as retargeted motions have it, or w x y z."""
    quaternions, joints = TURNS.as_quat(), ANGLES[:, [0, 2, 1]]
    file = tmp_path / "walk.csv"
    np.savetxt(file, np.column_stack([PLACES, quaternions, joints]), delimiter=",")
    with pytest.raises(TrajectoryError, match="4=base_qw"):
        sp.read_recorded_motion(file, BODY, timestep=0.025)
    names = dict(zip("4567", ("base_qx", "base_qy", "base_qz", "base_qw")))
    with pytest.warns(TrajectoryWarning, match="header"):
        recorded = sp.read_recorded_motion(file, BODY, timestep=0.025, names=names)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_position, PLACES, atol=1e-12)
    np.testing.assert_allclose(recorded.path.shape(TIMES), SHAPES, atol=1e-12)
    np.savetxt(file, np.column_stack([TIMES, PLACES, np.roll(quaternions, 1, axis=1), joints]))
    names = dict(zip("5678", ("base_qw", "base_qx", "base_qy", "base_qz")))
    with pytest.warns(TrajectoryWarning, match="header"):
        recorded = sp.read_recorded_motion(file, BODY, names=names)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.path.shape(TIMES), SHAPES, atol=1e-12)


def test_arrays_in_memory_are_read_as_a_frame_is():
    columns = dict(zip(JOINTS, ANGLES.T, strict=True))
    for source in (
        {"time": TIMES, **columns},
        (TIMES, ANGLES, JOINTS),
        (TIMES.tolist(), ANGLES.tolist(), list(JOINTS)),
        {"time": TIMES, "shapes": ANGLES, "joint_names": JOINTS},
        {"time": TIMES, "qpos": np.column_stack([PLACES, np.roll(TURNS.as_quat(), 1, axis=1), ANGLES[:, [0, 2, 1]]])},
    ):
        np.testing.assert_allclose(sp.read_shape_path(source, BODY).shape(TIMES), SHAPES, atol=1e-12)
    stepped = sp.read_shape_path(columns, BODY, timestep=0.025)
    np.testing.assert_allclose(stepped.shape(TIMES), SHAPES, atol=1e-12)
    degrees = (TIMES, np.degrees(ANGLES), [f"{name}_deg" for name in JOINTS])
    np.testing.assert_allclose(sp.read_shape_path(degrees, BODY).shape(TIMES), SHAPES, atol=1e-12)
    with pytest.raises(TrajectoryError, match="--degrees"):
        sp.read_shape_path((TIMES, np.degrees(ANGLES), JOINTS), BODY)
    with pytest.raises(sp.errors.ShapeError, match="file"):
        sp.read_shape_path((TIMES, ANGLES), BODY)
    bent = ANGLES.copy()
    bent[7, 1] = np.nan
    with pytest.raises(TrajectoryError, match="left_shoulder"):
        sp.read_shape_path((TIMES, bent, JOINTS), BODY)
