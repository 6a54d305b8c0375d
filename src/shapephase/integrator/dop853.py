"""The attitude equation integrated by SciPy, as an independent check of `integrate`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from ..chebyshev import inside
from ..errors import AccuracyNotReached
from ._spectral_error import Evaluate

# SciPy refuses a smaller relative tolerance.
_LEAST_RELATIVE_TOLERANCE = 3e-14


def dop853_rotation(
    evaluate: Evaluate, breaks: Array, momentum: Array, tolerance: float
) -> tuple[Callable[[Array], Array], int]:
    """S(t) for one Pi_0 by SciPy's DOP853 on the quaternion, restarted at the breaks.

    Every stage evaluates the deformation itself; the library's interpolation and stepping are not used.

    Returns
    -------
    dense : times (N,) -> quaternions (N, 4)
    evaluations : of I and L_o

    Examples
    --------
    >>> def evaluate(t):
    ...     return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), np.zeros((len(t), 3))
    >>> turn, _ = sp.integrator.dop853_rotation(evaluate, np.array([0.0, 1.0]), np.array([0.0, 0.0, 5.0]), 1e-9)
    >>> print(f"{np.linalg.norm(sp.so3.rotation_vector_from_quat(turn(np.array([1.0])))):.6f}")
    2.000000
    """
    from scipy.integrate import solve_ivp

    inner = inside(breaks[:-1], breaks[1:])

    rtol = max(tolerance, _LEAST_RELATIVE_TOLERANCE)

    def slope(t: float, q: Array, left: float, right: float) -> Array:
        inertia, internal = evaluate(np.array([min(max(t, left), right)]))
        unit = so3.normalised(q)
        omega = np.linalg.solve(inertia[0], so3.matrix_from_quat(unit).T @ momentum - internal[0])
        vector, scalar = q[:3], q[3]
        return 0.5 * np.append(scalar * omega + np.cross(vector, omega), -vector @ omega)

    quaternion, pieces, evaluations = np.array([0.0, 0.0, 0.0, 1.0]), [], 0
    for a, b, left, right in zip(breaks[:-1], breaks[1:], *inner, strict=True):
        # SciPy asks for the float next to zero, which is an underflow to those who want to be told.
        with np.errstate(under="ignore"):
            run = solve_ivp(
                slope, (a, b), quaternion, "DOP853", dense_output=True, rtol=rtol, atol=1e-2 * tolerance,
                args=(left, right),
            )  # fmt: skip
        if not run.success:
            raise AccuracyNotReached(f"DOP853 stopped at t = {run.t[-1]:.9g} s: {run.message}")
        pieces.append(run.sol)
        evaluations += run.nfev
        quaternion = so3.normalised(run.y[:, -1])

    return Dop853Output(breaks, tuple(pieces)), evaluations


@dataclass(frozen=True, eq=False)
class Dop853Output:
    """Quaternions at every time, piece by piece.

    Attributes
    ----------
    breaks : (M,) between which SciPy's own dense outputs hold [s]
    pieces : one dense output between two breaks each
    """

    breaks: Array
    pieces: tuple[Callable[[Array], Array], ...]

    def __call__(self, t: Array) -> Array:
        """Times (N,) -> unit quaternions (N, 4)."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.pieces) - 1)
        values = np.empty((len(t), 4))
        for number in np.unique(piece):
            rows = piece == number
            values[rows] = self.pieces[number](t[rows]).T
        return so3.normalised(values)
