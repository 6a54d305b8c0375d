"""What is computed for a batch of motions whose samples and steps differ: part by part, and put together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from ..arrays import Array
from ..integrator.many_rotations import assembled
from ..reconstruction.reconstruction import Motion

Result = TypeVar("Result")


def by_parts(motion: Motion, compute: Callable[[Motion], Result], shared: tuple[str, ...] = ()) -> Result:
    """A function of a motion for every part of it.

    Parameters
    ----------
    compute : motion of a batch (n,) -> a dataclass whose arrays have that axis in front
    shared : fields of the result that do not
    """
    parts = [(rows, compute(part)) for rows, part in motion.parts]
    first: Any = parts[0][1]
    given = {field.name: getattr(first, field.name) for field in fields(first) if field.name not in shared}
    names = [name for name, value in given.items() if isinstance(value, np.ndarray)]
    return replace(
        first, **{name: _whole(motion, [(rows, getattr(one, name)) for rows, one in parts]) for name in names}
    )


def array_by_parts(motion: Motion, compute: Callable[[Motion], Array]) -> Array:
    """The same of a function whose result is an array."""
    return _whole(motion, [(rows, compute(part)) for rows, part in motion.parts])


def _whole(motion: Motion, parts: list[Any]) -> Array:
    whole = assembled(parts)
    return whole.reshape(*motion.batch, *whole.shape[1:])
