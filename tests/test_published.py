"""The page of published numbers: each number computed anew, and the page as it is committed."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from benchmarks.published import PAGE, Entry, entries, said_of, table, with_results
from scipy.integrate import solve_ivp
from scipy.optimize import root

from shapephase import so3

ENTRIES = entries()
RESULTS = PAGE.read_text(encoding="utf-8").partition("<!-- results -->")[2]
ROWS = [line for line in RESULTS.splitlines() if line.startswith("| ") and not line.startswith("| what")]
AXIAL, ACROSS = 0.0025, 0.01
"""Moments of each half of the cat [kg m^2]."""
# Angle [rad], start of the costates of both halves [J s] and least cost [J s], from the equations below.
OPTIMA = [
    (0.5 * np.pi, [0.01452, 0.01606, -0.01069], 0.0372037571433),
    (np.pi, [-0.01933, 0.02348, -0.01880], 0.0904943496813),
]


@pytest.mark.parametrize(
    "number",
    [pytest.param(k, marks=pytest.mark.full if e.is_slow else (), id=e.what) for k, e in enumerate(ENTRIES)],
)
def test_the_library_has_the_published_number_and_the_page_what_is_computed(number: int):
    """The page's own digits may differ in the last one, by what rounding does on another machine."""
    entry, row = ENTRIES[number], ROWS[number]
    computed = entry.computed()
    assert entry.holds(computed), computed
    what, printed, shown, _ = (cell.strip() for cell in row.strip("|").split(" | "))
    assert what == entry.what
    assert said_of(entry) in RESULTS
    # Units follow a no-break space, degrees their number at once.
    printed, shown = (re.split(r"[\s…°]", cell)[0] for cell in (printed, shown))
    assert printed == entry.published
    assert float(shown) == pytest.approx(computed, abs=1.1 * 10.0 ** -len(shown.partition(".")[2]), rel=0.0)


def test_the_page_has_all_of_them_and_no_others():
    assert len(ROWS) == len(ENTRIES)
    text = PAGE.read_text(encoding="utf-8")
    found = [(entry, float(entry.published)) for entry in ENTRIES]
    written = with_results(text, table(found))
    assert [line for line in written.splitlines() if "{cite:t}" in line] == [
        line for line in text.splitlines() if "{cite:t}" in line
    ]
    assert written.partition("<!-- results -->")[0] == text.partition("<!-- results -->")[0]


def test_a_number_that_differs_in_its_last_printed_digit_does_not_hold():
    entry = Entry(
        topic="", what="", source="", inputs="", published="-1.250", unit="", computed=lambda: 0.0, within=None
    )
    numbers = (-1.2506, -1.2504, -1.2499, -1.2496, -1.2494)
    assert [entry.holds(number) for number in numbers] == [False, True, True, True, False]
    cut = dataclasses.replace(entry, truncated=True)
    assert [cut.holds(number) for number in (-1.2511, -1.2509, -1.2499)] == [False, True, False]
    loose = dataclasses.replace(entry, within=0.02)
    assert [loose.holds(number) for number in (-1.271, -1.269)] == [False, True]


@pytest.mark.parametrize(("angle", "half", "cost"), [pytest.param(*case, marks=pytest.mark.full) for case in OPTIMA])
def test_the_costs_of_the_cat_by_two_free_bodies_that_share_no_momentum(angle: float, half: list[float], cost: float):
    """Montgomery's problem as geodesics on two rotations, by SciPy alone: from straight to straight in a second.

    With costates p of both, n = R^T nu and nu = (sum R I R^T)^-1 sum R p, the rates are I^-1 p - n, and
    p' = p x rate + I rate x n.
    """
    inertia, inverse = np.diag([AXIAL, ACROSS, ACROSS]), np.diag(1.0 / np.array([AXIAL, ACROSS, ACROSS]))

    def slope(_: float, state: np.ndarray) -> np.ndarray:
        attitudes, costates = state[:18].reshape(2, 3, 3), state[18:].reshape(2, 3)
        whole = sum(r @ inertia @ r.T for r in attitudes)
        shared = np.linalg.solve(whole, sum(r @ p for r, p in zip(attitudes, costates, strict=True)))
        near = [r.T @ shared for r in attitudes]
        rates = [inverse @ p - n for p, n in zip(costates, near, strict=True)]
        turned = [r @ so3.hat(w) for r, w in zip(attitudes, rates, strict=True)]
        pushed = [np.cross(p, w) + np.cross(inertia @ w, n) for p, w, n in zip(costates, rates, near, strict=True)]
        return np.concatenate([*(t.ravel() for t in turned), *pushed])

    def miss(start: np.ndarray) -> np.ndarray:
        begin = np.concatenate([np.tile(np.eye(3).ravel(), 2), start])
        end = solve_ivp(slope, (0.0, 1.0), begin, method="DOP853", rtol=1e-12, atol=1e-13).y[:18, -1]
        goal = so3.exp(np.array([angle, 0.0, 0.0]))
        return np.ravel(so3.log(goal.T @ end.reshape(2, 3, 3)))

    found = root(miss, np.array([half[0], half[1], half[2], half[0], -half[1], -half[2]]))
    assert np.abs(found.fun).max() < 1e-10
    first, second = found.x.reshape(2, 3)
    together = first + second
    energy = 0.5 * (first @ inverse @ first + second @ inverse @ second - 0.5 * together @ inverse @ together)
    assert energy == pytest.approx(cost, abs=2e-13)
    published = next(e.published for e in ENTRIES if e.what.endswith(f"by {np.degrees(angle):.0f}°") and e.is_slow)
    assert energy == pytest.approx(float(published), abs=0.5e-10)
