"""`shapephase robots`, `compile` and `doctor`: what is installed, and the loops in machine code."""

from __future__ import annotations

from typing import Any

from .options import PRINT_DEFAULTS, PrintOptions
from .outcome import Outcome
from .progress import steps

_PACKAGES = ("shapephase", "numpy", "scipy", "pin", "casadi", "numba", "cyclopts", "rich")
_OPTIONAL_PACKAGES = (
    *("matplotlib", "trimesh", "pycollada", "playwright", "pillow", "imageio-ffmpeg", "example-robot-data", "mujoco"),
    *("rosbags", "pyyaml"),
)
_FEATURES = ("WITH_URDFDOM", "WITH_COLLISION", "WITH_OPENMP", "WITH_SDFORMAT", "WITH_CPPAD")  # of Pinocchio's wheel
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "xdg-open")
_COMPILER_TIMEOUT = 10.0  # [s] for the compiler to print its version


def robots_command(*, printing: PrintOptions = PRINT_DEFAULTS) -> Outcome:  # noqa: ARG001
    """List the bodies and motions that come with the library."""
    from ..body.catalog import example_names, robot_names
    from ..body.loading import load_body
    from ..examples.scenarios import MOTIONS

    bodies = {name: load_body(name) for name in robot_names()}
    motions = {name: {"body": motion.body, "about": motion.about} for name, motion in MOTIONS.items()}
    examples = list(example_names())
    width = max(map(len, [*bodies, *motions]))
    lines = ["Bodies"]
    lines += [f"  {name:<{width}}  {body.n_shape:3d} joints  {body.mass:9.3f} kg" for name, body in bodies.items()]
    lines += ["", "Motions"]
    lines += [f"  {name:<{width}}  {item['body']}: {item['about']}" for name, item in motions.items()]
    lines += ["", "Bodies of example-robot-data"]
    lines += [f"  example:{name}" for name in examples] or ["  none installed: pip install 'shapephase[bodies]'"]
    listed = {
        name: {"joints": list(body.joint_names), "units": list(body.joint_units), "mass": body.mass}
        for name, body in bodies.items()
    }
    return Outcome("\n".join(lines), {"bodies": listed, "motions": motions, "examples": examples})


def compile_command(*, printing: PrintOptions = PRINT_DEFAULTS) -> Outcome:  # noqa: ARG001
    """Compile the innermost loops with Numba now, not when they are first needed.

    Once is enough for all later sessions: what is compiled is kept in $XDG_CACHE_HOME/shapephase, or
    ~/.cache/shapephase.
    """
    from ..integrator.machine_code import compile_steps

    with steps(1) as work:
        work.begin("compiling")
        written = compile_steps()
    return Outcome(f"compiled: {len(written)} files in {written[0].parent}", {"files": [str(p) for p in written]})


def doctor_command(*, printing: PrintOptions = PRINT_DEFAULTS) -> Outcome:  # noqa: ARG001
    """List what the library finds on this machine: versions, features, compiler, cache, browser; for bug reports."""
    import platform

    data: dict[str, Any] = {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": _versions(_PACKAGES),
        "optional_packages": _versions(_OPTIONAL_PACKAGES),
        "pinocchio_features": _features(),
        "compiler": _compiler(),
        "machine_code": _machine_code(),
        "cache": _cache(),
        "browser": _browser(),
        "film_browser": _film_browser(),
    }
    width = max(map(len, _PACKAGES + _OPTIONAL_PACKAGES))
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
    from ..body.loading import pinocchio_features

    return pinocchio_features(_FEATURES)


def _compiler() -> str | None:
    """Return the C compiler and the first line of its version."""
    import os
    import shutil
    import subprocess

    command = os.environ.get("CC", "cc").split() or ["cc"]
    if shutil.which(command[0]) is None:
        return None
    try:
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=_COMPILER_TIMEOUT)
    except (OSError, subprocess.SubprocessError):
        return f"{' '.join(command)}, which does not run"
    lines = done.stdout.strip().splitlines()
    return f"{' '.join(command)}: {lines[0] if lines else 'version unknown'}"


def _machine_code() -> str:
    """Return whether the innermost loops can be machine code, and why not."""
    import warnings

    from ..errors import CompiledCodeWarning
    from ..integrator.machine_code import fault

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CompiledCodeWarning)
        why = fault()
    return f"no, {why}: much work takes much longer" if why else "yes, by Numba"


def _cache() -> str | None:
    """Return the folder of compiled functions, and their number."""
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
    """Return the Chromium that draws films."""
    from ..errors import MissingExtraError
    from ..plots.pages.video import chromium

    try:
        return chromium()
    except MissingExtraError:
        return None
