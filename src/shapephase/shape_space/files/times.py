"""Times of a table: which column has them and in which unit, and the stretch that is kept."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ...arguments import positive_argument
from ...arrays import Array, Integers, finite_array
from ...errors import ShapeError, TrajectoryError
from ...letters import value_text
from .labels import IN_A_SECOND, in_square_brackets, label, time_unit_argument
from .recording import Recording, Table, listed, times_from_zero

# Names of a column of times, in lower case, without unit and marks between words.
_TIMES = ("time", "times", "t", "timestamp", "timestamps", "stamp", "datetime", "elapsed", "elapsedtime", "timetag")
_EPOCH = (6.3e8, 4.1e9)  # [s] since 1970, from 1990 to 2100, in the unit in which steps are usual ones
_LONG_STEP = 10.0  # [s] joint motions are recorded more often: longer steps have another unit
_LONG_STEP_OF_MANY = 1.0  # [s] in long recordings: milliseconds at a thousand samples a second
_MANY = 10  # samples; a path written by hand has fewer
_USUAL_STEP = 0.1  # [s] joints are recorded ten times a second or more


def recording_of(
    table: Table,
    joint_names: Collection[str],
    names: Mapping[str, str | None],
    time_unit: str | None,
    timestep: float | None,
    trim: tuple[float, float] | None,
) -> Recording:
    """Samples of a table between two of its times, with times that begin at 0.

    joint_names : of the body: a joint of the name `t` is no column of times
    """
    unit = time_unit_argument(time_unit)
    doubtful = False
    if table.times is None:
        column = _time_column(table, joint_names, names)
        table, unit, doubtful = _timed(table, column, unit, timestep)
    else:
        if timestep is not None:
            raise TrajectoryError(f"{table.where}: timestep is for files without times; this one has its times")
        if unit not in (None, "s"):
            raise TrajectoryError(
                f"{table.where}: times of {table.format} files are in s, and time_unit={unit!r} was given"
            )
        unit = "s"
    if trim is not None:
        table = _trimmed(table, trim)
    assert table.times is not None
    times = times_from_zero(table.times, table.where, table.row, table.rows)
    if doubtful and doubtful_steps(times):
        step = float(np.median(np.diff(times)))
        likely = next((unit for unit in ("ms", "us", "ns") if step / IN_A_SECOND[unit] <= _USUAL_STEP), "ns")
        raise TrajectoryError(
            f"{table.where}: {len(times)} samples, one every {step:.6g} s if the times are in seconds; are they in "
            f"{likely}? Give time_unit={likely!r} (--time-unit {likely}), or time_unit='s' for seconds; or write "
            f"the unit into the header, as in `time [{likely}]`"
        )
    first, last = _clock(table)[[0, -1]].tolist()
    return Recording(table, times, first, last, unit)


def part_of(recording: Recording, samples: Integers) -> Recording:
    """Some of the samples of a recording, by their places, with times that begin at 0."""
    table = recording.table.kept(samples)
    first, last = _clock(table)[[0, -1]].tolist()
    times = recording.times[samples]
    return Recording(table, times - times[0], first, last, recording.time_unit)


def samples_within(table: Table, ends: tuple[float, float]) -> Integers:
    """Places of the samples from the first to the last of two times, as the file gives them."""
    clock = _clock(table)
    return np.flatnonzero((clock >= ends[0]) & (clock <= ends[1]))


def doubtful_steps(times: Array) -> bool:
    """True where times [s] would be taken for another unit if the file did not state seconds."""
    step = float(np.median(np.diff(times)))
    return step >= (_LONG_STEP_OF_MANY if len(times) >= _MANY else _LONG_STEP)


def is_clock(text: str) -> bool:
    """True where a label names times, at the end of a topic, too: `__time`, `Time [ms]`, `field.header.stamp`."""
    name = re.split(r"[/.]", label(text).name)[-1]
    return re.sub(r"[\s_%#]", "", name).lower() in _TIMES


def trim_argument(trim: tuple[float, float] | None, name: str = "trim") -> tuple[float, float] | None:
    """Two times, the first before the last. Raises ShapeError."""
    if trim is None:
        return None
    if np.shape(trim) != (2,):
        raise ShapeError(
            f"{name}: two times are needed, as {name}=(0.5, 2.0) (--{name} 0.5 2.0), got {value_text(trim)}"
        )
    first, last = finite_array(trim, name, (2,)).tolist()
    if not first < last:
        raise ShapeError(f"{name}: two times, the first before the last, are needed, got {value_text(trim)}")
    return first, last


def _time_column(table: Table, joint_names: Collection[str], names: Mapping[str, str | None]) -> str | None:
    """Label of the column of times, or None."""
    targets = {text: target for text in table.columns if (target := names.get(text, text)) is not None}
    clocks = [text for text, name in targets.items() if name not in joint_names and is_clock(name)]
    plain = [text for text in clocks if label(targets[text]).name.strip("_% ").lower() == "time"]
    if len(plain) == 1:
        return plain[0]
    if len(clocks) > 1:
        raise TrajectoryError(
            f"{table.where}: columns {' and '.join(map(repr, clocks[:4]))} are both times; leave one out: --names "
            f"'{clocks[-1]}=' (names={{{clocks[-1]!r}: None}})"
        )
    return clocks[0] if clocks else None


def _timed(table: Table, column: str | None, unit: str | None, timestep: float | None) -> tuple[Table, str, bool]:
    """The table with its times, their unit, and True where nothing states it."""
    if column is None:
        if timestep is None:
            shown = listed([name[:40] for name in table.columns], 12)
            raise TrajectoryError(
                f"{table.where}: the header has no column `time`; it reads {shown}. Name the one that has the times: "
                "--names COLUMN=time (names={column: 'time'}); or give the time between samples: --step 0.01 "
                "(timestep=0.01)"
            )
        step = positive_argument(timestep, "timestep")
        return replace(table, times=step * np.arange(len(table.rows))), "s", False
    if timestep is not None:
        raise TrajectoryError(
            f"{table.where}: timestep is for files without times; this one has its times in column {column!r}"
        )
    table.check_column(column)
    stated = table.units.get(column) or label(column).unit or ("s" if table.by_format else None)
    if stated is not None and stated not in IN_A_SECOND:
        raise TrajectoryError(f"{table.where}: column {column!r} is in {stated}, no unit of time")
    if stated is None and in_square_brackets(column) is not None:
        raise TrajectoryError(
            f"{table.where}: column {column!r}: the unit is not known; give time_unit, one of {', '.join(IN_A_SECOND)}"
        )
    if unit is not None and stated is not None and unit != stated:
        raise TrajectoryError(f"{table.where}: column {column!r} is in {stated}, and time_unit={unit!r} was given")
    clock = table.columns[column]
    known = unit or stated or _unit_since_1970(clock)
    size = IN_A_SECOND[known or "s"]
    # In seconds, times since 1970 have seven digits behind the point: their start is taken off in their own unit.
    times = clock / size if size == 1.0 else (clock - clock[0]) / size
    columns = {name: values for name, values in table.columns.items() if name != column}
    return replace(table, columns=columns, times=times, clock=clock), known or "s", known is None


def _unit_since_1970(clock: Array) -> str | None:
    """Unit in which times count from 1970, or None.

    A clock that counts from another day in a smaller unit would have to run for weeks, and take ten thousand samples
    a second, to be taken for this one.
    """
    if len(clock) < 2:
        return None
    with np.errstate(over="ignore"):
        step = float(np.median(np.diff(clock)))
    for unit in ("s", "ms", "us", "ns"):
        size = IN_A_SECOND[unit]
        if _EPOCH[0] <= clock[0] / size <= _EPOCH[1] and 0.0 < step / size <= _USUAL_STEP:
            return unit
    return None


def _clock(table: Table) -> Array:
    times = table.times if table.clock is None else table.clock
    assert times is not None
    return times


def _trimmed(table: Table, trim: tuple[float, float]) -> Table:
    samples, clock = samples_within(table, trim), _clock(table)
    if not len(clock):
        raise TrajectoryError(f"{table.where}: two samples or more are needed, got 0")
    if len(samples) < 2:
        low, high = f"{clock.min():.9g}", f"{clock.max():.9g}"
        raise TrajectoryError(
            f"{table.where}: {len(samples)} samples from {trim[0]:.9g} to {trim[1]:.9g}, two or more are needed; the "
            f"file's own times go from {low} to {high}: trim=({low}, {high}) (--flight {low} {high}) keeps all of it"
        )
    return table.kept(samples)
