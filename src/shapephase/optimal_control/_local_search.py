"""Local search from a guess of a plan; its path is corrected and compared with the goal and the limits."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..dynamics.torques import joint_torques
from ..errors import ShapePhaseError
from ..shape_space.closest_approach import ClosestApproach
from ._path_cost import path_cost
from ._plan_limits import LIMIT_SLACK, Margins, closest_links, effort_shares, limit_shares, tightened, widened
from ._polish import GAUSS_NODES, GOAL_TOLERANCE, PolishedPath, polish
from ._spline_basis import SplineBasis
from ._via_points import via_rows
from .collocation import GOOD_STATUS, STAGES, CollocationProgram, NlpSolution
from .guesses.loops import PLACES, Guess, guess_of, guess_of_control
from .plan import Start
from .plan_options import Search
from .solver_callback import IterationCallback
from .task import Reorientation

_HALVINGS = 2  # of the pieces, where the motion of the optimum misses the goal: fast joints need finer ones
_TIGHTENINGS = 6  # rounds in which efforts are given less room, where they exceed limits between the nodes
_NEARLY = 0.9  # share of a limit that a message about a failed search counts as being at it
_WINDING_TOLERANCE = 0.1  # [rad], far less than the half turn by which windings of one attitude differ
_WINDING_SAMPLES = 50  # attitudes per piece: so close together that unwrapping is safe


@dataclass(frozen=True, eq=False)
class Attempt:
    """Result of one local search.

    report : its summary for the user
    polished : its path, corrected; None where that could not be reconstructed
    cost : cost of the corrected path; infinite where there is none
    reaches_goal : whether the corrected path reaches the goal within the limits
    basis : spline of the path
    closest : pairs of links that come near the clearance, the nearest first
    """

    task: Reorientation
    report: Start
    polished: PolishedPath | None
    cost: float
    reaches_goal: bool
    basis: SplineBasis
    closest: tuple[ClosestApproach, ...] = ()

    def rank(self) -> tuple[bool, bool, float]:
        """Sorting key: first local optima, then paths that reach the goal by cost, then others by error."""
        if self.polished is None:
            return True, True, np.inf
        return not self.report.converged, not self.reaches_goal, self.cost if self.reaches_goal else self.goal_error

    @property
    def touches(self) -> bool:
        """True where links come nearer than the clearance."""
        least = self.task.clearance
        return least is not None and any(near.distance < least for near in self.closest)

    @property
    def goal_error(self) -> float:
        """Goal error of the corrected path [rad]."""
        return np.inf if self.polished is None else self.polished.goal_error


def guessed_attitudes(task: Reorientation, guess: Guess) -> Callable[[Array], Array]:
    """Return the attitudes at places of [0, 1] from which a solver starts: (N,) -> (N, 4)."""
    if task.windings is not None:
        return task.uniform_winding
    turn = task.turn_to_goal(guess.motion.final_attitude, guess.control[-1])
    return lambda places: guess.quaternions(places, turn)


@dataclass(frozen=True, eq=False)
class LocalSearch:
    """Search for the local optimum next to a guess.

    program : program for the spline of the path at first
    halvings : how often pieces may be halved; never where the user gave their number
    settles : whether the solver may end where the cost of a long motion has settled
    """

    task: Reorientation
    program: CollocationProgram
    iterations: int
    halvings: int
    settles: bool = False

    @classmethod
    def of(cls, task: Reorientation, basis: SplineBasis, search: Search, *, settles: bool = False) -> LocalSearch:
        halvings = _HALVINGS if search.pieces is None else 0
        return cls(task, CollocationProgram(task, basis), int(search.iterations), halvings, settles)

    def attempt(self, guess: Guess, callback: IterationCallback) -> Attempt:
        """Return the local optimum, its path corrected to reach the goal; on finer pieces where these do not."""
        best, control = self._on(self.program, guess, callback)
        for _ in range(self.halvings):
            solved = best.report.status in GOOD_STATUS
            if best.reaches_goal or not (solved or best.touches):
                break
            finer = SplineBasis(2 * best.basis.pieces)
            onward = guess_of(self.task, finer, best.basis.matrix(PLACES) @ control)
            if onward is None:
                break
            following, control = self._on(CollocationProgram(self.task, finer), onward, callback)
            best = min(best, following, key=Attempt.rank)
            if best is not following:
                break
        return best

    def _on(self, program: CollocationProgram, guess: Guess, callback: IterationCallback) -> tuple[Attempt, Array]:
        """Return the attempt of a program, with the iterations of all rounds, and the solver's control points.

        Where efforts exceed their limits between the nodes, or links come too near, these get less room in a further
        round.
        """
        task, basis, began, iterations = self.task, program.basis, time.perf_counter(), 0
        control, duration, attitudes = guess.control, task.duration, guessed_attitudes(task, guess)
        options: dict[str, Any] = {
            "iterations": self.iterations,
            "via_places": guess.via_places,
            "iteration_callback": callback,
            "settles": self.settles,
            "room": None,
            "margins": Margins({}, STAGES),
        }
        rounds = 0
        while True:
            solution = program.solve(control, duration, attitudes, **options)
            iterations += solution.iterations
            attempt = corrected_attempt(task, basis, replace(solution, iterations=iterations), began)
            if rounds == _TIGHTENINGS or attempt.polished is None or not solution.converged:
                break
            tighter = _tightened(attempt, options["room"], options["margins"], rounds)
            again = guess_of_control(task, basis, solution.control)
            if tighter is None or again is None:
                break
            room, margins = tighter
            if not margins.same_rows(options["margins"]):
                program = CollocationProgram(task, basis, margins)
            options |= {"room": room, "margins": margins, "via_places": solution.via_places}
            control, duration, attitudes = solution.control, solution.duration, guessed_attitudes(task, again)
            rounds += 1
        return attempt, solution.control


def _tightened(
    attempt: Attempt, room: Array | None, margins: Margins, rounds: int
) -> tuple[Array | None, Margins] | None:
    """Return room for efforts and margins of distances with which a path will keep its limits; None where it does."""
    task, basis, tighter = attempt.task, attempt.basis, False
    if task.efforts_limited and attempt.polished is not None:
        shares = effort_shares(task, basis, attempt.polished.motion)
        if shares.max() > 1.0 + LIMIT_SLACK:
            room, tighter = tightened(room, shares, STAGES, rounds), True
    if attempt.touches:
        margins, tighter = widened(margins, attempt.closest, task.clearance or 0.0), True
    return (room, margins) if tighter else None


def corrected_attempt(task: Reorientation, basis: SplineBasis, solution: NlpSolution, began: float) -> Attempt:
    """Correct a solver's path, the result of a search that began at a time [s], to reach the goal."""
    polished, cost, reaches_goal, closest = None, np.inf, False, ()
    with suppress(ShapePhaseError):  # where the path has no motion or no finite cost
        corrected = polish(task, basis, solution.control, solution.duration, solution.via_places)
        cost, polished = _cost(task, basis, corrected), corrected
    if polished is not None:
        closest = closest_links(task, polished.path)
        reaches_goal = polished.goal_error <= GOAL_TOLERANCE and _within_limits(task, basis, polished)
    report = Start(
        status=solution.status,
        converged=solution.converged and reaches_goal,
        cost=solution.cost,
        goal_error=task.goal_error(solution.attitude, solution.control[-1]),
        kkt_residual=solution.kkt_residual,
        infeasibility=solution.infeasibility,
        iterations=solution.iterations,
        seconds=time.perf_counter() - began,
        second_order=solution.second_order,
    )
    attempt = Attempt(task, report, polished, cost, reaches_goal, basis, closest)
    if attempt.touches:
        attempt = replace(attempt, report=replace(report, converged=False), reaches_goal=False)
    return attempt


