"""Elliptic functions against 50 digits, with m = 1 − m1 formed there, and against their laws."""

from __future__ import annotations

from itertools import product

import mpmath
import numpy as np
import pytest

from shapephase import elliptic
from shapephase.errors import ShapeError
from support.long_runs import full_but

EPS = float(np.finfo(float).eps)
M1 = [1.0, 0.9, 0.5, 1e-3, 1e-8, 1e-15, 1e-30]
BELOW = np.nextafter(0.5 * np.pi, 0.0)
ABOVE = np.nextafter(0.5 * np.pi, 2.0)
AMPLITUDES = [1e-200, 1e-8, 0.1, 0.7, 1.2, 1.57, BELOW, 0.5 * np.pi, ABOVE, 2.0, 3.0, np.pi, 10.0, 1e3, -1.0, -4.0]
PAIRS = list(product([*M1, 0.0], AMPLITUDES))
CHARACTERISTICS = [-1e8, -100.0, -1.0, -0.3, -1e-10, 0.0, 0.3, 0.99, 1.0 - 1e-8, 1.0 - 2.0**-53]
ARGUMENTS = [0.01, 0.3, 0.5, 0.9, 0.999, 0.999999, 1.0, 1.000001, 1.001, 1.5, 2.0, 2.5, 3.7, 10.2, 50.0]


def mp(value):
    return mpmath.mpf(float(value))


def off(value, truth):
    """Relative error."""
    return abs(float(mpmath.mpf(float(value)) / truth - 1))


def arguments(m1):
    """From tiny to 50 quarter periods, both signs, both sides of the switch at 1e-9."""
    quarter = elliptic.complete_k(m1) if m1 else 7.0
    size = np.concatenate([[1e-300, 1e-12, 9.99e-10, 1.01e-9, 9e-8, 1e-5], np.multiply(ARGUMENTS, quarter)])
    return np.concatenate([-size, size])


@pytest.fixture(autouse=True)
def fifty_digits():
    with mpmath.workdps(50):
        yield


@pytest.mark.parametrize("m1", M1)
def test_complete_integrals(m1):
    m = 1 - mp(m1)
    assert off(elliptic.complete_k(m1), mpmath.ellipk(m)) < 1e-15
    assert off(elliptic.complete_e(m1), mpmath.ellipe(m)) < 1e-15
    for n in CHARACTERISTICS:
        assert off(elliptic.complete_pi(n, m1), mpmath.ellippi(mp(n), m)) < 1e-13


@pytest.mark.parametrize("m1", [1.0, 0.5, 1e-8, 1e-18, 1e-30, 0.0])
def test_the_argument_of_sn_and_cn(m1):
    for cosine in (1.0, 0.7, 1e-3, 1e-9, 1e-15, 1e-40):
        sine = np.sqrt(1.0 - cosine * cosine)
        square = mp(cosine) ** 2 / (mp(cosine) ** 2 + mp(sine) ** 2)
        truth = mpmath.sqrt(1 - square) * mpmath.elliprf(square, square + mp(m1) * (1 - square), 1)
        for factor in (1.0, 3.0, 1e-100):
            found = elliptic.argument_of(factor * sine, factor * cosine, m1)
            assert abs(float(mp(found) - truth)) < 2e-15 * max(1.0, float(truth))
            assert elliptic.argument_of(-factor * sine, factor * cosine, m1) == -found
        sn, cn, _, _ = elliptic.jacobi(found, m1)
        assert abs(float(sn) - sine) < 8.0 * EPS
        assert abs(float(cn) - cosine) < 8.0 * EPS
    assert elliptic.argument_of(1.0, 0.0, 0.0) == np.inf
    for sine, cosine in ((0.5, -0.1), (0.0, 0.0)):
        with pytest.raises(ShapeError, match="cn"):
            elliptic.argument_of(sine, cosine, m1)


