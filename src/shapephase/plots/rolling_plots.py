"""Figures of Poinsot's description: the ellipsoid rolling on its plane, and a body cone rolling on a space cone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .. import so3
from ..arguments import number_argument
from ..arrays import Array, Mask
from ..errors import ShapeError
from ..rigid_body.euler_top import EulerTop
from ..rigid_body.poinsot import Poinsot, cones
from ._sphere_axes import ParallelAxes
from .plot_style import BLACK, BLUE, GREEN, GREY, VERMILION, check_axes
from .polhode_plots import herpolhode_times, polhode_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POLHODE: dict[str, Any] = {"color": VERMILION, "linestyle": "-", "linewidth": 1.8}
_HERPOLHODE: dict[str, Any] = {"color": BLUE, "linestyle": "-", "linewidth": 1.1}
_GRID: dict[str, Any] = {"color": GREY, "linestyle": "-", "linewidth": 0.35}
_PRINCIPAL: dict[str, Any] = {"color": "#555555", "linestyle": (0, (4, 1.5)), "linewidth": 0.8}
_OMEGA: dict[str, Any] = {"color": GREEN, "linestyle": "-", "linewidth": 2.0}
_MU: dict[str, Any] = {"color": BLACK, "linestyle": (0, (5, 1.5)), "linewidth": 1.4}
_AXIS: dict[str, Any] = {"color": VERMILION, "linestyle": (0, (6, 1, 1, 1)), "linewidth": 1.4}
_AROUND = 181  # points of a closed curve: chords stay within a line's width of it
# Lines of the ellipsoid's grid from pole to pole, and around.
_MERIDIANS = 6
_PARALLELS = 5
_GENERATORS = 24  # of a cone that are drawn
_PLANE = 1.15  # half the plane's side, over the herpolhode's radius
_UNDER = 0.85
_BEYOND = 1.22  # of the longest semi-axis: reach of a direction, for its name
_BELOW = 1.4  # of the height over the plane: reach of the momentum
_ABOVE_CONES = 16.0  # [degrees] elevation of the eye over cones
_BESIDE_CONES = 65.0
_LIMB = -1e-9  # [curve's size] height over the tangent: rounding on the limb is seen
_DOWNWARDS = np.array([[1.0], [-1.0], [-1.0]])  # the invariable plane is a floor, its normal, the momentum, points down


def plot_rolling_ellipsoid(
    ax: Axes, top: EulerTop, time: float = 0.0, *, periods: float = 2.0, view: tuple[float, float] = (22.0, 40.0)
) -> Axes:
    """Poinsot's picture at one time: the ellipsoid of inertia on the invariable plane, polhode and herpolhode.

    Lengths are angular velocities. The plane is drawn as a floor, so that the momentum points down; the first axis
    points along the herpolhode's point at t = 0. What the ellipsoid hides is dimmed.

    Source: Marsden and Ratiu, section 15.5; theory.md I1 to I5.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection, or three-dimensional ones, in the view they have
    top : with momentum
    time : at which the ellipsoid is shown [s]
    periods : of the body momentum for which the herpolhode is drawn, above 0; on the separatrix all of it is
    view : elevation and azimuth of the eye [degrees], for flat axes

    Raises
    ------
    ShapeError
        If the top has no momentum, or the number of periods is not above 0.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> sp.plots.plot_rolling_ellipsoid(ax, top, time=1.0).get_legend().get_texts()[0].get_text()
    'polhode'
    """
    check_axes(ax)
    moment = number_argument(time, "time", "s")
    count = number_argument(periods, "periods")
    if not count > 0.0:
        raise ShapeError(f"periods: a positive number of them is drawn, got {periods}")
    poinsot = Poinsot(top)
    space = ParallelAxes(ax, view)
    frame = np.vstack([poinsot.plane_axes, poinsot.normal]) * _DOWNWARDS
    axes = frame @ top.attitude(moment) @ top.axes
    ellipsoid = _Ellipsoid(axes, poinsot.semi_axes)
    height = poinsot.distance
    contact = frame @ poinsot.herpolhode(moment)
    wide = max(_PLANE * poinsot.annulus[1], *(_UNDER * np.linalg.norm(axes[:2] * poinsot.semi_axes, axis=1)))
    corners = wide * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    floor = np.array([0.0, 0.0, -height])
    space.fill(corners + floor, "#F1EEE4", "#C9C2AE", depth=0.5)
    if poinsot.annulus[1] > 0.0:
        body = so3.apply(top.attitude(moment), poinsot.polhode(polhode_times(top))) @ frame.T
        space.line(body, ellipsoid.faces(body, space.eye), "polhode", depth=4.0, **_POLHODE)
        drawn = poinsot.herpolhode(herpolhode_times(top, count)) @ frame.T
        space.line(drawn, ~ellipsoid.hides(drawn, space.eye), "herpolhode", depth=2.0, **_HERPOLHODE)
    _draw_ellipsoid(space, ellipsoid)
    inside = np.zeros(2, dtype=bool)
    space.line(np.stack([np.zeros(3), contact]), inside, r"angular velocity $\omega$", depth=3.9, **_OMEGA)
    below = np.array([0.0, 0.0, -_BELOW * height])
    space.line(np.stack([np.zeros(3), floor]), inside, r"momentum $\mu$, normal of the plane", depth=3.8, **_MU)
    space.line(np.stack([floor, below]), np.ones(2, dtype=bool), None, depth=0.4, **_MU)
    space.mark(contact, "point of contact", marker="o", color=GREEN, markersize=6.5)
    space.write(_BEYOND * below, r"$\mu$")
    for number, column in enumerate(axes.T):
        end = _BEYOND * poinsot.semi_axes[number] * column * np.copysign(1.0, column @ space.eye)
        if end[2] > -height:
            space.write(end, f"$I_{number + 1}$")
    reach = np.concatenate([corners + floor, ellipsoid.box(), _BEYOND * below[None]])
    space.frame(reach, f"the ellipsoid of inertia rolls on its plane; t = {moment:.4g} s", "[rad/s]")
    return ax


def plot_cones(ax: Axes, top: EulerTop, time: float = 0.0, *, view: tuple[float, float] | None = None) -> Axes:
    """The body cone of a symmetric body rolling on the space cone, at one time; both touch along the angular velocity.

    Lengths are angular velocities; the momentum points up, and the first axis to where the angular velocity is at
    t = 0. The body cone is about the axis of symmetry, the space cone about the momentum.

    Source: Marsden and Ratiu, 15.8 case 2; theory.md H2.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection, or three-dimensional ones, in the view they have
    top : with two equal moments, and a momentum
    time : [s]
    view : elevation and azimuth of the eye [degrees], for flat axes; None: beside the axis of symmetry

    Raises
    ------
    ShapeError
        If no two moments are equal, or all three, or the momentum is zero.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> top = sp.EulerTop.principal([1.0, 1.0, 2.0], [3.0, 0.0, 4.0])
    >>> sp.plots.plot_cones(ax, top).get_legend().get_title().get_text().split("\\n")[0]
    'oblate: the space cone is inside the body cone'
    """
    check_axes(ax)
    moment = number_argument(time, "time", "s")
    found = cones(top)
    poinsot = Poinsot(top)
    frame = np.vstack([poinsot.plane_axes, poinsot.normal])
    omega = frame @ poinsot.herpolhode(moment)
    speed = float(np.linalg.norm(omega))
    symmetry = top.axes[:, 2 if found.space_inside_body else 0]
    axis = frame @ top.attitude(moment) @ symmetry
    axis *= np.copysign(1.0, axis[2])
    beside = float(np.degrees(np.arctan2(axis[1], axis[0]))) + _BESIDE_CONES
    space = ParallelAxes(ax, (_ABOVE_CONES, beside) if view is None else view)
    up = np.array([0.0, 0.0, 1.0])
    for direction, half, label, line, face in (
        (axis, found.body_half_angle, "body cone", _POLHODE, "#F6D9C4"),
        (up, found.space_half_angle, "space cone", _HERPOLHODE, "#CBE5F5"),
    ):
        name = f"{label}, half angle {np.degrees(half):.4g}°"
        _draw_cone(space, direction, speed, half, name, face, line)
    for end, label, text, look in (
        (speed * up, r"momentum $\mu$", r"$\mu$", _MU),
        (speed * axis, "axis of symmetry", r"$e$", _AXIS),
        (omega, r"angular velocity $\omega$", r"$\omega$", _OMEGA),
    ):
        space.line(np.stack([np.zeros(3), _BEYOND * end]), np.ones(2, dtype=bool), label, depth=5.0, **look)
        space.write((_BEYOND + 0.08) * end, text)
    reach = _BEYOND * np.concatenate([speed * np.stack([up, axis]), omega[None], np.zeros((1, 3))])
    rims = [_rim(direction, speed, half) for direction, half in
            ((axis, found.body_half_angle), (up, found.space_half_angle))]  # fmt: skip
    kind = "prolate: the cones touch from outside"
    if found.space_inside_body:
        kind = "oblate: the space cone is inside the body cone"
    rates = f"precession {found.precession_rate:.4g} rad/s, spin {found.spin_rate:.4g} rad/s".replace("-", "−")
    space.frame(np.concatenate([reach, *rims]), f"{kind}\n{rates}; t = {moment:.4g} s", "[rad/s]")
    return ax


class _Ellipsoid:
    """An ellipsoid about the origin, by its axes as columns (3, 3) and its semi-axes (3,)."""

    def __init__(self, axes: Array, semi_axes: Array) -> None:
        self.stretch = axes * semi_axes
        self.shrink = axes / semi_axes

    def points(self, directions: Array) -> Array:
        """Image of points of the unit sphere: (..., 3) -> (..., 3)."""
        return directions @ self.stretch.T

    def faces(self, points: Array, eye: Array) -> Mask:
        """True where points (N, 3) of the surface are on the side of the eye."""
        return (points @ self.shrink) @ (eye @ self.shrink) >= _LIMB

    def hides(self, points: Array, eye: Array) -> Mask:
        """True where the ellipsoid is between points (N, 3) outside it and the eye."""
        start, towards = points @ self.shrink, eye @ self.shrink
        along = start @ towards / (towards @ towards)
        nearest = np.sum(start**2, axis=-1) - along**2 * (towards @ towards)
        return (along < 0.0) & (nearest < 1.0)

    def outline(self, eye: Array) -> Array:
        """Visible edge: (N, 3)."""
        return self.points(_circle(so3.normalised(eye @ self.shrink)))

    def box(self) -> Array:
        """Corners of the box around it: (8, 3)."""
        half = np.linalg.norm(self.stretch, axis=1)
        return half * np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T


def _draw_ellipsoid(space: ParallelAxes, ellipsoid: _Ellipsoid) -> None:
    """Draw the outline, the ellipses in the principal planes, and a grid about the axis of the largest moment."""
    if not space.solid:
        space.fill(ellipsoid.outline(space.eye), "#DDEAF3", BLACK, depth=2.5)
    angles = np.linspace(0.0, np.pi, _MERIDIANS, endpoint=False)
    grid = [_circle(np.array([np.cos(a), np.sin(a), 0.0])) for a in angles]
    around = _circle(np.array([0.0, 0.0, 1.0]))
    for height in np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, _PARALLELS + 2)[1:-1]):
        grid.append(np.array([0.0, 0.0, height]) + np.sqrt(1.0 - height**2) * around)
    for directions in grid:
        points = ellipsoid.points(directions)
        near = ellipsoid.faces(points, space.eye)
        space.line(points, near, None, depth=3.2, **_GRID)
    for normal in np.eye(3):
        points = ellipsoid.points(_circle(normal))
        space.line(points, ellipsoid.faces(points, space.eye), "principal planes", depth=3.4, **_PRINCIPAL)


def _draw_cone(
    space: ParallelAxes, axis: Array, slant: float, half: float, label: str, face: str, line: dict[str, Any]
) -> None:
    """Draw a cone from the origin: its rim, some of its generators, and its sides as a shade."""
    rim = _rim(axis, slant, half)
    space.fill(np.vstack([np.zeros((1, 3)), rim]), face, "none", depth=1.5, hull=True)
    outwards = (rim - slant * np.cos(half) * axis) * np.cos(half) - slant * np.sin(half) ** 2 * axis
    near = outwards @ space.eye >= _LIMB * slant
    # Into an opening that faces the eye, the whole rim is seen.
    space.line(rim, near | bool(axis @ space.eye > 0.0), label, depth=4.0, **line)
    for k in range(0, len(rim) - 1, (len(rim) - 1) // _GENERATORS):
        pair = np.stack([np.zeros(3), rim[k]])
        space.line(pair, np.full(2, near[k]), None, depth=3.0, color=line["color"], linewidth=0.4)


def _rim(axis: Array, slant: float, half: float) -> Array:
    """The circle on a cone at some length from its apex: (N, 3)."""
    return slant * (np.cos(half) * axis + np.sin(half) * _circle(axis, 8 * _GENERATORS + 1))


def _circle(normal: Array, count: int = _AROUND) -> Array:
    """The unit circle across a unit vector: (N, 3)."""
    first = so3.perpendicular(normal)
    angle = np.linspace(0.0, 2.0 * np.pi, count)[:, None]
    return np.cos(angle) * first + np.sin(angle) * np.cross(normal, first)
