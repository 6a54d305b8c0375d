"""Left-invariant metrics on SO(3), Riemannian and sub-Riemannian: geodesics, exponential map and its differential.

The length of a curve of attitudes R, R' = R hat(u), is the integral of sqrt(u.I u). With Pi = I u the momentum of
Pontryagin's principle, the shortest curves are the motions of a free rigid body of inertia I,

    Pi' = Pi x u,   u = a Pi,   a = I^-1,   H = Pi.a Pi/2,

and their speed is sqrt(2 H): with H = 1/2 time is length. A moment may be infinite: then its component of u is
forbidden, a has a zero, and the metric is sub-Riemannian. `momentum_flow` has both cases in one closed form.

Principal moments ascend, I_1 <= I_2 <= I_3, so that an infinite one is I_3. Inertias, momenta and attitudes are in the
caller's body axes.

Sources: Bonnard, Cots and Shcherbakova 2013, section 3; theory.md Q1-Q6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import inertia_argument, moments_argument, whole_argument
from ...arrays import Array, common_batch, finite_array, real_array
from ...display import short_repr
from ...errors import ShapeError
from ...inertia_tensor import ascending_moments, principal_axes
from .._arguments import TWELVE_DIGITS, check_entries
from ._conjugate_search import conjugate_times
from ._momentum_flow import attitude_flow, exponential_derivative


@dataclass(frozen=True, eq=False)
class LeftInvariantMetric:
    """Left-invariant metric on SO(3). Made by `left_invariant_metric`.

    Momenta are those at the start, in body axes, and the geodesics start at the identity: by left invariance the one
    that starts at R_0 is R_0 times it. Leading axes of momenta and times broadcast. Everything raises `ShapeError` for
    momenta or times of the wrong shape or not finite.
    """

    moments: Array
    """(3,) principal moments, ascending [kg m^2]; infinite where the direction is forbidden."""
    axes: Array
    """(3, 3) whose columns are the principal axes in body axes, determinant +1."""
    inverse_moments: Array
    """(3,) a_i = 1/I_i, descending [1/(kg m^2)]; 0 where the direction is forbidden."""

    __repr__ = short_repr

    @property
    def is_sub_riemannian(self) -> bool:
        """True if a direction is forbidden."""
        return bool(self.inverse_moments[2] == 0.0)

    def angular_velocity(self, momentum: ArrayLike) -> Array:
        """u = a Pi, which maximises the pseudo-Hamiltonian: (..., 3) -> (..., 3), body axes [rad/s]."""
        return (self._principal(momentum) * self.inverse_moments) @ self.axes.T

    def pseudo_hamiltonian(self, momentum: ArrayLike, angular_velocity: ArrayLike) -> Array:
        """u.Pi − u.I u/2, of which the maximum over u is `hamiltonian`: (..., 3), (..., 3) -> (...) [J].

        Raises ShapeError if u has a component that the metric forbids.
        """
        pi, u = self._principal(momentum), self._principal(angular_velocity, "angular_velocity", "rad/s")
        if self.is_sub_riemannian and np.any(u[..., 2] != 0.0):
            raise ShapeError(
                f"angular_velocity: its component along {self.axes[:, 2]} must be 0, the metric forbids this direction"
            )
        weights = np.where(np.isfinite(self.moments), self.moments, 0.0)
        return np.sum(u * pi, axis=-1) - 0.5 * np.sum(weights * u * u, axis=-1)

    def hamiltonian(self, momentum: ArrayLike) -> Array:
        """H = Pi.a Pi/2, half of the square of the speed: (..., 3) -> (...) [J].

        Source: Bonnard et al. (2); section 3.2 for the sub-Riemannian one.
        """
        return 0.5 * np.sum(self.inverse_moments * self._principal(momentum) ** 2, axis=-1)

    def speed(self, momentum: ArrayLike) -> Array:
        """sqrt(2 H), length per time: (..., 3) -> (...)."""
        return np.sqrt(2.0 * self.hamiltonian(momentum))

    def unit_speed(self, momentum: ArrayLike) -> Array:
        """The momentum of the same direction with H = 1/2: (..., 3) -> (..., 3).

        Raises ShapeError where H is 0: at zero momentum, and along the forbidden direction, to which no geodesic
        belongs.
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        return pi / self._moving(pi)[..., None]

    def momentum_rate(self, momentum: ArrayLike) -> Array:
        """Pi' = Pi x a Pi, Euler's equation: (..., 3) -> (..., 3), body axes [kg m^2/s^2].

        Source: Bonnard et al. (3), whose commutators have the opposite sign of AB − BA (theory.md B-E2).
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        return np.cross(pi, self.angular_velocity(pi))

    def attitude(self, momentum: ArrayLike, t: ArrayLike = 1.0) -> Array:
        """R(t) of the geodesic, at t = 1 the exponential map: (..., 3), (...) -> (..., 3, 3)."""
        pi, times, batch = self._flat(momentum, t)
        return (self.axes @ attitude_flow(self.inverse_moments, pi, times) @ self.axes.T).reshape(*batch, 3, 3)

    def body_momentum(self, momentum: ArrayLike, t: ArrayLike) -> Array:
        """Pi(t) = R(t)^T Pi(0): (..., 3), (...) -> (..., 3), body axes [kg m^2/s].

        R Pi, the lift of the right-invariant fields, is conserved. Source: Bonnard et al., proposition 5.
        """
        start = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        return so3.apply(so3.transpose(self.attitude(start, t)), start)

    def differential(self, momentum: ArrayLike, t: ArrayLike = 1.0) -> Array:
        """Z with delta R = R hat(Z delta Pi), of the attitude at t by the momentum: (..., 3), (...) -> (..., 3, 3).

        Its columns are Jacobi fields in body axes [1/(kg m^2/s)]; conjugate times are the zeros of det Z.

        Source: theory.md Q6; `exponential_derivative`.
        """
        pi, times, batch = self._flat(momentum, t)
        derivative = exponential_derivative(self.inverse_moments, pi, times)
        return (self.axes @ derivative @ self.axes.T).reshape(*batch, 3, 3)

    def conjugate_time(self, momentum: ArrayLike, order: int = 1) -> Array:
        """Time of the geodesic's first conjugate point, or of its `order`-th: (..., 3) -> (...) [s].

        Points where two Jacobi fields vanish count twice. Right to about 1e-13 of the time.

        Source: theory.md Q6; `conjugate_times`.

        Raises ShapeError where H is 0; AccuracyNotReached if none is found in ten thousand steps of the search, because
        the moments are too unequal.
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        self._moving(pi)
        count = whole_argument(order, "order", 1)
        times = conjugate_times(self.inverse_moments, pi.reshape(-1, 3) @ self.axes, count)
        return times.reshape(pi.shape[:-1])[()]

    def conjugate_locus(self, momentum: ArrayLike, order: int = 1) -> Array:
        """The conjugate points of the identity along these geodesics: (..., 3) -> (..., 3, 3)."""
        return self.attitude(momentum, self.conjugate_time(momentum, order))

    def _principal(self, value: ArrayLike, name: str = "momentum", unit: str = "kg m^2/s") -> Array:
        return finite_array(value, name, (3,), unit=unit) @ self.axes

    def _moving(self, momentum: Array) -> Array:
        """The speeds; raises unless all are above 0."""
        speed = self.speed(momentum)
        still = ~(speed > TWELVE_DIGITS * np.sqrt(self.inverse_moments[0]) * np.linalg.norm(momentum, axis=-1))
        forbidden = f", nor along the forbidden direction {self.axes[:, 2]}" if self.is_sub_riemannian else ""
        check_entries(still, momentum, "momentum", "nothing moves with it; it must not be zero" + forbidden)
        return speed

    def _flat(self, momentum: ArrayLike, t: ArrayLike) -> tuple[Array, Array, tuple[int, ...]]:
        pi, times = self._principal(momentum), finite_array(t, "t", unit="s")
        batch = common_batch(momentum=pi.shape[:-1], t=times.shape)
        return np.broadcast_to(pi, (*batch, 3)).reshape(-1, 3), np.broadcast_to(times, batch).reshape(-1), batch


