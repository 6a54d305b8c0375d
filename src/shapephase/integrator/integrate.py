"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator of the library.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. An embedded formula estimates each step's error, and the
linearised equation, integrated along with it, shows how errors grow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import NamedTuple

import numpy as np

from .. import so3, sphere
from ..arguments import LOOSEST_TOLERANCE
from ..arrays import Array, Integers
from ..chebyshev import chebyshev
from ..errors import AccuracyNotReached
from ._dense_output import DenseOutput
from ._error_propagator import amplification, exact_propagators, momentum_slope
from ._rotation_step import STAGES, tableau
from ._step_control import StepRequirements, carried_over, finer
from ._step_loop import FEW, StepRecord, integrate_steps, integrate_steps_at_rest
from .interpolant import Interpolant
from .sampling import Sampler

_EPS = np.finfo(float).eps
# Steps of one motion: some ten seconds, and a gigabyte of results.
_MOST_STEPS = 4_000_000
# Rounds of refinement; most motions need one, and after twelve the error is at its floor.
_MOST_ROUNDS = 12
# Steps of one motion from which on propagators are not integrated along: the derivative of coarser steps costs less.
_MANY_STEPS = 4000
# Of the tolerance, for sampling at first: errors grow by a factor not yet known, and samples are cheaper than a second
# round.
_SAMPLING_SHARE = 0.05
# The same without momentum, where errors do not grow.
_SAMPLING_SHARE_AT_REST = 0.3
# Of the tolerance, for the first plan of many momenta at once.
_MARGIN_OF_MANY = 0.1
# [rad] for a single step: it is far below rounding, and a stricter plan would only waste steps.
_LEAST_STEP_TOLERANCE = 1e-18
# Of the tolerance: Chebyshev degrees that the plan neglects.
_INSIGNIFICANT_SHARE = 1e-3
# [rad] sum of local errors up to which the propagators of the steps are trusted.
_INFORMATIVE_ERROR = 1e-2
# Of the tolerance: with more rounding than this no refinement reaches it.
_MOST_ROUNDING = 0.9
# Of the error at the ends of the steps: what the polynomials between them may add.
_DENSE_SHARE = 5e-3
_BATCHED_FIELDS = (
    "quaternions", "directions", "turns", "dynamics", "sampling_error", "stepping_error", "amplification",
    "propagator",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
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
    amplification : (B,) largest growth of an attitude error from one time to a later one
    propagator : (B, 3, 3) how a small turn of the start, S exp(hat(delta)) in base axes, reaches the end; to a few
        thousandths, enough to judge errors and to steer a search
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
    amplification: Array
    propagator: Array

    @cached_property
    def panel(self) -> Integers:
        """The interpolant's panel of each step: (K,)."""
        each = np.tile(self.steps, self.interpolant.loops)
        return np.repeat(np.arange(len(each)), each)

    @property
    def times(self) -> Array:
        """The ends of the steps: (K + 1,) [s]."""
        return self._times

    @cached_property
    def _times(self) -> Array:
        edges, panel = self.interpolant.edges, self.panel
        each = np.tile(self.steps, self.interpolant.loops)
        within = np.arange(len(panel)) - np.repeat(np.cumsum(each) - each, each)
        return np.append(edges[panel] + (edges[panel + 1] - edges[panel]) * (within / each[panel]), edges[-1])

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error over the interval, rounding included: (B,) [rad]."""
        return (1.0 + _DENSE_SHARE) * self._error_at_ends

    @property
    def _error_at_ends(self) -> Array:
        """The same at the ends of the steps: (B,) [rad]."""
        return self.sampling_error + self.stepping_error + self.rounding_error

    @cached_property
    def rounding_error(self) -> Array:
        """Error due to rounding alone: (B,) [rad]."""
        chords = self.quaternions[:, 1:] - self.quaternions[:, :-1]
        turned_by = 2.0 * np.sqrt(np.einsum("bki,bki->bk", chords, chords)).sum(axis=1)
        # The rate of turning itself is known only to a few units of rounding; the error grows as the body turns on.
        committed = 8.0 + 2.0 * np.sqrt(self.quaternions.shape[1]) + turned_by
        return _EPS * (self.amplification * committed + 4.0 * turned_by)

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        found, count = so3.matrix_from_quat(np.moveaxis(self._dense.quaternion(t), 0, -1)), len(self.momentum)
        return found if len(found) == count else np.repeat(found, count, axis=0)

    @property
    def end(self) -> Array:
        """S at the end of the interval: (B, 3, 3)."""
        return so3.matrix_from_quat(self.quaternions[:, -1])

    def dynamic_phase(self, t: Array) -> Array:
        """The integral of omega . Pi/|Pi| from 0 to t: (N,) -> (B, N) [rad]; zero without momentum."""
        before = np.cumsum(self.dynamics, axis=1) - self.dynamics
        return (before[:, self._dense.step_of(t)] + self._dense.dynamic_phase(t)) * self._moving

    def solid_angle(self, t: Array) -> Array:
        """Of the momentum's curve from 0 to t, closed by the great circle: (N,) -> (B, N) [sr]; without momentum zero.

        Seen from this description's frame, positive where the curve goes counter-clockwise seen from outside. It
        grows continuously from zero as long as the curve keeps away from the point opposite its start, at which
        it jumps by 4 pi.
        """
        if not self.directions.shape[1]:
            return np.zeros((len(self.momentum), len(t)))
        start, corners, index = self.directions[:, :1], self.directions, self._dense.step_of(t)
        fans = sphere.triangle_area(start, corners[:, :-1], corners[:, 1:]) + self.dynamics - self.turns
        before = np.cumsum(fans, axis=1) - fans
        attitude, near = self.rotation(t), corners[:, index]
        there = so3.apply(so3.transpose(attitude), start)
        # The turn about the direction at the step's start, the shortest rotation taken off.
        steps = so3.transpose(so3.matrix_from_quat(self.quaternions[:, index])) @ attitude
        turn = np.where(t == self.times[index], 0.0, so3.angle_about(steps @ so3.between(near, there), near))
        part = sphere.triangle_area(start, near, there) + self._dense.dynamic_phase(t) - turn
        return (before[:, index] + part) * self._moving

    @property
    def _moving(self) -> Array:
        """One where there is momentum, else zero: (B, 1)."""
        return np.any(self.momentum != 0.0, axis=1, keepdims=True).astype(np.float64)

    @cached_property
    def momentum_slope(self) -> Array:
        """How the end turns, S exp(hat(slope dPi)), by a change dPi of the body momentum at the start: (B, 3, 3).

        The derivative of steps like those that were taken.
        """
        return momentum_slope(_stage_channels(self.interpolant, self.steps), self.momentum, self.interpolant.loops)

    @cached_property
    def _dense(self) -> DenseOutput:
        """The same rotation between the ends of the steps; without momentum it is one for the whole batch."""
        rows = slice(None) if self.directions.shape[1] else slice(1)
        return DenseOutput(
            interpolant=self.interpolant,
            steps=self.steps,
            times=self.times,
            quaternions=self.quaternions[rows],
            directions=self.directions[rows],
            dynamics=self.dynamics[rows],
            magnitude=np.linalg.norm(self.momentum[rows], axis=-1),
            goal=_DENSE_SHARE * float(self._error_at_ends.min(initial=np.inf)),
        )

    def with_rotations(self, rotations: Array, error: Array) -> SteppedRotation:
        """The same steps with the rotations at their ends (B, K + 1, 3, 3) found by another method."""
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

    def inverse_and_drift(self, t: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o at times: (N,) -> (N, 3, 3), (N, 3)."""
        return self.interpolant.inverse_and_drift(t)


def stepped_rotation(
    sampler: Sampler, momentum: Array, tolerance: float, *, subdivide: Integers | None = None
) -> SteppedRotation:
    """Integrate the attitude equation to a tolerance, sampling the deformation as far as that needs.

    Parameters
    ----------
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    tolerance : of the attitude over the whole interval [rad]
    subdivide : (P,) steps on each panel of finished samples, whose ends are to be ends of steps

    Raises
    ------
    AccuracyNotReached
        If the estimate stays above the tolerance.
    """
    return _Integration(sampler, momentum, tolerance, subdivide).solution()


class _ErrorGrowth(NamedTuple):
    """How errors grow along the motions of a batch."""

    amplification: Array  # (B,) from one time to a later one
    propagator: Array  # (B, 3, 3) from the start to the end


class _Attempt(NamedTuple):
    """One round of steps with its error estimates."""

    rotation: SteppedRotation
    local_errors: Array  # (B, K) of each step [rad]

    @property
    def is_informative(self) -> bool:
        """Whether it shows how errors grow; steps that are still far too long do not."""
        small = self.local_errors.sum(axis=1).max() < _INFORMATIVE_ERROR
        return bool(small and np.isfinite(self.rotation.amplification).all())

    def panel_errors(self) -> Array:
        """The sums of the local errors on each panel, the worst of all loops and momenta: (P,) [rad]."""
        steps, loops = self.rotation.steps, self.rotation.interpolant.loops
        by_loop = self.local_errors.reshape(len(self.local_errors), loops, -1).sum(axis=1)
        return np.add.reduceat(by_loop, np.cumsum(steps) - steps, axis=1).max(axis=0)


class _Integration:
    """The attitude equation solved in rounds: sample, plan the steps, take them, estimate the error, refine."""

    def __init__(self, sampler: Sampler, momentum: Array, tolerance: float, subdivide: Integers | None) -> None:
        self._sampler, self._momentum, self._tolerance = sampler, momentum, tolerance
        self._subdivide = 1 if subdivide is None else subdivide
        self._magnitudes = np.sqrt((momentum * momentum).sum(axis=-1))
        self._largest = float(self._magnitudes.max(initial=0.0))
        share = _SAMPLING_SHARE if self._largest > 0.0 else _SAMPLING_SHARE_AT_REST
        self._sampling_target = share * tolerance
        # What earlier rounds found out: how errors grow where only the derivative shows it, and a finer plan.
        self._error_growth: _ErrorGrowth | None = None
        self._refined: tuple[Array, Integers] | None = None  # panel ends [s], steps on each panel

    def solution(self) -> SteppedRotation:
        """The first attempt whose error estimate is within the tolerance for every momentum."""
        number = 0
        while True:
            self._sampler.refine(self._largest, self._sampling_target)
            attempt = self._attempt(self._sampler.interpolant())
            if (attempt.rotation.error_estimate <= self._tolerance).all():
                return _for_whole_batch(attempt.rotation, self._momentum)
            steps = self._refine(attempt, number)
            number += 1
            if number == _MOST_ROUNDS or steps > _MOST_STEPS or self._is_hopeless(attempt):
                raise _not_reached(self._tolerance, attempt.rotation)

    def _attempt(self, interpolant: Interpolant) -> _Attempt:
        """Steps as planned, and the error estimates of the result."""
        requirements = StepRequirements.from_interpolant(interpolant, self._largest, self._tolerance)
        steps = self._plan(interpolant, requirements)
        record = self._take_steps(interpolant, steps)
        local = requirements.safety_factor(steps) * record.errors
        total = local.sum(axis=1)
        if not np.isfinite(total).all():
            # Steps so long that they overflowed: as wrong as an attitude can be.
            local = np.where(np.isfinite(local), local, np.pi)
            total = local.sum(axis=1)
        error_growth = self._error_growth or _ErrorGrowth(amplification(record.propagators), _end_propagator(record))
        rotation = SteppedRotation(
            interpolant=interpolant,
            momentum=self._momentum,
            steps=steps,
            quaternions=record.quaternions,
            directions=record.directions,
            turns=record.turns,
            dynamics=record.dynamics,
            sampling_error=error_growth.amplification * self._sampler.error(self._largest),
            # Degrees that the plan took for insignificant count too.
            stepping_error=error_growth.amplification * total + _INSIGNIFICANT_SHARE * self._tolerance,
            amplification=error_growth.amplification,
            propagator=error_growth.propagator,
        )
        return _Attempt(rotation, local)

    def _plan(self, interpolant: Interpolant, requirements: StepRequirements) -> Integers:
        """Steps on each panel: (P,). Finds the growth of errors first where the steps themselves will not show it."""
        # The derivative for each of many momenta would take too long; with steps this short it is not needed.
        short = requirements.far and len(self._momentum) > FEW
        least = requirements.least_steps(short=short)
        if self._refined is None:
            # Among many momenta some need more steps than most, and a second round would repeat them all.
            margin = 1.0 if len(self._momentum) <= FEW else _MARGIN_OF_MANY
            planned = requirements.first_plan(margin * self._tolerance)
        else:
            planned = carried_over(interpolant, *self._refined)
        count = interpolant.loops * float(np.maximum(planned, least).sum())
        if count > _MOST_STEPS:
            raise _too_many_steps(count, requirements.whole_turn, interpolant)
        many = count > _MANY_STEPS
        if self._largest > 0.0 and self._error_growth is None and (many or (requirements.far and not short)):
            self._error_growth = _error_growth_by_derivative(interpolant, self._momentum, self._magnitudes)
            # The errors of so many steps add up and are amplified: each must be that much smaller.
            worst = float(np.nan_to_num(self._error_growth.amplification).max())
            share = 0.01 * planned.sum() * interpolant.loops * max(1.0, worst)
            planned = requirements.first_plan(max(self._tolerance / share, _LEAST_STEP_TOLERANCE))
        return self._subdivide * np.ceil(np.maximum(planned, least) / self._subdivide).astype(int)

    def _take_steps(self, interpolant: Interpolant, steps: Integers) -> StepRecord:
        """All steps of all loops and momenta."""
        channels = _stage_channels(interpolant, steps)
        if not self._magnitudes.any():
            return integrate_steps_at_rest(channels, interpolant.loops)
        directions = _directions(self._momentum, self._magnitudes)
        with_propagators = self._error_growth is None
        return integrate_steps(
            channels, directions, self._magnitudes, interpolant.loops, with_propagators=with_propagators
        )

    def _refine(self, attempt: _Attempt, number: int) -> int:
        """Finer steps and samples for the next round, after round `number` from 0; the steps of all its loops."""
        rotation = attempt.rotation
        worst = float(rotation.amplification.max()) if attempt.is_informative else 1.0
        left = max(self._tolerance - float(rotation.rounding_error.max()), 0.1 * self._tolerance)
        # Less in every round: where one of the errors is at its floor, the others must make room for it.
        budget = 0.6 * 0.8**number * left / worst
        steps, errors = rotation.steps, attempt.panel_errors()
        if errors.sum() > budget:
            steps = finer(steps, errors, budget)
        self._refined = rotation.interpolant.edges[: len(steps) + 1], steps
        self._sampling_target = min(self._sampling_target, 0.5 * budget)
        return int(steps.sum()) * rotation.interpolant.loops

    def _is_hopeless(self, attempt: _Attempt) -> bool:
        """Whether rounding alone takes up the tolerance."""
        rounding = attempt.rotation.rounding_error
        return attempt.is_informative and bool(np.any(rounding > _MOST_ROUNDING * self._tolerance))


def _too_many_steps(count: float, turn: float, interpolant: Interpolant) -> AccuracyNotReached:
    """The error of a motion that would take more steps than are taken, raised before any memory is."""
    turns = turn / (2.0 * np.pi)
    return AccuracyNotReached(
        f"the body turns up to {turns:.3g} times in {interpolant.edges[-1]:.6g} s, which takes some {count:.3g} steps; "
        f"at most {_MOST_STEPS} are taken, enough for about {turns * _MOST_STEPS / count:.3g} turns: shorten the "
        "motion, or lower the momentum"
    )


def _not_reached(tolerance: float, last: SteppedRotation) -> AccuracyNotReached:
    parts = [float(np.max(part)) for part in (last.sampling_error, last.stepping_error, last.rounding_error)]
    return AccuracyNotReached(
        f"the tolerance {tolerance:.3g} rad was not reached: the estimate is {np.max(last.error_estimate):.3g} rad, of "
        f"which sampling {parts[0]:.3g}, stepping {parts[1]:.3g} and rounding {parts[2]:.3g}, with errors amplified "
        f"{np.max(last.amplification):.3g} times; loosen the tolerance or shorten the motion"
    )


def _error_growth_by_derivative(interpolant: Interpolant, momentum: Array, magnitudes: Array) -> _ErrorGrowth:
    """How errors grow along a long motion, by the derivative of coarse steps.

    Propagators that are only nearly right would drift off over many turns; the steps' own derivative does not.
    """
    largest = float(magnitudes.max())
    least = StepRequirements.from_interpolant(interpolant, largest, LOOSEST_TOLERANCE).least_steps()
    steps = np.ceil(np.maximum(least, 1.0)).astype(int)
    channels, directions = _stage_channels(interpolant, steps), _directions(momentum, magnitudes)
    error_growth = _ErrorGrowth(np.empty(len(magnitudes)), np.empty((len(magnitudes), 3, 3)))
    with np.errstate(all="ignore"):
        for row in range(len(magnitudes)):
            part = slice(row, row + 1)
            propagators = exact_propagators(channels, directions[part], magnitudes[part], interpolant.loops)
            error_growth.amplification[part] = amplification(propagators)
            error_growth.propagator[part] = propagators[:, -1]
    return error_growth


def _end_propagator(record: StepRecord) -> Array:
    """How a small turn of the start reaches the end: (B, 3, 3)."""
    if record.propagators.shape[1]:
        return record.propagators[:, -1]
    return so3.transpose(so3.matrix_from_quat(record.quaternions[:, -1]))


def _directions(momentum: Array, magnitudes: Array) -> Array:
    """Pi/|Pi|; for a motion without momentum in a batch with it any direction shows the rotation."""
    moving = magnitudes > 0.0
    if moving.all():
        return momentum / magnitudes[:, None]
    return np.where(moving[:, None], momentum, [0.0, 0.0, 1.0]) / np.where(moving, magnitudes, 1.0)[:, None]


def _for_whole_batch(solution: SteppedRotation, momentum: Array) -> SteppedRotation:
    """The solution with one row for each momentum; without momentum all share the only one."""
    count = len(momentum)
    if len(solution.quaternions) == count:
        return solution
    shared = {name: getattr(solution, name) for name in _BATCHED_FIELDS}
    return replace(solution, **{name: np.broadcast_to(v, (count, *v.shape[1:])) for name, v in shared.items()})


def _stage_channels(interpolant: Interpolant, steps: Integers) -> Array:
    """Channels at the 12 stages of each step of the first loop, times the step's length: (K, 108)."""
    widths = np.diff(interpolant.edges[: len(steps) + 1])
    coefficients = interpolant.coefficients * widths[:, None, None]
    degrees = coefficients.shape[1]
    channels = np.empty((int(steps.sum()) * STAGES, 9))
    panel = row = 0
    for count, run in groupby(steps.tolist()):
        panels = len(list(run))
        stop = row + panels * count * STAGES
        out = channels[row:stop].reshape(panels, count * STAGES, 9)
        np.matmul(_stage_matrix(degrees, count), coefficients[panel : panel + panels], out=out)
        panel, row = panel + panels, stop
    return channels.reshape(-1, 9 * STAGES)


@lru_cache(maxsize=512)
def _stage_matrix(degree_count: int, count: int) -> Array:
    """Chebyshev coefficients of a panel -> values at all stages of its steps, times the step's share of it.

    (12 count, degrees)
    """
    _, _, c = tableau()
    x = 2.0 * (np.arange(count)[:, None] + c) / count - 1.0
    return chebyshev(np.clip(x, -1.0, 1.0), degree_count).reshape(STAGES * count, degree_count) / count
