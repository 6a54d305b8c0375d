"""Flights of five bodies by MuJoCo (Euler, implicitfast, RK4) and Drake (discrete) for campaigns of audits."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp

from .simulators import plain_urdf

LIBRARY = {"diver": 20.0, "satellite": 20.0, "cat_two_halves": 0.05}  # and the size of their momenta [kg m^2/s]
MOMENTA = LIBRARY | {"crane": 4.0, "spider": 1.0}
INTEGRATORS = {"euler": 0, "implicitfast": 3, "rk4": 1, "drake": None}
STIFFNESS = 20.0  # [rad/s] How fast the motors follow their targets

CRANE = """<mujoco><worldbody><body name="hull"><freejoint name="free"/>
<inertial pos="0.02 -0.01 0.03" mass="8" diaginertia="0.30 0.22 0.16"/>
<body name="boom" pos="0.2 0.05 0.1"><joint name="slew" axis="0.2 0.1 1"/>
<inertial pos="0.25 0 0.02" mass="1.5" diaginertia="0.004 0.03 0.031"/>
<body name="jib" pos="0.5 0 0"><joint name="luff" axis="0 1 0.3"/>
<inertial pos="0.2 0.03 0" mass="0.9" diaginertia="0.002 0.012 0.0125"/>
<body name="load" pos="0.4 0 0"><joint name="hoist" type="slide" axis="0 0.3 1"/>
<inertial pos="0 0 -0.05" mass="1.1" diaginertia="0.003 0.003 0.004"/></body></body></body>
<body name="counterweight" pos="-0.2 0 0.1"><joint name="swing" axis="1 0.4 0"/>
<inertial pos="-0.15 0.05 0" mass="2" diaginertia="0.01 0.015 0.012"/></body></body></worldbody></mujoco>"""


def spider() -> str:
    """Six legs of two hinges about axes that are not parallel, as a URDF."""

    def link(name: str, mass: float, moments: tuple[float, float, float], centre: str) -> str:
        x, y, z = moments
        return (
            f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>'
            f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    parts = [link("body", 3.0, (0.02, 0.03, 0.04), "0.01 0 0.02")]
    for leg in range(6):
        turn = leg * np.pi / 3.0 + 0.1
        at = f"{0.15 * np.cos(turn):.6f} {0.15 * np.sin(turn):.6f} 0"
        parts.append(link(f"thigh{leg}", 0.35, (0.0004, 0.0016, 0.0016), "0.1 0 0.01"))
        parts.append(link(f"shin{leg}", 0.2 + 0.03 * leg, (0.0002, 0.0012, 0.0012), "0.1 0.01 0"))
        for name, parent, child, where, axis in (
            (f"hip{leg}", "body", f"thigh{leg}", f'xyz="{at}" rpy="0 0 {turn:.6f}"', "0 1 0.3"),
            (f"knee{leg}", f"thigh{leg}", f"shin{leg}", 'xyz="0.2 0 0"', "0.2 1 0"),
        ):
            parts.append(
                f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin {where}/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="99" velocity="99"/></joint>'
            )
    return f'<robot name="spider">{"".join(parts)}</robot>'


@cache
def urdf(name: str) -> str:
    """All that moves and weighs in a body, as both simulators read it."""
    with tempfile.TemporaryDirectory() as folder:
        if name in LIBRARY:
            return plain_urdf(sp.load_body(name)._model, "revolute")
        file = Path(folder) / ("body.xml" if name == "crane" else "body.urdf")
        file.write_text(CRANE if name == "crane" else spider())
        return plain_urdf(sp.load_body(file)._model, "revolute")


@cache
def body_of(name: str) -> sp.Body:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "body.urdf"
        file.write_text(urdf(name))
        return sp.load_body(file)


def mujoco_model(name: str) -> Any:
    """A floating body with a ball about each link's centre, above a floor that touches only where it is switched on."""
    floating = (
        '<link name="world"/><joint name="free" type="floating"><parent link="world"/><child link="link1"/></joint>'
        '<mujoco><compiler discardvisual="false" balanceinertia="false" inertiafromgeom="false" '
        'boundmass="1e-14" boundinertia="1e-14"/></mujoco></robot>'
    )
    spec = mujoco.MjSpec.from_string(urdf(name).replace("</robot>", floating))
    for part in spec.bodies[1:]:
        part.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0.0, 0.0], pos=part.ipos, mass=0.0, conaffinity=0)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 1.0], contype=0, conaffinity=0)
    return spec.compile()


@dataclass
class Flight:
    """How one is flown, and what is true of it.

    words : a hypothesis whose name has one of these is the true cause
    """

    kind: str
    name: str
    rng: np.random.Generator
    integrator: str = "rk4"
    step: float = 0.001
    every: int = 5
    duration: float = 1.0
    gravity: float = 9.81
    height: float = 30.0
    floor: bool = False
    drag: float = 0.0
    change: Callable[[Any], object] | None = None
    record: Callable[[sp.FloatingTrajectory], sp.FloatingTrajectory] | None = None
    words: tuple[str, ...] = ()
    silence_allowed: bool = False
    rates: bool = True
    drift: float = field(default=0.0)


