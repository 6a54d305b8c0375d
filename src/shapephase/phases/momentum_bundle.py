"""The circle bundle J^-1(mu) -> sphere, and the connection by which a closed curve of the momentum has a phase.

The states of angular momentum mu are the attitudes R, with Pi = R^T mu; a tangent vector is an angular velocity omega
in body axes, R' = R hat(omega). Rotations about mu make the circles, R -> Pi is the projection to the sphere of
radius l = |mu|. The connection form is A = Pi.omega/l, which is 1 on the generator of those rotations; its curvature
is dA = dS/l^2, dS the area of the sphere.

Source: Cabrera 2006, section 3.2.1 and (11); theory.md D1 to D3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array, common_batch, finite_array
from ..errors import ShapeError


def momentum_generator(momentum: ArrayLike, attitude: ArrayLike) -> Array:
    """The vector field of rotations about mu at R: body angular velocities (..., 3), Pi/l [1].

    Source: Cabrera 2006, section 3.2.1; theory.md D1.

    Parameters
    ----------
    momentum : (..., 3) mu, inertial axes, not zero [kg m^2/s]
    attitude : (..., 3, 3) body axes to inertial axes

    Raises
    ------
    ShapeError
        If an argument is of a wrong shape or value; so do the other two functions.

    Examples
    --------
    >>> attitude = sp.so3.exp(np.array([0.3, -0.2, 0.5]))
    >>> along = sp.phases.momentum_generator([0.0, 0.0, 2.0], attitude)
    >>> print(sp.phases.momentum_connection([0.0, 0.0, 2.0], attitude, along).round(12))
    1.0
    """
    return _direction(momentum, attitude)


def momentum_connection(momentum: ArrayLike, attitude: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """The connection form A = Pi.omega/l at R: (..., 3), (..., 3, 3), (..., 3) -> (...) [rad/s].

    Along a motion, A is the rate of the dynamic phase; velocities with A = 0 are horizontal.

    Source: Cabrera 2006 (11); theory.md D2. Other arguments and errors as `momentum_generator`.

    Parameters
    ----------
    angular_velocity : (..., 3) of R' = R hat(omega), body axes [rad/s]

    Examples
    --------
    >>> print(sp.phases.momentum_connection([0.0, 0.0, 2.0], np.eye(3), [0.1, 0.2, 0.3]))
    0.3
    """
    direction = _direction(momentum, attitude)
    velocity = finite_array(angular_velocity, "angular_velocity", (3,), unit="rad/s")
    common_batch(momentum=direction.shape[:-1], angular_velocity=velocity.shape[:-1])
    return np.sum(direction * velocity, axis=-1)


def momentum_curvature(momentum: ArrayLike, attitude: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """The curvature dA of the connection at R on two velocities, Pi.(first x second)/l: -> (...) [rad^2/s^2].

    It is dS/l^2 of the velocities Pi x first and Pi x second that they give the momentum in the body: the phase of a
    small loop is minus its solid angle.

    Source: Cabrera 2006, section 3.2.1; theory.md D3. Other arguments and errors as `momentum_generator`.

    Parameters
    ----------
    first, second : (..., 3) body angular velocities [rad/s]

    Examples
    --------
    >>> print(sp.phases.momentum_curvature([0.0, 0.0, 2.0], np.eye(3), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    1.0
    """
    direction = _direction(momentum, attitude)
    left, right = finite_array(first, "first", (3,)), finite_array(second, "second", (3,))
    common_batch(momentum=direction.shape[:-1], first=left.shape[:-1], second=right.shape[:-1])
    return np.sum(direction * np.cross(left, right), axis=-1)


def _direction(momentum: ArrayLike, attitude: ArrayLike) -> Array:
    """Pi/l."""
    spatial = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    rotation = so3.rotation_argument(attitude, "attitude")
    common_batch(momentum=spatial.shape[:-1], attitude=rotation.shape[:-2])
    magnitude = np.linalg.norm(spatial, axis=-1, keepdims=True)
    if np.any(magnitude == 0.0):
        raise ShapeError("momentum: its direction is needed, and zero has none")
    return so3.apply(so3.transpose(rotation), spatial / magnitude)
