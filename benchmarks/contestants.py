"""What people use today, written as well as it can be in Python: one right-hand side, tuned by hand."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import shapephase as sp

from .cases import Case

Joints = Callable[[float], tuple[np.ndarray, np.ndarray]]


def scalar_path(path: sp.ShapePath) -> Joints:
    """Shapes and rates at one time, without the overhead of a call for many."""
    curve = path.curve
    if hasattr(curve, "sines"):
        harmonics = 2.0 * np.pi / curve.period * np.arange(1, curve.sines.shape[1] + 1)
        mean, both = curve.mean, np.concatenate([curve.cosines, curve.sines], axis=1)
        slopes = np.concatenate([curve.sines * harmonics, -curve.cosines * harmonics], axis=1)

        def fourier(t: float) -> tuple[np.ndarray, np.ndarray]:
            phase = harmonics * t
            waves = np.concatenate([np.cos(phase), np.sin(phase)])
            return mean + both @ waves, slopes @ waves

        return fourier
    if hasattr(curve, "knots"):
        knots, order = curve.knots.tolist(), len(curve.coefficients)
        pieces = np.moveaxis(curve.coefficients, 0, 1).copy()
        powers, last = np.arange(order), len(knots) - 2

        def piecewise(t: float) -> tuple[np.ndarray, np.ndarray]:
            i = min(bisect_right(knots, t) - 1, last)
            local = (t - knots[i]) ** powers
            return local @ pieces[i], (powers[1:] * local[:-1]) @ pieces[i, 1:]

        return piecewise

    def general(t: float) -> tuple[np.ndarray, np.ndarray]:
        shapes, rates = curve(np.array([t]))
        return shapes[0], rates[0]

    return general


class FloatingModel:
    """A Pinocchio model with its free-flyer at the identity, for one contestant."""

    def __init__(self, case: Case) -> None:
        body = case.body
        self.model, self.data = body._model, body._model.createData()
        self.q, self.v = pin.neutral(self.model), np.zeros(self.model.nv)
        self._path = scalar_path(case.path)
        joints = self._joints = body._joints
        self._plain = joints.follows.is_identity and not body.continuous.any()
        self._q_joint, self._v_joint = joints._configuration_index, 6 + joints._velocity_index

    def set(self, t: float) -> None:
        """The joints at time t."""
        r, rate = self._path(t)
        if self._plain:
            self.q[self._q_joint], self.v[self._v_joint] = r, rate
        else:
            self.q[:] = self._joints.configurations(r[None])[0]
            self.v[:] = self._joints.velocities(r[None], rate[None])[0]


def solve_ivp_attitude(case: Case, rtol: float, atol: float | None = None) -> tuple[np.ndarray, int]:
    """Final quaternion x y z w by DOP853 on `ccrba`, restarted at the breaks of the path; evaluations."""
    floating = FloatingModel(case)
    model, data, q, v = floating.model, floating.data, floating.q, floating.v
    mu = case.momentum
    ccrba = pin.ccrba

    def slope(t: float, state: np.ndarray) -> tuple[float, float, float, float]:
        floating.set(t)
        ccrba(model, data, q, v)
        x, y, z, w = state.tolist()
        n = (x * x + y * y + z * z + w * w) ** -0.5
        x, y, z, w = x * n, y * n, z * n, w * n
        a, b, c = mu
        s, u, p = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
        h = data.hg.angular.tolist()
        pi = (a - w * s + y * p - z * u - h[0], b - w * u + z * s - x * p - h[1], c - w * p + x * u - y * s - h[2])
        (i, f, e), (_, g, d), (_, _, k) = data.Ig.inertia.tolist()
        aa, bb, cc = g * k - d * d, i * k - e * e, i * g - f * f
        dd, ee, ff = e * f - i * d, f * d - g * e, e * d - f * k
        det = i * aa + f * ff + e * ee
        o = (aa * pi[0] + ff * pi[1] + ee * pi[2]) / det
        r = (ff * pi[0] + bb * pi[1] + dd * pi[2]) / det
        m = (ee * pi[0] + dd * pi[1] + cc * pi[2]) / det
        return (
            0.5 * (w * o + y * m - z * r),
            0.5 * (w * r + z * o - x * m),
            0.5 * (w * m + x * r - y * o),
            -0.5 * (x * o + y * r + z * m),
        )

    state, count = np.array([0.0, 0.0, 0.0, 1.0]), 0
    edges = case.path.breaks
    for a, b in pairwise(edges):
        run = solve_ivp(slope, (a, b), state, "DOP853", rtol=rtol, atol=1e-2 * rtol if atol is None else atol)
        state = run.y[:, -1] / np.linalg.norm(run.y[:, -1])
        count += run.nfev
    return state, count
