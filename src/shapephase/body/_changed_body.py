"""A body as it is, but for its inertias, or for joints that follow others."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, where a type checker cannot look.
# pyright: reportAttributeAccessIssue=false
from collections.abc import Mapping
from copy import copy
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..arrays import Array
from ..errors import ShapeError, unknown_name
from ..letters import what_came
from ._model_tree import model_with, moving_joints
from .couplings.coupling import Coupling

if TYPE_CHECKING:
    from .body import Body


def changed_body(body: Body, masses: Array, centres: Array, tensors: Array) -> Body:
    """A body with other inertias, of all frames of its chain and in their axes: (k + 1,), (k + 1, 3), (k + 1, 3, 3)."""
    changed = copy(body)
    # The first two frames of a ball joint are none of the model's.
    between = [frame for ball in body.chain.follows.balls for frame in (ball.row + 1, ball.row + 2)]
    changed._model = model_with(body._model, *(np.delete(one, between, axis=0) for one in (masses, centres, tensors)))
    changed.mass = float(pin.computeTotalMass(changed._model))
    changed.chain = body.chain.with_inertias(masses, centres, tensors)
    # It is no longer what the file says.
    changed.sha256 = changed.file = None
    return changed


def coupled_body(body: Body, couplings: Mapping[str, Coupling]) -> Body:
    """A body some of whose joints follow others, as `Body.with_couplings` says."""
    if not isinstance(couplings, Mapping):
        raise ShapeError(
            "couplings by joint are needed, such as {'knee': Coupling.linear('hip', 0.5)}, got " + what_came(couplings)
        )
    for name, coupling in couplings.items():
        joints = tuple(moving_joints(body._model))
        if name not in joints:
            raise unknown_name(f"joint of {body.name}", name, joints)
        if not isinstance(coupling, Coupling):
            raise ShapeError(f"joint {name}: a Coupling is needed, got {what_came(coupling)}")
    changed = type(body)(body._model, body.name, {**body.couplings, **couplings})
    changed.joint_orders, changed.base_joints = body.joint_orders, body.base_joints
    changed.base_angles, changed.base_slides = body.base_angles, body.base_slides
    changed.length_unit = body.length_unit
    return changed
