"""The motion of a body as it was recorded: by the momentum that its recorded base shows, or by one that is given."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_flag, check_object, initial_state_arguments
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_smooth
from ..body.loading import as_body
from ..deformation.deformation import Deformation, articulated
from ..deformation.rotors import RotorValue, mapping_of_joints
from ..display import frozen
from ..errors import AccuracyNotReached, ShapeError, TrajectoryError, TrajectoryWarning, WrongObjectError
from ..reconstruction.reconstruction import Motion, momentum_from_rate, reconstruct
from ..run_progress import ProgressCallback
from ..shape_space.files.flight import ALL, turns
from ..shape_space.files.read import RecordedMotion
from ..shape_space.path_samples import path_samples
from ..warning_filters import quiet
from .recorded_momentum import RecordedMomentum, momentum_from_recording, warn_of_drift


@frozen
class RecordedFlight:
    """A recording as a motion. Made by `motion_from_recording`.

    Attributes
    ----------
    motion : of the body along the recorded path
    momentum_by : "fit" to the recorded attitudes and rates of the base, "given", or "nothing": it is
        zero, as the base was not recorded, or has one attitude in every sample, and none is given
    fitted : the fit, where there is one
    """

    motion: Motion
    momentum_by: str
    fitted: RecordedMomentum | None = None


def motion_from_recording(
    body: Body | str,
    recorded: RecordedMotion,
    *,
    momentum: ArrayLike | None = None,
    rate: ArrayLike | None = None,
    rate_time: float = 0.0,
    attitude: ArrayLike | None = None,
    joints: ArrayLike | str | None = None,
    tolerance: float = 1e-9,
    find_axes: bool = False,
    progress: ProgressCallback | None = None,
    rotors: Mapping[str, RotorValue] | None = None,
    rotor_speeds: Mapping[str, RotorValue] | None = None,
) -> RecordedFlight:
    """The motion of a recorded body, as every command makes it.

    Where attitudes or rates of the base were recorded, the momentum is fitted to them. A momentum that is given wins;
    the motion then starts at the recorded attitude. Zero is taken only where nothing of the base was recorded, or one
    attitude in every sample, as of a base that was held fixed.

    Parameters
    ----------
    recorded : as `read_recorded_motion` gives it; with its flight="recorded" only what is a flight
    momentum : (3,) the recorder's axes [kg m^2/s]; None: as the file states or the recorded base shows, or zero
    rate : (3,) angular velocity of the base at one time instead, base axes [rad/s]
    rate_time : that time, since the first sample kept [s]
    attitude : (3, 3) or quaternion (4,) x y z w of the start, beside a momentum or rate, or of rates without attitudes;
        None: as recorded, or the identity
    joints : noise of the recorded joints for the fit, as for `uncertainty`; None: that of their smoothing, if any
    tolerance : of the attitude [rad]
    find_axes : as for `momentum_from_recording`
    progress : called while it is reconstructed
    rotors, rotor_speeds : wheels, as for `articulated`; those of `recorded.wheel_speeds` count as well

    Raises
    ------
    ShapeError
        For an attitude beside a momentum that is fitted, axes to be found without a fit, or momentum and rate.
    TrajectoryError
        If the recording was not declared to be a flight, and its base is none: the fit does not settle, or what it
        leaves is no noise.
    AccuracyNotReached
        If the fit to a requested flight does not settle.

    Warns
    -----
    TrajectoryWarning
        If the momentum of a flight changes.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> sp.write_shape_path(loop, "joints.csv")
    >>> print(sp.motion_from_recording(cat, sp.read_recorded_motion("joints.csv", cat)).momentum_by)
    nothing
    """
    body = as_body(body)
    check_object(recorded, "RecordedMotion", "recorded")
    check_flag(find_axes, "find_axes")
    if momentum is not None:
        momentum = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    if momentum is not None and rate is not None:
        raise ShapeError("rate and momentum: either states how the body turns; leave one of them out")
    if momentum is None and rate is None:
        momentum = recorded.momentum
    speeds = {**recorded.wheel_speeds, **mapping_of_joints(rotor_speeds, "rotor_speeds")}
    deformation = articulated(body, recorded.path, rotors=rotors, rotor_speeds=speeds)
    attitudes, rates = recorded.base_attitude, recorded.base_rates
    given = momentum is not None or rate is not None
    is_turning = turns(attitudes) if attitudes is not None else rates is not None and bool(rates.any())
    if not given and (is_turning or (recorded.flight is not None and (attitudes is not None or rates is not None))):
        if attitude is not None and attitudes is not None:
            raise ShapeError(
                "the attitude at the start is fitted to the recorded base, with the momentum; leave it out "
                "(--attitude), or give the momentum, too (--momentum)"
            )
        joints = _noise_of_smoothing(body, recorded) if joints is None else joints
        fitted = _fit(deformation, recorded, attitude, joints, tolerance, find_axes=find_axes)
        return RecordedFlight(fitted.motion, "fit", fitted)
    if find_axes:
        raise ShapeError(
            "the axes of the base are found by the fit of a momentum to its recorded attitude: leave the momentum out "
            "(--momentum), or give the axes (--base-axes)"
        )
    if attitude is None and attitudes is not None:
        attitude = attitudes[0]
    if rate is not None:
        momentum = momentum_from_rate(deformation, rate, attitude, time=rate_time)
    start = np.zeros(3) if momentum is None else momentum
    moved = reconstruct(deformation, start, attitude, tolerance=tolerance, progress=progress)
    return RecordedFlight(moved, "given" if given else "nothing")


def _noise_of_smoothing(body: Body, recorded: RecordedMotion) -> Array | None:
    """Noise by which the joints were smoothed (n,); None where a motion has no derivatives by their samples."""
    if recorded.smoothing is None:
        return None
    with suppress(WrongObjectError, ShapeError):
        path_samples(recorded.path)
        check_smooth(body.chain.follows, "derivatives by a path need", kinks_only=True)
        return recorded.smoothing.noise
    return None


def _fit(
    deformation: Deformation,
    recorded: RecordedMotion,
    attitude: ArrayLike | None,
    joints: ArrayLike | str | None,
    tolerance: float,
    *,
    find_axes: bool,
) -> RecordedMomentum:
    flight = recorded.flight
    start = None if attitude is None else initial_state_arguments(np.zeros(3), attitude)[1]
    assumed = flight is None or not flight.requested
    try:
        with quiet(category=TrajectoryWarning):
            fitted = momentum_from_recording(
                deformation,
                recorded.times,
                recorded.base_attitude,
                rates=recorded.base_rates,
                attitude=start,
                joints=joints,
                tolerance=tolerance,
                find_axes=find_axes,
            )
    except (AccuracyNotReached, TrajectoryError) as error:
        if assumed:
            raise _no_flight(recorded, str(error)) from error
        raise type(error)(
            f"{error}. Give other times: flight=(first, last) (--flight FIRST LAST); or the axes of the base: "
            "base_axes (--base-axes x,-z,y); or momentum=[0, 0, 0] (--momentum 0 0 0), if the recorded base shall not "
            "count"
        ) from error
    if not fitted.conserved:
        if assumed and (flight is None or flight.by == ALL):
            raise _no_flight(recorded, "the residuals of the recorded base are no noise")
        warn_of_drift(fitted)
    return fitted


def _no_flight(recorded: RecordedMotion, why: str) -> TrajectoryError:
    return TrajectoryError(
        f"{recorded.record['file']}: the base is recorded, and no momentum is given, but no free "
        f"flight with one momentum is found: {why}. Give the times of the flight: flight=(first, last) (--flight FIRST "
        "LAST); or flight='all' (--flight all), if the body is free all the time; or momentum=[0, 0, 0] "
        "(--momentum 0 0 0), if the recorded base is not to count"
    )
