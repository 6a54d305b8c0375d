"""Reorientation: the cheapest motion of the joints that turns a free body to a goal."""

from __future__ import annotations

import math
import pickle
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_executor, check_object
from ..body.body import Body
from ..errors import PlanNotFound
from ..run_progress import ProgressCallback, check_progress
from ._certificates import hamiltonian_spread
from ._local_search import Attempt, LocalSearch, corrected_attempt, failure_message, guessed_attitudes, polished_path
from ._plan_limits import limit_shares, position_share, warn_of_unstated
from ._reachable_turns import check_reachable
from ._reduced import check_reducible
from ._spline_basis import SplineBasis
from .collocation import CollocationProgram
from .guesses.loops import PLACES, Guess, guess_of, guess_of_control, guesses
from .guesses.stroke_program import StrokeProgram, strokes_suffice
from .guesses.strokes import guess_of_strokes, most_of_a_loop
from .plan import Plan
from .plan_options import Goal, Limits, Search, goal_argument
from .solver_callback import STOP_REQUESTED, IterationCallback
from .task import Reorientation, reorientation
from .waypoints import Waypoint

# Few free joints: each piece is so cheap that the spline can be as fine as an extremal needs.
_FEW_JOINTS = 4
# Many free joints: the spline is coarse and no coarse search comes first.
_MANY_JOINTS = 8
# Pieces of the spline for few joints: paths of so many obey Wong's equations to 1e-4. For the acceleration cost they
# would lose digits, as second derivatives of the basis grow with the square of the pieces; and from rest the joints
# start within a piece, which is to be no shorter than a machine can do.
_PIECES_OF_FEW = 160
# Pieces up to `_MANY_JOINTS`, and beyond.
_PIECES = 40
_PIECES_OF_MANY = 20
# Pieces of the coarse search that ranks the guesses, for few joints and for more: enough for a loop to bend.
_COARSE_PIECES = 10
_COARSE_PIECES_OF_MORE = 20
# Guesses that it ranks for each start, and at most unless there are more starts; for few joints, where they are cheap,
# not fewer than eight.
_RANKED = 4
_MOST_RANKED = 16
_LEAST_OF_FEW = 8
# Joints up to which guesses are ranked for several starts; for one, up to `_MANY_JOINTS`.
_RANKED_JOINTS = 12
# How often a loop that starts as a circle may go round: it bends into some rounds more than it starts with.
_ROUNDS_OF_LOOPS = 4
# Further guesses that are gone on with where none of those asked for leads to a plan: near a degenerate optimum
# rounding decides whether a search comes to it.
_SPARE = 2
# The most iterations for each: those that have not ended by then are near enough to be ranked.
_COARSE_ITERATIONS = 40
# Its accuracy, scaled: it has to find the right basin, not the optimum.
_COARSE_TOLERANCE = 1e-4
# The same before "reduced", which without second derivatives does not get along a flat valley: it starts at its end.
_COARSE_ITERATIONS_OF_REDUCED = 100
_COARSE_TOLERANCE_OF_REDUCED = 1e-6
# Constraint violation, scaled, up to which its end is gone on with; else the guess itself is, after all others.
_COARSE_INFEASIBILITY = 1e-2
_STAGES = {"guesses": (0.0, 0.3), "search": (0.3, 1.0)}  # shares of the whole between which each is reported
_USUAL_ITERATIONS = 50  # iterations after which half of a start is reported as done


