"""The optimal control problem in the path's coefficients alone, with the exact derivative of the final attitude."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array, Mask
from ..deformation.deformation import deformation_along
from ..errors import TrajectoryError, unknown_name
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.body_path import route_along
from ..shape_space.shape_path import ShapePath
from ._gauss import gauss_tableau
from ._plan_limits import derivative_limits
from ._polish import end_conditions, goal_derivative, movable_points
from ._spline_basis import SplineBasis
from ._via_rows import open_points, via_rows
from .collocation import NlpSolution
from .guesses.loops import start_metric
from .solver_callback import BestIterate, IterationCallback
from .symbolic import symbolic_body
from .task import COSTS, Reorientation

# Accuracy of the reconstruction in every iteration [rad]: below what the solver's own tolerance can tell.
_RECONSTRUCTION_TOLERANCE = 1e-9
# Accuracy of the optimum, scaled.
_TOLERANCE = 1e-8
# Gauss nodes of a piece, for the cost: exact for the costs "rate" and "acceleration" of a cubic spline.
_STAGES = 4
# SLSQP stops where the cost changes by less than this share of the tolerance: the cost is quadratic at its optimum, so
# the path is much less accurate than the cost.
_COST_CHANGE = 1e-2
# Turn still missing at which a solution counts as converged [rad]: the Newton corrections remove the rest.
_GOAL_REACHED = 1e-6
# Scaled unknowns this close to a limit count as being at it.
_ACTIVE = 1e-9
# SLSQP may stop earlier, where the optimality conditions hold to this many tolerances: the cost cannot resolve more.
_CONDITIONS_MET = 10.0
# The least stiffness of a coordinate in the cost [kg m^2 or kg], so that one that moves for nothing has a finite scale.
_LEAST_STIFFNESS = 1e-12
# The least cost that scales the others, so that a guess at rest does not divide by zero.
_LEAST_COST = 1e-300
# Below this turn [rad] the derivative of the logarithm is taken from its series, 1/12 + O(turn^2).
_SMALL_TURN = 1e-4
# The least turn to divide by [rad].
_LEAST_TURN = 1e-12
_NOT_HERE = ("time", "effort")
_STOPPED = "stopped on request"
_CONVERGED = "conditions of optimality met"


class _EndSearchError(Exception):
    """Raised in a callback to end SLSQP at an iterate: not every version of SciPy offers another way."""

    def __init__(self, last: Array, reason: str) -> None:
        super().__init__(reason)
        self.last = last


class ReducedProgram:
    """Sequential quadratic programming (SciPy's SLSQP) in the control points of the path; the duration is given.

    The attitude at the end is that of `reconstruct`, its derivative that of `end_derivative`: there is no error of a
    transcription. Unknowns are scaled by the diagonal of the cost in the metric of the start.

    Raises
    ------
    UnknownNameError, TrajectoryError
        For the costs "time" and "effort", and limits of efforts; for waypoints without a time.
    """

    def __init__(self, task: Reorientation, basis: SplineBasis) -> None:
        check_reducible(task)
        self._task, self._basis = task, basis
        inside, weights, _ = gauss_tableau(_STAGES)
        places = (basis.nodes[:-1, None] + inside / basis.pieces).ravel()
        self._weights = np.tile(weights, basis.pieces) / basis.pieces
        self._values = basis.matrix(places)
        self._slopes = basis.matrix(places, 2 if task.cost == "acceleration" else 1)
        self._density = _density_gradient(task, len(places)) if task.cost == "kinetic" else None

    def solve(
        self,
        control: Array,
        duration: float,
        quaternions: Callable[[Array], Array],  # noqa: ARG002 (the integrator finds its own)
        *,
        iterations: int,
        tolerance: float = _TOLERANCE,
        via_places: Array | None = None,  # noqa: ARG002 (all are given)
        iteration_callback: IterationCallback | None = None,
    ) -> NlpSolution:
        """A local optimum from a guess: control points (k, m) and T. As `CollocationProgram.solve`."""
        task = self._task
        problem = _ScaledProblem(self, task, self._basis, np.clip(control, task.lower, task.upper), duration)
        best = BestIterate(iteration_callback, lambda x: float(np.linalg.norm(problem.end(x)[0])))

        def callback(x: Array) -> None:
            residual, missing = problem.residuals(x)
            here = x.copy()
            stop = best.report(here, problem.cost(x)[0] * problem.cost_scale, missing)
            # Rate limits have multipliers that the residual does not know.
            converged = not problem.limits_rates and max(residual, missing) < _CONDITIONS_MET * tolerance
            if stop or converged:
                raise _EndSearchError(here, _STOPPED if stop else _CONVERGED)

        last, success, status, count = problem.minimised(callback, best, iterations, _COST_CHANGE * tolerance)
        residual, missing = problem.residuals(last)
        points = problem.control_points(last)
        return NlpSolution(
            control=points,
            duration=duration,
            attitude=self._motion(points, duration)[1].final_attitude,
            cost=problem.cost(last)[0] * problem.cost_scale,
            status=status,
            converged=success and missing < _GOAL_REACHED,
            kkt_residual=max(residual, missing),
            infeasibility=missing,
            iterations=count,
            via_places=np.array([point.place for point in task.via], dtype=np.float64),
        )

    def _motion(self, control: Array, duration: float) -> tuple[ShapePath, Motion]:
        path = self._basis.path(self._task.shapes(control), duration, self._task.body.joint_names)
        deformation = deformation_along(self._task.body, route_along(self._task.body, path))
        return path, reconstruct(deformation, self._task.momentum, tolerance=_RECONSTRUCTION_TOLERANCE)

    def end(self, control: Array, duration: float) -> tuple[Array, Array]:
        """The turn that is missing at the end (j,), and its derivative by the control points (j, k, m).

        For a pointed axis the derivative is exact to first order in what is missing.
        """
        path, motion = self._motion(control, duration)
        slopes = goal_derivative(self._task, self._basis, path, motion, control)
        turn = self._task.turn_to_goal(motion.final_attitude, control[-1])
        if self._task.target is None:
            return self._task.constrained_directions() @ turn, -slopes
        return turn, -np.tensordot(_inverse_right_jacobian(turn), slopes, axes=1)

    def cost(self, control: Array, duration: float) -> tuple[float, Array]:
        """The cost and its derivative by the control points (k, m)."""
        task, slopes = self._task, self._slopes
        bend = slopes @ control
        if self._density is None:
            power = 3 if task.cost == "acceleration" else 1
            turned = bend @ task.coupling.T @ task.coupling
            value = 0.5 * float(self._weights @ np.sum(turned * bend, axis=1)) / duration**power
            return value, slopes.T @ (self._weights[:, None] * turned) / duration**power
        density, by_shape, by_slope = (np.array(part) for part in self._density((self._values @ control).T, bend.T))
        change = self._values.T @ (self._weights[:, None] * by_shape.T)
        change += slopes.T @ (self._weights[:, None] * by_slope.T)
        return float(density.ravel() @ self._weights) / duration, change / duration

    def stiffness(self) -> Array:
        """How steeply the cost grows with each control point in the metric of the start, square root: (k, m)."""
        by_coordinate = np.maximum(np.diag(start_metric(self._task)), _LEAST_STIFFNESS)
        return np.sqrt(np.outer(self._weights @ self._slopes**2, by_coordinate))


def check_reducible(task: Reorientation) -> None:
    """Raise UnknownNameError or TrajectoryError for a task that is not for the method "reduced"."""
    if task.cost in _NOT_HERE:
        raise unknown_name("cost for method 'reduced'", task.cost, [cost for cost in COSTS if cost not in _NOT_HERE])
    if task.efforts_limited:
        raise unknown_name("method with limits of efforts", "reduced", ["collocation"])
    if open_points(task):
        raise TrajectoryError(
            "method 'reduced' passes waypoints at given times; give their times, or use 'collocation'"
        )


class _ScaledProblem:
    """The program as SciPy sees it: the movable control points in units of their stiffness, the cost as a ratio.

    Attributes
    ----------
    cost_scale : cost of the guess
    limits_rates : whether any rate is limited, or acceleration, or jerk
    """

    def __init__(
        self, program: ReducedProgram, task: Reorientation, basis: SplineBasis, guess: Array, duration: float
    ) -> None:
        self._program, self._guess, self._duration = program, guess, duration
        self._free = movable_points(task, basis)
        stiffness = program.stiffness()
        self._unit = (stiffness.max() / stiffness)[self._free]
        self.cost_scale = max(program.cost(guess, duration)[0], _LEAST_COST)
        self._low, self._high = (
            np.broadcast_to(limit, guess.shape)[self._free] / self._unit for limit in (task.lower, task.upper)
        )
        bounds = derivative_limits(task, duration)
        self.limits_rates = any(bool(np.isfinite(limit).any()) for limit in bounds.values())
        self._constraints: list[dict[str, Any]] = [
            {"type": "eq", "fun": lambda x: self.end(x)[0], "jac": lambda x: self.end(x)[1]}
        ]
        passed, values = via_rows(task, basis, np.array([point.place for point in task.via], dtype=np.float64))
        conditions = np.kron(end_conditions(task, basis), np.eye(task.dimension))
        every = np.concatenate([conditions, passed.reshape(-1, guess.size)])
        self._end_conditions = every[:, self._free.ravel()] * self._unit
        if len(every):
            fixed = np.asarray(every @ np.where(self._free, 0.0, guess).ravel(), dtype=np.float64)
            fixed[len(conditions) :] -= values
            self._constraints.append(_linear_equations(self._end_conditions, fixed))
        if self.limits_rates:
            self._constraints.append(_within_rates(basis, list(bounds.values()), guess, self._free, self._unit))
        # SciPy evaluates the constraint and its derivative separately at the same x: the last result is kept.
        self._known: dict[bytes, tuple[Array, Array]] = {}

    def control_points(self, x: Array) -> Array:
        """All control points (k, m)."""
        whole = self._guess.copy()
        whole[self._free] = x * self._unit
        return whole

    def cost(self, x: Array) -> tuple[float, Array]:
        """The scaled cost and its gradient."""
        value, slope = self._program.cost(self.control_points(x), self._duration)
        return value / self.cost_scale, slope[self._free] * self._unit / self.cost_scale

    def end(self, x: Array) -> tuple[Array, Array]:
        """The turn that is missing at the end, and its derivative."""
        key = x.tobytes()
        if key not in self._known:
            self._known.clear()
            missing, slopes = self._program.end(self.control_points(x), self._duration)
            self._known[key] = missing, slopes[:, self._free] * self._unit
        return self._known[key]

    def residuals(self, x: Array) -> tuple[float, float]:
        """Violation of the Karush-Kuhn-Tucker conditions, rate limits left out, and of the goal."""
        missing, slopes = self.end(x)
        gradient = self.cost(x)[1]
        slopes = np.concatenate([slopes, self._end_conditions])
        below, above = x <= self._low + _ACTIVE, x >= self._high - _ACTIVE
        inside = ~(below | above)
        gradient -= np.linalg.lstsq(slopes[:, inside].T, gradient[inside], rcond=None)[0] @ slopes
        wrong = np.concatenate([np.abs(gradient[inside]), -gradient[below & ~above], gradient[above & ~below]])
        return float(wrong.max(initial=0.0)), float(np.abs(missing).max())

    def minimised(
        self, callback: Callable[[Array], None], best: BestIterate, iterations: int, cost_change: float
    ) -> tuple[Array, bool, str, int]:
        """Final unknowns, success, message and iterations of SLSQP; where it was stopped, of the best iterate."""
        from scipy.optimize import minimize

        try:
            found = minimize(
                self.cost,
                self._guess[self._free] / self._unit,
                jac=True,
                method="SLSQP",
                bounds=np.stack([self._low, self._high], axis=1),
                constraints=self._constraints,
                callback=callback,
                options={"maxiter": iterations, "ftol": cost_change},
            )
        except _EndSearchError as end:
            status = str(end)
            if status == _STOPPED:
                return best.unknowns, False, status, best.iterations
            return end.last, True, status, best.iterations
        return found.x, bool(found.success), str(found.message), int(found.nit)


def _inverse_right_jacobian(turn: Array) -> Array:
    """J_r^-1 of a rotation vector: log(exp(turn) exp(e)) = turn + J_r^-1 e to first order in e; (3,) -> (3, 3)."""
    angle = max(float(np.linalg.norm(turn)), _LEAST_TURN)
    cross = so3.hat(turn)
    half = 0.5 * angle
    share = (1.0 - half / np.tan(half)) / angle**2 if angle > _SMALL_TURN else 1.0 / 12.0
    return np.eye(3) - 0.5 * cross.T + share * cross @ cross


def _linear_equations(rows: Array, fixed: Array) -> dict[str, Any]:
    """Equations that are linear in the scaled unknowns: rows @ x + fixed = 0."""
    return {"type": "eq", "fun": lambda x: rows @ x + fixed, "jac": lambda _: rows}


def _within_rates(basis: SplineBasis, bounds: list[Array], guess: Array, free: Mask, unit: Array) -> dict[str, Any]:
    """Limits of derivatives by place, (m,) each, as inequalities that are linear in the scaled unknowns."""
    every, largest = [], []
    for order, limit in enumerate(bounds, start=1):
        limited = np.flatnonzero(np.isfinite(limit))
        every.append(np.kron(basis.derivative_control(order), np.eye(len(limit))[limited]))
        largest.append(np.tile(limit[limited], basis.dimension - order))
    every, largest = np.concatenate(every), np.concatenate(largest)
    rows = every[:, free.ravel()] * unit
    fixed = every @ np.where(free, 0.0, guess).ravel()
    both, room = np.concatenate([-rows, rows]), np.concatenate([largest - fixed, largest + fixed])
    return {"type": "ineq", "fun": lambda x: both @ x + room, "jac": lambda _: both}


def _density_gradient(task: Reorientation, count: int) -> Any:
    """Half the kinetic metric at (r, u), and its derivatives by r and u, at `count` nodes at once."""
    import casadi

    r, u = casadi.SX.sym("r", task.dimension), casadi.SX.sym("u", task.dimension)
    coupling = casadi.DM(task.coupling)
    slope, shape = coupling @ u, coupling @ r + casadi.DM(task.offset)
    density = 0.5 * casadi.dot(slope, symbolic_body(task.body).shape_metric(shape) @ slope)
    parts = [density, casadi.gradient(density, r), casadi.gradient(density, u)]
    return casadi.Function("density", [r, u], [casadi.densify(part) for part in parts], {"cse": True}).map(count)
