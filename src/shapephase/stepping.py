"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator everybody uses.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. Every second step is repeated at twice the length, and
the difference estimates the local error; the linearised equation, carried along, says how errors grow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby

import numpy as np

from . import so3
from .arrays import Array, Integers, finite_array
from .errors import AccuracyNotReached, ShapeError
from .interpolant import Interpolant, chebyshev, inside
from .march import march_in_casadi, march_in_numpy
from .rotation_step import STAGES, steps_in_numpy, tableau
from .sampling import Sampler
from .spectrum import Evaluate

_EPS = np.finfo(float).eps
_SYMBOLIC_BATCH = 24
_LATER, _EARLIER = np.tril_indices(10, -1)
_MOST_STEPS = 2_000_000
_ROUNDS = 12
_TIGHTEST, _LOOSEST = 1e-13, 1e-4


@dataclass(frozen=True, eq=False)
class SteppedRotation:
    """S(t), the attitude relative to the start, at every time, for a batch of momenta.

    Attributes
    ----------
    interpolant : the sampled deformation
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    doubles : (P,) double steps on each of the interpolant's panels, the same in every loop
    quaternions : (B, K + 1, 4) xyzw at the step ends, of the frame whose z axis is the momentum's direction
    sampling_error, stepping_error : (B,) estimates of the attitude error over the whole interval [rad]
    amplification : (B,) largest growth of an attitude error from one time to a later one
    propagator : (B, 3, 3) how a small turn of the start, S exp(hat(delta)) in base axes, reaches the end; to about
        1e-4, enough to judge errors and to steer a search
    """

    interpolant: Interpolant
    momentum: Array
    doubles: Integers
    quaternions: Array
    sampling_error: Array
    stepping_error: Array
    amplification: Array
    propagator: Array

    @cached_property
    def panel(self) -> Integers:
        """The interpolant's panel of each step: (K,)."""
        each = np.tile(2 * self.doubles, self.interpolant.loops)
        return np.repeat(np.arange(len(each)), each)

    @property
    def times(self) -> Array:
        """The ends of the steps: (K + 1,) [s]."""
        return self._times

    @cached_property
    def _times(self) -> Array:
        edges, panel = self.interpolant.edges, self.panel
        each = np.tile(2 * self.doubles, self.interpolant.loops)
        within = np.arange(len(panel)) - np.repeat(np.cumsum(each) - each, each)
        return np.append(edges[panel] + (edges[panel + 1] - edges[panel]) * (within / each[panel]), edges[-1])

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error over the interval, rounding included: (B,) [rad]."""
        return self.sampling_error + self.stepping_error + self.rounding_error

    @cached_property
    def rounding_error(self) -> Array:
        """What rounding alone contributes: (B,) [rad]."""
        turned = 2.0 * np.linalg.norm(np.diff(self.quaternions, axis=1), axis=-1).sum(axis=1)
        return self.amplification * _EPS * (8.0 + 2.0 * np.sqrt(self.quaternions.shape[1]) + turned)

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


def tolerance_argument(tolerance: float) -> float:
    """A user's tolerance of an attitude [rad]. Raises ShapeError outside 1e-13 to 1e-4."""
    goal = finite_array(tolerance, "tolerance", unit="rad")
    if goal.ndim or not _TIGHTEST <= goal <= _LOOSEST:
        raise ShapeError(f"tolerance: a number from {_TIGHTEST:g} to {_LOOSEST:g} rad is needed, got {tolerance!r}")
    return float(goal)


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
    rounds = 0
    while True:
        rounds += 1
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
        # Steps that are still far too long tell nothing about how errors grow.
        telling = local.sum(axis=1).max() < 1e-2 and bool(np.isfinite(growth).all())
        worst = float(np.max(growth)) if telling else 1.0
        room = 0.6 * tolerance / worst
        by_loop = local.reshape(len(local), interpolant.loops, -1).sum(axis=1)
        sums = np.max(np.add.reduceat(by_loop, _starts(doubles), axis=1), axis=0)
        if sums.sum() > room:
            doubles = _finer(doubles, sums, room)
        sampling_target = min(sampling_target, 0.5 * room)
        plan = _Plan(interpolant.edges[: len(doubles) + 1], doubles)
        too_many = rounds == _ROUNDS or doubles.sum() * interpolant.loops > _MOST_STEPS
        if too_many or (telling and np.any(bound.rounding_error > 0.9 * tolerance)):
            raise _not_reached(tolerance, bound)


def _local_errors(differences: Array, coarse: Array, fine: Array) -> Array:
    """Error estimates of double steps [rad], from their differences to steps of twice the length.

    Once the steps are small, two half steps of order eight err 255 times less than the whole one; an eighth of that is
    relied on. Whether they are small shows in the distances to a fifth-order formula on the same stages, of the
    whole step (`coarse`) and of its halves (`fine`): these fall by 32 then, and hardly at all where a step jumps over
    what happens inside it. Where a step is so long that it overflows, half a turn may be wrong.
    """
    finite = np.isfinite(differences) & np.isfinite(coarse) & np.isfinite(fine)
    differences, coarse, fine = (np.where(finite, part, np.pi) for part in (differences, coarse, fine))
    fall = np.maximum(coarse, 1e-300) / np.maximum(fine, 1e-16)
    return differences / np.clip(30.0 * (fall / 24.0) ** 3, 0.7, 30.0)


def _not_reached(tolerance: float, last: SteppedRotation) -> AccuracyNotReached:
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
    march = march_in_casadi if len(momentum) <= _SYMBOLIC_BATCH else march_in_numpy
    if size.any():
        quaternions, judged, growth = march(channels, start, size, interpolant.loops)
    else:
        quaternions, judged, growth = march(channels[:, :, 6:], start, None, interpolant.loops)
    unknown = np.full(len(momentum), np.nan)
    last = so3.transpose(so3.matrix_from_quat(quaternions[:, -1])) if growth is None else growth[:, -1]
    solution = SteppedRotation(
        interpolant, momentum, doubles, quaternions, unknown, unknown, _amplification(growth), last
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
    half_widths = 0.5 * np.diff(interpolant.edges[: len(doubles) + 1])
    coefficients = interpolant.coefficients * half_widths[:, None, None]
    channels = np.empty((int(doubles.sum()), 3 * STAGES, 9))
    panel = row = 0
    for count, run in groupby(doubles.tolist()):
        panels = len(list(run))
        stages = _stage_matrix(coefficients.shape[1], count) @ coefficients[panel : panel + panels]
        channels[row : row + panels * count] = stages.reshape(-1, 3 * STAGES, 9)
        panel, row = panel + panels, row + panels * count
    return channels


@lru_cache(maxsize=256)
def _stage_matrix(degree_count: int, count: int) -> Array:
    """Chebyshev coefficients of a panel -> values at all stages of its double steps, times the step's share of it.

    (36 count, degrees)
    """
    _, _, c = tableau()
    inside = np.concatenate([c, 0.5 * c, 0.5 + 0.5 * c])
    x = 2.0 * (np.arange(count)[:, None] + inside) / count - 1.0
    share = np.repeat([1.0, 0.5, 0.5], STAGES) / count
    values = chebyshev(np.clip(x, -1.0, 1.0), degree_count) * share[:, None]
    return values.reshape(3 * STAGES * count, degree_count)


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
