"""The rigid parts of a body: the base, and what each joint moves."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, where a type checker cannot look.
# pyright: reportAttributeAccessIssue=false
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from ..arrays import Array
from ..display import short_repr


@dataclass(frozen=True, eq=False)
class MovingPart:
    """Links that are fixed to each other, and their inertia together, in the axes of the first.

    Attributes
    ----------
    links : their names
    mass : [kg]
    centre : (3,) centre of mass [m]
    inertia : (3, 3) about the centre of mass [kg m^2]

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> [part.mass for part in cat.moving_parts]
    [1.0, 0.0, 0.0, 1.0]
    """

    links: tuple[str, ...]
    mass: float
    centre: Array
    inertia: Array

    __repr__ = short_repr


def moving_parts(model: pin.Model) -> tuple[MovingPart, ...]:
    """The parts of a model with a free-flyer, in its order; only those that have links."""
    frames: dict[int, list[Any]] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frames.setdefault(frame.parentJoint, []).append(frame)
    parts = []
    for joint, inertia in enumerate(model.inertias.tolist()):
        if joint in frames:
            seen = frames[joint][0].placement.actInv(inertia)
            names = tuple(frame.name for frame in frames[joint])
            parts.append(MovingPart(names, seen.mass, np.array(seen.lever), np.array(seen.inertia)))
    return tuple(parts)
