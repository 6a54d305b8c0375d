"""How a motion is looked at: as angles, as a table, as a figure, in three dimensions, as a card."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_keywords, times_argument
from ..arrays import Array, finite_array
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, card_html, card_text, error_text, momentum_text, numbers
from ..errors import MissingExtraError, ShapeError
from ..offers import offered
from ._athlete_axes import AthleteAxes, athlete_axes
from .attitude_angles import Chart, EulerAngles, RotationVectors, continued_angles, euler_chart
from .motion_record import write_table

_COLUMNS = (
    "time", "qx", "qy", "qz", "qw", "omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s",
    "base_x_m", "base_y_m", "base_z_m",
)  # fmt: skip
# Rows of a table.
_ROWS = 201
# Parts of a step between which angles are continued at least: no turn of a step is missed.
_PARTS = 8


class MotionViews:
    """What a `Motion` shows of itself; the motion is `self`, whose class is further down the line."""

    __repr__, _repr_html_ = card_text, card_html

    def rotation_vector(self: Any, t: ArrayLike) -> Array:
        """The attitude as a rotation vector, continued past half turns: times (...) -> batch + (..., 3) [rad].

        It begins within a half turn, and may become longer than that. It is continued along the motion itself, so what
        it is at a time does not depend on the other times. Where the attitude comes back to the identity after whole
        turns, to 1e-10 rad or its error estimate, every axis will do, and it goes straight on.
        """
        return self._continued(t, RotationVectors())

    def euler_angles(self: Any, t: ArrayLike, sequence: str = "ZYX") -> Array:
        """The attitude as Euler angles of any sequence, continuous in time: times (...) -> batch + (..., 3) [rad].

        R is the product of turns about the axes of `sequence` in their order: capitals are axes of the body as it has
        turned so far (intrinsic), small letters inertial ones (extrinsic). The outer angles begin in (-pi, pi]. All are
        continued along the motion itself, as finely as it needs near the ends of the middle one, where the gimbals lock
        and the outer ones turn fast: what they are at a time does not depend on the other times. A motion that goes
        through such an end, to 1e-10 rad or the attitude's error estimate, goes straight through: the middle angle goes
        on beyond it.

        Parameters
        ----------
        sequence : three of X, Y, Z, or of x, y, z, no two neighbours alike; "ZYX" is yaw, pitch, roll

        Raises
        ------
        UnknownNameError
            For another sequence.
        """
        return self._continued(t, euler_chart(sequence))

    def athlete_axes(
        self: Any,
        *,
        lateral: str | ArrayLike | None = None,
        longitudinal: str | ArrayLike | None = None,
        somersault: str | ArrayLike | None = None,
        up: str | ArrayLike | None = None,
    ) -> AthleteAxes:
        """The axes by which `somersault_tilt_twist` counts, and where each comes from; `print` says it in words.

        Each may be given, by its name ("x" to "-z") or as three numbers. The athlete's own are found otherwise,
        whatever way the laboratory's axes point.

        Parameters
        ----------
        lateral : from the right side to the left, base axes; of what is given the part across the longitudinal one.
            None: by the places of links called left and right; of a body without such links as the axis of the
            somersault lies in it at the start, so that tilt and twist begin with 0
        longitudinal : from the feet to the head, base axes. None: the axis of least inertia of the whole body at its
            straightest in this motion, where the least moment is the smallest part of the next one
        somersault : inertial axes; of what is given the horizontal part. None: that of the momentum; where it is
            smaller than the upright part, or without momentum, of the lateral axis at the start. It points to the left
            of the body at the start, so a forward somersault counts up, a backward one down
        up : inertial axes. None: as the recording fell from which the motion is, else "z"

        Raises
        ------
        UnknownNameError, ShapeError
            For other axes, or a lateral one along the longitudinal one.
        WrongObjectError
            If an axis cannot be found and has to be given; for a deformation seen from a gauge.

        Examples
        --------
        >>> dive = sp.examples.full_dive()
        >>> print(sp.reconstruct(dive.deformation, dive.momentum).athlete_axes().somersault.round(6))
        [0. 1. 0.]
        """
        return athlete_axes(self, lateral, longitudinal, somersault, up)

    def somersault_tilt_twist(
        self: Any,
        t: ArrayLike,
        *,
        lateral: str | ArrayLike | None = None,
        longitudinal: str | ArrayLike | None = None,
        somersault: str | ArrayLike | None = None,
        up: str | ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Somersault, tilt and twist as biomechanists count them: times (...) -> batch + (...) each [rad].

        The somersault is a turn about a horizontal axis in space, the twist about the longitudinal axis of the body,
        and the tilt about the axis to its front between them. Somersault and twist begin within half a turn, and all go
        on without a jump, as `euler_angles`; in revolutions they are divided by 2 pi.

        Parameters
        ----------
        lateral, longitudinal, somersault, up : as for `athlete_axes`, which says what they are where they are not given

        Raises
        ------
        UnknownNameError, ShapeError, WrongObjectError
            As `athlete_axes`.

        Notes
        -----
        Source: Yeadon 1990, J. Biomech. 23, 59: angles in the order somersault, tilt, twist.

        Examples
        --------
        >>> dive = sp.examples.full_dive()
        >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
        >>> somersault, tilt, twist = (np.ptp(one) for one in motion.somersault_tilt_twist([0.0, motion.duration]))
        >>> print(f"{somersault / (2 * np.pi):.4f} somersaults, {twist / (2 * np.pi):.4f} twists")
        1.5000 somersaults, 1.0000 twists
        """
        axes = athlete_axes(self, lateral, longitudinal, somersault, up)
        # Columns: to the front, to the left, up.
        here = np.stack([axes.frontal, axes.lateral, np.broadcast_to(axes.longitudinal, axes.lateral.shape)], axis=-1)
        upward = np.broadcast_to(axes.up, axes.somersault.shape)
        there = np.stack([np.cross(axes.somersault, upward), axes.somersault, upward], axis=-1)
        angles = self._continued(t, EulerAngles("YXZ"), (so3.quat_from_matrix(there), so3.quat_from_matrix(here)))
        return angles[..., 0], angles[..., 1], angles[..., 2]

    def write_csv(self: Any, path: str | os.PathLike[str], times: ArrayLike | None = None, **fall: ArrayLike) -> None:
        """Write a time series: attitude (x y z w, one sign throughout), angular velocity, base position.

        Parameters
        ----------
        times : (N,) [s]; None: 201 even times
        fall : start, velocity, gravity as in `base_position`

        Raises
        ------
        ShapeError
            If the motion is a batch.
        """
        check_keywords(fall, MotionViews.write_csv)
        write_table(path, self._columns(times, fall))

    def to_dataframe(self: Any, times: ArrayLike | None = None, **fall: ArrayLike) -> Any:
        """The time series of `write_csv` as a table of pandas.

        Parameters
        ----------
        times, fall : as for `write_csv`

        Raises
        ------
        ShapeError
            If the motion is a batch.
        MissingExtraError
            Without pandas.
        """
        check_keywords(fall, MotionViews.to_dataframe)
        try:
            from pandas import DataFrame
        except ImportError:
            raise MissingExtraError("a table needs pandas; install it with: pip install pandas") from None
        return DataFrame(self._columns(times, fall))

    def to_xarray(self: Any, times: ArrayLike | None = None, **fall: ArrayLike) -> Any:
        """Base, joints and their rates in time as a data set of xarray, as `exports.motion_dataset` makes it.

        Parameters
        ----------
        times, fall : as for `write_csv`

        Raises
        ------
        ShapeError
            If the motion is a batch.
        MissingExtraError
            Without xarray.
        """
        check_keywords(fall, MotionViews.to_xarray)
        return offered("Motion.to_xarray")(self, times, **fall)

    def plot(self: Any, kind: str | None = None, *, ax: Any = None, gauge: Any = "horizontal") -> Any:
        """Draw one of the figures of `plots.FIGURES` and return its Matplotlib axes.

        Parameters
        ----------
        kind : "phases", "momentum", "attitude", "shape", "torques", "inertia", "internal_momentum" or "energy"; None:
            the phases, without momentum the attitude
        ax : axes to draw into; None: those of a new figure one column wide, which is `axes.figure`
        gauge : as for `split`

        Raises
        ------
        MissingExtraError
            Without Matplotlib.
        UnknownNameError, ShapeError
            For another kind, or one that needs a momentum where there is none; if the motion is a batch.
        """
        return offered("Motion.plot")(self, kind, ax=ax, gauge=gauge)

    def view(self: Any, **options: Any) -> Any:
        """Page of the motion in three dimensions, to write, show or film; a notebook displays it.

        Parameters
        ----------
        options : of `shapephase.view`
        """
        return offered("Motion.view")(self, **options)

    def _card(self: Any) -> Card:
        rows = [
            ("duration", numbers(self.duration, "s")),
            ("momentum", momentum_text(self.momentum)),
            ("error estimate", error_text(self.error_estimate)),
            ("method", f"{self.method}, tolerance {self.tolerance:g} rad, {self.evaluations} evaluations"),
        ]
        title = f"Motion: {self.deformation.label}"
        if self.batch:
            return Card(title, rows)
        times = np.linspace(0.0, self.duration, MOST_POINTS)
        vectors = self.rotation_vector(times)
        rows.insert(2, ("final attitude", f"{numbers(self.quat_xyzw(self.duration))}, x y z w"))
        rows.insert(3, ("rotation vector", f"{numbers(np.degrees(vectors[-1]))} deg at the end"))
        return Card(title, rows, curves_picture(vectors, "rotation vector in time"))

    def _columns(self: Any, times: ArrayLike | None, fall: dict[str, ArrayLike]) -> dict[str, Array]:
        """The columns of a table by their names."""
        if self.batch:
            raise ShapeError(f"a table holds one motion, this is a batch of {self.batch}; reconstruct one of them")
        t = np.linspace(0.0, self.duration, _ROWS) if times is None else finite_array(times, "times", (None,), unit="s")
        quaternions = self.quat_xyzw(t)
        flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0, -1.0, 1.0)
        quaternions[1:] *= np.cumprod(flips)[:, None]
        columns = [t, *quaternions.T, *self.angular_velocity(t).T, *self.base_position(t, **fall).T]
        return dict(zip(_COLUMNS, columns, strict=True))

    def _continued(self: Any, t: ArrayLike, chart: Chart, seen: tuple[Array, Array] | None = None) -> Array:
        """Three numbers of each attitude, continued from the start: times (...) -> batch + (..., 3).

        `seen`: quaternions of axes in space and in the body, by which the attitude is seen.
        """
        times = times_argument(t, self.duration)
        ends = self.solution.times
        between = ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS

        def quaternions(some: Array) -> Array:
            found = self.quat_xyzw(some)
            if seen is not None:
                there, here = (one[..., None, :] for one in seen)
                found = so3.quat_product(so3.quat_product(so3.quat_inverse(there), found), here)
            return found.reshape(-1, len(some), 4)

        every = np.append(between.ravel(), ends[-1])
        error = float(np.max(self.error_estimate, initial=0.0))
        found = continued_angles(quaternions, every, times.ravel(), chart, error)
        return found.reshape(*self.batch, *times.shape, 3)
