"""Whether a trajectory of somebody else's simulator or recorder is right in flight, and what is wrong if it is not.

`audit` compares it with the laws of a free body and ranks what may explain the difference.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
