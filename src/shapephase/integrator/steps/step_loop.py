"""The attitude equation stepped on an interpolant three times, so that the differences tell the errors.

All steps; two of them at a time; these pairs on series with errors like those they probably have. Without momentum,
where steps cost little: all steps; twice as many; all steps on these other series. Machine code takes them where there
is some (`fast.marches`). Without it each march of a few momenta is one CasADi call after another, and the steps of many
are taken on whole arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import run_progress
from ...arrays import Array, Integers
from ..fast import engine
from ..fast.marches import march_in_threads, quaternions_at_rest
from ..interpolant import Interpolant
from .array_marches import quaternions_of_many, record_many
from .casadi_marches import quaternions_of_few, quaternions_of_one_loop, record_of_few
from .rotation_step import product
from .stage_channels import channels_at_stages, channels_of_runs, runs_of_panels
from .step_record import CHECKPOINTS, StepRecord, checkpoint_steps, ends_of_pairs

# Momenta: up to so many, one after another in CasADi is faster than all at once on NumPy's arrays.
FEW = 24
# Momenta on arrays at once, so that the arrays of one step stay in the processor's cache.
_ROWS_AT_ONCE = 2048


def integrate_steps(
    interpolant: Interpolant,
    perturbed: Array | None,
    steps: Integers,
    directions: Array,
    magnitudes: Array,
    *,
    with_propagators: bool = True,
    threads: int | None = None,
) -> StepRecord:
    """All steps of all loops, starting at the identity.

    Parameters
    ----------
    perturbed : (P, n, 9) the interpolant's coefficients with errors like those they probably have; None: not marched on
    steps : (P,) at least two, on each panel of one loop
    directions : (B, 3) Pi/|Pi| at the start
    magnitudes : (B,) of the momentum [kg m^2/s]
    with_propagators : whether to integrate the error propagators too
    threads : at most, in machine code; None: one for each processor
    """
    if engine.is_ready():
        return _by_kernel(interpolant, perturbed, steps, directions, magnitudes, with_propagators, threads)
    total, batch = interpolant.loops * sum(steps.tolist()), len(magnitudes)
    series, runs = interpolant.coefficients * interpolant.widths[:, None, None], runs_of_panels(steps)
    channels, coarse = channels_of_runs(series, runs), channels_of_runs(series, runs, in_pairs=True)
    cut = None if perturbed is None else channels_at_stages(interpolant, perturbed, steps, in_pairs=True)
    ends, loops = ends_of_pairs(steps, interpolant.loops), interpolant.loops
    # All steps, pairs of them, and these again where series are perturbed.
    at_once = 1 if batch <= FEW else _ROWS_AT_ONCE
    run_progress.begin(run_progress.STEPPING, -(-batch // at_once) * total * (3 if perturbed is None else 4) // 2)
    if batch <= FEW:
        starts = directions, magnitudes
        whole = record_of_few(channels, loops, *starts, with_propagators=with_propagators)
        pairs = quaternions_of_few(coarse, loops, *starts)
        whole.stepping[:] = largest_angle(whole.quaternions[:, ends], pairs)
        if cut is not None:
            whole.truncation[:] = largest_angle(pairs, quaternions_of_few(cut, loops, *starts))
        return whole
    whole = StepRecord.empty(batch, total, CHECKPOINTS if with_propagators else 0)
    for first in range(0, batch, at_once):
        rows = slice(first, first + at_once)
        starts = directions[rows], magnitudes[rows]
        # Steps that are far too long overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            record_many(whole, rows, channels, loops, *starts)
            pairs = quaternions_of_many(coarse, loops, *starts)
            whole.stepping[rows] = largest_angle(whole.quaternions[rows][:, ends], pairs)
            if cut is not None:
                whole.truncation[rows] = largest_angle(pairs, quaternions_of_many(cut, loops, *starts))
    return whole


def integrate_steps_at_rest(interpolant: Interpolant, perturbed: Array | None, steps: Integers) -> StepRecord:
    """As `integrate_steps` without momentum: a batch of one.

    The equation is linear, so steps do not depend on each other, and a further loop repeats the rotation of the first:
    it costs no steps.
    """
    run_progress.begin(run_progress.STEPPING, int(steps.sum()) * (3 if perturbed is None else 4))
    coefficients = interpolant.coefficients
    whole = _quaternions_at_rest(interpolant, coefficients, steps)
    finer = _quaternions_at_rest(interpolant, coefficients, 2 * steps)
    truncation = 0.0
    if perturbed is not None:
        truncation = largest_angle(whole, _quaternions_at_rest(interpolant, perturbed, steps))
    nothing = np.zeros((1, len(whole) - 1))
    return StepRecord(
        quaternions=whole[None],
        directions=np.empty((1, 0, 3)),
        turns=nothing,
        dynamics=nothing,
        propagators=np.empty((1, 0, 3, 3)),
        stepping=np.array([largest_angle(whole, finer[::2])]),
        truncation=np.array([truncation]),
    )


def quaternions_alone(
    interpolant: Interpolant,
    coefficients: Array,
    steps: Integers,
    directions: Array | None = None,
    magnitudes: Array | None = None,
) -> Array:
    """At the ends of all steps, other series in the interpolant's place: (B, K + 1, 4), nothing else being integrated.

    Parameters as of `integrate_steps`; no directions and magnitudes: without momentum, B = 1.
    """
    run_progress.begin(run_progress.STEPPING, interpolant.loops * int(steps.sum()))
    if directions is None or magnitudes is None:
        return _quaternions_at_rest(interpolant, coefficients, steps)[None]
    if engine.is_ready():
        widths, none = np.diff(interpolant.edges[: len(steps) + 1]), np.zeros(0, dtype=int)
        record = march_in_threads(
            widths, coefficients, None, steps, interpolant.loops, directions, magnitudes, marks=none
        )
        return record.quaternions
    channels, loops = channels_at_stages(interpolant, coefficients, steps), interpolant.loops
    if len(magnitudes) <= FEW:
        return quaternions_of_few(channels, loops, directions, magnitudes)
    parts = (slice(first, first + _ROWS_AT_ONCE) for first in range(0, len(magnitudes), _ROWS_AT_ONCE))
    return np.concatenate([quaternions_of_many(channels, loops, directions[rows], magnitudes[rows]) for rows in parts])


def largest_angle(a: Array, b: Array) -> Any:
    """The largest angle between attitudes that are near each other: (..., K, 4) quaternions -> (...) [rad]."""
    apart = a - b
    largest = np.vecdot(apart, apart).max(axis=-1)
    if not largest.max(initial=0.0) <= 1.0:
        # A quaternion and its negative are one attitude.
        opposite = a + b
        nearer = np.minimum(np.vecdot(apart, apart), np.vecdot(opposite, opposite))
        largest = nearer.max(axis=-1)
    return 2.0 * np.sqrt(largest)


def _by_kernel(
    interpolant: Interpolant,
    perturbed: Array | None,
    steps: Integers,
    directions: Array,
    magnitudes: Array,
    with_propagators: bool,
    threads: int | None,
) -> StepRecord:
    widths, loops = interpolant.widths, interpolant.loops
    marks = checkpoint_steps(loops * int(steps.sum())) if with_propagators else np.zeros(0, dtype=int)
    return march_in_threads(
        widths, interpolant.coefficients, perturbed, steps, loops, directions, magnitudes, marks=marks, threads=threads
    )


def _quaternions_at_rest(interpolant: Interpolant, coefficients: Array, steps: Integers) -> Array:
    """At the ends of all steps without momentum: (loops K + 1, 4)."""
    if engine.is_ready():
        quaternions = quaternions_at_rest(interpolant.widths, coefficients, steps)
        run_progress.advance(len(quaternions) - 1)
    else:
        half_rates = coefficients[:, :, 6:] * (-0.5 * interpolant.widths)[:, None, None]
        quaternions = quaternions_of_one_loop(channels_of_runs(half_rates, runs_of_panels(steps)))
    return _repeated(quaternions, interpolant.loops) if interpolant.loops > 1 else quaternions


def _repeated(quaternions: Array, loops: int) -> Array:
    """The first loop's quaternions after 0, 1, 2 ... loops, the last of each being the first of the next."""
    x, y, z, w = quaternions[-1]
    sine = np.sqrt(x * x + y * y + z * z)
    half = np.arctan2(sine, w) * np.arange(loops)
    axis = quaternions[-1, :3] / sine if sine > 0.0 else np.zeros(3)
    powers = np.concatenate([np.sin(half)[:, None] * axis, np.cos(half)[:, None]], axis=1)
    further = np.stack(product(list(powers.T[:, :, None]), list(quaternions[1:].T)), axis=-1).reshape(-1, 4)
    return np.concatenate([quaternions[:1], further])
