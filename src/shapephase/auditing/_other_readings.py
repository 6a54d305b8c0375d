"""Hypotheses that the numbers mean something else: other frames, orders, units or times, or filtered samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import UnivariateSpline

from ..arrays import Array
from ..body.body import Body
from ..warning_filters import quiet
from ._observation import observed
from ._residuals import Residuals, fitted_hypothesis, leftover, leftover_of_moments, residuals
from ._smooth_part import cut_off
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise
from .hypothesis import FittedValue, Hypothesis, Leftover

_STEPS = 8  # of Gauss and Newton, for a time
_ENOUGH = 1e-7  # relative change of a fitted number below which it is kept
_LONGEST = 0.1  # of the trajectory: longest shift in time that is tried, which costs samples at the ends
_OTHER_FRAME = {"world": "base", "base": "world"}

_SLACK = 1e-12  # of the trajectory: rounding of a time
_AS_GOOD_AS_EXACT = 1e-7  # of the range of a joint or rate: smaller noise is taken as none

Change = Callable[[FloatingTrajectory], FloatingTrajectory]
_FREE = (1, 2, 0)  # orders of cosines that the laws leave open in each block
_APART = 1.7  # ratio of the cut-offs of two laws up to which they are one


@dataclass(frozen=True)
class _Reading:
    """Another way to read a trajectory."""

    name: str
    kind: str
    change: Change
    needs_rates: bool = False
    degrees: tuple[bool, bool, bool] = (False, False, False)

    def noise(self, level: TrajectoryNoise, turning: Array) -> TrajectoryNoise:
        """Noise of the samples read in this way: angles, rates of joints and of the base may be in degrees."""
        angles, rates, base = self.degrees
        factor = np.where(turning, np.radians(1.0), 1.0)
        return replace(
            level,
            joints=tuple((np.array(level.joints) * factor).tolist()) if angles else level.joints,
            joint_rates=tuple((np.array(level.joint_rates) * factor).tolist()) if rates else level.joint_rates,
            rate=float(np.radians(level.rate)) if base else level.rate,
        )


@dataclass(frozen=True)
class _Gradual:
    """Another way to read it by a number that says how much."""

    name: str
    kind: str
    change: Callable[[FloatingTrajectory, _Curves, float], FloatingTrajectory]
    label: str
    unit: str
    needs_rates: bool = False
    needs_joints: bool = True


@dataclass(frozen=True, eq=False)
class OtherReading:
    """A hypothesis with the trajectories, and the noise of each, as they are if it is true."""

    hypothesis: Hypothesis
    runs: tuple[FloatingTrajectory, ...]
    levels: tuple[TrajectoryNoise, ...]

    def fits(self, body: Body) -> list[Residuals]:
        """Residuals of the trajectories as they are then."""
        return [residuals(body, observed(body, *pair)) for pair in zip(self.runs, self.levels, strict=True)]


def other_readings(
    body: Body,
    runs: Sequence[FloatingTrajectory],
    levels: Sequence[TrajectoryNoise],
    *,
    any_step: bool = False,
) -> list[OtherReading]:
    """All of them, each applied to all runs.

    levels : noise of each run as it is
    any_step : whether the drift of an integrator's step of any length is taken off
    """
    given = all(run.joint_rates is not None for run in runs)
    found = []
    for reading in _readings(body, runs[0]):
        if reading.needs_rates and not given:
            continue
        read = tuple(reading.change(run) for run in runs)
        noise = tuple(reading.noise(level, _turning(body)) for level in levels)
        left = replace(_leftover(body, read, noise, any_step), in_time=None)
        found.append(OtherReading(fitted_hypothesis(reading.name, reading.kind, left), read, noise))
    curves = [_Curves(run, level) for run, level in zip(runs, levels, strict=True)]
    return found + [
        _gradual(body, reading, runs, curves, levels, any_step)
        for reading in _GRADUAL
        if (given or not reading.needs_rates) and (body.n_shape or not reading.needs_joints)
    ]


def read_otherwise(body: Body, run: FloatingTrajectory) -> Iterator[FloatingTrajectory]:
    """The trajectory in every other frame, order and unit that a place of the centre of mass depends on."""
    for reading in _readings(body, run):
        if not reading.needs_rates:
            yield reading.change(run)


def _readings(body: Body, run: FloatingTrajectory) -> Iterator[_Reading]:
    order, frame, units = "quaternion", "frame", "units"
    if "order" not in run.certain:
        yield _Reading("quaternion written x y z w, read with w first", order, lambda t: _rolled(t, 1))
        yield _Reading("quaternion written w x y z, read with w last", order, lambda t: _rolled(t, -1))
    if "direction" not in run.certain:
        yield _Reading("quaternion of the world in base axes", order, lambda t: _inverse(t))
    rate, velocity = _OTHER_FRAME[run.rate_axes], _OTHER_FRAME[run.velocity_axes]
    yield _Reading(f"angular velocity in {rate} axes", frame, lambda t: replace(t, rate_axes=rate), needs_rates=True)
    if run.velocity is not None:
        yield _Reading(
            f"linear velocity in {velocity} axes",
            frame,
            lambda t: replace(t, velocity_axes=velocity),
            needs_rates=True,
        )
        yield _Reading(
            f"angular velocity in {rate} axes, linear in {velocity}",
            frame,
            lambda t: replace(t, rate_axes=rate, velocity_axes=velocity),
            needs_rates=True,
        )
    turning = _turning(body)
    if turning.any() and "units" not in run.certain:
        for angles, rates, base, name in (
            (True, False, False, "joint angles in degrees"),
            (False, True, False, "joint rates in degrees per second"),
            (False, False, True, "angular velocity of the base in degrees per second"),
            (False, True, True, "all angular rates in degrees per second"),
            (True, True, False, "joint angles and rates in degrees"),
            (True, True, True, "all angles and rates in degrees"),
        ):
            which = angles, rates, base
            yield _Reading(name, units, lambda t, w=which: _scaled(t, turning, *w), rates or base, which)


def _turning(body: Body) -> Array:
    return np.array([unit == "rad" for unit in body.joint_units], dtype=bool)


def _rolled(run: FloatingTrajectory, places: int) -> FloatingTrajectory:
    return replace(run, quaternion=np.roll(run.quaternion, places, axis=1))


def _inverse(run: FloatingTrajectory) -> FloatingTrajectory:
    return replace(run, quaternion=run.quaternion * [-1.0, -1.0, -1.0, 1.0])


def _scaled(run: FloatingTrajectory, turning: Array, angles: bool, rates: bool, base: bool) -> FloatingTrajectory:
    factor = np.where(turning, np.radians(1.0), 1.0)
    return replace(
        run,
        shapes=run.shapes * factor if angles else run.shapes,
        joint_rates=run.joint_rates * factor if rates and run.joint_rates is not None else run.joint_rates,
        rate=np.radians(run.rate) if base and run.rate is not None else run.rate,
    )


def _inside(run: FloatingTrajectory, lost: float) -> FloatingTrajectory:
    """Samples at which what is late or early by so much is known."""
    times = run.times
    slack = _SLACK * float(times[-1] - times[0])
    first = times[0] + max(-lost, 0.0) - slack
    last = times[-1] - max(lost, 0.0) + slack
    kept = np.flatnonzero((times >= first) & (times <= last))
    return run.part(int(kept[0]), int(kept[-1]) + 1)


class _Curves:
    """Curves near the samples of a run, no nearer than their noise.

    What a change of reading adds is taken from these: taken from the samples themselves, it would smooth their noise
    and seem to explain it.
    """

    def __init__(self, run: FloatingTrajectory, level: TrajectoryNoise) -> None:
        self._times = run.times
        self.shapes = [_curve(run.times, *each) for each in zip(run.shapes.T, level.joints, strict=True)]
        self.rates: list[Any] = []
        self.base: dict[str, list[Any]] = {}
        if run.joint_rates is not None:
            pairs = zip(run.joint_rates.T, level.joint_rates, strict=True)
            self.rates = [_curve(run.times, *each) for each in pairs]
        for name, noise in (("rate", level.rate), ("velocity", level.velocity)):
            values = getattr(run, name)
            if values is not None:
                self.base[name] = [_curve(run.times, column, noise) for column in values.T]

    def moved(self, curves: Sequence[Any], times: Array, late: float) -> Array:
        """What a shift in time adds: (N, k)."""
        later = np.clip(times + late, self._times[0], self._times[-1])
        return np.array([curve(later) - curve(times) for curve in curves]).reshape(len(curves), len(times)).T


def _curve(times: Array, values: Array, noise: float) -> Any:
    """Through the samples where they are as good as exact, else as near to them as their noise."""
    exact = noise <= _AS_GOOD_AS_EXACT * float(np.ptp(values))
    # Nearer than it says that it comes is near enough.
    with quiet(category=UserWarning):
        return UnivariateSpline(times, values, k=5, s=0.0 if exact else len(times) * noise**2)


def _shifted_joints(run: FloatingTrajectory, curves: _Curves, late: float) -> FloatingTrajectory:
    """Joints that were recorded late are taken from later samples."""
    shapes = run.shapes + curves.moved(curves.shapes, run.times, late)
    if run.joint_rates is None:
        return replace(run, shapes=shapes)
    return replace(run, shapes=shapes, joint_rates=run.joint_rates + curves.moved(curves.rates, run.times, late))


def _shifted_rates(run: FloatingTrajectory, curves: _Curves, late: float) -> FloatingTrajectory:
    assert run.joint_rates is not None
    found = {name: getattr(run, name) + curves.moved(those, run.times, late) for name, those in curves.base.items()}
    return replace(run, joint_rates=run.joint_rates + curves.moved(curves.rates, run.times, late), **found)


def _sharpened_joints(run: FloatingTrajectory, curves: _Curves, width: float) -> FloatingTrajectory:
    """A filter adds half its width, squared, times the second derivative; it is taken off again."""
    half = 0.5 * width
    shapes = run.shapes - half * np.stack([curve(run.times, 2) for curve in curves.shapes], axis=1)
    if run.joint_rates is None:
        return replace(run, shapes=shapes)
    bent = np.stack([curve(run.times, 2) for curve in curves.rates], axis=1)
    return replace(run, shapes=shapes, joint_rates=run.joint_rates - half * bent)


def _leftover(
    body: Body, runs: Sequence[FloatingTrajectory], levels: Sequence[TrajectoryNoise], any_step: bool
) -> Leftover:
    pairs = zip(runs, levels, strict=True)
    fits = [residuals(body, observed(body, run, level), any_step=any_step) for run, level in pairs]
    return leftover(fits, np.concatenate([fit.vector for fit in fits]))


def _moments(body: Body, run: FloatingTrajectory, noise: TrajectoryNoise, any_step: bool) -> Array:
    fit = residuals(body, observed(body, run, noise), any_step=any_step)
    return fit.moments(fit.vector)


_GRADUAL = (
    _Gradual("joints shifted in time", "time", _shifted_joints, "late by", "s"),
    _Gradual("rates shifted in time", "time", _shifted_rates, "late by", "s", needs_rates=True, needs_joints=False),
    _Gradual("joints filtered", "filter", _sharpened_joints, "square of the width", "s^2"),
)


def _gradual(
    body: Body,
    reading: _Gradual,
    runs: Sequence[FloatingTrajectory],
    curves: Sequence[_Curves],
    levels: Sequence[TrajectoryNoise],
    any_step: bool,
) -> OtherReading:
    """A number fitted by Gauss and Newton; samples that a shift loses count like those that are left."""
    usual = float(np.median(np.diff(runs[0].times)))
    span = float(runs[0].times[-1] - runs[0].times[0])
    longest = _LONGEST * span if reading.unit == "s" else (_LONGEST * span) ** 2
    # A filter has no negative width.
    least = -longest if reading.unit == "s" else 0.0
    nudge = 0.02 * usual if reading.unit == "s" else 0.1 * usual**2

    def changed(value: float, *lost: float) -> tuple[FloatingTrajectory, ...]:
        read = [reading.change(run, near, value) for run, near in zip(runs, curves, strict=True)]
        for each in lost if reading.unit == "s" else ():
            read = [_inside(run, each) for run in read]
        return tuple(read)

    def left(value: float, *lost: float) -> Leftover:
        moments = np.zeros((3, 3))
        for run, read, level in zip(runs, changed(value, *lost), levels, strict=True):
            share = len(run.times) / len(read.times)
            moments += _moments(body, read, level, any_step) * [share, share**2, share]
        return leftover_of_moments(moments)

    def square(value: float) -> float:
        # While the shift is fitted, the same samples count.
        return float(left(value, longest, -longest).squares.sum())

    value, best = 0.0, square(0.0)
    step, bend = nudge, 0.0
    for _ in range(_STEPS):
        ahead, behind = square(value + step), square(value - step)
        slope, bend = (ahead - behind) / (2.0 * step), (ahead - 2.0 * best + behind) / step**2
        if not bend > 0.0:
            break
        change = float(np.clip(-slope / bend, -0.5 * longest, 0.5 * longest))
        trial = float(np.clip(value + change, least, longest))
        new = square(trial)
        for _ in range(_STEPS):
            if new <= best:
                break
            trial = 0.5 * (trial + value)
            new = square(trial)
        if new > best:
            break
        done = abs(trial - value) < _ENOUGH * abs(trial) + 1e-12 * usual
        value, best = trial, new
        step = max(min(nudge, 0.1 * abs(change)), 1e-4 * nudge)
        if done:
            break
    found, without = left(value, value), left(0.0)
    if found.squares.sum() >= without.squares.sum():
        found, value = without, 0.0
    found = replace(found, steps=_leftover(body, changed(value, value), levels, any_step).steps)
    bar = float(np.sqrt(2.0 / bend)) if bend > 0.0 else np.inf
    values = {reading.label: FittedValue(value=value, bar=bar, unit=reading.unit)}
    hypothesis = fitted_hypothesis(reading.name, reading.kind, found, parameters=1, values=values)
    return OtherReading(hypothesis, changed(value, value), tuple(levels))


def filtered_samples(fits: Sequence[Residuals], without: Leftover) -> list[Hypothesis]:
    """The cut-off; empty where momentum and fall do not end at one frequency, as those of filtered samples do.

    Without rates the momentum is summed over the time, which adds slow noise of its own: there the fall decides.
    """
    cuts = []
    for fit in fits:
        span = float(fit.seen.times[-1] - fit.seen.times[0])
        blocks = (0, 1) if fit.seen.given_rates else (1,)
        for block, part in fit.blocks(fit.vector).items():
            if block in blocks:  # rates are held against differences of samples, which have a cut-off of their own
                order = cut_off(part, _FREE[block])
                if order is None:
                    return []
                cuts.append(0.5 * order / span)
    if not cuts or max(cuts) > _APART * min(cuts):
        return []
    value = FittedValue(value=float(np.exp(np.log(cuts).mean())), bar=float(np.ptp(cuts) / 2.0), unit="Hz")
    left = replace(without, squares=np.minimum(without.squares, without.counts), effective=without.counts)
    remark = "the noise of the samples ends there; filter a longer recording less, or state its noise"
    return [
        fitted_hypothesis("samples filtered", "filter", left, parameters=2, values={"cut-off": value}, remark=remark)
    ]
