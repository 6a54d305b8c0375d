"""Stability of the steady rotations of a free rigid body: energy-Casimir method, spectrum, Hessian on the sphere.

Steady rotations are the equilibria of Euler's equations, Pi' = Pi x Omega with Pi = I Omega: the momentum lies along a
principal axis. The body's axes are arbitrary: tensors need not be diagonal.

Source: Marsden and Ratiu, section 15.9; Arnold 1966 (the method on the coadjoint orbit).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import magnitude_argument, vector_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import principal_axes
from ..letters import value_text
from ._arguments import FEW_ULPS, TWELVE_DIGITS, one_tensor
from .euler_top import EulerTop

_LARGEST = 1e100  # [kg m^2/s] and its inverse: the momentum's square and inverse square must be finite


@dataclass(frozen=True)
class SteadyRotation:
    """Steady rotation of a free rigid body, and its stability by three methods. Made by `steady_rotation`.

    A spherical body is "stable" everywhere: every momentum stands still.
    """

    momentum: Array
    """(3,) the equilibrium Pi_e, body axes [kg m^2/s]."""
    moment: float
    """I_e, the moment of inertia about it [kg m^2]."""
    slope: float  #: Phi' at |Pi_e|^2/2 of the Casimir Phi that is added to the energy, see `casimir`.
    curvature: float
    """Phi'' at |Pi_e|^2/2 of this Casimir."""
    first_variation: Array
    """(3,) gradient of H + Phi at Pi_e, Omega + Phi' Pi; zero by the choice of the slope [rad/s]."""
    second_variation: Array
    """(3, 3) second derivative of H + Phi at Pi_e, body axes [1/(kg m^2)]."""
    definiteness: str
    """ "positive definite", "negative definite", "indefinite" or "semidefinite" (equal moments)."""
    linearisation: Array
    """(3, 3) A in dPi' = A dPi, Euler's equations linearised at Pi_e, body axes [1/s]."""
    tangent: Array
    """(3, 2) columns: the principal axes at right angles to Pi_e, right-handed with it."""
    eigenvalues: np.ndarray
    """(2,) complex, plus and minus, of the linearisation on the tangent plane of the sphere [1/s]."""
    sphere_hessian: Array
    """(2, 2) second derivative of H restricted to the momentum sphere, in the basis `tangent`."""
    index: int
    """Number of negative directions of `sphere_hessian`."""
    verdict: str
    """ "stable" (Liapunov), "unstable", or "stable modulo the circle of equilibria" (where this moment equals exactly
    one of the others: a neighbouring motion drifts along the circle of equilibria and stays near it)."""

    __repr__ = short_repr

    def casimir(self, half_square: ArrayLike) -> Array:
        """Phi(x) = slope x + curvature/2 (x - x_e)^2 at x = |Pi|^2/2: (...) -> (...) [J].

        The curvature is +-2/(I_e |Pi_e|^2), of the sign that makes the second variation definite where any does.
        Source: Marsden and Ratiu, after (15.9.8) and (15.9.10).
        """
        x = finite_array(half_square, "half_square", unit="(kg m^2/s)^2")
        return self.slope * x + 0.5 * self.curvature * (x - 0.5 * self.momentum @ self.momentum) ** 2


