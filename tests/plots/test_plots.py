"""Every figure's artists carry the numbers that they should: the data drawn are compared, not pixels."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import pairwise, product

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import shapephase as sp
from shapephase import plots, so3, sphere
from shapephase.bounds.energy import energy_along
from shapephase.bounds.regimes import regime_certificate
from shapephase.deformation.gauge import named_gauge
from shapephase.errors import GaugeError, MissingExtraError, ShapeError, UnknownNameError
from shapephase.examples import MOTIONS, astronaut_leg_swing, cat_righting, satellite_sweep
from shapephase.plots._joint_styles import other_side
from shapephase.plots._sphere_area import enclosed_cells, outlines
from shapephase.plots.motion_plots import _pieces
from shapephase.plots.plot_style import axes_image
from shapephase.rigid_body import EulerTop
from support.long_runs import full_but

BLACK, BLUE, VERMILION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
UPRIGHT = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
UPSIDE_DOWN = so3.exp(np.array([np.pi, 0.0, 0.0]))


@pytest.fixture(scope="module")
def cat():
    return sp.load_body("cat")


@pytest.fixture(scope="module")
def satellite():
    return sp.load_body("satellite")


@pytest.fixture(scope="module")
def motions(cat, satellite):
    astronaut = sp.articulated(sp.load_body("astronaut"), astronaut_leg_swing())
    return {
        "cat": sp.reconstruct(sp.articulated(cat, cat_righting(0.5)), [0.02, 0.01, 0.03], UPSIDE_DOWN),
        "astronaut": sp.reconstruct(astronaut, [0.5, 2.0, 3.0]),
        "satellite": sp.reconstruct(sp.articulated(satellite, satellite_sweep()), [1.0, 2.5, 4.0]),
        "spinning": sp.reconstruct(sp.articulated(satellite, satellite_sweep()), [3.0, 8.0, 30.0]),
    }


def flat_axes(height=4.3):
    return plots.column_axes(height)


def solid_axes():
    return Figure(figsize=(3.4, 4.6)).add_subplot(projection="3d")


def xy(line):
    return np.stack(line.get_data_3d() if hasattr(line, "get_data_3d") else line.get_data(), axis=-1)


def drawn(ax, colour, width=None):
    """The points of all lines of a colour (and width), in the order in which they were drawn."""
    lines = [line for line in ax.lines if line.get_color() == colour and line.get_marker() in ("None", "")]
    lines = [line for line in lines if width is None or line.get_linewidth() == width]
    return [xy(line) for line in lines]


def marked(ax, marker, colour):
    found = [xy(line) for line in ax.lines if line.get_marker() == marker and line.get_color() == colour]
    return np.concatenate(found) if found else np.zeros((0, 2))


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def by_label(ax, label):
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return np.asarray(line.get_ydata(), dtype=float)


def beginning(ax, word):
    """The data of the line whose label begins so."""
    (line,) = [line for line in ax.lines if line.get_label().startswith(word)]
    return np.asarray(line.get_ydata(), dtype=float)


def screen(view):
    elevation, azimuth = np.radians(view)
    rise, level = np.sin(elevation), np.cos(elevation)
    right = [-np.sin(azimuth), np.cos(azimuth), 0.0]
    up = [-rise * np.cos(azimuth), -rise * np.sin(azimuth), level]
    return np.array([right, up]), np.array([level * np.cos(azimuth), level * np.sin(azimuth), rise])


def joined(pieces):
    """Pieces that share their ends, as one curve."""
    for one, other in pairwise(pieces):
        assert other[0] == pytest.approx(one[-1], abs=1e-14)
    return np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])


def shaded_area(ax, view):
    """The solid angle that the shading covers, winding numbers counted: read off the drawn outlines alone."""
    flat, eye = screen(view)
    total = 0.0
    for patch in [patch for patch in ax.patches if (patch.get_gid() or "").startswith("area")]:
        _, winding, side = patch.get_gid().split()
        for outline in patch.get_path().to_polygons(closed_only=False):
            corners = outline[:-1]
            depth = np.sqrt(np.maximum(0.0, 1.0 - np.sum(corners**2, axis=-1)))
            points = corners @ flat + (1.0 if side == "near" else -1.0) * depth[:, None] * eye
            total += int(winding) * sphere.triangle_area(points[0], points[1:-1], points[2:]).sum()
    return total


@pytest.mark.parametrize("name", full_but(["cat", "astronaut", "satellite", "spinning"], "astronaut", "spinning"))
def test_the_curve_is_the_body_momentum_on_its_sphere(motions, name):
    motion = motions[name]
    ax = plots.plot_momentum_curve(solid_axes(), motion, "base")
    curve = joined(drawn(ax, BLACK, 1.5))
    assert np.linalg.norm(curve, axis=-1) == pytest.approx(np.ones(len(curve)), abs=1e-14)
    times = np.linspace(0.0, motion.duration, 500)
    momenta = motion.body_momentum(times)
    expected = momenta / np.linalg.norm(motion.momentum)
    # Every point of the motion lies on a chord of the curve, and the curve has no step that is seen.
    along = np.diff(curve, axis=0)
    assert np.linalg.norm(along, axis=-1).max() < 0.025
    assert max(distance_to_chords(point, curve) for point in expected) < 2e-4
    # And the other way round: nothing else is drawn.
    assert max(distance_to_chords(point, expected) for point in curve[::7]) < 2e-3
    assert curve[[0, -1]] == pytest.approx(expected[[0, -1]], abs=1e-9)
    assert marked(ax, "*", GREEN) == pytest.approx(expected[:1], abs=1e-9)
    assert marked(ax, "s", VERMILION) == pytest.approx(expected[-1:], abs=1e-9)


def distance_to_chords(point, curve):
    start, step = curve[:-1], np.diff(curve, axis=0)
    share = np.sum((point - start) * step, axis=-1) / np.maximum(np.sum(step**2, axis=-1), 1e-300)
    return np.linalg.norm(start + np.clip(share, 0.0, 1.0)[:, None] * step - point, axis=-1).min()


class _UnsetMemory:
    """NumPy whose new arrays hold the largest numbers until they are set."""

    def __getattr__(self, name):
        return getattr(np, name)

    def empty(self, shape):
        return np.full(shape, np.finfo(float).max)


def test_the_limits_read_no_memory_that_was_never_set(motions, monkeypatch):
    """Matplotlib stores polygons of different lengths in one array and takes the limits of the axes from all of it."""
    monkeypatch.setattr("mpl_toolkits.mplot3d.art3d.np", _UnsetMemory())
    ax = plots.plot_momentum_curve(solid_axes(), motions["cat"], "base")
    assert np.abs(ax.dataLim.get_points()).max() <= 1.0 + 1e-12
    ax = plots.plot_caustic(solid_axes(), (4.0, 2.0, 1.0), circles=6)
    assert np.abs(ax.dataLim.get_points()).max() <= np.pi + 1e-12


@pytest.mark.parametrize("gauge", ["horizontal", "principal", "mean_body"])
def test_the_curve_in_a_gauge_is_the_momentum_in_the_gauged_description(motions, gauge):
    motion = motions["satellite"]
    seen = named_gauge(motion.deformation, gauge)
    other = sp.reconstruct(seen, motion.momentum, seen.frame(0.0).T, tolerance=1e-11)
    expected = other.body_momentum(np.linspace(0.0, motion.duration, 200)) / np.linalg.norm(motion.momentum)
    ax = plots.plot_momentum_curve(solid_axes(), motion, gauge)
    curve = joined(drawn(ax, BLACK, 1.5))
    assert max(distance_to_chords(point, curve) for point in expected) < 2e-4
    assert curve[[0, -1]] == pytest.approx(expected[[0, -1]], abs=1e-8)
    assert ax.get_legend().get_title().get_text().startswith(f"{gauge} gauge")


@pytest.mark.parametrize(
    ("name", "gauge"),
    full_but(
        [*product(("cat", "astronaut", "satellite"), ("horizontal", "base", "principal")), ("spinning", "horizontal")],
        *[("cat", "horizontal"), ("astronaut", "base"), ("satellite", "principal"), ("spinning", "horizontal")],
    ),
)
def test_the_shaded_area_is_the_solid_angle(motions, name, gauge):
    motion, view = motions[name], (20.0, 35.0)
    ax = plots.plot_momentum_curve(flat_axes(), motion, gauge, view=view)
    angle = float(sp.split(motion, gauge).solid_angle)
    tolerance = 2e-3 * (1.0 + abs(angle))
    assert shaded_area(ax, view) == pytest.approx(angle, abs=tolerance)
    assert f"solid angle {angle:+.4g} sr".replace("-", "−") in ax.get_legend().get_title().get_text()


def test_the_shaded_area_is_one_outline_and_the_figure_small():
    """Half a sphere was 1,300 cells with their sides drawn: megabytes of them."""
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 14.0), [0.6, 0.9, 0.5])
    ax = plots.plot_momentum_curve(plots.column_axes(3.9), motion, "base")
    areas = [patch for patch in ax.patches if (patch.get_gid() or "").startswith("area")]
    corners = sum(len(patch.get_path().vertices) for patch in areas)
    curve = sum(len(line.get_xdata()) for line in ax.lines if line.get_color() == BLACK)
    assert corners < 3 * curve
    assert len(axes_image(ax, "svg")) < 400_000


def test_sides_that_polygons_share_cancel():
    """Of a board of squares with a hole the outer and the inner edge are left, the inner one the other way round."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    board = [square + place + 1e-13 * k for k, place in enumerate(product(range(3), range(3))) if place != (1, 1)]
    found = sorted(outlines(board), key=len)
    areas = [0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) for x, y in (curve.T for curve in found)]
    assert [len(curve) for curve in found] == [4, 12]
    assert areas == pytest.approx([-1.0, 9.0], abs=1e-10)
    # Without a common side each stays as it is.
    assert len(outlines([square, np.add(square, [3.0, 0.0])])) == 2


