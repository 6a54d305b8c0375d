"""The falling cat of Kane and Scher (1969), from the paper's kinematics alone.

Two equal axisymmetric halves, axial to transverse inertia 0.25, both centres of mass at the waist. In the front half's
axes: a is its forward axis x, K lies in the x-z plane at the angle alpha from a, the rear half's axis (a when straight)
is b = cos(beta) K - sin(beta) (cos(th) u + sin(th) v) with u across K in that plane and v = K x u, and the waist bends
without twist: the relative rotation is exp(gamma n) with n along a x b.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import TrajectoryError, UnknownNameError
from shapephase.examples import kane_scher
from support.independent import apart, body_of, turn
from support.places import ROBOTS

RIGHTING = [(0, 59.426459), (10, 60.036246), (20, 61.813873), (30, 64.618733), (45, 70.316222), (60, 77.132402)]
JOINTS = ("waist_pitch", "waist_yaw", "waist_roll")
A = np.array([1.0, 0.0, 0.0])


def rear_axis(alpha: float, beta: float, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """b and db/dtheta: (N,) -> (N, 3), (N, 3)."""
    k = np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    u = np.array([np.sin(alpha), 0.0, -np.cos(alpha)])
    v = np.cross(k, u)
    c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
    return np.cos(beta) * k - np.sin(beta) * (c * u + s * v), np.sin(beta) * (s * u - c * v)


def untwisted(b: np.ndarray, b_rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp(gamma n) = 1 + hat(c) + hat(c)^2/(1 + a.b), c = a x b, and its rate: (N, 3, 3) each."""
    hats = np.cross(np.eye(3)[None], np.cross(A, b)[:, None]).swapaxes(1, 2) * -1.0
    hat_rates = np.cross(np.eye(3)[None], np.cross(A, b_rate)[:, None]).swapaxes(1, 2) * -1.0
    scale, scale_rate = 1.0 / (1.0 + b @ A), -(b_rate @ A) / (1.0 + b @ A) ** 2
    matrix = np.eye(3) + hats + scale[:, None, None] * hats @ hats
    rate = hat_rates + scale[:, None, None] * (hat_rates @ hats + hats @ hat_rates)
    return matrix, rate + scale_rate[:, None, None] * hats @ hats


