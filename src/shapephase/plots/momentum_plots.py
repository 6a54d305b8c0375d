"""Figures on the sphere of momenta: the curve of a motion with the area inside it, and closed orbits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .. import so3, sphere
from ..arguments import check_flag, check_object, number_argument, times_argument
from ..arrays import Array, finite_array
from ..errors import ShapeError
from ..phases.momentum_curve import Gauge, MomentumCurve, momentum_curve
from ..phases.return_map import FixedPoints
from ..reconstruction.reconstruction import Motion
from ..rigid_body.portrait import equilibria, heteroclinics
from ._joint_styles import plain_text
from ._sphere_area import AreaCells, enclosed_cells
from ._sphere_axes import SphereAxes
from .plot_style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SMALL, VERMILION, check_axes, one_motion, subdivided
from .polhode_plots import draw_polhodes, spread_energies

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CURVE: dict[str, Any] = {"color": BLACK, "linestyle": "-", "linewidth": 1.5}
_CLOSURE = {"color": VERMILION, "linestyle": (0, (3, 1.2)), "linewidth": 1.7}
_ROUND_LARGEST = {"color": "#8A8A8A", "linestyle": "-", "linewidth": 0.6, "behind": True}
_ROUND_SMALLEST = {**_ROUND_LARGEST, "linestyle": (0, (4, 2))}
_SEPARATRIX = {"color": PURPLE, "linestyle": (0, (6, 1, 1, 1)), "linewidth": 1.3}
_KINDS: dict[str, dict[str, Any]] = {
    "elliptic": {"marker": "o", "color": BLUE, "markersize": 6.5},
    "hyperbolic": {"marker": "X", "color": VERMILION, "markersize": 7.0},
    "inverse hyperbolic": {"marker": "D", "color": ORANGE, "markersize": 5.5},
    "parabolic": {"marker": "s", "color": GREEN, "markersize": 5.5},
}
_MAX_ANGLE = 0.02  # [rad] between points: chords stay within a line's width of the arc
_FIRST_PARTS = 8  # of a step, to find how far the curve bends in it
_MANY_POINTS = 30_000  # of a curve: its steps then have two parts
_MAX_PARTS = 40  # of a step: a very fast curve must not fill the memory
_LONG = 40.0  # [1] length of a curve, some six revolutions, that is drawn in a finer line
_CLOSED = 1e-6  # [rad] between start and end: a smaller gap is none
_UNSEEN = 0.03  # of the curve's size: a smaller gap is not seen
_NO_AREA = 1e-12  # [sr] rounding
_SMALL_CURVE = 0.13  # [radii of the sphere] half the size of a curve that is enlarged in an inset
_NOTHING = 1e-6  # [radii of the sphere] half the size of a point
# [radii of the sphere] middles and side of the places for an inset, in the corners beside the sphere.
_INSET_CORNERS = np.array([[0.98, 0.9], [-0.98, 0.9], [0.98, -0.8], [-0.98, -0.8]])
_INSET_SIDE = 0.78
_FREE = 0.1  # [radii] between points of a curve that keep text away
_MOST_FREE = 200  # such points
_EQUAL = 1e-9  # relative difference of moments that is rounding
_DEFAULT_VIEW = (24.0, 32.0)  # [degrees] elevation, azimuth: no axis points to the eye or stands upright
_VIEW_OFFSET = (12.0, 18.0)  # [degrees] elevation, azimuth of the eye beside the middle of a curve
_MAX_ELEVATION = 65.0  # [degrees] nearer to the pole the azimuth means little
_SPREAD = 0.2  # length of the mean direction below which a curve prefers no side


def plot_momentum_curve(
    ax: Axes,
    motion: Motion,
    gauge: Gauge = "horizontal",
    *,
    frozen_at: float | None = 0.0,
    area: bool = True,
    view: tuple[float, float] | None = None,
) -> Axes:
    """The direction of the body momentum on its sphere, in a gauge, with the signed area that it encloses.

    If the curve is open, the great circle that closes it is drawn. The area is that of `split`, shaded by its winding
    number, and hatched where the curve is clockwise, which counts as negative. Behind are the polhodes, separatrices
    and axes of the rigid body with the inertia of one time, in the same frame. The far side is dimmed.

    Source: Cabrera 2006, equation (12) and section 4.1; Marsden and Ratiu, figure 15.3.1.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection, or three-dimensional ones, in the view they have
    motion : of one momentum, no batch
    gauge : as for `split`
    frozen_at : the time of that rigid body [s]; None: no portrait
    area : whether the area is shaded
    view : elevation and azimuth of the eye [degrees], for flat axes; None: such that most of the curve is in front

    Raises
    ------
    MissingExtraError, UnknownNameError, GaugeError
        Without Matplotlib; for a gauge that `split` refuses.
    ShapeError
        If the motion is a batch, or has no momentum.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> len(sp.plots.plot_momentum_curve(ax, motion, "base").lines) > 3
    True
    """
    check_flag(area, "area")
    check_object(motion, "Motion", "motion")
    check_axes(ax)
    one_motion(motion)
    if not np.any(motion.momentum):
        raise ShapeError("a motion without angular momentum has no momentum curve; the body turns by its shape alone")
    curve = _fine_curve(motion, gauge)
    points = curve.corners[0]
    drawn = SphereAxes(ax, _view_of(points) if view is None else view)
    title = f"{plain_text(gauge) if isinstance(gauge, str) else 'given'} gauge"
    closing = _great_circle(points[-1], points[0])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    # Many revolutions need a finer line, or they would run together.
    width = _CURVE["linewidth"] * float(np.clip(_LONG / max(length[-1], _LONG), 0.2, 1.0))
    cells = None
    if area:
        solid_angle = float(curve.slivers.sum() + sphere.polygon_area(curve.corners)[0])
        cells = enclosed_cells(np.concatenate([points, closing[1:-1]]), curve.references[0])
        title += f"; solid angle {_signed(solid_angle)} sr"
    look = {**_CURVE, "linewidth": width}
    _draw_curve(drawn, points, closing, cells, look)
    drawn.keep_free(_spread(points, length))
    for axis, name in zip(np.eye(3), "xyz"):
        drawn.text(axis, f"${name}$", 0.13, alpha=1.0 if axis @ drawn.eye >= 0.0 else 0.45)
    if frozen_at is not None:
        time = times_argument(number_argument(frozen_at, "frozen_at", "s"), motion.duration).reshape(1)
        inertia = motion.deformation.description.sample(time)[0][0]
        frame = curve.frame(time)
        if frame is not None:
            inertia = frame[0] @ inertia @ frame[0].T
        _portrait(drawn, inertia)
        title += f"\nbehind it: polhodes of the body frozen at t = {float(time[0]):.4g} s"
    drawn.finish(r"$\Pi_{}/|\Pi|$ [1]", title)
    middle = points.mean(axis=0)
    reach = float(np.abs((points - middle) @ drawn.screen.T).max())
    if not drawn.solid and _NOTHING < reach < _SMALL_CURVE and middle @ drawn.eye > 0.0:
        _enlarged(drawn, points, closing, cells, look)
    return ax


def plot_fixed_points(
    ax: Axes, points: FixedPoints, *, inertia: Array | None = None, view: tuple[float, float] | None = None
) -> Axes:
    """The directions of the momentum that return after a loop of shapes, each with its index and stability.

    Circles, crosses, diamonds and squares are elliptic, hyperbolic, inverse hyperbolic and parabolic points, labelled
    by their indices. Those on the far side are dimmed.

    Parameters
    ----------
    ax : flat or three-dimensional axes
    inertia : (3, 3) of a rigid body whose portrait is drawn behind, the deformation's frame [kg m^2]; None: none
    view : as for `plot_momentum_curve`

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> points = sp.fixed_points(sp.articulated(cat, loop), 0.005)
    >>> len(sp.plots.plot_fixed_points(ax, points).lines) >= 2
    True
    """
    check_object(points, "FixedPoints", "points")
    check_axes(ax)
    drawn = SphereAxes(ax, _DEFAULT_VIEW if view is None else view)
    for direction, index, kind in zip(points.directions, points.index.tolist(), points.stability, strict=True):
        drawn.point(direction, kind, **_KINDS[kind])
        near = bool(direction @ drawn.eye >= 0.0)
        drawn.text(direction, "0" if not index else f"{'+' if index > 0 else '−'}1", 0.13, alpha=1.0 if near else 0.45)
    if inertia is not None:
        _portrait(drawn, finite_array(inertia, "inertia", (3, 3), unit="kg m^2"))
    total = rf"$|\Pi|$ = {points.magnitude:.4g} kg m²/s; indices sum to {points.index_sum}"
    drawn.finish("$u_{}$ [1]", total + ("" if points.complete else "\nsome may be missing"))
    return ax


def _draw_curve(
    drawn: SphereAxes, points: Array, closing: Array, cells: AreaCells | None, look: dict[str, Any], scale: float = 1.0
) -> None:
    """Draw the curve with its ends, direction, closing arc and area."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    drawn.curve(points, r"$\Pi/|\Pi|$", **look)
    places = np.searchsorted(length, length[-1] * np.array([0.125, 0.375, 0.625, 0.875]))
    drawn.arrows(points, places, BLACK, shaft=0.01 * scale)
    drawn.point(points[0], "start", marker="*", color=GREEN, markersize=10.0)
    size = min(1.0, float(np.linalg.norm(points - points[0], axis=1).max()))
    if so3.angle_between(points[0], points[-1]) > max(_CLOSED, _UNSEEN * size):
        drawn.point(points[-1], "end", marker="s", color=VERMILION, markersize=5.5)
        drawn.curve(closing, "closing great circle", **_CLOSURE)
    if cells is not None:
        drawn.area(cells)


