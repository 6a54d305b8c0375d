"""Scan of a function of time: it is resolved to its rounding before it is integrated.

The function is first sampled at some 5,200 unevenly spaced times with no gap above 1/4,000 of the duration. Chebyshev
series on panels, halved where they disagree with these samples or with their own neighbours, then resolve its columns.
A panel that is halved without end holds a kink: it is located to rounding, by the series on its two sides.
"""

from __future__ import annotations

import warnings
from itertools import pairwise

import numpy as np

from ... import run_progress
from ...arrays import Array, Integers, Mask
from ...chebyshev import derivative_matrix, nodes_on, unit_nodes
from ...errors import AccuracyNotReached, NoisyPathError, TrajectoryError, UndeclaredBreakWarning
from ...integrator.resolved import DEGREE, ResolvedPath
from ..curves import CLOSED
from ._kink_location import located_kink
from ._scan_panels import (
    CHECKS,
    PanelFit,
    Panels,
    Piece,
    ResolvedPanels,
    check_matrix,
    integral_matrix,
    polynomials,
    sample_times,
    transform,
)
from .function_scan import FunctionScan, ScannedFunction

_EPS = float(np.finfo(float).eps)
_FIRST_PANELS = (4, 2, 1)  # of the only piece, of each of up to four, of each of more
_ROUNDING = 32.0 * _EPS  # of a function's values and of a series through them, relative to the largest
_INNER_ROUNDING = 64.0 * _EPS  # relative to the path's largest shape or rate, which the function may subtract
_INNER_STEPS = 1e-12  # [rad] steps within the function, as by 1,000 + r - 1,000 or between an integrator's pieces
_STUBBORN = 0.2  # share left after halving a panel: a series gains digits, rounding stays
_TIME_ROUNDING = 8.0  # roundings of the times: changes in that time are not resolved
_LEAST_WIDTH = 1e-13  # relative to the duration: narrower panels hold only rounding
_KINK_WIDTH = 2.0**-12  # relative to the duration: narrower unresolved panels are searched for a kink
_MOST_PANELS = 4000  # and 40 per break: a path that needs more is rough, not merely long
_MOST_NOISE = 1e-9  # [rad], of rates times half a panel: less is covered by the tolerance, more is refused
_KINK_TICKS = 2.0  # roundings of times: accuracy of a located kink
_NOISE_MARGIN = 16.0  # error of a series through scattered values, over their scatter
_NOISE_PLACE = 0.4142  # place in a panel for the noise test: no node, no half of anything
_NOISE_TIMES = 10  # their median scatter is not moved by a single jump
_NOISE_STEP = 64.0  # roundings of times: no function changes in so short a time
_RATE_DEFECT = 1e-9  # [rad] larger differences between integrated rates and shapes are an error of the rates
_END_SLOPES = np.arange(DEGREE + 1.0) ** 2  # Chebyshev slopes at a panel's end, times half its width
_SLOPE_ROUNDING = 4.0 * _EPS  # in every coefficient of a series, relative to the largest value
_SLOPE_MARGIN = 8.0  # truncation of a slope, over the last coefficients
_LEAST_CORNER = 1e-8  # relative to the largest slope: a smaller difference at a common end is smooth
_NAMED_TIMES = 8  # times that a warning lists


def scanned(function: ScannedFunction, breaks: Array) -> FunctionScan:
    """Look at a function of which only its values are known.

    breaks : (M,) times between which it is declared smooth, first and last its ends [s]

    Raises TrajectoryError if what must be continuous jumps, or a rate is not the derivative of its value. Raises
    NoisyPathError if the values carry noise. Raises AccuracyNotReached if it is too rough for some thousands of panels.
    Warns of kinks that are not among the breaks.
    """
    return _Scan(function, breaks).result()


