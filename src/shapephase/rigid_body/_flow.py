"""The flow of a smooth vector field at given times, near rounding."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, finite_array
from ..errors import AccuracyNotReached, ShapeError

_TOLERANCE = 3e-14
"""Relative tolerance of a step, near the least that SciPy takes."""
_STEPS = 20_000
"""Most steps between two times; a motion that needs more is stiff, and no task for an explicit method."""


def flow(rate: Callable[[Array], Array], start: Array, times: Array, scale: Array | float | None = None) -> Array:
    """The solution of y' = rate(y) with y(times[0]) = start, by DOP853: (N,) times -> (..., N, d).

    Parameters
    ----------
    rate : (..., d) -> (..., d), smooth
    start : (..., d), all integrated together
    times : (N,) strictly ascending, as `ascending_times` returns them
    scale : the size of y to which the tolerance 3e-14 refers, broadcast to start; None: that of each vector of it

    Every time is the end of a step, so that no error of interpolation enters. The error in phase grows with the square
    of the time: along a tumbling body 1e-11 over ten periods, 1e-9 over eighty.

    Raises
    ------
    AccuracyNotReached
        If the solution leaves every bound before the last time, the step becomes too small, or the steps too many.
    """
    from scipy.integrate import DOP853

    shape, out = start.shape, [start]
    if not start.size:
        return np.zeros((*shape[:-1], len(times), shape[-1]))
    size = np.abs(start).max(axis=-1, keepdims=True) if scale is None else scale
    absolute: Any = _TOLERANCE * np.maximum(np.broadcast_to(size, shape).ravel(), np.finfo(float).tiny)
    state, pace = start.ravel(), None

    def slope(_: float, flat: Array) -> Array:
        return rate(flat.reshape(shape)).ravel()

    for left, right in pairwise(times):
        with np.errstate(all="ignore"):
            if not np.isfinite(slope(left, state)).all():
                raise AccuracyNotReached(f"the motion has no finite rate at t = {left:.9g}; its numbers are too large")
            first = None if pace is None else min(pace, right - left)
            solver = DOP853(slope, left, state, right, rtol=_TOLERANCE, atol=absolute, first_step=first)
            steps = 0
            while solver.status == "running" and steps < _STEPS:
                solver.step()
                # The step that ends here was cut short; its proposal for the next one is the natural pace.
                pace, steps = solver.h_abs, steps + 1
        state = solver.y
        if solver.status != "finished" or not np.isfinite(state).all():
            raise AccuracyNotReached(
                f"the motion cannot be followed beyond t = {solver.t:.9g}: it grows without bound, is too rough, or "
                f"takes more than {_STEPS} steps from one time to the next; ask for times before that, or more of them"
            )
        out.append(state.reshape(shape))
    return np.stack(out, axis=-2)


def ascending_times(times: ArrayLike) -> Array:
    """A user's times: (N,), strictly ascending, at least one. Raises ShapeError."""
    array = finite_array(times, "times", (None,))
    if array.ndim != 1 or not array.size or np.any(np.diff(array) <= 0.0):
        raise ShapeError("times: strictly ascending times (N,) are needed, the first is that of the start")
    return array
