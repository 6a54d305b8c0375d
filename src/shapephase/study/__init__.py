"""Studies: the same motion ten thousand times, with other bodies, momenta, paths; computed anywhere, kept as it grows.

A `Study` is a recipe: a body, a motion, what is varied, and what is to be known of each case. `Study.run` computes it
in processes of this machine or on a cluster of Dask and fills a store of Zarr, which goes on where it was left.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
