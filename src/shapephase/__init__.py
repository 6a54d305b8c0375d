"""shapephase: a free body changes its shape in a known way; how does it turn?

The folders are the rooms of the theory, from the bottom up: `body` (a model and its inertia), `integrator` and
`rigid_body` (rotations, in general and in closed form), `shape_space` (paths, connection, holonomy), `deformation`
(inertia and internal momentum in time), `reconstruction` (the attitude), `dynamics` (what drives it), `phases`,
`bounds` and `optimal_control`,
`plots` and `examples`, `study` (many of all that), `auditing` (is somebody else's trajectory right?). Names are
loaded when they are first used.
"""

from lazy_loader import attach_stub

from .offers import offer

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)

offer("Motion.plot", "shapephase.plots.named_figures", "motion_figure")
offer("Motion.to_xarray", "shapephase.exports.tables", "motion_dataset")
offer("Motion.view", "shapephase.plots.viewer", "view")