def test_a_curve_that_nearly_closes_has_no_end_on_its_start():
    """The diver's momentum is back within a thousandth of a degree: the end hid the start."""
    top = EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5))
    for missing, shown in ((1e-3, False), (0.1, True)):
        motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), (1.0 - missing) * top.period), [0.7, 0.2, 1.5])
        ax = plots.plot_momentum_curve(flat_axes(), motion, "base")
        assert ("end" in labels(ax)) == ("closing great circle" in labels(ax)) == shown
        assert len(marked(ax, "*", GREEN)) == 1


def test_the_sign_of_the_area_is_told_by_hatching(motions):
    ax = plots.plot_momentum_curve(flat_axes(), motions["astronaut"])
    areas = [patch for patch in ax.patches if (patch.get_gid() or "").startswith("area")]
    assert areas
    for patch in areas:
        assert bool(patch.get_hatch()) == (" -" in patch.get_gid())
    assert "winding −1" in labels(ax)
    # Euler's equations: near the axis of the greatest moment Pi1' = -a Pi2 and Pi2' = b Pi1 with a, b > 0,
    # counterclockwise; clockwise near that of the least.
    for momentum, sign in (([0.3, 0.2, 1.5], "+"), ([1.5, 0.2, 0.3], "−")):
        turned = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 3.5), momentum)
        angle = float(sp.split(turned, "base").solid_angle)
        ax = plots.plot_momentum_curve(flat_axes(), turned, "base", view=(20.0, 35.0))
        assert f"winding {sign}1" in labels(ax)
        assert ("+" if angle > 0 else "−") == sign
        assert shaded_area(ax, (20.0, 35.0)) == pytest.approx(angle, abs=1e-4)


def test_a_curve_gone_round_twice_is_shaded_twice():
    tensor = np.diag([1.0, 2.0, 3.0])
    top = EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5))
    motion = sp.reconstruct(sp.rigid(tensor, 2.0 * top.period), [0.7, 0.2, 1.5])
    view = (24.0, 32.0)
    ax = plots.plot_momentum_curve(flat_axes(), motion, "base", view=view)
    windings = {patch.get_gid().split()[1] for patch in ax.patches if (patch.get_gid() or "").startswith("area")}
    assert "+2" in windings
    assert "winding +2" in labels(ax)
    assert shaded_area(ax, view) == pytest.approx(float(sp.split(motion, "base").solid_angle), abs=2e-3)
    # Montgomery's phase of the closed form: per period it is the dynamic phase 2 E T/l less the area.
    turned = so3.log(motion.final_attitude)
    phase = 2.0 * (2.0 * top.energy * top.period / top.magnitude) - shaded_area(ax, view)
    along = np.array([0.7, 0.2, 1.5]) / top.magnitude
    assert so3.wrap(phase - turned @ along) == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("name", ["cat", "astronaut"])
def test_the_closing_great_circle_is_the_shortest(motions, name):
    ax = plots.plot_momentum_curve(solid_axes(), motions[name])
    closing = joined(drawn(ax, VERMILION, 1.7))
    curve = joined(drawn(ax, BLACK, 1.5))
    assert closing[[0, -1]] == pytest.approx(curve[[-1, 0]], abs=1e-15)
    assert np.linalg.norm(closing, axis=-1) == pytest.approx(np.ones(len(closing)), abs=1e-14)
    normal = np.cross(closing[0], closing[-1])
    assert np.abs(closing @ normal).max() < 1e-14
    length = np.linalg.norm(np.diff(closing, axis=0), axis=-1).sum()
    assert length == pytest.approx(float(sp.split(motions[name]).momentum_gap), rel=1e-4)
    assert "closing great circle" in labels(ax)


def test_the_heads_point_the_way_the_momentum_goes(motions):
    motion, view = motions["astronaut"], (35.0, 20.0)
    ax = plots.plot_momentum_curve(flat_axes(), motion, "base", view=view)
    flat, _ = screen(view)
    times = np.linspace(0.0, motion.duration, 4001)
    seen = motion.body_momentum(times) @ flat.T / np.linalg.norm(motion.momentum)
    heads = [text for text in ax.texts if hasattr(text, "arrow_patch")]
    assert heads
    for head in heads:
        place, step = 0.5 * (np.array(head.xy) + head.xyann), np.array(head.xy) - head.xyann
        nearest = int(np.clip(np.linalg.norm(seen - place, axis=-1).argmin(), 1, len(times) - 2))
        onward = seen[nearest + 1] - seen[nearest - 1]
        assert step @ onward > 0.9 * np.linalg.norm(step) * np.linalg.norm(onward)


def test_many_turns_are_counted_together_and_drawn_finer():
    top = EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5))
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 30.0 * top.period), [0.7, 0.2, 1.5])
    ax = plots.plot_momentum_curve(flat_axes(), motion, "base")
    assert "winding +3 or more" in labels(ax)
    widths = {line.get_linewidth() for line in ax.lines if line.get_color() == BLACK and line.get_marker() == "None"}
    (width,) = widths
    assert 0.3 <= width < 1.0


def test_a_steady_rotation_is_a_point():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 2.0), [0.0, 0.0, 1.0])
    for gauge in ("base", "horizontal"):
        ax = plots.plot_momentum_curve(solid_axes(), motion, gauge)
        assert np.concatenate(drawn(ax, BLACK, 1.5)) == pytest.approx(
            np.array([[0.0, 0.0, 1.0]] * sum(map(len, drawn(ax, BLACK, 1.5)))), abs=1e-12
        )
        flat = plots.plot_momentum_curve(flat_axes(), motion, gauge)
        assert not [label for label in labels(flat) if label.startswith("winding")]
        flat.figure.draw_without_rendering()