def plan_reorientation(
    body: Body,
    goal: Goal | ArrayLike,
    *,
    momentum: ArrayLike = 0.0,
    duration: float = 1.0,
    start: ArrayLike | None = None,
    end: Any = None,
    via: Sequence[Waypoint] = (),
    cost: str = "kinetic",
    rates_at_ends: str = "zero",
    joints: Sequence[str] | None = None,
    symmetric: Mapping[str, tuple[str, float]] | None = None,
    limits: Limits | None = None,
    search: Search | None = None,
    progress: ProgressCallback | None = None,
    executor: Executor | None = None,
) -> Plan:
    """The cheapest motion of the joints that turns a free body to a goal: the falling cat's problem, for any body.

    The attitude is the identity at the start. The path is a C2 cubic spline; its motion is reconstructed by the
    library's integrator, and the path corrected until that motion reaches the goal.

    Parameters
    ----------
    goal : (3, 3) attitude at the end, or any of several (k, 3, 3); or a `Goal`: an axis to be pointed, of the base or
        of a link, an attitude up to a symmetry of the body, or somersaults and twists to be counted
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]; 0: none
    duration : [s]; for cost "time" the longest allowed
    start : (n,) shape at the start [rad or m]; None: neutral, or as near as the limits permit
    end : (n,) shape at the end; None: as at the start, a closed loop; "free": any
    via : what the path passes through on its way, in this order: a `Waypoint` is a shape, or the coordinates of some
        joints, with a time or without
    cost : "kinetic", the integral of 1/2 r' (M_ss - M_sb M_bb^-1 M_bs) r' over time [J s], the kinetic energy that the
        joint motion has without angular momentum, M the mass matrix with base b and joints s: joints that undo each
        other, as in a flat gimbal, move at no cost and may then jump; "rate", that of 1/2 |r'|^2; "acceleration", that
        of 1/2 |r''|^2; "effort", that of the squared torques and forces of all joints, each as a part of its limit [s];
        "time", the duration, under rate limits
    rates_at_ends : of the joints; "zero": from rest to rest, for the cost "acceleration" without acceleration at the
        ends, too; "periodic": the same at both ends, for gaits; "free": any, as the theory of optimal loops has it: the
        body would have to be set in motion before the start, and stopped after the end
    joints : names of those that may move, the others are held at the start; None: all
    symmetric : joints that follow others: name -> (name of the leader, factor)
    limits : of positions, rates, accelerations, jerks and efforts; None: `Limits()`, positions and rates as the body's
        file has them
    search : method, starts, resolution; None: `Search()`
    progress : called after each iteration as `progress(share, text)`: the share of the search that is done, from 0 to
        1, which never falls, and a text such as "search 2 of 3: iteration 12, off the goal by 2.0e-02 rad, cost 0.125".
        A true return stops the search, as its time limit does (`Search.time_limit`): the cheapest plan of the starts
        that had ended is returned, or else PlanNotFound raised with the best so far. Ctrl-C is raised as
        KeyboardInterrupt, and nothing is kept
    executor : of `concurrent.futures` or of a cluster (`distributed.Client.get_executor()`), whose processes search
        from several starts (`Search.starts`) side by side; `progress` is then called when a start has ended.
        None: one start after the other, here. Plans do not depend on it

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For arguments of the wrong shape, ends beyond the limits, unknown names.
    UnreachableGoalError
        If no motion can reach the goal, as the holonomy algebra (`reachable`) or a plane of symmetry shows at once.
    PlanNotFound
        If no start came to a local optimum that reaches the goal, or `progress` or its time limit stopped the search
        before; it carries the best attempt.

    Warns
    -----
    UnstatedLimitWarning
        If `limits` takes those of rates or efforts from the body's file, and it states none for a joint.

    Notes
    -----
    Equation :eq:`isoholonomic` of the documentation.
    Source: Montgomery 1990, Isoholonomic problems and some applications.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> goal, search = sp.so3.exp(np.array([1.0, 0.0, 0.0])), sp.optimal_control.Search(pieces=16)
    >>> plan = sp.plan_reorientation(cat, goal, search=search)
    >>> print(f"{sp.so3.angle(goal.T @ plan.motion.final_attitude):.6f} rad off")
    0.000000 rad off
    """
    check_object(body, "Body", "body")
    check_executor(executor)
    check_progress(progress)
    chosen = Search() if search is None else search
    goals = goal_argument(goal).members
    tasks = [
        reorientation(
            body,
            member,
            momentum=momentum,
            duration=duration,
            start=start,
            end=end,
            via=via,
            cost=cost,
            rates_at_ends=rates_at_ends,
            joints=joints,
            symmetric=symmetric,
            limits=limits,
        )
        for member in goals
    ]
    if chosen.method == "reduced":
        check_reducible(tasks[0])
    check_reachable(tasks)
    warn_of_unstated(tasks[0], Limits() if limits is None else limits)
    began = time.perf_counter()
    reporter = _SearchMonitor(progress, chosen.time_limit)
    attempts: list[Attempt] = []
    for searched in _searches(tasks, chosen, reporter, executor):
        for attempt in searched:
            attempts.append(attempt)
            if reporter.stopped:
                break
        if reporter.stopped or any(attempt.report.converged for attempt in attempts):
            break
    seconds = time.perf_counter() - began
    reporter.finish()
    best = min((attempt for attempt in attempts if attempt.polished is not None), key=Attempt.rank, default=None)
    plan = (
        None
        if best is None
        else _plan(dict(zip(tasks, goals, strict=True)), best, attempts, chosen.method, seconds, reporter.stopped)
    )
    if best is None or plan is None or not best.report.converged:
        raise PlanNotFound(failure_message(tasks[0], attempts, best, reporter.stopped), plan)
    return plan


