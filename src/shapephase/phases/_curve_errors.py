"""Error estimates of phases, from the errors of an attitude and of its samples.

Both are known at every time, from finer steps and from a perturbed series (`integrator.lift.error_turns`), and so are
the displacements of a curve by them. Only rounding, and errors that no series shows, are bounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ..integrator.lift import Lift
from ..integrator.stepped import SteppedRotation
from ..reconstruction.reconstruction import Motion
from .error_estimates import ArcErrors, RunningErrors, SplitErrors
from .momentum_curve import MomentumCurve

_FACTORS = np.array([2.0, 1.0])  # of the difference to finer steps (their error to 0.5 %), of the perturbed series
_OF_LARGEST = 0.03  # of the largest error so far, added: the last value may be small by chance
_LEAST = np.array([0.05, 0.01])  # error of integrals of turns (steps, samples) per radian of curve, up to one radian
_AT_ANY_TIME = 0.1  # of errors at unknown times, for each radian of the curve: most cancels as the curve goes round
_NOT_LINEAR = 0.68  # of the growth in a step: max of x - x^9, since errors grow as the ninth power of the part taken
_ROUNDING = 32.0  # units of rounding in a sum of angles
_ROUNDING_OF_RADIANS = 8.0  # units of rounding for each radian of the sum
_EPS = float(np.finfo(float).eps)
_BEYOND_LINEAR = 1.05  # tangent over sine up to half the distance from the opposite point
_CLOSING_SIGNS = np.array([0.0, 1.0, -1.0, -1.0])  # of the closing area in dynamic phase, area, and both phases
_TINY = 1e-300  # keeps quotients defined without errors, and at the point opposite the start


class CurveArcs(NamedTuple):
    """Parts of a curve between edges: (N,) places of their starts and ends."""

    first: Integers
    last: Integers

    @classmethod
    def of(cls, edges: Array, starts: Array, ends: Array) -> CurveArcs:
        """Between times that are edges."""
        return cls(*np.broadcast_arrays(np.searchsorted(edges, starts), np.searchsorted(edges, ends)))

    def added(self, sums: Array) -> Array:
        """Growth along each arc of sums since the start: (..., K + 1) -> (..., N)."""
        return sums[..., self.last] - sums[..., self.first]

    def largest(self, sums: Array) -> Array:
        """The largest |growth| on the way: (..., K + 1) -> (..., N)."""
        if not self.first.any():
            return np.maximum.accumulate(np.abs(sums), axis=-1)[..., self.last]
        # Every second extreme is one of an arc; the others lie between two arcs.
        both = np.stack([self.first, self.last], axis=-1).ravel()
        high, low = (extreme.reduceat(sums, both, axis=-1)[..., ::2] for extreme in (np.maximum, np.minimum))
        start = sums[..., self.first]
        return np.maximum(np.maximum(high - start, start - low), np.abs(self.added(sums)))


class PhaseErrors(NamedTuple):
    """Errors of phases along arcs of a curve, closed by great circles: (B, N) each [rad]."""

    dynamic: Array
    area: Array
    phase: Array
    tilt: Array
    gap: Array  # of the ends of the great circles


@dataclass(frozen=True, eq=False)
class CurveErrors:
    """The errors of a momentum's curve, from those of attitude and lift at every time.

    Arrays whose first axis is 2 hold what finer steps do, then what the perturbed series does.

    motion, curve : whose errors they are
    """

    motion: Motion
    curve: MomentumCurve

    @property
    def attitude(self) -> Array:
        """Error of the attitude of the deformation's own frame at the end: (B,) [rad]."""
        error = _at_end(self._of_attitude) + self._unseen
        return np.minimum(error, self.motion.solution.error_estimate)

    @property
    def lift(self) -> Array:
        """Error of the horizontal lift at the end: (1,) or (B,) [rad]."""
        return self._of_end(self.motion.lift_with_errors)

    @property
    def wheels(self) -> Array:
        """Error of the rotation by the momentum that wheels store, at the end: (1,) or (B,) [rad]."""
        if not self.motion.deformation.has_wheels:
            return np.zeros(1)
        return self.lift + self._of_end(self.motion.lift_without_momentum)

    @property
    def by_momentum(self) -> Array:
        """Error of the rotation that the total momentum adds to that of shape and wheels, at the end: (B,) [rad]."""
        if not self.motion.deformation.has_wheels:
            return self.between
        return self.attitude + self._of_end(self.motion.lift_without_momentum)

    def _of_end(self, lift: Lift) -> Array:
        return np.minimum(_at_end(lift.turns) + _unseen_of(lift), lift.rotation.error_estimate)

    @property
    def between(self) -> Array:
        """Error of the rotation from the lift to the attitude, at the end: (B,) [rad]."""
        error = _at_end(self._of_attitude - self._of_lift) + self._unseen + _unseen_of(self.motion.lift_with_errors)
        return np.minimum(error, self.motion.solution.error_estimate + self.motion.horizontal_lift.error_estimate)

    def of(self, arcs: CurveArcs, residual: Array, targets: Array) -> PhaseErrors:
        """Errors of arcs of the curve, closed by great circles from their ends to targets (B, N, 3), gauge axes.

        Targets are the starts of the arcs, or fixed where all begin with the curve. The residuals (B, N) are those
        between two ways to their phases.
        """
        curve = self.curve
        displaced, sizes = curve.displaced(self._of_gauge), _norms(self._of_gauge)
        # Steps displace the curve along which the dynamic phase is summed up, whatever the lift does; samples turn the
        # body about its momentum by the phase.
        body = displaced if curve.lift is None else curve.displaced(self._at_edges(self._of_attitude[:1]))
        dynamic = np.stack([body.area[0] + body.phase[0], displaced.area[1] + displaced.along[1]])
        ends = curve.corners[:, arcs.last]
        # The area beside a great circle grows by so much for each radian by which an end is displaced across it.
        factor = _BEYOND_LINEAR * _norms(targets - ends) / (_norms(targets + ends) + _TINY)
        beside, closing = self._beside(arcs, targets, ends), np.multiply.outer(_CLOSING_SIGNS**2, factor)
        # Dynamic phase, area, phase by its integral, and as it could be read off the attitude.
        responses = np.stack([dynamic, displaced.area, dynamic - displaced.area, displaced.along])
        lengths, swings, summed = arcs.added(self._lengths)
        paths = np.stack([lengths + swings, lengths, swings, np.ones_like(lengths)])
        largest = sizes.max(axis=2, keepdims=True)
        on_the_way = arcs.largest(responses) + closing[:, None] * largest
        grown = arcs.added(responses) + np.multiply.outer(_CLOSING_SIGNS, beside)
        errors = np.einsum("s,qsbn->qbn", _FACTORS, np.abs(grown) + _OF_LARGEST * on_the_way)
        errors += self._unseen_of_gauge[:, None] * (1.0 + _AT_ANY_TIME * paths + closing)
        errors += np.tensordot(_LEAST, largest, axes=1) * np.minimum(paths, 1.0)
        errors += _EPS * (_ROUNDING * (1.0 + closing) + _ROUNDING_OF_RADIANS * (summed + lengths))
        errors += curve.error[:, None] + residual
        so_far = sizes + _OF_LARGEST * np.maximum.accumulate(sizes, axis=-1)
        turned = np.tensordot(_FACTORS, so_far, axes=1) + self._unseen_of_gauge[:, None]
        gap = turned[:, arcs.first] + turned[:, arcs.last] + _EPS * _ROUNDING
        # Near the point opposite the target any displacement turns the great circle round.
        near, whole = gap > np.arctan2(1.0, factor), 2.0 * np.pi
        tilt = np.minimum(_BEYOND_LINEAR * gap * np.sqrt(1.0 + factor * factor), np.pi)
        return PhaseErrors(
            dynamic=errors[0],
            area=np.where(near, whole, np.minimum(errors[1], whole)),
            phase=np.where(near, whole, np.minimum(np.minimum(errors[2], errors[3]), whole)),
            tilt=np.where(near, np.pi, tilt),
            gap=np.minimum(gap, np.pi),
        )

    def _beside(self, arcs: CurveArcs, targets: Array, ends: Array) -> Array:
        """Changes of the area beside the great circles by the turns: (2, B, N) [sr]."""
        # One and the cosine between them, without the cancellation near the opposite point.
        total = targets + ends
        versed = 0.5 * np.einsum("bni,bni->bn", total, total)[..., None]
        across = np.einsum("sbni,bni->sbn", self._in_gauge(arcs.last), total - versed * ends)
        if arcs.first.any():
            across += np.einsum("sbni,bni->sbn", self._in_gauge(arcs.first), versed * targets - total)
        return -across / (versed[..., 0] + _TINY)

    def _in_gauge(self, place: Integers) -> Array:
        """The turns at edges, gauge axes: (N,) -> (2, B, N, 3)."""
        turns, frames = self._of_gauge[:, :, place], self.curve.frame_at(place)
        return turns if frames is None else so3.apply(frames, turns)

    @cached_property
    def _stepped(self) -> SteppedRotation:
        """Steps of a motion whose batch has one part."""
        stepped = self.motion.stepped
        assert isinstance(stepped, SteppedRotation)
        return stepped

    @cached_property
    def _of_attitude(self) -> Array:
        """Turns of the deformation's own frame at the ends of steps: (2, B, N, 3)."""
        return self._weighted(self.motion.error_turns)

    @cached_property
    def _of_lift(self) -> Array:
        """Turns of the lift at the ends of the motion's steps: (2, B, N, 3)."""
        return self._weighted(self.motion.lift_with_errors.turns)

    def _weighted(self, turns: Array) -> Array:
        """Where the samples are known to be better than the perturbed series, so much of what that does."""
        if self._stepped is not self.motion.solution:
            return turns
        most = _norms(self.motion.error_turns[1]).max(axis=1)
        share = np.minimum(self._stepped.sampling_error / (most + _TINY), 1.0)
        return turns * np.stack([np.ones_like(share), share])[:, :, None, None]

    @cached_property
    def _unseen(self) -> Array:
        """Attitude error that neither finer steps nor the perturbed series show: (B,) [rad]."""
        stepped = self._stepped
        hidden = stepped.amplification * stepped.perturbed.hidden
        if stepped is self.motion.solution:
            hidden = np.minimum(hidden, stepped.sampling_error)
        return hidden + stepped.rounding_error

    @cached_property
    def _unseen_of_gauge(self) -> Array:
        unseen = self._unseen if self.curve.lift is None else self._unseen + _unseen_of(self.motion.lift_with_errors)
        if self.curve.frames is None and len(self.curve.edges) == self._stepped.quaternions.shape[1]:
            return unseen
        # What is between the ends of steps counts, too.
        grown = _norms(np.diff(self._of_attitude, axis=2)).max(axis=2, initial=0.0)
        return unseen + _NOT_LINEAR * np.tensordot(_FACTORS, grown, axes=1)

    @cached_property
    def _of_gauge(self) -> Array:
        """Turns of the gauge's frame at the edges: (2, B, K + 1, 3)."""
        turns = self._of_attitude if self.curve.lift is None else self._of_attitude - self._of_lift
        return self._at_edges(turns)

    def _at_edges(self, turns: Array) -> Array:
        """Vectors at the ends of steps, between them linearly: (..., N, 3) -> (..., K + 1, 3)."""
        edges, times = self.curve.edges, self._stepped.times
        if len(times) == len(edges):
            return turns
        right = np.clip(np.searchsorted(times, edges), 1, len(times) - 1)
        share = ((edges - times[right - 1]) / (times[right] - times[right - 1]))[:, None]
        return (1.0 - share) * turns[..., right - 1, :] + share * turns[..., right, :]

    @cached_property
    def _lengths(self) -> Array:
        """Since the start: of the curve, of its part due to I^-1 Pi, of the dynamic phase: (3, B, K + 1) [rad]."""
        curve, sums = self.curve, np.zeros((3, *self.curve.corners.shape[:2]))
        rates = _norms(np.stack([curve.slopes, curve.by_momentum]))
        np.cumsum(rates[..., :-1] * np.diff(curve.edges), axis=-1, out=sums[:2, :, 1:])
        np.cumsum(np.abs(curve.dynamic), axis=-1, out=sums[2, :, 1:])
        return sums


