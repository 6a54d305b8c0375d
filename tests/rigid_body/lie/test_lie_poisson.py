"""Lie-Poisson brackets in exact arithmetic and along motions; the Lagrangian from particles; the book's exercises."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shapephase import so3 as rotations
from shapephase.errors import AccuracyNotReached, ShapeError, SingularInertiaError
from shapephase.rigid_body.lie import (
    angular_velocity,
    body_angular_velocity,
    bracket_gradient,
    casimir_defect,
    cayley_klein_attitude,
    cayley_klein_bracket,
    cayley_klein_equations,
    cayley_klein_gradient,
    cayley_klein_hamiltonian,
    cayley_klein_momentum,
    cayley_klein_motion,
    cayley_klein_spinor,
    coadjoint_orbit_form,
    convective_lagrangian,
    convective_velocity,
    dissipated_power,
    double_bracket_equations,
    double_bracket_motion,
    euler_equations,
    hamiltonian_vector_field,
    heisenberg,
    kinetic_energy,
    legendre_transform,
    lie_poisson_bracket,
    lie_poisson_motion,
    linear_casimirs,
    magnetic_equilibria,
    magnetic_hamiltonian,
    magnetic_precession,
    magnetic_precession_rate,
    mass_inertia,
    mass_inner_product,
    material_lagrangian,
    material_velocity,
    poisson_tensor,
    quadratic_casimirs,
    reduce_translations,
    se2,
    se3,
    se3_inertia,
    sl2r,
    so,
    so3,
    spatial_angular_velocity,
    spatial_lagrangian,
    spatial_momentum,
    spatial_velocity,
    sphere_area_form,
    sphere_symplectic_form,
    su2,
    symmetric_bracket,
)
from support.independent import assert_within, cross, rigid_motion

ALGEBRAS = [so3(), so(4), sl2r(), se2(), se3(), su2(), heisenberg()]
each_algebra = pytest.mark.parametrize("algebra", ALGEBRAS, ids=lambda a: a.name)
INERTIA = np.array([[2.0, 0.3, -0.1], [0.3, 3.1, 0.2], [-0.1, 0.2, 1.4]])


class Polynomial:
    """A polynomial with rational coefficients, {exponents: coefficient}; just what brackets need."""

    def __init__(self, terms):
        self.terms = {e: c for e, c in terms.items() if c}

    def __add__(self, other):
        terms = dict(self.terms)
        for e, c in other.terms.items():
            terms[e] = terms.get(e, 0) + c
        return Polynomial(terms)

    def __mul__(self, other):
        terms = {}
        for (e, c), (f, b) in product(self.terms.items(), other.terms.items()):
            both = tuple(i + j for i, j in zip(e, f))
            terms[both] = terms.get(both, 0) + c * b
        return Polynomial(terms)

    def slope(self, i):
        return Polynomial({(*e[:i], e[i] - 1, *e[i + 1 :]): c * e[i] for e, c in self.terms.items() if e[i]})

    def at(self, point):
        return sum((c * np.prod([x**n for x, n in zip(point, e)]) for e, c in self.terms.items()), Fraction(0))

    def gradient(self, point):
        return np.array([float(self.slope(i).at(point)) for i in range(len(point))])

    def hessian(self, point):
        d = len(point)
        return np.array([[float(self.slope(i).slope(j).at(point)) for j in range(d)] for i in range(d)])


def exact_bracket(f, g, algebra):
    """-mu_k c_ij^k dF_i dG_j with rational numbers, written out again here."""
    d = algebra.dimension
    total = Polynomial({})
    for i, j, k in product(range(d), repeat=3):
        if algebra.structure[i, j, k]:
            unit = tuple(int(n == k) for n in range(d))
            total += Polynomial({unit: -Fraction(algebra.structure[i, j, k])}) * f.slope(i) * g.slope(j)
    return total


def random_polynomials(d, rng, count, terms=5, degree=3):
    def one():
        exponents = (
            tuple(np.bincount(rng.integers(0, d, rng.integers(1, degree + 1)), minlength=d)) for _ in range(terms)
        )
        return Polynomial({tuple(int(n) for n in e): Fraction(int(rng.integers(-9, 10)), 7) for e in exponents})

    return [one() for _ in range(count)]


def rational_point(d, rng):
    return [Fraction(int(n), 8) for n in rng.integers(-16, 17, d)]


# K1: the bracket


@each_algebra
def test_jacobi_identity_and_leibniz_rule_are_exact_for_polynomials_k1(algebra, rng):
    for _ in range(3):
        f, g, h = random_polynomials(algebra.dimension, rng, 3)
        nested = (
            exact_bracket(exact_bracket(a, b, algebra), c, algebra) for a, b, c in ((f, g, h), (g, h, f), (h, f, g))
        )
        assert (next(nested) + next(nested) + next(nested)).terms == {}
        left = exact_bracket(f * g, h, algebra)
        right = f * exact_bracket(g, h, algebra) + exact_bracket(f, h, algebra) * g
        assert (left + Polynomial({(0,) * algebra.dimension: Fraction(-1)}) * right).terms == {}
        assert (exact_bracket(f, g, algebra) + exact_bracket(g, f, algebra)).terms == {}


@each_algebra
def test_bracket_and_its_gradient_are_those_of_exact_arithmetic_k1(algebra, rng):
    f, g, h = random_polynomials(algebra.dimension, rng, 3)
    for _ in range(4):
        point = rational_point(algebra.dimension, rng)
        mu = np.array([float(x) for x in point])
        inner = exact_bracket(f, g, algebra)
        value = lie_poisson_bracket(f.gradient(point), g.gradient(point), mu, algebra)
        scale = 1e-13 * (1.0 + np.abs(f.gradient(point)).max() * np.abs(g.gradient(point)).max() * np.abs(mu).max())
        assert value == pytest.approx(float(inner.at(point)), rel=1e-12, abs=scale)
        pair = [(x.gradient(point), x.hessian(point)) for x in (f, g)]
        slope = bracket_gradient(*pair, mu, algebra)
        np.testing.assert_allclose(slope, inner.gradient(point), rtol=1e-11, atol=20 * scale)
        nested = lie_poisson_bracket(slope, h.gradient(point), mu, algebra)
        outer = float(exact_bracket(inner, h, algebra).at(point))
        assert nested == pytest.approx(outer, rel=1e-10, abs=1e3 * scale)


def test_gradients_may_be_callables_and_batches_k1(rng):
    pi = rng.normal(size=(4, 5, 3))
    linear, axis = rng.normal(size=3), np.array([0.0, 0.0, 1.0])
    by_call = lie_poisson_bracket(lambda p: angular_velocity(INERTIA, p), linear, pi)
    assert by_call.shape == (4, 5)
    assert_within(by_call, -np.sum(pi * np.cross(pi @ np.linalg.inv(INERTIA), linear), -1), 1e-14)
    assert_within(
        lie_poisson_bracket(linear, axis, pi), np.einsum("i,abij,j->ab", linear, poisson_tensor(pi), axis), 1e-14
    )
    np.testing.assert_array_equal(poisson_tensor(pi), rotations.hat(pi))
    with pytest.raises(ShapeError, match="first"):
        lie_poisson_bracket([1.0, 2.0], axis, pi)
    with pytest.raises(ShapeError, match="second"):
        lie_poisson_bracket(axis, lambda p: np.full_like(p, np.nan), pi)


# G1, G2: Euler's equations and the Casimirs


def test_bracket_with_the_energy_gives_eulers_equations_g1(rng):
    pi = rng.normal(size=(50, 3))
    moments = np.array([3.0, 2.0, 1.0])
    omega = pi / moments
    # (15.3.10) by components.
    first, second, third = pi.T
    components = np.stack(
        [
            (moments[1] - moments[2]) / (moments[1] * moments[2]) * second * third,
            (moments[2] - moments[0]) / (moments[2] * moments[0]) * third * first,
            (moments[0] - moments[1]) / (moments[0] * moments[1]) * first * second,
        ],
        axis=-1,
    )
    by_bracket = np.stack([lie_poisson_bracket(e, omega, pi) for e in np.eye(3)], axis=-1)
    assert_within(by_bracket, components, 1e-14)
    assert_within(euler_equations(np.diag(moments), pi), components, 1e-14)
    assert_within(hamiltonian_vector_field(omega, pi), components, 1e-14)
    assert_within(euler_equations(INERTIA, pi), np.cross(pi, np.linalg.solve(INERTIA, pi.T).T), 1e-14)
    np.testing.assert_allclose(kinetic_energy(np.diag(moments), pi), 0.5 * np.sum(pi**2 / moments, axis=-1), rtol=1e-14)


@each_algebra
def test_bracket_is_the_rate_of_functions_along_a_motion_g1(algebra, rng):
    # F(T) - F(0) is the integral of {F, H} along the motion, by Gauss's formula of 24 nodes.
    d = algebra.dimension
    f = 0.3 * rng.normal(size=(d, d))
    h = np.eye(d) + 0.1 * (f + f.T)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    times = np.concatenate([[0.0], 0.5 * (nodes + 1.0), [1.0]])
    motion = lie_poisson_motion(lambda mu: mu @ h, rng.normal(size=d), times, algebra)
    values = np.sin(np.einsum("ni,ij,nj->n", motion, f, motion))
    slope = np.cos(np.einsum("ni,ij,nj->n", motion, f, motion))[:, None] * (motion @ (f + f.T))
    rate = lie_poisson_bracket(slope, motion @ h, motion, algebra)
    assert 0.5 * weights @ rate[1:-1] == pytest.approx(values[-1] - values[0], abs=1e-10)


def test_motion_is_that_of_the_raw_equations_g1():
    times, start = np.linspace(0.0, 20.0, 41), np.array([0.3, 1.2, -0.8])
    motion = lie_poisson_motion(lambda p: angular_velocity(INERTIA, p), start, times)
    assert_within(motion, rigid_motion(INERTIA, start, times)[0], 1e-11)


@pytest.mark.parametrize(
    ("algebra", "linear", "quadratic"),
    [
        (so3(), 0, [np.eye(3)]),
        (su2(), 0, [np.eye(3)]),
        # The inverse of the Killing form: h^2/2 + 2 x y.
        (sl2r(), 0, [[[0.5, 0, 0], [0, 0, 1.0], [0, 1.0, 0]]]),
        (se2(), 0, [np.diag([0.0, 1.0, 1.0])]),
        (
            se3(),
            0,
            [np.diag([0.0] * 3 + [1.0] * 3), np.block([[np.zeros((3, 3)), np.eye(3)], [np.eye(3), np.zeros((3, 3))]])],
        ),
        # |M|^2 and the Pfaffian M_12 M_34 - M_13 M_24 + M_14 M_23.
        (so(4), 0, [np.eye(6), np.fliplr(np.diag([1.0, -1.0, 1.0, 1.0, -1.0, 1.0]))]),
        (heisenberg(), 1, [np.diag([0.0, 0.0, 1.0])]),
        (so(2), 1, [np.eye(1)]),
        (so(5), 0, [np.eye(10)]),
    ],
    ids=lambda x: getattr(x, "name", None),
)
def test_casimirs_found_from_structure_constants_are_the_known_ones_g2(algebra, linear, quadratic, rng):
    lines, forms = linear_casimirs(algebra), quadratic_casimirs(algebra)
    assert len(lines) == linear
    assert forms.shape == (len(quadratic), algebra.dimension, algebra.dimension)
    assert_within(forms, np.swapaxes(forms, -1, -2), 1e-15)
    mu = rng.normal(size=(10, algebra.dimension))
    for form in forms:
        assert_within(casimir_defect(2.0 * mu @ form, mu, algebra), 0.0, 1e-13)
    for line in lines:
        assert_within(casimir_defect(line, mu, algebra), 0.0, 1e-14)
    basis = forms.reshape(len(forms), -1)
    assert_within(basis @ basis.T, np.eye(len(forms)), 1e-13)
    for known in quadratic:
        flat = np.ravel(known)
        assert_within(basis.T @ (basis @ flat), flat, 1e-13)


def test_casimirs_of_a_large_algebra_and_an_empty_batch_g2():
    assert len(quadratic_casimirs(so(6))) == 1
    assert lie_poisson_motion(lambda p: p, np.zeros((0, 3)), [0.0, 1.0]).shape == (0, 2, 3)
    np.testing.assert_array_equal(lie_poisson_motion(lambda p: p, np.zeros(3), [0.0, 1.0]), 0.0)


# K2: the leaves


def test_sphere_carries_minus_the_area_form_k2(rng):
    pi, dh, df, w = rng.normal(size=(4, 40, 3))
    length = np.linalg.norm(pi, axis=-1)
    v = np.cross(pi, w)
    field = hamiltonian_vector_field(dh, pi)
    # omega(X_H, v) = dH . v, {F, H} = omega(X_F, X_H), and omega = -dA/|Pi|.
    assert_within(sphere_symplectic_form(pi, field, v), np.sum(dh * v, axis=-1), 1e-12)
    assert_within(
        sphere_symplectic_form(pi, hamiltonian_vector_field(df, pi), field), lie_poisson_bracket(df, dh, pi), 1e-12
    )
    np.testing.assert_allclose(
        sphere_symplectic_form(pi, field, v), -sphere_area_form(pi, field, v) / length, rtol=1e-12
    )
    # The area is positive for vectors that turn to the left seen from outside, and that of a unit square is 1.
    across = rotations.perpendicular(pi)
    np.testing.assert_allclose(sphere_area_form(pi, across, np.cross(pi, across) / length[:, None]), 1.0, rtol=1e-13)


@each_algebra
def test_orbit_form_on_any_algebra_k2(algebra, rng):
    mu, a, b = rng.normal(size=(3, 10, algebra.dimension))
    u, v = algebra.coad(a, mu), algebra.coad(b, mu)
    form = coadjoint_orbit_form(mu, u, v, algebra)
    assert_within(form, lie_poisson_bracket(a, b, mu, algebra), 1e-11)
    assert_within(coadjoint_orbit_form(mu, v, u, algebra), -form, 1e-11)
    assert_within(form, np.sum(a * v, axis=-1), 1e-11)
    if algebra.dimension == 3 and algebra.name in ("so(3)", "su(2)"):
        assert_within(form, sphere_symplectic_form(mu, u, v), 1e-11)


def test_what_is_not_tangent_or_no_sphere_is_refused_k2():
    with pytest.raises(ShapeError, match="tangent"):
        coadjoint_orbit_form([0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    with pytest.raises(ShapeError, match="radius"):
        sphere_area_form(np.zeros(3), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])


def test_wrong_inertia_is_refused():
    with pytest.raises(ShapeError, match="symmetric"):
        euler_equations(np.triu(np.ones((3, 3))), [1.0, 0.0, 0.0])
    with pytest.raises(SingularInertiaError):
        euler_equations(np.diag([1.0, 1.0, 0.0]), [1.0, 0.0, 0.0])
    with pytest.raises(ShapeError):
        euler_equations([1.0, 2.0, 3.0], [1.0, 0.0, 0.0])


# A12 to A15, G3, G4: the Lagrangian


@pytest.fixture
def particles(rng):
    return rng.uniform(0.2, 2.0, 7), rng.normal(size=(7, 3))


def moving(rng, count=5):
    """Attitudes, their rates and body rates: (count, 3, 3), (count, 3, 3), (count, 3)."""
    attitude, omega = rotations.exp(rng.normal(size=(count, 3))), rng.normal(size=(count, 3))
    return attitude, attitude @ rotations.hat(omega), omega


def test_three_velocities_are_the_rates_of_positions_a12(particles, rng):
    _, positions = particles
    turn, omega = rng.normal(size=3), rng.normal(size=3)
    attitude = rotations.exp(turn)
    rate = attitude @ rotations.hat(omega)

    def placed(t):
        return positions @ (attitude @ rotations.exp(t * omega)).T

    step = 1e-3
    # A formula of sixth order for the rate of x(t) = R(t) X at a fixed X, and of X(t) = R(t)^-1 x at a fixed x.
    coefficients = {1: 45.0, 2: -9.0, 3: 1.0}

    def rate_of(f):
        return sum(c * (f(k * step) - f(-k * step)) for k, c in coefficients.items()) / (60.0 * step)

    material = material_velocity(rate, positions)
    assert_within(material, rate_of(placed), 1e-12)
    x = placed(0.0)
    assert_within(spatial_velocity(attitude, rate, x), material, 1e-14)
    back = rate_of(lambda t: x @ (attitude @ rotations.exp(t * omega)))
    assert_within(convective_velocity(attitude, rate, positions), -back, 1e-12)
    assert_within(convective_velocity(attitude, rate, positions), material @ attitude, 1e-14)


def test_three_lagrangians_are_equal_a12(particles, rng):
    masses, positions = particles
    attitude, rate, omega = moving(rng)
    by_hand = 0.5 * np.array([sum(m * np.sum((r @ x) ** 2) for m, x in zip(masses, positions)) for r in rate])
    for value in (
        material_lagrangian(masses, positions, rate),
        spatial_lagrangian(masses, positions, attitude, rate),
        convective_lagrangian(masses, positions, attitude, rate),
        0.5 * mass_inner_product(masses, positions, omega, omega),
        kinetic_energy(mass_inertia(masses, positions), legendre_transform(masses, positions, omega)),
    ):
        np.testing.assert_allclose(value, by_hand, rtol=1e-13)


def test_the_lagrangian_is_left_invariant_and_not_right_invariant_a13(particles, rng):
    masses, positions = particles
    attitude, rate, _ = moving(rng)
    turn = rotations.exp(rng.normal(size=3))
    value = material_lagrangian(masses, positions, rate)
    np.testing.assert_allclose(material_lagrangian(masses, positions, turn @ rate), value, rtol=1e-13)
    np.testing.assert_allclose(spatial_lagrangian(masses, positions, turn @ attitude, turn @ rate), value, rtol=1e-13)
    assert np.abs(material_lagrangian(masses, positions, rate @ turn) / value - 1.0).max() > 0.01


def test_inner_product_inertia_and_legendre_transform_a14(particles, rng):
    masses, positions = particles
    a, b = rng.normal(size=(2, 6, 3))
    inertia = mass_inertia(masses, positions)
    assert_within(mass_inner_product(masses, positions, a, b), np.sum((a @ inertia) * b, -1), 1e-12)
    by_entries = [[mass_inner_product(masses, positions, e, f) for f in np.eye(3)] for e in np.eye(3)]
    assert_within(inertia, by_entries, 1e-13)
    momentum = legendre_transform(masses, positions, a)
    assert_within(momentum, a @ inertia, 1e-12)
    assert_within(angular_velocity(inertia, momentum), a, 1e-12)
    # dL/dOmega = Pi: the quadratic is differenced exactly.
    slope = [
        0.5 * (convective_lagrangian(masses, positions, np.eye(3), rotations.hat(a[0] + e))
        - convective_lagrangian(masses, positions, np.eye(3), rotations.hat(a[0] - e)))
        for e in np.eye(3)
    ]  # fmt: skip
    assert_within(slope, momentum[0], 1e-12)


def test_translations_reduce_out_a15(particles, rng):
    masses, positions = particles
    body = reduce_translations(masses, positions)
    assert_within(masses @ body.positions, 0.0, 1e-14)
    twist = rng.normal(size=(8, 6))
    omega, velocity = twist[:, :3], twist[:, 3:]
    speeds = velocity[:, None] + np.cross(omega[:, None], positions)
    energy = 0.5 * np.einsum("p,npi,npi->n", masses, speeds, speeds)
    operator = se3_inertia(masses, positions)
    np.testing.assert_allclose(0.5 * np.einsum("ni,ij,nj->n", twist, operator, twist), energy, rtol=1e-13)
    both = twist @ operator
    assert_within(both[:, :3], np.einsum("p,npi->ni", masses, np.cross(positions, speeds)), 1e-12)
    assert_within(both[:, 3:], np.einsum("p,npi->ni", masses, speeds), 1e-12)
    # Koenig: the energy splits, and the reduced momentum is that of turning about the centre of mass.
    of_centre = 0.5 * np.sum(both[:, 3:] ** 2, axis=-1) / body.mass
    reduced = body.momentum(both)
    assert_within(reduced, omega @ body.inertia, 1e-12)
    np.testing.assert_allclose(of_centre + kinetic_energy(body.inertia, reduced), energy, rtol=1e-13)


def test_reduction_is_a_poisson_map_a15(particles, rng):
    body = reduce_translations(*particles)
    both, df, dg = rng.normal(size=(20, 6)), rng.normal(size=(20, 3)), rng.normal(size=(20, 3))

    def lifted(gradient):
        return np.concatenate([gradient, np.cross(body.centre, gradient)], axis=-1)

    # The pull-back of a gradient, by differences of the linear map.
    by_columns = np.stack([body.momentum(e) for e in np.eye(6)])
    assert_within(lifted(df), df @ by_columns.T, 1e-14)
    assert_within(
        lie_poisson_bracket(lifted(df), lifted(dg), both, se3()),
        lie_poisson_bracket(df, dg, body.momentum(both)),
        1e-12,
    )


def test_spatial_momentum_is_turned_and_constant_g3(particles, rng):
    masses, positions = particles
    attitude, rate, omega = moving(rng)
    expected = (attitude @ legendre_transform(masses, positions, omega)[..., None])[..., 0]
    assert_within(spatial_momentum(masses, positions, attitude, rate), expected, 1e-12)
    # Along a motion of the raw second-order equations of the particles' attitude.
    inertia = mass_inertia(masses, positions)
    pi, rotation = rigid_motion(inertia, inertia @ omega[0], np.linspace(0.0, 5.0, 11))
    along = spatial_momentum(masses, positions, rotation, rotation @ rotations.hat(pi @ np.linalg.inv(inertia)))
    assert_within(along, np.broadcast_to(along[0], along.shape), 1e-10)


def test_angular_velocities_in_body_and_space_g4(rng):
    attitude, rate, omega = moving(rng)
    assert_within(body_angular_velocity(attitude, rate), omega, 1e-14)
    in_space = spatial_angular_velocity(attitude, rate)
    assert_within(in_space, (attitude @ omega[..., None])[..., 0], 1e-14)
    assert_within(rotations.hat(in_space), rate @ np.swapaxes(attitude, -1, -2), 1e-14)


def test_wrong_particles_and_rates_are_refused():
    with pytest.raises(ShapeError, match="masses"):
        mass_inertia([1.0, -1.0], np.eye(3)[:2])
    with pytest.raises(ShapeError, match="one"):
        mass_inertia([1.0, 1.0], np.eye(3))
    with pytest.raises(ShapeError, match="attitude_rate"):
        body_angular_velocity(np.eye(3), np.eye(3))
    with pytest.raises(ShapeError, match="reflection"):
        body_angular_velocity(-np.eye(3), np.zeros((3, 3)))


def test_motions_no_method_can_follow_are_refused(monkeypatch):
    with pytest.raises(AccuracyNotReached, match="finite"):
        double_bracket_motion(1e-200 * np.eye(3), [1e200, 1.0, 1.0], 1.0, [0.0, 1.0])
    monkeypatch.setattr("shapephase.rigid_body._flow._STEPS", 50)
    with pytest.raises(AccuracyNotReached, match="50"):
        double_bracket_motion(INERTIA, [1.0, 2.0, 3.0], 1e12, [0.0, 1.0])
    # What stops being finite on the way is refused as well.
    with pytest.raises(AccuracyNotReached, match="followed"):
        lie_poisson_motion(lambda p: np.where(p > 1.5, np.nan, [0.0, 0.0, 1.0]), [0.0, -1.6, 0.0], [0.0, 5.0])


# G6: Cayley-Klein parameters


def spinors(rng, *shape):
    return rng.normal(size=(*shape, 2)) + 1j * rng.normal(size=(*shape, 2))


def test_momentum_map_written_out_g6(rng):
    z = spinors(rng, 9)
    first, second = np.moveaxis(z, -1, 0)
    product_ = first.conj() * second
    known = -0.25 * np.stack([2 * product_.real, 2 * product_.imag, abs(first) ** 2 - abs(second) ** 2], -1)
    assert_within(cayley_klein_momentum(z), known, 1e-14)
    np.testing.assert_allclose(np.linalg.norm(known, axis=-1), 0.25 * np.linalg.norm(z, axis=-1) ** 2, rtol=1e-14)
    # Equivariance: z -> U^H z turns Pi by R^T, U over R.
    unitary = su2_element(rng.normal(size=3))
    rotation = rotations.exp(2.0 * unitary[1])
    assert_within(cayley_klein_momentum(z @ unitary[0].conj()), cayley_klein_momentum(z) @ rotation, 1e-13)


def su2_element(half_turn):
    """exp(-i half_turn . sigma) by Rodrigues' formula, and the vector itself."""
    length = np.linalg.norm(half_turn)
    x, y, z = half_turn / length
    sigma = np.array([[z, x - 1j * y], [x + 1j * y, -z]])
    return np.cos(length) * np.eye(2) - 1j * np.sin(length) * sigma, half_turn


