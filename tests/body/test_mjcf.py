"""MJCF against MuJoCo: mass, centre, I, L_o, limits and the order of joints; what floats, follows another, or fails."""

from __future__ import annotations

import json
import re
import subprocess
import warnings
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest

import shapephase as sp
from shapephase import child_process
from shapephase.body.engines import engine_tree as asking
from shapephase.body.engines.formats import MJCF, format_of
from shapephase.errors import (
    IgnoredElementWarning,
    ModelFileError,
    ShapeError,
    ShapePhaseError,
    UnknownNameError,
)
from support.damaged_files import mutated
from support.floating_mujoco import FloatingMujoco
from support.hostile_files import GOOD_MJCF
from support.independent import random_loop, random_vector, simulated_motion

pytestmark = pytest.mark.usefixtures("warm_engines")
JOINT = '<joint name="j" axis="1 2 3" pos="0.1 0 0.05" range="-10 10"/>'
INERTIAL = '<inertial pos="0 0.1 0" euler="30 40 50" mass="1" diaginertia="0.02 0.03 0.04"/>'


def mjcf(inside=JOINT + INERTIAL, compiler="", place='euler="10 20 30"', free="<freejoint/>", before=""):
    return (
        f'<mujoco model="m"><compiler {compiler}/>{before}<worldbody><body name="a" pos="1 2 3" quat="0.9 0.1 0.2 0.3">'
        f'{free}<inertial pos="0 0 0.1" mass="2" diaginertia="0.2 0.3 0.4"/>'
        f'<body name="b" pos="0.1 0.2 0.3" {place}>{inside}</body></body></worldbody></mujoco>'
    )


def geom(attributes, compiler=""):
    return mjcf(JOINT + f"<geom {attributes}/>", compiler)


DEFAULTS = """<default><geom size="0.1 0.2 0.3" density="500"/><joint axis="0 1 0" range="-20 30"/>
<default class="x"><geom type="box" size="0.2"/><joint type="slide" range="-1 2"/>
<default class="y"><geom type="ellipsoid" mass="2"/></default></default></default>"""

