"""Links of a body that recorded segments show, and the turns from the segments' axes to the links'.

That turn C is the identity where they are the link's own, or comes from a calibration pose, in which the body stands
in its zero pose: C = S^T G L with S the segment's turn there, L the link's in axes of the base, and G the turn of the
base. G is that by which the links' joints lie best on the recorded origins (Kabsch, Acta Crystallographica A 32 (1976)
922); where these do not determine it, the identity.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...errors import ShapeError, TrajectoryError
from ...letters import value_text
from .recording import Recording, SegmentPoses, warn

OWN_AXES = "links"  # calibration: segments have the axes of the body's links
SHORT = 0.02  # [m] tolerance of lengths; shorter ones are not compared
# [rad] between the ways to the next joint: people are not straight; other arm poses give 90 deg.
MOST_OFF_WAY = np.radians(20.0)
_OTHER_POSE = np.radians(45.0)  # [rad] a larger turn between two calibration poses means two postures
_FLAT = 1e-4  # relative to the largest singular value: points on one line
_THOUSAND = (500.0, 2000.0)  # recorded lengths in millimetres, over the body's in metres
_PARTS = {  # part -> its names in Xsens, Theia and usual models, without the side
    "pelvis": ("pelvis", "hips"),
    "thigh": ("thigh", "upperleg", "upleg", "femur"),
    "shank": ("shank", "lowerleg", "lowleg", "tibia", "calf", "shin"),
    "foot": ("foot",),
    "toes": ("toes", "toe"),
    "upperarm": ("upperarm", "uarm", "uparm", "humerus"),
    "forearm": ("forearm", "larm", "lowerarm", "lowarm"),
    "hand": ("hand",),
}
_USUAL = {word: part for part, words in _PARTS.items() for word in words}
_SIDED = re.compile(r"(?P<before>left|right|[lr](?=_))?_?(?P<part>.+?)_?(?P<behind>left|right|(?<=_)[lr])?")
_ROOM = ("worldbody", "world", "ground")  # names of the room among the segments
_MODELS = {"opensim": ".osim", "mvnx": ".mvnx"}  # kind of model whose links are the segments -> ending of its files


@dataclass(frozen=True, kw_only=True)
class SegmentChoices:
    """How segments become links, checked: options of `read_recorded_motion`."""

    names: Mapping[str, str | None]
    calibration: float | str | None = None
    length_tolerance: float | None = None

    def __post_init__(self) -> None:
        """Raise ShapeError for values of the wrong kind."""
        off, at = self.length_tolerance, self.calibration
        if off is not None and (isinstance(off, bool) or not isinstance(off, int | float) or not 0.0 < off < 1.0):
            raise ShapeError(f"length_tolerance: a share between 0 and 1 is needed, as 0.1, got {value_text(off)}")
        if at is not None and (isinstance(at, bool) or not isinstance(at, int | float | str)):
            raise ShapeError(f"calibration: a time or {OWN_AXES!r} is needed, got {value_text(at)}")

    @property
    def given(self) -> bool:
        """True if an option is given that only poses of segments need."""
        return self.calibration is not None or self.length_tolerance is not None


class Frame(NamedTuple):
    """A frame of the body's chain and the segment that shows it; turn and place of the link in the frame."""

    frame: int
    segment: int
    link: str
    turn: Array
    place: Array


class Calibration(NamedTuple):
    """Turns from segment axes to those of the frames (k, 3, 3), and the segments' origins there (k, 3) [m].

    error, worst : largest angle between recorded and own ways [rad], and which way that is
    by_origins : True if origins show how the base is turned
    """

    turns: Array
    origins: Array
    error: float = 0.0
    worst: str = ""
    by_origins: bool = False


