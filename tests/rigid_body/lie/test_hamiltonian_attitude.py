"""The attitude of a Hamiltonian of the momentum, against `EulerTop`, mpmath and the paper's quadrature."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad

from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.rigid_body import ZYZ, EulerTop, precession_rate
from shapephase.rigid_body.lie import hamiltonian_motion

INVERSE = np.array([1.0, 0.5, 0.25])
TIMES = np.linspace(0.0, 12.0, 7)


def gradient(pi):
    """Of Pi.I^-1 Pi/2 + (Pi_1^4 + Pi_3^4)/40 + Pi_2/5: neither quadratic nor even."""
    return INVERSE * pi + 0.1 * pi**3 * np.array([1.0, 0.0, 1.0]) + np.array([0.0, 0.2, 0.0])


def energy(pi):
    quartic = 0.025 * (pi[..., 0] ** 4 + pi[..., 2] ** 4)
    return 0.5 * np.sum(INVERSE * pi * pi, axis=-1) + quartic + 0.2 * pi[..., 1]


def test_kinetic_energy_gives_the_free_rigid_body_q9():
    rng = np.random.default_rng(2)
    start, attitude = rng.normal(size=(3, 3)), so3.exp(rng.normal(size=(3, 3)))
    motion = hamiltonian_motion(lambda pi: INVERSE * pi, start, TIMES, attitude)
    for k in range(3):
        top = EulerTop.principal(1.0 / INVERSE, start[k], attitude[k])
        assert np.abs(motion.attitude[k] - top.attitude(TIMES)).max() < 1e-11
        assert np.abs(motion.body_momentum[k] - top.body_momentum(TIMES)).max() < 1e-11


def test_any_hamiltonian_against_mpmath_q9():
    motion = hamiltonian_motion(gradient, [0.3, 0.4, 1.2], [0.0, 0.8])
    with mp.workdps(20):

        def rates(_, y):
            pi, r = y[:3], y[3:]
            a = [
                pi[0] + pi[0] ** 3 / mp.mpf(10),
                pi[1] / 2 + mp.mpf(1) / 5,
                pi[2] / 4 + pi[2] ** 3 / mp.mpf(10),
            ]
            dpi = [pi[1] * a[2] - pi[2] * a[1], pi[2] * a[0] - pi[0] * a[2], pi[0] * a[1] - pi[1] * a[0]]
            rows = []
            for k in range(3):
                row = r[3 * k : 3 * k + 3]
                # A row of R hat(omega).
                rows += [row[1] * a[2] - row[2] * a[1], row[2] * a[0] - row[0] * a[2], row[0] * a[1] - row[1] * a[0]]
            return dpi + rows

        start = [mp.mpf("0.3"), mp.mpf("0.4"), mp.mpf("1.2"), 1, 0, 0, 0, 1, 0, 0, 0, 1]
        end = np.array(mp.odefun(rates, 0, start, tol=mp.mpf(10) ** -16)(0.8), dtype=float)
    assert motion.body_momentum[-1] == pytest.approx(end[:3], abs=2e-13)
    assert motion.attitude[-1].ravel() == pytest.approx(end[3:], abs=2e-13)


def test_first_integrals_and_the_quadrature_of_the_azimuth_q9():
    """H and R Pi are constant; and (4) of the paper is the rate of the first Euler angle."""
    motion = hamiltonian_motion(gradient, [0.3, 0.4, 1.2], TIMES)
    assert energy(motion.body_momentum) == pytest.approx(energy(np.array([0.3, 0.4, 1.2])), abs=1e-12)
    spatial = so3.apply(motion.attitude, motion.body_momentum)
    assert spatial == pytest.approx(np.broadcast_to([0.3, 0.4, 1.2], (7, 3)), abs=1e-14)
    upright = so3.between(np.array([0.3, 0.4, 1.2]) / 1.3, np.array([0.0, 0.0, 1.0]))

    def rate(t):
        pi = (
            hamiltonian_motion(gradient, [0.3, 0.4, 1.2], [0.0, t]).body_momentum[-1]
            if t
            else np.array([0.3, 0.4, 1.2])
        )
        return float(precession_rate(pi, gradient(pi)))

    angle = quad(rate, 0.0, 1.0, epsabs=1e-10)[0]
    turned = hamiltonian_motion(gradient, [0.3, 0.4, 1.2], [0.0, 1.0], upright)
    azimuths = ZYZ.angles(turned.attitude)[:, 0]
    assert so3.wrap(azimuths[1] - azimuths[0] - angle) == pytest.approx(0.0, abs=1e-9)


def test_wrong_arguments_get_a_sentence():
    for arguments in (
        ([1.0, 2.0], [0.0, 1.0]),
        ([1.0, 2.0, 3.0], [1.0, 0.0]),
        ([1.0, 2.0, 3.0], [0.0, 1.0], np.eye(2)),
    ):
        with pytest.raises(ShapeError):
            hamiltonian_motion(gradient, *arguments)
    with pytest.raises(TypeError, match="hamiltonian"):
        hamiltonian_motion(INVERSE, [1.0, 2.0, 3.0], [0.0, 1.0])
