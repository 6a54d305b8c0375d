"""Figures of the rigid body: polhodes on the momentum sphere, the herpolhode in its annulus, the heavy top's stability.

Each function draws into given Matplotlib axes and returns them. Line styles and markers differ as the colours do (those
of Okabe and Ito), so that nothing is lost in black and white.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, number_argument
from ..arrays import Array, finite_array
from ..elliptic import incomplete_f
from ..errors import ShapeError
from ..rigid_body.euler_top import EulerTop
from ..rigid_body.lagrange_top import LagrangeTop, sleeping_top
from ..rigid_body.poinsot import Poinsot
from ..rigid_body.portrait import equilibria, heteroclinics, polhodes
from ._sphere_axes import SphereAxes
from .plot_style import BLACK, BLUE, GREEN, ORANGE, SKY, SMALL, VERMILION, check_axes, finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LARGEST = {"color": BLUE, "linestyle": "-", "linewidth": 0.9}
SMALLEST = {"color": VERMILION, "linestyle": (0, (4, 1.5)), "linewidth": 0.9}
SEPARATRIX = {"color": BLACK, "linestyle": "-", "linewidth": 1.6}
_AT_REST = {"color": ORANGE, "linestyle": (0, (1, 1)), "linewidth": 2.4}
OWN = {"color": GREEN, "linestyle": "-", "linewidth": 2.8}
_HEADS = np.array([0.25, 0.7])  # [length of a separatrix] arrowheads along it
_TAIL = 10.0  # [1/rate] from its crest: exp(-10) is within a line's width of the foot
_SEPARATRIX_END = 1e-5  # [rad] short of a quarter turn, where the elliptic integral is infinite
_PHASE_STEP = 0.02  # [rad] between points: chords stay within a line's width of the curve
# Points of a herpolhode: smooth at the least, and at the most some two hundred turns, which are not distinguishable.
_MIN_POINTS = 400
_MAX_POINTS = 60_000
_LARGEST_RATIO = 2.2  # I3/I1 at the top: a little above 2, the most of a rigid body


def plot_polhodes(
    ax: Axes, body: EulerTop | ArrayLike, *, energies: ArrayLike | None = None, view: tuple[float, float] = (24.0, 32.0)
) -> Axes:
    """Polhodes, separatrices and equilibria on the sphere of unit momentum; the far side is dimmed.

    Source: Marsden and Ratiu, figure 15.3.1.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection, or three-dimensional ones, in the view they have
    body : (3,) principal moments [kg m^2]; or a top, whose principal axes are taken by ascending moments, and whose own
        polhode is drawn thick, with a star at its start
    energies : (N,) of the curves for |Pi| = 1 [1/(kg m^2)]; None: four about each stable axis
    view : elevation and azimuth of the eye [degrees], for flat axes

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> len(sp.plots.plot_polhodes(ax, [1.0, 2.0, 3.0]).lines) > 6
    True
    """
    check_axes(ax)
    top = body if isinstance(body, EulerTop) else None
    moments = finite_array(body.moments if isinstance(body, EulerTop) else body, "body", (3,), unit="kg m^2")
    points = equilibria(moments)
    sphere = SphereAxes(ax, view)
    levels = spread_energies(moments) if energies is None else np.atleast_1d(finite_array(energies, "energies"))
    draw_polhodes(sphere, moments, levels, np.eye(3), LARGEST, SMALLEST)
    kinds = {point.kind for point in points}
    if "saddle" in kinds:
        for curve in heteroclinics(moments):
            sphere.curve(curve, "separatrix", **SEPARATRIX)
            sphere.arrows(curve, len(curve) * _HEADS, BLACK)
    elif "centre" in kinds:
        around = np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
        first, second = [point.direction for point in points if point.kind == "degenerate"][::2]
        sphere.curve(np.cos(around) * first + np.sin(around) * second, "circle of equilibria", **_AT_REST)
        points = tuple(point for point in points if point.kind == "centre")
    if top is not None and top.magnitude > 0.0:
        _own_polhode(sphere, top)
    markers: dict[str, tuple[str, dict[str, Any]]] = {
        "centre": ("centre", {"marker": "o", "color": BLACK}),
        "saddle": ("saddle", {"marker": "X", "color": VERMILION}),
        "degenerate": ("equilibrium, as every point", {"marker": "s", "color": ORANGE}),
    }
    for point in points:
        label, style = markers[point.kind]
        # Behind the top's own start, which may be there, too.
        sphere.point(point.direction, label, behind=True, **style)
    for axis, end in enumerate(np.eye(3) * np.copysign(1.0, sphere.eye)):
        sphere.text(end, f"$I_{axis + 1}$ = {moments[axis]:.3g}", 0.24)
    sphere.finish(r"$\Pi_{}/|\Pi|$ [1]", "momentum in the body: polhodes; moments in kg m²")
    return ax


def plot_herpolhode(ax: Axes, top: EulerTop, periods: float = 5.0) -> Axes:
    """The herpolhode in the invariable plane, between the two circles of its annulus.

    The origin is the foot of the normal, which points to the eye; the first axis points to the curve at t = 0, marked
    by a star. On the separatrix the whole spiral is drawn, whatever the periods; a steady rotation is a point.

    Source: Marsden and Ratiu, section 15.5; theory.md I5.

    Parameters
    ----------
    ax : flat axes
    periods : of the body momentum, above 0; of more than some two hundred turns the first are drawn

    Raises
    ------
    ShapeError
        If the number of periods is not above 0, or the top has no momentum.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> len(sp.plots.plot_herpolhode(ax, top, 2).lines) >= 1
    True
    """
    check_object(top, "EulerTop", "top")
    check_axes(ax)
    count = number_argument(periods, "periods")
    if not count > 0.0:
        raise ShapeError(f"periods: a positive number of them is drawn, got {periods}")
    poinsot = Poinsot(top)
    inner, outer = poinsot.annulus
    around = np.linspace(0.0, 2.0 * np.pi, 361)
    if outer > 0.0:
        times = herpolhode_times(top, count)
        radius, angle = poinsot.herpolhode_radius(times), poinsot.herpolhode_angle(times)
        ax.plot(radius * np.cos(angle), radius * np.sin(angle), color=BLUE, linewidth=1.0, label="herpolhode")
        for circle, label in ((outer, f"annulus, {inner:.3g} to {outer:.3g} rad/s"), (inner, None)):
            x, y = circle * np.cos(around), circle * np.sin(around)
            ax.plot(x, y, color=VERMILION, linestyle=(0, (4, 2)), linewidth=1.2, label=label)
    start = float(poinsot.herpolhode_radius(0.0))
    ax.plot([start], [0.0], marker="*", color=GREEN, markersize=9, linestyle="none", label="$t = 0$")
    ax.plot([0.0], [0.0], marker="+", color=BLACK, markersize=8, linestyle="none", label="foot of the normal")
    reach = 1.1 * (outer or poinsot.distance)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set_xlabel(r"$\omega_1$ in the invariable plane [rad/s]", fontsize=SMALL)
    ax.set_ylabel(r"$\omega_2$ in the invariable plane [rad/s]", fontsize=SMALL)
    finish(ax, title="herpolhode: where the angular velocity touches the plane")
    return ax


def plot_heavy_top_stability(ax: Axes, tops: ArrayLike = (), *, fastest: float = 4.0) -> Axes:
    """Stability of the upright Lagrange top: I3/I1 against Pi3/sqrt(M g l I1), both without unit.

    Stable for Pi3² >= 4 M g l I1, whatever I3, at equality too: the verdict of `sleeping_top`. At I3 = 2 I1 eigenvalues
    are double for every Pi3; beyond the threshold they are imaginary there as elsewhere. No top with weight reaches
    that line, since I1 is taken about the point of support: I3 < 2 I1.

    Source: Marsden and Ratiu, theorem 15.10.1; theory.md M6 for equality, M-E10 for the spectrum.

    Parameters
    ----------
    ax : flat axes
    tops : (N, 2) tops to mark, Pi3/sqrt(M g l I1) and I3/I1 > 0
    fastest : end of the axis of Pi3, above 2

    Raises
    ------
    MissingExtraError, ShapeError, SingularInertiaError
        For a ratio of moments that is not above 0.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> sp.plots.plot_heavy_top_stability(ax).get_ylabel()
    '$I_3 / I_1$ [1]'
    """
    check_axes(ax)
    marked = finite_array(tops, "tops") if np.size(tops) == 0 else finite_array(tops, "tops", (2,))
    marked = marked.reshape(-1, 2)
    end = number_argument(fastest, "fastest")
    if not end > 2.0:
        raise ShapeError(f"fastest: the chart must reach beyond the threshold 2, got {fastest}")
    end = max(end, 1.05 * float(np.abs(marked[:, 0]).max(initial=0.0)))
    highest = max(_LARGEST_RATIO, 1.05 * float(marked[:, 1].max(initial=0.0)))
    ratios = np.array([0.0, highest])
    for sign in (-1.0, 1.0):
        label = "stable" if sign > 0.0 else None
        ax.fill_betweenx(ratios, 2.0 * sign, end * sign, facecolor=SKY, alpha=0.45, linewidth=0.0, label=label)
    unstable = {"facecolor": "#F7E1C0", "edgecolor": ORANGE, "hatch": "///", "linewidth": 0.0}
    ax.fill_betweenx(ratios, -2.0, 2.0, label="unstable", **unstable)
    for sign in (-1.0, 1.0):
        label = r"$\Pi_3^2 = 4\,M g \ell I_1$" if sign > 0.0 else None
        ax.plot([2.0 * sign, 2.0 * sign], ratios, color=BLACK, linewidth=1.8, label=label)
    ax.plot(
        [-end, end], [2.0, 2.0], color=BLUE, linewidth=1.5, linestyle=(0, (1, 1)), label="$I_3 = 2I_1$, double roots"
    )
    # In units of I1 and M g l.
    verdicts = np.array([sleeping_top(LagrangeTop(1.0, ratio, 1.0), spin).verdict for spin, ratio in marked.tolist()])
    for stable, label, style in ((True, "stable top", "o"), (False, "unstable top", "X")):
        chosen = marked[(verdicts == "stable") == stable]
        if len(chosen):
            colour = GREEN if stable else VERMILION
            ax.plot(chosen[:, 0], chosen[:, 1], marker=style, color=colour, linestyle="none", markersize=5, label=label)
    ax.set(xlim=(-end, end), ylim=(0.0, highest))
    ax.set_xlabel(r"$\Pi_3 / \sqrt{M g \ell I_1}$ [1]", fontsize=SMALL)
    ax.set_ylabel("$I_3 / I_1$ [1]", fontsize=SMALL)
    finish(ax, title="the upright Lagrange top")
    return ax


def _own_polhode(sphere: SphereAxes, top: EulerTop) -> None:
    """The polhode of a top and its start."""
    orbit = top.orbit
    if top.regime not in ("steady", "spherical"):
        points = top.body_momentum(polhode_times(top)) @ top.axes / top.magnitude
        sphere.curve(points, "this top", **OWN)
    sphere.point(orbit.start / orbit.magnitude, "$t = 0$", marker="*", color=GREEN, markersize=11)


def draw_polhodes(
    sphere: SphereAxes,
    moments: Array,
    levels: Array,
    axes: Array,
    about_largest: dict[str, Any],
    about_smallest: dict[str, Any],
) -> None:
    """Draw the polhodes of some energies of a body with these moments about axes (3, 3), in two styles."""
    middle = np.median(moments)
    for level, pair in zip(levels, polhodes(moments, levels) if len(levels) else ()):
        largest = 2.0 * level * middle < 1.0 or middle == np.min(moments)
        label = "about largest moment" if largest else "about smallest moment"
        for curve in pair:
            sphere.curve(curve @ axes.T, label, **(about_largest if largest else about_smallest))


def spread_energies(moments: Array) -> Array:
    """Energies of four curves about each stable axis, at equal angles from the axis to the separatrix."""
    least, middle, most = np.sort(1.0 / moments)
    if least == most:
        return np.zeros(0)
    levels = []
    for own, other in ((least, most), (most, least)):
        angle = np.arcsin(np.sqrt((middle - own) / (other - own))) * np.array([0.2, 0.4, 0.6, 0.8])
        levels += [*(0.5 * (own + (other - own) * np.sin(angle) ** 2))] if middle != own else []
    return np.array(levels)


def polhode_times(top: EulerTop) -> Array:
    """Times of points of the whole polhode at even amplitudes, on the separatrix half a turn of them: (N,) [s]."""
    half = 0.5 * np.pi - _SEPARATRIX_END if top.regime == "separatrix" else np.pi
    u = incomplete_f(np.linspace(-half, half, 721), top.complement)
    return (u - top.orbit.phase) / top.rate


def herpolhode_times(top: EulerTop, periods: float) -> Array:
    """Times fine enough both for the rotation about mu and for the waves between the circles."""
    fastest = max(top.rate, top.magnitude / float(top.moments[0]))
    if top.regime == "separatrix":
        start, end = (np.array([-_TAIL, _TAIL]) - top.orbit.phase) / top.rate
    else:
        start, end = 0.0, min(periods * top.period, _MAX_POINTS * _PHASE_STEP / fastest)
    phases = (end - start) * fastest
    return np.linspace(start, end, int(np.clip(phases / _PHASE_STEP, _MIN_POINTS, _MAX_POINTS)))
