"""Curvature over shape space, flatness, Stokes and lifts against differences, closed forms and quadrature."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, where a type checker cannot look.
# pyright: reportAttributeAccessIssue=false
import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import (
    AccuracyNotReached,
    OpenPathError,
    ShapeError,
    SingularInertiaError,
    TrajectoryError,
    UnknownNameError,
)
from shapephase.shape_space import curvature_on_plane, horizontal_lift, is_flat, stokes_holonomy
from support.bodies import BODIES, joint, link, random_loop, random_shapes, urdf
from support.independent import apart, geodesic_turn, hat, turn, urdf_file
from support.long_runs import full_but

X, Y, Z = np.eye(3)
DEGREE = np.pi / 180.0
# Weights of the central difference of order eight, for -4 ... 4.
EIGHTH = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


def rotation_vector(rotation):
    return Rotation.from_matrix(rotation).as_rotvec()


def plain_lift(body, path, times):
    """R' = -R hat(A rate) on the nine entries by DOP853, restarted at the breaks: (N, 3, 3)."""

    def slope(t, r):
        rate = sp.mechanical_connection(body, path.shape(t)) @ path.rate(t)
        return -(r.reshape(3, 3) @ hat(rate)).ravel()

    r, found = np.eye(3).ravel(), np.empty((len(times), 9))
    for a, b in itertools.pairwise(path.breaks):
        run = solve_ivp(slope, (a, b), r, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
        inside = (times >= a) & (times <= b)
        if inside.any():
            found[inside] = run.sol(times[inside]).T
        r = run.y[:, -1]
    return found.reshape(-1, 3, 3)


def ellipse(body, joints, amplitude, duration=2.0, **at):
    """Once round in the plane of two joints, the others at the coordinates given by name, else neutral."""
    i, j = map(body.joint_index, joints)
    cosine, sine = np.zeros((2, body.n_shape, 1))
    cosine[i], sine[j] = amplitude
    return sp.ShapePath.fourier(body.shape(at), cosine, sine, duration)


# ---- A planar chain of three links: everything by complex numbers ---------------------------------------------------

MASSES, MOMENTS = np.array([2.0, 1.1, 0.7]), np.array([0.31, 0.12, 0.05])
CENTRES = np.array([0.05 - 0.1j, 0.35 + 0.08j, 0.3 - 0.06j])
HINGES = np.array([0.4 + 0.15j, 0.75 - 0.1j])


def chain_urdf(extra=""):
    links = [
        link(name, m, [3 * i, 2 * i, i], (c.real, c.imag, 0.0))
        for name, m, i, c in zip("abc", MASSES, MOMENTS, CENTRES, strict=True)
    ]
    first, second = ((h.real, h.imag, 0.0) for h in HINGES)
    return urdf(
        *links,
        joint("near", "revolute", "a", "b", Z, first),
        joint("far", "revolute", "b", "c", Z, second, extra=extra),
    )


def chain(q1, q2):
    """I about the normal, J_1, J_2 and F_12 = d_1 (J_2/I) - d_2 (J_1/I): numbers, by hand from masses and lengths."""
    near, far = np.exp(1j * q1), np.exp(1j * (q1 + q2))
    hinges = np.array([HINGES[0], HINGES[0] + near * HINGES[1]])
    x = np.array([CENTRES[0], HINGES[0] + near * CENTRES[1], hinges[1] + far * CENTRES[2]])
    moved = np.array([[0, 1, 1], [0, 0, 1]])
    # A turn of joint i moves what hangs on it: dx = i (x - h); twice, it is seen from the outer of the two hinges.
    dx = 1j * moved * (x - hinges[:, None])
    ddx = np.array([[-moved[max(i, j)] * (x - hinges[max(i, j)]) for j in range(2)] for i in range(2)])

    def about_centre(a, b):
        """Sum m conj(a) b with the part of the centre of mass taken off."""
        return MASSES @ (a.conj() * b) - (MASSES @ a.conj()) * (MASSES @ b) / MASSES.sum()

    inertia = MOMENTS.sum() + about_centre(x, x).real
    matrix = np.array([moved[j] @ MOMENTS + about_centre(x, dx[j]).imag for j in range(2)])
    d_inertia = np.array([2.0 * about_centre(x, dx[i]).real for i in range(2)])
    d_matrix = np.array(
        [[(about_centre(dx[i], dx[j]) + about_centre(x, ddx[i, j])).imag for j in range(2)] for i in range(2)]
    )
    slopes = d_matrix / inertia - np.outer(d_inertia, matrix) / inertia**2
    return inertia, matrix, slopes[0, 1] - slopes[1, 0]


@pytest.fixture
def planar(load_urdf):
    return load_urdf(chain_urdf())


def test_curvature_of_a_planar_chain(planar, rng):
    """About the normal it is d_1 A_2 - d_2 A_1 without a bracket, in the plane nothing."""
    for shape in rng.uniform(-3.0, 3.0, (8, 2)):
        inertia, matrix, want = chain(*shape)
        np.testing.assert_allclose(
            sp.mechanical_connection(planar, shape), np.outer(Z, matrix / inertia), atol=1e-14, rtol=0
        )
        found = sp.curvature(planar, shape)[0, 1]
        assert abs(want) > 1e-3
        np.testing.assert_allclose(found, want * Z, atol=1e-14, rtol=0)


def test_curvature_over_the_plane_of_a_planar_chain(planar):
    first, second = np.linspace(-2.0, 1.5, 5), np.linspace(-1.0, 2.8, 4)
    want = np.array([[chain(a, b)[2] * Z for b in second] for a in first])
    np.testing.assert_allclose(curvature_on_plane(planar, ("near", "far"), first, second), want, atol=1e-14, rtol=0)
    np.testing.assert_allclose(
        curvature_on_plane(planar, (1, 0), second, first), -np.swapaxes(want, 0, 1), atol=1e-14, rtol=0
    )


def test_stokes_for_a_planar_chain(planar):
    """Rotations of the plane commute: minus the integral of the curvature over the ellipse, by quadrature."""
    centre, size = np.array([0.4, -0.7]), np.array([60.0, 45.0]) * DEGREE
    nodes, weights = np.polynomial.legendre.leggauss(24)
    radii, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    angles = 2.0 * np.pi * np.arange(64) / 64
    total = sum(
        w * x * 2.0 * np.pi / 64 * chain(*(centre + x * size * [np.cos(h), np.sin(h)]))[2]
        for x, w in zip(radii, weights, strict=True)
        for h in angles
    )
    want = turn(Z, -total * size.prod())
    path = ellipse(planar, ("near", "far"), size, near=centre[0], far=centre[1])
    assert abs(total) > 0.05
    assert apart(stokes_holonomy(planar, path, 1e-12), want) < 1e-12
    assert apart(sp.holonomy(planar, path, 1e-12), want) < 1e-12
    assert apart(stokes_holonomy(planar, path.repeated(3), 1e-12), turn(Z, -3.0 * total * size.prod())) < 3e-12


# ---- Curvature ------------------------------------------------------------------------------------------------------


def test_curvature_against_differences_of_order_eight(body, rng):
    """B6: d_i A_j - d_j A_i - A_i x A_j, to rounding."""
    step = 0.02
    shape = random_shapes(body, rng, 1)[0]
    around = shape + step * np.arange(-4, 5)[:, None, None] * np.eye(body.n_shape)
    slopes = np.einsum("k,kiaj->ija", EIGHTH, sp.mechanical_connection(body, around)) / step
    columns = sp.mechanical_connection(body, shape).T
    want = slopes - np.swapaxes(slopes, 0, 1) - np.cross(columns[:, None], columns[None])
    assert np.abs(want).max() > 5e-4
    found = sp.curvature(body, shape)
    np.testing.assert_allclose(found, want, atol=3e-11, rtol=0)
    np.testing.assert_array_equal(found, -np.swapaxes(found, 0, 1))


def test_a_plane_is_told_what_is_wrong_with_it():
    cat = sp.load_body("cat_two_halves")
    with pytest.raises(UnknownNameError, match="'waist_pitch'"):
        curvature_on_plane(cat, ("waist_pich", "waist_yaw"), [0.0], [0.0])
    for twice in ((1, 1), ("waist_yaw", cat.joint_index("waist_yaw"))):
        with pytest.raises(ShapeError, match="twice"):
            curvature_on_plane(cat, twice, [0.0], [0.0])
    for joints in ("waist_yaw", (0,), (0, 1, 2)):
        with pytest.raises(ShapeError, match="joints"):
            curvature_on_plane(cat, joints, [0.0], [0.0])
    with pytest.raises(ShapeError, match="first"):
        curvature_on_plane(cat, (0, 1), 0.0, [0.0])
    with pytest.raises(ShapeError, match="nan"):
        curvature_on_plane(cat, (0, 1), [0.0], [np.nan])
    with pytest.raises(ShapeError, match="waist_pitch"):
        curvature_on_plane(cat, (0, 1), [0.0], [0.0], np.zeros(2))


@pytest.mark.parametrize("place", [3, -1, True, 1.0, None])
def test_a_place_is_one_of_the_shape_vector_s(place):
    with pytest.raises(UnknownNameError, match="waist"):
        curvature_on_plane(sp.load_body("cat_two_halves"), (0, place), [0.0], [0.0])


# ---- Stokes ---------------------------------------------------------------------------------------------------------

PLANES = [
    ("cat", "waist_pitch", "waist_yaw"),
    ("cat_two_halves", "waist_pitch", "waist_yaw"),
    ("astronaut", "left_shoulder_flexion", "left_shoulder_abduction"),
    ("example:human", "left_shoulder_Z", "left_shoulder_X"),
    ("satellite", 0, 1),
    ("satellite", "boom_extension", "wheel_spin"),
    ("example:kinova", 0, 1),
    ("diver", 0, 1),
]


@pytest.mark.parametrize(("name", "first", "second"), full_but(PLANES, *PLANES[::4]))
def test_stokes_round_sixty_degrees(name, first, second):
    """B6, B7: the curvature inside a loop of 60 degrees in two joints gives its holonomy."""
    body = sp.load_body(name)
    joints = [k if isinstance(k, str) else body.joint_names[k] for k in (first, second)]
    path = ellipse(body, joints, (60.0 * DEGREE, 60.0 * DEGREE), **dict.fromkeys(joints, 0.2))
    want = sp.holonomy(body, path, 1e-12)
    assert np.linalg.norm(rotation_vector(want)) > 5e-5
    assert apart(stokes_holonomy(body, path), want) < 1e-9
    assert apart(stokes_holonomy(body, path, 1e-12), want) < 3e-12
    small = ellipse(body, joints, (0.1, 0.15), **dict.fromkeys(joints, 0.2))
    assert apart(stokes_holonomy(body, small, 1e-13), sp.holonomy(body, small, 1e-13)) < 3e-13


@pytest.mark.parametrize("name", full_but(BODIES, "cat_two_halves", "diver"))
def test_stokes_against_a_plain_integrator(name, rng):
    """Over all joints at once; the lift along the loop by DOP853, the surface by curvature alone."""
    body = sp.load_body(name)
    path = random_loop(body, rng, amplitude=0.8)
    want = plain_lift(body, path, np.array([path.duration]))[0]
    assert np.linalg.norm(rotation_vector(want)) > 1e-3
    assert apart(stokes_holonomy(body, path, 1e-11), want) < 2e-11


@pytest.mark.parametrize("name", full_but(["cat_two_halves", "satellite"], "cat_two_halves"))
def test_stokes_for_loops_of_all_kinds(name, rng):
    body = sp.load_body(name)
    corners = random_shapes(body, rng, 4)
    corners = np.vstack([corners, corners[:1]])
    times = [0.0, 0.7, 1.0, 2.2, 3.0]
    smooth = random_loop(body, rng, harmonics=3, amplitude=1.0)
    polygon = sp.ShapePath.waypoints(times, corners)
    loops = {
        "periodic spline": sp.ShapePath.spline(times, corners),
        "two after each other": smooth.then(smooth.reversed().stretched(0.3)).then(smooth),
        "polygon backwards twice": polygon.repeated(2).reversed(),
        "black box": sp.ShapePath.function(lambda t: smooth.curve(t), smooth.duration),
        "at rest": sp.ShapePath.waypoints([0.0, 1.0], corners[[0, 0]]),
    }
    for kind, path in loops.items():
        want = sp.holonomy(body, path, 1e-12)
        assert apart(stokes_holonomy(body, path, 1e-10), want) < 1e-10, kind


@pytest.mark.full
def test_any_centre_will_do(rng):
    """Inside, outside, on the loop, at a corner: the cones differ by what has no boundary."""
    cat = sp.load_body("cat_two_halves")
    smooth = random_loop(cat, rng, amplitude=1.0)
    eight = sp.ShapePath.fourier(np.zeros(3), [[0, 0.0], [0, 0], [0, 0.2]], [[0.9, 0], [0, 0.7], [0, 0]], 1.0)
    polygon = sp.ShapePath.waypoints([0, 1, 2, 3], [[0.8, 0, 0], [-0.4, 0.7, 0.3], [-0.4, -0.7, 0], [0.8, 0, 0]])
    for path in (smooth, eight, polygon):
        want = sp.holonomy(cat, path, 1e-12)
        places = [path.shape(0.0), path.shape(0.3), np.zeros(3), [0.5, -0.4, 0.6], path.shape(0.1) + 1.5 * Z]
        for centre in places:
            assert apart(stokes_holonomy(cat, path, 1e-11, centre), want) < 1e-11
    through_its_centre = eight.shape(0.5)
    np.testing.assert_allclose(through_its_centre, eight.shape(0.0), atol=1e-15, rtol=0)
    assert np.linalg.norm(rotation_vector(sp.holonomy(cat, eight))) > 0.01


@pytest.mark.parametrize("tolerance", full_but([1e-4, 1e-8, 1e-12], 1e-4, 1e-8))
def test_stokes_keeps_its_tolerance(tolerance, rng):
    cat = sp.load_body("cat_two_halves")
    for _ in range(3):
        path = random_loop(cat, rng, harmonics=4, amplitude=1.4)
        found = stokes_holonomy(cat, path, tolerance)
        assert apart(found, sp.holonomy(cat, path, 1e-13)) < tolerance + 2e-13
        np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-14, rtol=0)


