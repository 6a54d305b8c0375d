"""Columns of a recording that say where the base is and how it is turned, and the axes in which they say it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from ... import so3
from ...arrays import FARTHEST, Array, Integers
from ...body.link_tree import Joint
from ...body.virtual_base import joint_coordinates, way_names, way_poses
from ...errors import TrajectoryError
from ...letters import what_came
from ._gaps import Gaps
from ._pose_columns import CANONICAL, MRP, VECTOR
from .labels import ANGLES, LENGTHS, NO_UNIT, SI, Label, label
from .recording import Recording

ESTIMATE = "estimate"  # axes of the base that a fit determines
_FOLLOWING = ("omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s")  # of `Motion.write_csv`; they follow from the rest
_VELOCITIES = ("base_vx_m_s", "base_vy_m_s", "base_vz_m_s")  # written by `export_motion`
_AGREES = 0.1  # median error of turns between samples, relative to the rates: both agree
_CONTRADICTS = 0.5  # relative to the rates: turns that are off by more contradict them
_PREFIXES = ("base", "pelvis", "root")
_OFF_UNIT = 1e-3  # allowed error of a quaternion's length: recordings keep as few as three digits
_MOST_ANGLE = 2.0 * np.pi  # [rad] larger angles without a unit are rather in degrees
_LEAST_SLIDES = 2  # sliding joints that determine the place of the base; with one, the other directions are fixed
_FARTHEST = 50.0  # [m] distances without a unit beyond it are rather in millimetres
_AXES = "xyz"
_SAME_AXES = "x y z"
_OPENSIM_AXES = "x -z y"  # base axes of URDF (x forward, z up) in OpenSim's (x forward, y up, z right)


class _Group(NamedTuple):
    """Columns that belong together.

    Attributes
    ----------
    kind : "quaternion", "angles", "mrp", "vector", "position", or "joints", by which the body's file moves its base
    names : of the columns
    parts : for each column its part of the quaternion, or the axis it turns about
    order : of angles, the usual one: each turns about its axis as those before have turned it
    axes : of the base in those that the columns tell, the usual ones
    """

    kind: str
    names: tuple[str, ...]
    parts: str = _AXES
    order: str = ""
    axes: str = _SAME_AXES


def _groups() -> tuple[_Group, ...]:
    found = [_Group("quaternion", tuple(f"q{part}" for part in "xyzw"), "xyzw")]
    for prefix in _PREFIXES:
        for stem in ("q", "quat_"):
            found.append(_Group("quaternion", tuple(f"{prefix}_{stem}{part}" for part in "xyzw"), "xyzw"))
        for parts in ("xyzw", "wxyz"):
            names = tuple(f"{prefix}_quat_{parts}_{k}" for k in range(len(parts)))
            found.append(_Group("quaternion", names, parts))
        turns = tuple(f"{prefix}_{word}" for word in ("roll", "pitch", "yaw"))
        found.append(_Group("angles", turns, _AXES, "zyx"))
        for stem in ("", "t"):
            found.append(_Group("position", tuple(f"{prefix}_{stem}{axis}" for axis in _AXES)))
    found.append(_Group("mrp", tuple(CANONICAL[MRP].values())))
    found.append(_Group("vector", tuple(CANONICAL[VECTOR].values())))
    opensim = tuple(f"pelvis_{word}" for word in ("tilt", "list", "rotation"))
    return (*found, _Group("angles", opensim, "zxy", "zxy", _OPENSIM_AXES))


_GROUPS = _groups()
KNOWN = frozenset(name for group in _GROUPS for name in group.names)


@dataclass(frozen=True, kw_only=True)
class BaseChoices:
    """How columns become the motion of the base: what a caller has said, checked.

    Attributes
    ----------
    order : of angles, as "zxy"; None: the usual one of such columns
    axes : (3, 3) base axes to the axes that the columns tell, ESTIMATE, or None for the usual ones
    said : these axes as they were given
    """

    order: str | None = None
    axes: Array | str | None = None
    said: str | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class BaseMotion:
    """The recorded motion of the base.

    Attributes
    ----------
    attitude : (N, 3, 3) base axes to the recorder's, or None; with axes to be estimated, from the columns' own axes
    position : (N, 3) [m] or None
    record : what it was read from, as JSON can hold it, or None
    left_out : label -> why a column was left out
    """

    attitude: Array | None
    position: Array | None
    record: dict[str, Any] | None
    left_out: dict[str, str]

    def kept(self, samples: Integers) -> BaseMotion:
        """Some of the samples, by their places."""
        return replace(
            self,
            attitude=None if self.attitude is None else self.attitude[samples],
            position=None if self.position is None else self.position[samples],
        )


def base_choices(order: str | None, axes: Any) -> BaseChoices:
    """A user's order of angles and axes of the base. Raises TrajectoryError, ShapeError."""
    if order is not None and (
        not isinstance(order, str) or order not in {"".join(letters) for letters in permutations(_AXES)}
    ):
        raise TrajectoryError(
            f"base_order: the three axes in their order, as 'zxy', are needed, got {what_came(order)}"
        )
    if axes is None or (isinstance(axes, str) and axes == ESTIMATE):
        return BaseChoices(order=order, axes=axes, said=axes)
    if isinstance(axes, str):
        return BaseChoices(order=order, axes=named_axes(axes), said=" ".join(axes.replace(",", " ").split()))
    matrix = so3.rotation_argument(axes, "base_axes")
    if matrix.shape != (3, 3):
        raise TrajectoryError(f"base_axes: one rotation (3, 3) is needed, got {matrix.shape}")
    return BaseChoices(order=order, axes=matrix, said=str(matrix.tolist()))


