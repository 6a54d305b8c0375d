"""A turn by Drake: Hermite-Simpson collocation of attitude, joints and rates as a mathematical program.

Joints are cubics between nodes, a quaternion obeys its equation at nodes and half way; there the angular momentum is
zero as Drake's own constraint says, and there the kinetic energy is weighed as Simpson's rule has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.multibody.optimization import CentroidalMomentumConstraint
from pydrake.solvers import IpoptSolver, MathematicalProgram, SolverOptions

import shapephase as sp
from shapephase import so3

from ..simulators import drake_plant
from .rest_to_rest import Turn, hermite, joints_of


def collocated(turn: Turn) -> tuple[sp.ShapePath, str]:
    """The path, and what the solver said."""
    body, n, nodes, step = turn.body, turn.body.n_shape, turn.nodes, turn.step
    plant = drake_plant(body)[0].ToAutoDiffXd()
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    joints = [plant.GetJointByName(name) for name in joints_of(body)]
    position = np.array([joint.position_start() for joint in joints])
    velocity = np.array([joint.velocity_start() for joint in joints])
    program = MathematicalProgram()
    # At nodes and half way between: even and odd.
    s, r = (program.NewContinuousVariables(2 * nodes + 1, n, name) for name in "sr")
    w = program.NewContinuousVariables(2 * nodes + 1, 3, "w")
    p = program.NewContinuousVariables(nodes + 1, 4, "p")
    base, still = program.NewContinuousVariables(7, "base"), program.NewContinuousVariables(6, "still")
    program.AddBoundingBoxConstraint(np.eye(7)[0], np.eye(7)[0], base)
    program.AddBoundingBoxConstraint(0.0, 0.0, still)
    lower, upper = body.joint_limits.T
    begin = body.shape()
    context = plant.CreateDefaultContext()
    momentum = CentroidalMomentumConstraint(plant, None, context, True)
    energy = _Energy(plant)
    for row in range(2 * nodes + 1):
        q, v = np.empty(plant.num_positions(), dtype=object), np.empty(plant.num_velocities(), dtype=object)
        q[:7], q[position], v[:3], v[3:6], v[velocity] = base, s[row], w[row], still[:3], r[row]
        program.AddConstraint(momentum, np.concatenate([q, v, still[3:]]))
        weight = step / 6.0 * (4.0 if row % 2 else 1.0 if row in (0, 2 * nodes) else 2.0)
        program.AddCost(_weighed(energy, weight), vars=np.concatenate([q, v]))
        program.AddBoundingBoxConstraint(lower, upper, s[row])
        program.AddBoundingBoxConstraint(-turn.rates, turn.rates, r[row])
    for k in range(0, 2 * nodes, 2):
        _add_linear(program, s[k + 1] - 0.5 * (s[k] + s[k + 2]) - step / 8.0 * (r[k] - r[k + 2]))
        _add_linear(program, r[k + 1] - 1.5 / step * (s[k + 2] - s[k]) + 0.25 * (r[k] + r[k + 2]))
        parts = [p[k // 2], w[k], w[k + 1], p[k // 2 + 1], w[k + 2]]
        program.AddConstraint(_attitude_gap(step), np.zeros(4), np.zeros(4), vars=np.concatenate(parts))
    for row in (0, 2 * nodes):
        program.AddBoundingBoxConstraint(begin, begin, s[row])
        program.AddBoundingBoxConstraint(0.0, 0.0, r[row])
    program.AddBoundingBoxConstraint(np.eye(4)[0], np.eye(4)[0], p[0])
    x, y, z, c = so3.quat_from_matrix(turn.goal)
    away = np.array([[-x, c, z, -y], [-y, -z, c, x], [-z, y, -x, c]])
    program.AddLinearEqualityConstraint(away, np.zeros(3), p[-1])
    shapes, rates, _ = turn.first_guess(np.linspace(0.0, 1.0, 2 * nodes + 1))
    program.SetInitialGuess(s, shapes)
    program.SetInitialGuess(r, rates)
    program.SetInitialGuess(w, np.zeros(w.shape))
    program.SetInitialGuess(p, np.tile(np.eye(4)[0], (nodes + 1, 1)))
    program.SetInitialGuess(base, np.eye(7)[0])
    program.SetInitialGuess(still, np.zeros(6))
    options = SolverOptions()
    for key, value in {"max_cpu_time": turn.seconds, "max_iter": 3000, "sb": "yes"}.items():
        options.SetOption(IpoptSolver.id(), key, value)
    found = IpoptSolver().Solve(program, None, options)
    pieces = hermite(found.GetSolution(s[::2]), found.GetSolution(r[::2]), step)
    return turn.path(pieces), f"IPOPT: {found.get_solution_result().name}"


class _Energy:
    """Kinetic energy of q and v beside that of the centre of mass."""

    def __init__(self, plant: Any) -> None:
        self._plant, self._context = plant, plant.CreateDefaultContext()
        self._mass = plant.CalcTotalMass(self._context)

    def __call__(self, qv: np.ndarray) -> Any:
        self._plant.SetPositionsAndVelocities(self._context, qv)
        drift = self._plant.CalcCenterOfMassTranslationalVelocityInWorld(self._context)
        return self._plant.CalcKineticEnergy(self._context) - 0.5 * self._mass * drift.dot(drift)


def _weighed(energy: _Energy, weight: float) -> Any:
    return lambda qv: weight * energy(qv)


def _attitude_gap(step: float) -> Any:
    """Of the quaternion p' = p (0, w) / 2 with w in the base's axes, by Simpson's rule."""

    def gap(parts: np.ndarray) -> np.ndarray:
        p, w, w_half, p_next, w_next = np.split(parts, [4, 7, 10, 14])
        slope, slope_next = _turning(p, w), _turning(p_next, w_next)
        p_half = 0.5 * (p + p_next) + step / 8.0 * (slope - slope_next)
        return p_next - p - step / 6.0 * (slope + 4.0 * _turning(p_half, w_half) + slope_next)

    return gap


def _turning(p: np.ndarray, w: np.ndarray) -> np.ndarray:
    c, x, y, z = p
    a, b, d = w
    return 0.5 * np.array([-x * a - y * b - z * d, c * a + y * d - z * b, c * b + z * a - x * d, c * d + x * b - y * a])


def _add_linear(program: MathematicalProgram, rows: np.ndarray) -> None:
    for row in rows:
        program.AddLinearEqualityConstraint(row == 0.0)
