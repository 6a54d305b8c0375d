"""The geodesic that closes a recorded path, and its derivatives by that path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial

from ..arrays import Array
from ..body.body import Body
from ..body.momentum_gradients import energy_gradients
from .curves import PiecewisePolynomial
from .shape_geodesic import ShapeGeodesic, changes_by_ends, shape_geodesic, shape_speed
from .shape_path import ShapePath, interpolated

PIECES = 4  # cubics of a geodesic: each within 1e-9 of a geodesic of 0.1 rad


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
