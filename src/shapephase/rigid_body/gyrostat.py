"""The gyrostat in closed form: a rigid body with a rotor inside, at any time, for every axis of the rotor.

The body's momentum is Pi = I omega + h with h fixed in the body, and Pi' = Pi x I^-1 (Pi - h). The curve of Pi is that
of `_gyrostat_orbit`; the attitude is, as for `EulerTop`,

    R(t) = R(0) Q(0)^T exp(psi e) Q(t),    psi' = omega.(x + e) / (1 + e.x),    x = Pi/|Pi|,

where Q(t) is the shortest turn that takes x to a unit vector e, and psi a sum of Legendre integrals of the third kind.

Sources: Volterra 1899; Wittenburg 1977, section 4.6; theory.md section 2 (equation of motion with constant L_o).

Steady rotations have omega along Pi: `gyrostat_equilibria` counts them, `bifurcation_rotors` has the rotors at which
their number changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import positive_argument, whole_argument
from ..arrays import Array, finite_array, lock_arrays
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import body_principal_axes
from ..roots import bracketed_root
from ._arguments import one_array, one_attitude, one_tensor, times_within_turns
from ._gyrostat_orbit import GyrostatOrbit, Swing, best_axis, gyrostat_orbit, swing_about

_ROUNDING = 4.0 * float(np.finfo(float).eps)  # relative difference of moments, or part of the rotor off their axis


class Gyrostat:
    """A free rigid body with a spinning rotor inside, whose momentum relative to the body is constant.

    Two wheels are described by this. One whose speed relative to the body is kept: `inertia` has the wheel in it, and
    `rotor` is its moment times that speed along its axle. One that turns freely, whose momentum about the axle p is
    constant: `inertia` is without the wheel's moment J about its axle, I - J a a^T, and `rotor` is p a.

    Raises AccuracyNotReached within some 3e-5 rad of a steady rotation, where the oval is so small that its digits are
    lost (below 1e-2 rad the error of the start grows as the inverse square of that angle), or for a body so nearly
    symmetric that it is nearly a circle; `reconstruct` with `prescribed` has no such limit.

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


@dataclass(frozen=True, eq=False)
class GyrostatEquilibrium:
    """Steady rotation of a gyrostat about its momentum. Made by `gyrostat_equilibria`."""

    direction: Array
    """(3,) of the momentum, body axes."""
    rate: float
    """Rate of the body about it, negative where it turns backward [rad/s]."""
    energy: float
    """omega.I omega/2 [J]."""
    stability: str
    """ "least energy", "most energy" or "saddle"; only the first withstands friction."""
    frequency: float
    """Frequency of small oscillations about a stable one, or rate of growth from a saddle [rad/s]."""

    __post_init__ = lock_arrays
    __repr__ = short_repr


def gyrostat_equilibria(inertia: ArrayLike, rotor: ArrayLike, magnitude: float) -> tuple[GyrostatEquilibrium, ...]:
    """The steady rotations with |Pi| = `magnitude`, by ascending energy: 6, 4 or 2 of them.

    There omega = r Pi/|Pi|, and with c = r/|Pi| and b = h/|Pi| the direction is x_i = a_i b_i/(a_i - c), a = 1/I, where
    the sum of x_i^2 is 1. Where a symmetric body has whole circles of them, two of each circle are given.

    Source: Wittenburg 1977, section 4.6.2; Hughes 1986, chapter 6.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2]
    rotor : (3,) momentum of the rotor, body axes [kg m^2/s]
    magnitude : of the momentum, above 0 [kg m^2/s]

    Examples
    --------
    >>> len(sp.rigid_body.gyrostat_equilibria(np.diag([1.0, 2.0, 3.0]), [1.0, 2.0, 1.0], 1.0))
    2
    """
    momentum = one_array(rotor, "rotor", (3,), "kg m^2/s")
    size = positive_argument(magnitude, "magnitude", "a momentum in kg m^2/s")
    moments, axes = body_principal_axes(one_tensor(inertia))
    a, b = 1.0 / moments, axes.T @ momentum / size
    b = np.where(np.abs(b) <= _ROUNDING * np.abs(b).max(), 0.0, b)
    equilibria = [_described(a, b, x, size, axes) for x in _directions(a, b)]
    return tuple(sorted(equilibria, key=lambda equilibrium: equilibrium.energy))


