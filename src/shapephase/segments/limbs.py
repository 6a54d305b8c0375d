"""Limbs of a body, found from its tree of links, and the joints that move them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import pairwise, takewhile

import numpy as np

from ..arguments import check_mapping
from ..arrays import Array
from ..body.body import Body
from ..body.link_motions import link_motions
from ..body.loading import as_body
from ..display import frozen
from ..errors import ShapeError, unknown_name
from ..letters import value_text

_BRANCH = (
    0.01  # of the mass: a hand is 0.6 % of a person, a forearm with hand 2.2 % (de Leva 1996); fingers fork no trunk
)
_MIRRORED = 0.01  # difference of masses and distances of two limbs, relative: left and right of measured models
GROUPINGS = ("limbs", "joints")
WHEELS = "wheels"  # the group of the momentum that wheels store
CONDITIONS = ("momentum", "attitude", "duration", "body")  # in which two motions can differ besides their joints
_KINDS = {
    "leg": re.compile(r"(?i)leg|thigh|shank|femur|tibia|foot|hip|knee|ankle|cuisse|jambe|calf|hind"),
    "arm": re.compile(r"(?i)arm|hand|humer|radius|elbow|wrist|shoulder|clavic|bras"),
    "head": re.compile(r"(?i)head|neck|skull|tete"),
    "tail": re.compile(r"(?i)tail"),
    "wheel": re.compile(r"(?i)wheel|rotor"),
    "wing": re.compile(r"(?i)wing|panel"),
}
_SIDE = re.compile(r"(?<![A-Za-z])([LlRr])(?:eft|ight|EFT|IGHT)?(?![a-z])|([LR])(?:eft|ight)|^([lr])(?=[A-Z])")
_END = re.compile(r"(?i)(?<![a-z])(front|rear|fore|hind)(?![a-z])")


@dataclass(frozen=True, eq=False)
class Limb:
    """Joints that move together, with the names by which it is paired with another.

    joints : names of the joints, as in `SegmentTree.joints`
    kind, side, end : "arm", "left" or "right", "front" or "rear"; "" where unknown
    mass : [kg]
    parent : frame on which it hangs
    distance : of its centre of mass from that of the parent, neutral shape [m]
    """

    joints: tuple[str, ...]
    kind: str
    side: str
    end: str
    link: str
    mass: float
    parent: int
    distance: float


class SegmentTree:
    """Segments of a body, frames that carry mass, and the joints between them.

    Several axes between two segments are one joint; its name is that part which the names of its axes share, or that of
    the link that it moves.
    """

    def __init__(self, body: Body) -> None:
        self.body = body
        chain = self.body.chain
        self.frames = [
            frame
            for frame in range(len(chain.masses))
            if frame == 0 or chain.masses[frame] > 0.0 or frame not in chain.parents
        ]
        self._links: dict[int, str] = {}
        for link, (frame, _) in chain.link_frames.items():
            self._links.setdefault(frame, link)
        # From each segment up to the next one: the axes of its joint, and the segment that it hangs on.
        self.above: dict[int, int] = {}
        self._axes: dict[int, list[int]] = {}
        for frame in self.frames[1:]:
            axes, parent = [frame], chain.parents[frame - 1]
            while parent not in self.frames:
                axes, parent = [parent, *axes], chain.parents[parent - 1]
            self.above[frame], self._axes[frame] = parent, axes

    @cached_property
    def joint_of(self) -> dict[int, str]:
        """Name of the joint that moves each segment; segments whose axes all follow other joints have none."""
        coordinates = {frame: self._coordinates(axes) for frame, axes in self._axes.items()}
        names = {frame: self._joint_name(frame, known) for frame, known in coordinates.items() if known}
        doubled = {name for name, count in Counter(names.values()).items() if count > 1}
        return {
            frame: coordinates[frame][0] if name in doubled and len(coordinates[frame]) == 1
            else self._links.get(frame, coordinates[frame][0]) if name in doubled
            else name
            for frame, name in names.items()
        }  # fmt: skip

    @cached_property
    def joints(self) -> dict[str, tuple[int, ...]]:
        """Columns of the shape that belong to each joint."""
        columns: dict[str, tuple[int, ...]] = {}
        taken: set[int] = set()
        for frame, name in self.joint_of.items():
            own = tuple(c for c in self.body.joint_columns(self._coordinates(self._axes[frame])) if c not in taken)
            columns[name] = columns.get(name, ()) + own
            taken.update(own)
        return {name: own for name, own in columns.items() if own}

    @cached_property
    def branch_masses(self) -> Array:
        """Mass of each frame with all that hangs on it: (k + 1,) [kg]."""
        masses = self.body.chain.masses.copy()
        for frame in reversed(self.frames[1:]):
            masses[self.above[frame]] += masses[frame]
        return masses

    @cached_property
    def trunk_frames(self) -> set[int]:
        """Segments at which the body branches, and those between them; of a body without branches the heaviest one."""
        masses, total = self.body.chain.masses, self.body.mass
        neighbours: dict[int, list[float]] = {frame: [] for frame in self.frames}
        for frame, parent in self.above.items():
            neighbours[parent].append(self.branch_masses[frame])
            neighbours[frame].append(total - self.branch_masses[frame])
        degrees = {frame: sum(mass >= _BRANCH * total for mass in sides) for frame, sides in neighbours.items()}
        hubs = {frame for frame, degree in degrees.items() if degree > 2}
        heaviest = max(self.frames, key=lambda frame: masses[frame])
        if not hubs or degrees[heaviest] > 1:
            hubs.add(heaviest)
        if degrees[0] > 1:
            hubs.add(0)
        ways = [self._way_up(frame) for frame in hubs]
        shared = set.intersection(*map(set, ways))
        meeting = next(frame for frame in ways[0] if frame in shared)
        return {frame for way in ways for frame in way[: way.index(meeting) + 1]}

    @property
    def trunk(self) -> str:
        """Link of the trunk: the base where it belongs to the trunk, else the heaviest link of the trunk."""
        frame = 0 if 0 in self.trunk_frames else max(self.trunk_frames, key=lambda f: self.body.chain.masses[f])
        return self._links[frame]

    def limbs(self) -> dict[str, Limb]:
        """Subtrees off the trunk by name, and the joints within the trunk."""
        inside = self.trunk_frames
        top = next(frame for frame in self.frames if frame in inside)
        pieces: dict[int, list[int]] = {}
        inner: list[int] = []
        for frame in self.joint_of:
            outer = frame if frame not in inside else self.above[frame]
            if outer in inside:
                inner.append(frame)
                continue
            way = self._way_up(outer)
            # A way up that does not meet the trunk is that of the limb with the base, on which the trunk hangs.
            lowest = next((below for below, step in pairwise(way) if step in inside), self.above.get(top, 0))
            pieces.setdefault(lowest, []).append(frame)
        limbs = [
            self._limb(frames, self.above[low] if self.above.get(low) in inside else top, low)
            for low, frames in pieces.items()
        ]
        named = dict(zip(self._limb_names(limbs), limbs, strict=True))
        if inner:
            joints = tuple(dict.fromkeys(self.joint_of[frame] for frame in inner))
            name = joints[0] if len(joints) == 1 else "trunk"
            named[name] = Limb(joints, "", "", "", "", 0.0, -1, 0.0)
        return named

    def _coordinates(self, axes: Iterable[int]) -> tuple[str, ...]:
        """Independent joints among the axes; of a ball joint its name."""
        chain, body = self.body.chain, self.body
        names: dict[str, None] = {}
        for frame in axes:
            name = chain.names[frame - 1]
            ball = next((b.name for b in chain.follows.balls if b.row <= frame - 1 <= b.row + 2), None)
            if ball is not None:
                names[ball] = None
            elif name in body.joint_names:
                names[name] = None
        return tuple(names)

    def _joint_name(self, frame: int, coordinates: tuple[str, ...]) -> str:
        if len(coordinates) == 1:
            return coordinates[0]
        words = zip(*(re.split(r"[ _.-]", name) for name in coordinates), strict=False)
        shared = [alike[0] for alike in takewhile(lambda alike: len(set(alike)) == 1, words)]
        return "_".join(shared) if shared else self._links.get(frame, coordinates[0])

    def _way_up(self, frame: int) -> list[int]:
        way = [frame]
        while way[-1]:
            way.append(self.above[way[-1]])
        return way

    def _limb(self, frames: list[int], parent: int, first: int) -> Limb:
        """A limb of joints that move these segments; `first` is its segment next to the parent in the trunk."""
        chain = self.body.chain
        own = sorted({first, *frames, *(self.above[frame] for frame in frames)} - self.trunk_frames)
        shape = self.body.shape()
        places = link_motions(chain, shape[None], np.zeros_like(shape)[None]).places[0]
        mass = float(chain.masses[own].sum())
        centre = chain.masses[own] @ places[own] / mass if mass else places[own].mean(axis=0)
        joints = tuple(dict.fromkeys(self.joint_of[frame] for frame in frames))
        words = [link for link, (frame, _) in chain.link_frames.items() if frame in own and chain.masses[frame] > 0.0]
        counts = Counter(kind for word in words or joints for kind, found in _KINDS.items() if found.search(word))
        side = next((match for word in (*words, *joints) if (match := _SIDE.search(word))), None)
        end = next((match[1].lower() for word in (*words, *joints) if (match := _END.search(word))), "")
        return Limb(
            joints=joints,
            kind=max(counts, key=lambda kind: counts[kind]) if counts else "",
            side="" if side is None else {"l": "left", "r": "right"}[next(g for g in side.groups() if g).lower()],
            end={"fore": "front", "hind": "rear"}.get(end, end),
            link=self._links.get(first, joints[0]),
            mass=mass,
            parent=parent,
            distance=float(np.linalg.norm(centre - places[parent])),
        )

    @staticmethod
    def _limb_names(limbs: list[Limb]) -> list[str]:
        """Names in words, "left arm"; the first link's where words do not tell limbs apart."""
        kinds = Counter(limb.kind for limb in limbs)
        words = []
        for limb in limbs:
            alone = kinds[limb.kind] == 1
            kind = "legs" if limb.kind == "leg" and alone and not limb.side else limb.kind
            words.append(" ".join(filter(None, (limb.end, limb.side, kind))) if kind else limb.link)
        counts = Counter(words)
        names = [word if counts[word] == 1 else limb.link for word, limb in zip(words, limbs, strict=True)]
        doubled = Counter(names)
        return [name if doubled[name] == 1 else limb.joints[0] for name, limb in zip(names, limbs, strict=True)]


