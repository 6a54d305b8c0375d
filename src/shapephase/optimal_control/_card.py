"""What is shown of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, angle_text, momentum_text, numbers
from ..so3 import angle

if TYPE_CHECKING:
    from .plan import Plan

_SECOND_ORDER = {True: "a minimum among paths near by", False: "not met", None: "not known"}


def plan_card(self: Plan) -> Card:
    """What turns by how much at which cost, how far off the goal, and how it was found; with its joints in time."""
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
    if self.hamiltonian_spread is not None:
        rows.append(("Hamiltonian", f"constant to {self.hamiltonian_spread:.1e}"))
    shapes = self.path.shape(np.linspace(0.0, self.path.duration, MOST_POINTS))
    return Card(f"Plan for {self.body.name}", rows, curves_picture(shapes, "joints in time"))
