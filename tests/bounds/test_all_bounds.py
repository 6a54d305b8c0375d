"""Bounds and certificates: they hold for every motion, the corrected formulas hold and the printed ones do not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import shapephase as sp
from shapephase.bounds import (
    Bound,
    PhaseBounds,
    arc_length_bounds,
    azimuth_bounds,
    azimuth_rate,
    bounds,
    crown_region,
    dynamic_phase_bounds,
    dynamic_phase_bounds_by_extremes,
    energy_along,
    energy_bounds,
    homoclinic_energy,
    loop_phase_bounds,
    regime_certificate,
    return_time_bounds,
    solid_angle_bounds,
)
from support.independent import cross
from support.random_deformations import KINDS, random_case

QUICK, FULL = 20, 2000
ALLOWED = 1e-8


def moments_in_time(function, duration):
    """A deformation with fixed axes, no internal momentum and these moments: times (N,) -> three arrays."""
    return sp.prescribed(
        lambda t: np.stack(np.broadcast_arrays(*function(t), t)[:3], -1)[:, :, None] * np.eye(3), None, duration
    )


def raw_momentum(moments, start, times):
    """Euler's equations with moments in time, by SciPy alone."""

    def rate(t, pi):
        return cross(pi, pi / np.array([float(m) for m in moments(t)]))

    flow = solve_ivp(rate, (times[0], times[-1]), start, t_eval=times, rtol=1e-12, atol=1e-13, method="DOP853")
    return flow.y.T


def check_case(seed):
    """Every bound, the crown and the certificate of one random deformation, on a stretch of it for odd seeds."""
    kind, deformation, momentum = random_case(seed)
    motion = sp.reconstruct(deformation, momentum)
    interval = (0.15 * motion.duration, 0.6 * motion.duration) if seed % 2 else (0.0, motion.duration)
    found = bounds(motion, interval)
    for bound in found:
        assert np.isfinite([bound.limit, bound.value]).all(), (kind, seed, bound)
        assert bound.slack >= -ALLOWED * max(abs(bound.limit), abs(bound.value)), (kind, seed, bound)
    start = motion.attitude(interval[0])
    certificate = regime_certificate(deformation, momentum, start, interval)
    momenta = motion.body_momentum(np.linspace(*interval, 300))
    assert np.all(crown_region(deformation, momentum, start, interval).contains(momenta)), (kind, seed)
    if certificate.certain:
        assert np.all(momenta @ certificate.axis > 0.0), (kind, seed)
        check_sense(certificate, deformation, motion, interval)
    return certificate.certain


def check_sense(certificate, deformation, motion, interval):
    """Above the frozen separatrix about the axis of the smallest moment, below it about that of the largest."""
    times = np.linspace(*interval, 50)
    difference = energy_along(motion, times) - homoclinic_energy(
        deformation, times, float(np.linalg.norm(motion.momentum))
    )
    assert np.all(difference > 0.0) if certificate.regime == "about axis 1" else np.all(difference < 0.0)


def test_bounds_hold_in_random_deformations_e9():
    certain = [check_case(seed) for seed in range(QUICK)]
    assert 0.1 < np.mean(certain) < 0.9


@pytest.mark.full
def test_bounds_hold_in_two_thousand_random_deformations_e9():
    certain = [check_case(seed) for seed in range(QUICK, QUICK + FULL)]
    assert 0.1 < np.mean(certain) < 0.9


def test_every_kind_of_bound_is_given_e9():
    """The enumeration has each of them, those about an axis where one is certain and Pi has gone round."""
    seed = KINDS.index("circling") + len(KINDS)
    names = {bound.name for bound in bounds(sp.reconstruct(*random_case(seed)[1:]))}
    for name in ("moment 3", "energy,", "energy rate", "homoclinic", "arc length, by energy", "distance", "azimuth"):
        assert any(found.startswith(name) for found in names), name
    for name in ("dynamic phase, most, by extremes", "return time, by latitude", "cosine to the axis, least"):
        assert name in names


def test_energy_bounds_are_sharp_where_the_energy_is_known_e9():
    """Homothety: E = E_0/a(t)^2 whatever Pi does, and both bounds find that to the resolution."""
    base = np.array([1.0, 1.5, 2.2])
    deformation = sp.prescribed(lambda t: ((1.0 + 0.3 * np.sin(t)) ** 2)[:, None, None] * np.diag(base), None, 3.0)
    found = energy_bounds(deformation, [0.3, 0.9, 0.4], resolution=5e-4)
    start = 0.5 * np.sum(np.array([0.3, 0.9, 0.4]) ** 2 / base)
    middle = 0.5 * (found.enclosure.edges[:-1] + found.enclosure.edges[1:])
    exact = start / (1.0 + 0.3 * np.sin(middle)) ** 2
    assert np.all((found.lower <= exact) & (exact <= found.upper))
    assert np.all(found.upper - found.lower <= 0.03 * exact)


