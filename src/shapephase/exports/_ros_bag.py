"""Bags of ROS 2 in MCAP: joints, and the pose of the base as a message and as a transform."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..errors import MissingExtraError, OutputFileError

_NANO = 10**9  # of the stamps, in a second
_WORLD = "world"  # frame of the inertial axes
_VERSION = 9  # of the bag's metadata


def whole_nanoseconds(times: Array, duration: float) -> Array:
    """The nearest times that a stamp holds, none after the end: (N,) -> (N,) [s]."""
    return np.minimum(np.round(times * _NANO) / _NANO, np.floor(duration * _NANO) / _NANO)


@contextmanager
def _bag_folder() -> Iterator[Path]:
    """A temporary folder for a bag. Raises OutputFileError for what the system refuses to write there."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputFileError(f"cannot write a bag into {tempfile.gettempdir()}: {reason}") from None


def mcap_bag(
    times: Array, quat_xyzw: Array, position: Array, link: str, joints: tuple[tuple[str, ...], Array, Array] | None
) -> bytes:
    """Topics /joint_states, /base_pose and /tf at whole nanoseconds, as the bytes of an MCAP file.

    link : frame of the base
    joints : names (n,), coordinates and rates (N, n); None: no topic of joints

    Raises MissingExtraError without rosbags; OutputFileError where the folder for temporary files is full.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("MCAP files need rosbags; install it with: pip install 'shapephase[data]'") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds: Any = store.types

    def made(kind: str, *fields: Any) -> Any:
        return kinds[kind](*fields)

    stamps: Integers = np.round(times * _NANO).astype(np.int64)
    with _bag_folder() as folder:
        bag = folder / "motion"
        with Writer(bag, version=_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:

            def topic(name: str, kind: str) -> Any:
                connection = writer.add_connection(name, kind, typestore=store)
                return lambda stamp, message: writer.write(connection, stamp, store.serialize_cdr(message, kind))

            pose = topic("/base_pose", "geometry_msgs/msg/PoseStamped")
            transform = topic("/tf", "tf2_msgs/msg/TFMessage")
            state = None if joints is None else topic("/joint_states", "sensor_msgs/msg/JointState")
            for row, stamp in enumerate(stamps.tolist()):
                time = made("builtin_interfaces/msg/Time", *divmod(stamp, _NANO))
                header = made("std_msgs/msg/Header", time, _WORLD)
                turned = made("geometry_msgs/msg/Quaternion", *quat_xyzw[row].tolist())
                point = made("geometry_msgs/msg/Point", *position[row].tolist())
                moved = made("geometry_msgs/msg/Vector3", *position[row].tolist())
                placed = made("geometry_msgs/msg/Pose", point, turned)
                pose(stamp, made("geometry_msgs/msg/PoseStamped", header, placed))
                frames = made("geometry_msgs/msg/Transform", moved, turned)
                stamped = made("geometry_msgs/msg/TransformStamped", header, link, frames)
                transform(stamp, made("tf2_msgs/msg/TFMessage", [stamped]))
                if joints is not None and state is not None:
                    names, shapes, rates = joints
                    own = made("std_msgs/msg/Header", time, "")
                    columns = [shapes[row], rates[row], np.zeros(0)]
                    state(stamp, made("sensor_msgs/msg/JointState", own, list(names), *columns))
        return (bag / "motion.mcap").read_bytes()
