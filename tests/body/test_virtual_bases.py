"""Bases moved by joints from a world without mass: attitude, place and split of what MuJoCo itself simulates."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import quad

import shapephase as sp
from shapephase.errors import IgnoredElementWarning, ModelFileError, TrajectoryError

pytestmark = pytest.mark.usefixtures("warm_engines")
CASES = Path(__file__).parents[1] / "cases"
HEAVY = '<inertial><origin xyz="0.02 -0.01 0.1"/><mass value="4"/><inertia ixx="0.09" iyy="0.08" izz="0.03" ixy="0.004" ixz="0" iyz="0"/></inertial>'  # noqa: E501
LIGHT = '<inertial><origin xyz="0 0.05 -0.2"/><mass value="1"/><inertia ixx="0.02" iyy="0.03" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501
LEG = '<joint name="hip" type="continuous"><parent link="trunk"/><child link="leg"/><origin xyz="0.1 0.2 0" rpy="0.4 0 0.3"/><axis xyz="1 2 2"/></joint>'  # noqa: E501
PARTS = f'<link name="trunk">{HEAVY}</link><link name="leg">{LIGHT}</link>{LEG}'
LIMIT = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
DURATION, STEPS = 1.0, 400


def joint(name, kind, parent, child, axis="0 0 1", origin=""):
    """An element of a URDF."""
    more = "" if kind in ("fixed", "floating") else f'<axis xyz="{axis}"/>'
    limit = LIMIT if kind in ("prismatic", "revolute") else ""
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<origin {origin}/>{more}{limit}</joint>'


def chain(*steps, body=PARTS):
    """A URDF with joints (name, kind, axis, origin) from the world to its trunk."""
    links = ["world", *(f"step{k}" for k in range(1, len(steps))), "trunk"]
    text = "".join(f'<link name="{name}"/>' for name in links[:-1]) + body
    for (name, kind, axis, origin), parent, child in zip(steps, links, links[1:], strict=False):
        text += joint(name, kind, parent, child, axis, origin)
    return f'<robot name="r">{text}</robot>'


SIX = (
    ("px", "prismatic", "1 0 0", ""),
    ("py", "prismatic", "0 1 0", 'xyz="0.3 0 0"'),
    ("pz", "prismatic", "0 0 1", ""),
    ("yaw", "continuous", "0 0 1", 'rpy="0.2 0.1 -0.3"'),
    ("mount", "fixed", "", 'xyz="0 0.1 0" rpy="0 0 1.1"'),
    ("pitch", "revolute", "0 1 0", 'xyz="0 0 0.05"'),
    ("roll", "continuous", "1 1 0", ""),
)
MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="rail" pos="0.1 0 0.5" euler="0 0 1">
<body name="trunk" euler="0.3 0.1 0"><joint name="px" type="slide" axis="1 0 0"/>
<joint name="py" type="slide" axis="0 1 0"/><joint name="pz" type="slide" axis="0 0 1" ref="0.4"/>
<joint name="yaw" axis="0 0 1" pos="0.1 0 0"/><joint name="pitch" axis="0 1 0"/>
<inertial pos="0.02 0 0.1" mass="4" diaginertia="0.09 0.08 0.03"/><body name="leg" pos="0.1 0.2 0">
<joint name="hip" axis="1 2 2"/><inertial pos="0 0.05 -0.2" mass="1" diaginertia="0.02 0.03 0.015"/></body></body>
</body></worldbody></mujoco>"""
FILES = {
    "six.urdf": (chain(*SIX), ("px", "py", "pz", "yaw", "pitch", "roll")),
    "two_hinges.urdf": (chain(SIX[3], SIX[6]), ("yaw", "roll")),
    "planar.urdf": (chain(("float", "planar", "0 1 0", 'xyz="0 0 1"')), ("float_TX", "float_TY", "float_RZ")),
    "hinge.urdf": (chain(("turn", "continuous", "1 2 3", 'rpy="0.1 0.2 0.3"')), ("turn",)),
    "plane.xml": (MJCF, ("px", "py", "pz", "yaw", "pitch")),
    "ball.xml": (
        MJCF.replace('<joint name="yaw" axis="0 0 1" pos="0.1 0 0"/><joint name="pitch" axis="0 1 0"/>',
                     '<joint name="round" type="ball"/>'),
        ("px", "py", "pz", "round.w", "round.x", "round.y", "round.z"),
    ),
}  # fmt: skip
SINGLE = ("planar.urdf", "hinge.urdf")


