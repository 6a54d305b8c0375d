"""Formats that other programs own: what the engine computes, a motion by it alone, and files that are refused."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings

import biorbd
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.body.engines.formats import format_of
from shapephase.errors import IgnoredElementWarning, ModelFileError
from support.engine_files import ACROBAT, MASSLESS_ROOT, measured

# That a file is read in a process of its own is left to test_published_flights.py and the README's bodies.
pytestmark = pytest.mark.usefixtures("warm_engines")
EPS = np.finfo(float).eps
SIX_DIGITS = 5e-7
"""What a frame written with six digits lacks of being orthonormal, at most."""


def loaded(tmp_path, text, name="file.txt"):
    path = tmp_path / name
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        return sp.load_body(path)


# ---- bioMod --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def exact_acrobat():
    """With the frame's numbers to sixteen digits, as biorbd and the library must then agree to rounding."""
    cosine, sine = np.cos(0.2), np.sin(0.2)
    return ACROBAT.replace("0.980067", repr(float(cosine))).replace("0.198669", repr(float(sine)))


def test_an_acrobat_is_what_biorbd_has(tmp_path, exact_acrobat):
    body = loaded(tmp_path, exact_acrobat)
    assert body.joint_names == (
        *("Thorax_RotX", "Thorax_RotZ", "RightArm_RotZ", "RightArm_RotY", "RightArm_RotX", "Slider_TransZ"),
    )
    assert body.link_names == ("Pelvis", "Thorax", "RightArm", "Slider", "Hand")
    assert body.joint_units == ("rad",) * 5 + ("m",)
    np.testing.assert_array_equal(body.joint_limits[:2], [[-0.5, 0.9], [-1.0, 1.0]])
    np.testing.assert_allclose(body.mass, 57.25, rtol=4 * EPS)


def test_a_quaternion_is_a_ball_joint(tmp_path, exact_acrobat):
    """In two segments of one body, so that biorbd's scalar parts, which it keeps at the end, are told apart; against
    the same with three hinges."""
    hinged = exact_acrobat.replace("\tcom 0.01 0 -0.02", "\trotations zyx\n\tcom 0.01 0 -0.02", 1)
    hinges = loaded(tmp_path, hinged)
    body = loaded(tmp_path, hinged.replace("rotations	zyx", "rotations q").replace("rotations zyx", "rotations q"))
    assert body.ball_joints == ("RightArm_Quat", "Hand_Quat")
    random = np.random.default_rng(5)
    for angles in random.uniform(-1.0, 1.0, (4, hinges.n_shape)):
        shape = dict(zip(hinges.joint_names, angles, strict=True))
        turned = {
            f"{name}_Quat": Rotation.from_euler("ZYX", [shape.pop(f"{name}_Rot{axis}") for axis in "ZYX"]).as_quat()
            for name in ("RightArm", "Hand")
        }
        found, expected = body.locked_inertia(body.shape(shape | turned)), hinges.locked_inertia(angles)
        np.testing.assert_allclose(found, expected, rtol=0, atol=100 * EPS * np.abs(expected).max())


def test_six_digits_of_a_frame_are_made_a_rotation(tmp_path, exact_acrobat):
    (tmp_path / "a.bioMod").write_text(ACROBAT)
    with pytest.warns(IgnoredElementWarning, match="orthonormal|mesh"):
        rounded = sp.load_body(tmp_path / "a.bioMod")
    exact = loaded(tmp_path, exact_acrobat)
    shape = np.array([0.2, -0.3, 0.5, 0.1, 0.7, 0.05])
    apart = rounded.locked_inertia(shape) - exact.locked_inertia(shape)
    scale = np.abs(exact.locked_inertia(shape)).max()
    assert EPS * scale < np.abs(apart).max() < 10 * SIX_DIGITS * scale


