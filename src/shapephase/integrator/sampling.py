"""How a deformation is sampled: on panels, at nested Chebyshev points, as densely as an attitude needs, and no more.

The bandwidth of the shape motion, not the speed of the rotation, sets how often the body must be evaluated. A panel
gets 8, 16 or 32 degrees, beyond which it is halved, until what is missing from its series turns the body by little.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

import numpy as np

from ..arrays import Array
from ..chebyshev import chebyshev, end_margin, nodes_on, values_to_coefficients
from ..errors import AccuracyNotReached
from .channels import Channels, Directly, Evaluate, rates_of
from .constants import HIDDEN_SHARE, RANDOM_SUM, SAMPLING_SHARE
from .interpolant import Interpolant
from .kernels import spectra_kernel as spectra
from .samples import Panels, Samples
from .smoothness import DEGREES, Smoothness

_MOST_PANELS = 4000  # before halving ends, besides 40 for every break: a motion that needs more is rough
_AT_ONCE = 4096  # panels sampled together: their samples take some ten megabytes
_LEAST_WIDTH = 1e-13  # of a panel, relative to the interval: narrower ones would consist of rounding
_BETWEEN = np.array([0.0411, 0.2677, 0.5573, 0.8219])  # shares of a panel where series are checked: far from any node


class Sampler:
    """A deformation to be sampled, which keeps what was evaluated.

    Parameters
    ----------
    evaluate : times (N,) -> I (N, 3, 3), L_o (N, 3)
    known : what is known of it before it is sampled
    directly : times (N,) -> I^-1 and I^-1 L_o (N, 9), faster than `evaluate`, which is called where it is or returns
        None

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
        self._samples: dict[tuple[float, float], Samples] = {}

    @property
    def evaluations(self) -> int:
        """How many times the deformation was evaluated so far."""
        return self.channels.count

    def samples(self, momentum: float, tolerance: float, *, strict: bool = True) -> Samples:
        """Sample until the attitude error for momenta up to this magnitude is probably below `tolerance` [rad].

        The result depends on the arguments alone, whatever was sampled before.

        Parameters
        ----------
        momentum : magnitude of the largest [kg m^2/s]
        strict : whether samples that cannot be dense enough are an error, not only marked

        Raises
        ------
        AccuracyNotReached
            If the motion is too rough between its breaks.
        """
        key = float(momentum), float(tolerance)
        samples = self._samples.get(key)
        if samples is None:
            samples = self._samples[key] = _Sampling(self, *key).samples()
        if strict and samples.too_rough is not None:
            raise samples.too_rough
        return samples


def _by_degree(panels: Panels) -> list[_Panels]:
    """Panels of one degree together."""
    left, right = panels.edges[:-1], panels.edges[1:]
    groups = [(degree, panels.degrees == degree) for degree in sorted(set(panels.degrees.tolist()))]
    return [_Panels.new(degree, left[rows], right[rows]) for degree, rows in groups]


def _parts(waiting: list[_Panels]) -> Iterator[list[_Panels]]:
    """Panels that are sampled together: all, where they are few, else some thousand at a time."""
    if sum(len(panels.left) for panels in waiting) <= _AT_ONCE:
        yield waiting
        return
    for panels in waiting:
        for first in range(0, len(panels.left), _AT_ONCE):
            yield [panels.of(slice(first, first + _AT_ONCE))]


