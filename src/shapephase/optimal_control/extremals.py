"""Normal extremals of the isoholonomic problem: a charged particle in the curvature of the mechanical connection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from threading import Lock
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from .. import so3
from ..arguments import positive_argument, times_argument, tolerance_argument, vector_argument
from ..arrays import Array, check_reach
from ..body.body import Body
from ..errors import AccuracyNotReached, SingularInertiaError, unknown_name
from ..integrator.casadi_calls import call_casadi
from ..shape_space.connection import connection_slopes, horizontal_lift, mechanical_connection
from ..shape_space.shape_path import ShapePath
from .symbolic import solved, symbolic_body

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PIECES = (2, 4, 8, 16, 32, 64)
_LEAST_METRIC = 1e-12
_MOST = 200_000
_SETTLED = 1e-9
_LEAST_FELT = 1e-9

_COSTS = ("kinetic", "rate")

_built: WeakKeyDictionary[Body, dict[str, Hamiltonian]] = WeakKeyDictionary()
_building = Lock()


@dataclass(frozen=True, eq=False)
class Hamiltonian:
    """Wong's equations of a body in Hamilton's form, as CasADi functions; g is the metric of the cost.

    They stand on L(r, u, l) = 1/2 u g u + l . A u, the Lagrangian of a charge l in base axes: its derivatives are
    p' = dL/dr, p = dL/du and omega = -dL/dl. The state is (r, p, quaternion xyzw), l = R^T charge, and
    H = 1/2 (p - A^T l) g^-1 (p - A^T l).

    Attributes
    ----------
    field : state, charge -> rate of the state
    energy : state, charge -> H
    slopes : r, u, l -> gradient of L by all three, (2 n + 3,)
    metric : r -> g
    """

    field: Any
    energy: Any
    slopes: Any
    metric: Any

    @cached_property
    def second(self) -> Any:
        """r, u, l -> second derivatives of L by all three, (2 n + 3, 2 n + 3); built when first needed."""
        import casadi

        parts = [casadi.SX.sym("x", self.slopes.numel_in(place)) for place in range(3)]
        rows = casadi.jacobian(self.slopes(*parts), casadi.vertcat(*parts), {"symmetric": True})
        return casadi.Function("second", parts, [casadi.densify(rows)])


@dataclass(frozen=True, eq=False)
class Extremal:
    """A motion with zero momentum that solves Wong's equations, as a function of time.

    With g the metric of the cost, A the connection and F its curvature, l = R^T charge:
    d/dt (g r')_i = 1/2 r' dg/dr_i r' + l . F_ik r'_k, R' = R hat(-A r'), R(0) = 1. The charge is constant in inertial
    axes, so in base axes l' = l x omega; the speed, r' g r', is constant too.

    Attributes
    ----------
    body : who moves
    metric : "kinetic" or "rate", what g is (see `extremal`)
    duration : [s]
    charge : (3,) inertial axes [J s, or rad/s for "rate"]
    energy : 1/2 r' g r', kept by the motion [J, or rad^2/s^2]
    energy_drift : the largest relative change of the computed one at the steps
    solution : times -> states (2 n + 4, N): shapes, their canonical momenta, quaternion xyzw
    """

    body: Body
    metric: str
    duration: float
    charge: Array
    energy: float
    energy_drift: float
    solution: Callable[[Array], Array]

    @property
    def cost(self) -> float:
        """The integral of 1/2 r' g r' over the duration [J s, or rad^2/s for "rate"]."""
        return self.energy * self.duration

    @cached_property
    def path(self) -> ShapePath:
        """The motion of the joints alone."""
        names = self.body.joint_names

        def curve(times: Array) -> tuple[Array, Array]:
            states = self._states(times)
            return states[: len(names)].T, self._rates(states)

        return ShapePath.function(curve, self.duration, joint_names=names)

    def shape(self, t: ArrayLike) -> Array:
        """Times (...) -> (..., n) [rad or m]. Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        return self._states(times.ravel())[: self.body.n_shape].T.reshape(*times.shape, self.body.n_shape)

    def rate(self, t: ArrayLike) -> Array:
        """Times (...) -> (..., n) [rad/s or m/s]. Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        return self._rates(self._states(times.ravel())).reshape(*times.shape, self.body.n_shape)

    def attitude(self, t: ArrayLike) -> Array:
        """Base axes to the base axes at the start: times (...) -> (..., 3, 3). Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        quaternions = so3.normalised(self._states(times.ravel())[-4:].T)
        return so3.matrix_from_quat(quaternions).reshape(*times.shape, 3, 3)

    def _states(self, times: Array) -> Array:
        # SciPy's solution does not take no times.
        return self.solution(times) if len(times) else np.empty((2 * self.body.n_shape + 4, 0))

    def _rates(self, states: Array) -> Array:
        field = hamiltonian(self.body, self.metric).field
        n = self.body.n_shape
        rates = [call_casadi(field, 1, row, self.charge)[0][0, :n] for row in states.T]
        return np.array(rates).reshape(-1, n)


