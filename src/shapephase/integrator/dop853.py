"""The attitude equation integrated by SciPy, as an independent check of `integrate`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .. import so3
from ..arrays import Array
from .channels import Evaluate
from .driven_attitude import DrivenAttitude, driven_attitude
from .limited_steps import StepLimits


def dop853_rotation(
    evaluate: Evaluate, breaks: Array, momentum: Array, tolerance: float
) -> tuple[Callable[[Array], Array], int]:
    """S(t) for one Pi_0 by SciPy's DOP853 on the quaternion, restarted at the breaks.

    Every stage evaluates the deformation itself; the library's interpolation and stepping are not used.

    Returns
    -------
    dense : times (N,) -> quaternions (N, 4)
    evaluations : of I and L_o

    Raises the errors of `driven_attitude`.

    Examples
    --------
    >>> def evaluate(t):
    ...     return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), np.zeros((len(t), 3))
    >>> turn, _ = sp.integrator.dop853_rotation(evaluate, np.array([0.0, 1.0]), np.array([0.0, 0.0, 5.0]), 1e-9)
    >>> print(f"{np.linalg.norm(sp.so3.rotation_vector_from_quat(turn(np.array([1.0])))):.6f}")
    2.000000
    """
    driven = dop853_attitude(evaluate, breaks, momentum, tolerance)
    return driven.run, driven.evaluations


def dop853_attitude(
    evaluate: Evaluate, breaks: Array, momentum: Array, tolerance: float, limits: StepLimits | None = None
) -> DrivenAttitude:
    """S(t) of `dop853_rotation` with its measured error, by steps within limits; errors as `driven_attitude`."""

    def rates(times: Array, attitudes: Array, states: Array) -> tuple[Array, Array]:
        inertia, internal = evaluate(times)
        pi = so3.apply(so3.transpose(attitudes), momentum)
        return np.asarray(np.linalg.solve(inertia, (pi - internal)[..., None])[..., 0], dtype=np.float64), states

    nothing = np.zeros(0)
    return driven_attitude(rates, breaks, np.eye(3), nothing, nothing, tolerance, limits)
