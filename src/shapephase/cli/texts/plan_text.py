"""A plan as text for people, as plain data for programs, and in one line for files."""

from __future__ import annotations

from ... import so3
from ...body.body import Body
from ...optimal_control.plan import Plan
from ...phases.split_text import rotation_line
from .result_text import approach_data

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


def plan_data(body: Body, plan: Plan) -> dict[str, object]:
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
