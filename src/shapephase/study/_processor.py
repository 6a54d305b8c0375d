"""What computes: the type of the processor, and whether machine code is used."""

from __future__ import annotations

import contextlib
import platform
from functools import lru_cache
from pathlib import Path

from ..integrator.machine_code import is_used


@lru_cache(maxsize=1)
def processor_text() -> str:
    """For example "x86_64, AMD EPYC 9B14, machine code"."""
    name = platform.processor()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.lower().startswith("model name"):
                name = line.partition(":")[2].strip()
                break
    code = "machine code" if is_used() else "interpreted"
    return ", ".join(part for part in (platform.machine(), name, code) if part)
