"""Shapes and their rates as functions of time: what shape paths are made of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_picklable
from ..arrays import Array, Integers, Mask, check_reach, lock_arrays, real_array
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError

CLOSED = 1e-9  # [rad or m] largest gap of a loop: files are written with ten digits or more
_WHOLE_TURN = 2.0 * np.pi
_MOST_REPEATED = 100_000  # knots of a repeated loop that are written out


class Curve(Protocol):
    """Shapes and rates at times of [0, duration]: (N,) -> (N, n), (N, n)."""

    def __call__(self, times: Array, /) -> tuple[Array, Array]:
        """Shapes and their rates."""
        ...


class Swings(NamedTuple):
    """Bound of the changes of a curve, known before it is sampled.

    most : how often it can swing between two breaks, an upper bound; 0: nothing moves; None: unknown
    smooth_loop : True if it also goes smoothly from its end to its start
    """

    most: float | None = None
    smooth_loop: bool = False


def most_swings(counts: Sequence[float | None]) -> float | None:
    """Return the largest of some upper bounds; None where one is unknown."""
    known = [count for count in counts if count is not None]
    return max(known, default=0.0) if len(known) == len(counts) else None


class _Known:
    """Base of curves: prints in a line, arrays that nobody changes, swings unknown."""

    __repr__ = short_repr
    __post_init__ = lock_arrays


@dataclass(frozen=True, eq=False, repr=False)
class Fourier(_Known):
    """mean + sum a_k cos(2 pi k t/T) + b_k sin(2 pi k t/T)."""

    mean: Array
    cosines: Array
    sines: Array
    period: float

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates."""
        harmonics, weights = self._weights
        phase = times[:, None] * harmonics
        both = np.concatenate([np.cos(phase), np.sin(phase)], axis=1) @ weights
        n_shape = len(self.mean)
        return both[:, :n_shape] + self.mean, both[:, n_shape:]

    def accelerations(self, times: Array) -> Array:
        """Second derivatives: (N,) -> (N, n)."""
        harmonics, _ = self._weights
        phase, squares = times[:, None] * harmonics, harmonics**2
        return -(np.cos(phase) @ (self.cosines * squares).T + np.sin(phase) @ (self.sines * squares).T)

    @property
    def occupied(self) -> Integers:
        """The harmonics whose coefficients are not all zero, ascending."""
        return 1 + np.flatnonzero(np.any((self.cosines != 0.0) | (self.sines != 0.0), axis=0))

    @property
    def swings(self) -> Swings:
        """Swings as often as the highest harmonic."""
        return Swings(float(self.occupied.max(initial=0)), smooth_loop=True)

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        """Angular frequencies (k,) [rad/s]; of the cosines and sines in the shapes and in the rates (2 k, 2 n)."""
        harmonics = _WHOLE_TURN / self.period * np.arange(1, self.cosines.shape[1] + 1)
        of_cosines = np.concatenate([self.cosines, self.sines * harmonics]).T
        of_sines = np.concatenate([self.sines, -self.cosines * harmonics]).T
        return harmonics, np.concatenate([of_cosines, of_sines])


Interpolation = Literal["not-a-knot", "periodic", "rest to rest"]