def test_rays_left_coarse_are_owned_up_to(monkeypatch):
    kinova = sp.load_body("example:kinova")
    path = ellipse(kinova, kinova.joint_names[:2], (60.0 * DEGREE, 60.0 * DEGREE))
    monkeypatch.setattr("shapephase.shape_space.curvature_field._SHARE", 10.0)
    with pytest.raises(AccuracyNotReached, match="rays"):
        stokes_holonomy(kinova, path, 1e-12)


def test_a_loop_that_closes_but_nearly():
    """To 1e-9, which is more than the tolerance: the rays to its two ends are told apart."""
    cat = sp.load_body("cat_two_halves")
    corners = np.array([[0.3, 0.1, 0.0], [-0.5, 0.6, 0.2], [-0.4, -0.6, 0.4], [0.3, 0.1, 0.0]])
    corners[-1] += [9e-10, -8e-10, 9e-10]
    path = sp.ShapePath.waypoints([0, 1, 2, 3], corners)
    want = plain_lift(cat, path, np.array([3.0]))[0]
    assert apart(stokes_holonomy(cat, path, 1e-12), want) < 1e-11


def test_going_round_often_costs_nothing_more(monkeypatch, rng):
    cat, asked = sp.load_body("cat_two_halves"), []
    path = random_loop(cat, rng)
    once = sp.holonomy(cat, path, 1e-13)
    true = sp.Body.sample_rates
    monkeypatch.setattr(sp.Body, "sample_rates", lambda *args: asked.append(len(args[1])) or true(*args))
    stokes_holonomy(cat, path, 1e-10)
    for_one = sum(asked)
    found = stokes_holonomy(cat, path.repeated(100), 1e-10)
    assert sum(asked) - for_one < 3 * for_one
    assert apart(found, np.linalg.matrix_power(once, 100)) < 1.2e-10


