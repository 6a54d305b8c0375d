"""The simulated dive of `robots/`: `python -m support.simulated_dive`, in `tests/`, writes recording and truth anew.

MuJoCo's floating body of the diver, with gravity. Springs and dampers make the arms follow `diver_twist`: inner forces,
which leave the momentum of the flight as it is. A force and a torque push off at first, and a force stops the fall.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.arrays import Array
from support.places import ROBOTS

PUSH, STOP, STEP = 0.2, 0.2, 5e-4  # [s]
FLOATING = (
    '<mujoco><compiler discardvisual="true" balanceinertia="false"/></mujoco><link name="world"/>'
    '<joint name="free" type="floating"><parent link="world"/><child link="trunk"/></joint></robot>'
)
TO_OPENSIM = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # x forward, y up, z right


def simulated() -> tuple[Array, Array, Rotation, Array, Array]:
    """Times, places and attitudes of the base, arms, angular momentum; z is up, 100 samples a second."""
    body, dive = sp.load_body("diver"), sp.examples.diver_twist()
    model = mujoco.MjModel.from_xml_string(Path(body.file).read_text().replace("</robot>", FLOATING))
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in body.joint_names]
    places, speeds = [j.qposadr[0] for j in joints], [j.dofadr[0] for j in joints]
    data.qpos[:3] = [0.0, 0.0, 10.0]
    data.qpos[places] = dive.shape(0.0)
    trunk, weight = model.body("trunk").id, 9.81 * model.body_mass.sum()
    rows = []
    for step in range(round((PUSH + dive.duration + STOP) / STEP)):
        goal, rate = (f(np.clip(data.time - PUSH, 0.0, dive.duration)) for f in (dive.shape, dive.rate))
        data.qfrc_applied[speeds] = 2000.0 * (goal - data.qpos[places]) + 40.0 * (rate - data.qvel[speeds])
        pushes, stops = data.time < PUSH, data.time > PUSH + dive.duration
        data.xfrc_applied[trunk] = [0, 0, (3.0 * pushes + 7.0 * stops) * weight, 0, 300.0 * pushes, 0]
        if step % 20 == 0:
            mujoco.mj_forward(model, data)
            mujoco.mj_subtreeVel(model, data)
            rows.append([data.time, *data.qpos[:7], *data.qpos[places], *data.subtree_angmom[trunk]])
        mujoco.mj_step(model, data)
    times, place, wxyz, arms, momentum = np.split(np.array(rows), [1, 4, 8, 10], axis=1)
    return times[:, 0], place, Rotation.from_quat(np.roll(wxyz, -1, axis=1)), arms, momentum


def files() -> dict[str, str]:
    """The recording, as OpenSim writes it, with noise of pelvis, its place and joints; and the truth in its axes."""
    rng = np.random.default_rng(5)
    times, place, turns, arms, momentum = simulated()
    truth = TO_OPENSIM * turns
    recorded = truth * Rotation.from_rotvec(np.radians(0.5) * rng.normal(size=(len(times), 3)))
    angles = (recorded * TO_OPENSIM.inv()).as_euler("ZXY", degrees=True)
    where = TO_OPENSIM.apply(place) + 0.002 * rng.normal(size=place.shape)
    joints = np.degrees(arms) + 0.3 * rng.normal(size=arms.shape)
    names = sp.load_body("diver").joint_names
    pelvis = [f"pelvis_{name}" for name in ("tilt", "list", "rotation", "tx", "ty", "tz")]
    head = f"Coordinates\nversion=1\nnRows={len(times)}\nnColumns={7 + len(names)}\ninDegrees=yes\nendheader\n"
    momenta = [f"momentum_{axis} [kg m^2/s]" for axis in "xyz"]
    exact = np.column_stack([times, arms, truth.as_quat(), TO_OPENSIM.apply(momentum)])
    return {
        "diver_dive.mot": head + _table(["time", *pelvis, *names], np.column_stack([times, angles, where, joints]), 4),
        "diver_dive_truth.csv": _table(["time", *names, "qx", "qy", "qz", "qw", *momenta], exact, 7, ","),
    }


def _table(names: list[str], rows: Array, digits: int, between: str = "\t") -> str:
    lines = [between.join(f"{value:.{digits}f}" for value in row) for row in rows]
    return "\n".join([between.join(names), *lines, ""])


if __name__ == "__main__":
    for name, text in files().items():
        (ROBOTS / name).write_text(text, encoding="utf-8")
