"""Bars cover the truth as often as they say: noisy recordings of a known motion, each with bars of its own."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.stats import binom, chi2

import shapephase as sp
from shapephase import so3
from shapephase.examples.scenarios import cat_righting
from shapephase.shape_space.files.closing import closed_path
from shapephase.shape_space.files.smoothing import Recorded
from support.long_runs import full_but

# What is computed is the same with and without machine code, which is quicker.

_NOISE = np.radians(0.3)
_RATE = 60.0
_LEVEL = 0.95


def swing(name: str) -> sp.ShapePath:
    """A cycle of a second, all joints in a range of their own, at rest in its second half."""
    body = sp.load_body(name)
    rng = np.random.default_rng(11)
    times = np.arange(61) / _RATE
    share = np.clip(2.0 * times, 0.0, 1.0)[:, None]
    lift = np.sin(np.pi * share) ** 2
    phases = rng.uniform(0.0, 6.0, body.n_shape)
    samples = lift * (0.6 * rng.normal(size=body.n_shape) + 0.5 * np.sin(2.0 * np.pi * share + phases))
    samples[-1] = samples[0]
    return sp.ShapePath.spline(times, samples, periodic=True)


@pytest.mark.parametrize(("name", "draws"), full_but(product(["cat", "astronaut"], [30, 400]), ("cat", 30)))
def test_a_recorded_cycle_with_noise(name: str, draws: int):
    """Each component of the holonomy's error within two bars, and its chi-square, in 95 % of the recordings."""
    body, path = sp.load_body(name), swing(name)
    times = path.breaks
    exact = path.shape(times[:-1])
    truth = sp.holonomy(body, path)
    rng = np.random.default_rng(4)
    errors, covariances = np.empty((draws, 3)), np.empty((draws, 3, 3))
    for row in range(draws):
        noisy = exact + _NOISE * rng.normal(size=exact.shape)
        recorded = sp.ShapePath.spline(times, np.concatenate([noisy, noisy[:1]]), periodic=True)
        motion = sp.reconstruct(sp.articulated(body, recorded), np.zeros(3), tolerance=1e-6)
        errors[row] = so3.log(sp.split(motion).holonomy @ truth.T)
        covariances[row] = sp.uncertainty(motion, joints=_NOISE).holonomy
    check(errors, covariances)


def righting() -> tuple[sp.ShapePath, np.ndarray]:
    """The falling cat's, with a pause before and after, as recorded without noise; and its holonomy."""
    body = sp.load_body("cat")
    slow = cat_righting(1.0).matched(body.joint_names, "cat")
    times = np.arange(91) / _RATE
    samples = slow.shape(np.clip(times - 0.25, 0.0, slow.duration))
    samples[-1] = samples[0]
    return sp.ShapePath.spline(times, samples, periodic=True), sp.holonomy(body, slow)


RECORDINGS = [*product(["cat", "astronaut"], ["smooth", "drift"]), ("righting", "smooth"), ("righting", "drift")]


@pytest.mark.parametrize(
    ("name", "by", "draws"),
    [("cat", "smooth", 10), *(pytest.param(*one, 400, marks=pytest.mark.full) for one in RECORDINGS)],
)
@pytest.mark.filterwarnings("ignore:joint .* moves by")
@pytest.mark.filterwarnings("ignore:motion that cannot be told from noise")  # the righting cat keeps some joints still
def test_a_noisy_recording_that_is_closed(name: str, by: str, draws: int):
    """Both ends have noise of their own; what smooths and closes it is chosen by each recording."""
    body = sp.load_body("cat" if name == "righting" else name)
    path, truth = righting() if name == "righting" else (swing(name), sp.holonomy(body, swing(name)))
    times = path.breaks
    exact = path.shape(times)
    rng = np.random.default_rng(7)
    errors, covariances, biases = np.empty((draws, 3)), np.empty((draws, 3, 3)), np.empty(draws)
    for row in range(draws):
        samples = exact + _NOISE * rng.normal(size=exact.shape)
        # Without drift, the gap is far below a tenth of a radian.
        level = np.full(body.n_shape, _NOISE if by == "smooth" else 0.0)
        recorded = Recorded(times, samples, level, body.joint_names)
        closed, _, _ = closed_path(recorded, body, within=0.1, by=by)
        motion = sp.reconstruct(sp.articulated(body, closed), np.zeros(3), tolerance=1e-6)
        errors[row] = so3.log(sp.split(motion).holonomy @ truth.T)
        bars = sp.uncertainty(motion, joints=_NOISE)
        covariances[row], biases[row] = bars.holonomy, bars.smoothing_bias
    check(errors, covariances)
    assert (biases > 0.0).all() if by == "smooth" else not biases.any()
    # The mean error beside the bar: what is biased in truth, to what so many draws show.
    off = np.abs(errors.mean(axis=0)) / np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)).mean(axis=0)
    assert off.max() < 0.2 + 3.5 / np.sqrt(draws)


