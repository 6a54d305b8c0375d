"""Inertia and momentum of a tree of links: right to rounding, compiled or not."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from benchmarks.body_leaf import leaves

import shapephase as sp
from shapephase.errors import SingularInertiaError
from shapephase.integrator.link_tree import (
    tree_channels,
    tree_inertia_and_momentum,
)
from support.bodies import joint, link, random_shapes, urdf
from support.compiler import needs_compiler

EPS = np.finfo(float).eps


@needs_compiler
def test_random_bodies_are_rounded_like_their_terms():
    """Eighty of the two thousand of `benchmarks/body_leaf.py`, half of them with joints 100 m away."""
    found = leaves(80, 7)
    assert max(leaf.joints for leaf in found) == 12
    for leaf in found:
        assert leaf.kernel <= leaf.allowed
        assert leaf.pinocchio <= leaf.allowed
    assert max(leaf.kernel for leaf in found) <= max(leaf.pinocchio for leaf in found)


def test_the_kernel_agrees_with_pinocchio(body, rng):
    """A joint's angle may be many turns: cosines of a million radians come from the usual functions."""
    shapes, rates = random_shapes(body, rng, 21), rng.normal(size=(21, body.n_shape))
    turning = np.array([unit == "rad" for unit in body.joint_units])
    shapes[7] += 2.0 * np.pi * 1000.0 * turning
    shapes[13] += 1e6 * turning
    inertia, momentum = tree_inertia_and_momentum(body.chain.rows, shapes, rates)
    expected, expected_momentum = body.sample(shapes, rates)
    # Pinocchio is given the same angles; both round some hundred terms.
    size = np.abs(expected).max()
    assert np.abs(inertia - expected).max() < 1e-14 * size
    assert np.abs(momentum - expected_momentum).max() < 1e-13 * size
    channels = tree_channels(body.chain.rows, shapes, rates)
    inverse = np.linalg.inv(expected)
    assert np.allclose(channels[:, :6], inverse.reshape(-1, 9)[:, [0, 4, 8, 5, 2, 1]], rtol=0, atol=1e-12 / size)
    assert np.allclose(channels[:, 6:], (inverse @ expected_momentum[..., None])[..., 0], rtol=0, atol=1e-11)


def test_interpreted_kernels_give_the_same_bits(monkeypatch, body, rng):
    shapes, rates = random_shapes(body, rng, 3), rng.normal(size=(3, body.n_shape))
    shapes[1] += 1e6
    compiled = tree_channels(body.chain.rows, shapes, rates)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    np.testing.assert_array_equal(tree_channels(body.chain.rows, shapes, rates), compiled)


def test_a_shape_s_result_does_not_depend_on_its_companions(body, rng):
    shapes, rates = random_shapes(body, rng, 19), rng.normal(size=(19, body.n_shape))
    whole = tree_channels(body.chain.rows, shapes, rates)
    alone = [tree_channels(body.chain.rows, shapes[i : i + 1], rates[i : i + 1])[0] for i in range(19)]
    assert np.array_equal(whole, alone)


def test_a_singular_body_is_left_to_code_that_names_it(monkeypatch, load_urdf):
    rod = load_urdf(
        urdf(
            link("a", 1.0, (1e-18, 1.0, 1.0)), link("b", 1.0, (1e-18, 1.0, 1.0), com=(0.3, 0.0, 0.0)),
            joint("hinge", "revolute", "a", "b", axis=(1.0, 0.0, 0.0)),
        )
    )  # fmt: skip
    assert tree_channels(rod.chain.rows, np.zeros((2, 1)), np.zeros((2, 1))) is None
    deformation = sp.articulated(rod, sp.ShapePath.fourier([0.0], [[0.1]], [[0.2]], 1.0))
    said = []
    for value in ("0", "1"):
        monkeypatch.setenv("NUMBA_DISABLE_JIT", value)
        with pytest.raises(SingularInertiaError) as raised:
            sp.reconstruct(deformation, [0.1, 0.0, 0.0])
        said.append(str(raised.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("interpreted", ["0", "1"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_left_to_slower_code(monkeypatch, value, interpreted):
    """Which says at what time."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", interpreted)
    body = sp.load_body("cat_two_halves")
    for which in range(2):
        motion = np.zeros((2, 3, 3))
        motion[which, 1] = value
        assert tree_channels(body.chain.rows, *motion) is None


def test_a_pickled_body_has_its_rows(body):
    body.chain.rows  # noqa: B018 (kept from now on)
    again = pickle.loads(pickle.dumps(body))
    assert np.array_equal(again.chain.rows.rows, body.chain.rows.rows)
