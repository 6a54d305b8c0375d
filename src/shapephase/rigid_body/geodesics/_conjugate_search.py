"""Conjugate times on SO(3) by the angles of a Lagrangian plane, which cannot miss one or count one twice.

In inertial axes a Jacobi field y with y(0) = 0 and its momentum x = delta Pi(0) + Pi(0) x y/2 obey a Hamiltonian system
of the quadratic form w.a w >= 0, w = x + Pi(0) x y/2. Hence the eigenvalues exp(2 i theta) of
(X + i Y)(X − i Y)^-1, X and Y the matrices of three such fields, turn one way only, and a conjugate time is where one
of them passes 1: det Y = 0, also where two fields vanish at once and the determinant does not change its sign. With
|Pi| = 1 their angles together grow by no more than 5/2 (a_1 + a_2 + a_3) a unit of time.

Sources: theory.md Q6; Arnold 1967 for the angles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize.elementwise import find_root

from ... import so3
from ...arrays import Array, Integers
from ...errors import AccuracyNotReached
from ._momentum_flow import attitude_flow, exponential_fields, momentum_flow

_TURN = 2.0 * np.pi  # [rad]
_STEPS_EACH = 10_000  # steps for each order: moments (3, 2, 1) need ten, only moments five thousandfold apart need more
_SLACK = 1e-6  # [rad] that rounding may set the sum of the angles back: far below the growth in a step


@dataclass(frozen=True, eq=False)
class _StepStart:
    """The beginnings of the steps in which the conjugate times lie, for N geodesics."""

    time: Array
    """(N,)"""
    total: Array
    """(N,) sum of the angles [rad]."""
    attitude: Array
    """(N, 3, 3)"""
    frame: Array
    """X above Y, with orthonormal columns: (N, 6, 3)."""


def conjugate_times(inverse_moments: Array, momenta: Array, order: int) -> Array:
    """The `order`-th conjugate time of each geodesic, counted with multiplicity: (3,) descending, (N, 3) -> (N,).

    Raises AccuracyNotReached if there is none in ten thousand steps times `order`, each of some tenths of a turn about
    the axis of the smallest moment: the moments are too unequal.
    """
    magnitude = np.linalg.norm(momenta, axis=-1)
    directions = momenta / magnitude[:, None]
    # Below the shortest time in which the sum of the angles could grow by a whole turn, which would be missed.
    step = 0.9 * _TURN / (2.5 * float(inverse_moments.sum()))
    left = _brackets(inverse_moments, directions, order, step)
    return _roots(inverse_moments, directions, order, left, step) / magnitude


def _brackets(inverse_moments: Array, directions: Array, order: int, step: float) -> _StepStart:
    eyes = np.tile(np.eye(3), (len(directions), 1, 1))
    still = np.zeros(len(directions))
    frame = np.concatenate([eyes, np.zeros(eyes.shape)], axis=-2)
    left = _StepStart(time=still, total=still.copy(), attitude=eyes, frame=frame)
    rows = np.arange(len(directions))
    for index in range(1, order * _STEPS_EACH + 1):
        if not rows.size:
            return left
        time = index * step
        frame = _frame(inverse_moments, directions, left, rows, np.full(rows.size, time))
        angles = _angles(frame)
        total = _continued(left.total[rows], angles)
        ahead = _count(total, angles) < order
        rows = rows[ahead]
        left.time[rows], left.total[rows] = time, total[ahead]
        # Else all columns would soon be along the field that grows fastest.
        left.frame[rows] = np.linalg.qr(frame[ahead])[0]
        left.attitude[rows] = attitude_flow(inverse_moments, directions[rows], np.full(rows.size, time))
    raise AccuracyNotReached(
        f"conjugate point {order}: none up to the time {order * _STEPS_EACH * step:.6g}/|Pi| for the momentum along "
        f"{directions[rows[0]]} (principal axes); the moments are too unequal to go on"
    )


def _roots(inverse_moments: Array, directions: Array, order: int, left: _StepStart, step: float) -> Array:
    """The crossings, by Chandrupatla's bracketing method, all at once."""

    def crossing(times: Array, rows: Integers) -> Array:
        """The angle that is the next to pass a whole turn, less the turn; above 0 once it has."""
        rows = rows.astype(np.int64)
        angles = _angles(_frame(inverse_moments, directions, left, rows, times))
        missing = order - _count(_continued(left.total[rows], angles), angles)
        index = np.arange(len(rows))
        ahead = angles[index, 3 - np.clip(missing, 1, 3)] - _TURN
        value = np.where(missing > 0, ahead, angles[index, np.clip(-missing, 0, 2)])
        # At t = 0 all angles are whole turns.
        return np.where(times > 0.0, value, -_TURN)

    every, low, high = np.arange(len(directions)), left.time, left.time + step
    solution = find_root(crossing, (low, high), args=(every,), tolerances={"xatol": 0.0, "xrtol": np.finfo(float).eps})
    # A conjugate time may be at an end of a step, to rounding.
    return np.where(crossing(low, every) > 0.0, low, np.where(solution.success, solution.x, high))


def _frame(inverse_moments: Array, directions: Array, left: _StepStart, rows: Integers, times: Array) -> Array:
    """X above Y at times after the step's beginning: (N,) -> (N, 6, 3)."""
    attitude, momenta, fields = left.attitude[rows], left.frame[rows, :3], left.frame[rows, 3:]
    further, turn = times - left.time[rows], 0.5 * so3.hat(directions[rows])
    start = so3.apply(so3.transpose(attitude), directions[rows])
    slope = momentum_flow(inverse_moments, start, further)[1]
    step = exponential_fields(inverse_moments, start, further, attitude_flow(inverse_moments, start, further), slope)
    # The fields grow from w of the step's beginning as others do from delta Pi.
    new = fields + attitude @ step @ so3.transpose(attitude) @ (momenta + turn @ fields)
    return np.concatenate([momenta + turn @ (new - fields), new], axis=-2)


def _angles(frame: Array) -> Array:
    """2 theta of the three eigenvalues, in [0, 2 pi), ascending: (N, 6, 3) -> (N, 3)."""
    momenta, fields = frame[:, :3], frame[:, 3:]
    # (X − iY)^-1 (X + iY), which has the same eigenvalues.
    values = np.linalg.eigvals(np.linalg.solve(momenta - 1j * fields, momenta + 1j * fields))
    return np.sort(np.mod(np.angle(values), _TURN), axis=-1)


def _continued(before: Array, angles: Array) -> Array:
    """The sum of the angles, which has grown by less than a turn since it was `before`."""
    grown = angles.sum(axis=-1) - before
    return before + np.mod(grown + _SLACK, _TURN) - _SLACK


def _count(sums: Array, angles: Array) -> Integers:
    """Number of times that eigenvalues have passed 1."""
    return np.rint((sums - angles.sum(axis=-1)) / _TURN).astype(np.int64)
