"""What is computed by kernels beside what is computed on arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from shapephase.integrator.fast import engine


def both(monkeypatch: pytest.MonkeyPatch, run: Callable[[], Any]) -> list[Any]:
    """The same by arrays and by kernels."""
    found = []
    for setting in ("0", "1"):
        monkeypatch.setenv("SHAPEPHASE_FAST", setting)
        assert engine.is_ready() == (setting == "1")
        found.append(run())
    return found
