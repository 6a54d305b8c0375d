"""`shapephase plan`: the joint motion that turns a body to a goal."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from cyclopts import Parameter

from ...errors import PlanNotFound, ShapeError
from ..exit_codes import ExitCode
from ..options import AS_TEXT, AS_WRITTEN, BodyArgument, BodyOptions, GivenMomentum, PrintOptions, ReportFile
from ..outcome import Outcome, check_writable
from ..progress import Steps, steps
from ..terminal import say_written
from .goals import GoalWords
from .postures import mirrored, moving_joints, posture, waypoint

if TYPE_CHECKING:
    from ...body.body import Body
    from ...optimal_control.plan import Plan, Progress
    from ...optimal_control.plan_options import Limits

# What stands for the limits that a body's file states.
_OF_THE_FILE = "body"
# What a part of a limit is of, where that is not plain.
_FROM_MIDDLE = {"position": ", from the middle of the range"}
# Numbers may begin with a minus.
_SIGNED = Parameter(allow_leading_hyphen=True, negative_iterable="", show_default=False)
_CODES = {
    "found": ExitCode.DONE,
    "not found": ExitCode.NOT_FOUND,
    "stopped": ExitCode.STOPPED,
    "out of time": ExitCode.OUT_OF_TIME,
}


def plan_command(
    body: BodyArgument,
    /,
    *,
    floating: BodyOptions = AS_WRITTEN,
    turn: Annotated[tuple[str, ...], _SIGNED] = (),
    point: Annotated[tuple[str, str] | None, _SIGNED] = None,
    rotate: float | None = None,
    about: Annotated[str | None, _SIGNED] = None,
    symmetry: Annotated[str | None, _SIGNED] = None,
    momentum: GivenMomentum = (0.0, 0.0, 0.0),
    duration: float = 1.0,
    somersaults: float | None = None,
    half_twists: float | None = None,
    from_: Annotated[str | None, Parameter(name="--from")] = None,
    to: str | None = None,
    via: Annotated[tuple[str, ...], Parameter(negative_iterable="", show_default=False)] = (),
    joints: str | None = None,
    hold: str | None = None,
    mirror: str | None = None,
    cost: str = "kinetic",
    rates_at_ends: str = "zero",
    rate_limit: float | None = None,
    acceleration_limit: float | None = None,
    jerk_limit: float | None = None,
    effort: str | None = None,
    starts: int = 1,
    workers: int | None = None,
    time_limit: float | None = None,
    seed: int = 0,
    pieces: int | None = None,
    iterations: int = 300,
    out: Path | None = None,
    html: ReportFile = None,
    printing: PrintOptions = AS_TEXT,  # noqa: ARG001
) -> Outcome:
    """Find the cheapest motion of the joints that turns a body to a goal, and compute the resulting motion.

    Ctrl-C ends the search; the best motion so far is printed and written, and the exit code is 130. So does its time
    limit, with the exit code 124. If the search finds nothing, its best try is printed and written, and the exit code
    is 7. The file says so in its first line.

    Parameters
    ----------
    turn
        The turn at the end: degrees, and an axis of the base at the start (x, y, z, or three numbers with commas
        between them); of several the one that costs least. For example `--turn "90 about y"`.
    point
        Two vectors instead: an axis of the base, or behind its name of a link as it is at the end, and the direction
        that this has to have at the end, in inertial axes, of any length; the turn about it is free. For example
        `--point "dish 0 0 1" "0 1 0"`.
    symmetry
        Turns of the body, before that of the goal, after which it looks the same: how often about an axis of the base,
        or behind a link's name in --point of this, or an axis alone, for all turns about it. For example
        `--symmetry "4 about x"`.
    rotate
        Angle of the turn, in degrees, as with --turn. For example `--rotate 180`.
    about
        Axis of the turn: x, y or z of the base at the start, or three numbers with commas between them; x where
        --rotate is given without it. For example `--about 0,1,1`.
    duration
        Of the motion, in s; for the cost "time" the longest allowed. For example `--duration 0.8`.
    somersaults
        Turns about the momentum, instead of --rotate; 0 where only --half-twists is given. For example
        `--somersaults 1.5 --momentum 0 40 0`.
    half_twists
        Half turns about the z axis of the base, with --somersaults; 0 where only that is given. For example
        `--half-twists 2`.
    from_
        Posture at the start: NAME=VALUE pairs with commas between them, in rad or m, or in degrees with deg behind the
        number, or the first row of a motion file; without it zero, or as near as the limits permit. For example
        `--from waist_pitch=30deg,waist_yaw=0.1`.
    to
        Posture at the end, like --from, of a file the last row; or free; without it as at the start. For example
        `--to free`.
    via
        Posture on the way, which the joints pass without stopping: NAME=VALUE pairs, the other joints being as they
        like, with a time in s behind @ or without; or that of a motion file at a time, passed then. More than once, in
        this order. For example `--via waist_pitch=60deg@0.4`.
    joints
        Those that may move, with commas between their names; without it all. For example
        `--joints waist_pitch,waist_yaw`.
    hold
        Those that rest at the posture of the start, instead. For example `--hold head_yaw`.
    mirror
        Joints that follow others, or with a minus move against them. For example `--mirror hip_left=-hip_right`.
    cost
        What is made least: kinetic, rate, acceleration, effort (the squared torques and forces of all joints, each as
        a part of its limit) or time; for example `--cost rate`.
    rates_at_ends
        Of the joints: zero (from rest to rest), periodic (the same at both ends, for gaits) or free; for example
        `--rates-at-ends free`.
    rate_limit
        The largest rate of every joint, in rad/s or m/s; without it those that the body's file states. For example
        `--rate-limit 3`.
    acceleration_limit
        The largest acceleration of every joint, in rad/s^2 or m/s^2; without it any. For example
        `--acceleration-limit 20`.
    jerk_limit
        The largest jerk, the rate of the acceleration, in rad/s^3 or m/s^3; without it any. From rest joints then start
        without acceleration. For example `--jerk-limit 100`.
    effort
        The largest torque or force of every joint, in N m or N, or the word body for those that the body's file states;
        without it any. For example `--effort body`.
    starts
        Searches from different guesses, of which the cheapest plan is kept; for example `--starts 4`.
    workers
        Processes of this machine that search side by side, without unit; without it one search after the other. For
        example `--workers 4`.
    time_limit
        The longest that the search may take, in s; then it ends with the best so far. For example `--time-limit 60`.
    seed
        Of the random guesses, a whole number; for example `--seed 7`.
    pieces
        Of the spline that the motion is, six or more; without it as many as suit the number of joints, from 20 to 160.
        Few are quick to try. For example `--pieces 12`.
    iterations
        The most that the solver takes for each start; for example `--iterations 1000`.
    out
        Write the joint motion to this CSV file; without it none is written. For example `--out plan.csv`.
    """
    from ...body.loading import load_body
    from ...optimal_control.plan_options import Search
    from ...optimal_control.planning import plan_reorientation
    from ...phases.phases import split
    from ...shape_space.files.read import write_shape_path

    limits = _limits(rate_limit, acceleration_limit, jerk_limit, effort)
    words = GoalWords(turn, rotate, about, point, symmetry, somersaults, half_twists)
    words.check()
    goal = words.goal()
    _check_search(workers, time_limit)
    if not 0.0 < duration < math.inf:
        raise ShapeError(f"--duration: a time in s above 0 is needed, got {duration:g}")
    aside = check_writable(out, "--out", ".csv")
    aside = check_writable(html, "--html", ".html") or aside
    with steps(12 if html else 2) as work:
        work.begin("loading")
        loaded = load_body(body, **floating.loading)
        start = None if from_ is None else posture(loaded, from_, "--from", first=True)
        end = to if to in (None, "free") else posture(loaded, to, "--to", first=False)
        status = ""
        work.begin("searching")
        beside = workers is not None and workers > 1
        with (
            _stoppable(work, time_limit, beside=beside) as search,
            _executor(workers if beside else None, search) as executor,
        ):
            try:
                found = plan_reorientation(
                    loaded,
                    goal,
                    momentum=momentum,
                    duration=duration,
                    start=start,
                    end=end,
                    via=[waypoint(loaded, one) for one in via],
                    cost=cost,
                    rates_at_ends=rates_at_ends,
                    joints=moving_joints(loaded, joints, hold),
                    symmetric=mirrored(mirror),
                    limits=limits,
                    search=Search(
                        starts=starts, seed=seed, pieces=pieces, iterations=iterations, time_limit=time_limit
                    ),
                    iteration_callback=search.report,
                    executor=executor,
                )
            except PlanNotFound as failure:
                if failure.best is None:
                    raise
                found, status = cast("Plan", failure.best), str(failure)
        if status:
            warnings.warn(status, stacklevel=2)
        if out is not None:
            write_shape_path(found.path, out, comment=_comment(loaded, found))
            say_written(out)
        if html is not None:
            from ...plotting.report import write_report

            write_report(
                found.motion,
                split(found.motion),
                html,
                shape_path=found.path,
                title=f"{loaded.name} turns itself",
                purpose=_purpose(found),
                begin=work.begin,
            )
            say_written(html)
    text, data = _text(loaded, found, momentum), _data(loaded, found, momentum)
    return Outcome(
        text,
        data,
        code=_CODES[found.status],
        aside=aside,
        made_from=found.motion.deformation.made_from,
    )


def _limits(
    rate_limit: float | None, acceleration_limit: float | None, jerk_limit: float | None, effort: str | None
) -> Limits:
    """What the joints have to stay within. Raises ShapeError."""
    from ...optimal_control.plan_options import Limits

    return Limits(
        rate_limits=_OF_THE_FILE if rate_limit is None else rate_limit,
        acceleration_limits=acceleration_limit,
        jerk_limits=jerk_limit,
        effort_limits=None if effort is None else _effort(effort),
    )


def _effort(word: str) -> float | str:
    """One number, or the body's own. Raises ShapeError."""
    if word == _OF_THE_FILE:
        return word
    try:
        return float(word)
    except ValueError:
        raise ShapeError(
            f"--effort: a number of N m or N above 0 is needed, or {_OF_THE_FILE} for those of the body's file, got "
            f"{word!r}"
        ) from None


