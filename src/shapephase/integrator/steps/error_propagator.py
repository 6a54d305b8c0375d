"""Error propagators: how small changes of the start grow along a motion, by the derivative of the steps."""

from __future__ import annotations

from functools import lru_cache
from math import isfinite, sqrt
from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array
from ..casadi_calls import call_casadi, map_rows
from ..fast import engine
from ..fast.estimate_constants import EPS, ROUNDING_OF_RADIAN, ROUNDING_OF_START, ROUNDING_OF_STEP
from ..fast.marches import derivatives, growths_and_rounding
from .casadi_marches import BLOCK, attitude_step_function
from .propagator_step import adjugate_of, matrix_product
from .rotation_step import STAGES, attitude_step
from .step_record import CHECKPOINTS, checkpoint_steps

# Of each entry of an adjugate, row by row: first times second less third times fourth of these entries.
_COFACTORS = np.array(
    [
        [4, 2, 1, 5, 0, 2, 3, 1, 0],
        [8, 7, 5, 6, 8, 3, 7, 6, 4],
        [5, 1, 2, 3, 2, 0, 4, 0, 1],
        [7, 8, 4, 8, 6, 5, 6, 7, 3],
    ]
)
# Of the products of squares of propagators: six digits.
_FEW_DIGITS_LOST = 1e6


def growth_and_rounding(
    propagators: Array, quaternions: Array, least: float, threads: int | None = None
) -> tuple[Array, Array]:
    """Largest growth of an error from one time to a later one, and the error due to rounding when it is largest.

    A turn about the momentum's axis stays what it is, and volumes are kept: taking the singular
    values of a propagator as s, 1, 1/s, the sum of their squares gives the largest. Every step commits rounding of its
    own, at random, and every radian turned some of the rate's; the propagators carry them on.

    Parameters
    ----------
    propagators : (B, CHECKPOINTS, 3, 3), or (B, 0, 3, 3) without momentum
    quaternions : (B, K + 1, 4) at the step ends
    least : [rad]; where the rounding is below by the largest growth alone, that is enough
    threads : at most, in machine code; None: one for each processor

    Returns
    -------
    growth, infinite where it is not known, and rounding [rad]: (B,) each
    """
    if engine.is_ready():
        growth, rounding = growths_and_rounding(propagators, quaternions, threads)
    else:
        growth, rounding = _growths_and_rounding(propagators, quaternions)
    return growth, looked_at_closely(rounding, propagators, quaternions, least)


def looked_at_closely(rounding: Array, propagators: Array, quaternions: Array, least: float) -> Array:
    """Rounding by the largest growth (B,), where it is above `least` time by time; arguments as above [rad]."""
    large = rounding > least
    if propagators.shape[1] and np.count_nonzero(large):
        large &= np.isfinite(rounding)
        rounding[large] = _rounding_at_worst(propagators[large], _turns(quaternions[large]))
    return rounding


def largest_growth(propagators: Array) -> Array:
    """Of an error from one time to a later one: (B, CHECKPOINTS, 3, 3) -> (B,), infinite where it is not known."""
    if propagators.shape[1] == 0:
        return np.ones(len(propagators))
    numbers = propagators.reshape(len(propagators), -1)
    found = map_rows(growth_of_propagators, numbers.shape[1], numbers)
    if isfinite(found.sum()):
        return found[:, 0]
    # Where steps were so long that they overflowed, the growth is unknown.
    return np.where(np.isfinite(found).all(axis=1), found[:, 0], np.inf)


def growth_of_propagators(entries: list[Any]) -> list[Any]:
    """From propagators in a row: the growth, and a sum that is finite where they all are."""
    import casadi

    matrices = [[entries[first + 3 * i : first + 3 * i + 3] for i in range(3)] for first in range(0, len(entries), 9)]
    adjugates = [adjugate_of(matrix) for matrix in matrices]
    largest = 1.0
    for later in range(1, len(matrices)):
        for earlier in range(later):
            between = matrix_product(matrices[later], adjugates[earlier])
            squares = sum(entry * entry for row in between for entry in row)
            largest = casadi.fmax(largest, 0.5 * (squares - 1.0))
    return [casadi.sqrt(largest + casadi.sqrt(largest * largest - 1.0)), sum(entries)]


