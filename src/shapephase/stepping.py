"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator everybody uses.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. Every second step is repeated at twice the length, and
the difference estimates the local error; the linearised equation, carried along, says how errors grow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from . import so3
from .arrays import Array, Integers
from .errors import AccuracyNotReached
from .rotation_step import (
    STAGES,
    body_momentum,
    relative_angle,
    step,
    steps_in_numpy,
    tableau,
    variation,
)
from .sampling import Evaluate, Interpolant, chebyshev

_EPS = np.finfo(float).eps
_SHARE = 64.0  # two half steps of order 8 err 255 times less than the whole one; a quarter of that is relied on
_BLOCK = 256
_SYMBOLIC_BATCH = 24
_MOST_STEPS = 2_000_000
_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class SteppedRotation:
    """S(t), the attitude relative to the start, at every time, for a batch of momenta.

    Attributes
    ----------
    interpolant : the sampled deformation
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    times : (K + 1,) ends of the steps [s]
    panel : (K,) the interpolant's panel of each step
    quaternions : (B, K + 1, 4) xyzw of S at the step ends
    sampling_error, stepping_error : (B,) estimates of the attitude error over the whole interval [rad]
    amplification : (B,) largest growth of an attitude error from one time to a later one
    propagator : (B, 3, 3) how a small turn of the start, S exp(hat(delta)) in base axes, reaches the end; to about
        1e-4, enough to judge errors and to steer a search
    """

    interpolant: Interpolant
    momentum: Array
    times: Array
    panel: Integers
    quaternions: Array
    sampling_error: Array
    stepping_error: Array
    amplification: Array
    propagator: Array

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error over the interval, rounding included: (B,) [rad]."""
        return self.sampling_error + self.stepping_error + self.rounding_error

    @property
    def rounding_error(self) -> Array:
        """What rounding alone contributes: (B,) [rad]."""
        return self.amplification * _EPS * (8.0 + 2.0 * np.sqrt(len(self.times)) + self._total_angle)

    @property
    def _total_angle(self) -> Array:
        speed = np.linalg.norm(np.diff(self.quaternions, axis=1), axis=-1)
        return 2.0 * speed.sum(axis=1)

    def quaternion(self, t: Array) -> Array:
        """S(t) as quaternions: (N,) -> (B, N, 4); a step of the same formula from the step end before t."""
        index = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        lengths = t - self.times[index]
        _, _, c = tableau()
        stage_times = self.times[index, None] + c * lengths[:, None]
        channels = self.interpolant.channels(stage_times, self.panel[index]) * lengths[:, None, None]
        if not self.momentum.any():
            return np.broadcast_to(
                steps_in_numpy(self.quaternions[:1, index], None, channels[..., 6:]), (len(self.momentum), len(t), 4)
            )
        return steps_in_numpy(self.quaternions[:, index], self.momentum[:, None, :], channels)

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        return so3.matrix_from_quat(self.quaternion(t))

    def with_rotations(self, rotations: Array, error: Array) -> SteppedRotation:
        """The same steps with the rotations at their ends (B, K + 1, 3, 3) found by another method."""
        return replace(
            self, quaternions=so3.quat_from_matrix(rotations), stepping_error=error, sampling_error=0.0 * error
        )

    def inverse_and_drift(self, t: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o at times: (N,) -> (N, 3, 3), (N, 3)."""
        return self.interpolant.inverse_and_drift(t)


class Samples(Protocol):
    """What the integrator needs to know of a deformation; `Sampler` is one."""

    def refine(self, momentum: float, tolerance: float) -> None:
        """Sample until the attitude error for momenta up to this size is at most `tolerance` [rad]."""
        ...

    def error(self, momentum: float) -> float:
        """Bound of the attitude error due to sampling [rad]."""
        ...

    def interpolant(self) -> Interpolant:
        """What has been sampled so far."""
        ...


