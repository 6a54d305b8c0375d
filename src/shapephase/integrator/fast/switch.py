"""Whether machine code is used: where Numba is installed, unless $SHAPEPHASE_FAST says 0.

In Python it is, from the first reconstruction on. A command line that runs for a second would wait for Numba longer
than it gains, so there only large work switches it on, or SHAPEPHASE_FAST=1.
"""

from __future__ import annotations

import os
from functools import lru_cache
from importlib.util import find_spec

VARIABLE = "SHAPEPHASE_FAST"
"""Environment variable: 0 never, 1 always, else as described above."""
_MANY_MOMENTA = 200
"""Some 0.1 s without machine code, what importing Numba and loading the kernels takes."""
_MANY_SAMPLES = 50_000
"""Of the body, some 0.1 s with Pinocchio: a recording of five thousand rows."""

_waits_for_large_work = False


@lru_cache(maxsize=1)
def is_installed() -> bool:
    """Whether Numba can be imported, without importing it."""
    return find_spec("numba") is not None


def is_allowed() -> bool:
    """Whether machine code may be used in this process."""
    return os.environ.get(VARIABLE, "").strip() != "0" and is_installed()


def is_on() -> bool:
    """Whether machine code is to be used now."""
    return is_allowed() and (not _waits_for_large_work or os.environ.get(VARIABLE, "").strip() == "1")


def wait_for_large_work() -> None:
    """As the command line does: machine code is not used before `expect_work` says that it pays."""
    global _waits_for_large_work
    _waits_for_large_work = True


def expect_work(*, momenta: int = 1, samples: int = 0) -> None:
    """Say what is to come: so many momenta on one motion, so many samples of the body."""
    global _waits_for_large_work
    if pays(momenta, samples):
        _waits_for_large_work = False


def pays(momenta: int, samples: int) -> bool:
    """Whether work is large enough to import Numba for."""
    return momenta >= _MANY_MOMENTA or samples >= _MANY_SAMPLES
