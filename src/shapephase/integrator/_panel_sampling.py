"""Any deformation sampled on panels between its breaks, at nested Chebyshev points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from ..arrays import Array, Integers, Mask
from ..chebyshev import chebyshev, inside, nodes_on, values_to_coefficients
from ..errors import AccuracyNotReached
from ._last_terms import Perturbed, perturbed_series
from ._spectral_error import Channels, SpectralEstimate, averaged_share, estimate_spectrum, spectral_norms
from .interpolant import Interpolant
from .resolved import Hidden, ResolvedPath

# Tolerance [rad] from which on, and the degree to begin with on many panels and on a few.
_FIRST_DEGREES = ((1e-7, 5, 10), (1e-11, 10, 10), (0.0, 15, 30))
# Of both halves of a bisected panel: enough to see how fast the spectrum decays.
_HALF_DEGREE = 10
# The highest of a panel; bisecting needs fewer samples than a higher degree.
_HIGHEST_DEGREE = 80
# Panels before bisecting ends, besides 40 for every break: a motion that needs more is rough, not merely long.
_MOST_PANELS = 4000
# Of the tolerance: what the first panels may leave hidden of a path that is resolved.
_HIDDEN_SHARE = 0.1
# Of the root of the sum of squared noises: their sum is hardly ever larger.
_NOISE_FACTOR = 4.0
# Of a panel, relative to the interval: narrower ones would consist of rounding.
_LEAST_WIDTH = 1e-13
# Sixty-four points of a panel, none of them a node: a low-discrepancy sequence.
_TEST_FRACTIONS = np.sort(np.mod(0.5 + 0.6180339887498949 * np.arange(64, dtype=np.float64), 1.0))


@dataclass(frozen=True, eq=False)
class PanelGroup:
    """Panels of one degree."""

    degree: int
    left: Array
    right: Array
    values: Array  # (G, degree + 1, 9) at the ascending Chebyshev points
    coefficients: Array  # (G, degree + 1, 9) of the Chebyshev series through them
    gaps: Array  # (G, 2) errors seen between the nodes; NaN: not checked
    estimate: SpectralEstimate

    @property
    def width(self) -> Array:
        return self.right - self.left

    def kept(self, rows: Mask) -> PanelGroup:
        return panel_group(self.degree, self.left[rows], self.right[rows], self.values[rows], self.gaps[rows])


def panel_group(degree: int, left: Array, right: Array, values: Array, gaps: Array | None = None) -> PanelGroup:
    """Panels of one degree with their values (G, degree + 1, 9), their series and the errors of these."""
    rounding = 2.0 * np.spacing(np.abs(right)) / (right - left)
    coefficients = values_to_coefficients(degree) @ values
    estimate = estimate_spectrum(spectral_norms(coefficients), rounding)
    if gaps is None:
        gaps = np.full((len(left), 2), np.nan)
    seen = ~np.isnan(gaps[:, 0])
    if seen.any():
        estimate = estimate.raised_to(2.0 * np.nan_to_num(gaps), seen)
    return PanelGroup(
        degree=degree, left=left, right=right, values=values, coefficients=coefficients, gaps=gaps, estimate=estimate
    )


@dataclass(frozen=True, eq=False)
class PanelsToSample:
    """Panels to be sampled at a degree; `known` are the values at a lower degree that divides it."""

    degree: int
    left: Array
    right: Array
    known: Array | None

    def new_points(self) -> Array:
        """(G, m) times; the ends are moved a little inwards, to this side of a break."""
        nodes = nodes_on(self.left, self.right, self.degree)
        if self.known is not None:
            return nodes[:, ~self._old()]
        if self.degree:
            nodes[:, 0], nodes[:, -1] = inside(self.left, self.right)
        return nodes

    def with_values(self, fresh: Array) -> Array:
        """(G, degree + 1, 9)."""
        if self.known is None:
            return self._with_true_ends(fresh) if self.degree else fresh
        whole = np.empty((len(self.left), self.degree + 1, 9))
        old = self._old()
        whole[:, old], whole[:, ~old] = self.known, fresh
        return whole

    def _with_true_ends(self, values: Array) -> Array:
        """Values at the very ends from those a little inwards, along the polynomial's slope there."""
        degrees = np.arange(self.degree + 1.0)
        slopes = np.stack([(-1.0) ** (degrees + 1.0), np.ones_like(degrees)]) * degrees**2
        at_ends = slopes @ (values_to_coefficients(self.degree) @ values)
        first, _ = inside(self.left, self.right)
        shift = (2.0 * (first - self.left) / (self.right - self.left))[:, None]
        values = values.copy()
        values[:, 0] -= shift * at_ends[:, 0]
        values[:, -1] += shift * at_ends[:, 1]
        return values

    def _old(self) -> Mask:
        count = 1 if self.known is None else self.known.shape[1] - 1
        return np.arange(self.degree + 1) % (self.degree // count) == 0


class PanelSampler:
    """Samples on panels between the breaks, at nested Chebyshev points."""

    def __init__(
        self,
        channels: Channels,
        breaks: Array,
        loops: int,
        oscillations: float | None,
        probe: Callable[[Array], Array] | None,
        resolved: ResolvedPath | None = None,
        *,
        checked: bool = False,
    ) -> None:
        self._channels, self._probe, self._loops, self._resolved = channels, probe, loops, resolved
        self._is_bandlimited = oscillations is not None or (resolved is not None and not checked)
        self._span = float(breaks[-1] - breaks[0])
        self._most_panels = _MOST_PANELS + 40 * len(breaks)
        pieces = 4 if oscillations is None else max(1, int(np.ceil(oscillations / 2.0)))
        ends = [np.linspace(left, right, pieces + 1) for left, right in pairwise(breaks)]
        self._left, self._right = np.concatenate([e[:-1] for e in ends]), np.concatenate([e[1:] for e in ends])
        self._at_rest = oscillations == 0.0
        self._groups: dict[int, PanelGroup] = {}
        self._known_hidden: dict[int, tuple[PanelGroup, Hidden]] = {}
        self._interpolant: Interpolant | None = None

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        if not self._groups and self._resolved is not None:
            first = self._resolved.first_panels(_HIDDEN_SHARE * tolerance)
            rows = [(int(d), first.degree == d) for d in np.unique(first.degree)]
            self._add([PanelsToSample(d, first.left[r], first.right[r], None) for d, r in rows])
        elif not self._groups:
            of_many, of_few = next(degrees for least, *degrees in _FIRST_DEGREES if tolerance > least)
            at_rest = self._panels_at_rest()
            parts = ((0, at_rest), (of_many if len(self._left) > 4 else of_few, ~at_rest))
            self._add([PanelsToSample(d, self._left[rows], self._right[rows], None) for d, rows in parts if rows.any()])
        while True:
            hidden = {d: self._hidden(d, momentum)[0] for d in self._groups}
            errors = {
                d: np.maximum(g.estimate.error(momentum, g.width, 2.0 * d), hidden[d]) for d, g in self._groups.items()
            }
            total = self._loops * sum(float(e.sum()) for e in errors.values())
            if total <= tolerance:
                if self._is_bandlimited or not self._check_between_nodes():
                    return
                continue
            share = tolerance / (self._span * self._loops)
            rough = {
                d: (errors[d] > share * g.width) & (~g.estimate.at_rounding | (hidden[d] > share * g.width))
                for d, g in self._groups.items()
            }
            if not any(rows.any() for rows in rough.values()):
                return
            self._refine_panels(rough, errors, tolerance, total)

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        total, noises = 0.0, []
        for degree, g in self._groups.items():
            hidden, noise = self._hidden(degree, momentum)
            total += float(np.maximum(g.estimate.error(momentum, g.width, 2.0 * degree), hidden).sum())
            noises.append(noise)
        return self._loops * (total + sum_of_noise(np.concatenate(noises)))

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        if self._interpolant is None:
            groups = list(self._groups.values())
            left = np.concatenate([g.left for g in groups])
            coefficients = np.zeros((len(left), max(self._groups) + 1, 9))
            start = 0
            for g in groups:
                coefficients[start : start + len(g.left), : g.degree + 1] = g.coefficients
                start += len(g.left)
            order = np.argsort(left)
            edges = np.append(left[order], max(float(g.right.max()) for g in groups))
            if self._loops > 1:
                starts = edges[-1] * np.arange(self._loops)
                edges = np.append((starts[:, None] + edges[:-1]).ravel(), self._loops * edges[-1])
            self._interpolant = Interpolant(edges, coefficients[order], self._loops, self._channels.count)
        return self._interpolant

    def perturbed(self, momentum: float) -> Perturbed:
        """As `Sampler.perturbed`."""
        degrees = np.concatenate([np.full(len(g.left), d) for d, g in self._groups.items()])
        left = np.concatenate([g.left for g in self._groups.values()])
        hidden, noises = 0.0, []
        for degree, g in self._groups.items():
            between, noise = self._hidden(degree, momentum)
            seen = 0.5 * g.width * (np.nan_to_num(g.gaps) @ np.array([momentum, 1.0]))
            hidden += float((between + seen).sum())
            noises.append(noise)
        hidden += sum_of_noise(np.concatenate(noises))
        interpolant, order = self.interpolant(), np.argsort(left)
        widths = np.diff(interpolant.edges[: len(left) + 1])
        make = partial(perturbed_series, interpolant.coefficients, degrees[order], widths, momentum)
        return Perturbed(make, self._loops * hidden)

    def _refine_panels(self, rough: dict[int, Mask], errors: dict[int, Array], tolerance: float, total: float) -> None:
        """Raise the degree where the spectrum decays fast enough for that to do, else bisect."""
        to_sample: list[PanelsToSample] = []
        too_many = self._panel_count > self._most_panels
        for degree, rows in rough.items():
            if not rows.any():
                continue
            g = self._groups.pop(degree)
            share = tolerance / (self._span * self._loops) * g.width
            with np.errstate(divide="ignore", invalid="ignore"):
                missing = np.log(np.maximum(errors[degree] / share, 1.0)) / g.estimate.decay
            # Without any missing degrees, the error was seen between the nodes: the degree is doubled.
            factor = np.clip(np.ceil(np.nan_to_num(missing, nan=0.0, posinf=9.9 * degree) / degree + 0.9), 2, 4)
            factor[(missing > 3.1 * degree) | (factor * degree > _HIGHEST_DEGREE)] = 0
            halves = rows & (factor == 0)
            if (g.width[halves] < _LEAST_WIDTH * self._span).any() or (too_many and halves.any()):
                where = float(g.left[halves][np.argmin(g.width[halves])])
                raise AccuracyNotReached(
                    f"the shape motion is rough near t = {where:.12g} s: an error of {total:.3g} rad is left, "
                    f"{tolerance:.3g} was requested; declare the times of its jumps as breaks, smooth the data, or "
                    "loosen the tolerance"
                )
            if not rows.all():
                self._groups[degree] = g.kept(~rows)
            for times in (2, 3, 4):
                grows = rows & (factor == times)
                if grows.any():
                    to_sample.append(PanelsToSample(times * degree, g.left[grows], g.right[grows], g.values[grows]))
            if halves.any():
                left, right = g.left[halves], g.right[halves]
                middle = 0.5 * (left + right)
                ends = np.concatenate([left, middle]), np.concatenate([middle, right])
                to_sample.append(PanelsToSample(_HALF_DEGREE, *ends, None))
        self._add(to_sample)

    def _hidden(self, degree: int, momentum: float) -> tuple[Array, Array]:
        """What of a resolved path lies beyond the nodes of the panels of a degree, and its noise there: (G,) [rad]."""
        g = self._groups[degree]
        if self._resolved is None or not degree:
            return np.zeros(len(g.left)), np.zeros(len(g.left))
        if self._known_hidden.get(degree, (None,))[0] is not g:
            self._known_hidden[degree] = g, self._resolved.hidden(g.left, g.right, degree)
        return hidden_errors(self._known_hidden[degree][1], g, momentum)

    @property
    def is_checked(self) -> bool:
        """Whether its interpolant is compared with the deformation between the nodes."""
        return not self._is_bandlimited

    @property
    def panels(self) -> list[tuple[PanelsToSample, Hidden | None]]:
        """The panels of each degree so far, and what of a resolved path lies beyond it."""
        found = []
        for degree, g in sorted(self._groups.items()):
            resolved = self._resolved if degree else None
            hidden = None if resolved is None else resolved.hidden(g.left, g.right, degree)
            found.append((PanelsToSample(degree, g.left, g.right, None), hidden))
        return found

    def _panels_at_rest(self) -> Mask:
        """Panels on which nothing moves: one sample each is enough."""
        at_rest = np.full(len(self._left), self._at_rest)
        if self._at_rest or self._probe is None:
            return at_rest
        for fractions in (_TEST_FRACTIONS[31:32], _TEST_FRACTIONS):
            rows = np.flatnonzero(~at_rest) if len(fractions) == 1 else np.flatnonzero(at_rest)
            times = self._left[rows, None] + (self._right - self._left)[rows, None] * fractions
            seen = self._probe(times.ravel()).reshape(len(rows), len(fractions), -1)
            at_rest[rows] = ~seen[:, :, seen.shape[-1] // 2 :].any(axis=(1, 2))
            if not at_rest.any():
                break
        return at_rest

    @property
    def _panel_count(self) -> int:
        return sum(len(g.left) for g in self._groups.values())

    def _add(self, to_sample: list[PanelsToSample]) -> None:
        """Sample new panels, and those whose degree is raised; one call for all points."""
        self._interpolant = None
        times = [panels.new_points() for panels in to_sample]
        values = self._channels(np.concatenate([t.ravel() for t in times]))
        start = 0
        for panels, points in zip(to_sample, times, strict=True):
            whole = panels.with_values(values[start : start + points.size].reshape(*points.shape, 9))
            start += points.size
            left, right, gaps = panels.left, panels.right, None
            if panels.degree in self._groups:
                g = self._groups[panels.degree]
                gaps = np.concatenate([g.gaps, np.full((len(left), 2), np.nan)])
                left, right = np.concatenate([g.left, left]), np.concatenate([g.right, right])
                whole = np.concatenate([g.values, whole])
            gaps = None if self._is_bandlimited else gaps
            self._groups[panels.degree] = panel_group(panels.degree, left, right, whole, gaps)

    def _check_between_nodes(self) -> bool:
        """Compare new panels of a black box with samples between their nodes. False: no panel was new."""
        self._interpolant = None
        found = False
        for degree, g in list(self._groups.items()):
            rows = np.flatnonzero(np.isnan(g.gaps[:, 0]))
            if not len(rows) or not degree:
                continue
            found = True
            points = self._suspicious_points(g, rows)
            there = chebyshev(2.0 * points - 1.0, degree + 1) @ values_to_coefficients(degree)
            between = g.left[rows, None] + g.width[rows, None] * points
            truth = self._channels(between.ravel()).reshape(*points.shape, 9)
            gaps = g.gaps.copy()
            gaps[rows] = spectral_norms(there @ g.values[rows] - truth).max(axis=1)
            self._groups[degree] = panel_group(degree, g.left, g.right, g.values, gaps)
        return found

    def _suspicious_points(self, g: PanelGroup, rows: Integers) -> Array:
        """Where in the panels (in [0, 1]) the probe is farthest from its own interpolant: (R, k)."""
        if self._probe is None:
            return np.broadcast_to(_TEST_FRACTIONS[::16], (len(rows), 4))
        there = chebyshev(2.0 * _TEST_FRACTIONS - 1.0, g.degree + 1) @ values_to_coefficients(g.degree)
        nodes = nodes_on(*inside(g.left[rows], g.right[rows]), g.degree)
        between = g.left[rows, None] + g.width[rows, None] * _TEST_FRACTIONS
        seen, truth = (self._probe(t.ravel()).reshape(*t.shape, -1) for t in (nodes, between))
        gap = np.abs(there @ seen - truth)
        half = gap.shape[-1] // 2
        worst = [np.argmax(part.max(axis=-1), axis=1) for part in (gap[..., :half], gap[..., half:])]
        return _TEST_FRACTIONS[np.stack(worst, axis=-1)]


def hidden_errors(hidden: Hidden, g: PanelGroup, momentum: float) -> tuple[Array, Array]:
    """What lies beyond the nodes of panels turns a body, and its noise: (G,) [rad]."""
    # A shape that is off turns the body by the inertia, for as long as the panel lasts.
    turn = momentum * g.estimate.inverse_norm * g.width
    share = averaged_share(2.0 * g.degree, turn + g.width * g.estimate.drift_norm)
    shapes, rates = (share[:, None] * hidden.higher + hidden.misfit).T
    return shapes * turn + rates, hidden.noise * (1.0 + turn)


def sum_of_noise(noise: Array) -> float:
    """Of panels whose noise is independent of one another: (P,)."""
    return min(float(noise.sum()), _NOISE_FACTOR * float(np.sqrt((noise * noise).sum())))
