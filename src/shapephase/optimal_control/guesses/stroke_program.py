"""Motions of equal strokes as a nonlinear program, which has each stroke once, however often it is repeated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array, Integers
from ...chebyshev import gauss_tableau
from ...shape_space.connection import mechanical_connection
from .._polish import end_conditions
from .._spline_basis import SplineBasis
from ..collocation import STAGES, CollocationProgram, NlpSolution, final_conditions
from ..cost_metric import METRIC_COSTS
from ..nodes.node_functions import node_functions
from ..solver_callback import IterationCallback
from ..task import Reorientation

_COSTS = (*METRIC_COSTS, "time")

PIECES_OF_WAY = 6  # between legs: enough for a spline to lead from one stroke to another

_ITERATIONS = 200  # searches that reach an optimum take 30 to 90

_DIGITS = 9  # decimals in which rates of equal strokes are compared: they agree up to rounding


def strokes_suffice(task: Reorientation) -> bool:
    """True where the program has the cost of a task and all its limits."""
    return task.cost in _COSTS and not task.limits_beyond_rates


@dataclass(frozen=True)
class Layout:
    """Places of the strokes of some legs on a spline: way, leg, way, leg, ..., way.

    A spline on equal pieces repeats itself where its control points do.

    strokes : of each leg the pieces of a stroke, and how often it is gone round
    """

    strokes: tuple[tuple[int, int], ...]

    @cached_property
    def basis(self) -> SplineBasis:
        """Spline of the whole motion."""
        return SplineBasis(self.firsts[-1] + int(np.prod(self.strokes[-1])) + PIECES_OF_WAY)

    @cached_property
    def firsts(self) -> list[int]:
        """The first piece of each leg."""
        lengths = [pieces * rounds + PIECES_OF_WAY for pieces, rounds in self.strokes]
        return [PIECES_OF_WAY + sum(lengths[:leg]) for leg in range(len(lengths))]

    @cached_property
    def shared(self) -> Integers:
        """Index of each control point among the distinct ones: (k,)."""
        same = np.arange(self.basis.dimension)
        for first, (pieces, rounds) in zip(self.firsts, self.strokes, strict=True):
            # A piece depends on the control points from the one before its own to the second after it.
            points = np.arange(first - 1, first + pieces * rounds + 2)
            same[points] = points[0] + (points - points[0]) % pieces
        return np.unique(same, return_inverse=True)[1]

    @cached_property
    def chains(self) -> list[tuple[Integers, int]]:
        """Ways and strokes alternately: their pieces, and how often they are passed."""
        chains, place = [], 0
        for first, (pieces, rounds) in zip(self.firsts, self.strokes, strict=True):
            chains += [(np.arange(place, first), 1), (np.arange(first, first + pieces), rounds)]
            place = first + pieces * rounds
        return [*chains, (np.arange(place, self.basis.pieces), 1)]


class StrokeProgram(CollocationProgram):
    """Collocation of a motion of equal strokes; without momentum each of them turns the body alike.

    Unknown are x = (points that differ, T, q at the nodes of pieces that differ, q at the ends of these pieces). Ways
    and strokes are chains of pieces; q of a stroke begins at 1, that of a way goes on from the way before by the power
    of the stroke between them:

        q_next = q_end q_stroke^rounds.

    places : places of the nodes on the spline
    program, derivatives : as for `CollocationProgram`
    """

    def __init__(self, task: Reorientation, layout: Layout) -> None:
        import casadi
        from scipy import sparse

        self._task, self.basis, self._layout = task, layout.basis, layout
        basis, m, self._shared = layout.basis, task.dimension, layout.shared
        pieces = np.concatenate([chain for chain, _ in layout.chains])
        inside, weights, integrals = gauss_tableau(STAGES)
        step = 1.0 / basis.pieces
        self.places = (basis.nodes[pieces, None] + inside * step).ravel()
        count, points = len(self.places), int(layout.shared.max()) + 1
        # The place of the first end of each chain, and the number of all ends: one more than pieces in each chain.
        begins = np.cumsum([0, *(len(chain) + 1 for chain, _ in layout.chains)])
        # Strokes, too, begin at 1.
        self._ones, self._n_ends = [0, *begins[1:-1:2]], int(begins[-1])
        parts = np.cumsum([0, points * m, 1, 4 * count, 4 * self._n_ends])
        self._open = slice(int(parts[-1]), int(parts[-1]))  # there are no waypoints
        unknown = casadi.MX.sym("unknown", int(parts[-1]))
        varied, duration, inner, outer = casadi.vertsplit(unknown, parts.tolist())
        onto = sparse.csr_matrix((np.ones(basis.dimension), (np.arange(basis.dimension), layout.shared)))
        shapes, rates = (
            casadi.reshape(_in_coordinates(basis.sparse_matrix(self.places, order) @ onto, m) @ varied, m, count)
            for order in (0, 1)
        )
        inner, outer = casadi.reshape(inner, 4, count), casadi.reshape(outer, 4, self._n_ends)
        at_node = casadi.vertcat(shapes, rates, inner, casadi.repmat(duration, 1, count))
        turning, density = node_functions(task).values.map(count)(at_node)
        of_chains = [np.arange(first, last - 1) for first, last in pairwise(begins)]
        before = np.concatenate(of_chains)
        turned = casadi.reshape(turning, 4 * STAGES, len(pieces))
        to_nodes = casadi.kron(casadi.DM(step * integrals), casadi.DM.eye(4)) @ turned
        to_end = casadi.kron(casadi.DM(step * weights[None]), casadi.DM.eye(4)) @ turned
        begin, end = outer[:, before.tolist()], outer[:, (before + 1).tolist()]
        rows = [
            casadi.vec(casadi.reshape(inner, 4 * STAGES, len(pieces)) - casadi.repmat(begin, STAGES, 1) - to_nodes),
            casadi.vec(end - begin - to_end),
        ]
        last = [outer[:, int(begin) - 1] for begin in begins[1:]]
        for leg, (_, rounds) in enumerate(layout.strokes):
            onward = _product(last[2 * leg], _power(last[2 * leg + 1], rounds))
            rows.append(outer[:, int(begins[2 * leg + 2])] - onward)
        conditions = _in_coordinates(sparse.csr_matrix(end_conditions(task, basis)) @ onto, m)
        end = int(layout.shared[-1]) * m
        rows += [conditions @ varied, final_conditions(task, varied[end : end + m], last[-1])]
        met = np.zeros(sum(row.shape[0] for row in rows))
        ahead = met.copy()
        if task.target is None:
            ahead[-1] = np.inf
        limited = np.flatnonzero(np.isfinite(task.rate_limit))
        fastest = np.unique(np.round(basis.rate_control @ onto, _DIGITS), axis=0)
        at_most = casadi.DM(np.tile(task.rate_limit[limited], len(fastest)))
        fast = casadi.DM(sparse.csc_matrix(sparse.kron(fastest, np.eye(m)[limited]))) @ varied
        rows += [fast - at_most * duration, fast + at_most * duration]
        zero, unbounded = np.zeros(fast.shape[0]), np.full(fast.shape[0], np.inf)
        self._low = np.concatenate([met, -unbounded, zero])
        self._high = np.concatenate([ahead, zero, unbounded])
        passed = np.concatenate([np.full(len(chain), rounds) for chain, rounds in layout.chains])
        shares = casadi.DM(np.kron(passed, step * weights))
        cost = duration if task.cost == "time" else casadi.dot(density.T, shares)
        self._cost_function = casadi.Function("cost", [unknown], [cost])
        self.program = {"x": unknown, "f": cost, "g": casadi.vertcat(*rows)}
        self.derivatives = {}  # by CasADi: the program is small

    def solve_strokes(self, control: Array, iteration_callback: IterationCallback | None = None) -> NlpSolution:
        """Return a local optimum from a guess of the control points (k, m)."""
        guess = self._guess(control)
        return self._optimum(guess, float(self._cost_function(guess)), iteration_callback, _ITERATIONS)

    def _guess(self, control: Array) -> Array:
        """Return the unknowns, with the attitude by one step for each piece."""
        task, layout, basis = self._task, self._layout, self.basis
        points = np.zeros((int(layout.shared.max()) + 1, task.dimension))
        points[layout.shared] = control
        control = points[layout.shared]
        inside, _, _ = gauss_tableau(STAGES)
        inner, outer, one = [], [], np.array([0.0, 0.0, 0.0, 1.0])
        reached = one
        for number, (chain, rounds) in enumerate(layout.chains):
            middles = basis.nodes[chain] + 0.5 / basis.pieces
            connection = mechanical_connection(task.body, task.shapes(basis.matrix(middles) @ control)) @ task.coupling
            turns = -so3.apply(connection, basis.matrix(middles, 1) @ control) / basis.pieces
            of_stroke = number % 2 == 1
            now = one if of_stroke else reached
            outer.append(now)
            for turn in turns:
                inner.append(so3.quat_product(now, so3.quat_from_rotation_vector(inside[:, None] * turn)))
                now = so3.quat_product(now, so3.quat_from_rotation_vector(turn))
                outer.append(now)
            whole = so3.quat_from_rotation_vector(rounds * so3.log(so3.matrix_from_quat(now)))
            reached = so3.quat_product(reached, whole) if of_stroke else now
        return np.concatenate([points.ravel(), [task.duration], np.concatenate(inner).ravel(), np.array(outer).ravel()])


def _in_coordinates(matrix: Any, count: int) -> Any:
    """Return a sparse CasADi matrix that acts on each of `count` coordinates alike."""
    import casadi
    from scipy import sparse

    return casadi.DM(sparse.csc_matrix(sparse.kron(matrix, sparse.eye(count))))


def _product(first: Any, second: Any) -> Any:
    import casadi

    vector = first[3] * second[:3] + second[3] * first[:3] + casadi.cross(first[:3], second[:3])
    return casadi.vertcat(vector, first[3] * second[3] - casadi.dot(first[:3], second[:3]))


def _power(quat: Any, exponent: int) -> Any:
    """Return the power of a unit quaternion other than 1."""
    import casadi

    size = casadi.norm_2(quat[:3])
    angle = exponent * casadi.atan2(size, quat[3])
    return casadi.vertcat(casadi.sin(angle) / size * quat[:3], casadi.cos(angle))
