"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator everybody uses.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. Every second step is repeated at twice the length, and
the difference estimates the local error; the linearised equation, carried along, says how errors grow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from . import so3
from .arrays import Array, Integers
from .errors import AccuracyNotReached
from .rotation_step import (
    STAGES,
    body_momentum,
    judged_step,
    judged_steps_in_numpy,
    relative_angle,
    steps_in_numpy,
    tableau,
    variation,
)
from .sampling import Evaluate, Interpolant, Sampler, chebyshev, inside

_EPS = np.finfo(float).eps
_BLOCK = 256
_SYMBOLIC_BATCH = 24
_LATER, _EARLIER = np.tril_indices(10, -1)
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
    quaternions : (B, K + 1, 4) xyzw at the step ends, of the frame whose z axis is the momentum's direction
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

    @cached_property
    def rounding_error(self) -> Array:
        """What rounding alone contributes: (B,) [rad]."""
        turned = 2.0 * np.linalg.norm(np.diff(self.quaternions, axis=1), axis=-1).sum(axis=1)
        return self.amplification * _EPS * (8.0 + 2.0 * np.sqrt(len(self.times)) + turned)

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        return self._first @ so3.matrix_from_quat(self._quaternion(t))

    @property
    def end(self) -> Array:
        """S at the end of the interval: (B, 3, 3)."""
        return self._first[:, 0] @ so3.matrix_from_quat(self.quaternions[:, -1])

    @cached_property
    def _first(self) -> Array:
        return so3.transpose(so3.matrix_from_quat(self.quaternions[:, :1]))

    def _quaternion(self, t: Array) -> Array:
        """(N,) -> (B, N, 4): a step of the same formula from the step end before t."""
        index = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        lengths = t - self.times[index]
        _, _, c = tableau()
        stage_times = self.times[index, None] + c * lengths[:, None]
        channels = self.interpolant.channels(stage_times, self.panel[index]) * (0.5 * lengths[:, None, None])
        size = np.linalg.norm(self.momentum, axis=-1)
        if not size.any():
            same = steps_in_numpy(self.quaternions[:1, index], None, channels[..., 6:])
            return np.broadcast_to(same, (len(size), len(t), 4))
        return steps_in_numpy(self.quaternions[:, index], size[:, None], channels)

    def with_rotations(self, rotations: Array, error: Array) -> SteppedRotation:
        """The same steps with the rotations at their ends (B, K + 1, 3, 3) found by another method."""
        framed = so3.transpose(self._first) @ rotations
        return replace(self, quaternions=so3.quat_from_matrix(framed), stepping_error=error, sampling_error=0.0 * error)

    def inverse_and_drift(self, t: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o at times: (N,) -> (N, 3, 3), (N, 3)."""
        return self.interpolant.inverse_and_drift(t)


def stepped_rotation(sampler: Sampler, momentum: Array, tolerance: float) -> SteppedRotation:
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
            stepping_error=growth * local.sum(axis=1),
        )
        if np.all(bound.error_estimate <= tolerance):
            return _for_all(bound, momentum)
        last = bound
        # Steps that are still far too long tell nothing about how errors grow.
        telling = local.sum(axis=1).max() < 1e-2
        worst = float(np.max(growth)) if telling else 1.0
        room = 0.6 * tolerance / worst
        by_loop = local.reshape(len(local), interpolant.loops, -1).sum(axis=1)
        sums = np.max(np.add.reduceat(by_loop, _starts(doubles), axis=1), axis=0)
        if sums.sum() > room:
            doubles = _finer(doubles, sums, room)
        sampling_target = min(sampling_target, 0.5 * room)
        plan = _Plan(interpolant.edges[: len(doubles) + 1], doubles)
        if doubles.sum() * interpolant.loops > _MOST_STEPS or (
            telling and np.any(bound.rounding_error > 0.9 * tolerance)
        ):
            break
    raise _not_reached(tolerance, last)


def _local_errors(differences: Array, coarse: Array, fine: Array) -> Array:
    """Error estimates of double steps [rad], from their differences to steps of twice the length.

    Once the steps are small, two half steps of order eight err 255 times less than the whole one; an eighth of that is
    relied on. Whether they are small shows in the distances to a fifth-order formula on the same stages, of the
    whole step (`coarse`) and of its halves (`fine`): these fall by 32 then, and hardly at all where a step jumps over
    what happens inside it.
    """
    fall = np.maximum(coarse, 1e-300) / np.maximum(fine, 1e-16)
    return differences / np.clip(30.0 * (fall / 24.0) ** 3, 0.7, 30.0)


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
    """Double steps per panel from the speed of rotation and the bandwidth of the panel.

    The two factors were fitted to the steps found by trial on the benchmark's cases at three tolerances; nine times in
    ten the first plan does.
    """
    widths = np.diff(interpolant.edges[: len(interpolant.coefficients) + 1])
    sizes = np.abs(interpolant.coefficients)
    rates = size * sizes[:, :, :6].sum(axis=2) + sizes[:, :, 6:].sum(axis=2)
    turn = widths * rates.sum(axis=1)
    swing = (widths * (rates @ np.arange(rates.shape[1]) ** 4.0)) ** 0.25
    # A step must not jump over what happens inside a panel: two degrees that carry the motion for each double step,
    # four of those that matter at all.
    least = np.ones(len(rates))
    for share, threshold in ((0.5, 0.1 * rates.max(axis=1)), (0.25, 0.1 * tolerance / widths)):
        matters = rates > threshold[:, None]
        degree = np.where(matters.any(axis=1), rates.shape[1] - 1 - np.argmax(matters[:, ::-1], axis=1), 0)
        least = np.maximum(least, share * degree)
    return np.ceil(np.maximum(tolerance**-0.125 * (0.012 * turn + 0.15 * swing), least)).astype(int)


def _plan_for(interpolant: Interpolant, plan: _Plan) -> Integers:
    """The plan carried over to an interpolant whose panels may have been bisected since."""
    edges = interpolant.edges[: len(interpolant.coefficients) + 1]
    widths = np.diff(edges)
    middle = 0.5 * (edges[:-1] + edges[1:])
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
    """All double steps: the solution and the estimates of their local errors (B, D) [rad]."""
    size = np.linalg.norm(momentum, axis=-1)
    start = _frame_along(momentum, size)
    channels = _stage_channels(interpolant, doubles)
    march = _march_symbolic if len(momentum) <= _SYMBOLIC_BATCH else _march_numpy
    if size.any():
        quaternions, judged, growth = march(channels, start, size, interpolant.loops)
    else:
        quaternions, judged, growth = march(channels[:, :, 6:], start, None, interpolant.loops)
    edges = interpolant.edges
    each = np.tile(2 * doubles, interpolant.loops)
    panel = np.repeat(np.arange(len(each)), each)
    within = np.arange(len(panel)) - np.repeat(np.cumsum(each) - each, each)
    times = np.append(edges[panel] + (edges[panel + 1] - edges[panel]) * (within / each[panel]), edges[-1])
    unknown = np.full(len(momentum), np.nan)
    last = so3.transpose(so3.matrix_from_quat(quaternions[:, -1])) if growth is None else growth[:, -1]
    solution = SteppedRotation(
        interpolant, momentum, times, panel, quaternions, unknown, unknown, _amplification(growth), last
    )
    return solution, _local_errors(*np.moveaxis(judged, -1, 0))


def _frame_along(momentum: Array, size: Array) -> Array:
    """Quaternions (B, 4) of frames, seen from which the momentum is the z axis: R^T z = momentum / size."""
    x, y, z = (momentum / np.where(size > 0.0, size, 1.0)[:, None]).T
    across = x * x + y * y
    scalar = np.where(z < 0.0, across / (1.0 + np.abs(z)), 1.0 + z)
    opposite = (size > 0.0) & (across + scalar == 0.0)
    scalar = np.where(size > 0.0, scalar, 1.0)
    return so3.normalised(np.stack([np.where(opposite, 1.0, y), -x, np.zeros_like(x), scalar], axis=-1))


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
    """Channels at the 36 stages of each double step of the first loop, times half the step length: (D, 36, 9).

    First the 12 stages of the whole step, then those of its two halves.
    """
    degree_count = interpolant.coefficients.shape[1]
    channels = np.empty((int(doubles.sum()), 3 * STAGES, 9))
    widths = 0.5 * np.diff(interpolant.edges[: len(doubles) + 1])
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
    """Largest growth of an error from one time to a later one, from the propagators (B, D + 1, 3, 3).

    Between ten times. The flow has determinant one (I^-1 hat(Pi) - hat(omega) has no trace), so the adjugate is
    the inverse; the largest singular value is bounded by the sixteenth root of the sum of the sixteenth
    powers of all three, at most 7 % above it.
    """
    if growth is None:
        return np.ones(1)
    count = growth.shape[1]
    chosen = growth[:, np.arange(10) * (count - 1) // 9]
    between = chosen[:, _LATER] @ _adjugate(chosen)[:, _EARLIER]
    square = np.swapaxes(between, -1, -2) @ between
    scale = np.trace(square, axis1=-2, axis2=-1)
    power = square / scale[..., None, None]
    power = power @ power
    power = power @ power
    top = np.sqrt(scale) * np.sum(power * power, axis=(-1, -2)) ** 0.0625
    return np.maximum(1.0, top.max(axis=1))


def _adjugate(matrix: Array) -> Array:
    """Adjugates of 3 x 3 matrices (..., 3, 3)."""
    result = np.empty_like(matrix)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            n, o = (m + 1) % 3, (m + 2) % 3
            result[..., m, i] = matrix[..., j, n] * matrix[..., k, o] - matrix[..., j, o] * matrix[..., k, n]
    return result


def _march_numpy(channels: Array, start: Array, size: Array | None, loops: int) -> tuple[Array, Array, Array | None]:
    """All double steps for a large batch, each formula on whole arrays of the batch."""
    quaternion = start
    track = [quaternion]
    judged = np.empty((len(start), loops * len(channels), 3))
    growth = None if size is None else [np.tile(np.eye(3), (len(start), 1, 1))]
    for number in range(loops * len(channels)):
        block = channels[number % len(channels)]
        whole, first, second = block[:STAGES], block[STAGES : 2 * STAGES], block[2 * STAGES :]
        coarse, far = judged_steps_in_numpy(quaternion, size, whole)
        middle, near = judged_steps_in_numpy(quaternion, size, first)
        quaternion, next_near = judged_steps_in_numpy(middle, size, second)
        judged[:, number, 0] = relative_angle(quaternion.T, coarse.T)
        judged[:, number, 1], judged[:, number, 2] = np.sqrt(far), np.sqrt(near) + np.sqrt(next_near)
        track += [middle, quaternion]
        if growth is not None:
            rows = variation(body_momentum(middle.T, size), 4.0 * second[0])
            matrix = np.moveaxis(np.array([np.broadcast_arrays(*row) for row in rows]), -1, 0)
            growth.append(_exponential(matrix) @ growth[-1])
    propagators = None if growth is None else np.stack(growth, axis=1)
    return np.stack(track, axis=1), judged, propagators


def _exponential(matrix: Array) -> Array:
    """exp by its (2, 2) Pade approximant: of fourth order, and a rotation where the matrix is antisymmetric."""
    even, odd = np.eye(3) + matrix @ matrix / 12.0, 0.5 * matrix
    return np.linalg.solve(even - odd, even + odd)


def _march_symbolic(channels: Array, start: Array, size: Array | None, loops: int) -> tuple[Array, Array, Array | None]:
    """All double steps for a few momenta, one call of a CasADi function for each block of steps."""
    batch, count = len(start), len(channels)
    total = loops * count
    quaternions = np.empty((batch, 2 * total + 1, 4))
    quaternions[:, 0] = start
    judged = np.empty((batch, total, 3))
    growth = None if size is None else np.empty((batch, total + 1, 3, 3))
    blocks = [_Block(channels[k : k + _BLOCK], size is not None) for k in range(0, count, _BLOCK)]
    for row in range(batch):
        state = np.zeros(4 if size is None else 14)
        state[:4] = start[row]
        if size is not None and growth is not None:
            state[4:13:4] = 1.0
            state[13] = size[row]
            growth[row, 0] = np.eye(3)
        done = 0
        for _ in range(loops):
            for block in blocks:
                states, sides = block(state)
                stop = done + block.count
                quaternions[row, 2 * done + 1 : 2 * stop : 2] = sides[:, :4]
                quaternions[row, 2 * done + 2 : 2 * stop + 1 : 2] = states[:, :4]
                judged[row, done:stop] = sides[:, 4:]
                if growth is not None:
                    growth[row, done + 1 : stop + 1] = states[:, 4:13].reshape(-1, 3, 3)
                state, done = states[-1], stop
    return quaternions, judged, growth


class _Block:
    """A run of double steps over given channels, ready to be called with one state after another.

    A state holds the quaternion and, with momentum, the propagator row by row and the momentum's size.
    """

    def __init__(self, channels: Array, with_momentum: bool) -> None:
        self.count = len(channels)
        length = _block_length(self.count)
        function = _double_steps(length, with_momentum)
        self._channels = np.zeros((length, channels[0].size))
        self._channels[: self.count] = channels.reshape(self.count, -1)
        self._state = np.empty(function.size1_in(0))
        self._results = [np.empty((length, function.size1_out(k))) for k in range(2)]
        # The buffer belongs to this block: threads that integrate at the same time do not share it.
        self._buffer, self._evaluate = function.buffer()
        for place, argument in enumerate((self._state, self._channels)):
            self._buffer.set_arg(place, argument.data)
        for place, result in enumerate(self._results):
            self._buffer.set_res(place, result.data)

    def __call__(self, state: Array) -> tuple[Array, Array]:
        """States after each double step, and beside: the quaternion after its first half and what judges the step."""
        self._state[:] = state
        self._evaluate()
        states, sides = self._results
        return states[: self.count], sides[: self.count]


def _block_length(count: int) -> int:
    """The next of a few lengths, so that few functions are built; the rest of a block is filled with rest."""
    for length in (4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192):
        if count <= length:
            return length
    return _BLOCK


@lru_cache(maxsize=64)
def _double_steps(length: int, with_momentum: bool) -> Any:
    """`length` double steps as one CasADi function of the state and the channels (length, 36 * 9 or 36 * 3)."""
    return _double_step_function(with_momentum).mapaccum("double_steps", length)


@lru_cache(maxsize=2)
def _double_step_function(with_momentum: bool) -> Any:
    import casadi

    state = casadi.SX.sym("state", 14 if with_momentum else 4)
    per_stage = 9 if with_momentum else 3
    data = casadi.SX.sym("channels", 3 * STAGES * per_stage)
    components = casadi.vertsplit(data)
    stages = [components[per_stage * s : per_stage * (s + 1)] for s in range(3 * STAGES)]
    parts = casadi.vertsplit(state)
    quaternion = parts[:4]
    size = parts[13] if with_momentum else None
    coarse, far = judged_step(quaternion, size, stages[:STAGES])
    middle, near = judged_step(quaternion, size, stages[STAGES : 2 * STAGES])
    end, next_near = judged_step(middle, size, stages[2 * STAGES :])
    side = casadi.vertcat(*middle, relative_angle(end, coarse), far**0.5, near**0.5 + next_near**0.5)
    if size is None:
        return casadi.Function("double_step", [state, data], [casadi.vertcat(*end), side])
    doubled = [4.0 * channel for channel in stages[2 * STAGES]]
    matrix = casadi.vertcat(*(casadi.horzcat(*row) for row in variation(body_momentum(middle, size), doubled)))
    propagator = casadi.reshape(casadi.vertcat(*parts[4:13]), 3, 3).T
    even, odd = casadi.SX.eye(3) + casadi.mtimes(matrix, matrix) / 12.0, 0.5 * matrix
    total = casadi.mtimes(casadi.inv_minor(even - odd), casadi.mtimes(even + odd, propagator))
    following = casadi.vertcat(*end, casadi.reshape(total.T, 9, 1), size)
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

    inner = inside(breaks[:-1], breaks[1:])

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
