"""`shapephase audit`: whether trajectories of a simulator or a recorder are right in flight, and if not, why."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .options import (
    BODY_DEFAULTS,
    PRINT_DEFAULTS,
    BodyArgument,
    BodyOptions,
    Calibration,
    FillOption,
    LengthTolerance,
    LowPassOption,
    PrintOptions,
    ResampleOption,
)
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import say_written

_ENDINGS = (".svg", ".pdf", ".png")

Trajectories = Annotated[
    str,
    Parameter(
        help="Its trajectories with the base: NPZ or CSV with MuJoCo's qpos and qvel, Pinocchio's or Drake's q and v, "
        "biorbd's Q and Qdot or bioptim's q and qdot, or a recording with the attitude of the base; several are runs "
        "with different steps. For example `run.npz`."
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class TrajectoryOptions:
    """How a trajectory is read; each is an argument of `read_trajectory`."""

    integrator_step: Annotated[
        tuple[float, ...],
        Parameter(
            show_default=False,
            negative_iterable="",
            consume_multiple=True,
            help="Step of the integrator of each trajectory, in s; without it that between its samples. For example "
            "`--integrator-step 0.001 0.002`.",
        ),
    ] = ()
    step: Annotated[
        float | None,
        Parameter(
            show_default=False,
            help="Time between samples, in s, for files without times; for example `--step 0.01`.",
        ),
    ] = None
    names: Annotated[
        tuple[str, ...],
        Parameter(
            show_default=False,
            negative_iterable="",
            consume_multiple=True,
            help="Which column of a recording is which joint: COLUMN=JOINT, COLUMN= to leave it out, or a file of such "
            "lines; for example `--names LKnee=left_knee`.",
        ),
    ] = ()
    degrees: Annotated[
        bool | None,
        Parameter(
            negative="--radians",
            show_default=False,
            help="Turning joints of a recording are in degrees, or in radians; without it, as the file says. For "
            "example `--degrees`.",
        ),
    ] = None
    joint_order: Annotated[
        str | None,
        Parameter(
            show_default=False,
            help="Order of the joints in MuJoCo's qpos or Isaac's joint_pos without names: mujoco, isaac, "
            "isaac-by-name or body, without unit; without it by the places of bodies in the file, else mujoco. For "
            "example `--joint-order isaac`.",
        ),
    ] = None
    rest_missing: Annotated[
        bool,
        Parameter(
            negative="",
            show_default=False,
            help="Joints without a column rest at zero, or at their limit next to it; for example `--rest-missing`.",
        ),
    ] = False
    ignore_extra: Annotated[
        bool,
        Parameter(
            negative="",
            show_default=False,
            help="Columns that are no joints of the body are left out; for example `--ignore-extra`.",
        ),
    ] = False
    fill: FillOption = None
    lowpass: LowPassOption = None
    resample: ResampleOption = None
    base_order: Annotated[
        str | None,
        Parameter(
            show_default=False,
            help="The axes of the base's recorded angles in the order in which they turn, without unit; without it zxy "
            "for OpenSim's, zyx for roll, pitch and yaw. For example `--base-order yxz`.",
        ),
    ] = None
    base_axes: Annotated[
        str | None,
        Parameter(
            show_default=False,
            help="Where the x, y and z axis of the body's base point to in the axes whose attitude was recorded, "
            "without unit; without it x,-z,y for OpenSim's pelvis, else x,y,z. For example `--base-axes x,y,z`.",
        ),
    ] = None
    calibration: Calibration = None
    length_tolerance: LengthTolerance = None


AS_IT_IS = TrajectoryOptions()


def audit_command(
    body: BodyArgument,
    /,
    *trajectories: Trajectories,
    floating: BodyOptions = BODY_DEFAULTS,
    tolerance: Annotated[float | None, Parameter(show_default=False)] = None,
    flight: Annotated[tuple[str, ...], Parameter(negative_iterable="", consume_multiple=True)] = ("auto",),
    reading: TrajectoryOptions = AS_IT_IS,
    every: Annotated[int | None, Parameter(show_default=False)] = None,
    figure: Path | None = None,
    html: Annotated[Path | None, Parameter(show_default=False)] = None,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Audit trajectories in flight: momentum, fall, attitude and rates, and what explains it if they are wrong.

    The exit code is 0 where all are right within their noise or the tolerance, 10 where one is wrong, and 12 where the
    samples cannot tell, for they hide a fault as large as the tolerance.

    Parameters
    ----------
    tolerance
        Relative tolerance of momentum and rates, and of the fall relative to the body's extent; without it 0.001, and
        for recordings with noise, or of people, the effect of a centimetre of wander. For example `--tolerance 1e-6`.
    flight
        What is in the air: auto (where the centre of mass falls longest), auto:2 (the second such flight), all, or its
        first and last time, in s; for example `--flight all` or `--flight 0.4 1.2`.
    every
        Steps of the integrator between two samples, for files without the step; without it the step is fitted where the
        samples tell it. For example `--every 5`.
    figure
        Write drift, error of the attitude and what the hypotheses leave over to this figure, .svg, .pdf or .png;
        without it none is written. For example `--figure audit.pdf`.
    html
        Write the audit with curves in time and all hypotheses to this HTML file; without it none is written. For
        example `--html audit.html`.
    """
    from ..auditing.figures import write_audit_figure
    from ..auditing.reading import read_trajectory
    from ..auditing.trajectory_audit import audit
    from ..errors import ShapeError
    from .motion import body_argument, column_names, flight_words
    from .outcome import ExitCode

    aside = check_writable(figure, "--figure", *_ENDINGS)
    aside = check_writable(html, "--html", ".html") or aside
    if not trajectories:
        raise ShapeError("audit: one trajectory or more is needed after the body")
    given = reading.integrator_step or (None,)
    if len(given) not in (1, len(trajectories)):
        needed = f"one for each of {len(trajectories)} trajectories is needed"
        raise ShapeError(f"--integrator-step: {needed}, got {len(given)}")
    loaded = body_argument(body, floating)
    each = given if len(given) == len(trajectories) else given * len(trajectories)
    with steps(2) as work:
        work.begin("reading")
        runs = [
            read_trajectory(
                file,
                loaded,
                integrator_step=step,
                names=column_names(reading.names) or None,
                degrees=reading.degrees,
                timestep=reading.step,
                joint_order=reading.joint_order,
                rest_missing=reading.rest_missing,
                ignore_extra=reading.ignore_extra,
                fill=reading.fill,
                lowpass=reading.lowpass,
                resample=reading.resample,
                base_order=reading.base_order,
                base_axes=reading.base_axes,
                calibration=reading.calibration,
                length_tolerance=reading.length_tolerance,
            )
            for file, step in zip(trajectories, each, strict=True)
        ]
        work.begin("auditing")
        found = audit(loaded, runs, tolerance=tolerance, flight=flight_words(flight) or "auto", every=every)
        if figure is not None:
            write_audit_figure(found, figure)
            say_written(figure)
        if html is not None:
            from ..auditing.page import audit_page

            audit_page(loaded, runs, found).write(html)
            say_written(html)
    code = ExitCode.WRONG if found.wrong else ExitCode.DONE if found.right else ExitCode.UNDECIDED
    return Outcome(found.table(), found.record, code=code, aside=aside, made_from={})
