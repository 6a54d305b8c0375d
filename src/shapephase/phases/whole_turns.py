"""Turns of a body, whole ones counted: about its momentum, and somersaults and twists of an athlete."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from ..display import short_repr
from ..errors import ChartPoleError, ShapeError
from ..reconstruction import AthleteAxes
from ..reconstruction.attitude_angles import athlete_slopes, tilt_and_twist
from ..reconstruction.reconstruction import Motion
from ..refinement import least_over
from .phase_split import PhaseSplit

_TURN = 2.0 * np.pi
_PARTS = 8  # of a step, between which counts and rates are followed: a step turns the body by a fraction of a radian
_FIXED = 1e-9  # of the angular velocity, off one axis: rounding of a motion in a plane


@dataclass(frozen=True, eq=False)
class AthleteTurns:
    """Somersaults and twists of one motion from its start to its end.

    Attributes
    ----------
    somersaults, twists : [revolutions]
    largest_tilt, tilt_time : size of the largest tilt [rad], and when it is reached [s]
    somersault_rate, twist_rate : largest sizes of the rates [rad/s]; None where the tilt passes through 90 degrees
    error : estimate of the numerical error of each count [revolutions]
    axes : of these angles

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> turns = sp.phases.athlete_turns(sp.reconstruct(dive.deformation, dive.momentum))
    >>> print(turns.halves, f"{np.degrees(turns.largest_tilt):.1f} deg at {turns.tilt_time:.2f} s")
    (1.5, -1.0) 10.3 deg at 0.87 s
    """

    somersaults: float
    twists: float
    largest_tilt: float
    tilt_time: float
    somersault_rate: float | None
    twist_rate: float | None
    error: float
    axes: AthleteAxes

    __repr__ = short_repr

    @property
    def halves(self) -> tuple[float, float]:
        """Somersaults and twists to the nearest half."""
        return round(2.0 * self.somersaults) / 2.0 + 0.0, round(2.0 * self.twists) / 2.0 + 0.0

    def __str__(self) -> str:
        """Return the counts in a sentence."""
        halves = self.halves
        rates = ""
        if self.somersault_rate is not None and self.twist_rate is not None:
            fast = self.somersault_rate / _TURN, self.twist_rate / _TURN
            rates = f", at most {fast[0]:.3f} somersaults and {fast[1]:.3f} twists a second"
        return (
            f"As an athlete: {_count(self.somersaults)} somersaults and {_count(self.twists)} twists (to halves "
            f"{halves[0]:g} and {halves[1]:g}), tilt at most {math.degrees(self.largest_tilt):.1f} degrees "
            f"at {self.tilt_time:.4g} s{rates} (numerical error {self.error:.0e} turns); {self.axes}."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the counts for JSON, with the axes and their sources."""
        return {
            "somersaults": self.somersaults,
            "twists": self.twists,
            "somersaults_to_halves": self.halves[0],
            "twists_to_halves": self.halves[1],
            "largest_tilt_rad": self.largest_tilt,
            "largest_tilt_time_s": self.tilt_time,
            "largest_somersault_rate_rad_s": self.somersault_rate,
            "largest_twist_rate_rad_s": self.twist_rate,
            "somersault_axes": {
                name: {"axis": getattr(self.axes, name).tolist(), "by": reason}
                for name, reason in sorted(self.axes.reasons.items())
            },
        }


@dataclass(frozen=True, eq=False)
class TurnCounts:
    """Turns of one motion from its start to its end.

    Attributes
    ----------
    about_momentum : the Montgomery phase in revolutions, in the gauge of the split; 0 without momentum
    athlete : somersaults and twists; None for another body
    error : error estimate of each count [revolutions]
    rotation_number : revolutions about the axis of a motion in a plane, one whose axis of rotation is fixed; None for
        other motions
    rotation_axis : (3,) of it, base axes

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> counts = sp.turn_counts(motion, sp.split(motion))
    >>> print(f"{counts.somersaults:.3f} somersaults, {abs(counts.twists):.3f} twists")
    1.500 somersaults, 1.000 twists
    """

    about_momentum: float
    athlete: AthleteTurns | None
    error: float
    rotation_number: float | None = None
    rotation_axis: Array | None = None

    __repr__ = short_repr

    @property
    def somersaults(self) -> float | None:
        """Revolutions; None where no athlete is counted."""
        return None if self.athlete is None else self.athlete.somersaults

    @property
    def twists(self) -> float | None:
        """Revolutions; None where no athlete is counted."""
        return None if self.athlete is None else self.athlete.twists

    @property
    def largest_tilt(self) -> float | None:
        """Size of the largest tilt [rad]; None where no athlete is counted."""
        return None if self.athlete is None else self.athlete.largest_tilt

    @property
    def axes(self) -> AthleteAxes | None:
        """Axes of the athlete; None where none is counted."""
        return None if self.athlete is None else self.athlete.axes

    def __str__(self) -> str:
        """Return the counts in a sentence or two; "" where there is nothing to count."""
        sentences = []
        if self.about_momentum:
            sentences.append(
                "The angle of a rotation does not count whole turns: about its momentum the body turned "
                f"{_count(self.about_momentum)} times (the Montgomery phase; numerical error {self.error:.0e})."
            )
        elif self.rotation_number is not None and self.rotation_axis is not None:
            axis = " ".join(f"{value + 0.0:.6g}" for value in np.round(self.rotation_axis, 9))
            sentences.append(
                f"The body turns in a plane, about ({axis}), base axes: rotation number {_count(self.rotation_number)} "
                f"(numerical error {self.error:.0e} turns)."
            )
        if self.athlete is not None:
            sentences.append(str(self.athlete))
        return " ".join(sentences)

    def to_dict(self) -> dict[str, Any]:
        """Return the counts for JSON, with the axes and their sources where the body is an athlete."""
        counts: dict[str, Any] = {"turns_about_momentum": self.about_momentum, "turns_error": self.error}
        if self.rotation_number is not None and self.rotation_axis is not None:
            counts |= {"rotation_number": self.rotation_number, "rotation_axis": self.rotation_axis.tolist()}
        return counts | ({} if self.athlete is None else self.athlete.to_dict())


