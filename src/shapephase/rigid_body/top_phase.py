"""How far a heavy top turns about the vertical: the part of the geometry, and that of its momentum.

Gravity leaves the symmetry about the vertical, whose momentum mu = Pi.Gamma stays. Reduced by it, the motion is that of
Gamma on the sphere, the base of a circle bundle with a mechanical connection: it is horizontal where Gamma.I Omega = 0.
Round a closed curve of Gamma the top turns about the vertical by the holonomy of this connection, and by the integral
of mu/(Gamma.I Gamma). With Omega = (Omega.Gamma) Gamma + Gamma' x Gamma, the holonomy is minus the solid angle of the
curve, and minus the integral of Gamma.I (Gamma' x Gamma)/(Gamma.I Gamma).

Sources: Marsden, Montgomery and Ratiu 1990, *Reduction, symmetry, and phases in mechanics*; Marsden and Ratiu, section
15.10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import so3, sphere
from ..arguments import check_object
from ..arrays import Array, lock_arrays
from ..display import short_repr
from ..errors import AccuracyNotReached
from ..refinement import halved, settled
from .heavy_top import HeavyTopMotion

_HALVINGS = 12  # of the steps of a motion, as `sphere.curve_area` takes them
_SHARE = 0.1  # of the motion's error estimate, for its integrals
_ROUNDING = 1e-13  # [rad] least error of an integral, that of `sphere.curve_area`


@dataclass(frozen=True, eq=False, kw_only=True)
class HeavyTopPhase:
    """The turn of a heavy top about the vertical, in two parts. Made by `heavy_top_phase`; arrays have its batch.

    Attributes
    ----------
    geometric : (...) holonomy of the mechanical connection along the curve of Gamma, closed by the shortest great
        circle; modulo whole turns, as the solid angle is known modulo 4 pi [rad]
    dynamic : (...) the integral of mu/(Gamma.I Gamma), whole turns counted [rad]
    angle : (...) their sum, in (-pi, pi]: R(T) = exp(angle hat(e_z)) C, where C is the horizontal lift along the great
        circle from Gamma(0) to Gamma(T), beginning at R(0); where Gamma returns, C = R(0) [rad]
    solid_angle : (...) that the closed curve of Gamma encloses [sr]
    residual : (...) angle between the two sides of that equation, the attitude being integrated [rad]
    error_estimate : (...) of the angle, and of the parts beside their rounding [rad]
    """

    geometric: Array
    dynamic: Array
    angle: Array
    solid_angle: Array
    residual: Array
    error_estimate: Array

    __repr__ = short_repr
    __post_init__ = lock_arrays


def heavy_top_phase(motion: HeavyTopMotion) -> HeavyTopPhase:
    """Split how far a heavy top has turned about the vertical at the end of a motion.

    Equation :eq:`heavy-top-phase` of the documentation.
    Source: Marsden, Montgomery and Ratiu 1990.

    Raises
    ------
    AccuracyNotReached
        If the integrals do not settle.

    Examples
    --------
    >>> top = sp.rigid_body.HeavyTop(np.diag([1.0, 1.5, 0.5]), 2.0)
    >>> motion = top.motion([0.1, 0.3, 2.0], [0.6, 0.0, 0.8], duration=3.0)
    >>> phase = sp.rigid_body.heavy_top_phase(motion)
    >>> bool(phase.residual < 1e-9)
    True
    """
    check_object(motion, "HeavyTopMotion", "motion")
    tensor, steps = motion.top.inertia, motion._solution.ts
    tolerance = max(_SHARE * float(np.max(motion.error_estimate, initial=0.0)), _ROUNDING)

    def curve(times: Array) -> tuple[Array, Array]:
        gamma = motion.gamma(times)
        return gamma, np.cross(gamma, motion.angular_velocity(times))

    def parts(times: Array) -> Array:
        gamma, rate = curve(times)
        return np.stack([motion.vertical_momentum[..., None] / _about(tensor, gamma), _lifted(tensor, gamma, rate)])

    area, (dynamic, lifted) = sphere.curve_area(curve, steps, tolerance), _integral(parts, steps, tolerance)
    start, end = motion.gamma(0.0), motion.gamma(motion.duration)
    axis = so3.log(so3.between(end, start))[..., None, :]

    def closing(fractions: Array) -> Array:
        gamma = so3.apply(so3.exp(axis * fractions[:, None]), end[..., None, :])
        return _lifted(tensor, gamma, np.cross(axis, gamma))

    back = _integral(closing, np.array([0.0, 1.0]), tolerance)
    geometric = lifted + back - area
    angle = so3.wrap(geometric + dynamic)
    beside = _turned(motion.attitude(0.0), -back) @ so3.between(end, start)
    return HeavyTopPhase(
        geometric=geometric,
        dynamic=dynamic,
        angle=angle,
        solid_angle=area,
        residual=so3.angle(so3.transpose(_turned(beside, angle)) @ motion.attitude(motion.duration)),
        error_estimate=motion.error_estimate + tolerance,
    )


def _about(tensor: Array, gamma: Array) -> Array:
    """The moment about the vertical, Gamma.I Gamma: (..., 3, 3), (..., N, 3) -> (..., N)."""
    return np.einsum("...ni,...ij,...nj->...n", gamma, tensor, gamma)


def _lifted(tensor: Array, gamma: Array, rate: Array) -> Array:
    """Turning about the vertical in a horizontal motion, -Gamma.I (Gamma' x Gamma)/(Gamma.I Gamma): -> (..., N)."""
    return -np.einsum("...ni,...ij,...nj->...n", gamma, tensor, np.cross(rate, gamma)) / _about(tensor, gamma)


def _integral(function: Callable[[Array], Array], edges: Array, tolerance: float) -> Array:
    """The integral over the edges: times (N,) -> (..., N) becomes (...). Raises AccuracyNotReached."""

    def whole(edges: Array) -> Array:
        nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
        return np.sum(function(nodes.ravel()) * weights.ravel(), axis=-1)

    def change(last: Array, new: Array) -> float:
        return float(np.max(np.abs(new - last) / np.maximum(np.abs(new), 1.0), initial=0.0))

    result = settled(map(whole, halved(edges, _HALVINGS)), change, tolerance)
    if result is None:
        raise AccuracyNotReached("heavy top: the integrals of its phase do not settle; shorten the motion")
    return result


def _turned(attitude: Array, angle: Array) -> Array:
    """Attitudes turned about the vertical: (..., 3, 3), (...) -> (..., 3, 3)."""
    return so3.exp(angle[..., None] * np.eye(3)[2]) @ attitude
