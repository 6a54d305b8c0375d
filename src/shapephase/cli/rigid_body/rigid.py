"""`shapephase rigid`: a free rigid body in closed form, its figures, and its ellipsoid rolling in a page or a film."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...errors import ShapeError
from ..options import PRINT_DEFAULTS, FilmFile, Moments, OptionalFigureFile, PageFile, PrintOptions
from ..outcome import FIGURE_ENDINGS, Outcome, check_writable
from ..pictures import check_page_files, deliver
from ..terminal import write_file

if TYPE_CHECKING:
    from ...rigid_body.euler_top import EulerTop

Vector = tuple[float, float, float]

_LARGEST = 1e30  # [kg m^2/s, rad/s] and one over the least: pages hold numbers in 32 bits


def rigid_command(
    moments: Moments,
    /,
    *,
    momentum: Annotated[
        Vector,
        Parameter(
            negative_iterable="",
            help="Angular momentum at the start along the three principal axes, which the body starts with along the "
            "inertial ones, in kg m^2/s; for example `--momentum 0.6 0.9 0.5`.",
        ),
    ],
    figure: str = "polhodes",
    time: float = 0.0,
    out: OptionalFigureFile = None,
    html: PageFile = None,
    video: FilmFile = None,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Analyse a free rigid body: period, phase, polhodes, rolling ellipsoid, cones.

    Parameters
    ----------
    figure
        What `--out` draws: polhodes, herpolhode, rolling (the ellipsoid on its plane) or, with two equal moments,
        cones (of the body and of space); for example `--figure rolling`.
    time
        When the ellipsoid and the cones are shown, in s; for example `--time 1.5`.
    """
    from ...arguments import check_choice
    from ...plots.named_figures import RIGID_FIGURES, write_rigid_figure
    from ...plots.pages.poinsot_page import rolling_ellipsoid, rolling_facts

    check_choice(figure, "kind of figure", RIGID_FIGURES)
    if not math.isfinite(time):
        raise ShapeError(f"--time: a number is needed, got {time}")
    aside = check_writable(out, "--out", *FIGURE_ENDINGS)
    aside = check_page_files(html, video) or aside
    top = _top(moments, momentum)
    facts = rolling_facts(top)
    write_file(out, lambda file: write_rigid_figure(figure, top, file, time))
    written = {} if out is None else {"figure": str(out)}
    if html is not None or video is not None:
        written |= deliver(rolling_ellipsoid(top), html, video)[1]
    data = {
        "moments_kg_m2": list(moments),
        "momentum_kg_m2_s": list(momentum),
        "energy_J": top.energy,
        "regime": top.regime,
        "period_s": top.period if math.isfinite(top.period) else None,
        **written,
    }
    wide = max(len(name) for name, _, _ in facts)
    lines = [f"{name:{wide}}  {number}; {meaning}" for name, number, meaning in facts]
    return Outcome("\n".join(lines), data, aside=aside)


def _top(moments: Vector, momentum: Vector) -> EulerTop:
    """Return the body. Raises ShapeError for rates that cannot be drawn."""
    from ...rigid_body.euler_top import EulerTop

    largest = max(map(abs, momentum))
    if not largest <= _LARGEST:
        raise ShapeError(f"--momentum: at most {_LARGEST:g} kg m^2/s can be drawn, got {largest:g}")
    top = EulerTop.principal(moments, momentum)
    for speed in (top.magnitude / float(moment) for moment in top.moments):
        if top.magnitude and not 1.0 / _LARGEST <= speed <= _LARGEST:
            ends = f"from {1.0 / _LARGEST:g} to {_LARGEST:g} can be drawn"
            raise ShapeError(f"--momentum: this body may turn at {speed:.3g} rad/s; {ends}")
    return top
