"""Inertia tensors against point masses, 50-digit inverses and refusals."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from shapephase.errors import SingularInertiaError
from shapephase.inertia_tensor import (
    ascending_moments,
    inverse_inertia,
    principal_axes,
    second_moment,
    triangle_defect,
)

laws = settings(derandomize=True, max_examples=60, deadline=None)


def turned(moments, seed):
    axes = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    tensor = axes @ np.diag(moments) @ axes.T
    return 0.5 * (tensor + tensor.T)


def mp_inverse(tensor):
    with mpmath.workdps(50):
        inverse = mpmath.matrix(tensor.tolist()) ** -1
        return np.array([[float(inverse[i, j]) for j in range(3)] for i in range(3)])


# The adjugate is used where det > 1e-5 trace^3, LAPACK below: both sides, thin rods and flat plates.
SPREADS = (
    (3, 2, 1),
    (1, 1, 1),
    (1, 1, 1e-4),
    (1, 1, 9e-5),
    (1, 1, 7e-5),
    (1, 1, 1e-7),
    (1, 1e-3, 1e-3),
    (1, 0.006, 0.004),
)


@pytest.mark.parametrize("moments", SPREADS)
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_inverse_against_50_digits(moments, scale):
    for seed in range(3):
        tensor = turned(scale * np.array(moments), seed)
        exact = mp_inverse(tensor)
        inverse = inverse_inertia(tensor)
        condition = max(moments) / min(moments)
        np.testing.assert_allclose(inverse, exact, rtol=0, atol=2e-15 * condition * np.abs(exact).max())
        np.testing.assert_array_equal(inverse, inverse.T)


def test_inverse_of_a_batch_is_that_of_each(rng):
    tensors = np.array([[turned(rng.uniform(1, 3, 3), 7 * i + j) for j in range(3)] for i in range(2)])
    tensors[1, 2] = turned([1.0, 1.0, 1e-8], 5)  # one of them sends the batch down the careful branch
    together = inverse_inertia(tensors)
    for i in range(2):
        for j in range(3):
            exact = mp_inverse(tensors[i, j])
            bound = 2e-15 * np.linalg.cond(tensors[i, j]) * np.abs(exact).max()
            np.testing.assert_allclose(together[i, j], exact, rtol=0, atol=bound)


@pytest.mark.parametrize(
    "moments",
    [
        (0, 0, 0), (1, 1, 0), (1, 0, 0), (1, 1, -1), (1, -1, -1), (-1, -1, -1), (1, 1, -1000), (1, -1000, 1),
        (-1000, 1, 1), (1e-3, 1e-3, -1), (1, 1, 1e-13), (np.nan, 1, 1), (np.inf, 1, 1),
    ],
)  # fmt: skip
def test_what_no_body_can_divide_by_is_refused_with_its_time(moments):
    tensors = np.stack([np.diag([1.0, 2.0, 3.0]), np.diag(np.array(moments, dtype=float))])
    with pytest.raises(SingularInertiaError, match=r"0\.25"):
        inverse_inertia(tensors, np.array([0.0, 0.25]))
    with pytest.raises(ArithmeticError):
        inverse_inertia(tensors[1])


@pytest.mark.parametrize("moments", [(1, 1, -1), (1, -1, -1), (-1, -1, -1), (3, -1, -1), (1, 1, -1000), (-1, -2, 0.1)])
def test_indefinite_tensors_are_refused_in_any_axes(moments):
    for seed in range(20):
        with pytest.raises(SingularInertiaError):
            inverse_inertia(turned(np.array(moments, dtype=float), seed))


def test_the_bound_of_what_is_singular():
    """The least moment must be above 1e-12 of the largest."""
    np.testing.assert_allclose(
        inverse_inertia(np.diag([1.0, 1.0, 1.5e-12])), np.diag([1.0, 1.0, 1 / 1.5e-12]), rtol=1e-14
    )
    with pytest.raises(SingularInertiaError):
        inverse_inertia(np.diag([1.0, 1.0, 0.9e-12]))


@laws
@given(arrays(np.float64, 3, elements=st.floats(-50.0, 50.0)), st.integers(0, 50))
def test_only_positive_definite_tensors_pass(moments, seed):
    tensor = turned(moments, seed)
    least, largest = np.min(moments), np.max(np.abs(moments))
    if least > 1e-6 * largest:
        np.testing.assert_allclose(inverse_inertia(tensor) @ tensor, np.eye(3), atol=1e-14 * largest / least, rtol=0)
    elif least < 0.0:
        with pytest.raises(SingularInertiaError):
            inverse_inertia(tensor)


def test_second_moment_is_that_of_the_mass(rng):
    """A4: J = tr(I)/2 - I = sum m r r^T."""
    masses, points = rng.uniform(0.5, 2, 9), rng.normal(size=(9, 3))
    moment = np.einsum("m,mi,mj->ij", masses, points, points)
    inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    np.testing.assert_allclose(second_moment(inertia), moment, atol=1e-13, rtol=0)
    stacked = np.stack([inertia, 2 * inertia])
    np.testing.assert_allclose(second_moment(stacked), [moment, 2 * moment], atol=1e-13, rtol=0)


@laws
@given(arrays(np.float64, (4, 3), elements=st.floats(-3.0, 3.0)), arrays(np.float64, 4, elements=st.floats(0.1, 5.0)))
def test_every_set_of_masses_keeps_the_triangle_inequality(points, masses):
    """A4: equivalently the second moment is positive semidefinite."""
    points = points + np.array([0.0, 0.0, 4.0])
    inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    assert triangle_defect(inertia) <= 1e-14
    moments = np.linalg.eigvalsh(second_moment(inertia))
    assert moments[0] >= -1e-13 * moments[2]
    assert triangle_defect(inertia) == pytest.approx(-2 * moments[0] / np.linalg.eigvalsh(inertia)[2], abs=1e-13)


def test_triangle_defect_of_known_bodies():
    """A flat plate sits on the edge of what is possible, a cube well inside, (1, 1, 3) outside."""
    assert triangle_defect(np.diag([1.0, 2.0, 3.0])) == pytest.approx(0.0, abs=1e-15)
    assert triangle_defect(np.eye(3)) == pytest.approx(-1.0)
    np.testing.assert_allclose(triangle_defect(np.stack([np.diag([1.0, 1, 3]), turned([3, 1, 1], 2)])), 1 / 3)


def test_principal_axes():
    """A11: ascending moments, a proper frame, inertia = axes diag axes^T, at ties too."""
    for seed, moments in enumerate([(3, 2, 1), (1, 1, 2), (2, 1, 2), (5, 5, 5), (1e-6, 1, 1)]):
        tensor = turned(moments, seed)
        found, axes = principal_axes(tensor)
        np.testing.assert_allclose(found, np.sort(moments), rtol=1e-13, atol=1e-15 * max(moments))
        np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, tensor, atol=4e-15 * max(moments), rtol=0)
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=2e-15, rtol=0)
        assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-14)


def test_principal_axes_of_a_batch(rng):
    tensors = np.array([[turned(rng.uniform(1, 3, 3), 5 * i + j) for j in range(5)] for i in range(4)])
    moments, axes = principal_axes(tensors)
    assert moments.shape == (4, 5, 3)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, atol=1e-14, rtol=0)
    np.testing.assert_allclose(tensors @ axes, axes * moments[..., None, :], atol=1e-14, rtol=0)


def test_ascending_moments_say_where_each_stood_and_with_what_parity(rng):
    for order in itertools.permutations(range(3)):
        moments = np.array([0.4, 1.1, 2.0])[list(order)]
        ascending, where, parity = ascending_moments(moments)
        assert np.array_equal(ascending, [0.4, 1.1, 2.0])
        assert np.array_equal(moments[where], ascending)
        assert parity == np.round(np.linalg.det(np.eye(3)[:, where]))
    batch = rng.uniform(0.1, 2.0, (2, 5, 3))
    ascending, where, parity = ascending_moments(batch)
    assert np.array_equal(ascending, np.sort(batch, axis=-1))
    assert np.array_equal(np.take_along_axis(batch, where, -1), ascending)
    assert np.array_equal(parity, np.round(np.linalg.det(np.eye(3)[where])))
    assert np.array_equal(ascending_moments(np.array([2.0, 1.0, 2.0]))[1], [1, 0, 2])
