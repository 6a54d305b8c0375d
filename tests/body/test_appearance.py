"""What is drawn of a body against its file read by others, and the inertia that drawn solids have."""

from __future__ import annotations

import importlib.util
import itertools
import math
import shutil
import warnings
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.body import inertia_box
from shapephase.body.drawing import limits
from shapephase.errors import VisualWarning
from support.bodies import EVERY_BODY, joint, link, random_shapes, urdf

BOX_COLOUR, PLAIN = (0.337, 0.706, 0.914, 1.0), (0.72, 0.74, 0.78, 1.0)
BASE = link("base", 3.0, [0.3, 0.5, 0.6])
TURN = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 0.6"/>'


def solid_inertia(kind, size, mass):
    """Inertia of uniform solids, long axis z, by the textbook."""
    if kind == "sphere":
        return np.eye(3) * 0.4 * mass * size[0] ** 2
    if kind == "box":
        x, y, z = np.square(size)
        return np.diag([y + z, x + z, x + y]) * mass / 12.0
    assert kind == "cylinder"
    across = mass * (3.0 * size[0] ** 2 + size[1] ** 2) / 12.0
    return np.diag([across, across, 0.5 * mass * size[0] ** 2])


def volume(kind, size):
    return {
        "sphere": lambda: 4.0 / 3.0 * math.pi * size[0] ** 3,
        "box": lambda: math.prod(size),
        "cylinder": lambda: math.pi * size[0] ** 2 * size[1],
    }[kind]()


def together(bodies):
    """Mass, centre and inertia about it of solids (mass, centre, inertia)."""
    mass = sum(m for m, _, _ in bodies)
    centre = sum(m * c for m, c, _ in bodies) / mass
    inertia = sum(
        i + m * ((c - centre) @ (c - centre) * np.eye(3) - np.outer(c - centre, c - centre)) for m, c, i in bodies
    )
    return mass, centre, inertia


def with_visual(visual, tail="", more=""):
    """A body of two links; the second carries a <visual>."""
    arm = link("arm", 1.0, [0.02, 0.03, 0.04], (0.2, 0.1, 0.0)).replace("</link>", f"{visual}</link>")
    return urdf(more, BASE, arm, joint("hip", "revolute", "base", "arm", (0, 1, 0)), tail)


def shown(body, name="arm"):
    return [shape for shape in sp.body.visuals(body) if shape.link == name]


# ---- Inertia boxes --------------------------------------------------------------------------------------------------


def test_inertia_boxes_have_the_mass_and_inertia_they_stand_for(rng):
    for _ in range(50):
        mass, edges = rng.uniform(0.1, 9.0), rng.uniform(0.01, 2.0, 3)
        turn = Rotation.random(random_state=rng).as_matrix()
        tensor = turn @ solid_inertia("box", edges, mass) @ turn.T
        found, axes = inertia_box(mass, tensor)
        np.testing.assert_allclose(np.sort(found), np.sort(edges), rtol=1e-7)
        np.testing.assert_allclose(axes @ solid_inertia("box", found, mass) @ axes.T, tensor, rtol=0, atol=1e-13 * 99)
        assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-13)


