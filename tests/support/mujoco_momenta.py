"""Attitudes of a body with wheels from MuJoCo's momenta M(q) v, integrated by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from shapephase.arrays import Array
from support.independent import JointMotion, quaternion_rate


def attitudes(
    mjcf: str,
    joints: JointMotion,
    names: Sequence[str],
    momentum: Array,
    attitude: Array,
    times: Array,
    *,
    momenta: Mapping[str, Callable[[float], float]] | None = None,
    speeds: Mapping[str, Callable[[float], float]] | None = None,
) -> Array:
    """Attitudes (N, 3, 3) of a floating body with the given momenta of wheels, or their speeds, in time."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    kept, held = momenta or {}, speeds or {}

    def dof(name: str) -> int:
        return int(np.ravel(model.joint(name).dofadr)[0])

    unknown = [*range(6), *map(dof, kept)]
    known = [*map(dof, names), *map(dof, held)]
    places = [int(np.ravel(model.joint(name).qposadr)[0]) for name in names]

    def omega(t: float, quat_xyzw: Array) -> Array:
        data.qpos[3:7] = np.roll(quat_xyzw, 1)
        data.qpos[places] = joints.shape(t)
        mujoco.mj_fwdPosition(model, data)
        mass = np.zeros((model.nv, model.nv))
        for row, unit in zip(mass, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        rates = np.concatenate([joints.rate(t), [speed(t) for speed in held.values()]])
        # Without linear momentum the base's angular ones, in its own axes, are those about the centre of mass.
        turned = Rotation.from_quat(quat_xyzw).inv().apply(momentum)
        wanted = np.concatenate([np.zeros(3), turned, [value(t) for value in kept.values()]])
        return np.linalg.solve(mass[np.ix_(unknown, unknown)], wanted - mass[np.ix_(unknown, known)] @ rates)[3:6]

    def slope(t: float, quat_xyzw: Array) -> list[float]:
        return quaternion_rate(quat_xyzw, omega(t, quat_xyzw / np.linalg.norm(quat_xyzw)))

    start = Rotation.from_matrix(attitude).as_quat()
    run = solve_ivp(slope, (0.0, times[-1]), start, "DOP853", t_eval=times, rtol=1e-11, atol=1e-13)
    assert run.success, run.message
    return Rotation.from_quat(run.y.T).as_matrix()
