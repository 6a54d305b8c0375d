"""`shapephase plan`: the joint motion that turns a body to a goal."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from ...errors import PlanNotFound, ShapeError
from ..options import (
    BODY_DEFAULTS,
    PRINT_DEFAULTS,
    BodyArgument,
    BodyOptions,
    GivenMomentum,
    PrintOptions,
    ReportFile,
    option,
    rare,
)
from ..outcome import ExitCode, Outcome, check_writable
from ..progress import steps
from ..terminal import write_file
from .constraints import JointOptions, LimitOptions
from .goals import GoalOptions
from .search import SearchOptions, running_search

if TYPE_CHECKING:
    from ...optimal_control.plan import Plan

_CODES = {
    "found": ExitCode.DONE,
    "not found": ExitCode.NOT_FOUND,
    "stopped": ExitCode.STOPPED,
    "out of time": ExitCode.OUT_OF_TIME,
}
# Defaults of the command.
_NO_GOAL, _ALL_JOINTS, _NO_LIMITS, _ONE_SEARCH = GoalOptions(), JointOptions(), LimitOptions(), SearchOptions()


def plan_command(
    body: BodyArgument,
    /,
    *,
    goal: GoalOptions = _NO_GOAL,
    momentum: GivenMomentum = (0.0, 0.0, 0.0),
    duration: Annotated[
        float,
        option("Duration, in s; with --cost time the longest. For example `--duration 0.8`."),
    ] = 1.0,
    joints: JointOptions = _ALL_JOINTS,
    cost: Annotated[
        str,
        option(
            "What is least: kinetic, rate, acceleration, effort (squared torques and forces relative to their limits) "
            "or time; default: kinetic. For example `--cost rate`."
        ),
    ] = "kinetic",
    rates_at_ends: Annotated[
        str,
        rare(
            "Rates of the joints: zero, periodic (equal at both ends, for gaits) or free; default: zero. For example "
            "`--rates-at-ends free`.",
        ),
    ] = "zero",
    limits: LimitOptions = _NO_LIMITS,
    searching: SearchOptions = _ONE_SEARCH,
    out: Annotated[
        Path | None, option("Write the joint motion to this CSV file; for example `--out plan.csv`.")
    ] = None,
    html: ReportFile = None,
    floating: BodyOptions = BODY_DEFAULTS,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Find the cheapest motion of the joints that turns a body to a goal, and compute the resulting motion.

    After Ctrl-C (exit code 130), at the time limit (124) and if nothing is found (7) the best result is printed and
    written; the first line of the file says so.
    """
    from ...body.loading import load_body
    from ...optimal_control.planning import plan_reorientation
    from ...shape_space.files.write import write_shape_path
    from ..texts.plan_text import plan_comment, plan_data, plan_lines, plan_purpose

    target, settings = goal.goal(), searching.search()
    if not 0.0 < duration < math.inf:
        raise ShapeError(f"--duration: a time in s above 0 is needed, got {duration:g}")
    aside = any([check_writable(out, "--out", ".csv"), check_writable(html, "--html", ".html")])
    with steps(3 if html else 2) as work:
        work.begin("loading")
        loaded = load_body(body, **floating.loading)
        arguments, within = joints.arguments(loaded), limits.limits(loaded)
        work.begin("searching")
        with running_search(searching, work) as (search, executor):
            try:
                plan = plan_reorientation(
                    loaded,
                    target,
                    momentum=momentum,
                    duration=duration,
                    cost=cost,
                    rates_at_ends=rates_at_ends,
                    limits=within,
                    search=settings,
                    progress=search.report,
                    executor=executor,
                    **arguments,
                )
            except PlanNotFound as failure:
                if failure.best is None:
                    raise
                plan = cast("Plan", failure.best)
                warnings.warn(str(failure), stacklevel=2)
        write_file(out, lambda file: write_shape_path(plan.path, file, comment=plan_comment(loaded, plan)))
        if html is not None:
            work.begin("making the report")
            from ...phases.phases import split
            from ...plots.report_page import report

            page = report(
                plan.motion,
                split(plan.motion),
                shape_path=plan.path,
                title=f"{loaded.name} turns itself",
                purpose=plan_purpose(plan),
                progress=work.watch,
            )
            write_file(html, page.write)
    return Outcome(
        "\n".join(plan_lines(loaded, plan)),
        plan_data(loaded, plan),
        code=_CODES[plan.status],
        aside=aside,
        made_from=plan.motion.deformation.made_from,
    )
