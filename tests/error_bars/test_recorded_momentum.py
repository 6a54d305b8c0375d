"""The momentum of recorded flights: of simulated ones it is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom, chi2

import shapephase as sp
from shapephase import so3
from shapephase.error_bars._along_motion import responses
from shapephase.errors import AccuracyNotReached, ShapeError, TrajectoryError, TrajectoryWarning, WrongObjectError

# What is computed is the same with and without machine code, which is quicker.

_MOMENTUM = np.array([4.0, -6.0, 40.0])
_START = so3.exp(np.array([0.3, 0.2, 0.1]))
_NOISE = np.radians(0.5)
_TIMES = np.arange(61) / 60.0


def somersault() -> sp.Deformation:
    body = sp.load_body("diver")
    times = np.linspace(0.0, 1.0, 16)
    arms = np.stack([1.2 + np.sin(2.0 * np.pi * times), 1.0 + np.cos(5.0 * times)], axis=1)
    return sp.articulated(body, sp.ShapePath.spline(times, arms, periodic=False))


def flight(momentum: np.ndarray = _MOMENTUM) -> sp.Motion:
    return sp.reconstruct(somersault(), momentum, _START, tolerance=1e-10)


def noisy(motion: sp.Motion, seed: int) -> np.ndarray:
    errors = _NOISE * np.random.default_rng(seed).normal(size=(len(_TIMES), 3))
    return motion.attitude(_TIMES) @ so3.exp(errors)


def test_responses_along_the_way_are_the_derivatives_of_the_end_and_of_the_steps():
    motion = flight()
    (end,) = responses(motion, np.array([motion.duration]))
    exact = sp.derivatives(motion)
    np.testing.assert_allclose(end[:, 3:], exact.by_momentum.final_attitude, atol=1e-11)
    np.testing.assert_allclose(end[:, :3] @ _START, exact.by_attitude.final_attitude, atol=1e-11)
    step = 1e-3
    for axis, unit in enumerate(np.eye(3)):
        ahead, behind = flight(_MOMENTUM + step * unit), flight(_MOMENTUM - step * unit)
        at = np.array([0.3, 0.55])
        found = so3.log(ahead.attitude(at) @ so3.transpose(behind.attitude(at))) / (2.0 * step)
        np.testing.assert_allclose(responses(motion, at)[:, :, 3 + axis], found, atol=1e-7)


@pytest.mark.parametrize("momentum", [_MOMENTUM, np.array([8.0, -20.0, 80.0]), np.array([0.0, 0.0, 0.0])])
def test_without_noise_the_momentum_is_found(momentum: np.ndarray):
    """To the tolerance of the reconstruction, a second and some kg m^2 wide."""
    motion = flight(momentum)
    found = sp.momentum_from_recording(somersault(), _TIMES, motion.attitude(_TIMES), tolerance=1e-9)
    np.testing.assert_allclose(found.momentum, momentum, atol=1e-7)
    assert so3.angle(found.initial_attitude @ _START.T) < 1e-8
    assert found.noise < 1e-8
    assert np.abs(found.residuals).max() < 1e-8


@pytest.mark.parametrize("draws", [20, pytest.param(400, marks=pytest.mark.full)])
@pytest.mark.filterwarnings("ignore:the momentum is not constant")
def test_bars_cover_the_truth(draws: int):
    """In 95 % of the recordings, each component and the chi-square of all; 92 to 98 % of 400.

    Chance alone makes one momentum of a thousand change.
    """
    motion = flight()
    errors, bars, squares = np.empty((draws, 6)), np.empty((draws, 6)), np.empty(draws)
    for row in range(draws):
        found = sp.momentum_from_recording(somersault(), _TIMES, noisy(motion, row), noise=_NOISE)
        errors[row, :3] = so3.log(_START.T @ found.initial_attitude)
        errors[row, 3:] = found.momentum - _MOMENTUM
        bars[row] = np.sqrt(np.diag(found.covariance))
        squares[row] = errors[row] @ np.linalg.solve(found.covariance, errors[row])
    least, most = binom.ppf([5e-4, 1.0 - 5e-4], draws, 0.95) / draws
    inside = np.mean(np.abs(errors) < 1.959964 * bars, axis=0)
    assert np.all((inside >= least) & (inside <= most)), inside
    assert least <= np.mean(squares < chi2.ppf(0.95, 6)) <= most


def test_the_noise_is_what_the_fit_leaves():
    """Of 183 numbers less six: known to 5 %."""
    found = sp.momentum_from_recording(somersault(), _TIMES, noisy(flight(), 7))
    assert found.noise == pytest.approx(_NOISE, rel=0.2)
    again = sp.momentum_from_recording(somersault(), _TIMES, noisy(flight(), 7), noise=2.0 * found.noise)
    # What is stated beyond what the fit leaves is white; what it leaves has a correlation, too, here nearly none.
    assert abs(found.noise_correlation) < 0.2
    np.testing.assert_allclose(np.diag(again.covariance), 4.0 * np.diag(found.covariance), rtol=0.2)
    np.testing.assert_allclose(found.covariance[3:, 3:], found.momentum_covariance)
    bars = sp.uncertainty(found.motion, momentum=found.momentum_covariance, attitude=found.attitude_covariance)
    assert 0.0 < bars.montgomery_phase < 0.2


def correlated(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Noise of variance one: white, autoregressive of the first order, or the mean of neighbours."""
    way, length = kind.split()
    white = rng.normal(size=(len(_TIMES) + 200, 3))
    if way == "autoregressive":
        phi = np.exp(-1.0 / float(length))
        return np.asarray(np.sqrt(1.0 - phi**2) * lfilter([1.0], [1.0, -phi], white, axis=0))[200:]
    return np.asarray(lfilter(np.full(int(length), 1.0 / np.sqrt(float(length))), [1.0], white, axis=0))[200:]


