"""Andoyer's variables: theory.md R1, N12 and the errata B-E3, B-E4 of Bonnard et al."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import AccuracyNotReached, ChartPoleError, ShapeError, UnphysicalInertiaError
from shapephase.rigid_body import ZXZ, ZYZ, EulerTop, andoyer_pendulum
from shapephase.rigid_body.geodesics import AndoyerVariables, andoyer_from_euler, andoyer_motion, andoyer_variables

MOMENTS = np.array([3.0, 2.0, 1.0])
TENSOR = np.array([[2.1, 0.3, -0.2], [0.3, 1.7, 0.15], [-0.2, 0.15, 1.2]])
SYMPLECTIC = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
CHARTS = pytest.mark.parametrize("chart", [ZYZ, ZXZ], ids=lambda chart: chart.name)
# Central differences of eighth order.
OFFSETS = np.array([1, 2, 3, 4])
WEIGHTS = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])


def random_attitudes(rng, count):
    return so3.matrix_from_quat(so3.normalised(rng.normal(size=(count, 4))))


def about_third(angle):
    return so3.exp(np.array([0.0, 0.0, 1.0]) * np.asarray(angle)[..., None])


def about_first(angle):
    return so3.exp(np.array([1.0, 0.0, 0.0]) * np.asarray(angle)[..., None])


def random_euler(rng, count):
    angles = np.stack([rng.uniform(-3, 3, count), rng.uniform(0.3, 2.8, count), rng.uniform(-3, 3, count)], axis=-1)
    return angles, rng.normal(size=(count, 3))


def test_the_complete_relations_with_euler_angles_r1():
    """Bonnard et al., section 3.4, with the last for phi_3; ZXZ differs by quarter turns of phi and psi."""
    angles, momenta = random_euler(np.random.default_rng(1), 400)
    v = andoyer_from_euler(angles, momenta)
    (phi1, phi2, phi3), (p1, p2, p3) = angles.T, momenta.T
    size = np.linalg.norm(ZYZ.body_momentum(angles, momenta), axis=-1)
    root_l, root_k = np.sqrt(size**2 - p3**2), np.sqrt(size**2 - p1**2)
    scale = 1e-13 * (1.0 + size / root_l + size / root_k)
    assert np.abs(np.array([v.vertical - p1, v.axial - p3, v.total - size])).max() < 2e-14 * size.max() / 0.3
    assert np.all(np.abs(p2 * np.sin(phi2) + root_l * root_k * np.sin(v.g) / size) < scale * size)
    assert np.all(np.abs(np.cos(phi2) - (p1 * p3 - root_l * root_k * np.cos(v.g)) / size**2) < scale)
    first = v.k + np.arctan2(p3 - p1 * np.cos(phi2), p2 * np.sin(phi2))
    third = v.l + np.arctan2(p1 - p3 * np.cos(phi2), p2 * np.sin(phi2))
    assert np.all(np.abs(so3.wrap(first - phi1)) < scale * 10)
    assert np.all(np.abs(so3.wrap(third - phi3)) < scale * 10)
    other = andoyer_from_euler(angles + np.array([0.5, 0.0, -0.5]) * np.pi, momenta, ZXZ)
    for name in ("g", "k", "l"):
        assert np.all(np.abs(so3.wrap(getattr(other, name) - getattr(v, name))) < scale * 10)


@CHARTS
def test_euler_angles_come_back_r1(chart):
    angles, momenta = random_euler(np.random.default_rng(2), 500)
    back, back_momenta = andoyer_from_euler(angles, momenta, chart).euler_angles(chart)
    momentum = chart.body_momentum(angles, momenta)
    size = np.linalg.norm(momentum, axis=-1)
    level = np.sqrt(size**2 - momenta[:, 0] ** 2)
    tolerance = 1e-13 * (1.0 + size / np.hypot(momentum[:, 0], momentum[:, 1]) + size / level)[:, None]
    assert np.all(np.abs(so3.wrap(back - angles)) < 4.0 * tolerance)
    assert np.all(np.abs(back_momenta - momenta) < 4.0 * tolerance * size[:, None])


def test_the_last_relation_is_for_phi_3_and_with_atan2_b_e4():
    angles, momenta = random_euler(np.random.default_rng(3), 100)
    v = andoyer_from_euler(angles, momenta)
    (_, phi2, phi3), (p1, p2, p3) = angles.T, momenta.T
    over, under = p1 - p3 * np.cos(phi2), p2 * np.sin(phi2)
    right = v.l + np.arctan2(over, under)
    assert np.abs(so3.wrap(right - phi3)).max() < 1e-12
    assert np.all(np.abs(so3.wrap(right - phi2)) > 1e-4)
    wrong = np.abs(so3.wrap(v.l + np.arctan(over / under) - phi3))
    assert 25 < np.sum(wrong > 3.0) < 75


def test_definition_as_a_product_of_turns_r1():
    rng = np.random.default_rng(5)
    attitude, momentum = random_attitudes(rng, 300), rng.normal(size=(300, 3))
    v = andoyer_variables(attitude, momentum)
    spatial = so3.apply(attitude, momentum)
    tilt, lean = np.arccos(v.vertical / v.total), np.arccos(v.axial / v.total)
    product = about_third(v.k + np.pi) @ about_first(tilt) @ about_third(v.g) @ about_first(lean) @ about_third(v.l)
    assert np.all(np.abs(product - attitude).max(axis=(1, 2)) < 1e-14 * (1 / np.sin(tilt) + 1 / np.sin(lean)))
    azimuth = np.arctan2(spatial[:, 1], spatial[:, 0])
    assert np.abs(so3.wrap(azimuth - v.k - 0.5 * np.pi)).max() < 1e-13
    across = np.sqrt(v.total**2 - v.axial**2)
    assert np.abs(momentum - np.stack([across * np.sin(v.l), across * np.cos(v.l), v.axial], -1)).max() < 1e-13
    assert np.abs(v.spatial_momentum - spatial).max() < 1e-13


def near_singular_states(rng, count):
    """Attitudes and momenta of sizes 1e-3 to 1e3, a third next to L = +-G, a third next to K = +-G."""
    attitude = random_attitudes(rng, count)
    momentum = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-3, 3, (count, 1))
    third = count // 3
    momentum[:third, :2] *= 10.0 ** rng.uniform(-8, 0, (third, 1))
    spatial = so3.apply(attitude, momentum)
    spatial[third : 2 * third, :2] *= 10.0 ** rng.uniform(-8, 0, (third, 1))
    momentum[third : 2 * third] = so3.apply(so3.transpose(attitude), spatial)[third : 2 * third]
    return attitude, momentum


def test_round_trip_of_ten_thousand_states_r1():
    attitude, momentum = near_singular_states(np.random.default_rng(6), 10_000)
    v = andoyer_variables(attitude, momentum)
    spatial = so3.apply(attitude, momentum)
    tolerance = 1e-12 * v.total * (1.0 / np.hypot(*momentum.T[:2]) + 1.0 / np.hypot(*spatial.T[:2]))
    assert tolerance.max() > 1e-5
    assert np.all(np.abs(v.attitude - attitude).max(axis=(1, 2)) < tolerance)
    assert np.all(np.abs(v.body_momentum - momentum).max(axis=1) < tolerance * v.total)
    assert np.all(np.abs(v.spatial_momentum - spatial).max(axis=1) < tolerance * v.total)
    again = andoyer_variables(v.attitude, v.body_momentum)
    for name in ("total", "vertical", "axial"):
        assert np.all(np.abs(getattr(again, name) - getattr(v, name)) < tolerance * v.total)
    # Nearer than this G - L, of sixteen digits, no longer tells that there was an l, or G - K a k.
    apart = np.minimum(np.hypot(*momentum.T[:2]), np.hypot(*spatial.T[:2])) > 1e-7 * v.total
    assert apart.sum() > 8_000
    for name in ("g", "k", "l"):
        assert np.all(np.abs(so3.wrap(getattr(again, name) - getattr(v, name)))[apart] < tolerance[apart])
    assert v.is_regular[6_700:].all()


def test_singular_cases_keep_the_attitude_r1():
    """Along the body's third axis l = 0, along the inertial one k = 0, and g takes the whole turn."""
    turn = about_third(0.7)
    tip = np.diag([1.0, -1.0, -1.0])
    for attitude, sign, whole in ((turn, 1.0, 0.7), (tip @ turn, 1.0, None), (turn, -1.0, None), (tip, -1.0, None)):
        v = andoyer_variables(attitude, [0.0, 0.0, 2.0 * sign])
        assert v.l == 0.0
        assert v.k == 0.0
        assert (v.total, abs(v.axial), abs(v.vertical)) == (2.0, 2.0, pytest.approx(2.0, abs=1e-15))
        assert np.abs(v.attitude - attitude).max() < 1e-15
        assert np.abs(v.body_momentum - [0.0, 0.0, 2.0 * sign]).max() < 1e-15
        assert not v.is_regular
        if whole is not None:
            assert so3.wrap(v.g + np.pi - whole) == pytest.approx(0.0, abs=1e-15)
    rng = np.random.default_rng(7)
    attitude = random_attitudes(rng, 50)
    only_l = andoyer_variables(attitude, [0.0, 0.0, -1.3])
    assert np.all(only_l.l == 0.0)
    assert not only_l.is_regular.any()
    assert np.all(andoyer_variables(attitude, [-0.0, -0.0, -1.3]).l == 0.0)
    assert andoyer_variables(np.eye(3), [-0.0, -0.0, 1.3]).k == 0.0
    assert np.abs(only_l.attitude - attitude).max() < 1e-14
    along = np.where(np.arange(50) % 2, 1.1, -1.1)
    only_k = andoyer_variables(so3.transpose(attitude), attitude[:, :, 2] * along[:, None])
    assert np.abs(only_k.attitude - so3.transpose(attitude)).max() < 1e-7
    exact = AndoyerVariables(*np.zeros((3, 2)) + 0.3, np.full(2, 2.0), np.array([2.0, -2.0]), np.array([1.0, 1.0]))
    # Entries of sums and products of sines: two or three units of rounding each, and three such products are added.
    rounding = 8.0 * np.finfo(float).eps
    assert np.abs(exact.attitude @ so3.transpose(exact.attitude) - np.eye(3)).max() < rounding
    turned = so3.apply(exact.attitude, exact.body_momentum)
    assert np.abs(turned - exact.spatial_momentum).max() < rounding * exact.total.max()


