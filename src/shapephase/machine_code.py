"""The innermost loops in machine code, for those who have a C compiler and ask for it once.

CasADi interprets its functions. What it writes of them in C does the same operations in the same order, so the results
are the same to the last bit, and take a fifth of the time.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .errors import CompilerError
from .files import write_whole

# Contracting a product and a sum into one operation would round differently.
_OPTIONS = ("-O2", "-ffp-contract=off", "-shared", "-fPIC")
_PATIENCE = 120.0
_TRIALS = 20


class MachineCodeWarning(UserWarning):
    """Compiled steps were found but cannot be used; the interpreted ones give the same results."""


def code_folder() -> Path:
    """Where compiled functions are kept: $XDG_CACHE_HOME/shapephase, or ~/.cache/shapephase."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "shapephase"


def in_machine_code(function: Any) -> Any:
    """The compiled twin of a CasADi function if there is one in `code_folder`, else the function itself."""
    import casadi

    if not code_folder().is_dir():
        return function
    library = _library(function.name(), _source(function))
    # In a folder that others may write to, their code is not ours to run.
    if not library.is_file() or library.stat().st_uid not in (0, os.getuid()):
        return function
    try:
        return casadi.external(function.name(), str(library))
    except RuntimeError:
        warnings.warn(
            f"{library} cannot be loaded; the steps are interpreted. `shapephase compile` writes it anew",
            MachineCodeWarning,
            stacklevel=2,
        )
        return function


def compile_functions(functions: list[Any]) -> list[Path]:
    """Compile CasADi functions of dense numbers into `code_folder`, each compared with the interpreted one.

    Raises
    ------
    CompilerError
        If there is no C compiler (`cc`, or what $CC names), it fails, or its code gives other numbers.
    """
    words = os.environ.get("CC", "cc").split() or ["cc"]
    if shutil.which(words[0]) is None:
        raise CompilerError(
            f"there is no C compiler {words[0]!r} on this machine; install one (gcc or clang), or name it in $CC. "
            "Everything works without it"
        )
    folder = code_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as workshop:
            return [_compiled(function, words, Path(workshop)) for function in functions]
    except OSError as error:
        raise CompilerError(f"{folder}: cannot be written to ({error}); $XDG_CACHE_HOME names another place") from error


def _compiled(function: Any, compiler: list[str], workshop: Path) -> Path:
    """One function compiled, tried and put in its place."""
    import casadi

    source = _source(function)
    written, made = workshop / f"{function.name()}.c", workshop / f"{function.name()}.so"
    written.write_text(source)
    command = [*compiler, *_OPTIONS, str(written), "-o", str(made), "-lm"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        raise CompilerError(f"the compiler {compiler[0]} took more than {_PATIENCE:g} s; $CC names another") from None
    if done.returncode:
        raise CompilerError(f"the compiler {compiler[0]} failed: {done.stderr.strip()[-500:] or 'it says nothing'}")
    twin = casadi.external(function.name(), str(made))
    rng = np.random.default_rng(0)
    for _ in range(_TRIALS):
        given = [rng.uniform(-1.0, 1.0, function.size_in(place)) for place in range(function.n_in())]
        pairs = zip(function.call(given), twin.call(given), strict=True)
        if not all(np.array_equal(np.array(a), np.array(b), equal_nan=True) for a, b in pairs):
            raise CompilerError(f"what {compiler[0]} makes of the steps gives other numbers; name another in $CC")
    library = _library(function.name(), source)
    write_whole(library, lambda stream: stream.write(made.read_bytes()))
    return library


def _source(function: Any) -> str:
    """A CasADi function in C."""
    import casadi

    generator = casadi.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    return str(generator.dump())


def _library(name: str, source: str) -> Path:
    """Where the compiled source belongs: another source, machine or system has another name."""
    kind = f"{platform.system()} {platform.machine()} {' '.join(_OPTIONS)}\n"
    return code_folder() / f"{name}-{hashlib.sha256((kind + source).encode()).hexdigest()[:24]}.so"
