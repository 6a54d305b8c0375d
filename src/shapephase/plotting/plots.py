"""Every figure of the library: functions that draw into given Matplotlib axes and return them.

Nothing here opens a window or keeps any state; figures, their sizes and files are left to the caller, and `column_axes`
makes a figure one column wide. Importing this does not import Matplotlib: the first drawing does.

    ax = plots.plot_momentum_curve(plots.column_axes(3.8), motion)
    ax.figure.savefig("curve.pdf")
"""

from __future__ import annotations

from .geodesic_plots import plot_caustic, plot_conjugate_locus, plot_ellipsoid_locus
from .momentum_plots import plot_fixed_points, plot_momentum_curve
from .motion_plots import plot_attitude, plot_energy, plot_inertia, plot_internal_momentum, plot_phases
from .plot_style import column_axes
from .polhode_plots import plot_heavy_top_stability, plot_herpolhode, plot_polhodes
from .regime_plots import plot_bounds, plot_crown
from .rolling_plots import plot_cones, plot_rolling_ellipsoid
from .shape_plots import plot_curvature, plot_reach, plot_shape_path, plot_shape_plane
from .torque_plots import plot_torques

__all__ = [
    "column_axes",
    "plot_attitude",
    "plot_bounds",
    "plot_caustic",
    "plot_cones",
    "plot_conjugate_locus",
    "plot_crown",
    "plot_curvature",
    "plot_ellipsoid_locus",
    "plot_energy",
    "plot_fixed_points",
    "plot_heavy_top_stability",
    "plot_herpolhode",
    "plot_inertia",
    "plot_internal_momentum",
    "plot_momentum_curve",
    "plot_phases",
    "plot_polhodes",
    "plot_reach",
    "plot_rolling_ellipsoid",
    "plot_shape_path",
    "plot_shape_plane",
    "plot_torques",
]
