"""The command line: `shapephase split`, `shapephase robots`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np
from cyclopts import App, CycloptsError, Parameter

from . import so3
from .arrays import Array
from .body import Body
from .catalog import example_names, load_body, robot_names
from .deformation import articulated
from .errors import (
    InputFileNotFoundError,
    ModelFileError,
    ShapePhaseError,
    TrajectoryError,
    UnknownNameError,
)
from .motion_files import read_shape_path
from .phases import PhaseSplit, split
from .reconstruction import Motion, reconstruct
from .scenarios import MOTIONS, named_motion
from .shape_path import ShapePath

_USAGE, _MODEL, _TRAJECTORY, _NUMERICS = 2, 3, 4, 5

app = App(
    name="shapephase",
    help="A free body changes its shape in a known way; how does it turn?",
    result_action="return_value",
)


@dataclass(frozen=True)
class _Outcome:
    """What a command has to say, for people and for programs."""

    text: str
    data: dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, or 2 usage, 3 body, 4 trajectory, 5 numerics, with one line on stderr."""
    tokens = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in tokens
    try:
        outcome = app(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        _fail(_first_line(error), _USAGE, as_json, "usage")
    except ShapePhaseError as error:
        _fail(_first_line(error), _exit_code(error), as_json, type(error).__name__)
    if isinstance(outcome, _Outcome):
        print(json.dumps(outcome.data, indent=2) if as_json else outcome.text)


@app.command(name="split")
def split_command(
    body: str,
    motion: str,
    /,
    *,
    momentum: Annotated[tuple[float, float, float], Parameter(negative_iterable="")] = (0.0, 0.0, 0.0),
    attitude: Annotated[tuple[float, float, float, float], Parameter(negative_iterable="")] = (0.0, 0.0, 0.0, 1.0),
    gauge: str = "horizontal",
    tolerance: float = 1e-9,
    out: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> _Outcome:
    """Split the rotation of a free body into shape holonomy and Montgomery phase.

    Parameters
    ----------
    body
        a URDF file, a name from `shapephase robots`, or example:NAME of example-robot-data
    motion
        a CSV or NPZ file of joint coordinates in time, or the name of a motion from `shapephase robots`
    momentum
        angular momentum about the centre of mass, inertial axes [kg m^2/s]
    attitude
        of the base at the start, quaternion x y z w
    gauge
        horizontal, base or principal
    tolerance
        of the attitude [rad]
    out
        write the motion to this NPZ file
    json
        print JSON
    """
    if out is not None:
        _check_writable(out)
    loaded = load_body(body)
    path = _path(motion, loaded)
    start = so3.quat_argument(attitude, "attitude")
    moved = reconstruct(articulated(loaded, path), momentum, start, tolerance=tolerance)
    result = split(moved, gauge)
    if out is not None:
        moved.save(out)
    return _Outcome(_split_text(loaded, motion, moved, result), _split_data(loaded, motion, moved, result))


@app.command(name="robots")
def robots_command(
    *,
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> _Outcome:
    """List the bodies and motions that come with the library.

    Parameters
    ----------
    json
        print JSON
    """
    bodies = {name: load_body(name) for name in robot_names()}
    motions = {name: {"body": motion.body, "about": motion.about} for name, motion in MOTIONS.items()}
    examples = list(example_names())
    width = max(map(len, [*bodies, *motions]))
    lines = ["Bodies"]
    lines += [f"  {name:<{width}}  {body.n_shape:3d} joints  {body.mass:9.3f} kg" for name, body in bodies.items()]
    lines += ["", "Motions"]
    lines += [f"  {name:<{width}}  {item['body']}: {item['about']}" for name, item in motions.items()]
    lines += ["", "Bodies of example-robot-data"]
    lines += [f"  example:{name}" for name in examples] or ["  none installed: pip install 'shapephase[robots]'"]
    listed = {
        name: {"joints": list(body.joint_names), "units": list(body.joint_units), "mass": body.mass}
        for name, body in bodies.items()
    }
    return _Outcome("\n".join(lines), {"bodies": listed, "motions": motions, "examples": examples})


def _check_writable(out: Path) -> None:
    if out.suffix != ".npz":
        raise UnknownNameError(f"--out writes an NPZ file, its name must end in .npz, got {str(out)!r}")
    if not out.absolute().parent.is_dir():
        raise InputFileNotFoundError(f"{out.parent}: there is no such folder to write {out.name} to")


def _path(motion: str, body: Body) -> ShapePath:
    if motion in MOTIONS and not Path(motion).is_file():
        return named_motion(motion)
    if not Path(motion).exists() and not Path(motion).suffix:
        raise UnknownNameError(f"unknown motion {motion!r}: neither a file nor one of {', '.join(MOTIONS)}")
    return read_shape_path(motion, body)


def _split_text(body: Body, motion_name: str, motion: Motion, result: PhaseSplit) -> str:
    momentum = " ".join(f"{v:g}" for v in motion.momentum)
    lines = [
        f"{body.name} along {motion_name}: {motion.duration:g} s, {body.n_shape} joints, {body.mass:.6g} kg, "
        f"momentum ({momentum}) kg m^2/s",
        "",
        f"{'':24}{'angle [deg]':>16}   axis (inertial)",
        _rotation_line("total rotation", result.total_rotation),
        _rotation_line("  shape holonomy" if result.is_loop else "  shape lift (open)", result.holonomy),
        _rotation_line("  dynamical rotation", result.dynamical_rotation),
        "",
    ]
    if result.has_phase:
        lines += [
            f"{f'seen in the {result.gauge} gauge':24}{'[deg]':>16}{'[rad]':>20}",
            _phase_line("Montgomery phase", result.montgomery_phase),
            _phase_line("  dynamic phase", result.dynamic_phase),
            _phase_line("  geometric phase", result.geometric_phase),
            _rotation_line("tilt", result.tilt),
            f"{'momentum gap':24}{np.degrees(result.momentum_gap):16.6f} deg",
            f"{'residual':24}{result.residual:16.2e} rad   (phase by formula against attitude)",
        ]
    else:
        lines.append("no angular momentum: the shape alone turns the body, there is no Montgomery phase")
    if not result.is_loop:
        lines.append(f"{'shape gap':24}{result.shape_gap:16.6g}       (the shape does not return: no holonomy)")
    lines += [
        f"{'error estimate':24}{motion.error_estimate:16.2e} rad",
        f"{'evaluations':24}{motion.evaluations:16d}",
    ]
    return "\n".join(lines)


def _rotation_line(name: str, rotation: Array) -> str:
    vector = so3.log(rotation)
    turn = float(np.linalg.norm(vector))
    axis = "" if turn < 1e-12 else "   (" + " ".join(f"{v + 0.0:9.6f}" for v in np.round(vector / turn, 6)) + ")"
    return f"{name:24}{np.degrees(turn):16.6f}{axis}"


def _phase_line(name: str, phase: Array) -> str:
    return f"{name:24}{np.degrees(phase):16.6f}{phase:20.9f}"


def _split_data(body: Body, motion_name: str, motion: Motion, result: PhaseSplit) -> dict[str, Any]:
    data = {key: value.tolist() if hasattr(value, "tolist") else value for key, value in asdict(result).items()}
    return {
        "body": body.name,
        "motion": motion_name,
        "duration_s": motion.duration,
        "momentum_kg_m2_s": motion.momentum.tolist(),
        "final_attitude_quat_xyzw": motion.quat_xyzw(motion.duration).tolist(),
        **data,
        "error_estimate_rad": float(motion.error_estimate),
        "evaluations": motion.evaluations,
    }


def _exit_code(error: ShapePhaseError) -> int:
    if isinstance(error, TrajectoryError):
        return _TRAJECTORY
    if isinstance(error, ModelFileError):
        return _MODEL
    return _USAGE if isinstance(error, ValueError | FileNotFoundError | ImportError) else _NUMERICS


def _first_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _fail(message: str, code: int, as_json: bool, kind: str) -> NoReturn:
    if as_json:
        print(json.dumps({"error": {"type": kind, "message": message, "exit_code": code}}))
    print(f"shapephase: {message}", file=sys.stderr)
    raise SystemExit(code)
