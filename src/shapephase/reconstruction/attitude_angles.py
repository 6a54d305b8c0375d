"""Attitudes in time as three numbers that go on without a jump: rotation vectors and Euler angles."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array
from ..errors import unknown_name
from ..warning_filters import quiet

_AXES = ("x", "y", "z")
_TURN = 2.0 * np.pi
# [rad] Below this length a rotation vector has no direction of its own.
_NO_DIRECTION = 1e-12


def continued_rotation_vectors(attitudes: Array) -> Array:
    """Rotation vectors of attitudes in their order, each the nearest to the one before: (N, 3, 3) -> (N, 3) [rad].

    Those of one rotation are on its axis, whole turns apart.
    """
    found = so3.log(attitudes)
    lengths = np.linalg.norm(found, axis=-1)
    for k in range(1, len(found)):
        before = found[k - 1]
        if lengths[k] < _NO_DIRECTION:
            # Whole turns about any axis: the one that went before.
            size = float(np.linalg.norm(before))
            turns = np.rint(size / _TURN)
            found[k] = before / size * turns * _TURN if turns else found[k]
            continue
        axis = found[k] / lengths[k]
        found[k] += axis * _TURN * np.rint((before @ axis - lengths[k]) / _TURN)
    return found


def euler_angles(attitudes: Array, sequence: str) -> Array:
    """Euler angles of attitudes in their order, each the nearest to those before: (N, 3, 3) -> (N, 3) [rad].

    Parameters
    ----------
    sequence : as for `Motion.euler_angles`

    Raises
    ------
    UnknownNameError
        For another sequence.
    """
    check_sequence(sequence)
    # Loaded when needed: it is a large part of SciPy.
    from scipy.spatial.transform import Rotation

    # Where the gimbals lock the third angle is taken to be zero, and what follows is continued from there.
    with quiet("Gimbal lock", UserWarning):
        found = Rotation.from_matrix(attitudes).as_euler(sequence)
    proper = sequence[0] == sequence[2]
    for k in range(1, len(found)):
        other = np.array([found[k, 0] + np.pi, -found[k, 1] if proper else np.pi - found[k, 1], found[k, 2] + np.pi])
        both = np.stack([found[k], other])
        both += _TURN * np.rint((found[k - 1] - both) / _TURN)
        found[k] = both[np.argmin(np.abs(both - found[k - 1]).sum(axis=-1))]
    return found


def somersault_tilt_twist(attitudes: Array, lateral: str, longitudinal: str) -> Array:
    """Somersault, tilt and twist of attitudes in their order: (N, 3, 3) -> (N, 3) [rad].

    Parameters
    ----------
    lateral, longitudinal : "x", "y" or "z"

    Raises
    ------
    UnknownNameError
        For other axes, or twice the same.
    """
    for name, axis in (("lateral axis", lateral), ("longitudinal axis", longitudinal)):
        if not isinstance(axis, str) or axis not in _AXES:
            raise unknown_name(name, axis, _AXES)
    if lateral == longitudinal:
        raise unknown_name("longitudinal axis", longitudinal, [axis for axis in _AXES if axis != lateral])
    (frontal,) = {*_AXES} - {lateral, longitudinal}
    return euler_angles(attitudes, f"{lateral}{frontal}{longitudinal}".upper())


def check_sequence(sequence: str) -> None:
    """Raise UnknownNameError for what is no sequence of Euler angles."""
    axes = sequence.lower() if isinstance(sequence, str) else ""
    cased = isinstance(sequence, str) and sequence in (sequence.lower(), sequence.upper())
    valid = cased and len(axes) == 3 and {*axes} <= {*_AXES} and axes[0] != axes[1] != axes[2]
    if not valid:
        kinds = [a + b + c for a in "XYZ" for b in "XYZ" for c in "XYZ" if a != b != c]
        raise unknown_name("sequence of Euler angles", str(sequence), [*kinds, *map(str.lower, kinds)])