class Links:
    """Frames of a body's chain that segments show.

    frames : parents before children; the first is the base
    above : place of a frame among them -> that of the nearest one towards the base
    left_out : segments that show no frame
    """

    def __init__(self, where: str, poses: SegmentPoses, body: Body, names: Mapping[str, str | None]) -> None:
        self.where, self.poses, self.body, self.chain = where, poses, body, body.chain
        by_frame = self._matched(names)
        self.frames = list(by_frame.values())
        self.left_out = [name for k, name in enumerate(poses.names) if k not in [f.segment for f in self.frames]]
        order = {frame: place for place, frame in enumerate(by_frame)}
        self.above = {order[frame]: order[self.shown_by(frame)] for frame in by_frame if frame}

    def shown_by(self, frame: int) -> int:
        """The nearest frame towards the base that a segment shows, other than this one."""
        shown = {f.frame for f in self.frames}
        while frame:
            frame = self.chain.parents[frame - 1]
            if frame in shown:
                break
        return frame

    def frame_poses(self, shapes: Array) -> dict[int, tuple[Array, Array]]:
        """Turns (M, 3, 3) and places (M, 3) of all frames with a segment or mass, in axes of the base."""
        poses = {}
        first = {frame: link for link, (frame, _) in reversed(list(self.chain.link_frames.items()))}
        for frame in sorted({f.frame for f in self.frames} | {*np.flatnonzero(self.chain.masses).tolist()}):
            pose, inside = self.body.link_pose(shapes, first[frame]), self.chain.link_frames[first[frame]][1]
            turn = pose[:, :3, :3] @ inside[:3, :3].T
            poses[frame] = turn, pose[:, :3, 3] - turn @ inside[:3, 3]
        return poses

    @property
    def in_millimetres(self) -> bool:
        """True if segments are a thousand times as far apart as the links in the body's zero pose."""
        if self.poses.origins is None or not self.above:
            return False
        rest = self.frame_poses(self.body.shape()[None])
        recorded, own = 0.0, 0.0
        for k, above in self.above.items():
            lower, upper = self.frames[k], self.frames[above]
            own += float(np.linalg.norm(rest[lower.frame][1] - rest[upper.frame][1]))
            ways = self.poses.origins[:, lower.segment] - self.poses.origins[:, upper.segment]
            lengths = np.linalg.norm(ways[np.isfinite(ways).all(axis=1)], axis=1)
            recorded += float(np.median(lengths)) if len(lengths) else 0.0
        return _THOUSAND[0] * own <= recorded <= _THOUSAND[1] * own

    def calibration(self, recording: Recording, choices: SegmentChoices, record: dict[str, Any]) -> Calibration:
        """Turns and origins of the segments in their frames; the record gets how they were found."""
        at, stands, file = choices.calibration, dict(self.poses.stands or {}), self.body.file
        if at is None and file is not None and file.suffix.lower() == _MODELS.get(self.poses.of_model or ""):
            at = OWN_AXES
        if at == OWN_AXES:
            record["calibration"] = "segments have the axes of the links"
            return Calibration(np.stack([f.turn.T for f in self.frames]), self._origins())
        try:
            time = None if at is None else float(at)
        except ValueError:
            time = None
        if time is not None:
            stands = {f"{time:.9g} {recording.time_unit}": self._at(time, recording)}
        elif isinstance(at, str):
            if at not in stands:
                raise TrajectoryError(
                    f"{self.where}: calibration={at!r:.40}: a time is needed, {OWN_AXES!r}, or a pose of the file, "
                    f"which has {', '.join(stands) or 'none'}; give one of these (--calibration T)"
                )
            stands = {at: stands[at]}
        if not stands:
            raise TrajectoryError(
                f"{self.where}: axes of segments differ from program to program, and the file has no calibration pose. "
                "Give calibration=T (--calibration T), a time at which the body stands in its zero pose, or "
                f"calibration={OWN_AXES!r} (--calibration {OWN_AXES}) where segments have the axes of the links of "
                f"{self.body.name}"
            )
        fits = {kind: self._fitted(*pose) for kind, pose in stands.items()}
        kind = min(fits, key=lambda each: fits[each].error)
        fit = fits[kind]
        if fit.error > MOST_OFF_WAY:
            raise TrajectoryError(
                f"{self.where}: the body does not stand in its zero pose at {' or '.join(stands)}: the way "
                f"{fit.worst} is {np.degrees(fit.error):.0f} deg off, and {np.degrees(MOST_OFF_WAY):.0f} deg are the "
                "most. Give a time at which it does: calibration=T (--calibration T)"
            )
        for other, candidate in fits.items():
            apart = so3.angle(so3.transpose(candidate.turns) @ fit.turns)
            if candidate.error <= MOST_OFF_WAY and apart.max() > _OTHER_POSE:
                raise TrajectoryError(
                    f"{self.where}: both {kind} and {other} may be the zero pose of {self.body.name}, and "
                    f"{self.frames[int(np.argmax(apart))].link} is turned by {np.degrees(apart.max()):.0f} deg between "
                    f"them; say which: calibration={kind!r} (--calibration {kind})"
                )
        axes = "as the joints lie" if fit.by_origins else "the room's, as the joints do not tell them"
        record["calibration"] = f"zero pose at {kind}, axes of the base {axes}"
        record["calibration_off_deg"] = float(np.degrees(fit.error))
        if not fit.by_origins:
            warn(
                f"{self.where}: at {kind} the base of {self.body.name} is taken to have the axes of the room: the "
                "places of segments do not tell how it is turned"
            )
        return fit

    def _origins(self) -> Array:
        """Places in the frames of the segments: centres of mass, or the origins of links."""
        return np.stack([self.chain.centres[f.frame] if self.poses.at_centres else f.place for f in self.frames])

    def _at(self, time: float, recording: Recording) -> tuple[Array, Array | None]:
        clock = recording.clock
        if not clock[0] <= time <= clock[-1]:
            raise TrajectoryError(
                f"{self.where}: calibration={time:.9g}: times go from {clock[0]:.9g} to {clock[-1]:.9g} "
                f"{recording.time_unit}; give one of them (--calibration T)"
            )
        sample = int(np.argmin(np.abs(clock - time)))
        if not np.isfinite(self.poses.turns[sample, [f.segment for f in self.frames]]).all():
            raise TrajectoryError(
                f"{recording.place(sample)}: a segment has no pose at the time of calibration; give another one "
                "(--calibration T)"
            )
        return self.poses.turns[sample], None if self.poses.origins is None else self.poses.origins[sample]

    def _fitted(self, turns: Array, origins: Array | None) -> Calibration:
        used = [f.segment for f in self.frames]
        rest = self.frame_poses(self.body.shape()[None])
        turned = np.stack([rest[f.frame][0][0] for f in self.frames])
        inside, base, error, worst, by_origins = self._origins(), np.eye(3), 0.0, "", False
        if origins is not None and self.above:
            ends = origins[used]
            own = np.stack([rest[f.frame][1][0] for f in self.frames]) + so3.apply(turned, inside)
            # The place of the base's own origin depends on the program.
            free = slice(1 if len(own) > 3 else 0, None)
            left, sizes, right = np.linalg.svd((ends[free] - ends[free].mean(0)).T @ (own[free] - own[free].mean(0)))
            by_origins = len(own[free]) > 2 and bool(sizes[1] > _FLAT * sizes[0])
            if by_origins:
                base = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
            beside = [k for k, above in self.above.items() if above == 0]
            start = np.mean(ends[beside] - own[beside] @ base.T, axis=0)
            if not self.poses.at_centres:
                inside[0] = base.T @ (ends[0] - start)
                ends = np.vstack([start + base @ own[:1].T[:, 0], ends[1:]])
            for k, above in self.above.items():
                apart = angle_of_ways(ends[k] - ends[above], base @ (own[k] - own[above]))
                if apart > error:
                    error, worst = apart, f"from {self.frames[above].link} to {self.frames[k].link}"
        return Calibration(so3.transpose(turns[used]) @ base @ turned, inside, error, worst, by_origins)

    def _matched(self, names: Mapping[str, str | None]) -> dict[int, Frame]:
        """Frame of the chain -> the segment that shows it, parents before children."""
        links = self.chain.link_frames
        known = known_links(self.body, self.poses.names)
        frames: dict[int, Frame] = {}
        shown: dict[str, str] = {}
        free = []
        for number, segment in enumerate(self.poses.names):
            link = names.get(segment, known.get(segment))
            if link is None:
                free += [] if segment in names or _plain(segment) in _ROOM else [segment]
                continue
            if link not in links:
                raise TrajectoryError(
                    f"{self.where}: names: {link!r:.60} is no link of {self.body.name}; links are {', '.join(links)}; "
                    f"write --names {segment}=LINK"
                )
            if link in shown:
                raise TrajectoryError(
                    f"{self.where}: segments {shown[link]!r} and {segment!r} are both link {link}; leave one out with "
                    f"names={{{segment!r}: None}} (--names {segment}=)"
                )
            shown[link] = segment
            frame, pose = links[link]
            # Among several links of one rigid part, that whose axes are the part's.
            if frame not in frames or np.array_equal(pose, np.eye(4)):
                frames[frame] = Frame(frame, number, link, pose[:3, :3], pose[:3, 3])
        first = {frame: link for link, (frame, _) in reversed(list(links.items()))}
        lacking = [first[frame] for frame in [0, *np.flatnonzero(self.chain.masses).tolist()] if frame not in frames]
        if 0 not in frames or (lacking and free):
            segment = free[0] if free else "SEGMENT"
            raise TrajectoryError(
                f"{self.where}: the file has poses of {len(self.poses.names)} segments, and no segment is known as "
                f"{', '.join(dict.fromkeys(lacking))} of {self.body.name}; segments left over are "
                f"{', '.join(free) or 'none'}. Say which is which: names={{{segment!r}: {lacking[0]!r}}} (--names "
                f"{segment}={lacking[0]}), or leave a segment out: --names {segment}="
            )
        return dict(sorted(frames.items()))


