"""What examples of deforming bodies are made of: motions in closed form, and the clocks they go by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad_vec
from scipy.optimize import root_scalar

from .. import so3
from ..arrays import Array, finite_array
from ..deformation.deformation import Deformation, prescribed
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError
from ..rigid_body.euler_top import EulerTop

_FARTHEST = 2.0**30
_QUADRATURE = 1e-11


class KnownMotion(Protocol):
    """A motion in closed form; times (...)."""

    def attitude(self, t: ArrayLike, /) -> Array:
        """R(t): -> (..., 3, 3)."""
        ...

    def body_momentum(self, t: ArrayLike, /) -> Array:
        """Pi(t): -> (..., 3) [kg m^2/s]."""
        ...


@dataclass(frozen=True, eq=False)
class Example:
    """A deformation, a momentum, and what is known about the motion they make.

    Attributes
    ----------
    deformation : what moves
    momentum : (3,) inertial axes, which are the body's axes at the start [kg m^2/s]
    known : the motion in closed form, or None
    phase : theta_M of the whole duration in the base gauge, where Pi is back at its start then; modulo 2 pi [rad]
    turn : the angle of the whole rotation at the end, where the example is known by it [rad]
    rigid : the body frozen at the start, where the example is compared with it
    """

    deformation: Deformation
    momentum: Array
    known: KnownMotion | None = None
    phase: float | None = None
    turn: float | None = None
    rigid: EulerTop | None = None


@dataclass(frozen=True, eq=False)
class TimeReparametrisedRigid:
    """A body that moves as a rigid one does, by a clock of its own: R(t) = R_RB(tau(t)), Pi(t) = Pi_RB(tau(t))."""

    top: EulerTop
    clock: Callable[[Array], Array]

    def attitude(self, t: ArrayLike) -> Array:
        """R(t): times (...) -> (..., 3, 3)."""
        return self.top.attitude(self.clock(_times(t)))

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) -> (..., 3) [kg m^2/s]."""
        return self.top.body_momentum(self.clock(_times(t)))


@dataclass(frozen=True, eq=False)
class AxialMotion:
    """A body with moments (A(t), B(t), B(t)): R(t) = exp(b(t) hat(mu)) exp(Pi_1 (a(t) - b(t)) hat(e_1)).

    a and b are the integrals of 1/A and 1/B from 0 to t, mu the momentum and Pi_1 its part along the axis, which stays.

    Attributes
    ----------
    momentum : (3,) [kg m^2/s]
    axial, transverse : a and b, times (...) -> (...) [1/(kg m^2/s)]
    """

    momentum: Array
    axial: Callable[[Array], Array]
    transverse: Callable[[Array], Array]

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
        """The turn of the body about its axis, against which Pi goes round it: times (...) -> (...) [rad]."""
        times = _times(t)
        return self.momentum[0] * (self.axial(times) - self.transverse(times))


@dataclass(frozen=True, eq=False)
class Scale:
    """A factor a(t) by which all distances in a body grow, and the time tau = int a^-2 dt by which it then turns.

    Attributes
    ----------
    factor : times (...) -> (...), above 0
    clock : times (...) -> (...) [s]; None: by quadrature
    """

    factor: Callable[[Array], ArrayLike]
    clock: Callable[[Array], Array] | None = None

    def at(self, times: Array) -> Array:
        """The factor: (...) -> (...). Raises ShapeError for another shape, or where it is not above 0."""
        values = finite_array(self.factor(times), "scale")
        if values.shape != times.shape or np.any(values <= 0.0):
            raise ShapeError(f"the scale must return numbers above 0 of shape {times.shape}, got {values}")
        return values


def pulsation(amount: float = 0.5, period: float = 3.0) -> Scale:
    """a^-2 = 1 + amount sin(2 pi t/period), 0 < |amount| < 1: tau = t + amount period (1 − cos)/(2 pi)."""
    pace = 2.0 * np.pi / positive(period, "period", "s")
    if not 0.0 < abs(amount) < 1.0:
        raise ShapeError(f"amount: a number between −1 and 1, not 0, is needed, got {amount!r}")
    return Scale(
        lambda t: 1.0 / np.sqrt(1.0 + amount * np.sin(pace * t)),
        lambda t: t + 2.0 * amount / pace * np.sin(0.5 * pace * t) ** 2,
    )


