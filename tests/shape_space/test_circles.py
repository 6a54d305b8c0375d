"""Circles of two joints: against closed forms in the plane, the flux within, and the curvature in the limit."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import shapephase as sp
from shapephase import planar
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from support.bodies import joint, link, urdf


@pytest.mark.parametrize("radius", [0.01, 0.5, 3.0])
def test_a_mass_round_two_others_turns_them_like_a_beanie(radius):
    """About their centre the moments of both parts are constant. Two masses off the plane keep all from one line."""
    p = ca.SX.sym("p", 2)
    masses = np.array([1.0, 2.5, 0.4, 0.4, 0.7])
    middle = [masses[1] / (masses[0] + masses[1]), 0.0]
    still = ca.DM([[0, 0, 0], [1, 0, 0], [*middle, 0.5], [*middle, -0.5]])
    places = ca.vertcat(still, ca.vertcat(p[0], p[1], 0).T)
    body = sp.particle_body(masses, ca.Function("round", [p], [places]), ["x", "y"], units="m")
    pair, third = masses[0] * masses[1] / masses[:2].sum(), masses[4] * masses[:4].sum() / masses.sum()
    loop = sp.ShapePath.circle(body, "x", "y", radius, centre=middle)
    turn = sp.so3.log(sp.holonomy(body, loop, 1e-12))
    known = planar.beanie_turn(pair, third * radius**2, 2.0 * np.pi)
    assert np.exp(1j * turn[2]) == pytest.approx(np.exp(1j * known), abs=4e-12)
    assert np.abs(turn[:2]).max() == 0.0


@pytest.fixture
def chain(tmp_path):
    """Three links in the plane with a hinge about z between each two."""
    links = [link(name, 1.0 + k, (0.1, 0.2, 0.3), (0.4, 0.1 * k, 0.0)) for k, name in enumerate(("a", "b", "c"))]
    hinges = [
        joint("near", "continuous", "a", "b", xyz=(1.0, 0.0, 0.0)),
        joint("far", "continuous", "b", "c", xyz=(1.0, 0.0, 0.0)),
    ]
    file = tmp_path / "chain.urdf"
    file.write_text(urdf(*links, *hinges))
    return sp.load_body(file)


def test_small_circles_of_the_cat_turn_it_by_the_curvature_times_their_area():
    """The next order in the radius is the third: half the circle, an eighth of the rest."""
    cat = sp.load_body("cat")
    centre = cat.shape({"waist_yaw": 0.2, "tail_1_pitch": 0.3})
    first, second = cat.joint_index("waist_pitch"), cat.joint_index("waist_yaw")
    field = sp.curvature(cat, centre)[first, second]
    rest = []
    for radius in (0.02, 0.01, 0.005):
        loop = sp.ShapePath.circle(cat, "waist_pitch", "waist_yaw", radius, centre=centre)
        assert np.array_equal(
            np.delete(loop.shape([0.0, 0.3]), (first, second), 1)[1], np.delete(centre, (first, second))
        )
        rest.append(sp.so3.log(sp.holonomy(cat, loop, 1e-13)) + np.pi * radius**2 * field)
    assert np.linalg.norm(rest[0]) < 0.02 * np.pi * 0.02**2 * np.linalg.norm(field)
    quarter = np.linalg.norm(rest[0] - 8.0 * rest[1]), np.linalg.norm(8.0 * (rest[1] - 8.0 * rest[2]))
    assert quarter[0] < 0.1 * np.linalg.norm(rest[0])
    assert quarter[1] < 0.6 * quarter[0] + 1e-11


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        (("waist_pitch", "waist_yaw", 1.2), TrajectoryError, "goes from -2.1 to 1 rad.*radii up to 1 fit there"),
        (("waist_yaw", "waist_pitch", 1.2), TrajectoryError, "waist_pitch of cat"),
        (("waist_pitch", "waist_pitch", 0.2), ShapeError, "two different joints"),
        (("waist_pitch", "waist", 0.2), UnknownNameError, "Did you mean 'waist_yaw'"),
        (("waist_pitch", "waist_yaw", 0.0), TrajectoryError, "^radius: "),
        (("waist_pitch", "waist_yaw", [0.1, 0.2]), TrajectoryError, "^radius: "),
    ],
)
def test_a_wrong_circle_is_named(arguments, error, said):
    with pytest.raises(error, match=said):
        sp.ShapePath.circle("cat", *arguments)


def test_a_circle_of_an_angle_and_a_length_has_no_radius():
    with pytest.raises(ShapeError, match=r"boom_extension \[m\]"):
        sp.ShapePath.circle("satellite", "boom_extension", "arm_1", 0.1)


def test_a_centre_beyond_a_limit_and_of_another_length_is_named():
    cat = sp.load_body("cat")
    beyond = cat.shape()
    beyond[cat.joint_index("waist_pitch")] = 1.3
    with pytest.raises(TrajectoryError, match="move the centre"):
        sp.ShapePath.circle(cat, "waist_pitch", "waist_yaw", 0.1, centre=beyond)
    with pytest.raises(ShapeError, match="centre"):
        sp.ShapePath.circle(cat, "waist_pitch", "waist_yaw", 0.1, centre=[0.0, 0.0])
