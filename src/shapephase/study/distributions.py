"""Distributions by name, and the random numbers of a case, which seed, axis and index of the case determine."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .. import so3
from ..arrays import Array, Integers, finite_array
from ..display import short_repr
from ..errors import ShapeError

Numbers = float | Sequence[float]

_MOST = 1e100  # of parameters: no draw overflows, nor the square of one


class Distribution:
    """Base of the distributions, which are dataclasses of their parameters."""

    _most_deviation: ClassVar[float] = _MOST
    _only: ClassVar[tuple[tuple[int, ...], str] | None] = None  # shape and name of all that can be drawn, if limited

    __repr__ = short_repr

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where values of this shape cannot be drawn."""
        if self._only is not None and self._only[0] != shape:
            raise ShapeError(f"{name}: {type(self).__name__} are drawn of {self._only[1]} only")
        for parameter, given in vars(self).items():
            value = finite_array(given, f"{parameter} of {name}")
            if not self._fits(value.shape, shape):
                raise ShapeError(f"{parameter} of {name}: one number or an array {shape} is needed, got {value.shape}")
            if parameter in ("deviation", "median") and np.any(value < 0.0):
                raise ShapeError(f"{parameter} of {name}: 0 or more is needed, got {given}")
            if np.any(np.abs(value) > (self._most_deviation if parameter == "deviation" else _MOST)):
                raise ShapeError(f"{name}: it is spread so widely that no number holds what may be drawn")

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        raise NotImplementedError

    def _fits(self, given: tuple[int, ...], shape: tuple[int, ...]) -> bool:
        matching = zip(reversed(given), reversed(shape), strict=False)
        return len(given) <= len(shape) and all(length in (1, expected) for length, expected in matching)


@dataclass(frozen=True, repr=False)
class Normal(Distribution):
    """Independent normal numbers; for an attitude a rotation vector in rad, which turns the start about its own axes.

    Attributes
    ----------
    mean, deviation : one for all entries, or one for each, in the unit of what is drawn

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum": sp.study.Normal([0.0, 0.0, 0.1], 0.02)}, draws=100)
    >>> print(study.case(7).momentum.round(4))
    [0.0515 0.018  0.111 ]
    """

    mean: Numbers = 0.0
    deviation: Numbers = 1.0

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        return np.asarray(self.mean) + np.asarray(self.deviation) * rng.standard_normal(shape)


@dataclass(frozen=True, repr=False)
class LogNormal(Distribution):
    """Positive numbers whose logarithm is normal: factors of masses and inertias, which stay physical.

    Attributes
    ----------
    deviation : of the logarithm, without unit; for small ones the relative standard deviation
    median : in the unit of what is drawn

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"masses": sp.study.LogNormal(0.05)}, draws=100)
    >>> print(study.case(7).masses.round(3)[:4], study.case(7).masses.min() > 0.0)
    [0.979 1.026 1.065 0.944] True
    """

    _most_deviation = 10.0  # the logarithm of a draw is below 100 but for one in 1e23

    deviation: Numbers
    median: Numbers = 1.0

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        return np.asarray(self.median) * np.exp(np.asarray(self.deviation) * rng.standard_normal(shape))


@dataclass(frozen=True, repr=False)
class Uniform(Distribution):
    """Numbers between two ends, all equally probable.

    Attributes
    ----------
    low, high : the ends, one for all entries or one for each, in the unit of what is drawn

    Examples
    --------
    >>> over = {"beta": sp.study.Uniform(0.3, 1.2)}
    >>> study = sp.study.Study("cat_two_halves", "kane_scher", over, parameters={"alpha": 0.0}, draws=100)
    >>> print(f"{study.case(7).parameters['beta']:.4f}")
    1.0881
    """

    low: Numbers
    high: Numbers

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        return np.asarray(self.low) + (np.asarray(self.high) - np.asarray(self.low)) * rng.random(shape)

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where values of this shape cannot be drawn."""
        super().check(name, shape)
        if np.any(np.asarray(self.high) < np.asarray(self.low)):
            raise ShapeError(f"{name}: the high end lies below the low one, {self.high} and {self.low}")


@dataclass(frozen=True, repr=False)
class Choice(Distribution):
    """One of some values, all equally probable.

    Attributes
    ----------
    values : (n, ...) in the unit of what is drawn

    Examples
    --------
    >>> over = {"tolerance": sp.study.Choice([1e-9, 1e-7])}
    >>> study = sp.study.Study("cat", "cat_righting", over, draws=100)
    >>> study.case(7).tolerance
    1e-09
    """

    values: Sequence[Any]

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        values = np.asarray(self.values, dtype=float)
        return np.broadcast_to(values[rng.integers(len(values))], shape).copy()

    def _fits(self, given: tuple[int, ...], shape: tuple[int, ...]) -> bool:
        return bool(given and given[0]) and given[1:] in ((), shape)


@dataclass(frozen=True, repr=False)
class Directions(Distribution):
    """Vectors of one magnitude, such as momenta, with evenly distributed directions.

    Attributes
    ----------
    magnitude : [kg m^2/s]

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum": sp.study.Directions(0.1)}, draws=100)
    >>> print(np.linalg.norm(study.case(7).momentum).round(12))
    0.1
    """

    _only = (3,), "vectors"
    magnitude: float

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        return self.magnitude * so3.normalised(rng.standard_normal(shape))

    def _fits(self, given: tuple[int, ...], shape: tuple[int, ...]) -> bool:
        return not given and bool(shape)


@dataclass(frozen=True, repr=False)
class Rotations(Distribution):
    """Evenly distributed attitudes at the start (the invariant measure of the rotations).

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"attitude": sp.study.Rotations()}, draws=100)
    >>> print(sp.so3.quat_from_matrix(study.case(7).attitude).round(4))
    [ 0.2377 -0.8969  0.2214  0.3001]
    """

    _only = (4,), "attitudes"

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        return so3.normalised(rng.standard_normal(shape))


DISTRIBUTIONS = {kind.__name__.lower(): kind for kind in (Normal, LogNormal, Uniform, Choice, Directions, Rotations)}
"""Their names in a file."""


def generators(seed: int, axis: str, cases: Integers) -> Iterator[np.random.Generator]:
    """Yield the generator of each case, at the start of its random numbers: one object, reset for the next case.

    The key of Philox is made of the seed and the name of the axis, its counter of the index of the case.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=(zlib.crc32(axis.encode()),))
    source = np.random.Philox(key=sequence.generate_state(2, np.uint64))
    generator = np.random.Generator(source)
    state: Any = source.state
    for index in cases.tolist():
        # The third word: a case may draw 2^128 numbers before it meets the next.
        state["state"]["counter"][:] = (0, 0, index, 0)
        source.state = state | {"buffer_pos": 4, "has_uint32": 0, "uinteger": 0}
        yield generator


def drawn_values(seed: int, axis: str, cases: Integers, source: Distribution, shape: tuple[int, ...]) -> Array:
    """Return the values of an axis in some cases: (N,) + shape."""
    values = np.empty((len(cases), *shape))
    for row, rng in enumerate(generators(seed, axis, cases)):
        values[row] = source._draw(rng, shape)
    return values
