"""Bodies, motions, splits and closed orbits as text for people and as plain data for programs."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...phases.phase_split import PhaseSplit
from ...phases.return_map import FixedPoints
from ...plain_data import plain
from ...reconstruction.reconstruction import Motion
from ...reconstruction.recorded_base import base_difference
from ...shape_space.closest_approach import Clearance, ClosestApproach
from ...shape_space.files.read import RecordedMotion
from ...shape_space.summaries import BodySummary, PathSummary


def split_heading(body: Body, motion_name: str, motion: Motion) -> str:
    """Return the first line of the table of a split."""
    momentum = " ".join(f"{v:g}" for v in motion.momentum)
    start = so3.quat_from_matrix(motion.initial_attitude)
    turned = "" if start[3] == 1.0 else f", attitude at the start ({' '.join(f'{v:.6g}' for v in start + 0.0)})"
    return (
        f"{body.name} along {motion_name}: {motion.duration:g} s, {body.n_joints} joints, {body.mass:.6g} kg, "
        f"momentum ({momentum}) kg m^2/s{turned}"
    )


def split_data(body: Body, motion_name: str, motion: Motion, result: PhaseSplit) -> dict[str, Any]:
    """Return a split for programs."""
    return {
        "body": body.name,
        "motion": motion_name,
        "duration_s": motion.duration,
        "momentum_kg_m2_s": motion.momentum.tolist(),
        "initial_attitude_quat_xyzw": so3.quat_from_matrix(motion.initial_attitude).tolist(),
        "final_attitude_quat_xyzw": motion.quat_xyzw(motion.duration).tolist(),
        **result.to_dict(),
        "error_estimate_rad": float(motion.error_estimate),
        "evaluations": motion.evaluations,
        "sha256": dict(motion.deformation.inputs),
    }


def orbit_lines(
    body: Body, motion_name: str, gauge: str, found: FixedPoints, starts: Array, splits: list[PhaseSplit]
) -> list[str]:
    """Return the table of closed orbits and their phases."""
    certain = "these are all: their indices sum to 2"
    if not found.complete:
        certain = f"these are perhaps not all: their indices sum to {found.index_sum}, those of all to 2"
    lines = [
        f"{body.name} along {motion_name}, momentum {found.magnitude:g} kg m^2/s, {gauge} gauge: "
        f"{len(splits)} closed orbits, attitudes to {found.tolerance:g} rad",
        certain,
        "",
        f"{'direction at the start (base axes)':>36}{'index':>7}{'Montgomery [deg]':>20}"
        f"{'dynamic':>14}{'geometric':>14}  stability",
    ]
    for direction, index, kind, result in zip(starts, found.index, found.stability, splits, strict=True):
        place = " ".join(f"{v + 0.0:11.7f}" for v in np.round(direction, _DIRECTION_DIGITS))
        first, second, third = np.degrees([result.montgomery_phase, result.dynamic_phase, result.geometric_phase])
        lines.append(f"{place:>36}{index:+7d}{first:20.6f}{second:14.6f}{third:14.6f}  {kind}")
    return lines


def orbit_data(
    body: Body, motion_name: str, gauge: str, found: FixedPoints, starts: Array, splits: list[PhaseSplit]
) -> dict[str, Any]:
    """Return closed orbits and their phases for programs."""
    rows = zip(starts.tolist(), found.index.tolist(), found.trace.tolist(), found.stability, splits, strict=True)
    names = ("momentum_direction_at_start", "index", "trace", "stability")
    orbits = [dict(zip(names, row[:4], strict=True)) | row[4].to_dict() | {"gauge": gauge} for row in rows]
    return {
        "body": body.name,
        "motion": motion_name,
        "momentum_kg_m2_s": found.magnitude,
        "gauge": gauge,
        "complete": found.complete,
        "index_sum": found.index_sum,
        "tolerance_rad": found.tolerance,
        "orbits": orbits,
    }


def body_lines(summary: BodySummary) -> list[str]:
    """Return the table of a body."""
    width = max(map(len, ("joint", *(joint.name for joint in summary.joints))))
    balls = sum(joint.kind == "ball" for joint in summary.joints) // 4
    count = len(summary.joints) - 3 * balls
    lines = [
        f"{summary.name}: {summary.mass:.6g} kg, {len(summary.links)} links, {count} joints",
        f"{'centre of mass':24}{_numbers(summary.centre_of_mass)}   m, base axes, neutral shape",
        f"{'principal moments':24}{_numbers(summary.principal_moments)}   kg m^2",
        f"{'sha256':24}{summary.sha256 or 'none: not from a file'}",
        "",
        f"{'joint':<{width}}  {'kind':<10}{'lower':>12}{'upper':>12}{'range':>16}",
    ]
    for joint in summary.joints:
        if joint.kind == "ball" and not joint.name.endswith(_FIRST_OF_FOUR):
            continue
        limits = "".join(f"{_limit(value):>12}" for value in (joint.lower, joint.upper))
        span = _limit(joint.upper - joint.lower)
        unit, name = ("", _of_ball(joint.name)) if joint.kind == "ball" else (joint.unit, joint.name)
        lines.append(f"{name:<{width}}  {joint.kind:<10}{limits} {unit:<3}{span:>12}")
    if summary.followers:
        width = max(map(len, ("follower", *summary.followers)))
        lines += [
            "",
            f"{'follower':<{width}}  rule",
            *(f"{k:<{width}}  {rule}" for k, rule in summary.followers.items()),
        ]
    return [*lines, "", *_part_lines(summary)]


def _part_lines(summary: BodySummary) -> list[str]:
    """Return a table of rigid parts, by the first link and the number of links fixed to it."""
    names = [
        part.links[0] if len(part.links) == 1 else f"{part.links[0]} +{len(part.links) - 1}" for part in summary.parts
    ]
    width = max(map(len, ("link", *names)))
    lines = [f"{'link':<{width}}{'kg':>13}  {'centre of mass [m]':^38}  {'principal moments [kg m^2]':^38}".rstrip()]
    for name, part in zip(names, summary.parts, strict=True):
        lines.append(
            f"{name:<{width}}{part.mass:13.6g}  {_numbers(part.centre_of_mass)}  {_numbers(part.principal_moments)}"
        )
    return lines


def path_lines(
    body: Body, name: str, summary: PathSummary, recorded: RecordedMotion | None, wheels: Collection[str] = ()
) -> list[str]:
    """Return the table of a joint motion; wheels are not listed as joints at rest."""
    closes = "yes" if summary.is_loop else f"no: {gap_text(body, summary.gap)} from its start"
    lines = [
        f"{name}: {summary.duration:g} s, {_pieces(summary.breaks - 1)}",
        f"{'closes':24}{closes}",
    ]
    if recorded is not None:
        lines.insert(1, f"{'recorded':24}{len(recorded.times)} samples, {recorded.format}")
        if recorded.base_attitude is not None:
            lines.append(f"{'base':24}recorded too")
    balls = {name for ball in body.chain.follows.balls for name in ball.names}
    moved = {_of_ball(name) for name in balls - {*summary.still_joints}}
    still = [_of_ball(name) if name in balls else name for name in summary.still_joints]
    still = [name for name in dict.fromkeys(still) if name not in moved and name not in wheels]
    for title, names in (
        ("beyond their limits", summary.joints_beyond_limits),
        ("beyond their rates", summary.joints_beyond_rates),
        ("at rest", still),
    ):
        lines += [f"{title:24}{', '.join(names)}"] if names else []
    return lines


def too_fast(body: Body, summary: PathSummary) -> str:
    """Return a warning about joints that move faster than the body's file allows."""
    rows = [body.joint_index(name) for name in summary.joints_beyond_rates]
    rows.sort(key=lambda k: -summary.fastest[k] / body.rate_limits[k])
    rates = [
        f"{body.joint_names[k]} {summary.fastest[k]:.4g} of {body.rate_limits[k]:.4g} {body.joint_units[k]}/s"
        for k in rows[:_MOST_NAMED]
    ]
    more = [f"{len(rows) - _MOST_NAMED} more"] if len(rows) > _MOST_NAMED else []
    return (
        f"joints move faster than the limits of the body's file: {', '.join(rates + more)}; check times and "
        "units, slow the motion down, or change the limits (velocity)"
    )


