"""Poses of segments: base, joints and momentum against a person that SciPy's rotations have moved."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import ShapeError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files import read_recorded_motion
from support import segment_files
from support.bodies import link, urdf
from support.segment_files import COUNT, LINKS, THEIR_NAMES, TIMES, moved, own_axes

pytestmark = pytest.mark.usefixtures("warm_readers")
ROUNDING = 1e-10
SINGLE = 2e-6
"""C3D files have single precision, of lengths of some metres in mm."""


@pytest.fixture
def body(load_urdf):
    return load_urdf(segment_files.person_urdf())


def renamed(each):
    return {THEIR_NAMES[name]: values for name, values in each.items()}


def write(folder, kind, motion, turns):
    """A file of the poses, and how it is to be read."""
    if kind == "mvnx":
        file = folder / "suit.mvnx"
        file.write_text(segment_files.mvnx_text(renamed(turns), renamed(motion.places)), encoding="utf-8")
        return file, {}
    if kind == "c3d":
        file = folder / "poses.c3d"
        segment_files.write_c3d(str(file), turns, motion.places, "mm")
        return file, {"calibration": 0.0}
    if kind == "sto":
        file = folder / "a_BodyKinematics_pos_global.sto"
        centres = {p.name: motion.places[p.name] + motion.turns[p.name] @ np.array(p.centre) for p in LINKS}
        file.write_text(segment_files.body_kinematics_text(motion.turns, centres), encoding="utf-8")
        return file, {"calibration": "links"}
    file = folder / "poses.csv"
    file.write_text(segment_files.table_text(turns, motion.places, kind), encoding="utf-8")
    return file, {"calibration": 0.0}


def check(recorded, body, motion, tolerance):
    np.testing.assert_allclose(recorded.times, TIMES, rtol=0, atol=1e-12)
    np.testing.assert_allclose(recorded.base_attitude, motion.turns["hips"], rtol=0, atol=tolerance)
    np.testing.assert_allclose(recorded.base_position, motion.places["hips"], rtol=0, atol=tolerance)
    shapes = recorded.path.shape(TIMES)
    assert set(motion.columns) == set(body.joint_names)
    for name, expected in motion.columns.items():
        np.testing.assert_allclose(shapes[:, body.joint_index(name)], expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("kind", ["", "mm", "mvnx", "c3d", "sto"])
def test_base_and_joints_are_those_that_moved_the_segments(tmp_path, body, kind):
    motion = moved()
    file, options = write(tmp_path, kind, motion, own_axes(motion))
    recorded = read_recorded_motion(file, body, **options)
    tolerance = SINGLE if kind == "c3d" else ROUNDING
    check(recorded, body, motion, tolerance)
    expected = segment_files.momentum_between(motion)
    size = np.abs(expected).max()
    for found in (recorded.segments.of_poses, recorded.segments.of_chain):
        np.testing.assert_allclose(found, expected, rtol=0, atol=60.0 * tolerance * size)


def test_momentum_of_a_rigid_turn_is_inertia_times_rate(tmp_path, body):
    """All links at zero, turning at 2 rad/s about an axis of the room: L = R I R^T omega, I of the locked body."""
    motion, rate = moved(0.0), np.array([0.6, -1.0, 1.6])
    turn = Rotation.from_rotvec(TIMES[:, None] * rate).as_matrix()
    centre = sum(p.mass * (motion.places[p.name] + motion.turns[p.name] @ np.array(p.centre)) for p in LINKS)
    centre = centre[0] / sum(p.mass for p in LINKS)
    turns = {name: turn @ each for name, each in motion.turns.items()}
    places = {name: centre + np.einsum("nij,nj->ni", turn, each - centre) for name, each in motion.places.items()}
    file = tmp_path / "poses.csv"
    file.write_text(segment_files.table_text(turns, places), encoding="utf-8")
    recorded = read_recorded_motion(file, body, calibration=0.0)
    halfway = Rotation.from_rotvec(recorded.segments.times[:, None] * rate).as_matrix() @ motion.turns["hips"][0]
    expected = np.einsum("nij,jk,nlk,l->ni", halfway, body.locked_inertia(body.shape()), halfway, rate)
    # Ways between samples are chords: with a turn of a from one to the next, (sin a) / a of what arcs have.
    atol = (np.linalg.norm(rate) / 60.0) ** 2 / 6.0 * np.linalg.norm(expected, axis=1).max()
    np.testing.assert_allclose(recorded.segments.of_poses, expected, rtol=0, atol=atol)
    np.testing.assert_allclose(recorded.segments.of_poses, recorded.segments.of_chain, rtol=0, atol=ROUNDING)


def test_segments_with_the_axes_of_links_need_no_pose(tmp_path, body):
    motion = moved()
    file, _ = write(tmp_path, "", motion, motion.turns)
    check(read_recorded_motion(file, body, calibration="links"), body, motion, ROUNDING)


def test_without_places_the_base_has_the_axes_of_the_room_at_the_calibration(tmp_path, body):
    motion = moved(start=(0.0, 0.0, 0.0))
    file = tmp_path / "turns.csv"
    file.write_text(segment_files.table_text(own_axes(motion), None), encoding="utf-8")
    with pytest.warns(TrajectoryWarning, match="room"):
        recorded = read_recorded_motion(file, body, calibration=0.0)
    np.testing.assert_allclose(recorded.base_attitude, motion.turns["hips"], rtol=0, atol=ROUNDING)
    shapes = recorded.path.shape(TIMES)
    for name, expected in motion.columns.items():
        np.testing.assert_allclose(shapes[:, body.joint_index(name)], expected, rtol=0, atol=ROUNDING)
    assert recorded.base_position is None
    assert recorded.segments.of_poses is None


def test_a_calibration_pose_by_its_name_and_by_the_better_fit(tmp_path, body):
    """Where a T-pose has its legs apart, the N-pose is the body's zero pose."""
    motion = moved()
    turns, places = renamed(own_axes(motion)), renamed(motion.places)
    text = segment_files.mvnx_text(turns, places, poses=("npose", "tpose"))
    lines = text.splitlines()
    number = next(k for k, line in enumerate(lines) if 'type="tpose"' in line)
    other = next(line for line in lines if f'index="{COUNT - 1}"' in line)
    lines[number] = other.replace('type="normal"', 'type="tpose"')
    file = tmp_path / "suit.mvnx"
    file.write_text("\n".join(lines), encoding="utf-8")
    recorded = read_recorded_motion(file, body)
    check(recorded, body, motion, ROUNDING)
    assert "npose" in recorded.record["segments"]["calibration"]
    with pytest.raises(TrajectoryError, match="tpose"):
        read_recorded_motion(file, body, calibration="tpose")


