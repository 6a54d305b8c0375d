"""Attitudes of many deformations along one path, with one momentum each.

Each is sampled and stepped as if there were no others, but for where it begins: on the panels that one of them, the
model, needs, at which all are evaluated together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .. import run_progress
from ..arrays import Array, Integers, Mask
from ..errors import AccuracyNotReached, ShapeError, SingularInertiaError
from .channels import inverted
from .integrate import fresh_times
from .many_rotations import CLASSES, GroupedRotations, rotations_of_each, rounded_up
from .samples import Panels
from .sampling import Sampler, nodes_of_panels
from .stepped import SteppedRotation
from .stepping import magnitudes_and_directions

_AT_ONCE = 64  # deformations evaluated together: enough for the shared work to cost little
_MOST_KEPT = 1_000_000_000  # numbers of all series, which are kept: eight gigabytes


class Variants(Protocol):
    """Deformations along one path, and the one by which they are planned."""

    def __len__(self) -> int:
        """How many they are."""
        ...

    @property
    def model(self) -> Sampler:
        """Sampler of the deformation by which they are planned."""
        ...

    def channels(self, rows: Integers, times: Array) -> tuple[Array, Mask]:
        """I^-1 and I^-1 L_o of some at times, and which are reliable: (V,), (S,) -> (V, S, 9), (V,)."""
        ...

    def alone(self, row: int) -> Sampler:
        """Sampler of one of them."""
        ...


@dataclass(frozen=True, eq=False)
class VariantRotations:
    """S(t) of N deformations, each in a batch of one."""

    rotations: tuple[SteppedRotation, ...]

    def __getitem__(self, row: int) -> SteppedRotation:
        """Rotation of one deformation."""
        return self.rotations[row]

    @property
    def error_estimate(self) -> Array:
        """Estimates of the attitude errors: (N,) [rad]."""
        return np.array([rotation.error_estimate[0] for rotation in self.rotations])

    @property
    def end(self) -> Array:
        """S at the end of the interval: (N, 3, 3)."""
        return np.array([rotation.end[0] for rotation in self.rotations]).reshape(-1, 3, 3)

    @property
    def evaluations(self) -> Integers:
        """How many times each deformation was evaluated: (N,)."""
        return np.array([rotation.interpolant.evaluations for rotation in self.rotations], dtype=np.int64)


def rotations_of_variants(variants: Variants, momentum: Array, tolerance: float) -> VariantRotations:
    """Integrate the attitude equation of each deformation as if there were no others, to a tolerance [rad].

    `momentum` (N, 3) is the body's at the start of each [kg m^2/s]. Raises AccuracyNotReached and SingularInertiaError
    where one deformation alone would; the message has its number.
    """
    count = len(momentum)
    ceilings = rounded_up(magnitudes_and_directions(momentum)[0], CLASSES)
    run_progress.begin(run_progress.STEPPING, max(count, 1))
    rotations: dict[int, SteppedRotation] = {}
    for lot in list(_lots(variants, ceilings, tolerance)):
        for row, sampler in lot.samplers(variants):
            try:
                rotation = rotations_of_each(sampler, momentum[row : row + 1], tolerance)
            except (AccuracyNotReached, SingularInertiaError) as error:
                raise type(error)(f"body {row} of {count}: {error}") from error
            rotations[row] = rotation.finest if isinstance(rotation, GroupedRotations) else rotation
        run_progress.advance(len(lot.rows))
    return VariantRotations(tuple(rotations[row] for row in range(count)))


@dataclass(frozen=True, eq=False)
class _Lot:
    """Deformations that begin on the same panels; None: each on its own."""

    rows: Integers
    panels: Panels | None
    times: tuple[Array, ...] = ()

    def samplers(self, variants: Variants) -> Iterator[tuple[int, Sampler]]:
        """Number and sampler of each, with its channels on the shared panels."""
        rows = self.rows.tolist()
        if self.panels is None:
            yield from ((row, variants.alone(row)) for row in rows)
            return
        channels, reliable = variants.channels(self.rows, np.concatenate(self.times))
        stops = np.cumsum([len(times) for times in self.times])[:-1]
        for row, values, known in zip(rows, channels, reliable, strict=True):
            sampler = variants.alone(row)
            if known:
                sampler.begin_with(self.panels, zip(self.times, np.split(values, stops), strict=True))
            yield row, sampler


def _lots(variants: Variants, ceilings: Array, tolerance: float) -> Iterator[_Lot]:
    """Raise AccuracyNotReached for more than can be kept, before any memory is taken."""
    kept = 0
    for ceiling in np.unique(ceilings).tolist():
        rows = np.flatnonzero(ceilings == ceiling)
        panels, times = None, ()
        try:
            samples = variants.model.samples(ceiling, tolerance)
        except (AccuracyNotReached, SingularInertiaError):
            pass
        else:
            panels = samples.panels
            times = nodes_of_panels(panels), fresh_times(samples.interpolant)[0]
            kept += len(rows) * samples.interpolant.coefficients.size
        if kept > _MOST_KEPT:
            raise AccuracyNotReached(
                f"{len(ceilings)} motions on some {kept // (9 * len(ceilings))} samples each would take "
                f"{8e-9 * kept:.3g} GB; take slices of the family of some "
                f"{int(len(ceilings) * _MOST_KEPT / kept)} bodies"
            )
        for first in range(0, len(rows), _AT_ONCE):
            yield _Lot(rows[first : first + _AT_ONCE], panels, times)


def many_inverted(inertia: Array, momentum: Array, times: Array) -> tuple[Array, Mask]:
    """I^-1 and I^-1 L_o, and which are reliable: (V, S, 3, 3), (V, S, 3), (S,) -> (V, S, 9), (V,)."""
    channels, reliable = np.zeros((*momentum.shape[:2], 9)), np.ones(len(inertia), dtype=np.bool_)
    for place in range(len(inertia)):
        try:
            channels[place] = inverted(inertia[place], momentum[place], times)
        except (SingularInertiaError, ShapeError):
            reliable[place] = False
    return channels, reliable
