"""A body as a reading process hands it over: links and joints of one axis, and inertia and momentum by the engine.

This module and the readers beside it run in the child process.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

from ...arrays import Array
from ..couplings.coupling import Coupling
from ..formats.xml_text import quoted
from ..link_tree import Joint, Link
from ..virtual_base import joint_coordinates

EXACT = 1e-12  # share of the largest terms by which an engine's numbers may differ: thousands of roundings
FRAME_ERRORS = 10.0  # times the deviation of an engine's axes from orthonormal ones, which its sums contain
_POSES = 3  # random shapes at which the engine's numbers are compared: a wrong sign shows at the first
SEED = 20060518  # arbitrary, so that every loading compares at equal shapes
_MOST_NAME = 256  # characters; names appear whole in messages and tables
_STEP = 0.01  # [s] of differences of eighth order: their truncation is near rounding for rates of 1 rad/s
WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)  # of f(k h) - f(-k h), k = 1 to 4 (Fornberg 1988)


class UnusableModelError(Exception):
    """The file cannot be used; the message gives the reason. With a line where it is known."""

    def __init__(self, message: str, line: int = 1) -> None:
        super().__init__(message)
        self.line = line


@dataclass
class Chain:
    """Links and joints on the way down from the root; `where` of each is its line alone.

    frames : names of links that are mere steps between the axes of one joint and the next
    notes : what is left out of the file: a sentence, or kind, name and text of many alike
    poses : the engine's numbers at random shapes, the arguments of `add_pose`
    couplings : of joints that follow others, by name
    base_joints, base_angles, base_slides : see `LinkTree`
    """

    name: str
    links: dict[str, Link] = field(default_factory=dict)
    joints: list[Joint] = field(default_factory=list)
    frames: list[str] = field(default_factory=list)
    notes: list[str | tuple[str, str, str]] = field(default_factory=list)
    poses: list[dict[str, Any]] = field(default_factory=list)
    couplings: dict[str, Coupling] = field(default_factory=dict)
    base_joints: list[Joint] = field(default_factory=list)
    base_angles: tuple[list[str], str] | None = None
    base_slides: list[str] | None = None

    def add_link(self, name: str, mass: float, centre: Array, inertia: Array, line: int = 1) -> None:
        """Add a link with centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2], in its axes."""
        if name in self.links:
            raise UnusableModelError(f"two links are named {name!r}; give each a name of its own", line)
        if not np.isfinite(centre).all():
            raise UnusableModelError(f"link {name!r}: its centre of mass is {np.ravel(centre).tolist()}", line)
        self.links[name] = Link(name, str(line), float(mass), np.array(centre).ravel(), np.array(inertia).reshape(3, 3))

    def add_frame(self, name: str) -> None:
        """Add a step between two axes, a link without mass."""
        self.add_link(name, 0.0, np.zeros(3), np.zeros((3, 3)))
        self.frames.append(name)

    def add_joints(
        self,
        parent: str,
        child: str,
        place: Array,
        turn: Array,
        axes: Sequence[tuple[str, str, Array, list[float] | None]],
        line: int = 1,
    ) -> None:
        """Add the joints between two links, each moved by the one before it.

        place, turn : the first joint's axes in those of the parent (3,) [m], (3, 3)
        axes : name, "revolute", "prismatic" or "ball", axis (3,), limits [rad or m]; none: the links are fixed to each
            other
        """
        if not axes:
            axes = [(f"{child}_fixed", "fixed", np.array([1.0, 0.0, 0.0]), None)]
        for number, (name, kind, axis, limits) in enumerate(axes):
            below = child if number == len(axes) - 1 else f"{child}__{name}"
            if below != child:
                self.add_frame(below)
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
        limits: list[float] | None,
        after: Array | None = None,
        line: int = 1,
    ) -> None:
        """Add one joint, by the fields of `Joint`; limits None: it has none."""
        if any(joint.name == name for joint in self.joints):
            raise UnusableModelError(f"joint {name!r}: two joints have this name; rename one", line)
        lower, upper = (-np.inf, np.inf) if limits is None else map(float, limits)
        if not lower <= upper:
            raise UnusableModelError(
                f"joint {name!r}: the lower limit {lower:g} is not below the upper one, {upper:g}", line
            )
        # Copies, as engines change their arrays.
        after = np.zeros(3) if after is None else after
        place, axis, after = (np.array(vector).ravel() for vector in (place, axis, after))
        turn = np.array(turn).reshape(3, 3)
        self.joints.append(Joint(name, str(line), kind, parent, child, place, turn, axis, after, (lower, upper)))

    def moving(self) -> list[str]:
        """Names of the coordinates of joints that follow no other; a ball joint has four."""
        return [name for joint in self.joints if joint.name not in self.couplings for name in joint_coordinates(joint)]

    def random_shapes(self) -> list[tuple[dict[str, float], dict[str, float]]]:
        """Coordinates and rates by joint, within a radian or metre, and within the limits."""
        random, names = np.random.default_rng(SEED), self.moving()
        limits_of = {joint.name: joint.limits for joint in self.joints}
        limits = [limits_of.get(name, (-1.0, 1.0)) for name in names]
        lower, upper = np.clip(np.array(limits).reshape(-1, 2), -1.0, 1.0).T
        states = []
        for _ in range(_POSES):
            shape = lower + (upper - lower) * random.uniform(size=len(lower))
            rate = random.uniform(-1.0, 1.0, len(lower))
            states.append(tuple(dict(zip(names, values.tolist(), strict=True)) for values in (shape, rate)))
        return states

    def add_pose(
        self,
        shape: dict[str, float],
        rate: dict[str, float],
        inertia: Array,
        momentum: Array,
        tolerance: tuple[float, float] = (EXACT, EXACT),
        whole: tuple[float | None, Array | None] = (None, None),
    ) -> None:
        """Add the engine's I (3, 3) [kg m^2] and L_o (3,) [kg m^2/s] at a shape, axes of the root link.

        tolerance : of both, as shares of their largest terms
        whole : mass [kg] and centre of mass (3,) [m] from the root link's origin; None: not compared
        """
        mass, centre = whole
        self.poses.append({
            "shape": shape,
            "rate": rate,
            "inertia": np.ravel(inertia),
            "momentum": np.ravel(momentum),
            "tolerance": tolerance,
            "mass": mass,
            "centre": centre,
        })  # fmt: skip

    def to_json(self) -> str:
        """The chain as JSON: objects by their fields, arrays as lists."""
        return json.dumps(self, default=_plain)


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {item.name: getattr(value, item.name) for item in fields(value)}
    return value.tolist()


def check_name(name: str, owner: str, line: int) -> None:
    """Raise UnusableModelError for a name that is too long, or cannot be printed."""
    if len(name) > _MOST_NAME:
        raise UnusableModelError(f"{quoted(owner)}: {len(name)} characters; up to {_MOST_NAME} are allowed", line)
    if not name.isprintable() or name.isspace():
        raise UnusableModelError(f"{owner}: a name with characters that cannot be printed; rename it", line)


def locked_inertia(masses: Array, centres: Array, tensors: Array) -> Array:
    """Inertia about the common centre of mass of parts (N,), (N, 3), (N, 3, 3) in one set of axes: (3, 3)."""
    apart = centres - masses @ centres / masses.sum()
    squares = (apart**2).sum(axis=1)[:, None, None] * np.eye(3) - apart[:, :, None] * apart[:, None, :]
    return np.asarray((tensors + masses[:, None, None] * squares).sum(axis=0))


def inertia_and_momentum(
    masses: Array, tensors: Array, centres: Array, turns: Array, speeds: Array, omega: Array
) -> tuple[Array, Array]:
    """Locked inertia (3, 3) and angular momentum (3,) of moving parts about their common centre of mass.

    masses, tensors : (N,), (N, 3, 3) each in axes of its part
    centres, turns, speeds, omega : (N, 3), (N, 3, 3), (N, 3), (N, 3)
    """
    turned = turns @ tensors @ np.swapaxes(turns, 1, 2)
    apart = centres - masses @ centres / masses.sum()
    momentum = masses @ np.cross(apart, speeds) + (turned @ omega[:, :, None])[:, :, 0].sum(axis=0)
    return locked_inertia(masses, centres, turned), momentum


def rates_by_differences(
    poses: Callable[[dict[str, float]], tuple[Array, Array]], shape: dict[str, float], rate: dict[str, float]
) -> tuple[Array, Array]:
    """Velocities of centres and angular velocities, (N, 3) each, by poses a little earlier and later.

    poses : centres (N, 3) and orientations (N, 3, 3) at coordinates by name
    """
    speeds = slopes = np.zeros(())
    for steps, weight in enumerate(WEIGHTS, 1):
        for side in (1.0, -1.0):
            moved = {name: value + side * steps * _STEP * rate[name] for name, value in shape.items()}
            centres, turns = poses(moved)
            speeds, slopes = speeds + side * weight / _STEP * centres, slopes + side * weight / _STEP * turns
    spins = slopes @ np.swapaxes(poses(shape)[1], 1, 2)
    return speeds, 0.5 * np.stack([spins[:, i, j] - spins[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1)
