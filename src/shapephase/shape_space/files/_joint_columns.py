"""Columns of a recording matched to the joints of a body by name, in SI units; doubtful ones raise or warn."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ... import so3
from ...arguments import check_flag
from ...arrays import Array, Integers
from ...body.body import Body
from ...errors import ShapeError, TrajectoryError, UnknownColumnError, unknown_name
from ...letters import value_text
from ..interpolation import ball_columns, neighbours_signs
from ._gaps import Gaps
from .base_columns import HINT, KNOWN, BaseChoices, BaseColumns, BaseMotion, base_names
from .labels import (
    ANGLES,
    LENGTHS,
    NO_UNIT,
    RATE_UNITS,
    SI,
    Label,
    angle_unit,
    angles_in_rad,
    check_range,
    check_unit,
    in_square_brackets,
    is_counter,
    joint_part,
    label,
    other_unit,
    quantity,
    rate_label,
    rate_size,
    warn_of_limits,
    warn_of_turns,
    wheel_hint,
)
from .recording import LONGEST_NAME, NEARLY_UNIT, Recording, Table, checked_quaternions, listed, warn
from .times import is_clock, part_of

_STILL = 1e-9  # [rad, m or degrees] range of a locked coordinate
_FEW = 6  # joints that the warning about missing columns lists
_MOST_SHOWN = 50  # columns that an error lists
_NO_JOINT = "no joint of the body"
_SAME = 1e-6  # relative to their range: printed digits of a coordinate that follows another
_TURN = re.compile(r"(?P<joint>.+)(?:\.r(?P<small>[xyz])|_(?P<large>[XYZ])rotation)", re.DOTALL)
_ACROSS = 1e-6  # cosine of the angle between orthogonal axes
_JUMP = 0.5 * np.pi  # [rad] per sample of two hinges, while the link turns by less than a third of it


@dataclass(frozen=True, kw_only=True)
class JointChoices:
    """How columns become joints, checked: options of `read_recorded_motion`; names of columns as labels.

    without : joints that are left out, those of `wheel_speeds` among them where the body has them
    wheel_speeds : wheel -> its column of speeds, also with a unit behind a colon
    """

    names: Mapping[str, str | None]
    base: BaseChoices
    degrees: bool | None = None
    rest: Mapping[str, float | str] | None = None
    rest_missing: bool = False
    ignore_extra: bool = False
    fill: float | None = None
    without: tuple[str, ...] = ()
    wheel_speeds: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise ShapeError for values of the wrong kind."""
        check_flag(self.degrees, "degrees", allow_none=True)
        check_flag(self.rest_missing, "rest_missing")
        check_flag(self.ignore_extra, "ignore_extra")
        if self.rest is not None and not isinstance(self.rest, Mapping):
            raise ShapeError(f"rest: a mapping, joint -> value, is needed, got {value_text(self.rest)}")


class Matched(NamedTuple):
    """Motion of a body's joints in a recording.

    shapes : (N, n) [rad or m] in the body's order
    base : the motion of the base
    columns : joint -> the label of its column
    units : joint -> the unit in which its column was read
    at_rest : joint -> where it rests [rad or m], of joints without a column
    left_out : label -> why it was left out
    gaps : what was filled, and cut off at the ends, ready for JSON; None: the recording has no gaps
    speeds : (N, k) of wheels on their axles [rad/s]
    speed_columns : wheel -> label and unit of its column, in the order of those
    """

    shapes: Array
    base: BaseMotion
    columns: dict[str, str]
    units: dict[str, str]
    at_rest: dict[str, float]
    left_out: dict[str, str]
    gaps: dict[str, Any] | None
    speeds: Array
    speed_columns: dict[str, Label]

    def kept(self, samples: Integers) -> Matched:
        """Some of the samples, by their places."""
        return self._replace(shapes=self.shapes[samples], base=self.base.kept(samples), speeds=self.speeds[samples])


