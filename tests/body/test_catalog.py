"""From a name, a path or a text to a body, or to an error that says what is wrong with the file."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from shapephase.body import catalog
from shapephase.errors import (
    IgnoredElementWarning,
    InputFileNotFoundError,
    MissingExtraError,
    ModelFileError,
    ShapePhaseError,
    UnknownNameError,
    UnphysicalInertiaError,
    UnphysicalInertiaWarning,
)
from support.bodies import BODIES, joint, link, urdf

CASES = Path(__file__).parents[1] / "cases"
BASE = link("base", 3.0, [0.3, 0.5, 0.6])
ARM = link("arm", 1.0, [0.02, 0.03, 0.04], (0.2, 0.1, 0.0))
GOOD = urdf(BASE, ARM, joint("hip", "revolute", "base", "arm", (0, 1, 0)))


# ---- Names ----------------------------------------------------------------------------------------------------------


def test_the_robots_that_come_with_the_library():
    """U6: at least a cat and an astronaut, sorted."""
    names = sp.robot_names()
    assert {"cat", "astronaut", "cat_two_halves", "diver", "satellite"} <= set(names)
    assert list(names) == sorted(names)


@pytest.mark.parametrize("name", BODIES)
def test_every_named_body_loads_without_a_warning(name):
    """U6: cat, astronaut, the human of example-robot-data and the rest; warnings are errors here."""
    body = sp.load_body(name)
    assert body.name == name.removeprefix("example:")
    assert body.n_shape >= 2
    assert np.linalg.eigvalsh(body.locked_inertia(body.shape()))[0] > 0.0


@pytest.mark.parametrize("name", sp.robot_names())
def test_our_own_files_are_sound(name):
    """Names are unique, the neutral shape lies inside the limits, and the file says its own name."""
    path = catalog.robots_folder() / f"{name}.urdf"
    root = ElementTree.parse(path).getroot()
    assert root.get("name") == name
    for kind in ("link", "joint"):
        names = [element.get("name") for element in root.findall(kind)]
        assert len(set(names)) == len(names)
    limits = sp.load_body(name).joint_limits
    assert np.all(limits[:, 0] <= 0.0)
    assert np.all(limits[:, 1] >= 0.0)
    assert np.all(limits[:, 0] < limits[:, 1])


def test_the_human_is_the_one_of_example_robot_data():
    """U6: 36 joints and the mass summed from its file."""
    human = sp.load_body("example:human")
    path = catalog.example_file("human")
    masses = [float(element.get("value")) for element in ElementTree.parse(path).getroot().iter("mass")]
    assert human.n_shape == 36
    assert human.mass == pytest.approx(sum(masses), rel=1e-14)
    assert "human" in catalog.example_names()
    np.testing.assert_array_equal(sp.load_body(path).locked_inertia(np.zeros(36)), human.locked_inertia(np.zeros(36)))


def test_a_name_and_its_path_are_the_same_body():
    path = catalog.robots_folder() / "cat.urdf"
    shape = 0.1 * np.arange(23.0)
    want = sp.load_body("cat").locked_inertia(shape)
    for source in (path, str(path), os.path.relpath(path)):
        body = sp.load_body(source)
        assert body.name == "cat"
        np.testing.assert_array_equal(body.locked_inertia(shape), want)


def test_a_file_of_the_users_own_wins_over_our_name(tmp_path, monkeypatch):
    (tmp_path / "cat").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    assert sp.load_body("cat").joint_names == ("hip",)


def test_unknown_names_are_answered_with_the_nearest_and_all():
    with pytest.raises(UnknownNameError, match="'catt'") as caught:
        sp.load_body("catt")
    assert all(name in str(caught.value) for name in sp.robot_names())
    with pytest.raises(UnknownNameError, match="'human'"):
        sp.load_body("example:humn")


def test_without_example_robot_data_the_error_names_the_extra(monkeypatch):
    monkeypatch.setattr(sys, "path", [])
    assert catalog.example_names() == ()
    with pytest.raises(MissingExtraError, match=r"shapephase\[bodies\]"):
        sp.load_body("example:human")


def test_robots_are_found_from_any_folder(tmp_path):
    """By another interpreter, started elsewhere."""
    code = "import shapephase as sp; print(sp.load_body('cat').n_shape, *sp.robot_names())"
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["23", *sp.robot_names()]


def test_robots_inside_the_package_win_as_in_a_wheel(tmp_path, monkeypatch):
    inside = tmp_path / "shapephase" / "robots"
    inside.mkdir(parents=True)
    (inside / "newt.urdf").write_text(GOOD)
    monkeypatch.setattr(catalog, "__file__", str(tmp_path / "shapephase" / "body" / "catalog.py"))
    assert sp.robot_names() == ("newt",)
    assert sp.load_body("newt").joint_names == ("hip",)


@pytest.mark.parametrize("source", [3, None, b"cat", 1.5, ["cat"]])
def test_what_is_no_source_is_refused(source):
    with pytest.raises(ModelFileError, match=r"pinocchio\.Model"):
        sp.load_body(source)


# ---- Files ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["nowhere.urdf", "no/such/folder/body.urdf", "a\0b.urdf", ""])
def test_a_file_that_is_not_there(name):
    with pytest.raises(InputFileNotFoundError) as caught:
        sp.load_body(name)
    assert isinstance(caught.value, FileNotFoundError)
    assert isinstance(caught.value, ShapePhaseError)
    assert Path(name).name.replace("\0", "\\x00") in str(caught.value)


@pytest.mark.parametrize("name", ["/dev/null", "/dev/zero"])
def test_a_device_is_no_file(name):
    with pytest.raises(InputFileNotFoundError, match="regular"):
        sp.load_body(name)


@pytest.mark.parametrize(
    ("name", "error"), [("x" * 5000, UnknownNameError), ("x" * 5000 + ".urdf", InputFileNotFoundError)]
)
def test_a_name_longer_than_any_file_has(name, error):
    with pytest.raises(error):
        sp.load_body(name)


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(InputFileNotFoundError, match="folder"):
        sp.load_body(tmp_path)


GIBBERISH = {
    "empty": (b"", "an empty file"),
    "cut short": (GOOD[:150].encode(), r"XML.*line 1, column"),
    "two roots": ((GOOD + GOOD).encode(), "XML.*junk"),
    "latin-1": ('<robot name="é"/>'.encode("latin-1"), "UTF-8.*byte 13"),
    "mjcf": (b"<mujoco/>", "<worldbody>: there is no <body>"),
    "doctype": (b'<!DOCTYPE robot [<!ENTITY m "1">]>' + GOOD.encode(), "DOCTYPE"),
    "no links": (b'<robot name="a"/>', "link|URDF"),
    "two trees": (urdf(BASE, ARM).encode(), "base|arm|root|URDF"),
}


@pytest.mark.parametrize("kind", GIBBERISH)
def test_a_file_that_is_no_urdf(kind, tmp_path):
    content, said = GIBBERISH[kind]
    path = tmp_path / "faulty.urdf"
    path.write_bytes(content)
    with pytest.raises(ModelFileError, match=rf"faulty\.urdf.*({said})"):
        sp.load_body(path)


def test_a_byte_order_mark_does_no_harm(tmp_path):
    path = tmp_path / "marked.urdf"
    path.write_bytes(GOOD.encode("utf-8-sig"))
    assert sp.load_body(path).joint_names == ("hip",)


def test_a_finished_xacro_with_its_namespace_left_is_a_urdf(load_urdf):
    text = GOOD.replace('name="small"', 'name="small" xmlns:xacro="http://www.ros.org/wiki/xacro"')
    assert load_urdf(text).mass == 4.0


# ---- Numbers: a wrong one never becomes a silent zero ---------------------------------------------------------------


NO_NUMBERS = ["nan", "inf", "1e400", "", "heavy", "1,5", "1.5kg", "0x1p3", "1_0", "１.5"]


@pytest.mark.parametrize("value", NO_NUMBERS)
def test_a_mass_must_be_a_finite_number(value, load_urdf):
    """U1: Pinocchio would drop the link's inertia, mass and all, and only print a line."""
    with pytest.raises(ModelFileError, match="'arm'"):
        load_urdf(GOOD.replace('mass value="1.0"', f'mass value="{value}"'))


