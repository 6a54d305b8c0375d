"""Pseudo-rigid bodies: elastic bodies that deform homogeneously, their steady spins and whether these are stable.

The places of the matter are x = Q X, Q(t) any matrix of positive determinant. With the reference's second moments
E = diag(E_1, E_2, E_3), the integral of X X^T by mass, the energy is

    H = tr(Q' E Q'^T)/2 + V(Q),    V = mu (tr Q^T Q - 3)/2 - mu log J + lambda (log J)^2/2,    J = det Q,

V that of a compressible neo-Hookean material, isotropic and at rest at Q = 1; the equation of motion is
Q'' E = -dV/dQ. A steady spin turns a constant stretch, Q = exp(t hat(Omega)) diag(q).

Any motion is a turn of a changing shape, Q = R S with S symmetric: S is what the phases of the turn R belong to
(`PseudoRigidMotion`).

Sources: Lewis and Simo 1990; Simo, Lewis and Marsden 1991; Marsden and Ratiu, section 15.9, remark 5; theory.md L8.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import root

from .. import so3
from ..arguments import check_object, number_argument
from ..arrays import Array, finite_array, lock_arrays
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError, UnphysicalInertiaError
from ._arguments import above_zero, axis_index, check_entries
from ._flow import TOLERANCE

_LOOSER = 32.0  # tolerance of the second run, whose difference is above the error of the first
_STEPS = 200_000  # most steps of one run, some minutes of computing
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class PseudoRigidBody:
    """A homogeneously deforming body of neo-Hookean material.

    A rigid body with principal moments I_i has E_i = (I_j + I_k - I_i)/2 (`inertia_tensor.second_moment`).

    Parameters
    ----------
    second_moments : (3,) E_i > 0, the integrals of X_i^2 by mass in the reference, along its principal axes [kg m^2]
    shear : mu > 0, shear modulus times volume [J]
    bulk : lambda >= 0, Lame's first constant times volume [J]

    Examples
    --------
    >>> body = sp.rigid_body.PseudoRigidBody([3.0, 2.0, 1.0], shear=10.0, bulk=20.0)
    >>> print(body.moments())
    [3. 4. 5.]
    """

    second_moments: Array
    shear: float
    bulk: float

    __repr__ = short_repr

    def __init__(self, second_moments: ArrayLike, shear: float, bulk: float) -> None:
        moments = finite_array(second_moments, "second_moments", (3,), unit="kg m^2")
        stiffness = finite_array(shear, "shear", unit="J"), finite_array(bulk, "bulk", unit="J")
        if moments.shape != (3,) or any(value.shape for value in stiffness):
            raise ShapeError("second_moments, shear, bulk: three numbers, one and one are needed")
        if moments.min() <= 0.0 or stiffness[0] <= 0.0 or stiffness[1] < 0.0:
            raise UnphysicalInertiaError("second_moments and shear must be above 0, bulk not below 0")
        object.__setattr__(self, "second_moments", np.array(moments))
        object.__setattr__(self, "shear", float(stiffness[0]))
        object.__setattr__(self, "bulk", float(stiffness[1]))

    def moments(self, stretches: ArrayLike = (1.0, 1.0, 1.0)) -> Array:
        """Principal moments of inertia of the body stretched by q: (..., 3) -> (..., 3) [kg m^2]."""
        q = finite_array(stretches, "stretches", (3,))
        check_entries(q <= 0.0, q, "stretches", "they must be above 0")
        parts = self.second_moments * q**2
        return parts.sum(axis=-1, keepdims=True) - parts

    def stored_energy(self, deformation: ArrayLike) -> Array:
        """V(Q): (..., 3, 3) -> (...) [J]."""
        q, log = self._deformation(deformation)
        squares = np.sum(q * q, axis=(-2, -1))
        return 0.5 * self.shear * (squares - 3.0) - self.shear * log + 0.5 * self.bulk * log * log

    def force(self, deformation: ArrayLike) -> Array:
        """DV/dQ: (..., 3, 3) -> (..., 3, 3) [J]; Q'' E = -force."""
        q, log = self._deformation(deformation)
        inverse = np.linalg.inv(so3.transpose(q))
        return self.shear * (q - inverse) + (self.bulk * log)[..., None, None] * inverse

    def motion(self, deformation: ArrayLike, rate: ArrayLike, duration: float) -> PseudoRigidMotion:
        """The free motion from these initial values, by DOP853 at its finest tolerance.

        Parameters
        ----------
        deformation : (3, 3) Q at the start, of positive determinant
        rate : (3, 3) Q' at the start [1/s]
        duration : [s]

        Raises
        ------
        AccuracyNotReached
            If the motion takes too many steps.
        ShapeError
            If the matrices have other shapes.

        Examples
        --------
        >>> body = sp.rigid_body.PseudoRigidBody([3.0, 2.0, 1.0], shear=10.0, bulk=20.0)
        >>> spin = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        >>> motion = body.motion(np.diag([1.1, 1.0, 0.9]), spin, 2.0)
        >>> deformation = sp.prescribed(motion.inertia, motion.internal_momentum, 2.0)
        >>> turned = sp.reconstruct(deformation, motion.momentum, motion.attitude(0.0)).final_attitude
        >>> bool(sp.so3.angle(turned.T @ motion.attitude(2.0)) < 1e-8)
        True
        """
        start, speed = self._deformation(deformation)[0], finite_array(rate, "rate", (3, 3), unit="1/s")
        if start.shape != (3, 3) or speed.shape != (3, 3):
            raise ShapeError("deformation, rate: one matrix (3, 3) each is needed")
        time = above_zero(duration, "duration", "s")
        fine, coarse = (self._solution(start, speed, time, factor) for factor in (1.0, _LOOSER))
        angular = speed * self.second_moments @ start.T
        found = PseudoRigidMotion(self, time, so3.vee(angular - angular.T), 0.0, fine)
        other, times = replace(found, _solution=coarse), fine.ts
        error = float(so3.angle(so3.transpose(found.attitude(times)) @ other.attitude(times)).max())
        return replace(found, error_estimate=error)

    def _solution(self, start: Array, speed: Array, duration: float, factor: float) -> OdeSolution:
        """Q and Q', row by row, in time."""

        def slope(_: float, state: Array) -> Array:
            return np.concatenate([state[9:], -(self.force(state[:9].reshape(3, 3)) / self.second_moments).ravel()])

        initial = np.concatenate([start.ravel(), speed.ravel()])
        local, size = factor * TOLERANCE, float(np.abs(initial).max())
        solver, times, pieces = DOP853(slope, 0.0, initial, duration, rtol=local, atol=local * size), [0.0], []
        while solver.status == "running" and len(pieces) < _STEPS:
            solver.step()
            times.append(solver.t)
            pieces.append(solver.dense_output())
        if solver.status != "finished":
            raise AccuracyNotReached(
                f"pseudo-rigid body: {len(pieces)} steps reach t = {solver.t:.6g} s; shorten the motion"
            )
        return OdeSolution(times, pieces)

    def _deformation(self, deformation: ArrayLike) -> tuple[Array, Array]:
        q = finite_array(deformation, "deformation", (3, 3))
        volume = np.linalg.det(q)
        if np.any(volume <= 0.0):
            raise ShapeError(f"deformation: its determinant must be above 0, got {float(volume.min()):.6g}")
        return q, np.log(volume)

    def _stiffness(self, stretches: Array) -> Array:
        """The second derivative of V at diag(q), rows of Q one after the other: (9, 9) [J]."""
        log, inverse = float(np.log(stretches.prod())), 1.0 / stretches
        volume = np.diag(inverse).ravel()
        same = np.eye(len(volume))
        turned = np.einsum("i,j,ik,jl->ijlk", inverse, inverse, np.eye(3), np.eye(3)).reshape(same.shape)
        return self.shear * (same + turned) + self.bulk * (np.outer(volume, volume) - log * turned)