def symplectic_defect(chart, angles, momenta):
    """Of (phi, theta, psi, p_phi, p_theta, p_psi) -> (g, k, l, G, K, L)."""
    point, step = np.concatenate([angles, momenta]), 6e-3
    shifts = step * np.concatenate([OFFSETS, -OFFSETS])
    points = point + shifts[:, None, None] * np.eye(6)
    v = andoyer_from_euler(points[..., :3], points[..., 3:], chart)
    values = np.stack([v.g, v.k, v.l, v.total, v.vertical, v.axial])
    values[:3] = values[:3, :1, :1] + so3.wrap(values[:3] - values[:3, :1, :1])
    jacobian = np.einsum("ism,s->im", values, np.concatenate([WEIGHTS, -WEIGHTS])) / step
    return np.abs(jacobian.T @ SYMPLECTIC @ jacobian - SYMPLECTIC).max()


@CHARTS
def test_the_map_is_canonical_r1(chart):
    rng = np.random.default_rng(8)
    tried = 0
    for angles, momenta in zip(*random_euler(rng, 200), strict=True):
        v = andoyer_from_euler(angles, momenta, chart)
        # Where the angles change on a scale far above the step of the differences.
        regular = min(v.total - abs(v.axial), v.total - abs(v.vertical)) > 0.3 * v.total and v.total > 0.8
        if regular and 0.7 < angles[1] < 2.4:
            assert symplectic_defect(chart, angles, momenta) < 1e-10
            tried += 1
    assert tried > 30