def test_poisson_map_for_any_functions_g6(rng):
    z, df, dg = spinors(rng, 20), rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    pulled = cayley_klein_bracket(cayley_klein_gradient(df, z), cayley_klein_gradient(dg, z))
    assert_within(pulled, lie_poisson_bracket(df, dg, cayley_klein_momentum(z)), 1e-12)
    # The gradient itself, by exact differences of the quadratic Pi(z).
    for direction in (np.array([1, 0]), np.array([0, 1]), np.array([1j, 0]), np.array([0, 1j])):
        slope = 0.5 * (cayley_klein_momentum(z + direction) - cayley_klein_momentum(z - direction))
        expected = np.sum((cayley_klein_gradient(df, z).conj() * direction).real, axis=-1)
        assert_within(np.sum(slope * df, axis=-1), expected, 1e-12)


def test_collective_hamiltonian_gives_eulers_equations_g6(rng):
    z = spinors(rng, 12)
    pi, rate = cayley_klein_momentum(z), cayley_klein_equations(INERTIA, z)
    step = 1e-3
    along = (cayley_klein_momentum(z + step * rate) - cayley_klein_momentum(z - step * rate)) / (2.0 * step)
    assert_within(along, euler_equations(INERTIA, pi), 1e-11)
    np.testing.assert_allclose(
        cayley_klein_hamiltonian(INERTIA, z), 0.5 * np.sum(pi * np.linalg.solve(INERTIA, pi.T).T, -1)
    )
    # Hamilton's equations q' = dH/dp, p' = -dH/dq of K(Pi(z)).
    gradient = cayley_klein_gradient(angular_velocity(INERTIA, pi), z)
    assert_within(rate, gradient.imag - 1j * gradient.real, 1e-13)


