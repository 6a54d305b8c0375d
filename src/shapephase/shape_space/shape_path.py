"""Shapes as functions of time: the joint motions that drive everything else."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import (
    breaks_argument,
    check_flag,
    check_function,
    made_by,
    positive_argument,
    times_argument,
)
from ..arrays import Array, read_only
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, card_html, card_text, frozen, numbers
from ..errors import OpenPathError, ShapeError, ShapePhaseError, TrajectoryError, unknown_name
from ..integrator.smoothness import Smoothness
from ..letters import value_text
from .curves import (
    CLOSED,
    Curve,
    Function,
    Interpolation,
    Joined,
    Multiplied,
    PiecewisePolynomial,
    Reordered,
    Repeated,
    Retimed,
    Swings,
    exact_accelerations,
    returned_pair,
    swings_of,
)
from .interpolation import (
    ball_columns,
    circle_coefficients,
    factors_between,
    fourier_curve,
    path_joint_names,
    rest_to_rest_curve,
    same_shape,
    sample_arguments,
    spline_curve,
)
from .path_series import SAME_TIME, resolved_accelerations, spline_times
from .scan.function_scan import FunctionScan, check_rates, path_function
from .scan.scanning import scanned

_WHOLE_TURN = 2.0 * np.pi


class SampleOrigin(Protocol):
    """Steps from recorded samples, closed, smoothed or resampled, to values at the knots of a path."""

    @property
    def samples(self) -> Array:
        """Samples as they were recorded: (N, n) [rad or m]."""
        ...

    @property
    def bias(self) -> Array:
        """Known bias of smoothing: (knots, n) [rad or m]."""
        ...

    def by_samples(self, by_values: Array, /) -> Array:
        """Convert m derivatives by the values at the knots to those by the samples: (knots, m, n) -> (N, m, n)."""
        ...

    def bias_by_samples(self, by_values: Array, /) -> Array:
        """Convert m derivatives by the bias at the knots to those by the samples: (knots, m, n) -> (N, m, n)."""
        ...

    def path(self, samples: Array, /) -> ShapePath:
        """Return the path that the same steps make of other samples (N, n)."""
        ...


@made_by("read_shape_path(file, body), or ShapePath.circle, fourier, spline, waypoints or function")
@frozen
class ShapePath:
    """A motion of the joints, r(t) on [0, duration].

    Made by `circle`, `fourier`, `spline`, `waypoints` or `function`, or read from a file. Between two neighbouring
    `breaks` the path is smooth; the breaks hold 0 and `duration`.

    Attributes
    ----------
    curve : shapes and rates at an array of times
    duration : [s]
    breaks : (M,) ascending, first 0, last `duration` [s]
    n_shape : number of joints
    joint_names : the joints in the order of the columns, or None where the path belongs to no body in particular
    loops : the path is its first `duration / loops` seconds, this many times
    sha256 : of the file it was read from, whatever was done to it since; None without a file
    record : how it was read and what was done to it then, `RecordedMotion.record`; None without a file
    origin : how it follows from recorded samples; None: these are the values at its knots, or there are none

    Examples
    --------
    >>> circle = sp.ShapePath.fourier([0.0, 0.0], [[0.5], [0.0]], [[0.0], [0.5]], 2.0)
    >>> circle.shape(0.5).round(12).tolist(), circle.duration
    ([0.0, 0.5], 2.0)
    """

    curve: Curve
    duration: float
    breaks: Array
    n_shape: int
    joint_names: tuple[str, ...] | None = None
    loops: int = 1
    sha256: str | None = None
    record: Mapping[str, Any] | None = None
    origin: SampleOrigin | None = None

    __repr__, _repr_html_ = card_text, card_html

    @staticmethod
    def fourier(
        mean: ArrayLike,
        cosines: ArrayLike,
        sines: ArrayLike,
        duration: float,
        *,
        joint_names: Sequence[str] | None = None,
    ) -> ShapePath:
        """Closed loop r = mean + sum_k a_k cos(2 pi k t/T) + b_k sin(2 pi k t/T), k = 1 ... K.

        Parameters
        ----------
        mean : (n,) [rad or m]
        cosines, sines : (n, K), the a_k and b_k [rad or m]
        duration : T [s]
        joint_names : n names, to be matched with a body's by name
        """
        curve = fourier_curve(mean, cosines, sines, positive_argument(duration))
        return ShapePath(
            curve,
            curve.period,
            breaks=np.array([0.0, curve.period]),
            n_shape=len(curve.mean),
            joint_names=path_joint_names(joint_names, len(curve.mean)),
            # Harmonics that are all multiples of one number make a shorter loop, repeated.
            loops=max(1, int(np.gcd.reduce(curve.occupied))),
        )

    @staticmethod
    def circle(
        body: Body | ParticleBody | str,
        first: str,
        second: str,
        radius: float,
        *,
        centre: ArrayLike | None = None,
        duration: float = 1.0,
    ) -> ShapePath:
        """Circle of two joints, from the first towards the second; the others rest.

        Parameters
        ----------
        first, second : joints of the body, both in rad or both in m; the circle begins at the centre + radius of the
            first
        radius : [rad or m]; the body turns by about minus pi radius^2 times the curvature of the two joints
        centre : (n,) its middle, and where the others rest; None: the neutral shape
        duration : of one round [s]

        Raises
        ------
        UnknownNameError, ShapeError
            For joints that the body does not have, or of different units.
        TrajectoryError
            If the circle leaves the limits of a joint; the message has the largest radius that fits.

        Examples
        --------
        >>> loop = sp.ShapePath.circle("cat", "waist_pitch", "waist_yaw", 0.5)
        >>> print(f"{np.degrees(sp.so3.angle(sp.holonomy('cat', loop))):.3f} degrees")
        32.240 degrees
        """
        owner = as_body_or_particles(body)
        mean, cosines, sines = circle_coefficients(owner, (first, second), radius, centre)
        return ShapePath.fourier(mean, cosines, sines, duration, joint_names=owner.joint_names)

    @staticmethod
    def spline(
        times: ArrayLike, shapes: ArrayLike, periodic: bool | None = None, *, joint_names: Sequence[str] | None = None
    ) -> ShapePath:
        """C2 cubic spline through samples; its knots are its breaks.

        Parameters
        ----------
        times : (N,) ascending [s]; the path starts at 0, so times are shifted
        shapes : (N, n) [rad or m]; quaternions of ball joints, known by their names, get the sign that is nearer to the
            sample before
        periodic : smooth where the end meets the start; None: when the last sample equals the first to 1e-9.
            Otherwise the ends are not-a-knot.

        Raises
        ------
        TrajectoryError
            If times do not ascend, there are fewer than two samples, or a periodic path does not close.
        """
        check_flag(periodic, "periodic", allow_none=True)
        t, r, balls = sample_arguments(times, shapes, joint_names)
        return _piecewise(spline_curve(t, r, balls, periodic), joint_names)

    @staticmethod
    def waypoints(times: ArrayLike, shapes: ArrayLike, *, joint_names: Sequence[str] | None = None) -> ShapePath:
        """Straight moves from rest to rest through waypoints, each by the quintic of least jerk.

        r = r_i + (r_(i+1) - r_i) (10 s^3 - 15 s^4 + 6 s^5), s = (t - t_i)/(t_(i+1) - t_i).
        Parameters and errors like `spline`.
        """
        t, r, _ = sample_arguments(times, shapes, joint_names)
        return _piecewise(rest_to_rest_curve(t, r), joint_names)

    @staticmethod
    def function(
        f: Callable[[Array], tuple[ArrayLike, ArrayLike]],
        duration: float,
        breaks: ArrayLike = (),
        *,
        joint_names: Sequence[str] | None = None,
    ) -> ShapePath:
        """Path given by a function of times (N,) that returns shapes (N, n) and rates (N, n).

        Before a body follows it, the path is sampled once at some 5,500 times (`scan`). Features wider than 1/2,000 of
        the duration are found; a narrower one that leaves the shape as it was has to be declared as a break. Kinks are
        located and taken as breaks, with a warning.

        Parameters
        ----------
        breaks : interior times where a derivative jumps [s]; the function is evaluated just inside them

        Raises
        ------
        TrajectoryError
            If the rates are not the derivatives of the shapes (checked at a few times, and again by the scan).
        ShapeError
            If the function returns another shape than (N, n).
        """
        check_function(f, "f", "a function of times that gives shapes and rates")
        period = positive_argument(duration)
        edges = breaks_argument(breaks, period)
        start, _ = returned_pair(f(np.zeros(1)))
        if start.ndim != 2 or start.shape[0] != 1:
            raise ShapeError(f"the function must return shapes (N, n) for times (N,); for N = 1 it gave {start.shape}")
        curve = Function(f, start.shape[1])
        path = ShapePath(curve, period, edges, start.shape[1], path_joint_names(joint_names, start.shape[1]))
        check_rates(curve, edges)
        return path

    def shape(self, t: ArrayLike) -> Array:
        """Shapes r(t): times (...) of [0, duration] -> (..., n) [rad or m]. Raises TrajectoryError outside."""
        return self._evaluated(t)[0]

    def rate(self, t: ArrayLike) -> Array:
        """Rates r'(t): times (...) of [0, duration] -> (..., n) [rad/s or m/s]. Raises TrajectoryError outside."""
        return self._evaluated(t)[1]

    def acceleration(self, t: ArrayLike) -> Array:
        """Accelerations r''(t): times (...) of [0, duration] -> (..., n) [rad/s^2 or m/s^2]; at a break the later one.

        They are exact, but for functions: there they follow from the rates that the scan resolved. Raises
        TrajectoryError outside, and the errors of `scan`.
        """
        times = times_argument(t, self.duration)
        accelerations = exact_accelerations(self.curve, times.ravel())
        if accelerations is None:
            accelerations = resolved_accelerations(self._scan.resolved, self.loops, times.ravel())
        return accelerations.reshape(*times.shape, self.n_shape)

    @cached_property
    def swings(self) -> Swings:
        """Largest number of swings between two breaks, and whether one loop goes on smoothly in the next."""
        most, smooth = swings_of(self.curve)
        return Swings(most / self.loops, len(self.breaks) == 2) if smooth and most is not None else Swings(most)

    @property
    def smoothness(self) -> Smoothness:
        """Smoothness of quantities that depend smoothly on shapes and rates."""
        if not self.n_shape:
            # A rigid body.
            return Smoothness(breaks=self.breaks[[0, -1]], oscillations=0.0)
        scan = self.scan
        breaks = self.breaks
        if scan is not None and len(scan.found_breaks):
            starts = self.duration / self.loops * np.arange(self.loops)
            breaks = np.union1d(breaks, (starts[:, None] + scan.found_breaks).ravel())
        return Smoothness(
            breaks=breaks,
            oscillations=self.swings.most,
            loops=self.loops,
            smooth_loop=self.swings.smooth_loop,
            resolved=scan.resolved if scan is not None else None,
        )

    @property
    def scan(self) -> FunctionScan | None:
        """Scan of the first loop of a path known only as a function; else None.

        Raises
        ------
        TrajectoryError
            If the shape jumps, or the rate is not its derivative; the message has time and joint.
        NoisyPathError, AccuracyNotReached
            If the values carry noise, or are too rough for thousands of panels.

        Warns
        -----
        UndeclaredBreakWarning
            For kinks that were not declared.
        """
        return self._scan if self.swings.most is None else None

    @cached_property
    def _scan(self) -> FunctionScan:
        period = self.duration / self.loops
        edges = self.breaks[self.breaks <= period * (1.0 + SAME_TIME)]
        return scanned(path_function(self.curve, self.n_shape, self.joint_names), edges)

    @property
    def gap(self) -> Array:
        """End of the path minus its start: (n,) [rad or m]; zero for a loop."""
        ends, _ = self.curve(np.array([0.0, self.duration]))
        return ends[1] - ends[0]

    def reversed(self) -> ShapePath:
        """The path backwards in time."""
        breaks = self.duration - self.breaks[::-1]
        breaks[[0, -1]] = 0.0, self.duration
        curve = Retimed(self.curve, self.duration)
        return replace(self, curve=curve, breaks=breaks, origin=None)

    def stretched(self, factor: float) -> ShapePath:
        """The path `factor` times as slowly."""
        scale = positive_argument(factor, "factor", "a number")
        duration = self.duration * scale
        breaks = self.breaks * scale
        breaks[-1] = duration
        curve = Retimed(self.curve, self.duration, scale)
        return replace(self, curve=curve, duration=duration, breaks=breaks, origin=None)

    def then(self, other: ShapePath) -> ShapePath:
        """Join another path to the end of this one.

        A start that differs from this path's end by whole turns of joints is shifted by them, so that the
        shape stays continuous; a quaternion of a ball joint is the same turn with another sign or length.

        Raises
        ------
        TrajectoryError
            If the joints differ, or `other` starts at another shape than the one where this path ends.
        """
        if self.n_shape != other.n_shape:
            raise TrajectoryError(f"paths of {self.n_shape} and {other.n_shape} joints cannot follow each other")
        names = self.joint_names or other.joint_names
        if names != (other.joint_names or names):
            raise TrajectoryError(
                f"paths with other joints or another order of joints: {names} and {other.joint_names}"
            )
        end, start = self.shape(self.duration), other.shape(0.0)
        factors = factors_between(end, start, ball_columns(names))
        start = start * factors
        offset = np.round((end - start) / _WHOLE_TURN) * _WHOLE_TURN
        if not same_shape(end, start + offset):
            joint = int(np.argmax(np.abs(end - start - offset)))
            raise TrajectoryError(
                f"paths do not join: joint {names[joint] if names else joint} ends at {end[joint]:.9g} and the next "
                f"path starts at {start[joint]:.9g}"
            )
        duration = self.duration + other.duration
        breaks = np.concatenate([self.breaks, self.duration + other.breaks[1:]])
        breaks[-1] = duration
        following = other.curve if np.all(factors == 1.0) else Multiplied(other.curve, factors)
        curve = Joined(self.curve, self.duration, following, other.duration, offset)
        return ShapePath(curve, duration, breaks, self.n_shape, names)

    def repeated(self, count: int) -> ShapePath:
        """The loop `count` times in a row.

        Raises
        ------
        OpenPathError
            If the path does not end where it begins, up to whole turns of joints, and signs of quaternions.
        TrajectoryError
            If the count is not a whole number of 1 or more.
        """
        if not isinstance(count, int | float | np.number) or not np.isfinite(count) or count < 1 or count % 1:
            raise TrajectoryError(f"a path is repeated a whole number of times, 1 or more; got {value_text(count)}")
        (start, end), _ = self.curve(np.array([0.0, self.duration]))
        gap = end - start * factors_between(end, start, ball_columns(self.joint_names))
        turns = np.round(gap / _WHOLE_TURN) * _WHOLE_TURN
        if not same_shape(gap, turns):
            joint = int(np.argmax(np.abs(gap - turns)))
            name = self.joint_names[joint] if self.joint_names else f"number {joint}"
            raise OpenPathError(f"only a loop can be repeated; joint {name} ends {gap[joint]:.9g} off")
        starts = self.duration * np.arange(count)
        breaks = np.concatenate([*(start + self.breaks[:-1] for start in starts), [count * self.duration]])
        if self.swings.smooth_loop:
            breaks = breaks[[0, -1]]
        curve = Repeated(self.curve, self.duration, int(count), turns)
        return replace(
            self,
            curve=curve,
            duration=count * self.duration,
            breaks=breaks,
            loops=self.loops * int(count),
            origin=None,
        )

    @cached_property
    def sample_times(self) -> Array:
        """Times of a table whose cubic spline is the path to 1e-9 rad or m, or of its largest value above 1: (N,) [s].

        These are a spline's own knots, some 400 times for each swing of a series, and ever nearer ones towards a kink.

        Raises
        ------
        TrajectoryError
            If that takes more than a million times; also as `scan`.
        """
        return read_only(spline_times(self))

    def matched(self, joint_names: Sequence[str], owner: str) -> ShapePath:
        """The path with its columns in the order of `joint_names`, matched by name where the path has names.

        Raises
        ------
        UnknownNameError
            If the path has a joint that is not among them.
        TrajectoryError
            If one of them is missing, or a path without names has another number of columns. `owner` names the
            body in messages.
        """
        expected = tuple(joint_names)
        if self.joint_names is None:
            if self.n_shape == len(expected):
                return self
            raise TrajectoryError(
                f"the path has {self.n_shape} joints, {owner} has {len(expected)}: {', '.join(expected)}"
            )
        for name in self.joint_names:
            if name not in expected:
                raise unknown_name(f"joint of {owner}", name, expected)
        missing = [name for name in expected if name not in self.joint_names]
        if missing:
            raise TrajectoryError(f"the path lacks these joints of {owner}: {', '.join(missing)}")
        if self.joint_names == expected:
            return self
        order = np.array([self.joint_names.index(name) for name in expected])
        curve = Reordered(self.curve, order)
        return replace(self, curve=curve, joint_names=expected)

    def _card(self) -> Card:
        """Duration, joints that move, widest joint and closure, with a picture of the joints in time."""
        try:
            shapes = self.shape(np.linspace(0.0, self.duration, MOST_POINTS))
        except ShapePhaseError as error:
            return Card("ShapePath", [("duration", numbers(self.duration, "s")), ("cannot be evaluated", str(error))])
        spans = np.ptp(shapes, axis=0) if self.n_shape else np.zeros(1)
        widest = int(np.argmax(spans))
        name = self.joint_names[widest] if self.joint_names else f"joint {widest}"
        gap = float(np.max(np.abs(shapes[-1] - shapes[0]), initial=0.0))
        rows = [
            ("duration", numbers(self.duration, "s") + (f", {self.loops} loops" if self.loops > 1 else "")),
            ("joints", f"{self.n_shape}, {np.count_nonzero(spans > 0.0)} of them move"),
            ("widest", f"{name}, by {spans[widest]:.4g} rad or m"),
            ("breaks", f"{len(self.breaks)}"),
            ("closes", "yes" if gap <= CLOSED else f"no, by {gap:.4g} rad or m"),
        ]
        return Card("ShapePath", rows, curves_picture(shapes, "joints in time") if self.n_shape else "")

    def _evaluated(self, t: ArrayLike) -> tuple[Array, Array]:
        times = times_argument(t, self.duration)
        shapes, rates = self.curve(times.ravel())
        expected_shape = (*times.shape, self.n_shape)
        return shapes.reshape(expected_shape), rates.reshape(expected_shape)


