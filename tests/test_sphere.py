"""Areas on the sphere against spherical trigonometry of 50 digits, caps, and parallel transport."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from shapephase import so3, sphere
from shapephase.errors import AccuracyNotReached
from support.independent import apart, geodesic_turn, random_rotation, turn
from support.long_runs import full_but

X, Y, Z = np.eye(3)
EPS = float(np.finfo(float).eps)
TURN = 2.0 * np.pi


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


def circle(colatitude, winding):
    """A latitude circle with its rate over [0, 2 pi]."""
    curve, speed = cap(colatitude, winding)
    return lambda t: (curve(t), speed(t))


def test_an_octant_is_an_eighth_of_the_sphere_counterclockwise_from_outside():
    assert sphere.triangle_area(X, Y, Z) == pytest.approx(np.pi / 2, abs=1e-15)
    assert sphere.triangle_area(X, Z, Y) == pytest.approx(-np.pi / 2, abs=1e-15)


def test_triangles_against_the_excess_of_50_digits(rng):
    for corners in unit(rng.normal(size=(60, 3, 3))):
        # Twice the angle of a point in the plane whose coordinates are known to a few units of rounding, here eight.
        a, b, c = corners
        distance = np.hypot(np.linalg.det(corners), 1.0 + a @ b + b @ c + c @ a)
        rounding = EPS * (2.0 * 8.0 / distance + 2.0 * np.pi)
        assert sphere.triangle_area(*corners) == pytest.approx(mp_excess(corners), abs=rounding)


@pytest.mark.parametrize("size", [1e-2, 1e-4, 1e-7])
def test_small_triangles_keep_their_relative_accuracy(size, rng):
    corners = unit(X + size * rng.normal(size=(20, 3, 3)))
    for three in corners:
        exact = mp_excess(three)
        flat = abs(np.dot(X, np.cross(three[1] - three[0], three[2] - three[0]))) / 2
        assert abs(exact) == pytest.approx(flat, rel=10 * size)
        # The corners themselves are rounded, so an area is known to size times rounding.
        assert sphere.triangle_area(*three) == pytest.approx(exact, abs=1e-15 * size + 1e-31)


@pytest.mark.parametrize("colatitude", [0.01, 0.7, np.pi / 2, 2.5])
def test_a_cap_has_its_textbook_area(colatitude):
    area = loop_area(Z, *cap(colatitude))
    assert area == pytest.approx(2.0 * np.pi * (1.0 - np.cos(colatitude)), abs=1e-12)
    assert loop_area(Z, *cap(colatitude, turns=-1)) == pytest.approx(-area, abs=1e-12)
    assert loop_area(Z, *cap(colatitude, turns=3)) == pytest.approx(3.0 * area, abs=1e-12)


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
    np.testing.assert_allclose(np.linalg.norm(points, axis=-1), 1.0, atol=1e-15, rtol=0)
    np.testing.assert_allclose(points.T @ points / 642, np.eye(3) / 3, atol=2e-3, rtol=0)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=2e-3, rtol=0)
    nearest = np.sort(points @ points.T, axis=1)[:, -2]
    assert np.degrees(np.arccos(nearest)).min() > 5.0


# ---- Curves ---------------------------------------------------------------------------------------------------------
#
# A curve given by a colatitude and a longitude that may both run through all numbers, seen from turned axes. The form
# (1 - cos(colatitude)) d(longitude) is the area form on that whole plane, poles included, so its integral is the area
# of any loop there, modulo 4 pi; each time the colatitude goes once round, half a sphere comes on top.


def waves(rng, harmonics, size):
    """A random periodic function with its slope."""
    k = np.arange(1, harmonics + 1)
    a, b = size * rng.normal(size=(2, harmonics)) / k

    def at(t):
        phase = np.multiply.outer(t, k)
        return np.cos(phase) @ a + np.sin(phase) @ b, -np.sin(phase) @ (k * a) + np.cos(phase) @ (k * b)

    return at


class Angles:
    """u(t) = turned (sin a cos b, sin a sin b, cos a), a = colatitude + over t + waves, b = around t + waves."""

    def __init__(self, rng, colatitude, *, around=0, over=0, wave=(3, 0.0), other=None):
        self.colatitude, self.around, self.over = colatitude, around, over
        self.first, self.second = waves(rng, *wave), waves(rng, *(other or wave))
        self.turned = random_rotation(int(rng.integers(2**31)))

    def __call__(self, t):
        (a, da), (b, db) = self.angles(t)
        sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
        u = np.stack([sa * cb, sa * sb, ca], axis=-1)
        v = np.stack([da * ca * cb - db * sa * sb, da * ca * sb + db * sa * cb, -da * sa], axis=-1)
        return u @ self.turned.T, v @ self.turned.T

    def angles(self, t):
        (a, da), (b, db) = self.first(t), self.second(t)
        return (self.colatitude + self.over * t + a, self.over + da), (self.around * t + b, self.around + db)

    @property
    def area(self):
        t = np.linspace(0.0, TURN, 1024, endpoint=False)
        (a, _), (_, db) = self.angles(t)
        return TURN * np.mean((1.0 - np.cos(a)) * db) + TURN * self.over


def random_curves():
    """A hundred closed curves over [0, 2 pi], with names."""
    rng = np.random.default_rng(40)
    for _ in range(25):
        yield "wandering", Angles(rng, rng.uniform(0.3, 2.8), wave=(int(rng.integers(2, 7)), rng.uniform(0.2, 0.8)))
    for winding in (3, -3, 3, 3, 3, -3, 3, 3, 3, 3, 2, 5, 1, 1, 1):
        yield "winding", Angles(rng, rng.uniform(0.4, 2.7), around=winding, wave=(3, 0.12))
    for _ in range(15):
        yield "self-intersecting", Angles(rng, np.pi / 2, around=int(rng.integers(0, 2)), wave=(5, 0.7))
    for over in (1, 1, -1, 1, 2, 1, 3, 0, 0, 0, 0, 0, 0, 0, 0):
        # The colatitude runs, or swings, through 0 and pi: through both poles exactly.
        yield "both poles", Angles(rng, 1.0, around=int(rng.integers(0, 4)), over=over, wave=(2, 0.5 if over else 2.5))
    for _ in range(10):
        yield "large", Angles(rng, rng.uniform(2.2, 3.1), around=1, wave=(2, 0.05))
    for size in (1e-1, 1e-2, 1e-3, 1e-5, 1e-7):
        yield "tiny", Angles(rng, 1.0, wave=(3, size))
        yield "tiny about the pole", Angles(rng, size, around=1, wave=(3, 0.2 * size), other=(3, 0.2))
    for _ in range(10):
        yield "figure of eight", Eight(rng)


class Eight(Angles):
    """The second angle swings twice as fast as the first: two lobes of opposite area, one a little larger."""

    def __init__(self, rng):
        super().__init__(rng, rng.uniform(1.0, 2.0))
        self.sizes = rng.uniform(0.3, 0.9, 2)

    def angles(self, t):
        p, q = self.sizes
        return (self.colatitude + p * np.sin(2 * t), 2 * p * np.cos(2 * t)), (q * np.sin(t), q * np.cos(t))


CURVES = list(random_curves())
EDGES = np.linspace(0.0, TURN, 33)


def far_from(points):
    """A direction whose opposite is away from a curve: the best of a thousand random ones."""
    tries = unit(np.random.default_rng(7).normal(size=(1000, 3)))
    return tries[np.argmax(np.min(points @ tries.T, axis=0))]


def wrapped_area(area):
    """Modulo 4 pi, nearest to zero."""
    return 2.0 * np.angle(np.exp(0.5j * np.asarray(area)))


@pytest.mark.parametrize("number", full_but(range(100), *range(25)))
def test_solid_angle_by_formula_transport_and_polygon(number):
    """Three ways, and a fourth, agree on random curves."""
    kind, curve = CURVES[number]
    t = np.linspace(0.0, TURN, 4096, endpoint=False)
    u, v = curve(t)
    n = far_from(u)
    assert np.min(u @ n) > -1.0 + 1e-3
    formula = TURN * np.mean(np.cross(u, v) @ n / (1.0 + u @ n))
    size = min(1.0, float(np.abs(v).max()))
    scale = max(1.0, float(np.mean(np.abs(np.cross(u, v) @ n / (1.0 + u @ n)))))
    assert abs(wrapped_area(formula - curve.area)) < 1e-13 * scale, kind
    area = sphere.curve_area(curve, EDGES)
    assert abs(wrapped_area(area - formula)) < 1e-12 * size + 1e-15, kind
    carried = sphere.transport(curve, EDGES)
    np.testing.assert_allclose(carried.T @ carried, np.eye(3), rtol=0, atol=1e-13)
    np.testing.assert_allclose(carried @ u[0], u[0], rtol=0, atol=1e-11)
    assert apart(carried, turn(u[0], float(area))) < 1e-10
    # The polygon's error falls as the square of its sides, and what is left of it by Richardson's table vanishes.
    counts = 512 * 2 ** np.arange(4)
    polygons = np.array([sphere.polygon_area(curve(np.linspace(0.0, TURN, m, endpoint=False))[0]) for m in counts])
    errors = wrapped_area(polygons - formula)
    assert abs(errors[-1]) < 1e-2
    if abs(errors[-1]) > 1e-9:
        np.testing.assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.02)
    row = formula + errors
    for order in range(1, 4):
        row = (4**order * row[1:] - row[:-1]) / (4**order - 1)
    assert abs(row[0] - formula) < 1e-9


@pytest.mark.parametrize("number", range(0, 100, 7))
def test_curve_area_needs_no_good_edges(number):
    """One step, three uneven ones, a thousand: the same area; a shift of the start or a reversal, too."""
    _, curve = CURVES[number]
    truth = curve.area
    for edges in (EDGES[[0, -1]], np.array([0.0, 0.1, 5.0, TURN]), EDGES[::8], np.linspace(0.0, TURN, 1000)):
        assert abs(wrapped_area(sphere.curve_area(curve, edges) - truth)) < 1e-12 * max(1.0, abs(truth))
    start = curve(np.zeros(1))[0][0]
    for edges in (EDGES[::4], np.linspace(0.0, TURN, 1000)):
        assert apart(sphere.transport(curve, edges), turn(start, truth)) < 1e-10
    shifted = sphere.curve_area(curve, EDGES + 1.234)
    assert abs(wrapped_area(shifted - truth)) < 1e-12 * max(1.0, abs(truth))

    def backwards(t):
        u, v = curve(TURN - t)
        return u, -v

    assert abs(wrapped_area(sphere.curve_area(backwards, EDGES) + truth)) < 1e-12 * max(1.0, abs(truth))


@pytest.mark.parametrize("colatitude", [0.01, 0.7, np.pi / 2, 2.2, 2.9, 3.13])
@pytest.mark.parametrize("winding", [1, -1, 2, 3, -3, 8, 50])
def test_latitude_circles(colatitude, winding):
    curve = circle(colatitude, winding)
    truth = TURN * winding * (1.0 - np.cos(colatitude))
    assert apart(sphere.transport(curve, EDGES), turn(curve(np.zeros(1))[0][0], truth)) < 1e-10
    for edges in (EDGES, EDGES[[0, -1]]):
        area = sphere.curve_area(curve, edges)
        assert abs(wrapped_area(area - truth)) < 1e-12
        # Counted from the pole that is farther away.
        other = -TURN * winding * (1.0 + np.cos(colatitude))
        if abs(colatitude - np.pi / 2) > 0.1:
            assert area == pytest.approx(truth if colatitude < np.pi / 2 else other, abs=1e-12)


def test_three_turns_at_colatitude_2_9():
    """The example of numerics.md section 3: 37.15 = -0.547 modulo 2 pi, and the area found is 37.15 - 12 pi."""
    area = sphere.curve_area(circle(2.9, 3), EDGES)
    assert area == pytest.approx(37.15 - 12.0 * np.pi, abs=5e-3)
    assert area == pytest.approx(-6.0 * np.pi * (1.0 + np.cos(2.9)), abs=1e-13)
    assert sphere.wrapped(np.array(6.0 * np.pi * (1.0 - np.cos(2.9)))) == pytest.approx(area, abs=1e-13)


def test_great_circles_hold_half_the_sphere(rng):
    for _ in range(10):
        a, b = np.linalg.qr(rng.normal(size=(3, 2)))[0].T

        def curve(t, a=a, b=b):
            c, s = np.cos(t)[:, None], np.sin(t)[:, None]
            return c * a + s * b, c * b - s * a

        for edges in (EDGES, EDGES[[0, -1]], EDGES[[0, 16, -1]]):
            assert abs(sphere.curve_area(curve, edges)) == pytest.approx(TURN, abs=1e-12)
            assert apart(sphere.transport(curve, edges), np.eye(3)) < 1e-12


def kinked(kink):
    """Along a parallel, and from a time on along a meridian; the area between, closed by a great circle."""

    def curve(t):
        early, late = np.minimum(t, kink), np.maximum(t - kink, 0.0)
        a, b, turned = 1.0 + 2.0 * late, early, t > kink
        da, db = np.where(turned, 2.0, 0.0), np.where(turned, 0.0, 1.0)
        sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
        u = np.stack([sa * cb, sa * sb, ca], axis=-1)
        return u, np.stack([da * ca * cb - db * sa * sb, da * ca * sb + db * sa * cb, -da * sa], axis=-1)

    end = np.array([np.sin(3.0 - 2.0 * kink) * np.cos(kink), np.sin(3.0 - 2.0 * kink) * np.sin(kink)])
    ends = np.array([[np.sin(1.0), 0.0, np.cos(1.0)], [*end, np.cos(3.0 - 2.0 * kink)]])
    return curve, (1.0 - np.cos(1.0)) * kink + mp_excess([Z, ends[1], ends[0]])


@pytest.mark.parametrize("kink", [1.0 / np.pi, 0.5, 0.123, 0.7])
def test_a_kink_is_an_edge_or_noticed(kink):
    curve, truth = kinked(kink)
    edges = np.array([0.0, kink, 1.0])
    (first, last), _ = curve(edges[[0, -1]])
    assert sphere.curve_area(curve, edges) == pytest.approx(truth, abs=1e-13)
    back = geodesic_turn(last, first) @ sphere.transport(curve, edges)
    assert apart(back, turn(first, truth)) < 1e-11
    if kink != 0.5:
        with pytest.raises(AccuracyNotReached, match="kinks"):
            sphere.curve_area(curve, edges[[0, -1]])


def test_transport_with_steps_that_are_far_too_long_raises():
    with pytest.raises(AccuracyNotReached, match="settle"):
        sphere.transport(circle(0.7, 400), EDGES[[0, -1]])


@pytest.mark.parametrize("number", range(0, 100, 9))
def test_open_curves_are_closed_by_the_great_circle(number):
    """The area form integrated by SciPy along the curve, and back along the great circle."""
    _, curve = CURVES[number]
    end = 3.7
    ends, _ = curve(np.array([0.0, end]))
    n = far_from(
        np.concatenate(
            [curve(np.linspace(0.0, end, 500))[0], unit(ends[0] + np.linspace(0, 1, 99)[:, None] * (ends[1] - ends[0]))]
        )
    )

    def rate(t):
        u, v = curve(np.array([t]))
        return float(np.cross(u[0], v[0]) @ n / (1.0 + u[0] @ n))

    along = sum(quad(rate, a, b, epsabs=1e-13, epsrel=1e-13)[0] for a, b in itertools.pairwise(np.linspace(0, end, 9)))
    truth = along + mp_excess([n, ends[1], ends[0]])
    assert abs(wrapped_area(sphere.curve_area(curve, np.linspace(0.0, end, 17)) - truth)) < 2e-12
    # Carried along and back by the shortest turn, a tangent vector has turned by the area.
    back = geodesic_turn(ends[1], ends[0]) @ sphere.transport(curve, np.linspace(0.0, end, 17))
    assert apart(back, turn(ends[0], truth)) < 1e-10


def test_a_lune_between_opposite_ends():
    """Half a great circle at an angle to the one by which its opposite ends are joined, through `so3.middle`."""
    for start in unit(np.random.default_rng(2).normal(size=(8, 3))):
        middle = so3.middle(-start, start)
        for angle in (0.3, 1.2, 2.5, -0.8):
            through = turn(start, angle) @ middle

            def curve(t, start=start, through=through):
                c, s = np.cos(t)[:, None], np.sin(t)[:, None]
                return c * start + s * through, c * through - s * start

            # Out through `through`, back through `middle`, which lies clockwise of it about the start.
            area = sphere.curve_area(curve, np.linspace(0.0, np.pi, 9))
            assert abs(wrapped_area(area + 2.0 * angle)) < 1e-12


def test_batches_of_curves():
    several = [curve for _, curve in CURVES[::17]]
    three = np.array([0.0, 1.0, 2.0, 4.0, TURN])

    def batch(t):
        both = [curve(t) for curve in several]
        return np.array([u for u, _ in both]), np.array([v for _, v in both])

    areas, turns = sphere.curve_area(batch, three), sphere.transport(batch, three)
    assert areas.shape == (6,)
    assert turns.shape == (6, 3, 3)
    for row, curve in enumerate(several):
        assert abs(wrapped_area(areas[row] - curve.area)) < 1e-12
        assert apart(turns[row], turn(curve(np.zeros(1))[0][0], curve.area)) < 1e-10

    def folded(t):
        u, v = batch(t)
        return u.reshape(2, 3, -1, 3), v.reshape(2, 3, -1, 3)

    np.testing.assert_allclose(sphere.curve_area(folded, three), areas.reshape(2, 3), rtol=0, atol=1e-13)
    np.testing.assert_allclose(sphere.transport(folded, three), turns.reshape(2, 3, 3, 3), rtol=0, atol=1e-13)


# ---- Polygons -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sides", [3, 4, 5, 12, 100])
@pytest.mark.parametrize("radius", [1e-3, 0.4, 1.3])
def test_regular_polygons(sides, radius):
    """The excess of 2 n right triangles about the centre, by Napier's rules."""
    corners, _ = circle(radius, 1)(TURN * np.arange(sides) / sides)
    with mpmath.workdps(30):
        corner = mpmath.atan2(1, mpmath.tan(mpmath.pi / sides) * mpmath.cos(mpmath.mpf(radius)))
        truth = float(2 * sides * (corner + mpmath.pi / sides - mpmath.pi / 2))
    assert sphere.polygon_area(corners) == pytest.approx(truth, abs=2e-14)
    assert sphere.polygon_area(corners[::-1]) == pytest.approx(-truth, abs=2e-14)
    assert sphere.polygon_area(np.roll(corners, 2, axis=0)) == pytest.approx(truth, abs=2e-14)


