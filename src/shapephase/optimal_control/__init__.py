"""Optimal reorientation: motions of the joints that turn a free body by a given rotation at least cost.

`plan_reorientation` finds one; extremals, their residuals and their conjugate times stand beside it. CasADi is used
here and in `integrator` only.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
