"""What the step of a semi-implicit integrator adds to momentum, fall and rates of a free body, to first order.

Semi-implicit Euler takes v' = v + h a(q, v), then q' = q moved with v' for h. With L(q, v), linear in v, moved at fixed
v: dL/ds = G and d2L/ds2 = H. A step conserves L(q, v') + h G(q, v) = L(q, v), so that L grows by h^2 (dG/dt - H / 2):

    L(t) - L(0) = h (G - G(0) - 1/2 integral of H dt).

The centre of mass c, with second and third derivative c2 and c3 at fixed v, leaves its parabola by h times the integral
of (c2 - integral of c3 dt) / 2, and the rates given are those of h / 2 earlier. Rates that are differences of the
samples are later by h / 2, which takes G / 2 off.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ._observation import Observation

_TURN = 0.01
"""[rad] Turn over which derivatives at fixed velocities are taken: cut off are 1e-4 / 12 of them, rounding is less."""


class StepDrift(NamedTuple):
    """Changes per second of step of momentum (N, 3), centre of mass (N, 3) or None, and rates (M, c) or None."""

    momentum: Array
    centre: Array | None
    rates: Array | None


def step_drift(body: Body, seen: Observation, slope: Array | None) -> StepDrift:
    """The drift.

    Parameters
    ----------
    slope : (M, c) derivatives of the given rates, or None
    """
    fastest = max(float(np.abs(seen.rate).max()), float(np.abs(seen.joint_rates).max(initial=0.0)), 1e-300)
    short = _TURN / fastest
    shapes, rates = seen.trajectory.shapes, seen.joint_rates
    momenta, centres = {}, {}
    for k in (-2, -1, 0, 1, 2):
        moved = shapes + k * short * rates
        turned = seen.attitude @ so3.exp(k * short * seen.rate)
        inertia, internal = body.sample(moved, rates)
        momenta[k] = so3.apply(turned, so3.apply(inertia, seen.rate) + internal)
        centres[k] = so3.apply(turned, body.centre_of_mass(moved))
    slow = (momenta[1] - momenta[-1]) / (2.0 * short)
    bent = (momenta[1] - 2.0 * momenta[0] + momenta[-1]) / short**2
    share = 1.0 if seen.given_rates else 0.5
    momentum = share * slow - 0.5 * _integral(seen.times, bent)
    if seen.centre is None:
        return StepDrift(momentum, None, None if slope is None else 0.5 * slope)
    second = (centres[1] - 2.0 * centres[0] + centres[-1]) / short**2
    third = (centres[2] - 2.0 * centres[1] + 2.0 * centres[-1] - centres[-2]) / (2.0 * short**3)
    centre = 0.5 * _integral(seen.times, second - _integral(seen.times, third))
    return StepDrift(momentum, centre, None if slope is None else 0.5 * slope)


def _integral(times: Array, values: Array) -> Array:
    return np.asarray(CubicSpline(times, values).antiderivative()(times))
