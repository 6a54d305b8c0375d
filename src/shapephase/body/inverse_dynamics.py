"""The efforts that drive a known motion of a body in free fall."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, which a type checker cannot follow.
# pyright: reportAttributeAccessIssue=false
import numpy as np
import pinocchio as pin

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from .body import Body
from .couplings.coordinate_map import check_smooth
from .couplings.joint_map import BASE


def falling_efforts(
    body: Body, shapes: Array, rates: Array, accelerations: Array, spins: Array, spin_rates: Array
) -> tuple[Array, Array]:
    """Efforts of the joints of a body in free fall, by Newton-Euler steps from link to link (Pinocchio's `rnea`).

    The centre of mass falls freely: gravity moves all links alike, and loads no joint. The effort of a joint that
    follows another adds to the effort of that one by the work it does.

    shapes, rates, accelerations : (N, n), unchecked
    spins, spin_rates : (N, 3) angular velocity of the base and its rate, base axes [rad/s], [rad/s^2]

    efforts : (N, n) [N m or N]
    wrenches : (N, 6) force on the base and torque about its origin, base axes, that the motion would need from
        outside, which is none for a free body [N], [N m]

    Source: Featherstone 2008, Rigid Body Dynamics Algorithms, section 5.3.
    """
    check_object(body, "Body", "body")
    model, data, joints = body._model, body._data(), body._joints
    check_smooth(joints.follows, "torques need", kinks_only=True)
    states = floating_states(body, shapes, rates, accelerations, spins, spin_rates)
    states[2][:, :3] += model.gravity.linear
    whole = np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])
    whole = whole.reshape(len(shapes), model.nv)
    return joints.columns(whole[:, BASE:], shapes), whole[:, :BASE]


def floating_velocities(body: Body, shapes: Array, rates: Array, spins: Array) -> tuple[Array, Array]:
    """Configurations and velocities of Pinocchio's model while the centre of mass rests, as `floating_states` has them.

    Joints that follow others may have kinks.
    """
    check_object(body, "Body", "body")
    model, data, joints = body._model, body._data(), body._joints
    configurations, velocities = joints.configurations(shapes), joints.velocities(shapes, rates)
    for row, (q, v) in enumerate(zip(configurations, velocities, strict=True)):
        pin.centerOfMass(model, data, q, v)
        v[:3], v[3:BASE] = -data.vcom[0] - so3.cross(spins[row], data.com[0]), spins[row]
    return configurations, velocities


def floating_states(
    body: Body, shapes: Array, rates: Array, accelerations: Array, spins: Array, spin_rates: Array
) -> tuple[Array, Array, Array]:
    """Configurations, velocities and accelerations of Pinocchio's model while the centre of mass rests.

    The base's position is the origin, its attitude the identity. The first six velocities are linear and angular, base
    axes, and their accelerations the derivatives of these six numbers.

    shapes, rates, accelerations, spins, spin_rates : as for `falling_efforts`

    Returns (N, nq), (N, nv), (N, nv)
    """
    check_object(body, "Body", "body")
    model, data, joints = body._model, body._data(), body._joints
    check_smooth(joints.follows, "accelerations need", kinks_only=True)
    configurations = joints.configurations(shapes)
    velocities, slopes = joints.velocities(shapes, rates), joints.accelerations(shapes, rates, accelerations)
    for row, (q, v, a) in enumerate(zip(configurations, velocities, slopes, strict=True)):
        pin.centerOfMass(model, data, q, v, a)
        centre, speed, w = data.com[0].copy(), data.vcom[0].copy(), spins[row]
        v[:3], v[3:BASE] = -speed - so3.cross(w, centre), w
        a[3:BASE] = spin_rates[row]
        a[:3] = -data.acom[0] - so3.cross(spin_rates[row], centre) - so3.cross(w, speed)
    return configurations, velocities, slopes