@dataclass(frozen=True, eq=False)
class PseudoRigidMotion:
    """Free motion of a pseudo-rigid body on [0, duration]. Made by `PseudoRigidBody.motion`; times are (...) [s].

    `prescribed(motion.inertia, motion.internal_momentum, motion.duration)` is its change of shape as a deformation:
    `reconstruct` turns it as the motion does, and `split` has its holonomy and its phases.
    """

    body: PseudoRigidBody
    """The `PseudoRigidBody`."""
    duration: float
    """Duration of the motion [s]."""
    momentum: Array
    """(3,) angular momentum, inertial axes, constant [kg m^2/s]."""
    error_estimate: float
    """Error of the attitude: its largest difference from a run with 32 times the tolerance [rad]."""
    _solution: OdeSolution = field(repr=False)

    __repr__ = short_repr
    __post_init__ = lock_arrays

    def deformation(self, t: ArrayLike) -> Array:
        """Q(t): (...) -> (..., 3, 3)."""
        return self._state(t)[0]

    def attitude(self, t: ArrayLike) -> Array:
        """R(t) of Q = R S, body to inertial axes: (...) -> (..., 3, 3)."""
        left, _, right = np.linalg.svd(self._state(t)[0])
        return left @ right

    def stretch(self, t: ArrayLike) -> Array:
        """S(t) of Q = R S, symmetric positive definite, the shape: (...) -> (..., 3, 3)."""
        return self._stretch(t)[0]

    def inertia(self, t: ArrayLike) -> Array:
        """Locked inertia of the shape, tr(S E S) 1 - S E S: (...) -> (..., 3, 3) [kg m^2]."""
        stretch = self._stretch(t)[0]
        second = stretch * self.body.second_moments @ stretch
        return np.trace(second, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - second

    def internal_momentum(self, t: ArrayLike) -> Array:
        """Momentum L_o of the changing shape that does not turn, body axes: (...) -> (..., 3) [kg m^2/s]."""
        stretch, rate = self._stretch(t)
        moved = rate * self.body.second_moments @ stretch
        return so3.vee(moved - so3.transpose(moved))

    def _state(self, t: ArrayLike) -> tuple[Array, Array]:
        times = finite_array(t, "t", unit="s")
        if np.any((times < 0.0) | (times > self.duration)):
            raise ShapeError(f"t: from {times.min():.6g} to {times.max():.6g} s; the motion is on [0, {self.duration}]")
        rows = self._solution(times.ravel()).T.reshape(*times.shape, 2, 3, 3)
        return rows[..., 0, :, :], rows[..., 1, :, :]

    def _stretch(self, t: ArrayLike) -> tuple[Array, Array]:
        """S and S', from S^2 = Q^T Q in the axes of its eigenvectors."""
        q, speed = self._state(t)
        _, stretches, axes = np.linalg.svd(q)
        squared = so3.transpose(speed) @ q
        turned = axes @ (squared + so3.transpose(squared)) @ so3.transpose(axes)
        rate = turned / (stretches[..., :, None] + stretches[..., None, :])
        return so3.transpose(axes) * stretches[..., None, :] @ axes, so3.transpose(axes) @ rate @ axes


@dataclass(frozen=True, eq=False)
class PseudoRigidSpin:
    """Steady spin of a pseudo-rigid body. Made by `pseudo_rigid_spin`."""

    body: PseudoRigidBody
    """The `PseudoRigidBody`."""
    axis: int
    """0, 1 or 2."""
    momentum: float
    """Along the axis [kg m^2/s]."""
    rate: float
    """Omega [rad/s]."""
    stretches: Array
    """(3,) q, the stretches along the principal axes."""
    curvatures: Array
    """(8,) second derivatives of the amended potential V + mu.I(Q)^-1 mu/2, ascending, across the turn about the
    momentum, to which it is indifferent [J]."""
    eigenvalues: np.ndarray
    """(18,) complex, of the linearised motion in the turning frame [1/s]."""
    verdict: str
    """ "stable" where all curvatures are positive (energy-momentum method: in the sense of Liapunov, up to the turn
    about the momentum); "unstable" where an eigenvalue has a positive real part; else "spectrally stable", as about the
    axis of the smallest moment, where friction would decide otherwise."""

    __repr__ = short_repr

    def deformation(self, t: ArrayLike) -> Array:
        """Q(t) = exp(t hat(Omega)) diag(q): (...) [s] -> (..., 3, 3)."""
        times = finite_array(t, "t", unit="s")
        return so3.exp(times[..., None] * self.rate * np.eye(3)[self.axis]) * self.stretches


def pseudo_rigid_spin(body: PseudoRigidBody, axis: int, momentum: float) -> PseudoRigidSpin:
    """The steady spin about a principal axis, how much it stretches the body, and its stability.

    The stretches are a critical point of V + momentum^2/(2 I(q)), reached from the body at rest.

    Source: Lewis and Simo 1990; Marsden and Ratiu, section 15.9, remark 5 (theory.md L8).
    Raises AccuracyNotReached if no equilibrium is found.

    Parameters
    ----------
    axis : 0, 1 or 2, of the reference's principal axes
    momentum : [kg m^2/s]

    Examples
    --------
    >>> body = sp.rigid_body.PseudoRigidBody([3.0, 2.0, 1.0], shear=10.0, bulk=20.0)
    >>> spin = sp.rigid_body.pseudo_rigid_spin(body, 2, 6.0)
    >>> print(f"{spin.rate:.6f} rad/s, as rigid {6.0 / 5.0:.6f} rad/s")
    1.017854 rad/s, as rigid 1.200000 rad/s
    """
    check_object(body, "PseudoRigidBody", "body")
    index, size = axis_index(axis), number_argument(momentum, "momentum", "kg m^2/s")
    stretches = _stretched(body, index, size)
    rate = size / float(body.moments(stretches)[index])
    curvatures = _curvatures(body, index, size, stretches)
    eigenvalues = _spectrum(body, index, rate, stretches)
    # Double eigenvalues are split by the root of the rounding; curvatures have its thousandfold.
    if curvatures[0] > 1e3 * _EPS * curvatures[-1]:
        verdict = "stable"
    elif np.real(eigenvalues).max() > 30.0 * np.sqrt(_EPS) * np.abs(eigenvalues).max():
        verdict = "unstable"
    else:
        verdict = "spectrally stable"
    return PseudoRigidSpin(
        body=body,
        axis=index,
        momentum=size,
        rate=rate,
        stretches=stretches,
        curvatures=curvatures,
        eigenvalues=eigenvalues,
        verdict=verdict,
    )


def _stretched(body: PseudoRigidBody, axis: int, momentum: float) -> Array:
    """Stretches of a steady spin, solved for by their logarithms, so that they stay positive."""
    across = np.where(np.arange(3) == axis, 0.0, body.second_moments)

    def balance(logs: Array) -> Array:
        q = np.exp(logs)
        pulled = momentum**2 * across * q * q / float(across @ (q * q)) ** 2
        return (body.shear * (q * q - 1.0) + body.bulk * logs.sum() - pulled) / body.shear

    solution = root(balance, np.zeros(3), tol=1e-15)
    stretches = np.exp(solution.x)
    if np.abs(balance(solution.x)).max() > 1e-10 * (1.0 + float((stretches**2).max())):
        raise AccuracyNotReached(f"no steady spin with momentum {momentum:.6g} kg m^2/s was found: {solution.message}")
    return stretches


def _curvatures(body: PseudoRigidBody, axis: int, momentum: float, stretches: Array) -> Array:
    """Second derivatives of the amended potential, across the turn about the momentum."""
    q, second, unit = np.diag(stretches), np.diag(body.second_moments), np.eye(3)[axis]
    inverse = np.diag(1.0 / body.moments(stretches))
    omega = momentum * inverse @ unit
    directions = np.eye(q.size).reshape(-1, 3, 3)
    products = directions @ second @ q.T
    slopes = 2.0 * np.trace(products, axis1=1, axis2=2)[:, None, None] * np.eye(3) - products - so3.transpose(products)
    # d^2 (mu.I^-1 mu/2) = omega.dI I^-1 dI omega - omega.d^2I omega/2, I quadratic in Q.
    pushed = slopes @ omega
    pairs = np.einsum("aij,j,bkj->abik", directions, body.second_moments, directions)
    bends = np.trace(pairs, axis1=2, axis2=3) * (omega @ omega) - np.einsum("i,abik,k->ab", omega, pairs, omega)
    hessian = body._stiffness(stretches) + pushed @ inverse @ pushed.T - 0.5 * (bends + bends.T)
    turn = (so3.hat(unit) @ q).ravel()
    basis = np.linalg.svd(turn[None])[2][1:]
    return np.asarray(np.linalg.eigvalsh(basis @ hessian @ basis.T), dtype=float)


def _spectrum(body: PseudoRigidBody, axis: int, rate: float, stretches: Array) -> np.ndarray:
    """Eigenvalues of d'' = -2 hat(Omega) d' - hat(Omega)^2 d - V''[d] E^-1 in the frame that turns."""
    turn = np.kron(so3.hat(rate * np.eye(3)[axis]), np.eye(3))
    forces = body._stiffness(stretches) / np.tile(body.second_moments, 3)[:, None]
    matrix = np.block([[np.zeros_like(turn), np.eye(len(turn))], [-turn @ turn - forces, -2.0 * turn]])
    return np.linalg.eigvals(matrix)
