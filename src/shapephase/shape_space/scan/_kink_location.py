"""Location of a kink of a function of time that is smooth on both sides of it, to rounding."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Array
from ...chebyshev import nodes_on, values_to_coefficients

_DEGREE = 4  # of the series on each side: continued by half their length they stay exact
_SIDE = 2.0  # length of a side, in widths of the stretch between
_TIMES = 31  # of the stretch in one round
_NEARER = 0.1  # ratio of distances that assigns a value to a side
_ALIKE = 30.0  # roundings: values this near to both sides are undecided; continued series add as much
_LEAST_PROGRESS = 0.5  # of the stretch per round: with less, both sides are alike
_NARROW = 4.0  # roundings of times
_CONFIRMED_DEGREE = 8  # of the series that confirm a kink; places where they are checked
_CONFIRMED_AT = np.array([0.043, 0.331, 0.613, 0.957])
_MOST_ROUNDS = 20


def located_kink(
    at: Callable[[Array], Array],
    stretch: tuple[float, float],
    limits: tuple[float, float],
    floor: Array,
) -> float | None:
    """The time of the only kink in a short stretch; None where there is none, or something else.

    at : times (N,) -> values (N, c)
    limits : between which the function may be evaluated
    floor : (c,) rounding of the values
    """
    scale = np.maximum(floor, np.finfo(float).tiny)
    tick = float(np.spacing(stretch[1]))
    where = _narrowed(at, stretch, limits, scale, tick)
    if where is None:
        return None
    width = stretch[1] - stretch[0]
    margin = 64.0 * tick
    before = max(limits[0], where - width), where - margin
    after = where + margin, min(limits[1], where + width)
    confirmed = _is_smooth(at, before, scale) and _is_smooth(at, after, scale)
    return where if confirmed else None


def _is_smooth(at: Callable[[Array], Array], side: tuple[float, float], scale: Array) -> bool:
    """True if one short series is the function on a side of a kink."""
    left, right = side
    nodes = nodes_on(np.array([left]), np.array([right]), _CONFIRMED_DEGREE)[0]
    checks = left + (right - left) * _CONFIRMED_AT
    values = at(np.concatenate([nodes, checks]))
    local = 2.0 * _CONFIRMED_AT - 1.0
    coefficients = values_to_coefficients(_CONFIRMED_DEGREE) @ values[: len(nodes)]
    gap = np.polynomial.chebyshev.chebval(local, coefficients).T - values[len(nodes) :]
    return bool((np.abs(gap) <= _ALIKE * scale).all())


def _narrowed(
    at: Callable[[Array], Array], stretch: tuple[float, float], limits: tuple[float, float], scale: Array, tick: float
) -> float | None:
    """The time from which on the function belongs to the right side, as far as sides are there."""
    left, right = stretch
    for _ in range(_MOST_ROUNDS):
        width = right - left
        before = max(limits[0], left - _SIDE * width)
        after = min(limits[1], right + _SIDE * width)
        if left - before < 0.5 * width or after - right < 0.5 * width:
            return None
        sides = nodes_on(np.array([before, right]), np.array([left, after]), _DEGREE)
        times = left + width * np.arange(1.0, _TIMES + 1.0) / (_TIMES + 1.0)
        values = at(np.concatenate([sides.ravel(), times]))
        known = values[: sides.size].reshape(2, _DEGREE + 1, -1)
        there = values[sides.size :]
        far = np.stack([_continued(known[k], sides[k, 0], sides[k, -1], times) - there for k in range(2)])
        from_left, from_right = np.abs(far / scale).max(axis=2)
        of_left = (from_left <= _NEARER * from_right) & (from_right > _ALIKE)
        of_right = (from_right <= _NEARER * from_left) & (from_left > _ALIKE)
        alike = np.maximum(from_left, from_right) <= _ALIKE
        last = int(np.max(np.flatnonzero(of_left), initial=-1))
        first = int(np.min(np.flatnonzero(of_right), initial=_TIMES))
        if last > first:
            return None
        between = slice(last + 1, first)
        # A point or two at the kink itself may be near to neither side by enough.
        undecided = int((~alike[between]).sum())
        if undecided > max(2, (first - last) // 3) and width > 1e3 * tick:
            return None
        if (~(of_left | alike))[: last + 1].any() or (~(of_right | alike))[first:].any():
            return None
        if last < 0 and first == _TIMES:
            return 0.5 * (left + right) if alike.all() else None
        left, right = times[last] if last >= 0 else left, times[first] if first < _TIMES else right
        if right - left <= _NARROW * tick or right - left > _LEAST_PROGRESS * width:
            return 0.5 * (left + right)
    return 0.5 * (left + right)


def _continued(values: Array, left: float, right: float, times: Array) -> Array:
    """The polynomial through values at the Chebyshev points of [left, right], at times outside."""
    local = (2.0 * times - left - right) / (right - left)
    coefficients = values_to_coefficients(_DEGREE) @ values
    return np.asarray(np.polynomial.chebyshev.chebval(local, coefficients).T, dtype=np.float64)
