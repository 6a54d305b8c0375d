"""An attitude together with other states, by SciPy's DOP853 on the unit quaternion, with a measured estimate."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Protocol

import numpy as np

from .. import so3
from ..arrays import Array
from ..display import frozen
from ..errors import AccuracyNotReached
from ..sphere import gauss_nodes
from .channels import Evaluate
from .limited_steps import Run, StepLimits, limited_run

# Times (N,), attitudes (N, 3, 3), other states (N, k) -> angular velocities, body axes (N, 3), and rates (N, k).
Rates = Callable[[Array, Array, Array], tuple[Array, Array]]
_FIRST = 0.01  # tolerance of the first run over the requested one: its error is then about the requested tolerance
_SHARPER = 0.1  # ratio of tolerances from run to run: their difference is the error of the first
_LEAST_RELATIVE = 3e-14  # least relative tolerance of SciPy
_LEAST = 3e-15  # least absolute tolerance: it gains as much again for small numbers
_ROUNDING = 1e-13  # [rad] in some thousand steps
_LONGEST = 1.0 / 64.0  # of the duration: longer steps gain nothing
_SHORTER = 0.75  # ratio of longest steps from run to run, 10^(-1/8): runs with equal steps make equal errors
_GAIN = 0.4  # ratio of differences up to which, with the least tolerance, shorter steps are tried
_MOST_COMPARED = 4000  # times at which two runs are compared
_SAMPLE_GAP = 1.0 / 4000.0  # of the duration, between times that are checked: as in the scan of a path
_GAUSS_GAP = 0.1835  # of an interval: largest gap between eight Gauss points
_DEFECT_LIMIT = 20.0  # tolerances of a run between step and integral of the slope; up to 2, for work 14, where resolved
_PARTS = 8.0  # of a step that passed over something
_MOST_ROUNDS = 100  # in which something was passed over: so many narrow intervals can follow from each other


class StatesInTime(Protocol):
    """A unit quaternion and other numbers as functions of time."""

    @property
    def times(self) -> Array:
        """Ends of the steps [s]."""
        ...

    def __call__(self, t: Array, /) -> Array:
        """State at times: (N,) -> (N, 4 + k)."""
        ...


@frozen
class DrivenAttitude:
    """Attitudes and other states in time.

    run : the sharper of the two last runs
    scales : (k,) of the other states
    error_times : (M,) at which both were compared [s]
    attitude_errors : (M,) the largest angle between them so far [rad]
    state_errors : (M, k) the largest differences of the other states so far
    evaluations : of the rates, in all runs
    """

    run: StatesInTime
    scales: Array
    error_times: Array
    attitude_errors: Array
    state_errors: Array
    evaluations: int

    @property
    def times(self) -> Array:
        """Ends of the steps [s]."""
        return self.run.times

    @property
    def error_estimate(self) -> Array:
        """Estimate of the attitude's error over all times: (1,) [rad]."""
        return self.attitude_errors[-1:]

    def attitude(self, t: Array) -> Array:
        """Attitudes at times: (N,) -> (N, 3, 3)."""
        return so3.matrix_from_quat(self.run(t)[:, :4])

    def states(self, t: Array) -> Array:
        """Other states at times: (N,) -> (N, k)."""
        return self.run(t)[:, 4:] * self.scales


def driven_attitude(
    rates: Rates,
    breaks: Array,
    attitude: Array,
    states: Array,
    scales: Array,
    tolerance: float,
    limits: StepLimits | None = None,
) -> DrivenAttitude:
    """Integrate R' = R hat(omega) and y' = g, both given by `rates`, restarted at the breaks.

    Runs are repeated, each with a tenth of the tolerance of the one before and shorter steps, until two of them agree.
    Their difference is the estimate of the error, and grows as the motion magnifies errors. Two runs may both step over
    something short. So the slope is integrated once more along each run, by Gauss's rule at times 1/4,000 of the
    duration apart: where that is not the change over a step, steps are made shorter. Narrower things are found by
    limits only.

    breaks : (M,) between which all is smooth [s]
    attitude : (3, 3) at the start
    states : (k,) at the start
    scales : (k,) size that matters of each
    tolerance : of the attitude, and of the other states in their scales [rad]
    limits : of steps, by what is known of the rates; None: nothing

    Raises AccuracyNotReached if the sharpest two runs disagree by more than the tolerance, or the rates change too
    often in short times.
    """

    def slopes(times: Array, values: Array) -> Array:
        omega, others = rates(times, so3.matrix_from_quat(so3.normalised(values[:, :4])), values[:, 4:] * scales)
        # By the quaternion as it is: the turn is then right whatever its length has drifted to.
        (a, b, c, w), (p, q, r) = values[:, :4].T, omega.T
        turning = [w * p + b * r - c * q, w * q + c * p - a * r, w * r + a * q - b * p, -a * p - b * q - c * r]
        return np.column_stack([*(0.5 * rate for rate in turning), others / scales])

    start = np.concatenate([so3.quat_from_matrix(attitude), states / scales])
    whole = StepLimits.even(breaks[[0, -1]], 1.0 / _LONGEST)
    limits = whole if limits is None else limits.combined(whole)
    evaluations = 0

    def run_of(sharpness: float, limits: StepLimits) -> Run:
        nonlocal evaluations
        rtol = max(sharpness, _LEAST_RELATIVE)
        run = limited_run(lambda t, y: slopes(np.array([t]), y[None])[0], breaks, start, limits, rtol, sharpness)
        evaluations += run.evaluations
        return run

    for _ in range(_MOST_ROUNDS):
        last, run, times, errors = _agreeing_runs(run_of, tolerance, limits)
        worst = float(errors[-1].max())
        # Either of two runs that disagree may have passed over what the other met.
        shorter = [_shorter_steps(slopes, checked) for checked in ((run,) if worst <= tolerance else (last, run))]
        tighter = [narrower for narrower in shorter if narrower is not None]
        if not tighter:
            break
        limits = reduce(StepLimits.combined, tighter, limits)
    else:
        raise AccuracyNotReached(
            f"what drives the motion changes too often in short times: in {_MOST_ROUNDS} rounds steps passed over "
            "something; give the times of pulses as breaks, or shorten the motion"
        )
    if worst > tolerance:
        late = times[int(np.argmax(errors.max(axis=1) > tolerance))]
        raise AccuracyNotReached(
            f"two integrations disagree by {worst:.3g} rad where {tolerance:.3g} was requested, from {late:.6g} s "
            "on: the motion magnifies its errors; loosen the tolerance or shorten the motion"
        )
    return DrivenAttitude(run, scales, times, errors[:, 0], errors[:, 1:] * scales, evaluations)