FILES = {
    "plain": mjcf(),
    "good": GOOD_MJCF,
    "radian": mjcf(compiler='angle="radian"'),
    "degree": mjcf(compiler='angle="degree"'),
    "eulerseq zyx": mjcf(compiler='eulerseq="zyx"'),
    "eulerseq XYZ": mjcf(compiler='eulerseq="XYZ"'),
    "eulerseq ZXz": mjcf(compiler='eulerseq="ZXz"'),
    "axisangle": mjcf(place='axisangle="1 2 3 40"'),
    "axisangle radian": mjcf(place='axisangle="1 2 3 4"', compiler='angle="radian"'),
    "xyaxes": mjcf(place='xyaxes="1 2 3 0 1 0.5"'),
    "zaxis": mjcf(place='zaxis="1 2 3"'),
    "zaxis down": mjcf(place='zaxis="0 0 -2"'),
    "zaxis nearly down": mjcf(place='zaxis="1e-4 0 -1"'),
    "quat of any length": mjcf(place='quat="3 1 2 -1"'),
    "welded": mjcf(INERTIAL),
    "no free joint": mjcf(free=""),
    "free joint by type": mjcf(free='<joint name="root" type="free"/>'),
    "two joints": mjcf(JOINT + '<joint name="k" axis="0 1 0" pos="0 0.1 0"/>' + INERTIAL),
    "three hinges and a slide": mjcf(
        '<joint axis="1 0 0"/><joint axis="0 1 0" pos="1 0 0"/><joint type="slide" axis="1 1 1" pos="2 0 0"/>'
        '<joint axis="0 0 1" pos="0 0 0.3"/>' + INERTIAL
    ),
    "slide": mjcf('<joint name="j" type="slide" axis="1 1 0" pos="1 0 0" range="-1 2"/>' + INERTIAL),
    "unlimited": mjcf('<joint name="j" axis="-1 0 0"/>' + INERTIAL),
    "limited": mjcf('<joint name="j" limited="true" range="-10 20"/>' + INERTIAL, 'autolimits="false"'),
    "not limited": mjcf('<joint name="j" limited="false" range="-10 20"/>' + INERTIAL),
    "no names": mjcf(
        "<joint/>" + INERTIAL + '<body pos="1 0 0"><joint/><geom size="0.1"/></body><body><geom size="0.2"/></body>'
    ),
    "fullinertia": mjcf(JOINT + '<inertial pos="0 0.1 0" mass="1" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>'),
    "sphere": geom('size="0.1"'),
    "sphere by mass": geom('size="0.1" mass="3" pos="0.1 0.2 0.3"'),
    "box": geom('type="box" size="0.05 0.2 0.1" euler="10 20 30" pos="0.1 0 0" density="700"'),
    "ellipsoid": geom('type="ellipsoid" size="0.05 0.2 0.1" euler="10 20 30" pos="0.1 0 0"'),
    "cylinder": geom('type="cylinder" size="0.05 0.2" axisangle="1 1 0 50"'),
    "capsule": geom('type="capsule" size="0.05 0.2" zaxis="1 1 0"'),
    "capsule between points": geom('type="capsule" size="0.05" fromto="0 0 0 0.1 0.2 0.3"'),
    "cylinder between points": geom('type="cylinder" size="0.05" fromto="0.3 0 0 0.1 0.2 -0.3"'),
    "box between points": geom('type="box" size="0.05" fromto="0 0 0 0.1 0.2 0.3"'),
    "ellipsoid between points": geom('type="ellipsoid" size="0.05 0.2" fromto="0 0 0 0.1 0.2 -0.3"'),
    "capsule straight down": geom('type="capsule" size="0.05" fromto="0 0 0.3 0 0 0"'),
    "several geoms": mjcf(
        JOINT + '<geom type="box" size="0.05 0.2 0.1" euler="10 20 30"/><geom size="0.1" mass="1" pos="1 0 0"/>'
    ),
    "geoms beside an inertial": mjcf(JOINT + INERTIAL + '<geom size="0.3"/>'),
    "geoms only": mjcf(JOINT + INERTIAL + '<geom size="0.3"/>', 'inertiafromgeom="true"'),
    "inertials only": mjcf(JOINT + INERTIAL + '<geom size="0.3"/>', 'inertiafromgeom="false"'),
    "inertials only, a geom welded on": mjcf(
        JOINT + INERTIAL + '<body pos="1 0 0"><geom size="0.3"/></body>', 'inertiafromgeom="false"'
    ),
    "massless geom": mjcf(JOINT + INERTIAL + '<geom size="0.3" mass="0"/>'),
    "drawn only": geom('size="0.1" contype="0" conaffinity="0" group="2"', 'discardvisual="true"'),
    "defaults": mjcf('<joint name="j"/><geom/>', before=DEFAULTS),
    "class of an element": mjcf('<joint name="j" class="x"/><geom class="y" size="0.4"/>', before=DEFAULTS),
    "class of children": mjcf(
        '<joint name="j"/><geom/><body childclass="x"><joint name="k"/><geom/><body><geom size="0.1 0.4"/></body>'
        '<body childclass="y"><joint/><geom/><geom class="main"/></body></body>',
        before=DEFAULTS,
    ),
    "fused": mjcf(JOINT + INERTIAL + '<body><geom size="0.2"/></body>', 'fusestatic="true"'),
    "frames": mjcf(
        JOINT + '<frame pos="0 0 1" euler="10 0 0"><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0" euler="0 10 20"/>'
        '<frame quat="1 0 1 0" childclass="x"><geom/><body name="c" pos="1 2 3" zaxis="1 1 0">'
        '<joint name="k"/><geom size="0.1"/>'
        "</body></frame></frame>",
        before=DEFAULTS,
    ),
    "frame in the world": mjcf()
    .replace('<body name="a"', '<frame pos="1 0 0"><body name="a"')
    .replace("</worldbody>", "</frame></worldbody>"),
    "armature is no link": mjcf('<joint name="j" armature="5" damping="1"/>' + INERTIAL),
}


