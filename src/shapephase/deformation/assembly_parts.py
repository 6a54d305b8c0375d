"""The parts of an assembly, with their terms of the sums over all mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Array
from ..display import short_repr
from ..shape_space.shape_path import ShapePath


@dataclass(frozen=True, eq=False)
class Moments:
    """Terms of a part in the sums over all mass, about the frame's origin, at times (N,).

    first, momentum : (N, 3) integrals of r dm [kg m] and of its rate v dm [kg m/s]
    second, flow : (N, 3, 3) integrals of r r^T dm [kg m^2] and of r v^T dm [kg m^2/s]
    vis_viva : (N,) integral of v.v dm, twice the energy in this frame [J]
    """

    first: Array
    momentum: Array
    second: Array
    flow: Array
    vis_viva: Array

    def __add__(self, other: Moments) -> Moments:
        """The moments of both."""
        return Moments(*(getattr(self, name) + getattr(other, name) for name in vars(self)))


class Part(Protocol):
    """A part of an assembly, its motion known in the frame of the whole.

    Examples
    --------
    >>> path = sp.ShapePath.waypoints([0.0, 2.0], [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    >>> sp.deformation.moving_mass(80.0, path).mass  # one of the parts there are
    80.0
    """

    @property
    def mass(self) -> float:
        """All its mass, which stays [kg]."""
        ...

    @property
    def path(self) -> ShapePath | None:
        """Path of its motion; None: it is fixed in the frame."""
        ...

    def moments(self, times: Array, origin: Array, /) -> Moments:
        """Its moments about a point (3,) that is fixed in the frame."""
        ...

    def correlation(self, times: Array, reference: float, origin: Array, /) -> tuple[Array, Array]:
        """Integral of r(t) r(reference)^T dm (N, 3, 3) and its rate, about `origin`."""
        ...

    def lever(self, columns: Array, origin: Array, /) -> float:
        """The largest angular momentum about `origin` for a unit of a rate of the path (N, n) [kg m]."""
        ...


@dataclass(frozen=True, eq=False)
class RigidPart:
    """A rigid part that is fixed in the frame. Made by `rigid_part`.

    Attributes
    ----------
    mass : [kg]
    centre : (3,) its centre of mass in the frame [m]
    moment : (3, 3) integral of r r^T dm about its centre, tr(I)/2 - I [kg m^2]
    """

    mass: float
    centre: Array
    moment: Array
    path: ShapePath | None = None

    __repr__ = short_repr

    def moments(self, times: Array, origin: Array) -> Moments:
        arm = self.centre - origin
        still = np.zeros((len(times), 3))
        second = self.moment + self.mass * np.outer(arm, arm)
        matrix = np.zeros((len(times), 3, 3))
        return Moments(still + self.mass * arm, still, matrix + second, matrix, np.zeros(len(times)))

    def correlation(self, times: Array, reference: float, origin: Array) -> tuple[Array, Array]:  # noqa: ARG002
        of_all = self.moments(times, origin)
        return of_all.second, of_all.flow

    def lever(self, columns: Array, origin: Array) -> float:  # noqa: ARG002
        return 0.0


@dataclass(frozen=True, eq=False)
class MovingMass:
    """A point mass that moves in the frame. Made by `moving_mass`.

    Attributes
    ----------
    mass : [kg]
    path : x, y, z in the frame [m]
    """

    mass: float
    path: ShapePath

    __repr__ = short_repr

    def moments(self, times: Array, origin: Array) -> Moments:
        at, speed = self.path.curve(times)
        arm = at - origin
        second, flow = (self.mass * arm[:, :, None] * other[:, None] for other in (arm, speed))
        return Moments(self.mass * arm, self.mass * speed, second, flow, self.mass * np.sum(speed**2, axis=-1))

    def correlation(self, times: Array, reference: float, origin: Array) -> tuple[Array, Array]:
        at, speed = self.path.curve(times)
        there = self.mass * (self.path.curve(np.array([reference]))[0][0] - origin)
        return (at - origin)[:, :, None] * there, speed[:, :, None] * there

    def lever(self, columns: Array, origin: Array) -> float:
        """See `Part`: its mass at the farthest."""
        return self.mass * float(np.linalg.norm(columns - origin, axis=1).max())


@dataclass(frozen=True, eq=False)
class Boom:
    """A uniform straight boom that comes out of a point of the body. Made by `boom`.

    The share length/full_length of its `mass` is out, a rod that moves along itself; the rest is stowed at the root, a
    point mass at rest. The boom's mass is constant.

    Attributes
    ----------
    mass : of the whole boom [kg]
    full_length : of the whole boom [m]
    root, direction : (3,) where it comes out [m], and the unit vector of where to, in the frame
    path : the length that is out, one column [m]
    """

    mass: float
    full_length: float
    root: Array
    direction: Array
    path: ShapePath

    __repr__ = short_repr

    def moments(self, times: Array, origin: Array) -> Moments:
        out, speed = (column[:, 0] for column in self.path.curve(times))
        density, arm, axis = self.mass / self.full_length, self.root - origin, self.direction
        half, third = 0.5 * density * out**2, density * out**3 / 3.0
        first = self.mass * arm + half[:, None] * axis
        momentum = (density * out * speed)[:, None] * axis
        mixed = np.outer(arm, axis)
        second = self.mass * np.outer(arm, arm) + half[:, None, None] * (mixed + mixed.T)
        second = second + third[:, None, None] * np.outer(axis, axis)
        of_rod = (density * out)[:, None] * arm + half[:, None] * axis
        flow = (speed[:, None] * of_rod)[:, :, None] * axis
        return Moments(first, momentum, second, flow, density * out * speed**2)

    def correlation(self, times: Array, reference: float, origin: Array) -> tuple[Array, Array]:
        """See `Part`: a bit of boom that ends s behind the tip is max(length - s, 0) along the axis from the root."""
        out, speed = (column[:, 0] for column in self.path.curve(times))
        then = self.path.curve(np.array([reference]))[0][0, 0]
        density, arm, axis = self.mass / self.full_length, self.root - origin, self.direction
        both = np.minimum(out, then)
        along = out * then * both - 0.5 * (out + then) * both**2 + both**3 / 3.0
        along_rate = (then * both - 0.5 * both**2) * speed
        still = self.mass * np.outer(arm, arm) + 0.5 * density * then**2 * np.outer(arm, axis)
        here = 0.5 * density * out**2
        square, mixed = np.outer(axis, axis), np.outer(axis, arm)
        value = still + here[:, None, None] * mixed + density * along[:, None, None] * square
        rate = (density * out * speed)[:, None, None] * mixed + density * along_rate[:, None, None] * square
        return value, rate

    def lever(self, columns: Array, origin: Array) -> float:
        """See `Part`: all that is out moves, the tip at the farthest."""
        out = float(np.abs(columns).max())
        return self.mass / self.full_length * out * (float(np.linalg.norm(self.root - origin)) + out)
