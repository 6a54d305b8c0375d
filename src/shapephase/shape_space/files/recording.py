"""Content of a motion file before its columns are matched to joints, and checks that all kinds of file share."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...arguments import check_time_steps
from ...arrays import Array, Integers, Mask
from ...errors import InputFileNotFoundError, TrajectoryError, TrajectoryWarning
from ...files import no_such_file

if TYPE_CHECKING:
    from ._segment_poses import SegmentMotion
    from .formats.nameless_joints import NamelessJoints

OFF_UNIT = 1e-3  # allowed error of a quaternion's length: recordings keep as few as three digits
NEARLY_UNIT = (
    0.1  # the same of splines between unit quaternions, which are shorter, and where an audit looks for faults
)
LONGEST_NAME = 256  # characters of a column's name, as of a joint's name in a body's file
_UNEVEN_STEPS = 100.0  # over the median step, or under it: a gap, or one sample recorded twice


class Rates(NamedTuple):
    """Rates of a whole floating body at N samples.

    base : (N, 3) angular velocity of the base [rad/s]
    joints : (N, n) derivatives of the body's coordinates [rad/s or m/s], of a ball joint those of its quaternion
    base_axes, velocity_axes : "base" or "world", the axes of the velocities of the base
    velocity : (N, 3) of the base's origin [m/s], or None
    """

    base: Array
    joints: Array
    base_axes: str
    velocity: Array | None = None
    velocity_axes: str = "world"


class Simulated(NamedTuple):
    """Rates and step in arrays of a whole floating body, beside its coordinates.

    rates : of all samples, where they are stored
    step : of the integrator that made them [s], where it is stored
    """

    rates: Rates | None
    step: float | None


@dataclass(frozen=True, eq=False, kw_only=True)
class SegmentPoses:
    """Poses of k segments at N times.

    turns : (N, k, 3, 3) segment axes to the room's; NaN where they were not recorded
    origins : (N, k, 3) or None [m]
    stands : name of a calibration pose of the file -> turns (k, 3, 3) and origins (k, 3)
    at_centres : True if origins are centres of mass, else they are joints
    of_model : kind of model whose links the segments are: "opensim", "mvnx" or None
    in_metres : True if the file states the unit of lengths
    """

    names: tuple[str, ...]
    turns: Array
    origins: Array | None
    stands: Mapping[str, tuple[Array, Array]] | None = None
    at_centres: bool = False
    of_model: str | None = None
    in_metres: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Columns of a file, under the labels they have there.

    where : the file, for messages
    format : the kind of file, for people
    columns : label -> (N,) as they stand there; NaN where no number does
    rows : (N,) the numbers of the samples in messages
    row : the word for a sample in messages, "row" or "point"
    times : (N,) [s]; None: one of the columns has them
    clock : (N,) times as the file gives them; None: these times, or that column
    by_format : True if the kind of file fixes times in seconds, and angles in radians or `degrees`
    degrees : True if turning joints are in degrees; None: the file should state it and does not
    units : label -> unit, where it is stated elsewhere than in the label
    faults : label -> sample -> entry that is no number, for the first of them
    base_quat_xyzw : (N, 4) as recorded, or None
    base_position : (N, 3) [m] or None
    momentum : (3,) that the file states [kg m^2/s], or None
    up : the axis that the kind of file has upwards; None: it has none
    unread : name -> kind, of arrays and other entries of the file that are no columns
    left_out : label -> why it was left out, of columns without motion
    numbered : True if columns have no names, but numbers from 1
    nameless : how columns of an array without names became those of joints; None: they have names
    unnamed : unread matrices as long as the columns, whose columns have no names
    zero_pose : True if all angles of the first sample are zero: the pose that exporters put before a motion
    simulated : rates and step of arrays of a whole floating body; None: they are not
    poses : of segments, before these have become joints
    segments : angular momentum of segments and joints, after that
    """

    where: str
    format: str
    columns: dict[str, Array]
    rows: Sequence[int]
    row: str = "row"
    times: Array | None = None
    clock: Array | None = None
    by_format: bool = False
    degrees: bool | None = False
    units: Mapping[str, str] = field(default_factory=dict)
    faults: Mapping[str, Mapping[int, str]] = field(default_factory=dict)
    base_quat_xyzw: Array | None = None
    base_position: Array | None = None
    momentum: Array | None = None
    up: str | None = None
    unread: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    numbered: bool = False
    unnamed: Sequence[str] = ()
    nameless: NamelessJoints | None = None
    zero_pose: bool = False
    simulated: Simulated | None = None
    poses: SegmentPoses | None = None
    segments: SegmentMotion | None = None

    def check_column(self, label: str) -> None:
        """Raise TrajectoryError for the first entry of a column that is not a finite number."""
        missing = np.flatnonzero(self.missing(label))
        if len(missing):
            raise self._not_a_number(label, int(missing[0]))

    def missing(self, label: str) -> Mask:
        """True for samples without an entry: (N,). Raises TrajectoryError for words and infinite numbers."""
        values = self.columns[label]
        wrong = [*self.faults.get(label, {}), *np.flatnonzero(np.isinf(values)).tolist()]
        if wrong:
            raise self._not_a_number(label, min(wrong))
        return np.isnan(values)

    def _not_a_number(self, label: str, sample: int) -> TrajectoryError:
        text = self.faults.get(label, {}).get(sample, str(self.columns[label][sample]))
        return not_a_number(text, f"{self.where}: {self.row} {self.rows[sample]}, column {label!r}")

    def kept(self, samples: Integers) -> Table:
        """Some of the samples, by their places."""
        places = samples.tolist()
        new = {old: k for k, old in enumerate(places)}
        faults = {
            label: {new[k]: text for k, text in entries.items() if k in new} for label, entries in self.faults.items()
        }
        arrays = {
            name: None if (values := getattr(self, name)) is None else values[samples]
            for name in ("times", "clock", "base_quat_xyzw", "base_position")
        }
        return replace(
            self,
            columns={label: values[samples] for label, values in self.columns.items()},
            rows=[self.rows[k] for k in places],
            faults=faults,
            zero_pose=self.zero_pose and places[:1] == [0],
            simulated=None,
            **arrays,
        )


