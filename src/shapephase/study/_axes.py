"""What a study varies: its axes by name, checked, and their values in some cases."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import so3
from ..arguments import tolerance_argument
from ..arrays import Array, Integers, finite_array
from ..deformation.frames import gauge_link
from ..errors import StudyError, unknown_name
from ..letters import value_text
from .distributions import Distribution, Normal, drawn_values

COMPONENTS = ("momentum_x", "momentum_y", "momentum_z")
OF_PARTS = ("masses", "centres", "inertias")
LABELS = ("body", "motion", "gauge")  # axes of names
# Units and shapes of numbers that are varied; -1 stands for the moving parts of the body.
QUANTITIES: dict[str, tuple[str, tuple[int, ...]]] = {
    "momentum": ("kg m^2/s", (3,)),
    **dict.fromkeys(COMPONENTS, ("kg m^2/s", ())),
    "tolerance": ("rad", ()),
    "joint_noise": ("rad or m", ()),
    "masses": ("", (-1,)),
    "centres": ("radii of gyration", (-1, 3)),
    "inertias": ("", (-1,)),
    "attitude": ("", (4,)),
}
LONGEST_NAME = 200  # characters: folders of the store have the names of axes and outputs


class Axis(NamedTuple):
    """A quantity that is varied, over a grid (n,) + shape or from a distribution; or a list of labels."""

    name: str
    shape: tuple[int, ...] = ()
    grid: Array | None = None
    distribution: Distribution | None = None
    labels: tuple[Any, ...] = ()

    @property
    def grid_length(self) -> int | None:
        """Number of values of the grid or list; None for a distribution."""
        return len(self.labels) or (None if self.grid is None else len(self.grid))

    def values(self, seed: int, cases: Integers, places: Integers) -> Array:
        """Return (N,) + shape values in cases at these places of the grid; the places themselves for labels."""
        if self.distribution is not None:
            return drawn_values(seed, self.name, cases, self.distribution, self.shape)
        return places.astype(float) if self.grid is None else self.grid[places]


def unit_of(name: str) -> str:
    """Return the unit of an axis, which is not known of a parameter."""
    return QUANTITIES.get(name.partition(".")[0], ("", ()))[0]


def check_name(name: object, entry: str) -> None:
    """Raise StudyError for a name that no folder of a store can have."""
    if not isinstance(name, str):
        raise StudyError(f"{entry}: a name is needed, got {value_text(name)}")
    if len(name) > LONGEST_NAME:
        raise StudyError(f"{entry}: a name of {len(name)} characters, {name[:20]!r}...; use {LONGEST_NAME} at most")


def check_labels(name: str, given: object) -> None:
    """Raise StudyError for anything but a list of one label or more."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise StudyError(f"over.{name}: a list of names is needed, got {value_text(given)}")
    if not len(given):
        raise StudyError(f"over.{name}: a grid needs one value or more")


def checked_axis(name: str, given: Any, parts: int, parameters: Sequence[str]) -> Axis:
    """Return an axis of a study, whose body has so many moving parts and whose motion these parameters.

    Raises UnknownNameError, StudyError, ShapeError.
    """
    lead, _, link = name.partition(".")
    if lead not in (*QUANTITIES, *LABELS) and name not in parameters:
        raise unknown_name("axis in over", name, (*QUANTITIES, *LABELS, *parameters))
    if name in LABELS:
        for label in given if name == "gauge" else ():
            gauge_link(label)
        return Axis(name, labels=tuple(given))
    _, shape = QUANTITIES.get(lead if lead in OF_PARTS else name, ("", ()))
    shape = shape[1:] if link and lead in OF_PARTS else tuple(parts if length < 0 else length for length in shape)
    if isinstance(given, Distribution):
        # A normal attitude is a turn of the start, a rotation vector.
        shape = (3,) if name == "attitude" and isinstance(given, Normal) else shape
        given.check(f"over.{name}", shape)
        return Axis(name, shape, distribution=given)
    try:
        count = len(given)
    except TypeError:
        raise StudyError(
            f"over.{name}: a grid of values or a distribution is needed, got {value_text(given)}"
        ) from None
    if not count:
        raise StudyError(f"over.{name}: a grid needs one value or more")
    values = finite_array(given, f"over.{name}")
    if values.shape[1:] != shape and (values.ndim > 1 or lead not in OF_PARTS):
        came = str(values.shape[1:]) if values.ndim > 1 else "single numbers"
        raise StudyError(f"over.{name}: values of shape {shape} are needed, got {came}")
    if values.shape[1:] != shape:
        values = np.broadcast_to(values.reshape(-1, *(1,) * len(shape)), (count, *shape)).copy()
    if name == "attitude":
        so3.quat_argument(values, "over.attitude")
    for tolerance in values.tolist() if name == "tolerance" else ():
        tolerance_argument(tolerance)
    return Axis(name, shape, values)


def start_attitudes(values: Array, base: Array | None) -> list[Array]:
    """Return attitudes (3, 3) from quaternions (N, 4), or from rotation vectors (N, 3) that turn the base attitude."""
    if values.shape[-1] == 4:
        return list(so3.matrix_from_quat(so3.normalised(values)))
    # One by one, so that each has the bits that it has alone.
    turns = [so3.exp(vector) for vector in values]
    return turns if base is None else [base @ turn for turn in turns]
