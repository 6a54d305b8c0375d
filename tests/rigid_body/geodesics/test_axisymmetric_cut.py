"""The axisymmetric metrics' closed forms against the general search, brute force over all geodesics, and shooting."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.rigid_body.geodesics import axisymmetric_metric, left_invariant_metric
from support.independent import assert_within

# (I_1, I_3): flat with I_3 below and beyond 2 I_1, round, rods, sub-Riemannian.
PAIRS = [(1.0, 1.5), (1.0, 3.0), (1.0, 30.0), (2.0, 2.0), (2.0, 0.7), (1.0, 0.2), (1.0, np.inf), (2.5, np.inf)]
IDS = [f"{first:g}-{third:g}" for first, third in PAIRS]
# All geodesics are looked through for half of them in the quick run.
SLOW = (PAIRS[2], PAIRS[3], PAIRS[5], PAIRS[7])
SOME = [pytest.param(p, marks=pytest.mark.full) if p in SLOW else p for p in PAIRS]


def unit_momenta(pair, seed, count):
    metric = left_invariant_metric([pair[0], pair[0], pair[1]])
    return metric, metric.unit_speed(np.random.default_rng(seed).normal(size=(count, 3)))


def all_ways(pair, q, on_su2=False, samples=200):
    """The shortest of all geodesics with tau <= pi to a quaternion (q_1 + i q_2 not 0), by scanning every branch.

    Its own derivation: tau and p_3 on the curve sin tau sqrt(1 - p_3^2) = |q_1 + i q_2|, the phase of q_0 + i q_3
    modulo 2 pi, or pi on SO(3).
    """
    eta, across, along = pair[0] / pair[1] - 1.0, np.hypot(q[0], q[1]), np.hypot(q[2], q[3])
    target, cycle = np.arctan2(q[2], q[3]), 2.0 * np.pi if on_su2 else np.pi

    def parts(nu):
        sine, cosine = np.hypot(across, along * np.sin(nu)), along * np.cos(nu)
        return np.arctan2(sine, cosine), along * np.sin(nu) / sine

    def phase(nu):
        tau, axial = parts(nu)
        return nu + eta * tau * axial - target

    grid = np.linspace(-np.pi, np.pi, samples)
    # Denser where the axial part turns over.
    grid = np.unique(np.concatenate([grid, *(k * np.pi + across * np.linspace(-8.0, 8.0, 60) for k in (-1, 0, 1))]))
    values, best = phase(grid), np.inf
    for k in range(int(np.floor(values.min() / cycle)), int(np.ceil(values.max() / cycle)) + 1):
        rest = values - k * cycle
        for i in np.flatnonzero(rest[1:] * rest[:-1] <= 0.0):
            tau, axial = parts(brentq(lambda nu, k=k: phase(nu) - k * cycle, grid[i], grid[i + 1], xtol=1e-14))
            best = min(best, 2.0 * np.sqrt(pair[0]) * tau * np.sqrt(1.0 + eta * axial**2))
    return best


@pytest.mark.parametrize("pair", SOME, ids=lambda pair: f"{pair[0]:g}-{pair[1]:g}")
def test_distances_on_su2_are_the_least_of_all_ways_q6(pair):
    closed = axisymmetric_metric(*pair)
    quats = Rotation.random(6, random_state=5).as_quat() * np.array([[1.0], [-1.0]] * 3)
    expected = [all_ways(pair, quat, on_su2=True) for quat in quats]
    assert_within(closed.distance_on_su2(quats), expected, 1e-10)
    rotations = Rotation.from_quat(quats).as_matrix()
    nearer = np.minimum(closed.distance_on_su2(quats), closed.distance_on_su2(-quats))
    assert_within(closed.distance(rotations), nearer, 1e-11)
    assert closed.distance_on_su2([0.0, 0.0, 0.0, 1.0]) == 0.0


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
def test_the_diameter_of_su2_is_the_greatest_length_up_to_the_cut_q6(pair):
    """The farthest points are on the cut locus: by the cut times of geodesics of 4,001 axial parts."""
    closed = axisymmetric_metric(*pair)
    axial = np.linspace(0.0, 1.0, 4001)[:-1]
    momenta = np.stack([np.sqrt(1.0 - axial**2), 0.0 * axial, axial], axis=-1)
    speed = np.sqrt((1.0 - axial**2) / pair[0] + axial**2 / pair[1])
    lengths = closed.cut_time_on_su2(momenta) * speed
    assert lengths.max() <= closed.diameter_on_su2 * (1.0 + 1e-12)
    assert lengths.max() == pytest.approx(closed.diameter_on_su2, rel=1e-7)
    assert closed.distance_on_su2([0.0, 0.0, 0.0, -1.0]) <= closed.diameter_on_su2 * (1.0 + 1e-12)


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
def test_conjugate_times_are_those_of_the_search_q6(pair):
    metric, start = unit_momenta(pair, 1, 60)
    start = np.concatenate([start, metric.unit_speed([[1.0, 0.0, 0.0], [0.3, 0.0, 1e-9], [1e-3, 0.0, 1.0]])])
    expected = metric.conjugate_time(start)
    closed = axisymmetric_metric(*pair)
    np.testing.assert_allclose(closed.conjugate_time(start), expected, rtol=1e-12)
    np.testing.assert_allclose(closed.conjugate_time(3.0 * start), expected / 3.0, rtol=1e-12)


@pytest.mark.parametrize("pair", [(1.0, 0.2), (1.0, 3.0), (1.0, np.inf)])
def test_the_printed_equation_of_the_conjugate_times_q6(pair):
    metric, start = unit_momenta(pair, 2, 30)
    eta = pair[0] / pair[1] - 1.0
    axial = start[:, 2] / np.linalg.norm(start, axis=-1)
    tau = axisymmetric_metric(*pair).conjugate_time(start) * np.linalg.norm(start, axis=-1) / (2.0 * pair[0])
    slope = tau * eta * (1.0 - axial**2) / (1.0 + eta * axial**2)
    product = np.sin(tau) * (np.sin(tau) + slope * np.cos(tau))
    assert_within(product, 0.0, 1e-14)
    if eta > 0.0:
        assert np.all((tau > 0.5 * np.pi) & (tau < np.pi))
    else:
        np.testing.assert_allclose(tau, np.pi, rtol=1e-14)
    # The determinant of the differential is that product, up to a factor without zeros.
    t = np.random.default_rng(3).uniform(0.3, 1.6, 30) * metric.conjugate_time(start)
    tau = t * np.linalg.norm(start, axis=-1) / (2.0 * pair[0])
    kappa = eta * (1.0 - axial**2) / (1.0 + eta * axial**2)
    ratio = np.linalg.det(metric.differential(start, t)) / (
        np.sin(tau) * (np.sin(tau) + kappa * tau * np.cos(tau)) * t * 4.0 / np.linalg.norm(start, axis=-1) ** 2
    )
    energy = (1.0 + eta * axial**2) / pair[0]
    np.testing.assert_allclose(ratio, energy, rtol=1e-10)


@pytest.mark.parametrize("pair", SOME, ids=IDS)
def test_cut_times_against_all_geodesics_q6(pair):
    metric, start = unit_momenta(pair, 4, 3)
    cut = axisymmetric_metric(*pair).cut_time(start)
    assert np.all(cut <= metric.conjugate_time(start) * (1.0 + 1e-12))
    for part, shortest in ((0.4, True), (0.999, True), (1.001, False), (1.3, False)):
        for momentum, time in zip(start, part * cut):
            length = all_ways(pair, so3.quat_from_matrix(metric.attitude(momentum, time)))
            if shortest:
                assert abs(length - time) < 1e-11
            elif time < metric.conjugate_time(momentum):
                assert length < time - 1e-9


@pytest.mark.parametrize("pair", SOME, ids=IDS)
def test_cut_times_on_su2_against_all_geodesics_q6(pair):
    _, start = unit_momenta(pair, 5, 3)
    closed = axisymmetric_metric(*pair)
    cut = closed.cut_time_on_su2(start)
    assert np.all(cut >= closed.cut_time(start))
    eta, size = closed.eta, np.linalg.norm(start, axis=-1)
    for part, shortest in ((0.6, True), (0.999, True), (1.001, False)):
        tau, axial = part * cut * size / (2.0 * pair[0]), start[:, 2] / size
        whole = np.exp(1j * eta * axial * tau) * (np.cos(tau) + 1j * axial * np.sin(tau))
        across = np.sqrt(1.0 - axial**2) * np.abs(np.sin(tau))
        for k in range(len(start)):
            length = all_ways(pair, np.array([across[k], 0.0, whole[k].imag, whole[k].real]), on_su2=True)
            assert abs(length - part * cut[k]) < 1e-11 if shortest else length < part * cut[k] - 1e-9


def test_q0_vanishes_at_the_cut_or_tau_is_pi_q6():
    for pair in PAIRS:
        metric, start = unit_momenta(pair, 6, 50)
        closed = axisymmetric_metric(*pair)
        eta, size = closed.eta, np.linalg.norm(start, axis=-1)
        cut, axial = closed.cut_time(start), start[:, 2] / size
        tau = cut * size / (2.0 * pair[0])
        zero = np.cos(tau) * np.cos(tau * eta * axial) - axial * np.sin(tau) * np.sin(tau * eta * axial)
        assert np.abs(np.where(tau < np.pi * (1.0 - 1e-12), zero, 0.0)).max() < 1e-14
        # A zero of q_0 is a half turn.
        half = tau < np.pi * (1.0 - 1e-12)
        if half.any():
            angle = so3.angle(metric.attitude(start[half], cut[half]))
            assert_within(angle, np.pi, 1e-7)
        # No zero comes earlier.
        for part in np.linspace(0.05, 0.999, 40):
            t = part * tau
            assert np.all(np.cos(t) * np.cos(t * eta * axial) - axial * np.sin(t) * np.sin(t * eta * axial) > 0.0)


@pytest.mark.parametrize("pair", SOME, ids=IDS)
def test_distances_against_all_geodesics_q6(pair):
    closed = axisymmetric_metric(*pair)
    attitudes = Rotation.random(6, random_state=7).as_matrix()
    distance = closed.distance(attitudes)
    expected = [all_ways(pair, so3.quat_from_matrix(attitude)) for attitude in attitudes]
    assert_within(distance, expected, 1e-11)
    momentum = closed.shortest_momentum(attitudes)
    metric = left_invariant_metric([pair[0], pair[0], pair[1]])
    assert_within(metric.attitude(momentum), attitudes, 1e-12)
    np.testing.assert_allclose(metric.speed(momentum), distance, rtol=1e-14)
    assert distance.max() <= closed.diameter


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
def test_a_geodesic_before_its_cut_is_found_again_q6(pair):
    metric, start = unit_momenta(pair, 8, 200)
    closed = axisymmetric_metric(*pair)
    time = np.random.default_rng(9).uniform(0.001, 0.999, 200) * closed.cut_time(start)
    momentum = closed.shortest_momentum(metric.attitude(start, time))
    size = time * np.linalg.norm(start, axis=-1)
    assert (np.linalg.norm(momentum - time[:, None] * start, axis=-1) / (1.0 + size)).max() < 1e-10
    back = closed.distance(so3.transpose(metric.attitude(start, time)))
    np.testing.assert_allclose(back, time, rtol=1e-11)


@pytest.mark.parametrize("pair", SOME, ids=IDS)
def test_the_diameter_is_the_largest_distance_q6(pair):
    closed = axisymmetric_metric(*pair)

    def nearness(x):
        """By the angles of the swing and of the twist, in which the distance is even and periodic."""
        swing = so3.exp(np.array([x[0], 0.0, 0.0]))
        return -float(closed.distance(swing @ so3.exp(np.array([0.0, 0.0, x[1]]))))

    grid = [(a, b) for a in np.linspace(0.05, np.pi - 0.01, 10) for b in np.linspace(0.02, np.pi - 0.01, 10)]
    best = min(grid, key=nearness)
    simplex = [best, np.add(best, [-0.1, 0.0]), np.add(best, [0.0, -0.1])]
    options = {"xatol": 1e-9, "fatol": 1e-13, "initial_simplex": simplex}
    found = minimize(nearness, best, method="Nelder-Mead", options=options)
    assert -found.fun <= closed.diameter + 1e-12
    assert -found.fun > closed.diameter - 1e-6


@pytest.mark.parametrize("pair", SOME, ids=IDS)
def test_distance_to_turns_about_the_axis_q6(pair):
    closed = axisymmetric_metric(*pair)
    alpha = np.linspace(0.01, np.pi, 12)
    turns = so3.exp(alpha[:, None] * np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(closed.distance(turns), closed.distance_to_turn(alpha), rtol=1e-13)
    # The general branch next to the axis, where all geodesics are looked through.
    for angle, turn in zip(alpha, turns):
        aside = so3.quat_from_matrix(turn @ so3.exp(np.array([1e-6, 0.0, 0.0])))
        assert abs(all_ways(pair, aside) - closed.distance_to_turn(angle)) < 2e-6 * np.sqrt(pair[0])
    np.testing.assert_allclose(closed.distance_to_turn(-alpha), closed.distance_to_turn(alpha), rtol=1e-15)
    np.testing.assert_allclose(closed.distance_to_turn(alpha + 2.0 * np.pi), closed.distance_to_turn(alpha), rtol=1e-13)
    # Either way it is a geodesic's length.
    metric = left_invariant_metric([pair[0], pair[0], pair[1]])
    assert_within(metric.attitude(closed.shortest_momentum(turns)), turns, 1e-12)


def test_sub_riemannian_distance_to_turns_about_the_axis_is_a_limit_q5():
    alpha = np.linspace(0.05, np.pi, 9)
    closed = axisymmetric_metric(1.0, np.inf)
    expected = np.sqrt(alpha * (4.0 * np.pi - alpha))
    np.testing.assert_allclose(closed.distance_to_turn(alpha), expected, rtol=1e-14)
    assert abs(closed.diameter - np.pi * np.sqrt(3.0)) < 1e-15
    # d^2 is short of its limit by the integral of p_3^2 over a unit of time, (2 pi - alpha)^2, times 1/I_3.
    for moment in (1e3, 1e5, 1e7):
        gap = (expected**2 - axisymmetric_metric(1.0, moment).distance_to_turn(alpha) ** 2) * moment
        np.testing.assert_allclose(gap, (2.0 * np.pi - alpha) ** 2, rtol=2.0 / moment + 1e-14 * moment)
        assert abs(axisymmetric_metric(1.0, moment).diameter - closed.diameter) < 2.0 / moment


def test_small_turns_about_the_axis_keep_their_digits():
    closed = axisymmetric_metric(1.0, np.inf)
    for alpha in (1e-12, 1e-6, 1e-3):
        turn = so3.exp(np.array([0.0, 0.0, alpha]))
        assert abs(closed.distance(turn) / np.sqrt(alpha * (4.0 * np.pi - alpha)) - 1.0) < 1e-10
    assert closed.distance(np.eye(3)) == 0.0
    np.testing.assert_array_equal(closed.shortest_momentum(np.eye(3)), np.zeros(3))


def test_half_turns_and_batches():
    closed = axisymmetric_metric(1.0, 1.4)
    halves = so3.exp(np.pi * np.eye(3))
    np.testing.assert_allclose(closed.distance(halves), np.pi * np.sqrt([1.0, 1.0, 1.4]), rtol=1e-14)
    batch = np.broadcast_to(halves, (2, 3, 3, 3))
    assert closed.distance(batch).shape == (2, 3)
    assert closed.shortest_momentum(batch).shape == (2, 3, 3)
    momenta = np.random.default_rng(10).normal(size=(4, 5, 3))
    for name in ("conjugate_time", "cut_time", "cut_time_on_su2"):
        values = getattr(closed, name)(momenta)
        assert values.shape == (4, 5)
        assert np.shape(getattr(closed, name)(momenta[0, 0])) == ()
        assert abs(getattr(closed, name)(momenta[1, 2]) - values[1, 2]) < 1e-14


def test_refusals():
    for first, third in ((0.0, 1.0), (-1.0, 1.0), (np.inf, 1.0), (1.0, 0.0), (1.0, np.nan), (1.0, "x"), (None, 1.0)):
        with pytest.raises(ShapeError, match="moments"):
            axisymmetric_metric(first, third)
    flat, usual = axisymmetric_metric(1.0, np.inf), axisymmetric_metric(1.0, 2.0)
    for name in ("conjugate_time", "cut_time", "cut_time_on_su2"):
        with pytest.raises(ShapeError, match="forbidden"):
            getattr(flat, name)([0.0, 0.0, 1.0])
        with pytest.raises(ShapeError, match="moves"):
            getattr(usual, name)([0.0, 0.0, 0.0])
    with pytest.raises(ShapeError):
        usual.distance(2.0 * np.eye(3))
    with pytest.raises(ShapeError):
        usual.distance_to_turn(np.nan)
