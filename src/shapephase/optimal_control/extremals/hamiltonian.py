"""Equations of extremals in Hamilton's form, built once for a body, and their integration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.integrate import solve_ivp

from ...arrays import Array
from ...body.body import Body
from ...body.couplings.coordinate_map import check_no_balls, check_smooth
from ...body.loading import as_body_or_particles
from ...body.particles.casadi_positions import symbol_kind
from ...body.particles.point_masses import ParticleBody
from ...display import short_repr
from ...errors import AccuracyNotReached, SingularInertiaError
from ...shape_space.connection import mechanical_connection
from ..cost_metric import CostMetric, metric_argument
from ..symbolic import call_casadi, quaternion_rate, solve_linear, symbolic_body

_LEAST_METRIC = 1e-12  # eigenvalue that still determines rates: the mass matrix is rounded to 1e-15
_MOST = 200_000  # evaluations, after which the charge turns the motion too fast

_built: WeakKeyDictionary[Body | ParticleBody, dict[object, Hamiltonian]] = WeakKeyDictionary()
_building = Lock()


@dataclass(frozen=True, eq=False)
class Hamiltonian:
    """Wong's equations of a body in Hamilton's form, as CasADi functions; g is the metric of the cost.

    Made by `hamiltonian`.

    They derive from L(r, u, l) = 1/2 u g u + l . A u, the Lagrangian of a charge l in base axes: its derivatives are
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

    __repr__ = short_repr

    @cached_property
    def second(self) -> Any:
        """Function r, u, l -> second derivatives of L by all three, (2 n + 3, 2 n + 3); built when first needed."""
        import casadi

        parts = [symbol_kind(self.slopes).sym("x", self.slopes.numel_in(place)) for place in range(3)]
        rows = casadi.jacobian(self.slopes(*parts), casadi.vertcat(*parts), {"symmetric": True})
        return casadi.Function("second", parts, [casadi.densify(rows)])


def hamiltonian(body: Body | ParticleBody | str, metric: Any) -> Hamiltonian:
    """Return the equations of a body; built at its first call, kept as long as the body.

    Raises UnknownNameError, and ShapeError where a joint follows others by a function with knots.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> equations = sp.optimal_control.hamiltonian(cat, "kinetic")
    >>> print(np.array(equations.metric(np.zeros(3))).diagonal().round(6))
    [0.005   0.005   0.00125]
    """
    body = as_body_or_particles(body)
    given = metric_argument(body, metric, "metric")
    check_smooth(body.follows, "the equations of extremals need")
    check_no_balls(body.follows, "the equations of extremals need")
    with _building:
        of_body = _built.setdefault(body, {})
        if given.key not in of_body:
            of_body[given.key] = _hamiltonian(body, given.metric)
        return of_body[given.key]


def flow(
    body: Body | ParticleBody,
    equations: Hamiltonian,
    shape: Array,
    rate: Array,
    charge: Array,
    duration: float,
    accuracy: float,
    most: int | None = None,
) -> Any:
    """SciPy's dense solution of the extremal from a shape, the base at the identity (see `integrated`)."""
    momenta, _ = natural_scales(body, equations, shape, rate, charge)
    return integrated(
        lambda now: call_casadi(equations.field, 1, now, charge)[0][0],
        duration,
        initial_state(equations, shape, rate, charge),
        accuracy,
        np.concatenate([np.ones(body.n_shape), momenta, np.ones(4)]),
        most,
    )


def initial_state(equations: Hamiltonian, shape: Array, rate: Array, charge: Array) -> Array:
    """State at the start, where the base is at the identity: -> (2 n + 4,)."""
    n = len(shape)
    momentum = call_casadi(equations.slopes, 1, shape, rate, charge)[0][0, n : 2 * n]
    return np.concatenate([shape, momentum, [0.0, 0.0, 0.0, 1.0]])


