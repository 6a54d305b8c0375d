"""The loop of a motion on the curvature: what it encloses in the drawn plane, in its whole cone, and what it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import whole_argument
from ..arrays import Array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_smooth
from ..body.loading import as_body
from ..display import short_repr
from ..errors import OpenPathError, ShapeError
from ..letters import value_text
from ..shape_space.body_path import as_path, check_closed, route_along
from ..shape_space.connection import curvature, horizontal_lift, mechanical_connection
from ..shape_space.curvature_field import curvature_along
from ..shape_space.shape_path import CLOSED, ShapePath
from . import plot_style as style
from ._joint_styles import joint_place
from ._postures import draw_postures
from .curvature_map import (
    colour_scale,
    component_of,
    curvature_colours,
    draw_loop,
    draw_map,
    name_axes,
    row_around,
    shown_part,
    squared_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PRINCIPAL = "principal"
HEIGHT = 5.2  # [in] of a figure one column wide whose map is about square
_AT_REST = 1e-9  # [rad or m] range of a joint that does not move
_NO_TURN = 1e-6  # [rad] turns of less have no axis: whole turns are then about that of the flux
_PANELS = 128  # of a loop, on which the flux is integrated by Gauss: 1e-7 rad for the motions of the library
_RULES = ((3, 8), (4, 12))  # Gauss nodes along the loop and the rays; the difference of both is the error
_MIDDLES = 256  # even times whose mean shape is the centre, as of `stokes_holonomy`
_MANY = 512  # panels, as of recordings: they are so short that two nodes less along the loop give as much
_ARROWS = 11  # of the vector field along each axis
_POSTURE = 0.45  # [in] height of a posture
_BESIDE = 3  # postures in a row of a figure higher than that, else all
_HIGH = 4.0  # [in]
_TICKS = 5  # on each of three axes: their numbers do not touch
_ZOOM = 0.85  # of three-dimensional axes: their labels stay in the figure
_SPACE_SECTORS = 180  # of the cone over three joints: two degrees each


@dataclass(frozen=True, eq=False)
class LoopFlux:
    """What a loop of shapes encloses in the drawn joints and in all, and the turn that it makes.

    Rotation vectors (3,) [rad] in base axes at the start; a flux is the turn that it stands for: minus the integral of
    the curvature over the cone of straight rays from the mean shape of the loop.

    joints, units : of the two or three axes of the figure
    centre, directions : (n,) mean shape, (k, n) of the axes
    points : (N, k) the loop in the figure
    in_plane : flux through the loop's projection on the drawn joints, the others at the mean shape
    of_cone : flux through the cone over all joints
    turn : the exact turn, whole turns added so that it is nearest to `of_cone`
    error : estimate of the error of each [rad]
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    centre: Array
    directions: Array
    points: Array
    in_plane: Array
    of_cone: Array
    turn: Array
    error: float

    __repr__ = short_repr

    def parts(self, direction: Array | None) -> dict[str, float]:
        """Return the three turns and their differences along a direction or by their norms [rad].

        `other_joints` is what the joints add that are not drawn, `order` what the order of the turns adds, which do
        not commute; the three last add up to `turn`.
        """
        in_plane, cone, turn = (float(shown_part(v, direction)) for v in (self.in_plane, self.of_cone, self.turn))
        return {
            "turn": turn,
            "flux_in_plane": in_plane,
            "flux_of_cone": cone,
            "other_joints": cone - in_plane,
            "order": turn - cone,
        }


def loop_flux(body: Body, path: ShapePath, joints: Sequence[str | int] | str | None = None) -> LoopFlux:
    """Return what a loop encloses and the turn that it makes. Arguments and errors like `plot_loop`."""
    route = route_along(body, path)
    check_smooth(body.chain.follows, "the curvature needs")
    check_closed(body, route)
    turned = np.flatnonzero(np.abs(route.gap) > CLOSED)
    if len(turned):
        raise OpenPathError(
            f"joint {body.joint_names[turned[0]]} ends whole turns from its start: no cone spans a loop"
        )
    shapes = route.shape(style.even_times(route, None))
    centre = route.shape((np.arange(_MIDDLES) + 0.5) / _MIDDLES * route.duration / route.loops).mean(axis=0)
    names, units, directions = _drawn_axes(body, shapes, centre, joints)
    lift = horizontal_lift(body, route)
    edges = np.union1d(route.breaks, np.linspace(0.0, route.duration, _PANELS * route.loops + 1))
    whole, plane = (_flux(body, route, edges, centre, onto) for onto in (None, directions))
    vector = so3.log(lift.end)
    # A vector that is not zero, where there is neither a turn nor a flux.
    axis = so3.normalised(vector if np.linalg.norm(vector) > _NO_TURN else whole[0] + _NO_TURN)
    vector = vector + 2.0 * np.pi * np.round((whole[0] - vector) @ axis / (2.0 * np.pi)) * axis
    error = max(whole[1], plane[1], lift.error_estimate)
    points = (shapes - centre * (units[0] == PRINCIPAL)) @ directions.T
    return LoopFlux(names, units, centre, directions, points, plane[0], whole[0], vector, error)


