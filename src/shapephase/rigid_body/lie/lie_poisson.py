"""The minus Lie-Poisson bracket on the dual of a Lie algebra, its Casimirs and the symplectic form of its leaves.

{F, G}(mu) = -<mu, [dF, dG]>, on so(3)* = R^3 the rigid body's bracket -Pi . (grad F x grad G). The equations of
motion F' = {F, H} are mu' = ad*_{dH} mu, for the kinetic energy K = Pi . I^-1 Pi / 2 Euler's equations. Functions
enter by their gradients, as values (..., d) or as callables of the momentum. Where no algebra is given it is so(3).

Source: Marsden and Ratiu, section 15.3 and chapter 13.

With double-bracket dissipation the energy of a free rigid body falls and its momentum stays on its sphere:
Pi' = Pi x Omega + alpha Pi x (Pi x Omega) with alpha > 0, that is F' = {F, K} + {F, K}_sym with the symmetric bracket
{F, G}_sym = -alpha (Pi x grad F) . (Pi x grad G); Marsden and Ratiu print it without the minus sign, with which the
energy would grow.

Source: Marsden and Ratiu, exercise 15.9-2; theory.md K4, M-E8.

The attitude of a body whose angular velocity is the gradient of H follows R' = R hat(grad H(Pi)). H and the spatial
momentum mu = R Pi, the lift of right-invariant fields, are constant, so that R alone is the state: Pi = R^T mu.

Source: Bonnard, Cots and Shcherbakova 2013, remark 3 and proposition 5; theory.md Q4, Q9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_function, check_object, check_pair, inverse_inertia_argument
from ...arrays import Array, common_batch, finite_array
from ...display import short_repr
from ...errors import ShapeError
from .._arguments import TWELVE_DIGITS, ascending_times
from .._flow import flow
from .lie_algebra import WRITTEN_DIGITS, LieAlgebra, so

Gradient = ArrayLike | Callable[[Array], ArrayLike]  # on the dual: values (..., d), or a callable of momenta (..., d)

_SO3 = so(3)  # the algebra of a function that is not given one
_NULL = 1e-10  # of linear equations in structure constants, which may have defects of 1e-12


def poisson_tensor(momentum: ArrayLike, algebra: LieAlgebra = _SO3) -> Array:
    """B_ij = {mu_i, mu_j} = -c_ij^k mu_k: (..., d) -> (..., d, d). {F, G} = dF . B dG, and mu' = B dH.

    For so(3) it is hat(Pi).

    Examples
    --------
    >>> print(sp.rigid_body.lie.poisson_tensor([1.0, 2.0, 3.0]) + 0.0)
    [[ 0. -3.  2.]
     [ 3.  0. -1.]
     [-2.  1.  0.]]
    """
    mu = _momentum(momentum, algebra)
    return -np.einsum("ijk,...k->...ij", algebra.structure, mu)


def lie_poisson_bracket(first: Gradient, second: Gradient, momentum: ArrayLike, algebra: LieAlgebra = _SO3) -> Array:
    """{F, G}(mu) = -<mu, [dF, dG]>: (...), from the gradients of F and G at momenta (..., d).

    Equation :eq:`bracket` of the documentation.
    Source: Marsden and Ratiu, equation (15.3.8); theory.md K1.

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> sp.rigid_body.lie.lie_poisson_bracket(x, y, [0.0, 0.0, 5.0]).item()  # {Pi_1, Pi_2} = -Pi_3
    -5.0
    """
    mu = _momentum(momentum, algebra)
    bracket = algebra.bracket(gradient_at(first, "first", mu), gradient_at(second, "second", mu))
    return -np.sum(mu * bracket, axis=-1)


def bracket_gradient(
    first: tuple[ArrayLike, ArrayLike],
    second: tuple[ArrayLike, ArrayLike],
    momentum: ArrayLike,
    algebra: LieAlgebra = _SO3,
) -> Array:
    """The gradient of {F, G}, with which brackets can be nested: (..., d).

    Parameters
    ----------
    first, second : gradient (..., d) and Hessian (..., d, d) of F and of G at the momenta
    momentum : (..., d)

    Examples
    --------
    >>> flat = np.zeros((3, 3))
    >>> sp.rigid_body.lie.bracket_gradient(([1.0, 0.0, 0.0], flat), ([0.0, 1.0, 0.0], flat), [1.0, 2.0, 3.0]).tolist()
    [0.0, 0.0, -1.0]
    """
    mu = _momentum(momentum, algebra)
    d = algebra.dimension
    for pair, name in ((first, "first"), (second, "second")):
        check_pair(pair, name, "a gradient and a Hessian")
    df, dg = finite_array(first[0], "first gradient", (d,)), finite_array(second[0], "second gradient", (d,))
    ddf, ddg = finite_array(first[1], "first Hessian", (d, d)), finite_array(second[1], "second Hessian", (d, d))
    tensor = poisson_tensor(mu, algebra)
    outer = np.einsum("...ji,...jk,...k->...i", ddf, tensor, dg) + np.einsum("...j,...jk,...ki->...i", df, tensor, ddg)
    return outer - algebra.bracket(df, dg)


def hamiltonian_vector_field(hamiltonian: Gradient, momentum: ArrayLike, algebra: LieAlgebra = _SO3) -> Array:
    """X_H(mu) = ad*_{dH} mu, with {F, H} = dF . X_H: (..., d) -> (..., d). For so(3) it is Pi x grad H.

    Examples
    --------
    >>> sp.rigid_body.lie.hamiltonian_vector_field([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]).tolist()  # Pi x grad H
    [0.0, -1.0, 0.0]
    """
    mu = _momentum(momentum, algebra)
    return algebra.coad(gradient_at(hamiltonian, "hamiltonian", mu), mu)


def lie_poisson_motion(
    hamiltonian: Callable[[Array], ArrayLike], momentum: ArrayLike, times: ArrayLike, algebra: LieAlgebra = _SO3
) -> Array:
    """The motion mu' = ad*_{dH} mu from a momentum at the first time: (..., d), (N,) -> (..., N, d).

    Raises AccuracyNotReached if the motion goes to infinity before the last time.

    Parameters
    ----------
    hamiltonian : gradient of H, momenta (..., d) -> (..., d)
    times : (N,) strictly ascending

    Examples
    --------
    >>> inverse = np.array([1.0, 0.5, 0.25])
    >>> pi = sp.rigid_body.lie.lie_poisson_motion(lambda pi: inverse * pi, [0.3, 0.4, 1.2], [0.0, 1.0, 2.0])
    >>> print(np.linalg.norm(pi, axis=-1).round(9))
    [1.3 1.3 1.3]
    """
    start, instants = _momentum(momentum, algebra), ascending_times(times)
    check_function(hamiltonian, "hamiltonian", "a function that gives the gradient")
    gradient_at(hamiltonian, "hamiltonian", start)

    def rate(mu: Array) -> Array:
        gradient = np.broadcast_to(np.asarray(hamiltonian(mu), dtype=float), mu.shape)
        return np.einsum("...i,ijk,...k->...j", gradient, algebra.structure, mu)

    return flow(rate, start, instants)


def casimir_defect(function: Gradient, momentum: ArrayLike, algebra: LieAlgebra = _SO3) -> Array:
    """Length of ad*_{dC} mu, the vector field of a function: (..., d) -> (...).

    Zero everywhere if and only if C is a Casimir.

    Source: Marsden and Ratiu, equation (15.3.12).

    Examples
    --------
    >>> sp.rigid_body.lie.casimir_defect([0.3, 0.4, 1.2], [0.3, 0.4, 1.2]).item()  # of |Pi|^2/2, a Casimir
    0.0
    """
    return np.linalg.norm(hamiltonian_vector_field(function, momentum, algebra), axis=-1)


def linear_casimirs(algebra: LieAlgebra) -> Array:
    """An orthonormal basis v of the linear Casimirs mu -> v . mu, that is of the centre of the algebra: (count, d).

    Examples
    --------
    >>> sp.rigid_body.lie.linear_casimirs(sp.rigid_body.lie.so3()).shape  # none
    (0, 3)
    """
    check_object(algebra, "LieAlgebra", "algebra")
    return _null_space(algebra.structure.reshape(algebra.dimension, -1).T)


def quadratic_casimirs(algebra: LieAlgebra) -> Array:
    """A basis Q of the quadratic Casimirs mu -> mu . Q mu, orthonormal, each Q symmetric: (count, d, d).

    Products of linear Casimirs are among them. From the null space of {mu . Q mu, mu_j} = 0, d^2 (d + 1)/2 linear
    equations for d (d + 1)/2 unknowns.

    Examples
    --------
    >>> print((sp.rigid_body.lie.quadratic_casimirs(sp.rigid_body.lie.so3())[0] * np.sqrt(3.0)).round(9) + 0.0)
    [[1. 0. 0.]
     [0. 1. 0.]
     [0. 0. 1.]]
    """
    check_object(algebra, "LieAlgebra", "algebra")
    d = algebra.dimension
    rows, columns = np.triu_indices(d)
    symmetric = np.zeros((len(rows), d, d))
    weight = np.where(rows == columns, 1.0, np.sqrt(0.5))
    symmetric[np.arange(len(rows)), rows, columns] = weight
    symmetric[np.arange(len(rows)), columns, rows] = weight
    field = np.einsum("qim,ijk->qjmk", symmetric, algebra.structure)
    equations = (field + field.swapaxes(-1, -2)).reshape(len(rows), -1)
    return np.einsum("cq,qij->cij", _null_space(equations.T), symmetric)


def coadjoint_orbit_form(momentum: ArrayLike, first: ArrayLike, second: ArrayLike, algebra: LieAlgebra = _SO3) -> Array:
    """The minus form of the coadjoint orbit, omega(ad*_a mu, ad*_b mu) = -<mu, [a, b]>: (...).

    {F, G} = omega(X_F, X_G), and omega(X_H, v) = dH . v. Arguments in the order of all forms here, as
    `sphere_symplectic_form`, which it is on so(3).

    Raises ShapeError if a vector is not tangent to the orbit, that is not an ad*_a mu, to 1e-9 of its length.

    Parameters
    ----------
    momentum : (..., d) the point mu
    first, second : (..., d) tangent vectors of the orbit

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> sp.rigid_body.lie.coadjoint_orbit_form([0.0, 0.0, 5.0], x, y).item()
    -0.2
    """
    mu = _momentum(momentum, algebra)
    tensor = poisson_tensor(mu, algebra)
    inverse = np.linalg.pinv(tensor, rcond=TWELVE_DIGITS)
    u, v = finite_array(first, "first", mu.shape[-1:]), finite_array(second, "second", mu.shape[-1:])
    for name, vector in (("first", u), ("second", v)):
        off = np.linalg.norm((tensor @ inverse @ vector[..., None])[..., 0] - vector, axis=-1)
        if np.any(off > WRITTEN_DIGITS * np.linalg.norm(vector, axis=-1)):
            raise ShapeError(f"{name}: not tangent to the coadjoint orbit, {off.max():.3g} of it is off the leaf")
    return np.einsum("...ij,...j,...i->...", inverse, u, v)


def sphere_area_form(momentum: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """dA(u, v) = Pi . (u x v)/|Pi|, the area form of the sphere through Pi, positive from outside: (..., 3) -> (...).

    Raises ShapeError for a zero momentum.

    Examples
    --------
    >>> sp.rigid_body.lie.sphere_area_form([0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]).item()
    1.0
    """
    pi, u, v = (finite_array(x, n, (3,)) for x, n in ((momentum, "momentum"), (first, "first"), (second, "second")))
    return np.sum(pi * np.cross(u, v), axis=-1) / _radius(pi)


def sphere_symplectic_form(momentum: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """omega(u, v) = -Pi . (u x v)/|Pi|^2 = -dA/|Pi|, the form of the leaf for the minus bracket: (..., 3) -> (...).

    omega(X_H, v) = dH . v for tangent v. Raises ShapeError for a zero momentum. Source: theory.md K2, D3.

    Equation :eq:`symplectic` of the documentation.

    Examples
    --------
    >>> sp.rigid_body.lie.sphere_symplectic_form([0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]).item()  # -dA/|Pi|
    -0.5
    """
    area = sphere_area_form(momentum, first, second)
    return -area / _radius(np.asarray(momentum, dtype=float))


def euler_equations(inertia: ArrayLike, momentum: ArrayLike) -> Array:
    """Pi' = Pi x I^-1 Pi: (..., 3, 3), (..., 3) -> (..., 3) [kg m^2/s^2].

    Equations :eq:`euler-rigid` and :eq:`hamiltonian` of the documentation.
    Source: Marsden and Ratiu, equations (15.3.9), (15.3.10).

    Examples
    --------
    >>> sp.rigid_body.lie.euler_equations(np.diag([1.0, 2.0, 4.0]), [1.0, 0.0, 1.0]).tolist()  # Pi x I^-1 Pi
    [0.0, 0.75, 0.0]
    """
    pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    return np.cross(pi, angular_velocity(inertia, pi))


def kinetic_energy(inertia: ArrayLike, momentum: ArrayLike) -> Array:
    """K = Pi . I^-1 Pi / 2: (..., 3, 3), (..., 3) -> (...) [J]. Source: equation (15.3.3).

    Examples
    --------
    >>> sp.rigid_body.lie.kinetic_energy(np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 2.0]).item()
    0.5
    """
    pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    return 0.5 * np.sum(pi * angular_velocity(inertia, pi), axis=-1)


def angular_velocity(inertia: ArrayLike, momentum: ArrayLike) -> Array:
    """Omega = I^-1 Pi, the gradient of the kinetic energy: (..., 3, 3), (..., 3) -> (..., 3) [rad/s, body axes].

    Examples
    --------
    >>> sp.rigid_body.lie.angular_velocity(np.diag([1.0, 2.0, 4.0]), [1.0, 1.0, 1.0]).tolist()
    [1.0, 0.5, 0.25]
    """
    pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    return (inverse_inertia_argument(inertia) @ pi[..., None])[..., 0]


def gradient_at(gradient: Gradient, name: str, mu: Array) -> Array:
    """Gradient, given by values or a callable, at momenta (..., d). Raises ShapeError, WrongObjectError."""
    if callable(gradient):
        check_function(gradient, name, "a gradient, or a function that gives it,")
    value = gradient(mu) if callable(gradient) else gradient
    return finite_array(value, f"{name} gradient", mu.shape[-1:])


def _momentum(value: ArrayLike, algebra: LieAlgebra) -> Array:
    check_object(algebra, "LieAlgebra", "algebra")
    return finite_array(value, "momentum", (algebra.dimension,))


def _radius(pi: Array) -> Array:
    radius = np.linalg.norm(pi, axis=-1)
    if not np.all(radius > 0.0):
        raise ShapeError("momentum: the sphere of radius 0 has no area form; a momentum other than 0 is needed")
    return radius


def _null_space(equations: Array) -> Array:
    """Orthonormal solutions of a homogeneous linear system: (m, n) -> (count, n)."""
    # The triangular factor comes first because there are many more equations than unknowns.
    _, values, vectors = np.linalg.svd(np.linalg.qr(equations, mode="r"))
    rank = int(np.sum(values > _NULL * max(float(values.max(initial=0.0)), 1.0)))
    return vectors[rank:]


def symmetric_bracket(first: Gradient, second: Gradient, momentum: ArrayLike, alpha: ArrayLike) -> Array:
    """{F, G}_sym = -alpha (Pi x grad F) . (Pi x grad G), from gradients at momenta (..., 3): (...).

    Parameters
    ----------
    first, second : gradients of F and G, values (..., 3) or callables of the momentum
    momentum : (..., 3) body momentum [kg m^2/s]
    alpha : (...) dissipation [s/(kg m^2)], positive where energy is lost

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> sp.rigid_body.lie.symmetric_bracket(x, x, [0.0, 0.0, 2.0], 0.5).item()  # -alpha |Pi x e_x|^2
    -2.0
    """
    pi, strength = finite_array(momentum, "momentum", (3,), unit="kg m^2/s"), finite_array(alpha, "alpha")
    across = np.cross(pi, gradient_at(first, "first", pi))
    return -strength * np.sum(across * np.cross(pi, gradient_at(second, "second", pi)), axis=-1)


def double_bracket_equations(inertia: ArrayLike, momentum: ArrayLike, alpha: ArrayLike) -> Array:
    """Pi' = Pi x Omega + alpha Pi x (Pi x Omega): (..., 3, 3), (..., 3), (...) -> (..., 3) [kg m^2/s^2].

    Examples
    --------
    >>> sp.rigid_body.lie.double_bracket_equations(np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 2.0], 0.1).tolist()
    [0.0, 0.0, 0.0]
    """
    pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    return _rate(pi, angular_velocity(inertia, pi), finite_array(alpha, "alpha")[..., None])


def dissipated_power(inertia: ArrayLike, momentum: ArrayLike, alpha: ArrayLike) -> Array:
    """-dK/dt = alpha |Pi x Omega|^2, zero at equilibria only: (...) [W].

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.dissipated_power(np.diag([1.0, 2.0, 4.0]), [1.0, 0.0, 1.0], 2.0).item()  # alpha |Pi x Omega|^2
    1.125
    """
    pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    torque = np.cross(pi, angular_velocity(inertia, pi))
    return finite_array(alpha, "alpha") * np.sum(torque * torque, axis=-1)


def double_bracket_motion(inertia: ArrayLike, momentum: ArrayLike, alpha: float, times: ArrayLike) -> Array:
    """The body momentum under double-bracket dissipation, given at the first time: (..., 3), (N,) -> (..., N, 3).

    Parameters
    ----------
    inertia : (3, 3) or (..., 3, 3) [kg m^2]
    alpha : (...) dissipation [s/(kg m^2)]; a negative one drives the body
    times : (N,) strictly ascending [s]

    Examples
    --------
    >>> pi = sp.rigid_body.lie.double_bracket_motion(np.diag([1.0, 2.0, 4.0]), [0.6, 0.1, 0.5], 1.0, [0.0, 60.0])
    >>> print(pi[-1].round(4) + 0.0, np.linalg.norm(pi, axis=-1).round(6))
    [0.     0.     0.7874] [0.787401 0.787401]
    """
    pi, instants = finite_array(momentum, "momentum", (3,), unit="kg m^2/s"), ascending_times(times)
    strength, inverse = finite_array(alpha, "alpha")[..., None], inverse_inertia_argument(inertia)
    start = np.array(np.broadcast_to(pi, np.broadcast_shapes(pi.shape, inverse.shape[:-1], (*strength.shape[:-1], 3))))
    return flow(lambda p: _rate(p, (inverse @ p[..., None])[..., 0], strength), start, instants)


def _rate(pi: Array, omega: Array, strength: Array) -> Array:
    torque = np.cross(pi, omega)
    return torque + strength * np.cross(pi, torque)


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
