"""Motion files of every kind as other programs write them: what the tests of readers are fed with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
NANO = 10**9


@dataclass(eq=False)
class Sample:
    """A recorded motion of a body: joints in a stranger's order, in radians and in degrees, and the base."""

    names: list[str]
    labels: list[str]
    ns: np.ndarray
    shapes: np.ndarray
    degrees: np.ndarray
    in_body_order: np.ndarray
    quaternions: np.ndarray
    positions: np.ndarray

    @staticmethod
    def random(body, count=12, seed=3, closed=False):
        """At uneven times, whole nanoseconds; inside the limits."""
        rng = np.random.default_rng(seed)
        ns = np.concatenate([[0], np.cumsum(rng.integers(200_000_000, 900_000_000, count - 1))])
        shapes = rng.uniform(0.05, 0.9, (count, body.n_shape))
        if closed:
            shapes[-1] = shapes[0]
        order = rng.permutation(body.n_shape)
        turns = np.array([unit == "rad" for unit in body.joint_units])[order]
        names = [body.joint_names[k] for k in order]
        labels = [f"{name}_deg" if turn else name for name, turn in zip(names, turns, strict=True)]
        mixed = shapes[:, order]
        quaternions = rng.normal(size=(count, 4))
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        degrees = np.where(turns, np.degrees(mixed), mixed)
        return Sample(names, labels, ns, mixed, degrees, shapes, quaternions, rng.normal(size=(count, 3)))


def write_delimited(file, names, times, shapes, delimiter=","):
    rows = [delimiter.join(map(repr, [float(t), *map(float, row)])) for t, row in zip(times, shapes, strict=True)]
    file.write_text("\n".join([delimiter.join(["time", *names]), *rows]) + "\n", encoding="utf-8")


def write_opensim(file, names, times, shapes, degrees, separator="\t", **header):
    said = {"version": 1, "nRows": len(times), "nColumns": len(names) + 1, "inDegrees": "yes" if degrees else "no"}
    lines = ["Coordinates", *(f"{key}={value}" for key, value in (said | header).items() if value is not None)]
    lines += ["", "endheader", separator.join(["time", *names])]
    lines += [separator.join(map(repr, [float(t), *map(float, r)])) for t, r in zip(times, shapes, strict=True)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def yaml_trajectory(names, nanoseconds, shapes, style="sec", indent=""):
    """JointTrajectory in YAML, by hand; `style` is that of time_from_start."""
    second, nano = {"sec": ("sec", "nanosec"), "secs": ("secs", "nsecs"), "float": ("", "")}[style]
    lines = ["joint_names:", *(f"- {name}" for name in names), "points:"]
    for time, row in zip(nanoseconds, shapes, strict=True):
        lines.append(f"- positions: [{', '.join(repr(float(v)) for v in row)}]")
        lines.append(f"  velocities: [{', '.join('0.0' for _ in row)}]")
        if style == "float":
            lines.append(f"  time_from_start: {float(time / NANO)!r}")
        else:
            lines += ["  time_from_start:", f"    {second}: {time // NANO}", f"    {nano}: {time % NANO}"]
    return "\n".join(indent + line for line in lines) + "\n"


def yaml_states(names, nanoseconds, shapes):
    """JointState messages as a topic's echo prints them."""
    return "".join(
        f"header:\n  stamp:\n    sec: {t // NANO}\n    nanosec: {t % NANO}\n  frame_id: ''\n"
        f"name: [{', '.join(names)}]\nposition: [{', '.join(repr(float(v)) for v in row)}]\nvelocity: []\n---\n"
        for t, row in zip(nanoseconds, shapes, strict=True)
    )


class Messages:
    """The messages of ROS 1 or ROS 2, made and encoded by rosbags."""

    def __init__(self, version):
        self.version = version
        self.types = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)

    def header(self, stamp):
        time = self.types.types["builtin_interfaces/msg/Time"](sec=stamp // NANO, nanosec=stamp % NANO)
        extra = {"seq": 0} if self.version == 1 else {}
        return self.types.types["std_msgs/msg/Header"](stamp=time, frame_id="", **extra)

    def state(self, stamp, names, positions):
        none = np.zeros(0)
        return self.types.types[STATE](self.header(stamp), list(names), np.array(positions, float), none, none)

    def trajectory(self, stamp, names, nanoseconds, shapes):
        duration = self.types.types["builtin_interfaces/msg/Duration"]
        point, none = self.types.types["trajectory_msgs/msg/JointTrajectoryPoint"], np.zeros(0)
        points = [
            point(np.array(row, float), none, none, none, duration(sec=t // NANO, nanosec=t % NANO))
            for t, row in zip(nanoseconds, shapes, strict=True)
        ]
        return self.types.types[TRAJECTORY](self.header(stamp), list(names), points)

    def encoded(self, message, kind):
        return (self.types.serialize_ros1 if self.version == 1 else self.types.serialize_cdr)(message, kind)


def write_bag(file, topics, storage="sqlite3", recorded=None):
    """A bag of `topics`: name -> (type, messages made by a function of `Messages`).

    `storage` is "rosbag1", "sqlite3" or "mcap"; the bag of ROS 2 is the folder `file`. `recorded` are the times of
    recording [ns].
    """
    messages = Messages(1 if storage == "rosbag1" else 2)
    if storage == "rosbag1":
        writer = Bag1Writer(file)
    else:
        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        writer = Bag2Writer(file, version=9, storage_plugin=plugin)
    with writer:
        for topic, (kind, make) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=messages.types)
            for k, message in enumerate(make(messages)):
                time = k + 1 if recorded is None else int(recorded[k])
                writer.write(connection, time, messages.encoded(message, kind))


def states(names, nanoseconds, shapes, stamped=True):
    """A topic of JointState messages."""
    return STATE, lambda m: [m.state(int(t) * stamped, names, row) for t, row in zip(nanoseconds, shapes, strict=True)]


def trajectory(names, nanoseconds, shapes, stamp=0):
    """A topic of one JointTrajectory message."""
    return TRAJECTORY, lambda m: [m.trajectory(stamp, names, [int(t) for t in nanoseconds], shapes)]
