"""Distances between links against MuJoCo's, their derivatives against differences, and which pairs count."""

from __future__ import annotations

import pickle
import re
import warnings

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from shapephase.errors import NoCollisionGeometryError, UnknownNameError, VisualWarning
from support.bodies import joint, link, urdf

LONGEST = 100.0  # [m] no distance is longer
MJCF = """<mujoco><worldbody><body name="a"><freejoint/><geom type="ellipsoid" size="0.1 0.2 0.3"/>
<body name="b" pos="0.6 0 0"><joint name="ball" type="ball"/><geom type="box" size="0.1 0.05 0.1"/>
<body name="c" pos="0.4 0 0"><joint name="hinge" axis="0 1 0.3"/><geom type="capsule" size="0.05 0.1"/>
<geom type="sphere" size="0.2" pos="0.3 0 0" contype="0" conaffinity="0" mass="0"/>
<body name="d" pos="0.4 0.1 0"><joint name="after" axis="0 0 1"/><geom type="cylinder" size="0.06 0.1"/></body></body>
</body></body></worldbody>
<equality><joint joint1="after" joint2="hinge" polycoef="0.2 0.7 0.3 0 0"/></equality></mujoco>"""


def spheres(radius=0.1, gap=0.5):
    """A row of three links with a sphere each, `gap` apart, jointed about z."""
    ball = f'<collision><geometry><sphere radius="{radius}"/></geometry></collision>'
    drawn = '<visual><geometry><box size="9 9 9"/></geometry></visual>'
    links = [link(name, 1.0, [0.01, 0.02, 0.02]).replace("</link>", f"{ball}{drawn}</link>") for name in "abc"]
    joints = [joint(f"j{c}", "continuous", p, c, xyz=(gap, 0, 0)) for p, c in ("ab", "bc")]
    return urdf(*links, *joints)


def mujoco_distances(body, shapes, pairs):
    """Least distances of MuJoCo's own reading of a URDF, whose root is its world."""
    setting = (
        '<mujoco><compiler discardvisual="false" fusestatic="false" boundmass="1e-3" boundinertia="1e-6" '
        'balanceinertia="true"/></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(re.sub(r"(<robot[^>]*>)", rf"\1{setting}", body.file.read_text(), count=1))
    model.opt.ccd_tolerance, model.opt.ccd_iterations = 1e-12, 1000
    data = mujoco.MjData(model)
    owners = [body.link_names[0] if not number else model.body(number).name for number in model.geom_bodyid]
    places = [model.joint(name).qposadr[0] for name in body.joint_names]
    result = np.empty((len(shapes), len(pairs)))
    for row, shape in enumerate(shapes):
        data.qpos[places] = shape
        mujoco.mj_kinematics(model, data)
        for column, (first, second) in enumerate(pairs):
            result[row, column] = min(
                mujoco.mj_geomDistance(model, data, i, j, LONGEST, np.zeros(6))
                for i, one in enumerate(owners)
                for j, other in enumerate(owners)
                if (one, other) == (first, second)
            )
    return result


@pytest.mark.parametrize("name", ["cat", "astronaut", "astronaut_suited", "satellite", "diver"])
@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.full)])
def test_distances_are_those_of_mujoco(name, count, rng):
    body = sp.load_body(name)
    shapes = rng.uniform(-1.0, 1.0, (count, body.n_shape))
    distances = sp.body.link_distances(body, shapes)
    expected = mujoco_distances(body, shapes, distances.pairs)
    np.testing.assert_allclose(distances.distance[expected > 0.0], expected[expected > 0.0], rtol=0, atol=1e-7)
    # Both find depths to 1e-6.
    np.testing.assert_allclose(distances.distance, expected, rtol=0, atol=1e-5)
    assert name == "satellite" or (distances.distance < 0.0).any()
    gaps = np.linalg.norm(distances.points[..., 0, :] - distances.points[..., 1, :], axis=-1)
    np.testing.assert_allclose(gaps, np.abs(distances.distance), atol=1e-5)


@pytest.mark.parametrize("name", ["cat", "satellite", "balls and followers"])
def test_derivatives_are_those_of_the_distances(name, rng, tmp_path):
    """Central differences; where faces are parallel distances have kinks, which random postures miss."""
    file = tmp_path / "a.xml"
    file.write_text(MJCF)
    body = sp.load_body(file if " " in name else name)
    step, shapes = 1e-5, body.shape() + rng.uniform(-0.7, 0.7, (12, body.n_shape))
    distances = sp.body.link_distances(body, shapes)
    for column, unit in enumerate(np.eye(body.n_shape)):
        ahead, behind = (sp.body.link_distances(body, shapes + s * step * unit).distance for s in (1.0, -1.0))
        off = np.abs((ahead - behind) / (2.0 * step) - distances.slopes[..., column])
        # EPA is accurate to 1e-6 m only.
        assert off[distances.distance > 0.0].max() < 1e-4
        assert np.median(off) < 2e-6


