"""What is shown of a deformation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, numbers
from ..errors import ShapePhaseError

if TYPE_CHECKING:
    from .deformation import Deformation


def deformation_card(self: Deformation) -> Card:
    """How long it is, its least and largest moments, its internal momentum; with the principal moments in time."""
    rows = [("duration", numbers(self.duration, "s") + (f", {self.loops} loops" if self.loops > 1 else ""))]
    title = f"Deformation: {self.label}"
    times = np.linspace(0.0, self.duration, MOST_POINTS)
    try:
        inertia, internal = self.inertia(times), self.internal_momentum(times)
    except ShapePhaseError as error:
        return Card(title, [*rows, ("cannot be evaluated", str(error))])
    moments = np.asarray(np.linalg.eigvalsh(inertia), dtype=np.float64)
    rows += [
        ("principal moments", f"{moments.min():.6g} to {moments.max():.6g} kg m^2"),
        ("internal momentum", f"up to {np.linalg.norm(internal, axis=-1).max():.6g} kg m^2/s"),
        ("shape closes", "yes" if self.closure is not None else f"no, by {self.shape_gap:.4g}"),
        ("breaks", f"{len(self.declared_breaks)}"),
    ]
    return Card(title, rows, curves_picture(moments, "principal moments in time"))