def named_axes(text: str) -> Array:
    """The rotation from base axes of a text such as "x -z y": where the x, y and z axis of the base point to.

    Raises TrajectoryError.
    """
    words = text.replace(",", " ").split()
    matrix = np.zeros((3, 3))
    for column, word in enumerate(words[:3]):
        axis = word.lstrip("+-")
        if len(axis) == 1 and axis in _AXES and len(word) <= 2:
            matrix[_AXES.index(axis), column] = -1.0 if word[0] == "-" else 1.0
    if len(words) != 3 or np.linalg.det(matrix) != 1.0:
        raise TrajectoryError(
            f"base_axes: where the x, y and z axis of the base point to is needed, three right-handed words such as "
            f"'x,-z,y', or {ESTIMATE!r}; got {what_came(text)}"
        )
    return matrix


@dataclass(frozen=True, eq=False)
class BaseColumns:
    """Columns of the base as they are found in a table, one after the other."""

    recording: Recording
    gaps: Gaps
    choices: BaseChoices
    degrees: bool | None
    angles: tuple[tuple[str, ...], str] | None  # that the body's file turns the base by, and their axes
    slides: tuple[str, ...] | None  # that it moves the base by
    way: tuple[Joint, ...] = ()  # the joints of the body's file that lead to the base
    found: dict[str, tuple[str, str | None]] = field(default_factory=dict)
    rates: dict[str, str] = field(default_factory=dict)

    def take(self, text: str, target: str) -> bool:
        """Keep a column, by its label and the name that it goes by, if it is one of the base."""
        if target in _FOLLOWING:
            self.rates[target] = text
            return True
        if target in _VELOCITIES:
            return True
        plain = target in KNOWN or target in self.own_names
        parts = Label(target, None) if plain else label(target)
        if parts.name not in KNOWN and parts.name not in self.own_names:
            return False
        table = self.recording.table
        if parts.name in self.found:
            first = self.found[parts.name][0]
            raise TrajectoryError(f"{table.where}: columns {first!r} and {text!r} are both {parts.name}; keep one")
        own = table.units.get(text) or label(text).unit
        if parts.unit and own and parts.unit != own:
            raise TrajectoryError(f"{table.where}: column {text!r} is in {own}, and names says {parts.unit}")
        self.found[parts.name] = (text, parts.unit or own)
        return True

    def motion(self, *, ignore_extra: bool) -> BaseMotion:
        """What the columns say together.

        ignore_extra : whether columns without their companions are left out

        Raises TrajectoryError if some are missing, are there twice, are no possible numbers, or have a unit that can
        only be guessed.
        """
        table, left_out = self.recording.table, {}
        groups: dict[str, _Group] = {}
        for group in self._groups():
            there = [name for name in group.names if name in self.found]
            lacking = ", ".join(name for name in group.names if name not in self.found)
            if there and lacking:
                if not ignore_extra:
                    raise TrajectoryError(
                        f"{table.where}: base motion with {', '.join(there)}, without {lacking}; add it, or leave them "
                        "out: ignore_extra=True (--ignore-extra), or names={column: None} (--names COLUMN=)"
                    )
                left_out |= {self.found[name][0]: f"of the base, without {lacking}" for name in there}
            elif there:
                for what in self._told_by(group):
                    if what in groups or self._stored(what) is not None:
                        first = groups[what].names[0] if what in groups else "an array"
                        raise TrajectoryError(
                            f"{table.where}: the {what} of the base stands twice, as {first} and as {group.names[0]}; "
                            "leave one out with names={column: None} (--names COLUMN=)"
                        )
                    groups[what] = group
        attitude, record = self._attitude(groups.get("attitude"))
        position = self._position(groups.get("position"))
        if position is not None:
            record["position"] = list(self._texts(groups["position"])) if "position" in groups else "base_position"
        return BaseMotion(attitude=attitude, position=position, record=record or None, left_out=left_out)

    def _groups(self) -> tuple[_Group, ...]:
        """Those that are known anyway; of the angles that the body's own file names, what they turn about there."""
        groups = _GROUPS
        if self.angles is not None:
            names, axes = self.angles
            groups = (*(one for one in groups if set(one.names) != set(names)), _Group("angles", names, axes, axes))
        if self.slides is not None:
            groups = (*groups, _Group("position", self.slides))
        moved = set(way_names(self.way))
        # A name may be that of a joint on the way to the base, and one of several that are known anyway.
        whole = any(
            moved & set(one.names) and not set(one.names) <= moved and set(one.names) <= set(self.found)
            for one in groups
        )
        if not whole and moved & set(self.found):
            groups = (*(one for one in groups if not moved & set(one.names)), self._joints_of_the_base())
        return groups

    def _joints_of_the_base(self) -> _Group:
        """The joints on the way to the base, without slides where none of these has a column."""
        turns = tuple(name for joint in self.way if joint.kind != "prismatic" for name in joint_coordinates(joint))
        names = way_names(self.way)
        return _Group("joints", names if set(names) - set(turns) & set(self.found) or not turns else turns)

    def _told_by(self, group: _Group) -> tuple[str, ...]:
        """What columns say of the base: "attitude", "position" or both."""
        if group.kind != "joints":
            return ("position",) if group.kind == "position" else ("attitude",)
        sliding = [joint.name in group.names for joint in self.way if joint.kind == "prismatic"]
        turning = len(group.names) > sum(sliding)
        return ("attitude",) * turning + ("position",) * (sum(sliding) >= _LEAST_SLIDES)

    @property
    def own_names(self) -> tuple[str, ...]:
        """What the body's own file calls coordinates of its base."""
        return (*(self.angles[0] if self.angles else ()), *(self.slides or ()), *way_names(self.way))

    def _stored(self, what: str) -> Array | None:
        table = self.recording.table
        return table.base_position if what == "position" else table.base_quat_xyzw

    def _attitude(self, group: _Group | None) -> tuple[Array | None, dict[str, Any]]:
        stored, record = self._stored("attitude"), {}
        if group is not None:
            self.gaps.joined(self.recording.table, self._texts(group))
        if group is None and stored is None:
            return None, {}
        if group is None:
            assert stored is not None
            turned, usual = _by_quaternions(stored, self.recording), _SAME_AXES
            record["attitude"] = "base_quat_xyzw"
        elif group.kind == "joints":
            turned, usual = self._by_joints(group)[0], group.axes
            record["attitude"] = list(self._texts(group))
        else:
            values = np.stack([self._values(name, group.kind) for name in group.names], axis=-1)
            usual = group.axes
            record["attitude"] = list(self._texts(group))
            if group.kind in ("mrp", "vector"):
                turned = so3.exp(_vectors_of_mrps(values) if group.kind == "mrp" else values)
            elif group.kind == "quaternion":
                turned = _by_quaternions(values[:, [group.parts.index(part) for part in "xyzw"]], self.recording)
            else:
                order = self.choices.order or group.order
                turned = so3.matrix_from_euler(values[:, [group.parts.index(axis) for axis in order]], order)
                record |= {"order": order, "order_said": self.choices.order is not None}
        turned = turned if group is None else self.gaps.turned(self._texts(group), turned)
        if "order" not in record and (group is None or group.kind in ("quaternion", "mrp", "vector")):
            self._check_parts(turned)
        if "order" not in record and self.choices.order is not None:
            raise TrajectoryError(
                f"{self.recording.table.where}: base_order is for angles, and the base's attitude is not told by three"
            )
        record |= {"axes": self.choices.said or usual, "axes_said": self.choices.said is not None}
        axes = named_axes(usual) if self.choices.axes is None else self.choices.axes
        return (turned if isinstance(axes, str) else turned @ axes), record

    def _check_parts(self, turned: Array) -> None:
        """Raise TrajectoryError where rates beside a quaternion say that its first number is w: (N, 3, 3)."""
        if len(self.rates) < len(_FOLLOWING) or len(turned) < 2:
            return
        rates = np.stack([self.recording.table.columns[self.rates[name]] for name in _FOLLOWING], axis=-1)
        if not np.isfinite(rates).all():
            return
        between = 0.5 * (rates[1:] + rates[:-1])
        size = float(np.median(np.linalg.norm(between, axis=-1)))
        w_first = so3.matrix_from_quat(np.roll(so3.quat_from_matrix(turned), -1, axis=-1))
        as_read, other = (self._off_rates(attitudes, between) for attitudes in (turned, w_first))
        if as_read > _CONTRADICTS * size and other < _AGREES * size:
            raise TrajectoryError(
                f"{self.recording.table.where}: read as x y z w, the quaternion of the base turns otherwise than "
                f"{', '.join(_FOLLOWING)} say; read as w x y z it turns as they say: write its numbers in the order "
                "x y z w, or give the columns their names"
            )

    def _off_rates(self, attitudes: Array, rates: Array) -> float:
        """How far turns between neighbouring samples are from rates there, in the median [rad/s]."""
        turns = so3.log(so3.transpose(attitudes[:-1]) @ attitudes[1:]) / np.diff(self.recording.times)[:, None]
        return float(np.median(np.linalg.norm(turns - rates, axis=-1)))

    def _position(self, group: _Group | None) -> Array | None:
        if group is None:
            return self._stored("position")
        self.gaps.joined(self.recording.table, self._texts(group))
        places = (
            self._by_joints(group)[1]
            if group.kind == "joints"
            else np.stack([self._values(name, group.kind) for name in group.names], axis=-1)
        )
        return self.gaps.bridged(self._texts(group), places)

    def _by_joints(self, group: _Group) -> tuple[Array, Array]:
        """Attitude and place by the joints on the way to the base, seen from the world that they start from."""
        kinds = {
            name: {"ball": "quaternion", "prismatic": "position"}.get(joint.kind, "angles")
            for joint in self.way
            for name in joint_coordinates(joint)
        }
        values = {name: self._values(name, kinds[name]) for name in group.names}
        for joint in self.way:
            if joint.kind == "ball":
                _by_quaternions(np.stack([values[name] for name in joint_coordinates(joint)], axis=-1), self.recording)
        return way_poses(self.way, values, len(self.recording.times))

    def _texts(self, group: _Group) -> tuple[str, ...]:
        return tuple(self.found[name][0] for name in group.names)

    def _values(self, name: str, kind: str) -> Array:
        """A column in rad, m or, of a quaternion, without unit."""
        table = self.recording.table
        text, said = self.found[name]
        values = self.gaps.held(table, text)
        if kind in ("quaternion", "mrp"):
            if said not in (None, NO_UNIT):
                raise TrajectoryError(
                    f"{table.where}: column {text!r} is in {said}; a {kind} has no unit: name the column without it"
                )
            return values
        sizes: Mapping[str, float] = ANGLES if kind in ("angles", "vector") else LENGTHS
        if said is not None and said != SI and said not in sizes:
            raise TrajectoryError(f"{table.where}: column {text!r} is in {said}; {', '.join(sizes)} are possible")
        found = self._lengths(text, values, said) if kind == "position" else self._angles(text, values, said)
        farthest = int(np.argmax(np.abs(found)))
        if abs(found[farthest]) > FARTHEST:
            raise TrajectoryError(
                f"{self.recording.place(farthest)}: column {text!r} is at {found[farthest]:.6g} rad or m; up to "
                f"{FARTHEST:g} can be represented to full accuracy"
            )
        return found

    def _lengths(self, text: str, values: Array, said: str | None) -> Array:
        farthest = int(np.argmax(np.abs(values)))
        if said is None and not self.recording.table.by_format and abs(values[farthest]) > _FARTHEST:
            raise TrajectoryError(
                f"{self.recording.place(farthest)}: column {text!r}: {values[farthest]:.6g} m from the origin, or "
                f"millimetres? Write the unit into the header, as `{text} [mm]` or `{text} [m]`"
            )
        return values * (1.0 if said in (None, SI) else LENGTHS[said])

    def _angles(self, text: str, values: Array, said: str | None) -> Array:
        table = self.recording.table
        if said is None:
            given = self.degrees if self.degrees is not None else table.degrees
            if given is None:
                raise TrajectoryError(
                    f"{table.where}: the header does not say inDegrees=yes or no; add that, or give degrees=True or "
                    "False (--degrees, --radians)"
                )
            widest = int(np.argmax(np.abs(values)))
            unsaid = self.degrees is None and not table.by_format
            if unsaid and abs(values[widest]) > _MOST_ANGLE:
                raise TrajectoryError(
                    f"{self.recording.place(widest)}: column {text!r} is at {values[widest]:.6g} rad, more than a "
                    f"turn: degrees? Name it {text}_deg or give degrees=True (--degrees); for radians, give "
                    "degrees=False (--radians)"
                )
            said = "deg" if given else "rad"
        elif self.degrees is not None and self.degrees != (said == "deg"):
            spelled = "degrees" if said == "deg" else said
            raise TrajectoryError(
                f"{table.where}: column {text!r} is in {spelled} by its name, and degrees={self.degrees} was given"
            )
        return values * (1.0 if said == SI else ANGLES[said])


def _vectors_of_mrps(parameters: Array) -> Array:
    """Rotation vectors (N, 3) of modified Rodrigues parameters, tan(angle / 4) about the axis, or of their shadows.

    Source: Schaub and Junkins, Analytical Mechanics of Space Systems, section 3.6: the parameters of the body's axes
    relative to the inertial ones, sigma_B/N, belong to the turn that takes the inertial axes to the body's.
    """
    sizes = np.linalg.norm(parameters, axis=-1, keepdims=True)
    tiny = sizes < np.finfo(np.float64).tiny
    return parameters * np.where(tiny, 4.0, 4.0 * np.arctan(sizes) / np.where(tiny, 1.0, sizes))


def _by_quaternions(quaternions: Array, recording: Recording) -> Array:
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(quaternions, axis=-1)
    off = np.abs(norms - 1.0)
    worst = int(np.argmax(off))
    if not off[worst] <= _OFF_UNIT:
        raise TrajectoryError(
            f"{recording.place(worst)}: the quaternion x y z w of the base has the norm {norms[worst]:.6g}; 1 is needed"
        )
    return so3.matrix_from_quat(quaternions / norms[:, None])