def test_a_part_in_a_mirror_is_where_biorbd_sees_it(tmp_path, exact_acrobat):
    """Models of real acrobats have frames with determinant -1: the same part, said in mirrored numbers."""
    hand = exact_acrobat[exact_acrobat.index("segment Hand") :]
    plain = hand.replace("0.0002 0 0\n", "0.0002 0 0.00002\n")
    plain = plain.replace("\t\t0 0 0.0001", "\t\t0.00002 0 0.0001")
    finger = "segment Finger\n\tparent Hand\n{}\tmass 0.02\n\tcom 0 0 {}0.01\nendsegment\n"
    mirrored = plain.replace("rt 0.3 0 0 xyz 0 0.1 -0.05", f"RTinMatrix 1\n{_matrix(Rotation.from_euler('x', 0.3))}")
    mirrored = mirrored.replace("0.01 0 -0.02", "0.01 0 0.02").replace("0.00002", "-0.00002")
    above = exact_acrobat.replace(hand, "")
    same = loaded(tmp_path, above + plain + finger.format("\trt 0 0 0 xyz 0 0 0.03\n", ""), "plain.bioMod")
    body = loaded(tmp_path, above + mirrored + finger.format("\trt 0 0 0 xyz 0 0 -0.03\n", "-"), "mirrored.bioMod")
    shape, rate = np.array([0.2, -0.3, 0.5, 0.1, 0.7, 0.05]), np.array([0.3, 0.2, -0.4, 0.5, 0.1, 0.2])
    locked, momentum = same.locked_inertia(shape), same.internal_momentum(shape, rate)
    np.testing.assert_allclose(body.locked_inertia(shape), locked, rtol=0, atol=100 * EPS * np.abs(locked).max())
    np.testing.assert_allclose(body.internal_momentum(shape, rate), momentum, rtol=0, atol=100 * EPS * body.mass)
    with pytest.raises(ModelFileError, match="'Hand'"):
        loaded(tmp_path, above + mirrored.replace("\tmass", "\trotations x\n\tmass", 1))


def _matrix(turn):
    """Of the hand's frame in a mirror that swaps its palm and its back."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = turn.as_matrix() @ np.diag([1.0, 1.0, -1.0]), [0.0, 0.1, -0.05]
    return "\tRT\n" + "".join("\t\t" + " ".join(map(repr, row)) + "\n" for row in frame.tolist())


def test_a_base_without_mass_of_its_own(tmp_path):
    """Coordinates spread over segments without mass are the base's: the same body."""
    body, whole = loaded(tmp_path, MASSLESS_ROOT), loaded(tmp_path, ACROBAT)
    assert (body.joint_names, body.link_names) == (whole.joint_names, whole.link_names)
    shape = np.array([0.2, -0.3, 0.5, 0.1, 0.7, 0.05])
    np.testing.assert_array_equal(body.locked_inertia(shape), whole.locked_inertia(shape))


@pytest.mark.usefixtures("kept_locale")
def test_momentum_of_floating_motions_is_biorbd_s(tmp_path, exact_acrobat, rng):
    """The base moves and turns, too, as biorbd's own coordinates of it, about axes that each carry the next."""
    text = exact_acrobat.replace("\tmeshfile pelvis.bvh // not there\n", "")
    body = loaded(tmp_path, text, "a.bioMod")
    model = biorbd.Model(str(tmp_path / "a.bioMod"))
    for q, v in rng.uniform(-1.0, 1.0, (3, 2, model.nbQ())):
        there, moves = biorbd.GeneralizedCoordinates(q), biorbd.GeneralizedVelocity(v)
        turn = Rotation.from_euler("XYZ", q[3:6]).as_matrix()
        first, second = Rotation.from_euler("X", q[3]).as_matrix(), Rotation.from_euler("XY", q[3:5]).as_matrix()
        omega = turn.T @ (v[3] * np.eye(3)[0] + v[4] * first[:, 1] + v[5] * second[:, 2])
        inertia, centre = body.locked_inertia(q[6:]), body.centre_of_mass(q[6:])
        momentum = turn @ (inertia @ omega + body.internal_momentum(q[6:], v[6:]))
        extent = np.abs(inertia).max()
        np.testing.assert_allclose(q[:3] + turn @ centre, model.CoM(there, True).to_array(), rtol=0, atol=1e-14)
        expected = model.angularMomentum(there, moves, True).to_array()
        np.testing.assert_allclose(momentum, expected, rtol=0, atol=1e-12 * extent * np.abs(v).sum())


