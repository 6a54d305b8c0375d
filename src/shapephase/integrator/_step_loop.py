"""The attitude equation stepped on an interpolant three times, so that the differences tell the errors.

All steps; two of them at a time; these pairs on series with errors like those they probably have. Without momentum,
where steps cost little: all steps; twice as many; all steps on these other series. Machine code takes them where there
is some (`fast.marches`). Without it each march of a few momenta is one CasADi call after another, and the steps of many
are taken on whole arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import groupby
from typing import Any

import numpy as np

from .. import run_progress
from ..arrays import Array, Integers, read_only
from ..chebyshev import chebyshev
from ._rotation_step import STAGES, momentum_step, product, rest_step, tableau, turned, unit, variation
from .casadi_calls import call_casadi_into
from .fast import engine
from .fast.marches import march_in_threads, quaternions_at_rest
from .interpolant import Interpolant
from .step_record import CHECKPOINTS, StepRecord, ends_of_pairs

# Steps in one CasADi call: enough for the cost of a call not to show, and few different lengths to build.
BLOCK = 256
# Momenta: up to so many, one after another in CasADi is faster than all at once on NumPy's arrays.
FEW = 24
# Momenta on arrays at once, so that the arrays of one step stay in the processor's cache.
_ROWS_AT_ONCE = 2048
# The stages at 1/3 and 0.65 of a step: the mean of their variations stands for that of the whole step.
_INNER_STAGES = (5, 8)
_IDENTITY = np.eye(3)


def integrate_steps(
    interpolant: Interpolant,
    perturbed: Array | None,
    steps: Integers,
    directions: Array,
    magnitudes: Array,
    *,
    with_propagators: bool = True,
    threads: int | None = None,
) -> StepRecord:
    """All steps of all loops, starting at the identity.

    Parameters
    ----------
    perturbed : (P, n, 9) the interpolant's coefficients with errors like those they probably have; None: not marched on
    steps : (P,) at least two, on each panel of one loop
    directions : (B, 3) Pi/|Pi| at the start
    magnitudes : (B,) of the momentum [kg m^2/s]
    with_propagators : whether to integrate the error propagators too
    threads : at most, in machine code; None: one for each processor
    """
    if engine.is_ready():
        return _by_kernel(interpolant, perturbed, steps, directions, magnitudes, with_propagators, threads)
    total, batch = interpolant.loops * sum(steps.tolist()), len(magnitudes)
    # What channels of one momentum are multiplied by costs the least on series.
    folded = float(magnitudes[0]) if batch == 1 else 1.0
    scale, runs = interpolant.widths[:, None, None] * channel_scale(folded), _runs(steps)
    series = interpolant.coefficients * scale
    channels, coarse = _channels_of_runs(series, runs), _channels_of_runs(series, runs, in_pairs=True)
    cut = None if perturbed is None else _channels_of_runs(perturbed * scale, runs, in_pairs=True)
    ends, loops = ends_of_pairs(steps, interpolant.loops), interpolant.loops
    # All steps, pairs of them, and these again where series are perturbed.
    at_once = 1 if batch <= FEW else _ROWS_AT_ONCE
    run_progress.begin(run_progress.STEPPING, -(-batch // at_once) * total * (3 if perturbed is None else 4) // 2)
    if batch <= FEW:
        starts = directions, magnitudes / folded
        whole = _record_of_few(channels, loops, *starts, with_propagators=with_propagators)
        pairs = _quaternions_of_few(coarse, loops, *starts)
        whole.stepping[:] = largest_angle(whole.quaternions[:, ends], pairs)
        if cut is not None:
            whole.truncation[:] = largest_angle(pairs, _quaternions_of_few(cut, loops, *starts))
        return whole
    whole = StepRecord.empty(batch, total, CHECKPOINTS if with_propagators else 0)
    for first in range(0, batch, at_once):
        rows = slice(first, first + at_once)
        starts = directions[rows], magnitudes[rows]
        # Steps that are far too long overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            _record_many(whole, rows, channels, loops, *starts)
            pairs = _quaternions_of_many(coarse, loops, *starts)
            whole.stepping[rows] = largest_angle(whole.quaternions[rows][:, ends], pairs)
            if cut is not None:
                whole.truncation[rows] = largest_angle(pairs, _quaternions_of_many(cut, loops, *starts))
    return whole


def integrate_steps_at_rest(interpolant: Interpolant, perturbed: Array | None, steps: Integers) -> StepRecord:
    """As `integrate_steps` without momentum: a batch of one.

    The equation is linear, so steps do not depend on each other, and a further loop repeats the rotation of the first:
    it costs no steps.
    """
    run_progress.begin(run_progress.STEPPING, int(steps.sum()) * (3 if perturbed is None else 4))
    coefficients = interpolant.coefficients
    whole = _quaternions_at_rest(interpolant, coefficients, steps)
    finer = _quaternions_at_rest(interpolant, coefficients, 2 * steps)
    truncation = 0.0
    if perturbed is not None:
        truncation = largest_angle(whole, _quaternions_at_rest(interpolant, perturbed, steps))
    nothing = np.zeros((1, len(whole) - 1))
    return StepRecord(
        quaternions=whole[None],
        directions=np.empty((1, 0, 3)),
        turns=nothing,
        dynamics=nothing,
        propagators=np.empty((1, 0, 3, 3)),
        stepping=np.array([largest_angle(whole, finer[::2])]),
        truncation=np.array([truncation]),
    )


def quaternions_alone(
    interpolant: Interpolant,
    coefficients: Array,
    steps: Integers,
    directions: Array | None = None,
    magnitudes: Array | None = None,
) -> Array:
    """At the ends of all steps, other series in the interpolant's place: (B, K + 1, 4), nothing else being integrated.

    Parameters as of `integrate_steps`; no directions and magnitudes: without momentum, B = 1.
    """
    run_progress.begin(run_progress.STEPPING, interpolant.loops * int(steps.sum()))
    if directions is None or magnitudes is None:
        return _quaternions_at_rest(interpolant, coefficients, steps)[None]
    if engine.is_ready():
        widths, none = np.diff(interpolant.edges[: len(steps) + 1]), np.zeros(0, dtype=int)
        record = march_in_threads(
            widths, coefficients, None, steps, interpolant.loops, directions, magnitudes, marks=none
        )
        return record.quaternions
    channels, loops = _channels_at_stages(interpolant, coefficients, steps), interpolant.loops
    if len(magnitudes) <= FEW:
        return _quaternions_of_few(channels, loops, directions, magnitudes)
    parts = (slice(first, first + _ROWS_AT_ONCE) for first in range(0, len(magnitudes), _ROWS_AT_ONCE))
    return np.concatenate([_quaternions_of_many(channels, loops, directions[rows], magnitudes[rows]) for rows in parts])


@lru_cache(maxsize=256)
def checkpoint_steps(count: int) -> Integers:
    """After how many of so many steps the propagators are kept: (CHECKPOINTS,), the first none, the last all."""
    return read_only(np.arange(CHECKPOINTS) * count // (CHECKPOINTS - 1))


def stage_channels(interpolant: Interpolant, steps: Integers) -> Array:
    """Channels at the 12 stages of each step of the first loop, times the step's length: (K, 108)."""
    return _channels_at_stages(interpolant, interpolant.coefficients, steps)