def test_a_curve_too_small_on_its_sphere_is_enlarged(motions):
    halves = sp.articulated(sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 1.0))
    motion = sp.reconstruct(halves, [0.0, 0.002, 0.005])
    ax = plots.plot_momentum_curve(flat_axes(), motion)
    (inset,) = ax.child_axes
    whole, near = (joined([xy(line) for line in lines]) for lines in (
        [line for line in axes.lines if line.get_color() == BLACK and line.get_linewidth() == 1.5]
        for axes in (ax, inset)
    ))  # fmt: skip
    assert near == pytest.approx(whole, abs=0.0)
    (left, right), (bottom, top) = inset.get_xlim(), inset.get_ylim()
    assert left < near[:, 0].min() < near[:, 0].max() < right
    assert bottom < near[:, 1].min() < near[:, 1].max() < top
    # The bar is as long as the angle that stands above it, where the sphere faces the eye.
    (bar,) = [xy(line) for line in inset.lines if line.get_linewidth() == 2.0]
    (text,) = [text.get_text() for text in inset.texts if text.get_text()]
    assert np.sin(np.radians(float(text[:-1]))) == pytest.approx(np.ptp(bar[:, 0]), rel=1e-12)
    # It is larger there, and covers nothing of the curve itself.
    ax.figure.draw_without_rendering()
    frame = inset.get_window_extent()
    assert not any(frame.contains(*point) for point in ax.transData.transform(whole))
    unit = np.ptp(ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])[:, 0])
    assert frame.width / (right - left) > 2.0 * unit
    assert not plots.plot_momentum_curve(flat_axes(), motions["astronaut"]).child_axes


def test_no_text_stands_on_the_curve(motions):
    for motion in (motions["astronaut"], motions["satellite"]):
        ax = plots.plot_momentum_curve(flat_axes(), motion)
        ax.figure.draw_without_rendering()
        curve = np.concatenate([xy(line) for line in ax.lines if line.get_color() == BLACK])
        places = ax.transData.transform(curve)
        for text in ax.texts:
            if text.get_text() in ("$x$", "$y$", "$z$"):
                box = text.get_window_extent()
                assert not any(box.contains(*place) for place in places), text


def test_a_closed_curve_has_no_closing_circle():
    closed, *_ = sp.closed_orbits(sp.articulated("cat", cat_righting()), 0.005)
    ax = plots.plot_momentum_curve(flat_axes(), closed, "base")
    assert labels(ax)[:2] == [r"$\Pi/|\Pi|$", "start"]
    assert "closing great circle" not in labels(ax)
    assert len(marked(ax, "s", VERMILION)) == 0
    assert "winding −1" in labels(ax) or "winding +1" in labels(ax)


@pytest.mark.parametrize("gauge", ["horizontal", "base"])
def test_the_portrait_is_that_of_the_frozen_body_in_the_gauge(motions, gauge):
    motion, time = motions["satellite"], 21.0
    inertia = named_gauge(motion.deformation, gauge).inertia(time)
    ax = plots.plot_momentum_curve(solid_axes(), motion, gauge, frozen_at=time)
    inverse = np.linalg.inv(inertia)
    moments = np.linalg.eigvalsh(inertia)
    separatrix = np.concatenate(drawn(ax, "#CC79A7"))
    assert np.einsum("ni,ij,nj->n", separatrix, inverse, separatrix) == pytest.approx(
        np.full(len(separatrix), 1.0 / moments[1]), rel=1e-9
    )
    polhodes = drawn(ax, "#8A8A8A")
    assert len(polhodes) >= 16
    for line in polhodes:
        assert np.ptp(np.einsum("ni,ij,nj->n", line, inverse, line)) < 1e-9 / moments[0]
    points = marked(ax, "o", "#999999")
    assert len(points) == 4
    rotated = points @ inverse
    assert np.abs(np.cross(rotated, points)).max() < 1e-12
    assert "t = 21 s" in ax.get_legend().get_title().get_text()
    assert drawn(plots.plot_momentum_curve(solid_axes(), motion, frozen_at=None), "#CC79A7") == []


def test_symmetric_bodies_have_the_portrait_that_they_have():
    for moments, separatrices in ((np.diag([2.0, 2.0, 3.0]), 0), (np.eye(3), 0), (np.diag([1.0, 2.0, 3.0]), 4)):
        motion = sp.reconstruct(sp.rigid(so3.exp(np.ones(3)) @ moments @ so3.exp(-np.ones(3)), 3.0), [0.3, 0.5, 1.0])
        ax = plots.plot_momentum_curve(solid_axes(), motion, "base")
        assert ("separatrix" in labels(ax)) == bool(separatrices)
        ax.figure.draw_without_rendering()


def test_flat_axes_show_the_curve_in_parallel_projection(motions):
    motion, view = motions["astronaut"], (-20.0, 140.0)
    solid = solid_axes()
    solid.view_init(*view)
    plots.plot_momentum_curve(solid, motion)
    flat = plots.plot_momentum_curve(flat_axes(), motion, view=view)
    right, _ = screen(view)
    assert joined(drawn(flat, BLACK, 1.5)) == pytest.approx(joined(drawn(solid, BLACK, 1.5)) @ right.T, abs=1e-13)


def test_most_of_the_curve_is_in_front(motions):
    for motion in motions.values():
        ax = plots.plot_momentum_curve(flat_axes(), motion)
        near = sum(len(xy(line)) for line in ax.lines if line.get_color() == BLACK and line.get_alpha() == 1.0)
        far = sum(len(xy(line)) for line in ax.lines if line.get_color() == BLACK and line.get_alpha() != 1.0)
        assert near > far


@pytest.mark.parametrize("count", full_but([3, 6], 3))
def test_cells_cover_the_inside_of_polygons_with_their_windings(count):
    random = np.random.default_rng(3)
    t = np.linspace(0.0, 2.0 * np.pi, 700, endpoint=False)
    for _ in range(count):
        waves = [np.cos(t[:, None] * np.arange(5)), np.sin(t[:, None] * np.arange(5))]
        curve = sum(wave @ random.normal(size=(5, 3)) for wave in waves)
        curve /= np.linalg.norm(curve, axis=-1, keepdims=True)
        reference = sphere.far_reference(curve)
        cells = enclosed_cells(curve, reference)
        assert cells.area == pytest.approx(float(sphere.polygon_area(curve)), abs=1e-4)
        assert set(np.abs(cells.windings)) <= {1, 2, 3}
        # The winding about a cell's middle, by angles in the plane of the stereographic projection from -n.
        frame = np.stack([so3.perpendicular(reference), np.cross(reference, so3.perpendicular(reference)), reference])
        x, y, z = (curve @ frame.T).T
        flat = (x + 1j * y) / (1.0 + z)
        for k in range(0, len(cells.polygons), 97):
            middle = cells.polygons[k].mean(axis=0)
            a, b, c = frame @ (middle / np.linalg.norm(middle))
            turn = np.angle(np.roll(flat - (a + 1j * b) / (1.0 + c), -1) / (flat - (a + 1j * b) / (1.0 + c))).sum()
            if abs(sphere.polygon_area(cells.polygons[k])) > 1e-5:
                assert round(turn / (2.0 * np.pi)) == cells.windings[k]


