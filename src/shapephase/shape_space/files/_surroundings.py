"""Samples before and after those that are kept: what is cut off a recording is smoothed before it is cut."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ...arrays import Array, Mask
from ...errors import TrajectoryError, TrajectoryWarning
from ..ball_columns import ball_columns
from ._recording import Recording
from ._times import part_of
from .smoothing import Recorded

_GAP = 5.0
"""Usual steps; what is farther from its neighbour is no more a part of the same motion."""


def surrounded(
    samples: Recorded,
    kept: Recording,
    untrimmed: Callable[[], Recording],
    shapes_of: Callable[[Recording], Array],
) -> Recorded:
    """The samples that are kept with those that the file has before and after them, as far as these can be read.

    Parameters
    ----------
    kept : what `samples` are of
    untrimmed : the whole recording, where that can be read
    shapes_of : the joints of a recording (N, n) [rad or m]
    """
    # Nobody has asked for these samples: what is doubtful or wrong in them is not reported.
    with suppress(TrajectoryError), warnings.catch_warnings():
        warnings.simplefilter("ignore", TrajectoryWarning)
        whole = untrimmed()
        first = list(whole.table.rows).index(kept.table.rows[0])
        past = first + len(samples.times)
        start, stop = _readable(whole, first, past)
        if (start, stop) != (first, past):
            part = part_of(whole, np.arange(start, stop))
            inside = slice(first - start, past - start)
            shapes = _signed_as(samples, shapes_of(part), inside)
            return Recorded(part.times, shapes, samples.noise, samples.joint_names, inside)
    return samples


def _readable(whole: Recording, first: int, past: int) -> tuple[int, int]:
    """From where and up to where samples follow each other without a gap, and all of them are numbers."""
    steps = np.diff(whole.times)
    usual = float(np.median(steps[first : past - 1]))
    apart = np.flatnonzero(steps > _GAP * usual)
    broken = np.flatnonzero(~_are_numbers(whole))
    before = np.concatenate([apart[apart < first] + 1, broken[broken < first] + 1, [0]])
    after = np.concatenate([apart[apart >= past - 1] + 1, broken[broken >= past], [len(whole.times)]])
    return int(before.max()), int(after.min())


def _are_numbers(whole: Recording) -> Mask:
    """Which samples are numbers in every column: (N,)."""
    table = whole.table
    more = (table.base_quat_xyzw, table.base_position)
    columns = [*table.columns.values(), *(values for values in more if values is not None)]
    found = np.ones(len(whole.times), dtype=bool)
    for values in columns:
        found &= np.isfinite(values).reshape(len(found), -1).all(axis=1)
    return found


def _signed_as(samples: Recorded, shapes: Array, inside: slice) -> Array:
    """Quaternions with the signs that those that are kept have."""
    found = shapes.copy()
    for ball in ball_columns(samples.joint_names):
        if found[inside, ball][0] @ samples.shapes[0, ball] < 0.0:
            found[:, ball] *= -1.0
    return found
