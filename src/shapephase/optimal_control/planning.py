"""Reorientation: the cheapest motion of the joints that turns a free body as asked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..body.body import Body
from ..errors import AccuracyNotReached, PlanNotFound, ShapeError, ShapePhaseError, unknown_name
from ..shape_space.connection import mechanical_connection
from ..shape_space.shape_path import ShapePath
from ._guesses import PLACES, Guess, guess_of, guesses
from .collocation import CollocationProgram, Solved, gauss_tableau
from .plan import Plan, Progress, Start
from .polish import REACHED, Polished, panel_nodes, polished
from .reduced import ReducedProgram
from .solver_watch import Watch
from .spline_basis import SplineBasis
from .task import Reorientation, reorientation

METHODS = ("collocation", "reduced")
_FINE, _FEW = 160, 4
"""So many pieces obey Wong's equations to 1e-4; accelerations would lose digits on them."""
_PIECES, _PIECES_OF_MANY, _MANY = 40, 20, 8
# Rates and durations may exceed their limits by this share, as much as the solver leaves.
_SLACK = 1e-7
# Windings of the same attitude differ by half a turn or more.
_WINDING = 0.1
_COARSE, _SCOUTS, _SCOUTING = 10, 8, 60
_PARTS, _SETTLED = (4, 8, 16, 32, 64, 128), 1e-10


class _Watched:
    """Passes on where the search stands.

    Attributes
    ----------
    stopped : whether it has been asked to stop
    """

    def __init__(self, watch: Callable[[Progress], Any] | None) -> None:
        self._watch = watch
        self.stopped = False

    def during(self, stage: str, start: int, starts: int) -> Watch:
        """What the solver tells, of one start."""

        def told(iteration: int, cost: float, infeasibility: float) -> bool:
            if self._watch is not None and not self.stopped:
                self.stopped = bool(self._watch(Progress(stage, start, starts, iteration, cost, infeasibility)))
            return self.stopped

        return told


def plan_reorientation(
    body: Body,
    target: Any = None,
    *,
    momentum: ArrayLike = 0.0,
    duration: float = 1.0,
    start: ArrayLike | None = None,
    end: Any = None,
    cost: str = "kinetic",
    joint_limits: bool = True,
    rate_limits: ArrayLike | None = None,
    joints: Sequence[str] | None = None,
    symmetric: Mapping[str, tuple[str, float]] | None = None,
    somersaults: float | None = None,
    half_twists: float | None = None,
    twist_axis: ArrayLike = (0.0, 0.0, 1.0),
    seed: int = 0,
    starts: int = 1,
    method: str = "collocation",
    pieces: int | None = None,
    iterations: int = 300,
    watch: Callable[[Progress], Any] | None = None,
) -> Plan:
    """The cheapest motion of the joints that turns a free body as asked: the falling cat's problem, for any body.

    The attitude is the identity at the start. The path is a C2 cubic spline; its motion is reconstructed by the
    library's integrator, and the path corrected until that reaches the goal.

    Parameters
    ----------
    target : (3, 3) attitude at the end; or a pair (2, 3), an axis of the base and the inertial direction it shall have
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]; 0: none
    duration : [s]; for cost "time" the longest allowed
    start : (n,) shape at the start [rad or m]; None: neutral, or as near as the limits let
    end : (n,) shape at the end; None: as at the start, a closed loop; "free": any
    cost : "kinetic", the integral of 1/2 r' (M_ss - M_sb M_bb^-1 M_bs) r' over time [J s], the kinetic energy that the
        joint motion has without angular momentum, M the mass matrix with base b and joints s: joints that undo each
        other, as in a flat gimbal, move at no cost and may then jump; "rate", that of 1/2 |r'|^2; "acceleration", that
        of 1/2 |r''|^2, from rest, and to rest where the end is given; "time", the duration, under `rate_limits`
    joint_limits : whether the joints stay within those of the body
    rate_limits : one for all joints, or (n,) [rad/s or m/s]
    joints : names of those that may move; None: all
    symmetric : joints that follow others: name -> (name of the leader, factor)
    somersaults, half_twists : instead of a target, how often the body goes about its momentum and, in half turns,
        about its own `twist_axis`, counted through the motion, whole or not; both axes at right angles at the start
    twist_axis : (3,) base axes
    seed : of the random starts
    starts : local searches from different guesses; the cheapest plan is returned
    method : "collocation", the attitude by Gauss collocation, the whole a sparse program with exact second derivatives
        for IPOPT; or "reduced", the path's coefficients alone, with the exact derivative of the integrator's attitude
        (no cost "time"). On equal splines both come to the same costs within 1.5 %, of the cat in 14 and 11 s; the
        first leaves a KKT residual of 1e-9, the second of some 1e-6, and for the astronaut it may want more than 300
        iterations: the first is the default
    pieces : of the spline, six or more; None: 160 for up to four free joints and the costs
        kinetic and rate, else 40 for up to eight, 20 for more
    iterations : of the solver, for each start
    watch : told after each iteration where the search stands; if it returns something true, the search stops there:
        with the cheapest plan of the starts that had ended, or else PlanNotFound with the best so far.
        Ctrl-C is raised as KeyboardInterrupt, and nothing is kept

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For arguments of the wrong shape, ends beyond the limits, unknown names.
    PlanNotFound
        If no start came to a local optimum that reaches the goal, or `watch` stopped it; it carries the best try.

    Source: Montgomery 1990, Isoholonomic problems and some applications.
    """
    if method not in METHODS:
        raise unknown_name("method", method, METHODS)
    for value, name, least in ((pieces, "pieces", 6), (starts, "starts", 1), (iterations, "iterations", 1)):
        if value is None and name == "pieces":
            continue
        if not isinstance(value, int | np.integer) or value < least:
            raise ShapeError(f"{name}: a whole number, {least} or more, is needed, got {value!r}")
    task = reorientation(
        body,
        target,
        momentum=momentum,
        duration=duration,
        start=start,
        end=end,
        cost=cost,
        joint_limits=joint_limits,
        rate_limits=rate_limits,
        joints=joints,
        symmetric=symmetric,
        somersaults=somersaults,
        half_twists=half_twists,
        twist_axis=twist_axis,
    )
    began = time.perf_counter()
    basis = SplineBasis(int(pieces or _pieces(task)))
    program = CollocationProgram(task, basis) if method == "collocation" else ReducedProgram(task, basis)
    watched = _Watched(watch)
    begun = _starts(task, basis, seed, int(starts), int(iterations), watched)
    tries: list[_Try] = []
    for guess in begun:
        if watched.stopped and tries:
            break
        told = watched.during("search", len(tries) + 1, len(begun))
        tries.append(_search(task, basis, program, guess, int(iterations), told))
    whole = {
        "method": method,
        "iterations": sum(one.report.iterations for one in tries),
        "seconds": time.perf_counter() - began,
        "starts": tuple(one.report for one in tries),
    }
    best = min((one for one in tries if one.plan is not None), key=_Try.rank, default=None)
    plan = replace(best.plan, **whole) if best is not None and best.plan is not None else None
    if best is None or plan is None or not best.report.converged:
        raise PlanNotFound(_failure(task, tries, best, watched.stopped), plan)
    return plan


