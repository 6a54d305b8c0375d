"""An MJCF file in MuJoCo itself, its body set free: what the library's reading of it is held against.

MuJoCo's own editing of the model puts a free joint in the place of those at the root. Nothing here is shared with the
library's reader. Contacts, constraints, fluid and gravity are off.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from shapephase.arrays import Array

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_BALL = int(mujoco.mjtJoint.mjJNT_BALL)
_COUPLED = int(mujoco.mjtEq.mjEQ_JOINT)
_NEXT_TO_NOTHING = 2e-15
"""[kg], and [kg m^2]; MuJoCo's least is 1e-15."""
_OFF = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT) | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


class FloatingMujoco:
    """The model of a file of which one body floats; vectors are (base velocity, world; base rate, base axes; joints).

    Of a ball joint shapes have four numbers x, y, z, w, a quaternion of any length, and rates their derivatives.

    Attributes
    ----------
    joints : numbers of those that the body moves and that follow no other, in MuJoCo's order
    width : how many numbers a shape has
    """

    def __init__(self, path: Path, root_body: str | None = None) -> None:
        with warnings.catch_warnings():
            # MuJoCo has words on settings that will go.
            warnings.simplefilter("ignore", UserWarning)
            self._make(path, root_body)

    def _make(self, path: Path, root_body: str | None) -> None:
        written = mujoco.MjSpec.from_file(str(path))
        written.memory, written.njmax, written.nconmax = 2**26, -1, -1
        first = written.compile()
        base = next(body for body in written.bodies if body.name == root_body) if root_body else _tree(written)
        assert base.parent.name == "world"
        for what in (written.keys, written.sensors, written.actuators, written.tendons, written.excludes):
            for part in list(what):
                written.delete(part)
        for equality in list(written.equalities):
            if int(equality.type) != _COUPLED:
                written.delete(equality)
        for joint in list(base.joints):
            written.delete(joint)
        if first.body_mass[base.id] == 0.0:
            # What moves must weigh something: less than rounding leaves of the others.
            base.explicitinertial, base.mass, base.inertia = True, _NEXT_TO_NOTHING, np.full(3, _NEXT_TO_NOTHING)
        base.add_freejoint()
        self.model: Any = written.compile()
        model = self.model
        model.opt.density = model.opt.viscosity = 0.0
        model.opt.gravity[:] = 0.0
        model.opt.disableflags |= _OFF
        self.data = mujoco.MjData(model)
        self.base = base.id
        self.bodies = [body for body in range(1, model.nbody) if self._hangs(body)]
        moving = [joint for joint in range(model.njnt) if int(model.jnt_bodyid[joint]) in self.bodies]
        (free,) = (joint for joint in moving if int(model.jnt_type[joint]) == _FREE)
        self._place, self._first = int(model.jnt_qposadr[free]), int(model.jnt_dofadr[free])
        coupled = [k for k in range(model.neq) if model.eq_active0[k] and int(model.eq_type[k]) == _COUPLED]
        self._rules = {int(model.eq_obj1id[k]): k for k in coupled}
        self._moving = [joint for joint in moving if joint != free]
        self.joints = [joint for joint in self._moving if joint not in self._rules]
        self.width = sum(4 if int(model.jnt_type[joint]) == _BALL else 1 for joint in self.joints)

    def _hangs(self, body: int) -> bool:
        while body not in (0, self.base):
            body = int(self.model.body_parentid[body])
        return body == self.base

    def _spread(self, shape: Array, rate: Array, bend: Array) -> dict[int, tuple[Any, Any, Any]]:
        """Coordinate, rate and acceleration of every joint, those that follow others by their polynomials."""
        known: dict[int, tuple[Any, Any, Any]] = {}
        numbers = np.stack([shape, rate, bend], -1)
        assert len(numbers) == self.width
        for joint in self.joints:
            ball = int(self.model.jnt_type[joint]) == _BALL
            known[joint] = _ball(*numbers[:4].T) if ball else tuple(numbers[0])
            numbers = numbers[4 if ball else 1 :]

        def of(joint: int) -> tuple[Any, Any, Any]:
            if joint not in known:
                rule, model = self._rules[joint], self.model
                leader = int(model.eq_obj2id[rule])
                here = model.qpos0[model.jnt_qposadr[joint]]
                polynomial = np.polynomial.Polynomial(model.eq_data[rule, :5])
                if leader < 0:
                    return float(here + polynomial.coef[0]), 0.0, 0.0
                q, v, a = of(leader)
                away = q - model.qpos0[model.jnt_qposadr[leader]]
                slope, curve = polynomial.deriv()(away), polynomial.deriv(2)(away)
                known[joint] = (float(here + polynomial(away)), float(slope * v), float(slope * a + curve * v * v))
            return known[joint]

        return {joint: of(joint) for joint in self._moving}

    def put(self, position: Array, quat_xyzw: Array, shape: Array) -> None:
        """Set the configuration, by a quaternion of length one, and compute all that depends on it alone."""
        qpos, place = self.data.qpos, self._place
        qpos[place : place + 3] = position
        qpos[place + 3] = quat_xyzw[3]
        qpos[place + 4 : place + 7] = quat_xyzw[:3]
        self._shape = np.asarray(shape, dtype=float)
        none = np.zeros(self.width)
        for joint, (q, _, _) in self._spread(self._shape, none, none).items():
            first = int(self.model.jnt_qposadr[joint])
            qpos[first : first + np.size(q)] = q
        mujoco.mj_fwdPosition(self.model, self.data)

    def place(self, position: Array, attitude: Array, shape: Array) -> None:
        self.put(position, Rotation.from_matrix(attitude).as_quat(), shape)

    def move(self, velocity: Array, omega: Array, rate: Array) -> None:
        """Set the velocity and compute all that depends on it."""
        self._rate = np.asarray(rate, dtype=float)
        self.data.qvel[:] = self._vector(velocity, omega, self._rate, np.zeros(self.width), 1)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def _vector(self, linear: Any, angular: Any, rate: Array, bend: Array, part: int) -> Array:
        vector = np.zeros(self.model.nv)
        vector[self._first : self._first + 3] = linear
        vector[self._first + 3 : self._first + 6] = angular
        for joint, values in self._spread(self._shape, rate, bend).items():
            first = int(self.model.jnt_dofadr[joint])
            vector[first : first + np.size(values[part])] = values[part]
        return vector

    def _momenta(self, vector: Array) -> Array:
        result = np.zeros(self.model.nv)
        mujoco.mj_mulM(self.model, self.data, result, vector)
        return result[self._first : self._first + 6]

    def base_mass(self) -> Array:
        rows = np.eye(self.model.nv)[self._first : self._first + 6]
        return np.array([self._momenta(row) for row in rows])

    def carried(self, rate: Array) -> Array:
        """The base's momenta (6,) that the joints' rates carry."""
        return self._momenta(self._vector(0.0, 0.0, np.asarray(rate), np.zeros(self.width), 1))

    def base_force(self, bend: Array) -> Array:
        """What would keep the base from accelerating while the joints do (6,)."""
        bias = self.data.qfrc_bias[self._first : self._first + 6]
        return bias + self._momenta(self._vector(0.0, 0.0, self._rate, np.asarray(bend), 2))

    def centre_of_mass(self) -> Array:
        return self.data.subtree_com[self.base].copy()

    def momentum_about_centre(self) -> Array:
        """As MuJoCo sums it over the links, world axes."""
        mujoco.mj_subtreeVel(self.model, self.data)
        return self.data.subtree_angmom[self.base].copy()

    def mass(self) -> float:
        return float(self.model.body_subtreemass[self.base])

    def locked_inertia(self) -> Array:
        """About the centre of mass, axes of the base."""
        model, data = self.model, self.data
        axes, centre = data.xmat[self.base].reshape(3, 3), self.centre_of_mass()
        inertia = np.zeros((3, 3))
        for body in self.bodies:
            own, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - centre
            inertia += own @ np.diag(model.body_inertia[body]) @ own.T
            inertia += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return axes.T @ inertia @ axes

    def extent(self) -> float:
        """Of the inertia about the base, the size of the terms that it is a sum of."""
        model, away = self.model, self.data.xipos[self.bodies] - self.data.xpos[self.base]
        return float(model.body_mass[self.bodies] @ (away**2).sum(axis=1) + model.body_inertia[self.bodies].sum())

    def lack(self) -> float:
        """What its quaternions and axes lack of length one."""
        model = self.model
        lengths = [np.linalg.norm(each, axis=1) for each in (model.body_quat, model.body_iquat, model.jnt_axis)]
        return float(np.abs(np.concatenate(lengths) - 1.0).max())