def test_flow_on_c2_covers_the_rigid_body_with_its_attitude_g6(rng):
    z, times = spinors(rng), np.linspace(0.0, 12.0, 25)
    path = cayley_klein_motion(INERTIA, z, times)
    start = cayley_klein_momentum(z)
    momentum, attitude = rigid_motion(INERTIA, start, times)
    assert_within(cayley_klein_momentum(path), momentum, 1e-11)
    assert_within(cayley_klein_attitude(z, path), attitude, 1e-11)
    np.testing.assert_allclose(np.linalg.norm(path, axis=-1), np.linalg.norm(z), rtol=1e-12)
    batch = cayley_klein_motion(INERTIA, np.stack([z, 1j * z]), times)
    assert_within(batch[1], 1j * path, 1e-12)


def test_spinor_over_a_momentum_g6(rng):
    pi = np.concatenate([rng.normal(size=(20, 3)), 2.0 * np.eye(3), -np.eye(3), np.zeros((1, 3)), [[1e-9, 0, 1.0]]])
    # Square roots, a division and products of numbers up to the largest momentum: eight units of rounding of that.
    rounding = 8.0 * np.finfo(float).eps * np.linalg.norm(pi, axis=1).max()
    for phase in (0.0, 0.7):
        assert_within(cayley_klein_momentum(cayley_klein_spinor(pi, phase)), pi, rounding)
    turned = np.exp(0.7j) * cayley_klein_spinor(pi)
    assert_within(cayley_klein_spinor(pi, 0.7), turned, rounding)
    with pytest.raises(ShapeError, match="lengths"):
        cayley_klein_attitude([1.0, 0.0], [2.0, 0.0])
    with pytest.raises(ShapeError, match="lengths"):
        cayley_klein_attitude([0.0, 0.0], [0.0, 0.0])
    with pytest.raises(ShapeError):
        cayley_klein_momentum([1.0, 2.0, 3.0])
    with pytest.raises(ShapeError):
        cayley_klein_momentum([np.nan * 1j, 1.0])


