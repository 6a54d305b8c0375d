"""From I(t) and L_o(t) to rotations: sampling, interpolation, stepping, and error estimates.

A deformation is sampled as Chebyshev series (`sampling`), which are stepped by an eighth-order formula
(`integrate`); the linearised equation shows how errors grow. Knows nothing of bodies, shapes or phases.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
