"""The momentum of a recorded flight, from the attitudes of its base."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_flag, check_object, number_argument, times_argument
from ..arrays import Array, copied_when_read, finite_array, lock_arrays
from ..deformation.deformation import Deformation
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError, TrajectoryWarning
from ..reconstruction.reconstruction import Motion, reconstruct
from ..reconstruction.recorded_base import W_FIRST, read_w_first
from ._along_motion import legendre, responses
from ._residual_noise import drift_modes, held, most_modes, residual_noise

_MOST_ROUNDS = 40  # of Gauss and Newton; a flight of many turns takes ten
_ENOUGH_ROUNDS = 12  # after which a recording far from any flight of the body is refused
_SMALL_STEP = 1e-3  # of the standard deviations of the fit: a smaller step is the last
_NO_STEP = 1e-11  # [rad], and of the momentum: the last step without noise
_MOST_HALVINGS = 12  # of a step that leads away from the recording
UNKNOWNS = 6  # turn of the start and momentum
_SAME_AXES = 0.2  # [rad] between equal candidates for the axes
_MOST_LIKELY = 4  # candidates for the axes that are fitted
_ROUGH_ROUNDS = 15  # of least squares for a candidate
_VAGUE_AXES = 0.3  # [rad] uncertainty of axes that the recording leaves open
_FIRST_TIMES = 6  # attitudes that are fitted first, or up to twice as many
_NO_FLIGHT = 0.5  # [rad] rms from every motion of the body, beyond which a recording is none of its flights
_ROUNDED = 10.0  # tolerances of the reconstruction: smaller residuals are rounding
_CONSTANT = 0.01  # of the momentum and of the internal momentum: a smaller change is not reported


@copied_when_read("initial_attitude", "base_axes")
@dataclass(frozen=True, eq=False)
class RecordedMomentum:
    """The momentum and start with which a body comes nearest to the attitudes that were recorded.

    Made by `momentum_from_recording`.

    Attributes
    ----------
    momentum : (3,) about the centre of mass, the recorder's axes [kg m^2/s]
    initial_attitude : (3, 3), base axes to the recorder's
    momentum_covariance : (3, 3) [(kg m^2/s)^2], as `uncertainty` takes it
    attitude_covariance : (3, 3) of the turn of the start, base axes [rad^2], as `uncertainty` takes it
    covariance : (6, 6) of both, the turn of the start first, as `uncertainty` takes it: by the noise of the recorded
        attitudes alone, with its correlation in time, and by a momentum that changes; with the noise of the joints it
        is `uncertainty(fit.motion, start=fit, joints=...).start`
    by_attitudes : (6, 3 N) their change by turns of the recorded attitudes, base axes
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
    """

    momentum: Array
    initial_attitude: Array
    momentum_covariance: Array
    attitude_covariance: Array
    covariance: Array
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

    __post_init__ = lock_arrays
    __repr__ = short_repr

    @property
    def angles(self) -> Array:
        """Angles from reconstructed to recorded attitudes: (N,) [rad]."""
        return np.linalg.norm(self.residuals, axis=1)


def momentum_from_recording(
    deformation: Deformation,
    times: ArrayLike,
    attitudes: ArrayLike,
    *,
    noise: float | None = None,
    tolerance: float = 1e-8,
    find_axes: bool = False,
) -> RecordedMomentum:
    """Fit the angular momentum of a flight to recorded attitudes of the base, by reconstructing the whole of it.

    Nothing that was recorded is differentiated: the six numbers of momentum and initial attitude are those whose
    reconstruction is nearest to all attitudes in the sense of least squares, with the covariance that follows.

    Parameters
    ----------
    deformation : how the body changes its shape meanwhile
    times : (N,) within it, ascending, three or more [s]
    attitudes : (N, 3, 3), base axes to the recorder's; nearer to each other than half a turn
    noise : standard deviation of each component of a recorded attitude [rad]; None: what the fit leaves, which holds
        what noise of the joints turns the reconstruction by, too. Bars are never shorter than what the fit leaves says
    tolerance : of the reconstruction [rad]
    find_axes : whether the attitudes are those of axes that are fixed to the base in an unknown way, which is fitted
        too: from the way on with which the momentum, roughly, stays most constant

    Raises
    ------
    ShapeError
        If the shapes disagree.
    TrajectoryError
        If there are fewer than three times, or they do not ascend; or if the attitudes are a flight only once their
        quaternions are read with w first.
    AccuracyNotReached
        If the fit does not settle: the recording is no free flight of this body, or too coarse; or if it does not tell
        the axes.

    Warns
    -----
    TrajectoryWarning
        If the momentum changes: what is left over of the attitudes is no noise. Bars then hold the momentum at every
        time.

    Notes
    -----
    Noise that is correlated in time, as trackers and filters leave it, makes the bars longer, by an autoregressive
    process whose correlation is not known either. Equation :eq:`moved-fit` of the documentation.
    Source: theory.md section 8 (the response of the attitude to start and momentum).

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion, times = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), np.linspace(0.0, 1.0, 9)
    >>> result = sp.momentum_from_recording(motion.deformation, times, motion.attitude(times))
    >>> print(result.momentum.round(6) + 0.0)
    [0.    0.    0.005]
    """
    check_flag(find_axes, "find_axes")
    check_object(deformation, "Deformation", "deformation")
    at = times_argument(finite_array(times, "times", (None,), unit="s"), deformation.duration)
    recorded = so3.rotation_argument(attitudes, "attitudes")
    if at.ndim != 1 or recorded.shape != (len(at), 3, 3):
        raise ShapeError(f"attitudes: ({at.size}, 3, 3), one for each time, are needed, got {recorded.shape}")
    if len(at) < 3 or np.any(np.diff(at) <= 0.0):
        raise TrajectoryError("times: three or more that ascend are needed to fit a momentum")
    if noise is not None and not number_argument(noise, "noise", "rad") > 0.0:
        raise ShapeError(f"noise: a positive standard deviation is needed, got {noise}")
    try:
        fit = _flight_fitted(deformation, at, recorded, tolerance, find_axes=find_axes)
    except AccuracyNotReached as error:
        # Axes that are to be found leave the order of the quaternions open.
        if not find_axes:
            with suppress(AccuracyNotReached):
                _flight_fitted(deformation, at, read_w_first(recorded), tolerance, find_axes=False)
                raise TrajectoryError(f"the recorded base is no flight of this body; {W_FIRST}") from error
        raise
    result = _estimated(fit, at, noise, tolerance)
    if not result.conserved:
        warn_of_drift(result)
    return result


def _estimated(fit: _Fitted, times: Array, noise: float | None, tolerance: float) -> RecordedMomentum:
    """The fit with the noise and the change of the momentum that its residuals show."""
    residuals, slopes, motion = fit.residuals, fit.slopes, fit.motion
    white = np.asarray(np.linalg.inv(slopes.T @ slopes), dtype=np.float64)
    seen = float(np.sqrt((residuals**2).sum() / (residuals.size - slopes.shape[1])))
    modes, sure, by_modes = 0, False, np.empty((residuals.size, 0))
    # Residuals near the tolerance of the reconstruction are rounding.
    if _spread(residuals) > _ROUNDED * tolerance:
        turned = responses(motion, times, most_modes(len(times)))[:, :, UNKNOWNS:]
        by_modes = (so3.transpose(motion.attitude(times)) @ turned).reshape(residuals.size, -1)
        modes, sure = drift_modes(residuals, slopes, by_modes)
    left = residual_noise(residuals, np.hstack([slopes, by_modes[:, : 3 * modes]]))
    covariance = left.covariance(slopes)
    widening = float(np.sqrt(np.diag(covariance / (left.weights @ left.variances * white))[3:UNKNOWNS].max()))
    if noise is not None:
        covariance = covariance + max(noise**2 - seen**2, 0.0) * white
    momenta, conserved = np.tile(motion.momentum, (len(times), 1)), True
    if modes:
        seen = float(np.sqrt(left.weights @ left.variances))
        changes = (left.weights @ left.parameters).reshape(-1, 3)[[1, *range(-modes, 0)]]
        deviations = legendre(times, times, modes) @ changes
        covariance[3:UNKNOWNS, 3:UNKNOWNS] += held(deviations)
        momenta = momenta + deviations
        _, carried = motion.deformation.description.sample(times)
        turning = np.linalg.norm(motion.momentum) + np.sqrt((carried**2).sum(axis=1).mean())
        conserved = not sure or bool(np.linalg.norm(deviations, axis=1).max() <= _CONSTANT * turning)
    free = fit.slopes.shape[1] > UNKNOWNS
    return RecordedMomentum(
        momentum=motion.momentum,
        initial_attitude=motion.initial_attitude,
        momentum_covariance=covariance[3:UNKNOWNS, 3:UNKNOWNS],
        attitude_covariance=covariance[:3, :3],
        covariance=covariance[:UNKNOWNS, :UNKNOWNS],
        by_attitudes=np.asarray(np.linalg.pinv(slopes)[:UNKNOWNS], dtype=np.float64),
        noise=seen if noise is None else noise,
        noise_correlation=left.correlation,
        widening=widening,
        residuals=residuals,
        momenta=momenta,
        conserved=conserved,
        motion=motion,
        times=times,
        base_axes=fit.axes,
        axes_covariance=covariance[UNKNOWNS:, UNKNOWNS:] if free else np.zeros((3, 3)),
    )


def warn_of_drift(fit: RecordedMomentum) -> None:
    """Issue a TrajectoryWarning with the first and the last momentum."""
    first, last = (" ".join(f"{value:.4g}" for value in fit.momenta[row]) for row in (0, -1))
    warnings.warn(
        f"the momentum is not constant: it goes from ({first}) to ({last}) kg m^2/s, so that nothing conserved was "
        "recorded; the bars hold it at every time. Is the body in the air all the time, and are its masses right?",
        TrajectoryWarning,
        stacklevel=3,
    )


class _Fitted(NamedTuple):
    """The nearest motion and axes, (3, 3) base axes to those recorded; what is left, (N, 3), its slopes, (3 N, m)."""

    motion: Motion
    axes: Array
    residuals: Array
    slopes: Array


def _flight_fitted(
    deformation: Deformation, times: Array, recorded: Array, tolerance: float, *, find_axes: bool
) -> _Fitted:
    """The nearest flight; raises AccuracyNotReached where none is near."""
    if find_axes:
        fit = _with_axes(deformation, times, recorded, tolerance)
    else:
        fit = _fitted(deformation, times, recorded, tolerance, np.eye(3))
    _check_near(fit.residuals, times)
    return fit


def _fitted(deformation: Deformation, times: Array, recorded: Array, tolerance: float, axes: Array) -> _Fitted:
    """Fit to the first few attitudes, then to more and more, so that a wrong momentum never loses count of turns."""
    fit = _Least(deformation, times, recorded, tolerance)
    half = len(times) // 2
    if half < _FIRST_TIMES:
        return fit.settled(fit.first_motion(axes), axes)
    before = _fitted(deformation, times[:half], recorded[:half], tolerance, axes)
    _check_near(before.residuals, times[:half])
    return fit.settled(before.motion, axes)


def _momenta(deformation: Deformation, times: Array, recorded: Array) -> Array:
    """Momenta by the turns between neighbouring attitudes: (N - 1, 3)."""
    middle = 0.5 * (times[1:] + times[:-1])
    turns = so3.log(so3.transpose(recorded[:-1]) @ recorded[1:])
    rates = turns / np.diff(times)[:, None]
    inertia, internal = deformation.description.sample(middle)
    seen = recorded[:-1] @ so3.exp(0.5 * turns)
    return so3.apply(seen, so3.apply(inertia, rates) + internal)


def _with_axes(deformation: Deformation, times: Array, recorded: Array, tolerance: float) -> _Fitted:
    """The nearest fit from each of the likely axes, of which a nearly symmetric body has several."""
    fits, vague = [], False
    free = _Least(deformation, times, recorded, tolerance, find_axes=True)
    for axes in _likely_axes(deformation, times, recorded):
        # From unlikely axes a fit may wander about.
        with suppress(AccuracyNotReached):
            near = _fitted(deformation, times, recorded, tolerance, axes)
            if free.leaves_axes_open(near):
                vague = True
                continue
            fits.append(free.settled(near.motion, near.axes))
    if vague and not fits:
        raise AccuracyNotReached("the flight leaves the axes of the base open; give them: base_axes (--base-axes)")
    if not fits:
        raise AccuracyNotReached("with no axes of the base the recording comes near to a free flight of this body")
    return min(fits, key=lambda fit: _spread(fit.residuals))


def _likely_axes(deformation: Deformation, times: Array, recorded: Array) -> list[Array]:
    """The axes with which the momentum stays most constant, best first: near the 24 ways along the base's axes."""
    from scipy.optimize import least_squares

    def wander(turn: Array, about: Array) -> Array:
        momenta = _momenta(deformation, times, recorded @ about @ so3.exp(turn))
        return ((momenta - momenta.mean(axis=0)) / np.sqrt((momenta**2).sum(axis=1).mean())).ravel()

    candidates: list[tuple[float, Array]] = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            axes = np.eye(3)[:, order] * signs
            if np.linalg.det(axes) > 0.0:
                near = least_squares(wander, np.zeros(3), args=(axes,), max_nfev=_ROUGH_ROUNDS)
                candidates.append((float(near.cost), axes @ so3.exp(near.x)))
    kept: list[Array] = []
    for _, axes in sorted(candidates, key=lambda candidate: candidate[0]):
        if all(so3.angle(so3.transpose(axes) @ other) > _SAME_AXES for other in kept):
            kept.append(axes)
    return kept[:_MOST_LIKELY]