class _Scan:
    """Scan of a function; all columns are weighted as soon as their weights are known."""

    def __init__(self, function: ScannedFunction, breaks: Array) -> None:
        self._function, self._breaks = function, breaks
        self._weights = np.ones(2 * function.n_values)
        self._duration = float(breaks[-1])
        self._tick = float(np.spacing(self._duration))
        self._evaluations = self._calls = 0
        self._noise = 0.0
        self._found: list[float] = []
        # Breaks at which an angle only goes on at another turn.
        self._turned: set[float] = set()

    def result(self) -> FunctionScan:
        """Resolve all pieces, and those again that hold kinks."""
        pieces = [Piece(a, b) for a, b in pairwise(self._breaks)]
        few = _FIRST_PANELS[0] if len(pieces) == 1 else _FIRST_PANELS[1] if len(pieces) <= 4 else _FIRST_PANELS[2]
        self._most_panels = _MOST_PANELS + 40 * len(self._breaks)
        self._times = np.concatenate([sample_times(p.first, p.last, self._duration) for p in pieces])
        first = self._first_panels(pieces, few)
        nodes = nodes_on(first.left, first.right, DEGREE)
        both = self._at(np.concatenate([self._times, nodes.ravel()]))
        self._n = n = self._function.n_values
        self._weights, sizes = self._function.judge(self._times, both[: len(self._times)])
        both *= self._weights
        self._samples, values = both[: len(self._times)], both[len(self._times) :].reshape(*nodes.shape, -1)
        self._largest = np.maximum(np.abs(self._samples).max(axis=0, initial=0.0), sizes * self._weights)
        self._reach = np.abs(self._samples[:, :n]).max(axis=0, initial=0.0)
        # A rate that is a derivative counts by the largest value in the whole time; any other has its own.
        of_rates = np.where(self._function.paired, self._largest[:n] / self._duration, self._largest[n:])
        self._inner_sizes = np.concatenate([self._largest[:n], of_rates])
        done: list[Piece] = []
        parts: list[ResolvedPanels] = []
        while pieces:
            parts.append(self._resolve(pieces, first, values))
            done += [piece for piece in pieces if not piece.kinks]
            pieces = [part for piece in pieces if piece.kinks for part in self._parts(piece)]
            if pieces:
                first = self._first_panels(pieces, _FIRST_PANELS[1])
                values = None
        done.sort(key=lambda piece: piece.left)
        panels = ResolvedPanels.in_order(parts)
        starts = np.searchsorted(panels.left, [piece.first for piece in done])
        self._find_corners(panels, starts)
        self._check_jumps(done, panels, starts)
        defect = self._checked_rates(panels)
        # The outermost ends of a piece are the breaks themselves.
        edges = np.append(panels.left, self._duration)
        edges[starts] = [piece.left for piece in done]
        breaks = np.array(sorted(self._found))
        kinks = np.array([time for time in breaks if time not in self._turned])
        if len(kinks):
            self._warn(kinks)
        return FunctionScan(
            resolved=ResolvedPath(edges[:-1], edges[1:], panels.coefficients, panels.noise, self._duration, defect),
            found_breaks=breaks,
            evaluations=self._evaluations,
            calls=self._calls,
            noise=self._noise,
        )

    def _at(self, times: Array) -> Array:
        """Values and rates side by side: (N,) -> (N, 2 n)."""
        self._evaluations += len(times)
        self._calls += 1
        run_progress.begin(run_progress.LOOKING, 1)
        both = np.concatenate(self._function.curve(times), axis=1) * self._weights
        run_progress.advance(1)
        return both

    def _first_panels(self, pieces: list[Piece], count: int) -> Panels:
        edges = np.array([np.linspace(piece.first, piece.last, count + 1) for piece in pieces])
        number = np.repeat(np.arange(len(pieces)), count)
        return Panels(edges[:, :-1].ravel(), edges[:, 1:].ravel(), number, np.full((len(number), 1), np.inf))

    # ---- Halving ----

    def _resolve(self, pieces: list[Piece], panels: Panels, values: Array | None) -> ResolvedPanels:
        """Halve panels until all are resolved, or hold kinks that were located: those of pieces without kinks."""
        done: list[ResolvedPanels] = []
        level = resolved = 0
        while len(panels.left):
            fit = self._fit(panels, values)
            values, misfit, floor = None, fit.misfit, fit.floor
            good: Mask = np.all(misfit <= floor, axis=1)
            ends = panels.left[good], panels.right[good]
            done.append(ResolvedPanels(*ends, panels.piece[good], fit.coefficients[good], fit.noise[good]))
            resolved += int(good.sum())
            bad, rounding = panels.of(~good), floor[~good]
            if len(bad.left) + resolved > self._most_panels:
                raise self._too_rough(float(bad.left[np.argmax(misfit[~good].max(axis=1))]))
            smooth = self._without_kinks(pieces, bad, rounding, level)
            bad, left_over = bad.of(smooth), misfit[~good][smooth]
            narrow = bad.right - bad.left < _LEAST_WIDTH * self._duration
            if narrow.any():
                raise self._too_rough(float(bad.left[narrow][0]))
            panels = bad.halves(left_over)
            level += 1
        has_kinks = np.array([bool(piece.kinks) for piece in pieces])
        panels_in_order = ResolvedPanels.in_order(done)
        return panels_in_order.of(~has_kinks[panels_in_order.piece])

    def _fit(self, panels: Panels, values: Array | None) -> PanelFit:
        """Series of panels, and how far the path is from them."""
        left, right = panels.left, panels.right
        count = len(left)
        scatter: Array | float = 0.0
        if values is None:
            nodes = nodes_on(left, right, DEGREE)
            checks = left[:, None] + (right - left)[:, None] * CHECKS
            steps = np.minimum(_NOISE_STEP * self._tick, 0.01 * (right - left))[:, None] * np.arange(_NOISE_TIMES)
            near = (left + _NOISE_PLACE * (right - left))[:, None] + steps
            all_times = np.concatenate([nodes, checks, near], axis=1)
            both = self._at(all_times.ravel()).reshape(*all_times.shape, -1)
            values, checked = both[:, : DEGREE + 1], both[:, DEGREE + 1 : -_NOISE_TIMES]
            misfit = np.abs(check_matrix() @ values - checked).max(axis=1, initial=0.0)
            scatter = self._scatter(both[:, -_NOISE_TIMES:])
        else:
            misfit = np.zeros((count, values.shape[2]))
        coefficients = transform() @ values
        floor = self._floor(values, right - left)
        np.maximum(misfit, 0.5 * np.abs(coefficients[:, -3:]).max(axis=1, initial=0.0), out=misfit)
        starts, ends = np.searchsorted(self._times, left), np.searchsorted(self._times, right)
        index = np.concatenate([np.arange(a, b) for a, b in zip(starts, ends, strict=True)])
        if len(index):
            row = np.repeat(np.arange(count), ends - starts)
            local = (2.0 * self._times[index] - left[row] - right[row]) / (right - left)[row]
            basis = polynomials(local)
            stops = np.cumsum(ends - starts)
            for panel in np.flatnonzero(ends > starts):
                part = slice(int(stops[panel] - (ends - starts)[panel]), int(stops[panel]))
                gap = basis[part] @ coefficients[panel] - self._samples[starts[panel] : ends[panel]]
                np.maximum(misfit[panel], np.abs(gap).max(axis=0, initial=0.0), out=misfit[panel])
        follows = (misfit > floor) & (misfit <= _NOISE_MARGIN * scatter)
        follows &= np.all((misfit <= floor) | follows, axis=1)[:, None]
        noise = self._allowed_noise(panels, follows, np.broadcast_to(scatter, misfit.shape))
        # Where halving does not help, and no more is left than rounding within the function's own sums, this is it.
        np.maximum(self._largest, np.abs(values).max(axis=(0, 1), initial=0.0), out=self._largest)
        inner = _INNER_ROUNDING * self._largest
        widths = np.where(np.arange(len(inner)) < self._n, 1.0, 0.5 * (right - left)[:, None])
        inner = inner + _INNER_STEPS / widths
        inner = np.where(misfit > _STUBBORN * panels.before, inner, 0.0)
        return PanelFit(coefficients, misfit, np.maximum(np.maximum(floor, inner), _NOISE_MARGIN * scatter), noise)

    def _floor(self, values: Array, width: Array) -> Array:
        """Rounding of the columns on panels, by numbers and by times: (P, k, 2 n) -> (P, 2 n)."""
        n = self._n
        largest = np.abs(values).max(axis=1, initial=0.0)
        slopes = np.ptp(values, axis=1) / width[:, None]
        slopes[:, :n] = np.where(self._function.paired, largest[:, n:], slopes[:, :n])
        return _ROUNDING * largest + _TIME_ROUNDING * (self._tick * slopes + _EPS * self._inner_sizes)

    # ---- Kinks, jumps, noise, roughness ----

    def _without_kinks(self, pieces: list[Piece], bad: Panels, floor: Array, level: int) -> Mask:
        """The panels in which no kink is located; where one is, the piece notes it."""
        kept = np.ones(len(bad.left), dtype=bool)
        for row in np.flatnonzero(bad.right - bad.left < _KINK_WIDTH * self._duration) if level % 2 else ():
            piece = pieces[bad.piece[row]]
            where = located_kink(
                self._at, (float(bad.left[row]), float(bad.right[row])), (piece.first, piece.last), floor[row]
            )
            if where is None:
                continue
            kept[row] = False
            if not any(abs(where - other) < 256.0 * self._tick for other in piece.kinks):
                piece.kinks.append(where)
        return kept

    def _parts(self, piece: Piece) -> list[Piece]:
        self._found += piece.kinks
        return [Piece(a, b) for a, b in pairwise([piece.left, *sorted(piece.kinks), piece.right])]

    def _find_corners(self, panels: ResolvedPanels, starts: Integers) -> None:
        """Note kinks of values without rates that are at an end of a panel by chance, by the slopes there."""
        alone = ~self._function.paired
        if not alone.any():
            return
        half = 0.5 * (panels.right - panels.left)[:, None]
        series = panels.coefficients[:, :, : self._n][:, :, alone]
        at_end = np.einsum("k,pkn->pn", _END_SLOPES, series) / half
        signs = np.where(np.arange(DEGREE + 1) % 2, 1.0, -1.0)
        at_start = np.einsum("k,pkn->pn", signs * _END_SLOPES, series) / half
        last = np.abs(series[:, -3:]).max(axis=1)
        rounding = _SLOPE_ROUNDING * self._largest[: self._n][alone]
        uncertain = _END_SLOPES[-1] * (_SLOPE_MARGIN * last + rounding) / half
        sizes = np.repeat(np.maximum.reduceat(np.abs(at_end), starts), np.diff([*starts, len(half)]), axis=0)
        after = np.setdiff1d(np.arange(len(half)), starts)
        bends = np.abs(at_start[after] - at_end[after - 1])
        corner = bends > uncertain[after] + uncertain[after - 1] + _LEAST_CORNER * sizes[after]
        self._found += panels.left[after][corner.any(axis=1)].tolist()

    def _check_jumps(self, pieces: list[Piece], panels: ResolvedPanels, starts: Integers) -> None:
        """Raise TrajectoryError where a value jumps at a break; an angle that goes on at another turn does not."""
        if len(pieces) < 2:
            return
        n, function = self._n, self._function
        before = np.array([piece.last for piece in pieces[:-1]])
        after = np.array([piece.first for piece in pieces[1:]])
        both = self._at(np.concatenate([before, after]))
        first, second = both[: len(before)], both[len(before) :]
        gap = second[:, :n] - first[:, :n]
        turns = np.where(function.angles, np.round(gap / (2.0 * np.pi)), 0.0)
        gap -= 2.0 * np.pi * turns
        speeds = np.maximum(np.abs(first), np.abs(second))[:, n:] * function.paired
        jumps = np.abs(gap) > CLOSED * np.maximum(1.0, self._reach) + 2.0 * (after - before)[:, None] * speeds
        at_kinks = np.isin([piece.right for piece in pieces[:-1]], self._found)
        jumps &= at_kinks[:, None] | ~function.may_jump
        if jumps.any():
            row, column = (int(i) for i in np.argwhere(jumps)[0])
            weight = self._weights[column]
            raise TrajectoryError(
                f"{function.subject} jumps: {function.columns[column]} goes from {first[row, column] / weight:.9g} to "
                f"{second[row, column] / weight:.9g} at {pieces[row].right:.12g} s; {function.words.continuous}"
            )
        rate_jumps = np.abs(second - first)[:, n:]
        # A kink is known to a rounding or two of the times: what a value may be off by there counts as noise.
        panels.noise[starts[1:] - 1] += _KINK_TICKS * self._tick * rate_jumps.max(axis=1, initial=0.0) * at_kinks
        has_jump = rate_jumps > CLOSED * np.maximum(1.0, self._largest[n:])
        self._turned = {
            piece.right for row, piece in enumerate(pieces[:-1]) if turns[row].any() and not has_jump[row].any()
        }

    def _scatter(self, values: Array) -> Array:
        """Scatter of values over times so near to each other that no function changes: (P, k, 2 n) -> (P, 2 n).

        A function that is merely rough goes straight there; at a single jump most neighbours still do.
        """
        bends = np.abs(values[:, 2:] - 2.0 * values[:, 1:-1] + values[:, :-2])
        # The median of a normal distribution's size, and the sum of its three squares.
        return np.median(bends, axis=1) / (0.6745 * np.sqrt(6.0))

    def _allowed_noise(self, panels: Panels, noisy: Mask, scatter: Array) -> Array:
        """Noise of panels whose series follow it, where the tolerance covers it: (P,) [rad]; else NoisyPathError."""
        n = self._n
        half = 0.5 * (panels.right - panels.left)
        weights = np.where(np.arange(2 * n) < n, 1.0, half[:, None])
        sizes = np.where(noisy, scatter * weights, 0.0)
        self._noise = max(self._noise, float(sizes.max(initial=0.0)))
        loud = sizes > _MOST_NOISE * np.maximum(1.0, np.tile(self._reach, 2))
        if loud.any():
            row, worst = (int(i) for i in np.unravel_index(np.argmax(np.where(loud, sizes, 0.0)), sizes.shape))
            where = panels.left[row] + _NOISE_PLACE * 2.0 * half[row]
            raise NoisyPathError(
                f"{self._function.subject} is noisy: the {self._function.quantities[worst]} scatters by "
                f"{scatter[row, worst] / self._weights[worst]:.2g} {self._function.words.units[worst >= n]} near "
                f"t = {where:.9g} s, however near the times; smooth the data first"
            )
        return sizes.max(axis=1, initial=0.0)

    def _too_rough(self, where: float) -> AccuracyNotReached:
        return AccuracyNotReached(
            f"{self._function.subject} is rough near t = {where:.12g} s: {self._evaluations} evaluations do not "
            "resolve it; declare the times of its jumps as breaks, or smooth the data"
        )

    def _checked_rates(self, panels: ResolvedPanels) -> float:
        """Compare the integral of each rate on each panel with its value: the sum of the differences above rounding."""
        if not self._function.paired.any():
            return 0.0
        n, series, half = self._n, panels.coefficients, 0.5 * (panels.right - panels.left)
        integrals = half[:, None, None] * (integral_matrix() @ series[:, :, n:])
        apart = np.abs(integrals[:, 1:-1] - series[:, 1:, :n]).max(axis=1, initial=0.0)
        apart *= self._function.paired
        fastest = np.abs(series[:, :, n:]).sum(axis=1)
        rounding = _ROUNDING * self._reach + 2.0 * _TIME_ROUNDING * self._tick * fastest + _NOISE_MARGIN * self._noise
        wrong = apart > _RATE_DEFECT * np.maximum(1.0, self._reach) + rounding
        if wrong.any():
            panel, column = (int(i) for i in np.unravel_index(np.argmax(np.where(wrong, apart, 0.0)), wrong.shape))
            basis = polynomials(unit_nodes(DEGREE))
            slopes = basis @ (derivative_matrix(DEGREE + 1) @ series[panel, :, column]) / half[panel]
            rates = basis @ series[panel, :, n + column]
            # The ends of a differentiated series are its least certain part.
            place = 3 + int(np.argmax(np.abs(slopes - rates)[3:-3]))
            where = nodes_on(panels.left[[panel]], panels.right[[panel]], DEGREE)[0, place]
            weight, words = self._weights[column], self._function.words
            raise TrajectoryError(
                f"{self._function.subject} gives the {words.rate} {rates[place] / weight:.9g} of "
                f"{self._function.columns[column]} at {where:.9g} s, but its {words.values} change at "
                f"{slopes[place] / weight:.9g}; return {words.returned}"
            )
        return float(np.where(apart > rounding, apart, 0.0).max(axis=1, initial=0.0).sum())

    def _warn(self, found: Array) -> None:
        named = ", ".join(f"{time:.15g}" for time in found[:_NAMED_TIMES])
        more = f" and at {len(found) - _NAMED_TIMES} more times" if len(found) > _NAMED_TIMES else ""
        warnings.warn(
            f"{self._function.subject} has kinks that were not declared, at t = {named} s{more}; they are taken as "
            "breaks. Declare them with breaks= to be certain",
            UndeclaredBreakWarning,
            stacklevel=2,
        )
