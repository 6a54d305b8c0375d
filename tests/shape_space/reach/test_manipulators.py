"""The generalised Jacobian, against the motion itself; rates that leave the base still; dynamic singularities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import shapephase as sp
from shapephase.errors import ShapeError, UnknownNameError
from support.bodies import joint, link, urdf

EPS = np.finfo(float).eps


@pytest.mark.parametrize(("name", "tip"), [("satellite", -1), ("cat_two_halves", -1)])
def test_it_is_the_velocity_of_a_link_along_a_free_motion(name, tip):
    """Places in space from the lift, differentiated by differences of eighth order."""
    body = sp.load_body(name)
    hand, point = body.link_names[tip], np.array([0.1, -0.2, 0.3])
    rng = np.random.default_rng(0)
    size = 0.2 * rng.uniform(-1.0, 1.0, (2, body.n_shape, 1))
    path = sp.ShapePath.fourier(0.1 * rng.normal(size=body.n_shape), *size, 1.0)
    lift = sp.horizontal_lift(body, path, 1e-12)

    def pose(t):
        turned, pose = lift.attitude(t), body.link_pose(path.shape(t), hand)
        place = (pose[..., :3, :3] @ point) + pose[..., :3, 3] - body.centre_of_mass(path.shape(t))
        return np.einsum("...ij,...j->...i", turned, place), turned @ pose[..., :3, :3]

    t, h = 0.37, 0.01
    weights = np.array([4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0]) / h
    steps = h * np.arange(1, 5)
    ahead, behind = pose(t + steps), pose(t - steps)
    speed, slope = (np.tensordot(weights, a - b, 1) for a, b in zip(ahead, behind, strict=True))
    spin = sp.so3.vee(slope @ pose(t)[1].T)
    matrix = sp.generalised_jacobian(body, path.shape(t), hand, point)
    found = (matrix @ path.rate(t)).reshape(2, 3) @ lift.attitude(t).T
    np.testing.assert_allclose(found, [speed, spin], rtol=0, atol=2e-9)


def test_with_the_base_at_rest_it_is_the_usual_one():
    body = sp.load_body("satellite")
    hand, shape, rate = body.link_names[-1], 0.2 * np.ones(10), np.linspace(-1.0, 1.0, 10)
    matrix = sp.generalised_jacobian(body, np.stack([shape, -shape]), hand, fixed_base=True)
    assert matrix.shape == (2, 6, 10)
    np.testing.assert_allclose(
        matrix[0, 3:] @ rate, body.link_angular_velocity(shape, rate, hand), rtol=0, atol=50 * EPS
    )
    step = 1e-5
    moved = (body.link_pose(shape + step * rate, hand) - body.link_pose(shape - step * rate, hand))[:3, 3] / (
        2.0 * step
    )
    np.testing.assert_allclose(matrix[0, :3] @ rate, moved, rtol=0, atol=1e-8)


def test_rates_of_the_null_space_leave_the_base_still():
    body = sp.load_body("satellite")
    shape = np.linspace(-0.3, 0.4, 10)
    quiet = sp.reaction_null_space(body, shape)
    assert quiet.shape == (10, 7)
    np.testing.assert_allclose(quiet.T @ quiet, np.eye(7), rtol=0, atol=20 * EPS)
    turning = sp.mechanical_connection(body, shape)
    assert np.abs(turning @ quiet).max() < 1e3 * EPS * np.abs(turning).max()


def planar_arm(tmp_path, heavier=1.0):
    """Papadopoulos and Dubowsky 1993: an arm of two links of 1 m in a plane, 0.5 m from the centre of its base."""
    parts = [
        link("base", 40.0 * heavier, 3 * (6.667 * heavier,)),
        link("link1", 4.0, 3 * (0.333,), (0.5, 0.0, 0.0)),
        link("link2", 3.0, 3 * (0.25,), (0.5, 0.0, 0.0)),
        '<link name="hand"/>',
    ]
    joints = [
        joint("shoulder", "revolute", "base", "link1", xyz=(0.5, 0.0, 0.0)),
        joint("elbow", "revolute", "link1", "link2", xyz=(1.0, 0.0, 0.0)),
        joint("wrist", "fixed", "link2", "hand", xyz=(1.0, 0.0, 0.0)),
    ]
    file = tmp_path / f"arm{heavier:g}.urdf"
    file.write_text(urdf(*parts, *joints))
    return sp.load_body(file)


@pytest.mark.filterwarnings("ignore::shapephase.errors.UnphysicalInertiaWarning")
def test_the_arm_of_papadopoulos_and_dubowsky_is_singular_where_they_say(tmp_path):
    """At -65 and -11.41 degrees, where an arm on the ground is not; on a heavy base it is that arm."""
    body, plane = planar_arm(tmp_path), np.eye(6)[:2]

    def determinant(elbow):
        return np.linalg.det(sp.generalised_jacobian(body, [np.radians(-65.0), elbow], "hand")[:2])

    elbow = brentq(determinant, np.radians(-20.0), np.radians(-5.0), xtol=1e-15)
    assert np.degrees(elbow) == pytest.approx(-11.41, abs=0.005)
    values = sp.dynamic_manipulability(body, [np.radians(-65.0), elbow], "hand", directions=plane)
    assert values[1] < 1e-14 < 0.1 < values[0]
    ground = sp.generalised_jacobian(body, [np.radians(-65.0), elbow], "hand", fixed_base=True)[:2]
    assert np.linalg.det(ground) == pytest.approx(np.sin(elbow), abs=10 * EPS)
    heavy, shape = planar_arm(tmp_path, 1e9), [0.4, 1.1]
    free, fixed = (sp.generalised_jacobian(heavy, shape, "hand", fixed_base=still) for still in (False, True))
    np.testing.assert_allclose(free, fixed, rtol=0, atol=1e-8)


def test_links_that_are_none_are_refused():
    body = sp.load_body("satellite")
    with pytest.raises(UnknownNameError):
        sp.generalised_jacobian(body, body.shape(), "nothing")
    with pytest.raises(ShapeError):
        sp.generalised_jacobian(body, np.zeros(3), body.link_names[-1])