@pytest.mark.parametrize("name", ["cat", "spinning"])
def test_phases_in_time_end_in_those_of_the_split(motions, name):
    motion = motions[name]
    ax = plots.plot_phases(flat_axes(2.6), motion)
    found = sp.split(motion)
    dynamic, geometric, total = (beginning(ax, word) for word in ("dynamic", "geometric", "total"))
    assert dynamic + geometric == pytest.approx(total, abs=1e-12)
    assert [dynamic[0], geometric[0], total[0]] == [0.0, 0.0, 0.0]
    # Two ways of integrating along one motion, each far nearer to it than the motion is to the truth.
    near = 0.1 * float(motion.error_estimate) + 1e-12
    for drawn_last, phase in ((dynamic, "dynamic_phase"), (geometric, "geometric_phase"), (total, "montgomery_phase")):
        assert drawn_last[-1] == pytest.approx(float(getattr(found, phase)), rel=1e-12, abs=near)
    times = np.asarray(next(line for line in ax.lines if line.get_label().startswith("total")).get_xdata())
    assert (times[0], times[-1]) == (0.0, motion.duration) == ax.get_xlim()
    assert np.abs(np.diff(total)).max() < 0.5
    # Independently: the dynamic phase from the integrator.
    assert sp.running_phases(motion, times).dynamic_phase == pytest.approx(dynamic, abs=near)
    # Nothing in the legend that cannot be seen.
    assert len(ax.collections) == 0
    assert len(labels(ax)) == 3
    assert "[rad]" in ax.get_ylabel()
    assert ax.child_axes[0].get_ylabel() == "phase [deg]"
    assert ax.get_xlabel() == "$t$ [s]"


def test_phases_without_momentum_are_zero(cat):
    motion = sp.reconstruct(sp.articulated(cat, cat_righting(0.5)), np.zeros(3))
    ax = plots.plot_phases(flat_axes(2.6), motion, "base", times=[0.0, 0.2, 0.5])
    assert all(beginning(ax, word).tolist() == [0.0, 0.0, 0.0] for word in ("dynamic", "geometric", "total"))
    assert "base gauge" in ax.get_legend().get_title().get_text()


@pytest.mark.parametrize("name", ["cat", "spinning"])
def test_the_attitude_is_drawn_as_it_is(motions, name):
    motion = motions[name]
    ax = plots.plot_attitude(flat_axes(2.6), motion)
    pieces = [
        np.concatenate(drawn(ax, colour, width)) for colour, width in ((BLUE, 1.6), (VERMILION, 1.5), (GREEN, 1.5))
    ]
    vectors = np.stack([piece[:, 1] for piece in pieces], axis=-1)
    times = pieces[0][:, 0]
    assert so3.angle(so3.transpose(so3.exp(vectors)) @ motion.attitude(times)).max() < 1e-12
    assert by_label(ax, r"$|\theta|$") == pytest.approx(np.linalg.norm(vectors, axis=-1), abs=1e-15)
    # Both turn by more than a half turn, and no line jumps there.
    assert np.linalg.norm(vectors, axis=-1).max() > 1.2 * np.pi
    for piece in drawn(ax, BLUE, 1.6):
        assert np.abs(np.diff(piece[:, 1])).max(initial=0.0) < 1.0
    assert labels(ax) == [r"$\theta_x$", r"$\theta_y$", r"$\theta_z$", r"$|\theta|$"]
    assert [other.get_ylabel() for other in (ax, *ax.child_axes)] == ["rotation vector [rad]", "rotation vector [deg]"]
    ax = plots.plot_attitude(flat_axes(2.6), motion, "quaternion")
    quaternions = np.stack([by_label(ax, f"$q_{name}$") for name in "xyzw"], axis=-1)
    assert np.linalg.norm(quaternions, axis=-1) == pytest.approx(np.ones(len(quaternions)), abs=1e-14)
    assert np.abs(so3.matrix_from_quat(quaternions) - motion.attitude(times)).max() < 1e-12
    # One sign throughout.
    assert np.linalg.norm(np.diff(quaternions, axis=0), axis=-1).max() < 0.5


def test_a_rotation_vector_goes_on_past_half_turns_which_are_marked():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 7.0), [0.0, 0.0, 3.0])
    ax = plots.plot_attitude(flat_axes(2.6), motion)
    z = np.concatenate(drawn(ax, GREEN, 1.5))
    assert z[:, 1] == pytest.approx(z[:, 0], abs=1e-9)
    half_turns = [line.get_ydata()[0] for line in ax.lines if len(line.get_ydata()) == 2]
    assert half_turns == pytest.approx([np.pi, 2.0 * np.pi, 0.0])


def test_lines_are_interrupted_where_they_jump():
    ax = flat_axes()
    _pieces(ax, np.arange(4.0), np.array([[0.0], [0.5], [3.0], [3.5]]), [("jump", {"color": "red"})])
    assert [line.tolist() for line in drawn(ax, "red")] == [[[0.0, 0.0], [1.0, 0.5]], [[2.0, 3.0], [3.0, 3.5]]]


def test_a_small_geometric_phase_is_enlarged(motions):
    ax = plots.plot_phases(flat_axes(2.6), motions["cat"])
    (inset,) = ax.child_axes[1:]
    (small,) = [line for line in inset.lines if len(line.get_xdata()) > 2]
    assert np.asarray(small.get_ydata()) == pytest.approx(np.degrees(beginning(ax, "geometric")), abs=1e-12)
    assert np.degrees(np.ptp(beginning(ax, "geometric"))) < 0.06 * np.degrees(np.ptp(beginning(ax, "total")))
    # No line of the figure passes beneath it.
    ax.figure.draw_without_rendering()
    frame = inset.get_window_extent()
    for line in ax.lines:
        assert not any(frame.contains(*point) for point in ax.transData.transform(line.get_xydata()))
    # One that can be seen is not.
    assert len(plots.plot_phases(flat_axes(2.6), motions["spinning"]).child_axes) == 1


def test_the_power_of_ten_stands_in_the_unit(cat):
    """Above the axis, where Matplotlib writes it, the legend covered it."""
    still = sp.ShapePath.waypoints([0.0, 1.0], [np.zeros(cat.n_shape)] * 2, joint_names=cat.joint_names)
    motion = sp.reconstruct(sp.articulated(cat, still), [0.0, 0.0, 1e-9])
    for ax, factor in ((plots.plot_phases(flat_axes(), motion), 1.0), (plots.plot_energy(flat_axes(), motion), 1.0)):
        ax.figure.draw_without_rendering()
        for axis in (ax.yaxis, *(child.yaxis for child in ax.child_axes)):
            assert not (axis.get_offset_text().get_visible() and axis.get_offset_text().get_text())
        power = int(re.search("10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+) ", ax.get_ylabel())[1].translate(UPRIGHT))
        for place, tick in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True):
            shown = float(tick.get_text().replace("−", "-")) * 10.0**power
            assert shown == pytest.approx(factor * place, rel=1e-3, abs=1e-3 * 10.0**power)
    assert "= 0.00°" in labels(plots.plot_phases(flat_axes(), motion))[1]


def test_lines_of_many_loops_are_finer(cat):
    path = cat_righting(0.5)
    few, many = (plots.plot_shape_path(flat_axes(), one, cat) for one in (path, path.repeated(60)))
    for one, other in zip(few.lines, many.lines, strict=True):
        assert other.get_linewidth() == pytest.approx(0.35 * one.get_linewidth())
        assert other.get_markersize() == pytest.approx(0.35 * one.get_markersize())


def test_a_start_upside_down_is_drawn_without_a_jump(cat):
    # A half turn at the start has two rotation vectors; the one that goes on is drawn.
    motion = sp.reconstruct(sp.articulated(cat, cat_righting(0.5)), [0.02, 0.0, 0.0], UPSIDE_DOWN)
    ax = plots.plot_attitude(flat_axes(2.6), motion)
    (x,) = drawn(ax, BLUE, 1.6)
    assert np.abs(np.diff(x[:, 1])).max() < 0.1


