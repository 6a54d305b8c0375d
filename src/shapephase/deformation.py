"""Deformations: a body's locked inertia and internal momentum as functions of time, whatever they come from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from . import so3
from .arrays import Array, finite_array
from .body import Body
from .connection import path_gap, path_sampler
from .errors import ShapeError, SingularInertiaError, UnphysicalInertiaError
from .inertia_tensor import inverse_inertia
from .interpolant import Interpolant, chebyshev, inside, unit_nodes, values_to_coefficients
from .sampling import Sampler, sampler
from .shape_path import ShapePath, breaks_argument, positive_argument, times_argument

_CLOSED = 1e-9


class Source(Protocol):
    """What a deformation is made of; all functions take times (N,) in [0, duration]."""

    def sample(self, times: Array, /) -> tuple[Array, Array]:
        """Locked inertia (N, 3, 3) [kg m^2] and internal momentum (N, 3) [kg m^2/s]."""
        ...

    def inertia_rate(self, times: Array, /) -> Array:
        """Rate of the locked inertia (N, 3, 3) [kg m^2/s]."""
        ...

    def frame(self, times: Array, /) -> Array:
        """This description's frame in the original one (N, 3, 3)."""
        ...

    def centre_of_mass(self, times: Array, /) -> Array:
        """Centre of mass from the base origin, this description's axes (N, 3) [m]."""
        ...

    def sampler(self, breaks: Array, /) -> Sampler:
        """A fresh sampler of this source."""
        ...


@dataclass(frozen=True, eq=False)
class Deformation:
    """A free body that changes its shape in a known way, seen from its base frame.

    Made by `articulated`, `particles`, `prescribed` or `rigid`, or from another by a gauge.

    Attributes
    ----------
    source : the functions themselves
    duration : [s]
    breaks : (M,) times between which all is smooth, first 0, last `duration` [s]
    closure : (3, 3) where the shape at the end is the one at the start turned by it (the identity for a closed
        joint path seen from the base), else None
    shape_gap : how far the end shape is from the start shape [largest joint difference, or relative change]
    label : what it is, for people
    loops : the deformation is its first `duration / loops` seconds, this many times
    """

    source: Source
    duration: float
    breaks: Array
    closure: Array | None
    shape_gap: float
    label: str
    loops: int = 1

    def inertia(self, t: ArrayLike) -> Array:
        """Locked inertia: times (...) -> (..., 3, 3), base axes, about the centre of mass [kg m^2]."""
        times = times_argument(t, self.duration)
        return self.source.sample(times.ravel())[0].reshape(*times.shape, 3, 3)

    def internal_momentum(self, t: ArrayLike) -> Array:
        """L_o, angular momentum with the base at rest: times (...) -> (..., 3), base axes [kg m^2/s]."""
        times = times_argument(t, self.duration)
        return self.source.sample(times.ravel())[1].reshape(*times.shape, 3)

    def inertia_rate(self, t: ArrayLike) -> Array:
        """Rate of the locked inertia: times (...) -> (..., 3, 3) [kg m^2/s]."""
        times = times_argument(t, self.duration)
        return self.source.inertia_rate(times.ravel()).reshape(*times.shape, 3, 3)

    def frame(self, t: ArrayLike) -> Array:
        """U(t), this description's frame in the original one, d_here = U d: times (...) -> (..., 3, 3)."""
        times = times_argument(t, self.duration)
        return self.source.frame(times.ravel()).reshape(*times.shape, 3, 3)

    def centre_of_mass(self, t: ArrayLike) -> Array:
        """Centre of mass from the base origin: times (...) -> (..., 3), this description's axes [m]."""
        times = times_argument(t, self.duration)
        return self.source.centre_of_mass(times.ravel()).reshape(*times.shape, 3)

    def sampler(self) -> Sampler:
        """A fresh sampler for the integrator."""
        return self.source.sampler(self.breaks)


