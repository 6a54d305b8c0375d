"""The portrait of the free rigid body on the momentum sphere: equilibria, separatrices and polhodes in closed form.

Everything is for |Pi| = 1, from the principal moments alone. Source: Marsden and Ratiu, section 15.3 (figure 15.3.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import moments_argument, whole_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import ascending_moments
from ..letters import value_text
from ._arguments import TWELVE_DIGITS


@dataclass(frozen=True)
class Equilibrium:
    """Steady rotation as a point on the momentum sphere, on a principal axis. Made by `equilibria`."""

    direction: Array
    """(3,) unit vector."""
    kind: str
    """ "centre" (extreme moment), "saddle" (middle moment), "degenerate" (one of a circle or sphere of equilibria)."""
    rate: float
    """Angular frequency about a centre, rate of growth at a saddle, 0 where degenerate; for |Pi| = 1 [1/(kg m^2)]."""

    __repr__ = short_repr


def equilibria(moments: ArrayLike) -> tuple[Equilibrium, ...]:
    """The six steady rotations of a body, axis by axis in the order of its moments, + before −.

    Source: Marsden and Ratiu, 15.3 (figure 15.3.1) and 15.9; theory.md L2.

    Examples
    --------
    >>> saddle = sp.rigid_body.equilibria([1.0, 2.0, 3.0])[2]
    >>> saddle.kind, saddle.direction.tolist()
    ('saddle', [0.0, 1.0, 0.0])
    """
    inertia = moments_argument(moments)
    points = []
    for axis in range(3):
        product = inverse_difference(inertia, (axis + 1) % 3, axis) * inverse_difference(inertia, (axis + 2) % 3, axis)
        kind = "degenerate" if product == 0.0 else "centre" if product > 0.0 else "saddle"
        rate = float(np.sqrt(abs(product)))
        points += [Equilibrium(direction=side * np.eye(3)[axis], kind=kind, rate=rate) for side in (1.0, -1.0)]
    return tuple(points)


def heteroclinics(moments: ArrayLike, count: int = 181) -> Array:
    """The four great half-circles from saddle to saddle, each along its motion: (4, count, 3) unit vectors.

    In axes of ascending moments each lies in a plane, |Pi_1/Pi_3| = sqrt((1/I2 - 1/I3)/(1/I1 - 1/I2)).

    Source: Marsden and Ratiu (15.8.10), whose I1, I2, I3 are our I3, I2, I1, with the signs of theory.md M-E4.
    Raises ShapeError if two moments are equal: the middle axis is then on a circle of equilibria and there is no
    separatrix.

    Examples
    --------
    >>> curve = sp.rigid_body.heteroclinics([1.0, 2.0, 3.0], 5)[0]
    >>> print(curve[[0, -1]].round(6) + 0.0)  # from saddle to saddle
    [[ 0. -1.  0.]
     [ 0.  1.  0.]]
    """
    inertia = moments_argument(moments)
    ascending, order, parity = ascending_moments(inertia)
    if not np.all(np.diff(ascending) > 0.0):
        raise ShapeError(f"moments: three different ones are needed for a separatrix, got {inertia} kg m^2")
    count = whole_argument(count, "count", 2)
    angle = np.linspace(0.0, np.pi, count)
    least = np.sqrt(inverse_difference(ascending, 1, 2) / inverse_difference(ascending, 0, 2))
    most = np.sqrt(inverse_difference(ascending, 0, 1) / inverse_difference(ascending, 0, 2))
    curves = np.empty((4, count, 3))
    for row, (first, third) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)]):
        middle = -parity * first * third * np.cos(angle)
        curves[row][:, order] = np.stack([first * least * np.sin(angle), middle, third * most * np.sin(angle)], axis=-1)
    return curves


def polhodes(moments: ArrayLike, energies: ArrayLike, count: int = 361) -> Array:
    """Curves of constant energy on the sphere of unit momentum, along their motion: (N,) -> (N, 2, count, 3).

    Raises ShapeError if an energy is out of range, or the three moments are equal: then no point of the sphere moves.

    The two curves of an energy circle the same axis on its two sides. At both ends of the range they are points; at
    1/(2 I_middle) each consists of two halves of separatrices.

    Parameters
    ----------
    moments : (3,) in any order [kg m^2]
    energies : (N,) for |Pi| = 1, from 1/(2 I_max) to 1/(2 I_min) [1/(kg m^2)]; for a top its energy over |Pi|^2
    count : points of each closed curve, of which the last is the first again

    Examples
    --------
    >>> curves = sp.rigid_body.polhodes([1.0, 2.0, 3.0], [0.2], 5)
    >>> energy = 0.5 * np.sum(curves**2 / [1.0, 2.0, 3.0], axis=-1)
    >>> curves.shape, np.ptp(energy).round(12).item()
    ((1, 2, 5, 3), 0.0)
    """
    inertia = moments_argument(moments)
    levels = np.atleast_1d(finite_array(energies, "energies", unit="1/(kg m^2)"))
    ascending, order, parity = ascending_moments(inertia)
    lowest, highest = 0.5 / ascending[2], 0.5 / ascending[0]
    if lowest == highest:
        raise ShapeError(f"moments: all are {lowest} kg m^2, and every point of the sphere is at rest; no curves")
    outside = (levels < lowest * (1.0 - TWELVE_DIGITS)) | (levels > highest * (1.0 + TWELVE_DIGITS))
    if levels.ndim != 1 or np.any(outside):
        raise ShapeError(
            f"energies: expected (N,) in [{lowest}, {highest}] 1/(kg m^2) for |Pi| = 1, got {value_text(levels)}"
        )
    count = whole_argument(count, "count", 2)
    phase = np.linspace(0.0, 2.0 * np.pi, count)
    curves = np.empty((len(levels), 2, count, 3))
    for row, level in enumerate(levels):
        below = 2.0 * level * ascending[1] < 1.0 or ascending[1] == ascending[0]
        circled, outer = (2, 0) if below else (0, 2)
        above_circled = 2.0 * level - 1.0 / ascending[circled]
        squares = np.clip([above_circled / inverse_difference(ascending, i, circled) for i in (outer, 1)], 0.0, 1.0)
        a, b = np.sqrt(squares)
        c = np.sqrt((1.0 - squares[0]) * np.cos(phase) ** 2 + (1.0 - squares[1]) * np.sin(phase) ** 2)
        for branch, side in enumerate((1.0, -1.0)):
            along = curves[row, branch]
            along[:, order[outer]] = a * np.cos(phase)
            along[:, order[1]] = parity * side * b * np.sin(phase)
            along[:, order[circled]] = side * c
    return curves


def inverse_difference(moments: Array, first: int, second: int) -> float:
    """1/I_first - 1/I_second, accurate in all digits also for moments that nearly agree [1/(kg m^2)].

    Examples
    --------
    >>> sp.rigid_body.inverse_difference(np.array([1.0, 2.0, 4.0]), 1, 2)
    0.25
    """
    first, second = whole_argument(first, "first", 0), whole_argument(second, "second", 0)
    return float((moments[second] - moments[first]) / (moments[first] * moments[second]))