def _check_search(workers: int | None, time_limit: float | None) -> None:
    """Raise ShapeError for numbers that no search can keep to."""
    if workers is not None and workers < 1:
        raise ShapeError(f"--workers: a whole number above 0 is needed, got {workers}")
    if time_limit is not None and not 0.0 < time_limit < math.inf:
        raise ShapeError(f"--time-limit: a time in s above 0 is needed, got {time_limit:g}")


@contextmanager
def _deaf() -> Iterator[None]:
    """Ctrl-C is ignored, also by processes that begin meanwhile."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _executor(workers: int | None, search: _InterruptibleSearch) -> Iterator[Executor | None]:
    """Processes that search side by side; None where one is enough."""
    if workers is None:
        yield None
        return
    from ...optimal_control.solver_callback import keep_interrupts

    # A process that was forked beside threads of the solver may hang.
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=spawned, initializer=keep_interrupts) as processes:
        # They begin deaf to Ctrl-C, until they can take note of it.
        with _deaf():
            processes.submit(int)
        search.beside = [process.pid for process in multiprocessing.active_children() if process.pid is not None]
        try:
            if search.stopped:
                search.end_beside()
            yield processes
        finally:
            search.end_beside()
            processes.shutdown(cancel_futures=True)


def _text(body: Body, found: Plan, momentum: tuple[float, float, float]) -> str:
    from ...phases.split_text import rotation_line

    passed = " ".join(f"{time:.6g}" for time in found.waypoint_times)
    return "\n".join(
        [
            _heading(body, found.path.duration, momentum),
            "",
            f"{'status':24}{found.status:>16}",
            rotation_line("turned", found.motion.final_attitude),
            f"{'off the goal':24}{found.goal_error:16.2e} rad",
            f"{'cost':24}{found.cost:16.9g}   {found.cost_unit} ({found.cost_name})",
            f"{'rates at the ends':24}{found.rates_at_ends:>16}",
            *(
                f"{f'{name} at most':24}{share:16.4%}   of its limit{_FROM_MIDDLE.get(name, '')}"
                for name, share in found.limit_shares.items()
            ),
            *([f"{'waypoints passed at':24}{passed:>16} s"] if passed else []),
            f"{'off the minimum':24}{found.kkt_residual:16.2e}       (residual of the conditions of a minimum, scaled)",
            f"{'iterations':24}{found.iterations:16d}       (in {found.seconds:.1f} s, {_searches(len(found.starts))})",
        ]
    )


def _searches(count: int) -> str:
    return "one search" if count == 1 else f"{count} searches"


def _data(body: Body, found: Plan, momentum: tuple[float, float, float]) -> dict[str, object]:
    from ... import so3

    return {
        "body": body.name,
        "status": found.status,
        "duration_s": found.path.duration,
        "momentum_kg_m2_s": list(momentum),
        "final_attitude_quat_xyzw": so3.quat_from_matrix(found.motion.final_attitude).tolist(),
        "miss_rad": found.goal_error,
        "cost": found.cost,
        "cost_name": found.cost_name,
        "cost_unit": found.cost_unit,
        "rates_at_ends": found.rates_at_ends,
        "limit_shares": dict(found.limit_shares),
        "waypoint_times_s": found.waypoint_times.tolist(),
        "kkt_residual": found.kkt_residual,
        "iterations": found.iterations,
        "seconds": found.seconds,
        "searches": len(found.starts),
        "searches_that_agree": found.agreeing_starts,
        "second_order_met": found.second_order,
        "hamiltonian_spread": found.hamiltonian_spread,
    }


class _InterruptibleSearch:
    """A search on the terminal, which Ctrl-C ends after the iteration in progress.

    Attributes
    ----------
    reported : whether there will be something to keep: an iteration has been reported, or others search
    stopped : whether Ctrl-C has been pressed since
    beside : ids of the processes that search side by side
    """

    def __init__(self, work: Steps, time_limit: float | None, *, beside: bool = False) -> None:
        self._work = work
        self._end = math.inf if time_limit is None else time.monotonic() + time_limit
        self.reported, self.stopped = beside, False
        self.beside: list[int] = []

    def report(self, now: Progress) -> bool:
        """Show the progress of the search; returns whether to stop it."""
        which = f" {now.start} of {now.starts}" if now.starts > 1 else ""
        left = "" if self._end == math.inf else f", {max(self._end - time.monotonic(), 0.0):.0f} s left"
        self._work.say(
            f"{now.stage}{which}: iteration {now.iteration}, off the goal by {now.goal_error:.1e} rad, "
            f"cost {now.cost:.6g}{left}"
        )
        self.reported = True
        return self.stopped

    def end_beside(self) -> None:
        """Ctrl-C for those that search side by side."""
        for process in self.beside:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGINT)

    def interrupted(self, *_: Any) -> None:
        """Ctrl-C: the search ends after this iteration; pressed again, at once."""
        if self.stopped or not self.reported:
            raise KeyboardInterrupt
        self.stopped = True
        self.end_beside()
        self._work.say("stopping, to keep the best so far (Ctrl-C again gives it up)")


@contextmanager
def _stoppable(work: Steps, time_limit: float | None, *, beside: bool) -> Iterator[_InterruptibleSearch]:
    """A search that Ctrl-C stops."""
    search = _InterruptibleSearch(work, time_limit, beside=beside)
    if threading.current_thread() is not threading.main_thread():
        # Python hands Ctrl-C to the main thread alone.
        yield search
        return
    before = signal.signal(signal.SIGINT, search.interrupted)
    try:
        yield search
    finally:
        signal.signal(signal.SIGINT, before)


_ENDINGS = {
    "found": "This is the cheapest plan that was found",
    "not found": "No plan was found; this is the nearest that the search came",
    "stopped": "The search was stopped; this is the best until then",
    "out of time": "The search ended by its time limit; this is the best until then",
}


def _purpose(found: Plan) -> str:
    """Sentences for a page."""
    return (
        f"{_ENDINGS[found.status]}: off the goal by {found.goal_error:.1e} rad, cost {found.cost:.6g} "
        f"{found.cost_unit} ({found.cost_name})."
    )


def _comment(body: Body, found: Plan) -> str:
    return (
        f"shapephase plan, {body.name}: {found.status}; off the goal by {found.goal_error:.1e} rad, cost "
        f"{found.cost:.9g} {found.cost_unit} ({found.cost_name}), KKT residual {found.kkt_residual:.1e}"
    )


def _heading(body: Body, duration: float, momentum: tuple[float, float, float]) -> str:
    numbers = " ".join(f"{value:g}" for value in momentum)
    return f"{body.name}: {duration:g} s, {body.n_joints} joints, momentum ({numbers}) kg m^2/s"