def test_a_loop_of_fifty_pieces(rng):
    diver = sp.load_body("diver")
    times = np.linspace(0.0, 1.0, 51)
    corners = ellipse(diver, diver.joint_names, (1.0, 0.8), 1.0).shape(times) + 0.02 * rng.normal(size=(51, 2))
    corners[-1] = corners[0]
    path = sp.ShapePath.spline(times, corners)
    assert apart(stokes_holonomy(diver, path, 1e-6), sp.holonomy(diver, path, 1e-9)) < 1e-7


def test_joints_are_matched_by_name(rng):
    cat = sp.load_body("cat_two_halves")
    order = [2, 0, 1]
    a, b = rng.uniform(-0.8, 0.8, (2, 3, 1))
    path = sp.ShapePath.fourier(np.zeros(3), a, b, 1.0)
    renamed = sp.ShapePath.fourier(
        np.zeros(3), a[order], b[order], 1.0, joint_names=[cat.joint_names[k] for k in order]
    )
    np.testing.assert_allclose(stokes_holonomy(cat, renamed), stokes_holonomy(cat, path), atol=1e-14, rtol=0)
    np.testing.assert_allclose(horizontal_lift(cat, renamed).end, horizontal_lift(cat, path).end, atol=1e-14, rtol=0)
    with pytest.raises(TrajectoryError, match="lacks"):
        stokes_holonomy(cat, sp.ShapePath.fourier([0], [[1]], [[0]], 1.0, joint_names=cat.joint_names[:1]))


