"""Building blocks of the examples: motions in closed form, and the time scales of bodies that change size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from .. import so3
from ..arguments import number_argument, vector_argument
from ..arrays import Array, finite_array
from ..deformation.deformation import Deformation, prescribed
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError
from ..letters import value_text
from ..rigid_body.euler_top import EulerTop

_MAX_STRETCH = 2.0**30  # of the first guess of a time, up to which a function has to reach its target
_CHECK_STEP = 1e-7  # of the duration, for differences of a given clock: their error is about 1e-9
_CHECK_RATE = 1e-3  # of the rate of a given clock: finds any wrong formula, and passes an interpolated clock
_CHECK_START = 1e-9  # of the duration, for the start of a given clock


class KnownMotion(Protocol):
    """A motion in closed form; times (...).

    Made by `homothety`.
    """

    def attitude(self, t: ArrayLike, /) -> Array:
        """R(t): -> (..., 3, 3)."""
        ...

    def body_momentum(self, t: ArrayLike, /) -> Array:
        """Pi(t): -> (..., 3) [kg m^2/s]."""
        ...


@dataclass(frozen=True, eq=False)
class Example:
    """A deformation, a momentum, and known facts about the motion that results.

    Made by `homothety`.

    Attributes
    ----------
    deformation : of the body
    momentum : (3,) inertial axes, which are the body's axes at the start [kg m^2/s]
    known : the motion in closed form, or None
    phase : theta_M of the whole duration in the base gauge, modulo 2 pi, if Pi is back at its start by then [rad]
    turn : the angle of the total rotation, if known [rad]
    rigid : the rigid body with the inertia of the start, if the example is compared with it
    """

    deformation: Deformation
    momentum: Array
    known: KnownMotion | None = None
    phase: float | None = None
    turn: float | None = None
    rigid: EulerTop | None = None

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class TimeReparametrisedRigid:
    """A rigid body's motion in a time of its own: R(t) = R_RB(tau(t)), Pi(t) = Pi_RB(tau(t)).

    Made by `homothety`.

    Attributes
    ----------
    top : the rigid body
    clock : tau, times (...) -> (...) [s]
    """

    top: EulerTop
    clock: Callable[[Array], Array]

    __repr__ = short_repr

    def attitude(self, t: ArrayLike) -> Array:
        """R(t): times (...) -> (..., 3, 3)."""
        return self.top.attitude(self.clock(_times(t)))

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) -> (..., 3) [kg m^2/s]."""
        return self.top.body_momentum(self.clock(_times(t)))