def _pieces(task: Reorientation) -> int:
    if task.size <= _FEW and task.cost in ("kinetic", "rate"):
        return _FINE
    return _PIECES if task.size <= _MANY else _PIECES_OF_MANY


@dataclass(frozen=True, eq=False)
class _Try:
    """One local search: its report, its polished plan, and whether that reaches the goal within the limits."""

    report: Start
    plan: Plan | None
    reaches: bool

    def rank(self) -> tuple[bool, bool, float]:
        """The best try has the least: local optima first, then what reaches the goal, by cost, then what misses it."""
        if self.plan is None:
            return True, True, np.inf
        return not self.report.converged, not self.reaches, self.plan.cost if self.reaches else self.plan.miss


def _starts(
    task: Reorientation, basis: SplineBasis, seed: int, count: int, iterations: int, watched: _Watched
) -> list[Guess]:
    """The guesses to start from; for few joints each first improved on a coarse spline, the cheapest taken."""
    if task.size > _MANY:
        return guesses(task, basis, seed, count)
    coarse = SplineBasis(_COARSE)
    scouts = guesses(task, coarse, seed, max(count, _SCOUTS))
    program = CollocationProgram(task, coarse)
    found: list[tuple[float, int, Guess]] = []
    for place, scout in enumerate(scouts):
        if watched.stopped and found:
            break
        turn = task.turn(scout.motion.final_attitude)
        solved = program.solve(
            scout.control,
            task.duration,
            task.evenly_wound
            if task.windings is not None
            else lambda places, scout=scout, turn=turn: scout.quaternions(places, turn),
            iterations=min(_SCOUTING, iterations),
            tolerance=1e-5,
            watch=watched.during("guesses", place + 1, len(scouts)),
        )
        curve = coarse.matrix(PLACES) @ (solved.control if solved.converged else scout.control)
        guess = guess_of(task, basis, curve)
        if guess is not None:
            found.append((solved.cost if solved.converged else np.inf, place, guess))
    return [guess for _, _, guess in sorted(found, key=lambda entry: entry[:2])][:count]