def natural_scales(
    body: Body | ParticleBody, equations: Hamiltonian, shape: Array, rate: Array, charge: Array
) -> tuple[Array, float]:
    """Typical magnitudes of an extremal's momenta (n,) and charge, whatever the units of the joints."""
    metric = np.array(equations.metric(shape))
    momenta = np.sqrt(np.diag(metric)) * (np.sqrt(rate @ metric @ rate) or 1.0)
    largest = float(np.abs(mechanical_connection(body, shape)).max())
    return momenta, max(float(np.linalg.norm(charge)), float(momenta.max()) / largest if largest else 0.0) or 1.0


def integrated(
    field: Callable[[Array], Array], span: float, state: Array, goal: float, scale: Array, most: int | None = None
) -> Any:
    """SciPy's dense solution with steps of relative accuracy `goal`; below `scale` of an entry it is absolute.

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

    # A step that overflows is rejected.
    with np.errstate(over="ignore", invalid="ignore"):
        result = solve_ivp(
            counted, (0.0, span), state, method="DOP853", rtol=goal, atol=goal * scale, dense_output=True
        )
    if result.status != 0:
        raise AccuracyNotReached(
            f"the extremal breaks down at {result.t[-1]:.6g} s of {span:.6g} s ({result.message}): a shape lies ahead "
            "in which a motion of the joints has no kinetic energy; shorten the motion, or start elsewhere"
        )
    return result


def checked_metric(
    body: Body | ParticleBody, equations: Hamiltonian | CostMetric, shapes: Array, coupling: Array | None = None
) -> Array:
    """Metric g of each shape, (N, n) -> (N, n, n). Raises SingularInertiaError where a motion has no energy.

    With a coupling (n, m), only its motions are checked.
    """
    whole = np.array([np.array(equations.metric(shape)) for shape in shapes])
    metrics = whole if coupling is None else coupling.T @ whole @ coupling
    unit = np.sqrt(np.maximum(np.diagonal(metrics, axis1=1, axis2=2), 0.0))
    unit = np.where(unit > 0.0, unit, 1.0)
    values, vectors = np.linalg.eigh(metrics / unit[:, None] / unit[:, :, None])
    if not body.n_shape or values.min() <= _LEAST_METRIC:
        worst = vectors[int(np.argmin(values[:, 0])), :, 0] if body.n_shape else np.zeros(0)
        moved = worst if coupling is None else coupling @ worst
        joint = body.joint_names[int(np.argmax(np.abs(moved)))] if body.n_shape else "none"
        raise SingularInertiaError(
            f"{body.name}: a motion of its joints (most of it joint {joint}) has no kinetic energy, so no extremal "
            "determines its rate; give mass to what the joint moves, or leave it out"
        )
    return whole


def _hamiltonian(body: Body | ParticleBody, metric: Any) -> Hamiltonian:
    import casadi

    symbols, n = symbolic_body(body), body.n_shape
    kind = symbol_kind(symbols.inertia) if metric.is_a("SXFunction") else casadi.MX
    shape, rate, moment = (kind.sym(*what) for what in (("r", n), ("u", n), ("l", 3)))
    lagrangian = 0.5 * rate.T @ metric(shape) @ rate + moment.T @ symbols.connection(shape) @ rate
    gradient = casadi.gradient(casadi.cse(lagrangian), casadi.vertcat(shape, rate, moment))
    slopes = casadi.Function("slopes", [shape, rate, moment], [casadi.densify(casadi.cse(gradient))])
    state, charge = kind.sym("state", 2 * n + 4), kind.sym("charge", 3)
    here, vector, scalar = state[:n], state[2 * n : 2 * n + 3], state[2 * n + 3]
    across = casadi.cross(vector, charge)
    turned_back = charge + 2.0 * (casadi.cross(vector, across) - scalar * across) / casadi.sumsqr(state[2 * n :])
    kinetic = state[n : 2 * n] - symbols.connection(here).T @ turned_back
    speed = solve_linear(metric(here), kinetic)
    known = slopes(here, speed, turned_back)
    omega = -known[2 * n :]
    field = casadi.densify(casadi.cse(casadi.vertcat(speed, known[:n], quaternion_rate(state[2 * n :], omega))))
    return Hamiltonian(
        field=casadi.Function("field", [state, charge], [field]),
        energy=casadi.Function("energy", [state, charge], [0.5 * kinetic.T @ speed]),
        slopes=slopes,
        metric=metric,
    )