def test_energy_bounds_reach_what_some_motion_does_e9():
    """No bound of the rate at the start can be sharper than the most over all directions with that energy."""
    deformation = moments_in_time(lambda t: (1.0 + 0.1 * t, 1.5 - 0.2 * t, 2.0 + 0.3 * t), 1.0)
    momentum = np.array([0.5, 0.6, 0.7])
    found = energy_bounds(deformation, momentum, resolution=2e-4)
    size = np.linalg.norm(momentum)
    inverse, rate = 1.0 / np.array([1.0, 1.5, 2.0]), -np.array([0.1, -0.2, 0.3]) / np.array([1.0, 1.5, 2.0]) ** 2
    e = np.sum(momentum**2 * inverse) / size**2
    # x = (x1, x2, 1 - x1 - x2) on the line of this energy; the rate is linear in it, so extremes are at its ends.
    ends = []
    for i, j in ((0, 1), (1, 2), (0, 2)):
        share = (e - inverse[j]) / (inverse[i] - inverse[j])
        if 0.0 <= share <= 1.0:
            ends.append(0.5 * size**2 * (share * rate[i] + (1.0 - share) * rate[j]))
    assert found.rate_upper[0] == pytest.approx(max(ends), abs=2e-3)
    assert found.rate_lower[0] == pytest.approx(min(ends), abs=2e-3)
    assert found.rate_upper[0] >= max(ends) - 1e-12
    assert found.rate_lower[0] <= min(ends) + 1e-12


def test_energy_rate_by_internal_momentum_is_reached_e3():
    """An axisymmetric body whose w is along u x I^-1 u: dE/dt = (Pi x I^-1 Pi).w, all that the bound allows."""
    moments, drift = np.array([1.0, 2.0, 2.0]), np.array([0.0, 0.0, -0.3])
    deformation = sp.prescribed(
        lambda t: np.broadcast_to(np.diag(moments), (len(t), 3, 3)),
        lambda t: np.broadcast_to(moments * drift, (len(t), 3)),
        1e-6,
    )
    found = energy_bounds(deformation, [0.6, 0.8, 0.0])
    exact = np.cross([0.6, 0.8, 0.0], np.array([0.6, 0.8, 0.0]) / moments) @ drift
    assert found.rate_upper[0] >= exact
    assert found.rate_upper[0] == pytest.approx(exact, rel=1e-4)
    assert found.rate_lower[0] == pytest.approx(-exact, rel=1e-4)


def test_regime_crossing_under_the_triangle_cap_e11():
    """I = (1, 1.05, I_3), I_3 from 1.06 to 2.05 in 0.2 s: E from 0.48189 to 0.33610 through 0.47619."""

    def moments(t):
        return 1.0, 1.05, 1.06 + 0.99 * t / 0.2

    deformation = moments_in_time(moments, 0.2)
    assert deformation.triangle_defect()[0] <= 0.0
    start = np.array([0.6, 0.0, 0.8])
    raw = raw_momentum(moments, start, np.array([0.0, 0.2]))
    energies = 0.5 * np.sum(raw**2 / np.array([moments(0.0), moments(0.2)]), axis=1)
    assert energies == pytest.approx([0.48189, 0.33610], abs=5e-6)
    motion = sp.reconstruct(deformation, start)
    assert energy_along(motion, [0.0, 0.2]) == pytest.approx(energies, rel=1e-9)
    assert homoclinic_energy(deformation, [0.0, 0.2], 1.0) == pytest.approx([0.47619, 0.47619], abs=5e-6)
    # No certificate over the whole; about axis 1 at first, about axis 3 at last.
    whole = regime_certificate(deformation, start)
    assert whole.regime == "may cross"
    assert not whole.certain
    assert whole.threshold == pytest.approx((0.5 / 1.05, 0.5 / 1.05), rel=1e-9)
    first = regime_certificate(deformation, start, interval=(0.0, 0.002))
    last = regime_certificate(deformation, start, motion.attitude(0.05), interval=(0.05, 0.2))
    assert (first.regime, last.regime) == ("about axis 1", "about axis 3")
    assert first.axis == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    assert last.axis == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_antenna_along_the_largest_axis_keeps_its_regime_e9():
    """F4 with growing I_3: the energy falls, and from the initial momentum alone the regime is certain for ever."""
    deformation = moments_in_time(lambda t: (1.0, 1.5, 2.0 + 0.4 * t / 20.0), 20.0)
    certificate = regime_certificate(deformation, [0.3, 0.2, 0.9])
    assert certificate.regime == "about axis 3"
    start = 0.5 * (0.09 / 1.0 + 0.04 / 1.5 + 0.81 / 2.0)
    assert certificate.energy[1] == pytest.approx(start, rel=1e-9)
    # The least margin is at the start, where the energy is E_initial.
    assert certificate.margin == pytest.approx(0.5 * 0.94 / 1.5 - start, rel=1e-8)
    assert "falls" in certificate.why
    motion = sp.reconstruct(deformation, [0.3, 0.2, 0.9])
    assert np.all(np.diff(energy_along(motion, np.linspace(0.0, 20.0, 400))) <= 0.0)


