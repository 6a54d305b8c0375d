"""The energy E_t = Pi.I^-1 Pi/2 along a motion, its rate, and its level sets on the sphere of momenta.

E_t is not the kinetic energy T where the shape moves: with T_0 that of the shape motion alone,

    T = omega.I omega/2 + L_o.omega + T_0,    E_t = T - T_0 + L_o.I^-1 L_o/2.

Sources: Cabrera 2006, equation (4) with the missing half (theory.md C-E1) and section 4.1 with L_o in place of the
misprint there (C-E9); theory.md E1 to E5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, number_argument, times_argument, whole_argument
from ..arrays import Array, finite_array
from ..deformation.deformation import Deformation
from ..display import short_repr
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion
from ..rigid_body.euler_top import EulerTop


@dataclass(frozen=True, eq=False)
class EnergyRate:
    """The two parts of dE_t/dt; fields are batch + t.shape [W]. Made by `energy_rate`."""

    by_inertia: Array
    """Pi.(I^-1)' Pi/2, the whole rate if there is no internal momentum."""
    by_internal_momentum: Array
    """(Pi x I^-1 Pi).I^-1 L_o."""

    __repr__ = short_repr

    @property
    def total(self) -> Array:
        """dE_t/dt [W]."""
        return self.by_inertia + self.by_internal_momentum


@dataclass(frozen=True, eq=False)
class FrozenPolhode:
    """Polhode of Pi if the body stayed rigid from one time on. Made by `frozen_polhode`."""

    points: Array
    """(N, 3) of the curve from Pi once round and back to it [kg m^2/s]; on the separatrix it is not closed, but the
    half circle through Pi between the two directions of the intermediate axis."""
    energy: float
    """E_t on it [J]."""
    homoclinic_energy: float
    """E_t of the separatrix [J]."""
    period: float
    """Period of the rigid body's Pi [s]; infinite on the separatrix and at an equilibrium."""
    regime: str
    """One of those of `EulerTop.regime`."""

    __repr__ = short_repr


def momentum_energy(inertia: ArrayLike, momentum: ArrayLike) -> Array:
    """E = Pi.I^-1 Pi/2: (..., 3, 3) [kg m^2], (..., 3) body axes [kg m^2/s] -> (...) [J]; leading axes broadcast.

    Raises ShapeError, SingularInertiaError. Source: theory.md E1.

    Examples
    --------
    >>> sp.bounds.momentum_energy(np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 2.0]).item()
    0.5
    """
    tensor, pi = finite_array(inertia, "inertia", (3, 3)), finite_array(momentum, "momentum", (3,))
    return 0.5 * np.sum(pi * so3.apply(inverse_inertia(tensor), pi), axis=-1)


def energy_along(motion: Motion, t: ArrayLike) -> Array:
    """E_t of a motion: times (...) -> batch + (...) [J]. Source: theory.md E1.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.0, 0.0, 2.0])
    >>> sp.bounds.energy_along(motion, [0.0, 3.0]).tolist()
    [0.5, 0.5]
    """
    check_object(motion, "Motion", "motion")
    times, inverse, _, pi = _along(motion, t)
    energy = 0.5 * np.sum(pi * so3.apply(inverse, pi), axis=-1)
    return energy.reshape((*motion.batch, *times.shape))[()]


def energy_rate(motion: Motion, t: ArrayLike) -> EnergyRate:
    """dE_t/dt of a motion, in its two parts: times (...) -> batch + (...) [W].

    Source: Cabrera 2006, section 4.1, with L_o where L(d_0) is printed (theory.md C-E9); E3.

    Equation :eq:`energy-rate` of the documentation.

    Examples
    --------
    >>> growing = sp.prescribed(lambda t: np.eye(3) * (1.0 + t)[:, None, None], None, 1.0)
    >>> motion = sp.reconstruct(growing, [0.0, 0.0, 2.0])
    >>> print(f"{sp.bounds.energy_rate(motion, 0.0).by_inertia:.6f} W")  # d/dt of 2/(1 + t)
    -2.000000 W
    """
    check_object(motion, "Motion", "motion")
    times, inverse, drift, pi = _along(motion, t)
    inverse_rate = -inverse @ motion.deformation.description.inertia_rate(times.ravel()) @ inverse
    shape = (*motion.batch, *times.shape)
    by_inertia = 0.5 * np.sum(pi * so3.apply(inverse_rate, pi), axis=-1)
    by_drift = np.sum(np.cross(pi, so3.apply(inverse, pi)) * drift, axis=-1)
    return EnergyRate(by_inertia.reshape(shape)[()], by_drift.reshape(shape)[()])