@dataclass(frozen=True, eq=False)
class WongFit:
    """How nearly a path solves Wong's equations.

    Attributes
    ----------
    charge : (3,) that fits best, the shortest if several do, inertial axes with R(0) = 1 [J s, or rad/s for "rate"]
    rate : (n,) at the start of the extremal that the fit means [rad/s or m/s]
    residual : root mean square, in the metric of the cost, of what is missing in p = p(0) + integral of dL/dr,
        relative to that of the rate
    """

    charge: Array
    rate: Array
    residual: float


def extremal(
    body: Body,
    shape: ArrayLike,
    rate: ArrayLike,
    charge: ArrayLike,
    duration: float,
    *,
    metric: str = "kinetic",
    tolerance: float = 1e-11,
) -> Extremal:
    """The normal extremal from a shape with a rate and a charge.

    Integrates Hamilton's equations of H = 1/2 (p - A^T l) g^-1 (p - A^T l), p = g r' + A^T l.

    Parameters
    ----------
    shape, rate : (n,) at the start [rad or m], [rad/s or m/s]
    charge : (3,) lambda, inertial axes; the base starts at the identity [J s, or rad/s for "rate"]
    duration : [s]
    metric : g of the cost, the integral of 1/2 r' g r': "kinetic", the reduced metric (`SymbolicBody.shape_metric`),
        or "rate", the identity
    tolerance : of each step, relative, between 1e-13 and 1e-4

    Raises
    ------
    ShapeError
        If the arguments are not of these shapes, not finite, or beyond 1e6.
    UnknownNameError
        For another metric.
    SingularInertiaError
        If a motion of the joints has no kinetic energy, so its rate is not determined.
    AccuracyNotReached
        If the integration breaks down or takes too many steps: such a shape lies ahead, or the charge is too large.

    Source: Montgomery, Isoholonomic problems and some applications, Comm. Math. Phys. 128 (1990) 565-592, theorem 1 and
    its Hamiltonian form; signs as in theory.md section 1.
    """
    start, speed = (vector_argument(value, name, body.n_shape) for value, name in ((shape, "shape"), (rate, "rate")))
    check_reach(start, "shape")
    check_reach(speed, "rate")
    moment = vector_argument(charge, "charge", 3)
    span, goal = positive_argument(duration), tolerance_argument(tolerance)
    equations = hamiltonian(body, metric)
    checked_metric(body, equations, start[None])
    state = initial_state(equations, start, speed, moment)

    def field(now: Array) -> Array:
        return call_casadi(equations.field, 1, now, moment)[0][0]

    momenta, _ = natural_sizes(body, equations, start, speed, moment)
    answer = integrated(field, span, state, goal, np.concatenate([np.ones(body.n_shape), momenta, np.ones(4)]))
    energies = np.array([call_casadi(equations.energy, 1, row, moment)[0][0, 0] for row in answer.y.T])
    energy = float(energies[0])
    drift = float(np.abs(energies - energy).max() / energy) if energy else 0.0
    return Extremal(body, metric, span, moment, energy, drift, answer.sol)


def wong_residual(body: Body, path: ShapePath, *, metric: str = "kinetic") -> WongFit:
    """How far a path of the joints, at zero momentum, is from an extremal: the optimality check of a plan.

    Wong's equations are taken in integrated form (du Bois-Reymond), p = g r' + A^T l = p(0) + integral of dL/dr: so a
    spline is judged by its rate, not by its acceleration, and a jump of the rate is an error like any other.

    Parameters
    ----------
    path : open or closed; between its breaks smooth
    metric : as for `extremal`

    Raises
    ------
    UnknownNameError, TrajectoryError
        For another metric; if the path has other joints than the body.
    SingularInertiaError
        As `extremal`, at any shape of the path.
    AccuracyNotReached
        If the path is too rough between its breaks for the integral to be found.

    Source: as `extremal`.
    """
    route = path.matched(body.joint_names, body.name)
    equations = hamiltonian(body, metric)
    lift = horizontal_lift(body, route)
    last: WongFit | None = None
    for pieces in _PIECES:
        edges = np.concatenate([np.linspace(a, b, pieces + 1)[:-1] for a, b in pairwise(route.breaks)])
        fit = _fit(body, equations, route, lift.attitude, np.append(edges, route.duration))
        if last is not None and abs(fit.residual - last.residual) <= _SETTLED + 1e-3 * fit.residual:
            return fit
        last = fit
    raise AccuracyNotReached(
        "the momentum of the path does not settle as it is sampled more densely; declare the times where its rate "
        "jumps as breaks of the path"
    )