@pytest.mark.parametrize(
    ("name", "draws"),
    [("cat", 10), *(pytest.param(name, 400, marks=pytest.mark.full) for name in ("cat", "astronaut"))],
)
def test_bodies_that_are_not_quite_known(name: str, draws: int):
    """Masses, centres and inertias of the links off by 5 %, and bars of the body that is believed in."""
    body, path = sp.load_body(name), swing(name)
    truth = sp.holonomy(body, path)
    errors_of = sp.InertiaErrors(masses=0.05, centres=0.05, inertias=0.05)
    errors, covariances = np.empty((draws, 3)), np.empty((draws, 3, 3))
    for row, believed in enumerate(drawn_bodies(body, draws)):
        motion = sp.reconstruct(sp.articulated(believed, path), np.zeros(3), tolerance=1e-6)
        errors[row] = so3.log(sp.split(motion).holonomy @ truth.T)
        covariances[row] = sp.uncertainty(motion, inertias=errors_of).holonomy
    check(errors, covariances)


def drawn_bodies(body: sp.Body, draws: int) -> sp.BodyFamily:
    """Relative errors of 5 % of each part: of mass, of centre in radii of gyration, of inertia beside the mass."""
    parts, rng = [part for part in body.moving_parts if part.mass], np.random.default_rng(8)
    given: dict[str, dict[str, np.ndarray]] = {"masses": {}, "centres": {}, "inertias": {}}
    for part in parts:
        link, radius = part.links[0], np.sqrt(0.5 * np.trace(part.inertia) / part.mass)
        growth, stretch = 1.0 + 0.05 * rng.normal(size=(2, draws))
        given["masses"][link] = growth * part.mass
        given["centres"][link] = part.centre + 0.05 * radius * rng.normal(size=(draws, 3))
        given["inertias"][link] = (growth * stretch)[:, None, None] * part.inertia
    found = body.with_inertias(**given, on_unphysical="allow")
    assert isinstance(found, sp.BodyFamily)
    return found


def check(errors: np.ndarray, covariances: np.ndarray) -> None:
    """Of the errors (draws, 3) as many as should be are within their bars, and these are as long as they scatter."""
    draws = len(errors)
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    squares = np.einsum("na,na->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0])
    # What so many draws leave open, with a chance of one in a thousand; 92 to 98 % of 400.
    least, most = binom.ppf([5e-4, 1.0 - 5e-4], draws, _LEVEL) / draws
    inside = np.mean(np.abs(errors) < 1.959964 * deviations, axis=0)
    assert np.all((inside >= least) & (inside <= most)), inside
    assert least <= np.mean(squares < chi2.ppf(_LEVEL, 3)) <= most
    # The bar's own length beside the scatter, which is known to one in the root of twice the draws.
    scatter = np.sqrt(np.mean(errors**2, axis=0))
    allowed = max(0.15, 3.3 / np.sqrt(2.0 * draws))
    np.testing.assert_allclose(deviations.mean(axis=0), scatter, rtol=allowed)