def test_no_cone_spans_an_open_path_or_a_whole_turn():
    satellite = sp.load_body("satellite")
    start = satellite.shape()
    turned = sp.ShapePath.waypoints(
        [0, 1], [start, start + 4 * np.pi * np.eye(10)[satellite.joint_index("wheel_spin")]]
    )
    assert sp.holonomy(satellite, turned).shape == (3, 3)
    with pytest.raises(OpenPathError, match="wheel_spin"):
        stokes_holonomy(satellite, turned)
    open_path = sp.ShapePath.waypoints([0, 1], [start, satellite.shape({"boom_extension": 0.2})])
    with pytest.raises(OpenPathError, match="boom_extension"):
        stokes_holonomy(satellite, open_path)
    back = turned.then(turned.reversed())
    assert apart(stokes_holonomy(satellite, back, 1e-10), np.eye(3)) < 1e-10


def test_stokes_checks_what_it_is_given():
    cat = sp.load_body("cat_two_halves")
    path = ellipse(cat, ("waist_pitch", "waist_yaw"), (0.5, 0.5))
    with pytest.raises(ShapeError, match="centre"):
        stokes_holonomy(cat, path, centre=[0.0, 0.0])
    with pytest.raises(ShapeError, match="nan"):
        stokes_holonomy(cat, path, centre=[0.0, np.nan, 0.0])


