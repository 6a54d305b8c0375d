"""Bounds over a box of parameters of how far the motions of a family are from that of its centre.

At the same share of its duration T, a member has T I^-1 and T I^-1 L_o. How far these are from the centre's is known
from members on a grid of parameters and times. Let K be the integral over the motion of that distance, |dI^-1| l +
|d(I^-1 L_o)|, S and W those of the spread of the eigenvalues of I^-1, times l, and of |I^-1 L_o|, and A the growth of
attitude errors along the centre's motion. Then the attitudes of all members stay within D of the centre's, where

    D = A (K (1 + c D) + (a S + b W) D^2)

has its smaller root: variation of constants, with all terms of second order bounded. Where there is no root the box is
too large. The one link that is not a proof are the differences, which are those of neighbours on the grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import maximum_filter1d

from ..arrays import Array, lock_arrays
from ..deformation.deformation import Deformation
from ..display import short_repr
from ..inertia_tensor import inverse_inertia

_COUNTS = {1: 65, 2: 17, 3: 7}  # of members along each parameter, by the number of parameters
PANELS, _TIMES = 128, 4  # panels of time after the start, which is one by itself, and times in each
_WIDER = 1.1  # than the largest difference among those of neighbours beside it: curvature at the ends of the box
_ROUND_UP = 1.0 + 1e-12  # for products of positive bounds: thousands of times their rounding
_GROWTH = 1.1  # the growth of errors is measured between 17 times, to 4 %
_FARTHEST = 0.1  # [rad] for which the three constants below hold
_SQUARE_SPREAD, _SQUARE_DRIFT, _PRODUCT = 1.57, 1.04, 2.62  # a, b and c: commutators, and exp's inverse derivative


@dataclass(frozen=True, eq=False)
class Cover:
    """Boxes of parameters that cover a family, and how far at least their members miss a goal. Made by `design`.

    Attributes
    ----------
    boxes : (K, n, 2) ends of the boxes
    centres : (K,) miss of the member at the centre of each, of the goal that excludes it [rad, or J for a regime]
    least : (K,) no member of the box misses that goal by less; above 0 [rad, or J for a regime]
    goals : (K,) names of those goals
    """

    boxes: Array
    centres: Array
    least: Array
    goals: tuple[str, ...]

    __post_init__ = lock_arrays
    __repr__ = short_repr


class NotEnclosed(Exception):
    """A family for which there are no bounds; the message says why."""


@dataclass(frozen=True, eq=False)
class Differences:
    """Bounds that hold for all members of a box, against the member at its centre.

    attitude : of the angle between both at any of the times [rad]
    lift : the same of the horizontal lifts [rad]
    dynamic : of the dynamic phase [rad]
    inverse, spread : (P,) on each panel of time: the change of I^-1, and the distance of its extreme eigenvalues at the
        centre [1/(kg m^2)]
    """

    attitude: float
    lift: float
    dynamic: float
    inverse: Array
    spread: Array


class FamilySamples:
    """T I^-1 and T I^-1 L_o of the members on a grid of parameters, at equal shares of their durations T."""

    def __init__(self, member: Callable[[Array], Deformation], box: Array) -> None:
        """Sample the family on its box (n, 2). Raises NotEnclosed for too many parameters."""
        count = len(box)
        if count not in _COUNTS:
            raise NotEnclosed(
                f"a family of {count} parameters is not enclosed; try another start, or fix all but {max(_COUNTS)}"
            )
        grid = np.linspace(box[:, 0], box[:, 1], _COUNTS[count])
        made = [member(np.array(x)) for x in product(*grid.T)]
        self._grid = grid
        durations = np.array([deformation.duration for deformation in made])
        sampled = zip(*(_sampled(deformation) for deformation in made), strict=True)
        shape = (_COUNTS[count],) * count
        plain, drift = (np.array(values).reshape(*shape, *values[0].shape) for values in sampled)
        inverse = plain * durations.reshape(*shape, 1, 1, 1, 1)
        # Largest rates of change by each parameter between neighbours, on the panels of time.
        self._slopes = []
        for axis, step in enumerate(grid[1] - grid[0]):
            sizes = [np.abs(np.linalg.eigvalsh(np.diff(values, axis=axis))).max(axis=-1) for values in (inverse, plain)]
            sizes.append(np.linalg.norm(np.diff(drift, axis=axis), axis=-1))
            self._slopes.append([_beside(size.max(axis=-1), count) * (_WIDER / step) for size in sizes])

    def differences(
        self, box: Array, centre: Deformation, growth: float, magnitude: float, panels: int = PANELS
    ) -> Differences | None:
        """Bounds over a part of the family's box; None where it is too large for any.

        box : (n, 2)
        centre : its member there
        growth : of attitude errors along the motion of that member
        magnitude : l [kg m^2/s]
        panels : number of panels of time after the start for which they hold
        """
        changes = inverse, plain, drift = np.zeros((3, 1 + PANELS))
        for axis, half in enumerate(0.5 * np.diff(box, axis=1)[:, 0]):
            for total, slopes in zip(changes, self._slopes[axis], strict=True):
                for other, (low, high) in enumerate(box.tolist()):
                    edges, last = self._grid[:, other], slopes.shape[other] - 1
                    first, final = np.searchsorted(edges, low, "right"), np.searchsorted(edges, high, "left")
                    kept = slice(min(max(first - 1, 0), last), min(max(final, 1), last + 1))
                    slopes = slopes[(slice(None),) * other + (kept,)]
                total += half * slopes.max(axis=tuple(range(len(box))))
        tensors, still = _sampled(centre)
        values = np.linalg.eigvalsh(tensors)
        spread = _WIDER * (values[..., 2] - values[..., 0]).max(axis=-1)
        stray = _WIDER * np.linalg.norm(still, axis=-1).max(axis=-1)
        change, bent, strayed, lifted = (
            float(rate[1 : 1 + panels].sum()) / PANELS * _ROUND_UP
            for rate in (inverse * magnitude + drift, spread * centre.duration * magnitude, stray, drift)
        )
        distance = _smaller_root(_GROWTH * growth, change, _SQUARE_SPREAD * bent + _SQUARE_DRIFT * strayed)
        if distance is None:
            return None
        return Differences(distance, lifted, change + distance * (bent + strayed), plain, spread)


def panel_of(deformation: Deformation, time: float) -> int:
    """Return the panel in which a time lies, 0 at the start."""
    return min(int(np.ceil(time / deformation.duration * PANELS)), PANELS)


def _sampled(deformation: Deformation) -> tuple[Array, Array]:
    """I^-1 and T I^-1 L_o at the start and on the panels: (P, times, 3, 3) [1/(kg m^2)], (P, times, 3) [rad]."""
    shares = (np.arange(PANELS * _TIMES) + 0.5) / (PANELS * _TIMES)
    times = deformation.duration * np.concatenate([np.zeros(_TIMES), shares])
    inertia, internal = deformation.description.sample(times)
    inverse = inverse_inertia(inertia, times)
    drift = deformation.duration * (inverse @ internal[:, :, None])[:, :, 0]
    return inverse.reshape(-1, _TIMES, 3, 3), drift.reshape(-1, _TIMES, 3)


def _beside(values: Array, count: int) -> Array:
    """The greatest of each value and its neighbours, along parameters and panels after the start: (..., P)."""
    for axis in range(count):
        values = maximum_filter1d(values, 3, axis=axis, mode="nearest")
    after = maximum_filter1d(values[..., 1:], 3, axis=-1, mode="nearest")
    return np.concatenate([values[..., :1], after], axis=-1)


def _smaller_root(growth: float, change: float, square: float) -> float | None:
    """Smaller root D of D = growth (change (1 + c D) + square D^2), if there is one where the constants hold."""
    linear = 1.0 - _PRODUCT * growth * change
    discriminant = linear * abs(linear) - 4.0 * growth * growth * change * square
    if discriminant <= 0.0:
        return None
    root = 2.0 * growth * change / (linear + np.sqrt(discriminant)) * _ROUND_UP
    return float(root) if root <= _FARTHEST else None
