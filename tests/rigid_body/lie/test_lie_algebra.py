"""Lie algebras, the Euler-Poincare equations and Poinsot's theorem on them, against laws and other representations."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

from shapephase import so3 as rotations
from shapephase.errors import AccuracyNotReached, LieAlgebraError, ShapeError, ShapePhaseError, SingularInertiaError
from shapephase.inertia_tensor import second_moment
from shapephase.rigid_body.lie import (
    LieAlgebra,
    adjoint_action,
    body_momentum,
    body_velocity,
    coadjoint_action,
    contact_conormal,
    contact_velocity,
    euler_poincare_motion,
    euler_poincare_rate,
    group_exponential,
    hamiltonian_vector_field,
    heisenberg,
    invariable_hyperplane,
    lie_algebra_from_matrices,
    lie_poisson_bracket,
    manakov_integrals,
    momentum_traces,
    n_dimensional_angular_velocity,
    n_dimensional_inertia,
    n_dimensional_momentum,
    n_dimensional_rate,
    pfaffian,
    reduce_translations,
    rolling_contact,
    se2,
    se3,
    se3_inertia,
    sl2r,
    so,
    so3,
    space_momentum,
    space_velocity,
    su2,
)
from support.independent import assert_within, rigid_motion

ALGEBRAS = [so3(), so(2), so(4), so(5), sl2r(), se2(), se3(), su2(), heisenberg()]
each_algebra = pytest.mark.parametrize("algebra", ALGEBRAS, ids=lambda a: a.name)
# The algebras on which the generalised theorem of Poinsot is followed in time.
rolling_algebra = pytest.mark.parametrize("algebra", [so3(), se3(), so(4), sl2r(), su2()], ids=lambda a: a.name)


def inertia_of(algebra, rng):
    root = rng.normal(size=(algebra.dimension,) * 2)
    return root @ root.T + np.eye(algebra.dimension)


def commutator(a, b):
    return a @ b - b @ a


# The algebra


@each_algebra
def test_bracket_is_the_commutator_of_matrices(algebra, rng):
    a, b = rng.normal(size=(2, 4, algebra.dimension))
    expected = commutator(algebra.matrix(a), algebra.matrix(b))
    assert_within(algebra.matrix(algebra.bracket(a, b)), expected, 1e-14)
    assert_within(algebra.coordinates(expected), algebra.bracket(a, b), 1e-13)
    assert_within(algebra.ad(a) @ b[..., None], algebra.bracket(a, b)[..., None], 1e-14)


@each_algebra
def test_laws_of_the_algebra_are_exact_in_whole_numbers(algebra):
    c = algebra.structure.astype(int)
    assert np.array_equal(c, algebra.structure)
    assert np.array_equal(c, -c.transpose(1, 0, 2))
    double = np.einsum("ijs,skm->ijkm", c, c)
    assert not (double + double.transpose(1, 2, 0, 3) + double.transpose(2, 0, 1, 3)).any()


@each_algebra
def test_coad_is_the_dual_of_ad(algebra, rng):
    a, b, mu = rng.normal(size=(3, 5, algebra.dimension))
    assert_within(np.sum(algebra.coad(a, mu) * b, axis=-1), np.sum(mu * algebra.bracket(a, b), axis=-1), 1e-13)


def test_so3_is_the_cross_product_and_coad_gives_pi_cross_omega(rng):
    a, b = rng.normal(size=(2, 6, 3))
    for algebra in (so3(), so(3), su2()):
        assert_within(algebra.bracket(a, b), np.cross(a, b), 1e-15)
        assert_within(algebra.coad(a, b), np.cross(b, a), 1e-15)
    np.testing.assert_array_equal(so3().matrix(a), rotations.hat(a))


@pytest.mark.parametrize("n", [3, 4, 5])
def test_killing_form_of_so_n_is_the_known_multiple_of_the_trace(n, rng):
    # B(A, B) = (n - 2) tr(AB), an identity of so(n).
    algebra = so(n)
    a, b = rng.normal(size=(2, algebra.dimension))
    known = (n - 2) * np.trace(algebra.matrix(a) @ algebra.matrix(b))
    assert a @ algebra.killing_form @ b == pytest.approx(known, rel=1e-14)


def test_killing_form_of_sl2r_and_of_the_others():
    # 4 tr(AB) on sl(2, R); zero on a nilpotent algebra; degenerate on a semidirect product.
    expected = [[8.0, 0.0, 0.0], [0.0, 0.0, 4.0], [0.0, 4.0, 0.0]]
    np.testing.assert_array_equal(sl2r().killing_form, expected)
    np.testing.assert_array_equal(heisenberg().killing_form, 0.0)
    assert np.linalg.matrix_rank(se3().killing_form) == 3
    np.testing.assert_array_equal(so3().killing_form, -2.0 * np.eye(3))
    # The affine group of the line is the smallest algebra that is not unimodular.
    affine = np.zeros((2, 2, 2))
    affine[0, 1, 1], affine[1, 0, 1] = 1.0, -1.0
    assert not LieAlgebra(affine).is_unimodular
    assert all(algebra.is_unimodular for algebra in ALGEBRAS)


def test_se3_dual_carries_the_heavy_top_bracket_m2(rng):
    # {F, G} = -Pi.(F_Pi x G_Pi) - Gamma.(F_Pi x G_Gamma - G_Pi x F_Gamma), and with it the heavy top's equations.
    pi, gamma, f_pi, f_gamma, g_pi, g_gamma = rng.normal(size=(6, 20, 3))
    known = -np.sum(pi * np.cross(f_pi, g_pi), -1)
    known -= np.sum(gamma * (np.cross(f_pi, g_gamma) - np.cross(g_pi, f_gamma)), -1)
    mu, df, dg = (np.concatenate(x, axis=-1) for x in ((pi, gamma), (f_pi, f_gamma), (g_pi, g_gamma)))
    assert_within(lie_poisson_bracket(df, dg, mu, se3()), known, 1e-13)
    moments, weight, chi = np.array([1.0, 2.0, 2.7]), 1.3, np.array([0.0, 0.6, 0.8])
    gradient = np.concatenate([pi / moments, np.broadcast_to(weight * chi, pi.shape)], axis=-1)
    top = np.concatenate(
        [np.cross(pi, pi / moments) + weight * np.cross(gamma, chi), np.cross(gamma, pi / moments)], axis=-1
    )
    assert_within(hamiltonian_vector_field(gradient, mu, se3()), top, 1e-13)


def test_commutators_have_the_opposite_sign_to_the_printed_ones_b_e2():
    one, two, three = so3().matrix_basis
    printed = ((one, two, -three), (one, three, two), (two, three, -one))
    for a, b, said in printed:
        assert np.abs(commutator(a, b) - said).max() == 2.0
        np.testing.assert_array_equal(commutator(a, b), -said)
    # With them Euler's equations come out right only because the bracket's sign is chosen wrong as well.
    pi, moments = np.array([0.3, -1.1, 0.7]), np.array([1.0, 2.0, 3.0])
    euler = [(1 / moments[k] - 1 / moments[j]) * pi[j] * pi[k] for j, k in ((1, 2), (2, 0), (0, 1))]
    assert_within(euler_poincare_rate(so3(), np.diag(moments), pi), euler, 1e-15)
    flipped = LieAlgebra(-so3().structure)
    assert_within(euler_poincare_rate(flipped, np.diag(moments), pi), np.negative(euler), 1e-15)


def test_any_basis_of_matrices_gives_its_algebra(rng):
    mixing = rng.normal(size=(3, 3))
    for algebra in (so3(), sl2r(), su2()):
        other = lie_algebra_from_matrices(np.einsum("ij,jab->iab", mixing, algebra.matrix_basis))
        # A change of basis is a congruence of the Killing form.
        assert_within(other.killing_form, mixing @ algebra.killing_form @ mixing.T, 1e-11)
    with pytest.raises(LieAlgebraError, match="independent"):
        lie_algebra_from_matrices([np.eye(2), 2.0 * np.eye(2)])
    with pytest.raises(LieAlgebraError, match="closed"):
        lie_algebra_from_matrices([[[0, 1], [0, 0]], [[0, 0], [1, 0]]])


def test_numbers_that_are_no_lie_algebra_are_refused():
    crossed = np.array(so3().structure)
    crossed[0, 1, 2] += 1e-9
    with pytest.raises(LieAlgebraError, match="antisymmetric"):
        LieAlgebra(crossed)
    bent = np.zeros((3, 3, 3))
    bent[0, 1, 0], bent[1, 2, 0], bent[2, 0, 1] = 1.0, 1.0, 1.0
    with pytest.raises(LieAlgebraError, match="Jacobi"):
        LieAlgebra(bent - bent.swapaxes(0, 1))
    with pytest.raises(LieAlgebraError, match="basis"):
        LieAlgebra(so3().structure, -so3().matrix_basis)
    with pytest.raises(ShapeError, match="square"):
        LieAlgebra(so3().structure, np.ones((3, 2, 3)))
    for wrong in (np.zeros((2, 3, 3)), np.zeros(3), np.full((3, 3, 3), np.nan), "so3", np.zeros((0, 0, 0))):
        with pytest.raises(ShapeError):
            LieAlgebra(wrong)
    for n in (1, 2.5, True, "3"):
        with pytest.raises(LieAlgebraError, match="whole"):
            so(n)
    masked = np.ma.masked_array(so3().matrix_basis, mask=np.zeros((3, 3, 3)) == 0)
    with pytest.raises(ShapeError, match="masked"):
        lie_algebra_from_matrices(masked)
    with pytest.raises(ShapeError, match="rectangular"):
        lie_algebra_from_matrices([[[1.0, 2.0], [3.0]]])
    assert issubclass(LieAlgebraError, ShapePhaseError)
    assert issubclass(LieAlgebraError, ValueError)


def test_what_is_not_of_the_algebra_is_refused():
    algebra = so3()
    with pytest.raises(LieAlgebraError, match="element"):
        algebra.coordinates(np.eye(3))
    with pytest.raises(LieAlgebraError, match="structure"):
        LieAlgebra(algebra.structure).matrix([1.0, 0.0, 0.0])
    with pytest.raises(ShapeError, match="matrix"):
        algebra.coordinates(np.eye(4))
    with pytest.raises(ShapeError):
        algebra.bracket([1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="read-only"):
        algebra.structure[0, 1, 2] = 5.0


# Kinematics on the group


@each_algebra
def test_body_and_space_trivialisations_g5(algebra, rng):
    g = group_exponential(algebra, 0.7 * rng.normal(size=(4, algebra.dimension)))
    assert_within(g[0], expm(algebra.matrix(algebra.coordinates(logm(g[0])))), 1e-10)
    a = rng.normal(size=(4, algebra.dimension))
    moved = g @ algebra.matrix(a)
    assert_within(body_velocity(algebra, g, moved), a, 1e-12)
    # (15.4.6): V^S = Ad_g V^B.
    in_space = space_velocity(algebra, g, moved)
    assert_within((adjoint_action(algebra, g) @ a[..., None])[..., 0], in_space, 1e-12)
    assert_within(algebra.matrix(in_space) @ g, moved, 1e-12)
    # (15.4.5): alpha^S = Ad*_{g^-1} alpha^B, and both pair with velocities as alpha does with V.
    alpha = rng.normal(size=g.shape) + (1j * rng.normal(size=g.shape) if np.iscomplexobj(g) else 0.0)
    body, space = body_momentum(algebra, g, alpha), space_momentum(algebra, g, alpha)
    assert_within((coadjoint_action(algebra, g) @ body[..., None])[..., 0], space, 1e-11)
    value = np.sum(alpha.conj() * moved, axis=(-1, -2)).real
    assert_within(np.sum(body * a, axis=-1), value, 1e-12)
    assert_within(np.sum(space * in_space, axis=-1), value, 1e-11)


@each_algebra
def test_adjoint_action_is_a_homomorphism_with_ad_as_its_rate(algebra, rng):
    a, b, x = 0.5 * rng.normal(size=(3, algebra.dimension))
    g, h = group_exponential(algebra, a), group_exponential(algebra, b)
    assert_within(adjoint_action(algebra, g @ h), adjoint_action(algebra, g) @ adjoint_action(algebra, h), 1e-12)
    assert_within(adjoint_action(algebra, g), expm(algebra.ad(a)), 1e-12)
    turned = adjoint_action(algebra, g)
    assert_within(algebra.bracket(turned @ b, turned @ x), turned @ algebra.bracket(b, x), 1e-12)
    assert_within(coadjoint_action(algebra, g), np.linalg.inv(turned).T, 1e-12)


def test_spatial_momentum_of_so3_is_the_turned_one_g5(rng):
    rotation = rotations.exp(rng.normal(size=3))
    # Sums of products of two entries of a rotation, known to a unit or two of rounding each.
    rounding = 8.0 * np.finfo(float).eps
    assert_within(adjoint_action(so3(), rotation), rotation, rounding)
    assert_within(coadjoint_action(so3(), rotation), rotation, rounding)


def test_what_is_not_of_the_group_is_refused():
    with pytest.raises(LieAlgebraError, match="singular"):
        adjoint_action(so3(), np.zeros((3, 3)))
    with pytest.raises(LieAlgebraError, match="element"):
        adjoint_action(so3(), np.diag([1.0, 2.0, 3.0]))
    with pytest.raises(LieAlgebraError, match="element"):
        body_velocity(so3(), np.eye(3), np.eye(3))
    with pytest.raises(ShapeError, match="complex"):
        adjoint_action(so3(), 1j * np.eye(3))
    with pytest.raises(ShapeError):
        adjoint_action(so3(), np.eye(4))


# The Euler-Poincare equations


def test_euler_poincare_on_so3_is_the_free_rigid_body_g7():
    moments, pi, times = np.array([3.0, 2.0, 1.0]), np.array([0.4, 1.5, -0.7]), np.linspace(0.0, 10.0, 21)
    momentum, attitude = rigid_motion(np.diag(moments), pi, times)
    motion = euler_poincare_motion(so3(), np.diag(moments), pi, times)
    assert_within(motion.momentum, momentum, 1e-11)
    assert_within(motion.attitude, attitude, 1e-11)
    assert_within(motion.adjoint, motion.attitude, 1e-13)
    # The same motion on the double cover.
    covered = euler_poincare_motion(su2(), np.diag(moments), pi, times)
    assert_within(covered.momentum, momentum, 1e-11)
    assert_within(adjoint_action(su2(), covered.attitude), attitude, 1e-11)


def test_a_batch_and_a_later_start_give_the_same_motions_g7(rng):
    inertia, momenta = inertia_of(so3(), rng), rng.normal(size=(2, 2, 3))
    motion = euler_poincare_motion(so3(), inertia, momenta, np.linspace(1.0, 4.0, 4))
    assert motion.momentum.shape == (2, 2, 4, 3)
    assert motion.attitude.shape == (2, 2, 4, 3, 3)
    for i, j in np.ndindex(2, 2):
        alone = euler_poincare_motion(so3(), inertia, momenta[i, j], np.linspace(0.0, 3.0, 4))
        assert_within(motion.momentum[i, j], alone.momentum, 1e-13)
        assert_within(motion.attitude[i, j], alone.attitude, 1e-13)


@each_algebra
def test_energy_and_space_momentum_are_constant_and_attitude_follows_g7(algebra, rng):
    motion = euler_poincare_motion(algebra, inertia_of(algebra, rng), rng.normal(size=algebra.dimension), [0, 0.7, 2.0])
    np.testing.assert_allclose(motion.energy, motion.energy[0], rtol=3e-13)
    assert_within(motion.space_momentum, np.broadcast_to(motion.momentum[0], (3, algebra.dimension)), 1e-12)
    assert_within(adjoint_action(algebra, motion.attitude), motion.adjoint, 1e-12)
    # The same constants through the group's matrices.
    by_matrices = np.einsum("nij,nj->ni", coadjoint_action(algebra, motion.attitude), motion.momentum)
    assert_within(by_matrices, np.broadcast_to(motion.momentum[0], by_matrices.shape), 1e-12)


def test_on_se3_the_centre_of_mass_moves_straight_and_the_rest_turns_as_on_so3_g7(rng):
    masses, positions = rng.uniform(0.5, 2.0, 6), rng.normal(size=(6, 3))
    twist, times = np.array([0.8, -0.3, 1.1, 0.2, 0.5, -0.4]), np.linspace(0.0, 6.0, 13)
    operator = se3_inertia(masses, positions)
    body = reduce_translations(masses, positions)
    motion = euler_poincare_motion(se3(), operator, operator @ twist, times)
    rotation, origin = motion.attitude[:, :3, :3], motion.attitude[:, :3, 3]
    start = twist[3:] + np.cross(twist[:3], body.centre)
    assert_within(origin + rotation @ body.centre, body.centre + times[:, None] * start, 1e-11)
    alone = euler_poincare_motion(so3(), body.inertia, body.inertia @ twist[:3], times)
    assert_within(rotation, alone.attitude, 1e-11)
    assert_within(body.momentum(motion.momentum), alone.momentum, 1e-11)


def test_structure_constants_alone_are_enough_g7(rng):
    known = sl2r()
    abstract, inertia, mu = LieAlgebra(known.structure), inertia_of(known, rng), rng.normal(size=3)
    motion = euler_poincare_motion(abstract, inertia, mu, [0.0, 1.0, 2.0])
    assert motion.attitude is None
    with_matrices = euler_poincare_motion(known, inertia, mu, [0.0, 1.0, 2.0])
    assert_within(motion.adjoint, with_matrices.adjoint, 1e-12)
    assert_within(np.linalg.det(with_matrices.attitude), 1.0, 1e-12)


def test_motions_that_run_away_and_wrong_operators_are_refused():
    # On the affine group of the line y' = y^2: infinite at t = 1.
    affine = np.zeros((2, 2, 2))
    affine[0, 1, 1], affine[1, 0, 1] = 1.0, -1.0
    algebra = LieAlgebra(affine)
    indefinite = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert euler_poincare_motion(algebra, indefinite, [0.0, 1.0], [0.0, 0.9]).momentum[-1, 1] == pytest.approx(10.0)
    with pytest.raises(AccuracyNotReached, match="followed"):
        euler_poincare_motion(algebra, indefinite, [0.0, 1.0], [0.0, 2.0])
    for wrong, match in ((np.diag([1.0, 0.0, 1.0]), "singular"), (np.triu(np.ones((3, 3))), "symmetric")):
        with pytest.raises(LieAlgebraError, match=match):
            euler_poincare_rate(so3(), wrong, [1.0, 0.0, 0.0])
    with pytest.raises(ShapeError, match="one"):
        euler_poincare_rate(so3(), np.ones((2, 3, 3)), [1.0, 0.0, 0.0])
    for times in ([1.0, 0.0], [], [0.0, np.nan], 3.0):
        with pytest.raises(ShapeError):
            euler_poincare_motion(so3(), np.eye(3), [1.0, 0.0, 0.0], times)


# The rigid body in n dimensions


def test_three_dimensional_case_is_the_usual_inertia_g7(rng):
    inertia = inertia_of(so3(), rng)
    j = second_moment(inertia)
    j += (1.0 - np.linalg.eigvalsh(j)[0]) * np.eye(3)
    assert_within(n_dimensional_inertia(j), np.trace(j) * np.eye(3) - j, 1e-13)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_n_dimensional_rigid_body_keeps_all_its_integrals_g7(n, rng):
    root = rng.normal(size=(n, n)) / n
    j, algebra = root @ root.T + 0.5 * np.eye(n), so(n)
    m = algebra.matrix(rng.normal(size=algebra.dimension))
    omega = n_dimensional_angular_velocity(j, m)
    assert_within(omega @ j + j @ omega, m, 1e-13)
    assert_within(n_dimensional_momentum(j, omega), m, 1e-13)
    assert_within(n_dimensional_rate(j, m), commutator(m, omega), 1e-13)
    by_algebra = euler_poincare_rate(algebra, n_dimensional_inertia(j), algebra.coordinates(m))
    assert_within(algebra.matrix(by_algebra), commutator(m, omega), 1e-12)
    times = [0.0, 1.0, 3.0]
    motion = euler_poincare_motion(algebra, n_dimensional_inertia(j), algebra.coordinates(m), times)
    raw = solve_ivp(
        lambda _, y: n_dimensional_rate(j, y.reshape(n, n)).ravel(),
        (0, 3),
        m.ravel(),
        "DOP853",
        times,
        rtol=1e-13,
        atol=1e-14,
    )
    matrices = algebra.matrix(motion.momentum)
    assert_within(matrices, raw.y.T.reshape(-1, n, n), 1e-10)
    for constants in (momentum_traces(matrices), *(manakov_integrals(j, matrices, k) for k in range(1, n + 1))):
        np.testing.assert_allclose(constants, np.broadcast_to(constants[0], constants.shape), rtol=1e-11, atol=1e-10)
    # The space momentum R M R^T, through the attitude.
    in_space = motion.attitude @ matrices @ np.swapaxes(motion.attitude, -1, -2)
    assert_within(in_space, np.broadcast_to(m, in_space.shape), 1e-11)


def test_manakov_coefficients_are_the_traces_g7(rng):
    root = rng.normal(size=(4, 4))
    j, m = root @ root.T, so(4).matrix(rng.normal(size=(3, 6)))
    for power, shift in product((1, 2, 3, 5), (-0.7, 0.0, 1.3)):
        traces = np.trace(np.linalg.matrix_power(m + shift * j @ j, power), axis1=-2, axis2=-1)
        values = manakov_integrals(j, m, power) @ shift ** np.arange(power + 1)
        np.testing.assert_allclose(values, traces, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(momentum_traces(m)[:, 1], np.trace(m @ m @ m @ m, axis1=-2, axis2=-1), rtol=1e-13)


def test_manakov_is_conserved_only_with_the_square_of_j_g7(rng):
    # d/dt tr (M + lambda S)^3 at lambda^1 is 3 tr([M, Omega] (M S + S M)): zero for S = J^2, not for S = J.
    j, m = np.diag([1.0, 2.0, 3.5, 5.0]), so(4).matrix(5.0 * rng.normal(size=6))
    rate = n_dimensional_rate(j, m)
    assert abs(np.trace(rate @ (m @ j @ j + j @ j @ m))) < 1e-10
    assert abs(np.trace(rate @ (m @ j + j @ m))) > 0.1


def test_pfaffian_squares_to_the_determinant_and_is_constant_g7(rng):
    for n in (2, 4, 6, 8):
        m = so(n).matrix(rng.normal(size=(5, n * (n - 1) // 2)))
        np.testing.assert_allclose(pfaffian(m) ** 2, np.linalg.det(m), rtol=1e-10)
        # pf(B M B^T) = det(B) pf(M) fixes the sign.
        b = rng.normal(size=(n, n))
        np.testing.assert_allclose(pfaffian(b @ m @ b.T), np.linalg.det(b) * pfaffian(m), rtol=1e-9)
    m = so(4).matrix(rng.normal(size=6))
    assert pfaffian(m) == pytest.approx(m[0, 1] * m[2, 3] - m[0, 2] * m[1, 3] + m[0, 3] * m[1, 2], rel=1e-14)
    motion = euler_poincare_motion(
        so(4), n_dimensional_inertia(np.diag([1.0, 2, 3, 4])), so(4).coordinates(m), [0, 1, 4]
    )
    np.testing.assert_allclose(pfaffian(so(4).matrix(motion.momentum)), pfaffian(m), rtol=1e-11)


def test_wrong_n_dimensional_bodies_are_refused():
    for error, word, call in (
        (ShapeError, "even", lambda: pfaffian(np.zeros((3, 3)))),
        (ShapeError, "antisymmetric", lambda: momentum_traces(np.eye(3))),
        (ShapeError, "symmetric", lambda: n_dimensional_inertia(np.triu(np.ones((3, 3))))),
        (SingularInertiaError, "inertia", lambda: n_dimensional_inertia(np.diag([1.0, 0.0, 0.0]))),
        (ShapeError, "whole", lambda: manakov_integrals(np.eye(3), np.zeros((3, 3)), 0)),
    ):
        with pytest.raises(error, match=word):
            call()
    with pytest.raises(ShapeError):
        n_dimensional_rate(np.eye(3), np.zeros((4, 4)))


# Poinsot's theorem on any Lie algebra


def rolling(algebra, rng, nodes=41, duration=1.5):
    """A motion at Chebyshev's points of [0, duration]."""
    inertia = inertia_of(algebra, rng)
    times = 0.5 * duration * (1.0 - np.cos(np.pi * np.arange(nodes) / (nodes - 1)))
    return euler_poincare_motion(algebra, inertia, rng.normal(size=algebra.dimension), times)