def without_joints(path: ShapePath, names: Collection[str]) -> ShapePath:
    """Return the path of the other joints; of a path without names the path itself."""
    kept = [k for k, name in enumerate(path.joint_names or ()) if name not in names]
    if path.joint_names is None or len(kept) == path.n_shape:
        return path
    order, left = np.array(kept, dtype=int), tuple(path.joint_names[k] for k in kept)
    curve = Reordered(path.curve, order)
    return replace(path, curve=curve, n_shape=len(kept), joint_names=left)


def interpolated(
    knots: Array, values: Array, through: Interpolation | None, joint_names: Sequence[str] | None = None
) -> ShapePath:
    """Return the path of the kind `through` with values at its knots; those of a periodic one without the last."""
    if through == "rest to rest":
        return ShapePath.waypoints(knots, values, joint_names=joint_names)
    periodic = through == "periodic"
    whole = np.concatenate([values, values[:1]]) if periodic else values
    return ShapePath.spline(knots, whole, periodic, joint_names=joint_names)


def _piecewise(curve: PiecewisePolynomial, joint_names: Sequence[str] | None) -> ShapePath:
    n_shape = curve.coefficients.shape[2]
    return ShapePath(curve, float(curve.knots[-1]), curve.knots, n_shape, path_joint_names(joint_names, n_shape))