# K3: a moment in a magnetic field


def test_precession_is_hamiltonian_with_energy_m_dot_b_k3(rng):
    moment, field = rng.normal(size=(2, 15, 3))
    np.testing.assert_array_equal(magnetic_precession_rate(moment, field), np.cross(moment, field))
    assert_within(hamiltonian_vector_field(field, moment), np.cross(moment, field), 1e-15)
    by_bracket = np.stack([lie_poisson_bracket(e, field, moment) for e in np.eye(3)], axis=-1)
    assert_within(by_bracket, np.cross(moment, field), 1e-15)
    shift = rng.normal(size=3)
    difference = magnetic_hamiltonian(moment + shift, field) - magnetic_hamiltonian(moment, field)
    assert_within(difference, field @ shift, 1e-13)


def test_closed_form_solves_the_equation_k3(rng):
    moment, field, times = rng.normal(size=3), rng.normal(size=3), np.linspace(0.0, 8.0, 17)
    run = solve_ivp(lambda _, m: cross(m, field), (0, 8), moment, "DOP853", times, rtol=1e-13, atol=1e-14)
    assert_within(magnetic_precession(moment, field, times), run.y.T, 1e-12)
    assert magnetic_precession(np.ones((4, 3)), field, times).shape == (4, 17, 3)
    assert_within(lie_poisson_motion(lambda m: 0 * m + field, moment, times), run.y.T, 1e-12)


