"""The mechanical connection, its curvature and holonomies against differences, closed forms and a plain integrator."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import OpenPathError, ShapeError, SingularInertiaError, TrajectoryError
from support.bodies import joint, link, random_loop, random_shapes, urdf
from support.independent import hat
from support.long_runs import full_but

Z = np.array([0.0, 0.0, 1.0])


def about(axis, angle):
    return Rotation.from_rotvec(np.asarray(axis, dtype=float) * angle).as_matrix()


def angle_of(rotation):
    return Rotation.from_matrix(rotation).magnitude()


def lift(body, path, start, end):
    """U' = -U hat(A r'), by DOP853 on the nine entries."""

    def slope(t, u):
        omega = -sp.mechanical_connection(body, path.shape(t)) @ path.rate(t)
        return (u.reshape(3, 3) @ hat(omega)).ravel()

    u = np.eye(3).ravel()
    edges = [start, *(b for b in path.breaks if start < b < end), end]
    for a, b in itertools.pairwise(edges):
        u = solve_ivp(slope, (a, b), u, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return u.reshape(3, 3)


# ---- Connection -----------------------------------------------------------------------------------------------------


def test_the_connection_cancels_the_angular_momentum(body, rng):
    """B1: I (-A r') + L_o = 0 for every motion of the joints."""
    shapes, rates = random_shapes(body, rng, 5), rng.normal(size=(5, body.n_shape))
    connection = sp.mechanical_connection(body, shapes)
    assert connection.shape == (5, 3, body.n_shape)
    omega = -np.einsum("bij,bj->bi", connection, rates)
    momentum = body.internal_momentum(shapes, rates)
    left = np.einsum("bij,bj->bi", body.locked_inertia(shapes), omega) + momentum
    np.testing.assert_allclose(left, 0.0, atol=1e-13 * np.abs(momentum).max(), rtol=0)
    alone = np.linalg.solve(body.locked_inertia(shapes[2]), body.momentum_matrix(shapes[2]))
    np.testing.assert_allclose(connection[2], alone, atol=1e-12 * np.abs(alone).max(), rtol=0)


def test_connection_and_curvature_check_their_shapes(load_urdf):
    diver = sp.load_body("diver")
    for function in (sp.mechanical_connection, sp.curvature):
        with pytest.raises(ShapeError, match="left_shoulder_abduction"):
            function(diver, np.zeros(3))
        with pytest.raises(ShapeError, match="nan"):
            function(diver, [0.0, np.nan])
    line = load_urdf(
        urdf(link("a", 1, [0, 0, 0]), link("b", 1, [0, 0, 0]), joint("s", "prismatic", "a", "b", (1, 0, 0), (1, 0, 0)))
    )
    for function in (sp.mechanical_connection, sp.curvature):
        with pytest.raises(SingularInertiaError):
            function(line, [0.5])


# ---- Curvature ------------------------------------------------------------------------------------------------------


def test_curvature_of_a_batch(rng):
    cat = sp.load_body("cat_two_halves")
    shapes = random_shapes(cat, rng, 6).reshape(2, 3, 3)
    together = sp.curvature(cat, shapes)
    assert together.shape == (2, 3, 3, 3, 3)
    np.testing.assert_array_equal(together[1, 2], sp.curvature(cat, shapes[1, 2]))


# ---- The square cat: unit masses at the ends of two crossed rods, one of variable length ----------------------------


@pytest.fixture
def square_cat(load_urdf):
    return load_urdf(
        urdf(
            link("rod", 2.0, [0.0, 2.0, 2.0]),
            '<link name="hub"/>',
            link("east", 1.0, [0, 0, 0]),
            link("west", 1.0, [0, 0, 0]),
            joint("angle", "continuous", "rod", "hub"),
            joint("reach", "prismatic", "hub", "east", (1, 0, 0)),
            joint("west_reach", "prismatic", "hub", "west", (-1, 0, 0), extra='<mimic joint="reach"/>'),
        )
    )


def test_square_cat_connection_and_curvature(square_cat):
    """r^2/(1 + r^2) dphi (theory.md section 7), hence F_(r, phi) = 2 r/(1 + r^2)^2."""
    phi, r = square_cat.joint_index("angle"), square_cat.joint_index("reach")
    for angle, reach in ((0.3, 0.7), (1.1, 1.9), (-2.0, 0.2)):
        shape = square_cat.shape({"angle": angle, "reach": reach})
        connection = sp.mechanical_connection(square_cat, shape)
        np.testing.assert_allclose(connection[:, phi], reach**2 / (1 + reach**2) * Z, atol=1e-13, rtol=0)
        np.testing.assert_allclose(connection[:, r], 0.0, atol=1e-13, rtol=0)
        np.testing.assert_allclose(
            sp.curvature(square_cat, shape)[r, phi],
            2 * reach / (1 + reach**2) ** 2 * Z,
            atol=1e-12,
            rtol=0,
        )


def test_square_cat_holonomy(square_cat):
    """Reach out, turn, draw in, turn back: the difference of r^2/(1 + r^2) times the angle, against the turn."""
    near, far, sweep = 0.6, 1.7, 1.2
    corners = [(0.3, near), (0.3, far), (0.3 + sweep, far), (0.3 + sweep, near), (0.3, near)]
    shapes = [square_cat.shape({"angle": a, "reach": r}) for a, r in corners]
    path = sp.ShapePath.waypoints([0.0, 0.5, 1.1, 2.0, 3.0], shapes)
    turn = (far**2 / (1 + far**2) - near**2 / (1 + near**2)) * sweep
    np.testing.assert_allclose(sp.holonomy(square_cat, path, 1e-12), about(Z, -turn), atol=1e-11, rtol=0)


# ---- Elroy's beanie and reaction wheels -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["continuous", "revolute"])
def test_elroys_beanie(kind, load_urdf):
    """Two planar bodies on a pin through both centres: -2 pi I2/(I1 + I2) a turn (theory.md section 7)."""
    first, second = 3.0, 0.7
    body = load_urdf(
        urdf(
            link("head", 2.0, [2, 2, first]),
            link("beanie", 1.0, [0.4, 0.4, second]),
            joint("pin", kind, "head", "beanie"),
        )
    )
    for turns in (1, -1, 3):
        path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0], [2.0 * np.pi * turns]])
        if kind == "revolute":
            with pytest.raises(OpenPathError, match="pin"):
                sp.holonomy(body, path)
            continue
        want = about(Z, -2.0 * np.pi * turns * second / (first + second))
        np.testing.assert_allclose(sp.holonomy(body, path, 1e-12), want, atol=1e-11, rtol=0)


