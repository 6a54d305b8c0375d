"""What is drawn of Euler angles, elliptic cylinders and the pendulum, against definitions and both integrals."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from shapephase import so3
from shapephase.errors import ChartPoleError, ShapeError, WrongObjectError
from shapephase.plots import column_axes, plot_elliptic_cylinders, plot_euler_angles, plot_pendulum
from shapephase.rigid_body import ZXZ, ZYZ, EulerTop

EPS = np.finfo(float).eps
BLACK, BLUE, VERMILION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
MOMENTS = np.array([1.0, 2.0, 3.5])
# About the axis of the smallest moment, either way; about that of the largest, either way.
STARTS = ([0.9, 0.4, 0.5], [-0.9, 0.4, -0.5], [0.3, 0.5, 0.9], [0.3, -0.5, -0.9])


def solid_axes():
    return Figure(figsize=(3.4, 3.9)).add_subplot(projection="3d")


def curves(ax, colour, width=None):
    """Points (N, 2) or (N, 3) of the lines of a colour, pieces of one line for themselves."""
    lines = [
        line
        for line in ax.lines
        if line.get_linestyle() != "None" and line.get_color() == colour and width in (None, line.get_linewidth())
    ]
    return [np.stack(line.get_data_3d() if ax.name == "3d" else line.get_data(), axis=-1) for line in lines]


def start(ax):
    (line,) = [line for line in ax.lines if line.get_marker() == "*"]
    return np.ravel(line.get_data_3d() if ax.name == "3d" else line.get_data())


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def turned(vector, axis, angle):
    """Rodrigues' formula."""
    along = axis * (axis @ vector)
    return along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector)


