"""Model files with the quirks that people's files have: what is right for each, by hand, SciPy, MuJoCo or yeadon."""

from __future__ import annotations

import gzip
import io
import json
import re
import struct
import warnings
import zipfile

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.body import implausible
from shapephase.cli.main import main
from shapephase.errors import (
    IgnoredElementWarning,
    ModelFileError,
    ShapeError,
    UnphysicalInertiaError,
    WrongObjectError,
)
from support.bodies import joint, link, urdf

pytestmark = pytest.mark.usefixtures("warm_engines")
TRUNK, LEG = link("trunk", 3.0, [0.1, 0.2, 0.3]), link("leg", 1.0, [0.02, 0.03, 0.01], (0.0, 0.1, -0.2))
HIP = joint("hip", "continuous", "trunk", "leg", (1, 0, 0), (0.1, 0.0, -0.3))
PLAIN = urdf(TRUNK, LEG, HIP)
FRAME = '<parent link="trunk"/><child link="leg"/><origin xyz="0.1 0 -0.3"/>'


def inertia_by_hand(turn):
    """Locked inertia of trunk and leg, with the leg turned in the hip."""
    centre = np.array([0.1, 0.0, -0.3]) + turn @ [0.0, 0.1, -0.2]
    reduced = 3.0 * 1.0 / 4.0
    apart = reduced * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.diag([0.1, 0.2, 0.3]) + turn @ np.diag([0.02, 0.03, 0.01]) @ turn.T + apart


def written(tmp_path, content, name="robot.urdf"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# ---- What is read ---------------------------------------------------------------------------------------------------

HEADED = '<?xml version="1.0"?>\n' + PLAIN
READ = {
    "blank lines first": "\n \r\n\t" + HEADED,
    "a byte order mark": "\ufeff" + HEADED,
    "a mark and a blank line": "\ufeff\n" + HEADED,
    "UTF-16": HEADED.encode("utf-16"),
    "Latin-1": HEADED.replace("?>", ' encoding="ISO-8859-1"?><!-- für -->').encode("latin-1"),
    "UTF-8 that states Latin-1": HEADED.replace("?>", ' encoding="ISO-8859-1"?><!-- für -->'),
    "a zero byte at the end": HEADED + "\0",
    "zero bytes and lines at the end": HEADED + "\n\0\0\0\n\0",
    "a default namespace": PLAIN.replace("<robot", '<robot xmlns="http://www.ros.org"'),
    "a namespace of xacro at another address": PLAIN.replace("<robot", '<robot xmlns:xacro="urn:any"'),
    "a prefix that is bound to nothing": PLAIN.replace("</robot>", '<gazebo><ignition:a x="1"/></gazebo></robot>'),
    "a sensor and a material": PLAIN.replace("</robot>", '<sensor name="s"/><material name="m"/></robot>'),
    "a world that is nowhere written": PLAIN.replace(
        "</robot>", '<joint name="base" type="floating"><parent link="world"/><child link="trunk"/></joint></robot>'
    ),
    "Drake's spelling of a hinge": PLAIN.replace("<joint", "<drake:joint").replace("</joint", "</drake:joint"),
}


@pytest.mark.parametrize("kind", READ)
def test_an_odd_file_is_read(kind, tmp_path):
    body = sp.load_body(written(tmp_path, READ[kind]))
    assert (body.mass, body.joint_names, body.link_names) == (4.0, ("hip",), ("trunk", "leg"))
    turn = Rotation.from_euler("x", 0.7).as_matrix()
    np.testing.assert_allclose(body.locked_inertia([0.7]), inertia_by_hand(turn), rtol=0, atol=1e-15)


def test_a_line_is_that_of_the_file_behind_blank_lines(tmp_path):
    path = written(tmp_path, "\n\n" + HEADED.replace('value="1.0"', 'value="-1.0"'))
    with pytest.raises(ModelFileError, match="'leg'"):
        sp.load_body(path)


def test_a_ball_joint_of_drake(tmp_path):
    path = written(tmp_path, urdf(TRUNK, LEG, f'<drake:joint name="hip" type="ball">{FRAME}</drake:joint>'))
    body = sp.load_body(path)
    assert body.joint_names == ("hip.x", "hip.y", "hip.z", "hip.w")
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1])
    np.testing.assert_allclose(body.locked_inertia(turn.as_quat()), inertia_by_hand(turn.as_matrix()), atol=1e-15)


