"""Bounds over intervals: they hold everywhere, they are tight, and they come from the coefficients."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import shapephase as sp
from shapephase.arguments import interval_argument
from shapephase.bounds._enclosure import ball, enclosure
from shapephase.chebyshev import restriction_matrix
from support.independent import body_of, random_loop
from support.random_deformations import KINDS, random_case

INTERVALS = (None, (0.31, 0.77))


def cells_of(known, times):
    return np.clip(np.searchsorted(known.edges, times, side="right") - 1, 0, len(known.widths) - 1)


def channels_of(deformation, times):
    inertia, internal = deformation.description.sample(times)
    inverse = np.linalg.inv(inertia)
    return inverse, np.einsum("nij,nj->ni", inverse, internal)


def test_series_bounds_hold_exactly_e9(rng):
    """Against rational arithmetic: |T_k| <= 1 on [-1, 1], whatever the rounding of the sum."""
    for _ in range(50):
        series = rng.normal(size=(7, 1)) * 10.0 ** rng.uniform(-8, 2, (7, 1))
        middle, radius = ball(series)
        low, high = middle - radius, middle + radius
        for x in map(Fraction, rng.uniform(-1.0, 1.0, 20)):
            before, now, value = Fraction(1), x, Fraction(0)
            for coefficient in series[:, 0]:
                value += Fraction(float(coefficient)) * before
                before, now = now, 2 * x * now - before
            assert Fraction(float(low[0])) <= value <= Fraction(float(high[0]))


def test_series_bounds_are_reached_e9():
    """c_0 plus the sum of the others is the value at 1 where all are positive."""
    middle, radius = ball(np.array([[1.0], [0.25], [0.125]]))
    assert middle[0] == 1.0
    assert radius[0] == pytest.approx(0.375, abs=1e-13)


@pytest.mark.parametrize("count", [1, 2, 9, 33, 81])
def test_restriction_is_the_same_polynomial_e9(count, rng):
    series = rng.normal(size=(count, 2)) / np.arange(1, count + 1)[:, None] ** 2
    left, right = -0.37, 0.81
    x = np.linspace(-1.0, 1.0, 101)
    stretched = 0.5 * (left + right) + 0.5 * (right - left) * x
    expected = np.polynomial.chebyshev.chebval(stretched, series)
    restricted = restriction_matrix(count, left, right) @ series
    assert np.polynomial.chebyshev.chebval(x, restricted) == pytest.approx(expected, abs=3e-13)


@pytest.mark.parametrize("interval", INTERVALS)
@pytest.mark.parametrize("seed", range(len(KINDS)))
def test_channels_lie_in_their_bounds_e9(seed, interval):
    """At thousands of times the inverse, its rate, the drift, the moments and |L_o| are within what is claimed."""
    _, deformation, _ = random_case(seed)
    length = deformation.duration
    known = enclosure(deformation, interval and (interval[0] * length, interval[1] * length))
    times = np.linspace(known.edges[0], known.edges[-1], 4001)
    cell = cells_of(known, times)
    inverse, drift = channels_of(deformation, times)
    seen = known.frame.T @ inverse @ known.frame
    assert np.all(np.abs(seen - known.inverse[cell]) <= known.inverse_radius[cell])
    assert np.all(np.linalg.norm(drift @ known.frame - known.drift[cell], axis=1) <= known.drift_radius[cell])
    assert np.all(np.linalg.norm(drift, axis=1) <= known.drift_magnitude[cell])
    rate = -inverse @ deformation.inertia_rate(times) @ inverse
    room = known.inverse_rate_radius[cell] + 1e-8 * np.abs(rate).max()
    assert np.all(np.abs(known.frame.T @ rate @ known.frame - known.inverse_rate[cell]) <= room)
    moments = np.linalg.eigvalsh(deformation.inertia(times))
    least, greatest = known.principal_moments
    assert np.all((least[cell] <= moments) & (moments <= greatest[cell]))
    internal = np.linalg.norm(deformation.internal_momentum(times), axis=1)
    assert np.all(internal <= known.internal_momentum_magnitude[cell])
    # Tight: a cell is as wide as the resolution, and no bound is far from what is reached.
    assert np.all(greatest - least <= 0.06 * greatest)
    assert known.internal_momentum_magnitude.max() <= 1.25 * internal.max() + 1e-12


def test_bounds_converge_with_the_resolution_e9():
    _, deformation, _ = random_case(0)
    times = np.linspace(0.0, deformation.duration, 20001)
    top = np.linalg.eigvalsh(deformation.inertia(times))[:, 2].max()
    gaps = [
        enclosure(deformation, resolution=resolution).principal_moments[1][:, 2].max() - top
        for resolution in (5e-3, 1e-3, 2e-4)
    ]
    assert gaps[0] > gaps[1] > gaps[2] > 0.0
    assert gaps[2] < 4e-4 * top


def test_bounds_see_what_samples_miss_e9():
    """A maximum between all the samples of the panel is in the bound: it is a bound of the series."""

    def inertia(t):
        diagonal = 1.0 / (1.0 + 0.4 * np.exp(-((t - 0.4711) ** 2) / 0.02))
        return diagonal[:, None, None] * np.diag([1.0, 1.2, 1.4])

    known = enclosure(sp.prescribed(inertia, None, 1.0))
    # At the peak the least moment is 1/1.4.
    assert known.principal_moments[0][:, 0].min() <= 1.0 / 1.4
    assert known.principal_moments[0][:, 0].min() == pytest.approx(1.0 / 1.4, rel=1e-2)


def test_rigid_body_is_known_to_rounding_e9():
    known = enclosure(sp.rigid(np.diag([1.0, 2.0, 3.0]), 5.0))
    least, greatest = known.principal_moments
    assert least[0] == pytest.approx([1.0, 2.0, 3.0], abs=1e-12)
    assert greatest[0] == pytest.approx([1.0, 2.0, 3.0], abs=1e-12)
    assert np.all((least <= [1.0, 2.0, 3.0]) & (greatest >= [1.0, 2.0, 3.0]))
    assert len(known.widths) == 1
    assert known.internal_momentum_magnitude[0] == 0.0


def test_quadratic_form_and_view_along_an_axis_e9(rng):
    """u.I^-1 u within its bounds; along, across and coupling of I^-1 about any axis, with either sign."""
    _, deformation, _ = random_case(KINDS.index("turning axes"))
    known = enclosure(deformation)
    times = 0.5 * (known.edges[:-1] + known.edges[1:]) + 0.49 * known.widths * rng.uniform(-1.0, 1.0, len(known.widths))
    inverse, _ = channels_of(deformation, times)
    for _ in range(20):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        low, high = known.quadratic(axis)
        value = np.einsum("i,kij,j->k", axis, inverse, axis)
        assert np.all((low <= value) & (value <= high))
        plane = np.linalg.svd(axis[None])[2][1:]
        inner = np.linalg.eigvalsh(plane @ inverse @ plane.T)
        side = np.linalg.norm(np.einsum("i,kij,lj->kl", axis, inverse, plane), axis=1)
        for sign in (1.0, -1.0):
            along, across, coupling = known.about(axis, sign)
            assert np.all((along[:, 0] <= sign * value) & (sign * value <= along[:, 1]))
            assert np.all(across[:, 0] <= (sign * inner).min(axis=1))
            assert np.all((sign * inner).max(axis=1) <= across[:, 1])
            assert np.all(side <= coupling)


def test_loops_of_a_repeated_path_e9():
    """The second loop's cells are those of the first."""
    loop = random_loop(3, body_of("cat_two_halves").n_shape)
    once = sp.articulated(body_of("cat_two_halves"), loop.path)
    thrice = sp.articulated(body_of("cat_two_halves"), loop.path.repeated(3))
    length = once.duration
    first, second = (enclosure(d, i) for d, i in ((once, (0.2, 0.9)), (thrice, (length + 0.2, length + 0.9))))
    assert second.principal_moments[1].max() == pytest.approx(first.principal_moments[1].max(), rel=1e-9)
    times = np.linspace(length + 0.2, length + 0.9, 501)
    moments = np.linalg.eigvalsh(thrice.inertia(times))
    cell = cells_of(second, times)
    assert np.all(moments <= second.principal_moments[1][cell])
    assert np.all(moments >= second.principal_moments[0][cell])


def test_breaks_are_ends_of_cells_e9():
    """A jump of the rate at a break is on the edge of two cells, and both sides' rates are right."""

    def inertia(t):
        return (1.0 + 0.3 * np.abs(t - 0.4))[:, None, None] * np.diag([1.0, 1.3, 1.6])

    known = enclosure(sp.prescribed(inertia, None, 1.0, breaks=(0.4,)))
    index = int(np.argmin(np.abs(known.edges - 0.4)))
    assert known.edges[index] == pytest.approx(0.4, abs=1e-12)
    assert known.inverse_rate[index - 1].trace() > 0.0 > known.inverse_rate[index].trace()


@pytest.mark.parametrize(
    "interval", [(-0.1, 1.0), (0.5, 0.5), (0.0, 2.1), (1.0, 0.2), (0.0, np.nan), 3.0, ("a", "b"), (0,)]
)
def test_interval_is_refused(interval):
    with pytest.raises(sp.ShapePhaseError, match="interval"):
        interval_argument(interval, 2.0)
