"""A turn by Crocoddyl, for the Python that has it: the problem as JSON on the standard input, the answer on the output.

Joints accelerate evenly between nodes, a free-flyer without gravity follows as its dynamics have it, by Runge-Kutta
steps of fourth order. The cost is the whole kinetic energy, without momentum that of the joints' motion. Limits and
ends are penalties of squares whose weights are raised a hundredfold, three times, each search going on from the one
before.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import crocoddyl
import numpy as np
import pinocchio as pin

RAISED = (1.0, 1e2, 1e4, 1e6)
"""Weights of the penalties, as shares of the guess's mean energy."""
AT_ONCE = 5
"""Iterations between looks at the clock."""
ENOUGH = 400
"""Iterations with each weight."""
SETTLED = 1e-5
"""Of the cost in so many iterations: then the weight is raised."""
TINY = 1e-7
"""Of the accelerations' squares, as a share of the guess's mean energy: without it the last of them are free."""


class FreeBody(crocoddyl.DifferentialActionModelAbstract):
    """A free-flyer whose joints accelerate as they are told; the base follows, as nothing pushes it.

    Momentum that the steps' errors make, and that a search would live on, is taken away within `memory` [s].
    """

    def __init__(self, state: Any, costs: Any, memory: float) -> None:
        crocoddyl.DifferentialActionModelAbstract.__init__(self, state, state.nv - 6, costs.nr)
        self._model, self._costs = state.pinocchio, costs
        self._data = self._model.createData()
        self._shared = crocoddyl.DataCollectorMultibody(self._data)
        self._still, self._memory = np.zeros(self._model.nv), memory

    def createData(self) -> Any:
        """With the costs' own."""
        data = crocoddyl.DifferentialActionModelAbstract.createData(self)
        data.costs = self._costs.createData(self._shared)
        data.costs.shareMemory(data)
        return data

    def calc(self, data: Any, x: np.ndarray, u: np.ndarray | None = None) -> None:
        """Accelerations, the base's first: M_bb a_b = -(M_bj u + bias_b + (M v)_b / memory); and the cost's density."""
        u = self._still[6:] if u is None else u
        q, v = x[: self._model.nq], x[self._model.nq :]
        mass = pin.crba(self._model, self._data, q)[:6]
        mass = np.hstack([np.triu(mass[:, :6]) + np.triu(mass[:, :6], 1).T, mass[:, 6:]])
        bias = pin.nonLinearEffects(self._model, self._data, q, v)[:6]
        pushed = mass[:, 6:] @ u + bias + mass @ v / self._memory
        data.xout = np.concatenate([-np.linalg.solve(mass[:, :6], pushed), u])
        self._costs.calc(data.costs, x, u)
        data.cost = data.costs.cost + pin.computeKineticEnergy(self._model, self._data, q, v)

    def calcDiff(self, data: Any, x: np.ndarray, u: np.ndarray | None = None) -> None:
        """By inverse dynamics; M v = rnea(q, 0, v), so that half of v' d(M v)/dq is the energy's gradient."""
        u = self._still[6:] if u is None else u
        q, v, n = x[: self._model.nq], x[self._model.nq :], self._model.nv
        by_q, by_v, mass = (
            part.copy() for part in pin.computeRNEADerivatives(self._model, self._data, q, v, data.xout)
        )
        mass = np.triu(mass) + np.triu(mass, 1).T
        carried = pin.computeRNEADerivatives(self._model, self._data, q, self._still, v)[0].copy()
        pushed = by_q + carried / self._memory, by_v + mass / self._memory, mass[:, 6:]
        follows = -np.linalg.solve(mass[:6, :6], np.hstack(pushed)[:6])
        data.Fx = np.vstack([follows[:, : 2 * n], np.zeros((n - 6, 2 * n))])
        data.Fu = np.vstack([follows[:, 2 * n :], np.eye(n - 6)])
        self._costs.calcDiff(data.costs, x, u)
        data.Lx = data.costs.Lx + np.concatenate([0.5 * v @ carried, mass @ v])
        hessian = data.costs.Lxx.copy()
        hessian[n:, n:] += mass
        data.Lxx = hessian
        data.Lu, data.Luu, data.Lxu = data.costs.Lu, data.costs.Luu, data.costs.Lxu