def stepped_rotation(sampler: Samples, momentum: Array, tolerance: float) -> SteppedRotation:
    """Integrate the attitude equation to a tolerance, sampling the deformation as far as that needs.

    Parameters
    ----------
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    tolerance : of the attitude over the whole interval [rad]

    Raises
    ------
    AccuracyNotReached
        If the estimate stays above the tolerance.
    """
    size = float(np.max(np.linalg.norm(momentum, axis=-1), initial=0.0))
    moving = momentum if size > 0.0 else np.zeros((1, 3))
    sampling_target = 0.3 * tolerance
    plan: _Plan | None = None
    last: SteppedRotation | None = None
    for _ in range(_ROUNDS):
        sampler.refine(size, sampling_target)
        interpolant = sampler.interpolant()
        doubles = _first_plan(interpolant, size, tolerance) if plan is None else _plan_for(interpolant, plan)
        solution, local = _run(interpolant, moving, doubles)
        growth = solution.amplification
        bound = replace(
            solution,
            sampling_error=growth * sampler.error(size),
            stepping_error=growth * local.sum(axis=1) / _SHARE,
        )
        if np.all(bound.error_estimate <= tolerance):
            return _for_all(bound, momentum)
        last = bound
        room = 0.6 * tolerance / float(np.max(growth))
        sums = np.max(np.add.reduceat(local, _starts(doubles), axis=1), axis=0) / _SHARE
        if sums.sum() > room:
            doubles = _finer(doubles, sums, room)
        sampling_target = min(sampling_target, 0.5 * room)
        plan = _Plan(interpolant.edges, doubles)
        if doubles.sum() > _MOST_STEPS or np.any(bound.rounding_error > 0.9 * tolerance):
            break
    raise _not_reached(tolerance, last)


def _not_reached(tolerance: float, last: SteppedRotation | None) -> AccuracyNotReached:
    if last is None:
        return AccuracyNotReached(f"the tolerance {tolerance:.3g} rad was not reached")
    parts = [float(np.max(part)) for part in (last.sampling_error, last.stepping_error, last.rounding_error)]
    return AccuracyNotReached(
        f"the tolerance {tolerance:.3g} rad was not reached: the estimate is {np.max(last.error_estimate):.3g} rad, of "
        f"which sampling {parts[0]:.3g}, stepping {parts[1]:.3g} and rounding {parts[2]:.3g}, with errors amplified "
        f"{np.max(last.amplification):.3g} times; loosen the tolerance or shorten the motion"
    )


@dataclass(frozen=True, eq=False)
class _Plan:
    """Double steps for each panel of an interpolant."""

    edges: Array
    doubles: Integers


def _first_plan(interpolant: Interpolant, size: float, tolerance: float) -> Integers:
    """Double steps per panel from the speed of rotation and the bandwidth of the panel."""
    widths = np.diff(interpolant.edges)
    means = np.abs(interpolant.coefficients)
    speed = size * means[:, :, :3].sum(axis=(1, 2)) / 1.5 + np.sqrt((means[:, :, 6:] ** 2).sum(axis=(1, 2)))
    significant = means.sum(axis=2) > np.sqrt(tolerance) * means.sum(axis=2).max(axis=1, keepdims=True)
    swings = significant.shape[1] - 1 - np.argmax(significant[:, ::-1], axis=1)
    fineness = 0.5 * tolerance ** (-1.0 / 9.0)
    return np.maximum(1, np.ceil(fineness * (0.15 * speed * widths + 0.1 * swings))).astype(int)


def _plan_for(interpolant: Interpolant, plan: _Plan) -> Integers:
    """The plan carried over to an interpolant whose panels may have been bisected since."""
    widths = np.diff(interpolant.edges)
    middle = 0.5 * (interpolant.edges[:-1] + interpolant.edges[1:])
    old = np.clip(np.searchsorted(plan.edges, middle) - 1, 0, len(plan.doubles) - 1)
    return np.maximum(1, np.ceil(plan.doubles[old] * widths / np.diff(plan.edges)[old] - 1e-9)).astype(int)


def _finer(doubles: Integers, sums: Array, room: float) -> Integers:
    """More double steps where the local errors are above their share."""
    shares = np.maximum(room * doubles / doubles.sum(), 0.1 * room / len(doubles))
    factor = np.clip((sums / shares) ** 0.125 * 1.05, 1.0, 8.0)
    return np.ceil(doubles * factor).astype(int)


