"""The portrait on the momentum sphere against Euler's equations, integrated and linearised, for every order of axes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shapephase.errors import ShapeError
from shapephase.rigid_body import equilibria, heteroclinics, inverse_difference, polhodes
from support.independent import cross

ORDERS = [*itertools.permutations((1.0, 2.0, 3.0)), (2.4, 0.7, 2.5), (1.0, 1.1, 9.0)]


def slope(moments, direction):
    return np.cross(direction, direction / np.asarray(moments))


def energy(moments, direction):
    return 0.5 * np.sum(direction**2 / np.asarray(moments), axis=-1)


def linearised(moments, direction):
    """The matrix of v -> v x I^-1 n + n x I^-1 v."""
    columns = [np.cross(v, direction / moments) + np.cross(direction, v / moments) for v in np.eye(3)]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("moments", ORDERS)
def test_six_equilibria_and_their_kinds_g8(moments):
    found = equilibria(moments)
    assert len(found) == 6
    assert {tuple(e.direction) for e in found} == {tuple(s * v) for v in np.eye(3) for s in (1.0, -1.0)}
    middle = np.argsort(moments)[1]
    for point in found:
        assert slope(moments, point.direction) == pytest.approx(np.zeros(3), abs=0.0)
        roots = np.linalg.eigvals(linearised(np.array(moments), point.direction))
        largest = roots[np.argmax(np.abs(roots))]
        assert point.kind == ("saddle" if np.argmax(np.abs(point.direction)) == middle else "centre")
        assert point.rate == pytest.approx(abs(largest.real if point.kind == "saddle" else largest.imag), rel=1e-12)
        assert point.rate > 0.0


@pytest.mark.parametrize(
    ("moments", "kinds"),
    [
        ((1.0, 1.0, 2.0), ["degenerate"] * 4 + ["centre"] * 2),
        ((1.0, 2.0, 2.0), ["centre"] * 2 + ["degenerate"] * 4),
        ((2.0, 1.0, 2.0), ["degenerate"] * 2 + ["centre"] * 2 + ["degenerate"] * 2),
        ((2.0, 2.0, 2.0), ["degenerate"] * 6),
    ],
)
def test_equal_moments_have_circles_of_equilibria_g8(moments, kinds):
    assert [e.kind for e in equilibria(moments)] == kinds
    assert all(e.rate == 0.0 for e in equilibria(moments) if e.kind == "degenerate")


@pytest.mark.parametrize("moments", ORDERS)
def test_four_heteroclinics_join_the_saddles_along_the_motion_g8(moments):
    curves = heteroclinics(moments, 61)
    assert curves.shape == (4, 61, 3)
    middle = int(np.argsort(moments)[1])
    assert np.linalg.norm(curves, axis=-1) == pytest.approx(np.ones((4, 61)), abs=1e-15)
    assert energy(moments, curves) == pytest.approx(np.full((4, 61), 0.5 / moments[middle]), rel=1e-14)
    # Half-circles, each in a plane through the centre.
    for curve in curves:
        assert np.linalg.svd(curve, compute_uv=False)[2] < 1e-14
        step = curve[31] - curve[29]
        assert slope(moments, curve[30]) @ step > 0.1 * np.linalg.norm(step) * np.linalg.norm(slope(moments, curve[30]))
        assert curve[0] == pytest.approx(-curve[-1], abs=1e-15)
        assert abs(curve[0, middle]) == 1.0
    # In each of the four quarters between the planes of the middle axis one; from each saddle two.
    outer = [i for i in range(3) if i != middle]
    assert {tuple(np.sign(curve[30, outer])) for curve in curves} == set(itertools.product((1.0, -1.0), repeat=2))
    assert sum(curve[0, middle] for curve in curves) == 0.0


@pytest.mark.parametrize("moments", ORDERS)
def test_a_solution_runs_along_the_heteroclinic_g8(moments):
    middle = int(np.argsort(moments)[1])
    end_time = 7.0 / next(e.rate for e in equilibria(moments) if e.kind == "saddle")
    for curve in heteroclinics(moments, 5):
        assert abs(curve[2, middle]) < 1e-15
        for end, until in ((curve[-1], end_time), (curve[0], -end_time)):
            solved = solve_ivp(
                lambda _, n: cross(n, n / np.array(moments)), (0.0, until), curve[2], "DOP853", rtol=1e-12, atol=1e-14
            )
            nearest = np.linalg.norm(solved.y.T - end, axis=-1).min()
            assert nearest < 1e-2
            normal = np.cross(curve[1], curve[2])
            assert solved.y.T @ normal == pytest.approx(np.zeros(solved.y.shape[1]), abs=1e-7)


@pytest.mark.parametrize("moments", ORDERS)
def test_polhodes_lie_on_sphere_and_ellipsoid_and_run_along_the_motion_g8(moments):
    low, middle, high = 0.5 / np.sort(moments)[::-1]
    levels = np.array(
        [low + 1e-9, 0.5 * (low + middle), middle * (1 - 1e-9), middle * (1 + 1e-9), 0.5 * (middle + high)]
    )
    curves = polhodes(moments, levels, 73)
    assert curves.shape == (5, 2, 73, 3)
    assert np.linalg.norm(curves, axis=-1) == pytest.approx(np.ones((5, 2, 73)), abs=1e-14)
    assert energy(moments, curves) == pytest.approx(np.broadcast_to(levels[:, None, None], (5, 2, 73)), rel=1e-14)
    assert curves[:, :, 0] == pytest.approx(curves[:, :, -1], abs=1e-14)
    order = np.argsort(moments)
    for level, pair in zip(levels, curves):
        circled = order[2] if level < middle else order[0]
        assert np.all(pair[0, :, circled] > 0.0)
        assert pair[1, :, circled] == pytest.approx(-pair[0, :, circled], abs=0.0)
        for curve in pair:
            inside, step = curve[1:-1], curve[2:] - curve[:-2]
            motion = slope(moments, inside)
            along = np.sum(step * motion, axis=-1) / np.linalg.norm(step, axis=-1) / np.linalg.norm(motion, axis=-1)
            assert along.min() > 0.5


def test_polhodes_at_the_ends_are_points_and_at_the_middle_the_separatrices_g8():
    moments = (2.0, 1.0, 4.0)
    ends = polhodes(moments, [0.125, 0.5], 9)
    assert ends[0, 0] == pytest.approx(np.tile([0.0, 0.0, 1.0], (9, 1)), abs=1e-15)
    assert ends[1, 1] == pytest.approx(np.tile([0.0, -1.0, 0.0], (9, 1)), abs=1e-15)
    both = polhodes(moments, 0.25, 61)[0].reshape(-1, 3)
    separatrices = heteroclinics(moments, 3601).reshape(-1, 3)
    for point in both:
        assert np.linalg.norm(separatrices - point, axis=-1).min() < 1e-3
    for axis in (0, 1, 2):
        assert {1.0, -1.0} == {float(np.sign(x)) for x in both[:, axis] if abs(x) > 0.1}


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.0), (2.0, 2.0, 1.0), (1.0, 3.0, 1.0), (3.0, 1.0, 3.0)])
def test_polhodes_of_an_axisymmetric_body_are_circles_of_latitude_g8(moments):
    axis = next(i for i in range(3) if moments.count(moments[i]) == 1)
    levels = np.linspace(0.5 / max(moments), 0.5 / min(moments), 7)
    curves = polhodes(moments, levels, 37)
    assert energy(moments, curves) == pytest.approx(np.broadcast_to(levels[:, None, None], (7, 2, 37)), rel=1e-14)
    assert np.ptp(curves[..., axis], axis=-1) == pytest.approx(np.zeros((7, 2)), abs=1e-15)
    with pytest.raises(ShapeError, match="different"):
        heteroclinics(moments)


def test_energies_outside_by_rounding_are_points_g8():
    moments = (0.7, 1.1, 1.3)
    ends = [0.5 / 1.3 * (1.0 - 1e-13), 0.5 / 0.7 * (1.0 + 1e-13)]
    curves = polhodes(moments, ends, 9)
    assert curves[0, 0] == pytest.approx(np.tile([0.0, 0.0, 1.0], (9, 1)), abs=1e-15)
    assert curves[1, 0] == pytest.approx(np.tile([1.0, 0.0, 0.0], (9, 1)), abs=1e-15)


def test_inverse_difference_keeps_its_digits():
    moments = np.array([1.0, 1.0 + 2.0**-50, 4.0])
    assert inverse_difference(moments, 0, 1) == pytest.approx(2.0**-50 / (1.0 + 2.0**-50), rel=1e-15, abs=0.0)
    assert inverse_difference(moments, 2, 0) == -0.75


def test_what_cannot_be_is_refused():
    with pytest.raises(ShapeError, match="rest"):
        polhodes((2.0, 2.0, 2.0), 0.25)
    with pytest.raises(ShapeError, match="energies"):
        polhodes((1.0, 2.0, 4.0), [0.3, 0.6])
    with pytest.raises(ShapeError, match="energies"):
        polhodes((1.0, 2.0, 4.0), [[0.3]])
    for function in (equilibria, heteroclinics, lambda m: polhodes(m, 0.3)):
        with pytest.raises(ShapeError, match="positive"):
            function((1.0, -2.0, 4.0))
        with pytest.raises(ShapeError, match="shape"):
            function((1.0, 2.0))
