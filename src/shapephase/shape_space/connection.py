"""The mechanical connection: how a motion of the joints alone turns a free body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_choice, check_function, times_argument, tolerance_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..display import frozen
from ..errors import AccuracyNotReached, OpenPathError, ShapeError
from ..inertia_tensor import inverse_inertia
from ..integrator.integrate import stepped_rotation
from ..integrator.stepped import SteppedRotation
from .body_path import check_closed, path_sampler, users_route_along
from .path_series import evenly_divided, panel_edges
from .shape_path import CLOSED, ShapePath

_GAUSS_RULE = np.polynomial.legendre.leggauss(16)  # 16 nodes resolve a few swings on a panel
_PIECES = [2**k for k in range(1, 7)]  # panels per piece, in turn: a change at 64 means an undeclared break


def mechanical_connection(body: Body | ParticleBody | str, shape: ArrayLike, *, of: str = "coordinates") -> Array:
    """Rotation rate of the base that cancels the angular momentum of a joint motion.

    A(r) = I(r)^-1 J(r): with zero momentum the base turns at omega = -A(r) rate [rad/s, base axes].

    Equation :eq:`connection` of the documentation, for ball joints with :eq:`ball-rates`.
    Source: Cabrera 2006, sections 2.1 and 2.3.1 (a); theory.md B1.

    Parameters
    ----------
    shape : (..., n) joint coordinates [rad or m]
    of : "coordinates", a column for each coordinate of the shape; "rates", for each rate of the joints. The two
        differ for ball joints only, which have four coordinates and three rates (`Body.rate_names`)

    Returns
    -------
    (..., 3, n) connection, base axes [rad per unit of joint]; (..., 3, m) of rates

    Raises
    ------
    ShapeError
        If the last axis is not the body's n joints, or an entry is not finite.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> sp.mechanical_connection(cat, np.zeros(3)).round(6).tolist()
    [[0.0, 0.0, 0.5], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]
    """
    body = as_body_or_particles(body)
    frame = _rate_frame(body, shape, of)
    columns = inverse_inertia(body.locked_inertia(shape)) @ body.momentum_matrix(shape)
    return columns if frame is None else columns @ frame


def _rate_frame(body: Body | ParticleBody, shape: ArrayLike, of: str) -> Array | None:
    """The frame (..., n, m) in which results are; None: that of the coordinates."""
    check_choice(of, "value of of", ("coordinates", "rates"))
    return None if of == "coordinates" or isinstance(body, ParticleBody) else body.rate_frame(shape)


def curvature(body: Body | ParticleBody | str, shape: ArrayLike, *, of: str = "coordinates") -> Array:
    """Curvature of the mechanical connection, F_ij = d_i A_j - d_j A_i - A_i x A_j.

    A small square of side e in the joints i, j, gone round from i to j, turns the body by exp(-e^2 F_ij).

    For rates, e_a the directions in which one of them is 1, it is F(e_a, e_b) = e_a(A_b) - e_b(A_a) - A([e_a, e_b])
    - A_a x A_b: those of a ball joint do not commute, [e_x, e_y] = e_z and so on.

    Equation :eq:`curvature` of the documentation; of rates :eq:`ball-curvature`.
    Raises like `mechanical_connection`. Source: theory.md B6; numerics.md section 4.

    Parameters
    ----------
    shape, of : as for `mechanical_connection`

    Returns
    -------
    (..., n, n, 3) antisymmetric in i, j; base axes [rad per product of the two joints' units]; (..., m, m, 3) of rates

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> sp.curvature(cat, np.zeros(3))[1, 2].round(6).tolist()  # of waist_pitch and waist_yaw
    [0.0, 0.0625, 0.0]
    """
    body = as_body_or_particles(body)
    columns, slopes = connection_slopes(body, shape)
    bracket = np.cross(columns[..., :, None, :], columns[..., None, :, :])
    curvatures = slopes - np.swapaxes(slopes, -2, -3) - bracket
    frame = _rate_frame(body, shape, of)
    return curvatures if frame is None else np.einsum("...ia,...ijk,...jb->...abk", frame, curvatures, frame)


def connection_slopes(body: Body | ParticleBody | str, shape: ArrayLike) -> tuple[Array, Array]:
    """Columns A_j of the connection and their exact derivatives d_i A_j: (..., n) -> (..., n, 3), (..., n, n, 3).

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> columns, slopes = sp.shape_space.connection_slopes(cat, np.zeros(3))
    >>> print(columns.round(6).tolist(), slopes.shape)
    [[0.0, 0.5, 0.0], [0.0, 0.0, 0.5], [0.5, 0.0, 0.0]] (3, 3, 3)
    """
    body = as_body_or_particles(body)
    connection = mechanical_connection(body, shape)
    inverse = inverse_inertia(body.locked_inertia(shape))[..., None, :, :]
    # dA_i = I^-1 (dJ_i - dI_i A), indices (i, axis, j)
    gradient = inverse @ (
        body.momentum_matrix_gradient(shape) - body.inertia_gradient(shape) @ connection[..., None, :, :]
    )
    return np.swapaxes(connection, -1, -2), np.swapaxes(gradient, -1, -2)


def holonomy(body: Body | ParticleBody | str, path: ShapePath | str, tolerance: float = 1e-9) -> Array:
    """The rotation of a body with zero angular momentum whose joints go once round a loop.

    Equation :eq:`holonomy` of the documentation.
    Source: Cabrera 2006, section 3.1.1 (R_G); theory.md B7.

    Parameters
    ----------
    path : a closed path; a continuous joint may end whole turns from its start
    tolerance : of the rotation, between 1e-13 and 1e-4 [rad]

    Returns
    -------
    (3, 3) attitude at the end for the identity at the start

    Raises
    ------
    OpenPathError
        If the path does not close: then the rotation depends on where the base frame is fixed.

    Examples
    --------
    >>> cat, bend = sp.load_body("cat_two_halves"), np.radians(59.426458741516)
    >>> turn = sp.holonomy(cat, sp.examples.kane_scher(0.0, bend))
    >>> print(f"{np.degrees(sp.so3.angle(turn)):.6f} degrees: it turns over")
    180.000000 degrees: it turns over
    """
    body, goal = as_body_or_particles(body), tolerance_argument(tolerance)
    route = users_route_along(body, path)
    check_closed(body, route)
    return _lift(body, route, goal).end[0]


@frozen
class HorizontalLift:
    """The attitude of a body with zero angular momentum along a path of its joints. Made by `horizontal_lift`.

    Attributes
    ----------
    body : the one that moves
    path : how the joints move, in the body's order
    solution : the integrated rotation
    """

    body: Body | ParticleBody
    path: ShapePath
    solution: SteppedRotation

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.path.duration

    @property
    def error_estimate(self) -> float:
        """Estimate of the largest attitude error along the path [rad]."""
        return float(self.solution.error_estimate[0])

    @property
    def end(self) -> Array:
        """The attitude at the end, (3, 3); of a loop its holonomy."""
        return self.solution.end[0]

    def attitude(self, t: ArrayLike) -> Array:
        """Base axes to the base axes at the start: times (...) -> (..., 3, 3). Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        return self.solution.rotation(times.ravel())[0].reshape(*times.shape, 3, 3)

    def angular_velocity(self, t: ArrayLike) -> Array:
        """-A(r) rate: times (...) -> (..., 3), base axes [rad/s]. Raises TrajectoryError outside."""
        times = times_argument(t, self.duration)
        shapes, rates = self.path.curve(times.ravel())
        return -so3.apply(mechanical_connection(self.body, shapes), rates).reshape(*times.shape, 3)


def horizontal_lift(body: Body | ParticleBody | str, path: ShapePath | str, tolerance: float = 1e-9) -> HorizontalLift:
    """The attitude of a body with zero angular momentum along a path, open or closed: R' = R hat(-A rate), R(0) = 1.

    Source: Cabrera 2006, section 2.3.1 (a) and remark 2.11; theory.md B2, B8.

    Parameters
    ----------
    path : any path of the body's joints
    tolerance : of the attitude at all times, between 1e-13 and 1e-4 [rad]

    Raises
    ------
    UnknownNameError, TrajectoryError
        If the path has other joints than the body.
    AccuracyNotReached
        If the tolerance cannot be met.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, np.radians(59.426458741516))
    >>> lift = sp.horizontal_lift(cat, loop)
    >>> print(f"{np.degrees(sp.so3.angle(lift.attitude(loop.duration))):.6f} degrees: it turns over")
    180.000000 degrees: it turns over
    """
    body, goal = as_body_or_particles(body), tolerance_argument(tolerance)
    route = users_route_along(body, path)
    return HorizontalLift(body, route, _lift(body, route, goal))


def _lift(body: Body | ParticleBody, route: ShapePath, tolerance: float) -> SteppedRotation:
    return stepped_rotation(path_sampler(body, route), np.zeros((1, 3)), tolerance)


def holonomy_derivative(
    body: Body | ParticleBody | str,
    path: ShapePath | str,
    variation: Callable[[Array], ArrayLike],
    tolerance: float = 1e-9,
) -> tuple[Array, Array]:
    """The holonomy of a loop, and its exact derivative by parameters that the loop may depend on.

    Seen from the start, the loop path + c variation_k turns the body by exp(c hat(d_k)) holonomy to first order in c:
    d_k is the integral of the curvature F(rate, variation_k), carried along by the lift, plus what moving the loop's
    own start does.

    Source: theory.md B6; numerics.md section 4 (curvature of the connection).

    Parameters
    ----------
    path : a closed path, as for `holonomy`
    variation : times (N,) -> (N, m, n), the derivatives of the shape by m parameters, joints in the body's order;
        smooth between the path's breaks, the same at the end as at the start
    tolerance : of the holonomy, and of its derivative relative to the integral of the curvature's size

    Returns
    -------
    holonomy : (3, 3)
    derivative : (m, 3) d_k, inertial axes [rad per unit of the parameter]

    Raises
    ------
    OpenPathError
        If the path does not close, or a variation opens it.
    ShapeError
        If `variation` returns another shape, or what is not finite.
    AccuracyNotReached
        If the tolerance cannot be met.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> def growing(t):
    ...     return loop.shape(t)[:, None, :]
    >>> turn, slope = sp.holonomy_derivative(cat, loop, growing)
    >>> slope.shape
    (1, 3)
    """
    body, goal = as_body_or_particles(body), tolerance_argument(tolerance)
    route = users_route_along(body, path)
    check_function(variation, "variation", "a function of times that gives changes of shape (N, m, n)")
    check_closed(body, route)
    lift = _lift(body, route, goal)
    ends = np.array([0.0, route.duration])
    at_ends = _variation_at(variation, ends, body.n_shape)
    if np.abs(at_ends[1] - at_ends[0]).max(initial=0.0) > CLOSED * (1.0 + np.abs(at_ends).max(initial=0.0)):
        raise OpenPathError("a variation opens the loop: it must be the same at the end as at the start")
    turned = lift.end[0]
    connection = mechanical_connection(body, route.shape(0.0))
    moved_start = -(at_ends[0] @ connection.T) @ (turned - np.eye(3)).T

    def carried_curvature(times: Array) -> tuple[Array, Array]:
        shapes, rates = route.curve(times)
        inertia, matrix, inertia_rate, matrix_rate = body.sample_rates(shapes, rates)
        inverse = inverse_inertia(inertia, times)
        columns = inverse @ matrix
        turning = -so3.apply(columns, rates)
        along = inverse @ (matrix_rate - inertia_rate @ columns)
        across = inverse @ np.swapaxes(body.angular_momentum_gradient(shapes, rates, turning), -1, -2)
        bracket = so3.hat(turning) @ columns
        by_joint = lift.rotation(times)[0] @ (along - across + bracket)
        changes = _variation_at(variation, times, body.n_shape)
        scale = np.einsum("nak,nmk->n", np.abs(along) + np.abs(across) + np.abs(bracket), np.abs(changes))
        return np.einsum("nak,nmk->nma", by_joint, changes), scale

    return turned, moved_start + integral(carried_curvature, panel_edges(route, route.loops), goal)


def _variation_at(variation: Callable[[Array], ArrayLike], times: Array, n_shape: int) -> Array:
    values = finite_array(variation(times), "variation")
    if values.ndim != 3 or values.shape[0] != len(times) or values.shape[2] != n_shape:
        raise ShapeError(f"variation: expected ({len(times)}, m, {n_shape}) at {len(times)} times, got {values.shape}")
    return values


def integral(function: Callable[[Array], tuple[Array, Array]], edges: Array, tolerance: float) -> Array:
    """The integral of a function smooth between edges, by Gauss on ever shorter panels.

    The function returns its values (N, m, 3), and the magnitude of what they are differences of (N,): the tolerance is
    relative to the integral of that. Between edges it must not swing often (`panel_edges`): two coarse rules that are
    both blind for a swing would agree.
    """
    nodes, weights_of_panel = _GAUSS_RULE
    last, change, goal = None, np.inf, 0.0
    for pieces in _PIECES:
        panels = evenly_divided(edges, pieces)
        half = 0.5 * np.diff(panels)
        times = panels[:-1, None] + half[:, None] * (nodes + 1.0)
        weights = (half[:, None] * weights_of_panel).ravel()
        values, scales = function(times.ravel())
        total = np.einsum("n,nma->ma", weights, values)
        goal = tolerance * float(weights @ scales)
        if last is not None:
            change = float(np.abs(total - last).max(initial=0.0))
        # Halving sixteen-point panels gains many digits: the change is the error of the coarser ones.
        if change <= goal or goal == 0.0:
            return total
        last = total
    raise AccuracyNotReached(
        f"the integral along the path still changes by {change:.3g} rad where {goal:.3g} is needed; declare the "
        "times where the variation jumps as breaks of the path, or loosen the tolerance"
    )
