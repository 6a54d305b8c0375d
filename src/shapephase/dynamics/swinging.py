"""Hinges that no motor holds: they swing as the body turns, and turn it as they swing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_function, initial_state_arguments, tolerance_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.inverse_dynamics import falling_efforts
from ..body.loading import as_body
from ..chebyshev import inside
from ..deformation.deformation import articulated
from ..deformation.rotors import widened_path
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError, unknown_name
from ..inertia_tensor import inverse_inertia
from ..integrator.driven_attitude import DrivenAttitude, driven_attitude
from ..letters import value_text
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.body_path import as_path
from ..shape_space.curves import PiecewisePolynomial
from ..shape_space.shape_path import ShapePath

# Time, coordinates (k,) and rates (k,) of the free hinges -> efforts of springs and dampers (k,) [N m or N].
Effort = Callable[[float, Array, Array], ArrayLike]
_INTEGRATED = 0.3  # of the tolerance, for the hinges' integration
_SHARE = 0.03  # of the tolerance, for polynomials between knots [rad or m]
_SAME_TIME = 1e-12  # of the duration: nearer times are one
_LOOKS = 65  # times, beside those that limit steps, where the fastest joint is searched
_MOST_PIECES = 20_000  # between knots: a path of more takes minutes
_PLACES = (0.25, 0.5, 0.75)  # of a piece, where it is compared with the integrated motion


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeHinges:
    """The motion of a body some of whose joints swing freely. Made by `free_hinges`.

    Attributes
    ----------
    motion : along the path that came out; `split`, `joint_torques` and all else apply to it
    path : of all joints, polynomials of degree five between knots
    hinges : names of those that are free
    attitude_defect : how far the attitude of the motion is from the one integrated with the hinges [rad]
    error_estimate : of attitude and hinges, measured [rad or m]
    """

    motion: Motion
    path: ShapePath
    hinges: tuple[str, ...]
    attitude_defect: float
    error_estimate: float

    __repr__ = short_repr


def free_hinges(
    body: Body | str,
    path: ShapePath | str,
    free: Mapping[str, tuple[float, float]],
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    *,
    effort: Effort | None = None,
    tolerance: float = 1e-9,
) -> FreeHinges:
    """The motion of a body some of whose joints follow a path while others swing freely.

    The hinges have no motor. Their accelerations are those with which inverse dynamics finds no effort in them, but
    that of their springs and dampers. What comes out is a path of all joints, and the motion along it.

    Equation :eq:`free-hinges` of the documentation.

    Parameters
    ----------
    path : of the other joints
    free : for each free joint its coordinate and its rate at the start [rad or m], [rad/s or m/s]
    momentum, attitude : (3,), (3, 3) as for `reconstruct`
    effort : of springs and dampers, time, coordinates (k,), rates (k,) -> (k,) in the order of `free` [N m or N];
        None: none
    tolerance : of attitude and hinges [rad or m]

    Raises
    ------
    UnknownNameError, ShapeError, TrajectoryError
        For a joint that the body has not, no free joint, or a path of other joints than the rest.
    AccuracyNotReached
        If the tolerance cannot be met, as for a long swing that is chaotic.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> still = sp.ShapePath.waypoints([0.0, 0.5], np.zeros((2, 2)), joint_names=("waist_yaw", "waist_roll"))
    >>> found = sp.free_hinges(cat, still, {"waist_pitch": (0.3, 1.0)}, [0.0, 0.002, 0.01])
    >>> bool(np.abs(sp.joint_torques(found.motion).torque[:, 0]).max() < 1e-9)  # nothing drives the hinge
    True
    """
    body = as_body(body)
    path = as_path(path, body)
    goal = tolerance_argument(tolerance)
    starts = _starts(body, free)
    names = tuple(free)
    columns = np.array([body.joint_index(name) for name in names], dtype=int)
    if effort is not None:
        check_function(effort, "effort", "a function of time, coordinates and rates")
    route = widened_path(body, path, names)
    mu, start = initial_state_arguments(momentum, attitude)
    if mu.ndim > 1 or start.ndim > 2:
        raise ShapeError("free hinges swing in one motion at a time; give one momentum and attitude")
    swing = _Swing(body, route, columns, effort, mu)
    known = route.smoothness
    limits, breaks = known.step_limits, known.breaks
    if known.resolved is not None:
        # Accelerations are then slopes of series, which jump by their rounding from panel to panel.
        breaks = np.union1d(breaks, limits.edges)
        breaks = breaks[np.append(True, np.diff(breaks) > _SAME_TIME * route.duration)]
        breaks[-1] = route.duration
    # What the driven joints' own rates make of the hinges' for a time counts as far as it moves them.
    looked = np.union1d(limits.edges, np.linspace(0.0, route.duration, _LOOKS))
    fastest = np.abs(route.curve(np.union1d(looked, 0.5 * (looked[:-1] + looked[1:])))[1]).max(initial=0.0)
    rates = np.full(len(names), 1.0 / route.duration + fastest) + np.abs(starts[1])
    scales = np.concatenate([np.ones(len(names)), rates])
    integrated = driven_attitude(swing.rates, breaks, start, starts.ravel(), scales, _INTEGRATED * goal, limits)
    whole = _path_of(swing, integrated, breaks, goal)
    motion = reconstruct(articulated(body, whole), mu, attitude, tolerance=goal)
    times = integrated.error_times
    defect = float(so3.angle(so3.transpose(motion.attitude(times)) @ integrated.attitude(times)).max())
    worst = float(max(integrated.attitude_errors[-1], integrated.state_errors[-1, : len(names)].max()))
    return FreeHinges(
        motion=motion, path=whole, hinges=names, attitude_defect=defect, error_estimate=worst + defect + _SHARE * goal
    )


@dataclass(frozen=True, eq=False)
class _Swing:
    """The equations of the hinges and of the base."""

    body: Body
    route: ShapePath
    columns: Any
    effort: Effort | None
    momentum: Array

    def rates(self, times: Array, turned: Array, states: Array) -> tuple[Array, Array]:
        """Rates for `driven_attitude`; states are the coordinates of the hinges and then their rates."""
        omega, accelerations = self.accelerations(times, turned, states)
        return omega, np.concatenate([states[:, len(self.columns) :], accelerations], axis=1)

    def joints(self, times: Array, states: Array) -> tuple[Array, Array]:
        """Coordinates and rates of all joints, with those of the hinges from states: (N, n) each."""
        (shapes, rates), count = self.route.curve(times), len(self.columns)
        shapes[:, self.columns], rates[:, self.columns] = states[:, :count], states[:, count:]
        return shapes, rates

    def accelerations(self, times: Array, turned: Array, states: Array) -> tuple[Array, Array]:
        """Angular velocities of the base (N, 3) and accelerations of the hinges (N, k)."""
        count = len(self.columns)
        (shape, rate), acceleration = self.joints(times, states), self.route.acceleration(times)
        inertia, matrix, inertia_rate, matrix_rate = self.body.sample_rates(shape, rate)
        inverse = inverse_inertia(inertia, times)
        pi = so3.apply(so3.transpose(turned), self.momentum)
        omega = so3.apply(inverse, pi - so3.apply(matrix, rate))
        still = np.cross(pi, omega) - so3.apply(inertia_rate, omega) - so3.apply(matrix_rate, rate)
        slopes = so3.apply(inverse, still - so3.apply(matrix, acceleration))
        efforts, _ = falling_efforts(self.body, shape, rate, acceleration, omega, slopes)
        # Efforts are linear in accelerations: those of one of each hinge from rest, which the others may be far above.
        shapes = np.repeat(shape, count, axis=0)
        unit_rates = np.tile(np.eye(shape.shape[1])[self.columns], (len(times), 1))
        answers = -so3.apply(np.repeat(inverse, count, axis=0), so3.apply(np.repeat(matrix, count, axis=0), unit_rates))
        rest = np.zeros_like(shapes)
        by_one, _ = falling_efforts(self.body, shapes, rest, unit_rates, np.zeros_like(answers), answers)
        by_one = np.swapaxes(by_one[:, self.columns].reshape(-1, count, count), 1, 2)
        given = np.array([self._given(float(t), state) for t, state in zip(times, states, strict=True)])
        solution = np.linalg.solve(by_one, (given - efforts[:, self.columns])[..., None])[..., 0]
        return omega, np.asarray(solution, dtype=np.float64)

    def _given(self, t: float, state: Array) -> Array:
        """Efforts of springs and dampers: (2 k,) -> (k,)."""
        count = len(self.columns)
        if self.effort is None:
            return np.zeros(count)
        given = np.asarray(self.effort(t, state[:count], state[count:]), dtype=np.float64)
        if given.shape != (count,) or not np.isfinite(given).all():
            raise ShapeError(f"effort: {count} finite numbers are needed, at t = {t:.9g} s it gave {value_text(given)}")
        return given


def _path_of(swing: _Swing, found: DrivenAttitude, breaks: Array, tolerance: float) -> ShapePath:
    """Polynomials of degree five that have coordinates, rates and accelerations at knots, as many as are needed."""
    knots = np.union1d(found.times, breaks)
    count = len(swing.columns)
    while True:
        left, right = inside(knots[:-1], knots[1:])
        starts, ends = _all_joints(swing, found, left, knots[:-1]), _all_joints(swing, found, right, knots[1:])
        coefficients = _quintics(np.diff(knots), *starts, *ends)
        curve = PiecewisePolynomial(knots, coefficients)
        times = (knots[:-1, None] + np.diff(knots)[:, None] * np.array(_PLACES)).ravel()
        shapes, rates = (np.abs(a - b) for a, b in zip(curve(times), swing.joints(times, found.states(times))))
        off = max(shapes.max(initial=0.0), rates.max(initial=0.0) / found.scales[count:].min() * _SHARE)
        if off <= _SHARE * tolerance:
            break
        if 2 * len(knots) > _MOST_PIECES:
            raise AccuracyNotReached(
                f"the swing of {', '.join(np.array(swing.body.joint_names)[swing.columns])} needs too many pieces of a "
                "path; loosen the tolerance or shorten the motion"
            )
        knots = np.sort(np.concatenate([knots, 0.5 * (knots[:-1] + knots[1:])]))
    return ShapePath(curve, float(knots[-1]), knots, swing.body.n_shape, swing.body.joint_names)


def _all_joints(swing: _Swing, found: DrivenAttitude, times: Array, knots: Array) -> tuple[Array, Array, Array]:
    """Coordinates, rates and accelerations at knots (N,), by those at times just on one side of them: (N, n) each."""
    states = found.states(times)
    (shapes, rates), accelerations = swing.joints(times, states), swing.route.acceleration(times)
    accelerations[:, swing.columns] = swing.accelerations(times, found.attitude(times), states)[1]
    # What a fast joint moves in between is more than rounding.
    away = (knots - times)[:, None]
    return shapes + away * rates, rates + away * accelerations, accelerations


def _quintics(widths: Array, r: Array, v: Array, a: Array, s: Array, w: Array, b: Array) -> Array:
    """Coefficients (6, P, n) of the polynomials with these values, slopes and second derivatives at both ends."""
    h = widths[:, None]
    gap = s - r - h * v - 0.5 * h**2 * a
    slope, bend = h * (w - v - h * a), h**2 * (b - a)
    return np.stack(
        [
            r, v, 0.5 * a,
            (10.0 * gap - 4.0 * slope + 0.5 * bend) / h**3,
            (-15.0 * gap + 7.0 * slope - bend) / h**4,
            (6.0 * gap - 3.0 * slope + 0.5 * bend) / h**5,
        ]
    )  # fmt: skip


def _starts(body: Body, free: Mapping[str, Any]) -> Array:
    """Coordinates and rates at the start: (2, k). Raises UnknownNameError, ShapeError."""
    if not isinstance(free, Mapping) or not free:
        raise ShapeError(f"free: joints with (coordinate, rate) at the start are needed, got {value_text(free)}")
    for name in free:
        if name not in body.joint_names:
            raise unknown_name(f"joint of {body.name}", name, body.joint_names)
        if body.joint_units[body.joint_index(name)] == "1":
            raise ShapeError(f"free: {name} is a number of a ball joint; hinges and slides swing, of one axis each")
    return np.array([finite_array(pair, f"free, {name}", (2,)) for name, pair in free.items()]).T
