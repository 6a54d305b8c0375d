"""Results as figures (Matplotlib), as a page in 3-D (viser) and as a report in one file."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
