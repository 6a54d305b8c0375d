"""BVH files: a human from a skeleton, and the motion of the same file."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import IgnoredElementWarning, ModelFileError, ShapeError, TrajectoryError
from support import bvh_files
from support.bvh_files import UNIT, ZYX, bvh_text, columns, load, posed, skeleton_text, write

MASSLESS = ("ToeBase", "FingerBase")
STEP = 1.0 / 120.0
MOMENTUM = np.array([-45.0, 2.0, 1.0])
"""[kg m^2/s] Backwards over the left and right axis, with some twist."""
DIGITS = 1e-6
"""[degrees, units] To which a file with six decimals is written, half of it."""


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    return load(write(tmp_path_factory.mktemp("bvh") / "person.bvh", bvh_text(np.zeros((0, len(columns()))), STEP)))


def random_rows(count, turns=ZYX):
    """A random posture, and others near it: a bone turns by less than a third of a turn between them."""
    generator, width = np.random.default_rng(3), len(columns(turns))
    return generator.uniform(-80.0, 80.0, width) + generator.uniform(-15.0, 15.0, (count, width))


@pytest.mark.parametrize("turns", [ZYX, ("Xrotation", "Zrotation", "Yrotation")], ids=["zyx", "xzy"])
def test_bones_are_where_the_format_puts_them(turns, tmp_path):
    """Poses of all bones of random frames, by the products of rotations that define the format."""
    rows = random_rows(3, turns)
    body = load(write(tmp_path / "turns.bvh", bvh_text(rows, STEP, turns)))
    recorded = sp.read_recorded_motion(tmp_path / "turns.bvh", body)
    assert body.n_shape == 4 * (len(bvh_files.bones()) - 5)
    for frame, row in enumerate(rows):
        expected = posed(row, turns)
        shape = recorded.path.shape(recorded.times[frame])
        assert recorded.base_attitude is not None
        assert recorded.base_position is not None
        np.testing.assert_allclose(recorded.base_attitude[frame], expected["Hips"][:3, :3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(recorded.base_position[frame], UNIT * row[:3], rtol=1e-15)
        for name, pose in expected.items():
            if name.endswith(MASSLESS):
                continue
            seen = np.linalg.inv(expected["Hips"]) @ pose
            seen[:3, 3] *= UNIT
            np.testing.assert_allclose(body.link_pose(shape, name), seen, rtol=0, atol=1e-13)


def test_the_segments_are_those_of_the_astronaut(tmp_path):
    """A skeleton with the joints of astronaut.urdf, made of the same table, has his masses, centres and inertias."""
    astronaut = sp.load_body("astronaut")
    shape = astronaut.shape()
    names = {"LowerBack": "middle_trunk", "Chest": "upper_trunk", "Head": "head"}
    above = {"LowerBack": "Hips", "Chest": "LowerBack", "Head": "Chest"}
    for side in ("Left", "Right"):
        limbs = [("UpLeg", "thigh"), ("Leg", "shank"), ("Foot", "foot")]
        arms = [("Arm", "upper_arm"), ("ForeArm", "forearm"), ("Hand", "hand")]
        for first, chain in (("Hips", limbs), ("Chest", arms)):
            last = first
            for bone, link in chain:
                names[side + bone], above[side + bone], last = f"{side.lower()}_{link}", last, side + bone
    names["Hips"] = "lower_trunk"
    place = {bone: astronaut.link_pose(shape, link)[:3, 3] for bone, link in names.items()}

    def lines(bone):
        offset = place[bone] - place.get(above.get(bone, ""), place[bone])
        toes = "0.2 0 0" if bone.endswith("Foot") else "0 0 -0.1"
        ends = [] if bone in above.values() else ["End Site", "{", f"OFFSET {toes}", "}"]
        below = [line for other, parent in above.items() if parent == bone for line in lines(other)]
        return [
            f"{'JOINT' if bone in above else 'ROOT'} {bone}",
            "{",
            "OFFSET " + " ".join(map(repr, offset.tolist())),
            f"CHANNELS 3 {' '.join(ZYX)}",
            *below,
            *ends,
            "}",
        ]

    text = "\n".join(["HIERARCHY", *lines("Hips"), "MOTION", "Frames: 0", "Frame Time: 0.01"])
    found = load(write(tmp_path / "astronaut.bvh", text), length_unit=1.0, person_mass=82.2)
    parts = {part.links[0]: part for part in found.moving_parts}
    expected = {part.links[0]: part for part in astronaut.moving_parts}
    for bone, link in names.items():
        one, other = parts[bone], expected[link]
        assert one.mass == pytest.approx(other.mass, abs=1e-9)
        # Places have four decimals, and inertias five; a foot's centre is set lower there.
        apart = np.abs(one.centre - other.centre)
        assert np.all(apart[: 2 if link.endswith("foot") else 3] < 3e-4), bone
        np.testing.assert_allclose(one.inertia, other.inertia, rtol=2e-3, atol=1e-5, err_msg=bone)


def flip(body):
    """Times, the path of a tuck, and a backward somersault along it."""
    times = STEP * np.arange(97)
    tuck = np.sin(np.pi * times / times[-1]) ** 2
    sway = np.sin(2.0 * np.pi * times / times[-1])
    turns = {
        **{f"{side}UpLeg": (-2.0, 0.0, 0.0) for side in ("Left", "Right")},
        **{f"{side}Leg": (2.2, 0.0, 0.0) for side in ("Left", "Right")},
        "RightArm": (0.0, 1.2, 0.0), "LeftArm": (0.0, -1.2, 0.0), "Spine": (0.5, 0.0, 0.0), "Neck": (0.4, 0.0, 0.0),
    }  # fmt: skip
    leans = {"LowerBack": (0.0, 0.0, 0.2), "LeftArm": (0.0, 0.0, 0.9), "RightForeArm": (0.0, 0.6, 0.0)}
    shapes = np.tile(body.shape(), (len(times), 1))
    for bone in {*turns, *leans}:
        vectors = np.outer(tuck, turns.get(bone, np.zeros(3))) + np.outer(sway, leans.get(bone, np.zeros(3)))
        first = body.joint_index(f"{bone}.x")
        shapes[:, first : first + 4] = Rotation.from_rotvec(vectors).as_quat()
    path = sp.ShapePath.spline(times, shapes, periodic=False, joint_names=body.joint_names)
    return times, path, sp.reconstruct(sp.articulated(body, path), MOMENTUM, tolerance=1e-10)


def rows_of(times, path, motion):
    """What a recorder writes of it: places in units, angles in degrees."""
    shapes, named = path.shape(times), {}
    for first, name in enumerate(path.joint_names):
        if name.endswith(".x"):
            bone, turned = name.removesuffix(".x"), Rotation.from_quat(shapes[:, first : first + 4])
            angles = turned.as_euler("ZYX", degrees=True).T
            named |= {f"{bone}_{turn}": each for turn, each in zip(ZYX, angles, strict=True)}
    fall = {"start": [0.0, 1.0, 0.0], "velocity": [0.0, 3.5, -0.8], "gravity": [0.0, -9.81, 0.0]}
    places = motion.base_position(times, **fall) / UNIT
    turned = motion.attitude(times)
    second = np.arcsin(-turned[:, 2, 0])
    first, third = np.arctan2(turned[:, 1, 0], turned[:, 0, 0]), np.arctan2(turned[:, 2, 1], turned[:, 2, 2])
    named |= {f"Hips_{axis}position": places[:, k] for k, axis in enumerate("XYZ")}
    named |= dict(zip([f"Hips_{turn}" for turn in ZYX], np.degrees([first, second, third]), strict=True))
    return np.stack([named.get(name, np.zeros(len(times))) for name in columns()], axis=1)


@pytest.fixture(scope="module")
def somersault(body):
    times, path, motion = flip(body)
    return times, path, motion, rows_of(times, path, motion)


def fitted(body, recorded):
    return sp.momentum_from_recording(sp.articulated(body, recorded.path), recorded.times, recorded.base_attitude)


def test_a_somersault_comes_back(body, somersault, tmp_path):
    """Written, read, fitted and split: momentum and phases are those of the motion that was written.

    Angles are off by half of the last decimal; so is the base, along which the momentum is fitted.
    """
    _, path, motion, rows = somersault
    file = write(tmp_path / "jump.bvh", bvh_text(np.round(rows, 6), STEP))
    recorded = sp.read_recorded_motion(file, load(file), flight="all", close=False)
    assert recorded.format == "BVH"
    # The file's decimals, and a spline that lets errors grow by no more than three halves.
    off = np.radians(DIGITS)
    assert np.abs(recorded.path.shape(path.sample_times) - path.shape(path.sample_times)).max() < off
    found = fitted(body, recorded)
    assert np.linalg.norm(found.momentum - MOMENTUM) < 100.0 * off * np.linalg.norm(MOMENTUM)
    before, after = sp.split(motion), sp.split(found.motion)
    assert after.total_rotation == pytest.approx(before.total_rotation, abs=1e3 * off)
    assert after.dynamic_phase == pytest.approx(before.dynamic_phase, abs=1e3 * off)


WRAPPED = np.array([150.0, 165.0, 179.0, -167.0, -152.0, -139.0, -128.0])


@pytest.mark.parametrize("second", ["", "Yrotation "], ids=["one channel", "two channels"])
def test_hinges_that_files_wrap_go_on(second, tmp_path):
    """A bone of one or two channels is hinges, whose angles are determined but for whole turns."""
    text = re.sub(r"(JOINT LeftLeg\n.*\n.*\n\s+)CHANNELS 3 .*", rf"\1CHANNELS {1 + bool(second)} {second}Xrotation",
                  skeleton_text())  # fmt: skip
    names = [name for name in columns() if not re.match(r"LeftLeg_[ZY]", name)]
    place = names.index("LeftLeg_Xrotation")
    if second:
        names.insert(place, "LeftLeg_Yrotation")
    rows = np.zeros((len(WRAPPED), len(names)))
    rows[:, names.index("LeftLeg_Xrotation")] = WRAPPED
    frames = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    file = write(tmp_path / "wrap.bvh", f"{text}MOTION\nFrames: {len(rows)}\nFrame Time: {STEP}\n{frames}\n")
    body = load(file)
    recorded = sp.read_recorded_motion(file, body)
    found = recorded.path.shape(recorded.times)[:, body.joint_index("LeftLeg_Xrotation")]
    np.testing.assert_allclose(np.degrees(found), WRAPPED % 360.0, rtol=1e-15)
    assert ("LeftLeg_Yrotation" in body.joint_names) == bool(second)


def test_what_a_file_does_not_say_is_asked_or_told(tmp_path):
    file = write(tmp_path / "a.bvh", bvh_text(np.zeros((2, len(columns()))), STEP))
    with pytest.raises(ModelFileError, match="length_unit"):
        sp.load_body(file)
    with pytest.warns(IgnoredElementWarning, match="RightFingerBase"):
        found = sp.load_body(file, length_unit=UNIT)
    assert found.mass == pytest.approx(70.0, rel=1e-14)
    assert found.length_unit == UNIT
    heavier: Any = found.with_inertias(masses={"Head": 5.0})
    assert heavier.length_unit == UNIT
    with pytest.raises(ShapeError, match="length_unit"):
        sp.load_body("cat", length_unit=0.01)
    with pytest.raises(ShapeError, match="person_mass"):
        sp.load_body("cat", person_mass=70.0)
    with pytest.raises(TrajectoryError, match="length_unit"):
        sp.load_body(file, length_unit=-1.0)
    with pytest.raises(ShapeError, match="root_body"):
        load(file, root_body="Hips")


def test_the_content_tells_the_format_and_other_bodies_have_no_such_motion(tmp_path):
    text = bvh_text(np.zeros((2, len(columns()))), STEP)
    assert load(write(tmp_path / "skeleton.dat", "\ufeff\n" + text)).n_shape == 84
    with pytest.raises(TrajectoryError, match="skeleton"):
        sp.read_shape_path(write(tmp_path / "m.bvh", text), sp.load_body("cat"))


def test_the_jump_that_ships_is_counted_within_its_bars():
    """The momentum that the file was made of, and twists about the axes of the skeleton: y up, x from right to left."""
    person = load(bvh_files.JUMP)
    found = fitted(person, sp.read_recorded_motion(bvh_files.JUMP, person, flight="auto"))
    bars = sp.uncertainty(found.motion, joints="0.2deg", start=found)
    off = found.momentum - bvh_files.JUMP_MOMENTUM
    assert off @ np.linalg.solve(bars.start[3:, 3:], off) < 16.3  # one of a thousand takes is beyond
    axes = found.motion.athlete_axes()
    assert axes.by_links
    np.testing.assert_allclose(axes.lateral, [1.0, 0.0, 0.0], atol=0.01)
    turns = sp.phases.athlete_turns(found.motion)
    _, _, twist = found.motion.somersault_tilt_twist([0.0, 1.0], lateral="x", longitudinal="y", up="y")
    assert turns.twists == pytest.approx(np.diff(twist)[0] / (2.0 * np.pi), abs=0.01)
    assert bars.twists is not None
    assert 0.0 < bars.twists < 0.003


@pytest.mark.full
def test_the_jump_is_written_anew_as_it_ships():
    assert bvh_files.jump_text() == bvh_files.JUMP.read_text(encoding="utf-8")


def one_channel(rows):
    """A file in which the left knee has one channel."""
    text = re.sub(r"(JOINT LeftLeg\n.*\n.*\n\s+)CHANNELS 3 .*", r"\1CHANNELS 1 Xrotation", skeleton_text())
    kept = [k for k, name in enumerate(columns()) if not re.match(r"LeftLeg_[ZY]", name)]
    frames = "\n".join(" ".join(map(repr, row)) for row in rows[:, kept].tolist())
    return f"{text}MOTION\nFrames: {len(rows)}\nFrame Time: {STEP}\n{frames}\n"


def test_one_channel_turns_a_ball_joint_and_three_no_hinge(body, tmp_path):
    rows = np.zeros((7, len(columns())))
    rows[:, columns().index("LeftLeg_Xrotation")] = WRAPPED
    one, three = write(tmp_path / "one.bvh", one_channel(rows)), write(tmp_path / "three.bvh", bvh_text(rows, STEP))
    found, same = (sp.read_shape_path(file, body) for file in (one, three))
    np.testing.assert_array_equal(found.shape(found.breaks), same.shape(same.breaks))
    with pytest.raises(TrajectoryError, match="'LeftLeg'"):
        sp.read_shape_path(three, load(one))


def test_bones_with_other_axes_are_no_motion_of_this_body(body, tmp_path):
    """The offset of a bone turned by a right angle."""
    turned = edited("OFFSET 0.4 -8.3 0.0", "OFFSET 8.3 0.4 0.0")
    with pytest.raises(TrajectoryError, match="'LeftLeg'"):
        sp.read_shape_path(write(tmp_path / "m.bvh", turned), body)


@pytest.mark.parametrize(
    "renamed",
    [
        {
            "LeftUpLeg": "L_Hip", "LeftLeg": "L_Knee", "LeftFoot": "L_Ankle", "LeftToeBase": "L_Foot",
            "LeftShoulder": "L_Collar", "LeftArm": "L_Shoulder", "LeftForeArm": "L_Elbow", "LeftHand": "L_Wrist",
        },
        {
            "LeftUpLeg": "thigh_l", "LeftLeg": "calf_l", "LeftFoot": "foot_l", "LeftToeBase": "ball_l",
            "LeftShoulder": "clavicle_l", "LeftArm": "upperarm_l", "LeftForeArm": "lowerarm_l", "LeftHand": "hand_l",
        },
        {"LeftArm": "mixamorig:LeftArm", "Head": "mixamorig:Head", "LeftLeg": "mixamorig:LeftLeg"},
    ],
    ids=["joints of learned models", "sides behind", "a prefix"],
)  # fmt: skip
def test_names_of_other_skeletons(renamed, body, tmp_path):
    """Each part carries the same under any of its names."""
    text = bvh_text(np.zeros((0, len(columns()))), STEP)
    mirrored = {
        old.replace("Left", "Right"): new.replace("L_", "R_").replace("_l", "_r").replace("Left", "Right")
        for old, new in renamed.items()
    }
    for old, new in {**renamed, **mirrored}.items():
        text = re.sub(rf"JOINT {old}\n", f"JOINT {new}\n", text)
    other = load(write(tmp_path / "other.bvh", text))
    np.testing.assert_array_equal(other.locked_inertia(other.shape()), body.locked_inertia(body.shape()))


def edited(old, new, count=1):
    text = bvh_text(np.zeros((3, len(columns()))), STEP)
    assert old in text
    return text.replace(old, new, count)


def without_first(text):
    """Each frame with a number less."""
    return text.replace(FRAME, FRAME[4:])


FRAME = " ".join(["0.0"] * len(columns()))
FAULTS = {
    "cut off": (lambda: skeleton_text()[:900].rpartition("\n")[0], "the file ends where"),
    "no motion": (skeleton_text, "the file ends where MOTION is needed"),
    "a brace is missing": (lambda: edited("\n}\nMOTION", "\nMOTION"), "JOINT, End Site or } is needed, got 'MOTION'"),
    "a brace too many": (lambda: edited("MOTION", "}\nMOTION"), "MOTION is needed behind the skeleton"),
    "no opening brace": (lambda: edited("JOINT Spine\n\t\t{", "JOINT Spine"), "Spine: { is needed"),
    "an unknown channel": (lambda: edited("Zrotation", "Wrotation"), "the channel 'Wrotation' is unknown"),
    "a wrong count": (lambda: edited("CHANNELS 3", "CHANNELS 4"), "CHANNELS 4 are stated, and 3 follow"),
    "a hinge twice": (
        lambda: edited("CHANNELS 3 Zrotation Yrotation Xrotation", "CHANNELS 2 Xrotation Xrotation"),
        "stands twice",
    ),
    "a place twice": (lambda: edited("CHANNELS 6 Xposition", "CHANNELS 6 Yposition"), "stands twice"),
    "root without turns": (
        lambda: without_first(
            edited("CHANNELS 6 Xposition Yposition Zposition Zrotation", "CHANNELS 5 Xposition Yposition Zposition")
        ),
        "three rotations are needed",
    ),
    "root on a plane": (lambda: without_first(edited("CHANNELS 6 Xposition", "CHANNELS 5")), "three positions or none"),
    "a number beyond all others": (lambda: edited(FRAME, FRAME[:-3] + "1e200"), "1e+200 in a frame"),
    "no number": (lambda: edited("OFFSET 0.0 2.9", "OFFSET 0.0 2,9"), "'2,9' is not a finite number"),
    "two numbers": (lambda: edited("OFFSET 0.0 2.9 -0.2", "OFFSET 0.0 2.9"), "OFFSET and three numbers"),
    "far away": (lambda: edited("OFFSET 0.0 2.9", "OFFSET 0.0 1e200"), "an offset above"),
    "two of a name": (lambda: edited("JOINT Spine1", "JOINT Spine"), "two bones are named 'Spine'"),
    "no name": (lambda: edited("JOINT Spine1", "JOINT"), "a name of letters"),
    "a second root": (lambda: edited("JOINT Spine\n", "ROOT Spine\n"), "JOINT, End Site or } is needed, got 'ROOT"),
    "endless nesting": (
        lambda: (
            "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n"
            + "".join(f"JOINT b{k}\n{{\nOFFSET 0 0 0\nCHANNELS 0\n" for k in range(5000))
        ),
        "nested more than 100 deep",
    ),
    "not a number": (lambda: edited(FRAME, FRAME[:-3] + "nan"), "'nan' is not a finite number"),
    "a grouped number": (lambda: edited(FRAME, FRAME[:-3] + "1_0"), "'1_0' is not a finite number"),
    "a short frame": (lambda: edited(FRAME, FRAME[:-4]), "80 numbers in a frame, and the skeleton has 81 channels"),
    "frames too few": (lambda: edited("Frames: 3", "Frames: 4"), "4 are stated, and 3 follow; the file is cut off"),
    "frames too many": (lambda: edited("Frames: 3", "Frames: 2"), "2 are stated, and more follow"),
    "frames without end": (lambda: edited("Frames: 3", "Frames: 999999999"), "are stated, and 3 follow"),
    "no count": (lambda: edited("Frames: 3", "Frames: three"), "'three' is not a number of frames"),
    "no time": (lambda: edited(f"Frame Time: {STEP!r}", "Frame Time: 0"), "a time above 0 is needed"),
    "not text": (lambda: edited("JOINT Spine1", "JOINT Sp\0ine"), "that can be printed"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_damaged_files_are_refused_with_their_line(name, body, tmp_path):
    """As a body and as a motion."""
    made, said = FAULTS[name]
    file = write(tmp_path / "odd.bvh", made())
    with pytest.raises(ModelFileError, match=rf"odd\.bvh:\d+: .*{re.escape(said)}"):
        load(file)
    with pytest.raises(TrajectoryError, match=rf"odd\.bvh: line \d+: .*{re.escape(said)}"):
        sp.read_shape_path(file, body)


HUMAN_FAULTS = {
    "no knee": (
        ("JOINT LeftLeg", "JOINT Kneecap"),
        "no bone is known as the left shank of a human; call it LeftLeg in the",
    ),
    "no head": (("JOINT Head", "JOINT Top"), None),
    "a bone without length": (("OFFSET 0.4 -8.3 0.0", "OFFSET 0 0 0"), "bone 'LeftUpLeg' has no length"),
}


@pytest.mark.parametrize("name", HUMAN_FAULTS)
def test_skeletons_of_no_human(name, body, tmp_path):
    """Without a head, its mass is on the neck."""
    change, said = HUMAN_FAULTS[name]
    file = write(tmp_path / "odd.bvh", edited(*change))
    if said is None:
        assert load(file).mass == pytest.approx(body.mass, rel=1e-14)
        return
    with pytest.raises(ModelFileError, match=rf"odd\.bvh:\d+: {said}"):
        load(file)


@pytest.mark.parametrize(
    ("shift", "said"), [(0.0, None), (0.5, r"line \d+: bone 'Spine' is 0.5 units from its OFFSET")]
)
def test_places_of_bones_are_their_offsets_or_an_error(shift, said, body, tmp_path):
    """Some programs write six channels for every bone."""
    text = re.sub(
        r"(JOINT Spine\n\s+\{\n\s+OFFSET .*\n\s+)CHANNELS 3 (.*)", r"\1CHANNELS 6 Xposition Yposition Zposition \2",
        skeleton_text(),
    )  # fmt: skip
    column = columns().index("Spine_Zrotation")
    rows = np.insert(random_rows(3), [column] * 3, [0.0, 2.9, -0.2 + shift], axis=1)
    frames = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    file = write(tmp_path / "six.bvh", f"{text}MOTION\nFrames: 3\nFrame Time: 0.01\n{frames}\n")
    if said is None:
        plain = sp.read_shape_path(write(tmp_path / "three.bvh", bvh_text(random_rows(3), 0.01)), body)
        np.testing.assert_array_equal(sp.read_shape_path(file, load(file)).shape(0.01), plain.shape(0.01))
        return
    with pytest.raises(TrajectoryError, match=said):
        sp.read_shape_path(file, body)
