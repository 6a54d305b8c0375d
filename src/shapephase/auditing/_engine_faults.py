"""Hypotheses about the engine: the step of its integrator is too long, or its gyroscopic term is missing.

Several runs with different steps show an order p: what is wrong grows as the step to the power p, by one curve of the
time for all runs. One run may agree with semi-implicit Euler.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from .. import so3
from ..arrays import Array
from ..display import short_repr
from ._observation import Observation
from ._residuals import Residuals, fitted_hypothesis, leftover
from .hypothesis import FittedValue, Hypothesis, Leftover, milliseconds

_LOWEST = 0.3  # order below which it is none: halving the step then changes next to nothing
_APART = 1.05  # ratio of two steps from which they tell an order
_ABOVE = 10.0  # drifts in units of what is known of them, by noise and rounding: smaller ones tell no order
_BELONGS = 0.25  # of the drifts: largest share that the law of one order may leave
_UNEVEN = 1.0  # largest difference of orders between steps where the step alone is the cause
_BARS = 3.0  # standard deviations by which a fitted step may be off
_INACCURATE = 0.1  # of a step: what terms of second order add, 0.1 % for 2 ms at 10 rad/s, and 5 % for 20 ms
_AS_ONE = 1e-3  # share of the momentum: joints that add less are at rest, and the body turns as one
_SEEN = 1e-9  # share of the largest column: what moves nothing, as the inertia of a ball does not, takes no part
_AXES = "xyz"


@dataclass(frozen=True, kw_only=True)
class StepOrder:
    """Dependence of the error on the step of the integrator.

    Attributes
    ----------
    steps : of the runs that tell it, ascending [s]
    drifts : of the momentum in each, rms relative to the momenta that turn and move the body
    order : the exponent, from the shortest step to the next
    between : the exponents from each step to the next
    off_law : what one curve of the time, growing with that exponent, leaves of the drifts of these two, relative

    Examples
    --------
    >>> found = sp.auditing.StepOrder(
    ...     steps=(0.001, 0.002), drifts=(1e-4, 2e-4), order=1.0, between=(1.0,), off_law=0.0)
    >>> found.order
    1.0
    """

    steps: tuple[float, ...]
    drifts: tuple[float, ...]
    order: float
    between: tuple[float, ...]
    off_law: float

    __repr__ = short_repr


def step_order(runs: Sequence[Observation], least: Sequence[float]) -> StepOrder | None:
    """The order that runs with several steps have together; None where they tell none.

    least : of each run, what a drift has to exceed, rms relative to the momenta
    """
    ordered = sorted(zip(runs, least, strict=True), key=lambda pair: pair[0].trajectory.assumed_step)
    known = [(run, _drift(run)) for run, limit in ordered if _rms(_drift(run)) > _ABOVE * limit * run.scale]
    steps = [run.trajectory.assumed_step for run, _ in known]
    if len(known) < 2 or any(longer < _APART * shorter for shorter, longer in pairwise(steps)):
        return None
    drifts = [_rms(drift) / run.scale for run, drift in known]
    between = tuple(
        float(np.log(drifts[k + 1] / drifts[k]) / np.log(steps[k + 1] / steps[k])) for k in range(len(known) - 1)
    )
    return StepOrder(
        steps=tuple(steps),
        drifts=tuple(drifts),
        order=between[0],
        between=between,
        off_law=_off_law(known[:2], between[0]),
    )


def step_hypothesis(found: StepOrder, without: Leftover, late: float) -> Hypothesis | None:
    """The step as a cause, if one law holds for all runs.

    late : share of the residuals of rates that no lateness explains, squared
    """
    uneven = max(abs(each - found.order) for each in found.between)
    if found.order < _LOWEST or uneven > _UNEVEN or found.off_law > _BELONGS:
        return None
    steps = ", ".join(milliseconds(step) for step in found.steps)
    shares = np.array([found.off_law**2, found.off_law**2, late])
    return fitted_hypothesis(
        "integration step",
        "step",
        replace(without, squares=without.squares * shares),
        parameters=1,
        values={"order": FittedValue(value=found.order, bar=uneven)},
        remark=f"from runs with steps of {steps} ms",
    )


def _drift(run: Observation) -> Array:
    """From the first sample on: (N, 3)."""
    seen = run.seen(run.momentum)
    if run.given_rates:
        return seen - seen[0]
    since = (run.times - run.times[0])[:, None]
    return seen - since * (since * seen).sum(axis=0) / (since**2).sum()


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).sum(axis=-1).mean()))


def _together(known: Sequence[tuple[Observation, Array]]) -> Array:
    """The drifts of all runs at times that all have: (runs, N, 3)."""
    begin = max(run.times[0] for run, _ in known)
    end = min(run.times[-1] for run, _ in known)
    times = np.linspace(begin, end, min(len(run.times) for run, _ in known))
    return np.stack([CubicSpline(run.times, drift)(times) for run, drift in known])


def _off_law(known: Sequence[tuple[Observation, Array]], order: float) -> float:
    """What one curve times step^order leaves of the drifts, rms relative to them, each run weighing alike."""
    drifts = _together(known)
    powers = np.array([run.trajectory.assumed_step for run, _ in known]) ** order
    scaled = drifts / powers[:, None, None]
    return _rms((scaled - scaled.mean(axis=0)).reshape(-1, 3)) / _rms(scaled.reshape(-1, 3))


def is_possible_step(fit: Residuals, step: float, bar: float) -> bool:
    """Whether a fitted step is positive, no longer than the time between samples, and the one that is given."""
    spacing, given = float(np.median(np.diff(fit.seen.times))), fit.seen.trajectory.integrator_step
    off = _BARS * bar + _INACCURATE * step
    return 0.0 < step <= spacing + off and (given is None or abs(step - given) <= off)


def integration_step(fits: Sequence[Residuals]) -> list[Hypothesis]:
    """The step of a semi-implicit integrator, from one run, however sparse its samples are; empty where it is none."""
    columns = [fit.step_column() for fit in fits]
    lengths = [float((column**2).sum()) for column in columns]
    if not all(length > 0.0 for length in lengths):
        return []
    steps = [float(fit.vector @ c[:, 0]) / n for fit, c, n in zip(fits, columns, lengths, strict=True)]
    values, remarks = {}, []
    for fit, step, length in zip(fits, steps, lengths, strict=True):
        spacing, bar = float(np.median(np.diff(fit.seen.times))), float(1.0 / np.sqrt(length))
        if not is_possible_step(fit, step, bar):
            return []
        label = "step" if len(fits) == 1 else f"step of {fit.seen.trajectory.name}"
        values[label] = FittedValue(value=step, bar=bar, unit="s")
        remarks.append(f"{spacing / step:.3g}")
    every = ", ".join(remarks)
    left = np.concatenate([fit.vector - step * c[:, 0] for fit, step, c in zip(fits, steps, columns, strict=True)])
    return [
        fitted_hypothesis(
            "integration step",
            "step",
            leftover(fits, left),
            parameters=len(fits),
            values=values,
            remark=f"consistent with semi-implicit Euler, {every} steps a sample; a run with half the step tells",
        )
    ]


def no_gyroscopic_term(fits: Sequence[Residuals]) -> list[Hypothesis]:
    """Without omega x I omega in Euler's equations omega is constant in world axes: the momentum goes as R I R^T.

    Empty where joints move: what an engine makes of their motion then is not known.
    """
    if any(np.sqrt((fit.seen.internal**2).sum(axis=1).mean()) > _AS_ONE * fit.seen.scale for fit in fits):
        return []
    lefts, values = [], {}
    for fit in fits:
        seen = fit.seen
        columns = fit.columns(seen.attitude @ seen.inertia @ so3.transpose(seen.attitude))
        rate, left = _fitted(columns, fit.vector)
        lefts.append(left)
        if not values:
            values = {
                f"angular velocity {axis}": FittedValue(value=float(part), bar=float(bar), unit="rad/s")
                for axis, part, bar in zip(_AXES, *rate, strict=True)
            }
    return [
        fitted_hypothesis(
            "no gyroscopic term in the engine",
            "engine",
            leftover(fits, np.concatenate(lefts)),
            parameters=3 * len(fits),
            values=values,
            remark="the angular velocity is constant in world axes; switch the gyroscopic force of the engine on",
        )
    ]


def _fitted(columns: Array, vector: Array) -> tuple[tuple[Array, Array], Array]:
    """Least squares: the coefficients with their bars, and what is left."""
    left, strengths, right = np.linalg.svd(columns, full_matrices=False)
    kept = strengths > _SEEN * max(float(strengths.max(initial=0.0)), np.finfo(float).tiny)
    inverse = right[kept].T / strengths[kept]
    amounts = left[:, kept].T @ vector
    return (inverse @ amounts, np.linalg.norm(inverse, axis=1)), vector - left[:, kept] @ amounts