def articulated(body: Body, path: ShapePath) -> Deformation:
    """The deformation of a body whose joints follow a path.

    Joints are matched by name where the path has names, else by order.

    Raises
    ------
    UnknownNameError, TrajectoryError
        If the path has other joints than the body.
    """
    route = path.matched(body.joint_names, body.name)
    gap = float(np.max(np.abs(path_gap(body, route)), initial=0.0))
    closure = np.eye(3) if gap <= _CLOSED else None
    source = _Articulated(body, route)
    return Deformation(source, route.duration, route.breaks, closure, gap, f"{body.name} along a path", route.loops)


def rigid(inertia: ArrayLike, duration: float) -> Deformation:
    """A rigid body: constant inertia (3, 3) [kg m^2], no internal momentum, for `duration` [s].

    Source: Cabrera 2006, example 2.6; theory.md A10.
    """
    tensor = _inertia_argument(finite_array(inertia, "inertia", (3, 3))[None])[0]
    length = positive_argument(duration)
    return Deformation(_Rigid(tensor), length, np.array([0.0, length]), np.eye(3), 0.0, "rigid body")


def prescribed(
    inertia: Callable[[Array], ArrayLike],
    internal_momentum: Callable[[Array], ArrayLike] | None,
    duration: float,
    breaks: ArrayLike = (),
) -> Deformation:
    """A deformation given by functions of time.

    Parameters
    ----------
    inertia : times (N,) -> (N, 3, 3) [kg m^2], symmetric positive definite
    internal_momentum : times (N,) -> (N, 3) [kg m^2/s]; None: zero
    duration : [s]
    breaks : interior times where a derivative jumps [s]

    The shape is taken to be a loop when the inertia at the end is that at the start, to 1e-9.

    Raises
    ------
    ShapeError, UnphysicalInertiaError
        If a function returns the wrong shape, or a tensor that is not symmetric.
    """
    length = positive_argument(duration)
    edges = breaks_argument(breaks, length)
    source = _Prescribed(inertia, internal_momentum, edges)
    ends = source.sample(np.array([0.0, length]))[0]
    gap = float(np.max(np.abs(ends[1] - ends[0])) / np.max(np.abs(ends[0])))
    return Deformation(source, length, edges, np.eye(3) if gap <= _CLOSED else None, gap, "prescribed inertia")


def particles(
    masses: ArrayLike,
    positions: Callable[[Array], tuple[ArrayLike, ArrayLike]],
    duration: float,
    breaks: ArrayLike = (),
) -> Deformation:
    """A body of point masses that move in a known way as seen from a frame.

    Parameters
    ----------
    masses : (m,) [kg], positive, two or more
    positions : times (N,) -> positions (N, m, 3) [m], velocities (N, m, 3) [m/s]; need not be centred
    duration : [s]
    breaks : interior times where a derivative jumps [s]

    The shape is a loop when the particles at the end are those at the start turned by some rotation, which
    is then the closure.

    Raises
    ------
    ShapeError
        If shapes of arrays disagree or a mass is not positive. Collinear particles raise SingularInertiaError
        when the motion is computed.

    Source: Cabrera 2006, sections 2.1 to 2.3; theory.md A1 to A3, A7, A8.
    """
    weights = finite_array(masses, "masses", (None,), unit="kg")
    if weights.ndim != 1 or len(weights) < 2 or np.any(weights <= 0.0):
        raise ShapeError(f"masses: two numbers or more above 0 [kg] are needed, got {weights}")
    length = positive_argument(duration)
    source = _Particles(weights, positions)
    ends, _ = source.centred(np.array([0.0, length]))
    turn = _best_turn(weights, ends[0], ends[1])
    size = float(np.max(np.linalg.norm(ends[0], axis=-1)))
    if size == 0.0:
        raise SingularInertiaError("all particles are in one place: there is no inertia that could turn")
    gap = float(np.max(np.linalg.norm(ends[1] - ends[0] @ turn.T, axis=-1))) / size
    closure = turn if gap <= _CLOSED else None
    return Deformation(source, length, breaks_argument(breaks, length), closure, gap, f"{len(weights)} particles")