@pytest.mark.parametrize(
    ("kind", "least", "most"),
    [("mean 1", 0.9, 1.2), ("autoregressive 3", 1.2, 4.0), ("autoregressive 10", 1.2, 6.0), ("mean 5", 1.2, 4.0)],
)
@pytest.mark.parametrize("draws", [2, pytest.param(400, marks=pytest.mark.full)])
@pytest.mark.filterwarnings("ignore:the momentum is not constant")
def test_noise_that_is_correlated_makes_longer_bars(kind: str, least: float, most: float, draws: int):
    """Of 400 recordings 92 % or more within 1.96 bars. Slow changes have at most (1 + phi) / (1 - phi) times the
    variance of white noise: 6 for three samples, 20 for ten, and the root of that in bars, of 400 in the middle."""
    motion, rng = flight(), np.random.default_rng(8)
    inside, widening = np.empty((draws, 3), dtype=bool), np.empty(draws)
    for row in range(draws):
        attitudes = motion.attitude(_TIMES) @ so3.exp(_NOISE * correlated(kind, rng))
        found = sp.momentum_from_recording(somersault(), _TIMES, attitudes, tolerance=1e-6)
        inside[row] = np.abs(found.momentum - _MOMENTUM) < 1.959964 * np.sqrt(np.diag(found.momentum_covariance))
        widening[row] = found.widening
        assert draws > 2 or found.conserved
    assert least < np.median(widening) < most
    assert draws == 2 or np.all(inside.mean(axis=0) >= 0.92), inside.mean(axis=0)


@pytest.mark.parametrize("joints", [None, "0.3deg"])
def test_a_momentum_that_changes_is_held_by_the_bars_and_said(joints: str | None):
    """The rate of a rigid body about its middle axis is prescribed, and doubles: so does the momentum."""
    body, times = sp.load_body("diver"), np.linspace(0.0, 0.8, 41)
    arms = np.tile([0.3, -0.3], (41, 1))
    turned = so3.exp(np.outer(3.0 * (times + times**2 / 1.6), [0.0, 1.0, 0.0]))
    noise = so3.exp(np.radians(0.3) * np.random.default_rng(1).normal(size=(41, 3)))
    deformation = sp.articulated(body, sp.ShapePath.spline(times, arms, periodic=False))
    with pytest.warns(TrajectoryWarning, match="conserved"):
        found = sp.momentum_from_recording(deformation, times, turned @ noise, joints=joints, tolerance=1e-6)
    truth = np.outer(3.0 * (1.0 + times / 0.8), body.locked_inertia(arms[0])[:, 1])
    bar = 1.959964 * np.sqrt(np.diag(found.momentum_covariance))
    assert np.all(np.abs(truth - found.momentum) < bar)
    # No longer than holding takes.
    assert bar[1] < 2.2 * np.abs(truth[:, 1] - found.momentum[1]).max()
    np.testing.assert_allclose(found.momenta[:, 1], truth[:, 1], atol=0.05 * truth[-1, 1])
    assert not found.conserved
    # What is left beside the drift, not the drift, of five degrees.
    assert found.noise < np.radians(1.0)


