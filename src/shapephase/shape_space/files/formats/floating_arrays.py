"""Arrays of simulators and optimisers with all coordinates of a floating body, base and joints together."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .... import so3
from ....arrays import Array, finite_array
from ....body.body import Body
from ....body.joint_orders import MUJOCO, OWN, simulator_order
from ....body.virtual_base import way_names, way_poses
from ....errors import ShapeError, TrajectoryError, unknown_name
from ..recording import NEARLY_UNIT, Rates
from .nameless_joints import FREE_JOINT, NamelessJoints, joint_columns, nameless_joints

_NUMBERED = re.compile(r"(qpos|qvel|q|v|Q|Qdot|qdot)[_\[ ]?([0-9]{1,6})\]?")  # qpos_0, qpos[0], qpos0
_ROOT = 6  # coordinates of a free root: three slides, three hinges
_NAMES_THAT_SAY_IT = (
    "store arrays under names that say the order: qpos (place, quaternion w x y z, joints), or base_position, "
    "base_quat_xyzw and shapes beside joint_names"
)


class FreeJoint(NamedTuple):
    """Layout of the coordinates of a free base, which stand before those of the joints.

    quaternion : columns of x, y, z and w
    rate, velocity : columns of the angular and the linear velocity, and `rate_axes`, `velocity_axes` their axes
    order : the word for the order of joints without names
    """

    title: str
    quaternion: list[int]
    position: list[int]
    rate: list[int]
    velocity: list[int]
    rate_axes: str
    velocity_axes: str
    order: str


MUJOCO_QPOS = FreeJoint("MuJoCo qpos", [4, 5, 6, 3], [0, 1, 2], [3, 4, 5], [0, 1, 2], "base", "world", MUJOCO)
PINOCCHIO_Q = FreeJoint("Pinocchio q", [3, 4, 5, 6], [0, 1, 2], [3, 4, 5], [0, 1, 2], "base", "base", OWN)
# Drake numbers the joints of a URDF depth first, as MuJoCo does.
DRAKE_Q = FreeJoint("Drake q", [1, 2, 3, 0], [4, 5, 6], [0, 1, 2], [3, 4, 5], "world", "world", MUJOCO)


class FloatingMotion(NamedTuple):
    """Base and joints of a floating body at N samples.

    names : of the columns of `joints` (N, m) [rad or m]
    quaternion, position : (N, 4) x y z w, (N, 3) of the base [m], or None
    nameless : how columns without names became those of joints; None: they have names, or the file's own order
    """

    title: str
    names: tuple[str, ...]
    joints: Array
    quaternion: Array | None = None
    position: Array | None = None
    rates: Rates | None = None
    nameless: NamelessJoints | None = None

    def shapes(self, body: Body) -> Array:
        """Coordinates of the body's independent joints in its order: (N, n). Raises UnknownNameError."""
        return self.joints[:, places_of(self.names, body)]


def floating_motion(arrays: Mapping[str, Any], where: str, body: Body, order: str | None) -> FloatingMotion | None:
    """Motion in one of the arrays `qpos`, `q` and `Q`; None without them.

    The meaning of `q` follows from the number of its coordinates, and Pinocchio's or Drake's order from the columns
    that are a quaternion of length one. Coordinates may stand along either axis.
    """
    kind = next((name for name in ("qpos", "q", "Q") if name in arrays), None)
    if kind is None:
        return None
    values = finite_array(arrays[kind], f"{where}: {kind}", (None, None))
    names = None if "joint_names" not in arrays else tuple(map(str, np.ravel(arrays["joint_names"])))
    if kind == "q" and names is None and order in (None, OWN):
        values = _with_angles(values, body)
    count = np.size(arrays["time"]) if "time" in arrays else None
    layouts = {"qpos": (MUJOCO_QPOS,), "q": (PINOCCHIO_Q, DRAKE_Q), "Q": ()}[kind]
    root = None if kind == "qpos" else root_width(body, kind)
    fitting: list[tuple[FreeJoint | None, bool]] = []
    for transposed, rows in ((False, values), (True, values.T)):
        if count not in (None, len(rows)):
            continue
        for layout in layouts:
            free = _free_columns(layout, rows.shape[1], names, body, order)
            if free is not None and (not free or _is_unit(rows[:, layout.quaternion])):
                fitting.append((layout, transposed))
        if root is not None and rows.shape[1] == root + body.n_shape:
            fitting.append((None, transposed))
    if len(fitting) != 1:
        times = "" if count is None else f", and there are {count} times"
        raise TrajectoryError(
            f"{where}: {kind} has shape {values.shape}{times}"
            + _misfit(kind, fitting, names or body.joint_names, None if root is None else root + body.n_shape)
        )
    ((layout, transposed),) = fitting
    labels = {"qpos": ("qvel",), "q": ("v",), "Q": ()}[kind] if layout else ("Qdot", "qdot")
    stored = next((arrays[label] for label in labels if label in arrays), None)
    rates = None if stored is None else np.asarray(stored)
    if transposed:
        values, rates = values.T, None if rates is None else rates.T
    if layout is None:
        return _of_root(values, rates, where, body, root or 0)
    motion = with_free_joint(layout, values, rates, body, names=names, order=order, labels=(kind, *labels), where=where)
    return motion._replace(nameless=arrays.get("nameless", motion.nameless))