def bifurcation_rotors(inertia: ArrayLike, rotor_axis: ArrayLike) -> Array:
    """Momenta of a rotor about an axis, over |Pi|, at which the number of steady rotations changes: (k,) ascending.

    Source: the equation of `gyrostat_equilibria`, whose left side is convex between two of its poles.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2]
    rotor_axis : (3,) not zero, body axes

    Examples
    --------
    >>> sp.rigid_body.bifurcation_rotors(np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 1.0])  # |1 - I3/I|
    array([1., 3.])
    """
    moments, axes = body_principal_axes(one_tensor(inertia))
    n = axes.T @ _unit(rotor_axis)
    n = np.where(np.abs(n) <= _ROUNDING, 0.0, n)
    a = 1.0 / moments
    weights, poles = _poles(a, n)
    places = [_least(weights, poles, left, right) for left, right in pairwise(poles)] + _bare(a, n)
    return np.sort([1.0 / np.sqrt(np.sum(weights / (poles - place) ** 2)) for place in places])


@dataclass(frozen=True, eq=False)
class DualSpinTurn:
    """Turn of a body whose rotor slowly takes up all momentum. Made by `dual_spin_turn`."""

    rotor: Array
    """(N,) momentum of the rotor, from 0 to all of it [kg m^2/s]."""
    direction: Array
    """(N, 3) of the momentum in the body, from the axis of the largest moment to that of the rotor."""
    rate: Array
    """(N,) of the body about it [rad/s]."""

    __post_init__ = lock_arrays
    __repr__ = short_repr


def dual_spin_turn(inertia: ArrayLike, rotor_axis: ArrayLike, magnitude: float, count: int = 101) -> DualSpinTurn:
    """Turn of a body whose rotor slowly takes up all momentum, from a spin about the axis of the largest moment.

    The body stays in its steady rotation of least energy, which friction favours, and ends at rest with the rotor's
    axis along the momentum.

    Source: Kaplan 1976, section 5.4; Hughes 1986, chapter 6.
    Raises ShapeError if the rotor's axis is zero, or at right angles to that of the largest moment.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2]
    rotor_axis : (3,) body axes, not at right angles to the axis of the largest moment
    magnitude : of the momentum [kg m^2/s]
    count : of steps, 2 or more, evenly spaced in the body's rate

    Examples
    --------
    >>> turn = sp.rigid_body.dual_spin_turn(np.diag([1.0, 2.0, 3.0]), [1.0, 0.0, 1.0], 1.0, 3)
    >>> turn.rotor.round(6).tolist()
    [0.0, 0.606339, 1.0]
    """
    size = positive_argument(magnitude, "magnitude", "a momentum in kg m^2/s")
    steps = whole_argument(count, "count", 2)
    moments, axes = body_principal_axes(one_tensor(inertia))
    n, a = axes.T @ _unit(rotor_axis), 1.0 / moments
    if abs(n[2]) <= _ROUNDING:
        raise ShapeError("rotor_axis: it is at right angles to the axis of the largest moment, and nothing turns it")
    c = a[2] * np.linspace(1.0, 0.0, steps)
    # x_i = k a_i n_i/(a_i - c); both divided by the term that is infinite at the start.
    direction = a * n * (a[2] - c)[:, None] / np.where(np.arange(3) == 2, 1.0, a - c[:, None])
    direction[:, 2] = a[2] * n[2]
    length = np.linalg.norm(direction, axis=1)
    return DualSpinTurn(
        rotor=size * (a[2] - c) / length, direction=(direction / length[:, None]) @ axes.T, rate=size * c
    )


