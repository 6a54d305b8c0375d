"""A body against the numbers of its file: mass, links, joints, and one I(q), L_o computed without Pinocchio.

Whatever a parser drops, lumps or turns the wrong way shows here, and no such body leaves `load_body`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array
from ..errors import ModelFileError
from .body import Body
from .couplings.ball_joints import coordinate_names
from .couplings.coupling import with_followers
from .engines.chain import EXACT, SEED
from .engines.chain import inertia_and_momentum as of_parts
from .link_tree import LinkTree
from .virtual_base import joint_coordinates


def check_against_file(body: Body, tree: LinkTree, where: str) -> None:
    """Compare a body with the tree of links that its file has."""
    if not body.mass > 0.0:
        first = next(iter(tree.links.values()))
        raise ModelFileError(
            f"{first.where}: link {first.name!r}: neither it nor any other link has mass; "
            "give each that moves its <inertial> with <mass>, <origin> and <inertia>"
        )
    joints = (joint for joint in tree.joints if joint.name not in tree.couplings)
    coordinates = {name for joint in joints for name in joint_coordinates(joint)}
    for what, own, expected in (
        ("links", set(body.link_names), {*tree.links} - tree.frames),
        ("joints", set(body.joint_names), coordinates),
    ):
        if own != expected:
            raise _differs(where, what, f"lost {sorted(expected - own)}", f"gained {sorted(own - expected)}")
    mass = sum(link.mass for link in tree.links.values())
    _compare(where, "mass", body.mass, mass, EXACT * mass)
    random = np.random.default_rng(SEED)
    shape, rate = random.uniform(-1.0, 1.0, (2, body.n_shape))
    by_name = [dict(zip(body.joint_names, values, strict=True)) for values in (shape.tolist(), rate.tolist())]
    inertia, momentum, extent, motion = inertia_and_momentum(tree, *by_name)
    _compare(where, "inertia", body.locked_inertia(shape), inertia, EXACT * extent)
    _compare(where, "momentum", body.internal_momentum(shape, rate), momentum, EXACT * motion)


def check_against_engine(body: Body, tree: LinkTree, poses: list[dict[str, Any]], where: str) -> None:
    """Compare a body with the engine that owns its format, at random shapes and rates."""
    for pose in poses:
        shape, rate = (np.array([pose[of][name] for name in body.joint_names]) for of in ("shape", "rate"))
        *_, extent, motion = inertia_and_momentum(tree, pose["shape"], pose["rate"])
        exact, coarse = pose["tolerance"]
        inertia = np.reshape(pose["inertia"], (3, 3))
        _compare(where, "inertia", body.locked_inertia(shape), inertia, exact * extent, "engine")
        _compare(where, "momentum", body.internal_momentum(shape, rate), pose["momentum"], coarse * motion, "engine")
        if pose["mass"] is not None:
            _compare(where, "mass", body.mass, pose["mass"], exact * body.mass, "engine")
            # The centre is off by its share of the size of the body.
            off = exact * np.sqrt(extent / body.mass)
            _compare(where, "centre", body.centre_of_mass(shape), pose["centre"], off, "engine")


def inertia_and_momentum(
    tree: LinkTree, shape: dict[str, float], rate: dict[str, float]
) -> tuple[Array, Array, float, float]:
    """Locked inertia and internal momentum from the definitions, link by link.

    shape, rate : coordinates and rates of the independent joints by name [rad or m], [rad/s or m/s]

    inertia, momentum : (3, 3) [kg m^2], (3,) [kg m^2/s] about the centre of mass, axes of the root link
    extent, motion : the size of the terms they are sums of, seen from the root link; rounding is a share of it

    Source: theory.md A3, A7.
    """
    names = list(tree.links)
    place = {name: number for number, name in enumerate(names)}
    parents = [place[joint.parent] for joint in tree.joints]
    children = [place[joint.child] for joint in tree.joints]
    states = with_followers(tree.couplings, shape, rate)
    angles, rates = np.array([[values.get(joint.name, 0.0) for joint in tree.joints] for values in states])
    turning = np.array([joint.kind != "prismatic" for joint in tree.joints], dtype=bool)
    leads = np.array([joint.lead if joint.kind == "screw" else joint.kind == "prismatic" for joint in tree.joints])
    stacked = [np.array([getattr(j, what) for j in tree.joints]) for what in ("axis", "place", "after", "turn")]
    axes, places, afters = (array.reshape(-1, 3) for array in stacked[:3])
    axes = axes / np.sqrt((axes**2).sum(axis=-1, keepdims=True))
    turns = stacked[3].reshape(-1, 3, 3)
    own = so3.exp(axes * (turning * angles)[:, None])
    # How the child turns or slides, in the joint's axes.
    motions = axes * rates[:, None]
    for number, joint in enumerate(tree.joints):
        if joint.kind == "ball":
            four = np.array([[values[key] for key in coordinate_names(joint.name)] for values in (shape, rate)])
            own[number], motions[number] = _ball_motion(*four)
    moved = turns @ own
    slides = places + (turns @ (axes * (leads * angles)[:, None])[..., None])[..., 0]
    slides += (moved @ afters[..., None])[..., 0]
    pose_turn, pose_place = np.zeros((len(names), 3, 3)), np.zeros((len(names), 3))
    pose_turn[0] = np.eye(3)
    for number, (parent, child) in enumerate(zip(parents, children, strict=True)):
        pose_turn[child] = pose_turn[parent] @ moved[number]
        pose_place[child] = pose_place[parent] + pose_turn[parent] @ slides[number]
    # How each link moves: omega, and the velocity of its origin.
    directions = (pose_turn[parents] @ (turns @ motions[..., None]))[..., 0]
    omega, velocity = np.zeros((len(names), 3)), np.zeros((len(names), 3))
    for number, (parent, child) in enumerate(zip(parents, children, strict=True)):
        omega[child] = omega[parent] + turning[number] * directions[number]
    hinges = pose_place[children] - (pose_turn[children] @ afters[..., None])[..., 0]
    steps = np.cross(omega[parents], hinges - pose_place[parents])
    steps += np.cross(omega[children], pose_place[children] - hinges) + leads[:, None] * directions
    for number, (parent, child) in enumerate(zip(parents, children, strict=True)):
        velocity[child] = velocity[parent] + steps[number]
    links = tree.links.values()
    masses = np.array([link.mass for link in links])
    offsets = (pose_turn @ np.array([link.centre for link in links])[..., None])[..., 0]
    own_tensors = np.array([link.inertia for link in links])
    tensors = pose_turn @ own_tensors @ np.swapaxes(pose_turn, -1, -2)
    centres, speeds = pose_place + offsets, velocity + np.cross(omega, offsets)
    # The largest term of every sum, and with it the rounding, is that of the farthest part at the fastest rate.
    distances = np.sqrt((centres**2).sum(axis=-1))
    extent = float(masses @ distances**2 + np.abs(tensors).sum())
    motion = float(distances.max() * (masses @ np.sqrt((speeds**2).sum(axis=-1))))
    motion += extent * float(np.abs(motions).max(initial=0.0))
    return *of_parts(masses, own_tensors, centres, pose_turn, speeds, omega), extent, motion


def _ball_motion(numbers: Array, derivatives: Array) -> tuple[Array, Array]:
    """The turn of a ball joint and its angular velocity, axes of the parent: (4,), (4,) -> (3, 3), (3,).

    R = (w^2 - v.v + 2 v v^T + 2 w v x)/|p|^2, and its rate times R^T.
    """
    (*vector, scalar), (*change, swing) = numbers, derivatives
    v, dv, square = np.array(vector), np.array(change), float(numbers @ numbers)
    whole = (scalar**2 - v @ v) * np.eye(3) + 2.0 * (np.outer(v, v) + scalar * so3.hat(v))
    slope = 2.0 * (scalar * swing - v @ dv) * np.eye(3)
    slope += 2.0 * (np.outer(dv, v) + np.outer(v, dv) + swing * so3.hat(v) + scalar * so3.hat(dv))
    turn = whole / square
    spin = (slope - 2.0 * float(numbers @ derivatives) * turn) @ turn.T / square
    return turn, 0.5 * np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]])


def _compare(where: str, what: str, own: ArrayLike, expected: ArrayLike, off: float, source: str = "file") -> None:
    # NaN fails this comparison.
    if not np.all(np.abs(np.asarray(own) - np.asarray(expected)) <= off):
        raise _differs(where, what, np.asarray(own).tolist(), np.asarray(expected).tolist(), source)


def _differs(where: str, what: str, own: object, expected: object, source: str = "file") -> ModelFileError:
    return ModelFileError(
        f"{where}:1: the body made from this file has another {what} than the {source}: {own} against {expected}; "
        "please report this file"
    )