@dataclass(frozen=True, eq=False)
class _Panels:
    """Panels of one degree that are being sampled.

    left, right : (P,) [s]
    values : (P, degree/2 + 1, 9) at every second node; None: unknown
    parents : (P,) the last terms of the panels that each is a half of, at the highest degree [rad/s]
    """

    degree: int
    left: Array
    right: Array
    values: Array | None
    parents: Array

    @property
    def before(self) -> Array:
        """The parents where they are of this degree, else infinite: (P,) [rad/s]."""
        return self.parents if self.degree == DEGREES[-1] else np.full(len(self.left), inf)

    @classmethod
    def new(cls, degree: int, left: Array, right: Array) -> _Panels:
        """Panels without values."""
        return cls(degree, left, right, None, np.full(len(left), inf))

    def of(self, rows: slice) -> _Panels:
        """Some of them."""
        values = None if self.values is None else self.values[rows]
        return _Panels(self.degree, self.left[rows], self.right[rows], values, self.parents[rows])

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

    def samples(self) -> Samples:
        known, before = self._known, self._sampler.evaluations
        defect = known.loops * (0.0 if known.resolved is None else known.resolved.defect)
        too_rough = None
        if defect > 0.5 * self._tolerance:
            too_rough = AccuracyNotReached(
                f"rates and values of the function of time disagree by {defect:.3g} rad, which is too much for samples "
                f"good to {self._tolerance:.3g} rad; give the exact derivatives, or loosen the tolerance"
            )
        first = Panels(*known.first_panels(HIDDEN_SHARE * self._tolerance))
        most = _MOST_PANELS + 40 * len(known.breaks) + len(first.degrees)
        waiting = _by_degree(first)
        while waiting:
            further: list[_Panels] = []
            for part in _parts(waiting):
                for panels, values in zip(part, self._sampled(part), strict=True):
                    further += self._sampled_next(panels, values)
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
        channels = self._sampler.channels(np.concatenate([nodes.ravel() for nodes in times]))
        stops = np.cumsum([nodes.size for nodes in times])[:-1]
        return [
            panels.with_fresh(values.reshape(*nodes.shape, 9), self._end)
            for panels, nodes, values in zip(waiting, times, np.split(channels, stops), strict=True)
        ]

    def _sampled_next(self, panels: _Panels, values: Array) -> list[_Panels]:
        """Keep the panels that are dense enough; return the others, finer."""
        degree, left, right = panels.degree, panels.left, panels.right
        series, table = values_to_coefficients(degree) @ values, np.empty((len(left), spectra.COLUMNS))
        spectra.judge(series, right - left, np.spacing(right), panels.before, self._momentum, self._rate, table)
        if self._known.is_checked and degree:
            self._check_between(panels, series, table)
        good = table[:, spectra.GOOD] > 0.0
        if good.all():
            self._keep(left, right, series, table)
            return []
        self._keep(left[good], right[good], series[good], table[good])
        rough = ~good
        left, right, late = left[rough], right[rough], table[rough, spectra.LATE]
        if degree < DEGREES[-1]:
            # Noise is detected at the highest degree only.
            return [_Panels(2 * degree, left, right, values[rough], panels.parents[rough])]
        middle = 0.5 * (left + right)
        ends = np.concatenate([left, middle]), np.concatenate([middle, right])
        return [_Panels(DEGREES[1], *ends, None, np.tile(late, 2))]

    def _check_between(self, panels: _Panels, series: Array, table: Array) -> None:
        """Compare good panels with the body between their nodes, and mark those that differ as bad."""
        rows = np.flatnonzero(table[:, spectra.GOOD])
        width = (panels.right - panels.left)[rows]
        times = panels.left[rows, None] + width[:, None] * _BETWEEN
        body = self._sampler.channels(times.ravel()).reshape(*times.shape, 9)
        here = chebyshev(2.0 * _BETWEEN - 1.0, panels.degree + 1) @ series[rows]
        gap = rates_of(here - body, self._momentum).max(axis=1)
        fits = gap <= table[rows, spectra.ALLOWED]
        table[rows[~fits], spectra.GOOD] = 0.0
        # The gap swings to both sides.
        self._gap += 0.5 * float((gap * width)[fits].sum())

    def _keep(self, left: Array, right: Array, series: Array, table: Array) -> None:
        if len(left):
            self._done.append((left, right, series, table))
            self._count += len(left)

    def _keep_as_it_is(self, panels: _Panels) -> None:
        """Keep panels that cannot be finer, by samples of their degree, with estimates of their errors."""
        (values,) = self._sampled([_Panels.new(panels.degree, panels.left, panels.right)])
        series, table = values_to_coefficients(panels.degree) @ values, np.empty((len(values), spectra.COLUMNS))
        ends = panels.right - panels.left, np.spacing(panels.right), panels.before
        spectra.judge(series, *ends, self._momentum, self._rate, table)
        table[:, spectra.CHANGE], table[:, spectra.BETWEEN] = panels.degree, table[:, spectra.LATE]
        self._keep(panels.left, panels.right, series, table)

    def _rough(self, further: list[_Panels]) -> AccuracyNotReached:
        narrowest = min(further, key=lambda panels: float((panels.right - panels.left).min()))
        where = float(narrowest.left[np.argmin(narrowest.right - narrowest.left)])
        return AccuracyNotReached(
            f"the shape motion is rough near t = {where:.12g} s: samples good to {self._tolerance:.3g} rad would be "
            "too many; declare the times of its jumps as breaks, smooth the data, or loosen the tolerance"
        )

    def _whole(self, evaluations: int, defect: float, too_rough: AccuracyNotReached | None) -> Samples:
        left, right, table = (np.concatenate([part[k] for part in self._done]) for k in (0, 1, 3))
        degrees = np.concatenate([np.full(len(part[0]), part[2].shape[1] - 1) for part in self._done])
        series, row = self._done[0][2], 0
        if len(self._done) > 1:
            series = np.zeros((len(left), degrees.max() + 1, 9))
            for part in self._done:
                series[row : row + len(part[0]), : part[2].shape[1]] = part[2]
                row += len(part[0])
        # Halves of panels come after all first halves.
        if not np.all(left[:-1] < left[1:]):
            order = np.argsort(left)
            left, right, table, series = (rows[order] for rows in (left, right, table, series))
            degrees = degrees[order]
        loops = self._known.loops
        edges = first = np.append(left, right[-1])
        if loops > 1:
            starts = self._end * np.arange(loops)
            edges = np.append((starts[:, None] + edges[:-1]).ravel(), self._end * loops)
        interpolant = Interpolant(edges, series, loops, evaluations)
        worst = table.max(axis=0)
        return Samples(
            interpolant=interpolant,
            panels=Panels(first, degrees),
            change=table[:, spectra.CHANGE],
            noisy=table[:, spectra.NOISY],
            between=float(worst[spectra.BETWEEN]),
            hidden=defect + loops * (self._gap + self._noise_of_path(interpolant)),
            level=float(worst[spectra.MISSING]) * loops * self._end / SAMPLING_SHARE,
            condition=float(worst[spectra.CONDITION]),
            rates=(float(worst[spectra.INVERSE]), float(worst[spectra.DRIFT])),
            too_rough=too_rough,
        )

    def _noise_of_path(self, interpolant: Interpolant) -> float:
        """Attitude error by noise of a resolved path in one loop, independent from panel to panel [rad]."""
        resolved = self._known.resolved
        if resolved is None or not resolved.noise.any():
            return 0.0
        turn = interpolant.widths.sum() * rates_of(interpolant.coefficients[:, 0], self._momentum).max()
        noise = resolved.noise * (1.0 + turn / len(resolved.noise))
        return float(min(noise.sum(), RANDOM_SUM * np.sqrt((noise * noise).sum())))
