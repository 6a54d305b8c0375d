"""Residual of Wong's equations along a joint path: the optimality check of a plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...body.loading import as_body_or_particles
from ...body.particles.point_masses import ParticleBody
from ...display import short_repr
from ...errors import AccuracyNotReached, SingularInertiaError, TrajectoryError
from ...shape_space.body_path import as_path, route_along
from ...shape_space.connection import connection_slopes, horizontal_lift, mechanical_connection
from ...shape_space.shape_path import ShapePath
from ..symbolic import call_casadi
from ..task import joint_coupling
from .hamiltonian import Hamiltonian, checked_metric, hamiltonian

_STAGES = 12  # Gauss nodes of a panel: exact to rounding on few panels of a smooth path
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_STAGES)
_SERIES = np.polynomial.legendre.legint(np.eye(_STAGES), lbnd=-1.0)  # integrals of the Legendre polynomials
# Integral from -1 to each node of the polynomial through values at the nodes: (k, k).
_INTEGRAL = np.polynomial.legendre.legval(_NODES, _SERIES).T @ np.linalg.inv(
    np.polynomial.legendre.legvander(_NODES, _STAGES - 1)
)
_PANELS = (2 ** np.arange(1, 7)).tolist()  # between two breaks, until the residual has converged
_CONVERGED = 1e-9  # change of a converged residual: the accuracy of the attitude along the path
_CONVERGED_SHARE = 1e-3  # relative change, which suffices too: it is read as an order of magnitude
_LEAST_FELT = 1e-9  # share of all charges' effect below which a combination is set to 0

_SAMPLES = 65  # times at which a path is compared with `joints` and `symmetric`
_FOLLOWS = 1e-9  # [rad or m], deviation from them: rounding of user input


@dataclass(frozen=True, eq=False)
class WongFit:
    """Extremal that fits a path best, and the path's residual in Wong's equations. Made by `wong_residual`.

    Attributes
    ----------
    charge : (3,) that fits best, the shortest if several do, inertial axes with R(0) = 1 [J s, or rad/s for "rate"]
    rate : (n,) at the start of that extremal [rad/s or m/s]
    residual : root mean square, in the metric of the cost, of the defect of p = p(0) + integral of dL/dr, relative to
        that of the rate
    """

    charge: Array
    rate: Array
    residual: float

    __repr__ = short_repr


def wong_residual(
    body: Body | ParticleBody | str,
    path: ShapePath | str,
    *,
    metric: Any = "kinetic",
    joints: Sequence[str] | None = None,
    symmetric: Mapping[str, tuple[str, float]] | None = None,
) -> WongFit:
    """Residual of Wong's equations along a path of the joints at zero momentum: the optimality check of a plan.

    The equations are integrated (du Bois-Reymond), p = g r' + A^T l = p(0) + integral of dL/dr: the rate of a spline
    counts, not its acceleration, and a jump of the rate is an error like any other.

    Source: see `extremal`.

    Parameters
    ----------
    path : open or closed; between its breaks smooth
    metric : see `extremal`
    joints, symmetric : see `plan_reorientation`; the path is compared with extremals of the motions that these leave

    Raises
    ------
    UnknownNameError, TrajectoryError
        For another metric; if the path has other joints than the body, or does not move as `joints` and
        `symmetric` prescribe.
    SingularInertiaError
        See `extremal`; at any shape of the path.
    AccuracyNotReached
        If the path is too rough between its breaks for the integral to be found.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> print(f"{sp.optimal_control.wong_residual(cat, loop).residual:.3f}")  # an extremal
    0.000
    """
    body = as_body_or_particles(body)
    path = as_path(path, body)
    route = route_along(body, path)
    equations = hamiltonian(body, metric)
    coupling = joint_coupling(body, joints, symmetric)
    _check_follows(body, route, coupling)
    lift = horizontal_lift(body, route)
    last: WongFit | None = None
    for panels in _PANELS:
        edges = np.concatenate([np.linspace(a, b, panels + 1)[:-1] for a, b in pairwise(route.breaks)])
        try:
            fit = _fit(body, equations, coupling, route, lift.attitude, np.append(edges, route.duration))
        except np.linalg.LinAlgError as error:
            raise SingularInertiaError(
                f"{body.name}: along this path a motion has nearly no kinetic energy: no extremal fits it ({error})"
            ) from error
        if last is not None and abs(fit.residual - last.residual) <= _CONVERGED + _CONVERGED_SHARE * fit.residual:
            return fit
        last = fit
    raise AccuracyNotReached(
        "the residual of the path does not converge as it is sampled more densely; declare the times where its rate "
        "jumps as breaks of the path"
    )


def _fit(
    body: Body | ParticleBody,
    known: Hamiltonian,
    coupling: Array,
    route: ShapePath,
    attitude: Callable[[Array], Array],
    edges: Array,
) -> WongFit:
    """Fit charge and initial momentum to the integrated equations at Gauss points, by least squares."""
    half = 0.5 * np.diff(edges)
    times = (edges[:-1, None] + half[:, None] * (_NODES + 1.0)).ravel()
    shapes, rates = route.curve(times)
    n, uncharged = body.n_shape, np.zeros(3)
    gradients = np.array(
        [call_casadi(known.slopes, 1, *row, uncharged)[0][0] for row in zip(shapes, rates, strict=True)]
    )
    columns, by_shape = connection_slopes(body, shapes)
    back = so3.transpose(attitude(times))
    # Columns: without charge, and by each component of the charge.
    momenta = np.concatenate([gradients[:, n : 2 * n, None], columns @ back], axis=2)
    forces = np.concatenate([gradients[:, :n, None], np.einsum("nija,nj->nia", by_shape, rates) @ back], axis=2)
    momenta, forces = coupling.T @ momenta, coupling.T @ forces
    panels = forces.reshape(len(half), len(_NODES), -1) * half[:, None, None]
    before = np.cumsum(np.einsum("k,pkx->px", _WEIGHTS, panels), axis=0)
    impulses = np.concatenate([np.zeros((1, before.shape[1])), before[:-1]])[:, None] + _INTEGRAL @ panels
    root = np.linalg.cholesky(coupling.T @ checked_metric(body, known, shapes, coupling) @ coupling)
    weights = np.sqrt((half[:, None] * _WEIGHTS).ravel())[:, None, None]
    # In the metric of the cost.
    missing = (weights * np.linalg.solve(root, momenta - impulses.reshape(momenta.shape))).reshape(-1, 4)
    speed = float(np.linalg.norm(weights * np.linalg.solve(root, momenta[:, :, :1])))
    # p(0) is eliminated first: the part of a charge that only shifts p(0) has no effect.
    initial, triangle = np.linalg.qr((weights * np.linalg.inv(root)).reshape(-1, coupling.shape[1]))
    left = missing - initial @ (initial.T @ missing)
    effects, values, axes = np.linalg.svd(left[:, 1:], full_matrices=False)
    kept = values > _LEAST_FELT * np.linalg.norm(missing[:, 1:])
    charge = -axes[kept].T @ ((effects[:, kept].T @ left[:, 0]) / values[kept])
    combined = np.append(1.0, charge)
    residual = float(np.linalg.norm(left @ combined)) / speed if speed else 0.0
    momentum = np.linalg.solve(triangle, initial.T @ (missing @ combined))
    here = route.shape(0.0)
    kinetic = momentum - coupling.T @ mechanical_connection(body, here).T @ charge
    metric = coupling.T @ np.array(known.metric(here)) @ coupling
    rate = coupling @ np.asarray(np.linalg.solve(metric, kinetic), float)
    return WongFit(charge=charge, rate=rate, residual=residual)


def _check_follows(body: Body | ParticleBody, route: ShapePath, coupling: Array) -> None:
    """Raise TrajectoryError where joints of a path do not move as the coupling prescribes."""
    shapes = route.shape(np.linspace(0.0, route.duration, _SAMPLES))
    moves = shapes - shapes[0]
    deviation = np.abs(moves - moves @ np.linalg.pinv(coupling).T @ coupling.T).max(axis=0)
    worst = int(np.argmax(deviation))
    if deviation[worst] > _FOLLOWS:
        raise TrajectoryError(
            f"joint {body.joint_names[worst]} of the path deviates by up to {deviation[worst]:.3g} from what joints "
            "and symmetric prescribe"
        )
