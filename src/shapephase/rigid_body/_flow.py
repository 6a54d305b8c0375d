"""The flow of a smooth vector field at given times, accurate nearly to rounding."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from ..arguments import check_function
from ..arrays import Array
from ..errors import AccuracyNotReached

TOLERANCE = 3e-14  # relative tolerance of a step; SciPy warns below 2.2e-14 (100 eps) and raises the value
_STEPS = 20_000  # most steps from one time to the next; a motion that needs more is too stiff for an explicit method


def flow(rate: Callable[[Array], Array], start: Array, times: Array, scale: Array | float | None = None) -> Array:
    """Solution of y' = rate(y) with y(times[0]) = start, by DOP853: (N,) times -> (..., N, d).

    Every time is the end of a step, so no interpolation error enters. The error in phase grows with the square of the
    time: for a tumbling body it is 1e-11 after ten periods and 1e-9 after eighty.

    Raises AccuracyNotReached if the solution leaves every bound before the last time, the step becomes too small, or
    the steps too many.

    Parameters
    ----------
    rate : (..., d) -> (..., d), smooth
    start : (..., d), all integrated together
    times : (N,) strictly ascending
    scale : magnitude of y that the tolerance 3e-14 is relative to, broadcast to start; None: the largest entry of
        each vector of start

    Examples
    --------
    >>> decay = sp.rigid_body.flow(lambda y: -y, np.array([1.0]), np.array([0.0, 1.0]))
    >>> print(f"{decay[-1, 0]:.9f} = exp(-1)")
    0.367879441 = exp(-1)
    """
    check_function(rate, "rate", "a function that gives rates of change")
    from scipy.integrate import DOP853

    shape, out = start.shape, [start]
    if not start.size:
        return np.zeros((*shape[:-1], len(times), shape[-1]))
    magnitude = np.abs(start).max(axis=-1, keepdims=True) if scale is None else scale
    absolute: Any = TOLERANCE * np.maximum(np.broadcast_to(magnitude, shape).ravel(), np.finfo(float).tiny)
    state, next_step = start.ravel(), None

    def slope(_: float, flat: Array) -> Array:
        return rate(flat.reshape(shape)).ravel()

    for left, right in pairwise(times):
        with np.errstate(all="ignore"):
            if not np.isfinite(slope(left, state)).all():
                raise AccuracyNotReached(f"the motion has no finite rate at t = {left:.9g}; its values are too large")
            first = None if next_step is None else min(next_step, right - left)
            solver = DOP853(slope, left, state, right, rtol=TOLERANCE, atol=absolute, first_step=first)
            steps = 0
            while solver.status == "running" and steps < _STEPS:
                solver.step()
                # The last step was cut short by the end time; the step proposed after it was not.
                next_step, steps = solver.h_abs, steps + 1
        state = solver.y
        if solver.status != "finished" or not np.isfinite(state).all():
            raise AccuracyNotReached(
                f"the motion cannot be followed beyond t = {solver.t:.9g}: it grows without bound, is too rough, or "
                f"takes more than {_STEPS} steps from one time to the next; give earlier times, or more of them"
            )
        out.append(state.reshape(shape))
    return np.stack(out, axis=-2)