def test_boxes_of_rods_plates_and_what_cannot_exist():
    """A rod of length 1 and mass 12 has moment 1; a tensor no body can have leaves one edge at zero."""
    edges, axes = inertia_box(12.0, np.diag([0.0, 1.0, 1.0]))
    np.testing.assert_allclose(np.sort(edges), [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(np.abs(axes[:, np.argmax(edges)]), [1.0, 0.0, 0.0], atol=1e-15)
    edges, _ = inertia_box(1.0, np.diag([1.0, 1.0, 3.0]))
    assert edges.min() == 0.0
    assert np.isfinite(edges).all()


@pytest.mark.parametrize("name", EVERY_BODY)
def test_a_model_without_a_file_is_drawn_as_boxes_that_turn_as_heavily(name, rng):
    """The solids drawn, put where `link_pose` says, have the body's locked inertia and centre of mass."""
    path = sp.load_body(name).file
    body = sp.load_body(pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer()))
    assert body.link_names == sp.load_body(name).link_names
    masses = {part.links[0]: part.mass for part in body.moving_parts}
    boxes = sp.body.visuals(body)
    assert {box.kind for box in boxes} == {"box"}
    for shape in random_shapes(body, rng, 3):
        solids = []
        for box in boxes:
            pose = body.link_pose(shape, box.link) @ box.pose
            turn, mass = pose[:3, :3], masses[box.link]
            solids.append((mass, pose[:3, 3], turn @ solid_inertia("box", box.dimensions, mass) @ turn.T))
        mass, centre, inertia = together(solids)
        assert mass == pytest.approx(body.mass, rel=1e-12)
        np.testing.assert_allclose(centre, body.centre_of_mass(shape), atol=1e-12)
        # A sheet or rod is drawn a hundredth thick.
        expected = body.locked_inertia(shape)
        np.testing.assert_allclose(inertia, expected, rtol=0, atol=2e-4 * np.abs(expected).max())


def test_parts_that_nobody_has_named_are_called_after_their_joint():
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "trunk")
    model.appendBodyToJoint(root, pin.Inertia(2.0, np.zeros(3), np.diag([0.1, 0.2, 0.25])), pin.SE3.Identity())
    hip = model.addJoint(root, pin.JointModelRX(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5])), "hip")
    model.appendBodyToJoint(hip, pin.Inertia(1.0, np.array([0.0, 0.1, 0.0]), np.eye(3) * 0.01), pin.SE3.Identity())
    before = model.nframes
    body = sp.load_body(model)
    assert model.nframes == before
    assert body.link_names == ("trunk", "hip")
    trunk, leg = sp.body.visuals(body)
    assert (trunk.link, leg.link) == ("trunk", "hip")
    np.testing.assert_allclose(leg.pose[:3, 3], [0.0, 0.1, 0.0], atol=1e-15)
    np.testing.assert_allclose(np.sqrt(0.06) * np.ones(3), leg.dimensions, rtol=1e-12)
    np.testing.assert_allclose(body.link_pose([0.5 * np.pi], "hip")[:3, 3], [0.0, 0.0, 0.5], atol=1e-15)


def test_a_point_mass_is_a_ball_of_water(load_urdf):
    point = link("arm", 2.0, [0.0, 0.0, 0.0], (0.2, 0.1, 0.0))
    body = load_urdf(urdf(BASE, point, joint("hip", "revolute", "base", "arm", (0, 1, 0))))
    (ball,) = shown(body)
    assert ball.kind == "sphere"
    assert volume("sphere", ball.dimensions) == pytest.approx(0.002, rel=1e-12)
    np.testing.assert_array_equal(ball.pose[:3, 3], [0.2, 0.1, 0.0])


