"""A body as rows of plain numbers, with its joints' axes turned to e_z, for loops in machine code."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..display import short_repr
from .couplings.coordinate_map import CoordinateMap

if TYPE_CHECKING:
    from .joint_chain import JointChain

NUMBERS = 22
"""In the row of a frame: its turn at rest in the parent's axes (9, row by row), its place there (3) [m]; then of what
moves with it the mass [kg], the centre of mass (3) [m] and the inertia about that (xx yy zz yz xz xy) [kg m^2]."""
GEOMETRY = 12
"""How many of them do not depend on masses; they come first."""
_PARALLEL = 1e-14
"""Sine of the angle between a screw's axis and its slide: all that rounding leaves."""


@dataclass(frozen=True, eq=False)
class LinkRows:
    """Frame 0 is the base; joint k turns and slides frame k + 1 along its own z axis, by its coordinate q.

    Attributes
    ----------
    parents : (k,) number of the frame that each hangs on
    turning : (k,) 1 where a joint turns by q, 0 where it only slides
    leads : (k,) by how much it slides, in units of q: 1, 0, or the lead of a screw [m/rad]
    rows : (k + 1, NUMBERS)
    mass : of all [kg]
    follows : as in `JointChain`
    bases : (k + 1, 3, 3) the axes of each frame in those that it has in the chain, in more digits
    """

    parents: Any
    turning: Array
    leads: Array
    rows: Array
    mass: float
    follows: CoordinateMap
    bases: Any

    __repr__ = short_repr

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """Of all joints, followers included: (N, n), (N, n) -> (N, k), (N, k), each in one piece."""
        coordinates, speeds = self.follows.with_rates(shapes, rates)
        return np.ascontiguousarray(coordinates), np.ascontiguousarray(speeds)

    def in_chain_axes(self, derivatives: Array) -> Array:
        """Derivatives by first moments and inertias of frames, (m, k + 1, 10) as `inertial_sums` has them, turned."""
        bases, found = np.asarray(self.bases, dtype=np.float64), derivatives.copy()
        found[..., 1:4] = (bases @ derivatives[..., 1:4, None])[..., 0]
        # An entry off the diagonal of a tensor stands there twice.
        tensors = derivatives[..., [4, 9, 8, 9, 5, 7, 8, 7, 6]] * [1.0, 0.5, 0.5, 0.5, 1.0, 0.5, 0.5, 0.5, 1.0]
        turned = bases @ tensors.reshape(*derivatives.shape[:2], 3, 3) @ np.swapaxes(bases, -1, -2)
        found[..., 4:] = turned.reshape(*derivatives.shape[:2], 9)[..., [0, 4, 8, 5, 2, 1]] * [
            1.0,
            1.0,
            1.0,
            2.0,
            2.0,
            2.0,
        ]
        return found


def link_rows(chain: JointChain) -> LinkRows:
    """The rows of a chain, with each of its frames turned about its origin so that z is the joint's axis."""
    count = len(chain.names)
    # Turned in more digits, so that only the results are rounded.
    bases = [np.eye(3, dtype=np.longdouble)]
    turning, leads = (chain.axes != 0.0).any(axis=1), np.zeros(count)
    rows = np.zeros((count + 1, NUMBERS))
    for joint, (axis, slide) in enumerate(zip(chain.axes, chain.slides, strict=True)):
        basis = _with_third_axis(axis if turning[joint] else slide)
        lead = slide @ basis
        if np.abs(lead[:2]).max() > _PARALLEL * np.abs(lead).max():
            raise ValueError(f"joint {chain.names[joint]} slides across its axis")
        leads[joint] = lead[2]
        parent = bases[chain.parents[joint]]
        rows[joint + 1, :9] = (parent.T @ chain.turns[joint] @ basis).ravel()
        rows[joint + 1, 9:12] = parent.T @ chain.places[joint]
        bases.append(basis)
    rows[0, [0, 4, 8]] = 1.0
    axes = np.array(bases)
    rows[:, GEOMETRY:] = inertial_numbers(axes, chain.masses, chain.centres, chain.inertias)
    return LinkRows(
        parents=np.array(chain.parents, dtype=np.uint32),
        turning=turning.astype(float),
        leads=leads,
        rows=rows,
        mass=float(chain.masses.sum()),
        follows=chain.follows,
        bases=axes,
    )


def rows_with(rows: LinkRows, masses: Array, centres: Array, inertias: Array) -> LinkRows:
    """The rows of a chain with other inertias: its joints are the same."""
    changed = rows.rows.copy()
    changed[:, GEOMETRY:] = inertial_numbers(rows.bases, masses, centres, inertias)
    return replace(rows, rows=changed, mass=float(masses.sum()))


def inertial_numbers(bases: Any, masses: Array, centres: Array, inertias: Array) -> Array:
    """What the rows say of masses: (..., k + 1), (..., k + 1, 3), (..., k + 1, 3, 3) -> (..., k + 1, 10)."""
    back = np.swapaxes(bases, -1, -2)
    turned = (back @ inertias @ bases).reshape(*masses.shape, 9)[..., [0, 4, 8, 5, 2, 1]]
    return np.concatenate([masses[..., None], (back @ centres[..., None])[..., 0], turned], axis=-1).astype(float)


def _with_third_axis(axis: Array) -> Any:
    """A rotation whose third column is the direction of `axis`; exact where that is one of the axes: (3, 3)."""
    third = axis.astype(np.longdouble)
    third /= np.sqrt(third @ third)
    first = np.zeros(3, dtype=np.longdouble)
    # The axis after the nearest: for a coordinate axis the columns are coordinate axes too.
    first[(int(np.argmax(np.abs(third))) + 1) % 3] = 1.0
    first -= (first @ third) * third
    first /= np.sqrt(first @ first)
    return np.stack([first, np.cross(third, first), third], axis=1)
