"""Postures and lists of joints, from the words of the command line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import ShapeError

if TYPE_CHECKING:
    from ...arrays import Array
    from ...body.body import Body


def posture(body: Body, text: str, option: str, *, first: bool) -> Array:
    """A shape from NAME=VALUE pairs, or from the first or last row of a motion file: (n,).

    Joints that are not named are at zero, or as near as their limits permit.
    """
    import numpy as np

    if "=" not in text:
        from ...shape_space.files.read import read_shape_path

        path = read_shape_path(Path(text), body)
        return path.shape(0.0 if first else path.duration)
    shape = np.clip(body.shape(), *body.joint_limits.T)
    for pair in text.split(","):
        name, found, value = pair.partition("=")
        if not found:
            raise ShapeError(
                f"{option}: NAME=VALUE pairs with commas between them, or a file, are needed, got {text!r}"
            )
        shape[body.joint_index(name.strip())] = _value(value.strip(), option)
    return shape


def names(text: str | None) -> list[str]:
    """Names with commas between them."""
    return [] if text is None else [name.strip() for name in text.split(",") if name.strip()]


def moving_joints(body: Body, joints: str | None, hold: str | None) -> list[str] | None:
    """The joints that may move; None: all."""
    if joints is not None and hold is not None:
        raise ShapeError("--joints and --hold each say which joints move; give one of them")
    if hold is not None:
        held = body.joint_columns(names(hold))
        return [name for number, name in enumerate(body.joint_names) if number not in held]
    return None if joints is None else names(joints)


def mirrored(text: str | None) -> dict[str, tuple[str, float]]:
    """Joints that follow others, NAME=LEADER or NAME=-LEADER: name -> (name of the leader, factor)."""
    followers = {}
    for pair in names(text):
        name, found, leader = pair.partition("=")
        if not found or not leader.strip("- "):
            raise ShapeError(f"--mirror: NAME=LEADER or NAME=-LEADER is needed, got {pair!r}")
        leader = leader.strip()
        followers[name.strip()] = (leader.removeprefix("-"), -1.0 if leader.startswith("-") else 1.0)
    return followers


def _value(text: str, option: str) -> float:
    """In rad or m; with "deg" behind it in degrees."""
    try:
        value = math.radians(float(text.removesuffix("deg"))) if text.endswith("deg") else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ShapeError(f"{option}: a number in rad or m, or with deg behind it, is needed, got {text!r}")
    return value