def solved(asked: dict[str, Any]) -> dict[str, Any]:
    """The nodes that were found, and what became of the search."""
    begin = time.process_time()
    model = pin.buildModelFromXML(asked["urdf"], pin.JointModelFreeFlyer())
    model.gravity.setZero()
    columns = np.array([model.joints[model.getJointId(name)].idx_v - 6 for name in asked["joints"]])
    step = asked["duration"] / asked["nodes"]
    state = crocoddyl.StateMultibody(model)
    xs, us = _guess(model, columns, *(np.array(asked[key]) for key in ("shapes", "rates", "accelerations")), step)
    first, data = xs[0], model.createData()
    energy = np.mean([pin.computeKineticEnergy(model, data, x[: model.nq], x[model.nq :]) for x in xs])
    goal = first.copy()
    goal[3:7] = asked["goal"]
    room = np.full((2, state.ndx), np.inf) * np.array([[-1.0], [1.0]])
    room[:, 6 + columns] = np.array(asked["limits"]).T - first[7 + columns]
    room[:, model.nv + 6 + columns] = np.outer([-1.0, 1.0], asked["rate_limits"])
    spent, late, done = 0, False, False
    for weight in RAISED:
        problem = _problem(state, first, goal, room, len(us), step, energy, weight)
        solver, last = crocoddyl.SolverFDDP(problem), np.inf
        for _ in range(ENOUGH // AT_ONCE):
            done = solver.solve(xs, us, AT_ONCE, False)
            xs, us, spent = list(solver.xs), list(solver.us), spent + solver.iter + 1
            late = time.process_time() - begin > asked["seconds"]
            if done or late or abs(last - solver.cost) < SETTLED * abs(solver.cost):
                break
            last = solver.cost
        if late:
            break
    end = "stopped" if late else "converged" if done else "settled"
    return {
        "shapes": [x[7 + columns].tolist() for x in xs],
        "rates": [x[model.nq + 6 + columns].tolist() for x in xs],
        "accelerations": [u[columns].tolist() for u in us],
        "said": f"FDDP: {end}, {spent} iterations",
        "seconds": time.process_time() - begin,
    }


def _guess(
    model: Any, columns: np.ndarray, shapes: np.ndarray, rates: np.ndarray, accelerations: np.ndarray, step: float
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """States of the joints' guess, the base as momentum has it, and accelerations."""
    data, q, xs, us = model.createData(), pin.neutral(model), [], []
    for shape, rate, acceleration in zip(shapes, rates, accelerations):
        v, u = np.zeros(model.nv), np.zeros(model.nv - 6)
        q[7 + columns], v[6 + columns], u[columns] = shape, rate, acceleration
        mass = pin.crba(model, data, q)[:6]
        mass[:, :6] = np.triu(mass[:, :6]) + np.triu(mass[:, :6], 1).T
        v[:6] = -np.linalg.solve(mass[:, :6], mass[:, 6:] @ v[6:])
        xs.append(np.concatenate([q, v]))
        us.append(u)
        q = pin.integrate(model, q, step * v)
    return xs, us[:-1]


def _problem(
    state: Any,
    first: np.ndarray,
    goal: np.ndarray,
    room: np.ndarray,
    nodes: int,
    step: float,
    energy: float,
    weight: float,
) -> Any:
    """The energy's integral within limits, to the goal at rest; both as penalties with this weight."""
    n = state.nv
    running, ends = crocoddyl.CostModelSum(state, n - 6), crocoddyl.CostModelSum(state, n - 6)
    within = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(*room))
    from_first = crocoddyl.ResidualModelState(state, first, n - 6)
    running.addCost("limits", crocoddyl.CostModelResidual(state, within, from_first), weight * energy)
    told = crocoddyl.ResidualModelControl(state, n - 6)
    running.addCost("controls", crocoddyl.CostModelResidual(state, told), TINY * energy)
    duration = nodes * step
    counted = np.concatenate([np.zeros(3), np.ones(n - 3), np.zeros(6), np.full(n - 6, duration**2)])
    off = crocoddyl.ResidualModelState(state, goal, n - 6)
    squares = crocoddyl.ActivationModelWeightedQuad(counted)
    ends.addCost("ends", crocoddyl.CostModelResidual(state, squares, off), duration * weight * energy)
    between = crocoddyl.IntegratedActionModelRK(FreeBody(state, running, step), crocoddyl.RKType.four, step)
    last = crocoddyl.IntegratedActionModelEuler(FreeBody(state, ends, step), 0.0)
    return crocoddyl.ShootingProblem(first, [between] * nodes, last)


if __name__ == "__main__":
    json.dump(solved(json.load(sys.stdin)), sys.stdout)
