"""Draw the pictures of the gallery: `python docs/gallery/draw.py`, or with the names of some of them.

They are written beside this file, in 128 colours.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from io import BytesIO
from pathlib import Path

from matplotlib.axes import Axes
from PIL import Image

import shapephase as sp
from shapephase import plots
from shapephase.examples import MOTIONS
from shapephase.plots import column_axes

HERE = Path(__file__).parent
# Dots per inch: 440 pixels wide, as a column of the page.
RESOLUTION = 130
COLOURS = 128
# Angular momenta [kg m^2/s], and the shape of the loop of Kane and Scher [rad].
MOMENTA = {
    "astronaut": (0.5, 2.0, 3.0),
    "cat": (0.0, 0.0, 0.0),
    "cat_two_halves": (0.0, 0.002, 0.005),
    "diver": (0.0, 61.558831, 0.0),
}
BEND = 1.037187
# Pictures in space.
SOLID = ("caustic", "loop_space")
TOP = ([1.0, 2.0, 3.0], [0.3, 0.5, 0.9])


@cache
def motion(body: str, name: str) -> sp.Motion:
    """A motion of the library, with its momentum."""
    path = sp.examples.kane_scher(0.0, BEND) if name == "kane_scher" else MOTIONS[name].path()
    return sp.reconstruct(sp.articulated(sp.load_body(body), path), MOMENTA[body])


def top(moments: list[float], momentum: list[float]) -> sp.EulerTop:
    """A free rigid body by its principal moments [kg m^2]."""
    return sp.EulerTop.principal(moments, momentum)


DRAWINGS: dict[str, tuple[float, Callable[[Axes], object]]] = {
    "loop": (5.2, lambda ax: plots.plot_loop(ax, sp.load_body("cat"), MOTIONS["cat_righting"].path())),
    "loop_principal": (
        5.2,
        lambda ax: plots.plot_loop(
            ax, sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, BEND), "principal", axis="norm"
        ),
    ),
    "curvature": (
        2.8,
        lambda ax: plots.plot_curvature(
            ax, sp.load_body("satellite"), ("arm_1", "boom_extension"), path=MOTIONS["satellite_sweep"].path()
        ),
    ),
    "reach": (2.8, lambda ax: plots.plot_reach(ax, sp.reachable(sp.load_body("cat")))),
    "attitude": (2.8, lambda ax: plots.plot_attitude(ax, motion("diver", "diver_twist"))),
    "energy": (2.8, lambda ax: plots.plot_energy(ax, motion("diver", "diver_twist"))),
    "joints": (2.8, lambda ax: plots.plot_shape_path(ax, MOTIONS["cat_righting"].path(), sp.load_body("cat"))),
    "momentum": (3.9, lambda ax: plots.plot_momentum_curve(ax, motion("cat_two_halves", "kane_scher"))),
    "phases": (2.8, lambda ax: plots.plot_phases(ax, motion("cat_two_halves", "kane_scher"))),
    "segment_momentum": (
        3.4,
        lambda ax: plots.plot_segment_momentum(ax, sp.segment_momentum(motion("cat", "cat_righting")), "z"),
    ),
    "direct_shares": (2.8, lambda ax: plots.plot_direct_shares(ax, sp.contributions(motion("cat", "cat_righting")))),
    "shares": (2.8, lambda ax: plots.plot_shares(ax, sp.contributions(motion("cat", "cat_righting")))),
    "solid_angle": (3.9, lambda ax: plots.plot_momentum_curve(ax, motion("astronaut", "astronaut_leg_swing"))),
    "polhodes": (3.8, lambda ax: plots.plot_polhodes(ax, top(*TOP))),
    "separatrix": (3.8, lambda ax: plots.plot_polhodes(ax, top([3.0, 6.0, 8.0], [0.5, 0.3, 1.0]))),
    "herpolhode": (3.8, lambda ax: plots.plot_herpolhode(ax, top(*TOP))),
    "rolling": (3.6, lambda ax: plots.plot_rolling_ellipsoid(ax, top(*TOP), 1.0)),
    "cones_oblate": (3.6, lambda ax: plots.plot_cones(ax, top([1.0, 1.0, 1.7], [0.3, 0.5, 0.8]))),
    "cones_prolate": (3.6, lambda ax: plots.plot_cones(ax, top([2.0, 2.0, 0.8], [0.3, 0.5, 0.8]))),
    "caustic": (3.6, lambda ax: plots.plot_caustic(ax, [2.0, 2.0, 1.0])),
    "loop_space": (
        5.2,
        lambda ax: plots.plot_loop(
            ax, sp.load_body("cat"), MOTIONS["cat_righting"].path(), ("waist_pitch", "waist_yaw", "neck_yaw")
        ),
    ),
}


def draw(name: str, folder: Path = HERE) -> Path:
    """Write one of the pictures; returns its file."""
    height, drawing = DRAWINGS[name]
    ax = column_axes(height, projection="3d" if name in SOLID else None)
    drawing(ax)
    stream = BytesIO()
    ax.figure.savefig(stream, format="png", dpi=RESOLUTION)
    file = folder / f"{name}.png"
    Image.open(stream).convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        file, optimize=True
    )
    return file


if __name__ == "__main__":
    for chosen in sys.argv[1:] or DRAWINGS:
        print(draw(chosen))
