"""Lie algebras, Lie-Poisson brackets and Euler-Poincare equations, with the rigid body as their example.

Mostly after Marsden and Ratiu, Introduction to Mechanics and Symmetry, chapters 13 to 15.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
