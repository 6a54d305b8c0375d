"""What motions of the joints alone can turn a free body to, by which loops, and in which frame that is seen best."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