@pytest.mark.parametrize("m1", full_but([1.0, 0.5, 1e-3, 1e-8, 1e-18, 1e-30], 1.0, 1e-3, 1e-30))
def test_pi_without_its_even_growth(m1):
    quarter = float(elliptic.complete_k(m1))
    for n in (-1e-12, -1e-3, -0.9, -1.0, -30.0, -1e6):
        with mpmath.workdps(90):
            m = 1 - mp(m1)
            whole = mpmath.ellippi(mp(n), m) - mpmath.ellipk(m) / (1 - mp(n))
            assert off(elliptic.complete_pi_excess(n, m1), whole) < 1e-13
            for part in (0.01, 0.3, 0.9, 0.99):
                sn, cn, dn, am, excess = elliptic.jacobi_and_pi_excess(n, part * quarter, m1)
                assert (sn, cn, dn, am) == elliptic.jacobi(part * quarter, m1)
                phi = mpmath.asin(mpmath.ellipfun("sn", mp(part * quarter), m=m))
                truth = mpmath.ellippi(mp(n), phi, m) - mp(part * quarter) / (1 - mp(n))
                assert abs(float(excess - truth)) < 3e-15 * max(1.0, quarter) * min(1.0, -n)
                later = elliptic.jacobi_and_pi_excess(n, (part + 6.0) * quarter, m1)[4]
                assert abs(float(later - truth - 6 * whole)) < 3e-14 * max(1.0, quarter) * min(1.0, -n)
                assert elliptic.jacobi_and_pi_excess(n, -part * quarter, m1)[4] == -excess
    assert elliptic.complete_pi_excess(0.0, m1) == 0.0
    for call in (lambda: elliptic.complete_pi_excess(0.1, m1), lambda: elliptic.jacobi_and_pi_excess(0.1, 1.0, m1)):
        with pytest.raises(ShapeError, match="n:"):
            call()


def test_complete_integrals_next_to_zero():
    assert elliptic.complete_k(0.0) == elliptic.complete_pi(-0.5, 0.0) == elliptic.complete_pi(0.5, 0.0) == np.inf
    assert elliptic.complete_e(0.0) == 1.0
    for m1 in (1e-59, 1e-61, 1e-300, 5e-324):
        quarter = mpmath.log(16 / mp(m1)) / 2
        assert off(elliptic.complete_k(m1), quarter) < 1e-15
        assert abs(elliptic.complete_e(m1) - 1.0) < 1e-15
        for n in (0.3, 1.0 - 1e-10, 1.0 - 2.0**-53, -0.3, -1e5):
            root = mpmath.sqrt(abs(mp(n)))
            bend = -root * mpmath.atanh(root) if n > 0 else root * mpmath.atan(root)
            assert off(elliptic.complete_pi(n, m1), (quarter + bend) / (1 - mp(n))) < 1e-14


@pytest.mark.parametrize("m1", M1)
def test_jacobi_functions(m1):
    m, quarter = 1 - mp(m1), mpmath.ellipk(1 - mp(m1))
    for u in arguments(m1):
        sn, cn, dn, am = elliptic.jacobi(u, m1)
        truth = [mpmath.ellipfun(kind, mp(u), m=m) for kind in ("sn", "cn", "dn")]
        allowed = 1e-15 * max(1.0, abs(u))
        assert abs(float(sn - truth[0])) < allowed
        assert abs(float(cn - truth[1])) < allowed
        assert off(dn, truth[2]) < 2.0 * allowed
        turns = mpmath.nint(mp(u) / (2 * quarter))
        sign = -1 if int(turns) % 2 else 1
        amplitude = turns * mpmath.pi + mpmath.atan2(sign * truth[0], sign * truth[1])
        assert abs(float(am - amplitude)) < 1e-15 * max(1.0, abs(u) + abs(am))
        if abs(u) < 1.0:
            assert off(sn, truth[0]) < 8.0 * EPS
            assert off(am, amplitude) < 8.0 * EPS
        if abs(u) < 0.99 * quarter:
            assert off(cn, truth[1]) < 1e-13


def test_jacobi_functions_in_the_limit():
    for u in [*arguments(0.0), 700.0, 1e9]:
        sn, cn, dn, am = elliptic.jacobi(u, 0.0)
        assert off(sn, mpmath.tanh(mp(u))) < 1e-15
        assert abs(mp(cn) - mpmath.sech(mp(u))) <= 1e-15 * mp(cn) + mp(1e-300)
        assert dn == cn
        assert off(am, 2 * mpmath.atan(mpmath.tanh(mp(u) / 2))) < 1e-15
    assert all(np.all(part == 0.0) for part in np.take(elliptic.jacobi(0.0, [0.0, 1e-9, 1.0]), [0, 3], axis=0))


