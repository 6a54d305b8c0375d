"""A body of point masses whose places are functions of a few parameters: shapes without a file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_picklable, names_argument
from ...arrays import Array, finite_array, lock_arrays
from ...display import short_repr
from ...errors import ShapeError, WrongObjectError, unknown_name
from ...letters import value_text
from ..couplings.coordinate_map import CoordinateMap
from ..shape_arguments import ShapeArguments
from ._given_positions import GivenPositions, Places
from .casadi_positions import CasadiPositions, is_casadi_function, particle_maps


@dataclass(frozen=True, eq=False)
class ParticleBody(ShapeArguments):
    """Point masses whose places in a frame are functions of a shape: polygons, n bodies, a hub with a cord.

    It stands wherever a `Body` stands for its inertia and momentum alone: `mechanical_connection`, `curvature`,
    `holonomy` and the like, `reachable`, and `articulated`, which makes a deformation of particles. Made by
    `particle_body`.

    Attributes
    ----------
    masses : (m,) [kg]
    joint_names : of the parameters
    joint_units : their units, "rad" or "m"
    joint_limits : (n, 2), infinite where there are none
    continuous : (n,) True where values 2 pi apart are the same shape
    name : label in messages and figures
    places : shapes (N, n) -> places (N, m, 3) [m] and their derivatives (N, n, m, 3)

    Examples
    --------
    >>> def places(shapes):
    ...     return np.stack([[[r, 0, 0], [-r, 0, 0], [0, 1, 0]] for (r,) in shapes]), np.tile(
    ...         [[[1.0, 0, 0], [-1, 0, 0], [0, 0, 0]]], (len(shapes), 1, 1, 1)
    ...     )
    >>> body = sp.particle_body([1.0, 1.0, 1.0], places, ["half_width"], units="m")
    >>> body.locked_inertia([2.0])[2, 2].round(6).item()  # 2 r^2 + 2/3
    8.666667
    """

    masses: Array
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    joint_limits: Array
    continuous: Array
    name: str
    places: CasadiPositions | GivenPositions

    __post_init__ = lock_arrays
    __repr__ = short_repr
    _coordinate = "parameter"

    def __getstate__(self) -> dict[str, Any]:
        """State for pickle. Raises LocalFunctionError for places given by a lambda."""
        given = self.places
        check_picklable(given.function if isinstance(given, GivenPositions) else given, "a body of particles")
        return self.__dict__

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.masses.sum())

    sha256 = None  # it comes from no file
    ball_joints: ClassVar[tuple[str, ...]] = ()

    @cached_property
    def follows(self) -> CoordinateMap:
        """Coordinates of all joints from the shape: the shape itself."""
        count = self.n_shape
        return CoordinateMap(self.joint_names, self.joint_names, np.eye(count), np.zeros(count))

    @property
    def rate_limits(self) -> Array:
        """Largest rates: (n,), infinite."""
        return np.full(self.n_shape, np.inf)

    @property
    def effort_limits(self) -> Array:
        """Largest forces and torques: (n,), infinite."""
        return self.rate_limits

    def joint_columns(self, names: Iterable[str]) -> list[int]:
        """Places of parameters in the shape vector, in ascending order. Raises UnknownNameError."""
        return sorted({self.joint_index(name) for name in names})

    def shape(self, joints: Mapping[str, float] | None = None) -> Array:
        """The shape with the named parameters at these values, all others 0: -> (n,). Raises UnknownNameError."""
        shape = np.zeros(self.n_shape)
        for name, value in (joints or {}).items():
            shape[self.joint_index(name)] = finite_array(value, f"parameter {name}")
        return shape

    def maps(self) -> Any:
        """Return I (3, 3), J (3, n), the mass matrix (n, n) and the centre of mass (3,) as functions of one shape (n,).

        One `casadi.Function`, to be used while the body exists; the mass matrix is that of a frame at rest, about the
        centre of mass. Higher derivatives of places from a Python function are differences of the given ones.
        """
        return particle_maps(self.places.symbolic, self.masses)

    def positions(self, shape: ArrayLike) -> Array:
        """Places of the particles from their centre of mass: (..., n) -> (..., m, 3) [m]."""
        r = self._checked(shape)
        return self._centred(self._rows(r))[0].reshape(*r.shape[:-1], len(self.masses), 3)

    def locked_inertia(self, shape: ArrayLike) -> Array:
        """Inertia frozen in a shape, about the centre of mass: (..., n) -> (..., 3, 3) [kg m^2]. See `Body`."""
        r = self._checked(shape)
        return self._inertia(self._centred(self._rows(r))[0]).reshape(*r.shape[:-1], 3, 3)

    def momentum_matrix(self, shape: ArrayLike) -> Array:
        """J(r), angular momentum per unit rate: (..., n) -> (..., 3, n) [kg m^2/s per unit]. See `Body`."""
        r = self._checked(shape)
        return self._matrix(*self._centred(self._rows(r))).reshape(*r.shape[:-1], 3, self.n_shape)

    def angular_map_gradient(self, shape: ArrayLike) -> Array:
        """d[I, J]/dr_k, both side by side: (..., n) -> (..., n, 3, 3 + n)."""
        r = self._checked(shape)
        rows = self._rows(r)
        places, slopes = self._centred(rows)
        cross = np.einsum("m,nkmi,nmj->nkij", self.masses, slopes, places)
        moment = cross + np.swapaxes(cross, -1, -2)
        inertia = np.trace(moment, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - moment
        turning = np.cross(slopes[:, :, None], slopes[:, None]) + np.cross(places[:, None, None], self._bends(rows))
        matrix = np.einsum("m,nkjma->nkaj", self.masses, turning)
        return np.concatenate([inertia, matrix], axis=-1).reshape(*r.shape[:-1], self.n_shape, 3, 3 + self.n_shape)

    def inertia_rate(self, shape: ArrayLike, rate: ArrayLike) -> Array:
        """dI/dt along a motion of the parameters: (..., n), (..., n) -> (..., 3, 3) [kg m^2/s]."""
        r, v = self._pair(shape, rate)
        return np.einsum("...kab,...k->...ab", self.inertia_gradient(r), v)

    def angular_momentum_gradient(self, shape: ArrayLike, rate: ArrayLike, base_rate: ArrayLike) -> Array:
        """dI/dr_k w + dJ/dr_k rate: three times (..., n or 3) -> (..., n, 3) [kg m^2/s per unit]. See `Body`."""
        r, v, w = self._with_base_rate(shape, rate, base_rate)
        return np.einsum("...kab,...b->...ka", self.angular_map_gradient(r), np.concatenate([w, v], axis=-1))

    def centre_of_mass(self, shape: ArrayLike) -> Array:
        """Centre of mass from the origin of the places: (..., n) -> (..., 3) [m]."""
        r = self._checked(shape)
        return ((self.masses / self.mass) @ self.places(self._rows(r))[0]).reshape(*r.shape[:-1], 3)

    def kinetic_energy(self, shape: ArrayLike, rate: ArrayLike, angular_velocity: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """About the centre of mass, while the frame turns: -> (...) [J]. See `Body`."""
        r, v, omega = self._turning(shape, rate, angular_velocity)
        places, slopes = self._centred(self._rows(r))
        moving = np.einsum("nkma,nk->nma", slopes, self._rows(v))
        moving += np.cross(omega.reshape(-1, 1, 3), places)
        return (0.5 * np.einsum("m,nma,nma->n", self.masses, moving, moving)).reshape(r.shape[:-1])

    def sample(self, shape: Array, rate: Array) -> tuple[Array, Array]:
        """Locked inertia and internal momentum along a trajectory: (N, n), (N, n) -> (N, 3, 3), (N, 3). Unchecked."""
        places, slopes = self._centred(shape)
        return self._inertia(places), so3.apply(self._matrix(places, slopes), rate)

    def sample_rates(self, shape: Array, rate: Array) -> tuple[Array, Array, Array, Array]:
        """I, J, dI/dt and dJ/dt along a trajectory: (N, n), (N, n) -> (N, 3, 3), (N, 3, n) and once more. Unchecked."""
        places, slopes = self._centred(shape)
        change = np.einsum("nkab,nk->nab", self.angular_map_gradient(shape), rate)
        return self._inertia(places), self._matrix(places, slopes), change[..., :3], change[..., 3:]

    def _centred(self, rows: Array) -> tuple[Array, Array]:
        """Places and their derivatives from the centre of mass: (N, n) -> (N, m, 3), (N, n, m, 3)."""
        places, slopes = self.places(rows)
        share = self.masses / self.mass
        return places - (share @ places)[:, None], slopes - (share @ slopes)[:, :, None]

    def _bends(self, rows: Array) -> Array:
        """Second derivatives of the places, exactly symmetric: (N, n) -> (N, n, n, m, 3)."""
        bends = self.places.bends(rows)
        bends = 0.5 * (bends + np.swapaxes(bends, 1, 2))
        return bends - ((self.masses / self.mass) @ bends)[..., None, :]

    def _inertia(self, places: Array) -> Array:
        moment = np.einsum("m,nmi,nmj->nij", self.masses, places, places)
        return np.trace(moment, axis1=-2, axis2=-1)[:, None, None] * np.eye(3) - moment

    def _matrix(self, places: Array, slopes: Array) -> Array:
        return np.einsum("m,nkma->nak", self.masses, np.cross(places[:, None], slopes))


def particle_body(
    masses: ArrayLike,
    places: Callable[[Array], tuple[ArrayLike, ArrayLike]] | Any,
    parameters: Sequence[str],
    *,
    units: str | Sequence[str] = "rad",
    continuous: Sequence[str] = (),
    limits: Mapping[str, tuple[float, float]] | None = None,
    name: str = "particles",
) -> ParticleBody:
    """A body of point masses from their places as a function of a shape.

    Source: Cabrera 2006, sections 2.1 to 2.3; theory.md A1 to A3, B1.

    Parameters
    ----------
    masses : (m,) [kg], positive, two or more
    places : shapes (N, n) -> places (N, m, 3) [m], which need not be centred, and their derivatives by each parameter
        (N, n, m, 3); or a `casadi.Function` of one shape (n) that gives (m, 3), or (m, 2) in a plane: CasADi then
        finds the derivatives
    parameters : names of the n entries of a shape
    units : of all, or of each: "rad" or "m"
    continuous : names of those that turn without end, so that values 2 pi apart are the same shape
    limits : name -> least and largest value of a parameter, for plans; others have none
    name : label in messages and figures

    Raises
    ------
    ShapeError
        If limits do not ascend, masses are not positive, arrays have other shapes, or derivatives are not those of the
        places.
    WrongObjectError
        If `places` cannot be called.
    UnknownNameError
        If `continuous` or `limits` names another parameter.

    Examples
    --------
    >>> import casadi as ca
    >>> r = ca.SX.sym("r", 2)
    >>> corners = ca.vertcat(ca.horzcat(0, 0), ca.horzcat(1, 0), ca.horzcat(ca.cos(r[0]), ca.sin(r[0])) * r[1])
    >>> triangle = sp.particle_body([1, 1, 1], ca.Function("corners", [r], [corners]), ["angle", "side"])
    >>> sp.curvature(triangle, [1.0, 1.0])[0, 1].round(6).tolist()
    [0.0, 0.0, -0.703988]
    """
    weights = finite_array(masses, "masses", (None,), unit="kg").copy()
    if weights.ndim != 1 or len(weights) < 2 or np.any(weights <= 0.0):
        raise ShapeError(f"masses: two numbers or more above 0 [kg] are needed, got {value_text(weights)}")
    names = names_argument(parameters, "parameters", "names of the parameters in a list")
    of_each = (units,) * len(names) if isinstance(units, str) else names_argument(units, "units", "a unit for each")
    if len(of_each) != len(names) or not set(of_each) <= {"rad", "m"}:
        raise ShapeError(f'units: "rad" or "m", of all or of each of {len(names)}, are needed, got {value_text(units)}')
    endless = names_argument(continuous, "continuous", "names of parameters in a list")
    for parameter in endless:
        if parameter not in names:
            raise unknown_name("parameter", parameter, names)
    if is_casadi_function(places):
        function = CasadiPositions(places, len(names), len(weights))
    elif callable(places) and not isinstance(places, type):
        function = GivenPositions(cast("Places", places), len(names), len(weights))
    else:
        raise WrongObjectError(
            f"places: a function of shapes that gives places and derivatives is needed, got {value_text(places)}"
        )
    bounds = np.tile([-np.inf, np.inf], (len(names), 1))
    for parameter, given in ({} if limits is None else limits).items():
        if parameter not in names:
            raise unknown_name("parameter", parameter, names)
        bounds[names.index(parameter)] = low, high = finite_array(given, f"limits of {parameter}", (2,))
        if not low <= high:
            raise ShapeError(
                f"limits: of {parameter}, the lower before the upper one are needed, got {value_text(given)}"
            )
    turning = np.array([parameter in endless for parameter in names], dtype=bool)
    return ParticleBody(
        masses=weights,
        joint_names=names,
        joint_units=of_each,
        joint_limits=bounds,
        continuous=turning,
        name=str(name),
        places=function,
    )