@pytest.mark.parametrize("tolerance", [0.0, -1e-9, np.nan, np.inf, "tight", None, [1e-9, 1e-9]])
def test_a_tolerance_is_a_small_number_above_zero(tolerance):
    cat = sp.load_body("cat_two_halves")
    path = ellipse(cat, ("waist_pitch", "waist_yaw"), (0.5, 0.5))
    for function in (sp.holonomy, stokes_holonomy, horizontal_lift):
        for wrong in (tolerance, 1e-3):
            with pytest.raises(ShapeError, match="tolerance"):
                function(cat, path, wrong)
    if tolerance is not None and tolerance != np.inf:
        with pytest.raises(ShapeError, match="tolerance"):
            is_flat(cat, tolerance=tolerance)


def test_a_ray_too_long_to_resolve_says_so():
    """Thousands of turns to the loop: no number of pieces at hand resolves them."""
    cat = sp.load_body("cat_two_halves")
    path = ellipse(cat, ("waist_pitch", "waist_yaw"), (0.5, 0.5))
    with pytest.raises(AccuracyNotReached, match="ray"):
        stokes_holonomy(cat, path, centre=[2e4, 1e4, 0.0])


def test_rays_through_shapes_on_one_line_are_refused(load_urdf):
    """Three points in a row have no inertia about the row; a loop round that shape has a holonomy, its cone has not."""
    row = load_urdf(
        urdf(
            link("a", 1.0, [0, 0, 0]),
            '<link name="pin"/>',
            '<link name="hub"/>',
            link("b", 1.0, [0, 0, 0]),
            link("c", 1.3, [0, 0, 0], (0.7, 0.0, 0.0)),
            joint("to_pin", "fixed", "a", "pin", xyz=(1.0, 0.0, 0.0)),
            joint("to_b", "fixed", "pin", "b"),
            joint("y", "revolute", "pin", "hub", Y),
            joint("z", "revolute", "hub", "c", Z),
        )
    )
    path = ellipse(row, ("y", "z"), (0.5, 0.5))
    assert sp.holonomy(row, path).shape == (3, 3)
    with pytest.raises(SingularInertiaError, match="at the centre"):
        stokes_holonomy(row, path)
    node = 0.5 * (1.0 + np.polynomial.legendre.leggauss(12)[0][4])
    with pytest.raises(SingularInertiaError, match="on the ray"):
        stokes_holonomy(row, path, centre=-node / (1.0 - node) * path.shape(0.0))
    with pytest.raises(AccuracyNotReached):
        stokes_holonomy(row, path, centre=[0.3, 0.2])
    aside = ellipse(row, ("y", "z"), (0.3, 0.5), y=0.9)
    assert apart(stokes_holonomy(row, aside, 1e-10), sp.holonomy(row, aside, 1e-11)) < 1e-10


