"""Poses of segments: base, joints and momentum against a person that SciPy's rotations have moved."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import IgnoredElementWarning, ModelFileError, ShapeError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files import read_recorded_motion
from support import segment_files
from support.bodies import joint, link, urdf
from support.segment_files import COUNT, LINKS, THEIR_NAMES, TIMES, moved, own_axes

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
    with pytest.warns(TrajectoryWarning, match="axes of the room"):
        recorded = read_recorded_motion(file, body, calibration=0.0)
    np.testing.assert_allclose(recorded.base_attitude, motion.turns["hips"], rtol=0, atol=ROUNDING)
    shapes = recorded.path.shape(TIMES)
    for name, expected in motion.columns.items():
        np.testing.assert_allclose(shapes[:, body.joint_index(name)], expected, rtol=0, atol=ROUNDING)
    assert recorded.base_position is None
    assert recorded.segments.of_poses is None


def test_a_calibration_pose_by_its_name_and_by_the_better_fit(tmp_path, body):
    """Of a T-pose with the legs apart and an N-pose the body's zero pose is taken."""
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
    with pytest.raises(TrajectoryError, match=r"does not stand in its zero pose at tpose.*--calibration T"):
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
    with pytest.raises(TrajectoryError, match=r"'tpose-isb': a time is needed.*--calibration T"):
        read_recorded_motion(tmp_path / "suit.mvnx", body, calibration="tpose-isb")


def test_lengths_in_a_file_without_unit_are_those_of_the_body(tmp_path, body):
    motion = moved()
    file = tmp_path / "poses.c3d"
    segment_files.write_c3d(str(file), own_axes(motion), motion.places, None)
    recorded = read_recorded_motion(file, body, calibration=0.0)
    check(recorded, body, motion, SINGLE)
    assert recorded.record["segments"]["length_unit"].startswith("mm")


def test_frames_in_which_nobody_is_seen_are_refused_by_their_number_and_may_be_cut_off(tmp_path, body):
    motion = moved()
    file = tmp_path / "poses.c3d"
    segment_files.write_c3d(str(file), own_axes(motion), motion.places, "mm", unseen=3)
    with pytest.raises(TrajectoryError, match=f"frame {COUNT - 2}"):
        read_recorded_motion(file, body, calibration=0.0)
    kept = read_recorded_motion(file, body, calibration=0.0, trim=(0.0, TIMES[-4] + 1e-6))
    np.testing.assert_allclose(kept.base_attitude, motion.turns["hips"][:-3], rtol=0, atol=SINGLE)