def _starts(doubles: Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(doubles)[:-1]])


def _run(interpolant: Interpolant, momentum: Array, doubles: Integers) -> tuple[SteppedRotation, Array]:
    """All double steps: the solution and the (B, D) differences between double and half steps [rad]."""
    still = not momentum.any()
    channels = _stage_channels(interpolant, doubles)
    march = _march_symbolic if len(momentum) <= _SYMBOLIC_BATCH else _march_numpy
    quaternions, differences, growth = march(channels[:, :, 6:] if still else channels, None if still else momentum)
    fractions = [np.arange(1, 2 * d + 1) / (2 * d) for d in doubles]
    left, widths = interpolant.edges[:-1], np.diff(interpolant.edges)
    times = np.concatenate([[left[0]], *(a + w * f for a, w, f in zip(left, widths, fractions, strict=True))])
    times[np.concatenate([[0], np.cumsum(2 * doubles)])] = interpolant.edges
    panel = np.repeat(np.arange(len(doubles)), 2 * doubles)
    unknown = np.full(len(momentum), np.nan)
    last = so3.transpose(so3.matrix_from_quat(quaternions[:, -1])) if growth is None else growth[:, -1]
    solution = SteppedRotation(
        interpolant, momentum, times, panel, quaternions, unknown, unknown, _amplification(growth), last
    )
    return solution, differences


def _for_all(solution: SteppedRotation, momentum: Array) -> SteppedRotation:
    """The one solution of zero momentum shared by the whole batch."""
    count = len(momentum)
    if len(solution.momentum) == count:
        return replace(solution, momentum=momentum)
    return replace(
        solution,
        momentum=momentum,
        quaternions=np.broadcast_to(solution.quaternions, (count, *solution.quaternions.shape[1:])),
        sampling_error=np.broadcast_to(solution.sampling_error, (count,)),
        stepping_error=np.broadcast_to(solution.stepping_error, (count,)),
        amplification=np.broadcast_to(solution.amplification, (count,)),
        propagator=np.broadcast_to(solution.propagator, (count, 3, 3)),
    )


def _stage_channels(interpolant: Interpolant, doubles: Integers) -> Array:
    """Scaled channels at the 36 stages of each double step: (D, 36, 9).

    First the 12 stages of the whole step, then those of its two halves.
    """
    degree_count = interpolant.coefficients.shape[1]
    channels = np.empty((int(doubles.sum()), 3 * STAGES, 9))
    widths = np.diff(interpolant.edges)
    starts = _starts(doubles)
    for count in np.unique(doubles):
        panels = np.flatnonzero(doubles == count)
        values = _stage_matrix(degree_count, int(count)) @ interpolant.coefficients[panels]
        values = values.reshape(len(panels), count, 3 * STAGES, 9) * (widths[panels] / count)[:, None, None, None]
        rows = (starts[panels, None] + np.arange(count)).ravel()
        channels[rows] = values.reshape(-1, 3 * STAGES, 9)
    channels[:, STAGES:] *= 0.5
    return channels


@lru_cache(maxsize=256)
def _stage_matrix(degree_count: int, count: int) -> Array:
    """Chebyshev coefficients of a panel -> values at all stages of its double steps: (36 count, degrees)."""
    _, _, c = tableau()
    inside = np.concatenate([c, 0.5 * c, 0.5 + 0.5 * c])
    x = 2.0 * (np.arange(count)[:, None] + inside) / count - 1.0
    return chebyshev(np.clip(x, -1.0, 1.0), degree_count).reshape(3 * STAGES * count, degree_count)


def _amplification(growth: Array | None) -> Array:
    """Largest growth of an error from one time to a later one, from the propagators (B, D + 1, 3, 3)."""
    if growth is None:
        return np.ones(1)
    count = growth.shape[1]
    chosen = growth[:, np.unique(np.linspace(0, count - 1, min(count, 48)).astype(int))]
    inverse = np.linalg.inv(chosen)
    worst = np.ones(len(growth))
    for later in range(1, chosen.shape[1]):
        between = chosen[:, later, None] @ inverse[:, :later]
        squares = np.linalg.eigvalsh(np.swapaxes(between, -1, -2) @ between)[..., 2]
        worst = np.maximum(worst, np.sqrt(squares.max(axis=1)))
    return worst