# ---- Mimic joints ---------------------------------------------------------------------------------------------------


# ---- Flatness -------------------------------------------------------------------------------------------------------


def wheeled(load_urdf, size, axes, length=1.0):
    """A lopsided bus of some size [m] with a round wheel on each axis, of `size` of its moments, turned anyhow."""
    turned = Rotation.from_rotvec([0.4, -0.7, 1.1]).as_matrix()
    bus = length**2 * turned @ np.diag([1.0, 1.7, 2.2]) @ turned.T
    parts = [link("bus", 5.0, 0.5 * (bus + bus.T))]
    # No link may have a radius of gyration below a tenth of a millimetre.
    mass = min(0.3, 4e7 * size * length**2)
    for k, axis in enumerate(axes):
        wheel, place = f"wheel_{k}", length * np.array([0.3 - 0.4 * k, 0.5 * k - 0.2, 0.1 * k * k])
        frame = Rotation.from_matrix(geodesic_turn(Z, axis)) * Rotation.from_euler("z", 0.7 * k)
        rpy = frame.as_euler("xyz")
        parts += [
            link(wheel, mass, np.array([0.6, 0.6, 1.0]) * size * length**2),
            joint(f"spin_{k}", "continuous", "bus", wheel, Z, place, rpy),
        ]
    return load_urdf(urdf(*parts))


@pytest.mark.parametrize("length", [1e-3, 1.0, 5.0])
@pytest.mark.parametrize("size", [0.3, 1e-3, 1e-6, 1e-8])
def test_wheels_on_parallel_axes_are_flat(size, length, load_urdf):
    """B6: A is constant and its columns are parallel; on other axes A_i x A_j is left, however small the wheels."""
    axis = np.array([0.48, -0.6, 0.64])
    assert is_flat(wheeled(load_urdf, size, [axis, axis, -axis], length))
    skew = wheeled(load_urdf, size, [axis, axis, np.array([0.6, 0.8, 0.0])], length)
    assert not is_flat(skew)
    columns = sp.mechanical_connection(skew, skew.shape()).T
    np.testing.assert_allclose(
        sp.curvature(skew, skew.shape())[1, 2],
        -np.cross(columns[1], columns[2]),
        atol=1e-15 * size,
        rtol=0,
    )


def test_bodies_of_one_joint_are_flat(load_urdf):
    bent = [link("a", 1.3, [1, 2, 2.5]), link("b", 0.7, [0.1, 0.2, 0.25], (0.3, 0.4, 0.1))]
    for kind in ("revolute", "continuous", "prismatic"):
        body = load_urdf(urdf(*bent, joint("j", kind, "a", "b", (1, 0.2, 0), (0.1, 0, 0))))
        assert np.abs(sp.mechanical_connection(body, [0.3])).max() > 1e-3
        assert is_flat(body)
    assert is_flat(load_urdf(chain_urdf('<mimic joint="near" multiplier="0.5"/>')))
    assert is_flat(load_urdf(urdf(bent[0])))


@pytest.mark.parametrize("length", [1e-3, 1.0, 5.0])
def test_slides_on_one_line_are_flat(length, load_urdf, rng):
    """They carry no angular momentum: all there is to see is rounding. Nor do they change what a wheel on it does."""
    turned = Rotation.from_rotvec([0.5, 1.0, -0.7])
    line, rpy = turned.apply(Z), turned.as_euler("xyz")
    slides = (
        link("a", 1.3, length**2 * turned.as_matrix() @ np.diag([2.5, 2.5, 1.0]) @ turned.as_matrix().T),
        link("b", 0.7, length**2 * np.array([0.2, 0.2, 0.1])),
        link("c", 0.9, length**2 * np.array([0.2, 0.2, 0.1])),
        joint("s", "prismatic", "a", "b", Z, 0.1 * length * line, rpy),
        joint("t", "prismatic", "b", "c", Z, (0.0, 0.0, 0.3 * length)),
    )
    shapes = rng.uniform(-1.0, 1.0, (16, 3)) * [length, length, 3.0]
    assert is_flat(load_urdf(urdf(*slides)), shapes[:, :2])
    wheel = link("w", 1e-6, 1e-7 * length**2 * np.array([0.6, 0.6, 1.0]))
    body = load_urdf(urdf(*slides, wheel, joint("spin", "continuous", "c", "w")))
    assert body.joint_units == ("m", "m", "rad")
    assert is_flat(body, shapes)
    assert is_flat(body)
    assert np.abs(sp.mechanical_connection(body, body.shape())).max() > 1e-9
    across = load_urdf(urdf(*slides, wheel, joint("spin", "continuous", "c", "w", X)))
    assert not is_flat(across, shapes)