@dataclass(frozen=True, eq=False)
class _Least:
    """Least squares over momentum and start, and the axes where they are to be found.

    Attributes
    ----------
    deformation, tolerance, find_axes : as given
    times, recorded : (N,), (N, 3, 3) what is fitted
    """

    deformation: Deformation
    times: Array
    recorded: Array
    tolerance: float
    find_axes: bool = False

    def settled(self, motion: Motion, axes: Array) -> _Fitted:
        """Fit by steps of Gauss and Newton from a motion and axes, halved where they go too far."""
        residuals = self._residuals(motion, axes)
        for number in range(_MOST_ROUNDS):
            if number == _ENOUGH_ROUNDS:
                _check_near(residuals, self.times)
            slopes = self._slopes(motion)
            step = np.asarray(np.linalg.lstsq(slopes, residuals.ravel(), rcond=None)[0], dtype=np.float64)
            if self._is_small(step, slopes, motion, residuals):
                return _Fitted(motion, axes, residuals, slopes)
            motion, axes, residuals = self._nearer(motion, axes, step, float((residuals**2).sum()))
        raise AccuracyNotReached(f"the momentum did not settle within {_MOST_ROUNDS} rounds; {_apart(residuals)}")

    def leaves_axes_open(self, near: _Fitted) -> bool:
        """True where the recording allows other axes, too, by the residuals of a fit to given axes."""
        slopes = self._slopes(near.motion)
        # A turn of the axes that start and momentum undo.
        ours, others = slopes[:, UNKNOWNS:], slopes[:, :UNKNOWNS]
        alone = ours - others @ np.linalg.lstsq(others, ours, rcond=None)[0]
        weakest = float(np.linalg.svd(alone, compute_uv=False)[-1])
        return _spread(near.residuals) > _VAGUE_AXES * weakest

    def first_motion(self, axes: Array) -> Motion:
        """Motion with the mean of the momenta by neighbouring attitudes."""
        momenta = _momenta(self.deformation, self.times, self.recorded @ axes)
        return self._reconstructed(momenta.mean(axis=0), self.recorded[0] @ axes)

    def _slopes(self, motion: Motion) -> Array:
        """The change of all attitudes by start, momentum and, backwards, axes, base axes: (3 N, 6 or 9)."""
        turns = responses(motion, self.times)
        turns[:, :, :3] = turns[:, :, :3] @ motion.initial_attitude
        slopes = (so3.transpose(motion.attitude(self.times)) @ turns).reshape(-1, UNKNOWNS)
        return np.hstack([slopes, np.tile(-np.eye(3), (len(self.times), 1))]) if self.find_axes else slopes

    def _nearer(self, motion: Motion, axes: Array, step: Array, before: float) -> tuple[Motion, Array, Array]:
        trial, turned, residuals = motion, axes, np.empty(0)
        for halving in range(_MOST_HALVINGS):
            change = step * 0.5**halving
            start = motion.initial_attitude @ so3.exp(change[:3])
            trial = self._reconstructed(motion.momentum + change[3:UNKNOWNS], start)
            turned = axes @ so3.exp(change[UNKNOWNS:]) if self.find_axes else axes
            residuals = self._residuals(trial, turned)
            if (residuals**2).sum() <= before:
                break
        return trial, turned, residuals

    def _is_small(self, step: Array, slopes: Array, motion: Motion, residuals: Array) -> bool:
        """True where a step is far below the uncertainty of the fit, or rounding."""
        unknowns = slopes.shape[1]
        by_unit = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
        noise = float(np.sqrt((residuals**2).sum() / (residuals.size - unknowns)))
        floor = np.full(unknowns, _NO_STEP)
        floor[3:UNKNOWNS] *= float(np.linalg.norm(motion.momentum))
        # The tolerance of the reconstruction also bounds the last step.
        return bool(np.all(np.abs(step) <= (_SMALL_STEP * noise + self.tolerance) * by_unit + floor))

    def _reconstructed(self, momentum: Array, attitude: Array) -> Motion:
        return reconstruct(self.deformation, momentum, attitude, tolerance=self.tolerance)

    def _residuals(self, motion: Motion, axes: Array) -> Array:
        return so3.log(so3.transpose(motion.attitude(self.times)) @ self.recorded @ axes)


def _spread(residuals: Array) -> float:
    """Root mean square of the angles [rad]."""
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


def _check_near(residuals: Array, times: Array) -> None:
    """Raise AccuracyNotReached where the residuals of attitudes at these times are too large for noise."""
    if _spread(residuals) > _NO_FLIGHT:
        raise AccuracyNotReached(
            f"{_apart(residuals)} from {times[0]:.6g} to {times[-1]:.6g} s: no free flight of this body, or the axes "
            "that were recorded are not those of its base"
        )


def _apart(residuals: Array) -> str:
    """Distance from reconstruction to recording, in words."""
    spread = np.degrees(_spread(residuals))
    return f"the reconstruction stays {spread:.3g} degrees (rms) from {len(residuals)} attitudes"