def _unit(axis: ArrayLike) -> Array:
    vector = finite_array(axis, "rotor_axis", (3,))
    length = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not length:
        raise ShapeError(f"rotor_axis: one direction (3,), not zero, is needed, got shape {vector.shape}")
    return vector / length


def _poles(a: Array, b: Array) -> tuple[Array, Array]:
    """Weights and poles, ascending, of the terms (a_i b_i)^2/(a_i - c)^2; terms of equal poles are added."""
    order = np.argsort(a)
    order = order[b[order] != 0.0]
    poles, squares = a[order], (a[order] * b[order]) ** 2
    first = np.diff(poles, prepend=-np.inf) > _ROUNDING * poles
    weights = np.bincount(np.cumsum(first) - 1, squares, int(first.sum())).astype(float)
    return weights, poles[first]


def _bare(a: Array, b: Array) -> list[float]:
    """Inverse moments of axes along which the rotor has no component, if they are not poles."""
    poles = a[b != 0.0]
    return [float(a[k]) for k in range(3) if b[k] == 0.0 and np.all(np.abs(poles - a[k]) > _ROUNDING * a[k])]


def _least(weights: Array, poles: Array, left: float, right: float) -> float:
    """Minimum of the sum between two poles, a root of its slope, which ascends."""

    inset = 1e-9 * (right - left)
    return bracketed_root(lambda place: float(np.sum(weights / (poles - place) ** 3)), left + inset, right - inset)


def _directions(a: Array, b: Array) -> list[Array]:
    """All x with x_i = a_i b_i/(a_i - c) and |x| = 1."""
    directions: list[Array] = []
    weights, poles = _poles(a, b)
    for place in _bare(a, b):
        others = np.abs(a - place) > _ROUNDING * a
        x = np.where(others, a * b / np.where(others, a - place, 1.0), 0.0)
        rest = 1.0 - float(x @ x)
        if rest > 0.0:
            free = int(np.argmin(np.abs(a - place)))
            directions += [x + sign * np.sqrt(rest) * np.eye(3)[free] for sign in (1.0, -1.0)]
    if not len(poles):
        return directions
    reach = float(np.sqrt(weights.sum()))
    # Each root by its distance from a pole, which keeps all digits: outside the poles, on both sides of each minimum.
    sides = [(poles[0], -1.0, reach), (poles[-1], 1.0, reach)]
    for left, right in pairwise(poles):
        middle = _least(weights, poles, left, right)
        if np.sum(weights / (poles - middle) ** 2) < 1.0:
            sides += [(left, 1.0, middle - left), (right, -1.0, right - middle)]
    for pole, side, far in sides:
        near = float(np.sqrt(weights[poles == pole][0]))
        gaps = poles - pole

        def excess(distance: float, gaps: Array = gaps, side: float = side) -> float:
            return float(np.sum(weights / (gaps - side * distance) ** 2)) - 1.0

        at = near if excess(near) <= 0.0 else bracketed_root(excess, near, far * (1.0 + _ROUNDING))
        x = a * b / np.where(b == 0.0, 1.0, (a - pole) - side * at)
        directions.append(x / np.linalg.norm(x))
    return directions


def _described(a: Array, b: Array, x: Array, magnitude: float, axes: Array) -> GyrostatEquilibrium:
    turning = a * (x - b)
    c = float(turning @ x)
    plane = np.linalg.svd(x[None])[2][1:]
    low, high = np.linalg.eigvalsh(plane @ np.diag(a - c) @ plane.T)
    stability = "saddle" if low * high < 0.0 else "least energy" if low + high > 0.0 else "most energy"
    return GyrostatEquilibrium(
        direction=axes @ x,
        rate=magnitude * c,
        energy=0.5 * magnitude**2 * float(np.sum(a * (x - b) ** 2)),
        stability=stability,
        frequency=magnitude * float(np.sqrt(abs(low * high))),
    )
