"""Tables of pandas or xarray, of a caller or read from a file, as columns; ROS messages printed as tables."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from ....errors import TrajectoryError
from ..labels import IN_A_SECOND, joint_part, unit_of
from ..recording import OFF_UNIT, Table
from .column_tables import column_table

_PANDAS = ("DataFrame",)
_XARRAY = ("Dataset", "DataArray")
_STAMPS = (("sec", "nanosec"), ("secs", "nsecs"))  # names of the two parts of a ROS stamp
_NANO = int(IN_A_SECOND["ns"])
_NAMES = ("name", "joint", "joint_name", "jointname")  # columns that name the joint of a row
_VALUES = ("position", "pos", "angle", "joint_position")  # columns with its coordinate
_STAMP = 3  # columns of a header: seconds, nanoseconds, frame
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_MATRIX = 36  # entries of a covariance
_LISTED = re.compile(r"(?P<stem>(?:.*[./])?)(?P<kind>name|position|velocity|effort)\[?(?P<number>\d+)\]?")
Columns = list[tuple[str, Any]]


def is_frame(value: object) -> bool:
    """True for a table of pandas or xarray."""
    return _is(value, "pandas", _PANDAS) or _is(value, "xarray", _XARRAY)


def read_frame(frame: Any) -> Table:
    """Columns of a `DataFrame`, whose index may hold the times, or of a `Dataset` or `DataArray` along time.

    Attributes `units` of variables of xarray are their units. In a two-dimensional array, the coordinate of the second
    dimension names the joints.
    """
    if not _is(frame, "pandas", _PANDAS):
        return _of_xarray(frame)
    if "format" in frame.attrs:
        return file_table(frame, frame.attrs.get("file", "the DataFrame"))
    columns: list[tuple[object, Any]] = []
    for k, label in enumerate(frame.columns):
        # Several levels are parts of one name.
        name = "/".join(str(part) for part in label if str(part)) if isinstance(label, tuple) else label
        columns.append((str(name) if isinstance(name, int | np.integer) else name, frame.iloc[:, k].to_numpy()))
    index, numbered = frame.index, frame.columns.dtype.kind in "iu"
    values = index.to_numpy() if index.nlevels == 1 else None
    if values is not None and index.name is not None:
        columns.insert(0, (str(index.name), values))
    elif values is not None and (values.dtype.kind in "mM" or (values.dtype.kind == "f" and not numbered)):
        columns.insert(0, ("time", values))
    table = column_table("the DataFrame", "pandas", columns)
    return replace(table, numbered=numbered)


def file_table(frame: Any, where: str) -> Table:
    """The table of a frame that `read_table` has read: its head, and the numbers of its rows."""
    head = frame.attrs
    frame, of_joints = _one_row_a_sample(frame, where)
    columns, dropped = _with_names([(str(label), frame.iloc[:, k].to_numpy()) for k, label in enumerate(frame)], where)
    columns, left_out = echoed_columns(columns) if head.get("numbered") else listed_names(columns)
    table = column_table(
        where,
        head["format"],
        _stamped(columns, head.get("rate")),
        units=head.get("units"),
        rows=[int(k) for k in frame.index],
        row=head.get("row", "row"),
        comma=head.get("comma", False),
    )
    numbered = bool(head.get("numbered")) and not left_out
    return replace(table, numbered=numbered, left_out=of_joints | dropped | left_out)


def _one_row_a_sample(frame: Any, where: str) -> tuple[Any, dict[str, str]]:
    """A table with one row for each joint and sample, `time,name,position`, as one with a column for each joint.

    Returns the columns left out, too: other quantities of each joint.
    """
    lower = {str(label).strip().lower(): label for label in frame}
    name = next((lower[word] for word in _NAMES if word in lower), None)
    value = next((lower[word] for word in _VALUES if word in lower), None)
    if name is None or value is None or frame[name].dtype.kind in "fiu":
        return frame, {}
    joints = frame[name].astype(str).to_numpy()
    first = list(dict.fromkeys(joints.tolist()))
    count = len(first)
    if count < 2:
        return frame, {}
    wrong = np.flatnonzero(joints != np.resize(np.array(first), len(joints)))
    if len(wrong) or len(joints) % count:
        row = int(frame.index[wrong[0] if len(wrong) else -1])
        raise TrajectoryError(
            f"{where}: column {name!r} names a joint in each row, and row {row} does not go on as the first {count} "
            "rows begin: write the rows of each sample in one order, or a table with one column for each joint"
        )
    of_joints = {}
    for label in frame.columns.drop([name, value]):
        texts = frame[label].astype(str).to_numpy().reshape(-1, count)
        part = joint_part(f"joint/{label}", ("joint",))
        if (part is not None and part[1]) or (texts != texts[:, :1]).any():
            of_joints[str(label)] = "of each joint, no position"
    wide = frame.iloc[::count].drop(columns=[name, value, *of_joints])
    for place, joint in enumerate(first):
        wide[joint] = frame[value].to_numpy()[place::count]
    return wide, of_joints


def _is(value: object, package: str, kinds: tuple[str, ...]) -> bool:
    return any(
        parent.__name__ in kinds and parent.__module__.split(".")[0] == package for parent in type(value).__mro__
    )


def _with_names(columns: Columns, where: str) -> tuple[Columns, dict[str, str]]:
    """Columns that have names, and the meaning of those without one: an index that was written, or nothing."""
    named: Columns = []
    dropped: dict[str, str] = {}
    has_times = any(name.lower().startswith("time") for name, _ in columns)
    for place, (name, values) in enumerate(columns):
        if name:
            named.append((name, values))
        elif _is_empty(values):
            continue
        elif place == 0 and _counts(values):
            dropped["column 1"] = "counts the rows"
        elif place == 0 and not has_times:
            named.append(("time", values))
        else:
            raise TrajectoryError(f"{where}: column {place + 1} has no name in the header; write one, or drop it")
    return named, dropped


def _counts(values: Any) -> bool:
    """True for whole numbers, one after the other from 0 or 1: R writes them in quotation marks."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return bool(len(numbers) and numbers[0] in (0.0, 1.0) and (np.diff(numbers) == 1.0).all())


