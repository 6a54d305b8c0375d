"""Error bars to first order, against drawn motions and against what must hold exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, UnknownNameError
from support.long_runs import full_but

# What is computed is the same with and without machine code, which is quicker.

_DRAWS = 100


def motion(momentum: tuple[float, float, float] = (4.0, -6.0, 40.0), *, periodic: bool = True) -> sp.Motion:
    body = sp.load_body("diver")
    times = np.linspace(0.0, 1.0, 16)
    swing = np.stack([1.2 + np.sin(2.0 * np.pi * times), 1.0 + np.cos(2.0 * np.pi * times)], axis=1)
    path = sp.ShapePath.spline(times, swing, periodic=periodic)
    return sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-8)


SOURCES = {
    "joints": {"joints": 0.005},
    "one joint": {"joints": [0.01, 0.0]},
    "inertias": {"inertias": sp.InertiaErrors(masses=0.03, centres=0.02, inertias=0.03)},
    "momentum": {"momentum": np.diag([0.04, 0.01, 0.09])},
    "attitude": {"attitude": 0.01},
    "all": {"joints": 0.005, "inertias": sp.InertiaErrors(masses=0.02), "momentum": 0.1, "attitude": 0.005},
}


@pytest.mark.parametrize(
    ("source", "periodic"),
    full_but([*((name, True) for name in SOURCES), ("joints", False)], ("joints", False), ("all", True)),
)
def test_first_order_is_what_draws_show(source: str, periodic: bool):
    """A standard deviation of 100 draws is known to 6 %: four times that is allowed, and 2 % for the second order."""
    whole = motion(periodic=periodic)
    first = sp.uncertainty(whole, **SOURCES[source])
    drawn = sp.sampled_uncertainty(whole, **SOURCES[source], draws=_DRAWS, seed=3)
    allowed = 4.0 / np.sqrt(2.0 * _DRAWS) + 0.02
    for name in ("final_attitude", "total_rotation", "holonomy", "dynamical_rotation"):
        expected, found = getattr(drawn, name), getattr(first, name)
        size = np.sqrt(np.trace(found))
        gap = np.sqrt(np.diag(found)) - np.sqrt(np.diag(expected))
        assert np.abs(gap).max() <= allowed * size + 1e-7, name
    for name in ("dynamic_phase", "solid_angle", "montgomery_phase"):
        found, expected = getattr(first, name), getattr(drawn, name)
        assert abs(found - expected) <= allowed * found + 1e-7, name
    assert (first.draws, drawn.draws) == (0, _DRAWS)


def test_variances_of_independent_sources_add_up():
    whole = motion()
    parts = [sp.uncertainty(whole, **{key: value}) for key, value in SOURCES["all"].items()]
    together = sp.uncertainty(whole, **SOURCES["all"])
    np.testing.assert_allclose(together.total_rotation, sum(part.total_rotation for part in parts), rtol=1e-12)
    assert together.montgomery_phase**2 == pytest.approx(sum(part.montgomery_phase**2 for part in parts), rel=1e-12)


def test_a_covariance_is_as_good_as_a_deviation():
    whole = motion()
    samples = sp.derivatives(whole).by_samples.holonomy.shape[1]
    short = sp.uncertainty(whole, joints=[0.002, 0.003], momentum=0.1)
    long = sp.uncertainty(whole, joints=np.diag(np.tile([4e-6, 9e-6], samples // 2)), momentum=0.01 * np.eye(3))
    np.testing.assert_allclose(short.total_rotation, long.total_rotation, rtol=1e-12)


def test_a_turn_of_the_start_turns_the_end_with_it():
    """Without momentum nothing else happens: the rotation itself is seen in other axes."""
    resting = motion((0.0, 0.0, 0.0))
    found = sp.uncertainty(resting, attitude=0.01)
    np.testing.assert_allclose(found.final_attitude, 1e-4 * np.eye(3), atol=1e-12)
    assert found.montgomery_phase == found.dynamic_phase == found.solid_angle == 0.0


def test_a_rotation_about_a_known_axis_has_a_bar_that_grows_with_the_momentum():
    """A body that keeps its shape turns about the axis of its momentum by |l| T / I."""
    body = sp.load_body("diver")
    path = sp.ShapePath.spline([0.0, 0.5, 1.0], np.ones((3, 2)), periodic=False)
    inertia = body.locked_inertia(np.ones(2))
    values, vectors = np.linalg.eigh(inertia)
    turned = sp.reconstruct(sp.articulated(body, path), values[2] * vectors[:, 2], tolerance=1e-10)
    found = sp.uncertainty(turned, momentum=0.01 * values[2])
    assert so3.angle(turned.final_attitude) == pytest.approx(1.0, abs=1e-9)
    assert found.total_angle == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.002, 0.02, 1.0, np.pi - 0.01, np.pi])
def test_the_bar_of_an_angle_is_how_far_it_is_off(angle):
    """Rotations drawn with the covariance that is given; near 0 no angle is farther off than the whole rotation."""
    body = sp.load_body("diver")
    path = sp.ShapePath.spline([0.0, 0.5, 1.0], np.ones((3, 2)), periodic=False)
    values, vectors = np.linalg.eigh(body.locked_inertia(np.ones(2)))
    turned = sp.reconstruct(sp.articulated(body, path), angle * values[2] * vectors[:, 2], tolerance=1e-12)
    found = sp.uncertainty(turned, momentum=vectors * (values * [0.01, 0.02, 0.005]) ** 2 @ vectors.T)
    errors = np.random.default_rng(1).multivariate_normal(np.zeros(3), found.total_rotation, 100_000)
    drawn = Rotation.from_rotvec(errors) * Rotation.from_matrix(sp.split(turned).total_rotation)
    off = np.sqrt(np.mean((drawn.magnitude() - angle) ** 2))
    assert off < 1.02 * found.total_angle
    if angle in (0.0, 1.0, np.pi):  # between these the change is one-sided in part, and less than the bar
        assert found.total_angle == pytest.approx(off, rel=0.02)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"joints": -1.0}, ShapeError, "not negative"),
        ({"joints": np.eye(3)}, ShapeError, r"covariance \(30, 30\)"),
        ({"momentum": [[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, ShapeError, "symmetric"),
        ({"momentum": np.diag([1.0, 1.0, -1.0])}, ShapeError, "negative eigenvalue"),
        ({"attitude": np.nan}, ShapeError, "attitude"),
        ({"inertias": sp.InertiaErrors(masses={"tail": 0.1})}, UnknownNameError, "tail"),
        ({"inertias": sp.InertiaErrors(masses=-0.1)}, ShapeError, "not negative"),
    ],
)
def test_what_is_no_covariance(given: dict, error: type, message: str):
    with pytest.raises(error, match=message):
        sp.uncertainty(motion(), **given)


def test_one_draw_is_no_sample():
    with pytest.raises(ShapeError, match="2 or more"):
        sp.sampled_uncertainty(motion(), momentum=0.1, draws=1)