def plot_loop(
    ax: Axes,
    body: Body | str,
    path: ShapePath | str,
    joints: Sequence[str | int] | str | None = None,
    *,
    axis: str | ArrayLike | None = None,
    postures: int = 6,
) -> Axes:
    """A loop of shapes on the curvature over two of its joints, and the parts of the turn that it makes.

    Above are the flux through the drawn plane, what the other joints add to it (the flux through the cone over all
    joints), and what the order of the turns adds to that: the exact turn. Arrows are the connection: what goes along
    one turns the body about the axis, what goes across one does not. The postures are those at the numbers on the
    loop, with the turn up to there.

    Source: theory.md B6; Hatton and Choset 2011.

    Parameters
    ----------
    ax : flat axes; three-dimensional ones for three joints
    body, path : a closed path of its joints
    joints : two or three names or indices, or "principal", the two principal directions of the path; None: the two
        whose loop encloses most curvature
    axis : as for `plot_curvature`; None: that of the largest component of the turn
    postures : of the body round the loop; 0: none

    Raises
    ------
    OpenPathError
        If the path does not close.
    ShapeError, UnknownNameError
        For other joints, fewer than two that move, or those of a ball joint.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> ax = sp.plots.plot_loop(sp.plots.column_axes(4.4), cat, loop)
    >>> print(ax.get_legend().get_title().get_text())
    one round turns the body about x by −63.3°
    = −64.4° flux in this plane (cone of all joints −64.4°)
    +0.0° by other joints, +1.1° by the order of turns
    """
    body = as_body(body)
    path = as_path(path, body)
    flux = loop_flux(body, path, joints)
    count = whole_argument(postures, "postures", 0)
    draw_loop_flux(ax, body, path, flux, axis, count)
    return ax


def loop_axes(flux: LoopFlux) -> Axes:
    """Return axes of a new figure for a loop whose flux is known."""
    return style.column_axes(HEIGHT, projection=None if len(flux.joints) == 2 else "3d")


