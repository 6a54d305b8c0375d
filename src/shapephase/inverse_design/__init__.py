"""Inverse design: the member of a family of deformations whose phase, attitude or regime is the wanted one.

`design` finds it, or says by enclosures over the whole family that there is none.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
