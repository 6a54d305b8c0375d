"""The free rigid body as a pendulum, and the pendulum's motion in Jacobi's functions.

On an elliptic cylinder K = r^2/2 in the space of body momenta,

    Pi_1 = k_1 r cos(theta),  Pi_2 = k_2 r sin(theta),  Pi_3 = p,

N = p^2/2 + (k_2 r)^2/(2 k_3^2) sin^2(theta) is a pendulum's energy, and the angle obeys
theta'' = -r^2/(2 k_1^2 k_3^2) sin(2 theta). 1, 2, 3 are the body's principal axes in an order that can be chosen; the
order of ascending moments, used everywhere else, is also the book's in section 15.11. The third axis must have the
largest or the smallest moment; then the same formulas hold with 1/k_1^2 = |1/I_1 - 1/I_3|, 1/k_2^2 = |1/I_2 - 1/I_3|
and, of either sign, 1/k_3^2 = k_1^2 (1/k_1^2 - 1/k_2^2); and theta' = sigma p/(k_1 k_2), where sigma is 1 for an even
order of the axes with the largest moment last, and changes sign with either.

Momenta along the third axis, where r = 0, have no angle: they are the equilibria that this cylinder leaves out, and
another choice of the third axis has them.

Source: Marsden and Ratiu, section 15.11, whose time runs backwards (theory.md M-E11); N2 to N8, N10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprf

from .. import elliptic
from ..arguments import moments_argument, vector_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import ascending_moments
from ..letters import value_text
from ._arguments import check_entries, together

_FAINT = 1e-140  # of the largest component of a momentum: squares of smaller ones underflow


@dataclass(frozen=True)
class PendulumEquilibrium:
    """Steady rotation as an equilibrium of the pendulum, p = 0. Made by `RigidBodyPendulum.equilibria`."""

    angle: float
    """theta [rad]: 0, pi/2, pi or 3 pi/2."""
    axis: int
    """The principal axis, 0 to 2 as the moments were given, that the momentum is along."""
    sign: int
    """1 or -1, the momentum's direction along it."""
    stability: str
    """"stable", "unstable", or "neutral" where the other two moments are equal and theta does not accelerate."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class RigidBodyPendulum:
    """Coordinates (r, theta, p) of body momenta on elliptic cylinders. Made by `rigid_body_pendulum`."""

    moments: Array
    """(3,) principal moments as given [kg m^2]."""
    axes: tuple[int, int, int]
    """Which of the principal axes are called 1, 2, 3; the cylinders are about the third."""
    k1: float  #: k_1 [sqrt(kg) m]: Pi_1 = k_1 r cos(theta).
    k2: float
    """k_2 [sqrt(kg) m]: Pi_2 = k_2 r sin(theta)."""
    inverse_square_k3: float
    """1/k_3^2: N = p^2/2 + (k_2 r)^2/(2 k_3^2) sin^2(theta). Negative if theta = 0 is the unstable one."""
    stiffness: float
    """1/(k_1 k_3)^2 = 1/k_1^2 - 1/k_2^2, so that theta'' = -stiffness r^2/2 sin(2 theta)."""
    orientation: float
    """sigma, 1 or -1: theta' = sigma p/(k_1 k_2)."""

    __repr__ = short_repr

    def coordinates(self, momentum: ArrayLike) -> tuple[Array, Array, Array]:
        """r, theta in (-pi, pi] and p of body momenta: (..., 3) -> (...), (...) [rad], (...) [kg m^2/s].

        Source: Marsden and Ratiu (15.11.12).
        Raises ShapeError if a momentum is along the third axis, where the angle is undefined, or is not three finite
        numbers.
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        first, second, third = np.moveaxis(pi[..., list(self.axes)], -1, 0)
        requirement = f"along the cylinders' axis {self.axes[2]} theta is undefined; put another axis last"
        check_entries((first == 0.0) & (second == 0.0), pi, "momentum", requirement)
        cosine, sine = first / self.k1, second / self.k2
        # Adding zero takes the sign off a zero, of which arctan2 would make minus a half turn.
        return np.hypot(cosine, sine), np.arctan2(sine + 0.0, cosine), third

    def body_momentum(self, r: ArrayLike, theta: ArrayLike, p: ArrayLike) -> Array:
        """Pi of r, theta and p, the inverse of `coordinates`: (...) each -> (..., 3) [kg m^2/s]."""
        r, theta, p = together(r=r, theta=theta, p=p)
        pi = np.empty((*p.shape, 3))
        pi[..., self.axes[0]] = self.k1 * r * np.cos(theta)
        pi[..., self.axes[1]] = self.k2 * r * np.sin(theta)
        pi[..., self.axes[2]] = p
        return pi

    def hamiltonian(self, r: ArrayLike, theta: ArrayLike, p: ArrayLike) -> Array:
        """N = p^2/2 + (k_2 r)^2/(2 k_3^2) sin^2(theta), constant along a motion: (...) each -> (...).

        Source: Marsden and Ratiu (15.11.13).
        """
        r, theta, p = together(r=r, theta=theta, p=p)
        return 0.5 * (p * p + (self.k2 * r * np.sin(theta)) ** 2 * self.inverse_square_k3)

    def rates(self, r: ArrayLike, theta: ArrayLike, p: ArrayLike) -> tuple[Array, Array]:
        """theta' and p', Hamilton's equations of N with the bracket {theta, p} = sigma/(k_1 k_2): (...) each.

        Source: Marsden and Ratiu (15.11.16), (15.11.17) with time reversed; theory.md M-E11.
        """
        r, theta, p = together(r=r, theta=theta, p=p)
        slope = (self.k2 * r) ** 2 * self.inverse_square_k3 * np.sin(theta) * np.cos(theta)
        return self.angle_momentum_bracket * p, -self.angle_momentum_bracket * slope

    def acceleration(self, r: ArrayLike, theta: ArrayLike) -> Array:
        """theta'' = -stiffness r^2/2 sin(2 theta), the pendulum equation: (...), (...) -> (...) [rad/s^2].

        Source: Marsden and Ratiu (15.11.18), the same forwards and backwards in time.
        """
        r, theta = together(r=r, theta=theta)
        return -0.5 * self.stiffness * r * r * np.sin(2.0 * theta)

    @property
    def angle_momentum_bracket(self) -> float:
        """{theta, p} = sigma/(k_1 k_2), so that F' = {F, N}; the book's {p, theta} = 1/(k_1 k_2) is its opposite.

        Source: Marsden and Ratiu (15.11.14), (15.11.15); theory.md M-E11.
        """
        return self.orientation / (self.k1 * self.k2)

    @property
    def symplectic_density(self) -> float:
        """sigma k_1 k_2, the leaf's symplectic form by d theta ^ dp: its area element over |grad K|, up to the sign.

        Source: Marsden and Ratiu, exercise 15.11-1.
        """
        return self.orientation * self.k1 * self.k2

    @property
    def equilibria(self) -> tuple[PendulumEquilibrium, ...]:
        """The four equilibria of every cylinder r > 0, along its axes 1 and 2.

        Source: Marsden and Ratiu, after corollary 15.11.2.
        """
        kinds = {1.0: ("stable", "unstable"), 0.0: ("neutral", "neutral"), -1.0: ("unstable", "stable")}
        pair = kinds[float(np.sign(self.stiffness))]
        return tuple(
            PendulumEquilibrium(
                angle=0.5 * np.pi * k, axis=self.axes[k % 2], sign=1 if k < 2 else -1, stability=pair[k % 2]
            )
            for k in range(4)
        )

    def motion(self, momentum: ArrayLike) -> PendulumMotion:
        """The motion in closed form from a body momentum (3,) at t = 0 [kg m^2/s].

        The distance from the separatrix is computed in exact arithmetic, so a motion next to it is as accurate as any.

        Source: Marsden and Ratiu (15.11.18); the pendulum's solution in Jacobi's functions is standard.
        Raises ShapeError for a momentum along the third axis, or with a part below 1e-140 of its largest that is not
        zero.
        """
        pi = vector_argument(momentum, "momentum", unit="kg m^2/s")
        r, _, _ = self.coordinates(pi)
        faint = (pi != 0.0) & (np.abs(pi) < _FAINT * np.max(np.abs(pi)))
        if faint.any():
            raise ShapeError(f"momentum: {pi} has parts below {_FAINT:g} of the largest; make them zero, or larger")
        # By the angle delta from a stable equilibrium: delta'^2 + W sin^2(delta) = nu^2, W = |stiffness| r^2.
        # In units of the largest momentum and the least moment, so that nothing overflows.
        largest, least = float(np.max(np.abs(pi))), float(np.min(self.moments))
        x, y, z = (Fraction(float(pi[i])) / Fraction(largest) for i in self.axes)
        a1, a2, a3 = (Fraction(least) / Fraction(float(self.moments[i])) for i in self.axes)
        u, v = abs(a1 - a3), abs(a2 - a3)
        swapped = u < v
        if swapped:
            x, y, u, v = y, x, v, u
        restoring = (u - v) * (u * x * x + v * y * y)
        total = v * (u * z * z + (u - v) * y * y)
        gap = u * ((u - v) * x * x - v * z * z)
        unit = largest / least
        nu, well, speed = (_root(square) * unit for square in (total, restoring, u * v * z * z))
        share = v * y * y / (u * x * x + v * y * y)
        # delta is counted from pi/2 where 2 is the stable axis: its cosine goes with Pi_2, its sine with -Pi_1.
        quarter = (1 if swapped else 0) + (2 if x < 0 else 0)
        side = (-1.0 if (y < 0) != swapped else 1.0) * (-1.0 if x < 0 else 1.0)
        sine, cosine = side * _root(share), _root(1 - share)
        direction = -1.0 if self.orientation * float(z) < 0.0 else 1.0
        regime, complement, swing = "rotation", 1.0, 1.0
        rate, start = nu, (sine, cosine, 1.0)
        if z == 0 and (restoring == 0 or x == 0 or y == 0):
            regime = "equilibrium"
            if restoring > 0:
                quarter += 0 if y == 0 else int(side)
                rate, swing, start = (well if y == 0 else 0.0), 0.0, (0.0, 1.0, 1.0)
        elif gap > 0:
            regime, complement, swing = "libration", float(gap / restoring), nu / well
            rate, start = well, (side * _root((u - v) * v * y * y / total), speed / nu, cosine)
        elif gap < 0:
            complement, start = float(-gap / total), (sine, cosine, speed / nu)
        else:
            regime, complement, start = "separatrix", 0.0, (sine, cosine, cosine)
        sn, cn, dn = start
        phase = sn * float(elliprf(cn * cn, dn * dn, 1.0))
        centre = quarter if quarter < 2 or (quarter == 2 and sn <= 0.0) else quarter - 4
        return PendulumMotion(
            pendulum=self,
            radius=float(r),
            regime=regime,
            rate=direction * rate,
            complement=complement,
            phase=phase,
            swing=swing,
            centre=0.5 * np.pi * centre,
        )


@dataclass(frozen=True, eq=False)
class PendulumMotion:
    """Motion of the pendulum, and of the rigid body, in closed form. Made by `RigidBodyPendulum.motion`."""

    pendulum: RigidBodyPendulum  #: The pendulum that moves.
    radius: float
    """r, of the cylinder."""
    regime: str
    """"libration" about a stable equilibrium, "rotation" of theta, "separatrix" or "equilibrium"."""
    rate: float
    """Argument of Jacobi's functions per second [rad/s], with the sign of theta' at t = 0 (0 there: positive)."""
    complement: float
    """m1 = 1 - k^2 of the modulus k."""
    phase: float
    """Argument of Jacobi's functions at t = 0."""
    swing: float
    """The sine of the largest angle from the stable equilibrium; 0 at an equilibrium, 1 where theta rotates."""
    centre: float
    """The equilibrium angle that Jacobi's amplitude is counted from, a multiple of pi/2 [rad]."""

    __repr__ = short_repr

    @property
    def modulus(self) -> float:
        """k of Jacobi's functions."""
        return float(np.sqrt(1.0 - self.complement))

    @property
    def period(self) -> float:
        """Period of Pi, 4 K(k)/|rate| [s]: a libration, or a turn of theta; infinite on the separatrix and at rest."""
        if self.regime == "separatrix" or self.rate == 0.0:
            return float("inf")
        return float(4.0 * elliptic.complete_k(self.complement) / abs(self.rate))

    def angle(self, time: ArrayLike) -> Array:
        """theta, continuous in time: (...) [s] -> (...) [rad]; in [-pi, pi] at t = 0.

        Raises ShapeError for times that are not finite, or longer than 1e12 periods; so do all methods.
        """
        sn, _, dn, am = self._jacobi(time)
        return self.centre + (np.arctan2(self.swing * sn, dn) if self._swings else am)

    def momentum(self, time: ArrayLike) -> Array:
        """p, the momentum's part along the third axis: (...) [s] -> (...) [kg m^2/s]."""
        _, cn, dn, _ = self._jacobi(time)
        return self._peak * (cn if self._swings else dn)

    def body_momentum(self, time: ArrayLike) -> Array:
        """Pi(t): (...) [s] -> (..., 3) [kg m^2/s]."""
        sn, cn, dn, _ = self._jacobi(time)
        pendulum, r = self.pendulum, self.radius
        sine, cosine = (self.swing * sn, dn) if self._swings else (sn, cn)
        # Quarter turns are exact, which the sine and cosine of a rounded angle are not.
        for _ in range(round(2.0 * self.centre / np.pi) % 4):
            sine, cosine = cosine, -sine
        pi = np.empty((*np.shape(sine), 3))
        pi[..., pendulum.axes[0]] = pendulum.k1 * r * cosine
        pi[..., pendulum.axes[1]] = pendulum.k2 * r * sine
        pi[..., pendulum.axes[2]] = self._peak * (cn if self._swings else dn)
        return pi

    @property
    def _swings(self) -> bool:
        """True if sn is the sine of delta divided by its maximum, else sn is the sine itself."""
        return self.regime == "libration" or self.swing == 0.0

    @property
    def _peak(self) -> float:
        """The largest p, with its sign at t = 0."""
        return self.pendulum.symplectic_density * self.rate * self.swing

    def _jacobi(self, time: ArrayLike) -> tuple[Array, Array, Array, Array]:
        t = finite_array(time, "time", unit="s")
        return elliptic.jacobi(self.phase + self.rate * t, self.complement)


