"""How fast the wheels of a moving body spin."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, times_argument
from ..arrays import Array
from ..deformation.rotors import RotorDescription
from ..errors import WrongObjectError
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion


def wheel_speeds(motion: Motion | ForcedMotion, t: ArrayLike) -> Array:
    """The speeds of wheels on their axles, in the order in which `articulated` was given them, speeds held last.

    Parameters
    ----------
    motion : of a deformation made by `articulated(..., rotors=, rotor_speeds=)`
    t : times (...) [s]

    Returns
    -------
    batch + t.shape + (wheels,) [rad/s]

    Raises
    ------
    WrongObjectError
        If the body has no such wheels, or is seen in a gauge.

    Notes
    -----
    Equation :eq:`routh` of the documentation.

    Examples
    --------
    >>> satellite = sp.load_body("satellite")
    >>> rest = [name for name in satellite.joint_names if name != "wheel_spin"]
    >>> still = sp.ShapePath.waypoints([0.0, 1.0], np.zeros((2, len(rest))), joint_names=rest)
    >>> deformation = sp.articulated(satellite, still, rotor_speeds={"wheel_spin": 100.0})
    >>> print(sp.dynamics.wheel_speeds(sp.reconstruct(deformation, [0.0, 0.0, 1.0]), 0.5))
    [100.]
    """
    if not isinstance(motion, ForcedMotion):
        check_object(motion, "Motion", "motion")
    description = motion.deformation.description
    if not isinstance(description, RotorDescription):
        raise WrongObjectError(
            "motion: the speeds of wheels need a body with wheels, made by `articulated(..., rotors=)`; this is: "
            f"{motion.deformation.label}"
        )
    times = times_argument(t, motion.duration)
    omega = motion.angular_velocity(times).reshape(-1, times.size, 3)
    found = description.spins(times.ravel(), omega)
    return np.reshape(found, (*motion.batch, *times.shape, len(description.rotors)))