def test_antenna_along_the_smallest_axis_has_no_certificate_e9():
    """F3: growing I_1 passes I_2; a motion about axis 1 leaves it, which no certificate denies."""
    deformation = moments_in_time(lambda t: (1.0 + 0.9 * t / 40.0, 1.5, 2.0), 40.0)
    momentum = np.array([0.8, 0.1, 0.6])
    assert regime_certificate(deformation, momentum, interval=(0.0, 2.0)).regime == "about axis 1"
    assert regime_certificate(deformation, momentum).regime == "may cross"
    momenta = sp.reconstruct(deformation, momentum).body_momentum(np.linspace(0.0, 40.0, 2000))
    assert momenta[:, 0].min() < 0.0


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_certificate_scales_with_the_units_e9(scale):
    deformation = sp.prescribed(lambda t: scale * (1.0 + 0.02 * t)[:, None, None] * np.diag([1.0, 1.5, 2.0]), None, 1.0)
    certificate = regime_certificate(deformation, np.array([0.3, 0.2, 0.9]) * scale)
    plain = moments_in_time(lambda t: tuple((1.0 + 0.02 * t) * m for m in (1.0, 1.5, 2.0)), 1.0)
    expected = regime_certificate(plain, [0.3, 0.2, 0.9])
    assert certificate.regime == expected.regime == "about axis 3"
    assert certificate.margin / scale == pytest.approx(expected.margin, rel=1e-6)


def test_without_momentum_nothing_is_certain_e9():
    deformation = moments_in_time(lambda t: (1.0, 1.5, 2.0 + t), 1.0)
    certificate = regime_certificate(deformation, np.zeros(3))
    assert certificate.regime == "may cross"
    assert "no angular momentum" in certificate.why
    assert dynamic_phase_bounds(certificate.bounds) == PhaseBounds(lower=0.0, upper=0.0)
    assert return_time_bounds(certificate).by_azimuth == 0.0
    with pytest.raises(sp.ShapePhaseError, match="momentum"):
        bounds(sp.reconstruct(deformation, np.zeros(3)))


@pytest.mark.parametrize(
    ("momentum", "attitude"),
    [(np.ones((2, 3)), None), (np.ones(3), np.stack([np.eye(3)] * 2)), ([1.0, np.nan, 0.0], None), ([1.0, 2.0], None)],
)
def test_only_one_motion_at_a_time_e9(momentum, attitude):
    with pytest.raises(sp.ShapePhaseError):
        energy_bounds(sp.rigid(np.eye(3), 1.0), momentum, attitude)


def test_batches_of_motions_are_refused_e9():
    with pytest.raises(sp.ShapePhaseError, match="batch"):
        bounds(sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), np.ones((2, 3))))


@pytest.mark.parametrize("factor", [1.05, 0.95])
def test_thresholds_need_their_half_c_e5(factor):
    """A rigid body with E = 1.05 l^2/(2 I_2) keeps Pi_1 > 0, with 0.95 it does not; printed l^2/I_2 says otherwise."""
    inverse = 1.0 / np.array([1.0, 1.6, 2.2])
    goal = factor * 0.5 * inverse[1]
    share = (2.0 * goal - inverse[2]) / (inverse[0] - inverse[2])
    start = np.sqrt([share, 0.0, 1.0 - share])
    times = np.linspace(0.0, 120.0, 6001)
    momenta = raw_momentum(lambda _: 1.0 / inverse, start, times)
    kept = bool(np.all(momenta[:, 0] > 0.0))
    assert kept == (factor > 1.0)
    certificate = regime_certificate(sp.rigid(np.diag(1.0 / inverse), 120.0), start)
    assert certificate.regime == ("about axis 1" if factor > 1.0 else "about axis 3")
    # As printed both would have E_max < l^2/I_2 and circle axis 3, which the first does not.
    assert goal < inverse[1]
    if factor > 1.0:
        assert momenta[:, 2].min() < -0.1


