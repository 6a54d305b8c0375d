"""Search for a time before which no geodesic from the identity arrives at an attitude.

All momenta of unit speed are covered by cells (`MomentumCover`). A curve of length L that begins where a cell's
geodesics are at t and ends at the attitude has, for any covector m of dual length 1, m.(xi − y) <= L + terms of second
order, xi the rotation vector from the centre's end to the attitude and y that to another geodesic of the cell. With m
the momentum at t the linear part of y drops out, by Gauss's lemma, so that a cell need not be as small as the length
that is missing. Far from the attitude L is at least sqrt(I_1) times the angle. None of the cell arrives before t + L:
cells go forward by L, and are halved where L is much less than for the centre alone.

Momenta with |Pi_3| beyond `largest_axial` are left out: loops round their third axis are short enough to make them
longer than other ways.

Sources: docs/theory/geodesics.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ... import so3
from ...arrays import Array, Mask
from ._momentum_cover import (
    SLACK,
    TABLE_COST,
    Cells,
    FlowBounds,
    MomentumCover,
    coarse_cells,
    flow_bounds,
    half_diagonal,
)
from ._momentum_flow import exponential_fields, momentum_flow, quaternion_flow

NEAR = 1.0  # [rad] up to which |J(theta)^-1 − 1| <= 0.51 theta, J the left or right derivative of the rotation vector
_JACOBIAN = 0.51
_LOGARITHM = 1.05  # (theta/2)/sin(theta/2) at most
_WORTH = 0.5  # of the centre's own bound: a cell whose bound is below is halved
_NO_LENGTH = 1e-100  # dual length of a covector along a forbidden direction, whose square still is a number
_BLOCK = 2000  # cells at once, those of the earliest times


@dataclass(frozen=True, eq=False)
class Goal:
    """An attitude in principal axes, or a unit quaternion that differs from its negative."""

    quat: Array
    """(4,) xyzw."""
    on_su2: bool

    def errors(self, quats: Array) -> Array:
        """Rotation vectors from these to the goal, up to pi long, or 2 pi: (N, 4) -> (N, 3)."""
        error = so3.quat_product(so3.quat_inverse(quats), np.broadcast_to(self.quat, quats.shape))
        error = error if self.on_su2 else so3.positive_scalar(error)
        sine = np.linalg.norm(error[:, :3], axis=-1)
        small = sine < np.sqrt(np.finfo(float).tiny)
        scale = np.where(small, 2.0, 2.0 * np.arctan2(sine, error[:, 3]) / np.where(small, 1.0, sine))
        vectors = error[:, :3] * scale[:, None]
        # The negative of the goal is a whole turn away, about any axis.
        vectors[small & (error[:, 3] < 0.0), 2] = 2.0 * np.pi
        return vectors

    @property
    def vector(self) -> Array:
        """(3,) rotation vector from the identity."""
        return self.errors(np.array([[0.0, 0.0, 0.0, 1.0]]))[0]

    def on_axes(self, order: list[int]) -> Array:
        """The quaternion with its axes in this cyclic order: (4,)."""
        return self.quat[[*order, 3]]


@dataclass(frozen=True, eq=False)
class KnownArrival:
    """A geodesic that arrives at the goal at a time, and no other one of the momenta near its own shortly before."""

    n: Array
    """(3,) its momentum in units of the cover."""
    radius: float
    """Radius of the ball of momenta n."""
    before: float
    """Time before the arrival up to which no other arrives."""


@dataclass(frozen=True, eq=False)
class Search:
    """Result of `first_arrival`."""

    time: float
    """No geodesic arrives before."""
    work: int
    """Evaluated cells, rows of tables counted `TABLE_COST` times."""


@dataclass(frozen=True, eq=False)
class Progress:
    """Bounds for N cells at their times."""

    length: Array
    """(N,) below which no curve from any of the cell's geodesics comes to the attitude."""
    at_centre: Array
    """(N,) the bound of the centre's geodesic alone."""
    across: Mask
    """(N,) True where halving the azimuth makes the deviation smaller."""