def test_a_pose_of_a_suit_in_other_axes_than_the_motion_is_no_calibration(tmp_path, body):
    """`tpose-isb` has the places of the T-pose, and axes as the ISB recommends, which no other frame has."""
    motion = moved()
    turns, places = renamed(own_axes(motion)), renamed(motion.places)
    others = {name: each @ Rotation.from_rotvec([0.0, 0.0, 1.5]).as_matrix() for name, each in turns.items()}
    isb = next(
        line for line in segment_files.mvnx_text(others, places, poses=("tpose-isb",)).splitlines() if "-isb" in line
    )
    text = segment_files.mvnx_text(turns, places).replace("<frames>", f"<frames>{isb}")
    (tmp_path / "suit.mvnx").write_text(text, encoding="utf-8")
    check(read_recorded_motion(tmp_path / "suit.mvnx", body), body, motion, ROUNDING)
    with pytest.raises(TrajectoryError, match="tpose-isb"):
        read_recorded_motion(tmp_path / "suit.mvnx", body, calibration="tpose-isb")


def test_a_file_without_unit_whose_last_frames_saw_nobody(tmp_path, body):
    """Lengths are those of the body in millimetres; frames without poses are named, and may be cut off."""
    motion, kept = moved(), COUNT - 3
    file = tmp_path / "poses.c3d"
    segment_files.write_c3d(str(file), own_axes(motion), motion.places, None, unseen=COUNT - kept)
    with pytest.raises(TrajectoryError, match=f"frame {kept + 1}"):
        read_recorded_motion(file, body, calibration=0.0)
    recorded = read_recorded_motion(file, body, calibration=0.0, trim=(0.0, TIMES[kept - 1] + 1e-6))
    np.testing.assert_allclose(recorded.base_attitude, motion.turns["hips"][:kept], rtol=0, atol=SINGLE)
    np.testing.assert_allclose(recorded.base_position, motion.places["hips"][:kept], rtol=0, atol=SINGLE)
    assert recorded.record["segments"]["length_unit"].startswith("mm")


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ("axes", {}, r"calibration pose.*--calibration T"),
        ("axes", {"calibration": "links"}, r"the segment has other axes.*--calibration T"),
        ("leg", {"calibration": "links"}, r"shank_l lies \d+ deg off.*not those of the links.*--calibration T"),
        ("axes", {"calibration": 9.0}, r"times go from 0 to 0\.5.*--calibration T"),
        ("axes", {"calibration": "tpose"}, r"a pose of the file, which has none.*--calibration T"),
        ("axes", {"calibration": TIMES[-1]}, r"does not stand in its zero pose.*--calibration T"),
        ("lengths", {"calibration": 0.0}, r"--length-tolerance 0\.2"),
        ("name", {"calibration": 0.0}, r"no segment is known as torso.*left over are Brust.*--names Brust=torso"),
        ("name", {"calibration": 0.0, "names": {"Brust": "chest"}}, r"'chest' is no link.*--names Brust=LINK"),
        ("twice", {"calibration": 0.0}, r"both link torso.*--names Torso="),
        ("knee", {"calibration": 0.0}, r"knee_l leave \d+ deg.*--calibration T"),
        ("half", {"calibration": 0.0}, r"'torso' has no columns torso_x.*--names torso="),
        ("unit", {"calibration": 0.0}, r"row 2: the quaternion of 'hips' has the length 2"),
        ("cell", {"calibration": 0.0}, r"row 2, column 'hips_qx': 'abc'"),
        ("rad", {"calibration": 0.0}, r"'hips_x \[rad\]' is in rad.*--names"),
        ("column", {"calibration": 0.0}, r"joint knee_l has a column.*--names knee_l="),
    ],
)
def test_what_cannot_be_meant_is_refused_with_the_way_on(tmp_path, body, change, options, message):
    motion = moved(stretch=1.2 if change == "lengths" else 1.0)
    turns, places = own_axes(motion), dict(motion.places)
    if change == "knee":
        turns["shank_l"] = turns["shank_l"] @ Rotation.from_rotvec(np.outer(TIMES, [3.0, 0.0, 0.0])).as_matrix()
    if change == "leg":
        turned = Rotation.from_rotvec([0.0, 1.0, 0.0]).as_matrix()
        back = motion.turns["thigh_l"].transpose(0, 2, 1)
        turns = {**motion.turns, "thigh_l": motion.turns["thigh_l"] @ turned}
        turns["shank_l"] = turns["thigh_l"] @ back @ motion.turns["shank_l"]
    if change == "name":
        turns["Brust"], places["Brust"] = turns.pop("torso"), places.pop("torso")
    if change == "twice":
        turns["Torso"], places["Torso"] = turns["torso"], places["torso"]
    text = segment_files.table_text(turns, places)
    if change == "half":
        text = text.replace("torso_x", "torso_speed")
        options = options | {"ignore_extra": True}
    if change == "rad":
        text = text.replace("hips_x", "hips_x [rad]")
    if change == "cell":
        header, first, *others = text.splitlines()
        cells = first.split(",")
        cells[2] = "abc"
        text = "\n".join([header, ",".join(cells), *others])
    if change == "unit":
        header, first, *others = text.splitlines()
        cells = first.split(",")
        cells[1:5] = ["2.0", "0.0", "0.0", "0.0"]
        text = "\n".join([header, ",".join(cells), *others])
    if change == "column":
        header, *rows = text.splitlines()
        text = "\n".join([f"{header},knee_l", *(f"{row},0.0" for row in rows)])
    (tmp_path / "poses.csv").write_text(text, encoding="utf-8")
    with pytest.raises(TrajectoryError, match=message):
        read_recorded_motion(tmp_path / "poses.csv", body, **options)