def quadrature(function, duration):
    return quad(function, 0.0, duration, epsabs=1e-12, epsrel=1e-11, limit=200)[0]


def test_arc_length_bounds_against_quadrature_e6():
    """General, without internal momentum and ordered: the integrals themselves, to the resolution, and from above."""
    _, deformation, momentum = random_case(KINDS.index("turned frame, internal momentum"))
    size = np.linalg.norm(momentum)

    def least(t):
        return 1.0 / np.linalg.eigvalsh(deformation.inertia(t))[0]

    def internal(t):
        return np.linalg.norm(deformation.internal_momentum(t))

    exact = size * quadrature(lambda t: least(t) * (size + internal(t)), deformation.duration)
    found = arc_length_bounds(energy_bounds(deformation, momentum, resolution=5e-4)).general
    assert exact <= found <= exact * 1.01
    still = moments_in_time(lambda t: (1.0 + 0.3 * np.sin(t), 1.5, 2.0), 2.0)
    exact = quadrature(lambda t: 1.0 / (1.0 + 0.3 * np.sin(t)), 2.0) * 0.94
    found = arc_length_bounds(energy_bounds(still, [0.3, 0.2, 0.9], resolution=5e-4))
    assert exact <= found.general <= exact * 1.002
    assert found.by_drift == pytest.approx(found.general, rel=1e-12)


def test_arc_length_by_energy_is_reached_e6():
    """An axisymmetric rigid body circles with |u x I^-1 u| at the bound: there it is sharp."""
    top = sp.rigid(np.diag([1.0, 2.0, 2.0]), 3.0)
    momentum = np.array([0.6, 0.8, 0.0])
    exact = 0.6 * 0.8 * (1.0 - 0.5) * 3.0
    found = arc_length_bounds(energy_bounds(top, momentum))
    assert found.by_energy == pytest.approx(exact, rel=1e-9)
    assert found.by_energy >= exact
    sphere = arc_length_bounds(energy_bounds(sp.rigid(2.0 * np.eye(3), 3.0), momentum))
    assert sphere.by_energy < 1e-6 < sphere.general


def test_norm_of_the_inverse_is_the_least_moment_e7(rng):
    """|I^-1 v| <= |v|/I_1, reached along the axis of the smallest moment."""
    _, deformation, _ = random_case(KINDS.index("turned frame"))
    found = energy_bounds(deformation, [0.0, 0.0, 1.0]).enclosure
    times = np.linspace(0.0, deformation.duration, 300)
    cell = np.clip(np.searchsorted(found.edges, times, side="right") - 1, 0, len(found.widths) - 1)
    top = found.eigenvalues[1][cell, 2]
    inverse = np.linalg.inv(deformation.inertia(times))
    vectors = rng.normal(size=(300, 3))
    sizes = np.linalg.norm(np.einsum("nij,nj->ni", inverse, vectors), axis=1) / np.linalg.norm(vectors, axis=1)
    assert np.all(sizes <= top)
    assert top == pytest.approx(np.linalg.norm(inverse, ord=2, axis=(1, 2)), rel=2e-2)


def test_crown_region_e8(rng):
    """The region of a rigid body is its polhode, on the start's side alone; a deforming body's holds its motion."""
    rigid = sp.rigid(np.diag([1.0, 1.5, 2.0]), 30.0)
    momentum = np.array([0.3, 0.2, 0.9])
    region = crown_region(rigid, momentum)
    momenta = sp.reconstruct(rigid, momentum, tolerance=1e-12).body_momentum(np.linspace(0.0, 30.0, 200))
    # The region is a curve here: it holds the directions to rounding, and none beside them.
    assert np.mean(region.contains(raw_scaled(momenta, momentum))) > 0.9
    assert not np.any(region.contains(-momenta))
    assert not np.any(region.contains(momenta + 1e-4 * np.array([0.0, 0.0, 1.0])))
    assert np.all(region.contains(np.zeros((4, 3))) == np.zeros(4, dtype=bool))
    low, high = region.cosines
    cosines = momenta[:, 2] / np.linalg.norm(momentum)
    assert low == pytest.approx(cosines.min(), abs=1e-3)
    assert high == pytest.approx(cosines.max(), abs=1e-3)
    deforming = moments_in_time(lambda t: (1.0, 1.5, 2.0 + 0.1 * np.sin(t)), 10.0)
    crown = crown_region(deforming, momentum)
    moved = sp.reconstruct(deforming, momentum).body_momentum(np.linspace(0.0, 10.0, 500))
    assert np.all(crown.contains(moved))
    directions = rng.normal(size=(20000, 3))
    assert 0.01 < np.mean(crown.contains(directions)) < 0.3
    assert np.all(directions[crown.contains(directions)][:, 2] > 0.0)


