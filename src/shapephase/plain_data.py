"""Results as plain data, which JSON can hold."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any


def plain(result: Any) -> dict[str, Any]:
    """Return the shown fields of a dataclass: arrays become lists, dataclasses dictionaries, infinite limits null."""
    return {field.name: _as_json(getattr(result, field.name)) for field in fields(result) if field.repr}


def _as_json(value: Any) -> Any:
    value = value.tolist() if hasattr(value, "tolist") else plain(value) if is_dataclass(value) else value
    if isinstance(value, dict):
        return {key: _as_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_as_json(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