def _pieces(count: int) -> str:
    return "smooth throughout" if count == 1 else f"{count} smooth pieces"


def gap_text(body: Body, gap: Array) -> str:
    """Return the joint that ends farthest from its start, and its gap of (n,) [rad or m]."""
    worst = int(np.argmax(np.abs(gap)))
    unit, off = body.joint_units[worst], float(gap[worst])
    turned = f" ({math.degrees(off):.4g} deg)" if unit == "rad" else ""
    return f"{body.joint_names[worst]} ends {off:.6g} {unit}".removesuffix(" 1") + turned


def record_data(recorded: RecordedMotion | None) -> dict[str, Any]:
    """Return a recording for programs."""
    if recorded is None:
        return {}
    return {
        "format": recorded.format,
        "samples": len(recorded.times),
        "residual_rms": dict(zip(recorded.path.joint_names or (), recorded.residual.tolist(), strict=True)),
        "base_recorded": recorded.base_attitude is not None,
    }


def recorded_base_text(motion: Motion, recorded: RecordedMotion | None) -> tuple[list[str], dict[str, Any]]:
    """Return the difference of the recorded base from the reconstructed one, as lines and as data."""
    if recorded is None or recorded.base_attitude is None:
        return [], {}
    found = base_difference(motion, recorded.times, recorded.base_attitude)
    worst = int(np.argmax(found.angle))
    angle, when = float(found.angle[worst]), float(found.times[worst])
    text = f"{'base as recorded':24}{np.degrees(angle):16.6f} deg at most from this one, at {when:g} s"
    return [text], {"recorded_base_difference_rad": angle, "recorded_base_difference_time_s": when}