def sampled_deformation(
    interpolant: Interpolant, centre: Array, breaks: Array, closure: Array | None, shape_gap: float, label: str
) -> Deformation:
    """A deformation known only by its interpolant, as kept in a file; `centre` are Chebyshev coefficients (P, n, 3)."""
    source = _Sampled(interpolant, centre)
    return Deformation(source, float(breaks[-1]), breaks, closure, shape_gap, label)


class _Original:
    """The frame of a description that no gauge has turned, with its origin at the centre of mass."""

    def frame(self, times: Array) -> Array:
        return np.broadcast_to(np.eye(3), (len(times), 3, 3)).copy()

    def centre_of_mass(self, times: Array) -> Array:
        return np.zeros((len(times), 3))


@dataclass(frozen=True, eq=False)
class _Articulated(_Original):
    body: Body
    path: ShapePath

    def sample(self, times: Array) -> tuple[Array, Array]:
        return self.body.sample(*self.path.curve(times))

    def inertia_rate(self, times: Array) -> Array:
        return self.body.inertia_rate(*self.path.curve(times))

    def centre_of_mass(self, times: Array) -> Array:
        return self.body.centre_of_mass(self.path.curve(times)[0])

    def sampler(self, breaks: Array) -> Sampler:  # noqa: ARG002 (the path's own)
        return path_sampler(self.body, self.path)


@dataclass(frozen=True, eq=False)
class _Rigid(_Original):
    tensor: Array

    def sample(self, times: Array) -> tuple[Array, Array]:
        return np.broadcast_to(self.tensor, (len(times), 3, 3)).copy(), np.zeros((len(times), 3))

    def inertia_rate(self, times: Array) -> Array:
        return np.zeros((len(times), 3, 3))

    def sampler(self, breaks: Array) -> Sampler:
        return sampler(self.sample, breaks, oscillations=0.0)


@dataclass(frozen=True, eq=False)
class _Prescribed(_Original):
    inertia: Callable[[Array], ArrayLike]
    momentum: Callable[[Array], ArrayLike] | None
    breaks: Array

    def sample(self, times: Array) -> tuple[Array, Array]:
        tensors = _inertia_argument(_returned(self.inertia(times), "inertia", (len(times), 3, 3)), times)
        if self.momentum is None:
            return tensors, np.zeros((len(times), 3))
        return tensors, _returned(self.momentum(times), "internal momentum", (len(times), 3))

    def inertia_rate(self, times: Array) -> Array:
        return rate_of(lambda t: self.sample(t)[0], times, self.breaks)

    def sampler(self, breaks: Array) -> Sampler:
        return sampler(self.sample, breaks)


@dataclass(frozen=True, eq=False)
class _Particles(_Original):
    masses: Array
    positions: Callable[[Array], tuple[ArrayLike, ArrayLike]]

    def centred(self, times: Array) -> tuple[Array, Array]:
        """Positions and velocities (N, m, 3) from the centre of mass."""
        wanted = (len(times), len(self.masses), 3)
        both = self.positions(times)
        points, speeds = (
            _returned(part, name, wanted) for name, part in zip(("positions", "velocities"), both, strict=True)
        )
        fraction = self.masses / self.masses.sum()
        return points - (fraction @ points)[:, None], speeds - (fraction @ speeds)[:, None]

    def sample(self, times: Array) -> tuple[Array, Array]:
        points, speeds = self.centred(times)
        moment = np.einsum("m,nmi,nmj->nij", self.masses, points, points)
        momentum = np.einsum("m,nmi->ni", self.masses, np.cross(points, speeds))
        return _inertia_of(moment), momentum

    def inertia_rate(self, times: Array) -> Array:
        points, speeds = self.centred(times)
        rate = np.einsum("m,nmi,nmj->nij", self.masses, points, speeds)
        return _inertia_of(rate + np.swapaxes(rate, -1, -2))

    def sampler(self, breaks: Array) -> Sampler:
        return sampler(self.sample, breaks)


