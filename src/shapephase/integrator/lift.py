"""The rotation without momentum, on the samples of a motion with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ._error_propagator import rounding_error
from ._last_terms import Perturbed
from ._step_control import StepRequirements, even_steps
from ._step_loop import integrate_steps_at_rest
from .interpolant import Interpolant
from .stepped import SteppedRotation

# Of the motion's error estimate: what the steps of its lift are to err by at most.
_SHARE = 0.05
# [rad] the same where the motion is as good as exact.
_ROUNDING = 1e-14
# Times that the steps of a lift are halved to err no more than that.
_MOST_HALVINGS = 3


def lift_along(rotation: SteppedRotation) -> SteppedRotation:
    """How the shape alone would turn the frame, on the samples of a motion; at the ends of its steps own ones end."""
    if not rotation.directions.shape[1]:
        return rotation
    interpolant = rotation.interpolant
    tolerance = max(_SHARE * float(np.min(rotation.error_estimate)), _ROUNDING)
    requirements = StepRequirements.from_interpolant(interpolant, 0.0, tolerance)
    steps = even_steps(requirements.plan(tolerance), rotation.steps)
    record = integrate_steps_at_rest(interpolant, None, steps)
    stepping = requirements.stepping_error(steps, record.stepping)
    for _ in range(_MOST_HALVINGS):
        if stepping[0] <= tolerance:
            break
        steps = 2 * steps
        record = integrate_steps_at_rest(interpolant, None, steps)
        stepping = requirements.stepping_error(steps, record.stepping)
    one, turned = np.ones(1), _perturbed_turns(interpolant, rotation.perturbed, steps, record.quaternions)
    return SteppedRotation(
        interpolant=interpolant,
        momentum=np.zeros((1, 3)),
        steps=steps,
        quaternions=record.quaternions,
        directions=record.directions,
        turns=record.turns,
        dynamics=record.dynamics,
        sampling_error=rotation.perturbed.hidden + np.sqrt((turned * turned).sum(axis=-1)).max(axis=-1),
        stepping_error=stepping,
        rounding_error=rounding_error(record.propagators, record.quaternions, one, tolerance),
        amplification=one,
        perturbed=rotation.perturbed,
    )


def _perturbed_turns(interpolant: Interpolant, perturbed: Perturbed, steps: Integers, quaternions: Array) -> Array:
    """From a rotation without momentum to that on the perturbed series, at the ends of its steps: (1, K + 1, 3)."""
    if not perturbed.changes(interpolant.coefficients):
        return np.zeros((*quaternions.shape[:2], 3))
    changed = replace(interpolant, coefficients=perturbed.coefficients)
    return _turns(quaternions, integrate_steps_at_rest(changed, None, steps).quaternions)


def _turns(start: Array, end: Array) -> Array:
    """Small turns between quaternions xyzw: (..., 4), (..., 4) -> (..., 3)."""
    v, w, a, b = start[..., :3], end[..., :3], start[..., 3:], end[..., 3:]
    # A quaternion and its negative are one attitude.
    signs = np.where((start * end).sum(axis=-1, keepdims=True) < 0.0, -2.0, 2.0)
    return signs * (a * w - b * v - so3.cross(v, w))
