"""Steps over the series of a deformation: attitudes from I^-1 and I^-1 L_o."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from threading import RLock
from typing import Any, NamedTuple

import numpy as np

from .. import run_progress, so3
from ..arrays import Array, Integers
from ..chebyshev import chebyshev
from .interpolant import Interpolant
from .kernels import spectra_kernel, step_kernel
from .machine_code import expect_work

_AT_ONCE = 4000  # steps whose channels are in memory: four times as many take some 16 megabytes
_FEW = 24  # steps of a panel up to which the matrix of their channels is kept: half a megabyte at most
_TURN = 1e-7  # [rad] of the starts that show the growth of errors: its square is as small as rounding
_MARKS = 17  # times between which the growth of errors is measured, the start included
_JOBS = 12  # steps taken side by side for each of the coarsest
_IMAGINARY = 1e-60  # part of a direction, for derivatives: its square vanishes, and products stay far above underflow
_LEAST_FOR_A_THREAD = 64  # rows: some tenths of a millisecond of work
_MOST_AT_ONCE = 8192  # rows in one call: some tenths of a second, after which a run that is watched reports progress


class Block(NamedTuple):
    """Steps whose channels are in memory together: those of panels `low` to `high`, or some of one panel's."""

    low: int
    high: int
    begin: int  # of the steps of the first panel
    end: int
    loops: int


def _blocks(steps: Integers, loops: int) -> Iterator[Block]:
    """All steps of all loops."""
    ends = np.cumsum(steps)
    if ends[-1] <= _AT_ONCE:
        yield Block(0, len(steps), 0, int(steps[0]), loops)
        return
    for _ in range(loops):
        low = 0
        while low < len(steps):
            before = ends[low] - steps[low]
            high = max(low + 1, int(np.searchsorted(ends, before + _AT_ONCE, side="right")))
            for begin in range(0, int(steps[low]), _AT_ONCE) if high == low + 1 else (0,):
                yield Block(low, high, begin, min(begin + _AT_ONCE, int(steps[low])), 1)
            low = high


def stage_channels(
    series: Array, widths: Array, steps: Integers, block: Block, factors: tuple[int, ...] = (1,)
) -> tuple[Array, Integers]:
    """The channels at the stages of steps, times their lengths, and the steps of each panel: (K, STAGES, 9), (P,).

    Series (P, n, 9), widths (P,) [s] and steps (P,) are those of the panels of one loop. Each panel has first its
    steps, then for each further factor so many times as many.
    """
    part = slice(block.low, block.high)
    scaled, counts = series[part] * widths[part, None, None], steps[part]
    terms = series.shape[1]
    if block.end - block.begin < counts[0]:
        matrix = np.concatenate([_matrix(terms, int(f * counts[0]), f * block.begin, f * block.end) for f in factors])
        return (matrix @ scaled[0]).reshape(-1, step_kernel.STAGES, 9), np.array([block.end - block.begin])
    distinct = sorted(set(counts.tolist()))
    if len(distinct) == 1:
        return (_matrix_of_panel(terms, distinct[0], factors) @ scaled).reshape(-1, step_kernel.STAGES, 9), counts
    sizes = sum(factors)
    channels, starts = (
        np.empty((sizes * int(counts.sum()), step_kernel.STAGES, 9)),
        sizes * (np.cumsum(counts) - counts),
    )
    for count in distinct:
        rows = np.flatnonzero(counts == count)
        values = (_matrix_of_panel(terms, count, factors) @ scaled[rows]).reshape(len(rows), sizes * count, -1, 9)
        channels[starts[rows, None] + np.arange(sizes * count)] = values
    return channels, counts


def _matrix(terms: int, count: int, begin: int, end: int) -> Array:
    """Matrix from a panel's series to its channels at the stages of some of `count` steps, times their share of it."""
    places = (np.arange(begin, end)[:, None] + step_kernel.NODES).ravel()
    return chebyshev(np.clip(2.0 * places / count - 1.0, -1.0, 1.0), terms) / count


def _matrix_of_panel(terms: int, count: int, factors: tuple[int, ...]) -> Array:
    return (_kept_matrix if count <= _FEW else _kept_matrix.__wrapped__)(terms, count, factors)


@lru_cache(maxsize=128)
def _kept_matrix(terms: int, count: int, factors: tuple[int, ...]) -> Array:
    return np.concatenate([_matrix(terms, f * count, 0, f * count) for f in factors])


