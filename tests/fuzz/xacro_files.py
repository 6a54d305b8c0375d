"""Grammar of xacro files: bodies in URDF, told by properties, macros, conditions, and parts from packages."""

from __future__ import annotations

import re
from random import Random

from .bodies import urdf
from .pieces import ODD_NAMES, Trial, amount, odd_one, rarely, sometimes_damaged

_ODD_EXPRESSIONS = (
    *("${1/0}", "${nan}", "${float('nan')}", "${float('inf')}", "${none}", "${'x' * 10**10}", "${9**9**9}", "${}"),
    *("${", "${1", "$${1}", "${'a'}", "${[1, 2]}", "${().__class__}", "${1; 2}", "${1 if}", "${True}", "${1e400}"),
    *("${[k for k in range(10**9)]}", "${sum(range(10**9))}", "${load_yaml('numbers.yaml')}", "${load_yaml('no')}"),
    *("${load_yaml('/dev/zero')}", "${__import__('os').abort()}", "${exit()}", "${quit}", "${pi}", "${radians(30)}"),
    *("$(find none)", "$(find parts)", "$(find", "$(arg none)", "$(arg length)", "$(env NONE)", "$(optenv NONE 1)"),
    *("$(eval 1/0)", "$(eval 1 + 1)", "$(cwd)", "$(dirname)", "$(anon a)", "$(none)", "${p0}", "${lambda: 1}"),
)
_ODD_BLOCKS = (
    *('<xacro:include filename="body.xacro"/>', '<xacro:include filename="none.xacro"/>', "<xacro:none/>"),
    *('<xacro:include filename="$(find none)/a.xacro"/>', '<xacro:include filename="/dev/zero"/>', "<xacro:if/>"),
    *('<xacro:include filename="packages/parts/*.xacro"/>', '<xacro:include filename="packages"/>', "<xacro:macro/>"),
    *('<xacro:macro name="own" params=""><xacro:own/></xacro:macro><xacro:own/>', '<xacro:insert_block name="none"/>'),
    *('<xacro:macro name="link" params="a b:=${a} *c **d"/><xacro:link a="1"/>', '<xacro:property name="p0"/>'),
    *('<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/><l a="${a}"/>', "<xacro:call/>"),
    *('<xacro:arg name="length"/>', '<xacro:arg name="length" default="3"/>', '<xacro:property value="1"/>'),
    *('<xacro:element xacro:name="link" name="more"/>', '<xacro:attribute name="name" value="other"/>', "<xacro:x:y/>"),
    *('<xacro:property name="k" value="${[0]}"/>${k.append(k)}', '<xacro:unless value="${2}"/>', "<xacro:/>"),
)
_PLACES = (["packages"], ["packages/parts"], [], ["none"], ["body.xacro"], ["packages", "folder"], [""], ["/"], ["."])
"""Folders of packages, as they are told."""
_VALUE = re.compile(r'="([^"<$]*)"')
_ROBOT = '<robot name="fuzzed" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'


def xacro(chance: Random) -> Trial:
    """A body of `bodies.urdf`, some of whose values are expressions, and some of whose links come from elsewhere."""
    text = urdf(chance).files["body.urdf"].decode(errors="replace")
    inside = re.sub(r"^.*?<robot[^>]*>|</robot>.*$", "", text, flags=re.DOTALL)
    before: list[str] = []
    for _ in range(chance.randrange(4)):
        found = list(_VALUE.finditer(inside))
        if not found:
            break
        place = chance.choice(found)
        inside = inside[: place.start(1)] + _expression(chance, place[1], before) + inside[place.end(1) :]
    parts = re.findall(r"<link .*?</link>|<link [^>]*/>", inside, flags=re.DOTALL)
    files: dict[str, bytes] = {"numbers.yaml": b"{a: 1.5, b: [1, 2]}\n", "packages/note.txt": b""}
    if parts and chance.randrange(2):
        part = chance.choice(parts)
        inside = inside.replace(part, "", 1)
        if chance.randrange(2):
            name = odd_one(chance, "part", ODD_NAMES, 30)
            before.append(f'<xacro:macro name="{name}" params="scale:=1">{part}</xacro:macro><xacro:{name}/>')
        else:
            include = odd_one(
                chance,
                "$(find parts)/part.xacro",
                ("packages/parts/part.xacro", "packages/parts/part.xacro", "part.xacro"),
                3,
            )
            before.append(f'<xacro:include filename="{include}"/>')
            content = _ROBOT.format(part).encode(errors="replace")
            files["packages/parts/part.xacro"] = sometimes_damaged(chance, content, 12)
            if chance.randrange(2):
                said = odd_one(
                    chance, "<package><name>parts</name></package>", ("<package/>", "", "<name>", "\x00"), 12
                )
                files["packages/parts/package.xml"] = said.encode()
    if rarely(chance, 8):
        truth = odd_one(chance, chance.choice(("true", "1", "${1 < 2}")), ("", "x", "${2}", "${nan}", "0"), 5)
        inside = f'<xacro:{chance.choice(("if", "unless"))} value="{truth}">{inside}</xacro:if>'
        inside = inside.replace("</xacro:if>", "</xacro:unless>") if inside.startswith("<xacro:unless") else inside
    if rarely(chance, 8):
        before.insert(chance.randrange(len(before) + 1), chance.choice(_ODD_BLOCKS))
    data = sometimes_damaged(chance, _ROBOT.format("".join(before) + inside).encode(errors="replace"), 12)
    name = chance.choice(("body.xacro", "body.xacro", "body.urdf"))
    places = chance.choice(_PLACES) if rarely(chance, 6) else _PLACES[0]
    given = odd_one(chance, {}, ({"on_unphysical": "warn"}, {"root": "free"}, {"root_body": "link0"}), 12)
    return Trial(
        kind="body", source="xacro", files={name: data} | files, main=name, options=given | {"packages": places}
    )


def _expression(chance: Random, value: str, before: list[str]) -> str:
    """What stands for a value, and what has to be said before."""
    if rarely(chance, 12):
        return chance.choice(_ODD_EXPRESSIONS)
    name = odd_one(chance, f"p{len(before)}", ODD_NAMES, 60)
    match chance.randrange(4):
        case 0:
            before.append(f'<xacro:property name="{name}" value="{value}"/>')
            return f"${{{name}}}"
        case 1:
            before.append(f'<xacro:arg name="{name}" default="{value}"/>')
            return f"$(arg {name})"
        case 2 if re.fullmatch(r"[-+.0-9e]+", value):
            return f"${{{value} + {abs(amount(chance, 0.01))!r}}}"
        case _:
            return f"${{{value!r}}}" if "'" not in value else value
