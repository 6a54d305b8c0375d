"""Shortest ways between near shapes, in the metric of the kinetic energy of a body without angular momentum.

One of them closes a recorded path: that, and its derivatives by the path, is a `ClosingArc`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike

from ..arguments import check_object
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_no_balls
from ..body.momentum_gradients import energy_gradients
from ..errors import TrajectoryError
from .curves import PiecewisePolynomial
from .shape_path import ShapePath, interpolated

_DEGREE = 6  # of the acceleration's polynomial: between near shapes it is nearly constant
_ROUNDS = 40  # largest number: each gains a factor of about the distance [rad]
_SETTLED = 1e-10  # change at which iterations end, of the way relative to its length
PIECES = 4  # cubics of a geodesic: each within 1e-9 of a geodesic of 0.1 rad
_STEP = 1e-4  # [rad or m] of central differences: error a few 1e-8 of a small correction


class ShapeGeodesic(NamedTuple):
    """A geodesic on [0, 1], at constant speed.

    nodes : (N,) from 0 to 1
    shapes : (N, n) there [rad or m]
    rates : (N, n) by the parameter [rad or m]
    length : in the metric of the kinetic energy [kg^(1/2) m]
    """

    nodes: Array
    shapes: Array
    rates: Array
    length: float


def shape_speed(body: Body, shape: ArrayLike, rate: ArrayLike) -> Array:
    """Speed of a joint motion in the metric of the kinetic energy: (..., n), (..., n) -> (...) [kg^(1/2) m/s].

    The square is twice the kinetic energy about the centre of mass of the body without angular momentum, whose base
    turns at -A rate. Source: Montgomery 1993; theory.md A6, B1.
    """
    check_object(body, "Body", "body")
    shapes, rates = np.broadcast_arrays(finite_array(shape, "shape", (None,)), finite_array(rate, "rate", (None,)))
    momenta = _gradients(body, np.array(shapes), np.array(rates))[1]
    return np.sqrt(np.maximum(np.sum(rates * momenta, axis=-1), 0.0))


def shape_geodesic(body: Body, start: ArrayLike, end: ArrayLike) -> ShapeGeodesic:
    """The geodesic between two near shapes, by successive approximation from the straight line.

    Its acceleration is g^-1 (grad(r'.g r')/2 - (r'.grad g) r'), integrated twice between the two ends.

    start, end : (n,) [rad or m], a few tenths apart

    Raises TrajectoryError if the shapes are so far apart that the approximation does not settle, or joints move
    nothing.
    """
    check_object(body, "Body", "body")
    check_no_balls(body.chain.follows, "geodesics of shapes need")
    first = finite_array(start, "start", (body.n_shape,)).copy()
    last = finite_array(end, "end", (body.n_shape,)).copy()
    nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)
    once, twice = _integrals(nodes)
    straight = last - first
    shapes = first + nodes[:, None] * straight
    rates = np.broadcast_to(straight, shapes.shape)
    scale = float(np.abs(straight).max(initial=0.0))
    too_far = TrajectoryError(f"no geodesic was found between two shapes whose joints differ by up to {scale:.6g}")
    for _ in range(_ROUNDS if scale > 0.0 else 0):
        acceleration = _acceleration(body, _metric(body, shapes), shapes, rates)
        bent = twice @ acceleration
        slope = straight - bent[-1]
        old, shapes = shapes, first + nodes[:, None] * slope + bent
        rates = slope + once @ acceleration
        if not np.abs(shapes - old).max() > _SETTLED * scale:
            break
        if not np.abs(shapes - first).max() < 10.0 * scale:
            raise too_far
    else:
        if scale > 0.0:
            raise too_far
    return ShapeGeodesic(nodes, shapes, rates, float(shape_speed(body, shapes, rates).mean()))


def _integrals(nodes: Array) -> tuple[Array, Array]:
    """Matrices from values at the nodes to the integral from 0 to each node, once and twice."""
    powers = np.vander(nodes, increasing=True)
    orders = np.arange(len(nodes))
    inverse = np.linalg.inv(powers)
    once = powers * nodes[:, None] / (orders + 1.0)
    twice = once * nodes[:, None] / (orders + 2.0)
    return once @ inverse, twice @ inverse


def _acceleration(body: Body, metric: Array, shapes: Array, rates: Array) -> Array:
    """Acceleration of the geodesics with these rates: (N, n, n), (N, n), (N, n) -> (N, n)."""
    try:
        return np.asarray(np.linalg.solve(metric, _force(body, shapes, rates)[..., None])[..., 0], dtype=np.float64)
    except np.linalg.LinAlgError:
        raise TrajectoryError("there is no geodesic: some joints move no mass") from None


def changes_by_ends(body: Body, way: ShapeGeodesic) -> Array:
    """The derivatives of the shapes at the nodes by the start and by the end: (N, n, 2 n)."""
    n = way.shapes.shape[1]
    once, twice = _integrals(way.nodes)
    share = way.nodes[:, None, None]
    unit = np.eye(n)
    straight = np.concatenate([(1.0 - share) * unit, share * unit], axis=2)
    slope = np.broadcast_to(np.concatenate([-unit, unit], axis=1), straight.shape)
    metric = _metric(body, way.shapes)
    acceleration = _acceleration(body, metric, way.shapes, way.rates)
    shapes, rates = straight, slope
    for _ in range(_ROUNDS):
        bent = _change_of_acceleration(body, way, metric, acceleration, shapes, rates)
        whole = np.tensordot(twice, bent, 1)
        before, shapes = shapes, straight - share * whole[-1] + whole
        rates = slope - whole[-1] + np.tensordot(once, bent, 1)
        if np.abs(shapes - before).max(initial=0.0) < _SETTLED:
            break
    return shapes


def _change_of_acceleration(
    body: Body, way: ShapeGeodesic, metric: Array, acceleration: Array, shapes: Array, rates: Array
) -> Array:
    """Change of the acceleration by changes of shapes and rates at the nodes: (N, n, m) each -> (N, n, m)."""
    sides = []
    for step in (_STEP, -_STEP):
        there = way.shapes[:, None] + step * np.swapaxes(shapes, 1, 2)
        along = way.rates[:, None] + step * np.swapaxes(rates, 1, 2)
        still = np.broadcast_to(acceleration[:, None], there.shape)
        sides.append(_force(body, there, along) - _gradients(body, there, still)[1])
    change = (sides[0] - sides[1]) / (2.0 * _STEP)
    return np.asarray(np.linalg.solve(metric, np.swapaxes(change, 1, 2)), dtype=np.float64)


def _force(body: Body, shapes: Array, rates: Array) -> Array:
    """Force on geodesics, the gradient of the energy less the rate of g r' at constant rates: (..., n) each."""
    step = _STEP / float(np.abs(rates).max())
    ahead, behind = (_gradients(body, shapes + sign * step * rates, rates)[1] for sign in (1.0, -1.0))
    return _gradients(body, shapes, rates)[0] - (ahead - behind) / (2.0 * step)


def _metric(body: Body, shapes: Array) -> Array:
    """The matrices g of twice the energy, r'.g r': (N, n) -> (N, n, n)."""
    n = shapes.shape[1]
    there = np.broadcast_to(shapes[:, None], (len(shapes), n, n))
    return _gradients(body, there, np.broadcast_to(np.eye(n), there.shape))[1]


def _gradients(body: Body, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """Gradients of the energy by shapes and by rates: (..., n) -> (..., n) each."""
    n = shapes.shape[-1]
    gradients = energy_gradients(body.chain, shapes.reshape(-1, n), rates.reshape(-1, n))
    return gradients[0].reshape(shapes.shape), gradients[1].reshape(shapes.shape)


@dataclass(frozen=True, eq=False)
class ClosingArc:
    """The way back from the end of a path to its start, as fast as the path itself, rms.

    body : in whose metric it is the shortest
    opened : the path
    way : the geodesic, from the last shape to the first
    """

    body: Body
    opened: ShapePath
    way: ShapeGeodesic

    @cached_property
    def speed(self) -> float:
        """Rms speed of the path [kg^(1/2) m/s]."""
        speeds = shape_speed(self.body, *self.opened.curve(self.opened.breaks))
        return float(np.sqrt(np.mean(speeds**2)))

    @property
    def seconds(self) -> float:
        """Duration of the way back [s]."""
        return self.way.length / self.speed

    @property
    def curve(self) -> PiecewisePolynomial:
        """The path and the way back as one."""
        opened = self.opened.curve
        assert isinstance(opened, PiecewisePolynomial)
        seconds = self.seconds
        knots = np.concatenate([opened.knots, opened.knots[-1] + seconds * np.arange(1, PIECES + 1) / PIECES])
        cubics = _cubics(self.way.nodes, self.way.shapes) / seconds ** np.arange(4)[:, None, None]
        return PiecewisePolynomial(knots, np.concatenate([opened.coefficients, cubics], axis=1))

    @property
    def closed(self) -> ShapePath:
        """The path with the way back at its end."""
        curve, opened = self.curve, self.opened
        duration = float(curve.knots[-1])
        return ShapePath(curve, duration, curve.knots, opened.n_shape, opened.joint_names, origin=self)

    def path(self, samples: Array) -> ShapePath:
        """Return the closed path of other samples, as `PathOrigin`; it makes the same whole turns."""
        before, origin = self.opened.curve, self.opened.origin
        assert isinstance(before, PiecewisePolynomial)
        names = self.opened.joint_names
        opened = origin.path(samples) if origin else interpolated(before.knots, samples, before.through, names)
        turns = self.way.shapes[-1] - before(before.knots[:1])[0][0]
        first, last = opened.curve(opened.breaks[[0, -1]])[0]
        return ClosingArc(self.body, opened, shape_geodesic(self.body, last, first + turns)).closed

    def by_ends(self, by_cubics: Array) -> Array:
        """Convert derivatives by the cubics' coefficients (4, PIECES, m, n) to those by the path's first and last
        shape: (2, m, n)."""
        changes = changes_by_ends(self.body, self.way)
        n = changes.shape[1]
        by_nodes = _cubics(self.way.nodes, changes.reshape(len(changes), -1)).reshape(4, PIECES, n, 2, n)
        by_nodes /= self.seconds ** np.arange(4)[:, None, None, None, None]
        # The geodesic starts where the path ends.
        return np.einsum("pimj,pijek->emk", by_cubics, by_nodes)[::-1]

    def seconds_by_path(self) -> tuple[Array, Array, Array]:
        """The derivatives of the time that it takes: by the path's first and last shape, (2, n), and by its shapes and
        rates at its breaks, (N, n) each."""
        ends = [0, -1]
        momenta = energy_gradients(self.body.chain, self.way.shapes[ends], self.way.rates[ends])[1]
        of_length = np.stack([momenta[1], -momenta[0]]) / self.way.length
        by_shape, by_rate = energy_gradients(self.body.chain, *self.opened.curve(self.opened.breaks))
        factor = -self.seconds / (self.speed**2 * len(by_shape))
        return of_length / self.speed, factor * by_shape, factor * by_rate


def _cubics(nodes: Array, shapes: Array) -> Array:
    """Cubics in the parameter from 0 to 1, PIECES of them, with the values and slopes of the polynomial through shapes
    at nodes: (N,), (N, m) -> (4, PIECES, m)."""
    edges = np.linspace(0.0, 1.0, PIECES + 1)
    fit = polynomial.polyfit(nodes, shapes, len(nodes) - 1)
    values = np.array(polynomial.polyval(edges, fit).T, dtype=np.float64)
    values[[0, -1]] = shapes[[0, -1]]
    slopes = np.array(polynomial.polyval(edges, polynomial.polyder(fit)).T, dtype=np.float64)
    step = 1.0 / PIECES
    rise, start, end = (values[1:] - values[:-1]) / step, slopes[:-1], slopes[1:]
    return np.stack([values[:-1], start, (3.0 * rise - 2.0 * start - end) / step, (start + end - 2.0 * rise) / step**2])