def test_axes_of_the_base_that_nobody_knows_are_found():
    """Any that are fixed to it; each component of their turn, and of the momentum, within four bars."""
    motion, times = flight(np.array([4.0, 60.0, 6.0])), _TIMES[::3]
    for seed, axes in enumerate([np.eye(3)[:, [2, 0, 1]] @ so3.exp(np.array([0.2, 0.1, -0.1]))]):
        errors = so3.exp(_NOISE * np.random.default_rng(seed).normal(size=(len(times), 3)))
        recorded = motion.attitude(times) @ errors @ axes.T
        found = sp.momentum_from_recording(somersault(), times, recorded, tolerance=1e-6, find_axes=True)
        turn = so3.log(axes.T @ found.base_axes)
        assert np.all(np.abs(turn) < 4.0 * np.sqrt(np.diag(found.axes_covariance)))
        off = found.momentum - motion.momentum
        assert np.all(np.abs(off) < 4.0 * np.sqrt(np.diag(found.momentum_covariance)))
        known = sp.momentum_from_recording(somersault(), times, recorded @ axes, tolerance=1e-6)
        assert np.trace(known.momentum_covariance) < np.trace(found.momentum_covariance)
        np.testing.assert_array_equal(known.base_axes, np.eye(3))


def test_a_flight_that_does_not_tell_the_axes_says_so():
    """A body that turns steadily about one axis: the axes may be turned about it, whatever the recording."""
    rigid = sp.articulated(sp.load_body("diver"), sp.ShapePath.waypoints([0.0, 0.5], [[3.0, -3.0]] * 2))
    motion, times = sp.reconstruct(rigid, [0.0, 0.0, 4.0], tolerance=1e-6), np.linspace(0.0, 0.5, 8)
    errors = so3.exp(_NOISE * np.random.default_rng(0).normal(size=(len(times), 3)))
    with pytest.raises(AccuracyNotReached, match="base_axes"):
        sp.momentum_from_recording(rigid, times, motion.attitude(times) @ errors, tolerance=1e-6, find_axes=True)


def test_what_is_no_flight_is_refused():
    rng = np.random.default_rng(1)
    wild = so3.exp(rng.normal(size=(len(_TIMES), 3)))
    with pytest.raises(AccuracyNotReached, match="degrees"):
        sp.momentum_from_recording(somersault(), _TIMES, wild)


def test_what_cannot_be_fitted():
    attitudes = flight().attitude(_TIMES)
    with pytest.raises(ShapeError, match="time"):
        sp.momentum_from_recording(somersault(), _TIMES, attitudes[1:])
    with pytest.raises(TrajectoryError, match="ascend"):
        sp.momentum_from_recording(somersault(), _TIMES[::-1], attitudes)
    with pytest.raises(TrajectoryError, match="three"):
        sp.momentum_from_recording(somersault(), _TIMES[:2], attitudes[:2])
    with pytest.raises(ShapeError, match="positive"):
        sp.momentum_from_recording(somersault(), _TIMES, attitudes, noise=0.0)
    with pytest.raises(ShapeError, match="joints"):
        sp.momentum_from_recording(somersault(), _TIMES, attitudes, joints=-0.1)
    with pytest.raises(WrongObjectError, match="articulated"):
        sp.momentum_from_recording(sp.rigid(np.eye(3), 1.0), _TIMES, attitudes, joints=0.1)
