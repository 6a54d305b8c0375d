"""The heavy top: a rigid body with a fixed point, in uniform gravity.

Pi is the angular momentum about the fixed point and Gamma the upward vertical, both in body axes; chi is the unit
vector from the fixed point to the centre of mass, Mgl its distance times the weight [J]. The equations are
Lie-Poisson on se(3)*: Pi' = Pi x Omega + Mgl Gamma x chi, Gamma' = Gamma x Omega, Pi = I Omega.

Source: Marsden and Ratiu, section 15.10; theory.md M1, M2, M10.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853, DenseOutput, OdeSolution

from .. import so3
from ..arguments import check_pair, inertia_argument, number_argument
from ..arrays import Array, common_batch, finite_array
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError
from ..inertia_tensor import inverse_inertia
from ..letters import value_text
from ._arguments import above_zero, unit_vectors
from ._flow import TOLERANCE

_RATIO = 32.0  # of the local tolerances of the two runs of a motion, whose difference shows the error
_STEPS = 200_000  # most steps of one run, some minutes of computing

Pair = tuple[Array, Array]  # a point of se(3)*, or a gradient there: its Pi part and its Gamma part, each (..., 3)


@dataclass(frozen=True, eq=False)
class HeavyTop:
    """A heavy top, or a batch of them.

    Equation :eq:`heavy-top` of the documentation.
    Source: Marsden and Ratiu (15.10.1-3).
    Raises ShapeError if shapes or entries are wrong, or chi is not a unit vector (to 1e-6).

    Parameters
    ----------
    inertia : (..., 3, 3) symmetric positive definite tensor about the fixed point, body axes [kg m^2]
    mgl : (...) mass times gravity times the distance of the centre of mass from the fixed point [J]
    chi : (..., 3) unit vector from the fixed point to the centre of mass, body axes

    Examples
    --------
    >>> top = sp.rigid_body.HeavyTop(np.diag([1.0, 1.0, 0.5]), 2.0)
    >>> top.energy([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]).item()  # 1/(2 * 0.5) + 2
    3.0
    """

    inertia: Array
    mgl: Array
    chi: Array
    inverse: Array = field(init=False, repr=False)

    __repr__ = short_repr

    def __init__(self, inertia: ArrayLike, mgl: ArrayLike, chi: ArrayLike = (0.0, 0.0, 1.0)) -> None:
        tensor = finite_array(inertia, "inertia", (3, 3), unit="kg m^2")
        tensor = inertia_argument(tensor.reshape(-1, 3, 3)).reshape(tensor.shape)
        direction, strength = unit_vectors(chi, "chi"), finite_array(mgl, "mgl", unit="J")
        common_batch(inertia=tensor.shape[:-2], mgl=strength.shape, chi=direction.shape[:-1])
        values = {"inertia": tensor, "mgl": strength, "chi": direction, "inverse": inverse_inertia(tensor)}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def angular_velocity(self, momentum: ArrayLike) -> Array:
        """Omega = I^-1 Pi: (..., 3) -> (..., 3) [rad/s]."""
        return so3.apply(self.inverse, finite_array(momentum, "momentum", (3,)))

    def energy(self, momentum: ArrayLike, gamma: ArrayLike) -> Array:
        """H = Pi.Omega/2 + Mgl Gamma.chi: (..., 3), (..., 3) -> (...) [J]. Source: Marsden and Ratiu (15.10.3)."""
        pi, up = _point(momentum, gamma)
        return 0.5 * np.sum(pi * self.angular_velocity(pi), axis=-1) + self.mgl * np.sum(up * self.chi, axis=-1)

    def energy_gradient(self, momentum: ArrayLike, gamma: ArrayLike) -> Pair:
        """(dH/dPi, dH/dGamma) = (Omega, Mgl chi): (..., 3), (..., 3) -> two of (..., 3) [rad/s], [J]."""
        pi, _ = _point(momentum, gamma)
        omega = self.angular_velocity(pi)
        return omega, np.broadcast_to(self.mgl[..., None] * self.chi, omega.shape)

    def rates(self, momentum: ArrayLike, gamma: ArrayLike) -> Pair:
        """(Pi', Gamma'): (..., 3), (..., 3) -> two of (..., 3). Source: Marsden and Ratiu (15.10.1-2)."""
        pi, up = _point(momentum, gamma)
        omega, weight = self.energy_gradient(pi, up)
        return np.cross(pi, omega) + np.cross(up, weight), np.cross(up, omega)

    def linearisation(self, momentum: ArrayLike, gamma: ArrayLike) -> Array:
        """The derivative of (Pi', Gamma') by (Pi, Gamma): (..., 3), (..., 3) -> (..., 6, 6).

        Its eigenvalues at an equilibrium are the spectrum; two of them are zero, for the two Casimirs.
        Source: Marsden and Ratiu (15.10.12-13).
        """
        pi, up = _point(momentum, gamma)
        omega, weight = self.energy_gradient(pi, up)
        spin = so3.hat(omega)
        return np.block([[so3.hat(pi) @ self.inverse - spin, -so3.hat(weight)], [so3.hat(up) @ self.inverse, -spin]])

    def legendre(self, momentum: ArrayLike, gamma: ArrayLike) -> Pair:
        """(Omega, v) = gradient of H + |Gamma|^2/2, an element of se(3): (..., 3), (..., 3) -> two of (..., 3).

        H alone is linear in Gamma and has no Legendre transform; |Gamma|^2/2 [J] is a Casimir, so the sum has the
        same motions. Source: Marsden and Ratiu, exercise 15.10-1.
        """
        pi, up = _point(momentum, gamma)
        omega, weight = self.energy_gradient(pi, up)
        return omega, weight + up

    def lagrangian(self, omega: ArrayLike, v: ArrayLike) -> Array:
        """l = Omega.I Omega/2 + |v - Mgl chi|^2/2, of which H + |Gamma|^2/2 is the Legendre transform [J].

        With Pi = dl/dOmega and Gamma = dl/dv the heavy top is Euler-Poincare on se(3): Pi' = Pi x Omega + Gamma x v,
        Gamma' = Gamma x Omega: (..., 3), (..., 3) -> (...). Source: Marsden and Ratiu, exercise 15.10-1 (b).
        """
        rate, rest = finite_array(omega, "omega", (3,)), finite_array(v, "v", (3,)) - self.mgl[..., None] * self.chi
        return 0.5 * np.sum(rate * so3.apply(self.inertia, rate), axis=-1) + 0.5 * np.sum(rest * rest, axis=-1)

    def motion(
        self,
        momentum: ArrayLike,
        gamma: ArrayLike | None = None,
        *,
        duration: float,
        attitude: ArrayLike | None = None,
        tolerance: float = 1e-9,
    ) -> HeavyTopMotion:
        """The motion from these initial values, with both Casimirs exact to rounding at every time.

        The attitude is integrated as a quaternion, together with the two horizontal components of the spatial momentum
        R Pi; its vertical component, Pi.Gamma, is constant and enters as given. Gamma = R^T e_z and Pi = R^T (R Pi) are
        formed from these, so Pi.Gamma and |Gamma| cannot drift. The method is Dormand and Prince's of order 8(5,3); a
        second run with a looser tolerance gives the error estimate.

        Parameters
        ----------
        momentum : (..., 3) body momentum at the start [kg m^2/s]
        gamma : (..., 3) upward vertical in body axes at the start; the attitude is then the shortest rotation that
            takes it to e_z
        attitude : (..., 3, 3) body to inertial axes at the start, instead of gamma; with neither, the identity
        duration : of the motion [s]
        tolerance : of the attitude over the whole motion, in [1e-12, 1e-2] [rad]

        Raises
        ------
        ShapeError
            If both gamma and attitude are given, or the tolerance is outside its limits.
        AccuracyNotReached
            If the tolerance cannot be met: unstable or chaotic motions magnify rounding exponentially.
        """
        body = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        if gamma is not None and attitude is not None:
            raise ShapeError("gamma, attitude: give one of them; each determines where the vertical is")
        if gamma is not None:
            vertical = unit_vectors(gamma, "gamma")
            start = so3.between(vertical, np.broadcast_to(np.eye(3)[2], vertical.shape))
        else:
            start = np.eye(3) if attitude is None else so3.rotation_argument(attitude, "attitude")
        time, requested = above_zero(duration, "duration", "s"), number_argument(tolerance, "tolerance", "rad")
        if not 1e-12 <= requested <= 1e-2:
            raise ShapeError(f"tolerance: one number from 1e-12 to 1e-2 rad is needed, got {value_text(tolerance)}")
        own = np.broadcast_shapes(self.inertia.shape[:-2], self.mgl.shape, self.chi.shape[:-1])
        shape = common_batch(top=own, momentum=body.shape[:-1], attitude=start.shape[:-2])
        start, body = np.broadcast_to(start, (*shape, 3, 3)), np.broadcast_to(body, (*shape, 3))
        least = _RATIO * TOLERANCE
        local = max(0.01 * requested, least)  # errors of steps add up
        while True:
            coarse = _integrated(self, start, body, time, local)
            fine = _integrated(self, start, body, time, local / _RATIO)
            # Measured, the error of the finer run is about 1/32 of the difference.
            estimate = 0.1 * _difference(coarse, fine)
            worst = float(np.max(estimate, initial=0.0))
            if worst <= requested:
                return replace(fine, error_estimate=estimate)
            if local <= least:
                raise AccuracyNotReached(
                    f"heavy top: the attitude is known to {worst:.2g} rad over {time:.6g} s, tolerance "
                    f"{requested:.2g}; shorten the motion or loosen the tolerance (unstable motions magnify rounding)"
                )
            # Mostly one repetition suffices; estimates of coarse runs are too rough for larger changes.
            local = max(local * max(0.3 * requested / worst, 1e-3), least)


@dataclass(frozen=True, eq=False)
class HeavyTopMotion:
    """Motion of a heavy top on [0, duration].

    Times (...) give results of shape batch + time + item. Made by `HeavyTop.motion`.
    """

    top: HeavyTop
    """The `HeavyTop`."""
    duration: float
    """Duration of the motion [s]."""
    vertical_momentum: Array
    """(...) Pi.Gamma, constant [kg m^2/s]."""
    error_estimate: Array
    """(...) of the attitude over the whole motion, a tenth of the largest difference from a run with 32 times the local
    tolerance [rad]."""
    energy_drift: Array
    """(...) largest |H(t) - H(0)| at the ends of the steps [J]."""
    _scale: Array = field(repr=False)
    _solution: OdeSolution = field(repr=False)

    __repr__ = short_repr

    def attitude(self, t: ArrayLike) -> Array:
        """R(t), body to inertial axes: (...) -> (..., 3, 3)."""
        return so3.matrix_from_quat(self._state(t)[0])

    def gamma(self, t: ArrayLike) -> Array:
        """The upward vertical in body axes, R^T e_z: (...) -> (..., 3)."""
        return self.attitude(t)[..., 2, :]

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t), body axes: (...) -> (..., 3) [kg m^2/s]."""
        quat_xyzw, spatial = self._state(t)
        return so3.apply(so3.transpose(so3.matrix_from_quat(quat_xyzw)), spatial)

    def angular_velocity(self, t: ArrayLike) -> Array:
        """Omega(t), body axes: (...) -> (..., 3) [rad/s]."""
        inverse = self.top.inverse[(..., *(None,) * np.ndim(t), slice(None), slice(None))]
        return so3.apply(inverse, self.body_momentum(t))

    def _state(self, t: ArrayLike) -> tuple[Array, Array]:
        """Quaternions xyzw and spatial momentum: times (...) -> batch + time + (4,), batch + time + (3,)."""
        times = finite_array(t, "t", unit="s")
        if np.any((times < 0.0) | (times > self.duration)):
            raise ShapeError(f"t: from {times.min():.6g} to {times.max():.6g} s; the motion is on [0, {self.duration}]")
        batch = self._scale.shape
        flat = self._solution(times.ravel()) if times.size else np.empty((6 * self._scale.size, 0))
        rows = np.moveaxis(flat.reshape(*batch, 6, times.size), -2, -1).reshape(*batch, *times.shape, 6)
        lift = (..., *(None,) * times.ndim)
        return _unpacked(rows, self._scale[lift], self.vertical_momentum[lift])


