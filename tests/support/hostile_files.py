"""Hostile and odd body files, each with what must come of it."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

GOOD = """<?xml version="1.0"?>
<robot name="small">
  <link name="base">
    <inertial>
      <mass value="3.0"/>
      <inertia ixx="0.3" ixy="0" ixz="0" iyy="0.5" iyz="0" izz="0.6"/>
    </inertial>
  </link>
  <link name="arm">
    <inertial>
      <origin xyz="0.2 0.1 0.0" rpy="0.1 0.2 0.3"/>
      <mass value="1.0"/>
      <inertia ixx="0.02" ixy="0.0" ixz="0.0" iyy="0.03" iyz="0.0" izz="0.04"/>
    </inertial>
  </link>
  <link name="hand">
    <inertial>
      <mass value="0.5"/>
      <inertia ixx="0.002" ixy="0.0" ixz="0.0" iyy="0.003" iyz="0.0" izz="0.004"/>
    </inertial>
  </link>
  <joint name="hip" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <origin xyz="0.3 0.0 0.1" rpy="0.5 0.0 0.0"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
  <joint name="wrist" type="continuous">
    <parent link="arm"/>
    <child link="hand"/>
    <origin xyz="0.4 0.0 0.0"/>
    <axis xyz="1 0 1"/>
  </joint>
</robot>
"""

GOOD_MJCF = """<mujoco model="small">
  <compiler angle="radian"/>
  <default>
    <joint damping="1"/>
    <default class="thin">
      <geom type="capsule" size="0.05"/>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <inertial pos="0 0 0.1" mass="3" diaginertia="0.2 0.3 0.4"/>
      <body name="arm" pos="0.2 0 0" euler="0.1 0.2 0.3">
        <joint name="hip" axis="0 1 0" pos="0.1 0 0" range="-1 1"/>
        <joint name="twist" axis="1 0 0"/>
        <inertial pos="0.1 0 0" mass="1" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>
        <body name="hand" pos="0.3 0 0" childclass="thin">
          <joint name="slide" type="slide" axis="1 0 1"/>
          <geom name="palm" fromto="0 0 0 0.1 0.1 0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class Case:
    """A file and what must come of it.

    `said` is a regular expression in the message of the `error`, None where the file loads; `line` the line that the
    message must name; `warned` an expression in the warnings.
    """

    name: str
    content: Callable[[], bytes]
    said: str | None = None
    line: int | None = None
    error: str = "ModelFileError"
    warned: str | None = None
    suffix: str = ".urdf"
    options: tuple[tuple[str, str], ...] = ()

    @property
    def file(self) -> str:
        return f"{re.sub(r'[^a-z0-9]+', '_', self.name.lower())}{self.suffix}"


def edit(*pairs: tuple[str, str], base: str = GOOD) -> str:
    """A good file with some texts replaced, each where it stands first."""
    for old, new in pairs:
        assert old in base, old
        base = base.replace(old, new, 1)
    return base


def _case(
    name: str, content: str | bytes | Callable[[], bytes], said: str | None = None, at: str | None = None, **rest: Any
) -> Case:
    """A case; the line it must name is that of the text `at`."""
    if callable(content):
        return Case(name, content, said, rest.pop("line", None), **rest)
    data = content.encode() if isinstance(content, str) else content
    line = rest.pop("line", None)
    if at is not None and line is None:
        assert at.encode() in data, at
        line = data[: data.index(at.encode())].count(b"\n") + 1
    return Case(name, lambda: data, said, line, **rest)


def _faulty(name: str, old: str, new: str, said: str | None = None, at: str | None = None, **rest: Any) -> Case:
    """A good file with one thing replaced, which the message must name in its line."""
    base = rest.pop("base", GOOD)
    also = (pair,) if (pair := rest.pop("also", None)) else ()
    return _case(name, edit((old, new), *also, base=base), said, at or (new.strip() if said else None), **rest)


def _mjcf(name: str, old: str, new: str, said: str | None = None, at: str | None = None, **rest: Any) -> Case:
    return _faulty(f"mjcf {name}", old, new, said, at, base=GOOD_MJCF, suffix=".xml", **rest)


@cache
def cases() -> list[Case]:
    """All of them; names are unique."""
    found = [
        *_no_xml(),
        *_other_formats(),
        *_numbers(),
        *_inertias(),
        *_trees(),
        *_joints(),
        *_names(),
        *_large(),
        *_mjcfs(),
    ]
    assert len({case.name for case in found}) == len(found)
    return found


