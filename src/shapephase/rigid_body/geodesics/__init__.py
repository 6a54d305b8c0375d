"""Geodesics of the rigid body's metrics: Serret-Andoyer, surfaces of revolution, ellipsoids, left-invariant on SO(3).

Conjugate and cut points, distances, and the variables of Andoyer and Sadov. Mostly after Bonnard, Cots and
Shcherbakova 2013.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
