"""Reorientation: cheapest motion of the joints that turns a free body to a goal."""

from __future__ import annotations

import math
import pickle
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_executor
from ..arrays import Array
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..deformation.deformation import articulated
from ..errors import PlanNotFound
from ..reconstruction.reconstruction import reconstruct
from ..run_progress import ProgressCallback, check_progress
from ._local_search import Attempt, LocalSearch, corrected_attempt, failure_message, guessed_attitudes
from ._path_cost import cost_density
from ._plan_limits import limit_shares, position_share, warn_of_unstated
from ._polish import GAUSS_NODES, RECONSTRUCTION_TOLERANCE
from ._reachable_turns import check_reachable
from ._spline_basis import SplineBasis
from .collocation import CollocationProgram
from .cost_metric import METRIC_COSTS
from .guesses.loops import PLACES, Guess, guess_of, guess_of_control, guess_of_path, guesses
from .guesses.stroke_program import StrokeProgram, strokes_suffice
from .guesses.strokes import guess_of_strokes, most_of_a_loop
from .plan import Plan
from .plan_options import Goal, Limits, Search, Waypoint, goal_argument
from .solver_callback import STOP_REQUESTED, IterationCallback
from .task import Reorientation, reorientation

_FEW_JOINTS = 4  # free joints so cheap that the spline can be as fine as an extremal needs
_MANY_JOINTS = 8  # free joints beyond which the spline is coarse and no coarse search comes first
# For few joints: such paths obey Wong's equations to 1e-4. The acceleration cost would lose digits, as second
# derivatives grow with the square of the pieces; and from rest, joints start within a piece.
_PIECES_OF_FEW = 160
_PIECES = 40  # up to `_MANY_JOINTS`
_PIECES_OF_MANY = 20  # beyond
_COARSE_PIECES = 10  # of the coarse search that ranks the guesses for few joints: enough for a loop to bend
_COARSE_PIECES_OF_MORE = 20  # for more joints
_RANKED = 4  # guesses that it ranks for each start
_MOST_RANKED = 16  # at most, unless there are more starts
_LEAST_OF_FEW = 8  # at least for few joints, where they are cheap
_RANKED_JOINTS = 12  # up to which guesses are ranked for several starts; for one, up to `_MANY_JOINTS`
_ROUNDS_OF_LOOPS = 4  # that a loop which starts as a circle may take: it bends into some more rounds
_SPARE = 2  # further guesses where no start led to a plan: near a degenerate optimum rounding decides that
_COARSE_ITERATIONS = 40  # of the coarse search: what has not ended then is near enough to be ranked
_COARSE_TOLERANCE = 1e-4  # scaled: it has to find the right basin, not the optimum
_COARSE_INFEASIBILITY = 1e-2  # scaled violation beyond which the guess itself is taken, after all others
_ENDS = 3  # pieces at both ends that are left out: from rest a spline takes some to come to its speed
_AT_LIMIT = 1.0 - 1e-5  # share of a rate limit that counts as being at it
_STAGES = {"guesses": (0.0, 0.3), "search": (0.3, 1.0)}  # shares of the whole between which each is reported
_USUAL_ITERATIONS = 50  # iterations after which half of a start is reported as done