def test_a_frame_without_mass_is_flat():
    """All that its joints move is one rigid body, which does not turn: slopes and brackets are large and cancel.

    Pinocchio reads the files: from a URDF such joints would be the free base.
    """

    def floating(*parts: str) -> sp.Body:
        return sp.load_body(pin.buildModelFromXML(urdf(*parts), pin.JointModelFreeFlyer()))

    gimbal = floating(
        '<link name="frame"/>',
        '<link name="outer"/>',
        '<link name="inner"/>',
        link("body", 2.0, [1.0, 1.7, 2.2], (0.1, -0.2, 0.3)),
        joint("yaw", "revolute", "frame", "outer", Z, (0.1, 0.0, 0.0)),
        joint("pitch", "revolute", "outer", "inner", Y, (0.0, 0.2, 0.0)),
        joint("roll", "revolute", "inner", "body", X),
    )
    columns = sp.mechanical_connection(gimbal, [0.2, 0.3, 0.4]).T
    np.testing.assert_allclose(columns[:2], [Z, [-np.sin(0.2), np.cos(0.2), 0.0]], atol=1e-14, rtol=0)
    assert is_flat(gimbal)
    path = ellipse(gimbal, ("yaw", "pitch"), (1.0, 0.8))
    assert apart(stokes_holonomy(gimbal, path, 1e-12), np.eye(3)) < 1e-12
    table = floating(
        '<link name="frame"/>',
        '<link name="x"/>',
        '<link name="y"/>',
        link("body", 2.0, [1.0, 1.7, 2.2], (0.1, -0.2, 0.3)),
        joint("along", "prismatic", "frame", "x", (0.6, 0.8, 0.1), rpy=(0.3, 0.2, 0.1)),
        joint("across", "prismatic", "x", "y", (0.6, 0.0, 0.8)),
        joint("hinge", "revolute", "y", "body", (0.1, 0.2, 0.3), (0.0, 0.4, 0.0)),
    )
    assert is_flat(table)
    far = np.random.default_rng(3).uniform(-1.0, 1.0, (16, 3)) * [800.0, 800.0, 3.0]
    assert is_flat(table, far)


def test_a_body_without_joints(load_urdf):
    rock = load_urdf(urdf(link("rock", 1.0, [1.0, 2.0, 2.5])))
    path = sp.ShapePath.waypoints([0.0, 1.0], np.zeros((2, 0)))
    for found in (stokes_holonomy(rock, path), horizontal_lift(rock, path).attitude(0.5)):
        np.testing.assert_array_equal(found, np.eye(3))


def test_bodies_that_turn_by_their_joints_are_not_flat(body, planar):
    assert not is_flat(body)
    assert not is_flat(planar)


def test_flatness_is_asked_within_the_limits(monkeypatch):
    """A whole turn where there are none, or from the one that there is."""
    model = pin.buildModelFromUrdf(str(urdf_file("cat_two_halves")), pin.JointModelFreeFlyer())
    model.lowerPositionLimit[7:] = [-np.inf, 0.4, -1e30]
    model.upperPositionLimit[7:] = [0.1, np.inf, 1e30]
    cat, seen = sp.load_body(model), []
    true = sp.shape_space.connection_slopes
    monkeypatch.setattr(
        "shapephase.shape_space.curvature_field.connection_slopes", lambda *args: seen.append(args[1]) or true(*args)
    )
    assert not is_flat(cat)
    least, most = np.min(seen[0], axis=0), np.max(seen[0], axis=0)
    allowed = np.array([[0.1 - 2 * np.pi, 0.1], [0.4, 0.4 + 2 * np.pi], [-np.pi, np.pi]])
    assert np.all((least >= allowed[:, 0]) & (most <= allowed[:, 1]) & (most - least > 4.0))
    satellite = sp.load_body("satellite")
    assert not is_flat(satellite)
    assert not is_flat(satellite)
    np.testing.assert_array_equal(seen[1], seen[2])
    slide = satellite.joint_index("boom_extension")
    lower, upper = satellite.joint_limits[slide]
    assert np.all((seen[1][:, slide] >= lower) & (seen[1][:, slide] <= upper))


