"""MVNX: poses of the segments of an inertial suit, frame by frame, as the programs of Xsens export them.

Orientations are quaternions w, x, y, z, segment axes to the room's; positions are those of the segments' origins, each
the joint that is nearer to the pelvis, in metres. Before the motion the file has calibration poses, as `tpose`.
Source: MVN User Manual (Xsens), chapters on the MVNX format and on segment axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np
from scipy.spatial.transform import Rotation

from ... import so3
from ...arrays import FARTHEST, Array
from .bvh_text import Bone, BvhFaultError, Skeleton
from .xml_text import quoted

_NORMAL = "normal"  # type of a frame of the motion; every other type is a calibration pose
# calibration poses, the best first; others, like `tpose-isb`, have axes of their own
_STANDING = ("tpose", "npose", "identity")
_ON_TIME = 2e-3  # [s] from index / frame rate: times are whole milliseconds
_OFF_UNIT = 1e-3  # of a quaternion's length: files have six digits
# Segment -> the point at its far end.
_TIPS = {"Head": "pTopOfHead", "RightHand": "pRightTopOfHand", "LeftHand": "pLeftTopOfHand"} | {
    f"{side}Toe": f"p{side}Toe" for side in ("Right", "Left")
}
_CHANNELS = ("Xposition", "Yposition", "Zposition", "Zrotation", "Xrotation", "Yrotation")


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of k segments at N times.

    turns : (N, k, 3, 3) segment axes to the room's
    origins : (N, k, 3) [m]
    lines : where the frames stand
    """

    turns: Array
    origins: Array
    lines: list[int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Suit:
    """Contents of an MVNX file.

    segments : their names
    points : for each, name -> place in its axes (3,) [m]
    joints : number of the child -> number of its parent, and the joint's place in the parent's axes [m]
    motion : the frames of the motion
    times : (N,) [s]
    stands : name of a calibration pose -> the poses, one frame
    """

    segments: tuple[str, ...]
    points: tuple[Mapping[str, Array], ...]
    joints: Mapping[int, tuple[int, Array]]
    motion: Poses
    times: Array
    stands: Mapping[str, Poses]


@dataclass
class _Frame:
    kind: str
    line: int
    time: str | None
    index: str | None
    numbers: dict[str, Array] = field(default_factory=dict)


class _MotionBeginsError(Exception):
    """Ends the parsing where only what stands before the motion is needed."""


def read_suit(content: bytes, *, motion: bool = True) -> Suit:
    """Read a file.

    motion : False: what stands before the motion is enough, if it has a calibration pose
    """
    return _Reader(motion=motion).read(content)


class _Reader:
    def __init__(self, *, motion: bool) -> None:
        self.motion = motion
        self.rate: float | None = None
        self.segments: list[str] = []
        self.points: list[dict[str, Array]] = []
        self.connections: list[list[str]] = []
        self.frames: list[_Frame] = []
        self.point = ""
        self.path: list[str] = []
        self.text: list[str] = []
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self.text.append
        self.parser.EntityDeclHandler = self._entity

    def read(self, content: bytes) -> Suit:
        try:
            self.parser.Parse(content, True)
        except _MotionBeginsError:
            pass
        except expat.ExpatError as error:
            raise BvhFaultError(
                f"no well-formed XML ({expat.ErrorString(error.code)}); is the file cut off? Export it again",
                error.lineno,
            ) from None
        if not self.segments:
            raise self.fault("no <segments>; export the file again, with orientation and position of the segments")
        stands = {
            frame.kind: self._poses([frame]) for frame in self.frames if frame.kind in _STANDING and frame.numbers
        }
        frames = [frame for frame in self.frames if frame.kind == _NORMAL]
        return Suit(
            segments=tuple(self.segments),
            points=tuple(self.points),
            joints=self._joints(),
            motion=self._poses(frames),
            times=self._times(frames),
            stands=stands,
        )

    def fault(self, message: str) -> BvhFaultError:
        return BvhFaultError(message, max(self.parser.CurrentLineNumber, 1))

    def _entity(self, *_: object) -> None:
        raise self.fault("entities are not expanded; export the file again, without a document type")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        self.path.append(name)
        self.text.clear()
        if len(self.path) == 1 and name != "mvnx":
            raise self.fault(f"<{quoted(name)}>: expected <mvnx>; this is not an MVNX file")
        if name == "subject":
            self.rate = self._number(attributes.get("frameRate", "nan"), "frameRate")
        elif name == "segment" and self.path[-2:-1] == ["segments"]:
            label = attributes.get("label", "")
            if not label or label in self.segments:
                raise self.fault(f"segment {quoted(label)!r}: a label of its own is needed")
            self.segments.append(label)
            self.points.append({})
        elif name == "point":
            self.point = attributes.get("label", "")
        elif name == "joint":
            self.connections.append([])
        elif name == "frame":
            kind = attributes.get("type", _NORMAL)
            if kind == _NORMAL and not self.motion and self.frames:
                raise _MotionBeginsError
            line = self.parser.CurrentLineNumber
            self.frames.append(_Frame(kind, line, attributes.get("time"), attributes.get("index")))

    def _end(self, tag: str) -> None:
        name, _, parent = tag.rpartition(":")[2], self.path.pop(), (self.path or [""])[-1]
        if parent == "frame" and name in ("orientation", "position"):
            width = {"orientation": 4, "position": 3}[name]
            self.frames[-1].numbers[name] = self._numbers(width * len(self.segments), name).reshape(-1, width)
        elif name in ("pos_b", "pos_s") and parent == "point" and self.points:
            self.points[-1][self.point] = self._numbers(3, name)
        elif name in ("connector1", "connector2") and self.connections:
            self.connections[-1].append("".join(self.text).strip())
        self.text.clear()

    def _numbers(self, count: int, what: str) -> Array:
        words = "".join(self.text).split()
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError:
            values = np.array([self._number(word, what) for word in words])
        if len(values) != count:
            raise self.fault(f"{what}: {len(values)} numbers, and {count} are needed for {len(self.segments)} segments")
        if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > FARTHEST:
            raise self.fault(f"{what}: a number is not finite or too large; export the file again")
        return values

    def _number(self, word: str, what: str) -> float:
        try:
            return float(word)
        except ValueError:
            raise self.fault(f"{what}: {quoted(word)!r} is not a number") from None

    def _poses(self, frames: list[_Frame]) -> Poses:
        count = len(self.segments)
        turns, origins = np.empty((len(frames), count, 4)), np.empty((len(frames), count, 3))
        for number, frame in enumerate(frames):
            for what in ("orientation", "position"):
                if what not in frame.numbers:
                    raise BvhFaultError(f"no <{what}> in a frame; export the file again, with it", frame.line)
            turns[number], origins[number] = frame.numbers["orientation"], frame.numbers["position"]
        off = np.abs(np.linalg.norm(turns, axis=-1) - 1.0)
        if off.max(initial=0.0) > _OFF_UNIT:
            number, segment = np.unravel_index(int(np.argmax(off)), off.shape)
            raise BvhFaultError(
                f"the quaternion of {self.segments[segment]} is {off[number, segment]:.2g} off length 1; export the "
                "file again",
                frames[number].line,
            )
        xyzw = so3.normalised(np.roll(turns, -1, axis=-1))
        return Poses(so3.matrix_from_quat(xyzw), origins, [frame.line for frame in frames])

    def _times(self, frames: list[_Frame]) -> Array:
        """By the frames' numbers, as times are whole milliseconds; by these where frames do not keep the rate."""
        rate = self.rate
        numbers = np.array([k if f.index is None else self._number(f.index, "index") for k, f in enumerate(frames)])
        times = np.array([1e-3 * self._number("nan" if f.time is None else f.time, "time") for f in frames])
        if rate is None or not 0.0 < rate < np.inf:
            if np.isnan(times).any():
                raise self.fault("frames without time, and no frameRate; export the file again")
            return times
        by_rate = (numbers - numbers[:1]) / rate
        if np.isnan(times).any():
            return by_rate
        return times[:1] + by_rate if np.all(np.abs(times - times[:1] - by_rate) <= _ON_TIME) else times

    def _joints(self) -> dict[int, tuple[int, Array]]:
        """Number of the child -> its parent and the joint's place there, by `Pelvis/jLeftHip` and its like."""
        joints: dict[int, tuple[int, Array]] = {}
        for ends in self.connections:
            parts = [end.partition("/") for end in ends]
            if len(parts) != 2 or any(name not in self.segments for name, _, _ in parts):
                raise self.fault(f"joint {quoted(' and '.join(ends))!r}: two segments of the file are needed")
            (parent, _, point), (child, _, _) = parts
            above = self.segments.index(parent)
            if point not in self.points[above]:
                raise self.fault(f"joint {quoted(ends[0])!r}: {parent} has no such point; export the file again")
            joints[self.segments.index(child)] = above, self.points[above][point]
        return joints


def suit_skeleton(suit: Suit) -> Skeleton:
    """Bones of a suit's segments with the frame in which they are laid out: its T-pose, else all of its motion.

    A segment's axes are those of its bone.
    """
    # A prop in a hand is a segment without joints.
    roots = sorted({parent for parent, _ in suit.joints.values()} - suit.joints.keys())
    if len(roots) != 1:
        raise BvhFaultError(
            f"joints have {len(roots)} roots among the {len(suit.segments)} segments, and those of a body have one; "
            "export the file again, with <joints> and points, or load another body",
            1,
        )
    standing = next((suit.stands[kind] for kind in _STANDING if kind in suit.stands), suit.motion)
    order: list[int] = roots
    for number in order:
        order += [child for child, (parent, _) in suit.joints.items() if parent == number]
    bones, channels = [], []
    for place, number in enumerate(order):
        name = suit.segments[number]
        parent, offset = suit.joints.get(number, (None, np.zeros(3)))
        tip = suit.points[number].get(_TIPS.get(name, ""))
        words = _CHANNELS if parent is None else _CHANNELS[3:]
        column = sum(width.shape[1] for width in channels)
        above = None if parent is None else order.index(parent)
        bones.append(Bone(name=name, line=1, parent=above, offset=offset, channels=words, column=column, tip=tip))
        turns = standing.turns[:, number]
        if parent is not None:
            turns = so3.transpose(standing.turns[:, parent]) @ turns
        angles = Rotation.from_matrix(turns).as_euler("ZXY", degrees=True) if len(turns) else np.empty((0, 3))
        channels.append(np.hstack([standing.origins[:, number], angles]) if place == 0 else angles)
    return Skeleton(bones=tuple(bones), frames=np.hstack(channels), lines=standing.lines, step=1.0)
