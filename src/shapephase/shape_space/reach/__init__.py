"""Rotations that motions of the joints alone reach, the loops that do it, and the frame that shows it best."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
