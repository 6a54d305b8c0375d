"""A body as it is, but for its inertias."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, where a type checker cannot look.
# pyright: reportAttributeAccessIssue=false
from copy import copy
from typing import TYPE_CHECKING

import pinocchio as pin

from ..arrays import Array
from ._model_tree import model_with

if TYPE_CHECKING:
    from .body import Body


def changed_body(body: Body, masses: Array, centres: Array, tensors: Array) -> Body:
    """A body with other inertias, of all frames of its chain and in their axes: (k + 1,), (k + 1, 3), (k + 1, 3, 3)."""
    changed = copy(body)
    changed._model = model_with(body._model, masses, centres, tensors)
    changed.mass = float(pin.computeTotalMass(changed._model))
    changed.chain = body.chain.with_inertias(masses, centres, tensors)
    # It is no longer what the file says.
    changed.sha256 = changed.file = None
    return changed
