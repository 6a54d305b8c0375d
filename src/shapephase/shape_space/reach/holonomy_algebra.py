"""Rotations that loops of the joints reach: the holonomy algebra, from the curvature and its covariant derivatives."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object, made_by, number_argument, whole_argument
from ...arrays import Array
from ...body.body import Body
from ...body.couplings.coordinate_map import check_smooth
from ...body.loading import as_body_or_particles
from ...body.particles.point_masses import ParticleBody
from ...display import frozen
from ...errors import ShapeError
from ..body_path import one_shape
from ..connection import connection_slopes, curvature, horizontal_lift
from ..shape_path import ShapePath
from .smallest_loops import AxisLoop, loops_of_second_order, loops_of_third_order

_NODES = 25  # Chebyshev points on a ray, the shape among them: they resolve six swings of the curvature
_HALF_WIDTH = 0.4  # [strokes] of those rays; rounding of the m-th derivative grows as (25/0.4)^m
_RAYS = 4  # random directions: derivatives are vectors in three dimensions, which three directions span
_FAR_SHAPES = 6  # random shapes at the ends of straight paths
_LOOKS = np.arange(1, 5) / 4  # places on those paths
_FAR = 0.6  # [strokes] largest distance of such a shape, in each joint
_SEED = 26  # any fixed seed: repeatable results
_LIFT_TOLERANCE = 1e-12  # [rad] of the lift that carries a curvature back


@frozen
class OrderReach:
    """Axes of the turns by loops small to some order of their stroke. Made by `reachable`.

    Attributes
    ----------
    order : in the stroke: 2 by the curvature, 3 by its first covariant derivatives, and so on
    rank : of all axes up to this order
    axes : (rank, 3) orthonormal, those of lower orders first, base axes
    singular_values : (3,) of what this order alone gives [rad per stroke^order]
    """

    order: int
    rank: int
    axes: Array
    singular_values: Array


@frozen
class PairTurn:
    """Turn of the body by a small loop of two joints. Made by `reachable`.

    Attributes
    ----------
    joints : their names
    rate : |F_ij| [rad per product of the joints' units]
    axis : (3,) of the turn of a loop that goes from the first joint to the second, base axes
    units : of the product, as "rad^2"
    """

    joints: tuple[str, str]
    rate: float
    axis: Array
    units: str

    @property
    def degrees(self) -> float:
        """Degrees per square radian, or per product of the joints' units."""
        return float(np.degrees(self.rate))


@made_by("reachable(body, shape)")
@frozen
class Reach:
    """The rotations that loops of the joints reach from a shape. Made by `reachable`.

    Attributes
    ----------
    name : of the body
    joint_names : of the body
    shape : (n,) where the loops begin [rad or m]
    strokes : (n,) what counts as a stroke of 1: a radian, and for what slides the body's radius of gyration [rad or m]
    rank : of the holonomy algebra: 0, 1 or 3
    singular_values : (3,) of the curvature at and around the shape, carried back to it [rad per square stroke], which
        `rank` counts
    noise : below which a singular value is taken for zero [rad per square stroke]
    orders : what is reached at each order of the stroke, up to the first at which `rank` is complete
    loops : for each axis the smallest loop that turns about it, of second or third order
    pairs : of joints, those that turn the body most first
    """

    name: str
    joint_names: tuple[str, ...]
    shape: Array
    strokes: Array
    rank: int
    singular_values: Array
    noise: float
    orders: tuple[OrderReach, ...]
    loops: tuple[AxisLoop, ...]
    pairs: tuple[PairTurn, ...]

    @property
    def gap(self) -> float:
        """The least singular value that counts over the largest that does not, or over the noise where that is more."""
        if not self.rank:
            return np.inf
        counted = self.singular_values[: self.rank]
        rest = self.singular_values[self.rank :].max(initial=0.0)
        return float(counted.min() / max(rest, self.noise))

    @property
    def is_complete(self) -> bool:
        """True if every rotation can be reached."""
        return self.rank == 3


def reachable(
    body: Body | ParticleBody | str, shape: ArrayLike | None = None, *, most_orders: int = 5, tolerance: float = 1e-8
) -> Reach:
    """Find the rotations that loops of the joints reach from a shape, the smallest such loops, and the best joints.

    Loops of a body without angular momentum turn it by the group whose algebra the curvature of the connection spans,
    taken at all shapes and carried back (Ambrose and Singer). At one shape its covariant derivatives

        D_k F_ij = d_k F_ij - A_k x F_ij

    and theirs span the same, as the connection is analytic (Chow): those of order m - 2 give the turns by loops at
    order m of their stroke. Both are computed: `rank` is that of the curvature around the shape, `orders` have the
    derivatives. Whole turns of a joint without end, as of a reaction wheel, may add to that and are not examined.

    Source: theory.md B6; Ambrose and Singer 1953; Shapere and Wilczek 1989; Montgomery 2002, chapter 12.

    Parameters
    ----------
    shape : (n,) where the loops begin [rad or m]; None: neutral
    most_orders : the highest order of the stroke, 2 to 6
    tolerance : of singular values, relative to the size of the terms that the curvature is a difference of

    Raises
    ------
    ShapeError
        If the shape is not one of the body, or `most_orders` or the tolerance is out of range.
    SingularInertiaError
        If at that shape or around it all mass is on one line.

    Examples
    --------
    >>> found = sp.reachable(sp.load_body("cat_two_halves"))
    >>> found.rank, found.pairs[0].joints
    (3, ('waist_pitch', 'waist_yaw'))
    """
    body = as_body_or_particles(body)
    if isinstance(body, Body):
        check_smooth(body.chain.follows, "derivatives of the curvature need")
    least = number_argument(tolerance, "tolerance")
    highest = whole_argument(most_orders, "most_orders", 2)
    if highest > 6 or not 0.0 < least < 1.0:
        raise ShapeError(
            f"most_orders and tolerance: 2 to 6, and a number between 0 and 1, are needed, got {highest} and {least:g}"
        )
    place = body.shape() if shape is None else one_shape(body, shape, "shape").copy()
    strokes = _strokes(body, place)
    field = _Field(body, place, strokes)
    noise = least * field.magnitude
    values = np.linalg.svd(_carried_curvature(field), full_matrices=False)[1]
    values = np.pad(values, (0, 3 - len(values)))
    # Two axes have a third for their bracket.
    rank = (0, 1, 3, 3)[int(np.sum(values > noise))]
    orders = _orders(field, rank, highest, noise)
    loops = loops_of_second_order(field.here, place, strokes, orders[0].axes, noise) if orders else ()
    if len(orders) > 1:
        new = orders[1].axes[orders[0].rank :]
        loops += loops_of_third_order(field.here, field.slopes, place, strokes, orders[0].axes, new)
    return Reach(
        name=body.name,
        joint_names=body.joint_names,
        shape=place,
        strokes=strokes,
        rank=rank,
        singular_values=values,
        noise=noise,
        orders=orders,
        loops=loops,
        pairs=_ranked_pairs(body, field.here, strokes),
    )


class _Field:
    """The curvature of a body around a shape, in strokes.

    here : (n, n, 3) F_ij at the shape
    slopes : (n, n, n, 3) D_k F_ij there, k first
    magnitude : of the terms that F is the difference of
    """

    def __init__(self, body: Body | ParticleBody, shape: Array, strokes: Array) -> None:
        self.body, self.shape, self.strokes = body, shape, strokes
        columns, slopes = connection_slopes(body, shape)
        norms = np.linalg.norm(columns, axis=-1) * strokes
        terms = 2.0 * np.linalg.norm(slopes, axis=-1) * np.outer(strokes, strokes) + np.outer(norms, norms)
        self.magnitude = float(terms.max(initial=0.0))
        self.here = self.at(shape[None])[0]
        count = len(shape)
        self.slopes = np.zeros((count, *self.here.shape))
        for k in range(count if count > 1 else 0):
            self.slopes[k] = self.derivatives(np.eye(count)[k], 1)[0]

    def at(self, shapes: Array) -> Array:
        """F at other shapes: (N, n) -> (N, n, n, 3)."""
        return curvature(self.body, shapes) * np.outer(self.strokes, self.strokes)[..., None]

    def derivatives(self, direction: Array, count: int) -> list[Array]:
        """D_v F, D_v D_v F, ... at the shape: `count` of (n, n, 3), by differentiation on Chebyshev points."""
        angles = np.pi * np.arange(_NODES) / (_NODES - 1)
        points, matrix = np.cos(angles), _differentiation(angles) / _HALF_WIDTH
        shapes = self.shape + np.outer(_HALF_WIDTH * points, direction * self.strokes)
        field = self.at(shapes)
        turning = np.einsum("pka,k->pa", connection_slopes(self.body, shapes)[0], direction * self.strokes)
        slopes = []
        for _ in range(count):
            field = np.einsum("pq,q...->p...", matrix, field) - np.cross(turning[:, None, None], field)
            slopes.append(field[_NODES // 2])
        return slopes


def _differentiation(angles: Array) -> Array:
    """The matrix that differentiates at the Chebyshev points cos(angles) (Trefethen 2000, chapter 6).

    Differences of the points by products of sines, and each row sums to zero, so that rounding stays small.
    """
    count = len(angles)
    signs = (-1.0) ** np.arange(count)
    signs[[0, -1]] *= 2.0
    half_sum, half_difference = (0.5 * (angles[:, None] + sign * angles) for sign in (1.0, -1.0))
    gaps = -2.0 * np.sin(half_sum) * np.sin(half_difference)
    matrix = np.outer(signs, 1.0 / signs) / np.where(gaps == 0.0, 1.0, gaps)
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix


def _strokes(body: Body | ParticleBody, shape: Array) -> Array:
    radius = float(np.sqrt(0.5 * np.trace(body.locked_inertia(shape)) / body.mass))
    return np.array([radius if unit == "m" else 1.0 for unit in body.joint_units])


def _pairs_of(field: Array) -> Array:
    """The values for i < j side by side: (..., n, n, 3) -> (3, K)."""
    first, second = np.triu_indices(field.shape[-2], 1)
    return field[..., first, second, :].reshape(-1, 3).T


def _carried_curvature(field: _Field) -> Array:
    """The curvature at the shape and at others around it, carried back along straight paths: (3, K)."""
    body, start = field.body, field.shape
    if body.n_shape < 2:
        return np.zeros((3, 1))
    random = np.random.default_rng(_SEED)
    ends = start + _FAR * field.strokes * random.uniform(-1.0, 1.0, (_FAR_SHAPES, body.n_shape))
    carried = carried_curvature(body, start, ends) * np.outer(field.strokes, field.strokes)[..., None]
    return np.concatenate([_pairs_of(field.here), *map(_pairs_of, carried)], axis=1)


def carried_curvature(body: Body | ParticleBody, start: Array, ends: Array) -> Array:
    """Curvature on straight paths from a shape to others, carried back along them: (n,), (N, n) -> (4 N, n, n, 3)."""
    check_object(body, "Body", "body", or_kind="ParticleBody")
    parts = []
    for end in ends:
        path = ShapePath.waypoints([0.0, 1.0], [start, end])
        turned = horizontal_lift(body, path, _LIFT_TOLERANCE).attitude(_LOOKS)
        parts.append(np.einsum("pab,pijb->pija", turned, curvature(body, path.shape(_LOOKS))))
    return np.concatenate(parts)


def _orders(field: _Field, rank: int, highest: int, noise: float) -> tuple[OrderReach, ...]:
    """Axes that each order adds, until all are reached."""
    if field.body.n_shape < 2:
        return ()
    random = np.random.default_rng(_SEED)
    rays = random.normal(size=(_RAYS, field.body.n_shape))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    along = [field.derivatives(ray, highest - 2) for ray in rays] if rank and highest > 3 else []
    spans: list[Array] = []
    orders: list[OrderReach] = []
    axes = np.zeros((0, 3))
    for order in range(2, highest + 1):
        if order == 2:
            own = _pairs_of(field.here)
        elif order == 3:
            own = _pairs_of(field.slopes)
        else:
            own = np.concatenate([_pairs_of(ray[order - 3]) for ray in along] or [np.zeros((3, 1))], axis=1)
        # Derivatives in another order of the joints differ by brackets with the curvature.
        brackets = [np.cross(a, b) for k in range(2, order - 1) for a in _basis(spans[k - 2], noise)
                    for b in _basis(spans[order - k - 2], noise)]  # fmt: skip
        spans.append(np.concatenate([own, *(np.array(one)[:, None] for one in brackets)], axis=1))
        axes = _extended(axes, spans[-1], noise)
        orders.append(
            OrderReach(
                order=order, rank=len(axes), axes=axes, singular_values=np.linalg.svd(own, full_matrices=False)[1][:3]
            )
        )
        if len(axes) >= rank:
            break
    return tuple(orders)


def _basis(span: Array, noise: float) -> Array:
    """Its left singular vectors times their singular values, where these are no noise: (k, 3)."""
    left, values, _ = np.linalg.svd(span, full_matrices=False)
    return (left * values).T[values > noise]


def _extended(axes: Array, span: Array, noise: float) -> Array:
    """The axes with those of a span that are new: (k, 3), (3, K) -> (k + new, 3)."""
    rest = span - axes.T @ (axes @ span)
    left, values, _ = np.linalg.svd(rest, full_matrices=False)
    return np.concatenate([axes, left.T[: len(values)][values > noise]])[:3]


def _ranked_pairs(body: Body | ParticleBody, here: Array, strokes: Array) -> tuple[PairTurn, ...]:
    pairs: list[tuple[float, PairTurn]] = []
    for i, j in combinations(range(body.n_shape), 2):
        turn = -here[i, j]
        size = float(np.linalg.norm(turn))
        axis = turn / size if size > 0.0 else np.zeros(3)
        units = sorted((body.joint_units[i], body.joint_units[j]), reverse=True)
        product = f"{units[0]}^2" if units[0] == units[1] else " ".join(units)
        joints = body.joint_names[i], body.joint_names[j]
        pair = PairTurn(joints=joints, rate=size / float(strokes[i] * strokes[j]), axis=axis + 0.0, units=product)
        pairs.append((size, pair))
    return tuple(pair for _, pair in sorted(pairs, key=lambda one: -one[0]))
