"""The free rigid body and its relatives, in closed form where there is one; needs no robot model.

`EulerTop` (momentum, attitude, phases), `Poinsot` (the rolling ellipsoid), steady rotations and their stability, half
twists (Dzhanibekov, tennis racket), Euler angles, the pendulum in the rigid body; heavy and Lagrange tops with their
nutation. `lie` has Lie algebras and their brackets, `geodesics` the metrics of the rigid body. Mostly after Marsden
and Ratiu, Introduction to Mechanics and Symmetry, chapter 15.

Principal moments may be given in any order, and results are on the axes as given; where an order is named, it is
ascending: axis 1 has the smallest moment (see `inertia_tensor`).

Arguments of the wrong shape, out of range or not finite raise `ShapeError`, inertias that are not symmetric
`UnphysicalInertiaError`, inertias that are not positive definite `SingularInertiaError`. Docstrings list what else
raises.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
