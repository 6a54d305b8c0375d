"""Poinsot's rolling ellipsoid and the cones against the integrated equations, chords, brute force and 50 digits."""

from __future__ import annotations

import itertools
from functools import lru_cache

import mpmath
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from shapephase.errors import ShapeError
from shapephase.rigid_body import Closure, EulerTop, Poinsot, cones
from support.independent import rigid_motion
from support.long_runs import full_but

TILT = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
SEPARATRIX = ((3.0, 6.0, 8.0), (0.5, 0.3, 1.0))
"""2 E I2 = L² exactly, in doubles."""

PRINCIPAL = {
    "largest": ((3.0, 2.0, 1.0), (1.4, -0.5, 0.6)),
    "smallest": ((3.0, 2.0, 1.0), (0.5, 0.6, -1.4)),
    "other order": ((1.3, 0.9, 2.4), (-0.4, 1.1, 0.7)),
    "next to a steady rotation": ((1.0, 2.0, 3.0), (1e-4, 2e-4, -1.0)),
    "next to the separatrix": ((3.0, 6.0, 8.0), (0.5, 0.3, 1.001)),
    "across the separatrix": ((3.0, 6.0, 8.0), (-0.501, 0.3, 1.0)),
    "separatrix": SEPARATRIX,
    "oblate": ((1.0, 1.0, 1.7), (0.3, 0.5, -0.8)),
    "prolate": ((2.0, 0.6, 2.0), (0.3, 0.5, 0.8)),
    "more than a body": ((1.0, 1.2, 9.0), (0.6, -0.5, 0.7)),
}
TENSORS = {
    "turned": (TILT @ np.diag([1.1, 2.3, 2.9]) @ TILT.T, np.array([0.2, 1.0, -0.9])),
    "turned, smallest": (TILT @ np.diag([0.4, 2.3, 2.5]) @ TILT.T, np.array([1.0, -0.4, 0.3])),
}
NAMES = [*PRINCIPAL, *TENSORS]
ROLLING = [n for n in NAMES if n not in ("oblate", "prolate")]
PERIODIC = [n for n in NAMES if n != "separatrix"]
TWO_CIRCLES = [n for n in ROLLING if n != "separatrix"]
POINTS = {
    "largest": ((1.0, 2.0, 3.0), (0.0, 0.0, -1.5)),
    "intermediate": ((1.0, 2.0, 3.0), (0.0, 1.5, 0.0)),
    "smallest": ((1.0, 2.0, 3.0), (1.5, 0.0, 0.0)),
    "symmetry axis": ((1.0, 1.0, 3.0), (0.0, 0.0, 2.0)),
    "equator": ((1.0, 1.0, 3.0), (0.6, 0.8, 0.0)),
    "spherical": ((2.0, 2.0, 2.0), (0.3, 0.5, -0.8)),
}


@lru_cache
def top_of(name):
    attitude = Rotation.from_rotvec([-0.9, 0.2, 1.4]).as_matrix()
    if name in TENSORS:
        return EulerTop(*TENSORS[name], attitude)
    return EulerTop.principal(*PRINCIPAL[name], attitude)


@lru_cache
def integrated(name):
    """Times, attitudes and body rates of the raw equations."""
    top = top_of(name)
    times = np.linspace(0.0, min(2.2 * top.period, 60.0), 241)
    body = top.initial_attitude.T @ top.momentum
    momenta, attitudes = rigid_motion(top.inertia, body, times, top.initial_attitude)
    return times, attitudes, momenta @ np.linalg.inv(top.inertia)


def carried(matrix, vector):
    return np.einsum("...ij,...j->...i", matrix, vector)


def twice_energy(name):
    top = top_of(name)
    body = top.initial_attitude.T @ top.momentum
    return body @ np.linalg.solve(top.inertia, body)


def chords(curve, start, end):
    """Length of a smooth curve by the sum of its chords, extrapolated to chords of no length (Romberg)."""
    table = []
    for level in range(6):
        points = curve(np.linspace(start, end, 600 * 2**level + 1))
        table.append(np.linalg.norm(np.diff(points, axis=0), axis=-1).sum())
    for order in range(1, 6):
        table = [fine + (fine - coarse) / (4.0**order - 1.0) for coarse, fine in itertools.pairwise(table)]
    return table[-1]


