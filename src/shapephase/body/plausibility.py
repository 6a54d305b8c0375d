"""Numbers of a body that are possible, but that hardly any real body has: other units, or a slip in a file."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence

import numpy as np

from ..arguments import check_object
from ..arrays import Array
from .body import Body
from .drawing.appearance import drawn_shapes
from .drawing.visual import Visual, inertia_box
from .formats.urdf import WHOLE_TURN
from .formats.xml_text import listed
from .link_tree import ROUNDING
from .loading import as_body

_DENSITIES = (0.1, 22_600.0)  # [kg/m^3] a tenth of air, and osmium: no matter on earth is denser
_MASS_RATIO = 1e4  # of links on one joint: a fingertip on an arm is a thousandth
_FARTHEST = 50.0  # [m] from joint to joint: a shin is 450 in millimetres, the longest boom in orbit is 30
_GYRATION = (0.01, 3.0)  # of the drawn width: a solid has less than a half, one drawn in millimetres a thousandth
_HEIGHTS = (0.9, 2.4)  # [m] of standing people
_BEYOND_JOINTS = 0.039 + 0.130  # of the height: below ankles, above the head's joint (Drillis and Contini 1964)


def implausible(body: Body | str) -> tuple[str, ...]:
    """Return reasons to doubt that a body is real, a sentence for each kind.

    Links that are denser than any matter or lighter than air, by the box of their inertia or by what is drawn of them;
    masses of neighbours that differ ten thousandfold; joints that are not limited although their kind is, or beyond a
    whole turn; lengths that look like millimetres; mass that is all on one line. Nothing of this makes a body
    unusable.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> sp.body.implausible(cat)
    ()
    """
    body = as_body(body)
    chain, masses = body.chain, body.chain.masses
    names = [""] * len(masses)
    for link, (frame, _) in chain.link_frames.items():
        names[frame] = names[frame] or link
    shapes: dict[int, list[Visual]] = {}
    drawn, _, incomplete = drawn_shapes(body)
    for shape in drawn:
        shapes.setdefault(chain.link_frames[shape.link][0], []).append(shape)
    # The width of a link is unknown while some of its shapes are missing.
    for link in incomplete & chain.link_frames.keys():
        shapes.pop(chain.link_frames[link][0], None)
    doubts = _LinkDoubts(names)
    for frame in np.flatnonzero(masses > 0.0).tolist():
        mass = float(masses[frame])
        edges = np.sort(inertia_box(mass, chain.inertias[frame])[0])
        if chain.inertias[frame].any():
            # Moments near the smallest number have no roots; those of a point mass are zero.
            edges = np.maximum(edges, sys.float_info.min)
        _judge_density(doubts, body, frame, edges, shapes.get(frame, []))
    _judge_neighbours(doubts, chain.parents, masses)
    _judge_lengths(doubts, chain.places, chain.centres)
    return (*doubts.sentences(), *_line_doubts(body), *_limit_doubts(body), *_height_doubts(body))


def person_height(body: Body) -> float | None:
    """Height of the person of a motion capture file [m], to a tenth; None for other bodies.

    From ankle to hip and on to the head's joint along the bones, whatever the pose, and what is beyond them.
    """
    check_object(body, "Body", "body")
    if body.length_unit is None:
        return None
    chain = body.chain
    along = np.zeros(len(chain.masses))
    for child, parent in enumerate(chain.parents, 1):
        along[child] = along[parent] + np.linalg.norm(chain.places[child - 1])

    def reach(*endings: str) -> float:
        ends = ((frame, pose) for link, (frame, pose) in chain.link_frames.items() if link.lower().endswith(endings))
        return float(min((along[frame] + np.linalg.norm(pose[:3, 3]) for frame, pose in ends), default=0.0))

    legs, trunk = reach("foot", "ankle"), reach("head")
    return (legs + trunk) / (1.0 - _BEYOND_JOINTS) if legs and trunk else None


def _height_doubts(body: Body) -> Iterable[str]:
    height = person_height(body)
    if height is not None and not _HEIGHTS[0] <= height <= _HEIGHTS[1]:
        yield (
            f"the person stands {height:.2g} m tall: is the unit of length right? Give length_unit (--length-unit), as "
            "0.01 for centimetres or 0.0254 for inches"
        )


def _line_doubts(body: Body) -> Iterable[str]:
    """A doubt where all mass is on one line, so that no inertia determines the turn about it."""
    shape = body.shape()
    moments = np.linalg.eigvalsh(body.locked_inertia(shape))
    largest = moments[-1] + body.mass * float(np.sum(body.centre_of_mass(shape) ** 2))
    if moments[0] <= ROUNDING * largest:
        where = "on one line" if moments[-1] > ROUNDING * largest else "in one point"
        yield (
            f"all mass is {where} in the neutral shape: its turns about that are not determined; give the links "
            "moments of inertia"
        )


class _LinkDoubts:
    """Doubts about links by kind, the worst link first."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._by_kind: dict[str, list[tuple[float, str]]] = {}

    def add(self, kind: str, frame: int, excess: float, numbers: str) -> None:
        self._by_kind.setdefault(kind, []).append((excess, f"{self._names[frame]!r} ({numbers})"))

    def sentences(self) -> Iterable[str]:
        for kind, links in self._by_kind.items():
            worst_first = [text for _, text in sorted(links, key=lambda item: -item[0])]
            yield _sentence("link", worst_first, kind)


