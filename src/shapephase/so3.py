"""Rotations of space: matrices, rotation vectors and quaternions, batched over leading axes.

A rotation matrix `R` takes body axes to inertial axes; quaternions are xyzw, as in SciPy and Pinocchio.
"""

from __future__ import annotations

import numpy as np

from .arrays import Array, finite_array
from .errors import ShapeError

FAR_FROM_OPPOSITE = 0.2  # 1 + a.b of unit vectors, above which half the turn between them is far from a right angle
OPPOSITE = 64.0 * float(np.finfo(float).eps)  # length of the sum of opposite unit vectors: a tenth may be rounding
_SMALL_SINE = 1e-9  # of half an angle: sine and angle differ by a sixth of its cube, less than the last digit
_ORTHOGONAL = 1e-6  # largest entry of R^T R - 1 in a rotation that a user gives: six written digits
_UNIT_QUATERNION = 1e-3  # farthest from 1 that the length of a quaternion may be: recordings keep three digits


def hat(vector: Array) -> Array:
    """The matrix of the cross product, hat(v) w = v x w: (..., 3) -> (..., 3, 3).

    Examples
    --------
    >>> print(sp.so3.hat(np.array([1.0, 2.0, 3.0])) @ [0.0, 0.0, 1.0])  # (1, 2, 3) x e_z
    [ 2. -1.  0.]
    """
    matrix = np.zeros((*vector.shape, 3))
    matrix[..., 0, 1] = -vector[..., 2]
    matrix[..., 0, 2] = vector[..., 1]
    matrix[..., 1, 0] = vector[..., 2]
    matrix[..., 1, 2] = -vector[..., 0]
    matrix[..., 2, 0] = -vector[..., 1]
    matrix[..., 2, 1] = vector[..., 0]
    return matrix


def vee(matrix: Array) -> Array:
    """The vector of the antisymmetric part, the inverse of `hat`: (..., 3, 3) -> (..., 3).

    Examples
    --------
    >>> sp.so3.vee(np.array([[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]])).tolist()
    [1.0, 2.0, 3.0]
    """
    return 0.5 * np.stack(
        [
            matrix[..., 2, 1] - matrix[..., 1, 2],
            matrix[..., 0, 2] - matrix[..., 2, 0],
            matrix[..., 1, 0] - matrix[..., 0, 1],
        ],
        axis=-1,
    )


def transpose(matrix: Array) -> Array:
    """The inverse of a rotation: (..., 3, 3) -> (..., 3, 3).

    Examples
    --------
    >>> turn = sp.so3.exp(np.array([0.0, 0.0, 0.3]))
    >>> print(f"{sp.so3.log(sp.so3.transpose(turn))[2]:.12f}")
    -0.300000000000
    """
    return np.swapaxes(matrix, -1, -2)


def apply(matrix: Array, vector: Array) -> Array:
    """Matrix times vector over leading axes: (..., 3, 3), (..., 3) -> (..., 3).

    Examples
    --------
    >>> quarter = sp.so3.exp(np.array([0.0, 0.0, np.pi / 2]))
    >>> (sp.so3.apply(quarter, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])).round(12) + 0.0).tolist()
    [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    """
    return (matrix @ vector[..., None])[..., 0]


def exp(rotation_vector: Array) -> Array:
    """The rotation by |v| radians about v: (..., 3) -> (..., 3, 3).

    Examples
    --------
    >>> quarter = sp.so3.exp(np.array([0.0, 0.0, np.pi / 2]))
    >>> print(quarter.round(12) + 0.0)
    [[ 0. -1.  0.]
     [ 1.  0.  0.]
     [ 0.  0.  1.]]
    """
    return matrix_from_quat(quat_from_rotation_vector(rotation_vector))