def expansion(rate: float = 0.02) -> Scale:
    """a = 1 + rate t [1/s]: tau = t/(1 + rate t), below 1/rate for all time: it turns so far."""
    pace = positive(rate, "rate", "1/s")
    return Scale(lambda t: 1.0 + pace * t, lambda t: t / (1.0 + pace * t))


@dataclass(frozen=True, eq=False)
class SteadyTurn:
    """A body that turns evenly about its momentum: R(t) = exp(t hat(omega)), Pi constant.

    Attributes
    ----------
    momentum : (3,) [kg m^2/s]
    angular_velocity : (3,), along the momentum [rad/s]
    """

    momentum: Array
    angular_velocity: Array

    def attitude(self, t: ArrayLike) -> Array:
        """R(t): times (...) -> (..., 3, 3)."""
        return so3.exp(_times(t)[..., None] * self.angular_velocity)

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t): times (...) -> (..., 3) [kg m^2/s]."""
        return np.broadcast_to(self.momentum, (*_times(t).shape, 3)).copy()


def diagonal(moments: Callable[[Array], Array], duration: float, breaks: ArrayLike, on_unphysical: str) -> Deformation:
    """The deformation whose principal axes stay, from its moments: times (N,) -> (N, 3) [kg m^2]."""
    return prescribed(lambda t: moments(t)[:, :, None] * np.eye(3), None, duration, breaks, on_unphysical=on_unphysical)


def clock_of(scale: Scale, duration: float) -> Callable[[Array], Array]:
    """The clock of a scale. Raises TrajectoryError where the one given is not the integral of a^-2."""
    if scale.clock is None:
        return _clock_by_quadrature(scale.at)
    times, step = duration * np.array([0.123, 0.456, 0.789]), 1e-7 * duration
    pace = (scale.clock(times + step) - scale.clock(times - step)) / (2.0 * step)
    start = float(scale.clock(np.zeros(())))
    if abs(start) > 1e-9 * duration or not np.allclose(pace * scale.at(times) ** 2, 1.0, rtol=0.0, atol=1e-3):
        raise TrajectoryError(
            f"the clock of the scale must be the integral of a^-2 from 0; it starts at {start:.6g} s and runs "
            f"{pace * scale.at(times) ** 2} times as fast at t = {times} s; leave it out to have it computed"
        )
    return scale.clock


def _clock_by_quadrature(factor: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """The integral of a^-2 from 0 to t for an array of times, all in one adaptive quadrature."""

    def clock(times: Array) -> Array:
        value, error = quad_vec(
            lambda s: times * factor(times * s) ** -2.0, 0.0, 1.0, epsabs=1e-14, epsrel=1e-14, limit=500
        )
        scale = np.linalg.norm(value) + 1.0
        if not error <= _QUADRATURE * scale:
            raise AccuracyNotReached(
                f"the scale is too rough for quadrature: its clock is known to {error:.3g} s only; give the clock"
            )
        return value

    return clock


def first_time(function: Callable[[Array], Array], target: float, guess: float) -> float:
    """When a growing function of time, 0 at 0, reaches the target."""
    late = guess
    while late < _FARTHEST * guess:
        if function(np.asarray(late)) >= target:
            bracket = (0.0, late)
            return float(
                root_scalar(lambda t: float(function(np.asarray(t)) - target), bracket=bracket, xtol=1e-14).root
            )
        late *= 2.0
    raise TrajectoryError("the momentum does not come back to its start in the body; give a duration [s]")


def _times(t: ArrayLike) -> Array:
    return finite_array(t, "t", unit="s")


def momentum_argument(value: ArrayLike) -> Array:
    """A momentum (3,). Raises ShapeError."""
    return _three(value, "momentum", "kg m^2/s")


def _three(value: ArrayLike, name: str, unit: str) -> Array:
    array = finite_array(value, name, (3,), unit=unit).copy()
    if array.ndim != 1:
        raise ShapeError(f"{name}: (3,) is needed, got {array.shape}; make an example for each")
    return array


def positive(value: float, name: str, unit: str) -> float:
    """A number above 0. Raises ShapeError."""
    number = finite_array(value, name, unit=unit)
    if number.ndim or number <= 0.0:
        raise ShapeError(f"{name}: a number above 0 [{unit}] is needed, got {value!r}")
    return float(number)