def matched(recording: Recording, body: Body, choices: JointChoices) -> tuple[Recording, Matched]:
    """The recording without gaps at its ends, and its motion of the body's joints and base."""
    where = recording.table.where
    for text in recording.table.columns:
        if len(text) > LONGEST_NAME:
            raise TrajectoryError(f"{where}: a column's name has {len(text)} characters: {text!r:.40}...")
    gaps = Gaps(recording, choices.fill)
    recording, sources = with_quaternions(recording, body, choices.names, choices.degrees, gaps)
    table = recording.table
    shapes = np.empty((len(recording.times), body.n_shape))
    labels: dict[int, str] = {}
    units: dict[str, str] = {}
    stated_units: set[int] = set()
    base = BaseColumns(
        recording, gaps, choices.base, choices.degrees, body.base_angles, body.base_slides, body.base_joints
    )
    left_out = {text: f"{kind}, no column" for text, kind in table.unread.items()} | dict(table.left_out)
    targets = {text: target for text in table.columns if (target := choices.names.get(text, text)) is not None}
    names_of_base = base_names(targets, {*body.joint_names, *KNOWN, *base.own_names})
    known_names = (*body.joint_names, *base.own_names)
    companions: dict[str, str] = {}
    speed_columns = {name: _speed_column(table, name, column) for name, column in choices.wheel_speeds.items()}
    of_wheels = {column.name for column in speed_columns.values()}
    for text in table.columns:
        if text in of_wheels:
            continue
        if text not in targets:
            left_out[text] = "as told by names"
            continue
        target = targets[text]
        resolved = _resolved(target, body)
        if resolved is not None and resolved.name in choices.without:
            left_out[text] = "angle of a joint that is left out"
            continue
        if resolved is None:
            part = joint_part(label(target).name, known_names)
            of_base = base.take(text, _with_unit(names_of_base.get(text), target)) or (
                part is not None and not part[1] and base.take(text, _with_unit(part[0], target))
            )
            if not of_base:
                rate = rate_label(target)
                if rate.unit is not None and rate.name in body.joint_names:
                    companions[rate.name] = text
                elif part is not None and part[1]:
                    companions[part[0]] = text
                left_out[text] = _why_left_out(text, target, recording, body, known_names, choices)
            continue
        joint = body.joint_index(resolved.name)
        unit, stated = _unit(text, resolved, joint, body, table, choices.degrees)
        if joint in labels:
            raise TrajectoryError(f"{where}: columns {labels[joint]!r} and {text!r} are the same joint; keep one")
        labels[joint], units[resolved.name] = text, unit
        stated_units |= {joint} if stated else set()
        shapes[:, joint] = (1.0 if unit == NO_UNIT else (ANGLES | LENGTHS)[unit]) * gaps.held(table, text)
    for ball in ball_columns(body.joint_names):
        quaternion = [column for column in range(ball.start, ball.stop) if column in labels]
        if quaternion:
            gaps.joined(table, [labels[column] for column in quaternion])
            shapes[:, quaternion] = np.stack([gaps.held(table, labels[column]) for column in quaternion], axis=1)
    _check_unread(labels, body, table, choices)
    for name in choices.without:
        shapes[:, body.joint_index(name)] = 0.0
    unexplained = [text for text, reason in left_out.items() if reason == _NO_JOINT]
    if body.n_shape and not labels and choices.rest_missing and unexplained:
        raise TrajectoryError(
            f"{where}: no column is a joint of {body.name}; there is {listed(map(repr, unexplained), _MOST_SHOWN)}, "
            f"and joints are {', '.join(body.joint_names)}. Say which column is which: names={{column: joint}} "
            "(--names COLUMN=JOINT); if all joints do rest, leave out each column by names={column: None} (--names "
            "COLUMN=)"
        )
    at_rest = _rest_of_missing(labels, body, where, choices, companions, explained=not unexplained)
    for name, value in at_rest.items():
        shapes[:, body.joint_index(name)] = value
    for joint, (name, unit) in enumerate(zip(body.joint_names, body.joint_units, strict=True)):
        check_range(recording, f"joint {name}", shapes[:, joint], unit)
        if joint in labels and joint not in stated_units:
            check_unit(shapes[:, joint], joint, body, recording)
    shapes = continued_hinges(shapes, body, recording)
    for joint in np.flatnonzero(np.array(body.joint_units) == "rad").tolist():
        warn_of_turns(shapes[:, joint], body.joint_names[joint], recording)
    for joint, text in labels.items():
        if body.joint_units[joint] != NO_UNIT:
            shapes[:, joint] = gaps.bridged([text], shapes[:, joint])
    speeds = np.empty((len(shapes), len(speed_columns)))
    for k, (text, unit) in enumerate(speed_columns.values()):
        speeds[:, k] = (rate_size(unit or "rad/s") or 1.0) * gaps.bridged([text], gaps.held(table, text))
    warn_of_limits(shapes, body, recording)
    shapes = continued_balls(shapes, body, recording, gaps, labels)
    base_motion = base.motion(ignore_extra=choices.ignore_extra)
    columns = {body.joint_names[joint]: sources.get(text, text) for joint, text in labels.items()}
    kept, filled = gaps.settled()
    left_out |= base_motion.left_out
    motion = Matched(shapes, base_motion, columns, units, at_rest, left_out, filled, speeds, speed_columns)
    return (recording, motion) if len(kept) == len(shapes) else (part_of(recording, kept), motion.kept(kept))