@dataclass(frozen=True, eq=False)
class CellEnds:
    """Where the geodesics of N cells are at their times, relative to those of the centres."""

    quats: Array
    """(N, 4) attitudes of the centres' geodesics."""
    momentum: Array
    """(N, 3) theirs, in body axes."""
    fields: Array
    """(N, 3, 3) derivatives by n of the rotation vectors from there, in body axes."""
    sides: list[Array]
    """Two (N, 3): `fields` times half of the azimuth and of the height."""
    radius: Array
    """(N,) of the cells."""
    bend: Array
    """(N,) parts of n that are not linear in azimuth and height."""
    angle: Array
    """(N,) of the rotation vectors, at most."""
    curving: Array
    turned: Array
    """(N,) `curving` and `turned`: rest per |q|², from the momentum's flow and from turns that do not commute."""
    slack: Array
    """(N,) above the rounding errors of an angle."""

    @property
    def rest(self) -> Array:
        """(N,) length of what the rotation vectors have beside their linear part, up to 1 rad."""
        return (self.curving + self.turned) * self.radius**2 + self.slack


def cell_ends(cover: MomentumCover, bounds: FlowBounds, cells: Cells) -> CellEnds:
    """Ends of geodesics at each cell's time."""
    a = cover.inverse_moments
    n, wide, high = cover.chart(cells.azimuth, cells.height)
    start = n * cover.units
    quats = quaternion_flow(a, start, cells.time)
    attitude = so3.matrix_from_quat(quats)
    slope = momentum_flow(a, start, cells.time)[1]
    fields = so3.transpose(attitude) @ exponential_fields(a, start, cells.time, attitude, slope) * cover.units
    radius = cover.radius(cells)
    growth, curving = bounds.at(cells.ancestor, cells.time)
    return CellEnds(
        quats=quats,
        momentum=so3.apply(so3.transpose(attitude), start),
        fields=fields,
        sides=[
            half[:, None] * so3.apply(fields, side)
            for half, side in ((cells.half_azimuth, wide), (cells.half_height, high))
        ],
        radius=radius,
        bend=cover.bend(cells),
        angle=growth * radius,
        curving=curving,
        turned=0.25 * _LOGARITHM * growth**2,
        slack=SLACK * (1.0 + cells.time),
    )


def progress(cover: MomentumCover, bounds: FlowBounds, cells: Cells, goal: Goal) -> Progress:
    """How far the cells' geodesics still are from the goal."""
    a, ends = cover.inverse_moments, cell_ends(cover, bounds, cells)
    sides, bend, rest, second = ends.sides, ends.bend, ends.rest, ends.curving + ends.turned
    xi = goal.errors(ends.quats)
    angle = np.linalg.norm(xi, axis=-1)
    straight = half_diagonal(*sides) + np.linalg.norm(ends.fields, axis=(-2, -1)) * bend + rest
    deviation = np.minimum(ends.angle, np.where(ends.angle < NEAR, straight, np.inf))
    shortest = 1.0 / np.sqrt(a[0])
    covectors = np.stack([ends.momentum, cover.units**2 * xi])
    covectors /= np.maximum(np.sqrt(np.sum(a * covectors**2, axis=-1, keepdims=True)), _NO_LENGTH)
    size = np.linalg.norm(covectors, axis=-1)
    moved = sum(np.abs(np.sum(covectors * side, axis=-1)) for side in sides)
    moved += np.linalg.norm(np.einsum("cni,nij->cnj", covectors, ends.fields), axis=-1) * bend + size * rest

    def length(deviation: Array, missing: Array) -> Array:
        """The greatest bound, for an angle and a missing part along each covector."""
        far = shortest * (angle - deviation)
        quadratic, factor = 0.5 * _JACOBIAN * size / shortest**2, 1.0 + _JACOBIAN * size * deviation / shortest
        missing = np.maximum(missing, 0.0)
        root = 2.0 * missing / (factor + np.sqrt(factor**2 + 4.0 * quadratic * missing))
        return np.maximum(far, np.minimum(shortest * (NEAR - deviation), root.max(axis=0)))

    along = np.sum(covectors * xi, axis=-1)
    ahead, at_centre = length(deviation, along - moved), length(np.zeros_like(angle), along)
    if cover.forbidden:
        # The momentum's part of the rest is horizontal but for the turn since.
        rest = (ends.curving * np.minimum(1.0, cells.time / shortest) + ends.turned) * ends.radius**2 + ends.slack
        upwards = np.abs(sides[0][:, 2]) + np.abs(sides[1][:, 2]) + rest
        upwards += np.linalg.norm(ends.fields[:, 2], axis=-1) * bend
        ahead = np.maximum(ahead, least_climb(a, np.abs(xi[:, 2]), upwards, deviation))
        at_centre = np.maximum(at_centre, least_climb(a, np.abs(xi[:, 2]), np.zeros_like(angle), np.zeros_like(angle)))
    effects = [
        np.linalg.norm(side, axis=-1) + second * ends.radius * width
        for side, width in zip(sides, cover.widths(cells), strict=True)
    ]
    return Progress(
        length=np.maximum(ahead, 0.0) * (1.0 - SLACK),
        at_centre=at_centre,
        across=effects[0] > effects[1],
    )


