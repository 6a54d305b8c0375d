"""Optimal loops of bodies of particles: closed forms, published turns, and a transcription of another kind."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, UnknownNameError, UnreachableGoalError
from shapephase.optimal_control import (
    Goal,
    Limits,
    Search,
    conjugate_times,
    extremal,
    path_cost,
    plan_reorientation,
    shoot,
    small_loop,
    symbolic_body,
    wong_residual,
)
from support.long_runs import full_but

EPS = np.finfo(float).eps
Z = np.array([0.0, 0.0, 1.0])
BEFORE = np.array(
    [[1.0, 0.0, 0.4], [-0.8, 0.6, -0.5], [0.1, -0.9, 0.5], [-0.3, 0.5, 0.8], [0.7, 0.8, -0.6], [-0.6, -0.7, -0.7]]
)


def corners(direction):
    """Three unit masses of inertia 1 at a point of the unit sphere of shapes, whose pole is the regular triangle."""
    wide = ca.sqrt(0.5 * (1.0 + direction[0]))
    one = ca.vertcat(wide, 0.0) / np.sqrt(0.5)
    two = ca.vertcat(direction[1], direction[2]) / (2.0 * wide) / np.sqrt(2.0 / 3.0)
    return ca.vertcat((-one / 2).T, (one / 2).T, two.T)


def triangle(chart, limits=None):
    """Its shape in the plane: "equal-area" (Lambert's), or "stereographic", about the pole."""
    r = ca.SX.sym("r", 2)
    square = ca.sumsqr(r)
    if chart == "equal-area":
        direction = ca.vertcat(r * ca.sqrt(1.0 - square / 4.0), 1.0 - square / 2.0)
    else:
        direction = ca.vertcat(2.0 * r, 1.0 - square) / (1.0 + square)
    return sp.particle_body(
        np.ones(3), ca.Function("corners", [r], [corners(direction)]), ["x", "y"], units="m", limits=limits
    )


def random_parts(seed):
    """Masses, places at rest, and what parameters and sines of the first two move; even seeds are planar."""
    rng, flat = np.random.default_rng(seed), seed % 2 == 0
    sizes = np.array([0.3, 0.3, 0.2, 0.2] if flat else [0.3, 0.3, 0.3, 0.2, 0.2])
    parts = np.concatenate([[BEFORE], rng.normal(size=(len(sizes), 6, 3)) * sizes[:, None, None]])
    return rng.uniform(0.5, 2.0, 6), parts * ([1.0, 1.0, 0.0] if flat else [1.0, 1.0, 1.0])


def random_places(r, parts):
    factors = [1.0, *ca.vertsplit(r), ca.sin(2.0 * r[1]), ca.sin(2.0 * r[0] + 1.0)]
    return sum(factor * ca.DM(part) for factor, part in zip(factors, parts, strict=True))


def random_body(seed):
    masses, parts = random_parts(seed)
    r = ca.SX.sym("r", len(parts) - 3)
    return sp.particle_body(masses, ca.Function("places", [r], [random_places(r, parts)]), list("abc")[: r.shape[0]])


class Sines:
    """The places of `random_body` as a function of Python, with their derivatives."""

    def __init__(self, seed):
        self.masses, self.parts = random_parts(seed)

    def __call__(self, shapes):
        a, b = shapes.T
        one, none = np.ones_like(a), np.zeros_like(a)
        rows = [
            [one, a, b, np.sin(2.0 * b), np.sin(2.0 * a + 1.0)],
            [none, one, none, none, 2.0 * np.cos(2.0 * a + 1.0)],
            [none, none, one, 2.0 * np.cos(2.0 * b), none],
        ]
        places, *slopes = (np.einsum("fn,fmk->nmk", np.array(factors), self.parts) for factors in rows)
        return places, np.stack(slopes, axis=1)


# --- the sphere of triangles: a charge in the field of a monopole ------------------------------------------


def circle(angle, size=1.0):
    """Circle through the pole, in the stereographic chart, whose solid angle is twice an angle."""
    radius = 0.5 * size * np.tan(np.arccos(1.0 - angle / np.pi))
    return sp.ShapePath.fourier([radius, 0.0], [[-radius], [0.0]], [[0.0], [radius]], 1.0)


@pytest.mark.parametrize("starts", full_but([0, 1], 0))
def test_the_cheapest_turn_of_three_bodies_costs_what_a_circle_on_their_sphere_does(starts):
    """theory of reorientation: theta (2 pi - theta) / (2 T) for unit inertia; its slope is the charge pi - theta."""
    angle, body = 0.6, triangle("stereographic")
    search = Search(pieces=40, starts=starts, guess=None if starts else circle(angle, 0.8))
    plan = plan_reorientation(body, so3.exp(angle * Z), rates_at_ends="free", search=search)
    np.testing.assert_allclose(plan.cost, 0.5 * angle * (2.0 * np.pi - angle), rtol=1e-8)
    fit = wong_residual(body, plan.path)
    np.testing.assert_allclose(fit.charge, (np.pi - angle) * Z, rtol=0, atol=1e-3)
    assert fit.residual < 1e-3
    near = plan.path.shape(np.linspace(0.0, 1.0, 41))
    directions = np.concatenate([2.0 * near, 1.0 - np.sum(near**2, axis=1, keepdims=True)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    # A circle lies in a plane.
    assert np.linalg.svd(directions - directions.mean(axis=0), compute_uv=False)[2] < 1e-5


def test_its_extremal_closes_at_a_conjugate_time():
    """The circle may be turned about its first point, so that neighbours meet where it closes."""
    exact = shoot(triangle("stereographic"), circle(0.6, 0.95), so3.exp(0.6 * Z))
    np.testing.assert_allclose(exact.cost, 0.3 * (2.0 * np.pi - 0.6), rtol=2e-9)
    np.testing.assert_allclose(exact.charge, (np.pi - 0.6) * Z, rtol=0, atol=1e-8)
    (meeting,) = conjugate_times(exact)
    assert (round(meeting.time, 7), meeting.multiplicity) == (1.0, 1)


def test_a_charge_in_a_constant_field_goes_round_in_circles():
    """Dido's problem: in an equal-area chart with the metric of the plane a turn theta costs 4 pi theta / T."""
    body, angle = triangle("equal-area"), 0.5
    for metric in ("rate", np.eye(2)):
        loop = small_loop(body, [0.2, -0.1], metric=metric)
        np.testing.assert_allclose([loop.turn_about_axis, loop.cost(angle)], [0.5, 4.0 * np.pi * angle], rtol=1e-12)
        exact = shoot(body, loop.path(angle), so3.exp(angle * Z), metric=metric)
        np.testing.assert_allclose(exact.cost, 4.0 * np.pi * angle, rtol=1e-9)
        around = exact.shape(np.linspace(0.0, 1.0, 32, endpoint=False))
        radii = np.linalg.norm(around - around.mean(axis=0), axis=1)
        np.testing.assert_allclose(radii, np.sqrt(2.0 * angle / np.pi), rtol=1e-9)
    search, start = Search(pieces=24, starts=0, guess=loop.path(0.8 * angle)), loop.path(0.8 * angle).shape(0.0)
    plan = plan_reorientation(
        body, so3.exp(angle * Z), cost=np.eye(2), start=start, rates_at_ends="free", search=search
    )
    np.testing.assert_allclose(plan.cost, 4.0 * np.pi * angle, rtol=1e-6)
    assert (plan.cost_name, plan.cost_unit, len(plan.starts)) == ("metric", "", 1)
    np.testing.assert_allclose(path_cost(body, plan.path, np.eye(2)), plan.cost, rtol=1e-13)


def test_conjugate_times_of_a_constant_field_are_its_periods():
    """A charge l in a field 1/2 goes round in 4 pi / l, at any speed."""
    path = extremal(triangle("equal-area"), [0.0, 0.0], [0.3, 0.1], 3.0 * np.pi * Z, 1.0, metric="rate")
    (meeting,) = conjugate_times(path, until=1.5)
    np.testing.assert_allclose(meeting.time, 4.0 / 3.0, rtol=1e-8)


# --- small deformations -------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_small_loops_are_the_eigenvalue_problem_of_small_deformations(seed):
    """Shapere and Wilczek: F = 2 I^-1 sum m V_i x V_j for displacements V without momentum, g = sum m V_i . V_j."""
    rng = np.random.default_rng(seed)
    masses, rest, axis = rng.uniform(0.5, 2.0, 8), rng.normal(size=(8, 3)), so3.normalised(rng.normal(size=3))
    moved = rng.normal(size=(4, 8, 3))
    centred = [part - masses @ part / masses.sum() for part in (rest, *moved)]
    still = np.stack(centred[1:]).reshape(4, -1)
    weights = np.repeat(masses, 3)
    turns = np.stack([np.cross(np.eye(3)[k], centred[0]).ravel() for k in range(3)])
    # Displacements are made orthogonal to turns: they have no angular momentum.
    still -= (still * weights) @ turns.T @ np.linalg.inv((turns * weights) @ turns.T) @ turns
    parts = still.reshape(4, 8, 3)
    r = ca.SX.sym("r", 4)
    places = ca.DM(centred[0]) + sum(r[k] * ca.DM(parts[k]) for k in range(4))
    body = sp.particle_body(masses, ca.Function("places", [r], [places]), list("abcd"))
    crossed = np.cross(parts[:, None], parts[None])
    momentum = 2.0 * np.einsum("m,ijmk->ijk", masses, crossed)
    inverse = np.linalg.inv((turns * weights) @ turns.T)
    form = momentum @ inverse @ axis
    values = eigh(1j * form, (still * weights) @ still.T, eigvals_only=True)
    loop = small_loop(body, np.zeros(4), axis)
    np.testing.assert_allclose(loop.turn_about_axis, values[-1], rtol=1e-12)
    # The turn is that of the area up to the cube of the radius: halving the radius divides the difference by eight.
    misses = []
    for size in (4e-4, 1e-4):
        turn = so3.log(sp.holonomy(body, loop.path(size), 1e-12))
        misses.append(np.linalg.norm(turn - np.pi * loop.radius(size) ** 2 * loop.turn))
    assert misses[1] < misses[0] / 6.0
    assert misses[0] < 0.05 * 4e-4
    np.testing.assert_allclose(path_cost(body, loop.path(1e-8)), loop.cost(1e-8), rtol=1e-3 * np.sqrt(1e-1))


def test_small_loops_are_ellipses_in_a_metric_of_unequal_axes():
    loop = small_loop(triangle("equal-area"), [0.0, 0.0], metric=np.diag([1.0, 4.0]))
    np.testing.assert_allclose(loop.turn_about_axis, 0.25, rtol=1e-13)
    lengths = np.linalg.norm(loop.path(0.1).shape(np.linspace(0.0, 1.0, 5)[:2]), axis=1)
    np.testing.assert_allclose(sorted(lengths, reverse=True)[0] / min(lengths), 2.0, rtol=1e-12)
    np.testing.assert_allclose(so3.log(sp.holonomy(triangle("equal-area"), loop.path(0.1), 1e-12)), 0.1 * Z, atol=1e-11)


# --- the pentagon -------------------------------------------------------------------------------------------


LARGEST_TURN, ITS_COST = 28.159372374545848, 28.1894387991082
"""[degrees], [J s]: the loop of zero curvature at even pace, by mpmath in 30 digits with 48 Fourier coefficients.

Published is 28.15937237: Tong and Dullin, SIAM J. Applied Dynamical Systems 11 (2012).
"""


@pytest.mark.full
def test_plans_of_the_pentagon_lead_to_its_largest_turn():
    """Turns lack a/l^2 + b/l^2.5 + ... of the largest, l the charge, and costs by dC = l dtheta.

    Half powers come from the given first shape, which is on the loop of zero curvature; the rest stays inside of it.
    """
    body, costs, charges = sp.examples.linked_pentagon(), [], []
    size = brentq(lambda size: sp.curvature(body, [size, 0.0])[0, 1, 2], 1.0, 2.5, xtol=1e-14)
    # A circle turns further than the first plan: at the largest turn no change of the path changes it.
    path = sp.ShapePath.fourier([0.0, 0.0], [[size], [0.0]], [[0.0], [-size]], 1.0)
    turns = np.radians([27.9, 28.15, 28.155, 28.158])
    for turn in turns:
        search = Search(pieces=80, starts=0, guess=path)
        plan = plan_reorientation(body, so3.exp(turn * Z), start=[size, 0.0], rates_at_ends="free", search=search)
        assert plan.goal_error < 1e-9
        path = plan.path
        costs.append(plan.cost)
        charges.append(wong_residual(body, path).charge[2])
    turns, costs, charges = turns[1:], costs[1:], np.array(charges[1:])[:, None]
    powers = np.array([2.0, 2.5, 3.0])
    ones, none = np.ones_like(charges), np.zeros_like(charges)
    rows = np.block(
        [[ones, none, -(charges**-powers)], [none, ones, -powers / (powers - 1.0) * charges ** (1 - powers)]]
    )
    weights = np.concatenate([charges**2, charges])
    found = np.linalg.lstsq(weights * rows, weights[:, 0] * np.concatenate([turns, costs]), rcond=None)[0]
    assert abs(np.degrees(found[0]) - LARGEST_TURN) < 2e-6
    assert abs(found[1] - ITS_COST) < 1e-3


# --- continuous bodies --------------------------------------------------------------------------------------


def deformed(places, deformation, parameters, mass):
    """Points of equal mass at these places of a body at rest, moved by a matrix that depends on parameters."""
    function = ca.Function("places", [parameters], [ca.DM(places) @ deformation.T])
    names = list("abc")[: parameters.shape[0]]
    return sp.particle_body(np.full(len(places), mass / len(places)), function, names, units="m")


def test_six_points_are_an_ellipsoid_that_deforms_linearly():
    """Against the second moments E = m a^2 / 5: S = F E F', I = tr S - S, J from F_k E F', M_kl = tr F_k E F_l'."""
    axes, mass, r = np.array([1.0, 0.7, 0.4]), 3.0, ca.SX.sym("r", 3)
    move = ca.vertcat(ca.horzcat(ca.exp(r[0]), r[1], r[2] ** 2), ca.horzcat(0.0, 1.0, r[0] * r[2]), ca.DM([[0, 0, 1]]))
    points = np.sqrt(0.6) * np.diag(axes)
    functions = symbolic_body(deformed(np.concatenate([points, -points]), move, r, mass))
    a, b, c = shape = np.array([0.3, -0.4, 0.5])
    now = np.array([[np.exp(a), b, c**2], [0.0, 1.0, a * c], [0.0, 0.0, 1.0]])
    slopes = np.zeros((3, 3, 3))
    slopes[0, 0, 0], slopes[0, 1, 2], slopes[1, 0, 1], slopes[2, 0, 2], slopes[2, 1, 2] = np.exp(a), c, 1.0, 2.0 * c, a
    moments = np.diag(mass * axes**2 / 5.0)
    second = now @ moments @ now.T
    inertia = np.trace(second) * np.eye(3) - second
    turning = now @ moments @ np.swapaxes(slopes, 1, 2)
    matrix = np.stack([turning[:, i, j] - turning[:, j, i] for i, j in ((1, 2), (2, 0), (0, 1))])
    still = np.einsum("kij,jl,mil->km", slopes, moments, slopes)
    np.testing.assert_allclose(functions.inertia(shape), inertia, rtol=0, atol=20 * EPS)
    np.testing.assert_allclose(functions.momentum_matrix(shape), matrix, rtol=0, atol=20 * EPS)
    metric = still - matrix.T @ np.linalg.solve(inertia, matrix)
    np.testing.assert_allclose(functions.shape_metric(shape), metric, rtol=0, atol=20 * EPS)


def test_points_of_a_quadrature_are_a_wire_that_deforms_in_modes():
    """z = exp(i s) + w exp(-2 i s) round it: the curvature is 2 / (1 + |w|^2)^2."""
    s, w = 2.0 * np.pi * np.arange(8) / 8.0, ca.SX.sym("w", 2)
    cosine, sine = ca.DM(np.cos(2.0 * s)), ca.DM(np.sin(2.0 * s))
    places = ca.horzcat(np.cos(s) + w[0] * cosine + w[1] * sine, np.sin(s) + w[1] * cosine - w[0] * sine)
    wire = sp.particle_body(
        np.full(8, 2.0 / 8.0), ca.Function("places", [w], [places]), ["real", "imaginary"], units="m"
    )
    shape = np.array([0.3, -0.6])
    square = 1.0 + shape @ shape
    np.testing.assert_allclose(sp.curvature(wire, shape)[0, 1], 2.0 / square**2 * Z, rtol=0, atol=20 * EPS)
    # The metric of the rates that leave no momentum is that of a sphere.
    np.testing.assert_allclose(small_loop(wire, [0.0, 0.0]).cost(1e-3), 2.0 * np.pi * 1e-3, rtol=1e-13)


@pytest.mark.full
def test_a_lamina_that_deforms_linearly_turns_as_cheaply_as_three_bodies():
    """z -> (z + w z*) / sqrt(1 + |w|^2) of a disc keeps its inertia m a^2 / 2: its shapes are a sphere, too."""
    mass, radius, angle, w = 3.0, 0.8, 0.6, ca.SX.sym("w", 2)
    move = ca.vertcat(ca.horzcat(1.0 + w[0], w[1]), ca.horzcat(w[1], 1.0 - w[0])) / ca.sqrt(1.0 + ca.sumsqr(w))
    points = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]) * radius / np.sqrt(2.0)
    lamina = deformed(points, move, w, mass)
    plan = plan_reorientation(lamina, so3.exp(angle * Z), rates_at_ends="free", search=Search(pieces=40))
    cost = 0.5 * mass * radius**2 * 0.5 * angle * (2.0 * np.pi - angle)
    np.testing.assert_allclose(plan.cost, cost, rtol=1e-8)


def test_places_by_a_function_of_python_give_the_same_mechanics():
    places = Sines(0)
    given = sp.particle_body(places.masses, places, ["a", "b"])
    shape = np.array([0.2, -0.3])
    for name in ("inertia", "momentum_matrix", "shape_metric"):
        found, known = (np.array(getattr(symbolic_body(body), name)(shape)) for body in (given, random_body(0)))
        np.testing.assert_allclose(found, known, rtol=0, atol=50 * EPS)


@pytest.mark.full
def test_a_plan_by_a_function_of_python_is_that_of_the_function_of_casadi():
    """Second and third derivatives are differences there; the optimum depends on the first alone."""
    places, body = Sines(0), random_body(0)
    given, path = sp.particle_body(places.masses, places, ["a", "b"]), small_loop(body, [0.0, 0.0]).path(0.15)
    options = {"start": path.shape(0.0), "rates_at_ends": "free", "search": Search(pieces=12, starts=0, guess=path)}
    costs = [plan_reorientation(one, so3.exp(0.15 * Z), **options).cost for one in (given, body)]
    np.testing.assert_allclose(*costs, rtol=1e-9)


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("goal", "options", "error", "match"),
    [
        (so3.exp(0.3 * np.array([1.0, 0.0, 0.0])), {}, UnreachableGoalError, r"about one axis alone, \[0, 0, 1\]"),
        (Goal(pointing=(Z, Z), link="arm"), {}, ShapeError, "has no links"),
        (so3.exp(0.3 * Z), {"cost": "effort"}, ShapeError, "has no motors"),
        (so3.exp(0.3 * Z), {"limits": Limits(effort_limits=1.0)}, ShapeError, "has no motors"),
        (so3.exp(0.3 * Z), {"limits": Limits(clearance=0.1)}, ShapeError, "has no solids"),
        (so3.exp(0.3 * Z), {"cost": np.diag([1.0, -1.0])}, ShapeError, "positive definite"),
        (so3.exp(0.3 * Z), {"cost": np.eye(3)}, ShapeError, r"2, 2\)"),
        (so3.exp(0.3 * Z), {"cost": ca.Function("g", [ca.SX.sym("r", 2)], [1.0])}, ShapeError, "casadi.Function"),
        (so3.exp(0.3 * Z), {"cost": "metric"}, UnknownNameError, "kinetic"),
        (so3.exp(0.3 * Z), {"start": [2.0, 0.0]}, sp.errors.TrajectoryError, "x"),
    ],
)
def test_what_particles_cannot_do_is_refused(goal, options, error, match):
    body = triangle("equal-area", {"x": (-1.0, 1.0)})
    with pytest.raises(error, match=match):
        plan_reorientation(body, goal, **options)


def test_loops_that_do_not_turn_are_refused():
    with pytest.raises(ShapeError, match="no small loop"):
        small_loop(triangle("equal-area"), [0.0, 0.0], [1.0, 0.0, 0.0])
    with pytest.raises(ShapeError, match="axis"):
        small_loop(triangle("equal-area"), [0.0, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(ShapeError, match="limits"):
        sp.particle_body([1, 1, 1], Sines(0), ["a", "b"], limits={"a": (1.0, -1.0)})
    with pytest.raises(UnknownNameError, match="parameter"):
        sp.particle_body([1, 1, 1], Sines(0), ["a", "b"], limits={"c": (-1.0, 1.0)})
