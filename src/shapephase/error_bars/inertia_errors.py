"""Errors of the inertias of links, as error bars take them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..arguments import made_by
from ..display import short_repr


@made_by("InertiaErrors(masses=0.05), for example")
@dataclass(frozen=True, kw_only=True)
class InertiaErrors:
    """Relative standard deviations of the inertias of links, independent of each other.

    Each is one number for all moving links, or a mapping from names of links.

    Attributes
    ----------
    masses : of the mass, with which the rotational inertia grows
    centres : of each coordinate of the centre of mass, in radii of gyration of the link
    inertias : of the rotational inertia as a whole, the mass being as it is

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.uncertainty(motion, inertias=sp.InertiaErrors(masses=0.05))
    >>> print(f"{found.dynamic_phase:.4f} rad")
    0.0107 rad
    """

    masses: float | Mapping[str, float] = 0.0
    centres: float | Mapping[str, float] = 0.0
    inertias: float | Mapping[str, float] = 0.0

    __repr__ = short_repr
