"""Which way is up for a body, in whose axes its pictures stand."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...body.body import Body
from ...body.link_motions import link_motions
from ...errors import unknown_name

AXES = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}
# Distance of a part from the mirror image of another with the same mass, of the body's size: modelling is not exact.
_ALIKE = 0.02
# Share of the mass that may lie otherwise: some models have a small part on the wrong side.
_ASTRAY = 0.03


def up_axis(up: str | None, body: Body | None) -> Array:
    """The named axis: (3,); without a name z, or y for a body that is drawn with y up.

    Robots and most bodies have x in front and z up, so that left and right are mirror images across y; models of
    people from biomechanics have y up, and left and right across z.

    Raises
    ------
    UnknownNameError
        If there is no such axis.
    """
    if up is not None:
        if not isinstance(up, str) or up not in AXES:
            raise unknown_name("axis", up, AXES)
        return np.array(AXES[up])
    y_up = body is not None and body.n_shape > 0 and _mirrored(body, 2) and not _mirrored(body, 1)
    return np.array(AXES["y" if y_up else "z"])


def _mirrored(body: Body, axis: int) -> bool:
    """Whether the parts of a neutral body lie as their mirror images across an axis do."""
    shape = body.shape()[None]
    places = link_motions(body.chain, shape, np.zeros_like(shape)).places[0]
    masses = body.chain.masses
    # Frames between the joints of one place carry no mass.
    heavy = masses > 0.0
    places, masses = places[heavy], masses[heavy]
    images = places * np.where(np.arange(3) == axis, -1.0, 1.0)
    apart = np.linalg.norm(places[:, None] - images, axis=-1) / max(float(np.ptp(places, axis=0).max()), 1e-300)
    alike = np.abs(masses[:, None] - masses) <= _ALIKE * (masses[:, None] + masses)
    astray = ~np.any(alike & (apart <= _ALIKE), axis=1)
    return bool(masses[astray].sum() <= _ASTRAY * masses.sum())
