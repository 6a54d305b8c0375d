"""Pinocchio's model of a checked tree of links, and checks of a user's own model."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, which a type checker cannot follow.
# pyright: reportAttributeAccessIssue=false
from typing import Any

import numpy as np
import pinocchio as pin

from .. import so3
from ..arrays import Array
from ..errors import ModelFileError, ShapeError
from ..inertia_tensor import second_moment
from ..letters import value_text
from .link_tree import Link, LinkTree, inertia_warnings

_ROUNDING = 1e-12  # of the largest wheel that a link could hold: what rounding leaves of a limit reached exactly
_ROOT = "shapephase_free_flyer"  # name of the joint that lets the base move: unlikely in a file
BALL = "JointModelSpherical"  # Pinocchio's ball joint: a unit quaternion, and rates in axes of the child
# What to use for joints whose own coordinates would not do.
_INSTEAD = {
    "JointModelSphericalZYX": "its first and last axis can fall together; use the other",
    "JointModelPlanar": "its slides turn with it; use two prismatic joints and a revolute one behind them",
    "JointModelFreeFlyer": "only the base floats; use three prismatic joints and a ball joint behind them",
    "JointModelTranslation": "use three prismatic joints in a row",
}


def model_of(tree: LinkTree, where: str) -> pin.Model:
    """A model with a free-flyer from a checked tree: by Pinocchio's parser from a URDF's text, else joint by joint."""
    root = _ROOT
    taken = {*tree.links, *(joint.name for joint in tree.joints)}
    while root in taken:
        root += "_"
    try:
        if tree.text is not None:
            return pin.buildModelFromXML(tree.text, pin.JointModelFreeFlyer(), root)
        return _built(tree, root)
    except (ValueError, RuntimeError) as error:
        raise ModelFileError(f"{where}:1: robot {tree.name!r}: Pinocchio does not accept it: {error}") from None


def checked_model(source: Any, on_unphysical: str) -> tuple[pin.Model, list[Link], Array, list[str]]:
    """A copy of a user's model, what each joint moves, its orientation (N, 3, 3) in the neutral shape, and doubts.

    A link named after the joint is added to whatever a joint moves without a link of its own, so that it has a pose.
    """
    if not isinstance(source, pin.Model):
        raise ModelFileError(f"a body is loaded from a path, a name or a pinocchio.Model, got {type(source).__name__}")
    where = f"model {source.name!r}"
    if source.njoints < 2 or source.joints[1].shortname() != "JointModelFreeFlyer":
        raise ModelFileError(
            f"{where}: the model's root joint is no free-flyer, so the mass of its root link is lost; build it with "
            "pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer())"
        )
    links = [
        Link(name, where, inertia.mass, np.array(inertia.lever), np.array(inertia.inertia))
        for name, inertia in zip(list(source.names)[1:], source.inertias.tolist()[1:], strict=True)
    ]
    doubts = inertia_warnings(links, on_unphysical, "what joint {!r} moves")
    if not any(link.mass for link in links):
        raise ModelFileError(f"{where}: nothing in it has mass")
    model = source.copy()
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    turns = np.array([data.oMi[number].rotation for number in range(1, model.njoints)])
    named = {frame.parentJoint for frame in model.frames if frame.type == pin.FrameType.BODY}
    for joint in range(1, model.njoints):
        if joint not in named and not model.existFrame(model.names[joint], pin.FrameType.BODY):
            model.addBodyFrame(model.names[joint], joint, pin.SE3.Identity(), 0)
    return model, links, turns, doubts


def model_with(model: pin.Model, masses: Array, centres: Array, tensors: Array) -> pin.Model:
    """A copy whose joints, from the free-flyer on, move other inertias, in their axes: (k,), (k, 3), (k, 3, 3)."""
    changed = model.copy()
    for place, (mass, centre, tensor) in enumerate(zip(masses.tolist(), centres, tensors, strict=True), start=1):
        changed.inertias[place] = _inertia(mass, centre, tensor)
    return changed


def moving_joints(model: pin.Model) -> dict[str, int]:
    """Names and numbers of the joints below the free-flyer, in Pinocchio's order."""
    moving = {}
    for number in range(2, model.njoints):
        joint = model.joints[number]
        kind = joint.shortname()
        single = joint.nv == 1 and (joint.nq == 1 or kind.startswith("JointModelRUB") or "Unbounded" in kind)
        if kind != BALL and (not single or "Mimic" in kind):
            raise ModelFileError(
                f"joint {model.names[number]!r} is a {kind}; joints of one axis are supported (revolute, continuous, "
                f"prismatic), and ball joints ({BALL}): {_INSTEAD.get(kind, 'replace it by a chain of those')}"
            )
        moving[model.names[number]] = number
    return moving


