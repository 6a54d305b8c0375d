"""The hypothesis that the step of an integrator is too long: several runs with different steps tell, one may agree.

With an order p, what is wrong grows as the step to the power p, by one curve of the time for all runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..display import short_repr
from ._observation import Observation
from .hypothesis import FittedValue, Hypothesis

_LOWEST = 0.3
"""Order below which it is none: halving the step then changes next to nothing."""
_APART = 1.05
"""Ratio of two steps from which they tell an order."""
_ABOVE = 10.0
"""Drifts in units of what is known of them, by noise and rounding: smaller ones tell no order."""
_BELONGS = 0.25
"""Of the drifts: more must not be left by the law of one order."""
_UNEVEN = 1.0
"""Orders from one step to the next differ by less where the step alone is the cause."""


@dataclass(frozen=True, kw_only=True)
class StepOrder:
    """How what is wrong goes with the step of the integrator.

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
    ordered = sorted(zip(runs, least, strict=True), key=lambda pair: pair[0].trajectory.integrator_step)
    known = [(run, _drift(run)) for run, limit in ordered if _rms(_drift(run)) > _ABOVE * limit * run.scale]
    steps = [run.trajectory.integrator_step for run, _ in known]
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


def step_hypothesis(found: StepOrder) -> Hypothesis | None:
    """The step as a cause, if one law holds for all runs; its square is relative to all there is to explain."""
    uneven = max(abs(each - found.order) for each in found.between)
    if found.order < _LOWEST or uneven > _UNEVEN or found.off_law > _BELONGS:
        return None
    steps = ", ".join(f"{1e3 * step:.4g}" for step in found.steps)
    return Hypothesis(
        name="integration step",
        kind="step",
        square=found.off_law**2,
        left_over=found.off_law,
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
    powers = np.array([run.trajectory.integrator_step for run, _ in known]) ** order
    scaled = drifts / powers[:, None, None]
    return _rms((scaled - scaled.mean(axis=0)).reshape(-1, 3)) / _rms(scaled.reshape(-1, 3))


def as_semi_implicit_euler(body: Body, run: Observation) -> float | None:
    """What is left of the drift of one run, relative to it, if every sample is a step of semi-implicit Euler.

    New velocities come from the forces at the old configuration: there the momentum of the new velocities is the old
    one plus its rate at fixed velocities times the step. What the new configuration makes of it is the drift.
    None where the samples are not the steps.
    """
    steps = np.diff(run.times)
    step = run.trajectory.integrator_step
    if not run.given_rates or np.abs(steps - step).max() > 1e-6 * step:
        return None
    inertia, matrix, inertia_rate, matrix_rate = body.sample_rates(run.trajectory.shapes, run.joint_rates)
    momentum = so3.apply(inertia, run.rate) + so3.apply(matrix, run.joint_rates)
    carried = so3.apply(inertia_rate, run.rate) + so3.apply(matrix_rate, run.joint_rates)
    slope = so3.apply(run.attitude, np.cross(run.rate, momentum) + carried)
    ahead = so3.apply(inertia[:-1], run.rate[1:]) + so3.apply(matrix[:-1], run.joint_rates[1:])
    rest = so3.apply(run.attitude[:-1], ahead) - run.momentum[:-1] + step * slope[:-1]
    drift = run.momentum[1:] - run.momentum[:-1]
    whole = _rms(np.cumsum(drift, axis=0))
    return _rms(np.cumsum(rest, axis=0)) / whole if whole > 0.0 else None
