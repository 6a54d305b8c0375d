"""Axes by which somersaults, tilt and twists of an athlete are counted; they do not depend on the laboratory's."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.link_motions import link_motions
from ..display import frozen
from ..errors import ShapeError, WrongObjectError, unknown_name
from ..inertia_tensor import principal_axes
from ..refinement import least_over
from ..shape_space.path_series import panel_edges
from ..shape_space.shape_path import ShapePath

if TYPE_CHECKING:
    from .reconstruction import Motion

NAMED = {
    sign + axis: factor * np.eye(3)[k] for sign, factor in (("", 1.0), ("-", -1.0)) for k, axis in enumerate("xyz")
}
"""Unit vectors by name."""
_NO_DIRECTION = 1e-6  # component of a unit vector below which its direction is rounding of measured data
_SIDES = re.compile(
    r"(?<![A-Za-z])([Ll]eft|[Rr]ight|LEFT|RIGHT)(?![a-z])|(?<![A-Za-z])([lrLR])(?![A-Za-z])|(Left|Right)|^([lrLR])(?=[A-Z])"
)
"""Left or right in the name of a link: left_arm, LeftArm, l_hip, hip_r, rThigh, LHipJoint."""
_UPPER_LINKS = re.compile(r"(?i)head|skull|neck")
_LOWER_LINKS = re.compile(r"(?i)foot|feet|toe|shank|calf|tibia|ankle")
_BY_LINKS = "links named right and left"
_NO_SIDES = (
    "{}: the axis from right to left is unknown, since no two links of one trunk are named left and right; give it: "
    "lateral='y' (--lateral y), or three numbers in base axes"
)


@frozen
class AthleteAxes:
    """Axes by which somersaults, tilt and twists are counted, with the source of each.

    Attributes
    ----------
    lateral : (3,) from the right side of the body to the left, base axes; of a batch, batch + (3,)
    longitudinal : (3,) from the feet to the head, base axes
    somersault : batch + (3,) horizontal, inertial axes; where the body begins it points to the left rather than right
    up : (3,) inertial axes
    reasons : source of each of the four, in words

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> axes = motion.athlete_axes()
    >>> axes.somersault.round(6).tolist(), axes.reasons["somersault"]
    ([0.0, 1.0, 0.0], 'the horizontal part of the momentum')
    """

    lateral: Array
    longitudinal: Array
    somersault: Array
    up: Array
    reasons: dict[str, str]

    def __str__(self) -> str:
        """Return the four sources in words, with the directions."""
        return (
            f"somersaults about {self.reasons['somersault']}{_shown(self.somersault, 'inertial')}, twists about "
            f"{self.reasons['longitudinal']}{_shown(self.longitudinal, 'base')}, from right to left: "
            f"{self.reasons['lateral']}{_shown(self.lateral, 'base')}; up is {self.reasons['up']}"
        )

    @property
    def by_links(self) -> bool:
        """True where the lateral axis follows from links named left and right."""
        return self.reasons["lateral"] == _BY_LINKS

    @property
    def matrices(self) -> tuple[Array, Array]:
        """Axes to the front, to the left and up as columns, at zero angles: inertial axes, base axes."""
        body = np.stack([self.frontal, self.lateral, np.broadcast_to(self.longitudinal, self.lateral.shape)], axis=-1)
        up = np.broadcast_to(self.up, self.somersault.shape)
        return np.stack([np.cross(self.somersault, up), self.somersault, up], axis=-1), body

    @property
    def frontal(self) -> Array:
        """Axis of the tilt, from back to front, base axes: (3,) or batch + (3,)."""
        return so3.cross(self.lateral, self.longitudinal)


def athlete_axes(
    motion: Motion,
    lateral: str | ArrayLike | None,
    longitudinal: str | ArrayLike | None,
    somersault: str | ArrayLike | None,
    up: str | ArrayLike | None,
) -> AthleteAxes:
    """Return the axes of `Motion.athlete_axes`."""
    reasons: dict[str, str] = {}
    upward = _upward(motion, up, reasons)
    if hasattr(motion.deformation.description, "original"):
        raise WrongObjectError(
            "motion: somersaults are counted by axes of a base, and this deformation is seen from a gauge; "
            "reconstruct the one without the gauge"
        )
    # Looked for only where an axis is to be found by it.
    trunk = cache(partial(_Trunk.of, motion))
    if longitudinal is None:
        long = trunk().long_axis()
        reasons["longitudinal"] = "the axis of least inertia of the whole body at its straightest"
    else:
        long = _axis(longitudinal, "longitudinal axis", reasons)
    side = None
    if lateral is not None:
        side = _across(_axis(lateral, "lateral axis", reasons), long)
        if side is None:
            raise ShapeError("longitudinal: an axis across the lateral one is needed, and these two are along one line")
    elif (body := trunk().body) is not None and (leftward := _from_right_to_left(body, trunk().shape)) is not None:
        side = _across(leftward, long)
        reasons["lateral"] = _BY_LINKS
    start = motion.initial_attitude
    about = _somersault(motion, somersault, upward, start, side, reasons)
    if side is None:
        seen = so3.apply(so3.transpose(start), about)
        across = seen - np.sum(seen * long, axis=-1, keepdims=True) * long
        length = np.linalg.norm(across, axis=-1, keepdims=True)
        if np.any(length < _NO_DIRECTION):
            raise WrongObjectError(_NO_SIDES.format(motion.deformation.label))
        side = across / length
        reasons["lateral"] = "the axis of the somersault in the body at the start"
    return AthleteAxes(lateral=side, longitudinal=long, somersault=about, up=upward, reasons=reasons)


@dataclass(frozen=True, eq=False)
class _Trunk:
    """Body at its straightest: locked inertia (3, 3); with joints also the body and its shape (n,)."""

    inertia: Array
    body: Body | None
    shape: Array

    @classmethod
    def of(cls, motion: Motion) -> _Trunk:
        description = motion.deformation.description

        def width(times: Array) -> Array:
            moments = np.linalg.eigvalsh(description.sample(times)[0])
            return moments[:, 0] / moments[:, 1]

        body, path = getattr(description, "body", None), getattr(description, "path", None)
        if isinstance(body, Body) and isinstance(path, ShapePath):
            when = np.array([least_over(width, panel_edges(path))[1]])
            return cls(description.sample(when)[0][0], body, path.curve(when)[0][0])
        when = np.array([least_over(width, motion.deformation.breaks)[1]])
        return cls(description.sample(when)[0][0], None, np.zeros(0))

    def long_axis(self) -> Array:
        """Axis of least inertia, towards the head, else away from the feet, else along the base's z: (3,)."""
        moments, axes = principal_axes(self.inertia)
        if moments[1] - moments[0] <= _NO_DIRECTION * moments[1]:
            raise WrongObjectError(
                "motion: two moments of inertia of the body are equal where it is straightest, so no axis is the long "
                "one; give it: longitudinal='z', or three numbers in axes of the base"
            )
        axis = axes[:, 0]
        heights = axis if self.body is None else _upwards(self.body, self.shape, axis)
        sizes = np.abs(heights)
        # Without head and feet, z decides before y and x.
        leading = heights[-1] if sizes[-1] > _NO_DIRECTION * sizes.max() else heights[int(np.argmax(sizes))]
        return axis * (1.0 if leading >= 0.0 else -1.0)


