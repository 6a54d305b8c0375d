"""What is shown of a split, and of the directions that return."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import so3
from ..card_pictures import bars_picture, sphere_picture
from ..display import Card, angle_text, error_text, momentum_text, numbers

if TYPE_CHECKING:
    from .phase_split import PhaseSplit
    from .return_map import FixedPoints

_KINDS = ("elliptic", "hyperbolic", "inverse hyperbolic", "parabolic")


def split_card(self: PhaseSplit) -> Card:
    """The rotations and the phases; with bars of dynamic, geometric and Montgomery phase."""
    about = self.about
    whole = "shape holonomy" if self.is_loop else "shape lift (open)"
    rows = [
        ("momentum", momentum_text(about.momentum)),
        ("total rotation", angle_text(so3.angle(self.total_rotation))),
        (whole, angle_text(so3.angle(self.holonomy))),
        ("Montgomery phase", angle_text(self.montgomery_phase)),
        ("  dynamic", angle_text(self.dynamic_phase)),
        ("  geometric", angle_text(self.geometric_phase)),
        ("momentum gap", angle_text(self.momentum_gap)),
        ("error, residual", f"{error_text(about.error_estimate)}, {error_text(self.residual)}"),
    ]
    if not np.any(self.has_phase):
        whose = "total angular momentum" if self.has_wheels else "angular momentum"
        rows = [*rows[:3], ("phases", f"none: there is no {whose}"), rows[-1]]
    if self.has_wheels:
        rows.insert(3, ("turn by wheels alone", angle_text(so3.angle(self.wheel_rotation))))
    title = f"PhaseSplit of {about.label}, {about.duration:g} s, {self.gauge} gauge"
    if np.ndim(self.montgomery_phase) or not self.has_phase:
        return Card(title, rows)
    phases = [float(phase) for phase in (self.dynamic_phase, self.geometric_phase, self.montgomery_phase)]
    return Card(title, rows, bars_picture(phases, "dynamic, geometric and Montgomery phase"))


def fixed_points_card(self: FixedPoints) -> Card:
    """How many there are of which stability, and whether these are all; with the sphere they are on."""
    counts = [f"{self.stability.count(kind)} {kind}" for kind in _KINDS if kind in self.stability]
    largest = float(np.max(self.gap, initial=0.0))
    rows = [
        ("momentum", numbers(self.magnitude, "kg m^2/s")),
        ("directions", f"{len(self.directions)}{': ' if counts else ''}{', '.join(counts)}"),
        ("complete", "yes: indices sum to 2" if self.complete else f"perhaps not: indices sum to {self.index_sum}"),
        ("gap", f"{largest:.1e} rad at most"),
        ("tolerance", f"{self.tolerance:.1e} rad"),
    ]
    kinds = [_KINDS.index(kind) for kind in self.stability]
    return Card("FixedPoints", rows, sphere_picture(self.directions, kinds, "directions on the sphere"))