# ---- URDF -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sp.robot_names())
def test_our_bodies_are_drawn_as_their_files_say(name):
    """Against another reader: every primitive, its size, its pose by SciPy's angles, and its material by name."""
    body = sp.load_body(name)
    root = ElementTree.parse(body.file).getroot()
    colours = {m.get("name"): m.find("color").get("rgba") for m in root.iter("material") if m.find("color") is not None}
    expected = []
    for element in root.findall("link"):
        for visual in element.findall("visual"):
            (shape,) = visual.find("geometry")
            keys = {"box": ["size"], "cylinder": ["radius", "length"], "sphere": ["radius"]}[shape.tag]
            size = tuple(float(word) for key in keys for word in shape.get(key).split())
            origin, pose = visual.find("origin"), np.eye(4)
            if origin is not None:
                pose[:3, 3] = np.fromstring(origin.get("xyz", "0 0 0"), sep=" ")
                angles = np.fromstring(origin.get("rpy", "0 0 0"), sep=" ")
                pose[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
            rgba = tuple(map(float, colours[visual.find("material").get("name")].split()))
            expected.append((element.get("name"), shape.tag, size, rgba, pose))
    found = sp.body.visuals(body)
    assert [(v.link, v.kind, v.dimensions, v.colour) for v in found] == [each[:4] for each in expected]
    for shape, (*_, pose) in zip(found, expected, strict=True):
        np.testing.assert_allclose(shape.pose, pose, atol=1e-15)


def test_capsules_colours_and_defaults(load_urdf):
    own = '<material name="x"><color rgba="0.1 0.2 0.3 0.4"/></material>'
    shape = "<geometry><capsule radius='0.1' length='0.5'/></geometry>"
    body = load_urdf(with_visual(f"<visual>{TURN}{shape}{own}</visual><visual>{shape}</visual>"))
    first, second = shown(body)
    assert (first.kind, first.dimensions, first.colour) == ("capsule", (0.1, 0.5), (0.1, 0.2, 0.3, 0.4))
    expected = Rotation.from_euler("xyz", [0.4, -0.5, 0.6]).as_matrix()
    np.testing.assert_allclose(first.pose[:3, :3], expected, atol=1e-15)
    np.testing.assert_array_equal(first.pose[:3, 3], [0.1, -0.2, 0.3])
    assert second.colour == PLAIN
    np.testing.assert_array_equal(second.pose, np.eye(4))


def test_a_material_defined_elsewhere_and_capsules_of_other_names(load_urdf):
    used = "<visual><geometry><d:capsule radius='0.1' length='0.5'/></geometry><material name='blue'/></visual>"
    text = with_visual(used, more='<material name="blue"><color rgba="0 0 2 1"/></material>')
    body = load_urdf(text.replace("<robot ", '<robot xmlns:d="http://drake.mit.edu" '))
    (shape,) = shown(body)
    assert (shape.kind, shape.colour) == ("capsule", (0.0, 0.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("visual", "says"),
    [
        ("<visual/>", "no <geometry>"),
        ("<visual><geometry/></visual>", "nothing"),
        ("<visual><geometry><sphere radius='0'/></geometry></visual>", "above zero"),
        ("<visual><geometry><sphere radius='one'/></geometry></visual>", "finite number"),
        ("<visual><geometry><box size='1 2'/></geometry></visual>", "3 finite numbers"),
        ("<visual><geometry><cone radius='1'/></geometry></visual>", "<cone>"),
        ("<visual><geometry><mesh/></geometry></visual>", "not found"),
        ("<visual><geometry><mesh filename='package://nowhere/a.stl'/></geometry></visual>", "package://nowhere/a.stl"),
        ("<visual><geometry><mesh filename='file:///etc/hostname'/></geometry></visual>", "files .stl"),
        (f"<visual><geometry><mesh filename='{'a' * 5000}.stl'/></geometry></visual>", "not found"),
    ],
)
def test_what_cannot_be_shown_is_said_and_drawn_as_a_box(load_urdf, visual, says):
    body = load_urdf(with_visual(visual))
    with pytest.warns(VisualWarning, match="body.urdf:") as caught:
        (box,) = shown(body)
    assert says in str(caught[0].message)
    assert "link 'arm'" in str(caught[0].message)
    assert (box.kind, box.colour) == ("box", BOX_COLOUR)
    expected = np.sort(np.sqrt(6.0 * np.array([0.05, 0.03, 0.01])))
    np.testing.assert_allclose(np.sort(box.dimensions), expected, rtol=1e-12)
    np.testing.assert_allclose(box.pose[:3, 3], [0.2, 0.1, 0.0], atol=1e-15)


def test_one_faulty_shape_among_good_ones(load_urdf):
    good = "<visual><geometry><sphere radius='0.1'/></geometry></visual>"
    body = load_urdf(with_visual(good + "<visual/>"))
    with pytest.warns(VisualWarning, match="geometry"):
        (shape,) = shown(body)
    assert shape.kind == "sphere"


def test_many_faults_make_one_short_warning(load_urdf):
    body = load_urdf(with_visual("<visual/>" * 200))
    with pytest.warns(VisualWarning, match="190") as caught:
        sp.body.visuals(body)
    assert len(caught) == 1


# ---- Files that change ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("change", ["rewritten", "gone"])
def test_a_file_that_changed_since_loading_is_not_believed(tmp_path, change):
    path = tmp_path / "cat.urdf"
    shutil.copy(sp.body.robots_folder() / "cat.urdf", path)
    body = sp.load_body(path)
    assert len(sp.body.visuals(body)) == 16
    if change == "gone":
        path.unlink()
    else:
        path.write_text(path.read_text().replace('radius="0.05"', 'radius="0.06"'))
    with pytest.warns(VisualWarning, match=r"cat\.urdf"):
        found = sp.body.visuals(body)
    assert len(found) == sum(part.mass > 0.0 for part in body.moving_parts) == 14
    assert {shape.kind for shape in found} == {"box"}


def test_a_body_remembers_its_file_wherever_one_goes(tmp_path, monkeypatch):
    shutil.copy(sp.body.robots_folder() / "cat.urdf", tmp_path / "tom.urdf")
    monkeypatch.chdir(tmp_path)
    body = sp.load_body("tom.urdf")
    monkeypatch.chdir("/")
    assert body.file == tmp_path / "tom.urdf"
    assert len(sp.body.visuals(body)) == 16


# ---- Meshes ---------------------------------------------------------------------------------------------------------


def write_wedge(path):
    """A mesh that no mirror or turn takes to itself."""
    import trimesh

    path.parent.mkdir(parents=True, exist_ok=True)
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    trimesh.Trimesh(points, faces).export(path)


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".STL", ".ply"])
@pytest.mark.parametrize(
    ("filename", "place"),
    [
        ("package://wedge_description/meshes/a", "meshes/a"),
        ("package:///wedge_description/meshes/a", "meshes/a"),
        ("package://other_name/meshes/a", "meshes/a"),
        ("../meshes/a", "meshes/a"),
        ("a", "urdf/a"),
    ],
)
def test_meshes_are_found_around_the_urdf(tmp_path, filename, place, suffix):
    import trimesh

    package = tmp_path / "wedge_description"
    write_wedge(package / (place + suffix))
    mesh = f"<visual>{TURN}<geometry><mesh filename='{filename}{suffix}' scale='0.1 -0.2 0.3'/></geometry></visual>"
    (package / "urdf").mkdir(exist_ok=True)
    (package / "urdf" / "wedge.urdf").write_text(with_visual(mesh))
    (shape,) = shown(sp.load_body(package / "urdf" / "wedge.urdf"))
    assert (shape.kind, shape.dimensions) == ("mesh", (0.1, -0.2, 0.3))
    assert shape.mesh.resolve() == package / (place + suffix)
    drawn = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    # A positive volume: the faces of a mirrored mesh look outward, too.
    assert drawn.volume == pytest.approx(1.0 * 0.1 * 0.2 * 0.3, rel=1e-6)
    np.testing.assert_allclose(drawn.bounds, [[0.0, -0.4, 0.0], [0.1, 0.0, 0.9]], atol=1e-7)


