"""Every figure as a panel beside another one: nothing is cut, and nothing stands on the other panel or on a legend.

Nor is anything cut in the image of a notebook, which is cropped to what counts for the layout.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations, product

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure
from matplotlib.transforms import TransformedBbox

import shapephase as sp
from shapephase import plots
from shapephase.examples import MOTIONS, cat_righting, kane_scher
from shapephase.rigid_body import geodesics
from support.long_runs import full_but

SIZES = ((5.8, 3.4), (7.0, 2.8), (8.0, 5.6))  # [in]: narrow, low, high
PIXEL = 1.0  # rounding of letters
TOP = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.3, 0.5, 0.9])


@cache
def motion(name):
    body, momentum = {"cat": ("cat", (0.02, 0.01, 0.03)), "diver": ("diver", (0.0, 61.558831, 0.0))}[name]
    path = {"cat": cat_righting, "diver": MOTIONS["diver_twist"].path}[name]()
    return sp.reconstruct(sp.articulated(sp.load_body(body), path), momentum)


@cache
def shares():
    return sp.contributions(motion("diver"))


def crown():
    tensor = np.diag([1.0, 1.2, 2.0])
    return sp.bounds.crown_region(sp.rigid(tensor, 2.0), [0.1, 0.0, 2.0])


def satellite():
    return sp.load_body("satellite"), MOTIONS["satellite_sweep"].path()


FIGURES = {
    "momentum_curve": lambda ax: plots.plot_momentum_curve(ax, motion("cat")),
    "fixed_points": lambda ax: plots.plot_fixed_points(ax, sp.fixed_points(motion("cat").deformation, 0.02)),
    "phases": lambda ax: plots.plot_phases(ax, motion("cat")),
    "attitude": lambda ax: plots.plot_attitude(ax, motion("diver")),
    "inertia": lambda ax: plots.plot_inertia(ax, motion("cat").deformation),
    "internal_momentum": lambda ax: plots.plot_internal_momentum(ax, motion("cat").deformation),
    "energy": lambda ax: plots.plot_energy(ax, motion("diver")),
    "shape_path": lambda ax: plots.plot_shape_path(ax, satellite()[1], satellite()[0]),
    "shape_path of many": lambda ax: plots.plot_shape_path(ax, cat_righting(), sp.load_body("cat")),
    "shape_plane": lambda ax: plots.plot_shape_plane(ax, cat_righting(), ("waist_pitch", "waist_yaw")),
    "curvature": lambda ax: plots.plot_curvature(
        ax, *satellite()[:1], ("boom_extension", "arm_1"), path=satellite()[1]
    ),
    "loop": lambda ax: plots.plot_loop(ax, sp.load_body("cat_two_halves"), kane_scher(0.0, 0.5)),
    "torques": lambda ax: plots.plot_torques(ax, motion("cat")),
    "segment_momentum": lambda ax: plots.plot_segment_momentum(ax, sp.segment_momentum(motion("cat"))),
    "somersault": lambda ax: plots.plot_somersault(ax, motion("diver")),
    "somersault with error bars": lambda ax: plots.plot_somersault(ax, motion("diver"), momentum=0.5, attitude=0.02),
    "shares": lambda ax: plots.plot_shares(ax, shares()),
    "direct_shares": lambda ax: plots.plot_direct_shares(ax, shares()),
    "reach": lambda ax: plots.plot_reach(ax, sp.reachable(sp.load_body("cat_two_halves"))),
    "polhodes": lambda ax: plots.plot_polhodes(ax, TOP),
    "herpolhode": lambda ax: plots.plot_herpolhode(ax, TOP),
    "heavy_top_stability": lambda ax: plots.plot_heavy_top_stability(ax, [[1.5, 1.2]]),
    "rolling_ellipsoid": lambda ax: plots.plot_rolling_ellipsoid(ax, TOP, 1.0),
    "cones": lambda ax: plots.plot_cones(ax, sp.EulerTop.principal([1.0, 1.0, 1.7], [0.3, 0.5, 0.8])),
    "crown": lambda ax: plots.plot_crown(ax, crown()),
    "bounds": lambda ax: plots.plot_bounds(ax, sp.bounds.bounds(motion("cat"))),
    "conjugate_locus": lambda ax: plots.plot_conjugate_locus(ax, [3.0, 2.0, 1.0]),
    "surface_locus": lambda ax: plots.plot_surface_locus(ax, geodesics.ellipsoid(0.8)),
    "potential": lambda ax: plots.plot_potential(ax, [3.0, 2.0, 1.0]),
    "first_return": lambda ax: plots.plot_first_return(ax, [3.0, 2.0, 1.0]),
    "euler_angles": lambda ax: plots.plot_euler_angles(ax, [0.7, 0.9, 1.0]),
    "elliptic_cylinders": lambda ax: plots.plot_elliptic_cylinders(ax, TOP),
    "pendulum": lambda ax: plots.plot_pendulum(ax, TOP),
    "caustic": lambda ax: plots.plot_caustic(ax, [2.0, 2.0, 1.0], circles=8),
}
SOLID = ("caustic",)


def beside(plot, size, projection=None):
    """A figure with two panels of one kind; the axes of each panel with those that the plot adds."""
    figure = Figure(figsize=size, layout="constrained")
    panels = []
    for ax in figure.subplots(1, 2, subplot_kw={"projection": projection}):
        before = set(figure.axes)
        plot(ax)
        panels.append([ax, *(other for other in figure.axes if other not in before and other is not ax)])
    figure.draw_without_rendering()
    return figure, panels


def words_of(panel):
    """Labels, ticks, texts and legends of a panel: name and box [pixels]."""
    found = []
    for ax in [*panel, *(child for parent in panel for child in parent.child_axes)]:
        if ax.get_legend():
            found.append(("legend", ax.get_legend().get_window_extent()))
        texts = [ax.title, *ax.texts]
        if ax.axison:
            for axis in (ax.xaxis, ax.yaxis, *([ax.zaxis] if ax.name == "3d" else [])):
                low, high = sorted(axis.get_view_interval())
                ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
                texts += [axis.label, *(label for tick in ticks for label in (tick.label1, tick.label2))]
        for text in texts:
            if text.get_visible() and text.get_text().strip() and not hasattr(text, "arrow_patch"):
                found.append((f"{text.get_text()!r}", text.get_window_extent()))
    return [(name, box) for name, box in found if box.width > 0.0 and box.height > 0.0]


def overlap(one, other):
    """Whether two boxes have more than a pixel in common both ways."""
    common = np.minimum(one.max, other.max) - np.maximum(one.min, other.min)
    return bool(np.all(common > PIXEL))


def faults(figure, panels):
    """What is cut, and what covers what it should not."""
    found = []
    words = [words_of(panel) for panel in panels]
    cropped = figure.get_tightbbox().padded(rcParams["savefig.pad_inches"])
    pages = {"": figure.bbox, " in a notebook": TransformedBbox(cropped, figure.dpi_scale_trans)}
    for own in words:
        for (name, box), (where, page) in product(own, pages.items()):
            if np.any(box.min < page.min - PIXEL) or np.any(box.max > page.max + PIXEL):
                found.append(f"{name} is cut{where}")
    for (panel, own), (other_panel, other) in combinations(zip(panels, words), 2):
        for mine, theirs, frames in ((own, other, other_panel), (other, own, panel)):
            for name, box in mine:
                found += [f"{name} is on the other panel" for ax in frames if overlap(box, ax.get_window_extent())]
                found += [f"{name} is on {there} of the other panel" for there, place in theirs if overlap(box, place)]
    for panel, own in zip(panels, words):
        legend = [box for name, box in own if name == "legend"]
        for box in legend:
            found += [f"the legend is on {name}" for name, place in own if name != "legend" and overlap(box, place)]
            curves = [
                line.get_window_extent()
                for line in panel[0].lines
                if not panel[0].axison and len(line.get_xdata()) > 20
            ]
            found += ["the legend is on the picture" for place in curves if overlap(box, place)]
    return list(dict.fromkeys(found))


def legend_in_the_margin(ax):
    """A legend that no layout knows, beside the axes."""
    ax.plot([0.0, 1.0], [0.0, 1.0], label="a curve with a name")
    ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5)).set_in_layout(False)


def legend_on_a_sphere(ax):
    """A sphere that takes all of its axes, and a legend below its middle."""
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    ax.plot(np.cos(turn), np.sin(turn), label="the limb of a sphere")
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.legend(loc="lower center")


@pytest.mark.parametrize(
    ("plot", "fault"),
    [
        (legend_in_the_margin, "legend is on the other panel"),
        (legend_in_the_margin, "legend is cut"),
        (legend_in_the_margin, "legend is cut in a notebook"),
        (legend_on_a_sphere, "the legend is on the picture"),
    ],
)
def test_bad_figures_are_found(plot, fault):
    assert fault in faults(*beside(plot, SIZES[1]))


def test_every_public_figure_is_a_case():
    assert {f"plot_{name.split()[0]}" for name in FIGURES} == {n for n in plots.__all__ if n.startswith("plot_")}


# The other sizes of the others in the full run: every legend that was cut or on something is here.
KEPT = [("momentum_curve", SIZES[1]), *((name, SIZES[0]) for name in ("momentum_curve", "attitude", "herpolhode"))]
KEPT += [(name, SIZES[0]) for name in ("rolling_ellipsoid", "cones", "loop", "shape_path")]


@pytest.mark.parametrize(("name", "size"), full_but([*product(FIGURES, SIZES)], *KEPT))
def test_a_figure_beside_another_one(name, size):
    figure, panels = beside(FIGURES[name], size, "3d" if name in SOLID else None)
    assert faults(figure, panels) == []
