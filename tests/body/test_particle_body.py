"""Bodies of particles whose places are functions of parameters, against links, closed forms and published turns."""

from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import shapephase as sp
from shapephase.errors import ShapeError, UnknownNameError, WrongObjectError
from support.bodies import joint, link, urdf

EPS = np.finfo(float).eps
OPTIMAL_PENTAGON = 28.15937237
"""[degrees] Tong and Dullin 2012, unit masses."""
OPTIMAL_CONVEX_PENTAGON = 18.97477801
"""[degrees] The same among convex pentagons."""


def dumbbells(derivatives="casadi"):
    """Two rods of two particles, 1 and 2 m long, on a pin and in a universal joint's first two turns."""
    r = ca.SX.sym("r", 2)
    turned = ca.vertcat(
        ca.horzcat(ca.cos(r[0]), -ca.sin(r[0]), 0), ca.horzcat(ca.sin(r[0]), ca.cos(r[0]), 0), ca.horzcat(0, 0, 1)
    )
    leaned = ca.vertcat(
        ca.horzcat(1, 0, 0), ca.horzcat(0, ca.cos(r[1]), -ca.sin(r[1])), ca.horzcat(0, ca.sin(r[1]), ca.cos(r[1]))
    )
    second = (turned @ leaned @ ca.DM([[0.3, 1.0, -0.2], [0.1, -1.0, 0.4], [-0.7, 0.2, 0.6]])).T
    first = ca.DM([[0.5, 0.0, 0.1], [-1.5, 0.2, 0.0], [0.2, 0.7, -0.3]])
    places = ca.Function("places", [r], [ca.vertcat(first, second)])
    masses = [1.0, 2.0, 0.7, 0.5, 1.5, 0.9]
    if derivatives == "casadi":
        return sp.particle_body(masses, places, ["turn", "lean"])
    slopes = ca.Function("slopes", [r], [ca.jacobian(places(r), r[0]), ca.jacobian(places(r), r[1])])

    def given(shapes):
        found = [[np.asarray(one).reshape(3, 6).T for one in slopes(shape)] for shape in shapes]
        return np.stack([np.asarray(places(shape)) for shape in shapes]), np.array(found)

    return sp.particle_body(masses, given, ["turn", "lean"])


def linked(body):
    """The same as two links with the inertias of the particles, on two hinges."""
    points, links = body.places(np.zeros((1, 2)))[0][0], []
    for name, part in (("front", slice(0, 3)), ("back", slice(3, 6))):
        m, r = body.masses[part], points[part]
        centre = m @ r / m.sum()
        moment = np.einsum("m,mi,mj->ij", m, r - centre, r - centre)
        links.append(link(name, m.sum(), np.trace(moment) * np.eye(3) - moment, centre))
    between = '<link name="between"/>'
    hinges = joint("turn", "revolute", "front", "between"), joint("lean", "revolute", "between", "back", (1, 0, 0))
    return urdf(*links, between, *hinges)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    body = dumbbells()
    file = tmp_path_factory.mktemp("bodies") / "pair.urdf"
    file.write_text(linked(body))
    return body, sp.load_body(file, on_unphysical="warn")


LOOP = sp.ShapePath.fourier([0.2, -0.3], [[0.8, 0.1], [0.2, 0.0]], [[0.0, 0.3], [0.9, 0.0]], 1.5)


@pytest.mark.parametrize("derivatives", ["casadi", "given"])
def test_it_is_the_body_of_links_with_the_same_inertias(pair, derivatives):
    """Second derivatives that are given by differences are right to some 1e-12; no curvature depends on them."""
    ours, theirs = dumbbells(derivatives), pair[1]
    shapes = np.random.default_rng(0).uniform(-2.0, 2.0, (5, 2))
    rates = shapes[::-1]
    for ask in ("locked_inertia", "momentum_matrix", "inertia_gradient", "centre_of_mass"):
        np.testing.assert_allclose(getattr(ours, ask)(shapes), getattr(theirs, ask)(shapes), rtol=0, atol=200 * EPS)
    np.testing.assert_allclose(
        ours.momentum_matrix_gradient(shapes), theirs.momentum_matrix_gradient(shapes), rtol=0, atol=2e-12
    )
    np.testing.assert_allclose(sp.curvature(ours, shapes), sp.curvature(theirs, shapes), rtol=0, atol=500 * EPS)
    for ask in ("internal_momentum", "kinetic_energy", "inertia_rate"):
        found, known = (getattr(body, ask)(shapes, rates) for body in (ours, theirs))
        np.testing.assert_allclose(found, known, rtol=0, atol=500 * EPS)
    turning = np.ones(3)
    np.testing.assert_allclose(
        ours.angular_momentum_gradient(shapes, rates, turning),
        theirs.angular_momentum_gradient(shapes, rates, turning),
        rtol=0,
        atol=2e-11,
    )
    assert not sp.is_flat(ours, shapes)