def semidirect_bracket(
    df: tuple[ArrayLike, ArrayLike], dg: tuple[ArrayLike, ArrayLike], momentum: ArrayLike, gamma: ArrayLike
) -> Array:
    """The minus Lie-Poisson bracket {F, G} of the semidirect product se(3)*: (...).

    {F, G} = -Pi.(F_Pi x G_Pi) - Gamma.(F_Pi x G_Gamma + F_Gamma x G_Pi); F' = {F, H} along a heavy top's motion.

    Source: Marsden and Ratiu, introduction (heavy top) and section 15.10; theory.md M2.

    Parameters
    ----------
    df, dg : gradients (F_Pi, F_Gamma), (G_Pi, G_Gamma), each of two (..., 3)
    momentum, gamma : (..., 3) the point

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> zero = np.zeros(3)
    >>> sp.rigid_body.semidirect_bracket((x, zero), (y, zero), [0.0, 0.0, 5.0], z).item()  # -Pi . (x x y)
    -5.0
    """
    for pair, name in ((df, "df"), (dg, "dg")):
        check_pair(pair, name, "the gradients by momentum and by gamma")
    (fp, fg), (gp, gg) = (tuple(finite_array(row, "gradient", (3,)) for row in pair) for pair in (df, dg))
    pi, up = _point(momentum, gamma)
    turning = np.sum(pi * np.cross(fp, gp), axis=-1)
    return -turning - np.sum(up * (np.cross(fp, gg) + np.cross(fg, gp)), axis=-1)