def truth(model, shape, rate):
    """Mass, centre, I, L_o from MuJoCo, with the floating body turned and moved somewhere, in its own axes."""
    data = mujoco.MjData(model)
    moving = [number for number in range(model.njnt) if model.jnt_type[number] != mujoco.mjtJoint.mjJNT_FREE]
    for number, q, v in zip(moving, shape, rate, strict=True):
        data.qpos[model.jnt_qposadr[number]], data.qvel[model.jnt_dofadr[number]] = q, v
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_subtreeVel(model, data)
    axes, centre = data.xmat[1].reshape(3, 3), data.subtree_com[1]
    inertia = np.zeros((3, 3))
    for number in range(1, model.nbody):
        own, arm = data.ximat[number].reshape(3, 3), data.xipos[number] - centre
        inertia += own @ np.diag(model.body_inertia[number]) @ own.T
        inertia += model.body_mass[number] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return (
        model.body_subtreemass[1],
        axes.T @ (centre - data.xpos[1]),
        axes.T @ inertia @ axes,
        axes.T @ data.subtree_angmom[1],
    )


def agree(body, text, seed):
    """Compare with MuJoCo at a random shape and rate."""
    compare(body, mujoco.MjModel.from_xml_string(text), seed)


def compare(body, model, seed):
    random = np.random.default_rng(seed)
    shape, rate = random.uniform(-2.0, 2.0, (2, body.n_shape))
    same_as(body, shape, rate, truth(model, shape, rate))


def same_as(body, shape, rate, expected):
    mass, centre, inertia, momentum = expected
    size = np.abs(inertia).max() + mass * centre @ centre
    assert body.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(body.centre_of_mass(shape), centre, rtol=0, atol=1e-12 * (1.0 + np.abs(centre).max()))
    np.testing.assert_allclose(body.locked_inertia(shape), inertia, rtol=0, atol=1e-12 * size)
    found = body.internal_momentum(shape, rate)
    np.testing.assert_allclose(found, momentum, rtol=0, atol=1e-12 * size * max(np.abs(rate).max(initial=0.0), 1.0) * 3)


@pytest.fixture
def load_mjcf(tmp_path):
    def load(text, **options):
        path = tmp_path / "body.xml"
        path.write_text(text)
        return sp.load_body(path, **options)

    return load


@pytest.fixture(scope="module")
def kept():
    """Bodies of `FILES` that have been loaded."""
    return {}


@pytest.fixture
def file_body(kept, load_mjcf):
    def body_of(name):
        if name not in kept:
            kept[name] = load_mjcf(FILES[name])
        return kept[name]

    return body_of


@pytest.mark.parametrize("name", FILES)
def test_mass_inertia_and_momentum_are_mujoco_s(name, file_body):
    body = file_body(name)
    for seed in range(3):
        agree(body, FILES[name], seed)


@pytest.mark.parametrize("name", FILES)
def test_joints_have_mujoco_s_order_names_limits_and_units(name, file_body):
    body, model = file_body(name), mujoco.MjModel.from_xml_string(FILES[name])
    moving = [number for number in range(model.njnt) if model.jnt_type[number] != mujoco.mjtJoint.mjJNT_FREE]
    assert len(moving) == body.n_shape
    for number, said, (lower, upper), unit in zip(
        moving, body.joint_names, body.joint_limits, body.joint_units, strict=True
    ):
        assert model.joint(number).name in ("", said)
        assert unit == ("m" if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_SLIDE else "rad")
        limits = model.jnt_range[number] if model.jnt_limited[number] else (-np.inf, np.inf)
        np.testing.assert_allclose((lower, upper), limits, rtol=1e-15)


def test_every_body_of_the_file_is_a_link(file_body):
    body = file_body("good")
    assert body.link_names == ("trunk", "arm", "hand")
    assert body.joint_names == ("hip", "twist", "slide")
    assert list(body.continuous) == [False, True, False]
    model = mujoco.MjModel.from_xml_string(GOOD_MJCF)
    data = mujoco.MjData(model)
    data.qpos[7:] = shape = [0.3, -2.0, 0.4]
    mujoco.mj_fwdPosition(model, data)
    base = data.body("trunk").xmat.reshape(3, 3)
    for name in body.link_names:
        pose = body.link_pose(shape, name)
        np.testing.assert_allclose(pose[:3, :3], base.T @ data.body(name).xmat.reshape(3, 3), atol=1e-14, rtol=0)
        np.testing.assert_allclose(
            pose[:3, 3], base.T @ (data.body(name).xpos - data.body("trunk").xpos), atol=1e-14, rtol=0
        )


