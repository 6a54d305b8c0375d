"""Smooth paths through noisy samples: a quintic smoothing spline for each joint, linear in the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_flag, positive_argument
from ...arrays import FARTHEST, Array, Mask, finite_array
from ...body.body import Body
from ...display import frozen
from ...errors import ShapeError, TrajectoryError
from ...letters import value_text
from ..curves import CLOSED, PiecewisePolynomial
from ..interpolation import ball_columns, neighbours_signs
from ..linear_smoother import ORDER, PILOT_ORDER, LinearSmoother, LowPass, likeliest, width_of
from ..shape_path import ShapePath
from ._sample_origins import Prepared
from .recording import warn

_FEWEST = 5  # samples: fewer do not separate motion from noise
_WIDEST_GAP = 5.0 * np.sqrt(2.0)  # noise levels: five standard deviations of the difference of two samples
_REACH = 6.0  # widths: a sample farther away has a weight of exp(-6/2)/6 or less
_UNEVEN = 1e-3  # relative spread of even steps
_SHORTEST = 0.5  # length of an averaged unit quaternion: below, attitudes in reach are over 120 deg apart
_REACH_OF_FILTER = 0.7  # periods of the cut-off from an end: weights are within 4 % of the largest inside
_MEMORY_OF_FILTER = 6.0  # periods of the cut-off: a sample's weight is then exp(-33)
_EXACT = 1e-9  # relative to the samples' spread: less noise is none, and samples are interpolated
_MOST_SWING = 4.0 * FARTHEST  # [rad or m] between two samples: terms of its cubics are then right to 1e-9


@frozen
class Smoothing:
    """Effect of smoothing on recorded samples.

    noise : (n,) as stated, rms [rad or m]; zero where the path goes through the samples
    penalty : (n,) of the integral of squared third derivatives, beside the sum of squares of samples minus path [s^5]
    degrees_of_freedom : (n,) effective, of as many as there are samples, those before and after the path that were
        smoothed with it among them
    bias : (knots, n) what was taken off the motion itself at the knots, as far as it is known [rad or m]
    bias_in_bars : its rms, of the joint where it is largest beside what is left of the noise: in standard deviations
        of that; error bars hold both
    residual : (n,) rms of samples minus path [rad or m]
    low_pass : the filter that took the place of the spline, for which the noise is an estimate; None: a spline
    in_band : (n,) rms of what the filter of twice the cut-off would leave beside this one [rad or m]
    noise_in_band : (n,) what the noise alone leaves there
    ends : how long at the start and at the end of the path the filter lacks samples on one side [s]
    """

    noise: Array
    penalty: Array
    degrees_of_freedom: Array
    bias: Array
    bias_in_bars: float
    residual: Array
    low_pass: LowPass | None = None
    in_band: Array | None = None
    noise_in_band: Array | None = None
    ends: tuple[float, float] = (0.0, 0.0)

    def of_joints(self, kept: Mask) -> Smoothing:
        """What it did to some of the joints, True in (n,)."""
        by_joint = ("noise", "penalty", "degrees_of_freedom", "bias", "residual", "in_band", "noise_in_band")
        given = {name: getattr(self, name) for name in by_joint}
        return replace(self, **{name: value[..., kept] for name, value in given.items() if value is not None})

    def spline_record(self, joint_names: tuple[str, ...]) -> dict[str, Any]:
        """Penalties and bias of a smoothing spline, by joint, ready for JSON."""
        return {
            "penalty_s5": dict(zip(joint_names, self.penalty.tolist(), strict=True)),
            "degrees_of_freedom": dict(zip(joint_names, self.degrees_of_freedom.tolist(), strict=True)),
            "bias_rms": dict(zip(joint_names, np.sqrt(np.mean(self.bias**2, axis=0)).tolist(), strict=True)),
            "bias_in_bars": self.bias_in_bars,
        }

    def filter_record(self, joint_names: tuple[str, ...]) -> dict[str, Any]:
        """The low-pass filter, the noise it leaves and the motion it takes off, by joint, ready for JSON."""
        assert self.low_pass is not None
        assert self.in_band is not None
        assert self.noise_in_band is not None
        return {
            "cut_off_hz": self.low_pass.cut_off,
            "filter": "Butterworth, second order, forwards and backwards",
            "rate_hz": self.low_pass.rate,
            "noise": dict(zip(joint_names, self.noise.tolist(), strict=True)),
            "twice_the_cut_off_hz": self.low_pass.twice.cut_off,
            "rms_up_to_twice_the_cut_off": dict(zip(joint_names, self.in_band.tolist(), strict=True)),
            "of_that_by_noise": dict(zip(joint_names, self.noise_in_band.tolist(), strict=True)),
            "affected_at_ends_s": list(self.ends),
        }


def smoothed_path(
    times: ArrayLike,
    shapes: ArrayLike,
    noise: ArrayLike,
    periodic: bool | None = None,
    joint_names: Sequence[str] | None = None,
    *,
    penalty: float | None = None,
) -> tuple[ShapePath, Smoothing]:
    """Fit a C2 cubic spline near samples whose noise is known, and report what smoothing did to them.

    Its values at the samples' times are those of a quintic smoothing spline with natural ends, each joint with its own
    penalty. They are linear in the samples, so that error bars go through. A noise of zero is interpolation.

    The penalty is the likeliest one for the noise level. Its bias, above all at the ends, where the third derivative
    of such a spline is zero, follows from a spline of degree nine.

    A periodic spline runs smoothly from its end to its start, and its ends are equal. The first and the last sample
    are then two measurements of one shape: their mean is used, with the weight of both.

    Source: Reinsch 1967 (the spline); Wahba 1985 (the penalty); own derivation (the bias).

    Parameters
    ----------
    times : (N,) ascending; the path starts at 0 [s]
    shapes : (N, n) [rad or m]
    noise : rms of each sample's noise, one number or one for each joint (n,) [rad or m]
    periodic : None: periodic when the last sample equals the first to 1e-9
    joint_names : n names
    penalty : instead of those that follow from the noise [s^5]; what it does to the motion is known in any case

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
            f"noise: a number or {plain.n_shape} of them, zero or above, are needed, got {value_text(noise)}"
        )
    samples = Recorded(at, recorded, np.broadcast_to(levels, plain.n_shape), plain.joint_names)
    return prepared_path(samples, periodic=samples.meets if periodic is None else periodic, penalty=penalty)


