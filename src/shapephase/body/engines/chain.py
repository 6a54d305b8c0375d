"""What a reading process says of a body: links and joints of one axis as plain numbers, and how the engine sees it.

This module and the readers beside it run in the child process, with the engine and NumPy alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays import Array

POSES = 3
"""Random shapes and rates at which the engine's inertia and momentum are compared with ours."""
SEED = 20060518
"""Any number: the random shapes are the same at every loading."""
_NO_OFFSET = np.zeros(3)
_MOST_NAME = 256
"""Characters of a name, which appears whole in messages and tables."""


class UnusableModelError(Exception):
    """The file cannot be used; the text says why. With a line where it is known."""

    def __init__(self, message: str, line: int = 1) -> None:
        super().__init__(message)
        self.line = line


@dataclass
class Chain:
    """Links and joints on the way down from the root.

    Attributes
    ----------
    links, joints : as the fields of `Link` and `Joint`, by name of the field
    frames : names of links that are mere steps between the axes of one joint and the next
    notes : what the file says and is not taken up: a sentence, or kind, name and what is to be said of many alike
    poses : what the engine gives at random shapes, as `add_pose` takes it
    couplings : of joints that follow others, by name, as `couple` takes them
    base_joints : as `joints`, those that lead from the world to the base
    base_angles : names of three angles of the base and the axes they turn about, one after the other; or none
    base_slides : names of three coordinates that move the base along x, y and z; or none
    """

    name: str
    links: list[dict[str, Any]] = field(default_factory=list)
    joints: list[dict[str, Any]] = field(default_factory=list)
    frames: list[str] = field(default_factory=list)
    notes: list[str | tuple[str, str, str]] = field(default_factory=list)
    poses: list[dict[str, Any]] = field(default_factory=list)
    couplings: dict[str, dict[str, Any]] = field(default_factory=dict)
    base_joints: list[dict[str, Any]] = field(default_factory=list)
    base_angles: tuple[list[str], str] | None = None
    base_slides: list[str] | None = None

    def add_link(self, name: str, mass: float, centre: Array, inertia: Array, line: int = 1) -> None:
        """With its centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2], in its axes."""
        if any(link["name"] == name for link in self.links):
            raise UnusableModelError(f"two links are named {name!r}; give each a name of its own", line)
        if not np.isfinite(centre).all():
            raise UnusableModelError(f"link {name!r}: its centre of mass is {np.ravel(centre).tolist()}", line)
        entry = {"name": name, "mass": float(mass), "centre": np.ravel(centre).tolist(), "line": line}
        self.links.append(entry | {"inertia": np.ravel(inertia).tolist()})

    def add_joints(
        self,
        parent: str,
        child: str,
        place: Array,
        turn: Array,
        axes: list[tuple[str, str, Array, list[float]]] | list[tuple[str, str, Array, list[float] | None]],
        line: int = 1,
    ) -> None:
        """The joints between two links, each moved by the one before it.

        place, turn : the first joint's axes in those of the parent (3,) [m], (3, 3)
        axes : name, "revolute", "prismatic" or "ball", axis (3,), limits [rad or m]; none: the links are fixed to each
            other
        """
        if not axes:
            ahead = np.array([1.0, 0.0, 0.0])
            self.add_joint(f"{child}_fixed", "fixed", parent, child, place, turn, ahead, None, line=line)
        for number, (name, kind, axis, limits) in enumerate(axes):
            last = number == len(axes) - 1
            below = child if last else f"{child}__{name}"
            if not last:
                self.add_link(below, 0.0, np.zeros(3), np.zeros((3, 3)))
                self.frames.append(below)
            self.add_joint(name, kind, parent, below, place, turn, axis, limits, line=line)
            parent, place, turn = below, np.zeros(3), np.eye(3)

    def add_joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        place: Array,
        turn: Array,
        axis: Array,
        limits: Any,
        after: Array = _NO_OFFSET,
        line: int = 1,
    ) -> None:
        """One joint, as the fields of `Joint`; limits None: it has none."""
        if any(joint["name"] == name for joint in self.joints):
            raise UnusableModelError(f"joint {name!r}: two joints have this name; rename one", line)
        if limits is not None and not limits[0] <= limits[1]:
            raise UnusableModelError(
                f"joint {name!r}: the lower limit {limits[0]:g} is not below the upper one, {limits[1]:g}", line
            )
        self.joints.append({
            "name": name,
            "kind": kind,
            "parent": parent,
            "child": child,
            "place": np.ravel(place).tolist(),
            "turn": np.ravel(turn).tolist(),
            "axis": np.ravel(axis).tolist(),
            "after": np.ravel(after).tolist(),
            "line": line,
            "limits": None if limits is None else [float(limits[0]), float(limits[1])],
        })  # fmt: skip

    def couple(self, name: str, start: float, terms: list[tuple[str, Array, Array, Array]]) -> None:
        """A joint that follows others: start + the sum of functions of one other joint each.

        terms : name of the joint that is followed, knots (m,), centres (m + 1,) and coefficients (order, m + 1) of the
            polynomials between the knots, by powers of the distance from the centres (`JointFunction`)
        """
        self.couplings[name] = {
            "start": float(start),
            "terms": [
                [driver, *(np.asarray(one, dtype=float).tolist() for one in function)] for driver, *function in terms
            ],
        }  # fmt: skip

    def moving(self) -> list[str]:
        """Names of the coordinates of joints that follow no other; of a ball joint there are four."""
        moving = (joint for joint in self.joints if joint["kind"] != "fixed")
        return [
            name
            for joint in moving
            if joint["name"] not in self.couplings
            for name in (ball_names(joint["name"]) if joint["kind"] == "ball" else [joint["name"]])
        ]

    def random_shapes(self) -> list[tuple[dict[str, float], dict[str, float]]]:
        """Coordinates and rates by joint, within a radian or metre, and within the limits."""
        random = np.random.default_rng(SEED)
        limits_of = {joint["name"]: joint["limits"] for joint in self.joints}
        limits = [limits_of.get(name) or (-1.0, 1.0) for name in self.moving()]
        lower, upper = np.clip(np.array(limits).reshape(-1, 2), -1.0, 1.0).T
        found = []
        for _ in range(POSES):
            shape = lower + (upper - lower) * random.uniform(size=len(lower))
            rate = random.uniform(-1.0, 1.0, len(lower))
            found.append((dict(zip(self.moving(), shape.tolist(), strict=True)),
                          dict(zip(self.moving(), rate.tolist(), strict=True))))  # fmt: skip
        return found

    def add_pose(
        self,
        shape: dict[str, float],
        rate: dict[str, float],
        inertia: Array,
        momentum: Array,
        tolerance: tuple[float, float],
        whole: tuple[float, Array] | None = None,
    ) -> None:
        """What the engine has at a shape: I (3, 3) [kg m^2] and L_o (3,) [kg m^2/s], axes of the root link.

        tolerance : of both, as shares of their largest terms
        whole : its mass [kg] and centre of mass (3,) [m], from the root link's origin; None: not compared
        """
        mass, centre = whole or (None, None)
        self.poses.append({
            "shape": shape,
            "rate": rate,
            "inertia": np.ravel(inertia).tolist(),
            "momentum": np.ravel(momentum).tolist(),
            "tolerance": list(tolerance),
            "mass": mass,
            "centre": None if centre is None else np.ravel(centre).tolist(),
        })  # fmt: skip

    def spoken(self) -> dict[str, Any]:
        """All of it as JSON holds it."""
        return self.__dict__


