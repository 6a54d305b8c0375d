"""How far results may be off: derivatives by path, inertias, momentum and start, and the error bars that follow.

`uncertainty` for error bars to first order, `sampled_uncertainty` for the same by drawing, `derivatives` for the exact
derivatives that the first is made of.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