_MOST_NAMED = 4  # joints in a warning
_DIRECTION_DIGITS = 7  # after the point
_FIRST_OF_FOUR = ".x"  # end of the name of a ball joint's first number, in whose row it is shown
_PATH_KEYS = {"joints_beyond_limits": "beyond", "joints_beyond_rates": "too_fast", "still_joints": "resting"}
"""JSON keys that are shorter than the names of the fields."""


def path_data(summary: PathSummary) -> dict[str, Any]:
    """Return the summary of a joint motion for programs."""
    return {_PATH_KEYS.get(key, key): value for key, value in plain(summary).items()}


def _of_ball(name: str) -> str:
    """Return the ball joint of a name such as `neck.x`."""
    return name.rpartition(".")[0]


def _numbers(values: Array) -> str:
    return " ".join(f"{value:12.6g}" for value in values)


def _limit(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "none"


def clearance_lines(result: Clearance, distance: float) -> list[str]:
    """Return the table of pairs that come nearer than a distance, and what was not compared."""
    geometry, near = result.geometry, result.approaches
    count = f"{len(near)} of {len(geometry.pairs)} pairs of links"
    lines = [f"{count} come closer than {distance:g} m" + (":" if near else "")]
    if near:
        names = [f"{first}, {second}" for first, second in (approach.links for approach in near)]
        width = max(map(len, ("links", *names)))
        lines.append(f"{'links':<{width}}{'closest at [s]':>16}{'distance [m]':>16}")
        lines += [f"{name:<{width}}{a.time:16.6g}{a.distance:16.6f}" for name, a in zip(names, near, strict=True)]
    left_out = {reason: sum(entry[2] == reason for entry in geometry.left_out) for *_, reason in geometry.left_out}
    if left_out:
        reasons = ", ".join(f"{number} {reason}" for reason, number in left_out.items())
        lines.append(f"{'pairs left out':24}{reasons} (--json lists them)")
    if geometry.missing:
        lines.append(f"{'links without shapes':24}{', '.join(geometry.missing)}")
    return lines


def clearance_data(result: Clearance, distance: float) -> dict[str, object]:
    """Return closest approaches for programs."""
    return {
        "below_m": distance,
        "pairs_compared": len(result.geometry.pairs),
        "closer": approach_data(result.approaches),
        "left_out": [
            {"links": [first, second], "reason": reason} for first, second, reason in result.geometry.left_out
        ],
        "links_without_shapes": list(result.geometry.missing),
    }


def approach_data(approaches: Sequence[ClosestApproach]) -> list[dict[str, object]]:
    """Return pairs of links with their least distance for programs."""
    return [{"links": list(near.links), "time_s": near.time, "distance_m": near.distance} for near in approaches]