def _upwards(body: Body, shape: Array, axis: Array) -> Array:
    """Coordinate of the head along an axis, or minus that of the feet; without either the axis itself, base axes."""
    motions = link_motions(body.chain, shape[None], np.zeros_like(shape)[None])
    for pattern, sign in ((_UPPER_LINKS, 1.0), (_LOWER_LINKS, -1.0)):
        frames = [frame for link, (frame, _) in body.chain.link_frames.items() if pattern.search(link)]
        if frames:
            return sign * motions.places[0, frames].mean(axis=0)[None] @ axis
    return axis


def _from_right_to_left(body: Body, shape: Array) -> Array | None:
    """Unit vector of the sum of the vectors from right to left joints of one trunk: (3,), base axes; None: no pairs."""
    chain = body.chain
    motions = link_motions(chain, shape[None], np.zeros_like(shape)[None])
    turns = motions.turns[0]
    origins = motions.places[0] - so3.apply(turns, chain.centres)
    frames = {frame for frame, _ in chain.link_frames.values()}
    trunks: dict[int, int] = {}

    def pairs() -> Iterator[tuple[int, list[int], Array]]:
        """Parent, the two frames, and the vector between their joints."""
        sides: dict[tuple[int, str], dict[str, tuple[int, Array]]] = {}
        for link, (frame, _) in chain.link_frames.items():
            match = _SIDES.search(link)
            if match is None or frame == 0:
                continue
            which = next(group for group in match.groups() if group)[0].lower()
            rest = (link[: match.start()] + "*" + link[match.end() :]).lower()
            joint = frame - 1
            while (parent := chain.parents[joint]) and parent not in frames:  # the first joint of a ball joint's three
                joint = parent - 1
            place = origins[parent] + turns[parent] @ chain.places[joint]
            sides.setdefault((trunks.get(parent, parent), rest), {}).setdefault(which, (frame, place))
        for (parent, _), pair in sides.items():
            if len(pair) == 2:
                yield parent, [frame for frame, _ in pair.values()], pair["l"][1] - pair["r"][1]

    # Skeletons of motion capture have pairs of bones that begin in one point of the trunk: what hangs on them counts.
    for parent, pair, vector in list(pairs()):
        if not vector.any():
            trunks |= dict.fromkeys(pair, parent)
    leftward = [vector for _, _, vector in pairs()]
    total = np.sum(leftward, axis=0) if leftward else np.zeros(3)
    length = float(np.linalg.norm(total))
    scale = sum(float(np.linalg.norm(vector)) for vector in leftward) or 1.0
    return total / length if length > _NO_DIRECTION * scale else None