def test_circular_functions_at_the_other_end(rng):
    u = rng.uniform(-30.0, 30.0, 1000)
    sn, cn, dn, am = elliptic.jacobi(u, 1.0)
    assert np.abs(sn - np.sin(u)).max() < 3e-14
    assert np.abs(cn - np.cos(u)).max() < 3e-14
    assert np.abs(dn - 1.0).max() < 1e-15
    assert np.abs(am - u).max() < 3e-14


@pytest.mark.parametrize(("m1", "phi"), full_but(PAIRS, *PAIRS[::7]))
def test_incomplete_integrals(m1, phi):
    m = 1 - mp(m1)
    assert off(elliptic.incomplete_e(phi, m1), mpmath.ellipe(mp(phi), m)) < 1e-14
    if m1 == 0.0 and abs(phi) >= 0.5 * np.pi:
        return
    assert off(elliptic.incomplete_f(phi, m1), mpmath.ellipf(mp(phi), m)) < 1e-14
    for n in CHARACTERISTICS:
        with mpmath.workdps(80):
            truth = mpmath.ellippi(mp(n), mp(phi), m)
        assert off(elliptic.incomplete_pi(n, phi, m1), truth) < 2e-14


@pytest.mark.parametrize("count", full_but([40, 90, 300], 40))
def test_third_kind_of_random_arguments(rng, count):
    """Among them n close to 1 with m1 and cos(phi) far below 1 − n, on both sides of the switch there."""
    far, m1 = count // 3, 10.0 ** rng.uniform(-30.0, 0.0, count)
    near = 0.5 * np.pi - 10.0 ** rng.uniform(-16.0, 0.0, count - far)
    phi = np.concatenate([rng.uniform(-9.0, 9.0, far), near])
    close, negative = 1.0 - 10.0 ** rng.uniform(-15.5, 0.0, count), -(10.0 ** rng.uniform(-9, 20, count))
    n = np.where(rng.random(count) < 0.7, close, negative)
    values = elliptic.incomplete_pi(n, phi, m1)
    for value, *given in zip(values, n, phi, m1):
        with mpmath.workdps(100):
            assert off(value, mpmath.ellippi(mp(given[0]), mp(given[1]), 1 - mp(given[2]))) < 1e-14


@pytest.mark.parametrize("m1", full_but([0.9, 1e-3, 1e-15, 1e-30], 0.9, 1e-30))
def test_third_kind_along_the_argument(m1):
    """The amplitude at 100 digits, whatever m1."""
    quarter = elliptic.complete_k(m1)
    for share in (1e-12, 0.2, 0.7, 0.999, 1.001, 1.7, 5.2, -3.4):
        u = share * quarter
        with mpmath.workdps(100):
            m = 1 - mp(m1)
            half = 2 * mpmath.ellipk(m)
            turns = mpmath.nint(mp(u) / half)
            rest = mp(u) - turns * half
            amplitude = mpmath.atan2(*(mpmath.ellipfun(kind, rest, m=m) for kind in ("sn", "cn")))
            for n in (-1e4, -1.0, -1e-3, 0.0):
                truth = mpmath.ellippi(mp(n), amplitude, m) + 2 * turns * mpmath.ellippi(mp(n), m)
                assert off(elliptic.jacobi_pi(n, u, m1), truth) < 1e-13


def test_third_kind_along_the_separatrix():
    for n in (-1e10, -5.0, -0.3, -1e-12, 0.0):
        for u in (1e-12, 0.3, 3.0, 40.0, 400.0, 1e5, -7.0):
            root = mpmath.sqrt(-mp(n))
            truth = (mp(u) + root * mpmath.atan(root * mpmath.tanh(mp(u)))) / (1 - mp(n))
            assert off(elliptic.jacobi_pi(n, u, 0.0), truth) < 5e-15