def targets(rng: np.random.Generator, joints: int) -> Callable[[float], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    sizes, turns = rng.uniform(0.2, 0.6, joints), rng.uniform(4.0, 11.0, joints)
    phases, middle = rng.uniform(0.0, 6.0, joints), rng.uniform(-0.4, 0.4, joints)

    def at(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = turns * t + phases
        swing, slope = sizes * np.sin(angle), sizes * turns * np.cos(angle)
        return middle + swing, slope, -(turns**2) * swing

    return at


def motor(mass: np.ndarray, bias: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Torques of the joints that give them an acceleration while the base gives way."""
    share = np.linalg.solve(mass[:6, :6], np.column_stack([mass[:6, 6:], bias[:6]]))
    way = mass[6:, :6] @ share
    return (mass[6:, 6:] - way[:, :-1]) @ pull + bias[6:] - way[:, -1]


def fly(flight: Flight) -> sp.FloatingTrajectory:
    body, rng = body_of(flight.name), flight.rng
    target = targets(rng, body.n_shape)
    quat = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat()[[3, 0, 1, 2]]
    shapes, rates, _ = target(0.0)
    inertia, internal = body.sample(shapes[None], rates[None])
    wanted = MOMENTA[flight.name] * rng.uniform(0.4, 1.0) * rng.normal(size=3) / np.sqrt(3.0)
    spin = np.linalg.solve(inertia[0], wanted - internal[0])
    velocity = np.array([1.0, 0.2, 3.0 if flight.floor else 4.0])
    simulated = fly_drake if flight.integrator == "drake" else fly_mujoco
    names, times, qpos, qvel, momenta = simulated(flight, target, quat, velocity, spin)
    run = sp.FloatingTrajectory.from_mujoco(body, times, qpos, qvel, joint_names=names)
    inertia, internal = body.sample(run.shapes, run.joint_rates)
    turning = np.einsum("nij,nj->ni", inertia, run.rate)
    scale = np.sqrt((turning**2 + internal**2).sum(axis=1).mean())
    flight.drift = float(np.linalg.norm(momenta - momenta.mean(axis=0), axis=1).max() / scale)
    run = run if flight.record is None else flight.record(run)
    return run if flight.rates else replace(run, rate=None, velocity=None, joint_rates=None)


def fly_mujoco(flight: Flight, target: Any, quat: Any, velocity: Any, spin: Any) -> tuple[Any, ...]:
    model = mujoco_model(flight.name)
    model.opt.integrator, model.opt.timestep = INTEGRATORS[flight.integrator], flight.step
    model.opt.gravity[:] = 0.0, 0.0, -flight.gravity
    if flight.floor:
        model.geom_conaffinity[int(np.flatnonzero(model.geom_bodyid == 0)[0])] = 1
    if flight.change is not None:
        flight.change(model)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    shapes, rates, _ = target(0.0)
    data.qpos[:] = np.concatenate([[0.0, 0.0, flight.height], quat, shapes])
    data.qvel[:] = np.concatenate([velocity, spin, rates])
    mass = np.zeros((model.nv, model.nv))
    rows, momenta = [], []
    for k in range(round(flight.duration / flight.step) + 1):
        mujoco.mj_forward(model, data)
        if k % flight.every == 0:
            rows.append((k * flight.step, data.qpos.copy(), data.qvel.copy()))
            mujoco.mj_subtreeVel(model, data)
            momenta.append(data.subtree_angmom[1].copy())
        place, slope, bend = target(k * flight.step)
        pull = bend + STIFFNESS**2 * (place - data.qpos[7:]) + 2.0 * STIFFNESS * (slope - data.qvel[6:])
        mujoco.mj_fullM(model, data, mass)
        data.qfrc_applied[6:] = motor(mass, data.qfrc_bias, pull)
        if flight.drag:
            wind = np.zeros(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, 1, wind, 0)
            wide = model.body_subtreemass[1] * flight.drag
            data.xfrc_applied[1, :3] = -wide * np.linalg.norm(wind[3:]) * wind[3:]
        mujoco.mj_step(model, data)
    names = [model.joint(k).name for k in range(1, model.njnt)]
    return names, *(np.array(column) for column in zip(*rows, strict=True)), np.array(momenta)


def fly_drake(flight: Flight, target: Any, quat: Any, velocity: Any, spin: Any) -> tuple[Any, ...]:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.analysis import Simulator

    plant = MultibodyPlant(time_step=flight.step)
    Parser(plant).AddModelsFromString(urdf(flight.name), "urdf")
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -flight.gravity])
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    shapes, rates, _ = target(0.0)
    turned = Rotation.from_quat(quat[[1, 2, 3, 0]])
    plant.SetPositions(context, np.concatenate([quat, [0.0, 0.0, flight.height], shapes]))
    plant.SetVelocities(context, np.concatenate([turned.apply(spin), velocity, rates]))
    port = plant.get_applied_generalized_force_input_port()
    rows, momenta = [], []
    for k in range(round(flight.duration / flight.step) + 1):
        q, v = plant.GetPositions(context), plant.GetVelocities(context)
        turned = Rotation.from_quat(q[[1, 2, 3, 0]])
        if k % flight.every == 0:
            base = np.concatenate([q[4:7], q[:4] / np.linalg.norm(q[:4])])
            rows.append(
                (k * flight.step, np.append(base, q[7:]), np.concatenate([v[3:6], turned.inv().apply(v[:3]), v[6:]]))
            )
            centre = plant.CalcCenterOfMassPositionInWorld(context)
            momenta.append(plant.CalcSpatialMomentumInWorldAboutPoint(context, centre).rotational())
        place, slope, bend = target(k * flight.step)
        pull = bend + STIFFNESS**2 * (place - q[7:]) + 2.0 * STIFFNESS * (slope - v[6:])
        bias = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        force = np.zeros(plant.num_velocities())
        force[6:] = motor(plant.CalcMassMatrix(context), bias, pull)
        port.FixValue(context, force)
        simulator.AdvanceTo((k + 1) * flight.step)
    joints = sorted((plant.get_joint(k) for k in plant.GetJointIndices()), key=lambda joint: joint.position_start())
    names = [joint.name() for joint in joints if joint.num_positions() == 1]
    return names, *(np.array(column) for column in zip(*rows, strict=True)), np.array(momenta)