def _enlarged(drawn: SphereAxes, points: Array, closing: Array, cells: AreaCells | None, look: dict[str, Any]) -> None:
    """A curve too small on its sphere, in an inset in the corner that is farthest from it, with a scale in degrees."""
    flat = np.concatenate([points, closing]) @ drawn.screen.T
    middle, half = 0.5 * (flat.min(axis=0) + flat.max(axis=0)), 0.62 * float(np.ptp(flat, axis=0).max())
    corner = _INSET_CORNERS[int(np.argmax(np.linalg.norm(_INSET_CORNERS - middle, axis=1)))]
    side = _INSET_SIDE
    inset = drawn.ax.inset_axes((*(corner - 0.5 * side), side, side), transform=drawn.ax.transData, zorder=7)
    near = SphereAxes(inset, drawn.view)
    _draw_curve(near, points, closing, cells, look, half)
    inset.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
    inset.set(xticks=[], yticks=[])
    power = 10.0 ** np.floor(np.log10(np.degrees(half)))
    degrees = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= np.degrees(half))
    left, bottom = middle - 0.88 * half
    inset.plot([left, left + np.sin(np.radians(degrees))], [bottom, bottom], color=BLACK, linewidth=2.0, zorder=6)
    inset.text(left, bottom + 0.08 * half, f"{degrees:g}°", fontsize=SMALL - 1, zorder=6)
    drawn.ax.indicate_inset_zoom(inset, edgecolor=GREY)