def with_free_joint(
    layout: FreeJoint,
    places: Array,
    rates: Any,
    body: Body,
    *,
    names: Sequence[str] | None,
    order: str | None,
    labels: Sequence[str],
    where: str,
) -> FloatingMotion:
    """Motion in rows of coordinates, those of a free base before those of the joints.

    places : (N, 7 + m), or without a free joint (N, m)
    rates : (N, 6 + k), of a ball joint its angular velocity in axes of the link that it moves; or None
    names : of the columns of the joints; None: those of an order
    labels : of the two arrays, for messages
    """
    nameless = None
    if names is None:
        nameless = nameless_joints(body, places.shape[1], f"{where}: {labels[0]}", order or layout.order)
        names, free = nameless.names, nameless.free
    else:
        free = places.shape[1] - len(names)
        if free not in (0, FREE_JOINT):
            raise TrajectoryError(
                f"{where}: {labels[0]} has {places.shape[1]} columns; with {len(names)} joints ({', '.join(names)}) it "
                f"has {len(names) + FREE_JOINT}, or {len(names)} without the free joint; mend 'joint_names'"
            )
    doubled = [name for name in names if list(names).count(name) > 1]
    if doubled:
        raise TrajectoryError(f"{where}: joint_names: {doubled[0]!r} stands {list(names).count(doubled[0])} times")
    motion = FloatingMotion(layout.title, tuple(names), places[:, free:], nameless=nameless)
    if not free:
        return motion
    motion = motion._replace(quaternion=places[:, layout.quaternion], position=places[:, layout.position])
    if rates is None or not set(body.joint_names) <= set(names):
        return motion
    balls = sum(name.endswith(".w") for name in names)
    moving = finite_array(rates, f"{where}: {labels[1]}", (len(places), _ROOT + len(names) - balls))
    return motion._replace(
        rates=Rates(
            base=moving[:, layout.rate],
            joints=_derivatives(motion, moving[:, _ROOT:], body),
            base_axes=layout.rate_axes,
            velocity=moving[:, layout.velocity],
            velocity_axes=layout.velocity_axes,
        )
    )


def numbered_columns(columns: Mapping[str, Any], where: str) -> dict[str, list[str]]:
    """Labels such as `qpos_0`, `q[1]` and `Qdot2`, by array in their order; of arrays whose numbers are 0, 1, 2, ..."""
    by_array: dict[str, dict[int, str]] = {}
    for label in columns:
        match = _NUMBERED.fullmatch(label.strip())
        if match is None:
            continue
        numbers = by_array.setdefault(match[1], {})
        first = numbers.setdefault(int(match[2]), label)
        if first != label:
            raise TrajectoryError(
                f"{where}: columns {first!r} and {label!r} are number {int(match[2])} of {match[1]}; keep one"
            )
    return {
        name: [numbers[k] for k in range(len(numbers))]
        for name, numbers in by_array.items()
        if sorted(numbers) == list(range(len(numbers)))
    }


def root_width(body: Body, kind: str) -> int | None:
    """Number of coordinates that move the base before those of the joints; None where their order is not known.

    A bioMod names them, and so does a file that moves its base by joints. `Q` of another body is biorbd's, which turns
    about x, y and z; `q` would leave open in which order.
    """
    if body.base_joints:
        return len(way_names(body.base_joints))
    known = body.base_angles is not None and body.base_slides is not None if _is_biomod(body) else kind == "Q"
    return _ROOT if known and (_is_biomod(body) or body.base_angles is None) else None


def places_of(names: Sequence[str], body: Body) -> list[int]:
    """Columns of the body's independent joints among those with names. Raises UnknownNameError."""
    for joint in body.joint_names:
        if joint not in names:
            raise unknown_name("joint among joint_names", joint, names)
    return [list(names).index(joint) for joint in body.joint_names]


def _of_root(values: Array, rates: Any, where: str, body: Body, width: int) -> FloatingMotion:
    """Motion in biorbd's generalised coordinates: of the root in the order of the body's file, then of the joints."""
    if body.ball_joints:
        raise TrajectoryError(
            f"{where}: Q of a model with quaternions is not read ({body.ball_joints[0]} has one); write columns by "
            "name, or q with the quaternion x y z w of each"
        )
    root, joints, names = values[:, :width], values[:, width:], body.joint_names
    if _is_biomod(body):
        names = tuple(name for name in simulator_order(body, MUJOCO, names) if name in names)
    if rates is not None:
        if np.shape(rates) != values.shape:
            raise ShapeError(f"{where}: Qdot: expected shape {values.shape} as that of Q, got {np.shape(rates)}")
        rates = finite_array(rates, f"{where}: Qdot", values.shape)
    motion = FloatingMotion("biorbd Q", names, joints)
    if body.base_joints:
        way = dict(zip(way_names(body.base_joints), root.T, strict=True))
        turns, places = way_poses(body.base_joints, way, len(values))
        return motion._replace(quaternion=so3.quat_from_matrix(turns), position=places)
    angles, axes = root[:, 3:], "xyz" if body.base_angles is None else body.base_angles[1]
    turns = so3.matrix_from_euler(angles, axes)
    motion = motion._replace(quaternion=so3.quat_from_matrix(turns), position=root[:, :3])
    if rates is None:
        return motion
    base = np.zeros((len(values), 3))
    for k, axis in enumerate(axes):
        # The rate so far is seen from axes that have turned on.
        turn = so3.matrix_from_euler(angles[:, [k]], axis)
        base = so3.apply(so3.transpose(turn), base) + rates[:, 3 + k, None] * np.eye(3)["xyz".index(axis)]
    moving = rates[:, _ROOT:][:, places_of(names, body)]
    return motion._replace(rates=Rates(base, moving, "base", rates[:, :3], "world"))


