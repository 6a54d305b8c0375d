"""The free rigid body, the Euler top, in closed form: momentum, attitude, period and phases at any time.

The momentum goes round an axis ê of the body, see `momentum_orbit`. The attitude is

    R(t) = R(0) Q(0)^T exp(psi ê) Q(t),

where Q(t) is the shortest turn that takes the direction of Pi to ê, never farther than a quarter turn, and

    psi' = L/I_k + (2 E/L − L/I_k)/(1 + ê.Pi/L),

whose integral is L t/I_2 plus a Legendre integral of the third kind, of characteristic n <= 0, less the part of it that
grows in proportion to t. No Euler angles enter, so there are no poles and one formula serves every case.

Sources: Marsden and Ratiu, exercise 15.8-1; compare van Zon and Schofield 2007; theory.md D17, H.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import elliptic, so3
from ..arguments import made_by
from ..arrays import Array
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, card_html, numbers
from ..inertia_tensor import body_principal_axes
from ._arguments import one_array, one_attitude, one_tensor, times_within_turns
from ._momentum_orbit import MomentumOrbit, momentum_orbit

_BLOCK = 16_384  # times evaluated together: their arrays (half a megabyte each) stay in a processor's cache


@made_by("EulerTop(inertia, momentum)")
class EulerTop:
    """A free rigid body with a given inertia, angular momentum and initial attitude.

    Every inertia and momentum is allowed, also zero momentum; times may be negative. Raises ShapeError, and
    UnphysicalInertiaError or SingularInertiaError if the inertia is not symmetric or not positive definite.

    Equations :eq:`jacobi` and :eq:`rigid-phase` of the documentation.

    Parameters
    ----------
    inertia : (3, 3) about the centre of mass, body axes [kg m^2], symmetric positive definite
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    attitude : (3, 3) at t = 0, body axes to inertial axes; None: the identity

    Attributes
    ----------
    inertia, momentum : as given
    initial_attitude : (3, 3)
    moments : (3,) principal moments, ascending [kg m^2]
    axes : (3, 3) whose columns are the principal axes in body axes, determinant +1
    orbit : the curve of Pi in those axes

    Examples
    --------
    >>> top = sp.EulerTop.principal([3.0, 2.0, 1.0], [0.6, 0.3, 1.5])
    >>> print(f"{top.energy:.6f} J, period {top.period:.6f} s, Montgomery phase {top.montgomery_phase:.6f} rad")
    1.207500 J, period 7.336538 s, Montgomery phase 11.386379 rad
    """

    def __init__(self, inertia: ArrayLike, momentum: ArrayLike, attitude: ArrayLike | None = None) -> None:
        spatial, start = one_array(momentum, "momentum", (3,), "kg m^2/s"), one_attitude(attitude)
        self._make(one_tensor(inertia), spatial, start, start.T @ spatial)

    @classmethod
    def principal(cls, moments: ArrayLike, momentum: ArrayLike, attitude: ArrayLike | None = None) -> EulerTop:
        """A body whose axes are its principal axes, with its momentum along them, so that no rounding enters.

        Parameters
        ----------
        moments : (3,) about the three body axes, in any order [kg m^2]
        momentum : (3,) at t = 0, body axes [kg m^2/s]
        attitude : (3, 3) at t = 0; None: the identity
        """
        tensor = one_tensor(np.diag(one_array(moments, "moments", (3,), "kg m^2")))
        body, start = one_array(momentum, "momentum", (3,), "kg m^2/s"), one_attitude(attitude)
        top = cls.__new__(cls)
        top._make(tensor, start @ body, start, body)
        return top

    def _make(self, inertia: Array, momentum: Array, attitude: Array, body_momentum: Array) -> None:
        self.inertia, self.momentum, self.initial_attitude = inertia, momentum, attitude
        self.moments, self.axes = body_principal_axes(inertia)
        self.orbit = orbit = momentum_orbit(self.moments, self.axes.T @ body_momentum)
        # The factors left and right of exp(psi ê) Q(t) are constant: together they are one linear map of quaternions.
        ends = so3.quat_from_matrix(self.axes)
        outward = so3.quat_product(so3.quat_from_matrix(attitude), ends)
        left = so3.quat_product(
            outward, so3.quat_inverse(so3.normalised(_precessing_frame(orbit, np.zeros(()), np.asarray(orbit.phase))))
        )
        columns = so3.quat_product(np.eye(4), np.broadcast_to(so3.quat_inverse(ends), (4, 4)))
        self._around = so3.quat_product(np.broadcast_to(left, (4, 4)), columns)

    _repr_html_ = card_html

    def _card(self) -> Card:
        """Moments, momentum, energy, regime and period; with the body momentum in one period."""
        rows = [
            ("moments", numbers(self.moments, "kg m^2")),
            ("momentum", numbers(self.momentum, "kg m^2/s")),
            ("energy", numbers(self.energy, "J")),
            ("regime", self.regime),
            ("period", numbers(self.period, "s")),
            ("condition", f"{self.condition:.3g}, the factor by which a half turn magnifies rounding of the data"),
        ]
        if not np.isfinite(self.period):
            return Card("EulerTop", rows)
        momenta = self.body_momentum(np.linspace(0.0, self.period, MOST_POINTS))
        return Card("EulerTop", rows, curves_picture(momenta, "body momentum in one period"))

    def __repr__(self) -> str:  # noqa: D105
        moments = ", ".join(f"{moment:.6g}" for moment in self.moments)
        return f"EulerTop(moments=({moments}) kg m^2, momentum={self.magnitude:.6g} kg m^2/s, {self.regime})"

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) of either sign -> (..., 3), body axes [kg m^2/s]."""
        orbit = self.orbit
        return orbit.magnitude * (orbit.directions(self._argument(t)[1]) @ self.axes.T)

    def angular_velocity(self, t: ArrayLike) -> Array:
        """omega(t) = I^-1 Pi(t): times (...) -> (..., 3), body axes [rad/s]."""
        return (self.body_momentum(t) @ self.axes / self.moments) @ self.axes.T

    def attitude(self, t: ArrayLike) -> Array:
        """R(t), body axes to inertial axes: times (...) -> (..., 3, 3)."""
        return so3.matrix_from_quat(self._quaternion(t))

    def quat_xyzw(self, t: ArrayLike) -> Array:
        """The attitude as quaternions x y z w with w >= 0: times (...) -> (..., 4)."""
        return so3.positive_scalar(self._quaternion(t))

    @property
    def magnitude(self) -> float:
        """|Pi| [kg m^2/s]."""
        return self.orbit.magnitude

    @property
    def energy(self) -> float:
        """E = Pi.I^-1 Pi/2 [J]."""
        return 0.5 * float(np.sum(self.orbit.start**2 / self.moments))

    @property
    def regime(self) -> str:
        """Kind of motion of Pi in the body.

        "rest" without momentum; "spherical" with three equal moments; "steady" along a principal axis; "axisymmetric":
        at a constant rate round the symmetry axis; "circling" the axis of the largest or of the smallest moment;
        "separatrix": from one direction of the intermediate axis to the other, once in all time.
        """
        return self.orbit.regime

    @property
    def axis(self) -> Array:
        """The principal axis that Pi circles, on Pi's side: (3,) unit vector, body axes.

        On the separatrix that of the largest moment. Where Pi stands still and circles nothing (a spherical body, the
        intermediate axis, the equator of an axisymmetric body) its own direction; zero at rest.
        """
        return self.axes @ self.orbit.direction

    @property
    def rate(self) -> float:
        """Rate of the argument of the elliptic functions [rad/s]; 0 where Pi stands still and circles nothing."""
        return self.orbit.rate

    @property
    def modulus(self) -> float:
        """k of the elliptic functions (SciPy's parameter is its square): 0 next to the axis, 1 on the separatrix."""
        return float(np.sqrt(1.0 - self.complement))

    @property
    def complement(self) -> float:
        """m1 = 1 − k², accurate in all its digits however small; from 0 on the separatrix to 1 next to the axis."""
        return self.orbit.complement

    @property
    def condition(self) -> float:
        """Factor by which each half turn magnifies a change of inertia or momentum, relative to its largest entry.

        I3/I1 or more; about 1/m1 near the separatrix, infinite on it and along the intermediate axis. Rounding of the
        input is magnified by it, such as that of a tensor given in other axes than the principal ones.
        """
        return self.orbit.condition

    @property
    def period(self) -> float:
        """4 K/rate, after which Pi is what it was [s].

        Infinite on the separatrix and where Pi stands still and circles nothing; along the axes of the largest and the
        smallest moment the period of the small circles nearby.

        Source: theory.md H7.
        """
        return 4.0 * float(elliptic.complete_k(self.complement)) / self.rate if self.rate else np.inf

    @property
    def dynamic_phase(self) -> float:
        """The integral of omega.Pi/|Pi| over a period, 2 E T/|Pi| [rad]; 0 at rest.

        Source: Cabrera 2006, example 3.8; theory.md D12.
        """
        return self._mean_rate * self.period if self.magnitude else 0.0

    @property
    def solid_angle(self) -> float:
        """The signed area that the direction of Pi encloses in a period, in the body, on the side of `axis` [sr].

        Between −2 pi and 2 pi; negative about the axis of the smallest moment, which Pi circles clockwise. On the
        separatrix its limit, plus or minus `separatrix_solid_angle`; 0 where Pi stands still.

        Source: theory.md D12 and section 7.
        """
        orbit = self.orbit
        if orbit.regime in ("rest", "spherical", "steady"):
            return 0.0
        grown = orbit.excess * self.period if orbit.excess else 0.0
        return grown - orbit.third_kind + 2.0 * np.pi * orbit.sense

    @property
    def montgomery_phase(self) -> float:
        """dynamic_phase − solid_angle: R(t + T) = exp(this mu^) R(t), mu^ the momentum's direction [rad].

        Not reduced modulo 2 pi. It is also the angle that an axis which Pi does not circle turns through about the
        momentum, followed continuously in t. Infinite without a finite period; 0 at rest.

        Source: Montgomery 1991; Marsden and Ratiu, section 15.9, remark 4; theory.md D12, D17.
        """
        return self.precession_per_period - 2.0 * np.pi * self.orbit.sense

    @property
    def precession_per_period(self) -> float:
        """The angle that the circled axis turns through about the momentum in a period, followed along t [rad].

        `montgomery_phase` plus a full turn about the axis of the largest moment, less one about that of the smallest.

        Source: theory.md D17 (from Marsden and Ratiu, exercise 15.8-1).
        """
        if not self.rate:
            return np.inf if self.magnitude else 0.0
        return self.orbit.spin * self.period + self.orbit.third_kind

    @property
    def long_axis_precession_per_period(self) -> float:
        """`precession_per_period` of the axis of the smallest moment, whichever axis Pi circles [rad]."""
        return self.precession_per_period if self.orbit.circled == 0 else self.montgomery_phase

    @property
    def polhode_frequency(self) -> float:
        """2 pi/period, at which the momentum circles in the body [rad/s]; 0 where there is no finite period."""
        return 2.0 * np.pi / self.period

    @property
    def precession_frequency(self) -> float:
        """Mean rate of the circled axis about the momentum, precession_per_period/period [rad/s].

        Where there is no finite period the limit, 2 E/|Pi|; 0 at rest.
        """
        return self.precession_per_period / self.period if np.isfinite(self.period) else self._mean_rate

    @property
    def _mean_rate(self) -> float:
        """2 E/|Pi| = omega.Pi/|Pi|, the turn about the momentum [rad/s]."""
        return 2.0 * self.energy / self.magnitude if self.magnitude else 0.0

    def _argument(self, t: ArrayLike) -> tuple[Array, Array]:
        """Times, checked, and the argument of the elliptic functions there."""
        turn = min(self.period, 2.0 * np.pi * self.moments[0] / self.magnitude) if self.magnitude else np.inf
        times = times_within_turns(t, turn)
        return times, self.rate * times + self.orbit.phase

    def _quaternion(self, t: ArrayLike) -> Array:
        times, u = self._argument(t)
        flat, u = times.ravel(), u.ravel()
        quaternion = np.empty((flat.size, 4))
        for start in range(0, flat.size, _BLOCK):
            part = slice(start, start + _BLOCK)
            quaternion[part] = so3.normalised(_precessing_frame(self.orbit, flat[part], u[part]) @ self._around)
        return quaternion.reshape(*times.shape, 4)


def _precessing_frame(orbit: MomentumOrbit, times: Array, u: Array) -> Array:
    """Quaternions of exp(psi ê) Q, in principal axes, psi up to a constant: (...) -> (..., 4), not normalised."""
    direction, swing = orbit.directions_and_swing(u)
    half = 0.5 * (orbit.spin * times + swing)
    cosine, sine = np.cos(half), np.sin(half)
    # Q turns about the cross product of Pi and ê, which is at right angles to ê; its quaternion has the half angle.
    across = direction @ so3.hat(orbit.direction)
    scalar = 1.0 + direction @ orbit.direction
    turn = np.empty((*direction.shape[:-1], 4))
    turn[..., :3] = cosine[..., None] * across + sine[..., None] * (across @ so3.hat(orbit.direction).T)
    turn[..., :3] += (sine * scalar)[..., None] * orbit.direction
    turn[..., 3] = cosine * scalar
    return turn
