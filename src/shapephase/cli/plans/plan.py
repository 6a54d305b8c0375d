"""`shapephase plan`: the joint motion that turns a body to a goal."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, cast

from cyclopts import Parameter

from ...errors import PlanNotFound, ShapeError
from .. import options
from ..options import option, rare
from ..outcome import ExitCode, Outcome, check_writable
from ..progress import steps
from ..terminal import write_file
from .constraints import JointOptions, LimitOptions
from .goals import GoalOptions
from .search import SearchOptions, running_search

if TYPE_CHECKING:
    from ...optimal_control.plan import Plan
    from ...optimal_control.way_back import Undo
    from ...reconstruction.reconstruction import Motion
    from ...shape_space.shape_path import ShapePath
    from ..motion import LoadedMotion

_CODES = {
    "found": ExitCode.DONE,
    "not found": ExitCode.NOT_FOUND,
    "stopped": ExitCode.STOPPED,
    "out of time": ExitCode.OUT_OF_TIME,
}
# Defaults of the command.
_NO_GOAL, _ALL_JOINTS, _NO_LIMITS, _ONE_SEARCH = GoalOptions(), JointOptions(), LimitOptions(), SearchOptions()


def plan_command(
    body: options.BodyArgument,
    /,
    *,
    goal: GoalOptions = _NO_GOAL,
    start: options.StartOptions = options.START_DEFAULTS,
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
    html: options.ReportFile = None,
    recording: Annotated[
        options.RecordingOptions, Parameter(name="*", group=options.RARE)
    ] = options.RECORDING_DEFAULTS,
    errors: Annotated[options.ErrorOptions, Parameter(name="*", group=options.RARE)] = options.ERROR_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
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
    from ..texts.plan_text import end_bar_lines
    from .from_motion import check_needed, matched, undone

    target, settings = goal.goal(), searching.search()
    if duration is not None and not 0.0 < duration < math.inf:
        raise ShapeError(f"--duration: a time in s above 0 is needed, got {duration:g}")
    check_needed(goal, start, recording)
    aside = any([check_writable(out, "--out", ".csv"), check_writable(html, "--html", ".html")])
    with steps(3 if html else 2) as work:
        work.begin("loading")
        loaded, flown = load_body(body, **floating.loading), None
        within, arguments = limits.limits(loaded), joints.arguments(loaded)
        if goal.undo is not None:
            flown = undone(body, goal.undo, start, recording, floating, joints, rates_at_ends)
        elif goal.match is not None:
            arguments |= matched(body, goal.match, start, recording, floating)
        else:
            arguments |= {"goal": target, "momentum": (0.0, 0.0, 0.0) if start.momentum is None else start.momentum}
        work.begin("searching")
        with running_search(searching, work) as (search, executor):
            shared: dict[str, Any] = {
                "cost": cost,
                "limits": within,
                "search": settings,
                "progress": search.report,
                "executor": executor,
            }
            try:
                if flown is not None:
                    shared |= {name: arguments[name] for name in ("joints", "symmetric")}
                    result = _undone(flown, undo(flown.motion, duration=duration, **shared))
                else:
                    shared |= {"duration": 1.0 if duration is None else duration, "rates_at_ends": rates_at_ends}
                    result = _planned(plan_reorientation(loaded, **shared, **arguments))
            except PlanNotFound as failure:
                if failure.best is None:
                    raise
                result = _planned(cast("Plan", failure.best))
                warnings.warn(str(failure), stacklevel=2)
        bars = error_bars(result.motion, errors, None)
        write_file(out, lambda file: write_shape_path(result.path, file, comment=result.comment))
        if html is not None:
            work.begin("making the report")
            from ...phases.phases import split
            from ...plots.pages.report_page import report

            page = report(
                result.motion,
                split(result.motion),
                shape_path=result.path,
                title=f"{loaded.name} turns itself",
                purpose=result.purpose,
                progress=work.watch,
            )
            write_file(html, page.write)
    return Outcome(
        "\n".join([*result.lines, *end_bar_lines(bars)]),
        result.data | error_bar_data(bars),
        code=result.code,
        aside=aside,
        made_from=result.motion.deformation.made_from,
    )


class _Result(NamedTuple):
    """Motion of the joints that the command found, and what is printed and written of it."""

    motion: Motion
    path: ShapePath
    lines: list[str]
    data: dict[str, Any]
    purpose: str
    comment: str
    code: ExitCode


def _planned(plan: Plan) -> _Result:
    from ...body.loading import as_body
    from ..texts.plan_text import plan_comment, plan_data, plan_lines, plan_purpose

    body, code = as_body(plan.body), _CODES[plan.status]
    lines, comment = plan_lines(body, plan), plan_comment(body, plan)
    return _Result(plan.motion, plan.path, lines, plan_data(body, plan), plan_purpose(plan), comment, code)


def _undone(flown: LoadedMotion, ways: Undo) -> _Result:
    """Return the best way back; one played backwards is a result, too, where the search found none."""
    from ..texts.plan_text import undo_data, undo_lines, undo_purpose
    from ..texts.recording_text import recording_data

    best, purpose = ways.best, undo_purpose(ways)
    data = undo_data(flown.body, ways) | recording_data(flown.recorded)
    comment = f"shapephase plan, {flown.body.name}: {purpose}"
    code = ExitCode.DONE if ways.status == "not found" else _CODES[ways.status]
    return _Result(best.motion, best.path, undo_lines(flown, ways), data, purpose, comment, code)