def test_random_polygons_against_fans_of_50_digits(rng):
    """A fan of triangles from any point has the same area modulo 4 pi."""
    for count in (3, 4, 7, 12):
        corners = unit(rng.normal(size=(count, 3)))
        point = unit(rng.normal(size=3))
        closed = np.concatenate([corners, corners[:1]])
        truth = sum(mp_excess([point, a, b]) for a, b in itertools.pairwise(closed))
        assert abs(wrapped_area(sphere.polygon_area(corners) - truth)) < 1e-13


def test_degenerate_polygons():
    corners = unit([[1.0, 2.0, 0.5], [0.3, 0.1, 1.0], [-0.2, 0.8, 0.4]])
    assert sphere.polygon_area(corners[:1]) == pytest.approx(0.0, abs=1e-15)
    assert sphere.polygon_area(corners[:2]) == pytest.approx(0.0, abs=1e-15)
    assert sphere.polygon_area(corners[[0, 1, 2, 1, 0]]) == pytest.approx(0.0, abs=1e-15)
    doubled = np.repeat(corners, 3, axis=0)
    assert sphere.polygon_area(doubled) == pytest.approx(mp_excess(corners), abs=1e-15)


def test_a_polygon_whose_ends_are_opposite_goes_through_the_middle():
    between = unit([1.0, 2.0, 0.5])
    start = unit([0.2, -0.3, 1.0])
    corners = np.stack([start, between, -start])
    by_hand = np.concatenate([corners, so3.middle(-start, start)[None]])
    assert sphere.polygon_area(corners) == pytest.approx(sphere.polygon_area(by_hand), abs=1e-13)


