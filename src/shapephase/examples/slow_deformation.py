"""Slow deformations, and how near their phase is to that of a rigid body.

Source: Cabrera 2006, remark 4.6; theory.md F5. The orders are derived here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from .. import so3
from ..arguments import check_choice, check_object, moments_argument, number_argument
from ..arrays import Array
from ..deformation.deformation import Deformation
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError
from ..letters import value_text
from ..reconstruction.reconstruction import Motion
from ..rigid_body import separatrix_solid_angle
from ..rigid_body.euler_top import EulerTop
from ._closed_form_motions import Example, diagonal, positive

_REVOLUTION = (0.0, 2.0 * np.pi)  # [rad] of the angle along an orbit
_DEGREES = tuple(14 * 2**k for k in range(6))  # of Chebyshev series, tried in turn; the last very near the separatrix
_RESOLVED = 1e-11  # of the largest coefficient, for the last ones: the integral is then known to about ten digits
_END_MARGIN = 1e-9  # [rad] from the axis and from the separatrix: nearer, the area of an orbit is rounding

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
    expansion: float = 0.2,
    momentum: ArrayLike = (0.4, 0.3, 3.2),
) -> Example:
    """F5: the largest moment grows slowly, I_3(t) = I_3 (1 + expansion f(rate t)); `rigid` is the body at the start.

    With f(s) = s ("even") the phase of the first loop of Pi about axis 3 is that of the rigid body up to a term of
    first order in the rate, expansion rate `slow_phase_slope`: Pi does not come back but spirals, and the moments that
    count are those half a loop later. Against the rigid body with the inertia of the middle of the loop, if Pi crosses
    a plane of two principal axes there, the difference is of second order.

    With f(s) = sin²(pi s) ("periodic"), 1/rate being its period, the deformation starts from its turning point. Within
    a loop it is of second order in the rate, and so is the difference of the phases.

    With f(s) = 10 s³ − 15 s⁴ + 6 s⁵ ("deployment"), from rest to rest in 1/rate: the area that Pi encloses is the
    adiabatic invariant. At the end the body agrees with `orbit_of_area(I(end), l, area at the start)` in area and
    phase up to a term of third order, because the third derivative of f is the first that jumps at the ends; in
    general the order is that of the first derivative that jumps, for the even law the first. Here "deployment" lasts
    for all of 1/rate, the others for one and a quarter rigid periods.

    Over all of a slow deformation, as long as 1/rate, the precession is `adiabatic_precession` up to a term of first
    order, which is second order a loop.

    Parameters
    ----------
    rate : above 0 [1/s]
    law : "even", "periodic" or "deployment"
    moments : (3,), ascending [kg m^2]
    expansion : relative increase of I_3 where f is 1, above 0
    momentum : (3,), on an orbit about axis 3

    Notes
    -----
    Source: Cabrera 2006, remark 4.6, with the scale corrected (C-E12); orders derived here; theory.md F5.

    Examples
    --------
    >>> example = sp.examples.slow_antenna(1e-3)
    >>> print(f"{example.rigid.montgomery_phase:.6f} rad")  # of the body as it was at the start
    11.187497 rad
    """
    check_choice(law, "law", _LAWS)
    slow, start = positive(rate, "rate", "1/s"), moments_argument(moments)
    top = orbit_about_third(start, momentum)
    increase = positive(expansion, "expansion", "1") * start[2] * np.array([0.0, 0.0, 1.0])
    length = 1.0 / slow if law == "deployment" else 1.25 * top.period
    deformation = diagonal(lambda t: start + increase * _LAWS[law](slow * t)[:, None], length, (), "error")
    return Example(deformation=deformation, momentum=top.momentum, rigid=top)


def slow_phase_slope(moments: ArrayLike, momentum: ArrayLike) -> float:
    """Derivative of the phase of one loop about axis 3 by a steady growth I_3 (1 + g t): d theta_M/dg at g = 0 [rad s].

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

    Notes
    -----
    Source: first-order perturbation in Andoyer's variables, derived here.

    Examples
    --------
    >>> print(f"{sp.examples.slow_phase_slope([1.0, 1.5, 2.0], [0.4, 0.3, 3.2]):.6f} rad s")
    -109.583017 rad s
    """
    start = moments_argument(moments)
    top = orbit_about_third(start, momentum)
    first, magnitude, low = top.momentum, top.magnitude, 1.0 / start[2]
    # Pi circles axis 3 counterclockwise where Pi_3 > 0.
    sense, azimuth = np.sign(first[2]), np.arctan2(first[1], first[0])

    def across(u: Array) -> Array:
        angle = azimuth + sense * u
        return np.cos(angle) ** 2 / start[0] + np.sin(angle) ** 2 / start[1]

    def tilt(u: Array) -> Array:
        return (2.0 * top.energy - low * magnitude**2) / (across(u) - low)

    def time_per_angle(u: Array) -> Array:
        return 1.0 / (np.sqrt(magnitude**2 - tilt(u)) * (across(u) - low))

    time = _primitive(time_per_angle, _REVOLUTION)
    swept = _primitive(lambda u: tilt(u) * time_per_angle(u), _REVOLUTION)

    def density(u: Array) -> Array:
        along = magnitude**2 - tilt(u)
        change = swept(u) - (tilt(u) + 2.0 * along) * time(u)
        return magnitude * across(u) * low * change / (2.0 * along**1.5 * (across(u) - low) ** 2)

    return float(_primitive(density, _REVOLUTION)(2.0 * np.pi))


def orbit_of_area(moments: ArrayLike, magnitude: float, solid_angle: float) -> EulerTop:
    """The rigid body whose Pi encloses a given area about axis 3.

    Parameters
    ----------
    moments : (3,), ascending [kg m^2]
    magnitude : of Pi, above 0 [kg m^2/s]
    solid_angle : above 0 and below that of the separatrix [sr]

    Raises
    ------
    ShapeError
        If no orbit about axis 3 has that area.

    Notes
    -----
    Source: Ehrenfest's adiabatic invariance, with the area as the action; theory.md F5.

    Examples
    --------
    >>> top = sp.examples.orbit_of_area([1.0, 1.5, 2.0], 1.0, 0.5)
    >>> print(f"{abs(top.solid_angle):.9f} sr")
    0.500000000 sr
    """
    solid_angle = number_argument(solid_angle, "solid_angle", "sr")
    end, norm = moments_argument(moments), positive(magnitude, "magnitude", "kg m^2/s")
    limit = separatrix_solid_angle(end, 2)

    def orbit(angle: float) -> EulerTop:
        return EulerTop.principal(end, norm * np.array([0.0, np.sin(angle), np.cos(angle)]))

    nearest, farthest = _END_MARGIN, 0.5 * np.pi - _END_MARGIN
    if not orbit(nearest).solid_angle < solid_angle < orbit(farthest).solid_angle:
        raise ShapeError(
            f"solid_angle: the orbits about axis 3 have areas from 0 to {limit:.9g} sr, got {value_text(solid_angle)}"
        )
    tilt = root_scalar(lambda x: orbit(x).solid_angle - solid_angle, bracket=(nearest, farthest), xtol=1e-15)
    return orbit(float(tilt.root))


def adiabatic_precession(deformation: Deformation, momentum: ArrayLike, until: float) -> float:
    """The angle of axis 3 about the momentum from 0 to a time, if the area that Pi encloses is constant [rad].

    The integral of `EulerTop.precession_frequency` along the orbits of one area. A family of one parameter encloses no
    area of parameters, so there is no geometric part (Hannay's angle is zero). From one crossing of the plane of axes 2
    and 3 to another, the true precession differs by a term of first order in the rate, all loops together; between
    other points also by what varies within a loop.

    Parameters
    ----------
    deformation : with fixed principal axes, in the order of ascending moments, and no internal momentum
    momentum : (3,), on an orbit about axis 3 [kg m^2/s]
    until : [s]

    Raises
    ------
    ShapeError
        For another deformation, or if there is no orbit of that area any more, because it met the separatrix.
    AccuracyNotReached
        Very near a separatrix.

    Notes
    -----
    Source: Hannay 1985; derived here, theory.md F5.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 1.5, 2.0], [0.4, 0.3, 3.2])
    >>> body = sp.rigid(np.diag([1.0, 1.5, 2.0]), 2.0 * top.period)
    >>> angle = sp.examples.adiabatic_precession(body, [0.4, 0.3, 3.2], top.period)
    >>> print(f"{sp.so3.wrap(angle - top.montgomery_phase):.6f}")
    0.000000
    """
    check_object(deformation, "Deformation", "deformation")
    end = positive(until, "until", "s")
    top = orbit_about_third(_ascending(deformation, np.zeros(1))[0], momentum)

    def rate(times: Array) -> Array:
        tops = [orbit_of_area(row, top.magnitude, abs(top.solid_angle)) for row in _ascending(deformation, times)]
        return np.array([orbit.precession_frequency for orbit in tops])

    edges = np.append(deformation.breaks[deformation.breaks < end], end)
    return float(sum(_primitive(rate, piece)(piece[1]) for piece in pairwise(edges.tolist())))


def _primitive(function: Callable[[Array], Array], domain: tuple[float, float]) -> np.polynomial.Chebyshev:
    """The integral from the left end of a smooth function, as a polynomial. Raises AccuracyNotReached."""
    for degree in _DEGREES:
        # On the separatrix itself the function is infinite at some angle, and the series does not converge.
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
            "deformation: ascending moments about fixed axes, and no internal momentum, are needed, as in the printed "
            "antennas"
        )
    return moments


def first_loop(motion: Motion, axis: int = 3) -> float:
    """The time at which Pi has first gone once round a body axis, back to its meridian [s].

    `arc_phases(motion, [0, this], "base")` is the phase of that loop, closed along the meridian.

    Parameters
    ----------
    axis : 1, 2 or 3, which Pi circles in one sense throughout

    Raises
    ------
    ShapeError
        If the motion is a batch, or the axis is none of these.
    TrajectoryError
        If Pi does not go once round the axis during the motion.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 1.5, 2.0], [0.4, 0.3, 3.2])
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.5, 2.0]), 2.0 * top.period), [0.4, 0.3, 3.2])
    >>> print(f"{sp.examples.first_loop(motion) / top.period:.6f} periods")
    1.000000 periods
    """
    check_object(motion, "Motion", "motion")
    if motion.batch or not isinstance(axis, int | np.integer) or axis not in (1, 2, 3):
        raise ShapeError(
            f"one motion and axis 1, 2 or 3 are needed, got a batch {motion.batch} and axis {value_text(axis)}"
        )
    across = np.array([axis, axis + 1]) % 3

    def azimuth(times: Array) -> Array:
        return np.arctan2(*np.moveaxis(motion.body_momentum(times)[..., across[::-1]], -1, 0))

    times = motion.solution.times
    turned = np.unwrap(azimuth(times))
    turned -= turned[0]
    full_turns = np.flatnonzero(np.abs(turned) >= 2.0 * np.pi)
    if not len(full_turns):
        degrees = np.degrees(np.abs(turned).max())
        raise TrajectoryError(f"Pi goes only {degrees:.6g} degrees round axis {axis} in this motion, not once round")
    last = int(full_turns[0])
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
