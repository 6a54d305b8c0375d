"""What is unlikely of a body is said: other units and slips are seen, and real bodies are not accused."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

import shapephase as sp
from shapephase.body import implausible, robots_folder
from shapephase.cli.main import main

# A box of 0.3 m by 0.4 m by 0.6 m with the density of water: a torso.
EDGES = np.array([0.3, 0.4, 0.6])
WATER = 72.0
DRAWN = f"<visual><geometry><box size='{' '.join(map(str, EDGES))}'/></geometry></visual>"


def box(name, mass=WATER, edges=EDGES, visual=""):
    """A link that is a box of uniform density."""
    moments = mass / 12.0 * (np.sum(np.square(edges)) - np.square(edges))
    entries = " ".join(f"{key}='{value!r}'" for key, value in zip(("ixx", "iyy", "izz"), moments.tolist()))
    return (
        f"<link name='{name}'><inertial><mass value='{mass!r}'/><inertia {entries} ixy='0' ixz='0' iyz='0'/></inertial>"
        f"{visual}</link>"
    )


def joint(child, parent="a", limit="<limit lower='-1' upper='1' effort='1' velocity='1'/>", place="0 0 0.5"):
    return (
        f"<joint name='j{child}' type='revolute'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 0 1'/>"
        f"<origin xyz='{place}'/>{limit}</joint>"
    )


def said_of(load_urdf, *parts):
    return implausible(load_urdf(f"<robot name='r'>{''.join(parts)}</robot>"))


def test_two_boxes_of_water_are_a_body(load_urdf):
    assert said_of(load_urdf, box("a", visual=DRAWN), box("b"), joint("b")) == ()


@pytest.mark.parametrize(("place", "where"), [("0 0 0", "in one point"), ("0 0 0.4", "on one line")])
def test_a_body_without_a_moment_of_inertia(load_urdf, place, where):
    """Two point masses in the same place or apart; a third beside their line makes a body of them."""
    point = "<link name='{}'><inertial><mass value='2'/><inertia ixx='0' iyy='0' izz='0' ixy='0' ixz='0' iyz='0'/>"
    point += "<origin xyz='0.1 0 0'/></inertial></link>"
    parts = [point.format("a"), point.format("b"), joint("b", place=place)]
    (said,) = said_of(load_urdf, *parts)
    assert said.startswith(f"all mass is {where} in the neutral shape: its turns about that are not determined; ")
    aside = said_of(load_urdf, *parts, point.format("c"), joint("c", place="0.3 0 0.1"))
    assert (aside == ()) == (where == "on one line")


@pytest.mark.parametrize("name", sp.robot_names())
def test_our_bodies_are_plausible(name):
    assert implausible(sp.load_body(name)) == ()


@pytest.mark.parametrize("inertia", ["as heavy", "as light"])
def test_a_torso_of_sixty_tonnes(load_urdf, inertia):
    """Whether its moments grew with its mass or not. 72 kg in 0.072 m^3 are water; 60 t are more than osmium."""
    heavy = box("torso", 60_000.0)
    if inertia == "as light":
        heavy = re.sub(r"mass value='[^']*'", "mass value='60000'", box("torso"))
    (said,) = said_of(load_urdf, box("a"), heavy, joint("torso"))
    assert said.startswith("link 'torso' (6e+04 kg, ")
    assert "denser than any matter" in said
    # The box of the inertia, by its longest edge; with small moments it is smaller by the root of the mass.
    scale = 1.0 if inertia == "as heavy" else math.sqrt(WATER / 60_000.0)
    assert f"{60_000.0 / (0.6 * scale) ** 3:.2g} kg/m^3" in said


def test_a_link_of_a_microgram(load_urdf):
    found = said_of(load_urdf, box("a"), box("dust", 1e-9), joint("dust"))
    assert any(re.match(r"link 'dust' \(1e-09 kg, 1.4e-08 kg/m\^3\): lighter than air", said) for said in found)
    assert any("'dust' (1e-09 kg on 72 kg): masses that differ ten thousandfold" in said for said in found)
    assert len(found) == 2


def test_neighbours_are_compared_over_links_without_mass(load_urdf):
    parts = (box("a"), "<link name='step'/>", box("b", 1e-3, EDGES / 100.0), joint("step"), joint("b", "step"))
    (said,) = said_of(load_urdf, *parts)
    assert said.startswith("link 'b' (0.001 kg on 72 kg): masses that differ")


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        (
            "<limit lower='-90' upper='90' effort='1' velocity='1'/>",
            "'jb' (-90 to 90 rad): limited beyond a whole turn",
        ),
        ("<limit lower='-6.28319' upper='6.28319' effort='1' velocity='1'/>", None),
        (
            "<limit lower='-1' upper='6.4' effort='1' velocity='1'/>",
            "'jb' (-1 to 6.4 rad): limited beyond a whole turn",
        ),
    ],
)
def test_limits_beyond_a_turn(load_urdf, limit, words):
    found = said_of(load_urdf, box("a"), box("b"), joint("b", limit=limit))
    assert found == () if words is None else words in found[0]


@pytest.mark.usefixtures("warm_engines")
def test_limits_that_are_missing(tmp_path):
    """An MJCF may leave a slide without them."""
    inertial = "<inertial pos='0 0 0' mass='1' diaginertia='.1 .1 .1'/>"
    (tmp_path / "b.xml").write_text(
        f"<mujoco><worldbody><body name='a'><freejoint/>{inertial}<body name='b'><joint name='free' type='slide'/>"
        f"{inertial}</body><body name='c'><joint name='kept' type='slide' range='-1 1' limited='true'/>"
        f"{inertial}</body></body></worldbody></mujoco>"
    )
    assert implausible(sp.load_body(tmp_path / "b.xml")) == ("joint 'free': not limited on both sides",)


def test_a_mesh_in_millimetres(tmp_path):
    pytest.importorskip("trimesh")
    corners = [[x, y, z] for x in (0, 300) for y in (0, 400) for z in (0, 600)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 2 3", "f 2 4 3", "f 5 6 7", "f 1 5 8"]
    (tmp_path / "torso.obj").write_text("\n".join(lines) + "\n")
    for scale, words in (("0.001 0.001 0.001", None), ("1 1 1", "is the drawing in millimetres?")):
        mesh = f"<visual><geometry><mesh filename='torso.obj' scale='{scale}'/></geometry></visual>"
        (tmp_path / "a.urdf").write_text(f"<robot name='r'>{box('a', visual=mesh)}</robot>")
        found = implausible(sp.load_body(tmp_path / "a.urdf"))
        assert found == () if words is None else words in found[0]


def scaled_astronaut(length=1.0, mass=1.0, inertia=1.0):
    """The astronaut's file in other units of length, mass or moment."""
    text = (robots_folder() / "astronaut.urdf").read_text(encoding="utf-8")

    def changed(pattern, factor, text):
        numbers = re.compile(r"[-+0-9.e]+")
        grown = lambda found: found[1] + numbers.sub(lambda n: repr(float(n[0]) * factor), found[2]) + found[3]  # noqa: E731
        return re.sub(pattern, grown, text)

    text = changed(r"""(\bmass value=")([^"]*)(")""", mass, text)
    text = changed(r"""(\bi[xyz][xyz]=")([^"]*)(")""", inertia, text)
    return changed(r"""(\bxyz=")([^"]*)("(?=[^>]*/>\s*(?:<(?:parent|child|mass|inertia|geometry)|$)))""", length, text)


