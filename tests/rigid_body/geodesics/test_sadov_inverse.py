"""From action and angle variables back to Andoyer's: round trips, and free motions as straight lines."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.rigid_body import EulerTop
from shapephase.rigid_body.geodesics import (
    andoyer_from_sadov,
    andoyer_variables,
    sadov_frequencies,
    sadov_variables,
    serret_andoyer_metric,
)
from support.independent import assert_within

ORDERS = ([3.0, 2.0, 1.0], [1.0, 2.0, 3.0], [2.0, 3.0, 1.0], [1.0, 3.0, 2.0])


def side_of(moments, momenta):
    """The side of the axis that each momentum circles, from its definition."""
    metric = serret_andoyer_metric(moments)
    own = momenta @ metric.andoyer_axes
    return np.where(metric.geodesics_of(momenta).is_oscillating, np.sign(own[..., 0]), np.sign(own[..., 2]))


def back(moments, sadov, side):
    angles = np.stack([sadov.own, sadov.precession, sadov.node], axis=-1)
    actions = np.stack([sadov.action, sadov.total, sadov.vertical], axis=-1)
    return andoyer_from_sadov(moments, angles, actions, side)


@pytest.mark.parametrize("moments", ORDERS)
def test_there_and_back_r15(moments):
    rng = np.random.default_rng(5)
    attitude, momentum = so3.exp(1.5 * rng.normal(size=(200, 3))), rng.normal(size=(200, 3))
    sadov = sadov_variables(moments, andoyer_variables(attitude, momentum))
    again = back(moments, sadov, side_of(moments, momentum))
    # Next to the separatrix angle variables lose digits in proportion to 1/m1.
    allowed = 100.0 * np.finfo(float).eps / serret_andoyer_metric(moments).geodesics_of(momentum).complement
    assert np.all(np.abs(again.body_momentum - momentum).max(axis=-1) < allowed * np.linalg.norm(momentum, axis=-1))
    assert np.all(np.abs(again.attitude - attitude).max(axis=(-2, -1)) < allowed)
    assert np.median(allowed) < 2e-13


@pytest.mark.parametrize("moments", ORDERS)
@pytest.mark.parametrize("momentum", [(1.5, 0.3, 0.4), (0.2, -0.5, -1.4)])
def test_a_free_motion_is_a_straight_line_r15(moments, momentum):
    """Angles that advance evenly give the attitude of `EulerTop`, which knows nothing of them."""
    start = so3.exp(np.array([0.3, -0.2, 0.9]))
    top = EulerTop.principal(moments, momentum, start)
    sadov = sadov_variables(moments, andoyer_variables(start, momentum))
    times = np.linspace(0.0, 30.0, 41)
    angles = np.stack(
        [
            sadov.own + sadov.own_rate * times,
            sadov.precession + sadov.precession_rate * times,
            sadov.node + 0.0 * times,
        ],
        axis=-1,
    )
    actions = np.array([sadov.action, sadov.total, sadov.vertical])
    found = andoyer_from_sadov(moments, angles, actions, side_of(moments, np.array(momentum)))
    assert np.abs(found.attitude - top.attitude(times)).max() < 1e-12
    assert np.abs(found.body_momentum - top.body_momentum(times)).max() < 1e-12


@pytest.mark.parametrize(("moments", "symmetry"), [([3.0, 3.0, 1.0], 2), ([3.0, 1.0, 1.0], 0), ([2.0, 2.0, 2.0], 2)])
def test_of_two_equal_moments_the_error_says_which_variables_to_take_r15(moments, symmetry):
    """And it is right: l and g of Andoyer's, about the axis of symmetry, grow evenly at these rates."""
    momentum, times = np.array([0.6, 0.3, 0.4]), np.linspace(0.0, 1.5, 4)
    order = [(symmetry + 1) % 3, (symmetry + 2) % 3, symmetry]
    top = EulerTop.principal(np.array(moments)[order], momentum[order])
    found = andoyer_variables(top.attitude(times), top.body_momentum(times))
    equal, own = moments[order[0]], moments[symmetry]
    size, along = np.linalg.norm(momentum), momentum[symmetry]
    for angle, rate in ((found.l, along * (1.0 / own - 1.0 / equal)), (found.g, size / equal)):
        assert_within(so3.wrap(angle - angle[0] - rate * times), 0.0, 1e-13)
    state = andoyer_variables(np.eye(3), momentum)
    for call in (
        lambda: sadov_variables(moments, state),
        lambda: sadov_frequencies(moments, momentum),
        lambda: andoyer_from_sadov(moments, [0.0, 0.0, 0.0], [0.5, 1.0, 0.2]),
    ):
        with pytest.raises(ShapeError, match="andoyer_variables"):
            call()


def test_the_ends_of_the_action_and_what_is_refused():
    along = andoyer_from_sadov([3.0, 2.0, 1.0], [0.4, 0.5, 0.6], [0.0, 2.0, 0.3], -1.0)
    assert along.body_momentum == pytest.approx([-2.0, 0.0, 0.0], abs=1e-15)
    along = andoyer_from_sadov([3.0, 2.0, 1.0], [0.4, 0.5, 0.6], [2.0, 2.0, 0.3])
    # Andoyer's variables themselves have half of the digits at L = G.
    assert along.body_momentum == pytest.approx([0.0, 0.0, 2.0], abs=1e-7)
    for angles, actions, side in (
        ([0.0, 0.0, 0.0], [3.0, 2.0, 0.0], 1.0),
        ([0.0, 0.0, 0.0], [-0.1, 2.0, 0.0], 1.0),
        ([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], 1.0),
        ([0.0, 0.0, 0.0], [0.1, 1.0, 0.0], 0.5),
        ([0.0, 0.0], [0.1, 1.0, 0.0], 1.0),
        ([0.0, 0.0, 0.0], [0.1, 1.0, 2.0], 1.0),
    ):
        with pytest.raises(ShapeError):
            andoyer_from_sadov([3.0, 2.0, 1.0], angles, actions, side)