@pytest.mark.parametrize("m1", [*M1, 0.0])
def test_laws_of_the_functions(m1, rng):
    reach = 3.0 * min(elliptic.complete_k(m1), 7.0)
    u, v = rng.uniform(-reach, reach, (2, 500))
    (s1, c1, d1, a1), (s2, c2, d2, _), (s, c, d, _) = (elliptic.jacobi(w, m1) for w in (u, v, u + v))
    # Squares of numbers up to 1 that are right to a unit of rounding or two.
    assert np.abs(s1 * s1 + c1 * c1 - 1.0).max() < 8.0 * EPS
    assert np.abs(d1 * d1 - c1 * c1 - m1 * s1 * s1).max() < 8.0 * EPS
    assert np.abs(np.sin(a1) - s1).max() < 1e-14
    divisor = c1 * c1 + s1 * s1 * (c2 * c2 + m1 * s2 * s2)
    assert np.abs(s * divisor - (s1 * c2 * d2 + s2 * c1 * d1)).max() < 1e-13
    assert np.abs(c * divisor - (c1 * c2 - s1 * d1 * s2 * d2)).max() < 1e-13
    assert np.abs(d * divisor - (d1 * d2 - (1.0 - m1) * s1 * c1 * s2 * c2)).max() < 1e-13
    h = 1e-3
    points = np.stack([elliptic.jacobi(u + k * h, m1) for k in (-3, -2, -1, 1, 2, 3)])
    rates = np.tensordot([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0], points, axes=1) / (60.0 * h)
    expected = [c1 * d1, -s1 * d1, -(1.0 - m1) * s1 * c1, d1]
    assert np.abs(rates - expected).max() < 1e-11
    inside = d1 > 1e-3
    back = elliptic.incomplete_f(a1[inside], m1)
    allowed = 1e-14 * (1.0 + np.abs(a1[inside])) / d1[inside] + 1e-15 * np.abs(u[inside])
    assert np.all(np.abs(back - u[inside]) < allowed)


@pytest.mark.parametrize("m1", M1)
def test_periods(m1):
    quarter = elliptic.complete_k(m1)
    u = np.linspace(-0.9, 0.9, 7) * quarter
    sn, cn, dn, am = elliptic.jacobi(u, m1)
    for turns in (-4, -1, 1, 7):
        moved = elliptic.jacobi(u + 2.0 * turns * quarter, m1)
        sign, allowed = (-1.0) ** turns, 1e-14 * quarter
        assert np.abs(moved[0] - sign * sn).max() < allowed
        assert np.abs(moved[1] - sign * cn).max() < allowed
        assert np.abs(moved[2] / dn - 1.0).max() < 2.0 * allowed
        assert np.abs(moved[3] - am - turns * np.pi).max() < allowed
    u = np.linspace(-9.0, 9.0, 20001) * quarter
    steps = np.diff(elliptic.jacobi(u, m1)[3])
    assert steps.min() >= -1e-14
    assert steps.max() <= 1.01 * (u[1] - u[0])


@pytest.mark.parametrize("m1", [0.9, 0.5, 1e-3, 1e-8])
def test_relation_of_legendre(m1):
    k, e = elliptic.complete_k([m1, 1.0 - m1]), elliptic.complete_e([m1, 1.0 - m1])
    assert abs(e[0] * k[1] + e[1] * k[0] - k[0] * k[1] - 0.5 * np.pi) < 1e-14


@pytest.mark.parametrize("m1", [*M1, 0.0])
def test_integrals_are_odd_and_continuous(m1):
    phi = np.array([0.3, 1.1, 1.5])
    for integral in (
        lambda a: elliptic.incomplete_f(a, m1),
        lambda a: elliptic.incomplete_e(a, m1),
        lambda a: elliptic.incomplete_pi(0.4, a, m1),
        lambda a: elliptic.incomplete_pi(-2.0, a, m1),
    ):
        assert np.array_equal(integral(-phi), -integral(phi))
        assert integral(0.0) == 0.0
    across = elliptic.incomplete_e([BELOW, ABOVE, 3.0 * BELOW, 3.0 * ABOVE], m1)
    assert np.abs(across / elliptic.complete_e(m1) - [1.0, 1.0, 3.0, 3.0]).max() < 1e-14


def test_half_turns_are_counted_by_the_sign_of_the_cosine():
    half = (np.arange(-2000, 2000) + 0.5) * np.pi
    for phi in (np.nextafter(half, -np.inf), half, np.nextafter(half, np.inf)):
        assert (
            np.abs(elliptic.incomplete_e(phi, 0.5) / elliptic.complete_e(0.5) / (half * 2.0 / np.pi) - 1.0).max()
            < 1e-14
        )