def log(matrix: Array) -> Array:
    """The rotation vector with angle in [0, pi]: (..., 3, 3) -> (..., 3) [rad].

    Through the quaternion, so accurate at every angle, half turns included.

    Examples
    --------
    >>> half = np.diag([1.0, -1.0, -1.0])
    >>> print(sp.so3.log(half).round(9))  # half a turn about x
    [3.14159265 0.         0.        ]
    """
    return rotation_vector_from_quat(quat_from_matrix(matrix))


def angle(matrix: Array) -> Array:
    """The angle of a rotation, in [0, pi]: (..., 3, 3) -> (...) [rad].

    Examples
    --------
    >>> round(float(sp.so3.angle(sp.so3.exp(np.array([0.0, 0.3, 0.4])))), 12)
    0.5
    """
    return np.linalg.norm(log(matrix), axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """The angle between unit vectors, accurate for small and for straight angles: (..., 3), (..., 3) -> (...) [rad].

    Examples
    --------
    >>> x = np.array([1.0, 0.0, 0.0])
    >>> float(sp.so3.angle_between(x, np.array([1.0, 1e-9, 0.0])))
    1e-09
    """
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def angle_about(matrix: Array, axis: Array) -> Array:
    """The angle in (-pi, pi] of the turn about a unit axis nearest to the rotation [rad].

    The twist of the swing-twist decomposition; exact when the rotation is a turn about `axis`.

    Examples
    --------
    >>> turn = sp.so3.exp(np.array([0.0, 0.0, 0.7]))
    >>> round(float(sp.so3.angle_about(turn, np.array([0.0, 0.0, -1.0]))), 12)
    -0.7
    """
    quat_xyzw = quat_from_matrix(matrix)
    twist = np.sum(quat_xyzw[..., :3] * axis, axis=-1)
    return wrap(2.0 * np.arctan2(twist, quat_xyzw[..., 3]))


def wrap(phase: Array | float) -> Array:
    """A phase modulo 2 pi in (-pi, pi] [rad].

    Examples
    --------
    >>> print(f"{sp.so3.wrap(7.0):.6f} = 7 - 2 pi")
    0.716815 = 7 - 2 pi
    """
    turn = 2.0 * np.pi
    phase = np.asarray(phase, dtype=float)
    inside = (phase > -np.pi) & (phase <= np.pi)
    if inside.all():
        return np.array(phase)
    return np.where(inside, phase, np.maximum(np.pi - np.mod(np.pi - phase, turn), np.nextafter(-np.pi, 0.0)))


def between(start: Array, end: Array) -> Array:
    """The rotation along the shortest great circle that takes the unit vector `start` to `end`.

    For opposite vectors the half turn through `middle`: (..., 3), (..., 3) -> (..., 3, 3).

    Examples
    --------
    >>> turn = sp.so3.between(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    >>> print(sp.so3.log(turn).round(9))  # a quarter turn about z
    [0.         0.         1.57079633]
    """
    start, end = np.broadcast_arrays(start, end)
    scalar = 1.0 + np.einsum("...i,...i->...", start, end)
    if scalar.min(initial=1.0) > FAR_FROM_OPPOSITE:
        return matrix_from_quat(normalised(np.concatenate([cross(start, end), scalar[..., None]], axis=-1)))
    half = middle(start, end)
    # Two turns of at most a quarter each, so that the plane is well determined also for nearly opposite ends.
    return _short_turn(half, end) @ _short_turn(start, half)


def _short_turn(start: Array, end: Array) -> Array:
    half = normalised(start + end)
    return matrix_from_quat(
        normalised(np.concatenate([cross(start, half), np.sum(start * half, axis=-1, keepdims=True)], axis=-1))
    )


def cross(first: Array, second: Array) -> Array:
    """The cross product of vectors along the last axis, in a third of the time that NumPy's takes.

    Examples
    --------
    >>> sp.so3.cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])).tolist()
    [0.0, 0.0, 2.0]
    """
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    result = np.empty(np.broadcast_shapes(first.shape, second.shape))
    result[..., 0] = b * z - c * y
    result[..., 1] = c * x - a * z
    result[..., 2] = a * y - b * x
    return result


def middle(start: Array, end: Array) -> Array:
    """The unit vector halfway between two; for opposite vectors one fixed perpendicular: (..., 3).

    Examples
    --------
    >>> sp.so3.middle(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])).round(6).tolist()
    [0.707107, 0.707107, 0.0]
    """
    total = start + end
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    opposite = length < OPPOSITE
    if not opposite.any():
        return total / length
    return np.where(opposite, perpendicular(start), total / np.where(opposite, 1.0, length))


def perpendicular(vector: Array) -> Array:
    """A unit vector at right angles to each vector: (..., 3) -> (..., 3).

    Examples
    --------
    >>> across = sp.so3.perpendicular(np.array([1.0, 2.0, 2.0]))
    >>> abs(float(across @ [1.0, 2.0, 2.0])) < 1e-14, round(float(np.linalg.norm(across)), 12)
    (True, 1.0)
    """
    least = np.argmin(np.abs(vector), axis=-1)
    across = np.cross(vector, np.eye(3)[least])
    return across / np.linalg.norm(across, axis=-1, keepdims=True)


def quat_from_rotation_vector(rotation_vector: Array) -> Array:
    """xyzw of the rotation by |v| about v: (..., 3) -> (..., 4).

    Examples
    --------
    >>> sp.so3.quat_from_rotation_vector(np.array([0.0, 0.0, np.pi / 3])).round(6).tolist()
    [0.0, 0.0, 0.5, 0.866025]
    """
    half = 0.5 * np.linalg.norm(rotation_vector, axis=-1, keepdims=True)
    return np.concatenate([0.5 * np.sinc(half / np.pi) * rotation_vector, np.cos(half)], axis=-1)


def rotation_vector_from_quat(quat_xyzw: Array) -> Array:
    """The rotation vector with angle in [0, pi] of unit quaternions: (..., 4) -> (..., 3) [rad].

    Examples
    --------
    >>> sp.so3.rotation_vector_from_quat(np.array([0.0, 0.0, 1.0, 0.0])).round(6).tolist()
    [0.0, 0.0, 3.141593]
    """
    quat = positive_scalar(quat_xyzw)
    sine = np.linalg.norm(quat[..., :3], axis=-1)
    small = sine < _SMALL_SINE
    scale = np.where(small, 2.0, 2.0 * np.arctan2(sine, quat[..., 3]) / np.where(small, 1.0, sine))
    return scale[..., None] * quat[..., :3]


def quat_from_matrix(matrix: Array) -> Array:
    """xyzw with w >= 0 of a rotation matrix: (..., 3, 3) -> (..., 4).

    The largest of the four components is found first and divides the others (Shepperd 1978), so no
    rotation is near a singularity.

    Examples
    --------
    >>> sp.so3.quat_from_matrix(np.diag([1.0, -1.0, -1.0])).round(12).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    m = matrix
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    squares = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], trace], axis=-1)
    largest = np.argmax(squares, axis=-1)
    rows = np.empty((*trace.shape, 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rows[..., i, i] = 1.0 + 2.0 * m[..., i, i] - trace
        rows[..., i, j] = rows[..., j, i] = m[..., i, j] + m[..., j, i]
        rows[..., i, 3] = rows[..., 3, i] = m[..., k, j] - m[..., j, k]
    rows[..., 3, 3] = 1.0 + trace
    chosen = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    return positive_scalar(normalised(chosen))


def quat_product(first: Array, second: Array) -> Array:
    """The quaternion of a product of rotations, xyzw: (..., 4), (..., 4) -> (..., 4).

    Examples
    --------
    >>> quarter = sp.so3.quat_from_rotation_vector(np.array([0.0, 0.0, np.pi / 2]))
    >>> sp.so3.quat_product(quarter, quarter).round(12).tolist()  # half a turn about z
    [0.0, 0.0, 1.0, 0.0]
    """
    v, w, a, b = first[..., :3], second[..., :3], first[..., 3:], second[..., 3:]
    vector = a * w + b * v + cross(v, w)
    return np.concatenate([vector, a * b - np.sum(v * w, axis=-1, keepdims=True)], axis=-1)


def quat_inverse(quat_xyzw: Array) -> Array:
    """The inverse of unit quaternions xyzw: (..., 4) -> (..., 4).

    Examples
    --------
    >>> print(sp.so3.quat_inverse(np.array([0.0, 0.0, 0.6, 0.8])) + 0.0)
    [ 0.   0.  -0.6  0.8]
    """
    return quat_xyzw * [-1.0, -1.0, -1.0, 1.0]


def positive_scalar(quat_xyzw: Array) -> Array:
    """q or -q, whichever has a scalar part that is not negative: (..., 4) -> (..., 4).

    Examples
    --------
    >>> print(sp.so3.positive_scalar(np.array([0.0, 0.0, 0.6, -0.8])) + 0.0)
    [ 0.   0.  -0.6  0.8]
    """
    return np.where(quat_xyzw[..., 3:] < 0.0, -quat_xyzw, quat_xyzw)


def normalised(vector: Array) -> Array:
    """Each vector divided by its length: (..., k) -> (..., k).

    Examples
    --------
    >>> sp.so3.normalised(np.array([0.0, 3.0, 4.0])).tolist()
    [0.0, 0.6, 0.8]
    """
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def matrix_from_quat(quat_xyzw: Array) -> Array:
    """The rotation matrix of a unit quaternion xyzw: (..., 4) -> (..., 3, 3).

    Examples
    --------
    >>> sp.so3.matrix_from_quat(np.array([1.0, 0.0, 0.0, 0.0])).tolist()  # half a turn about x
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    """
    x, y, z, w = quat_xyzw[..., 0], quat_xyzw[..., 1], quat_xyzw[..., 2], quat_xyzw[..., 3]
    matrix = np.empty((*x.shape, 3, 3))
    matrix[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    matrix[..., 0, 1] = 2.0 * (x * y - z * w)
    matrix[..., 0, 2] = 2.0 * (x * z + y * w)
    matrix[..., 1, 0] = 2.0 * (x * y + z * w)
    matrix[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    matrix[..., 1, 2] = 2.0 * (y * z - x * w)
    matrix[..., 2, 0] = 2.0 * (x * z - y * w)
    matrix[..., 2, 1] = 2.0 * (y * z + x * w)
    matrix[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return matrix


def mrp_from_quat(quat_xyzw: Array) -> Array:
    """Modified Rodrigues parameters e tan(angle/4) of a unit quaternion xyzw: (..., 4) -> (..., 3).

    A rotation has two sets. This is the one of length 1 or less, which jumps to its shadow -sigma/|sigma|^2 where a
    motion passes half a turn. For attitudes it is that of the turn from inertial axes to those of the base: `sigma_BN`.

    Source: Schaub and Junkins, Analytical Mechanics of Space Systems, section 3.6.

    Examples
    --------
    >>> sp.so3.mrp_from_quat(np.array([0.0, 0.0, -1.0, 0.0])).tolist()  # half a turn about z
    [0.0, 0.0, -1.0]
    """
    whole = np.where(quat_xyzw[..., 3:] < 0.0, -quat_xyzw, quat_xyzw)
    return whole[..., :3] / (1.0 + whole[..., 3:])


def quat_from_mrp(mrp: Array) -> Array:
    """xyzw with w >= 0 of modified Rodrigues parameters, of either set: (..., 3) -> (..., 4).

    Examples
    --------
    >>> sp.so3.quat_from_mrp(np.array([0.0, 0.0, 0.5])).tolist()
    [0.0, 0.0, 0.8, 0.6]
    """
    square = np.sum(mrp * mrp, axis=-1, keepdims=True)
    return positive_scalar(np.concatenate([2.0 * mrp, 1.0 - square], axis=-1) / (1.0 + square))


def matrix_from_euler(angles: Array, axes: str) -> Array:
    """Turns about coordinate axes, each about its axis as those before have turned it: (..., k) -> (..., 3, 3).

    Parameters
    ----------
    angles : (..., k) in the order of the turns [rad]
    axes : k letters x, y or z; (a, b, c) about "zyx" is R_z(a) R_y(b) R_x(c)

    Examples
    --------
    >>> turned = sp.so3.matrix_from_euler(np.array([0.5 * np.pi, 0.5 * np.pi]), "zx")
    >>> turned.round(9).astype(int).tolist()  # columns: where x, y and z go
    [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    """
    turned = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for k, axis in enumerate(axes):
        turned = turned @ exp(angles[..., k, None] * np.eye(3)["xyz".index(axis)])
    return turned


def turn_of(quat_xyzw: Array, rate: Array) -> Array:
    """The angular velocity, in body axes, of a unit quaternion with this rate: (..., 4), (..., 4) -> (..., 3).

    Examples
    --------
    >>> at_rest, rate = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.0, 0.0, 0.25, 0.0])
    >>> sp.so3.turn_of(at_rest, rate).tolist()  # twice the rate of the quaternion
    [0.0, 0.0, 0.5]
    """
    vector, scalar = quat_xyzw[..., :3], quat_xyzw[..., 3:]
    return 2.0 * (scalar * rate[..., :3] - rate[..., 3:] * vector - np.cross(vector, rate[..., :3]))


def rotation_argument(value: object, name: str) -> Array:
    """A user's rotation matrices, checked and made orthogonal to rounding: (..., 3, 3).

    Raises
    ------
    ShapeError
        If the shape is wrong, or a matrix is further than 1e-6 from a proper rotation.

    Examples
    --------
    >>> sp.so3.rotation_argument(np.eye(3), "attitude").tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    matrix = finite_array(value, name, (3, 3))  # type: ignore[arg-type]
    defect = float(np.max(np.abs(transpose(matrix) @ matrix - np.eye(3)), initial=0.0))
    if defect > _ORTHOGONAL:
        raise ShapeError(f"{name}: not a rotation, R^T R differs from the identity by {defect:.2g}")
    if np.any(np.linalg.det(matrix) < 0.0):
        raise ShapeError(f"{name}: a reflection (determinant -1), not a rotation")
    return orthonormalised(matrix)


