"""The attitude of many deformations, one momentum each, stepped one after another by the same plan."""

from __future__ import annotations

from .jit import kernel
from .march_kernel import march_momenta


@kernel
def march_variants(
    widths, series, perturbed, steps, loops, directions, magnitudes, marks, lanes, most_segments,
    quaternions, ends, turns, dynamics, propagators, stepping, truncation,
):  # fmt: skip
    """As `march_momenta`, each momentum on series of its own: (V, P, n * 9)."""
    for row in range(len(series)):
        one = slice(row, row + 1)
        march_momenta(
            widths, series[row], perturbed[row], steps, loops, directions[one], magnitudes[one], marks, lanes,
            most_segments, quaternions[one], ends[one], turns[one], dynamics[one], propagators[one], stepping[one],
            truncation[one],
        )  # fmt: skip
