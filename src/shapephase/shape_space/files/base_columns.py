"""Columns of a recording that hold place and attitude of the base: names that programs give them, axes, motion."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ... import so3
from ...arguments import check_flag
from ...arrays import Array, Integers
from ...body.link_tree import Joint
from ...body.virtual_base import joint_coordinates, way_names, way_poses
from ...errors import TrajectoryError
from ...letters import value_text
from ._base_rates import RATE_NAMES, BaseRates, agreeing, check_speed, in_rad_per_s
from ._gaps import Gaps
from .labels import NO_UNIT, Label, angles_in_rad, check_range, label, lengths_in_m, rate_label
from .recording import OFF_UNIT, Recording, checked_quaternions

ESTIMATE = "estimate"  # axes of the base that a fit determines
_VELOCITIES = ("base_vx_m_s", "base_vy_m_s", "base_vz_m_s")  # written by `export_motion`
_COUNTED = tuple(f"{turn}{error}_rad" for turn in ("somersault", "tilt", "twist") for error in ("", "_error"))
_FOLLOWS = ("_kg_m2_s", "_speed_rad_s")  # end the labels of momenta and speeds of wheels, which follow, too
_LEAST_SLIDES = 2  # sliding joints that determine the place of the base; with one, the other directions are fixed
_SAME_AXES = "x y z"
_OPENSIM_AXES = "x -z y"  # base axes of URDF (x forward, z up) in OpenSim's (x forward, y up, z right)
QUATERNION = "quaternion"
PLACE = "place"
MRP = "mrp"
VECTOR = "vector"
EULER = "euler"
RATE = "rate"
_KINDS = {
    QUATERNION: ("q", "quat", "quaternion", "orientation", "rotation", "attitude", "rot", "att"),
    PLACE: ("p", "t", "r", "pos", "position", "trans", "translation", "location"),
    MRP: ("sigma", "mrp", "mrps"),
    VECTOR: ("rotvec", "rv", "axisangle"),
    RATE: ("omega", "w", "gyro", "gyr", "gyroscope"),
}
_KIND_OF = {word: kind for kind, words in _KINDS.items() for word in words}
_EULER = {"roll": "roll", "pitch": "pitch", "yaw": "yaw", "heading": "yaw"}
_BASE = frozenset(  # words before the kind that name no other part of the body
    ("base", "link", "root", "pelvis", "body", "pose", "odom", "odometry", "state", "states", "transform", "field")
) | {"free", "floating", "freeflyer"}
_FRAME = re.compile(r"[a-z]{1,2}")  # frames between a kind and its component, as in `p_RS_R_x`
_IMU = frozenset(("imu", "sensor"))  # words that name the base's own sensor of rates
_JOINED = re.compile(r"(q|quat|t|p|mrp|sigma|rotvec|pos)([wxyz]|\d)|(omega|w|gyro|gyr)([xyz])")
_ANGULAR = re.compile(r"ang(?:ular)?[_ .]?(?:vel(?:ocity)?|rate)")
_SPLIT = re.compile(r"[/.\s_\[\]()]+")
CANONICAL = {  # kind -> component -> name of its column
    QUATERNION: {part: f"base_q{part}" for part in "xyzw"},
    PLACE: {part: f"base_{part}" for part in "xyz"},
    MRP: {part: f"base_mrp_{part}" for part in "123"},
    VECTOR: {part: f"base_rotvec_{part}" for part in "xyz"},
    EULER: {part: f"base_{part}" for part in ("roll", "pitch", "yaw")},
    RATE: dict(zip("xyz", RATE_NAMES, strict=True)),
}
HINT = (  # in messages about columns of the base
    "columns of the base are base_x, base_y, base_z and base_qx, base_qy, base_qz, base_qw or base_roll, base_pitch, "
    "base_yaw or base_mrp_1, base_mrp_2, base_mrp_3; its rates omega_x, omega_y, omega_z"
)


class _Group(NamedTuple):
    """Columns that belong together.

    kind : "quaternion", "angles", "mrp", "vector", "position", or "joints", by which the body's file moves its base
    names : of the columns
    parts : for each column its part of the quaternion, or the axis it turns about
    order : default order of angles: each turns about its axis as those before have turned it
    axes : default axes of the base in those of the columns
    """

    kind: str
    names: tuple[str, ...]
    parts: str = "xyz"
    order: str = ""
    axes: str = _SAME_AXES


def _groups() -> tuple[_Group, ...]:
    groups = [_Group("quaternion", ("qx", "qy", "qz", "qw"), "xyzw")]
    for prefix in ("base", "pelvis", "root"):
        for stem in ("q", "quat_"):
            groups.append(_Group("quaternion", tuple(f"{prefix}_{stem}{part}" for part in "xyzw"), "xyzw"))
        for parts in ("xyzw", "wxyz"):
            groups.append(_Group("quaternion", tuple(f"{prefix}_quat_{parts}_{k}" for k in range(4)), parts))
        groups.append(_Group("angles", (f"{prefix}_roll", f"{prefix}_pitch", f"{prefix}_yaw"), "xyz", "zyx"))
        for stem in ("", "t"):
            groups.append(_Group("position", tuple(f"{prefix}_{stem}{axis}" for axis in "xyz")))
    groups += [_Group("mrp", tuple(CANONICAL[MRP].values())), _Group("vector", tuple(CANONICAL[VECTOR].values()))]
    groups.append(_Group("angles", ("pelvis_tilt", "pelvis_list", "pelvis_rotation"), "zxy", "zxy", _OPENSIM_AXES))
    return tuple(groups)


_GROUPS = _groups()
KNOWN = frozenset(name for group in _GROUPS for name in group.names) | {*RATE_NAMES}


@dataclass(frozen=True, kw_only=True)
class BaseChoices:
    """How columns become the motion of the base, checked: options of `read_recorded_motion`.

    axes : (3, 3) base axes to the axes of the columns, ESTIMATE, or None for the default
    given : these axes as the caller wrote them
    inverse : True where attitudes take the recorder's axes to the base's; None: as recorded rates show, else False
    """

    order: str | None = None
    axes: Array | str | None = None
    given: str | None = None
    inverse: bool | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class BaseMotion:
    """Recorded motion of the base.

    attitude : (N, 3, 3) base axes to the recorder's, or None; with axes to be estimated, from the columns' own axes
    position : (N, 3) [m] or None
    rates : (N, 3) angular velocity, base axes [rad/s], or None; with axes to be estimated, in the columns' own axes
    record : what it was read from, ready for JSON, or None
    left_out : label -> why a column was left out
    """

    attitude: Array | None
    position: Array | None
    rates: Array | None
    record: dict[str, Any] | None
    left_out: dict[str, str]

    def kept(self, samples: Integers) -> BaseMotion:
        """Some of the samples, by their places."""
        return self.mapped(lambda values: values[samples], lambda values: values[samples])

    def mapped(self, vectors: Callable[[Array], Array], turns: Callable[[Array], Array]) -> BaseMotion:
        """The motion with functions of places and rates, and of attitudes."""
        return replace(
            self,
            attitude=None if self.attitude is None else turns(self.attitude),
            position=None if self.position is None else vectors(self.position),
            rates=None if self.rates is None else vectors(self.rates),
        )


def base_choices(order: str | None, axes: Any, inverse: bool | None) -> BaseChoices:
    """Order of angles, axes and direction of the base's attitude, checked. Raises TrajectoryError, ShapeError."""
    check_flag(inverse, "base_inverse", allow_none=True)
    orders = ["".join(letters) for letters in permutations("xyz")]
    if order is not None and (not isinstance(order, str) or order not in orders):
        raise TrajectoryError(
            f"base_order: the three axes in their order, as 'zxy', are needed, got {value_text(order)}"
        )
    if axes is None or (isinstance(axes, str) and axes == ESTIMATE):
        return BaseChoices(order=order, axes=axes, given=axes, inverse=inverse)
    if isinstance(axes, str):
        words = " ".join(axes.replace(",", " ").split())
        return BaseChoices(order=order, axes=named_axes(axes), given=words, inverse=inverse)
    matrix = so3.rotation_argument(axes, "base_axes")
    if matrix.shape != (3, 3):
        raise TrajectoryError(f"base_axes: one rotation (3, 3) is needed, got {matrix.shape}")
    return BaseChoices(order=order, axes=matrix, given=str(matrix.tolist()), inverse=inverse)


