"""Velocities and momenta on a matrix Lie group, seen from the body and from space.

A tangent vector V at g is a matrix (V = g' along a curve), a covector alpha at g a matrix too, with the pairing
<alpha, V> = Re tr(alpha^H V). Left translation gives the body's components, right translation those of space.

Source: Marsden and Ratiu, equations (15.4.1) to (15.4.6).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object
from ...arrays import Array
from ...errors import LieAlgebraError, ShapeError
from .lie_algebra import LieAlgebra, Matrices, complex_or_real


def group_exponential(algebra: LieAlgebra, a: ArrayLike) -> Matrices:
    """The group element exp(a): (..., d) -> (..., n, n). Raises ShapeError, LieAlgebraError.

    Examples
    --------
    >>> quarter = sp.rigid_body.lie.group_exponential(sp.rigid_body.lie.so3(), [0.0, 0.0, np.pi / 2.0])
    >>> print(quarter.real.round(9) + 0.0)
    [[ 0. -1.  0.]
     [ 1.  0.  0.]
     [ 0.  0.  1.]]
    """
    check_object(algebra, "LieAlgebra", "algebra")
    from scipy.linalg import expm

    return expm(algebra.matrix(a))


def adjoint_action(algebra: LieAlgebra, g: ArrayLike) -> Array:
    """Ad_g as a matrix, the components of g E_i g^-1: (..., n, n) -> (..., d, d).

    Raises LieAlgebraError if g has no inverse, or does not map the algebra to itself: then it is not an element of the
    group.

    Examples
    --------
    >>> half = np.diag([1.0, -1.0, -1.0])
    >>> print(sp.rigid_body.lie.adjoint_action(sp.rigid_body.lie.so3(), half).round(9) + 0.0)
    [[ 1.  0.  0.]
     [ 0. -1.  0.]
     [ 0.  0. -1.]]
    """
    element, inverse = _element(algebra, g)
    turned = element[..., None, :, :] @ algebra.matrix_basis @ inverse[..., None, :, :]
    return np.swapaxes(algebra.coordinates(turned), -1, -2)


def coadjoint_action(algebra: LieAlgebra, g: ArrayLike) -> Array:
    """Ad*_{g^-1} as a matrix, the left action on covectors, mu_space = Ad*_{g^-1} mu_body: (..., n, n) -> (..., d, d).

    <Ad*_{g^-1} mu, a> = <mu, Ad_{g^-1} a>. Raises LieAlgebraError like `adjoint_action` does.
    Source: Marsden and Ratiu, equation (15.4.5).

    Examples
    --------
    >>> half = np.diag([1.0, -1.0, -1.0])
    >>> print(sp.rigid_body.lie.coadjoint_action(sp.rigid_body.lie.so3(), half).diagonal().round(9))
    [ 1. -1. -1.]
    """
    _, inverse = _element(algebra, g)
    return np.swapaxes(adjoint_action(algebra, inverse), -1, -2)


def body_velocity(algebra: LieAlgebra, g: ArrayLike, velocity: ArrayLike) -> Array:
    """V^B = g^-1 V of a tangent vector at g: (..., n, n), (..., n, n) -> (..., d).

    Source: Marsden and Ratiu, equation (15.4.4).
    Raises LieAlgebraError if g^-1 V is not an element of the algebra: V is not tangent to the group.

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.body_velocity(lie.so3(), np.eye(3), sp.so3.hat(np.array([1.0, 2.0, 3.0]))).round(9).tolist()
    [1.0, 2.0, 3.0]
    """
    _, inverse = _element(algebra, g)
    return algebra.coordinates(inverse @ _like(algebra, velocity, "velocity"))


def space_velocity(algebra: LieAlgebra, g: ArrayLike, velocity: ArrayLike) -> Array:
    """V^S = V g^-1 of a tangent vector at g: (..., n, n), (..., n, n) -> (..., d).

    Raises LieAlgebraError like `body_velocity` does. Source: Marsden and Ratiu, equation (15.4.3).

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> turn = sp.so3.exp(np.array([0.0, 0.0, np.pi / 2.0]))
    >>> lie.space_velocity(lie.so3(), turn, turn @ sp.so3.hat(np.array([1.0, 0.0, 0.0]))).round(9).tolist()
    [0.0, 1.0, 0.0]
    """
    _, inverse = _element(algebra, g)
    return algebra.coordinates(_like(algebra, velocity, "velocity") @ inverse)


def body_momentum(algebra: LieAlgebra, g: ArrayLike, covector: ArrayLike) -> Array:
    """alpha^B, the pull-back of a covector at g by left translation, <alpha^B, a> = <alpha, g a>: -> (..., d).

    Source: Marsden and Ratiu, equation (15.4.2).

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.body_momentum(lie.so3(), np.eye(3), sp.so3.hat(np.array([0.0, 0.0, 1.0]))).tolist()
    [0.0, 0.0, 2.0]
    """
    element, _ = _element(algebra, g)
    return _paired(_like(algebra, covector, "covector"), element[..., None, :, :] @ algebra.matrix_basis)


def space_momentum(algebra: LieAlgebra, g: ArrayLike, covector: ArrayLike) -> Array:
    """alpha^S, the pull-back of a covector at g by right translation, <alpha^S, a> = <alpha, a g>: -> (..., d).

    Source: Marsden and Ratiu, equation (15.4.1).

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.space_momentum(lie.so3(), np.eye(3), sp.so3.hat(np.array([0.0, 0.0, 1.0]))).tolist()
    [0.0, 0.0, 2.0]
    """
    element, _ = _element(algebra, g)
    return _paired(_like(algebra, covector, "covector"), algebra.matrix_basis @ element[..., None, :, :])


def _paired(covector: Matrices, vectors: Matrices) -> Array:
    return np.einsum("...ab,...iab->...i", covector.conj(), vectors).real


def _element(algebra: LieAlgebra, g: ArrayLike) -> tuple[Matrices, Matrices]:
    element = _like(algebra, g, "g")
    try:
        inverse = np.linalg.inv(element)
    except np.linalg.LinAlgError:
        raise LieAlgebraError(f"g: a singular matrix is not an element of the group of {algebra.name}") from None
    return element, inverse


def _like(algebra: LieAlgebra, value: ArrayLike, name: str) -> Matrices:
    check_object(algebra, "LieAlgebra", "algebra")
    n = algebra.matrix_basis.shape[-1]
    matrices = complex_or_real(value, name, (n, n))
    if np.iscomplexobj(matrices) and not np.iscomplexobj(algebra.matrix_basis):
        raise ShapeError(f"{name}: {algebra.name} has real matrices, got complex ones")
    return matrices
