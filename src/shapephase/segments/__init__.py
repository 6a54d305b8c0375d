"""Which part of a body does what: momentum by segment, and the share of every limb in a turn."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
