"""The rotation split into what the shape does and what the momentum adds: holonomy and Montgomery phase.

`split` for the whole motion, `running_phases` in time, `arc_phases` for parts; `fixed_points` and `closed_orbits` where
shape and momentum close together, `momentum_returns` where the momentum comes back.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