def test_inertia_and_internal_momentum(motions):
    deformation = motions["satellite"].deformation
    ax = plots.plot_inertia(flat_axes(2.6), deformation)
    times = np.asarray(ax.lines[0].get_xdata())
    inertia = deformation.inertia(times)
    moments = np.stack([by_label(ax, f"$I_{k}$") for k in "123"], axis=-1)
    assert moments.sum(axis=-1) == pytest.approx(np.trace(inertia, axis1=1, axis2=2), rel=1e-13)
    assert moments.prod(axis=-1) == pytest.approx(np.linalg.det(inertia), rel=1e-12)
    assert np.all(np.diff(moments, axis=-1) >= 0.0)
    assert ax.get_ylim()[0] == 0.0
    ax = plots.plot_inertia(flat_axes(2.6), deformation, "entries")
    for name, (i, j) in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}.items():
        assert by_label(ax, f"$I_{{{name}}}$") == pytest.approx(inertia[:, j, i], abs=1e-13)
    assert "[kg m²]" in ax.get_ylabel()
    ax = plots.plot_internal_momentum(flat_axes(2.6), deformation)
    internal = np.stack([by_label(ax, f"$L_{{o,{name}}}$") for name in "xyz"], axis=-1)
    path = satellite_sweep()
    body = sp.load_body("satellite")
    assert internal == pytest.approx(body.internal_momentum(path.shape(times), path.rate(times)), abs=1e-12)
    assert by_label(ax, "$|L_o|$") == pytest.approx(np.linalg.norm(internal, axis=-1), abs=1e-15)
    assert "[kg m²/s]" in ax.get_ylabel()


@pytest.mark.parametrize("name", ["cat", "astronaut"])
def test_energy_lies_between_the_bands_whose_edges_are_the_thresholds_e5(motions, name):
    motion = motions[name]
    ax = plots.plot_energy(flat_axes(2.6), motion)
    energy = by_label(ax, "$E$")
    times = np.asarray(next(line for line in ax.lines if line.get_label() == "$E$").get_xdata())
    size = np.linalg.norm(motion.momentum)
    moments = np.linalg.eigvals(motion.deformation.inertia(times)).real
    least, middle, most = np.sort(moments, axis=-1).T
    momenta = motion.body_momentum(times)
    solved = np.linalg.solve(motion.deformation.inertia(times), momenta[..., None])[..., 0]
    assert energy == pytest.approx(0.5 * np.sum(momenta * solved, axis=-1), rel=1e-10)
    assert by_label(ax, r"$\ell^2\!/2I_2$, separatrix") == pytest.approx(size**2 / (2.0 * middle), rel=1e-12)
    bands = {band.get_label(): band.get_paths()[0].vertices for band in ax.collections}
    for label, low, high in (
        ("about smallest moment", size**2 / (2.0 * middle), size**2 / (2.0 * least)),
        ("about largest moment", size**2 / (2.0 * most), size**2 / (2.0 * middle)),
    ):
        for edge in (low, high):
            expected = np.stack([times, edge], axis=-1)[::17]
            away = np.abs(bands[label][:, None] - expected).max(axis=-1).min(axis=0)
            assert away.max() < 1e-12 * edge.max()
        assert bands[label][:, 1].max() == pytest.approx(high.max(), rel=1e-12)
        assert bands[label][:, 1].min() == pytest.approx(low.min(), rel=1e-12)
    assert np.all(
        (energy >= size**2 / (2.0 * most) * (1.0 - 1e-12)) & (energy <= size**2 / (2.0 * least) * (1 + 1e-12))
    )
    hatches = {band.get_label(): band.get_hatch() for band in ax.collections}
    assert hatches["about smallest moment"] != hatches["about largest moment"]
    assert ax.get_ylabel() == "energy [J]"


def test_the_energy_is_on_an_axis_where_it_is_seen():
    """A diver's smallest moment is a tenth of the others: with its bound the energy would be a line at the bottom."""
    dive = sp.articulated(sp.load_body("diver"), MOTIONS["diver_twist"].path())
    motion = sp.reconstruct(dive, [0.0, 61.558831, 0.0])
    ax = plots.plot_energy(flat_axes(2.6), motion)
    energy = by_label(ax, "$E$")
    low, high = ax.get_ylim()
    assert low < energy.min() < energy.max() < high
    assert np.ptp(energy) > 0.5 * (high - low)
    greatest = 0.5 * 61.558831**2 / np.linalg.eigvalsh(dive.inertia(0.0))[0]
    assert high < 0.2 * greatest
    title = ax.get_legend().get_title().get_text()
    assert rf"$\ell^2\!/2I_1$ is beyond the axis, up to {greatest:.4g} J" in title
    assert r"$\ell^2\!/2I_3$" in labels(ax)


def test_a_band_between_equal_moments_is_not_in_the_legend():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.0, 2.0]), 2.0), [0.6, 0.1, 1.5])
    shown = labels(plots.plot_energy(flat_axes(), motion))
    assert "about largest moment" in shown
    assert "about smallest moment" not in shown


def test_certain_bounds_of_the_energy_are_drawn_as_steps(motions):
    motion = motions["satellite"]
    certificate = regime_certificate(motion.deformation, motion.momentum)
    ax = plots.plot_energy(flat_axes(2.6), motion, certificate=certificate)
    lower, upper = [patch.get_data() for patch in ax.patches]
    times = np.linspace(0.0, motion.duration, 300)
    cell = np.clip(np.searchsorted(lower.edges, times, side="right") - 1, 0, len(lower.values) - 1)
    energy = energy_along(motion, times)
    assert np.all((lower.values[cell] <= energy) & (energy <= upper.values[cell]))
    assert "certain bounds" in labels(ax)


def test_shapes_in_time_are_grouped_by_unit(satellite):
    path = satellite_sweep()
    ax = plots.plot_shape_path(flat_axes(2.6), path, satellite)
    (twin,) = [other for other in ax.figure.axes if other is not ax]
    (angle,), (length,) = ax.lines, twin.lines
    times = np.asarray(angle.get_xdata())
    names = list(satellite.joint_names)
    assert angle.get_ydata() == pytest.approx(path.shape(times)[:, names.index("arm_1")], abs=0.0)
    assert length.get_ydata() == pytest.approx(path.shape(times)[:, names.index("boom_extension")], abs=0.0)
    assert [other.get_ylabel() for other in (ax, *ax.child_axes, twin)] == ["", "joints [deg]", "joints [m]"]
    assert labels(ax) == ["arm_1 [deg]", "boom_extension [m]", "beyond a limit"]
    ax = plots.plot_shape_path(flat_axes(2.6), path, satellite, ["arm_2", 0])
    assert ["arm_2", names[0]] == [label.split(" [")[0] for label in labels(ax)[:2]]
    ax = plots.plot_shape_path(flat_axes(2.6), path)
    assert ax.get_ylabel() == "joints [rad or m]"
    unnamed = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 1.0], [1.0, 1.0]])
    assert labels(plots.plot_shape_path(flat_axes(2.6), unnamed)) == ["joint 0"]


def test_of_many_joints_those_that_move_most_are_named(cat):
    path = cat_righting(0.5)
    ax = plots.plot_shape_path(flat_axes(2.6), path, cat)
    values = path.matched(cat.joint_names, cat.name).shape(np.asarray(ax.lines[0].get_xdata()))
    span = np.ptp(values, axis=0)
    named = labels(ax)[:6]
    others = [k for k, name in enumerate(cat.joint_names) if name not in named]
    assert span[[cat.joint_index(name) for name in named]].min() >= span[others].max()
    assert labels(ax)[6:] == [f"{int((span > 1e-9).sum()) - 6} others", "beyond a limit"]
    seven = plots.plot_shape_path(flat_axes(2.6), path, cat, [cat.joint_index(name) for name in named] + others[:1])
    assert labels(seven)[6] == "1 other"
    for line, name in zip(ax.lines, named):
        assert line.get_ydata() == pytest.approx(values[:, cat.joint_index(name)], abs=0.0)
    assert len({(str(line._dash_pattern), line.get_color()) for line in ax.lines[:6]}) == 6


