"""Steps between samples of a recording: a first pose apart from the motion, turns too fast to follow, even steps."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from ... import so3
from ...arrays import Array, Integers
from ...body.body import Body
from ...errors import TrajectoryError, TrajectoryWarning
from ._gaps import ROUNDING, UNRESOLVED
from ._joint_columns import Matched
from .labels import IN_A_SECOND
from .recording import Recording, warn
from .smoothing import filtered, filtered_attitudes
from .times import part_of

_APART = 5.0  # first rate over the largest of the next second: a moving body does not slow down so much
_NEXT = 1.0  # [s]
_FEWEST = 4  # steps in that second: fewer are no recording with small steps
_NO_POSE = 0.02  # [rad or m] a smaller first step is noise, or a body that hardly moves
_DENSER = 1.1  # largest even rate over the usual rate of uneven samples
_GAP = 5.0  # usual steps: samples farther apart belong to different motions


def without_first_pose(recording: Recording, motion: Matched, body: Body) -> tuple[Recording, Matched]:
    """The motion without a pose of zero angles that is apart from all others, which exporters put before it.

    Warns where that pose is left out, and where another first sample is as far from the second.
    """
    later = recording.times[1:-1] - recording.times[1] if len(recording.times) > 2 else np.zeros(0)
    count = int(np.count_nonzero(later < _NEXT))
    if count < _FEWEST:
        return recording, motion
    beginning = motion.kept(np.arange(count + 2))
    lengths = np.diff(recording.times[: count + 2])
    for names, unit, steps in _steps(beginning, body):
        rates = steps.max(axis=1, initial=0.0) / lengths
        if not (rates[0] > _APART * rates[1:].max() and steps[0].max() > _NO_POSE):
            continue
        size = float(steps[0].max())
        shown = f"{np.degrees(size):.3g} deg" if unit == "rad" else f"{size:.3g} {unit}"
        moved = (
            f"{names[int(np.argmax(steps[0]))]} goes {shown} to the next {recording.table.row}, over {_APART:g} times "
            f"the largest step of the next {_NEXT:g} s"
        )
        if recording.table.zero_pose:
            warn(f"{recording.place(0)}: left out: all angles are zero, and {moved}: a pose put before the motion")
            samples = np.arange(1, len(recording.times))
            return part_of(recording, samples), motion.kept(samples)
        warn(
            f"{recording.place(0)}: {moved}: is the first {recording.table.row} a pose that is no part of the motion? "
            "Leave it out with trim (--flight)"
        )
        break
    return recording, motion


def warn_of_fast_turns(recording: Recording, motion: Matched, body: Body) -> None:
    """Issue a TrajectoryWarning where a ball joint turns by about half a turn from one sample to the next."""
    balls = body.chain.follows.balls
    if not balls or len(recording.times) < 2:
        return
    steps = np.stack([_angles(ball.turns(motion.shapes)) for ball in balls], axis=1)
    sample, column = divmod(int(np.argmax(steps)), len(balls))
    if steps[sample, column] < UNRESOLVED:
        return
    clock = recording.first + recording.times[sample + 1] * IN_A_SECOND[recording.time_unit]
    others = int(np.count_nonzero(steps >= UNRESOLVED)) - 1
    warn(
        f"{recording.place(sample + 1)}: {balls[column].name} turns by {np.degrees(steps[sample, column]):.3g} deg "
        f"from {recording.table.row} {recording.table.rows[sample]}, at {clock:.6g} {recording.time_unit}"
        f"{f' ({others} more such steps)' if others else ''}: samples so far apart do not say which way round; the "
        "shorter way is taken"
    )


def evenly_spaced(times: Array, motion: Matched, inside: slice, rate: float) -> tuple[Array, Matched, slice]:
    """A motion at so many even times a second [1/s], by splines through its samples, and which of them are inside."""
    usual = 1.0 / float(np.median(np.diff(times)))
    if rate > _DENSER * usual:
        raise TrajectoryError(
            f"resample: about {usual:.4g} samples a second are recorded, and lowpass takes the noise of each as its "
            f"own; give that rate or less (resample={usual:.4g}, --resample {usual:.4g})"
        )
    start, stop = times[inside][[0, -1]]
    before, past, after = (int((t - start) * rate + ROUNDING) for t in (2.0 * start - times[0], stop, times[-1]))
    at = np.clip(start + np.arange(-before, after + 1) / rate, times[0], times[-1])
    base = motion.base
    if base.attitude is not None:
        turned = RotationSpline(times, Rotation.from_matrix(base.attitude))(at).as_matrix()
        base = replace(base, attitude=turned)
    if base.position is not None:
        base = replace(base, position=CubicSpline(times, base.position)(at))
    shapes, speeds = (CubicSpline(times, values)(at) for values in (motion.shapes, motion.speeds))
    return at - at[0], motion._replace(shapes=shapes, base=base, speeds=speeds), slice(before, before + past + 1)


def low_passed(times: Array, motion: Matched, cut_off: float) -> Matched:
    """The motion with its base filtered: joints are filtered where their path is made."""
    base = motion.base
    if base.attitude is not None:
        base = replace(base, attitude=filtered_attitudes(times, base.attitude, cut_off))
    if base.position is not None:
        base = replace(base, position=filtered(times, base.position, cut_off))
    return motion._replace(base=base)


def _steps(motion: Matched, body: Body) -> list[tuple[list[str], str, Array]]:
    """Names of turning and of sliding parts, unit, and steps from sample to sample: (N - 1, k) [rad or m]."""
    shapes, base = motion.shapes, motion.base
    steps: dict[str, dict[str, Array]] = {"rad": {}, "m": {}}
    for joint, (name, unit) in enumerate(zip(body.joint_names, body.joint_units, strict=True)):
        if unit in steps:
            steps[unit][name] = np.abs(np.diff(shapes[:, joint]))
    for ball in body.chain.follows.balls:
        steps["rad"][ball.name] = _angles(ball.turns(shapes))
    if base.attitude is not None:
        steps["rad"]["the base"] = _angles(base.attitude)
    if base.position is not None:
        steps["m"]["the base"] = np.linalg.norm(np.diff(base.position, axis=0), axis=1)
    return [
        (list(parts), unit, np.array([*parts.values()], dtype=np.float64).reshape(-1, len(shapes) - 1).T)
        for unit, parts in steps.items()
    ]


def _angles(turns: Array) -> Array:
    """Between neighbours: (N, 3, 3) -> (N - 1,) [rad]."""
    return so3.angle(so3.transpose(turns[:-1]) @ turns[1:])


def surrounded(
    kept: Recording,
    motion: Matched,
    untrimmed: Callable[[], Recording],
    match: Callable[[Recording], tuple[Recording, Matched]],
    fill: float | None,
) -> tuple[Recording, Matched, slice]:
    """The samples that are kept with those that the file has before and after them, and which of these are kept."""
    # Faults and doubts of these samples, which the caller left out, are not reported.
    with suppress(TrajectoryError), warnings.catch_warnings():
        warnings.simplefilter("ignore", TrajectoryWarning)
        whole = untrimmed()
        first = list(whole.table.rows).index(kept.table.rows[0])
        past, steps = first + len(kept.times), np.diff(whole.times)
        apart = np.flatnonzero(steps > _GAP * float(np.median(steps[first : past - 1])))
        broken = _broken(whole, motion.left_out, fill)
        start = max([*(apart[apart < first] + 1), *(broken[broken < first] + 1), 0])
        stop = min([*(apart[apart >= past - 1] + 1), *broken[broken >= past], len(whole.times)])
        part, around = match(part_of(whole, np.arange(start, stop)))
        begin = list(part.table.rows).index(kept.table.rows[0])
        return part, around, slice(begin, begin + len(kept.times))
    return kept, motion, slice(None)


def _broken(whole: Recording, left_out: Collection[str], fill: float | None) -> Integers:
    """Samples that lack a number in some column, and are not bridged."""
    table, count = whole.table, len(whole.times)
    columns = [values for label, values in table.columns.items() if label not in left_out]
    columns += [values for values in (table.base_quat_xyzw, table.base_position) if values is not None]
    missing = np.zeros(count + 2, dtype=bool)
    for values in columns:
        missing[1:-1] |= ~np.isfinite(values).reshape(count, -1).all(axis=1)
    edges = np.flatnonzero(np.diff(missing.astype(int))).reshape(-1, 2)
    for first, past in edges.tolist():
        if fill is not None and first > 0 and past < count:
            missing[first + 1 : past + 1] = whole.times[past] - whole.times[first - 1] > fill
    return np.flatnonzero(missing[1:-1])
