"""`shapephase audit`: whether trajectories of a simulator or a recorder are right in flight, and if not, why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import ShapeError
from . import options
from .outcome import FIGURE_ENDINGS, ExitCode, Outcome, check_writable
from .progress import steps
from .terminal import write_file

Trajectories = Annotated[
    str,
    Parameter(
        help="Its trajectories with the base: NPZ or CSV with MuJoCo's qpos and qvel, Pinocchio's or Drake's q and v, "
        "biorbd's Q and Qdot or bioptim's q and qdot, or a recording with the attitude of the base; several are runs "
        "with different steps. For example `run.npz`."
    ),
]


def audit_command(
    body: options.BodyArgument,
    /,
    *trajectories: Trajectories,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    tolerance: Annotated[float | None, Parameter(show_default=False)] = None,
    flight: Annotated[tuple[str, ...], Parameter(negative_iterable="", consume_multiple=True)] = ("auto",),
    reading: options.TrajectoryOptions = options.TRAJECTORY_DEFAULTS,
    every: Annotated[int | None, Parameter(show_default=False)] = None,
    figure: Path | None = None,
    html: Annotated[Path | None, Parameter(show_default=False)] = None,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Audit trajectories in flight: momentum, fall, attitude and rates, and what explains it if they are wrong.

    The exit code is 0 where all are right within their noise or the tolerance, 10 where one is wrong, and 12 where the
    samples cannot tell, for they hide a fault as large as the tolerance.

    Parameters
    ----------
    tolerance
        Tolerance of momentum and rates as a fraction of them, and of the fall as a fraction of the body's extent;
        without it 0.001, and for recordings with noise, or of people, the effect of a centimetre of wander. For example
        `--tolerance 1e-6`.
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
    from .motion import body_argument, column_names, flight_words

    aside = check_writable(figure, "--figure", *FIGURE_ENDINGS)
    aside = check_writable(html, "--html", ".html") or aside
    if not trajectories:
        raise ShapeError("audit: one trajectory or more is needed after the body")
    given = reading.integrator_step or (None,)
    if len(given) not in (1, len(trajectories)):
        needed = f"one for each of {len(trajectories)} trajectories is needed"
        raise ShapeError(f"--integrator-step: {needed}, got {len(given)}")
    loaded = body_argument(body, floating)
    each = given if len(given) == len(trajectories) else given * len(trajectories)
    choices: dict[str, Any] = vars(reading) | {"timestep": reading.step, "names": column_names(reading.names) or None}
    del choices["step"], choices["integrator_step"]
    with steps(2) as work:
        work.begin("reading")
        runs = [
            read_trajectory(file, loaded, integrator_step=step, **choices)
            for file, step in zip(trajectories, each, strict=True)
        ]
        work.begin("auditing")
        found = audit(loaded, runs, tolerance=tolerance, flight=flight_words(flight) or "auto", every=every)
        write_file(figure, lambda file: write_audit_figure(found, file))
        if html is not None:
            from ..auditing.page import audit_page

            write_file(html, audit_page(loaded, runs, found).write)
    code = ExitCode.WRONG if found.wrong else ExitCode.DONE if found.right else ExitCode.UNDECIDED
    return Outcome(found.table(), found.record, code=code, aside=aside, made_from={})