BESIDE = """
segment Ground
	parent root
	rotations	x
endsegment
"""


@pytest.mark.full
def test_other_roots_are_left_out_or_named(tmp_path):
    """Furniture without mass is left out; of two bodies one is named."""
    (tmp_path / "two.bioMod").write_text(ACROBAT + BESIDE)
    with pytest.warns(IgnoredElementWarning, match="segments"):
        body = sp.load_body(tmp_path / "two.bioMod")
    assert (body.n_shape, len(body.link_names)) == (6, 5)
    (tmp_path / "two.bioMod").write_text(ACROBAT + BESIDE.replace("rotations", "mass 90\n\trotations"))
    with pytest.raises(ModelFileError, match="'Pelvis'"):
        sp.load_body(tmp_path / "two.bioMod")
    with pytest.warns(IgnoredElementWarning, match="segments"):
        assert sp.load_body(tmp_path / "two.bioMod", root_body="Pelvis").n_shape == 6
    with pytest.raises(ModelFileError, match="'Thorax'"):
        sp.load_body(tmp_path / "two.bioMod", root_body="Thorax")
    (tmp_path / "two.bioMod").write_text("version 4\n" + BESIDE)
    with pytest.raises(ModelFileError, match=":3:"):
        sp.load_body(tmp_path / "two.bioMod")


@pytest.mark.full
def test_a_base_without_mass_that_lies_elsewhere(tmp_path):
    """What biorbd gives a segment without mass, 1e-8 kg, is no part of the body where the segment is not."""
    far = MASSLESS_ROOT.replace("rt 0.2 0 0 xyz 0 0 0", "rt 0.2 0 0 xyz 1 2 3")
    assert far != MASSLESS_ROOT
    shape = np.array([0.2, -0.3, 0.5, 0.1, 0.7, 0.05])
    near, away = (loaded(tmp_path, text).locked_inertia(shape) for text in (MASSLESS_ROOT, far))
    np.testing.assert_array_equal(away, near)