@pytest.mark.parametrize("value", [" 1.0 ", "1.0\t", "+1", "1e0", "1.", "001"])
def test_a_mass_in_unusual_writing_is_read_or_refused_but_never_lost(value, load_urdf):
    """U1: Python reads " 1.0 " as a number, Pinocchio does not."""
    text = GOOD.replace('mass value="1.0"', f'mass value="{value}"')
    try:
        mass = load_urdf(text).mass
    except ModelFileError:
        return
    assert mass == pytest.approx(4.0, abs=1e-15)


@pytest.mark.parametrize("value", ["nan", "", "0.04m", " 0.04", "0.04 "])
def test_an_inertia_entry_is_read_or_refused_but_never_lost(value, load_urdf):
    want = load_urdf(GOOD).locked_inertia([0.0])
    try:
        found = load_urdf(GOOD.replace('izz="0.04"', f'izz="{value}"')).locked_inertia([0.0])
    except ModelFileError:
        return
    np.testing.assert_array_equal(found, want)


@pytest.mark.parametrize("xyz", ["nan 0 0", "0.2 0.1", "0.2 0.1 0 0", "a b c", "0.2,0.1,0"])
@pytest.mark.parametrize("whose", ['<origin xyz="0.2 0.1 0.0"/>', '<origin xyz="0.0 0.0 0.0" rpy="0.0 0.0 0.0"/>'])
def test_an_origin_must_be_three_numbers(xyz, whose, load_urdf):
    """U1: an unreadable origin of the inertia makes Pinocchio drop the link's mass."""
    start = len(f'<robot name="small">{BASE}')
    faulty = GOOD[:start] + GOOD[start:].replace(whose, f'<origin xyz="{xyz}"/>')
    assert faulty != GOOD
    with pytest.raises(ModelFileError):
        load_urdf(faulty)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('mass value="1.0"', 'mass value="-1.0"', "negative mass -1"),
        ('<mass value="1.0"/>', "", "no <mass>"),
        ('mass value="1.0"', "mass", "<mass> has no value"),
        (' iyz="0.0" izz="0.04"', ' izz="0.04"', "iyz"),
        ('<inertia ixx="0.02" ixy="0.0" ixz="0.0" iyy="0.03" iyz="0.0" izz="0.04"/>', "", "no <inertia>"),
        ("</inertial></link><joint", "</inertial><inertial/></link><joint", "2 <inertial>"),
    ],
)
def test_a_faulty_inertial_is_refused_by_link(old, new, said, load_urdf):
    assert old in GOOD
    with pytest.raises(ModelFileError, match=rf"'arm'.*{said}"):
        load_urdf(GOOD.replace(old, new))


