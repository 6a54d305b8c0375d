"""Segments of a human on a skeleton: which bones carry them, and their masses, centres and inertias.

Masses, centres of mass and radii of gyration are those of men by P. de Leva, J. Biomechanics 29 (1996) 1223-1230,
table 4. Limbs are as long as their bones; trunk and head take their length from the distance of hips and shoulders.

All of it is laid out where the joints are in one frame of the file, that of the straightest posture. How the axes of
bones lie has no part in it: zero angles are not a posture where bones have axes of their own.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from ...arrays import Array
from .bvh_text import BvhFaultError, Skeleton
from .xml_text import listed


class _Row(NamedTuple):
    """One line of the table."""

    part: float  # of the mass of the body
    centre: float  # from the first end point, in parts of the length
    radii: tuple[float, float, float]  # of gyration about front-back, left-right, long axes, in parts of the length
    length: float  # of the men who were measured [m]


_TABLE = {
    "head": _Row(0.0694, 0.5002, (0.303, 0.315, 0.261), 0.2429),
    "upper_trunk": _Row(0.1596, 0.5066, (0.505, 0.320, 0.465), 0.2421),
    "middle_trunk": _Row(0.1633, 0.4502, (0.482, 0.383, 0.468), 0.2155),
    "lower_trunk": _Row(0.1117, 0.6115, (0.615, 0.551, 0.587), 0.1457),
    "upper_arm": _Row(0.0271, 0.5772, (0.285, 0.269, 0.158), 0.2817),
    "forearm": _Row(0.0162, 0.4574, (0.276, 0.265, 0.121), 0.2689),
    "hand": _Row(0.0061, 0.7900, (0.628, 0.513, 0.401), 0.0862),
    "thigh": _Row(0.1416, 0.4095, (0.329, 0.329, 0.149), 0.4222),
    "shank": _Row(0.0433, 0.4395, (0.251, 0.246, 0.102), 0.4403),
    "foot": _Row(0.0137, 0.4415, (0.257, 0.245, 0.124), 0.2581),
}
_TRUNK = ("upper_trunk", "middle_trunk", "lower_trunk")
_SHOULDERS = 0.8556  # height over the hips, of the trunk's length: robots/astronaut.urdf, after Drillis and Contini
_HEEL = 0.05 / _TABLE["foot"].length  # behind the ankle, of the foot's length (HeiMan)
_ALONG = 0.7  # cosine to the long axis above which the body's front-back axis is not a segment's
# Names of the bones that carry a segment, without their side, the most specific first.
_NAMES = {
    "thigh": ("upleg", "upperleg", "thigh", "hip"),
    "shank": ("leg", "lowerleg", "lowleg", "calf", "shin", "knee"),
    "foot": ("ankle", "foot"),
    "upper_arm": ("upperarm", "uparm", "arm", "shoulder"),
    "forearm": ("forearm", "lowerarm", "lowarm", "elbow"),
    "hand": ("wrist", "hand"),
}
_SIDES = {"left": ("left", "l"), "right": ("right", "r")}
_MAY_LACK = {"hand": "forearm"}  # segments that the bone above carries where a skeleton ends early
_MOST_POSTURES = 2000  # frames that are compared: a person stands straight for longer than a frame
_AS_STRAIGHT = 5e-3  # of the length from shoulders to feet: knees bent by 15 degrees shorten it so much
_AS_WIDE = 1e-6  # of a span: files have six digits, and among equal frames the first counts


class Segment(NamedTuple):
    """A segment in axes of its bone: mass [kg], centre from its joint (3,) [m], inertia about that centre (3, 3)
    [kg m^2]."""

    bone: int
    mass: float
    centre: Array
    inertia: Array


class Person(NamedTuple):
    """A skeleton with the masses of a person.

    segments : all sixteen of them, each in axes of its bone
    base : the nearest bone that carries all of these, itself or by bones that hang on it
    moving : the base and the bones between it and the segments, parents before children
    frame : number of the frame in which they were laid out; None: at zero angles, of a file without frames
    turns : (k, 3, 3) of all bones in that frame, axes of the room
    height : from the lowest to the highest joint or end of head, trunk and legs in that frame, along the trunk [m]
    """

    segments: list[Segment]
    base: int
    moving: list[int]
    frame: int | None
    turns: Array
    height: float


def person_of(skeleton: Skeleton, mass: float, metre: float) -> Person:
    """The segments of a person on a skeleton.

    They are laid out in the frame of the straightest posture: of the frames in which trunk and legs, from shoulders to
    ankles, are as long as in any other but for half a percent, the one with the largest span of the arms. That is the
    T-pose, where a file has one.

    mass : of the person [kg]
    metre : length of a unit of the file [m]
    """
    return _Layout(skeleton, mass, metre).person()


class _Layout:
    def __init__(self, skeleton: Skeleton, mass: float, metre: float) -> None:
        self.skeleton, self.mass = skeleton, mass
        self.plain = [_plain(bone.name) for bone in skeleton.bones]
        self.bones = {(side, part): self._limb(side, part) for side in _SIDES for part in _NAMES}
        self.frame, frames = self._straightest()
        poses = skeleton.poses(range(len(skeleton.bones)), frames)
        self.turns = np.array([turn[0] for turn, _ in poses.values()])
        self.places = metre * np.array([place[0] for _, place in poses.values()])
        self.tips = {
            number: metre * self.turns[number] @ bone.tip
            for number, bone in enumerate(skeleton.bones)
            if bone.tip is not None
        }
        thighs, arms = (self._middle(part) for part in ("thigh", "upper_arm"))
        self.up = self._direction(arms - thighs, "the hips and the shoulders are in one place")
        across = self.places[self.bones["left", "thigh"]] - self.places[self.bones["right", "thigh"]]
        self.left = self._direction(across - (across @ self.up) * self.up, "the hips are in one place")
        self.front = np.cross(self.left, self.up)
        self.hips, self.trunk = thighs, float(np.linalg.norm(arms - thighs)) / _SHOULDERS

    def person(self) -> Person:
        segments = self._segments()
        ways = [self.skeleton.above(segment.bone) for segment in segments]
        base = next(bone for bone in ways[0] if all(bone in way for way in ways))
        moving = sorted({bone for way in ways for bone in way if base in self.skeleton.above(bone)})
        arms = {self.bones[side, "upper_arm"] for side in _SIDES}
        whole = {bone: {*self.skeleton.above(bone)} for bone in range(len(self.skeleton.bones))}
        upright = [bone for bone, way in whole.items() if base in way and not arms & way]
        ends = [self.places[bone] + self.tips.get(bone, np.zeros(3)) for bone in upright]
        heights = np.array([*self.places[upright], *ends]) @ self.up
        return Person(segments, base, moving, self.frame, self.turns, float(np.ptp(heights)))

    def _straightest(self) -> tuple[int | None, Array]:
        """Number and channels (1, c) of the frame of the straightest posture."""
        whole = self.skeleton.frames
        if not len(whole):
            return None, np.zeros((1, whole.shape[1]))
        numbers = np.unique(np.linspace(0, len(whole) - 1, _MOST_POSTURES).round().astype(np.int64))
        poses = self.skeleton.poses(list(self.bones.values()), whole[numbers])

        def both(part: str) -> Array:
            return np.stack([poses[self.bones[side, part]][1] for side in _SIDES])

        hips, ankles, hands = both("thigh"), both("foot"), both("hand")
        trunk = both("upper_arm").mean(axis=0) - hips.mean(axis=0)
        # Legs apart are as straight as legs side by side.
        down = hips.mean(axis=0) - ankles.mean(axis=0)
        legs = np.linalg.norm(hips - ankles, axis=-1).mean(axis=0)
        lengths = np.linalg.norm(down, axis=-1)
        factors = np.divide(legs, lengths, out=np.zeros_like(legs), where=lengths > 0.0)
        straight = np.linalg.norm(trunk + factors[:, None] * down, axis=-1)
        spans = np.linalg.norm(hands[0] - hands[1], axis=-1)
        spans[straight < (1.0 - _AS_STRAIGHT) * straight.max()] = 0.0
        best = int(numbers[np.argmax(spans >= (1.0 - _AS_WIDE) * spans.max())])
        return best, whole[[best]]

    def _segments(self) -> list[Segment]:
        segments = self._torso()
        for side in _SIDES:
            upper, forearm, thigh, shank, foot = (
                self.bones[side, part] for part in ("upper_arm", "forearm", "thigh", "shank", "foot")
            )
            segments.append(self._between("upper_arm", upper, self.places[forearm]))
            wrist = self._wrist(side)
            segments.append(self._between("forearm", forearm, wrist))
            segments.append(self._hand(side, wrist))
            segments.append(self._between("thigh", thigh, self.places[shank]))
            segments.append(self._between("shank", shank, self.places[foot]))
            segments.append(self._foot(foot, float(np.linalg.norm(self.places[foot] - self.places[shank]))))
        return segments

    def _torso(self) -> list[Segment]:
        """Pelvis, middle and chest along the line from the hips, and the head on its end."""
        pelvis = self._common([self.bones[side, "thigh"] for side in _SIDES])
        chest = self._common([self.bones[side, "upper_arm"] for side in _SIDES])
        above = self.skeleton.above(pelvis)
        way = [pelvis, *(bone for bone in self.skeleton.above(chest)[::-1] if bone not in above)]
        whole = sum(_TABLE[part].length for part in _TRUNK)
        segments, top = [], self.trunk
        for part in _TRUNK:
            row = _TABLE[part]
            length = self.trunk * row.length / whole
            height = top - row.centre * length
            top -= length
            carrier = {"upper_trunk": way[-1], "lower_trunk": pelvis}.get(part, self._reaching(way, height))
            segments.append(self._segment(part, carrier, self.hips + height * self.up, self.up, length))
        head = next((self.plain.index(word) for word in ("head", "neck") if word in self.plain), None)
        if head is None:
            raise self._unknown("head", "Head")
        row, length = _TABLE["head"], self.trunk * _TABLE["head"].length / whole
        centre = self.hips + (self.trunk + (1.0 - row.centre) * length) * self.up
        return [*segments, self._segment("head", head, centre, self.up, length)]

    def _reaching(self, way: list[int], height: float) -> int:
        """The last bone of the trunk whose joint is not above a height over the hips."""
        lower = [bone for bone in way if (self.places[bone] - self.hips) @ self.up <= height]
        return lower[-1] if lower else way[0]

    def _between(self, part: str, bone: int, end: Array) -> Segment:
        along = end - self.places[bone]
        length = float(np.linalg.norm(along))
        direction = self._direction(along, f"bone {self.skeleton.bones[bone].name!r} has no length", bone)
        centre = self.places[bone] + _TABLE[part].centre * along
        return self._segment(part, bone, centre, direction, length)

    def _wrist(self, side: str) -> Array:
        """End of the forearm."""
        forearm, hand = self.bones[side, "forearm"], self.bones[side, "hand"]
        return self.places[hand] if hand != forearm else self.places[forearm] + self._towards(forearm)

    def _hand(self, side: str, wrist: Array) -> Segment:
        """The hand from the wrist on, as long as hands are beside forearms."""
        forearm, hand = self.bones[side, "forearm"], self.bones[side, "hand"]
        along = wrist - self.places[forearm]
        ahead = self._towards(hand) if hand != forearm else along
        direction = self._direction(ahead if ahead.any() else along, "the forearm has no length", forearm)
        length = float(np.linalg.norm(along)) * _TABLE["hand"].length / _TABLE["forearm"].length
        return self._segment("hand", hand, wrist + _TABLE["hand"].centre * length * direction, direction, length)

    def _foot(self, foot: int, shank: float) -> Segment:
        """The foot from heel to toes, as long as feet are beside shanks."""
        ahead = self._towards(foot)
        direction = self._direction(ahead if ahead.any() else self.front, "it points nowhere", foot)
        length = shank * _TABLE["foot"].length / _TABLE["shank"].length
        centre = self.places[foot] + (_TABLE["foot"].centre - _HEEL) * length * direction
        return self._segment("foot", foot, centre, direction, length)

    def _segment(self, part: str, bone: int, centre: Array, along: Array, length: float) -> Segment:
        row = _TABLE[part]
        reference = self.front if abs(self.front @ along) < _ALONG else self.up
        sagittal = reference - (reference @ along) * along
        sagittal /= np.linalg.norm(sagittal)
        axes = np.stack([sagittal, np.cross(along, sagittal), along])
        mass = row.part * self.mass
        moments = mass * (np.array(row.radii) * length) ** 2
        inertia = axes.T @ (moments[:, None] * axes)
        turn = self.turns[bone]
        inertia = turn.T @ (0.5 * (inertia + inertia.T)) @ turn
        return Segment(bone, mass, turn.T @ (centre - self.places[bone]), inertia)

    def _towards(self, bone: int) -> Array:
        """Vector from a bone's joint to the next one elsewhere, or to the end of the bone: (3,) [m]; or zeros."""
        waiting = [bone]
        while waiting:
            at = waiting.pop(0)
            if at != bone and np.any(self.places[at] != self.places[bone]):
                return self.places[at] - self.places[bone]
            tip = self.tips.get(at)
            if tip is not None and tip.any():
                return self.places[at] + tip - self.places[bone]
            waiting += self.skeleton.below(at)
        return np.zeros(3)

    def _limb(self, side: str, part: str) -> int:
        for word in _NAMES[part]:
            sided = {pattern for mark in _SIDES[side] for pattern in (f"{mark}{word}", f"{word}{mark}")}
            for number, name in enumerate(self.plain):
                if name in sided:
                    return number
        if part in _MAY_LACK:
            return self._limb(side, _MAY_LACK[part])
        raise self._unknown(f"{side} {part.replace('_', ' ')}", f"{side.title()}{_NAMES[part][0].title()}")

    def _unknown(self, what: str, name: str) -> BvhFaultError:
        names = listed([bone.name for bone in self.skeleton.bones], 40)
        return BvhFaultError(
            f"no bone is known as the {what} of a human; call it {name} in the file. There are: {names}",
            self.skeleton.bones[0].line,
        )

    def _common(self, bones: list[int]) -> int:
        """The nearest bone that all of these hang on."""
        first, second = (self.skeleton.above(bone)[1:] for bone in bones)
        shared = [bone for bone in first if bone in second]
        if not shared:
            raise BvhFaultError("left and right limbs hang on no common bone", self.skeleton.bones[0].line)
        return shared[0]

    def _middle(self, part: str) -> Array:
        return 0.5 * (self.places[self.bones["left", part]] + self.places[self.bones["right", part]])

    def _direction(self, vector: Array, why: str, bone: int = 0) -> Array:
        length = np.linalg.norm(vector)
        if not length > 0.0:
            raise BvhFaultError(why, self.skeleton.bones[bone].line)
        return vector / length


def _plain(name: str) -> str:
    """Letters of a name in lower case, without what stands before a colon: "mixamorig:LeftArm" -> "leftarm"."""
    return re.sub(r"^mixamorig\d*|[^a-z]", "", name.rpartition(":")[2].lower())