def _is_empty(values: Any) -> bool:
    return values.dtype.kind == "f" and bool(np.isnan(values).all())


def _stamped(columns: Columns, rate: float | None) -> Columns:
    """Columns with one of times in place of the two parts of a stamp, or of frames with their rate."""
    by_name = dict(columns)
    if rate is not None and "Frame" in by_name:
        others = [(name, values) for name, values in columns if name not in ("Frame", "Sub Frame")]
        return [("time [s]", np.asarray(by_name["Frame"], dtype=np.float64) / rate), *others]
    for name, seconds in columns:
        for whole, part in _STAMPS:
            other = name.removesuffix(whole) + part
            if not name.endswith(whole) or other not in by_name:
                continue
            nano = by_name[other]
            if seconds.dtype.kind in "iu" and nano.dtype.kind in "iu":
                others = [column for column in columns if column[0] not in (name, other)]
                return [("time [ns]", seconds * _NANO + nano), *others]
    return columns


def _of_xarray(data: Any) -> Table:
    where = f"the {type(data).__name__}"
    arrays = dict(data.data_vars) if type(data).__name__ == "Dataset" else {str(data.name or "data"): data}
    dimensions = {array.dims[0] for array in arrays.values() if array.dims}
    if len(dimensions) != 1 or any(array.ndim not in (1, 2) for array in arrays.values()):
        listed = ", ".join(f"{name} {array.dims}" for name, array in arrays.items())
        raise TrajectoryError(
            f"{where}: variables along one dimension, the time, or along it and the joints, are needed; there are "
            f"{listed}"
        )
    (dimension,) = dimensions
    columns: list[tuple[object, Any]] = []
    units: dict[str, str] = {}

    def keep(name: object, values: Any, attributes: Any) -> None:
        columns.append((name, values))
        # Climate data write the unit of times before the day that they count from.
        unit = unit_of(str(attributes.get("units", "")).split(" since ")[0])
        if unit is not None:
            units[str(name)] = unit

    if dimension in data.coords:
        keep(str(dimension), data.coords[dimension].to_numpy(), data.coords[dimension].attrs)
    for name, array in arrays.items():
        if array.ndim == 1:
            keep(str(name), array.to_numpy(), array.attrs)
            continue
        second = array.dims[1]
        if second not in array.coords:
            raise TrajectoryError(
                f"{where}: the dimension {second!r} of {name} has no coordinate that names the joints; add one"
            )
        for k, joint in enumerate(array.coords[second].to_numpy().tolist()):
            keep(joint, np.asarray(array[:, k]), array.attrs)
    return column_table(where, "xarray", columns, units=units, row="sample")


