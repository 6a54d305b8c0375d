"""How the geodesic between two near shapes answers to its ends, by the equations that it is found by."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.momentum_gradients import energy_gradients
from .shape_geodesic import ShapeGeodesic, integrals

_STEP = 1e-4  # [rad or m] of central differences: error a few 1e-8 of a small correction
_SETTLED = 1e-10  # change of the field at which to stop: a round gains a factor of about the length [rad]
_MOST_ROUNDS = 40


def changes_by_ends(body: Body, way: ShapeGeodesic) -> Array:
    """The derivatives of the shapes at the nodes by the start and by the end: (N, n, 2 n)."""
    n = way.shapes.shape[1]
    once, twice = integrals(way.nodes)
    share = way.nodes[:, None, None]
    unit = np.eye(n)
    straight = np.concatenate([(1.0 - share) * unit, share * unit], axis=2)
    slope = np.broadcast_to(np.concatenate([-unit, unit], axis=1), straight.shape)
    metric = _metric(body, way.shapes)
    force = _force(body, way.shapes, way.rates)
    acceleration = np.asarray(np.linalg.solve(metric, force[..., None])[..., 0], dtype=np.float64)
    shapes, rates = straight, slope
    for _ in range(_MOST_ROUNDS):
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
    """By changes of shapes and rates at the nodes: (N, n, m) each -> (N, n, m)."""
    sides = []
    for step in (_STEP, -_STEP):
        there = way.shapes[:, None] + step * np.swapaxes(shapes, 1, 2)
        along = way.rates[:, None] + step * np.swapaxes(rates, 1, 2)
        still = np.broadcast_to(acceleration[:, None], there.shape)
        sides.append(_force(body, there, along) - _gradients(body, there, still)[1])
    change = (sides[0] - sides[1]) / (2.0 * _STEP)
    return np.asarray(np.linalg.solve(metric, np.swapaxes(change, 1, 2)), dtype=np.float64)


def _force(body: Body, shapes: Array, rates: Array) -> Array:
    """What bends geodesics, the gradient of the energy less the rate of g r' at rates that stay: (..., n) each."""
    step = _STEP / float(np.abs(rates).max())
    ahead, behind = (_gradients(body, shapes + sign * step * rates, rates)[1] for sign in (1.0, -1.0))
    return _gradients(body, shapes, rates)[0] - (ahead - behind) / (2.0 * step)


def _metric(body: Body, shapes: Array) -> Array:
    """The matrices g: (N, n) -> (N, n, n)."""
    n = shapes.shape[1]
    there = np.broadcast_to(shapes[:, None], (len(shapes), n, n))
    return _gradients(body, there, np.broadcast_to(np.eye(n), there.shape))[1]


def _gradients(body: Body, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """Of the energy, by shapes and by rates: (..., n) -> (..., n) each."""
    n = shapes.shape[-1]
    found = energy_gradients(body.chain, shapes.reshape(-1, n), rates.reshape(-1, n))
    return found[0].reshape(shapes.shape), found[1].reshape(shapes.shape)