@dataclass(frozen=True, eq=False)
class Recorded:
    """Samples of joints and their noise.

    times, shapes : (N,) ascending [s], (N, n) [rad or m]
    noise : (n,) rms [rad or m]
    inside : the samples that are kept; those before and after them are smoothed with them
    cut_off : of the low-pass filter that takes the place of a spline [Hz], or None
    """

    times: Array
    shapes: Array
    noise: Array
    joint_names: tuple[str, ...] | None
    inside: slice = field(default_factory=lambda: slice(None))
    cut_off: float | None = None

    @property
    def smoothed(self) -> bool:
        """True if the path is near the samples, and not through them."""
        return self.cut_off is not None or bool(self.noise.any())

    def around(self, margin: int = 0) -> Recorded:
        """The samples that are kept, with so many before and after them, or as many as there are, from the time 0."""
        first, past, _ = self.inside.indices(len(self.times))
        start = max(first - margin, 0)
        part = slice(start, min(past + margin, len(self.times)))
        times = self.times[part]
        inside = slice(first - start, past - start)
        return replace(self, times=times - times[0], shapes=self.shapes[part], inside=inside)

    @property
    def meets(self) -> bool:
        """True if the last sample is the first, to the accuracy of files, and another is between them."""
        shapes = self.shapes[self.inside]
        first, last = shapes[0], shapes[-1]
        return len(shapes) > 2 and bool(np.all(np.abs(last - first) <= CLOSED * np.maximum(1.0, np.abs(first))))


def prepared_path(
    recorded: Recorded,
    *,
    periodic: bool,
    penalty: float | None = None,
    turns: Array | None = None,
    drift: bool = False,
) -> tuple[ShapePath, Smoothing]:
    """The path near recorded samples, and what smoothing did; see `smoothed_path`.

    turns : (n,) whole turns that are taken off evenly before, and given back afterwards [rad]
    drift : True to take off the gap between last and first sample evenly
    """
    noise, whole_turns = recorded.noise, np.zeros(len(recorded.noise)) if turns is None else turns
    if recorded.cut_off is not None:
        return _filtered(recorded, recorded.cut_off, periodic, whole_turns, drift=drift)
    given = None if penalty is None else positive_argument(penalty, "smooth_penalty", "a penalty in s^5")
    if given is not None and not noise.any():
        raise TrajectoryError("smooth_penalty: state the noise of the samples too (smooth, --smooth)")
    kept = recorded.around()
    steps = _steps(kept, noise > 0.0, periodic, whole_turns, drift=drift)
    if noise.any():
        if len(kept.times) < _FEWEST:
            raise TrajectoryError(f"smoothing needs {_FEWEST} samples or more, got {len(kept.times)}")
        names = recorded.joint_names or tuple(f"number {joint}" for joint in range(len(noise)))
        if periodic and not drift:
            _check_gap(kept.shapes[-1] - kept.shapes[0] - whole_turns, noise, names)
        _check_signal(steps.joined(kept.shapes), noise, names)
    elif not drift and not whole_turns.any():
        plain = ShapePath.spline(kept.times, kept.shapes, periodic, joint_names=recorded.joint_names)
        return plain, _report(kept, steps, plain)
    samples, steps = _smoothed(recorded, given, periodic, whole_turns, drift=drift)
    path = steps.path(samples.shapes)
    return path, _report(samples, steps, path)