def casimirs(momentum: ArrayLike, gamma: ArrayLike) -> tuple[Array, Array]:
    """(Pi.Gamma, |Gamma|^2), constant along every motion: (..., 3), (..., 3) -> two of (...).

    Source: Marsden and Ratiu, before (15.10.4).

    Examples
    --------
    >>> [float(value) for value in sp.rigid_body.casimirs([0.0, 0.0, 3.0], [0.0, 0.0, 1.0])]
    [3.0, 1.0]
    """
    pi, up = _point(momentum, gamma)
    return np.sum(pi * up, axis=-1), np.sum(up * up, axis=-1)


def heavy_top_steps(
    top: HeavyTop, attitude: Array, momentum: Array, duration: float, local_tolerance: float
) -> Iterator[tuple[float, Array, Array, DenseOutput]]:
    """Steps of the integration: time, attitude (quaternions xyzw) and spatial momentum after each, and its interpolant.

    All tops of the batch take the same steps. The tolerance of one step applies to the attitude [rad] and to the
    momentum relative to max(|Pi|, sqrt(Mgl I)). Raises AccuracyNotReached after 200 000 steps.
    """
    vertical, scale, start = _packed(top, attitude, momentum)
    strength = top.mgl / scale

    def rates(_: float, y: Array) -> Array:
        state, out = y.reshape(start.shape), np.empty(start.shape)
        quat, spatial = _unpacked(state, scale, vertical)
        rotation = so3.matrix_from_quat(quat)
        omega = so3.apply(top.inverse, so3.apply(so3.transpose(rotation), spatial))
        vector, scalar = state[..., :3], state[..., 3]
        # Not by np.cross, which would take half of the whole time.
        out[..., :3] = 0.5 * (scalar[..., None] * omega + so3.apply(so3.hat(vector), omega))
        out[..., 3] = -0.5 * np.sum(vector * omega, axis=-1)
        arm = so3.apply(rotation, top.chi)
        out[..., 4] = -strength * arm[..., 1]
        out[..., -1] = strength * arm[..., 0]
        return out.ravel()

    solver = DOP853(
        rates, 0.0, start.ravel(), duration, rtol=TOLERANCE, atol=local_tolerance / np.sqrt(max(scale.size, 1))
    )
    for _ in range(_STEPS):
        message = solver.step()
        if solver.status == "failed":
            raise AccuracyNotReached(f"heavy top: {message} at t = {solver.t:.9g} s; loosen the tolerance")
        yield solver.t, *_unpacked(solver.y.reshape(start.shape), scale, vertical), solver.dense_output()
        if solver.status == "finished":
            return
    raise AccuracyNotReached(
        f"heavy top: {_STEPS} steps reach t = {solver.t:.6g} of {duration:.6g} s; shorten the motion"
    )