def test_absolute_meshes_and_damaged_ones(tmp_path, load_urdf):
    write_wedge(tmp_path / "a b.stl")
    (shape,) = shown(
        load_urdf(with_visual(f"<visual><geometry><mesh filename='file://{tmp_path}/a%20b.stl'/></geometry></visual>"))
    )
    assert len(shape.faces) == 4
    for content in (b"", b"solid", bytes(range(256)), b"\0" * 84):
        (tmp_path / "bad.stl").write_bytes(content)
        body = load_urdf(with_visual("<visual><geometry><mesh filename='bad.stl'/></geometry></visual>"))
        with pytest.warns(VisualWarning, match="bad.stl"):
            (box,) = shown(body)
        assert box.kind == "box"


def test_the_meshes_of_example_robot_data_are_found_from_elsewhere(tmp_path):
    shutil.copy(sp.body.example_file("human"), tmp_path / "mine.urdf")
    found = sp.body.visuals(sp.load_body(tmp_path / "mine.urdf"))
    assert sum(shape.kind == "mesh" for shape in found) == 23


def test_without_the_reader_of_a_mesh_the_extra_is_named(tmp_path, load_urdf, monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "collada" else real(name))
    (tmp_path / "a.dae").write_text("<COLLADA/>")
    body = load_urdf(with_visual("<visual><geometry><mesh filename='a.dae'/></geometry></visual>"))
    with pytest.warns(VisualWarning, match=r"shapephase\[plot\]"):
        assert shown(body)[0].kind == "box"


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="inch" meter="0.0254"/><up_axis>Y_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><lambert><diffuse><color>1 0 0 1</color></diffuse>
</lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 2 0 0 0 3
</float_array><technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4" material="s">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry>
</library_geometries>
<library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="s" target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def test_collada_meshes_count_in_their_unit_and_keep_their_axes_and_colour(tmp_path, load_urdf):
    (tmp_path / "a.dae").write_text(COLLADA)
    body = load_urdf(with_visual("<visual><geometry><mesh filename='a.dae'/></geometry></visual>"))
    if importlib.util.find_spec("collada") is None:
        with pytest.warns(VisualWarning, match="pycollada"):
            assert shown(body)[0].kind == "box"
        return
    (shape,) = shown(body)
    np.testing.assert_allclose(shape.vertices.max(axis=0), 0.0254 * np.array([1.0, 2.0, 3.0]), rtol=1e-6)
    assert shape.colour == (1.0, 0.0, 0.0, 1.0)


