"""`shapephase reach`: which rotations loops of a body's joints reach, by which loops, and which joints do most."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ..errors import ShapeError
from .joint_values import joint_values
from .options import BODY_DEFAULTS, PRINT_DEFAULTS, BodyArgument, BodyOptions, OptionalFigureFile, PrintOptions
from .outcome import Outcome, check_writable
from .terminal import say_written

_ENDINGS = (".svg", ".pdf", ".png")


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
    from .texts.reach_text import reach_data, reach_lines

    aside = check_writable(out, "--out", *_ENDINGS)
    if pairs < 0:
        raise ShapeError(f"--pairs: a whole number, 0 or more, is needed, got {pairs}")
    loaded = body_argument(body, floating)
    reach = reachable(loaded, loaded.shape(joint_values(loaded, at, "--at")))
    if out is not None:
        from ..plots.plot_style import column_axes, write_axes
        from ..plots.shape_plots import plot_reach

        write_axes(plot_reach(column_axes(2.8), reach), out)
        say_written(out)
    data = reach_data(reach, pairs) | {"figure": None if out is None else str(out)}
    return Outcome("\n".join(reach_lines(reach, pairs)), data, aside=aside)
