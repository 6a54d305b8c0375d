"""Figures of a motion or a rigid body by name, one column wide, as images in files or in memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import check_choice, check_file_name, check_object
from ..body.body import Body
from ..display import short_repr
from ..errors import ShapeError
from ..files import write_whole
from ..phases.momentum_curve import Gauge
from ..reconstruction.reconstruction import Motion
from ..rigid_body.euler_top import EulerTop
from ..segments.limb_contributions import contributions
from ..segments.momentum import segment_momentum
from ..shape_space.body_path import as_path, in_joint_order
from ..shape_space.reach.holonomy_algebra import reachable
from ..shape_space.shape_path import ShapePath
from .loop_plots import HEIGHT as LOOP_HEIGHT
from .loop_plots import enclosing_pair, plot_loop
from .momentum_plots import plot_momentum_curve
from .motion_plots import plot_attitude, plot_energy, plot_inertia, plot_internal_momentum, plot_phases, plot_torques
from .plot_style import axes_image, column_axes, even_times, write_axes
from .polhode_plots import plot_herpolhode, plot_polhodes
from .rolling_plots import plot_cones, plot_rolling_ellipsoid
from .segment_plots import HEIGHT as SEGMENT_HEIGHT
from .segment_plots import plot_segment_momentum, plot_shares, plot_somersault
from .shape_plots import plot_curvature, plot_reach, plot_shape_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHOWN_PER_INCH = 130.0  # pixels in a notebook
_EXACT: Mapping[str, Any] = {}  # errors of inputs that have none


@dataclass(frozen=True)
class Figure:
    """A kind of figure.

    Attributes
    ----------
    caption : one line
    height : [in]
    draw : function of axes, motion, path of the joints, gauge and errors of the inputs by name
    with_momentum, with_path : whether it needs a momentum, a path of the joints
    of_change : whether it shows nothing but zero of a rigid body
    of_loop : whether it needs a path that closes
    in_report : whether a report has it
    of_athlete : whether a report has it only of a person or an animal whose somersaults are counted
    with_errors : whether it has bars for errors of the inputs

    Examples
    --------
    >>> sp.plots.FIGURES["phases"].height > 0.0
    True
    """

    caption: str
    height: float
    draw: Callable[[Axes, Motion, ShapePath | None, Gauge, Mapping[str, Any]], object]
    with_momentum: bool = False
    with_path: bool = False
    of_change: bool = False
    of_loop: bool = False
    in_report: bool = True
    of_athlete: bool = False
    with_errors: bool = False

    __repr__ = short_repr


def _draw_shape(ax: Axes, motion: Motion, path: ShapePath | None) -> None:
    plot_shape_path(ax, _joints_of(path, "shape"), getattr(motion.deformation.description, "body", None))


def _draw_curvature(ax: Axes, motion: Motion, path: ShapePath | None) -> None:
    body, route = _body_of(motion, "curvature"), _joints_of(path, "curvature")
    shapes = in_joint_order(body, route).shape(even_times(route, None))
    plot_curvature(ax, body, enclosing_pair(body, shapes), path=route)


def _joints_of(path: ShapePath | None, kind: str) -> ShapePath:
    if path is None:
        raise ShapeError(f"the figure {kind!r} needs the path of the joints, and there is none")
    return path


def _body_of(motion: Motion, kind: str) -> Body:
    body = getattr(motion.deformation.description, "body", None)
    if body is None:
        raise ShapeError(f"the figure {kind!r} needs a body with joints; make the motion of articulated(body, path)")
    return body


FIGURES: Mapping[str, Figure] = {
    "somersault": Figure(
        "Somersault, tilt and twist",
        2.8,
        lambda ax, motion, _, __, errors: plot_somersault(ax, motion, **errors),
        of_athlete=True,
        with_errors=True,
    ),
    "momentum": Figure(
        "The momentum in the frame of the gauge, and the area it encloses",
        3.9,
        lambda ax, motion, _, gauge, *__: plot_momentum_curve(ax, motion, gauge),
        with_momentum=True,
    ),
    "phases": Figure(
        "The phases in time", 2.8, lambda ax, motion, _, gauge, *__: plot_phases(ax, motion, gauge), with_momentum=True
    ),
    "attitude": Figure("The attitude as a rotation vector", 2.8, lambda ax, motion, *_: plot_attitude(ax, motion)),
    "shape": Figure(
        "The joints", 2.8, lambda ax, motion, path, *_: _draw_shape(ax, motion, path), with_path=True, of_change=True
    ),
    "torques": Figure(
        "The torques of the joints", 2.8, lambda ax, motion, *_: plot_torques(ax, motion), with_path=True
    ),
    "inertia": Figure(
        "Principal moments of the locked inertia", 2.8, lambda ax, motion, *_: plot_inertia(ax, motion.deformation)
    ),
    "internal_momentum": Figure(
        "Internal momentum", 2.8, lambda ax, motion, *_: plot_internal_momentum(ax, motion.deformation), of_change=True
    ),
    "energy": Figure(
        "The energy, and the axis that the momentum circles",
        2.8,
        lambda ax, motion, *_: plot_energy(ax, motion),
        with_momentum=True,
    ),
    "loop": Figure(
        "The loop of the joints on the curvature, and the parts of the turn by shape",
        LOOP_HEIGHT,
        lambda ax, motion, path, *_: plot_loop(ax, _body_of(motion, "loop"), _joints_of(path, "loop")),
        with_path=True,
        of_loop=True,
    ),
    "curvature": Figure(
        "The curvature over the two joints whose loop encloses most",
        2.8,
        lambda ax, motion, path, *_: _draw_curvature(ax, motion, path),
        with_path=True,
        in_report=False,
    ),
    "reach": Figure(
        "The pairs of joints whose small loops turn the body most",
        2.8,
        lambda ax, motion, *_: plot_reach(ax, reachable(_body_of(motion, "reach"))),
        in_report=False,
    ),
    "contributions": Figure(
        "The shares of the limbs in the twist",
        2.8,
        lambda ax, motion, *_: plot_shares(ax, contributions(motion)),
        in_report=False,
    ),
    "segment_momentum": Figure(
        "The momentum by link or limb",
        SEGMENT_HEIGHT,
        lambda ax, motion, *_: plot_segment_momentum(ax, segment_momentum(motion)),
        in_report=False,
    ),
}
"""Figures of a motion by name, as `Motion.plot`, `report` and the command line take them.