def test_flatness_is_asked_at_the_shapes_given(planar):
    """The curvature of the planar chain changes its sign at some first angle: there it vanishes, and not beside it."""
    near, far = -2.0, 3.0
    assert chain(near, 0.0)[2] * chain(far, 0.0)[2] < 0.0
    for _ in range(60):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if chain(middle, 0.0)[2] * chain(near, 0.0)[2] > 0.0 else (near, middle)
    here, beside = [near, 0.0], [near + 1e-6, 0.0]
    assert is_flat(planar, here)
    assert not is_flat(planar, [here, beside])
    assert is_flat(planar, [here, beside], 1e-4)
    with pytest.raises(ShapeError, match="near"):
        is_flat(planar, [0.0, 0.0, 0.0])
    with pytest.raises(ShapeError, match="shapes"):
        is_flat(planar, np.zeros((0, 2)))


# ---- Horizontal lifts -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", full_but(["cat", "satellite", "example:human", "example:kinova"], "satellite"))
def test_the_lift_of_an_open_path(name, rng):
    """B2, B8: R' = -R hat(A rate) by a plain integrator, at all times."""
    body = sp.load_body(name)
    shapes = random_shapes(body, rng, 3)
    path = sp.ShapePath.waypoints([0.0, 0.8, 2.0], shapes)
    lift = horizontal_lift(body, path, 1e-11)
    times = np.sort(np.append(rng.uniform(0.0, 2.0, 20), [0.0, 0.8, 2.0]))
    want = plain_lift(body, path, times)
    assert apart(lift.attitude(times), want) < 2e-11
    assert apart(lift.end, want[-1]) < 2e-11
    assert np.linalg.norm(rotation_vector(want[-1])) > 1e-2
    np.testing.assert_array_equal(lift.attitude(0.0), np.eye(3))
    assert 0.0 < lift.error_estimate <= 1e-11
    assert lift.duration == 2.0
    momentum = np.einsum("tij,tj->ti", body.locked_inertia(path.shape(times)), lift.angular_velocity(times))
    momentum += body.internal_momentum(path.shape(times), path.rate(times))
    np.testing.assert_allclose(momentum, 0.0, atol=1e-12 * np.abs(body.locked_inertia(shapes)).max(), rtol=0)
    step = 2e-3
    around = lift.attitude(0.3 + step * np.arange(-4, 5))
    rate = around[4].T @ np.einsum("k,kij->ij", EIGHTH, around) / step
    np.testing.assert_allclose(rate, hat(lift.angular_velocity(0.3)), atol=1e-8, rtol=0)


def test_the_lift_of_a_loop_ends_in_its_holonomy(body, rng):
    path = random_loop(body, rng)
    lift = horizontal_lift(body, path, 1e-11)
    np.testing.assert_array_equal(lift.end, sp.holonomy(body, path, 1e-11))
    assert apart(lift.attitude(path.duration), lift.end) < 1e-14
    twice = horizontal_lift(body, path.repeated(2), 1e-11)
    assert apart(twice.attitude(1.3 * path.duration), lift.end @ lift.attitude(0.3 * path.duration)) < 3e-11


def test_a_lift_checks_its_times_and_joints():
    cat = sp.load_body("cat_two_halves")
    lift = horizontal_lift(cat, sp.ShapePath.waypoints([0, 1], [[0, 0, 0], [0.5, 0.2, 0.1]]))
    assert lift.attitude(np.zeros((2, 3))).shape == (2, 3, 3, 3)
    assert lift.angular_velocity(np.zeros((2, 3))).shape == (2, 3, 3)
    for ask in (lift.attitude, lift.angular_velocity):
        with pytest.raises(TrajectoryError, match="outside"):
            ask(1.1)
        with pytest.raises(ShapeError, match="nan"):
            ask([0.0, np.nan])
    with pytest.raises(TrajectoryError, match="joints"):
        horizontal_lift(cat, sp.ShapePath.waypoints([0, 1], np.zeros((2, 2))))