@dataclass(frozen=True, eq=False)
class _Sampled(_Original):
    interpolant: Interpolant
    centre: Array

    def sample(self, times: Array) -> tuple[Array, Array]:
        inverse, drift = self.interpolant.inverse_and_drift(times)
        inertia = inverse_inertia(inverse, times)
        return inertia, so3.apply(inertia, drift)

    def inertia_rate(self, times: Array) -> Array:
        return rate_of(lambda t: self.sample(t)[0], times, self.interpolant.edges)

    def centre_of_mass(self, times: Array) -> Array:
        panel = self.interpolant.panel_of(times)
        left, right = self.interpolant.edges[panel], self.interpolant.edges[panel + 1]
        basis = chebyshev(np.clip((2.0 * times - left - right) / (right - left), -1.0, 1.0), self.centre.shape[1])
        return np.einsum("nk,nkc->nc", basis, self.centre[panel % len(self.centre)])

    def sampler(self, breaks: Array) -> Sampler:
        edges = np.union1d(breaks, self.interpolant.edges)
        return sampler(self.sample, edges, oscillations=0.5)


def rate_of(function: Callable[[Array], Array], times: Array, breaks: Array) -> Array:
    """Time derivative of a smooth function between breaks: (N,) -> (N, ...).

    The slope of the polynomial through nine points around each time, on one side of every break; exact for
    polynomials of degree eight, about 1e-11 relative for a motion of a few swings.
    """
    piece = np.clip(np.searchsorted(breaks, times, side="right") - 1, 0, len(breaks) - 2)
    left, right = breaks[piece], breaks[piece + 1]
    half = 0.01 * (right - left)
    middle = np.clip(times, left + half, right - half)
    nodes = unit_nodes(8)
    first, last = inside(left, right)
    points = np.clip(middle[:, None] + half[:, None] * nodes, first[:, None], last[:, None])
    values = function(points.ravel())
    values = values.reshape(len(times), 9, -1)
    local = (times - middle) / half
    derivative = np.polynomial.chebyshev.chebder(values_to_coefficients(8))
    weights = np.polynomial.chebyshev.chebval(local, derivative).T / half[:, None]
    return np.einsum("nk,nkc->nc", weights, values).reshape(len(times), *function(times[:1]).shape[1:])


def _inertia_of(moment: Array) -> Array:
    """tr(M) - M, from sums of m r r^T."""
    return np.trace(moment, axis1=-2, axis2=-1)[:, None, None] * np.eye(3) - moment


def _inertia_argument(tensors: Array, times: Array | None = None) -> Array:
    skew = np.abs(tensors - np.swapaxes(tensors, -1, -2)).max(initial=0.0)
    if skew > 1e-9 * np.abs(tensors).max(initial=0.0):
        raise UnphysicalInertiaError(f"an inertia tensor must be symmetric; its entries differ by {skew:.3g} kg m^2")
    symmetric = 0.5 * (tensors + np.swapaxes(tensors, -1, -2))
    inverse_inertia(symmetric, times)
    return symmetric


def _returned(value: ArrayLike, name: str, wanted: tuple[int, ...]) -> Array:
    array = finite_array(value, name)
    if array.shape != wanted:
        raise ShapeError(f"the function of the {name} must return {wanted} for these times, got {array.shape}")
    return array


def _best_turn(masses: Array, start: Array, end: Array) -> Array:
    """The rotation that takes one set of points nearest to another (Kabsch 1976)."""
    left, _, right = np.linalg.svd(np.einsum("m,mi,mj->ij", masses, end, start))
    sign = np.sign(np.linalg.det(left @ right))
    return left @ np.diag([1.0, 1.0, sign]) @ right
