"""Frames over a region of shapes in which a body is disturbed least, so that one integral predicts its turn best."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import whole_argument
from ...arrays import Array, finite_array
from ...body.body import Body
from ...body.loading import as_body_or_particles
from ...body.particles.point_masses import ParticleBody
from ...display import frozen
from ...errors import AccuracyNotReached, ShapeError
from ..body_path import check_closed, in_joint_order, route_along
from ..connection import integral, mechanical_connection
from ..path_series import panel_edges, turn_of_a_loop
from ..shape_path import ShapePath

_MOST_DEGREE = 6  # of the polynomials; the number of terms is about n^degree
_MOST_TERMS = 3000  # least squares with more take minutes
_POINTS_PER_TERM = 4  # shapes at which the connection is made small
_LEAST_POINTS = 512  # such shapes at least
_STEPS = 40  # largest number of corrections: each is about a hundredth of the last
_SMALL_STEP = 1e-11  # [rad] of the last correction
_TURN_TOLERANCE = 1e-12  # change of the integral of the connection's size at which halving ends


@frozen
class MinimumPerturbation:
    """A frame U(r) for each shape of a region, with the least connection. Made by `minimum_perturbation`.

    Attributes
    ----------
    body : whose shapes they are
    centre : (n,) of the region, where U is the identity [rad or m]
    widths : (n,) half widths of the region [rad or m]
    powers : (K, n) exponents of the terms of the polynomials
    layers : (S, K, 3) coefficients; U is the product of the exponentials of S polynomials, the last one on the left
    mean_square : of the connection over the region, in this frame and in that of the base [1]
    """

    body: Body | ParticleBody
    centre: Array
    widths: Array
    powers: Array
    layers: Array
    mean_square: tuple[float, float]

    def frame(self, shape: ArrayLike) -> Array:
        """U, the base's vectors seen from the frame: (..., n) -> (..., 3, 3)."""
        return self._reached(shape)[0]

    def connection(self, shape: ArrayLike) -> Array:
        """The connection in this frame, U (A_j + U^T d_j U): (..., n) -> (..., 3, n), as `mechanical_connection`."""
        return self._reached(shape)[1]

    def along(self, path: ShapePath | str) -> Callable[[Array], tuple[Array, Array]]:
        """The frame in time, for `in_gauge`: times (N,) -> U (N, 3, 3) and its body rates (N, 3) [rad/s]."""
        route = in_joint_order(self.body, path)

        def frames(times: Array) -> tuple[Array, Array]:
            shapes, rates = route.curve(times)
            turned, seen = self._reached(shapes)
            back = so3.transpose(turned)
            return turned, so3.apply(back @ seen - mechanical_connection(self.body, shapes), rates)

        return frames

    def first_order_turn(self, path: ShapePath | str) -> Array:
        """The turn of a loop by one integral of the connection in this frame, exp(-integral of A): -> (3, 3).

        Seen from the base at the start, as `holonomy`. The integral is right to 1e-12 of that of the connection's size,
        whatever the loop: it is taken on the panels on which the path is resolved, halved until it changes no more.

        Raises
        ------
        OpenPathError
            For a path that is not a loop.
        AccuracyNotReached
            If the integral still changes, as where the joints go far beyond the region of the frame.
        """
        route = route_along(self.body, path)
        check_closed(self.body, route)

        def turning(times: Array) -> tuple[Array, Array]:
            shapes, rates = route.curve(times)
            columns = self._reached(shapes)[1]
            sizes = np.einsum("nak,nk->n", np.abs(columns), np.abs(rates))
            return so3.apply(columns, rates)[:, None], sizes

        # A joint that winds is elsewhere in the region of the frame in the next loop.
        wound = turn_of_a_loop(route).any()
        loops = route.loops if wound else 1
        total = integral(turning, panel_edges(route, loops), _TURN_TOLERANCE)[0] * (route.loops // loops)
        start, end = self.frame(route.shape(np.array([0.0, route.duration])))
        return start.T @ so3.exp(-total) @ end

    def _reached(self, shape: ArrayLike) -> tuple[Array, Array]:
        r = finite_array(shape, "shape")
        seen = mechanical_connection(self.body, r)
        values, slopes = _terms(((r - self.centre) / self.widths).reshape(-1, len(self.centre)), self.powers)
        frame, columns = _layered(
            values, slopes / self.widths[:, None], seen.reshape(-1, *seen.shape[-2:]), self.layers
        )
        return frame.reshape(*r.shape[:-1], 3, 3), columns.reshape(seen.shape)


def minimum_perturbation(
    body: Body | ParticleBody | str, centre: ArrayLike, width: ArrayLike, degree: int = 3
) -> MinimumPerturbation:
    """The frame of the body, as a function of its shape, in which motions of the joints disturb it least on the whole.

    U(r) makes the mean square of the connection over a region as small as polynomials can. There the connection has no
    divergence, and one integral of it, exp(-integral of A), predicts the turn of a loop better than in the base or in
    `mean_body_gauge`, which is best near one shape only.

    Source: Travers, Hatton and Choset 2013 (minimum perturbation); theory.md B4.

    Parameters
    ----------
    centre : (n,) of the region [rad or m]
    width : half width of the region, of all joints or (n,) of each [rad or m]
    degree : of the polynomials, 1 to 6

    Raises
    ------
    ShapeError
        If the region is none of the body's shapes, or there would be more than 3,000 terms.
    AccuracyNotReached
        If the frame is not found, as over a region so wide that the body turns over in it.

    Examples
    --------
    >>> frames = sp.minimum_perturbation(sp.load_body("cat_two_halves"), [0.0, 0.0, 0.0], 0.5)
    >>> least, base = frames.mean_square
    >>> bool(least < 0.2 * base)
    True
    """
    body = as_body_or_particles(body)
    count = body.n_shape
    middle = finite_array(centre, "centre").copy()
    widths = np.broadcast_to(finite_array(width, "width"), middle.shape if np.ndim(width) == 0 else np.shape(width))
    if middle.shape != (count,) or widths.shape != (count,) or not count or np.any(widths <= 0.0):
        raise ShapeError(
            f"centre and width: a shape ({count},) and half widths above 0 are needed, got {middle.shape} and "
            f"{np.shape(width)}"
        )
    highest = whole_argument(degree, "degree", 1)
    powers = _powers(count, highest) if highest <= _MOST_DEGREE and count**highest < 1e7 else np.zeros((0, count))
    if not 0 < len(powers) <= _MOST_TERMS:
        raise ShapeError(f"degree: 1 to {_MOST_DEGREE}, with at most {_MOST_TERMS} terms, is needed, got {degree}")
    points = max(_LEAST_POINTS, _POINTS_PER_TERM * len(powers))
    unit = _even_points(count, points)
    values, slopes = _terms(unit, powers)
    base = mechanical_connection(body, middle + unit * widths)
    # Joints count by the widths of the region, whatever their units.
    scaled = base * widths
    layers = np.zeros((0, len(powers), 3))
    seen = scaled
    for _ in range(_STEPS):
        change = _correction(values, slopes, seen)
        layers = np.concatenate([layers, change[None]])
        _, seen = _layered(values, slopes, scaled, layers)
        if np.abs(values @ change).max() < _SMALL_STEP:
            break
    else:
        raise AccuracyNotReached("the frame of the least perturbation was not found; take a smaller region")
    least, given = (float(np.mean(np.sum(each**2, axis=(-1, -2)))) for each in (seen, scaled))
    return MinimumPerturbation(
        body=body, centre=middle, widths=widths.copy(), powers=powers, layers=layers, mean_square=(least, given)
    )


def _even_points(count: int, points: int) -> Array:
    """Points spread evenly over [-1, 1]^n: (points, n).

    Multiples of powers of 1/g, g the root of g^(n + 1) = g + 1, modulo 1 (Roberts 2018; the golden ratio for n = 1).
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (count + 1.0))
    steps = np.array([ratio**-power for power in range(1, count + 1)])
    places = np.mod(0.5 + np.arange(points)[:, None] * steps, 1.0)
    return 2.0 * places - 1.0


def _powers(count: int, degree: int) -> Array:
    """Exponents of all terms of degree 1 to `degree`: (K, n)."""
    rows = [
        np.bincount(which, minlength=count)
        for total in range(1, degree + 1)
        for which in combinations_with_replacement(range(count), total)
    ]
    return np.array(rows, dtype=np.float64)


def _terms(x: Array, powers: Array) -> tuple[Array, Array]:
    """Terms and their derivatives: (N, n), (K, n) -> (N, K), (N, n, K)."""
    raised = x[:, None] ** powers
    values = raised.prod(axis=-1)
    slopes = np.empty((len(x), x.shape[1], len(powers)))
    for j in range(x.shape[1]):
        lowered = powers[:, j] * x[:, None, j] ** np.maximum(powers[:, j] - 1.0, 0.0)
        slopes[:, j] = lowered * np.delete(raised, j, axis=-1).prod(axis=-1)
    return values, slopes


def _layered(values: Array, slopes: Array, columns: Array, layers: Array) -> tuple[Array, Array]:
    """The frame, and the connection seen from it: (N, K), (N, n, K), (N, 3, n), (S, K, 3) -> (N, 3, 3), (N, 3, n)."""
    frame = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for layer in layers:
        turn, rates = values @ layer, np.swapaxes(slopes @ layer, -1, -2)
        step = so3.exp(turn)
        frame = step @ frame
        columns = step @ (columns + _right_jacobian(turn) @ rates)
    return frame, columns


def _right_jacobian(turn: Array) -> Array:
    """The body rate of exp(turn) per unit of the turn's rate: (N, 3) -> (N, 3, 3)."""
    angle = np.linalg.norm(turn, axis=-1)[:, None, None]
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, 2.0 * np.sin(0.5 * safe) ** 2 / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    spin = so3.hat(turn)
    return np.eye(3) - first * spin + second * spin @ spin


def _correction(values: Array, slopes: Array, columns: Array) -> Array:
    """Coefficients (K, 3) of the small turn psi that makes A_j + d_j psi + psi x A_j least, in the mean square."""
    spin = -so3.hat(np.swapaxes(columns, -1, -2))
    # Rows are points, joints and axes; columns terms and axes.
    rows = slopes[..., None, :, None] * np.eye(3)[:, None, :] + spin[..., :, None, :] * values[:, None, None, :, None]
    matrix = rows.reshape(-1, 3 * values.shape[1])
    coefficients = np.linalg.lstsq(matrix, -np.swapaxes(columns, -1, -2).reshape(-1), rcond=1e-12)[0]
    return np.asarray(coefficients, dtype=np.float64).reshape(-1, 3)