@rolling_algebra
def test_spatial_velocity_stays_in_the_invariable_hyperplane_i6(algebra, rng):
    motion = rolling(algebra, rng)
    # xi_s through the group's matrices, and the plane through xi(0) with the conormal mu(0), by hand.
    g = motion.attitude
    in_space = algebra.coordinates(g @ algebra.matrix(motion.velocity) @ np.linalg.inv(g))
    offsets = (in_space - motion.velocity[0]) @ motion.momentum[0]
    assert_within(offsets, 0.0, 1e-11)
    contact = rolling_contact(motion)
    assert_within(contact.point, in_space, 1e-11)
    assert_within(contact.hyperplane_offset, offsets, 1e-11)
    assert np.abs(in_space - in_space[0]).max() > 0.01


@rolling_algebra
def test_moved_energy_quadric_is_tangent_to_the_hyperplane_there_i6(algebra, rng):
    motion = rolling(algebra, rng)
    contact = rolling_contact(motion)
    assert_within(contact.quadric_offset, 0.0, 1e-11)
    assert_within(contact.tangency_defect, 0.0, 1e-11)
    # By hand: along every direction v of the plane the energy starts without a linear term.
    normal = contact.hyperplane.normal
    v = rng.normal(size=(6, algebra.dimension))
    v -= np.outer(v @ normal / (normal @ normal), normal)
    for i in (0, 7, 20, 40):
        back = np.linalg.inv(adjoint_action(algebra, motion.attitude[i]))

        def energy(x, back=back):
            return 0.5 * np.einsum("...i,ij,...j->...", x @ back.T, motion.inertia, x @ back.T)

        linear = energy(contact.point[i] + v) - energy(contact.point[i] - v)
        assert_within(linear, 0.0, 1e-10)
        assert energy(contact.point[i]) == pytest.approx(motion.energy[0], rel=1e-11)


