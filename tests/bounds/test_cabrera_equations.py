"""Cabrera's sections 2 and 3.2 as identities: on sums over particles, on joints and on prescribed inertias.

What stands on the other side is never the library: positions of the particles in space and their derivatives, an
integration of the raw equations, a product of small turns.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.deformation import assembly, boom, moving_mass, rigid_part
from shapephase.inertia_tensor import principal_axes
from shapephase.rigid_body import EulerTop
from support.bodies import random_loop
from support.independent import apart, cross, hat

DURATION = 2.0
TIMES = np.array([0.13, 0.6, 1.05, 1.4, 1.87])
MOMENTUM = np.array([0.9, -1.4, 2.1])


def derivative(function, t, step=0.01):
    """Central difference of order ten."""
    weights = (5 / 6, -5 / 21, 5 / 84, -5 / 504, 1 / 1260)
    total = sum(w * (function(t + k * step) - function(t - k * step)) for k, w in enumerate(weights, start=1))
    return total / step


class Cloud:
    """Point masses on random Fourier paths, not centred."""

    def __init__(self, seed, count=5):
        rng = np.random.default_rng(seed)
        self.masses = rng.uniform(0.3, 1.5, count)
        self.middle = 1.5 * rng.normal(size=(count, 3))
        self.waves = rng.normal(size=(2, 2, count, 3)) * 0.12

    def __call__(self, t):
        at, speed = self.middle + 0 * t[:, None, None], 0 * self.middle + 0 * t[:, None, None]
        for k in (1, 2):
            w = 2 * np.pi * k / DURATION
            c, s = np.cos(w * t)[:, None, None], np.sin(w * t)[:, None, None]
            a, b = self.waves[:, k - 1]
            at, speed = at + a * c + b * s, speed + w * (b * c - a * s)
        return at, speed

    def centred(self, t):
        at, speed = self(np.atleast_1d(t))
        share = self.masses / self.masses.sum()
        return at - (share @ at)[:, None], speed - (share @ speed)[:, None]

    @property
    def deformation(self):
        return sp.particles(self.masses, self, DURATION)


def momentum_of(masses, at, speed):
    return np.einsum("m,...mi->...i", masses, np.cross(at, speed))


def prescribed_case(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.random(rng=rng).as_matrix()
    a, b, c = rng.uniform(-0.2, 0.2, (3, 3))

    def inertia(t):
        w = np.pi * t[:, None]
        moments = np.array([1.5, 2.0, 2.4]) + a * np.cos(w) + b * np.sin(2 * w)
        return turn @ (moments[:, :, None] * np.eye(3)) @ turn.T

    return sp.prescribed(inertia, lambda t: c * np.cos(np.pi * t)[:, None] + a * t[:, None], DURATION)


def assembly_case(seed):
    rng = np.random.default_rng(seed)
    furniture = sp.ShapePath.fourier(rng.normal(size=3), *(0.2 * rng.normal(size=(2, 3, 2))), DURATION)
    length = sp.ShapePath.fourier([1.0], [[0.4]], [[0.2]], DURATION)
    hull = rigid_part(5.0, np.diag([1.0, 1.3, 1.6]), rng.normal(size=3))
    return assembly(hull, [moving_mass(1.0, furniture), boom(0.6, 2.0, rng.normal(size=3), [1, 2, -1], length)])


def articulated_case(seed):
    body = sp.load_body("diver")
    return sp.articulated(body, random_loop(body, np.random.default_rng(seed), duration=DURATION))


CASES = {
    **{f"particles {seed}": lambda seed=seed: Cloud(seed).deformation for seed in range(3)},
    **{f"prescribed {seed}": lambda seed=seed: prescribed_case(seed) for seed in range(3)},
    "assembly": lambda: assembly_case(4),
    "diver": lambda: articulated_case(5),
}


@cache
def solved(name):
    deformation = CASES[name]()
    start = Rotation.random(rng=np.random.default_rng(len(name))).as_matrix()
    return sp.reconstruct(deformation, MOMENTUM, start, tolerance=1e-11)


@pytest.fixture(params=CASES)
def motion(request):
    return solved(request.param)


def rate_of_attitude(motion, t):
    """omega from R(t) alone."""
    matrix = np.swapaxes(motion.attitude(t), -1, -2) @ derivative(motion.attitude, t)
    assert np.abs(matrix + np.swapaxes(matrix, -1, -2)).max() < 1e-8
    return np.stack([matrix[:, 2, 1], matrix[:, 0, 2], matrix[:, 1, 0]], axis=-1)


def times_vector(matrix, vector):
    return np.einsum("...ij,...j->...i", matrix, vector)


def turning(seed):
    """An arbitrary R(t), its body rate, both in closed form: R = exp(a hat(u)) exp(b hat(v)), a and b of time."""
    rng = np.random.default_rng(seed)
    u, v = rng.normal(size=(2, 3))

    def frame(t):
        first = Rotation.from_rotvec(np.sin(1.3 * t)[:, None] * u).as_matrix()
        second = Rotation.from_rotvec((0.7 * t * t)[:, None] * v).as_matrix()
        omega = (1.3 * np.cos(1.3 * t))[:, None] * times_vector(np.swapaxes(second, 1, 2), u) + (1.4 * t)[:, None] * v
        return first @ second, omega

    return frame


# ---- Bodies ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_equation_3_angular_momentum_of_a_turned_body_a5(seed):
    """L(d/dt (R d)) = R I omega + R L_o for any turn R(t): sums over the particles in space."""
    cloud = Cloud(seed)
    turn, omega = turning(seed)(TIMES)
    at, speed = cloud.centred(TIMES)
    there = at @ np.swapaxes(turn, 1, 2)
    moved = (np.cross(omega[:, None], at) + speed) @ np.swapaxes(turn, 1, 2)
    left = momentum_of(cloud.masses, there, moved)
    body = cloud.deformation
    right = times_vector(turn, times_vector(body.inertia(TIMES), omega) + body.internal_momentum(TIMES))
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-13 * np.abs(left).max())
    slope = derivative(lambda t: cloud.centred(t)[0] @ np.swapaxes(turning(seed)(t)[0], 1, 2), TIMES)
    np.testing.assert_allclose(moved, slope, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_equation_4_kinetic_energy_of_a_turned_body_a6(seed):
    """T(d/dt (R d)) = omega.I omega/2 + L_o.omega + T_0, T = sum m v^2/2 over the particles in space."""
    cloud = Cloud(seed)
    body = cloud.deformation
    turn, omega = turning(seed)(TIMES)
    at, speed = cloud.centred(TIMES)
    moved = (np.cross(omega[:, None], at) + speed) @ np.swapaxes(turn, 1, 2)
    left = 0.5 * np.einsum("m,nmi,nmi->n", cloud.masses, moved, moved)
    still = 0.5 * np.einsum("m,nmi,nmi->n", cloud.masses, speed, speed)
    spinning = times_vector(body.inertia(TIMES), omega)
    right = np.sum(omega * (0.5 * spinning + body.internal_momentum(TIMES)), axis=-1) + still
    np.testing.assert_allclose(left, right, rtol=1e-13)
    np.testing.assert_allclose(body.kinetic_energy(TIMES, omega), left, rtol=1e-13)
    np.testing.assert_allclose(body.kinetic_energy(TIMES), still, rtol=1e-13)


def test_kinetic_energy_as_printed_lacks_the_half_c_e1():
    """With T = sum m v^2, printed before equation (4), (4) is off by T - T_0; with the half it holds."""
    cloud = Cloud(1)
    body = cloud.deformation
    turn, omega = turning(1)(TIMES)
    at, speed = cloud.centred(TIMES)
    moved = (np.cross(omega[:, None], at) + speed) @ np.swapaxes(turn, 1, 2)
    printed, of_shape = (np.einsum("m,nmi,nmi->n", cloud.masses, part, part) for part in (moved, speed))
    turned = np.sum(omega * (0.5 * times_vector(body.inertia(TIMES), omega) + body.internal_momentum(TIMES)), axis=-1)
    np.testing.assert_allclose(0.5 * printed - (turned + 0.5 * of_shape), np.zeros(5), rtol=0, atol=1e-12)
    defect = printed - (turned + of_shape)
    np.testing.assert_allclose(defect, 0.5 * (printed - of_shape), rtol=1e-11)
    assert np.abs(defect).min() > 0.1


def driven():
    """Four masses on springs whose rest lengths change in time: momentum about the centre and energy, at 41 times."""
    rng = np.random.default_rng(12)
    masses = rng.uniform(0.5, 1.5, 4)
    at, speed = rng.normal(size=(2, 4, 3))
    rest = rng.uniform(1.0, 2.0, (4, 4))
    rest = rest + rest.T

    def forces(t, r):
        total = np.zeros((4, 3))
        for i in range(4):
            for j in range(i):
                line = r[i] - r[j]
                distance = np.linalg.norm(line)
                pull = -(distance - rest[i, j] * (1 + 0.3 * np.sin(2.1 * t + i))) * line / distance
                total[i] += pull
                total[j] -= pull
        return total

    def slope(t, y):
        r, v = y.reshape(2, 4, 3)
        return np.concatenate([v, forces(t, r) / masses[:, None]]).ravel()

    run = solve_ivp(
        slope, (0, 3), np.concatenate([at, speed]).ravel(), "DOP853", np.linspace(0, 3, 41), rtol=1e-12, atol=1e-13
    )
    r, v = np.moveaxis(run.y.T.reshape(-1, 2, 4, 3), 1, 0)
    share = masses / masses.sum()
    r, v = r - (share @ r)[:, None], v - (share @ v)[:, None]
    return momentum_of(masses, r, v), 0.5 * np.einsum("m,nmi,nmi->n", masses, v, v), masses, r, v, run.t


def test_masses_driven_by_their_own_forces_are_a_self_deforming_body_a9():
    """Their motion seen from some turning frame is a deformation; the library turns it back into that in space."""
    momentum, energy, masses, r, v, times = driven()
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0, atol=1e-10)
    assert np.ptp(energy) > 0.1 * energy.max()
    frame = turning(7)
    turn, omega = frame(times)
    seen = r @ turn
    seen_speed = v @ turn - np.cross(omega[:, None], seen)
    from scipy.interpolate import CubicHermiteSpline

    spline = CubicHermiteSpline(times, seen, seen_speed)
    body = sp.particles(masses, lambda t: (spline(t), spline(t, 1)), 3.0, breaks=times[1:-1])
    np.testing.assert_allclose(body.kinetic_energy(times, omega), energy, rtol=1e-10)
    motion = sp.reconstruct(body, momentum[0], turn[0], tolerance=1e-9)
    # Cubics through 41 samples.
    assert apart(motion.attitude(times), turn) < 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_principal_axes_are_axes_of_steady_rotation_a11(seed):
    """I e = I_k e with a proper frame; a rigid body that turns about one of them goes on doing so."""
    tensor = Cloud(seed).deformation.inertia(0.7)
    moments, axes = principal_axes(tensor)
    np.testing.assert_allclose(tensor @ axes, axes * moments, rtol=0, atol=1e-13)
    assert np.linalg.det(axes) == pytest.approx(1.0, rel=1e-13)
    assert np.all(np.diff(moments) > 0)
    for k in (0, 2):
        motion = sp.reconstruct(sp.rigid(tensor, 2.0), 3.0 * axes[:, k], tolerance=1e-11)
        assert apart(motion.final_attitude, expm(2.0 * 3.0 / moments[k] * hat(axes[:, k]))) < 1e-10


# ---- Motion ---------------------------------------------------------------------------------------------------------


def test_equation_5_the_second_order_equation_c1(motion):
    """I omega' = I omega x omega + L_o x omega - I' omega - L_o', omega by differences of R(t)."""
    body = motion.deformation
    omega = rate_of_attitude(motion, TIMES)
    inertia, momentum = body.inertia(TIMES), body.internal_momentum(TIMES)
    left = times_vector(inertia, derivative(motion.angular_velocity, TIMES))
    spin = times_vector(inertia, omega)
    right = np.cross(spin + momentum, omega)
    right -= times_vector(derivative(body.inertia, TIMES), omega) + derivative(body.internal_momentum, TIMES)
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-8 * max(1.0, np.abs(spin).max()) * 3)


