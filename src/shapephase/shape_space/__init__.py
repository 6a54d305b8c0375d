"""The space of shapes: paths through it, the mechanical connection on it, its curvature and holonomy.

`ShapePath` is a motion of the joints; `mechanical_connection` is the turn of the body while they move; `holonomy`
is what is left of that after a loop. `files` reads recorded motions.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
