"""Any deformation sampled on panels between its breaks, at nested Chebyshev points."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ...arrays import Array, Integers, Mask
from ...chebyshev import chebyshev, inside, nodes_on, values_to_coefficients, widest_margin
from ...errors import AccuracyNotReached
from .._last_terms import Perturbed, perturbed_series
from .._spectral_error import SampledChannels, spectral_norms
from ..fast import engine
from ..fast.panels import Demand, PanelsToSample, sampled_round
from ..interpolant import Interpolant
from ..resolved import Hidden, ResolvedPath
from .finer_panels import FinerPanels, refining_factors
from .halved_panels import halved_edges, halved_series, pays_to_halve
from .panel_series import (
    PanelErrors,
    PanelSeries,
    panel_errors,
    sample_times,
    series_through,
)

# Tolerance [rad] from which on, and the degree to begin with on many panels and on a few.
_FIRST_DEGREES = ((1e-7, 5, 10), (1e-11, 10, 20), (0.0, 15, 30))
# Panels that are a few.
_FEW = 4
# Panels before bisecting ends, besides 40 for every break: a motion that needs more is rough, not merely long.
_MOST_PANELS = 4000
# Of the tolerance: what the first panels may leave hidden of a path that is resolved.
_HIDDEN_SHARE = 0.1
# First panels, for so many tolerances, that are kept for the next motion.
_MOST_KNOWN = 64
# Of the tolerance: what rates and values of a function may disagree by.
_DEFECT_SHARE = 0.5
# Of a panel, relative to the interval: narrower ones would consist of rounding.
_LEAST_WIDTH = 1e-13
# Sixty-four points of a panel, none of them a node: a low-discrepancy sequence.
_TEST_FRACTIONS = np.sort(np.mod(0.5 + 0.6180339887498949 * np.arange(64, dtype=np.float64), 1.0))
NONE_JOINED = np.empty(0, dtype=np.int64)
_NO_DEGREES = NONE_JOINED
_NO_VALUES = np.empty((0, 9))


def _perturbed(series: PanelSeries, momentum: float, is_halved: bool) -> Array:
    found = perturbed_series(series.coefficients, series.degree, series.width, momentum)
    return halved_series(found) if is_halved else found


class PanelSampler:
    """Samples on panels between the breaks, at nested Chebyshev points.

    Attributes
    ----------
    end : of all panels of a loop [s]
    defect : what rates and values of a function of time disagree by in one loop [rad]
    """

    def __init__(
        self,
        channels: SampledChannels,
        breaks: Array,
        loops: int,
        oscillations: float | None,
        probe: Callable[[Array], Array] | None,
        resolved: ResolvedPath | None = None,
        *,
        checked: bool = False,
        known: dict[Any, PanelsToSample] | None = None,
    ) -> None:
        self._known = {} if known is None else known
        self._channels, self._probe, self._loops, self._resolved = channels, probe, loops, resolved
        self.defect = 0.0 if resolved is None else resolved.defect
        self._is_bandlimited = oscillations is not None or (resolved is not None and not checked)
        self._breaks, self._oscillations = breaks, oscillations
        self.end, self._span = float(breaks[-1]), float(breaks[-1] - breaks[0])
        self._most_panels = _MOST_PANELS + 40 * len(breaks)
        self._series: PanelSeries | None = None
        self._errors: tuple[float, PanelErrors] | None = None
        self._interpolant: Interpolant | None = None
        self._halves: bool | None = None

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        defect = self._loops * self.defect
        if defect > _DEFECT_SHARE * tolerance:
            raise AccuracyNotReached(
                f"rates and values of the function of time disagree by {defect:.3g} rad, which is too much for samples "
                f"good to {tolerance:.3g} rad; give the exact derivatives, or loosen the tolerance"
            )
        tolerance -= defect
        if self._is_bandlimited and engine.is_ready():
            if self._series is None or self._rough(momentum, tolerance)[1].any():
                self._refine_in_machine_code(float(momentum), float(tolerance))
            return
        if self._series is None:
            _, _, degree, left, right, times = self._panels_so_far(tolerance)
            # A copy: what machine code computes in work arrays is overwritten by the next call.
            values = self._channels(times).copy()
            self._keep(series_through(degree, left, right, values, self.end, degree > 0))
        while True:
            total, rough = self._rough(momentum, tolerance)
            if total <= tolerance:
                if self._is_bandlimited or not self._check_between_nodes():
                    return
                continue
            if not rough.any():
                return
            self._refine_panels(rough, momentum, tolerance, total)

    def _refine_in_machine_code(self, momentum: float, tolerance: float) -> None:
        """Each round in one call, where nothing is to be looked at between the nodes."""
        panels, series = self._panels_so_far(tolerance), self._series
        degree, values = (_NO_DEGREES, _NO_VALUES) if series is None else (series.degree, series.values)
        demand = Demand(momentum, tolerance, self._span * self._loops, self._loops, widest_margin(self.end))
        while True:
            _, _, here, left, right, times = panels
            fresh = self._channels(times) if len(times) else _NO_VALUES
            hidden = None if self._resolved is None else self._resolved.hidden(left, right, here).table
            found = sampled_round(degree, values, panels, fresh, hidden, demand)
            if not len(found.further):
                self._keep(PanelSeries.of(here, left, right, found.values, found.coefficients, found.table))
                self._errors = momentum, PanelErrors(found.errors)
                return
            try:
                total = self._loops * float(found.errors[0].sum())
                self._check_halves(found.further, left, right - left, tolerance, total)
            except AccuracyNotReached:
                # What there is may do all the same.
                self._keep(PanelSeries.of(here, left, right, found.values, found.coefficients, found.table))
                raise
            degree, values, panels = here, found.values, found.finer

    def _panels_so_far(self, tolerance: float) -> PanelsToSample:
        """Those that are sampled already, or the first ones."""
        series = self._series
        if series is not None:
            count = len(series.degree)
            ends = series.left, series.right, np.empty(0)
            return PanelsToSample(np.arange(count), np.ones(count, dtype=np.int64), series.degree, *ends)
        key = tolerance, self._breaks.tobytes(), self._oscillations, self._resolved is None
        found = self._known.get(key)
        if found is None:
            found = self._panels_at_first(tolerance)
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[key] = found
        return found

    def _panels_at_first(self, tolerance: float) -> PanelsToSample:
        degree, left, right = self._first_panels(tolerance)
        none = np.zeros(len(degree), dtype=np.int64)
        return PanelsToSample(none, none, degree, left, right, sample_times(degree, left, right, self.end))

    @property
    def series(self) -> PanelSeries:
        """All panels so far, of which `refine` makes the first."""
        if self._series is None:
            raise RuntimeError("nothing is sampled before `refine` was called")
        return self._series

    @property
    def hidden(self) -> Hidden | None:
        """What a resolved path has beyond the nodes of these panels; None: nothing is known of that."""
        if self._resolved is None:
            return None
        series = self.series
        return self._resolved.hidden(series.left, series.right, series.degree)

    @property
    def is_checked(self) -> bool:
        """Whether its interpolant is compared with the deformation between the nodes."""
        return not self._is_bandlimited

    @property
    def sample_times(self) -> Array:
        """Where the panels so far are sampled: (S,) [s]."""
        series = self.series
        return sample_times(series.degree, series.left, series.right, self.end)

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        errors = self._errors_at(momentum)
        return self._loops * (errors.total + errors.sum_of_noise + self.defect)

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`; its panels are halves of those that were sampled where these take many steps."""
        if self._interpolant is None:
            if self._is_halved:
                series = self.series.coefficients
                halves = halved_edges(self._edges()), halved_series(series)
                self._interpolant = Interpolant(*halves, self._loops, self._channels.count, sampled=series)
            else:
                self._interpolant = self.as_sampled()
        return self._interpolant

    def as_sampled(self) -> Interpolant:
        """The interpolant on the panels that were sampled."""
        return Interpolant(self._edges(), self.series.coefficients, self._loops, self._channels.count)

    def _edges(self) -> Array:
        series = self.series
        edges = np.empty(len(series.left) + 1)
        edges[:-1], edges[-1] = series.left, series.right[-1]
        if self._loops > 1:
            starts = edges[-1] * np.arange(self._loops)
            edges = np.append((starts[:, None] + edges[:-1]).ravel(), self._loops * edges[-1])
        return edges

    def perturbed(self, momentum: float) -> Perturbed:
        """As `Sampler.perturbed`."""
        series, errors = self.series, self._errors_at(momentum)
        hidden = errors.total_hidden + errors.sum_of_noise + self.defect
        if not self._is_bandlimited:
            hidden += float((0.5 * series.width * (np.nan_to_num(series.gaps) @ np.array([momentum, 1.0]))).sum())
        make = partial(_perturbed, series, momentum, self._is_halved)
        return Perturbed(make, self._loops * hidden)

    def channels(self, times: Array) -> Array:
        """As `Sampler.channels`."""
        return self._channels(times)

    body_channels = channels

    def joined_panels(self) -> Integers:
        """As `Sampler.joined_panels`: none, since rates may jump at breaks that nobody stated."""
        return NONE_JOINED

    @property
    def _is_halved(self) -> bool:
        if self._halves is None:
            # Without momentum steps are cheap.
            degree, turn = self.series.degree, self._errors[1].total_turn if self._errors and self._errors[0] else 0.0
            self._halves = turn > 0.0 and pays_to_halve(len(degree), turn, sum(degree.tolist()))
        return self._halves

    def _first_panels(self, tolerance: float) -> tuple[Integers, Array, Array]:
        """Degrees and ends."""
        of_many, of_few = next(degrees for least, *degrees in _FIRST_DEGREES if tolerance > least)
        if self._resolved is not None:
            first = self._resolved.first_panels(_HIDDEN_SHARE * tolerance)
            degree = first.degree
            if len(degree) <= _FEW:
                # A body's inertia swings faster than its shape.
                degree = np.where(degree, np.maximum(degree, of_few), 0)
            return degree, first.left, first.right
        pieces = 4 if self._oscillations is None else max(1, int(np.ceil(self._oscillations / 2.0)))
        left, right = self._breaks[:-1], self._breaks[1:]
        at_rest = self._panels_at_rest(left, right)
        moving = len(left) - int(np.count_nonzero(at_rest))
        if 2 * pieces * moving <= _FEW:
            # Wide panels would need degrees so high that each step takes longer.
            pieces *= 2
        degree = np.where(at_rest, 0, of_many if pieces * moving > _FEW else of_few)
        if pieces > 1 and moving:
            counts = np.where(at_rest, 1, pieces)
            within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
            left = np.repeat(left, counts) + within * np.repeat((right - left) / counts, counts)
            right, degree = np.append(left[1:], right[-1]), np.repeat(degree, counts)
        return degree, left, right

    def _rough(self, momentum: float, tolerance: float) -> tuple[float, Mask]:
        """The error of all panels [rad], and if it is above the tolerance which of them more samples help: (P,)."""
        series, errors = self.series, self._errors_at(momentum)
        total = self._loops * errors.total
        if total <= tolerance:
            return total, np.zeros(len(series.degree), dtype=np.bool_)
        share = self._share(tolerance)
        return total, (errors.whole > share) & (~series.estimate.at_rounding | (errors.hidden > share))

    def _share(self, tolerance: float) -> Array:
        """What each panel may be off by: (P,) [rad]."""
        return tolerance / (self._span * self._loops) * self.series.width

    def _refine_panels(self, rough: Mask, momentum: float, tolerance: float, total: float) -> None:
        """Raise the degree where the spectrum decays fast enough for that to do, else bisect."""
        old = self.series
        factor = refining_factors(old, rough, self._errors_at(momentum).whole, self._share(tolerance))
        self._check_halves(factor, old.left, old.width, tolerance, total)
        finer = FinerPanels.of(old, factor)
        # One call for all points.
        values = finer.values(old, self._channels(finer.fresh_times(self.end)))
        # What was sampled before has had its ends corrected.
        series = series_through(finer.degree, finer.left, finer.right, values, self.end, finer.factor == 0)
        seen = np.flatnonzero((finer.factor == 1) & ~np.isnan(old.gaps[finer.origin, 0]))
        self._keep(series.with_gaps(seen, old.gaps[finer.origin[seen]]) if len(seen) else series)

    def _check_halves(self, factor: Integers, left: Array, width: Array, tolerance: float, total: float) -> None:
        """Raise AccuracyNotReached where halving panels does not end; `total` : of their errors [rad]."""
        halves = factor == 0
        if not halves.any():
            return
        if (width[halves] < _LEAST_WIDTH * self._span).any() or len(factor) > self._most_panels:
            where = float(left[halves][np.argmin(width[halves])])
            raise AccuracyNotReached(
                f"the shape motion is rough near t = {where:.12g} s: an error of {total:.3g} rad is left, "
                f"{tolerance:.3g} was requested; declare the times of its jumps as breaks, smooth the data, or "
                "loosen the tolerance"
            )

    def _keep(self, series: PanelSeries) -> None:
        self._series, self._errors, self._interpolant, self._halves = series, None, None, None

    def _errors_at(self, momentum: float) -> PanelErrors:
        if self._errors is None or self._errors[0] != momentum:
            self._errors = momentum, panel_errors(self.series, self.hidden, momentum)
        return self._errors[1]

    def _panels_at_rest(self, left: Array, right: Array) -> Mask:
        """Panels on which nothing moves: one sample each is enough."""
        at_rest = np.full(len(left), self._oscillations == 0.0)
        if self._oscillations == 0.0 or self._probe is None:
            return at_rest
        for fractions in (_TEST_FRACTIONS[31:32], _TEST_FRACTIONS):
            rows = np.flatnonzero(~at_rest) if len(fractions) == 1 else np.flatnonzero(at_rest)
            times = left[rows, None] + (right - left)[rows, None] * fractions
            seen = self._probe(times.ravel()).reshape(len(rows), len(fractions), -1)
            at_rest[rows] = ~seen[:, :, seen.shape[-1] // 2 :].any(axis=(1, 2))
            if not at_rest.any():
                break
        return at_rest

    def _check_between_nodes(self) -> bool:
        """Compare new panels of a black box with samples between their nodes. False: no panel was new."""
        series = self.series
        new = np.flatnonzero(np.isnan(series.gaps[:, 0]) & (series.degree > 0))
        if not len(new):
            return False
        gaps = np.empty((len(new), 2))
        for degree in np.unique(series.degree[new]).tolist():
            of_degree = series.degree[new] == degree
            rows = new[of_degree]
            left, width = series.left[rows, None], series.width[rows, None]
            points = self._suspicious_points(degree, series.left[rows], series.right[rows])
            here = chebyshev(2.0 * points - 1.0, degree + 1) @ series.coefficients[rows, : degree + 1]
            truth = self._channels((left + width * points).ravel()).reshape(*points.shape, 9)
            gaps[of_degree] = spectral_norms(here - truth).max(axis=1)
        self._keep(series.with_gaps(new, gaps))
        return True

    def _suspicious_points(self, degree: int, left: Array, right: Array) -> Array:
        """Where in panels of a degree (in [0, 1]) the probe is farthest from its own interpolant: (R, k)."""
        if self._probe is None:
            return np.broadcast_to(_TEST_FRACTIONS[::16], (len(left), 4))
        there = chebyshev(2.0 * _TEST_FRACTIONS - 1.0, degree + 1) @ values_to_coefficients(degree)
        nodes = nodes_on(*inside(left, right), degree)
        between = left[:, None] + (right - left)[:, None] * _TEST_FRACTIONS
        seen, truth = (self._probe(t.ravel()).reshape(*t.shape, -1) for t in (nodes, between))
        gap = np.abs(there @ seen - truth)
        half = gap.shape[-1] // 2
        worst = [np.argmax(part.max(axis=-1), axis=1) for part in (gap[..., :half], gap[..., half:])]
        return _TEST_FRACTIONS[np.stack(worst, axis=-1)]