def _somersault(
    motion: Motion,
    given: str | ArrayLike | None,
    up: Array,
    start: Array,
    side: Array | None,
    reasons: dict[str, str],
) -> Array:
    """Axis of the somersault: batch + (3,), inertial axes."""
    momentum = motion.momentum
    batch = momentum.shape
    left = None if side is None else np.broadcast_to(so3.apply(start, side), batch)
    if given is not None:
        about = np.broadcast_to(_axis(given, "somersault", reasons), batch)
        return _horizontal(about, up, "somersault: a horizontal axis is needed, and this one points up or down")
    upright = np.abs(momentum @ up)
    flat = momentum - (momentum @ up)[..., None] * up
    tumbles = (np.linalg.norm(flat, axis=-1) >= upright) & (np.linalg.norm(momentum, axis=-1) > 0.0)
    by_momentum = "the horizontal part of the momentum"
    by_side = "the axis from right to left at the start, made horizontal"
    if not tumbles.all() and left is None:
        raise WrongObjectError(_NO_SIDES.format(motion.deformation.label))
    reasons["somersault"] = ", or ".join([by_momentum] * bool(tumbles.any()) + [by_side] * (not tumbles.all()))
    about = flat if left is None else np.where(tumbles[..., None], flat, left)
    axis = _horizontal(
        about,
        up,
        "the axis from right to left is vertical at the start, and the momentum is zero or vertical, so the axis of "
        "the somersault is not defined; give it: somersault='x', or three numbers in inertial axes",
    )
    if left is None:
        return axis
    towards = np.sum(axis * left, axis=-1, keepdims=True)
    return axis * np.where(towards < -_NO_DIRECTION, -1.0, 1.0)


def _horizontal(axis: Array, up: Array, otherwise: str) -> Array:
    flat = axis - np.sum(axis * up, axis=-1, keepdims=True) * up
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    if np.any(length <= _NO_DIRECTION * np.linalg.norm(axis, axis=-1, keepdims=True)):
        raise ShapeError(otherwise)
    return flat / length


def _upward(motion: Motion, given: str | ArrayLike | None, reasons: dict[str, str]) -> Array:
    if given is not None:
        return _axis(given, "up", reasons)
    recording = motion.deformation.made_from.get("recording") or {}
    recorded = str((recording.get("flight") or {}).get("up", "")).removeprefix("+")
    name = recorded if recorded in NAMED else "z"
    reasons["up"] = f"{name}, against the fall of the recording" if recorded in NAMED else f"{name}, by default"
    return NAMED[name].copy()


def _axis(given: str | ArrayLike, what: str, reasons: dict[str, str]) -> Array:
    """Return a unit vector from its name or from three numbers. Raises UnknownNameError, ShapeError."""
    if isinstance(given, str):
        if given not in NAMED:
            raise unknown_name(what, given, list(NAMED))
        reasons[what.split()[0]] = f"{given}, as given"
        return NAMED[given].copy()
    vector = finite_array(given, what, (3,))
    length = float(np.linalg.norm(vector))
    if vector.ndim != 1 or length == 0.0:
        raise ShapeError(f"{what}: a name of {', '.join(NAMED)} or three numbers (3,), not all zero, are needed")
    reasons[what.split()[0]] = "as given"
    return vector / length


def _across(axis: Array, other: Array) -> Array | None:
    """Unit vector of the part of one unit vector across another; None where they are parallel."""
    across = axis - (axis @ other) * other
    length = float(np.linalg.norm(across))
    return across / length if length > _NO_DIRECTION else None


def _shown(axis: Array, frame: str) -> str:
    numbers = " ".join(f"{value + 0.0:.3f}" for value in np.round(axis, 3)) if axis.ndim == 1 else ""
    return f" ({numbers}, {frame} axes)" if numbers else ""
