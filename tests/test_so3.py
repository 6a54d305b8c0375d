"""Rotations against SciPy, matrix exponentials of 50 digits and the group's laws."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import ShapeError

laws = settings(derandomize=True, max_examples=60, deadline=None)
vectors = arrays(np.float64, 3, elements=st.floats(-4.0, 4.0, allow_subnormal=False))
# Zero, both sides of every switch (1e-9 in log, 1e-8 in sinc-like terms), the half turn and beyond.
EPS = float(np.finfo(float).eps)
# Entries of a rotation matrix or a quaternion that is made from the other or from a vector: sums of products of numbers
# up to 1, of sines or roots that are right to some units of rounding.
ENTRIES = 16.0 * EPS
ANGLES = (
    0.0, 1e-300, 1e-16, 1e-12, 0.9e-9, 1.1e-9, 1.9e-9, 2.1e-9, 1e-8, 1e-5, 1e-3, 0.5, 1.5, 2.0943951,
    3.0, np.pi - 1e-5, np.pi - 1e-9, np.pi - 1e-15, np.pi,
)  # fmt: skip
DIRECTIONS = [np.array(v) / np.linalg.norm(v) for v in ((1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 2, -3), (-5, 1e-6, 2))]


def mp_exp(vector):
    """exp(hat(v)) by the matrix exponential of 50 digits, rounded once."""
    with mpmath.workdps(50):
        x, y, z = (mpmath.mpf(float(c)) for c in vector)
        rotation = mpmath.expm(mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]]))
        return np.array([[float(rotation[i, j]) for j in range(3)] for i in range(3)])


def test_hat_is_the_cross_product_and_vee_its_inverse(rng):
    v, w = rng.normal(size=(2, 4, 5, 3))
    np.testing.assert_allclose(
        (so3.hat(v) @ w[..., None])[..., 0], np.cross(v, w), atol=2.0 * EPS * np.abs(v).max() * np.abs(w).max(), rtol=0
    )
    np.testing.assert_array_equal(so3.vee(so3.hat(v)), v)
    symmetric = rng.normal(size=(3, 3))
    np.testing.assert_array_equal(so3.vee(symmetric + symmetric.T), np.zeros(3))


def test_apply_and_transpose_over_leading_axes(rng):
    matrix, vector = rng.normal(size=(2, 5, 3, 3)), rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose(
        so3.apply(matrix, vector), np.einsum("abij,abj->abi", matrix, vector), atol=1e-14, rtol=0
    )
    np.testing.assert_array_equal(so3.transpose(matrix), np.einsum("abij->abji", matrix))


@pytest.mark.parametrize("angle", [*ANGLES, 3.5, 2 * np.pi, 10.0])
def test_exp_is_the_matrix_exponential_of_50_digits(angle):
    for direction in DIRECTIONS:
        np.testing.assert_allclose(so3.exp(angle * direction), mp_exp(angle * direction), rtol=0, atol=3e-15)


@pytest.mark.parametrize("angle", ANGLES)
def test_log_recovers_the_vector_on_both_sides_of_the_switches(angle):
    for direction in DIRECTIONS:
        vector = angle * direction
        back = so3.log(mp_exp(vector))
        if angle > np.pi - 1e-14:  # the two vectors of a half turn are the same rotation
            back *= np.sign(back @ vector)
        # Small vectors keep their relative accuracy, until the squares underflow.
        np.testing.assert_allclose(back, vector, rtol=0, atol=max(2e-15 * angle, 1e-300))


def test_exp_and_log_agree_with_scipy(rng):
    vectors = rng.normal(size=(7, 11, 3)) * 2.0
    scipy = Rotation.from_rotvec(vectors.reshape(-1, 3))
    matrices = so3.exp(vectors)
    assert matrices.shape == (7, 11, 3, 3)
    np.testing.assert_allclose(matrices.reshape(-1, 3, 3), scipy.as_matrix(), atol=ENTRIES, rtol=0)
    np.testing.assert_allclose(so3.log(matrices).reshape(-1, 3), scipy.as_rotvec(), atol=1e-14, rtol=0)
    np.testing.assert_allclose(so3.angle(matrices).ravel(), scipy.magnitude(), atol=1e-14, rtol=0)


@laws
@given(vectors, vectors)
def test_laws_of_the_group(v, w):
    """exp(-v) inverts, conjugation turns the axis, all is proper and orthogonal."""
    r, s = so3.exp(v), so3.exp(w)
    np.testing.assert_allclose(r @ so3.exp(-v), np.eye(3), atol=2.0 * ENTRIES, rtol=0)
    np.testing.assert_allclose(s @ r @ s.T, so3.exp(s @ v), atol=2e-14, rtol=0)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=2.0 * ENTRIES, rtol=0)
    assert np.linalg.det(r) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(so3.exp(so3.log(r)), r, atol=5e-15, rtol=0)
    assert 0.0 <= so3.angle(r) <= np.pi + 1e-15


def test_exp_solves_its_differential_equation():
    """d/dt exp(t v) = exp(t v) hat(v): attitude times body rate; a transposed matrix fails."""
    v, t, step = np.array([0.3, -1.1, 0.7]), 0.8, 1e-3
    value = {k: so3.exp((t + k * step) * v) for k in (-2, -1, 0, 1, 2)}
    slope = (value[-2] - 8 * value[-1] + 8 * value[1] - value[2]) / (12 * step)
    np.testing.assert_allclose(slope, value[0] @ so3.hat(v), atol=1e-11, rtol=0)


def test_the_right_hand_rule():
    np.testing.assert_allclose(
        so3.exp(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15, rtol=0
    )


def test_quaternions_are_xyzw_as_in_scipy(rng):
    rotations = Rotation.from_rotvec(rng.normal(size=(200, 3)) * 2.5)
    quat = so3.quat_from_matrix(rotations.as_matrix())
    np.testing.assert_allclose(quat, rotations.as_quat(canonical=True), atol=ENTRIES, rtol=0)
    np.testing.assert_allclose(so3.matrix_from_quat(quat), rotations.as_matrix(), atol=ENTRIES, rtol=0)
    np.testing.assert_allclose(
        so3.matrix_from_quat(so3.quat_from_rotation_vector(rotations.as_rotvec())),
        rotations.as_matrix(),
        atol=ENTRIES,
        rtol=0,
    )
    assert np.all(quat[:, 3] >= 0.0)


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), np.ones((1, 3)) / np.sqrt(3), [[0.6, -0.8, 0.0]]]))
def test_quaternion_of_half_turns(axis):
    """Where the scalar part vanishes, each of the other three may be the largest."""
    half_turn = 2.0 * np.outer(axis, axis) - np.eye(3)
    quat = so3.quat_from_matrix(half_turn)
    np.testing.assert_allclose(np.outer(quat[:3], quat[:3]), np.outer(axis, axis), atol=2e-15, rtol=0)
    assert abs(quat[3]) < 4.0 * EPS
    # Four of the spacings of pi.
    assert so3.angle(half_turn) == pytest.approx(np.pi, abs=8.0 * EPS)


def test_positive_scalar_and_normalised():
    np.testing.assert_array_equal(
        so3.positive_scalar(np.array([[1.0, 2, 3, -4], [1, 2, 3, 4]])), [[-1, -2, -3, 4], [1, 2, 3, 4]]
    )
    np.testing.assert_allclose(so3.normalised(np.array([3.0, 0.0, 4.0])), [0.6, 0.0, 0.8], atol=1e-16, rtol=0)


def test_angle_about_is_the_twist(rng):
    axis = DIRECTIONS[3]
    phases = np.linspace(-3.14, np.pi, 40)
    turns = so3.exp(phases[:, None] * axis)
    np.testing.assert_allclose(so3.angle_about(turns, axis), phases, atol=2e-15, rtol=0)
    swing = so3.exp(rng.uniform(0.1, 2.0, (40, 1)) * so3.normalised(np.cross(rng.normal(size=(40, 3)), axis)))
    np.testing.assert_allclose(so3.angle_about(swing @ turns, axis), phases, atol=1e-13, rtol=0)
    assert so3.angle_about(so3.exp(np.pi * axis), axis) == pytest.approx(np.pi, abs=1e-14)


def test_the_twist_is_the_nearest_turn(rng):
    """Of all turns about the axis none is nearer to the rotation."""
    axis = DIRECTIONS[3]
    for rotation in so3.exp(rng.normal(size=(10, 3))):
        best = so3.angle_about(rotation, axis)
        away = so3.angle(rotation @ so3.exp(-best * axis))
        near = so3.angle(rotation @ so3.exp(-(best + np.array([[-1e-3], [1e-3]])) * axis))
        assert np.all(near > away)


def test_wrap_is_in_the_half_open_circle(rng):
    phases = np.concatenate([rng.uniform(-40.0, 40.0, 500), np.pi * np.arange(-9, 10)])
    phases = np.concatenate([phases, np.nextafter(phases, 99.0), np.nextafter(phases, -99.0)])
    wrapped = so3.wrap(phases)
    assert np.all(wrapped > -np.pi)
    assert np.all(wrapped <= np.pi)
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * phases), atol=3e-14, rtol=0)
    assert so3.wrap(-np.pi) == np.pi
    assert so3.wrap(np.pi) == np.pi
    inside = np.array([-3.1, -1e-300, 0.0, 1e-17, 3.1])
    np.testing.assert_array_equal(so3.wrap(inside), inside)


def test_between_is_the_shortest_turn(rng):
    start, end = so3.normalised(rng.normal(size=(2, 50, 3)))
    turn = so3.between(start, end)
    np.testing.assert_allclose(so3.apply(turn, start), end, atol=1e-14, rtol=0)
    np.testing.assert_allclose(so3.angle(turn), np.arccos(np.sum(start * end, axis=-1)), atol=1e-14, rtol=0)
    np.testing.assert_allclose(np.sum(so3.log(turn) * (start + end), axis=-1), 0.0, atol=1e-14, rtol=0)


@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-13, 1e-12, 1e-10, 0.9e-8, 1e-6, 1e-3])
def test_between_almost_opposite_and_almost_equal(gap):
    """Both sides of the switch to a fixed half turn, where 1.4e-14 is left to the opposite point."""
    start = DIRECTIONS[3]
    nearby = so3.apply(so3.exp(gap * so3.perpendicular(start)), start)
    np.testing.assert_allclose(so3.between(start, nearby) @ start, nearby, atol=1e-15, rtol=0)
    opposite = so3.between(start, -nearby)
    np.testing.assert_allclose(opposite @ start, -nearby, atol=1e-14, rtol=0)
    np.testing.assert_allclose(opposite @ opposite.T, np.eye(3), atol=1e-14, rtol=0)


def test_middle_lies_halfway(rng):
    start, end = so3.normalised(rng.normal(size=(2, 50, 3)))
    half = so3.middle(start, end)
    np.testing.assert_allclose(np.sum(half * start, -1), np.sum(half * end, -1), atol=1e-14, rtol=0)
    np.testing.assert_allclose(np.linalg.norm(half, axis=-1), 1.0, atol=1e-15, rtol=0)
    np.testing.assert_allclose(np.sum(half * np.cross(start, end), -1), 0.0, atol=1e-15, rtol=0)
    assert abs(so3.middle(start[0], -start[0]) @ start[0]) < 1e-15


def test_perpendicular(rng):
    vectors = np.concatenate([rng.normal(size=(50, 3)), np.eye(3), -np.eye(3)])
    across = so3.perpendicular(vectors)
    np.testing.assert_allclose(np.sum(across * vectors, -1), 0.0, atol=1e-15, rtol=0)
    np.testing.assert_allclose(np.linalg.norm(across, axis=-1), 1.0, atol=1e-15, rtol=0)


def test_a_users_rotation_is_checked_and_made_orthogonal(rng):
    rotation = Rotation.from_rotvec([0.4, -2.0, 1.0]).as_matrix()
    rough = rotation + 1e-7 * rng.uniform(-1, 1, (3, 3))
    made = so3.rotation_argument(rough, "attitude")
    np.testing.assert_allclose(made @ made.T, np.eye(3), atol=1e-15, rtol=0)
    left, _, right = np.linalg.svd(rough)
    np.testing.assert_allclose(made, left @ right, atol=1e-13, rtol=0)
    many = Rotation.random(50, rng=rng).as_matrix()
    np.testing.assert_allclose(so3.rotation_argument(many, "attitude"), many, atol=1e-15, rtol=0)
    off = np.zeros((3, 3))
    off[0, 0] = 1.0  # R^T R is off by twice this
    so3.rotation_argument(np.eye(3) + 0.45e-6 * off, "attitude")
    with pytest.raises(ShapeError, match=r"1\.4e-06"):
        so3.rotation_argument(np.eye(3) + 0.7e-6 * off, "attitude")


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (np.diag([1.0, 1.0, -1.0]), "reflection"),
        (2.0 * np.eye(3), "not a rotation"),
        (np.eye(3) + 1e-5, "not a rotation"),
        (np.zeros((3, 3)), "not a rotation"),
        (np.full((3, 3), np.nan), "nan"),
        (np.eye(4), r"\(4, 4\)"),
        ([0.0, 0.0, 0.0, 1.0], r"\(4,\)"),
        ("upright", "real numbers"),
        (np.eye(3) * 1j, "complex"),
    ],
)
def test_what_is_no_rotation_is_refused_by_name(value, said):
    with pytest.raises(ShapeError, match=rf"attitude.*{said}"):
        so3.rotation_argument(value, "attitude")


def test_a_users_quaternion(rng):
    quat = Rotation.from_rotvec(rng.normal(size=3)).as_quat()
    want = Rotation.from_quat(quat).as_matrix()
    np.testing.assert_allclose(so3.quat_argument(1.0000005 * quat, "attitude"), want, atol=1e-14, rtol=0)
    np.testing.assert_allclose(so3.quat_argument(-quat, "attitude"), want, atol=1e-14, rtol=0)
    np.testing.assert_allclose(so3.quat_argument(1.0009 * quat, "attitude"), want, atol=1e-14, rtol=0)
    for bad in (np.zeros(4), 1.0015 * quat, 1.1 * quat, np.full(4, np.nan), np.eye(3)):
        with pytest.raises(ShapeError, match="attitude"):
            so3.quat_argument(bad, "attitude")


def test_modified_rodrigues_parameters_are_scipys_of_both_sets():
    """Half turns, the identity and small angles among them; a shadow is the same rotation."""
    turns = Rotation.concatenate(
        [Rotation.random(200, rng=8), Rotation.from_rotvec([[0.0, 0.0, np.pi], [0.0, 0.0, 0.0], [1e-9, 0.0, -2e-9]])]
    )
    quaternions = turns.as_quat()
    found = so3.mrp_from_quat(quaternions)
    np.testing.assert_allclose(found, turns.as_mrp(), rtol=0, atol=1e-15)
    assert np.linalg.norm(found, axis=-1).max() <= 1.0
    shadows = -found[:200] / (found[:200] ** 2).sum(axis=-1, keepdims=True)
    for parameters in (found[:200], shadows):
        back = so3.matrix_from_quat(so3.quat_from_mrp(parameters))
        np.testing.assert_allclose(back, turns[:200].as_matrix(), rtol=0, atol=1e-14)
    assert (so3.quat_from_mrp(shadows)[:, 3] >= 0.0).all()
