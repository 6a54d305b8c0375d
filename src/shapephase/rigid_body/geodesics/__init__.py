"""Geodesics of the rigid body's metrics: Serret-Andoyer, surfaces of revolution, ellipsoids, left-invariant on SO(3).

Conjugate and cut points, distances, and the variables of Andoyer and Sadov. Mostly after Bonnard, Cots and
Shcherbakova 2013, who number principal moments in descending order: their I_1 > I_2 > I_3 and A < B < C are our
I_3, I_2, I_1 and 1/I_3, 1/I_2, 1/I_1. Moments are taken in any order, and results are on the caller's axes.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
