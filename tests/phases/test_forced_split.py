"""The split of a motion under a torque from outside: the angle of the attitude against the three parts of the phase."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import GaugeError
from support.independent import geodesic_turn, wrapped

GAUGES = ("base", "horizontal", "principal", "mean_body")


@pytest.fixture(scope="module")
def motion():
    """Nothing of it closes."""
    cat = sp.load_body("cat_two_halves")
    deformation = sp.articulated(cat, sp.examples.kane_scher(0.3, 1.0))

    def torque(state):
        return [0.002 * np.cos(3.0 * state.time), 0.001, -0.01 * state.rate[2]]

    return sp.reconstruct(deformation, [0.004, -0.002, 0.005], torque=torque)


@pytest.mark.parametrize("gauge", GAUGES)
def test_the_three_parts_are_the_angle_of_the_attitude(motion, gauge):
    """Without the solid angle in space it would be off by far more than the estimate."""
    found = sp.split(motion, gauge)
    assert found.residual <= found.error_estimate < 1e-8
    assert min(found.body_gap, found.space_gap) > 0.1, "the closing must matter"
    assert abs(wrapped(found.space_solid_angle)) > 0.05
    assert np.allclose(found.total_rotation, found.dynamical_rotation @ found.holonomy, atol=1e-14)


def test_the_angle_in_the_base_gauge_by_hand(motion):
    """Attitudes and momenta at both ends alone, with shortest turns of another formula."""
    found = sp.split(motion, "base")
    ends = [0.0, motion.duration]
    (first, last), (pi, end_pi) = motion.attitude(ends), motion.body_momentum(ends)
    mu, end_mu = (vector / np.linalg.norm(vector) for vector in motion.momentum(ends))
    u, v = (vector / np.linalg.norm(vector) for vector in (pi, end_pi))
    turned = geodesic_turn(end_mu, mu) @ last @ geodesic_turn(v, u).T @ first.T
    np.testing.assert_allclose(turned, sp.so3.exp(found.phase * mu), rtol=0, atol=1e-9)


def test_without_a_torque_it_is_the_split_of_a_free_motion(motion):
    still = sp.reconstruct(motion.deformation, motion.initial_momentum, torque=lambda _: np.zeros(3))
    free = sp.split(sp.reconstruct(motion.deformation, motion.initial_momentum))
    found = sp.split(still)
    assert found.space_solid_angle == pytest.approx(0.0, abs=1e-12)
    assert wrapped(found.phase - free.montgomery_phase) == pytest.approx(0.0, abs=1e-8)
    assert found.dynamic_phase == pytest.approx(float(free.dynamic_phase), abs=1e-8)
    np.testing.assert_allclose(found.holonomy, free.holonomy, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.total_rotation, free.total_rotation, rtol=0, atol=1e-8)


def test_where_both_curves_close_the_body_is_turned_by_the_phase():
    """A ball is driven round a cone by a torque in space: its momentum comes back, and so does that of the body.

    Both rates are chosen so: the momentum mu goes round z at the rate w, and Pi about the body's axis at rest in it.
    With omega = mu/I the attitude is R = exp(w t z) exp((mu/I - w z) t) and the phase that of its last turn.
    """
    inertia, size, polar, turns = 2.0, 3.0, 0.7, 2
    rate = 1.1
    mu = size * np.array([np.sin(polar), 0.0, np.cos(polar)])
    slip = mu / inertia - rate * np.array([0.0, 0.0, 1.0])
    # In the body the momentum goes round this axis; it is back after a whole turn of both.
    duration = 2.0 * np.pi * turns / rate

    def torque(state):
        return rate * np.cross([0.0, 0.0, 1.0], state.attitude @ state.momentum)

    body = sp.rigid(inertia * np.eye(3), duration)
    motion = sp.reconstruct(body, mu, torque=sp.ExternalTorque(torque, "space"))
    np.testing.assert_allclose(motion.final_attitude, sp.so3.exp(slip * duration), rtol=0, atol=1e-9)
    found = sp.split(motion, "base")
    assert found.space_gap < 1e-9
    # A cap of the sphere, gone round twice, counted modulo 4 pi.
    cap = 2.0 * np.pi * turns * (1.0 - np.cos(polar))
    assert 2.0 * wrapped(0.5 * (found.space_solid_angle - cap)) == pytest.approx(0.0, abs=1e-9)
    assert found.dynamic_phase == pytest.approx(size / inertia * duration, rel=1e-12)
    assert found.residual <= found.error_estimate


@pytest.mark.full
def test_a_momentum_that_passes_through_zero_is_refused():
    body = sp.rigid(np.diag([1.0, 1.5, 2.0]), 2.0)
    brake = sp.ExternalTorque(lambda _: [0.0, 0.0, -1.0], "space")
    with pytest.raises(GaugeError, match="momentum"):
        sp.split(sp.reconstruct(body, [0.0, 0.0, 1.0], torque=brake))
    with pytest.raises(GaugeError, match="momentum"):
        sp.split(sp.reconstruct(body, [0.0, 0.0, 0.0], torque=brake))
    past = sp.split(sp.reconstruct(body, [0.0, 0.01, 1.0], torque=brake), "base")
    assert past.residual <= past.error_estimate
