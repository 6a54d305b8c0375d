"""Lie algebras by their structure constants: bracket, adjoint and coadjoint operators, Killing form.

Elements a (..., d) and covectors mu (..., d) are given by their components in one basis and its dual, so the pairing
is <mu, a> = mu . a. For `so3` these are vectors of space, the bracket is the cross product.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arguments import check_object
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import LieAlgebraError, ShapeError
from ...letters import value_text
from .._arguments import TWELVE_DIGITS

Matrices = NDArray[Any]  # real or complex square matrices (..., n, n)

WRITTEN_DIGITS = 1e-9  # relative error of the entries of a matrix that a user writes with nine digits
NEAR_ZERO = 1e-14  # ratio of eigenvalues, or distance of structure constants from integers, that is rounding


@dataclass(frozen=True, eq=False)
class LieAlgebra:
    """A real Lie algebra of dimension d, [e_i, e_j] = c_ij^k e_k.

    Raises LieAlgebraError if the constants are not antisymmetric in i and j, do not satisfy Jacobi's identity to
    rounding, or are not those of the basis.

    Examples
    --------
    >>> algebra = sp.rigid_body.lie.so3()
    >>> algebra.name, algebra.structure.shape
    ('so(3)', (3, 3, 3))
    """

    structure: Array
    """(d, d, d) structure constants c[i, j, k]."""
    basis: Matrices | None = None
    """(d, n, n) real or complex matrices with the same brackets, or None for an abstract algebra."""
    name: str = "Lie algebra"
    """For messages."""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check the laws once, and keep structure constants that are exactly antisymmetric and read-only."""
        structure = finite_array(self.structure, "structure", (None, None, None))
        if structure.ndim != 3 or len(set(structure.shape)) != 1 or not structure.size:
            raise ShapeError(f"structure: structure constants (d, d, d) are needed, got {structure.shape}")
        largest = float(np.abs(structure).max())
        defect = np.abs(structure + structure.swapaxes(0, 1))
        if defect.max() > TWELVE_DIGITS * largest:
            i, j, k = np.unravel_index(int(np.argmax(defect)), defect.shape)
            raise LieAlgebraError(
                f"structure: not antisymmetric, c[{i}, {j}, {k}] = {structure[i, j, k]:.9g} and "
                f"c[{j}, {i}, {k}] = {structure[j, i, k]:.9g}; [e_i, e_j] = -[e_j, e_i] is needed"
            )
        structure = 0.5 * (structure - structure.swapaxes(0, 1))
        double = np.einsum("ijm,mkl->ijkl", structure, structure)
        cyclic = np.abs(double + double.transpose(1, 2, 0, 3) + double.transpose(2, 0, 1, 3))
        if cyclic.max() > TWELVE_DIGITS * len(structure) * largest**2:
            i, j, k, _ = np.unravel_index(int(np.argmax(cyclic)), cyclic.shape)
            raise LieAlgebraError(
                f"structure: Jacobi's identity fails for e_{i}, e_{j}, e_{k} by {cyclic.max():.3g}; "
                "[[a, b], c] + [[b, c], a] + [[c, a], b] = 0 is needed"
            )
        basis = None if self.basis is None else _matrices(self.basis, "basis")
        if basis is not None:
            _check_basis(basis, structure)
            basis.setflags(write=False)
        structure.setflags(write=False)
        object.__setattr__(self, "structure", structure)
        object.__setattr__(self, "basis", basis)

    @property
    def dimension(self) -> int:
        """The dimension d."""
        return len(self.structure)

    def bracket(self, a: ArrayLike, b: ArrayLike) -> Array:
        """The Lie bracket [a, b]: (..., d), (..., d) -> (..., d)."""
        return np.einsum("...i,...j,ijk->...k", self._vector(a, "a"), self._vector(b, "b"), self.structure)

    def ad(self, a: ArrayLike) -> Array:
        """The adjoint operator ad_a, ad_a b = [a, b]: (..., d) -> (..., d, d)."""
        return np.einsum("...i,ijk->...kj", self._vector(a, "a"), self.structure)

    def coad(self, a: ArrayLike, mu: ArrayLike) -> Array:
        """The coadjoint operator, <ad*_a mu, b> = <mu, [a, b]>: (..., d), (..., d) -> (..., d).

        For so(3) it is mu x a.
        """
        return np.einsum("...i,ijk,...k->...j", self._vector(a, "a"), self.structure, self._vector(mu, "mu"))

    @cached_property
    def killing_form(self) -> Array:
        """The Killing form tr(ad_i ad_j): (d, d), invariant, nondegenerate if and only if the algebra is semisimple."""
        return np.einsum("ikl,jlk->ij", self.structure, self.structure)

    @cached_property
    def is_unimodular(self) -> bool:
        """True if tr ad_a = 0 for every a, so that Lie-Poisson flows keep the volume of the dual."""
        return bool(np.abs(np.einsum("ijj->i", self.structure)).max() <= TWELVE_DIGITS * np.abs(self.structure).max())

    def matrix(self, a: ArrayLike) -> Matrices:
        """The matrix a^i E_i of an element: (..., d) -> (..., n, n). Raises ShapeError, LieAlgebraError."""
        return np.einsum("...i,imn->...mn", self._vector(a, "a"), self.matrix_basis)

    def coordinates(self, matrix: ArrayLike) -> Array:
        """The components of a matrix of the algebra, the inverse of `matrix`: (..., n, n) -> (..., d).

        Raises
        ------
        ShapeError
            If the matrices have another size than the basis.
        LieAlgebraError
            If a matrix is further from the span of the basis than 1e-9 of its largest entry, or there is no basis.
        """
        basis = self.matrix_basis
        matrices = _matrices(matrix, "matrix")
        if matrices.shape[-1] != basis.shape[-1]:
            raise ShapeError(
                f"matrix: matrices (..., n, n) with n = {basis.shape[-1]} are needed, got {matrices.shape}"
            )
        components = _flat(matrices) @ self._dual_basis
        left = np.abs(_flat(np.einsum("...i,imn->...mn", components, basis) - matrices)).max(axis=-1, initial=0.0)
        if np.any(left > WRITTEN_DIGITS * np.abs(_flat(matrices)).max(axis=-1, initial=0.0)):
            raise LieAlgebraError(f"matrix: not an element of {self.name}, off its span by {left.max():.3g}")
        return components

    @property
    def matrix_basis(self) -> Matrices:
        """The basis of matrices (d, n, n). Raises LieAlgebraError where the algebra has none."""
        if self.basis is None:
            raise LieAlgebraError(f"{self.name}: only structure constants are known; give a basis of matrices")
        return self.basis

    @cached_property
    def _dual_basis(self) -> Array:
        return np.linalg.pinv(_flat(self.matrix_basis)).astype(np.float64, copy=False)

    def _vector(self, value: ArrayLike, name: str) -> Array:
        return finite_array(value, name, (self.dimension,))


