"""Bodies that MuJoCo flies: joints driven by motors, base free, with faults planted on purpose and noise on top.

Everything is MuJoCo's own: its integrators, its clock, its order of joints. Nothing of the library's mechanics is used.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from support.independent import BODIES, FourierLoop, body_of, mujoco_model, random_loop, random_rotation, random_vector

INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
STIFFNESS = 20.0
"""[rad/s] How fast the motors follow the loop."""


@dataclass(frozen=True)
class Flown:
    """What MuJoCo has flown, as it stores it.

    Attributes
    ----------
    times : (N,) [s]
    qpos, qvel : (N, 7 + n), (N, 6 + n), joints in MuJoCo's order
    joint_names : in that order
    """

    times: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    joint_names: tuple[str, ...]


def flown(
    name: str,
    *,
    seed: int,
    integrator: str = "rk4",
    step: float = 0.001,
    every: int = 1,
    duration: float = 1.0,
    heavier: dict[str, float] | None = None,
    push: Callable[[float], tuple[np.ndarray, np.ndarray]] | None = None,
    gravity: float = 9.81,
    reach: float = 0.5,
    model: mujoco.MjModel | None = None,
    watch: Callable[[mujoco.MjModel, mujoco.MjData], None] | None = None,
) -> Flown:
    """A flight.

    Parameters
    ----------
    step : of the integrator [s]
    every : how many steps lie between samples
    heavier : link -> factor of its mass, its inertia left as it is
    push : time -> force and torque on the base's centre of mass, world axes [N], [N m]
    reach : of the joints' loop [rad]
    model : the body in other surroundings; None: the body alone
    watch : called at each state once its forces are known, before the step; it may apply more of them
    """
    model = copy.copy(mujoco_model(name) if model is None else model)
    model.opt.integrator, model.opt.timestep = INTEGRATORS[integrator], step
    model.opt.gravity[:] = 0.0, 0.0, -gravity
    for link, factor in (heavier or {}).items():
        model.body_mass[model.body(link).id] *= factor
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    joints = [model.joint(k) for k in range(1, model.njnt)]
    places = np.array([int(np.ravel(joint.qposadr)[0]) for joint in joints])
    rates = np.array([int(np.ravel(joint.dofadr)[0]) for joint in joints])
    loop = random_loop(seed, len(joints), size=reach, duration=1.0, harmonics=2)
    _begin(model, data, loop, places, rates, name, seed)
    masses = np.zeros((model.nv, model.nv))
    qpos, qvel, times = [], [], []
    for k in range(round(duration / step) + 1):
        if k % every == 0:
            qpos.append(data.qpos.copy())
            qvel.append(data.qvel.copy())
            times.append(k * step)
        now = k * step
        behind = loop.shape(now) - data.qpos[places]
        slow = loop.rate(now) - data.qvel[rates]
        pull = loop.acceleration(now) + STIFFNESS**2 * behind + 2.0 * STIFFNESS * slow
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, masses)
        # The base is free, and gives way.
        share = np.linalg.solve(masses[:6, :6], np.column_stack([masses[:6, rates], data.qfrc_bias[:6]]))
        way = masses[rates, :6] @ share
        data.qfrc_applied[rates] = (masses[np.ix_(rates, rates)] - way[:, :-1]) @ pull
        data.qfrc_applied[rates] += data.qfrc_bias[rates] - way[:, -1]
        if push is not None:
            force, torque = push(now)
            data.xfrc_applied[1] = np.concatenate([force, torque])
        if watch is not None:
            watch(model, data)
        mujoco.mj_step(model, data)
    return Flown(np.array(times), np.array(qpos), np.array(qvel), tuple(joint.name for joint in joints))


def _begin(model, data, loop: FourierLoop, places, rates, name: str, seed: int) -> None:
    """Joints on the loop, the base turned anyhow, thrown with a momentum about the centre of mass."""
    quat = Rotation.from_matrix(random_rotation(seed)).as_quat()
    data.qpos[:3], data.qpos[3:7], data.qpos[places] = 0.0, np.roll(quat, 1), loop.shape(0.0)
    data.qvel[rates] = loop.rate(0.0)
    momentum = random_vector(seed, 1.5 * BODIES[name])

    def found() -> np.ndarray:
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        return data.subtree_angmom[1].copy()

    carried, turned = found(), []
    for axis in np.eye(3):
        data.qvel[3:6] = axis
        turned.append(found() - carried)
    data.qvel[3:6] = np.linalg.solve(np.array(turned).T, momentum - carried)
    found()
    data.qvel[:3] = np.array([1.0, 0.2, 3.0]) - data.subtree_linvel[1]


def noisy(motion: Flown, seed: int, *, turn: float, place: float, angle: float, rate: float) -> Flown:
    """With white noise of the base's attitude [rad], its place [m], joints [rad or m] and all rates [rad/s, m/s]."""
    rng = np.random.default_rng(seed)
    qpos, qvel = motion.qpos.copy(), motion.qvel.copy()
    turned = Rotation.from_quat(qpos[:, [4, 5, 6, 3]]) * Rotation.from_rotvec(turn * rng.normal(size=(len(qpos), 3)))
    qpos[:, 3:7] = turned.as_quat()[:, [3, 0, 1, 2]]
    qpos[:, :3] += place * rng.normal(size=(len(qpos), 3))
    qpos[:, 7:] += angle * rng.normal(size=qpos[:, 7:].shape)
    qvel += rate * rng.normal(size=qvel.shape)
    return Flown(motion.times, qpos, qvel, motion.joint_names)


__all__ = ["BODIES", "Flown", "body_of", "flown", "noisy"]
