"""The curvature of the mechanical connection over regions of shape space, and the holonomies that it makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import tolerance_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_smooth
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..chebyshev import gauss_tableau
from ..errors import AccuracyNotReached, OpenPathError, ShapeError, SingularInertiaError, unknown_name
from ..inertia_tensor import inverse_inertia
from ..integrator.integrate import stepped_rotation
from ..integrator.sampling import Sampler
from ..letters import value_text
from .body_path import check_closed, one_shape, route_along
from .connection import connection_slopes
from .shape_path import CLOSED, ShapePath

_EPS = float(np.finfo(float).eps)
_SHAPES = 16  # random shapes: curvature that vanishes at all of them vanishes
_SEED = 15  # any fixed seed: repeatable results
_NO_LIMIT = 1e3  # [rad or m] wider limits stand for none
_ROUNDING = 16.0 * _EPS  # largest rounding of the curvature of 130 flat bodies
_NODES = 12  # Gauss nodes per piece of a ray: they resolve one swing of the curvature
_PIECES = [2**k for k in range(7)]  # of a ray, tried until the integral settles
_ROWS = 2000  # rays, or pieces of rays, computed together: bounds memory
_SHARE = 0.01  # of the tolerance for each ray: the sum over the path then keeps it


def is_flat(body: Body | ParticleBody | str, shapes: ArrayLike | None = None, tolerance: float = 1e-10) -> bool:
    """True where the curvature vanishes, so that small loops of the joints do not turn the body.

    Source: theory.md B6.

    Parameters
    ----------
    shapes : (..., n) to be examined [rad or m]; None: 16 random shapes, always the same, spread over the joint
        limits, and over a whole turn (or 2 pi m) where a joint has none
    tolerance : of each F_ij relative to |d_i A_j| + |d_j A_i| + |A_i| |A_j|, the terms that it is the difference of;
        beyond that only what rounding leaves of them is taken for zero: wheels too small to turn the body by a
        billionth of their own turn may count as no wheels

    Raises
    ------
    ShapeError
        If the last axis is not the body's n joints, there are no shapes, or the tolerance is not above 0.

    Examples
    --------
    >>> sp.is_flat(sp.load_body("cat_two_halves"))
    False
    """
    body = as_body_or_particles(body)
    goal = finite_array(tolerance, "tolerance")
    if goal.ndim or goal <= 0.0:
        raise ShapeError(f"tolerance: a number above 0 is needed, got {value_text(tolerance)}")
    places = _random_shapes(body) if shapes is None else finite_array(shapes, "shapes")
    if not places.size and body.n_shape:
        raise ShapeError(f"shapes: one shape or more is needed, got an array of shape {places.shape}")
    columns, slopes = connection_slopes(body, places)
    crossed = np.cross(columns[..., :, None, :], columns[..., None, :, :])
    defect = np.linalg.norm(slopes - np.swapaxes(slopes, -2, -3) - crossed, axis=-1)
    slope, norm = np.linalg.norm(slopes, axis=-1), np.linalg.norm(columns, axis=-1)
    terms = slope + np.swapaxes(slope, -1, -2) + norm[..., :, None] * norm[..., None, :]
    return bool(np.all(defect <= goal * terms + _rounding_of_slopes(body, places)))


def curvature_on_plane(
    body: Body | ParticleBody | str,
    joints: Sequence[str | int],
    first: ArrayLike,
    second: ArrayLike,
    shape: ArrayLike | None = None,
) -> Array:
    """Curvature F_ij over the plane of two joints.

    Source: theory.md B6; numerics.md section 4.

    Parameters
    ----------
    joints : the joints i and j, names or places in the shape vector
    first, second : (A,), (B,) coordinates of the two joints [rad or m]
    shape : (n,) where the other joints stand; None: neutral

    Returns
    -------
    (A, B, 3) base axes [rad per product of the two joints' units]; a small square of side e about a point of the plane,
        gone round from i to j, turns the body by exp(-e^2 F_ij)

    Raises
    ------
    UnknownNameError
        If a name is not one of the body's joints.
    ShapeError
        If the joints are not two different ones, or an array has the wrong shape.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> found = sp.curvature_on_plane(cat, ("waist_pitch", "waist_yaw"), [0.0, 0.1], [0.0])
    >>> print(found[0, 0].round(6))
    [1.75 0.   0.  ]
    """
    body = as_body_or_particles(body)
    i, j = _two_joints(body, joints)
    across, along = finite_array(first, "first"), finite_array(second, "second")
    for name, row in (("first", across), ("second", along)):
        if row.ndim != 1:
            raise ShapeError(f"{name}: a row of coordinates is needed, got shape {row.shape}")
    shapes = np.empty((len(across), len(along), body.n_shape))
    shapes[:] = body.shape() if shape is None else one_shape(body, shape, "shape")
    shapes[:, :, i], shapes[:, :, j] = across[:, None], along
    rows = shapes.reshape(-1, body.n_shape)
    unit = np.eye(body.n_shape)
    field, _, _ = curvature_along(body, rows, *(np.broadcast_to(unit[k], rows.shape) for k in (i, j)))
    return field.reshape(len(across), len(along), 3)


def stokes_holonomy(
    body: Body | ParticleBody | str, path: ShapePath | str, tolerance: float = 1e-9, centre: ArrayLike | None = None
) -> Array:
    """Holonomy of a loop from the curvature inside it, by the non-abelian theorem of Stokes.

    The loop is spanned by the cone of straight rays from a centre c to its shapes p(t). With T(x, t) the horizontal
    lift along the ray c + x (p(t) - c), from x = 0, the curvature carried to the centre,

        a(t) = integral from 0 to 1 of T(x, t) F(p - c, p') x dx,

    is the connection along the loop in the frame that the rays carry: G' = G hat(-a), and the loop turns the body by
    T(1, 0)^T G T(1, 0). No lift along the loop is used, so this is an independent check of `holonomy`.

    Along a ray lift and integral are found by Gauss collocation of 12 nodes on 1, 2, 4 ... pieces until halving
    changes them by less than a hundredth of the tolerance; a(t) is then sampled and its ordered exponential stepped
    by the integrator of `holonomy`, whose error estimate has to stay within the rest of the tolerance.

    Source: theory.md B6, B7.

    Parameters
    ----------
    path : a closed path; it may have corners, cross itself and pass through the centre
    tolerance : of the rotation, between 1e-13 and 1e-4 [rad]
    centre : (n,) the tip of the cone, joints in the body's order [rad or m]; None: the mean shape of the loop, whose
        cone stays within the limits of the joints if the loop does

    Returns
    -------
    (3, 3) as `holonomy`

    Raises
    ------
    OpenPathError
        If the path does not close, or a continuous joint ends whole turns from its start: no cone spans such a loop.
    SingularInertiaError
        If at the centre or at another shape of the cone all mass is on one line: there the connection is not defined.
    AccuracyNotReached
        If the tolerance cannot be met, as where the cone passes close to such a shape.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> print(np.abs(sp.stokes_holonomy(cat, loop) - sp.holonomy(cat, loop)).max().round(8))
    0.0
    """
    body, goal = as_body_or_particles(body), tolerance_argument(tolerance)
    route = route_along(body, path)
    if isinstance(body, Body):
        check_smooth(body.chain.follows, "the theorem of Stokes needs")
    check_closed(body, route)
    turned = np.flatnonzero(np.abs(route.gap) > CLOSED)
    if len(turned):
        joint = int(turned[0])
        raise OpenPathError(
            f"joint {body.joint_names[joint]} ends {route.gap[joint] / (2.0 * np.pi):.6g} turns from its start: no "
            "cone spans such a loop, whose holonomy is not made of curvature alone; use holonomy"
        )
    middles = np.arange(256) + 0.5
    times = route.duration / route.loops * middles / len(middles)
    tip = route.curve(times)[0].mean(axis=0) if centre is None else one_shape(body, centre, "centre")
    cone = _Cone(body, route, tip, goal)
    carried = Sampler(cone.sample, route.smoothness)
    round_loop = stepped_rotation(carried, np.zeros((1, 3)), 0.9 * goal)
    _, (out, back) = cone.rays(np.array([0.0, route.duration]))
    estimate = float(round_loop.error_estimate[0]) + 3.0 * cone.worst
    if estimate > goal:
        raise AccuracyNotReached(
            f"the tolerance {goal:.3g} rad was not reached: the estimate is {estimate:.3g} rad, of which the rays from "
            f"the centre {3.0 * cone.worst:.3g}; loosen the tolerance or choose a centre nearer to the loop"
        )
    return out.T @ round_loop.end[0] @ back


class _Cone:
    """The straight rays from a centre to a loop.

    worst : the largest change left when the pieces of a ray were halved, as a turn of the whole loop [rad]
    """

    def __init__(self, body: Body | ParticleBody, route: ShapePath, centre: Array, tolerance: float) -> None:
        self._body, self._route, self._centre, self._tolerance = body, route, centre, tolerance
        self.worst = 0.0
        try:
            inverse_inertia(body.locked_inertia(centre))
        except SingularInertiaError as error:
            raise SingularInertiaError(f"at the centre of the cone: {error}; or choose another centre") from None

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Locked inertia and internal momentum for the integrator: 1 and a(t)."""
        return np.broadcast_to(np.eye(3), (len(times), 3, 3)), self.rays(times)[0]

    def rays(self, times: Array) -> tuple[Array, Array]:
        """The curvature a(t) carried to the centre, and the lifts T(1, t) to the loop: (N,) -> (N, 3), (N, 3, 3)."""
        shapes, rates = self._route.curve(times)
        arms = shapes - self._centre
        parts = [slice(start, start + _ROWS) for start in range(0, len(times), _ROWS)]
        done = [self._refined(times[part], arms[part], rates[part]) for part in parts]
        densities, lifts = (np.concatenate(part) for part in zip(*done, strict=True))
        return densities, lifts

    def _refined(self, times: Array, arms: Array, rates: Array) -> tuple[Array, Array]:
        """Rays on ever more pieces, until each has settled."""
        densities, lifts, _ = self._on_pieces(1, times, arms, rates)
        rough, left = np.arange(len(times)), 0.0
        for pieces in _PIECES[1:]:
            block = max(1, _ROWS // pieces)
            blocks = [rough[k : k + block] for k in range(0, len(rough), block)]
            parts = [self._on_pieces(pieces, times[rows], arms[rows], rates[rows]) for rows in blocks]
            density, lift, scale = (np.concatenate(part) for part in zip(*parts, strict=True))
            change = self._route.duration * np.linalg.norm(density - densities[rough], axis=-1)
            change = np.maximum(change, np.abs(lift - lifts[rough]).max(axis=(-1, -2)))
            densities[rough], lifts[rough] = density, lift
            rounding = 8.0 * _EPS * (1.0 + self._route.duration * scale)
            good = change <= np.maximum(_SHARE * self._tolerance, rounding)
            self.worst = max(self.worst, float(change[good].max(initial=0.0)))
            if good.all():
                return densities, lifts
            rough, left = rough[~good], float(change[~good].max())
        raise AccuracyNotReached(
            f"the curvature along the ray from the centre to the shape at t = {times[rough[0]]:.9g} s still changes by "
            f"{left:.3g} rad where {_SHARE * self._tolerance:.3g} is needed; loosen the tolerance or "
            "choose another centre"
        )

    def _on_pieces(self, pieces: int, times: Array, arms: Array, rates: Array) -> tuple[Array, Array, Array]:
        """a(t), T(1, t), and the magnitude of the terms of a(t), with 12 nodes on each piece of the rays."""
        nodes, weights, integrals = gauss_tableau(_NODES)
        along = ((np.arange(pieces)[:, None] + nodes) / pieces).ravel()
        shapes = self._centre + along[:, None] * arms[:, None]
        directions, changes = np.broadcast_arrays(arms[:, None], rates[:, None] * along[:, None])
        flat = (len(times) * len(along), self._body.n_shape)
        places, outward, sideways = (part.reshape(flat) for part in (shapes, directions, changes))
        try:
            field, turning, scale = curvature_along(self._body, places, outward, sideways, np.repeat(times, len(along)))
        except SingularInertiaError as error:
            raise SingularInertiaError(
                f"on the ray from the centre to the shape of that time: {error}; or choose another centre"
            ) from None
        grid = (len(times), pieces, _NODES)
        spin = so3.hat(-turning.reshape(*grid, 3)) / pieces
        # Y = 1 + integral of Y hat(omega), for the transposes of Y at the nodes.
        system = np.einsum("ij,npjcb->npibjc", integrals, spin).reshape(len(times), pieces, 3 * _NODES, 3 * _NODES)
        solved = np.linalg.solve(np.eye(3 * _NODES) - system, np.tile(np.eye(3), (_NODES, 1)))
        inner = so3.transpose(solved.reshape(*grid, 3, 3))
        whole = np.eye(3) + np.einsum("j,npjab->npab", weights, inner @ spin)
        carried = so3.apply(inner, field.reshape(*grid, 3))
        by_piece = np.einsum("j,npja->npa", weights / pieces, carried)
        density, lift = np.zeros((len(times), 3)), np.broadcast_to(np.eye(3), (len(times), 3, 3))
        for piece in range(pieces):
            density += so3.apply(lift, by_piece[:, piece])
            lift = lift @ whole[:, piece]
        return density, lift, scale.reshape(len(times), -1).mean(axis=1)


def curvature_along(
    body: Body | ParticleBody, shapes: Array, first: Array, second: Array, times: Array | None = None
) -> tuple[Array, Array, Array]:
    """F(u, v) for two directions at each shape, A u, and the magnitude of the terms of F.

    (N, n) each -> (N, 3), (N, 3), (N,)
    """
    inertia, matrix, inertia_first, matrix_first = body.sample_rates(shapes, first)
    _, _, inertia_second, matrix_second = body.sample_rates(shapes, second)
    inverse = inverse_inertia(inertia, times)
    turn_first, turn_second = (so3.apply(inverse, so3.apply(matrix, v)) for v in (first, second))
    onward = so3.apply(inverse, so3.apply(matrix_first, second) - so3.apply(inertia_first, turn_second))
    sideways = so3.apply(inverse, so3.apply(matrix_second, first) - so3.apply(inertia_second, turn_first))
    bracket = np.cross(turn_first, turn_second)
    norms = np.linalg.norm(np.stack([onward, sideways, bracket]), axis=-1)
    return onward - sideways - bracket, turn_first, norms.sum(axis=0)


def _random_shapes(body: Body | ParticleBody) -> Array:
    lower, upper = body.joint_limits.T
    open_below, open_above = ~(lower > -_NO_LIMIT), ~(upper < _NO_LIMIT)
    least = np.where(open_below, np.where(open_above, -np.pi, upper - 2.0 * np.pi), lower)
    most = np.where(open_above, np.where(open_below, np.pi, lower + 2.0 * np.pi), upper)
    return np.random.default_rng(_SEED).uniform(least, most, (_SHAPES, body.n_shape))


def _rounding_of_slopes(body: Body | ParticleBody, shapes: Array) -> Array:
    """Bound of the rounding of the curvature: (..., n) -> (..., n, n).

    A joint motion of kinetic energy T_0 has an angular momentum of at most sqrt(2 T_0 I), I the largest moment, taken
    about the base origin where momenta are summed; rounding is relative to the connection that would give. A slide
    counts by the body's radius of gyration, and as if it moved all mass: what is the same for all of it cancels too.
    """
    sliding = np.array([unit == "m" for unit in body.joint_units], dtype=bool)
    moments = np.linalg.eigvalsh(body.locked_inertia(shapes))[..., [0, 2]]
    energies = body.kinetic_energy(shapes[..., None, :], np.eye(body.n_shape))
    energies = np.where(sliding, 0.5 * body.mass, np.maximum(energies, 0.0))
    about_origin = moments[..., 1:] + body.mass * np.square(body.centre_of_mass(shapes)).sum(axis=-1, keepdims=True)
    most = np.sqrt(2.0 * energies * about_origin) / moments[..., :1]
    length = np.where(sliding, np.sqrt(moments[..., 1:] / body.mass), 1.0)
    by_pair = most[..., None, :] / length[..., :, None]
    return _ROUNDING * (by_pair + np.swapaxes(by_pair, -1, -2))


def _two_joints(body: Body | ParticleBody, joints: Sequence[str | int]) -> tuple[int, int]:
    if isinstance(joints, str) or not isinstance(joints, Sequence | np.ndarray) or len(joints) != 2:
        raise ShapeError(f"joints: two joints of {body.name} are needed, got {value_text(joints)}")
    places = []
    for joint in joints:
        is_place = isinstance(joint, int | np.integer) and not isinstance(joint, bool) and 0 <= joint < body.n_shape
        if not is_place and not isinstance(joint, str):
            raise unknown_name(f"joint of {body.name}", str(joint), body.joint_names)
        places.append(body.joint_index(joint) if isinstance(joint, str) else int(joint))
    if places[0] == places[1]:
        raise ShapeError(f"joints: two different joints are needed, got {body.joint_names[places[0]]} twice")
    return places[0], places[1]