def lie_algebra_from_matrices(basis: ArrayLike, name: str = "matrix Lie algebra") -> LieAlgebra:
    """The Lie algebra spanned over the reals by matrices, the bracket being AB - BA.

    Parameters
    ----------
    basis : (d, n, n) real or complex matrices, linearly independent and closed under the bracket

    Raises
    ------
    ShapeError
        If the matrices have another shape, or there are none.
    LieAlgebraError
        If the matrices are linearly dependent, or a bracket leaves their span.

    Examples
    --------
    >>> plane = sp.rigid_body.lie.lie_algebra_from_matrices([[[0.0, -1.0], [1.0, 0.0]]], "so(2)")
    >>> plane.structure.tolist()
    [[[0.0]]]
    """
    matrices = _matrices(basis, "basis")
    if matrices.ndim != 3 or not len(matrices):
        raise ShapeError(f"basis: matrices (d, n, n) are needed, got {matrices.shape}")
    if np.linalg.matrix_rank(_flat(matrices)) < len(matrices):
        raise LieAlgebraError(f"basis: the {len(matrices)} matrices are not linearly independent over the reals")
    structure = _flat(_commutators(matrices)) @ np.linalg.pinv(_flat(matrices))
    # Constants that differ from integers by the rounding of the fit alone are integers.
    whole = np.round(structure)
    near = np.abs(structure - whole) < NEAR_ZERO * max(1.0, float(np.abs(structure).max()))
    structure = np.where(near, whole, structure)
    return LieAlgebra(structure, matrices, name)


