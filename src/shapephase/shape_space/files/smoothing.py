"""Smooth paths through noisy samples: the least wiggly spline that stays as far from them as the noise is large."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...arrays import Array
from ...errors import TrajectoryError
from ..curves import PiecewisePolynomial
from ..shape_path import ShapePath
from ._recording import warn

_FEWEST = 5
"""Samples; four determine a cubic, so that nothing could be smoothed."""
_WIDEST_GAP = 5.0 * np.sqrt(2.0)
"""Largest gap of a loop in noise levels: five standard deviations of the difference of two samples."""
_OFF = 0.01
"""Share by which the residual may exceed the noise level: what FITPACK's search for the smoothness leaves."""
_EXACT = 1e-9
"""Noise below this share of the samples' spread counts as none: the samples are interpolated."""
_ANY = 1e3
"""Noise above this many times the spread is cut to it: a single cubic is within either, and its square is finite."""


def smoothed_path(
    times: Array, shapes: Array, noise: Array, periodic: bool | None, joint_names: Sequence[str]
) -> tuple[ShapePath, Array]:
    """A C2 cubic spline near samples whose noise is known, and how far it is from them.

    Of each joint, the smoothest cubic spline whose samples are off by the noise level, rms (the discrepancy
    principle; SciPy's `splrep`, FITPACK, keeps to it within a thousandth, as a rule, and a hundredth at most), or by
    less where a single cubic is that near already. The knots of all joints together are the breaks. A noise of zero
    is interpolation.

    A periodic spline runs smoothly from its end to its start, and its ends are equal. The first and the last sample
    are then two measurements of one shape: their mean is used, with the weight of both.

    Parameters
    ----------
    times : (N,) ascending from 0 [s]
    shapes : (N, n) [rad or m]
    noise : (n,) rms [rad or m]
    periodic : None: periodic when the last sample equals the first to 1e-9
    joint_names : n names

    Returns
    -------
    path, residual : the residual (n,) is the rms of samples minus path [rad or m]

    Raises
    ------
    TrajectoryError
        If there are fewer than five samples, a periodic path does not close within the noise, or no joint moves more
        than its noise.

    Warns
    -----
    TrajectoryWarning
        For a joint that moves no more than its noise.

    Notes
    -----
    Source: Reinsch 1967 (the principle); Dierckx 1993, Curve and Surface Fitting with Splines (the algorithm).
    """
    if not noise.any():
        plain = ShapePath.spline(times, shapes, periodic, joint_names=joint_names)
        return plain, _residual(plain, times, shapes)
    if len(times) < _FEWEST:
        raise TrajectoryError(f"smoothing needs {_FEWEST} samples or more, got {len(times)}")
    gap = shapes[-1] - shapes[0]
    loop = bool(np.all(np.abs(gap) <= 1e-9 * np.maximum(1.0, np.abs(shapes[0])))) if periodic is None else periodic
    if loop:
        _check_gap(gap, noise, joint_names)
    _check_signal(shapes, noise, joint_names)
    splines = [_spline(times, shapes[:, j], float(noise[j]), loop, name) for j, name in enumerate(joint_names)]
    knots = np.unique(np.concatenate([times[[0, -1]], *(spline.t for spline in splines)]))
    knots = knots[(knots >= 0.0) & (knots <= times[-1])]
    coefficients = np.empty((4, len(knots) - 1, len(splines)))
    for power, divisor in enumerate((1.0, 1.0, 2.0, 6.0)):
        for j, spline in enumerate(splines):
            coefficients[power, :, j] = spline(knots[:-1], nu=power) / divisor
    curve = PiecewisePolynomial(knots, coefficients)
    path = ShapePath(curve, float(times[-1]), knots, shapes.shape[1], tuple(joint_names), 0.5)
    return path, _residual(path, times, shapes)


def _spline(times: Array, samples: Array, noise: float, loop: bool, name: str) -> Any:
    """SciPy's spline of one joint."""
    from scipy.interpolate import BSpline, make_interp_spline, splrep

    spread = float(_spread(samples))
    if noise <= _EXACT * spread:
        through = np.append(samples[:-1], samples[0]) if loop else samples
        return make_interp_spline(times, through, k=3, bc_type="periodic" if loop else "not-a-knot")
    # Scaled, so that metres and radians, large and small, are the same to the routine.
    middle, scale = float(samples.mean()), spread or 1.0
    values, weights = (samples - middle) / scale, np.ones(len(samples))
    squares = len(samples) * min(noise / scale, _ANY) ** 2
    if loop:
        # Two samples y -+ d/2 weigh like one y of weight sqrt(2), and are off by d^2/2 whatever the spline does.
        squares = max(squares - 0.5 * (values[-1] - values[0]) ** 2, 0.0)
        values[[0, -1]] = 0.5 * (values[0] + values[-1])
        weights[0] = np.sqrt(2.0)
    fitted: Any = splrep(times, values, weights, k=3, s=squares, per=int(loop), full_output=1, quiet=1)
    knots, numbers, _ = fitted[0]
    spline = BSpline(knots, numbers * scale + middle, 3)
    off = np.sqrt(np.mean((spline(times) - samples) ** 2))
    if off > (1.0 + _OFF) * noise:
        raise TrajectoryError(
            f"joint {name} could not be smoothed to {noise:.6g}: the spline stays {off:.6g} from the samples; state "
            "another noise level, or zero for interpolation"
        )
    return spline


def _check_gap(gap: Array, noise: Array, joint_names: Sequence[str]) -> None:
    wide = np.abs(gap) > np.maximum(_WIDEST_GAP * noise, 1e-9)
    if wide.any():
        joint = int(np.argmax(np.where(wide, np.abs(gap), 0.0)))
        raise TrajectoryError(
            f"a periodic path closes within the noise, and joint {joint_names[joint]} ends {gap[joint]:.6g} from its "
            f"start with a noise level of {noise[joint]:.6g}; cut the recording at a full cycle, or close it by drift"
        )


def _check_signal(shapes: Array, noise: Array, joint_names: Sequence[str]) -> None:
    spread = _spread(shapes)
    drowned = (noise >= spread) & (spread > 0.0)
    moves = noise < spread
    if drowned.any() and not moves.any():
        raise TrajectoryError(
            f"no joint moves more than its noise level (joint {joint_names[int(spread.argmax())]} most, by "
            f"{spread.max():.6g} rms); nothing of the motion would be left. The level is in rad or m"
        )
    for joint in map(int, np.flatnonzero(drowned)):
        warn(
            f"joint {joint_names[joint]} moves by {spread[joint]:.6g} rms about its mean, no more than the noise level "
            f"{noise[joint]:.6g}: little but its mean is left"
        )


def _spread(samples: Array) -> Array:
    """Rms about the mean, along the first axis; exactly zero where nothing moves."""
    return np.where(np.ptp(samples, axis=0) > 0.0, samples.std(axis=0), 0.0)


def _residual(path: ShapePath, times: Array, shapes: Array) -> Array:
    return np.sqrt(np.mean((shapes - path.shape(times)) ** 2, axis=0))
