"""Channels of a body, I^-1 and I^-1 L_o, at the stages of steps: products of fixed matrices and Chebyshev series."""

from __future__ import annotations

from functools import lru_cache
from itertools import groupby

import numpy as np

from ...arrays import Array, Integers
from ...chebyshev import chebyshev
from ..interpolant import Interpolant
from .rotation_step import STAGES, tableau
from .step_record import ends_of_pairs


def stage_channels(interpolant: Interpolant, steps: Integers) -> Array:
    """Channels at the 12 stages of each step of the first loop, times the step's length: (K, 108)."""
    return channels_at_stages(interpolant, interpolant.coefficients, steps)


def channels_at_stages(
    interpolant: Interpolant, coefficients: Array, steps: Integers, *, in_pairs: bool = False
) -> Array:
    """The same of other series on the interpolant's panels; of each step, or of pairs of them."""
    return channels_of_runs(coefficients * interpolant.widths[:, None, None], runs_of_panels(steps), in_pairs=in_pairs)


def runs_of_panels(steps: Integers) -> list[tuple[int, int]]:
    """Numbers of steps, and on how many panels one after another they are taken: (P,)."""
    return [(count, len(list(run))) for count, run in groupby(steps.tolist())]


def channels_of_runs(scaled: Array, runs: list[tuple[int, int]], *, in_pairs: bool = False) -> Array:
    """Of series times the widths of their panels: (P, n, k) -> (K, 12 k)."""
    _, terms, each = scaled.shape
    if len(runs) == 1:
        return np.matmul(_stage_matrix(terms, runs[0][0], in_pairs), scaled).reshape(-1, each * STAGES)
    matrices = [_stage_matrix(terms, count, in_pairs) for count, _ in runs]
    channels = np.empty((sum(panels * len(matrix) for matrix, (_, panels) in zip(matrices, runs, strict=True)), each))
    panel = row = 0
    for matrix, (_, panels) in zip(matrices, runs, strict=True):
        stop = row + panels * len(matrix)
        out = channels[row:stop].reshape(panels, len(matrix), each)
        np.matmul(matrix, scaled[panel : panel + panels], out=out)
        panel, row = panel + panels, stop
    return channels.reshape(-1, each * STAGES)


@lru_cache(maxsize=512)
def _stage_matrix(degree_count: int, count: int, in_pairs: bool) -> Array:
    """Chebyshev coefficients of a panel -> values at all stages of its steps, times the step's share of it.

    (12 K, degrees), of `count` steps or of pairs of them.
    """
    _, _, c = tableau()
    ends = ends_of_pairs(np.array([count]), 1) if in_pairs else np.arange(count + 1)
    lengths = np.diff(ends)[:, None]
    x = 2.0 * (ends[:-1, None] + lengths * c) / count - 1.0
    values = chebyshev(np.clip(x, -1.0, 1.0), degree_count).reshape(len(lengths), STAGES, degree_count)
    return (values * (lengths / count)[..., None]).reshape(-1, degree_count)