@dataclass(frozen=True, eq=False)
class Recording:
    """A table whose times are known.

    times : (N,) from 0 [s]
    first, last : of the times kept, as the file gives them
    """

    table: Table
    times: Array
    first: float
    last: float
    time_unit: str

    @property
    def clock(self) -> Array:
        """Times as the file gives them: (N,)."""
        clock = self.table.times if self.table.clock is None else self.table.clock
        assert clock is not None
        return clock

    def place(self, index: int) -> str:
        """The file and the sample, for messages."""
        return f"{self.table.where}: {self.table.row} {self.table.rows[index]}"


def checked_quaternions(quaternions: Array, recording: Recording, owner: str, tolerance: float) -> Array:
    """Quaternions x y z w (N, 4) with the length 1. Raises TrajectoryError where one is farther from it."""
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(quaternions, axis=-1)
    worst = int(np.argmax(np.abs(lengths - 1.0)))
    if not abs(lengths[worst] - 1.0) <= tolerance:
        raise TrajectoryError(
            f"{recording.place(worst)}: the quaternion x y z w of {owner} has the norm {lengths[worst]:.6g}; 1 is "
            "needed"
        )
    return quaternions / lengths[:, None]


def listed(names: Iterable[str], most: int) -> str:
    """Names for a message, at most so many of them."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def warn(message: str) -> None:
    """Issue a `TrajectoryWarning`."""
    warnings.warn(message, TrajectoryWarning, stacklevel=6)


def file_bytes(where: Path) -> bytes:
    """Content of a regular file. Raises InputFileNotFoundError if it is not there, no file, or not to be opened."""
    if not os.path.isfile(where):
        raise InputFileNotFoundError(f"{where}: is no regular file") if os.path.exists(where) else no_such_file(where)
    try:
        return where.read_bytes()
    except OSError as error:
        raise InputFileNotFoundError(f"{where}: cannot be opened ({error.strerror})") from None


def digest(where: Path) -> str:
    """The SHA-256 of a file; of a folder, that of the lines `<SHA-256>  <name>` of its files by name."""
    if where.is_dir():
        lines = [f"{digest(part)}  {part.name}\n" for part in sorted(where.iterdir())]
        return hashlib.sha256("".join(lines).encode()).hexdigest()
    with where.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def check_text(data: bytes, where: Path) -> None:
    """Raise TrajectoryError where bytes are no UTF-8 text or hold a NUL."""
    try:
        data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TrajectoryError(
            f"{where}: not UTF-8 text, byte {error.start} (0x{data[error.start]:02x}) cannot be read; save it as UTF-8"
        ) from None
    zero = data.find(b"\0")
    if zero >= 0:
        raise TrajectoryError(f"{where}: byte {zero} is NUL, so this is no text")


def number(entry: str, place: str) -> float:
    """A finite number, strictly written. Raises TrajectoryError that begins with `place`."""
    try:
        # Python's own reading also takes 1_000 and digits of other scripts.
        value = float(entry) if entry.isascii() and "_" not in entry else np.nan
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise not_a_number(entry, place)
    return float(value)


def not_a_number(entry: str, place: str) -> TrajectoryError:
    """The error for an entry that is not a finite number."""
    text = entry.strip()
    shown = repr(text if len(text) < 40 else text[:40] + "...")
    remedy = "write a number, or leave the cell empty where nothing was recorded"
    if is_blank(text):
        remedy = "fill the gap or drop the row"
    elif text.replace(",", "").lstrip("+-").isdigit():
        remedy = "write it with a decimal point, as the others, and without marks of thousands"
    return TrajectoryError(f"{place}: {shown} is no finite number; {remedy}")


def times_from_zero(times: Array, where: str, row: str, rows: Sequence[int]) -> Array:
    """Times checked and shifted to start at 0: (N,) -> (N,) [s].

    Raises TrajectoryError if there are fewer than two, they do not ascend, or their differences are not finite. Warns
    where one step is more than a hundred times as long, or as short, as most and as those beside it, or where numbers
    so far from zero resolve the steps badly.
    """
    if len(times) < 2:
        raise TrajectoryError(f"{where}: two samples or more are needed, got {len(times)}; give a longer motion")
    with np.errstate(over="ignore"):
        steps, shifted = np.diff(times), times - times[0]
    late = np.flatnonzero(steps <= 0.0)
    if len(late):
        i = int(late[0]) + 1
        raise TrajectoryError(
            f"{where}: {row} {rows[i]}: time {times[i]:.9g} s does not come after {times[i - 1]:.9g} s; sort the "
            f"{row}s and drop repeated times"
        )
    if not np.isfinite(shifted[-1]) or np.any(np.diff(shifted) <= 0.0):
        raise TrajectoryError(
            f"{where}: times from {times[0]:.9g} s to {times[-1]:.9g} s are not distinct in double precision"
        )
    check_time_steps(shifted, f"{where}: ")
    if np.spacing(np.abs(times).max()) > 1e-6 * steps.min():
        warn(
            f"{where}: times near {times[-1]:.9g} s resolve only {np.spacing(np.abs(times).max()):.2g} s of steps of "
            f"{steps.min():.3g} s; subtract the start before the file is written"
        )
    usual = float(np.median(steps))
    # Steps that shrink or grow one by one, as towards a kink, are meant.
    longer = np.maximum(np.append(steps[1:], 0.0), np.append(0.0, steps[:-1]))
    gaps = steps > _UNEVEN_STEPS * np.maximum(usual, longer)
    doubled = _UNEVEN_STEPS * steps < np.minimum(usual, longer)
    for odd, meaning in (
        (gaps, "a gap in the recording? The path is interpolated across it"),
        (doubled, "the same sample twice? Rates there may be far too large"),
    ):
        if odd.any():
            i = int(np.argmax(np.where(odd, np.abs(np.log(steps / usual)), -1.0)))
            warn(
                f"{where}: {steps[i]:.6g} s between {row} {rows[i]} and {row} {rows[i + 1]}, where the usual step is "
                f"{usual:.6g} s: {meaning}"
            )
    return shifted


def is_blank(text: str) -> bool:
    """True for an entry that stands for a missing number."""
    return text.strip().lower() in ("", "nan", "-nan", ".nan", "na", "n/a", "<na>", "nat", "null", "none", "~")
