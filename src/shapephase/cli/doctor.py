"""`shapephase doctor`: what the library finds on this machine."""

from __future__ import annotations

from typing import Any

from .options import AS_TEXT, PrintOptions
from .outcome import Outcome

_PACKAGES = (
    ("shapephase", "numpy", "scipy", "pin", "casadi", "numba", "cyclopts", "rich"),
    (
        "matplotlib",
        "trimesh",
        "pycollada",
        "playwright",
        "pillow",
        "imageio-ffmpeg",
        "example-robot-data",
        "mujoco",
        "rosbags",
        "pyyaml",
    ),
)
"""What is needed, and what may be there."""
_FEATURES = ("WITH_URDFDOM", "WITH_COLLISION", "WITH_OPENMP", "WITH_SDFORMAT", "WITH_CPPAD")
"""Of Pinocchio's wheel."""
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "xdg-open")
_COMPILER_TIMEOUT = 10.0
"""For the compiler to say its version [s]."""


def doctor_command(*, printing: PrintOptions = AS_TEXT) -> Outcome:  # noqa: ARG001
    """List what the library finds on this machine: versions, features, compiler, cache, browser; for bug reports."""
    import platform

    data: dict[str, Any] = {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": _versions(_PACKAGES[0]),
        "optional_packages": _versions(_PACKAGES[1]),
        "pinocchio_features": _features(),
        "compiler": _compiler(),
        "machine_code": _machine_code(),
        "cache": _cache(),
        "browser": _browser(),
        "film_browser": _film_browser(),
    }
    width = max(len(name) for names in _PACKAGES for name in names)
    lines = [f"{'system':<{width}}  {data['system']}", f"{'python':<{width}}  {data['python']}"]
    for kind in ("packages", "optional_packages"):
        lines += [f"{name:<{width}}  {found or 'not installed'}" for name, found in data[kind].items()]
    words = {True: "yes", False: "no"}
    lines += [f"{f'pin {name}':<{width}}  {words[has]}" for name, has in data["pinocchio_features"].items()]
    lines += [
        f"{name:<{width}}  {data[name] or 'none'}"
        for name in ("compiler", "machine_code", "cache", "browser", "film_browser")
    ]
    return Outcome("\n".join(lines), data)


def _versions(names: tuple[str, ...]) -> dict[str, str | None]:
    from importlib.metadata import PackageNotFoundError, version

    found: dict[str, str | None] = {}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found


def _features() -> dict[str, bool]:
    from ..body._model_tree import pinocchio_features

    return pinocchio_features(_FEATURES)


def _compiler() -> str | None:
    """The first line of what the C compiler says of its version."""
    import os
    import shutil
    import subprocess

    command = os.environ.get("CC", "cc").split() or ["cc"]
    if shutil.which(command[0]) is None:
        return None
    try:
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=_COMPILER_TIMEOUT)
    except (OSError, subprocess.SubprocessError):
        return f"{' '.join(command)}, which does not answer"
    said = done.stdout.strip().splitlines()
    return f"{' '.join(command)}: {said[0] if said else 'version unknown'}"


def _machine_code() -> str:
    """Whether the innermost loops can be machine code."""
    import warnings

    from ..errors import CompiledCodeWarning
    from ..integrator.machine_code import fault

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CompiledCodeWarning)
        why = fault()
    return f"no, {why}: much work takes much longer" if why else "yes, by Numba"


def _cache() -> str | None:
    """The folder of compiled functions, and how many it holds."""
    from ..integrator.kept_code import code_folder

    try:
        folder = code_folder()
        return f"{folder}: {sum(1 for _ in folder.rglob('*.nbc'))} compiled functions"
    except (OSError, RuntimeError):
        return None


def _browser() -> str | None:
    import os
    import shutil

    named = os.environ.get("BROWSER")
    return named or next((path for name in _BROWSERS if (path := shutil.which(name))), None)


def _film_browser() -> str | None:
    """The Chromium that would draw a film."""
    from ..errors import MissingExtraError
    from ..plotting.pages.video import chromium

    try:
        return chromium()
    except MissingExtraError:
        return None
