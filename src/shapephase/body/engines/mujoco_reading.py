"""MJCF models, as MuJoCo (Todorov, Erez and Tassa 2012) compiles them.

Includes, defaults, frames, replicas, attachments, meshes with mass and the settings of the compiler are MuJoCo's; what
is taken over is the compiled tree of bodies, joints and inertias, and which joints follow others. The motor inertia of
joints (`armature`) belongs to no link and is left out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

# What its compiled part brings, a type checker does not see.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from ... import so3
from ...arrays import FARTHEST, Array
from ..couplings.ball_joints import BallJoint, coordinate_names
from ..couplings.coupling import Coupling, circular, with_followers
from ..couplings.functions import polynomial
from ..formats.xml_text import listed
from ..link_tree import MOST_LINKS, MOST_MASS
from .chain import EXACT, FRAME_ERRORS, Chain, UnusableModelError, check_name, locked_inertia
from .mujoco_model import BALL, FREE, SLIDE, Compiled, base_of, compiled_model, rotation

_COUPLED = int(mujoco.mjtEq.mjEQ_JOINT)
_CONNECT = int(mujoco.mjtEq.mjEQ_CONNECT)
_WELD = int(mujoco.mjtEq.mjEQ_WELD)
_BY_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_BY_SITE = int(mujoco.mjtWrap.mjWRAP_SITE)  # of a tendon's path, what belongs to a body
_OF_SITES = int(mujoco.mjtObj.mjOBJ_SITE)


def chain_of(path: str, root: str | None = None, root_body: str | None = None) -> Chain:
    """Links and joints of an MJCF file.

    root : "free" removes a single joint between the body that floats and the world, too
    root_body : the body that floats, with all that hangs on it
    """
    compiled = compiled_model(path)
    base, way, notes = base_of(compiled, root, root_body)
    bodies = compiled.below(base)
    if len(bodies) > MOST_LINKS:
        raise UnusableModelError(f"<mujoco>: the body has {len(bodies)} links; up to {MOST_LINKS} are supported")
    own = set(bodies)
    name = bytes(compiled.model.names).split(b"\0", 1)[0].decode(errors="replace")
    chain = Chain(name or Path(path).stem, notes=[*compiled.notes, *notes])
    chain.couplings = _couplings(compiled, own, base)
    _check_carried(compiled, own)
    for body in bodies:
        _add_link(chain, compiled, body)
        if body != base:
            _add_joints(chain, compiled, body)
    moved = Chain("")
    for body in way:
        # A free joint does not lead to the body.
        if all(compiled.model.jnt_type[joint] != FREE for joint in compiled.joints_of(body)):
            _add_joints(moved, compiled, body)
    chain.base_joints = moved.joints if moved.moving() else []
    chain.notes += _ignored(compiled, own)
    if compiled.model.body_subtreemass[base] > 0.0:
        _add_poses(chain, compiled, bodies)
    return chain


# ---- Links and joints -----------------------------------------------------------------------------------------------


def _add_link(chain: Chain, compiled: Compiled, body: int) -> None:
    model, name, line = compiled.model, compiled.names[body], compiled.line(body)
    check_name(name, f"body {name!r}", line)
    mass, moments = float(model.body_mass[body]), model.body_inertia[body]
    if not max(mass, np.abs(moments).max()) < MOST_MASS:
        numbers = f"{mass:g} kg, moments {moments.tolist()} kg m^2"
        raise UnusableModelError(f"body {name!r}: {numbers}: too large, less than {MOST_MASS:g} is needed", line)
    lengths = np.concatenate([model.body_pos[body], model.body_ipos[body]])
    _check_places(lengths, np.concatenate([model.body_quat[body], model.body_iquat[body]]), f"body {name!r}", line)
    turn = rotation(model.body_iquat[body])
    tensor = turn @ np.diag(moments) @ turn.T
    chain.add_link(name, mass, model.body_ipos[body], 0.5 * (tensor + tensor.T), line)


def _check_places(places: Array, directions: Array, owner: str, line: int) -> None:
    if not np.isfinite(directions).all():
        raise UnusableModelError(f"{owner}: it is turned by {directions.tolist()}: finite numbers are needed", line)
    if not np.abs(places).max() < FARTHEST:
        raise UnusableModelError(f"{owner}: its places {places.tolist()} m: less than {FARTHEST:g} is needed", line)


def _add_joints(chain: Chain, compiled: Compiled, body: int) -> None:
    """The joints of a body, one after the other, each about its own place in the body."""
    model, child = compiled.model, compiled.names[body]
    parent = compiled.names[int(model.body_parentid[body])]
    place, turn = model.body_pos[body], rotation(model.body_quat[body])
    joints = compiled.joints_of(body)
    if not joints:
        chain.add_joints(parent, child, place, turn, [])
    anchor = np.zeros(3)
    for joint in joints:
        name, axis = compiled.joint_name(joint), model.jnt_axis[joint]
        owner, line = f"joint {name!r}", compiled.line(joint, "joint")
        check_name(name, owner, line)
        _check_places(model.jnt_pos[joint], axis, owner, line)
        ball = model.jnt_type[joint] == BALL
        sliding = model.jnt_type[joint] == SLIDE
        place = place + turn @ (model.jnt_pos[joint] - anchor)
        anchor = model.jnt_pos[joint]
        # The coordinate does not begin at zero where the file has the body.
        by = 0.0 if ball else -_reference(model, joint)
        place, turn = (place + by * (turn @ axis), turn) if sliding else (place, turn @ so3.exp(by * axis))
        lower, upper = model.jnt_range[joint].tolist()
        if lower > upper:
            raise UnusableModelError(
                f"{owner}: range: the lower limit {lower:g} is above the upper one, {upper:g}", line
            )
        limits = [lower, upper] if model.jnt_limited[joint] and not ball else None
        kind = "ball" if ball else "prismatic" if sliding else "continuous" if limits is None else "revolute"
        if ball and model.jnt_limited[joint]:
            chain.notes.append(("joint", repr(name), "the range of a ball joint is ignored"))
        last = joint == joints[-1]
        below = child if last else f"{child}\0{name}"
        if not last:
            # A step between two joints of a body.
            chain.add_frame(below)
        after = -anchor if last else np.zeros(3)
        chain.add_joint(name, kind, parent, below, place, turn, axis, limits, after, line)
        parent, place, turn = below, np.zeros(3), np.eye(3)


# ---- Equalities and what else holds parts together ------------------------------------------------------------------


def _couplings(compiled: Compiled, own: set[int], base: int) -> dict[str, Coupling]:
    """The joints of the body that follow others, by equalities of joints; those at the root are gone."""
    model = compiled.model
    joints = {joint for body in own - {base} for joint in compiled.joints_of(body)}
    couplings: dict[str, Coupling] = {}
    lines: dict[str, int] = {}
    for number in _active(model, _COUPLED):
        follower, leader = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        if follower not in joints:
            continue
        name, line = compiled.joint_name(follower), compiled.line(follower, "joint")
        if name in couplings:
            raise UnusableModelError(f"joint {name!r}: two equalities hold it; keep one", line)
        start, powers, lines[name] = _reference(model, follower), model.eq_data[number, :5], line
        if leader < 0:
            couplings[name] = Coupling(start + float(powers[0]))
            continue
        if leader not in joints:
            raise UnusableModelError(
                f"joint {name!r}: it follows {compiled.joint_name(leader)!r}, which does not belong to the free body; "
                "remove the equality",
                line,
            )
        function = polynomial(np.array(powers), _reference(model, leader))
        couplings[name] = Coupling(start, ((compiled.joint_name(leader), function),))
    if (name := circular(couplings)) is not None:
        raise UnusableModelError(
            f"joint {name!r}: by equalities joints follow each other in a circle; remove one", lines[name]
        )
    return couplings


def _reference(model: Any, joint: int) -> float:
    """The coordinate at which the body is where the file has it."""
    return float(model.qpos0[model.jnt_qposadr[joint]])


def _active(model: Any, *kinds: int) -> list[int]:
    return [number for number in range(model.neq) if model.eq_active0[number] and int(model.eq_type[number]) in kinds]


def _held(model: Any, number: int) -> tuple[int, int]:
    """The two bodies that a weld or connection holds together."""
    pair = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
    if int(model.eq_objtype[number]) == _OF_SITES:
        return int(model.site_bodyid[pair[0]]), int(model.site_bodyid[pair[1]])
    return pair


def _check_carried(compiled: Compiled, own: set[int]) -> None:
    """Raise UnusableModelError where parts outside the body are tied to it, or soft parts are among its own."""
    model = compiled.model
    for number in _active(model, _CONNECT, _WELD):
        first_body, second_body = _held(model, number)
        outside = second_body if first_body in own else first_body
        if (first_body in own) != (second_body in own) and model.body_treeid[outside] >= 0:
            inside = first_body if first_body in own else second_body
            raise UnusableModelError(
                f"body {compiled.names[inside]!r}: the equality {_equality(model, number)} makes it carry "
                f"{compiled.names[outside]!r}, which is not part of the free body; remove one of them",
                compiled.line(inside),
            )
    for flex in range(model.nflex):
        first = int(model.flex_vertadr[flex])
        soft = own & set(model.flex_vertbodyid[first : first + int(model.flex_vertnum[flex])].tolist())
        if soft:
            body = min(soft)
            raise UnusableModelError(
                f"body {compiled.names[body]!r}: soft bodies (flex) are not rigid links; remove them",
                compiled.line(body),
            )


def _equality(model: Any, number: int) -> str:
    return f"{model.eq(number).name or number!r} ({'weld' if int(model.eq_type[number]) == _WELD else 'connect'})"


def _ignored(compiled: Compiled, own: set[int]) -> list[str | tuple[str, str, str]]:
    """Notes on what holds or drives joints of the body, which are free here."""
    model = compiled.model
    notes: list[str | tuple[str, str, str]] = []
    for number in _active(model, _CONNECT, _WELD):
        first_body, second_body = _held(model, number)
        pair = f"{compiled.names[first_body]!r} and {compiled.names[second_body]!r}"
        named = _equality(model, number)
        if own & {first_body, second_body}:
            free = "every joint moves on its own" if own >= {first_body, second_body} else "the body is free"
            notes.append(("equality", f"{named} of {pair}", f"ignored, {free}"))
    tendons = [model.tendon(tendon) for tendon in range(model.ntendon) if _led_over(model, tendon) & own]
    ends = np.reshape([model.geom_bodyid[model.pair_geom1], model.geom_bodyid[model.pair_geom2]], (2, -1)).T.tolist()
    pairs = [model.pair(pair) for pair, bodies in enumerate(ends) if own & set(bodies)]
    for parts, what in (
        (tendons, "tendons are ignored, every joint moves on its own"),
        (pairs, "contacts are ignored"),
    ):
        if parts:
            notes.append(f"{what}: {listed([repr(part.name or str(part.id)) for part in parts])}")
    return notes


def _led_over(model: Any, tendon: int) -> set[int]:
    """The bodies of its joints and sites."""
    first = int(model.tendon_adr[tendon])
    bodies = set()
    for wrap in range(first, first + int(model.tendon_num[tendon])):
        kind, number = int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
        if kind == _BY_JOINT:
            bodies.add(int(model.jnt_bodyid[number]))
        elif kind == _BY_SITE:
            bodies.add(int(model.site_bodyid[number]))
    return bodies


# ---- What MuJoCo computes -------------------------------------------------------------------------------------------


def _add_poses(chain: Chain, compiled: Compiled, bodies: list[int]) -> None:
    """Mass, centre, inertia and momentum with the body that floats at rest."""
    model, base = compiled.model, bodies[0]
    names = {joint: compiled.joint_name(joint) for body in bodies[1:] for joint in compiled.joints_of(body)}
    quaternions = np.concatenate([model.body_quat[bodies], model.body_iquat[bodies]])
    lengths = np.concatenate([np.linalg.norm(quaternions, axis=1), np.linalg.norm(model.jnt_axis, axis=1)])
    tolerance = EXACT + FRAME_ERRORS * float(np.abs(lengths - 1.0).max())
    # Near the origin nothing is lost by where the file puts the body.
    above = base
    while above:
        model.body_pos[above], model.body_quat[above] = 0.0, (1.0, 0.0, 0.0, 0.0)
        above = int(model.body_parentid[above])
    data = mujoco.MjData(model)
    for joint in compiled.joints_of(base):
        if model.jnt_type[joint] == FREE:
            first = int(model.jnt_qposadr[joint])
            data.qpos[first : first + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    for shape, rate in chain.random_shapes():
        coordinates, rates = with_followers(chain.couplings, shape, rate)
        for joint, name in names.items():
            if model.jnt_type[joint] == BALL:
                ball, where, first = BallJoint(name, 0, 0), int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
                four = [np.array([[values[part] for part in coordinate_names(name)]]) for values in (shape, rate)]
                data.qpos[where : where + 4] = np.roll(ball.quaternions(four[0])[0], 1)
                data.qvel[first : first + 3] = ball.rates(*four)[0]
                continue
            data.qpos[model.jnt_qposadr[joint]] = coordinates[name]
            data.qvel[model.jnt_dofadr[joint]] = rates[name]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        axes = data.xmat[base].reshape(3, 3)
        turns = data.ximat[bodies].reshape(-1, 3, 3)
        tensors = turns @ (model.body_inertia[bodies][:, :, None] * np.swapaxes(turns, 1, 2))
        inertia = locked_inertia(model.body_mass[bodies], data.xipos[bodies], tensors)
        momentum = axes.T @ data.subtree_angmom[base]
        centre = axes.T @ (data.subtree_com[base] - data.xpos[base])
        whole = float(model.body_subtreemass[base]), centre
        chain.add_pose(shape, rate, axes.T @ inertia @ axes, momentum, (tolerance, tolerance), whole)
