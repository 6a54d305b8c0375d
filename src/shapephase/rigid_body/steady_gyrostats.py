"""Steady rotations of a gyrostat: how many, how stable, and at which rotors their number changes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import positive_argument, whole_argument
from ..arrays import Array, finite_array, lock_arrays
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import body_principal_axes
from ..roots import bracketed_root
from ._arguments import one_array, one_tensor

_ROUNDING = 4.0 * float(
    np.finfo(float).eps
)  # relative difference of inverse moments, or part of the rotor along an axis


@dataclass(frozen=True, eq=False)
class GyrostatEquilibrium:
    """Steady rotation of a gyrostat about its momentum. Made by `gyrostat_equilibria`.

    Attributes
    ----------
    direction : (3,) of the momentum, body axes
    rate : of the body about it, negative where it turns backward [rad/s]
    energy : omega.I omega/2 [J]
    stability : "least energy", "most energy" or "saddle"; only the first withstands friction
    frequency : of small oscillations about a stable one, or the rate of growth from a saddle [rad/s]
    """

    direction: Array
    rate: float
    energy: float
    stability: str
    frequency: float

    __post_init__ = lock_arrays
    __repr__ = short_repr


def gyrostat_equilibria(inertia: ArrayLike, rotor: ArrayLike, magnitude: float) -> tuple[GyrostatEquilibrium, ...]:
    """The steady rotations with |Pi| = `magnitude`, by ascending energy: 6, 4 or 2 of them.

    There omega = r Pi/|Pi|, and with c = r/|Pi| and b = h/|Pi| the direction is x_i = a_i b_i/(a_i - c), a = 1/I, where
    the sum of x_i^2 is 1. Where a symmetric body has whole circles of them, two of each circle are given.

    Source: Wittenburg 1977, section 4.6.2; Hughes 1986, chapter 6.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2]
    rotor : (3,) momentum of the rotor, body axes [kg m^2/s]
    magnitude : of the momentum, above 0 [kg m^2/s]

    Examples
    --------
    >>> len(sp.rigid_body.gyrostat_equilibria(np.diag([1.0, 2.0, 3.0]), [1.0, 2.0, 1.0], 1.0))
    2
    """
    momentum = one_array(rotor, "rotor", (3,), "kg m^2/s")
    size = positive_argument(magnitude, "magnitude", "a momentum in kg m^2/s")
    moments, axes = body_principal_axes(one_tensor(inertia))
    a, b = 1.0 / moments, axes.T @ momentum / size
    b = np.where(np.abs(b) <= _ROUNDING * np.abs(b).max(), 0.0, b)
    equilibria = [_described(a, b, x, size, axes) for x in _directions(a, b)]
    return tuple(sorted(equilibria, key=lambda equilibrium: equilibrium.energy))


def bifurcation_rotors(inertia: ArrayLike, rotor_axis: ArrayLike) -> Array:
    """Momenta of a rotor about an axis, over |Pi|, at which the number of steady rotations changes: (k,) ascending.

    Source: the equation of `gyrostat_equilibria`, whose left side is convex between two of its poles.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2]
    rotor_axis : (3,) not zero, body axes

    Examples
    --------
    >>> sp.rigid_body.bifurcation_rotors(np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 1.0])  # |1 - I3/I|
    array([1., 3.])
    """
    moments, axes = body_principal_axes(one_tensor(inertia))
    n = axes.T @ _unit(rotor_axis)
    n = np.where(np.abs(n) <= _ROUNDING, 0.0, n)
    a = 1.0 / moments
    weights, poles = _poles(a, n)
    places = [_least(weights, poles, left, right) for left, right in pairwise(poles)] + _bare(a, n)
    return np.sort([1.0 / np.sqrt(_sum(place, weights, poles)) for place in places])


@dataclass(frozen=True, eq=False)
class DualSpinTurn:
    """Turn of a body whose rotor slowly takes up all momentum. Made by `dual_spin_turn`.

    Attributes
    ----------
    rotor : (N,) momentum of the rotor, from 0 to all of it [kg m^2/s]
    direction : (N, 3) of the momentum in the body, from the axis of the largest moment to that of the rotor
    rate : (N,) of the body about it [rad/s]
    """

    rotor: Array
    direction: Array
    rate: Array

    __post_init__ = lock_arrays
    __repr__ = short_repr


def dual_spin_turn(inertia: ArrayLike, rotor_axis: ArrayLike, magnitude: float, count: int = 101) -> DualSpinTurn:
    """Turn of a body whose rotor slowly takes up all momentum, from a spin about the axis of the largest moment.

    The body stays in its steady rotation of least energy, which friction favours, and ends at rest with the rotor's
    axis along the momentum.

    Source: Kaplan 1976, section 5.4; Hughes 1986, chapter 6.
    Raises ShapeError if the rotor's axis is zero, or at right angles to that of the largest moment.

    Parameters
    ----------
    inertia : (3, 3) [kg m^2]
    rotor_axis : (3,) body axes, not at right angles to the axis of the largest moment
    magnitude : of the momentum [kg m^2/s]
    count : of steps, 2 or more, evenly spaced in the body's rate

    Examples
    --------
    >>> turn = sp.rigid_body.dual_spin_turn(np.diag([1.0, 2.0, 3.0]), [1.0, 0.0, 1.0], 1.0, 3)
    >>> turn.rotor.round(6).tolist()
    [0.0, 0.606339, 1.0]
    """
    size = positive_argument(magnitude, "magnitude", "a momentum in kg m^2/s")
    steps = whole_argument(count, "count", 2)
    moments, axes = body_principal_axes(one_tensor(inertia))
    n, a = axes.T @ _unit(rotor_axis), 1.0 / moments
    if abs(n[2]) <= _ROUNDING:
        raise ShapeError("rotor_axis: it is at right angles to the axis of the largest moment, and nothing turns it")
    c = a[2] * np.linspace(1.0, 0.0, steps)
    # x_i = k a_i n_i/(a_i - c); both divided by the term that is infinite at the start.
    direction = a * n * (a[2] - c)[:, None] / np.where(np.arange(3) == 2, 1.0, a - c[:, None])
    direction[:, 2] = a[2] * n[2]
    length = np.linalg.norm(direction, axis=1)
    return DualSpinTurn(
        rotor=size * (a[2] - c) / length, direction=(direction / length[:, None]) @ axes.T, rate=size * c
    )


def _unit(axis: ArrayLike) -> Array:
    vector = finite_array(axis, "rotor_axis", (3,))
    length = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not length:
        raise ShapeError(f"rotor_axis: one direction (3,), not zero, is needed, got shape {vector.shape}")
    return vector / length


def _poles(a: Array, b: Array) -> tuple[Array, Array]:
    """Weights and poles, ascending, of the terms (a_i b_i)^2/(a_i - c)^2; terms of equal poles are added."""
    weights: list[float] = []
    poles: list[float] = []
    for k in np.argsort(a):
        if b[k] == 0.0:
            continue
        if poles and abs(a[k] - poles[-1]) <= _ROUNDING * a[k]:
            weights[-1] += float((a[k] * b[k]) ** 2)
        else:
            weights.append(float((a[k] * b[k]) ** 2))
            poles.append(float(a[k]))
    return np.array(weights), np.array(poles)


def _bare(a: Array, b: Array) -> list[float]:
    """Inverse moments of axes along which the rotor has no component, if they are not poles."""
    poles = a[b != 0.0]
    return [float(a[k]) for k in range(3) if b[k] == 0.0 and np.all(np.abs(poles - a[k]) > _ROUNDING * a[k])]


def _sum(place: float, weights: Array, poles: Array) -> float:
    return float(np.sum(weights / (poles - place) ** 2))


def _least(weights: Array, poles: Array, left: float, right: float) -> float:
    """Minimum of the sum between two poles, a root of its slope, which ascends."""

    def slope(place: float) -> float:
        return float(np.sum(weights / (poles - place) ** 3))

    inset = 1e-9 * (right - left)
    return bracketed_root(slope, left + inset, right - inset)


def _directions(a: Array, b: Array) -> list[Array]:
    """All x with x_i = a_i b_i/(a_i - c) and |x| = 1."""
    directions: list[Array] = []
    weights, poles = _poles(a, b)
    for place in _bare(a, b):
        others = np.abs(a - place) > _ROUNDING * a
        x = np.where(others, a * b / np.where(others, a - place, 1.0), 0.0)
        rest = 1.0 - float(x @ x)
        if rest > 0.0:
            free = int(np.argmin(np.abs(a - place)))
            directions += [x + sign * np.sqrt(rest) * np.eye(3)[free] for sign in (1.0, -1.0)]
    if not len(poles):
        return directions
    reach = float(np.sqrt(weights.sum()))
    # Each root by its distance from a pole, which keeps all digits: outside the poles, on both sides of each minimum.
    sides = [(poles[0], -1.0, reach), (poles[-1], 1.0, reach)]
    for left, right in pairwise(poles):
        middle = _least(weights, poles, left, right)
        if _sum(middle, weights, poles) < 1.0:
            sides += [(left, 1.0, middle - left), (right, -1.0, right - middle)]
    for pole, side, far in sides:
        near = float(np.sqrt(weights[poles == pole][0]))
        gaps = poles - pole

        def excess(distance: float, gaps: Array = gaps, side: float = side) -> float:
            return float(np.sum(weights / (gaps - side * distance) ** 2)) - 1.0

        at = near if excess(near) <= 0.0 else bracketed_root(excess, near, far * (1.0 + _ROUNDING))
        x = a * b / np.where(b == 0.0, 1.0, (a - pole) - side * at)
        directions.append(x / np.linalg.norm(x))
    return directions


def _described(a: Array, b: Array, x: Array, magnitude: float, axes: Array) -> GyrostatEquilibrium:
    turning = a * (x - b)
    c = float(turning @ x)
    plane = np.linalg.svd(x[None])[2][1:]
    low, high = np.linalg.eigvalsh(plane @ np.diag(a - c) @ plane.T)
    stability = "saddle" if low * high < 0.0 else "least energy" if low + high > 0.0 else "most energy"
    return GyrostatEquilibrium(
        direction=axes @ x,
        rate=magnitude * c,
        energy=0.5 * magnitude**2 * float(np.sum(a * (x - b) ** 2)),
        stability=stability,
        frequency=magnitude * float(np.sqrt(abs(low * high))),
    )