def test_names_made_up_do_not_depend_on_chance(file_body):
    body = file_body("no names")
    assert body.joint_names == ("b_joint1", "body3_joint1")
    assert body.link_names == ("a", "b", "body3", "body4")


def test_a_motion_of_an_mjcf_body_is_reconstructed(file_body):
    """Momentum is kept by a turn of the base, as for any body."""
    body = file_body("good")
    path = sp.ShapePath.fourier([0.1, 0.2, 0.0], 0.3 * np.ones((3, 1)), 0.2 * np.ones((3, 1)), 1.0)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.1, 0.2])
    times = np.linspace(0.0, 1.0, 7)
    turned = motion.attitude(times) @ (
        body.locked_inertia(path.shape(times)) @ motion.angular_velocity(times)[..., None]
        + body.internal_momentum(path.shape(times), path.rate(times))[..., None]
    )
    np.testing.assert_allclose(turned[..., 0], np.tile([0.0, 0.1, 0.2], (7, 1)), atol=1e-9, rtol=0)


def test_a_joint_counts_from_its_reference(load_mjcf):
    """Of a hinge and of a slide: at `ref` the bodies are where the file has them."""
    text = mjcf(
        '<joint name="j" axis="1 2 3" pos="0.1 0 0.05" ref="20"/><joint name="k" type="slide" ref="0.3"/>' + INERTIAL
    )
    body = load_mjcf(text)
    for seed in range(3):
        agree(body, text, seed)
    model = mujoco.MjModel.from_xml_string(text)
    pose = body.link_pose(model.qpos0[7:], "b")
    np.testing.assert_allclose(pose[:3, 3], model.body_pos[2], atol=4e-16, rtol=0)


def test_meshes_replicas_and_settings_that_change_masses_are_mujoco_s(load_mjcf):
    text = mjcf(
        '<frame pos="0 0 1" euler="10 0 0"><body name="c"><joint name="k"/><geom type="mesh" mesh="m"/></body></frame>'
        + JOINT
        + INERTIAL
        + '<replicate count="3" offset="0.1 0 0" euler="0 0 20"><geom size="0.1"/></replicate>',
        'settotalmass="7" balanceinertia="true"',
        before='<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>',
    )
    body = load_mjcf(text)
    assert body.joint_names == ("j", "k")
    assert body.mass == pytest.approx(7.0, rel=1e-14)
    agree(body, text, 1)


