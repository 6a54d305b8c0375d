"""Bodies put together from parts that move in known ways: a rigid spacecraft, moving masses, booms that come out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import on_unphysical_argument, positive_argument, vector_argument
from ..arrays import Array, finite_array
from ..errors import ShapeError, TrajectoryError, UnphysicalInertiaError
from ..inertia_tensor import second_moment
from ..shape_space.shape_path import CLOSED, ShapePath
from ..shape_space.smoothness import Smoothness
from ._physical_validity import check_never_on_a_line, check_triangle, least_over
from .deformation import Deformation
from .descriptions import UngaugedDescription, inertia_of


@dataclass(frozen=True, eq=False)
class Moments:
    """What a part adds to the sums over all mass, about the frame's origin, at times (N,).

    Attributes
    ----------
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
    """A part of an assembly, its motion known in the frame of the whole."""

    @property
    def mass(self) -> float:
        """All its mass, which stays [kg]."""
        ...

    @property
    def path(self) -> ShapePath | None:
        """What drives it; None: it is fixed in the frame."""
        ...

    def moments(self, times: Array, origin: Array, /) -> Moments:
        """Its moments about a point (3,) that is fixed in the frame."""
        ...

    def correlation(self, times: Array, reference: float, origin: Array, /) -> tuple[Array, Array]:
        """Integral of r(t) r(reference)^T dm (N, 3, 3) and its rate, about `origin`."""
        ...


@dataclass(frozen=True, eq=False)
class RigidPart:
    """A rigid part that is fixed in the frame; made by `rigid_part`.

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

    def moments(self, times: Array, origin: Array) -> Moments:
        """As `Part`."""
        arm = self.centre - origin
        still = np.zeros((len(times), 3))
        second = self.moment + self.mass * np.outer(arm, arm)
        matrix = np.zeros((len(times), 3, 3))
        return Moments(still + self.mass * arm, still, matrix + second, matrix, np.zeros(len(times)))

    def correlation(self, times: Array, reference: float, origin: Array) -> tuple[Array, Array]:  # noqa: ARG002
        """As `Part`."""
        of_all = self.moments(times, origin)
        return of_all.second, of_all.flow


@dataclass(frozen=True, eq=False)
class MovingMass:
    """A point mass that moves in the frame; made by `moving_mass`.

    Attributes
    ----------
    mass : [kg]
    path : x, y, z in the frame [m]
    """

    mass: float
    path: ShapePath

    def moments(self, times: Array, origin: Array) -> Moments:
        """As `Part`."""
        at, speed = self.path.curve(times)
        arm = at - origin
        second, flow = (self.mass * arm[:, :, None] * other[:, None] for other in (arm, speed))
        return Moments(self.mass * arm, self.mass * speed, second, flow, self.mass * np.sum(speed**2, axis=-1))

    def correlation(self, times: Array, reference: float, origin: Array) -> tuple[Array, Array]:
        """As `Part`."""
        at, speed = self.path.curve(times)
        there = self.mass * (self.path.curve(np.array([reference]))[0][0] - origin)
        return (at - origin)[:, :, None] * there, speed[:, :, None] * there


@dataclass(frozen=True, eq=False)
class Boom:
    """A uniform straight boom that comes out of a point of the body; made by `boom`.

    Of its `mass` the share length/full_length is out, a rod that moves along itself; the rest is stowed at the root as
    a point mass at rest. So the boom's mass stays, and what is out is missing at the root.

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

    def moments(self, times: Array, origin: Array) -> Moments:
        """As `Part`."""
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
        """As `Part`: a bit of boom that ends s behind the tip is max(length - s, 0) along the axis from the root."""
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


