"""Methods of classes in lower folders that functions of higher folders implement, such as `motion.plot()`.

A folder imports only from folders on lower lines, so a method of a motion cannot import plotting. The package, which
is above all folders, registers the functions by name when it is imported; they are loaded at their first call.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_OFFERS: dict[str, tuple[str, str]] = {}


def offer(method: str, module: str, function: str) -> None:
    """Register the function of a module that implements a method, "Class.method"."""
    _OFFERS[method] = module, function


def offered(method: str) -> Callable[..., Any]:
    """Return the function that implements a method, loaded now."""
    module, function = _OFFERS[method]
    return getattr(importlib.import_module(module), function)