@dataclass(frozen=True, eq=False)
class _Job:
    """A local search that is to be done."""

    task: Reorientation
    basis: SplineBasis
    guess: Guess


def _searches(
    tasks: Sequence[Reorientation], search: Search, reporter: _SearchMonitor, executor: Executor | None
) -> Iterator[Iterator[Attempt]]:
    """What is tried until something leads to a plan: loops first, unless none can turn the body so far."""
    near, far = [], []
    for task in tasks:
        beyond = float(np.linalg.norm(task.turn_to_goal())) > _ROUNDS_OF_LOOPS * most_of_a_loop(task)
        (far if beyond else near).append(task)
    if near:
        yield _searched_by_loops(near, search, reporter, executor)
    yield chain.from_iterable(_searched_by_strokes(task, search, reporter) for task in tasks)
    if far:
        yield _searched_by_loops(far, search, reporter, executor)


def _searched_by_loops(
    tasks: Sequence[Reorientation], search: Search, reporter: _SearchMonitor, executor: Executor | None
) -> Iterator[Attempt]:
    """From loops, and from some more where none of those asked for leads to a plan."""
    first, spare = _jobs(tasks, search, reporter)
    searched = _searched_here if executor is None else partial(_searched_by, executor)
    found = False
    for attempt in searched(first, search, reporter):
        found = found or attempt.report.converged
        yield attempt
    if not found:
        for attempt in _searched_here(spare, search, reporter):
            yield attempt
            if attempt.report.converged:
                break


def _jobs(tasks: Sequence[Reorientation], search: Search, reporter: _SearchMonitor) -> tuple[list[_Job], list[_Job]]:
    """The local searches for each of several tasks, and those to go on with if none of them leads to a plan."""
    first: list[_Job] = []
    spare: list[_Job] = []
    for task in tasks:
        if first and reporter.stopped:
            break
        basis = SplineBasis(int(search.pieces or _default_pieces(task)))
        for jobs, found in zip((first, spare), _starting_points(task, basis, search, reporter), strict=True):
            jobs.extend(_Job(task, basis, guess) for guess in found)
    return first, spare


def _searched_here(jobs: Sequence[_Job], search: Search, reporter: _SearchMonitor) -> Iterator[Attempt]:
    """The local searches, one after the other."""
    local = None
    for number, job in enumerate(jobs):
        if local is None or local.task is not job.task:
            local = LocalSearch.of(job.task, job.basis, search)
        yield local.attempt(job.guess, reporter.solver_callback("search", number + 1, len(jobs)))


