"""Euler's equations as a cross product of two gradients, and the Lie groups behind them.

With the energy H = Pi.I^-1 Pi / 2 and L = |Pi|^2 / 2, Euler's equations are Pi' = grad L x grad H. They have this form
with K = a H + b L and N = c H + d L for every real matrix (a, b; c, d) of determinant -1 or 1, but for a sign:

    Pi' = grad K x grad N where ad - bc = -1,    Pi' = grad N x grad K where ad - bc = 1.

K is then a Casimir of the bracket {F, G} = -grad K.(grad F x grad G) (of the opposite one for determinant 1), which is
the minus Lie-Poisson bracket of the Lie algebra [a, b] = Q (a x b), Q the matrix of K; and N is the Hamiltonian. The
signature of K decides which algebra.

Marsden and Ratiu (15.11.1), (15.11.5) have the first form together with determinant 1, which runs time backwards.
Source: Marsden and Ratiu, section 15.11, after Holm and Marsden 1991; theory.md M-E11, N1, N9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import moments_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...inertia_tensor import principal_axes
from .._arguments import FEW_ULPS, one_array, one_tensor
from .lie_algebra import NEAR_ZERO, WRITTEN_DIGITS

# By the number of eigenvalues of the more frequent and of the less frequent sign.
_GROUPS = {(3, 0): "SO(3)", (2, 1): "SO(2,1)", (2, 0): "SE(2)", (1, 1): "SE(1,1)", (1, 0): "Heisenberg", (0, 0): "R^3"}


@dataclass(frozen=True, eq=False)
class NambuPair:
    """K = Pi.casimir Pi / 2 and N = Pi.hamiltonian Pi / 2 with Pi' = orientation (grad K x grad N).

    Made by `nambu_pair`.
    """

    casimir: Array
    """(3, 3) symmetric, the matrix of K."""
    hamiltonian: Array
    """(3, 3) symmetric, the matrix of N."""
    orientation: float
    """1 or -1."""

    __repr__ = short_repr

    def values(self, momentum: ArrayLike) -> tuple[Array, Array]:
        """K and N, both constant along a motion: (..., 3) -> (...), (...)."""
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        return 0.5 * _dot(pi, pi @ self.casimir), 0.5 * _dot(pi, pi @ self.hamiltonian)

    def rate(self, momentum: ArrayLike) -> Array:
        """Pi' = orientation (grad K x grad N): (..., 3) -> (..., 3) [kg m^2/s^2]."""
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        return self.orientation * np.cross(pi @ self.casimir, pi @ self.hamiltonian)

    def bracket(self, momentum: ArrayLike, gradient_f: ArrayLike, gradient_g: ArrayLike) -> Array:
        """{F, G} = -orientation grad K.(grad F x grad G): (..., 3) each -> (...). So F' = {F, N}.

        Source: Marsden and Ratiu (15.11.21).
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        first, second = finite_array(gradient_f, "gradient_f", (3,)), finite_array(gradient_g, "gradient_g", (3,))
        return -self.orientation * _dot(pi @ self.casimir, np.cross(first, second))

    @property
    def structure_constants(self) -> Array:
        """c[i, j, k] of the Lie algebra whose minus Lie-Poisson bracket `bracket` is: (3, 3, 3)."""
        return structure_constants(self.orientation * self.casimir)

    @property
    def group(self) -> str:
        """The Lie group of K, see `lie_group`."""
        return lie_group(self.casimir)


def nambu_pair(inertia: ArrayLike, matrix: ArrayLike) -> NambuPair:
    """K = a H + b L and N = c H + d L of a rigid body; coefficients of Pi^2 that vanish up to rounding are zero.

    Source: Marsden and Ratiu (15.11.5), (15.11.6); theory.md M-E11.
    Raises ShapeError if the determinant differs from 1 and -1 by more than 1e-9.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2, body axes]
    matrix : (2, 2), (a, b; c, d) with ad - bc = 1 or -1

    Examples
    --------
    >>> pair = sp.rigid_body.lie.nambu_pair(np.diag([1.0, 2.0, 4.0]), [[1.0, 0.0], [0.0, 1.0]])
    >>> pair.casimir.diagonal().tolist(), pair.hamiltonian.diagonal().tolist()
    ([1.0, 0.5, 0.25], [1.0, 1.0, 1.0])
    """
    tensor, entries = one_tensor(inertia), one_array(matrix, "matrix", (2, 2))
    (a, b), (c, d) = entries
    determinant = a * d - b * c
    if abs(abs(determinant) - 1.0) > WRITTEN_DIGITS * (1.0 + abs(a * d) + abs(b * c)):
        raise ShapeError(
            f"matrix: (a, b; c, d) = {entries.tolist()} has ad - bc = {determinant:.9g}; it must be -1, or 1 for the "
            "reversed cross product: divide a row by it"
        )
    moments, axes = principal_axes(tensor)
    is_diagonal = not np.any(tensor - np.diag(np.diag(tensor)))
    # The moments of a diagonal tensor are exact; others carry the rounding of the largest.
    rounding = np.ones(3) if is_diagonal else moments[2] / moments
    casimir, hamiltonian = (axes @ np.diag(_coefficients(moments, row, rounding)) @ axes.T for row in entries)
    return NambuPair(
        casimir=0.5 * (casimir + casimir.T),
        hamiltonian=0.5 * (hamiltonian + hamiltonian.T),
        orientation=float(-np.sign(determinant)),
    )


def cylinder_matrix(moments: ArrayLike) -> Array:
    """(a, b; c, d) that makes K and N cylinders, about the third and the first axis: (3,) -> (2, 2).

    The moments may be in any order; the cylinders are elliptic where the second one is the intermediate, as for the
    ascending moments of the book. The determinant is 1, as there, so Pi' = grad N x grad K.

    Source: Marsden and Ratiu (15.11.7).
    Raises ShapeError if the moments are not positive, or the first equals the third.

    Examples
    --------
    >>> matrix = sp.rigid_body.lie.cylinder_matrix([1.0, 2.0, 4.0])
    >>> sp.rigid_body.lie.nambu_pair(np.diag([1.0, 2.0, 4.0]), matrix).casimir.diagonal().round(9).tolist()
    [0.75, 0.25, 0.0]
    """
    first, _, third = moments_argument(moments)
    if first == third:
        raise ShapeError(f"moments: the first and the third are both {first:.17g}, and must differ; permute the axes")
    return np.array([[1.0, -1.0 / third], [-first * third / (third - first), third / (third - first)]])


def structure_constants(form: ArrayLike) -> Array:
    """c[i, j, k] with [e_i, e_j] = sum of c[i, j, k] e_k for the bracket [a, b] = Q (a x b): (3, 3) -> (3, 3, 3).

    Source: Marsden and Ratiu, theorem 15.11.3 and exercise 14.9-1.

    Parameters
    ----------
    form : (3, 3) symmetric, Q; Pi.Q Pi / 2 is then a Casimir of the Lie-Poisson bracket

    Examples
    --------
    >>> sp.rigid_body.lie.structure_constants(np.eye(3))[0, 1].tolist()  # those of so(3)
    [0.0, 0.0, 1.0]
    """
    return np.einsum("ijl,lk->ijk", so3.hat(np.eye(3)).transpose(1, 2, 0) * -1.0, _form(form))


def lie_group(form: ArrayLike) -> str:
    """The Lie group whose dual's Casimir is a quadratic form, by its signature: (3, 3) -> name.

    "SO(3)" (+++), "SO(2,1)" (++-), "SE(2)" (++0), "SE(1,1)" (+-0), "Heisenberg" (+00), "R^3" (000), each up to a
    common sign. An eigenvalue below 1e-14 of the largest counts as zero. For a non-degenerate form the group is that
    of the rotations of the form.

    Source: Marsden and Ratiu, theorem 15.11.3, which leaves out (+-0) and (000).

    Examples
    --------
    >>> [sp.rigid_body.lie.lie_group(np.diag([1.0, 1.0, last])) for last in (1.0, -1.0, 0.0)]
    ['SO(3)', 'SO(2,1)', 'SE(2)']
    """
    values = np.linalg.eigvalsh(_form(form))
    threshold = NEAR_ZERO * np.max(np.abs(values))
    positive, negative = int(np.sum(values > threshold)), int(np.sum(values < -threshold))
    return _GROUPS[max(positive, negative), min(positive, negative)]


def maxwell_bloch_invariants(state: ArrayLike) -> tuple[Array, Array]:
    """(x_2^2 + x_3^2)/2 and x_3 + x_1^2/2 of the real Maxwell-Bloch system: (..., 3) -> (...), (...).

    A circular and a parabolic cylinder. On the first x_1 is the rate of a pendulum's angle, on the second x_1 obeys
    the ideal Duffing equation x_1'' = C x_1 - x_1^3/2, C the second invariant.
    Source: Marsden and Ratiu, remark after theorem 15.11.3 (David and Holm 1992); theory.md N11.

    Examples
    --------
    >>> tuple(float(value) for value in sp.rigid_body.lie.maxwell_bloch_invariants([1.0, 2.0, 3.0]))
    (6.5, 3.5)
    """
    x, y, z = np.moveaxis(finite_array(state, "state", (3,)), -1, 0)
    return 0.5 * (y * y + z * z), z + 0.5 * x * x


def maxwell_bloch_rate(state: ArrayLike) -> Array:
    """(x_2, x_1 x_3, -x_1 x_2), the cross product of the gradients of the two invariants: (..., 3) -> (..., 3).

    Examples
    --------
    >>> sp.rigid_body.lie.maxwell_bloch_rate([1.0, 2.0, 3.0]).tolist()
    [2.0, 3.0, -2.0]
    """
    x, y, z = np.moveaxis(finite_array(state, "state", (3,)), -1, 0)
    return np.stack([y, x * z, -x * y], axis=-1)


def _coefficients(moments: Array, row: Array, rounding: Array) -> Array:
    """a / I_i + b, zero where the terms cancel up to rounding."""
    inverse = row[0] / moments
    total = inverse + row[1]
    return np.where(np.abs(total) <= FEW_ULPS * (np.abs(inverse) * rounding + abs(row[1])), 0.0, total)


def _form(form: ArrayLike) -> Array:
    matrix = one_array(form, "form", (3, 3))
    skew = np.abs(matrix - matrix.T).max()
    if skew > WRITTEN_DIGITS * np.abs(matrix).max():
        raise ShapeError(f"form: the matrix of a quadratic form is symmetric; its entries differ by {skew:.3g}")
    return 0.5 * (matrix + matrix.T)


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)
