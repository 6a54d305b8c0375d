"""Inertia and momentum by OpenSim itself at some shapes; in the reading process alone."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from ...arrays import Array
from .chain import Chain, inertia_and_momentum
from .opensim_numbers import engine, entries_of, loaded, pose_of, refused, tensor_of, value_and_slope, vector_of


def add_poses(
    chain: Chain, path: str, base: str, bodies: Collection[str], coordinates: Mapping[str, float | None]
) -> None:
    """Add what OpenSim computes with the base at rest.

    bodies : names of those that belong to the chain
    coordinates : of these, and where they are locked
    """
    bare = loaded(path)
    rules = _rules(bare)
    for components in (bare.updForceSet(), bare.updControllerSet(), bare.updConstraintSet(), bare.updProbeSet()):
        components.clearAndDestroy()
    known = {coordinate.getName(): coordinate for coordinate in entries_of(bare.updCoordinateSet())}
    for coordinate in known.values():
        coordinate.setDefaultLocked(False)
        coordinate.setDefaultClamped(False)
        coordinate.setDefaultIsPrescribed(False)
        coordinate.setDefaultSpeedValue(0.0)
    try:
        state = bare.initSystem()
    except RuntimeError as error:
        raise refused(error) from None
    root = bare.getBodySet().get(base)
    # Part by part: not all bodies of the file need belong to the chain.
    parts = [part for part in entries_of(bare.getBodySet()) if part.getName() in bodies]
    masses, tensors = np.array([part.getMass() for part in parts]), np.array([tensor_of(part) for part in parts])
    for shape, rate in chain.random_shapes():
        for name, (value, speed) in _of_all(shape, rate, coordinates, rules).items():
            known[name].setValue(state, value, False)
            known[name].setSpeedValue(state, speed)
        bare.realizeVelocity(state)
        turn, _ = pose_of(root.getTransformInGround(state))
        turns = np.array([pose_of(part.getTransformInGround(state))[0] for part in parts])
        centres, speeds, omega = np.swapaxes([_moving(part, state) for part in parts], 0, 1)
        inertia, momentum = inertia_and_momentum(masses, tensors, centres, turns, speeds, omega)
        chain.add_pose(shape, rate, turn.T @ inertia @ turn, turn.T @ momentum)


def _moving(part: Any, state: Any) -> tuple[Array, Array, Array]:
    """Centre of mass of a body, its velocity and the angular velocity, in the ground's axes."""
    station = part.getMassCenter()
    centre, speed = part.findStationLocationInGround(state, station), part.findStationVelocityInGround(state, station)
    return vector_of(centre), vector_of(speed), vector_of(part.getAngularVelocityInGround(state))


def _rules(model: Any) -> dict[str, tuple[Any, list[str]]]:
    """OpenSim's functions of the coordinates that follow others, copied, and the coordinates that each follows."""
    rules = {}
    for constraint in entries_of(model.getConstraintSet()):
        coupler = engine().CoordinateCouplerConstraint.safeDownCast(constraint)
        if coupler is not None and coupler.get_isEnforced():
            drivers = entries_of(coupler.getIndependentCoordinateNames())
            rules[coupler.getDependentCoordinateName()] = (coupler.getFunction().clone(), drivers)
    return rules


def _of_all(
    shape: Mapping[str, float],
    rate: Mapping[str, float],
    coordinates: Mapping[str, float | None],
    rules: Mapping[str, tuple[Any, list[str]]],
) -> dict[str, tuple[float, float]]:
    """Values and speeds of all coordinates but the base's; dependent ones by OpenSim's own functions."""
    states: dict[str, tuple[float, float]] = {}

    def find(name: str) -> tuple[float, float]:
        if name not in states:
            locked = coordinates[name]
            if locked is not None:
                states[name] = locked, 0.0
            elif name in rules:
                function, drivers = rules[name]
                leaders = [find(driver) for driver in drivers]
                value, *slopes = value_and_slope(function, [value for value, _ in leaders])
                states[name] = value, sum(s * speed for s, (_, speed) in zip(slopes, leaders, strict=True))
            else:
                states[name] = shape.get(name, 0.0), rate.get(name, 0.0)
        return states[name]

    for name in coordinates:
        find(name)
    return states