def low_pass(times: Array, cut_off: float) -> LowPass:
    """The filter of evenly spaced samples. Raises TrajectoryError for others, and for a cut-off beyond them."""
    rate = (len(times) - 1) / float(times[-1] - times[0])
    if len(times) < _FEWEST:
        raise TrajectoryError(f"lowpass: {_FEWEST} samples or more are needed, got {len(times)}; leave lowpass out")
    if not is_even(times):
        steps = np.diff(times)
        raise TrajectoryError(
            f"lowpass: samples are {steps.min():.6g} to {steps.max():.6g} s apart, and a filter needs even steps; give "
            f"resample={rate:.4g} (--resample {rate:.4g}), or smooth (--smooth) in place of lowpass"
        )
    if cut_off >= 0.5 * rate:
        raise TrajectoryError(
            f"lowpass: {rate:.6g} samples a second hold frequencies below {0.5 * rate:.6g} Hz, got a cut-off of "
            f"{cut_off:.6g} Hz; give a lower one, as lowpass={0.1 * rate:.2g} (--lowpass {0.1 * rate:.2g})"
        )
    return LowPass(cut_off, rate)


def is_even(times: Array) -> bool:
    """True if all steps are equal to a thousandth."""
    steps = np.diff(times)
    return bool(np.ptp(steps) <= _UNEVEN * steps.mean())


def filtered(times: Array, values: Array, cut_off: float) -> Array:
    """Values (N, k), filtered."""
    smoother = low_pass(times, cut_off).smoother(times - times[0], False, values.shape[1])
    return values[0] + smoother(values - values[0])


def filtered_attitudes(times: Array, attitudes: Array, cut_off: float) -> Array:
    """Attitudes (N, 3, 3), filtered as rotations.

    The mean rate of turn, fixed in space, is taken off, so that a constant one is not changed; the quaternions that
    are left are filtered, and made unit again. For a small wobble at the frequency f on a turn whose rate differs from
    the mean by w [rad/s], this leaves the mean of the shares h of the frequencies f - w/(4 pi) and f + w/(4 pi), and
    half of their difference turned by a right angle about the axis of w, both over the share of w/(4 pi).
    """
    steps = so3.log(attitudes[1:] @ so3.transpose(attitudes[:-1]))
    mean_turn = so3.exp((times - times[0])[:, None] * steps.sum(axis=0) / (times[-1] - times[0]))
    left = neighbours_signs(so3.quat_from_matrix(so3.transpose(mean_turn) @ attitudes), (slice(0, 4),))
    smooth = filtered(times, left, cut_off)
    _check_lengths(smooth, cut_off, "the base")
    return mean_turn @ so3.matrix_from_quat(so3.normalised(smooth))


def _check_lengths(quaternions: Array, cut_off: float, name: str) -> None:
    if np.linalg.norm(quaternions, axis=1).min() < _SHORTEST:
        raise TrajectoryError(
            f"lowpass: {name} turns too fast for a cut-off of {cut_off:.6g} Hz, which averages opposite attitudes; "
            "give a higher one (lowpass, --lowpass)"
        )


def _filtered(
    recorded: Recorded, cut_off: float, periodic: bool, turns: Array, *, drift: bool
) -> tuple[ShapePath, Smoothing]:
    """The path of filtered samples; its noise is estimated by what is above twice the cut-off."""
    rate = (len(recorded.times) - 1) / float(recorded.times[-1])
    samples = recorded.around(0 if periodic else int(np.ceil(_MEMORY_OF_FILTER * rate / cut_off)))
    columns, count = len(recorded.noise), len(samples.times)
    narrow = low_pass(samples.times, cut_off)
    smoother, wider = (each.smoother(samples.times, periodic, columns) for each in (narrow, narrow.twice))
    steps = _steps(samples, np.ones(columns, dtype=bool), periodic, turns, drift=drift)
    steps = replace(steps, smoother=smoother, pilot=None)
    first, *_ = joined = steps.joined(samples.shapes)
    values = joined - first
    by_narrow, by_wide = smoother(values), wider(values)
    for ball in ball_columns(recorded.joint_names):
        _check_lengths((first + by_narrow)[:, ball], cut_off, f"a ball joint (column {ball.start})")
    response, wide_response = narrow.responses(count), narrow.twice.responses(count)
    noise = np.sqrt(
        ((values - by_wide) ** 2).sum(axis=0) / max(((1.0 - wide_response) ** 2).sum(), np.finfo(float).tiny)
    )
    noise = np.where(noise > _EXACT * _spread(values), noise, 0.0)
    path = steps.path(samples.shapes)
    inside = samples.times[samples.inside]
    reach = 0.0 if periodic else _REACH_OF_FILTER / cut_off
    return path, replace(
        _report(replace(samples, noise=noise), steps, path),
        low_pass=narrow,
        in_band=np.sqrt(np.mean((by_wide - by_narrow) ** 2, axis=0)),
        noise_in_band=noise * np.sqrt(((wide_response - response) ** 2).sum() / count),
        ends=(max(reach - float(inside[0]), 0.0), max(reach - float(samples.times[-1] - inside[-1]), 0.0)),
    )


