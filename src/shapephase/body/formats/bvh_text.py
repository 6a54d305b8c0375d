"""BVH: a skeleton at zero angles and the angles of its bones, frame by frame, as a strict reader finds them.

The format has no unit of length. Its angles are in degrees, about axes in one point, each turned by those before it:
three of them are a rotation, of which many triples are the same.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import so3
from ...arrays import FARTHEST, Array
from .xml_text import quoted

_START = b"HIERARCHY"
_PLACES = ("Xposition", "Yposition", "Zposition")
_TURNS = ("Xrotation", "Yrotation", "Zrotation")
_MOST_DEPTH = 100  # bones from the root; with all fingers there are twelve
_STAYS = 1e-4  # of a bone's length, between its place and the offset: files have six digits


class BvhFaultError(Exception):
    """A fault of a file, with its line."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


@dataclass(frozen=True, eq=False, kw_only=True)
class Bone:
    """A joint of the skeleton and what it moves.

    name, line : its name and where that stands
    parent : number of the bone it hangs on; None for the root
    offset : (3,) from the parent's joint, all angles zero [units of the file]
    channels : words of its channels, in the file's order
    column : of its first channel, among those of a frame
    tip : (3,) of its end site from its joint [units], or None
    """

    name: str
    line: int
    parent: int | None
    offset: Array
    channels: tuple[str, ...]
    column: int
    tip: Array | None

    @property
    def turns(self) -> tuple[tuple[str, int], ...]:
        """Axes "x", "y" or "z" of its turns in their order, and where the angles stand in a frame."""
        return tuple(
            (word[0].lower(), self.column + place) for place, word in enumerate(self.channels) if word in _TURNS
        )

    @property
    def slides(self) -> tuple[tuple[int, int], ...]:
        """Coordinates 0, 1 or 2 of its place that have a channel, and where they stand in a frame."""
        return tuple(
            (_PLACES.index(word), self.column + place) for place, word in enumerate(self.channels) if word in _PLACES
        )

    @property
    def is_ball(self) -> bool:
        """True for a bone that turns about all axes, in any order: its angles are a rotation, not hinges."""
        return len(self.turns) > 2

    @property
    def hinge_names(self) -> tuple[str, ...]:
        """Names of the hinges that its channels of rotation would be, each by itself."""
        return tuple(f"{self.name}_{axis.upper()}rotation" for axis, _ in self.turns)


@dataclass(frozen=True, eq=False, kw_only=True)
class Skeleton:
    """All bones, parents before children in the file's order, and their motion.

    frames : (N, c) of all channels [degrees or units]
    lines : where the frames stand
    step : between frames [s]
    """

    bones: tuple[Bone, ...]
    frames: Array
    lines: Sequence[int]
    step: float

    def turned(self, number: int, frames: Array) -> Array:
        """Rotations of a bone in the axes of the one that it hangs on: frames (M, c) -> (M, 3, 3)."""
        turns = self.bones[number].turns
        angles = np.radians(frames[:, [column for _, column in turns]])
        return so3.matrix_from_euler(angles, "".join(axis for axis, _ in turns))

    def placed(self, number: int, frames: Array) -> Array:
        """Places of a bone's joint in the axes of the one that it hangs on: frames (M, c) -> (M, 3) [units]."""
        bone = self.bones[number]
        places = np.tile(bone.offset, (len(frames), 1))
        for axis, column in bone.slides:
            places[:, axis] = frames[:, column]
        return places

    def poses(self, numbers: Iterable[int], frames: Array) -> dict[int, tuple[Array, Array]]:
        """Turns (M, 3, 3) and places (M, 3) [units] of bones and of all that they hang on, seen from the root's joint.

        Every bone is at its OFFSET; axes are those of the room.
        """
        poses: dict[int, tuple[Array, Array]] = {}
        for number in sorted({above for bone in numbers for above in self.above(bone)}):
            turn, parent = self.turned(number, frames), self.bones[number].parent
            place = np.zeros((len(frames), 3))
            if parent is not None:
                above_turn, above_place = poses[parent]
                turn, place = above_turn @ turn, above_place + above_turn @ self.bones[number].offset
            poses[number] = turn, place
        return poses

    def base_motion(self, base: int) -> tuple[Array, Array | None]:
        """Turns (N, 3, 3) and places (N, 3) [units] of a bone in the room, those that it hangs on multiplied in.

        The places are None where no channel has them.
        """
        turn, place = np.eye(3), np.zeros((len(self.frames), 3))
        for number in self.above(base)[::-1]:
            place = place + so3.apply(turn, self.placed(number, self.frames))
            turn = turn @ self.turned(number, self.frames)
        moves = any(self.bones[number].slides for number in self.above(base))
        return turn, place if moves else None

    def below(self, number: int) -> list[int]:
        """The bones that hang on one."""
        return [child for child, bone in enumerate(self.bones) if bone.parent == number]

    def above(self, number: int) -> list[int]:
        """A bone and those it hangs on, up to the root."""
        way, at = [], number
        while at is not None:
            way.append(at)
            at = self.bones[at].parent
        return way