def test_hamiltonian_in_principal_axes_and_any_other_r1():
    """Bonnard et al. (5), and Pi.I^-1 Pi/2."""
    rng = np.random.default_rng(9)
    attitude, momentum = random_attitudes(rng, 100), rng.normal(size=(100, 3))
    v = andoyer_variables(attitude, momentum)
    i1, i2, i3 = MOMENTS
    across = np.sin(v.l) ** 2 / i1 + np.cos(v.l) ** 2 / i2
    printed = 0.5 * across * (v.total**2 - v.axial**2) + v.axial**2 / (2.0 * i3)
    assert np.abs(v.hamiltonian(np.diag(MOMENTS)) - printed).max() < 1e-14
    energy = 0.5 * np.einsum("ni,ij,nj->n", momentum, np.linalg.inv(TENSOR), momentum)
    assert np.abs(v.hamiltonian(TENSOR) - energy).max() < 1e-13


def test_rates_are_those_of_the_motion_r1():
    """Along an integrated body of any inertia, and by the derivatives of the Hamiltonian."""
    top = EulerTop(TENSOR, [0.4, -0.7, 1.1], so3.exp(np.array([0.3, 1.0, -0.4])))
    step = 1e-2
    times = np.concatenate([OFFSETS, -OFFSETS]) * step + 1.3
    here, around = (andoyer_variables(top.attitude(t), top.body_momentum(t)) for t in (1.3, times))
    weights = np.concatenate([WEIGHTS, -WEIGHTS]) / step
    g_rate, l_rate, axial_rate = here.rates(TENSOR)
    assert np.sum(weights * so3.wrap(around.g - here.g)) == pytest.approx(g_rate, abs=1e-11)
    assert np.sum(weights * so3.wrap(around.l - here.l)) == pytest.approx(l_rate, abs=1e-11)
    assert np.sum(weights * around.axial) == pytest.approx(axial_rate, abs=1e-11)
    assert np.ptp(around.k) < 1e-14


