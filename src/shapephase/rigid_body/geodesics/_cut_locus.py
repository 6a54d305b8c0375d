"""Cut loci of two-spheres of revolution, where the theory gives them.

On a smooth sphere of revolution, symmetric in its equator, whose curvature falls all the way from the equator to the
poles (an oblate ellipsoid), the cut locus of a point is an arc of the opposite parallel; where it rises (a prolate
one), an arc of the opposite meridian; on the round sphere the opposite point. The arc's ends are conjugate points.
It is an arc of the opposite parallel also where only the first return falls with p, whatever the curvature does:
extremals of opposite directions meet there, after half a period, and those of smaller p farther on.

Sources: Sinclair and Tanaka 2007, main theorem; Bonnard, Caillau, Sinclair and Tanaka 2009, for first returns; Bonnard,
Cots and Shcherbakova 2013, end of section 2; theory.md O16, P6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...letters import what_came
from ...roots import safe_newton
from ._conjugate_locus import conjugate_points
from ._extremal import start_of
from .surface_of_revolution import SurfaceOfRevolution

_MERIDIAN = 1e-9  # in parts of the largest p: below, the longitude jumps at the pole within the rounding of the phase
_POLE_MARGIN = 1e-12  # of |y|, which is 1 at the pole, where the direction of an extremal is not defined


@dataclass(frozen=True)
class CutLocus:
    """Cut locus of the point at a latitude and longitude 0: an arc between two ends. Made by `cut_locus`."""

    kind: str
    """ "parallel", "meridian" or "point"."""
    latitudes: tuple[float, float]
    """phi of the ends, ascending."""
    longitudes: tuple[float, float]
    """theta of the ends, ascending, about pi [rad]."""

    __repr__ = short_repr


def cut_locus(surface: SurfaceOfRevolution, latitude: float = 0.0) -> CutLocus:
    """The cut locus of the point at a latitude, longitude 0.

    Raises ShapeError if the surface is no smooth sphere whose curvature changes one way from the equator to the poles,
    or whose first return falls with p, or the point is a pole.

    Examples
    --------
    >>> cut = sp.rigid_body.geodesics.cut_locus(sp.rigid_body.geodesics.ellipsoid(0.8))
    >>> print(cut.kind, np.round(np.array(cut.longitudes) / np.pi, 9))
    parallel [0.8 1.2]
    """
    check_object(surface, "SurfaceOfRevolution", "surface")
    kind = _kind(surface, latitude)
    phi = float(latitude)
    if kind == "point":
        return CutLocus(kind=kind, latitudes=(0.0 - phi, 0.0 - phi), longitudes=(np.pi, np.pi))
    if kind == "parallel":
        end = float(conjugate_points(surface, 0.0, 1, latitude).longitude)
        return CutLocus(kind=kind, latitudes=(0.0 - phi, 0.0 - phi), longitudes=(end, 2.0 * np.pi - end))
    ends = np.sort(conjugate_points(surface, np.array([0.5, -0.5]) * np.pi, 1, latitude).latitude)
    return CutLocus(kind=kind, latitudes=(float(ends[0]), float(ends[1])), longitudes=(np.pi, np.pi))


def cut_time(surface: SurfaceOfRevolution, direction: ArrayLike, latitude: float = 0.0) -> Array:
    """The length up to which extremals from a latitude in directions (...) [rad] are shortest: (...) -> (...).

    Until they meet their mirror image: at the opposite parallel, after half a period, or at the opposite meridian.

    Examples
    --------
    >>> print(f"{sp.rigid_body.geodesics.cut_time(sp.rigid_body.geodesics.ellipsoid(1.0), 0.5):.9f} = pi")
    3.141592654 = pi
    """
    check_object(surface, "SurfaceOfRevolution", "surface")
    kind = _kind(surface, latitude)
    angle = finite_array(direction, "direction", unit="rad")
    start = start_of(surface, angle, latitude)
    if kind != "meridian":
        return np.asarray(0.5 * surface.period(start.momentum))[()]
    p, q, room, first = (np.ravel(a) for a in (start.momentum, start.q, start.room, start.phase))
    magnitude = np.abs(p)
    begin = surface.trusted_arcs(magnitude, q, room, first)
    # Next to a meridian the longitude jumps at the pole, and the conjugate point is the limit of the meeting points.
    straight = magnitude <= _MERIDIAN * surface.greatest_momentum

    def step(chi: Array) -> tuple[Array, Array]:
        gained = surface.trusted_arcs(magnitude, q, room, chi).longitude - begin.longitude - np.pi
        square = q * np.sin(chi) ** 2
        value, _, _ = surface.stretch(square, surface.depth - square)
        rate = magnitude / surface.equator * value / np.maximum(1.0 - square, np.finfo(float).tiny)
        return gained, chi - gained / np.maximum(rate, np.finfo(float).tiny)

    chi = safe_newton(step, first + 0.9 * np.pi, first, first + np.pi)
    time = surface.trusted_arcs(magnitude, q, room, chi).time - begin.time
    conjugate = np.ravel(conjugate_points(surface, angle, 1, latitude).time)
    return np.where(straight, conjugate, time).reshape(angle.shape)[()]


def _kind(surface: SurfaceOfRevolution, latitude: float) -> str:
    if not surface.has_smooth_poles:
        raise ShapeError(f"a cut locus is known on smooth spheres of revolution; this one ends at a {surface.end}")
    if np.ndim(latitude) != 0 or not abs(float(surface.height(latitude))) < 1.0 - _POLE_MARGIN:
        raise ShapeError(f"latitude: one number between the poles is needed, got {what_came(latitude)}")
    trend = surface.curvature_trend()
    if trend != "neither":
        return {"decreasing": "parallel", "increasing": "meridian", "constant": "point"}[trend]
    if surface.tameness() == "decreasing":
        return "parallel"
    raise ShapeError(
        "the curvature must fall, or rise, all the way from the equator to the poles, or the first return fall with p; "
        "they do not"
    )
