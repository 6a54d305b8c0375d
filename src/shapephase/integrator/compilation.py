"""The innermost loops in machine code, where a C compiler is at hand.

CasADi interprets its functions. The C code it generates does the same operations in the same order, so the results
are the same to the last bit, in a fifth of the time.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CompiledCodeWarning, CompilerError
from ..files import write_whole
from .fast.cache_folder import code_folder

# Contracting a product and a sum into one operation would round differently.
_OPTIONS = ("-O2", "-ffp-contract=off", "-shared", "-fPIC")
# [s] for one call of the compiler; it takes a few seconds on a slow machine.
_COMPILER_TIMEOUT = 120.0
# Random arguments for which a compiled function must agree with the interpreted one: operations in another order, or
# another function in the place of one, show in nearly every trial.
_TRIALS = 20


@lru_cache(maxsize=64)
def compiled_or_interpreted(function: Any) -> Any:
    """The compiled twin of a CasADi function if there is one in `code_folder`, else the function itself.

    The folder is searched once for each function.
    """
    import casadi

    try:
        if not code_folder().is_dir():
            return function
        library = _library(function.name(), _source(function))
        # Code written by another user is not run, even if the folder lets everyone write.
        if not library.is_file() or library.stat().st_uid not in (0, os.getuid()):
            return function
    except (OSError, RuntimeError):
        return function
    try:
        return casadi.external(function.name(), str(library))
    except RuntimeError:
        warnings.warn(
            f"{library} cannot be loaded; the steps are interpreted. `shapephase compile` writes it anew",
            CompiledCodeWarning,
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
    compiler = os.environ.get("CC", "cc").split() or ["cc"]
    if shutil.which(compiler[0]) is None:
        raise CompilerError(
            f"there is no C compiler {compiler[0]!r} on this machine; install one (gcc or clang), or name it in $CC. "
            "Everything works without it"
        )
    try:
        folder = code_folder()
    except RuntimeError as error:
        raise CompilerError(
            f"there is no folder for compiled functions ({error}); name one in $XDG_CACHE_HOME"
        ) from error
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as workshop:
            for function in functions:
                _compile(function, compiler, Path(workshop))
            _check_all(compiler, workshop)
            return [_installed(function, Path(workshop)) for function in functions]
    except OSError as error:
        raise CompilerError(
            f"{folder}: cannot be written to ({error}); $XDG_CACHE_HOME names another folder"
        ) from error


def _compile(function: Any, compiler: list[str], workshop: Path) -> None:
    """Compile one function, and save the interpreted one beside it."""
    source, made = workshop / f"{function.name()}.c", workshop / f"{function.name()}.so"
    source.write_text(_source(function))
    function.save(str(workshop / f"{function.name()}.casadi"))
    done = _run([*compiler, *_OPTIONS, str(source), "-o", str(made), "-lm"], compiler)
    if done.returncode:
        raise CompilerError(f"the compiler {compiler[0]} failed: {done.stderr.strip()[-500:] or 'it printed nothing'}")


def _check_all(compiler: list[str], workshop: str) -> None:
    """Compare in a separate process: code for "fast" mathematics changes the arithmetic of a process that loads it."""
    trial = (
        "import sys; from shapephase.integrator.compilation import same_numbers; "
        "sys.exit(not same_numbers(sys.argv[1]))"
    )
    done = _run([sys.executable, "-c", trial, workshop], compiler)
    if done.returncode:
        said = f" ({done.stderr.strip().splitlines()[-1][-300:]})" if done.stderr.strip() else ""
        words = " ".join(compiler)
        raise CompilerError(f"the steps compiled by {words!r} give other numbers{said}; name another compiler in $CC")


def same_numbers(workshop: str) -> bool:
    """Whether all compiled functions in a folder give the same as the interpreted ones beside them, bit by bit."""
    import casadi

    rng = np.random.default_rng(0)
    for saved in sorted(Path(workshop).glob("*.casadi")):
        function = casadi.Function.load(str(saved))
        trials = [
            [rng.uniform(-1.0, 1.0, function.size_in(place)) for place in range(function.n_in())]
            for _ in range(_TRIALS)
        ]
        expected = [function.call(given) for given in trials]
        compiled = casadi.external(function.name(), str(saved.with_suffix(".so")))
        for given, numbers in zip(trials, expected, strict=True):
            pairs = zip(numbers, compiled.call(given), strict=True)
            if not all(np.array_equal(np.array(a), np.array(b), equal_nan=True) for a, b in pairs):
                return False
    smallest = np.array([5e-324])
    return bool((smallest * 1.0)[0] > 0.0)


def _run(command: list[str], compiler: list[str]) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=_COMPILER_TIMEOUT, check=False)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"compiling with {compiler[0]} took more than {_COMPILER_TIMEOUT:g} s; $CC names another compiler"
        ) from None


def _installed(function: Any, workshop: Path) -> Path:
    """Move a compiled function to its place."""
    library = _library(function.name(), _source(function))
    write_whole(library, lambda stream: stream.write((workshop / f"{function.name()}.so").read_bytes()))
    return library


def _source(function: Any) -> str:
    """A CasADi function in C."""
    import casadi

    generator = casadi.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    return str(generator.dump())


def _library(name: str, source: str) -> Path:
    """The file of compiled source; its name depends on source, machine and system."""
    kind = f"{platform.system()} {platform.machine()} {' '.join(_OPTIONS)}\n"
    return code_folder() / f"{name}-{hashlib.sha256((kind + source).encode()).hexdigest()[:24]}.so"
