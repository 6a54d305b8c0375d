"""Descriptions of deformations: joints that follow a path, particles, functions of time, samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_picklable, inertia_argument
from ..arrays import Array, finite_array, lock_arrays
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..chebyshev import PiecewiseChebyshev, inside, unit_nodes, values_to_coefficients
from ..errors import GaugeError, ShapeError
from ..inertia_tensor import inverse_inertia, second_moment
from ..integrator.interpolant import Interpolant
from ..integrator.smoothness import Smoothness
from ..shape_space.body_path import channels_along
from ..shape_space.scan.function_scan import FunctionScan, ScannedFunction, path_function
from ..shape_space.scan.scanning import scanned
from ..shape_space.shape_path import ShapePath
from ._physical_validity import check_never_on_a_line, check_not_on_a_line, check_triangle
from ._scanned_functions import inertia_and_momentum, positions_and_velocities

_SLOPE_DEGREE = 8  # of the polynomials that `rate_of` differentiates


class Description(Protocol):
    """The functions of a deformation; all take times (N,) in [0, duration].

    Examples
    --------
    >>> body = sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0)
    >>> inertia, momentum = body.description.sample(np.array([0.0, 1.0]))
    >>> inertia.shape, momentum.tolist()
    ((2, 3, 3), [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    """

    def sample(self, times: Array, /) -> tuple[Array, Array]:
        """Locked inertia (N, 3, 3) [kg m^2] and internal momentum (N, 3) [kg m^2/s]."""
        ...

    def channels(self, times: Array, /) -> Array | None:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o in one call (N, 9), or None where only `sample` will do."""
        ...

    def inertia_rate(self, times: Array, /) -> Array:
        """Rate of the locked inertia (N, 3, 3) [kg m^2/s]."""
        ...

    def stored_momentum(self, times: Array, /) -> Array | None:
        """Part of the internal momentum that wheels hold even at rest of all joints (N, 3); None without wheels."""
        ...

    def frame(self, times: Array, /) -> Array:
        """This description's frame in the original one (N, 3, 3)."""
        ...

    def centre_of_mass(self, times: Array, /) -> Array:
        """Centre of mass from the base origin, this description's axes (N, 3) [m]."""
        ...

    def correlation(self, times: Array, reference: float, /) -> tuple[Array, Array]:
        """Integral of r(t) r(reference)^T dm (N, 3, 3) and its rate; GaugeError where the masses are not known."""
        ...

    def kinetic_energy(self, times: Array, turning: Array, /) -> Array:
        """Energy with this frame turning at (B, N, 3) [rad/s]: -> (B, N) [J]; GaugeError like `correlation`."""
        ...

    def link_frames(self, times: Array, link: str, /) -> tuple[Array, Array]:
        """Orientation (N, 3, 3) and angular velocity (N, 3) of a link in this frame; GaugeError without links."""
        ...

    @property
    def scan(self) -> FunctionScan | None:
        """Scan of the user's functions, done when first needed; None where all is known.

        A motion in loops has that of the first. Raises and warns like `ShapePath.scan`.
        """
        ...

    def depends_on(self) -> ScannedFunction:
        """The functions of time of which all else is a smooth function, for their scan."""
        ...

    def smoothness(self, breaks: Array, /) -> Smoothness:
        """Smoothness, by which the integrator chooses how to sample it, given the deformation's breaks [s].

        Raises SingularInertiaError if the inertia is known to be singular at some time.
        """
        ...


class UserFunctions:
    """Immutable holder of a user's functions, which pickle has to find by their names."""

    _holder = "a deformation"

    def __getstate__(self) -> dict[str, Any]:
        """State to pickle. Raises LocalFunctionError for a lambda."""
        for value in vars(self).values():
            if callable(value):
                check_picklable(value, self._holder)
        return self.__dict__

    def __deepcopy__(self, _: dict[int, Any]) -> Self:
        """The holder itself, which is immutable."""
        return self


class UngaugedDescription:
    """The frame of a description that no gauge has turned, with its origin at the centre of mass; masses unknown."""

    def channels(self, times: Array) -> Array | None:  # noqa: ARG002
        return None

    @property
    def scan(self) -> FunctionScan | None:
        return self._scan

    @cached_property
    def _scan(self) -> FunctionScan | None:
        return None

    def depends_on(self) -> ScannedFunction:
        return inertia_and_momentum(self.sample, "the deformation")

    def sample(self, times: Array) -> tuple[Array, Array]:
        raise NotImplementedError

    def stored_momentum(self, times: Array) -> Array | None:  # noqa: ARG002
        return None

    def frame(self, times: Array) -> Array:
        return np.broadcast_to(np.eye(3), (len(times), 3, 3)).copy()

    def centre_of_mass(self, times: Array) -> Array:
        return np.zeros((len(times), 3))

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:  # noqa: ARG002
        raise _unknown_masses("its mean frame")

    def kinetic_energy(self, times: Array, turning: Array) -> Array:  # noqa: ARG002
        raise _unknown_masses("its kinetic energy")

    def link_frames(self, times: Array, link: str) -> tuple[Array, Array]:  # noqa: ARG002
        raise GaugeError(f"there is no link {link!r}: only the deformation of an articulated body has links")


def _unknown_masses(what: str) -> GaugeError:
    return GaugeError(
        f"of this deformation only the inertia is known, not where its masses are, and so not {what}; describe it by "
        "`articulated`, `particles` or `assembly`"
    )


@dataclass(frozen=True, eq=False)
class ArticulatedDescription(UngaugedDescription):
    """An articulated body whose joints follow a path."""

    body: Body
    path: ShapePath

    def sample(self, times: Array) -> tuple[Array, Array]:
        return self.body.sample(*self.path.curve(times))

    def channels(self, times: Array) -> Array | None:
        return channels_along(self.body, self.path, times)

    def inertia_rate(self, times: Array) -> Array:
        return self.body.inertia_rate(*self.path.curve(times))

    def centre_of_mass(self, times: Array) -> Array:
        return self.body.centre_of_mass(self.path.curve(times)[0])

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:
        return self.body.mass_correlation(*self.path.curve(times), self.path.curve(np.array([reference]))[0][0])

    def kinetic_energy(self, times: Array, turning: Array) -> Array:
        return self.body.kinetic_energy(*self.path.curve(times), turning)

    @property
    def scan(self) -> FunctionScan | None:
        return self.path.scan

    def depends_on(self) -> ScannedFunction:
        return path_function(self.path.curve, self.path.n_shape, self.path.joint_names)

    def link_frames(self, times: Array, link: str) -> tuple[Array, Array]:
        shapes, rates = self.path.curve(times)
        return self.body.link_pose(shapes, link)[:, :3, :3], self.body.link_angular_velocity(shapes, rates, link)

    def smoothness(self, breaks: Array) -> Smoothness:  # noqa: ARG002 (the path's own)
        return self.path.smoothness

    def __getstate__(self) -> dict[str, Any]:
        """Body and path alone are pickled: the scan is repeated."""
        return {"body": self.body, "path": self.path}


@dataclass(frozen=True, eq=False)
class RigidDescription(UngaugedDescription):
    """A tensor that stays as it is."""

    tensor: Array

    __post_init__ = lock_arrays

    def sample(self, times: Array) -> tuple[Array, Array]:
        return np.broadcast_to(self.tensor, (len(times), 3, 3)).copy(), np.zeros((len(times), 3))

    def inertia_rate(self, times: Array) -> Array:
        return np.zeros((len(times), 3, 3))

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:  # noqa: ARG002
        moment = np.broadcast_to(second_moment(self.tensor), (len(times), 3, 3))
        return moment.copy(), np.zeros((len(times), 3, 3))

    def kinetic_energy(self, times: Array, turning: Array) -> Array:  # noqa: ARG002
        return 0.5 * np.sum(turning * so3.apply(self.tensor, turning), axis=-1)

    def smoothness(self, breaks: Array) -> Smoothness:
        return Smoothness(breaks, oscillations=0.0)


@dataclass(frozen=True, eq=False)
class PrescribedDescription(UserFunctions, UngaugedDescription):
    """Functions of time for the inertia and the internal momentum, smooth between declared breaks.

    `on_unphysical` "error" checks every tensor.
    """

    inertia: Callable[[Array], ArrayLike]
    momentum: Callable[[Array], ArrayLike] | None
    breaks: Array
    on_unphysical: str = "allow"

    def sample(self, times: Array) -> tuple[Array, Array]:
        tensors = inertia_argument(_returned(self.inertia(times), "inertia", (len(times), 3, 3)), times)
        if self.on_unphysical == "error":
            check_triangle(tensors, times, "error")
        if self.momentum is None:
            return tensors, np.zeros((len(times), 3))
        return tensors, _returned(self.momentum(times), "internal momentum", (len(times), 3))

    def inertia_rate(self, times: Array) -> Array:
        return rate_of(lambda t: self.sample(t)[0], times, np.union1d(self.breaks, self._scan.found_breaks))

    @cached_property
    def _scan(self) -> FunctionScan:
        return scanned(self.depends_on(), self.breaks)

    def depends_on(self) -> ScannedFunction:
        return inertia_and_momentum(self.sample, "the prescribed deformation")

    def smoothness(self, breaks: Array) -> Smoothness:
        return Smoothness(breaks, resolved=self._scan.resolved)


@dataclass(frozen=True, eq=False)
class ParticleDescription(UserFunctions, UngaugedDescription):
    """Point masses that move as seen from a frame, smoothly between declared breaks; `oscillations` as `Smoothness`."""

    masses: Array
    positions: Callable[[Array], tuple[ArrayLike, ArrayLike]]
    breaks: Array
    oscillations: float | None = None

    __post_init__ = lock_arrays

    def as_given(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities (N, m, 3) as the function gives them."""
        expected_shape = (len(times), len(self.masses), 3)
        points, speeds = self.positions(times)
        return _returned(points, "positions", expected_shape), _returned(speeds, "velocities", expected_shape)

    def centred(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities (N, m, 3) from the centre of mass."""
        points, speeds = self.as_given(times)
        fraction = self.masses / self.masses.sum()
        return points - (fraction @ points)[:, None], speeds - (fraction @ speeds)[:, None]

    def moment(self, times: Array) -> Array:
        """Sum of m r r^T about the centre of mass: (N,) -> (N, 3, 3) [kg m^2]."""
        points, _ = self.centred(times)
        return np.einsum("m,nmi,nmj->nij", self.masses, points, points)

    def sample(self, times: Array) -> tuple[Array, Array]:
        points, speeds = self.centred(times)
        moment = np.einsum("m,nmi,nmj->nij", self.masses, points, points)
        check_not_on_a_line(moment, times)
        momentum = np.einsum("m,nmi->ni", self.masses, np.cross(points, speeds))
        return inertia_of(moment), momentum

    def inertia_rate(self, times: Array) -> Array:
        points, speeds = self.centred(times)
        rate = np.einsum("m,nmi,nmj->nij", self.masses, points, speeds)
        return inertia_of(rate + np.swapaxes(rate, -1, -2))

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:
        (points, speeds), (there, _) = self.centred(times), self.centred(np.array([reference]))
        weighted = self.masses[:, None] * there[0]
        return np.swapaxes(points, -1, -2) @ weighted, np.swapaxes(speeds, -1, -2) @ weighted

    def kinetic_energy(self, times: Array, turning: Array) -> Array:
        points, speeds = self.centred(times)
        total = np.cross(turning[:, :, None], points) + speeds
        return 0.5 * np.einsum("m,bnmi,bnmi->bn", self.masses, total, total)

    @cached_property
    def _scan(self) -> FunctionScan | None:
        return scanned(self.depends_on(), self.breaks) if self.oscillations is None else None

    def depends_on(self) -> ScannedFunction:
        return positions_and_velocities(self.masses, self.centred, lambda t: float(np.abs(self.as_given(t)[0]).max()))

    def smoothness(self, breaks: Array) -> Smoothness:
        check_never_on_a_line(self.moment, breaks)
        scan = self.scan
        return Smoothness(breaks, oscillations=self.oscillations, resolved=scan.resolved if scan else None)


@dataclass(frozen=True, eq=False)
class ParticlePath:
    """A path of 3 m columns read as the positions of m particles."""

    path: ShapePath

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities: (N,) -> (N, m, 3), (N, m, 3)."""
        points, speeds = self.path.curve(times)
        expected_shape = (len(times), self.path.n_shape // 3, 3)
        return points.reshape(expected_shape), speeds.reshape(expected_shape)


@dataclass(frozen=True, eq=False)
class ParticlesAlong:
    """The positions of a body of particles whose parameters follow a path, in its order."""

    body: ParticleBody
    path: ShapePath

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities: (N,) -> (N, m, 3), (N, m, 3)."""
        shapes, rates = self.path.curve(times)
        places, slopes = self.body.places(shapes)
        return places, np.einsum("nkma,nk->nma", slopes, rates)


@dataclass(frozen=True, eq=False)
class SampledDescription(UngaugedDescription):
    """A deformation kept in a file: its interpolant, the centre of mass, and the momentum that wheels store.

    Centre and stored momentum are Chebyshev coefficients on the interpolant's panels (P, n, 3).
    """

    interpolant: Interpolant
    centre: Array
    stored: Array | None = None

    def sample(self, times: Array) -> tuple[Array, Array]:
        inverse, drift = self.interpolant.inverse_and_drift(times)
        inertia = inverse_inertia(inverse, times)
        return inertia, so3.apply(inertia, drift)

    def inertia_rate(self, times: Array) -> Array:
        return rate_of(lambda t: self.sample(t)[0], times, self.interpolant.edges)

    def centre_of_mass(self, times: Array) -> Array:
        return PiecewiseChebyshev(self.interpolant.edges, self.centre)(times)

    def stored_momentum(self, times: Array) -> Array | None:
        return None if self.stored is None else PiecewiseChebyshev(self.interpolant.edges, self.stored)(times)

    def smoothness(self, breaks: Array) -> Smoothness:
        edges = np.union1d(breaks, self.interpolant.edges)
        return Smoothness(edges, oscillations=0.5)


def rate_of(function: Callable[[Array], Array], times: Array, breaks: Array) -> Array:
    """Time derivative of a smooth function between breaks: (N,) -> (N, ...).

    The slope of the polynomial through nine points around each time, on one side of every break; exact for
    polynomials of degree eight, about 1e-11 relative for a motion of a few swings.
    """
    piece = np.clip(np.searchsorted(breaks, times, side="right") - 1, 0, len(breaks) - 2)
    left, right = breaks[piece], breaks[piece + 1]
    half = 0.01 * (right - left)
    middle = np.clip(times, left + half, right - half)
    nodes = unit_nodes(_SLOPE_DEGREE)
    first, last = inside(left, right)
    points = np.clip(middle[:, None] + half[:, None] * nodes, first[:, None], last[:, None])
    values = function(points.ravel())
    values = values.reshape(len(times), len(nodes), -1)
    local = (times - middle) / half
    derivative = np.polynomial.chebyshev.chebder(values_to_coefficients(_SLOPE_DEGREE))
    weights = np.polynomial.chebyshev.chebval(local, derivative).T / half[:, None]
    return np.einsum("nk,nkc->nc", weights, values).reshape(len(times), *function(times[:1]).shape[1:])


def inertia_of(moment: Array) -> Array:
    """tr(M) - M, from sums of m r r^T: (N, 3, 3) -> (N, 3, 3)."""
    return np.trace(moment, axis1=-2, axis2=-1)[:, None, None] * np.eye(3) - moment


def _returned(value: ArrayLike, name: str, expected_shape: tuple[int, ...]) -> Array:
    array = finite_array(value, name)
    if array.shape != expected_shape:
        raise ShapeError(f"the function of the {name} must return {expected_shape} for these times, got {array.shape}")
    return array