@pytest.mark.full
def test_other_words_for_the_same(tmp_path):
    spelt = ACROBAT.replace("com 0 0 0.2", "CenterOfMass 0 0 0.2").replace(
        "inertia\n\t\t0.03 0 0\n\t\t0 0.03 0\n\t\t0 0 0.003", "inertia_xxyyzz 0.03 0.03 0.003"
    )
    assert "inertia_xxyyzz" in spelt
    spelt = spelt.replace("meshfile pelvis.bvh", "meshfile pelvis.bvh\n\tmeshrt 0 0 0 xyz 0 0 0\n\tmeshscale 1 1 1")
    shape = np.array([0.2, -0.3, 0.5, 0.1, 0.7, 0.05])
    found, expected = (loaded(tmp_path, text).locked_inertia(shape) for text in (spelt, ACROBAT))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("parent Thorax", "parent Torso", r":\d+: segment 'RightArm': its parent 'Torso' does not exist"),
        ("mass 30", "mass nan", "no real body has mass nan"),
        ("mass 30", "mass -30", "no real body has mass -30"),
        ("com 0 0 0.2", "cm 0 0 0.2", r":\d+: segment 'Thorax': biorbd ignores the word 'cm'; 'com' is near"),
        ("rotations	xz", "rotations x z", r"biorbd reads 'x' alone; write `rotations xz`"),
        ("segment Hand", "segment Slider", r":\d+: two segments are named 'Slider'"),
        ("parent Slider", "", "one root segment is needed, got 'Pelvis', 'Hand'"),
        (
            "0 0.980067 -0.198669 0.02",
            "0 2.980067 -0.198669 0.02",
            r":\d\d: segment 'Thorax': biorbd does not accept it",
        ),
        ("RT 0.1 -0.2 0.3 xyz", "RT 0.1 -0.2 0.3 abc", "biorbd does not accept it"),
        ("RT 0.1 -0.2 0.3 xyz", "RT 0.1 -0.2 xyz", r":\d+: segment 'RightArm': RT is three angles.*got 6 values"),
        ("com 0 0 0.2", "com 0 0 0.2 7", r":\d+: segment 'Thorax': com has 4 values, not 3"),
        ("com 0 0 0.2", "com 0 0,2 0", r":\d+: segment 'Thorax': com: '0,2' is not a number that biorbd reads$"),
        ("mass 30", "mass 0x10", r":\d+: segment 'Thorax': mass: '0x10' is not a number that biorbd reads$"),
        (
            "mass 30",
            "mass 3.0E+01",
            r":\d+: segment 'Thorax': mass: '3.0E\+01' is not a number that.*; write a small e",
        ),
        ("0 0.35 0\n", "0 0.35 0\n\tmeshfile a.stl\n", r":\d+: segment 'Thorax': inertia has 6 values, not 9"),
        (
            "rangesQ -0.5 0.9",
            "rangesQ 0.9 -0.5",
            r":\d+: joint 'Thorax_RotX': the lower limit 0.9 is not below the upper",
        ),
        ("segment Hand", "segment Hand" + 300 * "d", r":\d+: segment 'Handd.* 304 characters; up to 256 are allowed"),
        ("mass 30", "mass 2^5", r":\d+: segment 'Thorax': mass: '2\^5' is not a number"),
        ("mass 30", "mass 30\n\tmass 40", r":\d+: segment 'Thorax': 'mass' stands twice"),
        ("com 0.01 0 -0.02\nendsegment\n", "com 0.01 0 -0.0", r":\d+: segment 'Hand' has no endsegment"),
        ("endsegment\n\nsegment RightArm", "segment RightArm", r":\d+: segment 'Thorax' has no endsegment"),
        ("rangesQ -0.5 0.9", "rangesQ -0.5 0.9 0.1 0.2", r":\d+: segment 'Thorax': rangesQ has 6 values of 2 coord"),
    ],
)
def test_a_biomod_that_cannot_be_used(tmp_path, old, new, message):
    assert old in ACROBAT
    with pytest.raises(ModelFileError, match=message):
        loaded(tmp_path, ACROBAT.replace(old, new, 1))


def test_points_and_patches_of_a_mesh_may_be_many(tmp_path):
    lines = (
        "mesh 0 0 0",
        "mesh 0 0.1 0",
        "mesh 1E-1 0 0",
        "patch 0 1 2",
        "patch 2 1 0",
        "meshcolor 1 0 0",
        "com 0 0 0.2",
    )
    mesh = "".join(f"\n\t{line}" for line in lines)
    body = loaded(tmp_path, ACROBAT.replace("\n\tcom 0 0 0.2", mesh, 1))
    np.testing.assert_array_equal(
        body.locked_inertia(body.shape()), loaded(tmp_path, ACROBAT).locked_inertia(np.zeros(6))
    )


def test_values_are_what_biorbd_makes_of_them(tmp_path):
    """Sums, products and numbers with a small e; biorbd's own sums are trusted, but for those that it reads wrong."""
    for text, mass in (("3e1", 30.0), ("(2+3)*6", 30.0), ("60/2", 30.0), ("3.0e+1", 30.0), ("+30.", 30.0)):
        body = loaded(tmp_path, ACROBAT.replace("mass 30", f"mass {text}", 1))
        np.testing.assert_allclose(body.mass, 27.25 + mass, rtol=4 * EPS)


