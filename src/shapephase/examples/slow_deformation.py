"""Slow deformations: how near the phase is to that of a rigid body.

Source: Cabrera 2006, remark 4.6; theory.md F5. The orders are derived here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from .. import so3
from ..arguments import moments_argument
from ..arrays import Array
from ..deformation.deformation import Deformation
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError, unknown_name
from ..reconstruction.reconstruction import Motion
from ..rigid_body._momentum_orbit import separatrix_solid_angle
from ..rigid_body.euler_top import EulerTop
from .closed_form_motions import Example, diagonal, positive

_ROUND = (0.0, 2.0 * np.pi)
_NODES = (14, 28, 56, 112, 224, 448)
_RESOLVED = 1e-11

_LAWS: Mapping[str, Callable[[Array], Array]] = {
    "even": lambda s: s,
    "periodic": lambda s: np.sin(np.pi * s) ** 2,
    "deployment": lambda s: s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
}


def slow_antenna(
    rate: float = 1e-3,
    law: str = "even",
    *,
    moments: ArrayLike = (1.0, 1.5, 2.0),
    growth: float = 0.2,
    momentum: ArrayLike = (0.4, 0.3, 3.2),
) -> Example:
    """F5: the largest moment grows slowly, I_3(t) = I_3 (1 + growth f(rate t)); `rigid` is the body at the start.

    With f(s) = s ("even") the phase of the first loop of Pi about axis 3 is that of the rigid body up to a term of
    first order in the rate, growth rate `slow_phase_slope`: Pi does not come back but spirals, and the moments that
    count are those half a loop later. Against the body frozen in the middle of the loop, where Pi crosses a plane of
    two axes there, the difference is of second order.

    With f(s) = sin²(pi s) ("periodic"), 1/rate being its period, the deformation starts from its turning point. Within
    a loop it is of second order in the rate, and so is the difference of the phases.

    With f(s) = 10 s³ − 15 s⁴ + 6 s⁵ ("deployment"), from rest to rest in 1/rate: the area that Pi goes round is the
    adiabatic invariant. The body that comes out is `orbit_of_area(I(end), l, area at the start)` in area and phase up
    to a term of third order, since the third derivative of f is the first that jumps at the ends; in general, of the
    order of the first derivative that jumps, for the even law the first. Here "deployment" lasts for all of 1/rate,
    the others for one and a quarter rigid periods.

    Over all of a slow deformation, as long as 1/rate, the precession is `adiabatic_precession` up to a term of first
    order, which is second order a loop.

    Parameters
    ----------
    rate : above 0 [1/s]
    law : "even", "periodic" or "deployment"
    moments : (3,), ascending [kg m^2]
    growth : of I_3, relative
    momentum : (3,), on an orbit about axis 3

    Source: Cabrera 2006, remark 4.6, whose scale is wrong (C-E12); orders derived here; theory.md F5.
    """
    if law not in _LAWS:
        raise unknown_name("law", law, _LAWS)
    pace, start = positive(rate, "rate", "1/s"), moments_argument(moments)
    top = orbit_about_third(start, momentum)
    slope = positive(growth, "growth", "1") * start[2] * np.array([0.0, 0.0, 1.0])
    length = 1.0 / pace if law == "deployment" else 1.25 * top.period
    deformation = diagonal(lambda t: start + slope * _LAWS[law](pace * t)[:, None], length, (), "error")
    return Example(deformation, top.momentum, rigid=top)


def slow_phase_slope(moments: ArrayLike, momentum: ArrayLike) -> float:
    """How the phase of one loop about axis 3 answers to a steady growth I_3 (1 + g t): d theta_M/dg at g = 0 [rad s].

    The loop ends where Pi is back on its meridian, closed along it. With u the angle along, a(u) the value of 1/I
    across axis 3, v = a − 1/I_3, w = Pi_1² + Pi_2² and L = Pi_3 of the rigid motion, dt = du/(L v), W = int w dt,

        the integral over 2 pi of  l a (W − w t − 2 L² t) / (2 I_3 L³ v²) du.

    Parameters
    ----------
    moments : (3,), ascending [kg m^2]
    momentum : (3,), on an orbit about axis 3 [kg m^2/s]

    Raises
    ------
    ShapeError
        For a momentum that does not circle axis 3.
    AccuracyNotReached
        Very near the separatrix.

    Source: first-order perturbation in Andoyer's variables, derived here.
    """
    start = moments_argument(moments)
    top = orbit_about_third(start, momentum)
    first, size, low = top.momentum, top.magnitude, 1.0 / start[2]
    # Pi goes round axis 3 counterclockwise where Pi_3 > 0.
    sense, azimuth = np.sign(first[2]), np.arctan2(first[1], first[0])

    def across(u: Array) -> Array:
        angle = azimuth + sense * u
        return np.cos(angle) ** 2 / start[0] + np.sin(angle) ** 2 / start[1]

    def tilt(u: Array) -> Array:
        return (2.0 * top.energy - low * size**2) / (across(u) - low)

    def pace(u: Array) -> Array:
        return 1.0 / (np.sqrt(size**2 - tilt(u)) * (across(u) - low))

    time, swept = _primitive(pace, _ROUND), _primitive(lambda u: tilt(u) * pace(u), _ROUND)

    def density(u: Array) -> Array:
        along = size**2 - tilt(u)
        change = swept(u) - (tilt(u) + 2.0 * along) * time(u)
        return size * across(u) * low * change / (2.0 * along**1.5 * (across(u) - low) ** 2)

    return float(_primitive(density, _ROUND)(2.0 * np.pi))


def orbit_of_area(moments: ArrayLike, size: float, solid_angle: float) -> EulerTop:
    """The rigid body with these ascending moments whose Pi, of this size, goes round an area about axis 3.

    Parameters
    ----------
    solid_angle : above 0 and below that of the separatrix [sr]

    Raises
    ------
    ShapeError
        If no orbit about axis 3 has that area.

    Source: Ehrenfest's adiabatic invariance, with the area as the action; theory.md F5.
    """
    end, length = moments_argument(moments), positive(size, "size", "kg m^2/s")
    limit = separatrix_solid_angle(end, 2)

    def orbit(height: float) -> EulerTop:
        return EulerTop.principal(end, length * np.array([0.0, np.sin(height), np.cos(height)]))

    lowest, highest = 1e-9, 0.5 * np.pi - 1e-9
    if not orbit(lowest).solid_angle < solid_angle < orbit(highest).solid_angle:
        raise ShapeError(
            f"solid_angle: the orbits about axis 3 have areas from 0 to {limit:.9g} sr, got {solid_angle!r}"
        )
    found = root_scalar(lambda x: orbit(x).solid_angle - solid_angle, bracket=(lowest, highest), xtol=1e-15)
    return orbit(float(found.root))


def adiabatic_precession(deformation: Deformation, momentum: ArrayLike, until: float) -> float:
    """What axis 3 turns through about the momentum from 0 to a time, if the area that Pi goes round stays [rad].

    The integral of `EulerTop.precession_frequency` along the orbits of one area. The one parameter of such a family
    goes round no area of parameters, so there is no geometric part (Hannay's angle is zero). From one crossing of the
    plane of axes 2 and 3 to another, the true precession differs by a term of first order in the rate, all loops
    together; between other places also by what the orbit adds within a loop.

    Parameters
    ----------
    deformation : with principal axes that stay, in the order of ascending moments, and no internal momentum
    momentum : (3,), on an orbit about axis 3 [kg m^2/s]
    until : [s]

    Raises
    ------
    ShapeError
        For another deformation, or where the orbits of that area come to an end, at a separatrix.
    AccuracyNotReached
        Very near a separatrix.

    Source: Hannay 1985; derived here, theory.md F5.
    """
    end = positive(until, "until", "s")
    top = orbit_about_third(_ascending(deformation, np.zeros(1))[0], momentum)

    def rate(times: Array) -> Array:
        tops = [orbit_of_area(row, top.magnitude, abs(top.solid_angle)) for row in _ascending(deformation, times)]
        return np.array([orbit.precession_frequency for orbit in tops])

    edges = np.append(deformation.breaks[deformation.breaks < end], end)
    return float(sum(_primitive(rate, piece)(piece[1]) for piece in pairwise(edges.tolist())))


def _primitive(function: Callable[[Array], Array], domain: tuple[float, float]) -> np.polynomial.Chebyshev:
    """The integral from the left end of a smooth function, as a polynomial. Raises AccuracyNotReached."""
    for degree in _NODES:
        # On the separatrix itself the function is infinite somewhere, and nothing converges.
        with np.errstate(divide="ignore", invalid="ignore"):
            series = np.polynomial.Chebyshev.interpolate(function, degree, domain)
        if np.abs(series.coef[-3:]).max() < _RESOLVED * np.abs(series.coef).max():
            return series.integ(lbnd=domain[0])
    raise AccuracyNotReached(
        f"an integral along the orbit does not converge to {_RESOLVED:g}: Pi comes too near the separatrix; choose a "
        "momentum nearer to axis 3"
    )


def _ascending(deformation: Deformation, times: Array) -> Array:
    """Principal moments along the frame's axes: (N,) -> (N, 3)."""
    tensors, internal = deformation.inertia(times), deformation.internal_momentum(times)
    moments = np.diagonal(tensors, axis1=-2, axis2=-1)
    if np.any(internal) or np.any(tensors != moments[:, None] * np.eye(3)) or np.any(np.diff(moments, axis=-1) < 0.0):
        raise ShapeError(
            "deformation: moments that ascend along axes that stay, and no internal momentum, are needed, as the "
            "printed antennas have them"
        )
    return moments


def first_loop(motion: Motion, axis: int = 3) -> float:
    """When Pi has first gone once round a body axis, back to its meridian: time [s].

    `arc_phases(motion, [0, this], "base")` is the phase of that loop, closed along the meridian.

    Parameters
    ----------
    axis : 1, 2 or 3, which Pi goes round in one sense throughout

    Raises
    ------
    ShapeError
        If the motion is a batch, or the axis none of these.
    TrajectoryError
        If Pi does not get round within the motion.
    """
    if motion.batch or axis not in (1, 2, 3):
        raise ShapeError(f"one motion and axis 1, 2 or 3 are needed, got a batch {motion.batch} and axis {axis!r}")
    across = np.array([axis, axis + 1]) % 3

    def azimuth(times: Array) -> Array:
        return np.arctan2(*np.moveaxis(motion.body_momentum(times)[..., across[::-1]], -1, 0))

    times = motion.solution.times
    gone = np.unwrap(azimuth(times))
    gone -= gone[0]
    round_it = np.flatnonzero(np.abs(gone) >= 2.0 * np.pi)
    if not len(round_it):
        turned = np.degrees(np.abs(gone).max())
        raise TrajectoryError(f"Pi does not get round axis {axis} in this motion, only {turned:.6g} degrees of the way")
    last = int(round_it[0])
    start = azimuth(times[0])
    bracket = (float(times[last - 1]), float(times[last]))
    return float(
        root_scalar(lambda t: float(so3.wrap(azimuth(np.asarray(t)) - start)), bracket=bracket, xtol=1e-15).root
    )


def orbit_about_third(moments: Array, momentum: ArrayLike) -> EulerTop:
    """The rigid body at the start, where Pi circles axis 3. Raises ShapeError."""
    top = EulerTop.principal(moments, momentum)
    if top.orbit.circled != 2:
        raise ShapeError(f"momentum: Pi must circle axis 3, that of the largest moment, got {top.momentum} kg m^2/s")
    return top
