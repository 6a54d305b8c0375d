"""The body: a URDF, an MJCF file or a Pinocchio model, checked and frozen.

`load_body` turns a name or a file into a `Body`, which gives the locked inertia I(r), the momentum matrix J(r), their
exact derivatives, the centre of mass and the poses of links. Every hazard of a file ends here, and Pinocchio is used
nowhere else.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
