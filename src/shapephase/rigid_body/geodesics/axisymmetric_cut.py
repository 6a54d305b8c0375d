"""The metric of an axisymmetric body on SO(3) in closed form: conjugate times, cut times, diameter, distances.

Moments (I_1, I_1, I_3) about axes named by the symmetry, the third the axis of symmetry, whichever moment is larger;
I_3 is infinite for the sub-Riemannian metric. With eta = I_1/I_3 − 1 >= −1, p_3 the axial part of
the momentum's direction, tau = t |Pi|/(2 I_1) and beta = eta p_3 tau, the geodesic in quaternions is

    q_0 + i q_3 = exp(i beta) (cos tau + i p_3 sin tau),   |q_1 + i q_2| = sqrt(1 − p_3²) sin tau.

It is shortest up to its cut time, the earlier of tau = pi and q_0 = 0, where it meets its mirror image or, by q and −q,
the one from the other side.

Sources: Bates and Fasso 2007 (conjugate points); Podobryaev and Sachkov 2016 (cut times, diameter); theory.md
section 7, Q6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from ... import so3
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...letters import value_text
from ...roots import bracketed_root, safe_newton

_PAST_END = 1e-8  # [rad] beside an end of a bracket that is a root itself


@dataclass(frozen=True)
class AxisymmetricMetric:
    """Metric of moments (I_1, I_1, I_3) in these axes. Made by `axisymmetric_metric`.

    Momenta are in body axes, axis 3 the axis of symmetry; they need not have unit speed, and times are theirs.
    """

    equatorial: float
    """I_1 [kg m^2]."""
    axial: float
    """I_3, infinite where turns about the axis are forbidden [kg m^2]."""

    __repr__ = short_repr

    @property
    def eta(self) -> float:
        """I_1/I_3 − 1, −1 for the sub-Riemannian metric; positive for bodies like a rod."""
        return self.equatorial / self.axial - 1.0

    @property
    def diameter(self) -> float:
        """The largest distance of two attitudes: pi sqrt(I_1), pi sqrt(I_3), or beyond I_3 = 2 I_1 less than that.

        Source: Podobryaev and Sachkov 2016; theory.md section 7.
        """
        if self.axial <= self.equatorial:
            return float(np.pi * np.sqrt(self.equatorial))
        if self.axial <= 2.0 * self.equatorial:
            return float(np.pi * np.sqrt(self.axial))
        ratio = self.equatorial / self.axial
        return float(np.pi * np.sqrt(self.equatorial * (3.0 - 4.0 * ratio) / (1.0 - ratio)))

    @property
    def diameter_on_su2(self) -> float:
        """The largest distance of two unit quaternions, where q and −q are two points.

        2 pi sqrt(I_1) for I_3 >= I_1, across the axis. Else the greatest length of a geodesic up to its cut, which is
        searched for by the axial part of its momentum.

        Source: Podobryaev 2018 for the question; the cut times are those of `cut_time_on_su2`.
        """
        if self.eta <= 0.0:
            return float(2.0 * np.pi * np.sqrt(self.equatorial))

        def length(axial: Array) -> Array:
            """Up to the cut, for axial parts of the momentum's direction."""
            stretch = np.sqrt(1.0 + self.eta * axial**2)
            return 2.0 * np.sqrt(self.equatorial) * self._first_root(axial, on_su2=True) * stretch

        samples = np.linspace(0.0, 1.0, 129)
        lengths = length(samples)
        best = int(np.argmax(lengths))
        low, high = samples[max(best - 1, 0)], samples[min(best + 1, len(samples) - 1)]
        found = minimize_scalar(lambda p: -float(length(np.asarray(p))), bounds=(low, high), method="bounded")
        return float(max(lengths[best], -found.fun))

    def conjugate_time(self, momentum: ArrayLike) -> Array:
        """Time of a geodesic's first conjugate point: (..., 3) -> (...) [s].

        tau = pi for I_3 >= I_1, where the geodesics of one p_3 meet; else the root in (pi/2, pi] of
        sin tau + kappa tau cos tau with kappa = eta (1 − p_3²)/(1 + eta p_3²), where their caustic is.

        Raises ShapeError if a momentum is not three finite numbers, or nothing moves with it; so do all methods.
        """
        axial, unit_time = self._direction(momentum)
        if self.eta <= 0.0:
            return np.pi * unit_time
        kappa = self.eta * (1.0 - axial) * (1.0 + axial) / (1.0 + self.eta * axial**2)
        flat = np.ravel(kappa)

        def step(rest: Array) -> tuple[Array, Array]:
            """Newton's step in pi − tau, in which the equation is increasing and convex."""
            value = rest - np.arctan(flat * (np.pi - rest))
            return value, rest - value / (1.0 + flat / (1.0 + (flat * (np.pi - rest)) ** 2))

        start = np.arctan(np.pi * flat)
        rest = safe_newton(step, start, np.zeros_like(flat), start).reshape(np.shape(kappa))
        return (np.pi - rest) * unit_time

    def cut_time(self, momentum: ArrayLike) -> Array:
        """Time up to which a geodesic is the shortest: (..., 3) -> (...) [s].

        tau = pi or the first zero of q_0, whichever comes first.
        """
        axial, unit_time = self._direction(momentum)
        return self._first_root(axial, on_su2=False) * unit_time

    def cut_time_on_su2(self, momentum: ArrayLike) -> Array:
        """Cut time on the unit quaternions, where q and −q are two points: (..., 3) -> (...) [s].

        tau = pi for I_3 >= I_1, else the first zero of q_3 if that is earlier.
        """
        axial, unit_time = self._direction(momentum)
        if self.eta <= 0.0:
            return np.pi * unit_time
        return self._first_root(axial, on_su2=True) * unit_time

    def distance_to_turn(self, angle: ArrayLike) -> Array:
        """The distance to a turn about the axis of symmetry by any angle [rad]: (...) -> (...).

        With alpha in [0, pi] the angle but for whole turns and sign: sqrt(I_3) alpha straight about the axis;
        from alpha = 2 pi (1 + eta) on, where eta < 0, by the geodesics with tau = pi,
        2 pi sqrt(I_1 (1 + (1 − alpha/(2 pi))²/eta)). Sub-Riemannian: sqrt(I_1 alpha (4 pi − alpha)).
        """
        alpha = np.abs(so3.wrap(finite_array(angle, "angle", unit="rad")))
        if self.eta < 0.0:
            part = alpha / (2.0 * np.pi)
            ratio = self.equatorial / self.axial
            bent = part >= ratio
            # 1 + (1 − part)²/eta without the difference of numbers near 1.
            square = np.where(bent, (part * (2.0 - part) - ratio) / (1.0 - ratio), 0.0)
            around = 2.0 * np.pi * np.sqrt(self.equatorial * square)
            if np.isinf(self.axial):
                return around
            return np.where(bent, around, np.sqrt(self.axial) * alpha)[()]
        return np.sqrt(self.axial) * alpha

    def distance(self, attitude: ArrayLike) -> Array:
        """The distance from the identity: (..., 3, 3) -> (...), the length of `shortest_momentum`'s geodesic."""
        return self._length(self.shortest_momentum(attitude))

    def shortest_momentum(self, attitude: ArrayLike) -> Array:
        """The momentum whose geodesic comes to the attitude at t = 1 by the shortest way: (..., 3, 3) -> (..., 3).

        The attitude leaves one unknown, the angle nu of cos tau + i p_3 sin tau, and before the cut the angle nu + beta
        of q_0 + i q_3 takes each value once. On the cut one of several shortest ways is chosen.
        """
        return self._shortest_of_each(so3.quat_from_matrix(so3.rotation_argument(attitude, "attitude")))

    def distance_on_su2(self, quat_xyzw: ArrayLike) -> Array:
        """The distance of unit quaternions from 1, where −1 is another point: (..., 4) -> (...)."""
        return self._length(self.shortest_momentum_on_su2(quat_xyzw))

    def shortest_momentum_on_su2(self, quat_xyzw: ArrayLike) -> Array:
        """The momentum of a shortest geodesic to a unit quaternion, not to its negative: (..., 4) -> (..., 3)."""
        so3.quat_argument(quat_xyzw, "quat_xyzw")
        return self._shortest_of_each(so3.normalised(np.asarray(quat_xyzw, dtype=float)))

    def _shortest_of_each(self, quats: Array) -> Array:
        flat = [self._shortest(quat) for quat in quats.reshape(-1, 4)]
        return np.array(flat).reshape(*quats.shape[:-1], 3)

    def _length(self, momentum: Array) -> Array:
        """Length of the geodesic in a unit of time."""
        equator, axis = np.sum(momentum[..., :2] ** 2, axis=-1), momentum[..., 2] ** 2
        return np.sqrt(equator / self.equatorial + axis / self.axial)

    def _shortest(self, quat: Array) -> Array:
        across, along = float(np.hypot(quat[0], quat[1])), float(np.hypot(quat[2], quat[3]))
        target = float(np.arctan2(abs(quat[2]), quat[3]))
        sign = -1.0 if quat[2] < 0.0 else 1.0
        if across == 0.0:
            return self._about_axis(target) * [1.0, 1.0, sign]

        def way(angle: float, side: float) -> tuple[float, float, float]:
            """sin tau, p_3 tau and the angle of q_0 + i q_3, at nu or pi − nu."""
            cosine, sine = side * along * np.cos(angle), float(np.hypot(across, along * np.sin(angle)))
            turn = float(along * np.sin(angle) / sine * np.arctan2(sine, cosine))
            return sine, turn, (angle if side > 0.0 else np.pi - angle) + self.eta * turn

        quarter = 0.5 * np.pi
        side = 1.0 if way(quarter, 1.0)[2] >= target else -1.0
        angle = 0.0
        if target > 0.0:
            # On SU(2)'s cut tau = pi − arcsin |q_1 + i q_2| solves it too, past the cut if the angle falls towards it.
            past = target == np.pi and way(_PAST_END, side)[2] > target
            angle = bracketed_root(lambda nu: way(nu, side)[2] - target, _PAST_END if past else 0.0, quarter)
        sine, turn, _ = way(angle, side)
        tau = float(np.arctan2(sine, side * along * np.cos(angle)))
        # tau near pi has fewer digits than its sine.
        flat = tau / sine * so3.apply(so3.exp(np.array([0.0, 0.0, sign * self.eta * turn])), quat[:3])
        return 2.0 * self.equatorial * np.array([flat[0], flat[1], sign * turn])

    def _about_axis(self, half: float) -> Array:
        """The momentum of a shortest way to the turn by 2 half about the axis."""
        ratio = self.equatorial / self.axial
        if half <= np.pi * ratio:
            return np.array([0.0, 0.0, 2.0 * self.axial * half if half else 0.0])
        # 1 − p_3, which may be small.
        rest = (half / np.pi - ratio) / (1.0 - ratio)
        return 2.0 * np.pi * self.equatorial * np.array([np.sqrt(rest * (2.0 - rest)), 0.0, 1.0 - rest])

    def _first_root(self, axial: Array, on_su2: bool) -> Array:
        """The first tau up to pi at which q_0 is 0, or on SU(2) q_3; else pi.

        q_0 is proportional to the cosine of tau + arctan(p_3 tan beta), q_3/p_3 to the sine of
        tau + arctan(tan beta/p_3), both angles followed along tau from 0; they grow.
        """
        shape, axial = np.shape(axial), np.ravel(np.abs(axial))
        target = np.pi if on_su2 else 0.5 * np.pi

        def step(tau: Array) -> tuple[Array, Array]:
            beta = self.eta * axial * tau
            sine, cosine = np.sin(beta), np.cos(beta)
            if on_su2:
                # sin(beta)/p_3, finite at p_3 = 0.
                ratio = self.eta * tau * np.sinc(beta / np.pi)
                lead = np.arctan2((1.0 - axial) * ratio * cosine, cosine**2 + sine * ratio)
                rate = 1.0 + self.eta / (cosine**2 + ratio**2)
            else:
                denominator = cosine**2 + axial**2 * sine**2
                lead = np.arctan2((axial - 1.0) * sine * cosine, cosine**2 + axial * sine**2)
                rate = 1.0 + self.eta * axial**2 / np.maximum(denominator, np.finfo(float).tiny)
            value = tau + beta + lead - target
            # Where the angle stands still the bracket is halved, as this step leaves it.
            return value, tau - value / np.maximum(rate, np.finfo(float).tiny)

        latest = np.full(axial.shape, np.pi)
        return safe_newton(step, latest, np.zeros(axial.shape), latest).reshape(shape)[()]

    def _direction(self, momentum: ArrayLike) -> tuple[Array, Array]:
        """p_3, and the time in which tau grows by 1 [s]."""
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        magnitude = np.linalg.norm(pi, axis=-1)
        across = np.hypot(pi[..., 0], pi[..., 1])
        if np.any(across == 0.0 if np.isinf(self.axial) else magnitude == 0.0):
            raise ShapeError(
                "momentum: nothing moves with zero momentum"
                + (", nor with one along the axis, the forbidden direction" if np.isinf(self.axial) else "")
            )
        return pi[..., 2] / magnitude, 2.0 * self.equatorial / magnitude


def axisymmetric_metric(equatorial: float, axial: float) -> AxisymmetricMetric:
    """The metric of moments (I_1, I_1, I_3), I_3 about the axis of symmetry, which is the third.

    Equation :eq:`conjugate-time` of the documentation.
    Raises ShapeError if a moment is not a number above 0, or I_1 is not finite.

    Parameters
    ----------
    equatorial : I_1 > 0 [kg m^2]
    axial : I_3 > 0 [kg m^2]; `inf` for the sub-Riemannian metric

    Examples
    --------
    >>> print(f"{sp.rigid_body.geodesics.axisymmetric_metric(2.0, 1.0).diameter:.9f} = pi sqrt(2)")
    4.442882938 = pi sqrt(2)
    """
    try:
        first, third = float(equatorial), float(axial)
    except (TypeError, ValueError):
        came = f"{value_text(equatorial)} and {value_text(axial)}"
        raise ShapeError(f"moments: two numbers are needed, got {came}") from None
    if not (0.0 < first < np.inf and third > 0.0):
        raise ShapeError(
            f"moments: the equatorial must be finite and above 0, the axial one above 0 or inf; got {first}, {third}"
        )
    return AxisymmetricMetric(equatorial=first, axial=third)
