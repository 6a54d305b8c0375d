"""What lower folders ask of functions of higher ones: methods such as `motion.plot()`, and motions by their names.

A folder imports only from folders on lower lines, so a method of a motion cannot import plotting. The package, which
is above all folders, registers the functions by name when it is imported; they are loaded at their first call.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_OFFERS: dict[str, tuple[str, str]] = {}


def offer(method: str, module: str, function: str) -> None:
    """Register the function of a module that implements a method, "Class.method", or has the name given."""
    _OFFERS[method] = module, function


def offered(method: str) -> Callable[..., Any]:
    """Return a function that is registered, loaded now."""
    module, function = _OFFERS[method]
    return getattr(importlib.import_module(module), function)
