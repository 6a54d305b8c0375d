"""The figures' artists carry the right numbers: on the sphere, on the energy level, between the circles; not pixels."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

from shapephase.errors import MissingExtraError, ShapeError, SingularInertiaError
from shapephase.plots import plot_heavy_top_stability, plot_herpolhode, plot_polhodes
from shapephase.plots.polhode_plots import herpolhode_times
from shapephase.rigid_body import EulerTop, LagrangeTop, Poinsot, upright_potential

MOMENTS = (2.0, 1.0, 4.0)
ROUND_LARGEST, ROUND_SMALLEST, OWN = "#0072B2", "#D55E00", "#009E73"
TOPS = {
    "largest": EulerTop.principal((1.0, 2.0, 3.0), (0.3, 0.5, -0.9)),
    "smallest": EulerTop.principal((3.0, 2.0, 1.0), (0.5, 0.6, -1.4)),
    "separatrix": EulerTop.principal((3.0, 6.0, 8.0), (0.5, 0.3, 1.0)),
    "oblate": EulerTop.principal((1.0, 1.0, 1.7), (0.3, 0.5, -0.8)),
}


def solid_axes():
    return Figure(figsize=(3.4, 3.8)).add_subplot(projection="3d")


def flat_axes():
    return Figure(figsize=(3.4, 3.8)).add_subplot()


def curves(ax, colour=None):
    """The points of the lines of a colour, (N, 2) or (N, 3) each."""
    lines = [line for line in ax.lines if line.get_linestyle() != "None" and colour in (None, line.get_color())]
    return [np.stack(line.get_data_3d() if ax.name == "3d" else line.get_data(), axis=-1) for line in lines]


def markers(ax, style):
    lines = [line for line in ax.lines if line.get_marker() == style]
    return np.concatenate([np.stack(x.get_data_3d() if ax.name == "3d" else x.get_data(), axis=-1) for x in lines])


def energy(points, moments):
    return 0.5 * np.sum(points**2 / np.asarray(moments), axis=-1)


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_curves_lie_on_the_sphere_and_on_their_energy_g8():
    levels = [0.15, 0.2, 0.3, 0.45]
    ax = plot_polhodes(solid_axes(), MOMENTS, energies=levels)
    for colour, expected in ((ROUND_LARGEST, levels[:2]), (ROUND_SMALLEST, levels[2:])):
        found = curves(ax, colour)
        assert all(np.linalg.norm(c, axis=-1) == pytest.approx(np.ones(len(c)), abs=1e-14) for c in found)
        assert all(np.ptp(energy(c, MOMENTS)) < 1e-14 for c in found)
        assert {round(float(energy(c[0], MOMENTS)), 12) for c in found} == set(expected)
    whole = np.concatenate(curves(ax, "#000000"))
    assert energy(whole, MOMENTS) == pytest.approx(np.full(len(whole), 0.25), rel=1e-14)
    assert sorted(map(tuple, markers(ax, "o"))) == sorted([(0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
    assert sorted(map(tuple, markers(ax, "X"))) == [(-1, 0, 0), (1, 0, 0)]
    assert labels(ax) == ["about largest moment", "about smallest moment", "separatrix", "saddle", "centre"]


def test_the_usual_energies_go_round_each_stable_axis_g8():
    ax = plot_polhodes(solid_axes(), MOMENTS)
    for colour, low, high in ((ROUND_LARGEST, 0.125, 0.25), (ROUND_SMALLEST, 0.25, 0.5)):
        found = {round(float(energy(c[0], MOMENTS)), 12) for c in curves(ax, colour)}
        assert len(found) == 4
        assert low < min(found) < max(found) < high
        own, other = (0.5 / 4.0, 0.5) if low == 0.125 else (0.5, 0.5 / 4.0)
        angles = np.arcsin(np.sqrt((np.array(sorted(found, key=lambda h: abs(h - own))) - own) / (other - own)))
        whole = np.arcsin(np.sqrt((0.25 - own) / (other - own)))
        assert angles / whole == pytest.approx([0.2, 0.4, 0.6, 0.8], abs=1e-9)


@pytest.mark.parametrize("view", [(24.0, 32.0), (90.0, 0.0), (-15.0, 200.0)])
def test_the_far_side_is_dimmed_g8(view):
    ax = solid_axes()
    ax.view_init(*view)
    plot_polhodes(ax, MOMENTS)
    elevation, azimuth = np.radians(view)
    eye = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    for line in [line for line in ax.lines if line.get_alpha() is not None]:
        heights = np.stack(line.get_data_3d(), axis=-1) @ eye
        # Neighbouring pieces share the point at the limb, which is a step beyond it.
        assert heights.min() > -0.06 if line.get_alpha() == 1.0 else heights.max() < 0.06
    handles = ax.get_legend().legend_handles
    assert labels(ax) == ["about largest moment", "about smallest moment", "separatrix", "saddle", "centre"]
    assert [handle.get_alpha() for handle in handles] == [1.0] * 5


@pytest.mark.parametrize(
    ("view", "right", "up"),
    [((0.0, 90.0), [-1, 0, 0], [0, 0, 1]), ((90.0, 0.0), [0, 1, 0], [-1, 0, 0]), ((-90.0, 0.0), [0, 1, 0], [1, 0, 0])],
)
def test_flat_axes_show_the_same_points_in_parallel_projection_g8(view, right, up):
    solid = solid_axes()
    solid.view_init(*view)
    plot_polhodes(solid, MOMENTS)
    flat = plot_polhodes(flat_axes(), MOMENTS, view=view)
    assert len(solid.lines) == len(flat.lines)
    for one, other in zip(curves(solid), curves(flat)):
        assert other == pytest.approx(one @ np.transpose([right, up]), abs=1e-14)


def test_pieces_of_a_curve_join_at_the_limb_g8():
    ax = plot_polhodes(solid_axes(), MOMENTS, energies=[0.24])
    pieces = curves(ax, ROUND_LARGEST)
    assert len(pieces) > 2
    for this, piece in enumerate(pieces):
        ends = np.concatenate([[p[0], p[-1]] for other, p in enumerate(pieces) if other != this] + [piece[:1]])
        assert np.linalg.norm(ends - piece[-1], axis=-1).min() < 1e-14


def test_heads_on_the_separatrix_point_the_way_the_momentum_goes_g8():
    """By Euler's equations alone: Pi' = Pi x I^-1 Pi."""
    moments, view = np.array([1.0, 2.0, 3.0]), (24.0, 32.0)
    ax = plot_polhodes(flat_axes(), moments, view=view)
    elevation, azimuth = np.radians(view)
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    screen = np.stack([right, np.cross(eye, right)])
    heads = [text for text in ax.texts if hasattr(text, "arrow_patch")]
    assert len(heads) >= 3
    for head in heads:
        x, y = 0.5 * (np.array(head.xy) + head.xyann)
        point = x * screen[0] + y * screen[1] + np.sqrt(1.0 - x * x - y * y) * eye
        assert energy(point, moments) == pytest.approx(0.25, abs=2e-3)
        onward = screen @ np.cross(point, point / moments)
        step = np.array(head.xy) - head.xyann
        assert step @ onward > 0.99 * np.linalg.norm(step) * np.linalg.norm(onward)


@pytest.mark.parametrize("name", TOPS)
def test_the_polhode_of_a_top_is_drawn_whole_g8(name):
    top = TOPS[name]
    ax = plot_polhodes(solid_axes(), top)
    own = np.concatenate(curves(ax, OWN))
    assert np.linalg.norm(own, axis=-1) == pytest.approx(np.ones(len(own)), abs=1e-14)
    assert energy(own, top.moments) == pytest.approx(np.full(len(own), top.energy / top.magnitude**2), rel=1e-13)
    far = 12.0 / top.rate if name == "separatrix" else top.period
    passed = top.body_momentum(np.linspace(-far, far, 200)) @ top.axes / top.magnitude
    assert max(np.linalg.norm(own - point, axis=-1).min() for point in passed) < 0.01
    assert markers(ax, "*") == pytest.approx(top.body_momentum(0.0)[None] @ top.axes / top.magnitude, abs=1e-15)
    assert {"this top", "$t = 0$"} <= set(labels(ax))
    assert OWN in {line.get_color() for line in plot_polhodes(flat_axes(), top).lines}


def test_degenerate_bodies_g8():
    ax = plot_polhodes(solid_axes(), (1.0, 2.0, 1.0))
    assert labels(ax) == ["about largest moment", "circle of equilibria", "centre"]
    assert len({round(float(energy(c[0], (1.0, 2.0, 1.0))), 12) for c in curves(ax, ROUND_LARGEST)}) == 4
    assert curves(ax, ROUND_SMALLEST) == []
    circle = np.concatenate(curves(ax, "#E69F00"))
    assert circle[:, 1] == pytest.approx(np.zeros(len(circle)), abs=0.0)
    assert np.linalg.norm(circle, axis=-1) == pytest.approx(np.ones(len(circle)), abs=1e-15)
    assert sorted(map(tuple, markers(ax, "o"))) == [(0, -1, 0), (0, 1, 0)]
    assert labels(plot_polhodes(solid_axes(), (1.0, 1.0, 2.0), energies=[0.5]))[0] == "about largest moment"
    ax = plot_polhodes(solid_axes(), (1.0, 2.0, 2.0))
    assert labels(ax) == ["about smallest moment", "circle of equilibria", "centre"]
    assert len({round(float(energy(c[0], (1.0, 2.0, 2.0))), 12) for c in curves(ax, ROUND_SMALLEST)}) == 4
    spherical = EulerTop.principal((2.0, 2.0, 2.0), (0.3, 0.5, -0.8))
    ax = plot_polhodes(flat_axes(), spherical)
    assert labels(ax) == ["$t = 0$", "equilibrium, as every point"]
    ax = plot_polhodes(flat_axes(), EulerTop.principal((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)))
    assert "$t = 0$" not in labels(ax)
    ax = plot_polhodes(solid_axes(), EulerTop.principal((1.0, 2.0, 3.0), (0.0, -2.0, 0.0)))
    assert markers(ax, "*") == pytest.approx(np.array([[0.0, -1.0, 0.0]]), abs=0.0)


@pytest.mark.parametrize("name", TOPS)
def test_the_herpolhode_is_drawn_between_its_circles_i5(name):
    top = TOPS[name]
    inner, outer = Poinsot(top).annulus
    ax = plot_herpolhode(flat_axes(), top, 6.0)
    (curve,) = curves(ax, ROUND_LARGEST)
    circles = [np.unique(np.linalg.norm(c, axis=-1).round(12)) for c in curves(ax, ROUND_SMALLEST)]
    assert np.concatenate(circles) == pytest.approx([outer, inner], abs=1e-12)
    radius = np.linalg.norm(curve, axis=-1)
    assert radius.min() == pytest.approx(inner, abs=2e-3 * outer)
    assert radius.max() == pytest.approx(outer, rel=1e-3)
    assert inner - 1e-14 <= radius.min() <= radius.max() <= outer + 1e-14
    # No step longer than a line can hide, so that circle and curve stay round.
    assert np.linalg.norm(np.diff(curve, axis=0), axis=-1).max() < 0.06 * outer
    turned = np.unwrap(np.arctan2(curve[:, 1], curve[:, 0]))
    if name != "separatrix":
        assert turned[-1] - turned[0] == pytest.approx(6.0 * Poinsot(top).angle_per_period, abs=1e-9)
    start = Poinsot(top).herpolhode_radius(0.0)
    assert markers(ax, "*") == pytest.approx(np.array([[start, 0.0]]), abs=0.0)
    assert np.linalg.norm(curve - [start, 0.0], axis=-1).min() < 0.02 * outer
    assert ax.get_aspect() == 1.0
    assert "[rad/s]" in ax.get_xlabel()
    assert "[rad/s]" in ax.get_ylabel()
    assert f"{inner:.3g} to {outer:.3g} rad/s" in labels(ax)[1]


@pytest.mark.parametrize("momentum", [(0.0, 0.0, 2.0), (0.0, 2.0, 0.0)])
def test_a_steady_rotation_is_drawn_as_a_point_i5(momentum):
    ax = plot_herpolhode(flat_axes(), EulerTop.principal((1.0, 2.0, 3.0), momentum))
    assert curves(ax) == []
    assert markers(ax, "*") == pytest.approx(np.zeros((1, 2)), abs=0.0)
    assert labels(ax) == ["$t = 0$", "foot of the normal"]
    assert ax.get_xlim()[1] > 0.0


def test_heavy_top_chart_has_the_threshold_and_the_double_roots():
    tops = [(2.5, 0.4), (-2.1, 1.0), (1.9, 1.5), (0.0, 0.2)]
    ax = plot_heavy_top_stability(flat_axes(), tops)
    vertical = [c for c in curves(ax) if np.ptp(c[:, 0]) == 0.0]
    for line in vertical:
        # Pi3^2 = 4 M g l I1 in units of M g l I1, over the whole height.
        assert line[:, 0] ** 2 == pytest.approx([4.0, 4.0], abs=0.0)
        assert tuple(line[:, 1]) == ax.get_ylim()
    assert {line[0, 0] for line in vertical} == {-2.0, 2.0}
    (double,) = [c for c in curves(ax) if np.ptp(c[:, 1]) == 0.0]
    assert tuple(double[:, 1]) == (2.0, 2.0)
    regions = {area.get_label(): area.get_paths()[0].vertices for area in ax.collections}
    assert np.abs(regions["unstable"][:, 0]).max() == 2.0
    assert regions["stable"][:, 0].min() == 2.0
    assert sorted(map(tuple, markers(ax, "o"))) == [(-2.1, 1.0), (2.5, 0.4)]
    assert sorted(map(tuple, markers(ax, "X"))) == [(0.0, 0.2), (1.9, 1.5)]
    # The same verdict as the discriminant of the characteristic equation, theory.md M-E10, I1 = M g l = 1.
    for spin, ratio in tops:
        roots = np.roots([1.0, 0.0, (1.0 + (1.0 - ratio) ** 2) * (spin / ratio) ** 2 - 2.0, 0.0,
                          ((1.0 - ratio) * (spin / ratio) ** 2 + 1.0) ** 2])  # fmt: skip
        assert (np.abs(roots.real).max() < 1e-6) == (abs(spin) > 2.0)
    assert labels(ax)[:4] == ["stable", "unstable", r"$\Pi_3^2 = 4\,M g \ell I_1$", "$I_3 = 2I_1$, double roots"]


def test_heavy_top_chart_and_the_sleeping_top_agree_at_the_threshold_too():
    """At Pi3² = 4 M g l I1 the potential has a minimum of fourth order: it is stable, on both sides."""
    ax = plot_heavy_top_stability(flat_axes(), [(2.0, 0.5), (-2.0, 1.5), (1.999, 0.5)])
    assert sorted(map(tuple, markers(ax, "o"))) == [(-2.0, 1.5), (2.0, 0.5)]
    assert sorted(map(tuple, markers(ax, "X"))) == [(1.999, 0.5)]
    top, tilts = LagrangeTop(1.0, 0.5, 1.0), np.array([0.01, 0.1, 0.2])
    assert np.all(upright_potential(top, 2.0, tilts) > 0.0)
    assert upright_potential(top, 1.999, tilts)[0] < 0.0
    with pytest.raises(SingularInertiaError, match="above"):
        plot_heavy_top_stability(flat_axes(), [(3.0, 0.0)])


def test_heavy_top_chart_grows_with_its_tops():
    ax = plot_heavy_top_stability(flat_axes(), [(-9.0, 3.0)])
    assert ax.get_xlim()[0] < -9.0
    assert ax.get_ylim()[1] > 3.0
    assert plot_heavy_top_stability(flat_axes(), fastest=6.0).get_xlim() == (-6.0, 6.0)


def test_figures_are_complete_and_draw_without_a_warning():
    for make in (flat_axes, solid_axes):
        plot_polhodes(make(), TOPS["largest"]).figure.draw_without_rendering()
    for ax in (plot_herpolhode(flat_axes(), TOPS["separatrix"]), plot_heavy_top_stability(flat_axes())):
        ax.figure.draw_without_rendering()
    # The legend under the sphere is inside the axes, where nothing cuts it off.
    ax = flat_axes()
    plot_polhodes(ax, TOPS["largest"]).figure.draw_without_rendering()
    legend, frame = ax.get_legend().get_window_extent(), ax.get_window_extent()
    assert legend.y0 >= frame.y0 - 1.0
    bottom = ax.transData.transform((0.0, -1.0))[1]
    assert legend.y1 < bottom


def test_what_cannot_be_drawn_is_refused():
    top = TOPS["largest"]
    for draw in (lambda ax: plot_polhodes(ax, MOMENTS), lambda ax: plot_herpolhode(ax, top), plot_heavy_top_stability):
        with pytest.raises(ShapeError, match="ax"):
            draw(None)
    with pytest.raises(ShapeError, match="principal"):
        plot_polhodes(flat_axes(), (1.0, -2.0, 3.0))
    with pytest.raises(ShapeError, match="energies"):
        plot_polhodes(flat_axes(), MOMENTS, energies=[0.7])
    with pytest.raises(ShapeError, match="periods"):
        plot_herpolhode(flat_axes(), top, 0.0)
    with pytest.raises(ShapeError, match="fastest"):
        plot_heavy_top_stability(flat_axes(), fastest=2.0)
    with pytest.raises(ShapeError, match="tops"):
        plot_heavy_top_stability(flat_axes(), [1.0, 2.0, 3.0])


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    ax = flat_axes()
    monkeypatch.setitem(sys.modules, "matplotlib.axes", None)
    with pytest.raises(MissingExtraError, match=r"shapephase\[plot\]"):
        plot_polhodes(ax, MOMENTS)


def test_the_start_of_a_steady_top_is_not_hidden_by_the_equilibrium_that_it_is():
    """The legend named a star that nobody saw."""
    for momentum in ((0.0, 0.0, 2.0), (0.0, 2.0, 0.0)):
        ax = plot_polhodes(flat_axes(), EulerTop.principal((1.0, 2.0, 3.0), momentum))
        marks = [line for line in ax.lines if line.get_linestyle() == "None"]
        (star,) = [line for line in marks if line.get_marker() == "*"]
        (under,) = [line for line in marks if line is not star and np.array_equal(line.get_xydata(), star.get_xydata())]
        assert under.get_zorder() < star.get_zorder()


def test_of_a_herpolhode_of_very_many_turns_the_first_are_drawn():
    """A nearly symmetric body next to a circle of equilibria goes round 1e10 times in its period."""
    top = EulerTop.principal((1.0, 1.0, 1.9999999), (1e-9, 1.0, 1e-9))
    times = herpolhode_times(top, 5.0)
    turns = np.ptp(Poinsot(top).herpolhode_angle(times[:: len(times) - 1])) / (2.0 * np.pi)
    assert 100.0 < turns < 400.0
    # Each step is so short that its chord is not seen.
    assert turns * 2.0 * np.pi / len(times) < 0.021
    short = EulerTop.principal((1.0, 2.0, 3.0), (0.3, 0.5, 0.9))
    assert herpolhode_times(short, 5.0)[-1] == pytest.approx(5.0 * short.period, rel=1e-15)
