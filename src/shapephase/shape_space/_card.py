"""What is shown of a path of joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, numbers
from ..errors import ShapePhaseError

if TYPE_CHECKING:
    from .shape_path import ShapePath

_CLOSED = 1e-9  # [rad or m] largest difference of the ends of a closed path


def shape_path_card(self: ShapePath) -> Card:
    """How long it is, which joints move by how much, whether it closes; with its joints in time."""
    try:
        shapes = self.shape(np.linspace(0.0, self.duration, MOST_POINTS))
    except ShapePhaseError as error:
        return Card("ShapePath", [("duration", numbers(self.duration, "s")), ("cannot be evaluated", str(error))])
    spans = np.ptp(shapes, axis=0) if self.n_shape else np.zeros(1)
    widest = int(np.argmax(spans))
    name = self.joint_names[widest] if self.joint_names else f"joint {widest}"
    gap = float(np.max(np.abs(shapes[-1] - shapes[0]), initial=0.0))
    rows = [
        ("duration", numbers(self.duration, "s") + (f", {self.loops} loops" if self.loops > 1 else "")),
        ("joints", f"{self.n_shape}, {np.count_nonzero(spans > 0.0)} of them move"),
        ("widest", f"{name}, by {spans[widest]:.4g} rad or m"),
        ("breaks", f"{len(self.breaks)}"),
        ("closes", "yes" if gap <= _CLOSED else f"no, by {gap:.4g} rad or m"),
    ]
    return Card("ShapePath", rows, curves_picture(shapes, "joints in time") if self.n_shape else "")