# ---- MJCF -----------------------------------------------------------------------------------------------------------

with_mujoco = pytest.mark.usefixtures("warm_engines")
MJCF = """
<mujoco model="toy">
  <compiler angle="radian" eulerseq="zyx"/>
  <default>
    <geom rgba="0.2 0.4 0.6 1"/>
    <default class="thin"><geom type="capsule" size="0.02 0.3" mass="0.4"/></default>
  </default>
  <asset><material name="red" rgba="0.9 0.1 0.1 1"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body pos="0 0 1" euler="0.1 0.2 0.3">
      <freejoint/>
      <geom type="box" size="0.1 0.2 0.3" pos="0.01 0.02 0.03" quat="0.5 0.5 -0.5 0.5" material="red" rgba="1 0 0 1"/>
      <frame pos="0.3 0.1 0" axisangle="0 1 0 0.7">
        <geom type="ellipsoid" size="0.1 0.15 0.2" pos="0.2 0 0.1" euler="0.3 -0.2 0.5"/>
        <body name="arm" pos="0 0 0.5" xyaxes="0 1 0 -1 0 0" childclass="thin">
          <joint name="hip" axis="0 1 0" pos="0 0 0.1"/>
          <geom zaxis="1 1 0"/>
          <geom type="cylinder" fromto="0 0 0 0.1 0.2 0.3" size="0.05"/>
          <geom type="box" fromto="0 0 0 0.1 -0.2 0.3" size="0.02"/>
          <geom type="sphere" size="0.07" group="2"/>
          <geom type="sphere" size="0.5" group="3"/>
          <body pos="0.2 0 0"><joint axis="1 0 0"/><geom group="4"/></body>
        </body>
        <body pos="0 -0.5 0"><joint axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>
      </frame>
    </body>
  </worldbody>
</mujoco>
"""