# ---- Yeadon's human ------------------------------------------------------------------------------------------------

SEEN = """
import json, sys, numpy as np, yeadon
human = yeadon.Human(sys.argv[1])
turns = json.loads(sys.argv[2])
human.set_CFG_dict({name: turns.get(name, 0.0) for name in human.CFGnames})
inertia, centre = np.zeros((3, 3)), human.center_of_mass.ravel()
for part in human.segments:
    away = part.center_of_mass.ravel() - centre
    inertia += part.rot_mat @ part.rel_inertia @ part.rot_mat.T
    inertia += part.mass * (away @ away * np.eye(3) - np.outer(away, away))
print(json.dumps([human.mass, centre.tolist(), inertia.tolist()]))
"""


def seen(path, turns):
    command = [sys.executable, "-c", SEEN, str(path), json.dumps(turns)]
    # What stands before it is the package's own.
    printed = subprocess.run(command, capture_output=True, check=True).stdout.splitlines()[-1]
    mass, centre, inertia = json.loads(printed)
    return mass, np.array(centre), np.array(inertia)


def test_a_person_is_what_yeadon_measures(tmp_path, rng):
    """Mass and centre are the package's, the inertia the sum of its segments' turned tensors."""
    body = loaded(tmp_path, measured())
    low, high = np.array(body.joint_limits).T
    shape = low + (high - low) * rng.uniform(size=body.n_shape)
    mass, centre, inertia = seen(tmp_path / "file.txt", dict(zip(body.joint_names, shape.tolist(), strict=True)))
    np.testing.assert_allclose(body.mass, mass, rtol=20 * EPS)
    np.testing.assert_allclose(body.centre_of_mass(shape), centre, rtol=0, atol=1e-14)
    np.testing.assert_allclose(body.locked_inertia(shape), inertia, rtol=0, atol=1e-14 * np.abs(inertia).max())
    assert (body.n_shape, len(body.link_names)) == (18, 11)


MOVING = """
import json, sys, numpy as np, yeadon
human = yeadon.Human(sys.argv[1])
turns, rates = json.loads(sys.argv[2])
nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
def at(time):
    human.set_CFG_dict({name: turns[name] + time * rates[name] for name in human.CFGnames})
    return [np.column_stack([part.center_of_mass, part.rot_mat]) for part in human.segments]
series = np.polynomial.chebyshev.chebfit(nodes, np.array([at(time) for time in nodes]).reshape(24, -1), 23)
(here, slope) = (np.polynomial.chebyshev.chebval(0.0, one) for one in (series, np.polynomial.chebyshev.chebder(series)))
here, slope = np.array(at(0.0)), slope.reshape(-1, 3, 4)
masses = np.array([part.mass for part in human.segments])
centre, speed = masses @ here[:, :, 0] / masses.sum(), masses @ slope[:, :, 0] / masses.sum()
total = np.zeros(3)
for part, pose, rate in zip(human.segments, here, slope):
    turn, spin = pose[:, 1:], rate[:, 1:] @ pose[:, 1:].T
    omega = np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2
    total += part.mass * np.cross(pose[:, 0] - centre, rate[:, 0] - speed) + turn @ part.rel_inertia @ turn.T @ omega
pelvis = human.segments[0]
spin = here[0, :, 1:].T @ slope[0, :, 1:]
omega = [(spin[2, 1] - spin[1, 2]) / 2, (spin[0, 2] - spin[2, 0]) / 2, (spin[1, 0] - spin[0, 1]) / 2]
print(json.dumps([total.tolist(), here[0, :, 1:].tolist(), omega]))
"""