def _packed(top: HeavyTop, attitude: Array, momentum: Array) -> tuple[Array, Array, Array]:
    """Vertical momentum, unit of momentum and state (quaternion, horizontal momentum in that unit)."""
    spatial = so3.apply(attitude, momentum)
    moment = np.trace(top.inertia, axis1=-2, axis2=-1)
    scale = np.maximum(np.linalg.norm(momentum, axis=-1), np.sqrt(np.abs(top.mgl) * moment))
    scale = np.where(scale > 0.0, scale, 1.0)
    state = np.concatenate([so3.quat_from_matrix(attitude), spatial[..., :2] / scale[..., None]], axis=-1)
    # Pi.Gamma from the given data, so that the rounding of the product R Pi does not enter.
    return np.sum(momentum * attitude[..., 2, :], axis=-1), scale, state


def _unpacked(state: Array, scale: Array, vertical: Array) -> tuple[Array, Array]:
    """Unit quaternion and spatial momentum."""
    horizontal = state[..., 4:] * scale[..., None]
    upright = np.broadcast_to(vertical, horizontal.shape[:-1])[..., None]
    return so3.normalised(state[..., :4]), np.concatenate([horizontal, upright], axis=-1)


def _integrated(
    top: HeavyTop, attitude: Array, momentum: Array, duration: float, local_tolerance: float
) -> HeavyTopMotion:
    """One run with a local tolerance, without an error estimate."""
    vertical, scale, _ = _packed(top, attitude, momentum)
    before = top.energy(momentum, attitude[..., 2, :])
    times, pieces, drift = [0.0], [], np.zeros(scale.shape)
    for t, quat, spatial, piece in heavy_top_steps(top, attitude, momentum, duration, local_tolerance):
        rotation = so3.matrix_from_quat(quat)
        energy = top.energy(so3.apply(so3.transpose(rotation), spatial), rotation[..., 2, :])
        drift = np.maximum(drift, np.abs(energy - before))
        times.append(t)
        pieces.append(piece)
    return HeavyTopMotion(top, duration, vertical, np.zeros(scale.shape), drift, scale, OdeSolution(times, pieces))


def _difference(coarse: HeavyTopMotion, fine: HeavyTopMotion) -> Array:
    """Largest angle between the attitudes, at the ends and middles of the finer steps [rad]."""
    ends = fine._solution.ts
    times = np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1])])
    return so3.angle(so3.transpose(coarse.attitude(times)) @ fine.attitude(times)).max(axis=-1)


def _point(momentum: ArrayLike, gamma: ArrayLike) -> Pair:
    """A point of se(3)* as two arrays of one shape."""
    pi, up = finite_array(momentum, "momentum", (3,), unit="kg m^2/s"), finite_array(gamma, "gamma", (3,))
    shape = common_batch(momentum=pi.shape, gamma=up.shape)
    return np.broadcast_to(pi, shape), np.broadcast_to(up, shape)
