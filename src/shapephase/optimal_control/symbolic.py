"""Mechanics of a body as CasADi functions of its shape, for derivatives and larger expressions."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from threading import Lock
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..arguments import check_choice
from ..arrays import Array
from ..body.body import Body
from ..body.couplings.coordinate_map import CoordinateMap
from ..body.couplings.functions import JointFunction
from ..body.joint_chain import JointChain
from ..body.loading import as_body_or_particles
from ..body.particles.casadi_positions import symbol_kind
from ..body.particles.point_masses import ParticleBody
from ..display import short_repr
from ..errors import unknown_name

QUANTITIES = ("inertia", "momentum_matrix", "connection", "centre_of_mass", "shape_metric")

_built: WeakKeyDictionary[Body | ParticleBody, SymbolicBody] = WeakKeyDictionary()
_building = Lock()


@dataclass(frozen=True, eq=False)
class SymbolicBody:
    """Functions of a body's shape r (n,), each a `casadi.Function` of r alone. Made by `symbolic_body`.

    Called with symbols of CasADi's kind SX a function gives its expression, with MX one call in the larger graph, with
    numbers a DM. All are in base axes. Can be pickled, and each function has CasADi's own `serialize`. For numbers of
    many shapes at once the methods of `Body` are faster.

    Source: Cabrera 2006, section 2.3 and equation (4); theory.md A3, A6, A7.

    Attributes
    ----------
    name : name of the body
    joint_names : names in the order of r
    inertia : I(r), (3, 3) about the centre of mass [kg m^2]
    momentum_matrix : J(r), (3, n): the internal momentum is J rate
    connection : A(r) = I^-1 J, (3, n): with zero momentum the base turns at -A rate
    centre_of_mass : (3,) from the base origin [m]
    shape_metric : g(r), (n, n): 1/2 rate g rate is the kinetic energy, about the centre of mass, of a motion with zero
        angular momentum. It is M_ss - M_sb M_bb^-1 M_bs of the mass matrix M with base b and joints s, and twice the
        form T_0 - 1/2 L_o I^-1 L_o
    chain : its tree of links; None: particles
    maps : inertia, momentum_matrix, mass matrix and centre of mass of particles in one call; None: links
    """

    name: str
    joint_names: tuple[str, ...]
    inertia: Any
    momentum_matrix: Any
    connection: Any
    centre_of_mass: Any
    shape_metric: Any
    chain: JointChain | None = field(repr=False)
    maps: Any = None
    _made: dict[str, Any] = field(default_factory=dict, repr=False)

    __repr__ = short_repr

    @property
    def n_shape(self) -> int:
        """Number of independent joints."""
        return len(self.joint_names)

    def derivative(self, quantity: str) -> Any:
        """Return the derivative of one of the five quantities by r, as a function of r, built at the first call.

        Returns
        -------
        casadi.Function, r -> (entries, n): row a + rows b holds the gradient of entry [a, b] (columns one after the
            other, as CasADi stores matrices)

        Raises
        ------
        UnknownNameError
            For an unknown quantity.
        """
        import casadi

        check_choice(quantity, "quantity", QUANTITIES)
        key = f"{quantity}_derivative"
        if key not in self._made:
            shape = symbol_kind(self.inertia).sym("shape", self.n_shape)
            rows = casadi.jacobian(casadi.vec(getattr(self, quantity)(shape)), shape)
            self._made[key] = casadi.Function(key, [shape], [casadi.densify(rows)], ["shape"], [key])
        return self._made[key]

    def link_pose(self, link: str) -> Any:
        """Return the pose of a link in base axes from the base origin, as a function of r: r -> (4, 4).

        Raises
        ------
        UnknownNameError
            For an unknown link.
        """
        import casadi

        if self.chain is None or link not in self.chain.link_frames:
            raise unknown_name(f"link of {self.name}", link, () if self.chain is None else self.chain.link_frames)
        key = f"link_{tuple(self.chain.link_frames).index(link)}"
        if key not in self._made:
            shape = casadi.SX.sym("shape", self.n_shape)
            frame, pose = self.chain.link_frames[link]
            turn, place = joint_frames(self.chain, joint_coordinates(self.chain.follows, shape), shape)[frame]
            last = casadi.SX([[0.0, 0.0, 0.0, 1.0]])
            upper = casadi.horzcat(turn @ constant(pose[:3, :3]), place + turn @ constant(pose[:3, 3]))
            self._made[key] = casadi.Function(key, [shape], [casadi.densify(casadi.vertcat(upper, last))])
        return self._made[key]


def symbolic_body(body: Body | ParticleBody | str) -> SymbolicBody:
    """Return the functions of a body; built at its first call, kept as long as the body.

    Source: the composite rigid body algorithm (Featherstone, Rigid Body Dynamics Algorithms, section 6.2), reduced by
    the momentum of the base.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> functions = sp.optimal_control.symbolic_body(cat)
    >>> print(np.array(functions.inertia(np.zeros(3))).diagonal().round(6))
    [0.005 0.02  0.02 ]
    """
    body = as_body_or_particles(body)
    with _building:
        if body not in _built:
            _built[body] = _symbolic(body) if isinstance(body, Body) else _of_particles(body)
        return _built[body]


def solve_linear(matrix: Any, right: Any) -> Any:
    """Solution of matrix x = right in symbols, for a symmetric positive definite matrix: (m, m), (m, k) -> (m, k).

    By the factors L D L^T, entry by entry: backward stable, which the adjugate of a thin body's inertia is not.
    """
    import casadi

    dimension = matrix.shape[0]
    lower, pivots = np.empty((dimension, dimension), dtype=object), []
    for column in range(dimension):
        known = sum(lower[column, k] ** 2 * pivots[k] for k in range(column))
        pivots.append(matrix[column, column] - known)
        for row in range(column + 1, dimension):
            known = sum(lower[row, k] * lower[column, k] * pivots[k] for k in range(column))
            lower[row, column] = (matrix[row, column] - known) / pivots[column]
    rows: list[Any] = []
    for row in range(dimension):
        rows.append(right[row, :] - sum(lower[row, k] * rows[k] for k in range(row)))
    rows = [row / pivot for row, pivot in zip(rows, pivots, strict=True)]
    for row in reversed(range(dimension)):
        rows[row] = rows[row] - sum(lower[k, row] * rows[k] for k in range(row + 1, dimension))
    return casadi.vertcat(*rows)


def quaternion_rate(quaternion: Any, omega: Any) -> Any:
    """Rate of an attitude's quaternion xyzw at an angular velocity in base axes."""
    import casadi

    vector, scalar = quaternion[:3], quaternion[3]
    return 0.5 * casadi.vertcat(scalar * omega + casadi.cross(vector, omega), -casadi.dot(vector, omega))


