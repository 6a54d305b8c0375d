"""Inertia and momentum over the plane of two joints as Chebyshev series, and gauges in which curvature is shown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...chebyshev import chebyshev, nodes_on, values_to_coefficients
from ...display import short_repr
from ...inertia_tensor import inverse_inertia

_DEGREES = (8, 12, 16, 24, 32, 48)  # tried along each joint
_GOOD = 1e-10  # [rad per unit of joint] difference from the connection of a good series
_CHECKED = 41  # points between the nodes, along each joint
_SAFETY = 2.0  # the largest difference may lie between them
# A recurrence for Chebyshev polynomials of degree n is off by n^2 of this at the edges, in each of two variables.
_ROUNDING = 2.0 * float(np.finfo(float).eps)
# Degree of the turns by which the frame of least perturbation differs from the base, and how often they are improved.
_GAUGE_DEGREE = 8
_GAUGE_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class PlaneSeries:
    """Locked inertia and momentum matrix for two joints, all others at rest: sum of coefficients[a, b] T_a(x) T_b(y).

    Both are entire functions of the angles, so that few terms are enough; the connection, their quotient, needs many.

    box : (2, 2) lowest and highest of each joint [rad or m], where x and y are -1 and 1
    inertia : (n, n, 3, 3) coefficients, base axes [kg m^2]
    momentum : (n, n, 3, 2) coefficients, base axes [kg m^2/s per unit of joint rate]
    inertia_error, momentum_error : largest difference that was found (of a column of the momentum matrix), doubled, and
        rounding, in those units
    error : the same of the connection that follows [rad per unit of joint]
    """

    box: Array
    inertia: Array
    momentum: Array
    inertia_error: float
    momentum_error: float
    error: float

    __repr__ = short_repr

    def connection(self, first: Array, second: Array) -> Array:
        """A at all pairs of coordinates, I^-1 J of the series: (P,), (Q,) -> (P, Q, 3, 2)."""
        terms = [
            chebyshev(_local(values, ends), len(self.inertia))
            for values, ends in zip((first, second), self.box, strict=True)
        ]
        inertia, momentum = (_summed(terms, values) for values in (self.inertia, self.momentum))
        return np.asarray(np.linalg.solve(inertia, momentum), dtype=np.float64)


def plane_series(body: Body, joints: tuple[int, int], box: Array, rest: Array) -> PlaneSeries:
    """Series of the degree that is needed, up to 48, with its errors."""
    between = [np.linspace(ends[0], ends[1], _CHECKED + 2)[1:-1] for ends in box]
    exact = _sampled(body, joints, between, rest)
    connection = inverse_inertia(exact[0]) @ exact[1]
    weakest = float(np.linalg.eigvalsh(exact[0])[..., 0].min())
    steepest = float(np.linalg.norm(connection, axis=-2).max())
    found = None
    for degree in _DEGREES:
        nodes = [nodes_on(box[k, :1], box[k, 1:], degree)[0] for k in range(2)]
        matrix = values_to_coefficients(degree)
        inertia, momentum = (
            np.einsum("ap,bq,pqij->abij", matrix, matrix, values) for values in _sampled(body, joints, nodes, rest)
        )
        terms = [chebyshev(_local(values, ends), degree + 1) for values, ends in zip(between, box, strict=True)]
        rounding = _rounding(inertia, degree), _rounding(momentum, degree)
        tried = PlaneSeries(
            box=box,
            inertia=inertia,
            momentum=momentum,
            inertia_error=_largest_difference(_summed(terms, inertia), exact[0]) + rounding[0],
            momentum_error=_largest_difference(_summed(terms, momentum), exact[1]) + rounding[1],
            error=0.0,
        )
        # Rounding comes into the connection as any error of inertia and momentum does: by I^-1 (dJ - dI A).
        carried = (rounding[1] + steepest * rounding[0]) / weakest
        tried = replace(tried, error=_largest_difference(tried.connection(*between), connection) + carried)
        if found is None or tried.error < found.error:
            found = tried
        if tried.error <= _GOOD:
            break
    assert found is not None
    return found


def least_perturbation_turns(series: PlaneSeries, first: Array, second: Array) -> Array:
    """Turns U(r) to the frame in which the connection is least, in the mean square over the box.

    A frame with axes d' = U d of what are d in base axes sees the connection U A_i + vee(d_i U U^T). U is made of turns
    exp(hat(phi)), each of which minimises the square of A_i + d_i phi over polynomials phi: to first order that is the
    Poisson equation of Hatton and Choset, and the rounds make it exact.

    Parameters
    ----------
    first, second : (P,), (Q,) where the turns are given

    Returns
    -------
    (P, Q, 3, 3)

    Source: Hatton and Choset 2011, Int. J. Robotics Research 30, 988: optimal coordinates by the Hodge-Helmholtz
    decomposition, for rotations component by component.
    """
    count = 2 * _GAUGE_DEGREE + 3
    nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    half = 0.5 * (series.box[:, 1] - series.box[:, 0])
    connection = series.connection(*(series.box.mean(axis=1)[:, None] + half[:, None] * nodes))
    inside, slopes = _basis(nodes)
    # Derivatives of all products of two polynomials by both joints, at all nodes.
    by_first = np.einsum("pa,qb->pqab", slopes, inside).reshape(count**2, -1)[:, 1:] / half[0]
    by_second = np.einsum("pa,qb->pqab", inside, slopes).reshape(count**2, -1)[:, 1:] / half[1]
    equations = np.concatenate([by_first, by_second])
    products = np.einsum("pa,qb->pqab", inside, inside).reshape(count, count, -1)[..., 1:]
    out = [_basis(_local(values, ends))[0] for values, ends in zip((first, second), series.box, strict=True)]
    shown = np.einsum("pa,qb->pqab", *out).reshape(len(first), len(second), -1)[..., 1:]
    turns = np.broadcast_to(np.eye(3), (len(first), len(second), 3, 3))
    for _ in range(_GAUGE_ROUNDS):
        columns = np.moveaxis(connection, -1, 0).reshape(-1, 3)
        weights = np.linalg.lstsq(equations, -columns, rcond=None)[0]
        phi = np.einsum("pqk,ki->pqi", products, weights)
        change = np.stack([(rows @ weights).reshape(count, count, 3) for rows in (by_first, by_second)], axis=-1)
        turn = so3.exp(phi)
        connection = turn @ connection + _left_rates(phi, change)
        turns = so3.exp(np.einsum("pqk,ki->pqi", shown, weights)) @ turns
    return turns


def _left_rates(phi: Array, change: Array) -> Array:
    """vee(dU U^T) of U = exp(hat(phi)) for changes of phi: (..., 3), (..., 3, 2) -> (..., 3, 2)."""
    angle = np.linalg.norm(phi, axis=-1)[..., None, None]
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    across = so3.hat(phi)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return change + first * (across @ change) + second * (across @ across @ change)


def _basis(x: Array) -> tuple[Array, Array]:
    """Chebyshev polynomials and their derivatives: (N,) -> (N, _GAUGE_DEGREE + 1) twice."""
    unit = np.eye(_GAUGE_DEGREE + 1)
    series = np.polynomial.chebyshev
    slopes = np.stack([series.chebval(x, series.chebder(row)) for row in unit], axis=-1)
    return chebyshev(x, _GAUGE_DEGREE + 1), np.asarray(slopes, dtype=np.float64)


def _sampled(body: Body, joints: tuple[int, int], places: list[Array], rest: Array) -> tuple[Array, Array]:
    """Inertia and momentum matrix at all pairs of coordinates: (P,), (Q,) -> (P, Q, 3, 3), (P, Q, 3, 2)."""
    shapes = np.empty((len(places[0]), len(places[1]), body.n_shape))
    shapes[:] = rest
    shapes[:, :, joints[0]], shapes[:, :, joints[1]] = places[0][:, None], places[1]
    return body.locked_inertia(shapes), body.momentum_matrix(shapes)[..., list(joints)]


def _summed(terms: list[Array], coefficients: Array) -> Array:
    return np.einsum("pa,qb,abij->pqij", *terms, coefficients, optimize=True)


def _largest_difference(shown: Array, exact: Array) -> float:
    """Largest norm, doubled: of columns, or of a whole square matrix, which bounds its columns together."""
    axes = (-2, -1) if exact.shape[-1] == 3 else (-2,)
    return _SAFETY * float(np.sqrt(np.sum((shown - exact) ** 2, axis=axes)).max())


def _rounding(coefficients: Array, degree: int) -> float:
    return _ROUNDING * degree**2 * float(np.abs(coefficients).sum(axis=(0, 1)).max())


def _local(values: Array, ends: Array) -> Array:
    return np.clip((2.0 * values - ends.sum()) / (ends[1] - ends[0]), -1.0, 1.0)