Examples
--------
>>> sp.plots.FIGURES["phases"].height  # [in]
2.8
"""
RIGID_FIGURES: Mapping[str, tuple[float, Callable[[Axes, EulerTop, float], object]]] = {
    "polhodes": (3.8, lambda ax, top, _: plot_polhodes(ax, top)),
    "herpolhode": (3.8, lambda ax, top, _: plot_herpolhode(ax, top)),
    "rolling": (3.6, lambda ax, top, time: plot_rolling_ellipsoid(ax, top, time)),
    "cones": (3.6, lambda ax, top, time: plot_cones(ax, top, time)),
}
"""Figures of a free rigid body by name: the height of each [in], and the function that draws it at a time [s]."""


def motion_figure(
    motion: Motion, kind: str | None = None, *, ax: Axes | None = None, gauge: Gauge = "horizontal"
) -> Axes:
    """Return one of `FIGURES` as axes; see `Motion.plot`."""
    check_object(motion, "Motion", "motion")
    named = kind or ("phases" if motion.momentum.any() else "attitude")
    axes = column_axes(_figure_of(named, motion).height) if ax is None else ax
    FIGURES[named].draw(axes, motion, getattr(motion.deformation.description, "path", None), gauge, {})
    if ax is None:
        axes._repr_png_ = partial(axes_image, axes, "png", _SHOWN_PER_INCH)  # type: ignore[attr-defined]
    return axes


def _figure_of(kind: str, motion: Motion) -> Figure:
    """Return a kind of figure that this motion has. Raises UnknownNameError, ShapeError."""
    check_choice(kind, "kind of figure", FIGURES)
    if FIGURES[kind].with_momentum and not motion.momentum.any():
        raise ShapeError(f"the figure {kind!r} needs an angular momentum; it is zero here, give one")
    return FIGURES[kind]


def figure_image(
    kind: str,
    motion: Motion,
    path: ShapePath | None = None,
    gauge: Gauge = "horizontal",
    *,
    ending: str = "svg",
    errors: Mapping[str, Any] = _EXACT,
) -> bytes:
    """Return one of `FIGURES` as an image: "svg", "pdf" or "png"."""
    figure = _figure_of(kind, motion)
    check_choice(ending, "kind of image", ("svg", "pdf", "png"))
    ax = column_axes(figure.height)
    figure.draw(ax, motion, path, gauge, errors)
    return axes_image(ax, ending)


def write_figure(
    kind: str,
    motion: Motion,
    out: str | os.PathLike[str],
    path: ShapePath | str | None = None,
    gauge: Gauge = "horizontal",
    *,
    errors: Mapping[str, Any] | None = None,
) -> None:
    """Write one of `FIGURES` to an .svg, .pdf or .png file, whole or not at all.

    Parameters
    ----------
    path : of the joints, for "shape"
    errors : of the inputs by name, as for `uncertainty`, for "somersault"; None: no error bars

    Raises
    ------
    UnknownNameError
        For another kind, or another ending.
    ShapeError
        For a kind that needs a momentum or a path, if there is none; for errors of another kind; or if the motion is a
        batch.
    MissingExtraError
        Without Matplotlib.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plots.write_figure("energy", motion, "energy.svg")
    >>> from pathlib import Path
    >>> Path("energy.svg").read_text()[:5]
    '<?xml'
    """
    check_object(motion, "Motion", "motion")
    check_file_name(out, "out")
    if path is not None:
        path = as_path(path)
    if errors and not _figure_of(kind, motion).with_errors:
        shown = ", ".join(name for name, figure in FIGURES.items() if figure.with_errors)
        raise ShapeError(
            f"errors: the figure {kind!r} has no error bars; leave them out, or take one that has: {shown}"
        )
    ending = Path(out).suffix.removeprefix(".").lower()
    image = figure_image(kind, motion, path, gauge, ending=ending, errors=errors or _EXACT)
    write_whole(out, lambda stream: stream.write(image))


def write_rigid_figure(kind: str, top: EulerTop, out: str | os.PathLike[str], time: float = 0.0) -> None:
    """Write one of `RIGID_FIGURES` to an .svg, .pdf or .png file, whole or not at all.

    time : at which the ellipsoid or the cones are shown [s]
    """
    check_choice(kind, "kind of figure", RIGID_FIGURES)
    height, draw = RIGID_FIGURES[kind]
    ax = column_axes(height)
    draw(ax, top, time)
    write_axes(ax, out)
