"""Whether a function's rates are the derivatives of its shapes, at a few times."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, check_finite
from ...errors import TrajectoryError
from ..curves import Curve


def check_rates(curve: Curve, breaks: Array) -> None:
    """Compare the function's rates with differences of its shapes away from the breaks.

    At two steps: where these disagree with each other, as on the flank of a burst, nothing follows from them.
    """
    left, width = breaks[:-1], np.diff(breaks)
    middle = left + 0.381 * width
    coarse, _, _ = _differences(curve, middle, 1e-4 * width)
    slope, rate, spread = _differences(curve, middle, 1e-5 * width)
    scale = np.abs(rate) + np.maximum(spread, 1e-9) / breaks[-1]
    wrong = np.abs(slope - rate) > 1e-3 * scale + 10.0 * np.abs(slope - coarse)
    if wrong.any():
        where, joint = (int(i) for i in np.argwhere(wrong)[0])
        raise TrajectoryError(
            f"the path's function gives the rate {rate[where, joint]:.6g} of joint number {joint} at "
            f"{middle[where]:.6g} s, but its shapes change at {slope[where, joint]:.6g}; return (shapes, rates)"
        )


def _differences(curve: Curve, middle: Array, step: Array) -> tuple[Array, Array, Array]:
    """Slopes of the shapes by central differences of order four, rates as given, spread of the shapes."""
    shapes, rates = curve(np.concatenate([middle + k * step for k in (-2, -1, 0, 1, 2)]))
    check_finite(shapes, "shapes of the path's function")
    a, b, _, d, e = shapes.reshape(5, len(middle), -1)
    slopes = (a - 8 * b + 8 * d - e) / (12 * step[:, None])
    return slopes, rates.reshape(5, len(middle), -1)[2], np.ptp(shapes, axis=0)