def plan_reorientation(
    body: Body | ParticleBody | str,
    goal: Goal | ArrayLike,
    *,
    momentum: ArrayLike = 0.0,
    duration: float = 1.0,
    start: ArrayLike | None = None,
    end: Any = None,
    via: Sequence[Waypoint] = (),
    cost: Any = "kinetic",
    rates_at_ends: str = "zero",
    joints: Sequence[str] | None = None,
    symmetric: Mapping[str, tuple[str, float]] | None = None,
    limits: Limits | None = None,
    search: Search | None = None,
    progress: ProgressCallback | None = None,
    executor: Executor | None = None,
) -> Plan:
    """Return the cheapest motion of the joints that turns a free body to a goal: the falling cat's problem.

    The attitude is the identity at the start. The path is a C2 cubic spline, corrected until the motion that the
    library's integrator reconstructs from it reaches the goal.

    Equation :eq:`isoholonomic` of the documentation.
    Source: Montgomery 1990, Isoholonomic problems and some applications.

    Parameters
    ----------
    goal : (3, 3) attitude at the end, or any of several (k, 3, 3); or a `Goal`: an axis to be pointed, of the base or
        of a link, an attitude up to a symmetry of the body, or somersaults and twists to be counted
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]; 0: none
    duration : [s]; for cost "time" the longest allowed
    start : (n,) shape at the start [rad or m]; None: neutral, or as near as the limits permit
    end : (n,) shape at the end; None: that at the start, a closed loop; "free": any
    via : waypoints in their order: a `Waypoint` is a shape, or the coordinates of some joints, with or without a time
    cost : "kinetic", the integral of 1/2 r' (M_ss - M_sb M_bb^-1 M_bs) r' over time [J s], the kinetic energy of
        the joint motion without angular momentum, M the mass matrix with base b and joints s: joints that undo each
        other (a flat gimbal) move at no cost and may then jump; "rate", that of 1/2 |r'|^2; "acceleration", that
        of 1/2 |r''|^2; "effort", that of the squared torques and forces of all joints, each relative to its limit [s];
        "time", the duration, under rate limits. Or a metric g, a matrix (n, n) or a `casadi.Function` of the shape that
        gives one: the integral of 1/2 r' g r'
    rates_at_ends : of the joints; "zero": from rest to rest, for the cost "acceleration" without acceleration at the
        ends, too; "periodic": equal at both ends, for gaits; "free": any, as in the theory of optimal loops: the
        body would have to be set in motion before the start, and stopped after the end
    joints : names of those that may move; the others are held at the start; None: all
    symmetric : joints that follow others: name -> (name of the leader, factor)
    limits : limits of positions, rates, accelerations, jerks and efforts; None: `Limits()`, positions and rates of the
        body's file
    search : starts, resolution, time limit; None: `Search()`
    progress : called after each iteration as `progress(share, text)`: the share of the search that is done, from 0 to
        1, which never falls, and a text such as "search 2 of 3: iteration 12, off the goal by 2.0e-02 rad, cost 0.125".
        A true return stops the search, as its time limit does (`Search.time_limit`): the cheapest plan of the starts
        that had ended is returned, or else PlanNotFound raised with the best so far. Ctrl-C is raised as
        KeyboardInterrupt, and nothing is kept
    executor : executor of `concurrent.futures` or of a cluster (`distributed.Client.get_executor()`), whose processes
        search from several starts (`Search.starts`) at a time; `progress` is then called when a start has ended.
        None: one start after the other, in this process. Plans do not depend on it

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For wrong shapes, ends beyond the limits, unknown names.
    UnreachableGoalError
        If no motion can reach the goal, by the holonomy algebra (`reachable`) or a plane of symmetry.
    PlanNotFound
        If no start came to a local optimum that reaches the goal, or `progress` or its time limit stopped the search
        before; it carries the best attempt.

    Warns
    -----
    UnstatedLimitWarning
        If `limits` takes rates or efforts from the body's file, which states none for a joint.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> goal, search = sp.so3.exp(np.array([1.0, 0.0, 0.0])), sp.optimal_control.Search(pieces=16)
    >>> plan = sp.plan_reorientation(cat, goal, search=search)
    >>> print(f"{sp.so3.angle(goal.T @ plan.motion.final_attitude):.6f} rad off")
    0.000000 rad off
    """
    body = as_body_or_particles(body)
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
    check_reachable(tasks)
    warn_of_unstated(tasks[0], Limits() if limits is None else limits)
    began = time.perf_counter()
    monitor = _SearchMonitor(progress, chosen.time_limit)
    attempts: list[Attempt] = []
    for searched in _searches(tasks, chosen, monitor, executor):
        for attempt in searched:
            attempts.append(attempt)
            if monitor.stopped:
                break
        if monitor.stopped or any(attempt.report.converged for attempt in attempts):
            break
    seconds = time.perf_counter() - began
    monitor.finish()
    best = min((attempt for attempt in attempts if attempt.polished is not None), key=Attempt.rank, default=None)
    plan = (
        None if best is None else _plan(dict(zip(tasks, goals, strict=True)), best, attempts, seconds, monitor.stopped)
    )
    if best is None or plan is None or not best.report.converged:
        raise PlanNotFound(failure_message(tasks[0], attempts, best, monitor.stopped), plan)
    return plan


_Job = tuple[Reorientation, SplineBasis, Guess]  # a local search that is to be done


def _searches(
    tasks: Sequence[Reorientation], search: Search, monitor: _SearchMonitor, executor: Executor | None
) -> Iterator[Iterator[Attempt]]:
    """Yield the searches until one leads to a plan: loops first, unless none can turn the body so far."""
    near, far = [], []
    for task in tasks:
        beyond = float(np.linalg.norm(task.turn_to_goal())) > _ROUNDS_OF_LOOPS * most_of_a_loop(task)
        (far if beyond and search.guess is None else near).append(task)
    if near:
        yield _searched_by_loops(near, search, monitor, executor)
    yield chain.from_iterable(_searched_by_strokes(task, search, monitor) for task in tasks if search.starts)
    if far:
        yield _searched_by_loops(far, search, monitor, executor)


