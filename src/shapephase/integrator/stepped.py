"""S(t) by its steps: the attitudes at their ends, and all that follows from them."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from .. import so3, sphere
from ..arrays import Array, Integers, read_only
from ..display import frozen
from .closing import areas_back, far_references, jumps_between
from .interpolant import Interpolant
from .kernels.curve_kernel import within_steps
from .samples import Perturbed
from .stepping import magnitudes_and_directions, momentum_slope, part_channels

_AT_ONCE = 4096  # times, at which channels take some fifteen megabytes
_BATCHED_FIELDS = (
    "quaternions", "directions", "turns", "dynamics", "sampling_error", "stepping_error",
    "rounding_error", "amplification",
)  # fmt: skip


@frozen
class SteppedRotation:
    """S(t), the attitude relative to the start, at every time, for a batch of momenta.

    Attributes
    ----------
    interpolant : the sampled deformation
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    steps : (P,) steps on each of the interpolant's panels, the same in every loop
    quaternions : (B, K + 1, 4) xyzw at the step ends
    directions : (B, K + 1, 3) Pi/|Pi| at the step ends; (B, 0, 3) where no momentum of the batch differs from zero
    turns : (B, K) of each step about its starting direction, the shortest rotation between its ends taken off [rad]
    dynamics : (B, K) dynamic phase of each step [rad]
    sampling_error, stepping_error : (B,) estimates of the attitude error over the whole interval [rad]
    rounding_error : (B,) error due to rounding alone [rad]
    amplification : (B,) largest growth of an attitude error from one time to a later one
    perturbed : the interpolant's series with their probable errors

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 5.0])
    >>> print(motion.stepped.momentum, motion.stepped.error_estimate < 1e-9)
    [[0. 0. 5.]] [ True]
    """

    interpolant: Interpolant
    momentum: Array
    steps: Integers
    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    sampling_error: Array
    stepping_error: Array
    rounding_error: Array
    amplification: Array
    perturbed: Perturbed

    @cached_property
    def panel(self) -> Integers:
        """The interpolant's panel of each step: (K,)."""
        counts = self._steps_of_all_loops
        return read_only(np.repeat(np.arange(len(counts)), counts))

    @property
    def times(self) -> Array:
        """The ends of the steps: (K + 1,) [s]."""
        return self._times

    @cached_property
    def _times(self) -> Array:
        edges, steps = self.interpolant.edges, self._steps_of_all_loops
        done = np.cumsum(steps)
        of_panels = np.array([edges[:-1], edges[1:] - edges[:-1], done - steps, steps])
        starts, widths, before, counts = np.repeat(of_panels, steps, axis=1)
        return read_only(np.append(starts + widths * ((np.arange(done[-1]) - before) / counts), edges[-1]))

    @property
    def _steps_of_all_loops(self) -> Integers:
        loops = self.interpolant.loops
        return self.steps if loops == 1 else np.tile(self.steps, loops)

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error over the interval, rounding included: (B,) [rad]."""
        return self.sampling_error + self.stepping_error + self.rounding_error

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        return so3.matrix_from_quat(self._within(t)[1])

    @property
    def end(self) -> Array:
        """S at the end of the interval: (B, 3, 3)."""
        return so3.matrix_from_quat(self.quaternions[:, -1])

    def dynamic_phase(self, t: Array) -> Array:
        """The integral of omega . Pi/|Pi| from 0 to t: (N,) -> (B, N) [rad]; zero without momentum."""
        index, _, along = self._within(t)
        return _from_zero(self.dynamics)[:, index] + along

    def solid_angle(self, t: Array) -> Array:
        """Solid angle of the momentum's curve from 0 to t, closed by the great circle: (N,) -> (B, N) [sr].

        Seen from this description's frame, positive where the curve goes counter-clockwise seen from outside; zero
        without momentum. It grows continuously from zero as long as the curve keeps away from the point opposite its
        start, at which it jumps by 4 pi.
        """
        if not self.directions.shape[1]:
            return np.zeros((len(self.momentum), len(t)))
        corners, (index, quaternions, along) = self.directions, self._within(t)
        # Counted from a region far from the curve: counted from the start, errors near the point opposite it would
        # stay in the sum. Whole spheres by which the great circle back to the start makes the area jump are taken off.
        start, references = corners[:, :1], far_references(corners)[:, None]
        back = areas_back(references, corners, start)
        back[:, 0] = 0.0
        arcs = sphere.triangle_area(references, corners[:, :-1], corners[:, 1:])
        jumps = jumps_between(start, corners[:, :-1], corners[:, 1:], arcs + np.diff(back, axis=1))
        ends = _from_zero(arcs + self.dynamics - self.turns) + back - 4.0 * np.pi * _from_zero(jumps.astype(np.float64))
        attitude, near = so3.matrix_from_quat(quaternions), corners[:, index]
        there = so3.apply(so3.transpose(attitude), start)
        # The turn about the direction at the step's start, the shortest rotation taken off.
        steps = so3.transpose(so3.matrix_from_quat(self.quaternions[:, index])) @ attitude
        turn = np.where(t == self.times[index], 0.0, so3.angle_about(steps @ so3.between(near, there), near))
        grown = sphere.triangle_area(references, near, there)
        grown += areas_back(references, there, start) - back[:, index]
        grown -= 4.0 * np.pi * jumps_between(start, near, there, grown)
        return (ends[:, index] + grown + along - turn) * np.any(self.momentum != 0.0, axis=1, keepdims=True)

    @cached_property
    def momentum_slope(self) -> Array:
        """How the end turns, S exp(hat(slope dPi)), by a change dPi of the body momentum at the start: (B, 3, 3).

        The derivative of the steps themselves.
        """
        return momentum_slope(self.interpolant, self.steps, self.momentum)

    def _within(self, t: Array) -> tuple[Integers, Array, Array]:
        """The step of each time (N,), S there (B, N, 4), and what the dynamic phase grows by from the step's start.

        A part of a step is a step, by the same formula on the same series; a step's end belongs to the next one.
        """
        ends, batch = self.times, len(self.momentum)
        index = np.searchsorted(ends, t, side="right") - 1
        magnitudes, directions = magnitudes_and_directions(self.momentum)
        quaternions, along = np.empty((batch, len(t), 4)), np.empty((batch, len(t)))
        for first in range(0, len(t), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            starts = self.quaternions[:, index[part]]
            channels = part_channels(self.interpolant, ends[index[part]], t[part] - ends[index[part]])
            after, phase = np.empty_like(starts), np.empty(starts.shape[:2])
            within_steps(channels, magnitudes, directions, starts, after, phase)
            at_start = t[part] == ends[index[part]]
            # No step is taken there, and nothing rounded.
            quaternions[:, part] = np.where(at_start[:, None], starts, after)
            along[:, part] = np.where(at_start, 0.0, phase)
        return index, quaternions, along

    def with_rotations(self, rotations: Array, error: Array) -> SteppedRotation:
        """These steps with rotations at their ends (B, K + 1, 3, 3) by another method, and their error (B,)."""
        directions = self.directions
        if directions.shape[1]:
            directions = so3.apply(so3.transpose(rotations), directions[:, :1])
        return replace(
            self,
            quaternions=so3.quat_from_matrix(rotations),
            directions=directions,
            stepping_error=error,
            sampling_error=0.0 * error,
        )


def _from_zero(of_steps: Array) -> Array:
    """Sums over the steps up to each of their ends: (B, K) -> (B, K + 1)."""
    return np.concatenate([np.zeros((len(of_steps), 1)), np.cumsum(of_steps, axis=1)], axis=1)


def for_whole_batch(solution: SteppedRotation, momentum: Array) -> SteppedRotation:
    """The solution with one row for each momentum; without momentum all share the only one."""
    count = len(momentum)
    if len(solution.quaternions) == count:
        return solution
    shared = {name: getattr(solution, name) for name in _BATCHED_FIELDS}
    broadcast = {name: np.broadcast_to(v, (count, *v.shape[1:])) for name, v in shared.items()}
    return replace(solution, momentum=momentum, **broadcast)


def of_rows(solution: SteppedRotation, rows: Integers) -> SteppedRotation:
    """The solution for some of its momenta."""
    return replace(solution, **{name: getattr(solution, name)[rows] for name in ("momentum", *_BATCHED_FIELDS)})
