"""MJCF against MuJoCo: mass, centre of mass, I, L_o, limits and the order of joints, or the file is refused."""

from __future__ import annotations

import re
import warnings

import mujoco
import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ModelFileError, ShapePhaseError
from support.damaged_files import mutated
from support.hostile_files import GOOD_MJCF

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
    model = mujoco.MjModel.from_xml_string(text)
    random = np.random.default_rng(seed)
    shape, rate = random.uniform(-2.0, 2.0, (2, body.n_shape))
    mass, centre, inertia, momentum = truth(model, shape, rate)
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


@pytest.mark.parametrize("name", FILES)
def test_mass_inertia_and_momentum_are_mujoco_s(name, load_mjcf):
    body = load_mjcf(FILES[name])
    for seed in range(3):
        agree(body, FILES[name], seed)


@pytest.mark.parametrize("name", FILES)
def test_joints_have_mujoco_s_order_names_limits_and_units(name, load_mjcf):
    body, model = load_mjcf(FILES[name]), mujoco.MjModel.from_xml_string(FILES[name])
    moving = [number for number in range(model.njnt) if model.jnt_type[number] != mujoco.mjtJoint.mjJNT_FREE]
    assert len(moving) == body.n_shape
    for number, said, (lower, upper), unit in zip(
        moving, body.joint_names, body.joint_limits, body.joint_units, strict=True
    ):
        assert model.joint(number).name in ("", said)
        assert unit == ("m" if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_SLIDE else "rad")
        limits = model.jnt_range[number] if model.jnt_limited[number] else (-np.inf, np.inf)
        np.testing.assert_allclose((lower, upper), limits, rtol=1e-15)


def test_every_body_of_the_file_is_a_link(load_mjcf):
    body = load_mjcf(GOOD_MJCF)
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


def test_names_made_up_do_not_depend_on_chance(load_mjcf):
    body = load_mjcf(FILES["no names"])
    assert body.joint_names == ("b_joint1", "body3_joint1")
    assert body.link_names == ("a", "b", "body3", "body4")


def test_a_motion_of_an_mjcf_body_is_reconstructed(load_mjcf):
    """Momentum is kept by a turn of the base, as for any body."""
    body = load_mjcf(GOOD_MJCF)
    path = sp.ShapePath.fourier([0.1, 0.2, 0.0], 0.3 * np.ones((3, 1)), 0.2 * np.ones((3, 1)), 1.0)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.1, 0.2])
    times = np.linspace(0.0, 1.0, 7)
    turned = motion.attitude(times) @ (
        body.locked_inertia(path.shape(times)) @ motion.angular_velocity(times)[..., None]
        + body.internal_momentum(path.shape(times), path.rate(times))[..., None]
    )
    np.testing.assert_allclose(turned[..., 0], np.tile([0.0, 0.1, 0.2], (7, 1)), atol=1e-9, rtol=0)


def test_what_mujoco_writes_out_is_read(load_mjcf, tmp_path):
    """The way out that refusals name: meshes and includes are gone from the saved file."""
    text = mjcf(
        '<frame pos="0 0 1" euler="10 0 0"><body name="c"><joint name="k"/><geom type="mesh" mesh="m"/></body></frame>'
        + JOINT
        + INERTIAL,
        'saveinertial="true"',
        before='<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>',
    )
    with pytest.raises(ModelFileError, match=r"body 'c': a geom of type 'mesh' with mass"):
        load_mjcf(text)
    model = mujoco.MjModel.from_xml_string(text)
    mujoco.mj_saveLastXML(str(tmp_path / "plain.xml"), model)
    saved = (tmp_path / "plain.xml").read_text()
    body = load_mjcf(saved)
    assert body.joint_names == ("j", "k")
    agree(body, saved, 1)


@pytest.mark.parametrize("first", [0, pytest.param(1000, marks=pytest.mark.full)])
def test_damaged_files_that_load_are_what_mujoco_reads(first, load_mjcf):
    """Whatever MuJoCo reads too is the same body; what it refuses need not be."""
    both = 0
    for seed in range(first, first + (150 if first == 0 else 4000)):
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
    assert both > 20
