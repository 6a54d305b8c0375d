"""Motions for other programs: tables and data sets, vectors of simulators, attitudes of spacecraft, skeletons."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