def _spread(points: Array, length: Array) -> Array:
    """Points of a curve, and its ends, near enough to each other that no text fits between: (M, 3)."""
    steps = np.linspace(0.0, length[-1], min(_MOST_FREE, 2 + int(length[-1] / _FREE)))
    return points[np.searchsorted(length, steps).clip(0, len(points) - 1)]


def _fine_curve(motion: Motion, gauge: Gauge) -> MomentumCurve:
    """The curve, cut so finely that its chords stay within a line's width of it."""
    steps = motion.solution.times
    first = _FIRST_PARTS if _FIRST_PARTS * len(steps) < _MANY_POINTS else 2
    curve = momentum_curve(motion, gauge, times=subdivided(steps, first))
    bend = so3.angle_between(curve.corners[0, :-1], curve.corners[0, 1:])
    parts = np.clip(np.ceil(bend / _MAX_ANGLE), 1, _MAX_PARTS).astype(int)
    if np.all(parts == 1):
        return curve
    step = np.repeat(np.arange(len(parts)), parts)
    within = np.arange(len(step)) - np.repeat(np.cumsum(parts) - parts, parts)
    times = curve.edges[step] + np.diff(curve.edges)[step] * within / parts[step]
    return momentum_curve(motion, gauge, times=times)


def _portrait(drawn: SphereAxes, inertia: Array) -> None:
    """Polhodes, separatrices and equilibria of a rigid body, in grey: dots are its centres, crosses its saddles."""
    moments, axes = np.linalg.eigh(inertia)
    # Moments that differ only by rounding are equal: the body is symmetric.
    for lower in (0, 1):
        if moments[lower + 1] - moments[lower] <= _EQUAL * moments[2]:
            moments[lower + 1] = moments[lower]
    draw_polhodes(drawn, moments, spread_energies(moments), axes, _ROUND_LARGEST, _ROUND_SMALLEST)
    if moments[0] < moments[1] < moments[2]:
        for line in heteroclinics(moments):
            drawn.curve(line @ axes.T, "separatrix", behind=True, **_SEPARATRIX)
    for number, point in enumerate(equilibria(moments)):
        if point.kind != "degenerate":
            marker = "o" if point.kind == "centre" else "X"
            drawn.point(axes @ point.direction, None, behind=True, marker=marker, color=GREY, markersize=5.0)
            if axes @ point.direction @ drawn.eye >= 0.0:
                drawn.text(axes @ point.direction, f"$I_{number // 2 + 1}$", 0.13, color="#555555", fontsize=SMALL - 1)


def _great_circle(start: Array, end: Array) -> Array:
    """The arc from one direction to another, with the midpoint of the arc that closes the area: (N, 3)."""
    middle = so3.middle(start, end)
    half = 0.5 * float(so3.angle_between(start, end))
    across = end - start
    length = float(np.linalg.norm(across))
    if length == 0.0:
        return np.stack([start, end])
    angle = np.linspace(-half, half, 2 * max(1, int(np.ceil(half / _MAX_ANGLE))) + 1)[:, None]
    arc = np.cos(angle) * middle + np.sin(angle) * across / length
    return np.concatenate([start[None], arc[1:-1], end[None]])


def _view_of(points: Array) -> tuple[float, float]:
    """View from beside the middle of a curve, which keeps the sphere round."""
    middle = points.mean(axis=0)
    if float(np.linalg.norm(middle)) < _SPREAD:
        return _DEFAULT_VIEW
    elevation = float(np.degrees(np.arctan2(middle[2], np.hypot(middle[0], middle[1]))))
    azimuth = float(np.degrees(np.arctan2(middle[1], middle[0])))
    beside = -1.0 if elevation > 0.0 else 1.0
    tilted = float(np.clip(elevation + beside * _VIEW_OFFSET[0], -_MAX_ELEVATION, _MAX_ELEVATION))
    return tilted, azimuth - _VIEW_OFFSET[1]


def _signed(value: float) -> str:
    return "0" if abs(value) < _NO_AREA else f"{value:+.4g}".replace("-", "−")
