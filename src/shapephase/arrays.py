"""Array types and the checks every public entry makes once; inside the library arrays are trusted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ShapeError
from .letters import value_text

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]

AnyArray = TypeVar("AnyArray", Array, Integers, Mask)
Kind = TypeVar("Kind", bound=type)

FARTHEST = 1e6


def finite_array(value: ArrayLike, name: str, trailing: tuple[int | None, ...] = (), *, unit: str = "") -> Array:
    """A float64 array in native byte order whose last axes are `trailing` (None: any length), all finite.

    Raises ShapeError for text, objects, complex numbers, masked entries, a wrong shape, NaN or infinity; the message
    names the argument, the shape that came and the first bad entry.
    """
    array = real_array(value, name, unit)
    last = array.shape[max(0, array.ndim - len(trailing)) :]
    if last != trailing and (
        len(last) < len(trailing)
        or any(want is not None and have != want for want, have in zip(trailing, last, strict=True))
    ):
        raise ShapeError(f"{name}: expected shape {_shape_text(trailing)}{_in(unit)}, got {array.shape}")
    check_finite(array, name)
    return array


def check_finite(array: Array, name: str) -> None:
    """Raise `ShapeError` naming the first entry that is NaN or infinite."""
    if np.count_nonzero(np.isfinite(array)) < array.size:
        if not array.ndim:
            raise ShapeError(f"{name}: a finite number is needed, got {array}")
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ShapeError(f"{name}: entry {list(where)} is {array[where]}; every entry must be a finite number")


def check_reach(array: Array, name: str) -> None:
    """Raise `ShapeError` for joint coordinates or rates beyond 1e6: there the digits of an angle are lost."""
    if array.size and np.abs(array).max() > FARTHEST:
        where = tuple(int(i) for i in np.argwhere(np.abs(array) > FARTHEST)[0])
        raise ShapeError(f"{name}: entry {list(where)} is {array[where]:.6g}; joints go up to {FARTHEST:g} rad, m (/s)")


def common_shape(**arrays: Array) -> tuple[int, ...]:
    """The shape that arguments broadcast to. Raises ShapeError, which names them, if they do not broadcast."""
    return _broadcast("shapes", {name: array.shape for name, array in arrays.items()})


def common_batch(**leading: tuple[int, ...]) -> tuple[int, ...]:
    """The shape that leading axes broadcast to. Raises ShapeError, which names their owners, if they do not."""
    return _broadcast("leading axes", leading)


def _broadcast(kind: str, shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ShapeError(f"{listed}: the {kind} do not broadcast together") from None


def real_array(value: Any, name: str, unit: str = "") -> Array:
    """A float64 array in native byte order of any shape. Raises ShapeError for what holds no real numbers."""
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ShapeError(f"{name}: masked entries cannot be used; fill or drop them first")
    try:
        raw = np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name}: expected numbers{_in(unit)} in one rectangular array ({error})") from None
    if raw.dtype.kind not in "fiub":
        came = value_text(value)
        if isinstance(value, list | tuple | np.ndarray):
            odd = next((one for one in raw.flat if not isinstance(one, int | float | np.number)), None)
            came = f"an array of {raw.dtype}" + ("" if odd is None else f" with {value_text(odd)} in it")
        raise ShapeError(f"{name}: expected real numbers{_in(unit)}, got {came}")
    return np.ascontiguousarray(raw, dtype=np.float64).reshape(raw.shape)


def _shape_text(trailing: tuple[int | None, ...]) -> str:
    return "(..., " + ", ".join("N" if n is None else str(n) for n in trailing) + ")" if trailing else "(...)"


def _in(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def read_only(array: AnyArray) -> AnyArray:
    """A view of an array that cannot be written to; the array itself stays as it is."""
    view = array.view()
    view.setflags(write=False)
    return view


def lock_arrays(result: Any) -> None:
    """Show the arrays among the fields of a frozen dataclass as read-only views: what they mean would change else."""
    fields = result.__dict__
    for name, value in fields.items():
        if type(value) is np.ndarray:
            # `read_only` in place, as thousands of results are made in a second.
            fields[name] = view = value.view()
            view.setflags(write=False)


class _CopiedField:
    """A field of a dataclass that comes back as a copy of the array that it holds."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, result: Any, kind: type | None = None) -> Array:
        if result is None or self._name not in result.__dict__:
            raise AttributeError(self._name)
        return result.__dict__[self._name].copy()

    def __set__(self, result: Any, value: Array) -> None:
        result.__dict__[self._name] = value


def copied_when_read(*names: str) -> Callable[[Kind], Kind]:
    """A dataclass whose arrays of these names come back as copies that can be written to, and change nothing.

    For attitudes: `Rotation.from_matrix` of SciPy before 1.16 refuses arrays that are locked.
    """

    def with_copies(kind: Kind) -> Kind:
        for name in names:
            setattr(kind, name, _CopiedField(name))
        return kind

    return with_copies