@dataclass(frozen=True, eq=False)
class AssemblyDescription(UngaugedDescription):
    """The sum of parts, seen from the frame they are described in.

    Attributes
    ----------
    parts : each with its moments
    origin : (3,) a point near the common centre of mass; sums are taken about it, which saves digits
    """

    parts: tuple[Part, ...]
    origin: Array
    oscillations: float | None
    loops: int
    smooth_loop: bool
    sparse: bool

    @property
    def mass(self) -> float:
        """[kg]."""
        return sum(part.mass for part in self.parts)

    def about_centre(self, times: Array) -> Moments:
        """The moments of all about their common centre of mass, which moves; `first` stays as from `origin`."""
        total = reduce(Moments.__add__, (part.moments(times, self.origin) for part in self.parts))
        first, momentum = total.first, total.momentum
        second = total.second - first[:, :, None] * first[:, None] / self.mass
        flow = total.flow - first[:, :, None] * momentum[:, None] / self.mass
        vis_viva = total.vis_viva - np.sum(momentum**2, axis=-1) / self.mass
        return replace(total, second=second, flow=flow, vis_viva=vis_viva)

    def moment(self, times: Array) -> Array:
        """Integral of r r^T dm about the common centre: (N,) -> (N, 3, 3) [kg m^2]."""
        return self.about_centre(times).second

    def sample(self, times: Array) -> tuple[Array, Array]:
        """As `Description`."""
        total = self.about_centre(times)
        return inertia_of(total.second), so3.vee(np.swapaxes(total.flow, -1, -2) - total.flow)

    def inertia_rate(self, times: Array) -> Array:
        """As `Description`."""
        flow = self.about_centre(times).flow
        return inertia_of(flow + np.swapaxes(flow, -1, -2))

    def centre_of_mass(self, times: Array) -> Array:
        """As `Description`."""
        return self.origin + self.about_centre(times).first / self.mass

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:
        """As `Description`."""
        pairs = [part.correlation(times, reference, self.origin) for part in self.parts]
        total = self.about_centre(times)
        there = self.about_centre(np.array([reference])).first[0] / self.mass
        value = sum(pair[0] for pair in pairs) - total.first[:, :, None] * there
        rate = sum(pair[1] for pair in pairs) - total.momentum[:, :, None] * there
        return value, rate

    def kinetic_energy(self, times: Array, turning: Array) -> Array:
        """As `Description`."""
        inertia, momentum = self.sample(times)
        turned = 0.5 * so3.apply(inertia, turning) + momentum
        return np.sum(turning * turned, axis=-1) + 0.5 * self.about_centre(times).vis_viva

    def smoothness(self, breaks: Array) -> Smoothness:
        """As `Description`."""
        return Smoothness(
            breaks=breaks,
            oscillations=self.oscillations,
            loops=self.loops,
            smooth_loop=self.smooth_loop,
            sparse=self.sparse,
        )


def rigid_part(
    mass: float,
    inertia: ArrayLike = ((0.0, 0.0, 0.0),) * 3,
    centre: ArrayLike = (0.0, 0.0, 0.0),
    *,
    on_unphysical: str = "error",
) -> RigidPart:
    """A rigid part of an assembly: the spacecraft, or a mass bolted to it.

    Parameters
    ----------
    mass : [kg]
    inertia : (3, 3) about its own centre of mass, axes of the frame [kg m^2]; zero: a point
    centre : (3,) of its mass in the frame [m]
    on_unphysical : "error", "warn" or "allow" an inertia that breaks the triangle inequality

    Raises
    ------
    ShapeError, UnphysicalInertiaError
        For a mass that is not positive, a wrong shape, or an inertia that no distribution of mass has.

    Since masses add up to masses, an assembly of parts that are physical is physical at all times.
    """
    weight = positive_argument(mass, "mass", "a mass in kg")
    tensor = finite_array(inertia, "inertia", (3, 3), unit="kg m^2")
    place = vector_argument(centre, "centre", unit="m")
    if tensor.shape != (3, 3) or np.abs(tensor - tensor.T).max() > 1e-9 * np.abs(tensor).max():
        raise ShapeError(f"inertia: one symmetric (3, 3) tensor [kg m^2] is needed, got {tensor.tolist()}")
    tensor = 0.5 * (tensor + tensor.T)
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] < -1e-9 * np.abs(moments).max():
        raise UnphysicalInertiaError(f"inertia: principal moments {moments} kg m^2, one of them negative")
    if moments[2] > 0.0:
        check_triangle(tensor[None], None, on_unphysical_argument(on_unphysical))
    return RigidPart(weight, place, second_moment(tensor))


def moving_mass(mass: float, path: ShapePath) -> MovingMass:
    """A point mass of an assembly that moves in its frame: someone moving the furniture.

    Parameters
    ----------
    mass : [kg]
    path : three columns, x y z in the frame [m], by any of `ShapePath`'s makers

    Raises
    ------
    TrajectoryError
        If the path has not three columns, or the mass is not positive.

    Source: Cabrera 2006, example 2.2.
    """
    return MovingMass(positive_argument(mass, "mass", "a mass in kg"), _columns(path, 3, "a moving mass"))


