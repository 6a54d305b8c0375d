"""Columns of a recording matched to the joints of a body by name, in SI units; what is doubtful is asked or told."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...arguments import check_flag
from ...arrays import FARTHEST, Array, Integers
from ...body.body import Body
from ...errors import ShapeError, TrajectoryError, UnknownColumnError, unknown_name
from ...letters import what_came
from ..ball_columns import ball_columns
from ._ball_columns import continued_balls, continued_hinges, with_quaternions
from ._gaps import Gaps
from ._pose_columns import HINT, base_names
from ._unit_doubts import check_unit, warn_of_limits, warn_of_turns
from .base_columns import KNOWN, BaseChoices, BaseColumns, BaseMotion
from .labels import (
    ANGLES,
    LENGTHS,
    NO_UNIT,
    SI,
    Label,
    in_square_brackets,
    is_counter,
    joint_part,
    label,
    other_unit,
    quantity,
)
from .recording import LONGEST_NAME, Recording, warn
from .times import is_clock, part_of

_STILL = 1e-9  # [rad, m or degrees] range of a locked coordinate
_FEW = 6  # joints that the warning about missing columns lists
_MOST_SHOWN = 50  # columns that an error lists
_NO_JOINT = "no joint of the body"
_SAME = 1e-6  # relative to their range: printed digits of a coordinate that follows another


@dataclass(frozen=True, kw_only=True)
class JointChoices:
    """How columns become joints: what a caller has said, checked.

    Attributes
    ----------
    names : label -> name of the joint, with a unit if need be; None for a column to be left out
    degrees : whether turning joints are in degrees; None: as the file says. A sliding joint never is
    rest : joint -> value [rad or m] or a text with its unit, of joints without a column
    rest_missing : whether joints without a column rest at zero, or at the limit that is nearest to it
    ignore_extra : whether columns that are no joints are left out
    base : the same of the columns of the base
    fill : the longest gap that is bridged [s]; None: all are refused
    """

    names: Mapping[str, str | None]
    base: BaseChoices
    degrees: bool | None = None
    rest: Mapping[str, float | str] | None = None
    rest_missing: bool = False
    ignore_extra: bool = False
    fill: float | None = None

    def __post_init__(self) -> None:
        """Check what a caller has said. Raises ShapeError."""
        check_flag(self.degrees, "degrees", allow_none=True)
        check_flag(self.rest_missing, "rest_missing")
        check_flag(self.ignore_extra, "ignore_extra")
        if self.rest is not None and not isinstance(self.rest, Mapping):
            raise ShapeError(f"rest: a mapping, joint -> value, is needed, got {what_came(self.rest)}")


class Matched(NamedTuple):
    """The motion of a body's joints that a recording holds.

    Attributes
    ----------
    shapes : (N, n) [rad or m] in the body's order
    base : the motion of the base
    columns : joint -> the label of its column
    units : joint -> the unit in which its column was read
    at_rest : joint -> where it rests [rad or m], of joints without a column
    left_out : label -> why it was left out
    gaps : what was filled, and cut off at the ends, as JSON can hold it; None: the recording has no gaps
    """

    shapes: Array
    base: BaseMotion
    columns: dict[str, str]
    units: dict[str, str]
    at_rest: dict[str, float]
    left_out: dict[str, str]
    gaps: dict[str, Any] | None

    def kept(self, samples: Integers) -> Matched:
        """Some of the samples, by their places."""
        return self._replace(shapes=self.shapes[samples], base=self.base.kept(samples))


def matched(recording: Recording, body: Body, choices: JointChoices) -> tuple[Recording, Matched]:
    """The recording without gaps at its ends, and the shapes of a body that it holds.

    Raises UnknownNameError if a column is no joint of the body. Raises TrajectoryError if a joint is missing or
    doubled, a value is no number or no possible coordinate, a quaternion is not of unit length, a gap is not to be
    bridged, or the unit of a column can only be guessed. Warns where a joint leaves its limits, or jumps by about a
    whole turn from one sample to the next.
    """
    where = recording.table.where
    for text in recording.table.columns:
        if len(text) > LONGEST_NAME:
            raise TrajectoryError(f"{where}: a column's name has {len(text)} characters: {text[:40]!r}...")
    gaps = Gaps(recording, choices.fill)
    recording, turned = with_quaternions(recording, body, choices.names, choices.degrees, gaps)
    table = recording.table
    shapes = np.empty((len(recording.times), body.n_shape))
    found: dict[int, str] = {}
    units: dict[str, str] = {}
    known: set[int] = set()
    base = BaseColumns(
        recording, gaps, choices.base, choices.degrees, body.base_angles, body.base_slides, body.base_joints
    )
    left_out = {text: f"{what}, no column" for text, what in table.unread.items()} | dict(table.left_out)
    targets = {text: target for text in table.columns if (target := choices.names.get(text, text)) is not None}
    of_base = base_names(targets, {*body.joint_names, *KNOWN, *base.own_names})
    joints = (*body.joint_names, *base.own_names)
    companions: dict[str, str] = {}
    unexplained = False
    for text, values in table.columns.items():
        if text not in targets:
            left_out[text] = "as told by names"
            continue
        target = targets[text]
        resolved = _resolved(target, body)
        if resolved is None and base.take(text, _with_unit(of_base.get(text), target)):
            continue
        if resolved is None:
            part = joint_part(label(target).name, joints)
            if part is not None and not part[1] and base.take(text, _with_unit(part[0], target)):
                continue
            if part is not None and part[1]:
                companions[part[0]] = text
            left_out[text] = _why_left_out(text, target, recording, body, joints, choices)
            unexplained = unexplained or left_out[text] == _NO_JOINT
            continue
        joint = body.joint_names.index(resolved.name)
        unit, stated = _unit(text, resolved, joint, body, recording, choices.degrees)
        if joint in found:
            raise TrajectoryError(f"{where}: columns {found[joint]!r} and {text!r} are the same joint; keep one")
        values = gaps.held(table, text)
        found[joint] = text
        units[body.joint_names[joint]] = unit
        known |= {joint} if stated else set()
        shapes[:, joint] = (1.0 if unit == NO_UNIT else (ANGLES | LENGTHS)[unit]) * values
    for ball in ball_columns(body.joint_names):
        quaternion = [column for column in range(ball.start, ball.stop) if column in found]
        if quaternion:
            gaps.joined(table, [found[column] for column in quaternion])
            shapes[:, quaternion] = np.stack([gaps.held(table, found[column]) for column in quaternion], axis=1)
    _check_unread(found, body, recording, choices)
    if body.n_shape and not found and choices.rest_missing:
        _check_meant(left_out, body, recording)
    at_rest = _rest_of_missing(found, body, where, choices, companions, unexplained=unexplained)
    for name, value in at_rest.items():
        shapes[:, body.joint_index(name)] = value
    for joint in range(body.n_shape):
        _check_reach(shapes[:, joint], joint, body, recording)
        if joint in found and joint not in known:
            check_unit(shapes[:, joint], joint, body, recording)
    shapes = continued_hinges(shapes, body, recording)
    for joint in np.flatnonzero(body.continuous).tolist():
        warn_of_turns(shapes[:, joint], body.joint_names[joint], recording)
    for joint, text in found.items():
        if body.joint_units[joint] != NO_UNIT:
            shapes[:, joint] = gaps.bridged([text], shapes[:, joint])
    warn_of_limits(shapes, body, recording)
    shapes = continued_balls(shapes, body, recording, gaps, found)
    base_motion = base.motion(ignore_extra=choices.ignore_extra)
    columns = {body.joint_names[joint]: turned.get(text, text) for joint, text in found.items()}
    kept, filled = gaps.settled()
    motion = Matched(shapes, base_motion, columns, units, at_rest, left_out | base_motion.left_out, filled)
    return (recording, motion) if len(kept) == len(shapes) else (part_of(recording, kept), motion.kept(kept))


def _with_unit(name: str | None, target: str) -> str:
    """The name of a column of the base with the unit that its own label has; without such a name the label."""
    unit = label(target).unit
    return target if name is None else name if unit is None else f"{name} [{unit}]"


def _resolved(target: str, body: Body) -> Label | None:
    """The joint and the unit that a name stands for, or None."""
    if target in body.joint_names:
        return Label(target, None)
    parts = label(target)
    if parts.name in body.joint_names:
        return parts
    part = joint_part(parts.name, body.joint_names) if other_unit(target) is None else None
    return Label(part[0], parts.unit) if part is not None and not part[1] else None


def _why_left_out(
    text: str, target: str, recording: Recording, body: Body, joints: Collection[str], choices: JointChoices
) -> str:
    """Why a column that is no joint is left out; UnknownColumnError if nobody has said that it may be."""
    table = recording.table
    if text not in choices.names:
        said = _beside_a_motion(text, recording, joints)
        if said is not None:
            return said
        if choices.ignore_extra:
            return _NO_JOINT
        if target in body.couplings:
            return f"follows {' and '.join(body.couplings[target].drivers) or 'nothing: it is locked'}"
        if table.format.startswith("OpenSim") and np.isfinite(values := table.columns[text]).all():
            if np.ptp(values) <= _STILL:
                return f"locked at {values[0]:.6g}"
            for other, those in table.columns.items():
                if other != text and np.ptp(those - values) <= _SAME * np.ptp(values) and other in text:
                    return f"coupled to {other}"
    unit = in_square_brackets(target)
    if unit is not None and target[: target.rindex("[")].strip() in body.joint_names:
        units = ", ".join([*ANGLES, *LENGTHS])
        raise TrajectoryError(f"{table.where}: column {text!r}: no unit {unit!r:.40} is known; these are: {units}")
    kind = f"column in {table.where}; joint of {body.name}"
    error = unknown_name(kind, target, body.joint_names, UnknownColumnError)
    near = difflib.get_close_matches(target, body.joint_names, n=1)
    joint = near[0] if near else "JOINT" if body.n_shape else "base_x"
    raise UnknownColumnError(
        f"{error}; {HINT}. Say which it is: --names '{text}={joint}' (names={{{text!r}: {joint!r}}}); or leave it out: "
        f"--names '{text}=', or --ignore-extra for all that are no joints (ignore_extra=True)"
    )


def _beside_a_motion(text: str, recording: Recording, joints: Collection[str]) -> str | None:
    """What a column is that says nothing of the posture: a rate, a counter, a text; None where it may say something."""
    table = recording.table
    part = joint_part(label(text).name, joints)
    if part is not None and part[1]:
        return f"{part[1]} of {part[0]}"
    unit = other_unit(text)
    if unit is not None:
        return f"in {unit}: no position"
    values = table.columns[text]
    if is_clock(text):
        return "another clock"
    if is_counter(text) and bool((values == np.rint(values)).all()):
        return "counts the rows"
    if np.isnan(values).all():
        return "text" if table.faults.get(text) else "empty"
    return None


def _unit(
    text: str, target: Label, joint: int, body: Body, recording: Recording, degrees: bool | None
) -> tuple[str, bool]:
    """The unit of a column, and whether the caller or its header has said it."""
    table, name = recording.table, body.joint_names[joint]
    turns = body.joint_units[joint] == "rad"
    # A column keeps its unit when it is given another name.
    own = table.units.get(text) or (label(text).unit if text not in body.joint_names else None)
    said = target.unit or own
    if body.joint_units[joint] == NO_UNIT:
        if said not in (None, SI, NO_UNIT):
            raise TrajectoryError(f"{table.where}: column {text!r} is in {said}; a quaternion has no unit")
        return NO_UNIT, True
    if target.unit and own and target.unit != own:
        raise TrajectoryError(f"{table.where}: column {text!r} is in {own}, and names says {target.unit}")
    if said == SI:
        said = body.joint_units[joint]
    if said is not None and said not in (ANGLES if turns else LENGTHS):
        spelled = "degrees" if said == "deg" else said
        moves = "turns and is in rad or degrees" if turns else "slides and is in metres"
        raise TrajectoryError(f"{table.where}: column {text!r} is in {spelled}, but joint {name} {moves}")
    if not turns:
        return said or "m", said is not None
    if said is not None and degrees is not None and degrees != (said == "deg"):
        spelled = "degrees" if said == "deg" else said
        raise TrajectoryError(
            f"{table.where}: column {text!r} is in {spelled} by its name, and degrees={degrees} was given"
        )
    if said is not None:
        return said, True
    if degrees is not None:
        return "deg" if degrees else "rad", True
    if table.degrees is None:
        raise TrajectoryError(
            f"{table.where}: the header does not say inDegrees=yes or no; add that, or give degrees=True or False "
            "(--degrees, --radians)"
        )
    return "deg" if table.degrees else "rad", table.degrees


def _check_unread(found: Mapping[int, str], body: Body, recording: Recording, choices: JointChoices) -> None:
    """Raise TrajectoryError where a joint would rest though the file has something by its name, or a matrix."""
    table = recording.table
    for text, what in table.unread.items():
        target = choices.names.get(text, text)
        resolved = None if target is None else _resolved(target, body)
        if resolved is None or resolved.name in (choices.rest or {}):
            continue
        if body.joint_names.index(resolved.name) not in found:
            raise TrajectoryError(
                f"{table.where}: no column for joint {resolved.name}, and {text!r} is {what}, which is not read; write "
                f"{len(table.rows)} numbers as those of the others, or leave it out with names={{{text!r}: None}} "
                f"(--names {text}=)"
            )
    if table.unnamed and body.n_shape and not found:
        raise TrajectoryError(
            f"{table.where}: no vector is a joint of {body.name}, and {table.unnamed[0]!r} is "
            f"{table.unread[table.unnamed[0]]}; name its columns in `joint_names`"
        )


def _check_meant(left_out: Mapping[str, str], body: Body, recording: Recording) -> None:
    """Raise TrajectoryError where all joints would rest because the columns of theirs have other names.

    Where nothing is left out but what the caller has named, as in a file of the base alone, they do rest.
    """
    table = recording.table
    others = [repr(text) for text, why in left_out.items() if why == _NO_JOINT]
    if not others:
        return
    more = f" and {len(others) - _MOST_SHOWN} more" if len(others) > _MOST_SHOWN else ""
    raise TrajectoryError(
        f"{table.where}: no column is a joint of {body.name}; there is {', '.join(others[:_MOST_SHOWN])}{more}, and "
        f"joints are {', '.join(body.joint_names)}. Say which column is which: names={{column: joint}} (--names "
        "COLUMN=JOINT); if all joints do rest, leave out each column by names={column: None} (--names COLUMN=)"
    )


def _rest_of_missing(
    found: Mapping[int, str],
    body: Body,
    where: str,
    choices: JointChoices,
    companions: Mapping[str, str],
    *,
    unexplained: bool,
) -> dict[str, float]:
    """Joint -> where it rests, of the joints without a column.

    Some may be missing without a word where at least one is there, and every column is explained: none is a joint that
    was misspelt.

    companions : joint -> a column that has its rate or effort, so that it does move
    unexplained : whether columns were left out of which nobody knows what they are
    """
    at_rest: dict[str, float] = {}
    for name, value in (choices.rest or {}).items():
        joint = body.joint_index(name)
        if joint in found:
            raise TrajectoryError(f"{where}: rest: joint {name} has a column, {found[joint]!r}; leave one of them out")
        at_rest[name] = quantity(value, body.joint_units[joint], f"rest of joint {name}")
    missing = [name for i, name in enumerate(body.joint_names) if i not in found and name not in at_rest]
    moving = [name for name in missing if name in companions]
    if moving and not choices.rest_missing:
        name = moving[0]
        raise TrajectoryError(
            f"{where}: {companions[name]!r} is recorded of joint {name}, and its position is not; add a column {name}, "
            f"or say where it rests: --rest {name}=0 (rest={{{name!r}: 0}})"
        )
    if choices.rest_missing or (missing and found and not unexplained):
        limits = {name: body.joint_limits[body.joint_index(name)] for name in missing}
        neutral = dict(zip(body.joint_names, body.shape().tolist(), strict=True))
        at_rest |= {name: float(np.clip(neutral[name], *limits[name])) for name in missing}
        if not choices.rest_missing:
            shown = ", ".join(missing[:_FEW]) + (f" and {len(missing) - _FEW} more" if len(missing) > _FEW else "")
            warn(
                f"{where}: no column for {shown}: {'they rest' if len(missing) > 1 else 'it rests'} at zero or the "
                "nearest limit; --rest JOINT=VALUE (rest={joint: value}) says another place, --rest-missing this one"
            )
    elif missing:
        raise TrajectoryError(
            f"{where}: no column for {', '.join(missing)}; add them (zeros where the joint rests), or say where they "
            "rest: rest={joint: value} (--rest JOINT=VALUE), or rest_missing=True (--rest-missing) for zero. Joints of "
            f"{body.name}: {', '.join(body.joint_names)}"
        )
    return {name: at_rest[name] for name in body.joint_names if name in at_rest}


def _check_reach(values: Array, joint: int, body: Body, recording: Recording) -> None:
    largest = int(np.argmax(np.abs(values)))
    if abs(values[largest]) > FARTHEST:
        name, unit = body.joint_names[joint], body.joint_units[joint]
        raise TrajectoryError(
            f"{recording.place(largest)}: joint {name} is at {values[largest]:.6g} {unit}; up to {FARTHEST:g} {unit} "
            "can be represented to full accuracy"
        )