def test_equilibria_are_two_stable_centres_k3(rng):
    field = np.array([0.3, -1.2, 0.8])
    strength = np.linalg.norm(field)
    pair = magnetic_equilibria(2.5, field)
    assert [e.energy > 0 for e in pair] == [True, False]
    for equilibrium in pair:
        # Differences of products of the components of two parallel vectors, each known to a unit of rounding or two.
        rounding = 4.0 * np.finfo(float).eps * 2.5 * strength
        assert_within(magnetic_precession_rate(equilibrium.moment, field), 0.0, rounding)
        assert np.linalg.norm(equilibrium.moment) == pytest.approx(2.5, rel=1e-15)
        # The linearisation is the equation itself: its matrix by columns.
        matrix = np.stack([np.cross(e, field) for e in np.eye(3)], axis=-1)
        found = np.linalg.eigvals(matrix)
        assert_within(np.sort(found.imag), np.sort(equilibrium.spectrum.imag), 1e-14)
        assert_within(found.real, equilibrium.spectrum.real, 1e-14)
        assert equilibrium.spectrum.imag.max() == pytest.approx(strength)
        # Stable: the distance from it never changes.
        near = equilibrium.moment + 0.1 * rng.normal(size=3)
        along = magnetic_precession(near, field, np.linspace(0.0, 50.0, 101))
        distance = np.linalg.norm(along - equilibrium.moment, axis=-1)
        np.testing.assert_allclose(distance, distance[0], rtol=1e-12)
    with pytest.raises(ShapeError, match="field"):
        magnetic_equilibria(1.0, np.zeros(3))
    with pytest.raises(ShapeError, match="above"):
        magnetic_equilibria(0.0, field)