def mirrored_pairs(limbs: Mapping[str, Limb]) -> dict[str, tuple[str, str]]:
    """Two limbs that are mirror images of each other, by their names, else by place and mass: name of both -> names."""
    pairs: dict[str, tuple[str, str]] = {}
    for by_words in (True, False):
        taken = {name for pair in pairs.values() for name in pair}
        alike: dict[object, list[str]] = {}
        for name, limb in limbs.items():
            if name in taken or limb.parent < 0:
                continue
            if not by_words:
                near = (k for k, others in alike.items() if _mirrored(limb, limbs[others[0]]))
                alike.setdefault(next(near, name), []).append(name)
            elif limb.side:
                rest = _SIDE.sub("*", limb.link) if limb.kind == "" else limb.kind
                alike.setdefault((limb.end, rest), []).append(name)
        for names in alike.values():
            sides = {limbs[name].side for name in names}
            if len(names) == 2 and (not by_words or len(sides) == 2):
                first, second = limbs[names[0]], limbs[names[1]]
                both = " ".join(filter(None, (first.end if first.end == second.end else "", f"{first.kind}s")))
                known = first.kind == second.kind != "" and both not in pairs
                pairs[both if known else " and ".join(names)] = (names[0], names[1])
    return pairs


def _mirrored(first: Limb, second: Limb) -> bool:
    """True where two limbs on one segment have as many joints, equal masses and equal distances from it."""
    return (
        first.parent == second.parent
        and len(first.joints) == len(second.joints)
        and first.kind == second.kind
        and abs(first.mass - second.mass) <= _MIRRORED * max(first.mass, second.mass)
        and abs(first.distance - second.distance) <= _MIRRORED * max(first.distance, second.distance)
    )


