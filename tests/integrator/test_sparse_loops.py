"""Loops of few harmonics, whose spectra have gaps: no estimate may take a gap for convergence."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.integrator import Sampler, Smoothness
from support.independent import collocated_attitude
from support.long_runs import full_but

# Body, joint, harmonics and their amplitudes [rad], momentum [kg m^2/s], tolerance [rad]. The first two were wrong by
# two thousand and a million times their estimates where even samples met only every fourth term of a spectrum.
LOOPS = [
    ("cat", "waist_yaw", {4: 1.5}, 0.0, 1e-9),
    ("cat", "waist_yaw", {4: 3.0}, 0.0, 1e-6),
    ("cat", "waist_yaw", {4: 1.5}, 0.02, 1e-9),
    ("diver", "left_shoulder_abduction", {24: 2.0}, 0.0, 1e-7),
    ("diver", "left_shoulder_abduction", {8: 1.5, 12: 0.7}, 20.0, 1e-9),
    ("cat", "waist_yaw", {3: 1.0, 11: 1.2}, 0.0, 1e-8),
    ("cat", "waist_yaw", {1: 0.3, 16: 1.0}, 0.02, 1e-9),
]


def loop_of(body: sp.Body, joint: str, harmonics: dict[int, float]) -> sp.ShapePath:
    sines = np.zeros((body.n_shape, max(harmonics)))
    for harmonic, amplitude in harmonics.items():
        sines[body.joint_names.index(joint), harmonic - 1] = amplitude
    return sp.ShapePath.fourier(np.zeros(body.n_shape), 0.0 * sines, sines, 1.0)


@pytest.mark.parametrize(("name", "joint", "harmonics", "momentum", "tolerance"), full_but(LOOPS, *LOOPS[::2]))
def test_the_estimate_holds_in_the_middle_of_the_loop(name, joint, harmonics, momentum, tolerance):
    """Against Gauss collocation on Pinocchio's own momentum, at times between all that the library may sample."""
    body = sp.load_body(name)
    path = loop_of(body, joint, harmonics)
    spatial = momentum * np.array([0.36, 0.48, 0.8])
    motion = sp.reconstruct(sp.articulated(body, path), spatial, tolerance=tolerance)
    times = np.linspace(0.0, 1.0, 8 * max(harmonics) + 1)
    truth = collocated_attitude(name, body.joint_names, path.curve, spatial, np.eye(3), times)
    gap = np.abs(motion.attitude(times) - truth.attitude).max()
    assert truth.uncertainty < 0.1 * tolerance
    assert gap <= motion.error_estimate + truth.uncertainty
    assert motion.error_estimate <= tolerance


def test_a_loop_of_multiples_is_the_shorter_loop_repeated():
    body = sp.load_body("cat")
    path = loop_of(body, "waist_yaw", {4: 0.5, 8: 0.2})
    assert (path.loops, path.swings.most) == (4, 2.0)
    quarter = loop_of(body, "waist_yaw", {1: 0.5, 2: 0.2}).stretched(0.25)
    once = sp.reconstruct(sp.articulated(body, quarter), np.zeros(3))
    whole = sp.reconstruct(sp.articulated(body, path), np.zeros(3))
    assert whole.evaluations <= once.evaluations
    np.testing.assert_allclose(
        whole.final_attitude, np.linalg.matrix_power(once.final_attitude, 4), rtol=0, atol=8 * once.error_estimate
    )


def test_an_error_between_the_nodes_is_seen_whatever_the_spectrum_says():
    """A ripple that 64 even samples miss, and nothing but the ripple's 64th harmonic."""

    def evaluate(times):
        ripple = 1e-3 * np.sin(64.0 * 2.0 * np.pi * times)
        return np.eye(3) * (1.0 + 0.0 * times)[:, None, None], ripple[:, None] * np.array([0.0, 0.0, 1.0])

    known = Smoothness(np.array([0.0, 1.0]), oscillations=1.0, smooth_loop=True)
    found = Sampler(evaluate, known).samples(0.0, 1e-8).interpolant
    there = np.append(np.linspace(0.0, 1.0, 300), 0.00390625)
    _, drift = found.inverse_and_drift(there)
    assert np.abs(drift - evaluate(there)[1]).max() <= 1e-6
