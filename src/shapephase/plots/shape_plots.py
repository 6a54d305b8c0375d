"""Figures of shapes: joints in time, loops in the plane of two joints, and the curvature over such a plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, whole_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..errors import ShapeError
from ..letters import value_text
from ..shape_space.body_path import as_path, in_joint_order
from ..shape_space.curvature_field import curvature_on_plane
from ..shape_space.reach.holonomy_algebra import Reach
from ..shape_space.shape_path import ShapePath
from . import plot_style as style
from ._joint_styles import MAX_NAMED, both_sides, joint_place, joint_styles, named_joints, plain_text, plot_joints
from .curvature_map import component_of, draw_loop, draw_map, even_row, name_axes, row_around, squared_unit, two_joints

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AT_REST = 1e-9  # [rad or m] range of a joint that does not move
_SHOWN = {"rad": "deg", "m": "m", "1": "1", "rad or m": "rad or m"}  # units in the legend
_NEAR_LIMIT = 0.3  # of the joints' range: farther limits are not in the figure
_BAND = 0.035  # of the figure's height: a band beyond a limit
_AXES = "xyz"


def plot_shape_path(
    ax: Axes,
    path: ShapePath | str,
    body: Body | ParticleBody | str | None = None,
    joints: Sequence[str | int] | None = None,
    *,
    times: ArrayLike | None = None,
) -> Axes:
    """The joints in time: those that turn in degrees, with radians beside them or metres of those that slide.

    A joint of the left side and its like on the right have one colour and marker, the left one a pale broad line, the
    right one dashes. What is beyond a joint's limit is a band of its colour, where the limit is near enough to be seen.

    Parameters
    ----------
    ax : flat axes; where there are joints of both units, a twin of them is added to their figure
    body : whose joints they are, for names and units; None: names as the path has them, all on one scale
    joints : names or indices of those to draw; None: those that move. The six that move most are named, the others
        are grey
    times : (N,) where to draw [s]; None: evenly between the breaks

    Raises
    ------
    ShapeError
        If there are no joints to draw, or `joints` is not a list.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> len(sp.plots.plot_shape_path(ax, sp.examples.kane_scher(0.0, 0.5)).lines)  # one for each joint
    3
    """
    body = None if body is None else as_body_or_particles(body)
    path = as_path(path, body)
    style.check_flat_axes(ax)
    t = style.even_times(path, times)
    route, names, units = _named(path, body)
    values = route.shape(t)
    span = np.ptp(values, axis=0)
    if joints is not None and (isinstance(joints, str) or not isinstance(joints, Sequence | np.ndarray)):
        raise ShapeError(f"joints: several names or numbers in a list are needed, got {value_text(joints)}")
    chosen = (
        np.flatnonzero(span > _AT_REST) if joints is None else np.array([joint_place(j, names) for j in joints], int)
    )
    if not names:
        raise ShapeError("the body has no joints to draw; the figure 'attitude' shows how it turns")
    if not len(chosen):
        raise ShapeError("joints: none of them moves along this path; name those to draw")
    chosen = chosen[np.argsort(-span[chosen], kind="stable")] if len(chosen) > MAX_NAMED else chosen
    scales = sorted({units[k] for k in chosen}, key=("rad", "m", "1", "rad or m").index)
    places: dict[str, Any] = {unit: ax if n == 0 else ax.twinx() for n, unit in enumerate(scales)}
    legend = plot_joints(places, t, values, chosen, names, units, _SHOWN)
    named = named_joints(chosen.tolist(), units)
    shown = [names[k] for k in named]
    if body is not None and _limit_bands(places, units, body.joint_limits, values, named, joint_styles(shown)):
        legend["handles"].append(_band_patch())
        legend["labels"].append("beyond a limit")
    for unit, twin in list(places.items())[1:]:
        style.finer(twin, route.loops)
        style.label_ordinate(twin, f"joints [{unit}]", max(map(abs, twin.get_ylim())))
        twin.tick_params(labelsize=style.SMALL)
    title = "joints in time; dashes: the right side" if both_sides(shown) else "joints in time"
    style.in_time(ax, (t[0], t[-1]), f"joints [{scales[0]}]", loops=route.loops, title=title, **legend)
    if scales[0] == "rad":
        style.degrees_first(ax, "joints", radians=len(scales) == 1)
    return ax


def plot_shape_plane(
    ax: Axes,
    path: ShapePath | str,
    joints: Sequence[str | int],
    body: Body | ParticleBody | str | None = None,
    *,
    times: ArrayLike | None = None,
) -> Axes:
    """A path of shapes in the plane of two joints, with its start and its direction.

    Parameters
    ----------
    ax : flat axes
    joints : the names or indices of the two; the first is the abscissa
    body, times : as for `plot_shape_path`

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> path = sp.examples.kane_scher(0.0, 0.5)
    >>> len(sp.plots.plot_shape_plane(ax, path, (0, 1)).lines) >= 1
    True
    """
    body = None if body is None else as_body_or_particles(body)
    path = as_path(path, body)
    style.check_flat_axes(ax)
    t = style.even_times(path, times)
    route, names, units = _named(path, body)
    places = two_joints(joints, names)
    draw_loop(ax, route.shape(t)[:, places])
    name_axes(ax, [names[k] for k in places], [units[k] for k in places])
    style.finish(ax, ncols=3)
    return ax


def plot_curvature(
    ax: Axes,
    body: Body | ParticleBody | str,
    joints: Sequence[str | int],
    first: ArrayLike | None = None,
    second: ArrayLike | None = None,
    *,
    axis: str | ArrayLike | None = None,
    shape: ArrayLike | None = None,
    path: ShapePath | str | None = None,
) -> Axes:
    """One component of the curvature over the plane of two joints, with a path of shapes on it.

    Blue is positive and orange negative; lines of equal curvature are labelled, solid where positive, dashed where
    negative, thick where zero. A small counterclockwise loop turns the body by minus the curvature times its area. The
    axes are in radians with ticks in degrees, or in metres.

    Parameters
    ----------
    ax : flat axes; a scale of colours is added to their figure
    joints : the names or indices of the two; the first is the abscissa
    first, second : (A,), (B,) where to evaluate, ascending [rad or m]; None: around the path, or the joints' limits
    axis : "x", "y", "z", "norm", or the direction (3,) whose component is drawn, base axes; None: that of the largest
        component
    shape : (n,) positions of the other joints; None: neutral
    path : to be drawn; its other joints may move

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> cat = sp.load_body("cat_two_halves")
    >>> sp.plots.plot_curvature(ax, cat, ("waist_pitch", "waist_yaw"), axis="x").get_xlabel()
    'waist_pitch [deg]'
    """
    body = as_body_or_particles(body)
    if path is not None:
        path = as_path(path, body)
    style.check_flat_axes(ax)
    places = two_joints(joints, body.joint_names)
    points = None
    if path is not None:
        points = in_joint_order(body, path).shape(style.even_times(path, None))[:, places]
    rows = [
        _row(values, body, k, None if points is None else points[:, n], label)
        for n, (values, k, label) in enumerate(zip((first, second), places, ("first", "second")))
    ]
    field = curvature_on_plane(body, places, rows[0], rows[1], shape)
    units = [body.joint_units[k] for k in places]
    draw_map(ax, rows, field, *component_of(axis, field), squared_unit(*units))
    if points is not None:
        draw_loop(ax, points)
        style.finish(ax, ncols=3)
    name_axes(ax, [body.joint_names[k] for k in places], units)
    return ax


def plot_reach(ax: Axes, found: Reach, count: int = 10) -> Axes:
    """The pairs of joints whose small loops turn the body most, in degrees per square radian.

    The colour is that of the base axis nearest to the turn's.

    Parameters
    ----------
    ax : flat axes
    found : what `reachable` gives
    count : of pairs, 1 or more

    Raises
    ------
    ShapeError
        If the body has no pair of joints.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> found = sp.reachable(sp.load_body("cat_two_halves"))
    >>> len(sp.plots.plot_reach(Figure().subplots(), found).patches)  # one bar for each pair
    3
    """
    check_object(found, "Reach", "found")
    style.check_flat_axes(ax)
    shown = found.pairs[: whole_argument(count, "count", 1)]
    if not shown:
        raise ShapeError("found: there are no pairs of joints to draw; the body has one joint or none")
    for place, pair in enumerate(shown):
        about = int(np.argmax(np.abs(pair.axis)))
        look = {
            "color": (style.BLUE, style.GREEN, style.GREY)[about],
            "hatch": (None, "////", "....")[about],
            "edgecolor": "white",
        }
        ax.barh(place, pair.degrees, label=f"about {_AXES[about]}", **look)
    ax.set_yticks(range(len(shown)), [plain_text(" × ".join(pair.joints)) for pair in shown])
    ax.set_ylim(len(shown) - 0.5, -0.5)
    units = {pair.units for pair in shown}
    ax.set_xlabel(
        "turn [deg/rad²]" if units == {"rad^2"} else "turn [deg/rad², deg/(rad m), deg/m²]", fontsize=style.SMALL
    )
    ax.tick_params(labelsize=style.SMALL)
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    order = sorted(named)
    # It reaches to the left, over the names of the joints, where there is room.
    place = {"ncols": 3, "loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    style.finish(ax, handles=[named[one] for one in order], labels=order, **place)
    return ax


def _limit_bands(
    places: dict[str, Any], units: Sequence[str], limits: Array, values: Array, named: Any, looks: list[dict[str, Any]]
) -> bool:
    """Draw bands beyond limits that are near to what is drawn; return True if there is one."""
    drawn = False
    for unit, ax in places.items():
        own = [(k, look) for k, look in zip(named, looks, strict=True) if units[k] == unit]
        if not own:
            continue
        columns = values[:, [k for k, _ in own]]
        low, high = float(columns.min()), float(columns.max())
        reach = _NEAR_LIMIT * (high - low)
        # A limit that a left and a right joint share is one band.
        near = {
            (float(limit), sign, look.get("markerfacecolor", look["color"]))
            for k, look in own
            for limit, sign, end in zip(limits[k], (-1.0, 1.0), (values[:, k].min(), values[:, k].max()), strict=True)
            if abs(limit - end) <= reach
        }
        if near:
            bottom = min(low, min(limit for limit, _, _ in near))
            top = max(high, max(limit for limit, _, _ in near))
            thick = _BAND * (top - bottom)
            ax.set_ylim(bottom - 2.0 * thick, top + 2.0 * thick)
            for limit, sign, colour in sorted(near):
                ax.axhspan(
                    *sorted((limit, limit + sign * thick)), facecolor=colour, alpha=0.35, linewidth=0.0, zorder=1
                )
        drawn = drawn or bool(near)
    return drawn


def _band_patch() -> Any:
    from matplotlib.patches import Patch

    return Patch(facecolor=style.GREY, alpha=0.5, linewidth=0.0)


def _row(values: ArrayLike | None, body: Body | ParticleBody, joint: int, points: Array | None, name: str) -> Array:
    if values is not None:
        row = finite_array(values, name)
        if row.ndim != 1 or len(row) < 2 or np.any(np.diff(row) <= 0.0):
            raise ShapeError(f"{name}: two coordinates or more that increase are needed, got shape {row.shape}")
        return row
    low, high = body.joint_limits[joint]
    if points is not None:
        return row_around(points)
    return even_row(low, high) if np.isfinite(low) and np.isfinite(high) else even_row(-np.pi, np.pi)


def _named(path: ShapePath, body: Body | ParticleBody | None) -> tuple[ShapePath, tuple[str, ...], tuple[str, ...]]:
    """The path in the body's order, names and units of its columns."""
    if body is not None:
        return in_joint_order(body, path), body.joint_names, body.joint_units
    names = path.joint_names or tuple(f"joint {k}" for k in range(path.n_shape))
    return path, names, ("rad or m",) * path.n_shape