def test_a_universal_joint_of_drake_turns_about_x_and_then_the_turned_y(tmp_path):
    path = written(tmp_path, urdf(TRUNK, LEG, f'<drake:joint name="hip" type="universal">{FRAME}</drake:joint>'))
    body = sp.load_body(path)
    assert (body.joint_names, body.link_names) == (("hip_qx", "hip_qy"), ("trunk", "leg"))
    turn = Rotation.from_euler("XY", [0.6, -1.1]).as_matrix()
    np.testing.assert_allclose(body.locked_inertia([0.6, -1.1]), inertia_by_hand(turn), atol=1e-15)


def test_what_no_urdf_has_is_named_with_its_lines_in_one_warning(tmp_path):
    text = PLAIN.replace("</robot>", '\n<wheel_slip/>\n<drake:bushing/>\n<wheel_slip a="1"/></robot>')
    with pytest.warns(IgnoredElementWarning) as caught:
        sp.load_body(written(tmp_path, text))
    assert len(caught) == 1
    assert re.search(
        r":2: elements <wheel_slip>, <drake:bushing> \(line 3\), <wheel_slip> \(line 4\)", str(caught[0].message)
    )


def test_many_joints_of_one_fault_are_one_sentence(tmp_path):
    legs = [link(f"l{k}", 1.0, [0.1, 0.1, 0.1]) for k in range(8)]
    limited = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    balls = [joint(f"j{k}", "spherical", "trunk", f"l{k}", extra=limited) for k in range(8)]
    with pytest.warns(IgnoredElementWarning) as caught:
        sp.load_body(written(tmp_path, urdf(TRUNK, *legs, *balls)))
    assert len(caught) == 1
    assert str(caught[0].message).count("<limit> of a ball joint") == 1
    assert all(f"'j{k}'" in str(caught[0].message) for k in range(8))


@pytest.mark.parametrize(("share", "said"), [(-9e-7, None), (-2e-6, "--on-unphysical warn")])
def test_a_moment_below_zero_by_less_than_a_millionth_is_rounding(share, said, tmp_path):
    path = written(tmp_path, urdf(link("a", 1.0, [0.1, 0.1, 0.1 * share])))
    if said is None:
        assert sp.load_body(path).mass == 1.0
        return
    with pytest.raises(UnphysicalInertiaError, match=said):
        sp.load_body(path)
    with pytest.warns(sp.UnphysicalInertiaWarning, match="negative"):
        assert sp.load_body(path, on_unphysical="warn").mass == 1.0


@pytest.mark.parametrize("mesh", [None, "package://nowhere/torso.stl"])
def test_a_dummy_box_beside_a_lost_mesh_says_nothing_of_density(mesh, tmp_path):
    box = "<visual><geometry><box size='.001 .001 .001'/></geometry></visual>"
    lost = "" if mesh is None else f"<visual><geometry><mesh filename='{mesh}'/></geometry></visual>"
    text = urdf(TRUNK.replace("</inertial>", f"</inertial>{lost}{box}"))
    found = " ".join(implausible(sp.load_body(written(tmp_path, text))))
    assert ("denser than any matter" in found) == (mesh is None)


# ---- What is refused ------------------------------------------------------------------------------------------------


def archive(*names):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as packed:
        for name in names:
            packed.writestr(name, "x")
    return stream.getvalue()