@rolling_algebra
def test_the_energy_quadric_rolls_without_slipping_i6(algebra, rng):
    motion = rolling(algebra, rng)
    contact = rolling_contact(motion)
    assert_within(contact.contact_velocity, 0.0, 1e-12)
    # By hand: the rate of Ad_g(t) eta, eta the body's point that touches at a node, by Chebyshev's differentiation.
    slope = chebyshev_slope(motion.times)
    for i in (6, 20, 33):
        carried = motion.adjoint @ motion.velocity[i]
        assert_within(slope[i] @ carried, 0.0, 1e-9)
        other = motion.velocity[i] + np.eye(algebra.dimension)[0]
        moving = slope[i] @ (motion.adjoint @ other)
        assert_within(moving, contact_velocity(algebra, motion.adjoint[i], motion.velocity[i], other), 1e-9)
        assert np.abs(moving).max() > 1e-3
    # The contact runs along quadric and plane alike: the two rates are one vector, seen from the body and from space.
    assert_within(slope @ motion.velocity, contact.body_rate, 1e-9)
    assert_within(slope @ contact.point, contact.space_rate, 1e-9)


def chebyshev_slope(times):
    """The differentiation matrix at Chebyshev's points (Trefethen 2000, chapter 6)."""
    n = len(times)
    weight = np.r_[2.0, np.ones(n - 2), 2.0] * (-1.0) ** np.arange(n)
    matrix = np.outer(weight, 1.0 / weight) / (times[:, None] - times + np.eye(n))
    return matrix - np.diag(matrix.sum(axis=1))