def test_its_holonomy_and_its_motion_are_those_of_the_links(pair):
    ours, theirs = pair
    np.testing.assert_allclose(sp.holonomy(ours, LOOP, 1e-12), sp.holonomy(theirs, LOOP, 1e-12), rtol=0, atol=2e-12)
    np.testing.assert_allclose(sp.stokes_holonomy(ours, LOOP), sp.holonomy(theirs, LOOP), rtol=0, atol=2e-9)
    momentum = [0.5, -1.0, 2.0]
    ends = [
        sp.reconstruct(sp.articulated(body, LOOP), momentum, tolerance=1e-11).final_attitude for body in (ours, theirs)
    ]
    np.testing.assert_allclose(*ends, rtol=0, atol=2e-11)
    assert sp.articulated(ours, LOOP).closure is not None
    changes = sp.holonomy_derivative(ours, LOOP, lambda t: LOOP.shape(t)[:, None])[1]
    known = sp.holonomy_derivative(theirs, LOOP, lambda t: LOOP.shape(t)[:, None])[1]
    np.testing.assert_allclose(changes, known, rtol=0, atol=1e-8)


def test_three_bodies_in_a_plane_turn_by_half_the_solid_angle_on_their_sphere_of_shapes():
    """theory.md, section 7. The Jacobi vectors of equal masses, mapped by Hopf, are the sphere."""
    r = ca.SX.sym("r", 2)
    wide, high = ca.cos(r[0] / 2), ca.sin(r[0] / 2)
    one = ca.vertcat(wide, 0) / np.sqrt(0.5)
    two = high * ca.vertcat(ca.cos(r[1]), ca.sin(r[1])) / np.sqrt(2.0 / 3.0)
    corners = ca.vertcat((-one / 2).T, (one / 2).T, two.T)
    body = sp.particle_body(np.ones(3), ca.Function("corners", [r], [corners]), ["latitude", "longitude"])
    latitude = 0.8
    loop = sp.ShapePath.fourier([latitude, 1.5], [[0.3], [0.0]], [[0.0], [0.5]], 1.0)
    turn = sp.so3.log(sp.holonomy(body, loop, 1e-12))
    times = np.arange(64) / 64
    # Round a smooth loop even points sum to the integral of a one-form: the area between pole and loop.
    area = np.mean((1.0 - np.cos(loop.shape(times)[:, 0])) * loop.rate(times)[:, 1])
    np.testing.assert_allclose(turn, [0.0, 0.0, -0.5 * area], rtol=0, atol=2e-12)


def pentagon():
    """Corners of unit mass on a closed chain of unit edges, about the regular one."""
    k = np.arange(5)
    free, rest = ca.MX.sym("free", 2), ca.MX.sym("rest", 2)
    slow, fast = (ca.DM(np.stack([np.cos(f * k), np.sin(f * k)], axis=1)) for f in (0.4 * np.pi, 0.8 * np.pi))
    headings = 0.4 * np.pi * k + fast @ free + slow @ rest
    edges = ca.horzcat(ca.cos(headings), ca.sin(headings))
    closing = ca.rootfinder("closing", "newton", ca.Function("gap", [rest, free], [ca.sum1(edges).T]))
    corners = ca.cumsum(ca.substitute(edges, rest, closing(np.zeros(2), free)))
    return sp.particle_body(np.ones(5), ca.Function("corners", [free], [corners]), ["free_1", "free_2"])


