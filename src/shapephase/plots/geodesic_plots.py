"""Figures of geodesics: conjugate points and returns on surfaces of revolution, conjugate points on SO(3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, number_argument
from ..arrays import Array, Integers, finite_array
from ..errors import ShapeError
from ..letters import value_text
from ..rigid_body.geodesics import (
    SurfaceOfRevolution,
    conjugate_locus,
    conjugate_points,
    cut_locus,
    extremal,
    left_invariant_metric,
    serret_andoyer_metric,
    surface_of_metric,
)
from .plot_style import BLACK, BLUE, GREY, SERIES, SKY, SMALL, add_polygons, check_axes, check_flat_axes, finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS = 400  # of a curve: no corner is seen at the width of a page
_NEAREST = 2e-3  # last p of a locus, from the separatrix' (theta infinite) to the equator's
_WIDEST = 2.0 * np.pi  # [rad] from the centre of a locus: one that tends to a parallel never ends
_HIGHEST = 2.0  # potential that is drawn
_ROUNDING = 1e-12
_FIRST = 0.05  # square root of the least share of p above the separatrix
_APART = 0.25  # [height] by which the curves of two scales are kept apart
_TRIANGLE = 3  # corners
_FAINT: dict[str, Any] = {"color": GREY, "linewidth": 0.6, "alpha": 0.7, "zorder": 1.0}


def plot_conjugate_locus(
    ax: Axes, moments: ArrayLike, order: int = 1, *, momenta: ArrayLike = (), geodesics: int = 10
) -> Axes:
    """The conjugate locus of a point on the equator of the Serret-Andoyer surface: phi against theta, p_theta > 0.

    Two branches, one the mirror image of the other, from their common cusp on the equator, where p_theta is the root of
    the largest moment, towards the asymptotes phi = -K/alpha and K/alpha; faint the geodesics from the point up to
    where they touch it.

    Source: Bonnard, Cots and Shcherbakova 2013, section 4.4; theory.md R12.

    Parameters
    ----------
    ax : flat axes
    moments : (3,) principal moments, three different ones in any order [kg m^2]
    order : which conjugate points of each geodesic
    momenta : (N,) p_theta whose conjugate points are marked, above the root of the middle moment, at most that of the
        largest [sqrt(kg) m]
    geodesics : how many are drawn to either side

    Raises
    ------
    ShapeError
        If a momentum is not above the root of the middle moment.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> len(sp.plots.plot_conjugate_locus(ax, [3.0, 2.0, 1.0], geodesics=4).lines) > 4
    True
    """
    check_flat_axes(ax)
    metric = serret_andoyer_metric(moments)
    marked = finite_array(momenta, "momenta", (None,))
    if np.any(marked < 0.0):
        raise ShapeError(
            "momenta: the figure shows p_theta > 0; the locus of -p_theta is its mirror image, theta -> -theta"
        )
    shown = metric.geodesics(marked).conjugate_points(order) if marked.size else None
    low, high = metric.separatrix_momentum, metric.largest_momentum
    p = np.minimum(low + (high - low) * np.geomspace(1.0, _NEAREST, _POINTS), high)
    locus = metric.geodesics(p).conjugate_points(order)
    faint = _evenly_chosen(_POINTS, geodesics)
    family = metric.geodesics(p[faint])
    times = np.linspace(0.0, 1.0, _POINTS)[:, None] * locus.time[faint]
    phi, theta = family.phi(times), family.theta(times)
    label = "geodesics"
    for side in (1.0, -1.0):
        for column in range(theta.shape[1]):
            ax.plot(theta[:, column], side * phi[:, column], label=label, **_FAINT)
            label = "_"
    for side, style, name in ((1.0, SERIES[0], "upward start"), (-1.0, SERIES[1], "downward start")):
        ax.plot(locus.theta, side * locus.phi, label=f"locus, {name}", **style)
    label = r"$\varphi = \mp K/\alpha$"
    for side in (-1.0, 1.0):
        ax.axhline(side * metric.crest, color=BLACK, linewidth=0.8, linestyle=(0, (2, 2)), label=label)
        label = "_"
    if shown is not None:
        ax.plot(
            shown.theta,
            shown.phi,
            linestyle="none",
            marker="o",
            markersize=3.5,
            color=BLACK,
            label=r"of the $p_\theta$ given",
        )
    ax.plot([0.0], [0.0], linestyle="none", marker="*", markersize=8.0, color=BLACK, label="start", clip_on=False)
    ax.set_xlim(0.0, float(max(locus.theta.max(), 0.0 if shown is None else 1.02 * shown.theta.max())))
    ax.set_xlabel(r"$\theta$ [rad]", fontsize=SMALL)
    ax.set_ylabel(r"$\varphi$ [$\sqrt{\mathrm{kg}}$ m]", fontsize=SMALL)
    finish(ax, title=f"Serret-Andoyer metric: conjugate locus of order {order}")
    return ax


def plot_surface_locus(
    ax: Axes, surface: SurfaceOfRevolution, orders: Sequence[int] = (1,), *, latitude: float = 0.0, geodesics: int = 40
) -> Axes:
    """The conjugate loci of a point on a surface of revolution, and its cut locus: latitude against longitude.

    Each order about its centre, which is opposite to the start for odd orders, at theta = n pi, and the start itself
    for even ones; faint the geodesics on their way past the first. The ordinate is the parametric latitude, whose
    cosine is the distance from the axis over the equator's. The cut locus is drawn with order 1, where it is known.

    Source: Bonnard, Cots and Shcherbakova 2013, section 2; theory.md O16, P3, P5, P6.

    Parameters
    ----------
    ax : flat axes
    surface : by `ellipsoid`, `surface_of_metric` or `surface_of_stretch`, no sphere, where the loci are points
    orders : n = 1, 2, ... of the conjugate points
    latitude : of the start, as a length along the meridian, inside the surface
    geodesics : how many are drawn

    Raises
    ------
    ShapeError
        For a sphere, or if there are no orders.

    Examples
    --------
    >>> ax, oblate = sp.plots.column_axes(), sp.rigid_body.geodesics.ellipsoid(0.8)
    >>> ax = sp.plots.plot_surface_locus(ax, oblate, geodesics=4)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['geodesics', 'order 1: 4 cusps', 'cut locus: arc of a parallel']
    """
    latitude = number_argument(latitude, "latitude")
    check_flat_axes(ax)
    check_object(surface, "SurfaceOfRevolution", "surface")
    if surface.has_smooth_poles and surface.curvature_trend() == "constant":
        raise ShapeError("surface: on a sphere the conjugate loci are single points; give another surface")
    if not isinstance(orders, Sequence | np.ndarray) or not len(orders):
        raise ShapeError(f"orders: at least one is needed, such as (1, 2), got {value_text(orders)}")
    curves, directions = [], np.zeros(0)
    for order in orders:
        locus = conjugate_locus(surface, _POINTS, order, latitude)
        directions = locus.points.direction
        x = _about_centre(locus.points.longitude, locus.points.momentum, order)
        y = _parametric(locus.points.height)
        # East and west meet in the directions of the poles, or never.
        parts = [np.append(np.arange(len(x)), 0)] if surface.has_smooth_poles else np.split(np.arange(len(x)), 2)
        curves.append(([(x[part], y[part]) for part in parts], f"order {order}: {locus.cusps} cusps"))
    drawn = np.concatenate([np.stack(part) for parts, _ in curves for part in parts], axis=1)
    wide = min(float(np.abs(drawn[0]).max()), _WIDEST)
    room = 0.12 * max(wide, 0.5 * float(np.ptp(drawn[1])))
    _past_first(ax, surface, latitude, directions[_evenly_chosen(len(directions), geodesics)], wide + room)
    for index, (parts, label) in enumerate(curves):
        for x, y in parts:
            ax.plot(x, y, label=label, zorder=3.0, **SERIES[index % len(SERIES)])
            label = "_"
    if 1 in orders:
        _draw_cut(ax, surface, latitude)
    ax.set(xlim=(-wide - room, wide + room), ylim=(drawn[1].min() - room, drawn[1].max() + room), aspect="equal")
    ax.set_xlabel(r"$\theta - n\pi$ [rad]", fontsize=SMALL)
    ax.set_ylabel("parametric latitude [rad]", fontsize=SMALL)
    finish(ax, title="conjugate and cut locus of a point on a surface of revolution")
    return ax


def plot_potential(ax: Axes, surface: SurfaceOfRevolution | ArrayLike, momenta: ArrayLike | None = None) -> Axes:
    """V = p^2/m of a surface of revolution against phi, and the points where V = 1, between which extremals oscillate.

    Along an extremal of unit speed phi'^2 + V = 1; one that reaches the top of V below 1 passes the surface's end.

    Source: Bonnard, Cots and Shcherbakova 2013, remark 1 and lemma 4.1; theory.md O2, R5.

    Parameters
    ----------
    ax : flat axes
    surface : a surface of revolution; or (3,) three different moments [kg m^2], of whose Serret-Andoyer metric
    momenta : (N,) Clairaut's p, in absolute value at most that of the equator; None: four, the separatrix among them

    Raises
    ------
    ShapeError
        If a momentum is larger than that of the equator.

    Examples
    --------
    >>> len(sp.plots.plot_potential(sp.plots.column_axes(), [3.0, 2.0, 1.0]).lines)  # of each p the curve and both ends
    9
    """
    check_flat_axes(ax)
    surface, unit = _surface_and_unit(surface)
    low, high = surface.least_momentum, surface.greatest_momentum
    shares = np.array([0.0 if low > 0.0 else 0.2, 0.4, 0.7, 1.0])
    p = low + (high - low) * shares if momenta is None else finite_array(momenta, "momenta", (None,))
    if np.abs(p).max(initial=0.0) > high * (1.0 + _ROUNDING):
        raise ShapeError(f"momenta: |p| is at most sqrt(m(0)) = {high:.6g} on the surface, got {value_text(momenta)}")
    heights = np.sqrt(surface.depth) * np.sin(np.linspace(-0.5, 0.5, _POINTS + 1) * np.pi)
    heights = heights[1:-1] if surface.end == "pole" else heights
    phi = surface.latitude(heights)
    for index, momentum in enumerate(p.tolist()):
        look = SERIES[index % len(SERIES)]
        level = momentum**2 / (surface.equator * (1.0 - heights**2))
        ax.plot(phi, level, label=f"$p$ = {momentum:.4g}".replace("-", "−"), **look)
        turn = 1.0 - (momentum / high) ** 2
        if turn <= surface.depth * (1.0 + _ROUNDING):
            end = float(surface.latitude(np.sqrt(np.clip(turn, 0.0, surface.depth))))
            ax.plot(
                [-end, end], [1.0, 1.0], linestyle="none", marker="o", markersize=3.5, color=look["color"], zorder=4
            )
    ax.axhline(1.0, color=BLACK, linewidth=0.8, linestyle=(0, (2, 2)), label="energy, 1")
    ax.set(xlim=(-surface.reach, surface.reach), ylim=(0.0, _HIGHEST))
    ax.set_xlabel(rf"$\varphi$ [{unit}]", fontsize=SMALL)
    ax.set_ylabel(r"$V = p^2/m(\varphi)$ [1]", fontsize=SMALL)
    finish(ax, title="extremals oscillate where the potential is below 1")
    return ax


def plot_first_return(ax: Axes, surface: SurfaceOfRevolution | ArrayLike, momenta: ArrayLike = ()) -> Axes:
    """Period T and first return R of a surface's extremals against Clairaut's p, on a scale each.

    T is the length after which an extremal comes back to its latitude and direction, R the longitude that it gains from
    one passage of the equator to the next; T' = 2 p R', so that both fall or rise together.

    Source: Bonnard, Cots and Shcherbakova 2013, definition 2.4, lemma 2.8; theory.md O8, O14, R11.

    Parameters
    ----------
    ax : flat axes; a twin of them is added to their figure
    surface : a surface of revolution; or (3,) three different moments [kg m^2], of whose Serret-Andoyer metric
    momenta : (N,) p > 0 that are marked, of extremals that oscillate

    Examples
    --------
    >>> ax = sp.plots.plot_first_return(sp.plots.column_axes(), sp.rigid_body.geodesics.ellipsoid(0.8))
    >>> len(ax.figure.axes)
    2
    """
    check_flat_axes(ax)
    surface, unit = _surface_and_unit(surface)
    low, high = surface.least_momentum, surface.greatest_momentum
    marked = finite_array(momenta, "momenta", (None,))
    if marked.size:
        surface.parameters(marked)
    # Denser towards the separatrix, where both may grow without bound.
    p = low + (high - low) * np.linspace(_FIRST, 1.0, _POINTS // 2) ** 2
    twin: Any = ax.twinx()
    handles = []
    for axes, function, look, label, below in (
        (ax, surface.period, SERIES[0], f"period $T$ [{unit}]", _APART),
        (twin, surface.first_return, SERIES[1], "first return $R$ [rad]", 0.0),
    ):
        handles += axes.plot(p, function(p), label=label, **look)
        if marked.size:
            axes.plot(marked, function(marked), linestyle="none", marker="o", markersize=3.5, color=look["color"])
        axes.set_ylabel(label, fontsize=SMALL)
        axes.tick_params(labelsize=SMALL)
        bottom, top = axes.get_ylim()
        axes.set_ylim(bottom - below * (top - bottom), top + (_APART - below) * (top - bottom))
    ax.set_xlim(low, high)
    ax.set_xlabel(f"Clairaut's $p$ [{unit}]", fontsize=SMALL)
    finish(ax, handles=handles)
    return ax


def plot_caustic(
    ax: Axes, moments: ArrayLike, order: int = 1, *, circles: int = 32, view: tuple[float, float] = (22.0, -52.0)
) -> Axes:
    """The conjugate locus of the identity on SO(3), as rotation vectors: the images of a grid of starting velocities.

    A rotation vector [rad] is axis times angle; on the sphere of radius pi opposite points are the same rotation, where
    a surface that leaves there continues on the opposite side. The grid has the axis of the largest moment as its pole.

    Source: Bates and Fasso 2007, for two equal moments; theory.md Q6.

    Parameters
    ----------
    ax : three-dimensional axes
    moments : (3,) about the body axes [kg m^2], one may be `inf`: the sub-Riemannian metric
    order : which conjugate points of each geodesic
    circles : of latitude in the grid, and twice as many half circles from pole to pole
    view : elevation and azimuth of the eye [degrees]

    Raises
    ------
    MissingExtraError, ShapeError, AccuracyNotReached
        Without Matplotlib; for moments or an order for which there are no conjugate points, or none are found.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = Figure().add_subplot(projection="3d")
    >>> len(sp.plots.plot_caustic(ax, [2.0, 2.0, 1.0], circles=8).collections) >= 1
    True
    """
    check_axes(ax)
    if getattr(ax, "name", "") != "3d":
        raise ShapeError('ax: three-dimensional axes are needed; make them with projection="3d"')
    if isinstance(circles, bool) or not isinstance(circles, int | np.integer) or circles < 2:
        raise ShapeError(f"circles: a whole number from 2 on, got {value_text(circles)}")
    if finite_array(view, "view", (2,), unit="deg").ndim != 1:
        raise ShapeError("view: elevation and azimuth [deg] are needed")
    from matplotlib.patches import Patch

    space: Any = ax
    metric = left_invariant_metric(moments)
    polar, around = (np.arange(circles) + 0.5) * np.pi / circles, np.linspace(0.0, 2.0 * np.pi, 2 * circles + 1)
    velocities = np.sqrt(np.where(np.isfinite(metric.moments), metric.moments, 1.0)) * _directions(polar, around)
    vectors = so3.log(metric.conjugate_locus(metric.unit_speed(velocities @ metric.axes.T), order))
    meshes = _meshes(vectors)
    add_polygons(space, meshes, facecolor=SKY, edgecolor=BLUE, linewidth=0.2, alpha=0.3)
    extent = min(np.pi, max(1.1 * float(np.linalg.norm(vectors, axis=-1).max()), 1e-3))
    if extent == np.pi:
        turn = np.linspace(0.0, 2.0 * np.pi, 121)
        for axis in range(3):
            space.plot(
                *np.pi * np.roll([np.cos(turn), np.sin(turn), 0.0 * turn], axis, axis=0), color=GREY, linewidth=0.5
            )
    space.plot([0.0], [0.0], [0.0], linestyle="none", marker="*", markersize=7.0, color=BLACK, label="identity")
    space.set(xlim=(-extent, extent), ylim=(-extent, extent), zlim=(-extent, extent))
    space.set_box_aspect((1.0, 1.0, 1.0), zoom=0.78)
    space.view_init(*view)
    space.locator_params(nbins=5)
    for name, label in (("x", "axis 1 [rad]"), ("y", "axis 2 [rad]"), ("z", "axis 3 [rad]")):
        getattr(space, f"set_{name}label")(label, fontsize=SMALL)
    handles, _ = space.get_legend_handles_labels()
    named = Patch(facecolor=SKY, edgecolor=BLUE, alpha=0.5, label=f"conjugate points of order {order}")
    finish(space, handles=[named, *handles], loc="upper center", bbox_to_anchor=(0.5, 1.05))
    space.tick_params(axis="z", labelsize=SMALL)
    return ax


def _evenly_chosen(count: int, chosen: int) -> Integers:
    """`chosen` of the indices below `count`, evenly spread, the ends left out."""
    if isinstance(chosen, bool) or not isinstance(chosen, int | np.integer) or not 0 <= chosen <= count:
        raise ShapeError(f"geodesics: a whole number from 0 to {count} is needed, got {value_text(chosen)}")
    return np.linspace(0, count - 1, chosen + 2)[1:-1].astype(np.int64)


def _about_centre(longitude: Array, momentum: Array, order: int) -> Array:
    """Longitude less n pi for extremals to the east, plus n pi for those to the west; whole turns do not matter."""
    return longitude - np.where(momentum < 0.0, -1.0, 1.0) * order * np.pi


def _parametric(height: ArrayLike) -> Array:
    """The parametric latitude of y [rad]."""
    return np.arcsin(np.clip(height, -1.0, 1.0))


def _past_first(ax: Any, surface: SurfaceOfRevolution, latitude: float, directions: Array, reach: float) -> None:
    """Draw extremals from the start to `reach` past the last first conjugate point that is seen."""
    if not len(directions):
        return
    first = conjugate_points(surface, directions, 1, latitude)
    length = min(float(first.time.max()), np.pi * surface.greatest_momentum * _WIDEST)
    times = np.linspace(0.0, length + reach * surface.greatest_momentum, _POINTS)
    place, longitude, _ = extremal(surface, directions, latitude).state(times)
    x = _about_centre(longitude, first.momentum[:, None], 1)
    label = "geodesics"
    for across, up in zip(x, _parametric(surface.height(place)), strict=True):
        ax.plot(across, up, label=label, **_FAINT)
        label = "_"


def _draw_cut(ax: Any, surface: SurfaceOfRevolution, latitude: float) -> None:
    """Draw the cut locus, where it is known."""
    try:
        cut = cut_locus(surface, latitude)
    except ShapeError:
        return
    x = np.array(cut.longitudes) - np.pi
    ax.plot(x, _parametric(surface.height(cut.latitudes)), label=f"cut locus: arc of a {cut.kind}", zorder=4.0,
            color=BLACK, linewidth=2.4, solid_capstyle="round")  # fmt: skip


def _surface_and_unit(given: SurfaceOfRevolution | ArrayLike) -> tuple[SurfaceOfRevolution, str]:
    """A surface as it is, or of the Serret-Andoyer metric of moments, and the unit of its lengths."""
    if isinstance(given, SurfaceOfRevolution):
        return given, "length"
    metric = serret_andoyer_metric(given)
    surface = surface_of_metric(lambda phi: (metric.m(phi), metric.m_derivatives(phi)[0]), metric.crest)
    return surface, r"$\sqrt{\mathrm{kg}}$ m"


def _directions(polar: Array, azimuth: Array) -> Array:
    """Unit vectors of angles from axis 3 and about it: (N,), (M,) -> (N, M, 3)."""
    angle, turn = polar[:, None], azimuth[None, :]
    sine = np.sin(angle)
    return np.stack(np.broadcast_arrays(sine * np.sin(turn), -sine * np.cos(turn), np.cos(angle)), axis=-1)


def _meshes(vectors: Array) -> list[Array]:
    """Corners (m_k, 3) of the meshes of a grid (N, M, 3); one that leaves the ball of radius pi is cut there."""
    corners = np.stack([vectors[:-1, :-1], vectors[1:, :-1], vectors[1:, 1:], vectors[:-1, 1:]], axis=-2)
    corners = corners.reshape(-1, 4, 3)
    meshes = []
    for mesh in corners:
        if np.linalg.norm(mesh - np.roll(mesh, 1, axis=0), axis=-1).max() < np.pi:
            meshes.append(mesh)
            continue
        # Vectors of the opposite sense, longer than pi, are the same rotations.
        opposite = mesh - 2.0 * np.pi * so3.normalised(mesh)
        nearer = np.linalg.norm(mesh - mesh[0], axis=-1) <= np.linalg.norm(opposite - mesh[0], axis=-1)
        near = np.where(nearer[:, None], mesh, opposite)
        if np.linalg.norm(near - np.roll(near, 1, axis=0), axis=-1).max() < 0.5 * np.pi:
            halves = (_inside_ball(near), _inside_ball(np.where(nearer[:, None], opposite, mesh)))
            meshes += [half for half in halves if len(half) >= _TRIANGLE]
    return meshes


def _inside_ball(polygon: Array) -> Array:
    """The part of a small polygon inside the ball of radius pi: (N, 3) -> (M, 3)."""
    depth, directions, kept = np.pi - np.linalg.norm(polygon, axis=-1), so3.normalised(polygon), []
    for k, after in enumerate((*range(1, len(polygon)), 0)):
        if depth[k] >= 0.0:
            kept.append(polygon[k])
        if (depth[k] >= 0.0) != (depth[after] >= 0.0):
            # Between directions, so that the corner of the other part is opposite.
            share = depth[k] / (depth[k] - depth[after])
            kept.append(np.pi * so3.normalised((1.0 - share) * directions[k] + share * directions[after]))
    return np.array(kept)