def test_broadcasting():
    u, m1, n = np.linspace(-70.0, 70.0, 5)[:, None], np.array([0.0, 1e-30, 0.5, 1.0]), np.array([[[-0.5]], [[-3.0]]])
    together = elliptic.jacobi(u, m1)
    assert all(part.shape == (5, 4) for part in together)
    assert elliptic.jacobi_pi(n, u, m1).shape == (2, 5, 4)
    phi = u / 50.0
    for i, j in np.ndindex(5, 4):
        single = elliptic.jacobi(u[i, 0], m1[j])
        assert all(np.ndim(part) == 0 for part in single)
        assert np.abs(np.array(single) - [part[i, j] for part in together]).max() < 1e-13
        for f in (elliptic.incomplete_f, elliptic.incomplete_e):
            assert abs(f(phi, m1)[i, j] - f(phi[i, 0], m1[j])) < 1e-13
        assert abs(elliptic.incomplete_pi(n, phi, m1)[1, i, j] - elliptic.incomplete_pi(-3.0, phi[i, 0], m1[j])) < 1e-13
    assert elliptic.complete_pi(n, m1).shape == (2, 1, 4)
    assert elliptic.jacobi(np.empty(0), 0.5)[0].shape == (0,)
    assert elliptic.complete_k(1) == pytest.approx(0.5 * np.pi, abs=1e-15)


def test_far_arguments_stay_finite(rng):
    m1 = np.concatenate([[0.0, 5e-324], 10.0 ** rng.uniform(-323.0, 0.0, 20000)])
    size = m1.size
    n = -(10.0 ** rng.uniform(-320.0, 100.0, size))
    u, phi = (rng.choice([-1, 1], size) * 10.0 ** rng.uniform(-320.0, top, size) for top in (12.0, 18.0))
    phi[0] = 1.0
    values = [*elliptic.jacobi(u, m1), elliptic.incomplete_f(phi, m1), elliptic.incomplete_e(phi, m1)]
    values += [elliptic.incomplete_pi(n, phi, m1), elliptic.jacobi_pi(n, u, m1), elliptic.incomplete_pi(0.7, phi, m1)]
    assert all(np.isfinite(value).all() for value in values)


@pytest.mark.parametrize("m1", [-1e-300, 1.0 + 1e-15, np.nan, np.inf, "half", 0.5j, None, [0.5, [1.0]]])
def test_bad_parameters_are_refused(m1):
    for call in (
        lambda: elliptic.complete_k(m1),
        lambda: elliptic.complete_e(m1),
        lambda: elliptic.complete_pi(-1.0, m1),
        lambda: elliptic.jacobi(1.0, m1),
        lambda: elliptic.jacobi_pi(-1.0, 1.0, m1),
        lambda: elliptic.incomplete_f(1.0, m1),
        lambda: elliptic.incomplete_e(1.0, m1),
        lambda: elliptic.incomplete_pi(-1.0, 1.0, m1),
    ):
        with pytest.raises(ShapeError, match="m1"):
            call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: elliptic.jacobi(np.nan, 0.5), "^u: "),
        (lambda: elliptic.jacobi([1.0, 1e14], 0.5), r"^u: entry \[1\] .*periods"),
        (lambda: elliptic.jacobi([1.0, 2.0], [0.5, 0.5, 0.5]), "broadcast"),
        (lambda: elliptic.jacobi_pi([-1.0, 0.1], 1.0, 0.5), r"^n: entry \[1\]"),
        (lambda: elliptic.incomplete_f([0.1, -0.5 * np.pi], 0.0), r"^phi: entry \[1\] .*infinite"),
        (lambda: elliptic.incomplete_f(0.5 * np.pi, [0.1, 0.0]), r"^phi: entry \[1\] .*infinite"),
        (lambda: elliptic.incomplete_pi(-1.0, 2.0, 0.0), "^phi: .*infinite"),
        (lambda: elliptic.incomplete_pi([0.5, 1.0], 2.0, 0.5), r"^n: entry \[1\] .*below 1"),
        (lambda: elliptic.complete_pi(3.0, 0.5), "^n: .*below 1"),
        (lambda: elliptic.complete_pi(-1e101, 0.5), "^n: .*1e"),
        (lambda: elliptic.incomplete_e("one", 0.5), "^phi: "),
    ],
)
def test_bad_arguments_are_refused(call, message):
    with pytest.raises(ShapeError, match=message):
        call()