def so3() -> LieAlgebra:
    """so(3): basis hat(e_1), hat(e_2), hat(e_3); the bracket is the cross product, [e_1, e_2] = +e_3.

    Source: theory.md B-E2 (Bonnard et al. print the opposite sign).

    Examples
    --------
    >>> sp.rigid_body.lie.so3().structure[0, 1].tolist()  # [e_1, e_2] = e_3
    [0.0, 0.0, 1.0]
    """
    return so(3)


def so(n: int) -> LieAlgebra:
    """so(n), the antisymmetric matrices: E_ji - E_ij turns axis i towards axis j, pairs i < j in lexicographic order.

    For n = 3 the order is that of `so3.hat`. The basis is orthonormal for <A, B> = -tr(AB)/2.

    Raises LieAlgebraError for n below 2.

    Examples
    --------
    >>> sp.rigid_body.lie.so(4).structure.shape
    (6, 6, 6)
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 2:
        raise LieAlgebraError(f"n: a whole number from 2 up is needed, got {value_text(n)}")
    pairs = [(1, 2), (2, 0), (0, 1)] if n == 3 else list(combinations(range(n), 2))
    return lie_algebra_from_matrices(np.stack([_unit(n, j, i) - _unit(n, i, j) for i, j in pairs]), f"so({n})")


def sl2r() -> LieAlgebra:
    """sl(2, R): H = diag(1, -1), X, Y with [H, X] = 2X, [H, Y] = -2Y, [X, Y] = H.

    Examples
    --------
    >>> sp.rigid_body.lie.sl2r().structure[0, 1].tolist()  # [H, X] = 2 X
    [0.0, 2.0, 0.0]
    """
    return lie_algebra_from_matrices(np.stack([np.diag([1.0, -1.0]), _unit(2, 0, 1), _unit(2, 1, 0)]), "sl(2, R)")


def se2() -> LieAlgebra:
    """se(2): the turn, then the two translations, as 3 x 3 homogeneous matrices.

    Examples
    --------
    >>> sp.rigid_body.lie.se2().structure.shape, sp.rigid_body.lie.linear_casimirs(sp.rigid_body.lie.se2()).shape
    ((3, 3, 3), (0, 3))
    """
    turn = _unit(3, 1, 0) - _unit(3, 0, 1)
    return lie_algebra_from_matrices(np.stack([turn, _unit(3, 0, 2), _unit(3, 1, 2)]), "se(2)")


def se3() -> LieAlgebra:
    """se(3): three turns, then three translations, as 4 x 4 homogeneous matrices.

    [(a, u), (b, v)] = (a x b, a x v - b x u). A covector is (Pi, P), angular and linear momentum; with (Pi, Gamma)
    in its place the minus Lie-Poisson bracket is the heavy top's (theory.md M2).

    Examples
    --------
    >>> sp.rigid_body.lie.se3().structure.shape
    (6, 6, 6)
    """
    turns = np.zeros((3, 4, 4))
    turns[:, :3, :3] = so3().matrix_basis
    return lie_algebra_from_matrices(np.concatenate([turns, [_unit(4, i, 3) for i in range(3)]]), "se(3)")


def su2() -> LieAlgebra:
    """su(2): basis -i sigma_k / 2 of Pauli's matrices, with the structure constants of so(3).

    Examples
    --------
    >>> sp.rigid_body.lie.su2().structure[0, 1].round(12).tolist()
    [0.0, 0.0, 1.0]
    """
    sigma = np.array([[[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])
    return lie_algebra_from_matrices(-0.5j * sigma, "su(2)")


def heisenberg() -> LieAlgebra:
    """The Heisenberg algebra: [p, q] = z, z central, as strictly upper triangular 3 x 3 matrices.

    Examples
    --------
    >>> sp.rigid_body.lie.linear_casimirs(sp.rigid_body.lie.heisenberg()).round(9).tolist()  # the centre, z
    [[0.0, 0.0, 1.0]]
    """
    return lie_algebra_from_matrices(np.stack([_unit(3, 0, 1), _unit(3, 1, 2), _unit(3, 0, 2)]), "Heisenberg")


def inertia_operator(algebra: LieAlgebra, inertia: ArrayLike) -> Array:
    """Inertia operator, a symmetric isomorphism of the algebra with its dual: (d, d).

    It need not be positive definite, as in Marsden and Ratiu's exercise 15.5-1. Raises LieAlgebraError if it is not
    symmetric to 1e-9 of its largest entry, or singular.
    """
    check_object(algebra, "LieAlgebra", "algebra")
    d = algebra.dimension
    operator = finite_array(inertia, "inertia", (d, d))
    if operator.ndim != 2:
        raise ShapeError(f"inertia: one ({d}, {d}) operator is needed, got {operator.shape}")
    if np.abs(operator - operator.T).max() > WRITTEN_DIGITS * float(np.abs(operator).max()):
        raise LieAlgebraError("inertia: the operator is not symmetric; <I a, b> = <I b, a> is needed")
    values = np.abs(np.linalg.eigvalsh(operator))
    if values.min() <= NEAR_ZERO * values.max():
        raise LieAlgebraError(f"inertia: the operator is singular, its eigenvalues have magnitudes {np.sort(values)}")
    return 0.5 * (operator + operator.T)


def complex_or_real(value: ArrayLike, name: str, trailing: tuple[int | None, ...]) -> NDArray[Any]:
    """A user's finite array that may hold complex numbers, its last axes as in `finite_array`."""
    try:
        # asanyarray keeps the mask of a masked array, which `finite_array` refuses.
        entries = np.asanyarray(value)
    except ValueError:
        return finite_array(value, name, trailing)
    if not np.iscomplexobj(entries):
        return finite_array(entries, name, trailing)
    return finite_array(np.real(entries), name, trailing) + 1j * finite_array(np.imag(entries), name, trailing)


