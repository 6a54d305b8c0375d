"""Options of `shapephase plan` for the joints: postures on the way, joints that move or follow, and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ...errors import ShapeError
from ..joint_values import joint_values, value_in_si
from ..options import option, rare

if TYPE_CHECKING:
    from ...arrays import Array
    from ...body.body import Body
    from ...optimal_control.plan_options import Limits, Waypoint

_STATED = "body"  # stands for the limits that a body's file states


@Parameter(name="*")
@dataclass(frozen=True)
class JointOptions:
    """Postures of the joints, and which of them move."""

    from_: Annotated[tuple[str, ...], option(name="--from", several=True)] = ()
    """Posture at the start: JOINT=VALUE with blanks or commas between them, in rad or m or with a unit, or the first
    row of a motion file; default: zero, or as near as the limits permit. For example
    `--from waist_pitch=30deg waist_yaw=0.1`."""
    to: Annotated[tuple[str, ...], option(several=True)] = ()
    """Posture at the end, as --from (last row of a file), or free; default: that of the start. For example
    `--to free`."""
    via: Annotated[tuple[str, ...], rare(negative_iterable="")] = ()
    """Posture passed without stopping: JOINT=VALUE with commas between them, with or without @ and a time in s; or
    FILE@TIME. Repeat for more, in this order. For example `--via waist_pitch=60deg@0.4`."""
    joints: Annotated[str | None, option(allow_leading_hyphen=True)] = None
    """Joints that move, with commas between them, or with a minus before each those that rest; default: all. For
    example `--joints waist_pitch,waist_yaw` or `--joints -head_yaw`."""
    mirror: Annotated[str | None, rare()] = None
    """Joints that follow others, or with a minus move against them; for example `--mirror hip_left=-hip_right`."""

    def arguments(self, body: Body) -> dict[str, Any]:
        """Return those arguments of `plan_reorientation` that concern postures and joints."""
        free = self.to == ("free",)
        return {
            "start": _posture(body, self.from_, "--from", first=True) if self.from_ else None,
            "end": "free" if free else _posture(body, self.to, "--to", first=False) if self.to else None,
            "via": [_waypoint(body, text) for text in self.via],
            "joints": _moving_joints(body, _names(self.joints)),
            "symmetric": dict(map(_follower, _names(self.mirror))),
        }


@Parameter(name="*")
@dataclass(frozen=True)
class LimitOptions:
    """Limits of the joints."""

    rate_limit: Annotated[tuple[str, ...], option(several=True)] = ()
    """Largest rate of every joint, or JOINT=VALUE, in rad/s or m/s or with a unit; default: as the body's file states.
    For example `--rate-limit 200deg/s` or `--rate-limit waist_yaw=3`."""
    acceleration_limit: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Largest acceleration, likewise, in rad/s^2 or m/s^2; default: none. For example `--acceleration-limit 20`."""
    jerk_limit: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Largest jerk, likewise, in rad/s^3 or m/s^3; default: none. With one, joints that start from rest start without
    acceleration. For example `--jerk-limit 100`."""
    effort: Annotated[str | None, rare()] = None
    """Largest torque or force of every joint, in N m or N, or body for the limits that the body's file states; default:
    none. For example `--effort body`."""
    avoid: Annotated[str | None, option()] = None
    """Least distance between links, in m or with a unit, as for `check --clearance`; default: they may pass through
    each other. For example `--avoid 2cm`."""
    srdf: Annotated[Path | None, rare()] = None
    """Pairs of links that --avoid leaves out: an SRDF file; for example `--srdf robot.srdf`."""

    def limits(self, body: Body) -> Limits:
        """Return the limits. Raises ShapeError, UnknownNameError."""
        from ...optimal_control.plan_options import Limits

        rates = self.rate_limit or (_STATED,)
        return Limits(
            rate_limits=_STATED if rates == (_STATED,) else _limit(body, rates, "--rate-limit", 1),
            acceleration_limits=_limit(body, self.acceleration_limit, "--acceleration-limit", 2),
            jerk_limits=_limit(body, self.jerk_limit, "--jerk-limit", 3),
            effort_limits=None if self.effort is None else _effort(self.effort),
            clearance=None if self.avoid is None else value_in_si(self.avoid, "m", "--avoid"),
            srdf=self.srdf,
        )


def _limit(body: Body, words: tuple[str, ...], option: str, order: int) -> float | Array | None:
    """Return one limit for all joints, one for each (n,), or None without words."""
    import numpy as np

    if not words:
        return None
    if len(words) == 1 and "=" not in words[0]:
        return np.array([value_in_si(words[0], unit, option, order) for unit in body.joint_units])
    given = joint_values(body, words, option, order=order)
    stated = body.rate_limits if order == 1 else np.full(body.n_shape, math.inf)
    limits = np.array([given.get(name, other) for name, other in zip(body.joint_names, stated, strict=True)])
    if not np.isfinite(limits).all():
        missing = ", ".join(name for name, limit in zip(body.joint_names, limits, strict=True) if limit == math.inf)
        raise ShapeError(f"{option}: a limit is needed for each joint that has none in the body's file: {missing}")
    return limits


def _effort(word: str) -> float | str:
    if word == _STATED:
        return word
    try:
        return float(word)
    except ValueError:
        raise ShapeError(
            f"--effort: a number of N m or N above 0 is needed, or {_STATED} for those of the body's file, got {word!r}"
        ) from None


def _posture(body: Body, words: tuple[str, ...], option: str, *, first: bool) -> Array:
    """Return a shape (n,) from JOINT=VALUE, or from the first or last row of a motion file."""
    import numpy as np

    if len(words) == 1 and "=" not in words[0]:
        from ...shape_space.files.read import read_shape_path

        path = read_shape_path(Path(words[0]), body)
        return path.shape(0.0 if first else path.duration)
    shape = np.clip(body.shape(), *body.joint_limits.T)
    for name, value in joint_values(body, words, option).items():
        shape[body.joint_index(name)] = value
    return shape


def _waypoint(body: Body, text: str) -> Waypoint:
    """Return a posture to pass, from JOINT=VALUE with or without a time behind @, or from a motion file at a time."""
    from ...optimal_control.plan_options import Waypoint

    posture, timed, at = text.rpartition("@") if "@" in text else (text, "", "")
    time = _time(at) if timed else None
    if "=" in posture:
        return Waypoint(joint_values(body, [posture], "--via"), time)
    if time is None:
        raise ShapeError(f"--via: JOINT=VALUE, or FILE@TIME with the time in s, is needed, got {text!r}")
    from ...shape_space.files.read import read_shape_path

    path = read_shape_path(Path(posture), body)
    if not time <= path.duration:
        raise ShapeError(f"--via: {posture} ends at {path.duration:g} s, which is before {time:g} s")
    return Waypoint(path.shape(time), time)


def _time(text: str) -> float:
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not 0.0 < time < math.inf:
        raise ShapeError(f"--via: behind @ a time in s above 0 is needed, got {text!r}")
    return time


def _names(text: str | None) -> list[str]:
    return [name.strip() for name in (text or "").split(",") if name.strip()]


def _moving_joints(body: Body, names: list[str]) -> list[str] | None:
    """Return the joints that move; None: all."""
    resting = [name.removeprefix("-") for name in names if name.startswith("-")]
    if resting and len(resting) < len(names):
        raise ShapeError("--joints: joints that move, or with a minus before each those that rest, not both")
    if resting:
        columns = body.joint_columns(resting)
        return [name for column, name in enumerate(body.joint_names) if column not in columns]
    return names or None


def _follower(pair: str) -> tuple[str, tuple[str, float]]:
    """Return from NAME=LEADER or NAME=-LEADER a joint, its leader and the factor."""
    name, equals, leader = (text.strip() for text in pair.partition("="))
    if not equals or not leader.strip("- "):
        raise ShapeError(f"--mirror: NAME=LEADER or NAME=-LEADER is needed, got {pair!r}")
    return name, (leader.removeprefix("-"), -1.0 if leader.startswith("-") else 1.0)