def test_equations_7_to_10_momentum_rate_and_attitude_c2_c3_c4_c5(motion):
    """Pi = I omega + L_o with omega by differences of R, which is I^-1 (Pi - L_o); Pi' = Pi x omega, |Pi| stays."""
    body, size = motion.deformation, np.linalg.norm(motion.momentum)
    omega, pi = rate_of_attitude(motion, TIMES), motion.body_momentum(TIMES)
    spin = times_vector(body.inertia(TIMES), omega) + body.internal_momentum(TIMES)
    np.testing.assert_allclose(pi, spin, rtol=0, atol=1e-8 * size)
    np.testing.assert_allclose(np.linalg.norm(pi, axis=-1), np.full(5, size), rtol=1e-13)
    rate = np.linalg.solve(body.inertia(TIMES), (pi - body.internal_momentum(TIMES))[..., None])[..., 0]
    np.testing.assert_allclose(omega, rate, rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.angular_velocity(TIMES), rate, rtol=0, atol=1e-12 * np.abs(rate).max())
    slope = derivative(motion.body_momentum, TIMES)
    np.testing.assert_allclose(slope, np.cross(pi, rate), rtol=0, atol=1e-8 * size)


def raw_slope(motion):
    """The right side of (9) and (10) from the deformation's functions alone."""
    body = motion.deformation

    def rates(t, pi):
        inertia, inner = body.inertia(t), body.internal_momentum(t)
        return np.linalg.solve(inertia, pi - inner)

    return rates