def test_rates_are_those_of_the_pendulum_n12():
    """Bonnard et al. (8); the momentum along axis 3 included, where both are regular."""
    rng = np.random.default_rng(10)
    attitude, momentum = random_attitudes(rng, 60), rng.normal(size=(60, 3))
    v = andoyer_variables(attitude, momentum)
    g_rate, l_rate, axial_rate = v.rates(np.diag(MOMENTS))
    pendulum = andoyer_pendulum(MOMENTS)
    y_rate, p_y_rate = pendulum.rates(v.total, v.l, v.axial)
    assert np.abs(l_rate - y_rate).max() < 1e-14
    assert np.abs(axial_rate - p_y_rate).max() < 1e-14
    a, b, c = 1.0 / MOMENTS
    assert np.abs(g_rate - v.total * (a * np.sin(v.l) ** 2 + b * np.cos(v.l) ** 2)).max() < 1e-14
    pole = andoyer_variables(np.eye(3), [0.0, 0.0, 2.0])
    assert [float(rate) for rate in pole.rates(np.diag(MOMENTS))] == pytest.approx([2.0 * b, 2.0 * (c - b), 0.0])


@pytest.mark.parametrize("start", [(0.6, 0.3, 1.5), (0.6, 0.2, -1.5), (1.5, 0.3, 0.6), (-1.5, 0.3, -0.6)])
def test_l_librates_or_turns_as_proposition_7_says_n12(start):
    """Rotating: l gains a turn in a period; oscillating: it comes back, about pi/2 modulo pi."""
    top = EulerTop.principal(MOMENTS, start, so3.exp(np.array([0.3, 0.2, 0.5])))
    v = andoyer_motion(top, np.linspace(0.0, top.period, 41))
    kind = andoyer_pendulum(MOMENTS).trajectory_type(start)
    gain = 2.0 * np.pi * np.sign(start[2]) if kind == "rotating" else 0.0
    assert v.l[-1] - v.l[0] == pytest.approx(gain, abs=1e-13)
    if kind == "oscillating":
        assert np.abs(so3.wrap(v.l - 0.5 * np.pi * np.sign(start[0]))).max() < 0.5 * np.pi