@pytest.mark.parametrize("axis", ["0 0 0", "nan 0 0", "0 1", "up"])
def test_an_axis_must_point_somewhere(axis, load_urdf):
    with pytest.raises(ModelFileError, match=r"hip|body\.urdf"):
        load_urdf(GOOD.replace('<axis xyz="0.0 1.0 0.0"/>', f'<axis xyz="{axis}"/>'))


def test_an_axis_need_not_be_of_unit_length(load_urdf):
    long = load_urdf(GOOD.replace('<axis xyz="0.0 1.0 0.0"/>', '<axis xyz="0 7 0"/>'))
    np.testing.assert_allclose(long.momentum_matrix([0.3]), load_urdf(GOOD).momentum_matrix([0.3]), atol=1e-15, rtol=0)


def test_limits_must_be_in_order(load_urdf):
    with pytest.raises(ModelFileError, match="hip"):
        load_urdf(GOOD.replace('lower="-10" upper="10"', 'lower="1" upper="-1"'))


# ---- Trees ----------------------------------------------------------------------------------------------------------


def test_links_in_a_circle_apart_from_the_root_are_not_lost(load_urdf):
    """U1: Pinocchio loads the rest and forgets their mass."""
    ring = link("x", 1, [1, 1, 1]) + link("y", 1, [1, 1, 1])
    ring += joint("k1", "fixed", "x", "y") + joint("k2", "fixed", "y", "x")
    with pytest.raises(ModelFileError, match=r"\b[xy]\b"):
        load_urdf(GOOD.replace("</robot>", ring + "</robot>"))


