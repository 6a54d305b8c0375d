"""External torques about the centre of mass."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import breaks_argument, check_choice, check_function
from ..arrays import Array
from ..display import frozen
from ..errors import ShapeError
from ..letters import value_text

AXES = ("body", "space")


@frozen(kw_only=True)
class TorqueState:
    """State of the body at one time, the argument of a torque function.

    Attributes
    ----------
    time : [s]
    attitude : (3, 3) base axes to inertial axes
    rate : (3,) angular velocity of the base, base axes [rad/s]
    shape : (n,) joint coordinates [rad or m]; empty where the deformation has no joints
    inertia : (3, 3) locked, base axes [kg m^2]
    momentum : (3,) of the body about its centre of mass, base axes [kg m^2/s]

    Examples
    --------
    >>> def drag(state):
    ...     return -0.5 * state.rate
    >>> top = sp.rigid(np.diag([1.0, 1.0, 2.0]), 2.0)
    >>> print(sp.reconstruct(top, [0.0, 0.0, 2.0], torque=drag).momentum(2.0).round(9))  # 2 exp(-0.5 2/2)
    [0.         0.         1.21306132]
    """

    time: float
    attitude: Array
    rate: Array
    shape: Array
    inertia: Array
    momentum: Array


@frozen
class ExternalTorque:
    """External torque about the centre of mass.

    Attributes
    ----------
    function : `TorqueState` -> (3,) [N m], smooth between the breaks
    axes : "body", those of the base, or "space", inertial ones
    breaks : interior times where it jumps, such as the ends of a thruster's pulse [s]. The torque is sampled along the
        motion at times 1/4,000 of the duration apart: a pulse narrower than 1/2,000 needs its ends given here

    Examples
    --------
    >>> pulse = sp.ExternalTorque(lambda state: [0.0, 0.0, 0.5 * (0.3 < state.time < 0.7)], breaks=[0.3, 0.7])
    >>> motion = sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0], torque=pulse)
    >>> print(motion.momentum(1.0).round(9))
    [0.  0.  1.2]
    """

    function: Callable[[TorqueState], ArrayLike]
    axes: str = "body"
    breaks: ArrayLike = ()

    def __post_init__(self) -> None:
        """Check the arguments. Raises ShapeError, UnknownNameError."""
        check_function(self.function, "torque", "a function of a TorqueState that gives a torque (3,)")
        check_choice(self.axes, "axes", AXES)

    def edges(self, duration: float) -> Array:
        """Return the breaks with both ends: (M,) [s]. Raises TrajectoryError for one outside the interval."""
        return breaks_argument(self.breaks, duration)

    def in_base_axes(self, state: TorqueState) -> Array:
        """Return the torque in base axes: (3,) [N m]. Raises ShapeError where the function returns anything else."""
        given = np.asarray(self.function(state), dtype=np.float64)
        if given.shape != (3,) or not np.isfinite(given).all():
            raise ShapeError(
                f"torque: three finite numbers [N m] are needed, at t = {state.time:.9g} s it gave {value_text(given)}"
            )
        return given if self.axes == "body" else state.attitude.T @ given
