"""How extremals spread: their Jacobi fields, conjugate times, and the extremal that meets an end by shooting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import positive_argument, tolerance_argument
from ..arrays import Array
from ..body.body import Body
from ..errors import AccuracyNotReached, ShapeError
from ..integrator.casadi_calls import call_casadi
from ..shape_space.connection import horizontal_lift, mechanical_connection
from ..shape_space.shape_path import ShapePath
from .extremals import Extremal, extremal, hamiltonian, initial_state, integrated, natural_sizes, wong_residual

_STEPS = 40
# First to here by steps this accurate, which takes a fraction of the time.
_NEAR, _ROUGH = 1e-6, 1e-8
_DAMPING, _HOPELESS = 1e-5, 1e5
_SYMMETRY = 10.0
_SHARES = (1.0, 0.5, 0.25, 0.125, 0.0625)
# A trial that takes more evaluations than this has gone astray.
_MOST = 20_000
_NOTHING = 1e-9
_ZERO = 1e-6
_SCAN = 600
_SPARSE = 10
_BALANCING = 8


@dataclass(frozen=True, eq=False)
class JacobiFields:
    """The extremals next to one, from the same start: how its end moves with the initial rate and the charge.

    Attributes
    ----------
    duration : [s]
    n_shape : number of joints
    momentum_sizes, charge_size : (n,), what the columns of `matrix` are per: a change of g rate and of the charge by
        these
    solution : times -> (2 n + 4 + (2 n + 3)(n + 3), N): the extremal, then the fields
    """

    duration: float
    n_shape: int
    momentum_sizes: Array
    charge_size: float
    solution: Callable[[Array], Array]

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
    """A time at which neighbouring extremals from the same start meet again to first order.

    Attributes
    ----------
    time : [s]
    multiplicity : how many independent Jacobi fields vanish there
    """

    time: float
    multiplicity: int


def jacobi_fields(
    body: Body, metric: str, shape: Array, rate: Array, charge: Array, duration: float, tolerance: float
) -> JacobiFields:
    """All Jacobi fields that vanish at the start, along the extremal of these (trusted) arguments.

    Raises AccuracyNotReached as `extremal`.
    """
    n, equations = body.n_shape, hamiltonian(body, metric)
    momenta, of_charge = natural_sizes(body, equations, shape, rate, charge)
    charges = np.concatenate([np.zeros((3, n)), of_charge * np.eye(3)], axis=1)
    fields = np.zeros((2 * n + 3, n + 3))
    fields[n : 2 * n] = np.concatenate([np.diag(momenta), of_charge * mechanical_connection(body, shape).T], axis=1)

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
    size = np.concatenate([np.ones(n), momenta, np.ones(4), np.repeat(rows, n + 3)])
    start = np.concatenate([initial_state(equations, shape, rate, charge), fields.ravel()])
    answer = integrated(field, duration, start, tolerance, size)
    return JacobiFields(duration, n, momenta, of_charge, answer.sol)


def conjugate_times(motion: Extremal, until: float | None = None, tolerance: float = 1e-11) -> list[ConjugateTime]:
    """When neighbours from the same start meet the extremal again: beyond the first such time it is not minimal.

    A kernel that is there at all times, of charges that no motion feels (those across the plane of a planar body), is
    left out. A symmetry of the body that keeps the start and the end turns the extremal into others with the same end,
    so the end of an optimal loop is then a conjugate time, of the dimension of the symmetry.

    Parameters
    ----------
    motion : the extremal
    until : [s]; None: 1.05 times its duration, so that its end is looked at too
    tolerance : as for `extremal`

    Returns
    -------
    list of ConjugateTime, ascending, times in (0, until)

    Raises
    ------
    ShapeError
        If the extremal is at rest: all its Jacobi fields vanish with the speed.
    AccuracyNotReached
        If the integration breaks down before `until`.

    Source: Agrachev and Sachkov, Control Theory from the Geometric Viewpoint, section 21.
    """
    if motion.energy == 0.0:
        raise ShapeError("an extremal at rest has no conjugate times; give it a rate")
    span = 1.05 * motion.duration if until is None else positive_argument(until, "until")
    start, rate = motion.shape(0.0), motion.rate(0.0)
    goal = tolerance_argument(tolerance)
    fields = jacobi_fields(motion.body, motion.metric, start, rate, motion.charge, span, goal)
    times = span * np.arange(1, _SCAN + 1) / _SCAN
    raw = fields.matrix(times)
    n = motion.body.n_shape
    rows = np.repeat([_inverse_size(raw[:, :n]), _inverse_size(raw[:, n:])], [n, 3])
    left, right = _balanced(rows[:, None] * raw[::_SPARSE])
    left = left * rows

    def spread(t: Array) -> Array:
        return left @ fields.matrix(t) @ right

    values = np.linalg.svd(spread(times), compute_uv=False)
    least, largest = values[:, -1], values.max()
    dips = 1 + np.flatnonzero((least[1:-1] <= least[:-2]) & (least[1:-1] <= least[2:]))
    found: list[ConjugateTime] = []
    for dip in dips:
        time = _refined(spread, float(times[dip]), span / _SCAN)
        small = np.linalg.svd(spread(np.array([time]))[0], compute_uv=False) < _ZERO * largest
        if small.any() and not (found and abs(time - found[-1].time) < 1e-6 * span):
            found.append(ConjugateTime(time, int(small.sum())))
    return found


def _balanced(matrices: Array) -> tuple[Array, Array]:
    """Changes of basis, left (k, m) and right (m, k), after which no direction is felt more than another.

    (N, m, m); what all of them map to nothing, or never reach, is left out. Without it a charge that is hardly felt
    would hide the zeros of the others. By rows and columns in turn, as in Sinkhorn's scaling.
    """
    left = right = np.eye(matrices.shape[-1])
    for _ in range(_BALANCING):
        right = right @ _evened(left @ matrices @ right)
        left = _evened(so3.transpose(left @ matrices @ right)).T @ left
    return left, right


def _evened(matrices: Array) -> Array:
    """Columns after which the mean square of the matrices is the identity: (N, m, n) -> (n, k)."""
    _, values, rows = np.linalg.svd(matrices.reshape(-1, matrices.shape[-1]), full_matrices=False)
    kept = values > _NOTHING * values[0]
    return rows[kept].T / values[kept] * np.sqrt(len(matrices))


def _refined(spread: Callable[[Array], Array], time: float, step: float) -> float:
    """The time next to a dip of the least singular value at which it vanishes, or is least."""
    centre, reach = time, step
    for _ in range(8):
        left, values, right = np.linalg.svd(spread(np.array([time]))[0], full_matrices=False)
        small = 1e-3 * reach
        # The least singular value with its sign, along fixed vectors, passes through zero linearly.
        before, after = (left[:, -1] @ near @ right[-1] for near in spread(np.array([time - small, time + small])))
        slope = (after - before) / (2.0 * small)
        move = -values[-1] / slope if slope else 0.0
        time = float(np.clip(time + move, centre - step, centre + step))
        if abs(move) < 1e-12 * centre:
            break
        reach = min(reach, max(abs(move), 1e-6 * step))
    return time


def shoot(
    body: Body,
    path: ShapePath,
    target: ArrayLike | None = None,
    *,
    metric: str = "kinetic",
    tolerance: float = 1e-10,
) -> Extremal:
    """The extremal next to a nearly optimal path, with its start and end and the rotation asked for.

    Newton's method on the initial rate and the charge, with steps shortened until the end comes nearer. Where a
    symmetry of the body turns one solution into others the derivative is singular, and the damping, which falls with
    the residual, leads to a nearest solution all the same (Yamashita and Fukushima 2001: quadratically).

    Parameters
    ----------
    path : its start, end and duration are kept, the rate and charge of `wong_residual` are the first guess
    target : (3, 3) rotation over the path at zero momentum; None: that of the path
    metric : as for `extremal`
    tolerance : of the end shape and the rotation [rad or m]

    Raises
    ------
    AccuracyNotReached
        If it does not converge: the message holds what is left. Plans of bodies of up to 36 joints are near enough
        from 20 pieces on, where light joints do not whirl.
    As `extremal` and `wong_residual`.
    """
    route = path.matched(body.joint_names, body.name)
    goal = tolerance_argument(tolerance)
    turned = horizontal_lift(body, route).end if target is None else so3.rotation_argument(target, "target")
    if turned.shape != (3, 3):
        raise ShapeError(f"target: one rotation (3, 3) is needed, got {turned.shape}")
    start, end = route.shape(0.0), route.shape(route.duration)
    n, fine = body.n_shape, max(1e-13, 0.01 * goal)
    guess = wong_residual(body, route, metric=metric)
    rate, charge = guess.rate, guess.charge
    equations = hamiltonian(body, metric)
    tensor = np.array(equations.metric(start))

    def slopes(speed: Array, moment: Array, accuracy: float) -> Array:
        fields = jacobi_fields(body, metric, start, speed, moment, route.duration, accuracy)
        return fields.end()[2] / np.concatenate([fields.momentum_sizes, np.full(3, fields.charge_size)])

    def missing(speed: Array, moment: Array, accuracy: float, most: int | None = None) -> Array:
        state = initial_state(equations, start, speed, moment)
        momenta, _ = natural_sizes(body, equations, start, speed, moment)
        size = np.concatenate([np.ones(n), momenta, np.ones(4)])

        def field(now: Array) -> Array:
            return call_casadi(equations.field, 1, now, moment)[0][0]

        last = integrated(field, route.duration, state, accuracy, size, most).y[:, -1]
        attitude = so3.matrix_from_quat(so3.normalised(last[2 * n :]))
        return np.concatenate([last[:n] - end, so3.log(attitude @ turned.T)])

    def stepped(accuracy: float, damping: float) -> tuple[Array, Array, float] | None:
        """Rate and charge from which the end is nearer, and the next damping; None if there are none."""
        matrix = slopes(rate, charge, accuracy)
        momenta, of_charge = natural_sizes(body, equations, start, rate, charge)
        sizes = np.concatenate([momenta, np.full(3, of_charge)])
        scaled = matrix * sizes
        weights = np.repeat([_inverse_size(scaled[:n]), _inverse_size(scaled[n:])], [n, 3])
        left, right = weights[:, None] * scaled, weights * gap
        across, values, along = np.linalg.svd(left)
        # The rest are symmetries, as far as the integration can tell: along them the extremal stays where the path is.
        telling = values > _SYMMETRY * accuracy * values[0]
        across, values, along = across[:, telling], values[telling], along[telling]
        while damping < _HOPELESS:
            share = values / (values**2 + damping * np.linalg.norm(right))
            step = -sizes * (along.T @ (share * (across.T @ right)))
            for share in _SHARES:
                trial = rate + share * np.linalg.solve(tensor, step[:n]), charge + share * step[n:]
                try:
                    after = missing(*trial, accuracy, _MOST)
                except AccuracyNotReached:
                    continue
                if np.linalg.norm(weights * after) < (1.0 - 0.1 * share) * np.linalg.norm(right):
                    return *trial, damping / 4.0
            damping *= 64.0
        return None

    gap = np.full(n + 3, np.inf)
    for reach, accuracy in ((max(goal, _NEAR), max(fine, _ROUGH)), (goal, fine)):
        damping = _DAMPING
        for _ in range(_STEPS):
            gap = missing(rate, charge, accuracy)
            if np.linalg.norm(gap) <= reach:
                break
            better = stepped(accuracy, damping)
            if better is None:
                break
            rate, charge, damping = better
    if np.linalg.norm(gap) <= goal:
        return extremal(body, start, rate, charge, route.duration, metric=metric, tolerance=fine)
    raise AccuracyNotReached(
        f"no extremal found next to the path: the end is {np.linalg.norm(gap):.3g} away, {goal:.3g} was asked; start "
        "from a path nearer to the optimum (its wong_residual should be small; that of a plan falls with its pieces)"
    )


def _inverse_size(matrix: Array) -> float:
    largest = float(np.abs(matrix).max())
    return 1.0 / largest if largest else 1.0