def _cost(task: Reorientation, basis: SplineBasis, polished: PolishedPath) -> float:
    """Cost of a corrected path, by quadrature."""
    places, weights = basis.gauss(GAUSS_NODES)
    if task.cost == "effort":
        torque = joint_torques(polished.motion, places * polished.duration).torque
        return float(polished.duration * weights @ np.sum((torque / task.effort_measure) ** 2, axis=1))
    if task.cost == "time":
        return polished.duration
    if task.cost == "acceleration":
        bend = basis.matrix(places, 2) @ polished.control @ task.coupling.T
        return float(0.5 * weights @ np.sum(bend**2, axis=1)) / polished.duration**3
    return path_cost(task.body, polished.path, task.metric.metric if task.metric else task.cost)


def _within_limits(task: Reorientation, basis: SplineBasis, polished: PolishedPath) -> bool:
    """True where duration, rates, windings and waypoints are within limits; the correction keeps positions there."""
    if task.windings is not None:
        times = np.linspace(0.0, polished.path.duration, _WINDING_SAMPLES * basis.pieces)
        counted = task.counted_windings(polished.motion.attitude(times))
        if np.abs(counted - task.windings).max() > _WINDING_TOLERANCE:
            return False
    rows, values = via_rows(task, basis, polished.via_places)
    if np.abs(np.einsum("jkm,km->j", rows, polished.control) - values).max(initial=0.0) > GOAL_TOLERANCE:
        return False
    slack = 1.0 + LIMIT_SLACK
    shares = limit_shares(task, basis, polished.control, polished.motion)
    return polished.path.duration <= task.duration * slack and max(shares.values(), default=0.0) <= slack