def test_the_region_as_printed_is_wider_e8(rng):
    """R of the paper, from its definition: E_t between its extremes of the whole interval, at some time."""
    deforming = moments_in_time(lambda t: (1.0, 1.5, 2.0 + 0.1 * np.sin(t)), 10.0)
    momentum = np.array([0.3, 0.2, 0.9])
    crown = crown_region(deforming, momentum)
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    printed, sharper = crown.contains_as_printed(directions), crown.contains(directions)
    assert not np.any(sharper & ~printed)
    assert np.mean(printed) > 1.1 * np.mean(sharper)
    moments = np.linalg.inv(deforming.inertia(np.linspace(0.0, 10.0, 2001)))
    energies = 0.5 * momentum @ momentum * np.einsum("ni,tij,nj->nt", directions, moments, directions)
    low, high = crown.certificate.energy
    # The component of the start: the threshold l^2/(2 I_2) is above E_max, so R does not reach the plane Pi_3 = 0.
    assert high < momentum @ momentum / 3.0
    expected = (energies.max(axis=1) >= low) & (energies.min(axis=1) <= high) & (directions[:, 2] > 0.0)
    assert np.mean(printed != expected) < 2e-3
    assert np.all(printed[expected])
    # Where neither side is certain R goes round the sphere, with the momentum and its opposite.
    passing = crown_region(moments_in_time(lambda t: (1.0, 1.5 + 0.4 * np.sin(t), 2.0), 10.0), [0.3, 0.9, 0.3])
    found = passing.contains_as_printed(directions)
    assert np.array_equal(found, passing.contains_as_printed(-directions))
    assert np.array_equal(found, passing.contains_as_printed(3.0 * directions))
    # A rigid body's energy does not change: both are its polhode.
    assert not crown_region(sp.rigid(np.diag([1.0, 1.5, 2.0]), 3.0), momentum).contains_as_printed(np.zeros(3))


def raw_scaled(momenta, momentum):
    """Onto the exact ellipsoid of the rigid body above, along the third axis."""
    goal = np.sum(momentum**2 / [1.0, 1.5, 2.0])
    first = momenta[:, :2]
    size = momentum @ momentum
    # Two linear equations for the squares of the first and third components, the second kept.
    second = first[:, 1] ** 2
    x1 = ((goal - second / 1.5) - (size - second) / 2.0) / (1.0 - 0.5)
    x3 = size - second - x1
    return np.stack([np.copysign(np.sqrt(x1), first[:, 0]), first[:, 1], np.sqrt(x3)], axis=1)


def azimuth_by_differences(moments, start, axis):
    """The azimuth's rate from Euler's equations by differences of the raw flow."""
    second, third = (axis + 1) % 3, (axis + 2) % 3
    step = 1e-3
    momenta = raw_momentum(lambda _: moments, start, np.array([0.0, step, 2.0 * step, 3.0 * step, 4.0 * step]))
    angle = np.unwrap(np.arctan2(momenta[:, third], momenta[:, second]))
    return momenta[2], (angle[0] - 8.0 * angle[1] + 8.0 * angle[3] - angle[4]) / (12.0 * step)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_azimuth_rate_e10(axis, rng):
    for _ in range(5):
        moments, start = np.sort(rng.uniform(1.0, 2.0, 3)), rng.normal(size=3)
        momentum, rate = azimuth_by_differences(moments, start, axis)
        assert azimuth_rate(moments, momentum, axis) == pytest.approx(rate, abs=1e-8)


def test_azimuth_rate_needs_the_momentum_c_e4():
    """Printed (14) lacks l: true over printed is l exactly."""
    moments, start = np.array([1.0, 1.5, 2.0]), 2.7 * np.array([0.6, 0.48, 0.64])
    momentum, rate = azimuth_by_differences(moments, start, 0)
    size = np.linalg.norm(momentum)
    cosine = momentum[0] / size
    sine = momentum[2] / np.hypot(momentum[1], momentum[2])
    first, second, third = 1.0 / moments
    printed = cosine * (second - first + (third - second) * sine**2)
    assert rate / printed == pytest.approx(size, rel=1e-8)
    assert abs(printed - rate) > 0.5 * abs(rate)
    assert azimuth_rate(moments, momentum) == pytest.approx(rate, rel=1e-8)


