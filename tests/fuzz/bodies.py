"""Grammars of bodies: URDF and MJCF."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from xml.sax.saxutils import quoteattr

from .pieces import ODD_NAMES, Trial, entry, odd_one, rarely, sometimes_damaged

_MASSES = (0.0, -1.0, 1e-16, 1e-12, 1e-320, 1e7, 1e29, 1e31, 1e300)
_MOMENTS = (0.0, -1e-3, 1e-14, 1.0, 1e5, 1e28, -1e-30)
_TAGS = (
    "Link",
    "links",
    "joints",
    "inertia",
    "mass",
    "origin",
    "axis",
    "limit",
    "transmission",
    "gazebo",
    "xacro:macro",
)


def _numbers(chance: Random, values: Sequence[float]) -> str:
    words = [entry(chance, value, 250).strip() for value in values]
    if rarely(chance, 150):
        words = words[:-1] if chance.randrange(2) else [*words, "0"]
    return chance.choice((" ", "  ", "\t", " ")).join(words)


def _three(chance: Random, most: float = 1.0) -> list[float]:
    return [most * (chance.randrange(201) - 100) / 100.0 for _ in range(3)]


def _positive(chance: Random, most: float) -> float:
    return most * (1 + chance.randrange(100)) / 100.0


def _xml(chance: Random, tag: str, attributes: dict[str, str], *children: str) -> str:
    """An element, once in a while with an attribute lost, doubled, renamed, or another tag."""
    found = dict(attributes)
    if found and rarely(chance, 120):
        found.pop(chance.choice(sorted(found)))
    if found and rarely(chance, 120):
        found[odd_one(chance, chance.choice(sorted(found)) + "x", ("unit", "value", "NAME"), 3)] = "1"
    name = odd_one(chance, tag, _TAGS, 200)
    inside = list(children)
    if inside and rarely(chance, 80):
        inside.append(chance.choice(inside))
    if inside and rarely(chance, 80):
        inside.pop(chance.randrange(len(inside)))
    said = "".join(f" {key}={quoteattr(value)}" for key, value in found.items())
    return f"<{name}{said}/>" if not inside else f"<{name}{said}>{''.join(inside)}</{name}>"


def _moments(chance: Random, mass: float) -> list[float]:
    """Principal moments of three pairs of points, which satisfy the triangle inequality; or any."""
    squares = [mass * (0.01 + _positive(chance, 0.1)) ** 2 for _ in range(3)]
    moments = [squares[1] + squares[2], squares[0] + squares[2], squares[0] + squares[1]]
    if rarely(chance, 20):
        moments[chance.randrange(3)] = chance.choice(_MOMENTS)
    return moments


def _origin(chance: Random, turned: bool = True) -> str:
    said = {"xyz": _numbers(chance, _three(chance))}
    if turned and chance.randrange(2):
        said["rpy"] = _numbers(chance, _three(chance, 3.2))
    return _xml(chance, "origin", said)


def _urdf_link(chance: Random, name: str) -> str:
    mass = odd_one(chance, _positive(chance, 5.0), _MASSES, 25)
    xx, yy, zz = _moments(chance, abs(mass))
    products = [0.0, 0.0, 0.0] if not rarely(chance, 6) else [0.1 * xx, -0.05 * yy, 0.0]
    inertia = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), (xx, yy, zz, *products), strict=True))
    inertial = _xml(
        chance,
        "inertial",
        {},
        _origin(chance),
        _xml(chance, "mass", {"value": _numbers(chance, [mass])}),
        _xml(chance, "inertia", {key: _numbers(chance, [value]) for key, value in inertia.items()}),
    )
    parts = [] if rarely(chance, 12) else [inertial]
    if rarely(chance, 6):
        shape = _xml(chance, "geometry", {}, _xml(chance, "box", {"size": _numbers(chance, [0.1, 0.2, 0.3])}))
        parts.append(_xml(chance, "visual", {}, _origin(chance), shape))
    return _xml(chance, "link", {"name": name}, *parts)


def _urdf_joint(chance: Random, name: str, parent: str, child: str, others: Sequence[str]) -> str:
    kind = odd_one(
        chance, chance.choice(("revolute", "continuous", "prismatic", "fixed")), ("floating", "planar", "ball", ""), 60
    )
    parts = [_xml(chance, "parent", {"link": parent}), _xml(chance, "child", {"link": child}), _origin(chance)]
    if kind != "fixed":
        parts.append(
            _xml(
                chance,
                "axis",
                {"xyz": _numbers(chance, odd_one(chance, [0.0, 0.6, 0.8], ([0.0] * 3, [1e-12, 0.0, 0.0]), 40))},
            )
        )
    if kind in ("revolute", "prismatic"):
        ends = odd_one(chance, [-1.0, 1.0], ([1.0, -1.0], [0.0, 0.0], [2.0, 3.0], [-1e300, 1e300]), 25)
        limit = dict(zip(("lower", "upper", "effort", "velocity"), [*ends, 1.0, 1.0], strict=True))
        parts.append(_xml(chance, "limit", {key: _numbers(chance, [value]) for key, value in limit.items()}))
    if others and rarely(chance, 10):
        parts.append(
            _xml(chance, "mimic", {"joint": chance.choice((*others, name)), "multiplier": _numbers(chance, [2.0])})
        )
    return _xml(chance, "joint", {"name": name, "type": kind}, *parts)


def urdf(chance: Random) -> Trial:
    """A tree of links."""
    links = [odd_one(chance, f"link{k}", ODD_NAMES, 80) for k in range(1 + chance.randrange(5))]
    elements = [_urdf_link(chance, name) for name in links]
    joints: list[str] = []
    for k in range(1, len(links)):
        name = odd_one(chance, f"joint{k}", ODD_NAMES, 80)
        parent = links[odd_one(chance, chance.randrange(k), (k, len(links) - 1), 60)]
        elements.append(_urdf_joint(chance, name, parent, links[k], joints))
        joints.append(name)
    if rarely(chance, 4):
        chance.shuffle(elements)
    text = _xml(chance, "robot", {"name": "fuzzed"}, *elements)
    return _trial(chance, text, "URDF", "body.urdf")


def _trial(chance: Random, text: str, source: str, name: str) -> Trial:
    start = odd_one(
        chance,
        "",
        ('<?xml version="1.0"?>\n', '<?xml version="1.0" encoding="UTF-16"?>', "\ufeff", "<!DOCTYPE a>", "\n"),
        6,
    )
    data = sometimes_damaged(chance, (start + text).encode(errors="replace"), 12)
    given = odd_one(chance, {}, ({"on_unphysical": "warn"},), 4)
    return Trial(kind="body", source=source, files={name: data}, main=name, options=given)


def _turned(chance: Random) -> dict[str, str]:
    way = chance.randrange(10)
    if way == 6:
        return {"euler": _numbers(chance, _three(chance, 90.0))}
    if way == 7:
        return {"quat": _numbers(chance, [1.0, 0.1, 0.2, 0.3])}
    if way == 8:
        return {"axisangle": _numbers(chance, [0.0, 0.0, 1.0, 30.0])}
    if way == 9:
        return {
            "xyaxes": _numbers(
                chance, odd_one(chance, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ([1.0, 0.0, 0.0, 2.0, 0.0, 0.0], [0.0] * 6), 8)
            )
        }
    return {}


def _geom(chance: Random) -> str:
    kind = odd_one(
        chance,
        chance.choice(("sphere", "box", "capsule", "cylinder", "ellipsoid")),
        ("plane", "mesh", "hfield", "cone"),
        40,
    )
    said = {
        "type": kind,
        "size": _numbers(chance, [_positive(chance, 0.2) for _ in range(3)]),
        "pos": _numbers(chance, _three(chance)),
    }
    if kind in ("capsule", "cylinder", "box", "ellipsoid") and rarely(chance, 4):
        said = {
            "type": kind,
            "size": _numbers(chance, [0.05]),
            "fromto": _numbers(chance, [*_three(chance), *_three(chance)]),
        }
    else:
        said |= _turned(chance)
    if rarely(chance, 3):
        said |= {chance.choice(("mass", "density")): _numbers(chance, [odd_one(chance, 2.0, _MASSES, 15)])}
    return _xml(chance, "geom", said)


def _mjcf_body(chance: Random, names: list[str], depth: int) -> str:
    name = odd_one(chance, f"body{len(names)}", ODD_NAMES, 80)
    names.append(name)
    parts = []
    if depth:
        for _ in range(odd_one(chance, 1, (0, 2, 3), 4)):
            kind = odd_one(chance, "hinge", ("slide", "slide", "ball", "free"), 4)
            said = {"name": f"joint{len(names)}_{len(parts)}", "type": kind, "axis": _numbers(chance, [0.0, 0.6, 0.8])}
            if rarely(chance, 3):
                said["range"] = _numbers(chance, odd_one(chance, [-40.0, 40.0], ([1.0, -1.0], [0.0, 0.0]), 10))
            if rarely(chance, 4):
                said["pos"] = _numbers(chance, _three(chance))
            parts.append(_xml(chance, "joint", said))
    else:
        parts += [_xml(chance, "freejoint", {})] * odd_one(chance, 1, (0, 2), 6)
    if chance.randrange(2):
        mass = odd_one(chance, _positive(chance, 5.0), _MASSES, 25)
        said = {"mass": _numbers(chance, [mass]), "pos": _numbers(chance, _three(chance))}
        if rarely(chance, 3):
            said["fullinertia"] = _numbers(chance, [*_moments(chance, abs(mass)), 0.0, 0.0, 0.0])
        else:
            said |= {"diaginertia": _numbers(chance, _moments(chance, abs(mass)))} | _turned(chance)
        parts.append(_xml(chance, "inertial", said))
    if not parts or chance.randrange(2) or len(parts) < 2:
        parts.append(_geom(chance))
    for _ in range(chance.randrange(3) if depth < 3 and len(names) < 5 else 0):
        inside = _mjcf_body(chance, names, depth + 1)
        parts.append(
            inside
            if not rarely(chance, 8)
            else _xml(chance, "frame", {"pos": _numbers(chance, _three(chance))} | _turned(chance), inside)
        )
    return _xml(chance, "body", {"name": name, "pos": _numbers(chance, _three(chance))} | _turned(chance), *parts)


def mjcf(chance: Random) -> Trial:
    """A model of MuJoCo."""
    setting = odd_one(
        chance,
        {"angle": chance.choice(("degree", "radian"))},
        (
            {"eulerseq": "ZYX"},
            {"inertiafromgeom": "true"},
            {"inertiafromgeom": "false"},
            {"settotalmass": "2"},
            {"eulerseq": "xx"},
            {"angle": "x"},
        ),
        4,
    )
    parts = [_xml(chance, "compiler", setting)] * chance.randrange(2)
    if rarely(chance, 5):
        parts.append(_xml(chance, "default", {}, _xml(chance, "geom", {"density": _numbers(chance, [500.0])})))
    parts.append(_xml(chance, "worldbody", {}, _mjcf_body(chance, [], 0)))
    if rarely(chance, 20):
        parts.append(
            chance.choice(
                ("<equality><joint joint1='a'/></equality>", "<include file='x.xml'/>", "<actuator/>", "<asset/>")
            )
        )
    return _trial(chance, _xml(chance, "mujoco", {"model": "fuzzed"}, *parts), "MJCF", "body.xml")