def _march_numpy(channels: Array, momentum: Array | None) -> tuple[Array, Array, Array | None]:
    """All double steps for a large batch, each formula on whole arrays of the batch."""
    batch = 1 if momentum is None else len(momentum)
    quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (batch, 1))
    track = [quaternion]
    differences = np.empty((batch, len(channels)))
    growth = None if momentum is None else [np.tile(np.eye(3), (batch, 1, 1))]
    for number, block in enumerate(channels):
        whole, first, second = block[:STAGES], block[STAGES : 2 * STAGES], block[2 * STAGES :]
        coarse = steps_in_numpy(quaternion, momentum, whole)
        middle = steps_in_numpy(quaternion, momentum, first)
        quaternion = steps_in_numpy(middle, momentum, second)
        differences[:, number] = relative_angle(quaternion.T, coarse.T)
        track += [middle, quaternion]
        if growth is not None and momentum is not None:
            at_middle = body_momentum(middle.T, momentum.T)
            rows = variation(at_middle, 2.0 * second[0])
            matrix = np.moveaxis(np.array([np.broadcast_arrays(*row) for row in rows]), -1, 0)
            growth.append(_exponential(matrix, np.eye(3)) @ growth[-1])
    propagators = None if growth is None else np.stack(growth, axis=1)
    return np.stack(track, axis=1), differences, propagators


def _exponential(matrix: Array, identity: Array) -> Array:
    """exp to fourth order, enough to tell how errors grow."""
    total = identity
    for order in (4.0, 3.0, 2.0, 1.0):
        total = identity + matrix @ total / order
    return total


def _march_symbolic(channels: Array, momentum: Array | None) -> tuple[Array, Array, Array | None]:
    """All double steps for a few momenta, one compiled-expression call for each block of steps."""
    batch = 1 if momentum is None else len(momentum)
    count = len(channels)
    quaternions = np.empty((batch, 2 * count + 1, 4))
    quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0]
    differences = np.empty((batch, count))
    growth = None if momentum is None else np.empty((batch, count + 1, 3, 3))
    width = channels.shape[2] * 3 * STAGES
    for row in range(batch):
        state = np.zeros(4 if momentum is None else 16)
        state[3] = 1.0
        if momentum is not None and growth is not None:
            state[4:13:4] = 1.0
            state[13:] = momentum[row]
            growth[row, 0] = np.eye(3)
        for start in range(0, count, _BLOCK):
            stop = min(start + _BLOCK, count)
            length = _block_length(stop - start)
            block = np.zeros((length, width))
            block[: stop - start] = channels[start:stop].reshape(stop - start, width)
            states, sides = _double_steps(length, momentum is not None)(state, block)
            states, sides = states[: stop - start], sides[: stop - start]
            quaternions[row, 2 * start + 1 : 2 * stop : 2] = sides[:, :4]
            quaternions[row, 2 * start + 2 : 2 * stop + 1 : 2] = states[:, :4]
            differences[row, start:stop] = sides[:, 4]
            if growth is not None:
                growth[row, start + 1 : stop + 1] = states[:, 4:13].reshape(-1, 3, 3)
            state = states[-1].copy()
    return quaternions, differences, growth


def _block_length(count: int) -> int:
    """The next of a few lengths, so that few functions are built; the rest of a block is filled with rest."""
    for length in (4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192):
        if count <= length:
            return length
    return _BLOCK


@lru_cache(maxsize=64)
def _double_steps(length: int, with_momentum: bool) -> Callable[[Array, Array], tuple[Array, Array]]:
    """`length` double steps as one CasADi function.

    Maps the state (quaternion; with momentum also the propagator, row by row, and Pi_0) and the channels
    (length, 36 * 9 or 36 * 3) to the states after each double step and, beside, the quaternion after its first
    half and the difference between whole and half steps.
    """
    function = _double_step_function(with_momentum).mapaccum("double_steps", length)
    sizes = [function.size_out(k) for k in range(2)]

    def call(state: Array, channels: Array) -> tuple[Array, Array]:
        # A buffer holds one call's arguments; made anew, it can be used from any thread.
        buffer, evaluate = function.buffer()
        states, sides = (np.empty((columns, rows)) for rows, columns in sizes)
        buffer.set_arg(0, state.data)
        buffer.set_arg(1, channels.data)
        buffer.set_res(0, states.data)
        buffer.set_res(1, sides.data)
        evaluate()
        return states, sides

    return call


