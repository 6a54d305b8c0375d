"""Postures that a plan passes through, at times given or in their order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import positive_argument
from ..arrays import finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..letters import what_came


@dataclass(frozen=True, eq=False)
class Waypoint:
    """A posture that a plan passes through, without stopping there.

    Attributes
    ----------
    shape : (n,) of all joints [rad or m]; or name -> coordinate of some, the others being as the plan likes
    time : when [s]; None: whenever it suits, between the waypoints before and after it in their list

    Raises
    ------
    ShapeError, TrajectoryError
        For numbers that are not finite, no joints, a time that is not above 0.

    Examples
    --------
    >>> sp.optimal_control.Waypoint({"waist_pitch": 0.5}, time=0.4).time
    0.4
    """

    shape: ArrayLike | Mapping[str, float]
    time: float | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given and keep it as numbers."""
        if isinstance(self.shape, Mapping):
            if not self.shape or not all(isinstance(name, str) for name in self.shape):
                raise ShapeError(f"waypoint: names of joints with their coordinates are needed, got {self.shape}")
            kept = {name: finite_array(value, f"waypoint: {name}", ()).item() for name, value in self.shape.items()}
            object.__setattr__(self, "shape", kept)
        else:
            shape = np.array(finite_array(self.shape, "waypoint"))
            if shape.ndim != 1 or not len(shape):
                raise ShapeError(
                    f"waypoint: one coordinate for each joint, or names with coordinates, got {what_came(self.shape)}"
                )
            shape.flags.writeable = False
            object.__setattr__(self, "shape", shape)
        if self.time is not None:
            object.__setattr__(self, "time", positive_argument(self.time, "time of a waypoint"))
