"""Results that are computed when they are first looked at."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")


class Deferred(Generic[Result]):
    """A result to be; a copy of it in another process has it already.

    Parameters
    ----------
    compute : called once
    """

    def __init__(self, compute: Callable[[], Result]) -> None:
        self._compute = compute

    @cached_property
    def value(self) -> Result:
        """The result."""
        return self._compute()

    def __reduce__(self) -> tuple[Any, ...]:
        """Known from now on: what it is computed from may not be fit to be sent."""
        return Deferred, (partial(_known, self.value),)


def _known(value: Result) -> Result:
    return value
