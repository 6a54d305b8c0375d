"""How a motion is looked at: as angles, as a table, as a figure, in three dimensions, as a card."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_keywords, times_argument
from ..arrays import Array, finite_array
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, card_html, card_text, error_text, momentum_text, numbers
from ..errors import MissingExtraError, ShapeError
from ..offers import offered
from .attitude_angles import continued_rotation_vectors, euler_angles, somersault_tilt_twist
from .motion_record import write_table

_COLUMNS = (
    "time", "qx", "qy", "qz", "qw", "omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s",
    "base_x_m", "base_y_m", "base_z_m",
)  # fmt: skip
# Rows of a table.
_ROWS = 201
# Parts of a step between which angles are continued: no turn of a step is missed.
_PARTS = 8


class MotionViews:
    """What a `Motion` shows of itself; the motion is `self`, whose class is further down the line."""

    __repr__, _repr_html_ = card_text, card_html

    def rotation_vector(self: Any, t: ArrayLike) -> Array:
        """The attitude as a rotation vector, continued past half turns: times (...) -> batch + (..., 3) [rad].

        It begins within a half turn, and may become longer than that. Only where the attitude comes back to the
        identity after whole turns it may jump: there every axis will do.
        """
        return self._continued(t, continued_rotation_vectors)

    def euler_angles(self: Any, t: ArrayLike, sequence: str = "ZYX") -> Array:
        """The attitude as Euler angles of any sequence, continuous in time: times (...) -> batch + (..., 3) [rad].

        R is the product of turns about the axes of `sequence` in their order: capitals are axes of the body as it has
        turned so far (intrinsic), small letters inertial ones (extrinsic). The first angle begins in (-pi, pi], and
        where the middle one reaches its end (the gimbals lock) the other continuation is taken.

        Parameters
        ----------
        sequence : three of X, Y, Z, or of x, y, z, no two neighbours alike; "ZYX" is yaw, pitch, roll

        Raises
        ------
        UnknownNameError
            For another sequence.
        """
        return self._continued(t, lambda attitudes: euler_angles(attitudes, sequence))

    def somersault_tilt_twist(
        self: Any, t: ArrayLike, *, lateral: str = "x", longitudinal: str = "z"
    ) -> tuple[Array, Array, Array]:
        """Somersault, tilt and twist as biomechanists count them: times (...) -> batch + (...) each [rad].

        The somersault is a turn about the lateral axis as it is in space, the twist about the longitudinal axis of the
        body, and the tilt about the third between them. All begin within half a turn and go on without a jump; in
        revolutions they are divided by 2 pi.

        Parameters
        ----------
        lateral : "x", "y" or "z", the body's axis from side to side
        longitudinal : the one from feet to head

        Raises
        ------
        UnknownNameError
            For other axes, or twice the same.

        Notes
        -----
        Source: Yeadon 1990, J. Biomech. 23, 59: angles in the order somersault, tilt, twist.
        """
        angles = self._continued(t, lambda attitudes: somersault_tilt_twist(attitudes, lateral, longitudinal))
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
        """Draw one of the figures of `plotting.FIGURES` and return its Matplotlib axes.

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
        """Show the motion in three dimensions, as `shapephase.view` does.

        Parameters
        ----------
        options : of `shapephase.view`

        Raises
        ------
        MissingExtraError
            Without viser.
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

    def _continued(self: Any, t: ArrayLike, angles: Any) -> Array:
        """Three numbers of each attitude, continued from the start through all steps: (...) -> batch + (..., 3)."""
        times = times_argument(t, self.duration)
        ends = self.solution.times
        between = ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS
        every = np.union1d(np.append(between.ravel(), ends[-1]), times.ravel())
        attitudes = self.attitude(every).reshape(-1, len(every), 3, 3)
        found = np.array([angles(one) for one in attitudes])[:, np.searchsorted(every, times.ravel())]
        return found.reshape(*self.batch, *times.shape, 3)
