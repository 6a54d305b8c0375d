"""Worked examples: motions of the bodies that come with the library, and the deformations of Cabrera's paper.

`MOTIONS` has the falling cat, the astronaut and the satellite by name, each a path of joints; `EXAMPLES` deformations
with a momentum and what is known of the motion they make; `slow_antenna` and `first_loop` show how near a slow
deformation is to a rigid body.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