def test_a_segment_by_another_name_and_lengths_that_are_allowed(tmp_path, body):
    motion = moved(stretch=1.15)
    turns, places = own_axes(motion), dict(motion.places)
    turns["Brust"], places["Brust"] = turns.pop("torso"), places.pop("torso")
    (tmp_path / "poses.csv").write_text(segment_files.table_text(turns, places), encoding="utf-8")
    recorded = read_recorded_motion(
        tmp_path / "poses.csv", body, calibration=0.0, names={"Brust": "torso"}, length_tolerance=0.2
    )
    shapes = recorded.path.shape(TIMES)
    for name, expected in motion.columns.items():
        np.testing.assert_allclose(shapes[:, body.joint_index(name)], expected, rtol=0, atol=ROUNDING)
    assert recorded.record["segments"]["links"]["Brust"] == "torso"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("<?xml", "<!--<!DOCTYPE mvnx>--><?xml", 1), "well-formed"),
        (lambda text: text.replace("<mvnx", '<!DOCTYPE mvnx [<!ENTITY a "b">]><mvnx', 1), "entities"),
        (lambda text: text[: len(text) // 2], "cut off"),
        (lambda text: text.replace("<position>", "<position>1 ", 1), "22 numbers, and 21"),
        (lambda text: text.replace("<orientation>", "<orientation>x", 1), "not a number"),
        (lambda text: re.sub("<orientation>[^ ]* ", "<orientation>9 ", text, count=1), "off length 1"),
        (lambda text: text.replace("mvnx", "other"), "this is not an MVNX"),
        (lambda text: text.replace("orientation", "sensorOrientation"), "no <orientation>"),
    ],
)
def test_faults_of_a_suits_file_are_named_with_their_line(tmp_path, body, change, message):
    motion = moved()
    text = segment_files.mvnx_text(renamed(own_axes(motion)), renamed(motion.places))
    (tmp_path / "suit.mvnx").write_text(change(text), encoding="utf-8")
    with pytest.raises(TrajectoryError, match=rf"line \d+: .*{message}"):
        read_recorded_motion(tmp_path / "suit.mvnx", body)