def test_left_and_right_joints_share_a_colour_and_dashes_are_the_right(cat):
    ax = plots.plot_shape_path(flat_axes(2.6), cat_righting(0.5), cat)
    lines = dict(zip(labels(ax), ax.lines))
    for name in ("rear_{}_knee", "front_{}_elbow"):
        left, right = (lines[name.format(side)] for side in ("left", "right"))
        assert left.get_markerfacecolor() == right.get_markerfacecolor() == right.get_color()
        assert left.get_marker() == right.get_marker()
        assert (left.get_linestyle(), right.get_linestyle()) == ("-", "--")
        # Both are seen where they are the same: the dashes lie on a broad pale line.
        assert left.get_linewidth() > 2.0 * right.get_linewidth()
        assert left.get_zorder() < right.get_zorder()
        assert 0.299 * left.get_color()[0] + 0.587 * left.get_color()[1] + 0.114 * left.get_color()[2] > 0.45
    assert len({line.get_marker() for line in ax.lines[:6]}) == 4
    assert "dashes: the right side" in ax.get_legend().get_title().get_text()


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("left_knee", "right_knee"),
        ("hip_flexion_r", "hip_flexion_l"),
        ("RightElbow", "LeftElbow"),
        ("LF_HAA", None),
        ("ankle_L", "ankle_R"),
        ("waist_roll", None),
        ("arm_1", None),
        ("r-wrist", "l-wrist"),
    ],
)
def test_the_other_side_of_a_joint_is_told_by_its_name(name, other):
    assert other_side(name) == other
    assert other is None or other_side(other) == name


def test_limits_are_bands_where_they_are_near(satellite):
    ax = plots.plot_shape_path(flat_axes(2.6), satellite_sweep(), satellite)
    (twin,) = [other for other in ax.figure.axes if other is not ax]
    low, high = satellite.joint_limits[satellite.joint_index("boom_extension")]
    bands = sorted((band.get_y(), band.get_y() + band.get_height()) for band in twin.patches)
    assert (bands[0][1], bands[1][0]) == pytest.approx((low, high), abs=1e-15)
    assert twin.get_ylim()[0] < bands[0][0]
    assert twin.get_ylim()[1] > bands[1][1]
    # The arm may turn much farther than it does: its limits are not in the figure.
    limits = satellite.joint_limits[satellite.joint_index("arm_1")]
    assert np.abs(limits).min() > 1.5 * 1.2
    assert not ax.patches
    assert "beyond a limit" not in labels(plots.plot_shape_path(flat_axes(2.6), satellite_sweep()))


def test_the_plane_of_two_joints(satellite):
    path = satellite_sweep()
    ax = plots.plot_shape_plane(flat_axes(2.6), path, ("boom_extension", "arm_1"), satellite)
    (loop,) = drawn(ax, BLACK, 1.6)
    # The sweep's own formula: 0.9 (1 - cos) m against 1.2 sin rad.
    assert ((loop[:, 0] / 0.9 - 1.0) ** 2 + (loop[:, 1] / 1.2) ** 2) == pytest.approx(np.ones(len(loop)), abs=1e-12)
    assert marked(ax, "*", GREEN) == pytest.approx(np.zeros((1, 2)), abs=1e-12)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("boom_extension [m]", "arm_1 [deg]")
    heads = [text for text in ax.texts if hasattr(text, "arrow_patch")]
    assert len(heads) == 4
    for head in heads:
        (x, y), (after_x, after_y) = head.xyann, head.xy
        turn = (x / 0.9 - 1.0) * (after_y / 1.2) - (y / 1.2) * (after_x / 0.9 - 1.0)
        # 1 - cos and sin of the same angle: from the start up and to the right, clockwise.
        assert turn < 0.0
    straight = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.0], [1.0, 2.0]])
    ax = plots.plot_shape_plane(flat_axes(2.6), straight, (0, 1))
    assert marked(ax, "s", BLUE) == pytest.approx(np.array([[1.0, 2.0]]), abs=1e-12)


def test_the_curvature_is_that_of_small_loops(cat):
    joints = ("waist_pitch", "waist_yaw")
    first, second = np.linspace(-1.5, 1.5, 7), np.linspace(-1.0, 1.0, 5)
    ax = plots.plot_curvature(flat_axes(2.8), cat, joints, first, second, axis="x")
    mesh = ax.collections[0]
    values = np.asarray(mesh.get_array()).reshape(5, 7)
    corners = np.asarray(mesh.get_coordinates())
    assert corners[0, :, 0] == pytest.approx(first, abs=0.0)
    assert corners[:, 0, 1] == pytest.approx(second, abs=0.0)
    assert mesh.norm.vmin == -mesh.norm.vmax
    # Off the middle both ways, so that no swap of axes is missed; the difference of the connection's own definition.
    for i, j in ((1, 3), (5, 0)):
        centre = cat.shape({joints[0]: first[i], joints[1]: second[j]})
        side = 2e-3
        u, v = (side * cat.shape({name: 1.0}) for name in joints)
        square = np.array([-u - v, u - v, u + v, -u + v, -u - v]) / 2.0 + centre
        path = sp.ShapePath.waypoints(np.arange(5.0), square, joint_names=cat.joint_names)
        turn = so3.log(sp.holonomy(cat, path, tolerance=1e-12))
        assert -np.degrees(turn[0]) / side**2 == pytest.approx(values[j, i], rel=1e-2, abs=0.1)
    assert "x component\n[deg/rad²]" in ax.figure.axes[1].get_ylabel()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("waist_pitch [deg]", "waist_yaw [deg]")


def test_paths_of_particles_are_drawn_on_their_curvature():
    body = sp.examples.linked_pentagon()
    loop = sp.ShapePath.fourier([0.0, 0.0], [[1.0], [0.0]], [[0.0], [1.0]], 1.0, joint_names=body.joint_names)
    ax = plots.plot_curvature(flat_axes(2.8), body, ("b", "a"), path=loop)
    mesh = ax.collections[0]
    x, y = np.moveaxis(np.asarray(mesh.get_coordinates()), -1, 0)
    here = sp.curvature(body, np.stack([y, x], axis=-1)[::9, ::9])[..., 1, 0, 2]
    assert np.asarray(mesh.get_array()).reshape(x.shape)[::9, ::9] == pytest.approx(np.degrees(here), rel=1e-12)
    assert plots.plot_shape_plane(flat_axes(2.6), loop, (0, 1), body).get_xlabel() == "a [deg]"
    assert len(plots.plot_shape_path(flat_axes(2.6), loop, body).lines) == 2


