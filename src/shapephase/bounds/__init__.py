"""What is certain before a body moves: bounds of energy, arc length, return time and phase after Cabrera.

`regime_certificate` names the axis that the momentum circles; `bounds` collects the rest; `gravity_gradient` says
whether a body in orbit is free enough.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
