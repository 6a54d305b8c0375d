"""The momentum of a recorded flight, from the attitudes of its base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, times_argument
from ..arrays import Array, finite_array, lock_arrays
from ..deformation.deformation import Deformation
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError
from ..reconstruction.reconstruction import Motion, reconstruct
from ._along_motion import responses

# Rounds of Gauss and Newton; a flight of many turns takes ten.
_MOST_ROUNDS = 40
# Of the deviations that the fit itself leaves open: a smaller step is the last.
_SMALL_STEP = 1e-3
# [rad] and of the momentum: where there is no noise.
_NO_STEP = 1e-11
# A step is halved so many times, at most, to come nearer to the recording.
_MOST_HALVINGS = 12
_UNKNOWNS = 6
# Attitudes that are fitted first, or up to twice as many.
_FIRST_TIMES = 6
# [rad] A recording that stays so far from every motion of the body is none of its flights.
_NO_FLIGHT = 0.5


@dataclass(frozen=True, eq=False)
class RecordedMomentum:
    """The momentum and start with which a body comes nearest to the attitudes that were recorded.

    Attributes
    ----------
    momentum : (3,) about the centre of mass, the recorder's axes [kg m^2/s]
    initial_attitude : (3, 3), base axes to the recorder's
    momentum_covariance : (3, 3) [(kg m^2/s)^2], as `uncertainty` takes it
    attitude_covariance : (3, 3) of the turn of the start, base axes [rad^2], as `uncertainty` takes it
    covariance : (6, 6) of both, the turn of the start first
    noise : of each component of a recorded attitude, given or as the fit leaves it [rad]
    residuals : (N, 3) from reconstructed to recorded attitudes, rotation vectors in base axes [rad]
    motion : the one that was fitted

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion, times = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), np.linspace(0.0, 1.0, 9)
    >>> found = sp.momentum_from_recording(motion.deformation, times, motion.attitude(times), noise=1e-3)
    >>> print(found.momentum_covariance.shape, f"{found.noise:.3f}")
    (3, 3) 0.001
    """

    momentum: Array
    initial_attitude: Array
    momentum_covariance: Array
    attitude_covariance: Array
    covariance: Array
    noise: float
    residuals: Array
    motion: Motion

    __post_init__ = lock_arrays


def momentum_from_recording(
    deformation: Deformation,
    times: ArrayLike,
    attitudes: ArrayLike,
    *,
    noise: float | None = None,
    tolerance: float = 1e-8,
) -> RecordedMomentum:
    """Fit the angular momentum of a flight to recorded attitudes of the base, by reconstructing the whole of it.

    Nothing that was recorded is differentiated: the six numbers of momentum and initial attitude are those whose
    reconstruction is nearest to all attitudes in the sense of least squares, with the covariance that follows.

    Parameters
    ----------
    deformation : how the body changes its shape meanwhile
    times : (N,) within it, ascending, three or more [s]
    attitudes : (N, 3, 3), base axes to the recorder's; nearer to each other than half a turn
    noise : standard deviation of each component of a recorded attitude [rad]; None: what the fit leaves
    tolerance : of the reconstruction [rad]

    Raises
    ------
    ShapeError
        If the shapes disagree.
    TrajectoryError
        If there are fewer than three times, or they do not ascend.
    AccuracyNotReached
        If the fit does not settle: the recording is no free flight of this body, or too coarse.

    Notes
    -----
    Source: theory.md section 8 (the response of the attitude to start and momentum).

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion, times = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), np.linspace(0.0, 1.0, 9)
    >>> found = sp.momentum_from_recording(motion.deformation, times, motion.attitude(times))
    >>> print(found.momentum.round(6) + 0.0)
    [0.    0.    0.005]
    """
    check_object(deformation, "Deformation", "deformation")
    at = times_argument(finite_array(times, "times", (None,), unit="s"), deformation.duration)
    recorded = so3.rotation_argument(attitudes, "attitudes")
    if at.ndim != 1 or recorded.shape != (len(at), 3, 3):
        raise ShapeError(f"attitudes: ({at.size}, 3, 3), one for each time, are needed, got {recorded.shape}")
    if len(at) < 3 or np.any(np.diff(at) <= 0.0):
        raise TrajectoryError("times: three or more that ascend are needed to fit a momentum")
    if noise is not None and not noise > 0.0:
        raise ShapeError(f"noise: a positive standard deviation is needed, got {noise}")
    motion, residuals, slopes = _fitted(deformation, at, recorded, tolerance)
    if _spread(residuals) > _NO_FLIGHT:
        raise AccuracyNotReached(f"{_apart(residuals)}: is it a free flight of this body?")
    free = residuals.size - _UNKNOWNS
    if noise is None:
        noise = float(np.sqrt((residuals**2).sum() / free))
    covariance = np.asarray(noise**2 * np.linalg.inv(slopes.T @ slopes), dtype=np.float64)
    return RecordedMomentum(
        momentum=motion.momentum,
        initial_attitude=motion.initial_attitude,
        momentum_covariance=covariance[3:, 3:],
        attitude_covariance=covariance[:3, :3],
        covariance=covariance,
        noise=noise,
        residuals=residuals,
        motion=motion,
    )


def _fitted(deformation: Deformation, times: Array, recorded: Array, tolerance: float) -> tuple[Motion, Array, Array]:
    """The nearest motion, its residuals and slopes: to the first few attitudes, then to ever more of them.

    So that a momentum that is a little off never loses count of the turns.
    """
    fit = _Fit(deformation, times, recorded, tolerance)
    half = len(times) // 2
    if half < _FIRST_TIMES:
        return fit.settled(fit.first_motion())
    nearby, _, _ = _fitted(deformation, times[:half], recorded[:half], tolerance)
    return fit.settled(nearby)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Least squares over momentum and start.

    Attributes
    ----------
    deformation, tolerance : as given
    times, recorded : (N,), (N, 3, 3) what is fitted
    """

    deformation: Deformation
    times: Array
    recorded: Array
    tolerance: float

    def settled(self, motion: Motion) -> tuple[Motion, Array, Array]:
        """The nearest motion, its residuals and slopes, by steps of Gauss and Newton, halved where they go too far."""
        residuals = self._residuals(motion)
        for _ in range(_MOST_ROUNDS):
            slopes = self._slopes(motion)
            step = np.asarray(np.linalg.lstsq(slopes, residuals.ravel(), rcond=None)[0], dtype=np.float64)
            if self._is_small(step, slopes, motion, residuals):
                return motion, residuals, slopes
            motion, residuals = self._nearer(motion, step, float((residuals**2).sum()))
        raise AccuracyNotReached(f"the momentum did not settle within {_MOST_ROUNDS} rounds; {_apart(residuals)}")

    def first_motion(self) -> Motion:
        """By the mean of what the turns between neighbouring attitudes say, each at the middle of its time."""
        middle = 0.5 * (self.times[1:] + self.times[:-1])
        turns = so3.log(so3.transpose(self.recorded[:-1]) @ self.recorded[1:])
        rates = turns / np.diff(self.times)[:, None]
        inertia, internal = self.deformation.description.sample(middle)
        seen = self.recorded[:-1] @ so3.exp(0.5 * turns)
        momenta = so3.apply(seen, so3.apply(inertia, rates) + internal)
        return self._reconstructed(momenta.mean(axis=0), self.recorded[0])

    def _slopes(self, motion: Motion) -> Array:
        """The change of all attitudes by start and momentum, base axes: (3 N, 6)."""
        found = responses(motion, self.times)
        found[:, :, :3] = found[:, :, :3] @ motion.initial_attitude
        return (so3.transpose(motion.attitude(self.times)) @ found).reshape(-1, _UNKNOWNS)

    def _nearer(self, motion: Motion, step: Array, before: float) -> tuple[Motion, Array]:
        trial, residuals = motion, np.empty(0)
        for halving in range(_MOST_HALVINGS):
            change = step * 0.5**halving
            start = motion.initial_attitude @ so3.exp(change[:3])
            trial = self._reconstructed(motion.momentum + change[3:], start)
            residuals = self._residuals(trial)
            if (residuals**2).sum() <= before:
                break
        return trial, residuals

    def _is_small(self, step: Array, slopes: Array, motion: Motion, residuals: Array) -> bool:
        """Whether a step is far below what the recording leaves open, or next to nothing."""
        free = residuals.size - _UNKNOWNS
        by_unit = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
        noise = float(np.sqrt((residuals**2).sum() / free))
        floor = np.full(_UNKNOWNS, _NO_STEP)
        floor[3:] *= float(np.linalg.norm(motion.momentum))
        # What the tolerance of the reconstruction moves the fit by counts for nothing either.
        return bool(np.all(np.abs(step) <= (_SMALL_STEP * noise + self.tolerance) * by_unit + floor))

    def _reconstructed(self, momentum: Array, attitude: Array) -> Motion:
        return reconstruct(self.deformation, momentum, attitude, tolerance=self.tolerance)

    def _residuals(self, motion: Motion) -> Array:
        return so3.log(so3.transpose(motion.attitude(self.times)) @ self.recorded)


def _spread(residuals: Array) -> float:
    """Root mean square of the angles [rad]."""
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


def _apart(residuals: Array) -> str:
    """How far the reconstruction is from the recording, in words."""
    spread = np.degrees(_spread(residuals))
    return f"the reconstruction stays {spread:.3g} degrees (rms) from {len(residuals)} attitudes"
