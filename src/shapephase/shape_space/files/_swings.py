"""How far a smooth path swings between the samples of a recording: where that is too far, it misses the samples."""

from __future__ import annotations

import numpy as np

from ...arrays import FARTHEST
from ...body.body import Body
from ...errors import TrajectoryError
from ..curves import PiecewisePolynomial
from ..shape_path import ShapePath

_MOST_SWING = 4.0 * FARTHEST
"""Of a path between two samples [rad or m]: the terms of its cubics, which rounding leaves right to 1e-9."""


def check_swings(path: ShapePath, body: Body) -> None:
    """Raise TrajectoryError where a spline swings so far between samples that rounding moves it off them."""
    curve = path.curve
    assert isinstance(curve, PiecewisePolynomial)
    lengths = np.diff(curve.knots)
    powers = lengths[:, None] ** np.arange(len(curve.coefficients))
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        swings = np.einsum("kpj,pk->pj", np.abs(curve.coefficients), powers)
    if swings.size and not swings.max() <= _MOST_SWING:
        piece, joint = np.unravel_index(int(np.argmax(np.nan_to_num(swings, nan=np.inf))), swings.shape)
        raise TrajectoryError(
            f"joint {body.joint_names[joint]}: a smooth path through the samples would swing by some "
            f"{swings[piece, joint]:.2g} {body.joint_units[joint]} between {curve.knots[piece]:.9g} s and "
            f"{curve.knots[piece + 1]:.9g} s; is there a gap, or are two samples nearly at one time? Keep what is "
            "before or after it (trim, --flight), or drop a sample"
        )
