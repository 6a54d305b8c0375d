"""Which of many values are left to long runs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def full_but(values: Iterable[Any], *quick: Any) -> list[Any]:
    """The values as parameters of a test; those that are not among the quick ones are left to `make full`.

    A tuple is a value for each of several parameters.
    """
    listed = list(values)
    unknown = [value for value in quick if value not in listed]
    assert not unknown, f"not among the values: {unknown}"
    return [value if value in quick else _left_to_full(value) for value in listed]


def _left_to_full(value: Any) -> Any:
    return pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.full)
