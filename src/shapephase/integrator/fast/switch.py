"""Whether machine code is used: where Numba is installed, unless $SHAPEPHASE_FAST says 0.

In Python it is, from the first reconstruction on. A command that runs for a second would wait for Numba longer than it
gains: there only large work switches it on, and nothing is compiled, which `shapephase compile` does. SHAPEPHASE_FAST=1
is as in Python.
"""

from __future__ import annotations

import os
from functools import lru_cache
from importlib.util import find_spec

VARIABLE = "SHAPEPHASE_FAST"
"""Environment variable: 0 never, 1 always, else as described above."""
_MANY_MOMENTA = 200
"""Some 0.1 s without machine code, half of what importing Numba and loading the kernels takes."""
_MANY_SAMPLES = 100_000
"""Of the body, some 0.2 s with Pinocchio: a recording of twenty thousand rows."""

_is_command = False
_is_large = False


@lru_cache(maxsize=1)
def is_installed() -> bool:
    """Whether Numba can be imported, without importing it."""
    return find_spec("numba") is not None


def is_allowed() -> bool:
    """Whether machine code may be used in this process."""
    return _setting() != "0" and is_installed() and _can_compile()


def is_on() -> bool:
    """Whether machine code is to be used now."""
    return is_wanted() and _can_compile()


def is_wanted() -> bool:
    """The same where Numba is known to work."""
    setting = _setting()
    return is_installed() and (setting == "1" or (setting != "0" and (_is_large or not _is_command)))


def may_compile() -> bool:
    """Whether kernels that this machine does not have yet are compiled."""
    return not _is_command or _setting() == "1"


def _can_compile() -> bool:
    # A Numba that is told to interpret would take the loops one operation after another.
    interpreting = os.environ.get("NUMBA_DISABLE_JIT", "0").strip() not in ("", "0")
    return not interpreting


def begin_command() -> None:
    """From now on this process is a command: machine code is not used before `expect_work` says that it pays."""
    global _is_command, _is_large
    _is_command, _is_large = True, False


def expect_work(*, momenta: int = 1, samples: int = 0) -> None:
    """Say what is to come: so many momenta on one motion, so many samples of the body."""
    global _is_large
    _is_large = _is_large or momenta >= _MANY_MOMENTA or samples >= _MANY_SAMPLES


def _setting() -> str:
    return os.environ.get(VARIABLE, "").strip()
