"""Bodies put together from parts that move in known ways: a rigid spacecraft, moving masses, booms that come out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, on_unphysical_argument, positive_argument, vector_argument
from ..arrays import Array, finite_array
from ..errors import ShapeError, TrajectoryError, UnphysicalInertiaError, WrongObjectError
from ..inertia_tensor import second_moment
from ..integrator.smoothness import Smoothness
from ..letters import value_text
from ..refinement import least_over
from ..shape_space.body_path import as_path
from ..shape_space.curves import Swings, most_swings
from ..shape_space.scan.function_scan import FunctionScan, ScannedFunction, Words, path_function, side_by_side
from ..shape_space.scan.scanning import scanned
from ..shape_space.shape_path import CLOSED, ShapePath
from ._physical_validity import check_never_on_a_line, check_triangle
from ._scanned_functions import least_moment
from .assembly_parts import Boom, Moments, MovingMass, Part, RigidPart
from .deformation import Deformation
from .descriptions import UngaugedDescription, inertia_of

_PART_WORDS = Words(
    units=("m", "m/s"),
    continuous="parts move continuously",
    rate="velocity",
    values="places",
    returned="(places, velocities)",
)
_ROUNDED = 1e-9  # relative, of arguments: digits of files
_SIZE_SAMPLES = 64  # times at which the size of the whole is taken
_LEAST_ARM = 0.1  # of the distance at which a part alone would make the body's inertia: the least lever


@dataclass(frozen=True, eq=False)
class AssemblyDescription(UngaugedDescription):
    """The sum of parts, seen from the frame they are described in.

    parts : each with its moments
    origin : (3,) a point near the common centre of mass; sums are taken about it, which saves digits
    breaks : (M,) that were declared [s]
    swings : how fast all paths together can change
    loops : the interval is its first part, this many times
    """

    parts: tuple[Part, ...]
    origin: Array
    breaks: Array
    swings: Swings
    loops: int

    @property
    def mass(self) -> float:
        """Mass [kg]."""
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
        total = self.about_centre(times)
        return inertia_of(total.second), so3.vee(np.swapaxes(total.flow, -1, -2) - total.flow)

    def inertia_rate(self, times: Array) -> Array:
        flow = self.about_centre(times).flow
        return inertia_of(flow + np.swapaxes(flow, -1, -2))

    def centre_of_mass(self, times: Array) -> Array:
        return self.origin + self.about_centre(times).first / self.mass

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:
        pairs = [part.correlation(times, reference, self.origin) for part in self.parts]
        total = self.about_centre(times)
        there = self.about_centre(np.array([reference])).first[0] / self.mass
        value = sum(pair[0] for pair in pairs) - total.first[:, :, None] * there
        rate = sum(pair[1] for pair in pairs) - total.momentum[:, :, None] * there
        return value, rate

    def kinetic_energy(self, times: Array, turning: Array) -> Array:
        inertia, momentum = self.sample(times)
        turned = 0.5 * so3.apply(inertia, turning) + momentum
        return np.sum(turning * turned, axis=-1) + 0.5 * self.about_centre(times).vis_viva

    @cached_property
    def _scan(self) -> FunctionScan | None:
        if self.swings.most is not None:
            return None
        period = self.breaks[-1] / self.loops
        return scanned(self.depends_on(), self.breaks[self.breaks <= period * (1.0 + 1e-12)])

    def depends_on(self) -> ScannedFunction:
        """See `Description`: the paths of all parts, judged by the angular momentum that their rates are worth."""
        return side_by_side(
            [self._moved(k) for k, part in enumerate(self.parts) if part.path is not None],
            "the motion of the parts of the assembly",
        )

    def _moved(self, number: int) -> ScannedFunction:
        part, path = self.parts[number], self.parts[number].path
        assert path is not None

        def judge(times: Array, columns: Array) -> tuple[Array, Array]:
            least = least_moment(self.sample(times[:: max(1, len(times) // _SIZE_SAMPLES)])[0])
            n = columns.shape[1] // 2
            arm = max(part.lever(columns[:, :n], self.origin), _LEAST_ARM * np.sqrt(least * part.mass))
            return np.full(2 * n, arm / least), np.zeros(2 * n)

        along = ("along x", "along y", "along z") if path.n_shape == 3 else ("along itself",)
        moved = path_function(path.curve, path.n_shape, [f"{number} {axis}" for axis in along])
        columns = tuple(f"part {number} {axis}" for axis in along)
        quantities = tuple(f"{kind} of {name}" for kind in ("position", "velocity") for name in columns)
        angles = np.zeros(path.n_shape, dtype=bool)
        return replace(moved, judge=judge, angles=angles, columns=columns, quantities=quantities, words=_PART_WORDS)

    def smoothness(self, breaks: Array) -> Smoothness:
        scan = self.scan
        return Smoothness(
            breaks=breaks,
            oscillations=self.swings.most,
            loops=self.loops,
            smooth_loop=self.swings.smooth_loop,
            resolved=scan.resolved if scan is not None else None,
        )


def rigid_part(
    mass: float,
    inertia: ArrayLike = ((0.0, 0.0, 0.0),) * 3,
    centre: ArrayLike = (0.0, 0.0, 0.0),
    *,
    on_unphysical: str = "error",
) -> RigidPart:
    """A rigid part of an assembly: the spacecraft, or a mass bolted to it.

    Since masses add up to masses, an assembly of parts that are physical is physical at all times.

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

    Examples
    --------
    >>> sp.deformation.rigid_part(400.0, np.diag([300.0, 350.0, 500.0])).mass
    400.0
    """
    weight = positive_argument(mass, "mass", "a mass in kg")
    tensor = finite_array(inertia, "inertia", (3, 3), unit="kg m^2")
    place = vector_argument(centre, "centre", unit="m")
    if tensor.shape != (3, 3) or np.abs(tensor - tensor.T).max() > _ROUNDED * np.abs(tensor).max():
        raise ShapeError(f"inertia: one symmetric (3, 3) tensor [kg m^2] is needed, got {tensor.tolist()}")
    tensor = 0.5 * (tensor + tensor.T)
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] < -_ROUNDED * np.abs(moments).max():
        raise UnphysicalInertiaError(f"inertia: principal moments {moments} kg m^2, one of them negative")
    if moments[2] > 0.0:
        check_triangle(tensor[None], None, on_unphysical_argument(on_unphysical))
    return RigidPart(weight, place, second_moment(tensor))


def moving_mass(mass: float, path: ShapePath | str) -> MovingMass:
    """A point mass of an assembly that moves in its frame: someone moving the furniture.

    Source: Cabrera 2006, example 2.2.

    Parameters
    ----------
    mass : [kg]
    path : three columns, x y z in the frame [m], by any of `ShapePath`'s makers

    Raises
    ------
    TrajectoryError
        If the path has not three columns, or the mass is not positive.

    Examples
    --------
    >>> path = sp.ShapePath.waypoints([0.0, 2.0], [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    >>> sp.deformation.moving_mass(80.0, path).mass
    80.0
    """
    path = as_path(path)
    return MovingMass(positive_argument(mass, "mass", "a mass in kg"), _columns(path, 3, "a moving mass"))


def boom(mass: float, full_length: float, root: ArrayLike, direction: ArrayLike, path: ShapePath | str) -> Boom:
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

    Examples
    --------
    >>> path = sp.ShapePath.waypoints([0.0, 2.0], [[0.0], [3.0]])
    >>> sp.deformation.boom(6.0, 3.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), path).full_length
    3.0
    """
    path = as_path(path)
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

    Source: Cabrera 2006, examples 2.2 and 4.5; theory.md F6.

    Parameters
    ----------
    spacecraft : by `rigid_part`; its frame is the base frame
    parts : by `moving_mass`, `boom` or `rigid_part`
    duration : [s]; None: that of the paths, which must agree

    Raises
    ------
    TrajectoryError
        If the paths last differently, or no part has a duration.
    SingularInertiaError
        If all mass is on one line at some time, which the message names.
    WrongObjectError
        If a part is not by these functions.

    Examples
    --------
    >>> path = sp.ShapePath.waypoints([0.0, 2.0], [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    >>> hub = sp.deformation.rigid_part(300.0, np.diag([300.0, 350.0, 500.0]))
    >>> whole = sp.deformation.assembly(hub, [sp.deformation.moving_mass(100.0, path)])
    >>> print(whole.inertia([0.0, 2.0])[:, 2, 2])  # reduced mass of 75 kg at 2 m: 300 more
    [500. 800.]
    """
    check_object(spacecraft, "RigidPart", "spacecraft")
    if not isinstance(parts, Sequence) or not all(hasattr(part, "path") and hasattr(part, "mass") for part in parts):
        raise WrongObjectError(
            f"parts: several by moving_mass, boom or rigid_part are needed in a list, got {value_text(parts)}"
        )
    everything = (spacecraft, *parts)
    paths = [part.path for part in everything if part.path is not None]
    lengths = [path.duration for path in paths] + ([] if duration is None else [positive_argument(duration)])
    if not lengths:
        raise TrajectoryError("an assembly without moving parts needs a duration [s]")
    for first, second in pairwise(lengths):
        if abs(first - second) > _ROUNDED * first:
            raise TrajectoryError(f"all parts must move for one time, got {lengths} s; stretch or extend the paths")
    length = lengths[0]
    inner = [path.breaks[1:-1] for path in paths]
    breaks = np.unique(np.concatenate([[0.0], *inner, [length]]))
    loops = {path.loops for path in paths}
    together = len(loops) == 1
    swings = [path.swings.most and path.swings.most * (1 if together else path.loops) for path in paths]
    count = loops.pop() if together else 1
    about_zero = AssemblyDescription(
        parts=everything,
        origin=np.zeros(3),
        breaks=breaks,
        swings=Swings(most_swings(swings), all(path.swings.smooth_loop for path in paths)),
        loops=count,
    )
    description = replace(about_zero, origin=about_zero.centre_of_mass(np.zeros(1))[0])
    check_never_on_a_line(description.moment, breaks)
    gap = max((float(np.abs(path.gap).max()) for path in paths), default=0.0)
    closure = np.eye(3) if gap <= CLOSED else None
    names = f"a spacecraft with {len(parts)} parts" if len(parts) != 1 else "a spacecraft with one part"
    return Deformation(description, length, breaks, closure, gap, names, count)


def _columns(path: ShapePath, count: int, whose: str) -> ShapePath:
    if path.n_shape != count:
        raise TrajectoryError(f"{whose} needs a ShapePath of {count} columns [m], got one of {path.n_shape} columns")
    if np.abs(path.gap).max() <= CLOSED:
        return path
    # A path of joints that advances by 2 pi in every loop is a loop; one of metres is not.
    return replace(path, loops=1)