def is_bvh(content: bytes) -> bool:
    """True where bytes begin like a BVH file."""
    return content[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()[: len(_START)].upper() == _START


def bvh_skeleton(content: bytes) -> Skeleton:
    """Read a file."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Names of bones in older files; every byte is a letter.
        text = content.decode("latin-1")
    lines = _Lines(text)
    if lines.next("HIERARCHY") != ["HIERARCHY"]:
        raise lines.fault("HIERARCHY is needed")
    bones = _Hierarchy(lines).read()
    if lines.next("MOTION") != ["MOTION"]:
        raise lines.fault("MOTION is needed behind the skeleton: one ROOT, as many closing braces as opening ones")
    count = lines.after("Frames:")
    if not (count.isascii() and count.isdigit() and len(count) < 10):
        raise lines.fault(f"Frames: {quoted(count)!r} is not a number of frames")
    step = _numbers([lines.after("Frame Time:")], lines)[0]
    if not 1e-9 <= step <= 1e9:
        raise lines.fault(f"Frame Time: {step:g} s between frames; a time above 0 is needed")
    width = sum(len(bone.channels) for bone in bones)
    frames, at = _frames(lines, int(count), width)
    return Skeleton(bones=bones, frames=frames, lines=at, step=step)


class _Lines:
    """Lines that are not blank, one after the other."""

    def __init__(self, text: str) -> None:
        self.number = 0
        self._rest = self._numbered(text)

    def _numbered(self, text: str) -> Iterator[str]:
        for self.number, line in enumerate(text.splitlines(), start=1):
            if line.strip():
                yield line.strip()

    def text(self) -> str | None:
        return next(self._rest, None)

    def next(self, what: str) -> list[str]:
        """The words of the next line. Raises BvhFaultError at the end of the file."""
        line = self.text()
        if line is None:
            raise self.fault(f"the file ends where {what} is needed")
        return line.split()

    def after(self, label: str) -> str:
        """The text after a label in the next line."""
        words = " ".join(self.next(label))
        if not words.lower().startswith(label.lower()):
            raise self.fault(f"{label} is needed, got {quoted(words)!r}")
        return words[len(label) :].strip()

    def fault(self, message: str) -> BvhFaultError:
        return BvhFaultError(message, max(self.number, 1))


class _Hierarchy:
    """The skeleton on the way through its lines."""

    def __init__(self, lines: _Lines) -> None:
        self.lines = lines
        self.bones: list[Bone] = []
        self.names: set[str] = set()
        self.width = 0

    def read(self) -> tuple[Bone, ...]:
        """All bones of one root."""
        words = self.lines.next("ROOT")
        if words[0] != "ROOT":
            raise self.lines.fault(f"ROOT is needed, got {quoted(' '.join(words))!r}")
        open_bones: list[int] = [self._bone(words, None)]
        while open_bones:
            words = self.lines.next("}")
            if words == ["}"]:
                open_bones.pop()
            elif words[0] == "JOINT":
                if len(open_bones) >= _MOST_DEPTH:
                    raise self.lines.fault(f"bones are nested more than {_MOST_DEPTH} deep, as in no skeleton")
                open_bones.append(self._bone(words, open_bones[-1]))
            elif [word.lower() for word in words[:2]] == ["end", "site"]:
                self._end_site(words, open_bones[-1])
            else:
                raise self.lines.fault(f"JOINT, End Site or }} is needed, got {quoted(' '.join(words))!r}")
        return tuple(self.bones)

    def _bone(self, words: list[str], parent: int | None) -> int:
        line = self.lines.number
        brace = words[-1] == "{" and len(words) > 1
        name = " ".join(words[1:-1] if brace else words[1:])
        if not name or not name.isprintable():
            raise self.lines.fault(f"{words[0]} {quoted(name)!r}: a name of letters that can be printed is needed")
        if name in self.names:
            raise self.lines.fault(f"two bones are named {name!r}; give each a name of its own")
        self._open(name, brace)
        offset, channels = self._offset(name), self._channels(name)
        self.names.add(name)
        bone = Bone(name=name, line=line, parent=parent, offset=offset, channels=channels, column=self.width, tip=None)
        self.bones.append(bone)
        self.width += len(channels)
        return len(self.bones) - 1

    def _end_site(self, words: list[str], number: int) -> None:
        name = f"the end of {self.bones[number].name}"
        self._open(name, words[-1] == "{")
        tip = self._offset(name)
        if self.lines.next("}") != ["}"]:
            raise self.lines.fault(f"{name}: }} is needed behind its OFFSET")
        self.bones[number] = replace(self.bones[number], tip=tip)

    def _open(self, name: str, there: bool) -> None:
        if not there and self.lines.next("{") != ["{"]:
            raise self.lines.fault(f"{name}: {{ is needed")

    def _offset(self, name: str) -> Array:
        words = self.lines.next("OFFSET")
        if words[0] != "OFFSET" or len(words) != 4:
            raise self.lines.fault(f"{name}: OFFSET and three numbers are needed, got {quoted(' '.join(words))!r}")
        offset = np.array(_numbers(words[1:], self.lines))
        if np.abs(offset).max() > FARTHEST:
            raise self.lines.fault(f"{name}: an offset above {FARTHEST:g} units, as in no skeleton")
        return offset

    def _channels(self, name: str) -> tuple[str, ...]:
        words = self.lines.next("CHANNELS")
        if words[0] != "CHANNELS" or len(words) < 2:
            raise self.lines.fault(f"{name}: CHANNELS and their number are needed, got {quoted(' '.join(words))!r}")
        known = {word.lower(): word for word in (*_PLACES, *_TURNS)}
        channels = [known.get(word.lower(), "") for word in words[2:]]
        for word, channel in zip(words[2:], channels, strict=True):
            if not channel:
                raise self.lines.fault(
                    f"{name}: the channel {quoted(word)!r} is unknown; these are: {', '.join(known.values())}"
                )
        if words[1] != str(len(channels)):
            raise self.lines.fault(f"{name}: CHANNELS {quoted(words[1])} are stated, and {len(channels)} follow")
        places = [channel for channel in channels if channel in _PLACES]
        turns = [channel for channel in channels if channel in _TURNS]
        if len(set(places)) < len(places) or (len(turns) == 2 and len(set(turns)) == 1):
            raise self.lines.fault(f"{name}: a channel stands twice; two different ones are needed")
        return tuple(channels)


def _numbers(words: Sequence[str], lines: _Lines) -> list[float]:
    for word in words:
        try:
            # Python's own reading also takes 1_000 and digits of other scripts.
            value = float(word) if word.isascii() and "_" not in word else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise lines.fault(f"{quoted(word)!r} is not a finite number")
    return [float(word) for word in words]


def _quick_numbers(line: str, words: list[str]) -> list[float] | None:
    """A whole frame at once; None where each number must be checked."""
    if not line.isascii() or "_" in line:
        return None
    try:
        values = list(map(float, words))
    except ValueError:
        return None
    return values if math.isfinite(sum(map(abs, values))) else None


def _frames(lines: _Lines, count: int, width: int) -> tuple[Array, list[int]]:
    values, at = array("d"), []
    while (line := lines.text()) is not None:
        words = line.split()
        if len(words) != width:
            raise lines.fault(f"{len(words)} numbers in a frame, and the skeleton has {width} channels")
        if len(at) == count:
            raise lines.fault(f"Frames: {count} are stated, and more follow")
        numbers = _quick_numbers(line, words) or _numbers(words, lines)
        if max(map(abs, numbers), default=0.0) > FARTHEST:
            raise lines.fault(f"{max(numbers, key=abs):.6g} in a frame; up to {FARTHEST:g} can be resolved")
        values.extend(numbers)
        at.append(lines.number)
    if len(at) < count:
        raise lines.fault(f"Frames: {count} are stated, and {len(at)} follow; the file is cut off")
    return np.frombuffer(values, dtype=np.float64).reshape(-1, width) if at else np.empty((0, width)), at


def check_base(skeleton: Skeleton, base: int) -> None:
    """Raise BvhFaultError unless a bone and those it hangs on have three rotations, and three positions or none."""
    way = [skeleton.bones[number] for number in skeleton.above(base)]
    turns = [axis for bone in way for axis, _ in bone.turns]
    if len(turns) < len(_TURNS):
        words = " ".join(word for bone in way for word in bone.channels) or "none"
        raise BvhFaultError(f"root {way[0].name!r}: three rotations are needed, got {words}", way[0].line)
    for bone in way:
        if 0 < len(bone.slides) < len(_PLACES):
            words = " ".join(bone.channels)
            raise BvhFaultError(f"root {bone.name!r}: three positions or none are needed, got {words}", bone.line)


def check_lengths(skeleton: Skeleton, numbers: Sequence[int]) -> None:
    """Raise BvhFaultError where one of these bones moves along its parent: its length would change."""
    for bone in (skeleton.bones[number] for number in numbers):
        if not bone.slides or not len(skeleton.frames):
            continue
        axes, columns = (list(entries) for entries in zip(*bone.slides, strict=True))
        off = np.abs(skeleton.frames[:, columns] - bone.offset[axes]).max(axis=1)
        worst = int(np.argmax(off))
        if off[worst] > _STAYS * max(1.0, float(np.abs(bone.offset).max())):
            raise BvhFaultError(
                f"bone {bone.name!r} is {off[worst]:.3g} units from its OFFSET: bones of changing length are not rigid "
                "links; export rotations alone, or positions of the root only",
                skeleton.lines[worst],
            )