def _channels_at_stages(
    interpolant: Interpolant, coefficients: Array, steps: Integers, *, in_pairs: bool = False
) -> Array:
    return _channels_of_runs(coefficients * interpolant.widths[:, None, None], _runs(steps), in_pairs=in_pairs)


def _runs(steps: Integers) -> list[tuple[int, int]]:
    """Numbers of steps, and on how many panels one after another they are taken: (P,)."""
    return [(count, len(list(run))) for count, run in groupby(steps.tolist())]


def _channels_of_runs(scaled: Array, runs: list[tuple[int, int]], *, in_pairs: bool = False) -> Array:
    """Of series times the widths of their panels: (P, n, k) -> (K, 12 k)."""
    _, terms, each = scaled.shape
    if len(runs) == 1:
        return np.matmul(_stage_matrix(terms, runs[0][0], in_pairs), scaled).reshape(-1, each * STAGES)
    matrices = [_stage_matrix(terms, count, in_pairs) for count, _ in runs]
    channels = np.empty((sum(panels * len(matrix) for matrix, (_, panels) in zip(matrices, runs, strict=True)), each))
    panel = row = 0
    for matrix, (_, panels) in zip(matrices, runs, strict=True):
        stop = row + panels * len(matrix)
        out = channels[row:stop].reshape(panels, len(matrix), each)
        np.matmul(matrix, scaled[panel : panel + panels], out=out)
        panel, row = panel + panels, stop
    return channels.reshape(-1, each * STAGES)


