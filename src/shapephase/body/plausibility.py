"""Numbers of a body that are possible, but that hardly any real body has: other units, or a slip in a file."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence

import numpy as np

from ..arguments import check_object
from ..arrays import Array
from .appearance import Visual, drawn_shapes, inertia_box
from .body import Body

# Density of osmium [kg/m^3]; no matter on earth is denser.
_DENSEST = 22_600.0
# [kg/m^3], a tenth of air's; what is lighter and not thin would float away.
_LIGHTEST = 0.1
# Of the masses of two links that a joint connects; a fingertip on an arm is a thousandth.
_MASS_RATIO = 1e4
# From one joint to the next, or to a centre of mass [m]; a shin is 450 in millimetres, the longest boom in orbit is 30.
_FARTHEST = 50.0
# Radius of gyration over the width of what is drawn: of any solid within it less than a half.
_WIDEST_MASS = 3.0
# A mesh in millimetres is a thousand times as wide as the mass that it shows.
_NARROWEST_MASS = 0.01
# A joint that is limited at a whole turn, as rounded in a file.
_WHOLE_TURN = 2.0 * math.pi * (1.0 + 1e-3)
# Of moments of inertia, relative to those about the base's origin: what rounding leaves of zero.
_ON_A_LINE = 1e-12
# [m] People are taller.
_SMALLEST_PERSON = 0.9
# [m] People are smaller.
_TALLEST_PERSON = 2.4
# Of a person's height, that is below the ankle and above the head's joint (Drillis and Contini 1964).
_BEYOND_JOINTS = 0.039 + 0.130
# Names in one message.
_MOST_NAMED = 10


def implausible(body: Body) -> tuple[str, ...]:
    """What is unlikely of a real body, a sentence for each kind.

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
    check_object(body, "Body", "body")
    chain = body.chain
    names = [""] * len(chain.masses)
    for link, (frame, _) in chain.link_frames.items():
        names[frame] = names[frame] or link
    masses = chain.masses
    shapes: dict[int, list[Visual]] = {}
    drawn, _, partly = drawn_shapes(body)
    for shape in drawn:
        shapes.setdefault(chain.link_frames[shape.link][0], []).append(shape)
    # How wide a link is nobody knows while some of its shapes are missing.
    for link in partly & chain.link_frames.keys():
        shapes.pop(chain.link_frames[link][0], None)
    widths = {frame: _width(body, found) for frame, found in shapes.items()}
    links = _Links(names)
    for frame in np.flatnonzero(masses > 0.0).tolist():
        mass = float(masses[frame])
        edges = np.sort(inertia_box(mass, chain.inertias[frame])[0])
        if chain.inertias[frame].any():
            # Moments near the smallest number have no roots; those of a point mass are zero.
            edges = np.maximum(edges, sys.float_info.min)
        _judge_density(links, frame, mass, edges, widths.get(frame), shapes.get(frame, ()))
    _judge_neighbours(links, chain.parents, masses)
    _judge_lengths(links, chain.places, chain.centres)
    return (*links.sentences(), *_line_doubts(body), *_limit_doubts(body), *_height_doubts(body))


def person_height(body: Body) -> float | None:
    """How tall the person of a motion capture file stands [m], to a tenth; None of other bodies.

    From ankle to hip and on to the head's joint along the bones, whatever the pose, and what is beyond them.
    """
    check_object(body, "Body", "body")
    if body.length_unit is None:
        return None
    chain = body.chain
    along = np.zeros(len(chain.masses))
    for child, parent in enumerate(chain.parents, 1):
        along[child] = along[parent] + np.linalg.norm(chain.places[child - 1])

    def reach(words: Sequence[str]) -> float:
        found = [
            along[frame] + np.linalg.norm(pose[:3, 3])
            for link, (frame, pose) in chain.link_frames.items()
            if link.lower().endswith(tuple(words))
        ]
        return float(min(found, default=0.0))

    legs, trunk = reach(("foot", "ankle")), reach(("head",))
    return (legs + trunk) / (1.0 - _BEYOND_JOINTS) if legs and trunk else None


def _height_doubts(body: Body) -> Iterable[str]:
    height = person_height(body)
    if height is not None and not _SMALLEST_PERSON <= height <= _TALLEST_PERSON:
        yield (
            f"the person stands {height:.2g} m tall: is the unit of length right? Give length_unit (--length-unit), as "
            "0.01 for centimetres or 0.0254 for inches"
        )


def _line_doubts(body: Body) -> Iterable[str]:
    """Whether all mass is on one line, so that nothing says how the body turns about it."""
    shape = body.shape()
    moments = np.linalg.eigvalsh(body.locked_inertia(shape))
    largest = moments[-1] + body.mass * float(np.sum(body.centre_of_mass(shape) ** 2))
    if moments[0] <= _ON_A_LINE * largest:
        where = "on one line" if moments[-1] > _ON_A_LINE * largest else "in one point"
        yield (
            f"all mass is {where} in the neutral shape: its turns about that are not determined; give the links "
            "moments of inertia"
        )


