"""A magnetic moment in a constant field, M' = M x B: Hamiltonian with H = M . B for the minus Lie-Poisson bracket.

Source: Marsden and Ratiu, exercise 15.9-1; theory.md K3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ... import so3
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...letters import value_text


@dataclass(frozen=True, eq=False)
class MagneticEquilibrium:
    """Equilibrium of M' = M x B on the sphere |M| = magnitude; a centre. Made by `magnetic_equilibria`.

    It is Lyapunov stable since |M - moment| is constant along every motion, and not asymptotically: all motions nearby
    circle it with the same frequency.
    """

    moment: Array
    """M, along the field or opposite to it: (..., 3)."""
    energy: Array
    """(...) M . B."""
    spectrum: NDArray[np.complex128]
    """(..., 3) eigenvalues of the linearisation delta M' = delta M x B: 0 along the line of equilibria, and +-i |B| on
    the sphere's tangent plane."""

    __repr__ = short_repr


def magnetic_hamiltonian(moment: ArrayLike, field: ArrayLike) -> Array:
    """H = M . B, whose gradient is B: (..., 3), (..., 3) -> (...).

    Examples
    --------
    >>> sp.rigid_body.lie.magnetic_hamiltonian([1.0, 2.0, 3.0], [0.0, 0.0, 2.0]).item()
    6.0
    """
    return np.sum(finite_array(moment, "moment", (3,)) * finite_array(field, "field", (3,)), axis=-1)


def magnetic_precession_rate(moment: ArrayLike, field: ArrayLike) -> Array:
    """M' = M x B: (..., 3), (..., 3) -> (..., 3).

    Examples
    --------
    >>> sp.rigid_body.lie.magnetic_precession_rate([1.0, 0.0, 0.0], [0.0, 0.0, 2.0]).tolist()
    [0.0, -2.0, 0.0]
    """
    return np.cross(finite_array(moment, "moment", (3,)), finite_array(field, "field", (3,)))


def magnetic_precession(moment: ArrayLike, field: ArrayLike, t: ArrayLike) -> Array:
    """M(t) = exp(-t hat(B)) M(0), the turn about B at the rate -|B|: (..., 3), (..., 3), (N,) -> (..., N, 3).

    Examples
    --------
    >>> turned = sp.rigid_body.lie.magnetic_precession([1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [np.pi / 4.0])
    >>> print(turned.round(9) + 0.0)  # a quarter turn, against the right-hand rule
    [[ 0. -1.  0.]]
    """
    times = finite_array(t, "t")
    axis, start = finite_array(field, "field", (3,)), finite_array(moment, "moment", (3,))
    grown = axis.reshape(*axis.shape[:-1], *(1,) * times.ndim, 3)
    return so3.apply(so3.exp(-times[..., None] * grown), start.reshape(*start.shape[:-1], *(1,) * times.ndim, 3))


def magnetic_equilibria(magnitude: float, field: ArrayLike) -> tuple[MagneticEquilibrium, MagneticEquilibrium]:
    """The two equilibria on a sphere, along the field and opposite to it: both stable centres.

    Raises ShapeError if the field is zero, where every moment is an equilibrium, or the magnitude is not positive.

    Parameters
    ----------
    magnitude : |M|, positive
    field : (..., 3) B, not zero

    Examples
    --------
    >>> [float(point.moment[2]) for point in sp.rigid_body.lie.magnetic_equilibria(3.0, [0.0, 0.0, 2.0])]
    [3.0, -3.0]
    """
    axis, radius = finite_array(field, "field", (3,)), finite_array(magnitude, "magnitude")
    strength = np.linalg.norm(axis, axis=-1)
    if not np.all(strength > 0.0):
        raise ShapeError("field: without a field every moment is an equilibrium; a field other than 0 is needed")
    if not np.all(radius > 0.0):
        raise ShapeError(f"magnitude: the length of the moment must be above 0, got {value_text(magnitude)}")
    spectrum = strength[..., None] * np.array([0.0, 1j, -1j])
    along, against = (
        MagneticEquilibrium(moment=m, energy=magnetic_hamiltonian(m, axis), spectrum=spectrum)
        for m in radius[..., None] * np.stack([axis, -axis]) / strength[..., None]
    )
    return along, against
