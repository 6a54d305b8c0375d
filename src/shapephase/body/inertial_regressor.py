"""Inertia and internal momentum as functions of the masses, centres and rotational inertias of the links.

Seen from a given point that moves, both are linear in ten numbers for each link; about the centre of mass of all
there comes a product of two sums that are linear in four of them. What multiplies the numbers depends on shapes and
rates alone, so that one set of matrices serves all bodies with the same joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from ..inertia_tensor import FULL_FROM_SIX, VOIGT
from .joint_chain import JointChain
from .link_motions import LinkMotions, components, cross, link_motions

PARAMETERS = 10
"""Parameters of a link, in its axes and about its centre of mass in the body of the matrices: mass [kg], first
moment (3) [kg m], inertia xx yy zz yz xz xy [kg m^2]."""
OUTPUTS = 15
"""About the point that is that body's centre of mass: inertia xx yy zz yz xz xy, angular momentum (3), first moment of
mass (3), its rate (3)."""


@dataclass(frozen=True, eq=False)
class InertialRegressor:
    """The matrices at N shapes and rates.

    At the body that they were made for, the first moment of mass vanishes: there the first six and the next three rows
    are the exact derivatives of I and of L_o by the parameters.

    matrices : (N, 15, 10 links)
    centres : (links, 3) the centres of mass that parameters are about, axes of each link [m]
    """

    matrices: Array
    centres: Array

    def inertia_and_momentum(self, masses: Array, centres: Array, inertias: Array) -> tuple[Array, Array]:
        """I and L_o of bodies with the same joints, about the centre of mass of each, axes of the base.

        masses, centres, inertias : (V, links), (V, links, 3), (V, links, 3, 3); the latter about these centres

        Returns (V, N, 3, 3) [kg m^2], (V, N, 3) [kg m^2/s]
        """
        given = parameters(masses, centres, inertias, self.centres)
        count = len(self.matrices)
        sums = (given @ self.matrices.reshape(count * OUTPUTS, -1).T).reshape(len(masses), count, OUTPUTS)
        six, momentum, moment, rate = np.split(sums, (6, 9, 12), axis=-1)
        whole = masses.sum(axis=-1)[:, None, None]
        inertia = six[..., FULL_FROM_SIX]
        return inertia - _of_point(moment) / whole[..., None], momentum - np.cross(moment, rate) / whole


def inertial_regressor(chain: JointChain, shapes: Array, rates: Array) -> InertialRegressor:
    """The matrices at shapes and rates of the independent joints, (N, n) each.

    With P, U the place and speed of a link's centre from the centre of mass of all, R, w its orientation and angular
    velocity, and m, h, J its parameters: I is the sum of m (P.P - P P^T) + 2 P.Rh - P (Rh)^T - Rh P^T + R J R^T, and
    L_o of m P x U + Rh x U + P x (w x Rh) + R J R^T w.

    Source: theory.md A3, A7.
    """
    links = link_motions(chain, shapes, rates)
    count, frames = links.places.shape[:2]
    whole = np.zeros((count, frames, OUTPUTS, PARAMETERS))
    whole[..., 0] = np.concatenate(_of_masses(links), axis=-1)
    for axis in range(3):
        whole[..., 1 + axis] = np.concatenate(_of_first_moments(links, axis), axis=-1)
    for entry, (i, j) in enumerate(VOIGT):
        # A symmetric tensor with a one at (i, j), turned with the link.
        turned = links.turns[..., :, i, None] * links.turns[..., None, :, j]
        tensor = turned if i == j else turned + so3.transpose(turned)
        whole[..., :6, 4 + entry] = _voigt(tensor)
        whole[..., 6:9, 4 + entry] = so3.apply(tensor, links.spins)
    matrices = np.swapaxes(whole, 1, 2).reshape(count, OUTPUTS, frames * PARAMETERS)
    return InertialRegressor(np.ascontiguousarray(matrices), chain.centres)


def by_link_parameters(links: LinkMotions, rows: Array, spins: Array, *, moving: bool = True) -> Array:
    """Sums over N shapes of row . (dI spin + dL_o) by the ten parameters of each link: (k, 10 links).

    Equal to the derivatives by the regressor, at the body itself, without its matrices.

    rows : (N, k, 3)
    spins : (N, 3)
    moving : whether the links move as seen from the base; else the sums are of row . dI spin
    """
    turns = components(links.turns.reshape(*links.places.shape[:2], 9))
    places, spin = components(links.places), spins.T[:, :, None]
    all_spins = spin + (components(links.spins) if moving else np.zeros_like(places))
    speeds = cross(spin, places) + (components(links.speeds) if moving else 0.0)
    turning = _seen(turns, all_spins)
    result = np.empty((rows.shape[1], places.shape[2], PARAMETERS))
    for row, sums in zip(np.moveaxis(rows, 0, 2), result, strict=True):
        across = np.broadcast_to(row[:, :, None], places.shape)
        arms, near = cross(across, places), _seen(turns, across)
        sums[:, 0] = (arms * speeds).sum(axis=(0, 1))
        sums[:, 1:4] = _seen(turns, cross(speeds, across) + cross(arms, all_spins)).sum(axis=1).T
        for entry, (i, j) in enumerate(VOIGT):
            product = near[i] * turning[j]
            sums[:, 4 + entry] = (product if i == j else product + near[j] * turning[i]).sum(axis=0)
    return result.reshape(len(result), -1)


def _seen(turns: Array, vectors: Array) -> Array:
    """Vectors in axes of the links: (9, N, k), (3, N, k) -> (3, N, k)."""
    x, y, z = vectors
    return np.stack([turns[i] * x + turns[3 + i] * y + turns[6 + i] * z for i in range(3)])


def parameters(masses: Array, centres: Array, inertias: Array, about: Array) -> Array:
    """Mass, first moment and inertia about given points: (V, k), (V, k, 3), (V, k, 3, 3), (k, 3) -> (V, 10 k)."""
    offsets = centres - about
    whole = np.empty((*masses.shape, PARAMETERS))
    whole[..., 0] = masses
    whole[..., 1:4] = masses[..., None] * offsets
    whole[..., 4:] = _voigt(inertias + masses[..., None, None] * _of_point(offsets))
    return whole.reshape(len(masses), -1)


def _of_masses(links: LinkMotions) -> list[Array]:
    """Sums that one kilogram at the centre of each link adds: (N, k, ...)."""
    return [_voigt(_of_point(links.places)), np.cross(links.places, links.speeds), links.places, links.speeds]


def _of_first_moments(links: LinkMotions, axis: int) -> list[Array]:
    """Sums that a unit first moment along an axis of each link adds."""
    moment = links.turns[..., axis]
    rate = np.cross(links.spins, moment)
    product = links.places[..., :, None] * moment[..., None, :]
    trace = 2.0 * np.trace(product, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
    momentum = np.cross(moment, links.speeds) + np.cross(links.places, rate)
    return [_voigt(trace - product - so3.transpose(product)), momentum, moment, rate]


def _of_point(place: Array) -> Array:
    """The inertia of one kilogram: (..., 3) -> (..., 3, 3)."""
    return (place * place).sum(axis=-1)[..., None, None] * np.eye(3) - place[..., :, None] * place[..., None, :]


def _voigt(tensor: Array) -> Array:
    return np.stack([tensor[..., i, j] for i, j in VOIGT], axis=-1)
