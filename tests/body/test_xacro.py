"""xacro files: the body of the URDF that they stand for, parts from packages, meshes of these; what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ModelFileError, ShapeError, WrongObjectError
from support.hostile_files import GOOD_MJCF

pytest.importorskip("xacrodoc")
pytestmark = pytest.mark.usefixtures("warm_engines")
INERTIA = '<inertia ixx="0.3" iyy="0.2" izz="0.4" ixy="0" ixz="0.01" iyz="0"/>'
ROBOT = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
LINK = f'<link name="{{}}"><inertial><mass value="{{}}"/>{INERTIA}</inertial>{{}}</link>'
HINGE = (
    '<joint name="hip" type="revolute"><parent link="trunk"/><child link="leg"/><origin xyz="0.1 {} 0"/>'
    '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)
MESH = '<visual><geometry><mesh filename="package://legs/wedge.obj"/></geometry></visual>'
WEDGE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def walker(tmp_path):
    """A file that takes its leg from a package elsewhere, and the folder of packages."""
    package = tmp_path / "packages" / "legs"
    package.mkdir(parents=True)
    (package / "wedge.obj").write_text(WEDGE)
    macro = f'<xacro:macro name="leg" params="mass far:=0.5">{LINK.format("leg", "${mass}", MESH)}{HINGE}</xacro:macro>'
    (package / "leg.xacro").write_text(ROBOT.format(macro.replace("0.1 {} 0", "0.1 ${far / 2} 0")))
    path = tmp_path / "robots" / "walker.urdf.xacro"
    path.parent.mkdir()
    body = '<xacro:include filename="$(find legs)/leg.xacro"/>' + LINK.format("trunk", "5", "")
    path.write_text(ROBOT.format(body + '<xacro:leg mass="${2 + 1}"/>'))
    return path, package.parent


def test_a_file_is_the_urdf_that_it_stands_for(walker, tmp_path):
    path, packages = walker
    plain = LINK.format("trunk", "5", "") + LINK.format("leg", "3", "") + HINGE.format("0.25")
    (tmp_path / "plain.urdf").write_text(f'<robot name="a">{plain}</robot>')
    body, written = sp.load_body(path, packages=[packages]), sp.load_body(tmp_path / "plain.urdf")
    assert (body.joint_names, body.link_names, body.mass) == (("hip",), ("trunk", "leg"), 8.0)
    for angle in (-0.7, 0.0, 0.4):
        np.testing.assert_array_equal(body.locked_inertia([angle]), written.locked_inertia([angle]))
        np.testing.assert_array_equal(body.internal_momentum([angle], [1.0]), written.internal_momentum([angle], [1.0]))
    assert body.file == path
    mesh = next(shape for shape in sp.body.visuals(body) if shape.link == "leg")
    assert mesh.mesh == packages / "legs" / "wedge.obj"


@pytest.mark.parametrize("address", ["http://wiki.ros.org/xacro", "https://www.ros.org/wiki/xacro", "xacro", "urn:any"])
def test_macros_are_told_by_their_prefix_whatever_its_address(address, tmp_path):
    wing = '<xacro:macro name="wing" params="side sign">{}{}</xacro:macro>'.format(
        LINK.format("${side}", "2", ""), HINGE.format("${sign * 0.5}").replace('"hip"', '"${side}_hinge"')
    ).replace('"leg"', '"${side}"')
    used = '<xacro:wing side="left" sign="1"/><xacro:wing side="right" sign="-1"/>'
    text = ROBOT.replace("http://www.ros.org/wiki/xacro", address).format(LINK.format("trunk", "10", "") + wing + used)
    (tmp_path / "a.urdf").write_text(text)
    body = sp.load_body(tmp_path / "a.urdf")
    # By hand: three links, and places mirrored in the plane of symmetry.
    assert (body.mass, body.joint_names) == (14.0, ("left_hinge", "right_hinge"))
    centres = [body.link_pose(body.shape(), side)[:3, 3] for side in ("left", "right")]
    np.testing.assert_array_equal(centres, [[0.1, 0.5, 0.0], [0.1, -0.5, 0.0]])


@pytest.mark.parametrize("address", ["http://www.ros.org/wiki/xacro", "http://wiki.ros.org/xacro"])
def test_macros_by_another_prefix_which_xacro_leaves_are_no_urdf(address, tmp_path):
    text = f'<robot name="a" xmlns:x="{address}">{LINK.format("trunk", "5", "")}<x:leg/></robot>'
    (tmp_path / "a.urdf").write_text(text)
    with pytest.raises(ModelFileError, match="expression"):
        sp.load_body(tmp_path / "a.urdf")


def test_a_package_that_is_not_found_is_named(walker):
    with pytest.raises(ModelFileError, match=r"walker\.urdf\.xacro"):
        sp.load_body(walker[0])
    with pytest.raises(ModelFileError, match="packages"):
        sp.load_body(walker[0], packages=["nowhere"])


def test_a_fault_in_what_it_stands_for_has_its_line_there(tmp_path):
    (tmp_path / "a.xacro").write_text(ROBOT.format(LINK.format("trunk", "${-1}", "")))
    with pytest.raises(ModelFileError, match="'trunk'"):
        sp.load_body(tmp_path / "a.xacro")


def test_packages_are_for_urdf_and_xacro(tmp_path):
    (tmp_path / "a.xml").write_text(GOOD_MJCF)
    with pytest.raises(ShapeError, match="packages"):
        sp.load_body(tmp_path / "a.xml", packages=[tmp_path])
    for wrong in ("here", 3, [3], None):
        with pytest.raises(WrongObjectError, match="packages"):
            sp.load_body("cat", packages=wrong)
    assert sp.load_body("cat", packages=[tmp_path]).packages == (str(tmp_path),)