@dataclass(frozen=True, eq=False)
class AxialMotion:
    """A body with moments (A(t), B(t), B(t)): R(t) = exp(b(t) hat(mu)) exp(Pi_1 (a(t) - b(t)) hat(e_1)).

    Made by `axial_stretch`.

    a and b are the integrals of 1/A and 1/B from 0 to t, mu the momentum and Pi_1 its constant part along the axis.

    Attributes
    ----------
    momentum : (3,) [kg m^2/s]
    axial, transverse : a and b, times (...) -> (...) [1/(kg m^2/s)]
    """

    momentum: Array
    axial: Callable[[Array], Array]
    transverse: Callable[[Array], Array]

    __repr__ = short_repr

    def attitude(self, t: ArrayLike) -> Array:
        """R(t): times (...) -> (..., 3, 3)."""
        times = _times(t)
        precession = self.transverse(times)[..., None] * self.momentum
        return so3.exp(precession) @ so3.exp(self.azimuth(times)[..., None] * np.array([1.0, 0.0, 0.0]))

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) -> (..., 3) [kg m^2/s]."""
        back = so3.exp(-self.azimuth(t)[..., None] * np.array([1.0, 0.0, 0.0]))
        return so3.apply(back, np.broadcast_to(self.momentum, (*back.shape[:-2], 3)))

    def azimuth(self, t: ArrayLike) -> Array:
        """The rotation of the body about its axis, opposite to that of Pi: times (...) -> (...) [rad]."""
        times = _times(t)
        return self.momentum[0] * (self.axial(times) - self.transverse(times))


@dataclass(frozen=True, eq=False)
class Scale:
    """A factor a(t) by which all distances in a body grow, and the time tau = int a^-2 dt of its rotation.

    Made by `pulsation`.

    Attributes
    ----------
    factor : times (...) -> (...), above 0
    clock : times (...) -> (...) [s]
    """

    factor: Callable[[Array], ArrayLike]
    clock: Callable[[Array], Array]

    __repr__ = short_repr

    def at(self, times: Array) -> Array:
        """The factor: (...) -> (...). Raises ShapeError for another shape, or where it is not above 0."""
        values = finite_array(self.factor(times), "scale")
        if values.shape != times.shape or np.any(values <= 0.0):
            raise ShapeError(f"the scale must return numbers above 0 of shape {times.shape}, got {values}")
        return values


def pulsation(amount: float = 0.5, period: float = 3.0) -> Scale:
    """a^-2 = 1 + amount sin(2 pi t/period), 0 < |amount| < 1: tau = t + amount period (1 − cos)/(2 pi).

    Raises
    ------
    ShapeError
        If the amount is not between -1 and 1, or is 0.

    Examples
    --------
    >>> print(f"{sp.examples.pulsation(0.5, 3.0).clock(np.array(3.0)):.9f}")  # after a period the time itself
    3.000000000
    """
    amount = number_argument(amount, "amount")
    frequency = 2.0 * np.pi / positive(period, "period", "s")
    if not 0.0 < abs(amount) < 1.0:
        raise ShapeError(f"amount: a number between −1 and 1, not 0, is needed, got {value_text(amount)}")
    return Scale(
        factor=lambda t: 1.0 / np.sqrt(1.0 + amount * np.sin(frequency * t)),
        clock=lambda t: t + 2.0 * amount / frequency * np.sin(0.5 * frequency * t) ** 2,
    )


def expansion(rate: float = 0.02) -> Scale:
    """a = 1 + rate t, rate in 1/s: tau = t/(1 + rate t) stays below 1/rate, and the rotation is finite.

    Examples
    --------
    >>> float(sp.examples.expansion(0.02).factor(np.array(10.0)))  # 1 + 0.02 * 10
    1.2
    """
    speed = positive(rate, "rate", "1/s")
    return Scale(factor=lambda t: 1.0 + speed * t, clock=lambda t: t / (1.0 + speed * t))


@dataclass(frozen=True, eq=False)
class SteadyTurn:
    """Steady rotation about the momentum: R(t) = exp(t hat(omega)), Pi constant.

    Made by `furniture`.

    Attributes
    ----------
    momentum : (3,) [kg m^2/s]
    angular_velocity : (3,), along the momentum [rad/s]
    """

    momentum: Array
    angular_velocity: Array

    __repr__ = short_repr

    def attitude(self, t: ArrayLike) -> Array:
        """R(t): times (...) -> (..., 3, 3)."""
        return so3.exp(_times(t)[..., None] * self.angular_velocity)

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) -> (..., 3) [kg m^2/s]."""
        return np.broadcast_to(self.momentum, (*_times(t).shape, 3)).copy()


def diagonal(moments: Callable[[Array], Array], duration: float, breaks: ArrayLike, on_unphysical: str) -> Deformation:
    """The deformation with fixed principal axes and these moments: times (N,) -> (N, 3) [kg m^2]."""
    return prescribed(lambda t: moments(t)[:, :, None] * np.eye(3), None, duration, breaks, on_unphysical=on_unphysical)


def clock_of(scale: Scale, duration: float) -> Callable[[Array], Array]:
    """The clock of a scale. Raises TrajectoryError if the given one is not the integral of a^-2."""
    times, step = duration * np.array([0.123, 0.456, 0.789]), _CHECK_STEP * duration
    rate = (scale.clock(times + step) - scale.clock(times - step)) / (2.0 * step)
    start = float(scale.clock(np.zeros(())))
    ratio = rate * scale.at(times) ** 2
    if abs(start) > _CHECK_START * duration or not np.allclose(ratio, 1.0, rtol=0.0, atol=_CHECK_RATE):
        raise TrajectoryError(
            f"the clock of the scale must be the integral of a^-2 from 0; it starts at {start:.6g} s and runs "
            f"{ratio} times as fast at t = {times} s"
        )
    return scale.clock


def first_time(function: Callable[[Array], Array], target: float, guess: float) -> float:
    """The time at which an increasing function of time, 0 at 0, reaches the target."""
    late = guess
    while late < _MAX_STRETCH * guess:
        if function(np.asarray(late)) >= target:
            bracket = (0.0, late)
            return float(
                root_scalar(lambda t: float(function(np.asarray(t)) - target), bracket=bracket, xtol=1e-14).root
            )
        late *= 2.0
    raise TrajectoryError("the body momentum does not come back to its start; give a duration [s]")


def _times(t: ArrayLike) -> Array:
    return finite_array(t, "t", unit="s")


def momentum_argument(value: ArrayLike) -> Array:
    """A user's momentum (3,) [kg m^2/s]. Raises ShapeError."""
    return vector_argument(value, "momentum", unit="kg m^2/s").copy()


def positive(value: float, name: str, unit: str) -> float:
    """A user's number, checked to be above 0. Raises ShapeError."""
    number = finite_array(value, name, unit=unit)
    if number.ndim or number <= 0.0:
        raise ShapeError(f"{name}: a number above 0 [{unit}] is needed, got {value_text(value)}")
    return float(number)