def failure_message(task: Reorientation, attempts: Sequence[Attempt], best: Attempt | None, stopped: str) -> str:
    """Message of a search without a plan: each start, the best attempt, and what to change."""
    name = task.body.name
    summary = "; ".join(
        f"start {number + 1}: {attempt.report.status}, off by {attempt.report.goal_error:.3g} rad, KKT residual "
        f"{attempt.report.kkt_residual:.2g}"
        for number, attempt in enumerate(attempts)
    )
    if best is None or best.polished is None:
        outcome = "no attempt gave a path"
    elif best.reaches_goal:
        outcome = f"the best attempt, in `best`, reaches the goal at cost {best.cost:.6g}; there may be cheaper ones"
    else:
        length = best.polished.path.duration
        outcome = f"the best attempt, in `best`, misses the goal by {best.goal_error:.3g} rad in {length:.6g} s"
    if stopped:
        how = "stopped on request" if stopped == "stopped" else "ended by its time limit"
        return f"the search for a motion of the joints of {name} was {how} ({summary}); {outcome}"
    near: list[str] = []
    if best is not None and best.polished is not None:
        shares = limit_shares(best.task, best.basis, best.polished.control, best.polished.motion)
        near = [name for name, share in shares.items() if share > _NEARLY]
    more = "more iterations or starts (Search(starts=8), --starts 8)"
    if best is not None and best.touches:
        way_out = (
            f"links come nearer than the clearance of {task.clearance:g} m, {best.closest[0].text}: give a smaller "
            f"distance (--avoid), more time or {more}"
        )
    elif task.cost == "time":
        way_out = f"it may take longer than {task.duration:.6g} s: give a longer duration (--duration), or {more}"
    elif near:
        way_out = (
            f"joints are at their {' and '.join(near)} limits: give more than {task.duration:.6g} s (cost='time' with "
            "a longer duration, --cost time, finds the least)"
        )
    elif np.isfinite(task.rate_limit).all():
        way_out = (
            f"{task.duration:.6g} s may be too short: cost='time' with a longer duration (--cost time --duration) "
            f"finds the least; or give {more}"
        )
    else:
        way_out = f"loosen the limits, or give more time or {more}"
    return f"no motion of the joints of {name} was found that turns it to the goal ({summary}); {outcome}; {way_out}"