def _growths_and_rounding(propagators: Array, quaternions: Array) -> tuple[Array, Array]:
    """As `fast.marches.growths_and_rounding`."""
    growth, sums, count = largest_growth(propagators), _turns(quaternions).sum(axis=1), quaternions.shape[1] - 1
    committed = (ROUNDING_OF_START + ROUNDING_OF_STEP * sqrt(count)) + ROUNDING_OF_RADIAN * sums
    return growth, EPS * growth * committed


def _growth_between(propagators: Array) -> Array:
    """The growth of errors from each checkpoint to each: (B, M, 3, 3) -> (B, to, from)."""
    adjugates = _adjugates(propagators)
    # Of a product the sum of squares is the scalar product of two matrices of squares, where these are not so large
    # that their digits cancel.
    later, earlier = np.swapaxes(propagators, 2, 3) @ propagators, adjugates @ np.swapaxes(adjugates, 2, 3)
    if later.max(initial=0.0) * earlier.max(initial=0.0) < _FEW_DIGITS_LOST:
        squares = later.reshape(*later.shape[:2], 9) @ np.swapaxes(earlier.reshape(*earlier.shape[:2], 9), 1, 2)
    else:
        between = propagators[:, :, None] @ adjugates[:, None]
        squares = np.einsum("bjkmn,bjkmn->bjk", between, between)
    half = np.maximum(0.5 * (squares - 1.0), 1.0)
    return np.asarray(np.sqrt(half + np.sqrt(half * half - 1.0)))


def _adjugates(matrices: Array) -> Array:
    """(B, M, 3, 3) -> (B, M, 3, 3)."""
    flat = matrices.reshape(*matrices.shape[:2], 9)
    first, second, third, fourth = (flat[..., place] for place in _COFACTORS)
    return (first * second - third * fourth).reshape(matrices.shape)


def _turns(quaternions: Array) -> Array:
    """How far each step turns: (B, K + 1, 4) -> (B, K) [rad]."""
    chords = quaternions[:, 1:] - quaternions[:, :-1]
    return 2.0 * np.sqrt(np.vecdot(chords, chords))


def _rounding_at_worst(propagators: Array, turned: Array) -> Array:
    """The same, time by time, from how far each step turns (B, K) [rad]."""
    count = turned.shape[1]
    marks = checkpoint_steps(count)
    turned = np.add.reduceat(turned, np.minimum(marks[:-1], count - 1), axis=1)
    growth = _growth_between(propagators)
    # What is committed between two checkpoints grows as from the worse of them.
    growth = np.tril(np.maximum(growth[:, 1:, :-1], growth[:, 1:, 1:]))
    random = np.sqrt(growth * growth @ np.diff(marks).astype(np.float64))
    steady = np.einsum("bjk,bk->bj", growth, turned)
    largest = growth.max(axis=(1, 2), initial=1.0)
    committed = (ROUNDING_OF_STEP * random + ROUNDING_OF_RADIAN * steady).max(axis=1)
    return EPS * (ROUNDING_OF_START * largest + committed)


def exact_propagators(channels: Array, directions: Array, magnitudes: Array, loops: int) -> Array:
    """Error propagators by the derivative of the steps: (B, CHECKPOINTS, 3, 3).

    A turn delta of the start is carried over as S^T delta, and changes the momentum's direction by p x delta.

    Parameters
    ----------
    channels : (K, 108) at the stages of the steps of one loop
    """
    propagators = np.empty((len(magnitudes), CHECKPOINTS, 3, 3))
    propagators[:] = np.eye(3)
    marks = checkpoint_steps(loops * len(channels))
    for row, (direction, magnitude) in enumerate(zip(directions, magnitudes, strict=True)):
        first = so3.perpendicular(direction)
        basis = np.stack([first, np.cross(direction, first)])
        seeds = np.zeros((2, 8))
        seeds[:, :3] = np.cross(direction, basis)
        if engine.is_ready():
            ends, changes = derivatives(channels, loops, direction, seeds[:, :3], float(magnitude), marks)
            turns = so3.turn_of(ends[:, None], changes)
            propagators[row] = so3.transpose(so3.matrix_from_quat(ends)) + so3.transpose(turns) @ basis
            continue
        for done, quaternions, slopes in _derivatives(channels, direction, float(magnitude), loops, seeds):
            reached = np.flatnonzero((marks > done) & (marks <= done + len(quaternions)))
            if len(reached):
                there = marks[reached] - done - 1
                rotation = so3.transpose(so3.matrix_from_quat(quaternions[there]))
                propagators[row, reached] = rotation + so3.transpose(slopes[there]) @ basis
    return propagators


