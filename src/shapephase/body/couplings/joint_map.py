"""The map from the independent joints of a body to configurations and velocities of its Pinocchio model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...arrays import Array
from .._model_tree import moving_joints
from .ball_joints import COORDINATES, RATES
from .coordinate_map import coordinate_map
from .coupling import Coupling

BASE = 6  # velocities of the free-flyer, which come first in Pinocchio's order
_NO_LIMIT = 1e30  # [rad/s, m/s, N m or N] a larger stated limit means none


class JointMap:
    """Places of joints in Pinocchio's vectors, joints that follow others and joints kept as (cos, sin) included.

    Pinocchio's rates of a ball joint are the angular velocity in axes of the child, as ours; its coordinates a unit
    quaternion.

    follows : the coordinates of all joints from those of the independent ones
    names : tuple of the independent joints
    continuous : (n,) True for a joint that turns without end, and that no other follows by a curve
    limits : (n, 2) lower and upper [rad or m], infinite for continuous joints
    rate_limits : (n,) the largest rates [rad/s or m/s], infinite where none is stated
    effort_limits : (n,) what their motors can do [N m or N], infinite where none is stated
    neutral : (n,) the shape in which the file has the body: zero, and no turn of ball joints
    rate_names : of the rates of the independent joints
    rate_columns : (m,) the coordinate that each rate is of, of a ball joint its first
    rate_units : "rad" or "m" for each rate
    units : "rad" or "m" for each joint, "1" for the numbers of a ball joint
    """

    def __init__(self, model: Any, neutral: Array, couplings: Mapping[str, Coupling]) -> None:
        moving = {name: model.joints[number] for name, number in moving_joints(model).items()}
        balls = [name for name, kind in moving.items() if kind.nv == len(RATES)]
        self.follows = coordinate_map(tuple(moving), couplings, balls)
        self.names = self.follows.independent
        # By row; the coordinates of a ball joint have places of their own.
        kinds = [kind for kind in moving.values() for _ in range(kind.nv)]
        self._round = np.array([kind.nv == len(RATES) for kind in kinds], dtype=bool)
        turning = np.array([kind.nq == 2 for kind in kinds], dtype=bool)
        self._configuration_index = np.array([kind.idx_q for kind in kinds], dtype=int)
        self._velocity_index = np.array(
            [kind.idx_v + place for kind in moving.values() for place in range(kind.nv)], dtype=int
        ) - BASE  # fmt: skip
        self._turning = turning
        self._any_turning = bool(turning.any())
        self._ball_places = [moving[ball.name].idx_q for ball in self.follows.balls]
        self._neutral = neutral
        self._nv = model.nv
        # The row that each coordinate of the shape is of; of a ball joint its first.
        rows = {name: row for row, name in enumerate(self.follows.names)}
        rows |= {name: ball.row for ball in self.follows.balls for name in self.names[ball.columns]}
        independent = [rows[name] for name in self.names]
        own = [row for row, name in enumerate(self.follows.names) if name not in couplings]
        self._own_rows = np.array(own, dtype=int)
        self.rate_names = tuple(self.follows.names[row] for row in own)
        self.neutral = np.zeros(len(self.names))
        self.neutral[[ball.columns.stop - 1 for ball in self.follows.balls]] = 1.0
        self.neutral.setflags(write=False)
        endless, spherical = turning[independent], self._round[independent]
        limits = np.stack([model.lowerPositionLimit, model.upperPositionLimit], axis=-1)
        self.limits = limits[self._configuration_index[independent]].reshape(-1, 2)
        self.limits[endless | spherical] = [-np.inf, np.inf]
        self.limits.setflags(write=False)
        # What follows by a curve is elsewhere after a whole turn.
        self.continuous = endless & ~np.isin(np.array(self.names, dtype=str), self.follows.drivers)
        self.rate_limits = self._slowest(np.array(model.velocityLimit)[BASE + self._velocity_index])
        efforts = np.array(model.effortLimit)[BASE + self._velocity_index[independent]]
        known = (efforts > 0.0) & (efforts < _NO_LIMIT) & ~spherical
        self.effort_limits = np.where(known, efforts, np.inf)
        self.effort_limits.setflags(write=False)
        sliding = [kind.shortname().startswith("JointModelP") for kind in kinds]
        columns = {name: column for column, name in enumerate(self.names)}
        columns |= {row: ball.column for ball in self.follows.balls for row in self.follows.names[ball.rows]}
        self.rate_columns = tuple(columns[name] for name in self.rate_names)
        self.rate_units = tuple("m" if sliding[row] else "rad" for row in own)
        self.units = tuple("1" if self._round[i] else "m" if sliding[i] else "rad" for i in independent)

    def _slowest(self, stated: Array) -> Array:
        """Rate limits of the independent joints that their followers' limits allow; zero means none: (n,)."""
        stated = np.where((stated > 0.0) & (stated < _NO_LIMIT), stated, np.inf)
        factors = np.abs(self.follows.matrix)
        allowed = np.full(factors.shape, np.inf)
        np.divide(stated[:, None], factors, out=allowed, where=factors > 0.0)
        least = allowed.min(axis=0, initial=np.inf)
        place = {name: column for column, name in enumerate(self.names)}
        for joint in self.follows.curved:
            for source, function in joint.terms:
                column = place.get(self.follows.names[source])
                steepest = 0.0 if column is None else function.steepest(*self.limits[column].tolist())
                if column is not None and 0.0 < steepest < np.inf:
                    least[column] = min(least[column], stated[joint.row] / steepest)
        least.setflags(write=False)
        return least

    def configurations(self, shapes: Array) -> Array:
        """Pinocchio's configurations with the base at the origin: (N, n) -> (N, nq)."""
        full = self.follows.coordinates(shapes)
        q = np.empty((len(shapes), len(self._neutral)))
        q[:] = self._neutral
        if self._any_turning:
            turning = self._configuration_index[self._turning]
            fixed = self._configuration_index[~self._turning]
            q[:, fixed] = full[:, ~self._turning]
            q[:, turning] = np.cos(full[:, self._turning])
            q[:, turning + 1] = np.sin(full[:, self._turning])
        else:
            q[:, self._configuration_index] = full
        for ball, place in zip(self.follows.balls, self._ball_places, strict=True):
            q[:, place : place + len(COORDINATES)] = ball.quaternions(shapes)
        return q

    def velocities(self, shapes: Array, rates: Array) -> Array:
        """Pinocchio's velocities with the base at rest: (N, n), (N, n) -> (N, nv)."""
        v = np.zeros((len(rates), self._nv))
        v[:, BASE + self._velocity_index] = self.follows.with_rates(shapes, rates)[1]
        return v

    def accelerations(self, shapes: Array, rates: Array, accelerations: Array) -> Array:
        """Pinocchio's accelerations with the base at rest: (N, n), (N, n), (N, n) -> (N, nv)."""
        slopes = self.velocities(shapes, accelerations)
        if not self.follows.is_linear:
            bent = (self._slope_rates(shapes, rates) @ rates[..., None])[..., 0]
            slopes[:, BASE + self._velocity_index] += bent
        return slopes

    def independent_rates(self, shapes: Array, rates: Array) -> Array:
        """Rates of the independent joints, for ball joints the angular velocity: (N, n), (N, n) -> (N, m)."""
        return self.follows.with_rates(shapes, rates)[1][:, self._own_rows]

    def frames(self, shapes: Array) -> Array:
        """Derivatives of the shape at unit rates of the independent joints: (N, n) -> (N, n, m)."""
        frames = np.repeat(self.follows.matrix[self._own_rows].T[None], len(shapes), axis=0)
        place = {row: column for column, row in enumerate(self._own_rows.tolist())}
        for ball in self.follows.balls:
            first = place[ball.row]
            frames[:, ball.columns, first : first + len(RATES)] = ball.frame(shapes)
        return frames

    def columns(self, joints: Array, shapes: Array) -> Array:
        """Columns of Pinocchio's joints, base left out, folded into the independent: (N, ..., m) -> (N, ..., n)."""
        return self.follows.folded(joints[..., self._velocity_index], shapes)

    def bent_columns(self, joints: Array, shapes: Array, rates: Array) -> Array:
        """Columns of joints, folded by the rate of the fold along a motion: a second derivative needs it."""
        return joints[..., self._velocity_index] @ self._slope_rates(shapes, rates)

    def bent_rates(self, joints: Array, shapes: Array, rates: Array) -> Array:
        """Columns of joints, folded by the change of Pinocchio's rates with the shape at constant own rates. Other for
        ball joints only, whose rates are not derivatives of coordinates: by the bracket of the rates."""
        bent = self.follows.slope_rates(shapes, rates)
        for ball in self.follows.balls:
            bent[:, ball.rows, ball.columns] = ball.rates_by_shape(shapes, rates)
        return joints[..., self._velocity_index] @ bent

    def _slope_rates(self, shapes: Array, rates: Array) -> Array:
        """Rate, along a motion, of the derivatives of Pinocchio's rates by those of the shape: (N, k, n)."""
        bent = self.follows.slope_rates(shapes, rates)
        for ball in self.follows.balls:
            bent[:, ball.rows, ball.columns] = ball.slope_rates(shapes, rates)
        return bent
