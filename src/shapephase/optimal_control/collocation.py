"""The optimal control problem as a nonlinear program: the attitude by Gauss collocation, the shape a spline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from .solver_watch import BestIterate, Watch, ipopt_callback
from .spline_basis import SplineBasis
from .symbolic import solved, symbolic_body
from .task import Reorientation

_STAGES = 3
_DEGENERATE = 1e-3
_GOOD = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
# CasADi takes Ctrl-C for itself: in the middle of an iteration the solver says the first, between them the second.
_INTERRUPTED, _STOPPED = "NonIpopt_Exception_Thrown", "User_Requested_Stop"

_built: WeakKeyDictionary[Body, dict[tuple[object, ...], tuple[Any, Any, Any]]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Solved:
    """What a nonlinear program ended with.

    Attributes
    ----------
    control : (size, m) control points of the free coordinates [rad or m]
    duration : [s]
    attitude : (3, 3) at the end, as the program had it
    cost : as the program had it
    status : the solver's word
    converged : whether it is a local optimum to the solver's tolerance
    kkt_residual : the largest of the scaled conditions of Karush, Kuhn and Tucker left over
    infeasibility : the largest constraint violated
    iterations : how many
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


def gauss_tableau(stages: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of Gauss on [0, 1], and the integrals from 0 to each node of the polynomials through them."""
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    places = 0.5 * (nodes + 1.0)
    powers = np.arange(stages)
    values = places[:, None] ** powers
    integrals = places[:, None] ** (powers + 1) / (powers + 1)
    return places, 0.5 * weights, np.asarray(np.linalg.solve(values.T, integrals.T).T, dtype=np.float64)


class CollocationProgram:
    """Gauss collocation of the quaternion, the shape a spline, the whole a sparse program for IPOPT.

    Place s = t/T runs over [0, 1], u = dr/ds. At the three Gauss nodes of a piece

        dq/ds = q (T omega)/2,    T omega = T I^-1 R^T mu - A u,

    whose collocation keeps |q| to rounding, as it keeps all quadratic invariants; order six. Unknown are
    x = (control points, T, q at the nodes, q at the ends of the pieces). What a node sees of them is linear,
    y = W x with y = (r, u, q, T), so that Jacobian and Hessian are those of one node, chained on by W: exact, banded.

    Attributes
    ----------
    places : of the nodes
    program : x, p, f and g as CasADi's `nlpsol` takes them
    derivatives : Jacobian of g and Hessian of the Lagrangian, as functions that `nlpsol` takes
    """

    def __init__(self, task: Reorientation, basis: SplineBasis) -> None:
        import casadi

        self._task, self._basis = task, basis
        inside, weights, integrals = gauss_tableau(_STAGES)
        self.places = (basis.nodes[:-1, None] + inside / basis.pieces).ravel()
        m, pieces, count = task.size, basis.pieces, basis.pieces * _STAGES
        step = 1.0 / pieces
        unknown = casadi.MX.sym("unknown", m * basis.size + 1 + 4 * (count + pieces + 1))
        seen = self._seen()
        at_node = casadi.reshape(seen @ unknown, 2 * m + 5, count)
        node, first, second = _kept_node_functions(task)
        turning, density = node.map(count)(at_node)
        shares = casadi.DM(step * np.tile(weights, pieces))
        cost = casadi.dot(density.T, shares)
        # Rows that are linear but for the turning: the collocation, and the limits of the rates.
        linear, from_turning = self._linear_rows(step, weights, integrals)
        last = unknown[-4:]
        final = _final_conditions(task, last)
        rows = casadi.vertcat(linear @ unknown - from_turning @ casadi.vec(turning), final)
        slopes = casadi.diagcat(*casadi.horzsplit(first.map(count)(at_node), 2 * m + 5))
        jacobian = casadi.vertcat(linear - from_turning @ (slopes @ seen), casadi.jacobian(final, unknown))
        multipliers, of_cost = casadi.MX.sym("multipliers", rows.shape[0]), casadi.MX.sym("of_cost")
        upon = casadi.reshape(-from_turning.T @ multipliers[: linear.shape[0]], 4, count)
        of_density = 0.0 if task.cost == "time" else of_cost
        blocks = second.map(count)(at_node, upon, of_density * shares.T)
        hessian = seen.T @ (casadi.diagcat(*casadi.horzsplit(blocks, 2 * m + 5)) @ seen)
        plain = casadi.dot(final, multipliers[linear.shape[0] :])
        if task.cost == "time":
            cost = unknown[m * basis.size]
        if task.cost == "acceleration":
            cost = self._bending(unknown)
            plain = plain + of_cost * cost
        hessian = hessian + casadi.hessian(plain, unknown)[0]
        none = casadi.MX.sym("p", 0, 1)
        self._cost_function = casadi.Function("cost", [unknown], [cost])
        self.program = {"x": unknown, "p": none, "f": cost, "g": rows}
        self.derivatives = {
            "jac_g": casadi.Function("jac_g", [unknown, none], [rows, jacobian]),
            "hess_lag": casadi.Function("hess_lag", [unknown, none, of_cost, multipliers], [casadi.triu(hessian)]),
        }
        ends = np.zeros(3) if task.target is not None else np.array([0.0, 0.0, np.inf])
        self._low, self._high = np.append(self._low, np.zeros(3)), np.append(self._high, ends)

    def _seen(self) -> Any:
        """W, what the nodes see of the unknowns."""
        sparse = _scipy_sparse()
        m, count = self._task.size, len(self.places)
        shapes = sparse.kron(self._basis.matrix(self.places), sparse.eye(m))
        rates = sparse.kron(self._basis.matrix(self.places, 1), sparse.eye(m))
        durations = np.ones((count, 1))
        attitudes = sparse.eye(4 * count)
        whole = sparse.block_diag([sparse.vstack([shapes, rates]), durations, attitudes]).tocsr()
        order = np.concatenate(
            [
                np.arange(2 * m * count).reshape(2, count, m).transpose(1, 0, 2).reshape(count, 2 * m),
                2 * m * count + count + np.arange(4 * count).reshape(count, 4),
                2 * m * count + np.arange(count)[:, None],
            ],
            axis=1,
        )
        rest = sparse.csr_matrix((whole.shape[0], 4 * (self._basis.pieces + 1)))
        return _sparse(sparse.hstack([whole, rest]).tocsr()[order.ravel()])

    def _linear_rows(self, step: float, weights: Array, integrals: Array) -> tuple[Any, Any]:
        """The linear part of the collocation and of the limits of rates, and how the turning enters."""
        sparse = _scipy_sparse()
        task, basis = self._task, self._basis
        pieces, count = basis.pieces, len(self.places)
        before, after = sparse.eye(pieces, pieces + 1), sparse.eye(pieces, pieces + 1, k=1)
        from_start = sparse.kron(before, np.ones((_STAGES, 1)))
        wide = sparse.csr_matrix((4 * (count + pieces), task.size * basis.size + 1))
        quaternions = sparse.kron(
            sparse.block_array([[sparse.eye(count), -from_start], [None, after - before]]), sparse.eye(4)
        )
        limited = np.flatnonzero(np.isfinite(task.rates))
        rates = sparse.kron(basis.rate_control, sparse.eye(task.size).tocsr()[limited])
        paces = np.tile(task.rates[limited], basis.size - 1)[:, None]
        rest = sparse.csr_matrix((rates.shape[0], quaternions.shape[1]))
        linear = sparse.vstack(
            [
                sparse.hstack([wide, quaternions]),
                sparse.hstack([rates, -paces, rest]),
                sparse.hstack([rates, paces, rest]),
            ]
        )
        turning = sparse.vstack(
            [
                sparse.kron(sparse.eye(pieces), step * integrals),
                sparse.kron(sparse.eye(pieces), step * weights[None]),
            ]
        )
        turning = sparse.vstack(
            [sparse.kron(turning, sparse.eye(4)), sparse.csr_matrix((2 * rates.shape[0], 4 * count))]
        )
        free = np.full(rates.shape[0], np.inf)
        exact = np.zeros(4 * (count + pieces))
        self._low = np.concatenate([exact, -free, 0.0 * paces[:, 0]])
        self._high = np.concatenate([exact, 0.0 * paces[:, 0], free])
        return _sparse(linear), _sparse(turning)

    def _bending(self, unknown: Any) -> Any:
        """The integral of half the squared second derivative: exact by two nodes of a piece or more."""
        import casadi

        task, basis = self._task, self._basis
        _, weights, _ = gauss_tableau(_STAGES)
        bend = basis.matrix(self.places, 2)
        gram = bend.T @ (np.tile(weights, basis.pieces)[:, None] / basis.pieces * bend)
        control = casadi.reshape(unknown[: task.size * basis.size], task.size, basis.size)
        in_joints = casadi.DM(task.ties) @ control
        return 0.5 * casadi.dot(in_joints @ casadi.DM(gram), in_joints) / unknown[task.size * basis.size] ** 3

    def solve(
        self,
        control: Array,
        duration: float,
        quaternions: Callable[[Array], Array],
        *,
        iterations: int,
        tolerance: float = 1e-8,
        watch: Watch | None = None,
    ) -> Solved:
        """A local optimum from a guess: control points (size, m), T, and the attitude at places (N,) -> (N, 4)."""
        import casadi

        task, basis = self._task, self._basis
        scale = self._cost(control, duration)
        guess = np.concatenate(
            [control.ravel(), [duration], quaternions(self.places).ravel(), quaternions(basis.nodes).ravel()]
        )
        low, high = self._bounds()
        options = {
            "print_level": 0,
            "sb": "yes",
            "max_iter": int(iterations),
            "tol": tolerance,
            "obj_scaling_factor": 1.0 / scale,
            "nlp_scaling_method": "none",
            "bound_relax_factor": 0.0,
            "linear_solver": "mumps",
            "mu_strategy": "adaptive",
        }
        followed = BestIterate(watch)
        # CasADi does not keep it alive.
        heard = ipopt_callback(followed, len(guess), self._low, self._high)
        solver = casadi.nlpsol(
            "plan",
            "ipopt",
            self.program,
            {
                "ipopt": options,
                "print_time": False,
                "iteration_callback": heard,
                **self.derivatives,
            },
        )
        found = solver(x0=np.clip(guess, low, high), lbx=low, ubx=high, lbg=self._low, ubg=self._high)
        stats = solver.stats()
        status = str(stats["return_status"])
        if followed.error is not None:
            raise followed.error
        if status == _INTERRUPTED or (status == _STOPPED and not followed.stopped):
            raise KeyboardInterrupt
        values, cost = np.array(found["x"]).ravel(), float(found["f"])
        points = task.size * basis.size
        history = stats["iterations"]
        dual, primal = (float(history[key][-1]) if history[key] else np.inf for key in ("inf_du", "inf_pr"))
        if status in _GOOD and dual > _DEGENERATE:
            # IPOPT measures by the multipliers, which have no bound where the constraints leave no way but one.
            status = f"{status}, but degenerate"
        if status == _STOPPED:
            values, cost, primal = followed.unknowns, followed.cost, followed.infeasibility
        last = so3.matrix_from_quat(so3.normalised(values[-4:]))
        return Solved(
            values[:points].reshape(basis.size, task.size),
            float(values[points]),
            last,
            cost,
            status,
            status in _GOOD,
            max(dual, primal),
            primal,
            int(stats["iter_count"]),
        )

    def _cost(self, control: Array, duration: float) -> float:
        rest = np.zeros(4 * (len(self.places) + self._basis.pieces + 1))
        value = float(self._cost_function(np.concatenate([control.ravel(), [duration], rest])))
        return value if value > 0.0 else 1.0

    def _bounds(self) -> tuple[Array, Array]:
        task, basis = self._task, self._basis
        bounds = []
        for limit, free, first in ((task.lower, -np.inf, 0), (task.upper, np.inf, 1)):
            control = np.tile(limit, (basis.size, 1))
            control[0] = task.start
            if task.end is not None:
                control[-1] = task.end
            if task.rest_to_rest:
                control[1] = control[0]
                if task.end is not None:
                    control[-2] = control[-1]
            duration = 1e-3 * task.duration if task.cost == "time" and first == 0 else task.duration
            inner, ends = np.full(4 * len(self.places), free), np.full((basis.pieces + 1, 4), free)
            ends[0] = [0.0, 0.0, 0.0, 1.0]
            bounds.append(np.concatenate([control.ravel(), [duration], inner, ends.ravel()]))
        return bounds[0], bounds[1]


def _kept_node_functions(task: Reorientation) -> tuple[Any, Any, Any]:
    """`_node_functions`, kept as long as the body: those of many joints take seconds to build."""
    kept = _built.setdefault(task.body, {})
    key = (task.cost, task.ties.shape, task.ties.tobytes(), task.offset.tobytes(), task.momentum.tobytes())
    if key not in kept:
        kept[key] = _node_functions(task)
    return kept[key]


def _node_functions(task: Reorientation) -> tuple[Any, Any, Any]:
    """dq/ds (4,) and the cost's density at y = (r, u, q, T), the Jacobian of dq/ds, the Hessian of both, weighted."""
    import casadi

    body = symbolic_body(task.body)
    m = task.size
    y = casadi.SX.sym("y", 2 * m + 5)
    r, u, q, duration = y[:m], y[m : 2 * m], y[2 * m : 2 * m + 4], y[-1]
    ties = casadi.DM(task.ties)
    joints, rates = ties @ r + casadi.DM(task.offset), ties @ u
    turn = -body.connection(joints) @ rates
    if np.any(task.momentum):
        seen = casadi.DM(task.momentum)
        vector, scalar = q[:3], q[3]
        back = seen - 2.0 * scalar * casadi.cross(vector, seen) + 2.0 * casadi.cross(vector, casadi.cross(vector, seen))
        turn = turn + duration * solved(body.inertia(joints), back)
    turning = 0.5 * casadi.vertcat(q[3] * turn + casadi.cross(q[:3], turn), -casadi.dot(q[:3], turn))
    metric = {"kinetic": lambda: ties.T @ body.shape_metric(joints) @ ties, "rate": lambda: casadi.SX(ties.T @ ties)}
    form = metric[task.cost]() / duration if task.cost in metric else casadi.SX(m, m)
    density = 0.5 * casadi.dot(u, form @ u)
    upon, weight = casadi.SX.sym("upon", 4), casadi.SX.sym("weight")
    gradient = casadi.gradient(casadi.dot(upon, turning) + weight * density, y)
    # Everything is linear in u but the density: its block of the Hessian is known, only the rest is differentiated.
    others = casadi.vertcat(r, y[2 * m :])
    mixed = casadi.jacobian(gradient, others)
    across = mixed[m : 2 * m, :]
    upper = casadi.horzcat(mixed[:m, :m], across[:, :m].T, mixed[:m, m:])
    middle = casadi.horzcat(across[:, :m], weight * form, across[:, m:])
    lower = casadi.horzcat(mixed[2 * m :, :m], across[:, m:].T, mixed[2 * m :, m:])
    hessian = casadi.densify(casadi.vertcat(upper, middle, lower))
    jacobian = casadi.densify(casadi.jacobian(turning, y))
    options = {"cse": True}
    return (
        casadi.Function("node", [y], [turning, density], options),
        casadi.Function("node_jacobian", [y], [jacobian], options),
        casadi.Function("node_hessian", [y, upon, weight], [hessian], options),
    )


def _final_conditions(task: Reorientation, last: Any) -> Any:
    """Three rows of the last quaternion: zero at the target; for an axis the third is the cosine, not below zero."""
    import casadi

    if task.target is not None:
        x, y, z, w = so3.quat_from_matrix(task.target)
        return casadi.DM([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]) @ last
    axis, direction = task.pointing_axes()
    vector, scalar = last[:3], last[3]
    seen = casadi.DM(axis)
    turned = seen + 2.0 * scalar * casadi.cross(vector, seen) + 2.0 * casadi.cross(vector, casadi.cross(vector, seen))
    return casadi.DM(np.vstack([task.needed(), direction])) @ turned


def _scipy_sparse() -> Any:
    """SciPy's sparse matrices: imported late, and without the types that they lack."""
    from scipy import sparse

    return sparse


def _sparse(matrix: Any) -> Any:
    """A constant sparse matrix of CasADi."""
    import casadi

    return casadi.DM(_scipy_sparse().csc_matrix(matrix))
