"""What is certain before a motion is computed: bounds of energy, arc length, return time and phase after Cabrera.

`regime_certificate` names the principal axis that the momentum circles, `crown_region` the part of the momentum sphere
that it can reach, `bounds` lists every bound of a motion with the value it bounds. `gravity_torque_estimate` says
whether a body in orbit turns as a free one.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
