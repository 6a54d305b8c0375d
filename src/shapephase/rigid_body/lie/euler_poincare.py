"""The Euler-Poincare equations of a left-invariant kinetic energy on any Lie algebra.

With the inertia operator I and the body momentum mu = I xi they read mu' = ad*_xi mu, for so(3) Euler's equations
Pi' = Pi x Omega. The attitude follows from g' = g xi.

Poinsot's theorem holds on any of them: for l(xi) = <I xi, xi>/2 the quadric {l = E_0} of the body, carried into space
by Ad_g, touches the invariable hyperplane through xi_s = Ad_g xi, whose normal is the constant space momentum mu_s; the
point of it that touches has the velocity [xi_s, xi_s] = 0. In so(3) it is the inertia ellipsoid rolling on the
invariable plane.

Source: Marsden and Ratiu, exercise 15.5-1; theory.md I6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import LieAlgebraError
from .._arguments import ascending_times
from .._flow import flow
from .lie_algebra import LieAlgebra, Matrices, inertia_operator, linear_solution


@dataclass(frozen=True, eq=False)
class EulerPoincareMotion:
    """Motion of the Euler-Poincare equations from the identity of the group. Made by `euler_poincare_motion`."""

    algebra: LieAlgebra
    """The Lie algebra."""
    inertia: Array
    """(d, d) inertia operator."""
    times: Array
    """Times: (N,)."""
    momentum: Array
    """(..., N, d) body momentum mu."""
    velocity: Array
    """(..., N, d) body velocity xi = I^-1 mu."""
    adjoint: Array
    """(..., N, d, d) Ad_g, from body to space components; needs no matrices of the group."""
    attitude: Matrices | None
    """(..., N, n, n) the group element g, g' = g xi; None where the algebra has no basis of matrices."""

    __repr__ = short_repr

    @property
    def energy(self) -> Array:
        """l = <I xi, xi>/2, constant: (..., N)."""
        return 0.5 * np.sum(self.momentum * self.velocity, axis=-1)

    @property
    def space_velocity(self) -> Array:
        """xi_s = Ad_g xi: (..., N, d)."""
        return np.einsum("...ij,...j->...i", self.adjoint, self.velocity)

    @property
    def space_momentum(self) -> Array:
        """mu_s = Ad*_{g^-1} mu, constant: (..., N, d)."""
        return linear_solution(np.swapaxes(self.adjoint, -1, -2), self.momentum)


def euler_poincare_rate(algebra: LieAlgebra, inertia: ArrayLike, momentum: ArrayLike) -> Array:
    """mu' = ad*_xi mu with xi = I^-1 mu: (..., d) -> (..., d).

    Source: Marsden and Ratiu, section 15.3 and chapter 13; theory.md G7.
    Raises ShapeError, LieAlgebraError if the shapes do not fit, an entry is not finite, or the operator is not
    symmetric or singular.

    Parameters
    ----------
    inertia : (d, d) symmetric isomorphism of the algebra with its dual
    momentum : (..., d) body momentum

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> lie.euler_poincare_rate(lie.so3(), np.diag([1.0, 2.0, 4.0]), [1.0, 0.0, 1.0]).tolist()
    [0.0, 0.75, 0.0]
    """
    operator = inertia_operator(algebra, inertia)
    mu = finite_array(momentum, "momentum", (algebra.dimension,))
    return algebra.coad(linear_solution(operator, mu), mu)


