"""The channels of a body, from its inertia and internal momentum."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from shapephase.errors import SingularInertiaError
from shapephase.integrator._spectral_error import inverted

EPS = np.finfo(float).eps


def test_channels_against_fifty_digits():
    """Of tensors of condition numbers up to 1e9, which magnify rounding by as much."""
    rng = np.random.default_rng(4)
    for power in range(10):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        tensor = axes * 10.0 ** np.array([0.0, -0.5 * power, -1.0 * power]) @ axes.T
        tensor, momentum = 0.5 * (tensor + tensor.T), rng.normal(size=3)
        found = inverted(tensor[None], momentum[None], np.zeros(1))[0]
        with mpmath.workdps(50):
            exact = mpmath.matrix(tensor.tolist()) ** -1
            drift = exact * mpmath.matrix(momentum.tolist())
            entries = [exact[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))]
            whole = np.array([float(one) for one in [*entries, *drift]])
        limit = 8.0 * EPS * 10.0**power * np.array([np.abs(whole[:6]).max()] * 6 + [np.abs(whole[6:]).max()] * 3)
        assert (np.abs(found - whole) <= limit).all()


@pytest.mark.parametrize("moments", [[1.0, 1.0, 0.0], [10.0, 1.0, -2.0], [1.0, 1.0, 1e-13], [1.0, 1.0, np.nan]])
def test_no_channels_of_a_tensor_that_is_none(moments: list[float]):
    """Singular, indefinite with a positive trace, nearly singular, or no number; among good ones."""
    tensors = np.tile(np.diag([1.0, 2.0, 2.5]), (5, 1, 1))
    tensors[3] = np.diag(moments)
    with pytest.raises(SingularInertiaError):
        inverted(tensors, np.zeros((5, 3)), np.arange(5.0))