def product_of_turns(motion, count, right):
    """exp(hat(omega) h) over the middles of `count` steps, later factors on the right, or on the left."""
    h = DURATION / count
    middles = h * (np.arange(count) + 0.5)
    turns = Rotation.from_rotvec(h * motion.angular_velocity(middles)).as_matrix()
    total = np.eye(3)
    for turn in turns:
        total = total @ turn if right else turn @ total
    return total


def test_the_ordered_exponential_is_ordered_to_the_right_and_ends_at_t_c_e2():
    """Since R' = R hat(omega), later factors stand on the right; to the left, as T usually means, it fails.

    The printed upper limit is t_2 for every t: then R would not depend on t.
    """
    motion = solved("particles 1")
    whole = motion.initial_attitude.T @ motion.final_attitude
    coarse, fine, finest = (product_of_turns(motion, count, right=True) for count in (2000, 4000, 8000))
    once, twice = (4 * fine - coarse) / 3, (4 * finest - fine) / 3
    np.testing.assert_allclose((16 * twice - once) / 15, whole, rtol=0, atol=1e-9)
    assert apart(product_of_turns(motion, 4000, right=False), whole) > 0.1
    half = motion.initial_attitude.T @ motion.attitude(0.5 * DURATION)
    assert apart(half, whole) > 0.1