def _speed_column(table: Table, wheel: str, column: str) -> Label:
    """Label and unit of a wheel's column of speeds. Raises UnknownColumnError, TrajectoryError without a unit."""
    name, _, behind = column.rpartition(":")
    stated = behind if name and rate_size(behind) is not None else None
    wanted = column if column in table.columns or stated is None else name
    found = [text for text in table.columns if text == wanted] or [
        text for text in table.columns if rate_label(text).name == wanted
    ]
    if not found:
        raise unknown_name(
            f"column of speeds of {wheel} in {table.where}", wanted, [*table.columns], UnknownColumnError
        )
    if len(found) > 1:
        raise TrajectoryError(f"{table.where}: {wanted!r} may be {' or '.join(map(repr, found))}; write it in full")
    beside = table.units.get(found[0], "")
    own = rate_label(found[0]).unit or (beside if rate_size(beside) is not None else None)
    if own is None and stated is None:
        raise TrajectoryError(
            f"{table.where}: column {found[0]!r} states no unit of speed; write one of {RATE_UNITS} behind it: "
            f"--rotor-speed '{wheel}={wanted}:rpm' (wheel_speeds={{{wheel!r}: '{wanted}:rpm'}})"
        )
    if own is not None and stated is not None and rate_size(own) != rate_size(stated):
        raise TrajectoryError(f"{table.where}: column {found[0]!r} is in {own}, and {stated} was given")
    return Label(found[0], own or stated)


def _with_unit(name: str | None, target: str) -> str:
    """Name of a column of the base with the unit of its own label; without such a name the label."""
    unit = rate_label(target).unit or label(target).unit
    return target if name is None else name if unit is None else f"{name} [{unit}]"


def _resolved(target: str, body: Body) -> Label | None:
    """Joint and unit that a name stands for, or None."""
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
    """Reason for leaving out a column that is no joint; UnknownColumnError if there is none."""
    table = recording.table
    values = table.columns[text]
    if text not in choices.names:
        reason = _beside_a_motion(text, table, joints)
        if reason is not None:
            return reason
        if choices.ignore_extra:
            return _NO_JOINT
        if target in body.couplings:
            return f"follows {' and '.join(body.couplings[target].drivers) or 'nothing: it is locked'}"
        if table.format.startswith("OpenSim") and np.isfinite(values).all():
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


def _beside_a_motion(text: str, table: Table, joints: Collection[str]) -> str | None:
    """Kind of a column that holds no posture: a rate, a counter, a text; None where it may hold one."""
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


def _unit(text: str, target: Label, joint: int, body: Body, table: Table, degrees: bool | None) -> tuple[str, bool]:
    """Unit of a column, and True where caller or header states it."""
    expected = body.joint_units[joint]
    # A column keeps its unit when it is given another name.
    own = table.units.get(text) or (label(text).unit if text not in body.joint_names else None)
    stated = target.unit or own
    if expected == NO_UNIT:
        if stated not in (None, SI, NO_UNIT):
            raise TrajectoryError(f"{table.where}: column {text!r} is in {stated}; a quaternion has no unit")
        return NO_UNIT, True
    if target.unit and own and target.unit != own:
        raise TrajectoryError(f"{table.where}: column {text!r} is in {own}, and names says {target.unit}")
    stated = expected if stated == SI else stated
    if stated is not None and stated not in (ANGLES if expected == "rad" else LENGTHS):
        spelled = "degrees" if stated == "deg" else stated
        moves = "turns and is in rad or degrees" if expected == "rad" else "slides and is in metres"
        raise TrajectoryError(
            f"{table.where}: column {text!r} is in {spelled}, but joint {body.joint_names[joint]} {moves}"
        )
    return angle_unit(table, text, stated, degrees) if expected == "rad" else (stated or "m", stated is not None)


def _check_unread(labels: Mapping[int, str], body: Body, table: Table, choices: JointChoices) -> None:
    """Raise TrajectoryError where a joint would rest though the file has an array of its name, or a matrix."""
    for text, kind in table.unread.items():
        target = choices.names.get(text, text)
        resolved = None if target is None else _resolved(target, body)
        if resolved is None or resolved.name in (choices.rest or {}):
            continue
        if body.joint_index(resolved.name) not in labels:
            raise TrajectoryError(
                f"{table.where}: no column for joint {resolved.name}, and {text!r} is {kind}, which is not read; write "
                f"{len(table.rows)} numbers as those of the others, or leave it out with names={{{text!r}: None}} "
                f"(--names {text}=)"
            )
    if table.unnamed and body.n_shape and not labels:
        raise TrajectoryError(
            f"{table.where}: no vector is a joint of {body.name}, and {table.unnamed[0]!r} is "
            f"{table.unread[table.unnamed[0]]}; name its columns in `joint_names`"
        )