def test_rolling_in_so3_is_poinsots_theorem_i6(rng):
    motion = rolling(so3(), rng)
    contact = rolling_contact(motion)
    plane = contact.hyperplane
    # Distance 2K/|pi| from the origin, and equal arc lengths on ellipsoid and plane.
    assert plane.level / np.linalg.norm(plane.normal) == pytest.approx(
        2 * motion.energy[0] / np.linalg.norm(motion.momentum[0])
    )
    np.testing.assert_allclose(
        np.linalg.norm(contact.body_rate, axis=-1), np.linalg.norm(contact.space_rate, axis=-1), rtol=1e-12
    )
    rotation = motion.attitude[9]
    conormal = contact_conormal(motion.inertia, rotation, contact.point[9])
    assert_within(conormal, rotation @ motion.inertia @ rotation.T @ contact.point[9], 1e-12)


def test_rolling_holds_for_an_indefinite_operator_and_a_batch_i6(rng):
    algebra = sl2r()
    inertia = np.diag([1.0, -2.0, 0.7])
    motion = euler_poincare_motion(algebra, inertia, 0.3 * rng.normal(size=(4, 3)), [0.0, 0.3, 0.6])
    contact = rolling_contact(motion)
    assert contact.point.shape == (4, 3, 3)
    for defect in (
        contact.hyperplane_offset,
        contact.quadric_offset,
        contact.tangency_defect,
        contact.contact_velocity,
    ):
        assert_within(defect, 0.0, 1e-12)
    with pytest.raises(LieAlgebraError, match="rest"):
        invariable_hyperplane(algebra, inertia, np.zeros((2, 3)))
