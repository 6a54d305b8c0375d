"""Checks of arguments and thresholds that several modules share. Checks raise `ShapeError` unless noted otherwise."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import inertia_argument, number_argument
from ..arrays import Array, Mask, common_shape, finite_array
from ..errors import ShapeError, ShapePhaseError, SingularInertiaError
from ..letters import value_text

SIX_DIGITS = 1e-6  # relative: unit vectors and rates of rotations are often written with six digits
TWELVE_DIGITS = 1e-12  # relative: numbers that agree so far are equal, and ends of a range are met
FEW_ULPS = 16.0 * float(np.finfo(float).eps)  # rounding of eigenvalues and short sums, relative to the largest term
HALVINGS = 60  # of an interval of some radians, which leave rounding
_MOST_TURNS = 1e12  # turns of the body [1]: beyond them twelve of the sixteen digits of the phase are lost


def check_entries(
    bad: Mask, values: Array, name: str, requirement: str, error: type[ShapePhaseError] = ShapeError
) -> None:
    """Raise with the first entry of `values` that is marked in `bad` (...), and with what is required of it."""
    if np.any(bad):
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        value = values[where] if np.ndim(values[where]) else f"{values[where]:.17g}"
        raise error(f"{name}: entry {list(where)} is {value}; {requirement}")


def together(**values: ArrayLike) -> tuple[Array, ...]:
    """Finite numbers (...) each, broadcast to one shape."""
    arrays = {name: finite_array(value, name) for name, value in values.items()}
    shape = common_shape(**arrays)
    return tuple(np.broadcast_to(array, shape) for array in arrays.values())


def ascending_times(times: ArrayLike) -> Array:
    """Times in strictly ascending order, at least one: (N,)."""
    array = finite_array(times, "times", (None,))
    if array.ndim != 1 or not array.size or np.any(np.diff(array) <= 0.0):
        raise ShapeError("times: expected strictly ascending times (N,), the first one that of the start")
    return array


def times_within_turns(t: ArrayLike, longest: float) -> Array:
    """Times (...) [s] that are at most 1e12 turns away; `longest` is the time of one turn [s]."""
    times = finite_array(t, "t", unit="s")
    far = float(np.abs(times).max(initial=0.0))
    if far > _MOST_TURNS * longest:
        raise ShapeError(
            f"t: {far:.6g} s is more than 1e12 turns of this body away, where rounding leaves no digits of the "
            f"attitude; the largest time accepted is {_MOST_TURNS * longest:.6g} s"
        )
    return times


def one_array(value: ArrayLike, name: str, shape: tuple[int, ...], unit: str = "") -> Array:
    """One array of this shape, a copy."""
    array = finite_array(value, name, shape, unit=unit).copy()
    if array.shape != shape:
        raise ShapeError(f"{name}: one array of shape {shape} is needed, got {array.shape}; make one object for each")
    return array


def one_tensor(inertia: ArrayLike) -> Array:
    """One inertia tensor, made exactly symmetric: (3, 3). Raises UnphysicalInertiaError, SingularInertiaError."""
    return inertia_argument(one_array(inertia, "inertia", (3, 3), "kg m^2")[None])[0]


def positive_moments(moments: ArrayLike) -> Array:
    """Principal moments above 0: (..., 3). Raises SingularInertiaError."""
    values = finite_array(moments, "moments", (3,), unit="kg m^2")
    if np.any(values <= 0.0):
        raise SingularInertiaError(f"moments: every principal moment must be above 0, got {values.min():.6g} kg m^2")
    return values


def one_attitude(attitude: ArrayLike | None) -> Array:
    """One rotation, the identity where none is given: (3, 3)."""
    return np.eye(3) if attitude is None else one_array(so3.rotation_argument(attitude, "attitude"), "attitude", (3, 3))


def above_zero(value: ArrayLike, name: str, unit: str = "") -> float:
    """One number above 0."""
    number = number_argument(value, name, unit)
    if not number > 0.0:
        raise ShapeError(f"{name}: one number above 0{f' {unit}' if unit else ''} is needed, got {value_text(value)}")
    return number


def axis_index(axis: object) -> int:
    """Index of a principal axis: 0, 1 or 2."""
    if not isinstance(axis, int | np.integer) or axis not in (0, 1, 2):
        raise ShapeError(f"axis: one of 0, 1, 2 is needed, got {value_text(axis)}")
    return int(axis)


def unit_vectors(value: ArrayLike, name: str) -> Array:
    """Vectors of length 1 to six digits, normalised: (..., 3)."""
    vectors = finite_array(value, name, (3,))
    length = np.linalg.norm(vectors, axis=-1)
    if np.any(np.abs(length - 1.0) > SIX_DIGITS):
        raise ShapeError(f"{name}: a unit vector must have length 1, got {np.ravel(length)[0]:.6g}")
    return so3.normalised(vectors)
