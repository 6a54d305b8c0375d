"""Results for a batch of motions whose samples and steps differ: computed part by part, and deferred to first use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cached_property, partial
from typing import Any, Generic, TypeVar

import numpy as np

from ..integrator.many_rotations import assembled
from ..reconstruction.reconstruction import Motion

Result = TypeVar("Result")


class Deferred(Generic[Result]):
    """A result to be computed at its first use; a pickled copy has it already."""

    def __init__(self, compute: Callable[[], Result]) -> None:
        self._compute = compute

    @cached_property
    def value(self) -> Result:
        """The result."""
        return self._compute()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the result: its inputs may not be picklable."""
        return Deferred, (partial(_known, self.value),)


def _known(value: Result) -> Result:
    return value


def by_parts(motion: Motion, compute: Callable[[Motion], Result], shared: tuple[str, ...] = ()) -> Result:
    """Result of a function of a motion, computed for every part of it.

    `compute` takes a motion of a batch (n,) to an array, or a dataclass whose arrays, also those of dataclasses in it,
    have that axis in front, but for its `shared` fields.
    """
    return _joined(motion, [(rows, compute(part)) for rows, part in motion.parts], shared)


def _joined(motion: Motion, parts: list[Any], shared: tuple[str, ...] = ()) -> Any:
    first: Any = parts[0][1]
    if isinstance(first, np.ndarray):
        whole = assembled(parts)
        return whole.reshape(*motion.batch, *whole.shape[1:])
    if isinstance(first, Deferred):
        return Deferred(lambda: _joined(motion, [(rows, deferred.value) for rows, deferred in parts]))
    if not is_dataclass(first):
        return first
    names = [field.name for field in fields(first) if field.name not in shared]
    joined = {name: _joined(motion, [(rows, getattr(result, name)) for rows, result in parts]) for name in names}
    return type(first)(**vars(first) | joined)
