"""The map from the independent coordinates of a body to those of all its joints, with two derivatives."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...arrays import Array
from ...display import frozen
from ...errors import ModelFileError, ShapeError
from .ball_joints import BallJoint, coordinate_names, rate_names
from .coupling import Coupling
from .functions import JointFunction


class CurvedJoint(NamedTuple):
    """A joint whose coordinate is `start` plus functions of those of other joints; known by their places.

    row : its place among all joints
    start : [rad or m]
    terms : place of the joint that is followed, and the function
    """

    row: int
    start: float
    terms: tuple[tuple[int, JointFunction], ...]


@frozen
class CoordinateMap:
    """Coordinates of all k joints of one axis from the n numbers of a shape.

    A ball joint stands for three hinges behind a turn that differs from shape to shape, so that they are at zero.

    names : (k,) of all joints, of a ball joint those of its rates
    independent : (n,) of those that follow no other, of a ball joint those of its four numbers
    matrix, offset : (k, n), (k,) of the joints that depend on the shape by matrix @ shape + offset; other rows are zero
    curved : the others, each behind those that it follows
    balls : the ball joints
    """

    names: tuple[str, ...]
    independent: tuple[str, ...]
    matrix: Array
    offset: Array
    curved: tuple[CurvedJoint, ...] = ()
    balls: tuple[BallJoint, ...] = ()

    @property
    def is_linear(self) -> bool:
        """True where all joints depend on the shape by matrix and offset."""
        return not self.curved and not self.balls

    @cached_property
    def is_identity(self) -> bool:
        """True where no joint follows another."""
        count = len(self.names)
        whole = self.matrix.shape == (count, count) and np.array_equal(self.matrix, np.eye(count))
        return self.is_linear and whole and not self.offset.any()

    @cached_property
    def drivers(self) -> tuple[str, ...]:
        """The joints that a curved one follows, by a function that is not a straight line or after others."""
        return tuple(dict.fromkeys(self.names[source] for joint in self.curved for source, _ in joint.terms))

    @cached_property
    def knotted(self) -> tuple[tuple[int, Array, bool], ...]:
        """Joints that functions with knots depend on, in an order in which each is behind those it follows: its place,
        all the knots, and whether slopes jump there."""
        order = [*range(len(self.names))]
        depth = {joint.row: place for place, joint in enumerate(self.curved)}
        order.sort(key=lambda row: depth.get(row, -1))
        knotted = []
        for row in order:
            own = [f for joint in self.curved for source, f in joint.terms if source == row and len(f.knots)]
            if own:
                knots = np.unique(np.concatenate([function.knots for function in own]))
                knotted.append((row, knots, any(len(function.kinks) for function in own)))
        return tuple(knotted)

    @property
    def is_smooth(self) -> bool:
        """True where no function has knots."""
        return not self.knotted

    @property
    def has_kinks(self) -> bool:
        """True where a slope jumps at some knot."""
        return any(kinked for _, _, kinked in self.knotted)

    def coordinates(self, shapes: Array) -> Array:
        """(N, n) -> (N, k)."""
        if self.is_identity:
            return shapes
        full = shapes @ self.matrix.T + self.offset
        for joint in self.curved:
            full[:, joint.row] = joint.start + sum(function(full[:, k]).value for k, function in joint.terms)
        return full

    def with_rates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """Coordinates and rates of all joints: (N, n), (N, n) -> (N, k), (N, k)."""
        if self.is_identity:
            return shapes, rates
        full, speeds = shapes @ self.matrix.T + self.offset, rates @ self.matrix.T
        for joint in self.curved:
            full[:, joint.row] = joint.start
            for source, function in joint.terms:
                values = function(full[:, source])
                full[:, joint.row] += values.value
                speeds[:, joint.row] += values.slope * speeds[:, source]
        for ball in self.balls:
            speeds[:, ball.rows] = ball.rates(shapes, rates)
        return full, speeds

    def slopes(self, shapes: Array) -> Array:
        """Derivatives of all coordinates by the shape: (N, n) -> (N, k, n)."""
        return self._slopes_and_rates(shapes, np.zeros_like(shapes))[0]

    def slope_rates(self, shapes: Array, rates: Array) -> Array:
        """Rates of these derivatives along a motion, which are also the derivatives of all rates by the shape while the
        rates of the shape stay: (N, n), (N, n) -> (N, k, n)."""
        return self._slopes_and_rates(shapes, rates)[1]

    def folded(self, columns: Array, shapes: Array) -> Array:
        """Derivatives by all joints into those by the shape: (N, ..., k), (N, n) -> (N, ..., n)."""
        if self.is_identity:
            return columns
        if self.is_linear:
            return columns @ self.matrix
        rows = columns.reshape(len(columns), math.prod(columns.shape[1:-1]), columns.shape[-1])
        return (rows @ self.slopes(shapes)).reshape(*columns.shape[:-1], len(self.independent))

    def _slopes_and_rates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        full, speeds = self.with_rates(shapes, rates)
        slopes = np.repeat(self.matrix[None], len(shapes), axis=0)
        changes = np.zeros_like(slopes)
        for joint in self.curved:
            for source, function in joint.terms:
                values = function(full[:, source])
                slopes[:, joint.row] += values.slope[:, None] * slopes[:, source]
                bent = (values.bend * speeds[:, source])[:, None] * slopes[:, source]
                changes[:, joint.row] += bent + values.slope[:, None] * changes[:, source]
        for ball in self.balls:
            slopes[:, ball.rows, ball.columns] = ball.slopes(shapes)
            changes[:, ball.rows, ball.columns] = ball.hinge_slope_rates(shapes, rates)
        return slopes, changes


def coordinate_map(
    joints: tuple[str, ...], couplings: Mapping[str, Coupling], balls: Collection[str] = ()
) -> CoordinateMap:
    """The map of joints of which some follow others, and some are ball joints."""
    for name, coupling in couplings.items():
        for ball in {name, *coupling.drivers} & set(balls):
            raise ModelFileError(
                f"joint {name!r}: {ball!r} is a ball joint, whose turn is not one number that follows or leads another"
            )
    names = tuple(row for name in joints for row in (rate_names(name) if name in balls else [name]))
    free = [name for name in joints if name not in couplings]
    independent = tuple(part for name in free for part in (coordinate_names(name) if name in balls else [name]))
    for group in (names, independent):
        for name in group:
            if balls and group.count(name) > 1:
                raise ModelFileError(f"joint {name!r} has the name of a part of a ball joint; rename one of them")
    place = {name: row for row, name in enumerate(names)}
    columns = {name: column for column, name in enumerate(independent)}
    matrix, offset = np.zeros((len(names), len(independent))), np.zeros(len(names))
    for name in set(free) - set(balls):
        matrix[place[name], columns[name]] = 1.0
    spheres = tuple(
        BallJoint(name, place[rate_names(name)[0]], columns[coordinate_names(name)[0]])
        for name in joints if name in balls
    )  # fmt: skip
    curved: list[CurvedJoint] = []
    rows_of_curved: set[int] = set()
    for name in _ordered(names, couplings):
        coupling, row = couplings[name], place[name]
        terms = tuple((place[driver], function) for driver, function in coupling.terms)
        if all(_straight(function) and source not in rows_of_curved for source, function in terms):
            offset[row] = coupling.start
            for source, function in terms:
                start, slope = _line(function)
                matrix[row] += slope * matrix[source]
                offset[row] += start + slope * offset[source]
        else:
            curved.append(CurvedJoint(row, coupling.start, terms))
            rows_of_curved.add(row)
    return CoordinateMap(names, independent, matrix, offset, tuple(curved), spheres)


def _ordered(names: tuple[str, ...], couplings: Mapping[str, Coupling]) -> list[str]:
    """The joints that follow others, each behind those that it follows."""
    waiting = [name for name in names if name in couplings]
    known = set(names) - set(waiting)
    ordered: list[str] = []
    for name in waiting:
        for driver in couplings[name].drivers:
            if driver not in names:
                raise ModelFileError(f"joint {name!r} follows {driver!r}, which is fixed or not part of the body")
    while waiting:
        ready = [name for name in waiting if known.issuperset(couplings[name].drivers)]
        if not ready:
            raise ModelFileError(f"joints follow each other in a circle: {', '.join(map(repr, waiting))}")
        ordered += ready
        known.update(ready)
        waiting = [name for name in waiting if name not in known]
    return ordered


def _straight(function: JointFunction) -> bool:
    return not len(function.knots) and not function.coefficients[2:].any()


def _line(function: JointFunction) -> tuple[float, float]:
    """Value at zero and slope of a polynomial of the first degree."""
    start = float(function.coefficients[0, 0])
    slope = float(function.coefficients[1, 0]) if len(function.coefficients) > 1 else 0.0
    centre = float(function.centres[0])
    return (start - slope * centre if centre else start), slope


def check_smooth(follows: CoordinateMap, what: str, *, kinks_only: bool = False) -> None:
    """Raise ShapeError where a function that a joint follows others by has knots, or only where its slope jumps.

    what : that needs more, with its verb: "extremals need"
    """
    for joint in follows.curved:
        for source, function in joint.terms:
            if len(function.kinks) or (len(function.knots) and not kinks_only):
                names = f"{follows.names[joint.row]!r} follows {follows.names[source]!r}"
                rough = "piecewise linear function" if len(function.kinks) else "spline"
                better = "a spline or a polynomial" if kinks_only else "a polynomial"
                raise ShapeError(
                    f"{what} joints that follow others smoothly: {names} by a {rough} of {len(function.knots)} knots; "
                    f"state {better} in its place (Body.with_couplings)"
                )


def check_no_balls(follows: CoordinateMap, what: str) -> None:
    """Raise ShapeError for a ball joint, whose rates are not derivatives of coordinates.

    what : that needs such coordinates, with its verb: "extremals need"
    """
    if follows.balls:
        raise ShapeError(
            f"{what} a coordinate for each rate of the joints; ball joint {follows.balls[0].name} has four numbers for "
            "three rates: write it as three hinges in one point"
        )