def linear_solution(operator: Array, right: Array) -> Array:
    """x with operator x = right: (..., d, d), (..., d) -> (..., d)."""
    return np.linalg.solve(operator, right[..., None])[..., 0].astype(np.float64, copy=False)


def _unit(n: int, row: int, column: int) -> Array:
    matrix = np.zeros((n, n))
    matrix[row, column] = 1.0
    return matrix


def _commutators(basis: Matrices) -> Matrices:
    products = np.einsum("iab,jbc->ijac", basis, basis)
    return products - products.swapaxes(0, 1)


def _check_basis(basis: Matrices, structure: Array) -> None:
    if basis.ndim != 3 or len(basis) != len(structure):
        raise ShapeError(f"basis: {len(structure)} square matrices are needed, got {basis.shape}")
    brackets = _commutators(basis)
    off = np.abs(brackets - np.einsum("ijk,kab->ijab", structure, basis)).max()
    if off > TWELVE_DIGITS * len(basis) * np.abs(basis).max() ** 2:
        raise LieAlgebraError(
            f"basis: the brackets AB - BA are not [e_i, e_j] = c[i, j, k] e_k, off by {off:.3g}; the matrices are not "
            "closed under the bracket, or the structure constants belong to another basis"
        )


def _matrices(value: ArrayLike, name: str) -> Matrices:
    """A user's square matrices, real or complex: (..., n, n), a copy."""
    array = complex_or_real(value, name, (None, None))
    if array.shape[-1] != array.shape[-2]:
        raise ShapeError(f"{name}: square matrices (..., n, n) are needed, got {array.shape}")
    return np.array(array)


def _flat(matrices: Matrices) -> Array:
    """Matrices as real vectors: (..., n, n) -> (..., 2 n^2)."""
    flat = matrices.reshape(*matrices.shape[:-2], -1)
    return np.concatenate([np.real(flat), np.imag(flat)], axis=-1)