@pytest.mark.parametrize("start", [(0.6, 0.3, 1.5), (0.6, 0.2, -1.5), (1.5, 0.3, 0.6), (-1.5, 0.3, -0.6)])
def test_g_gains_the_montgomery_phase_r1(start):
    top = EulerTop.principal(MOMENTS, start, so3.exp(np.array([-0.3, 1.2, 0.5])))
    v = andoyer_motion(top, np.array([0.0, 0.4, 1.0]) * top.period)
    gain = v.g[-1] - v.g[0]
    assert so3.wrap(gain - top.montgomery_phase) == pytest.approx(0.0, abs=1e-12)
    # Counted along t, it is the turn of the body's third axis about the momentum.
    third = top.long_axis_precession_per_period
    assert gain == pytest.approx(third, abs=1e-12)
    assert np.ptp(v.k) == 0.0


def test_samples_far_apart_are_followed_r1():
    top = EulerTop(TENSOR, [0.4, -0.7, 1.1])
    dense = andoyer_motion(top, np.linspace(0.0, 40.0, 401))
    sparse = andoyer_motion(top, np.linspace(0.0, 40.0, 21))
    for name in ("g", "l", "axial", "k"):
        assert np.abs(getattr(dense, name)[::20] - getattr(sparse, name)).max() < 1e-12
    assert np.abs(np.diff(dense.g)).max() < 0.5
    assert dense.g[-1] - dense.g[0] > 10.0
    back = andoyer_motion(top, np.linspace(40.0, 0.0, 21))
    assert np.abs((back.g - back.g[-1]) - (sparse.g - sparse.g[0])[::-1]).max() < 1e-12
    one = andoyer_motion(top, [3.0])
    state = andoyer_variables(top.attitude(3.0), top.body_momentum(3.0))
    assert abs(one.g[0] - state.g) < 1e-13
    assert abs(one.l[0] - state.l) < 1e-13


def deforming_body():
    def inertia(t):
        swell = 1.0 + 0.3 * np.sin(2.0 * np.pi * t / 3.0) ** 2
        return np.eye(3) * (MOMENTS[:, None] * [1.0, 0.9, 1.0]) * swell[:, None, None] + 0.2 * np.eye(3)

    def internal(t):
        return 0.1 * np.stack([np.cos(2.0 * np.pi * t / 3.0), np.sin(4.0 * np.pi * t / 3.0), np.ones_like(t)], axis=-1)

    return sp.prescribed(inertia, internal, 3.0)


def test_a_deforming_body_turns_about_its_momentum_by_the_gain_of_g_r1():
    deformation = deforming_body()
    orbits = sp.closed_orbits(deformation, 1.5)
    assert orbits
    for motion in orbits:
        tilted = so3.exp(np.array([0.9, 0.4, 0.0]))
        times = np.linspace(0.0, 3.0, 31)
        # Seen in inertial axes in which the momentum is along no axis.
        seen = Turned(motion, tilted)
        v = andoyer_motion(seen, times)
        assert np.abs(so3.wrap(v.l[-1] - v.l[0])) < 1e-7
        attitude = tilted @ motion.attitude(times)
        direction = v.spatial_momentum[0] / v.total[0]
        turn = so3.exp(direction * (v.g[-1] - v.g[0]))
        assert np.abs(turn @ attitude[0] - attitude[-1]).max() < 1e-7
        split = sp.split(motion, gauge="base")
        assert abs(so3.wrap(v.g[-1] - v.g[0] - split.montgomery_angle)) < 1e-7
        assert np.abs(v.attitude - attitude).max() < 1e-7


class Turned:
    """A motion seen in other inertial axes."""

    def __init__(self, motion, turn):
        self.motion, self.turn = motion, turn

    def attitude(self, t):
        return self.turn @ self.motion.attitude(t)

    def body_momentum(self, t):
        return self.motion.body_momentum(t)


