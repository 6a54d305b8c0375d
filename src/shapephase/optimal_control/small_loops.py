"""Small loops of shapes that turn a body furthest for their length: circles in a metric, by an eigenvalue problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import number_argument, positive_argument, vector_argument
from ..arrays import Array, lock_arrays
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..display import short_repr
from ..errors import ShapeError
from ..shape_space.connection import curvature
from ..shape_space.shape_path import ShapePath
from .cost_metric import metric_argument
from .extremals.hamiltonian import checked_metric


@dataclass(frozen=True, eq=False)
class SmallLoop:
    """Circle of shapes, in the metric of a cost, that turns a body furthest for its length. Made by `small_loop`.

    In the coordinates of the shape it is an ellipse. Turns and costs hold to first order in the area: the
    error of a turn is of the order of the radius cubed.

    Attributes
    ----------
    joint_names : names in the order of a shape
    shape : (n,) centre
    axis : (3,) unit vector, base axes
    first, second : (n,) directions of the circle, orthonormal in the metric; it goes from `first` to `second`
    turn : (3,) rotation vector for each unit of the circle's area in the metric, base axes
    """

    joint_names: tuple[str, ...]
    shape: Array
    axis: Array
    first: Array
    second: Array
    turn: Array

    __post_init__ = lock_arrays
    __repr__ = short_repr

    @property
    def turn_about_axis(self) -> float:
        """Largest singular value of the curvature along the axis, in the metric."""
        return float(self.turn @ self.axis)

    def radius(self, angle: float) -> float:
        """Radius, in the metric, of the circle that turns the body by an angle about the axis [rad]."""
        return float(np.sqrt(number_argument(angle, "angle") / (np.pi * self.turn_about_axis)))

    def cost(self, angle: float, duration: float = 1.0) -> float:
        """Least cost of a small turn about the axis [rad] in a duration [s]: the integral of 1/2 r' g r'."""
        length = 2.0 * np.pi * self.radius(angle)
        return 0.5 * length**2 / positive_argument(duration)

    def path(self, angle: float, duration: float = 1.0) -> ShapePath:
        """Path round the circle that turns the body by about an angle [rad], at even pace, in a duration [s]."""
        radius = self.radius(angle)
        cosine, sine = (radius * direction[:, None] for direction in (self.first, self.second))
        return ShapePath.fourier(self.shape, cosine, sine, duration, joint_names=self.joint_names)


def small_loop(
    body: Body | ParticleBody | str,
    shape: ArrayLike,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    *,
    metric: Any = "kinetic",
) -> SmallLoop:
    """Return the small loop about a shape that turns a body most about an axis for its length.

    With F the curvature along the axis and g the metric, i g^-1/2 F g^-1/2 is Hermitian: the real and imaginary part of
    the eigenvector of its largest eigenvalue sigma span the plane of the loop. A circle of radius rho turns the body by
    pi rho^2 sigma; a small turn theta in a time T costs 2 pi theta / (sigma T), and no small loop turns it cheaper.

    Equation :eq:`small-loop` of the documentation.
    Source: Shapere and Wilczek, Gauge kinematics of deformable bodies, Am. J. Phys. 57 (1989) 514-518; Montgomery 1990.

    Parameters
    ----------
    shape : (n,) [rad or m]
    axis : (3,) base axes, of any length
    metric : see `extremal`

    Raises
    ------
    ShapeError
        For wrong shapes, an axis of no length, or if no small loop turns the body about the axis.
    SingularInertiaError
        See `extremal`.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> loop = sp.optimal_control.small_loop(cat, np.zeros(3), [1.0, 0.0, 0.0])
    >>> print(f"{loop.cost(np.radians(1.0)):.6f} J s")
    0.000313 J s
    """
    body = as_body_or_particles(body)
    centre, direction = vector_argument(shape, "shape", body.n_shape), vector_argument(axis, "axis", 3)
    if not direction.any():
        raise ShapeError("axis: a vector (3,) that is not zero is needed, got zeros")
    unit = so3.normalised(direction)
    given = metric_argument(body, metric, "metric")
    gram = checked_metric(body, given, centre[None])[0]
    field = curvature(body, centre)
    plane = widest_plane(field @ unit, gram)
    if plane is None:
        raise ShapeError(
            f"{body.name}: no small loop about this shape turns it about {unit.round(6).tolist()}; take another axis "
            "or shape (`curvature` has the turns of all planes)"
        )
    first, second = plane
    return SmallLoop(body.joint_names, centre, unit, first, second, -np.einsum("i,ijk,j->k", first, field, second))


_FLAT = 1e-9  # curvature in units of the metric below which loops turn the body by rounding alone


def widest_plane(form: Array, metric: Array) -> tuple[Array, Array] | None:
    """Two directions orthonormal in a metric, with the largest value of an antisymmetric form; None where it is zero.

    A loop from the first to the second turns by minus the form, which is positive.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(metric))
    values, vectors = np.linalg.eigh(1j * inverse @ form @ inverse.T)
    if values[-1] * np.linalg.norm(metric) <= _FLAT:
        return None
    first, second = (np.sqrt(2.0) * inverse.T @ part(vectors[:, -1]) for part in (np.real, np.imag))
    return (first, second) if first @ form @ second < 0.0 else (first, -second)