@pytest.mark.parametrize(
    "extra",
    [
        joint("k", "fixed", "arm", "base"),
        joint("k", "fixed", "arm", "arm"),
        joint("k", "fixed", "base", "ghost"),
        joint("hip", "fixed", "base", "arm"),
        BASE,
    ],
    ids=["circle", "itself", "missing link", "two parents", "link twice"],
)
def test_what_is_no_tree_is_refused(extra, load_urdf):
    with pytest.raises(ModelFileError):
        load_urdf(GOOD.replace("</robot>", extra + "</robot>"))


def test_a_chain_too_deep_for_the_parser_is_refused(tmp_path):
    """Pinocchio recurses over links and would end the interpreter; so another one tries."""
    links = [link(f"l{i}", 1.0, [0.1, 0.1, 0.1]) for i in range(4_001)]
    joints = [joint(f"j{i}", "fixed", f"l{i}", f"l{i + 1}") for i in range(4_000)]
    path = tmp_path / "deep.urdf"
    path.write_text(urdf(*links, *joints))
    code = f"import shapephase as sp\ntry: sp.load_body({str(path)!r})\nexcept sp.errors.ModelFileError as e: print(e)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0
    assert "deep.urdf" in run.stdout


def test_more_joints_than_any_body_has_are_refused(load_urdf):
    """Pinocchio's work space grows with the cube of their number: 32 GB for a thousand."""
    links = [link(f"l{i}", 1.0, [0.1, 0.1, 0.1]) for i in range(1001)]
    joints = [joint(f"j{i}", "revolute", "l0", f"l{i + 1}") for i in range(1000)]
    with pytest.raises(ModelFileError, match=r"100[01]"):
        load_urdf(urdf(*links, *joints))


# ---- Mimic joints ---------------------------------------------------------------------------------------------------


def chain(*rules):
    """Joints j0, j1, ... one after the other, each with its mimic rule or none."""
    links = [link(f"l{i}", 1.0, [0.1, 0.1, 0.1]) for i in range(len(rules) + 1)]
    joints = [joint(f"j{i}", "revolute", f"l{i}", f"l{i + 1}", extra=rule) for i, rule in enumerate(rules)]
    return urdf(*links, *joints)


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        (('<mimic joint="j1"/>', '<mimic joint="j0"/>'), "j[01].*circle"),
        (('<mimic joint="j0"/>', ""), "j0.*circle"),
        (('<mimic joint="j1"/>', '<mimic joint="j2"/>', '<mimic joint="j0"/>'), "j[012].*circle"),
        (('<mimic joint="j1"/>', '<mimic joint="j2"/>', '<mimic joint="j1"/>'), "j[012].*circle"),
        (('<mimic joint="nobody"/>', ""), "j0.*'nobody'"),
        (("<mimic/>", ""), "<mimic>: has no joint"),
        (('<mimic joint="j1" multiplier="two"/>', ""), "j0.*multiplier"),
        (('<mimic joint="j1" offset="nan"/>', ""), "j0.*offset"),
    ],
)
def test_faulty_mimic_joints_are_refused_by_name(rules, said, load_urdf):
    with pytest.raises(ModelFileError, match=said):
        load_urdf(chain(*rules))


def test_a_fixed_joint_that_mimics_does_not_move(load_urdf):
    text = chain("", "").replace(
        '<joint name="j1" type="revolute">', '<joint name="j1" type="fixed"><mimic joint="j0"/>'
    )
    with pytest.warns(IgnoredElementWarning, match="'j1'"):
        assert load_urdf(text).joint_names == ("j0",)


def test_a_joint_follows_one_of_its_own_kind(load_urdf):
    text = chain("", '<mimic joint="j0"/>').replace('name="j0" type="revolute"', 'name="j0" type="prismatic"')
    with pytest.raises(ModelFileError, match="'j1'"):
        load_urdf(text)


# ---- Lines, and warnings --------------------------------------------------------------------------------------------