def named_axes(text: str) -> Array:
    """Rotation from base axes by words such as "x -z y", where x, y and z axis of the base point to."""
    words = text.replace(",", " ").split()
    matrix = np.zeros((3, 3))
    for column, word in enumerate(words[:3]):
        axis = word.lstrip("+-")
        if len(axis) == 1 and axis in "xyz" and len(word) <= 2:
            matrix["xyz".index(axis), column] = -1.0 if word[0] == "-" else 1.0
    if len(words) != 3 or np.linalg.det(matrix) != 1.0:
        raise TrajectoryError(
            f"base_axes: where the x, y and z axis of the base point to is needed, three right-handed words such as "
            f"'x,-z,y', or {ESTIMATE!r}; got {value_text(text)}"
        )
    return matrix


@dataclass(frozen=True, eq=False)
class BaseColumns:
    """Columns of the base, collected one after the other from a table."""

    recording: Recording
    gaps: Gaps
    choices: BaseChoices
    degrees: bool | None
    angles: tuple[tuple[str, ...], str] | None  # names of the angles in the body's file, and their axes
    slides: tuple[str, ...] | None  # names of the coordinates of its place there
    way: tuple[Joint, ...] = ()  # joints of the body's file that lead to the base
    columns: dict[str, tuple[str, str | None]] = field(default_factory=dict)  # name -> label and unit
    rates: dict[str, tuple[str, str | None]] = field(default_factory=dict)  # name -> label and unit

    @property
    def own_names(self) -> tuple[str, ...]:
        """Names of the base's coordinates in the body's own file."""
        return (*(self.angles[0] if self.angles else ()), *(self.slides or ()), *way_names(self.way))

    def take(self, text: str, target: str) -> bool:
        """Keep a column, by its label and its name, and return True if it is one of the base."""
        rate = rate_label(target)
        rate = rate if rate.unit else label(target)
        if rate.name in RATE_NAMES:
            if rate.name in self.rates:
                self._raise_doubled(self.rates[rate.name][0], text, rate.name)
            units = self.recording.table.units
            self.rates[rate.name] = text, rate.unit or units.get(text) or rate_label(text).unit
            return True
        if target in _VELOCITIES or target in _COUNTED or target.endswith(_FOLLOWS):
            return True
        known = {*KNOWN, *self.own_names}
        parts = Label(target, None) if target in known else label(target)
        if parts.name not in known:
            return False
        table = self.recording.table
        if parts.name in self.columns:
            self._raise_doubled(self.columns[parts.name][0], text, parts.name)
        own = table.units.get(text) or label(text).unit
        if parts.unit and own and parts.unit != own:
            raise TrajectoryError(f"{table.where}: column {text!r} is in {own}, and names says {parts.unit}")
        self.columns[parts.name] = (text, parts.unit or own)
        return True

    def _raise_doubled(self, first: str, second: str, name: str) -> NoReturn:
        where = self.recording.table.where
        raise TrajectoryError(f"{where}: columns {first!r} and {second!r} are both {name}; keep one")

    def motion(self, *, ignore_extra: bool) -> BaseMotion:
        """The motion of the base. Raises TrajectoryError for missing, doubled, impossible or doubtful columns.

        ignore_extra : True to leave out columns without their companions
        """
        table, left_out = self.recording.table, {}
        groups: dict[str, _Group] = {}
        for group in self._groups():
            present = [name for name in group.names if name in self.columns]
            lacking = ", ".join(name for name in group.names if name not in self.columns)
            if present and lacking:
                if not ignore_extra:
                    raise TrajectoryError(
                        f"{table.where}: base motion with {', '.join(present)}, without {lacking}; add it, or leave "
                        "them out: ignore_extra=True (--ignore-extra), or names={column: None} (--names COLUMN=)"
                    )
                left_out |= {self.columns[name][0]: f"of the base, without {lacking}" for name in present}
            elif present:
                for quantity in self._quantities(group):
                    if quantity in groups or self._stored(quantity) is not None:
                        first = groups[quantity].names[0] if quantity in groups else "an array"
                        raise TrajectoryError(
                            f"{table.where}: the {quantity} of the base stands twice, as {first} and as "
                            f"{group.names[0]}; leave one out with names={{column: None}} (--names COLUMN=)"
                        )
                    groups[quantity] = group
        attitude, rates, record = self._attitude(groups.get("attitude"), self._rates())
        position = self._position(groups.get("position"))
        if position is not None:
            record["position"] = list(self._texts(groups["position"])) if "position" in groups else "base_position"
        return BaseMotion(attitude=attitude, position=position, rates=rates, record=record or None, left_out=left_out)

    def _groups(self) -> tuple[_Group, ...]:
        """Usual groups of columns and those of the body's own file, whose names come first."""
        groups = _GROUPS
        if self.angles is not None:
            names, axes = self.angles
            groups = (
                *(group for group in groups if set(group.names) != set(names)),
                _Group("angles", names, axes, axes),
            )
        if self.slides is not None:
            groups = (*groups, _Group("position", self.slides))
        moved = set(way_names(self.way))
        # A complete usual group that shares a name with a joint on the way to the base is meant as such.
        usual = any(
            moved & set(group.names) and not set(group.names) <= moved and set(group.names) <= set(self.columns)
            for group in groups
        )
        if usual or not moved & set(self.columns):
            return groups
        names = way_names(self.way)
        turns = tuple(name for joint in self.way if joint.kind != "prismatic" for name in joint_coordinates(joint))
        slides_are_there = set(names) - set(turns) & set(self.columns)
        joints = _Group("joints", names if slides_are_there or not turns else turns)
        return (*(group for group in groups if not moved & set(group.names)), joints)

    def _quantities(self, group: _Group) -> tuple[str, ...]:
        """Quantities that columns determine: "attitude", "position" or both."""
        if group.kind != "joints":
            return ("position",) if group.kind == "position" else ("attitude",)
        slides = sum(joint.name in group.names for joint in self.way if joint.kind == "prismatic")
        return ("attitude",) * (len(group.names) > slides) + ("position",) * (slides >= _LEAST_SLIDES)

    def _stored(self, quantity: str) -> Array | None:
        table = self.recording.table
        return table.base_position if quantity == "position" else table.base_quat_xyzw

    def _rates(self) -> BaseRates | None:
        """Recorded angular velocity; None without one."""
        if not self.rates:
            return None
        lacking = [name for name in RATE_NAMES if name not in self.rates]
        if lacking:
            raise TrajectoryError(
                f"{self.recording.table.where}: rates of the base with {', '.join(self.rates)}, without "
                f"{', '.join(lacking)}; add it, or leave them out: names={{column: None}} (--names COLUMN=)"
            )
        columns = [self.rates[name] for name in RATE_NAMES]
        texts = [text for text, _ in columns]
        self.gaps.joined(self.recording.table, texts)
        values = np.stack([self.gaps.held(self.recording.table, text) for text in texts], axis=-1)
        return in_rad_per_s(self.recording, columns, self.gaps.bridged(texts, values))

    def _attitude(
        self, group: _Group | None, rates: BaseRates | None
    ) -> tuple[Array | None, Array | None, dict[str, Any]]:
        """Attitudes and rates, and how they were read."""
        stored, given = self._stored("attitude"), self.choices
        of_rates: dict[str, Any] = {}
        if rates is not None:
            of_rates = {"rates": list(rates.columns), "rate_unit": rates.unit, "rate_unit_said": rates.stated}
        if group is None and stored is None:
            if given.inverse is not None:
                raise TrajectoryError(
                    f"{self.recording.table.where}: base_inverse is for recorded attitudes of the base, and there are "
                    "none; leave it out (--base-inverse)"
                )
            if rates is None:
                return None, None, {}
            check_speed(self.recording, rates)
            axes = np.eye(3) if given.axes is None or isinstance(given.axes, str) else given.axes
            return None, rates.values @ axes, of_rates
        record: dict[str, Any] = {"attitude": "base_quat_xyzw" if group is None else list(self._texts(group))}
        if group is None:
            assert stored is not None
            turns = self._by_quaternions(stored)
        else:
            self.gaps.joined(self.recording.table, self._texts(group))
            if group.kind == "joints":
                turns = self._by_joints(group)[0]
            else:
                values = np.stack([self._values(name, group.kind) for name in group.names], axis=-1)
                if group.kind == "quaternion":
                    turns = self._by_quaternions(values[:, [group.parts.index(part) for part in "xyzw"]])
                elif group.kind == "angles":
                    order = given.order or group.order
                    turns = so3.matrix_from_euler(values[:, [group.parts.index(axis) for axis in order]], order)
                    record |= {"order": order, "order_said": given.order is not None}
                else:
                    turns = so3.matrix_from_quat(so3.quat_from_mrp(values)) if group.kind == "mrp" else so3.exp(values)
            turns = self.gaps.turned(self._texts(group), turns)
        if "order" not in record and given.order is not None:
            raise TrajectoryError(
                f"{self.recording.table.where}: base_order is for angles, and the base's attitude is not given by three"
            )
        turns, of_base = so3.transpose(turns) if given.inverse else turns, None
        if given.inverse is not None:
            record |= {"inverse": given.inverse, "inverse_by": "as given"}
        if rates is not None:
            read = agreeing(self.recording, turns, rates, given.inverse)
            turns, of_base = read.turns, read.rates
            if read.inverse:
                record |= {"inverse": True, "inverse_by": "rates"}
            record |= of_rates | {"rate_axes": "inertial" if read.inertial else "base"}
        usual = _SAME_AXES if group is None else group.axes
        record |= {"axes": given.given or usual, "axes_said": given.given is not None}
        axes = named_axes(usual) if given.axes is None else given.axes
        if not isinstance(axes, str):
            turns, of_base = turns @ axes, None if of_base is None else of_base @ axes
        return turns, of_base, record

    def _position(self, group: _Group | None) -> Array | None:
        if group is None:
            return self._stored("position")
        self.gaps.joined(self.recording.table, self._texts(group))
        if group.kind == "joints":
            places = self._by_joints(group)[1]
        else:
            places = np.stack([self._values(name, group.kind) for name in group.names], axis=-1)
        return self.gaps.bridged(self._texts(group), places)

    def _by_joints(self, group: _Group) -> tuple[Array, Array]:
        """Attitude and place by the joints on the way to the base, in axes of the world they start from."""
        kinds = {"ball": "quaternion", "prismatic": "position"}
        values = {
            name: self._values(name, kinds.get(joint.kind, "angles"))
            for joint in self.way
            for name in joint_coordinates(joint)
            if name in group.names
        }
        for joint in self.way:
            if joint.kind == "ball":
                self._by_quaternions(np.stack([values[name] for name in joint_coordinates(joint)], axis=-1))
        return way_poses(self.way, values, len(self.recording.times))

    def _by_quaternions(self, quaternions: Array) -> Array:
        return so3.matrix_from_quat(checked_quaternions(quaternions, self.recording, "the base", OFF_UNIT))

    def _texts(self, group: _Group) -> tuple[str, ...]:
        return tuple(self.columns[name][0] for name in group.names)

    def _values(self, name: str, kind: str) -> Array:
        """A column (N,) in rad, m, or without unit."""
        table = self.recording.table
        text, unit = self.columns[name]
        values = self.gaps.held(table, text)
        if kind in ("quaternion", "mrp"):
            if unit not in (None, NO_UNIT):
                raise TrajectoryError(
                    f"{table.where}: column {text!r} is in {unit}; a {kind} has no unit: name the column without it"
                )
            return values
        if kind == "position":
            values = lengths_in_m(self.recording, text, values, unit)
        else:
            values = angles_in_rad(self.recording, text, values, unit, self.degrees)
        check_range(self.recording, f"column {text!r}", values, "rad or m")
        return values


