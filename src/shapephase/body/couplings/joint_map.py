"""From the independent joints of a body to the configuration and velocity vectors of its Pinocchio model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...arrays import Array
from .._model_tree import moving_joints
from .coordinate_map import coordinate_map
from .coupling import Coupling

# Velocities of the free-flyer, which come first in Pinocchio's order: three of translation, three of rotation.
_BASE = 6
# [rad/s, m/s, N m or N]; what is stated above stands for no limit.
_NO_LIMIT = 1e30


class JointMap:
    """Where each joint stands in Pinocchio's vectors, joints that follow others and joints kept as (cos, sin) included.

    Attributes
    ----------
    follows : the coordinates of all joints from those of the independent ones
    names : tuple of the independent joints
    continuous : (n,) True for a joint that turns without end, and that no other follows by a curve
    limits : (n, 2) lower and upper [rad or m], infinite for continuous joints
    rate_limits : (n,) the largest rates [rad/s or m/s], infinite where none is stated
    effort_limits : (n,) what their motors can do [N m or N], infinite where none is stated
    units : "rad" or "m" for each joint
    """

    def __init__(self, model: Any, neutral: Array, couplings: Mapping[str, Coupling]) -> None:
        moving = moving_joints(model)
        self.follows = coordinate_map(tuple(moving), couplings)
        self.names = self.follows.independent
        kinds = [model.joints[i] for i in moving.values()]
        turning = np.array([kind.nq == 2 for kind in kinds], dtype=bool)
        self._configuration_index = np.array([kind.idx_q for kind in kinds], dtype=int)
        self._velocity_index = np.array([kind.idx_v for kind in kinds], dtype=int) - _BASE
        self._turning = turning
        self._any_turning = bool(turning.any())
        self._neutral = neutral
        self._nv = model.nv
        independent = [list(moving).index(n) for n in self.names]
        endless = turning[independent]
        limits = np.stack([model.lowerPositionLimit, model.upperPositionLimit], axis=-1)
        self.limits = limits[self._configuration_index[independent]].reshape(-1, 2)
        self.limits[endless] = [-np.inf, np.inf]
        self.limits.setflags(write=False)
        # What follows by a curve is elsewhere after a whole turn.
        self.continuous = endless & ~np.isin(np.array(self.names, dtype=str), self.follows.drivers)
        self.rate_limits = self._slowest(np.array(model.velocityLimit)[[kind.idx_v for kind in kinds]])
        efforts = np.array(model.effortLimit)[[kinds[one].idx_v for one in independent]]
        self.effort_limits = np.where((efforts > 0.0) & (efforts < _NO_LIMIT), efforts, np.inf)
        self.effort_limits.setflags(write=False)
        sliding = [kind.shortname().startswith("JointModelP") for kind in kinds]
        self.units = tuple("m" if sliding[i] else "rad" for i in independent)

    def _slowest(self, stated: Array) -> Array:
        """Of each independent joint, so that its followers keep theirs, too; a limit of zero says nothing: (n,)."""
        stated = np.where((stated > 0.0) & (stated < _NO_LIMIT), stated, np.inf)
        factors = np.abs(self.follows.matrix)
        each = np.full(factors.shape, np.inf)
        np.divide(stated[:, None], factors, out=each, where=factors > 0.0)
        least = each.min(axis=0, initial=np.inf)
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
        return q

    def velocities(self, shapes: Array, rates: Array) -> Array:
        """Pinocchio's velocities with the base at rest: (N, n), (N, n) -> (N, nv)."""
        v = np.zeros((len(rates), self._nv))
        v[:, _BASE + self._velocity_index] = self.follows.with_rates(shapes, rates)[1]
        return v

    def accelerations(self, shapes: Array, rates: Array, accelerations: Array) -> Array:
        """Pinocchio's accelerations with the base at rest: (N, n), (N, n), (N, n) -> (N, nv)."""
        found = self.velocities(shapes, accelerations)
        if not self.follows.is_linear:
            bent = (self.follows.slope_rates(shapes, rates) @ rates[..., None])[..., 0]
            found[:, _BASE + self._velocity_index] += bent
        return found

    def columns(self, joints: Array, shapes: Array) -> Array:
        """Columns of Pinocchio's joints, base left out, folded into the independent: (N, ..., m) -> (N, ..., n)."""
        return self.follows.folded(joints[..., self._velocity_index], shapes)

    def bent_columns(self, joints: Array, shapes: Array, rates: Array) -> Array:
        """The same, folded by how the fold changes along rates, as a second derivative needs it."""
        return joints[..., self._velocity_index] @ self.follows.slope_rates(shapes, rates)
