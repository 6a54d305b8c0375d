"""`shapephase conjugate`: conjugate points of the Serret-Andoyer metric of a free rigid body."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ...errors import ShapeError
from ..options import PRINT_DEFAULTS, Moments, OptionalFigureFile, PrintOptions
from ..outcome import FIGURE_ENDINGS, FIGURE_HEIGHT, Outcome, check_writable
from ..terminal import write_file

_PARTS = (1.0, 0.8, 0.6, 0.4, 0.2, 0.05)  # of the way from the separatrix' p to the largest: the p without --momenta


def conjugate_command(
    moments: Moments,
    /,
    *,
    momenta: Annotated[
        tuple[float, ...], Parameter(consume_multiple=True, negative_iterable="", show_default=False)
    ] = (),
    order: int = 1,
    out: OptionalFigureFile = None,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """List conjugate points of the free rigid body's Serret-Andoyer metric, and draw their locus.

    The three principal moments must differ.

    Parameters
    ----------
    momenta
        Momenta of the geodesics, p = |Pi|/sqrt(2 E), above the square root of the middle moment and at most that of the
        largest, in sqrt(kg) m; default: six of them. For example `--momenta 1.5 1.6`.
    order
        Which conjugate point of each geodesic, 1 the first; for example `--order 2`.
    """
    import numpy as np

    from ...arrays import finite_array
    from ...rigid_body.geodesics import serret_andoyer_metric

    aside = check_writable(out, "--out", *FIGURE_ENDINGS)
    metric = serret_andoyer_metric(moments)
    low, high = metric.separatrix_momentum, metric.largest_momentum
    p = finite_array(momenta if momenta else [low + part * (high - low) for part in _PARTS], "--momenta", (None,))
    p = p if momenta else np.minimum(p, high)
    if np.any((p <= low) | (p > high)):
        raise ShapeError(
            f"--momenta: only geodesics with {low:.6g} < p <= {high:.6g} have conjugate points and are listed, got "
            + " ".join(f"{value:g}" for value in p)
        )
    family = metric.geodesics(p)
    found = family.conjugate_points(order)
    if out is not None:
        from ...plots.geodesic_plots import plot_conjugate_locus
        from ...plots.plot_style import column_axes, write_axes

        ax = plot_conjugate_locus(column_axes(FIGURE_HEIGHT), moments, order, momenta=p)
        write_file(out, lambda file: write_axes(ax, file))
    rows = zip(p, family.period, family.first_return, found.time, found.phi, found.theta, strict=True)
    listed = " ".join(f"{moment:g}" for moment in moments)
    lines = [
        f"Serret-Andoyer metric of moments {listed} kg m^2, conjugate points of order {order}",
        f"asymptote at phi = {metric.crest:.9f} sqrt(kg) m either side, as p falls to {low:.9f}",
        "",
        "".join(f"{name:>16}" for name in ("p", "T", "R [rad]", "time", "phi", "theta [rad]")),
        *("".join(f"{value:16.9f}" for value in np.round(row, 9) + 0.0) for row in rows),
        "",
        "p, T, time and phi in sqrt(kg) m; of geodesics that start upward, the others are mirror images",
    ]
    data = {
        "moments_kg_m2": list(moments),
        "order": order,
        "crest": metric.crest,
        "p": p.tolist(),
        "period": family.period.tolist(),
        "first_return_rad": family.first_return.tolist(),
        "conjugate_time": found.time.tolist(),
        "phi": found.phi.tolist(),
        "theta_rad": found.theta.tolist(),
        "figure": None if out is None else str(out),
    }
    return Outcome("\n".join(lines), data, aside=aside)