def rigid_body_pendulum(moments: ArrayLike, axes: Sequence[int] | None = None) -> RigidBodyPendulum:
    """The pendulum of a rigid body with given principal moments.

    Equation :eq:`pendulum` of the documentation.
    Source: Marsden and Ratiu (15.11.7) to (15.11.13).
    Raises ShapeError if the moments are all equal (then every momentum is at rest), or the third axis is the
    intermediate one or shares its moment with another: K is then not an elliptic cylinder.

    Parameters
    ----------
    moments : (3,) [kg m^2], any order; momenta have their components in the same order
    axes : which of them, 0 to 2, are called 1, 2, 3. None: ascending, as in the book; where the two largest are equal
        descending, so that the third differs from the others

    Examples
    --------
    >>> pendulum = sp.rigid_body.rigid_body_pendulum([1.0, 2.0, 3.0])
    >>> pendulum.axes, round(pendulum.stiffness, 6)
    ((0, 1, 2), 0.5)
    """
    values = moments_argument(moments)
    if values.min() == values.max():
        raise ShapeError(f"moments: all are {values[0]:.17g}; every body momentum is then at rest, and K is zero")
    if axes is None:
        ascending, order, _ = ascending_moments(values)
        order = order if ascending[1] < ascending[2] else order[::-1]
    else:
        order = np.asarray(axes)
        if order.shape != (3,) or sorted(order.tolist()) != [0, 1, 2]:
            raise ShapeError(f"axes: got {value_text(axes)}; expected an order of 0, 1, 2")
    first, second, third = (int(i) for i in order)
    inverse = [1 / Fraction(float(value)) for value in values]
    by_first, by_second = inverse[first] - inverse[third], inverse[second] - inverse[third]
    if by_first * by_second <= 0:
        raise ShapeError(
            f"axes: {(first, second, third)} puts axis {third} last, whose moment {values[third]:.17g} of {values} "
            "must be the largest or the smallest and no other's, so that K is an elliptic cylinder"
        )
    even = (second - first) % 3 == 1
    sign = 1.0 if (by_first > 0) == even else -1.0
    stiffness = abs(by_first) - abs(by_second)
    return RigidBodyPendulum(
        moments=values,
        axes=(first, second, third),
        k1=float(abs(by_first)) ** -0.5,
        k2=float(abs(by_second)) ** -0.5,
        inverse_square_k3=float(stiffness / abs(by_first)),
        stiffness=float(stiffness),
        orientation=sign,
    )


def _root(value: Fraction) -> float:
    return float(np.sqrt(float(value)))
