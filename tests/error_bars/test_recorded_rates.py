"""The momentum by a gyro, alone or beside attitudes: of simulated flights it is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2

import shapephase as sp
from shapephase import so3
from shapephase.error_bars.result_derivatives import fit_by_inertias, fit_by_knots
from shapephase.errors import AccuracyNotReached, ShapeError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.path_samples import path_samples

# What is computed is the same with and without machine code, which is quicker.

_MOMENTUM = np.array([4.0, -6.0, 40.0])
_START = so3.exp(np.array([0.3, 0.2, 0.1]))
_NOISE, _RATE_NOISE, _BIAS = np.radians(0.5), 0.02, np.array([0.1, -0.2, 0.05])
_BODY = sp.load_body("diver")
_TIMES = np.arange(61) / 60.0


def arms(times: np.ndarray) -> np.ndarray:
    return np.stack([1.2 + np.sin(2.0 * np.pi * times), 1.0 + np.cos(5.0 * times)], axis=1)


def through(samples: np.ndarray, body: sp.Body = _BODY) -> sp.Deformation:
    return sp.articulated(body, sp.ShapePath.spline(np.linspace(0.0, 1.0, len(samples)), samples, periodic=False))


SOMERSAULT = through(arms(np.linspace(0.0, 1.0, 16)))


@pytest.fixture(scope="module")
def flight() -> sp.Motion:
    return sp.reconstruct(SOMERSAULT, _MOMENTUM, _START, tolerance=1e-10)


def recorded(flight: sp.Motion, kind: str, seed: int | None, times: np.ndarray = _TIMES) -> dict:
    """What `momentum_from_recording` is given; without a seed without noise and bias."""
    rng = np.random.default_rng(seed)
    noise, rate_noise, bias = (0.0, 0.0, 0.0) if seed is None else (_NOISE, _RATE_NOISE, _BIAS)
    turned = so3.exp(noise * rng.normal(size=(len(times), 3)))
    rates = flight.angular_velocity(times) + rate_noise * rng.normal(size=(len(times), 3)) + bias
    if kind == "rates":
        return {"rates": rates, "attitude": _START}
    return {"attitudes": flight.attitude(times) @ turned, "rates": rates}


@pytest.mark.parametrize("kind", ["rates", "both"])
def test_without_noise_the_momentum_is_found(kind: str, flight: sp.Motion):
    found = sp.momentum_from_recording(SOMERSAULT, _TIMES, **recorded(flight, kind, None), tolerance=1e-10)
    np.testing.assert_allclose(found.momentum, _MOMENTUM, atol=1e-7)
    assert so3.angle(found.initial_attitude @ _START.T) < 1e-8
    assert found.rate_noise < 1e-7
    np.testing.assert_allclose(found.bias, 0.0, atol=1e-7)
    assert found.conserved


@pytest.mark.parametrize("draws", [12, pytest.param(200, marks=pytest.mark.full)])
@pytest.mark.parametrize("kind", ["rates", "both"])
def test_bars_cover_the_truth(kind: str, draws: int, flight: sp.Motion):
    """The chi-squares of momentum (and start) and of the bias are below their 95 % points in 95 % of the draws."""
    within = np.empty((draws, 2), dtype=bool)
    for seed in range(draws):
        found = sp.momentum_from_recording(SOMERSAULT, _TIMES, **recorded(flight, kind, seed), tolerance=1e-7)
        first = 3 if kind == "rates" else 0
        error = np.append(so3.log(_START.T @ found.initial_attitude), found.momentum - _MOMENTUM)[first:]
        off = found.bias - _BIAS
        square = error @ np.linalg.solve(found.covariance[first:, first:], error)
        bias_square = off @ np.linalg.solve(found.bias_covariance, off)
        within[seed] = square < chi2.ppf(0.95, len(error)), bias_square < chi2.ppf(0.95, 3)
    least, most = binom.ppf([5e-4, 1.0 - 5e-4], draws, 0.95) / draws
    share = within.mean(axis=0)
    assert np.all((share >= least) & (share <= most)), share


def test_noise_is_what_the_fit_leaves_and_both_know_more_than_one(flight: sp.Motion):
    given = recorded(flight, "both", 3)
    both = sp.momentum_from_recording(SOMERSAULT, _TIMES, **given)
    assert both.noise == pytest.approx(_NOISE, rel=0.2)
    assert both.rate_noise == pytest.approx(_RATE_NOISE, rel=0.2)
    assert both.rate_residuals.shape == both.residuals.shape == (61, 3)
    alone = sp.momentum_from_recording(SOMERSAULT, _TIMES, given["attitudes"])
    assert alone.rate_noise == 0.0
    assert np.trace(both.momentum_covariance) < np.trace(alone.momentum_covariance)
    stated = sp.momentum_from_recording(SOMERSAULT, _TIMES, **given, noise=4.0 * _NOISE, rate_noise=4.0 * _RATE_NOISE)
    np.testing.assert_allclose(np.diag(stated.covariance), 16.0 * np.diag(both.covariance), rtol=0.4)


def test_a_gyro_that_is_precise_outweighs_a_bad_star_tracker(flight: sp.Motion):
    """Bars of both by noise alone, in closed form: the information of attitudes and of rates adds up."""
    rng, levels = np.random.default_rng(5), (0.02, 1e-4)
    attitudes = flight.attitude(_TIMES) @ so3.exp(levels[0] * rng.normal(size=(61, 3)))
    rates = flight.angular_velocity(_TIMES) + levels[1] * rng.normal(size=(61, 3)) + _BIAS
    both = sp.momentum_from_recording(SOMERSAULT, _TIMES, attitudes, rates=rates, noise=levels[0], rate_noise=levels[1])
    alone = sp.momentum_from_recording(SOMERSAULT, _TIMES, attitudes, noise=levels[0])
    size, spin = np.linalg.norm(_MOMENTUM), np.linalg.norm(both.momentum)
    # Rates know the momentum in base axes; the star tracker, where they point to.
    assert abs(spin - size) < 1e-3 < 3.0 * np.sqrt(np.trace(alone.momentum_covariance))
    along = _MOMENTUM / size
    assert along @ both.momentum_covariance @ along < 0.01 * (along @ alone.momentum_covariance @ along)


def test_a_bias_that_rates_alone_leave_open_is_not_fitted():
    """A rigid body about one principal axis turns evenly: all of its rate could be bias."""
    inertia, times = np.diag([1.0, 2.0, 2.5]), np.linspace(0.0, 5.0, 40)
    rates = np.tile([0.0, 0.0, 0.3], (40, 1)) + 1e-4 * np.random.default_rng(1).normal(size=(40, 3))
    found = sp.momentum_from_recording(sp.rigid(inertia, 5.0), times, rates=rates)
    assert found.bias_covariance is None
    np.testing.assert_allclose(found.momentum, [0.0, 0.0, 0.75], atol=1e-3)
    with pytest.raises(AccuracyNotReached, match=r"leave their bias open.*find_bias=False"):
        sp.momentum_from_recording(sp.rigid(inertia, 5.0), times, rates=rates, find_bias=True)


@pytest.mark.parametrize("kind", ["rates", "both"])
def test_derivatives_of_a_fit_by_samples_as_fits_to_others_show(kind: str, flight: sp.Motion):
    """Central differences of fits to one recording; the recorded times are no knots of the path."""
    times, levels = np.linspace(0.05, 0.95, 21), {"rate_noise": 0.1} | ({"noise": 0.02} if kind == "both" else {})
    given = recorded(flight, kind, None, times) | levels
    exact = sp.momentum_from_recording(SOMERSAULT, times, **given, tolerance=1e-10)
    samples = path_samples(SOMERSAULT.description.path).values
    found = fit_by_knots(exact.motion, exact.times, exact.by_attitudes, exact.by_rates)
    for row, joint in ((3, 1), (8, 0)):
        ends = []
        for sign in (1.0, -1.0):
            moved = samples.copy()
            moved[row, joint] += sign * 1e-4
            ends.append(sp.momentum_from_recording(through(moved), times, **given, tolerance=1e-10))
        turn = so3.log(ends[1].initial_attitude.T @ ends[0].initial_attitude)
        change = np.append(turn, ends[0].momentum - ends[1].momentum) / 2e-4
        np.testing.assert_allclose(found[:, 2 * row + joint], change, atol=2e-5 * np.linalg.norm(change))
    chain = _BODY.chain
    parameters = np.zeros((len(chain.masses), 10))
    parameters[:, 0] = chain.masses
    parameters[:, 4:] = chain.inertias[:, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    # A body that is heavier throughout has more momentum with the same attitudes and rates.
    change = fit_by_inertias(exact.motion, exact.times, exact.by_attitudes, exact.by_rates) @ parameters.ravel()
    np.testing.assert_allclose(change[:3], 0.0, atol=1e-8)
    np.testing.assert_allclose(change[3:], exact.momentum, atol=1e-6)


def test_a_body_with_a_wheel_that_keeps_its_momentum():
    satellite = sp.load_body("satellite")
    others = [name for name in satellite.joint_names if name != "wheel_spin"]
    path = sp.ShapePath.waypoints([0.0, 3.0], np.outer([0.0, 0.3], np.ones(len(others))), joint_names=others)
    deformation, times = sp.articulated(satellite, path, rotors={"wheel_spin": 2.0}), np.linspace(0.0, 3.0, 25)
    motion = sp.reconstruct(deformation, [1.0, 2.0, 3.0], tolerance=1e-10)
    rates = motion.angular_velocity(times)
    found = sp.momentum_from_recording(deformation, times, rates=rates, find_bias=False, tolerance=1e-9)
    np.testing.assert_allclose(found.momentum, [1.0, 2.0, 3.0], atol=1e-6)
    without = sp.articulated(satellite, path, rotors={"wheel_spin": 0.0})
    with pytest.warns(TrajectoryWarning, match="not constant"):
        other = sp.momentum_from_recording(without, times, motion.attitude(times), rates=rates, find_bias=False)
    assert np.abs(other.momentum - [1.0, 2.0, 3.0]).max() > 0.1, "the wheel must matter"


def test_a_momentum_that_changes_shows_in_rates_alone():
    """A rigid body about its middle axis whose rate doubles."""
    times = np.linspace(0.0, 0.8, 41)
    deformation = through(np.tile([0.3, -0.3], (41, 1)))
    rates = np.outer(3.0 * (1.0 + times / 0.8), [0.0, 1.0, 0.0]) + 0.01 * np.random.default_rng(1).normal(size=(41, 3))
    with pytest.warns(TrajectoryWarning, match="not constant"):
        found = sp.momentum_from_recording(deformation, times, rates=rates, tolerance=1e-7)
    assert not found.conserved


def test_what_is_wrong_is_named(flight: sp.Motion):
    given = recorded(flight, "rates", 2)
    slow = sp.reconstruct(SOMERSAULT, _MOMENTUM / 20.0).angular_velocity(_TIMES) + 0.01
    sp.momentum_from_recording(SOMERSAULT, _TIMES, rates=slow)
    with pytest.raises(TrajectoryError, match=r"in deg/s they are: .*--names 'COLUMN=COLUMN \[deg/s\]'"):
        sp.momentum_from_recording(SOMERSAULT, _TIMES, rates=np.degrees(slow))
    with pytest.raises(TrajectoryError, match=r"over half a turn; .*deg/s"):
        sp.momentum_from_recording(SOMERSAULT, _TIMES, rates=np.degrees(given["rates"]))
    with pytest.raises(TrajectoryError, match=r"read as its inverse, it is one: base_inverse=True \(--base-inverse\)"):
        sp.momentum_from_recording(SOMERSAULT, _TIMES, so3.transpose(flight.attitude(_TIMES)))
    for wrong, words in (
        ({}, "got neither|none are given"),
        ({**given, "rates": given["rates"][:9]}, "rates"),
        ({"rates": given["rates"], "rate_noise": -1.0}, "rate_noise: a positive standard deviation"),
        ({"rates": given["rates"], "noise": 1.0}, "there are rates alone"),
        ({"attitudes": flight.attitude(_TIMES), "find_bias": True}, "find_bias are for recorded rates"),
        ({"attitudes": flight.attitude(_TIMES), "attitude": _START}, "leave it out"),
        ({**recorded(flight, "both", 1), "find_axes": True}, "leave the rates out"),
    ):
        with pytest.raises(ShapeError, match=words):
            sp.momentum_from_recording(SOMERSAULT, _TIMES, **wrong)