@dataclass(frozen=True, eq=False, repr=False)
class PiecewisePolynomial(_Known):
    """sum_p coefficients[p, i] (t - knots[i])^p on the i-th interval; coefficients (order, pieces, n).

    `through`: by which rule the polynomials follow from their values at the knots; None: by none.
    """

    knots: Array
    coefficients: Array
    through: Interpolation | None = None
    swings: ClassVar[Swings] = Swings(0.5)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates."""
        piece = np.searchsorted(self.knots[1:-1], times, side="right")
        since = (times - self.knots[piece])[:, None]
        shapes, rates = np.zeros((2, len(times), self.coefficients.shape[2]))
        for coefficients in self.coefficients[::-1]:
            rates *= since
            rates += shapes
            shapes *= since
            shapes += coefficients[piece]
        return shapes, rates

    def accelerations(self, times: Array) -> Array:
        """Second derivatives, at a knot those of the piece on the right: (N,) -> (N, n)."""
        piece = np.searchsorted(self.knots[1:-1], times, side="right")
        since = (times - self.knots[piece])[:, None]
        accelerations = np.zeros((len(times), self.coefficients.shape[2]))
        for power in range(len(self.coefficients) - 1, 1, -1):
            accelerations = accelerations * since + power * (power - 1) * self.coefficients[power, piece]
        return accelerations


def polynomial_pieces(curve: Curve) -> PiecewisePolynomial | None:
    """Polynomials between knots that are the curve; None for other curves."""
    if isinstance(curve, PiecewisePolynomial):
        return curve
    if isinstance(curve, Joined):
        first, second = polynomial_pieces(curve.first), polynomial_pieces(curve.second)
        if first is None or second is None:
            return None
        return _joined_pieces([first, second], [np.zeros_like(curve.offset), curve.offset])
    inner = polynomial_pieces(curve.curve) if isinstance(curve, Changed) else None
    if inner is None:
        return None
    if isinstance(curve, Retimed) and curve.factor < 0.0:
        return _reversed_pieces(inner)
    if isinstance(curve, Retimed):
        powers = curve.factor ** -np.arange(len(inner.coefficients), dtype=np.float64)
        return PiecewisePolynomial(curve.factor * inner.knots, inner.coefficients * powers[:, None, None])
    if isinstance(curve, Reordered | Multiplied):
        return PiecewisePolynomial(inner.knots, curve._outer(inner.coefficients))
    if isinstance(curve, Repeated) and curve.count * len(inner.knots) <= _MOST_REPEATED:
        return _joined_pieces([inner] * curve.count, [loop * curve.turns for loop in range(curve.count)])
    return None


def exact_accelerations(curve: Curve, times: Array) -> Array | None:
    """r'' of a curve at times of its interval: (N,) -> (N, n); None where a function of a user is in it."""
    if isinstance(curve, Fourier | PiecewisePolynomial):
        return curve.accelerations(times)
    if isinstance(curve, Joined):
        late, inside = curve.late(times)
        first, second = exact_accelerations(curve.first, times[~late]), exact_accelerations(curve.second, inside)
        if first is None or second is None:
            return None
        joined = np.empty((len(times), len(curve.offset)))
        joined[~late], joined[late] = first, second
        return joined
    if not isinstance(curve, Changed):
        return None
    inner = exact_accelerations(curve.curve, curve._inner(times))
    return None if inner is None else curve._outer(inner) / curve.factor**2


def _joined_pieces(parts: list[PiecewisePolynomial], offsets: list[Array]) -> PiecewisePolynomial:
    order = max(len(part.coefficients) for part in parts)
    coefficients: list[Array] = []
    knots, start = [np.zeros(1)], 0.0
    for part, offset in zip(parts, offsets, strict=True):
        padded = np.zeros((order, *part.coefficients.shape[1:]))
        padded[: len(part.coefficients)] = part.coefficients
        padded[0] += offset
        coefficients.append(padded)
        knots.append(start + part.knots[1:])
        start += float(part.knots[-1])
    return PiecewisePolynomial(np.concatenate(knots), np.concatenate(coefficients, axis=1))


def _reversed_pieces(inner: PiecewisePolynomial) -> PiecewisePolynomial:
    order, lengths = len(inner.coefficients), np.diff(inner.knots)[:, None]
    coefficients = np.zeros_like(inner.coefficients)
    for power in range(order):
        for k in range(power, order):
            coefficients[power] += (-1.0) ** power * comb(k, power) * lengths ** (k - power) * inner.coefficients[k]
    return PiecewisePolynomial(inner.knots[-1] - inner.knots[::-1], coefficients[:, ::-1])


def returned_pair(returned: object) -> tuple[Array, Array]:
    """The shapes and rates that a user's function returned. Raises ShapeError where it is no such pair."""
    if not isinstance(returned, tuple | list) or len(returned) != 2:
        raise ShapeError("the path's function must return a pair, (shapes, rates)")
    return real_array(returned[0], "shapes of the path's function"), real_array(
        returned[1], "rates of the path's function"
    )