def test_the_body_of_a_suit_is_moved_as_its_segments_are(tmp_path):
    names, _, joints, tposed = suit()
    generator = np.random.default_rng(5)
    angles = {name: np.cumsum(0.02 * generator.normal(size=(COUNT, 3)), axis=0) for name in names}
    turns, places = {}, {}
    for name in names:
        own = Rotation.from_rotvec(angles[name] * (name not in ("RightToe", "LeftToe"))).as_matrix()
        parent, place = joints.get(name, (None, np.zeros(3)))
        turns[name] = own if parent is None else turns[parent] @ own
        places[name] = np.tile(place, (COUNT, 1)) if parent is None else places[parent] + turns[parent] @ place
    file = tmp_path / "suit.mvnx"
    file.write_text(suit_text(turns, places, tposed), encoding="utf-8")
    with pytest.warns(IgnoredElementWarning):
        body = sp.load_body(file, person_mass=60.0)
    assert body.mass == pytest.approx(60.0, rel=1e-12)
    recorded = read_recorded_motion(file, body)
    shapes = recorded.path.shape(TIMES)
    for name in names:
        pose = body.link_pose(shapes, name)
        found = (
            recorded.base_attitude @ pose[:, :3, :3],
            recorded.base_position + np.einsum("nij,nj->ni", recorded.base_attitude, pose[:, :3, 3]),
        )
        np.testing.assert_allclose(found[0], turns[name], rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(found[1], places[name], rtol=0, atol=ROUNDING)


def suit():
    """Segments of a suit, their points, child -> parent and place, and names of points."""
    legs = [("UpperLeg", "Pelvis", (0.0, 0.1, 0.0)), ("LowerLeg", "UpperLeg", (0.0, 0.0, -0.42)),
            ("Foot", "LowerLeg", (0.0, 0.0, -0.4)), ("Toe", "Foot", (0.17, 0.0, -0.06))]  # fmt: skip
    arms = [("Shoulder", "T8", (0.0, 0.03, 0.07)), ("UpperArm", "Shoulder", (0.0, 0.14, 0.0)),
            ("ForeArm", "UpperArm", (0.0, 0.27, 0.0)), ("Hand", "ForeArm", (0.0, 0.24, 0.0))]  # fmt: skip
    spine = [("L5", "Pelvis", (0.0, 0.0, 0.1)), ("L3", "L5", (0.0, 0.0, 0.1)), ("T12", "L3", (0.0, 0.0, 0.09)),
             ("T8", "T12", (0.0, 0.0, 0.09)), ("Neck", "T8", (0.0, 0.0, 0.13)),
             ("Head", "Neck", (0.0, 0.0, 0.09))]  # fmt: skip
    joints = {name: (parent, np.array(place)) for name, parent, place in spine}
    for side, sign in (("Right", -1.0), ("Left", 1.0)):
        for name, parent, place in (*legs, *arms):
            above = parent if parent in ("Pelvis", "T8") else side + parent
            joints[side + name] = above, np.array(place) * [1.0, sign, 1.0]
    names = ["Pelvis", *joints]
    points: dict[str, dict[str, tuple[float, ...]]] = {name: {} for name in names}
    for name, (parent, place) in joints.items():
        points[parent][f"j{name}"], points[name][f"j{name}"] = tuple(place.tolist()), (0.0, 0.0, 0.0)
    points["Head"]["pTopOfHead"] = (0.0, 0.0, 0.2)
    tposed = {name: np.zeros(3) for name in names}
    for name, (parent, place) in joints.items():
        tposed[name] = tposed[parent] + place
    return names, points, joints, tposed


def suit_text(turns, places, tposed):
    _, points, joints, _ = suit()
    listed = "".join(
        f'<joint label="j{name}"><connector1>{parent}/j{name}</connector1>'
        f"<connector2>{name}/j{name}</connector2></joint>"
        for name, (parent, _) in joints.items()
    )
    first = {name: np.concatenate([np.eye(3)[None], each]) for name, each in turns.items()}
    begun = {name: np.concatenate([tposed[name][None], each]) for name, each in places.items()}
    text = segment_files.mvnx_text(first, begun, joints=f"<joints>{listed}</joints>", points=points)
    lines = [line for line in text.splitlines() if ' index="0"' not in line]
    return "\n".join(lines)


def test_the_person_in_a_suit_is_that_of_a_bvh_file_of_the_same_bones(tmp_path):
    """Two readers, one of offsets and one of points, lay out one person: mass and inertia about three axes agree."""
    names, points, joints, tposed = suit()
    still = {name: np.tile(np.eye(3), (2, 1, 1)) for name in names}
    (tmp_path / "suit.mvnx").write_text(
        suit_text(still, {name: np.tile(place, (2, 1)) for name, place in tposed.items()}, tposed), encoding="utf-8"
    )
    lines = []

    def bone(name, place):
        head, width = ("ROOT", 6) if name == "Pelvis" else ("JOINT", 3)
        slides = "Xposition Yposition Zposition " if width == 6 else ""
        lines.append(f"{head} {name}\n{{\nOFFSET {' '.join(map(repr, place.tolist()))}")
        lines.append(f"CHANNELS {width} {slides}Zrotation Xrotation Yrotation")
        below = [child for child, (parent, _) in joints.items() if parent == name]
        for child in below:
            bone(child, joints[child][1])
        for label, tip in points[name].items():
            if label.startswith("p"):
                lines.append(f"End Site\n{{\nOFFSET {' '.join(map(repr, tip))}\n}}")
        lines.append("}")

    bone("Pelvis", np.zeros(3))
    frame = " ".join(["0"] * (3 + 3 * len(names)))
    text = "\n".join(["HIERARCHY", *lines, "MOTION", "Frames: 1", "Frame Time: 0.1", frame]) + "\n"
    (tmp_path / "person.bvh").write_text(text, encoding="utf-8")
    with pytest.warns(IgnoredElementWarning):
        first = sp.load_body(tmp_path / "suit.mvnx", person_mass=60.0)
    with pytest.warns(IgnoredElementWarning):
        second = sp.load_body(tmp_path / "person.bvh", person_mass=60.0, length_unit=1.0)
    np.testing.assert_allclose(
        first.locked_inertia(first.shape()), second.locked_inertia(second.shape()), rtol=0, atol=1e-12
    )


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
        (lambda text: text.replace("<orientation>", "<orientation>x", 1), "no number"),
        (lambda text: re.sub("<orientation>[^ ]* ", "<orientation>9 ", text, count=1), "off length 1"),
        (lambda text: text.replace("mvnx", "other"), "this is no MVNX"),
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
    with pytest.raises(TrajectoryError, match=r"'Velocities'.*_pos_global"):
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
    with pytest.raises(TrajectoryError, match=r"poses of segments.*leave them out"):
        read_recorded_motion(tmp_path / "q.npz", cat, calibration=0.0)


def test_the_binary_file_of_a_suit_says_what_to_export(tmp_path, body):
    (tmp_path / "take.mvn").write_bytes(b"\x00MVN")
    with pytest.raises(TrajectoryError, match="export it there as MVNX"):
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
    with pytest.raises(TrajectoryError, match=r"both tpose and npose.*--calibration tpose"):
        read_recorded_motion(tmp_path / "suit.mvnx", body)
    with pytest.warns(TrajectoryWarning, match="axes of the room"):
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


def test_joints_that_are_no_tree_make_no_body_and_a_prop_is_no_part_of_it(tmp_path):
    names, _, _, tposed = suit()
    still = {name: np.tile(np.eye(3), (2, 1, 1)) for name in names}
    places = {name: np.tile(place, (2, 1)) for name, place in tposed.items()}
    text = suit_text(
        {**still, "Prop1": still["Head"]}, {**places, "Prop1": places["Head"]}, {**tposed, "Prop1": np.ones(3)}
    )
    (tmp_path / "suit.mvnx").write_text(text, encoding="utf-8")
    with pytest.warns(IgnoredElementWarning):
        body = sp.load_body(tmp_path / "suit.mvnx", person_mass=60.0)
    assert set(body.link_names) == set(names)
    cut = re.sub(r'<joint label="jL3">.*?</joint>', "", text)
    (tmp_path / "cut.mvnx").write_text(cut, encoding="utf-8")
    with pytest.raises(ModelFileError, match=r"cut\.mvnx:1: joints have 2 roots"):
        sp.load_body(tmp_path / "cut.mvnx")


def test_hinges_that_follow_one_coordinate_are_found_by_the_turn_they_make_together(tmp_path, load_urdf):
    """Two hinges in a row, of which the second turns 0.4 times as far plus 0.1 rad about another axis."""
    axes, angles = np.array([[0.0, 1.0, 0.0], [0.0, 0.6, 0.8]]), 0.7 + 0.5 * np.sin(4.0 * TIMES)
    follows = '<mimic joint="knee" multiplier="0.4" offset="0.1"/>'
    body = load_urdf(
        urdf(
            *(link(name, 5.0, (0.1, 0.1, 0.05)) for name in ("thigh", "shank")),
            '<link name="between"/>',
            joint("knee", "revolute", "thigh", "between", axes[0], (0.0, 0.0, -0.4)),
            joint("roll", "revolute", "between", "shank", axes[1], extra=follows),
        )
    )
    base = Rotation.from_rotvec(np.outer(TIMES, [1.0, 2.0, 0.5])).as_matrix()
    both = Rotation.from_rotvec(np.outer(angles, axes[0])) * Rotation.from_rotvec(np.outer(0.4 * angles + 0.1, axes[1]))
    places = {"thigh": np.zeros((COUNT, 3)), "shank": base @ [0.0, 0.0, -0.4]}
    file = tmp_path / "poses.csv"
    file.write_text(
        segment_files.table_text({"thigh": base, "shank": base @ both.as_matrix()}, places), encoding="utf-8"
    )
    recorded = read_recorded_motion(file, body, calibration="links")
    np.testing.assert_allclose(recorded.path.shape(TIMES)[:, 0], angles, rtol=0, atol=ROUNDING)


def test_a_joint_that_slides_is_found_by_the_places(tmp_path, load_urdf):
    """A boom that goes out along a tilted axis, behind a hinge."""
    axis, along = np.array([0.0, 0.6, 0.8]), 0.3 + 0.2 * np.sin(5.0 * TIMES)
    body = load_urdf(
        urdf(
            *(link(name, 5.0, (0.1, 0.1, 0.05)) for name in ("hub", "boom")),
            '<link name="between"/>',
            joint("swing", "revolute", "hub", "between", (1.0, 0.0, 0.0), (0.0, 0.0, 0.5)),
            joint("reach", "prismatic", "between", "boom", tuple(axis), (0.1, 0.0, 0.0)),
        )
    )
    base = Rotation.from_rotvec(np.outer(TIMES, [1.0, 2.0, 0.5])).as_matrix()
    swung = base @ Rotation.from_euler("x", np.cos(TIMES)[:, None]).as_matrix()
    out = np.einsum("nij,nj->ni", swung, [0.1, 0.0, 0.0] + along[:, None] * axis)
    places = {"hub": np.zeros((COUNT, 3)), "boom": base @ [0.0, 0.0, 0.5] + out}
    file = tmp_path / "poses.csv"
    file.write_text(segment_files.table_text({"hub": base, "boom": swung}, places), encoding="utf-8")
    shapes = read_recorded_motion(file, body, calibration="links").path.shape(TIMES)
    np.testing.assert_allclose(shapes[:, body.joint_index("reach")], along, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(shapes[:, body.joint_index("swing")], np.cos(TIMES), rtol=0, atol=ROUNDING)


def test_of_links_in_one_the_recorded_centre_of_mass_is_that_of_one(tmp_path, load_urdf):
    """A foot with toes fixed to it: BodyKinematics has the foot's centre, and base, ankle and momentum are as moved."""
    parts = {"shank": (4.0, (0.0, 0.0, -0.2)), "foot": (1.0, (0.05, 0.0, -0.02)), "toes": (0.5, (0.03, 0.0, 0.0))}
    moments = (0.05, 0.04, 0.01)
    body = load_urdf(
        urdf(
            *(link(name, mass, moments, centre) for name, (mass, centre) in parts.items()),
            joint("ankle", "revolute", "shank", "foot", (0.0, 1.0, 0.0), (0.0, 0.0, -0.4)),
            joint("fixed", "fixed", "foot", "toes", xyz=(0.15, 0.0, -0.03)),
        )
    )
    shank = Rotation.from_rotvec(np.outer(TIMES, [1.0, 2.0, 0.5]))
    foot = shank * Rotation.from_euler("y", np.sin(3.0 * TIMES)[:, None])
    turns = {"shank": shank.as_matrix(), "foot": foot.as_matrix(), "toes": foot.as_matrix()}
    places = {"shank": np.zeros((COUNT, 3)), "foot": turns["shank"] @ [0.0, 0.0, -0.4]}
    places["toes"] = places["foot"] + turns["foot"] @ [0.15, 0.0, -0.03]
    centres = {name: places[name] + turns[name] @ centre for name, (_, centre) in parts.items()}
    file = tmp_path / "run_BodyKinematics_pos_global.sto"
    file.write_text(segment_files.body_kinematics_text(turns, centres), encoding="utf-8")
    recorded = read_recorded_motion(file, body, calibration="links")
    np.testing.assert_allclose(recorded.path.shape(TIMES)[:, 0], np.sin(3.0 * TIMES), rtol=0, atol=ROUNDING)
    steps = np.diff(TIMES)[:, None]
    whole = sum(mass * centres[name] for name, (mass, _) in parts.items()) / sum(mass for mass, _ in parts.values())
    expected = 0.0
    for name, (mass, _) in parts.items():
        turned, seen = Rotation.from_matrix(turns[name]), centres[name] - whole
        step = (turned[1:] * turned[:-1].inv()).as_rotvec()
        halfway = (Rotation.from_rotvec(0.5 * step) * turned[:-1]).as_matrix()
        expected = expected + np.einsum("nij,j,nkj,nk->ni", halfway, moments, halfway, step / steps)
        expected = expected + mass * np.cross(0.5 * (seen[1:] + seen[:-1]), np.diff(seen, axis=0) / steps)
    for found in (recorded.segments.of_poses, recorded.segments.of_chain):
        # The foot and its toes are one rigid part, whose centre goes along its own chord.
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-4 * np.abs(expected).max())
    np.testing.assert_allclose(recorded.segments.of_poses, recorded.segments.of_chain, rtol=0, atol=ROUNDING)