def turned_back(quaternion: Any, vector: Any) -> Any:
    """Inertial vector in base axes, R^T vector, for a unit quaternion."""
    import casadi

    axis, scalar = quaternion[:3], quaternion[3]
    return vector - 2.0 * scalar * casadi.cross(axis, vector) + 2.0 * casadi.cross(axis, casadi.cross(axis, vector))


def _symbolic(body: Body) -> SymbolicBody:
    import casadi

    chain = body.chain
    shape = casadi.SX.sym("shape", body.n_shape)
    frames = joint_frames(chain, joint_coordinates(chain.follows, shape), shape)
    masses, moments, tensors = _composites(chain, frames)
    centre = moments[0] / masses[0]
    inertia = _about(tensors[0], moments[0], centre)
    speeds = [joint_screw(chain, number, frames[number + 1]) for number in range(len(chain.parents))]
    # Linear and angular momentum, about the base origin, of what each joint carries at unit rate.
    carried = []
    for number, (turning, speed) in enumerate(speeds):
        mass, moment, tensor = masses[number + 1], moments[number + 1], tensors[number + 1]
        linear = mass * speed + casadi.cross(turning, moment)
        carried.append((linear, tensor @ turning + casadi.cross(moment, speed)))
    none = casadi.SX(3, 0)
    full_linear = casadi.horzcat(none, *(linear for linear, _ in carried))
    full_angular = casadi.horzcat(none, *(angular - casadi.cross(centre, linear) for linear, angular in carried))
    fold = constant(chain.matrix)
    if not chain.follows.is_linear:
        fold = coordinate_slopes(chain.follows, shape)
    linear, momentum_matrix = full_linear @ fold, full_angular @ fold
    connection = solve_linear(inertia, momentum_matrix)
    mass_matrix = fold.T @ _joint_mass_matrix(chain, speeds, carried) @ fold
    metric = mass_matrix - linear.T @ linear / masses[0] - momentum_matrix.T @ connection
    values = inertia, momentum_matrix, connection, centre, 0.5 * (metric + metric.T)
    return SymbolicBody(body.name, body.joint_names, *_functions(shape, values), chain=chain)


