"""Steps over the series of a deformation: attitudes from I^-1 and I^-1 L_o."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from .. import run_progress
from ..arrays import Array, Integers
from ..chebyshev import chebyshev
from .interpolant import Interpolant
from .kernels import step_kernel
from .threads import in_threads

# Steps of which the channels are there at once: four times as many take some 16 megabytes.
_AT_ONCE = 4000
# Steps of a panel for which the matrix that gives their channels is kept.
_KEPT = 64
# [rad] of the starts that show how errors grow: what is neglected is as small as rounding, relative to it.
_TURN = 1e-7
# Times between which the growth of errors is known, the start included.
_MARKS = 17
_NO_MARKS = np.zeros(0, dtype=np.int64)
# Of a direction, for derivatives: its products with whatever grows stay far from the smallest and the largest numbers.
_IMAGINARY = 1e-60


def stage_channels(series: Array, widths: Array, steps: Integers, first: int = 0, stop: int | None = None) -> Array:
    """The channels at the stages of steps `first` to `stop` of one loop, times their lengths: (K, STAGES, 9).

    Parameters
    ----------
    series, widths, steps : (P, n, 9), (P,) [s], (P,) of each panel
    """
    ends = np.cumsum(steps)
    stop = int(ends[-1]) if stop is None else stop
    found = np.empty((stop - first, step_kernel.STAGES, 9))
    low, high = (int(np.searchsorted(ends, place, side="right")) for place in (first, stop - 1))
    scaled, counts = series[low : high + 1] * widths[low : high + 1, None, None], steps[low : high + 1]
    starts = ends[low : high + 1] - counts
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        if count <= _KEPT and starts[rows[0]] >= first and starts[rows[-1]] + count <= stop:
            values = (_matrix_of_panel(series.shape[1], count) @ scaled[rows]).reshape(len(rows), count, -1, 9)
            if len(rows) == len(counts):
                return values.reshape(found.shape)
            found[(starts[rows] - first)[:, None] + np.arange(count)] = values
            continue
        for row in rows:
            begin, end = max(int(starts[row]), first), min(int(starts[row]) + count, stop)
            matrix = _matrix(series.shape[1], count, begin - int(starts[row]), end - int(starts[row]))
            found[begin - first : end - first] = (matrix @ scaled[row]).reshape(end - begin, -1, 9)
    return found


def _matrix(terms: int, count: int, begin: int, end: int) -> Array:
    """From the series of a panel to its channels at the stages of some of `count` steps, times their share of it."""
    places = (np.arange(begin, end)[:, None] + step_kernel.NODES).ravel()
    return chebyshev(np.clip(2.0 * places / count - 1.0, -1.0, 1.0), terms) / count


@lru_cache(maxsize=256)
def _matrix_of_panel(terms: int, count: int) -> Array:
    return _matrix(terms, count, 0, count)


def _blocks(steps: Integers, loops: int) -> Iterator[tuple[int, int, int]]:
    """First and last step of one loop, and how many loops go over them, one block after another."""
    total = int(steps.sum())
    if total <= _AT_ONCE:
        yield 0, total, loops
        return
    for _ in range(loops):
        for first in range(0, total, _AT_ONCE):
            yield first, min(first + _AT_ONCE, total), 1


def marched(
    interpolant: Interpolant, series: Array, steps: Integers, momentum: Array, start: Array | None = None
) -> Array:
    """Attitudes at the ends of steps of all loops, quaternions xyzw: (B, K + 1, 4).

    Parameters
    ----------
    series : (P, n, 9) on the interpolant's panels
    steps : (P,) on each of them
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    start : (B, 4) attitudes; None: the identity
    """
    return _marched(interpolant, series, steps, *magnitudes_and_directions(momentum), start)


def _marched(
    interpolant: Interpolant, series: Array, steps: Integers, magnitudes: Array, directions: Array, start: Array | None
) -> Array:
    """As `marched`; directions may be complex, for a derivative."""
    count = interpolant.loops * int(steps.sum())
    quaternions = np.zeros((len(magnitudes), count + 1, 4), dtype=directions.dtype)
    quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0] if start is None else start
    at = 0
    for first, stop, loops in _blocks(steps, interpolant.loops):
        channels = stage_channels(series, interpolant.widths, steps, first, stop)

        def march(rows: slice, channels: Array = channels, loops: int = loops, at: int = at) -> None:
            step_kernel.march(channels, loops, magnitudes[rows], directions[rows], at, quaternions[rows])

        for _ in in_threads(march, len(magnitudes)):
            pass
        at += loops * (stop - first)
    return quaternions


def magnitudes_and_directions(momentum: Array) -> tuple[Array, Array]:
    """|Pi| and Pi/|Pi|: (B, 3) -> (B,), (B, 3); without momentum any direction serves.

    Each row is the same whatever the others are.
    """
    x, y, z = momentum.T
    magnitudes = np.sqrt(x * x + y * y + z * z)
    moving = magnitudes > 0.0
    directions = momentum / np.where(moving, magnitudes, 1.0)[:, None]
    directions[~moving] = [0.0, 0.0, 1.0]
    return magnitudes, directions


@dataclass(frozen=True, eq=False)
class Attempt:
    """Steps of some momenta, and how far they are from others.

    Attributes
    ----------
    steps : (P,) on each panel of a loop, four times those that were asked for
    quaternions, directions, turns, dynamics : as `SteppedRotation` has them
    coarse, fine : (B,) largest angle between a fourth and half as many steps, and between these and all [rad]
    sampling : (B,) between steps on the series and on those changed by what is probably missing [rad]
    turned : (B,) the sum of all turns [rad]
    growth : (B,) of an error, from one time to a later one
    """

    steps: Integers
    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    coarse: Array
    fine: Array
    sampling: Array
    turned: Array
    growth: Array


def attempted(interpolant: Interpolant, changed: Array, steps: Integers, momentum: Array, threads: int | None) -> Attempt:
    """Take so many steps (P,) on each panel, twice and four times as many, for momenta (B, 3)."""
    magnitudes, directions = magnitudes_and_directions(momentum)
    series, widths, loops = interpolant.coefficients, interpolant.widths, interpolant.loops
    moving = bool(magnitudes.any())
    batch, count = len(momentum), loops * int(steps.sum())
    marks = np.unique(np.linspace(0, count, _MARKS).astype(np.int64)) if moving else _NO_MARKS
    states = np.zeros((batch, 7, 4))
    states[:, :, 3] = 1.0
    states[:, [4, 5, 6], [0, 1, 2]] = 0.5 * _TURN
    quaternions, seen = np.zeros((batch, 4 * count + 1, 4)), np.empty((batch, 4 * count + 1 if moving else 1, 3))
    quaternions[:, 0, 3], seen[:, 0] = 1.0, directions
    turns, dynamics = np.zeros((2, batch, 4 * count))
    measured, marked = np.zeros((batch, 4)), np.empty((batch, len(marks), 4, 4))
    at = 0
    blocks = list(_blocks(steps, loops))
    run_progress.begin(run_progress.STEPPING, len(blocks))
    for first, stop, times in blocks:
        channels, finer, finest, other = (
            stage_channels(which, widths, factor * steps, factor * first, factor * stop)
            for which, factor in ((series, 1), (series, 2), (series, 4), (changed, 1))
        )
        block = channels, finer, finest, other, times

        def attempt(rows: slice, block: tuple[Any, ...] = block, at: int = at) -> None:
            step_kernel.attempt(
                *block, magnitudes[rows], directions[rows], marks, at, states[rows],
                quaternions[rows], seen[rows], turns[rows], dynamics[rows], measured[rows], marked[rows],
            )  # fmt: skip

        for _ in in_threads(attempt, batch, threads):
            pass
        at += times * (stop - first)
        run_progress.advance(1)
    coarse, fine, sampling, turned = measured.T
    growth = largest_growth(marked) if moving else np.ones(batch)
    return Attempt(
        4 * steps, quaternions, seen if moving else seen[:, :0], turns, dynamics, coarse, fine, sampling, turned, growth
    )


def largest_growth(marked: Array) -> Array:
    """The largest growth of a small turn from one mark to a later one, from attitudes and turned ones: (B, M, 4, 4) -> (B,).

    The turns by which an error is known are propagators P; from one mark to a later one an error grows by P_j P_i^-1,
    whose determinant is one, and whose singular values are s, 1 and 1/s: s follows from the sum of the squares of its
    entries.
    """
    base, others = marked[:, :, :1], marked[:, :, 1:]
    matrices = np.swapaxes(small_turns(np.broadcast_to(base, others.shape), others), -1, -2) / _TURN
    a, b, c = (matrices[..., k, :] for k in range(3))
    inverses = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-1)
    largest = np.ones(len(marked))
    for later in range(1, marked.shape[1]):
        products = matrices[:, later, None] @ inverses[:, :later]
        squares = 0.5 * ((products * products).sum(axis=(-1, -2)) - 1.0)
        largest = np.maximum(largest, squares.max(axis=1))
    largest = np.where(np.isfinite(largest), largest, np.inf)
    return np.sqrt(largest + np.sqrt(largest * largest - 1.0))


def _cross(a: Array, b: Array) -> Array:
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def small_turns(start: Array, end: Array) -> Array:
    """From quaternions xyzw to others near them, body axes: (..., 4), (..., 4) -> (..., 3) [rad]."""
    # A quaternion and its negative are one attitude.
    return np.copysign(1.0, (start * end).sum(axis=-1, keepdims=True)) * _twice_turned(start, end)


def largest_angle(first: Array, second: Array) -> Array:
    """Between quaternions near each other: (B, K, 4), (B, K, 4) -> (B,) [rad]."""
    turns = small_turns(first, second)
    return np.sqrt((turns * turns).sum(axis=-1).max(axis=-1, initial=0.0))


def momentum_slope(interpolant: Interpolant, steps: Integers, momentum: Array) -> Array:
    """How the end turns, S exp(hat(slope dPi)), by a change dPi of the momentum at the start: (B, 3) -> (B, 3, 3).

    By an imaginary change so small that its square is nothing: what is imaginary in the result is the derivative.
    """
    magnitudes, directions = magnitudes_and_directions(momentum)
    still = magnitudes == 0.0
    scale = np.where(still, 1.0, magnitudes)
    directions = np.where(still[:, None], 0.0, directions)[:, None] + (1j * _IMAGINARY) * np.eye(3)
    ends = _marched(interpolant, interpolant.coefficients, steps, np.repeat(scale, 3), directions.reshape(-1, 3), None)
    end = ends[:, -1].reshape(-1, 3, 4)
    turns = _twice_turned(end.real, end.imag / (_IMAGINARY * scale[:, None, None]))
    return np.swapaxes(turns, -1, -2)


def _twice_turned(start: Array, end: Array) -> Array:
    """Twice the vector of the quaternion start^-1 end: (..., 4), (..., 4) -> (..., 3)."""
    u, p, v, q = start[..., :3], start[..., 3:], end[..., :3], end[..., 3:]
    return 2.0 * (p * v - q * u - _cross(u, v))


def part_channels(interpolant: Interpolant, starts: Array, lengths: Array) -> Array:
    """The channels at the stages of steps from starts (N,) [s] on, times their lengths (N,) [s]: (N, STAGES, 9)."""
    panel = interpolant.panel_of(starts + 0.5 * lengths)
    times = starts[:, None] + lengths[:, None] * step_kernel.NODES
    return interpolant.channels(times, panel) * lengths[:, None, None]
