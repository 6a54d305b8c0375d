"""Extremal to a given end, by shooting from a nearly optimal path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import tolerance_argument
from ...arrays import Array
from ...body.body import Body
from ...body.loading import as_body_or_particles
from ...body.particles.point_masses import ParticleBody
from ...errors import AccuracyNotReached, ShapeError
from ...shape_space.body_path import as_path, route_along
from ...shape_space.connection import horizontal_lift
from ...shape_space.shape_path import ShapePath
from .extremal import Extremal, extremal
from .hamiltonian import Hamiltonian, flow, hamiltonian
from .jacobi_fields import inverse_scale, jacobi_fields
from .wong_residual import wong_residual

_STEPS = 40  # Newton steps at each accuracy: damped steps along a weakly curved valley converge slowly
_ROUGH_GAP = 1e-6  # [rad or m] first reached by rough integrations, which take a fraction of the time,
_ROUGH_ACCURACY = 1e-8  # a hundredth of the gap
_FINEST_ACCURACY = 1e-13  # some hundred roundings
_ACCURACY_SHARE = 0.01  # of the gap to be reached
_FIRST_DAMPING = 1e-5  # relative to the gap: nearly a plain Newton step, as the path is nearly optimal
_RELAXATION = 4.0  # divides the damping after a step that helps
_TIGHTENING = 64.0  # multiplies it after one that does not: few trials to where the linear model holds
_LAST_DAMPING = 1e5  # at which the steps are too short to go on
_SYMMETRY = 10.0  # integration accuracies below which a relative singular value belongs to a symmetry
_SHARES = (0.5 ** np.arange(5)).tolist()  # of a step, tried before the damping rises
_DECREASE = 0.1  # least relative decrease of the gap by a whole step, as in Armijo's rule
_MOST_EVALUATIONS = 20_000  # of a trial, whose extremal then turns too fast to be a guide


@dataclass(frozen=True, eq=False)
class _Iterate:
    """Initial rate (n,) and charge (3,) of an extremal, and the damping of the next step."""

    rate: Array
    charge: Array
    damping: float


@dataclass(frozen=True, eq=False)
class _BoundaryProblem:
    """Extremals from `start` that have to end at `end`, turned by `turn`, after `duration`.

    body, metric, equations : see `extremal`
    start, end : (n,) shapes
    turn : (3, 3) attitude at the end
    duration : [s]
    """

    body: Body | ParticleBody
    metric: Any
    equations: Hamiltonian
    start: Array
    end: Array
    turn: Array
    duration: float

    def gap(self, rate: Array, charge: Array, accuracy: float, most: int | None = None) -> Array:
        """Distance of the extremal's end from the goal, shape and rotation vector: (n + 3,)."""
        n = self.body.n_shape
        last = flow(self.body, self.equations, self.start, rate, charge, self.duration, accuracy, most).y[:, -1]
        attitude = so3.matrix_from_quat(so3.normalised(last[2 * n :]))
        return np.concatenate([last[:n] - self.end, so3.log(attitude @ self.turn.T)])

    def step(self, now: _Iterate, gap: Array, accuracy: float) -> _Iterate | None:
        """Return a rate and charge with a nearer end; None if there are none."""
        n = self.body.n_shape
        fields = jacobi_fields(self.body, self.metric, self.start, now.rate, now.charge, self.duration, accuracy)
        scales = np.concatenate([fields.momentum_scales, np.full(3, fields.charge_scale)])
        # Derivative of the gap by g rate and charge, per scale: (n + 3, n + 3).
        scaled = fields.end()[2]
        weights = np.repeat([inverse_scale(scaled[:n]), inverse_scale(scaled[n:])], [n, 3])
        left, right = weights[:, None] * scaled, weights * gap
        across, values, along = np.linalg.svd(left)
        # The rest are symmetries, up to the integration's accuracy: along them the extremal stays where the path is.
        regular = values > _SYMMETRY * accuracy * values[0]
        across, values, along = across[:, regular], values[regular], along[regular]
        metric = np.array(self.equations.metric(self.start))
        damping = now.damping
        while damping < _LAST_DAMPING:
            damped = values / (values**2 + damping * np.linalg.norm(right))
            change = -scales * (along.T @ (damped * (across.T @ right)))
            for share in _SHARES:
                rate = now.rate + share * np.linalg.solve(metric, change[:n])
                charge = now.charge + share * change[n:]
                try:
                    after = self.gap(rate, charge, accuracy, _MOST_EVALUATIONS)
                except AccuracyNotReached:
                    continue
                if np.linalg.norm(weights * after) < (1.0 - _DECREASE * share) * np.linalg.norm(right):
                    return _Iterate(rate=rate, charge=charge, damping=damping / _RELAXATION)
            damping *= _TIGHTENING
        return None

    def newton(self, rate: Array, charge: Array, reach: float, accuracy: float) -> tuple[Array, Array, Array]:
        """Return rate and charge after Newton's method, which ends at a gap of `reach`, and the last gap."""
        now = _Iterate(rate=rate, charge=charge, damping=_FIRST_DAMPING)
        gap = np.full(self.body.n_shape + 3, np.inf)
        for _ in range(_STEPS):
            gap = self.gap(now.rate, now.charge, accuracy)
            if np.linalg.norm(gap) <= reach:
                break
            better = self.step(now, gap, accuracy)
            if better is None:
                break
            now = better
        return now.rate, now.charge, gap