def momentum_slope(channels: Array, momenta: Array, loops: int) -> Array:
    """The turn of the end, body axes, by a change of Pi at the start: (B, 3, 3) for Pi (B, 3), zero or not.

    Here the steps are taken on the quaternion itself: the direction of a momentum near zero is lost in rounding.
    """
    count = len(channels)
    result = np.empty((len(momenta), 3, 3))
    for row, momentum in enumerate(momenta):
        state = np.concatenate([[0.0, 0.0, 0.0, 1.0], momentum, np.zeros(12)])
        for _ in range(loops):
            for first in range(0, count, BLOCK):
                block = channels[first : first + BLOCK]
                (states,) = call_casadi(_slope_function(len(block)), len(block), state, block)
                state = states[-1]
        result[row] = so3.turn_of(state[:4], state[7:].reshape(3, 4)).T
    return result


def _derivatives(channels: Array, direction: Array, magnitude: float, loops: int, seeds: Array) -> Any:
    """Block by block: the steps before it, the quaternions (n, 4) and the turns by each seed (n, seeds, 3) after each.

    `seeds` (s, 8) are changes of direction, quaternion and magnitude at the start.
    """
    count, columns = len(channels), len(seeds)
    state = np.concatenate([direction, [0.0, 0.0, 0.0, 1.0, magnitude], seeds.ravel()])
    done = 0
    for _ in range(loops):
        for first in range(0, count, BLOCK):
            block = channels[first : first + BLOCK]
            (states,) = call_casadi(_derivative_function(len(block), columns), len(block), state, block)
            quaternions = states[:, 3:7]
            slopes = so3.turn_of(quaternions[:, None], states[:, 8:].reshape(-1, columns, 8)[:, :, 3:7])
            yield done, quaternions, slopes
            state, done = states[-1], done + len(block)


@lru_cache(maxsize=512)
def _slope_function(length: int) -> Any:
    """`length` steps as one CasADi function of quaternion, Pi at the start and the quaternion's derivatives by it."""
    return slope_step_function().mapaccum("steps", length)


@lru_cache(maxsize=1)
def slope_step_function() -> Any:
    """One step as a CasADi function of quaternion, Pi at the start and the quaternion's derivatives by it."""
    import casadi

    quaternion, momentum = casadi.SX.sym("quaternion", 4), casadi.SX.sym("momentum", 3)
    slopes, data = casadi.SX.sym("slopes", 4, 3), casadi.SX.sym("channels", 9 * STAGES)
    components = casadi.vertsplit(data)
    channels = [components[9 * s : 9 * s + 9] for s in range(STAGES)]
    following = casadi.vertcat(*attitude_step(casadi.vertsplit(quaternion), casadi.vertsplit(momentum), channels))
    further = casadi.jtimes(following, quaternion, slopes) + casadi.jacobian(following, momentum)
    state = casadi.vertcat(quaternion, momentum, casadi.reshape(slopes, 12, 1))
    onward = casadi.vertcat(following, momentum, casadi.reshape(further, 12, 1))
    return casadi.Function("slope_step", [state, data], [onward])


@lru_cache(maxsize=512)
def _derivative_function(length: int, columns: int) -> Any:
    """`length` steps as one CasADi function of the state with its derivatives, and the channels."""
    return derivative_step_function(columns).mapaccum("steps", length)


@lru_cache(maxsize=1)
def derivative_step_function(columns: int) -> Any:
    """One step as a CasADi function of the state with its derivatives, and the channels."""
    import casadi

    state, slopes = casadi.SX.sym("state", 8), casadi.SX.sym("slopes", 8, columns)
    data = casadi.SX.sym("channels", 9 * STAGES)
    following = attitude_step_function()(state, data)
    further = casadi.reshape(casadi.jtimes(following, state, slopes), 8 * columns, 1)
    whole = casadi.vertcat(state, casadi.reshape(slopes, 8 * columns, 1))
    return casadi.Function(f"derivative_step_{columns}", [whole, data], [casadi.vertcat(following, further)])