def test_a_reaction_wheel_in_a_lopsided_body(load_urdf):
    """Balanced and round, it leaves I alone: one turn gives exp(-2 pi I^-1 I_w a), about no axis of symmetry."""
    turn = about(Rotation.from_rotvec([0.3, -0.5, 0.9]).apply([1, 0, 0]), 0.8)
    bus = turn @ np.diag([1.0, 1.7, 2.2]) @ turn.T
    wheel, axis = np.array([0.2, 0.2, 0.3]), Rotation.from_euler("xyz", [0.4, -0.9, 0.0])
    a = axis.apply(Z)
    body = load_urdf(
        urdf(
            link("bus", 5.0, 0.5 * (bus + bus.T)),
            link("wheel", 1.0, wheel),
            joint("spin", "continuous", "bus", "wheel", Z, (0.4, -0.2, 0.3), (0.4, -0.9, 0.0)),
        )
    )
    reduced, arm = 5.0 / 6.0, np.array([0.4, -0.2, 0.3])
    inertia = bus + axis.as_matrix() @ np.diag(wheel) @ axis.as_matrix().T
    inertia += reduced * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    rate = np.linalg.solve(inertia, wheel[2] * a)
    np.testing.assert_allclose(sp.mechanical_connection(body, [2.0])[:, 0], rate, atol=1e-13, rtol=0)
    path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0], [2.0 * np.pi]])
    want = expm(-2.0 * np.pi * np.cross(np.eye(3), rate))
    np.testing.assert_allclose(sp.holonomy(body, path, 1e-12), want, atol=1e-11, rtol=0)


# ---- Cats and astronauts --------------------------------------------------------------------------------------------


# ---- Laws of the holonomy -------------------------------------------------------------------------------------------


def test_a_loop_backwards_undoes_it(body, rng):
    path = random_loop(body, rng)
    forth, back = sp.holonomy(body, path, 1e-11), sp.holonomy(body, path.reversed(), 1e-11)
    np.testing.assert_allclose(back, forth.T, atol=3e-11, rtol=0)