@pytest.mark.parametrize(
    ("made", "low", "high"), [(pentagon, 0.7, 1.0), (sp.examples.linked_pentagon, 1.0, 2.5)], ids=["written", "shipped"]
)
def test_the_optimal_pentagon_turns_as_published(made, low, high):
    """The loop of zero curvature; next to it the turn changes in second order only, so that 60 rays are enough."""
    body = made()
    angles = 0.5 * np.pi + 0.4 * np.pi * np.arange(7) / 12.0
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def turning(s, ray):
        return sp.curvature(body, s * ray)[0, 1, 2]

    sizes = [brentq(turning, low, high, args=(ray,), xtol=1e-5) for ray in rays]
    # Of a fifth of the loop the second half mirrors the first.
    sizes = np.append(np.tile(np.concatenate([sizes[:-1], sizes[:0:-1]]), 5), sizes[0])
    around = 0.5 * np.pi + 2.0 * np.pi * np.arange(61) / 60.0
    shapes = sizes[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    loop = sp.ShapePath.spline(np.arange(61.0), shapes)
    turn = np.degrees(sp.so3.angle(sp.holonomy(body, loop, 1e-8)))
    assert abs(turn - OPTIMAL_PENTAGON) < 2e-6


@pytest.mark.full
def test_the_optimal_convex_pentagon_turns_as_published():
    """All convex ones are where the curvature is positive: the loop is the border, where one corner is flat."""
    body = pentagon()

    def flattest(s, ray):
        edges = np.diff(body.positions(s * ray), axis=0, append=body.positions(s * ray)[:1])[:, :2]
        ahead = np.roll(edges, -1, axis=0)
        return (edges[:, 0] * ahead[:, 1] - edges[:, 1] * ahead[:, 0]).min()

    nodes, weights = np.polynomial.legendre.leggauss(20)
    angles, outward = 0.5 * np.pi + 0.1 * np.pi * (nodes + 1.0), 0.5 * (nodes + 1.0)
    turn = 0.0
    for angle, weight in zip(angles, weights, strict=True):
        ray = np.array([np.cos(angle), np.sin(angle)])
        size = brentq(flattest, 0.1, 0.92, args=(ray,), xtol=1e-13)
        inside = sp.curvature(body, size * outward[:, None] * ray)[:, 0, 1, 2]
        turn += 0.1 * np.pi * weight * 0.5 * weights @ (inside * size**2 * outward)
    # Ten such sectors are alike by the mirrors of the regular pentagon.
    assert abs(np.degrees(10.0 * turn) - OPTIMAL_CONVEX_PENTAGON) < 1e-8


def test_a_yo_yo_despins_as_published():
    """theory.md, section 7: what momentum and energy leave of the hub's rate when both cords of length l leave it.

    The hub is four particles; the cords unwind by the angle u, and the energy gives the rate of u.
    """
    radius, hub, mass, length = 0.5, 3.0, 0.2, 1.7
    u = ca.SX.sym("u")
    out, along = ca.vertcat(ca.cos(u), ca.sin(u)).T, ca.vertcat(ca.sin(u), -ca.cos(u)).T
    end = radius * (out + u * along)
    arms = radius * ca.DM([[1, 0], [0, 1], [-1, 0], [0, -1]])
    body = sp.particle_body(
        4 * [hub / 4] + 2 * [mass / 2], ca.Function("ends", [u], [ca.vertcat(arms, end, -end)]), ["u"]
    )
    inertia = body.locked_inertia([[0.0], [length / radius]])[:, 2, 2]
    matrix = body.momentum_matrix([[0.0], [length / radius]])[:, 2, 0]
    momentum, energy = inertia[0] * 1.0, 0.5 * inertia[0]
    at_end = 2.0 * body.kinetic_energy([length / radius], [1.0]) - matrix[1] ** 2 / inertia[1]
    rate = np.sqrt((2.0 * energy - momentum**2 / inertia[1]) / at_end)
    # Released along the radius: the hub keeps what the connection leaves of its rate.
    final = (momentum - matrix[1] * rate) / inertia[1]
    c = hub / mass + 1.0
    np.testing.assert_allclose(final, (c * radius**2 - length**2) / (c * radius**2 + length**2), rtol=0, atol=20 * EPS)


def test_wrong_places_are_refused_by_name():
    def places(shapes):
        return np.ones((len(shapes), 3, 3)), np.zeros((len(shapes), 1, 3, 3))

    def wrong(shapes):
        return shapes[:, :, None] * np.arange(9.0).reshape(3, 3), np.ones((len(shapes), 1, 3, 3))

    body = sp.particle_body(np.ones(3), places, ["a"])
    for ask, error, words in (
        (lambda: sp.particle_body([1.0, -1.0], places, ["a"]), ShapeError, "masses"),
        (lambda: sp.particle_body([1.0, 1.0], places, ["a"], units="deg"), ShapeError, "units"),
        (lambda: sp.particle_body([1.0, 1.0], places, ["a"], continuous=["b"]), UnknownNameError, "'b'"),
        (lambda: sp.particle_body([1.0, 1.0], np.eye(3), ["a"]), WrongObjectError, "places"),
        (lambda: sp.particle_body([1.0, 1.0], places, ["a"]).positions([0.0]), ShapeError, r"\(1, 2, 3\)"),
        (lambda: sp.particle_body(np.ones(3), wrong, ["a"]).positions([0.4]), ShapeError, "derivatives"),
        (lambda: body.positions([0.0, 0.0]), ShapeError, r"expected \(\.\.\., 1\)"),
        (lambda: body.shape({"b": 0.0}), UnknownNameError, "parameter"),
        (lambda: sp.particle_body([1, 1], ca.Function("f", [ca.SX.sym("r", 2)], [1]), ["a"]), ShapeError, "casadi"),
    ):
        with pytest.raises(error, match=words):
            ask()


def test_it_goes_to_another_process_where_its_function_does():
    body = dumbbells()
    again = pickle.loads(pickle.dumps(body))
    np.testing.assert_array_equal(again.positions([0.3, 0.4]), body.positions([0.3, 0.4]))
    with pytest.raises(sp.errors.LocalFunctionError):
        pickle.dumps(dumbbells("given"))