def _rest_of_missing(
    labels: Mapping[int, str],
    body: Body,
    where: str,
    choices: JointChoices,
    companions: Mapping[str, str],
    *,
    explained: bool,
) -> dict[str, float]:
    """Joint -> where it rests, of the joints without a column.

    Some may be missing without an option where at least one is there, and all columns are explained: none is a joint
    that was misspelt.

    companions : joint -> a column with its rate or effort: the joint does move
    explained : True where a reason is known for every column that was left out
    """
    at_rest: dict[str, float] = {}
    for name, value in (choices.rest or {}).items():
        joint = body.joint_index(name)
        if joint in labels:
            raise TrajectoryError(f"{where}: rest: joint {name} has a column, {labels[joint]!r}; leave one of them out")
        at_rest[name] = quantity(value, body.joint_units[joint], f"rest of joint {name}")
    known = {*at_rest, *choices.without}
    missing = [name for i, name in enumerate(body.joint_names) if i not in labels and name not in known]
    moving = next((name for name in missing if name in companions), None)
    if moving is not None and not choices.rest_missing:
        raise TrajectoryError(
            f"{where}: {companions[moving]!r} is recorded of joint {moving}, and its position is not; add a column "
            f"{moving}, or say where it rests: --rest {moving}=0 (rest={{{moving!r}: 0}}){wheel_hint(body, moving)}"
        )
    if choices.rest_missing or (missing and labels and explained):
        neutral = body.shape()
        for name in missing:
            joint = body.joint_index(name)
            at_rest[name] = float(np.clip(neutral[joint], *body.joint_limits[joint]))
        if not choices.rest_missing:
            warn(
                f"{where}: no column for {listed(missing, _FEW)}: {'they rest' if len(missing) > 1 else 'it rests'} at "
                "zero or the nearest limit; --rest JOINT=VALUE (rest={joint: value}) says another place, "
                "--rest-missing this one"
            )
    elif missing:
        raise TrajectoryError(
            f"{where}: no column for {', '.join(missing)}; add them (zeros where the joint rests), or say where they "
            "rest: rest={joint: value} (--rest JOINT=VALUE), or rest_missing=True (--rest-missing) for zero. Joints of "
            f"{body.name}: {', '.join(body.joint_names)}{wheel_hint(body, *missing)}"
        )
    return {name: at_rest[name] for name in body.joint_names if name in at_rest}


def with_quaternions(
    recording: Recording, body: Body, names: Mapping[str, str | None], degrees: bool | None, gaps: Gaps
) -> tuple[Recording, dict[str, str]]:
    """The recording with quaternions of ball joints in the place of angles, and the columns each is made of.

    The columns `shoulder.rz`, `shoulder.rx`, `shoulder.ry` of a ball joint, in the order in which they stand, are turns
    about z, x and y, each about its axis as those before have turned it; so are `shoulder_Zrotation` and so on, as
    tables that are made of BVH files name them.
    """
    table = recording.table
    sources: dict[str, str] = {}
    for joint in body.ball_joints:
        angles: dict[str, tuple[str, str | None]] = {}
        for text in table.columns:
            target = names.get(text, text)
            parts = Label("", None) if target is None else label(target)
            match = _TURN.fullmatch(parts.name)
            if match is None or match["joint"] != joint or parts.name in body.joint_names:
                continue
            axis = (match["small"] or match["large"]).lower()
            if axis in angles:
                both = f"columns {angles[axis][0]!r} and {text!r} are both {parts.name}"
                raise TrajectoryError(f"{table.where}: {both}; keep one")
            angles[axis] = text, parts.unit or table.units.get(text) or label(text).unit
        if not angles:
            continue
        lacking = [f"{joint}.r{axis}" for axis in "xyz" if axis not in angles]
        if lacking:
            raise TrajectoryError(f"{table.where}: ball joint {joint} turns about three axes; add {', '.join(lacking)}")
        labels = [text for text, _ in angles.values()]
        gaps.joined(table, labels)
        values = [
            angles_in_rad(recording, text, gaps.held(table, text), unit, degrees) for text, unit in angles.values()
        ]
        turns = gaps.turned(labels, so3.matrix_from_euler(np.stack(values, axis=-1), "".join(angles)))
        columns = {text: column for text, column in table.columns.items() if text not in labels}
        for part, column in zip("xyzw", so3.quat_from_matrix(turns).T, strict=True):
            name = f"{joint}.{part}"
            sources[name] = ", ".join(labels)
            if name in columns:
                raise TrajectoryError(
                    f"{table.where}: ball joint {joint} stands twice, as {sources[name]} and as {name}"
                )
            columns[name] = column
        table = replace(table, columns=columns)
    return replace(recording, table=table), sources


