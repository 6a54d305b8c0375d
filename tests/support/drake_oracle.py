"""An oracle from Drake: floating-base dynamics with the joints prescribed, no conservation law (theory.md U10).

Drake's are the parser, the momentum at the start, inverse dynamics, mass matrix and quaternion rates; SciPy's DOP853
carries the base through time.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from support.independent import RTOL, Array, FourierLoop, SimulatedMotion, urdf_file

_KEPT = {"link": ("inertial",), "joint": ("parent", "child", "origin", "axis", "limit")}


def mechanical_urdf(name: str) -> str:
    """The links of a body's URDF with their inertia, and its joints: no meshes to look up, no tags to warn of."""
    root = ElementTree.parse(urdf_file(name)).getroot()
    for element in list(root):
        if element.tag not in _KEPT:
            root.remove(element)
            continue
        for part in list(element):
            if part.tag not in _KEPT[element.tag]:
                element.remove(part)
    return ElementTree.tostring(root, encoding="unicode")


class DrakeBody:
    """A floating body in Drake, without gravity.

    The base comes first: seven positions (quaternion w x y z, base origin), six velocities (angular velocity, velocity
    of the base origin), all in world axes.
    """

    def __init__(self, name: str, joint_names: Sequence[str]) -> None:
        self.plant = MultibodyPlant(time_step=0.0)
        Parser(self.plant).AddModelsFromString(mechanical_urdf(name), "urdf")
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        self.plant.Finalize()
        (index,) = self.plant.GetFloatingBaseBodies()
        base = self.plant.get_body(index)
        assert base.has_quaternion_dofs()
        assert base.floating_positions_start() == base.floating_velocities_start_in_v() == 0
        assert len(joint_names) == self.plant.num_velocities() - 6
        joints = [self.plant.GetJointByName(joint) for joint in joint_names]
        self.position = np.array([joint.position_start() for joint in joints])
        self.velocity = np.array([joint.velocity_start() for joint in joints])
        self.context = self.plant.CreateDefaultContext()
        self.no_forces = MultibodyForces(self.plant)

    def place(self, base: ArrayLike, shape: Array) -> None:
        """Set the configuration: quaternion and position of the base, joints."""
        q = np.zeros(self.plant.num_positions())
        q[:7] = base
        q[self.position] = shape
        self.plant.SetPositions(self.context, q)

    def move(self, base: ArrayLike, rate: Array) -> Array:
        """Set the velocity; return the rates of the base's seven positions."""
        v = self.full(base, rate)
        self.plant.SetVelocities(self.context, v)
        return self.plant.MapVelocityToQDot(self.context, v)[:7]

    def full(self, base: ArrayLike, joints: ArrayLike) -> Array:
        vector = np.zeros(self.plant.num_velocities())
        vector[:6] = base
        vector[self.velocity] = joints
        return vector

    def centre_of_mass(self) -> Array:
        return self.plant.CalcCenterOfMassPositionInWorld(self.context)

    def momentum(self, base: ArrayLike, rate: Array) -> Array:
        """Angular momentum about the centre of mass, then linear momentum (6,), as Drake sums them over the links."""
        self.move(base, rate)
        return self.plant.CalcSpatialMomentumInWorldAboutPoint(self.context, self.centre_of_mass()).get_coeffs()

    def base_acceleration(self, joint_acceleration: Array) -> Array:
        """The (6,) with which nothing pushes the base: M_bb a = -(M_bj r'' + bias_b)."""
        known = self.full(np.zeros(6), joint_acceleration)
        push = self.plant.CalcInverseDynamics(self.context, known, self.no_forces)
        return np.linalg.solve(self.plant.CalcMassMatrix(self.context)[:6, :6], -push[:6])


def drake_motion(
    name: str,
    joint_names: Sequence[str],
    loop: FourierLoop,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    times: ArrayLike | None = None,
) -> SimulatedMotion:
    """The motion from M a + bias = 0 on the base, joints as prescribed.

    The centre of mass starts at rest at the origin; the momentum enters only through the initial velocity.
    """
    body = DrakeBody(name, joint_names)
    start = np.eye(3) if attitude is None else np.asarray(attitude, dtype=float)
    quat = Rotation.from_matrix(start).as_quat(scalar_first=True)
    body.place([*quat, 0.0, 0.0, 0.0], loop.shape(0.0))
    position = -body.centre_of_mass()
    body.place([*quat, *position], loop.shape(0.0))
    still = np.zeros(len(joint_names))
    carried = body.momentum(np.zeros(6), loop.rate(0.0))
    by_base = np.stack([body.momentum(one, still) for one in np.eye(6)], axis=-1)
    wanted = np.concatenate([np.asarray(momentum, dtype=float), np.zeros(3)])
    velocity = np.linalg.solve(by_base, wanted - carried)

    def slope(t: float, y: Array) -> Array:
        body.place(y[:7], loop.shape(t))
        rates = body.move(y[7:], loop.rate(t))
        return np.concatenate([rates, body.base_acceleration(loop.acceleration(t))])

    y = np.concatenate([quat, position, velocity])
    wanted_times = np.linspace(0.0, loop.duration, 41) if times is None else np.asarray(times, dtype=float)
    run = solve_ivp(
        slope, (0.0, loop.duration), y, "DOP853", rtol=RTOL, atol=1e-13, max_step=loop.duration / 20, dense_output=True
    )
    assert run.success, run.message
    values = run.sol(wanted_times).T
    turned = Rotation.from_quat(values[:, :4], scalar_first=True)
    return SimulatedMotion(turned.as_matrix(), values[:, 4:7], turned.apply(values[:, 7:10], inverse=True))