def _is_biomod(body: Body) -> bool:
    return body.file is not None and body.file.suffix.lower() == ".biomod"


def _free_columns(
    layout: FreeJoint, width: int, names: Sequence[str] | None, body: Body, order: str | None
) -> int | None:
    """Number of columns before those of the joints, 7 or none; None where the width does not fit."""
    if names is not None:
        free = width - len(names)
    else:
        columns = joint_columns(body, width, order or layout.order)
        free = None if columns is None else columns.free
    return free if free in ((0, FREE_JOINT) if layout is MUJOCO_QPOS else (FREE_JOINT,)) else None


def _derivatives(motion: FloatingMotion, rates: Array, body: Body) -> Array:
    """Derivatives of the body's coordinates (N, n) from the rates of all joints in the order of the array."""
    derivatives: dict[str, Array] = {}
    column, names = 0, motion.names
    while len(derivatives) < len(names):
        name = names[len(derivatives)]
        joint, dot, part = name.rpartition(".")
        quaternion_names = [f"{joint}.{axis}" for axis in "xyzw"]
        if not dot or part not in "xyzw" or not set(quaternion_names) <= set(names):
            derivatives[name] = rates[:, column]
            column += 1
            continue
        quaternion = motion.joints[:, [names.index(each) for each in quaternion_names]]
        turning = np.pad(rates[:, column : column + 3], ((0, 0), (0, 1)))
        derivatives |= dict(zip(quaternion_names, 0.5 * so3.quat_product(quaternion, turning).T, strict=True))
        column += 3
    return np.stack([derivatives[joint] for joint in body.joint_names], axis=1) if body.n_shape else rates[:, :0]


def _with_angles(values: Array, body: Body) -> Array:
    """Pinocchio's coordinates with the angles of joints that turn without end, whose cosine and sine it stores."""
    width = FREE_JOINT + body.n_shape + int(np.sum(body.continuous))
    for rows in (values, values.T):
        if not np.any(body.continuous) or rows.shape[1] != width or not _is_unit(rows[:, 3:FREE_JOINT]):
            continue
        parts, column = [rows[:, :FREE_JOINT]], FREE_JOINT
        for turns in body.continuous:
            pair = rows[:, column : column + 1 + turns]
            if turns and not _is_unit(pair):
                return values
            parts.append(np.unwrap(np.arctan2(pair[:, 1], pair[:, 0]))[:, None] if turns else pair)
            column += pair.shape[1]
        return np.hstack(parts) if rows is values else np.hstack(parts).T
    return values


def _is_unit(quaternions: Array) -> bool:
    return bool(np.abs(np.linalg.norm(quaternions, axis=1) - 1.0).max(initial=0.0) <= NEARLY_UNIT)


def _misfit(
    kind: str, fitting: Sequence[tuple[FreeJoint | None, bool]], names: Sequence[str], rooted: int | None
) -> str:
    """End of the message about an array that fits no order of coordinates, or several."""
    titles = list(dict.fromkeys("biorbd's" if layout is None else layout.title for layout, _ in fitting))
    if len(titles) > 1:
        return f": it fits {' and '.join(titles)}; {_NAMES_THAT_SAY_IT}"
    if fitting:
        return (
            ": as many samples as coordinates do not show along which axis time goes; leave out the last sample of "
            f"{kind}, of its rates and of the times"
        )
    orders = [] if rooted is None else [f"the root and the joints in biorbd's order ({rooted} numbers)"]
    if kind == "qpos":
        orders += [f"place, quaternion w x y z of length 1 and joints ({FREE_JOINT + len(names)} numbers)"]
        orders += [f"the joints alone ({len(names)})"]
    if kind == "q":
        orders += [
            "Pinocchio's place and quaternion x y z w of length 1, or Drake's quaternion w x y z and place, and the "
            f"joints ({FREE_JOINT + len(names)} numbers)"
        ]
    needed = ", or ".join(orders) or "coordinates of the base in an order that the body's file does not say"
    return (
        f"; a sample is {needed}; the joints are {', '.join(names)}. Store an array 'joint_names' if there are others, "
        f"or {_NAMES_THAT_SAY_IT}"
    )