@pytest.mark.parametrize(("start", "regime", "sense"), [((0.9, 0.4, 0.1), 1, -1.0), ((0.1, 0.4, 0.9), 3, 1.0)])
def test_azimuth_is_monotone_e10(start, regime, sense):
    """Clockwise about axis 1, counterclockwise about axis 3, in all certified motions with fixed axes."""

    def moments(t):
        return 1.0 + 0.01 * np.sin(t), 1.5 + 0.01 * np.cos(t), 2.0 + 0.01 * np.sin(2.0 * t)

    certificate = regime_certificate(moments_in_time(moments, 8.0), start)
    assert certificate.regime == f"about axis {regime}"
    found = azimuth_bounds(certificate)
    assert found.monotone
    assert found.sense == sense
    times = np.linspace(0.0, 8.0, 2000)
    momenta = raw_momentum(moments, np.array(start), times)
    axis = regime - 1
    angle = np.unwrap(np.arctan2(momenta[:, (axis + 2) % 3], momenta[:, (axis + 1) % 3]))
    assert np.all(sense * np.diff(angle) > 0.0)
    rates = sense * np.gradient(angle, times)[1:-1]
    cell = np.clip(np.searchsorted(certificate.bounds.enclosure.edges, times[1:-1]) - 1, 0, len(found.fast) - 1)
    assert np.all(rates <= found.fast[cell] + 1e-4)
    assert np.all(rates >= found.slow[cell] - 1e-4)


def test_azimuth_arguments_are_checked_e10():
    for moments, momentum, axis in (
        ([1.0, 2.0, 3.0], [1.0, 0.0, 0.0], 0),
        ([1.0, 2.0, 3.0], [1.0, 1.0, 0.0], 3),
        ([0.0, 2.0, 3.0], [1.0, 1.0, 0.0], 0),
    ):
        with pytest.raises(sp.ShapePhaseError):
            azimuth_rate(moments, momentum, axis)
    crossing = regime_certificate(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.0, 1.0, 0.0])
    for function in (azimuth_bounds, solid_angle_bounds):
        with pytest.raises(sp.ShapePhaseError, match="certain"):
            function(crossing)


def test_a_momentum_that_closes_returns_before_the_misread_bound_c_e10():
    """I_1 is six times its least value for a moment, inside of the turn; Pi comes back to its very start.

    The pulse is even about the instant at which Pi crosses the plane of axes 1 and 2: the way back mirrors the way out.
    """
    centre = 5.282198725746

    def moments(t):
        pulse = np.exp(-4.0 * (np.asarray(t) - centre) ** 2)
        return 1.0 + 5.0 * pulse, 6.5 + 0.0 * pulse, 7.0 + 0.0 * pulse

    start = np.array([0.8, 0.6, 0.0])
    times = np.linspace(0.0, 2.0 * centre, 1001)
    momenta = raw_momentum(moments, start, times)
    assert momenta[-1] == pytest.approx(start, abs=1e-9)
    assert np.linalg.norm(momenta[30:-30] - start, axis=1).min() > 0.1
    # The condition of case 1, corrected by C-E5, holds, and Pi goes once round axis 1.
    assert (0.5 * momenta**2 / np.stack(moments(times), axis=-1)).sum(axis=1).min() > 0.5 / 6.5
    angle = -np.unwrap(np.arctan2(momenta[:, 2], momenta[:, 1]))
    assert angle[-1] == pytest.approx(2.0 * np.pi, abs=1e-8)
    radius = 2.0 * np.pi * np.linalg.norm(np.cross(start, [1.0, 0.0, 0.0]))
    assert (round(radius, 2), round(times[-1], 2), round(6.0 * radius, 2)) == (3.77, 10.56, 22.62)
    assert radius < times[-1] < 6.0 * radius