def _search(task: Reorientation, basis: SplineBasis, program: Any, guess: Guess, iterations: int, watch: Watch) -> _Try:
    """One local search."""
    began = time.perf_counter()
    turn = task.turn(guess.motion.final_attitude)
    solved: Solved = program.solve(
        guess.control,
        task.duration,
        task.evenly_wound if task.windings is not None else lambda places: guess.quaternions(places, turn),
        iterations=iterations,
        watch=watch,
    )
    plan = None
    try:
        plan = _plan(task, basis, solved, polished(task, basis, solved.control, solved.duration))
    except ShapePhaseError:
        plan = None
    reaches = plan is not None and plan.miss <= REACHED and _within_limits(task, basis, plan)
    report = Start(
        solved.status,
        solved.converged and reaches,
        solved.cost,
        task.miss(solved.attitude),
        solved.kkt_residual,
        solved.infeasibility,
        solved.iterations,
        time.perf_counter() - began,
    )
    return _Try(report, plan, reaches)


def _plan(task: Reorientation, basis: SplineBasis, solved: Solved, done: Polished) -> Plan:
    if task.cost == "time":
        cost = done.duration
    elif task.cost == "acceleration":
        places, weights = panel_nodes(basis)
        bend = basis.matrix(places, 2) @ done.control @ task.ties.T
        cost = float(0.5 * weights @ np.sum(bend**2, axis=1)) / done.duration**3
    else:
        cost = path_cost(task.body, done.path, task.cost)
    return Plan(
        task.body,
        done.path,
        done.motion,
        task.cost,
        cost,
        done.miss,
        done.first_miss,
        done.steps,
        solved.kkt_residual,
        done.control,
        "",
        solved.iterations,
        0.0,
        (),
    )


def _within_limits(task: Reorientation, basis: SplineBasis, plan: Plan) -> bool:
    """Whether duration, rates and windings are as wanted; the polish cannot take coordinates beyond their limits."""
    if task.windings is not None:
        attitudes = plan.motion.attitude(np.linspace(0.0, plan.path.duration, 50 * basis.pieces))
        if np.abs(task.wound(attitudes) - task.windings).max() > _WINDING:
            return False
    rates = np.abs(basis.rate_control @ plan.coefficients) / plan.path.duration
    return plan.path.duration <= task.duration * (1.0 + _SLACK) and bool(np.all(rates <= task.rates * (1.0 + _SLACK)))


def path_cost(body: Body, path: ShapePath, cost: str = "kinetic") -> float:
    """The cost "kinetic" or "rate" of a path, as `plan_reorientation` counts it, with the body's own matrices.

    By Gauss with twelve nodes between the path's breaks, each divided by four, and again by two until the cost stays
    the same to 1e-10 of it.

    Raises
    ------
    UnknownNameError, TrajectoryError
        For another cost, or a path of other joints.
    AccuracyNotReached
        If the cost does not settle: the path has jumps that are not declared as breaks.
    """
    if cost not in ("kinetic", "rate"):
        raise unknown_name("cost of a path", cost, ("kinetic", "rate"))
    route = path.matched(body.joint_names, body.name)
    before = _integral(body, route, cost, 2)
    for parts in _PARTS:
        now = _integral(body, route, cost, parts)
        if abs(now - before) <= _SETTLED * abs(now):
            return now
        before = now
    raise AccuracyNotReached(
        f"the cost of the path of {body.name} does not settle on {_PARTS[-1]} parts between its breaks (last at "
        f"{before:.9g}); declare the times of its jumps as breaks"
    )


def _integral(body: Body, route: ShapePath, cost: str, parts: int) -> float:
    """Of the cost's density, with so many parts between breaks."""
    inside, weights, _ = gauss_tableau(12)
    ends = np.concatenate([np.linspace(a, b, parts + 1)[:-1] for a, b in pairwise(route.breaks)] + [route.breaks[-1:]])
    steps = np.diff(ends)
    shapes, rates = route.curve((ends[:-1, None] + steps[:, None] * inside).ravel())
    if cost == "rate":
        density = 0.5 * np.sum(rates**2, axis=1)
    else:
        turning = -so3.apply(mechanical_connection(body, shapes), rates)
        density = body.kinetic_energy(shapes, rates, turning)
    return float((steps[:, None] * weights).ravel() @ density)


def _failure(task: Reorientation, tries: Sequence[_Try], best: _Try | None, stopped: bool) -> str:
    """What to tell about starts that all failed."""
    tale = "; ".join(
        f"start {number + 1}: {one.report.status}, off by {one.report.miss:.3g} rad, KKT residual "
        f"{one.report.kkt_residual:.2g}"
        for number, one in enumerate(tries)
    )
    if best is None or best.plan is None:
        left = "no try was left"
    elif best.reaches:
        left = f"the best try, in `best`, reaches the goal at cost {best.plan.cost:.6g}, but there may be cheaper ones"
    else:
        length = best.plan.path.duration
        left = f"the best try, in `best`, misses the goal by {best.plan.miss:.3g} rad in {length:.6g} s"
    if stopped:
        return f"the search for a motion of the joints of {task.body.name} was stopped as asked ({tale}); {left}"
    return (
        f"no motion of the joints of {task.body.name} was found that turns it as asked ({tale}); {left}; loosen the "
        "limits, or give more time, iterations or starts"
    )