def _searched_by_strokes(task: Reorientation, search: Search, reporter: _SearchMonitor) -> Iterator[Attempt]:
    """Motions of many strokes, for few joints: equal ones, and from there any."""
    if task.dimension > _MANY_JOINTS or search.method != "collocation":
        return
    stroked = guess_of_strokes(task, search.seed, search.pieces)
    if stroked is None:
        return
    (layout, control), callback = stroked, reporter.solver_callback("search", 1, 1)
    if strokes_suffice(task):
        began = time.perf_counter()
        solution = StrokeProgram(task, layout).solve_strokes(control, callback)
        equal = corrected_attempt(task, layout.basis, solution, polished_path(task, layout.basis, solution), began)
        yield equal
        if equal.report.converged or reporter.stopped:
            return
    guess = guess_of_control(task, layout.basis, control)
    if guess is not None:
        few = replace(search, pieces=layout.basis.pieces)
        yield LocalSearch.of(task, layout.basis, few, settles=True).attempt(guess, callback)


def _searched_by(
    executor: Executor, jobs: Sequence[_Job], search: Search, reporter: _SearchMonitor
) -> Iterator[Attempt]:
    """The local searches by an executor, in their order."""
    recipes = {job.task: pickle.dumps((job.task, job.basis.pieces, search)) for job in jobs}
    found = executor.map(
        partial(_searched_elsewhere, reporter.end), [recipes[job.task] for job in jobs], [job.guess for job in jobs]
    )
    for number, (job, attempt) in enumerate(zip(jobs, found, strict=True)):
        end = attempt.report
        report = reporter.solver_callback("search", number + 1, len(jobs))
        report(end.iterations, end.cost, end.infeasibility, end.goal_error)
        yield replace(attempt, task=job.task)


# What a thread of an executor has made of the last recipe that came: a program takes as long as some starts.
_KEPT = threading.local()


def _searched_elsewhere(end: float, recipe: bytes, guess: Guess) -> Attempt:
    """A local search in another process or thread, until `STOP_REQUESTED` is set there or the time `end` [s, Unix]."""
    if getattr(_KEPT, "recipe", None) != recipe:
        task, pieces, search = pickle.loads(recipe)
        _KEPT.local = LocalSearch.of(task, SplineBasis(pieces), search)
        _KEPT.recipe = recipe
    return _KEPT.local.attempt(guess, lambda *_: STOP_REQUESTED.is_set() or time.time() > end)


class _SearchMonitor:
    """Reports the progress of a search to the user's callback, and stops it on request or at its time limit.

    Attributes
    ----------
    end : when the time limit is reached [s since 1970]: a clock that other processes share
    stopped : reason why the search was stopped, one of `PLAN_STATUS`; empty: none
    """

    def __init__(self, progress: ProgressCallback | None, time_limit: float | None) -> None:
        self._progress = progress
        self._share = 0.0
        self.end = math.inf if time_limit is None else time.time() + time_limit
        self.stopped = ""

    def solver_callback(self, stage: str, start: int, starts: int) -> IterationCallback:
        """Return the solver's callback during one start."""
        first, last = _STAGES[stage]
        which = f" {start} of {starts}" if starts > 1 else ""

        def report(iteration: int, cost: float, infeasibility: float, goal_error: float) -> bool:  # noqa: ARG001
            done = (start - 1 + iteration / (iteration + _USUAL_ITERATIONS)) / starts
            self._share = max(self._share, first + (last - first) * done)
            text = f"{stage}{which}: iteration {iteration}, off the goal by {goal_error:.1e} rad, cost {cost:.6g}"
            if not self.stopped and self._progress is not None and self._progress(self._share, text):
                self.stopped = "stopped"
            if not self.stopped and time.time() > self.end:
                self.stopped = "out of time"
            return bool(self.stopped)

        return report

    def finish(self) -> None:
        """Report the end of a search that was not stopped."""
        if self._progress is not None and not self.stopped:
            self._progress(1.0, "done")