@frozen
class JointGroups:
    """Groups of joints whose shares are computed.

    Attributes
    ----------
    columns : of the shape, by name of the group
    joints : names of joints, by name of the group
    rest : joints in no group
    pairs : mirrored groups by the name of both

    Examples
    --------
    >>> sp.segments.joint_groups(sp.load_body("diver")).pairs
    {'arms': ('left arm', 'right arm')}
    """

    columns: dict[str, tuple[int, ...]]
    joints: dict[str, tuple[str, ...]]
    rest: tuple[str, ...]
    pairs: dict[str, tuple[str, str]]


def joint_groups(body: Body | str, groups: str | Mapping[str, str | Iterable[str]] = "limbs") -> JointGroups:
    """Return groups of a body's joints: its limbs, its joints, or those that patterns of names choose.

    Parameters
    ----------
    body : with two groups or more; of a body with one limb alone each joint is a group, with one joint each coordinate
    groups : "limbs", "joints", or patterns of joint names such as "left_*" by name of the group

    Raises
    ------
    UnknownNameError
        For another word, or a pattern that matches no joint.
    ShapeError
        If a joint is in two groups.

    Examples
    --------
    >>> sp.segments.joint_groups(sp.load_body("diver")).joints
    {'left arm': ('left_shoulder_abduction',), 'right arm': ('right_shoulder_abduction',)}
    >>> sp.segments.joint_groups(sp.load_body("satellite"), {"arm": "arm_*"}).rest
    ('boom_extension', 'left_wing_drive', 'right_wing_drive', 'wheel_spin')
    """
    body = as_body(body)
    tree = SegmentTree(body)
    if isinstance(groups, str):
        if groups not in GROUPINGS:
            raise unknown_name("groups", groups, GROUPINGS)
        limbs = tree.limbs()
        by_limb = {name: limb.joints for name, limb in limbs.items() if any(j in tree.joints for j in limb.joints)}
        if groups == "limbs" and len(by_limb) > 1:
            columns = {name: _columns(tree, joints) for name, joints in by_limb.items()}
            kept = {name: limbs[name] for name in columns}
            return JointGroups(columns, by_limb, (), mirrored_pairs(kept))
        columns = dict(tree.joints)
        if len(columns) < 2:
            columns = {name: tuple(body.joint_columns([name])) for name in _coordinate_names(body)}
        return JointGroups(columns, {name: (name,) for name in columns}, (), {})
    check_mapping(groups, "groups", "patterns of joint names by group, such as {'arms': ['left_*', 'right_*']}")
    return _matched_groups(tree, groups)


