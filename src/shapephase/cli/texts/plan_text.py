"""A plan as text for people, as plain data for programs, and in one line for files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import so3
from ...body.body import Body
from ...optimal_control.plan import COST_UNITS, Plan
from ...optimal_control.way_back import Undo, WayBack
from ...phases.split_text import rotation_line
from .result_text import approach_data

if TYPE_CHECKING:
    from ...error_bars.covariance import Uncertainty
    from ..motion import LoadedMotion

_WAYS = {"backwards": "the motion played backwards", "plan": "the plan"}
_OF_RANGE = {"position": ", from the middle of the range"}
_ENDINGS = {
    "found": "This is the cheapest plan that was found",
    "not found": "No plan was found; this is the nearest that the search came",
    "stopped": "The search was stopped; this is the best until then",
    "out of time": "The search ended by its time limit; this is the best until then",
}


def plan_lines(body: Body, plan: Plan) -> list[str]:
    """Return the table of a plan."""
    momentum = " ".join(f"{value:g}" for value in plan.motion.momentum)
    passed = " ".join(f"{time:.6g}" for time in plan.waypoint_times)
    searches = "one search" if len(plan.starts) == 1 else f"{len(plan.starts)} searches"
    return [
        f"{body.name}: {plan.path.duration:g} s, {body.n_joints} joints, momentum ({momentum}) kg m^2/s",
        "",
        f"{'status':24}{plan.status:>16}",
        rotation_line("turned", plan.motion.final_attitude),
        f"{'off the goal':24}{plan.goal_error:16.2e} rad",
        f"{'cost':24}{plan.cost:16.9g}   {plan.cost_unit} ({plan.cost_name})",
        f"{'rates at the ends':24}{plan.rates_at_ends:>16}",
        *(
            f"{f'{name} at most':24}{share:16.4%}   of its limit{_OF_RANGE.get(name, '')}"
            for name, share in plan.limit_shares.items()
        ),
        *([f"{'closest links':24}{plan.closest[0].text}"] if plan.closest else []),
        *([f"{'waypoints passed at':24}{passed:>16} s"] if passed else []),
        f"{'KKT residual (scaled)':24}{plan.kkt_residual:16.2e}",
        f"{'iterations':24}{plan.iterations:16d}       (in {plan.seconds:.1f} s, {searches})",
    ]


def plan_data(body: Body, plan: Plan) -> dict[str, Any]:
    """Return a plan for programs."""
    return {
        "body": body.name,
        "status": plan.status,
        "duration_s": plan.path.duration,
        "momentum_kg_m2_s": plan.motion.momentum.tolist(),
        "final_attitude_quat_xyzw": so3.quat_from_matrix(plan.motion.final_attitude).tolist(),
        "miss_rad": plan.goal_error,
        "cost": plan.cost,
        "cost_name": plan.cost_name,
        "cost_unit": plan.cost_unit,
        "rates_at_ends": plan.rates_at_ends,
        "limit_shares": dict(plan.limit_shares),
        "closest_links": approach_data(plan.closest),
        "waypoint_times_s": plan.waypoint_times.tolist(),
        "kkt_residual": plan.kkt_residual,
        "iterations": plan.iterations,
        "seconds": plan.seconds,
        "searches": len(plan.starts),
        "searches_that_agree": plan.agreeing_starts,
        "second_order_met": plan.second_order,
        "hamiltonian_spread": plan.hamiltonian_spread,
    }


def undo_lines(flown: LoadedMotion, ways: Undo) -> list[str]:
    """Return the table of the ways back from a recording: played backwards, and planned."""
    body, shown = flown.body, [way for way in (ways.backwards, ways.plan) if way is not None]
    momentum, best = " ".join(f"{value + 0.0:g}" for value in flown.motion.momentum), ways.best
    fastest = [_fastest(body, way) for way in shown]
    rows = [
        ("", [way.name for way in shown], ""),
        ("off the start", [f"{way.error:.2e}" for way in shown], "rad"),
        (f"cost ({best.cost_name})", [f"{way.cost:.6g}" for way in shown], COST_UNITS[best.cost_name]),
        ("duration", [f"{way.path.duration:g}" for way in shown], "s"),
        *(
            (f"{name} at most", [f"{way.limit_shares[name]:.2%}" for way in shown], f"of its limit{where}")
            for name in ways.backwards.limit_shares
            for where in (_OF_RANGE.get(name, ""),)
        ),
        ("largest rate", [f"{rate:.4g}" for _, rate in fastest], _units_of(body, [joint for joint, _ in fastest])),
        ("  of joint", [body.joint_names[joint] for joint, _ in fastest], ""),
        ("limits", ["kept" if way.keeps_limits else "exceeded" for way in shown], ""),
    ]
    lines = [
        f"{body.name}: back from the end of the motion, {flown.motion.duration:g} s, momentum ({momentum}) kg m^2/s"
        f"{flown.beginning}",
        "",
        rotation_line("it turned", flown.motion.initial_attitude.T @ flown.motion.final_attitude),
        *(f"{name:24}{''.join(f'{value:>16}' for value in values)}   {unit}".rstrip() for name, values, unit in rows),
        "",
        f"best: {_WAYS[best.name]}",
    ]
    if not ways.backwards.undoes:
        off = math.degrees(ways.backwards.error)
        lines.append(f"Played backwards it ends {off:.4g} deg off: the momentum turns the body on.")
    for way in shown:
        if way.closest:
            lines.append(f"closest links, {_WAYS[way.name]}: {way.closest[0].text}")
    if ways.plan is None:
        lines.append(f"no plan: {ways.failure}")
    elif ways.plan.plan is not None:
        lines.append(f"KKT residual of the plan {ways.plan.plan.kkt_residual:.1e} (scaled), at rest at both ends")
    return lines


def undo_data(body: Body, ways: Undo) -> dict[str, Any]:
    """Return the ways back for programs."""
    shown = {way.name: way for way in (ways.backwards, ways.plan) if way is not None}
    back = {
        name: {
            "miss_rad": way.error,
            "undoes": way.undoes,
            "cost": way.cost,
            "duration_s": way.path.duration,
            "limit_shares": dict(way.limit_shares),
            "keeps_limits": way.keeps_limits,
            "closest_links": approach_data(way.closest),
            "peak_rates": dict(zip(body.joint_names, way.peak_rates.tolist(), strict=True)),
            "final_attitude_quat_xyzw": so3.quat_from_matrix(way.motion.final_attitude).tolist(),
            "search": None if way.plan is None else plan_data(body, way.plan),
        }
        for name, way in shown.items()
    }
    best = ways.best
    return {
        "body": body.name,
        "status": ways.status,
        "best": best.name,
        "momentum_kg_m2_s": best.motion.momentum.tolist(),
        "cost_name": best.cost_name,
        "cost_unit": COST_UNITS[best.cost_name],
        "ways_back": back,
        "failure": ways.failure or None,
    }


def undo_purpose(ways: Undo) -> str:
    """Return the first sentence of a report or file of a way back."""
    best = ways.best
    return (
        f"The way back: {_WAYS[best.name]}, off the start by {best.error:.1e} rad, cost {best.cost:.6g} "
        f"{COST_UNITS[best.cost_name]} ({best.cost_name})."
    )


def end_bar_lines(bars: Uncertainty | None) -> list[str]:
    """Return the line with the error bar of the attitude at the end by errors of masses and others; none without."""
    if bars is None:
        return []
    worst = math.degrees(math.sqrt(max(float(np.linalg.eigvalsh(bars.final_attitude)[-1]), 0.0)))
    return [f"{'attitude at the end':24}{'±':>8} {worst:<7.2g} deg about the worst axis, one standard deviation"]


def _fastest(body: Body, way: WayBack) -> tuple[int, float]:
    """Return the joint whose rate is the largest share of its limit, or the largest without limits, and its rate."""
    limits = np.where(np.isfinite(body.rate_limits), body.rate_limits, np.inf)
    shares = way.peak_rates / limits if np.isfinite(limits).any() else way.peak_rates
    joint = int(np.argmax(shares))
    return joint, float(way.peak_rates[joint])


def _units_of(body: Body, joints: list[int]) -> str:
    return " and ".join(dict.fromkeys(f"{body.joint_units[joint]}/s" for joint in joints))


def plan_purpose(plan: Plan) -> str:
    """Return the first sentence of a report."""
    return (
        f"{_ENDINGS[plan.status]}: off the goal by {plan.goal_error:.1e} rad, cost {plan.cost:.6g} "
        f"{plan.cost_unit} ({plan.cost_name})."
    )


def plan_comment(body: Body, plan: Plan) -> str:
    """Return the first line of the file of the joint motion."""
    return (
        f"shapephase plan, {body.name}: {plan.status}; off the goal by {plan.goal_error:.1e} rad, cost "
        f"{plan.cost:.9g} {plan.cost_unit} ({plan.cost_name}), KKT residual {plan.kkt_residual:.1e}"
    )