# K4: double-bracket dissipation


def test_energy_falls_everywhere_but_at_equilibria_k4(rng):
    pi, times = 2.0 * rotations.normalised(rng.normal(size=(6, 3))), np.linspace(0.0, 80.0, 81)
    rate = np.sum(angular_velocity(INERTIA, pi) * double_bracket_equations(INERTIA, pi, 0.8), axis=-1)
    np.testing.assert_allclose(rate, -dissipated_power(INERTIA, pi, 0.8), rtol=1e-12)
    assert rate.max() < 0.0
    motion = double_bracket_motion(INERTIA, pi, 0.8, times)
    energy = kinetic_energy(INERTIA, motion)
    assert np.all(np.diff(energy, axis=-1) < 1e-14)
    # It ends about the axis of the largest moment, the least energy on the sphere.
    moments, axes = np.linalg.eigh(INERTIA)
    np.testing.assert_allclose(energy[:, -1], 0.5 * np.sum(pi**2, axis=-1) / moments[-1], rtol=1e-9)
    assert_within(dissipated_power(INERTIA, 2.0 * axes.T, 0.8), 0.0, 1e-28)
    driven = kinetic_energy(INERTIA, double_bracket_motion(INERTIA, pi, -0.8, times))
    assert np.all(np.diff(driven, axis=-1) > -1e-14)


