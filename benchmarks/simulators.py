"""More of what people use: NumPy as one writes it first, and MuJoCo and Drake where they are installed.

All conserve momentum at the true attitude in SciPy's DOP853, as `contestants.solve_ivp_attitude` does. The simulators
compute inertia and momentum with the base at rest, by the fastest calls they have for it; the right-hand side around
them is tuned by hand, and their models are made once, outside the time of a second run.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp

from .cases import Case
from .contestants import FloatingModel

Contestant = Callable[..., tuple[np.ndarray, int]]
Slope = Callable[[float, np.ndarray], ArrayLike]
# Inertia xx, xy, xz, yy, yz, zz about the centre of mass and internal angular momentum x, y, z at one time.
Sample = Callable[[float], tuple[float, float, float, float, float, float, float, float, float]]


class ModelRefused(RuntimeError):
    """A simulator does not take this body."""


def available() -> list[tuple[str, Contestant]]:
    """The contestants of this module whose packages are here; one that refuses a body raises ModelRefused."""
    made = [("NumPy", plain_solve_ivp_attitude)]
    for name, package, contestant in (
        ("MuJoCo", "mujoco", mujoco_attitude),
        ("Drake", "pydrake.multibody.plant", drake_attitude),
    ):
        try:
            import_module(package)
        except ImportError:
            continue
        made.append((name, contestant))
    return made


def plain_solve_ivp_attitude(case: Case, rtol: float, atol: float | None = None) -> tuple[np.ndarray, int]:
    """As `solve_ivp_attitude`, with nothing tuned but the joints: NumPy's solver and products, SciPy's rotations."""
    floating, mu = FloatingModel(case), case.momentum

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        floating.set(t)
        pin.ccrba(floating.model, floating.data, floating.q, floating.v)
        quat = state / np.linalg.norm(state)
        pi = Rotation.from_quat(quat).as_matrix().T @ mu
        omega = np.linalg.solve(floating.data.Ig.inertia, pi - floating.data.hg.angular)
        return 0.5 * np.append(quat[3] * omega + np.cross(quat[:3], omega), -quat[:3] @ omega)

    return _integrated(case, slope, rtol, atol)


def mujoco_attitude(case: Case, rtol: float, atol: float | None = None) -> tuple[np.ndarray, int]:
    """With MuJoCo's composite inertia of the base and its sum of angular momentum over the links."""
    import mujoco

    model, indices = _mujoco_model(case.body)
    data = mujoco.MjData(model)
    joints = _Joints(case, *indices)
    data.qpos[3:7] = [1.0, 0.0, 0.0, 0.0]
    base = model.body("link1").id
    # Views of memory that stays where it is.
    qpos, qvel, composite, internal = data.qpos, data.qvel, data.crb[base], data.subtree_angmom[base]

    def sample(t: float) -> tuple[float, ...]:
        qpos[joints.position], qvel[joints.velocity] = joints.at(t)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        xx, yy, zz, xy, xz, yz = composite[:6].tolist()
        return xx, xy, xz, yy, yz, zz, *internal.tolist()

    return _integrated(case, _slope(sample, case.momentum), rtol, atol)


def drake_attitude(case: Case, rtol: float, atol: float | None = None) -> tuple[np.ndarray, int]:
    """With the base's rows of Drake's mass matrix, taken to the centre of mass."""
    plant, indices = drake_plant(case.body)
    context = plant.CreateDefaultContext()
    joints = _Joints(case, *indices)
    q, v = plant.GetPositions(context).copy(), np.zeros(plant.num_velocities())

    def sample(t: float) -> tuple[float, ...]:
        q[joints.position], v[joints.velocity] = joints.at(t)
        plant.SetPositions(context, q)
        rows = plant.CalcMassMatrix(context)[:6]
        lx, ly, lz, px, py, pz = (rows @ v).tolist()
        # The upper right block is the cross product with mass times centre of mass.
        top = rows[:4, :6].tolist()
        (xx, xy, xz, _, _, mcy), (_, yy, yz, mcz, _, _), (_, _, zz, _, mcx, _), (_, _, _, m, _, _) = top
        x, y, z = mcx / m, mcy / m, mcz / m
        return (
            *(xx - mcy * y - mcz * z, xy + mcx * y, xz + mcx * z),
            *(yy - mcx * x - mcz * z, yz + mcy * z, zz - mcx * x - mcy * y),
            *(lx - y * pz + z * py, ly - z * px + x * pz, lz - x * py + y * px),
        )

    return _integrated(case, _slope(sample, case.momentum), rtol, atol)


def _slope(sample: Sample, mu: np.ndarray) -> Slope:
    """The rate of the quaternion x y z w, without arrays."""
    a, b, c = mu.tolist()

    def slope(t: float, state: np.ndarray) -> tuple[float, float, float, float]:
        xx, xy, xz, yy, yz, zz, lx, ly, lz = sample(t)
        x, y, z, w = state.tolist()
        n = (x * x + y * y + z * z + w * w) ** -0.5
        x, y, z, w = x * n, y * n, z * n, w * n
        # mu in base axes is mu - 2 w (e x mu) + 2 e x (e x mu), e = (x, y, z).
        s, u, p = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
        i, j, k = a - w * s + y * p - z * u - lx, b - w * u + z * s - x * p - ly, c - w * p + x * u - y * s - lz
        # The inverse of a symmetric matrix by its minors.
        axx, ayy, azz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
        axy, axz, ayz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
        half = 0.5 / (xx * axx + xy * axy + xz * axz)
        o, r, m = (
            half * (axx * i + axy * j + axz * k),
            half * (axy * i + ayy * j + ayz * k),
            half * (axz * i + ayz * j + azz * k),
        )
        return w * o + y * m - z * r, w * r + z * o - x * m, w * m + x * r - y * o, -x * o - y * r - z * m

    return slope


