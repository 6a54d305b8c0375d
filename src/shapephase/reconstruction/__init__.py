"""From a deformation and a momentum to the attitude: `reconstruct`, and the `Motion` that it returns."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
