"""Data of a page: JSON, whose arrays stand together in one compressed block of bytes."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from .._letters import printable

# Arrays begin at multiples of this many bytes, as browsers need them.
_ALIGNED = 8
# Effort of the compression, of 9: more is much slower and hardly smaller.
_EFFORT = 6
# Letters that would end the element that the text stands in, and how JSON can write them.
_ESCAPES = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"})


def packed(data: Mapping[str, Any]) -> tuple[str, str]:
    """JSON of data, and base 64 of the bytes of all arrays in it; of reals as they are, or as their dtype says.

    Names are written as they can be printed, and numbers that are not finite become null.
    """
    block = bytearray()
    text = json.dumps(_plain(data, block, {}), separators=(",", ":"))
    return text.translate(_ESCAPES), base64.b64encode(zlib.compress(bytes(block), _EFFORT)).decode()


def _plain(value: Any, block: bytearray, known: dict[int, Any]) -> Any:
    if isinstance(value, np.ndarray):
        # Visuals of one file share their arrays.
        if id(value) not in known:
            known[id(value)] = _placed(value, block), value
        return known[id(value)][0]
    if isinstance(value, Mapping):
        return {key: _plain(entry, block, known) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, block, known) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return printable(value) if isinstance(value, str) else value


def _placed(array: np.ndarray, block: bytearray) -> dict[str, Any]:
    start = len(block)
    block += np.ascontiguousarray(array).tobytes()
    block += bytes(-len(block) % _ALIGNED)
    return {"array_kind": array.dtype.name, "start": start, "length": array.size}
