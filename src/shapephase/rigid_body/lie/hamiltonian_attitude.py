"""The attitude of any left-invariant Hamiltonian H(Pi) on SO(3): a body whose angular velocity is the gradient of H.

Pi' = Pi x grad H(Pi) and R' = R hat(grad H(Pi)). H and the spatial momentum mu = R Pi, the lift of right-invariant
fields, are constant, so that R alone is the state: Pi = R^T mu.

Source: Bonnard, Cots and Shcherbakova 2013, remark 3 and proposition 5; theory.md Q4, Q9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_function
from ...arrays import Array, common_batch, finite_array
from ...display import short_repr
from .._arguments import ascending_times
from .._flow import flow
from .lie_poisson import gradient_at


@dataclass(frozen=True, eq=False)
class HamiltonianMotion:
    """Motion of R' = R hat(grad H(Pi)). Made by `hamiltonian_motion`."""

    times: Array
    """(N,) [s]."""
    attitude: Array
    """(..., N, 3, 3) body axes to inertial axes."""
    momentum: Array
    """(..., 3) mu, inertial axes, constant [kg m^2/s]."""
    body_momentum: Array
    """(..., N, 3) Pi = R^T mu [kg m^2/s]."""
    angular_velocity: Array
    """(..., N, 3) grad H, body axes [rad/s]."""

    __repr__ = short_repr


def hamiltonian_motion(
    hamiltonian: Callable[[Array], ArrayLike],
    body_momentum: ArrayLike,
    times: ArrayLike,
    attitude: ArrayLike | None = None,
) -> HamiltonianMotion:
    """The motion, momentum and attitude, of a Hamiltonian of the body momentum alone, quadratic or not.

    |Pi| and R Pi are exact to rounding; how well H is kept shows the error, which is a few 1e-12 in ten periods.
    Where the inertial third axis is along mu, the azimuth of the body's third axis about it grows by `precession_rate`
    of the momentum and the gradient: the quadrature of the paper's (4).

    Source: Bonnard et al., remark 3, proposition 5 and (4); theory.md Q9.
    Raises AccuracyNotReached if the motion is too rough to be followed.

    Parameters
    ----------
    hamiltonian : gradient of H, momenta (..., 3) [kg m^2/s] -> (..., 3) [rad/s]
    body_momentum : (..., 3) Pi at the first time [kg m^2/s]
    times : (N,) strictly ascending [s]
    attitude : (..., 3, 3) at the first time; None: the identity

    Examples
    --------
    A rotor whose energy grows faster than the square of the momentum:

    >>> def gradient(pi):
    ...     return pi / np.array([1.0, 2.0, 4.0]) + 0.1 * pi**3
    >>> motion = sp.rigid_body.lie.hamiltonian_motion(gradient, [0.3, 0.4, 1.2], np.linspace(0.0, 20.0, 5))
    >>> pi = motion.body_momentum
    >>> energy = np.sum(pi**2 / np.array([2.0, 4.0, 8.0]) + 0.025 * pi**4, axis=-1)
    >>> print(energy.round(9))
    [0.3176825 0.3176825 0.3176825 0.3176825 0.3176825]
    """
    check_function(hamiltonian, "hamiltonian", "a function that gives the gradient")
    start, instants = finite_array(body_momentum, "body_momentum", (3,), unit="kg m^2/s"), ascending_times(times)
    outward = np.eye(3) if attitude is None else so3.rotation_argument(attitude, "attitude")
    shape = common_batch(body_momentum=start.shape[:-1], attitude=outward.shape[:-2])
    start, outward = np.broadcast_to(start, (*shape, 3)), np.broadcast_to(outward, (*shape, 3, 3))
    gradient_at(hamiltonian, "hamiltonian", start)
    spatial = so3.apply(outward, start)

    def rate(quat_xyzw: Array) -> Array:
        pi = so3.apply(so3.transpose(so3.matrix_from_quat(so3.normalised(quat_xyzw))), spatial)
        omega = np.broadcast_to(np.asarray(hamiltonian(pi), dtype=float), pi.shape)
        turning = np.concatenate([0.5 * omega, np.zeros((*omega.shape[:-1], 1))], axis=-1)
        return so3.quat_product(quat_xyzw, turning)

    attitudes = so3.matrix_from_quat(so3.normalised(flow(rate, so3.quat_from_matrix(outward), instants)))
    momenta = so3.apply(so3.transpose(attitudes), spatial[..., None, :])
    return HamiltonianMotion(
        times=instants,
        attitude=attitudes,
        momentum=spatial,
        body_momentum=momenta,
        angular_velocity=gradient_at(hamiltonian, "hamiltonian", momenta),
    )