def test_contours_of_the_curvature_tell_its_sign_without_colours(cat):
    ax = plots.plot_curvature(flat_axes(2.8), cat, ("waist_pitch", "waist_yaw"), path=cat_righting(0.5))
    mesh, lines = ax.collections[:2]
    levels = np.asarray(lines.levels)
    assert levels.min() < 0.0 < levels.max()
    # Matplotlib keeps None for a solid line.
    for level, (_, dashes) in zip(levels, lines.get_linestyles()):
        assert (dashes is not None) == (level < 0.0)
    texts = {text.get_text() for text in lines.labelTexts}
    assert texts <= {f"{level:.2g}".replace("-", "−") for level in levels}
    assert len(texts) > 2
    grid = np.asarray(mesh.get_coordinates())
    values = np.asarray(mesh.get_array()).reshape(grid.shape[:2])
    spacing = max(np.diff(grid[0, :, 0]).max(), np.diff(grid[:, 0, 1]).max())
    for level, path in zip(levels, lines.get_paths()):
        for x, y in path.vertices[::5]:
            near = (np.abs(grid[..., 0] - x) < 1.01 * spacing) & (np.abs(grid[..., 1] - y) < 1.01 * spacing)
            assert values[near].min() <= level <= values[near].max()
    # The loop is inside.
    (loop,) = drawn(ax, BLACK, 1.6)
    assert ax.get_xlim()[0] < loop[:, 0].min() < loop[:, 0].max() < ax.get_xlim()[1]
    assert ax.get_ylim()[0] < loop[:, 1].min() < loop[:, 1].max() < ax.get_ylim()[1]
    path = cat_righting(0.5).matched(cat.joint_names, cat.name)
    middle = path.shape(0.2)[[cat.joint_index("waist_pitch"), cat.joint_index("waist_yaw")]]
    assert np.linalg.norm(loop - middle, axis=-1).min() < 0.02


def test_small_curvatures_have_their_power_of_ten_in_the_unit(satellite):
    joints = ("boom_extension", "arm_1")
    ax = plots.plot_curvature(flat_axes(2.8), satellite, joints, axis=(2.0, 0.0, 2.0))
    grid = np.asarray(ax.collections[0].get_coordinates())
    field = sp.curvature_on_plane(satellite, joints, grid[0, :, 0], grid[:, 0, 1])
    values = np.asarray(ax.collections[0].get_array()).reshape(grid.shape[:2])
    assert values == pytest.approx((field[..., 0] + field[..., 2]).T / np.sqrt(2.0) * np.degrees(1e3), abs=1e-9)
    label = ax.figure.axes[1].get_ylabel()
    assert label == "curvature, along (0.71, 0, 0.71)\n[10⁻³ deg/(m rad)]"
    limits = satellite.joint_limits[satellite.joint_index("boom_extension")]
    assert ax.get_xlim() == pytest.approx(tuple(limits))


def test_a_flat_field_is_drawn_too(satellite):
    ax = plots.plot_curvature(flat_axes(2.8), satellite, ("arm_1", "arm_2"), [0.0, 1.0], [0.0, 1.0], axis="y")
    ax.figure.draw_without_rendering()
    assert len(ax.collections) >= 1


def test_fixed_points_are_marked_by_stability_and_index(motions):
    deformation = motions["satellite"].deformation
    points = sp.fixed_points(deformation, 3.0)
    ax = plots.plot_fixed_points(solid_axes(), points)
    for kind, (marker, colour) in {"elliptic": ("o", BLUE), "hyperbolic": ("X", VERMILION)}.items():
        expected = points.directions[[stability == kind for stability in points.stability]]
        assert len(expected) > 1
        assert marked(ax, marker, colour) == pytest.approx(expected, abs=0.0)
        # Fixed indeed: one loop of shapes brings the momentum back.
        gaps = sp.stroboscopic_map(deformation, 3.0, expected).gap
        assert gaps.max() < 1e-8
    assert sorted(text.get_text() for text in ax.texts) == sorted(
        "+1" if trace < 2.0 else "−1" for trace in points.trace
    )
    assert "indices sum to 2" in ax.get_legend().get_title().get_text()
    assert "3 kg m²/s" in ax.get_legend().get_title().get_text()
    assert "missing" not in ax.get_legend().get_title().get_text()
    partial = sp.FixedPoints(
        magnitude=3.0,
        directions=points.directions[:1],
        trace=points.trace[:1],
        index=np.zeros(1, int),
        stability=("parabolic",),
        gap=points.gap[:1],
        index_sum=0,
        complete=False,
        tolerance=1e-11,
    )
    ax = plots.plot_fixed_points(flat_axes(), partial, inertia=deformation.inertia(0.0))
    assert ax.texts[0].get_text() == "0"
    assert "some may be missing" in ax.get_legend().get_title().get_text()
    assert {"parabolic", "separatrix"} <= set(labels(ax))


def test_every_figure_returns_its_axes_and_is_drawn_within_its_column(motions, cat):
    motion, path = motions["cat"], cat_righting(0.5)
    joints = ("waist_pitch", "waist_yaw")
    points = sp.fixed_points(motion.deformation, 0.02)
    dive = sp.articulated(sp.load_body("diver"), sp.examples.MOTIONS["diver_twist"].path())
    dive = sp.reconstruct(dive, [0.0, 61.558831, 0.0])
    shares = sp.contributions(dive)
    figures = {
        plots.plot_momentum_curve: (motion,),
        plots.plot_fixed_points: (points,),
        plots.plot_phases: (motion,),
        plots.plot_attitude: (motion,),
        plots.plot_inertia: (motion.deformation,),
        plots.plot_internal_momentum: (motion.deformation,),
        plots.plot_energy: (motion,),
        plots.plot_shape_path: (path, cat),
        plots.plot_shape_plane: (path, joints, cat),
        plots.plot_curvature: (cat, joints),
        plots.plot_loop: (cat, path),
        plots.plot_torques: (motion,),
        plots.plot_segment_momentum: (sp.segment_momentum(motion),),
        plots.plot_somersault: (dive,),
        plots.plot_shares: (shares,),
        plots.plot_direct_shares: (shares,),
        plots.plot_reach: (sp.reachable(sp.load_body("cat_two_halves")),),
    }
    elsewhere = ("polhodes", "herpolhode", "heavy_top_stability", "crown", "bounds")
    elsewhere += ("caustic", "conjugate_locus", "surface_locus", "potential", "first_return")
    elsewhere += ("euler_angles", "elliptic_cylinders", "pendulum")
    elsewhere += ("cones", "rolling_ellipsoid")
    others = {getattr(plots, f"plot_{name}") for name in elsewhere}
    drawn = {getattr(plots, name) for name in plots.__all__ if name.startswith("plot_")}
    assert drawn - others == {*figures}
    for plot, arguments in figures.items():
        ax = flat_axes(4.3)
        assert plot(ax, *arguments) is ax
        ax.figure.draw_without_rendering()
        assert ax.figure.get_size_inches()[0] == 3.4
        width, height = ax.figure.canvas.get_width_height()
        texts = [*ax.texts, ax.xaxis.label, ax.yaxis.label, *(ax.get_legend().get_texts() if ax.get_legend() else ())]
        for text in texts:
            if text.get_text() and not hasattr(text, "arrow_patch"):
                assert text.get_fontsize() >= 6.0
                box = text.get_window_extent()
                assert np.all(box.min >= -2.0), (plot, text)
                assert np.all(box.max <= np.array([width, height]) + 2.0), (plot, text)


def test_lines_differ_without_colours(motions):
    for ax in (
        plots.plot_phases(flat_axes(2.6), motions["cat"]),
        plots.plot_attitude(flat_axes(2.6), motions["cat"], "quaternion"),
        plots.plot_inertia(flat_axes(2.6), motions["cat"].deformation, "entries"),
        plots.plot_internal_momentum(flat_axes(2.6), motions["cat"].deformation),
    ):
        looks = {
            line.get_label(): (str(line._dash_pattern), line.get_linewidth() > 2.0)
            for line in ax.lines
            if not line.get_label().startswith("_")
        }
        assert len(set(looks.values())) == len(looks)


