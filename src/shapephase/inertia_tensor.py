"""Inertia tensors: validity, inverse, principal axes; batched over leading axes.

The order of principal moments inside the library is ascending everywhere, I1 <= I2 <= I3: axis 1 (index 0) has the
smallest moment, axis 2 the intermediate one, axis 3 (index 2) the largest. Public functions take moments in any order
and return results on the caller's axes; `ascending_moments` and `principal_axes` lead from these to the inner order.

The literature differs. Marsden and Ratiu have I1 >= I2 >= I3 in section 15.8 (their I1, I2, I3 are our I3, I2, I1) and
I1 < I2 < I3 in section 15.11; Bonnard, Cots and Shcherbakova have I1 > I2 > I3, and A < B < C for the inverse moments.
Reversing three axes is an odd permutation, which changes one sign in a formula.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .arrays import Array
from .errors import SingularInertiaError

VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))  # order of six components: xx yy zz yz xz xy
SIX_OF_FULL = np.array([3 * i + j for i, j in VOIGT])  # places of the six among the nine entries, row by row
FULL_FROM_SIX = np.array([[VOIGT.index((min(i, j), max(i, j))) for j in range(3)] for i in range(3)])  # (3, 3) of six
_WELL_CONDITIONED = 1e-3  # of trace^3: with a larger determinant the adjugate magnifies rounding hundredfold at most
_SINGULAR = 1e-12  # least ratio of the smallest to the largest moment: below it the inverse has no correct digits left


def inverse_inertia(inertia: Array, times: Array | None = None) -> Array:
    """I^-1 of symmetric positive definite tensors: (..., 3, 3) -> (..., 3, 3), exactly symmetric.

    Raises
    ------
    SingularInertiaError
        If a tensor is not finite or its least eigenvalue is not above 1e-12 of its largest. `times` (...),
        where given, are the instants that the message quotes.

    Examples
    --------
    >>> sp.inertia_tensor.inverse_inertia(np.diag([1.0, 2.0, 4.0])).diagonal().tolist()
    [1.0, 0.5, 0.25]
    """
    with np.errstate(invalid="ignore", over="ignore"):
        adjugate, determinant = _adjugate(inertia)
        a = inertia[..., 0, 0]
        trace = np.trace(inertia, axis1=-2, axis2=-1)
        # Such a tensor is positive definite if its leading minors are positive.
        safe = (determinant > _WELL_CONDITIONED * np.abs(trace) ** 3) & (adjugate[..., 2, 2] > 0.0) & (a > 0.0)
    if safe.all():
        return adjugate / determinant[..., None, None]
    return _careful_inverse(inertia, times)


def _adjugate(inertia: Array) -> tuple[Array, Array]:
    """Adjugate and determinant of symmetric matrices."""
    a, b, c = inertia[..., 0, 0], inertia[..., 1, 1], inertia[..., 2, 2]
    d, e, f = inertia[..., 1, 2], inertia[..., 0, 2], inertia[..., 0, 1]
    adjugate = np.empty(inertia.shape)
    adjugate[..., 0, 0] = b * c - d * d
    adjugate[..., 1, 1] = a * c - e * e
    adjugate[..., 2, 2] = a * b - f * f
    adjugate[..., 0, 1] = adjugate[..., 1, 0] = e * d - f * c
    adjugate[..., 0, 2] = adjugate[..., 2, 0] = f * d - e * b
    adjugate[..., 1, 2] = adjugate[..., 2, 1] = f * e - d * a
    determinant = a * adjugate[..., 0, 0] + f * adjugate[..., 0, 1] + e * adjugate[..., 0, 2]
    return adjugate, determinant


def _careful_inverse(inertia: Array, times: Array | None) -> Array:
    flat = inertia.reshape(-1, 3, 3)
    finite = np.isfinite(flat).all(axis=(-1, -2))
    moments = np.full((len(flat), 3), np.nan)
    moments[finite] = np.linalg.eigvalsh(flat[finite])
    bad = ~(moments[:, 0] > _SINGULAR * moments[:, 2])
    if bad.any():
        first = int(np.argmax(bad))
        when = "" if times is None else f" at t = {np.ravel(times)[first]:.9g} s"
        raise SingularInertiaError(
            f"locked inertia{when} is not positive definite: principal moments {moments[first]} kg m^2; "
            "give mass to the links, or change the body so that it is not on one line"
        )
    inverse = np.linalg.inv(inertia)
    return 0.5 * (inverse + np.swapaxes(inverse, -1, -2))


def second_moment(inertia: Array) -> Array:
    """The second-moment tensor of mass, J = tr(I)/2 - I: (..., 3, 3) -> (..., 3, 3) [kg m^2].

    Any real distribution of mass has J positive semidefinite, which is the triangle inequality of the
    principal moments. Source: theory.md A4.

    Equation :eq:`triangle` of the documentation.

    Examples
    --------
    >>> sp.inertia_tensor.second_moment(np.diag([3.0, 4.0, 5.0])).diagonal().tolist()
    [3.0, 2.0, 1.0]
    """
    half_trace = 0.5 * np.trace(inertia, axis1=-2, axis2=-1)
    return half_trace[..., None, None] * np.eye(3) - inertia


def triangle_defect(inertia: Array) -> Array:
    """Excess over the triangle inequality, relative to the largest moment; negative where it holds: (...).

    Examples
    --------
    >>> float(sp.inertia_tensor.triangle_defect(np.diag([1.0, 1.0, 4.0])))  # 4 > 1 + 1: no body
    0.5
    """
    moments = np.linalg.eigvalsh(inertia)
    return (moments[..., 2] - moments[..., 1] - moments[..., 0]) / moments[..., 2]


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """Principal moments, ascending, and a proper frame of principal axes.

    Source: theory.md A11 (Marsden and Ratiu, section 15.3).

    Returns
    -------
    moments : (..., 3) [kg m^2]
    axes : (..., 3, 3), columns are the axes, determinant +1: inertia = axes diag(moments) axes^T

    Examples
    --------
    >>> moments, axes = sp.inertia_tensor.principal_axes(np.diag([3.0, 1.0, 2.0]))
    >>> moments.tolist(), round(float(np.linalg.det(axes)), 12)
    ([1.0, 2.0, 3.0], 1.0)
    """
    moments, axes = np.linalg.eigh(inertia)
    axes[..., :, 2] *= np.where(np.linalg.det(axes) < 0.0, -1.0, 1.0)[..., None]
    return moments, axes


def body_principal_axes(tensor: Array) -> tuple[Array, Array]:
    """Ascending moments and axes of one body: exact for a diagonal tensor, else equal moments are made equal.

    Moments of other tensors count as equal up to four roundings of the largest, the error of `eigh`.

    Examples
    --------
    >>> sp.inertia_tensor.body_principal_axes(np.diag([3.0, 1.0, 2.0]))[0].tolist()
    [1.0, 2.0, 3.0]
    """
    diagonal = np.diagonal(tensor)
    if np.array_equal(tensor, np.diag(diagonal)):
        moments, order, parity = ascending_moments(diagonal)
        axes = np.eye(3)[:, order]
        axes[:, 2] *= parity
        return moments, axes
    moments, axes = principal_axes(tensor)
    close = np.diff(moments) < 4.0 * np.finfo(float).eps * moments[2]
    if close[0]:
        moments[0] = moments[1]
    if close[1]:
        moments[2] = moments[1]
    return moments, axes


def ascending_moments(moments: Array) -> tuple[Array, NDArray[np.intp], Array]:
    """Principal moments in ascending order, and where each of them stood.

    Vectors v on the given axes are v[order] on the ordered ones. Those are right-handed only for an even permutation:
    formulas that need a proper rotation multiply one of the axes by the parity.

    Source: theory.md section 1 (table of conventions).

    Returns
    -------
    ascending : (..., 3) [kg m^2]
    order : (..., 3) indices with ascending = moments[order]; equal moments keep their order
    parity : (...) 1 for an even permutation, -1 for an odd one

    Examples
    --------
    >>> moments, order, parity = sp.inertia_tensor.ascending_moments(np.array([3.0, 1.0, 2.0]))
    >>> moments.tolist(), order.tolist()
    ([1.0, 2.0, 3.0], [1, 2, 0])
    """
    order = np.argsort(moments, axis=-1, kind="stable")
    parity = np.where((order[..., 1] - order[..., 0]) % 3 == 1, 1.0, -1.0)
    return np.take_along_axis(moments, order, -1), order, parity