def test_the_vector_field_on_the_level_set_of_the_momentum_c6(motion):
    """Proposition 3.2: the integral curve of X is (R(t), Pi(t))."""
    rates = raw_slope(motion)

    def field(t, y):
        attitude, pi = y[:9].reshape(3, 3), y[9:]
        omega = rates(min(t, DURATION), pi)
        return np.concatenate([(attitude @ hat(omega)).ravel(), cross(pi, omega)])

    start = np.concatenate([motion.initial_attitude.ravel(), motion.initial_attitude.T @ motion.momentum])
    run = solve_ivp(field, (0, DURATION), start, "DOP853", TIMES, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(motion.attitude(TIMES), run.y[:9].T.reshape(-1, 3, 3), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        motion.body_momentum(TIMES), run.y[9:].T, rtol=0, atol=1e-9 * np.linalg.norm(motion.momentum)
    )


def test_the_initial_momentum_c7(motion):
    """Pi(t_1) = R(t_1)^-1 L; the momentum of a body that starts with a given rate is R (I omega + L_o)."""
    np.testing.assert_allclose(
        motion.body_momentum(0.0), np.linalg.solve(motion.initial_attitude, motion.momentum), rtol=1e-12
    )
    omega = motion.angular_velocity(0.0)
    again = sp.momentum_from_rate(motion.deformation, omega, motion.initial_attitude)
    np.testing.assert_allclose(again, motion.momentum, rtol=0, atol=1e-12 * np.linalg.norm(motion.momentum))


@pytest.mark.parametrize("seed", range(3))
def test_the_momentum_in_space_is_kept_c8(seed):
    """Sum of m r x r' over the particles in space, their velocities by differences of positions."""
    cloud, motion = Cloud(seed), solved(f"particles {seed}")

    def in_space(t):
        return cloud.centred(t)[0] @ np.swapaxes(motion.attitude(t), 1, 2)

    momentum = momentum_of(cloud.masses, in_space(TIMES), derivative(in_space, TIMES))
    np.testing.assert_allclose(momentum, np.broadcast_to(motion.momentum, (5, 3)), rtol=0, atol=1e-8)
    assert motion.equation_residual < 1e-9


def test_the_rate_is_known_from_the_momentum_and_the_energy_is_not_kept_c9(motion):
    """Remarks 2.8 and 2.9: d/dt E = (Pi x I^-1 Pi).I^-1 L_o + Pi.(I^-1)' Pi/2 with E = Pi.I^-1 Pi/2."""
    body = motion.deformation
    assert np.linalg.eigvalsh(body.inertia(TIMES)).min() > 0

    def energy(t):
        pi = motion.body_momentum(t)
        return 0.5 * np.sum(pi * np.linalg.solve(body.inertia(t), pi[..., None])[..., 0], axis=-1)

    pi = motion.body_momentum(TIMES)
    inverse = np.linalg.inv(body.inertia(TIMES))
    spin, drift = times_vector(inverse, pi), times_vector(inverse, body.internal_momentum(TIMES))
    want = np.sum(np.cross(pi, spin) * drift, axis=-1)
    want += 0.5 * np.sum(pi * times_vector(derivative(lambda t: np.linalg.inv(body.inertia(t)), TIMES), pi), axis=-1)
    np.testing.assert_allclose(derivative(energy, TIMES), want, rtol=0, atol=1e-8 * energy(TIMES).max() * 3)
    assert np.ptp(energy(np.linspace(0, DURATION, 50))) > 1e-3 * energy(TIMES).max()


def test_the_hamiltonian_that_depends_on_time_c10(motion):
    """Remark 3.3: H = Pi.I^-1 Pi/2 - Pi.I^-1 L_o; Pi' = Pi x grad H, and along the motion dH/dt is that of the
    explicit time."""
    body = motion.deformation

    def hamiltonian(pi, t):
        solved_ = np.linalg.solve(body.inertia(t), (0.5 * pi - body.internal_momentum(t))[..., None])[..., 0]
        return np.sum(pi * solved_, axis=-1)

    pi = motion.body_momentum(TIMES)
    # Central differences of a quadratic function have no error but rounding.
    gradient = np.stack([hamiltonian(pi + e, TIMES) - hamiltonian(pi - e, TIMES) for e in np.eye(3)], axis=-1) / 2
    slope = derivative(motion.body_momentum, TIMES)
    size = np.linalg.norm(motion.momentum)
    np.testing.assert_allclose(slope, np.cross(pi, gradient), rtol=0, atol=1e-8 * size)
    along = derivative(lambda t: hamiltonian(motion.body_momentum(t), t), TIMES)
    explicit = derivative(lambda t: hamiltonian(pi, t), TIMES)
    np.testing.assert_allclose(along, explicit, rtol=0, atol=1e-8 * size**2)


def test_equation_12_the_dynamic_phase(motion):
    """|L| theta' = Pi.I^-1 Pi - Pi.I^-1 L_o, theta(0) = 0."""
    body = motion.deformation
    pi = motion.body_momentum(TIMES)
    want = np.linalg.solve(body.inertia(TIMES), (pi - body.internal_momentum(TIMES))[..., None])[..., 0]
    size = np.linalg.norm(motion.momentum)
    slope = derivative(motion.dynamic_phase, TIMES)
    np.testing.assert_allclose(slope, np.sum(want * pi, axis=-1) / size, rtol=0, atol=1e-8)
    assert motion.dynamic_phase(0.0) == 0.0


def test_the_turn_is_about_the_unit_vector_c_e3():
    """exp(theta L/|L|) with the vector's length; with L itself, or the norm of its hat matrix, the turn is another."""
    top = EulerTop.principal([1.0, 2.0, 3.0], [0.9, 0.3, 1.4])
    hat, phase, end = so3.hat(top.momentum), top.montgomery_phase, top.attitude(top.period)
    np.testing.assert_allclose(expm(phase * hat / top.magnitude), end, rtol=0, atol=1e-12)
    assert np.abs(expm(phase * hat) - end).max() > 0.1
    assert np.abs(expm(phase * hat / np.linalg.norm(hat)) - end).max() > 0.1


def test_the_whole_turn_does_not_depend_on_the_description_and_the_phase_does_c_e15(rng):
    body = sp.load_body("satellite")
    original = sp.articulated(body, random_loop(body, rng, duration=3.0))
    motion = sp.reconstruct(original, [0.5, 0.3, 1.0], tolerance=1e-11)
    turning = lambda t: so3.exp(np.outer(t, [0.2, 0.1, 0.4]))  # noqa: E731
    seen = [sp.split(motion, gauge) for gauge in ("base", "horizontal", turning)]
    for other in seen[1:]:
        np.testing.assert_allclose(other.total_rotation, seen[0].total_rotation, rtol=0, atol=1e-10)
        assert abs(so3.wrap(other.montgomery_phase - seen[0].montgomery_phase)) > 1e-3