def simulated(path, names, file):
    """The body swings its leg in MuJoCo, without momentum at first; xmat and xpos. The file has all of qpos."""
    # Of what moves, MuJoCo wants some mass: a part in 10^10 of the body's.
    moments = 'ixx="1e-12" iyy="1e-12" izz="1e-12" ixy="0" ixz="0" iyz="0"'
    dust = f'<inertial><mass value="5e-10"/><inertia {moments}/></inertial>'
    text = re.sub(r'<link name="(step.)"/>', rf'<link name="\1">{dust}</link>', path.read_text())
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.gravity[:] = 0.0
    model.opt.timestep, model.opt.integrator = DURATION / STEPS, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    body, hip = model.body("trunk").id, model.joint("hip").dofadr[0]
    rows = []
    for step in range(STEPS + 1):
        mujoco.mj_forward(model, data)
        rows.append((data.time, data.qpos.copy(), data.xmat[body].reshape(3, 3).copy(), data.xpos[body].copy()))
        data.qfrc_applied[hip] = 2.0 * np.cos(2.0 * np.pi * step / STEPS)
        mujoco.mj_step(model, data)
    times, qpos, turned, placed = (np.array(each) for each in zip(*rows, strict=True))
    header = ",".join(["time", *names, "hip"])
    np.savetxt(file, np.column_stack([times, qpos]), delimiter=",", header=header, comments="", fmt="%.17g")
    return turned, placed


@pytest.mark.parametrize("name", FILES)
def test_the_base_is_where_mujoco_has_it(name, tmp_path):
    text, names = FILES[name]
    path, file = tmp_path / name, tmp_path / "run.csv"
    path.write_text(text)
    turned, placed = simulated(path, names, file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        body = sp.load_body(path, root="free" if name in SINGLE else None)
    assert [str(one.message) for one in caught if "are the free base" in str(one.message)] == [
        str(one.message) for one in caught
    ]
    assert len(caught) == (name not in SINGLE)
    assert (body.joint_names, body.mass, body.link_names) == (("hip",), 5.0, ("trunk", "leg"))
    recorded = sp.read_recorded_motion(file, body)
    np.testing.assert_allclose(recorded.base_attitude, turned, atol=1e-12)
    if any(part in names for part in ("px", "float_TX")):
        np.testing.assert_allclose(recorded.base_position, placed, atol=1e-12)
    else:
        assert recorded.base_position is None
    assert np.linalg.norm(turned[-1] - turned[0]) > 0.05


@pytest.mark.parametrize("name", ["six.urdf", "ball.xml"])
def test_a_body_free_to_turn_turns_as_mujoco_says(name, tmp_path):
    """Three slides: without pushes the momentum about the centre of mass is zero and stays so."""
    text, names = FILES[name]
    path, file = tmp_path / name, tmp_path / "run.csv"
    path.write_text(text)
    turned, _ = simulated(path, names, file)
    with pytest.warns(IgnoredElementWarning, match="free"):
        body = sp.load_body(path)
    motion = sp.reconstruct(sp.articulated(body, sp.read_shape_path(file, body)), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(sp.split(motion).total_rotation, turned[0].T @ turned[-1], atol=1e-7)


def test_a_planar_walker_turns_by_closed_form():
    """About one axis, theta' = -J/I of the leg's angle, from two inertias about the common centre of mass."""
    with pytest.warns(IgnoredElementWarning, match="'root_x'"):
        body = sp.load_body(CASES / "planar_walker.urdf")
    angles = 0.8 * (1.0 - np.cos(np.linspace(0.0, np.pi, 101)))

    # Both hang on one hinge: reduced mass 0.8, arms 0.1 up and 0.2 down from it.
    def rate(angle, *_):
        d = np.array([-0.2 * np.sin(angle), -0.2 * np.cos(angle) - 0.1])
        slope = np.array([-0.2 * np.cos(angle), 0.2 * np.sin(angle)])
        carried = 0.02 + 0.8 * (d[1] * slope[0] - d[0] * slope[1])
        return -carried / (0.1 + 0.8 * d @ d)

    turned = quad(rate, 0.0, angles[-1], epsabs=1e-13)[0]
    times = np.linspace(0.0, 1.0, 101)
    path = sp.ShapePath.spline(times, angles[:, None], joint_names=["hip"])
    found = sp.split(sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0])).total_rotation
    np.testing.assert_allclose(sp.so3.log(found), [0.0, turned, 0.0], atol=1e-9)


@pytest.mark.parametrize("name", SINGLE)
def test_what_is_bolted_down_by_one_joint_does_not_float(name, tmp_path):
    (tmp_path / name).write_text(FILES[name][0])
    with pytest.raises(ModelFileError, match="'world'"):
        sp.load_body(tmp_path / name)