def test_return_time_with_the_other_extreme_is_false_c_e10():
    """Remark 4.1 read with 1/max I_1 claims more time than Pi takes; with 1/min I_1 it holds, the sharper one also.

    I_1 goes from small to large after the turn: then the largest I_1 says nothing of the turn.
    """

    def moments(t):
        grown = 0.5 * (1.0 + np.tanh(4.0 * (np.asarray(t) - 16.0)))
        return 1.0 + 5.0 * grown, 6.5 + 0.0 * grown, 7.0 + 0.0 * grown

    deformation = moments_in_time(moments, 20.0)
    start = np.array([0.8, 0.6, 0.0])
    times = np.linspace(0.0, 20.0, 8001)
    momenta = raw_momentum(moments, start, times)
    angle = -np.unwrap(np.arctan2(momenta[:, 2], momenta[:, 1]))
    turn = float(np.interp(2.0 * np.pi, angle, times))
    misread = 2.0 * np.pi * 0.6 * 6.0
    assert turn < 0.6 * misread
    least = 2.0 * np.pi * 0.6 * 1.0
    assert turn > least
    # The certificate holds up to the turn, and gives both bounds in the order they are stated to have.
    certificate = regime_certificate(deformation, start, interval=(0.0, 12.0))
    found = return_time_bounds(certificate)
    assert certificate.regime == "about axis 1"
    assert found.by_latitude == pytest.approx(least, rel=1e-2)
    assert found.by_inertia == pytest.approx(2.0 * np.pi / (1.0 - 1.0 / 7.0), rel=1e-2)
    assert found.by_latitude <= found.by_inertia <= found.by_azimuth <= turn <= found.latest


def test_return_time_of_a_rigid_body_e12():
    """The period of Euler's top is above every bound, and near the sharpest for a nearly axisymmetric one."""
    momentum = np.array([0.9, 0.3, 0.3])
    for moments, tight in (((1.0, 1.5, 2.0), 0.6), ((1.0, 1.999, 2.0), 0.99)):
        body = sp.rigid(np.diag(moments), 60.0)
        times = np.linspace(0.0, 60.0, 20001)
        momenta = raw_momentum(lambda _, m=moments: m, momentum, times)
        angle = -np.unwrap(np.arctan2(momenta[:, 2], momenta[:, 1]))
        period = float(np.interp(2.0 * np.pi, angle - angle[0], times))
        found = return_time_bounds(regime_certificate(body, momentum))
        assert 0.0 < found.by_latitude <= found.by_inertia <= found.by_azimuth <= period <= found.latest
        assert found.by_azimuth > tight * period


def test_return_time_about_the_largest_axis_and_no_return_within_e12():
    """The analogue about axis 3 has the least moment in it, not the largest; a short interval sees no return."""
    momentum = np.array([0.1, 0.1, 0.99])
    body = sp.rigid(np.diag([1.0, 1.1, 2.0]), 40.0)
    size = np.linalg.norm(momentum)
    found = return_time_bounds(regime_certificate(body, momentum))
    assert found.by_latitude == pytest.approx(2.0 * np.pi * np.hypot(0.1, 0.1) / size**2, rel=1e-6)
    assert found.within
    short = return_time_bounds(regime_certificate(body, momentum, interval=(0.0, 1.0)))
    assert not short.within
    assert short.by_azimuth == pytest.approx(1.0, rel=1e-12)
    assert short.latest == np.inf


def closing_motion(regime):
    """A deforming body whose Pi has gone once round its axis at the end, nearly closed: with the interval cut there."""

    def moments(t):
        return 1.0 + 0.004 * np.sin(t), 1.5 + 0.0 * t, 2.0 + 0.004 * np.cos(t)

    start = np.array([0.93, 0.3, 0.1]) if regime == 1 else np.array([0.1, 0.3, 0.93])
    axis = regime - 1
    times = np.linspace(0.0, 40.0, 40001)
    momenta = raw_momentum(moments, start, times)
    angle = np.unwrap(np.arctan2(momenta[:, (axis + 2) % 3], momenta[:, (axis + 1) % 3]))
    duration = float(np.interp(2.0 * np.pi, np.abs(angle - angle[0]), times))
    return moments_in_time(moments, duration), start


@pytest.mark.parametrize("regime", [1, 3])
def test_two_sided_bounds_of_the_phase_e13(regime):
    """(15) with the signed area, by extremes and by energy in time; the loop's own bounds from before the motion."""
    deformation, start = closing_motion(regime)
    motion = sp.reconstruct(deformation, start)
    phase = sp.split(motion, gauge="base")
    assert phase.momentum_gap < 0.05
    certificate = regime_certificate(deformation, start)
    assert certificate.regime == f"about axis {regime}"
    by_extremes = dynamic_phase_bounds_by_extremes(certificate.bounds)
    by_energy = dynamic_phase_bounds(certificate.bounds)
    assert by_extremes.lower <= by_energy.lower <= phase.dynamic_phase <= by_energy.upper <= by_extremes.upper
    signed = motion.solid_angle(motion.duration)
    for found in (by_extremes, by_energy):
        loop = found.of_loop(signed)
        assert loop.lower <= phase.dynamic_phase - signed <= loop.upper
        assert loop.width == pytest.approx(found.width, rel=1e-9)
    area, whole = solid_angle_bounds(certificate), loop_phase_bounds(certificate)
    # The gap leaves a sliver that the bounds of a closed curve do not know.
    assert area.lower - 0.05 <= signed <= area.upper + 0.05
    assert whole.lower - 0.05 <= phase.dynamic_phase - signed <= whole.upper + 0.05
    assert area.width < 1.5