@lru_cache(maxsize=512)
def _stage_matrix(degree_count: int, count: int, in_pairs: bool) -> Array:
    """Chebyshev coefficients of a panel -> values at all stages of its steps, times the step's share of it.

    (12 K, degrees), of `count` steps or of pairs of them.
    """
    _, _, c = tableau()
    ends = ends_of_pairs(np.array([count]), 1) if in_pairs else np.arange(count + 1)
    lengths = np.diff(ends)[:, None]
    x = 2.0 * (ends[:-1, None] + lengths * c) / count - 1.0
    values = chebyshev(np.clip(x, -1.0, 1.0), degree_count).reshape(len(lengths), STAGES, degree_count)
    return (values * (lengths / count)[..., None]).reshape(-1, degree_count)


def largest_angle(a: Array, b: Array) -> Any:
    """The largest angle between attitudes that are near each other: (..., K, 4) quaternions -> (...) [rad]."""
    apart = a - b
    largest = np.vecdot(apart, apart).max(axis=-1)
    if not largest.max(initial=0.0) <= 1.0:
        # A quaternion and its negative are one attitude.
        opposite = a + b
        nearer = np.minimum(np.vecdot(apart, apart), np.vecdot(opposite, opposite))
        largest = nearer.max(axis=-1)
    return 2.0 * np.sqrt(largest)


def _record_of_few(
    channels: Array, loops: int, directions: Array, magnitudes: Array, *, with_propagators: bool
) -> StepRecord:
    """All steps of a few momenta; what is no step's own is left empty."""
    width, (batch, _) = 16 if with_propagators else 7, directions.shape
    count = loops * len(channels)
    states, sides = np.empty((batch, count + 1, width)), np.empty((batch, count, 2))
    for row in range(batch):
        _march(_momentum_function, channels, loops, directions[row], magnitudes[row], states[row], sides[row])
    marks = checkpoint_steps(count) if with_propagators else []
    return StepRecord(
        quaternions=states[:, :, 3:7],
        directions=states[:, :, :3],
        turns=sides[:, :, 0],
        dynamics=sides[:, :, 1],
        propagators=states[:, marks, 7:].reshape(batch, -1, 3, 3),
        stepping=np.empty(batch),
        truncation=np.zeros(batch),
    )


def _quaternions_of_few(channels: Array, loops: int, directions: Array, magnitudes: Array) -> Array:
    """The quaternions alone at the ends of all steps: (B, K + 1, 4)."""
    states = np.empty((len(magnitudes), loops * len(channels) + 1, 7))
    for row in range(len(magnitudes)):
        _march(_attitude_function, channels, loops, directions[row], magnitudes[row], states[row])
    return states[:, :, 3:7]


def _march(
    function_of: Callable[[int, int], Any], channels: Array, loops: int, direction: Array, magnitude: float,
    states: Array, *sides: Array,
) -> None:  # fmt: skip
    """One momentum after another from the identity, by functions of so many steps: states (K + 1, n), sides (K, 2).

    A state is direction, quaternion and propagator.
    """
    first, count, done = states[0], len(channels), 0
    first[:], first[:3], first[6], first[7::4] = 0.0, direction, 1.0, 1.0
    if magnitude != 1.0:
        channels = (channels.reshape(-1, 9) * channel_scale(magnitude)).reshape(count, -1)
    for _ in range(loops):
        for start in range(0, count, BLOCK):
            block = channels[start : start + BLOCK]
            after = done + len(block)
            results = [states[done + 1 : after + 1], *(side[done:after] for side in sides)]
            call_casadi_into(function_of(len(block), states.shape[1]), (states[done], block), results)
            run_progress.advance(len(block))
            done = after


def channel_scale(magnitude: float) -> Array:
    """What channels are multiplied by where the momentum is a direction: (9,)."""
    return np.array([magnitude] * 6 + [1.0] * 3)


def _record_many(
    record: StepRecord, rows: slice, channels: Array, loops: int, directions: Array, magnitudes: Array
) -> None:
    """All steps of many momenta into their rows."""
    with_propagators = bool(record.propagators.shape[1])
    marks = checkpoint_steps(loops * len(channels)).tolist()
    record.directions[rows, 0], record.quaternions[rows, 0] = directions, [0.0, 0.0, 0.0, 1.0]
    record.propagators[rows] = _IDENTITY
    propagator: Any = np.eye(3).tolist()
    start = list(directions.T)
    steps = _steps_of_many(channels, loops, directions, magnitudes)
    for number, (step, end, quaternion, turn, dynamic) in enumerate(steps, 1):
        record.turns[rows, number - 1], record.dynamics[rows, number - 1] = turn, dynamic
        for column, part in enumerate(end):
            record.directions[rows, number, column] = part
        for column, part in enumerate(quaternion):
            record.quaternions[rows, number, column] = part
        if with_propagators:
            propagator = _next_propagator(propagator, start, end, magnitudes, step)
            for mark in (place for place, reached in enumerate(marks) if reached == number):
                for i, line in enumerate(propagator):
                    for j, part in enumerate(line):
                        record.propagators[rows, mark, i, j] = part
        start = end


