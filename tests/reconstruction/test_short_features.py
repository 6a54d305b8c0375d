"""Bodies at rest but for one short swing or pulse, where an integrator sees nothing for most of the time.

A wheel about a principal axis turns its body by -J/I of its own angle, whatever the pace; a pulse of torque about such
an axis has its integral for a momentum. The pulse is cos^4(pi x/2), with the integral 3/4 over -1 < x < 1.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np
import pytest

import shapephase as sp

DURATION, CENTRE = 4.0, 2.3
WIDTHS = [1 / 10, 1 / 200, 1 / 1900]
MOMENTS = np.array([1.0, 1.5, 2.0])


def pulse(times, width, centre=CENTRE, duration=DURATION):
    x = 2.0 * (np.asarray(times, dtype=float) - centre) / (width * duration)
    return np.where(np.abs(x) < 1.0, np.cos(0.5 * np.pi * x) ** 4, 0.0)


def swung(x):
    """The integral of the pulse from -1 on, over its whole."""
    x = np.clip(x, -1.0, 1.0)
    return 0.5 + 0.5 * x + 2.0 * np.sin(np.pi * x) / (3.0 * np.pi) + np.sin(2.0 * np.pi * x) / (12.0 * np.pi)


def turned(width):
    """A wheel that goes round by 20 rad in a short time."""

    def path(times):
        shapes, rates = np.zeros((2, len(times), satellite().n_shape))
        x = 2.0 * (times - CENTRE) / (width * DURATION)
        column = satellite().joint_index("wheel_spin")
        shapes[:, column] = 20.0 * swung(x)
        rates[:, column] = 20.0 * pulse(times, width) / (0.75 * 0.5 * width * DURATION)
        return shapes, rates

    return sp.ShapePath.function(path, DURATION, joint_names=satellite().joint_names)


def flick():
    """Waypoints: rest, a wheel that goes round in 1/1900 of the time, rest."""
    column = np.eye(satellite().n_shape)[satellite().joint_index("wheel_spin")]
    times = [0.0, CENTRE, CENTRE + DURATION / 1900, DURATION]
    return sp.ShapePath.waypoints(times, np.outer([0.0, 0.0, 20.0, 20.0], column), joint_names=satellite().joint_names)


def harmonics():
    """20 cos^40(pi t/T) as a Fourier series of 20 harmonics: a swing in 1/5 of the time."""
    count = 20
    cosines = np.array([2.0 * comb(2 * count, count - k) for k in range(1, count + 1)]) / 4.0**count
    column = 20.0 * np.eye(satellite().n_shape)[satellite().joint_index("wheel_spin")]
    mean = comb(2 * count, count) / 4.0**count * column
    waves = np.outer(column, cosines)
    return sp.ShapePath.fourier(mean, waves, 0.0 * waves, 1.0, joint_names=satellite().joint_names)


@lru_cache(maxsize=1)
def satellite():
    return sp.load_body("satellite")


PATHS = {
    **{f"function, 1/{1 / width:.0f}": lambda width=width: turned(width) for width in WIDTHS},
    "reversed and stretched": lambda: turned(1 / 1000).reversed().stretched(1.7),
    "joined": lambda: turned(1 / 200).then(turned(1 / 1900).reversed()),
    "waypoints": flick,
    "harmonics": harmonics,
    "harmonics of many loops": lambda: harmonics().repeated(3),
}


QUICK = ("function, 1/1900", "waypoints", "harmonics")


@pytest.mark.parametrize(
    "kind", [kind if kind in QUICK else pytest.param(kind, marks=pytest.mark.full) for kind in PATHS]
)
def test_dop853_turns_a_body_at_rest_by_what_its_wheel_turned(kind):
    path = PATHS[kind]()
    body = satellite()
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3), method="dop853")
    still = np.zeros(body.n_shape)
    share = np.linalg.solve(body.locked_inertia(still), body.momentum_matrix(still))
    times = np.linspace(0.0, path.duration, 33)
    truth = sp.so3.exp(-(path.shape(times) - path.shape(0.0)) @ share.T)
    errors = sp.so3.angle(sp.so3.transpose(truth) @ motion.attitude(times))
    assert errors.max() <= 1.5 * motion.error_estimate + 1e-13
    assert motion.error_estimate < 1e-9
    assert sp.so3.angle(truth).max() > 0.01, "the body must turn"


@pytest.mark.parametrize("axes", ["body", pytest.param("space", marks=pytest.mark.full)])
@pytest.mark.parametrize("width", [WIDTHS[0], WIDTHS[1], pytest.param(WIDTHS[2], marks=pytest.mark.full)])
def test_a_pulse_of_torque_gives_its_impulse(width, axes):
    axis, moment = np.eye(3)[1], MOMENTS[1]
    impulse = 0.75 * 0.5 * width * DURATION
    size = 0.4 * moment / impulse
    law = sp.ExternalTorque(lambda s: size * float(pulse(s.time, width)) * axis, axes)
    motion = sp.reconstruct(sp.rigid(np.diag(MOMENTS), DURATION), np.zeros(3), torque=law)
    np.testing.assert_allclose(motion.final_momentum, 0.4 * moment * axis, rtol=0, atol=1e-10)
    end = sp.so3.exp(0.4 * (DURATION - CENTRE) * axis)
    assert sp.so3.angle(end.T @ motion.final_attitude) <= 1.5 * motion.error_estimate + 1e-11


def test_a_torque_in_a_narrow_window_of_the_attitude_does_its_work():
    """Steady turns through 5 rad; within 1/300 of that a torque acts along: J (w^2 - w_0^2)/2 is the work by angles."""
    moment, rate, width = MOMENTS[2], 1.0, 5.0 / 300
    size = 0.5 * moment / (0.75 * 0.5 * width)

    def law(state):
        angle = np.arctan2(state.attitude[1, 0], state.attitude[0, 0]) % (2.0 * np.pi)
        return [0.0, 0.0, size * float(pulse(angle, width, 2.0, 1.0))]

    motion = sp.reconstruct(sp.rigid(np.diag(MOMENTS), 4.0), [0.0, 0.0, moment * rate], torque=law)
    assert motion.final_momentum[2] == pytest.approx(moment * np.sqrt(rate**2 + 2.0 * 0.5), abs=1e-8)
    assert motion.work(4.0) == pytest.approx(0.5 * moment, abs=1e-8)


@pytest.mark.full
def test_a_driven_swing_is_in_the_path_of_free_hinges():
    """A free wheel keeps J (omega_z + spin), here zero; the joint that is driven does what it was given to do."""
    body = satellite()
    driven = [name for name in body.joint_names if name != "wheel_spin"]
    width, joint = 1 / 1000, 0

    def swing(times):
        shapes, rates = np.zeros((2, len(times), len(driven)))
        x = 2.0 * (times - CENTRE) / (width * DURATION)
        shapes[:, joint] = 0.5 * swung(x)
        rates[:, joint] = 0.5 * pulse(times, width) / (0.75 * 0.5 * width * DURATION)
        return shapes, rates

    path = sp.ShapePath.function(swing, DURATION, joint_names=driven)
    found = sp.free_hinges(body, path, {"wheel_spin": (0.0, 0.0)}, np.zeros(3), tolerance=1e-7)
    times = CENTRE + 0.5 * width * DURATION * np.linspace(-1.2, 1.2, 25)
    columns = [body.joint_index(name) for name in driven]
    np.testing.assert_allclose(found.path.shape(times)[:, columns], swing(times)[0], rtol=0, atol=1e-8)
    spins = found.path.rate(times)[:, body.joint_index("wheel_spin")]
    turning = found.motion.angular_velocity(times)[:, 2]
    np.testing.assert_allclose(spins, -turning, rtol=0, atol=1e-6 * np.abs(turning).max())
    assert np.abs(turning).max() > 0.05
    assert found.attitude_defect <= 1e-7