def hamiltonian(body: Body, metric: str) -> Hamiltonian:
    """The equations of a body; built at the first call for it, kept as long as the body is. Raises UnknownNameError."""
    if metric not in _COSTS:
        raise unknown_name("metric", metric, _COSTS)
    with _building:
        of_body = _built.setdefault(body, {})
        if metric not in of_body:
            of_body[metric] = _hamiltonian(body, metric)
        return of_body[metric]


def initial_state(equations: Hamiltonian, shape: Array, rate: Array, charge: Array) -> Array:
    """State at the start, where the base is at the identity: -> (2 n + 4,)."""
    n = len(shape)
    momentum = call_casadi(equations.slopes, 1, shape, rate, charge)[0][0, n : 2 * n]
    return np.concatenate([shape, momentum, [0.0, 0.0, 0.0, 1.0]])


def natural_sizes(body: Body, equations: Hamiltonian, shape: Array, rate: Array, charge: Array) -> tuple[Array, float]:
    """How large the momenta (n,) and the charge of an extremal are, whatever the units of the joints."""
    metric = np.array(equations.metric(shape))
    momenta = np.sqrt(np.diag(metric)) * (np.sqrt(rate @ metric @ rate) or 1.0)
    felt = float(np.abs(mechanical_connection(body, shape)).max())
    return momenta, max(float(np.linalg.norm(charge)), float(momenta.max()) / felt if felt else 0.0) or 1.0


def integrated(
    field: Callable[[Array], Array], span: float, state: Array, goal: float, size: Array, most: int | None = None
) -> Any:
    """Solution with steps of relative accuracy `goal`, and a polynomial for each.

    Raises AccuracyNotReached, also after more evaluations than `most`.
    """
    count, limit = 0, _MOST if most is None else most

    def counted(time: float, now: Array) -> Array:
        nonlocal count
        count += 1
        if count > limit:
            raise AccuracyNotReached(
                f"the extremal is at {time:.6g} s of {span:.6g} s after {limit} evaluations: its charge turns it too "
                "fast, or it passes too near a shape in which a motion of the joints has no kinetic energy; take less "
                "charge or a shorter motion, or loosen the tolerance"
            )
        return field(now)

    # What overflows is rejected with its step.
    with np.errstate(over="ignore", invalid="ignore"):
        answer = solve_ivp(counted, (0.0, span), state, method="DOP853", rtol=goal, atol=goal * size, dense_output=True)
    if answer.status != 0:
        raise AccuracyNotReached(
            f"the extremal breaks down at {answer.t[-1]:.6g} s of {span:.6g} s ({answer.message}): a shape lies ahead "
            "in which a motion of the joints has no kinetic energy; shorten the motion, or start otherwise"
        )
    return answer


