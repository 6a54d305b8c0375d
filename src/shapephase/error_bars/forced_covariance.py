"""Error bars of a motion under a torque that is a function of time: of attitude and momentum at the end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..display import frozen
from ..errors import WrongObjectError
from ..reconstruction.external_torque import TorqueState
from ..reconstruction.forced_motion import ForcedMotion
from ..shape_space.path_samples import path_samples
from ._along_motion import ForcedAlong, forced_along
from ._propagation import angle_bar, carried
from .error_sources import Inputs, by_relative_errors
from .result_derivatives import described_by

_TURN = so3.exp(np.array([0.7, -0.4, 0.5]))  # to another attitude, at which a torque in time is what it was
_FACTOR = 1.3  # of rates, momenta and inertias there


@frozen
class ForcedUncertainty:
    """Error bars of a motion under a torque, to first order. Made by `uncertainty`.

    The final attitude R may be exp(hat(e)) R, where e has mean zero and the covariance that is given, inertial axes.
    The shape's holonomy does not depend on the torque: its bars are those of the motion without one.

    Attributes
    ----------
    state : (6, 6) covariance of the turn e [rad^2] and of the final momentum [(kg m^2/s)^2], inertial axes
    total_rotation : (3, 3) covariance of the rotation from the start to the end [rad^2]
    total_angle : standard deviation of its angle [rad], near 0 and 180 degrees as in `Uncertainty`

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> push = sp.ExternalTorque(lambda state: [0.0, 0.0, 0.01], axes="space")
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005], torque=push)
    >>> print(np.sqrt(np.diag(sp.uncertainty(motion, momentum=1e-5).final_momentum)))
    [1.e-05 1.e-05 1.e-05]
    """

    state: Array
    total_rotation: Array
    total_angle: float

    @property
    def final_attitude(self) -> Array:
        """Covariance of the final attitude: (3, 3) [rad^2]."""
        return self.state[:3, :3]

    @property
    def final_momentum(self) -> Array:
        """Covariance of the final momentum: (3, 3) [(kg m^2/s)^2]."""
        return self.state[3:, 3:]


def forced_uncertainty(motion: ForcedMotion, inputs: Inputs) -> ForcedUncertainty:
    """Error bars from checked inputs. Raises WrongObjectError for a torque that depends on more than the time."""
    along = forced_along(motion, described_by(motion).route)
    _check_in_time(motion, along)
    closure = np.eye(3) if motion.deformation.closure is None else motion.deformation.closure
    total = motion.final_attitude @ closure @ motion.initial_attitude.T
    state, of_total = np.zeros((6, 6)), np.zeros((3, 3))
    for derivative, turned_start, covariance in _causes(motion, along, inputs):
        state += carried(derivative, covariance)
        of_total += carried(derivative[:3] - total @ turned_start, covariance)
    return ForcedUncertainty(state, of_total, angle_bar(total, of_total))


def _causes(motion: ForcedMotion, along: ForcedAlong, inputs: Inputs) -> Iterator[tuple[Array, Array, Array]]:
    """Derivatives of turn and momentum at the end, (6, m), turns of the start, (3, m), and covariances."""
    described = described_by(motion)
    body, rows, start = (
        described.at(along.times, along.shapes, along.rates),
        along.rows[:, None],
        motion.initial_attitude,
    )
    spins = along.spins[:, None]

    def unmoved(derivative: Array, covariance: Array) -> tuple[Array, Array, Array]:
        return derivative, np.zeros((3, derivative.shape[1])), covariance

    if inputs.samples is not None:
        samples = path_samples(described.path)
        by_knots = body.by_knots(samples, spins, rows)
        for rule in samples.rules:
            yield unmoved(rule(by_knots), inputs.samples)
        # The bias is one unknown of variance one, times its estimate.
        yield unmoved(by_knots @ samples.bias[:, None], np.ones(1))
    if inputs.links is not None:
        by_parameters = body.by_inertias(spins, rows)
        yield unmoved(by_relative_errors(described.body, described.rotors, by_parameters), inputs.links)
    if inputs.rotors is not None:
        yield unmoved(body.wheels.by_values(rows), inputs.rotors)
    at_start = along.adjoint_at_start.T
    by_start = np.hstack([at_start[:, :3] @ start, at_start[:, 3:]])
    if inputs.momentum is not None:
        yield unmoved(by_start[:, 3:], inputs.momentum)
    if inputs.attitude is not None:
        yield by_start[:, :3], start, inputs.attitude
    if inputs.start is not None:
        yield by_start, np.hstack([start, np.zeros((3, 3))]), inputs.start


def _check_in_time(motion: ForcedMotion, along: ForcedAlong) -> None:
    """Raise WrongObjectError for a torque that is another one in another state at the same time."""
    law = motion.torque_law
    tensors = np.linalg.inv(along.inverse)
    momenta = so3.apply(so3.transpose(along.attitudes), along.momenta)
    given = zip(along.times.tolist(), along.attitudes, along.spins, along.shapes, tensors, momenta, strict=True)
    for time, attitude, rate, shape, inertia, momentum in given:
        here = TorqueState(time=time, attitude=attitude, rate=rate, shape=shape, inertia=inertia, momentum=momentum)
        there = replace(
            here,
            attitude=_TURN @ attitude,
            rate=_FACTOR * rate + 1.0,
            shape=shape + 0.1,
            inertia=_FACTOR * inertia,
            momentum=_FACTOR * momentum + 1.0,
        )
        if not np.array_equal(law.function(here), law.function(there)):
            raise WrongObjectError(
                f"torque: error bars need a torque that is a function of the time alone; at t = {time:.6g} s it "
                "changes with the state: draw inputs and reconstruct each motion, or give the torque in time"
            )
