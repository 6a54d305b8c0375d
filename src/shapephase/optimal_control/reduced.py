"""The optimal control problem in the path's coefficients alone: the attitude by the integrator, exactly derived."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array, Mask
from ..deformation.deformation import articulated
from ..errors import unknown_name
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.shape_path import ShapePath
from ._guesses import start_metric
from .collocation import Solved, gauss_tableau
from .polish import end_derivative, movable_points
from .solver_watch import BestIterate, Watch
from .spline_basis import SplineBasis
from .symbolic import symbolic_body
from .task import COSTS, Reorientation

_TOLERANCE = 1e-9
_STAGES = 4
# The cost still changes by this share of the tolerance where SLSQP stops; the turn missing must be less than that.
_CHANGE, _REACHED = 1e-2, 1e-6
_ACTIVE = 1e-9


# It may stop earlier, where the conditions of optimality are met to this many tolerances: more its cost cannot tell.
_SETTLED = 10.0
_STOPPED = "stopped as asked"


class _EnoughError(Exception):
    """Ends SLSQP where it is: it offers no other way out in all versions of SciPy."""

    def __init__(self, last: Array, why: str) -> None:
        super().__init__(why)
        self.last = last


class ReducedProgram:
    """Sequential quadratic programming (SciPy's SLSQP) in the control points of the path; the duration is given.

    The attitude at the end is that of `reconstruct`, its derivative that of `end_derivative`: there is no error of a
    transcription. Unknowns are scaled by the diagonal of the cost in the metric of the start.

    Raises
    ------
    UnknownNameError
        For the cost "time".
    """

    def __init__(self, task: Reorientation, basis: SplineBasis) -> None:
        if task.cost == "time":
            raise unknown_name("cost for method 'reduced'", task.cost, [cost for cost in COSTS if cost != "time"])
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
        tolerance: float = 1e-8,
        watch: Watch | None = None,
    ) -> Solved:
        """A local optimum from a guess: control points (size, m) and T. As `CollocationProgram.solve`."""
        from scipy.optimize import minimize

        task, basis = self._task, self._basis
        guess = np.clip(control, task.lower, task.upper)
        free = movable_points(task, basis)
        stiffness = np.sqrt(np.outer(self._weights @ self._slopes**2, np.maximum(np.diag(start_metric(task)), 1e-12)))
        unit = (stiffness.max() / stiffness)[free]
        scale = max(self._cost(guess, duration)[0], 1e-300)
        known: dict[bytes, tuple[Array, Array]] = {}

        def points(x: Array) -> Array:
            whole = guess.copy()
            whole[free] = x * unit
            return whole

        def cost(x: Array) -> tuple[float, Array]:
            value, slope = self._cost(points(x), duration)
            return value / scale, slope[free] * unit / scale

        def end(x: Array) -> tuple[Array, Array]:
            key = x.tobytes()
            if key not in known:
                known.clear()
                missed, slopes = self.end(points(x), duration)
                known[key] = missed, slopes[:, free] * unit
            return known[key]

        low, high = (np.broadcast_to(limit, guess.shape)[free] / unit for limit in (task.lower, task.upper))
        constraints: list[dict[str, Any]] = [{"type": "eq", "fun": lambda x: end(x)[0], "jac": lambda x: end(x)[1]}]
        limited = bool(np.isfinite(task.rates).any())
        if limited:
            constraints.append(self._within_rates(guess, free, unit, duration))
        followed = BestIterate(watch)

        def left(x: Array) -> tuple[float, float]:
            """Of the conditions of Karush, Kuhn and Tucker, without limits of rates, and of the constraints."""
            missed, slopes = end(x)
            gradient = cost(x)[1]
            below, above = x <= low + _ACTIVE, x >= high - _ACTIVE
            inside = ~(below | above)
            gradient -= np.linalg.lstsq(slopes[:, inside].T, gradient[inside], rcond=None)[0] @ slopes
            wrong = np.concatenate([np.abs(gradient[inside]), -gradient[below & ~above], gradient[above & ~below]])
            return float(wrong.max(initial=0.0)), float(np.abs(missed).max())

        def heard(x: Array) -> None:
            residual, missed = left(x)
            here = x.copy()
            asked = followed.stops(here, cost(x)[0] * scale, missed)
            if asked or (not limited and max(residual, missed) < _SETTLED * tolerance):
                raise _EnoughError(here, _STOPPED if asked else "conditions of optimality met")

        try:
            found = minimize(
                cost,
                guess[free] / unit,
                jac=True,
                method="SLSQP",
                bounds=np.stack([low, high], axis=1),
                constraints=constraints,
                callback=heard,
                options={"maxiter": iterations, "ftol": _CHANGE * tolerance},
            )
            last, success, status, count = found.x, bool(found.success), str(found.message), int(found.nit)
        except _EnoughError as enough:
            status, count = str(enough), followed.iterations
            success = status != _STOPPED
            last = enough.last if success else followed.unknowns
        residual, missed = left(last)
        return Solved(
            points(last),
            duration,
            self._motion(points(last), duration)[1].final_attitude,
            cost(last)[0] * scale,
            status,
            success and missed < _REACHED,
            max(residual, missed),
            missed,
            count,
        )

    def _motion(self, control: Array, duration: float) -> tuple[ShapePath, Motion]:
        path = self._basis.path(self._task.shapes(control), duration, self._task.body.joint_names)
        motion = reconstruct(articulated(self._task.body, path), self._task.momentum, tolerance=_TOLERANCE)
        return path, motion

    def end(self, control: Array, duration: float) -> tuple[Array, Array]:
        """The turn that is missing at the end (k,), and its derivative by the control points (k, size, m).

        Of a pointed axis the derivative is to first order in what is missing.
        """
        path, motion = self._motion(control, duration)
        needed = self._task.needed()
        slopes = np.tensordot(needed, end_derivative(self._task, self._basis, path, motion), axes=1)
        turn = self._task.turn(motion.final_attitude)
        # What a change of the end does to its logarithm, beyond first order in the turn itself.
        size = max(float(np.linalg.norm(turn)), 1e-12)
        cross = so3.hat(turn)
        half = 0.5 * size
        share = (1.0 - half / np.tan(half)) / size**2 if size > 1e-4 else 1.0 / 12.0
        bent = np.eye(3) - 0.5 * cross.T + share * cross @ cross
        if self._task.target is None:
            return needed @ turn, -slopes
        return turn, -np.tensordot(bent, slopes, axes=1)

    def _cost(self, control: Array, duration: float) -> tuple[float, Array]:
        """The cost and its derivative by the control points (size, m)."""
        task, slopes = self._task, self._slopes
        bend = slopes @ control
        if self._density is None:
            power = 3 if task.cost == "acceleration" else 1
            turned = bend @ task.ties.T @ task.ties
            value = 0.5 * float(self._weights @ np.sum(turned * bend, axis=1)) / duration**power
            return value, slopes.T @ (self._weights[:, None] * turned) / duration**power
        density, by_shape, by_slope = (np.array(part) for part in self._density((self._values @ control).T, bend.T))
        change = self._values.T @ (self._weights[:, None] * by_shape.T)
        change += slopes.T @ (self._weights[:, None] * by_slope.T)
        return float(density.ravel() @ self._weights) / duration, change / duration

    def _within_rates(self, guess: Array, free: Mask, unit: Array, duration: float) -> dict[str, Any]:
        """The limits of rates as inequalities that are linear in the scaled unknowns."""
        basis, rates = self._basis, self._task.rates
        limited = np.flatnonzero(np.isfinite(rates))
        every = np.kron(basis.rate_control, np.eye(len(rates))[limited])
        pace = np.tile(rates[limited] * duration, basis.size - 1)
        rows = every[:, free.ravel()] * unit
        fixed = every @ np.where(free, 0.0, guess).ravel()
        both, room = np.concatenate([-rows, rows]), np.concatenate([pace - fixed, pace + fixed])
        return {"type": "ineq", "fun": lambda x: both @ x + room, "jac": lambda _: both}


def _density_gradient(task: Reorientation, count: int) -> Any:
    """Half the kinetic metric at (r, u), and its derivatives by r and u, at `count` nodes at once."""
    import casadi

    r, u = casadi.SX.sym("r", task.size), casadi.SX.sym("u", task.size)
    ties = casadi.DM(task.ties)
    slope = ties @ u
    density = 0.5 * casadi.dot(slope, symbolic_body(task.body).shape_metric(ties @ r + casadi.DM(task.offset)) @ slope)
    parts = [density, casadi.gradient(density, r), casadi.gradient(density, u)]
    return casadi.Function("density", [r, u], [casadi.densify(part) for part in parts], {"cse": True}).map(count)
