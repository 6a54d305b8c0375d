"""Where a CasADi function could have a compiled twin; it has none."""

from __future__ import annotations

from typing import Any


def compiled_or_interpreted(function: Any) -> Any:
    """The function itself."""
    return function
