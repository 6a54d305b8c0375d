"""Samples before and after those that are kept: what is cut off a recording is smoothed before it is cut."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection
from contextlib import suppress

import numpy as np

from ...arrays import Integers
from ...errors import TrajectoryError, TrajectoryWarning
from ._joint_columns import Matched
from .recording import Recording
from .times import part_of

_GAP = 5.0
"""Usual steps; what is farther from its neighbour is no more a part of the same motion."""


def surrounded(
    kept: Recording,
    motion: Matched,
    untrimmed: Callable[[], Recording],
    match: Callable[[Recording], tuple[Recording, Matched]],
    fill: float | None,
) -> tuple[Recording, Matched, slice]:
    """The samples that are kept with those that the file has before and after them, and which of these are kept.

    Parameters
    ----------
    kept, motion : the samples that are kept
    untrimmed : the whole recording, where that can be read
    match : the joints and the base of a recording
    fill : the longest gap that is bridged [s], or None
    """
    # Nobody has asked for these samples: what is doubtful or wrong in them is not reported.
    with suppress(TrajectoryError), warnings.catch_warnings():
        warnings.simplefilter("ignore", TrajectoryWarning)
        whole = untrimmed()
        first = list(whole.table.rows).index(kept.table.rows[0])
        start, stop = _readable(whole, first, first + len(kept.times), _broken(whole, motion.left_out, fill))
        part, around = match(part_of(whole, np.arange(start, stop)))
        begin = list(part.table.rows).index(kept.table.rows[0])
        return part, around, slice(begin, begin + len(kept.times))
    return kept, motion, slice(None)


def _readable(whole: Recording, first: int, past: int, broken: Integers) -> tuple[int, int]:
    """From where and up to where samples follow each other without a gap, and all of them are numbers."""
    steps = np.diff(whole.times)
    usual = float(np.median(steps[first : past - 1]))
    apart = np.flatnonzero(steps > _GAP * usual)
    before = np.concatenate([apart[apart < first] + 1, broken[broken < first] + 1, [0]])
    after = np.concatenate([apart[apart >= past - 1] + 1, broken[broken >= past], [len(whole.times)]])
    return int(before.max()), int(after.min())


def _broken(whole: Recording, left_out: Collection[str], fill: float | None) -> Integers:
    """Samples that are no numbers in some column, and not bridged."""
    table = whole.table
    more = (table.base_quat_xyzw, table.base_position)
    columns = [values for label, values in table.columns.items() if label not in left_out]
    missing = np.zeros(len(whole.times) + 2, dtype=bool)
    for values in (*columns, *(values for values in more if values is not None)):
        missing[1:-1] |= ~np.isfinite(values).reshape(len(whole.times), -1).all(axis=1)
    edges = np.flatnonzero(np.diff(missing.astype(int))).reshape(-1, 2)
    for first, past in edges.tolist():
        if fill is not None and first > 0 and past < len(whole.times):
            missing[first + 1 : past + 1] = whole.times[past] - whole.times[first - 1] > fill
    return np.flatnonzero(missing[1:-1])