def test_parts_of_other_files(tmp_path):
    """An include, a model that is attached, and a mesh in a folder of its own."""
    corners, faces = [(0, 0, 0), (0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.3)], [(1, 3, 2), (1, 2, 4), (1, 4, 3), (2, 3, 4)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (tmp_path / "shapes").mkdir()
    (tmp_path / "shapes" / "wedge.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "arm.xml").write_text(
        f'<mujocoinclude><body name="arm" pos="0 0 1">{JOINT}{INERTIAL}</body></mujocoinclude>'
    )
    (tmp_path / "hand.xml").write_text(
        '<mujoco model="hand"><worldbody><body name="palm"><joint name="twist"/><geom size="0.1"/></body></worldbody>'
        "</mujoco>"
    )
    path = tmp_path / "whole.xml"
    path.write_text(
        '<mujoco><compiler meshdir="shapes"/><asset><mesh name="wedge" file="wedge.obj"/>'
        '<model name="hand" file="hand.xml"/></asset><worldbody><body name="base"><freejoint/>'
        '<geom type="mesh" mesh="wedge"/><include file="arm.xml"/>'
        '<frame pos="1 0 0"><attach model="hand" body="palm" prefix="left_"/></frame></body></worldbody></mujoco>'
    )
    body = sp.load_body(path)
    assert body.joint_names == ("j", "left_twist")
    assert body.link_names == ("base", "arm", "left_palm")
    compare(body, mujoco.MjModel.from_xml_path(str(path)), 1)


def test_what_is_given_for_a_mistake_in_an_included_file(tmp_path):
    (tmp_path / "part.xml").write_text('<mujocoinclude>\n\n<body name="arm"><joint axis="0 0"/></body></mujocoinclude>')
    path = tmp_path / "whole.xml"
    path.write_text('<mujoco>\n<worldbody><body><include file="part.xml"/></body></worldbody></mujoco>')
    with pytest.raises(ModelFileError, match=r"whole\.xml"):
        sp.load_body(path)


# ---- What floats ----------------------------------------------------------------------------------------------------

WALKER = """<mujoco><worldbody><body name="torso" pos="0 0 1.3">
<joint name="rootx" type="slide" axis="1 0 0"/><joint name="rootz" type="slide" axis="0 0 1" ref="1.3"/>
<joint name="rooty" axis="0 1 0"/><geom type="capsule" size="0.07 0.3"/>
<body name="leg" pos="0 0 -0.3"><joint name="hip" axis="0 -1 0"/><geom type="capsule" size="0.05 0.3" pos="0 0 -0.3"/>
<body name="foot" pos="0 0 -0.6"><joint name="ankle" axis="0 -1 0"/><geom size="0.06" pos="0.1 0 0"/></body></body>
</body>{}</worldbody>{}</mujoco>"""


def test_the_joints_of_a_planar_walker_in_the_world_are_its_free_base(load_mjcf):
    text = WALKER.format("", "")
    with pytest.warns(IgnoredElementWarning, match="'rootx'"):
        body = load_mjcf(text)
    assert body.joint_names == ("hip", "ankle")
    assert load_mjcf(text, root="free").base_joints[0].name == "rootx"
    free = re.sub(r"<joint name=\"root.*?/>", "", text.replace("\n", " "))
    agree(body, free, 1)


def test_one_of_several_trees_is_named(load_mjcf):
    """A free ball beside a free body; a pole that stands; and a part of the body alone."""
    ball = '<body name="ball"><freejoint/><geom size="0.1"/></body><body name="pole"><geom size="0.1"/></body>'
    text = WALKER.format(ball, "").replace('<joint name="rootx" type="slide" axis="1 0 0"/>', "")
    with pytest.raises(ModelFileError, match="'ball'"):
        load_mjcf(text)
    assert load_mjcf(text, root_body="ball").n_shape == 0
    assert load_mjcf(text, root_body="torso", root="free").joint_names == ("hip", "ankle")
    with pytest.raises(ModelFileError, match="'leg'"):
        load_mjcf(text, root_body="leg")
    leg = load_mjcf(text, root_body="leg", root="free")
    assert (leg.link_names, leg.joint_names) == (("leg", "foot"), ("ankle",))


def test_what_floats_is_a_question_of_files_with_a_world(load_mjcf):
    with pytest.raises(ShapeError, match="root_body"):
        sp.load_body("cat", root_body="base")
    with pytest.raises(ShapeError, match=r"pinocchio\.Model"):
        sp.load_body(pinocchio.Model(), root="free")
    assert sp.load_body("cat", root="free").joint_names == sp.load_body("cat").joint_names
    with pytest.raises(UnknownNameError, match="'fixed'"):
        load_mjcf(GOOD_MJCF, root="fixed")


# ---- Joints that follow others --------------------------------------------------------------------------------------

THREE = (
    '<joint name="j" axis="1 2 3" ref="20" range="-60 60"/><joint name="k" type="slide" axis="1 1 0" ref="0.2"/>'
    '<joint name="l" axis="0 1 0" pos="0.1 0 0"/>' + INERTIAL
)


def followed(*equalities):
    return mjcf(THREE).replace("</mujoco>", f"<equality>{''.join(equalities)}</equality></mujoco>")


def test_a_joint_follows_another_by_a_polynomial(load_mjcf):
    """A knee that slides as it bends, and a third that follows the slide; one is locked."""
    text = followed(
        '<joint joint1="k" joint2="j" polycoef="0.1 0.5 -0.3 0.2 0.1"/>',
        '<joint joint1="l" joint2="k" polycoef="0.3 -2 0.7 0 0"/>',
    )
    body, model = load_mjcf(text), mujoco.MjModel.from_xml_string(text)
    assert body.joint_names == ("j",)
    here = model.qpos0[7:]
    knee, third = (np.polynomial.Polynomial(model.eq_data[k, :5]) for k in (0, 1))
    for value, rate in ((0.4, 1.0), (-0.7, -2.0)):
        slide, speed = here[1] + knee(value - here[0]), knee.deriv()(value - here[0]) * rate
        turn, spin = here[2] + third(slide - here[1]), third.deriv()(slide - here[1]) * speed
        same_as(body, [value], [rate], truth(model, [value, slide, turn], [rate, speed, spin]))
    locked = followed(
        '<joint joint1="k" polycoef="0.1 0 0 0 0"/>', '<joint joint1="l" joint2="k" polycoef="0.3 9 0 0 0"/>'
    )
    body, model = load_mjcf(locked), mujoco.MjModel.from_xml_string(locked)
    values = [0.4, here[1] + 0.1, here[2] + 0.3 + 0.9]
    same_as(body, [0.4], [1.5], truth(model, values, [1.5, 0.0, 0.0]))


def test_a_coupled_floating_motion_is_mujoco_s(load_mjcf, tmp_path):
    """MuJoCo's floating-base dynamics know no law of conservation; a slide and a hinge follow by their polynomials."""
    text = followed(
        '<joint joint1="k" joint2="j" polycoef="0.1 0.5 -0.3 0.2 0.1"/>',
        '<joint joint1="l" joint2="k" polycoef="0.3 -2 0.7 0 0"/>',
    )
    body = load_mjcf(text)
    loop = random_loop(7, body.n_shape, duration=1.0, harmonics=1)
    momentum = random_vector(7, np.trace(body.locked_inertia(body.shape())) / 3.0)
    times = np.linspace(0.0, 1.0, 6)
    expected = simulated_motion(FloatingMujoco(tmp_path / "body.xml"), loop, momentum, None, times).attitude
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, tolerance=1e-11)
    np.testing.assert_allclose(motion.attitude(times), expected, rtol=0, atol=1e-9)


