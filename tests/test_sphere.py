"""Areas on the sphere against spherical trigonometry of 50 digits, caps, and parallel transport."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from shapephase import sphere

X, Y, Z = np.eye(3)


def unit(vector):
    return np.asarray(vector, dtype=float) / np.linalg.norm(vector, axis=-1, keepdims=True)


def mp_excess(corners):
    """Signed area of a spherical triangle: the sum of its angles minus pi, 50 digits."""
    with mpmath.workdps(50):
        points = []
        for corner in corners:
            p = [mpmath.mpf(float(c)) for c in corner]
            length = mpmath.sqrt(sum(c * c for c in p))
            points.append([c / length for c in p])

        def dot(u, v):
            return sum(a * b for a, b in zip(u, v, strict=True))

        def cross(u, v):
            return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]

        total = -mpmath.pi
        for i in range(3):
            a, b, c = points[i], points[(i + 1) % 3], points[(i + 2) % 3]
            n, m = cross(a, b), cross(a, c)
            total += mpmath.atan2(mpmath.sqrt(dot(cross(n, m), cross(n, m))), dot(n, m))
        return float(total * mpmath.sign(dot(points[0], cross(points[1], points[2]))))


def loop_area(reference, curve, speed, turn=2.0 * np.pi):
    """The integral of the area form along a smooth periodic curve, by the trapezoid rule."""
    t = np.linspace(0.0, turn, 4000, endpoint=False)
    return sphere.area_rate(reference, curve(t), speed(t)).mean() * turn


def cap(colatitude, turns=1):
    s, c = np.sin(colatitude), np.cos(colatitude)
    return (
        lambda t: np.stack([s * np.cos(turns * t), s * np.sin(turns * t), c + 0.0 * t], axis=-1),
        lambda t: turns * np.stack([-s * np.sin(turns * t), s * np.cos(turns * t), 0.0 * t], axis=-1),
    )


def test_an_octant_is_an_eighth_of_the_sphere_counterclockwise_from_outside():
    assert sphere.triangle_area(X, Y, Z) == pytest.approx(np.pi / 2, abs=1e-15)
    assert sphere.triangle_area(X, Z, Y) == pytest.approx(-np.pi / 2, abs=1e-15)


def test_triangles_against_the_excess_of_50_digits(rng):
    for corners in unit(rng.normal(size=(60, 3, 3))):
        assert sphere.triangle_area(*corners) == pytest.approx(mp_excess(corners), abs=4e-15)


@pytest.mark.parametrize("size", [1e-2, 1e-4, 1e-7])
def test_small_triangles_keep_their_relative_accuracy(size, rng):
    corners = unit(X + size * rng.normal(size=(20, 3, 3)))
    for three in corners:
        exact = mp_excess(three)
        flat = abs(np.dot(X, np.cross(three[1] - three[0], three[2] - three[0]))) / 2
        assert abs(exact) == pytest.approx(flat, rel=10 * size)
        # The corners themselves are rounded, so an area is known to size times rounding.
        assert sphere.triangle_area(*three) == pytest.approx(exact, abs=1e-15 * size + 1e-31)


def test_triangle_area_is_cyclic_odd_and_additive(rng):
    a, b, c, d = unit(rng.normal(size=(4, 30, 3)) + 2.0 * X)
    whole = sphere.triangle_area(a, b, c)
    np.testing.assert_allclose(sphere.triangle_area(b, c, a), whole, atol=1e-15)
    np.testing.assert_allclose(sphere.triangle_area(a, c, b), -whole, atol=1e-15)
    parts = sphere.triangle_area(d, a, b) + sphere.triangle_area(d, b, c) + sphere.triangle_area(d, c, a)
    np.testing.assert_allclose(parts, whole, atol=2e-15)


def test_degenerate_triangles_have_no_area():
    a, b = unit([1.0, 2.0, -0.5]), unit([0.3, 0.1, 1.0])
    for three in ((a, a, b), (a, b, b), (b, a, b), (a, a, a)):
        assert sphere.triangle_area(*three) == pytest.approx(0.0, abs=1e-15)


def test_triangle_area_is_the_integral_of_the_area_form_along_the_great_circle(rng):
    for reference, start, end in unit(rng.normal(size=(8, 3, 3))):
        across = unit(end - (start @ end) * start)

        def rate(s, reference=reference, start=start, across=across):
            u, du = np.cos(s) * start + np.sin(s) * across, -np.sin(s) * start + np.cos(s) * across
            return sphere.area_rate(reference, u, du)

        integral, _ = quad(rate, 0.0, np.arccos(start @ end), epsabs=1e-13, epsrel=1e-13, limit=200)
        assert sphere.triangle_area(reference, start, end) == pytest.approx(integral, abs=1e-11)


@pytest.mark.parametrize("colatitude", [0.01, 0.7, np.pi / 2, 2.5])
def test_a_cap_has_its_textbook_area(colatitude):
    area = loop_area(Z, *cap(colatitude))
    assert area == pytest.approx(2.0 * np.pi * (1.0 - np.cos(colatitude)), abs=1e-12)
    assert loop_area(Z, *cap(colatitude, turns=-1)) == pytest.approx(-area, abs=1e-12)
    assert loop_area(Z, *cap(colatitude, turns=3)) == pytest.approx(3.0 * area, abs=1e-12)


def test_another_reference_changes_the_area_by_whole_spheres_only(rng):
    for colatitude, turns in ((0.4, 1), (1.2, 1), (2.0, 1), (1.3, 2)):
        curve, speed = cap(colatitude, turns)
        truth = turns * 2.0 * np.pi * (1.0 - np.cos(colatitude))
        for reference in unit(rng.normal(size=(20, 3))):
            if np.min(1.0 + curve(np.linspace(0, 7, 200)) @ reference) < 0.05:
                continue
            spheres = (loop_area(reference, curve, speed) - truth) / (4.0 * np.pi)
            assert spheres == pytest.approx(round(spheres), abs=1e-12)


def test_a_figure_of_eight_has_no_area():
    def curve(t):
        return unit(np.stack([1.0 + 0.0 * t, 0.5 * np.sin(t), 0.3 * np.sin(2 * t)], axis=-1))

    def speed(t, h=1e-3):
        return (curve(t - 2 * h) - 8 * curve(t - h) + 8 * curve(t + h) - curve(t + 2 * h)) / (12 * h)

    assert loop_area(unit([1.0, 0.2, 0.1]), curve, speed) == pytest.approx(0.0, abs=1e-11)


def test_the_area_is_the_turn_of_parallel_transport():
    """A tangent vector carried round a loop turns by the area it encloses, about the outward normal."""

    def curve(t):
        return unit(np.stack([np.cos(t), np.sin(t) + 0.2 * np.cos(3 * t), 0.4 + 0.5 * np.sin(2 * t)], axis=-1))

    def speed(t, h=1e-3):
        return (curve(t - 2 * h) - 8 * curve(t - h) + 8 * curve(t + h) - curve(t + 2 * h)) / (12 * h)

    count = 20000
    points = curve(np.linspace(0.0, 2.0 * np.pi, count + 1))
    carried = start = unit(np.cross(points[0], Z))
    for here, there in itertools.pairwise(points):  # the shortest rotation of each small step
        normal = here + there
        carried = carried - (there @ carried) / (1.0 + here @ there) * normal
    turn = np.arctan2(points[0] @ np.cross(start, carried), start @ carried)
    area = loop_area(sphere.far_reference(points), curve, speed)
    assert np.angle(np.exp(1j * (area - turn))) == pytest.approx(0.0, abs=1e-6)
    assert abs(np.angle(np.exp(1j * (area + turn)))) > 0.1


def test_far_reference_keeps_its_antipode_away_from_the_curve(rng):
    axis = unit(rng.normal(size=3))
    cluster = unit(axis + 0.2 * rng.normal(size=(100, 3)))
    reference = sphere.far_reference(cluster)
    assert np.linalg.norm(reference) == pytest.approx(1.0, abs=1e-15)
    candidates = sphere.fibonacci_directions(642)
    distance = np.arccos(np.clip(-candidates @ cluster.T, -1, 1)).min(axis=1)
    own = np.arccos(np.clip(-cluster @ reference, -1, 1)).min()
    assert own == pytest.approx(distance.max(), abs=1e-12)
    assert own > 2.0


def test_fibonacci_directions_are_even():
    points = sphere.fibonacci_directions(642)
    assert points.shape == (642, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=-1), 1.0, atol=1e-15)
    np.testing.assert_allclose(points.T @ points / 642, np.eye(3) / 3, atol=2e-3)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=2e-3)
    nearest = np.sort(points @ points.T, axis=1)[:, -2]
    assert np.degrees(np.arccos(nearest)).min() > 5.0