def test_a_segment_without_places_may_be_left_out(tmp_path, body):
    """A hand that no link shows, without places: the rest is as it was."""
    motion = moved()
    turns = own_axes(motion)
    text = segment_files.table_text({**turns, "hand": turns["torso"]}, {**motion.places, "hand": motion.places["hips"]})
    for axis in "xyz":
        text = text.replace(f"hand_{axis}", f"hand_speed_{axis}")
    (tmp_path / "poses.csv").write_text(text, encoding="utf-8")
    options = {"names": {"hand": None, **{f"hand_speed_{axis}": None for axis in "xyz"}}}
    check(read_recorded_motion(tmp_path / "poses.csv", body, calibration=0.0, **options), body, motion, ROUNDING)


def test_velocities_of_bodies_are_no_positions(tmp_path, body):
    motion = moved()
    text = segment_files.body_kinematics_text(motion.turns, motion.places, "Velocities")
    (tmp_path / "a_BodyKinematics_vel_global.sto").write_text(text, encoding="utf-8")
    with pytest.raises(TrajectoryError, match="_pos_global"):
        read_recorded_motion(tmp_path / "a_BodyKinematics_vel_global.sto", body, calibration="links")


def test_choices_of_segments_are_checked_and_need_segments(tmp_path, body):
    motion = moved()
    file, _ = write(tmp_path, "", motion, motion.turns)
    with pytest.raises(ShapeError, match="length_tolerance"):
        read_recorded_motion(file, body, length_tolerance=2.0)
    with pytest.raises(ShapeError, match="calibration"):
        read_recorded_motion(file, body, calibration=[0.0])  # type: ignore[arg-type]
    cat = sp.load_body("cat_two_halves")
    np.savez(tmp_path / "q.npz", time=TIMES, shapes=np.zeros((COUNT, 3)), joint_names=np.array(cat.joint_names))
    with pytest.raises(TrajectoryError, match="length_tolerance"):
        read_recorded_motion(tmp_path / "q.npz", cat, calibration=0.0)


def test_the_binary_file_of_a_suit_says_what_to_export(tmp_path, body):
    (tmp_path / "take.mvn").write_bytes(b"\x00MVN")
    with pytest.raises(TrajectoryError, match="MVNX"):
        read_recorded_motion(tmp_path / "take.mvn", body)


