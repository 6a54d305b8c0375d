"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator of the library.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. Errors are measured: by half as many steps, and by half as
many on series with errors like those they probably have. The linearised equation, integrated along with it, shows how
rounding grows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import so3, sphere
from ..arguments import LOOSEST_TOLERANCE
from ..arrays import Array, Integers, lock_arrays, read_only
from ..errors import AccuracyNotReached
from ._dense_output import DenseOutput
from ._error_propagator import amplification, exact_propagators, momentum_slope, rounding_error
from ._step_control import StepRequirements, even_steps
from ._step_loop import FEW, StepRecord, integrate_steps, integrate_steps_at_rest, stage_channels
from .interpolant import Interpolant
from .sampling import Sampler

# Steps of one motion: some ten seconds, and a gigabyte of results.
_MOST_STEPS = 4_000_000
# Rounds of refinement; most motions need one.
_MOST_ROUNDS = 12
# Steps of one motion from which on propagators are not integrated along: the derivative of coarser steps costs less.
_MANY_STEPS = 4000
# Of the tolerance, for what the samplers say of themselves at first; it is ten to a hundred times the truth.
_SAMPLING_SHARE = 0.3
# Of the tolerance: what the samplers say, amplified, is not worth a march of its own below.
_NEGLIGIBLE = 0.005
# What errors are expected to grow by for each radian turned, and at most, before it is known.
_EXPECTED_GROWTH = 0.5
_MOST_EXPECTED_GROWTH = 30.0
# Of the room that rounding leaves: what stepping and sampling may take up, and what a further round aims at.
_MOST_STEPPING = 0.5
_MOST_SAMPLING = 0.4
_AIM = 0.2
# The order of the steps.
_ORDER = 8.0
# Amplification that the first plan allows for; what grows more is seen when it is there.
_MOST_FORESEEN = 1e4
# Of the tolerance, for the plan of many momenta at once: some need more steps than most, and a second round would
# repeat them all.
_MARGIN_OF_MANY = 0.1
# [rad] distance of coarser steps up to which the propagators of the steps are trusted.
_INFORMATIVE_ERROR = 0.1
# Of the tolerance: rounding below is not looked at closely.
_LITTLE_ROUNDING = 0.01
# Of the tolerance: with more rounding than this no refinement reaches it.
_MOST_ROUNDING = 0.9
# Of the error at the ends of the steps: what the polynomials between them may add.
_DENSE_SHARE = 5e-3
_BATCHED_FIELDS = (
    "quaternions", "directions", "turns", "dynamics", "sampling_error", "stepping_error",
    "rounding_error", "amplification",
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
    rounding_error : (B,) error due to rounding alone [rad]
    amplification : (B,) largest growth of an attitude error from one time to a later one
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

    __post_init__ = lock_arrays

    @cached_property
    def panel(self) -> Integers:
        """The interpolant's panel of each step: (K,)."""
        each = np.tile(self.steps, self.interpolant.loops)
        return read_only(np.repeat(np.arange(len(each)), each))

    @property
    def times(self) -> Array:
        """The ends of the steps: (K + 1,) [s]."""
        return read_only(self._times)

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

        The derivative of steps half as long as those that were taken.
        """
        # The error of a derivative is larger than that of the steps: twice as many make it smaller.
        channels = stage_channels(self.interpolant, 2 * self.steps)
        return momentum_slope(channels, self.momentum, self.interpolant.loops)

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


class _Attempt(NamedTuple):
    """One round of steps with its error estimates."""

    rotation: SteppedRotation
    stepping: Array  # (B,) distance of half as many steps [rad]

    @property
    def is_informative(self) -> bool:
        """Whether it shows how errors grow; steps that are still far too long do not."""
        return bool(self.stepping.max() < _INFORMATIVE_ERROR and np.isfinite(self.rotation.amplification).all())


class _Integration:
    """The attitude equation solved in rounds: sample, plan the steps, take them, estimate the error, refine."""

    def __init__(self, sampler: Sampler, momentum: Array, tolerance: float, subdivide: Integers | None) -> None:
        self._sampler, self._momentum, self._tolerance = sampler, momentum, tolerance
        self._subdivide = 1 if subdivide is None else subdivide
        self._magnitudes = np.sqrt((momentum * momentum).sum(axis=-1))
        self._largest = float(self._magnitudes.max(initial=0.0))
        # What earlier rounds found out: how much finer samples and steps must be, and how errors grow.
        self._sampling_target = _SAMPLING_SHARE * tolerance
        self._finer = 1.0
        self._amplification: float | None = None
        # How they do, where only the derivative of the steps shows it: (B, CHECKPOINTS, 3, 3).
        self._propagators: Array | None = None

    def solution(self) -> SteppedRotation:
        """The first attempt whose error estimate is within the tolerance for every momentum."""
        number, best = 0, np.inf
        while True:
            self._sampler.refine(self._largest, self._sampling_target)
            attempt = self._attempt(self._sampler.interpolant())
            estimate = float(attempt.rotation.error_estimate.max(initial=0.0))
            if estimate <= self._tolerance:
                return _for_whole_batch(attempt.rotation, self._momentum)
            number += 1
            # Finer steps and samples that bring nothing twice: what is left is rounding.
            stuck = number > 2 and estimate > 0.9 * best and attempt.is_informative
            if number == _MOST_ROUNDS or stuck or self._is_hopeless(attempt):
                raise _not_reached(self._tolerance, attempt.rotation)
            best = min(best, estimate)
            self._refine(attempt)

    def _attempt(self, interpolant: Interpolant) -> _Attempt:
        """Steps as planned, and the error estimates of the result."""
        expected = self._sampler.error(self._largest)
        requirements = StepRequirements.from_interpolant(interpolant, self._largest, self._tolerance)
        growth = self._amplification
        if growth is None:
            turn = requirements.whole_turn if self._largest else 0.0
            growth = min(1.0 + _EXPECTED_GROWTH * turn, _MOST_EXPECTED_GROWTH)
        perturbed = None
        if expected * growth > _NEGLIGIBLE * self._tolerance:
            perturbed = self._sampler.perturbed(self._largest)
        steps = self._plan(interpolant, requirements)
        record = self._take_steps(interpolant, None if perturbed is None else perturbed.coefficients, steps)
        stepping = np.where(np.isfinite(record.stepping), record.stepping, np.pi)
        propagators = record.propagators if self._propagators is None else self._propagators
        amplifications = amplification(propagators)
        sampling = amplifications * expected
        if perturbed is not None:
            measured = record.truncation + amplifications * perturbed.hidden
            sampling = np.fmin(sampling, measured)
        rotation = SteppedRotation(
            interpolant=interpolant,
            momentum=self._momentum,
            steps=steps,
            quaternions=record.quaternions,
            directions=record.directions,
            turns=record.turns,
            dynamics=record.dynamics,
            sampling_error=sampling,
            stepping_error=requirements.stepping_error(steps, stepping),
            rounding_error=rounding_error(
                propagators, record.quaternions, amplifications, _LITTLE_ROUNDING * self._tolerance
            ),
            amplification=amplifications,
        )
        return _Attempt(rotation, stepping)

    def _plan(self, interpolant: Interpolant, requirements: StepRequirements) -> Integers:
        """Steps on each panel: (P,). Finds the growth of errors first where the steps themselves will not show it."""
        few = len(self._momentum) <= FEW or self._largest == 0.0
        # The derivative for each of many momenta would take too long; with short steps it is not needed.
        short = requirements.far and not few
        goal = self._tolerance * (1.0 if few else _MARGIN_OF_MANY)
        planned = self._finer * requirements.plan(goal, short=short)
        count = interpolant.loops * float(planned.sum())
        if count > _MOST_STEPS:
            raise _too_many_steps(count, requirements.whole_turn, interpolant)
        many = count > _MANY_STEPS
        if self._largest > 0.0 and (many or (requirements.far and not short)):
            if self._propagators is None:
                self._propagators = _propagators_by_derivative(interpolant, self._momentum, self._magnitudes)
            # Errors will be amplified: each must be that much smaller.
            growth = amplification(self._propagators)
            worst = float(growth.max(where=np.isfinite(growth), initial=1.0))
            planned = self._finer * requirements.plan(goal / min(worst, _MOST_FORESEEN), short=short)
        steps = even_steps(planned, self._subdivide)
        if (count := interpolant.loops * float(steps.sum())) > _MOST_STEPS:
            raise _too_many_steps(count, requirements.whole_turn, interpolant)
        return steps

    def _take_steps(self, interpolant: Interpolant, perturbed: Array | None, steps: Integers) -> StepRecord:
        """All steps of all loops and momenta."""
        if not self._magnitudes.any():
            return integrate_steps_at_rest(interpolant, perturbed, steps)
        directions = _directions(self._momentum, self._magnitudes)
        with_propagators = self._propagators is None
        with np.errstate(over="ignore", invalid="ignore"):
            return integrate_steps(
                interpolant, perturbed, steps, directions, self._magnitudes, with_propagators=with_propagators
            )

    def _refine(self, attempt: _Attempt) -> None:
        """Finer steps and samples for the next round."""
        rotation = attempt.rotation
        room = max(self._tolerance - float(rotation.rounding_error.max()), 0.1 * self._tolerance)
        stepping, sampling = float(rotation.stepping_error.max()), float(rotation.sampling_error.max())
        if stepping > _MOST_STEPPING * room:
            self._finer *= float(np.clip((stepping / (_AIM * room)) ** (1.0 / _ORDER), 1.1, 4.0))
        if attempt.is_informative:
            self._amplification = float(rotation.amplification.max())
        if sampling > _MOST_SAMPLING * room and attempt.is_informative:
            expected = self._sampler.error(self._largest)
            self._sampling_target = min(self._sampling_target, expected * _AIM * room / sampling)

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


def _propagators_by_derivative(interpolant: Interpolant, momentum: Array, magnitudes: Array) -> Array:
    """How errors grow along long motions, by the derivative of coarse steps: (B, CHECKPOINTS, 3, 3).

    Propagators that are only nearly right would drift off over many turns; the steps' own derivative does not.
    """
    largest = float(magnitudes.max())
    requirements = StepRequirements.from_interpolant(interpolant, largest, LOOSEST_TOLERANCE)
    steps = even_steps(requirements.plan(LOOSEST_TOLERANCE), 1)
    channels, directions = stage_channels(interpolant, steps), _directions(momentum, magnitudes)
    with np.errstate(all="ignore"):
        return exact_propagators(channels, directions, magnitudes, interpolant.loops)


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
