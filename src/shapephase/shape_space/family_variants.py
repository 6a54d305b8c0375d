"""The bodies of a family along one path, as the integrator takes them side by side."""

from __future__ import annotations

from ..arrays import Array, Integers, Mask
from ..body.family import BodyFamily
from ..integrator import machine_code
from ..integrator.families import many_inverted
from ..integrator.link_tree import trees_channels
from ..integrator.sampling import Sampler
from .body_path import path_sampler
from .shape_path import ShapePath


class FamilyVariants:
    """The bodies of a family along one path with columns in their order, planned by the one they were made from."""

    def __init__(self, family: BodyFamily, path: ShapePath) -> None:
        self._family, self._path = family, path
        self.model = path_sampler(family.body, path)

    def __len__(self) -> int:
        """How many they are."""
        return len(self._family)

    def channels(self, rows: Integers, times: Array) -> tuple[Array, Mask]:
        """I^-1 and I^-1 L_o of some at times, and which can be relied on: (V,), (S,) -> (V, S, 9), (V,)."""
        shapes, rates = self._path.at_samples(times)
        if machine_code.is_used() and self._family.body.chain.has_rows:
            masses = self._family.mass[rows]
            return trees_channels(self._family.body.chain.rows, self._family.rows[rows], masses, shapes, rates)
        return many_inverted(*self._family.some(rows).sample(shapes, rates), times)

    def alone(self, row: int) -> Sampler:
        """Of one of them."""
        return path_sampler(self._family[row], self._path)
