"""What a study varies: the axes by name, checked, and the numbers of its cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import so3
from ..arguments import tolerance_argument
from ..arrays import Array, Integers, finite_array
from ..deformation.frames import gauge_link
from ..errors import StudyError, unknown_name
from ..letters import what_came
from .distributions import Distribution, Normal, drawn_values

COMPONENTS = ("momentum_x", "momentum_y", "momentum_z")
LABELS = ("body", "motion", "gauge")
"""Axes of names, not of numbers."""
LONGEST_NAME = 200
"""Characters of what is varied or known: folders of the store have these names."""
OF_PARTS: Mapping[str, tuple[int, ...]] = {"masses": (), "centres": (3,), "inertias": ()}
UNITS = {
    "momentum": "kg m^2/s",
    **dict.fromkeys(COMPONENTS, "kg m^2/s"),
    "tolerance": "rad",
    "joint_noise": "rad or m",
    "masses": "",
    "centres": "radii of gyration",
    "inertias": "",
    "attitude": "",
}
"""Of the numbers of an axis."""
_SHAPES = {"momentum": (3,), "attitude": (4,)}


@dataclass(frozen=True, eq=False)
class Axis:
    """One thing that is varied.

    Attributes
    ----------
    name : of it
    shape : of one value
    grid : (n,) + shape values of a grid, or labels; None where it is drawn
    distribution : or what it is drawn from
    """

    name: str
    shape: tuple[int, ...]
    grid: Array | tuple[Any, ...] | None
    distribution: Distribution | None

    @property
    def unit(self) -> str:
        """Of its numbers."""
        return unit_of(self.name)

    def values(self, seed: int, cases: Integers, places: Integers) -> Any:
        """In some cases, which are at these places of the grid: (N,) + shape, or labels."""
        if self.distribution is not None:
            return drawn_values(seed, self.name, cases, self.distribution, self.shape)
        if isinstance(self.grid, tuple):
            return [self.grid[place] for place in places.tolist()]
        assert self.grid is not None
        return self.grid[places]


def unit_of(name: str) -> str:
    """Of the numbers of an axis; of a parameter it is not known."""
    return UNITS.get(name.partition(".")[0], "")


def checked_axis(name: str, given: Any, parts: int, parameters: Sequence[str]) -> Axis:
    """An axis of a study.

    Parameters
    ----------
    parts : moving parts of the body
    parameters : of the motion's function

    Raises
    ------
    UnknownNameError, StudyError, ShapeError
    """
    lead, _, _ = name.partition(".")
    if len(name) > LONGEST_NAME:
        raise StudyError(f"over: a name of {len(name)} characters, {name[:20]!r}...; use {LONGEST_NAME} at most")
    if lead not in (*UNITS, *LABELS) and name not in parameters:
        raise unknown_name("axis in over", name, (*UNITS, *LABELS, *parameters))
    if name in LABELS:
        check_labels(name, given)
        if name == "gauge":
            for one in given:
                gauge_link(one)
        return Axis(name, (), tuple(given), None)
    shape = _shape(name, parts)
    if hasattr(given, "drawn"):
        # A turn of the start is normal, not the quaternion.
        shape = (3,) if name == "attitude" and isinstance(given, Normal) else shape
        given.check(f"over.{name}", shape)
        return Axis(name, shape, None, given)
    try:
        size = len(given)
    except TypeError:
        raise StudyError(f"over.{name}: a grid of values or a distribution is needed, got {what_came(given)}") from None
    if not size:
        raise StudyError(f"over.{name}: a grid needs one value or more")
    values = finite_array(given, f"over.{name}")
    if values.shape[1:] not in ((), shape):
        raise StudyError(f"over.{name}: values of shape {shape} are needed, got {values.shape[1:]}")
    if values.shape[1:] != shape:
        if name in _SHAPES:
            raise StudyError(f"over.{name}: values of shape {shape} are needed, got single numbers")
        values = np.broadcast_to(values.reshape(-1, *(1,) * len(shape)), (size, *shape)).copy()
    if name == "attitude":
        so3.quat_argument(values, "over.attitude")
    if name == "tolerance":
        for one in values.tolist():
            tolerance_argument(one)
    return Axis(name, shape, values, None)


def check_labels(name: str, given: object) -> None:
    """Raise StudyError for what is no list of one label or more."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise StudyError(f"over.{name}: a list of names is needed, got {what_came(given)}")
    if not len(given):
        raise StudyError(f"over.{name}: a grid needs one value or more")


def start_attitudes(values: Array, base: Array | None) -> Array:
    """Attitudes from quaternions (N, 4), or from turns (N, 3) of the base attitude: (N, 3, 3)."""
    if values.shape[-1] == 4:
        return so3.matrix_from_quat(so3.normalised(values))
    # One by one, so that each has the bits that it has alone.
    turns = np.array([so3.exp(one) for one in values]).reshape(-1, 3, 3)
    return turns if base is None else np.array([base @ one for one in turns]).reshape(-1, 3, 3)


def _shape(name: str, parts: int) -> tuple[int, ...]:
    lead, _, link = name.partition(".")
    if lead not in OF_PARTS:
        return _SHAPES.get(name, ())
    return OF_PARTS[lead] if link else (parts, *OF_PARTS[lead])
