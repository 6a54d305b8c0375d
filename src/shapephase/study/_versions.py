"""Processor and versions, on which the bits of results depend."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..integrator.machine_code import is_used
from ..provenance import provenance


@lru_cache(maxsize=1)
def processor_text() -> str:
    """Return processor and host, for example "x86_64, AMD EPYC 9B14, machine code, node7"."""
    name = platform.processor()
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        name = next(line.partition(":")[2].strip() for line in lines if line.lower().startswith("model name"))
    code = "machine code" if is_used() else "interpreted"
    return ", ".join(text for text in (platform.machine(), name, code, platform.node()) if text)


def computing_versions() -> dict[str, Any]:
    """Return the versions on which the bits of results depend, and whether machine code is used."""
    # Interpreted motions sample with Pinocchio, which rounds differently.
    return {**provenance()["versions"], "machine code": is_used()}


def version_differences(begun: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Return what differs, for example "numpy 2.4.6 in the study and 2.4.5 here"; empty where nothing does."""
    pairs = {name: (begun.get(name), version) for name, version in here.items()}
    return ", ".join(f"{name} {old} in the study and {new} here" for name, (old, new) in pairs.items() if old != new)
