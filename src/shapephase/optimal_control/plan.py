"""Result of planning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, angle_text, card_html, card_text, momentum_text, numbers, short_repr
from ..reconstruction.reconstruction import Motion
from ..shape_space.closest_approach import ClosestApproach
from ..shape_space.shape_path import ShapePath
from ..so3 import angle
from .plan_options import Goal

# Radians; metres stand for them where joints slide.
COST_UNITS = {
    "kinetic": "J s",
    "rate": "rad^2/s",
    "acceleration": "rad^2/s^3",
    "effort": "s",
    "time": "s",
    "metric": "",
}

_SECOND_ORDER = {True: "a minimum among paths near by", False: "not met", None: "not known"}
AGREEMENT = 1e-3  # relative difference of costs up to which starts have come to the same


@dataclass(frozen=True)
class Start:
    """Result of one start of the search. Made by `plan_reorientation`.

    Attributes
    ----------
    status : the solver's message
    converged : whether it is a local optimum that reaches the goal
    cost : cost at its end [unit of the plan's cost]
    goal_error : angle between the solver's own attitude at the end and the goal [rad]
    kkt_residual, infeasibility : remaining violation of the optimality conditions and of the constraints, scaled
    iterations : iterations of the solver
    seconds : time it took
    second_order : whether the projected Hessian of the Lagrangian is positive definite there, so that no neighbour is
        cheaper; None where unknown
    """

    status: str
    converged: bool
    cost: float
    goal_error: float
    kkt_residual: float
    infeasibility: float
    iterations: int
    seconds: float
    second_order: bool | None = None

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Plan:
    """Motion of the joints that turns a body to a goal, and the search that found it. Made by `plan_reorientation`.

    Attributes
    ----------
    body : the body that turns
    path : path of all its joints; a C2 spline with not-a-knot ends, also where it closes: `read_shape_path(...,
        close=False)` reads a file of its samples back unchanged
    motion : its reconstruction, to 1e-10 rad: independent of how the plan was found
    cost_name : "kinetic", "rate", "acceleration", "effort", "time", or "metric" for a given one
    rates_at_ends : "zero", "periodic" or "free"
    cost : cost of `path`, by quadrature with the body's own matrices [J s, rad^2/s, rad^2/s^3 or s]
    goal_error : angle between the reconstructed attitude at the end and the goal [rad]
    transcription_gap : goal error before the Newton corrections: the error of the discretisation [rad]
    polish_steps : Newton corrections of the path's coefficients that removed it
    kkt_residual : residual of the discrete optimum's KKT conditions before the corrections, scaled; for many strokes
        that of the optimum among motions of so many equal ones
    coefficients : (pieces + 1, m) control points of the free coordinates [rad or m]
    iterations, seconds : of all starts
    starts : results of the starts, in their order
    second_order : `Start.second_order` of the start that gave the plan
    hamiltonian_spread : variation of Pontryagin's Hamiltonian relative to its mean, which is zero along an optimal path
        of the costs "kinetic" and "rate" without momentum where no rate is at its limit. By means over the pieces of
        the spline, without three at both ends, where the joints start and stop; None for other costs, with momentum,
        where all pieces are at a rate limit, or accelerations, jerks or efforts have limits, or waypoints times
    limit_shares : largest share that `path` takes up of each kind of limit that it has, 1 being all of it: "position",
        from the middle of the range; "rate", by the spline's control points, which bound it; "acceleration" and
        "jerk"; "effort", at 4,001 even times or more
    goal : the goal that `path` was to reach; of several, the cheapest
    status : "found"; "not found" for a `PlanNotFound.best`; "stopped" or "out of time" before the end of all starts
    waypoint_times : (v,) times at which `path` passes its waypoints [s]
    closest : with `Limits(clearance=...)`, pairs of links that come nearer than that and 1 mm, the nearest first
    """

    body: Body | ParticleBody
    path: ShapePath
    motion: Motion
    cost_name: str
    rates_at_ends: str
    cost: float
    goal_error: float
    transcription_gap: float
    polish_steps: int
    kkt_residual: float
    coefficients: Array
    iterations: int
    seconds: float
    starts: tuple[Start, ...]
    second_order: bool | None = None
    hamiltonian_spread: float | None = None
    limit_shares: Mapping[str, float] = field(default_factory=dict)
    goal: Goal | None = None
    status: str = "found"
    waypoint_times: Array = field(default_factory=lambda: np.zeros(0))
    closest: tuple[ClosestApproach, ...] = ()

    @property
    def agreeing_starts(self) -> int:
        """Number of starts that came to the least cost, within a thousandth: evidence that it is the global optimum."""
        costs = [start.cost for start in self.starts if start.converged]
        return sum(cost <= min(costs) * (1.0 + AGREEMENT) for cost in costs)

    @property
    def cost_unit(self) -> str:
        """Unit of `cost`."""
        return COST_UNITS[self.cost_name]

    __repr__, _repr_html_ = card_text, card_html

    def _card(self) -> Card:
        """Card of the turn, its cost, goal error and search, with the joints in time."""
        converged = sum(start.converged for start in self.starts)
        rows = [
            ("duration", f"{numbers(self.path.duration, 's')}, rates at the ends: {self.rates_at_ends}"),
            ("momentum", momentum_text(self.motion.momentum)),
            ("turned", angle_text(angle(self.motion.final_attitude))),
            ("off the goal", f"{self.goal_error:.1e} rad"),
            ("cost", f"{numbers(self.cost, self.cost_unit)} ({self.cost_name})"),
            ("of the limits", ", ".join(f"{name} {share:.1%}" for name, share in self.limit_shares.items())),
            ("found by", f"{self.iterations} iterations, {self.seconds:.3g} s"),
            ("starts", f"{len(self.starts)}, {converged} of them converged, {self.agreeing_starts} to this cost"),
            ("KKT residual", f"{self.kkt_residual:.1e}"),
            ("second order", _SECOND_ORDER[self.second_order]),
        ]
        if len(self.waypoint_times):
            rows.append(("waypoints passed at", numbers(self.waypoint_times, "s")))
        if self.closest:
            rows.append(("closest links", self.closest[0].text))
        if self.hamiltonian_spread is not None:
            rows.append(("Hamiltonian", f"constant to {self.hamiltonian_spread:.1e}"))
        shapes = self.path.shape(np.linspace(0.0, self.path.duration, MOST_POINTS))
        return Card(f"Plan for {self.body.name}", rows, curves_picture(shapes, "joints in time"))