def least_climb(inverse_moments: Array, height: Array, upwards: Array, deviation: Array) -> Array:
    """Length of a curve that turns by `height` about the forbidden axis, less up to `upwards` at its start.

    Half a circle sweeps the greatest area; the other terms are of third order, or due to the start's deviation.
    """
    scale = np.sqrt(inverse_moments[0] * inverse_moments[1])
    missing = np.maximum(height - upwards, 0.0)
    longest = np.sqrt(2.0 * np.pi / scale * missing)
    best = np.zeros_like(height)
    for part in (0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.96):
        length = part * longest
        angle = np.sqrt(inverse_moments[0]) * length
        reach = deviation + angle
        swept = scale * length**2 / (2.0 * np.pi) + 0.5 * deviation * angle
        third = angle**2 * (0.125 * upwards + 0.025 * reach * angle + 0.047 * reach**2)
        third += 0.085 * reach * angle * upwards
        best = np.where((swept + third < missing) & (reach < NEAR), length, best)
    return best


def largest_axial(inverse_moments: Array, before: float) -> float:
    """|Pi_3| above which no geodesic of unit speed is the shortest up to `before`.

    The second variation of the energy is negative for turns about axes 1 and 2 that make a loop in a time tau, in which
    the turn about axis 3 comes back by itself. Every tau up to `before` gives a bound; the least is taken.

    Source: docs/theory/geodesics.md.
    """
    first, second, third = inverse_moments
    tau = before * np.linspace(0.02, 1.0, 50)
    frequency, mean, ratio = 2.0 * np.pi / tau, np.sqrt(first * second), np.sqrt(first / second)
    drift = (first - second) / (2.0 * mean)  # largest rate of Pi_3
    height = 2.0 / np.pi * mean * tau
    about = first + third
    constant = (
        frequency**2
        + height * (2.0 * ratio * frequency + 8.0 / np.pi * drift * tau * about)
        + height**2 * (ratio**2 - 1.0)
        + third * (ratio - 1.0 / ratio) * drift
    )
    linear = frequency * abs(first * second - third * (first + second)) / mean - 4.0 / np.pi * height * about
    weights = first * (1.0 - third / second), second * (1.0 - third / first)
    square = third * (0.5 * sum(weights) + min(weights))
    # The positive root of square k² + linear k = constant.
    denominator = linear + np.sqrt(linear**2 + 4.0 * square * constant)
    least = np.where(denominator > 0.0, 2.0 * constant / np.where(denominator > 0.0, denominator, 1.0), np.inf)
    return float(np.min(least + drift * tau))


def momentum_cover(inverse_moments: Array, duration: float, highest: float) -> MomentumCover:
    """The cover with units that suit geodesics of this length."""
    with np.errstate(divide="ignore"):
        units = 1.0 / np.sqrt(inverse_moments)
    units[2] = min(units[2], highest, np.pi * units[0] * units[1] / duration)
    return MomentumCover(inverse_moments=inverse_moments, units=units, duration=duration)