def test_an_arm_of_mujoco_is_bolted_down_too(tmp_path):
    inner = (
        '<body name="arm"><joint name="turn" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    )
    for text in (inner, f'<body name="stand">{inner}</body>', f'<body><body name="stand">{inner}</body></body>'):
        (tmp_path / "arm.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
        with pytest.raises(ModelFileError, match="'turn'"):
            sp.load_body(tmp_path / "arm.xml")
        body = sp.load_body(tmp_path / "arm.xml", root="free")
        assert (body.link_names, body.n_shape) == (("arm",), 0)


def test_a_floating_joint_from_a_massless_root_is_the_base(load_urdf):
    steps = (("mount", "fixed", "", 'rpy="0.1 0 0"'), ("float", "floating", "", 'xyz="1 2 3"'))
    body, plain = load_urdf(chain(*steps)), load_urdf(f'<robot name="r">{PARTS}</robot>')
    assert (body.joint_names, body.link_names, body.base_joints) == (plain.joint_names, plain.link_names, ())
    np.testing.assert_array_equal(body.locked_inertia([0.3]), plain.locked_inertia([0.3]))


def test_frames_without_mass_do_not_hold_the_body(load_urdf):
    camera = '<link name="camera"/>' + joint("pan", "continuous", "world", "camera")
    with pytest.raises(ModelFileError, match="'turn'"):
        load_urdf(chain(SIX[3], body=PARTS + camera).replace('"yaw"', '"turn"'))


def test_two_arms_on_a_massless_root_are_doubted(load_urdf):
    text = '<robot name="r"><link name="stand"/>' + f'<link name="a">{HEAVY}</link><link name="b">{LIGHT}</link>'
    text += joint("left", "continuous", "stand", "a") + joint("right", "continuous", "stand", "b") + "</robot>"
    with pytest.warns(IgnoredElementWarning, match="'left'"):
        assert load_urdf(text).joint_names == ("left", "right")


def test_the_base_leads_and_follows_no_joint(load_urdf):
    tied = LEG.replace("</joint>", '<mimic joint="turn"/></joint>')
    with pytest.raises(ModelFileError, match="'hip'"):
        load_urdf(chain(SIX[3], ("turn", "continuous", "1 0 0", ""), body=PARTS.replace(LEG, tied)))


def test_what_leads_to_the_base_is_not_drawn(load_urdf):
    box = "<visual><geometry><box size='1 1 1'/></geometry></visual>"
    text = chain(*SIX).replace('<link name="world"/>', f'<link name="world">{box}</link>')
    with pytest.warns(IgnoredElementWarning):
        body = load_urdf(text.replace('<link name="trunk">', f'<link name="trunk">{box}'))
    assert [shape.link for shape in sp.body.visuals(body) if shape.kind == "box"][:1] == ["trunk"]
    assert "world" not in {shape.link for shape in sp.body.visuals(body)}


def test_columns_that_are_not_all_there_are_asked_for(tmp_path):
    (tmp_path / "r.urdf").write_text(FILES["six.urdf"][0])
    with pytest.warns(IgnoredElementWarning):
        body = sp.load_body(tmp_path / "r.urdf")
    (tmp_path / "m.csv").write_text("time,hip,yaw,pitch\n0,0,0,0\n0.5,1,0,0\n1,0,0,0\n")
    with pytest.raises(TrajectoryError, match="roll"):
        sp.read_shape_path(tmp_path / "m.csv", body)
    # Nor are they needed.
    assert sp.read_recorded_motion(tmp_path / "m.csv", body, ignore_extra=True).base_attitude is None


def test_a_column_may_have_the_name_of_a_joint_and_of_another_recording(load_urdf, tmp_path):
    """A joint `base_roll`: beside `base_pitch` and `base_yaw` the column is one of three angles."""
    body = load_urdf(chain(("base_roll", "continuous", "1 0 0", 'rpy="0 0 0.5"')), root="free")
    (tmp_path / "m.csv").write_text("time,hip,base_roll\n0,0,0.1\n0.5,1,0.2\n1,0,0.3\n")
    alone = sp.read_recorded_motion(tmp_path / "m.csv", body).base_attitude
    np.testing.assert_allclose(alone[-1], sp.so3.exp([0.0, 0.0, 0.5]) @ sp.so3.exp([0.3, 0.0, 0.0]), atol=1e-15)
    rows = "0,0,0.1,0,0\n0.5,1,0.2,0,0\n1,0,0.3,0,0\n"
    (tmp_path / "m.csv").write_text("time,hip,base_roll,base_pitch,base_yaw\n" + rows)
    three = sp.read_recorded_motion(tmp_path / "m.csv", body).base_attitude
    np.testing.assert_allclose(three[-1], sp.so3.exp([0.3, 0.0, 0.0]), atol=1e-15)
