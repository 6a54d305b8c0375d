"""Normal extremals of the isoholonomic problem: a charged particle in the curvature of the mechanical connection."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebint
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution

from ... import so3
from ...arguments import made_by, positive_argument, times_argument, tolerance_argument, vector_argument
from ...arrays import Array, check_reach
from ...body.body import Body
from ...body.loading import as_body_or_particles
from ...body.particles.point_masses import ParticleBody
from ...chebyshev import PiecewiseChebyshev, nodes_on, values_to_coefficients
from ...display import short_repr
from ...shape_space.shape_path import ShapePath
from ..symbolic import call_casadi
from .hamiltonian import checked_metric, flow, hamiltonian

_DEGREE = 12  # of the series of rates on a step of order 8: its error is that of the step


@made_by("optimal_control.extremal(...)")
@dataclass(frozen=True, eq=False)
class Extremal:
    """A motion with zero momentum that solves Wong's equations, as a function of time. Made by `extremal`.

    With g the metric of the cost, A the connection and F its curvature, l = R^T charge:
    d/dt (g r')_i = 1/2 r' dg/dr_i r' + l . F_ik r'_k, R' = R hat(-A r'), R(0) = 1. The charge is constant in inertial
    axes, so in base axes l' = l x omega; the speed, r' g r', is constant too.

    Attributes
    ----------
    body : the body that moves
    metric : what g is (see `extremal`)
    duration : [s]
    charge : (3,) inertial axes [J s, or rad/s for "rate"]
    energy : 1/2 r' g r', kept by the motion [J, or rad^2/s^2]
    energy_drift : largest relative change of the computed energy at the steps
    solution : SciPy's: times -> states (2 n + 4, N): shapes, their canonical momenta, quaternion xyzw
    """

    body: Body | ParticleBody
    metric: Any
    duration: float
    charge: Array
    energy: float
    energy_drift: float
    solution: OdeSolution

    __repr__ = short_repr

    @property
    def cost(self) -> float:
        """Integral of 1/2 r' g r' over the duration [J s, or rad^2/s for "rate"]."""
        return self.energy * self.duration

    @cached_property
    def path(self) -> ShapePath:
        """Motion of the joints: on each step a series of the rates, and its integral.

        The slopes of the solution's own polynomials are Hamilton's rates only to some 1e-9.
        """
        edges = self.solution.ts
        nodes = nodes_on(edges[:-1], edges[1:], _DEGREE)
        rates = self._rates(self._states(nodes.ravel())).reshape(*nodes.shape, self.body.n_shape)
        series = values_to_coefficients(_DEGREE) @ rates
        shapes = 0.5 * np.diff(edges)[:, None, None] * chebint(series, axis=1, lbnd=-1.0)
        # Each step begins where the one before it ends, the first one at the start.
        offsets = np.cumsum(shapes.sum(axis=1), axis=0)
        shapes[:, 0] += self.shape(0.0) + np.concatenate([np.zeros((1, self.body.n_shape)), offsets[:-1]])
        curves = PiecewiseChebyshev(edges, shapes), PiecewiseChebyshev(edges, series)
        return ShapePath.function(
            lambda times: (curves[0](times), curves[1](times)), self.duration, joint_names=self.body.joint_names
        )

    def shape(self, t: ArrayLike) -> Array:
        """Shape at times (...) -> (..., n) [rad or m]. Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        return self._states(times.ravel())[: self.body.n_shape].T.reshape(*times.shape, self.body.n_shape)

    def rate(self, t: ArrayLike) -> Array:
        """Rate at times (...) -> (..., n) [rad/s or m/s]. Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        return self._rates(self._states(times.ravel())).reshape(*times.shape, self.body.n_shape)

    def attitude(self, t: ArrayLike) -> Array:
        """Rotation from base axes to those at the start: times (...) -> (..., 3, 3). Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        quaternions = so3.normalised(self._states(times.ravel())[-4:].T)
        return so3.matrix_from_quat(quaternions).reshape(*times.shape, 3, 3)

    def _states(self, times: Array) -> Array:
        # SciPy's solution does not accept an empty array of times.
        return self.solution(times) if len(times) else np.empty((2 * self.body.n_shape + 4, 0))

    def _rates(self, states: Array) -> Array:
        field = hamiltonian(self.body, self.metric).field
        n = self.body.n_shape
        rates = [call_casadi(field, 1, row, self.charge)[0][0, :n] for row in states.T]
        return np.array(rates).reshape(-1, n)


def extremal(
    body: Body | ParticleBody | str,
    shape: ArrayLike,
    rate: ArrayLike,
    charge: ArrayLike,
    duration: float,
    *,
    metric: Any = "kinetic",
    tolerance: float = 1e-11,
) -> Extremal:
    """Return the normal extremal from a shape with a rate and a charge.

    Integrates Hamilton's equations of H = 1/2 (p - A^T l) g^-1 (p - A^T l), p = g r' + A^T l.

    Equation :eq:`wong` of the documentation.
    Source: Montgomery, Isoholonomic problems and some applications, Comm. Math. Phys. 128 (1990) 565-592, theorem 1 and
    its Hamiltonian form; signs as in theory.md section 1.

    Parameters
    ----------
    shape, rate : (n,) at the start [rad or m], [rad/s or m/s]
    charge : (3,) lambda, inertial axes; the base starts at the identity [J s, or rad/s for "rate"]
    duration : [s]
    metric : g of the cost, the integral of 1/2 r' g r': "kinetic", the reduced metric (`SymbolicBody.shape_metric`);
        "rate", the identity; a matrix (n, n), or a `casadi.Function` of the shape that gives one
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

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> path = sp.optimal_control.extremal(cat, np.zeros(3), [1.0, 0.0, 0.0], [0.0, 0.0, 0.001], 1.0)
    >>> print(f"{path.cost:.6f} J s")
    0.002500 J s
    """
    body = as_body_or_particles(body)
    start, speed = (vector_argument(value, name, body.n_shape) for value, name in ((shape, "shape"), (rate, "rate")))
    check_reach(start, "shape")
    check_reach(speed, "rate")
    moment = vector_argument(charge, "charge", 3)
    span, goal = positive_argument(duration), tolerance_argument(tolerance)
    equations = hamiltonian(body, metric)
    checked_metric(body, equations, start[None])
    result = flow(body, equations, start, speed, moment, span, goal)
    energies = np.array([call_casadi(equations.energy, 1, row, moment)[0][0, 0] for row in result.y.T])
    energy = float(energies[0])
    drift = float(np.abs(energies - energy).max() / energy) if energy else 0.0
    return Extremal(body, metric, span, moment, energy, drift, solution=result.sol)