def kinetic_energy_along(motion: Motion, t: ArrayLike) -> Array:
    """T = omega.I omega/2 + L_o.omega + T_0 about the centre of mass: times (...) -> batch + (...) [J].

    Raises GaugeError if the deformation is known by its inertia only.
    Source: Cabrera 2006, equation (4), with the missing half (theory.md C-E1); A6.

    Equation :eq:`energies` of the documentation.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.0, 0.0, 2.0])
    >>> sp.bounds.kinetic_energy_along(motion, 1.0).item()
    0.5
    """
    check_object(motion, "Motion", "motion")
    times = times_argument(t, motion.duration)
    flat = times.ravel()
    inertia, internal = motion.deformation.description.sample(flat)
    omega = motion.angular_velocity(flat).reshape(-1, flat.size, 3)
    turning = np.sum(omega * (0.5 * so3.apply(inertia, omega) + internal), axis=-1)
    shape_only = motion.deformation.description.kinetic_energy(flat, np.zeros((1, flat.size, 3)))
    return (turning + shape_only).reshape((*motion.batch, *times.shape))[()]


def homoclinic_energy(deformation: Deformation, t: ArrayLike, magnitude: float) -> Array:
    """l^2/(2 I_2(t)), the energy on the separatrix of the body frozen at each time: times (...) -> (...) [J].

    Equation :eq:`homoclinic` of the documentation.
    Source: Cabrera 2006, section 4.1.1, with the missing half (theory.md C-E5); E5.

    Parameters
    ----------
    magnitude : l, the momentum's norm [kg m^2/s]

    Examples
    --------
    >>> sp.bounds.homoclinic_energy(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), 0.0, 2.0).item()
    1.0
    """
    check_object(deformation, "Deformation", "deformation")
    norm = number_argument(magnitude, "magnitude")
    times = times_argument(t, deformation.duration)
    middle = np.linalg.eigvalsh(deformation.inertia(times))[..., 1]
    return np.asarray(0.5 * norm * norm / middle, dtype=np.float64)[()]


def frozen_polhode(deformation: Deformation, t: float, momentum: ArrayLike, count: int = 200) -> FrozenPolhode:
    """The level set of E_t through Pi: its polhode if the body stayed rigid with the inertia of time t.

    Source: Cabrera 2006, section 4.1; theory.md E4.

    Parameters
    ----------
    momentum : (3,) Pi(t), base axes [kg m^2/s]
    count : number of points, 2 or more

    Examples
    --------
    >>> curve = sp.bounds.frozen_polhode(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), 0.0, [0.1, 0.2, 2.0])
    >>> top = sp.EulerTop.principal([1.0, 2.0, 4.0], [0.1, 0.2, 2.0])
    >>> print(f"{curve.period:.6f} s, {top.period:.6f} s")
    7.252223 s, 7.252223 s
    """
    check_object(deformation, "Deformation", "deformation")
    count = whole_argument(count, "count", 2)
    inertia = deformation.inertia(number_argument(t, "t", "s"))
    top = EulerTop(inertia, momentum)
    orbit = top.orbit
    directions = np.broadcast_to(orbit.direction, (count, 3))
    if orbit.rate:
        # Parametrised by the angle about the axis that is circled, because the time is infinite on the separatrix.
        scaled = orbit.start / orbit.magnitude / np.where(orbit.amplitudes == 0.0, 1.0, orbit.amplitudes)
        half, begin = orbit.regime == "separatrix", float(np.arctan2(scaled[1], scaled[orbit.other]))
        am = np.linspace(-0.5 * np.pi, 0.5 * np.pi, count) if half else begin + np.linspace(0.0, 2.0 * np.pi, count)
        sine, cosine = np.sin(am), np.cos(am)
        directions = np.empty((count, 3))
        directions[:, 1], directions[:, orbit.other] = sine, cosine
        directions[:, orbit.circled] = np.sqrt(cosine * cosine + orbit.complement * sine * sine)
        directions *= orbit.amplitudes
    return FrozenPolhode(
        points=orbit.magnitude * (directions @ top.axes.T),
        energy=top.energy,
        homoclinic_energy=0.5 * orbit.magnitude * orbit.magnitude / float(top.moments[1]),
        period=top.period,
        regime=top.regime,
    )


def _along(motion: Motion, t: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """Times, and at them flattened I^-1 (N, 3, 3), w (N, 3) and Pi (B, N, 3)."""
    times = times_argument(t, motion.duration)
    flat = times.ravel()
    inertia, internal = motion.deformation.description.sample(flat)
    inverse = inverse_inertia(inertia, flat)
    pi = motion.body_momentum(flat).reshape(-1, flat.size, 3)
    return times, inverse, so3.apply(inverse, internal), pi