def test_a_body_whose_arms_hang_is_met_by_the_t_pose_of_a_suit(tmp_path, load_urdf):
    """Zero where the arms hang as in the N-pose; a right angle about the axis to the front where they are held out."""
    hanging = [link("Pelvis", 20.0, (0.3, 0.2, 0.2))]
    names, places = ["Pelvis"], {"Pelvis": np.array([0.0, 0.0, 1.0])}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        upper, lower = f"{side}UpperArm", f"{side}ForeArm"
        hanging += [link(upper, 2.0, (0.02, 0.02, 0.002)), link(lower, 1.0, (0.01, 0.01, 0.001))]
        for name, parent, child, xyz in (
            (f"{side}Shoulder", "Pelvis", upper, f"0 {0.2 * sign} 0.5"), (f"{side}Elbow", upper, lower, "0 0 -0.3")
        ):  # fmt: skip
            hanging.append(
                f'<joint name="{name}" type="spherical"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{xyz}"/></joint>'
            )
        names += [upper, lower]
        places |= {upper: np.array([0.0, 0.2 * sign, 1.5]), lower: np.array([0.0, 0.5 * sign, 1.5])}
    lowered = np.linspace(0.0, 0.5 * np.pi, COUNT)
    out = {name: np.tile(np.eye(3), (COUNT, 1, 1)) for name in names}
    held = {name: np.tile(place, (COUNT, 1)) for name, place in places.items()}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        upper, lower = f"{side}UpperArm", f"{side}ForeArm"
        out[upper] = out[lower] = Rotation.from_euler("x", -sign * lowered[:, None]).as_matrix()
        held[lower] = held[upper] + out[upper] @ [0.0, 0.3 * sign, 0.0]
    file = tmp_path / "suit.mvnx"
    file.write_text(segment_files.mvnx_text(out, held), encoding="utf-8")
    body = load_urdf(urdf(*hanging))
    shapes = read_recorded_motion(file, body).path.shape(TIMES)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        shoulder = [body.joint_index(f"{side}Shoulder.{part}") for part in "xyzw"]
        elbow = [body.joint_index(f"{side}Elbow.{part}") for part in "xyzw"]
        turned = Rotation.from_quat(shapes[:, shoulder]).as_rotvec()
        expected = np.outer(sign * (0.5 * np.pi - lowered), [1.0, 0.0, 0.0])
        np.testing.assert_allclose(turned, expected, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(Rotation.from_quat(shapes[:, elbow]).magnitude(), 0.0, rtol=0, atol=ROUNDING)


def test_two_poses_that_the_joints_do_not_tell_apart_are_asked_for(tmp_path, load_urdf):
    """An upper arm without a forearm: nothing says whether it hangs in the body's zero pose or is held out."""
    ball = '<joint name="arm" type="spherical"><parent link="{}"/><child link="{}"/><origin xyz="0 0.2 0.5"/></joint>'
    pair = ("Pelvis", "LeftUpperArm")
    body = load_urdf(urdf(*(link(name, 5.0, (0.1, 0.1, 0.05)) for name in pair), ball.format(*pair)))
    turns = {name: np.tile(np.eye(3), (COUNT, 1, 1)) for name in pair}
    places = {name: np.tile([0.0, 0.2 * k, 1.0 + 0.5 * k], (COUNT, 1)) for k, name in enumerate(pair)}
    (tmp_path / "suit.mvnx").write_text(segment_files.mvnx_text(turns, places), encoding="utf-8")
    with pytest.raises(TrajectoryError, match="npose"):
        read_recorded_motion(tmp_path / "suit.mvnx", body)
    with pytest.warns(TrajectoryWarning, match="room"):
        recorded = read_recorded_motion(tmp_path / "suit.mvnx", body, calibration="tpose")
    np.testing.assert_allclose(recorded.path.shape(TIMES), np.tile([0.0, 0.0, 0.0, 1.0], (COUNT, 1)), atol=ROUNDING)


def test_check_prints_the_momentum_of_both_and_gives_it_to_programs(tmp_path, capsys, body):
    motion = moved()
    file, _ = write(tmp_path, "", motion, own_axes(motion))
    expected = segment_files.momentum_between(motion).mean(axis=0)
    main(["check", str(body.file), str(file), "--calibration", "0", "--json"])
    found = json.loads(capsys.readouterr().out)["motion"]["recording"]["segments"]
    for name in ("momentum_of_poses", "momentum_of_chain"):
        np.testing.assert_allclose(found[name], expected, rtol=0, atol=ROUNDING)
    main(["check", str(body.file), str(file), "--calibration", "0", "--length-tolerance", "0.05"])
    line = next(line for line in capsys.readouterr().out.splitlines() if "mean momentum" in line)
    assert f"({', '.join(f'{value:.4g}' for value in expected)}) of the segments' own poses" in line


def test_quaternions_of_a_sensor_beside_the_joints_are_no_segments(tmp_path):
    """A table of joints with the base stays one, whatever else has a quaternion."""
    cat = sp.load_body("cat_two_halves")
    turns = Rotation.from_rotvec(np.outer(TIMES, [0.1, 0.2, 0.3])).as_quat()
    columns = {"time": TIMES, **{name: 0.1 * np.sin(k + TIMES) for k, name in enumerate(cat.joint_names)}}
    columns |= {f"base_{axis}": np.ones(COUNT) for axis in "xyz"}
    columns |= {f"{what}_q{axis}": turns[:, k] for what in ("base", "imu") for k, axis in enumerate("xyzw")}
    rows = [",".join(map(repr, row)) for row in np.column_stack(list(columns.values())).tolist()]
    (tmp_path / "log.csv").write_text("\n".join([",".join(columns), *rows]), encoding="utf-8")
    recorded = read_recorded_motion(tmp_path / "log.csv", cat, ignore_extra=True)
    assert recorded.segments is None
    np.testing.assert_allclose(
        Rotation.from_matrix(recorded.base_attitude).as_rotvec(), np.outer(TIMES, [0.1, 0.2, 0.3]), rtol=0, atol=1e-14
    )