@with_mujoco
def test_the_geoms_of_an_mjcf_are_where_mujoco_has_them(tmp_path):
    import mujoco

    path = tmp_path / "toy.xml"
    path.write_text(MJCF)
    body = sp.load_body(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    kinds = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box"}
    factors = {"sphere": [1], "capsule": [1, 2], "cylinder": [1, 2], "ellipsoid": [1, 1, 1], "box": [2, 2, 2]}
    hidden = np.flatnonzero((model.geom_group == 3) | (model.geom_bodyid == 0))
    expected = [geom for geom in range(model.ngeom) if geom not in hidden]
    found = [shape for shape in sp.body.visuals(body) if shape.colour != BOX_COLOUR]
    assert len(found) == len(expected) == 7
    for shape, geom in zip(found, expected, strict=True):
        kind = kinds[int(model.geom_type[geom])]
        assert shape.kind == kind
        size = np.array(factors[kind]) * model.geom_size[geom, : len(factors[kind])]
        np.testing.assert_allclose(shape.dimensions, size, rtol=1e-14)
        np.testing.assert_allclose(shape.colour, model.geom_rgba[geom], atol=1e-7)
        turn = Rotation.from_quat(np.roll(model.geom_quat[geom], -1)).as_matrix()
        np.testing.assert_allclose(shape.pose[:3, :3], turn, atol=1e-12)
        np.testing.assert_allclose(shape.pose[:3, 3], model.geom_pos[geom], atol=1e-12)
        carrier = model.body(model.geom_bodyid[geom]).name or f"body{model.geom_bodyid[geom]}"
        assert shape.link == carrier


@with_mujoco
def test_the_moving_parts_of_an_mjcf_are_in_the_axes_of_their_links(tmp_path, rng):
    """Joints beside the origin of their body: the parts, put where `link_pose` says, have the locked inertia."""
    path = tmp_path / "toy.xml"
    path.write_text(MJCF)
    body = sp.load_body(path)
    for shape in rng.uniform(-1.0, 1.0, (3, body.n_shape)):
        solids = []
        for part in body.moving_parts:
            pose = body.link_pose(shape, part.links[0])
            turn, place = pose[:3, :3], pose[:3, 3]
            solids.append((part.mass, place + turn @ part.centre, turn @ part.inertia @ turn.T))
        mass, centre, inertia = together(solids)
        assert mass == pytest.approx(body.mass, rel=1e-12)
        np.testing.assert_allclose(centre, body.centre_of_mass(shape), atol=1e-12)
        np.testing.assert_allclose(inertia, body.locked_inertia(shape), rtol=1e-10, atol=1e-12 * body.mass)


@with_mujoco
def test_what_an_mjcf_shows_not_is_a_box(tmp_path):
    """The last body has an inertia and no geom."""
    path = tmp_path / "toy.xml"
    path.write_text(MJCF)
    boxes = [shape for shape in sp.body.visuals(sp.load_body(path)) if shape.colour == BOX_COLOUR]
    assert [box.link for box in boxes] == ["body4"]
    np.testing.assert_allclose(boxes[0].dimensions, math.sqrt(0.6), rtol=1e-12)


@with_mujoco
def test_materials_of_an_mjcf(tmp_path):
    path = tmp_path / "toy.xml"
    path.write_text(MJCF.replace(' rgba="1 0 0 1"', "").replace('<geom rgba="0.2 0.4 0.6 1"/>', ""))
    first, second, *_ = sp.body.visuals(sp.load_body(path))
    assert first.colour == (0.9, 0.1, 0.1, 1.0)
    assert second.colour == (0.5, 0.5, 0.5, 1.0)


@with_mujoco
def test_the_meshes_of_an_mjcf_are_where_the_file_puts_them(tmp_path):
    """MuJoCo moves a mesh to its centre, and turns it to its principal axes."""
    write_wedge(tmp_path / "wedge.stl")
    path = tmp_path / "toy.xml"
    path.write_text("""<mujoco><asset><mesh name="wedge" file="wedge.stl" scale="1 2 1"/></asset><worldbody>
      <body name="base">
      <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/><geom size="0.3" group="3"/>
      <geom type="mesh" mesh="wedge" pos="0.1 0 0" rgba="0 1 0 1"/>
      <body name="arm"><joint/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>
      </body></worldbody></mujoco>""")
    mesh, box = sp.body.visuals(sp.load_body(path))
    assert (mesh.kind, box.kind, mesh.colour) == ("mesh", "box", (0.0, 1.0, 0.0, 1.0))
    corners = mesh.pose[:3, :3] @ mesh.vertices[mesh.faces.ravel()].T + mesh.pose[:3, 3:]
    trimesh = pytest.importorskip("trimesh")
    written = trimesh.load_mesh(tmp_path / "wedge.stl")
    expected = np.array(written.vertices)[written.faces.ravel()] * [1.0, 2.0, 1.0] + [0.1, 0.0, 0.0]
    ours, theirs = (np.array(sorted(each.round(5).tolist())) for each in (corners.T, expected))
    np.testing.assert_allclose(ours, theirs, atol=2e-5, rtol=0)


@pytest.mark.parametrize("name", EVERY_BODY)
def test_every_moving_part_with_mass_is_shown(name):
    body = sp.load_body(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = {shape.link for shape in sp.body.visuals(body)}
    for part in body.moving_parts:
        assert part.mass == 0.0 or drawn & set(part.links)
    linked = list(itertools.chain.from_iterable(part.links for part in body.moving_parts))
    assert sorted(linked) == sorted(body.link_names)
    assert sum(part.mass for part in body.moving_parts) == pytest.approx(body.mass, rel=1e-12)


# ---- Very much to show ----------------------------------------------------------------------------------------------


def crowd(folder, meshes, visuals_of_each=1, kind="mesh", flat=False):
    """Two links, the first with many visuals, of icospheres in files or of balls."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    if flat:
        ball.vertices[:, 2] = 0.0
    shapes = []
    for k in range(meshes):
        if kind == "mesh":
            ball.export(folder / f"ball{k}.stl")
        shape = f"<mesh filename='ball{k}.stl' scale='.1 .1 .1'/>" if kind == "mesh" else "<sphere radius='.1'/>"
        place = f"<origin xyz='{0.01 * k} 0 0'/>"
        shapes += [f"<visual>{place}<geometry>{shape}</geometry></visual>"] * visuals_of_each
    inertia = "<mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
    (folder / "crowd.urdf").write_text(
        f"<robot name='r'><link name='a'><inertial>{inertia}</inertial>{''.join(shapes)}</link>"
        f"<link name='b'><inertial>{inertia}</inertial>"
        "<visual><geometry><sphere radius='1'/></geometry></visual></link>"
        "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>"
    )
    return sp.load_body(folder / "crowd.urdf")


def reach_of(shapes, directions):
    """How far shapes reach in directions (3, M), by all their points."""
    points = [
        np.asarray(s.vertices if len(s.vertices) else s.corners) @ s.pose[:3, :3].T + s.pose[:3, 3] for s in shapes
    ]
    return (np.concatenate(points) @ directions).max(axis=0)


@pytest.mark.parametrize("flat", [False, True])
def test_more_triangles_than_a_page_holds_are_drawn_as_hulls(tmp_path, rng, flat):
    """1,280 triangles each; the hull of some points of a ball reaches at least as far as 0.97 of its radius."""
    body = crowd(tmp_path, 6, 2, flat=flat)
    whole = sp.body.visuals(body)
    shapes, (sentence,) = limits.within_limits(list(whole), most_faces=5_000)
    assert "convex hulls: all have 15360 triangles together" in sentence
    assert len(shapes) == len(whole) == 13
    assert 1280 < sum(len(shape.faces) for shape in shapes) <= 5_000
    if flat:
        boxes = [shape for shape in shapes if shape.kind == "box"]
        assert boxes
        for box in boxes:
            # The file's numbers are floats of 32 bits.
            np.testing.assert_allclose(box.dimensions, [0.2, 0.2, 2e-4], rtol=2.0 * np.finfo(np.float32).eps)
        return
    import trimesh

    for shape in shapes[:12]:
        drawn = trimesh.Trimesh(shape.vertices, shape.faces, validate=True)
        assert drawn.is_watertight
        assert 0.9 < drawn.volume / (4.0 / 3.0 * np.pi * 1e-3) < 1.0
    directions = so3.normalised(rng.normal(size=(50, 3))).T
    np.testing.assert_allclose(reach_of(shapes[:12], directions), reach_of(whole[:12], directions), rtol=0.03)


def test_more_shapes_than_a_page_holds_are_drawn_as_one_hull(tmp_path):
    body = crowd(tmp_path, 1000, kind="ball")
    with pytest.warns(VisualWarning, match="'a'"):
        hull, ball = sp.body.visuals(body)
    assert (hull.link, hull.kind, ball.kind) == ("a", "mesh", "sphere")
    np.testing.assert_allclose([hull.vertices.min(axis=0), hull.vertices.max(axis=0)], [[-0.1] * 3, [10.09, 0.1, 0.1]])


def test_visuals_of_one_mesh_share_its_numbers(tmp_path):
    first, second, *_ = sp.body.visuals(crowd(tmp_path, 1, 2))
    assert first.vertices is second.vertices
    assert first.faces is second.faces