def _no_xml() -> Iterator[Case]:
    xml = "XML"
    yield _case("good", GOOD)
    yield _case("empty", b"", "empty file", line=1)
    yield _case("whitespace", b"  \n\n \t ", "empty file", line=1)
    yield _case("cut in a tag", GOOD[: GOOD.index("izz") - 2], xml, line=6)
    yield _case("json", b'{"robot": {"name": "a"}}', "a JSON file", line=1)
    yield _case("random bytes", random.Random(1).randbytes(500), "a binary file", line=1)
    yield _case("utf-16", GOOD.encode("utf-16"))
    yield _case("utf-16 without a mark", GOOD.encode("utf-16-le"), "zero byte", line=1)
    yield _case("latin-1", edit(("arm", "\xe4rm")).encode("latin-1"), r"UTF-8.*byte \d+", line=9)
    yield _case(
        "latin-1 declared", '<?xml version="1.0" encoding="latin-1"?><robot name="\xe4"/>'.encode("latin-1"), "no links"
    )
    yield _case("byte order mark", GOOD.encode("utf-8-sig"))
    yield _case("carriage returns", GOOD.replace("\n", "\r\n"))
    yield _case("zero byte in a name", edit(('"arm"', '"a\0m"')), "zero byte", "\0")
    yield _case("zero byte at the end", GOOD + "\0")
    yield _case("bell in a comment", edit(("<link", "<!-- \a --><link")), xml, line=3)
    yield _case("two robots", GOOD + GOOD.split("\n", 1)[1], "XML.*junk", line=36)
    yield _case("no quotes", edit(('"3.0"', "3.0")), xml, "<mass")
    yield _case("unknown entity", edit(("arm", "a&mass;m")), "XML.*entity", "a&mass;m")
    yield _case("known entity", edit(('"base"', '"b&amp;e"'), ('"base"', '"b&amp;e"')))
    yield _case("quotes in a name", edit(('"base"', "'b\"se'"), ('"base"', "'b\"se'")))
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    yield _case(
        "billion laughs", f'<!DOCTYPE r [<!ENTITY l0 "ha">{laughs}]>' + edit(("<?xml", "<?x")), "DOCTYPE", line=1
    )
    outside = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>\n<robot name="&x;"><link name="a"/></robot>'
    yield _case("entity from outside", outside, "DOCTYPE", line=1)
    yield _case("parameter entity", '<!DOCTYPE r [<!ENTITY % p SYSTEM "http://a/b"> %p;]><robot/>', "DOCTYPE", line=1)
    yield _case("doctype alone", "\n<!DOCTYPE robot>" + GOOD.split("\n", 1)[1], "DOCTYPE", line=2)
    yield _case("processing instruction", edit(("<robot", '<?xml-stylesheet href="/dev/zero"?><robot')))
    yield _case("character data", edit(("<link", "<![CDATA[ <mass value='9'/> ]]><link")))
    yield _case("commented link", edit(("<link", "<!-- <link name='x'/> --><link")))


