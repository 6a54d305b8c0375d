"""Bracketed roots: of one function to rounding, and of many increasing functions at once by the caller's own step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .arrays import Array
from .errors import AccuracyNotReached

ROUNDING = 2e-16  # the floor for an angle in [-pi/2, pi/2]


def bracketed_root(function: Callable[[float], float], low: float, high: float) -> float:
    """Root to rounding of a function whose signs at low and high differ, by Brent's method."""
    from scipy.optimize import brentq

    least = 4.0 * np.finfo(float).eps  # SciPy accepts none below
    return float(brentq(function, low, high, xtol=1e-300, rtol=least))  # type: ignore[arg-type]


def safe_newton(
    step: Callable[[Array], tuple[Array, Array]], start: Array, low: Array, high: Array, floor: float = 0.0
) -> Array:
    """The x (N,) in [low, high] where increasing functions cross 0.

    Raises AccuracyNotReached if the bracket has not closed after 120 steps, which a function that is not a number
    causes.

    step : x (N,) -> the functions there, or anything of their sign, and the next x by the caller's rule
    start, low, high : (N,)
    floor : change of x that makes no difference, however small x is; 6e-16 of x is always such

    A next x outside the bracket is replaced by the bracket's middle, so that it ends whatever the rule.
    """
    x, low, high = np.clip(start, low, high), low.copy(), high.copy()
    last = high - low
    settled = np.zeros(x.shape, dtype=bool)
    for _ in range(120):
        value, proposed = step(x)
        low = np.where(value <= 0.0, x, low)
        high = np.where(value >= 0.0, x, high)
        change = np.abs(proposed - x)
        inside = (proposed >= low) & (proposed <= high)
        # Steps that do not shrink by half are the mark of a rule that jumps to and fro.
        following = np.where(inside & (change <= 0.5 * last), proposed, 0.5 * (low + high))
        settled |= (np.minimum(change, high - low) <= floor + 3.0 * ROUNDING * np.abs(x)) | (value == 0.0)
        following = np.where(settled, x, following)
        last = np.abs(following - x)
        x = following
        if settled.all():
            return x
    raise AccuracyNotReached("no root was enclosed; the functions must be finite and increase from below 0 to above it")
