"""Places and motions of the links of a body, at many shapes in one call and without Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from .joint_chain import JointChain


@dataclass(frozen=True, eq=False)
class LinkMotions:
    """Motion of the k + 1 frames of a chain, at N shapes, in axes of the base.

    turns : (N, k + 1, 3, 3) orientations
    places, speeds : (N, k + 1, 3) of the centres of mass, from the centre of mass of all, which moves [m], [m/s]
    spins : (N, k + 1, 3) angular velocities [rad/s]
    """

    turns: Array
    places: Array
    speeds: Array
    spins: Array


def link_motions(chain: JointChain, shapes: Array, rates: Array) -> LinkMotions:
    """Motions of links with the base at rest: (N, n), (N, n) of the independent joints. Source: theory.md A7."""
    all_coordinates, all_rates = chain.follows.with_rates(shapes, rates)
    count, frames = len(shapes), len(chain.masses)
    turns = np.empty((count, frames, 3, 3))
    places, speeds, spins = np.zeros((3, count, frames, 3))
    turns[:, 0] = np.eye(3)
    # All joints at once, about their axes from the posture at zero.
    at_rest = chain.turns_at(shapes)
    turned = so3.exp(all_coordinates[..., None] * chain.axes)
    for joints, parents in chain.generations:
        before, spin = turns[:, parents] @ at_rest[:, joints], spins[:, parents]
        coordinate, rate = all_coordinates[:, joints, None], all_rates[:, joints, None]
        slide = so3.apply(before, chain.slides[joints])
        step = so3.apply(turns[:, parents], chain.places[joints]) + slide * coordinate
        turns[:, joints + 1] = before @ turned[:, joints]
        spins[:, joints + 1] = spin + so3.apply(before, chain.axes[joints]) * rate
        # From origin to origin, so that nothing far away is taken off again.
        places[:, joints + 1] = places[:, parents] + step
        speeds[:, joints + 1] = speeds[:, parents] + so3.cross(spin, step) + slide * rate
    levers = so3.apply(turns, chain.centres)
    share = chain.masses / chain.masses.sum()
    places, speeds = places + levers, speeds + so3.cross(spins, levers)
    return LinkMotions(
        turns=turns,
        places=places - (share @ places)[:, None],
        speeds=speeds - (share @ speeds)[:, None],
        spins=spins,
    )


def components(vectors: Array) -> Array:
    """Components of vectors as contiguous arrays, which are added and multiplied faster: (N, k, c) -> (c, N, k)."""
    return np.ascontiguousarray(np.moveaxis(vectors, -1, 0))


def cross(first: Array, second: Array) -> Array:
    """Cross product of vectors whose components come first: (3, ...), (3, ...) -> (3, ...)."""
    (a, b, c), (x, y, z) = first, second
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x])