def steady_rotation(inertia: ArrayLike, momentum: ArrayLike) -> SteadyRotation:
    """The steady rotation with this body momentum, and its stability.

    On the tangent plane the second derivative of H is diag(1/I_i - 1/I_e, 1/I_j - 1/I_e), the eigenvalues are
    +-|Pi| sqrt((I_e - I_i)(I_j - I_e)/(I_i I_j)) / I_e. The energy-Casimir method proves stability where that matrix
    is definite (the largest and the smallest moment); the spectrum proves instability where it is indefinite.

    Source: Marsden and Ratiu (15.9.4-12), theorem 15.9.1, remark 2 (I_e is their I1 in turn for each axis; where they
    order the moments, their I1 > I2 > I3 are our I3, I2, I1); theory.md L1-L3, L5, M-E13.
    Raises ShapeError if a shape is wrong, or the momentum is zero or not along a principal axis (to 1e-12).

    Parameters
    ----------
    inertia : (3, 3) symmetric positive definite tensor, body axes [kg m^2]
    momentum : (3,) along a principal axis, not zero, body axes [kg m^2/s]

    Examples
    --------
    >>> spin = sp.rigid_body.steady_rotation(np.diag([1.0, 2.0, 3.0]), [0.0, 1.0, 0.0])
    >>> print(f"{spin.eigenvalues.real.max():.6f} = sqrt((1 - 1/2)(1/2 - 1/3))")
    0.288675 = sqrt((1 - 1/2)(1/2 - 1/3))
    """
    tensor, vector = one_tensor(inertia), vector_argument(momentum, "momentum", unit="kg m^2/s")
    largest = np.abs(vector).max()
    if largest == 0.0:
        raise ShapeError("momentum: the body is at rest; a steady rotation needs a momentum other than zero")
    if not 1.0 / _LARGEST < largest < _LARGEST:
        raise ShapeError(f"momentum: {largest:.3g} kg m^2/s is out of range, 1e-100 to 1e100; take other units")
    magnitude = float(largest * np.linalg.norm(vector / largest))
    axis = vector / magnitude
    image = tensor @ axis
    moment = float(axis @ image)
    tilt = float(np.linalg.norm(image - moment * axis))
    if tilt > TWELVE_DIGITS * np.trace(tensor):
        raise ShapeError(
            f"momentum: {vector} is not along a principal axis, so the rotation is not steady (I n leaves n by "
            f"{tilt:.3g} kg m^2); take the axes from `steady_rotations`"
        )
    others, tangent = _across(tensor, axis)
    gaps = (moment - others) / (moment * others)  # 1/I_i - 1/I_e along the columns of `tangent`
    # Moments of a diagonal tensor are exact.
    exact = np.count_nonzero(tensor - np.diag(np.diag(tensor))) == 0 and np.count_nonzero(axis) == 1
    gaps[np.abs(moment - others) <= (0.0 if exact else FEW_ULPS * float(np.trace(tensor)))] = 0.0
    low, high = float(gaps.min()), float(gaps.max())
    if low > 0.0:
        definiteness, verdict = "positive definite", "stable"
    elif high < 0.0:
        definiteness, verdict = "negative definite", "stable"
    elif low < 0.0 < high:
        definiteness, verdict = "indefinite", "unstable"
    else:
        definiteness = "semidefinite"
        verdict = "stable" if low == high else "stable modulo the circle of equilibria"
    slope, along = -1.0 / moment, (-2.0 if low < 0.0 and high <= 0.0 else 2.0) / moment
    root = magnitude * np.sqrt(complex(-gaps[0] * gaps[1]))
    inverse = tangent @ np.diag(1.0 / others) @ tangent.T + np.outer(axis, axis) / moment
    return SteadyRotation(
        momentum=vector.copy(),
        moment=moment,
        slope=slope,
        curvature=along / magnitude**2,
        first_variation=inverse @ vector + slope * vector,
        second_variation=tangent @ np.diag(gaps) @ tangent.T + along * np.outer(axis, axis),
        definiteness=definiteness,
        # Pi_e x (D^2 H + Phi') dPi, since X_H = Pi x grad H and X_Phi = 0; no difference of equal terms is left.
        linearisation=magnitude * so3.hat(axis) @ tangent @ np.diag(gaps) @ tangent.T,
        tangent=tangent,
        eigenvalues=np.array([root, -root]),
        sphere_hessian=np.diag(gaps),
        index=int(np.count_nonzero(gaps < 0.0)),
        verdict=verdict,
    )


def steady_rotations(
    inertia: ArrayLike, magnitude: float = 1.0
) -> tuple[SteadyRotation, SteadyRotation, SteadyRotation]:
    """The steady rotations about the three principal axes, by ascending moment of inertia.

    The opposite momenta are the other three equilibria, alike in everything. The book's "longest axis" of theorem
    15.9.1 is the axis of the largest moment (its I1, our I3), which is the shortest axis of the inertia ellipsoid and
    of a homogeneous box: here axes go by their moments (theory.md M-E12).

    Equation :eq:`unstable-rate` of the documentation.
    Source: Marsden and Ratiu, theorem 15.9.1.

    Parameters
    ----------
    inertia : (3, 3) symmetric positive definite tensor, body axes [kg m^2]
    magnitude : |Pi| > 0 [kg m^2/s]

    Examples
    --------
    >>> [spin.verdict for spin in sp.rigid_body.steady_rotations(np.diag([1.0, 2.0, 3.0]))]
    ['stable', 'unstable', 'stable']
    """
    tensor, norm = one_tensor(inertia), magnitude_argument(magnitude)
    _, axes = principal_axes(tensor)
    smallest, intermediate, largest = (steady_rotation(tensor, norm * axes[:, k]) for k in range(3))
    return smallest, intermediate, largest


