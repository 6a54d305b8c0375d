"""What the steps' formula misses of a term, against mpmath, and what errors made of it are worth."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.integrate import DOP853

from shapephase.integrator.fast.estimate_constants import (
    BY_CHANCE,
    DEFECT_STEPS,
    FEW_STEPS,
    FORESEEN_AT_REST,
    FULL_ORDER,
)
from shapephase.integrator.interpolant import Interpolant
from shapephase.integrator.steps.quadrature_defects import Defects, PanelDefects, defect_table
from shapephase.integrator.steps.step_control import StepRequirements
from shapephase.integrator.steps.step_loop import integrate_steps_at_rest
from support.both_engines import both


def largest_defect(ends: list[int], degree: int) -> float:
    """Of T_k on a panel of width one, in 30 digits, in steps with these ends."""
    with mpmath.workdps(30):
        total = worst = mpmath.mpf(0)
        for start, end in pairwise(ends):
            length, steps = end - start, ends[-1]
            left, width = mpmath.mpf(2 * start) / steps - 1, mpmath.mpf(2 * length) / steps
            taken = sum(
                mpmath.mpf(b) * mpmath.chebyt(degree, left + mpmath.mpf(c) * width)
                for b, c in zip(DOP853.B.tolist(), DOP853.C.tolist())
                if b
            )
            exact = mpmath.quad(lambda x: mpmath.chebyt(degree, x), [left, left + width])
            total += length * taken / steps - exact / 2
            worst = max(worst, abs(total))
    return float(worst)


@pytest.mark.parametrize(("steps", "degree"), [(1, 8), (2, 9), (3, 40), (4, 16), (7, 23), (16, 31)])
def test_the_table_has_the_largest_defect_at_an_end_of_a_step(steps: int, degree: int):
    """Sums of stages by weights up to six are rounded to some 1e-15."""
    assert defect_table()[steps, degree] == pytest.approx(
        largest_defect([*range(steps + 1)], degree), rel=1e-9, abs=5e-15
    )


@pytest.mark.parametrize(
    ("ends", "degree"),
    [([0, 2, 3], 9), ([0, 2, 3, 5], 24), ([0, 2, 4, 5, 7], 16), ([0, 2, 4, 6, 7, 9, 11, 13], 31)],
)
def test_pairs_of_an_odd_number_have_rows_of_their_own(ends: list[int], degree: int):
    """One step of them is alone, in the middle or next to it."""
    row = DEFECT_STEPS + 1 + ends[-1] // 2
    assert defect_table()[row, degree] == pytest.approx(largest_defect(ends, degree), rel=1e-9, abs=5e-15)


def test_the_formula_takes_seven_degrees_exactly():
    assert not defect_table()[:, :8].any()
    assert defect_table()[1:9, 8].all()


def test_twice_as_many_steps_divide_the_defect_of_long_terms_by_two_to_the_eighth():
    table = defect_table()
    for steps in (2, 4, 8):
        assert table[2 * steps, 8] == pytest.approx(2.0**-8 * table[steps, 8], rel=1e-3)


def test_kernels_find_what_arrays_find(monkeypatch: pytest.MonkeyPatch):
    """Panels of more steps than the table has are among them."""
    rng = np.random.default_rng(3)
    coefficients = rng.normal(size=(6, 40, 9)) * 10.0 ** -np.linspace(0.0, 12.0, 40)[:, None]
    interpolant = Interpolant(np.cumsum([0.0, *rng.uniform(0.1, 1.0, 6)]), coefficients, 3, 0)
    steps, distances = np.array([2, 3, 7, 18, 4 * DEFECT_STEPS, 2 * DEFECT_STEPS]), 10.0 ** np.arange(-14.0, 0.0)

    def run() -> tuple[Defects, np.ndarray]:
        requirements = StepRequirements.from_interpolant(interpolant, 2.0, 1e-9)
        return requirements.defects(steps), requirements.stepping_error(steps, distances)

    (arrays, slow), (kernels, fast) = both(monkeypatch, run)
    np.testing.assert_allclose(kernels, arrays, rtol=1e-12)
    np.testing.assert_allclose(fast, slow, rtol=1e-12)


def defects(rates, turns, steps):
    return PanelDefects(rates, turns).found(steps)


def test_evenness_is_the_share_of_panels_that_err():
    """Of four panels one alone swings; then all alike."""
    rates = np.zeros((4, 20))
    rates[0, 12] = 1.0
    one = defects(rates, np.zeros(4), np.full(4, 4))
    every = defects(np.tile(rates[:1], (4, 1)), np.zeros(4), np.full(4, 4))
    assert one.evenness == pytest.approx(0.25)
    assert every.evenness == pytest.approx(1.0)
    assert every.coarse == pytest.approx(4.0 * one.coarse)
    distance = np.array([1e-3 * one.coarse])
    assert one.error(distance, 1) > every.error(distance, 1)


def test_an_error_is_no_larger_than_its_distance_and_no_smaller_than_the_order_allows():
    rng = np.random.default_rng(5)
    for _ in range(200):
        found = defects(10.0 ** rng.uniform(-12.0, 0.0, (3, 30)), rng.uniform(0.0, 5.0, 3), rng.integers(2, 80, 3))
        distance = 10.0 ** rng.uniform(-14.0, -1.0, 5)
        errors = found.error(distance, 1)
        assert np.all(errors <= distance)
        assert np.all(errors >= np.minimum(BY_CHANCE * FULL_ORDER / found.paired, 1.0) * distance * (1.0 - 1e-12))


def test_terms_that_no_step_sees_count_whole():
    """A term of degree 60 in two steps is missed by one as by two."""
    rates = np.zeros((1, 61))
    rates[0, 60] = 1e-9
    found = defects(rates, np.zeros(1), np.array([2]))
    assert found.unresolved == found.whole > 0.1e-9
    assert found.error(np.array([1e-3]), 1) >= found.whole


def test_where_errors_grow_a_distance_counts_more():
    """More with every growth up to twentyfold, never less than without, and never more than the distance."""
    rates = np.zeros((1, 20))
    rates[0, 12] = 1.0
    found = defects(rates, np.zeros(1), np.array([6]))
    assert found.unresolved == 0.0
    distance = np.full(5, 1e-3 * found.coarse)
    errors = found.error(distance, 1, np.array([1.0, 3.0, 10.0, 20.0, 1e9]))
    assert errors[0] == found.error(distance[:1], 1)
    assert np.all(np.diff(errors[:4]) > 0.0)
    assert errors[3] == errors[4] <= distance[4]


@pytest.mark.parametrize("fast", ["0", "1"])
@pytest.mark.parametrize("magnitude", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(4))
def test_a_plan_looks_ahead(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, fast: str, magnitude: float, seed: int
):
    """What the planned steps are foreseen to be off by is what the plan allows for, or nearly that."""
    if fast == "1":
        request.getfixturevalue("fast")
    else:
        monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    rng, tolerance = np.random.default_rng(seed), 1e-9
    coefficients = rng.normal(size=(4, 24, 9)) * 10.0 ** -np.linspace(0.0, 8.0, 24)[:, None]
    interpolant = Interpolant(np.linspace(0.0, 1.0, 5), coefficients, 1, 0)
    needed = StepRequirements.from_interpolant(interpolant, magnitude, tolerance)
    steps = needed.whole_steps(needed.plan(tolerance))
    assert steps.sum() <= FEW_STEPS
    if magnitude:
        assert needed.defects(steps).excess(1, tolerance) <= 1.5
    else:
        assert needed.foreseen_error_at_rest(steps) <= 1.5 * FORESEEN_AT_REST * tolerance


@pytest.mark.parametrize("steps", [2, 3, 6])
def test_without_momentum_the_error_is_foreseen_before_a_step_is_taken(steps: int):
    """Beside the integral of a turn about one axis: the worse of what a panel's middle and its end are off by."""
    rng, middle = np.random.default_rng(steps), (steps + 1) // 2
    series = np.zeros((1, 30, 9))
    series[0, :, 8] = 0.01 * rng.normal(size=30) * 10.0 ** -np.linspace(0.0, 4.0, 30)
    still = Interpolant(np.array([0.0, 0.5]), series, 1, 0)
    quaternions = integrate_steps_at_rest(still, None, np.array([steps])).quaternions[0]
    integral = Chebyshev(series[0, :, 8]).integ(lbnd=-1.0)
    exact = -0.25 * integral(2.0 * np.array([middle / steps, 1.0]) - 1.0)
    missed = float(np.abs(2.0 * np.arcsin(quaternions[[middle, steps], 2]) - exact).max())
    assert missed > 1e-8
    foreseen = StepRequirements.from_interpolant(still, 0.0, 1e-9).foreseen_error_at_rest(np.array([steps]))
    assert foreseen == pytest.approx(missed, rel=1e-3)
    # Of two panels they may add up.
    both_panels = Interpolant(np.array([0.0, 0.5, 1.0]), np.concatenate([series, -series]), 1, 0)
    of_both = StepRequirements.from_interpolant(both_panels, 0.0, 1e-9).foreseen_error_at_rest(np.full(2, steps))
    assert of_both == pytest.approx(2.0 * foreseen)


def test_next_to_no_momentum_leaves_more_to_chance():
    """Six times as much without any, three and a half times where it turns the body by a tenth of a radian."""
    rates = np.zeros((1, 20))
    rates[0, 12] = 1.0
    found = defects(rates, np.zeros(1), np.array([6]))
    distance = np.array([1e-3 * found.coarse])
    usual, little, none = (found.error(distance, 1, 1.0, turn)[0] for turn in (np.inf, 0.1, 0.0))
    assert little == pytest.approx(3.5 * usual)
    assert none == pytest.approx(6.0 * usual)
