"""Samples that repeat the state of the last step: their times are off by the part of a step that had gone by.

With a step h and samples every T the state of the sample k is late by (k T) mod h, a saw-tooth that repeats after q
samples where h / T = q / p. High differences of the samples, in which the motion itself is nearly nothing, show it.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from math import gcd
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import savgol_coeffs, savgol_filter

from ..arrays import Array
from ..reconstruction.attitude_angles import continuous
from ..shape_space.path_noise import white_noise
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise, estimated_noise
from .hypothesis import FittedValue, Hypothesis, milliseconds

_ORDER = 6  # of differences: a motion of 11 rad/s at every 20 ms keeps 1e-4 of itself
_LONGEST_PATTERN = 40  # samples: 2 ms at 60 Hz have 3, 1/240 s at 7 ms has 25
_BARS = 3.0  # standard deviations within which a rounder step is taken
_ROUND = 1e-4  # s
_REPEATS = 3  # of a pattern within the samples
_EVEN = 1e-3  # of the time between samples: logs with uneven times have those of the states
_LEFT = 0.5  # of the squares of differences; noise alike in m coordinates keeps 1 - 1/m of them at least
_BLOWS = 20.0  # times the median of squares: samples at which something struck
_OF_JOINTS = ("joints", "joint_rates")
_SLOPE = 9  # samples of a slope, over which steps up to four times the time between samples are smooth
_AT_REST = 1e-9  # [rad or m] range of a coordinate that does not move
_SLACK = 1e-3  # relative gain of a longer pattern over a shorter one that chance does not bring


def held_states(run: FloatingTrajectory) -> tuple[FloatingTrajectory, Hypothesis | None]:
    """The trajectory with the times of its states, and the step between them; itself and None where nothing is held."""
    spacing = float(np.median(np.diff(run.times)))
    if len(run.times) < 2 * _ORDER + 2 or np.abs(np.diff(run.times) - spacing).max() > _EVEN * spacing:
        return run, None
    lag = _repeats(run) or _pattern(run, spacing)
    if lag is None:
        return run, None
    step, late, bar = lag
    times = run.times - late
    # A state that is repeated is kept once.
    kept = np.concatenate([[True], np.diff(times) > 0.5 * min(step, spacing)])
    states = replace(run, times=times[kept], **{name: values[kept] for name, values in _samples(run).items()})
    even, noise = _at_even_times(states)
    states = replace(even if run.joint_rates is None else states, noise=run.noise or noise)
    hypothesis = Hypothesis(
        name=f"states held between steps of {milliseconds(step)} ms",
        kind="time",
        square=0.0,
        left_over=0.0,
        parameters=2,
        share=0.0,
        values={"step between states": FittedValue(value=step, bar=bar, unit="s")},
        remark=f"{run.name}: samples every {milliseconds(spacing)} ms repeat the last state, late by up to "
        f"{milliseconds(float(late.max()), 3)} ms; log the times of the states",
    )
    return states, hypothesis


def _samples(run: FloatingTrajectory) -> dict[str, Array]:
    values = {name: getattr(run, name) for name in ("shapes", "position", "rate", "velocity", "joint_rates")}
    return {"quaternion": continuous(run.quaternion)} | {name: had for name, had in values.items() if had is not None}


def _at_even_times(states: FloatingTrajectory) -> tuple[FloatingTrajectory, TrajectoryNoise]:
    """Curves through the states at even times, where differences show noise, and that of the states.

    Curves keep less of noise as fast as the samples, as they do of unit noise; of slower noise they keep all.
    """
    times = np.linspace(states.times[0], states.times[-1], len(states.times))

    def between(values: Array) -> Array:
        return np.asarray(make_interp_spline(states.times, values, k=5)(times))

    unit = np.random.default_rng(0).normal(size=(len(times), _SLOPE))
    kept = float(np.median(white_noise(between(unit)[:, :, None], 1)))
    even = replace(states, times=times, **{name: between(values) for name, values in _samples(states).items()})
    scaled: dict[str, Any] = {
        name: tuple(np.divide(value, kept).tolist()) if name in _OF_JOINTS else value / kept
        for name, value in asdict(estimated_noise(even)).items()
    }
    return even, TrajectoryNoise(**scaled)


def _repeats(run: FloatingTrajectory) -> tuple[float, Array, float] | None:
    """Step, lateness of each sample (N,) and bar of the step [s], where states are shown several times in turn."""
    values = np.hstack([run.quaternion, run.shapes, *([] if run.position is None else [run.position])])
    new = np.concatenate([[True], np.any(np.diff(values, axis=0) != 0.0, axis=1)])
    first = np.flatnonzero(new)[1:]
    lengths = np.diff(first)
    if len(first) < _SLOPE or lengths.min() < 2 or np.ptp(lengths) > 1:
        return None
    count = np.arange(len(first))
    step = float(np.polyfit(count, run.times[first], 1)[0])
    begin = float((run.times[first] - step * count).min())
    state = np.cumsum(new) - 2
    return step, run.times - (begin + step * state), float(np.ptp(run.times[first] - step * count)) / len(first)


def _pattern(run: FloatingTrajectory, spacing: float) -> tuple[float, Array, float] | None:
    """Step, lateness of each sample (N,) and bar of the step [s], where high differences show a pattern."""
    values = np.hstack([continuous(run.quaternion), run.shapes, *([] if run.position is None else [run.position])])
    values = values[:, np.ptp(values, axis=0) > _AT_REST]
    if not values.shape[1]:
        return None
    rough = np.diff(values, _ORDER, axis=0)
    speed = savgol_filter(values, _SLOPE, 3, deriv=1, delta=spacing, axis=0)[_ORDER // 2 : -_ORDER // 2]
    size = np.sqrt((rough**2).mean(axis=0))
    rough, speed = rough / size, speed / size
    squares = (rough**2).sum(axis=1)
    calm = squares <= _BLOWS * np.median(squares)
    whole, count = float(squares[calm].sum()), int(calm.sum())
    # Lateness d takes d v off a sample.
    weight, along = (np.where(calm, (part * speed).sum(axis=1), 0.0) for part in (speed, -rough))
    left, best = whole, None
    for length in range(2, min(_LONGEST_PATTERN, count // _REPEATS) + 1):
        order = np.arange(len(weight)) % length
        weights, products = (np.bincount(order, part, length) for part in (weight, along))
        turns = np.array([turn for turn in range(1, length) if gcd(turn, length) == 1])
        shifts, samples = np.arange(length)[:, None], np.arange(length)
        saws = (turns[:, None, None] * samples + shifts) % length / length
        seen = sum(c * np.roll(saws, -k, axis=2) for k, c in enumerate(np.diff(np.eye(_ORDER + 1), _ORDER, axis=0)[0]))
        strength, product = seen**2 @ weights, np.maximum(seen @ products, 0.0)
        remaining = whole - product**2 / np.maximum(strength, np.finfo(float).tiny)
        turn, shift = np.unravel_index(int(np.argmin(remaining)), remaining.shape)
        if remaining[turn, shift] < (1.0 - _SLACK) * left:
            left = float(remaining[turn, shift])
            amount = float(product[turn, shift] / strength[turn, shift])
            best = length, int(turns[turn]), int(shift), amount, float(strength[turn, shift])
    if best is None or left > _LEFT * whole:
        return None
    length, turn, shift, amount, strength = best
    # Noise of the slopes counts as motion, and makes the pattern seem smaller.
    noise = left / float((np.diff(np.eye(_ORDER + 1), _ORDER, axis=0) ** 2).sum())
    noise *= float((savgol_coeffs(_SLOPE, 3, deriv=1, delta=spacing) ** 2).sum())
    amount /= max(1.0 - noise / float(weight.sum()), 0.5)
    bar = float(np.sqrt(left / (count * strength)))
    # T / h = p / q, where p is the turn and a number of whole q; simulators have round steps.
    steps = spacing * length / (turn + length * np.arange(len(values)))
    off = np.abs(steps - amount)
    near = np.flatnonzero(off <= max(_BARS * bar, float(off.min())))
    uneven = np.abs(steps / _ROUND - np.round(steps / _ROUND)) > _EVEN
    step = float(steps[min(near, key=lambda place: (uneven[place], off[place]))])
    late = step * ((np.arange(len(values)) * turn + shift) % length) / length
    return step, late, bar
