"""What objects of lower rooms can do by means of higher ones, as `motion.plot()`: which function does it.

A folder imports only from folders on lower lines, so a method of a motion cannot import what draws it. The package,
which is above all rooms, offers the functions by name when it is imported; they are loaded when they are first called.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_OFFERS: dict[str, tuple[str, str]] = {}


def offer(method: str, module: str, function: str) -> None:
    """Let a method, "Class.method", be done by a function of a module, which need not be loaded yet."""
    _OFFERS[method] = module, function


def offered(method: str) -> Callable[..., Any]:
    """The function that does it, loaded now."""
    module, function = _OFFERS[method]
    return getattr(importlib.import_module(module), function)
