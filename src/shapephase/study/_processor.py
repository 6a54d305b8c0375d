"""What computes: processor and host, and the versions on which the bits of results depend."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..integrator.machine_code import is_used
from ..provenance import provenance

_PINNED = ("shapephase", "numpy", "scipy", "pin", "python")


@lru_cache(maxsize=1)
def processor_text() -> str:
    """For example "x86_64, AMD EPYC 9B14, machine code, node7"."""
    name = platform.processor()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.lower().startswith("model name"):
                name = line.partition(":")[2].strip()
                break
    code = "machine code" if is_used() else "interpreted"
    return ", ".join(part for part in (platform.machine(), name, code, platform.node()) if part)


def computing_versions() -> dict[str, Any]:
    """Versions on which the bits of results depend, and whether machine code is used."""
    said = provenance()["versions"]
    # Interpreted motions sample with Pinocchio, which rounds differently.
    return {**{name: said[name] for name in _PINNED}, "machine code": is_used()}


def other_versions(begun: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Where versions differ, both named, for example "numpy 2.4.6 in the study and 2.4.5 here"; else nothing."""
    pairs = {name: (begun.get(name), said) for name, said in here.items()}
    return ", ".join(
        f"{name} {first} in the study and {said} here" for name, (first, said) in pairs.items() if first != said
    )
