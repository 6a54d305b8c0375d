"""What is reachable: ranks known from symmetry, and loops that turn as predicted."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, WrongObjectError
from support.bodies import joint, link, urdf

CUBE = (0.1, 0.1, 0.1)
Z = (0.0, 0.0, 1.0)


def chain(*kinds, offset=0.0, centre=0.0):
    """Links along x on joints with parallel axes z; `offset` along z between them, `centre` of their mass."""
    links = [link(f"part{k}", 1.0 + 0.3 * k, CUBE, (0.5, 0.1 * k, centre * k)) for k in range(len(kinds) + 1)]
    joints = [
        joint(f"joint{k}", kind, f"part{k}", f"part{k + 1}", Z, (1.0, 0.0, offset)) for k, kind in enumerate(kinds)
    ]
    return urdf(*links, *joints)


@pytest.fixture
def load(tmp_path):
    def loaded(text):
        file = tmp_path / "body.urdf"
        file.write_text(text)
        return sp.load_body(file)

    return loaded


def untwisted_cat():
    """Two equal halves of five particles; the spine bends by a vector across it, half in each, and does not twist."""
    bend = ca.SX.sym("bend", 2)
    vector = ca.vertcat(0, bend)
    spin = ca.skew(vector)
    turned = ca.DM.eye(3) + 2.0 / (1.0 + ca.dot(vector, vector)) * (spin + spin @ spin)
    half = ca.DM([[1, 0.3, 0], [1, -0.3, 0], [1, 0, 0.3], [1, 0, -0.3], [2, 0, 0]])
    places = ca.vertcat((turned @ half.T).T, (turned.T @ (half @ ca.diag(ca.DM([-1, 1, 1]))).T).T)
    return sp.particle_body(np.ones(10), ca.Function("halves", [bend], [places]), ["pitch", "yaw"])


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "continuous"])
def test_with_one_joint_no_loop_turns_the_body(load, kind):
    found = sp.reachable(load(chain(kind, offset=0.3)))
    assert (found.rank, found.orders, found.loops, found.pairs) == (0, (), (), ())
    assert not found.is_complete


@pytest.mark.parametrize("kinds", [("revolute", "revolute"), ("revolute", "revolute", "revolute")])
def test_links_that_a_plane_mirrors_turn_about_its_normal_alone(load, kinds):
    shape = np.linspace(0.3, 0.7, len(kinds))
    found = sp.reachable(load(chain(*kinds)), shape)
    assert found.rank == 1
    assert found.gap > 1e6
    np.testing.assert_allclose(np.abs(found.orders[-1].axes), [Z], rtol=0, atol=1e-12)


def test_the_same_axes_with_links_offset_along_them_reach_every_rotation(load):
    shape = [0.3, 0.7]
    found = sp.reachable(load(chain("revolute", "revolute", centre=0.2)), shape)
    assert found.rank == 3
    assert found.is_complete
    assert found.gap > 1e4
    # Where joints stand along their axes does not matter; where masses are does.
    assert sp.reachable(load(chain("revolute", "revolute", offset=0.2)), shape).rank == 3


def test_the_untwisted_cat_of_two_halves_turns_about_its_spine_alone():
    """Montgomery 1993: the exchange of both halves leaves the group of a circle. With a twist it is all rotations."""
    for shape in ([0.0, 0.0], [0.3, -0.2]):
        found = sp.reachable(untwisted_cat(), shape)
        assert found.rank == 1
        assert found.gap > 1e6
        np.testing.assert_allclose(np.abs(found.loops[0].axis), [1.0, 0.0, 0.0], rtol=0, atol=1e-12)
    assert sp.reachable(sp.load_body("cat_two_halves")).rank == 3


def test_the_diver_needs_derivatives_of_the_curvature():
    found = sp.reachable(sp.load_body("diver"))
    assert found.rank == 3
    assert [(each.order, each.rank) for each in found.orders] == [(2, 1), (3, 3)]
    assert [each.order for each in found.loops] == [2, 3, 3]
    # At another shape the curvature spans the same, carried there.
    again = sp.reachable(sp.load_body("diver"), [0.4, -0.7])
    assert again.rank == 3


@pytest.mark.full
@pytest.mark.parametrize("name", ["cat", "astronaut", "example:human"])
def test_bodies_of_animals_and_people_reach_every_rotation(name):
    found = sp.reachable(sp.load_body(name))
    assert found.rank == 3
    assert found.gap > 1e5
    sizes = [each.rate for each in found.pairs]
    assert sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize(("name", "shape"), [("diver", None), ("cat_two_halves", (0.3, 0.2, -0.4))])
def test_the_smallest_loops_turn_as_predicted_and_in_the_order_of_their_stroke(name, shape):
    """Halving the stroke divides the turn by 2^order, and the rest of the prediction at least as 2^(order + 1/2)."""
    body = sp.load_body(name)
    for each in sp.reachable(body, shape).loops:
        strokes = np.array([0.04, 0.02, 0.01])
        turns = np.array([sp.so3.log(sp.holonomy(body, each.loop(s), 1e-13)) for s in strokes])
        about = turns @ each.axis
        rest = np.linalg.norm(turns - each.rotation_vector(strokes), axis=1)
        np.testing.assert_allclose(np.log2(about[:-1] / about[1:]), each.order, rtol=0, atol=0.02)
        np.testing.assert_allclose(about[-1], each.turn * strokes[-1] ** each.order, rtol=0.01)
        assert np.all(np.log2(rest[:-1] / rest[1:]) > each.order + 0.5)


def test_no_other_small_loop_of_that_energy_turns_further_about_the_axis():
    """Circles in random planes, of the same stroke, about the axis of second order."""
    body = sp.load_body("diver")
    best = sp.reachable(body).loops[0]
    field = sp.curvature(body, np.zeros(2))
    for plane in np.random.default_rng(0).normal(size=(50, 2, 2)):
        u, w = np.linalg.qr(plane.T)[0].T
        assert np.pi * abs(np.einsum("i,j,ija,a", u, w, field, best.axis)) <= best.turn * (1.0 + 1e-12)
    # Of eights, by brute force over both directions.
    slopes = [(sp.curvature(body, h) - sp.curvature(body, -h)) / 2e-4 for h in 1e-4 * np.eye(2)]
    columns = sp.mechanical_connection(body, np.zeros(2)).T
    carried = np.stack(slopes) - np.cross(columns[:, None, None], field)
    angles = np.linspace(0.0, np.pi, 181)
    v = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    w = np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    for each in sp.reachable(body).loops[1:]:
        turned = 0.25 * np.pi * np.abs(np.einsum("pk,pi,pj,kija,a->p", v, v, w, carried, each.axis))
        assert abs(turned.max() - each.turn) < 2e-4 * each.turn


def test_pairs_say_what_a_small_square_of_two_joints_turns_the_body_by():
    body = sp.load_body("cat_two_halves")
    for pair in sp.reachable(body, [0.3, 0.2, -0.4]).pairs:
        i, j = (body.joint_index(name) for name in pair.joints)
        side = 1e-3
        corners = np.zeros((5, 3))
        corners[1:3, i] = corners[2:4, j] = side
        corners += np.array([0.3, 0.2, -0.4]) - 0.5 * side * (np.eye(3)[i] + np.eye(3)[j])
        legs = [sp.ShapePath.waypoints([0.0, 1.0], ends) for ends in pairwise(corners)]
        square = legs[0].then(legs[1]).then(legs[2]).then(legs[3])
        turn = sp.so3.log(sp.holonomy(body, square, 1e-13)) / side**2
        np.testing.assert_allclose(turn, pair.rate * pair.axis, rtol=0, atol=5e-3)
        assert pair.degrees == np.degrees(pair.rate)


def test_wrong_arguments_are_refused():
    body = sp.load_body("diver")
    for ask, error in (
        (lambda: sp.reachable(3.0), WrongObjectError),
        (lambda: sp.reachable(body, [0.0]), ShapeError),
        (lambda: sp.reachable(body, most_orders=1), ShapeError),
        (lambda: sp.reachable(body, most_orders=7), ShapeError),
        (lambda: sp.reachable(body, tolerance=0.0), ShapeError),
        (lambda: sp.reachable(body).loops[0].loop(0.0), sp.errors.TrajectoryError),
    ):
        with pytest.raises(error):
            ask()
