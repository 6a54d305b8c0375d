"""The command line: `shapephase split`, `plan`, `check`, `orbits`, `conjugate`, `view`, `plot`, `robots`, `compile`."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, NoReturn

import numpy as np
from cyclopts import App, CycloptsError, Parameter

from .. import so3
from ..body.body import Body
from ..body.catalog import example_names, load_body, robot_names
from ..deformation.deformation import articulated
from ..deformation.gauge import named_gauge
from ..errors import CompilerError, ModelFileError, ShapePhaseError, TrajectoryError, UnknownNameError, unknown_name
from ..examples.scenarios import MOTIONS, named_motion
from ..integrator.compiled_steps import compile_steps
from ..phases.phases import split
from ..phases.return_map import fixed_points
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.files.read import RecordedMotion, read_recorded_motion
from ..shape_space.shape_path import ShapePath
from ..shape_space.summaries import body_summary, path_summary
from .conjugate import conjugate_command
from .plan import plan_command
from .progress import steps
from .text import (
    Outcome,
    base_said,
    body_lines,
    check_writable,
    orbit_data,
    orbit_lines,
    path_data,
    path_lines,
    plain,
    record_data,
    rotation_line,
    split_data,
    split_lines,
)

_USAGE, _MODEL, _TRAJECTORY, _NUMERICS, _STOPPED = 2, 3, 4, 5, 130

app = App(
    name="shapephase",
    help="A free body changes its shape in a known way; how does it turn?",
    result_action="return_value",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, or with one line on stderr 2 usage, 3 body, 4 trajectory, 5 numerics.

    Warnings are lines on stderr too, and a list in what `--json` prints. Ctrl-C ends with 130.
    """
    tokens = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in tokens
    outcome, failure = None, None
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        try:
            outcome = app(tokens, exit_on_error=False, print_error=False)
        except CycloptsError as error:
            failure = (_one_line(error), _USAGE, as_json, "usage")
        except ShapePhaseError as error:
            failure = (_one_line(error), _exit_code(error), as_json, type(error).__name__)
        except KeyboardInterrupt:
            raise SystemExit(_STOPPED) from None
    doubts = list(dict.fromkeys(_one_line(warning.message) for warning in raised))
    for doubt in doubts:
        print(f"shapephase: warning: {doubt}", file=sys.stderr)
    if failure:
        _fail(*failure)
    if isinstance(outcome, Outcome):
        data, text = {"shapephase": version("shapephase"), **outcome.data, "warnings": doubts}, outcome.text
        if outcome.judged:
            many = "1 warning" if len(doubts) == 1 else f"{len(doubts)} warnings"
            verdict = f"usable, with {many}" if doubts else "no fault found"
            listed = "".join(f"\nwarning: {doubt}" for doubt in doubts)
            data, text = data | {"verdict": verdict}, f"{text}\n{listed}\nverdict: {verdict}"
        print(json.dumps(data, indent=2) if as_json else text)
        if outcome.code:
            raise SystemExit(outcome.code)


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
    smooth: float | None = None,
    topic: str | None = None,
    out: Path | None = None,
    html: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> Outcome:
    """Split the rotation of a free body into shape holonomy and Montgomery phase.

    Parameters
    ----------
    body
        a URDF or MJCF file, a name from `shapephase robots`, or example:NAME of example-robot-data
    motion
        a file of joint coordinates in time (CSV, NPZ, OpenSim, ROS, MuJoCo qpos), or the name of a motion from
        `shapephase robots`
    momentum
        angular momentum about the centre of mass, inertial axes [kg m^2/s]
    attitude
        of the base at the start, quaternion x y z w
    gauge
        horizontal, base, principal, mean_body or link:NAME
    tolerance
        of the attitude [rad]
    smooth
        noise of recorded samples, rms [rad or m]; without it the path goes through all of them
    topic
        of a ROS bag with more than one motion
    out
        write the motion to this NPZ file
    html
        write a report with animation and figures to this HTML file
    json
        print JSON
    """
    check_writable(out, "--out", ".npz")
    check_writable(html, "--html", ".html")
    with steps(12 if html else 2) as work:
        work.begin("loading and reconstructing")
        moved, loaded, path, recorded = _moved(body, motion, momentum, attitude, tolerance, smooth, topic)
        result = split(moved, gauge)
        if out is not None:
            moved.save(out)
        if html is not None:
            from ..plotting.report import write_report

            title = f"{loaded.name} along {Path(motion).name}"
            write_report(moved, result, html, shape_path=path, title=title, begin=work.begin)
    lines, data = base_said(moved, recorded)
    text = [*split_lines(loaded, motion, moved, result), *lines]
    return Outcome("\n".join(text), split_data(loaded, motion, moved, result) | data)