class _Links:
    """Links by what is unlikely of them, with a number of the worst."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names
        self._found: dict[str, list[tuple[float, str]]] = {}

    def doubt(self, kind: str, frame: int, how_much: float, said: str) -> None:
        self._found.setdefault(kind, []).append((how_much, f"{self.names[frame]!r} ({said})"))

    def sentences(self) -> Iterable[str]:
        for kind, found in self._found.items():
            worst = [text for _, text in sorted(found, key=lambda each: -each[0])]
            yield f"{'link' if len(worst) == 1 else 'links'} {_listed(worst)}: {kind}"


def _judge_density(
    links: _Links, frame: int, mass: float, edges: Array, width: float | None, shapes: Sequence[Visual]
) -> None:
    longest, volume = float(edges[-1]), float(np.prod(edges))
    dense = min(mass / max(longest**3, sys.float_info.min), sys.float_info.max) if longest else 0.0
    light = mass / volume if volume else math.inf
    if width:
        dense = max(dense, mass / width**3)
        if all(shape.kind != "mesh" for shape in shapes):
            light = min(light, mass / sum(map(_volume, shapes)))
        # Of the largest moment, so that it holds for rods.
        radius = math.sqrt(float(edges[1] ** 2 + edges[2] ** 2) / 12.0)
        said = f"radius of gyration {radius:.3g} m, {width:.3g} m wide"
        if radius > _WIDEST_MASS * width:
            links.doubt("the inertia is that of a much larger body than is drawn", frame, radius / width, said)
        if 0.0 < radius < _NARROWEST_MASS * width:
            kind = "the inertia is that of a much smaller body than is drawn; is the drawing in millimetres?"
            links.doubt(kind, frame, width / radius, said)
    if dense > _DENSEST:
        kind = "denser than any matter; are masses in kg, lengths in m and moments in kg m^2?"
        links.doubt(kind, frame, dense, f"{mass:.3g} kg, {dense:.2g} kg/m^3 or more")
    if light < _LIGHTEST:
        kind = "lighter than air; are masses in kg, lengths in m and moments in kg m^2?"
        links.doubt(kind, frame, 1.0 / light, f"{mass:.3g} kg, {light:.2g} kg/m^3")


def _judge_neighbours(links: _Links, parents: Sequence[int], masses: Array) -> None:
    for child, parent in enumerate(parents, 1):
        # Frames without mass are steps between the axes of one joint and the next.
        while parent and not masses[parent]:
            parent = parents[parent - 1]
        pair = masses[[child, parent]]
        if pair.all() and pair.max() > _MASS_RATIO * pair.min():
            said = f"{masses[child]:.3g} kg on {masses[parent]:.3g} kg"
            links.doubt(
                "masses that differ ten thousandfold from their neighbours'", child, pair.max() / pair.min(), said
            )


def _judge_lengths(links: _Links, places: Array, centres: Array) -> None:
    kind = "very far from its joint or the joint before; are lengths in millimetres?"
    away = np.linalg.norm(centres, axis=-1)
    away[1:] = np.maximum(away[1:], np.linalg.norm(places, axis=-1))
    for frame in np.flatnonzero(away > _FARTHEST).tolist():
        links.doubt(kind, frame, float(away[frame]), f"{away[frame]:.3g} m")


def _limit_doubts(body: Body) -> Iterable[str]:
    joints = list(zip(body.joint_names, body.joint_limits.tolist(), body.joint_units, body.continuous, strict=True))
    missing = [
        repr(name)
        for name, limits, unit, endless in joints
        if not endless and unit != "1" and not all(map(math.isfinite, limits))
    ]
    if missing:
        yield f"{'joint' if len(missing) == 1 else 'joints'} {_listed(missing)}: not limited on both sides"
    beyond = [
        f"{name!r} ({lower:.6g} to {upper:.6g} rad)"
        for name, (lower, upper), unit, endless in joints
        if unit == "rad"
        and not endless
        and max(map(abs, filter(math.isfinite, (lower, upper))), default=0.0) > _WHOLE_TURN
    ]
    if beyond:
        kind = "limited beyond a whole turn; are limits in degrees?"
        yield f"{'joint' if len(beyond) == 1 else 'joints'} {_listed(beyond)}: {kind}"


def _width(body: Body, shapes: Sequence[Visual]) -> float:
    """The diagonal of the box around all that is drawn of a frame [m]."""
    points = []
    for shape in shapes:
        turned = body.chain.link_frames[shape.link][1] @ shape.pose
        points.append(shape.corners @ turned[:3, :3].T + turned[:3, 3])
    return float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))


def _volume(shape: Visual) -> float:
    """Of a primitive [m^3]."""
    first, *more = shape.dimensions
    ball = 4.0 / 3.0 * math.pi
    return {
        "box": lambda: math.prod(shape.dimensions),
        "cylinder": lambda: math.pi * first**2 * more[0],
        "capsule": lambda: math.pi * first**2 * more[0] + ball * first**3,
        "sphere": lambda: ball * first**3,
        "ellipsoid": lambda: ball * math.prod(shape.dimensions),
    }[shape.kind]()


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMED
    return ", ".join(names[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
