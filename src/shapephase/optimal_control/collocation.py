"""Optimal control problem as a nonlinear program: the attitude by Gauss collocation, the shape a spline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array
from ..chebyshev import gauss_tableau
from ._plan_limits import Margins
from ._polish import end_conditions
from ._spline_basis import SplineBasis
from ._via_points import open_points, symbolic_via_rows
from .nodes.node_distances import DistanceTerms
from .nodes.node_efforts import EffortTerms
from .nodes.node_functions import node_arguments, node_functions, scipy_sparse, sparse_matrix
from .solver_callback import BestIterate, IterationCallback, ipopt_callback
from .symbolic import symbolic_body, turned_back
from .task import Reorientation

STAGES = 3  # Gauss nodes of a piece, order six: 12 pieces of the cat are off by 1e-4 rad, which the polish removes
_DEGENERATE = 1e-3  # scaled dual residual of a degenerate success: beyond rounding, as IPOPT converges to 1e-8
_TOLERANCE = 1e-8  # scaled, of IPOPT
_SHORTEST = 1e-3  # least duration as a share of the longest, cost "time": keeps the division by T from zero
# Long motions may end where the cost has settled: strokes slide along themselves for hundreds of iterations.
_SETTLED_TOLERANCE = 1e-3  # scaled accuracy then
_SETTLED_CHANGE = 3e-4  # relative change of the cost, during at least
_SETTLED_ITERATIONS = 3  # iterations
_NEAR_BARRIER = 1e-3  # first barrier of a search from a path whose links touch: adaptive ones left it for dear ones
_UNBOUNDED = 1e10  # no bound, for IPOPT
GOOD_STATUS = ("Solve_Succeeded", "Solved_To_Acceptable_Level")  # IPOPT's, for a local optimum
_INTERRUPTED = "NonIpopt_Exception_Thrown"  # IPOPT's, after Ctrl-C within an iteration, which CasADi handles
_STOPPED = "User_Requested_Stop"  # after Ctrl-C between iterations, or a callback that stops the search


@dataclass(frozen=True, eq=False)
class NlpSolution:
    """Final iterate of a nonlinear program.

    control : (k, m) control points of the free coordinates [rad or m]
    duration : [s]
    attitude : (3, 3) at the end, by the program's own discretisation
    cost : cost by the program's own quadrature
    status : the solver's message
    converged : whether it is a local optimum to the solver's tolerance
    kkt_residual : largest remaining violation of the Karush-Kuhn-Tucker conditions, scaled
    infeasibility : largest violation of a constraint
    iterations : number of iterations
    via_places : (v,) places of the waypoints
    second_order : whether the Hessian of the Lagrangian, projected on what the constraints leave, is positive definite
        there, by the inertia of the last factorised matrix; None where that is not known
    """

    control: Array
    duration: float
    attitude: Array
    cost: float
    status: str
    converged: bool
    kkt_residual: float
    infeasibility: float
    iterations: int
    via_places: Array
    second_order: bool | None = None


class CollocationProgram:
    """Gauss collocation of the quaternion, the shape a spline, the whole a sparse program for IPOPT.

    Place s = t/T runs over [0, 1], u = dr/ds. At the three Gauss nodes of a piece

        dq/ds = q (T omega)/2,    T omega = T I^-1 R^T mu - A u,

    whose collocation keeps |q| to rounding, as it keeps all quadratic invariants; order six. Unknown are
    x = (control points, T, q at the nodes, q at the ends of the pieces, open places of waypoints). A node's arguments
    y = (r, u, q, T) are linear in them, y = W x, so that Jacobian and Hessian are those of one node, chained by W:
    exact, banded.

    Attributes
    ----------
    basis : spline of the path
    places : places of the nodes
    program : x, p, f and g as CasADi's `nlpsol` takes them
    derivatives : Jacobian of g and Hessian of the Lagrangian, as functions that `nlpsol` takes

    Parameters
    ----------
    margins : pairs of links whose distance is bounded at the nodes
    """

    _distances: DistanceTerms | None = None

    def __init__(self, task: Reorientation, basis: SplineBasis, margins: Margins | None = None) -> None:
        import casadi

        self._task, self.basis = task, basis
        self._shared, self._ones, self._n_ends = np.arange(basis.dimension), [0], basis.pieces + 1
        _, weights, integrals = gauss_tableau(STAGES)
        self.places, _ = basis.gauss(STAGES)
        count, step, width = len(self.places), 1.0 / basis.pieces, 2 * task.dimension + 5
        duration_place = task.dimension * basis.dimension
        core = duration_place + 1 + 4 * (count + basis.pieces + 1)
        self._open = slice(core, core + len(open_points(task)))
        unknown = casadi.MX.sym("unknown", self._open.stop)
        arguments = node_arguments(task, basis, self.places, 1, unknown.shape[0])
        at_node = casadi.reshape(arguments @ unknown, width, count)
        node = node_functions(task)
        turning, density = node.values.map(count)(at_node)
        panels = step * np.tile(weights, basis.pieces)
        shares = casadi.DM(panels)
        # All rows but those of the goal are linear in the unknowns, apart from the turning.
        linear, from_turning, low, high = self._linear_rows(step, weights, integrals)
        end = final_conditions(
            task, unknown[duration_place - task.dimension : duration_place], unknown[core - 4 : core]
        )
        via, via_low, via_high = symbolic_via_rows(task, basis, unknown[:duration_place], unknown[self._open])
        bends = _derivative_rows(task, basis, unknown)
        efforts = None
        if task.efforts_limited or task.cost == "effort":
            efforts = EffortTerms(task, basis, self.places, panels, unknown)
        effort_rows, effort_jacobian = (
            (casadi.MX(0, 1), casadi.MX(0, unknown.shape[0])) if efforts is None else (efforts.values, efforts.jacobian)
        )
        distances = DistanceTerms(task, basis, margins, unknown) if margins else None
        # Rows of no particular structure, which CasADi differentiates itself.
        others = casadi.vertcat(end, via, bends)
        groups = [linear @ unknown - from_turning @ casadi.vec(turning), others, effort_rows]
        if distances is not None:
            groups.append(distances.values)
        rows = casadi.vertcat(*groups)
        slopes = casadi.diagcat(*casadi.horzsplit(node.jacobian.map(count)(at_node), width))
        jacobian = casadi.vertcat(
            linear - from_turning @ (slopes @ arguments),
            casadi.jacobian(others, unknown),
            effort_jacobian,
            *([] if distances is None else [distances.jacobian]),
        )
        multipliers, cost_factor = casadi.MX.sym("multipliers", rows.shape[0]), casadi.MX.sym("cost_factor")
        of_linear, of_others, of_efforts, *of_distances = casadi.vertsplit(
            multipliers, np.cumsum([0, *(group.shape[0] for group in groups)]).tolist()
        )
        turning_multipliers = casadi.reshape(-from_turning.T @ of_linear, 4, count)
        density_factor = 0.0 if task.cost == "time" else cost_factor
        blocks = node.hessian.map(count)(at_node, turning_multipliers, density_factor * shares.T)
        hessian = arguments.T @ (casadi.diagcat(*casadi.horzsplit(blocks, width)) @ arguments)
        if efforts is not None:
            hessian = hessian + efforts.hessian(of_efforts, cost_factor)
        if distances is not None:
            hessian = hessian + distances.hessian(*of_distances)
        lagrangian = casadi.dot(others, of_others)
        if task.cost == "time":
            cost = unknown[duration_place]
        elif task.cost == "acceleration":
            cost = self._acceleration_cost(unknown)
            lagrangian = lagrangian + cost_factor * cost
        elif efforts is not None and task.cost == "effort":
            cost = efforts.cost
        else:
            cost = casadi.dot(density.T, shares)
        hessian = hessian + casadi.hessian(lagrangian, unknown)[0]
        none = casadi.MX.sym("p", 0, 1)
        self._cost_function = casadi.Function("cost", [unknown], [cost])
        self.program = {"x": unknown, "p": none, "f": cost, "g": rows}
        self.derivatives = {
            "jac_g": casadi.Function("jac_g", [unknown, none], [rows, jacobian]),
            "hess_lag": casadi.Function("hess_lag", [unknown, none, cost_factor, multipliers], [casadi.triu(hessian)]),
        }
        # The third row of a pointed axis is a cosine, which only has to be positive.
        final_high = np.zeros(3) if task.target is not None else np.array([0.0, 0.0, np.inf])
        self._distances = distances
        room = np.ones(bends.shape[0] + effort_rows.shape[0])
        self._low = np.concatenate([low, np.zeros(3), via_low, -room])
        self._high = np.concatenate([high, final_high, via_high, room])

    def _linear_rows(self, step: float, weights: Array, integrals: Array) -> tuple[Any, Any, Array, Array]:
        """Rows of collocation and rate limits: linear part, matrix of the turning, lower and upper bounds."""
        sparse = scipy_sparse()
        task, basis = self._task, self.basis
        pieces, count = basis.pieces, len(self.places)
        before, after = sparse.eye(pieces, pieces + 1), sparse.eye(pieces, pieces + 1, k=1)
        from_start = sparse.kron(before, np.ones((STAGES, 1)))

        quaternions = sparse.kron(
            sparse.block_array([[sparse.eye(count), -from_start], [None, after - before]]), sparse.eye(4)
        )
        limited = np.flatnonzero(np.isfinite(task.rate_limit))
        rates = sparse.kron(basis.rate_control, sparse.eye(task.dimension).tocsr()[limited])
        rate_limits = sparse.csr_matrix(np.tile(task.rate_limit[limited], basis.dimension - 1)[:, None])
        conditions = sparse.kron(end_conditions(task, basis), sparse.eye(task.dimension)).tocsr()
        no_places = sparse.csr_matrix((conditions.shape[0], self._open.stop - self._open.start))
        linear = sparse.block_array(
            [
                [None, None, quaternions, None],
                [rates, -rate_limits, None, None],
                [rates, rate_limits, None, None],
                [conditions, None, None, no_places],
            ]
        )
        turning = sparse.vstack([sparse.kron(sparse.eye(pieces), step * rows) for rows in (integrals, weights[None])])
        still = sparse.csr_matrix((2 * rates.shape[0] + conditions.shape[0], 4 * count))
        turning = sparse.vstack([sparse.kron(turning, sparse.eye(4)), still])
        equal, zero = np.zeros(4 * (count + pieces)), np.zeros(rates.shape[0])
        unbounded = np.full(rates.shape[0], np.inf)
        met = np.zeros(conditions.shape[0])
        low, high = np.concatenate([equal, -unbounded, zero, met]), np.concatenate([equal, zero, unbounded, met])
        return sparse_matrix(linear), sparse_matrix(turning), low, high

    def _acceleration_cost(self, unknown: Any) -> Any:
        """Integral of half the squared second derivative: exact with two nodes of a piece or more."""
        import casadi

        task, basis = self._task, self.basis
        places, weights = basis.gauss(STAGES)
        bend = basis.matrix(places, 2)
        gram = bend.T @ (weights[:, None] * bend)
        control = casadi.reshape(unknown[: task.dimension * basis.dimension], task.dimension, basis.dimension)
        in_joints = casadi.DM(task.coupling) @ control
        return 0.5 * casadi.dot(in_joints @ casadi.DM(gram), in_joints) / unknown[task.dimension * basis.dimension] ** 3

    def solve(
        self,
        control: Array,
        duration: float,
        quaternions: Callable[[Array], Array],
        *,
        iterations: int,
        tolerance: float = _TOLERANCE,
        via_places: Array | None = None,
        settles: bool = False,
        room: Array | None = None,
        margins: Margins | None = None,
        iteration_callback: IterationCallback | None = None,
    ) -> NlpSolution:
        """Return the local optimum from a guess: control points (k, m), T, attitudes at places (N,) -> (N, 4).

        via_places : (v,) guessed places of waypoints
        settles : whether the search may end where the cost changes no more
        room : shares of their limits for efforts at the nodes and the ends of pieces, (places, l); None: 1
        margins : of the program's pairs of links
        """
        at = np.zeros(len(self._task.via)) if via_places is None else via_places
        attitudes = [quaternions(self.places).ravel(), quaternions(self.basis.nodes).ravel()]
        guess = np.concatenate([control.ravel(), [duration], *attitudes, at[open_points(self._task)]])
        still = np.concatenate([guess[: control.size + 1], np.zeros(len(guess) - control.size - 1)])
        cost = float(self._cost_function(still))
        return self._optimum(guess, cost, iteration_callback, iterations, tolerance, settles, room, margins)

    def _optimum(
        self,
        guess: Array,
        cost: float,
        iteration_callback: IterationCallback | None,
        iterations: int,
        tolerance: float = _TOLERANCE,
        settles: bool = False,
        room: Array | None = None,
        margins: Margins | None = None,
    ) -> NlpSolution:
        """Return IPOPT's optimum from a guess of the unknowns, whose cost is the unit of costs unless it is 0."""
        import casadi

        best = BestIterate(iteration_callback, self._goal_error)
        barrier: dict[str, Any] = {"mu_strategy": "adaptive"}
        rows_low, rows_high = self._low.copy(), self._high.copy()
        if room is not None:
            rows_low[-room.size :], rows_high[-room.size :] = -room.ravel(), room.ravel()
        if self._distances is not None and margins:
            least = self._distances.bounds(margins)
            barrier = {"mu_strategy": "monotone", "mu_init": _NEAR_BARRIER}
            rows_low, rows_high = np.append(rows_low, least), np.append(rows_high, np.full(len(least), np.inf))
        settled = {
            "acceptable_tol": _SETTLED_TOLERANCE,
            "acceptable_constr_viol_tol": _SETTLED_TOLERANCE,
            # Complementarity is not scaled: the tolerance above bounds it, too.
            "acceptable_compl_inf_tol": _UNBOUNDED,
            "acceptable_obj_change_tol": _SETTLED_CHANGE,
            "acceptable_iter": _SETTLED_ITERATIONS,
        }
        options = {
            "print_level": 0,
            "sb": "yes",
            "max_iter": int(iterations),
            "tol": tolerance,
            "obj_scaling_factor": 1.0 / cost if cost > 0.0 else 1.0,
            "nlp_scaling_method": "none",
            "bound_relax_factor": 0.0,
            "linear_solver": "mumps",
            **barrier,
            **(settled if settles else {}),
        }
        # The local name keeps it alive: CasADi does not.
        callback = ipopt_callback(best, len(guess), rows_low, rows_high)
        given = {"ipopt": options, "print_time": False, "iteration_callback": callback, **self.derivatives}
        # Distances have no derivatives of CasADi's own. IPOPT shortens a step to where a function has no value.
        given |= {"no_nlp_grad": True, "show_eval_warnings": False}
        solver = casadi.nlpsol("plan", "ipopt", self.program, given)
        low, high = self._bounds()
        result = solver(x0=np.clip(guess, low, high), lbx=low, ubx=high, lbg=rows_low, ubg=rows_high)
        return self._solution(np.array(result["x"]).ravel(), float(result["f"]), solver.stats(), best)

    def _solution(self, values: Array, cost: float, stats: dict[str, Any], best: BestIterate) -> NlpSolution:
        """Return IPOPT's solution; where it was stopped, the best iterate instead of the last."""
        status = str(stats["return_status"])
        if best.error is not None:
            raise best.error
        if status == _INTERRUPTED or (status == _STOPPED and not best.stopped):
            raise KeyboardInterrupt
        history = stats["iterations"]
        shifts = history.get("regularization_size", []) if status in GOOD_STATUS else []
        dual, primal = (float(history[key][-1]) if history[key] else np.inf for key in ("inf_du", "inf_pr"))
        if status in GOOD_STATUS and dual > _DEGENERATE:
            # IPOPT scales by the multipliers, which are unbounded where the constraints leave only one motion.
            status = f"{status}, but degenerate"
        if status == _STOPPED:
            values, cost, primal = best.unknowns, best.cost, best.infeasibility
        points = (self._shared.max() + 1) * self._task.dimension
        return NlpSolution(
            control=values[:points].reshape(-1, self._task.dimension)[self._shared],
            duration=float(values[points]),
            attitude=self._last_attitude(values),
            cost=cost,
            status=status,
            converged=status in GOOD_STATUS,
            kkt_residual=max(dual, primal),
            infeasibility=primal,
            iterations=int(stats["iter_count"]),
            via_places=self._via_places(values),
            # IPOPT adds a multiple of the identity to the Hessian until the matrix has n positive and m negative
            # eigenvalues, n unknowns and m rows: with none, that of the projected Hessian are all positive.
            second_order=shifts[-1] == 0.0 if shifts else None,
        )

    def _goal_error(self, values: Array) -> float:
        """Goal error of unknowns [rad]."""
        last = self._task.dimension * int(self._shared[-1])
        return self._task.goal_error(self._last_attitude(values), values[last : last + self._task.dimension])

    def _last_attitude(self, values: Array) -> Array:
        return so3.matrix_from_quat(so3.normalised(values[self._open.start - 4 : self._open.start]))

    def _via_places(self, values: Array) -> Array:
        """Places of all waypoints, given or found."""
        places = np.array([np.nan if point.place is None else point.place for point in self._task.via])
        places[open_points(self._task)] = values[self._open]
        return places

    def _bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the unknowns: limits, fixed ends, the duration unless it is to be found."""
        task, bounds = self._task, []
        for limit, free in ((task.lower, -np.inf), (task.upper, np.inf)):
            control = np.tile(limit, (int(self._shared.max()) + 1, 1))
            control[self._shared[: task.equal_points]] = task.start
            if task.end is not None:
                control[self._shared[-task.equal_points :]] = task.end
            duration = _SHORTEST * task.duration if task.cost == "time" and free < 0.0 else task.duration
            inner, ends = np.full(4 * len(self.places), free), np.full((self._n_ends, 4), free)
            ends[self._ones] = [0.0, 0.0, 0.0, 1.0]
            opened = np.full(self._open.stop - self._open.start, 0.0 if free < 0.0 else 1.0)
            bounds.append(np.concatenate([control.ravel(), [duration], inner, ends.ravel(), opened]))
        return bounds[0], bounds[1]


def final_conditions(task: Reorientation, coordinates: Any, quaternion: Any) -> Any:
    """Three rows of the last coordinates and quaternion: zero at the target; for an axis the third is the cosine."""
    import casadi

    if task.target is not None:
        x, y, z, w = so3.quat_from_matrix(task.target)
        return casadi.DM([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]) @ quaternion
    axis, direction = task.pointing_axes()
    pointed = casadi.DM(axis)
    if task.link is not None:
        shape = casadi.DM(task.coupling) @ coordinates + casadi.DM(task.offset)
        pointed = symbolic_body(task.body).link_pose(task.link)(shape)[:3, :3] @ pointed
    # The conjugate quaternion turns into inertial axes.
    turned = turned_back(casadi.vertcat(-quaternion[:3], quaternion[3]), pointed)
    return casadi.DM(np.vstack([task.constrained_directions(), direction])) @ turned


def _derivative_rows(task: Reorientation, basis: SplineBasis, unknown: Any) -> Any:
    """Second and third derivatives of the coordinates by time, at their control points, as shares of limits: (j,)."""
    import casadi

    sparse, place = scipy_sparse(), task.dimension * basis.dimension
    rows = []
    for order, limit in ((2, task.acceleration_limit), (3, task.jerk_limit)):
        limited = np.flatnonzero(np.isfinite(limit))
        chosen = sparse.csr_matrix(sparse.eye(task.dimension).tocsr()[limited] / limit[limited, None])
        matrix = sparse_matrix(sparse.kron(basis.derivative_control(order), chosen))
        rows.append(matrix @ unknown[:place] / unknown[place] ** order)
    return casadi.vertcat(*rows)
