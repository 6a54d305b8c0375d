"""Extremals of a surface of revolution by Clairaut's integral, and the Jacobi fields along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from ...arguments import check_object, number_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import AccuracyNotReached, ShapeError
from ...roots import ROUNDING, safe_newton
from .._flow import TOLERANCE
from ._arc_quadrature import Arcs
from .surface_of_revolution import SurfaceOfRevolution


@dataclass(frozen=True, eq=False)
class Start:
    """Start of extremals, in the form that the integrals need: all (...) of one shape.

    Extremals that start southward are mirrored in the equator, so that the start phase is in [-pi/2, pi/2].
    """

    momentum: Array
    """Clairaut's p."""
    q: Array
    """1 - p^2/m(0)."""
    room: Array
    """depth - q."""
    phase: Array
    """chi at the start [rad], of the mirrored extremal where `side` is -1."""
    side: Array
    """1 for a northward start, -1 for a southward one."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Extremal:
    """Extremals of unit speed from one latitude, longitude 0, in directions (...). Made by `extremal`.

    Arguments t (...) [length] are any numbers; results have the directions' axes first, then those of t.
    """

    surface: SurfaceOfRevolution
    start: Start

    __repr__ = short_repr

    def phase(self, times: ArrayLike) -> Array:
        """chi at times t, increasing, of the mirrored extremal where it starts southward [rad]."""
        t = finite_array(times, "times")
        p, q, room, phase = np.broadcast_arrays(*self._spread_start(t)[:4], t)[:4]
        quarter = self.surface.trusted_arcs(p, q, room, np.full(p.shape, 0.5 * np.pi)).time
        total = self.surface.trusted_arcs(p, q, room, phase).time + t
        turns = np.rint(total / (2.0 * quarter))
        rest = np.clip(total - 2.0 * turns * quarter, -quarter, quarter)

        def step(chi: Array) -> tuple[Array, Array]:
            chi = chi.reshape(p.shape)
            value = self.surface.trusted_arcs(p, q, room, chi).time - rest
            return value.ravel(), (chi - value / self._stretch(q, room, chi)).ravel()

        start = 0.5 * np.pi * rest / quarter
        limit = np.full(p.size, 0.5 * np.pi)
        return safe_newton(step, start.ravel(), -limit, limit, ROUNDING).reshape(p.shape) + turns * np.pi

    def state(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Latitude phi, longitude theta (continuous) [rad] and p_phi = d phi/dt at times t."""
        t = finite_array(times, "times")
        p, q, _, first, side = self._spread_start(t)
        chi = self.phase(t)
        longitude = self._arcs(chi, t).longitude - self.surface.arcs(p, first).longitude
        return (
            self.surface.latitude(side * np.sqrt(q) * np.sin(chi)),
            longitude,
            side * np.sqrt(q) * np.cos(chi) / np.sqrt(1.0 - q * np.sin(chi) ** 2),
        )

    def jacobi_field(self, times: ArrayLike) -> Array:
        """The normal Jacobi field j with j = 0, j' = 1 at the start, by the derivative of the extremal, at times t.

        Its zeros are the conjugate times; j'' + G j = 0 with the Gauss curvature G. Source: see the module
        `surface_of_revolution`.
        """
        t = finite_array(times, "times")
        phase = self.phase(t)
        p, q, room, first, _ = self._spread_start(t)
        bend = self._arcs(phase, t).bend - self.surface.trusted_arcs(p, q, room, first).bend
        there, here = self._stretch(q, room, phase), self._stretch(q, room, first)
        return (
            np.cos(first) * there * np.sin(phase)
            - np.cos(phase) * here * np.sin(first)
            - q * np.cos(phase) * np.cos(first) * bend
        )

    def direction_derivative(self, times: ArrayLike) -> tuple[Array, Array]:
        """d phi and d theta by the direction of the start, at a fixed time: the vertical Jacobi field J_1.

        J_1 per unit of p_theta is this over -sqrt(m) p_phi at the start. p_phi d phi + p_theta d theta = 0.
        Source: Bonnard et al., proposition 1.
        """
        latitude, _, slope = self.state(times)
        field = self.jacobi_field(times)
        p = _spread(self.start.momentum, finite_array(times, "times"))
        distance = np.sqrt(self.surface.metric(latitude))
        return field * p / distance, -field * slope / distance

    def poincare_field(self, times: ArrayLike) -> tuple[Array, Array]:
        """J_2 = t dq/dt of phi and theta at times t: derivative of the end by the magnitude of the initial momentum."""
        t = finite_array(times, "times")
        latitude, _, slope = self.state(t)
        return t * slope, t * _spread(self.start.momentum, t) / self.surface.metric(latitude)

    def _arcs(self, phase: Array, times: Array) -> Arcs:
        return self.surface.trusted_arcs(*np.broadcast_arrays(*self._spread_start(times)[:3], phase))

    def _stretch(self, q: Array, room: Array, phase: Array) -> Array:
        return stretch_at(self.surface, q, room, phase)[0]

    def _spread_start(self, times: Array) -> tuple[Array, ...]:
        """p, q, depth - q, phase and side of the start, with an axis of length 1 for each axis of the times."""
        return tuple(_spread(values, times) for values in vars(self.start).values())