def _unseen_of(lift: Lift) -> Array:
    """Error of a lift that neither finer steps nor the perturbed series show: (1,) or (B,) [rad]."""
    return lift.perturbed.hidden + lift.rotation.rounding_error


def _norms(vectors: Array) -> Array:
    """Lengths: (..., 3) -> (...)."""
    return np.sqrt(np.einsum("...i,...i", vectors, vectors))


def _at_end(turns: Array) -> Array:
    """Error at the end from turns at all times: (2, B, N, 3) -> (B,) [rad]."""
    sizes = _norms(turns)
    return np.tensordot(_FACTORS, sizes[..., -1] + _OF_LARGEST * sizes.max(axis=-1), axes=1)


def split_errors(motion: Motion, curve: MomentumCurve, residual: Array) -> SplitErrors:
    """Errors of a split with its `residual` (B,)."""
    errors, batch, edges = CurveErrors(motion, curve), motion.batch, curve.edges
    arc = CurveArcs.of(edges, edges[:1], edges[-1:])
    whole = errors.of(arc, residual[:, None], curve.corners[:, :1])
    # What the momentum sweeps itself is joined to the reference; the closing is the rest.
    swept = errors.of(arc, residual[:, None], curve.references[:, None])

    def of(error: Array) -> Array:
        return (error.reshape(-1) * curve.has_phase).reshape(batch)[()]

    has_wheels = motion.deformation.has_wheels
    return SplitErrors(
        total_rotation=errors.attitude.reshape(batch)[()],
        holonomy=np.broadcast_to(errors.lift, residual.shape).reshape(batch)[()],
        dynamical_rotation=np.where(curve.has_phase | has_wheels, errors.between, 0.0).reshape(batch)[()],
        wheel_rotation=np.broadcast_to(errors.wheels, residual.shape).reshape(batch)[()],
        momentum_rotation=of(errors.by_momentum),
        montgomery_phase=of(whole.phase),
        montgomery_angle=of(whole.phase),
        dynamic_phase=of(whole.dynamic),
        geometric_phase=of(whole.area),
        solid_angle=of(whole.area),
        closing_tilt=of(whole.tilt),
        momentum_gap=of(whole.gap),
        closing_phase=of(np.minimum(whole.area + swept.area, 2.0 * np.pi)),
    )