@dataclass(frozen=True)
class SpinInSpace:
    """Motion in space of a body disturbed in a steady rotation, for all time. Made by `spin_in_space`."""

    steady: SteadyRotation
    """The steady rotation that was disturbed."""
    momentum: Array
    """(3,) the disturbed Pi, body axes [kg m^2/s]."""
    tilt: float
    """The greatest angle ever between the axis of the steady rotation and the angular momentum, which is constant in
    space [rad]; on a separatrix the limit that is never quite reached."""
    drift: float
    """How much faster than in the steady rotation the body turns about the momentum, on average [rad/s]; NaN where Pi
    does not circle the axis."""
    verdict: str
    """ "stable up to the turn about the momentum": the tilt is as small as one likes for small disturbances, while the
    angle about the momentum drifts; or "unstable"."""

    __repr__ = short_repr


def spin_in_space(inertia: ArrayLike, momentum: ArrayLike, disturbed: ArrayLike) -> SpinInSpace:
    """Motion in space after a disturbance of a steady rotation, whose axis stays near the momentum if it is stable.

    By Pi = R^T mu the angle in space between a body axis n and the constant mu is that in the body between n and Pi.
    So where Pi stays near n in the body, n stays near mu in space, and the tilt is that of the polhode's farthest
    point. The angle about mu is not stable: motions of nearly the same momentum turn at slightly different rates.
    With two equal moments a rotation across their axis is unstable in space: the momentum wanders along the circle of
    equilibria, and the axis away from the momentum.

    Source: Marsden and Ratiu, section 15.9, remark 3 (theory.md L7); M-E1 and M-E7 for the farthest point.
    Raises ShapeError, UnphysicalInertiaError, SingularInertiaError like `steady_rotation`; also if `disturbed` is zero.

    Parameters
    ----------
    inertia : (3, 3) symmetric positive definite tensor, body axes [kg m^2]
    momentum : (3,) of the steady rotation, along a principal axis [kg m^2/s]
    disturbed : (3,) Pi after the disturbance, not zero [kg m^2/s]

    Examples
    --------
    >>> spin = sp.rigid_body.spin_in_space(np.diag([1.0, 2.0, 3.0]), [0.0, 0.0, 1.0], [0.0, 0.01, 1.0])
    >>> print(f"tilt {np.degrees(spin.tilt):.4f} degrees, drift {spin.drift:.2e} rad/s")
    tilt 0.5729 degrees, drift 2.50e-05 rad/s
    """
    steady = steady_rotation(inertia, momentum)
    vector = vector_argument(disturbed, "disturbed", unit="kg m^2/s")
    if not vector.any():
        raise ShapeError(f"disturbed: one momentum (3,) other than zero is needed, got {value_text(disturbed)}")
    axis = steady.momentum / np.linalg.norm(steady.momentum)
    top, stable = EulerTop(inertia, vector), steady.verdict == "stable"
    return SpinInSpace(
        steady=steady,
        momentum=vector,
        tilt=_farthest(top, axis),
        drift=_mean_turn(top, axis) - float(np.linalg.norm(steady.momentum)) / steady.moment,
        verdict="stable up to the turn about the momentum" if stable else "unstable",
    )


def _farthest(top: EulerTop, axis: Array) -> float:
    """Greatest angle between Pi and a principal axis [rad]."""
    orbit, own = top.orbit, top.axes.T @ axis
    if orbit.circled < 0:
        return float(so3.angle_between(orbit.direction, own))
    shares, index = np.abs(orbit.amplitudes), int(np.argmax(np.abs(own)))
    if index == orbit.circled:
        # Farthest where the component along the middle axis is greatest; from behind, where Pi is nearest to the axis.
        if own @ orbit.direction > 0.0:
            return float(np.arctan2(shares[1], shares[index] * np.sqrt(orbit.complement)))
        return float(np.pi - np.arctan2(shares[orbit.other], shares[index]))
    if orbit.regime == "separatrix" and index == orbit.other:
        return 0.5 * np.pi if own @ orbit.start > 0.0 else float(np.pi - np.arccos(min(1.0, shares[index])))
    return float(np.pi - np.arccos(min(1.0, shares[index])))


def _mean_turn(top: EulerTop, axis: Array) -> float:
    """Mean rate of the body about the momentum, where Pi circles this axis or stands still [rad/s]."""
    if top.orbit.circled < 0:
        return 2.0 * top.energy / top.magnitude
    if np.abs(top.axes[:, top.orbit.circled] @ axis) < 0.5 or not np.isfinite(top.period):
        return float("nan")
    return top.montgomery_phase / top.period


def _across(tensor: Array, axis: Array) -> tuple[Array, Array]:
    """Moments and principal axes in the plane at right angles to a principal axis, right-handed with it."""
    first = so3.perpendicular(axis)
    basis = np.stack([first, np.cross(axis, first)], axis=-1)
    plane = basis.T @ tensor @ basis
    moments, turn = np.linalg.eigh(0.5 * (plane + plane.T))
    turn[:, 1] *= np.sign(np.linalg.det(turn))
    return moments, basis @ turn
