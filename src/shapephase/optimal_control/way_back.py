"""The way back: a motion of the joints that undoes the turn of a recorded one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import so3
from ..arguments import check_executor, check_mapping, check_object, names_argument, positive_argument
from ..arrays import Array
from ..deformation.deformation import articulated
from ..display import Card, card_html, card_text, numbers
from ..dynamics.moving_body import needed_body_and_path
from ..dynamics.torques import joint_torques
from ..errors import PlanNotFound, ShapeError
from ..reconstruction.reconstruction import Motion, reconstruct
from ..run_progress import ProgressCallback, check_progress
from ..shape_space.closest_approach import ClosestApproach
from ..shape_space.shape_path import ShapePath
from ._path_cost import motion_cost
from ._plan_limits import LIMIT_SLACK, TIMES, closest_links
from ._polish import GOAL_TOLERANCE
from .plan import COST_UNITS, Plan
from .plan_options import Goal, Limits, Search
from .planning import plan_reorientation
from .task import FARTHEST, Reorientation, limits_of_joints, reorientation

_TOGETHER = 1e-9  # share of the duration: closer times would leave no digits of a difference
_TOLERANCE = 1e-10  # [rad] of the reconstructions: a hundredth of what counts as undone


@dataclass(frozen=True, eq=False)
class WayBack:
    """A motion of the joints that begins where a recording ends. Made by `undo`.

    Attributes
    ----------
    name : "backwards" for the recording played backwards, "plan"
    path : joints in time, from the posture at the end of the recording
    motion : its reconstruction from the attitude at the end of the recording, in the same inertial axes
    error : angle between the attitude at its end and that at the start of the recording [rad]
    cost, cost_name : what it costs, in the unit of the cost
    limit_shares : largest share that it takes up of each kind of limit, 1 being all of it; at 4,001 times and the knots
        of the path
    clearance, closest : least distance of links that `Limits` require [m], and the pairs that come nearer than that
        and 1 mm, the nearest first
    plan : the search's own result; None for a motion played backwards
    """

    name: str
    path: ShapePath
    motion: Motion
    error: float
    cost: float
    cost_name: str
    limit_shares: Mapping[str, float]
    clearance: float | None = None
    closest: tuple[ClosestApproach, ...] = ()
    plan: Plan | None = None

    __repr__, _repr_html_ = card_text, card_html

    @property
    def undoes(self) -> bool:
        """True where the attitude at the start of the recording is reached to 1e-8 rad."""
        return self.error <= GOAL_TOLERANCE

    @property
    def keeps_limits(self) -> bool:
        """True where no limit is exceeded, and no links come nearer than the clearance."""
        apart = all(near.distance >= (self.clearance or 0.0) for near in self.closest)
        return apart and max(self.limit_shares.values(), default=0.0) <= 1.0 + LIMIT_SLACK

    @cached_property
    def peak_rates(self) -> Array:
        """Largest rate of each joint: (n,) [rad/s or m/s]."""
        return np.abs(self.path.rate(np.linspace(0.0, self.path.duration, TIMES))).max(axis=0)

    def _card(self) -> Card:
        rows = [
            ("duration", numbers(self.path.duration, "s")),
            ("off the start", f"{self.error:.1e} rad"),
            ("cost", f"{numbers(self.cost, COST_UNITS[self.cost_name])} ({self.cost_name})"),
            ("of the limits", ", ".join(f"{name} {share:.1%}" for name, share in self.limit_shares.items())),
            *([("closest links", self.closest[0].text)] if self.closest else []),
        ]
        return Card(f"Way back: {self.name}", rows)


@dataclass(frozen=True, eq=False)
class Undo:
    """Ways back from the end of a recording to its start. Made by `undo`.

    Attributes
    ----------
    backwards : the recording played backwards
    plan : the cheapest motion that was found; None where none was, and playing backwards undoes within the limits
    status : of the search, as `Plan.status`
    failure : why there is no plan; empty with one
    """

    backwards: WayBack
    plan: WayBack | None
    status: str = "found"
    failure: str = ""

    __repr__, _repr_html_ = card_text, card_html

    @property
    def best(self) -> WayBack:
        """The way back that undoes; of two that do, the one within the limits; of two such, the cheaper one."""
        ways = [way for way in (self.backwards, self.plan) if way is not None]
        return min(ways, key=lambda way: (not way.undoes, not way.keeps_limits, way.cost))

    def _card(self) -> Card:
        rows = [
            (way.name, f"off the start by {way.error:.1e} rad, cost {numbers(way.cost, COST_UNITS[way.cost_name])}")
            for way in (self.backwards, self.plan)
            if way is not None
        ]
        return Card("Undo", [*rows, ("best", self.best.name)])


def undo(
    motion: Motion,
    *,
    duration: float | None = None,
    cost: str = "kinetic",
    joints: Sequence[str] | None = None,
    symmetric: Mapping[str, tuple[str, float]] | None = None,
    limits: Limits | None = None,
    search: Search | None = None,
    progress: ProgressCallback | None = None,
    executor: Executor | None = None,
) -> Undo:
    """Return motions of the joints that take a body back from the end of a motion to its start, posture and attitude.

    Without momentum the motion played backwards, at any pace, undoes its turn exactly: reversing the path inverts its
    holonomy. A plan from the last posture to the first, with the inverse turn as its goal, is often cheaper, starts and
    ends at rest, and keeps to limits that the motion exceeds. With momentum the body turns on while its joints move
    back: playing backwards does not undo, and a plan has to reach the first attitude at a given time.

    Source: theory.md B2: the holonomy of a path run backwards is the inverse, whatever the pace.

    Parameters
    ----------
    motion : of an articulated body: `reconstruct`, or `motion_from_recording(...).motion`
    duration : of the way back [s]; for cost "time" the longest allowed; None: that of the motion. Needed with momentum
    cost, joints, symmetric, limits, search, progress, executor : as for `plan_reorientation`; without momentum one more
        search starts from the motion played backwards

    Raises
    ------
    ShapeError
        For a batch, or with momentum without a duration; as `plan_reorientation`.
    WrongObjectError
        For a motion without a body and a path: made of particles or functions, or loaded from a file; with wheels.
    PlanNotFound
        If no plan was found, and playing backwards does not undo within the limits.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.0])
    >>> back = sp.optimal_control.undo(motion, search=sp.optimal_control.Search(pieces=12))
    >>> back.best.name, back.backwards.undoes
    ('backwards', True)
    """
    check_object(motion, "Motion", "motion")
    body, path = needed_body_and_path(motion, "a way back needs")
    if motion.batch:
        raise ShapeError(f"motion: one motion is needed, this is a batch {motion.batch}; take one momentum")
    tumbling = bool(np.any(motion.momentum))
    if duration is None and tumbling:
        raise ShapeError(
            "duration: with momentum the body turns on, and a way back needs the time at which it is back: give it in "
            "s (duration=, --duration)"
        )
    length = path.duration if duration is None else positive_argument(duration)
    back = path.reversed() if length == path.duration or tumbling else path.reversed().stretched(length / path.duration)
    within, chosen = Limits() if limits is None else limits, Search() if search is None else search
    check_object(within, "Limits", "limits")
    check_object(chosen, "Search", "search")
    check_executor(executor)
    check_progress(progress)
    if joints is not None:
        names_argument(joints, "joints", "names of joints")
    if symmetric is not None:
        check_mapping(symmetric, "symmetric", "joint -> (joint that it follows, factor)")
    last, first = motion.final_attitude, motion.initial_attitude
    goal = Goal(rotation=so3.transpose(last) @ first)
    options = {
        "momentum": so3.apply(so3.transpose(last), motion.momentum),
        "duration": length,
        "start": path.shape(path.duration),
        "end": path.shape(0.0),
        "cost": cost,
        "joints": joints,
        "symmetric": symmetric,
        "limits": within,
    }
    task = reorientation(body, goal, **options)

    def way(name: str, route: ShapePath, plan: Plan | None = None) -> WayBack:
        moved = reconstruct(articulated(body, route), motion.momentum, last, tolerance=_TOLERANCE)
        return WayBack(
            name=name,
            path=route,
            motion=moved,
            error=float(so3.angle(so3.transpose(first) @ moved.final_attitude)),
            cost=motion_cost(moved, body, route, cost, task.effort_measure),
            cost_name=cost,
            limit_shares=_motion_shares(task, within, moved, route),
            clearance=task.clearance,
            closest=closest_links(task, route) if plan is None else plan.closest,
            plan=plan,
        )

    backwards = way("backwards", back)
    if chosen.guess is None and not tumbling:
        chosen = replace(chosen, guess=back)
    try:
        plan = plan_reorientation(body, goal, **options, search=chosen, progress=progress, executor=executor)
    except PlanNotFound as failure:
        if not (backwards.undoes and backwards.keeps_limits):
            raise
        return Undo(backwards, None, getattr(failure.best, "status", "not found"), str(failure))
    return Undo(backwards, way("plan", plan.path, plan), plan.status)


def _motion_shares(task: Reorientation, limits: Limits, motion: Motion, route: ShapePath) -> dict[str, float]:
    """Largest shares of their limits that a motion along a route takes up, at 4,001 even times and the route's breaks.

    The jerk by differences of accelerations, which is exact between the breaks of a cubic spline.
    """
    body, times = task.body, np.union1d(np.linspace(0.0, motion.duration, TIMES), route.breaks)
    shapes, rates = route.curve(times)
    bends = route.acceleration(times)
    apart = np.diff(times) > _TOGETHER * motion.duration
    jerks = np.diff(bends, axis=0)[apart] / np.diff(times)[apart, None]
    bounded = np.isfinite(body.joint_limits).any(axis=1) & limits.joint_limits
    lower, upper = np.clip(body.joint_limits, -FARTHEST, FARTHEST).T
    bounds = {
        "position": (shapes - 0.5 * (lower + upper), np.where(bounded, 0.5 * (upper - lower), np.inf)),
        "rate": (rates, limits.rate_limits),
        "acceleration": (bends, limits.acceleration_limits),
        "jerk": (jerks, limits.jerk_limits),
    }
    shares: dict[str, float] = {}
    for name, (values, given) in bounds.items():
        limit = limits_of_joints(body, given, f"{name}_limits", body.rate_limits)
        bounded = np.isfinite(limit)
        if bounded.any():
            shares[name] = float((np.abs(values[:, bounded]) / limit[bounded]).max())
    if task.efforts_limited:
        shares["effort"] = float(np.abs(joint_torques(motion, times).torque / task.effort_measure).max())
    return shares
