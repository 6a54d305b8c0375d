"""Named, ready cases: the falling cat, an astronaut, an antenna, and the deformations of Cabrera's paper."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
