"""Deformations: locked inertia I(t) and internal momentum L_o(t), whatever they come from, in any frame.

`articulated`, `particles`, `prescribed`, `rigid` and `assembly` make them; a gauge is the same deformation seen from a
frame that turns.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
