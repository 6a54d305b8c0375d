"""Bodies with the same joints and other masses, centres of mass and rotational inertias."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np

from ..arguments import made_by
from ..arrays import Array, Integers, lock_arrays, read_only
from ..errors import ShapeError
from ..letters import what_came
from ._changed_body import changed_body
from .body import Body
from .inertial_regressor import inertial_regressor
from .link_rows import GEOMETRY, inertial_numbers

# Numbers of regressors at once: some hundred MB.
_AT_ONCE = 10_000_000
_OF_A_LINK = 150


@made_by(Body="take one of its bodies, family[0]")
@dataclass(frozen=True, eq=False)
class BodyFamily(Sequence[Body]):
    """N bodies that differ in their inertias only: a sequence of them, made by `Body.with_inertias`.

    `articulated` and `reconstruct` take it as they take a body. Where the links are and how they move is the same for
    all, and computed once.

    Attributes
    ----------
    body : the one that they were made from
    masses : (N, k + 1) of what moves with each frame of `body.chain` [kg]
    centres : (N, k + 1, 3) centres of mass, axes of each frame [m]
    tensors : (N, k + 1, 3, 3) inertias about them [kg m^2]

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> masses = np.outer([1.0, 2.0, 3.0], [part.mass for part in cat.moving_parts])
    >>> family = cat.with_inertias(masses=masses)
    >>> len(family), round(family[2].mass, 6)
    (3, 6.0)
    """

    body: Body
    masses: Array
    centres: Array
    tensors: Array

    __post_init__ = lock_arrays

    def __len__(self) -> int:
        """N."""
        return len(self.masses)

    @overload
    def __getitem__(self, index: int) -> Body: ...

    @overload
    def __getitem__(self, index: slice) -> BodyFamily: ...

    def __getitem__(self, index: int | slice) -> Body | BodyFamily:
        """One of the bodies, made when it is asked for, or a family of those of a slice."""
        if isinstance(index, slice):
            return self.some(index)
        if not isinstance(index, int | np.integer):
            raise ShapeError(f"a body of a family is family[0], family[1] ..., got family[{what_came(index)}]")
        return changed_body(self.body, self.masses[index], self.centres[index], self.tensors[index])

    def some(self, rows: slice | Integers) -> BodyFamily:
        """A family of some of the bodies."""
        return BodyFamily(self.body, self.masses[rows], self.centres[rows], self.tensors[rows])

    def __repr__(self) -> str:
        """One line for people."""
        return f"BodyFamily({len(self)} x {self.body!r})"

    @property
    def mass(self) -> Array:
        """Of each: (N,) [kg]."""
        return self.masses.sum(axis=-1)

    def sample(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """I and L_o of all along a trajectory: (S, n), (S, n) -> (N, S, 3, 3), (N, S, 3). Unchecked."""
        inertia, momentum = np.empty((len(self), len(shapes), 3, 3)), np.empty((len(self), len(shapes), 3))
        at_once = max(1, _AT_ONCE // (_OF_A_LINK * self.masses.shape[1]))
        for first in range(0, len(shapes), at_once):
            part = slice(first, first + at_once)
            regressor = inertial_regressor(self.body.chain, shapes[part], rates[part])
            found = regressor.inertia_and_momentum(self.masses, self.centres, self.tensors)
            inertia[:, part], momentum[:, part] = found
        return inertia, momentum

    @cached_property
    def rows(self) -> Array:
        """The rows of each, as `LinkRows` has those of one body: (N, k + 1, 22), made when first needed."""
        own = self.body.chain.rows
        rows = np.empty((len(self), *own.rows.shape))
        rows[..., :GEOMETRY] = own.rows[:, :GEOMETRY]
        rows[..., GEOMETRY:] = inertial_numbers(own.bases, self.masses, self.centres, self.tensors)
        return read_only(rows)
