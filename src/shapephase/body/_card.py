"""What is shown of a body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import so3
from ..arrays import Array
from ..card_pictures import sticks_picture
from ..display import Card, numbers

if TYPE_CHECKING:
    from .body import Body

# Joints that are named.
_FEW = 4


def body_card(self: Body) -> Card:
    """Name, mass, principal moments and joints, with its frames as sticks in the neutral shape."""
    shape = self.shape()
    moments = np.linalg.eigvalsh(self.locked_inertia(shape))
    named = ", ".join(self.joint_names[:_FEW]) + (", …" if self.n_shape > _FEW else "")
    rows = [
        ("mass", numbers(self.mass, "kg")),
        ("links", f"{len(self.link_names)}"),
        ("joints", f"{self.n_joints}{f': {named}' if named else ''}"),
        ("centre of mass", numbers(self.centre_of_mass(shape), "m")),
        ("principal moments", numbers(moments, "kg m^2")),
    ]
    starts, ends = _sticks(self)
    return Card(f"Body {self.name!r}", rows, sticks_picture(starts, ends, "its joints") if len(starts) else "")


def _sticks(body: Body) -> tuple[Array, Array]:
    """From each frame to the joints that hang on it, and to the centre of mass of what moves with it."""
    chain = body.chain
    places, turns = [np.zeros(3)], [np.eye(3)]
    neutral = chain.follows.coordinates(body.shape()[None])[0]
    for k, parent in enumerate(chain.parents):
        at, turned = neutral[k], turns[parent] @ chain.turns[k]
        places.append(places[parent] + turns[parent] @ chain.places[k] + turned @ chain.slides[k] * at)
        turns.append(turned @ so3.exp(at * chain.axes[k]))
    ends = np.array(places)
    centres = ends + so3.apply(np.array(turns), chain.centres)
    starts = np.concatenate([ends[list(chain.parents)] if len(chain.parents) else ends[:0], ends])
    return starts, np.concatenate([ends[1:], centres])