def draw_loop_flux(
    ax: Any, body: Body, path: ShapePath, flux: LoopFlux, axis: str | ArrayLike | None = None, postures: int = 6
) -> None:
    """Draw a loop whose flux is known; arguments as for `plot_loop`."""
    direction, name = component_of(axis, flux.turn)
    if len(flux.joints) == 2:
        style.check_flat_axes(ax)
        _draw_plane(ax, body, flux, direction, name)
    else:
        style.check_axes(ax)
        if ax.name != "3d":
            raise ShapeError('ax: three joints need three-dimensional axes; make them with projection="3d"')
        _draw_space(ax, body, flux, direction, name)
        ax.set_box_aspect(None, zoom=_ZOOM)
        ax.set_anchor("N")
    if postures:
        _draw_round(ax, body, path, flux, postures)
    parts = {key: round(float(np.degrees(value)), 1) + 0.0 for key, value in flux.parts(direction).items()}
    about = "" if direction is None else f" about {name}"
    space = "plane" if len(flux.joints) == 2 else "space"
    title = (
        f"one round turns the body{about} by {parts['turn']}°\n"
        f"= {parts['flux_in_plane']}° flux in this {space} (cone of all joints {parts['flux_of_cone']}°)\n"
        f"{parts['other_joints']:+}° by other joints, {parts['order']:+}° by the order of turns"
    ).replace("-", "−")
    above = {
        "bbox_to_anchor": (0.5, _POSTURE * -(-postures // _beside(ax, postures))),
        "bbox_transform": _inches_above(ax),
    }
    style.finish(ax, handles=[], title=title, loc="lower center", **above)


def _beside(ax: Any, postures: int) -> int:
    """Number of postures in a row."""
    return _BESIDE if style.panel_size(ax)[1] > _HIGH else max(postures, 1)


def _inches_above(ax: Any) -> Any:
    """Coordinates above some axes: their widths, and inches, so that a layout knows the height."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    return blended_transform_factory(
        ax.transAxes, ax.figure.dpi_scale_trans + ScaledTranslation(0.0, 1.0, ax.transAxes)
    )


def enclosing_pair(body: Body, shapes: Array) -> list[int]:
    """Return the two joints whose loop (N, n) encloses most: area times curvature at its middle. Raises ShapeError."""
    usable = np.array([unit in ("rad", "m") for unit in body.joint_units])
    span = np.where(usable, np.ptp(shapes, axis=0), 0.0)
    widest = np.argsort(-span, kind="stable")[:2].tolist()
    if len(widest) < 2 or span[widest[1]] <= _AT_REST:
        raise ShapeError(f"path: a loop needs two joints that move, got {np.count_nonzero(span > _AT_REST)}")
    middle = shapes.mean(axis=0)
    arms, steps = np.where(usable, shapes[:-1] - middle, 0.0), np.diff(shapes, axis=0)
    area = 0.5 * np.abs(arms.T @ steps - steps.T @ arms)
    enclosed = np.where(usable, np.triu(np.linalg.norm(curvature(body, middle), axis=-1) * area), 0.0)
    pair = [int(k) for k in np.unravel_index(np.argmax(enclosed), enclosed.shape)]
    return pair if pair[0] != pair[1] else widest


def _drawn_axes(
    body: Body, shapes: Array, centre: Array, joints: Sequence[str | int] | str | None
) -> tuple[tuple[str, ...], tuple[str, ...], Array]:
    """Names, units and directions (k, n) of the axes of a figure."""
    usable = np.array([unit in ("rad", "m") for unit in body.joint_units])
    places = enclosing_pair(body, shapes)
    if isinstance(joints, str) and joints == PRINCIPAL:
        _, _, directions = np.linalg.svd(np.where(usable, shapes - centre, 0.0), full_matrices=False)
        return ("1st principal direction", "2nd principal direction"), (PRINCIPAL,) * 2, directions[:2]
    if joints is not None:
        if isinstance(joints, str) or not isinstance(joints, Sequence | np.ndarray) or len(joints) not in (2, 3):
            raise ShapeError(f'joints: two or three joints or "{PRINCIPAL}" are needed, got {value_text(joints)}')
        places = [joint_place(joint, body.joint_names) for joint in joints]
    names = tuple(body.joint_names[k] for k in places)
    if len({*names}) < len(names):
        raise ShapeError(f"joints: different joints are needed, got {', '.join(names)}")
    for k in places:
        if not usable[k]:
            raise ShapeError(
                f"joints: {body.joint_names[k]} is a number of a ball joint, which has no plane; take others"
            )
    return names, tuple(body.joint_units[k] for k in places), np.eye(body.n_shape)[places]


def _flux(body: Body, route: ShapePath, edges: Array, centre: Array, directions: Array | None) -> tuple[Array, float]:
    """Minus the curvature's integral over the cone of a loop, projected on some directions, and its error [rad]."""
    onto = None if directions is None else directions.T @ directions
    values = []
    for along_loop, along_ray in _RULES:
        nodes = along_loop - 2 * (len(edges) > _MANY * route.loops)
        (t, dt), (x, dx) = (np.polynomial.legendre.leggauss(count) for count in (nodes, along_ray))
        half = 0.5 * np.diff(edges)
        times, x = (edges[:-1, None] + half[:, None] * (t + 1.0)).ravel(), 0.5 * (x + 1.0)
        shapes, rates = route.curve(times)
        arms = shapes - centre
        arms, rates = (arms, rates) if onto is None else (arms @ onto, rates @ onto)
        places = centre + x[:, None, None] * arms
        pairs = (np.broadcast_to(arms, places.shape), x[:, None, None] * rates)
        field, _, _ = curvature_along(body, *(part.reshape(-1, body.n_shape) for part in (places, *pairs)))
        values.append(
            -np.einsum("i,j,ijk->k", 0.5 * dx, (half[:, None] * dt).ravel(), field.reshape(*places.shape[:2], 3))
        )
    return values[-1], float(np.abs(values[1] - values[0]).max())


def _draw_plane(ax: Any, body: Body, flux: LoopFlux, direction: Array | None, name: str) -> None:
    """Draw curvature, connection and loop in the plane of two joints."""
    rows = [row_around(points) for points in flux.points.T]
    offset = 0.0 if flux.units[0] == PRINCIPAL else flux.centre @ flux.directions.T
    start = flux.centre - offset @ flux.directions if np.ndim(offset) else flux.centre

    def shapes_at(first: Array, second: Array) -> Array:
        return start + first[:, None, None] * flux.directions[0] + second[:, None] * flux.directions[1]

    shapes = shapes_at(*rows)
    one, other = (np.broadcast_to(d, shapes.shape).reshape(-1, body.n_shape) for d in flux.directions)
    field, _, _ = curvature_along(body, shapes.reshape(-1, body.n_shape), one, other)
    units = ["rad" if unit == PRINCIPAL else unit for unit in flux.units]
    draw_map(ax, rows, field.reshape(*shapes.shape[:2], 3), direction, name, squared_unit(*units), "bottom")
    if direction is not None:
        step = [np.linspace(row[0], row[-1], 2 * _ARROWS + 1)[1::2] for row in rows]
        connection = mechanical_connection(body, shapes_at(*step))
        # By the axes' lengths: what goes along an arrow turns the body most for its way in the figure.
        across = flux.directions * np.array([[np.ptp(row)] for row in rows])
        turning = -np.einsum("a,ijan,kn->kji", direction, connection, across)
        ax.quiver(*step, *turning, color="#333333", width=0.006, alpha=0.6, pivot="middle", zorder=2.2)
    draw_loop(ax, flux.points)
    name_axes(ax, flux.joints, units)


def _draw_space(ax: Any, body: Body, flux: LoopFlux, direction: Array | None, name: str) -> None:
    """Draw the loop of three joints and its cone, coloured by the curvature across it."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    points = flux.points[np.linspace(0, len(flux.points) - 1, _SPACE_SECTORS + 1).astype(int)]
    tip = flux.directions @ flux.centre
    arms, steps = 0.5 * (points[1:] + points[:-1]) - tip, np.diff(points, axis=0)
    areas = 0.5 * np.linalg.norm(np.cross(arms, steps), axis=-1)
    field, _, _ = curvature_along(
        body, flux.centre + 0.5 * arms @ flux.directions, arms @ flux.directions, 0.5 * steps @ flux.directions
    )
    values = np.degrees(shown_part(field, direction)) / np.where(areas > 0.0, areas, 1.0)
    largest = float(np.abs(values).max()) or 1.0
    mapped = ScalarMappable(Normalize(-largest, largest), curvature_colours())
    triangles = [np.stack([tip, *side]) for side in pairwise(points)]
    style.add_polygons(ax, triangles, facecolors=mapped.to_rgba(values), alpha=0.8)
    ax.plot(*points.T, color=style.BLACK, linewidth=1.6)
    ax.plot(*points[:1].T, marker="*", color=style.GREEN, markersize=10.0, linestyle="none")
    name_axes(ax, flux.joints, flux.units)
    ax.locator_params(nbins=_TICKS)
    what = "norm" if direction is None else f"{name} component"
    per = "deg/rad²" if {*flux.units} == {"rad"} else "deg per area"
    colour_scale(ax, mapped, f"curvature of the cone, {what} [{per}]", "bottom", signed=direction is not None)


def _draw_round(ax: Any, body: Body, path: ShapePath, flux: LoopFlux, count: int) -> None:
    """Draw numbered points on the loop, and the body there above the axes."""
    route = route_along(body, path)
    once = flux.points[: len(flux.points) // route.loops + 1]
    steps = np.linalg.norm(np.diff(once / np.maximum(np.ptp(once, axis=0), _AT_REST), axis=0), axis=-1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    chosen = np.searchsorted(length, length[-1] * np.arange(count) / count)
    times = style.even_times(route, None)[chosen]
    shapes = route.shape(times)
    numbers = {"fontsize": style.SMALL - 1, "ha": "center", "va": "center", "zorder": 6.0}
    box = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": style.BLACK, "linewidth": 0.6}
    pictures = []
    beside = _beside(ax, count)
    rows = -(-count // beside)
    for k, point in enumerate(once[chosen]):
        ax.text(*point, str(k + 1), bbox=box, **numbers)
        left, bottom = k % beside / beside, _POSTURE * (rows - 1 - k // beside)
        pictures.append(ax.inset_axes((left, bottom, 1.0 / beside, _POSTURE), transform=_inches_above(ax)))
        look = numbers | {"ha": "left", "va": "top"}
        pictures[-1].text(0.0, 0.95, str(k + 1), transform=pictures[-1].transAxes, **look)
    draw_postures(pictures, body, shapes, horizontal_lift(body, route).attitude(times))