def check_name(name: str, owner: str, line: int) -> None:
    """Raise UnusableModelError for a name that is too long, or cannot be printed."""
    if len(name) > _MOST_NAME:
        raise UnusableModelError(f"{owner[:60]}: {len(name)} characters; up to {_MOST_NAME} are allowed", line)
    if not name.isprintable() or name.isspace():
        raise UnusableModelError(f"{owner}: a name with characters that cannot be printed; rename it", line)


def ball_names(joint: str) -> list[str]:
    """Of the four numbers of a ball joint, a quaternion of any length."""
    return [f"{joint}.{part}" for part in "xyzw"]


def ball_state(numbers: Array, derivatives: Array) -> tuple[Array, Array]:
    """Of length one, as w, x, y, z, and the angular velocity in axes of the child: (4,), (4,) -> (4,), (3,)."""
    (*vector, scalar), (*change, swing) = numbers, derivatives
    spin = scalar * np.array(change) - swing * np.array(vector) - np.cross(vector, change)
    square = float(numbers @ numbers)
    return np.roll(numbers, 1) / np.sqrt(square), 2.0 * spin / square


def locked_inertia(masses: Array, centres: Array, tensors: Array) -> Array:
    """About the common centre of mass, of parts (N,), (N, 3), (N, 3, 3) in the same axes: (3, 3)."""
    apart = centres - masses @ centres / masses.sum()
    squares = (apart**2).sum(axis=1)[:, None, None] * np.eye(3) - apart[:, :, None] * apart[:, None, :]
    return np.asarray((tensors + masses[:, None, None] * squares).sum(axis=0))