def left_invariant_metric(inertia: ArrayLike) -> LeftInvariantMetric:
    """The metric u.I u of an inertia, or of principal moments one of which may be infinite.

    Raises ShapeError for another shape, moments not positive, or more than one infinite.

    Parameters
    ----------
    inertia : (3,) principal moments about the three body axes, in any order, one of them `inf` for the sub-Riemannian
        metric that forbids turns about this axis; or a tensor (3, 3), symmetric positive definite [kg m^2]

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 1.0, 1.0])
    >>> print(f"{metric.conjugate_time(np.array([0.6, 0.0, 0.8])):.9f} = 2 pi")  # of a round body
    6.283185307 = 2 pi
    """
    values = real_array(inertia, "inertia", "kg m^2")
    if values.shape == (3, 3):
        moments, axes = principal_axes(inertia_argument(finite_array(values, "inertia")[None])[0])
        return LeftInvariantMetric(moments=moments, axes=axes, inverse_moments=1.0 / moments)
    if values.shape != (3,):
        raise ShapeError(f"inertia: three principal moments (3,) or a tensor (3, 3) are needed, got {values.shape}")
    infinite = values == np.inf
    if infinite.sum() > 1:
        raise ShapeError(
            f"inertia: at most one moment may be infinite, got {values}; turns about two axes at least must be allowed"
        )
    finite = moments_argument(np.where(infinite, values[~infinite].max(), values))
    # Read backwards, so that of equal moments the axis given first counts as that of the larger one.
    moments, order, parity = ascending_moments(np.where(infinite, np.inf, finite)[::-1])
    axes = np.eye(3)[::-1, order]
    axes[:, 1] *= -parity
    return LeftInvariantMetric(moments=moments, axes=axes, inverse_moments=1.0 / moments)
