"""The polhode by Weierstrass's function, against mpmath with fifty digits and the solution in Jacobi's functions."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from shapephase.errors import ShapeError
from shapephase.rigid_body import EulerTop, weierstrass_form

BODIES = (([1.0, 2.0, 3.0], [0.6, 0.9, 0.5]), ([2.0, 1.0, 3.0], [0.3, 0.9, 0.5]), ([3.0, 1.5, 2.0], [1.0, 0.2, -0.4]))


@pytest.mark.parametrize(("moments", "momentum"), BODIES)
def test_squares_of_the_momentum_h14(moments, momentum):
    """In any order of the moments; and y'^2 = 4 y^3 - g_2 y - g_3."""
    form, top = weierstrass_form(moments, momentum), EulerTop.principal(moments, momentum)
    times = np.linspace(-7.0, 9.0, 33)
    assert form.squares(times) == pytest.approx(top.body_momentum(times) ** 2, abs=1e-14)
    assert abs(form.roots.sum()) < 1e-16
    y, step = form.value(times), 1e-5
    slope = (form.value(times + step) - form.value(times - step)) / (2.0 * step)
    cubic = 4.0 * y**3 - form.invariants[0] * y - form.invariants[1]
    assert slope**2 == pytest.approx(cubic, abs=1e-9 * np.abs(4.0 * y**3).max())


@pytest.mark.parametrize(("moments", "momentum"), BODIES)
def test_the_function_and_its_periods_with_fifty_digits_h14(moments, momentum):
    """P of a complex argument, and both half periods as integrals of the differential, by mpmath."""
    form = weierstrass_form(moments, momentum)
    with mp.workdps(50):
        first, second, third = sorted((mp.mpf(root) for root in form.roots.tolist()), reverse=True)
        scale, parameter = mp.sqrt(first - third), (second - third) / (first - third)

        def weierstrass(z):
            return third + (first - third) / mp.ellipfun("sn", scale * z, m=parameter) ** 2

        for time in (-1.3, 0.0, 2.9):
            expected = weierstrass(mp.mpf(time) + mp.mpf(form.shift) + 1j * mp.mpf(form.half_periods[1]))
            assert abs(expected - mp.mpf(float(form.value(time)))) < 1e-14
        # y = e_3 + (e_2 - e_3) sin^2 and y = e_3 - (e_2 - e_3) tan^2 take the ends out of the integrands.
        gap = second - third
        real = mp.quad(lambda x: 1 / mp.sqrt(first - third - gap * mp.sin(x) ** 2), [0, mp.pi / 2])
        turned = mp.quad(lambda x: 1 / mp.sqrt(first - third - (first - second) * mp.sin(x) ** 2), [0, mp.pi / 2])
        assert abs(real - form.half_periods[0]) < 1e-14
        assert abs(turned - form.half_periods[1]) < 1e-14


def test_without_a_real_period_there_is_no_form():
    for moments, momentum in (
        ([1.0, 1.0, 2.0], [0.1, 0.2, 0.3]),
        ([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]),
        ([1.0, 2.0, 3.0], [0.0, 0.0, 0.0]),
        ([1.0, 2.0, 3.0], [1.0, 2.0]),
    ):
        with pytest.raises(ShapeError, match="moment"):
            weierstrass_form(moments, momentum)