@pytest.mark.parametrize("regime", [1, 3])
def test_signs_of_the_area_c_e6(regime):
    """The phase read off the attitude is theta_D - Lambda with the signed area; the printed + sign fails about axis 3.

    Both curves go round less than half of the sphere, for which + is printed: right about axis 1, which Pi goes round
    clockwise, and wrong about axis 3.
    """
    deformation, start = closing_motion(regime)
    motion = sp.reconstruct(deformation, start, tolerance=1e-11)
    times = np.linspace(0.0, motion.duration, 4001)
    directions = motion.body_momentum(times) / np.linalg.norm(start)
    axis = directions[:, regime - 1]
    angle = np.unwrap(np.arctan2(directions[:, (regime + 1) % 3], directions[:, regime % 3]))
    area = np.sum((1.0 - 0.5 * (axis[1:] + axis[:-1])) * np.diff(angle))
    assert abs(area) < 2.0 * np.pi
    turned = motion.final_attitude
    mu = start / np.linalg.norm(start)
    seen = 2.0 * np.arctan2(
        np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) @ mu,
        1.0 + np.trace(turned),
    )
    dynamic = motion.dynamic_phase(motion.duration)

    def off(phase):
        return abs((phase - seen + np.pi) % (2.0 * np.pi) - np.pi)

    assert off(dynamic - area) < 0.05
    printed = off(dynamic + abs(area))
    assert (printed < 0.05) == (regime == 1)


def test_phase_bounds_are_informative_below_a_full_turn_e14():
    """Width 2 (E_max - E_min) dt/l against 2 pi: short intervals are informative, long ones are not."""
    deformation = moments_in_time(lambda t: (1.0 + 0.2 * np.sin(t), 1.5 + 0.2 * np.cos(t), 2.0 + 0.1 * t / 40.0), 40.0)
    momentum = np.array([0.5, 0.6, 0.7])
    size = np.linalg.norm(momentum)
    for end, informative in ((0.5, True), (40.0, False)):
        found = energy_bounds(deformation, momentum, interval=(0.0, end))
        width = 2.0 * (found.greatest - found.least) * end / size
        phase = dynamic_phase_bounds_by_extremes(found)
        assert phase.width == pytest.approx(width, rel=1e-9)
        assert phase.is_informative is informative
        assert bool(width < 2.0 * np.pi) is informative


def test_scale_of_slow_deformations_c_e12():
    """E_initial - E_min is l^2 |d(1/I_3)/dt| dt/2 at most: small against E where the rate is against E/(l^2 dt).

    The printed scale I^2 E/dt has other units: doubling the unit of mass changes whether a deformation counts as slow,
    which the corrected scale does not.
    """

    def judged(unit):
        third, rate, duration = 2.0 * unit, 0.004 * unit, 10.0
        momentum = unit * np.array([0.1, 0.1, 0.99])
        deformation = moments_in_time(lambda t: (unit, 1.5 * unit, third + rate * t), duration)
        found = energy_bounds(deformation, momentum)
        size = np.linalg.norm(momentum)
        fall = rate / third**2
        start = float(found.initial.mean())
        assert (start - found.least) / start <= 0.5 * fall * size**2 * duration / start * 1.001
        return fall / (start / (size**2 * duration)), fall / (unit**2 * start / duration)

    (ratio, printed), (again, rescaled) = judged(1.0), judged(1000.0)
    assert again == pytest.approx(ratio, rel=1e-9)
    assert rescaled != pytest.approx(printed, rel=0.9)
    assert ratio < 0.05


def test_slack_and_tightness_of_a_bound():
    above, below = Bound("x", True, 2.0, 1.5), Bound("y", False, 1.0, 1.5)
    assert above.slack == below.slack == 0.5
    assert above.tightness == 0.75
    assert below.tightness == pytest.approx(2.0 / 3.0)
    assert dataclasses.replace(above, value=2.5).slack == -0.5
    assert dataclasses.replace(above, limit=-1.0).tightness == 0.0
    assert Bound("z", True, 0.0, 0.0).tightness == 1.0