def euler_poincare_motion(
    algebra: LieAlgebra, inertia: ArrayLike, momentum: ArrayLike, times: ArrayLike
) -> EulerPoincareMotion:
    """The motion with a given body momentum at the first time, with its reconstruction g' = g xi.

    Source: Marsden and Ratiu, equation (15.2.10) for the reconstruction.
    Raises AccuracyNotReached if the motion goes to infinity before the last time, as it can on some algebras.

    Parameters
    ----------
    inertia : (d, d) symmetric isomorphism of the algebra with its dual
    momentum : (..., d) body momentum at times[0], where g is the identity
    times : (N,) strictly ascending

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> motion = lie.euler_poincare_motion(lie.so3(), np.diag([1.0, 2.0, 4.0]), [0.3, 0.4, 1.2], [0.0, 1.0])
    >>> print(np.linalg.norm(motion.momentum, axis=-1).round(9))
    [1.3 1.3]
    """
    operator, d = inertia_operator(algebra, inertia), algebra.dimension
    mu, instants = finite_array(momentum, "momentum", (d,)), ascending_times(times)
    inverse, basis = np.linalg.inv(operator), algebra.basis
    # The adjoint representation and, where there is one, the matrix group obey the same equation.
    adjoint_basis = np.swapaxes(algebra.structure, -1, -2)
    blocks = [adjoint_basis] if basis is None else [adjoint_basis, basis]

    def rate(state: Array) -> Array:
        momenta, *elements = _split(state, blocks)
        xi = momenta @ inverse
        turning = [g @ np.einsum("...i,iab->...ab", xi, block) for g, block in zip(elements, blocks)]
        return _joined(np.einsum("...i,ijk,...k->...j", xi, algebra.structure, momenta), turning)

    identities = [np.broadcast_to(np.eye(b.shape[-1], dtype=b.dtype), (*mu.shape[:-1], *b.shape[1:])) for b in blocks]
    start = _joined(mu, identities)
    scale = np.ones(start.shape)
    scale[..., :d] = np.abs(mu).max(axis=-1, initial=0.0, keepdims=True)
    momenta, adjoint, *rest = _split(flow(rate, start, instants, scale), blocks)
    return EulerPoincareMotion(
        algebra=algebra,
        inertia=operator,
        times=instants,
        momentum=momenta,
        velocity=linear_solution(operator, momenta),
        adjoint=adjoint,
        attitude=rest[0] if rest else None,
    )


def _joined(momentum: Array, elements: list[Matrices]) -> Array:
    """One real vector: the momentum, then the entries of each group element, real parts before imaginary ones."""
    parts = [momentum]
    for g in elements:
        flat = g.reshape(*g.shape[:-2], -1)
        parts += [np.real(flat), np.imag(flat)] if np.iscomplexobj(g) else [flat]
    return np.concatenate(parts, axis=-1)


def _split(state: Array, blocks: list[Matrices]) -> list[Matrices]:
    """The inverse of `_joined`: the momentum, then one matrix for each set of generators."""
    at = len(blocks[0])
    parts: list[Matrices] = [state[..., :at]]
    for block in blocks:
        n = block.shape[-1]
        entries = [state[..., at + i * n * n : at + (i + 1) * n * n] for i in range(2 if np.iscomplexobj(block) else 1)]
        at += len(entries) * n * n
        whole = entries[0] if len(entries) == 1 else entries[0] + 1j * entries[1]
        parts.append(whole.reshape(*state.shape[:-1], n, n))
    return parts


@dataclass(frozen=True, eq=False)
class InvariableHyperplane:
    """Affine hyperplane {x : <normal, x> = level} of the algebra. Made by `invariable_hyperplane`."""

    normal: Array
    """(..., d) covector, the space momentum mu_s."""
    level: Array
    """(...) twice the energy."""

    __repr__ = short_repr

    def offset(self, point: ArrayLike) -> Array:
        """<mu_s, x> - 2 E_0, zero on the hyperplane: (..., N, d) -> (..., N)."""
        points = finite_array(point, "point", (self.normal.shape[-1],))
        return np.sum(self.normal[..., None, :] * points, axis=-1) - self.level[..., None]


@dataclass(frozen=True, eq=False)
class RollingContact:
    """Contact of the energy quadric with the invariable hyperplane along a motion, and its rolling there.

    Made by `rolling_contact`.
    """

    hyperplane: InvariableHyperplane
    """The invariable hyperplane."""
    point: Array
    """(..., N, d) point of contact in space, xi_s."""
    hyperplane_offset: Array
    """(..., N) of the point from the hyperplane; zero, part (a) of the theorem."""
    quadric_offset: Array
    """(..., N) l(Ad_{g^-1} xi_s) - E_0, of the point from the moved quadric; zero, part (b)."""
    tangency_defect: Array
    """(..., N, d) conormal of the moved quadric at the point less that of the hyperplane; zero, (b)."""
    contact_velocity: Array
    """(..., N, d) velocity of the point of the moved quadric that touches; zero, part (c)."""
    body_rate: Array
    """(..., N, d) xi', the rate of the contact along the quadric, body components."""
    space_rate: Array
    """(..., N, d) Ad_g xi', its rate along the hyperplane; equal rates are equal lengths of the two curves."""

    __repr__ = short_repr


