"""Figures of shapes: joints in time, loops in the plane of two joints, and the curvature over such a plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, whole_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..errors import ShapeError, unknown_name
from ..letters import value_text
from ..shape_space.body_path import in_joint_order
from ..shape_space.curvature_field import curvature_on_plane
from ..shape_space.reach.holonomy_algebra import Reach
from ..shape_space.shape_path import ShapePath
from . import plot_style as style
from ._joint_styles import MAX_NAMED, both_sides, joint_place, joint_styles, plain_text, plot_joints

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AT_REST = 1e-9  # [rad or m] range of a joint that does not move
_LEVELS = 8  # about so many lines of equal curvature
_COUNT = 61  # points along each joint: smooth under shading, a second of computation
_MARGIN = 0.25  # of the range of a path: room around it in the plane
_ZERO_LEVEL = 1e-9  # of the largest value: rounding
_SHOWN = {"rad": "deg", "m": "m", "1": "1", "rad or m": "rad or m"}  # units in the legend
_NEAR_LIMIT = 0.3  # of the joints' range: farther limits are not in the figure
_BAND = 0.035  # of the figure's height: a band beyond a limit
_AXES = "xyz"


def plot_shape_path(
    ax: Axes,
    path: ShapePath,
    body: Body | None = None,
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

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> len(sp.plots.plot_shape_path(ax, sp.examples.kane_scher(0.0, 0.5)).lines)  # one for each joint
    3
    """
    if body is not None:
        check_object(body, "Body", "body")
    check_object(path, "ShapePath", "path")
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
    named = chosen[:MAX_NAMED]
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
    path: ShapePath,
    joints: Sequence[str | int],
    body: Body | None = None,
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
    if body is not None:
        check_object(body, "Body", "body")
    check_object(path, "ShapePath", "path")
    style.check_flat_axes(ax)
    t = style.even_times(path, times)
    route, names, units = _named(path, body)
    i, j = _pair(joints, names)
    points = route.shape(t)[:, [i, j]]
    _loop(ax, points)
    ax.set_xlabel(f"{plain_text(names[i])} [{units[i]}]", fontsize=style.SMALL)
    ax.set_ylabel(f"{plain_text(names[j])} [{units[j]}]", fontsize=style.SMALL)
    style.finish(ax, ncols=3)
    return ax


def plot_curvature(
    ax: Axes,
    body: Body,
    joints: Sequence[str | int],
    first: ArrayLike | None = None,
    second: ArrayLike | None = None,
    *,
    axis: str | ArrayLike | None = None,
    shape: ArrayLike | None = None,
    path: ShapePath | None = None,
) -> Axes:
    """One component of the curvature over the plane of two joints, with a path of shapes on it.

    Violet is positive and orange negative; lines of equal curvature are labelled, solid where positive, dashed where
    negative, thick where zero. A small counterclockwise loop turns the body by minus the curvature times its area.

    Parameters
    ----------
    ax : flat axes; a scale of colours is added to their figure
    joints : the names or indices of the two; the first is the abscissa
    first, second : (A,), (B,) where to evaluate, ascending [rad or m]; None: around the path, or the joints' limits
    axis : "x", "y", "z", or the direction (3,) whose component is drawn, base axes; None: that of the largest component
    shape : (n,) positions of the other joints; None: neutral
    path : to be drawn; its other joints may move

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> cat = sp.load_body("cat_two_halves")
    >>> sp.plots.plot_curvature(ax, cat, ("waist_pitch", "waist_yaw"), axis="x").get_xlabel()
    'waist_pitch [rad]'
    """
    if path is not None:
        check_object(path, "ShapePath", "path")
    check_object(body, "Body", "body")
    style.check_flat_axes(ax)
    names, units = body.joint_names, body.joint_units
    i, j = _pair(joints, names)
    points = None
    if path is not None:
        points = in_joint_order(body, path).shape(style.even_times(path, None))[:, [i, j]]
    rows = [
        _row(values, body, k, None if points is None else points[:, n], label)
        for n, (values, k, label) in enumerate(((first, i, "first"), (second, j, "second")))
    ]
    field = curvature_on_plane(body, (i, j), rows[0], rows[1], shape)
    direction, name = _direction(axis, field)
    values = (field @ direction).T
    power, scale = style.power_of_ten(float(np.abs(values).max()))
    values = values * 10.0**-power
    largest = float(np.abs(values).max()) or 1.0
    mesh = _coloured(ax, rows, values, largest)
    _contours(ax, rows, values, largest)
    if points is not None:
        _loop(ax, points)
        style.finish(ax, ncols=3)
    ax.set(xlim=(rows[0][0], rows[0][-1]), ylim=(rows[1][0], rows[1][-1]))
    ax.set_xlabel(f"{plain_text(names[i])} [{units[i]}]", fontsize=style.SMALL)
    ax.set_ylabel(f"{plain_text(names[j])} [{units[j]}]", fontsize=style.SMALL)
    ax.tick_params(labelsize=style.SMALL)
    bar = ax.figure.colorbar(mesh, ax=ax)
    per = f"{units[i]}²" if units[i] == units[j] else f"({units[i]} {units[j]})"
    bar.set_label(f"curvature, {name}\n[{scale}rad/{per}]", fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)
    return ax


