"""Smooth paths through noisy samples: a smoothing spline of one penalty, linear in the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_flag, positive_argument
from ...arrays import Array, finite_array, lock_arrays
from ...display import short_repr
from ...errors import ShapeError, TrajectoryError
from ...letters import what_came
from ..curves import CLOSED
from ..shape_path import ShapePath
from ._linear_smoother import LinearSmoother, pilot
from ._recording import warn
from ._sample_origins import Prepared

_FEWEST = 5
"""Samples; of fewer, what is motion and what is noise cannot be told apart."""
_WIDEST_GAP = 5.0 * np.sqrt(2.0)
"""Largest gap of a loop in noise levels: five standard deviations of the difference of two samples."""
_BIAS = 0.2
"""Of what smoothing does to the motion, in standard deviations of what noise does: it widens no bar by more than
a fiftieth."""
_EXACT = 1e-9
"""Noise below this share of the samples' spread counts as none: the samples are interpolated."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What smoothing did to recorded samples.

    Attributes
    ----------
    noise : (n,) as stated, rms [rad or m]; zero where the path goes through the samples
    penalty : of the integral of squared second derivatives, beside the sum of squares of samples minus path [s^3]
    degrees_of_freedom : effective, of each joint that is smoothed, of as many as it has samples
    bias : (knots, n) what was taken off the motion itself at the knots, as far as it is known [rad or m]
    bias_in_bars : bias of a number that follows linearly from the path, at most, whichever it is: in standard
        deviations of what the noise does to it
    residual : (n,) rms of samples minus path [rad or m]
    """

    noise: Array
    penalty: float
    degrees_of_freedom: float
    bias: Array
    bias_in_bars: float
    residual: Array

    __repr__ = short_repr

    __post_init__ = lock_arrays


def smoothed_path(
    times: ArrayLike,
    shapes: ArrayLike,
    noise: ArrayLike,
    periodic: bool | None = None,
    joint_names: Sequence[str] | None = None,
    *,
    penalty: float | None = None,
) -> tuple[ShapePath, Smoothing]:
    """A C2 cubic spline near samples whose noise is known, and what smoothing did to them.

    Its values at the samples' times are those of a smoothing spline, with one penalty for all joints. They are linear
    in the samples, so that error bars go through. A noise of zero is interpolation.

    The penalty follows from the noise level: first the one of least expected error (Mallows' C_p), whose bias may be
    as large as the bars; then less, by as much as it takes for a bias under a fifth of the bar of any number that
    follows linearly from the path. How large it is follows from the samples smoothed twice by the first penalty.

    A periodic spline runs smoothly from its end to its start, and its ends are equal. The first and the last sample
    are then two measurements of one shape: their mean is used, with the weight of both.

    Parameters
    ----------
    times : (N,) ascending; the path starts at 0 [s]
    shapes : (N, n) [rad or m]
    noise : rms of each sample's noise, one or one for each joint (n,) [rad or m]
    periodic : None: periodic when the last sample equals the first to 1e-9
    joint_names : n names
    penalty : instead of the one that follows from the noise [s^3]; what it does to the motion is told in any case

    Raises
    ------
    TrajectoryError
        If there are fewer than five samples, a periodic path does not close within the noise, or no joint moves more
        than its noise.
    ShapeError
        If shapes disagree.

    Warns
    -----
    TrajectoryWarning
        For a joint that moves no more than its noise.

    Notes
    -----
    Source: Reinsch 1967 (the spline); Mallows 1973 (C_p); own derivation (the bias).

    Examples
    --------
    >>> times = np.linspace(0.0, 1.0, 41)
    >>> noisy = np.sin(2.0 * np.pi * times)[:, None] + 0.01 * np.cos(40.0 * times)[:, None]
    >>> path, told = sp.shape_space.files.smoothed_path(times, noisy, 0.01)
    >>> print(path.duration, told.residual.shape)
    1.0 (1,)
    """
    check_flag(periodic, "periodic", allow_none=True)
    plain = ShapePath.spline(times, shapes, False, joint_names=joint_names)
    at, recorded = plain.breaks, np.array(finite_array(shapes, "shapes"))
    levels = finite_array(noise, "noise")
    if levels.shape not in ((), (plain.n_shape,)) or np.any(levels < 0.0):
        raise ShapeError(
            f"noise: a number or {plain.n_shape} of them, zero or above, are needed, got {what_came(noise)}"
        )
    samples = Recorded(at, recorded, np.broadcast_to(levels, plain.n_shape), plain.joint_names)
    return prepared_path(samples, periodic=samples.meets if periodic is None else periodic, penalty=penalty)


@dataclass(frozen=True, eq=False)
class Recorded:
    """Samples of joints and what is known of their noise.

    Attributes
    ----------
    times, shapes : (N,) ascending from 0 [s], (N, n) [rad or m]
    noise : (n,) rms [rad or m]
    joint_names : n names, or None
    """

    times: Array
    shapes: Array
    noise: Array
    joint_names: tuple[str, ...] | None

    @property
    def meets(self) -> bool:
        """Whether the last sample is the first, as far as files can say, and another is between them."""
        first, last = self.shapes[0], self.shapes[-1]
        return len(self.times) > 2 and bool(np.all(np.abs(last - first) <= CLOSED * np.maximum(1.0, np.abs(first))))


def prepared_path(
    recorded: Recorded,
    *,
    periodic: bool,
    penalty: float | None = None,
    turns: Array | None = None,
    drift: bool = False,
) -> tuple[ShapePath, Smoothing]:
    """The path near recorded samples, as `smoothed_path`.

    Parameters
    ----------
    turns : (n,) whole turns that are taken off evenly before, and given back afterwards [rad]
    drift : whether the gap between last and first sample is taken off evenly
    """
    times, noise = recorded.times, recorded.noise
    given = None if penalty is None else positive_argument(penalty, "smooth_penalty", "a penalty in s^3")
    if given is not None and not noise.any():
        raise TrajectoryError("smooth_penalty: state the noise of the samples too (smooth, --smooth)")
    steps = Prepared(
        samples=recorded.shapes,
        bias=np.zeros((len(times) - periodic, len(noise))),
        smoother=LinearSmoother(times, periodic, 0.0),
        smoothed=np.zeros(len(noise), dtype=bool),
        turns=np.zeros(len(noise)) if turns is None else turns,
        drift=drift,
        joint_names=recorded.joint_names,
    )
    if noise.any():
        if len(times) < _FEWEST:
            raise TrajectoryError(f"smoothing needs {_FEWEST} samples or more, got {len(times)}")
        names = recorded.joint_names or tuple(f"number {joint}" for joint in range(len(noise)))
        if periodic and not drift:
            _check_gap(recorded.shapes[-1] - recorded.shapes[0] - steps.turns, noise, names)
        _check_signal(steps.joined(recorded.shapes), noise, names)
    elif not drift and not steps.turns.any():
        plain = ShapePath.spline(times, recorded.shapes, periodic, joint_names=recorded.joint_names)
        return plain, _report(recorded, steps, plain, 0.0)
    steps, in_bars = _smoothed(steps, noise, given)
    path = steps.path(recorded.shapes)
    return path, _report(recorded, steps, path, in_bars)


def _smoothed(steps: Prepared, noise: Array, given: float | None) -> tuple[Prepared, float]:
    """The steps with the smoother that the noise asks for, and the largest bias in bars."""
    spread = _spread(steps.joined(steps.samples))
    steps = replace(steps, smoothed=noise > _EXACT * spread)
    moving = steps.smoothed & (spread > 0.0)
    if not moving.any():
        return steps, 0.0
    values = steps.joined(steps.samples)
    smoother = steps.smoother
    first = pilot(smoother.times, smoother.periodic, values[:, moving] - values[0, moving], noise[moving])
    # Of the number that shows it most; it grows with the penalty.
    weighted = np.sqrt(smoother.weights)[:, None] * first.taken_off / noise[moving]
    in_bars = float(np.linalg.norm(weighted))
    most = first.smoother.penalty
    penalty = most * min(1.0, _BIAS / in_bars if in_bars else 1.0) if given is None else given
    chosen = replace(first.smoother, penalty=penalty)
    bias = np.zeros_like(values)
    bias[:, moving] = chosen(first.motion) - first.motion
    return replace(steps, smoother=chosen, bias=bias), in_bars * penalty / most


def _report(recorded: Recorded, steps: Prepared, path: ShapePath, in_bars: float) -> Smoothing:
    smoother = steps.smoother
    return Smoothing(
        noise=np.where(steps.smoothed, recorded.noise, 0.0),
        penalty=smoother.penalty,
        degrees_of_freedom=smoother.degrees_of_freedom if smoother.penalty else float(smoother.count),
        bias=steps.bias,
        bias_in_bars=in_bars,
        residual=np.sqrt(np.mean((recorded.shapes - path.shape(recorded.times)) ** 2, axis=0)),
    )


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
            f"{noise[joint]:.6g} (both in rad or m): of what it does, little is sure"
        )


def _spread(samples: Array) -> Array:
    """Rms about the mean, along the first axis; exactly zero where nothing moves."""
    return np.where(np.ptp(samples, axis=0) > 0.0, samples.std(axis=0), 0.0)