def running_errors(
    motion: Motion,
    curve: MomentumCurve,
    times: Array,
    residual: Array,
    references: Array,
    shape: tuple[int, ...],
) -> RunningErrors:
    """Errors of phases up to times (N,), edges of the curve, joined to references (B, 3) by great circles.

    `residual` (B, N) is that of the phases at each time; results have the `shape`.
    """
    arcs = CurveArcs.of(curve.edges, np.zeros(1), times)
    targets = np.broadcast_to(references[:, None], (*residual.shape, 3))
    parts = CurveErrors(motion, curve).of(arcs, residual, targets)

    def of(error: Array) -> Array:
        return (error * curve.has_phase[:, None]).reshape(shape)[()]

    return RunningErrors(
        dynamic_phase=of(parts.dynamic),
        geometric_phase=of(parts.area),
        montgomery_phase=of(parts.phase),
        solid_angle=of(parts.area),
    )


def arc_errors(motion: Motion, curve: MomentumCurve, cuts: Array, residuals: tuple[Array, Array]) -> ArcErrors:
    """Errors of the arcs between edges of the curve (K + 1,), and of all as one; `residuals`: (B, K) and (B, 1)."""
    errors, batch = CurveErrors(motion, curve), motion.batch
    parts, whole = (
        errors.of(CurveArcs.of(curve.edges, starts, ends), residual, curve.directions(starts))
        for starts, ends, residual in zip((cuts[:-1], cuts[:1]), (cuts[1:], cuts[-1:]), residuals, strict=True)
    )

    def of(error: Array) -> Array:
        return (error * curve.has_phase[:, None]).reshape(*batch, -1)

    def of_all(error: Array) -> Array:
        return of(error)[..., 0][()]

    # The polygon has the arcs' ends for corners; what its area is off by is what its closing great circles are.
    corners = (parts.tilt.sum(axis=1, keepdims=True) + whole.tilt).clip(max=2.0 * np.pi)
    return ArcErrors(
        dynamic_phase=of(parts.dynamic),
        geometric_phase=of(parts.area),
        montgomery_phase=of(parts.phase),
        solid_angle=of(parts.area),
        closing_tilt=of(parts.tilt),
        momentum_gap=of(parts.gap),
        polygon_angle=of_all(corners),
        total_phase=of_all(whole.phase),
        total_closing_tilt=of_all(whole.tilt),
    )
