"""Presentation of a motion: angles, table, figure, page in three dimensions, card."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_keywords, times_argument
from ..arrays import Array, finite_array
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, card_html, card_text, error_text, momentum_text, numbers
from ..errors import MissingExtraError, ShapeError, ShapePhaseError
from ..offers import offered
from ._athlete_axes import AthleteAxes, athlete_axes
from .attitude_angles import (
    Chart,
    EulerAngles,
    RotationVectors,
    athlete_slopes,
    continued_angles,
    euler_chart,
    followed,
)
from .motion_record import write_table

_COLUMNS = (
    "time", "qx", "qy", "qz", "qw", "omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s",
    "base_x_m", "base_y_m", "base_z_m",
)  # fmt: skip
_ROWS = 201  # of a table, by default
_PARTS = 8  # of a step, at which angles are continued: a step turns by less than a radian or so


def base_positions(motion: Any, t: ArrayLike, start: ArrayLike, velocity: ArrayLike, gravity: ArrayLike) -> Array:
    """Positions of the base origin, inertial axes, see `Motion.base_position`: times (...) -> batch + (..., 3) [m]."""
    times = times_argument(t, motion.duration)
    point, speed, pull = (
        finite_array(value, name, (3,))
        for value, name in ((start, "start"), (velocity, "velocity"), (gravity, "gravity"))
    )
    centre = point + times[..., None] * speed + 0.5 * times[..., None] ** 2 * pull
    return centre - so3.apply(motion.attitude(times), motion.deformation.centre_of_mass(times))


class MotionViews:
    """Mixin with the presentation methods of `Motion`."""

    __repr__, _repr_html_ = card_text, card_html

    def rotation_vector(self: Any, t: ArrayLike) -> Array:
        """Attitude as a rotation vector, continued past half turns: times (...) -> batch + (..., 3) [rad].

        It begins within a half turn. It is continued along the motion itself, so its value at a time does not depend on
        the other times. Where the attitude returns to the identity after whole turns, to 1e-10 rad or its error
        estimate, the axis is kept.
        """
        return self._continued(t, RotationVectors())

    def euler_angles(self: Any, t: ArrayLike, sequence: str = "ZYX") -> Array:
        """Attitude as Euler angles of any sequence, continuous in time: times (...) -> batch + (..., 3) [rad].

        R is the product of turns about the axes of `sequence` in their order: capitals are body axes (intrinsic), small
        letters inertial ones (extrinsic). The outer angles begin in (-pi, pi]. All are continued along the motion
        itself, with finer steps near gimbal lock, so their values at a time do not depend on the other times. A motion
        that passes through gimbal lock, to 1e-10 rad or the attitude's error estimate, continues straight: the middle
        angle goes on beyond its end.

        Raises UnknownNameError for another sequence.

        sequence : three of X, Y, Z, or of x, y, z, no two neighbours alike; "ZYX" is yaw, pitch, roll
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
        """Axes by which `somersault_tilt_twist` counts, with the source of each; `print` shows them in words.

        Each may be given, by its name ("x" to "-z") or as three numbers. The others are found from the body, whatever
        way the laboratory's axes point.

        Parameters
        ----------
        lateral : from the right side to the left, base axes; its part across the longitudinal axis is used. None: by
            the places of links named left and right; for a body without such links the axis of the somersault as it
            lies in the body at the start, so that tilt and twist begin with 0
        longitudinal : from the feet to the head, base axes. None: the axis of least inertia of the whole body at its
            straightest in this motion, where the least moment is the smallest part of the next one
        somersault : inertial axes; its horizontal part is used. None: the horizontal part of the momentum; where that
            is smaller than the vertical part, or without momentum, the lateral axis at the start. It points to the left
            of the body at the start, so a forward somersault counts up, a backward one down
        up : inertial axes. None: against the fall of the recording, else "z"

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
        """Somersault, tilt and twist of an athlete: times (...) -> batch + (...) each [rad].

        The somersault is a turn about a horizontal axis in space, the twist about the longitudinal axis of the body,
        and the tilt about the frontal axis between them. Somersault and twist begin within half a turn, and all are
        continuous in time; divided by 2 pi they are revolutions.

        Source: Yeadon 1990, J. Biomech. 23, 59: angles in the order somersault, tilt, twist.

        Parameters
        ----------
        lateral, longitudinal, somersault, up : as for `athlete_axes`

        Raises
        ------
        UnknownNameError, ShapeError, WrongObjectError
            For the axes that `athlete_axes` refuses.

        Examples
        --------
        >>> dive = sp.examples.full_dive()
        >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
        >>> somersault, tilt, twist = (np.ptp(angle) for angle in motion.somersault_tilt_twist([0.0, motion.duration]))
        >>> print(f"{somersault / (2 * np.pi):.4f} somersaults, {twist / (2 * np.pi):.4f} twists")
        1.5000 somersaults, 1.0000 twists
        """
        axes = athlete_axes(self, lateral, longitudinal, somersault, up)
        space, body = axes.matrices
        angles = self._continued(t, EulerAngles("YXZ"), (so3.quat_from_matrix(space), so3.quat_from_matrix(body)))
        return angles[..., 0], angles[..., 1], angles[..., 2]

    def somersault_rates(
        self: Any,
        t: ArrayLike,
        *,
        lateral: str | ArrayLike | None = None,
        longitudinal: str | ArrayLike | None = None,
        somersault: str | ArrayLike | None = None,
        up: str | ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Rates of somersault, tilt and twist: times (...) -> batch + (...) each [rad/s].

        Parameters
        ----------
        lateral, longitudinal, somersault, up : as for `athlete_axes`

        Raises
        ------
        ChartPoleError
            Where the tilt is a right angle, to 1e-6 rad: somersault and twist are about one axis there.
        UnknownNameError, ShapeError, WrongObjectError
            For the axes that `athlete_axes` refuses.

        Examples
        --------
        >>> dive = sp.examples.full_dive()
        >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
        >>> somersault, tilt, twist = motion.somersault_rates(0.0)
        >>> print(f"{somersault:.3f} {abs(tilt):.3f} {abs(twist):.3f} rad/s")
        5.705 0.000 0.000 rad/s
        """
        axes = {"lateral": lateral, "longitudinal": longitudinal, "somersault": somersault, "up": up}
        _, tilt, twist = self.somersault_tilt_twist(t, **axes)
        _, body = self.athlete_axes(**axes).matrices
        spin = so3.apply(np.swapaxes(body, -1, -2), self.angular_velocity(t))
        turning, tilting, twisting = np.moveaxis(so3.apply(athlete_slopes(tilt, twist), spin), -1, 0)
        return turning, tilting, twisting

    def somersault_errors(
        self: Any,
        t: ArrayLike,
        *,
        lateral: str | ArrayLike | None = None,
        longitudinal: str | ArrayLike | None = None,
        somersault: str | ArrayLike | None = None,
        up: str | ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Numerical errors of somersault, tilt and twist, by the attitude's estimate: -> batch + (...) each [rad].

        Towards 90 degrees of tilt an error of the attitude turns somersault and twist by more, half a turn at most.

        Parameters
        ----------
        lateral, longitudinal, somersault, up : as for `athlete_axes`

        Examples
        --------
        >>> dive = sp.examples.full_dive()
        >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
        >>> bool(max(motion.somersault_errors(1.0)) < 1e-8)
        True
        """
        _, tilt, _ = self.somersault_tilt_twist(
            t, lateral=lateral, longitudinal=longitudinal, somersault=somersault, up=up
        )
        error = np.reshape(self.error_estimate, (*self.batch, *([1] * (tilt.ndim - len(self.batch)))))
        outer = np.minimum(error / np.maximum(np.abs(np.cos(tilt)), np.finfo(np.float64).tiny), np.pi)
        return outer, np.broadcast_to(error, tilt.shape).copy(), outer.copy()

    def counted_axes(self: Any) -> AthleteAxes | None:
        """Axes of `athlete_axes` where somersaults are counted by default, else None.

        They are counted where the body has links named left and right, and a momentum turns it.

        Examples
        --------
        >>> dive = sp.examples.full_dive()
        >>> sp.reconstruct(dive.deformation, dive.momentum).counted_axes().by_links
        True
        """
        if not np.any(self.momentum):
            return None
        try:
            axes = self.athlete_axes()
        except ShapePhaseError:
            return None
        return axes if axes.by_links else None

    def write_csv(self: Any, path: str | os.PathLike[str], times: ArrayLike | None = None, **fall: ArrayLike) -> None:
        """Write a time series: attitude (x y z w, one sign throughout), angular velocity, base position.

        Raises ShapeError if the motion is a batch.

        times : (N,) [s]; None: 201 even times
        fall : start, velocity, gravity as in `base_position`
        """
        check_keywords(fall, MotionViews.write_csv)
        write_table(path, self._columns(times, fall))

    def to_dataframe(self: Any, times: ArrayLike | None = None, **fall: ArrayLike) -> Any:
        """Time series of `write_csv` as a pandas DataFrame.

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
        """Base, joints and their rates in time as an xarray Dataset (`exports.motion_dataset`).

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
        kind : "somersault", "phases", "momentum", "attitude", "shape", "torques", "inertia", "internal_momentum",
            "energy", "loop", "curvature", "reach", "contributions" or "segment_momentum";
            None: the phases, without momentum the attitude
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

    def segment_momentum(self: Any, times: ArrayLike | None = None) -> Any:
        """Angular momentum about the centre of mass, whole and by link, inertial axes (`shapephase.segment_momentum`).

        Parameters
        ----------
        times : (N,) [s]; None: 201 even times

        Examples
        --------
        >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
        >>> sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]).segment_momentum().links
        ('front', 'rear')
        """
        return offered("Motion.segment_momentum")(self, times=times)

    def view(self: Any, **options: Any) -> Any:
        """Return a page of the motion in three dimensions, to write, show or film; a notebook displays it.

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
        """Columns of the table by name."""
        if self.batch:
            raise ShapeError(f"a table holds one motion, this is a batch of {self.batch}; reconstruct one of them")
        t = np.linspace(0.0, self.duration, _ROWS) if times is None else finite_array(times, "times", (None,), unit="s")
        quaternions = self.quat_xyzw(t)
        flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0, -1.0, 1.0)
        quaternions[1:] *= np.cumprod(flips)[:, None]
        columns = [t, *quaternions.T, *self.angular_velocity(t).T, *self.base_position(t, **fall).T]
        return dict(zip(_COLUMNS, columns, strict=True))

    @cached_property
    def _last_followed(self: Any) -> dict[Any, tuple[Array, Array]]:
        """The curve of the last chart: whoever looks for an extreme asks for the same angles many times."""
        return {}

    def _continued(self: Any, t: ArrayLike, chart: Chart, seen: tuple[Array, Array] | None = None) -> Array:
        """Chart coordinates of each attitude, continued from the start: times (...) -> batch + (..., 3).

        `seen`: quaternions of the axes in space and in the body to which the coordinates refer.
        """
        times = times_argument(t, self.duration)
        ends = self.solution.times
        between = ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS

        def quaternions(sampled: Array) -> Array:
            attitude = self.quat_xyzw(sampled)
            if seen is not None:
                space, body = (axes[..., None, :] for axes in seen)
                attitude = so3.quat_product(so3.quat_product(so3.quat_inverse(space), attitude), body)
            return attitude.reshape(-1, len(sampled), 4)

        error = float(np.max(self.error_estimate, initial=0.0))
        key = (chart, seen if seen is None else tuple(axes.tobytes() for axes in seen))
        curve = self._last_followed.get(key)
        if curve is None:
            curve = followed(quaternions, np.append(between.ravel(), ends[-1]), chart, error)
            self._last_followed.clear()
            self._last_followed[key] = curve
        angles = continued_angles(quaternions, curve, times.ravel(), chart, error)
        return angles.reshape(*self.batch, *times.shape, 3)
