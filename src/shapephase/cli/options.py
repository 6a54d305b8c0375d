"""Arguments and options that several commands take, each declared once with its help."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

BodyArgument = Annotated[
    str,
    Parameter(help="a URDF or MJCF file, a name from `shapephase robots`, or example:NAME of example-robot-data"),
]
MotionArgument = Annotated[
    str,
    Parameter(
        help="a file of joint coordinates in time (CSV, NPZ, OpenSim, ROS, MuJoCo qpos), or the name of a motion from "
        "`shapephase robots`"
    ),
]
Momentum = Annotated[
    tuple[float, float, float],
    Parameter(negative_iterable="", help="angular momentum about the centre of mass, inertial axes [kg m^2/s]"),
]
Gauge = Annotated[str, Parameter(help="horizontal, base, principal, mean_body or link:NAME")]
ReportFile = Annotated[Path | None, Parameter(help="write a report with animation and figures to this HTML file")]
FigureFile = Annotated[Path, Parameter(help="the file, .svg, .pdf or .png")]
Json = Annotated[bool, Parameter(negative="", help="print JSON")]
"""`main` looks for it among the words of the command line, so that errors are JSON too; the commands ignore it."""


@Parameter(name="*")
@dataclass(frozen=True)
class FlightOptions:
    """How the body flies: its momentum, and its attitude at the start."""

    momentum: Momentum = (0.0, 0.0, 0.0)
    attitude: Annotated[
        tuple[float, float, float, float],
        Parameter(negative_iterable="", help="of the base at the start, quaternion x y z w"),
    ] = (0.0, 0.0, 0.0, 1.0)


@Parameter(name="*")
@dataclass(frozen=True)
class RecordingOptions:
    """How a file of recorded samples is read."""

    smooth: Annotated[
        float | None,
        Parameter(help="noise of recorded samples, rms [rad or m]; without it the path goes through all of them"),
    ] = None
    topic: Annotated[str | None, Parameter(help="of a ROS bag with more than one motion")] = None


AT_REST = FlightOptions()
AS_RECORDED = RecordingOptions()