def test_going_round_again_is_a_power(rng):
    cat = sp.load_body("cat")
    path = random_loop(cat, rng, amplitude=0.8)
    once = sp.holonomy(cat, path, 1e-12)
    for count in (2, 7, 200):
        many = sp.holonomy(cat, path.repeated(count), 1e-10)
        np.testing.assert_allclose(many, np.linalg.matrix_power(once, count), atol=1e-9, rtol=0)
    cubed = np.linalg.matrix_power(once, 3)
    for three in (path.repeated(2).then(path), path.stretched(2.0).repeated(3), path.repeated(3).stretched(0.1)):
        np.testing.assert_allclose(sp.holonomy(cat, three, 1e-10), cubed, atol=1e-9, rtol=0)
    np.testing.assert_allclose(sp.holonomy(cat, path.repeated(3).reversed(), 1e-10), cubed.T, atol=1e-9, rtol=0)
    np.testing.assert_allclose(sp.holonomy(cat, path.reversed().repeated(3), 1e-10), cubed.T, atol=1e-9, rtol=0)
    corners = sp.ShapePath.waypoints([0, 1, 2, 3], path.shape(path.duration * np.array([0.0, 0.3, 0.7, 1.0])))
    cornered = sp.holonomy(cat, corners, 1e-12)
    np.testing.assert_allclose(
        sp.holonomy(cat, corners.repeated(5), 1e-10),
        np.linalg.matrix_power(cornered, 5),
        atol=1e-9,
        rtol=0,
    )


def test_only_the_loop_counts_not_how_fast_it_is_gone_round(rng):
    cat = sp.load_body("cat_two_halves")
    path = random_loop(cat, rng, duration=1.0, amplitude=1.0)
    want = sp.holonomy(cat, path, 1e-11)

    def uneven(t):
        s, rate = t / 3.0 + 0.1 * np.sin(2 * np.pi * t / 3.0), 1 / 3.0 + 0.2 * np.pi / 3.0 * np.cos(2 * np.pi * t / 3.0)
        return path.shape(s), path.rate(s) * rate[:, None]

    assert angle_of(want) > 0.01
    np.testing.assert_allclose(sp.holonomy(cat, sp.ShapePath.function(uneven, 3.0), 1e-11), want, atol=1e-10, rtol=0)
    np.testing.assert_allclose(sp.holonomy(cat, path.stretched(1e4), 1e-11), want, atol=1e-10, rtol=0)
    np.testing.assert_allclose(sp.holonomy(cat, path.stretched(1e-4), 1e-11), want, atol=1e-10, rtol=0)


def test_another_starting_point_turns_the_axis(rng):
    """U(s)^T R_G U(s), U the lift from the old start to the new one."""
    cat = sp.load_body("cat_two_halves")
    path = random_loop(cat, rng, duration=1.0, amplitude=1.0)
    shift = 0.3
    later = sp.ShapePath.function(
        lambda t: (path.shape(np.mod(t + shift, 1.0)), path.rate(np.mod(t + shift, 1.0))), 1.0, [1.0 - shift]
    )
    to_there = lift(cat, path, 0.0, shift)
    want = to_there.T @ sp.holonomy(cat, path, 1e-11) @ to_there
    np.testing.assert_allclose(sp.holonomy(cat, later, 1e-11), want, atol=1e-10, rtol=0)
    assert np.abs(want - sp.holonomy(cat, path)).max() > 1e-3


@pytest.mark.parametrize("tolerance", full_but([1e-4, 1e-6, 1e-9, 1e-12], 1e-4, 1e-12))
def test_the_tolerance_is_kept(tolerance, rng):
    cat = sp.load_body("cat")
    path = random_loop(cat, rng, harmonics=4, amplitude=1.0)
    want = lift(cat, path, 0.0, path.duration)
    assert angle_of(sp.holonomy(cat, path, tolerance) @ want.T) < tolerance + 1e-11


def test_an_open_path_has_no_holonomy():
    """The joint that is farthest from closing is named, with its gap."""
    diver = sp.load_body("diver")
    path = sp.ShapePath.waypoints([0, 1], [[0.0, 0.0], [0.25, -0.5]])
    with pytest.raises(OpenPathError, match="right_shoulder_abduction") as caught:
        sp.holonomy(diver, path)
    assert isinstance(caught.value, TrajectoryError)
    assert isinstance(caught.value, ValueError)
    with pytest.raises(OpenPathError):
        sp.holonomy(diver, sp.ShapePath.waypoints([0, 1], [[0.0, 0.0], [0.0, 2 * np.pi]]))
    nearly = sp.ShapePath.waypoints([0, 1, 2], [[0.0, 0.0], [1.0, 0.3], [5e-10, 0.0]])
    assert sp.holonomy(diver, nearly).shape == (3, 3)