def _count(turns: float) -> str:
    """Return a number with four digits after the point; zero has no sign."""
    return f"{round(turns, 4) + 0.0:.4f}"


def athlete_turns(motion: Motion, axes: AthleteAxes | None = None) -> AthleteTurns:
    """Somersaults and twists of one motion, its largest tilt and rates.

    Parameters
    ----------
    motion : of an athlete, no batch
    axes : by `motion.athlete_axes`; None: those that it finds

    Raises
    ------
    ShapeError
        For a batch.
    WrongObjectError
        If an axis cannot be found and has to be given.

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> turns = sp.phases.athlete_turns(sp.reconstruct(dive.deformation, dive.momentum))
    >>> print(f"{turns.somersaults:.4f} somersaults, {turns.twists:.4f} twists")
    1.5000 somersaults, -1.0000 twists
    """
    check_object(motion, "Motion", "motion")
    if motion.batch:
        raise ShapeError(f"somersaults are counted of one motion, this is a batch of {motion.batch}")
    if axes is not None:
        check_object(axes, "AthleteAxes", "axes", call="motion.athlete_axes()")
    known = motion.athlete_axes() if axes is None else axes
    given = {name: getattr(known, name) for name in ("lateral", "longitudinal", "somersault", "up")}
    times = _times_within_steps(motion)
    somersault, _, twist = motion.somersault_tilt_twist(times, **given)
    lowest, when = least_over(
        lambda at: -np.abs(motion.somersault_tilt_twist(at, **given)[1]), motion.deformation.breaks
    )
    try:
        somersault_rate, _, twist_rate = motion.somersault_rates(times, **given)
        rates = float(np.abs(somersault_rate).max()), float(np.abs(twist_rate).max())
    except ChartPoleError:
        rates = None, None
    return AthleteTurns(
        somersaults=float(somersault[-1] - somersault[0]) / _TURN,
        twists=float(twist[-1] - twist[0]) / _TURN,
        largest_tilt=-lowest,
        tilt_time=when,
        somersault_rate=rates[0],
        twist_rate=rates[1],
        error=float(motion.somersault_errors(when, **given)[0]) / _TURN,
        axes=known,
    )


def turn_counts(motion: Motion, split: PhaseSplit) -> TurnCounts:
    """Return the turns of one motion about its momentum and, where links are named left and right, an athlete's counts.

    Parameters
    ----------
    split : of this motion

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.0, 0.0, 3.0 * 2.5 * np.pi])
    >>> print(f"{sp.turn_counts(motion, sp.split(motion)).about_momentum:.6f}")
    5.000000
    """
    check_object(motion, "Motion", "motion")
    check_object(split, "PhaseSplit", "split")
    about = float(split.montgomery_phase) / _TURN if split.has_phase else 0.0
    error = max(float(split.error_estimates.montgomery_phase), float(motion.error_estimate)) / _TURN
    axes = motion.counted_axes() if split.has_phase else None
    athlete = None if axes is None else athlete_turns(motion, axes)
    number, axis = _rotation_in_plane(motion)
    return TurnCounts(about, athlete, error if athlete is None else max(error, athlete.error), number, axis)


def count_slopes(motion: Motion) -> Array | None:
    """Return derivatives of somersaults and twists by turns of the last attitude, inertial, and the first, base axes.

    (2, 6) [revolutions per rad], about the same axes; None where nothing is counted or the tilt is a right angle.
    """
    check_object(motion, "Motion", "motion")
    axes = motion.counted_axes()
    if axes is None:
        return None
    space, body = axes.matrices
    try:
        slopes = athlete_slopes(*tilt_and_twist(space.T @ motion.attitude([0.0, motion.duration]) @ body))
    except ChartPoleError:
        return None
    first, last = slopes[:, [0, 2]] @ body.T / _TURN
    return np.hstack([last @ motion.final_attitude.T, -first])


def _times_within_steps(motion: Motion) -> Array:
    ends = motion.solution.times
    return np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS).ravel(), ends[-1])


def _rotation_in_plane(motion: Motion) -> tuple[float | None, Array | None]:
    """Revolutions about the fixed axis of a motion in a plane, and that axis; None for others."""
    times = _times_within_steps(motion)
    spins = motion.angular_velocity(times)
    fastest = spins[int(np.argmax(np.linalg.norm(spins, axis=1)))]
    speed = float(np.linalg.norm(fastest))
    if speed == 0.0:
        return None, None
    axis = fastest / speed
    # The axis, not its opposite, has a positive largest component.
    axis = axis * np.sign(axis[int(np.argmax(np.abs(axis)))])
    off = np.linalg.norm(spins - (spins @ axis)[:, None] * axis, axis=1).max()
    if off > (_FIXED + float(motion.error_estimate)) * speed:
        return None, None
    quaternions = motion.quat_xyzw(times)
    turned = so3.quat_product(so3.quat_inverse(quaternions[0]), quaternions)
    angle = 2.0 * np.unwrap(np.arctan2(turned[:, :3] @ axis, turned[:, 3]), period=np.pi)
    return float(angle[-1] - angle[0]) / _TURN, axis
