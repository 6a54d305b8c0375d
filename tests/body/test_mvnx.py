"""The person in an inertial suit: a body of its MVNX file, and the motion of the same file."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import IgnoredElementWarning, ModelFileError
from shapephase.shape_space.files import read_recorded_motion
from support import segment_files
from support.segment_files import COUNT, TIMES

ROUNDING = 1e-10


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
    with pytest.raises(ModelFileError, match=r"cut\.mvnx"):
        sp.load_body(tmp_path / "cut.mvnx")