def test_what_cannot_be_drawn_is_refused(motions, cat):
    motion, path = motions["cat"], cat_righting(0.5)
    batch = sp.reconstruct(motion.deformation, np.ones((2, 3)))
    without = sp.reconstruct(motion.deformation, np.zeros(3))
    for plot in (plots.plot_momentum_curve, plots.plot_phases, plots.plot_attitude, plots.plot_energy):
        with pytest.raises(ShapeError, match="motion"):
            plot(flat_axes(), batch)
        with pytest.raises(ShapeError, match="ax"):
            plot(None, motion)
    for plot in (plots.plot_momentum_curve, plots.plot_energy):
        with pytest.raises(ShapeError, match="momentum"):
            plot(flat_axes(), without)
    for plot in (plots.plot_phases, plots.plot_attitude, plots.plot_energy):
        with pytest.raises(ShapeError, match="flat"):
            plot(solid_axes(), motion)
        with pytest.raises(ShapeError, match="times"):
            plot(flat_axes(), motion, times=[0.3, 0.1])
    with pytest.raises(UnknownNameError, match="rotation_vector"):
        plots.plot_attitude(flat_axes(), motion, "euler")
    with pytest.raises(UnknownNameError, match="principal"):
        plots.plot_inertia(flat_axes(), motion.deformation, "both")
    with pytest.raises(UnknownNameError, match="waist_pitch"):
        plots.plot_shape_path(flat_axes(), path, cat, ["waist_pich"])
    with pytest.raises(ShapeError, match="moves"):
        plots.plot_shape_path(flat_axes(), sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.0], [0.0, 0.0]]))
    for joints, message in ((("waist_pitch",), "two joints are needed"), ((1, 1), "two different joints")):
        with pytest.raises(ShapeError, match=message):
            plots.plot_shape_plane(flat_axes(), path, joints, cat)
        with pytest.raises(ShapeError, match=message):
            plots.plot_curvature(flat_axes(), cat, joints)
    with pytest.raises(UnknownNameError, match="axis"):
        plots.plot_curvature(flat_axes(), cat, (0, 1), axis="xy")
    with pytest.raises(ShapeError, match="zero"):
        plots.plot_curvature(flat_axes(), cat, (0, 1), axis=(0.0, 0.0, 0.0))
    with pytest.raises(ShapeError, match="first"):
        plots.plot_curvature(flat_axes(), cat, (0, 1), [1.0, 0.0], [0.0, 1.0])
    with pytest.raises(ShapeError, match="height"):
        plots.column_axes(-1.0)
    with pytest.raises((ShapeError, GaugeError, UnknownNameError)):
        plots.plot_momentum_curve(flat_axes(), motion, "no such gauge")


def test_no_figure_is_registered_anywhere():
    code = (
        "import sys, shapephase as sp, numpy as np\n"
        "from shapephase import plots\n"
        "assert plots.plot_polhodes and plots.view\n"
        "assert not [m for m in sys.modules if m.startswith('matplotlib')]\n"
        "motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.1, 0.2, 1.0])\n"
        "plots.plot_momentum_curve(plots.column_axes(), motion).figure.draw_without_rendering()\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.strip() == "False"


def test_without_matplotlib_the_extra_is_named(motions, monkeypatch):
    ax = flat_axes()
    monkeypatch.setitem(sys.modules, "matplotlib.axes", None)
    with pytest.raises(MissingExtraError, match=r"shapephase\[plot\]"):
        plots.plot_momentum_curve(ax, motions["cat"])
    with pytest.raises(MissingExtraError, match=r"shapephase\[plot\]"):
        plots.column_axes()


@pytest.mark.parametrize(("points", "kind"), [(2_000, "path"), (200_000, "image")])
def test_long_curves_are_images_within_the_figure(points, kind):
    """A recording of ten thousand rows would be megabytes of vectors, and no browser would show them in time."""
    ax = plots.column_axes()
    t = np.linspace(0.0, 1.0, points)
    ax.plot(t, np.sin(1e3 * t**2))
    ax.fill_between(t, 0.0, np.cos(1e3 * t))
    picture = axes_image(ax, "svg")
    assert len(picture) < 4e5
    assert (b"<image" in picture) == (kind == "image")


def test_the_legend_of_reach_is_within_the_column_and_axes_differ_in_grey():
    ax = plots.plot_reach(plots.column_axes(), sp.reachable(sp.load_body("cat_two_halves")))
    ax.figure.draw_without_rendering()
    box = ax.get_legend().get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= ax.figure.canvas.get_width_height()[0]
    assert len({patch.get_hatch() for patch in ax.patches}) == len(ax.patches) == 3


def test_energy_and_polhodes_have_the_same_colours():
    """Blue about the largest moment, orange or vermilion about the smallest, separatrix black, the body's own green."""
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    ax = plots.plot_energy(flat_axes(2.6), motion)
    sphere = plots.plot_polhodes(flat_axes(3.8), EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5]))
    drawn = {line.get_label(): to_rgb(line.get_color()) for line in ax.lines}
    legend = sphere.get_legend()
    named = {text.get_text(): line for text, line in zip(legend.get_texts(), legend.legend_handles, strict=True)}
    assert drawn["$E$"] == to_rgb(named["this top"].get_color())
    assert drawn[r"$\ell^2\!/2I_2$, separatrix"] == to_rgb(named["separatrix"].get_color())
    for band in ax.collections:
        red, _, blue = band.get_facecolor()[0][:3]
        line_red, _, line_blue = to_rgb(named[band.get_label()].get_color())
        assert (red > blue) == (line_red > line_blue)


def test_torques_and_forces_have_their_zeros_at_one_height(motions):
    ax = plots.plot_torques(flat_axes(2.8), motions["satellite"])
    left, right = (axes.get_ylim() for axes in ax.figure.axes)
    assert left[0] / (left[1] - left[0]) == pytest.approx(right[0] / (right[1] - right[0]), rel=1e-12)
    for axes in ax.figure.axes:
        low, high = axes.get_ylim()
        for line in axes.lines:
            assert low < np.min(line.get_ydata()) <= np.max(line.get_ydata()) < high


def test_an_axis_of_metres_has_a_joint_with_a_name():
    """Of a satellite's nine joints the boom moves by 0.2 m, less than six others do in radians."""
    body = sp.load_body("satellite")
    far = {"boom_extension": 0.2, "wheel_spin": 0.0}
    swing = [far.get(name, 1.0) for name in body.joint_names]
    path = sp.ShapePath.waypoints([0.0, 1.0], [np.zeros(len(swing)), swing], joint_names=body.joint_names)
    ax = plots.plot_shape_path(flat_axes(2.8), path, body)
    named = [name for name in labels(ax) if not re.match(r"\d+ others|beyond a limit", name)]
    assert len(named) == 6
    assert "boom_extension [m]" in named


def test_axes_that_share_their_ordinates_keep_the_numbers_of_radians(motions):
    for ax in Figure(figsize=(8.0, 3.0), layout="constrained").subplots(1, 2, sharey=True):
        plots.plot_phases(ax, motions["cat"])
        ax.figure.draw_without_rendering()
        assert any(tick.label2.get_visible() and tick.label2.get_text() for tick in ax.yaxis.get_major_ticks())


def test_a_figure_cut_to_its_content_keeps_the_legend_below_a_sphere():
    """Beside a flat figure the sphere is narrower than its legend."""
    figure = Figure(figsize=(6.8, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    top = EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    plots.plot_polhodes(left, top)
    plots.plot_herpolhode(right, top, 4)
    figure.draw_without_rendering()
    kept = figure.get_tightbbox().padded(0.01)
    for place in left.get_legend().get_window_extent().get_points() / figure.dpi:
        assert kept.contains(*place)


def test_lines_in_axes_of_a_column_have_the_colours_of_okabe_and_ito():
    ax = plots.column_axes()
    assert [line.get_color() for line in ax.plot(np.zeros((2, 3)))] == ["#0072B2", "#D55E00", "#009E73"]