def _default_pieces(task: Reorientation) -> int:
    if task.dimension <= _FEW_JOINTS and task.cost in ("kinetic", "rate") and task.equal_points == 1:
        return _PIECES_OF_FEW
    return _PIECES if task.dimension <= _MANY_JOINTS else _PIECES_OF_MANY


def _starting_points(
    task: Reorientation, basis: SplineBasis, search: Search, reporter: _SearchMonitor
) -> tuple[list[Guess], list[Guess]]:
    """The guesses to start from, and those to go on with if none of them leads to a plan.

    Unless there are many joints, each is first improved on a coarse spline, and the cheapest are taken.
    """
    count = int(search.starts)
    if task.dimension > (_RANKED_JOINTS if count > 1 else _MANY_JOINTS):
        return guesses(task, basis, search.seed, count), []
    few = task.dimension <= _FEW_JOINTS
    coarse = SplineBasis(_COARSE_PIECES if few else _COARSE_PIECES_OF_MORE)
    ranked = max(count, min(_RANKED * count, _MOST_RANKED), _LEAST_OF_FEW if few else 1)
    candidates = guesses(task, coarse, search.seed, ranked)
    program = CollocationProgram(task, coarse)
    most, tolerance = _COARSE_ITERATIONS, _COARSE_TOLERANCE
    if search.method == "reduced":
        most, tolerance = _COARSE_ITERATIONS_OF_REDUCED, _COARSE_TOLERANCE_OF_REDUCED
    found: list[tuple[float, int, Guess]] = []
    for number, candidate in enumerate(candidates):
        if reporter.stopped and found:
            break
        solution = program.solve(
            candidate.control,
            task.duration,
            guessed_attitudes(task, candidate),
            iterations=min(most, int(search.iterations)),
            tolerance=tolerance,
            via_places=candidate.via_places,
            iteration_callback=reporter.solver_callback("guesses", number + 1, len(candidates)),
        )
        near = solution.infeasibility < _COARSE_INFEASIBILITY
        guess = guess_of(task, basis, coarse.matrix(PLACES) @ (solution.control if near else candidate.control))
        if guess is not None:
            found.append((solution.cost if near else np.inf, number, guess))
    order = [guess for _, _, guess in sorted(found, key=lambda entry: entry[:2])]
    return order[:count], order[count : count + _SPARE]


def _plan(
    goals: Mapping[Reorientation, Goal],
    best: Attempt,
    attempts: Sequence[Attempt],
    method: str,
    seconds: float,
    stopped: str,
) -> Plan | None:
    """The plan of the best attempt; None where it has no path."""
    if best.polished is None:
        return None
    task = best.task
    return Plan(
        body=task.body,
        goal=goals[task],
        waypoint_times=best.polished.via_places * best.polished.duration,
        status=stopped or ("found" if best.report.converged else "not found"),
        path=best.polished.path,
        motion=best.polished.motion,
        cost_name=task.cost,
        rates_at_ends=task.rates_at_ends,
        cost=best.cost,
        goal_error=best.polished.goal_error,
        transcription_gap=best.polished.first_goal_error,
        polish_steps=best.polished.steps,
        kkt_residual=best.report.kkt_residual,
        coefficients=best.polished.control,
        method=method,
        iterations=sum(attempt.report.iterations for attempt in attempts),
        seconds=seconds,
        starts=tuple(attempt.report for attempt in attempts),
        second_order=best.report.second_order,
        hamiltonian_spread=hamiltonian_spread(task, best.basis, best.polished.control, best.polished.duration),
        limit_shares=position_share(task, best.basis, best.polished.control)
        | limit_shares(task, best.basis, best.polished.control, best.polished.motion),
    )