def first_arrival(
    inverse_moments: Array, goal: Goal, begin: float, stop: float, most: int, known: Array | None = None
) -> Search:
    """A time up to `stop` before which no geodesic arrives, if none does before `begin`, a bound of the distance.

    `known` is the momentum of a geodesic of unit speed that arrives at `stop` and does not count.
    """
    highest = largest_axial(inverse_moments, begin)
    if not np.isfinite(highest) and inverse_moments[2] == 0.0:
        return Search(time=begin, work=0)
    cover = momentum_cover(inverse_moments, stop, highest)
    cells, bounds, rows = coarse_cells(cover, highest, most // TABLE_COST)
    work = rows * TABLE_COST
    if not len(cells):
        return Search(time=begin, work=work)
    arrival = _known_arrival(cover, known, bounds.growth.shape[1] - 1) if known is not None else None
    cells = replace(cells, time=np.full(len(cells), begin))
    while len(cells) and work < most:
        order = np.argsort(cells.time, kind="stable")
        block, cells = cells[order[:_BLOCK]], cells[order[_BLOCK:]]
        work += len(block)
        ahead = progress(cover, bounds, block, goal)
        block = replace(block, time=block.time + ahead.length)
        left = ~(block.time >= stop)
        if arrival is not None:
            n, _, _ = cover.chart(block.azimuth, block.height)
            inside = np.linalg.norm(n - arrival.n, axis=-1) + cover.radius(block) < arrival.radius
            left &= ~(inside & (block.time > stop - arrival.before))
        small = left & (ahead.length < _WORTH * ahead.at_centre)
        cells = cells.joined(block[left & ~small]).joined(block[small].halved(ahead.across[small]))
    return Search(time=float(min(stop, cells.time.min())) if len(cells) else stop, work=work)


def _known_arrival(cover: MomentumCover, momentum: Array, count: int) -> KnownArrival | None:
    """Uniqueness near a geodesic that arrives at the end of the cover's time; None where its end is nearly conjugate.

    Another one of momentum n + q that arrives earlier by eta needs Z q + O(q²) = eta u + O(eta²). Along the momentum
    that gives eta = O(q²), across it Z q = O(q²), with Z invertible: q = 0.
    """
    a, duration = cover.inverse_moments, cover.duration
    n = momentum / cover.units
    azimuth = np.arctan2(n[1], n[0])
    height = n[2] if cover.forbidden else np.arctan2(n[2] / cover.elongation, np.hypot(n[0], n[1]))
    half = 0.1
    while True:
        row, zero = np.ones(1), np.zeros(1, dtype=np.int64)
        cell = Cells(azimuth * row, height * row, half * row, half / cover.elongation * row, 0.0 * row, zero)
        bounds = flow_bounds(cover, cell, count)
        if bounds.closed[0]:
            break
        half *= 0.5
        if half < SLACK:
            return None
    quat = quaternion_flow(a, momentum[None], np.array([duration]))
    attitude = so3.matrix_from_quat(quat)
    slope = momentum_flow(a, momentum[None], np.array([duration]))[1]
    fields = exponential_fields(a, momentum[None], np.array([duration]), attitude, slope)[0] * cover.units
    singular = np.linalg.svd(fields, compute_uv=False)
    size, speed = float(np.linalg.norm(momentum)), float(np.sqrt(a[0]))
    # The way over eta has the rotation vector eta u but for `turning` eta².
    turning = 0.5 * a[0] * speed * size + 0.27 * a[0]
    before = min(0.5 / (size * turning), NEAR / speed)
    before = min(before, 0.5 * singular[2] / (float(bounds.rate[0].max()) + speed * singular[0]))
    curving = float(bounds.bend[0, -1] + 0.25 * _LOGARITHM * bounds.growth[0, -1] ** 2)
    early = duration + 2.0 * size * curving  # eta per |q|²
    across = 1.0 + speed * size
    radius = 0.5 * singular[2] / (0.5 * speed * duration + across * (curving + turning * before * early))
    radius = min(radius, float(cover.radius(cell)[0]), 1.0 / max(float(bounds.growth[0, -1]), SLACK))
    return KnownArrival(n=n, radius=radius, before=before)