@dataclass(frozen=True, eq=False, repr=False)
class Function(_Known):
    """A user's function, its results checked at every call."""

    f: Callable[[Array], tuple[ArrayLike, ArrayLike]]
    n_shape: int

    def __getstate__(self) -> dict[str, Any]:
        """Pickled state. Raises LocalFunctionError for a lambda."""
        check_picklable(self.f, "a path")
        return self.__dict__

    def __deepcopy__(self, _: dict[int, Any]) -> Function:
        """The curve itself: nothing of it changes."""
        return self

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates."""
        shapes, rates = returned_pair(self.f(times))
        expected_shape = (len(times), self.n_shape)
        for name, part in (("shapes", shapes), ("rates", rates)):
            if part.shape != expected_shape:
                raise ShapeError(
                    f"the path's function must return {name} {expected_shape} for these times, got {part.shape}"
                )
            if not np.isfinite(part).all():
                row = int(np.argwhere(~np.isfinite(part))[0, 0])
                raise TrajectoryError(f"the path's function returned {name} that are not finite at {times[row]:.9g} s")
        check_reach(shapes, "shapes of the path's function")
        return shapes, rates


class Changed(_Known):
    """Base of curves that are another one, `factor` times as slowly, or with other columns."""

    curve: Curve
    factor: float = 1.0

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates."""
        shapes, rates = self.curve(self._inner(times))
        return self._outer(shapes), self._outer(rates) / self.factor

    def _inner(self, times: Array) -> Array:
        return times

    def _outer(self, values: Array) -> Array:
        return values


@dataclass(frozen=True, eq=False, repr=False)
class Retimed(Changed):
    """A curve of some duration run through `factor` times as slowly, or backwards with -1."""

    curve: Curve
    duration: float
    factor: float = -1.0

    def _inner(self, times: Array) -> Array:
        return self.duration - times if self.factor < 0.0 else np.minimum(times / self.factor, self.duration)


@dataclass(frozen=True, eq=False, repr=False)
class Reordered(Changed):
    """The columns of a curve in another order."""

    curve: Curve
    order: Integers

    def _outer(self, values: Array) -> Array:
        return values[..., self.order]


@dataclass(frozen=True, eq=False, repr=False)
class Multiplied(Changed):
    """The columns of a curve, each times a factor."""

    curve: Curve
    factors: Array

    def _outer(self, values: Array) -> Array:
        return values * self.factors


@dataclass(frozen=True, eq=False, repr=False)
class Widened(Changed):
    """The columns of a curve among more, of which the others rest at zero."""

    curve: Curve
    columns: Integers
    n_shape: int

    def _outer(self, values: Array) -> Array:
        widened = np.zeros((len(values), self.n_shape))
        widened[:, self.columns] = values
        return widened


@dataclass(frozen=True, eq=False, repr=False)
class Repeated(Changed):
    """A loop `count` times, each time `turns` (whole turns) further."""

    curve: Curve
    period: float
    count: int
    turns: Array

    def _inner(self, times: Array) -> Array:
        return np.minimum(times - self.period * self._loops(times), self.period)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates."""
        shapes, rates = self.curve(self._inner(times))
        return shapes + self._loops(times)[:, None] * self.turns, rates

    def _loops(self, times: Array) -> Integers:
        # Compared with the very numbers that stand in the breaks, so that a time just before one stays in its loop.
        return np.searchsorted(self.period * np.arange(self.count), times, side="right") - 1


@dataclass(frozen=True, eq=False, repr=False)
class Joined(_Known):
    """A curve, and after it another, shifted by `offset` (whole turns)."""

    first: Curve
    first_duration: float
    second: Curve
    second_duration: float
    offset: Array

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates."""
        late, inside = self.late(times)
        shapes, rates = (np.empty((len(times), len(self.offset))) for _ in range(2))
        shapes[~late], rates[~late] = self.first(times[~late])
        shapes[late], rates[late] = self.second(inside)
        shapes[late] += self.offset
        return shapes, rates

    def late(self, times: Array) -> tuple[Mask, Array]:
        """True for times of the second curve, and its own times there."""
        late = times >= self.first_duration
        return late, np.minimum(times[late] - self.first_duration, self.second_duration)


def swings_of(curve: Curve) -> Swings:
    """Return how fast a curve can change; of one that is smooth over all its loops, over the whole of it."""
    if isinstance(curve, Joined):
        return Swings(most_swings([swings_of(curve.first).most, swings_of(curve.second).most]))
    if isinstance(curve, Repeated):
        loop = swings_of(curve.curve)
        return loop._replace(most=loop.most * curve.count) if loop.smooth_loop and loop.most else loop
    if isinstance(curve, Changed):
        return swings_of(curve.curve)
    return getattr(curve, "swings", Swings())
