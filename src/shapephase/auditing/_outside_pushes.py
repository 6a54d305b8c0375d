"""The hypotheses that something outside pushed: a torque, or a force at a point, between two times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from ..arrays import Array
from ._residuals import Residuals, fitted_hypothesis, leftover
from .hypothesis import FittedValue, Hypothesis

_KNOTS = 48  # times between which a push is looked for, all pairs of them, before the best is refined
_MOST_CALLS = 600  # of the refinement
_AS_GOOD_AS_NONE = 1e-6  # of the effect of a blow in the middle: smaller columns are not fitted
_FARTHEST = 30.0  # radii of gyration: largest lever of a force
_AXES = "xyz"


class _Push(NamedTuple):
    """Begin and end [s], fitted columns and what they leave."""

    begin: float
    end: float
    left: Array
    square: float
    amounts: Array
    bars: Array


def outside_pushes(fits: Sequence[Residuals]) -> list[Hypothesis]:
    """A torque, and where places are known a force, that acted alike in all runs."""
    found = [_torque(fits)]
    if all(fit.seen.centre is not None for fit in fits):
        force = _force(fits)
        found += [] if force is None else [force]
    return found


def _torque(fits: Sequence[Residuals]) -> Hypothesis:
    push = _fitted(fits, with_force=False)
    lasts = push.end - push.begin
    values = _times(push)
    for axis in range(3):
        values[f"torque {_AXES[axis]}"] = FittedValue(
            value=push.amounts[axis] / lasts, bar=push.bars[axis] / lasts, unit="N m"
        )
    values["twist"] = FittedValue(
        value=float(np.linalg.norm(push.amounts[:3])), bar=float(push.bars[:3].max()), unit="N m s"
    )
    return _hypothesis("torque from outside", "torque", push, fits, values, "")


def _force(fits: Sequence[Residuals]) -> Hypothesis | None:
    """None where it would have to act so far away that it is a torque."""
    push = _fitted(fits, with_force=True)
    arm = _FARTHEST * fits[0].seen.extent
    if arm * np.linalg.norm(push.amounts[3:]) < np.linalg.norm(push.amounts[:3]):
        return None
    lasts = push.end - push.begin
    force, torque = push.amounts[3:] / lasts, push.amounts[:3] / lasts
    values = _times(push)
    for axis in range(3):
        values[f"force {_AXES[axis]}"] = FittedValue(value=force[axis], bar=push.bars[3 + axis] / lasts, unit="N")
    magnitude = float(push.amounts[3:] @ push.amounts[3:])
    values["blow"] = FittedValue(value=float(np.sqrt(magnitude)), bar=float(push.bars[3:].max()), unit="N s")
    remark = ""
    if magnitude > 0.0:
        # Along the force its point is free.
        arm = np.cross(push.amounts[3:], push.amounts[:3]) / magnitude
        seen = fits[0].seen
        assert seen.centre is not None
        assert seen.trajectory.position is not None
        middle = int(np.argmin(np.abs(seen.times - 0.5 * (push.begin + push.end))))
        from_base = seen.attitude[middle].T @ (seen.centre[middle] + arm - seen.trajectory.position[middle])
        point = " ".join(f"{number:.3g}" for number in from_base)
        remark = f"through the point {point} m of the base, or any other along the force"
        along = float(abs(force @ torque)) / max(float(np.linalg.norm(force) * np.linalg.norm(torque)), 1e-300)
        if along > 0.1:
            remark += f"; and a torque along the force, {along:.0%} of all"
    return _hypothesis("force from outside", "force", push, fits, values, remark)


def _times(push: _Push) -> dict[str, FittedValue]:
    return {
        "from": FittedValue(value=push.begin, bar=0.0, unit="s"),
        "to": FittedValue(value=push.end, bar=0.0, unit="s"),
    }


def _hypothesis(
    name: str, kind: str, push: _Push, fits: Sequence[Residuals], values: dict[str, FittedValue], remark: str
) -> Hypothesis:
    left = leftover(fits, push.left)
    return fitted_hypothesis(name, kind, left, parameters=2 + len(push.amounts), values=values, remark=remark)


def _fitted(fits: Sequence[Residuals], *, with_force: bool) -> _Push:
    """The two times by a search over pairs and a simplex; the amounts are linear."""
    times = fits[0].seen.times
    least = float(np.median(np.diff(times)))
    vector = np.concatenate([fit.vector for fit in fits])
    middle = 0.5 * (times[0] + times[-1])
    blow = np.vstack([_columns(fit, middle, middle + least, with_force=with_force) for fit in fits])
    strengths = np.linalg.norm(blow, axis=0)

    def tried(begin: float, end: float) -> _Push:
        columns = np.vstack([_columns(fit, begin, end, with_force=with_force) for fit in fits])
        # A push that is as good as none, such as a force all along, which is a weight, takes no part.
        left, amounts, spread = vector, np.zeros(columns.shape[1]), np.zeros(columns.shape[1])
        lengths = np.linalg.norm(columns, axis=0)
        kept = np.flatnonzero(lengths > _AS_GOOD_AS_NONE * strengths)
        if len(kept):
            right = columns[:, kept] / lengths[kept]
            basis, triangle = np.linalg.qr(right)
            found = np.linalg.solve(triangle, basis.T @ vector)
            left = vector - right @ found
            amounts[kept] = found / lengths[kept]
            spread[kept] = np.linalg.norm(np.linalg.inv(triangle), axis=1) / lengths[kept]
        return _Push(begin, end, left, float(left @ left), amounts, spread)

    def cost(pair: Array) -> float:
        begin, lasts = float(pair[0]), float(np.exp(pair[1]))
        if begin < times[0] or begin + lasts > times[-1] + least:
            return np.inf
        # Log, for what is left goes over many powers of ten.
        return float(np.log(tried(begin, begin + lasts).square + np.finfo(float).tiny))

    begin, end = _best_pair(fits, with_force=with_force)
    start = np.array([begin, np.log(end - begin)])
    simplex = start + np.array([[0.0, 0.0], [0.5 * least, 0.0], [0.0, min(0.2, 2.0 * least / (end - begin))]])
    options = {"initial_simplex": simplex, "maxfev": _MOST_CALLS, "xatol": 1e-5 * least, "fatol": 1e-9}
    best = minimize(cost, start, method="Nelder-Mead", options=options)
    found = tried(float(best.x[0]), float(best.x[0] + np.exp(best.x[1])))
    whole = tried(begin, end)
    return found if found.square <= whole.square else whole


def _columns(fit: Residuals, begin: float, end: float, *, with_force: bool) -> Array:
    """Residuals of an angular impulse about each axis, and of a linear one along each: (M, 3 or 6)."""
    since = fit.seen.times
    ramp = np.clip((since - begin) / (end - begin), 0.0, 1.0)
    count = 6 if with_force else 3
    momentum, centre = np.zeros((len(since), 3, count)), np.zeros((len(since), 3, count))
    momentum[:, :, :3] = ramp[:, None, None] * np.eye(3)
    if with_force:
        inside = np.clip(since - begin, 0.0, end - begin)
        path = 0.5 * inside**2 / (end - begin) + np.maximum(since - end, 0.0)
        centre[:, :, 3:] = path[:, None, None] * np.eye(3) / fit.seen.mass
    return fit.columns(momentum, centre)


def _best_pair(fits: Sequence[Residuals], *, with_force: bool) -> tuple[float, float]:
    """The pair of knots whose push takes most off, with all directions of noise taken as alike."""
    times = fits[0].seen.times
    knots = np.linspace(times[0], times[-1], _KNOTS)
    first, last = np.triu_indices(_KNOTS, 1)
    begin, end = knots[first], knots[last]
    gain = np.zeros(len(begin))
    for fit in fits:
        seen = fit.seen
        since = seen.times[:, None]
        inside = np.clip(since - begin, 0.0, end - begin)
        ramp = inside / (end - begin)
        weight = 1.0 / np.sqrt(np.trace(seen.momentum_noise, axis1=1, axis2=2) / 3.0)
        gain += _gain(seen.seen(ramp), seen.seen(seen.momentum), weight, since, 1 if seen.given_rates else 2)
        if with_force and seen.centre is not None and seen.centre_noise is not None:
            path = 0.5 * inside**2 / (end - begin) + np.maximum(since - end, 0.0)
            weight = 1.0 / np.sqrt(np.trace(seen.centre_noise, axis1=1, axis2=2) / 3.0)
            gain += _gain(path, seen.centre, weight, since, 3)
    best = int(np.argmax(gain))
    return float(begin[best]), float(end[best])


def _gain(columns: Array, values: Array, weight: Array, since: Array, free: int) -> Array:
    """What each column, (N, P), takes off the squares of values (N, 3) less their lowest powers of time."""
    powers = weight[:, None] * (since - since.mean()) ** np.arange(free)
    basis = np.linalg.qr(powers)[0]
    found = weight[:, None] * columns
    found = found - basis @ (basis.T @ found)
    strength = (found**2).sum(axis=0)
    least = np.finfo(float).tiny + 1e-12 * strength.max(initial=0.0)
    return ((found.T @ (weight[:, None] * values)) ** 2).sum(axis=1) / np.maximum(strength, least)
