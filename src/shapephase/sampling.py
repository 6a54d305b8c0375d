"""I^-1 and I^-1 L_o of a deformation as piecewise Chebyshev polynomials, resolved to a stated attitude error.

The bandwidth of the shape motion, not the speed of the rotation, sets how often Pinocchio must be asked
(numerics.md sections 0 and 1). A smooth loop is sampled at even times, where its Fourier series converges fastest;
anything else on panels between its breaks, at nested Chebyshev points, doubled or bisected. Either way samples are
only ever added until the tail of the spectrum is small enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, Integers, Mask
from .errors import AccuracyNotReached, ShapeError
from .inertia_tensor import inverse_inertia

Evaluate = Callable[[Array], tuple[Array, Array]]

_FIRST_DEGREE, _LAST_DEGREE = 5, 80
_MOST_PANELS = 4000
_LEAST_WIDTH = 1e-13
_FIRST_HARMONICS, _LAST_EVEN = 4, 768
_EVEN_A_PANEL, _PANEL_DEGREE = 16, 32
_EPS = np.finfo(float).eps
_ROUNDING = 30.0 * _EPS
_VOIGT = np.array([0, 4, 8, 5, 2, 1])
_MATRIX = np.array([0, 5, 4, 5, 1, 3, 4, 3, 2])
_TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # off-diagonal channels stand for two entries of I^-1


@dataclass(frozen=True, eq=False)
class Interpolant:
    """I^-1 (6 numbers) and I^-1 L_o (3) on panels: nine channels as Chebyshev series.

    Attributes
    ----------
    edges : (loops P + 1,) panel ends [s]
    coefficients : (P, n, 9), padded with zeros to one degree; channels xx yy zz yz xz xy of I^-1, then I^-1 L_o;
        the P panels of the first loop serve every loop
    loops : how often the panels are gone through
    evaluations : how many times the deformation was evaluated
    """

    edges: Array
    coefficients: Array
    loops: int
    evaluations: int

    def panel_of(self, times: Array) -> Integers:
        """The panel of each time: (N,) -> (N,)."""
        return np.clip(np.searchsorted(self.edges, times, side="right") - 1, 0, len(self.edges) - 2)

    def channels(self, times: Array, panel: Integers) -> Array:
        """The nine channels at times of given panels: (N, k), (N,) -> (N, k, 9)."""
        count, degrees = len(self.coefficients), self.coefficients.shape[1]
        left, right = self.edges[panel, None], self.edges[panel + 1, None]
        local = np.clip((2.0 * times - left - right) / (right - left), -1.0, 1.0)
        values = np.empty((*times.shape, 9))
        chunk = max(1, 2_000_000 // (degrees * (9 + times.shape[1])))
        for start in range(0, len(times), chunk):
            part = slice(start, start + chunk)
            values[part] = chebyshev(local[part], degrees) @ self.coefficients[panel[part] % count]
        return values

    def inverse_and_drift(self, times: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o: (N,) -> (N, 3, 3) [1/(kg m^2)], (N, 3) [rad/s]."""
        values = self.channels(times[:, None], self.panel_of(times))[:, 0]
        return values[:, _MATRIX].reshape(-1, 3, 3), values[:, 6:]


class Sampler(Protocol):
    """A deformation being sampled."""

    def refine(self, momentum: float, tolerance: float) -> None:
        """Sample until the attitude error for momenta up to this size is at most `tolerance` [rad].

        Raises
        ------
        AccuracyNotReached
            If the motion is too rough between its breaks.
        """
        ...

    def error(self, momentum: float) -> float:
        """Estimate of the attitude error due to sampling, without amplification [rad]."""
        ...

    def interpolant(self) -> Interpolant:
        """What has been sampled so far."""
        ...


def sampler(
    evaluate: Evaluate,
    breaks: Array,
    *,
    oscillations: float | None = None,
    loops: int = 1,
    smooth_loop: bool = False,
    probe: Callable[[Array], Array] | None = None,
) -> Sampler:
    """The way of sampling that suits a deformation.

    Parameters
    ----------
    evaluate : times (N,) -> I (N, 3, 3), L_o (N, 3)
    breaks : (M,) where smoothness ends, first and last the interval's ends [s]
    oscillations : upper bound of the swings between two breaks (or in a smooth loop); 0: nothing moves;
        None: unknown, then the samples are vetted between the nodes
    loops : the interval is its first part, this many times
    smooth_loop : that part goes smoothly over into its start and has no breaks
    probe : a cheap stand-in for the deformation to vet a black box, times (N,) -> (N, 2 n), shapes and then their
        rates; None: the deformation itself is asked
    """
    asked = _Asked(evaluate)
    ends = breaks[breaks <= breaks[-1] / loops * (1.0 + 1e-12)] if loops > 1 else breaks
    if smooth_loop and oscillations is not None:
        return EvenSampler(asked, breaks[-1] / loops, loops, oscillations)
    return PanelSampler(asked, ends, loops, oscillations, probe)