@pytest.mark.filterwarnings("ignore::shapephase.UnphysicalInertiaWarning")
@pytest.mark.parametrize(
    ("units", "words"),
    [
        ({"mass": 1e3}, "denser than any matter"),
        ({"mass": 1e3, "inertia": 1e3}, "denser than any matter"),
        ({"length": 1e3}, "are lengths in millimetres?"),
        ({"inertia": 1e6}, "that of a much larger body than is drawn"),
        ({"inertia": 1e-6}, "that of a much smaller body than is drawn"),
        ({"inertia": 1e6}, "lighter than air"),
    ],
    ids=str,
)
def test_an_astronaut_in_other_units(tmp_path, units, words):
    assert implausible(sp.load_body("astronaut")) == ()
    (tmp_path / "astronaut.urdf").write_text(scaled_astronaut(**units), encoding="utf-8")
    found = implausible(sp.load_body(tmp_path / "astronaut.urdf"))
    assert any(words in said for said in found), found


@pytest.mark.usefixtures("warm_readers")
def test_check_says_so_and_shows_the_parts(capsys, tmp_path):
    (tmp_path / "b.urdf").write_text(f"<robot name='r'>{box('a')}{box('torso', 60_000.0)}{joint('torso')}</robot>")
    main(["check", str(tmp_path / "b.urdf"), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert data["verdict"] == "OK, 1 warning"
    assert "denser than any matter" in data["warnings"][0]
    base, torso = data["body"]["parts"]
    assert (base["links"], torso["links"], torso["mass"]) == (["a"], ["torso"], 60_000.0)
    np.testing.assert_allclose(torso["principal_moments"], 5000.0 * np.array([0.25, 0.45, 0.52]), rtol=1e-12)
    assert data["body"]["joints"][0]["upper"] - data["body"]["joints"][0]["lower"] == 2.0
    main(["check", str(tmp_path / "b.urdf")])
    out = capsys.readouterr().out
    assert re.search(r"^torso +60000 +0 +0 +0 +1250 +2250 +2600$", out, re.M)
    assert re.search(r"^jtorso +revolute +-1 +1 rad +2$", out, re.M)


@pytest.mark.parametrize("rpy", ["90 0 0", "0 -180 0", "0.5 0 7"])
def test_a_turn_in_degrees_is_named_with_its_radians(rpy, load_urdf):
    turned = joint("b").replace("<origin ", f"<origin rpy='{rpy}' ")
    radians = " ".join(f"{math.radians(float(word)):.6g}" for word in rpy.split())
    with pytest.warns(sp.IgnoredElementWarning, match="degrees") as said:
        load_urdf(f"<robot name='r'>{box('a')}{box('b')}{turned}</robot>")
    assert f'rpy="{radians}"' in str(said[0].message)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rpy", ["6.2832 0 0", "0 -3.1416 1.5708"])
def test_a_whole_turn_in_radians_is_none(rpy, load_urdf):
    turned = joint("b").replace("<origin ", f"<origin rpy='{rpy}' ")
    assert load_urdf(f"<robot name='r'>{box('a')}{box('b')}{turned}</robot>").n_shape == 1


@pytest.mark.parametrize("key", ["effort", "velocity"])
def test_a_negative_limit_is_named(key, load_urdf):
    limited = joint("b").replace(f"{key}='1'", f"{key}='-5'")
    with pytest.warns(sp.IgnoredElementWarning, match=f"the {key} limit is negative"):
        body = load_urdf(f"<robot name='r'>{box('a')}{box('b')}{limited}</robot>")
    assert {"effort": body.effort_limits, "velocity": body.rate_limits}[key].tolist() == [5.0]


def test_the_smallest_moment_there_is_makes_matter_too_dense(load_urdf):
    small = re.sub(r"(ixx|iyy|izz)='[^']*'", r"\1='5e-324'", box("b"))
    (said,) = said_of(load_urdf, box("a"), small, joint("b"))
    assert "'b'" in said
    assert "denser than any matter" in said


@pytest.mark.usefixtures("warm_engines")
@pytest.mark.parametrize("geom", ['mass="nan"', 'density="NaN"', 'mass="1" pos="0 nan 0"'])
def test_a_number_that_is_none_in_an_mjcf(geom, tmp_path):
    """MuJoCo alone takes the density of water, and says nothing."""
    file = tmp_path / "nan.xml"
    ball = '<geom type="sphere" size="0.1"'
    other = f'<body name="b"><joint name="j"/>{ball}/></body>'
    file.write_text(
        f'<mujoco><worldbody><body name="nan"><freejoint/>{ball} {geom}/>{other}</body></worldbody></mujoco>'
    )
    with pytest.raises(sp.errors.ModelFileError, match="number"):
        sp.load_body(file)
