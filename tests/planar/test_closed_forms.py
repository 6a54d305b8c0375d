"""Planar closed forms, against holonomies of links and of particles."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import shapephase as sp
from shapephase import planar
from shapephase.errors import ShapePhaseError
from support.bodies import joint, link, urdf

EPS = np.finfo(float).eps


def hinged(tmp_path, inertias, masses, levers, kind="continuous"):
    """Two links whose centres of mass are `levers` from the hinge, in line at zero."""
    parts = [
        link("front", masses[0], (1.0, 1.0, inertias[0]), (-levers[0], 0.0, 0.0)),
        link("back", masses[1], (1.0, 1.0, inertias[1]), (levers[1], 0.0, 0.0)),
    ]
    file = tmp_path / "hinged.urdf"
    file.write_text(urdf(*parts, joint("hinge", kind, "front", "back")))
    return sp.load_body(file, on_unphysical="warn")


@pytest.mark.filterwarnings("ignore::shapephase.errors.UnphysicalInertiaWarning")
@pytest.mark.parametrize("levers", [(0.0, 0.0), (0.4, 0.7), (0.6, -0.2)])
def test_a_hinge_turns_the_first_link_as_the_closed_form_says(tmp_path, levers):
    inertias, masses = (1.1, 0.6), (2.0, 1.3)
    body = hinged(tmp_path, inertias, masses, levers)
    for angle in (0.7, -2.5, 2.0 * np.pi, 9.0):
        path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0], [angle]])
        rates = sp.horizontal_lift(body, path, 1e-12)
        turn = sp.so3.log(rates.attitude(1.0))[2]
        known = planar.two_link_turn(inertias, masses, levers, angle)
        assert np.exp(1j * turn) == pytest.approx(np.exp(1j * known), abs=4e-12)
    if levers == (0.0, 0.0):
        angles = np.array([0.3, 2.0 * np.pi, -9.0])
        np.testing.assert_allclose(
            planar.beanie_turn(*inertias, angles), planar.two_link_turn(inertias, masses, levers, angles), rtol=8 * EPS
        )


def test_the_square_cat_turns_as_its_particles_do():
    r = ca.SX.sym("r", 2)
    arms = ca.DM([[1, 0], [0, 1], [-1, 0], [0, -1]])
    turned = ca.vertcat(ca.horzcat(ca.cos(r[1]), ca.sin(r[1])), ca.horzcat(-ca.sin(r[1]), ca.cos(r[1])))
    cat = ca.vertcat(arms, r[0] * (arms @ turned))
    body = sp.particle_body(np.ones(8), ca.Function("cat", [r], [cat]), ["arm", "angle"], units=["m", "rad"])
    near, far, angle = 0.6, 1.7, 1.1
    corners = [[near, 0.0], [far, 0.0], [far, angle], [near, angle], [near, 0.0]]
    legs = [sp.ShapePath.waypoints([0.0, 1.0], corners[k : k + 2]) for k in range(4)]
    square = legs[0].then(legs[1]).then(legs[2]).then(legs[3])
    turn = sp.so3.log(sp.holonomy(body, square, 1e-12))
    np.testing.assert_allclose(turn, [0.0, 0.0, planar.square_cat_turn(near, far, angle)], rtol=0, atol=4e-12)


def test_three_bodies_turn_by_half_the_solid_angle():
    """The frame of the first Jacobi vector, with different masses; steps on the sphere err as their square."""
    p = ca.SX.sym("p", 2)
    corners = ca.vertcat(ca.DM([[0, 0], [1, 0]]), ca.vertcat(p[0], p[1]).T)
    masses = [1.0, 2.5, 0.7]
    body = sp.particle_body(masses, ca.Function("corners", [p], [corners]), ["x", "y"], units="m")
    loop = sp.ShapePath.fourier([0.3, 1.0], [[0.5], [0.1]], [[0.1], [0.4]], 1.0)
    turn = sp.so3.log(sp.holonomy(body, loop, 1e-12))[2]
    found = []
    for count in (200, 400):
        places = body.places(loop.shape(np.arange(count) / count))[0][..., :2]
        found.append(planar.three_body_turn(masses, places))
    assert found[1] + (found[1] - found[0]) / 3.0 == pytest.approx(turn, abs=1e-8)


def test_a_yo_yo_stops_with_the_right_cord_and_not_before():
    hub, mass, radius = 3.0, 0.2, 0.5
    stop = planar.yo_yo_stop(hub, mass, radius)
    lengths = np.array([0.0, 0.5 * stop, stop, 2.0 * stop])
    rates = planar.yo_yo_rate(hub, mass, radius, lengths, 2.0)
    # Both balances: the ends move at R out along the tangent's normal, l (rate + unwinding), and R rate along it.
    assert rates[0] == 2.0
    for length, rate in zip(lengths, rates, strict=True):
        unwinding = 2.0
        ends = np.array([radius * rate, length * (rate + unwinding)])
        momentum = hub * rate + mass * (radius * ends[0] + length * ends[1])
        energy = hub * rate**2 + mass * ends @ ends
        assert momentum == pytest.approx((hub + mass * radius**2) * 2.0, rel=20 * EPS)
        assert energy == pytest.approx((hub + mass * radius**2) * 4.0, rel=20 * EPS)
    assert abs(rates[2]) < 10 * EPS


def test_wrong_numbers_are_refused():
    for ask in (
        lambda: planar.beanie_turn(-1.0, 1.0),
        lambda: planar.square_cat_turn(-1.0, 1.0, 1.0),
        lambda: planar.three_body_turn([1.0, 1.0], np.zeros((5, 3, 2))),
        lambda: planar.three_body_turn([1.0, 1.0, 1.0], np.zeros((5, 3, 2))),
        lambda: planar.yo_yo_rate(1.0, 0.0, 1.0, 1.0),
    ):
        with pytest.raises(ShapePhaseError):
            ask()
