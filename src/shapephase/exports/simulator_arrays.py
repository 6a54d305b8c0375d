"""The whole floating motion as the vectors of simulators: MuJoCo's `qpos` and `qvel`, Pinocchio's `q`, `v` and `a`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_keywords, check_object
from ..arrays import Array
from ..body.couplings.coordinate_map import check_no_balls
from ..body.formats.xml_text import listed
from ..body.joint_orders import MUJOCO, simulator_order
from ..display import frozen
from ..errors import UnknownNameError
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._whole_motion import Fall, WholeMotion, checked_times, whole_accelerations, whole_motion

_FREE_Q = 7
_FREE_V = 6  # numbers of a free joint among configurations, and among velocities
_SCALAR_FIRST = [3, 0, 1, 2]  # w, x, y, z from x y z w
_MUJOCO_FREE = 0  # MuJoCo's number of free joints among the kinds


@frozen(kw_only=True)
class MujocoArrays:
    """A motion as MuJoCo has it.

    Made by `mujoco_arrays`.

    Attributes
    ----------
    time : (N,) [s]
    qpos : (N, nq) position of the base, its quaternion w x y z, the joints [m], [rad or m]
    qvel : (N, nv) velocity of the base origin in inertial axes, angular velocity in base axes, rates of the joints
    joint_names : of all joints, in the order of the columns
    """

    time: Array
    qpos: Array
    qvel: Array
    joint_names: tuple[str, ...]


@frozen(kw_only=True)
class PinocchioArrays:
    """A motion as Pinocchio has it, of a model whose base is a free-flyer.

    Made by `pinocchio_arrays`.

    Attributes
    ----------
    time : (N,) [s]
    q : (N, nq) position of the base, its quaternion x y z w, the joints; one without end as its cosine and sine
    v : (N, nv) linear and angular velocity of the base in base axes, rates of the joints
    a : (N, nv) the derivatives of these numbers; where a path's acceleration jumps, those that follow
    joint_names : of all joints, in the order of the columns
    """

    time: Array
    q: Array
    v: Array
    a: Array
    joint_names: tuple[str, ...]


def mujoco_arrays(
    motion: Motion | ForcedMotion,
    times: ArrayLike | None = None,
    *,
    model: Any = None,
    **fall: ArrayLike,
) -> MujocoArrays:
    """The motion as MuJoCo's `qpos` and `qvel`.

    Parameters
    ----------
    motion : of an articulated body, in any gauge
    times : (N,) [s]; None: 201 even times
    model : a `mujoco.MjModel` with one free joint, in whose order the joints are put by their names; None: all joints
        in the order in which MuJoCo compiles the body's file, behind a free joint
    fall : start, velocity, gravity as in `Motion.base_position`

    Raises
    ------
    UnknownNameError
        If the model has no free joint, or lacks joints of the body, or has others.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> found = sp.exports.mujoco_arrays(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), [0.0])
    >>> print(found.qpos[0, 3:7])  # the identity, w first
    [1. 0. 0. 0.]
    """
    check_keywords(fall, mujoco_arrays)
    whole = whole_motion(motion, checked_times(motion, times), Fall.of(**fall))
    check_no_balls(whole.body.chain.follows, "arrays of MuJoCo need")
    quaternions = whole.quat_xyzw[:, _SCALAR_FIRST]
    base = np.hstack([whole.position, quaternions]), np.hstack([whole.world_velocity, whole.angular_velocity])
    if model is None:
        names = simulator_order(whole.body, MUJOCO, whole.names)
        places = [whole.names.index(name) for name in names]
        qpos, qvel = np.hstack([base[0], whole.joints[:, places]]), np.hstack([base[1], whole.rates[:, places]])
        return MujocoArrays(time=whole.times, qpos=qpos, qvel=qvel, joint_names=names)
    check_object(model, "MjModel", "model", call="mujoco.MjModel.from_xml_path(file)")
    free = [k for k in range(model.njnt) if model.jnt_type[k] == _MUJOCO_FREE]
    names = [model.joint(k).name for k in range(model.njnt) if k not in free]
    order = _order(whole, names, "MuJoCo", len(free))
    places = [k for k in range(model.njnt) if k not in free]
    qpos, qvel = np.tile(model.qpos0, (len(whole.times), 1)), np.zeros((len(whole.times), model.nv))
    _fill(qpos, base[0], int(model.jnt_qposadr[free[0]]))
    _fill(qvel, base[1], int(model.jnt_dofadr[free[0]]))
    qpos[:, model.jnt_qposadr[places]] = whole.joints[:, order]
    qvel[:, model.jnt_dofadr[places]] = whole.rates[:, order]
    return MujocoArrays(time=whole.times, qpos=qpos, qvel=qvel, joint_names=tuple(names))


def pinocchio_arrays(
    motion: Motion | ForcedMotion,
    times: ArrayLike | None = None,
    *,
    model: Any = None,
    **fall: ArrayLike,
) -> PinocchioArrays:
    """The motion as Pinocchio's `q`, `v` and `a`, as Crocoddyl has them.

    Parameters
    ----------
    motion : of an articulated body, in any gauge
    times : (N,) [s]; None: 201 even times
    model : a `pinocchio.Model` whose first joint is a free-flyer, in whose order the joints are put by their names;
        None: all joints in the body's order
    fall : start, velocity, gravity as in `Motion.base_position`

    Raises
    ------
    ShapeError
        If joints follow others with kinks, which have no `a`.
    UnknownNameError
        If the model has no free-flyer, or lacks joints of the body, or has others.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> found = sp.exports.pinocchio_arrays(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), [0.0])
    >>> print(found.q[0, 3:7])  # the identity, w last
    [0. 0. 0. 1.]
    """
    check_keywords(fall, pinocchio_arrays)
    falling = Fall.of(**fall)
    whole = whole_motion(motion, checked_times(motion, times), falling)
    a, slopes = whole_accelerations(motion, whole, falling)
    q, v = whole.configurations, whole.velocities
    if model is None:
        return PinocchioArrays(time=whole.times, q=q, v=v, a=a, joint_names=whole.names)
    check_no_balls(whole.body.chain.follows, "arrays by the order of another model need")
    check_object(model, "Model", "model", call="pinocchio.buildModelFromUrdf(file, pinocchio.JointModelFreeFlyer())")
    kinds = list(model.joints)
    free = len(kinds) > 1 and (kinds[1].nq, kinds[1].nv) == (_FREE_Q, _FREE_V)
    names = list(model.names)[2:]
    order = _order(whole, names, "Pinocchio", int(free))
    count = len(whole.times)
    own = q[:, :_FREE_Q], v[:, :_FREE_V], a[:, :_FREE_V]
    q, v, a = (np.zeros((count, size)) for size in (model.nq, model.nv, model.nv))
    for array, base, first in zip((q, v, a), own, (kinds[1].idx_q, kinds[1].idx_v, kinds[1].idx_v), strict=True):
        _fill(array, base, first)
    for place, kind in zip(order, kinds[2:], strict=True):
        column = whole.joints[:, [place]]
        _fill(q, np.hstack([np.cos(column), np.sin(column)]) if kind.nq == 2 else column, kind.idx_q)
        _fill(v, whole.rates[:, [place]], kind.idx_v)
        _fill(a, slopes[:, [place]], kind.idx_v)
    return PinocchioArrays(time=whole.times, q=q, v=v, a=a, joint_names=tuple(names))


def _fill(array: Array, columns: Array, first: int) -> None:
    array[:, first : first + columns.shape[1]] = columns


def _order(whole: WholeMotion, names: list[str], program: str, free: int) -> list[int]:
    """Places of a model's joints among those of the body. Raises UnknownNameError."""
    if free != 1:
        raise UnknownNameError(f"model: a model of {program} with one free joint, the base, is needed; it has {free}")
    for given, others, fault in (
        (whole.names, names, f"the model of {program} lacks joints of {whole.body.name}"),
        (names, whole.names, f"the model of {program} has joints that {whole.body.name} has not"),
    ):
        lacking = [name for name in given if name not in others]
        if lacking:
            raise UnknownNameError(f"model: {fault}: {listed(lacking, 8)}")
    return [whole.names.index(name) for name in names]