def _of_particles(body: ParticleBody) -> SymbolicBody:
    maps = body.maps()
    shape = symbol_kind(maps).sym("shape", body.n_shape)
    inertia, momentum_matrix, mass_matrix, centre = maps(shape)
    connection = solve_linear(inertia, momentum_matrix)
    metric = mass_matrix - momentum_matrix.T @ connection
    values = inertia, momentum_matrix, connection, centre, 0.5 * (metric + metric.T)
    return SymbolicBody(body.name, body.joint_names, *_functions(shape, values), chain=None, maps=maps)


def _functions(shape: Any, values: tuple[Any, ...]) -> list[Any]:
    """Functions of a shape, one for each of `QUANTITIES`."""
    import casadi

    return [
        casadi.Function(key, [shape], [casadi.densify(casadi.cse(value))], ["shape"], [key])
        for key, value in zip(QUANTITIES, values, strict=True)
    ]


def constant(array: Array) -> Any:
    """Return a constant sparse matrix."""
    import casadi

    return casadi.SX(casadi.sparsify(casadi.DM(array)))


def joint_frames(chain: JointChain, joints: Any, shape: Any) -> list[tuple[Any, Any]]:
    """Orientation and origin of each frame of the chain, base axes, from the coordinates of all joints.

    shape : the three hinges of ball joints are counted from its turns
    """
    import casadi

    balls = {ball.row: _turn(shape[ball.columns]) for ball in chain.follows.balls}
    frames = [(casadi.SX.eye(3), casadi.SX(3, 1))]
    for number, parent in enumerate(chain.parents):
        turn, place = frames[parent]
        coordinate = joints[number]
        place = place + turn @ constant(chain.places[number])
        turn = turn @ constant(chain.turns[number])
        if number in balls:
            turn = turn @ balls[number]
        if chain.slides[number].any():
            place = place + turn @ (constant(chain.slides[number]) * coordinate)
        if chain.axes[number].any():
            turn = turn @ _rotation(chain.axes[number], coordinate)
        frames.append((turn, place))
    return frames


def coordinate_slopes(follows: CoordinateMap, shape: Any) -> Any:
    """Derivatives of the coordinates of all joints by the shape; hinges of ball joints are counted from that shape."""
    import casadi

    about = casadi.SX.sym("about", shape.shape[0])
    return casadi.substitute(casadi.jacobian(joint_coordinates(follows, shape, about), shape), about, shape)


def joint_coordinates(follows: CoordinateMap, shape: Any, about: Any = None) -> Any:
    """Coordinates of all joints from the shape.

    about : shape from whose turns the three hinges of ball joints are counted; None: `shape`, so that they are zero
    """
    import casadi

    joints = constant(follows.matrix) @ shape + casadi.DM(follows.offset)
    for joint in follows.curved:
        joints[joint.row] = joint.start + sum(_followed(function, joints[k]) for k, function in joint.terms)
    if about is None:
        return joints
    for ball in follows.balls:
        turn = _turn(about[ball.columns]).T @ _turn(shape[ball.columns])
        joints[ball.row] = casadi.atan2(-turn[1, 2], turn[2, 2])
        joints[ball.row + 1] = casadi.asin(turn[0, 2])
        joints[ball.row + 2] = casadi.atan2(-turn[0, 1], turn[0, 0])
    return joints


def _turn(numbers: Any) -> Any:
    """Rotation of the four numbers of a ball joint: (3, 3)."""
    import casadi

    vector, scalar = numbers[:3], numbers[3]
    square = casadi.dot(numbers, numbers)
    along = scalar**2 - casadi.dot(vector, vector)
    return (along * casadi.SX.eye(3) + 2.0 * (vector @ vector.T + scalar * casadi.skew(vector))) / square