@app.command(name="view")
def view_command(
    body: str,
    motion: str,
    /,
    *,
    momentum: Annotated[tuple[float, float, float], Parameter(negative_iterable="")] = (0.0, 0.0, 0.0),
    attitude: Annotated[tuple[float, float, float, float], Parameter(negative_iterable="")] = (0.0, 0.0, 0.0, 1.0),
    html: Path | None = None,
    trail: str | None = None,
    speed: float | None = None,
    smooth: float | None = None,
    topic: str | None = None,
) -> Outcome | None:
    """Show a motion in 3-D: in a browser until Ctrl-C, or as one HTML file that opens offline.

    Parameters
    ----------
    body, motion, momentum, attitude, smooth, topic
        as for split
    html
        write the animation to this HTML file, and serve nothing
    trail
        a link that leaves a trail
    speed
        seconds of motion in a second
    """
    from ..plotting.viewer import motion_page, view

    check_writable(html, "--html", ".html")
    with steps(2) as work:
        work.begin("loading and reconstructing")
        moved, *_ = _moved(body, motion, momentum, attitude, 1e-9, smooth, topic)
        if html is not None:
            work.begin("recording the animation")
            motion_page(moved, html, trail=trail, speed=speed)
            return Outcome(f"wrote {html}", {"html": str(html)})
    live = view(moved, trail=trail, speed=speed, notebook=False)
    if live is not None:
        with live:
            print(f"{live.url}  (Ctrl-C to stop)", flush=True)
            live.wait()
    return None


@app.command(name="plot")
def plot_command(
    kind: str,
    body: str,
    motion: str,
    /,
    *,
    out: Path,
    momentum: Annotated[tuple[float, float, float], Parameter(negative_iterable="")] = (0.0, 0.0, 0.0),
    attitude: Annotated[tuple[float, float, float, float], Parameter(negative_iterable="")] = (0.0, 0.0, 0.0, 1.0),
    gauge: str = "horizontal",
    smooth: float | None = None,
    topic: str | None = None,
) -> Outcome:
    """Draw one figure of a motion, one column wide.

    Parameters
    ----------
    kind
        momentum, phases, attitude, shape, inertia, internal_momentum or energy
    out
        the file, .svg, .pdf or .png
    body, motion, momentum, attitude, gauge, smooth, topic
        as for split
    """
    from ..plotting.named_figures import FIGURES, write_figure

    if kind not in FIGURES:
        raise unknown_name("kind of figure", kind, FIGURES)
    check_writable(out, "--out", ".svg", ".pdf", ".png")
    moved, _, path, _ = _moved(body, motion, momentum, attitude, 1e-9, smooth, topic)
    write_figure(kind, moved, out, path, gauge)
    return Outcome(f"wrote {out}", {"figure": str(out)})


app.command(plan_command, name="plan")
app.command(conjugate_command, name="conjugate")


