"""Maps of one component of a curvature over a plane of shapes, and loops drawn on them.

Blue is positive and orange negative, here and in `explore`; joints and turns are in degrees, slides in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, finite_array
from ..errors import ShapeError, unknown_name
from ..letters import value_text
from . import plot_style as style
from ._joint_styles import joint_place, plain_text

_CLOSED = 1e-9  # [rad or m] between start and end: a smaller gap is rounding
_LEVELS = 8  # about so many lines of equal curvature
_ZERO_LEVEL = 1e-9  # of the largest value: rounding
_COUNT = 61  # points along each axis: smooth under shading, a second of computation
_MARGIN = 0.25  # of the range of a path: room around it in the plane
_PLAIN = (-2, 3)  # powers of ten of curvatures that are written as they are
COMPONENTS = ("x", "y", "z", "norm")
_NORM = "norm"


def two_joints(joints: Sequence[str | int], names: Sequence[str]) -> tuple[int, int]:
    """Return the places of two different joints. Raises ShapeError, UnknownNameError."""
    if isinstance(joints, str) or not isinstance(joints, Sequence | np.ndarray) or len(joints) != 2:
        raise ShapeError(f"joints: two joints are needed, got {value_text(joints)}")
    i, j = (joint_place(joint, names) for joint in joints)
    if i == j:
        raise ShapeError(f"joints: two different joints are needed, got {names[i]} twice")
    return i, j


def row_around(points: Array) -> Array:
    """Coordinates over the range of a path along one axis and some room on either side: (N,) -> (61,)."""
    room = _MARGIN * (float(np.ptp(points)) or 1.0)
    return even_row(float(points.min()) - room, float(points.max()) + room)


def even_row(low: float, high: float) -> Array:
    """Coordinates of a map along one axis: (61,)."""
    return np.linspace(low, high, _COUNT)


def component_of(axis: str | ArrayLike | None, vectors: Array) -> tuple[Array | None, str]:
    """Return the direction whose component is shown, None for the norm, and its name.

    axis : as for `plot_curvature`; None: that of the largest component of `vectors` (..., 3)
    """
    if axis is None:
        axis = COMPONENTS[int(np.argmax(np.abs(vectors).reshape(-1, 3).max(axis=0)))]
    if isinstance(axis, str):
        if axis not in COMPONENTS:
            raise unknown_name("axis", axis, COMPONENTS)
        return (None, _NORM) if axis == _NORM else (np.eye(3)[COMPONENTS.index(axis)], axis)
    direction = finite_array(axis, "axis", (3,))
    norm = float(np.linalg.norm(direction))
    if direction.ndim != 1 or not norm:
        raise ShapeError(f"axis: one direction (3,), not zero, is needed, got {value_text(direction)}")
    unit = direction / norm
    return unit, "({:.2g}, {:.2g}, {:.2g})".format(*unit).replace("-", "−")


def shown_part(vectors: Array, direction: Array | None) -> Array:
    """Return the component along a direction, or the norm: (..., 3) -> (...)."""
    return np.linalg.norm(vectors, axis=-1) if direction is None else vectors @ direction


def draw_map(
    ax: Any,
    rows: Sequence[Array],
    field: Array,
    direction: Array | None,
    name: str,
    per: str,
    side: str = "right",
) -> None:
    """Draw a curvature (A, B, 3) [rad per `per`] over two rows of coordinates, with a scale of colours beside it.

    direction, name : by `component_of`
    side : of the scale, "right" or "bottom"
    """
    values = np.degrees(shown_part(field, direction)).T
    power, scale = style.power_of_ten(float(np.abs(values).max()), _PLAIN)
    values = values * 10.0**-power
    largest = float(np.abs(values).max()) or 1.0
    look = {"cmap": curvature_colours(), "vmin": -largest, "vmax": largest, "shading": "gouraud", "rasterized": True}
    mesh = ax.pcolormesh(*rows, values, **look)
    _contours(ax, rows, values, largest)
    ax.set(xlim=(rows[0][0], rows[0][-1]), ylim=(rows[1][0], rows[1][-1]))
    what = "norm" if direction is None else f"along {name}" if name.startswith("(") else f"{name} component"
    label = f"curvature, {what}{chr(10) if side == 'right' else ' '}[{scale}deg/{per}]"
    colour_scale(ax, mesh, label, side, signed=direction is not None)


def colour_scale(ax: Any, mapped: Any, label: str, side: str = "right", *, signed: bool = True) -> None:
    """Draw a scale of colours beside or below some axes, its positive half for what has no sign."""
    bar = ax.figure.colorbar(mapped, ax=ax, location=side)
    if not signed:
        (bar.ax.set_ylim if side == "right" else bar.ax.set_xlim)(0.0, None)
    bar.set_label(label, fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)


def curvature_colours() -> Any:
    """Colours of a curvature, from negative over none to positive."""
    from matplotlib.colors import LinearSegmentedColormap

    ends = [style.NEGATIVE_CURVATURE, "#F7F7F7", style.POSITIVE_CURVATURE]
    return LinearSegmentedColormap.from_list("orange to blue", ends)


def squared_unit(first: str, second: str) -> str:
    """Return the product of two units of joints."""
    return f"{first}²" if first == second else f"({first} {second})"


def name_axes(ax: Any, names: Sequence[str], units: Sequence[str]) -> None:
    """Name the axes of a plane or a space of joints whose data are in rad or m; ticks of angles are in degrees."""
    for axis, name, unit in zip((getattr(ax, f"{letter}axis") for letter in "xyz"[: len(names)]), names, units):
        axis.set_label_text(f"{plain_text(name)} [{'deg' if unit == 'rad' else unit}]", fontsize=style.SMALL)
        if unit == "rad":
            style.ticks_in_degrees(axis)
    ax.tick_params(labelsize=style.SMALL)


def draw_loop(ax: Any, points: Array) -> None:
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
    if np.abs(points[-1] - points[0]).max() > _CLOSED:
        ax.plot(*points[-1:].T, marker="s", color=style.BLUE, markersize=5.0, linestyle="none", label="end")


def _contours(ax: Any, rows: Sequence[Array], values: Array, largest: float) -> None:
    """Draw lines of equal values at round numbers, if there are any in the range."""
    from matplotlib.ticker import MaxNLocator

    levels = MaxNLocator(nbins=_LEVELS, symmetric=True).tick_values(-largest, largest)
    levels = levels[(levels > values.min()) & (levels < values.max())]
    if len(levels):
        styles = ["-" if level >= 0.0 else "--" for level in levels]
        widths = [1.5 if abs(level) < _ZERO_LEVEL * largest else 0.7 for level in levels]
        lines = ax.contour(*rows, values, levels=levels, colors="#333333", linestyles=styles, linewidths=widths)
        ax.clabel(lines, fmt=lambda level: f"{level:.2g}".replace("-", "−"), fontsize=style.SMALL - 2, inline_spacing=2)


def _extent(points: Array) -> Array:
    span = np.ptp(points, axis=0)
    return np.where(span > 0.0, span, 1.0)
