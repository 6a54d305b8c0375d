"""Wheels along a motion: how the momentum that they store follows from shapes, inertias and the wheels' values.

A wheel of moment J about its axle a that keeps its momentum p takes J a a^T from the inertia and adds p a to the
momentum, so that the other links move like those of a body whose wheel has no moment about its axle. One at a held
speed s adds J s a.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.inertial_regressor import PARAMETERS
from ..body.joint_chain import JointChain
from ..body.link_motions import link_motions
from ..deformation.rotors import Rotor
from ..inertia_tensor import VOIGT

_DOUBLED = np.array([1.0 if i == j else 2.0 for i, j in VOIGT])  # entries that stand twice in a symmetric tensor


@dataclass(frozen=True, eq=False)
class WheelsAlong:
    """Wheels at N times of a motion, in whose shapes their own joints rest.

    body : the body with the wheels
    rotors : the wheels, W of them
    times : (N,) [s]
    shapes, rates : (N, n)
    """

    body: Body
    rotors: tuple[Rotor, ...]
    times: Array
    shapes: Array
    rates: Array

    @cached_property
    def driven(self) -> list[int]:
        """Columns of the joints that are not wheels."""
        wheels = {rotor.joint for rotor in self.rotors}
        return [column for column, name in enumerate(self.body.joint_names) if name not in wheels]

    @cached_property
    def axles(self) -> Array:
        """Unit vectors along the axles: (N, W, 3), base axes."""
        turns = link_motions(self.body.chain, self.shapes, self.rates).turns[:, self._frames]
        return so3.apply(turns, self._own_axles)

    @cached_property
    def stored(self) -> Array:
        """Momentum that all wheels store: (N, 3), base axes [kg m^2/s]."""
        return np.einsum("nw,nwc->nc", self.along, self.axles)

    def by_shape(self, rows: Array) -> Array:
        """Products of row . d(stored momentum) by the joints that are not wheels: (N, S, r, 3) -> (N, S r, m).

        Zero at odd S, see `BodyAlong.by_knots`.
        """
        turned = np.zeros((*rows.shape[:3], len(self.driven)))
        for place, column in enumerate(self.driven):
            unit = np.zeros_like(self.rates)
            unit[:, column] = 1.0
            turning = link_motions(self.body.chain, self.shapes, unit).spins[:, self._frames]
            change = np.einsum("nw,nwc->nc", self.along, np.cross(turning, self.axles))
            turned[:, ::2, :, place] = np.einsum("nsrc,nc->nsr", rows[:, ::2], change)
        return turned.reshape(len(rows), -1, len(self.driven))

    def by_inertias(self, derivative: Array, rows: Array) -> Array:
        """Derivatives by the ten parameters of each frame, from those with wheels at rest: (S r, 10 (k + 1))."""
        by_frame = derivative.reshape(len(derivative), -1, PARAMETERS).copy()
        sums = self._along_axles(rows, np.stack([rotor.at(self.times)[0] for rotor in self.rotors], axis=-1))
        for place, (rotor, frame, axle) in enumerate(zip(self.rotors, self._frames, self._own_axles, strict=True)):
            about = np.array([axle[i] * axle[j] for i, j in VOIGT])
            by_moment = -by_frame[:, frame, 4:] @ about if rotor.is_momentum else sums[:, place]
            by_frame[:, frame, 4:] += by_moment[:, None] * (_DOUBLED * about)
        return by_frame.reshape(derivative.shape)

    def by_values(self, rows: Array) -> Array:
        """Sums of products of row . d(stored momentum) by the wheels' values: (N, S, r, 3) -> (S r, W)."""
        units = [1.0 if rotor.is_momentum else rotor.inertia for rotor in self.rotors]
        return self._along_axles(rows, np.broadcast_to(units, self.along.shape))

    def _along_axles(self, rows: Array, along: Array) -> Array:
        """Sums of products of rows (N, S, r, 3) with axles that are (N, W) long: (S r, W)."""
        sums = np.zeros((*rows.shape[1:3], len(self.rotors)))
        sums[::2] = np.einsum("nsrc,nwc->srw", rows[:, ::2], along[..., None] * self.axles)
        return sums.reshape(-1, len(self.rotors))

    @cached_property
    def along(self) -> Array:
        """Momentum that each wheel stores along its axle: (N, W) [kg m^2/s]."""
        return np.stack([rotor.stored(self.times) for rotor in self.rotors], axis=-1)

    @property
    def _frames(self) -> list[int]:
        return wheel_frames(self.body.chain, self.rotors)

    @property
    def _own_axles(self) -> Array:
        """Axles in axes of the frames: (W, 3)."""
        return self.body.chain.axes[[frame - 1 for frame in self._frames]]


def wheel_frames(chain: JointChain, rotors: tuple[Rotor, ...]) -> list[int]:
    """Numbers of the wheels' frames in the chain."""
    return [chain.names.index(rotor.joint) + 1 for rotor in rotors]


def reduced_chain(chain: JointChain, rotors: tuple[Rotor, ...]) -> JointChain:
    """The chain without the moments of wheels that keep their momentum, about their axles."""
    if not rotors:
        return chain
    tensors = chain.inertias.copy()
    for rotor, frame in zip(rotors, wheel_frames(chain, rotors), strict=True):
        if rotor.is_momentum:
            tensors[frame] -= rotor.inertia * np.outer(chain.axes[frame - 1], chain.axes[frame - 1])
    return chain.with_inertias(chain.masses, chain.centres, tensors)