def test_many_motions_at_once_r1():
    """The leading axes of a motion of many momenta come first."""
    momenta = np.array([[0.3, 0.2, 1.1], [1.0, -0.4, 0.2]])
    motions = sp.reconstruct(sp.rigid(TENSOR, 5.0), momenta)
    times = np.linspace(0.0, 5.0, 7)
    together = andoyer_motion(motions, times)
    assert together.g.shape == (2, 7)
    for row, momentum in enumerate(momenta):
        alone = andoyer_motion(EulerTop(TENSOR, momentum), times)
        for name in ("g", "k", "l", "total", "vertical", "axial"):
            assert np.abs(getattr(together, name)[row] - getattr(alone, name)).max() < 1e-7


def test_motions_start_between_minus_and_plus_a_half_turn_r1():
    rng = np.random.default_rng(11)
    for attitude, momentum in zip(random_attitudes(rng, 40), rng.normal(size=(40, 3)), strict=True):
        top = EulerTop(TENSOR, momentum, attitude)
        v = andoyer_motion(top, [0.0, 0.1])
        state = andoyer_variables(attitude, top.body_momentum(0.0))
        assert np.abs(np.array([v.g[0] - state.g, v.l[0] - state.l, v.k[0] - state.k])).max() < 1e-12


class Jumping:
    """A body that turns over at once."""

    def attitude(self, t):
        return so3.exp(np.where(t[..., None] > 0.4, [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]))

    def body_momentum(self, t):
        return so3.apply(so3.transpose(self.attitude(t)), np.array([0.0, 0.0, 1.0]))


def test_refusals_say_what_is_wrong():
    top = EulerTop(TENSOR, [0.4, -0.7, 1.1])
    for error, word, call in (
        (ShapeError, "zero", lambda: andoyer_variables(np.eye(3), [0.0, 0.0, 0.0])),
        (ShapeError, "zero", lambda: andoyer_motion(EulerTop(TENSOR, [0.0, 0.0, 0.0]), [0.0, 1.0])),
        (ShapeError, "attitude", lambda: andoyer_variables(2.0 * np.eye(3), [1.0, 0.0, 0.0])),
        (ShapeError, "broadcast", lambda: andoyer_variables(np.tile(np.eye(3), (2, 1, 1)), np.ones((3, 3)))),
        (ShapeError, "order", lambda: andoyer_motion(top, [0.0, 1.0, 0.5])),
        (ShapeError, "least", lambda: andoyer_motion(top, [])),
        (AccuracyNotReached, "jumps", lambda: andoyer_motion(Jumping(), [0.0, 1.0])),
        (ChartPoleError, "axis", lambda: andoyer_variables(np.eye(3), [0.0, 0.0, 1.0]).rates(TENSOR)),
        (ChartPoleError, "pole", lambda: andoyer_variables(np.eye(3), [0.3, 0.0, 1.0]).euler_angles()),
        (ChartPoleError, "pole", lambda: andoyer_from_euler([0.1, 0.0, 0.2], [1.0, 0.0, 1.0])),
    ):
        with pytest.raises(error, match=word):
            call()
    for values, name in (
        ((0.1, 0.2, 0.3, 1.0, 0.0, 1.1), "axial"),
        ((0.1, 0.2, 0.3, 1.0, -1.1, 0.0), "vertical"),
        ((0.1, 0.2, 0.3, 0.0, 0.0, 0.0), "total"),
        (([0.1, 0.2], [0.2, 0.3, 0.4], 0.3, 1.0, 0.0, 0.0), "broadcast"),
        ((np.nan, 0.2, 0.3, 1.0, 0.0, 0.0), "g"),
    ):
        with pytest.raises(ShapeError, match=name):
            AndoyerVariables(*values)
    state = andoyer_variables(np.eye(3), np.ones((4, 3)))
    with pytest.raises(ShapeError, match="axes"):
        state.hamiltonian(np.tile(TENSOR, (3, 1, 1)))
    with pytest.raises(UnphysicalInertiaError):
        state.hamiltonian(TENSOR + np.triu(np.ones((3, 3)), 1))