def _followed(function: JointFunction, coordinate: Any) -> Any:
    """Function of a coordinate, whose derivatives are those of the piece that the coordinate is on."""
    import casadi

    def chosen(numbers: Array) -> Any:
        value = casadi.SX(float(numbers[-1]))
        for knot, number in zip(function.knots[::-1].tolist(), numbers[-2::-1].tolist(), strict=True):
            value = casadi.if_else(coordinate < knot, number, value)
        return value

    since, value = coordinate - chosen(function.centres), casadi.SX(0.0)
    for coefficients in function.coefficients[::-1]:
        value = value * since + chosen(coefficients)
    return value


def _rotation(axis: Array, angle: Any) -> Any:
    import casadi

    along = np.outer(axis, axis)
    across = casadi.skew(constant(axis))
    return constant(np.eye(3) - along) * casadi.cos(angle) + across * casadi.sin(angle) + constant(along)


def _composites(chain: JointChain, frames: list[tuple[Any, Any]]) -> tuple[Array, list[Any], list[Any]]:
    """Mass, first moment and inertia of each frame with all that hangs on it, about the base origin, base axes."""
    masses = chain.masses.copy()
    moments, tensors = [], []
    for (turn, place), mass, centre, inertia in zip(frames, chain.masses, chain.centres, chain.inertias, strict=True):
        moment = mass * (place + turn @ constant(centre))
        moments.append(moment)
        own = turn @ constant(inertia) @ turn.T
        tensors.append(own if mass == 0.0 else _about(own, -moment, moment / mass))
    for number in reversed(range(len(chain.parents))):
        parent = chain.parents[number]
        masses[parent] += masses[number + 1]
        moments[parent] = moments[parent] + moments[number + 1]
        tensors[parent] = tensors[parent] + tensors[number + 1]
    return masses, moments, tensors


def _about(tensor: Any, moment: Any, point: Any) -> Any:
    """Inertia about the centre of mass from that about the origin."""
    import casadi

    return tensor - (casadi.dot(moment, point) * casadi.SX.eye(3) - moment @ point.T)


def joint_screw(chain: JointChain, number: int, frame: tuple[Any, Any]) -> tuple[Any, Any]:
    """Screw of a joint at unit rate: angular velocity, and velocity at the base origin, base axes."""
    import casadi

    turn, place = frame
    turning = turn @ constant(chain.axes[number])
    return turning, turn @ constant(chain.slides[number]) + casadi.cross(place, turning)


def _joint_mass_matrix(chain: JointChain, speeds: list[tuple[Any, Any]], carried: list[tuple[Any, Any]]) -> Any:
    """Mass matrix of all joints with the base held."""
    import casadi

    count = len(chain.parents)
    matrix = casadi.SX(count, count)
    for number, (linear, angular) in enumerate(carried):
        above = number
        while above >= 0:
            turning, speed = speeds[above]
            matrix[number, above] = matrix[above, number] = casadi.dot(turning, angular) + casadi.dot(speed, linear)
            above = chain.parents[above] - 1
    return matrix


_MOST_BUFFERS = 128  # functions of one thread, of some kB each; a computation uses a few dozen


class _Buffers(threading.local):
    """Functions called by a thread, with the memory of each; every thread has its own."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Any, Any, Any, list[int]]] = {}

    def for_function(self, function: Any) -> tuple[Any, Any, list[int]]:
        """Return the buffer of a function, the call that evaluates it, and the lengths of its results."""
        known = self._known.get(id(function))
        if known is None:
            if len(self._known) >= _MOST_BUFFERS:
                self._known.clear()
            # The function is kept alive, so that no other one gets its id.
            lengths = [function.numel_out(place) for place in range(function.n_out())]
            known = self._known[id(function)] = function, *function.buffer(), lengths
        return known[1:]


_buffers = _Buffers()


def call_casadi(function: Any, rows: int, *arguments: Array) -> list[Array]:
    """Evaluate a CasADi function on arrays, in memory of this thread, so that threads can call it at the same time.

    Arguments hold numbers in the order of the function's inputs (column-major); each result is (rows, entries / rows).
    """
    buffer, evaluate, lengths = _buffers.for_function(function)
    inputs = [np.ascontiguousarray(argument) for argument in arguments]
    results = [np.empty((rows, length // rows)) for length in lengths]
    for place, argument in enumerate(inputs):
        buffer.set_arg(place, argument.data)
    for place, result in enumerate(results):
        buffer.set_res(place, result.data)
    evaluate()
    return results