def _ball(numbers: Array, slopes: Array, bends: Array) -> tuple[Array, Array, Array]:
    """Quaternion w, x, y, z of length one, rate in axes of the child and its derivative, by MuJoCo's own product."""
    square, stretch = numbers @ numbers, 2.0 * (numbers @ slopes) / (numbers @ numbers)

    def turned_back(four: Array) -> Array:
        product, conjugate = np.zeros(4), np.roll(numbers * [-1.0, -1.0, -1.0, 1.0], 1)
        mujoco.mju_mulQuat(product, conjugate, np.roll(four, 1))
        return 2.0 * product[1:] / square

    spin = turned_back(slopes)
    return np.roll(numbers, 1) / np.sqrt(square), spin, turned_back(bends) - stretch * spin


def _tree(written: Any) -> Any:
    """The only body in the world with joints on it or below, or the only one."""
    tops = list(written.worldbody.bodies)
    return next((body for body in tops if len(body.find_all("joint"))), tops[0])


def choices(path: Path) -> dict[str, str] | None:
    """What `load_body` is told of a file to take the tree with the most joints; None if it is no model with joints."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError):
        return None
    trees: dict[int, list[int]] = {}
    for joint in range(model.njnt):
        trees.setdefault(int(model.body_rootid[model.jnt_bodyid[joint]]), []).append(joint)
    if not trees:
        return None
    root = max(trees, key=lambda body: len(trees[body]))
    chosen = {}
    if len(trees) > 1:
        chosen["root_body"] = model.body(root).name or f"body{root}"
    if any(model.jnt_bodyid[joint] == root and model.jnt_type[joint] != _FREE for joint in trees[root]):
        chosen["root"] = "free"
    return chosen