def known_links(body: Body, segments: Iterable[str]) -> dict[str, str]:
    """Segment -> link, for segments that are known by their names."""
    links = body.chain.link_frames
    plain = {_plain(link): link for link in links}
    if "base" not in plain:
        plain["base"] = body.link_names[0]
    parts = [_usual(link) for link in links]
    usual = {part: link for part, link in zip(parts, links, strict=True) if parts.count(part) == 1}
    by_segment = {segment: plain.get(_plain(segment), usual.get(_usual(segment))) for segment in segments}
    return {segment: link for segment, link in by_segment.items() if link is not None}


def angle_of_ways(recorded: Array, own: Array) -> float:
    """The angle between two vectors [rad]; 0 where one is too short to have a direction."""
    sizes = np.linalg.norm(recorded), np.linalg.norm(own)
    return float(so3.angle_between(recorded / sizes[0], own / sizes[1])) if min(sizes) > SHORT else 0.0


def _plain(name: str) -> str:
    """Letters and digits in lower case: "L_Thigh" -> "lthigh"."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _usual(name: str) -> tuple[str, str]:
    """Side and part of a segment, in one word for what is called differently: ("l", "thigh")."""
    spaced = re.sub(r"[^a-z0-9]+", "_", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()).strip("_")
    match = _SIDED.fullmatch(spaced)
    if match is None:
        return "", name
    part = match["part"].replace("_", "")
    return (match["before"] or match["behind"] or "")[:1], _USUAL.get(part, part)
