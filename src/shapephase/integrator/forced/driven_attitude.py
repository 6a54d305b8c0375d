"""An attitude together with other states, by SciPy's DOP853 on the unit quaternion, with a measured estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ... import so3
from ...arrays import Array, lock_arrays
from ...chebyshev import inside
from ...display import short_repr
from ...errors import AccuracyNotReached

Rates = Callable[[float, Array, Array], tuple[Array, Array]]
"""Time, attitude (3, 3), other states (k,) -> angular velocity, body axes (3,), and the rates of the others (k,)."""
# Relative tolerance of the first run as a part of what is asked for: its error is about as large as that then.
_FIRST = 0.01
# Of a run against the one before it: the difference of both is the error of the first, ten times that of the second.
_SHARPER = 0.1
# SciPy gains nothing from less.
_LEAST = 3e-14
# [rad] Rounding of some thousand steps.
_ROUNDING = 1e-13
# Of the duration: longer steps could pass over what lasts for a short time only.
_LONGEST = 1.0 / 64.0
# Of the longest step, in each run that is ten times as sharp: the method is of order eight, and two runs with the same
# steps would make the same errors.
_SHORTER = 0.75
# Times at which two runs are compared.
_MOST_COMPARED = 4000


@dataclass(frozen=True, eq=False)
class _Run:
    """One run, a dense output between two breaks each."""

    breaks: Array
    pieces: tuple[Callable[[Array], Array], ...]
    times: Array
    evaluations: int

    def __call__(self, t: Array) -> Array:
        """Quaternions and scaled other states: (N,) -> (N, 4 + k)."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.pieces) - 1)
        values: Array = np.empty((len(t), len(self.pieces[0](self.breaks[:1])[:, 0])))
        for number in np.unique(piece):
            rows = piece == number
            values[rows] = self.pieces[number](t[rows]).T
        values[:, :4] = so3.normalised(values[:, :4])
        return values


@dataclass(frozen=True, eq=False)
class DrivenAttitude:
    """Attitudes and other states in time.

    Attributes
    ----------
    run : the sharper of the two last runs
    scales : (k,) of the other states
    error_times : (M,) at which both were compared [s]
    attitude_errors : (M,) the largest angle between them so far [rad]
    state_errors : (M, k) the largest differences of the other states so far
    evaluations : of the rates, in all runs
    """

    run: _Run
    scales: Array
    error_times: Array
    attitude_errors: Array
    state_errors: Array
    evaluations: int

    __repr__ = short_repr
    __post_init__ = lock_arrays

    @property
    def times(self) -> Array:
        """Ends of the steps [s]."""
        return self.run.times

    @property
    def error_estimate(self) -> Array:
        """Of the attitude, over all times: (1,) [rad]."""
        return self.attitude_errors[-1:]

    def attitude(self, t: Array) -> Array:
        """(N,) -> (N, 3, 3)."""
        return so3.matrix_from_quat(self.run(t)[:, :4])

    def states(self, t: Array) -> Array:
        """(N,) -> (N, k)."""
        return self.run(t)[:, 4:] * self.scales


def driven_attitude(
    rates: Rates, breaks: Array, attitude: Array, states: Array, scales: Array, tolerance: float
) -> DrivenAttitude:
    """Integrate R' = R hat(omega) and y' = g, both given by `rates`, restarted at the breaks.

    Runs are repeated, each with a tenth of the tolerance of the one before, until two of them agree. Their difference
    is the estimate of the error, and grows as the motion magnifies errors.

    Parameters
    ----------
    breaks : (M,) between which all is smooth [s]
    attitude : (3, 3) at the start
    states : (k,) at the start
    scales : (k,) size that matters of each
    tolerance : of the attitude, and of the other states in their scales [rad]

    Raises
    ------
    AccuracyNotReached
        If the sharpest two runs disagree by more than the tolerance.

    Examples
    --------
    >>> from shapephase.integrator.forced.driven_attitude import driven_attitude
    >>> def rates(t, attitude, states):
    ...     return np.array([0.0, 0.0, states[0]]), np.ones(1)  # a turn that speeds up
    >>> found = driven_attitude(rates, np.array([0.0, 1.0]), np.eye(3), np.zeros(1), np.ones(1), 1e-9)
    >>> print(f"{float(sp.so3.angle(found.attitude(np.array([1.0]))[0])):.9f}")
    0.500000000
    """
    sharpness = max(_FIRST * tolerance, _LEAST / _SHARPER)
    start = np.concatenate([so3.quat_from_matrix(attitude), states / scales])
    longest = _LONGEST * float(breaks[-1])
    last = _integrated(rates, breaks, start, scales, sharpness, longest)
    evaluations = last.evaluations
    while True:
        sharpness, longest = sharpness * _SHARPER, longest * _SHORTER
        run = _integrated(rates, breaks, start, scales, sharpness, longest)
        evaluations += run.evaluations
        middles = 0.5 * (run.times[:-1] + run.times[1:])
        times = np.union1d(run.times, middles)
        if len(times) > _MOST_COMPARED:
            times = times[np.unique(np.linspace(0, len(times) - 1, _MOST_COMPARED).astype(int))]
        one, other = last(times), run(times)
        apart = so3.angle(so3.transpose(so3.matrix_from_quat(one[:, :4])) @ so3.matrix_from_quat(other[:, :4]))
        errors = np.maximum.accumulate(np.column_stack([apart, np.abs(one - other)[:, 4:]]), axis=0) + _ROUNDING
        worst = float(errors[-1].max())
        if worst <= tolerance:
            return DrivenAttitude(run, scales, times, errors[:, 0], errors[:, 1:] * scales, evaluations)
        if sharpness * _SHARPER < 0.9 * _LEAST:
            late = times[int(np.argmax(errors.max(axis=1) > tolerance))]
            raise AccuracyNotReached(
                f"two integrations disagree by {worst:.3g} rad where {tolerance:.3g} was requested, from {late:.6g} s "
                "on: the motion magnifies its errors; loosen the tolerance or shorten the motion"
            )
        last = run


def _integrated(rates: Rates, breaks: Array, start: Array, scales: Array, sharpness: float, longest: float) -> _Run:
    from scipy.integrate import solve_ivp

    inner = inside(breaks[:-1], breaks[1:])

    def slope(t: float, y: Array, left: float, right: float) -> Array:
        unit = so3.normalised(y[:4])
        omega, others = rates(min(max(t, left), right), so3.matrix_from_quat(unit), y[4:] * scales)
        (a, b, c, w), (p, q, r) = unit.tolist(), omega.tolist()
        turning = [w * p + b * r - c * q, w * q + c * p - a * r, w * r + a * q - b * p, -a * p - b * q - c * r]
        return np.concatenate([0.5 * np.array(turning), others / scales])

    state, pieces, times, evaluations = start, [], [breaks[:1]], 0
    for a, b, left, right in zip(breaks[:-1], breaks[1:], *inner, strict=True):
        # SciPy asks for the float next to zero, which is an underflow to those who want to be told.
        with np.errstate(under="ignore"):
            run = solve_ivp(
                slope, (a, b), state, "DOP853", dense_output=True, rtol=sharpness, atol=sharpness, max_step=longest,
                args=(left, right),
            )  # fmt: skip
        if not run.success:
            raise AccuracyNotReached(f"DOP853 stopped at t = {run.t[-1]:.9g} s: {run.message}")
        pieces.append(run.sol)
        times.append(run.t[1:])
        evaluations += run.nfev
        state = run.y[:, -1].copy()
        state[:4] = so3.normalised(state[:4])
    return _Run(breaks, tuple(pieces), np.concatenate(times), evaluations)