def _built(tree: LinkTree, root: str) -> pin.Model:
    """A model made joint by joint, in the order of the tree."""
    model = pin.Model()
    model.name = tree.name
    number = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), root)
    # Every link hangs on a joint of the model, somewhere.
    hangs = {next(iter(tree.links)): (number, pin.SE3.Identity())}
    for joint in tree.joints:
        number, pose = hangs[joint.parent]
        pose, after = pose * pin.SE3(joint.turn, joint.place), pin.SE3(np.eye(3), joint.after)
        if joint.kind != "fixed":
            axis = joint.axis / np.linalg.norm(joint.axis)
            lower, upper = np.reshape(joint.limits, (2, 1))
            most = np.reshape(joint.most, (2, 1))
            sliding = joint.kind == "prismatic"
            moving = (pin.JointModelPrismaticUnaligned if sliding else pin.JointModelRevoluteUnaligned)(axis)
            if joint.kind == "screw":
                moving = pin.JointModelHelicalUnaligned(axis, joint.lead)
            if joint.kind == "continuous":
                moving, turned = _endless(axis)
                pose, after = pose * turned, turned.inverse() * after
                lower, upper = -np.ones(2), np.ones(2)
            if joint.kind == "ball":
                moving, lower, upper, most = pin.JointModelSpherical(), -np.ones(4), np.ones(4), np.zeros((2, 3))
            number = model.addJoint(number, moving, pose, joint.name, most[0], most[1], lower, upper)
            pose = pin.SE3.Identity()
        hangs[joint.child] = number, pose * after
    for name, (number, pose) in hangs.items():
        if name not in tree.frames:
            link = tree.links[name]
            model.appendBodyToJoint(number, _inertia(link.mass, link.centre, link.inertia), pose)
            model.addBodyFrame(name, number, pose, 0)
    return model


def model_with_wheel(model: pin.Model, link: int, axis: Array, inertia: float, name: str) -> pin.Model:
    """A copy with a wheel about `axis` (3,), in the axes of a frame, at the centre of mass of what moves with it.

    link : number of the frame
    inertia : about the axis [kg m^2]; it is taken out of the link. Raises ShapeError where it holds less
    """
    changed, frame = model.copy(), model.frames[link]
    number, whole = frame.parentJoint, model.inertias[frame.parentJoint]
    axle = frame.placement.rotation @ axis
    tensor, centre = np.array(whole.inertia), np.array(whole.lever)
    mass, disc = _carved_wheel(whole.mass, tensor, axle, inertia, frame.name)
    changed.inertias[number] = _inertia(whole.mass - mass, centre, tensor - disc)
    moving, turned = _endless(axle)
    place = pin.SE3(np.eye(3), centre) * turned
    none, ends = np.zeros(1), np.ones(2)
    added = changed.addJoint(number, moving, place, name, none, none, -ends, ends)
    back = turned.inverse()
    changed.appendBodyToJoint(added, _inertia(mass, np.zeros(3), disc), back)
    # Its axes at zero are those of the link.
    changed.addBodyFrame(name, added, back * pin.SE3(frame.placement.rotation, np.zeros(3)), 0)
    return changed


def _carved_wheel(mass: float, tensor: Array, axle: Array, inertia: float, link: str) -> tuple[float, Array]:
    """Mass and inertia of a wheel about the centre of mass that it shares with its link, which has these without it.

    A flat disc, J a a^T + J/2 (1 - a a^T), whose radius of gyration is that of the link, so that its mass is less.

    Raises ShapeError if no distribution of mass has what is left: its integral of r r^T dm would not be positive.

    mass, tensor : of the link with the wheel in it [kg], (3, 3) [kg m^2]
    axle : (3,) unit vector a
    inertia : J [kg m^2]
    link : its name, for messages
    """
    moment = second_moment(tensor)
    frame = so3.between(np.array([0.0, 0.0, 1.0]), axle)
    turned = frame.T @ moment @ frame
    along, beside = float(turned[2, 2]), turned[:2, 2]
    # J/2 across the axle may be taken out while the Schur complement of the part along it stays positive.
    across = turned[:2, :2] - (np.outer(beside, beside) / along if along > 0.0 else 0.0)
    largest = 2.0 * float(np.linalg.eigvalsh(across)[0])
    if mass <= 0.0 or inertia > largest * (1.0 + _ROUNDING):
        raise ShapeError(
            f"inertia: a wheel of {value_text(inertia)} kg m^2 about this axis is more than link {link!r} ({mass:.6g} "
            f"kg) can hold; up to {max(largest, 0.0):.6g} kg m^2 would leave it an inertia that some distribution of "
            "mass has. Is the wheel on another link (link=), or its mass not in the file?"
        )
    disc = 0.5 * inertia * (np.eye(3) + np.outer(axle, axle))
    return mass * inertia / float(np.trace(moment)), disc


def _endless(axis: Array) -> tuple[Any, pin.SE3]:
    """Pinocchio's joint without end cannot be given an axis: one about x, and the turn of x to a unit vector."""
    return pin.JointModelRUBX(), pin.SE3(so3.between(np.array([1.0, 0.0, 0.0]), axis), np.zeros(3))


def _inertia(mass: float, centre: Array, tensor: Array) -> pin.Inertia:
    # Entry by entry: the constructor refuses what `on_unphysical` may allow.
    inertia = pin.Inertia.Zero()
    inertia.mass, inertia.lever, inertia.inertia = mass, centre, tensor
    return inertia