def plot_reach(ax: Axes, found: Reach, count: int = 10) -> Axes:
    """The pairs of joints whose small loops turn the body most, in degrees per square radian.

    The colour is that of the base axis nearest to the turn's.

    Parameters
    ----------
    ax : flat axes
    found : what `reachable` gives
    count : of pairs, 1 or more

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


def _loop(ax: Any, points: Array) -> None:
    """Draw a path in a plane with its start, and arrowheads along it."""
    ax.plot(*points.T, color=style.BLACK, linewidth=1.6, label="path")
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points / _extent(points), axis=0), axis=1))])
    for k in np.searchsorted(length, length[-1] * np.array([0.15, 0.4, 0.65, 0.9])):
        after = min(k + 1, len(points) - 1)
        if length[after] > length[after - 1]:
            arrow = {"arrowstyle": "-|>", "color": style.BLACK, "mutation_scale": 10.0, "linewidth": 0.0}
            ax.annotate("", points[after], points[after - 1], arrowprops=arrow)
    start = {"marker": "*", "color": style.GREEN, "markersize": 10.0, "markeredgecolor": "white", "linestyle": "none"}
    ax.plot(*points[:1].T, label="start", **start)
    if np.abs(points[-1] - points[0]).max() > _AT_REST:
        ax.plot(*points[-1:].T, marker="s", color=style.BLUE, markersize=5.0, linestyle="none", label="end")


def _coloured(ax: Any, rows: list[Array], values: Array, largest: float) -> Any:
    from matplotlib.colors import LinearSegmentedColormap

    # Neither end is so dark that lines and text on it could not be read.
    colours = LinearSegmentedColormap.from_list("orange to violet", ["#C8701A", "#F7F7F7", "#7F6FB0"])
    look = {"cmap": colours, "vmin": -largest, "vmax": largest, "shading": "gouraud", "rasterized": True}
    return ax.pcolormesh(*rows, values, **look)


def _contours(ax: Any, rows: list[Array], values: Array, largest: float) -> None:
    """Draw lines of equal values at round numbers, if there are any in the range."""
    from matplotlib.ticker import MaxNLocator

    levels = MaxNLocator(nbins=_LEVELS, symmetric=True).tick_values(-largest, largest)
    levels = levels[(levels > values.min()) & (levels < values.max())]
    if len(levels):
        styles = ["-" if level >= 0.0 else "--" for level in levels]
        widths = [1.5 if abs(level) < _ZERO_LEVEL * largest else 0.7 for level in levels]
        lines = ax.contour(*rows, values, levels=levels, colors="#333333", linestyles=styles, linewidths=widths)
        ax.clabel(lines, fmt=lambda level: f"{level:.2g}".replace("-", "−"), fontsize=style.SMALL - 2, inline_spacing=2)


def _direction(axis: str | ArrayLike | None, field: Array) -> tuple[Array, str]:
    if axis is None:
        axis = _AXES[int(np.argmax(np.abs(field).max(axis=(0, 1))))]
    if isinstance(axis, str):
        if axis not in _AXES or len(axis) != 1:
            raise unknown_name("axis", axis, _AXES)
        return np.eye(3)[_AXES.index(axis)], f"{axis} component"
    direction = finite_array(axis, "axis", (3,))
    norm = float(np.linalg.norm(direction))
    if direction.ndim != 1 or not norm:
        raise ShapeError(f"axis: one direction (3,), not zero, is needed, got {value_text(direction)}")
    unit = direction / norm
    return unit, "along ({:.2g}, {:.2g}, {:.2g})".format(*unit).replace("-", "−")


def _row(values: ArrayLike | None, body: Body, joint: int, points: Array | None, name: str) -> Array:
    if values is not None:
        row = finite_array(values, name)
        if row.ndim != 1 or len(row) < 2 or np.any(np.diff(row) <= 0.0):
            raise ShapeError(f"{name}: two coordinates or more that increase are needed, got shape {row.shape}")
        return row
    low, high = body.joint_limits[joint]
    if points is not None:
        room = _MARGIN * (float(np.ptp(points)) or 1.0)
        low, high = float(points.min()) - room, float(points.max()) + room
    elif not (np.isfinite(low) and np.isfinite(high)):
        low, high = -np.pi, np.pi
    return np.linspace(low, high, _COUNT)


def _named(path: ShapePath, body: Body | None) -> tuple[ShapePath, tuple[str, ...], tuple[str, ...]]:
    """The path in the body's order, names and units of its columns."""
    if body is not None:
        return in_joint_order(body, path), body.joint_names, body.joint_units
    names = path.joint_names or tuple(f"joint {k}" for k in range(path.n_shape))
    return path, names, ("rad or m",) * path.n_shape


def _pair(joints: Sequence[str | int], names: Sequence[str]) -> tuple[int, int]:
    if isinstance(joints, str) or not isinstance(joints, Sequence | np.ndarray) or len(joints) != 2:
        raise ShapeError(f"joints: two joints are needed, got {value_text(joints)}")
    i, j = (joint_place(joint, names) for joint in joints)
    if i == j:
        raise ShapeError(f"joints: two different joints are needed, got {names[i]} twice")
    return i, j


def _extent(points: Array) -> Array:
    span = np.ptp(points, axis=0)
    return np.where(span > 0.0, span, 1.0)
