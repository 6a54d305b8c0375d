"""Columns of simulators' arrays, which have no names: which joint each is, by the order that the simulator gives them.

Where the file has the places of the bodies, too, the order is the one in which the body's links come to lie there.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .... import so3
from ....arrays import Array
from ....body.body import Body
from ....body.joint_orders import ISAAC, ISAAC_BY_NAME, MUJOCO, OWN, TITLES, JointOrder, simulator_order
from ....body.virtual_base import way_names
from ....errors import TrajectoryError, TrajectoryWarning
from ..recording import OFF_UNIT

FREE_JOINT = 7  # entries of a free joint: a place and a quaternion
_SAMPLES = 50  # at which places of bodies are compared: every joint has moved by then
_FITS = 0.01  # relative to the body's extent, rms: links farther from the file's bodies are others
_ALIKE = 5.0  # times the least distance: places with few digits do not distinguish such orders
_AT_REST = 1e-6  # [rad/s] slower bodies do not show how they turn
_CONTRADICTS = 0.5  # relative to the rates, rms: turns between samples that are off by more are others


@dataclass(frozen=True)
class NamelessJoints:
    """Joints of the columns of an array.

    order : the word for their order, one of `WORDS`
    free : the number of columns before them, 7 or none
    """

    order: str
    names: tuple[str, ...]
    free: int

    @property
    def title(self) -> str:
        """The order in words."""
        return TITLES[self.order]

    @property
    def record(self) -> dict[str, object]:
        """Order and names, ready for JSON."""
        return {"order": self.order, "means": self.title, "joints": list(self.names)}


def nameless_joints(body: Body, width: int, where: str, order: str | None) -> NamelessJoints:
    """Joints of an array of so many columns, with a free joint before them or without.

    Raises TrajectoryError if the body has another number of joints. Warns where Isaac's order depends on how its
    importer sorted the joints of a link.
    """
    word = order or MUJOCO
    joints = joint_columns(body, width, word)
    if joints is None:
        own = _independent(body, simulator_order(body, word, body.joint_names))
        raise TrajectoryError(
            f"{where} has {width} columns; with {len(own)} joints ({', '.join(own)}) it has {len(own) + FREE_JOINT}, "
            f"or {len(own)} without the free joint; joints that follow others may be there, too. Add an array "
            "'joint_names' with the names of the columns"
        )
    by_name = _independent(body, simulator_order(body, ISAAC_BY_NAME, body.joint_names))
    if word == ISAAC and by_name != _independent(body, joints.names):
        warnings.warn(
            f"{where}: joints of one link are taken as the file of {body.name} lists them: {', '.join(joints.names)}; "
            f"if the importer sorted them by name, give joint_order={ISAAC_BY_NAME!r} (--joint-order {ISAAC_BY_NAME})",
            TrajectoryWarning,
            stacklevel=2,
        )
    return joints


def joint_columns(body: Body, width: int, word: str) -> NamelessJoints | None:
    """Joints of an array of so many columns in an order; None where that is not their number."""
    joints = simulator_order(body, word, body.joint_names)
    fitting = {(names, free) for names, free in _layouts(body, joints) if width == len(names) + free}
    return NamelessJoints(word, *fitting.pop()) if len(fitting) == 1 else None


def placed_joints(
    body: Body,
    joints: Array,
    places: Array,
    quaternions: Array,
    where: str,
    order: str | None,
    *,
    orders: int,
    names: tuple[str, ...] | None = None,
    spins: Array | None = None,
    times: Array | None = None,
) -> tuple[NamelessJoints, int]:
    """Joints of an array whose bodies' places are known, and the quaternion order: 0 for w x y z, 1 for x y z w.

    joints : (N, n) without the free joint
    places : (N, b, 3) of the bodies, the base first [m]
    quaternions : (N, 4) of the base
    orders : 1: the quaternion is w x y z; 2: it may be x y z w, too
    spins : (N, b, 3) angular velocities of the bodies, world axes [rad/s], where they are known, at `times` (N,) [s]
    """
    if places.ndim != 3 or places.shape[::2] != (len(joints), 3):
        raise TrajectoryError(
            f"{where}: the places of bodies have the shape {places.shape}; ({len(joints)}, bodies, 3) is needed"
        )
    norms = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if not np.all(np.abs(norms - 1.0) <= OFF_UNIT):
        raise TrajectoryError(f"{where}: the quaternions of the base are not of length 1")
    unit = quaternions / norms
    attitudes = [so3.matrix_from_quat(each) for each in (np.roll(unit, -1, axis=-1), unit)][:orders]
    rows = np.unique(np.linspace(0, len(joints) - 1, _SAMPLES).astype(int))
    arms = places[rows, 1:] - places[rows, :1]
    measured = [np.einsum("tji,tkj->tki", attitude[rows], arms) for attitude in attitudes]
    extent = _rms_length(arms) if arms.size else 0.0
    tried: list[tuple[float, NamelessJoints, int, tuple[str, ...]]] = []
    for known in (*body.joint_orders, JointOrder(OWN, body.joint_names, ())):
        columns = names or next(
            (n for n, free in _layouts(body, known.joints) if not free and len(n) == joints.shape[1]), None
        )
        if columns is None or len(known.links) != places.shape[1] or (order is not None and known.word != order):
            continue
        shapes = _shapes(body, joints[rows], columns)
        first, *others = (body.link_pose(shapes, link)[:, :3, 3] for link in known.links)
        computed = np.stack([other - first for other in others], axis=1) if others else np.zeros_like(arms)
        for quaternion_order, seen in enumerate(measured):
            error = _rms_length(computed - seen) if others else 0.0
            tried.append((error, NamelessJoints(known.word, columns, 0), quaternion_order, known.links))
    if not tried:
        raise TrajectoryError(
            f"{where}: {joints.shape[1]} joints and {places.shape[1]} bodies are there, and {body.name} has "
            f"{body.n_shape} joints and {len(body.link_names)} links: the order of the joints cannot be told; add an "
            "array 'joint_names', or give joint_order (--joint-order)"
        )
    best = min(error for error, *_ in tried)
    if best > _FITS * extent:
        raise TrajectoryError(
            f"{where}: in no order of the joints do the links of {body.name} lie where the file has its bodies: at "
            f"best {best:.3g} m from there, rms; is it another robot? Add an array 'joint_names' if it is not"
        )
    alike = [trial for trial in tried if trial[0] <= _ALIKE * best + 1e-9 * extent]
    if spins is not None and times is not None and np.abs(spins).max() > _AT_REST:
        # Places do not show turns of a link about its own origin.
        errors = [
            _spin_error(body, _shapes(body, joints, trial.names), attitudes[quaternion_order], links, spins, times)
            for _, trial, quaternion_order, links in alike
        ]
        if min(errors) > _CONTRADICTS:
            raise TrajectoryError(
                f"{where}: body_ang_vel_w contradicts the attitudes of the bodies in every order of joints and "
                "quaternions; leave out what is wrong, or add 'joint_names' and base_quat_wxyz with shapes"
            )
        alike = [trial for trial, error in zip(alike, errors, strict=True) if error <= _ALIKE * min(errors) + 1e-6]
    _, chosen, quaternion_order, _ = min(alike, key=lambda trial: trial[0])
    shapes = _shapes(body, joints, chosen.names)
    for _, other, other_quaternion_order, _ in alike:
        if not np.array_equal(_shapes(body, joints, other.names), shapes):
            raise TrajectoryError(
                f"{where}: the places of the bodies fit {chosen.title}, and {other.title} as well; give joint_order "
                f"(--joint-order {chosen.order} or {other.order}), or add an array 'joint_names'"
            )
        if other_quaternion_order != quaternion_order:
            raise TrajectoryError(
                f"{where}: the places of the bodies fit quaternions w x y z, and x y z w as well; add body_ang_vel_w, "
                "or store shapes, joint_names and base_quat_wxyz"
            )
    return chosen, quaternion_order


def _rms_length(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))


def _spin_error(body: Body, shapes: Array, base: Array, links: Sequence[str], spins: Array, times: Array) -> float:
    """Difference between turns of links and `spins`, relative to these, rms."""
    rows = np.unique(np.linspace(0, len(times) - 2, _SAMPLES).astype(int))
    error, size = 0.0, 0.0
    for number, link in enumerate(links):
        before, after = (base[k] @ body.link_pose(shapes[k], link)[:, :3, :3] for k in (rows, rows + 1))
        turning = so3.log(after @ so3.transpose(before)) / (times[rows + 1] - times[rows])[:, None]
        between = 0.5 * (spins[rows, number] + spins[rows + 1, number])
        error += float(np.sum((turning - between) ** 2))
        size += float(np.sum(between**2))
    return float(np.sqrt(error / size)) if size else np.inf


def _independent(body: Body, names: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for name in names if name in body.joint_names)


def _layouts(body: Body, names: tuple[str, ...]) -> list[tuple[tuple[str, ...], int]]:
    """Possible columns: all joints or the independent ones, behind a free joint, the joints of the base, or none."""
    way, joints = way_names(body.base_joints), dict.fromkeys((names, _independent(body, names)))
    layouts = [(each, free) for each in joints for free in (FREE_JOINT, 0)]
    return layouts + ([((*way, *each), 0) for each in joints] if way else [])


def _shapes(body: Body, joints: Array, names: tuple[str, ...]) -> Array:
    """Columns of the independent joints, in the body's order."""
    return joints[:, [names.index(name) for name in body.joint_names]]