def _searched_by_loops(
    tasks: Sequence[Reorientation], search: Search, monitor: _SearchMonitor, executor: Executor | None
) -> Iterator[Attempt]:
    """Yield local searches from loops, and from further ones where none of the first leads to a plan."""
    first, spare = _jobs(tasks, search, monitor)
    searched = _searched_here if executor is None else partial(_searched_by, executor)
    converged = False
    for attempt in searched(first, search, monitor):
        converged = converged or attempt.report.converged
        yield attempt
    if not converged:
        for attempt in _searched_here(spare, search, monitor):
            yield attempt
            if attempt.report.converged:
                break


def _jobs(tasks: Sequence[Reorientation], search: Search, monitor: _SearchMonitor) -> tuple[list[_Job], list[_Job]]:
    """Return the local searches of several tasks, and spare ones if none of those leads to a plan."""
    first: list[_Job] = []
    spare: list[_Job] = []
    for task in tasks:
        if first and monitor.stopped:
            break
        pieces = _PIECES if task.dimension <= _MANY_JOINTS else _PIECES_OF_MANY
        if task.dimension <= _FEW_JOINTS and task.cost in METRIC_COSTS and task.equal_points == 1:
            pieces = _PIECES_OF_FEW
        basis = SplineBasis(int(search.pieces or pieces))
        guess = None if search.guess is None else guess_of_path(task, basis, search.guess)
        first.extend([] if guess is None else [(task, basis, guess)])
        if not search.starts:
            continue
        try:
            found = _starting_points(task, basis, search, monitor)
        except PlanNotFound:  # the user's own guess is enough
            if guess is None:
                raise
            continue
        for jobs, starts in zip((first, spare), found, strict=True):
            jobs.extend((task, basis, start) for start in starts)
    return first, spare


def _searched_here(jobs: Sequence[_Job], search: Search, monitor: _SearchMonitor) -> Iterator[Attempt]:
    """Yield local searches, one after the other."""
    local = None
    for number, (task, basis, guess) in enumerate(jobs):
        if local is None or local.task is not task:
            local = LocalSearch.of(task, basis, search)
        yield local.attempt(guess, monitor.solver_callback("search", number + 1, len(jobs)))


def _searched_by_strokes(task: Reorientation, search: Search, monitor: _SearchMonitor) -> Iterator[Attempt]:
    """Yield the optimum among motions of many equal strokes, for few joints, else the local search from there."""
    if task.dimension > _MANY_JOINTS:
        return
    stroked = guess_of_strokes(task, search.seed, search.pieces)
    if stroked is None:
        return
    (layout, control), callback = stroked, monitor.solver_callback("search", 1, 1)
    if strokes_suffice(task):
        began = time.perf_counter()
        solution = StrokeProgram(task, layout).solve_strokes(control, callback)
        equal = corrected_attempt(task, layout.basis, solution, began)
        yield equal
        if equal.report.converged or monitor.stopped:
            return
    guess = guess_of_control(task, layout.basis, control)
    if guess is not None:
        few = replace(search, pieces=layout.basis.pieces)
        yield LocalSearch.of(task, layout.basis, few, settles=True).attempt(guess, callback)


def _searched_by(
    executor: Executor, jobs: Sequence[_Job], search: Search, monitor: _SearchMonitor
) -> Iterator[Attempt]:
    """Yield local searches by an executor, in their order."""
    recipes = {task: pickle.dumps((task, basis.pieces, search)) for task, basis, _ in jobs}
    attempts = executor.map(
        partial(_searched_elsewhere, monitor.end), [recipes[task] for task, *_ in jobs], [guess for *_, guess in jobs]
    )
    for number, ((task, *_), attempt) in enumerate(zip(jobs, attempts, strict=True)):
        end = attempt.report
        report = monitor.solver_callback("search", number + 1, len(jobs))
        report(end.iterations, end.cost, end.infeasibility, end.goal_error)
        yield replace(attempt, task=task)


_KEPT = threading.local()  # the last program of a thread of an executor: it takes as long as some starts


def _searched_elsewhere(end: float, recipe: bytes, guess: Guess) -> Attempt:
    """Search in another process or thread, until `STOP_REQUESTED` is set there or the time `end` [s since 1970]."""
    if getattr(_KEPT, "recipe", None) != recipe:
        task, pieces, search = pickle.loads(recipe)
        _KEPT.local = LocalSearch.of(task, SplineBasis(pieces), search)
        _KEPT.recipe = recipe
    return _KEPT.local.attempt(guess, lambda *_: STOP_REQUESTED.is_set() or time.time() > end)


