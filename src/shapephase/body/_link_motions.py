"""Where the links of a body are and how they move, at many shapes in one call and without Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from .joint_chain import JointChain


@dataclass(frozen=True, eq=False)
class LinkMotions:
    """What moves with each of the k + 1 frames of a chain, at N shapes, in axes of the base.

    Attributes
    ----------
    turns : (N, k + 1, 3, 3) orientations
    places, speeds : (N, k + 1, 3) of the centres of mass, from the centre of mass of all, which moves [m], [m/s]
    spins : (N, k + 1, 3) angular velocities [rad/s]
    """

    turns: Array
    places: Array
    speeds: Array
    spins: Array


def link_motions(chain: JointChain, shapes: Array, rates: Array) -> LinkMotions:
    """With the base at rest: (N, n), (N, n) of the independent joints. Source: theory.md A7."""
    all_coordinates, all_rates = shapes @ chain.matrix.T + chain.offset, rates @ chain.matrix.T
    count, frames = len(shapes), len(chain.masses)
    turns = np.empty((count, frames, 3, 3))
    places, speeds, spins = np.zeros((3, count, frames, 3))
    turns[:, 0] = np.eye(3)
    # Of all joints at once, from the parent's axes to the child's.
    turned = chain.turns @ so3.exp(all_coordinates[..., None] * chain.axes)
    for joint, parent in enumerate(chain.parents):
        before, spin = turns[:, parent] @ chain.turns[joint], spins[:, parent]
        coordinate, rate = all_coordinates[:, joint, None], all_rates[:, joint, None]
        slide = before @ chain.slides[joint]
        step = turns[:, parent] @ chain.places[joint] + slide * coordinate
        turns[:, joint + 1] = turns[:, parent] @ turned[:, joint]
        spins[:, joint + 1] = spin + before @ chain.axes[joint] * rate
        # From origin to origin, so that nothing far away is taken off again.
        places[:, joint + 1] = places[:, parent] + step
        speeds[:, joint + 1] = speeds[:, parent] + so3.cross(spin, step) + slide * rate
    levers = so3.apply(turns, chain.centres)
    share = chain.masses / chain.masses.sum()
    places, speeds = places + levers, speeds + so3.cross(spins, levers)
    return LinkMotions(
        turns=turns,
        places=places - (share @ places)[:, None],
        speeds=speeds - (share @ speeds)[:, None],
        spins=spins,
    )
