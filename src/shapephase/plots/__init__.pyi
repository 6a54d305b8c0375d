from ._moving_scene import MovingScene, moving_scene
from .chart_plots import plot_elliptic_cylinders, plot_euler_angles, plot_pendulum
from .geodesic_plots import plot_caustic, plot_conjugate_locus, plot_first_return, plot_potential, plot_surface_locus
from .loop_plots import plot_loop
from .momentum_plots import plot_fixed_points, plot_momentum_curve
from .motion_plots import plot_attitude, plot_energy, plot_inertia, plot_internal_momentum, plot_phases, plot_torques
from .named_figures import FIGURES, Figure, write_figure
from .pages.explorer import explore
from .pages.page import Page
from .pages.poinsot_page import rolling_ellipsoid
from .pages.report_page import report
from .pages.segments_page import contributions_page, momentum_page
from .pages.viewer import view
from .plot_style import column_axes
from .polhode_plots import plot_heavy_top_stability, plot_herpolhode, plot_polhodes
from .regime_plots import plot_bounds, plot_crown
from .rolling_plots import plot_cones, plot_rolling_ellipsoid
from .segment_plots import (
    contributions_figure,
    plot_direct_shares,
    plot_segment_momentum,
    plot_shares,
    plot_somersault,
)
from .shape_plots import plot_curvature, plot_reach, plot_shape_path, plot_shape_plane

__all__ = [
    "FIGURES",
    "Figure",
    "MovingScene",
    "Page",
    "column_axes",
    "contributions_figure",
    "contributions_page",
    "explore",
    "momentum_page",
    "moving_scene",
    "plot_attitude",
    "plot_bounds",
    "plot_caustic",
    "plot_cones",
    "plot_conjugate_locus",
    "plot_crown",
    "plot_curvature",
    "plot_direct_shares",
    "plot_elliptic_cylinders",
    "plot_energy",
    "plot_euler_angles",
    "plot_first_return",
    "plot_fixed_points",
    "plot_heavy_top_stability",
    "plot_herpolhode",
    "plot_inertia",
    "plot_internal_momentum",
    "plot_loop",
    "plot_momentum_curve",
    "plot_pendulum",
    "plot_phases",
    "plot_polhodes",
    "plot_potential",
    "plot_reach",
    "plot_rolling_ellipsoid",
    "plot_segment_momentum",
    "plot_shape_path",
    "plot_shape_plane",
    "plot_shares",
    "plot_somersault",
    "plot_surface_locus",
    "plot_torques",
    "report",
    "rolling_ellipsoid",
    "view",
    "write_figure",
]
