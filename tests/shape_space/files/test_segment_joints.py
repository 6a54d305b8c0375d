"""Joints between segments that are no single hinge or ball: coupled ones, slides, links welded together."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from shapephase.shape_space.files import read_recorded_motion
from support import segment_files
from support.bodies import joint, link, urdf
from support.segment_files import COUNT, TIMES

ROUNDING = 1e-10


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
