"""Closest approaches of links as a table for people and as plain data for programs."""

from __future__ import annotations

from collections.abc import Sequence

from ...shape_space.closest_approach import Clearance, ClosestApproach


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