BALL = mjcf('<joint name="k" axis="1 2 3" pos="0 0.1 0"/><joint name="j" type="ball" pos="0.1 0 0.05"/>' + INERTIAL)


def test_a_ball_joint_is_mujoco_s(load_mjcf, tmp_path):
    """Beside a hinge of the same body, about another place; its range is told and ignored."""
    body = load_mjcf(BALL)
    assert body.joint_names == ("k", "j.x", "j.y", "j.z", "j.w")
    same = FloatingMujoco(tmp_path / "body.xml")
    for seed in range(3):
        random = np.random.default_rng(seed)
        shape, rate = random.normal(size=(2, 5))
        same.place(np.zeros(3), np.eye(3), shape)
        same.move(np.zeros(3), np.zeros(3), rate)
        centre, inertia = body.centre_of_mass(shape), body.locked_inertia(shape)
        np.testing.assert_allclose(centre, same.centre_of_mass(), rtol=0, atol=1e-13)
        np.testing.assert_allclose(inertia, same.locked_inertia(), rtol=0, atol=1e-13)
        momentum = body.internal_momentum(shape, rate)
        np.testing.assert_allclose(momentum, same.momentum_about_centre(), rtol=0, atol=1e-12 * np.abs(rate).sum())
    with pytest.warns(IgnoredElementWarning, match="'j'"):
        load_mjcf(BALL.replace('type="ball"', 'type="ball" range="0 30"'))


def test_a_floating_motion_with_a_ball_joint_is_mujoco_s(load_mjcf, tmp_path):
    """As above; the ball goes round its whole group, its four numbers along a Fourier series of any length."""
    body = load_mjcf(BALL)
    loop = random_loop(7, body.n_shape, duration=1.0, harmonics=1)
    loop = replace(loop, mean=loop.mean + np.eye(5)[4])
    momentum = random_vector(7, np.trace(body.locked_inertia(body.shape())) / 3.0)
    times = np.linspace(0.0, 1.0, 6)
    expected = simulated_motion(FloatingMujoco(tmp_path / "body.xml"), loop, momentum, None, times).attitude
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, tolerance=1e-11)
    np.testing.assert_allclose(motion.attitude(times), expected, rtol=0, atol=1e-9)