def waist_angles(matrix: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pitch, yaw, roll of matrix = Ry Rz Rx, and their rates, from its first column and second row."""
    x, y, z = matrix[:, :, 0].T
    dx, dy, dz = rate[:, :, 0].T
    p, q = matrix[:, 1, 1], -matrix[:, 1, 2]
    dp, dq = rate[:, 1, 1], -rate[:, 1, 2]
    angles = np.stack([np.arctan2(-z, x), np.arcsin(y), np.arctan2(q, p)], axis=1)
    rates = [(z * dx - x * dz) / (x * x + z * z), dy / np.sqrt(1.0 - y * y), (p * dq - q * dp) / (p * p + q * q)]
    return angles, np.stack(rates, axis=1)


def paper_path(alpha: float, beta: float, duration: float = 1.0) -> sp.ShapePath:
    """The cone gone round once, from the paper's formulas; alpha, beta [rad]."""
    pace = 2.0 * np.pi / duration

    def curve(t):
        b, db = rear_axis(alpha, beta, pace * t)
        angles, rates = waist_angles(*untwisted(b, db))
        return angles, pace * rates

    return sp.ShapePath.function(curve, duration, joint_names=JOINTS)


def library_path(alpha: float, beta: float, duration: float = 1.0) -> sp.ShapePath:
    from shapephase.examples import kane_scher

    return kane_scher(alpha, beta, duration=duration)


def turn_of_the_bend(motion: sp.Motion, alpha: float, beta: float) -> float:
    """The paper's psi [deg]: the turn of the plane of bending about the bisector, counted through the motion.

    The bisector keeps its direction in space (asserted), and the normal of the plane of the two axes turns about it;
    relative to that plane each half spins once backward, so the halves end up where psi says, less a whole turn.
    """
    times = np.linspace(0.0, motion.duration, 721)
    b, _ = rear_axis(alpha, beta, 2.0 * np.pi * times / motion.duration)
    attitude = motion.attitude(times)
    axis = bisector(alpha, beta)
    middle = np.einsum("nij,nj->ni", attitude, (A + b) / np.linalg.norm(A + b, axis=1)[:, None])
    np.testing.assert_allclose(middle, np.broadcast_to(axis, middle.shape), rtol=0, atol=1e-9)
    normal = np.einsum("nij,nj->ni", attitude, np.cross(A, b))
    start = normal[0] / np.linalg.norm(normal[0])
    angle = np.unwrap(np.arctan2(normal @ np.cross(axis, start), normal @ start))
    return float(np.degrees(angle[-1] - angle[0]))


def bisector(alpha: float, beta: float) -> np.ndarray:
    """Between the two halves' axes at the start."""
    b, _ = rear_axis(alpha, beta, np.zeros(1))
    middle = A + b[0]
    return middle / np.linalg.norm(middle)


PATHS = pytest.mark.parametrize("path_of", [paper_path, library_path])


@PATHS
@pytest.mark.parametrize(("alpha", "beta"), RIGHTING)
def test_the_cat_rights_itself(path_of, alpha: float, beta: float):
    a, b = np.radians([alpha, beta])
    deformation = sp.articulated(body_of("cat_two_halves"), path_of(a, b))
    motion = sp.reconstruct(deformation, np.zeros(3))
    half_turn = turn(bisector(a, b), np.pi)
    assert np.degrees(apart(motion.final_attitude, half_turn)) < 1e-5
    assert abs(turn_of_the_bend(motion, a, b) - 180.0) < 1e-5
    assert np.degrees(apart(sp.split(motion).holonomy, half_turn)) < 1e-5
    assert np.degrees(apart(sp.holonomy(body_of("cat_two_halves"), path_of(a, b)), half_turn)) < 1e-5


@PATHS
def test_another_cone_turns_by_what_the_paper_s_equation_gives(path_of):
    """(20, 40): 259.512497 degrees as a lift; the matrix is 100.487503 degrees about minus the bisector."""
    a, b = np.radians([20.0, 40.0])
    motion = sp.reconstruct(sp.articulated(body_of("cat_two_halves"), path_of(a, b)), np.zeros(3), tolerance=1e-11)
    axis = bisector(a, b)
    assert abs(turn_of_the_bend(motion, a, b) - 259.512496776) < 2e-8
    assert np.degrees(apart(motion.final_attitude, turn(-axis, np.radians(100.487503224)))) < 2e-8


@pytest.mark.parametrize(
    ("alpha", "beta"), [(0, 20.0), (0, 59.426458741516), (0, 80.0), (5, 30.0), (20, 61.8), (60, 77.0)]
)
def test_any_cone_turns_as_the_paper_s_equation_says(alpha: float, beta: float):
    """Equation (5): dpsi/dtheta = j S/{(1 - T)[1 - T + j (1 + T)] sqrt(1 + T)}, j = J/I, by quadrature."""
    a, b, j = np.radians(alpha), np.radians(beta), 0.25
    theta = 2.0 * np.pi * np.arange(4000) / 4000
    t = np.cos(a) * np.cos(b) - np.sin(a) * np.sin(b) * np.cos(theta)
    s = np.sqrt(2.0) * (np.cos(a) * np.sin(b) + np.sin(a) * np.cos(b) * np.cos(theta)) * np.sin(b)
    psi = 360.0 * np.mean(j * s / ((1.0 - t) * (1.0 - t + j * (1.0 + t)) * np.sqrt(1.0 + t)))
    motion = sp.reconstruct(sp.articulated(body_of("cat_two_halves"), paper_path(a, b)), np.zeros(3), tolerance=1e-11)
    assert abs(turn_of_the_bend(motion, a, b) - psi) < 1e-7


@pytest.mark.parametrize(("alpha", "beta"), [(0, 30.0), (20, 61.813873), (60, 77.132402)])
def test_the_waist_that_cannot_twist_does_what_the_other_does(alpha: float, beta: float):
    a, b = np.radians([alpha, beta])
    known = sp.holonomy(body_of("cat_two_halves"), library_path(a, b))
    found = sp.holonomy(body_of("cat_untwisted"), kane_scher(a, b, body="cat_untwisted"))
    assert apart(found, known) < 1e-9
    body, times = body_of("cat_untwisted"), np.linspace(0.0, 1.0, 9)
    poses = [body.link_pose(shape, "rear")[:3, :3] for shape in kane_scher(a, b, body="cat_untwisted").shape(times)]
    np.testing.assert_allclose(poses, untwisted(*rear_axis(a, b, 2.0 * np.pi * times))[0], rtol=0, atol=1e-14)


@pytest.mark.parametrize(("alpha", "beta"), [(0, 90.0), (0, 140.0), (20, 90.0), (30, 120.0)])
def test_bends_beyond_a_quarter_turn_turn_as_the_paper_s_equation_says(alpha: float, beta: float):
    """Equation (5) by quadrature, where the three angles of the other waist are singular or go round."""
    a, b, j = np.radians(alpha), np.radians(beta), 0.25
    theta = 2.0 * np.pi * np.arange(4000) / 4000
    t = np.cos(a) * np.cos(b) - np.sin(a) * np.sin(b) * np.cos(theta)
    s = np.sqrt(2.0) * (np.cos(a) * np.sin(b) + np.sin(a) * np.cos(b) * np.cos(theta)) * np.sin(b)
    psi = 2.0 * np.pi * np.mean(j * s / ((1.0 - t) * (1.0 - t + j * (1.0 + t)) * np.sqrt(1.0 + t)))
    # The halves end where psi says, less a whole turn.
    found = sp.holonomy(body_of("cat_untwisted"), kane_scher(a, b, body="cat_untwisted"))
    assert apart(found, turn(bisector(a, b), psi)) < 1e-9


def test_other_cones_and_bodies_are_refused():
    with pytest.raises(TrajectoryError, match="alpha"):
        kane_scher(0.5, np.pi - 0.4, body="cat_untwisted")
    with pytest.raises(TrajectoryError, match="beta"):
        kane_scher(0.5, 0.5 * np.pi)
    with pytest.raises(UnknownNameError, match="cat_untwisted"):
        kane_scher(0.1, 0.5, body="dog")


@pytest.mark.parametrize("offset", [0.05, 0.1225])
def test_centres_of_mass_off_the_waist_change_nothing(tmp_path, offset: float):
    """The halves stay mirror images, so that what their centres' distance adds cancels; (20, 40) is no righting."""
    path, (front, rear) = library_path(*np.radians([20.0, 40.0])), (f"{offset} 0 0", f"{-offset} 0 0")
    first, second, rest = (ROBOTS / "cat_two_halves.urdf").read_text().split('<origin xyz="0 0 0"/>')
    file = tmp_path / "moved.urdf"
    file.write_text(f'{first}<origin xyz="{front}"/>{second}<origin xyz="{rear}"/>{rest}')
    found = sp.holonomy(sp.load_body(file), path)
    assert apart(found, sp.holonomy(body_of("cat_two_halves"), path)) < 1e-12


def test_constant_bend_in_closed_form():
    """alpha = 0: the turn is 2 pi j cos(h)/(sin(h)^2 + j cos(h)^2), h half the bend (theory.md section 7)."""
    for bend in np.radians([10.0, 40.0, 59.426458741516, 85.0]):
        c, s = np.cos(0.5 * bend), np.sin(0.5 * bend)
        expected = 360.0 * 0.25 * c / (s**2 + 0.25 * c**2)
        motion = sp.reconstruct(sp.articulated(body_of("cat_two_halves"), paper_path(0.0, bend)), np.zeros(3))
        assert abs(turn_of_the_bend(motion, 0.0, bend) - expected) < 1e-7


@pytest.mark.parametrize(("alpha", "beta"), [*RIGHTING, (20, 40)])
def test_the_library_s_path_is_the_paper_s(alpha: float, beta: float):
    a, b = np.radians([alpha, beta])
    ours, papers = library_path(a, b, duration=0.7), paper_path(a, b, duration=0.7)
    assert ours.duration == 0.7
    assert set(ours.joint_names or ()) == set(JOINTS)
    order = [list(ours.joint_names or ()).index(joint) for joint in JOINTS]
    times = np.linspace(0.0, 0.7, 50)
    np.testing.assert_allclose(ours.shape(times)[:, order], papers.shape(times), rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.rate(times)[:, order], papers.rate(times), rtol=0, atol=1e-10)
    np.testing.assert_allclose(ours.gap, np.zeros(3), rtol=0, atol=1e-12)


def test_there_is_no_twist_and_the_bend_is_that_of_the_table():
    """Forward bend alpha + beta towards the belly at the start, backward bend beta - alpha half way."""
    a, b = np.radians([20.0, 61.813873])
    body, path = body_of("cat_two_halves"), library_path(a, b)
    poses = body.link_pose(path.shape(np.array([0.0, 0.25, 0.5])), "rear")[:, :3, :3]
    vectors = Rotation.from_matrix(poses).as_rotvec(degrees=True)
    np.testing.assert_allclose(vectors[:, 0], np.zeros(3), rtol=0, atol=1e-10)
    np.testing.assert_allclose(vectors[0], [0.0, -81.813873, 0.0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(vectors[2], [0.0, 41.813873, 0.0], rtol=0, atol=1e-9)


def test_the_way_back_turns_back_and_haste_changes_nothing():
    a, b = np.radians([20.0, 61.813873])
    body, path = body_of("cat_two_halves"), library_path(a, b)
    there = sp.reconstruct(sp.articulated(body, path), np.zeros(3), tolerance=1e-11).final_attitude
    back = sp.reconstruct(sp.articulated(body, path.reversed()), np.zeros(3), tolerance=1e-11).final_attitude
    slow = sp.reconstruct(sp.articulated(body, path.stretched(3.0)), np.zeros(3), tolerance=1e-11).final_attitude
    assert apart(there @ back, np.eye(3)) < 3e-11
    assert apart(there, slow) < 3e-11


@pytest.mark.parametrize(("alpha", "beta"), [(0.5, 0.3), (-0.1, 1.0), (0.1, 1.6)])
def test_cones_that_the_library_does_not_take(alpha: float, beta: float):
    with pytest.raises(TrajectoryError, match="alpha"):
        library_path(alpha, beta)
