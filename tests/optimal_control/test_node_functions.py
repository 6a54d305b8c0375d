"""A node's derivatives, put together link by link, against CasADi's own of the body's expressions."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import Limits, symbolic_body
from shapephase.optimal_control.nodes.node_functions import node_functions
from shapephase.optimal_control.symbolic import solve_linear
from shapephase.optimal_control.task import Reorientation, reorientation
from support.ball_bodies import BALLS
from support.coupled_bodies import LEG, TURN, couplings

EPS = np.finfo(float).eps
MU = (0.3, -0.2, 0.5)
# Coordinates that two joints share, and one that is held.
SHARED = {"symmetric": {"waist_yaw": ("waist_pitch", -0.5)}, "joints": ["waist_pitch", "waist_yaw"]}
CASES = {
    "kinetic": ("cat_two_halves", "kinetic", 0.0, {}),
    "with momentum": ("cat_two_halves", "kinetic", MU, {}),
    "symmetric": ("cat_two_halves", "rate", MU, SHARED),
    "time": ("diver", "time", MU, {}),
    "acceleration": ("diver", "acceleration", 0.0, {}),
    "branches": ("satellite", "kinetic", MU, {}),
    "rate": ("satellite", "rate", 0.0, {}),
    "curves": ("leg", "kinetic", MU, {}),
    "curves and rate": ("leg", "rate", 0.0, {}),
    "ball joints": ("balls", "kinetic", MU, {}),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Bodies that are no robots: with joints that follow others, and with ball joints."""
    paths = {name: tmp_path_factory.mktemp(name) / f"{name}.urdf" for name in ("leg", "balls")}
    for name, text in (("leg", LEG), ("balls", BALLS)):
        paths[name].write_text(text)
    leg = sp.load_body(paths["leg"]).with_couplings(couplings(next(iter(TURN.values()))[0]))
    return {"leg": leg, "balls": sp.load_body(paths["balls"])}


def differentiated(task: Reorientation):
    """dq/ds, density, and the derivatives that a node's functions promise, by CasADi alone."""
    m, body, coupling = task.dimension, symbolic_body(task.body), casadi.DM(task.coupling)
    y = casadi.SX.sym("y", 2 * m + 5)
    r, u, q, duration = y[:m], y[m : 2 * m], y[2 * m : 2 * m + 4], y[-1]
    joints = coupling @ r + casadi.DM(task.offset)
    turn = -body.connection(joints) @ coupling @ u
    vector, scalar = q[:3], q[3]
    mu = casadi.DM(task.momentum)
    seen = mu - 2.0 * scalar * casadi.cross(vector, mu) + 2.0 * casadi.cross(vector, casadi.cross(vector, mu))
    turn = turn + duration * solve_linear(body.inertia(joints), seen)
    turning = 0.5 * casadi.vertcat(scalar * turn + casadi.cross(vector, turn), -casadi.dot(vector, turn))
    none = casadi.SX(m, m)
    metrics = {"kinetic": body.shape_metric(joints), "rate": casadi.SX.eye(task.body.n_shape)}
    form = coupling.T @ metrics[task.cost] @ coupling if task.cost in metrics else none
    density = 0.5 * casadi.dot(u, form @ u) / duration
    multipliers, factor = casadi.SX.sym("multipliers", 4), casadi.SX.sym("factor")
    second, _ = casadi.hessian(casadi.dot(multipliers, turning) + factor * density, y)
    return casadi.Function("plain", [y, multipliers, factor], [turning, density, casadi.jacobian(turning, y), second])


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_those_of_the_whole_expression(case: str, made, rng):
    """Bodies with turning, sliding and following joints, at random shapes and rates."""
    name, cost, momentum, options = CASES[case]
    body = made[name] if name in made else sp.load_body(name)
    limits = Limits(joint_limits=False, rate_limits=1.0)
    task = reorientation(
        body, so3.exp(np.array([0.5, 0.0, 0.0])), momentum=momentum, cost=cost, limits=limits, **options
    )
    m, node, plain = task.dimension, node_functions(task), differentiated(task)
    for _ in range(4):
        q = so3.quat_from_rotation_vector(rng.normal(size=3))
        y = np.concatenate([rng.uniform(-0.9, 0.9, m), rng.normal(size=m), q, [1.3]])
        multipliers, factor = rng.normal(size=4), 0.7
        expected = [np.array(part) for part in plain(y, multipliers, factor)]
        found = [np.array(part) for part in (*node.values(y), node.jacobian(y), node.hessian(y, multipliers, factor))]
        condition = np.linalg.cond(body.locked_inertia(task.shapes(y[:m])))
        for seen, value in zip(found, expected, strict=True):
            # Each is a sum of some hundred terms, as large as what is left or, by the condition, larger.
            limit = 200.0 * condition * EPS * max(np.abs(value).max(), 1.0)
            np.testing.assert_allclose(seen, value, rtol=0, atol=limit)


def test_work_grows_with_the_joints_and_not_with_their_square():
    """Operations of a node's expressions for each joint, from ten joints to 27."""
    counts = []
    for name in ("satellite", "cat", "astronaut"):
        body = sp.load_body(name)
        task = reorientation(body, np.eye(3), limits=Limits(rate_limits=1.0))
        mechanics = _functions_of(node_functions(task).hessian)
        counts.append(max(function.n_instructions() for function in mechanics) / len(body.chain.parents))
    assert max(counts) < 1.5 * min(counts)


def _functions_of(function):
    """All expressions of scalars that a function calls."""
    inner = [
        function.instruction_MX(k).which_function() for k in range(function.n_instructions()) if _calls(function, k)
    ]
    return [part for one in inner for part in ([one] if one.is_a("SXFunction") else _functions_of(one))]


def _calls(function, instruction):
    return function.instruction_id(instruction) == casadi.OP_CALL