def extremal(surface: SurfaceOfRevolution, direction: ArrayLike, latitude: float = 0.0) -> Extremal:
    """Extremals from a latitude in directions (...), angles from east to north [rad].

    Raises ShapeError if a direction leads out of the band of extremals that oscillate about the equator within the
    chart.

    Examples
    --------
    >>> meridian = sp.rigid_body.geodesics.extremal(sp.rigid_body.geodesics.ellipsoid(1.0), np.pi / 2.0)
    >>> latitude, longitude, direction = meridian.state(0.3)
    >>> print(f"{latitude:.9f}")  # on a sphere as far north as it went
    0.300000000
    """
    return Extremal(surface=surface, start=start_of(surface, direction, latitude))


def start_of(surface: SurfaceOfRevolution, direction: ArrayLike, latitude: float = 0.0) -> Start:
    """`Start` of directions (...) [rad] at a latitude. Raises ShapeError, see `extremal`."""
    check_object(surface, "SurfaceOfRevolution", "surface")
    angle = finite_array(direction, "direction", unit="rad")
    y = float(surface.height(number_argument(latitude, "latitude", "rad")))
    rest = (1.0 - y) * (1.0 + y)
    sine, cosine = np.sin(angle), np.cos(angle)
    p = surface.greatest_momentum * np.sqrt(rest) * cosine
    surface.parameters(p)
    q = y * y + sine * sine * rest
    room = np.maximum(cosine * cosine * rest - (1.0 - surface.depth), 0.0)
    side = np.where(sine < 0.0, -1.0, 1.0)
    phase = np.arctan2(side * y, np.abs(sine) * np.sqrt(rest))
    return Start(momentum=p, q=q, room=room, phase=phase, side=side)


def stretch_at(surface: SurfaceOfRevolution, q: Array, room: Array, phase: Array) -> tuple[Array, Array, Array]:
    """D, D' and D'' at phases of extremals: (...) x 3 -> (...) x 3."""
    q, room, phase = np.broadcast_arrays(q, room, phase)
    square, rest = q * np.sin(phase) ** 2, room + q * np.cos(phase) ** 2
    value, slope, second = (a.reshape(q.shape) for a in surface.stretch(square.ravel(), rest.ravel()))
    return value, slope, second


def variational_jacobi_field(
    surface: SurfaceOfRevolution, direction: float, times: ArrayLike, latitude: float = 0.0
) -> Array:
    """`Extremal.jacobi_field` of one direction by integration of Jacobi's equation j'' + G j = 0: (N,) -> (N,).

    The phase is integrated with it, by d chi/dt = 1/D, so that turning points are regular. Times ascend, from 0 on.

    Source: Bonnard et al., definition 2.2.

    Raises
    ------
    ShapeError
        If the times do not ascend from 0 on.
    AccuracyNotReached
        If the integration fails.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> field = geodesics.variational_jacobi_field(geodesics.ellipsoid(1.0), 0.5, [0.0, np.pi / 2.0])
    >>> print(field.round(9))  # sin t on a sphere
    [0. 1.]
    """
    direction = number_argument(direction, "direction", "rad")
    t = finite_array(times, "times", (None,))
    if t.ndim != 1 or not t.size or t[0] < 0.0 or np.any(np.diff(t) < 0.0):
        raise ShapeError("times: expected ascending times (N,), from 0 on")
    start = start_of(surface, direction, latitude)

    def rate(_: float, state: Array) -> Array:
        value, slope = (float(a) for a in stretch_at(surface, start.q, start.room, np.asarray(state[0]))[:2])
        curvature = (value - 2.0 * float(start.q) * np.sin(state[0]) ** 2 * slope) / value**3
        return np.array([1.0 / value, state[2], -curvature * state[1]])

    state = [float(start.phase), 0.0, 1.0]
    span = (0.0, max(float(t[-1]), np.finfo(float).tiny))
    solution = solve_ivp(rate, span, state, method="DOP853", t_eval=t, rtol=TOLERANCE, atol=1e-15)
    if not solution.success:
        raise AccuracyNotReached(f"Jacobi's equation could not be integrated: {solution.message}")
    return solution.y[1]


def _spread(values: Array, times: Array) -> Array:
    """The directions' axes, followed by one of length 1 for each axis of the times."""
    return np.reshape(values, np.shape(values) + (1,) * np.ndim(times))