def base_names(targets: Mapping[str, str], own: Collection[str]) -> dict[str, str]:
    """Label -> the name of a column of the base, of all labels that complete a quaternion, a place and so on.

    own : names of joints and columns that are known already
    """
    families: dict[tuple[str, tuple[str, ...]], dict[str, str]] = {}
    for text, target in targets.items():
        part = None if target in own or label(target).name in own else _part(target)
        if part is not None:
            families.setdefault(part[:2], {})[part[2]] = text
    names: dict[str, str] = {}
    for (kind, _), texts in families.items():
        components = _components(kind, texts)
        if components is not None:
            names |= {texts[written]: CANONICAL[kind][part] for written, part in components.items()}
    return names


def _part(target: str) -> tuple[str, tuple[str, ...], str] | None:
    """Kind, words before it and component of a label; None of one that is no part of the base."""
    plain = rate_label(target).name
    plain = _ANGULAR.sub("omega", (label(target).name if plain == target else plain).lower())
    rooted = "/" in plain or "." in plain
    tokens: list[str] = []
    for token in filter(None, _SPLIT.split(plain)):
        joined = _JOINED.fullmatch(token)
        tokens += filter(None, joined.groups()) if joined is not None else (token,)
    if not tokens:
        return None
    *before, last = tokens
    if last in _EULER:
        return (EULER, tuple(before), _EULER[last]) if _is_base(before, rooted) else None
    if last not in (*"wxyz", *"01234"):
        return None
    for k, word in enumerate(before):
        if word in _KIND_OF and all(map(_FRAME.fullmatch, before[k + 1 :])):
            # `t1` to `t3` may be torques or temperatures; `r_BN_N_1` is a place.
            loose = _KIND_OF[word] == RATE or (_KIND_OF[word] == PLACE and len(word) == 1)
            if loose and last.isdigit() and not before[k + 1 :]:
                return None
            if _KIND_OF[word] == RATE:
                owner = [name for name in before[:k] if name not in _IMU]
                return (RATE, tuple(before), last) if _is_base(owner, rooted) else None
            return (_KIND_OF[word], tuple(before), last) if _is_base(before[:k], rooted) else None
    return (PLACE, tuple(before), last) if last in "xyz" and set(before) <= _BASE else None


def _is_base(words: list[str], rooted: bool) -> bool:
    """True if the words before a kind may be the base: known words, or the topic of a message."""
    return set(words) <= _BASE or (rooted and (not words or words[-1] in _BASE))


def _components(kind: str, texts: Mapping[str, str]) -> dict[str, str] | None:
    """Written component -> component, where all are there; numbers count from 0, with the scalar first, or from 1."""
    there = "".join(sorted(texts)) if kind != EULER else ""
    if kind == EULER:
        return {name: name for name in texts} if len(texts) == len(CANONICAL[EULER]) else None
    if kind == QUATERNION and there == "1234":
        first, last = texts["1"], texts["4"]
        raise TrajectoryError(
            f"quaternion {', '.join(texts[k] for k in '1234')}: its scalar part may be the first or the last; say "
            f"which: --names '{first}=qw' and so on, or '{first}=qx' to '{last}=qw' (names={{{first!r}: 'qw', ...}})"
        )
    forms: tuple[str, ...] = ("wxyz", "0123") if kind == QUATERNION else ("012", "123", "xyz")
    meant = "wxyz" if kind == QUATERNION else "".join(CANONICAL[kind])
    return dict(zip(there, meant, strict=True)) if there in forms else None
