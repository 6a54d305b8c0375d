"""Cost of a joint path by quadrature with the body's own matrices, independent of how a plan was found."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..chebyshev import gauss_tableau
from ..dynamics.torques import joint_torques
from ..errors import AccuracyNotReached
from ..reconstruction.reconstruction import Motion
from ..shape_space.body_path import as_path, route_along
from ..shape_space.connection import mechanical_connection
from ..shape_space.shape_path import ShapePath
from .cost_metric import METRIC_COSTS, CostMetric, metric_argument

_NODES = 12  # Gauss nodes of a panel: exact for the rate cost of a cubic spline, ample for smooth paths
_HALVINGS = 6  # of two panels between two breaks, until the cost has converged
_CONVERGED = 1e-10  # relative change between subdivisions: 100 roundings of the body's matrices


def path_cost(body: Body | ParticleBody | str, path: ShapePath | str, cost: Any = "kinetic") -> float:
    """Cost of a path that is the integral of a metric (see `plan_reorientation`), with the body's own matrices.

    By Gauss quadrature with twelve nodes a panel; the panels between two breaks of the path are halved until the cost
    changes by no more than 1e-10 of itself.

    Raises
    ------
    UnknownNameError, TrajectoryError
        For another cost, or a path of other joints.
    AccuracyNotReached
        If the cost does not converge: the path has jumps that are not declared as breaks.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> print(f"{sp.optimal_control.path_cost(cat, loop, 'rate'):.6f} rad^2/s")
    5.169923 rad^2/s
    """
    body = as_body_or_particles(body)
    path = as_path(path, body)
    metric = metric_argument(body, cost, "cost of a path")
    route = route_along(body, path)
    before, panels = _quadrature(body, route, metric, 2), 2
    for _ in range(_HALVINGS):
        panels *= 2
        now = _quadrature(body, route, metric, panels)
        if abs(now - before) <= _CONVERGED * abs(now):
            return now
        before = now
    raise AccuracyNotReached(
        f"the cost of the path of {body.name} does not converge on {panels} panels between its breaks (last at "
        f"{before:.9g}); declare the times of its jumps as breaks"
    )


def motion_cost(motion: Motion, body: Body | ParticleBody, route: ShapePath, cost: Any, effort_measure: Array) -> float:
    """Cost of a motion along a route in the order of the body's joints, by any of the costs of `plan_reorientation`.

    effort_measure : (n,) units of efforts for the cost "effort" [N m or N]
    """
    if not isinstance(cost, str) or cost in METRIC_COSTS:
        return path_cost(body, route, cost)
    if cost == "time":
        return route.duration
    times, weights = _gauss(route, 1)
    if cost == "acceleration":
        return float(0.5 * weights @ np.sum(route.acceleration(times) ** 2, axis=1))
    return float(weights @ np.sum((joint_torques(motion, times).torque / effort_measure) ** 2, axis=1))


def _quadrature(body: Body | ParticleBody, route: ShapePath, metric: CostMetric, panels: int) -> float:
    """Integral of the cost's density over the path, with so many panels between two breaks."""
    times, weights = _gauss(route, panels)
    return float(weights @ cost_density(body, metric, *route.curve(times)))


def _gauss(route: ShapePath, panels: int) -> tuple[Array, Array]:
    """Times and weights of a quadrature with so many panels between two breaks: (N,), (N,)."""
    inside, weights, _ = gauss_tableau(_NODES)
    ends = np.concatenate([np.linspace(a, b, panels + 1)[:-1] for a, b in pairwise(route.breaks)] + [route.breaks[-1:]])
    steps = np.diff(ends)
    return (ends[:-1, None] + steps[:, None] * inside).ravel(), (steps[:, None] * weights).ravel()


def cost_density(body: Body | ParticleBody, metric: CostMetric, shapes: Array, rates: Array) -> Array:
    """Integrand of a cost, 1/2 r' g r': (N, n), (N, n) -> (N,)."""
    if metric.name != "kinetic":
        return 0.5 * np.einsum("na,nab,nb->n", rates, metric.values(shapes), rates)
    return body.kinetic_energy(shapes, rates, -so3.apply(mechanical_connection(body, shapes), rates))