def stepped_quaternions(
    interpolant: Interpolant, series: Array, steps: Integers, momentum: Array, start: Array | None = None
) -> Array:
    """Attitudes at the ends of steps of all loops, quaternions xyzw: (B, K + 1, 4).

    Series (P, n, 9) and steps (P,) are those of the interpolant's panels, `momentum` (B, 3) the body's at the start
    [kg m^2/s], `start` (B, 4) its attitudes; None: the identity.
    """
    return _stepped_quaternions(interpolant, series, steps, *magnitudes_and_directions(momentum), start)


def _stepped_quaternions(
    interpolant: Interpolant, series: Array, steps: Integers, magnitudes: Array, directions: Any, start: Array | None
) -> Any:
    """Attitudes of `stepped_quaternions`; directions may be complex, for a derivative."""
    count = interpolant.loops * int(steps.sum())
    quaternions = np.zeros((len(magnitudes), count + 1, 4), dtype=directions.dtype)
    quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0] if start is None else start
    at = 0
    expect_work(steps=count * len(magnitudes))
    blocks = list(_blocks(steps, interpolant.loops))
    run_progress.begin(run_progress.STEPPING, len(blocks))
    for block in blocks:
        channels, _ = stage_channels(series, interpolant.widths, steps, block)

        def integrate(rows: slice, channels: Array = channels, loops: int = block.loops, at: int = at) -> None:
            step_kernel.integrate_steps(channels, loops, magnitudes[rows], directions[rows], at, quaternions[rows])

        for _ in in_threads(integrate, len(magnitudes)):
            pass
        at += block.loops * len(channels)
        run_progress.advance(1)
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
    """Steps of some momenta, and their distances from coarser ones and from those on perturbed series.

    steps : (P,) on each panel of a loop, four times those requested
    quaternions, directions, turns, dynamics : those of `SteppedRotation`
    coarse, fine : (B,) largest angle between a fourth and half as many steps, and between these and all [rad]
    sampling : (B,) between steps on the series and on those with their probable errors [rad]
    turned : (B,) the sum of all turns [rad]
    amplification : (B,) of an error, from one time to a later one
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
    amplification: Array


def attempted(
    interpolant: Interpolant, changed: Array, steps: Integers, momentum: Array, threads: int | None
) -> Attempt:
    """Take so many steps (P,) on each panel, twice and four times as many, for momenta (B, 3)."""
    magnitudes, directions = magnitudes_and_directions(momentum)
    series, widths, loops = interpolant.coefficients, interpolant.widths, interpolant.loops
    moving = bool(magnitudes.any())
    batch, count = len(momentum), loops * int(steps.sum())
    marks = np.unique(np.linspace(0, count, _MARKS if moving else 0).astype(np.int64))
    states = np.zeros((batch, 7, 4))
    states[:, :, 3] = 1.0
    states[:, [4, 5, 6], [0, 1, 2]] = 0.5 * _TURN
    quaternions, seen = np.zeros((batch, 4 * count + 1, 4)), np.empty((batch, 4 * count + 1 if moving else 1, 3))
    # Without momentum the direction stays as it is.
    quaternions[:, 0, 3], seen[:] = 1.0, directions[:, None]
    turns, dynamics = np.zeros((2, batch, 4 * count))
    measured, marked = np.zeros((batch, 4)), np.empty((batch, len(marks), 4, 4))
    of_rows = states, quaternions, seen, turns, dynamics, measured, marked
    at = 0
    expect_work(steps=_JOBS * count * batch)
    blocks = list(_blocks(steps, loops))
    run_progress.begin(run_progress.STEPPING, len(blocks))
    for block in blocks:
        channels, counts = stage_channels(series, widths, steps, block, (1, 2, 4))
        other, _ = stage_channels(changed, widths, steps, block, (2,))
        begun: Callable[..., None] = partial(step_kernel.attempt, channels, other, counts, block.loops)

        def attempt(rows: slice, begun: Callable[..., None] = begun, at: int = at) -> None:
            begun(magnitudes[rows], directions[rows], marks, at, *[part[rows] for part in of_rows])

        for _ in in_threads(attempt, batch, threads):
            pass
        at += block.loops * int(counts.sum())
        run_progress.advance(1)
    coarse, fine, sampling, turned = measured.T
    amplification = np.ones(batch)
    if moving:
        spectra_kernel.growths(marked, _TURN, amplification)
    return Attempt(
        steps=4 * steps,
        quaternions=quaternions,
        directions=seen if moving else seen[:, :0],
        turns=turns,
        dynamics=dynamics,
        coarse=coarse,
        fine=fine,
        sampling=sampling,
        turned=turned,
        amplification=amplification,
    )


def small_turns(start: Array, end: Array) -> Array:
    """Turns from quaternions xyzw to others near them, body axes: (..., 4), (..., 4) -> (..., 3) [rad]."""
    # A quaternion and its negative are one attitude.
    return np.copysign(1.0, (start * end).sum(axis=-1, keepdims=True)) * _twice_turned(start, end)


def largest_angle(first: Array, second: Array) -> Array:
    """Largest angle between quaternions near each other: (B, K, 4), (B, K, 4) -> (B,) [rad]."""
    turns = small_turns(first, second)
    return np.sqrt((turns * turns).sum(axis=-1).max(axis=-1, initial=0.0))


def momentum_slope(interpolant: Interpolant, steps: Integers, momentum: Array) -> Array:
    """Turn of the end, S exp(hat(slope dPi)), by a change dPi of the momentum at the start: (B, 3) -> (B, 3, 3).

    An imaginary change so small that its square vanishes: the imaginary part of the result is the derivative.
    """
    magnitudes, directions = magnitudes_and_directions(momentum)
    still = magnitudes == 0.0
    scale = np.where(still, 1.0, magnitudes)
    directions = np.where(still[:, None], 0.0, directions)[:, None] + (1j * _IMAGINARY) * np.eye(3)
    ends = _stepped_quaternions(
        interpolant, interpolant.coefficients, steps, np.repeat(scale, 3), directions.reshape(-1, 3), None
    )
    end = ends[:, -1].reshape(-1, 3, 4)
    turns = _twice_turned(end.real, end.imag / (_IMAGINARY * scale[:, None, None]))
    return np.swapaxes(turns, -1, -2)


def _twice_turned(start: Array, end: Array) -> Array:
    """Twice the vector of the quaternion start^-1 end: (..., 4), (..., 4) -> (..., 3)."""
    u, p, v, q = start[..., :3], start[..., 3:], end[..., :3], end[..., 3:]
    return 2.0 * (p * v - q * u - so3.cross(u, v))


def part_channels(interpolant: Interpolant, starts: Array, lengths: Array) -> Array:
    """The channels at the stages of steps from starts (N,) [s] on, times their lengths (N,) [s]: (N, STAGES, 9)."""
    panel = interpolant.panel_of(starts + 0.5 * lengths)
    times = starts[:, None] + lengths[:, None] * step_kernel.NODES
    return interpolant.channels(times, panel) * lengths[:, None, None]


def in_threads(run: Callable[[slice], None], batch: int, threads: int | None = None) -> Iterator[slice]:
    """Compute all rows, some in each call of `run`, which frees the interpreter; yield the rows after each call.

    Calls run in at most so many threads where there are enough rows; None: one thread for each processor. Each computes
    rows of its own, so that results do not depend on how many there are.
    """
    workers = max(1, min(processors() if threads is None else threads, batch // _LEAST_FOR_A_THREAD))
    count = max(1, min(-(-batch // workers), _MOST_AT_ONCE))
    parts = [slice(first, min(first + count, batch)) for first in range(0, max(batch, 1), count)]
    results = map(run, parts) if workers == 1 or len(parts) == 1 else _pool(workers).map(run, parts)
    for rows, _ in zip(parts, results, strict=True):
        yield rows


@lru_cache(maxsize=4)
def _pool(workers: int) -> ThreadPoolExecutor:
    """Threads that wait for the next call: to start them takes as long as a hundred momenta."""
    return ThreadPoolExecutor(workers)


def _free_after_fork() -> None:
    """Drop the threads that a child of this process does not have, and the locks that they held."""
    _pool.cache_clear()
    if sys.version_info >= (3, 12):
        return
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == __name__.partition(".")[0]:
            for kind in list(vars(module).values()):
                for attribute in list(vars(kind).values()) if isinstance(kind, type) else ():
                    if isinstance(attribute, cached_property):
                        # Held while a value is computed, for all objects of the class (bpo-43468).
                        vars(attribute)["lock"] = RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_free_after_fork)


@lru_cache(maxsize=1)
def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
