"""The Lagrangian of the free rigid body from its particles: three velocities, three equal energies, the inertia.

Masses (P,) sit at material points X (P, 3), x = R X in space. Sums over particles stand for the integrals over the
body.

Source: Marsden and Ratiu, sections 15.1 to 15.3; theory.md A12 to A15.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from .._arguments import SIX_DIGITS


@dataclass(frozen=True, eq=False)
class ReducedBody:
    """A rigid body with its translations reduced out, which turns on SO(3). Made by `reduce_translations`."""

    mass: float
    """Total mass [kg]."""
    centre: Array
    """(3,) centre of mass from the material origin [m]."""
    positions: Array
    """(P, 3) from the centre of mass [m]."""
    inertia: Array
    """(3, 3) about the centre of mass [kg m^2]."""

    __repr__ = short_repr

    def momentum(self, se3_momentum: ArrayLike) -> Array:
        """(Pi, P) about the material origin -> Pi - c x P about the centre of mass: (..., 6) -> (..., 3).

        A Poisson map of se(3)* to so(3)*, both with the minus Lie-Poisson bracket.
        """
        both = finite_array(se3_momentum, "se3_momentum", (6,))
        return both[..., :3] - np.cross(self.centre, both[..., 3:])


def material_velocity(attitude_rate: ArrayLike, positions: ArrayLike) -> Array:
    """V(X) = R' X: (..., 3, 3), (P, 3) -> (..., P, 3) [m/s]. Source: equation (15.2.1).

    Examples
    --------
    >>> sp.rigid_body.lie.material_velocity(sp.so3.hat(np.array([0.0, 0.0, 2.0])), [[1.0, 0.0, 0.0]]).tolist()
    [[0.0, 2.0, 0.0]]
    """
    rate, points = finite_array(attitude_rate, "attitude_rate", (3, 3)), finite_array(positions, "positions", (None, 3))
    return points @ so3.transpose(rate)


def spatial_velocity(attitude: ArrayLike, attitude_rate: ArrayLike, points: ArrayLike) -> Array:
    """v(x) = R' R^-1 x at points of space: (..., 3, 3), (..., 3, 3), (..., P, 3) -> (..., P, 3) [m/s].

    Source: equation (15.2.2).

    Examples
    --------
    >>> sp.rigid_body.lie.spatial_velocity(np.eye(3), sp.so3.hat(np.array([0.0, 0.0, 2.0])), [[1.0, 0.0, 0.0]]).tolist()
    [[0.0, 2.0, 0.0]]
    """
    omega = spatial_angular_velocity(attitude, attitude_rate)
    return np.cross(omega[..., None, :], finite_array(points, "points", (None, 3)))


def convective_velocity(attitude: ArrayLike, attitude_rate: ArrayLike, positions: ArrayLike) -> Array:
    """R^-1 R' X, the velocity in body axes: (..., 3, 3), (..., 3, 3), (P, 3) -> (..., P, 3) [m/s].

    Source: equation (15.2.3).

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.convective_velocity(np.eye(3), sp.so3.hat(np.array([0.0, 0.0, 2.0])), [[1.0, 0.0, 0.0]]).tolist()
    [[0.0, 2.0, 0.0]]
    """
    omega = body_angular_velocity(attitude, attitude_rate)
    return np.cross(omega[..., None, :], finite_array(positions, "positions", (None, 3)))


def body_angular_velocity(attitude: ArrayLike, attitude_rate: ArrayLike) -> Array:
    """Omega, hat(Omega) = R^-1 R': (..., 3, 3), (..., 3, 3) -> (..., 3) [rad/s, body axes].

    Source: equation (15.2.8).
    Raises ShapeError if R is not a rotation, or R' is not tangent to the rotations at R.

    Examples
    --------
    >>> sp.rigid_body.lie.body_angular_velocity(np.eye(3), sp.so3.hat(np.array([1.0, 2.0, 3.0]))).tolist()
    [1.0, 2.0, 3.0]
    """
    rotation, rate = so3.rotation_argument(attitude, "attitude"), finite_array(attitude_rate, "attitude_rate", (3, 3))
    spin = so3.transpose(rotation) @ rate
    symmetric = np.abs(spin + so3.transpose(spin)).max(initial=0.0)
    if symmetric > SIX_DIGITS * np.abs(spin).max(initial=0.0):
        raise ShapeError(
            f"attitude_rate: not the rate of a rotation, R^T R' has a symmetric part of {symmetric:.3g}; "
            "R' = R hat(Omega) is needed"
        )
    return so3.vee(spin)


def spatial_angular_velocity(attitude: ArrayLike, attitude_rate: ArrayLike) -> Array:
    """omega = R Omega, hat(omega) = R' R^-1: (..., 3, 3), (..., 3, 3) -> (..., 3) [rad/s, inertial axes].

    Raises ShapeError like `body_angular_velocity`. Source: equation (15.2.7).

    Examples
    --------
    >>> sp.rigid_body.lie.spatial_angular_velocity(np.eye(3), sp.so3.hat(np.array([1.0, 2.0, 3.0]))).tolist()
    [1.0, 2.0, 3.0]
    """
    return so3.apply(so3.rotation_argument(attitude, "attitude"), body_angular_velocity(attitude, attitude_rate))


def material_lagrangian(masses: ArrayLike, positions: ArrayLike, attitude_rate: ArrayLike) -> Array:
    """L = sum m |V|^2 / 2 over material velocities: (P,), (P, 3), (..., 3, 3) -> (...) [J].

    Left invariant: the same for (B R, B R') with any rotation B.
    Source: equations (15.2.4), (15.2.9).

    Examples
    --------
    >>> sp.rigid_body.lie.material_lagrangian([3.0], [[1.0, 0.0, 0.0]], sp.so3.hat(np.array([0.0, 0.0, 2.0]))).item()
    6.0
    """
    m, _ = _particles(masses, positions)
    return _energy(m, material_velocity(attitude_rate, positions))


def spatial_lagrangian(masses: ArrayLike, positions: ArrayLike, attitude: ArrayLike, attitude_rate: ArrayLike) -> Array:
    """L = sum m |v(x)|^2 / 2 of the spatial velocity field at x = R X: -> (...) [J]. Source: (15.2.5).

    Examples
    --------
    >>> rate = sp.so3.hat(np.array([0.0, 0.0, 2.0]))
    >>> sp.rigid_body.lie.spatial_lagrangian([3.0], [[1.0, 0.0, 0.0]], np.eye(3), rate).item()  # 3 * 2^2/2
    6.0
    """
    m, points = _particles(masses, positions)
    placed = points @ so3.transpose(so3.rotation_argument(attitude, "attitude"))
    return _energy(m, spatial_velocity(attitude, attitude_rate, placed))


def convective_lagrangian(
    masses: ArrayLike, positions: ArrayLike, attitude: ArrayLike, attitude_rate: ArrayLike
) -> Array:
    """L = sum m |Omega x X|^2 / 2: -> (...) [J]. Source: equations (15.2.6), (15.3.1).

    Examples
    --------
    >>> rate = sp.so3.hat(np.array([0.0, 0.0, 2.0]))
    >>> sp.rigid_body.lie.convective_lagrangian([3.0], [[1.0, 0.0, 0.0]], np.eye(3), rate).item()  # 3 * 2^2/2
    6.0
    """
    m, points = _particles(masses, positions)
    return _energy(m, convective_velocity(attitude, attitude_rate, points))


def mass_inner_product(masses: ArrayLike, positions: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """<<a, b>> = sum m (a x X) . (b x X): (P,), (P, 3), (..., 3), (..., 3) -> (...) [kg m^2 times those of a and b].

    L = <<Omega, Omega>> / 2. Source: Marsden and Ratiu, equation (15.3.2).

    Examples
    --------
    >>> x = [1.0, 0.0, 0.0]
    >>> sp.rigid_body.lie.mass_inner_product([2.0], [[0.0, 3.0, 0.0]], x, x).item()  # m r^2
    18.0
    """
    m, points = _particles(masses, positions)
    first, second = (np.cross(finite_array(v, n, (3,))[..., None, :], points) for v, n in ((a, "a"), (b, "b")))
    return np.sum(m * np.sum(first * second, axis=-1), axis=-1)


def mass_inertia(masses: ArrayLike, positions: ArrayLike) -> Array:
    """The inertia tensor about the material origin, I a . b = <<a, b>>: (P,), (P, 3) -> (3, 3) [kg m^2].

    Examples
    --------
    >>> sp.rigid_body.lie.mass_inertia([1.0, 1.0], [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]).tolist()
    [[4.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 5.0]]
    """
    m, points = _particles(masses, positions)
    return _inertia(m, points)


def legendre_transform(masses: ArrayLike, positions: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """Pi = sum m X x (Omega x X) = I Omega, the body momentum: (P,), (P, 3), (..., 3) -> (..., 3) [kg m^2/s].

    Source: Marsden and Ratiu, equation (15.3.4).

    Examples
    --------
    >>> sp.rigid_body.lie.legendre_transform([2.0], [[0.0, 3.0, 0.0]], [1.0, 0.0, 0.0]).tolist()
    [18.0, 0.0, 0.0]
    """
    m, points = _particles(masses, positions)
    speeds = np.cross(finite_array(angular_velocity, "angular_velocity", (3,), unit="rad/s")[..., None, :], points)
    return np.sum(m[:, None] * np.cross(points, speeds), axis=-2)


def spatial_momentum(masses: ArrayLike, positions: ArrayLike, attitude: ArrayLike, attitude_rate: ArrayLike) -> Array:
    """pi = sum m x x v = R Pi, constant in a free motion: -> (..., 3) [kg m^2/s, inertial axes].

    Source: Marsden and Ratiu, equations (15.3.5), (15.3.7), (15.3.13).

    Examples
    --------
    >>> rate = sp.so3.hat(np.array([0.0, 0.0, 2.0]))
    >>> sp.rigid_body.lie.spatial_momentum([3.0], [[1.0, 0.0, 0.0]], np.eye(3), rate).tolist()
    [0.0, 0.0, 6.0]
    """
    m, points = _particles(masses, positions)
    placed = points @ so3.transpose(so3.rotation_argument(attitude, "attitude"))
    return np.sum(m[:, None] * np.cross(placed, spatial_velocity(attitude, attitude_rate, placed)), axis=-2)


def se3_inertia(masses: ArrayLike, positions: ArrayLike) -> Array:
    """The inertia operator on se(3), twist (Omega, V) of the material origin -> (Pi, P): (P,), (P, 3) -> (6, 6).

    That of the kinetic energy with translations; for `euler_poincare_motion(se3(), ...)`.

    Examples
    --------
    >>> sp.rigid_body.lie.se3_inertia([2.0], [[0.0, 3.0, 0.0]]).diagonal().tolist()
    [18.0, 0.0, 18.0, 2.0, 2.0, 2.0]
    """
    m, points = _particles(masses, positions)
    coupling = so3.hat(m @ points)
    return np.block([[_inertia(m, points), coupling], [-coupling, m.sum() * np.eye(3)]])


def reduce_translations(masses: ArrayLike, positions: ArrayLike) -> ReducedBody:
    """The body about its centre of mass: SE(3) reduced by its translations to SO(3).

    Source: Marsden and Ratiu, exercise 15.1-1.

    Examples
    --------
    >>> body = sp.rigid_body.lie.reduce_translations([1.0, 3.0], [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    >>> body.centre.tolist(), body.inertia.diagonal().tolist()
    ([3.0, 0.0, 0.0], [0.0, 12.0, 12.0])
    """
    m, points = _particles(masses, positions)
    centre = m @ points / m.sum()
    inertia = _inertia(m, points - centre)
    return ReducedBody(mass=float(m.sum()), centre=centre, positions=points - centre, inertia=inertia)


def _inertia(masses: Array, points: Array) -> Array:
    second = np.einsum("p,pi,pj->ij", masses, points, points)
    return np.trace(second) * np.eye(3) - second


def _energy(masses: Array, speeds: Array) -> Array:
    return 0.5 * np.sum(masses * np.sum(speeds * speeds, axis=-1), axis=-1)


def _particles(masses: ArrayLike, positions: ArrayLike) -> tuple[Array, Array]:
    m = finite_array(masses, "masses", (None,), unit="kg")
    points = finite_array(positions, "positions", (None, 3), unit="m")
    if m.ndim != 1 or points.shape != (len(m), 3) or not len(m):
        raise ShapeError(f"positions: one (3,) for each mass is needed, got {points.shape} for masses {m.shape}")
    if not np.all(m > 0.0):
        raise ShapeError(f"masses: every mass must be above 0 kg, got {m[np.argmin(m)]:.6g} at {int(np.argmin(m))}")
    return m, points
