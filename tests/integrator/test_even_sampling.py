"""Loops at even times: kernels and arrays are one formula, and a second motion looks at nothing twice."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import shapephase as sp
from shapephase.arrays import Array
from shapephase.integrator._spectral_error import Channels
from shapephase.integrator.even.even_sampling import EvenSampler, _even_to_panel
from shapephase.integrator.panels.panel_sampling import PanelSampler
from support.both_engines import both

pytestmark = pytest.mark.usefixtures("fast")

EPS = float(np.finfo(float).eps)


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


@pytest.mark.parametrize(
    ("count", "panels", "degree", "highest"), [(96, 12, 22, 48), (96, 6, 32, 40), (448, 56, 22, 224)]
)
def test_the_transform_to_panels_is_right_to_rounding(count: int, panels: int, degree: int, highest: int):
    """Beside sums of cosines in fifty digits; summed in doubles they were off by a hundred units of rounding."""
    matrix = _even_to_panel(count, panels, degree, highest)
    with mpmath.workdps(50):
        for column in (0, 7, count // 2 + 1):
            values = []
            for node in range(degree + 1):
                share = (1 - mpmath.cospi(mpmath.mpf(node) / degree)) / (2 * panels) - mpmath.mpf(column) / count
                terms = [mpmath.cospi(2 * k * share) for k in range(1, highest + 1)]
                last = 1 if highest == count // 2 else 2
                values.append((1 + 2 * sum(terms[:-1]) + last * terms[-1]) / count)
            for row in (0, 1, degree // 2, degree):
                weights = [0.5 if node in (0, degree) else 1.0 for node in range(degree + 1)]
                cosines = [mpmath.cospi(mpmath.mpf(row * (degree - node)) / degree) for node in range(degree + 1)]
                exact = sum(a * b * c for a, b, c in zip(weights, cosines, values, strict=True)) * 2 / degree
                exact *= 0.5 if row in (0, degree) else 1.0
                assert abs(matrix[row, column] - float(exact)) < 4.0 * EPS / np.sqrt(count)


def test_a_loop_is_sampled_as_its_swing_asks():
    """A gentle loop takes few samples, a wide one as many as it needs at once."""
    body = sp.load_body("cat")
    counts = []
    for size in (0.02, 0.3, 1.0, 2.5):
        sines = np.zeros((body.n_shape, 2))
        sines[body.joint_names.index("waist_yaw")] = size, 0.3 * size
        path = sp.ShapePath.fourier(np.zeros(body.n_shape), 0.0 * sines, sines, 1.0)
        assert path.swing == pytest.approx(1.6 * size, rel=1e-15)
        assert path.stretched(2.0).reversed().repeated(3).swing == path.swing
        counts.append(sp.reconstruct(sp.articulated(body, path), np.zeros(3)).evaluations)
    assert counts == sorted(counts)
    assert counts[0] < 0.5 * counts[-1]
