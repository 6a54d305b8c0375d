"""An articulated body along its reconstructed motion, with the second derivatives of joints and base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..errors import WrongObjectError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath


@dataclass(frozen=True, eq=False, kw_only=True)
class MovingBody:
    """Joints and spin of the base at N times, in each of B motions of a batch.

    Attributes
    ----------
    shapes, rates, accelerations : (N, n) of the joints [rad or m], a second, a second squared
    spins : (B, N, 3) angular velocity of the base, base axes [rad/s]
    spin_rates : (B, N, 3) its rate [rad/s^2]
    push : (N, 3) torque from outside, base axes [N m]
    """

    shapes: Array
    rates: Array
    accelerations: Array
    spins: Array
    spin_rates: Array
    push: Array


def body_and_path(motion: Motion | ForcedMotion) -> tuple[Body, ShapePath] | None:
    """Of a motion of an articulated body, in whatever gauge; None of another."""
    found: object = motion.deformation.description
    while hasattr(found, "original"):
        found = found.original  # pyright: ignore[reportAttributeAccessIssue]
    body, path = getattr(found, "body", None), getattr(found, "path", None)
    return (body, path) if isinstance(body, Body) and isinstance(path, ShapePath) else None


def needed_body_and_path(motion: Motion | ForcedMotion, what: str) -> tuple[Body, ShapePath]:
    """The same for those who need it, "the torques of joints need". Raises WrongObjectError where there is none."""
    found = body_and_path(motion)
    if found is None:
        raise WrongObjectError(
            f"motion: {what} a body with joints along a path, made by `articulated`; this is: "
            f"{motion.deformation.label}"
        )
    return found


def moving_body(
    motion: Motion | ForcedMotion,
    body: Body,
    path: ShapePath,
    times: Array,
    turned: Array | None = None,
    moved: Array | None = None,
) -> MovingBody:
    """What joints and base do at (N,) times of a motion.

    The base's acceleration is that of the reconstructed motion: from I omega + L_o = Pi and Pi' = Pi x omega follows
    I omega' = Pi x omega - I' omega - L_o'; a torque from outside, which acts on the base, adds to both.

    Parameters
    ----------
    turned : (3,) a small turn of all attitudes, base axes, to see what it changes; None: none [rad]
    moved : (3, n) the same of shapes, rates and accelerations
    """
    shapes, rates = path.curve(times)
    accelerations = path.acceleration(times)
    if moved is not None:
        shapes, rates, accelerations = shapes + moved[0], rates + moved[1], accelerations + moved[2]
    inertia, matrix, inertia_rate, matrix_rate = body.sample_rates(shapes, rates)
    inverse = inverse_inertia(inertia, times)
    internal = so3.apply(matrix, rates)
    internal_rate = so3.apply(matrix_rate, rates) + so3.apply(matrix, accelerations)
    momenta = so3.apply(so3.transpose(motion.deformation.frame(times)), motion.body_momentum(times))
    momenta = momenta.reshape(-1, len(times), 3)
    if turned is not None:
        momenta = so3.apply(so3.transpose(so3.exp(turned)), momenta)
    push = np.zeros((len(times), 3))
    if isinstance(motion, ForcedMotion):
        push = so3.apply(so3.transpose(motion.deformation.frame(times)), motion.torque(times))
    spins = so3.apply(inverse, momenta - internal)
    slopes = so3.apply(inverse, np.cross(momenta, spins) + push - so3.apply(inertia_rate, spins) - internal_rate)
    return MovingBody(
        shapes=shapes, rates=rates, accelerations=accelerations, spins=spins, spin_rates=slopes, push=push
    )
