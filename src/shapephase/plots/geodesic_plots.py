"""Figures of conjugate points: on the Serret-Andoyer surface, on an ellipsoid of revolution, on SO(3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import number_argument
from ..arrays import Array, Integers, finite_array
from ..errors import ShapeError
from ..letters import value_text
from ..rigid_body.geodesics import (
    SurfaceOfRevolution,
    conjugate_locus,
    conjugate_points,
    ellipsoid,
    extremal,
    left_invariant_metric,
    serret_andoyer_metric,
)
from .plot_style import BLACK, BLUE, GREY, SERIES, SKY, SMALL, check_axes, check_flat_axes, finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS = 400  # of a curve: no corner is seen at the width of a page
_NEAREST = 2e-3  # last p of a locus, from the separatrix' (theta infinite) to the equator's
_TRIANGLE = 3  # corners
_FAINT: dict[str, Any] = {"color": GREY, "linewidth": 0.6, "alpha": 0.7, "zorder": 1.0}


def plot_conjugate_locus(
    ax: Axes, moments: ArrayLike, order: int = 1, *, momenta: ArrayLike = (), geodesics: int = 10
) -> Axes:
    """The conjugate locus of a point on the equator of the Serret-Andoyer surface: phi against theta, p_theta > 0.

    Two branches, one the mirror image of the other, from their common cusp on the equator, where p_theta is the root of
    the largest moment, towards the asymptotes phi = -K/alpha and K/alpha; faint the geodesics from the point up to
    where they touch it.

    Parameters
    ----------
    ax : flat axes
    moments : (3,) principal moments, three different ones in any order [kg m^2]
    order : which conjugate points of each geodesic
    momenta : (N,) p_theta whose conjugate points are marked, above the root of the middle moment, at most that of the
        largest [sqrt(kg) m]
    geodesics : how many are drawn to either side

    Notes
    -----
    Source: Bonnard, Cots and Shcherbakova 2013, section 4.4; theory.md R12.

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


def plot_ellipsoid_locus(
    ax: Axes, aspect: float, orders: Sequence[int] = (1, 2), *, latitude: float = 0.0, geodesics: int = 40
) -> Axes:
    """The caustics of a point on an ellipsoid of revolution: parametric latitude against longitude.

    Each order about its centre, which is opposite to the start for odd orders, at theta = n pi, and the start itself
    for even ones; faint the geodesics on their way past the first.

    Parameters
    ----------
    ax : flat axes
    aspect : polar over equatorial axis, not 1, where the caustics are points
    orders : n = 1, 2, ... of the conjugate points
    latitude : of the start, as a length along the meridian of the ellipsoid of unit equator, between its poles
    geodesics : how many are drawn

    Notes
    -----
    Source: Bonnard, Cots and Shcherbakova 2013, section 2, the ellipsoid; theory.md P3, P5.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> len(sp.plots.plot_ellipsoid_locus(ax, 0.8, geodesics=4).lines) >= 2
    True
    """
    latitude = number_argument(latitude, "latitude", "rad")
    check_flat_axes(ax)
    surface = ellipsoid(aspect)
    if aspect == 1.0:
        raise ShapeError("aspect: on a sphere the caustics are single points; give another one than 1")
    if not isinstance(orders, Sequence | np.ndarray) or not len(orders):
        raise ShapeError(f"orders: at least one is needed, such as (1, 2), got {value_text(orders)}")
    curves = []
    for order in orders:
        locus = conjugate_locus(surface, _POINTS, order, latitude)
        x = _about_centre(locus.points.longitude, locus.points.momentum, order)
        y = np.arcsin(np.clip(locus.points.height, -1.0, 1.0))
        curves.append((np.append(x, x[0]), np.append(y, y[0]), f"order {order}: {locus.cusps} cusps"))
    wide = max(float(np.abs(x).max()) for x, _, _ in curves)
    bottom, top = min(float(y.min()) for _, y, _ in curves), max(float(y.max()) for _, y, _ in curves)
    room = 0.12 * max(wide, 0.5 * (top - bottom))
    _past_first(ax, surface, latitude, geodesics, wide + room)
    for index, (x, y, label) in enumerate(curves):
        ax.plot(x, y, label=label, zorder=3.0, **SERIES[index % len(SERIES)])
    ax.set(xlim=(-wide - room, wide + room), ylim=(bottom - room, top + room), aspect="equal")
    ax.set_xlabel(r"$\theta - n\pi$ [rad]", fontsize=SMALL)
    ax.set_ylabel("parametric latitude [rad]", fontsize=SMALL)
    finish(ax, title=f"ellipsoid of aspect {aspect:.4g}: caustics of a point")
    return ax


def plot_caustic(
    ax: Axes, moments: ArrayLike, order: int = 1, *, circles: int = 32, view: tuple[float, float] = (22.0, -52.0)
) -> Axes:
    """The conjugate locus of the identity on SO(3), as rotation vectors: the images of a grid of starting velocities.

    A rotation vector [rad] is axis times angle; on the sphere of radius pi opposite points are the same rotation, where
    a surface that leaves there continues on the opposite side. The grid has the axis of the largest moment as its pole.

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

    Notes
    -----
    Source: Bates and Fasso 2007, for two equal moments; theory.md Q6.

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
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    space: Any = ax
    metric = left_invariant_metric(moments)
    polar, around = (np.arange(circles) + 0.5) * np.pi / circles, np.linspace(0.0, 2.0 * np.pi, 2 * circles + 1)
    velocities = np.sqrt(np.where(np.isfinite(metric.moments), metric.moments, 1.0)) * _directions(polar, around)
    vectors = so3.log(metric.conjugate_locus(metric.unit_speed(velocities @ metric.axes.T), order))
    meshes = _meshes(vectors)
    space.add_collection3d(Poly3DCollection(meshes, facecolor=SKY, edgecolor=BLUE, linewidth=0.2, alpha=0.3))
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


def _past_first(ax: Any, surface: SurfaceOfRevolution, latitude: float, geodesics: int, reach: float) -> None:
    """Draw extremals in evenly spread directions, from the start to `reach` past the last first conjugate point."""
    chosen = _evenly_chosen(_POINTS, geodesics)
    directions = 2.0 * np.pi * (np.arange(len(chosen)) + 0.5) / max(len(chosen), 1)
    if not len(directions):
        return
    first = conjugate_points(surface, directions, 1, latitude)
    times = np.linspace(0.0, float(first.time.max()) + reach, _POINTS)
    place, longitude, _ = extremal(surface, directions, latitude).state(times)
    x = _about_centre(longitude, first.momentum[:, None], 1)
    label = "geodesics"
    for across, up in zip(x, np.arcsin(np.clip(surface.height(place), -1.0, 1.0)), strict=True):
        ax.plot(across, up, label=label, **_FAINT)
        label = "_"


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
