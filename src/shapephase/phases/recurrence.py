"""When the body momentum of a motion comes back to its start, and where its curve crosses itself.

For shapes that close, `return_map` finds the motions that close with them; here is one motion of any body, rigid ones
included. The curve is that of u = Pi/|Pi| on the unit sphere, with u' = u x omega.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array, Integers, Mask, finite_array
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError
from ..integrator.interpolant import Interpolant
from ..letters import value_text
from ..reconstruction.reconstruction import Motion

_TINY = float(np.finfo(float).tiny)  # keeps quotients defined where the curve rests
_LONGEST = 0.05  # [rad] length of a piece of the curve: its cubic distinguishes two passages through it
_BENT = 0.3  # [rad] turn of a piece: a cubic is then right to a hundredth of its length
_TOO_SHORT = 1e-6  # [rad] shorter pieces are not divided for their bend: near a cusp the heading turns at once
_RESTING = 1e-11  # [rad] between points of a curve, below which its heading is rounding
_MOST_PIECES = 500_000  # for memory: a curve with more is refused
_AT_ONCE = 2048  # pieces whose neighbours are searched for together, for memory
_FAR = 1.0  # [rad] along the curve, after which it may have come back
_TURNED = 2.0  # [rad] turned, after which a small loop may have come back: it turns by more than pi
_SAME_CURVE = 1e-8  # [rad] between passages along whole pieces of a retraced curve
_MET = 1e-11  # [rad] between passages: the next Newton step leaves its square, below rounding even at 1e-6 rad
_TANGENT = 1e-6  # [rad] passages at a smaller angle touch and do not cross


@dataclass(frozen=True, eq=False)
class Returns:
    """When the momentum's direction is nearest its start again. Made by `momentum_returns`.

    Attributes
    ----------
    times : (n,) ascending, above 0 [s]
    gaps : (n,) angle to the start then [rad]
    """

    times: Array
    gaps: Array

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where the momentum's curve crosses itself, each pair of passages by itself. Made by `momentum_crossings`.

    Attributes
    ----------
    first, second : (n,) times of the two passages, first < second, ordered by them [s]
    directions : (n, 3) where, unit vectors of the base frame
    angles : (n,) from the first passage's heading to the second's, between 0 and pi [rad]
    gaps : (n,) angle between the two passages: of the order of rounding [rad]
    retraced : (m, 2) from when to when the curve goes along an earlier part of itself, either way [s]
    """

    first: Array
    second: Array
    directions: Array
    angles: Array
    gaps: Array
    retraced: Array

    __repr__ = short_repr


