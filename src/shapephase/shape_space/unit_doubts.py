"""Joint motions that resemble degrees or millimetres, and the warning about them."""

from __future__ import annotations

import warnings

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..errors import TrajectoryWarning
from .curves import Fourier, PiecewisePolynomial
from .path_series import evenly_divided, panel_edges
from .shape_path import ShapePath

DEGREE = np.pi / 180.0  # [rad]
_FAR_BEYOND = 0.2  # of the width of a joint's limits: noise leaves them by less
_HALF_TURN = np.pi  # [rad] beyond its limits a joint may go by less, to try forbidden postures
_LOOKS = 65  # times of the first loop of a function, at multiples of the golden ratio: no swing repeats them
_LOOKS_OF_A_SWING = 8  # times: a sine is then within 8 % of its largest value


def looks_like(values: Array, factor: float, lower: float, upper: float) -> bool:
    """True if values are far beyond limits, and within them in a unit of this size, in SI units: (N,) [rad or m]."""
    room = _FAR_BEYOND * (upper - lower)
    lowest, highest = float(values.min()), float(values.max())
    far = lowest < lower - room or highest > upper + room
    return far and factor * lowest >= lower - room and factor * highest <= upper + room


def warn_of_degrees(body: Body | ParticleBody, path: ShapePath) -> None:
    """Warn where the angles of a path, its columns in the order of the body's joints, resemble degrees.

    Warns if a joint goes more than half a turn beyond its limits, and in degrees all would stay within theirs. The
    unit of a recording is checked when it is read.
    """
    if path.record is not None or _farthest(path) <= _HALF_TURN:
        return
    times = _looked_at(path)
    shapes, _ = path.curve(times)
    limited = np.isfinite(body.joint_limits).all(axis=1) & (np.array(body.joint_units) == "rad")
    beyond = np.maximum(body.joint_limits[:, 0] - shapes, shapes - body.joint_limits[:, 1])
    far = [k for k in np.flatnonzero(limited) if beyond[:, k].max() > _HALF_TURN]
    if not far or not all(looks_like(shapes[:, k], DEGREE, *body.joint_limits[k]) for k in far):
        return
    worst = max(far, key=lambda k: float(beyond[:, k].max()))
    row = int(np.argmax(beyond[:, worst]))
    lower, upper = body.joint_limits[worst]
    warnings.warn(
        f"joint {body.joint_names[worst]} of {body.name} is at {shapes[row, worst]:.6g} rad at {times[row]:.6g} s, far "
        f"beyond its limits {lower:.4g} to {upper:.4g} rad, and within them in degrees: are the angles of this path in "
        "degrees? A ShapePath is in radians: np.radians(angles) makes them. If radians are meant, nothing is wrong",
        TrajectoryWarning,
        stacklevel=4,
    )


def _farthest(path: ShapePath) -> float:
    """A bound of the joint coordinates, without looking at a spline or a series in time [rad or m]."""
    if isinstance(path.curve, Fourier):
        curve = path.curve
        sizes = np.abs(curve.mean) + np.abs(curve.cosines).sum(axis=1) + np.abs(curve.sines).sum(axis=1)
    elif isinstance(path.curve, PiecewisePolynomial):
        sizes = np.abs(path.curve.coefficients[0])
    else:
        sizes = np.abs(path.curve(_looked_at(path))[0])
    return float(sizes.max(initial=0.0))


def _looked_at(path: ShapePath) -> Array:
    if isinstance(path.curve, PiecewisePolynomial):
        return path.breaks
    if path.swings.most is not None:
        return evenly_divided(panel_edges(path), _LOOKS_OF_A_SWING)
    return path.duration / path.loops * np.mod(0.6180339887498949 * np.arange(_LOOKS), 1.0)
