"""The gyrostat in closed form: a rigid body with a rotor inside, at any time, for every axis of the rotor.

The body's momentum is Pi = I omega + h with h fixed in the body, and Pi' = Pi x I^-1 (Pi - h). The curve of Pi is that
of `_gyrostat_orbit`; the attitude is, as for `EulerTop`,

    R(t) = R(0) Q(0)^T exp(psi e) Q(t),    psi' = omega.(x + e) / (1 + e.x),    x = Pi/|Pi|,

where Q(t) is the shortest turn that takes x to a unit vector e, and psi a sum of Legendre integrals of the third kind.

Sources: Volterra 1899; Wittenburg 1977, section 4.6; theory.md section 2 (equation of motion with constant L_o).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array
from ..inertia_tensor import body_principal_axes
from ._arguments import one_array, one_attitude, one_tensor, times_within_turns
from ._gyrostat_orbit import GyrostatOrbit, Swing, best_axis, gyrostat_orbit, swing_about

_ROUNDING = 4.0 * float(np.finfo(float).eps)  # relative difference of moments, or part of the rotor off their axis


class Gyrostat:
    """A free rigid body with a spinning rotor inside, whose momentum relative to the body is constant.

    Two wheels are described by this. One whose speed relative to the body is kept: `inertia` has the wheel in it, and
    `rotor` is its moment times that speed along its axle. One that turns freely, whose momentum about the axle p is
    constant: `inertia` is without the wheel's moment J about its axle, I - J a a^T, and `rotor` is p a.

    Source: Volterra 1899; Wittenburg 1977.

    Parameters
    ----------
    inertia : (3, 3) about the centre of mass, body axes [kg m^2], symmetric positive definite
    rotor : (3,) momentum of the rotor, body axes [kg m^2/s]; zero for a rigid body
    momentum : (3,) of all, about the centre of mass, inertial axes [kg m^2/s]
    attitude : (3, 3) at t = 0, body axes to inertial axes; None: the identity

    Attributes
    ----------
    inertia, rotor, momentum : as given
    initial_attitude : (3, 3)
    moments : (3,) principal moments, ascending [kg m^2]
    axes : (3, 3) whose columns are the principal axes in body axes, determinant +1
    regime : what the momentum does in the body: "steady", "circle" (uniformly about a symmetry axis), "one oval" (the
        only part of its curve), "one of two ovals", "separatrix"

    Raises
    ------
    AccuracyNotReached
        Within some 3e-5 rad of a steady rotation, where the oval is so small that its digits are lost (from 1e-2 rad
        on the error of the start grows as the inverse square of that angle), or of a body so nearly symmetric that it
        is nearly a circle; `reconstruct` with `prescribed` has no such limit.

    Examples
    --------
    >>> top = sp.Gyrostat(np.diag([1.0, 2.0, 3.0]), [0.1, 0.2, 0.3], [0.5, 1.0, -0.2])
    >>> print(f"{top.regime}, period {top.period:.6f} s, {top.energy:.6f} J")
    one oval, period 25.223914 s, 0.281667 J
    """

    def __init__(
        self, inertia: ArrayLike, rotor: ArrayLike, momentum: ArrayLike, attitude: ArrayLike | None = None
    ) -> None:
        self.inertia, self.initial_attitude = one_tensor(inertia), one_attitude(attitude)
        self.rotor = one_array(rotor, "rotor", (3,), "kg m^2/s")
        self.momentum = one_array(momentum, "momentum", (3,), "kg m^2/s")
        self.moments, self.axes = body_principal_axes(self.inertia)
        self._start = self.axes.T @ (self.initial_attitude.T @ self.momentum)
        self._rotor = self.axes.T @ self.rotor
        self._outward = self.initial_attitude @ self.axes
        self._orbit: GyrostatOrbit | None = None
        self._swing: Swing | None = None
        self._turning = np.zeros(3)
        omega = (self._start - self._rotor) / self.moments
        self._fastest = float(np.max((np.abs(self._start) + np.abs(self._rotor)) / self.moments))
        # Its terms cancel to rounding where the momentum stands still.
        speed, circling = float(np.linalg.norm(np.cross(self._start, omega))), self._circling()
        if speed <= 4.0 * _ROUNDING * self.magnitude * self._fastest:
            self.regime = "steady"
        elif circling is not None:
            self.regime, self._turning = "circle", circling
        else:
            self._find_orbit()

    def _find_orbit(self) -> None:
        """Find the curve, and the angle about the momentum."""
        size = self.magnitude
        rates, shift, start = 1.0 / self.moments, self._rotor / size, self._start / size
        orbit = gyrostat_orbit(rates, shift, start, size)
        axis = best_axis(orbit)
        twice = float((start - shift) @ (rates * (start - shift)))
        both = shift + axis
        numerator = size * np.append(rates * both, twice - both @ (rates * shift))
        self._orbit, self._axis, self._swing = orbit, axis, swing_about(orbit, axis, numerator)
        self._psi = float(self._swing.angle(np.zeros(1))[0])
        self._opposite = so3.quat_inverse(_shortest(start, axis))
        if orbit.complement == 0.0:
            self.regime = "separatrix"
        else:
            self.regime = "one of two ovals" if orbit.is_oscillating else "one oval"

    def _circling(self) -> Array | None:
        """Rate of x(t) = exp(-t rate) x(0) where the curve is a circle of constant rate, else None."""
        least, middle, most = self.moments
        rotor, start = self._rotor, self._start
        close = _ROUNDING * most
        if most - least <= close:
            return -rotor / most
        for axis, equal in ((0, most - middle), (2, middle - least)):
            across = np.delete(rotor, axis)
            if equal <= close and np.abs(across).max() <= _ROUNDING * np.abs(rotor).max():
                return ((start - rotor)[axis] / self.moments[axis] - start[axis] / middle) * np.eye(3)[axis]
        return None

    def __repr__(self) -> str:  # noqa: D105
        moments = ", ".join(f"{moment:.6g}" for moment in self.moments)
        rotor = ", ".join(f"{value:.6g}" for value in self.rotor)
        return f"Gyrostat(moments=({moments}) kg m^2, rotor=({rotor}) kg m^2/s, {self.regime})"

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) of either sign -> (..., 3), body axes [kg m^2/s]."""
        times = self._times(t)
        return self.magnitude * (self._directions(times) @ self.axes.T)

    def angular_velocity(self, t: ArrayLike) -> Array:
        """omega(t) = I^-1 (Pi(t) - h): times (...) -> (..., 3), body axes [rad/s]."""
        return ((self.body_momentum(t) - self.rotor) @ self.axes / self.moments) @ self.axes.T

    def attitude(self, t: ArrayLike) -> Array:
        """R(t), body axes to inertial axes: times (...) -> (..., 3, 3)."""
        return so3.matrix_from_quat(self.quat_xyzw(t))

    def quat_xyzw(self, t: ArrayLike) -> Array:
        """The attitude as quaternions x y z w with w >= 0: times (...) -> (..., 4)."""
        times = self._times(t)
        if self._orbit is None or self._swing is None:
            omega = (self._start - self._rotor) / self.moments
            rates = omega - self._turning, self._turning
            inner = so3.quat_product(*(so3.quat_from_matrix(so3.exp(times[..., None] * rate)) for rate in rates))
        else:
            psi = self._swing.angle(times.ravel()).reshape(times.shape) - self._psi
            turn = np.concatenate([np.sin(0.5 * psi)[..., None] * self._axis, np.cos(0.5 * psi)[..., None]], axis=-1)
            inner = so3.quat_product(turn, _shortest(self._directions(times), self._axis))
            inner = so3.quat_product(np.broadcast_to(self._opposite, inner.shape), inner)
        ends = so3.quat_from_matrix(self._outward), so3.quat_inverse(so3.quat_from_matrix(self.axes))
        left, right = (np.broadcast_to(end, inner.shape) for end in ends)
        return so3.positive_scalar(so3.normalised(so3.quat_product(so3.quat_product(left, inner), right)))

    @property
    def magnitude(self) -> float:
        """|Pi| [kg m^2/s]."""
        return float(np.linalg.norm(self.momentum))

    @property
    def energy(self) -> float:
        """omega.I omega/2, the energy without the rotor's own, which is constant [J]."""
        return 0.5 * float(np.sum((self._start - self._rotor) ** 2 / self.moments))

    @property
    def complement(self) -> float:
        """m1 = 1 - k^2 of the elliptic functions: 1 for small ovals, 0 on a separatrix; 1 where none are needed."""
        return 1.0 if self._orbit is None else self._orbit.complement

    @property
    def period(self) -> float:
        """Period of Pi in the body [s]; infinite on a separatrix and where it stands still."""
        if self._orbit is None:
            rate = float(np.linalg.norm(self._turning))
            return 2.0 * np.pi / rate if rate else np.inf
        return 2.0 * self._orbit.half_period

    @property
    def phase(self) -> float:
        """The angle of R(t + T) = exp(angle mu^) R(t), T the period, in (-pi, pi] [rad]; 0 without a finite period."""
        if not np.isfinite(self.period) or not self.magnitude:
            return 0.0
        turned = self.attitude(self.period) @ self.initial_attitude.T
        return float(so3.log(turned) @ self.momentum) / self.magnitude

    def _times(self, t: ArrayLike) -> Array:
        return times_within_turns(t, 1.0 / self._fastest if self._fastest else np.inf)

    def _directions(self, times: Array) -> Array:
        """x in principal axes."""
        if self._orbit is not None:
            return self._orbit.directions(times)
        start = self._start / (self.magnitude or 1.0)
        return so3.apply(so3.exp(-times[..., None] * self._turning), start)


def _shortest(directions: Array, axis: Array) -> Array:
    """Quaternions of the shortest turns that take unit vectors to an axis: (..., 3), (3,) -> (..., 4)."""
    scalar = 1.0 + directions @ axis
    return so3.normalised(np.concatenate([np.cross(directions, axis), scalar[..., None]], axis=-1))
