"""Result of `shapephase reach` as text and as plain data."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Array
from ...shape_space.reach.holonomy_algebra import Reach

_WORDS = {
    0: "no rotation: loops of the joints leave the body as it was",
    1: "rotations about one axis",
    3: "every rotation",
}
_STROKE = 0.1  # [strokes] size of the loops in the table


def reach_lines(found: Reach, most_pairs: int) -> list[str]:
    """Return the table."""
    moved = {name: value for name, value in zip(found.joint_names, found.shape, strict=True) if value}
    place = " ".join(f"{name}={value:g}" for name, value in moved.items()) or "neutral"
    lines = [f"{found.name}: {len(found.joint_names)} joints, from the shape {place}"]
    lines.append(f"reached by loops without angular momentum: {_WORDS[found.rank]} (rank {found.rank} of 3)")
    values = " ".join(f"{value:.3g}" for value in found.singular_values)
    lines.append(f"singular values {values}; the smallest of the rank is {found.gap:.2g} times the next, or the noise")
    if found.orders:
        lines += ["", "order  rank  axes reached (base axes)"]
        lines += [
            f"{each.order:>5}{each.rank:>6}  {'   '.join(_three(axis) for axis in each.axes) or '-'}"
            for each in found.orders
        ]
    if found.loops:
        lines += ["", f"smallest loops     axis (base axes)           turn at a stroke of {_STROKE:g} [degrees]"]
        lines += [
            f"order {each.order}            {_three(each.axis)}{np.degrees(each.turn * _STROKE**each.order):22.6f}"
            for each in found.loops
        ]
    if found.pairs and most_pairs:
        wide = max(len(" x ".join(pair.joints)) for pair in found.pairs[:most_pairs])
        lines += ["", f"{'pairs of joints':<{wide}}  degrees per square radian   axis of the turn"]
        for pair in found.pairs[:most_pairs]:
            unit = "" if pair.units == "rad^2" else f" (per {pair.units})"
            lines.append(f"{' x '.join(pair.joints):<{wide}}{pair.degrees:>27.6f}   {_three(pair.axis)}{unit}")
        if len(found.pairs) > most_pairs:
            lines.append(f"and {len(found.pairs) - most_pairs} more pairs")
    return lines


def reach_data(found: Reach, most_pairs: int) -> dict[str, Any]:
    """Return the result for programs."""
    return {
        "body": found.name,
        "joints": list(found.joint_names),
        "shape": found.shape.tolist(),
        "strokes": found.strokes.tolist(),
        "rank": found.rank,
        "singular_values": found.singular_values.tolist(),
        "noise": found.noise,
        "gap": found.gap if np.isfinite(found.gap) else None,
        "orders": [
            {
                "order": each.order,
                "rank": each.rank,
                "axes": each.axes.tolist(),
                "singular_values": each.singular_values.tolist(),
            }
            for each in found.orders
        ],
        "loops": [
            {"axis": each.axis.tolist(), "order": each.order, "turn_rad_per_stroke_to_the_order": each.turn}
            for each in found.loops
        ],
        "pairs": [
            {
                "joints": list(pair.joints),
                "degrees_per_unit": pair.degrees,
                "unit": pair.units,
                "axis": pair.axis.tolist(),
            }
            for pair in found.pairs[:most_pairs]
        ],
    }


def _three(axis: Array) -> str:
    # Rounding first, and 0 after it: no minus before a zero.
    return " ".join(f"{value:7.4f}" for value in np.round(axis, 4) + 0.0)