def _quaternions_of_many(channels: Array, loops: int, directions: Array, magnitudes: Array) -> Array:
    """The quaternions alone at the ends of all steps: (B, K + 1, 4)."""
    quaternions = np.empty((len(magnitudes), loops * len(channels) + 1, 4))
    quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0]
    for number, (_, _, quaternion, _, _) in enumerate(_steps_of_many(channels, loops, directions, magnitudes), 1):
        for column, part in enumerate(quaternion):
            quaternions[:, number, column] = part
    return quaternions


def _steps_of_many(channels: Array, loops: int, directions: Array, magnitudes: Array) -> Iterator[tuple[Any, ...]]:
    """After each step its channels, directions, quaternions, turns and dynamic phases, the components apart."""
    direction, quaternion = list(directions.T), [0.0, 0.0, 0.0, 1.0]
    steps = channels.reshape(-1, STAGES, 9).tolist()
    for _ in range(loops):
        for step in steps:
            end, turn, dynamic = momentum_step(direction, magnitudes, step)
            half = 0.5 * turn
            quaternion = turned(quaternion, direction, end, (np.sin(half), np.cos(half)))
            run_progress.advance(1)
            yield step, end, quaternion, turn, dynamic
            direction = end


def _by_kernel(
    interpolant: Interpolant,
    perturbed: Array | None,
    steps: Integers,
    directions: Array,
    magnitudes: Array,
    with_propagators: bool,
    threads: int | None,
) -> StepRecord:
    widths, loops = interpolant.widths, interpolant.loops
    marks = checkpoint_steps(loops * int(steps.sum())) if with_propagators else np.zeros(0, dtype=int)
    return march_in_threads(
        widths, interpolant.coefficients, perturbed, steps, loops, directions, magnitudes, marks=marks, threads=threads
    )


def _quaternions_at_rest(interpolant: Interpolant, coefficients: Array, steps: Integers) -> Array:
    """At the ends of all steps without momentum: (loops K + 1, 4)."""
    if engine.is_ready():
        quaternions = quaternions_at_rest(interpolant.widths, coefficients, steps)
        run_progress.advance(len(quaternions) - 1)
    else:
        half_rates = coefficients[:, :, 6:] * (-0.5 * interpolant.widths)[:, None, None]
        quaternions = _quaternions_of_one_loop(_channels_of_runs(half_rates, _runs(steps)))
    return _repeated(quaternions, interpolant.loops) if interpolant.loops > 1 else quaternions


def _quaternions_of_one_loop(half_rates: Array) -> Array:
    """From half the rates at all stages, times the steps' lengths: (K, 36) -> (K + 1, 4)."""
    count = len(half_rates)
    quaternions = np.empty((count + 1, 4))
    quaternions[0] = [0.0, 0.0, 0.0, 1.0]
    for first in range(0, count, BLOCK):
        block = half_rates[first : first + BLOCK]
        call_casadi_into(
            _rest_function(len(block)), (quaternions[first], block), [quaternions[first + 1 : first + BLOCK + 1]]
        )
        run_progress.advance(len(block))
    return quaternions


def _repeated(quaternions: Array, loops: int) -> Array:
    """The first loop's quaternions after 0, 1, 2 ... loops, the last of each being the first of the next."""
    x, y, z, w = quaternions[-1]
    sine = np.sqrt(x * x + y * y + z * z)
    half = np.arctan2(sine, w) * np.arange(loops)
    axis = quaternions[-1, :3] / sine if sine > 0.0 else np.zeros(3)
    powers = np.concatenate([np.sin(half)[:, None] * axis, np.cos(half)[:, None]], axis=1)
    further = np.stack(product(list(powers.T[:, :, None]), list(quaternions[1:].T)), axis=-1).reshape(-1, 4)
    return np.concatenate([quaternions[:1], further])


