"""Bodies with the same joints and other masses, centres of mass and rotational inertias, which are checked here."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import made_by, on_unphysical_argument
from ..arrays import Array, Integers, Mask, finite_array, lock_arrays
from ..errors import ShapeError, UnphysicalInertiaError, UnphysicalInertiaWarning, unknown_name
from ..inertia_tensor import second_moment
from ..letters import value_text
from .inertial_regressor import OUTPUTS, PARAMETERS, inertial_regressor
from .joint_chain import JointChain
from .link_tree import LEAST_MASS, MOST_MASS, NEGATIVE, ROUNDING, TRIANGLE

if TYPE_CHECKING:
    from .body import Body

_AT_ONCE = 10_000_000  # numbers of regressors in one pass: 80 MB


@made_by(Body="take one of its bodies, family[0]")
@dataclass(frozen=True, eq=False)
class BodyFamily(Sequence["Body"]):
    """N bodies that differ in their inertias only: a sequence of them, made by `Body.with_inertias`.

    `articulated` and `reconstruct` take it as they take a body.

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
        """One of the bodies, made on access, or a family of those of a slice."""
        if isinstance(index, slice):
            return self.some(index)
        if not isinstance(index, int | np.integer):
            raise ShapeError(f"a body of a family is family[0], family[1] ..., got family[{value_text(index)}]")
        return self.body.with_frame_inertias(self.masses[index], self.centres[index], self.tensors[index])

    def some(self, rows: slice | Integers) -> BodyFamily:
        """A family of some of the bodies."""
        return BodyFamily(self.body, self.masses[rows], self.centres[rows], self.tensors[rows])

    def __repr__(self) -> str:
        """One line for people."""
        return f"BodyFamily({len(self)} x {self.body!r})"

    @property
    def mass(self) -> Array:
        """Mass of each body: (N,) [kg]."""
        return self.masses.sum(axis=-1)

    def sample(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """I and L_o of all along a trajectory: (S, n), (S, n) -> (N, S, 3, 3), (N, S, 3). Unchecked."""
        inertia, momentum = np.empty((len(self), len(shapes), 3, 3)), np.empty((len(self), len(shapes), 3))
        at_once = max(1, _AT_ONCE // (PARAMETERS * OUTPUTS * self.masses.shape[1]))
        for first in range(0, len(shapes), at_once):
            part = slice(first, first + at_once)
            regressor = inertial_regressor(self.body.chain, shapes[part], rates[part])
            values = regressor.inertia_and_momentum(self.masses, self.centres, self.tensors)
            inertia[:, part], momentum[:, part] = values
        return inertia, momentum


_ASYMMETRY = 1e-9  # of the largest entry, between mirrored ones: printed digits
_UNITS = {"masses": "kg", "centres": "m", "inertias": "kg m^2"}
_ITEMS: dict[str, tuple[int, ...]] = {"masses": (), "centres": (3,), "inertias": (3, 3)}


Given = ArrayLike | Mapping[str, ArrayLike] | None


def given_inertias(
    chain: JointChain,
    parts: tuple[tuple[str, ...], ...],
    given: Mapping[str, Given],
    on_unphysical: str,
) -> tuple[Array, Array, Array]:
    """Masses, centres and tensors of a body's frames with those that are given in the place of its own.

    (..., k + 1) [kg], (..., k + 1, 3) [m], (..., k + 1, 3, 3) about the centres [kg m^2], in axes of the frames; the
    leading axis, if there is one, counts bodies.

    parts : names of the links of each moving part
    given : "masses", "centres" and "inertias", each as `Body.with_inertias` takes them
    """
    on_unphysical_argument(on_unphysical)
    chosen = {name: _by_part(value, name, parts) for name, value in given.items() if value is not None}
    batch = _batch(chosen, parts)
    masses, centres, tensors = (
        np.broadcast_to(own, (*batch, *own.shape)).copy() for own in (chain.masses, chain.centres, chain.inertias)
    )
    for part, value in chosen.get("masses", {}).items():
        frame, _ = chain.link_frames[parts[part][0]]
        masses[..., frame] = _checked_masses(value, parts[part][0], may_vanish=not chain.masses[frame])
    for part, value in chosen.get("centres", {}).items():
        frame, pose = chain.link_frames[parts[part][0]]
        centres[..., frame, :] = value @ pose[:3, :3].T + pose[:3, 3]
    faults: list[str] = []
    for part, value in chosen.get("inertias", {}).items():
        frame, pose = chain.link_frames[parts[part][0]]
        extent = (centres[..., frame, :] ** 2).sum(axis=-1) * masses[..., frame]
        symmetric, doubts = _checked_tensors(value, parts[part][0], float(np.max(extent, initial=0.0)))
        tensors[..., frame, :, :] = pose[:3, :3] @ symmetric @ so3.transpose(pose[:3, :3])
        faults += doubts
    if faults and on_unphysical == "error":
        raise UnphysicalInertiaError("; ".join(faults) + "; correct it, or pass on_unphysical='warn'")
    if faults and on_unphysical == "warn":
        warnings.warn("; ".join(faults), UnphysicalInertiaWarning, stacklevel=3)
    return masses, centres, tensors


def _by_part(value: Any, name: str, parts: tuple[tuple[str, ...], ...]) -> dict[int, Array]:
    """Given values by number of the part."""
    item, unit = _ITEMS[name], _UNITS[name]
    if not isinstance(value, Mapping):
        array = finite_array(value, name, (len(parts), *item), unit=unit)
        if array.ndim > len(item) + 2:
            raise ShapeError(f"{name}: at most one leading axis, the number of bodies, is possible, got {array.shape}")
        return dict(enumerate(np.moveaxis(array, array.ndim - 1 - len(item), 0)))
    first = {links[0]: number for number, links in enumerate(parts)}
    leads = {link: links[0] for links in parts for link in links}
    arrays = {}
    for link, entry in value.items():
        if link not in leads:
            raise unknown_name(f"link in {name}", link, first)
        if link not in first:
            raise ShapeError(
                f"{name}: link {link!r} is fixed to {leads[link]!r}: give {leads[link]!r} what both have together, in "
                "its axes, as in `Body.moving_parts`"
            )
        arrays[first[link]] = finite_array(entry, f"{name} of link {link!r}", item, unit=unit)
        if arrays[first[link]].ndim > len(item) + 1:
            raise ShapeError(f"{name} of link {link!r}: one, or one for each body, is needed, got {np.shape(entry)}")
    return arrays


def _batch(chosen: Mapping[str, Mapping[int, Array]], parts: tuple[tuple[str, ...], ...]) -> tuple[int, ...]:
    """() for one body, (N,) for N."""
    counts = {
        len(array): f"{name} of link {parts[part][0]!r} for {len(array)}"
        for name, by_part in chosen.items()
        for part, array in by_part.items()
        if array.ndim > len(_ITEMS[name])
    }
    if len(counts) > 1:
        raise ShapeError(f"all must be for the same number of bodies, got {', '.join(counts.values())}")
    return tuple(counts)


def _checked_masses(masses: Array, link: str, *, may_vanish: bool) -> Array:
    """Raises UnphysicalInertiaError; a part that has no mass may stay without."""
    fine = (masses >= LEAST_MASS) & (masses <= MOST_MASS)
    if may_vanish:
        fine |= masses == 0.0
    if not fine.all():
        where, worst = _first(~fine, masses)
        raise UnphysicalInertiaError(
            f"{where}masses: link {link!r} with {worst:.6g} kg; from {LEAST_MASS:g} to {MOST_MASS:g} kg is needed"
        )
    return masses


def _checked_tensors(tensors: Array, link: str, extent: float) -> tuple[Array, list[str]]:
    """Made exactly symmetric, and what no distribution of mass has. Raises UnphysicalInertiaError."""
    size = np.abs(tensors).max(axis=(-1, -2))
    skew = np.abs(tensors - so3.transpose(tensors)).max(axis=(-1, -2)) > _ASYMMETRY * size
    if skew.any():
        where, _ = _first(skew, size)
        raise UnphysicalInertiaError(f"{where}inertias: the tensor of link {link!r} is not symmetric")
    if (size > MOST_MASS).any():
        where, worst = _first(size > MOST_MASS, size)
        raise UnphysicalInertiaError(f"{where}inertias: link {link!r} with {worst:.6g} kg m^2; up to {MOST_MASS:g}")
    symmetric = 0.5 * (tensors + so3.transpose(tensors))
    doubtful = np.flatnonzero(~_surely_physical(second_moment(symmetric)).reshape(-1))
    moments = np.linalg.eigvalsh(symmetric.reshape(-1, 3, 3)[doubtful])
    floor = ROUNDING * (moments[:, 2] + extent)
    negative = moments[:, 0] < -NEGATIVE * np.maximum(moments[:, 2], 0.0) - floor
    broken = moments[:, 2] - moments[:, 1] - moments[:, 0] > TRIANGLE * moments[:, 2] + floor
    faults = []
    for which, text in (
        (negative, "one of them negative"),
        (broken & ~negative, "which break the triangle inequality"),
    ):
        if which.any():
            row = int(np.argmax(which))
            where = f"body {doubtful[row]}: " if symmetric.ndim > 2 else ""
            faults.append(f"{where}inertias: link {link!r} has principal moments {moments[row]} kg m^2, {text}")
    return symmetric, faults


def _surely_physical(moment: Array) -> Mask:
    """True where second moments are positive definite, by their leading minors: (..., 3, 3) -> (...)."""
    a, b, c = moment[..., 0, 0], moment[..., 1, 1], moment[..., 2, 2]
    d, e, f = moment[..., 1, 2], moment[..., 0, 2], moment[..., 0, 1]
    minor = a * b - f * f
    return (a > 0.0) & (minor > 0.0) & (c * minor + 2.0 * d * e * f - a * d * d - b * e * e > 0.0)


def _first(which: Mask, values: Array) -> tuple[str, float]:
    """The first place where something is true, as a message begins, and the value there."""
    flat = int(np.argmax(np.ravel(which)))
    return (f"body {flat}: " if np.ndim(which) else ""), float(np.ravel(values)[flat])