def test_batches_of_polygons(rng):
    corners = unit(rng.normal(size=(2, 3, 5, 3)))
    areas = sphere.polygon_area(corners)
    assert areas.shape == (2, 3)
    for i, j in np.ndindex(2, 3):
        assert areas[i, j] == sphere.polygon_area(corners[i, j])
    assert np.ndim(sphere.polygon_area(corners[0, 0])) == 0


# ---- Small parts ----------------------------------------------------------------------------------------------------


def test_areas_modulo_whole_spheres():
    values = np.array([0.0, 1.0, 6.0, 7.0, -6.0, -7.0, 100.0, -100.0, 1e-300])
    found = sphere.wrapped(values)
    assert np.all((found > -TURN) & (found <= TURN))
    np.testing.assert_allclose(np.exp(0.5j * found), np.exp(0.5j * values), rtol=0, atol=1e-13)
    assert found[-1] == 1e-300
    edge = sphere.wrapped(np.array([TURN, -TURN, 2.0 * TURN, 7.0]))
    assert edge[0] == TURN
    np.testing.assert_allclose(edge[1:], [TURN, 0.0, 7.0 - 2.0 * TURN], rtol=0, atol=1e-14)


def test_gauss_nodes_integrate_polynomials_of_degree_fifteen():
    edges = np.array([-1.0, -0.4, 0.1, 0.9])
    nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
    assert nodes.shape == weights.shape == (3, 8)
    assert np.all((nodes > edges[:-1, None]) & (nodes < edges[1:, None]))
    for power in range(16):
        truth = (edges[1:] ** (power + 1) - edges[:-1] ** (power + 1)) / (power + 1)
        np.testing.assert_allclose((nodes**power * weights).sum(axis=1), truth, rtol=0, atol=1e-15)
    np.testing.assert_allclose(weights.sum(axis=1), np.diff(edges), rtol=1e-15)
