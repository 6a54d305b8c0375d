"""`shapephase plan`: the joint motion that turns a body to a goal."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from cyclopts import Parameter

from ...errors import PlanNotFound, ShapeError
from ..options import (
    BODY_DEFAULTS,
    ERROR_DEFAULTS,
    PRINT_DEFAULTS,
    RARE,
    RECORDING_DEFAULTS,
    START_DEFAULTS,
    BodyArgument,
    BodyOptions,
    ErrorOptions,
    PrintOptions,
    RecordingOptions,
    ReportFile,
    StartOptions,
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
    start: StartOptions = START_DEFAULTS,
    duration: Annotated[
        float | None,
        option(
            "Duration, in s; with --cost time the longest; default: 1, or as long as --undo. For example "
            "`--duration 0.8`."
        ),
    ] = None,
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
    recording: Annotated[RecordingOptions, Parameter(name="*", group=RARE)] = RECORDING_DEFAULTS,
    errors: Annotated[ErrorOptions, Parameter(name="*", group=RARE)] = ERROR_DEFAULTS,
    floating: BodyOptions = BODY_DEFAULTS,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Find the cheapest motion of the joints that turns a body to a goal, and compute the resulting motion.

    After Ctrl-C (exit code 130), at the time limit (124) and if nothing is found (7) the best result is printed and
    written; the first line of the file says so.
    """
    from ...body.loading import load_body
    from ...optimal_control.planning import plan_reorientation
    from ...optimal_control.way_back import undo
    from ...shape_space.files.write import write_shape_path
    from ..texts.error_bar_text import error_bar_data, error_bars
    from ..texts.plan_text import (
        end_bar_lines,
        plan_comment,
        plan_data,
        plan_lines,
        plan_purpose,
        undo_data,
        undo_lines,
        undo_purpose,
    )
    from ..texts.recording_text import recording_data
    from .from_motion import check_needed, matched, undone

    target, settings = goal.goal(), searching.search()
    if duration is not None and not 0.0 < duration < math.inf:
        raise ShapeError(f"--duration: a time in s above 0 is needed, got {duration:g}")
    check_needed(goal, start, recording)
    aside = any([check_writable(out, "--out", ".csv"), check_writable(html, "--html", ".html")])
    with steps(3 if html else 2) as work:
        work.begin("loading")
        loaded = load_body(body, **floating.loading)
        within, arguments = limits.limits(loaded), joints.arguments(loaded)
        flown, ways, plan = None, None, None
        if goal.undo is not None:
            flown = undone(body, goal.undo, start, recording, floating, joints, rates_at_ends)
            loaded = flown.body
        elif goal.match is not None:
            target, more = matched(body, goal.match, start, recording, floating)
            arguments |= more
        else:
            arguments["momentum"] = (0.0, 0.0, 0.0) if start.momentum is None else start.momentum
        work.begin("searching")
        with running_search(searching, work) as (search, executor):
            shared = {
                "cost": cost,
                "limits": within,
                "search": settings,
                "progress": search.report,
                "executor": executor,
            }
            try:
                if flown is not None:
                    moving = {name: arguments[name] for name in ("joints", "symmetric")}
                    ways = undo(flown.motion, duration=duration, **shared, **moving)
                else:
                    length = 1.0 if duration is None else duration
                    plan = plan_reorientation(
                        loaded, target, duration=length, rates_at_ends=rates_at_ends, **shared, **arguments
                    )
            except PlanNotFound as failure:
                if failure.best is None:
                    raise
                plan = cast("Plan", failure.best)
                warnings.warn(str(failure), stacklevel=2)
        shown = plan if ways is None else ways.best
        bars = error_bars(shown.motion, errors, None)
        purpose = plan_purpose(plan) if ways is None else undo_purpose(ways)
        comment = plan_comment(loaded, plan) if ways is None else f"shapephase plan, {loaded.name}: {purpose}"
        write_file(out, lambda file: write_shape_path(shown.path, file, comment=comment))
        if html is not None:
            work.begin("making the report")
            from ...phases.phases import split
            from ...plots.report_page import report

            page = report(
                shown.motion,
                split(shown.motion),
                shape_path=shown.path,
                title=f"{loaded.name} turns itself",
                purpose=purpose,
                progress=work.watch,
            )
            write_file(html, page.write)
    if ways is None:
        lines, data, code = plan_lines(loaded, plan), plan_data(loaded, plan), _CODES[plan.status]
    else:
        lines, data = undo_lines(loaded, flown, ways), undo_data(loaded, ways) | recording_data(flown.recorded)
        code = ExitCode.DONE if ways.status == "not found" else _CODES[ways.status]
    return Outcome(
        "\n".join([*lines, *end_bar_lines(bars)]),
        data | error_bar_data(bars),
        code=code,
        aside=aside,
        made_from=shown.motion.deformation.made_from,
    )
