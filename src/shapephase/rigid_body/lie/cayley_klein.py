"""Cayley-Klein parameters: the rigid body on C^2, over so(3)* by the momentum map of SU(2).

z = q + i p in C^2 has the canonical bracket {q_a, p_b} = delta_ab. SU(2) acts by multiplication, and minus its
momentum map, Pi_k = -z^H sigma_k z / 4 with Pauli's matrices sigma_k, is a Poisson map onto so(3)* with the minus
Lie-Poisson bracket. A collective Hamiltonian H(Pi(z)) gives z' = (i/2) (Omega . sigma) z, Omega = dH/dPi, and z covers
the whole motion of the body, attitude included: z(t) = U(t)^H z(0) with U in SU(2) over R(t), R' = R hat(Omega).
|Pi| = |z|^2 / 4.

Source: Marsden and Ratiu, exercise 15.4-1; theory.md G6.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arguments import inverse_inertia_argument
from ...arrays import Array, finite_array
from ...errors import ShapeError
from .._arguments import SIX_DIGITS, ascending_times
from .._flow import flow
from .lie_algebra import complex_or_real, su2
from .lie_poisson import angular_velocity, kinetic_energy

Spinor = NDArray[np.complex128]  # vectors of C^2: (..., 2)

PAULI = 2j * su2().matrix_basis  # Pauli's matrices sigma_k: (3, 2, 2)
PAULI.setflags(write=False)


def cayley_klein_momentum(z: ArrayLike) -> Array:
    """Pi_k = -z^H sigma_k z / 4, minus the momentum map of SU(2) on C^2: (..., 2) -> (..., 3) [kg m^2/s].

    Examples
    --------
    >>> print(sp.rigid_body.lie.cayley_klein_momentum([2.0, 0.0]) + 0.0)
    [ 0.  0. -1.]
    """
    return _momentum_map(_spinor(z, "z"))


def cayley_klein_spinor(momentum: ArrayLike, phase: ArrayLike = 0.0) -> Spinor:
    """Spinor z with this momentum; its phase is the coordinate along the fibre: (..., 3), (...) -> (..., 2).

    Examples
    --------
    >>> z = sp.rigid_body.lie.cayley_klein_spinor([0.3, 0.4, 1.2])
    >>> print(sp.rigid_body.lie.cayley_klein_momentum(z).round(9))
    [0.3 0.4 1.2]
    """
    pi, angle = finite_array(momentum, "momentum", (3,)), finite_array(phase, "phase")
    length = np.linalg.norm(pi, axis=-1)
    below = pi[..., 2] <= 0.0
    # The larger component is made real, so that nothing cancels wherever the momentum points.
    large = np.sqrt(2.0 * (length + np.abs(pi[..., 2])))
    cross = -2.0 * (pi[..., 0] + 1j * pi[..., 1])
    small = np.where(below, cross, cross.conj()) / np.where(large > 0.0, large, 1.0)
    pair = np.where(below[..., None], np.stack([large + 0j, small], -1), np.stack([small, large + 0j], -1))
    return np.exp(1j * angle)[..., None] * pair


def cayley_klein_bracket(first: ArrayLike, second: ArrayLike) -> Array:
    """{F, G} on C^2 = T*R^2, from gradients with respect to q (real parts) and p (imaginary parts): (...).

    Parameters
    ----------
    first, second : (..., 2) complex, dF/dq + i dF/dp

    Examples
    --------
    >>> float(np.real(sp.rigid_body.lie.cayley_klein_bracket([1.0, 0.0], [1.0j, 0.0])))  # {q_1, p_1}
    1.0
    """
    f, g = _spinor(first, "first"), _spinor(second, "second")
    return np.sum(f.real * g.imag - f.imag * g.real, axis=-1)


def cayley_klein_gradient(omega: ArrayLike, z: ArrayLike) -> Spinor:
    """The gradient dF/dq + i dF/dp of a collective F(Pi(z)) with dF/dPi = omega: (..., 3), (..., 2) -> (..., 2).

    Examples
    --------
    >>> sp.rigid_body.lie.cayley_klein_gradient([0.0, 0.0, 2.0], [2.0, 0.0]).shape
    (2,)
    """
    return -0.5 * _turned(finite_array(omega, "omega", (3,)), _spinor(z, "z"))


def cayley_klein_hamiltonian(inertia: ArrayLike, z: ArrayLike) -> Array:
    """The kinetic energy as a function on C^2, K(Pi(z)): (..., 3, 3), (..., 2) -> (...) [J].

    Examples
    --------
    >>> z = sp.rigid_body.lie.cayley_klein_spinor([0.0, 0.0, 2.0])
    >>> print(f"{sp.rigid_body.lie.cayley_klein_hamiltonian(np.diag([1.0, 2.0, 4.0]), z):.9f} J")
    0.500000000 J
    """
    return kinetic_energy(inertia, cayley_klein_momentum(z))


def cayley_klein_equations(inertia: ArrayLike, z: ArrayLike) -> Spinor:
    """Hamilton's equations of the kinetic energy on C^2, z' = (i/2) (Omega . sigma) z: (..., 2) -> (..., 2).

    Examples
    --------
    >>> z = sp.rigid_body.lie.cayley_klein_spinor([0.0, 0.0, 2.0])
    >>> rate = sp.rigid_body.lie.cayley_klein_equations(np.diag([1.0, 2.0, 4.0]), z)
    >>> print(f"{np.linalg.norm(rate) / np.linalg.norm(z):.9f}")  # half of Omega_3 = 1/2
    0.250000000
    """
    spinor = _spinor(z, "z")
    return 0.5j * _turned(angular_velocity(inertia, cayley_klein_momentum(spinor)), spinor)


def cayley_klein_motion(inertia: ArrayLike, z: ArrayLike, times: ArrayLike) -> Spinor:
    """The rigid body's flow on C^2 from z at the first time: (..., 2), (N,) -> (..., N, 2).

    Examples
    --------
    >>> start = sp.rigid_body.lie.cayley_klein_spinor([0.3, 0.4, 1.2])
    >>> z = sp.rigid_body.lie.cayley_klein_motion(np.diag([1.0, 2.0, 4.0]), start, [0.0, 1.0])
    >>> print(np.linalg.norm(sp.rigid_body.lie.cayley_klein_momentum(z), axis=-1).round(9))
    [1.3 1.3]
    """
    inverse, start = inverse_inertia_argument(inertia), _spinor(z, "z")

    def rate(state: Array) -> Array:
        spinor = state[..., :2] + 1j * state[..., 2:]
        change = 0.5j * _turned((inverse @ _momentum_map(spinor)[..., None])[..., 0], spinor)
        return np.concatenate([change.real, change.imag], axis=-1)

    states = flow(rate, np.concatenate([start.real, start.imag], axis=-1), ascending_times(times))
    return states[..., :2] + 1j * states[..., 2:]


def cayley_klein_attitude(start: ArrayLike, z: ArrayLike) -> Array:
    """The attitude since `start` that a z of the same motion covers: (..., 2), (..., 2) -> (..., 3, 3).

    The U in SU(2) with z = U^H start, as a rotation: R^T takes the momentum of `start` to that of z.

    Raises ShapeError if the two lengths differ by more than 1e-6 of themselves, or are zero.

    Examples
    --------
    >>> start = sp.rigid_body.lie.cayley_klein_spinor([0.0, 0.0, 2.0])
    >>> z = sp.rigid_body.lie.cayley_klein_motion(np.diag([1.0, 2.0, 4.0]), start, [0.0, 1.0])[-1]
    >>> print(f"{sp.so3.angle(sp.rigid_body.lie.cayley_klein_attitude(start, z)):.9f}")  # 1/2 rad/s for 1 s
    0.500000000
    """
    first, last = _spinor(start, "start"), _spinor(z, "z")
    length, other = np.linalg.norm(first, axis=-1), np.linalg.norm(last, axis=-1)
    if not np.all((length > 0.0) & (np.abs(length - other) <= SIX_DIGITS * length)):
        raise ShapeError("z: not on the sphere |z| = |start| of a motion; equal lengths above 0 are needed")
    a, b = (_frame(x / n[..., None]) for x, n in ((first, length), (last, other)))
    unitary = a @ np.swapaxes(b.conj(), -1, -2)
    return 0.5 * np.einsum("jab,...bc,kcd,...ad->...jk", PAULI, unitary, PAULI, unitary.conj()).real


def _frame(unit: Spinor) -> Spinor:
    """The matrix of SU(2) whose first column is a unit vector."""
    return np.stack([unit, np.stack([-unit[..., 1].conj(), unit[..., 0].conj()], axis=-1)], axis=-1)


def _momentum_map(spinor: Spinor) -> Array:
    return -np.einsum("...a,kab,...b->...k", spinor.conj(), PAULI, spinor).real / 4.0


def _turned(omega: Array, spinor: Spinor) -> Spinor:
    return np.einsum("...k,kab,...b->...a", omega, PAULI, spinor)


def _spinor(value: ArrayLike, name: str) -> Spinor:
    return complex_or_real(value, name, (2,)).astype(np.complex128)