def _other_formats() -> Iterator[Case]:
    yield _case(
        "sdf", '<?xml version="1.0"?>\n<sdf version="1.6"><model name="a"/></sdf>', "<sdf>.*SDF.*sdf2urdf", line=2
    )
    yield _case("html", "<html><body>404</body></html>", "HTML.*raw", line=1)
    yield _case("xhtml", '<html xmlns="http://www.w3.org/1999/xhtml"><body/></html>', "HTML", line=1)
    yield _case("collada", '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"/>', "mesh", line=1)
    yield _case("svg", "<svg/>", "neither a URDF nor an MJCF model", line=1)
    yield _case("capital robot", GOOD.replace("robot", "Robot"), "<Robot>.*expected <robot>", line=2)
    yield _case("mujoco part", "<mujocoinclude/>", "part of an MJCF", line=1, suffix=".xml")
    yield _case("robot in a namespace", edit(("<robot", '<robot xmlns="http://a.b/c"')))
    xacro = ("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"')
    yield _case("xacro namespace left", edit(xacro))
    macro = '<xacro:macro name="m"/>'
    yield _case("xacro macro", edit(xacro, ("<link", macro + "<link")))
    call = '<xacro:arm side="left"/>'
    refused = "<robot>: xacro does not accept it: .*"
    yield _case("xacro call", edit(xacro, ('<link name="arm', call + '<link name="arm')), refused + "arm", line=1)
    for name, value in (("expression", "${m}"), ("substitution", "$(arg m)")):
        yield _case(f"xacro {name}", edit(('<mass value="3.0"/>', f'<mass value="{value}"/>')), refused + "m", line=1)
    mesh = '<visual><geometry><mesh filename="package://../../etc/passwd"/></geometry></visual>'
    for path in ("package://../../etc/passwd", "file:///etc/passwd", "/dev/zero", "http://127.0.0.1/a.dae"):
        yield _faulty(f"mesh {path}", "</inertial>", "</inertial>" + mesh.replace("package://../../etc/passwd", path))
    yield _faulty("transmission", "</robot>", '<transmission name="t"><joint name="hip"/></transmission></robot>')
    yield _faulty("gazebo", "</robot>", '<gazebo reference="arm"><mu1>0.2</mu1></gazebo></robot>')
    yield _faulty("version", '<robot name="small"', '<robot name="small" version="9.9"')
    yield _faulty("no robot name", '<robot name="small"', "<robot")


BAD_NUMBERS = (
    "nan",
    "inf",
    "-inf",
    "1e400",
    "",
    " ",
    "heavy",
    "1,5",
    "1.5kg",
    "0x1p3",
    "1_0",
    "\uff11.5",
    "--1",
    "1 2",
    "1e",
    "1" * 500,
)
BAD_VECTORS = (
    "nan 0 0",
    "1e400 0 0",
    "0 1",
    "0 1 0 0",
    "",
    "a b c",
    "0,1,0",
    "0 0 inf",
    "1e6 0 0",
    "0 0 0x1",
    "0\u00a00\u00a00\u00a01",
)


def _numbers() -> Iterator[Case]:
    for value in BAD_NUMBERS:
        shown = value[:10]
        yield _faulty(
            f"mass {shown}", '<mass value="1.0"/>', f'<mass value="{value}"/>', "link 'arm': <mass> value=.*finite"
        )
        inertia = '<inertia ixx="0.02" ixy="0.0"'
        new = inertia.replace('"0.0"', f'"{value}"')
        yield _faulty(f"product of inertia {shown}", inertia, new, "link 'arm': <inertia> ixy=.*finite")
        yield _faulty(f"limit {shown}", 'lower="-1.5"', f'lower="{value}"', "joint 'hip': <limit> lower=", "<limit")
    for value in BAD_VECTORS:
        yield _faulty(
            f"origin {value}", '<origin xyz="0.3 0.0 0.1"', f'<origin xyz="{value}"', "joint 'hip': <origin> xyz="
        )
        yield _faulty(f"angles {value}", 'rpy="0.5 0.0 0.0"', f'rpy="{value}"', "joint 'hip': <origin> rpy=")
        yield _faulty(
            f"centre {value}", '<origin xyz="0.2 0.1 0.0"', f'<origin xyz="{value}"', "link 'arm': <origin> xyz="
        )
        yield _faulty(f"axis {value}", '<axis xyz="0 1 0"/>', f'<axis xyz="{value}"/>', "joint 'hip': <axis> xyz=")
    for value in (" 1.0 ", "1.0\t", "+1", "1e0", "1.", "001", "1\n", "0.1E+1"):
        yield _faulty(f"unusual mass {value!r}", '<mass value="1.0"/>', f'<mass value="{value}"/>')
    yield _faulty("axis zero", '"0 1 0"', '"0 0 0"', "joint 'hip': the axis .* points nowhere")
    yield _faulty("axis tiny", '"0 1 0"', '"0 1e-200 0"', "joint 'hip': the axis .* points nowhere")
    yield _faulty("axis long", '"0 1 0"', '"1 2 3"')
    yield _faulty("axis missing", '<axis xyz="0 1 0"/>', "")
    yield _faulty("axis without xyz", '<axis xyz="0 1 0"/>', "<axis/>", "joint 'hip': <axis> has no xyz")
    yield _faulty(
        "axis misspelt", '<axis xyz="0 1 0"/>', '<axis xzy="0 1 0"/>', "joint 'hip': <axis> has no attribute 'xzy'"
    )
    yield _faulty(
        "origin misspelt", 'rpy="0.5 0.0 0.0"', 'ryp="0.5 0.0 0.0"', "joint 'hip': <origin> has no attribute 'ryp'"
    )
    yield _faulty("origin as quaternion", 'rpy="0.5 0.0 0.0"', 'quat_xyzw="0 0 0 1"', "has no attribute 'quat_xyzw'")


def _inertias() -> Iterator[Case]:
    mass, inertia = '<mass value="1.0"/>', '<inertia ixx="0.02" ixy="0.0" ixz="0.0" iyy="0.03" iyz="0.0" izz="0.04"/>'
    start = '<link name="arm">\n    <inertial>'
    yield _faulty("mass negative", mass, '<mass value="-1.0"/>', "link 'arm': negative mass -1")
    yield _faulty("mass huge", mass, '<mass value="1e308"/>', "link 'arm': <mass> value='1e308': too large")
    yield _faulty("mass nearly zero", mass, '<mass value="1e-310"/>', "link 'arm': mass 1e-310 kg is too small")
    yield _faulty("mass missing", mass, "", "link 'arm': <inertial> has no <mass>", line=10)
    yield _faulty("mass without value", mass, "<mass/>", "link 'arm': <mass> has no value")
    yield _faulty("mass as text", mass, "<mass>1.0</mass>", "link 'arm': <mass> has no attribute|<mass> has no value")
    yield _faulty("mass misspelt", mass, '<mass valu="1.0"/>', "link 'arm': <mass> has no attribute 'valu'")
    yield _faulty("mass twice", mass, mass + mass, "link 'arm': 2 <mass>")
    yield _faulty("inertia missing", inertia, "", "link 'arm': <inertial> has no <inertia>", line=10)
    yield _faulty("inertia without izz", ' izz="0.04"', "", "link 'arm': <inertia> has no izz", inertia[:20])
    yield _faulty(
        "inertia of MuJoCo", inertia, '<inertia diag="1 1 1"/>', "link 'arm': <inertia> has no attribute 'diag'"
    )
    yield _faulty(
        "inertial twice", start, start.replace("<inertial>", "<inertial/>\n<inertial>"), "'arm': 2 <inertial>", line=11
    )
    yield _faulty("inertial misspelt", start, start.replace("inertial", "inertal"), "'arm'|XML", line=14)
    small = ("<inertial>", "<Inertial>"), ("</inertial>", "</Inertial>")
    yield _case(
        "inertial with a capital", edit(*small), "link 'base': <Inertial> is not read; did you mean <inertial>", line=4
    )
    yield _faulty(
        "inertial with more in it",
        mass,
        mass + '<com xyz="0 0 0"/>',
        "link 'arm': <inertial> holds .*not <com>",
        "<com",
    )
    negative = inertia.replace("0.04", "-0.04")
    unphysical = {"error": "UnphysicalInertiaError"}
    yield _faulty(
        "moment negative", inertia, negative, "link 'arm'.*negative.*on_unphysical='warn'", line=9, **unphysical
    )
    allowed = (("on_unphysical", "warn"),)
    yield _faulty("moment negative allowed", inertia, negative, warned="link 'arm': a negative", options=allowed)
    off = inertia.replace('ixy="0.0"', 'ixy="0.05"')
    yield _faulty("product too large", inertia, off, "link 'arm'.*negative", line=9, **unphysical)
    yield _faulty("triangle broken", inertia, inertia.replace("0.04", "0.06"), warned="link 'arm'.*triangle")
    yield _faulty("millimetres", inertia, inertia.replace("0.0", "20000.0"), warned="link 'arm'.*units")
    yield _faulty("grams", mass, '<mass value="1e6"/>', warned="link 'arm'.*units")
    yield _faulty("inertia in tonnes", inertia, inertia.replace("0.0", "0.00000000"), warned="link 'arm'.*units")
    massless = edit(
        (mass, '<mass value="0"/>'), (inertia, inertia.replace("0.02", "0").replace("0.03", "0").replace("0.04", "0"))
    )
    yield _case("massless between", massless)
    yield _faulty(
        "massless hand",
        '<mass value="0.5"/>\n      <inertia ixx="0.002"',
        '<mass value="0"/>\n      <inertia ixx="0.002"',
        warned="'hand'.*without mass",
    )
    bare = '<robot name="a">\n<link name="a"/>\n</robot>'
    yield _case("no mass at all", bare, "link 'a': neither it nor any other link has mass", line=2)
    massless = edit(("<inertial>", "<visual>"), ("</inertial>", "</visual>"))
    yield _case(
        "massless root",
        massless,
        "joint 'hip': the only joint between 'base', which has no mass, and 'arm'.*root=\"free\"",
        '<joint name="hip"',
    )
    yield _case("massless root removed", massless, options=(("root", "free"),))
    point = re.sub(r'(i..)="[\d.]+"', r'\1="0"', GOOD)
    yield _case("point masses", point)
    tiny = re.sub(r'(value|i..)="([\d.]+)"', r'\1="\2e-14"', GOOD)
    yield _case("tiny masses", tiny)
    yield _case(
        "masses below rounding", tiny.replace("e-14", "e-30"), "link 'base': mass 3e-30 kg is too small", line=5
    )


def _trees() -> Iterator[Case]:
    def fixed(name: str, parent: str, child: str) -> str:
        return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'

    def added(name: str, new: str, said: str, at: str | None = None, **rest: Any) -> Case:
        return _case(name, edit(("</robot>", new + "\n</robot>")), said, at or new.splitlines()[0], **rest)

    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    x, y = (f'<link name="{name}">{body}</link>' for name in "xy")
    ring = f"{x}\n{y}\n{fixed('k1', 'x', 'y')}\n{fixed('k2', 'y', 'x')}"
    yield added("circle apart from the root", ring, "link 'x': .* closed chain: x, y")
    only = f'<robot name="a">\n{ring}\n</robot>'
    yield _case("circle alone", only, "link 'x': .* closed chain: x, y", x)
    yield added(
        "circle back to the root", fixed("k", "hand", "base"), "closed chain: base, arm, hand", '<link name="base"'
    )
    yield added("joint to itself", f"{x}\n{fixed('k', 'x', 'x')}", "link 'x': .* closed chain", x)
    yield added(
        "two parents", fixed("k", "base", "hand"), "link 'hand' has two parents, joints 'wrist' .*:29.* and 'k'"
    )
    yield added(
        "missing parent", f"{fixed('k', 'ghost', 'x')}\n{x}", "joint 'k': its parent link 'ghost' does not exist"
    )
    yield added("missing child", fixed("k", "arm", "ghost"), "joint 'k': its child link 'ghost' does not exist")
    yield added("two roots", x, "link 'x': 2 links have no parent.*base, x")
    yield _case(
        "link twice", edit(("</robot>", '<link name="arm"/></robot>')), "link 'arm': two <link>.*line 9", line=35
    )
    yield _case("joint twice", edit(('"wrist"', '"hip"')), "joint 'hip': two <joint>.*line 22", line=29)
    yield _faulty("no parent tag", '<parent link="arm"/>', "", "joint 'wrist': <joint> has no <parent>", line=29)
    yield _faulty("no child tag", '<child link="hand"/>', "", "joint 'wrist': <joint> has no <child>", line=29)
    yield _faulty("parent without link", '<parent link="arm"/>', "<parent/>", "<parent>: has no link")
    yield _faulty(
        "parent misspelt",
        '<parent link="arm"/>',
        '<parent lnk="arm"/>',
        "joint 'wrist': <parent> has no attribute 'lnk'",
    )
    yield _faulty(
        "parent twice", '<parent link="arm"/>', '<parent link="arm"/><parent link="base"/>', "joint 'wrist': 2 <parent>"
    )
    yield _case("no links", '<robot name="a"/>', "robot 'a': has no links", line=1)
    yield _case("only joints", '<robot name="a">\n' + fixed("k", "a", "b") + "</robot>", "has no links", line=1)
    yield _faulty("joint called like pinocchio's root", '"hip"', '"root_joint"')
    yield _faulty("joint called like our root", '"hip"', '"shapephase_free_flyer"')
    yield _faulty("joint called universe", '"hip"', '"universe"')
    yield _case("link called universe", GOOD.replace('"arm"', '"universe"'))
    yield _case("link called like its joint", GOOD.replace('"arm"', '"hip"'))
    yield _faulty("link misspelt", '<link name="hand">', '<Link name="hand">', "XML", line=21)
    yield _case(
        "joint misspelt",
        edit(("</robot>", '<jont name="k"/></robot>')),
        "<jont> is not read; did you mean <joint>",
        line=35,
    )


def _joints() -> Iterator[Case]:
    limit = '<limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>'
    for kind in ("planar", "floating", "hinge", "Revolute", ""):
        inside = kind in ("planar", "floating")
        new = f'<joint name="hip" type="{kind}">'
        yield _faulty(
            f"type {kind!r}",
            '<joint name="hip" type="revolute">',
            new,
            f"joint 'hip': type '{kind}' is not supported.*"
            + ("inside a body.* one in a row" if inside else "several in a row"),
        )
    yield _faulty("no type", ' type="revolute"', "", "joint 'hip': type ''", '<joint name="hip"')
    yield _faulty("no limit", limit, "", "joint 'hip': a revolute joint needs <limit", '<joint name="hip"')
    yield _faulty("limit without effort", ' effort="1" velocity="1"', "")
    yield _faulty("limit empty", limit, "<limit/>")
    yield _faulty(
        "limits exchanged",
        'lower="-1.5" upper="1.5"',
        'lower="1" upper="-1"',
        "joint 'hip': the lower limit 1 is above",
        "<limit",
    )
    yield _faulty("limit twice", limit, limit + limit, "joint 'hip': 2 <limit>", "<limit")
    yield _faulty(
        "origin twice",
        '<origin xyz="0.4 0.0 0.0"/>',
        '<origin/><origin xyz="0.4 0.0 0.0"/>',
        "joint 'wrist': 2 <origin>",
    )
    yield _faulty(
        "origin tag misspelt",
        '<origin xyz="0.4 0.0 0.0"/>',
        '<orgin xyz="0.4 0.0 0.0"/>',
        "joint 'wrist': <orgin> is not read; did you mean <origin>",
    )
    yield _faulty("prismatic", 'type="revolute"', 'type="prismatic"')

    def mimic(name: str, rule: str, said: str | None, old: str = '<axis xyz="1 0 1"/>', **rest: Any) -> Case:
        return _faulty(f"mimic {name}", old, old + rule, said, rule if said else None, **rest)

    yield mimic("good", '<mimic joint="hip" multiplier="2" offset="0.1"/>', None)
    yield mimic("nobody", '<mimic joint="ghost"/>', "joint 'wrist': mimics joint 'ghost', which does not exist")
    yield mimic("itself", '<mimic joint="wrist"/>', "joint 'wrist': .*circle")
    yield mimic("without joint", "<mimic/>", "<mimic>: has no joint")
    yield mimic("infinite", '<mimic joint="hip" multiplier="inf"/>', "joint 'wrist': <mimic> multiplier=")
    yield mimic(
        "misspelt", '<mimic joint="hip" multiplyer="2"/>', "joint 'wrist': <mimic> has no attribute 'multiplyer'"
    )
    yield mimic("huge", '<mimic joint="hip" multiplier="1e300"/>', "joint 'wrist': <mimic> multiplier=.*too large")
    slide = edit(('type="revolute"', 'type="prismatic"'))
    yield mimic(
        "of another kind",
        '<mimic joint="hip"/>',
        "joint 'wrist': is continuous and mimics joint 'hip', which is prismatic",
        base=slide,
    )
    held = edit(('type="revolute"', 'type="fixed"'))
    yield mimic(
        "of a fixed joint",
        '<mimic joint="hip"/>',
        "joint 'wrist': is continuous and mimics joint 'hip', which is fixed",
        base=held,
    )
    rule = '<mimic joint="wrist"/>'
    yield mimic(
        "on a fixed joint",
        rule,
        None,
        '<axis xyz="0 1 0"/>',
        base=held,
        warned=r":26: joint 'hip': <mimic> of a fixed joint is ignored",
    )
    circle = edit(('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="wrist"/>'))
    circle = edit(('<axis xyz="1 0 1"/>', '<mimic joint="hip"/>'), base=circle)
    yield _case("mimic in a circle", circle, "joint 'hip': .*circle", line=26)


def _names() -> Iterator[Case]:
    yield _faulty("link without name", '<link name="arm">', "<link>", "<link>: has no name")
    yield _faulty("link with empty name", '<link name="arm">', '<link name="">', "<link>: has no name")
    yield _faulty("link with blank name", '<link name="arm">', '<link name="  ">', "<link>: has no name")
    yield _faulty("joint without name", '<joint name="hip"', "<joint", "<joint>: has no name", line=22)
    yield _faulty("newline in a name", '<link name="arm">', '<link name="a&#10;m">', r"<link> 'a\\nm': .*printed")
    yield _faulty("right-to-left name", '<link name="arm">', '<link name="a\u202em">', "<link> .*printed")
    yield _case("name of 256", GOOD.replace('"arm"', f'"{"x" * 256}"'))
    yield _case("name in Greek", GOOD.replace('"arm"', '"χέρι"'))
    yield _case("name with spaces", GOOD.replace('"arm"', '"the left arm"'))
    yield _case("name like markup", GOOD.replace('"arm"', '"&lt;/link&gt;"'))


def _large() -> Iterator[Case]:
    def chain(count: int, kind: str) -> Callable[[], bytes]:
        def content() -> bytes:
            inertial = (
                '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
            )
            links = [f'<link name="l{i}">{inertial}</link>' for i in range(count)]
            joints = [
                f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
                for i in range(count - 1)
            ]
            return "\n".join(['<robot name="chain">', *links, *joints, "</robot>"]).encode()

        return content

    def star(count: int) -> Callable[[], bytes]:
        return lambda: re.sub(rb'parent link="l\d+"', b'parent link="l0"', chain(count, "continuous")())

    yield _case("chain of 150", chain(150, "continuous"))
    yield _case("chain of 150 fixed", chain(150, "fixed"))
    yield _case("chain of 250", chain(250, "fixed"), "link 'l200': a chain of more than 200", line=202)
    yield _case("chain of 1000", chain(1000, "continuous"), "999 moving joints; up to 200", line=1)
    yield _case("chain of 1900 fixed", chain(1900, "fixed"), "link 'l200': a chain", line=202)
    yield _case("chain of 12000", chain(12000, "fixed"), "12000 links; up to 2000", line=1)
    yield _case("star of 200", star(200))
    yield _case("star of 202", star(202), "201 moving joints; up to 200", line=1)
    nested = b'<robot name="a">' + b"<a>\n" * 5000 + b"</a>" * 5000 + b"</robot>"
    yield _case("nested and closed", nested, "has no links", line=1)
    yield _case("a comment full of signs", edit(("<link", "<!--" + '="' * 100_000 + "--><link")))
    yield _case("a text full of signs", edit(("<link", " = " * 100_000 + "<link")))
    yield _case(
        "a long attribute",
        lambda: edit(('"3.0"', '"' + "1" * 15_000_000 + '"')).encode(),
        r"<mass> value='1+\.\.\.'",
        line=5,
    )
    row = lambda: edit(('"3.0"', '"' + "1 " * 8_000_000 + '"')).encode()  # noqa: E731
    yield _case("a long row of numbers", row, r"<mass> value='1 1 .*\.\.\.'", line=5)
    yield _case("many blank lines", lambda: GOOD.replace("<axis", "\n" * 1_000_000 + "<axis").encode())


def _mjcfs() -> Iterator[Case]:
    def mjcf(name: str, content: str, said: str | None = None, at: str | None = None, **rest: Any) -> Case:
        return _case(f"mjcf {name}", content, said, at, suffix=".xml", **rest)

    def refused(name: str, old: str, new: str, said: str, at: str | None = None, **rest: Any) -> Case:
        return _mjcf(name, old, new, said.replace(": ", ": MuJoCo does not accept it: .*", 1), at, **rest)

    yield mjcf("good", GOOD_MJCF)
    yield mjcf("empty", "<mujoco/>", "<worldbody>: there is no <body>", line=1)
    yield mjcf("no body", "<mujoco>\n<worldbody/>\n</mujoco>", "there is no <body>", line=2)
    yield mjcf("doctype", "<!DOCTYPE m>" + GOOD_MJCF, "DOCTYPE", line=1)
    yield mjcf("cut", GOOD_MJCF[:400], "XML", line=14)
    for name, file, said in (
        ("include", "/etc/passwd", "XML parse error"),
        ("include of nothing", "nowhere.xml", "Error opening file"),
    ):
        yield refused(name, "<worldbody>", f'<worldbody><include file="{file}"/>', f"<include>: {said}")
    yield _mjcf("another body without joints", "</worldbody>", '<body name="b"/></worldbody>')
    yield _mjcf(
        "furniture",
        "</worldbody>",
        '<body name="b"><geom size="1"/></body></worldbody>',
        warned="what stands still in the world is left out: 'b'",
    )
    ball = '<body name="b"><freejoint/><geom size="1"/></body>'
    several = "body 'b': 2 bodies in the world.*'trunk', 'b'; choose one by root_body='trunk'"
    yield _mjcf("a free ball", "</worldbody>", f"{ball}</worldbody>", several, '<body name="b"')
    yield _mjcf("a free ball left out", "</worldbody>", f"{ball}</worldbody>", options=(("root_body", "trunk"),))
    yield _mjcf(
        "unknown root body",
        "</worldbody>",
        f"{ball}</worldbody>",
        "<worldbody>: root_body: no body is named 'trun'; there is 'trunk'",
        "<worldbody>",
        options=(("root_body", "trun"),),
    )
    yield _mjcf("two worlds", "</worldbody>", "</worldbody>\n<worldbody/>")
    yield _mjcf("ball", 'type="slide" axis="1 0 1"', 'type="ball"')
    yield refused(
        "free joint inside", '<joint name="twist" axis="1 0 0"/>', "<freejoint/>", "body 'arm': more than 6", line=14
    )
    yield refused("unknown type", 'type="slide"', 'type="screw"', "<joint>: invalid keyword: 'screw'")
    hinge = '<joint name="j"/>'
    yield _mjcf(
        "hinge to the world",
        "<freejoint/>",
        hinge,
        "joint 'j': the only joint between 'the world', which has no mass, and 'trunk'.*root=\"free\"",
        hinge,
    )
    yield _mjcf("hinge to the world removed", "<freejoint/>", hinge, options=(("root", "free"),))
    yield _mjcf("no free joint", "<freejoint/>", "")
    yield _mjcf("aligned free joint", "<freejoint/>", '<freejoint align="true"/>')
    yield _mjcf(
        "mocap base",
        "<freejoint/>",
        "",
        "body 'trunk': a mocap body is moved from outside",
        line=11,
        options=(("root_body", "trunk"),),
        also=('<body name="trunk"', '<body mocap="true" name="trunk"'),
    )
    yield _mjcf("joint without name", 'name="twist" ', "")
    yield _mjcf("body without name", 'name="arm" ', "")
    yield refused("joint twice", 'name="twist"', 'name="hip"', "<joint>: repeated name 'hip'", line=16)
    yield refused("body called world", '<body name="hand"', '<body name="world"', "<body>: repeated name 'world'")
    yield _mjcf(
        "joint with a name made for another",
        'name="twist"',
        'name="arm_joint1"',
        "joint 'arm_joint1': two joints have this name",
        line=16,
        also=('name="hip" ', ""),
    )
    yield _mjcf("reference", 'axis="1 0 0"', 'axis="1 0 0" ref="0.1"')
    yield refused("axis zero", 'axis="1 0 0"', 'axis="0 0 0"', "joint 'twist': axis too small")
    yield _mjcf("range exchanged", 'range="-1 1"', 'range="1 -1"', "joint 'hip': range: the lower limit 1 is above")
    yield refused(
        "range without autolimits", 'angle="radian"', 'angle="radian" autolimits="false"', "joint 'hip': ", line=15
    )
    yield refused("attribute misspelt", 'mass="1"', 'mas="1"', "<inertial>: unrecognized attribute: 'mas'")
    said = "<inertial>: mass='nan' is not a number"
    yield _mjcf("mass nan", 'mass="1"', 'mass="nan"', said, line=17)
    for value, said in (
        ("-1", "body 'arm': mass and inertia of moving bodies"),
        ("1kg", "<inertial>: bad format in attribute 'mass'"),
    ):
        line = 14 if said.startswith("body") else 17
        yield refused(f"mass {value}", 'mass="1"', f'mass="{value}"', said, line=line)
    for value in ("inf", "1e300"):
        yield _mjcf(f"mass {value}", 'mass="1"', f'mass="{value}"', "body 'arm': .*too large", line=14)
    yield _mjcf("far away", 'pos="0.1 0 0" mass', 'pos="1e7 0 0" mass', "body 'arm': its places.*1e\\+06", line=14)
    yield refused("inertia missing", ' diaginertia="0.2 0.3 0.4"', "", "body 'trunk': mass and inertia", line=11)
    yield _mjcf(
        "triangle mended",
        'angle="radian"',
        'angle="radian" balanceinertia="true"',
        also=('diaginertia="0.2 0.3 0.4"', 'diaginertia="0.2 0.3 0.6"'),
    )
    turn = 'euler="0.1 0.2 0.3"'
    yield refused("orientation twice", turn, f'{turn} quat="1 0 0 0"', "<body>: multiple orientation")
    angle = 'angle="radian"'
    yield refused("euler sequence", angle, f'{angle} eulerseq="xyw"', "body 'arm': .*euler sequence can only", line=14)
    for setting in (
        'boundmass="1"',
        'boundinertia="0.1"',
        'settotalmass="5"',
        'balanceinertia="true"',
        'inertiagrouprange="0 2"',
        'alignfree="true"',
    ):
        yield _mjcf(f"compiler {setting}", angle, f"{angle} {setting}")
    line = 'fromto="0 0 0 0.1 0.1 0.2"'
    yield refused("mesh that is nowhere", line, 'type="mesh" mesh="palm"', "geom 'palm': mesh 'palm' not found")
    palm, at = "geom 'palm': ", '<geom name="palm"'
    yield refused("geom without size", 'size="0.05"', "", palm + "size 0 must be positive", at)
    yield _mjcf("geom as a shell", 'name="palm"', 'name="palm" shellinertia="true"')
    slide = '<joint name="slide"'
    thin = '<default class="thin">'
    yield refused("class without name", thin, "<default>", "<default>: empty class name", line=5)
    for tag, name, near in (("frame", "poss", "pos"), ("replicate", "offsett", "offset")):
        yield _mjcf(
            f"{tag} misspelt",
            slide,
            f'<{tag} {name}="0 0 1" count="1"/>{slide}' if tag == "replicate" else f'<{tag} {name}="0 0 1"/>{slide}',
            f"<{tag}>: MuJoCo ignores '{name}'; did you mean {near}=",
        )
    yield _mjcf("empty frame", slide, f"<frame/>{slide}")
    yield _mjcf("joint in a frame", slide, f'<frame><joint name="x"/></frame>{slide}')
    yield _mjcf("nothing soft", "<worldbody>", "<deformable/><worldbody>")
    soft = '<flexcomp name="f" type="grid" dim="3" count="2 2 2" spacing="1 1 1" radius="0.01" mass="1"/>'
    yield _mjcf(
        "soft body",
        "</worldbody>",
        f'<body name="jelly">{soft}</body></worldbody>',
        "body 'f_0': soft bodies",
        line=1,
        also=(' damping="1"', ""),
        options=(("root_body", "jelly"),),
    )
    yield from _equalities(refused)
    world = "</worldbody>"
    yield refused("tendon", world, f'{world}<tendon><fixed name="t"/></tendon>', "fixed 't': .*path cannot be empty")
    yield _mjcf(
        "tendon over joints",
        world,
        f'{world}<tendon><fixed name="t"><joint joint="hip" coef="1"/></fixed></tendon>',
        warned="tendons are ignored, every joint moves on its own: 't'",
    )
    yield _mjcf(
        "contact",
        world,
        f'{world}<contact><pair name="p" geom1="palm" geom2="back"/></contact>',
        warned="contacts are ignored: 'p'",
        also=("<freejoint/>", '<freejoint/><geom name="back" size="0.1" mass="0"/>'),
    )
    yield _mjcf("actuator", world, f'{world}<actuator><motor joint="hip"/></actuator>')
    wide = '<body><joint/><geom size="0.1"/></body>' * 400
    yield mjcf(
        "wide",
        f'<mujoco>\n<worldbody><body><geom size="1"/>{wide}</body></worldbody></mujoco>',
        "400 moving joints; up to 200",
        line=1,
    )
    yield from _bombs(mjcf)


def _equalities(refused: Callable[..., Case]) -> Iterator[Case]:
    """Joints that follow others, and bodies that are held together."""

    def held(name: str, inside: str, **rest: Any) -> Case:
        return _mjcf(name, "</worldbody>", f"</worldbody><equality>{inside}</equality>", **rest)

    follows = '<joint joint1="hip" joint2="twist" polycoef="0.1 2 0 0 0"/>'
    yield held("equality", follows)
    yield held("equality with nothing", '<joint joint1="hip" polycoef="0.1 0 0 0 0"/>')
    yield held("equality that is off", '<joint joint1="hip" joint2="twist" active="false"/>')
    yield held(
        "equality of second degree",
        '<joint joint1="hip" joint2="twist" polycoef="0 1 0.5 0 0"/>',
    )
    yield held("equalities of one joint", follows * 2, said="joint 'hip': two equalities hold it", line=15)
    yield held(
        "equalities in a circle",
        f'{follows}<joint joint1="twist" joint2="hip"/>',
        said="joint '(hip|twist)': by equalities joints follow each other in a circle",
        line=15,
    )
    yield held(
        "loop",
        '<connect name="c" body1="trunk" body2="hand" anchor="0 0 0"/>',
        warned="equality 'c' .connect. of 'trunk' and 'hand': ignored, every joint moves on its own",
    )
    yield held(
        "weld to the world",
        '<weld body1="hand"/>',
        warned=r"equality 0 \(weld\) of 'hand' and 'world': ignored, the body is free",
    )
    yield _mjcf(
        "weld to another body",
        "</worldbody>",
        '<body name="b"><freejoint/><geom size="1"/></body></worldbody>'
        '<equality><weld name="w" body1="hand" body2="b"/></equality>',
        "body 'hand': the equality 'w' .weld. makes it carry 'b'",
        line=18,
        options=(("root_body", "trunk"),),
    )
    yield refused(
        "equality of an unknown joint",
        "</worldbody>",
        '</worldbody><equality><joint joint1="knee"/></equality>',
        "<mujoco>: unknown element 'knee'",
        line=24,
    )


def _bombs(mjcf: Callable[..., Case]) -> Iterator[Case]:
    """What asks for more memory than there is."""
    start, end = "<mujoco>\n<asset>", '</asset><worldbody><body><geom size="1"/></body></worldbody></mujoco>'
    for name, inside in (
        ("a field of heights", '<hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/>'),
        ("a texture", '<texture name="t" type="2d" builtin="flat" width="100000" height="100000"/>'),
    ):
        yield mjcf(name, f"{start}{inside}{end}", "MuJoCo does not accept it")
    user = '<mujoco>\n<size nuser_body="2000000000"/><worldbody><body><geom size="1"/></body></worldbody></mujoco>'
    yield mjcf("room for a user's numbers", user, "MuJoCo does not accept it")
