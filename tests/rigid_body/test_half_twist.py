"""Flips of a free rigid body, against raw integration, quadrature and 50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shapephase import so3
from shapephase.errors import ShapeError, SingularInertiaError
from shapephase.rigid_body import (
    EulerTop,
    half_twist,
    half_twist_from_tilt,
    racket_twist,
    steady_rotations,
    twist_defect,
)
from support.independent import assert_within, cross


def with_attitude(moments):
    def rates(_, y):
        omega = y[:3] / moments
        return np.concatenate([cross(y[:3], omega), (y[3:].reshape(3, 3) @ so3.hat(omega)).ravel()])

    return rates


def exact_half_twist(moments, momentum):
    """From the definitions, with 80 digits: a quadrature of dPi_2/Pi_2' by the energy and the magnitude."""
    with mpmath.workdps(80):
        i1, i2, i3 = map(mpmath.mpf, moments)
        x = [mpmath.mpf(float(v)) ** 2 for v in momentum]
        square, twice = sum(x), x[0] / i1 + x[1] / i2 + x[2] / i3
        # Pi_1^2 = p - q y, Pi_3^2 = r - s y with y = Pi_2^2; y ends at the smaller zero.
        whole = 1 / i1 - 1 / i3
        p, q = (twice - square / i3) / whole, (1 / i2 - 1 / i3) / whole
        r, s = (square / i1 - twice) / whole, (1 / i1 - 1 / i2) / whole
        near, far = sorted((p / q, r / s))
        return float(2 * mpmath.ellipk(near / far) / (whole * mpmath.sqrt(q * s) * mpmath.sqrt(far)))


def test_half_twist_time_to_the_last_digits_however_near_the_separatrix_l4():
    rng = np.random.default_rng(10)
    for tilt in (1.0, 1e-2, 1e-5, 1e-8, 1e-11, 1e-16, 1e-25):
        for _ in range(5):
            moments = np.sort(np.exp(rng.uniform(-1.0, 1.0, 3)))
            momentum = np.exp(rng.uniform(-1.0, 1.0)) * np.array([tilt, 1.0, tilt]) * rng.normal(size=3)
            twist = half_twist(moments, momentum)
            assert twist.time == pytest.approx(exact_half_twist(moments, momentum), rel=1e-13)
            for order in ([1, 2, 0], [1, 0, 2]):
                assert half_twist(moments[order], momentum[order]).time == twist.time
            unstable = steady_rotations(np.diag(moments), np.linalg.norm(momentum))[1]
            assert twist.growth_rate == pytest.approx(unstable.eigenvalues[0].real, rel=1e-12)


def test_between_flips_the_intermediate_component_reverses_and_the_body_turns_over_l4():
    moments, tilt = np.array([1.0, 2.0, 3.0]), 1e-3
    twist = half_twist_from_tilt(moments, 1.7, tilt, 0.3)
    start = 1.7 * np.array([np.sin(tilt) * np.cos(0.3), np.cos(tilt), np.sin(tilt) * np.sin(0.3)])
    assert twist.time == pytest.approx(half_twist(moments, start).time, rel=1e-12)

    def reverses(_, y):
        return y[1]

    full = (0.0, 3.2 * twist.time)
    initial = np.concatenate([start, np.eye(3).ravel()])
    run = solve_ivp(
        with_attitude(moments),
        full,
        initial,
        method="DOP853",
        rtol=1e-13,
        atol=1e-15,
        events=reverses,
        dense_output=True,
    )
    zeros = run.t_events[0]
    assert len(zeros) == 3
    assert np.diff(zeros) == pytest.approx([twist.time, twist.time], rel=1e-8)
    # Halfway between reversals the body spins about its intermediate axis, upright and overturned by turns.
    vertical = so3.normalised(start)
    upright = [run.sol(t)[3:].reshape(3, 3)[:, 1] @ vertical for t in 0.5 * (zeros[1:] + zeros[:-1])]
    assert upright == pytest.approx([-1.0, 1.0], abs=1e-5)


def test_the_logarithm_is_approached_and_exact_far_down_l4():
    moments = np.array([1.0, 1.4, 3.0])
    tilts = np.array([1e-1, 1e-2, 1e-3, 1e-4])
    twist = half_twist_from_tilt(moments, 2.0, tilts, 0.8)
    gap = np.abs(twist.time / twist.asymptote - 1.0)
    assert np.all(gap < 3.0 * twist.complement)
    assert np.all(gap[1:] < 0.02 * gap[:-1])
    far = half_twist_from_tilt(moments, 2.0, [1e-20, 1e-100], 0.8)
    assert far.time == pytest.approx(far.asymptote, rel=1e-14)
    # A tilt e times smaller takes 2/growth_rate longer.
    assert (far.time[1] - far.time[0]) * far.growth_rate[0] == pytest.approx(160.0 * np.log(10.0), rel=1e-13)
    assert half_twist_from_tilt(moments[::-1], 2.0, 1e-3, 0.8).time == twist.time[2]