def test_energy_balance_along_a_motion_k4():
    nodes, weights = np.polynomial.legendre.leggauss(30)
    times = np.concatenate([[0.0], nodes + 1.0, [2.0]])
    motion = double_bracket_motion(INERTIA, [0.5, -1.0, 1.3], 0.6, times)
    energy = kinetic_energy(INERTIA, motion)
    assert energy[0] - energy[-1] == pytest.approx(weights @ dissipated_power(INERTIA, motion[1:-1], 0.6), abs=1e-12)
    raw = solve_ivp(
        lambda _, p: cross(p, w := np.linalg.solve(INERTIA, p)) + 0.6 * (p * (p @ w) - w * (p @ p)),
        (0, 2), [0.5, -1.0, 1.3], "DOP853", times, rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    assert_within(motion, raw.y.T, 1e-12)


def test_equations_are_the_sum_of_the_two_brackets_k4(rng):
    pi, df = rng.normal(size=(2, 30, 3))
    omega = angular_velocity(INERTIA, pi)
    rate = np.sum(df * double_bracket_equations(INERTIA, pi, 0.37), axis=-1)
    both = lie_poisson_bracket(df, omega, pi) + symmetric_bracket(df, omega, pi, 0.37)
    assert_within(rate, both, 1e-13)
    assert_within(symmetric_bracket(df, omega, pi, 0.37), symmetric_bracket(omega, df, pi, 0.37), 1e-15)
    assert symmetric_bracket(df, df, pi, 0.37).max() < 0.0
    by_call = symmetric_bracket(lambda p: angular_velocity(INERTIA, p), df, pi, np.full(30, 0.37))
    assert_within(by_call, symmetric_bracket(omega, df, pi, 0.37), 1e-15)


def test_printed_symmetric_bracket_has_the_wrong_sign_m_e8(rng):
    pi, df = rng.normal(size=(2, 30, 3))
    omega = pi @ np.linalg.inv(INERTIA)
    alpha = 0.37
    equations = np.cross(pi, omega) + alpha * np.cross(pi, np.cross(pi, omega))
    rate = np.sum(df * equations, axis=-1)
    rigid = -np.sum(pi * np.cross(df, omega), axis=-1)
    printed = alpha * np.sum(np.cross(pi, df) * np.cross(pi, omega), axis=-1)
    assert np.abs(rigid + printed - rate).max() > 0.1
    assert_within(rigid - printed, rate, 1e-13)
    assert_within(symmetric_bracket(df, omega, pi, alpha), -printed, 1e-14)
    # Read the printed way, the energy would grow.
    assert np.min(alpha * np.sum(np.cross(pi, omega) ** 2, axis=-1)) > 0.0
