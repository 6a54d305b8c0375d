"""What is shown of a free rigid body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, numbers

if TYPE_CHECKING:
    from .euler_top import EulerTop


def top_card(self: EulerTop) -> Card:
    """Moments, momentum, energy, regime and period; with the body momentum in one period."""
    rows = [
        ("moments", numbers(self.moments, "kg m^2")),
        ("momentum", numbers(self.momentum, "kg m^2/s")),
        ("energy", numbers(self.energy, "J")),
        ("regime", self.regime),
        ("period", numbers(self.period, "s")),
        ("condition", f"{self.condition:.3g}, what rounding of its data is magnified by in each half turn"),
    ]
    if not np.isfinite(self.period):
        return Card("EulerTop", rows)
    momenta = self.body_momentum(np.linspace(0.0, self.period, MOST_POINTS))
    return Card("EulerTop", rows, curves_picture(momenta, "body momentum in one period"))