def _judge_density(doubts: _LinkDoubts, body: Body, frame: int, edges: Array, shapes: Sequence[Visual]) -> None:
    mass, width = float(body.chain.masses[frame]), _width(body, shapes) if shapes else 0.0
    longest, volume = float(edges[-1]), float(np.prod(edges))
    dense = min(mass / max(longest**3, sys.float_info.min), sys.float_info.max) if longest else 0.0
    light = mass / volume if volume else math.inf
    if width:
        dense = max(dense, mass / width**3)
        if all(shape.kind != "mesh" for shape in shapes):
            light = min(light, mass / sum(shape.volume for shape in shapes))
        # From the largest moment, so that it holds for rods.
        radius = math.sqrt(float(edges[1] ** 2 + edges[2] ** 2) / 12.0)
        numbers = f"radius of gyration {radius:.3g} m, {width:.3g} m wide"
        if radius > _GYRATION[1] * width:
            doubts.add("the inertia is that of a much larger body than is drawn", frame, radius / width, numbers)
        if 0.0 < radius < _GYRATION[0] * width:
            kind = "the inertia is that of a much smaller body than is drawn; is the drawing in millimetres?"
            doubts.add(kind, frame, width / radius, numbers)
    units = "are masses in kg, lengths in m and moments in kg m^2?"
    if dense > _DENSITIES[1]:
        doubts.add(f"denser than any matter; {units}", frame, dense, f"{mass:.3g} kg, {dense:.2g} kg/m^3 or more")
    if light < _DENSITIES[0]:
        doubts.add(f"lighter than air; {units}", frame, 1.0 / light, f"{mass:.3g} kg, {light:.2g} kg/m^3")


def _judge_neighbours(doubts: _LinkDoubts, parents: Sequence[int], masses: Array) -> None:
    kind = "masses that differ ten thousandfold from their neighbours'"
    for child, parent in enumerate(parents, 1):
        # Frames without mass are steps between the axes of one joint and the next.
        while parent and not masses[parent]:
            parent = parents[parent - 1]
        pair = masses[[child, parent]]
        if pair.all() and pair.max() > _MASS_RATIO * pair.min():
            numbers = f"{masses[child]:.3g} kg on {masses[parent]:.3g} kg"
            doubts.add(kind, child, pair.max() / pair.min(), numbers)


def _judge_lengths(doubts: _LinkDoubts, places: Array, centres: Array) -> None:
    kind = "very far from its joint or the joint before; are lengths in millimetres?"
    away = np.linalg.norm(centres, axis=-1)
    away[1:] = np.maximum(away[1:], np.linalg.norm(places, axis=-1))
    for frame in np.flatnonzero(away > _FARTHEST).tolist():
        doubts.add(kind, frame, float(away[frame]), f"{away[frame]:.3g} m")


def _limit_doubts(body: Body) -> Iterable[str]:
    columns = zip(body.joint_names, body.joint_limits.tolist(), body.joint_units, body.continuous, strict=True)
    joints = [(name, limits, unit) for name, limits, unit, endless in columns if not endless and unit != "1"]
    missing = [repr(name) for name, limits, _ in joints if not all(map(math.isfinite, limits))]
    if missing:
        yield _sentence("joint", missing, "not limited on both sides")
    beyond = [
        f"{name!r} ({lower:.6g} to {upper:.6g} rad)"
        for name, (lower, upper), unit in joints
        if unit == "rad" and max(map(abs, filter(math.isfinite, (lower, upper))), default=0.0) > WHOLE_TURN
    ]
    if beyond:
        yield _sentence("joint", beyond, "limited beyond a whole turn; are limits in degrees?")


def _sentence(what: str, names: Sequence[str], kind: str) -> str:
    return f"{what}{'s' * (len(names) > 1)} {listed(names, 10)}: {kind}"


def _width(body: Body, shapes: Sequence[Visual]) -> float:
    """The diagonal of the box around all that is drawn of a frame [m]."""

    def corners(shape: Visual) -> Array:
        turned = body.chain.link_frames[shape.link][1] @ shape.pose
        return shape.corners @ turned[:3, :3].T + turned[:3, 3]

    return float(np.linalg.norm(np.ptp(np.concatenate([*map(corners, shapes)]), axis=0)))
