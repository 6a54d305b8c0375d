"""Loops at even times: kernels and arrays are one formula, and a second motion looks at nothing twice."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase.arrays import Array
from shapephase.integrator._even_sampling import EvenSampler
from shapephase.integrator._spectral_error import Channels
from shapephase.integrator.panels.panel_sampling import PanelSampler
from support.both_engines import both

pytestmark = pytest.mark.usefixtures("fast")


@pytest.mark.parametrize("decay", [0.2, 0.6, 3.0])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("bump", [0.0, 1e-4])
def test_kernels_and_arrays_are_one_formula(
    monkeypatch: pytest.MonkeyPatch, decay: float, tolerance: float, bump: float
):
    """Of a spectrum that falls, and of one with something that the samples miss: estimates and samples agree."""
    rng = np.random.default_rng(7)
    parts = rng.normal(size=(2, 40, 9)) * np.exp(-decay * np.arange(40.0))[:, None]

    def swinging(t: Array) -> tuple[Array, Array]:
        phase = 2.0 * np.pi * np.outer(t, np.arange(40.0))
        found = np.cos(phase) @ parts[0] + np.sin(phase) @ parts[1] + bump * np.cos(768.0 * np.pi * t)[:, None]
        inertia = 9.0 * np.eye(3) + 0.1 * (found[:, :6] @ _VOIGT).reshape(-1, 3, 3)
        return inertia, found[:, 6:]

    def run() -> tuple[bool, float, float, Array]:
        sampler = EvenSampler(Channels(swinging), 1.0, 1, 4.0)
        done = sampler.refine(2.0, tolerance)
        perturbed = sampler.perturbed(2.0)
        return done, sampler.error(2.0), perturbed.hidden, sampler.interpolant().coefficients

    arrays, kernels = both(monkeypatch, run)
    assert arrays[0] == kernels[0]
    np.testing.assert_allclose(kernels[1:3], arrays[1:3], rtol=1e-12)
    np.testing.assert_array_equal(kernels[3], arrays[3])


_VOIGT = np.zeros((6, 9))
for _row, _entries in enumerate(((0,), (4,), (8,), (5, 7), (2, 6), (1, 3))):
    _VOIGT[_row, list(_entries)] = 1.0


def test_the_first_panels_of_a_path_are_known_to_its_next_motion():
    """The path is asked once for where it rests; other tolerances have first panels of their own."""
    asked = []

    def moving(t: Array) -> Array:
        asked.append(len(t))
        return np.where(t > 1.0, np.sin(t - 1.0), 0.0)[:, None] * np.ones(2)

    def evaluate(t: Array) -> tuple[Array, Array]:
        return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), moving(t) @ np.ones((2, 3))

    known: dict[object, object] = {}
    series = []
    for tolerance in (1e-9, 1e-9, 1e-6):
        sampler = PanelSampler(Channels(evaluate), np.array([0.0, 1.0, 2.0]), 1, 2.0, moving, known=known)
        before = len(asked)
        sampler.refine(1.0, tolerance)
        series.append((len(asked) - before, sampler.series))
    (first, one), (second, two), (third, three) = series
    assert second < first == third
    assert one.degree[0] == two.degree[0] == 0 < one.degree[1]
    np.testing.assert_array_equal(one.coefficients, two.coefficients)
    assert three.degree[1] < one.degree[1]
