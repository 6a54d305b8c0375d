"""Jacobi fields of extremals: the derivative of their ends by the initial conditions; and conjugate times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import so3
from ...arguments import check_object, number_argument, positive_argument, tolerance_argument
from ...arrays import Array
from ...body.body import Body
from ...body.loading import as_body_or_particles
from ...body.particles.point_masses import ParticleBody
from ...display import short_repr
from ...errors import ShapeError
from ...shape_space.connection import mechanical_connection
from ..symbolic import call_casadi
from .extremal import Extremal
from .hamiltonian import hamiltonian, initial_state, integrated, natural_scales

_SCAN = 600  # times that are searched for zeros: conjugate times of a loop are a good part of it apart
_BALANCING_STRIDE = 10  # every so many of those samples balance the basis
_BALANCING_ROUNDS = 8  # by rows and columns in turn; an approximate balance is enough
_NO_EFFECT = 1e-9  # share of the largest mean effect below which a direction has none
_ZERO = 1e-6  # share of the largest singular value below which one is zero: above the fields' accuracy
_SAME_TIME = 1e-6  # share of the span within which two zeros are one
_REFINEMENTS = 8  # Newton steps to a zero: quadratic from a sample on
_REFINED = 1e-12  # relative change of time at which they end: the accuracy of the fields
_DIFFERENCE = 1e-3  # interval of the difference quotient, as a share of how far the zero may still move
_LEAST_REACH = 1e-6  # least such distance in sampling steps, above rounding
_BEYOND_END = 1.05  # durations that are examined by default, so that a conjugate time at the end is found


@dataclass(frozen=True, eq=False)
class JacobiFields:
    """Jacobi fields of an extremal that vanish at its start: its derivative by initial rate and charge.

    Made by `jacobi_fields`.

    Attributes
    ----------
    duration : [s]
    n_shape : number of joints
    momentum_scales, charge_scale : (n,) and a number: units of g rate and of the charge that the columns of `matrix`
        are per
    solution : times -> (2 n + 4 + (2 n + 3)(n + 3), N): the extremal, then the fields
    """

    duration: float
    n_shape: int
    momentum_scales: Array
    charge_scale: float
    solution: Callable[[Array], Array]

    __repr__ = short_repr

    def matrix(self, t: Array) -> Array:
        """Change of shape and turn of the base (inertial axes) by g rate and charge: (N,) -> (N, n + 3, n + 3)."""
        n = self.n_shape
        fields = self.solution(t)[2 * n + 4 :].T.reshape(len(t), 2 * n + 3, n + 3)
        return np.delete(fields, np.s_[n : 2 * n], axis=1)

    def end(self) -> tuple[Array, Array, Array]:
        """Shape, attitude and `matrix` at the end: (n,), (3, 3), (n + 3, n + 3)."""
        times = np.array([self.duration])
        state = self.solution(times)[:, 0]
        quaternion = state[2 * self.n_shape : 2 * self.n_shape + 4]
        return state[: self.n_shape], so3.matrix_from_quat(so3.normalised(quaternion)), self.matrix(times)[0]


@dataclass(frozen=True, eq=False)
class ConjugateTime:
    """A time at which neighbouring extremals from the same start meet again to first order. Made by `conjugate_times`.

    Attributes
    ----------
    time : [s]
    multiplicity : number of independent Jacobi fields that vanish there
    """

    time: float
    multiplicity: int

    __repr__ = short_repr


def jacobi_fields(
    body: Body | ParticleBody | str,
    metric: Any,
    shape: Array,
    rate: Array,
    charge: Array,
    duration: float,
    tolerance: float,
) -> JacobiFields:
    """Return all Jacobi fields that vanish at the start, along the extremal of these (trusted) arguments.

    Raises AccuracyNotReached where `extremal` does.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> rate, charge = np.array([1.0, 0.0, 0.0]), np.zeros(3)
    >>> fields = sp.optimal_control.jacobi_fields(cat, "kinetic", np.zeros(3), rate, charge, 0.2, 1e-9)
    >>> print(np.abs(fields.matrix(np.array([0.0]))).max())  # they vanish at the start
    0.0
    """
    body = as_body_or_particles(body)
    duration = number_argument(duration, "duration", "s")
    tolerance = number_argument(tolerance, "tolerance")
    n, equations = body.n_shape, hamiltonian(body, metric)
    momenta, charge_scale = natural_scales(body, equations, shape, rate, charge)
    charges = np.concatenate([np.zeros((3, n)), charge_scale * np.eye(3)], axis=1)
    fields = np.zeros((2 * n + 3, n + 3))
    fields[n : 2 * n] = np.concatenate([np.diag(momenta), charge_scale * mechanical_connection(body, shape).T], axis=1)

    def field(now: Array) -> Any:
        state, spread = now[: 2 * n + 4], now[2 * n + 4 :].reshape(2 * n + 3, n + 3)
        attitude = so3.matrix_from_quat(so3.normalised(state[2 * n :]))
        moment = charge @ attitude
        flow = call_casadi(equations.field, 1, state, charge)[0][0]
        second = call_casadi(equations.second, 1, state[:n], flow[:n], moment)[0].reshape(2 * n + 3, 2 * n + 3)
        shapes, momenta_there, turns = spread[:n], spread[n : 2 * n], spread[2 * n :]
        moments = attitude.T @ (charges + so3.hat(charge) @ turns)
        known = second[:, :n] @ shapes + second[:, 2 * n :] @ moments
        rates = np.linalg.solve(second[n : 2 * n, n : 2 * n], momenta_there - known[n : 2 * n])
        slopes = known + second[:, n : 2 * n] @ rates
        return np.concatenate([flow, rates.ravel(), slopes[:n].ravel(), (-attitude @ slopes[2 * n :]).ravel()])

    rows = np.concatenate([np.ones(n), momenta, np.ones(3)])
    scale = np.concatenate([np.ones(n), momenta, np.ones(4), np.repeat(rows, n + 3)])
    start = np.concatenate([initial_state(equations, shape, rate, charge), fields.ravel()])
    result = integrated(field, duration, start, tolerance, scale)
    return JacobiFields(
        duration=duration,
        n_shape=n,
        momentum_scales=momenta,
        charge_scale=charge_scale,
        solution=result.sol,
    )


def conjugate_times(motion: Extremal, until: float | None = None, tolerance: float = 1e-11) -> list[ConjugateTime]:
    """Times at which neighbours from the same start meet the extremal again: it is not minimal beyond the first.

    A kernel at all times, of charges without effect (across the plane of a planar body), is left out. A symmetry of the
    body that keeps the start and the end turns the extremal into others with the same end, so the end of an optimal
    loop is then a conjugate time, of the dimension of the symmetry.

    Source: Agrachev and Sachkov, Control Theory from the Geometric Viewpoint, section 21.

    Parameters
    ----------
    motion : the extremal
    until : [s]; None: 1.05 times its duration, so that its end is included
    tolerance : see `extremal`

    Returns
    -------
    list of ConjugateTime, ascending, times in (0, until)

    Raises
    ------
    ShapeError
        If the extremal is at rest: all its Jacobi fields vanish with the speed.
    AccuracyNotReached
        If the integration breaks down before `until`.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> path = sp.optimal_control.extremal(cat, np.zeros(3), [1.0, 0.0, 0.0], np.zeros(3), 0.2)
    >>> sp.optimal_control.conjugate_times(path)
    []
    """
    check_object(motion, "Extremal", "motion")
    if motion.energy == 0.0:
        raise ShapeError("an extremal at rest has no conjugate times; give it a rate")
    span = _BEYOND_END * motion.duration if until is None else positive_argument(until, "until")
    start, rate = motion.shape(0.0), motion.rate(0.0)
    goal = tolerance_argument(tolerance)
    fields = jacobi_fields(motion.body, motion.metric, start, rate, motion.charge, span, goal)
    times = span * np.arange(1, _SCAN + 1) / _SCAN
    raw = fields.matrix(times)
    n = motion.body.n_shape
    rows = np.repeat([inverse_scale(raw[:, :n]), inverse_scale(raw[:, n:])], [n, 3])
    left, right = _balanced(rows[:, None] * raw[::_BALANCING_STRIDE])
    left = left * rows

    def spread(t: Array) -> Array:
        return left @ fields.matrix(t) @ right

    values = np.linalg.svd(spread(times), compute_uv=False)
    least, largest = values[:, -1], values.max()
    dips = 1 + np.flatnonzero((least[1:-1] <= least[:-2]) & (least[1:-1] <= least[2:]))
    times_found: list[ConjugateTime] = []
    for dip in dips:
        time = _refined(spread, float(times[dip]), span / _SCAN)
        small = np.linalg.svd(spread(np.array([time]))[0], compute_uv=False) < _ZERO * largest
        if small.any() and not (times_found and abs(time - times_found[-1].time) < _SAME_TIME * span):
            times_found.append(ConjugateTime(time=time, multiplicity=int(small.sum())))
    return times_found


def _balanced(matrices: Array) -> tuple[Array, Array]:
    """Return changes of basis, left (k, m) and right (m, k), after which all directions have the same mean effect.

    Directions that all matrices (N, m, m) map to zero, or do not reach, are left out. A charge of little effect would
    otherwise hide the zeros of the others. By rows and columns in turn, as in Sinkhorn's scaling.
    """
    left = right = np.eye(matrices.shape[-1])
    for _ in range(_BALANCING_ROUNDS):
        right = right @ _evened(left @ matrices @ right)
        left = _evened(so3.transpose(left @ matrices @ right)).T @ left
    return left, right


def _evened(matrices: Array) -> Array:
    """Return columns after which the mean square of the matrices is the identity: (N, m, n) -> (n, k)."""
    _, values, rows = np.linalg.svd(matrices.reshape(-1, matrices.shape[-1]), full_matrices=False)
    kept = values > _NO_EFFECT * values[0]
    return rows[kept].T / values[kept] * np.sqrt(len(matrices))


def _refined(spread: Callable[[Array], Array], time: float, step: float) -> float:
    """Return the time next to a dip of the least singular value at which it vanishes, or is least."""
    centre, reach = time, step
    for _ in range(_REFINEMENTS):
        left, values, right = np.linalg.svd(spread(np.array([time]))[0], full_matrices=False)
        small = _DIFFERENCE * reach
        # The least singular value with its sign, along fixed vectors, passes through zero linearly.
        before, after = (left[:, -1] @ near @ right[-1] for near in spread(np.array([time - small, time + small])))
        slope = (after - before) / (2.0 * small)
        move = -values[-1] / slope if slope else 0.0
        time = float(np.clip(time + move, centre - step, centre + step))
        if abs(move) < _REFINED * centre:
            break
        reach = min(reach, max(abs(move), _LEAST_REACH * step))
    return time


def inverse_scale(matrix: Array) -> float:
    """Inverse of the largest entry of a matrix; 1 for a zero matrix."""
    largest = float(np.abs(matrix).max())
    return 1.0 / largest if largest else 1.0
