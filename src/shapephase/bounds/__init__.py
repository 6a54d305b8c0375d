"""Bounds of energy, arc length, return time and phase before a motion is computed, after Cabrera 2006, section 4.

`regime_certificate` names the principal axis that the momentum circles, `crown_region` the part of the momentum sphere
that it can reach, `bounds` lists every bound of a motion with the value it bounds. `gravity_torque_estimate` estimates
the effect of gravity on a body in orbit.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
