"""The momentum of a recorded flight, from attitudes and rates of its base."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_flag, check_object, number_argument, times_argument
from ..arrays import Array, copied_when_read, finite_array
from ..deformation.deformation import Deformation
from ..display import frozen
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError, TrajectoryWarning
from ..reconstruction.reconstruction import Motion
from ..reconstruction.recorded_base import INVERSE, W_FIRST, read_w_first
from ..shape_space.path_samples import PathSamples, path_samples
from ._along_motion import legendre
from ._flight_fit import UNKNOWNS, Fitted, FlightFit, check_near, flight_fitted, from_few, size
from ._joint_noise import carried_by_knots, sample_covariance
from ._residual_noise import drift_modes, held, independent, residual_noise
from .result_derivatives import deformation_parts, fit_by_knots

_VAGUE_BIAS = 0.1  # of the rates: a bias that is less certain is not fitted to rates alone
_WEIGHINGS = 3  # of attitudes against rates: the third changes their noise by less than 1e-3
_RIGHT = 0.5  # of what is left in another reading: in the right unit, order or direction it was less than a quarter
_ROUNDED = 10.0  # tolerances of the reconstruction: smaller residuals are rounding
_CONSTANT = 0.01  # of the momentum and of the internal momentum: a smaller change is not reported


@copied_when_read("initial_attitude", "base_axes")
@frozen
class RecordedMomentum:
    """The momentum and start with which a body comes nearest to the attitudes and rates that were recorded.

    Made by `momentum_from_recording`.

    Attributes
    ----------
    momentum : (3,) about the centre of mass, the recorder's axes [kg m^2/s]
    initial_attitude : (3, 3), base axes to the recorder's
    momentum_covariance : (3, 3) [(kg m^2/s)^2], as `uncertainty` takes it
    attitude_covariance : (3, 3) of the turn of the start, base axes [rad^2], as `uncertainty` takes it
    covariance : (6, 6) of both, the turn of the start first, as `uncertainty` takes it: by the noise of the recorded
        base, and by that of the joints if the fit was given it; else, with this noise, it is
        `uncertainty(fit.motion, start=fit, joints=...).start`
    covariance_by_base : (6, 6) the part of it by the noise of the recorded base, with its correlation in time, and by a
        momentum that changes
    by_attitudes : (6, 3 N) their change by turns of the attitudes, base axes, those of the rates that follow included
    noise : of each component of a recorded attitude, given or as the fit leaves it [rad]
    noise_correlation : of the noise of neighbouring attitudes, as the fit leaves it: 0 for white noise
    widening : by which this correlation makes the bars of the momentum longer than white noise does, at most
    momenta : (N, 3) the momentum at each time, the recorder's axes [kg m^2/s]: constant where the residuals are noise,
        else as it probably changes, which the bars hold
    conserved : whether the momentum is constant, as far as the residuals show: to a hundredth of itself and of what
        the joints carry, or within what chance brings in one of 1000 recordings
    residuals : (N, 3) from reconstructed to recorded attitudes, rotation vectors in base axes [rad]
    motion : the one that was fitted
    times : (N,) of the recorded attitudes [s]
    base_axes : (3, 3) base axes to those whose attitude was recorded; the identity where these were the base's
    axes_covariance : (3, 3) of their turn, base axes [rad^2]; zero where they were given
    by_rates : (6, 3 N) change of start and momentum by the recorded rates, base axes; zero without rates
    rate_noise : of each component of a recorded rate, given or as the fit leaves it [rad/s]; 0 without rates
    rate_residuals : (N, 3) from reconstructed to recorded rates less their bias, base axes [rad/s]; (0, 3) without
    bias : (3,) constant part of the recorded rates that is not motion, base axes [rad/s]; zero where it is not fitted
    bias_covariance : (3, 3) [rad^2/s^2]; None where the bias is not fitted, and taken for zero
    """

    momentum: Array
    initial_attitude: Array
    momentum_covariance: Array
    attitude_covariance: Array
    covariance: Array
    covariance_by_base: Array
    by_attitudes: Array
    noise: float
    noise_correlation: float
    widening: float
    residuals: Array
    momenta: Array
    conserved: bool
    motion: Motion
    times: Array
    base_axes: Array
    axes_covariance: Array
    by_rates: Array
    rate_noise: float
    rate_residuals: Array
    bias: Array
    bias_covariance: Array | None

    @property
    def angles(self) -> Array:
        """Angles from reconstructed to recorded attitudes: (N,) [rad]."""
        return np.linalg.norm(self.residuals, axis=1)


def momentum_from_recording(
    deformation: Deformation,
    times: ArrayLike,
    attitudes: ArrayLike | None = None,
    *,
    rates: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    noise: float | None = None,
    rate_noise: float | None = None,
    find_bias: bool | None = None,
    joints: ArrayLike | str | None = None,
    tolerance: float = 1e-8,
    find_axes: bool = False,
) -> RecordedMomentum:
    """Fit the angular momentum of a flight to recorded attitudes and rates of the base, by reconstructing all of it.

    Nothing that was recorded is differentiated: the six numbers of momentum and initial attitude are those whose
    reconstruction is nearest to all attitudes and rates in the sense of least squares, with the covariance that
    follows. Rates alone leave the attitude at the start open: it is given, without an error.

    Parameters
    ----------
    deformation : how the body changes its shape meanwhile
    times : (N,) within it, ascending, three or more [s]
    attitudes : (N, 3, 3), base axes to the recorder's; nearer to each other than half a turn; None: rates alone
    rates : (N, 3) angular velocity of the base, base axes [rad/s], as a gyro measures it; None: attitudes alone
    attitude : (3, 3) of the start, for rates alone; None: the identity
    noise : standard deviation of each component of a recorded attitude [rad]; None: what the fit leaves, which holds
        what noise of the joints turns the reconstruction by, too. Bars are never shorter than what the fit leaves says
    rate_noise : standard deviation of each component of a recorded rate [rad/s]; None: what the fit leaves
    find_bias : True to fit a constant bias of the rates, False to take it for zero; None: it is fitted beside
        attitudes, and to rates alone where these determine it to a tenth of themselves
    joints : noise of the samples that the path of the joints is made of, as for `uncertainty`: what it turns the
        reconstruction by grows in time, and is not taken for a momentum that changes; None: none is known
    tolerance : of the reconstruction [rad]
    find_axes : whether the attitudes are those of axes that are fixed to the base in an unknown way, which is fitted
        too: from the way on with which the momentum, roughly, stays most constant

    Raises
    ------
    ShapeError
        If the shapes disagree; for rates beside axes to be found, and arguments without what they belong to.
    WrongObjectError
        With `joints`, if the deformation is not of an articulated body along a path through samples.
    TrajectoryError
        If there are fewer than three times, or they do not ascend; or if the attitudes are a flight only once their
        quaternions are read with w first, or as their inverse, or the rates once they are read in deg/s; or if by the
        rates the base turns over half a turn from one time to the next.
    AccuracyNotReached
        If the fit does not settle: the recording is not a free flight of this body, or too coarse; or if it does not
        determine the axes, or the bias that is to be found.

    Warns
    -----
    TrajectoryWarning
        If the momentum changes: what is left over of the recording is not noise. Bars then hold the momentum at every
        time.

    Notes
    -----
    Noise that is correlated in time, as trackers and filters leave it, makes the bars longer, by an autoregressive
    process whose correlation is not known either. Equations :eq:`moved-fit` and :eq:`drift-of-joints` of the
    documentation.
    Source: theory.md section 8 (the response of the attitude to start and momentum).

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion, times = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), np.linspace(0.0, 1.0, 9)
    >>> result = sp.momentum_from_recording(motion.deformation, times, motion.attitude(times))
    >>> print(result.momentum.round(6) + 0.0)
    [0.    0.    0.005]
    >>> by_gyro = sp.momentum_from_recording(motion.deformation, times, rates=motion.angular_velocity(times))
    >>> print(by_gyro.momentum.round(6) + 0.0)
    [0.    0.    0.005]
    """
    check_flag(find_axes, "find_axes")
    check_flag(find_bias, "find_bias", allow_none=True)
    check_object(deformation, "Deformation", "deformation")
    at = times_argument(finite_array(times, "times", (None,), unit="s"), deformation.duration)
    if attitudes is None and rates is None:
        raise ShapeError(
            "attitudes or rates: a momentum is fitted to recorded attitudes, rates or both; none are given"
        )
    recorded = None if attitudes is None else so3.rotation_argument(attitudes, "attitudes")
    if at.ndim != 1 or (recorded is not None and recorded.shape != (len(at), 3, 3)):
        got = () if recorded is None else recorded.shape
        raise ShapeError(f"attitudes: ({at.size}, 3, 3), one for each time, are needed, got {got}")
    if len(at) < 3 or np.any(np.diff(at) <= 0.0):
        raise TrajectoryError("times: three or more that ascend are needed to fit a momentum")
    measured = None if rates is None else finite_array(rates, "rates", (len(at), 3), unit="rad/s")
    if measured is not None:
        if measured.ndim > 2:
            raise ShapeError(f"rates: ({len(at)}, 3), one for each time, are needed, got {measured.shape}")
        _check_speed(at, measured)
    _check_choices(recorded, measured, noise, rate_noise, attitude, find_bias=find_bias, find_axes=find_axes)
    joint_noise = None
    if joints is not None:
        body, path, _, wheels = deformation_parts(deformation)
        joint_noise = sample_covariance(body, path, wheels, joints)
    least = FlightFit(deformation, at, recorded, tolerance)
    if recorded is None:
        assert measured is not None
        start = np.eye(3) if attitude is None else so3.rotation_argument(attitude, "attitude")
        if start.shape != (3, 3):
            raise ShapeError(f"attitude: one (3, 3) at the start is needed, got {start.shape}")
        least = replace(least, rates=measured, weight=1.0 / (size(measured) or 1.0), start=start)
        least, fit = _fitted_to_rates(least, find_bias)
    else:
        fit = _fitted_to_attitudes(least, find_axes=find_axes)
        least = replace(least, find_axes=find_axes)
        if measured is not None:
            least, fit = _weighed(replace(least, find_bias=find_bias is not False), fit, measured, noise, rate_noise)
    result = _estimated(least, fit, noise, rate_noise, joint_noise)
    if measured is None and not find_axes:
        _check_readings(least, _RIGHT * size(fit.residuals))
    if not result.conserved:
        warn_of_drift(result)
    return result


def _check_speed(times: Array, rates: Array) -> None:
    """Raise TrajectoryError for rates by which a body turns too far from one sample to the next."""
    turn = float(np.median(np.abs(rates[1:]).max(axis=1) * np.diff(times)))
    if turn > np.pi:
        raise TrajectoryError(
            f"rates: by them the base turns {turn:.3g} rad from one sample to the next, over half a turn; give samples "
            "that are closer, or the unit, if it is not rad/s: numpy.radians(rates) (--names 'COLUMN=COLUMN [deg/s]')"
        )


def _check_choices(
    recorded: Array | None,
    rates: Array | None,
    noise: float | None,
    rate_noise: float | None,
    attitude: ArrayLike | None,
    *,
    find_bias: bool | None,
    find_axes: bool,
) -> None:
    """Raise ShapeError for levels of noise that are none, and for choices without the data that they belong to."""
    for name, level, unit in (("noise", noise, "rad"), ("rate_noise", rate_noise, "rad/s")):
        if level is not None and not number_argument(level, name, unit) > 0.0:
            raise ShapeError(f"{name}: a positive standard deviation is needed, got {level}")
    if recorded is None and (noise is not None or find_axes):
        raise ShapeError("noise and find_axes are for recorded attitudes, and there are rates alone; leave them out")
    if recorded is not None and attitude is not None:
        raise ShapeError("attitude: that at the start is fitted to the recorded ones; leave it out")
    if rates is None and (rate_noise is not None or find_bias):
        raise ShapeError("rate_noise and find_bias are for recorded rates, and there are none; leave them out")
    if rates is not None and find_axes:
        raise ShapeError(
            "rates are those about the axes of the base, which are to be found: leave the rates out (--names COLUMN=), "
            "or give the axes: base_axes (--base-axes)"
        )


def _fitted_to_attitudes(least: FlightFit, *, find_axes: bool) -> Fitted:
    """The nearest flight to attitudes. Raises TrajectoryError where it is one in another reading of theirs."""
    assert least.recorded is not None
    try:
        return flight_fitted(least, find_axes=find_axes)
    except AccuracyNotReached as error:
        # Axes that are to be found leave the order of the quaternions open.
        if not find_axes:
            _check_readings(least, np.inf, error)
        raise


def _check_readings(least: FlightFit, off: float, cause: Exception | None = None) -> None:
    """Raise TrajectoryError where attitudes are nearer to a flight with w first, or as their inverse.

    off : rms angle that is too large beside that of such a flight [rad]; infinite where no other is near
    """
    assert least.recorded is not None
    usual = least.wander()
    for other, words in ((read_w_first, W_FIRST), (so3.transpose, INVERSE)):
        reading = replace(least, recorded=other(least.recorded))
        if cause is None and reading.wander() > _RIGHT * usual:
            continue
        with suppress(AccuracyNotReached):
            if size(flight_fitted(reading, find_axes=False).residuals) < off:
                raise TrajectoryError(f"the recorded base is no flight of this body; {words}") from cause


def _fitted_to_rates(least: FlightFit, find_bias: bool | None) -> tuple[FlightFit, Fitted]:
    """The nearest flight to rates alone, and what was fitted: with a bias where they determine it."""
    assert least.rates is not None
    fit, failure = None, None
    try:
        fit = from_few(least, np.eye(3))
        check_near(fit.residuals, least)
    except AccuracyNotReached as error:
        failure = error
    off = 1.0 if fit is None else size(fit.residuals)
    if off > _ROUNDED * least.tolerance:
        in_degrees = replace(least, rates=np.radians(least.rates), weight=np.degrees(least.weight))
        with suppress(AccuracyNotReached, np.linalg.LinAlgError):
            if size(from_few(in_degrees, np.eye(3)).residuals) < _RIGHT * off:
                raise TrajectoryError(
                    "the recorded rates are no flight of this body; read in deg/s they are: give their unit, "
                    "numpy.radians(rates) (--names 'COLUMN=COLUMN [deg/s]')"
                ) from failure
    if fit is None or failure is not None:
        assert failure is not None
        raise failure
    if find_bias is False:
        return least, fit
    biased = replace(least, find_bias=True)
    with suppress(AccuracyNotReached, np.linalg.LinAlgError):
        with_bias = biased.settled(fit.state)
        if not biased.leaves_open(with_bias, _VAGUE_BIAS):
            return biased, with_bias
    if find_bias:
        raise AccuracyNotReached(
            "the rates leave their bias open: this flight turns too evenly, or too short; give attitudes beside them, "
            "or take the bias for zero: find_bias=False"
        )
    return least, fit


def _weighed(
    least: FlightFit, near: Fitted, rates: Array, noise: float | None, rate_noise: float | None
) -> tuple[FlightFit, Fitted]:
    """The nearest flight to attitudes and rates, each weighed by its noise, given or as the fit leaves it."""
    fit, count = near, 3 * len(least.times)
    off = rates - near.motion.angular_velocity(least.times)
    bias = off.mean(axis=0) if least.find_bias else np.zeros(3)
    fit = near._replace(state=near.state._replace(bias=bias))
    own, others = (
        _left(near.residuals.ravel(), near.slopes, _inverse(near.slopes)),
        size(off - bias) / np.sqrt(3.0),
    )
    for _ in range(_WEIGHINGS):
        levels = noise or max(own, least.tolerance), rate_noise or max(others, least.tolerance)
        least = replace(least, rates=rates, weight=levels[0] / levels[1])
        fit = least.settled(fit.state)
        estimator, rows = _inverse(fit.slopes), fit.residuals.ravel()
        own, others = (
            _left(rows[part], fit.slopes[part], estimator[:, part]) for part in (slice(0, count), slice(count, None))
        )
        others /= least.weight
    return least, fit


def _inverse(slopes: Array) -> Array:
    """Parameters by residuals, in the sense of least squares: (n, m) -> (m, n)."""
    return np.asarray(np.linalg.pinv(slopes), dtype=np.float64)


def _left(residuals: Array, slopes: Array, estimator: Array) -> float:
    """Standard deviation of residuals (n,) by what a fit with these slopes (n, m) leaves of noise."""
    return float(np.sqrt((residuals**2).sum() / max(len(residuals) - np.einsum("am,ma->", slopes, estimator), 1.0)))


def _estimated(
    least: FlightFit, fit: Fitted, noise: float | None, rate_noise: float | None, joint_noise: Array | None
) -> RecordedMomentum:
    """The fit with the noise and the change of the momentum that its residuals show."""
    motion, times, tolerance = fit.state.motion, least.times, least.tolerance
    estimator = _inverse(fit.slopes)
    count, blocks = len(times), len(fit.residuals) // len(times)
    # The first of the recorded quantities shows whether the momentum changes.
    residuals, slopes = fit.residuals[:count], fit.slopes[: 3 * count]
    slopes = slopes[:, slopes.any(axis=0)]  # a bias of rates moves no attitude
    modes, sure, by_modes = 0, False, np.empty((residuals.size, 0))
    # Residuals near the tolerance of the reconstruction are rounding.
    if size(residuals) > _ROUNDED * tolerance:
        by_modes = least.slopes_by_modes(motion)
        by_joints = np.zeros((residuals.size, 0))
        if joint_noise is not None:
            by_joints = _carried_noise(least, motion, independent(np.hstack([slopes, by_modes])), joint_noise)
        modes, sure = drift_modes(residuals, slopes, by_modes, by_joints)
    covariance = np.zeros((len(estimator), len(estimator)))
    white_covariance = covariance.copy()
    stated_covariance = covariance.copy()
    lefts, seen = [], []
    for block in range(blocks):
        rows = slice(3 * count * block, 3 * count * (block + 1))
        own, part = fit.slopes[rows], estimator[:, rows]
        parameters = np.hstack([slopes, by_modes[:, : 3 * modes]]) if block == 0 else independent(own)
        left = residual_noise(fit.residuals[count * block : count * (block + 1)], parameters)
        white = part @ part.T
        covariance += left.covariance(part)
        white_covariance += left.weights @ left.variances * white
        seen.append(_left(fit.residuals.ravel()[rows], own, part))
        stated = noise if block == 0 and least.recorded is not None else rate_noise
        stated = None if stated is None else stated * (least.weight if least.recorded is None or block else 1.0)
        if stated is not None:
            stated_covariance += max(stated**2 - seen[-1] ** 2, 0.0) * white
        lefts.append(left)
    fixed = 3 if least.recorded is None else 0  # unknowns of the start, which is given
    own = slice(3 - fixed, UNKNOWNS - fixed)
    widening = float(np.sqrt((np.diag(covariance) / np.diag(white_covariance))[own].max()))
    covariance += stated_covariance
    momenta, conserved = np.tile(motion.momentum, (count, 1)), True
    if modes:
        left = lefts[0]
        seen[0] = float(np.sqrt(left.weights @ left.variances))
        changes = (left.weights @ left.parameters).reshape(-1, 3)[[1 - fixed // 3, *range(-modes, 0)]]
        deviations = legendre(times, times, modes) @ changes
        covariance[own, own] += held(deviations)
        momenta = momenta + deviations
        _, carried = motion.deformation.description.sample(times)
        turning = np.linalg.norm(motion.momentum) + np.sqrt((carried**2).sum(axis=1).mean())
        conserved = not sure or bool(np.linalg.norm(deviations, axis=1).max() <= _CONSTANT * turning)
    covariance = np.pad(covariance, ((fixed, 0), (fixed, 0)))
    by_attitudes, by_rates = _by_recorded(least, motion, np.pad(estimator, ((fixed, 0), (0, 0)))[:UNKNOWNS])
    extra, by_base = covariance[UNKNOWNS:, UNKNOWNS:], covariance[:UNKNOWNS, :UNKNOWNS]
    whole = by_base
    if joint_noise is not None:
        by_knots = fit_by_knots(motion, times, by_attitudes, by_rates)
        whole = by_base + carried_by_knots(_samples(motion), by_knots, joint_noise)
    return RecordedMomentum(
        momentum=motion.momentum,
        initial_attitude=motion.initial_attitude,
        momentum_covariance=whole[3:, 3:],
        attitude_covariance=whole[:3, :3],
        covariance=whole,
        covariance_by_base=by_base,
        by_attitudes=by_attitudes,
        noise=noise or (0.0 if least.recorded is None else seen[0]),
        noise_correlation=lefts[0].correlation,
        widening=widening,
        residuals=residuals if least.recorded is not None else np.zeros((0, 3)),
        momenta=momenta,
        conserved=conserved,
        motion=motion,
        times=times,
        base_axes=fit.state.axes,
        axes_covariance=extra if least.find_axes else np.zeros((3, 3)),
        by_rates=by_rates,
        rate_noise=0.0 if least.rates is None else rate_noise or seen[-1] / least.weight,
        rate_residuals=np.zeros((0, 3)) if least.rates is None else fit.residuals[-count:] / least.weight,
        bias=fit.state.bias,
        bias_covariance=extra if least.find_bias else None,
    )


def _by_recorded(least: FlightFit, motion: Motion, by_residuals: Array) -> tuple[Array, Array]:
    """Derivatives by turns of the attitudes and by the rates, (m, 3 N) each, of those by the residuals (m, 3 K)."""
    count = 3 * len(least.times)
    by_attitudes, by_rates = np.zeros((2, len(by_residuals), count))
    if least.recorded is not None:
        by_attitudes = by_residuals[:, :count]
    if least.rates is not None:
        by_rates = least.weight * by_residuals[:, -count:]
        by_turns = by_rates.reshape(len(by_rates), -1, 1, 3) @ least.rates_by_turns(motion)
        by_attitudes = by_attitudes + by_turns.reshape(by_rates.shape)
    return by_attitudes, by_rates


def _carried_noise(least: FlightFit, motion: Motion, columns: Array, noise: Array) -> Array:
    """Turns of the first recorded quantity by noise of the joints' samples, as far as orthonormal columns (3 N, c)
    hold them: (3 N, c), for c independent numbers of variance one."""
    others = 3 * len(least.times) * (least.recorded is not None and least.rates is not None)
    by_attitudes, by_rates = _by_recorded(least, motion, np.pad(columns.T, ((0, 0), (0, others))))
    by_knots = fit_by_knots(motion, least.times, by_attitudes, by_rates)
    values, axes = np.linalg.eigh(carried_by_knots(_samples(motion), by_knots, noise))
    return columns @ (axes * np.sqrt(np.maximum(values, 0.0)))


def _samples(motion: Motion) -> PathSamples:
    return path_samples(deformation_parts(motion.deformation).path)


def warn_of_drift(fit: RecordedMomentum) -> None:
    """Issue a TrajectoryWarning with the first and the last momentum."""
    first, last = (" ".join(f"{value:.4g}" for value in fit.momenta[row]) for row in (0, -1))
    warnings.warn(
        f"the momentum is not constant: it goes from ({first}) to ({last}) kg m^2/s, so that nothing conserved was "
        "recorded; the bars hold it at every time. Is the body in the air all the time, and are its masses right?",
        TrajectoryWarning,
        stacklevel=3,
    )
