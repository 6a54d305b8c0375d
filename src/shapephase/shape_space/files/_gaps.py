"""Gaps of a recording: samples at which a column has no number, bridged where they are short."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array, Integers, Mask
from ...errors import TrajectoryError
from .labels import seconds
from .recording import Recording, Table, listed

UNRESOLVED = 2.0 * np.pi / 3.0  # [rad] a larger rotation across a gap has an unknown direction
ROUNDING = 1e-9  # relative excess of a sum of time steps
_MOST_SHOWN = 4  # columns and gaps that an error lists


def fill_argument(fill: float | str | None) -> float | None:
    """The longest gap that is bridged [s]. Raises TrajectoryError."""
    longest = None if fill is None else seconds(fill, "fill")
    if longest is not None and longest <= 0.0:
        raise TrajectoryError(f"fill: a time above zero is needed, such as 0.1 or '100ms', got {fill!r:.40}")
    return longest


class Gaps:
    """Samples that columns of a recording lack, and their bridges.

    longest : gap that is bridged [s], from the last number before it to the first one after it; None: none is
    """

    def __init__(self, recording: Recording, longest: float | None) -> None:
        self._recording = recording
        self._longest = longest
        self._missing: dict[str, Mask] = {}
        self._method: dict[str, str] = {}

    def held(self, table: Table, label: str) -> Array:
        """A column with the last number before it in each gap, which `bridged` and `turned` then replace."""
        if label not in self._missing:
            self._missing[label] = table.missing(label)
        missing = self._missing[label]
        if missing.all():
            raise TrajectoryError(
                f"{table.where}: column {label!r} has no number; leave it out with names={{{label!r}: None}} (--names "
                f"{label}=), and say where its joint rests (rest, --rest)"
            )
        if not missing.any():
            return table.columns[label]
        source = np.where(missing, 0, np.arange(len(missing)))
        first = np.flatnonzero(~missing)[0]
        source[:first] = first
        return table.columns[label][np.maximum.accumulate(source)]

    def joined(self, table: Table, labels: Sequence[str]) -> None:
        """Let columns of one rotation or place have their gaps together."""
        for label in labels:
            self.held(table, label)
        together = np.asarray(np.logical_or.reduce([self._missing[label] for label in labels]), dtype=np.bool_)
        self._missing.update(dict.fromkeys(labels, together))

    def bridged(self, labels: Sequence[str], values: Array) -> Array:
        """Values (N, ...) of joined columns, in their gaps those of the cubic spline through the others."""
        from scipy.interpolate import CubicSpline

        missing = self._inside(labels[0])
        if not missing.any():
            return values
        self._method |= dict.fromkeys(labels, "cubic spline")
        known, times = ~self._missing[labels[0]], self._recording.times
        filled = values.copy()
        filled[missing] = CubicSpline(times[known], values[known])(times[missing])
        return filled

    def turned(self, labels: Sequence[str], turns: Array) -> Array:
        """Rotations (N, 3, 3) of joined columns, in their gaps those of the C2 rotation spline through the others."""
        from scipy.spatial.transform import Rotation, RotationSpline

        missing = self._inside(labels[0])
        if not missing.any():
            return turns
        self._method |= dict.fromkeys(labels, "rotation spline")
        samples, times = np.flatnonzero(~self._missing[labels[0]]), self._recording.times
        known = turns[samples]
        steps = so3.angle(so3.transpose(known[:-1]) @ known[1:])
        wide = np.flatnonzero((np.diff(samples) > 1) & (steps > UNRESOLVED))
        if len(wide):
            before, after = int(samples[wide[0]]), int(samples[wide[0] + 1])
            raise TrajectoryError(
                f"{self._recording.table.where}: {_columns(labels)} turn by {np.degrees(steps[wide[0]]):.3g} deg "
                f"across the gap {self._span(before, after)}: which way round is unknown; keep a stretch without it "
                f"(trim, {self._trim_option(before, after)})"
            )
        filled = turns.copy()
        filled[missing] = RotationSpline(times[samples], Rotation.from_matrix(known))(times[missing]).as_matrix()
        return filled

    def settled(self) -> tuple[Integers, dict[str, Any] | None]:
        """The samples without gaps at the ends, and what was filled and cut, ready for JSON."""
        ends = {label: np.flatnonzero(~missing)[[0, -1]].tolist() for label, missing in self._missing.items()}
        count = len(self._recording.times)
        low = max((first for first, _ in ends.values()), default=0)
        high = min((last for _, last in ends.values()), default=count - 1)
        gaps: dict[tuple[int, int], list[str]] = {}
        for label in self._missing:
            edges = np.flatnonzero(np.diff(np.concatenate([[0], self._inside(label).astype(int), [0]])))
            for first, past in edges.reshape(-1, 2).tolist():
                if past > low and first <= high:
                    gaps.setdefault((first - 1, past), []).append(label)
        outer = [
            (end, [label for label, both in ends.items() if both[which] == at], edge, at)
            for which, end, edge, at in ((0, "start", 0, low), (1, "end", count - 1, high))
            if at != edge
        ]
        if not gaps and not outer:
            return np.arange(count), None
        self._check(gaps, outer)
        if high - low < 1:
            raise TrajectoryError(
                f"{self._recording.table.where}: no two samples are left between the gaps at the start and at the end"
            )
        clock = self._recording.clock
        filled = [
            {
                "columns": labels,
                "after": float(clock[before]),
                "until": float(clock[after]),
                "seconds": self._length(before, after),
                "samples": after - before - 1,
                "by": self._method[labels[0]],
            }
            for (before, after), labels in sorted(gaps.items())
        ]
        cut = [
            {"columns": labels, "at": end, "samples": abs(at - edge), "from": float(clock[at])}
            for end, labels, edge, at in outer
        ]
        return np.arange(low, high + 1), {"filled": filled, "cut": cut}

    def _check(self, gaps: dict[tuple[int, int], list[str]], outer: Sequence[tuple[str, list[str], int, int]]) -> None:
        """Raise TrajectoryError for gaps longer than those to be bridged."""
        lengths = {gap: self._length(*gap) for gap in gaps}
        longest = -1.0 if self._longest is None else self._longest * (1.0 + ROUNDING)
        refused = sorted(gap for gap, length in lengths.items() if length > longest)
        where = self._recording.table.where
        if refused:
            shown = [f"{_columns(gaps[gap])} {self._span(*gap)}" for gap in refused[:_MOST_SHOWN]]
            more = f"; and {len(refused) - len(shown)} more" if len(refused) > len(shown) else ""
            beyond = "" if self._longest is None else f"; longer than the {self._longest:g} s to be bridged"
            need = f"{np.ceil(1e3 * max(lengths.values()) * (1.0 - ROUNDING)) / 1e3:g}"
            raise TrajectoryError(
                f"{where}: no number in {'; '.join(shown)}{more}{beyond}; bridge gaps of that length with fill={need} "
                f"(--fill {need}s), or keep a stretch without them (trim, {self._trim_option(*refused[0])})"
            )
        if outer and self._longest is None:
            end, labels, edge, at = outer[0]
            raise TrajectoryError(
                f"{where}: no number in {_columns(labels)} at the {end}, "
                f"{self._rows(min(edge, at + 1), max(edge, at - 1))}; cut such ends off with fill=0.1 (--fill 0.1s), "
                "which also bridges gaps of up to that length"
            )

    def _inside(self, label: str) -> Mask:
        """Missing samples with numbers before and after them."""
        missing = self._missing.get(label)
        if missing is None:
            return np.zeros(len(self._recording.times), dtype=bool)
        known = np.flatnonzero(~missing)
        inside = missing.copy()
        inside[: known[0]] = inside[known[-1] :] = False
        return inside

    def _length(self, before: int, after: int) -> float:
        return float(self._recording.times[after] - self._recording.times[before])

    def _span(self, before: int, after: int) -> str:
        clock, unit, length = self._recording.clock, self._recording.time_unit, self._length(before, after)
        rows = self._rows(before + 1, after - 1)
        return f"from {clock[before]:.9g} to {clock[after]:.9g} {unit} ({rows}, {length:.4g} s)"

    def _rows(self, first: int, last: int) -> str:
        table = self._recording.table
        if first == last:
            return f"{table.row} {table.rows[first]}"
        return f"{table.row}s {table.rows[first]} to {table.rows[last]}"

    def _trim_option(self, before: int, after: int) -> str:
        """The option that keeps the longer side of a gap."""
        clock = self._recording.clock
        first, last = (0, before) if before >= len(clock) - 1 - after else (after, len(clock) - 1)
        return f"--flight {clock[first]:.9g} {clock[last]:.9g}"


def _columns(labels: Sequence[str]) -> str:
    return f"column{'s' if len(labels) > 1 else ''} {listed(map(repr, labels), _MOST_SHOWN)}"