@app.command(name="check")
def check_command(
    body: str,
    motion: str | None = None,
    /,
    *,
    smooth: float | None = None,
    topic: str | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> Outcome:
    """Check a body, and a joint motion for it: what was read, and whether it can be used.

    Parameters
    ----------
    body
        as for split
    motion
        as for split
    smooth
        noise of recorded samples, rms [rad or m]; without it the path goes through all of them
    topic
        of a ROS bag with more than one motion
    json
        print JSON
    """
    loaded = load_body(body, isolate=True)
    card = body_summary(loaded)
    lines, data = body_lines(card), {"body": plain(card)}
    if motion is not None:
        path, recorded = _motion(motion, loaded, smooth, topic)
        moved = path_summary(loaded, path)
        lines += ["", *path_lines(loaded, motion, moved, recorded)]
        data["motion"] = path_data(moved) | record_data(loaded, recorded)
    return Outcome("\n".join(lines), data, judged=True)


@app.command(name="orbits")
def orbits_command(
    body: str,
    motion: str,
    magnitude: float,
    /,
    *,
    gauge: str = "horizontal",
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> Outcome:
    """Find the motions whose shape and momentum close together, and split each.

    Parameters
    ----------
    body
        as for split
    motion
        a closed one, as for split
    magnitude
        size of the angular momentum [kg m^2/s]
    gauge
        where the momentum closes: horizontal, base, principal, mean_body or link:NAME
    json
        print JSON
    """
    with steps(3) as work:
        work.begin("loading")
        loaded = load_body(body, isolate=True)
        path, _ = _motion(motion, loaded, None, None)
        deformation = articulated(loaded, path)
        seen = named_gauge(deformation, gauge)
        work.begin("finding what closes")
        found = fixed_points(seen, magnitude)
        upright = so3.transpose(so3.between(np.array([0.0, 0.0, 1.0]), found.directions))
        work.begin("splitting")
        moved = [reconstruct(seen, [0.0, 0.0, magnitude], attitude, tolerance=1e-11) for attitude in upright]
        splits = [split(orbit, "base") for orbit in moved]
        holonomy = split(reconstruct(deformation, np.zeros(3))).holonomy
    said = (loaded, motion, gauge, found, found.directions @ seen.frame(0.0), splits)
    lines = [*orbit_lines(*said), "", rotation_line("shape holonomy (base axes)", holonomy)]
    return Outcome("\n".join(lines), orbit_data(*said) | {"holonomy": holonomy.tolist()})


@app.command(name="robots")
def robots_command(
    *,
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> Outcome:
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
    return Outcome("\n".join(lines), {"bodies": listed, "motions": motions, "examples": examples})


@app.command(name="compile")
def compile_command(
    *,
    json: Annotated[bool, Parameter(negative="")] = False,  # noqa: ARG001 (read in main, errors included)
) -> Outcome:
    """Compile the innermost loops with this machine's C compiler: the same results, sooner.

    Once is enough for all later sessions. $CC names the compiler; what it writes is kept in $XDG_CACHE_HOME/shapephase,
    or ~/.cache/shapephase.

    Parameters
    ----------
    json
        print JSON
    """
    with steps(1) as work:
        work.begin("compiling")
        written = compile_steps()
    return Outcome(f"compiled: {len(written)} functions in {written[0].parent}", {"files": [str(p) for p in written]})


def _moved(
    body: str,
    motion: str,
    momentum: tuple[float, float, float],
    attitude: tuple[float, float, float, float],
    tolerance: float,
    smooth: float | None,
    topic: str | None,
) -> tuple[Motion, Body, ShapePath, RecordedMotion | None]:
    """The motion that the options ask for, and what it is made of."""
    loaded = load_body(body, isolate=True)
    path, recorded = _motion(motion, loaded, smooth, topic)
    start = so3.quat_argument(attitude, "attitude")
    return reconstruct(articulated(loaded, path), momentum, start, tolerance=tolerance), loaded, path, recorded


def _motion(
    motion: str, body: Body, smooth: float | None, topic: str | None
) -> tuple[ShapePath, RecordedMotion | None]:
    """The path of a motion, and its record where it comes from a file."""
    if motion in MOTIONS and not Path(motion).is_file():
        return named_motion(motion), None
    if not Path(motion).exists() and not Path(motion).suffix:
        raise UnknownNameError(f"unknown motion {motion!r}: neither a file nor one of {', '.join(MOTIONS)}")
    recorded = read_recorded_motion(motion, body, smooth=smooth, topic=topic)
    return recorded.path, recorded


def _exit_code(error: ShapePhaseError) -> int:
    if isinstance(error, TrajectoryError):
        return _TRAJECTORY
    if isinstance(error, ModelFileError):
        return _MODEL
    asked = ValueError | FileNotFoundError | ImportError | CompilerError
    return _USAGE if isinstance(error, asked) else _NUMERICS


def _one_line(error: Warning | Exception | str) -> str:
    return " ".join(str(error).split())


def _fail(message: str, code: int, as_json: bool, kind: str) -> NoReturn:
    if as_json:
        print(json.dumps({"error": {"type": kind, "message": message, "exit_code": code}}))
    print(f"shapephase: {message}", file=sys.stderr)
    raise SystemExit(code)