def test_distances_of_spheres_in_a_row(load_urdf):
    body = load_urdf(spheres())
    geometry = sp.body.collision_geometry(body)
    assert geometry.pairs == (("a", "c"),)
    assert geometry.left_out == (("a", "b", "adjacent"), ("b", "c", "adjacent"))
    angles = np.array([0.0, 0.5, 2.5, np.pi - 0.1])
    distances = sp.body.link_distances(body, np.stack([angles, 0.3 * angles], axis=-1))
    np.testing.assert_allclose(distances.distance[:, 0], np.cos(0.5 * angles) - 0.2, atol=1e-12)
    np.testing.assert_allclose(distances.slopes[:, 0, 0], -0.5 * np.sin(0.5 * angles), atol=1e-9)
    np.testing.assert_allclose(distances.slopes[:, 0, 1], 0.0, atol=1e-12)
    assert sp.body.link_distances(body, np.zeros((2, 0, 2))).distance.shape == (2, 0, 1)
    kept = pickle.loads(pickle.dumps(geometry))
    assert sp.body.link_distances(body, [2.0, 0.1], geometry=kept).distance == pytest.approx(np.cos(1.0) - 0.2)


def test_links_that_overlap_at_rest_and_those_of_an_srdf_do_not_count(load_urdf, tmp_path):
    overlapping = sp.body.collision_geometry(load_urdf(spheres(radius=0.55)))
    assert overlapping.pairs == ()
    assert overlapping.left_out[-1] == ("a", "c", "overlap at rest")
    body, srdf = load_urdf(spheres()), tmp_path / "a.srdf"
    srdf.write_text('<robot name="r"><disable_collisions link1="c" link2="a" reason="Never"/></robot>')
    disabled = sp.body.collision_geometry(body, srdf=srdf)
    assert (disabled.pairs, disabled.left_out[-1]) == ((), ("a", "c", "SRDF"))
    srdf.write_text('<robot name="r"><disable_collisions link1="c" link2="aa"/></robot>')
    with pytest.raises(UnknownNameError, match="Did you mean 'a'"):
        sp.body.collision_geometry(body, srdf=srdf)
    assert len(sp.body.collision_geometry(body).pairs) == 1


def test_links_over_a_link_without_mass_are_adjacent():
    geometry = sp.body.collision_geometry(sp.load_body("cat_two_halves"))
    assert (geometry.pairs, geometry.left_out) == ((), (("front", "rear", "adjacent"),))


def test_colliding_geoms_of_mjcf_count_and_those_that_are_only_drawn_do_not(tmp_path):
    file = tmp_path / "a.xml"
    file.write_text(MJCF)
    kinds = [solid.kind for solid in sp.body.collision_geometry(sp.load_body(file)).solids]
    assert kinds == ["ellipsoid", "box", "capsule", "cylinder"]
    file.write_text(re.sub('type="(ellipsoid|box|capsule|cylinder)"', r'\g<0> contype="0" conaffinity="0"', MJCF))
    assert len(sp.body.collision_geometry(sp.load_body(file)).solids) == 5


def test_a_link_whose_mesh_is_missing_is_left_out(load_urdf):
    mesh = '<collision><geometry><mesh filename="none.stl"/></geometry></collision>'
    body = load_urdf(spheres().replace("</link>", f"{mesh}</link>", 1))
    with pytest.warns(VisualWarning, match=r"none.stl.* is not found; links of body left out.*: a$"):
        geometry = sp.body.collision_geometry(body)
    assert (geometry.missing, geometry.pairs, len(geometry.solids)) == (("a",), (), 2)


def test_a_mesh_counts_as_its_convex_hull(load_urdf, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    # A cup open towards the others: its hull is closed.
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 0] < 0.5]).export(tmp_path / "cup.stl")
    text = spheres().replace('<sphere radius="0.1"/>', f'<mesh filename="{tmp_path}/cup.stl"/>', 1)
    body = load_urdf(text)
    distances = sp.body.link_distances(body, [0.0, 0.0])
    np.testing.assert_allclose(distances.distance, [1.0 - 0.2], atol=1e-9)
    assert sp.body.collision_geometry(body).solids[0].kind == "mesh"


def test_a_body_without_shapes_is_refused():
    model = pin.buildModelFromUrdf(str(sp.load_body("cat").file), pin.JointModelFreeFlyer())
    with pytest.raises(NoCollisionGeometryError, match=r"has no shapes.*URDF or MJCF"):
        sp.body.link_distances(sp.load_body(model), np.zeros(23))


def test_wrong_shapes_and_geometries_are_refused():
    body = sp.load_body("diver")
    with pytest.raises(sp.errors.ShapeError, match=r"expected \(..., 2\).*got shape \(3,\)"):
        sp.body.link_distances(body, np.zeros(3))
    with pytest.raises(sp.errors.WrongObjectError, match="CollisionGeometry is needed"):
        sp.body.link_distances(body, np.zeros(2), geometry=body)


def test_deep_overlaps_have_a_finite_depth(load_urdf):
    """Spheres, boxes and cylinders in one place: EPA of coal fails on some to tight tolerances."""
    for shape in ('<box size="0.2 0.3 0.4"/>', '<cylinder radius="0.1" length="0.3"/>', '<sphere radius="0.2"/>'):
        body = load_urdf(spheres(gap=0.6).replace('<sphere radius="0.1"/>', shape))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            depth = sp.body.link_distances(body, [[angle, 0.0] for angle in np.linspace(3.0, np.pi, 50)]).distance
        assert -1.0 < depth.min() < -0.1
