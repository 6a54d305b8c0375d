"""A deformation along a recorded path, sampled on panels that span as many knots as the tolerance allows."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ...arrays import Array, Integers, Mask
from ...chebyshev import chebyshev, local_coordinate, nodes_on, unit_nodes, values_to_coefficients
from ...errors import AccuracyNotReached
from .._last_terms import Perturbed
from .._spectral_error import EPS, Channels, SampledChannels, spectral_norms
from ..fast import engine
from ..interpolant import Interpolant
from .body_series import falling_terms
from .knot_path import KnotPath, blocks
from .panel_choice import DEGREES, first_panels, interval_degrees
from .polynomial_fit import missing_terms

# Of the tolerance: what panels may leave hidden of the path before others are looked for.
_HIDDEN_SHARE = 0.35
# Of the tolerance: what one panel may add within itself, and what all may add that are left as they are.
_WITHIN_SHARE = 0.4
_KEPT_SHARE = 0.5
# The highest degree of a panel; halving needs fewer samples than a higher one.
_HIGHEST_DEGREE = 64
# Numbers in the coefficients of all panels, padded to one degree: 160 megabytes. From there panels are rather halved.
_MOST_COEFFICIENTS = 20_000_000
# Nodes of panels that are worked on together: arrays of them stay below ten megabytes.
_NODES_AT_ONCE = 60_000
# Shapes at which a body is evaluated at once.
_BODIES_AT_ONCE = 10_000
# Rounds of refinement; degrees double, and panels are halved, in each.
_MOST_ROUNDS = 40
# Panels for each interval between two knots, and besides: a body that needs more is no smooth function of its shape.
_MOST_PANELS = (8, 4000)
# Of a panel, relative to the duration: narrower ones would consist of rounding.
_LEAST_WIDTH = 1e-13
# Rounding of a coefficient, relative to the largest: samples are right to some ten units, and their sums to thirty.
_ROUNDING = 30.0 * EPS
# Of the floor of rounding: what a panel adds at least.
_LEAST_OF_FLOOR = 0.01
# Of the root of the number of panels: how far a sum of roundings may be from what is usual.
_RANDOM = 2.0
# Intervals of a panel that hides too much, up to which each is sampled by itself: halves often hide too much, too.
_SHORT = 128
# A series falls by no more than this part of the sweep from degree to degree: faster decay is chance.
_FASTEST_DECAY = 0.05
# The decay of a body's series, where only the sweep tells it.
_DECAY_OF_SWEEP = 0.4
# Up to here a series is too short to show how it falls.
_LOW_DEGREE = 8
# Intervals in a row whose last terms, beside what is expected of them, count together: single ones are small by chance.
_NEIGHBOURS = 16
# Of the terms in the middle of a series: a tail that should be that many times smaller still, and is not even that
# small, is rounding.
_STAYS = 0.1
_FALLS = 0.01
# Slower decay than this is none.
_SLOWEST_DECAY = 0.7
# Of the integral of the first missing terms of a series, as its decay tells them.
_SAFETY_FACTOR = 4.0
# Keeps quotients of coefficients defined where these are zero.
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class _Group:
    """Panels of one degree: rows (G,) of series (P, n, 9), of which no more terms than the degree has are theirs."""

    degree: int
    left: Array
    right: Array
    series: Array
    rows: Integers

    @property
    def width(self) -> Array:
        return self.right - self.left

    @property
    def coefficients(self) -> Array:
        """Chebyshev coefficients of the channels, a copy: (G, degree + 1, 9)."""
        return self.series[self.rows, : self.degree + 1]

    def of(self, rows: Mask | Integers) -> _Group:
        return replace(self, left=self.left[rows], right=self.right[rows], rows=self.rows[rows])

    def kept(self, rows: Mask) -> _Group:
        """The same without the series of the others."""
        found = self.of(rows)
        return replace(found, series=found.coefficients, rows=np.arange(len(found.left)))

    def joined(self, other: _Group) -> _Group:
        left, right = np.concatenate([self.left, other.left]), np.concatenate([self.right, other.right])
        series = np.concatenate([self.coefficients, other.coefficients])
        return _Group(self.degree, left, right, series, np.arange(len(left)))


@dataclass(frozen=True, eq=False)
class _ToSample:
    """Panels to be sampled at a degree; `known` are the values at half of it."""

    degree: int
    left: Array
    right: Array
    known: Array | None

    def of(self, rows: Integers) -> _ToSample:
        known = None if self.known is None else self.known[rows]
        return _ToSample(self.degree, self.left[rows], self.right[rows], known)


@dataclass(frozen=True, eq=False)
class _PanelErrors:
    """Errors of the attitude due to the panels of a group [rad]: (G,) each."""

    adding: Array  # what adds up from panel to panel
    within: Array  # what does not
    hidden: Mask  # whether the path beyond the nodes is the larger part
    at_rounding: Mask

    def of(self, rows: Mask) -> _PanelErrors:
        return _PanelErrors(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def joined(cls, parts: list[_PanelErrors]) -> _PanelErrors:
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


class KnotSampler:
    """Samples a body along a path of polynomials between knots."""

    def __init__(self, path: KnotPath, loops: int, body_channels: SampledChannels) -> None:
        self._path, self._loops, self._body_channels = path, loops, body_channels
        self._count = 0
        self._span = float(path.knots[-1])
        self._groups: dict[int, _Group] = {}
        # Of the first panels of groups, for a momentum.
        self._known_errors: dict[int, _PanelErrors] = {}
        self._known_for = np.nan
        self._planned = np.inf
        self._interpolant: Interpolant | None = None

    @property
    def evaluations(self) -> int:
        """How many times the body was asked so far."""
        return self._count

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        goal = tolerance / self._loops
        for _ in range(_MOST_ROUNDS):
            total = self.error(momentum)
            if self._groups and total <= tolerance:
                return
            errors = self._errors_by_degree(momentum)
            hidden = sum(float(errors[d].adding[errors[d].hidden].sum()) for d in errors)
            if self._planned > goal and (not self._groups or hidden > _HIDDEN_SHARE * goal):
                self._plan(goal, momentum)
                continue
            level = _level(np.concatenate([found.adding for found in errors.values()]), _KEPT_SHARE * goal)
            rough = {
                degree: ((found.adding > level) | (found.within > _WITHIN_SHARE * tolerance)) & ~found.at_rounding
                for degree, found in errors.items()
            }
            if not any(rows.any() for rows in rough.values()):
                return
            self._refine_panels(rough, errors, momentum, tolerance, total)

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        errors = self._errors_by_degree(momentum).values()
        adding = sum(float(found.adding.sum()) for found in errors)
        return self._loops * adding + max((float(found.within.max(initial=0.0)) for found in errors), default=0.0)

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        if self._interpolant is None:
            self._interpolant = self._joined()
        return self._interpolant

    def _joined(self) -> Interpolant:
        groups = list(self._groups.values())
        left = np.concatenate([g.left for g in groups])
        end = max(float(g.right.max()) for g in groups)
        order, place = _order_and_places(left)
        coefficients, start = groups[0].series, 0
        # Series are handed on as they stand only where they stand in the order of the edges.
        in_order = all(g.series is coefficients for g in groups) and len(coefficients) == len(left)
        if not in_order or (np.concatenate([g.rows for g in groups]) != place).any():
            coefficients = np.zeros((len(left), max(self._groups) + 1, 9))
        while groups:
            group = groups.pop(0)
            rows = place[start : start + len(group.left)]
            start += len(rows)
            if group.series is coefficients:
                continue
            for part in blocks(np.arange(len(rows)), np.full(len(rows), group.degree + 1), _NODES_AT_ONCE):
                coefficients[rows[part], : group.degree + 1] = group.of(part).coefficients
            # Series of its own would be as large again.
            self._groups[group.degree] = replace(group, series=coefficients, rows=rows)
        edges = np.append(left[order], end)
        if self._loops > 1:
            starts = edges[-1] * np.arange(self._loops)
            edges = np.append((starts[:, None] + edges[:-1]).ravel(), self._loops * edges[-1])
        return Interpolant(edges, coefficients, self._loops, self._count)

    def perturbed(self, momentum: float) -> Perturbed:
        """As `Sampler.perturbed`: what is missing is known better than the last terms could tell."""
        return Perturbed.same(self.interpolant().coefficients, self.error(momentum))

    def channels(self, times: Array) -> Array:
        """As `Sampler.channels`: along the polynomials that stand for the path."""
        interpolant = self.interpolant()
        panel = interpolant.panel_of(times)
        left, right = interpolant.edges[panel], interpolant.edges[panel + 1]
        local, found = local_coordinate(times, left, right), np.empty((len(times), 9))
        for degree, group in self._groups.items():
            mine = np.flatnonzero(np.isin(left, group.left))
            if not len(mine):
                continue
            to_series = chebyshev(local[mine], degree + 1) @ values_to_coefficients(degree)
            states = self._path.states(left[mine], right[mine], degree)
            shapes, rates = ((to_series[:, None] @ state)[:, 0] for state in states)
            found[mine] = self._channels(shapes, rates, times[mine])
        return found

    def body_channels(self, times: Array) -> Array:
        """As `Sampler.body_channels`: along the recorded path itself."""
        return self._body_channels(times)

    def joined_panels(self) -> Integers:
        """As `Sampler.joined_panels`: all but those that end where the rate jumps."""
        interpolant = self.interpolant()
        inner = interpolant.edges[1 : len(interpolant.coefficients)]
        return np.flatnonzero(~np.isin(inner, self._path.knots[self._path.corners]))

    # ---- Samples ----

    def _plan(self, goal: float, momentum: float) -> None:
        """Panels for a tolerance; those that were sampled stay as they are."""
        plan = first_panels(self._path, goal, momentum)
        self._planned = goal
        known, self._groups = self._groups, {}
        left, right, degree = plan.left, plan.right, plan.degree
        for old in known.values():
            order = np.argsort(old.left)
            row = order[np.clip(np.searchsorted(old.left[order], left), 0, len(order) - 1)]
            same = (old.left[row] == left) & (old.right[row] == right) & (degree <= old.degree)
            keep = np.zeros(len(old.left), dtype=bool)
            keep[row[same]] = True
            self._keep(old, keep)
            left, right, degree = left[~same], right[~same], degree[~same]
        self._sample([_ToSample(int(d), left[degree == d], right[degree == d], None) for d in np.unique(degree)])

    def _sample(self, parts: list[_ToSample]) -> None:
        """Sample panels, some thousand neighbours at a time."""
        self._interpolant = None
        left = np.concatenate([part.left for part in parts])
        number = np.concatenate([np.full(len(part.left), i) for i, part in enumerate(parts)])
        row = np.concatenate([np.arange(len(part.left)) for part in parts])
        degree = np.array([part.degree for part in parts])[number]
        order, place = _order_and_places(left)
        series = np.zeros((len(left), int(degree.max()) + 1, 9))
        for block in blocks(order, degree[order] + 1, _NODES_AT_ONCE):
            mine = [block[number[block] == i] for i in range(len(parts))]
            values = self._sampled([part.of(row[chosen]) for part, chosen in zip(parts, mine, strict=True)])
            for part, chosen, found in zip(parts, mine, values, strict=True):
                series[place[chosen], : part.degree + 1] = values_to_coefficients(part.degree) @ found
        for i, part in enumerate(parts):
            fresh = _Group(part.degree, part.left, part.right, series, place[number == i])
            known = self._groups.get(part.degree)
            self._groups[part.degree] = fresh if known is None else known.joined(fresh)

    def _keep(self, group: _Group, rows: Mask) -> None:
        """Of a group and its errors only some panels."""
        errors = self._known_errors.pop(group.degree, None)
        if rows.any():
            self._groups[group.degree] = group.kept(rows)
            if errors is not None:
                self._known_errors[group.degree] = errors.of(rows)

    def _sampled(self, parts: list[_ToSample]) -> list[Array]:
        """The channels at the nodes of panels, (G, degree + 1, 9) for each part.

        Neighbours share the sample at their common end, where shapes and rates are continuous.
        """
        corners = self._path.knots[self._path.corners]
        times: list[Array] = []
        states: list[list[Array]] = []
        for part in parts:
            nodes = nodes_on(part.left, part.right, part.degree)
            if part.degree:
                # At a corner the rate is that on this side of it.
                ends = np.where(np.isin(part.right, corners), np.nextafter(part.right, -np.inf), part.right)
                nodes[:, 0], nodes[:, -1] = part.left, ends
            chosen = slice(None) if part.known is None else slice(1, None, 2)
            times.append(nodes[:, chosen])
            states.append([state[:, chosen] for state in self._path.states(part.left, part.right, part.degree)])
        shapes, rates = (np.concatenate([s[i].reshape(-1, s[i].shape[2]) for s in states]) for i in (0, 1))
        whole = np.concatenate([points.ravel() for points in times])
        distinct, rows, place = np.unique(whole, return_index=True, return_inverse=True)
        values = np.empty((len(rows), 9))
        for first in range(0, len(rows), _BODIES_AT_ONCE):
            part = rows[first : first + _BODIES_AT_ONCE]
            values[first : first + _BODIES_AT_ONCE] = self._channels(
                shapes[part], rates[part], distinct[first : first + _BODIES_AT_ONCE]
            )
        found: list[Array] = []
        start = 0
        for part, points in zip(parts, times, strict=True):
            fresh = values[place[start : start + points.size]].reshape(*points.shape, 9)
            start += points.size
            if part.known is not None:
                both = np.empty((len(part.left), part.degree + 1, 9))
                both[:, ::2], both[:, 1::2] = part.known, fresh
                fresh = both
            found.append(fresh)
        return found

    def _channels(self, shapes: Array, rates: Array, times: Array) -> Array:
        """The channels at shapes and rates (N, n), and times that messages name: (N, 9)."""
        self._count += len(times)
        path = self._path
        directly = (lambda _: path.directly(shapes, rates)) if engine.is_ready() else None
        return Channels(lambda _: path.follow(shapes, rates), directly)(times)

    def _refine_panels(
        self, rough: dict[int, Mask], errors: dict[int, _PanelErrors], momentum: float, tolerance: float, total: float
    ) -> None:
        """Double the degree where the body's series falls, else part at the knots: at all of them, or halve."""
        parts: list[_ToSample] = []
        changes: list[tuple[_Group, Mask, Mask, Mask]] = []
        panels = sum(len(g.left) for g in self._groups.values())
        highest = min(_HIGHEST_DEGREE, max(2 * DEGREES[0], _MOST_COEFFICIENTS // (9 * panels)))
        for degree, rows in rough.items():
            if not rows.any():
                continue
            group = self._groups[degree]
            grows = rows & ~errors[degree].hidden & (0 < 2 * degree <= highest)
            halves = rows & ~grows
            too_many = panels > _MOST_PANELS[0] * len(self._path.knots) + _MOST_PANELS[1]
            if (group.width[halves] < _LEAST_WIDTH * self._span).any() or (too_many and halves.any()):
                where = float(group.left[halves][np.argmin(group.width[halves])])
                raise AccuracyNotReached(
                    f"the shape motion is rough near t = {where:.12g} s: an error of {total:.3g} rad is left, "
                    f"{tolerance:.3g} was requested; smooth the data, or loosen the tolerance"
                )
            changes.append((group, rows, grows, halves))
        # Nothing has changed yet where panels cannot be finer: what there is may do all the same.
        for group, rows, grows, halves in changes:
            degree = group.degree
            del self._groups[degree]
            self._keep(group, ~rows)
            first, last = self._path.intervals(group.left, group.right)
            # Over several knots another degree means another polynomial in the place of the path.
            for chosen, known in ((grows & (last - first == 1), True), (grows & (last - first > 1), False)):
                if chosen.any():
                    # The series at its own nodes, which are every other one of the new ones.
                    nodes = chebyshev(unit_nodes(degree), degree + 1)
                    values = nodes @ group.of(chosen).coefficients if known else None
                    parts.append(_ToSample(2 * degree, group.left[chosen], group.right[chosen], values))
            torn = halves & (last - first > 1) & (last - first <= _SHORT)
            if torn.any():
                one = np.concatenate([np.arange(a, b) for a, b in zip(first[torn], last[torn], strict=True)])
                degrees = interval_degrees(self._path, one, tolerance / self._loops, momentum)
                for each in np.unique(degrees):
                    chosen = one[degrees == each]
                    ends = self._path.knots[chosen], self._path.knots[chosen + 1]
                    parts.append(_ToSample(int(each), *ends, None))
            cut = halves & ~torn
            if cut.any():
                left, right = group.left[cut], group.right[cut]
                middle = self._path.middle(left, right)
                half = next(d for d in DEGREES if d >= min(0.6 * degree, DEGREES[-1]))
                parts.append(_ToSample(half, np.concatenate([left, middle]), np.concatenate([middle, right]), None))
        self._sample(parts)

    # ---- Errors ----

    def _errors_by_degree(self, momentum: float) -> dict[int, _PanelErrors]:
        if momentum != self._known_for:
            self._known_errors, self._known_for = {}, momentum
        for degree, group in self._groups.items():
            known = self._known_errors.get(degree)
            fresh = np.arange(0 if known is None else len(known.adding), len(group.left))
            parts = blocks(fresh, np.full(len(fresh), degree + 1), _NODES_AT_ONCE)
            found = [self._errors_of(group.of(part), momentum) for part in parts]
            if found:
                self._known_errors[degree] = _PanelErrors.joined(([] if known is None else [known]) + found)
        return {degree: self._known_errors[degree] for degree in self._groups}

    def _errors_of(self, group: _Group, momentum: float) -> _PanelErrors:
        degree, width = group.degree, group.width
        count = len(width)
        if not degree:
            zero = np.zeros(count)
            return _PanelErrors(zero, zero, zero > 0.0, zero == 0.0)
        norms = spectral_norms(group.coefficients)
        weights = np.array([momentum, 1.0])
        hidden = self._path.hidden(group.left, group.right, degree, momentum)
        sizes, explained = norms @ weights, hidden.explained @ weights
        largest = sizes.max(axis=1)
        rounding = 2.0 * np.spacing(np.abs(group.right)) / width
        floor = _ROUNDING * largest + 4.0 * rounding * (sizes @ np.arange(degree + 1.0))
        middle, last = degree // 2, max(2, degree // 8)
        tail = sizes[:, -last:].max(axis=1)
        sweep = self._path.sweep(group.left, group.right)
        before_tail = sizes[:, middle - 1 : middle + 1].max(axis=1)
        decay = (tail / np.maximum(before_tail, _TINY)) ** (1.0 / (degree - middle))
        # A tail that is the path's own, whose effect is known, says nothing of how the body's own series falls.
        kinked = tail <= (1.0 + sweep) * explained[:, -last:].max(axis=1)
        decay = np.where(kinked, np.minimum(decay, _DECAY_OF_SWEEP * sweep), decay)
        decay = np.clip(decay, np.minimum(_FASTEST_DECAY * sweep, _SLOWEST_DECAY), _SLOWEST_DECAY)
        terms = tail[:, None] * decay[:, None] ** np.maximum(np.arange(2.0 * degree + 1.0) - degree, 0.0)
        first, last = self._path.intervals(group.left, group.right)
        single = np.flatnonzero(last - first == 1)
        if degree <= _LOW_DEGREE:
            # So few terms do not show how they fall, but the polynomial that the path is there does.
            single = single[np.argsort(group.left[single])]
            growth = falling_terms(self._path, group.left[single], group.right[single], momentum, 2 * degree + 1)
            before = np.maximum(growth[:, degree - 1 : degree + 1].max(axis=1), _TINY)
            seen = np.where(tail[single] > floor[single], tail[single] / before, 0.0)
            terms[single] = _largest_of_neighbours(seen)[:, None] * growth
        adding, within = (_SAFETY_FACTOR * width * part for part in missing_terms(degree, terms))
        turn = width * (momentum * norms[:, :, 0].max(axis=1) + norms[:, :, 1].max(axis=1))
        adding += turn * within
        least = _LEAST_OF_FLOOR * width * floor
        # Below the floor there is no decay to be seen.
        at_floor = tail <= floor
        if degree >= _LOW_DEGREE:
            # Nor where the series has to fall and does not: the inverse of an ill-conditioned tensor has more rounding.
            falls = (_DECAY_OF_SWEEP * sweep[single]) ** (degree - middle) < _FALLS * _STAYS
            at_floor[single] |= falls & (tail[single] > _STAYS * before_tail[single])
        noise = width * tail / degree
        # Rounding of different panels adds up as random numbers do.
        random = min(1.0, _RANDOM / np.sqrt(sum(len(g.left) for g in self._groups.values())))
        smooth = np.maximum(np.where(at_floor, random * noise, adding), least)
        within = np.maximum(np.where(at_floor, noise, within), least)
        return _PanelErrors(
            adding=smooth + hidden.adding,
            within=within + hidden.within,
            hidden=hidden.adding + hidden.within > smooth + within,
            at_rounding=at_floor & (hidden.adding <= 4.0 * least),
        )


def _order_and_places(left: Array) -> tuple[Integers, Integers]:
    """How panels ascend, and the place of each: (P,), (P,)."""
    order = np.argsort(left)
    place = np.empty(len(left), dtype=np.int64)
    place[order] = np.arange(len(left))
    return order, place


def _largest_of_neighbours(numbers: Array) -> Array:
    """The largest of each few in a row: (G,) -> (G,)."""
    starts = np.arange(0, len(numbers), _NEIGHBOURS)
    largest = np.maximum.reduceat(numbers, starts) if len(starts) else numbers
    return np.repeat(largest, _NEIGHBOURS)[: len(numbers)]


def _level(errors: Array, share: float) -> float:
    """Above it are the fewest errors without which the others add up to no more than a share."""
    ascending = np.sort(errors)
    kept = int(np.searchsorted(np.cumsum(ascending), share))
    return float(ascending[kept - 1]) if kept else 0.0