def momentum_returns(motion: Motion, gap: float = 0.1) -> Returns:
    """The times at which the direction of the body momentum is nearest its start, when it comes back that far.

    The local minima of the angle to the start, below `gap`, to rounding (of a motion known to its error estimate);
    the end of the motion counts when the direction is still coming nearer there. For a rigid body the first minimum
    of no angle is the period. Minima not deeper than the motion's error are none, so a steady turn has no returns;
    dips of less than about a thousandth of a radian in a smooth approach may be passed over.

    Parameters
    ----------
    gap : above 0, up to pi [rad]

    Raises
    ------
    ShapeError
        If the motion is a batch or has no momentum.

    Notes
    -----
    Source: theory.md section 6 and D12.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 2.5 * top.period), [0.6, 0.9, 0.5])
    >>> (sp.momentum_returns(motion).times / top.period).round(6).tolist()
    [1.0, 2.0]
    """
    check_object(motion, "Motion", "motion")
    largest = finite_array(gap, "gap", unit="rad")
    if largest.ndim or not 0.0 < largest <= np.pi:
        raise ShapeError(f"gap: an angle above 0, up to pi [rad] is needed, got {value_text(gap)}")
    curve = _Curve.of(motion)
    times = _resolved(curve, motion)
    directions, rates = curve.at(times)
    start = directions[0]
    nearing = rates @ start
    away = so3.angle_between(directions, start)
    begins = np.flatnonzero((nearing[1:-1] > 0.0) & (nearing[2:] <= 0.0)) + 1
    low, high = times[begins], times[begins + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        still = curve.at(middle)[1] @ start > 0.0
        low, high = np.where(still, middle, low), np.where(still, high, middle)
    nearest, ends = 0.5 * (low + high), begins
    if nearing[-1] > 0.0:
        nearest, ends = np.append(nearest, times[-1]), np.append(ends, len(times) - 1)
    gaps = so3.angle_between(curve.at(nearest)[0], start)
    noise = 1e-12 + 10.0 * float(motion.error_estimate)
    chosen, last = [], 0
    for row, end in enumerate(ends):
        if away[last : end + 1].max() - gaps[row] > noise:
            last = end + 1
            if gaps[row] < largest:
                chosen.append(row)
    return Returns(nearest[chosen], gaps[chosen])


def momentum_crossings(motion: Motion) -> Crossings:
    """All pairs of times at which the curve of the body momentum's direction crosses itself.

    Each pair is refined by Newton's method to rounding. The curve is followed in pieces that are 0.05 rad long and
    turn by 0.3 rad at most; two passages that touch, or cross twice within a piece without leaving each other by more
    than a hundredth of its length, may be passed over. Passages at less than 1e-6 rad are taken for touching.

    Where the curve goes along an earlier part of itself, to 1e-8 rad or thirty times the motion's error, it is
    listed in `retraced` (intervals of two pieces or more), and what crosses there is not counted again: the crossings
    are those of the curve without its retraced intervals. The meeting of the curve's two ends is not counted.

    Raises
    ------
    ShapeError
        If the motion is a batch or has no momentum.
    AccuracyNotReached
        If the curve needs more than 500 000 pieces.

    Notes
    -----
    Source: theory.md D8.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 3.0), [0.6, 0.9, 0.5])
    >>> len(sp.momentum_crossings(motion).first)  # a rigid body's curve does not cross itself
    0
    """
    check_object(motion, "Motion", "motion")
    curve = _Curve.of(motion)
    pieces = _Pieces.of(curve, _resolved(curve, motion))
    near = max(_SAME_CURVE, 30.0 * float(motion.error_estimate))
    pairs, partner = _neighbours(curve, pieces, near)
    retraced = _retraced(curve, pieces, partner, near)
    first, second = _refined(curve, pieces, pairs)
    length = motion.duration
    near_end = 1e-9 * length
    inside = ~((first < near_end) & (second > length - near_end))
    for begin, end in retraced:
        for time in (first, second):
            inside &= (time < begin) | (time > end)
    first, second = _distinct(first[inside], second[inside], 1e-8 * length)
    here, heading = curve.at(first)
    there, other = curve.at(second)
    angles = _angles(heading, other)
    crossing = np.sin(angles) > _TANGENT
    return Crossings(
        first[crossing],
        second[crossing],
        here[crossing],
        angles[crossing],
        so3.angle_between(here, there)[crossing],
        retraced,
    )


@dataclass(frozen=True)
class _Curve:
    """u(t) and u'(t) of one motion."""

    motion: Motion
    interpolant: Interpolant
    start: Array
    magnitude: float

    @classmethod
    def of(cls, motion: Motion) -> _Curve:
        if motion.batch:
            raise ShapeError(f"one motion is needed, this is a batch of {motion.batch}; reconstruct one of them")
        magnitude = float(np.linalg.norm(motion.momentum))
        if magnitude == 0.0:
            raise ShapeError("a motion without angular momentum has no momentum curve: its direction is undefined")
        return cls(motion, motion.interpolant, motion.initial_attitude.T @ (motion.momentum / magnitude), magnitude)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Directions and their rates: (N,) -> (N, 3), (N, 3)."""
        directions = so3.apply(so3.transpose(self.motion.solution.rotation(times)[0]), self.start)
        inverse, drift = self.interpolant.inverse_and_drift(times)
        return directions, np.cross(directions, so3.apply(inverse, self.magnitude * directions) - drift)


def _resolved(curve: _Curve, motion: Motion) -> Array:
    """Times between which the curve is short and bends little: (K + 1,)."""
    times = motion.solution.times
    times = np.unique(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
    directions, rates = curve.at(times)
    shortest = 1e-9 * motion.duration
    while True:
        chord = np.linalg.norm(np.diff(directions, axis=0), axis=-1)
        rough = (chord > _LONGEST) | ((so3.angle_between(rates[:-1], rates[1:]) > _BENT) & (chord > _TOO_SHORT))
        rough &= np.diff(times) > shortest
        if not rough.any():
            return times
        if len(times) + rough.sum() > _MOST_PIECES:
            raise AccuracyNotReached(
                f"the momentum curve needs more than {_MOST_PIECES} pieces (it is rough near t = "
                f"{times[:-1][rough][0]:.9g} s); look at a shorter part of the motion"
            )
        halves = 0.5 * (times[1:] + times[:-1])[rough]
        more, more_rates = curve.at(halves)
        order = np.argsort(np.concatenate([times, halves]))
        times = np.concatenate([times, halves])[order]
        directions = np.concatenate([directions, more])[order]
        rates = np.concatenate([rates, more_rates])[order]


@dataclass(frozen=True)
class _Pieces:
    """The curve in K pieces, each nearly a cubic.

    Times (K + 1,), points and rates at them (K + 1, 3); of the middle in time of each piece: time (K,), point and rate
    (K, 3), how far along the curve it is (K,) and how much the curve has turned until there (K,).
    """

    times: Array
    points: Array
    rates: Array
    middle: Array
    point: Array
    rate: Array
    along: Array
    turned: Array

    @classmethod
    def of(cls, curve: _Curve, times: Array) -> _Pieces:
        points, rates = curve.at(times)
        middle = 0.5 * (times[1:] + times[:-1])
        point, rate = curve.at(middle)
        step = np.linalg.norm(np.diff(point, axis=0), axis=-1)
        # Where the curve rests, its heading is but rounding.
        bend = np.where(step > _RESTING, so3.angle_between(rate[:-1], rate[1:]), 0.0)
        along, turned = (np.append(0.0, np.cumsum(part)) for part in (step, bend))
        return cls(times, points, rates, middle, point, rate, along, turned)

    @cached_property
    def duration(self) -> Array:
        """Durations: (K,) [s]."""
        return np.diff(self.times)

    @cached_property
    def length(self) -> Array:
        """Lengths of the chords: (K,)."""
        return np.linalg.norm(np.diff(self.points, axis=0), axis=-1)

    def apart(self, i: Integers, j: Integers) -> Mask:
        """True where the curve can have come back from a piece to a later one."""
        return (self.along[j] - self.along[i] > _FAR) | (self.turned[j] - self.turned[i] > _TURNED)

    def cubic(self, piece: Integers, share: Array) -> tuple[Array, Array]:
        """Place and slope by the share of a piece, by its cubic: (N,), (N,) -> (N, 3), (N, 3)."""
        x, span = share[:, None], self.duration[piece, None]
        first, last = self.points[piece], self.points[piece + 1]
        start, end = span * self.rates[piece], span * self.rates[piece + 1]
        square, cube = 3.0 * (last - first) - 2.0 * start - end, 2.0 * (first - last) + start + end
        return first + x * (start + x * (square + x * cube)), start + x * (2.0 * square + 3.0 * x * cube)


def _neighbours(curve: _Curve, pieces: _Pieces, near: float) -> tuple[Integers, Array]:
    """Pairs of pieces close together (n, 2), and for each piece the earlier time it goes along (K,), or -1.

    Pieces that go along earlier ones are left out of the pairs, so that a curve gone through a thousand times has no
    more of them than one.
    """
    from scipy.spatial import KDTree

    count = len(pieces.middle)
    reach = 1.1 * float(pieces.length.max()) + near
    partner, kept, pairs = np.full(count, -1.0), np.empty(0, dtype=np.int64), [np.empty((0, 2), dtype=np.int64)]
    for start in range(0, count, _AT_ONCE):
        part = np.arange(start, min(start + _AT_ONCE, count))
        pool = np.concatenate([kept, part])
        near_each = KDTree(pieces.point[pool]).query_ball_point(pieces.point[part], reach)
        second = np.repeat(part, [len(rows) for rows in near_each])
        first = pool[np.concatenate([np.asarray(rows, dtype=np.int64) for rows in near_each])]
        apart = (first < second) & (
            np.linalg.norm(pieces.point[first] - pieces.point[second], axis=-1)
            < 1.2 * np.maximum(pieces.length[first], pieces.length[second]) + near
        )
        first, second = first[apart], second[apart]
        apart = pieces.apart(first, second)
        first, second = first[apart], second[apart]
        who, guess = _seems_along(pieces, first, second, near)
        when, on = _on_curve(curve, pieces.middle[who], (pieces.point[who], pieces.rate[who]), guess, near)
        partner[who[on]] = when[on]
        # A piece at the end of a retraced interval is known by its middle: its other half may be new.
        along = np.pad(partner[part] >= 0.0, 1, mode="edge")
        along[0] = partner[start - 1] >= 0.0 if start else True
        kept = np.concatenate([kept, part[~(along[:-2] & along[1:-1] & along[2:])]])
        new = (partner[first] < 0.0) & (partner[second] < 0.0)
        pairs.append(np.stack([first[new], second[new]], axis=1))
    return np.concatenate(pairs), partner


def _seems_along(pieces: _Pieces, first: Integers, second: Integers, near: float) -> tuple[Integers, Array]:
    """The second pieces whose middles lie on cubics of first ones, as well as those show it, and where on them (n,)."""
    share = np.full(len(first), 0.5)
    point = pieces.point[second]
    for _ in range(4):
        place, slope = pieces.cubic(first, share)
        speed = np.maximum(np.sum(slope * slope, axis=-1), _TINY)
        # Before its start there is no curve.
        lowest = np.where(first == 0, 0.0, -0.1)
        share = np.clip(share + np.sum((point - place) * slope, axis=-1) / speed, lowest, 1.1)
    distance = np.linalg.norm(point - pieces.cubic(first, share)[0], axis=-1)
    rows = np.flatnonzero(distance < near + 0.01 * pieces.length[first])
    rows = rows[np.lexsort([distance[rows], second[rows]])]
    _, best = np.unique(second[rows], return_index=True)
    rows = rows[best]
    return second[rows], (pieces.times[first] + share * pieces.duration[first])[rows]


def _on_curve(
    curve: _Curve, times: Array, known: tuple[Array, Array], guesses: Array, near: float
) -> tuple[Array, Mask]:
    """The time next to each guess at which the curve is nearest its place at `times`; whether it runs along there.

    `known` are places and rates at `times`.
    """
    (point, rate), when = known, guesses
    for _ in range(2):
        here, slope = curve.at(when)
        speed = np.maximum(np.sum(slope * slope, axis=-1), _TINY)
        when = np.clip(when + np.sum((point - here) * slope, axis=-1) / speed, 0.0, times)
    here, slope = curve.at(when)
    apart = np.abs(times - when) > 0.5 * np.abs(times - guesses)
    return when, apart & (so3.angle_between(point, here) < near) & (np.sin(so3.angle_between(rate, slope)) < 1e-3)


def _retraced(curve: _Curve, pieces: _Pieces, partner: Array, near: float) -> Array:
    """Intervals of time in which the curve runs along earlier parts: (m, 2)."""
    on = np.concatenate([[False], partner >= 0.0, [False]])
    change = np.flatnonzero(on[1:] != on[:-1]).reshape(-1, 2)
    result = []
    for begin, end in change[change[:, 1] - change[:, 0] > 1]:
        times = []
        for inner, outer in ((begin, begin - 1), (end - 1, end)):
            if not 0 <= outer < len(pieces.middle):
                times.append(pieces.times[0 if outer < 0 else -1])
                continue
            inside, along, outside = (float(x) for x in (pieces.middle[inner], partner[inner], pieces.middle[outer]))
            times.append(_edge(curve, inside, along, outside, near))
        result.append(times)
    return np.array(result).reshape(-1, 2)


def _edge(curve: _Curve, inner: float, partner: float, outer: float, near: float) -> float:
    """Where running along an earlier part begins or ends, between a time inside and one outside."""
    known, when = inner, partner
    for _ in range(50):
        middle = 0.5 * (known + outer)
        _, rates = curve.at(np.array([known, when]))
        ratio = float(np.sum(rates[0] * rates[1]) / max(np.sum(rates[1] ** 2), _TINY))
        times = np.array([middle])
        nearest, on = _on_curve(curve, times, curve.at(times), np.array([when + ratio * (middle - known)]), near)
        if on[0]:
            known, when = middle, float(nearest[0])
        else:
            outer = middle
    return known


def _refined(curve: _Curve, pieces: _Pieces, pairs: Integers) -> tuple[Array, Array]:
    """Crossings within pairs of pieces: of their cubics first, then of the curve: times (n,), (n,)."""
    i, j = pairs.T
    b, d = np.diff(pieces.points, axis=0)[i], np.diff(pieces.points, axis=0)[j]
    across = np.linalg.norm(np.cross(b, d), axis=-1) > 0.5 * pieces.length[i] * pieces.length[j]
    # Pieces well across each other meet once; others are tried from each end and the middle.
    starts = [(i[across], j[across], 0.5, 0.5)]
    starts += [(i[~across], j[~across], p, q) for p in (0.0, 0.5, 1.0) for q in (0.0, 0.5, 1.0)]
    first, second = [], []
    for i, j, p, q in starts:
        shares = np.full(len(i), p), np.full(len(i), q)
        for _ in range(8):
            shares = _newton(*pieces.cubic(i, shares[0]), *pieces.cubic(j, shares[1]), shares, -0.5, 1.5)
        gap = np.linalg.norm(pieces.cubic(i, shares[0])[0] - pieces.cubic(j, shares[1])[0], axis=-1)
        good = gap < 1e-4 * (pieces.length[i] + pieces.length[j])
        first.append((pieces.times[i] + shares[0] * pieces.duration[i])[good])
        second.append((pieces.times[j] + shares[1] * pieces.duration[j])[good])
    end = curve.motion.duration
    times = _distinct(np.concatenate(first), np.concatenate(second), 1e-5 * float(np.median(pieces.duration)))
    for _ in range(6):
        times = _newton(*curve.at(times[0]), *curve.at(times[1]), times, 0.0, end)
    (here, heading), (there, other) = curve.at(times[0]), curve.at(times[1])
    # Where the curve goes along itself Newton's method has no target, and its next step may lead anywhere.
    met = (so3.angle_between(here, there) < _MET) & (np.sin(_angles(heading, other)) > _TANGENT)
    # A start that strayed from elsewhere may only just have come near. Newton's method squares an error: after one more
    # step all pairs are right to rounding.
    times = (times[0][met], times[1][met])
    return _newton(here[met], heading[met], there[met], other[met], times, 0.0, end)


def _angles(first: Array, second: Array) -> Array:
    """Angles between vectors of any length: (n, 3), (n, 3) -> (n,) [rad]."""
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.arctan2(across, np.sum(first * second, axis=-1))


def _newton(
    here: Array, heading: Array, there: Array, other: Array, places: tuple[Array, Array], low: float, high: float
) -> tuple[Array, Array]:
    """One Newton step on here = there, from places and slopes of both."""
    normal = np.cross(heading, other)
    square = np.maximum(np.sum(normal * normal, axis=-1), _TINY)
    apart = there - here
    step = (np.sum(np.cross(apart, slope) * normal, axis=-1) / square for slope in (other, heading))
    return tuple(np.clip(place + move, low, high) for place, move in zip(places, step, strict=True))


def _distinct(first: Array, second: Array, spacing: float) -> tuple[Array, Array]:
    """Pairs in order, each once."""
    order = np.lexsort([second, first])
    kept: list[int] = []
    for row in order:
        recent = [earlier for earlier in kept[-64:] if first[row] - first[earlier] < spacing]
        if all(abs(second[row] - second[earlier]) > spacing for earlier in recent):
            kept.append(int(row))
    return first[kept], second[kept]
