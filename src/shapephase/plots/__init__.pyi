from ._moving_scene import MovingScene, moving_scene
from .contribution_plots import contributions_figure, plot_direct_shares, plot_shares
from .explorer import explore
from .geodesic_plots import plot_caustic, plot_conjugate_locus, plot_ellipsoid_locus
from .loop_plots import plot_loop
from .momentum_plots import plot_fixed_points, plot_momentum_curve
from .motion_plots import plot_attitude, plot_energy, plot_inertia, plot_internal_momentum, plot_phases
from .named_figures import FIGURES, Figure, write_figure
from .page import Page
from .pages.poinsot_page import rolling_ellipsoid
from .plot_style import column_axes
from .polhode_plots import plot_heavy_top_stability, plot_herpolhode, plot_polhodes
from .regime_plots import plot_bounds, plot_crown
from .report_page import report
from .rolling_plots import plot_cones, plot_rolling_ellipsoid
from .segment_plots import plot_segment_momentum, plot_somersault
from .segments_page import contributions_page, momentum_page
from .shape_plots import plot_curvature, plot_reach, plot_shape_path, plot_shape_plane
from .torque_plots import plot_torques
from .viewer import view

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
    "plot_ellipsoid_locus",
    "plot_energy",
    "plot_fixed_points",
    "plot_heavy_top_stability",
    "plot_herpolhode",
    "plot_inertia",
    "plot_internal_momentum",
    "plot_loop",
    "plot_momentum_curve",
    "plot_phases",
    "plot_polhodes",
    "plot_reach",
    "plot_rolling_ellipsoid",
    "plot_segment_momentum",
    "plot_shape_path",
    "plot_shape_plane",
    "plot_shares",
    "plot_somersault",
    "plot_torques",
    "report",
    "rolling_ellipsoid",
    "view",
    "write_figure",
]
