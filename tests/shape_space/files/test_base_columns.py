"""The recorded motion of the base in the spellings that programs and people use; SciPy's rotations are the oracle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError
from shapephase.shape_space.files import read_recorded_motion
from support.motion_writers import write_delimited, write_opensim

DIVER = sp.load_body("diver")
TIMES = np.arange(9) / 60.0
_RNG = np.random.default_rng(21)
ARMS = _RNG.uniform(0.0, 1.5, (len(TIMES), 2))
TURNS = Rotation.from_rotvec(_RNG.normal(size=(len(TIMES), 3)))
PLACES = _RNG.normal(size=(len(TIMES), 3))
# Of a base that is x forward, y left and z up in the axes of a pelvis that is x forward, y up and z right.
PELVIS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
TILT_LIST_ROTATION = ["pelvis_tilt", "pelvis_list", "pelvis_rotation"]
WHERE = ["pelvis_tx", "pelvis_ty", "pelvis_tz"]
XYZW = TURNS.as_quat()
WXYZ = np.roll(XYZW, 1, axis=1)


def euler(order: str, columns: str) -> np.ndarray:
    """Angles [rad] that turn about carried axes in an order, in the order of columns."""
    angles = TURNS.as_euler(order.upper())
    return angles[:, [order.index(axis) for axis in columns]]


def csv(file, names, values):
    write_delimited(file, [*names, *DIVER.joint_names], TIMES, np.column_stack([values, ARMS]))
    return file


def opensim(file, names, angles, places, degrees=True):
    size = 180.0 / np.pi if degrees else 1.0
    write_opensim(
        file, [*names, *DIVER.joint_names], TIMES, np.column_stack([size * angles, places, size * ARMS]), degrees
    )
    return file


def attitude(file, **options):
    motion = read_recorded_motion(file, DIVER, **options)
    np.testing.assert_allclose(motion.path.shape(motion.times), ARMS, atol=1e-14)
    return motion.base_attitude


# Labels and values of the attitude, options, and what takes base axes to those of the columns.
SPELLINGS = {
    "q": ([f"q{part}" for part in "xyzw"], XYZW, {}),
    "scalar first": ([f"base_q{part}" for part in "wxyz"], WXYZ, {}),
    "of the pelvis": ([f"pelvis_quat_{part}" for part in "xyzw"], XYZW, {}),
    "numbered": ([f"base_quat_wxyz_{k}" for k in range(4)], WXYZ, {}),
    "roll, pitch, yaw": (["base_roll", "base_pitch", "base_yaw"], euler("zyx", "xyz"), {}),
    "in degrees": (["base_roll_deg", "base_pitch [deg]", "base_yaw°"], np.degrees(euler("zyx", "xyz")), {}),
    "another order": (["root_roll", "root_pitch", "root_yaw"], euler("xyz", "xyz"), {"base_order": "xyz"}),
    "by names": (
        ["a", "b", "c"],
        np.degrees(euler("zyx", "xyz")),
        {"names": {"a": "base_roll [deg]", "b": "base_pitch_deg", "c": "base_yaw_deg"}},
    ),
}


@pytest.mark.parametrize("order", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"])
def test_angles_on_either_branch_are_the_same_attitude(order: str, tmp_path):
    """Every other sample on the branch that no program chooses, and whole turns off."""
    angles = TURNS.as_euler(order.upper())
    angles[::2] = angles[::2] * [1.0, -1.0, 1.0] + np.pi * np.array([1.0, 1.0, -1.0])
    angles[1::3] += 2.0 * np.pi * np.array([1.0, -1.0, 0.0])
    names = [f"base_{('roll', 'pitch', 'yaw')['xyz'.index(axis)]} [deg]" for axis in order]
    found = attitude(csv(tmp_path / "m.csv", names, np.degrees(angles)), base_order=order)
    np.testing.assert_allclose(found, TURNS.as_matrix(), atol=1e-13)


@pytest.mark.parametrize("case", SPELLINGS)
def test_an_attitude_in_every_spelling(case: str, tmp_path):
    """To the rounding of a product of three rotations: all digits of the numbers are in the file."""
    names, values, options = SPELLINGS[case]
    found = attitude(csv(tmp_path / "m.csv", names, values), **options)
    np.testing.assert_allclose(found, TURNS.as_matrix(), atol=1e-14)


@pytest.mark.parametrize("degrees", [True, False])
def test_a_pelvis_of_opensim_is_the_base(degrees: bool, tmp_path):
    """Tilt about z, list about x, rotation about y; a base that is z up, in the axes of a pelvis that is y up."""
    names = [*TILT_LIST_ROTATION, *WHERE]
    file = opensim(tmp_path / "m.mot", names, euler("zxy", "zxy"), PLACES, degrees)
    motion = read_recorded_motion(file, DIVER)
    np.testing.assert_allclose(motion.base_attitude, TURNS.as_matrix() @ PELVIS, atol=1e-14)
    np.testing.assert_array_equal(motion.base_position, PLACES)
    assert motion.record["base"] == {
        "attitude": TILT_LIST_ROTATION,
        "order": "zxy",
        "order_said": False,
        "axes": "x -z y",
        "axes_said": False,
        "position": WHERE,
    }
    np.testing.assert_allclose(attitude(file, base_axes="x y z"), TURNS.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(attitude(file, base_axes=PELVIS), TURNS.as_matrix() @ PELVIS, atol=1e-14)
    np.testing.assert_allclose(attitude(file, base_axes="estimate"), TURNS.as_matrix(), atol=1e-14)


def test_another_order_of_opensim(tmp_path):
    """Some models turn about y first: the columns keep their axes, tilt is about z."""
    file = opensim(tmp_path / "m.mot", [*TILT_LIST_ROTATION, *WHERE], euler("yxz", "zxy"), PLACES)
    found = attitude(file, base_order="yxz", base_axes="x,-z,y")
    np.testing.assert_allclose(found, TURNS.as_matrix() @ PELVIS, atol=1e-14)
    assert np.abs(attitude(file) - found).max() > 0.1


def test_positions_have_units_of_their_own(tmp_path):
    labels = ["base_x_mm", "base_y [cm]", "base_z"]
    file = csv(tmp_path / "m.csv", labels, PLACES * [1e3, 1e2, 1.0])
    motion = read_recorded_motion(file, DIVER)
    np.testing.assert_allclose(motion.base_position, PLACES, atol=1e-15)
    assert motion.base_attitude is None
    with pytest.raises(TrajectoryError, match="millimetres"):
        read_recorded_motion(csv(tmp_path / "m.csv", ["base_x", "base_y", "base_z"], 1e3 * PLACES), DIVER)


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
@pytest.mark.usefixtures("warm_readers")
def test_arrays_say_the_order_by_their_name(order: str, tmp_path):
    import h5py
    import scipy.io

    quaternions = {f"base_quat_{order}": XYZW if order == "xyzw" else WXYZ, "base_position": PLACES}
    np.savez(tmp_path / "m.npz", time=TIMES, shapes=ARMS, joint_names=DIVER.joint_names, **quaternions)
    columns = dict(zip(DIVER.joint_names, ARMS.T, strict=True))
    scipy.io.savemat(tmp_path / "m.mat", {"time": TIMES, **columns, **quaternions})
    with h5py.File(tmp_path / "m.h5", "w") as book:
        for name, value in {"time": TIMES, **columns, **quaternions}.items():
            book[name] = value
        book["base_position"].attrs["units"] = "mm"
    for name, size in (("m.npz", 1.0), ("m.mat", 1.0), ("m.h5", 1e-3)):
        motion = read_recorded_motion(tmp_path / name, DIVER)
        np.testing.assert_allclose(motion.base_attitude, TURNS.as_matrix(), atol=1e-14)
        np.testing.assert_allclose(motion.base_position, size * PLACES, rtol=1e-15)


def test_a_joint_of_that_name_is_a_joint(load_urdf, tmp_path):
    body = load_urdf(
        '<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
        'izz="1"/></inertial></link><link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
        'iyz="0" izz="1"/></inertial></link><joint name="pelvis_tilt" type="revolute"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    write_delimited(tmp_path / "m.csv", ["pelvis_tilt"], TIMES, 0.1 * ARMS[:, :1])
    motion = read_recorded_motion(tmp_path / "m.csv", body)
    assert motion.base_attitude is None
    assert motion.record["base"] is None
    np.testing.assert_allclose(motion.path.shape(TIMES), 0.1 * ARMS[:, :1], atol=1e-15)


# What is asked: labels, values, options and the words of the question.
ANGLES = euler("zyx", "xyz")
RPY = ["base_roll", "base_pitch", "base_yaw"]
QUESTIONS = {
    "degrees, nobody says": (RPY, 50.0 * ANGLES, {}, r"row \d+: column 'base_\w+' .* degrees\? .*--degrees"),
    "part of it": (RPY[:2], ANGLES[:, :2], {}, "with base_roll, base_pitch, without base_yaw; .*--ignore-extra"),
    "twice": ([*RPY, *SPELLINGS["q"][0]], np.c_[ANGLES, XYZW], {}, "the attitude of the base stands twice"),
    "one column twice": (
        ["base_roll", "base_roll_deg"],
        ANGLES[:, :2],
        {},
        "'base_roll' and 'base_roll_deg' are both base_roll",
    ),
    "a length": (["base_roll_m", *RPY[1:]], ANGLES, {}, "'base_roll_m' is in m; rad, deg, mrad"),
    "a quaternion in degrees": (
        ["base_qx_deg", "base_qy", "base_qz", "base_qw"],
        XYZW,
        {},
        "'base_qx_deg' is in deg; a quaternion has no unit",
    ),
    "two units": (
        ["base_roll_deg", *RPY[1:]],
        ANGLES,
        {"names": {"base_roll_deg": "base_roll [rad]"}},
        "'base_roll_deg' is in deg, and names says rad",
    ),
    "two options": (
        ["base_roll_deg", *RPY[1:]],
        ANGLES,
        {"degrees": False},
        "'base_roll_deg' is in degrees by its name",
    ),
    "turns or places": (["base_rx", "base_ry", "base_rz"], ANGLES, {}, "unknown column .* 'base_rx'"),
    "too far": (RPY, 1e12 * ANGLES, {"degrees": False}, "up to 1e.06 rad or m can be represented"),
    "no number": (RPY, np.where(np.arange(3) == 1, np.nan, ANGLES), {}, "column 'base_pitch' has no number"),
    "an order of a quaternion": (SPELLINGS["q"][0], XYZW, {"base_order": "xyz"}, "base_order is for angles"),
    "no order": (RPY, ANGLES, {"base_order": "zyz"}, "base_order: the three axes"),
    "left-handed axes": (RPY, ANGLES, {"base_axes": "x,z,y"}, "three right-handed words"),
    "no axes": (RPY, ANGLES, {"base_axes": "forward"}, "three right-handed words"),
    "no rotation": (RPY, ANGLES, {"base_axes": np.diag([1.0, 1.0, -1.0])}, "base_axes"),
}


@pytest.mark.parametrize("case", QUESTIONS)
def test_what_is_doubtful_is_asked(case: str, tmp_path):
    names, values, options, words = QUESTIONS[case]
    with pytest.raises((TrajectoryError, ShapeError), match=words):
        read_recorded_motion(csv(tmp_path / "m.csv", names, values), DIVER, **options)


def test_a_part_of_the_base_is_left_out_where_that_is_allowed(tmp_path):
    file = csv(tmp_path / "m.csv", ["pelvis_tilt", *WHERE], np.c_[ANGLES[:, 0], PLACES])
    motion = read_recorded_motion(file, DIVER, ignore_extra=True)
    assert motion.base_attitude is None
    np.testing.assert_allclose(motion.base_position, PLACES)
    assert motion.record["left_out"] == {"pelvis_tilt": "of the base, without pelvis_list, pelvis_rotation"}


def test_joints_of_the_base_are_known_behind_the_letter_of_an_array(tmp_path):
    """Data sets of MuJoCo's humanoids have one array for each coordinate, `q_NAME`, and its rate, `dq_NAME`."""
    (tmp_path / "m.xml").write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body><inertial pos="0 0 0" mass="2" diaginertia="1 2 2"/>'
        '<joint name="tx" type="slide" axis="1 0 0"/><joint name="ty" type="slide" axis="0 1 0"/>'
        '<joint name="tz" type="slide" axis="0 0 1"/><joint name="tilt" axis="0 -1 0"/>'
        '<joint name="list" axis="1 0 0"/>'
        '<body><joint name="knee" axis="0 1 0"/><inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/></body></body>'
        "</worldbody></mujoco>"
    )
    times = np.linspace(0.0, 1.0, 20)
    arrays = {
        "tx": 2.0 + times,
        "ty": -times,
        "tz": times**2,
        "tilt": 0.3 * np.sin(times),
        "list": 0.2 * times,
        "knee": 0.5 * times,
    }
    rates = {f"dq_{name}": np.gradient(values, times) for name, values in arrays.items()}
    np.savez(tmp_path / "m.npz", **{f"q_{name}": values for name, values in arrays.items()}, **rates)
    body = sp.load_body(tmp_path / "m.xml", root="free")
    recorded = sp.read_recorded_motion(tmp_path / "m.npz", body, timestep=times[1])
    turned = Rotation.from_rotvec(np.outer(arrays["tilt"], [0.0, -1.0, 0.0]))
    turned = turned * Rotation.from_rotvec(np.outer(arrays["list"], [1.0, 0.0, 0.0]))
    np.testing.assert_allclose(recorded.base_attitude, turned.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_position.T, [arrays["tx"], arrays["ty"], arrays["tz"]], atol=1e-12)
    np.testing.assert_allclose(recorded.path.shape(recorded.times)[:, 0], arrays["knee"], atol=1e-12)
    assert recorded.record["left_out"] == {label: f"dq of {label[3:]}" for label in rates}