def adjugate_of(matrix: Any) -> list[list[Any]]:
    """Of a 3 x 3 matrix of numbers, arrays or symbols."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ]


def _next_propagator(propagator: Any, start: Any, end: Any, magnitude: Any, channels: Any) -> list[list[Any]]:
    """The error propagator after a step, by the Cayley transform of the variation at its middle, for each half of it.

    That is a rotation where the variation is one, however long the step.
    """
    middle = [0.25 * magnitude * part for part in unit([a + b for a, b in zip(start, end, strict=True)])]
    first, second = (channels[stage] for stage in _INNER_STAGES)
    inner = [0.5 * (a + b) for a, b in zip(first[:6], second[:6], strict=True)]
    quarter = variation(middle, [*inner, *(0.125 * (a + b) for a, b in zip(first[6:], second[6:], strict=True))])
    back = [[float(i == j) - quarter[i][j] for j in range(3)] for i in range(3)]
    adjugate = adjugate_of(back)
    twice = 2.0 / (back[0][0] * adjugate[0][0] + back[0][1] * adjugate[1][0] + back[0][2] * adjugate[2][0])
    # Of a matrix M the Cayley transform is 2 / (1 - M) - 1.
    half = [[twice * adjugate[i][j] - float(i == j) for j in range(3)] for i in range(3)]
    return matrix_product(half, matrix_product(half, propagator))


def matrix_product(a: Any, b: Any) -> list[list[Any]]:
    """Of two 3 x 3 matrices of numbers, arrays or symbols."""
    return [[row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j] for j in range(3)] for row in a]


@lru_cache(maxsize=1024)
def _momentum_function(length: int, width: int) -> Any:
    """`length` steps as one CasADi function of the state of so many numbers, and of channels."""
    return momentum_step_function(with_propagators=width > 7).mapaccum("steps", length)


@lru_cache(maxsize=1024)
def _attitude_function(length: int, _width: int) -> Any:
    """The same without turns and dynamic phases."""
    return attitude_step_function().mapaccum("steps", length)


@lru_cache(maxsize=512)
def _rest_function(length: int) -> Any:
    """`length` steps without momentum as one CasADi function of the quaternion and half the rates."""
    return rest_step_function().mapaccum("steps", length)


@lru_cache(maxsize=2)
def momentum_step_function(*, with_propagators: bool) -> Any:
    """One step as a CasADi function: state and channels, I^-1 times the magnitude -> next state; turn, dynamic phase.

    The state is direction, quaternion and propagator.
    """
    import casadi

    state, data, channels = _symbols(16 if with_propagators else 7)
    parts = casadi.vertsplit(state)
    end, attitude, sides = _following(parts, channels, with_dynamic=True)
    following = [*end, *attitude]
    if with_propagators:
        propagator = [parts[7 + 3 * i : 10 + 3 * i] for i in range(3)]
        following += [part for row in _next_propagator(propagator, parts[:3], end, 1.0, channels) for part in row]
    name = "momentum_step_with_propagator" if with_propagators else "momentum_step"
    return casadi.Function(name, [state, data], [casadi.vertcat(*following), casadi.vertcat(*sides)])


@lru_cache(maxsize=1)
def attitude_step_function() -> Any:
    """The same of direction and quaternion alone."""
    import casadi

    state, data, channels = _symbols(7)
    end, attitude, _ = _following(casadi.vertsplit(state), channels, with_dynamic=False)
    return casadi.Function("attitude_step", [state, data], [casadi.vertcat(*end, *attitude)])


def _symbols(width: int) -> tuple[Any, Any, list[list[Any]]]:
    """A state of so many numbers, the channels of a step, and these by stages."""
    import casadi

    state, data = casadi.SX.sym("state", width), casadi.SX.sym("channels", 9 * STAGES)
    components = casadi.vertsplit(data)
    return state, data, [components[9 * s : 9 * s + 9] for s in range(STAGES)]


def _following(parts: list[Any], channels: list[list[Any]], *, with_dynamic: bool) -> tuple[Any, Any, tuple[Any, Any]]:
    """Direction, quaternion, turn and dynamic phase after a step."""
    import casadi

    direction, quaternion = parts[:3], parts[3:7]
    end, turn, dynamic = momentum_step(direction, 1.0, channels, with_dynamic=with_dynamic)
    half_turn = casadi.sin(0.5 * turn), casadi.cos(0.5 * turn)
    return end, turned(quaternion, direction, end, half_turn), (turn, dynamic)


@lru_cache(maxsize=1)
def rest_step_function() -> Any:
    """One step without momentum as a CasADi function: quaternion and half the rates of turning -> the next one."""
    import casadi

    state, data = casadi.SX.sym("state", 4), casadi.SX.sym("half_rates", 3 * STAGES)
    components = casadi.vertsplit(data)
    turn = rest_step([components[3 * s : 3 * s + 3] for s in range(STAGES)])
    following = casadi.vertcat(*unit(product(casadi.vertsplit(state), turn)))
    return casadi.Function("rest_step", [state, data], [following])