def test_momentum_of_floating_motions_is_yeadon_s(tmp_path, rng):
    """Somersault, tilt and twist go on, too; speeds are those of the package's poses, by a series of degree 23."""
    body = loaded(tmp_path, measured())
    low, high = 0.3 * np.array(body.joint_limits).T
    shape, rate = low + (high - low) * rng.uniform(size=18), rng.uniform(-0.5, 0.5, 18)
    free = ("somersault", "tilt", "twist")
    asked = [dict(zip((*body.joint_names, *free), (*row, *rng.uniform(-0.5, 0.5, 3)), strict=True))
             for row in (shape, rate)]  # fmt: skip
    command = [sys.executable, "-c", MOVING, str(tmp_path / "file.txt"), json.dumps(asked)]
    total, turn, omega = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    inertia = body.locked_inertia(shape)
    momentum = np.array(turn) @ (inertia @ omega + body.internal_momentum(shape, rate))
    np.testing.assert_allclose(momentum, total, rtol=0, atol=1e-12 * np.abs(inertia).max() * np.abs(rate).sum())


def test_the_next_person_is_not_lighter(tmp_path):
    """The package keeps scaled densities for the whole process; each file is read in one of its own."""
    masses = [loaded(tmp_path, measured(total)).mass for total in (70.0, 50.0, None)]
    alone = seen(tmp_path / "file.txt", {})[0]
    np.testing.assert_allclose(masses, [70.0, 50.0, alone], rtol=1e-13)


@pytest.mark.parametrize("width", [0.3, 0.247])
def test_a_perimeter_that_is_too_long_makes_the_circle_that_yeadon_makes(width, tmp_path):
    """The package's own sample female1 has a perimeter of 3.85 times the width."""
    path = tmp_path / "person.txt"
    path.write_text(measured(None, Ls3w=width))
    with pytest.warns(IgnoredElementWarning, match=rf"taken for circles .*'Ls3: nipple' \({0.95 / width:.3g}\)"):
        body = sp.load_body(path)
    mass, _, inertia = seen(path, {})
    np.testing.assert_allclose(body.mass, mass, rtol=20 * EPS)
    np.testing.assert_allclose(body.locked_inertia(body.shape()), inertia, atol=1e-14 * np.abs(inertia).max())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (measured(Ls3w=-0.3), r":\d+: Ls3w: a number above zero is needed, got -0.3"),
        (measured(Ls3w=".nan"), r":\d+: Ls3w: a number above zero is needed, got .nan"),
        (measured(Ls3w="wide"), r":\d+: Ls3w: a number above zero is needed, got 'wide'"),
        (measured(Ls3w=None), "the file lacks Ls3w"),
        (measured(Ls9w=0.3), "has Ls9w, which are not measurements"),
        (measured(Ls3w="1:30"), r":\d+: Ls3w: a number above zero is needed, got 1:30"),
        (measured(Ls3w="012"), r":\d+: Ls3w: for YAML 012 is not this number; write 12.0$"),
        (measured() + "Ls3w: 0.4\n", r":98: Ls3w stands twice"),
        (measured(totalmass=0), r":\d+: totalmass: a number above zero is needed, got 0"),
        (measured(Ls0w=3.0), "level 'Ls0: hip joint centre': its perimeter is 0.3167 times its width"),
        (measured() + "a: [", r":\d+: it is not a YAML file of measurements"),
    ],
)
def test_measurements_that_cannot_be_used(tmp_path, text, message):
    with pytest.raises(ModelFileError, match=message):
        loaded(tmp_path, text)


# ---- Both ----------------------------------------------------------------------------------------------------------


def test_formats_are_told_by_content(tmp_path):
    assert format_of(ACROBAT.encode()) == "biomod"
    assert format_of(b"\xef\xbb\xbf// acrobat\n Version 3\n") == "biomod"
    assert format_of(measured().encode()) == "yeadon"
    assert format_of(b"<robot name='version 4'/>") is None
    assert loaded(tmp_path, ACROBAT, "person.urdf").n_shape == 6
