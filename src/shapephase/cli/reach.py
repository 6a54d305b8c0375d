"""`shapephase reach`: which rotations loops of a body's joints reach, by which loops, and which joints do most."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ..errors import ShapeError
from .joint_values import joint_values
from .options import BODY_DEFAULTS, PRINT_DEFAULTS, BodyArgument, BodyOptions, OptionalFigureFile, PrintOptions
from .outcome import FIGURE_ENDINGS, FIGURE_HEIGHT, Outcome, check_writable
from .terminal import write_file

if TYPE_CHECKING:
    from ..arrays import Array
    from ..shape_space.reach.holonomy_algebra import Reach

_WORDS = {
    0: "no rotation: loops of the joints leave the body as it was",
    1: "rotations about one axis",
    3: "every rotation",
}
_STROKE = 0.1  # [strokes] size of the loops in the table


def reach_command(
    body: BodyArgument,
    /,
    *,
    floating: BodyOptions = BODY_DEFAULTS,
    at: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative_iterable="", show_default=False)] = (),
    pairs: int = 10,
    out: OptionalFigureFile = None,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """List which rotations loops of the joints reach, the smallest loops about each axis, and the best pairs of joints.

    The body has no angular momentum.

    Parameters
    ----------
    at
        Where the loops begin: JOINT=VALUE with blanks or commas between them, in rad or m or with a unit; other joints
        are at zero. For example `--at waist_pitch=20deg`.
    pairs
        Number of pairs of joints in the list; for example `--pairs 20`.
    """
    from ..shape_space.reach.holonomy_algebra import reachable
    from .motion import body_argument

    aside = check_writable(out, "--out", *FIGURE_ENDINGS)
    if pairs < 0:
        raise ShapeError(f"--pairs: a whole number, 0 or more, is needed, got {pairs}")
    loaded = body_argument(body, floating)
    reach = reachable(loaded, loaded.shape(joint_values(loaded, at, "--at")))
    if out is not None:
        from ..plots.plot_style import column_axes, write_axes
        from ..plots.shape_plots import plot_reach

        write_file(out, lambda file: write_axes(plot_reach(column_axes(FIGURE_HEIGHT), reach), file))
    data = _data(reach, pairs) | {"figure": None if out is None else str(out)}
    return Outcome("\n".join(_lines(reach, pairs)), data, aside=aside)


def _lines(found: Reach, most_pairs: int) -> list[str]:
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
            f"order {each.order}            {_three(each.axis)}{math.degrees(each.turn * _STROKE**each.order):22.6f}"
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


def _data(found: Reach, most_pairs: int) -> dict[str, Any]:
    """Return the result for programs."""
    return {
        "body": found.name,
        "joints": list(found.joint_names),
        "shape": found.shape.tolist(),
        "strokes": found.strokes.tolist(),
        "rank": found.rank,
        "singular_values": found.singular_values.tolist(),
        "noise": found.noise,
        "gap": found.gap if math.isfinite(found.gap) else None,
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
    return " ".join(f"{value:7.4f}" for value in axis.round(4) + 0.0)
