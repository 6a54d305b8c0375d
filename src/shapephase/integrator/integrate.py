"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator everybody uses.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. An embedded formula estimates each step's error, and the
linearised equation, carried along, says how errors grow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby

import numpy as np

from .. import so3, sphere
from ..arguments import LOOSEST_TOLERANCE
from ..arrays import Array, Integers
from ..errors import AccuracyNotReached
from .error_propagator import amplification, exact_propagators, momentum_slope
from .interpolant import Interpolant, chebyshev, inside
from .rotation_step import STAGES, momentum_step, product, rest_step, tableau, turned
from .sampling import Sampler
from .spectral_error import Evaluate
from .step_control import StepRequirements, carried_over, finer
from .step_loop import FEW, StepRecord, integrate_steps, integrate_steps_at_rest

_EPS = np.finfo(float).eps
_MOST_STEPS = 4_000_000
_ROUNDS = 12
_MANY_STEPS = 4000
_BATCHED = (
    "quaternions", "directions", "turns", "dynamics", "sampling_error", "stepping_error", "amplification",
    "propagator",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class SteppedRotation:
    """S(t), the attitude relative to the start, at every time, for a batch of momenta.

    Attributes
    ----------
    interpolant : the sampled deformation
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    steps : (P,) steps on each of the interpolant's panels, the same in every loop
    quaternions : (B, K + 1, 4) xyzw at the step ends
    directions : (B, K + 1, 3) Pi/|Pi| at the step ends; (B, 0, 3) where no momentum of the batch differs from zero
    turns : (B, K) of each step about its starting direction, the shortest rotation between its ends taken off [rad]
    dynamics : (B, K) dynamic phase of each step [rad]
    sampling_error, stepping_error : (B,) estimates of the attitude error over the whole interval [rad]
    amplification : (B,) largest growth of an attitude error from one time to a later one
    propagator : (B, 3, 3) how a small turn of the start, S exp(hat(delta)) in base axes, reaches the end; to a few
        thousandths, enough to judge errors and to steer a search
    """

    interpolant: Interpolant
    momentum: Array
    steps: Integers
    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    sampling_error: Array
    stepping_error: Array
    amplification: Array
    propagator: Array

    @cached_property
    def panel(self) -> Integers:
        """The interpolant's panel of each step: (K,)."""
        each = np.tile(self.steps, self.interpolant.loops)
        return np.repeat(np.arange(len(each)), each)

    @property
    def times(self) -> Array:
        """The ends of the steps: (K + 1,) [s]."""
        return self._times

    @cached_property
    def _times(self) -> Array:
        edges, panel = self.interpolant.edges, self.panel
        each = np.tile(self.steps, self.interpolant.loops)
        within = np.arange(len(panel)) - np.repeat(np.cumsum(each) - each, each)
        return np.append(edges[panel] + (edges[panel + 1] - edges[panel]) * (within / each[panel]), edges[-1])

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error over the interval, rounding included: (B,) [rad]."""
        return self.sampling_error + self.stepping_error + self.rounding_error

    @cached_property
    def rounding_error(self) -> Array:
        """What rounding alone contributes: (B,) [rad]."""
        chords = self.quaternions[:, 1:] - self.quaternions[:, :-1]
        turned_by = 2.0 * np.sqrt(np.einsum("bki,bki->bk", chords, chords)).sum(axis=1)
        # The rate of turning itself is known to a few units of rounding only, which is felt as the body turns on.
        committed = 8.0 + 2.0 * np.sqrt(self.quaternions.shape[1]) + turned_by
        return _EPS * (self.amplification * committed + 4.0 * turned_by)

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        return so3.matrix_from_quat(self._at(t)[0])

    @property
    def end(self) -> Array:
        """S at the end of the interval: (B, 3, 3)."""
        return so3.matrix_from_quat(self.quaternions[:, -1])

    def dynamic_phase(self, t: Array) -> Array:
        """The integral of omega . Pi/|Pi| from 0 to t: (N,) -> (B, N) [rad]; zero without momentum."""
        index = self._step_of(t)
        before = np.cumsum(self.dynamics, axis=1) - self.dynamics
        return (before[:, index] + self._at(t)[3]) * self._moving

    def solid_angle(self, t: Array) -> Array:
        """Of the momentum's curve from 0 to t, closed by the great circle: (N,) -> (B, N) [sr]; without momentum zero.

        Seen from this description's frame, positive where the curve goes counter-clockwise seen from outside. It
        grows continuously from zero as long as the curve keeps away from the point opposite its start, at which
        it jumps by 4 pi.
        """
        if not self.directions.shape[1]:
            return np.zeros((len(self.momentum), len(t)))
        index = self._step_of(t)
        start, corners = self.directions[:, :1], self.directions
        fans = sphere.triangle_area(start, corners[:, :-1], corners[:, 1:]) + self.dynamics - self.turns
        before = np.cumsum(fans, axis=1) - fans
        _, there, turn, dynamic = self._at(t)
        return (
            before[:, index] + sphere.triangle_area(start, corners[:, index], there) + dynamic - turn
        ) * self._moving

    @property
    def _moving(self) -> Array:
        """One where there is momentum, else zero: (B, 1)."""
        return np.any(self.momentum != 0.0, axis=1, keepdims=True).astype(np.float64)

    @cached_property
    def momentum_slope(self) -> Array:
        """How the end turns, S exp(hat(slope dPi)), by a change dPi of the body momentum at the start: (B, 3, 3).

        The derivative of steps like those that were taken.
        """
        return momentum_slope(_stage_channels(self.interpolant, self.steps), self.momentum, self.interpolant.loops)

    def _step_of(self, t: Array) -> Integers:
        return np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)

    def _at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """A step of the same formula from the step end before t: (N,) -> quaternion, direction, turn, dynamic phase."""
        index = self._step_of(t)
        lengths = t - self.times[index]
        _, _, c = tableau()
        channels = self.interpolant.channels(self.times[index, None] + c * lengths[:, None], self.panel[index])
        stages = np.moveaxis(channels * lengths[:, None, None], 0, -1)
        before = list(np.moveaxis(self.quaternions[:, index], -1, 0))
        nothing = np.zeros((len(self.momentum), len(t)))
        if not self.directions.shape[1]:
            step, _ = rest_step(stages[:, 6:])
            return _stacked(product(before, step)), np.zeros((*nothing.shape, 3)), nothing, nothing
        start = list(np.moveaxis(self.directions[:, index], -1, 0))
        size = np.linalg.norm(self.momentum, axis=-1)[:, None]
        end, turn, dynamic, _ = momentum_step(start, size, stages)
        half = 0.5 * turn
        there = turned(before, start, end, (np.sin(half), np.cos(half)))
        return _stacked(there), _stacked(end), turn, dynamic

    def with_rotations(self, rotations: Array, error: Array) -> SteppedRotation:
        """The same steps with the rotations at their ends (B, K + 1, 3, 3) found by another method."""
        directions = self.directions
        if directions.shape[1]:
            directions = so3.apply(so3.transpose(rotations), directions[:, :1])
        return replace(
            self,
            quaternions=so3.quat_from_matrix(rotations),
            directions=directions,
            stepping_error=error,
            sampling_error=0.0 * error,
        )

    def inverse_and_drift(self, t: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o at times: (N,) -> (N, 3, 3), (N, 3)."""
        return self.interpolant.inverse_and_drift(t)


def _stacked(parts: list[Array]) -> Array:
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


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
    sizes = np.sqrt((momentum * momentum).sum(axis=-1))
    size = float(sizes.max(initial=0.0))
    # Errors grow with momentum, nobody knows yet how much; samples are cheaper than a second attempt.
    sampling_target = (0.05 if size > 0.0 else 0.3) * tolerance
    steps: Integers | None = None
    # Among many there are some that need more steps than most; a second attempt takes them all along.
    ease = 1.0 if len(momentum) <= FEW else 0.1
    known: tuple[Array, Array] | None = None
    edges = np.empty(0)
    rounds = 0
    while True:
        rounds += 1
        sampler.refine(size, sampling_target)
        interpolant = sampler.interpolant()
        needs = StepRequirements.of(interpolant, size, tolerance)
        # For each of many the derivative would take too long: steps so short that it is not needed.
        short = needs.far and len(momentum) > FEW
        least = needs.least_steps(short=short)
        planned = needs.first_plan(ease * tolerance) if steps is None else carried_over(interpolant, edges, steps)
        many = interpolant.loops * np.maximum(planned, least).sum() > _MANY_STEPS
        if size > 0.0 and known is None and (many or (needs.far and not short)):
            known = _growth_of_long(interpolant, momentum, sizes)
            # So many steps, each in need of that much more accuracy.
            share = 0.01 * planned.sum() * interpolant.loops * max(1.0, float(np.nan_to_num(known[0]).max()))
            planned = needs.first_plan(max(tolerance / share, 1e-18))
        steps = np.ceil(np.maximum(planned, least)).astype(int)
        march = _run(interpolant, momentum, sizes, steps, with_growth=known is None)
        local = needs.caution(steps) * march.errors
        total = local.sum(axis=1)
        if not np.isfinite(total).all():
            local = np.where(np.isfinite(local), local, np.pi)
            total = local.sum(axis=1)
        growth, last = known or (amplification(march.growth), _last(march))
        bound = SteppedRotation(
            interpolant,
            momentum,
            steps,
            march.quaternions,
            march.directions,
            march.turns,
            march.dynamics,
            growth * sampler.error(size),
            # What the plan took for too small to be resolved counts too.
            growth * total + 1e-3 * tolerance,
            growth,
            last,
        )
        if (bound.error_estimate <= tolerance).all():
            return _for_all(bound, momentum)
        # Steps that are still far too long tell nothing about how errors grow.
        telling = total.max() < 1e-2 and bool(np.isfinite(growth).all())
        worst = float(growth.max()) if telling else 1.0
        # Less in every round: where one of the errors is at its floor, the others must make room for it.
        left = max(tolerance - float(bound.rounding_error.max()), 0.1 * tolerance)
        room = 0.6 * 0.8 ** (rounds - 1) * left / worst
        by_loop = local.reshape(len(local), interpolant.loops, -1).sum(axis=1)
        sums = np.add.reduceat(by_loop, np.cumsum(steps) - steps, axis=1).max(axis=0)
        if sums.sum() > room:
            steps = finer(steps, sums, room)
        sampling_target = min(sampling_target, 0.5 * room)
        edges = interpolant.edges[: len(steps) + 1]
        too_many = rounds == _ROUNDS or steps.sum() * interpolant.loops > _MOST_STEPS
        if too_many or (telling and np.any(bound.rounding_error > 0.9 * tolerance)):
            raise _not_reached(tolerance, bound)


def _not_reached(tolerance: float, last: SteppedRotation) -> AccuracyNotReached:
    parts = [float(np.max(part)) for part in (last.sampling_error, last.stepping_error, last.rounding_error)]
    return AccuracyNotReached(
        f"the tolerance {tolerance:.3g} rad was not reached: the estimate is {np.max(last.error_estimate):.3g} rad, of "
        f"which sampling {parts[0]:.3g}, stepping {parts[1]:.3g} and rounding {parts[2]:.3g}, with errors amplified "
        f"{np.max(last.amplification):.3g} times; loosen the tolerance or shorten the motion"
    )


def _growth_of_long(interpolant: Interpolant, momentum: Array, sizes: Array) -> tuple[Array, Array]:
    """Amplification (B,) and propagator (B, 3, 3) of many steps, by the derivative of coarse ones.

    What is but nearly right drifts off in the end.
    """
    least = StepRequirements.of(interpolant, float(sizes.max()), LOOSEST_TOLERANCE).least_steps()
    steps = np.ceil(np.maximum(least, 1.0)).astype(int)
    channels, directions = _stage_channels(interpolant, steps), _directions(momentum, sizes)
    amplified, last = np.empty(len(sizes)), np.empty((len(sizes), 3, 3))
    with np.errstate(all="ignore"):
        for row in range(len(sizes)):
            part = slice(row, row + 1)
            growth = exact_propagators(channels, directions[part], sizes[part], interpolant.loops)
            amplified[part], last[part] = amplification(growth), growth[:, -1]
    return amplified, last


def _last(march: StepRecord) -> Array:
    """How a small turn of the start reaches the end."""
    if march.growth.shape[1]:
        return march.growth[:, -1]
    return so3.transpose(so3.matrix_from_quat(march.quaternions[:, -1]))


def _run(
    interpolant: Interpolant, momentum: Array, sizes: Array, steps: Integers, *, with_growth: bool = True
) -> StepRecord:
    """All steps."""
    channels = _stage_channels(interpolant, steps)
    if not sizes.any():
        return integrate_steps_at_rest(channels, interpolant.loops)
    return integrate_steps(channels, _directions(momentum, sizes), sizes, interpolant.loops, with_growth=with_growth)


def _directions(momentum: Array, sizes: Array) -> Array:
    """Pi/|Pi|; of a motion without momentum among others with it any direction shows the rotation."""
    moving = sizes > 0.0
    if moving.all():
        return momentum / sizes[:, None]
    return np.where(moving[:, None], momentum, [0.0, 0.0, 1.0]) / np.where(moving, sizes, 1.0)[:, None]


def _for_all(solution: SteppedRotation, momentum: Array) -> SteppedRotation:
    """The one solution of zero momentum shared by the whole batch."""
    count = len(momentum)
    if len(solution.quaternions) == count:
        return solution
    shared = {name: getattr(solution, name) for name in _BATCHED}
    return replace(solution, **{name: np.broadcast_to(v, (count, *v.shape[1:])) for name, v in shared.items()})


def _stage_channels(interpolant: Interpolant, steps: Integers) -> Array:
    """Channels at the 12 stages of each step of the first loop, times the step's length: (K, 108)."""
    widths = np.diff(interpolant.edges[: len(steps) + 1])
    coefficients = interpolant.coefficients * widths[:, None, None]
    degrees = coefficients.shape[1]
    channels = np.empty((int(steps.sum()) * STAGES, 9))
    panel = row = 0
    for count, run in groupby(steps.tolist()):
        panels = len(list(run))
        stop = row + panels * count * STAGES
        out = channels[row:stop].reshape(panels, count * STAGES, 9)
        np.matmul(_stage_matrix(degrees, count), coefficients[panel : panel + panels], out=out)
        panel, row = panel + panels, stop
    return channels.reshape(-1, 9 * STAGES)


@lru_cache(maxsize=512)
def _stage_matrix(degree_count: int, count: int) -> Array:
    """Chebyshev coefficients of a panel -> values at all stages of its steps, times the step's share of it.

    (12 count, degrees)
    """
    _, _, c = tableau()
    x = 2.0 * (np.arange(count)[:, None] + c) / count - 1.0
    return chebyshev(np.clip(x, -1.0, 1.0), degree_count).reshape(STAGES * count, degree_count) / count


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
