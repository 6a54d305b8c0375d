"""shapephase: a free body changes its shape in a known way; how does it turn?

The folders are the rooms of the theory, from the bottom up: `body` (a model and its inertia), `integrator` and
`rigid_body` (rotations, in general and in closed form), `shape_space` (paths, connection, holonomy), `deformation`
(inertia and internal momentum in time), `reconstruction` (the attitude), `dynamics` (what drives it), `phases`,
`bounds`, `optimal_control` and `inverse_design` (`design`), `segments` (the part of every limb), `plots` and
`examples`, `study` (many cases), `auditing` (is a simulated or recorded trajectory right?). `dir()` lists the rooms and
the names that most scripts use; every public name of a room is an attribute of that room. Names are loaded when they
are first used.
"""

from difflib import get_close_matches
from typing import Any

from lazy_loader import attach_stub

from .offers import offer

__version__ = "0.1.0"

_loaded, _, __all__ = attach_stub(__name__, __file__)

_SHOWN = """
auditing body bounds deformation dynamics error_bars errors examples exports optimal_control phases plots
reconstruction rigid_body segments shape_space so3 study
EulerTop InertiaErrors ShapePath articulated audit contributions curvature design export_motion holonomy in_gauge
joint_torques
load_body load_motion mechanical_connection particle_body plan_reorientation
reachable read_recorded_motion read_shape_path read_trajectory reconstruct rigid robot_names segment_momentum split
uncertainty
""".split()  # noqa: SIM905


def __getattr__(name: str) -> Any:
    if name in __all__ or name.startswith("_"):
        return _loaded(name)
    near = get_close_matches(name, __all__, 1)
    hint = f"; did you mean {near[0]}?" if near else "; dir(shapephase) lists the names"
    raise AttributeError(f"shapephase has no {name!r}{hint}", name=name)


def __dir__() -> list[str]:
    return sorted(_SHOWN)


offer("Motion.plot", "shapephase.plots.named_figures", "motion_figure")
offer("Motion.segment_momentum", "shapephase.segments.momentum", "segment_momentum")
offer("Motion.to_xarray", "shapephase.exports.tables", "motion_dataset")
offer("Motion.view", "shapephase.plots.pages.viewer", "view")
offer("named_motion", "shapephase.examples.scenarios", "named_motion")