def _integrated(case: Case, slope: Slope, rtol: float, atol: float | None) -> tuple[np.ndarray, int]:
    """Final quaternion x y z w by DOP853, restarted at the breaks of the path; evaluations."""
    state, count = np.array([0.0, 0.0, 0.0, 1.0]), 0
    for a, b in pairwise(case.path.breaks):
        run = solve_ivp(slope, (a, b), state, "DOP853", rtol=rtol, atol=1e-2 * rtol if atol is None else atol)
        state = run.y[:, -1] / np.linalg.norm(run.y[:, -1])
        count += run.nfev
    return state, count


class _Joints:
    """A case's joints, one coordinate each, and where a simulator keeps them."""

    def __init__(self, case: Case, position: np.ndarray, velocity: np.ndarray) -> None:
        self.position, self.velocity = position, velocity
        self._floating = FloatingModel(case)
        joints = [*self._floating.model.joints][2:]
        self._q, self._v = np.array([j.idx_q for j in joints]), np.array([j.idx_v for j in joints])
        self._endless = np.array([j.nq == 2 for j in joints])
        self._any_endless = bool(self._endless.any())

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and rates, in Pinocchio's order of joints; angles of endless joints within a turn."""
        self._floating.set(t)
        q, v = self._floating.q, self._floating.v[self._v]
        coordinates = q[self._q]
        if self._any_endless:
            first = self._q[self._endless]
            coordinates[self._endless] = np.arctan2(q[first + 1], q[first])
        return coordinates, v


# ---- Models ---------------------------------------------------------------------------------------------------------

# MuJoCo wants every moving link to weigh more than 1e-15 kg.
_MUJOCO = (
    '<link name="world"/>'
    '<joint name="joint1" type="floating"><parent link="world"/><child link="link1"/></joint>'
    '<mujoco><compiler discardvisual="true" balanceinertia="false" inertiafromgeom="false" '
    'boundmass="2e-15" boundinertia="2e-15"/></mujoco></robot>'
)


@cache
def _mujoco_model(body: sp.Body) -> tuple[Any, tuple[np.ndarray, np.ndarray]]:
    """A MuJoCo model with a floating base, and where its joints are in qpos and qvel."""
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_string(plain_urdf(body._model).replace("</robot>", _MUJOCO))
    except ValueError as error:
        raise ModelRefused(f"MuJoCo does not take {body.name}: {error}") from error
    joints = [model.joint(f"joint{i}") for i in range(2, body._model.njoints)]
    return model, (np.array([j.qposadr[0] for j in joints]), np.array([j.dofadr[0] for j in joints]))


@cache
def drake_plant(body: sp.Body) -> tuple[Any, tuple[np.ndarray, np.ndarray]]:
    """A Drake plant with a floating base at the origin, and where its joints are in positions and velocities."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(time_step=0.0)
    try:
        Parser(plant).AddModelsFromString(plain_urdf(body._model), "urdf")
        plant.Finalize()
    except RuntimeError as error:
        raise ModelRefused(f"Drake does not take {body.name}: {error}") from error
    joints = [plant.GetJointByName(f"joint{i}") for i in range(2, body._model.njoints)]
    return plant, (np.array([j.position_start() for j in joints]), np.array([j.velocity_start() for j in joints]))


def plain_urdf(model: pin.Model, hinge: str = "continuous") -> str:
    """A URDF of what moves and weighs in a Pinocchio model with a free-flyer: link1 is the base, joint2 the first.

    The files themselves have meshes that are not there, joints that follow others, and tiny links fixed to large ones
    whose inertia a simulator refuses or mends; here such links are one. A hinge is "continuous", or "revolute"
    within 10 rad.
    """
    data, neutral, parts = model.createData(), pin.neutral(model), []
    for i in range(1, model.njoints):
        inertia, placement = model.inertias[i], model.jointPlacements[i]
        tensor = inertia.inertia
        moments = (f'i{"xyz"[j]}{"xyz"[k]}="{_numbers(tensor[j, k])}"' for j in range(3) for k in range(j, 3))
        parts.append(
            f'<link name="link{i}"><inertial><origin xyz="{_numbers(inertia.lever)}"/>'
            f'<mass value="{_numbers(inertia.mass)}"/><inertia {" ".join(moments)}/></inertial></link>'
        )
        if i == 1:
            continue
        slide, turn = np.split(pin.computeJointJacobian(model, data, neutral, i)[:, model.joints[i].idx_v], 2)
        kind = "prismatic" if slide.any() else hinge
        limit = "" if kind == "continuous" else '<limit lower="-10" upper="10" effort="1" velocity="1"/>'
        parts.append(
            f'<joint name="joint{i}" type="{kind}"><parent link="link{model.parents[i]}"/><child link="link{i}"/>'
            f'<origin xyz="{_numbers(placement.translation)}" '
            f'rpy="{_numbers(pin.rpy.matrixToRpy(placement.rotation))}"/>'
            f'<axis xyz="{_numbers(slide if slide.any() else turn)}"/>{limit}</joint>'
        )
    return f'<robot name="body">{"".join(parts)}</robot>'


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(values))
