"""Grammars of ball joints: bodies in URDF, MJCF and bioMod, and columns of their quaternions and angles."""

from __future__ import annotations

import math
from random import Random

from support.ball_bodies import BALLS, ORDER

from .bodies import mjcf, urdf
from .engine_bodies import biomod
from .pieces import ODD_NAMES, Trial, amount, ascending, entry, odd_one, rarely, sometimes_damaged

_ODD_LABELS = (
    *("neck.r", "neck.w", "neck.x [deg]", "neck.x [1]", "neck", "neck.rx", "elbow.x", "neck.rw", "neck.wx", "Neck.x"),
    *("neck.rx_deg", "neck.ry [deg]", "neck.rz [m]", "shoulder.rx", "shoulder.x_deg", "neck.x [m]", "neck.x [SI]"),
)
_OPTIONS = (
    *({"rest_missing": True}, {"degrees": True}, {"degrees": False}, {"close": 0.5}, {"smooth": 0.01}),
    *(
        {"rest": {"neck.x": 1.0}, "rest_missing": True},
        {"rest": {"neck.w": 0.0}},
        {"resample": 40.0},
        {"close": "5deg"},
    ),
    *(
        {"names": {"neck.x": "neck.y", "neck.y": "neck.x"}},
        {"close": 2.0, "close_by": "geodesic"},
        {"trim": [0.0, 0.3]},
    ),
)


def bodies(chance: Random) -> Trial:
    """A body whose joints are balls more often than not."""
    made = chance.choice((urdf, urdf, mjcf, biomod))(chance)
    (name,) = made.files
    data = made.files[name]
    if name.endswith("urdf"):
        for kind in (b"revolute", b"continuous", b"prismatic"):
            if chance.randrange(3):
                data = data.replace(b'type="' + kind, b'type="spherical')
    elif name.endswith("xml"):
        for kind in (b"hinge", b"slide"):
            if chance.randrange(2):
                data = data.replace(b'type="' + kind, b'type="ball')
    else:
        lines = data.splitlines(keepends=True)
        data = b"".join(
            b"\trotations q\n" if line.startswith(b"\trotations") and chance.randrange(2) else line for line in lines
        )
    return Trial(kind="body", source=f"balls {made.source}", files={name: data}, main=name, options=made.options)


def _quaternion(chance: Random) -> list[float]:
    """Of length one, or nearly, or odd."""
    numbers = [amount(chance, 1.0), amount(chance, 1.0), amount(chance, 1.0), 0.5]
    length = math.hypot(*numbers) * odd_one(chance, 1.0, (0.97, 1.05, -1.0, -1.0, 1.2, 1e-5, 1e5, 1e300), 12)
    return odd_one(chance, [number / length for number in numbers], ([0.0] * 4, [1.0] * 4, [0.0, 0.0, 0.0, -1.0]), 40)


def columns(chance: Random) -> Trial:
    """A table with the joints of a body with two balls and a hinge, as quaternions or as angles."""
    count = odd_one(chance, 4 + chance.randrange(4), (1, 2), 20)
    table: dict[str, list[float]] = {"time": ascending(chance, count)}
    for ball in ("shoulder", "neck"):
        if rarely(chance, 3):
            for axis in chance.sample("xyz", 3):
                table[f"{ball}.r{axis}"] = [amount(chance, 2.0) for _ in range(count)]
        else:
            first = _quaternion(chance)
            rows = [_quaternion(chance) if rarely(chance, 4) else list(first) for _ in range(count)]
            rows = [[-part for part in row] if rarely(chance, 6) else row for row in rows]
            for part, values in zip("xyzw", zip(*rows, strict=True), strict=True):
                table[f"{ball}.{part}"] = list(values)
    table["elbow"] = [amount(chance) for _ in range(count)]
    labels = list(table)
    if rarely(chance, 6):
        labels.remove(chance.choice(labels[1:]))
    if rarely(chance, 6):
        labels.append(chance.choice(ORDER))
    if rarely(chance, 4):
        labels = [labels[0], *chance.sample(labels[1:], len(labels) - 1)]
    said = [odd_one(chance, label, (*_ODD_LABELS, chance.choice(ODD_NAMES)), 60) for label in labels]
    rows = [[entry(chance, table.get(label, [0.0] * count)[k], 400) for label in labels] for k in range(count)]
    text = "\n".join(",".join(row) for row in [said, *rows]) + "\n"
    return Trial(
        kind="motion",
        source="balls CSV",
        files={"motion.csv": sometimes_damaged(chance, text.encode(errors="replace"), 15), "body.urdf": BALLS.encode()},
        main="motion.csv",
        options=dict(odd_one(chance, {}, _OPTIONS, 4)),
    )