def boom(mass: float, full_length: float, root: ArrayLike, direction: ArrayLike, path: ShapePath) -> Boom:
    """A uniform boom of an assembly that comes out of the body, or goes in.

    What is not out is a point mass at rest at the root; what is out is a rod that moves along itself. Its mass is not
    part of the spacecraft's: if the spacecraft was measured with the boom stowed, subtract `mass` at `root`.

    Parameters
    ----------
    mass, full_length : of the whole boom [kg], [m]
    root : (3,) where it comes out, in the frame [m]
    direction : (3,) where to, of any length but zero
    path : one column, the length that is out, between 0 and `full_length` [m]

    Raises
    ------
    ShapeError, TrajectoryError
        If an argument has the wrong shape or sign, or the length leaves its range; the message names the time.
    """
    weight = positive_argument(mass, "mass", "a mass in kg")
    whole = positive_argument(full_length, "full_length", "a length in m")
    axis = vector_argument(direction, "direction")
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise ShapeError("direction: a vector other than zero is needed, got [0, 0, 0]")
    route = _columns(path, 1, "a boom")
    for sign, offset in ((1.0, 0.0), (-1.0, whole)):
        least, when = least_over(lambda t, s=sign, o=offset: s * route.curve(t)[0][:, 0] + o, route.breaks)
        if least < -1e-12 * whole:
            raise TrajectoryError(
                f"the length of a boom must stay between 0 and {whole:.9g} m, at t = {when:.6g} s it is "
                f"{sign * (least - offset):.9g} m"
            )
    return Boom(weight, whole, vector_argument(root, "root", unit="m"), axis / length, route)


def assembly(spacecraft: RigidPart, parts: Sequence[Part], duration: float | None = None) -> Deformation:
    """A rigid spacecraft with parts that move in its frame.

    The common centre of mass moves in that frame, and there is internal momentum; inertia, momentum, rates and energy
    are exact sums over the parts.

    Parameters
    ----------
    spacecraft : by `rigid_part`; its frame is the base frame
    parts : by `moving_mass`, `boom` or `rigid_part`
    duration : [s]; None: that of the paths, which must agree

    Raises
    ------
    TrajectoryError
        If the paths last differently, or nothing says how long the motion lasts.
    SingularInertiaError
        If all mass is on one line at some time, which the message names.

    Source: Cabrera 2006, examples 2.2 and 4.5; theory.md F6.
    """
    everything = (spacecraft, *parts)
    paths = [part.path for part in everything if part.path is not None]
    lengths = [path.duration for path in paths] + ([] if duration is None else [positive_argument(duration)])
    if not lengths:
        raise TrajectoryError("an assembly without moving parts needs a duration [s]")
    for one, other in pairwise(lengths):
        if abs(one - other) > 1e-9 * one:
            raise TrajectoryError(f"all parts must move for one time, got {lengths} s; stretch or extend the paths")
    length = lengths[0]
    inner = [path.breaks[1:-1] for path in paths]
    breaks = np.unique(np.concatenate([[0.0], *inner, [length]]))
    loops = {path.loops for path in paths}
    together = len(loops) == 1
    swings = [path.oscillations and path.oscillations * (1 if together else path.loops) for path in paths]
    known = None if None in swings else max((swing for swing in swings if swing is not None), default=0.0)
    count = loops.pop() if together else 1
    about_zero = AssemblyDescription(
        parts=everything,
        origin=np.zeros(3),
        oscillations=known,
        loops=count,
        smooth_loop=all(path.smooth_loop for path in paths),
        sparse=not together or any(path.sparse for path in paths),
    )
    description = replace(about_zero, origin=about_zero.centre_of_mass(np.zeros(1))[0])
    check_never_on_a_line(description.moment, breaks)
    gap = max((float(np.abs(path.gap).max()) for path in paths), default=0.0)
    closure = np.eye(3) if gap <= CLOSED else None
    names = f"a spacecraft with {len(parts)} parts" if len(parts) != 1 else "a spacecraft with one part"
    return Deformation(description, length, breaks, closure, gap, names, count)


def _columns(path: ShapePath, count: int, whose: str) -> ShapePath:
    if not isinstance(path, ShapePath) or path.n_shape != count:
        came = f"one of {path.n_shape} columns" if isinstance(path, ShapePath) else repr(type(path).__name__)
        raise TrajectoryError(f"{whose} needs a ShapePath of {count} columns [m], got {came}")
    if np.abs(path.gap).max() <= CLOSED:
        return path
    # A path of joints that advances by 2 pi in every loop is a loop; one of metres is not.
    swings = None if path.oscillations is None else path.oscillations * path.loops
    return replace(path, oscillations=swings, loops=1, smooth_loop=False)