def echoed_columns(columns: Columns) -> tuple[Columns, dict[str, str]]:
    """Columns of messages that `ros2 topic echo --csv` prints without a header; and why others were left out.

    A `JointState` is stamp, names, positions, velocities and efforts; a `PoseStamped` stamp, place and quaternion; an
    `Odometry` has a second frame, and covariances behind its pose. Anything else stays as it is.
    """
    values = [entries for _, entries in columns]
    if len(values) <= _STAMP or not _is_stamp(values[0], values[1]):
        return columns, {}
    is_number = [entries.dtype.kind in "fiu" and not _is_empty(entries) for entries in values[2:]]
    texts = is_number.index(True) if True in is_number else 0
    rest = values[2 + texts :]
    is_pose = _is_pose(rest, texts)
    if is_pose:
        names, others = [f"base_{name}" for name in _POSE], "covariance and velocities"
    elif texts > 1 and len(rest) >= texts - 1:
        constants = [_constant(entries) for entries in values[_STAMP : 2 + texts]]
        names, others = [name for name in constants if name is not None], "velocities and efforts"
        if len(names) < len(constants):
            return columns, {}
    else:
        return columns, {}
    time = ("time [ns]", values[0].astype(np.int64) * _NANO + values[1].astype(np.int64))
    more = len(rest) - len(names)
    left_out = {others: f"{more} numbers of each message, left out"} if more else {"frame_id": "text"}
    return [time, *zip(names, rest)], left_out


def listed_names(columns: Columns) -> tuple[Columns, dict[str, str]]:
    """Columns `position3` beside a column `name3` under that name, as `rostopic echo -p` prints a `JointState`."""
    matches = {label: match for label, _ in columns if (match := _LISTED.fullmatch(label)) is not None}
    names = {
        (match["stem"], match["number"]): _constant(values)
        for label, values in columns
        if (match := matches.get(label)) is not None and match["kind"] == "name" and values.dtype.kind not in "fiub"
    }
    named: Columns = []
    left_out: dict[str, str] = {}
    for label, values in columns:
        match = matches.get(label)
        name = None if match is None else names.get((match["stem"], match["number"]))
        if match is None or name is None:
            named.append((label, values))
        elif match["kind"] == "position":
            named.append((name, values))
        elif match["kind"] != "name":
            left_out[label] = f"{match['kind']} of {name}"
    return named, left_out


def _is_stamp(seconds: Any, nano: Any) -> bool:
    whole = seconds.dtype.kind in "iu" and nano.dtype.kind in "iu"
    return bool(whole and len(nano) and nano.min() >= 0 and nano.max() < _NANO and (np.diff(seconds) >= 0).all())


def _is_pose(rest: list[Any], texts: int) -> bool:
    """True where numbers behind the frames are a place and a quaternion of unit length."""
    if texts > 2 or len(rest) not in (len(_POSE), len(_POSE) + _MATRIX, len(_POSE) + 2 * _MATRIX + 6):
        return False
    lengths = np.linalg.norm(
        np.stack([np.asarray(entries, dtype=np.float64) for entries in rest[3 : len(_POSE)]]), axis=0
    )
    return bool((np.abs(lengths - 1.0) < OFF_UNIT).all())


def _constant(values: Any) -> str | None:
    """The text that stands in all rows, or None."""
    texts = {str(entry).strip() for entry in values}
    return texts.pop() if len(texts) == 1 else None