def _matched_groups(tree: SegmentTree, groups: Mapping[str, str | Iterable[str]]) -> JointGroups:
    body, owner = tree.body, {}
    names = _coordinate_names(body)
    joints: dict[str, tuple[str, ...]] = {}
    for group, patterns in groups.items():
        several = (patterns,) if isinstance(patterns, str) else tuple(patterns) if np.iterable(patterns) else ()
        if not isinstance(group, str) or not several or not all(isinstance(pattern, str) for pattern in several):
            raise ShapeError(
                f"groups: the name of a group and names of its joints are needed, got {value_text(group)}: "
                f"{value_text(patterns)}"
            )
        for pattern in several:
            # The name of a joint with several axes stands for them all.
            wanted = {c for joint, columns in tree.joints.items() if fnmatchcase(joint, pattern) for c in columns}
            matched = [name for name in names if fnmatchcase(name, pattern) or {*body.joint_columns([name])} <= wanted]
            if not matched:
                raise unknown_name(f"joint of {body.name} in group {group}", pattern, names)
            for name in matched:
                if owner.setdefault(name, group) != group:
                    raise ShapeError(
                        f"groups: joint {name} is in two groups, {owner[name]} and {group}; a joint belongs to one "
                        "at most"
                    )
        joints[group] = tuple(name for name in names if owner.get(name) == group)
    columns = {group: tuple(body.joint_columns(own)) for group, own in joints.items()}
    return JointGroups(columns, joints, tuple(name for name in names if name not in owner), {})


def _columns(tree: SegmentTree, joints: Iterable[str]) -> tuple[int, ...]:
    return tuple(sorted(column for joint in joints for column in tree.joints.get(joint, ())))


def _coordinate_names(body: Body) -> tuple[str, ...]:
    """Names of the joints of one axis, and of ball joints as a whole."""
    numbers = {name: ball.name for ball in body.chain.follows.balls for name in ball.names}
    return tuple(dict.fromkeys(numbers.get(name, name) for name in body.joint_names))


def groups_of_words(words: Iterable[str]) -> str | dict[str, tuple[str, ...]]:
    """Return groups from "limbs", "joints", or words such as "arms=left_*,right_*" and "momentum".

    Raises ShapeError for a word without patterns, or a group that stands twice.
    """
    several = tuple(words)
    if len(several) == 1 and several[0] in GROUPINGS:
        return several[0]
    groups: dict[str, tuple[str, ...]] = {}
    for word in several:
        name, _, patterns = word.partition("=")
        parts = tuple(filter(None, (pattern.strip() for pattern in patterns.split(","))))
        if not name.strip() or name.strip() in groups or not (parts or word in (*CONDITIONS, WHEELS)):
            raise ShapeError(
                f"--groups: limbs, joints, or words such as arms=left_*,right_* are needed, each group once; with "
                f"--baseline FILE also {', '.join(CONDITIONS)}, with wheels {WHEELS}; got {word!r:.60}"
            )
        groups[name.strip()] = parts
    return groups