def test_where_nothing_flips_the_time_is_infinite_l4():
    moments = np.array([1.0, 2.0, 3.0])
    for momentum in ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]):
        assert half_twist(moments, momentum).time == np.inf
    assert half_twist([2.0, 2.0, 2.0], [1.0, 2.0, 3.0]).time == np.inf
    # Pi_1^2 (I2 - I1)/I1 = Pi_3^2 (I3 - I2)/I3 in whole numbers.
    on = half_twist([1.0, 2.0, 4.0], [1.0, 1.0, np.sqrt(2.0)])
    off = half_twist([2.0, 3.0, 6.0], [1.0, 5.0, 1.0])
    assert on.complement < 1e-15
    assert (off.complement, off.time, off.asymptote) == (0.0, np.inf, np.inf)
    # An axisymmetric body circles evenly: half a turn.
    for moments in ([2.0, 2.0, 3.0], [1.0, 2.0, 2.0]):
        axis = 2 if moments[2] == 3.0 else 0
        momentum = np.array([0.3, 0.4, 0.5])
        rate = abs(1.0 / 2.0 - 1.0 / moments[axis]) * momentum[axis]
        assert half_twist(moments, momentum).time == pytest.approx(np.pi / rate, rel=1e-14)


def test_half_twist_is_batched_and_refuses_bad_input():
    rng = np.random.default_rng(11)
    moments, momenta = np.exp(rng.normal(size=(4, 1, 3))), rng.normal(size=(5, 3))
    table = half_twist(moments, momenta)
    assert table.time.shape == table.growth_rate.shape == (4, 5)
    assert table.time[2, 3] == half_twist(moments[2, 0], momenta[3]).time
    assert half_twist_from_tilt(moments, 1.0, [0.1] * 5, 0.2).time.shape == (4, 5)
    with pytest.raises(SingularInertiaError, match="above"):
        half_twist([1.0, 0.0, 2.0], [1.0, 1.0, 1.0])
    with pytest.raises(ShapeError, match="broadcast"):
        half_twist(np.ones((2, 3)), np.ones((3, 3)))
    with pytest.raises(ShapeError, match="broadcast"):
        half_twist_from_tilt([1.0, 2.0, 3.0], [1.0, 2.0], [0.1, 0.1, 0.1], 0.0)
    with pytest.raises(ShapeError, match="equal"):
        twist_defect([1.0, 2.0, 2.0])
    with pytest.raises(SingularInertiaError):
        twist_defect([1.0, -2.0, 2.0])


RACKETS = ([1.0, 2.0, 3.0], [0.2, 1.0, 1.15], [1.0, 1.05, 3.0], [1.0, 2.0, 2.01], [0.05, 1.0, 1.04], [1e-3, 1.0, 1.5])


@pytest.mark.parametrize("moments", RACKETS)
def test_twist_defect_solves_the_racket_equation_to_fifty_digits(moments):
    defect = float(twist_defect(moments))
    with mpmath.workdps(50):
        i1, i2, i3 = map(mpmath.mpf, moments)
        a, b = i2 / i1 - 1, 1 - i2 / i3

        def slope(short):
            """dphi/dpsi at psi = pi/2 - short."""
            square = b * mpmath.sin(short) ** 2
            return (1 - square) / mpmath.sqrt(square * (a + square))

        # The quadrature over psi from the middle of the flip, short = exp(-s).
        eps = mpmath.mpf(defect)
        first, last = -mpmath.log(mpmath.pi / 2), -mpmath.log(eps)
        ends = [first, *(s for s in range(0, int(last) + 2, 2) if first < s < last), last]
        turn = mpmath.quad(lambda s: slope(mpmath.exp(-s)) * mpmath.exp(-s), ends)
        # The error of eps by the error of the turn.
        assert abs((turn - mpmath.pi) / (slope(eps) * eps)) < 1e-13 * max(1.0, abs(np.log(defect)))
    assert twist_defect(np.flip(moments)) == defect


