"""Postures and lists of joints, from the words of the command line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import ShapeError

if TYPE_CHECKING:
    from ...arrays import Array
    from ...body.body import Body
    from ...optimal_control.plan_options import Waypoint


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
    for name, value in _coordinates(text, option).items():
        shape[body.joint_index(name)] = value
    return shape


def _coordinates(text: str, option: str) -> dict[str, float]:
    """Of joints, from NAME=VALUE pairs with commas between them."""
    named = {}
    for pair in text.split(","):
        name, found, value = pair.partition("=")
        if not found:
            raise ShapeError(
                f"{option}: NAME=VALUE pairs with commas between them, or a file, are needed, got {text!r}"
            )
        named[name.strip()] = _value(value.strip(), option)
    return named


def waypoint(body: Body, text: str) -> Waypoint:
    """A posture to pass, with its time behind an `@` or without: of NAME=VALUE pairs the joints named, or of a file.

    Of a motion file the posture at that time is passed at that time.
    """
    from ...optimal_control.plan_options import Waypoint

    named, timed, at = text.rpartition("@")
    named, at = (named, at) if timed else (text, "")
    time = _time(at) if timed else None
    if "=" in named:
        return Waypoint(_coordinates(named, "--via"), time)
    if time is None:
        raise ShapeError(f"--via: NAME=VALUE pairs, or FILE@TIME, the time in s, are needed, got {text!r}")
    from ...shape_space.files.read import read_shape_path

    path = read_shape_path(Path(named), body)
    if not time <= path.duration:
        raise ShapeError(f"--via: {named} ends at {path.duration:g} s, which is before {time:g} s")
    return Waypoint(path.shape(time), time)


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


def _time(text: str) -> float:
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not 0.0 < time < math.inf:
        raise ShapeError(f"--via: behind @ a time in s above 0 is needed, got {text!r}")
    return time


def _value(text: str, option: str) -> float:
    """In rad or m; with "deg" behind it in degrees."""
    try:
        value = math.radians(float(text.removesuffix("deg"))) if text.endswith("deg") else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ShapeError(f"{option}: a number in rad or m, or with deg behind it, is needed, got {text!r}")
    return value