def _agreeing_runs(
    run_of: Callable[[float, StepLimits], Run], tolerance: float, limits: StepLimits
) -> tuple[Run, Run, Array, Array]:
    """Two runs that agree, or the sharpest two; times (M,), and their largest difference so far (M, 1 + k)."""
    sharpness, before = max(_FIRST * tolerance, _LEAST / _SHARPER), np.inf
    last = run_of(sharpness, limits)
    while True:
        limits = limits.scaled(_SHORTER)
        if sharpness * _SHARPER < 0.9 * _LEAST:
            # No tolerance makes steps shorter now.
            limits = limits.combined(StepLimits(last.times, _SHORTER * np.diff(last.times)))
        else:
            sharpness *= _SHARPER
        run = run_of(sharpness, limits)
        times = np.union1d(run.times, 0.5 * (run.times[:-1] + run.times[1:]))
        if len(times) > _MOST_COMPARED:
            times = times[np.unique(np.linspace(0, len(times) - 1, _MOST_COMPARED).astype(int))]
        coarse, sharp = last(times), run(times)
        apart = so3.angle(so3.transpose(so3.matrix_from_quat(coarse[:, :4])) @ so3.matrix_from_quat(sharp[:, :4]))
        errors = np.maximum.accumulate(np.column_stack([apart, np.abs(coarse - sharp)[:, 4:]]), axis=0) + _ROUNDING
        worst = float(errors[-1].max())
        if worst <= tolerance or (sharpness * _SHARPER < 0.9 * _LEAST and worst > _GAIN * before):
            return last, run, times, errors
        last, before = run, worst


def _shorter_steps(slopes: Callable[[Array, Array], Array], run: Run) -> StepLimits | None:
    """Limits within the steps of a run that passed over something; None: none did."""
    passed_over = _defects(slopes, run).max(axis=1) > _DEFECT_LIMIT * run.rtol
    if not passed_over.any():
        return None
    return StepLimits(run.times, np.where(passed_over, np.diff(run.times) / _PARTS, np.inf))


def _defects(slopes: Callable[[Array, Array], Array], run: Run) -> Array:
    """Differences between the changes over steps and the integrals of the slope along them: (K, 4 + k).

    Zero for steps that are too short to pass over anything.
    """
    steps, duration = np.diff(run.times), run.times[-1]
    defects = np.zeros((len(steps), len(run(run.times[:1])[0])))
    long = np.flatnonzero(steps > _SAMPLE_GAP * duration)
    if len(long):
        parts = np.ceil(steps[long] * _GAUSS_GAP / (_SAMPLE_GAP * duration)).astype(int)
        first = np.cumsum(parts) - parts
        width = np.repeat(steps[long] / parts, parts)
        left = np.repeat(run.times[long], parts) + width * (np.arange(len(width)) - np.repeat(first, parts))
        nodes, weights = gauss_nodes(left, left + width)
        at_nodes = slopes(nodes.ravel(), run(nodes.ravel())).reshape(*nodes.shape, -1)
        integrals = np.add.reduceat(np.einsum("pm,pmk->pk", weights, at_nodes), first, axis=0)
        defects[long] = np.abs(run(run.times[long + 1]) - run(run.times[long]) - integrals)
    return defects


def dop853_attitude(
    evaluate: Evaluate, breaks: Array, momentum: Array, tolerance: float, limits: StepLimits | None = None
) -> DrivenAttitude:
    """S(t) for one Pi_0 by SciPy's DOP853 on the quaternion, restarted at the breaks, with its measured error.

    Every stage evaluates the deformation itself, an independent check of `integrate`. Raises like `driven_attitude`.
    """

    def rates(times: Array, attitudes: Array, states: Array) -> tuple[Array, Array]:
        inertia, internal = evaluate(times)
        pi = so3.apply(so3.transpose(attitudes), momentum)
        return np.asarray(np.linalg.solve(inertia, (pi - internal)[..., None])[..., 0], dtype=np.float64), states

    nothing = np.zeros(0)
    return driven_attitude(rates, breaks, np.eye(3), nothing, nothing, tolerance, limits)
