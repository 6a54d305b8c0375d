"""Error bars of motions whose momentum and start were fitted to a recorded base."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2

import shapephase as sp
from shapephase import so3
from shapephase.error_bars.result_derivatives import fit_by_inertias, fit_by_knots
from shapephase.errors import ShapeError, TrajectoryWarning
from shapephase.shape_space.path_samples import path_samples
from support import bvh_files

_NOISE = np.radians(0.4)
_MOMENTUM = np.array([4.0, -6.0, 40.0])
_START = so3.exp(np.array([0.3, 0.2, 0.1]))
_BODY = sp.load_body("diver")


def arms(times: np.ndarray) -> np.ndarray:
    return np.stack([1.2 + np.sin(2.0 * np.pi * times), 1.0 + np.cos(5.0 * times)], axis=1)


def through(samples: np.ndarray, duration: float = 0.6) -> sp.Deformation:
    times = np.linspace(0.0, duration, len(samples))
    return sp.articulated(_BODY, sp.ShapePath.spline(times, samples, periodic=False))


def fitted(deformation: sp.Deformation, times: np.ndarray, attitudes: np.ndarray) -> sp.RecordedMomentum:
    return sp.momentum_from_recording(deformation, times, attitudes, noise=_NOISE, tolerance=1e-10)


@pytest.fixture(scope="module")
def exact() -> sp.RecordedMomentum:
    """A fit that leaves nothing: only then is the response by derivatives of the first order exact."""
    deformation, times = through(arms(np.linspace(0.0, 0.6, 10))), np.linspace(0.05, 0.55, 12)
    motion = sp.reconstruct(deformation, _MOMENTUM, _START, tolerance=1e-10)
    return fitted(deformation, times, motion.attitude(times))


def test_a_fit_derivatives_to_samples_as_fits_to_others_show(exact: sp.RecordedMomentum):
    """Central differences of fits to one recording; the recorded times are no knots of the path."""
    samples = path_samples(exact.motion.deformation.description.path).values
    found = fit_by_knots(exact.motion, exact.times, exact.by_attitudes, exact.by_rates)
    attitudes, step = exact.motion.attitude(exact.times), 1e-4
    for row, joint in ((0, 1), (4, 0)):
        ends = []
        for sign in (1.0, -1.0):
            moved = samples.copy()
            moved[row, joint] += sign * step
            ends.append(fitted(through(moved), exact.times, attitudes))
        turn = so3.log(ends[1].initial_attitude.T @ ends[0].initial_attitude)
        change = np.concatenate([turn, ends[0].momentum - ends[1].momentum]) / (2.0 * step)
        np.testing.assert_allclose(found[:, 2 * row + joint], change, atol=1e-6 * np.linalg.norm(change))


def test_a_body_that_is_heavier_throughout_has_more_momentum_in_the_same_attitudes(exact: sp.RecordedMomentum):
    chain = _BODY.chain
    parameters = np.zeros((len(chain.masses), 10))
    parameters[:, 0] = chain.masses
    parameters[:, 4:] = chain.inertias[:, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    change = fit_by_inertias(exact.motion, exact.times, exact.by_attitudes, exact.by_rates) @ parameters.ravel()
    np.testing.assert_allclose(change[:3], 0.0, atol=1e-9)
    np.testing.assert_allclose(change[3:], exact.momentum, atol=1e-8)


def test_the_covariance_of_a_fit_is_that_of_its_answers_to_attitudes(exact: sp.RecordedMomentum):
    np.testing.assert_allclose(
        exact.covariance,
        _NOISE**2 * exact.by_attitudes @ exact.by_attitudes.T,
        rtol=1e-9,
        atol=1e-12 * np.abs(exact.covariance).max(),
    )


def test_errors_of_start_and_momentum_go_together(exact: sp.RecordedMomentum):
    """Without the terms across they are those of both alone; with them less is left of the attitude at the end."""
    motion, alone = exact.motion, exact.covariance.copy()
    alone[:3, 3:] = alone[3:, :3] = 0.0
    parts = sp.uncertainty(motion, momentum=exact.momentum_covariance, attitude=exact.attitude_covariance)
    apart, joint = sp.uncertainty(motion, start=alone), sp.uncertainty(motion, start=exact.covariance)
    np.testing.assert_allclose(apart.total_rotation, parts.total_rotation, rtol=1e-12)
    assert apart.montgomery_phase == pytest.approx(parts.montgomery_phase, rel=1e-12)
    np.testing.assert_allclose(apart.start, parts.start, rtol=1e-12)
    np.testing.assert_allclose(joint.start, exact.covariance, rtol=1e-12)
    turns = sp.derivatives(motion)
    both = np.hstack([turns.by_attitude.final_attitude, turns.by_momentum.final_attitude])
    np.testing.assert_allclose(joint.final_attitude, both @ exact.covariance @ both.T, rtol=1e-10)
    assert np.trace(joint.final_attitude) < 0.5 * np.trace(apart.final_attitude)
    whole = sp.uncertainty(motion, start=exact)
    np.testing.assert_allclose(whole.final_attitude, joint.final_attitude, rtol=1e-12)


def test_bars_of_somersaults_and_twists_are_those_of_moved_starts(exact: sp.RecordedMomentum):
    """Central differences of motions with other starts and momenta, counted about the same axes."""
    motion, bars, step = exact.motion, sp.uncertainty(exact.motion, start=exact.covariance), 1e-4
    axes = motion.counted_axes()
    same = {name: getattr(axes, name) for name in ("lateral", "longitudinal", "somersault", "up")}
    moves = step * np.vstack([np.eye(6), -np.eye(6)])
    starts = motion.initial_attitude @ so3.exp(moves[:, :3])
    moved = sp.reconstruct(motion.deformation, motion.momentum + moves[:, 3:], starts, tolerance=1e-10)
    somersault, _, twist = moved.somersault_tilt_twist([0.0, motion.duration], **same)
    for angle, bar in ((somersault, bars.somersaults), (twist, bars.twists)):
        counts = np.diff(angle, axis=1)[:, 0] / (2.0 * np.pi)
        slope = (counts[:6] - counts[6:]) / (2.0 * step)
        assert bar == pytest.approx(np.sqrt(slope @ exact.covariance @ slope), rel=1e-5)
    cat = sp.reconstruct(sp.articulated("cat_two_halves", sp.examples.kane_scher(0.0, 0.5)), [0.0, 0.0, 0.005])
    assert sp.uncertainty(cat, momentum=1e-5).twists is None


def test_masses_that_are_not_known_move_the_momentum_instead_of_the_attitudes(exact: sp.RecordedMomentum):
    """Whatever the masses, the recorded attitudes are what they are; the momentum that goes with them is not."""
    errors = sp.InertiaErrors(masses=0.05)
    fixed, moved = (
        sp.uncertainty(exact.motion, inertias=errors),
        sp.uncertainty(exact.motion, inertias=errors, start=exact),
    )
    assert np.trace(moved.final_attitude) < 0.05 * np.trace(fixed.final_attitude)
    assert not fixed.start.any()
    # Nearly as much as the mass of the largest link.
    size = np.sqrt(np.trace(moved.start[3:, 3:])) / np.linalg.norm(exact.momentum)
    assert 0.02 < size < 0.06


@pytest.mark.parametrize("draws", [12, pytest.param(200, marks=pytest.mark.full)])
def test_draws_of_what_goes_together_scatter_as_the_first_order_says(draws: int, exact: sp.RecordedMomentum):
    given = {"joints": 0.005, "start": exact}
    first = sp.uncertainty(exact.motion, **given)
    drawn = sp.sampled_uncertainty(exact.motion, **given, draws=draws, seed=2)
    allowed = 4.0 / np.sqrt(2.0 * draws) + 0.02
    for name in ("final_attitude", "total_rotation", "start"):
        ratio = np.sqrt(np.diag(getattr(drawn, name)) / np.diag(getattr(first, name)))
        np.testing.assert_allclose(ratio, 1.0, atol=allowed)
    for name in ("somersaults", "twists"):
        assert getattr(drawn, name) == pytest.approx(getattr(first, name), rel=allowed), name


def test_what_does_not_go_together(exact: sp.RecordedMomentum):
    for given in ({"momentum": 0.1}, {"attitude": 0.1}):
        with pytest.raises(ShapeError, match="momentum"):
            sp.uncertainty(exact.motion, start=exact, **given)
    other = sp.reconstruct(exact.motion.deformation, 2.0 * exact.momentum, exact.initial_attitude, tolerance=1e-6)
    with pytest.raises(ShapeError, match="own"):
        sp.uncertainty(other, start=exact)
    with pytest.raises(ShapeError, match="start"):
        sp.uncertainty(exact.motion, start=np.eye(3))


@pytest.mark.parametrize("joint_noise", [0.0, np.radians(0.3)])
@pytest.mark.parametrize("draws", [2, pytest.param(400, marks=pytest.mark.full)])
@pytest.mark.filterwarnings("ignore:the momentum is not constant")
def test_bars_of_a_recorded_flight_cover_the_truth(draws: int, joint_noise: float):
    """The attitude at the end, the momentum and theta_M of a second at 60 Hz, inside in 95 % of the recordings: each
    component and the chi-square, of 400 in 92 to 98 %; and the errors scatter as far as the bars are long, in the
    middle: in one recording of fifty chance makes a momentum that changes, and longer bars."""
    times = np.linspace(0.0, 1.0, 61)
    truth = sp.reconstruct(through(arms(times), 1.0), _MOMENTUM, _START, tolerance=1e-9)
    attitudes, phase = truth.attitude(times), sp.split(truth).montgomery_phase
    rng = np.random.default_rng(5)
    errors, bars, squares = np.empty((draws, 7)), np.empty((draws, 7)), np.empty((draws, 2))
    for row in range(draws):
        recorded = attitudes @ so3.exp(_NOISE * rng.normal(size=(61, 3)))
        noisy = through(arms(times) + joint_noise * rng.normal(size=(61, 2)), 1.0)
        fit = sp.momentum_from_recording(noisy, times, recorded, noise=_NOISE, joints=joint_noise, tolerance=1e-6)
        found = sp.uncertainty(fit.motion, start=fit, joints=joint_noise)
        np.testing.assert_allclose(fit.covariance, found.start, rtol=1e-9, atol=1e-12 * found.start.max())
        turn = so3.log(truth.final_attitude @ fit.motion.final_attitude.T)
        off = fit.momentum - _MOMENTUM
        errors[row] = [*turn, *off, sp.split(fit.motion).montgomery_phase - phase]
        variances = [*np.diag(found.final_attitude), *np.diag(found.start)[3:], found.montgomery_phase**2]
        bars[row] = np.sqrt(variances)
        for which, (error, covariance) in enumerate([(turn, found.final_attitude), (off, found.start[3:, 3:])]):
            squares[row, which] = error @ np.linalg.solve(covariance, error)
    # What so many draws leave open, with a chance of one in a thousand.
    least, most = binom.ppf([5e-4, 1.0 - 5e-4], draws, 0.95) / draws
    inside = np.concatenate(
        [np.mean(np.abs(errors) < 1.959964 * bars, axis=0), np.mean(squares < chi2.ppf(0.95, 3), axis=0)]
    )
    assert np.all((inside >= least) & (inside <= most)), inside
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / np.median(bars, axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=max(0.15, 3.3 / np.sqrt(2.0 * draws)))


def test_noise_of_the_joints_is_no_drift_of_the_momentum():
    """Noise of the arms moves the reconstructed attitudes by a walk in time. Of six recordings the fit that knows this
    noise doubts none; one that does not, which this noise is not white for, doubts some."""
    times, rng = np.linspace(0.0, 1.0, 31), np.random.default_rng(3)
    attitudes = sp.reconstruct(through(arms(times), 1.0), _MOMENTUM, _START, tolerance=1e-9).attitude(times)
    doubted, errors, bars = np.zeros(2, dtype=int), [], []
    for _ in range(6):
        recorded = attitudes @ so3.exp(0.001 * rng.normal(size=(31, 3)))
        noisy = through(arms(times) + 0.02 * rng.normal(size=(31, 2)), 1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TrajectoryWarning)
            fits = [
                sp.momentum_from_recording(noisy, times, recorded, joints=joints, tolerance=1e-6)
                for joints in (None, 0.02)
            ]
        doubted += [np.ptp(fit.momenta, axis=0).max() > 0.0 for fit in fits]
        errors.append(fits[1].momentum - _MOMENTUM)
        bars.append(np.sqrt(np.diag(sp.uncertainty(fits[1].motion, start=fits[1], joints=0.02).start)[3:]))
    assert doubted[0] > 1
    assert doubted[1] == 0
    assert np.all(np.abs(errors) < 4.0 * np.array(bars))


def test_the_noise_of_smoothed_joints_is_that_of_the_fit():
    """Without a noise that is given: the same momenta as with it, of a recording that the fit would doubt."""
    times, rng = np.linspace(0.0, 1.0, 31), np.random.default_rng(3)
    attitudes = sp.reconstruct(through(arms(times), 1.0), _MOMENTUM, _START, tolerance=1e-9).attitude(times)
    recorded = {
        "time": times,
        "shapes": arms(times) + 0.02 * rng.normal(size=(31, 2)),
        "joint_names": np.array(_BODY.joint_names),
        "base_quat_xyzw": so3.quat_from_matrix(attitudes @ so3.exp(2e-4 * rng.normal(size=(31, 3)))),
    }
    smoothed = sp.read_recorded_motion(recorded, _BODY, smooth=0.02, flight="all")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TrajectoryWarning)
        fits = [
            sp.motion_from_recording(_BODY, smoothed, joints=joints, tolerance=1e-6).fitted
            for joints in (None, smoothed.smoothing.noise, 0.0)
        ]
    np.testing.assert_array_equal(fits[0].momenta, fits[1].momenta)
    assert fits[0].conserved
    assert not fits[2].conserved


@pytest.mark.full
def test_a_jump_of_motion_capture_has_bars_as_long_as_its_momentum_scatters(tmp_path: Path):
    """Of 48 draws of noise like that of the file that ships, each component of the momentum within its 95 % bars, which
    are longer than the scatter by less than a half, as far as 48 draws show it. In one of 50 recordings chance brings a
    momentum that seems to change: in all but three of these, even the longest bars are less than twice the scatter."""
    draws, errors, bars, counts = 48, [], [], []
    for seed in range(draws):
        file = bvh_files.write(tmp_path / "jump.bvh", bvh_files.jump_text(seed))
        person = bvh_files.load(file)
        joints = bvh_files.jump_joint_noise(person)
        recording = sp.read_recorded_motion(file, person, flight="auto")
        found = sp.motion_from_recording(person, recording, joints=joints, tolerance=1e-7)
        assert found.fitted is not None
        uncertain = sp.uncertainty(found.motion, joints=joints, start=found.fitted)
        errors.append(found.fitted.momentum - bvh_files.JUMP_MOMENTUM)
        bars.append(np.sqrt(np.diag(uncertain.start)[3:]))
        counts.append(uncertain.twists)
    inside = np.mean(np.abs(errors) < 1.959964 * np.array(bars), axis=0)
    least, _ = binom.ppf([5e-4, 1.0], draws, 0.95) / draws
    assert np.all(inside >= least), inside
    # What so many draws leave open of the scatter: two of its own standard deviations.
    scatter = np.sqrt(np.mean(np.square(errors), axis=0)) * (1.0 + 2.0 / np.sqrt(2.0 * draws))
    bars = np.array(bars)
    assert np.all(bars.mean(axis=0) < 1.5 * scatter), bars.mean(axis=0) / scatter
    assert np.all(np.sort(bars, axis=0)[-4] < 2.0 * scatter), np.sort(bars, axis=0)[-4:] / scatter
    assert np.sort(counts)[-4] < 1.5 * np.median(counts)


def test_bars_in_time_are_those_of_moved_samples_starts_and_masses(exact: sp.RecordedMomentum):
    """Central differences of motions at one set of axes; with a fit, of fits to the same attitudes."""
    motion, step, at = exact.motion, 1e-4, np.array([0.1, 0.33, 0.6])
    found = motion.athlete_axes()
    same = {name: getattr(found, name) for name in ("lateral", "longitudinal", "somersault", "up")}

    def slope(change) -> np.ndarray:
        """Of somersault, tilt and twist at the times, (3, N), by a number that makes another motion."""
        ahead, behind = (np.array(change(sign * step).somersault_tilt_twist(at, **same)) for sign in (1.0, -1.0))
        return (ahead - behind) / (2.0 * step)

    def through_moved(size: float) -> sp.Deformation:
        moved = samples.copy()
        moved[3, 1] += size
        return through(moved)

    def heavier(size: float) -> sp.Deformation:
        part = next(part for part in _BODY.moving_parts if "left_arm" in part.links)
        mass = {"left_arm": (1.0 + size) * part.mass}
        body = _BODY.with_inertias(masses=mass, inertias={"left_arm": (1.0 + size) * part.inertia})
        return sp.articulated(body, motion.deformation.description.path)

    samples = path_samples(motion.deformation.description.path).values
    of_one = np.zeros((samples.size, samples.size))
    of_one[7, 7] = 1.0
    attitudes = motion.attitude(exact.times)
    for name, given, deformed in (
        ("joints", of_one, through_moved),
        ("inertias", sp.InertiaErrors(masses={"left_arm": 1.0}), heavier),
    ):
        fixed = slope(lambda size, by=deformed: sp.reconstruct(by(size), motion.momentum, _START, tolerance=1e-10))
        moved = slope(lambda size, by=deformed: fitted(by(size), exact.times, attitudes).motion)
        none = exact.covariance * 0.0
        for start, expected in ((none, fixed), (exact, moved)):
            bars = np.array(sp.error_bars.somersault_bars(motion, at, start=start, **{name: given}, **same))
            if start is exact:
                alone = np.array(sp.error_bars.somersault_bars(motion, at, start=exact.covariance, **same))
                bars = np.sqrt(bars**2 - alone**2)
            np.testing.assert_allclose(bars, np.abs(expected), atol=1e-6 * np.abs(fixed).max(), rtol=1e-5)
    turns = sp.error_bars.somersault_bars(motion, at, attitude=np.diag([1.0, 0.0, 0.0]), **same)
    by_start = slope(
        lambda size: sp.reconstruct(
            motion.deformation, motion.momentum, motion.initial_attitude @ so3.exp(np.array([size, 0.0, 0.0]))
        )
    )
    np.testing.assert_allclose(turns, np.abs(by_start), atol=1e-6)
    with pytest.raises(ShapeError, match="ascend"):
        sp.error_bars.somersault_bars(motion, at[::-1], attitude=0.1)
