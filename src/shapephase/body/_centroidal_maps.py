"""Pinocchio's centroidal maps at many shapes, with a column for each independent joint."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, which a type checker cannot follow.
# pyright: reportAttributeAccessIssue=false
import numpy as np
import pinocchio as pin

from ..arrays import Array
from .couplings.joint_map import BASE, JointMap


def full_map(model: pin.Model, data: pin.Data, joints: JointMap, shapes: Array) -> Array:
    """[I, J] with a column for every joint of the model: (N, n) -> (N, 3, 3 + joints)."""
    centroidal_map = pin.computeCentroidalMap
    # Each call returns a copy: concatenating all of them is faster than filling an array.
    maps = [centroidal_map(model, data, q) for q in joints.configurations(shapes)]
    return np.concatenate(maps).reshape(-1, BASE, model.nv)[:, 3:, 3:] if maps else np.empty((0, 3, model.nv - 3))


def angular_map(model: pin.Model, data: pin.Data, joints: JointMap, shapes: Array) -> Array:
    """[I, J] for each shape: (N, n) -> (N, 3, 3 + n)."""
    whole = full_map(model, data, joints, shapes)
    return np.concatenate([whole[:, :, :3], joints.columns(whole[:, :, 3:], shapes)], axis=-1)


def angular_map_rate(model: pin.Model, data: pin.Data, joints: JointMap, shapes: Array, rates: Array) -> Array:
    """d/dt [I, J] for each shape and rate: (N, n), (N, n) -> (N, 3, 3 + n)."""
    velocities = joints.velocities(shapes, rates)
    whole = np.empty((len(shapes), 3, model.nv - 3))
    for row, (q, v) in enumerate(zip(joints.configurations(shapes), velocities, strict=True)):
        pin.dccrba(model, data, q, v)
        whole[row] = data.dAg[3:, 3:]
    columns = joints.columns(whole[:, :, 3:], shapes)
    if not joints.follows.is_linear:
        columns += joints.bent_columns(full_map(model, data, joints, shapes)[:, :, 3:], shapes, rates)
    return np.concatenate([whole[:, :, :3], columns], axis=-1)


def momentum_gradients(
    model: pin.Model, data: pin.Data, joints: JointMap, shapes: Array, rates: Array, spins: Array
) -> Array:
    """d(I w + J rate)/dr_k while w and the rates stay: (N, n), (N, n), (N, 3) -> (N, 3, n)."""
    velocities = joints.velocities(shapes, rates)
    velocities[:, 3:BASE] = spins
    none = np.zeros(model.nv)
    gradients = np.empty((len(velocities), 3, model.nv))
    for row, (q, full) in enumerate(zip(joints.configurations(shapes), velocities, strict=True)):
        gradients[row] = pin.computeCentroidalDynamicsDerivatives(model, data, q, full, none)[0][3:]
    columns = joints.columns(gradients[:, :, BASE:], shapes)
    if not joints.follows.is_linear:
        columns += joints.bent_rates(full_map(model, data, joints, shapes)[:, :, 3:], shapes, rates)
    return columns


def internal_momenta(whole: Array, joints: JointMap, shapes: Array, rates: Array) -> Array:
    """L_o from full maps: (N, 3, 3 + joints), (N, n), (N, n) -> (N, 3)."""
    return np.einsum("nij,nj->ni", whole[:, :, 3:], joints.velocities(shapes, rates)[:, BASE:])


def kinetic_energies(
    model: pin.Model, data: pin.Data, joints: JointMap, shapes: Array, rates: Array, spins: Array
) -> Array:
    """About the centre of mass, the base turning at (N, 3): (N,) [J]."""
    velocities = joints.velocities(shapes, rates)
    velocities[:, 3:BASE] = spins
    energies, mass = np.empty(len(velocities)), float(pin.computeTotalMass(model))
    for row, (q, full) in enumerate(zip(joints.configurations(shapes), velocities, strict=True)):
        pin.ccrba(model, data, q, full)
        whole = pin.computeKineticEnergy(model, data, q, full)
        energies[row] = whole - 0.5 * data.hg.linear @ data.hg.linear / mass
    return energies


def centres_of_mass(model: pin.Model, data: pin.Data, joints: JointMap, shapes: Array) -> Array:
    """Centres of mass from the base origin, base axes: (N, 3) [m]."""
    configurations = joints.configurations(shapes)
    centres = np.empty((len(configurations), 3))
    for row, q in enumerate(configurations):
        centres[row] = pin.centerOfMass(model, data, q)
    return centres
