"""How a deformation is sampled: on panels, at nested Chebyshev points, as densely as an attitude needs, and no more.

The bandwidth of the shape motion, not the speed of the rotation, sets how often the body must be evaluated. A panel gets
8, 16 or 32 degrees, beyond which it is halved, until what is missing from its series turns the body by little.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from ..arrays import Array, Integers, Mask, lock_arrays, read_only
from ..chebyshev import chebyshev, end_margin, nodes_on, values_to_coefficients
from ..display import short_repr
from ..errors import AccuracyNotReached
from .channels import MATRIX, VOIGT, Channels, Directly, Evaluate, rates_of
from .constants import (
    BEYOND_LAST_TERMS,
    CHANGED_LAST_TERMS,
    EPS,
    HIDDEN_SHARE,
    RANDOM_SUM,
    ROUNDED_SAMPLES,
    SAMPLING_SHARE,
    SLOWEST_DECAY,
)
from .interpolant import Interpolant
from .smoothness import DEGREES, Smoothness

# Panels before halving ends, besides 40 for every break: a motion that needs more is rough, not merely long.
_MOST_PANELS = 4000
# Of a panel, relative to the interval: narrower ones would consist of rounding.
_LEAST_WIDTH = 1e-13
# Where the samples of a panel are compared with its series: none is near a node of a degree in use.
_BETWEEN = np.array([0.0411, 0.2677, 0.5573, 0.8219])
# Of what a panel's parent had beyond its degree: noise is as large in the halves, anything else is smaller.
_NOISE_STAYS = 0.5
# Of the largest term: what counts as noise is far below.
_NOISE = 1e-6
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Perturbed:
    """An interpolant's series with errors like those that they probably have.

    Attributes
    ----------
    coefficients : (P, n, 9) the last terms of each series changed by as much as is missing beyond them
    hidden : attitude error of what they do not show, without amplification [rad]
    """

    coefficients: Array
    hidden: float

    __repr__ = short_repr

    __post_init__ = lock_arrays


@dataclass(frozen=True, eq=False)
class Panels:
    """Panels of one loop, which are sampled at Chebyshev points.

    Attributes
    ----------
    edges : (P + 1,) [s]
    degrees : (P,)
    """

    edges: Array
    degrees: Integers

    @property
    def times(self) -> Array:
        """All nodes, panels of one degree after those of another: (S,) [s]."""
        end = float(self.edges[-1])
        return np.concatenate([panels.times(end).ravel() for panels in self.by_degree()])

    def by_degree(self) -> list[_Panels]:
        """Of one degree together."""
        left, right = self.edges[:-1], self.edges[1:]
        each = [(degree, self.degrees == degree) for degree in np.unique(self.degrees).tolist()]
        return [_Panels.new(degree, left[rows], right[rows]) for degree, rows in each]


@dataclass(frozen=True, eq=False)
class Samples:
    """A deformation as it was sampled for momenta up to a magnitude.

    Attributes
    ----------
    interpolant : the series through the samples
    panels : on which they are
    change : (P,) by how much of themselves the last two terms of each series may be wrong
    noisy : (P,) whether these terms are noise, which all others have as well
    between : attitude error within a panel that its ends do not show [rad]
    hidden : what no series shows, without amplification [rad]
    level : tolerance below which there would be more samples [rad]; 0: all that is missing is noise
    too_rough : why the samples are not as dense as they were to be; None: they are
    """

    interpolant: Interpolant
    panels: Panels
    change: Array
    noisy: Mask
    between: float
    hidden: float
    level: float
    too_rough: AccuracyNotReached | None = None

    __repr__ = short_repr

    @cached_property
    def perturbed(self) -> Perturbed:
        """The series changed by what is probably missing."""
        return Perturbed(changed_series(self.interpolant.coefficients, self.change, self.noisy), self.hidden)


def changed_series(coefficients: Array, change: Array, noisy: Mask) -> Array:
    """Series (P, n, 9) with their last two terms changed by shares (P,) of themselves.

    Where these terms are noise, the last of them is added to the first, with signs by chance: all terms have as much of
    it, and the first turns the body most.
    """
    found = coefficients.copy()
    last = last_terms(coefficients)
    rows = np.arange(len(found))
    for back in (0, 1):
        place = np.maximum(last - back, 0)
        found[rows, place] *= np.where(last >= 2, 1.0 - change, 1.0)[:, None]
    found[:, 0] += (_signs(len(found)) * (noisy & (last >= 2)))[:, None] * coefficients[rows, last]
    return read_only(found)


def rounded_series(coefficients: Array, units: float) -> Array:
    """Series (P, n, 9) of inertias and momenta that are rounded otherwise, by so many units of their largest entries.

    With L the largest moment, a rounding eps L E of the inertia, E of size one in any direction, changes I^-1 by
    -I^-1 eps L E I^-1: of a body that hardly resists turning about one axis, by more than units of its own.
    """
    panels, terms, _ = coefficients.shape
    rng, inverse = np.random.default_rng(0), coefficients[:, 0][:, MATRIX].reshape(-1, 1, 3, 3)
    least = np.linalg.eigvalsh(inverse[:, 0])[:, 0]
    unit = (units * EPS / np.where(least > 0.0, least, np.inf))[:, None, None]
    tensors, vectors = rng.standard_normal((panels, terms, 3, 3)), rng.standard_normal((panels, terms, 3))
    turned = inverse @ (tensors + np.swapaxes(tensors, -1, -2))
    drift = np.abs(coefficients[:, :, 6:]).max(axis=(1, 2))[:, None, None] * vectors
    found = coefficients.copy()
    there = np.arange(terms) <= last_terms(coefficients)[:, None]
    unit = unit * there[:, :, None]
    found[:, :, :6] += unit * (turned @ inverse).reshape(panels, terms, 9)[:, :, VOIGT]
    of_tensors = (turned @ coefficients[:, None, 0, 6:, None])[..., 0]
    found[:, :, 6:] += unit * (of_tensors + (inverse @ drift[..., None])[..., 0])
    return found


def _signs(count: int) -> Array:
    return np.where(np.random.default_rng(0).random(count) < 0.5, -1.0, 1.0)


def largest_condition(coefficients: Array) -> float:
    """Of the inertia, on all panels."""
    values = np.linalg.eigvalsh(coefficients[:, 0][:, MATRIX].reshape(-1, 3, 3))
    return float((values[:, 2] / np.maximum(values[:, 0], _TINY)).max())


def last_terms(coefficients: Array) -> Integers:
    """The degree of each series, padded with zeros to one degree: (P, n, 9) -> (P,)."""
    there = coefficients.any(axis=2)
    return np.where(there.any(axis=1), there.shape[1] - 1 - np.argmax(there[:, ::-1], axis=1), 0)


class Sampler:
    """A deformation that is sampled as often as is asked for; what was evaluated is kept.

    Parameters
    ----------
    evaluate : times (N,) -> I (N, 3, 3), L_o (N, 3)
    known : what is known of it before it is sampled
    directly : times (N,) -> I^-1 and I^-1 L_o (N, 9) as channels, sooner than by `evaluate`; None, or None as its
        result: `evaluate` is asked

    Examples
    --------
    >>> def evaluate(t):
    ...     return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), np.zeros((len(t), 3))
    >>> steady = sp.integrator.Sampler(evaluate, sp.integrator.Smoothness(np.array([0.0, 1.0]), oscillations=0.0))
    >>> steady.samples(5.0, 1e-9).interpolant.evaluations
    1
    """

    def __init__(self, evaluate: Evaluate, known: Smoothness, directly: Directly | None = None) -> None:
        self.channels = Channels(evaluate, directly)
        self.known = known
        self._found: dict[tuple[float, float], Samples] = {}
        self._first: Panels | None = None

    def begin_with(self, panels: Panels, known: Iterable[tuple[Array, Array]]) -> None:
        """Take these panels for the first; `known` : times (S,) [s] and the channels (S, 9) there."""
        self._first = panels
        for times, channels in known:
            self.channels.know(times, channels)

    def first_panels(self, tolerance: float) -> Panels:
        """Panels that leave at most `tolerance` [rad] unseen of what is known."""
        return Panels(*self.known.first_panels(tolerance)) if self._first is None else self._first

    @property
    def evaluations(self) -> int:
        """How many times the deformation was evaluated so far."""
        return self.channels.count

    def samples(self, momentum: float, tolerance: float, *, strict: bool = True) -> Samples:
        """Sample until the attitude error for momenta up to this magnitude is probably below `tolerance` [rad].

        The result depends on the arguments alone, whatever was asked for before.

        Parameters
        ----------
        momentum : magnitude of the largest [kg m^2/s]
        strict : whether samples that cannot be dense enough are an error; else they say so

        Raises
        ------
        AccuracyNotReached
            If the motion is too rough between its breaks.
        """
        key = float(momentum), float(tolerance)
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = _Sampling(self, *key).samples()
        if strict and found.too_rough is not None:
            raise found.too_rough
        return found


@dataclass(frozen=True, eq=False)
class _Panels:
    """Panels of one degree that are being sampled.

    Attributes
    ----------
    left, right : (P,) [s]
    values : (P, degree/2 + 1, 9) at every second node; None: nothing is known yet
    before : (P,) the last terms, at the highest degree, of the panel that each is a half of [rad/s]
    """

    degree: int
    left: Array
    right: Array
    values: Array | None
    before: Array

    @classmethod
    def new(cls, degree: int, left: Array, right: Array) -> _Panels:
        """Of which nothing is known."""
        return cls(degree, left, right, None, np.full(len(left), inf))

    def times(self, end: float) -> Array:
        """The nodes that are not sampled yet, the outermost on this side of breaks: (P, k) [s]."""
        if not self.degree:
            return 0.5 * (self.left + self.right)[:, None]
        nodes, margin = nodes_on(self.left, self.right, self.degree), end_margin(self.right - self.left, end)
        nodes[:, 0], nodes[:, -1] = self.left + margin, self.right - margin
        return nodes if self.values is None else nodes[:, 1::2]

    def with_fresh(self, fresh: Array, end: float) -> Array:
        """All values, at the ends of panels themselves: (P, k, 9) -> (P, degree + 1, 9)."""
        if self.values is None:
            if not self.degree:
                return fresh
            # From this side of a break to the break, along the slope of the series.
            width, order = self.right - self.left, np.arange(self.degree + 1.0)
            slopes = np.stack([(-1.0) ** order, np.ones_like(order)]) * order**2
            moved = (slopes @ values_to_coefficients(self.degree)) @ fresh
            values = fresh.copy()
            values[:, [0, -1]] += moved * (2.0 * end_margin(width, end) / width)[:, None, None]
            return values
        values = np.empty((len(self.left), self.degree + 1, 9))
        values[:, ::2], values[:, 1::2] = self.values, fresh
        return values


class _Sampling:
    """One run of a sampler, for momenta up to a magnitude and a tolerance."""

    def __init__(self, sampler: Sampler, momentum: float, tolerance: float) -> None:
        self._sampler, self._known, self._momentum, self._tolerance = sampler, sampler.known, momentum, tolerance
        self._end = self._known.period
        # [rad/s] that series may be off by.
        self._rate = SAMPLING_SHARE * tolerance / (self._known.loops * self._end)
        self._done: list[tuple[Array, ...]] = []
        self._count = 0
        self._gap = 0.0
        self._worst = 0.0

    def samples(self) -> Samples:
        known, before = self._known, self._sampler.evaluations
        defect = known.loops * (0.0 if known.resolved is None else known.resolved.defect)
        too_rough = None
        if defect > 0.5 * self._tolerance:
            too_rough = AccuracyNotReached(
                f"rates and values of the function of time disagree by {defect:.3g} rad, which is too much for samples "
                f"good to {self._tolerance:.3g} rad; give the exact derivatives, or loosen the tolerance"
            )
        first = self._sampler.first_panels(HIDDEN_SHARE * self._tolerance)
        most = _MOST_PANELS + 40 * len(known.breaks) + len(first.degrees)
        waiting = first.by_degree()
        while waiting:
            values = self._sampled(waiting)
            further: list[_Panels] = []
            for panels, there in zip(waiting, values, strict=True):
                further += self._judged(panels, there)
            finer = sum(len(panels.left) for panels in further)
            narrow = min((float((p.right - p.left).min()) for p in further), default=inf)
            if narrow < _LEAST_WIDTH * self._end or self._count + finer > most:
                too_rough = self._rough(further)
                for panels in further:
                    self._keep_as_it_is(panels)
                break
            waiting = further
        return self._whole(self._sampler.evaluations - before, defect, too_rough)

    def _sampled(self, waiting: list[_Panels]) -> list[Array]:
        times = [panels.times(self._end) for panels in waiting]
        found = self._sampler.channels(np.concatenate([one.ravel() for one in times]))
        stops = np.cumsum([one.size for one in times])[:-1]
        return [
            panels.with_fresh(part.reshape(*one.shape, 9), self._end)
            for panels, one, part in zip(waiting, times, np.split(found, stops), strict=True)
        ]

    def _judged(self, panels: _Panels, values: Array) -> list[_Panels]:
        """Keep the panels that are dense enough; the others as they are sampled next."""
        degree, left, right = panels.degree, panels.left, panels.right
        series = values_to_coefficients(degree) @ values
        if not degree:
            self._keep(left, right, series, np.zeros((4, len(left))))
            return []
        width = right - left
        rates = rates_of(series, self._momentum)
        late, decay = tail_and_decay(rates)
        rounded = ROUNDED_SAMPLES * EPS * rates.max(axis=1)
        rounded += 4.0 * np.spacing(right) / width * (rates @ np.arange(degree + 1.0))
        noisy = late <= rounded
        if degree == DEGREES[-1]:
            noisy |= (late >= _NOISE_STAYS * panels.before) & (late <= _NOISE * rates.max(axis=1))
        # What is beyond the degree swings that often over the panel, but for how far the body turns in it.
        swings = np.maximum(degree - width * rates.sum(axis=1), 1.0)
        missing = late * decay / (1.0 - decay)
        good = noisy | (missing <= self._rate * swings)
        if self._known.is_checked:
            good &= self._fits_between(panels, series, good, self._rate * swings + rounded)
        self._worst = max(self._worst, float((missing / swings)[good & ~noisy].max(initial=0.0)))
        change = np.minimum(CHANGED_LAST_TERMS * (1.0 + BEYOND_LAST_TERMS / degree) * decay / (1.0 - decay), degree)
        beyond = np.maximum(missing, noisy * late) * width / swings
        table = np.stack([np.where(noisy, 1.0, change), noisy, beyond, np.full(len(left), degree)])
        self._keep(left[good], right[good], series[good], table[:, good])
        rough = ~good
        if not rough.any():
            return []
        if degree < DEGREES[-1]:
            return [_Panels(2 * degree, left[rough], right[rough], values[rough], panels.before[rough])]
        middle = 0.5 * (left[rough] + right[rough])
        ends = np.concatenate([left[rough], middle]), np.concatenate([middle, right[rough]])
        return [_Panels(DEGREES[1], *ends, None, np.tile(late[rough], 2))]

    def _fits_between(self, panels: _Panels, series: Array, good: Mask, allowed: Array) -> Mask:
        """Whether series are right between their nodes, to what is allowed (P,) [rad/s]: of those good at the nodes."""
        rows = np.flatnonzero(good)
        width = (panels.right - panels.left)[rows]
        times = panels.left[rows, None] + width[:, None] * _BETWEEN
        body = self._sampler.channels(times.ravel()).reshape(*times.shape, 9)
        here = chebyshev(2.0 * _BETWEEN - 1.0, panels.degree + 1) @ series[rows]
        gap = rates_of(here - body, self._momentum).max(axis=1)
        fits = np.zeros(len(good), dtype=bool)
        fits[rows] = gap <= allowed[rows]
        # What is seen there swings to both sides.
        self._gap += 0.5 * float((gap * width)[fits[rows]].sum())
        return fits

    def _keep(self, left: Array, right: Array, series: Array, table: Array) -> None:
        self._done.append((left, right, series, table))
        self._count += len(left)

    def _keep_as_it_is(self, panels: _Panels) -> None:
        """Panels that cannot be finer, by samples of the least degree: their estimates say how far they are off."""
        coarse = _Panels.new(panels.degree, panels.left, panels.right)
        (values,) = self._sampled([coarse])
        series = values_to_coefficients(panels.degree) @ values
        late, _ = tail_and_decay(rates_of(series, self._momentum))
        one = np.ones(len(late))
        self._keep(panels.left, panels.right, series, np.stack([panels.degree * one, 0.0 * one, late, panels.degree * one]))

    def _rough(self, further: list[_Panels]) -> AccuracyNotReached:
        narrowest = min(further, key=lambda panels: float((panels.right - panels.left).min()))
        where = float(narrowest.left[np.argmin(narrowest.right - narrowest.left)])
        return AccuracyNotReached(
            f"the shape motion is rough near t = {where:.12g} s: samples good to {self._tolerance:.3g} rad would be "
            "too many; declare the times of its jumps as breaks, smooth the data, or loosen the tolerance"
        )

    def _whole(self, evaluations: int, defect: float, too_rough: AccuracyNotReached | None) -> Samples:
        left, right = (np.concatenate([part[k] for part in self._done]) for k in (0, 1))
        order = np.argsort(left)
        table = np.concatenate([part[3] for part in self._done], axis=1)[:, order]
        series = np.zeros((len(left), max(part[2].shape[1] for part in self._done), 9))
        row = 0
        for part in self._done:
            series[row : row + len(part[0]), : part[2].shape[1]] = part[2]
            row += len(part[0])
        loops = self._known.loops
        edges = np.append(left[order], right[order[-1]])
        if loops > 1:
            starts = self._end * np.arange(loops)
            edges = np.append((starts[:, None] + edges[:-1]).ravel(), self._end * loops)
        interpolant = Interpolant(edges, series[order], loops, evaluations)
        panels = Panels(edges[: len(order) + 1], table[3].astype(np.int64))
        hidden = defect + loops * (self._gap + self._noise_of_path(interpolant))
        level = self._worst * loops * self._end / SAMPLING_SHARE
        between = float(table[2].max(initial=0.0))
        return Samples(interpolant, panels, table[0], table[1] > 0.0, between, hidden, level, too_rough)

    def _noise_of_path(self, interpolant: Interpolant) -> float:
        """What noise of a resolved path turns the body by in one loop: that of panels is independent of each other."""
        resolved = self._known.resolved
        if resolved is None or not resolved.noise.any():
            return 0.0
        turn = interpolant.widths.sum() * rates_of(interpolant.coefficients[:, 0], self._momentum).max()
        noise = resolved.noise * (1.0 + turn / len(resolved.noise))
        return float(min(noise.sum(), RANDOM_SUM * np.sqrt((noise * noise).sum())))


def tail_and_decay(rates: Array) -> tuple[Array, Array]:
    """The larger of the last two terms, and by which factor terms fall from one degree to the next: (P, n) -> (P,) each.

    Single terms are small by chance, or by a motion's symmetry.
    """
    degree = rates.shape[1] - 1
    late = rates[:, -2:].max(axis=1)
    middle = np.maximum(rates[:, degree // 2 : degree - 1].max(axis=1), late)
    decay = (np.maximum(late, _TINY) / np.maximum(middle, _TINY)) ** (2.0 / degree)
    return late, np.minimum(decay, SLOWEST_DECAY)