class _Asked:
    """The deformation as channels, with a count of how often it was asked."""

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate
        self.count = 0

    def __call__(self, times: Array) -> Array:
        inertia, momentum = self._evaluate(times)
        self.count += len(times)
        inverse = inverse_inertia(inertia, times)
        channels = np.empty((len(times), 9))
        channels[:, :6] = inverse.reshape(-1, 9)[:, _VOIGT]
        channels[:, 6:] = (inverse @ momentum[:, :, None])[:, :, 0]
        if not np.isfinite(channels).all():
            row = int(np.argwhere(~np.isfinite(channels))[0, 0])
            raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
        return channels


@dataclass(frozen=True, eq=False)
class _Judgement:
    """What the spectra of some panels say: (G,) each."""

    inverse: Array  # error estimate of I^-1
    drift: Array  # error estimate of I^-1 L_o
    decay: Array  # of the spectrum, per degree; the slower one
    converging: Mask
    at_rounding: Mask
    inverse_size: Array
    drift_size: Array
    floor: Array  # (G, 2) what rounding alone leaves

    def error(self, momentum: float, width: Array, phase: float) -> Array:
        """Attitude error that the interpolation error feeds in: (G,) [rad].

        What a converging series lacks runs through `phase` or more in a panel [rad], so most of it averages out, as
        long as the body itself turns less; half of that is relied on. The error of a kink does not average out.
        """
        rate = momentum * self.inverse + self.drift
        turn = width * (momentum * self.inverse_size + self.drift_size)
        left = np.where(self.converging, np.minimum(1.0, 4.0 / np.maximum(phase - turn, 4.0)), 1.0)
        return 0.5 * width * rate * left

    def raised(self, gaps: Array, seen: Mask) -> _Judgement:
        """The same with errors at least as large as those seen (G, 2), which are not expected to average out."""
        return replace(
            self,
            inverse=np.maximum(self.inverse, gaps[:, 0]),
            drift=np.maximum(self.drift, gaps[:, 1]),
            converging=self.converging & ~seen,
            at_rounding=self.at_rounding & np.all(gaps <= 4.0 * self.floor, axis=1),
        )


