"""Wheels of a moving body: their speeds and accelerations on the axles, and the angles that they turn by."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, times_argument
from ..arrays import Array
from ..body.inverse_dynamics import falling_efforts
from ..chebyshev import PiecewiseChebyshev, inside, nodes_on, values_to_coefficients
from ..deformation.rotors import RotorDescription
from ..errors import AccuracyNotReached, ShapeError, WrongObjectError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..refinement import halved, settled

_DEGREE = 8  # of the series of speeds on a panel
_PANELS = 256  # at first, for the angles of wheels: as dense as the steps of the solution
_MOST_HALVINGS = 9  # of these panels: 131,000


def ungauged(motion: Motion | ForcedMotion) -> object:
    """Description of a motion's deformation as it was made, before any gauge."""
    description: object = motion.deformation.description
    while hasattr(description, "original"):
        description = description.original  # pyright: ignore[reportAttributeAccessIssue]
    return description


def wheels_of(motion: Motion | ForcedMotion) -> RotorDescription | None:
    """Description of a body with wheels, in any gauge; None for another motion."""
    description = ungauged(motion)
    return description if isinstance(description, RotorDescription) else None


def wheel_columns(wheels: RotorDescription) -> list[int]:
    """Columns of the wheels among the joints of the body."""
    return [wheels.platform.joint_index(rotor.joint) for rotor in wheels.rotors]


def solution_times(motion: Motion | ForcedMotion) -> Array:
    """Steps of a motion's solution and its breaks, ascending from 0 to its end [s]."""
    breaks = motion.breaks if isinstance(motion, ForcedMotion) else motion.deformation.breaks
    return np.union1d(motion.solution.times, breaks)


def base_momenta(motion: Motion | ForcedMotion, times: Array) -> Array:
    """Angular momenta in base axes, in whatever gauge the motion is: (N,) -> (B, N, 3) [kg m^2/s]."""
    momenta = so3.apply(so3.transpose(motion.deformation.frame(times)), motion.body_momentum(times))
    return momenta.reshape(-1, len(times), 3)


def with_wheels(
    wheels: RotorDescription, times: Array, momenta: Array, rates: Array, accelerations: Array
) -> tuple[Array, Array]:
    """Rates of the joints with the speeds of wheels, and accelerations with those of held speeds: (N, n), (N, n).

    momenta : (B, N, 3) in base axes [kg m^2/s]
    rates, accelerations : (N, n) along the path, where wheels rest

    Raises ShapeError for a batch whose wheels have other speeds in each motion.
    """
    if len(momenta) > 1 and any(rotor.is_momentum for rotor in wheels.rotors):
        raise ShapeError(
            f"wheels of given momentum have other speeds in each of {len(momenta)} motions; reconstruct one"
        )
    rates, accelerations = rates.copy(), accelerations.copy()
    rates[:, wheel_columns(wheels)] = _speeds(wheels, times, momenta)[0]
    for rotor in wheels.rotors:
        if not rotor.is_momentum:
            accelerations[:, wheels.platform.joint_index(rotor.joint)] = rotor.at(times)[1]
    return rates, accelerations


def with_free_wheels(
    wheels: RotorDescription,
    times: Array,
    joints: tuple[Array, Array, Array],
    base: tuple[Array, Array],
    matrix: Array,
    inverse: Array,
) -> tuple[Array, Array]:
    """Accelerations of the joints and of the base with those of wheels of given momentum: (N, n), (B, N, 3).

    The torque about such an axle, which is linear in the accelerations, is the rate of the momentum.

    joints : (N, n) shapes, rates, and accelerations that are zero for these wheels
    base : (B, N, 3) angular velocities and their rates by these, B = 1 where there are such wheels
    matrix, inverse : (N, 3, n) momentum by rates of the joints, (N, 3, 3) inverse of the locked inertia
    """
    free = [rotor for rotor in wheels.rotors if rotor.is_momentum]
    if not free:
        return joints[2], base[1]
    columns = [wheels.platform.joint_index(rotor.joint) for rotor in free]
    torques = falling_efforts(wheels.platform, *joints, base[0][0], base[1][0])[0][:, columns]
    carried = matrix[:, :, columns]
    turned = inverse @ carried
    moments = np.diag([rotor.inertia for rotor in free]) - np.swapaxes(carried, 1, 2) @ turned
    given = np.stack([rotor.at(times)[1] for rotor in free], axis=-1)
    spun = np.linalg.solve(moments, (given - torques)[..., None])
    accelerations = joints[2].copy()
    accelerations[:, columns] = spun[..., 0]
    return accelerations, base[1] - (turned @ spun)[..., 0]


def wheel_speeds(motion: Motion | ForcedMotion, t: ArrayLike) -> Array:
    """The speeds of wheels on their axles, in the order in which `articulated` was given them, speeds held last.

    Equation :eq:`routh` of the documentation.

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
        If the body has no such wheels.

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
    wheels = wheels_of(motion)
    if wheels is None:
        raise WrongObjectError(
            "motion: the speeds of wheels need a body with wheels, made by `articulated(..., rotors=)`; this is: "
            f"{motion.deformation.label}"
        )
    times = times_argument(t, motion.duration)
    speeds = _speeds(wheels, times.ravel(), base_momenta(motion, times.ravel()))
    return np.reshape(speeds, (*motion.batch, *times.shape, len(wheels.rotors)))


def wheel_angles(motion: Motion | ForcedMotion, wheels: RotorDescription, times: Array) -> Array:
    """Angles that wheels have turned by since the start: (N,) -> (N, wheels) [rad].

    Integrals of series through the speeds, on ever finer panels until they change by less than the motion's tolerance.
    Raises AccuracyNotReached.
    """
    edges = solution_times(motion)
    edges = np.append(edges[: -1 : max(1, len(edges) // _PANELS)], edges[-1])

    def finer() -> Iterator[PiecewiseChebyshev]:
        for panels in halved(edges, _MOST_HALVINGS):
            at = nodes_on(*inside(panels[:-1], panels[1:]), _DEGREE)
            speeds = _speeds(wheels, at.ravel(), base_momenta(motion, at.ravel()))[0]
            slopes = values_to_coefficients(_DEGREE) @ speeds.reshape(*at.shape, -1)
            series = chebyshev.chebint(slopes, lbnd=-1.0, axis=1) * (0.5 * np.diff(panels))[:, None, None]
            # A series from -1 on ends at the sum of its coefficients.
            series[1:, 0] += np.cumsum(series[:-1].sum(axis=1), axis=0)
            yield PiecewiseChebyshev(panels, series)

    angles = settled(finer(), lambda last, finest: float(np.abs(last(edges) - finest(edges)).max()), motion.tolerance)
    if angles is None:
        raise AccuracyNotReached(
            f"angles of wheels do not settle within {motion.tolerance:g} rad; loosen the tolerance"
        )
    return angles(times)


def _speeds(wheels: RotorDescription, times: Array, momenta: Array) -> Array:
    """Speeds of wheels on their axles by the momenta in base axes: (N,), (B, N, 3) -> (B, N, wheels) [rad/s]."""
    inertia, internal = wheels.sample(times)
    speeds = wheels.spins(times, so3.apply(inverse_inertia(inertia, times), momenta - internal))
    return np.broadcast_to(speeds, (*momenta.shape[:-1], len(wheels.rotors)))
