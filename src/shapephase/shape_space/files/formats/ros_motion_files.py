"""Joint motions that ROS recorded or commands: trajectories and states in YAML and in bags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....errors import TrajectoryError, unknown_name
from ..labels import IN_A_SECOND
from ..recording import Table, check_text, number
from .parser_process import by_library

_STATE = "sensor_msgs/msg/JointState"
_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
_NANO = int(IN_A_SECOND["ns"])
_LATEST = 1e12  # [s] larger times are none
_WRAPPERS = ("goal", "request", "trajectory", "joint_trajectory")  # keys of goals and planners around a trajectory
_UNITS = {"sec": _NANO, "secs": _NANO, "nanosec": 1, "nsecs": 1, "nsec": 1}  # parts of a time -> size [ns]
_MERGE = "<<"  # YAML 1.1 merges the value of this key into its mapping


class _State(NamedTuple):
    """A JointState message: its own time and the one at which it was recorded [ns], some joints."""

    stamp: int
    recorded: int
    names: Sequence[str]
    positions: list[float]


class _Trajectory(NamedTuple):
    """A JointTrajectory message: its time [ns], joints, and of each point its time (ns, s) and positions."""

    stamp: int
    names: Sequence[str]
    times: list[tuple[int, float]]
    positions: list[list[float]]


class Word(str):
    """A value as it was written, and its line: `1e-3` is a text in YAML 1.1, `on` is true and 012 is ten."""

    line: int


def read_ros_yaml(where: Path, data: bytes) -> Table:
    """Motion of a `JointTrajectory` in YAML, bare or in a goal, or documents of several, or of `JointState` messages.

    Several trajectories follow each other by their header stamps; states are merged as in a bag.
    """
    check_text(data, where)
    documents = [_unwrapped(document) for document in yaml_documents(data.decode("utf-8-sig"), str(where))]
    states = [_has(document, "name", "position") for document in documents]
    if not documents or not all(
        state or _has(document, "joint_names", "points") for state, document in zip(states, documents, strict=True)
    ):
        raise TrajectoryError(
            f"{where}: no ROS trajectory; a mapping with `joint_names` and `points` (JointTrajectory), or documents "
            "with `name` and `position` (JointState) are needed"
        )
    if any(states) != all(states):
        raise TrajectoryError(f"{where}: JointState and JointTrajectory messages are mixed; keep one kind")
    if not states[0]:
        trajectories = [_yaml_trajectory(document, where) for document in documents]
        return _of_trajectories(trajectories, str(where), "ROS YAML JointTrajectory")
    messages = []
    for count, document in enumerate(documents, start=1):
        names = _yaml_list(document["name"], f"{where}: message {count}: name", "joint names")
        positions = _yaml_numbers(document["position"], f"{where}: message {count}", "position", names)
        messages.append(_State(_yaml_stamp(document, where), 0, names, positions))
    return _of_states(messages, str(where), "ROS YAML JointState")


def read_bag(where: Path, topic: str | None) -> Table:
    """States or trajectories of one topic of a rosbag1 file, a rosbag2 folder, an MCAP or a SQLite file.

    The time of a state is that of its header, or the time of recording where no header has one. Messages that carry
    some of the joints are merged when together they have all of them at each time. Message definitions in the bag are
    not used: a bag with other definitions of these types is refused.
    """
    if where.is_dir() and not (where / "metadata.yaml").is_file():
        raise TrajectoryError(f"{where}: a folder without metadata.yaml, so no rosbag2; name a file in it")
    with by_library(where, "bag", "rosbags"):
        return _read_messages(where, topic)


def _read_messages(where: Path, topic: str | None) -> Table:
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2
    from rosbags.typesys import Stores, get_typestore

    first = where.suffix.lower() == ".bag" and where.is_file()
    types = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    with Reader1(where) if first else Reader2(where) as reader:
        chosen = _connections(reader.connections, where, topic)
        kind = chosen[0].msgtype
        digest = types.generate_msgdef(kind)[1] if first else types.hash_rihs01(kind)
        for connection in chosen:
            if connection.digest and connection.digest != digest:
                raise TrajectoryError(f"{where}: topic {connection.topic}: not the usual definition of {kind}")
        decode: Any = types.deserialize_ros1 if first else types.deserialize_cdr
        messages = ((time, decode(data, kind)) for _, time, data in reader.messages(chosen))
        label = f"{'rosbag1' if first else 'rosbag2'} {kind.split('/')[-1]}"
        if kind == _STATE:
            states = [
                _State(_bag_time(message.header.stamp), recorded, list(message.name), message.position.tolist())
                for recorded, message in messages
            ]
            return _of_states(states, str(where), label)
        trajectories = [
            _Trajectory(
                _bag_time(message.header.stamp),
                list(message.joint_names),
                [(_bag_time(point.time_from_start), 0.0) for point in message.points],
                [point.positions.tolist() for point in message.points],
            )
            for _, message in messages
        ]
        return _of_trajectories(trajectories, str(where), label)


def _connections(connections: Sequence[Any], where: Path, topic: str | None) -> list[Any]:
    """Connections of the one topic that holds joint motions."""
    motions = [connection for connection in connections if connection.msgtype in (_STATE, _TRAJECTORY)]
    topics = sorted({connection.topic for connection in motions})
    if not topics:
        others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in connections})[:20]) or "none"
        raise TrajectoryError(f"{where}: no topic of type {_STATE} or {_TRAJECTORY}; topics: {others}")
    if topic is not None and topic not in topics:
        raise unknown_name(f"topic with joint motions in {where}", topic, topics)
    if topic is None and len(topics) > 1:
        several = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in motions}))
        raise TrajectoryError(f"{where}: several topics hold joint motions, choose one with topic=: {several}")
    chosen = [connection for connection in motions if connection.topic == (topic or topics[0])]
    if len({connection.msgtype for connection in chosen}) > 1:
        raise TrajectoryError(f"{where}: topic {chosen[0].topic} holds messages of two types")
    return chosen


def _bag_time(time: Any) -> int:
    return time.sec * _NANO + time.nanosec


def _of_states(messages: list[_State], where: str, label: str) -> Table:
    """Messages with some of the joints each, merged by their times."""
    stamped = any(message.stamp for message in messages)
    # A clock may start at zero; a zero later on is a header that was not filled in.
    for count, message in enumerate(messages[1:], start=2):
        if not message.stamp and messages[count - 2].stamp:
            raise TrajectoryError(f"{where}: message {count} has no time in its header, and others have; drop it")
    if messages and not stamped and not any(message.recorded for message in messages):
        raise TrajectoryError(f"{where}: the messages have no times; record them with header stamps")
    joints = list(dict.fromkeys(name for message in messages for name in message.names))
    samples: dict[int, dict[str, float]] = {}
    numbers: dict[int, int] = {}
    for count, (stamp, recorded, names, positions) in enumerate(messages, start=1):
        if len(names) != len(positions):
            raise TrajectoryError(f"{where}: message {count}: {len(names)} joints and {len(positions)} positions")
        time = stamp if stamped else recorded
        sample = samples.setdefault(time, {})
        numbers.setdefault(time, count)
        for name, position in zip(names, positions, strict=True):
            if name in sample:
                raise TrajectoryError(
                    f"{where}: message {count}: joint {name} stands twice at one time; drop one message"
                )
            sample[name] = position
    for time, sample in samples.items():
        if len(sample) != len(joints):
            lacking = ", ".join(name for name in joints if name not in sample)
            raise TrajectoryError(
                f"{where}: message {numbers[time]}: no {lacking} at this time, and other messages have them; all "
                "joints are needed at each time: record one topic with all, choose it by topic=, or resample to a table"
            )
    positions = [[sample[name] for name in joints] for sample in samples.values()]
    times = [(time, 0.0) for time in samples]
    return _table(where, label, times, joints, positions, "message", list(numbers.values()))


def _of_trajectories(trajectories: list[_Trajectory], where: str, label: str) -> Table:
    """One trajectory, or several one after the other by the times of their headers."""
    joints = list(trajectories[0].names) if trajectories else []
    times: list[tuple[int, float]] = []
    rows: list[list[float]] = []
    for count, trajectory in enumerate(trajectories, start=1):
        doubled = [name for name, times in Counter(trajectory.names).items() if times > 1]
        if doubled:
            raise TrajectoryError(f"{where}: joint {', '.join(doubled[:5])} stands twice in joint_names")
        if set(trajectory.names) != set(joints):
            raise TrajectoryError(f"{where}: trajectory {count} has other joints than the first; keep one of them")
        if len(trajectories) > 1 and not trajectory.stamp:
            raise TrajectoryError(
                f"{where}: {len(trajectories)} trajectories, and number {count} has no time in its header, so their "
                "order in time is unknown; keep one trajectory"
            )
        columns = [trajectory.names.index(name) for name in joints]
        for k, positions in enumerate(trajectory.positions, start=1):
            if len(positions) != len(joints):
                raise TrajectoryError(f"{where}: point {k}: {len(positions)} positions for {len(joints)} joints")
            rows.append([positions[column] for column in columns])
        start = trajectory.stamp if len(trajectories) > 1 else 0
        times += [(start + nanoseconds, seconds) for nanoseconds, seconds in trajectory.times]
    return _table(where, label, times, joints, rows, "point", list(range(1, len(rows) + 1)))


def _table(
    where: str,
    label: str,
    times: list[tuple[int, float]],
    joints: list[str],
    positions: list[list[float]],
    row: str,
    rows: list[int],
) -> Table:
    start = times[0][0] if times else 0
    # Whole nanoseconds are subtracted first: as doubles, those of today's clocks are 200 ns apart.
    since_start = np.array([(nanoseconds - start) / _NANO + seconds for nanoseconds, seconds in times])
    table = np.array(positions, dtype=np.float64).reshape(len(rows), len(joints))
    if not np.isfinite(table).all():
        i, j = (int(k) for k in np.argwhere(~np.isfinite(table))[0])
        raise TrajectoryError(
            f"{where}: {row} {rows[i]}: joint {joints[j]} is {table[i, j]}, no finite number; drop the {row}"
        )
    return Table(
        where=where,
        format=label,
        columns={name: np.ascontiguousarray(table[:, j]) for j, name in enumerate(joints)},
        rows=rows,
        row=row,
        times=since_start,
        clock=start / _NANO + since_start,
        by_format=True,
    )


def _unwrapped(document: Any) -> Any:
    for _ in _WRAPPERS:
        if not isinstance(document, dict) or "points" in document or "position" in document:
            return document
        document = next((document[key] for key in _WRAPPERS if key in document), document)
    return document


def _has(document: Any, *keys: str) -> bool:
    return isinstance(document, dict) and all(key in document for key in keys)


def _yaml_trajectory(document: dict[str, Any], where: Path) -> _Trajectory:
    names = _yaml_list(document["joint_names"], f"{where}: joint_names", "joint names")
    points = document["points"]
    if not isinstance(points, list):
        raise TrajectoryError(f"{where}: points: a list is needed")
    times: list[tuple[int, float]] = []
    positions: list[list[float]] = []
    for count, point in enumerate(points, start=1):
        place = f"{where}: point {count}"
        for key in ("positions", "time_from_start"):
            if not _has(point, key):
                raise TrajectoryError(f"{place} has no {key}")
        nanoseconds, seconds = _yaml_time(point["time_from_start"], f"{place}: time_from_start")
        if nanoseconds + _NANO * seconds < 0.0:
            raise TrajectoryError(f"{place}: time_from_start is before the start; no trajectory has such times")
        times.append((nanoseconds, seconds))
        positions.append(_yaml_numbers(point["positions"], place, "positions", names))
    return _Trajectory(_yaml_stamp(document, where), names, times, positions)


def _yaml_list(value: Any, place: str, content: str) -> list[Word]:
    if not isinstance(value, list) or not all(isinstance(entry, Word) for entry in value):
        raise TrajectoryError(f"{place}: a list of {content} is needed")
    return value


def _yaml_numbers(value: Any, place: str, key: str, names: Sequence[str]) -> list[float]:
    entries = _yaml_list(value, f"{place}: {key}", "numbers")
    labels = [*names, *["without a name"] * len(entries)]
    return [number(entry, f"{place} (line {entry.line}), joint {name}") for entry, name in zip(entries, labels)]


def _yaml_stamp(document: dict[str, Any], where: Path) -> int:
    header = document.get("header")
    if not isinstance(header, dict) or "stamp" not in header:
        return 0
    nanoseconds, seconds = _yaml_time(header["stamp"], f"{where}: header stamp")
    if nanoseconds + _NANO * seconds < 0.0:
        raise TrajectoryError(f"{where}: header stamp: no clock has a time below zero")
    return nanoseconds + round(seconds * _NANO)


def _yaml_time(value: Any, place: str) -> tuple[int, float]:
    """Whole nanoseconds, and seconds: {sec, nanosec}, {secs, nsecs} or a number of seconds."""
    if isinstance(value, Word):
        seconds = number(value, place)
        if abs(seconds) > _LATEST:
            raise TrajectoryError(f"{place}: {seconds:g} s is no time")
        return 0, seconds
    units = [_UNITS.get(key) for key in value] if isinstance(value, dict) else [None]
    if None in units or len(set(units)) < len(units):
        raise TrajectoryError(f"{place}: {{sec, nanosec}}, {{secs, nsecs}} or a number of seconds is needed")
    return sum(unit * _whole(part, place) for unit, part in zip(units, value.values(), strict=True) if unit), 0.0


def _whole(value: Any, place: str) -> int:
    text = value if isinstance(value, Word) else ""
    digits = text.removeprefix("-")
    if not digits.isascii() or not digits.isdigit() or len(digits) > 12:
        raise TrajectoryError(f"{place}: a whole number is needed, got {text!r:.40}")
    return int(text)


def yaml_documents(text: str, where: str) -> list[Any]:
    """Documents of a YAML text that are not empty: dictionaries by text, lists, and `Word`s."""
    with by_library(Path(where), "YAML file", "PyYAML"):
        import yaml

    # Without resolvers, plain values are texts.
    safe = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    loader_of_texts: Any = type("_TextLoader", (safe,), {"yaml_implicit_resolvers": {}})

    def as_word(_: Any, node: Any) -> Word:
        word = Word(node.value)
        word.line = node.start_mark.line + 1
        return word

    def as_mapping(loader: Any, node: Any) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key, fault = loader.construct_object(key_node, deep=True), ""
            if key == _MERGE:
                fault = "merge keys (<<) are not read; write the values out"
            elif not isinstance(key, Word):
                fault = "a key must be a plain word"
            elif key in mapping:
                fault = f"{key!r:.60} stands twice"
            if fault:
                raise TrajectoryError(f"{where}: line {key_node.start_mark.line + 1}: {fault}")
            mapping[key] = loader.construct_object(value_node, deep=True)
        return mapping

    loader_of_texts.add_constructor("tag:yaml.org,2002:str", as_word)
    loader_of_texts.add_constructor("tag:yaml.org,2002:map", as_mapping)
    try:
        return [document for document in yaml.load_all(text, loader_of_texts) if document not in (None, "")]
    except (yaml.YAMLError, RecursionError) as error:
        raise TrajectoryError(f"{where}: no YAML: {' '.join(str(error).split()):.200}; write it anew") from None
