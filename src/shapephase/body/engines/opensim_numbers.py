"""Contents of OpenSim's objects as plain numbers; in the reading process alone."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array
from .chain import UnusableModelError


@lru_cache(maxsize=1)
def engine() -> Any:
    """OpenSim, imported by the first use: importing it with all modules would load another CasADi."""
    return import_module("opensim")


def loaded(path: str) -> Any:
    """The model of a file, its parts connected. Raises UnusableModelError."""
    try:
        model = engine().Model(path)
        model.finalizeConnections()
    except RuntimeError as error:
        raise refused(error) from None
    return model


def refused(error: Exception) -> UnusableModelError:
    """The error of OpenSim in one line."""
    message = " ".join(str(error).split("Thrown at")[0].split())
    return UnusableModelError(f"OpenSim does not accept it: {message.removeprefix('std::exception in ')}")


def ends(joint: Any) -> tuple[str, str]:
    """Names of the bodies that a joint joins, the ground's is 'ground'."""
    frames = [frame.findBaseFrame() for frame in (joint.getParentFrame(), joint.getChildFrame())]
    first, second = ("ground" if one.getAbsolutePathString() == "/ground" else one.getName() for one in frames)
    return (second, first) if second == "ground" else (first, second)


def value_and_slope(function: Any, places: list[float]) -> list[float]:
    """The value of a function of OpenSim, and its derivative by each argument."""
    where = engine().Vector(len(places), 0.0)
    for k, place in enumerate(places):
        where.set(k, place)
    results = [function.calcValue(where)]
    for k in range(len(places)):
        which = engine().StdVectorInt()
        which.append(k)
        results.append(function.calcDerivative(which, where))
    return results


def pose_of(transform: Any) -> tuple[Array, Array]:
    """Orientation and origin."""
    matrix = transform.R().asMat33()
    return np.array([[matrix.get(i, j) for j in range(3)] for i in range(3)]), vector_of(transform.p())


def tensor_of(body: Any) -> Array:
    """The inertia of a body about its centre of mass, in its axes."""
    inertia = body.getInertia()
    (xx, yy, zz), (xy, xz, yz) = vector_of(inertia.getMoments()), vector_of(inertia.getProducts())
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def vector_of(entries: Any, count: int = 3) -> Array:
    """The entries of one of Simbody's vectors."""
    return np.array([entries.get(k) for k in range(count)])


def entries_of(entries: Any) -> list[Any]:
    """The entries of one of OpenSim's arrays or sets."""
    return [entries.get(k) for k in range(entries.getSize())]
