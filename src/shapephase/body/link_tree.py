"""Links and joints as a file has them, whatever its format, and the checks that a tree of real links passes.

A `LinkTree` is plain numbers: the model for Pinocchio is made from it, and the check of that model, too.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches

import numpy as np

from ..arrays import Array
from ..errors import ModelFileError, UnphysicalInertiaError, unknown_name
from .couplings.coupling import Coupling
from .formats.xml_text import listed

MOST_LINKS = 2000  # most of them fixed to others
MOST_JOINTS = 200  # moving: Pinocchio's work space grows with their cube, 0.3 GB for 200
MOST_DEPTH = 200  # links from the root: recursive parsers overflow a stack of 512 KiB at 229
LEAST_MASS = 1e-15  # [kg] Pinocchio's sums of inertias are silently wrong below the rounding of 1 kg
MOST_MASS = 1e30  # [kg], and [kg m^2] for moments: their squares are still finite
TRIANGLE = 1e-3  # of the largest moment, above the sum of the others: files round their moments
NEGATIVE = 1e-6  # of the largest moment, below zero: six digits of a thin body
ROUNDING = 1e-12  # of the body's largest moment: what rounding leaves of zero
_RADII = (1e-4, 10.0)  # [m] of gyration: outside, moments are probably not in kg m^2, or lengths in millimetres
_HOLLOW = 0.01  # of the body's inertia about an axis, in links without mass: some files give dummies a little
_HEAVY = 1e5  # [kg] of a link: above, masses are probably in grams


@dataclass(frozen=True)
class Link:
    """One link.

    name, where : its name, and "file:line"
    mass : [kg]
    centre : (3,) centre of mass in link axes [m]
    inertia : (3, 3) about the centre of mass, link axes [kg m^2]
    """

    name: str
    where: str
    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass(frozen=True)
class Joint:
    """One joint: the child's axes are the parent's, moved by (place, turn), then by the joint, then by `after`.

    kind : "revolute", "continuous", "prismatic", "screw", "ball" or "fixed"; towards a base also "floating" or "planar"
    place, turn : (3,) [m], (3, 3) the joint's axes in those of the parent
    axis : (3,) in the joint's axes, of any length; of a ball joint it means nothing
    after : (3,) the origin of the child in the joint's axes [m]
    limits : lower and upper [rad or m]
    most : the largest effort and rate that a file states [N m or N], [rad/s or m/s]; zero: none
    lead : of a screw, along the axis [m/rad]
    """

    name: str
    where: str
    kind: str
    parent: str
    child: str
    place: Array
    turn: Array
    axis: Array
    after: Array = field(default_factory=lambda: np.zeros(3))
    limits: tuple[float, float] = (-np.inf, np.inf)
    most: tuple[float, float] = (0.0, 0.0)
    lead: float = 0.0


@dataclass(frozen=True)
class LinkTree:
    """All links and joints of a body, parents before children.

    name : of the robot
    links : by name, the root first
    joints : in the order in which they were found on the way down from the root
    couplings : of the joints that follow others, by name
    frames : names of links that are mere steps between the axes of one joint and the next
    notes : what is left out of the file
    text : the URDF that was checked, written anew; None for other formats, and with ball joints
    base_joints : what leads to the root link from a world without mass: coordinates of the base, not of the shape
    base_angles : names of three angles of the root link, and the axis that each turns about as those before have turned
        it, as "zxy"; None where the file names none
    base_slides : names of three coordinates that move the root link along x, y and z; None where the file names none
    length_unit : of a motion of the same file [m]; None where the format has a unit of its own
    """

    name: str
    links: dict[str, Link]
    joints: tuple[Joint, ...]
    couplings: dict[str, Coupling] = field(default_factory=dict)
    frames: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()
    text: str | None = None
    base_joints: tuple[Joint, ...] = ()
    base_angles: tuple[tuple[str, ...], str] | None = None
    base_slides: tuple[str, ...] | None = None
    length_unit: float | None = None


@dataclass(frozen=True)
class JointOrder:
    """An order of all joints of a body, those that follow others among them.

    word : the user's name of the order
    joints : names of coordinates; of a ball joint four, w first
    links : in the simulator's order of bodies: the base, and behind it what each joint moves, or all links of the file
    """

    word: str
    joints: tuple[str, ...]
    links: tuple[str, ...]


def from_the_root(links: dict[str, Link], joints: Iterable[Joint], where: str) -> tuple[str, tuple[Joint, ...]]:
    """The root link, and the joints sorted so that parents come before children."""
    joints = tuple(joints)
    moving = sum(joint.kind != "fixed" for joint in joints)
    for count, most, kind in ((len(links), MOST_LINKS, "links"), (moving, MOST_JOINTS, "moving joints")):
        if count > most:
            raise ModelFileError(f"{where}:1: the body has {count} {kind}; up to {most} are supported: leave some out")
    above: dict[str, Joint] = {}
    below: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in joints:
        for end, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise ModelFileError(
                    f"{joint.where}: joint {joint.name!r}: its {end} link {link!r} does not exist; there is "
                    f"{listed(get_close_matches(link, links, 5, 0.4) or list(links)[:5])}"
                )
        if joint.child in above:
            first = above[joint.child]
            raise ModelFileError(
                f"{joint.where}: joint {joint.name!r}: link {joint.child!r} has two parents, joints {first.name!r} "
                f"({first.where}) and {joint.name!r}; keep one"
            )
        above[joint.child] = joint
        below[joint.parent].append(joint)
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        raise ModelFileError(
            f"{links[roots[1]].where}: link {roots[1]!r}: {len(roots)} links have no parent, one is allowed: "
            f"{listed(roots)}; join them with joints"
        )
    sorted_joints: list[Joint] = []
    level, depth, reached = roots, 0, set(roots)
    while level:
        depth += 1
        if depth > MOST_DEPTH:
            raise ModelFileError(
                f"{links[level[0]].where}: link {level[0]!r}: a chain of more than {MOST_DEPTH} "
                "links; fix some into one"
            )
        joints_below = [joint for parent in level for joint in below[parent]]
        sorted_joints += joints_below
        level = [joint.child for joint in joints_below]
        reached.update(level)
    lost = [name for name in links if name not in reached]
    if lost:
        raise ModelFileError(
            f"{links[lost[0]].where}: link {lost[0]!r}: links that form a closed chain: {listed(lost)}; "
            "remove one of their joints"
        )
    return roots[0], tuple(sorted_joints)


def inertia_warnings(links: Iterable[Link], on_unphysical: str, label: str = "link {!r}") -> list[str]:
    """Doubts about the inertia of links, one message for each kind.

    Negative moments; moments that break the triangle inequality by more than 0.1 %; a mass or a radius of gyration
    that suggests wrong units. What rounding leaves of an inertia, judged against the largest of the whole body, is
    no fault. `label` is how messages name a link.
    """
    if not isinstance(on_unphysical, str) or on_unphysical not in ("error", "warn"):
        raise unknown_name("value of on_unphysical", on_unphysical, ("error", "warn"))
    links = list(links)
    for link in links:
        if not (np.isfinite(link.mass) and np.isfinite(link.inertia).all() and link.mass >= 0.0):
            numbers = f"mass {link.mass} kg and inertia {link.inertia.tolist()} kg m^2"
            raise UnphysicalInertiaError(
                f"{link.where}: {label.format(link.name)}: no real body has {numbers}; correct them"
            )
    masses = np.array([link.mass for link in links])
    moments = np.linalg.eigvalsh(np.array([link.inertia for link in links]).reshape(-1, 3, 3))
    offsets = np.array([link.centre for link in links]).reshape(-1, 3)
    floor = ROUNDING * np.max(moments[:, 2] + masses * (offsets**2).sum(axis=-1), initial=0.0)
    negative = moments[:, 0] < -NEGATIVE * np.maximum(moments[:, 2], 0.0) - floor
    if negative.any() and on_unphysical == "error":
        first = int(np.argmax(negative))
        others = [label.format(links[i].name) for i in np.flatnonzero(negative)[1:]]
        also = f" (also {listed(others)})" if others else ""
        raise UnphysicalInertiaError(
            f"{links[first].where}: {label.format(links[first].name)} has principal moments {moments[first]} "
            f"kg m^2, one of them negative{also}; correct the file, or load it with on_unphysical='warn' "
            "(--on-unphysical warn)"
        )
    broken = ~negative & (moments[:, 2] - moments[:, 1] - moments[:, 0] > TRIANGLE * moments[:, 2] + floor)
    # A radius from the largest moment: a rod may be as thin as it likes.
    radius = np.sqrt(np.maximum(moments[:, 2], 0.0) / np.where(masses > 0.0, masses, np.inf))
    real = (masses > 0.0) & (moments[:, 2] > floor)
    strange = (real & ((radius > _RADII[1]) | (radius < _RADII[0]))) | (masses > _HEAVY)
    kinds = (
        (negative, "a negative principal moment"),
        (broken, "principal moments that break the triangle inequality: no distribution of mass has them"),
        (
            strange,
            f"a mass above {_HEAVY:g} kg, or a radius of gyration above {_RADII[1]:g} m or below "
            f"{_RADII[0]:g} m; the units are kg, m and kg m^2",
        ),
    )
    doubts = []
    for which, text in kinds:
        if which.any():
            bad = [links[i] for i in np.flatnonzero(which)]
            doubts.append(f"{bad[0].where}: {listed([label.format(link.name) for link in bad])}: {text}")
    return doubts


def hollow_warnings(
    links: Iterable[Link], turns: Array, inertia: Array, on_unphysical: str, label: str = "link {!r}"
) -> list[str]:
    """The links without mass that have moments of inertia, as one message.

    turns : (N, 3, 3) axes of the links to those of the base, in the neutral shape
    inertia : (3, 3) of the whole body there, base axes [kg m^2]
    """
    links = list(links)
    moments, axes = np.linalg.eigh(inertia)
    if moments[-1] <= 0.0:
        return []
    # Scaled so that the body's is the identity; what it has about its thinnest axis may be nothing but rounding.
    scaled = axes / np.sqrt(np.maximum(moments, ROUNDING * moments[-1]))
    hollow = []
    for link, turn in zip(links, turns, strict=True):
        largest = float(np.linalg.eigvalsh(link.inertia)[-1])
        if link.mass == 0.0 and largest > ROUNDING * moments[-1]:
            share = float(np.linalg.eigvalsh(scaled.T @ turn @ link.inertia @ turn.T @ scaled)[-1])
            hollow.append((share, largest, link))
    if not hollow:
        return []
    share, largest, worst = max(hollow, key=lambda each: each[0])
    if share > _HOLLOW and on_unphysical == "error":
        raise UnphysicalInertiaError(
            f"{worst.where}: {label.format(worst.name)} has no mass and a moment of inertia of {largest:.4g} kg m^2, "
            f"{share:.3g} of the whole body's: no distribution of mass has that; give it its mass, or none of both, or "
            "load it with on_unphysical='warn' (--on-unphysical warn)"
        )
    named = listed([f"{label.format(link.name)} ({moment:.3g} kg m^2)" for _, moment, link in hollow])
    return [
        f"{hollow[0][2].where}: {named}: moments of inertia without mass, up to {share:.2g} of the whole body's: no "
        "distribution of mass has them; they count as the file has them"
    ]


def massless_warning(tree: LinkTree) -> list[str]:
    """The links that a joint moves although neither they nor anything attached to them has mass."""
    carried = {name: link.mass for name, link in tree.links.items()}
    for joint in reversed(tree.joints):
        carried[joint.parent] += carried[joint.child]
    idle = [
        j.child for j in tree.joints if j.kind != "fixed" and carried[j.child] == 0.0 and j.child not in tree.frames
    ]
    if not idle:
        return []
    where = tree.links[idle[0]].where
    named = listed([f"link {name!r}" for name in idle])
    return [f"{where}: {named}: moved by a joint, but without mass, and nothing with mass is attached to it"]


def grouped(notes: Iterable[tuple[str, str, str, str]]) -> tuple[str, ...]:
    """One sentence for each kind of note: of many joints with one fault, all names stand in one.

    notes : "file:line", what it is about ("joint"), its name, and the text
    """
    by_text: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for where, kind, name, text in notes:
        by_text.setdefault((kind, text), []).append((where, name))
    sentences = []
    for (kind, text), places in by_text.items():
        first = places[0][0]
        # Later ones by their line alone, where a line is known.
        names = [name if where == first else f"{name} (line {where.rpartition(':')[2]})" for where, name in places]
        sentences.append(f"{first}: {kind}{'s' * (len(names) > 1)} {listed(names)}: {text}")
    return tuple(sentences)
