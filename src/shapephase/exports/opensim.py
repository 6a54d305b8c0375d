"""Motions for OpenSim: a file of coordinates, those of the pelvis among them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_file_name, check_keywords
from ..arrays import Array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_no_balls
from ..errors import ShapeError
from ..files import write_whole
from ..reconstruction.attitude_angles import euler_angles
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._whole_motion import Fall, check_ending, checked_times, whole_motion

# Coordinates of the pelvis in OpenSim's models of walking: angles about z, x and y, one after the other; places.
_ANGLES = (("pelvis_tilt", "pelvis_list", "pelvis_rotation"), "zxy")
_PLACES = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
# From a base with x forward, y left, z up to a pelvis with x forward, y up, z right.
_TO_PELVIS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def write_opensim_motion(
    motion: Motion | ForcedMotion,
    path: str | os.PathLike[str],
    times: ArrayLike | None = None,
    *,
    base_axes: ArrayLike | None = None,
    **fall: ArrayLike,
) -> None:
    """Write base and joints as coordinates of OpenSim (`.mot`, `.sto`), the pelvis by three angles and three places.

    For a body from an OpenSim model, the angles and places are those of its file. For another they have the names that
    models of walking have, and turn about z, x and y of the ground, one after the other. The ground's axes are the
    inertial axes of the motion; in OpenSim y is up. Places count from where the model has its joint with the ground.

    Parameters
    ----------
    motion : of an articulated body, in any gauge
    times : (N,) [s]; None: 201 even times
    base_axes : (3, 3) base axes to those of the pelvis; None: the same for a body from an OpenSim model, else from x
        forward, y left, z up to OpenSim's x forward, y up, z right, as `read_recorded_motion` takes it
    fall : start, velocity, gravity as in `Motion.base_position`

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.exports.write_opensim_motion(motion, "turn.mot")
    >>> print(sp.read_recorded_motion("turn.mot", cat).base_attitude.shape)
    (201, 3, 3)
    """
    check_file_name(path, "path")
    check_keywords(fall, write_opensim_motion)
    where = Path(path)
    check_ending(where, "OpenSim's motions", ".mot", ".sto")
    whole = whole_motion(motion, checked_times(motion, times), Fall.of(**fall))
    check_no_balls(whole.body.chain.follows, "motions of OpenSim need")
    angles, order = whole.body.base_angles or _ANGLES
    turned = whole.attitude @ so3.transpose(_axes(whole.body, base_axes))
    names = ["time", *angles, *(whole.body.base_slides or _PLACES), *whole.body.joint_names]
    columns = [whole.times[:, None], euler_angles(turned, order.upper()), whole.position, whole.shapes]
    rows = np.hstack(columns).tolist()
    lines = [
        where.stem,
        "version=1",
        f"nRows={len(rows)}",
        f"nColumns={len(names)}",
        # Degrees would be taken for radians where OpenSim counts an angle neither as one nor as a length.
        "inDegrees=no",
        "endheader",
        "\t".join(names),
        *("\t".join(map(repr, row)) for row in rows),
        "",
    ]
    write_whole(where, lambda stream: stream.write("\n".join(lines).encode()))


def _axes(body: Body, given: ArrayLike | None) -> Array:
    if given is None:
        return _TO_PELVIS if body.base_angles is None else np.eye(3)
    rotation = so3.rotation_argument(given, "base_axes")
    if rotation.shape != (3, 3):
        raise ShapeError(f"base_axes: one rotation (3, 3) is needed, got shape {rotation.shape}")
    return rotation