def shoot(
    body: Body | ParticleBody | str,
    path: ShapePath | str,
    target: ArrayLike | None = None,
    *,
    metric: Any = "kinetic",
    tolerance: float = 1e-10,
) -> Extremal:
    """Return the extremal next to a nearly optimal path, with the same start and end and a given rotation.

    Newton's method on the initial rate and the charge, with steps shortened until the end comes nearer. Where a
    symmetry of the body turns one solution into others the derivative is singular, and the damping, which falls with
    the residual, leads to a nearest solution all the same (Yamashita and Fukushima 2001: quadratically).

    Raises also the errors of `extremal` and `wong_residual`.

    Parameters
    ----------
    path : start, end and duration are kept; the rate and charge of `wong_residual` are the first guess
    target : (3, 3) rotation over the path at zero momentum; None: that of the path
    metric : see `extremal`
    tolerance : of the end shape and the rotation [rad or m]

    Raises
    ------
    AccuracyNotReached
        If it does not converge: the message holds the remaining distance. Plans of bodies of up to 36 joints are near
        enough from 20 pieces on, except where light joints whirl.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> path = sp.optimal_control.shoot(cat, loop)
    >>> print(f"{path.cost:.4f} <= {sp.optimal_control.path_cost(cat, loop):.4f} J s")
    0.0204 <= 0.0204 J s
    """
    body = as_body_or_particles(body)
    path = as_path(path, body)
    route = route_along(body, path)
    goal = tolerance_argument(tolerance)
    turn = horizontal_lift(body, route).end if target is None else so3.rotation_argument(target, "target")
    if turn.shape != (3, 3):
        raise ShapeError(f"target: one rotation (3, 3) is needed, got {turn.shape}")
    fine = max(_FINEST_ACCURACY, _ACCURACY_SHARE * goal)
    guess = wong_residual(body, route, metric=metric)
    problem = _BoundaryProblem(
        body=body,
        metric=metric,
        equations=hamiltonian(body, metric),
        start=route.shape(0.0),
        end=route.shape(route.duration),
        turn=turn,
        duration=route.duration,
    )
    rate, charge, _ = problem.newton(guess.rate, guess.charge, max(goal, _ROUGH_GAP), max(fine, _ROUGH_ACCURACY))
    rate, charge, gap = problem.newton(rate, charge, goal, fine)
    if np.linalg.norm(gap) <= goal:
        return extremal(body, problem.start, rate, charge, route.duration, metric=metric, tolerance=fine)
    raise AccuracyNotReached(
        f"no extremal found next to the path: the end is {np.linalg.norm(gap):.3g} away, {goal:.3g} is required; start "
        "from a path nearer to the optimum (its wong_residual should be small; that of a plan falls with its pieces)"
    )
