"""What is computed for a batch of motions whose samples and steps differ: part by part, and put together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from ..arrays import Array
from ..integrator.many_rotations import assembled
from ..reconstruction.reconstruction import Motion
from ._deferred import Deferred

Result = TypeVar("Result")


def by_parts(motion: Motion, compute: Callable[[Motion], Result], shared: tuple[str, ...] = ()) -> Result:
    """A function of a motion for every part of it.

    Parameters
    ----------
    compute : motion of a batch (n,) -> a dataclass whose arrays, also those of dataclasses in it, have that axis in
        front
    shared : fields of the result that do not
    """
    return _joined(motion, [(rows, compute(part)) for rows, part in motion.parts], shared)


def _joined(motion: Motion, parts: list[Any], shared: tuple[str, ...] = ()) -> Any:
    first: Any = parts[0][1]
    if isinstance(first, np.ndarray):
        return _whole(motion, parts)
    if isinstance(first, Deferred):
        return Deferred(lambda: _joined(motion, [(rows, one.value) for rows, one in parts]))
    if not is_dataclass(first):
        return first
    names = [field.name for field in fields(first) if field.name not in shared]
    each = {name: [(rows, getattr(one, name)) for rows, one in parts] for name in names}
    return type(first)(**vars(first) | {name: _joined(motion, values) for name, values in each.items()})


def array_by_parts(motion: Motion, compute: Callable[[Motion], Array]) -> Array:
    """Apply a function with an array as result to the parts of a motion and join the rows."""
    return _whole(motion, [(rows, compute(part)) for rows, part in motion.parts])


def _whole(motion: Motion, parts: list[Any]) -> Array:
    whole = assembled(parts)
    return whole.reshape(*motion.batch, *whole.shape[1:])
