"""Distributions by name, and the random numbers of a case: seed, axis and index of the case give them."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from .. import so3
from ..arrays import Array, Integers, finite_array
from ..display import short_repr
from ..errors import ShapeError

Numbers = float | Sequence[float]

_FARTHEST_DRAWN = 10.0
"""Deviations from the mean; once in 1e23 draws one lies farther."""


class Distribution(Protocol):
    """What is drawn for every case."""

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        ...

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        ...


@dataclass(frozen=True)
class Normal:
    """Normal numbers, each independent of the others.

    Of an attitude they are a rotation vector in rad, by which the start is turned about its own axes.

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

    __repr__ = short_repr

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        return np.asarray(self.mean) + np.asarray(self.deviation) * rng.standard_normal(shape)

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        mean = _fitting(f"mean of {name}", self.mean, shape)
        deviation = _fitting(f"deviation of {name}", self.deviation, shape)
        if np.any(deviation < 0.0):
            raise ShapeError(f"deviation of {name}: 0 or more is needed, got {self.deviation}")
        _check_drawn(name, lambda: np.abs(mean) + _FARTHEST_DRAWN * deviation)


@dataclass(frozen=True)
class LogNormal:
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

    deviation: Numbers
    median: Numbers = 1.0

    __repr__ = short_repr

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        return np.asarray(self.median) * np.exp(np.asarray(self.deviation) * rng.standard_normal(shape))

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        for what, value in (("deviation", self.deviation), ("median", self.median)):
            if np.any(_fitting(f"{what} of {name}", value, shape) < 0.0):
                raise ShapeError(f"{what} of {name}: 0 or more is needed, got {value}")
        _check_drawn(name, lambda: np.asarray(self.median) * np.exp(_FARTHEST_DRAWN * np.asarray(self.deviation)))


@dataclass(frozen=True)
class Uniform:
    """Numbers that are anywhere between two ends with the same probability.

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

    __repr__ = short_repr

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        low = np.asarray(self.low)
        return low + (np.asarray(self.high) - low) * rng.random(shape)

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        if np.any(_fitting(f"high of {name}", self.high, shape) < _fitting(f"low of {name}", self.low, shape)):
            raise ShapeError(f"{name}: the high end lies below the low one, {self.high} and {self.low}")
        _check_drawn(name, lambda: np.asarray(self.high) - np.asarray(self.low))


@dataclass(frozen=True)
class Choice:
    """One of some values, each with the same probability.

    Attributes
    ----------
    values : (n, ...) they are, in the unit of what is drawn

    Examples
    --------
    >>> over = {"tolerance": sp.study.Choice([1e-9, 1e-7])}
    >>> study = sp.study.Study("cat", "cat_righting", over, draws=100)
    >>> study.case(7).tolerance
    1e-09
    """

    values: Sequence[Any]

    __repr__ = short_repr

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        values = np.asarray(self.values, dtype=float)
        return np.broadcast_to(values[rng.integers(len(values))], shape).copy()

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        values = finite_array(self.values, f"values of {name}")
        if not values.ndim or not len(values) or values.shape[1:] not in ((), shape):
            raise ShapeError(f"values of {name}: some of shape {shape} are needed, got {values.shape}")


@dataclass(frozen=True)
class Directions:
    """Vectors of one magnitude in all directions, evenly: of the momentum.

    Attributes
    ----------
    magnitude : [kg m^2/s]

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum": sp.study.Directions(0.1)}, draws=100)
    >>> print(np.linalg.norm(study.case(7).momentum).round(12))
    0.1
    """

    magnitude: float

    __repr__ = short_repr

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        return self.magnitude * so3.normalised(rng.standard_normal(shape))

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        _fitting(f"magnitude of {name}", self.magnitude, ())
        if shape != (3,):
            raise ShapeError(f"{name}: directions are of vectors, this has the shape {shape}")


@dataclass(frozen=True)
class Rotations:
    """Attitudes at the start, all alike probable (the invariant measure of the rotations).

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"attitude": sp.study.Rotations()}, draws=100)
    >>> print(sp.so3.quat_from_matrix(study.case(7).attitude).round(4))
    [ 0.2377 -0.8969  0.2214  0.3001]
    """

    __repr__ = short_repr

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """One value of this shape."""
        return so3.normalised(rng.standard_normal(shape))

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise ShapeError where it cannot give such values."""
        if shape != (4,):
            raise ShapeError(f"{name}: rotations are drawn of attitudes only")


DISTRIBUTIONS = {
    "normal": Normal,
    "lognormal": LogNormal,
    "uniform": Uniform,
    "choice": Choice,
    "directions": Directions,
    "rotations": Rotations,
}
"""Their names in a file."""


def generators(seed: int, axis: str, cases: Integers) -> Iterator[np.random.Generator]:
    """The generator of each case, at the start of its random numbers: it is one object, turned to the next case.

    The key of Philox is made of the seed and the name of the axis, its counter of the index of the case.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=(zlib.crc32(axis.encode()),))
    source = np.random.Philox(key=sequence.generate_state(2, np.uint64))
    generator = np.random.Generator(source)
    state: Any = source.state
    counter = state["state"]["counter"]
    for index in cases.tolist():
        # The third word: a case may draw 2^128 numbers before it meets the next.
        counter[:] = (0, 0, index, 0)
        state |= {"buffer_pos": 4, "has_uint32": 0, "uinteger": 0}
        source.state = state
        yield generator


def drawn_values(seed: int, axis: str, cases: Integers, what: Distribution, shape: tuple[int, ...]) -> Array:
    """The values of an axis in some cases: (N,) + shape."""
    values = np.empty((len(cases), *shape))
    for row, rng in enumerate(generators(seed, axis, cases)):
        values[row] = what.drawn(rng, shape)
    return values


def _check_drawn(name: str, largest: Callable[[], Array]) -> None:
    """Raise ShapeError where what is drawn may be larger than any number."""
    with np.errstate(over="ignore"):
        if not np.isfinite(largest()).all():
            raise ShapeError(f"{name}: it is spread so widely that no number holds what may be drawn")


def _fitting(name: str, value: Numbers, shape: tuple[int, ...]) -> Array:
    array = finite_array(value, name)
    try:
        fits = np.broadcast_shapes(array.shape, shape) == shape
    except ValueError:
        fits = False
    if not fits:
        raise ShapeError(f"{name}: one number or an array {shape} is needed, got {array.shape}")
    return array