LOOSE = link("x", 1.0, [0.1, 0.1, 0.1])
REFUSED = {
    "USD": (b"PXR-USDC\0\1\2", "USD stage", "convert"),
    "USDA": (b"#usda 1.0\n(\n)\n", "USD stage", "convert"),
    "USDZ": (archive("robot.usdc", "a.png"), "USD stage", "convert"),
    "Git LFS": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n", "Git LFS", "git lfs pull"),
    "JSON": (b'{"links": []}', "JSON", "load the URDF"),
    "SDF": (b'<?xml version="1.0"?><sdf version="1.6"><model name="a"/></sdf>', "SDF", "sdf2urdf"),
    "STEP": (b"ISO-10303-21;\nHEADER;\n", "STEP", "export a URDF"),
    "STL": (bytes(80) + struct.pack("<I", 1) + bytes(50), "STL", "load the model"),
    "STL in words": (b"solid hull\n  facet normal 0 0 1\n", "mesh", "load the model"),
    "OBJ": (b"v 0 0 0.5\nv 1 0 0\n", "mesh", "load the model"),
    "GLB": (b"glTF\2\0\0\0", "mesh", "load the model"),
    "Collada": (b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"/>', "mesh", "load the model"),
    "zip": (archive("model/robot.urdf"), "zip archive", "unpack it and load 'robot.urdf'"),
    "gzip": (gzip.compress(PLAIN.encode(), mtime=0), "gzip", "gunzip"),
    "a page": (b"<!DOCTYPE html>\n<html><p>404</html>", "HTML page", "download the raw file"),
    "SRDF": (b'<robot name="a"><group name="arm"/></robot>', "SRDF", "load its URDF"),
    "a table": (b"time,hip\n0.0,0.1\n0.1,0.2\n", "recorded motion", "check BODY MOTION"),
    "NPZ": (archive("qpos.npy"), "recorded motion", "check BODY MOTION"),
    "Yeadon's file without its unit": (b"Ls1L: 0.2\nLs2L: 0.3\n", "without a unit", "add the line"),
    "nothing": (b"\n\0", "empty file", "download"),
    "prose": (b"Dear all,\nhere is the robot.\n", "no XML", "load a URDF"),
    "a tag that is not closed": (PLAIN.replace("</inertial>", "", 1), "<inertial> of line 1 is not closed", "correct"),
    "a joint in a link": (urdf(TRUNK.replace("</link>", HIP + "</link>"), LEG), "<joint> stands in <link>", "move it"),
    "a mass in a link": (urdf(TRUNK.replace("</link>", '<mass value="1"/></link>')), "<mass> stands", "move it"),
    "a link in a joint": (urdf(TRUNK, LEG, HIP.replace("</joint>", LOOSE + "</joint>")), "<link> stands", "move it"),
    "a screw without its thread": (
        urdf(TRUNK, LEG, f'<drake:joint name="hip" type="screw">{FRAME}</drake:joint>'),
        "joint 'hip': <drake:joint> has no <drake:screw_thread_pitch>",
        "add it",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_file_that_is_no_body_is_named_with_what_to_do_next(kind, tmp_path):
    content, what, then = REFUSED[kind]
    with pytest.raises(ModelFileError) as caught:
        sp.load_body(written(tmp_path, content))
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'robot.urdf'}:")
    assert what in message
    assert then in message[message.index(what) :]


# ---- Meshes of an MJCF that are missing -----------------------------------------------------------------------------

HELD = '<inertial pos="0 0 0" mass="5" diaginertia="1 1.2 1.4"/>'
ARM = (
    '<body name="arm" pos="0 0 1"><joint name="j" axis="0 1 0"/>'
    '<inertial pos="0 0 .2" mass="1" diaginertia=".1 .1 .01"/></body>'
)
HULL = '<geom type="mesh" mesh="hull"/>'


def mjcf(trunk=HELD, shapes=HULL, asset='<mesh name="hull" file="hull.stl"/>', settings=""):
    return (
        f"<mujoco>{settings}<asset>{asset}</asset><worldbody><body name='bus'><freejoint/>{trunk}{shapes}"
        f"{ARM}</body></worldbody></mujoco>"
    )


LEFT_OUT = {
    "a mesh that is drawn": (mjcf(), ("hull.stl",)),
    "in a folder": (mjcf(settings='<compiler meshdir="far"/>'), ("hull.stl",)),
    "without mass, beside a ball that has it": (
        mjcf(trunk='<geom size=".2" mass="5"/>', shapes='<geom type="mesh" mesh="hull" mass="0"/>'), ("hull.stl",),
    ),
    "two meshes and a texture": (
        mjcf(asset='<mesh file="a.stl"/><mesh name="hull" file="b.obj"/><texture name="t" type="2d" file="t.png"/>'),
        ("a.stl", "b.obj", "t.png"),
    ),
    "a height field and a cube of pictures": (
        mjcf(
            shapes="",
            asset='<hfield name="h" file="h.png" size="1 1 1 1"/><texture name="s" type="cube" fileup="u.png"/>',
        ),
        ("h.png", "u.png"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_what_is_only_drawn_may_be_missing(kind, tmp_path):
    text, files = LEFT_OUT[kind]
    with pytest.warns(IgnoredElementWarning) as caught:
        body = sp.load_body(written(tmp_path, text, "b.xml"))
    assert len(caught) == 1
    assert all(file in str(caught[0].message) for file in files)
    plain = re.sub(r"<asset>.*</asset>|<geom type=.mesh.[^>]*>", "", text)
    model = mujoco.MjModel.from_xml_string(plain)  # type: ignore[attr-defined]
    assert body.mass == pytest.approx(model.body_mass.sum(), rel=1e-15)
    trunk = next(part for part in body.moving_parts if "bus" in part.links)
    np.testing.assert_allclose(np.linalg.eigvalsh(trunk.inertia), np.sort(model.body_inertia[1]), rtol=1e-14)


def test_a_missing_mesh_is_not_drawn_and_one_that_is_there_is_masses_own(tmp_path):
    shapes = HULL + '<geom type="box" size=".1 .2 .3"/>'
    with pytest.warns(IgnoredElementWarning, match="hull"):
        body = sp.load_body(written(tmp_path, mjcf(shapes=shapes), "b.xml"))
    assert [(shape.kind, shape.link) for shape in sp.body.visuals(body)] == [("box", "bus"), ("box", "arm")]
    written(tmp_path, b"version https://git-lfs.github.com/spec/v1\n", "hull.stl")
    with pytest.warns(IgnoredElementWarning, match="hull"):
        assert sp.load_body(tmp_path / "b.xml").mass == 6.0


@pytest.mark.parametrize(
    "text",
    [
        mjcf(trunk=""),
        mjcf(trunk="", shapes='<geom type="mesh" mesh="hull" mass="5"/>'),
        mjcf(trunk="", shapes='<geom type="box" mesh="hull"/>'),
        mjcf(settings='<compiler inertiafromgeom="true"/>'),
    ],
    ids=["no inertial", "only its mass is known", "a box as large as the mesh", "geoms count"],
)
def test_a_mass_from_a_missing_mesh_is_refused_by_its_name(text, tmp_path):
    with pytest.raises(ModelFileError, match="'bus'"):
        sp.load_body(written(tmp_path, text, "b.xml"))


# ---- Options --------------------------------------------------------------------------------------------------------

XACRO = (
    '<robot name="r" xmlns:xacro="http://wiki.ros.org/xacro"><xacro:arg name="mass" default="1"/>'
    + TRUNK.replace('value="3.0"', 'value="${2 + $(arg mass)}"')
    + f'<xacro:if value="$(arg payload)">{LEG}{HIP}</xacro:if></robot>'
)


def test_arguments_of_a_xacro_file(tmp_path, capsys):
    path = written(tmp_path, XACRO, "r.urdf.xacro")
    for payload, mass, joints in (("true", 4.0, ("hip",)), ("false", 3.0, ()), (True, 4.0, ("hip",))):
        body = sp.load_body(path, xacro_args={"payload": payload})
        assert (body.mass, body.joint_names) == (mass, joints)
    assert sp.load_body(path, xacro_args={"payload": "false", "mass": 7}).mass == 9.0
    # Drawn from the same expansion.
    body = sp.load_body(path, xacro_args={"payload": "true"})
    assert {shape.link for shape in sp.body.visuals(body)} == {"trunk", "leg"}
    for words in (["--xacro", "payload:=true", "mass:=2"], ["--xacro", "payload:=true", "--xacro", "mass:=2"]):
        assert main(["check", str(path), *words, "--json"]) in (0, None)
        assert json.loads(capsys.readouterr().out)["body"]["mass"] == 5.0


def test_a_study_gives_its_bodies_their_arguments(tmp_path):
    written(tmp_path, XACRO, "r.urdf.xacro")
    written(tmp_path, "time,hip\n0,0\n1,0.5\n2,0.8\n3,0.1\n", "m.csv")
    text = 'body = "r.urdf.xacro"\nmotion = "m.csv"\n'
    study = sp.study.read_study(written(tmp_path, text + '[xacro_args]\npayload = true\nmass = "2"\n', "s.toml"))
    assert study.loading == {"xacro_args": {"payload": "true", "mass": "2"}}
    assert sp.load_body(study.body, **study.loading).mass == 5.0


def test_an_argument_that_is_missing_or_unknown_is_an_error_with_what_to_type(tmp_path):
    path = written(tmp_path, XACRO, "r.urdf.xacro")
    with pytest.raises(ModelFileError, match="argument"):
        sp.load_body(path)
    with pytest.raises(ModelFileError, match="'payloat'"):
        sp.load_body(path, xacro_args={"payload": "true", "payloat": "true"})
    with pytest.raises(ShapeError, match="xacro"):
        sp.load_body("cat", xacro_args={"payload": "true"})
    for wrong in ("payload:=true", ["payload"], {1: 2}):
        with pytest.raises(WrongObjectError, match="xacro_args"):
            sp.load_body(path, xacro_args=wrong)


COMMANDS = (
    *("check", "split", "audit", "explore", "torques", "sweep", "plan", "view"),
    *("reach", "plot phases", "plot attitude", "orbits"),
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_takes_a_body_has_its_options(command, capsys):
    main([*command.split(), "--help-all"])
    said = capsys.readouterr().out
    assert all(option in said for option in ("--xacro", "--on-unphysical", "--packages"))


def test_on_the_command_line_an_odd_inertia_is_taken_with_a_warning(tmp_path, capsys):
    path = str(written(tmp_path, urdf(TRUNK, link("leg", 1.0, [0.1, 0.1, -0.01]), HIP)))
    main(["check", path, "--on-unphysical", "warn", "--json"])
    data = json.loads(capsys.readouterr().out)
    assert data["body"]["mass"] == 4.0
    assert any("negative principal moment" in said for said in data["warnings"])
    with pytest.raises(SystemExit):
        main(["check", path, "--xacro", "payload=true", "--json"])
    assert "as in --xacro payload:=true" in json.loads(capsys.readouterr().out)["error"]["message"]


# ---- Roots that move in a plane -------------------------------------------------------------------------------------

FLAT = """version 4
segment Trunk
	rt 0.2 0 0 xyz 0 0 0.5
	translations yz
	rotations x
	mass 5
	inertia
		1 0 0
		0 1 0
		0 0 1
endsegment
segment Leg
	parent Trunk
	rotations x
	mass 1
	com 0 0 -0.3
	inertia
		1 0 0
		0 1 0
		0 0 1
endsegment
"""


def test_the_one_angle_of_a_planar_root_of_a_biomod_is_the_recorded_base(tmp_path):
    pytest.importorskip("biorbd")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        body = sp.load_body(written(tmp_path, FLAT, "flat.bioMod"))
    assert body.joint_names == ("Leg_RotX",)
    times = np.linspace(0.0, 1.0, 21)
    y, z, tilt, leg = 0.1 * times, np.cos(times), 0.4 * times, np.sin(times)
    rows = np.column_stack([times, y, z, tilt, leg])
    header = "time,Trunk_TransY,Trunk_TransZ,Trunk_RotX,Leg_RotX"
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header=header, comments="", fmt="%.17g")
    recorded = sp.read_recorded_motion(tmp_path / "m.csv", body)
    frame = Rotation.from_euler("x", 0.2)
    want = frame * Rotation.from_euler("x", tilt[:, None])
    np.testing.assert_allclose(recorded.base_attitude, want.as_matrix(), rtol=0, atol=1e-15)
    places = np.array([0.0, 0.0, 0.5]) + frame.apply(np.column_stack([0.0 * y, y, z]))
    np.testing.assert_allclose(recorded.base_position, places, rtol=0, atol=1e-15)
