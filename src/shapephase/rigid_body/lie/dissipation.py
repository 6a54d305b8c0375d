"""Double-bracket dissipation of the free rigid body: energy falls, the momentum sphere stays.

Pi' = Pi x Omega + alpha Pi x (Pi x Omega) with alpha > 0, that is F' = {F, K} + {F, K}_sym with the symmetric bracket
{F, G}_sym = -alpha (Pi x grad F) . (Pi x grad G); Marsden and Ratiu print it without the minus sign, with which the
energy would grow.

Source: Marsden and Ratiu, exercise 15.9-2; theory.md K4, M-E8.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import inverse_inertia_argument
from ...arrays import Array, finite_array
from .._arguments import ascending_times
from .._flow import flow
from .lie_poisson import Gradient, angular_velocity, gradient_at


def symmetric_bracket(first: Gradient, second: Gradient, momentum: ArrayLike, alpha: ArrayLike) -> Array:
    """{F, G}_sym = -alpha (Pi x grad F) . (Pi x grad G), from gradients at momenta (..., 3): (...).

    Raises ShapeError.

    Parameters
    ----------
    first, second : gradients of F and G, values (..., 3) or callables of the momentum
    momentum : (..., 3) body momentum [kg m^2/s]
    alpha : (...) dissipation [s/(kg m^2)], positive where energy is lost

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> sp.rigid_body.lie.symmetric_bracket(x, x, [0.0, 0.0, 2.0], 0.5).item()  # -alpha |Pi x e_x|^2
    -2.0
    """
    pi, strength = _momentum(momentum), finite_array(alpha, "alpha")
    across = np.cross(pi, gradient_at(first, "first", pi))
    return -strength * np.sum(across * np.cross(pi, gradient_at(second, "second", pi)), axis=-1)


def double_bracket_equations(inertia: ArrayLike, momentum: ArrayLike, alpha: ArrayLike) -> Array:
    """Pi' = Pi x Omega + alpha Pi x (Pi x Omega): (..., 3, 3), (..., 3), (...) -> (..., 3) [kg m^2/s^2].

    Examples
    --------
    >>> sp.rigid_body.lie.double_bracket_equations(np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 2.0], 0.1).tolist()
    [0.0, 0.0, 0.0]
    """
    pi = _momentum(momentum)
    return _rate(pi, angular_velocity(inertia, pi), finite_array(alpha, "alpha")[..., None])


def dissipated_power(inertia: ArrayLike, momentum: ArrayLike, alpha: ArrayLike) -> Array:
    """-dK/dt = alpha |Pi x Omega|^2, zero at equilibria only: (...) [W]. Raises as `double_bracket_equations`.

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.dissipated_power(np.diag([1.0, 2.0, 4.0]), [1.0, 0.0, 1.0], 2.0).item()  # alpha |Pi x Omega|^2
    1.125
    """
    pi = _momentum(momentum)
    torque = np.cross(pi, angular_velocity(inertia, pi))
    return finite_array(alpha, "alpha") * np.sum(torque * torque, axis=-1)


def double_bracket_motion(inertia: ArrayLike, momentum: ArrayLike, alpha: float, times: ArrayLike) -> Array:
    """The body momentum under double-bracket dissipation, given at the first time: (..., 3), (N,) -> (..., N, 3).

    Raises as `double_bracket_equations`.

    Parameters
    ----------
    inertia : (3, 3) or (..., 3, 3) [kg m^2]
    alpha : (...) dissipation [s/(kg m^2)]; a negative one drives the body
    times : (N,) strictly ascending [s]

    Examples
    --------
    >>> pi = sp.rigid_body.lie.double_bracket_motion(np.diag([1.0, 2.0, 4.0]), [0.6, 0.1, 0.5], 1.0, [0.0, 60.0])
    >>> print(pi[-1].round(4) + 0.0, np.linalg.norm(pi, axis=-1).round(6))
    [0.     0.     0.7874] [0.787401 0.787401]
    """
    pi, instants, strength = _momentum(momentum), ascending_times(times), finite_array(alpha, "alpha")[..., None]
    inverse = inverse_inertia_argument(inertia)
    start = np.array(np.broadcast_to(pi, np.broadcast_shapes(pi.shape, inverse.shape[:-1], (*strength.shape[:-1], 3))))
    return flow(lambda p: _rate(p, (inverse @ p[..., None])[..., 0], strength), start, instants)


def _rate(pi: Array, omega: Array, strength: Array) -> Array:
    torque = np.cross(pi, omega)
    return torque + strength * np.cross(pi, torque)


def _momentum(value: ArrayLike) -> Array:
    return finite_array(value, "momentum", (3,), unit="kg m^2/s")