class _SearchMonitor:
    """Reports the progress of a search to the user's callback, and stops it on request or at its time limit.

    end : when the time limit is reached [s since 1970]: a clock that other processes share
    stopped : reason why the search was stopped, "stopped" or "out of time"; empty: none
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


def _starting_points(
    task: Reorientation, basis: SplineBasis, search: Search, monitor: _SearchMonitor
) -> tuple[list[Guess], list[Guess]]:
    """Return the guesses to start from, and spare ones if none of those leads to a plan.

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
    improved: list[tuple[float, int, Guess]] = []
    for number, candidate in enumerate(candidates):
        if monitor.stopped and improved:
            break
        solution = program.solve(
            candidate.control,
            task.duration,
            guessed_attitudes(task, candidate),
            iterations=min(_COARSE_ITERATIONS, int(search.iterations)),
            tolerance=_COARSE_TOLERANCE,
            via_places=candidate.via_places,
            iteration_callback=monitor.solver_callback("guesses", number + 1, len(candidates)),
        )
        near = solution.infeasibility < _COARSE_INFEASIBILITY
        guess = guess_of(task, basis, coarse.matrix(PLACES) @ (solution.control if near else candidate.control))
        if guess is not None:
            improved.append((solution.cost if near else np.inf, number, guess))
    order = [guess for _, _, guess in sorted(improved, key=lambda entry: entry[:2])]
    return order[:count], order[count : count + _SPARE]


def _plan(
    goals: Mapping[Reorientation, Goal],
    best: Attempt,
    attempts: Sequence[Attempt],
    seconds: float,
    stopped: str,
) -> Plan | None:
    """Return the plan of the best attempt; None where it has no path."""
    if best.polished is None:
        return None
    task, motion = best.task, best.polished.motion
    if isinstance(task.body, ParticleBody):
        along = articulated(task.body, best.polished.path)
        motion = reconstruct(along, task.momentum, tolerance=RECONSTRUCTION_TOLERANCE)
    return Plan(
        body=task.body,
        goal=goals[task],
        waypoint_times=best.polished.via_places * best.polished.duration,
        status=stopped or ("found" if best.report.converged else "not found"),
        path=best.polished.path,
        motion=motion,
        cost_name=task.cost,
        rates_at_ends=task.rates_at_ends,
        cost=best.cost,
        goal_error=best.polished.goal_error,
        transcription_gap=best.polished.first_goal_error,
        polish_steps=best.polished.steps,
        kkt_residual=best.report.kkt_residual,
        coefficients=best.polished.control,
        iterations=sum(attempt.report.iterations for attempt in attempts),
        seconds=seconds,
        starts=tuple(attempt.report for attempt in attempts),
        second_order=best.report.second_order,
        hamiltonian_spread=hamiltonian_spread(task, best.basis, best.polished.control, best.polished.duration),
        limit_shares=position_share(task, best.basis, best.polished.control)
        | limit_shares(task, best.basis, best.polished.control, best.polished.motion),
        closest=best.closest,
    )


def hamiltonian_spread(task: Reorientation, basis: SplineBasis, control: Array, duration: float) -> float | None:
    """Range of the means of Pontryagin's Hamiltonian over pieces, relative to its mean; None where undefined.

    Without momentum the cost's density L is quadratic in the rates, and the holonomy's term is linear in them, so that
    H = L, which is constant as nothing depends on time. Limits of positions do not change that; limits of rates and
    waypoints with a time do, and with limits of accelerations, jerks or efforts the Hamiltonian differs.

    Source: theory.md B6; Pontryagin's principle.
    """
    timed = any(point.place is not None for point in task.via)
    if task.metric is None or task.momentum.any() or task.limits_beyond_rates or timed:
        return None
    places, _ = basis.gauss(GAUSS_NODES)
    rates = basis.matrix(places, 1) @ control / duration
    density = cost_density(task.body, task.metric, task.shapes(basis.matrix(places) @ control), rates @ task.coupling.T)
    limited = np.any(np.abs(basis.rate_control @ control) > _AT_LIMIT * task.rate_limit * duration, axis=1)
    free = ~np.any(basis.rate_reaches & limited, axis=1)[_ENDS:-_ENDS]
    means = density.reshape(basis.pieces, -1).mean(axis=1)[_ENDS:-_ENDS][free]
    return float(np.ptp(means) / means.mean()) if means.any() else None