# ---- What fails -----------------------------------------------------------------------------------------------------


@pytest.fixture
def good_file(tmp_path):
    path = tmp_path / "body.xml"
    path.write_text(GOOD_MJCF)
    return path


def test_a_process_of_its_own_reads_it_and_leaves_nothing(good_file, tmp_path, monkeypatch):
    """The only test here that starts one: MuJoCo does not enter this process, nor does its log the current folder."""
    monkeypatch.setattr(asking, "run_alone", child_process.run_alone)
    monkeypatch.chdir(tmp_path)
    good_file.write_text(GOOD_MJCF.replace("<worldbody>", '<custom><text name="NaN" data="nan"/></custom><worldbody>'))
    assert sp.load_body(good_file.name).n_shape == 3
    assert [path.name for path in tmp_path.iterdir()] == ["body.xml"]


@pytest.mark.full
@pytest.mark.parametrize(
    "inside",
    [
        '<replicate count="1000000000" offset="1 0 0"><body><joint/><geom size="0.1"/></body></replicate>',
        '<replicate count="30000"><replicate count="30000"><geom size="0.1"/></replicate></replicate>',
    ],
)
def test_replicas_without_end_are_stopped(load_mjcf, monkeypatch, inside):
    monkeypatch.setattr(asking, "run_alone", child_process.run_alone)
    monkeypatch.setattr(asking, "_SECONDS", 5.0)
    with pytest.raises(ModelFileError, match="mujoco"):
        load_mjcf(mjcf(INERTIAL + JOINT + inside))


def test_numbers_that_are_not_mujoco_s_are_not_handed_out(load_mjcf, monkeypatch):
    """A centre, and a momentum, that are off by 1e-9."""
    real = asking.run_alone
    for what in ("mass", "centre", "inertia", "momentum"):

        def changed(*arguments, what=what):
            done = real(*arguments)
            said = json.loads(done.stdout)
            said["poses"][1][what] = (np.array(said["poses"][1][what]) + 1e-9).tolist()
            return subprocess.CompletedProcess([], 0, json.dumps(said).encode(), b"")

        monkeypatch.setattr(asking, "run_alone", changed)
        with pytest.raises(ModelFileError, match=f"another {what} than the engine"):
            load_mjcf(GOOD_MJCF)


def test_an_mjcf_is_told_by_its_content(tmp_path):
    path = tmp_path / "body.urdf"
    path.write_text("\ufeff<?xml version='1.0'?><!-- <robot> -->\n" + GOOD_MJCF)
    assert sp.load_body(path).joint_names == ("hip", "twist", "slide")
    assert format_of(path.read_bytes()) == MJCF
    assert format_of(b"<!-- <mujoco> --><robot/>") is None
    path.write_text(f"<!-- {'x' * 70_000} -->{GOOD_MJCF}")
    assert sp.load_body(path).n_shape == 3


@pytest.mark.parametrize("first", [0, pytest.param(1000, marks=pytest.mark.full)])
def test_damaged_files_that_load_are_what_mujoco_reads(first, load_mjcf):
    """Whatever MuJoCo reads too is the same body; what it refuses need not be."""
    both, count = 0, 24 if first == 0 else 4000
    for seed in range(first, first + count):
        content = mutated(GOOD_MJCF.encode(), seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                text = content.decode()
                body = load_mjcf(text)
            except (ShapePhaseError, UnicodeDecodeError):
                continue
        try:
            model = mujoco.MjModel.from_xml_string(re.sub("<!--.*?-->", "", text))
        except ValueError:
            continue
        if model.nbody > 1 and model.nv - 6 * (model.njnt - body.n_shape) == body.n_shape:
            agree(body, text, seed)
            both += 1
    assert both > 0.1 * count
