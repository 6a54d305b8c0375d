"""Joints that follow others, by functions that a user or a file states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_choice, check_mapping, number_argument
from ...display import frozen
from ...errors import ShapeError
from ...letters import value_text
from . import functions
from .functions import JointFunction

_ENDS = ("not-a-knot", "natural", "four points")


@frozen
class Coupling:
    """A joint's coordinate as a sum of functions, each of the coordinate of one other joint.

    Made by `constant`, `linear`, `polynomial`, `spline`, `piecewise_linear` or `simm_spline`, and added with `+`.
    `Body.with_couplings` takes it. Functions are exact: they are polynomials between their knots, and beyond the first
    and the last knot they go on straight.

    Attributes
    ----------
    start : what is added to the functions [rad or m]
    terms : name of the joint that is followed, and the function

    Examples
    --------
    >>> knee = sp.body.Coupling.polynomial("flexion", [0.0, 0.02, -0.01])
    >>> knee.drivers, round(knee.at({"flexion": 0.5}), 6)
    (('flexion',), 0.0075)
    """

    start: float = 0.0
    terms: tuple[tuple[str, JointFunction], ...] = ()

    @staticmethod
    def constant(value: float) -> Coupling:
        """A joint that is locked at a coordinate [rad or m]."""
        return Coupling(number_argument(value, "value"))

    @staticmethod
    def linear(driver: str, multiplier: float, offset: float = 0.0) -> Coupling:
        """multiplier * driver + offset."""
        slope, start = number_argument(multiplier, "multiplier"), number_argument(offset, "offset")
        return Coupling(0.0, ((_name(driver), functions.polynomial(np.array([start, slope]))),))

    @staticmethod
    def polynomial(driver: str, coefficients: ArrayLike, about: float = 0.0) -> Coupling:
        """sum_p coefficients[p] (driver - about)^p.

        MuJoCo's joint equality `polycoef="a0 a1 a2 a3 a4"` of joints with references y0 and x0 is
        `Coupling.constant(y0) + Coupling.polynomial(x, [a0, a1, a2, a3, a4], about=x0)`.
        """
        return _of(driver, functions.polynomial(np.asarray(coefficients), number_argument(about, "about")))

    @staticmethod
    def spline(driver: str, knots: ArrayLike, values: ArrayLike, *, ends: str = "not-a-knot") -> Coupling:
        """The C2 cubic spline through points; beyond them it goes on straight.

        Parameters
        ----------
        knots, values : (m,) coordinates of the driver, ascending, and of the joint there [rad or m]
        ends : "not-a-knot", "natural", or "four points": the third derivative at an end is that of the cubic through
            the four points there
        """
        check_choice(ends, "ends", _ENDS)
        return _of(driver, functions.cubic_spline(np.asarray(knots), np.asarray(values), ends))

    @staticmethod
    def simm_spline(driver: str, knots: ArrayLike, values: ArrayLike) -> Coupling:
        """OpenSim's `SimmSpline`: a spline with the ends "four points"."""
        return Coupling.spline(driver, knots, values, ends="four points")

    @staticmethod
    def piecewise_linear(driver: str, knots: ArrayLike, values: ArrayLike) -> Coupling:
        """Straight between points, and on beyond them."""
        return _of(driver, functions.piecewise_linear(np.asarray(knots), np.asarray(values)))

    def __add__(self, other: Coupling) -> Coupling:
        """The sum of both."""
        if not isinstance(other, Coupling):
            return NotImplemented
        return Coupling(self.start + other.start, self.terms + other.terms)

    def scaled(self, factor: float) -> Coupling:
        """All of it times a number."""
        by = number_argument(factor, "factor")
        return Coupling(by * self.start, tuple((name, function.scaled(by)) for name, function in self.terms))

    @property
    def drivers(self) -> tuple[str, ...]:
        """The joints that are followed, each once."""
        return tuple(dict.fromkeys(name for name, _ in self.terms))

    def at(self, coordinates: dict[str, float]) -> float:
        """The coordinate where those of the drivers are known [rad or m]."""
        check_mapping(coordinates, "coordinates", "joint -> coordinate")
        values = (float(function(np.array(coordinates[name])).value) for name, function in self.terms)
        return self.start + sum(values)

    def rate(self, coordinates: dict[str, float], rates: dict[str, float]) -> float:
        """The rate where coordinates and rates of the drivers are known [rad/s or m/s]."""
        return sum(float(function(np.array(coordinates[name])).slope) * rates[name] for name, function in self.terms)


def circular(couplings: Mapping[str, Coupling]) -> str | None:
    """The first joint that follows itself, by way of others or not; None without any."""
    for name in couplings:
        reached, ahead = set[str](), {name}
        while ahead:
            ahead = {driver for joint in ahead & couplings.keys() for driver in couplings[joint].drivers} - reached
            reached |= ahead
        if name in reached:
            return name
    return None


def with_followers(
    couplings: Mapping[str, Coupling], shape: Mapping[str, float], rate: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """Coordinates and rates of independent joints and of those that follow them, none in a circle."""
    coordinates, rates = dict(shape), dict(rate)

    def add(name: str) -> None:
        if name in coordinates or name not in couplings:
            return
        for driver in couplings[name].drivers:
            add(driver)
        coordinates[name], rates[name] = couplings[name].at(coordinates), couplings[name].rate(coordinates, rates)

    for name in couplings:
        add(name)
    return coordinates, rates


def described(coupling: Coupling) -> str:
    """In a few words: '0.5 hip + 0.1', 'cubic in knee, 12 knots'."""
    if not coupling.terms:
        return f"locked at {coupling.start:.6g}"
    parts = [_words(name, function) for name, function in coupling.terms]
    return _added(parts + ([f"{coupling.start:.6g}"] if coupling.start else []))


def _words(name: str, function: JointFunction) -> str:
    powers = np.flatnonzero(np.any(function.coefficients != 0.0, axis=1))
    degree = int(powers.max()) if len(powers) else 0
    if len(function.knots):
        kind = f"{_DEGREES[degree]} in" if degree < len(_DEGREES) else f"degree {degree} in"
        return f"{kind} {name}, {len(function.knots)} knots"
    if degree > 1:
        return f"polynomial of degree {degree} in {name}"
    slope = float(function.coefficients[1, 0]) if degree else 0.0
    start = float(function.coefficients[0, 0]) - slope * float(function.centres[0])
    return _added([f"{slope:.6g} {name}", *([f"{start:.6g}"] if start else [])])


def _added(parts: list[str]) -> str:
    return " + ".join(parts).replace("+ -", "- ")


_DEGREES = ("constant", "piecewise linear", "quadratic", "cubic", "quartic", "quintic")


def _of(driver: str, function: JointFunction) -> Coupling:
    function.check_continuous()
    return Coupling(0.0, ((_name(driver), function),))


def _name(driver: object) -> str:
    if not isinstance(driver, str):
        raise ShapeError(f"driver: the name of a joint is needed, got {value_text(driver)}")
    return driver