def test_a_message_begins_with_file_and_line_and_names_the_element(tmp_path):
    path = tmp_path / "cat.urdf"
    lines = (catalog.robots_folder() / "cat.urdf").read_text().splitlines()
    number = next(i for i, line in enumerate(lines) if "<mass" in line and i > 60)
    lines[number] = '<mass value="1,5"/>'
    path.write_text("\n".join(lines))
    with pytest.raises(ModelFileError) as caught:
        sp.load_body(path)
    assert re.match(
        rf"{re.escape(str(path))}:{number + 1}: link '\w+': <mass> value='1,5': a finite number", str(caught.value)
    )


@pytest.mark.parametrize("moments", [(95.0, 95.0, 95.0), (0.0041, 0.0041, 1e-5)])
def test_inertia_without_mass_is_an_error_above_a_hundredth_of_the_bodys(moments, load_urdf):
    """About its own axes: the camera is turned by 90 degrees about y, the trunk has 0.5, 0.4 and 0.2 kg m^2."""
    text = (CASES / "dummy_with_inertia.urdf").read_text()
    for axis, moment in zip("xyz", moments, strict=True):
        text = text.replace(f'i{axis}{axis}="95"', f'i{axis}{axis}="{moment}"')
    with pytest.raises(UnphysicalInertiaError, match="'camera'") as refused:
        load_urdf(text)
    assert ".urdf:8: " in str(refused.value)
    with pytest.warns(UnphysicalInertiaWarning, match="'camera'"):
        body = load_urdf(text, on_unphysical="warn")
    whole = np.diag([0.5, 0.4, 0.2]) + np.diag(moments[::-1])
    np.testing.assert_allclose(body.locked_inertia(body.shape()), whole, atol=1e-12)


def test_a_little_inertia_without_mass_is_a_warning(load_urdf):
    """0.0039 of 0.5 kg m^2 about x, and 0.002 of 0.2 about z."""
    text = (CASES / "dummy_with_inertia.urdf").read_text().replace('izz="95"', 'izz="0.0039"').replace("95", "0.002")
    with pytest.warns(UnphysicalInertiaWarning, match="'camera'"):
        load_urdf(text)


def test_inertia_without_mass_is_found_in_a_pinocchio_model():
    model = pin.Model()
    number = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(number, pin.Inertia(5.0, np.zeros(3), np.diag([0.5, 0.4, 0.2])), pin.SE3.Identity())
    number = model.addJoint(number, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    model.inertias[number] = pin.Inertia(0.0, np.zeros(3), np.diag([0.03, 0.03, 0.03]))
    with pytest.raises(UnphysicalInertiaError, match="'hinge'"):
        sp.load_body(model)


def test_one_warning_for_each_kind_names_all_its_links(load_urdf):
    broken = [link(f"l{i}", 1.0, [0.01, 0.01, 0.05]) for i in range(3)]
    joints = [joint(f"j{i}", "revolute", "base", f"l{i}") for i in range(3)]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_urdf(urdf(BASE, *broken, *joints))
    (warning,) = caught
    assert re.findall("'(l.)'", str(warning.message)) == ["l0", "l1", "l2"]
    assert warning.filename == str(Path(__file__).parents[1] / "conftest.py"), "it points to who loads"


def test_the_rounding_of_an_inertia_is_no_fault(load_urdf):
    """As in example:icub: a point mass whose inertia has been moved about, 1e-20 of the body's."""
    for izz in ("0", "5e-20", "-5e-20"):
        moments = f'ixx="5e-21" ixy="0" ixz="0" iyy="3e-20" iyz="0" izz="{izz}"'
        text = re.sub('ixx="0.02".*?izz="0.04"', moments, GOOD)
        assert text != GOOD
        load_urdf(text)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_doubts_do_not_depend_on_the_unit_of_mass(scale, load_urdf):
    """But for those about units."""
    good, bad = ([0.02, 0.03, 0.04], [0.02, 0.03, 0.06])
    for moments, doubted in ((good, False), (bad, True)):
        base, arm = (
            link("base", 3.0 * scale, np.multiply(scale, [0.3, 0.5, 0.6])),
            link("arm", scale, np.multiply(scale, moments)),
        )
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            load_urdf(urdf(base, arm, joint("hip", "revolute", "base", "arm")))
        assert any("triangle" in str(warning.message) for warning in caught) == doubted