def test_twist_defect_of_a_racket_that_is_integrated():
    # On the separatrix from the middle of the flip (Pi_2 = 0) until the handle has gone round half way.
    for moments in ([1.0, 2.0, 3.0], [0.2, 1.0, 1.15], [1.0, 1.4, 1.6]):
        i1, i2, i3 = moments
        shares = np.array(
            [(1.0 / i2 - 1.0 / i3) / (1.0 / i1 - 1.0 / i3), 0.0, (1.0 / i1 - 1.0 / i2) / (1.0 / i1 - 1.0 / i3)]
        )
        momentum = np.sqrt(shares)
        about = so3.between(momentum, np.array([0.0, 0.0, 1.0]))
        state = np.concatenate([momentum, about.ravel(), [0.0]])

        def rates(t, y, body=moments):
            turning = with_attitude(np.array(body))(t, y[:12])
            handle, rate = y[3:12].reshape(3, 3)[:, 0], turning[3:].reshape(3, 3)[:, 0]
            return np.append(turning, (handle[0] * rate[1] - handle[1] * rate[0]) / (handle[0] ** 2 + handle[1] ** 2))

        def half_turn(_, y):
            return abs(y[12]) - np.pi

        half_turn.terminal = True
        run = solve_ivp(rates, (0.0, 200.0), state, method="DOP853", rtol=1e-12, atol=1e-14, events=half_turn)
        end = run.y_events[0][0]
        assert np.arctan2(abs(end[2]), abs(end[1])) == pytest.approx(float(twist_defect(moments)), abs=2e-10)


@pytest.mark.parametrize(
    ("moments", "momentum"),
    [
        ([1.0, 2.0, 2.1], [0.1, 1.0, 0.0]),
        ([2.1, 1.0, 1.5], [0.7, 0.0, 1.0]),
        ([1.0, 1.2, 2.1], [0.0, 0.3, 0.95]),
        ([0.5, 1.2, 1.3], [0.9, 0.03, 0.0]),
        ([0.7, 1.0, 1.6], [0.0, 0.6, 0.8]),
    ],
)
def test_twist_of_a_racket_off_the_separatrix_by_the_exact_motion(moments, momentum):
    """Half of it from the middle of the flip, Pi_2 = 0, until the handle has gone half round; in closed form too."""
    order = np.argsort(moments)
    low, middle, high = np.array(moments)[order]
    a, b = middle / low - 1.0, 1.0 - middle / high
    start = np.array(momentum)[order]
    c = a * start[0] ** 2 - b * start[2] ** 2
    # The same orbit at Pi_2 = 0, of unit length.
    square = c / (start @ start)
    across = (a - square) / (a + b)
    top = EulerTop.principal([low, middle, high], [np.sqrt(1.0 - across), 0.0, np.sqrt(across)])
    times = np.linspace(0.0, 8.0 * np.pi * high, 20001)
    direction = so3.between(top.momentum, np.array([0.0, 0.0, 1.0]))
    handle = direction @ top.attitude(times)[:, :, 0].T
    azimuth = np.unwrap(np.arctan2(handle[1], handle[0]))
    pi = top.body_momentum(times)
    twist = np.unwrap(np.arctan2(pi[:, 1], pi[:, 2]))
    turned = np.abs(azimuth - azimuth[0])
    half = np.interp(np.pi, turned, (twist - twist[0]) * np.sign(twist[1] - twist[0]))
    assert racket_twist(moments, momentum) == pytest.approx(2.0 * half, abs=1e-5)


def test_twist_of_a_racket_next_to_the_separatrix_and_refusals():
    on_it = np.pi - 2.0 * float(twist_defect([1.0, 2.0, 2.1]))
    assert racket_twist([1.0, 2.0, 2.1], [0.0, 3.0, 0.0]) == pytest.approx(on_it, abs=1e-14)
    both = racket_twist([1.0, 2.0, 2.1], [[1e-5, 1.0, 0.0], [0.0, 1.0, 1e-5]])
    assert_within(both, on_it, 1e-8)
    assert both[1] < on_it < both[0]
    with pytest.raises(ShapeError, match="equal"):
        racket_twist([1.0, 1.0, 2.0], [0.0, 1.0, 0.0])
    with pytest.raises(ShapeError, match="momentum"):
        racket_twist([1.0, 2.0, 3.0], [0.0, 0.0, 0.0])


def test_twist_defect_limits():
    # No twist at all for a flat response, a full one for a long handle; batched.
    assert twist_defect([[1.0, 2.0, 2.0 + 1e-9], [1e-3, 1.0, 1.5]]) == pytest.approx([0.5 * np.pi, 0.0], abs=1e-4)
    assert twist_defect([1e-9, 1.0, 2.0]) == 0.0
    thin = twist_defect([1.0, 1.0 + 1e-12, 3.0])
    b = 2.0 / 3.0
    u = np.cos(thin)
    # With a -> 0: cot(eps) = b (pi + arcsin u).
    assert 1.0 / np.tan(thin) == pytest.approx(b * (np.pi + np.arcsin(u)), rel=1e-10)