def invariable_hyperplane(algebra: LieAlgebra, inertia: ArrayLike, momentum: ArrayLike) -> InvariableHyperplane:
    """The hyperplane on which the energy quadric rolls, from the momentum at the identity: (..., d).

    Raises ShapeError, LieAlgebraError if the shapes or the operator are not right, or the momentum is zero: then there
    is no plane.

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> plane = lie.invariable_hyperplane(lie.so3(), np.diag([1.0, 2.0, 4.0]), [0.0, 0.0, 2.0])
    >>> plane.normal.tolist(), plane.level.item()
    ([0.0, 0.0, 2.0], 1.0)
    """
    operator = inertia_operator(algebra, inertia)
    mu = finite_array(momentum, "momentum", (algebra.dimension,))
    if not np.all(np.abs(mu).max(axis=-1) > 0.0):
        raise LieAlgebraError(
            "momentum: a body at rest has no invariable hyperplane; a momentum other than 0 is needed"
        )
    return InvariableHyperplane(normal=mu, level=np.sum(mu * linear_solution(operator, mu), axis=-1))


def contact_conormal(inertia: ArrayLike, adjoint: ArrayLike, point: ArrayLike) -> Array:
    """The differential of l o Ad_{g^-1} at a point, the conormal of the moved energy quadric: (..., d) -> (..., d).

    Parameters
    ----------
    inertia : (d, d) symmetric operator
    adjoint : (..., d, d) Ad_g
    point : (..., d) in space

    Examples
    --------
    >>> sp.rigid_body.lie.contact_conormal(np.diag([1.0, 2.0, 4.0]), np.eye(3), [1.0, 1.0, 1.0]).tolist()
    [1.0, 2.0, 4.0]
    """
    points = finite_array(point, "point", (None,))
    d = points.shape[-1]
    operator, ad = finite_array(inertia, "inertia", (d, d)), finite_array(adjoint, "adjoint", (d, d))
    body = linear_solution(ad, points) @ operator
    return linear_solution(np.swapaxes(ad, -1, -2), body)


def contact_velocity(algebra: LieAlgebra, adjoint: ArrayLike, velocity: ArrayLike, body_point: ArrayLike) -> Array:
    """The velocity in space of a point fixed in the body's algebra, d/dt Ad_g eta = Ad_g [xi, eta]: -> (..., d).

    Parameters
    ----------
    adjoint : (..., d, d) Ad_g
    velocity : (..., d) body velocity xi
    body_point : (..., d) eta; at the contact it is xi, and the velocity is zero

    Examples
    --------
    >>> x, y, z = np.eye(3)
    >>> sp.rigid_body.lie.contact_velocity(sp.rigid_body.lie.so3(), np.eye(3), z, x).tolist()  # z x x
    [0.0, 1.0, 0.0]
    """
    check_object(algebra, "LieAlgebra", "algebra")
    ad = finite_array(adjoint, "adjoint", (algebra.dimension, algebra.dimension))
    return np.einsum("...ij,...j->...i", ad, algebra.bracket(velocity, body_point))


def rolling_contact(motion: EulerPoincareMotion) -> RollingContact:
    """The contact of energy quadric and invariable hyperplane along a motion, with the residuals of the theorem.

    Raises LieAlgebraError for a body at rest.

    Examples
    --------
    >>> from shapephase.rigid_body import lie
    >>> motion = lie.euler_poincare_motion(lie.so3(), np.diag([1.0, 2.0, 4.0]), [0.3, 0.4, 1.2], [0.0, 1.0])
    >>> contact = lie.rolling_contact(motion)
    >>> np.abs(contact.contact_velocity).max().round(9).item()  # it rolls
    0.0
    """
    check_object(motion, "EulerPoincareMotion", "motion")
    algebra, inertia = motion.algebra, motion.inertia
    hyperplane = invariable_hyperplane(algebra, inertia, motion.momentum[..., 0, :])
    point = motion.space_velocity
    body_point = linear_solution(motion.adjoint, point)
    body_rate = linear_solution(inertia, euler_poincare_rate(algebra, inertia, motion.momentum))
    energy = 0.5 * np.einsum("...i,ij,...j->...", body_point, inertia, body_point)
    return RollingContact(
        hyperplane=hyperplane,
        point=point,
        hyperplane_offset=hyperplane.offset(point),
        quadric_offset=energy - 0.5 * hyperplane.level[..., None],
        tangency_defect=contact_conormal(inertia, motion.adjoint, point) - hyperplane.normal[..., None, :],
        contact_velocity=contact_velocity(algebra, motion.adjoint, motion.velocity, body_point),
        body_rate=body_rate,
        space_rate=np.einsum("...ij,...j->...i", motion.adjoint, body_rate),
    )
