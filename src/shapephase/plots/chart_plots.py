"""Figures of coordinates of the rigid body: Euler angles, and the elliptic cylinders whose motion is a pendulum's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, vector_argument
from ..arrays import Array, Mask
from ..errors import ChartPoleError, ShapeError
from ..rigid_body.euler_angles import ZXZ, EulerChart
from ..rigid_body.euler_top import EulerTop
from ..rigid_body.pendulum import RigidBodyPendulum, rigid_body_pendulum
from ..rigid_body.portrait import polhodes
from ._sphere_axes import ParallelAxes
from .plot_style import BLACK, BLUE, GREEN, SMALL, VERMILION, check_axes, check_flat_axes, finish
from .polhode_plots import LARGEST, OWN, SEPARATRIX, SMALLEST

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INERTIAL: dict[str, Any] = {"color": BLACK, "linestyle": "-", "linewidth": 1.2}
_BODY: dict[str, Any] = {"color": VERMILION, "linestyle": "-", "linewidth": 1.8}
_NODES: dict[str, Any] = {"color": GREEN, "linestyle": (0, (5, 1.5)), "linewidth": 1.6}
_ARCS: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "linewidth": 2.0},
    {"color": BLUE, "linestyle": (0, (4, 1.5)), "linewidth": 2.0},
    {"color": BLUE, "linestyle": (0, (1, 1)), "linewidth": 2.0},
)
_AXIS_LENGTH = 1.25  # [radii of the planes' circles]
_ARC_RADIUS = 0.5
_NAME_AT = 0.1  # [radii] beyond an axis' end or an arc
_AROUND = 181  # points of a closed curve: chords stay within a line's width of it
_BEYOND = 1.25  # [largest momentum along it] half a cylinder's length
# Lines of a cylinder: rings and generators.
_RINGS = 5
_GENERATORS = 24
_CURVES = 4  # of a kind in the pendulum's portrait
_HEAD = 0.15  # [rad] half an arrow on the separatrix
_HIGHEST = 3.0  # [separatrix] energy of the portrait's fastest rotation
_TOUCHING = 1e-6  # [ray to the eye] up to which it leaves the surface that a point is on
_LINE = 1e-12  # [momentum] a part below which a cylinder is a line


def plot_euler_angles(
    ax: Axes, angles: ArrayLike, chart: EulerChart = ZXZ, *, view: tuple[float, float] = (24.0, 28.0)
) -> Axes:
    """Inertial and body axes, the line of nodes where their horizontal planes meet, and the three angles as arcs.

    Source: Marsden and Ratiu, figure 15.6.1; theory.md J1.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection, or three-dimensional ones, in the view they have
    angles : (3,) phi, theta and psi [rad]; those of an attitude are `chart.angles(attitude)`
    chart : `ZXZ` or `ZYZ`
    view : elevation and azimuth of the eye [degrees], for flat axes

    Raises
    ------
    ChartPoleError
        If theta is a multiple of pi, where both planes are one and there is no line of nodes.

    Examples
    --------
    >>> ax = sp.plots.plot_euler_angles(sp.plots.column_axes(3.9), np.radians([40.0, 50.0, 60.0]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()][:3]
    ['inertial axes $e_i$', 'body axes $\\\\xi_i$', 'line of nodes $N$']
    """
    check_axes(ax)
    check_object(chart, "EulerChart", "chart")
    values = vector_argument(angles, "angles", unit="rad")
    if not chart.is_regular(values):
        raise ChartPoleError(
            f"angles: theta = {values[1]:.6g} is a pole of the {chart.name.upper()} chart, where there is no line of "
            "nodes; give a theta between 0 and pi"
        )
    phi, theta, psi = values
    space = ParallelAxes(ax, view)
    body = chart.attitude(values)
    first, third = np.array([*chart.node, 0.0]), np.array([0.0, 0.0, 1.0])
    nodes = so3.apply(so3.exp(phi * third), first)
    for normal, face, edge, look in ((third, "#F1EEE4", "#C9C2AE", _INERTIAL), (body[:, 2], "#F6D9C4", "none", _BODY)):
        rim = _turned(so3.perpendicular(normal), normal, 2.0 * np.pi)
        space.fill(rim, face, edge, depth=0.5)
        seen = ~_behind_disc(rim, body[:, 2] if normal is third else third, space.eye)
        space.line(rim, seen, None, depth=2.0, **{**look, "linewidth": 0.6})
    for frame, letter, label, look in (
        (np.eye(3), "e", "inertial axes $e_i$", _INERTIAL),
        (body, r"\xi", r"body axes $\xi_i$", _BODY),
    ):
        for number, axis in enumerate(frame.T):
            line = np.linspace(0.0, _AXIS_LENGTH, 60)[:, None] * axis
            seen = ~_behind_disc(line, third, space.eye) & ~_behind_disc(line, body[:, 2], space.eye)
            space.line(line, seen, label, depth=4.0, **look)
            space.write((_AXIS_LENGTH + _NAME_AT) * axis, f"${letter}_{number + 1}$")
    both = np.linspace(-_AXIS_LENGTH, _AXIS_LENGTH, 2)[:, None] * nodes
    space.line(both, np.ones(2, dtype=bool), "line of nodes $N$", depth=4.5, **_NODES)
    space.write((_AXIS_LENGTH + _NAME_AT) * nodes, "$N$")
    turns = ((first, third, phi, r"\varphi"), (third, nodes, theta, r"\theta"), (nodes, body[:, 2], psi, r"\psi"))
    for (start, axis, angle, letter), look in zip(turns, _ARCS, strict=True):
        arc = _ARC_RADIUS * _turned(start, axis, angle)
        label = f"${letter}$ = {np.degrees(angle):.4g}°".replace("-", "−")
        space.line(arc, np.ones(len(arc), dtype=bool), label, depth=5.0, **look)
        space.write((1.0 + 2.0 * _NAME_AT) * arc[len(arc) // 2], f"${letter}$")
    reach = (_AXIS_LENGTH + _NAME_AT) * np.vstack([np.eye(3), body.T, nodes, -nodes])
    rims = [_turned(so3.perpendicular(normal), normal, 2.0 * np.pi) for normal in (third, body[:, 2])]
    order = f"$R = R_z(\\varphi)\\,R_{chart.name[1]}(\\theta)\\,R_z(\\psi)$"
    space.frame(np.concatenate([reach, *rims]), f"Euler angles of the {chart.name.upper()} chart: {order}", "[1]")
    return ax


def plot_elliptic_cylinders(ax: Axes, top: EulerTop, *, view: tuple[float, float] = (22.0, 35.0)) -> Axes:
    """The two elliptic cylinders in the space of body momenta that cross in the polhode, and that polhode.

    K = (E - |Pi|^2/(2 I_3)), whose cylinder is about axis 3, and N, a combination of energy and momentum without Pi_1,
    whose cylinder is about axis 1. On the first, the motion is that of a pendulum: see `plot_pendulum`.

    Source: Marsden and Ratiu (15.11.6) to (15.11.11); theory.md N2 to N4.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection, or three-dimensional ones, in the view they have
    top : of three different moments, whose momentum is not along axis 1 or 3; axes are numbered by ascending moment
    view : elevation and azimuth of the eye [degrees], for flat axes

    Raises
    ------
    ShapeError
        If two moments are equal, or one of the cylinders is a line.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> ax = sp.plots.plot_elliptic_cylinders(sp.plots.column_axes(3.9), top)
    >>> ax.get_legend().get_texts()[0].get_text()
    'K = 0.1875 J'
    """
    check_axes(ax)
    pendulum, start = _pendulum_of(top)
    r, theta, p = pendulum.coordinates(start)
    energy = float(pendulum.hamiltonian(r, theta, p))
    if energy == 0.0:
        raise ShapeError("top: the momentum is along axis 1, where the cylinder of N is a line; give another momentum")
    space = ParallelAxes(ax, view)
    r, p = float(r), np.sqrt(2.0 * energy)
    across = pendulum.k1 * r
    tubes = (
        _Tube(2, np.array([across, pendulum.k2 * r]), _BEYOND * p),
        _Tube(0, np.array([p / np.sqrt(pendulum.inverse_square_k3), p]), _BEYOND * across),
    )

    def seen(points: Array) -> Mask:
        return ~(tubes[0].hides(points, space.eye) | tubes[1].hides(points, space.eye))

    names = f"K = {0.5 * r * r:.4g} J", f"N = {energy:.4g} kg² m⁴/s²"
    for tube, label, look, face in zip(tubes, names, (LARGEST, SMALLEST), ("#DDEAF3", "#F6D9C4"), strict=True):
        space.fill(tube.ends(), face, "none", depth=0.5, hull=not space.solid)
        for line in tube.grid():
            space.line(line, seen(line), label, depth=3.0, **{**look, "linewidth": 0.6})
    for branch in polhodes(top.moments, [top.energy / top.magnitude**2], _AROUND)[0]:
        curve = top.magnitude * branch
        space.line(curve, seen(curve), "polhode: where they cross", depth=5.0, **{**OWN, "linewidth": 2.2})
    space.mark(start, "$t = 0$", marker="*", color=GREEN, markersize=10.0)
    reach = [tube.ends() for tube in tubes]
    corners = np.concatenate(reach)
    for number, axis in enumerate(np.eye(3)):
        end = 1.2 * np.abs(corners).max(axis=0)[number] * axis * np.copysign(1.0, space.eye[number])
        line = np.linspace(0.0, 1.0, _AROUND)[:, None] * end
        space.line(line, seen(line), None, depth=4.0, color=BLACK, linewidth=0.9)
        space.write(1.1 * end, rf"$\Pi_{number + 1}$")
        reach.append(1.1 * end[None])
    title = "momentum in the body: elliptic cylinders of K and N"
    space.frame(np.concatenate(reach), title, "[kg m²/s]")
    return ax


def plot_pendulum(ax: Axes, top: EulerTop) -> Axes:
    """The rigid body as a pendulum: angle and momentum on the elliptic cylinder K through a top's momentum.

    Curves of equal N: librations about the axis of the smallest moment, rotations about that of the largest, and the
    separatrix through the middle one; the top's own is thick, with a star at its start.

    Source: Marsden and Ratiu (15.11.12), (15.11.13), proposition 15.11.1; theory.md N5 to N8.

    Parameters
    ----------
    ax : flat axes
    top : of three different moments, whose momentum is not along axis 3; axes are numbered by ascending moment

    Raises
    ------
    ShapeError
        If two moments are equal, or the momentum is along axis 3, where the angle is undefined.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> sp.plots.plot_pendulum(sp.plots.column_axes(), top).get_xlabel()
    '$\\\\theta$ [rad]'
    """
    check_flat_axes(ax)
    pendulum, start = _pendulum_of(top)
    r, theta, p = (float(value) for value in pendulum.coordinates(start))
    crest = 0.5 * (pendulum.k2 * r) ** 2 * pendulum.inverse_square_k3
    own = float(pendulum.hamiltonian(r, theta, p))
    small = (np.arange(_CURVES) + 0.5) ** 2 / _CURVES**2
    # Evenly spread speeds.
    large = np.linspace(1.0, np.sqrt(max(_HIGHEST, 1.2 * own / crest)), _CURVES + 1)[1:] ** 2
    named: set[str] = set()

    def draw(angle: Array, momentum: Array, label: str, **look: Any) -> None:
        ax.plot(angle, momentum, label="_" if label in named else label, **look)
        named.add(label)

    for level in (*small, *large):
        look, label = (SMALLEST, "about smallest moment") if level < 1.0 else (LARGEST, "about largest moment")
        for angle, momentum in _level_curves(level, crest):
            draw(angle, momentum, label, **look)
    angle, height = np.linspace(-np.pi, np.pi, 2 * _AROUND), np.sqrt(2.0 * crest)
    for sign in (1.0, -1.0):
        draw(angle, sign * height * np.abs(np.cos(angle)), "separatrix", **SEPARATRIX)
        step = sign * np.array([pendulum.orientation * _HEAD, 0.0])
        style = {"arrowstyle": "-|>", "color": BLACK, "mutation_scale": 11.0, "linewidth": 0.0}
        ax.annotate("", (step[0], sign * height), (-step[0], sign * height), arrowprops=style)
    for angle, momentum in _level_curves(own / crest, crest):
        if p * momentum[0] > 0.0 if own >= crest else np.cos(theta) * np.cos(angle[0]) > 0.0:
            draw(angle, momentum, "this top", zorder=4.0, **OWN)
    ax.plot([theta], [p], linestyle="none", marker="*", color=GREEN, markersize=11, label="$t = 0$", zorder=6)
    mark = {"linestyle": "none", "markersize": 5.5, "markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": 5.0}
    for kind, places, look in (("centre", (-2, 0, 2), {"marker": "o", "color": BLACK}),
                               ("saddle", (-1, 1), {"marker": "X", "color": VERMILION})):  # fmt: skip
        draw(0.5 * np.pi * np.array(places), np.zeros(len(places)), kind, clip_on=False, **mark, **look)
    quarters = np.arange(-2, 3)
    ax.set_xticks(0.5 * np.pi * quarters, ["−π", "−π/2", "0", "π/2", "π"])
    ax.set_xlim(-np.pi, np.pi)
    ax.set_xlabel(r"$\theta$ [rad]", fontsize=SMALL)
    ax.set_ylabel(r"$p = \Pi_3$ [kg m²/s]", fontsize=SMALL)
    finish(ax, title=f"a rigid body is a pendulum on its cylinder K = {0.5 * r * r:.4g} J")
    return ax


def _level_curves(level: float, crest: float) -> list[tuple[Array, Array]]:
    """Angles and momenta of the curves of N = level * crest in -pi..pi; a libration about pi is cut there."""
    if level >= 1.0:
        angle = np.linspace(-np.pi, np.pi, 2 * _AROUND)
        speed = np.sqrt(2.0 * crest * (level - np.sin(angle) ** 2))
        return [(angle, speed), (angle, -speed)]
    curves = []
    # The half of positive angles from the equilibrium, moved to -pi, and the other, moved to pi.
    for shift, start, end in ((0.0, 0.0, 2.0), (-np.pi, 0.0, 1.0), (np.pi, 1.0, 2.0)):
        turn = np.pi * np.linspace(start, end, _AROUND)
        curves.append((shift + np.arcsin(np.sqrt(level) * np.sin(turn)), np.sqrt(2.0 * crest * level) * np.cos(turn)))
        curves[-1] = (curves[-1][0], np.cos(shift) * curves[-1][1]) if shift else curves[-1]
    return curves


def _pendulum_of(top: EulerTop) -> tuple[RigidBodyPendulum, Array]:
    """The pendulum on cylinders about the axis of the largest moment, and the momentum at t = 0: (3,), ascending."""
    check_object(top, "EulerTop", "top")
    if np.any(np.diff(top.moments) <= _LINE * top.moments[2]):
        raise ShapeError(f"top: of its moments {top.moments} two are equal, and N has no elliptic cylinder; change one")
    start = top.body_momentum(0.0) @ top.axes
    if np.hypot(start[0], start[1]) <= _LINE * top.magnitude:
        raise ShapeError("top: its momentum is zero or along the axis of the largest moment, where K has no cylinder; "
                         "give another momentum")  # fmt: skip
    return rigid_body_pendulum(top.moments, (0, 1, 2)), start


class _Tube:
    """An elliptic cylinder about a coordinate axis, open at both ends."""

    def __init__(self, axis: int, semi_axes: Array, length: float) -> None:
        self.axis, self.semi_axes, self.length = axis, semi_axes, length
        self.across = [(axis + 1) % 3, (axis + 2) % 3]

    def ring(self, turn: Array, along: float) -> Array:
        """Points at angles (N,) and one place along the axis: (N, 3)."""
        points = np.empty((len(turn), 3))
        points[:, self.across] = self.semi_axes * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        points[:, self.axis] = along
        return points

    def ends(self) -> Array:
        """Both edges: (2 N, 3)."""
        turn = np.linspace(0.0, 2.0 * np.pi, _AROUND)
        return np.concatenate([self.ring(turn, -self.length), self.ring(turn, self.length)])

    def grid(self) -> list[Array]:
        """Rings and generators: (N, 3) each."""
        turn = np.linspace(0.0, 2.0 * np.pi, _AROUND)
        lines = [self.ring(turn, along) for along in np.linspace(-self.length, self.length, _RINGS)]
        ends = [self.ring(turn[: -1 : (_AROUND - 1) // _GENERATORS], side * self.length) for side in (-1.0, 1.0)]
        share = np.linspace(0.0, 1.0, _AROUND)[:, None]
        return lines + [low + share * (high - low) for low, high in zip(*ends, strict=True)]

    def hides(self, points: Array, eye: Array) -> Mask:
        """True where the ray from points (N, 3) to the eye passes the surface."""
        start, towards = points[:, self.across] / self.semi_axes, eye[self.across] / self.semi_axes
        # The roots of |start + t towards| = 1.
        square, half = towards @ towards, start @ towards
        root = np.sqrt(np.maximum(half**2 - square * (np.sum(start**2, axis=-1) - 1.0), 0.0))
        found = np.zeros(len(points), dtype=bool)
        for t in ((-half - root) / square, (-half + root) / square):
            along = points[:, self.axis] + t * eye[self.axis]
            found |= (root > 0.0) & (t * np.sqrt(square) > _TOUCHING) & (np.abs(along) < self.length)
        return found


def _turned(start: Array, axis: Array, angle: float) -> Array:
    """A unit vector on its way about an axis by an angle: (N, 3)."""
    return so3.apply(so3.exp(np.linspace(0.0, angle, _AROUND)[:, None] * axis), start)


def _behind_disc(points: Array, normal: Array, eye: Array) -> Mask:
    """True where the unit disc about the origin is between points (N, 3) and the eye."""
    along = -(points @ normal) / (eye @ normal)
    return (along > _TOUCHING) & (np.linalg.norm(points + along[:, None] * eye, axis=-1) < 1.0 - _TOUCHING)