def _judged(size: Array, degree: int, time_rounding: Array | float) -> _Judgement:
    """Error estimates from the tails of spectra; size (G, degree + 1, 2) of I^-1 and of I^-1 L_o.

    `time_rounding` is the rounding of the sample times in units of half a panel (or of a radian): it limits what
    samples of a fast motion can tell.
    """
    if degree == 0:
        zero = np.zeros(len(size))
        sure = zero == 0.0
        return _Judgement(zero, zero, zero + np.inf, sure, sure, size[:, 0, 0], size[:, 0, 1], size[:, 0] * _EPS)
    top = size.max(axis=1)
    late = size[:, -max(2, degree // 10) :].max(axis=1)
    centre = degree // 2
    middle = size[:, centre - 1 : centre + 2].max(axis=1)
    slope = np.arange(degree + 1) @ size
    floor = _ROUNDING * top + 4.0 * np.reshape(time_rounding, (-1, 1)) * slope
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = np.where((late > 0.0) & (middle > late), np.log(middle / late) * (2.0 / degree), 0.0)
        # A geometric series with this decay leaves this much beyond its last term; twice, for aliasing.
        left_over = np.where(decay > 0.0, 2.0 * late / np.expm1(decay), np.inf)
    error = np.maximum(np.minimum(left_over, late * degree), 0.02 * floor)
    calm = late <= floor
    return _Judgement(
        error[:, 0],
        error[:, 1],
        np.where(calm, np.inf, decay).min(axis=1),
        (calm | (late < 1e-2 * middle)).all(axis=1),
        calm.all(axis=1),
        top[:, 0],
        top[:, 1],
        floor,
    )


def _sizes(coefficients: Array | NDArray[np.complex128]) -> Array:
    """Frobenius norm of I^-1 and norm of I^-1 L_o in spectra: (..., 9) -> (..., 2)."""
    squares = coefficients.real**2 + coefficients.imag**2
    return np.sqrt(np.stack([squares[..., :6] @ _TWICE, squares[..., 6:].sum(axis=-1)], axis=-1))


class EvenSampler:
    """Samples a smooth loop at even times; the counts double or triple."""

    def __init__(self, asked: _Asked, period: float, loops: int, oscillations: float) -> None:
        self._asked, self._period, self._loops = asked, period, loops
        count = 8 * _FIRST_HARMONICS * max(1, int(np.ceil(oscillations / _FIRST_HARMONICS))) if oscillations else 1
        self._values = asked(self._times(np.arange(count), count))
        self._judge()

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        while (error := self.error(momentum)) > tolerance and not self._judgement.at_rounding[0]:
            count = len(self._values)
            decay = float(self._judgement.decay[0])
            missing = np.log(error / tolerance) / decay if decay > 0.0 else np.inf
            # Twice, three or four times as many samples, whichever is enough for this decay.
            factor = 2 if missing <= 0.55 * count else 3 if missing <= 1.1 * count else 4
            if factor * count > _LAST_EVEN:
                raise AccuracyNotReached(
                    f"the loop is too rough to be sampled at even times: an error of {error:.3g} rad is left where "
                    f"{tolerance:.3g} was asked; loosen the tolerance, or give the path breaks"
                )
            index = np.arange(factor * count)
            fresh = index[index % factor != 0]
            values = np.empty((factor * count, 9))
            values[::factor] = self._values
            values[fresh] = self._asked(self._times(fresh, factor * count))
            self._values = values
            self._judge()

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        phase = np.pi * len(self._values)
        return self._loops * float(self._judgement.error(momentum, np.array([self._period]), phase)[0])

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        count = len(self._values)
        panels = max(1, count // _EVEN_A_PANEL)
        degree = _PANEL_DEGREE if count > 1 else 0
        coefficients = _even_to_panels(count, panels, degree) @ self._values
        edges = np.linspace(0.0, self._period * self._loops, panels * self._loops + 1)
        return Interpolant(edges, coefficients, self._loops, self._asked.count)

    def _times(self, index: Integers, count: int) -> Array:
        return (self._period / count) * index.astype(np.float64)

    def _judge(self) -> None:
        count = len(self._values)
        spectrum = np.fft.rfft(self._values, axis=0) * (2.0 / count)
        self._judgement = _judged(_sizes(spectrum)[None], count // 2, 2.0 * np.pi * _EPS)


@dataclass(frozen=True, eq=False)
class _Group:
    """Panels of one degree."""

    degree: int
    left: Array
    right: Array
    values: Array  # (G, degree + 1, 9) at the ascending Chebyshev points
    gaps: Array  # (G, 2) errors seen between the nodes; NaN: not looked for
    judgement: _Judgement

    @property
    def width(self) -> Array:
        return self.right - self.left

    def kept(self, rows: Mask) -> _Group:
        return _group(self.degree, self.left[rows], self.right[rows], self.values[rows], self.gaps[rows])


def _group(degree: int, left: Array, right: Array, values: Array, gaps: Array | None = None) -> _Group:
    rounding = 2.0 * np.spacing(np.abs(right)) / (right - left)
    judgement = _judged(_sizes(values_to_coefficients(degree) @ values), degree, rounding)
    if gaps is None:
        return _Group(degree, left, right, values, np.full((len(left), 2), np.nan), judgement)
    seen = ~np.isnan(gaps[:, 0])
    return _Group(
        degree,
        left,
        right,
        values,
        gaps,
        judgement.raised(2.0 * np.nan_to_num(gaps), seen) if seen.any() else judgement,
    )


@dataclass(frozen=True, eq=False)
class _Wanted:
    """Panels to be sampled at a degree; `known` are the values of a lower degree that divides it."""

    degree: int
    left: Array
    right: Array
    known: Array | None

    def new_points(self) -> Array:
        """(G, m) times; the ends are moved a little inwards, to this side of a break."""
        nodes = _nodes_in(self.left, self.right, self.degree)
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
        asked: _Asked,
        breaks: Array,
        loops: int,
        oscillations: float | None,
        probe: Callable[[Array], Array] | None,
    ) -> None:
        self._asked, self._probe, self._loops = asked, probe, loops
        self._known = oscillations is not None
        self._span = float(breaks[-1] - breaks[0])
        self._most = _MOST_PANELS + 40 * len(breaks)
        pieces = 4 if oscillations is None else max(1, int(np.ceil(oscillations / 2.0)))
        ends = [np.linspace(left, right, pieces + 1) for left, right in pairwise(breaks)]
        left, right = np.concatenate([e[:-1] for e in ends]), np.concatenate([e[1:] for e in ends])
        degree = 0 if oscillations == 0.0 else _FIRST_DEGREE * (1 if len(left) > 4 else 2)
        self._groups: dict[int, _Group] = {}
        self._add([_Wanted(degree, left, right, None)])

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        while True:
            errors = {d: g.judgement.error(momentum, g.width, 2.0 * d) for d, g in self._groups.items()}
            total = self._loops * sum(float(e.sum()) for e in errors.values())
            if total <= tolerance:
                if self._known or not self._look_between():
                    return
                continue
            share = tolerance / (self._span * self._loops)
            rough = {d: (errors[d] > share * g.width) & ~g.judgement.at_rounding for d, g in self._groups.items()}
            if not any(rows.any() for rows in rough.values()):
                return
            self._sharpen(rough, errors, tolerance, total)

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        return self._loops * sum(
            float(g.judgement.error(momentum, g.width, 2.0 * d).sum()) for d, g in self._groups.items()
        )

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        groups = list(self._groups.values())
        left = np.concatenate([g.left for g in groups])
        order = np.argsort(left)
        coefficients = np.zeros((len(left), max(self._groups) + 1, 9))
        start = 0
        for g in groups:
            rows = slice(start, start + len(g.left))
            coefficients[rows, : g.degree + 1] = values_to_coefficients(g.degree) @ g.values
            start = rows.stop
        edges = np.append(left[order], max(float(g.right.max()) for g in groups))
        if self._loops > 1:
            starts = edges[-1] * np.arange(self._loops)
            edges = np.append((starts[:, None] + edges[:-1]).ravel(), self._loops * edges[-1])
        return Interpolant(edges, coefficients[order], self._loops, self._asked.count)

    def _sharpen(self, rough: dict[int, Mask], errors: dict[int, Array], tolerance: float, total: float) -> None:
        """Raise the degree where the spectrum decays fast enough for that to do, else bisect."""
        wanted: list[_Wanted] = []
        crowded = self._panel_count > self._most
        for degree, rows in rough.items():
            if not rows.any():
                continue
            g = self._groups.pop(degree)
            share = tolerance / (self._span * self._loops) * g.width
            with np.errstate(divide="ignore", invalid="ignore"):
                missing = np.log(np.maximum(errors[degree] / share, 1.0)) / g.judgement.decay
            # A panel without a decay that is still small enough was found wanting between its nodes.
            factor = np.clip(np.ceil(np.nan_to_num(missing, nan=0.0, posinf=9.9 * degree) / degree + 0.9), 2, 4)
            factor[(missing > 3.1 * degree) | (factor * degree > _LAST_DEGREE)] = 0
            halves = rows & (factor == 0)
            if (g.width[halves] < _LEAST_WIDTH * self._span).any() or (crowded and halves.any()):
                where = float(g.left[halves][np.argmin(g.width[halves])])
                raise AccuracyNotReached(
                    f"the shape motion is rough near t = {where:.12g} s: an error of {total:.3g} rad is left where "
                    f"{tolerance:.3g} was asked; declare the times of its jumps as breaks, smooth the data, or loosen "
                    "the tolerance"
                )
            if not rows.all():
                self._groups[degree] = g.kept(~rows)
            for times in (2, 3, 4):
                grows = rows & (factor == times)
                if grows.any():
                    wanted.append(_Wanted(times * degree, g.left[grows], g.right[grows], g.values[grows]))
            if halves.any():
                left, right = g.left[halves], g.right[halves]
                middle = 0.5 * (left + right)
                ends = np.concatenate([left, middle]), np.concatenate([middle, right])
                wanted.append(_Wanted(2 * _FIRST_DEGREE, *ends, None))
        self._add(wanted)

    @property
    def _panel_count(self) -> int:
        return sum(len(g.left) for g in self._groups.values())

    def _add(self, wanted: list[_Wanted]) -> None:
        """Sample new panels, and those whose degree is raised; one call for all points."""
        times = [panels.new_points() for panels in wanted]
        values = self._asked(np.concatenate([t.ravel() for t in times]))
        start = 0
        for panels, points in zip(wanted, times, strict=True):
            whole = panels.with_values(values[start : start + points.size].reshape(*points.shape, 9))
            start += points.size
            left, right, gaps = panels.left, panels.right, None
            if panels.degree in self._groups:
                g = self._groups[panels.degree]
                gaps = np.concatenate([g.gaps, np.full((len(left), 2), np.nan)])
                left, right = np.concatenate([g.left, left]), np.concatenate([g.right, right])
                whole = np.concatenate([g.values, whole])
            gaps = None if self._known else gaps
            self._groups[panels.degree] = _group(panels.degree, left, right, whole, gaps)

    def _look_between(self) -> bool:
        """Look at new panels of a black box between their nodes; errors seen there count. False: nothing was new."""
        found = False
        for degree, g in list(self._groups.items()):
            rows = np.flatnonzero(np.isnan(g.gaps[:, 0]))
            if not len(rows):
                continue
            found = True
            points = self._suspicious_points(g, rows)
            there = chebyshev(2.0 * points - 1.0, degree + 1) @ values_to_coefficients(degree)
            between = g.left[rows, None] + g.width[rows, None] * points
            truth = self._asked(between.ravel()).reshape(*points.shape, 9)
            gaps = g.gaps.copy()
            gaps[rows] = _sizes(there @ g.values[rows] - truth).max(axis=1)
            self._groups[degree] = _group(degree, g.left, g.right, g.values, gaps)
        return found

    def _suspicious_points(self, g: _Group, rows: Integers) -> Array:
        """Where in its panels (in [0, 1]) the probe is farthest from its own interpolant: (R, k)."""
        if self._probe is None:
            return np.broadcast_to(_BETWEEN[::16], (len(rows), 4))
        there = chebyshev(2.0 * _BETWEEN - 1.0, g.degree + 1) @ values_to_coefficients(g.degree)
        nodes = _nodes_in(*inside(g.left[rows], g.right[rows]), g.degree)
        between = g.left[rows, None] + g.width[rows, None] * _BETWEEN
        seen, truth = (self._probe(t.ravel()).reshape(*t.shape, -1) for t in (nodes, between))
        gap = np.abs(there @ seen - truth)
        half = gap.shape[-1] // 2
        worst = [np.argmax(part.max(axis=-1), axis=1) for part in (gap[..., :half], gap[..., half:])]
        return _BETWEEN[np.stack(worst, axis=-1)]


def chebyshev(x: Array, count: int) -> Array:
    """T_0 ... T_(count-1) at x in [-1, 1]: (...) -> (..., count)."""
    return np.cos(np.arccos(x)[..., None] * np.arange(count))


def _nodes_in(left: Array, right: Array, degree: int) -> Array:
    """Ascending Chebyshev points of panels (G, degree + 1), ends included."""
    return 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * unit_nodes(degree)


def inside(left: Array, right: Array) -> tuple[Array, Array]:
    """Times just inside intervals: by more than stretching, reversing and joining paths round, by less than matters."""
    margin = np.minimum(64.0 * np.spacing(np.max(right)), 1e-3 * (right - left))
    return left + margin, right - margin


@lru_cache(maxsize=16)
def unit_nodes(degree: int) -> Array:
    """The ascending Chebyshev points of [-1, 1], ends included: (degree + 1,)."""
    return -np.cos(np.pi * np.arange(degree + 1) / degree) if degree else np.zeros(1)


@lru_cache(maxsize=16)
def values_to_coefficients(degree: int) -> Array:
    """Values at the ascending Chebyshev points of [-1, 1] -> Chebyshev coefficients: (degree + 1, degree + 1)."""
    if degree == 0:
        return np.ones((1, 1))
    matrix = chebyshev(unit_nodes(degree), degree + 1).T * (2.0 / degree)
    matrix[:, [0, -1]] *= 0.5
    matrix[[0, -1], :] *= 0.5
    return matrix


@lru_cache(maxsize=32)
def _even_to_panels(count: int, panels: int, degree: int) -> Array:
    """Samples at `count` even times of a period -> Chebyshev coefficients on even panels: (panels, degree + 1, count).

    Through the Fourier series, whose highest term is halved (count even).
    """
    if count == 1:
        return np.ones((1, 1, 1))
    phase = (2.0 * np.pi / panels) * (np.arange(panels)[:, None] + 0.5 + 0.5 * unit_nodes(degree)).ravel()
    angle = phase[:, None] - 2.0 * np.pi / count * np.arange(count)
    half = count // 2
    # The periodic sinc, sum of cos(k angle) for |k| < half plus half the last term.
    kernel = np.ones_like(angle)
    for k in range(1, half):
        kernel += 2.0 * np.cos(k * angle)
    kernel = (kernel + np.cos(half * angle)) / count
    return values_to_coefficients(degree) @ kernel.reshape(panels, degree + 1, count)


# Sixty-four points of a panel, none of them a node: a low-discrepancy sequence.
_BETWEEN = np.sort(np.mod(0.5 + 0.6180339887498949 * np.arange(64, dtype=np.float64), 1.0))
