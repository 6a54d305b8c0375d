"""Turning rate and cost density at a collocation node with their derivatives; and the layout of the unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...arrays import Array
from ...body.body import Body
from ...body.particles.casadi_positions import symbol_kind
from ...body.particles.point_masses import ParticleBody
from .._spline_basis import SplineBasis
from ..symbolic import joint_coordinates, quaternion_rate, solve_linear, turned_back
from ..task import Reorientation
from .node_mechanics import SIZE, node_mechanics


@dataclass(frozen=True, eq=False)
class NodeFunctions:
    """CasADi functions of a node's y = (r, u, q, T): shape, its derivative by place, quaternion, duration.

    values : y -> dq/ds (4,) and the density of the cost
    jacobian : y -> derivative of dq/ds by y, (4, 2 m + 5)
    hessian : y, multipliers of dq/ds (4,), factor of the density -> second derivatives of the weighted sum
    """

    values: Any
    jacobian: Any
    hessian: Any


_built: WeakKeyDictionary[Body | ParticleBody, dict[tuple[object, ...], NodeFunctions]] = WeakKeyDictionary()


def node_functions(task: Reorientation) -> NodeFunctions:
    """Return the functions of a task, kept as long as its body."""
    kept = _built.setdefault(task.body, {})
    key = (
        task.cost,
        task.metric and task.metric.key,
        task.coupling.shape,
        task.coupling.tobytes(),
        task.offset.tobytes(),
        task.momentum.tobytes(),
    )
    if key not in kept:
        kept[key] = _node_functions(task)
    return kept[key]


def _node_functions(task: Reorientation) -> NodeFunctions:
    """Chain rule over three stages: coordinates and rates of joints, sixteen mechanical numbers, the turning."""
    import casadi

    m = task.dimension
    (mechanics, second_of_mechanics), ends = node_mechanics(task.body), _ends(task)
    joints, second_of_joints = _joints(task)
    y = casadi.MX.sym("y", 2 * m + 5)
    place, rate, onward, back = joints(y[: 2 * m])
    shape = casadi.DM(task.coupling) @ y[:m] + casadi.DM(task.offset)
    numbers, by_place, by_rate = mechanics(place, rate, shape)
    price = _price(task)
    effort, at_rate, square = price(y[: 2 * m])
    inputs = casadi.vertcat(numbers, effort, y[2 * m :])
    turning, density = ends.values(inputs)
    # `onward`: derivatives of the joints by the shape; `back`: of their rates by the shape, zero where all joints that
    # follow others do so linearly.
    slopes = casadi.horzcat(by_place @ onward + by_rate @ back, by_rate @ onward)
    through = casadi.diagcat(casadi.vertcat(slopes, at_rate), casadi.MX.eye(5))
    jacobian = casadi.densify(ends.jacobian(inputs) @ through)
    multipliers, factor = casadi.MX.sym("multipliers", 4), casadi.MX.sym("factor")
    gradient, bend = ends.hessian(inputs, multipliers, factor)
    places, mixed, rates = second_of_mechanics(place, rate, shape, gradient[:SIZE])
    # Second derivatives by joints' coordinates and rates, chained to shape and its rate.
    lower = mixed @ onward + rates @ back
    corner = onward.T @ (places @ onward + mixed.T @ back) + back.T @ lower
    beside = onward.T @ lower
    block = casadi.vertcat(casadi.horzcat(corner, beside.T), casadi.horzcat(beside, onward.T @ rates @ onward))
    block = block + gradient[SIZE] * square
    if second_of_joints is not None:
        block = block + second_of_joints(y[: 2 * m], by_place.T @ gradient[:SIZE], by_rate.T @ gradient[:SIZE])
    hessian = through.T @ bend @ through + casadi.diagcat(block, casadi.MX(5, 5))
    return NodeFunctions(
        values=casadi.Function("node", [y], [turning, density]),
        jacobian=casadi.Function("node_jacobian", [y], [jacobian]),
        hessian=casadi.Function("node_hessian", [y, multipliers, factor], [casadi.densify(hessian)]),
    )


def _price(task: Reorientation) -> Any:
    """Function of shape and its rate (2 m,): 1/2 r' g r' of a given metric, its slopes and second derivatives."""
    import casadi

    m, metric = task.dimension, None if task.metric is None or task.cost == "kinetic" else task.metric.metric
    kind = casadi.SX if metric is None else symbol_kind(metric)
    both = kind.sym("both", 2 * m)
    rate, value = kind(casadi.DM(task.coupling)) @ both[m:], kind(1, 1)
    if metric is not None:
        value = 0.5 * rate.T @ metric(kind(casadi.DM(task.coupling)) @ both[:m] + casadi.DM(task.offset)) @ rate
    square, slopes = casadi.hessian(value, both)
    return casadi.Function("price", [both], [casadi.densify(value), slopes.T, square])


def _joints(task: Reorientation) -> tuple[Any, Any]:
    """Coordinates and rates of all joints from the shape and its rate, (2 m,).

    Returns
    -------
    values : (2 m,) -> coordinates (k,), rates (k,), derivatives of the first by the shape, of the second by the shape
    bend : (2 m,), factors of coordinates (k,) and of rates (k,) -> second derivatives (2 m, 2 m) of the weighted sum;
        None: they are zero
    """
    import casadi

    m, follows = task.dimension, task.body.follows
    both = casadi.SX.sym("both", 2 * m)
    coordinates, rate = both[:m], both[m:]
    shape = casadi.DM(task.coupling) @ coordinates + casadi.DM(task.offset)
    # Ball joints are three hinges counted from this very shape, which their derivatives are taken at.
    about = casadi.SX.sym("about", shape.shape[0])
    place = joint_coordinates(follows, shape, about)
    onward = casadi.jacobian(place, coordinates)
    rates = onward @ rate
    back = casadi.jacobian(rates, coordinates)
    parts = [casadi.substitute(part, about, shape) for part in (place, rates, onward, back)]
    values = casadi.Function("joints", [both], [casadi.densify(parts[0]), casadi.densify(parts[1]), *parts[2:]])
    if follows.is_linear:
        return values, None
    of_place, of_rate = (casadi.SX.sym(name, len(follows.names)) for name in ("of_place", "of_rate"))
    bend, _ = casadi.hessian(casadi.dot(of_place, place) + casadi.dot(of_rate, rates), both)
    bend = casadi.substitute(bend, about, shape)
    return values, casadi.Function("joints_bend", [both, of_place, of_rate], [bend])


def _ends(task: Reorientation) -> NodeFunctions:
    """Functions of the sixteen numbers, half the squared rate, quaternion and duration, (22,), instead of y.

    `hessian` returns the gradient of the weighted sum, (22,), before the second derivatives.
    """
    import casadi

    inputs, mass = casadi.SX.sym("inputs", SIZE + 6), task.body.mass
    moment, entries, angular, linear = inputs[:3], inputs[3:9], inputs[9:12], inputs[12:15]
    energy, effort, q, duration = inputs[15], inputs[16], inputs[17:21], inputs[21]
    about_origin = casadi.vertcat(
        casadi.horzcat(entries[0], entries[1], entries[2]),
        casadi.horzcat(entries[1], entries[3], entries[4]),
        casadi.horzcat(entries[2], entries[4], entries[5]),
    )
    inertia = about_origin - (casadi.dot(moment, moment) * casadi.SX.eye(3) - moment @ moment.T) / mass
    momentum = angular - casadi.cross(moment, linear) / mass
    solution = solve_linear(inertia, momentum)
    turn = -solution
    if np.any(task.momentum):
        turn = turn + duration * solve_linear(inertia, turned_back(q, casadi.DM(task.momentum)))
    turning = quaternion_rate(q, turn)
    density = casadi.SX(1, 1)
    if task.cost == "kinetic":
        density = 0.5 * (energy - casadi.dot(linear, linear) / mass - casadi.dot(momentum, solution)) / duration
    elif task.metric is not None:
        density = effort / duration
    density = casadi.densify(density)
    multipliers, factor = casadi.SX.sym("multipliers", 4), casadi.SX.sym("factor")
    weighted = casadi.dot(multipliers, turning) + factor * density
    bend, gradient = casadi.hessian(weighted, inputs)
    slopes = casadi.densify(casadi.jacobian(turning, inputs))
    options = {"cse": True}
    return NodeFunctions(
        values=casadi.Function("ends", [inputs], [turning, density], options),
        jacobian=casadi.Function("ends_jacobian", [inputs], [slopes], options),
        hessian=casadi.Function(
            "ends_hessian", [inputs, multipliers, factor], [casadi.densify(gradient), casadi.densify(bend)], options
        ),
    )


def node_arguments(task: Reorientation, basis: SplineBasis, places: Array, order: int, unknowns: int) -> Any:
    """Matrix W of y = (r, dr/ds, ..., q, T) at each place from the unknowns.

    The unknowns are x = (control points, T, q at nodes, q at the ends of pieces).

    places : (N,), whose attitudes are the first N unknown ones
    order : order of the last derivative
    """
    sparse = scipy_sparse()
    m, count = task.dimension, len(places)
    shapes = sparse.vstack([sparse.kron(basis.matrix(places, k), sparse.eye(m)) for k in range(order + 1)])
    whole = sparse.block_diag([shapes, np.ones((count, 1)), sparse.eye(4 * count)]).tocsr()
    width, passed = (order + 1) * m, (order + 1) * m * count
    rows = np.concatenate(
        [
            np.arange(passed).reshape(order + 1, count, m).transpose(1, 0, 2).reshape(count, width),
            passed + count + np.arange(4 * count).reshape(count, 4),
            passed + np.arange(count)[:, None],
        ],
        axis=1,
    )
    rest = sparse.csr_matrix((whole.shape[0], unknowns - whole.shape[1]))
    return sparse_matrix(sparse.hstack([whole, rest]).tocsr()[rows.ravel()])


def scipy_sparse() -> Any:
    """SciPy's module of sparse matrices: imported late, and without types."""
    from scipy import sparse

    return sparse


def sparse_matrix(matrix: Any) -> Any:
    """Return a constant sparse matrix of CasADi."""
    import casadi

    return casadi.DM(scipy_sparse().csc_matrix(matrix))
