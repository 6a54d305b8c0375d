"""`shapephase check`: what was read of a body and a motion, and what looks unlikely."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ..errors import ImplausibleBodyWarning, ShapeError, TrajectoryWarning
from . import options
from .options import option, rare
from .outcome import ExitCode, Outcome


def check_command(
    body: options.BodyArgument,
    motion: options.MotionArgument | None = None,
    /,
    *,
    clearance: Annotated[
        str | None,
        option(
            "List pairs of links that come closer than this along the motion, in m or with a unit; the exit code is "
            "then 4. Shapes are those for collisions, else those that are drawn; meshes count as their convex hulls. "
            "For example `--clearance 0.02` or `--clearance 2cm`."
        ),
    ] = None,
    srdf: Annotated[
        Path | None,
        rare("Pairs of links that --clearance leaves out: an SRDF file; for example `--srdf robot.srdf`."),
    ] = None,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Check a body, and a joint motion for it: what was read, what looks unlikely, and whether it can be used."""
    from ..body.collisions.geometry import collision_geometry
    from ..body.plausibility import implausible, person_height
    from ..shape_space.closest_approach import clearance as clearance_along
    from ..shape_space.summaries import body_summary, path_summary
    from .joint_values import value_in_si
    from .motion import body_argument, joint_motion, whole_path
    from .texts.recording_text import flight_lines, flights_in, recording_data, recording_lines
    from .texts.result_text import (
        body_lines,
        clearance_data,
        clearance_lines,
        path_data,
        path_lines,
        plain,
        record_data,
        too_fast,
    )
    from .wheels import wheel_lines, with_wheels

    if motion is None and clearance is not None:
        raise ShapeError("--clearance: a motion is needed, as in `shapephase check cat cat_righting --clearance 0.02`")
    distance = None if clearance is None else value_in_si(clearance, "m", "--clearance")
    code, own = ExitCode.DONE, body_argument(body, floating)
    loaded, spinning = with_wheels(own, wheels)
    for doubt in implausible(loaded):
        warnings.warn(doubt, ImplausibleBodyWarning, stacklevel=2)
    summary = body_summary(loaded)
    lines, data = body_lines(summary), {"body": plain(summary)}
    height = person_height(loaded)
    if height is not None:
        lines.insert(1, f"{'height':24}{height:.2f} m, of the person, by the bones")
        data["body"]["person_height_m"] = height
    if motion is not None:
        path, recorded = joint_motion(motion, own, recording, spinning)
        deformation = spinning.deformation(loaded, path, recorded)
        path = whole_path(deformation, path)
        moved = path_summary(loaded, path)
        if moved.joints_beyond_rates:
            warnings.warn(too_fast(loaded, moved), TrajectoryWarning, stacklevel=2)
        lines += ["", *path_lines(loaded, motion, moved, recorded, spinning.names), *wheel_lines(deformation)]
        lines += recording_lines(loaded, recorded)
        data["motion"] = path_data(moved) | record_data(recorded) | recording_data(recorded)
        if recorded is not None and recorded.flight is None:
            flights = flights_in(loaded, replace(recorded, path=path), recording)
            lines += flight_lines(flights, recorded)
            data["motion"]["flights"] = flights
        if distance is not None:
            geometry = collision_geometry(loaded, srdf=srdf)
            result = clearance_along(loaded, path, below=distance, geometry=geometry)
            lines += ["", *clearance_lines(result, distance)]
            data["motion"]["clearance"] = clearance_data(result, distance)
            if result.approaches:
                code = ExitCode.TRAJECTORY
                nearest = result.approaches[0].text
                warnings.warn(f"links come too close: {nearest}", TrajectoryWarning, stacklevel=2)
    made_from = {} if motion is None else {"joints": list(loaded.joint_names)}
    return Outcome("\n".join(lines), data, with_verdict=True, code=code, made_from=made_from)
