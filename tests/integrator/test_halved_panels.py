"""Panels in halves for the steps: the same function, and fewer steps."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from benchmarks.cases import as_function, numbered_case

import shapephase as sp
from shapephase.integrator.integrate import stepped_rotation
from shapephase.integrator.panels.halved_panels import halved_edges, halved_series
from shapephase.integrator.sampling import FinishedSampler

EPS = np.finfo(float).eps


@pytest.mark.parametrize("fast", ["0", "1"])
@pytest.mark.parametrize(("terms", "kept"), [(41, 34), (40, 33), (31, 26), (6, 6), (2, 2), (1, 1)])
def test_halves_are_the_same_series(monkeypatch: pytest.MonkeyPatch, terms: int, kept: int, fast: str):
    """To rounding, beside NumPy's sum of the whole one."""
    monkeypatch.setenv("SHAPEPHASE_FAST", fast)
    rng = np.random.default_rng(2)
    series = rng.normal(size=(3, terms, 9)) * np.exp(-np.arange(terms))[:, None]
    series[:, 0] += 1e3
    halves, places = halved_series(series), np.linspace(-1.0, 1.0, 50)
    assert halves.shape == (6, kept, 9)
    for panel, half in product(range(3), (0, 1)):
        there = np.polynomial.chebyshev.chebval(0.5 * places + half - 0.5, series[panel])
        found = np.polynomial.chebyshev.chebval(places, halves[2 * panel + half])
        np.testing.assert_allclose(found, there, rtol=4.0 * EPS, atol=0.0)
    np.testing.assert_array_equal(halved_edges(np.array([0.0, 1.0, 4.0])), [0.0, 0.5, 1.0, 2.5, 4.0])


def test_panels_are_halved_where_they_take_many_steps():
    """Not without momentum; with it, steps are fewer than on whole panels, and the result is the same."""
    case = numbered_case(10)
    box = sp.articulated(case.body, as_function(case.path))
    motion, still = sp.reconstruct(box, case.momentum), sp.reconstruct(box, np.zeros(3))
    cut = motion.stepped.interpolant
    assert still.stepped.interpolant.sampled is None
    assert cut.sampled is not None
    whole = replace(cut, edges=cut.edges[::2], coefficients=cut.sampled, sampled=None)
    other = stepped_rotation(FinishedSampler(whole), motion.stepped.momentum, 1e-9)
    assert motion.stepped.steps.sum() < 0.7 * other.steps.sum()
    gap = sp.so3.angle(sp.so3.transpose(other.end[0]) @ motion.stepped.end[0])
    assert gap < other.error_estimate[0] + motion.error_estimate