def continued_balls(shapes: Array, body: Body, recording: Recording, gaps: Gaps, columns: Mapping[int, str]) -> Array:
    """Shapes (N, n) with the quaternions of ball joints, bridged, in the sign that is nearer to the sample before.

    columns : joint -> label
    """
    balls = ball_columns(body.joint_names) if body.ball_joints else ()
    for ball, joint in zip(balls, body.ball_joints, strict=True):
        quaternions = checked_quaternions(shapes[:, ball], recording, f"ball joint {joint}", NEARLY_UNIT)
        labels = [columns[column] for column in range(ball.start, ball.stop) if column in columns]
        turns = so3.matrix_from_quat(quaternions)
        bridged = gaps.turned(labels, turns) if labels else turns
        changed = (bridged != turns).any(axis=(1, 2))
        shapes[changed, ball] = so3.quat_from_matrix(bridged[changed])
    return neighbours_signs(shapes, balls)


def continued_hinges(shapes: Array, body: Body, recording: Recording) -> Array:
    """Shapes (N, n) whose triples of hinges in one point go on to the nearest of their angles, where these jump.

    Angles a, b, c about axes at right angles are the same turn as a + pi, pi - b, c + pi and those whole turns apart.
    Programs that write the three angles of a rotation go from one to the other where the first and third axis meet.

    Warns of the first such sample: the hinges then go near that place, where they are far from a rotation.
    """
    if len(shapes) < 2:
        return shapes
    for columns, axes in _hinge_triples(body):
        angles = shapes[:, columns]
        first, second, third = (so3.exp(angles[:, k, None] * axes[k]) for k in range(3))
        turns = first @ second @ third
        # At a change of branch the first and the third go half a turn; a whole turn of one alone is as it is written.
        swift = np.sort(np.abs(np.diff(angles, axis=0)), axis=1)[:, 1]
        jumps = np.flatnonzero((swift > _JUMP) & (so3.angle(so3.transpose(turns[:-1]) @ turns[1:]) < swift / 3.0))
        if not len(jumps):
            continue
        for k in range(1, len(angles)):
            a, b, c = angles[k]
            branches = np.array([angles[k], [a + np.pi, np.pi - b, c + np.pi]])
            branches += 2.0 * np.pi * np.rint((angles[k - 1] - branches) / (2.0 * np.pi))
            angles[k] = branches[np.argmin(np.abs(branches - angles[k - 1]).max(axis=1))]
        shapes = shapes.copy()
        shapes[:, columns] = angles
        names = ", ".join(body.joint_names[column] for column in columns)
        warn(
            f"{recording.place(int(jumps[0]) + 1)}: {names} jump, and what they move does not ({len(jumps)} such "
            "steps): they go on to the nearest angles of the same rotation. Between samples, three hinges are a few "
            "degrees off a rotation where their first and third axis meet; a ball joint in their place is not"
        )
    return shapes


def _hinge_triples(body: Body) -> list[tuple[list[int], Array]]:
    """Three hinges in one point about axes at right angles: columns of the shape, and axes (3, 3) as rows at zero."""
    chain, triples, taken = body.chain, [], set()
    for joint in range(len(chain.names) - 2):
        three = range(joint, joint + 3)
        names = [chain.names[k] for k in three]
        one_point = all(chain.parents[k + 1] == k + 1 and not chain.places[k + 1].any() for k in three[:2])
        free = not taken & {*three} and {*names} <= {*body.joint_names} and not chain.slides[joint : joint + 3].any()
        if not one_point or not free:
            continue
        second = chain.turns[joint + 1]
        axes = np.array(
            [chain.axes[joint], second @ chain.axes[joint + 1], second @ chain.turns[joint + 2] @ chain.axes[joint + 2]]
        )
        if np.abs(axes @ axes.T - np.eye(3)).max() < _ACROSS:
            triples.append(([body.joint_index(name) for name in names], axes))
            taken |= {*three}
    return triples