@pytest.mark.parametrize("chart", [ZXZ, ZYZ])
@pytest.mark.parametrize("angles", [(0.7, 0.9, 1.0), (-1.2, 2.6, 4.0)])
def test_three_arcs_lead_from_the_inertial_to_the_body_axes(chart, angles):
    """Each arc is on the unit circle about its axis, has its angle, and begins where the one before has led."""
    ax = plot_euler_angles(solid_axes(), angles, chart)
    first = np.eye(3)[0 if chart is ZXZ else 1]
    third = np.eye(3)[2]
    # The line of nodes is where the horizontal planes meet, by the attitude alone.
    attitude = chart.attitude(np.array(angles))
    nodes = so3.normalised(np.cross(third, attitude[:, 2]))
    assert np.abs(turned(first, third, angles[0]) - nodes).max() < 8.0 * EPS
    (line,) = curves(ax, GREEN)
    assert np.abs(np.cross(line, nodes)).max() < 8.0 * EPS
    ends = ((first, third, nodes), (third, nodes, attitude[:, 2]), (nodes, attitude[:, 2], attitude @ first))
    arcs = curves(ax, BLUE)
    for arc, angle, (begin, axis, end) in zip(arcs, angles, ends, strict=True):
        unit = arc / np.linalg.norm(arc[0])
        assert np.abs(unit[0] - begin).max() < 16.0 * EPS
        assert np.abs(unit[-1] - end).max() < 16.0 * EPS
        assert np.abs(unit @ axis).max() < 16.0 * EPS
        chords = np.linalg.norm(np.diff(unit, axis=0), axis=-1)
        assert abs(2.0 * np.sum(np.arcsin(0.5 * chords)) - abs(angle)) < 1e3 * EPS
        middle = turned(begin, axis, 0.5 * angle)
        assert np.abs(unit[len(unit) // 2] - middle).max() < 16.0 * EPS
    assert labels(ax)[3:] == [
        f"${letter}$ = {np.degrees(angle):.4g}°".replace("-", "−")
        for letter, angle in zip((r"\varphi", r"\theta", r"\psi"), angles, strict=True)
    ]


def test_flat_euler_angles_show_the_same_in_parallel_projection():
    angles, view = np.array([0.7, 0.9, 1.0]), np.radians([24.0, 28.0])
    ax = plot_euler_angles(column_axes(3.9), angles)
    eye = np.array([np.cos(view[0]) * np.cos(view[1]), np.cos(view[0]) * np.sin(view[1]), np.sin(view[0])])
    right = so3.normalised(np.cross([0.0, 0.0, 1.0], eye))
    nodes = ZXZ.attitude([angles[0], 0.0, 0.0])[:, 0]
    (line,) = curves(ax, GREEN)
    assert line[-1] == pytest.approx(1.25 * np.array([nodes @ right, nodes @ np.cross(eye, right)]), abs=4.0 * EPS)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_the_planes_hide_is_dimmed(side):
    """Of the body's axes what is on the other side of the inertial plane, from above and from below."""
    ax = solid_axes()
    ax.view_init(40.0 * side, 0.0)
    plot_euler_angles(ax, [0.0, 2.0, 0.0])
    thick = [line for line in ax.lines if line.get_color() == VERMILION and line.get_linewidth() == 1.8]
    (hidden,) = [np.array(line.get_data_3d()) for line in thick if line.get_alpha() == 0.25]
    assert np.all(side * hidden[2, 1:] < 0.0)
    assert len(thick) >= 3


@pytest.mark.parametrize("momentum", STARTS)
def test_cylinders_hold_two_combinations_and_their_crossing_holds_energy_and_momentum(momentum):
    top = EulerTop.principal(MOMENTS, momentum)
    ax = plot_elliptic_cylinders(solid_axes(), top)
    i1, i2, i3 = MOMENTS
    pi = np.array(momentum)
    # Marsden and Ratiu (15.11.8) and (15.11.9), of the moments.
    level_k = 0.5 * ((1.0 / i1 - 1.0 / i3) * pi[0] ** 2 + (1.0 / i2 - 1.0 / i3) * pi[1] ** 2)
    share = i3 * (i2 - i1) / (i2 * (i3 - i1))
    level_n = 0.5 * (share * pi[1] ** 2 + pi[2] ** 2)
    for points in curves(ax, BLUE):
        x, y, _ = points.T
        value = 0.5 * ((1.0 / i1 - 1.0 / i3) * x**2 + (1.0 / i2 - 1.0 / i3) * y**2)
        assert np.abs(value / level_k - 1.0).max() < 32.0 * EPS
    for points in curves(ax, VERMILION):
        assert np.abs(0.5 * (share * points[:, 1] ** 2 + points[:, 2] ** 2) / level_n - 1.0).max() < 32.0 * EPS
    drawn = np.concatenate(curves(ax, GREEN))
    assert np.abs(np.sum(drawn**2, axis=-1) / (pi @ pi) - 1.0).max() < 32.0 * EPS
    assert np.abs(np.sum(drawn**2 / MOMENTS, axis=-1) / np.sum(pi**2 / MOMENTS) - 1.0).max() < 32.0 * EPS
    # Both branches, and all of the way round.
    circled = 2 if 2.0 * top.energy * i2 < pi @ pi else 0
    assert {*np.sign(drawn[:, circled])} == {-1.0, 1.0}
    assert start(ax) == pytest.approx(pi, abs=4.0 * EPS)
    assert labels(ax)[:2] == [f"K = {level_k:.4g} J", f"N = {level_n:.4g} kg² m⁴/s²"]


@pytest.mark.parametrize("momentum", STARTS)
def test_the_pendulum_s_curves_are_polhodes(momentum):
    """A point of the portrait is a momentum; the top's own curve has its energy and magnitude, others K alone."""
    top = EulerTop.principal(MOMENTS, momentum)
    ax = plot_pendulum(column_axes(), top)
    i1, i2, i3 = MOMENTS
    k1, k2 = 1.0 / np.sqrt(1.0 / i1 - 1.0 / i3), 1.0 / np.sqrt(1.0 / i2 - 1.0 / i3)
    pi = np.array(momentum)
    r = np.hypot(pi[0] / k1, pi[1] / k2)

    def momenta(points):
        return np.stack([k1 * r * np.cos(points[:, 0]), k2 * r * np.sin(points[:, 0]), points[:, 1]], axis=-1)

    own = np.concatenate([momenta(curve) for curve in curves(ax, GREEN)])
    assert np.abs(np.sum(own**2, axis=-1) / (pi @ pi) - 1.0).max() < 64.0 * EPS
    assert np.abs(np.sum(own**2 / MOMENTS, axis=-1) / np.sum(pi**2 / MOMENTS) - 1.0).max() < 64.0 * EPS
    # The motion stays on the branch that is drawn.
    path = top.body_momentum(np.linspace(0.0, top.period, 40))
    for point in path:
        assert np.linalg.norm(own - point, axis=-1).min() < 0.05
    assert momenta(start(ax)[None])[0] == pytest.approx(pi, abs=8.0 * EPS)
    unstable = i2
    for colour, sign in ((VERMILION, 1.0), (BLUE, -1.0), (BLACK, 0.0)):
        for curve in curves(ax, colour):
            points = momenta(curve)
            # Above, below and at the energy of the middle axis for the momentum of the curve.
            excess = np.sum(points**2 / MOMENTS, axis=-1) - np.sum(points**2, axis=-1) / unstable
            assert np.ptp(excess) < 64.0 * EPS * np.abs(points).max() ** 2
            assert sign == 0.0 or sign * excess[0] > 0.0
            assert sign != 0.0 or np.abs(excess).max() < 64.0 * EPS * np.abs(points).max() ** 2
    assert labels(ax) == [
        "about smallest moment", "about largest moment", "separatrix", "this top", "$t = 0$", "centre", "saddle",
    ]  # fmt: skip


def test_the_arrows_of_the_separatrix_lead_as_the_body_moves():
    top = EulerTop.principal(MOMENTS, [0.3, 0.5, 0.9])
    ax = plot_pendulum(column_axes(), top)
    before, after = np.moveaxis(top.body_momentum(np.array([0.0, 1e-3])), 0, 0)
    k1, k2 = 1.0 / np.sqrt(1.0 - 1.0 / 3.5), 1.0 / np.sqrt(0.5 - 1.0 / 3.5)
    grows = np.arctan2(after[1] / k2, after[0] / k1) > np.arctan2(before[1] / k2, before[0] / k1)
    (upper,) = [text for text in ax.texts if hasattr(text, "arrow_patch") and text.xy[1] > 0.0]
    assert bool(upper.xy[0] > upper.xyann[0]) is bool(grows)


def test_figures_refuse_what_they_cannot_draw():
    flat = column_axes()
    top = EulerTop.principal(MOMENTS, STARTS[0])
    with pytest.raises(ChartPoleError, match="between 0 and pi"):
        plot_euler_angles(flat, [0.3, 0.0, 0.1])
    with pytest.raises(ShapeError, match="angles"):
        plot_euler_angles(flat, [0.3, 0.2])
    with pytest.raises(WrongObjectError, match="chart"):
        plot_euler_angles(flat, [0.3, 0.2, 0.1], "zxz")
    for plot in (plot_elliptic_cylinders, plot_pendulum):
        with pytest.raises(WrongObjectError, match="EulerTop"):
            plot(flat, MOMENTS)
        with pytest.raises(ShapeError, match="two are equal"):
            plot(flat, EulerTop.principal([1.0, 2.0, 2.0], STARTS[0]))
        with pytest.raises(ShapeError, match="another momentum"):
            plot(flat, EulerTop.principal(MOMENTS, [0.0, 0.0, 1.0]))
        with pytest.raises(ShapeError, match="another momentum"):
            plot(flat, EulerTop.principal(MOMENTS, [0.0, 0.0, 0.0]))
    with pytest.raises(ShapeError, match="another momentum"):
        plot_elliptic_cylinders(flat, EulerTop.principal(MOMENTS, [1.0, 0.0, 0.0]))
    with pytest.raises(ShapeError, match="flat"):
        plot_pendulum(solid_axes(), top)
    assert not flat.lines
    # At rest on an axis of the cylinder the portrait is drawn without a curve of its own.
    ax = plot_pendulum(flat, EulerTop.principal(MOMENTS, [0.0, 1.0, 0.0]))
    assert "this top" not in labels(ax)
    assert start(ax) == pytest.approx([0.5 * np.pi, 0.0], abs=4.0 * EPS)