def checked_metric(body: Body, equations: Hamiltonian, shapes: Array) -> Array:
    """g of each shape, (N, n) -> (N, n, n). Raises SingularInertiaError where a motion of the joints has no energy."""
    metrics = np.array([np.array(equations.metric(shape)) for shape in shapes])
    size = np.sqrt(np.maximum(np.diagonal(metrics, axis1=1, axis2=2), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(metrics / size[:, None] / size[:, :, None])
    if not body.n_shape or values.min() <= _LEAST_METRIC:
        worst = vectors[int(np.argmin(values[:, 0])), :, 0] if body.n_shape else np.zeros(0)
        joint = body.joint_names[int(np.argmax(np.abs(worst)))] if body.n_shape else "none"
        raise SingularInertiaError(
            f"{body.name}: a motion of its joints (most of it joint {joint}) has no kinetic energy, so no extremal "
            "determines its rate; give mass to what the joint moves, or leave it out"
        )
    return metrics


def _hamiltonian(body: Body, cost: str) -> Hamiltonian:
    import casadi

    symbols, n = symbolic_body(body), body.n_shape
    shape, rate, moment = (casadi.SX.sym(*what) for what in (("r", n), ("u", n), ("l", 3)))
    metric = symbols.shape_metric if cost == "kinetic" else casadi.Function("rate", [shape], [casadi.SX.eye(n)])
    lagrangian = 0.5 * rate.T @ metric(shape) @ rate + moment.T @ symbols.connection(shape) @ rate
    gradient = casadi.gradient(casadi.cse(lagrangian), casadi.vertcat(shape, rate, moment))
    slopes = casadi.Function("slopes", [shape, rate, moment], [casadi.densify(casadi.cse(gradient))])
    state, charge = casadi.SX.sym("state", 2 * n + 4), casadi.SX.sym("charge", 3)
    here, vector, scalar = state[:n], state[2 * n : 2 * n + 3], state[2 * n + 3]
    across = casadi.cross(vector, charge)
    turned_back = charge + 2.0 * (casadi.cross(vector, across) - scalar * across) / casadi.sumsqr(state[2 * n :])
    kinetic = state[n : 2 * n] - symbols.connection(here).T @ turned_back
    speed = solved(metric(here), kinetic)
    known = slopes(here, speed, turned_back)
    omega = -known[2 * n :]
    quaternion_rate = 0.5 * casadi.vertcat(scalar * omega + casadi.cross(vector, omega), -casadi.dot(vector, omega))
    field = casadi.densify(casadi.cse(casadi.vertcat(speed, known[:n], quaternion_rate)))
    return Hamiltonian(
        casadi.Function("field", [state, charge], [field]),
        casadi.Function("energy", [state, charge], [0.5 * kinetic.T @ speed]),
        slopes,
        metric,
    )


def _fit(body: Body, known: Hamiltonian, route: ShapePath, attitude: Callable[[Array], Array], edges: Array) -> WongFit:
    """The integrated equations along the path by least squares on Gauss points."""
    half = 0.5 * np.diff(edges)
    times = (edges[:-1, None] + half[:, None] * (_NODES + 1.0)).ravel()
    shapes, rates = route.curve(times)
    n, uncharged = body.n_shape, np.zeros(3)
    gradients = np.array(
        [call_casadi(known.slopes, 1, *row, uncharged)[0][0] for row in zip(shapes, rates, strict=True)]
    )
    columns, by_shape = connection_slopes(body, shapes)
    back = so3.transpose(attitude(times))
    # Without charge, then by each component of the charge in inertial axes: (N, n, 4).
    momenta = np.concatenate([gradients[:, n : 2 * n, None], columns @ back], axis=2)
    pushes = np.concatenate([gradients[:, :n, None], np.einsum("nija,nj->nia", by_shape, rates) @ back], axis=2)
    panels = pushes.reshape(len(half), len(_NODES), -1) * half[:, None, None]
    before = np.cumsum(np.einsum("k,pkx->px", _WEIGHTS, panels), axis=0)
    done = np.concatenate([np.zeros((1, before.shape[1])), before[:-1]])[:, None] + _INTEGRAL @ panels
    root = np.linalg.cholesky(checked_metric(body, known, shapes))
    weights = np.sqrt((half[:, None] * _WEIGHTS).ravel())[:, None, None]
    missing = weights * np.linalg.solve(root, momenta - done.reshape(momenta.shape))
    # p(0) is eliminated first: what of a charge is only another p(0) is not felt.
    starts, triangle = np.linalg.qr((weights * np.linalg.inv(root)).reshape(-1, n))
    missing = missing.reshape(-1, 4)
    left = missing - starts @ (starts.T @ missing)
    felt, values, axes = np.linalg.svd(left[:, 1:], full_matrices=False)
    kept = values > _LEAST_FELT * np.linalg.norm(missing[:, 1:])
    charge = -axes[kept].T @ ((felt[:, kept].T @ left[:, 0]) / values[kept])
    speed = float(np.linalg.norm(weights * np.linalg.solve(root, momenta[:, :, :1])))
    combined = np.append(1.0, charge)
    residual = float(np.linalg.norm(left @ combined)) / speed if speed else 0.0
    momentum = np.linalg.solve(triangle, starts.T @ (missing @ combined))
    here = route.shape(0.0)
    kinetic = momentum - mechanical_connection(body, here).T @ charge
    return WongFit(charge, np.asarray(np.linalg.solve(np.array(known.metric(here)), kinetic), float), residual)


def _integral() -> Array:
    """The integral from -1 to each node of the polynomial through values at the nodes: (k, k)."""
    units = np.eye(len(_NODES))
    sums = np.polynomial.legendre.legval(_NODES, np.polynomial.legendre.legint(units, lbnd=-1.0))
    return sums.T @ np.linalg.inv(np.polynomial.legendre.legvander(_NODES, len(_NODES) - 1))


_INTEGRAL = _integral()
