"""Attitudes between the ends of steps: each step as the polynomial that has Taylor's terms right at both ends.

The attitude equation gives all derivatives at the ends of a step from those of I^-1 and I^-1 L_o, which are
polynomials; the Hermite polynomial through them is far nearer to the motion than the step itself, and one product
with a fixed matrix makes it. Where it is not near enough, steps are cut in halves by the step's own formula.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import groupby
from math import comb

import numpy as np

from ..arrays import Array, Integers
from ..chebyshev import chebyshev, derivative_matrix
from ..display import short_repr
from .fast.estimate_constants import TERMS
from .interpolant import Interpolant
from .steps.rotation_step import momentum_step, product, rest_step, tableau, turned

# From the first neglected Chebyshev coefficient to the largest error of a Hermite polynomial: x (1 - x) is at most a
# fourth, and the leading coefficient of that Chebyshev polynomial is 2^(4 TERMS - 1).
_ERROR_OF_COEFFICIENT = 2.0 ** (2 * TERMS - 1)
# Of the error that is estimated by the decay of four coefficients.
_SAFETY_FACTOR = 2.0
# Places in a piece where the error is measured, y in [-1, 1]: where it is largest, and at both sides of that.
_PLACES = np.array([-0.4, 0.0, 0.4])
# Halvings of the steps; each divides the error by four thousand, so that more than two are hardly ever needed.
_MOST_HALVINGS = 5
# [rad] error to which polynomials of quaternions, and its measure, are rounded.
_ROUNDING = 8.0 * float(np.finfo(float).eps)
# Polynomials that are kept, and that are made at once: five megabytes, and sixty on the way.
_MOST_PIECES = 10_000
# Keeps the decay of coefficients defined where all are zero.
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class DenseOutput:
    """The attitude at every time, from that at the ends of the steps; fields as in `SteppedRotation`.

    Attributes
    ----------
    magnitude : (B,) of the momentum [kg m^2/s]
    goal : for the error of the polynomials [rad]
    """

    interpolant: Interpolant
    steps: Integers
    times: Array
    quaternions: Array
    directions: Array
    dynamics: Array
    magnitude: Array
    goal: float

    __repr__ = short_repr

    def step_of(self, t: Array) -> Integers:
        """The step of each time; a step's end belongs to the next one: (N,) -> (N,)."""
        return np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)

    def quaternion(self, t: Array) -> Array:
        """xyzw of length one at any times: (N,) -> (4, B, N)."""
        index = np.searchsorted(self.times, t, side="right") - 1
        is_end = self.times[index] == t
        if is_end.all():
            return np.moveaxis(self.quaternions[:, index], -1, 0)
        found = self._values(4, t, np.minimum(index, len(self.times) - 2))
        found /= np.sqrt((found * found).sum(axis=0))
        if is_end.any():
            found[:, :, is_end] = np.moveaxis(self.quaternions[:, index[is_end]], -1, 0)
        return found

    def dynamic_phase(self, t: Array) -> Array:
        """Since the start of each time's step: (N,) -> (B, N) [rad]."""
        step = self.step_of(t)
        at_start, at_end = t == self.times[step], t == self.times[step + 1]
        if (at_start | at_end).all():
            return np.where(at_end, self.dynamics[:, step], 0.0)
        return np.where(at_start, 0.0, np.where(at_end, self.dynamics[:, step], self._values(5, t, step)[4]))

    def _values(self, components: int, t: Array, step: Integers) -> Array:
        """The polynomials at times of given steps: (N,), (N,) -> (components, B, N)."""
        x = (t - self.times[step]) / (self.times[step + 1] - self.times[step])
        kept = self._kept
        if kept is not None:
            return _at_places(kept, components, x, step)
        which, place = np.unique(step, return_inverse=True)
        order = np.argsort(place, kind="stable")
        at_once = max(1, _MOST_PIECES // max(1, len(self.magnitude)))
        found = np.empty((components, len(self.magnitude), len(t)))
        for first in range(0, len(which), at_once):
            these = order[slice(*np.searchsorted(place[order], [first, first + at_once]))]
            part = self._polynomials(which[first : first + at_once])
            found[:, :, these] = _at_places(part, components, x[these], place[these] - first)
        return found

    @cached_property
    def _kept(self) -> Array | None:
        """The polynomials of all steps, unless they are too many."""
        count = len(self.times) - 1
        return self._polynomials(np.arange(count)) if count * len(self.magnitude) <= _MOST_PIECES else None

    def _polynomials(self, which: Integers) -> Array:
        """Of given steps: (n, 5, B, W, pieces), as many pieces of each step as its polynomials need."""
        found, error = self._attempt(which, 1)
        for halvings in range(1, _MOST_HALVINGS + 1):
            if error <= max(self.goal, _ROUNDING):
                break
            found, last = self._attempt(which, 2**halvings)
            # What does not fall is rounding.
            if last > 0.5 * error:
                break
            error = last
        return found

    def _attempt(self, which: Integers, count: int) -> tuple[Array, float]:
        """Polynomials of given steps, each in `count` pieces, and their largest error [rad]."""
        channels, misses = end_channels(self.interpolant, self.steps, which, count)
        quaternions, directions, dynamics = self._piece_ends(which, count)
        # A quaternion and its negative are one attitude, but not on one polynomial.
        flips = (quaternions[:, :, 0] * quaternions[:, :, 1]).sum(axis=0) < 0.0
        quaternions[:, :, 1] = np.where(flips, -quaternions[:, :, 1], quaternions[:, :, 1])
        terms = taylor_terms(quaternions, directions, self.magnitude, channels)
        terms[0, 4] = dynamics
        found = hermite_polynomials(terms)
        squares = misses * misses
        largest = float(self.magnitude.max(initial=0.0)) ** 2 * (squares[:, :3] + 2.0 * squares[:, 3:6]).sum(axis=1)
        missed = float(np.sqrt((largest + squares[:, 6:].sum(axis=1)).max(initial=0.0)))
        error = missed + _SAFETY_FACTOR * interpolation_error(found[:, :4])
        return found.reshape(*found.shape[:3], len(which), count), error

    def _piece_ends(self, which: Integers, count: int) -> tuple[Array, Array | None, Array]:
        """Quaternions, directions (c, B, 2, M) and dynamic phases (B, 2, M) at both ends of the pieces of steps."""
        at_rest = not self.directions.shape[1]
        batch, steps = len(self.magnitude), len(which)
        quaternions = np.empty((4, batch, steps, count + 1))
        directions = np.empty((3, batch, steps, count + 1))
        dynamics = np.zeros((batch, steps, count + 1))
        for side, index in ((0, which), (-1, which + 1)):
            quaternions[..., side] = np.moveaxis(self.quaternions[:, index], -1, 0)
            if not at_rest:
                directions[..., side] = np.moveaxis(self.directions[:, index], -1, 0)
        dynamics[..., -1] = self.dynamics[:, which]
        # From one inner end to the next: a step over part of another may err by more than the whole of it.
        for inner in range(1, count):
            start = quaternions[..., inner - 1], directions[..., inner - 1], dynamics[..., inner - 1]
            found = self._stepped(which, (inner - 1) / count, inner / count, *start)
            for whole, part in zip((quaternions, directions, dynamics[None]), found, strict=True):
                whole[..., inner] = part

        def both(ends: Array) -> Array:
            cut = np.stack([ends[..., :-1], ends[..., 1:]], axis=-3)
            return cut.reshape(*ends.shape[:-2], 2, steps * count)

        return both(quaternions), None if at_rest else both(directions), both(dynamics)

    def _stepped(
        self, which: Integers, begin: float, end: float, quaternions: Array, directions: Array, dynamics: Array
    ) -> tuple[Array, Array, Array]:
        """A step of the same formula over a part of given steps, from what is at its beginning to what is at its end.

        (4, B, W), (3, B, W), (B, W) -> the same
        """
        starts, lengths = self.times[which], self.times[which + 1] - self.times[which]
        _, _, c = tableau()
        panel = self.interpolant.panel_of(starts + 0.5 * lengths)
        times, shares = (starts + begin * lengths)[:, None], ((end - begin) * lengths)[:, None]
        channels = self.interpolant.channels(times + c * shares, panel)
        stages = np.moveaxis(channels * shares[:, :, None], 0, -1)
        before = list(quaternions)
        if not self.directions.shape[1]:
            return np.array(product(before, rest_step(-0.5 * stages[:, 6:]))), directions, dynamics
        start = list(directions)
        following, turn, dynamic = momentum_step(start, self.magnitude[:, None], stages)
        attitude = turned(before, start, following, (np.sin(0.5 * turn), np.cos(0.5 * turn)))
        return np.array(attitude), np.array(following), dynamics + dynamic


def _at_places(polynomials: Array, components: int, x: Array, place: Integers) -> Array:
    """Polynomials (n, 5, B, W, pieces) at x in [0, 1] of the steps at given places: (components, B, N)."""
    count = polynomials.shape[-1]
    scaled = count * x
    piece = np.minimum(scaled.astype(int), count - 1)
    flat = polynomials.reshape(*polynomials.shape[:3], polynomials.shape[3] * count)
    return values(flat[:, :components], place * count + piece, 2.0 * (scaled - piece) - 1.0)


def end_channels(
    interpolant: Interpolant, steps: Integers, which: Integers | None, count: int = 1
) -> tuple[Array, Array]:
    """Taylor terms at both ends of the pieces of steps, and how far the polynomials made of them miss the integrals.

    Parameters
    ----------
    steps : (P,) on each panel of the first loop
    which : (W,) ascending, of the steps of all loops; None: every one
    count : pieces of each step, M = W count in all

    Returns
    -------
    channels : (9, TERMS, 2, M) of I^-1 (6) and I^-1 L_o (3), times a piece's length
    misses : (3, 9, M) of the integrals of the channels, at three places in each piece
    """
    if which is None:
        whole = _pieces_of_panels(interpolant.coefficients, interpolant.widths, count * steps)
        if interpolant.loops > 1:
            whole = np.tile(whole, (interpolant.loops, 1, 1))
    else:
        inner = which % int(steps.sum())
        starts = np.cumsum(steps) - steps
        panels, place = np.unique(np.searchsorted(starts, inner, side="right") - 1, return_inverse=True)
        pieces = _pieces_of_panels(interpolant.coefficients[panels], interpolant.widths[panels], count * steps[panels])
        rows = inner - starts[panels[place]] + (np.cumsum(steps[panels]) - steps[panels])[place]
        whole = pieces[(count * rows[:, None] + np.arange(count)).ravel()]
    channels = whole[:, : 2 * TERMS].reshape(-1, 2, TERMS, 9)
    return np.ascontiguousarray(channels.transpose(3, 2, 1, 0)), whole[:, 2 * TERMS :].transpose(1, 2, 0)


def _pieces_of_panels(coefficients: Array, widths: Array, counts: Integers) -> Array:
    """Taylor terms and misses of all pieces of panels: (P, n, 9), (P,), (P,) -> (M, 2 TERMS + 3, 9)."""
    scaled = coefficients * widths[:, None, None]
    degrees, rows = scaled.shape[1], 2 * TERMS + len(_PLACES)
    found, start = [], 0
    for each, run in groupby(counts.tolist()):
        stop = start + len(list(run))
        found.append((_taylor_matrix(degrees, each) @ scaled[start:stop]).reshape(-1, rows, 9))
        start = stop
    return np.concatenate(found)


def terms_at_ends(interpolant: Interpolant, steps: Integers, which: Integers | None) -> tuple[Array, Integers]:
    """The Taylor terms of `end_channels`, which steps of a panel share where one ends and the next begins.

    Returns
    -------
    terms : (Q, TERMS, 9) at the ends of the steps of some panels, times a step's length
    places : (W,) of each step's start among them, which its end follows
    """
    coefficients, widths = interpolant.coefficients, interpolant.widths
    if which is None:
        places = np.arange(len(steps)).repeat(steps) + np.arange(int(steps.sum()))
        return _terms_of_panels(coefficients, widths, steps), np.tile(places, interpolant.loops)
    inner = which % int(steps.sum())
    starts = np.cumsum(steps) - steps
    panels, place = np.unique(np.searchsorted(starts, inner, side="right") - 1, return_inverse=True)
    terms = _terms_of_panels(coefficients[panels], widths[panels], steps[panels])
    ends = np.cumsum(steps[panels] + 1) - (steps[panels] + 1)
    return terms, inner - starts[panels[place]] + ends[place]


def _terms_of_panels(coefficients: Array, widths: Array, counts: Integers) -> Array:
    """(P, n, 9), (P,), (P,) -> (Q, TERMS, 9), of each panel at one end more than it has steps."""
    scaled, each = coefficients * widths[:, None, None], counts.tolist()
    terms = np.empty((sum(each) + len(each), TERMS, 9))
    start = row = 0
    for count, run in groupby(each):
        stop = start + len(list(run))
        after = row + (stop - start) * (count + 1)
        out = terms[row:after].reshape(stop - start, -1, 9)
        np.matmul(_matrix_of_terms(scaled.shape[1], count), scaled[start:stop], out=out)
        start, row = stop, after
    return terms


def terms_of_pieces(interpolant: Interpolant, edges: Array) -> tuple[Array, Integers]:
    """As `terms_at_ends`, for pieces between any edges (M + 1,) [s], each within one panel."""
    lengths = np.diff(edges)
    panel = interpolant.panel_of(edges[:-1] + 0.5 * lengths)
    widths = interpolant.edges[panel + 1] - interpolant.edges[panel]
    count, degrees, _ = interpolant.coefficients.shape
    slopes, _ = _calculus(degrees)
    series = interpolant.series
    x = series.local(np.stack([edges[:-1], edges[1:]], axis=-1), panel)
    basis = chebyshev(x, degrees)
    needed, which = np.unique(panel % count, return_inverse=True)
    derivatives = slopes.reshape(degrees, TERMS, degrees).transpose(1, 0, 2) @ interpolant.coefficients[needed, None]
    terms = (basis[:, None] @ derivatives[which]).transpose(0, 2, 1, 3)
    # A piece's length to the power of the term, in a variable that goes from 0 to 1.
    powers = (2.0 * lengths / widths)[:, None] ** np.arange(TERMS) * lengths[:, None]
    return (terms * powers[:, None, :, None]).reshape(-1, TERMS, 9), 2 * np.arange(len(lengths))


@lru_cache(maxsize=512)
def _matrix_of_terms(degrees: int, count: int) -> Array:
    """Chebyshev coefficients of a panel -> Taylor terms at the ends of its pieces: ((count + 1) TERMS, degrees)."""
    slopes, _ = _calculus(degrees)
    ends = 2.0 * np.arange(count + 1) / count - 1.0
    # A piece's length to the power of the term, and the share of the panel.
    lengths = (2.0 / count) ** np.arange(TERMS)[:, None] / count
    terms = (chebyshev(ends, degrees) @ slopes).reshape(count + 1, TERMS, degrees) * lengths
    return np.ascontiguousarray(terms.reshape(-1, degrees))


@lru_cache(maxsize=512)
def _taylor_matrix(degrees: int, count: int) -> Array:
    """Chebyshev coefficients of a panel -> for each of its pieces Taylor terms at both ends and misses at three places.

    (count (2 TERMS + 3), degrees), times a piece's share of the panel; the variable of the series goes from 0 to 1.
    """
    _, integrals = _calculus(degrees)
    ends = 2.0 * np.arange(count + 1) / count - 1.0
    within = (2.0 * np.arange(count)[:, None] + 1.0 + _PLACES) / count - 1.0
    terms = _matrix_of_terms(degrees, count).reshape(count + 1, TERMS, degrees)
    taylor = np.stack([terms[:-1], terms[1:]], axis=1)
    # The integral's own terms: its values, then those of the series over 1, 2, ...
    primitive = chebyshev(ends, degrees + 1) @ integrals * 0.5
    of_integral = np.stack([primitive[:-1], primitive[1:]], axis=1)[:, :, None]
    of_integral = np.concatenate([of_integral, taylor[:, :, :-1] / np.arange(1, TERMS)[:, None]], axis=2)
    powers = _PLACES[:, None] ** np.arange(2 * TERMS)
    guess = powers @ hermite_matrix() @ of_integral.reshape(count, 2 * TERMS, degrees)
    misses = guess - chebyshev(within, degrees + 1) @ integrals * 0.5
    whole = np.concatenate([taylor.reshape(count, 2 * TERMS, degrees), misses], axis=1)
    return np.ascontiguousarray(whole.reshape(-1, degrees))


@lru_cache(maxsize=64)
def _calculus(degrees: int) -> tuple[Array, Array]:
    """Chebyshev coefficients -> those of the Taylor terms (degrees, TERMS degrees) and of the integral, one more."""
    slopes = [np.eye(degrees)]
    for order in range(1, TERMS):
        slopes.append(derivative_matrix(degrees) @ slopes[-1] / order)
    integrals = np.asarray(np.polynomial.chebyshev.chebint(slopes[0], axis=0), dtype=np.float64)
    return np.concatenate(slopes, axis=1), integrals


def taylor_terms(quaternions: Array, directions: Array | None, magnitude: Array, channels: Array) -> Array:
    """Taylor terms of S, and of the dynamic phase but for its value, at the ends of pieces: (TERMS, 5, B, 2, M).

    Parameters
    ----------
    quaternions, directions : (4, B, 2, M), (3, B, 2, M) at both ends of each piece; None: without momentum
    magnitude : (B,) of the momentum [kg m^2/s]
    channels : (9, TERMS, 2, M) from `end_channels`
    """
    terms = np.zeros((TERMS, 5, *quaternions.shape[1:]))
    terms[0, :4] = quaternions
    rates = np.broadcast_to(-channels[6:, :, None], (3, TERMS, *quaternions.shape[1:]))
    if directions is not None:
        p, rates = direction_terms(directions, magnitude, channels)
        terms[1:, 4] = (convolved(p, rates).T[..., :-1] / np.arange(1, TERMS)).T
    vectors, scalars = terms[:, :3].swapaxes(0, 1), terms[:, 3]
    for order in range(TERMS - 1):
        v, w, rate = vectors[:, : order + 1], scalars[: order + 1], _backwards(rates, order)
        half = 0.5 / (order + 1)
        vectors[:, order + 1] = half * (w * rate + crossed(v, rate)).sum(axis=1)
        scalars[order + 1] = -half * (v * rate).sum(axis=(0, 1))
    return terms


def direction_terms(directions: Array, magnitude: Array, channels: Array) -> tuple[Array, Array]:
    """Taylor terms of the momentum's direction and of omega, body axes: (3, TERMS, B, 2, M) each.

    Parameters as in `taylor_terms`.
    """
    p, rates = np.empty((2, 3, TERMS, *directions.shape[1:]))
    p[:, 0] = directions
    # The rows of I^-1, times |Pi|.
    inverse = channels[[0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(3, 3, *channels.shape[1:])[:, :, :, None]
    inverse = inverse * magnitude[:, None, None]
    drift = channels[6:, :, None]
    for order in range(TERMS):
        turning = (_backwards(inverse, order) * p[:, : order + 1]).sum(axis=(1, 2))
        rates[:, order] = turning - drift[:, order]
        if order + 1 < TERMS:
            p[:, order + 1] = crossed(p[:, : order + 1], _backwards(rates, order)).sum(axis=1) / (order + 1)
    return p, rates


def transported(vectors: Array, rates: Array) -> None:
    """Complete the Taylor terms (3, TERMS, B, 2, M) of vectors that rest while the axes they are seen in turn."""
    for order in range(TERMS - 1):
        vectors[:, order + 1] = crossed(vectors[:, : order + 1], _backwards(rates, order)).sum(axis=1) / (order + 1)


def convolved(a: Array, b: Array) -> Array:
    """Taylor terms of a scalar product from those of its factors: (3, TERMS, ...) each -> (TERMS, ...)."""
    result = np.empty((TERMS, *a.shape[2:]))
    for order in range(TERMS):
        np.einsum("ct...,ct...->...", a[:, : order + 1], _backwards(b, order), out=result[order])
    return result


def _backwards(terms: Array, order: int) -> Array:
    """Terms `order` ... 0 along the axis after the components."""
    return terms[..., order::-1, :, :, :] if order else terms[..., :1, :, :, :]


def crossed(a: Array, b: Array) -> Array:
    """Cross product of vectors along the first axis."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[j] * b[k], a[k] * b[j], out=result[i])
    return result


def hermite_polynomials(terms: Array) -> Array:
    """Coefficients of powers of y in [-1, 1] from Taylor terms at both ends: (TERMS, c, B, 2, M) -> (n, c, B, M)."""
    _, components, batch, _, count = terms.shape
    data = terms.transpose(3, 0, 1, 2, 4).reshape(2 * TERMS, -1)
    return (hermite_matrix() @ data).reshape(2 * TERMS, components, batch, count)


@lru_cache(maxsize=4)
def hermite_matrix(terms: int = TERMS) -> Array:
    """Taylor terms at x = 0, then those at x = 1 -> coefficients of powers of y = 2 x - 1; every entry is exact."""
    x, rest = np.array([0.5, 0.5]), np.array([0.5, -0.5])
    columns = []
    for near, far, sign in ((x, rest, 1.0), (rest, x, -1.0)):
        for order in range(terms):
            # (sign near)^order far^terms, divided by far^terms to the order that counts.
            total = np.zeros(1)
            for further in range(terms - order):
                power = np.polynomial.polynomial.polypow(near, further)
                total = np.polynomial.polynomial.polyadd(total, comb(terms - 1 + further, further) * power)
            total = np.polynomial.polynomial.polymul(total, np.polynomial.polynomial.polypow(sign * near, order))
            total = np.polynomial.polynomial.polymul(total, np.polynomial.polynomial.polypow(far, terms))
            columns.append(np.pad(total, (0, 2 * terms - len(total))))
    return np.stack(columns, axis=1)


def interpolation_error(polynomials: Array) -> float:
    """The largest error of polynomials of quaternions, from the decay of their Chebyshev coefficients [rad]."""
    tail = np.abs(_tail_matrix() @ polynomials[-4:].reshape(4, -1)).reshape(4, 4, -1).max(axis=1)
    early, late = np.maximum(tail[0], tail[1]), np.maximum(tail[2], tail[3])
    return float((2.0 * _ERROR_OF_COEFFICIENT * late * np.minimum(late / (early + _TINY), 1.0)).max(initial=0.0))


@lru_cache(maxsize=1)
def _tail_matrix() -> Array:
    """The last four coefficients of powers -> the last four Chebyshev coefficients."""
    count = 2 * TERMS
    columns = [np.polynomial.chebyshev.poly2cheb(row[: k + 1]) for k, row in enumerate(np.eye(count))]
    padded = [np.pad(column, (0, count - len(column)))[-4:] for column in columns[-4:]]
    return np.asarray(np.stack(padded, axis=1), dtype=np.float64)


def values(polynomials: Array, place: Integers, y: Array) -> Array:
    """The polynomials of given pieces at y in [-1, 1]: (n, c, B, M), (N,), (N,) -> (c, B, N)."""
    result = polynomials[-1].take(place, axis=-1)
    for row in polynomials[-2::-1]:
        result *= y
        result += row.take(place, axis=-1)
    return np.asarray(result, dtype=np.float64)
