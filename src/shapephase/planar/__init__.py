"""Closed forms of planar bodies without a file: what a pin, a cross, three bodies or two cords make of a turn."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
