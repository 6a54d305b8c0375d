"""The free rigid body in n dimensions: so(n) with the inertia of a mass distribution.

The body momentum is the antisymmetric matrix M = Omega J + J Omega, J the second moment of mass, and
M' = [M, Omega]; in three dimensions it is hat(I Omega) with I = tr(J) - J. The pairing is <A, B> = -tr(AB)/2, so the
components of a matrix in the basis of `so` are also those of the covector that it stands for.

Sources: Marsden and Ratiu, end of section 15.3 (after Mishchenko and Fomenko, Ratiu); Manakov 1976 for the integrals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import whole_argument
from ...arrays import Array, finite_array
from ...errors import ShapeError, SingularInertiaError
from .lie_algebra import NEAR_ZERO, WRITTEN_DIGITS, so

_LARGEST_PFAFFIAN = 10  # its expansion has (n - 1)!! terms, 945 for ten


def n_dimensional_inertia(second_moment: ArrayLike) -> Array:
    """The inertia operator Omega -> Omega J + J Omega in the basis of `so(n)`: (n, n) -> (d, d), d = n(n-1)/2.

    For `euler_poincare_motion(so(n), ...)`.

    Raises ShapeError, SingularInertiaError if J is not symmetric, or two of its eigenvalues have no positive sum: their
    plane has no inertia.

    Examples
    --------
    >>> sp.rigid_body.lie.n_dimensional_inertia(np.diag([1.0, 2.0, 3.0])).diagonal().tolist()  # J_i + J_j
    [5.0, 4.0, 3.0]
    """
    j = _second_moment(second_moment)
    basis = so(len(j)).matrix_basis
    return -0.5 * np.einsum("aij,bji->ab", basis, basis @ j + j @ basis)


def n_dimensional_momentum(second_moment: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """M = Omega J + J Omega: (n, n), antisymmetric (..., n, n) -> (..., n, n).

    Examples
    --------
    >>> omega = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> sp.rigid_body.lie.n_dimensional_momentum(np.diag([1.0, 2.0, 3.0]), omega)[1, 0].item()
    3.0
    """
    j = _second_moment(second_moment)
    omega = _antisymmetric(angular_velocity, "angular_velocity", len(j))
    return omega @ j + j @ omega


def n_dimensional_angular_velocity(second_moment: ArrayLike, momentum: ArrayLike) -> Array:
    """The Omega with Omega J + J Omega = M: (n, n), antisymmetric (..., n, n) -> (..., n, n).

    Examples
    --------
    >>> momentum = np.array([[0.0, -3.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> sp.rigid_body.lie.n_dimensional_angular_velocity(np.diag([1.0, 2.0, 3.0]), momentum)[1, 0].item()
    1.0
    """
    j = _second_moment(second_moment)
    m = _antisymmetric(momentum, "momentum", len(j))
    moments, axes = np.linalg.eigh(j)
    return axes @ ((axes.T @ m @ axes) / (moments[:, None] + moments + np.where(np.eye(len(j)), 1.0, 0.0))) @ axes.T


def n_dimensional_rate(second_moment: ArrayLike, momentum: ArrayLike) -> Array:
    """M' = [M, Omega]: (n, n), antisymmetric (..., n, n) -> (..., n, n).

    Examples
    --------
    >>> momentum = np.array([[0.0, -3.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> float(np.abs(sp.rigid_body.lie.n_dimensional_rate(np.diag([1.0, 2.0, 3.0]), momentum)).max())  # a steady turn
    0.0
    """
    omega = n_dimensional_angular_velocity(second_moment, momentum)
    m = finite_array(momentum, "momentum", (None, None))
    return m @ omega - omega @ m


def momentum_traces(momentum: ArrayLike) -> Array:
    """The Casimirs tr M^2, tr M^4, ..., one for each rotation plane: (..., n, n) -> (..., n // 2).

    Raises ShapeError for matrices that are not antisymmetric.

    Examples
    --------
    >>> momentum = np.array([[0.0, -3.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> sp.rigid_body.lie.momentum_traces(momentum).tolist()
    [-18.0]
    """
    m = _antisymmetric(momentum, "momentum")
    powers, traces = m @ m, []
    square = powers
    for _ in range(m.shape[-1] // 2):
        traces.append(np.trace(powers, axis1=-2, axis2=-1))
        powers = powers @ square
    return np.stack(traces, axis=-1)


def pfaffian(momentum: ArrayLike) -> Array:
    """The Pfaffian, for even n the Casimir whose square is det M: (..., n, n) -> (...).

    Raises ShapeError if n is odd or above 10, or the matrix is not antisymmetric.

    Examples
    --------
    >>> momentum = np.array([[0, 2, 0, 0], [-2, 0, 0, 0], [0, 0, 0, 3], [0, 0, -3, 0]])
    >>> print(f"{sp.rigid_body.lie.pfaffian(momentum):.6f}, {np.linalg.det(momentum):.6f}")
    6.000000, 36.000000
    """
    m = _antisymmetric(momentum, "momentum")
    n = m.shape[-1]
    if n % 2 or n > _LARGEST_PFAFFIAN:
        raise ShapeError(f"momentum: a Pfaffian needs an even dimension up to 10, got {n}")
    return _pfaffian(m)[()]


def manakov_integrals(second_moment: ArrayLike, momentum: ArrayLike, power: int) -> Array:
    """The coefficients of 1, lambda, ... in tr (M + lambda J^2)^k, all constant: (..., n, n) -> (..., k + 1).

    Source: Manakov 1976; (M + lambda J^2)' = [M + lambda J^2, Omega + lambda J].
    Raises ShapeError, SingularInertiaError like `n_dimensional_inertia`, or if k is not a whole number of 1 or more.

    Parameters
    ----------
    second_moment : (n, n) symmetric J
    momentum : (..., n, n) antisymmetric M
    power : k, 1 or more

    Examples
    --------
    >>> momentum = np.array([[0.0, -3.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> sp.rigid_body.lie.manakov_integrals(np.diag([1.0, 2.0, 3.0]), momentum, 2).tolist()
    [-18.0, 0.0, 98.0]
    """
    count = whole_argument(power, "power", 1)
    j = _second_moment(second_moment)
    m = _antisymmetric(momentum, "momentum", len(j))
    coefficients = [m, np.broadcast_to(j @ j, m.shape)]
    for _ in range(count - 1):
        lower = [np.zeros(m.shape), *coefficients]
        coefficients = [a @ m + b @ (j @ j) for a, b in zip([*coefficients, np.zeros(m.shape)], lower)]
    return np.stack([np.trace(c, axis1=-2, axis2=-1) for c in coefficients], axis=-1)


def _pfaffian(m: Array) -> Array:
    n = m.shape[-1]
    if n == 2:
        return m[..., 0, 1]
    total = np.zeros(m.shape[:-2])
    for column in range(1, n):
        left = [i for i in range(1, n) if i != column]
        total += (-1.0) ** (column - 1) * m[..., 0, column] * _pfaffian(m[..., left, :][..., :, left])
    return total


def _second_moment(value: ArrayLike) -> Array:
    j = finite_array(value, "second_moment", (None, None), unit="kg m^2")
    if j.ndim != 2 or j.shape[0] != j.shape[1] or len(j) < 2:
        raise ShapeError(f"second_moment: one symmetric matrix (n, n), n >= 2, is needed, got {j.shape}")
    if np.abs(j - j.T).max() > WRITTEN_DIGITS * np.abs(j).max():
        raise ShapeError(f"second_moment: not symmetric, off by {np.abs(j - j.T).max():.3g}")
    moments = np.linalg.eigvalsh(j)
    if not moments[0] + moments[1] > NEAR_ZERO * np.abs(moments).max():
        raise SingularInertiaError(
            f"second_moment: the two least eigenvalues {moments[:2]} give a plane no inertia; their sum must be above 0"
        )
    return 0.5 * (j + j.T)


def _antisymmetric(value: ArrayLike, name: str, n: int | None = None) -> Array:
    m = finite_array(value, name, (n, n))
    if m.shape[-1] != m.shape[-2] or m.shape[-1] < 2:
        raise ShapeError(f"{name}: matrices (..., n, n), n >= 2, are needed, got {m.shape}")
    symmetric = np.abs(m + np.swapaxes(m, -1, -2)).max(initial=0.0)
    if symmetric > WRITTEN_DIGITS * np.abs(m).max(initial=0.0):
        raise ShapeError(f"{name}: not antisymmetric, off by {symmetric:.3g}")
    return 0.5 * (m - np.swapaxes(m, -1, -2))