def orthonormalised(matrix: Array) -> Array:
    """The nearest rotation to a matrix already within 1e-6 of one (two Newton-Schulz steps).

    Examples
    --------
    >>> rough = sp.so3.exp(np.array([0.1, 0.2, 0.3])) + 1e-7
    >>> fine = sp.so3.orthonormalised(rough)
    >>> print(f"{np.linalg.det(rough):.6f}, {np.linalg.det(fine):.12f}")
    1.000000, 1.000000000000
    """
    for _ in range(2):
        matrix = 0.5 * matrix @ (3.0 * np.eye(3) - transpose(matrix) @ matrix)
    return matrix


def quat_argument(value: object, name: str) -> Array:
    """Rotation matrix of a user's xyzw quaternion: (..., 4) -> (..., 3, 3).

    Raises
    ------
    ShapeError
        If its length differs from 1 by more than 1e-3: it is probably not a quaternion.

    Examples
    --------
    >>> print(sp.so3.quat_argument([0.0, 0.0, 1.0, 0.0], "attitude"))
    [[-1.  0.  0.]
     [ 0. -1.  0.]
     [ 0.  0.  1.]]
    """
    quat_xyzw = finite_array(value, name, (4,))  # type: ignore[arg-type]
    length = np.linalg.norm(quat_xyzw, axis=-1)
    worst = float(np.max(np.abs(length - 1.0), initial=0.0))
    if worst > _UNIT_QUATERNION:
        raise ShapeError(
            f"{name}: a quaternion x y z w of length 1 is needed, its length differs by {worst:.3g}; 0 0 0 1 is no turn"
        )
    return matrix_from_quat(normalised(quat_xyzw))
