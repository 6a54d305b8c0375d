"""One case of a study: the numbers that make it, from which it can be computed by the library's own calls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..arrays import Array, lock_arrays
from ..display import short_repr


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """What a case is made of.

    Attributes
    ----------
    index : of the case
    body, motion : recipes
    parameters : of the motion's function
    momentum : (3,) [kg m^2/s]
    attitude : (3, 3) at the start; None: the identity
    tolerance : [rad]
    gauge : of the split
    masses, inertias : (k,) factors of the moving parts' masses, and of their inertias beside those, or None
    centres : (k, 3) by how much their centres of mass are moved, in radii of gyration, or None
    joint_noise : standard deviation of the noise of the path's samples [rad or m], or None

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1, 0.2]})
    >>> study.case(2).momentum
    array([0. , 0. , 0.2])
    """

    index: int
    body: Any
    motion: Any
    parameters: Mapping[str, float]
    momentum: Array
    attitude: Array | None
    tolerance: float
    gauge: str
    masses: Array | None = None
    centres: Array | None = None
    inertias: Array | None = None
    joint_noise: float | None = None

    __post_init__ = lock_arrays
    __repr__ = short_repr
