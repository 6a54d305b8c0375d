"""Arguments and options that several commands take, each declared once with its help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def _spaced(value: Sequence[float]) -> str:
    """A default as one types it."""
    return " ".join(f"{number:g}" for number in value)


BodyArgument = Annotated[
    str,
    Parameter(
        help="The body: a URDF or MJCF file, a name from `shapephase robots`, or example:NAME of example-robot-data; "
        "for example `cat`."
    ),
]
MotionArgument = Annotated[
    str,
    Parameter(
        help="The motion of its joints: a file (CSV, NPZ, OpenSim, ROS, MuJoCo qpos) or a name from "
        "`shapephase robots`; for example `fall.csv` or `cat_righting`."
    ),
]
Momentum = Annotated[
    tuple[float, float, float],
    Parameter(
        negative_iterable="",
        show_default=_spaced,
        help="Angular momentum about the centre of mass, inertial axes, in kg m^2/s; for example "
        "`--momentum 0 0 0.02`.",
    ),
]
Gauge = Annotated[
    str,
    Parameter(
        help="The frame that the phases are seen in: horizontal, base, principal, mean_body or link:NAME; for example "
        "`--gauge base`."
    ),
]
Tolerance = Annotated[
    float,
    Parameter(help="Of the attitude, from 1e-13 to 1e-4, in rad; for example `--tolerance 1e-6`."),
]
ReportFile = Annotated[
    Path | None,
    Parameter(
        help="Write a report with animation and figures to this HTML file; without it none is written. For example "
        "`--html report.html`."
    ),
]
FigureFile = Annotated[
    Path, Parameter(help="Write the figure to this file, .svg, .pdf or .png; for example `--out figure.pdf`.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class PrintOptions:
    """What is printed. `main` looks for these among the words of the command line, and the commands ignore them."""

    json: Annotated[
        bool,
        Parameter(
            negative="",
            show_default=False,
            help="Print JSON instead of a table, errors too; for example `--json | jq`.",
        ),
    ] = False
    quiet: Annotated[
        bool,
        Parameter(
            name=("--quiet", "-q"), negative="", show_default=False, help="On standard error, say nothing but errors."
        ),
    ] = False
    verbose: Annotated[
        bool,
        Parameter(
            name=("--verbose", "-v"), negative="", show_default=False, help="On standard error, say what is being done."
        ),
    ] = False


@Parameter(name="*")
@dataclass(frozen=True)
class FlightOptions:
    """How the body flies: its momentum, and its attitude at the start."""

    momentum: Momentum = (0.0, 0.0, 0.0)
    attitude: Annotated[
        tuple[float, float, float, float],
        Parameter(
            negative_iterable="",
            show_default=_spaced,
            help="Of the base at the start, a quaternion x y z w without unit; for example `--attitude 1 0 0 0`.",
        ),
    ] = (0.0, 0.0, 0.0, 1.0)


@Parameter(name="*")
@dataclass(frozen=True)
class RecordingOptions:
    """How a file of recorded samples is read."""

    smooth: Annotated[
        float | None,
        Parameter(
            help="Noise of the recorded samples, rms, in rad or m; without it the path goes through all of them. For "
            "example `--smooth 0.01`."
        ),
    ] = None
    topic: Annotated[
        str | None,
        Parameter(
            help="Of a ROS bag, the topic that holds the motion; needed if there is more than one. For example "
            "`--topic /joint_states`."
        ),
    ] = None


AS_TEXT = PrintOptions()
AT_REST = FlightOptions()
AS_RECORDED = RecordingOptions()
