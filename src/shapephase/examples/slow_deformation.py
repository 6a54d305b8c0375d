"""Slow deformations, and how near their phase is to that of a rigid body.

Source: Cabrera 2006, remark 4.6; theory.md F5. The orders are derived here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from .. import so3
from ..arguments import check_choice, check_object, moments_argument
from ..arrays import Array
from ..errors import ShapeError, TrajectoryError
from ..letters import value_text
from ..reconstruction.reconstruction import Motion
from ..rigid_body.euler_top import EulerTop
from ._closed_form_motions import Example, diagonal, positive

_LAWS: Mapping[str, Callable[[Array], Array]] = {
    "even": lambda s: s,
    "periodic": lambda s: np.sin(np.pi * s) ** 2,
}


def slow_antenna(
    rate: float = 1e-3,
    law: str = "even",
    *,
    moments: ArrayLike = (1.0, 1.5, 2.0),
    expansion: float = 0.2,
    momentum: ArrayLike = (0.4, 0.3, 3.2),
) -> Example:
    """F5: the largest moment grows slowly, I_3(t) = I_3 (1 + expansion f(rate t)); `rigid` is the body at the start.

    With f(s) = s ("even") the phase of the first loop of Pi about axis 3 is that of the rigid body up to a term of
    first order in the rate: Pi does not come back but spirals, and the moments that count are those half a loop later.

    With f(s) = sin²(pi s) ("periodic"), 1/rate being its period, the deformation starts from its turning point. Within
    a loop it is of second order in the rate, and so is the difference of the phases.

    It lasts for one and a quarter rigid periods.

    Source: Cabrera 2006, remark 4.6, with the scale corrected (C-E12); orders derived here; theory.md F5.

    Parameters
    ----------
    rate : above 0 [1/s]
    law : "even" or "periodic"
    moments : (3,), ascending [kg m^2]
    expansion : relative increase of I_3 where f is 1, above 0
    momentum : (3,), on an orbit about axis 3

    Examples
    --------
    >>> example = sp.examples.slow_antenna(1e-3)
    >>> print(f"{example.rigid.montgomery_phase:.6f} rad")  # of the body as it was at the start
    11.187497 rad
    """
    check_choice(law, "law", _LAWS)
    slow, start = positive(rate, "rate", "1/s"), moments_argument(moments)
    top = EulerTop.principal(start, momentum)
    if top.orbit.circled != 2:
        raise ShapeError(f"momentum: Pi must circle axis 3, that of the largest moment, got {top.momentum} kg m^2/s")
    increase = positive(expansion, "expansion", "1") * start[2] * np.array([0.0, 0.0, 1.0])
    deformation = diagonal(lambda t: start + increase * _LAWS[law](slow * t)[:, None], 1.25 * top.period, (), "error")
    return Example(deformation=deformation, momentum=top.momentum, rigid=top)


def first_loop(motion: Motion, axis: int = 3) -> float:
    """The time at which Pi has first gone once round a body axis, back to its meridian [s].

    `arc_phases(motion, [0, this], "base")` is the phase of that loop, closed along the meridian.

    Parameters
    ----------
    axis : 1, 2 or 3, which Pi circles in one sense throughout

    Raises
    ------
    ShapeError
        If the motion is a batch, or the axis is none of these.
    TrajectoryError
        If Pi does not go once round the axis during the motion.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 1.5, 2.0], [0.4, 0.3, 3.2])
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.5, 2.0]), 2.0 * top.period), [0.4, 0.3, 3.2])
    >>> print(f"{sp.examples.first_loop(motion) / top.period:.6f} periods")
    1.000000 periods
    """
    check_object(motion, "Motion", "motion")
    if motion.batch or not isinstance(axis, int | np.integer) or axis not in (1, 2, 3):
        raise ShapeError(
            f"one motion and axis 1, 2 or 3 are needed, got a batch {motion.batch} and axis {value_text(axis)}"
        )
    across = np.array([axis, axis + 1]) % 3

    def azimuth(times: Array) -> Array:
        return np.arctan2(*np.moveaxis(motion.body_momentum(times)[..., across[::-1]], -1, 0))

    times = motion.solution.times
    turned = np.unwrap(azimuth(times))
    turned -= turned[0]
    full_turns = np.flatnonzero(np.abs(turned) >= 2.0 * np.pi)
    if not len(full_turns):
        degrees = np.degrees(np.abs(turned).max())
        raise TrajectoryError(f"Pi goes only {degrees:.6g} degrees round axis {axis} in this motion, not once round")
    last = int(full_turns[0])
    start = azimuth(times[0])
    bracket = (float(times[last - 1]), float(times[last]))
    return float(
        root_scalar(lambda t: float(so3.wrap(azimuth(np.asarray(t)) - start)), bracket=bracket, xtol=1e-15).root
    )
