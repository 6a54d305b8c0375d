"""A wheel taken out of a link: its inertia, and what is left of the link's."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array
from ..errors import ShapeError
from ..inertia_tensor import second_moment
from ..letters import value_text

_ROUNDING = 1e-12  # of the largest wheel that a link could hold: what rounding leaves of a limit reached exactly


def carved_wheel(mass: float, tensor: Array, axle: Array, inertia: float, link: str) -> tuple[float, Array]:
    """Mass and inertia of a wheel about the centre of mass that it shares with its link, which has these without it.

    A flat disc, J a a^T + J/2 (1 - a a^T), whose radius of gyration is that of the link, so that its mass is less.

    Parameters
    ----------
    mass, tensor : of the link with the wheel in it [kg], (3, 3) [kg m^2]
    axle : (3,) unit vector a
    inertia : J [kg m^2]
    link : its name, for messages

    Raises
    ------
    ShapeError
        If no distribution of mass has what is left: its integral of r r^T dm would not be positive.
    """
    moment = second_moment(tensor)
    frame = so3.between(np.array([0.0, 0.0, 1.0]), axle)
    turned = frame.T @ moment @ frame
    along, beside = float(turned[2, 2]), turned[:2, 2]
    # J/2 across the axle may be taken out while the Schur complement of the part along it stays positive.
    across = turned[:2, :2] - (np.outer(beside, beside) / along if along > 0.0 else 0.0)
    largest = 2.0 * float(np.linalg.eigvalsh(across)[0])
    if mass <= 0.0 or inertia > largest * (1.0 + _ROUNDING):
        raise ShapeError(
            f"inertia: a wheel of {value_text(inertia)} kg m^2 about this axis is more than link {link!r} ({mass:.6g} "
            f"kg) can hold; up to {max(largest, 0.0):.6g} kg m^2 would leave it an inertia that some distribution of "
            "mass has. Is the wheel on another link (link=), or its mass not in the file?"
        )
    disc = 0.5 * inertia * (np.eye(3) + np.outer(axle, axle))
    return mass * inertia / float(np.trace(moment)), disc
