"""The march in machine code: many momenta side by side, in threads."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ... import run_progress
from ...arrays import Array, Integers
from ..steps.step_record import StepRecord
from ._plain import plain
from .threads import in_threads

# Steps of a chunk, whose channels stay in the processor's cache: for many momenta, and where a loop is repeated.
_SEGMENTS_OF_MANY = 8
_SEGMENTS_OF_LOOPS = 64


def march_in_threads(
    widths: Array,
    coefficients: Array,
    perturbed: Array | None,
    steps: Integers,
    loops: int,
    directions: Array,
    magnitudes: Array,
    *,
    marks: Integers,
    threads: int | None = None,
) -> StepRecord:
    """All steps of all loops, starting at the identity; a momentum's results do not depend on the others.

    Parameters
    ----------
    widths : (P,) of the panels [s]
    coefficients, perturbed : (P, n, 9) Chebyshev series of I^-1 and I^-1 L_o, and the same with some terms changed;
        None: not marched on
    steps : (P,) at least two, on each panel of one loop
    directions : (B, 3) of the momenta at the start
    magnitudes : (B,) of the momenta [kg m^2/s]
    marks : (M,) after how many steps, ascending, the error propagators are kept; none: they are not integrated
    threads : how many at most; None: one for each processor
    """
    batch, count = len(magnitudes), loops * int(steps.sum())
    whole = StepRecord.empty(batch, count, len(marks))
    module = _kernels()
    path = (
        plain(widths),
        plain(coefficients).reshape(len(widths), -1),
        np.empty((0, 1)) if perturbed is None else plain(perturbed).reshape(len(widths), -1),
        np.array(steps, dtype=np.int64),
        loops,
    )
    starts, sizes, places = plain(directions), plain(magnitudes), np.array(marks, dtype=np.int64)
    lanes = 1 if batch == 1 else module.LANES
    segments = segments_of(batch, loops)
    propagators = whole.propagators.reshape(batch, len(marks), 9)

    def run(rows: slice) -> None:
        module.march_momenta(
            *path, starts[rows], sizes[rows], places, lanes, segments,
            whole.quaternions[rows], whole.directions[rows], whole.turns[rows], whole.dynamics[rows],
            propagators[rows], whole.stepping[rows], whole.truncation[rows],
        )  # fmt: skip

    run_progress.begin(run_progress.STEPPING, max(batch, 1))
    fresh = whole.quaternions, whole.directions, whole.turns, whole.dynamics, propagators
    for rows in in_threads(run, batch, module.LANES, threads, fresh):
        run_progress.advance(rows.stop - rows.start)
    return whole


def quaternions_at_rest(widths: Array, coefficients: Array, steps: Integers) -> Array:
    """At the ends of all steps of one loop without momentum, from the identity: (K + 1, 4)."""
    quaternions = np.empty((int(steps.sum()) + 1, 4))
    series = plain(coefficients).reshape(len(widths), -1)
    _kernels().march_at_rest(plain(widths), series, np.array(steps, dtype=np.int64), quaternions)
    return quaternions


def growths_and_rounding(propagators: Array, quaternions: Array, threads: int | None = None) -> tuple[Array, Array]:
    """The largest growth of an error from one mark to a later one, and what the rounding of all steps grows to.

    Parameters
    ----------
    propagators : (B, M, 3, 3); without any nothing grows
    quaternions : (B, K + 1, 4) at the ends of steps
    threads : how many at most; None: one for each processor

    Returns
    -------
    growths, infinite where not known, and rounding [rad]: (B,) each
    """
    batch, find = len(quaternions), _growth_kernel().growths_and_rounding
    growths, rounding = np.empty(batch), np.empty(batch)
    matrices, ends = plain(propagators).reshape(*propagators.shape[:2], 9), plain(quaternions)

    def run(rows: slice) -> None:
        find(matrices[rows], ends[rows], growths[rows], rounding[rows])

    for _ in in_threads(run, batch, 1, threads):
        pass
    return growths, rounding


def derivatives(
    channels: Array, loops: int, direction: Array, seeds: Array, magnitude: float, marks: Integers
) -> tuple[Array, Array]:
    """Quaternions after some steps and their derivatives by the momentum's direction at the start: (M, 4), (M, S, 4).

    Parameters
    ----------
    channels : (K, 108) of one loop, at the stages one after another, times the step's length
    direction : (3,) of the momentum at the start
    seeds : (S, 3) its changes
    magnitude : of the momentum [kg m^2/s]
    marks : (M,) after how many steps, ascending
    """
    quaternions, slopes = np.empty((len(marks), 4)), np.empty((len(marks), len(seeds), 4))
    places = np.array(marks, dtype=np.int64)
    _derivative_kernel().step_derivatives(
        plain(channels), loops, plain(direction), plain(seeds), float(magnitude), places, quaternions, slopes
    )
    return quaternions, slopes


@lru_cache(maxsize=1)
def _derivative_kernel() -> Any:
    return import_module(".kernels.derivative_kernel", __package__)


@lru_cache(maxsize=1)
def _kernels() -> Any:
    return import_module(".kernels.march_kernel", __package__)


@lru_cache(maxsize=1)
def _growth_kernel() -> Any:
    return import_module(".kernels.growth_kernel", __package__)


def warm() -> None:
    """Call the kernels with the least that they take."""
    width, series, steps = np.ones(1), np.zeros((1, 1, 9)), np.array([2])
    direction, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(0, dtype=np.int64)
    march_in_threads(width, series, None, steps, 1, direction, np.ones(1), marks=none)
    quaternions_at_rest(width, series, steps)
    growths_and_rounding(np.zeros((1, 1, 3, 3)), np.zeros((1, 1, 4)))
    derivatives(np.zeros((1, 108)), 1, direction[0], direction, 1.0, steps)


def segments_of(batch: int, loops: int) -> int:
    """How many segments a chunk of steps has."""
    return _SEGMENTS_OF_LOOPS if loops > 1 else 1 if batch == 1 else _SEGMENTS_OF_MANY