def _steps(samples: Recorded, smoothed: Mask, periodic: bool, turns: Array, *, drift: bool) -> Prepared:
    """The steps from samples to a path, without penalties."""
    smoother = LinearSmoother(samples.times, periodic, np.where(smoothed, np.inf, 0.0))
    return Prepared(
        samples=samples.shapes,
        smoother=smoother,
        pilot=replace(smoother, order=PILOT_ORDER),
        inside=samples.inside,
        turns=turns,
        drift=drift,
        joint_names=samples.joint_names,
    )


def _smoothed(
    recorded: Recorded, given: float | None, periodic: bool, turns: Array, *, drift: bool
) -> tuple[Recorded, Prepared]:
    """Samples that are smoothed together, and the steps with the smoothers that follow from their noise."""
    samples = recorded.around()
    spread = _spread(_steps(samples, recorded.noise > 0.0, periodic, turns, drift=drift).joined(samples.shapes))
    noise = np.where(recorded.noise > _EXACT * spread, recorded.noise, 0.0)
    # The four numbers of a ball joint are smoothed alike.
    balls = [list(range(ball.start, ball.stop)) for ball in ball_columns(samples.joint_names)]
    groups = [*balls, *([column] for column in range(len(noise)) if not any(column in ball for ball in balls))]

    def smoother(part: Recorded, order: int = ORDER) -> LinearSmoother:
        values = _steps(part, noise > 0.0, periodic, turns, drift=drift).joined(part.shapes)
        if given is not None and order == ORDER:
            return LinearSmoother(part.times, periodic, np.where(noise > 0.0, given, 0.0))
        return likeliest(part.times, periodic, values, noise, groups, order)

    chosen = smoother(samples)
    if not periodic and noise.any():
        samples = recorded.around(int(np.ceil(_REACH * width_of(chosen))))
        chosen = smoother(samples) if len(samples.times) > chosen.count else chosen
    steps = _steps(samples, noise > 0.0, periodic, turns, drift=drift)
    return samples, replace(steps, smoother=chosen, pilot=smoother(samples, PILOT_ORDER))


def _report(samples: Recorded, steps: Prepared, path: ShapePath) -> Smoothing:
    smoother, kept = steps.smoother, samples.around()
    noise = np.where(steps.smoothed, samples.noise, 0.0)
    free = smoother.degrees_of_freedom()
    bias = steps.bias
    left = noise * np.sqrt(free / smoother.count)
    in_bars = np.divide(np.sqrt(np.mean(bias**2, axis=0)), left, out=np.zeros(len(noise)), where=left > 0.0)
    return Smoothing(
        noise=noise,
        penalty=smoother.penalties,
        degrees_of_freedom=free,
        bias=bias,
        bias_in_bars=float(in_bars.max(initial=0.0)),
        residual=np.sqrt(np.mean((kept.shapes - path.shape(kept.times)) ** 2, axis=0)),
    )


def _check_gap(gap: Array, noise: Array, joint_names: Sequence[str]) -> None:
    wide = np.abs(gap) > np.maximum(_WIDEST_GAP * noise, CLOSED)
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
    balls = ball_columns(joint_names)
    in_balls = {column for ball in balls for column in range(ball.start, ball.stop)}
    groups = [(str(joint_names[ball.start]).removesuffix(".x"), ball) for ball in balls]
    groups += [(name, slice(k, k + 1)) for k, name in enumerate(joint_names) if k not in in_balls]
    still = [f"{name} (by {spread[columns].max():.3g})" for name, columns in groups if drowned[columns].all()]
    if still:
        warn(
            f"motion that cannot be told from noise, in rad or m rms about the mean, of {len(still)} "
            f"joint{'s' * (len(still) > 1)}: {', '.join(still)}"
        )


def _spread(samples: Array) -> Array:
    """Rms about the mean, along the first axis; exactly zero where nothing moves."""
    return np.where(np.ptp(samples, axis=0) > 0.0, samples.std(axis=0), 0.0)


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