@lru_cache(maxsize=2)
def _double_step_function(with_momentum: bool) -> Any:
    import casadi

    state = casadi.SX.sym("state", 16 if with_momentum else 4)
    per_stage = 9 if with_momentum else 3
    data = casadi.SX.sym("channels", 3 * STAGES * per_stage)
    components = casadi.vertsplit(data)
    stages = [components[per_stage * s : per_stage * (s + 1)] for s in range(3 * STAGES)]
    parts = casadi.vertsplit(state)
    quaternion = parts[:4]
    momentum = parts[13:] if with_momentum else None
    coarse = step(quaternion, momentum, stages[:STAGES])
    middle = step(quaternion, momentum, stages[STAGES : 2 * STAGES])
    end = step(middle, momentum, stages[2 * STAGES :])
    side = casadi.vertcat(*middle, relative_angle(end, coarse))
    if momentum is None:
        return casadi.Function("double_step", [state, data], [casadi.vertcat(*end), side])
    doubled = [2.0 * channel for channel in stages[2 * STAGES]]
    matrix = casadi.vertcat(*(casadi.horzcat(*row) for row in variation(body_momentum(middle, momentum), doubled)))
    propagator = casadi.reshape(casadi.vertcat(*parts[4:13]), 3, 3).T
    total = propagator
    for order in (4.0, 3.0, 2.0, 1.0):
        total = propagator + casadi.mtimes(matrix, total) / order
    following = casadi.vertcat(*end, casadi.reshape(total.T, 9, 1), *momentum)
    return casadi.Function("double_step", [state, data], [following, side])


def dop853_rotation(
    evaluate: Evaluate, breaks: Array, momentum: Array, tolerance: float
) -> tuple[Callable[[Array], Array], int]:
    """S(t) for one Pi_0 by SciPy's DOP853 on the quaternion, restarted at the breaks: the independent check.

    Every stage evaluates the deformation itself; nothing of this module's interpolation or stepping is used.

    Returns
    -------
    dense : times (N,) -> quaternions (N, 4)
    evaluations : of I and L_o
    """
    from scipy.integrate import solve_ivp

    inner = np.nextafter(breaks[:-1], breaks[1:]), np.nextafter(breaks[1:], breaks[:-1])

    def slope(t: float, q: Array, left: float, right: float) -> Array:
        inertia, internal = evaluate(np.array([min(max(t, left), right)]))
        unit = so3.normalised(q)
        omega = np.linalg.solve(inertia[0], so3.matrix_from_quat(unit).T @ momentum - internal[0])
        vector, scalar = q[:3], q[3]
        return 0.5 * np.append(scalar * omega + np.cross(vector, omega), -vector @ omega)

    quaternion, pieces, evaluations = np.array([0.0, 0.0, 0.0, 1.0]), [], 0
    for a, b, left, right in zip(breaks[:-1], breaks[1:], *inner, strict=True):
        run = solve_ivp(
            slope, (a, b), quaternion, "DOP853", dense_output=True, rtol=max(tolerance, 3e-14), atol=1e-2 * tolerance,
            args=(left, right),
        )  # fmt: skip
        if not run.success:
            raise AccuracyNotReached(f"DOP853 stopped at t = {run.t[-1]:.9g} s: {run.message}")
        pieces.append(run.sol)
        evaluations += run.nfev
        quaternion = so3.normalised(run.y[:, -1])

    def dense(t: Array) -> Array:
        piece = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(pieces) - 1)
        values = np.empty((len(t), 4))
        for number in np.unique(piece):
            rows = piece == number
            values[rows] = pieces[number](t[rows]).T
        return so3.normalised(values)

    return dense, evaluations