@pytest.mark.parametrize("name", full_but(NAMES, *NAMES[::2]))
def test_polhode_and_herpolhode_are_the_integrated_rates_i5(name):
    times, attitudes, rates = integrated(name)
    poinsot = Poinsot(top_of(name))
    assert poinsot.polhode(times) == pytest.approx(rates, abs=3e-11)
    assert poinsot.herpolhode(times) == pytest.approx(carried(attitudes, rates), abs=3e-11)


@pytest.mark.parametrize("name", NAMES)
def test_the_herpolhode_lies_in_the_invariable_plane_i1_i2(name):
    poinsot, momentum, energy = Poinsot(top_of(name)), top_of(name).momentum, twice_energy(name)
    herpolhode = poinsot.herpolhode(np.linspace(-30.0, 30.0, 200))
    assert herpolhode @ momentum == pytest.approx(np.full(200, energy), rel=1e-13)
    assert poinsot.distance == pytest.approx(energy / np.linalg.norm(momentum), rel=1e-14)
    assert herpolhode @ poinsot.normal == pytest.approx(np.full(200, poinsot.distance), rel=1e-13)
    assert np.cross(poinsot.normal, momentum) == pytest.approx(np.zeros(3), abs=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_the_ellipsoid_touches_two_planes_at_plus_and_minus_omega_i3(name):
    times, attitudes, rates = integrated(name)
    top, poinsot, energy = top_of(name), Poinsot(top_of(name)), twice_energy(name)
    spatial = attitudes @ top.inertia @ np.swapaxes(attitudes, -1, -2)
    assert poinsot.ellipsoid(times) == pytest.approx(spatial, abs=1e-10)
    for side in (1, -1):
        contact = poinsot.contact(times, side)
        assert contact == pytest.approx(side * carried(attitudes, rates), abs=1e-10)
        gradient = carried(poinsot.ellipsoid(times), contact)
        assert np.cross(gradient, top.momentum) == pytest.approx(np.zeros(gradient.shape), abs=1e-12)
        assert np.sum(contact * gradient, axis=-1) == pytest.approx(np.full(len(times), energy), rel=1e-12)
    # All of the ellipsoid is on one side of the plane, and only the contact on it.
    sphere = np.random.default_rng(5).normal(size=(4000, 3))
    sphere /= np.linalg.norm(sphere, axis=-1, keepdims=True)
    ellipsoid = (sphere * poinsot.semi_axes) @ (attitudes[7] @ top.axes).T
    assert np.einsum("ni,ij,nj->n", ellipsoid, spatial[7], ellipsoid) == pytest.approx(np.full(4000, energy), rel=1e-12)
    heights = ellipsoid @ poinsot.normal
    assert heights.max() <= poinsot.distance * (1.0 + 1e-12)
    assert heights.max() > 0.99 * poinsot.distance


@pytest.mark.parametrize("name", NAMES)
def test_the_material_point_in_contact_stands_still_i4(name):
    poinsot = Poinsot(top_of(name))
    times = np.linspace(-7.0, 9.0, 50)
    assert poinsot.slip(times) == pytest.approx(np.zeros((50, 3)), abs=1e-14)
    # A point of the ellipsoid is where the attitude takes it: the one in contact at t has no velocity then.
    step = 1e-4
    point = np.swapaxes(poinsot.top.attitude(times), -1, -2) @ poinsot.contact(times)[..., None]
    moved = [(poinsot.top.attitude(times + s) @ point)[..., 0] for s in (-step, step)]
    assert (moved[1] - moved[0]) / (2.0 * step) == pytest.approx(np.zeros((50, 3)), abs=3e-8)
    # It would not be so about another point: the mirror image's velocity is that of a turn about the same axis.
    other = np.cross(poinsot.herpolhode(times), poinsot.herpolhode(times + 0.5))
    assert np.abs(other).max() > 1e-6


@pytest.mark.parametrize("name", ROLLING)
def test_polhode_and_herpolhode_have_equal_lengths_i4(name):
    poinsot = Poinsot(top_of(name))
    start, end = -0.3, min(0.45 * poinsot.top.period, 10.0)
    truth = chords(poinsot.polhode, start, end)
    assert chords(poinsot.herpolhode, start, end) == pytest.approx(truth, rel=1e-10)
    assert poinsot.polhode_length(start, end) == pytest.approx(truth, rel=1e-10)
    assert poinsot.herpolhode_length(start, end) == pytest.approx(truth, rel=1e-10)
    assert poinsot.polhode_length(end, start) == pytest.approx(-truth, rel=1e-10)
    assert poinsot.polhode_length(start, start) == 0.0


def test_length_of_a_polhode_with_nearly_a_corner_i4():
    """Moments far apart, as no body has them: Gauss's quadrature along the body's own axes, in many pieces."""
    top = EulerTop.principal((0.008304, 0.0155, 42.15), (1.363, -0.796, 0.043))

    def speed(u):
        omega = top.angular_velocity(u / top.rate)
        torque = np.cross(omega * top.inertia.diagonal(), omega)
        return np.linalg.norm(torque / top.inertia.diagonal(), axis=-1) / top.rate

    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(0.0, top.rate * top.period, 4001)
    half = 0.5 * np.diff(edges)[:, None]
    truth = np.sum(half * weights * speed(edges[:-1, None] + half * (1.0 + nodes)))
    assert Poinsot(top).length_per_period == pytest.approx(truth, rel=1e-10)
    assert Poinsot(top).herpolhode_length(0.0, top.period) == pytest.approx(truth, rel=1e-10)


@pytest.mark.parametrize("name", PERIODIC)
def test_length_over_many_periods_i4(name):
    poinsot, period = Poinsot(top_of(name)), top_of(name).period
    whole = chords(poinsot.polhode, 0.1, 0.1 + period)
    assert poinsot.length_per_period == pytest.approx(whole, rel=1e-9)
    part = chords(poinsot.herpolhode, 0.2, 0.2 + 0.3 * period)
    for length in (poinsot.polhode_length, poinsot.herpolhode_length):
        assert length(0.2, 0.2 + 7.3 * period) == pytest.approx(7.0 * whole + part, rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_polar_form_is_that_of_the_attitude_over_hundreds_of_periods_i5(name):
    poinsot = Poinsot(top_of(name))
    times = np.linspace(-300.0, 300.0, 999) * min(poinsot.top.period, 1.0)
    radius, angle = poinsot.herpolhode_radius(times), poinsot.herpolhode_angle(times)
    first, second = poinsot.plane_axes
    polar = (radius * np.cos(angle))[:, None] * first + (radius * np.sin(angle))[:, None] * second
    assert poinsot.distance * poinsot.normal + polar == pytest.approx(poinsot.herpolhode(times), abs=1e-12)
    assert poinsot.herpolhode_angle(0.0) == 0.0
    assert np.shape(poinsot.herpolhode_angle(0.3)) == np.shape(poinsot.herpolhode_radius(0.3)) == ()
    assert poinsot.herpolhode_angle(times.reshape(3, 333)) == pytest.approx(angle.reshape(3, 333), abs=0.0)


@pytest.mark.parametrize("name", TWO_CIRCLES)
def test_the_herpolhode_touches_both_circles_of_its_annulus_i5(name):
    poinsot = Poinsot(top_of(name))
    inner, outer = poinsot.annulus
    times = np.linspace(0.0, poinsot.top.period, 20001)
    foot = poinsot.distance * poinsot.normal
    radius = np.linalg.norm(poinsot.herpolhode(times) - foot, axis=-1)
    assert np.all(radius >= inner - 1e-13)
    assert np.all(radius <= outer + 1e-13)
    for circle, at in ((inner, np.argmin(radius[1:-1]) + 1), (outer, np.argmax(radius[1:-1]) + 1)):
        left, middle, right = radius[at - 1 : at + 2] ** 2
        assert middle - (left - right) ** 2 / (8.0 * (left + right - 2.0 * middle)) == pytest.approx(
            circle**2, rel=1e-8
        )
    assert 0.0 < inner < outer


@pytest.mark.parametrize("offset", [1e-3, -1e-3, 1e-7, -1e-7, 2e-14, -2e-14])
def test_the_inner_circle_keeps_its_digits_next_to_the_separatrix_i5(offset):
    moments, momentum = SEPARATRIX
    momentum = (momentum[0], momentum[1], momentum[2] + offset)
    inner, outer = Poinsot(EulerTop.principal(moments, momentum)).annulus
    with mpmath.workdps(60):
        i, p = [mpmath.mpf(x) for x in moments], [mpmath.mpf(x) for x in momentum]
        square, energy = sum(x * x for x in p), sum(x * x / y for x, y in zip(p, i))
        radii = []
        for plane in ((1, 0), (1, 2), (0, 2)):
            # Where the polhode crosses a coordinate plane: two squares from two equations.
            a, b = plane
            u = (energy - square / i[b]) / (1 / i[a] - 1 / i[b])
            v = square - u
            if u >= 0 and v >= 0:
                radii.append(mpmath.sqrt(u / i[a] ** 2 + v / i[b] ** 2 - energy**2 / square))
        radii = sorted(float(r) for r in radii)
    assert (inner, outer) == pytest.approx(tuple(radii), rel=1e-13, abs=0.0)


def test_reference_value_i5():
    """theory.md, section 6: I = (3, 2, 1), |Pi| = 1.7, a = 1.3."""
    square, double_energy = 1.7**2, 1.7**2 / 1.3
    third = (double_energy - square / 3.0) / (1.0 - 1.0 / 3.0)
    poinsot = Poinsot(EulerTop.principal((3.0, 2.0, 1.0), (np.sqrt(square - third), 0.0, np.sqrt(third))))
    assert poinsot.angle_per_period == pytest.approx(5.99603257834978, abs=1e-12)


@pytest.mark.parametrize("name", PERIODIC)
def test_two_frequencies_i5(name):
    """In axes that turn at the second, the herpolhode has the period of the first."""
    times, attitudes, rates = integrated(name)
    poinsot = Poinsot(top_of(name))
    first, second = poinsot.frequencies
    assert second / first == pytest.approx(poinsot.angle_per_period / (2.0 * np.pi), rel=1e-14)
    period = 2.0 * np.pi / first
    late = times[times >= period]
    turn = Rotation.from_rotvec(second * period * poinsot.normal).as_matrix()
    early = carried(poinsot.top.attitude(late - period), poinsot.polhode(late - period))
    assert carried(attitudes, rates)[times >= period] == pytest.approx(early @ turn.T, abs=1e-10)


@pytest.mark.parametrize(("turns", "lobes"), full_but([(2, 3), (3, 5), (4, 7), (7, 10)], (2, 3), (7, 10)))
def test_a_rational_ratio_closes_the_curve_i5(turns, lobes):
    def poinsot_of(third):
        return Poinsot(EulerTop.principal((1.0, 2.0, 2.5), (1.0, 0.0, third)))

    def excess(third):
        return poinsot_of(third).angle_per_period / (4.0 * np.pi) - turns / lobes

    grid = np.linspace(0.05, 8.0, 120)
    values = np.array([excess(third) for third in grid])
    at = np.flatnonzero((values[:-1] * values[1:] < 0.0) & (np.abs(np.diff(values)) < 0.05))[0]
    poinsot = poinsot_of(brentq(excess, grid[at], grid[at + 1], xtol=1e-15, rtol=1e-15))
    closure = poinsot.closure(1e-9)
    assert closure is not None
    assert (closure.turns, closure.lobes) == (turns, lobes)
    assert closure.gap < 1e-9
    times, length = np.linspace(0.0, 3.0, 40), 0.5 * lobes * poinsot.top.period
    assert poinsot.herpolhode(times + length) == pytest.approx(poinsot.herpolhode(times), abs=1e-9)
    for fewer in range(1, lobes):
        apart = poinsot.herpolhode(times + 0.5 * fewer * poinsot.top.period) - poinsot.herpolhode(times)
        assert np.abs(apart).max() > 1e-3


def test_closure_is_the_first_within_the_tolerance_i5():
    random = np.random.default_rng(11)
    for _ in range(40):
        top = EulerTop.principal(np.exp(random.uniform(-1.0, 1.0, 3)), random.normal(size=3))
        per_lobe = 0.5 * top.precession_per_period
        for tolerance in (1e-1, 1e-3):
            gaps = np.abs((np.arange(1, 20001) * per_lobe + np.pi) % (2.0 * np.pi) - np.pi)
            first = int(np.argmax(gaps <= tolerance)) + 1
            closure = Poinsot(top).closure(tolerance, most_lobes=20000)
            assert closure is not None
            assert closure.lobes == first
            assert closure.gap == pytest.approx(gaps[first - 1], abs=1e-9)
            assert closure.turns == round(first * per_lobe / (2.0 * np.pi))
            assert Poinsot(top).closure(tolerance, most_lobes=first) == closure
            assert first == 1 or Poinsot(top).closure(tolerance, most_lobes=first - 1) is None


@pytest.mark.parametrize("name", ["oblate", "prolate"])
def test_the_herpolhode_of_an_axisymmetric_body_is_a_circle_i5(name):
    poinsot = Poinsot(top_of(name))
    inner, outer = poinsot.annulus
    assert inner == outer > 0.0
    times = np.linspace(-20.0, 20.0, 77)
    assert poinsot.herpolhode_radius(times) == pytest.approx(np.full(77, outer), rel=1e-13)
    rate = poinsot.top.magnitude / np.partition(poinsot.top.moments, 1)[1]
    assert poinsot.herpolhode_angle(times) == pytest.approx(rate * times, abs=1e-13)
    assert poinsot.closure() == Closure(turns=1, lobes=0, gap=0.0)


def test_on_the_separatrix_the_herpolhode_spirals_in_i5():
    top = top_of("separatrix")
    poinsot = Poinsot(top)
    inner, outer = poinsot.annulus
    assert inner == 0.0
    crest = -top.orbit.phase / top.rate
    assert poinsot.herpolhode_radius(crest) == pytest.approx(outer, rel=1e-14)
    times = crest + np.array([-4000.0, -2000.0, -50.0, 50.0, 2000.0, 4000.0])
    radius, angle = poinsot.herpolhode_radius(times), poinsot.herpolhode_angle(times)
    assert radius[[2, 3]] * np.cosh(50.0 * top.rate) == pytest.approx(np.full(2, outer), rel=1e-10)
    assert np.all(radius[[0, -1]] < 1e-30)
    # Far out it turns about mu at the rate of the intermediate axis.
    assert np.diff(angle)[[0, -1]] == pytest.approx(np.full(2, 2000.0 * top.magnitude / 6.0), rel=1e-12)
    assert poinsot.angle_per_period == np.inf
    assert poinsot.closure() is None
    assert poinsot.frequencies == pytest.approx((0.0, top.magnitude / 6.0), rel=1e-14)
    # The whole curve is finitely long, and the limit of half a period's on either side.
    assert poinsot.length_per_period == pytest.approx(poinsot.polhode_length(-1e4, 1e4), rel=1e-13)
    assert poinsot.length_per_period == pytest.approx(chords(poinsot.polhode, crest - 500.0, crest + 500.0), rel=1e-8)
    for third in (1.0 + 1e-13, 1.0 - 1e-13):
        near = Poinsot(EulerTop.principal(SEPARATRIX[0], (0.5, 0.3, third)))
        assert 0.5 * near.length_per_period == pytest.approx(poinsot.length_per_period, rel=1e-6)


def test_where_the_separatrix_underflows_nothing_is_nan_i5():
    poinsot = Poinsot(top_of("separatrix"))
    times = np.array([-1e6, -1e5, -1e4, 1e4, 1e5, 1e6])
    radius, angle = poinsot.herpolhode_radius(times), poinsot.herpolhode_angle(times)
    assert np.all(np.isfinite(radius))
    assert angle[-1] - angle[-2] == pytest.approx(9e5 * poinsot.top.magnitude / 6.0, rel=1e-10)
    assert angle[-2] - angle[-3] == pytest.approx(9e4 * poinsot.top.magnitude / 6.0, rel=1e-10)
    # Omega keeps its direction against the axis, also where both distances from the foot are zero.
    near, far = 100.0 / poinsot.top.rate, 1000.0 / poinsot.top.rate
    for sign in (-1.0, 1.0):
        advance = poinsot.herpolhode_angle(sign * far) - poinsot.herpolhode_angle(sign * near)
        assert advance == pytest.approx(sign * (far - near) * poinsot.top.magnitude / 6.0, abs=1e-8)
    assert poinsot.polhode_length(-1e12, 1e12) == pytest.approx(poinsot.length_per_period, rel=1e-13)


@pytest.mark.parametrize("name", POINTS)
def test_a_steady_rotation_is_a_point_i5(name):
    top = EulerTop.principal(*POINTS[name], Rotation.from_rotvec([0.1, 0.5, 2.0]).as_matrix())
    poinsot = Poinsot(top)
    times = np.linspace(-3.0, 5.0, 9)
    body = np.array(POINTS[name][1]) / np.array(POINTS[name][0])
    assert poinsot.polhode(times) == pytest.approx(np.broadcast_to(body, (9, 3)), abs=1e-15)
    foot = poinsot.distance * poinsot.normal
    assert poinsot.herpolhode(times) == pytest.approx(np.broadcast_to(foot, (9, 3)), abs=1e-14)
    assert poinsot.contact(times) == pytest.approx(np.broadcast_to(foot, (9, 3)), abs=1e-14)
    assert np.linalg.norm(poinsot.slip(times)) < 1e-14
    assert poinsot.annulus == (0.0, 0.0)
    for zero in (poinsot.herpolhode_radius(times), poinsot.herpolhode_angle(times)):
        assert zero.shape == (9,)
        assert not zero.any()
    assert poinsot.polhode_length(0.0, 3.0) == poinsot.herpolhode_length(0.0, 3.0) == poinsot.length_per_period == 0.0
    assert poinsot.angle_per_period == 0.0
    assert poinsot.closure() == Closure(turns=0, lobes=0, gap=0.0)
    basis = np.vstack([poinsot.plane_axes, poinsot.normal])
    assert basis @ basis.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(basis) == pytest.approx(1.0)
    assert np.all(np.isfinite(poinsot.frequencies))


@pytest.mark.parametrize("size", [1e-60, 1e-139])
def test_right_next_to_a_steady_rotation_i5(size):
    """Radius and angle are those of the small ellipse: Pi' = Pi x Omega, linear in the deviation."""
    poinsot = Poinsot(EulerTop.principal((1.0, 2.0, 3.0), (size, 0.0, 1.0)))
    inner, outer = poinsot.annulus
    assert outer / size == pytest.approx(2.0 / 3.0, rel=1e-14)
    assert inner / size == pytest.approx(np.sqrt(2.0 / 3.0 / 6.0), rel=1e-14)
    assert poinsot.herpolhode_radius(0.0) / size == pytest.approx(2.0 / 3.0, rel=1e-14)
    assert poinsot.plane_axes[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    quarter = 0.25 * poinsot.top.period
    assert poinsot.herpolhode_radius(quarter) / inner == pytest.approx(1.0, rel=1e-13)
    assert poinsot.herpolhode_angle(quarter) == pytest.approx(0.25 * poinsot.angle_per_period, rel=1e-13)


def test_right_next_to_a_steady_rotation_of_a_nearly_spherical_body_i5():
    """The deviation's square would be below the least number with all its digits."""
    moments = (1.0 - 2.0**-53, 1.0, 1.0 + 2.0**-52)
    first, second = Poinsot(EulerTop.principal(moments, (2.1e-140, 0.0, 1.0))).plane_axes
    assert first == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert second == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_scales_of_units():
    """A unit of angular velocity is a unit: nothing overflows in between, and results only change by it."""
    one = Poinsot(EulerTop.principal((1.0, 2.0, 3.0), (0.4, 0.5, 0.6)))
    for scale in (2.0**-500, 2.0**500):
        other = Poinsot(EulerTop.principal((1.0, 2.0, 3.0), np.multiply(scale, (0.4, 0.5, 0.6))))
        assert np.divide(other.annulus, scale) == pytest.approx(np.array(one.annulus), rel=1e-13)
        assert other.distance / scale == pytest.approx(one.distance, rel=1e-13)
        assert other.semi_axes / scale == pytest.approx(one.semi_axes, rel=1e-13)
        assert other.herpolhode_angle(0.7 / scale) == pytest.approx(one.herpolhode_angle(0.7), rel=1e-13)


def test_what_cannot_be_is_refused():
    top = top_of("largest")
    with pytest.raises(ShapeError, match="momentum"):
        Poinsot(EulerTop.principal((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)))
    with pytest.raises(ShapeError, match="side"):
        Poinsot(top).contact(0.0, 2)
    for wrong in ({"tolerance": 0.0}, {"tolerance": np.nan}, {"most_lobes": 0}):
        with pytest.raises(ShapeError, match=next(iter(wrong))):
            Poinsot(top).closure(**wrong)
    for word, call in (
        ("end", lambda: Poinsot(top).polhode_length(0.0, [1.0, 2.0])),
        ("t:", lambda: Poinsot(top).herpolhode_angle([0.0, np.nan])),
        ("equal", lambda: cones(top)),
        ("equal", lambda: cones(EulerTop.principal(*POINTS["spherical"]))),
        ("equal", lambda: cones(EulerTop.principal((1.0, 1.0, 2.0), (0.0, 0.0, 0.0)))),
    ):
        with pytest.raises(ShapeError, match=word):
            call()


SYMMETRIC = {
    "oblate": ((1.0, 1.0, 1.7), (0.3, 0.5, 0.8), 2),
    "oblate, below": ((1.0, 1.0, 1.7), (0.3, 0.5, -0.8), 2),
    "prolate": ((2.0, 2.0, 0.6), (0.3, 0.5, 0.8), 2),
    "prolate, other axis": ((2.0, 0.6, 2.0), (0.3, -0.5, 0.8), 1),
    "oblate, other axis": ((1.1, 0.7, 0.7), (-0.9, 0.5, 0.8), 0),
    "flat": ((1.0, 1.0, 2.0), (1.0, 0.2, 0.1), 2),
    "rod": ((1.0, 1.0, 1e-3), (0.1, 0.2, 0.01), 2),
}


@pytest.mark.parametrize("name", SYMMETRIC)
@pytest.mark.parametrize("turned", [False, True])
def test_cones_roll_on_each_other_h2(name, turned):
    moments, momentum, index = SYMMETRIC[name]
    top = EulerTop.principal(moments, momentum, TILT)
    if turned:
        top = EulerTop(TILT.T @ np.diag(moments) @ TILT, np.array(momentum), TILT)
        momentum = TILT @ TILT.T @ momentum
    result = cones(top)
    body_axis = (TILT.T if turned else np.eye(3))[:, index]
    body_axis = np.copysign(1.0, body_axis @ (TILT.T @ top.momentum)) * body_axis
    oblate = moments[index] == max(moments)
    assert result.space_inside_body == oblate
    assert (result.spin_rate > 0.0) == oblate

    times = np.linspace(0.0, 5.0, 21)
    omega, attitude = top.angular_velocity(times), top.attitude(times)
    normal = top.momentum / np.linalg.norm(top.momentum)
    spatial = carried(attitude, omega)

    def angle(a, b):
        return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))

    assert angle(omega, body_axis) == pytest.approx(np.full(21, result.body_half_angle), abs=1e-13)
    assert angle(spatial, normal) == pytest.approx(np.full(21, result.space_half_angle), abs=1e-13)
    between = angle(normal, attitude @ body_axis)
    sign = -1.0 if oblate else 1.0
    assert result.body_half_angle + sign * result.space_half_angle == pytest.approx(between[0], abs=1e-13)

    # No generator of the space cone is inside the body cone (prolate), or none is outside (oblate).
    axis = attitude[4] @ body_axis
    about = Rotation.from_rotvec(np.linspace(0.0, 2.0 * np.pi, 100)[:, None] * normal).as_matrix()
    reach = angle(about @ spatial[4], axis)
    if oblate:
        assert reach.max() <= result.body_half_angle + 1e-12
    else:
        assert reach.min() >= result.body_half_angle - 1e-12

    # The symmetry axis precesses about mu, and the momentum goes round the symmetry axis in the body.
    precession = Rotation.from_rotvec(result.precession_rate * times[:, None] * normal).as_matrix()
    assert attitude @ body_axis == pytest.approx(precession @ attitude[0] @ body_axis, abs=1e-12)
    spin = Rotation.from_rotvec(result.spin_rate * times[:, None] * body_axis).as_matrix()
    assert top.body_momentum(times) == pytest.approx(carried(spin, top.body_momentum(0.0)), abs=1e-12)


@pytest.mark.parametrize("symmetry", [0.5, 3.0])
def test_cones_of_steady_rotations_h2(symmetry):
    along = cones(EulerTop.principal((1.0, 1.0, symmetry), (0.0, 0.0, -2.0)))
    assert (along.body_half_angle, along.space_half_angle) == (0.0, 0.0)
    assert along.spin_rate == pytest.approx(2.0 * (1.0 - 1.0 / symmetry))
    across = cones(EulerTop.principal((1.0, 1.0, symmetry), (0.6, 0.8, 0.0)))
    assert across.body_half_angle == pytest.approx(np.pi / 2.0)
    assert (across.space_half_angle, across.spin_rate, across.precession_rate) == (0.0, 0.0, 1.0)


def test_moments_equal_to_rounding_count_as_equal_h2():
    momentum = (0.3, 0.5, 0.8)
    equal, nearly = (cones(EulerTop.principal((1.0, second, 2.0), momentum)) for second in (1.0, 1.0 + 1e-14))
    assert nearly.body_half_angle == pytest.approx(equal.body_half_angle, abs=1e-13)
    assert nearly.spin_rate == pytest.approx(equal.spin_rate, abs=1e-13)
    with pytest.raises(ShapeError, match="equal"):
        cones(EulerTop.principal((1.0, 1.0 + 1e-9, 2.0), momentum))


def test_the_sign_of_lambda_does_not_decide_how_the_cones_roll_m_e17():
    """lambda = -a1 Pi3 changes its sign with Pi3; the cones stay: outside each other with I1 = I2 > I3, else inside."""
    for moments in ((2.0, 2.0, 0.7), (2.0, 2.0, 3.1)):
        for side in (1.0, -1.0):
            momentum = np.array([0.6, 0.0, 0.8 * side])
            printed = -(moments[1] - moments[2]) / (moments[1] * moments[2]) * momentum[2]
            omega, axis = momentum / moments, np.array([0.0, 0.0, side])
            # By coplanarity alone: the momentum lies between axis and omega, or omega between axis and momentum.
            to_omega, to_momentum = (np.arccos(v @ axis / np.linalg.norm(v)) for v in (omega, momentum))
            assert cones(EulerTop.principal(moments, momentum)).space_inside_body == (to_omega > to_momentum)
            assert (to_omega > to_momentum) == (moments[2] > moments[0])
            assert (printed > 0.0) == ((moments[2] > moments[0]) == (side > 0.0))


def test_cone_formulas_as_restored_m_e6():
    """The scan loses the indices and a square; a3 = 0 for a1, a2 and I1 for I3 are its other readings, and fail."""
    random = np.random.default_rng(3)
    for _ in range(20):
        first, third = random.uniform(0.5, 3.0, 2)
        momentum = random.normal(size=3)
        a1, a2, a3 = (first - third) / (first * third), (third - first) / (first * third), 0.0
        omega = momentum / [first, first, third]
        energy, axis = momentum @ omega, np.eye(3)[2]
        square = energy / first - a2 * momentum[2] ** 2 / third
        assert omega @ omega == pytest.approx(square, rel=1e-13)
        assert abs(omega @ omega - (energy / first - a2 * momentum[2] ** 2 / first)) > 1e-6
        assert abs(omega @ omega - (energy / first - a3 * momentum[2] ** 2 / third)) > 1e-6
        assert omega == pytest.approx(momentum / first - a2 * momentum[2] * axis, rel=1e-13)
        side = np.copysign(1.0, momentum[2])
        result = cones(EulerTop.principal((first, first, third), momentum))
        assert result.spin_rate == pytest.approx(side * -a1 * momentum[2], rel=1e-13)
        assert abs(result.spin_rate - side * a1 * momentum[2]) > 1e-6
        assert result.precession_rate == pytest.approx(np.linalg.norm(momentum) / first, rel=1e-14)
        slope = np.cross(momentum, omega)
        assert slope == pytest.approx(-a1 * momentum[2] * np.cross(axis, momentum), abs=1e-13)
