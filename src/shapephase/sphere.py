"""Curves of directions on the unit sphere: signed area, and parallel transport along them.

Areas are positive by the right-hand rule, seen from outside. All functions are batched.

The area form with a reference direction n, dA = n.(u x du) / (1 + n.u), is smooth except at u = -n; its integral
along a closed curve is the signed area modulo 4 pi, self-intersections and windings included, and along a
great-circle arc it has the closed form `triangle_area` (numerics.md section 3).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import so3
from .arrays import Array
from .errors import AccuracyNotReached
from .refinement import halved, settled

Curve = Callable[[Array], tuple[Array, Array]]
"""Times (N,) -> directions (..., N, 3) and a second vector along with them (..., N, 3)."""

_GAUSS = np.polynomial.legendre.leggauss(8)  # nodes in [-1, 1] and weights: exact for polynomials of degree 15
_MAGNUS_NODES = np.polynomial.legendre.leggauss(3)[0]  # nodes in [-1, 1] of the sixth-order Magnus step in `transport`
_HALVINGS = 12  # of all steps: a curve that needs steps 4096 times shorter has a kink between its edges


def area_rate(reference: Array, direction: Array, direction_rate: Array) -> Array:
    """dA/dt = n.(u x u')/(1 + n.u): (3,), (..., 3), (..., 3) -> (...) [sr/s].

    Examples
    --------
    >>> north, u, rate = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    >>> float(sp.sphere.area_rate(north, u, rate))  # along the equator: 2 pi sr in a turn of 2 pi
    1.0
    """
    along = np.sum(so3.cross(direction, direction_rate) * reference, axis=-1)
    return along / (1.0 + np.sum(reference * direction, axis=-1))


def triangle_area(reference: Array, start: Array, end: Array) -> Array:
    """Signed area of the spherical triangle (n, start, end), in (-2 pi, 2 pi] [sr].

    The integral of the area form along the great circle from `start` to `end`.
    Source: van Oosterom and Strackee 1983.

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> print(f"{sp.sphere.triangle_area(x, y, z):.9f} = pi/2, an eighth of the sphere")
    1.570796327 = pi/2, an eighth of the sphere
    """
    volume = np.sum(reference * so3.cross(start, end), axis=-1)
    denominator = 1.0 + np.sum(start * end + reference * start + reference * end, axis=-1)
    return 2.0 * np.arctan2(volume, denominator)


def polygon_area(corners: Array, references: Array | None = None) -> Array:
    """Signed area of a closed polygon of great-circle arcs, the last corner joined to the first: (..., N, 3) -> (...).

    Counted from the region that holds the direction farthest from the corners, opposite `references` (..., 3) where
    these are known. Opposite ends are joined through `so3.middle`.

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> print(f"{sp.sphere.polygon_area(np.array([x, y, z])):.9f} = pi/2")
    1.570796327 = pi/2
    """
    if references is None:
        far = [far_reference(polygon) for polygon in corners.reshape(-1, *corners.shape[-2:])]
        references = np.reshape(far, (*corners.shape[:-2], 3))
    return arc_areas(corners, references).sum(axis=-1)[()]


def arc_areas(corners: Array, references: Array) -> Array:
    """Areas between a closed polygon's arcs and its reference (..., 3), the last arc in two halves: (..., N + 1) [sr].

    (..., N, 3), (..., 3) -> (..., N + 1). Opposite ends are joined through `so3.middle`.

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> print(sp.sphere.arc_areas(np.array([x, y]), (x + y + z) / np.sqrt(3.0)).round(6))
    [ 0.523599 -0.261799 -0.261799]
    """
    first, last = corners[..., :1, :], corners[..., -1:, :]
    closed = np.concatenate([corners, so3.middle(last, first), first], axis=-2)
    return triangle_area(references[..., None, :], closed[..., :-1, :], closed[..., 1:, :])


def curve_area(curve: Curve, edges: Array, tolerance: float = 1e-13) -> Array:
    """Signed area that curves enclose, closed by the great circle from their ends to their starts: (...) [sr].

    The area between the curve and its chord, from edge to edge, is integrated with the chord's start as reference,
    where the area form is smooth; the area of the polygon of chords is exact. So the singularity of the area form is
    never near, whatever the curve winds around.

    Parameters
    ----------
    curve : times (N,) -> directions (..., N, 3) and their rates, smooth between the edges
    edges : (K + 1,) times; the curve's kinks must be among them, others may go unnoticed
    tolerance : of the area [sr]

    Raises
    ------
    AccuracyNotReached
        If the area has not converged after the steps were halved twelve times.

    Examples
    --------
    >>> def circle(t):
    ...     u = np.stack([0.6 * np.cos(t), 0.6 * np.sin(t), np.full_like(t, 0.8)], axis=-1)
    ...     return u, np.stack([-0.6 * np.sin(t), 0.6 * np.cos(t), 0.0 * t], axis=-1)
    >>> area = sp.sphere.curve_area(circle, np.linspace(0.0, 2.0 * np.pi, 9))
    >>> print(f"{float(area):.9f} = 2 pi (1 - 0.8)")
    1.256637061 = 2 pi (1 - 0.8)
    """

    def area(edges: Array) -> Array:
        nodes, weights = gauss_nodes(edges[:-1], edges[1:])
        direction, rate = (part.reshape(*part.shape[:-2], *nodes.shape, 3) for part in curve(nodes.ravel()))
        corners, _ = curve(edges)
        slivers = (area_rate(corners[..., :-1, None, :], direction, rate) * weights).sum(axis=(-1, -2))
        return slivers + polygon_area(corners)

    return _settled("the solid angle of", area, edges, lambda last, new: np.abs(wrapped(new - last)), tolerance)


def transport(curve: Curve, edges: Array, tolerance: float = 1e-12) -> Array:
    """Parallel transport of the tangent plane along curves: the rotation F with F' = hat(u x u') F: (..., 3, 3).

    It takes the curve's start to its end, as the sphere rolls along without twisting; round a closed curve it is a turn
    about the start by the enclosed area.

    Source: theory.md D4; the steps are the sixth-order Magnus formula of Blanes, Casas and Ros 2000.

    Parameters
    ----------
    curve : as for `curve_area`
    edges : (K + 1,) times; the curve's kinks must be among them, others may go unnoticed
    tolerance : of the rotation [rad]

    Raises
    ------
    AccuracyNotReached
        If the rotation has not converged after the steps were halved twelve times.

    Examples
    --------
    >>> def circle(t):
    ...     u = np.stack([0.6 * np.cos(t), 0.6 * np.sin(t), np.full_like(t, 0.8)], axis=-1)
    ...     return u, np.stack([-0.6 * np.sin(t), 0.6 * np.cos(t), 0.0 * t], axis=-1)
    >>> turn = sp.sphere.transport(circle, np.linspace(0.0, 2.0 * np.pi, 9))
    >>> print(f"{float(sp.so3.angle(turn)):.9f} = 2 pi (1 - 0.8), the area inside")
    1.256637061 = 2 pi (1 - 0.8), the area inside
    """

    def rotation(edges: Array) -> Array:
        steps = np.diff(edges)
        nodes = edges[:-1, None] + 0.5 * steps[:, None] * (_MAGNUS_NODES + 1.0)
        direction, rate = (part.reshape(*part.shape[:-2], *nodes.shape, 3) for part in curve(nodes.ravel()))
        early, middle, late = np.moveaxis(np.cross(direction, rate) * steps[:, None, None], -2, 0)
        slope, bend = np.sqrt(15.0) / 3.0 * (late - early), 10.0 / 3.0 * (late - 2.0 * middle + early)
        first = np.cross(middle, slope)
        second = -np.cross(middle, 2.0 * bend + first) / 60.0
        turns = so3.exp(middle + bend / 12.0 + np.cross(-20.0 * middle - bend + first, slope + second) / 240.0)
        whole = turns[..., 0, :, :]
        for step in range(1, len(steps)):
            whole = turns[..., step, :, :] @ whole
        return whole

    def change(last: Array, new: Array) -> Array:
        return so3.angle(new @ so3.transpose(last))

    return _settled("the transport along", rotation, edges, change, tolerance)


def _settled(
    what: str,
    result: Callable[[Array], Array],
    edges: Array,
    change: Callable[[Array, Array], Array],
    tolerance: float,
) -> Array:
    """The first result of ever shorter steps that changes by at most a tolerance. Raises AccuracyNotReached."""
    steps = map(result, halved(edges, _HALVINGS))
    found = settled(steps, lambda last, new: float(np.max(change(last, new))), tolerance)
    if found is None:
        raise AccuracyNotReached(f"{what} a curve does not settle; give more edges, the times of its kinks among them")
    return found


def wrapped(area: Array) -> Array:
    """A signed area modulo 4 pi in (-2 pi, 2 pi] [sr].

    Examples
    --------
    >>> print(f"{sp.sphere.wrapped(7.0):.6f} = 7 - 4 pi")
    -5.566371 = 7 - 4 pi
    """
    return 2.0 * so3.wrap(0.5 * area)


def gauss_nodes(left: Array, right: Array) -> tuple[Array, Array]:
    """Eight Gauss-Legendre nodes in each step and their weights: (K,), (K,) -> (K, 8), (K, 8).

    Examples
    --------
    >>> nodes, weights = sp.sphere.gauss_nodes(np.array([0.0]), np.array([1.0]))
    >>> round(float(np.sum(weights * nodes**3)), 12)  # the integral of t^3
    0.25
    """
    half = 0.5 * (right - left)[:, None]
    return left[:, None] + half * (_GAUSS[0] + 1.0), half * _GAUSS[1]


def far_reference(directions: Array) -> Array:
    """The reference n, of a fixed fine set, whose antipode is farthest from a curve: (N, 3) -> (3,).

    The region of the sphere that holds -n is the one whose area is not counted, which fixes the branch
    of the area of a winding curve.

    Examples
    --------
    >>> reference = sp.sphere.far_reference(np.array([[0.0, 0.0, 1.0]]))
    >>> float(reference[2]) > 0.9  # its antipode is far from the one direction, north
    True
    """
    return REFERENCES[np.argmax(np.min(directions @ REFERENCES.T, axis=0))]


def fibonacci_directions(count: int) -> Array:
    """Directions spread evenly over the sphere: (count, 3).

    Examples
    --------
    >>> spread = sp.sphere.fibonacci_directions(100)
    >>> np.linalg.norm(spread, axis=1).round(9).sum().item(), float(np.linalg.norm(spread.mean(axis=0))) < 0.01
    (100.0, True)
    """
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)


REFERENCES = fibonacci_directions(642)  # those that `far_reference` chooses from: (642, 3)
