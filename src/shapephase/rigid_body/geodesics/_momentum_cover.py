"""Cells of momenta of unit speed, and bounds of how far geodesics of one cell part.

With momenta n = Pi/sigma in units sigma, a cell is a rectangle in the azimuth and the latitude of n, or in the azimuth
and the height where the third direction is forbidden. From its centre's geodesic R_c to another one of the cell, whose
momentum differs by q, the deviation is R = k exp(V) R_c, in inertial axes, with

    |V − Z q| <= C |q|²,   angle(k) <= W² |q|²/4,   W = alpha int K ds,   C = alpha int m ds,

Z the exact derivative of the exponential map at the centre, K and m bounds of the first and of the second derivative of
the flow of the momentum. They hold for all pairs of momenta of an ancestor of the cell in a coarse grid, and solve
integral inequalities along the ancestor's centre with its exact transition matrices.

Nothing is rounded outwards; the bounds are relaxed by more than rounding errors add up to instead.

Sources: docs/theory/geodesics.md.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from ...arrays import Array, Integers, Mask
from ._momentum_flow import differences, momentum_flow

_CUBIC = 2.0 / np.sqrt(3.0)  # largest value of the symmetric form of 6 x y z on three unit vectors
_STEP_GROWTH = 0.15  # growth of deviations over a step of the tables: their bounds grow by twice that between nodes
_LEAST_STEPS, _MOST_STEPS = 8, 48  # of the tables
_AZIMUTHS, _COARSE = 12, 0.27  # cells of half a turn, and height of a cell, of the first grid: it is halved as needed
_LOOSE = 10.0  # times the centre's derivative, up to which the bound of the derivative over a cell is good enough
_BLOCK = 2000  # cells at once, for the memory
TABLE_COST = 16  # evaluations of an attitude that a row of the tables takes
SLACK = 1e-11  # relative: of deviations and lengths, above what thousands of rounding errors add up to


@dataclass(frozen=True, eq=False)
class Cells:
    """N cells, columns of one length."""

    azimuth: Array
    height: Array
    half_azimuth: Array
    half_height: Array
    time: Array
    """No geodesic of the cell arrives before."""
    ancestor: Integers
    """Row of the tables."""

    def __getitem__(self, rows: object) -> Self:
        return replace(self, **{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    def __len__(self) -> int:
        return len(self.time)

    def joined(self, other: Self) -> Self:
        """All cells of both."""
        columns = {f.name: np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)}
        return replace(self, **columns)

    def halved(self, across: Mask) -> Self:
        """Two halves of each, cut across the azimuth where `across` holds, else across the height."""
        wide, high = np.where(across, 0.5, 1.0) * self.half_azimuth, np.where(across, 1.0, 0.5) * self.half_height
        to_side, up = self.half_azimuth - wide, self.half_height - high
        halves = [
            replace(
                self,
                azimuth=self.azimuth + s * to_side,
                height=self.height + s * up,
                half_azimuth=wide,
                half_height=high,
            )
            for s in (-1.0, 1.0)
        ]
        return halves[0].joined(halves[1])


@dataclass(frozen=True, eq=False)
class MomentumCover:
    """Momenta of unit speed of a metric in principal axes, and bounds of their flow up to a time."""

    inverse_moments: Array
    """(3,) descending."""
    units: Array
    """(3,) sigma."""
    duration: float

    @property
    def forbidden(self) -> bool:
        return self.inverse_moments[2] == 0.0

    @property
    def elongation(self) -> float:
        """Largest third component of n, sqrt(I_3)/sigma_3; 1 for a height in place of a latitude."""
        return 1.0 if self.forbidden else float(1.0 / np.sqrt(self.inverse_moments[2]) / self.units[2])

    def chart(self, azimuth: Array, height: Array) -> tuple[Array, Array, Array]:
        """n and its derivatives by azimuth and height, each (N, 3)."""
        sine, cosine = np.sin(azimuth), np.cos(azimuth)
        if self.forbidden:
            radius, slope, third, rise = np.ones_like(height), np.zeros_like(height), height, np.ones_like(height)
        else:
            radius, slope = np.cos(height), -np.sin(height)
            third, rise = -self.elongation * slope, self.elongation * radius
        zero = np.zeros_like(height)
        return (
            np.stack([radius * cosine, radius * sine, third], axis=-1),
            np.stack([-radius * sine, radius * cosine, zero], axis=-1),
            np.stack([slope * cosine, slope * sine, rise], axis=-1),
        )

    def bend(self, cells: Cells) -> Array:
        """Largest difference of n from its linear part over a cell."""
        wide, high = cells.half_azimuth, cells.half_height
        return 0.5 * (wide**2 if self.forbidden else wide**2 + 2.0 * wide * high + self.elongation * high**2)

    def radius(self, cells: Cells) -> Array:
        """Largest |n − n_c| over a cell."""
        _, wide, high = self.chart(cells.azimuth, cells.height)
        sides = cells.half_azimuth[:, None] * wide, cells.half_height[:, None] * high
        return half_diagonal(*sides) + self.bend(cells)

    def widths(self, cells: Cells) -> tuple[Array, Array]:
        """Half of the extent of n along azimuth and height: (N,) twice."""
        _, wide, high = self.chart(cells.azimuth, cells.height)
        return cells.half_azimuth * np.linalg.norm(wide, axis=-1), cells.half_height * np.linalg.norm(high, axis=-1)

    def couplings(self) -> Array:
        """kappa with n_i' = kappa_i n_j n_k: (3,)."""
        first, second, third = self.units
        return differences(self.inverse_moments) * np.array(
            [second * third / first, third * first / second, first * second / third]
        )

    def growth_rate(self, third: Array) -> Array:
        """Largest rate at which deviations of n grow along orbits that begin with |n_3| up to this: (N,) -> (N,).

        |n_1| and |n_2| are at most 1, and Pi_3² + (a_1 − a_2)/(a_1 − a_3) Pi_2² is constant.
        """
        a, couplings = self.inverse_moments, self.couplings()
        share = (a[0] - a[1]) / (a[0] - a[2]) * (self.units[1] / self.units[2]) ** 2 if a[0] > a[2] else 0.0
        first, second, about = (np.roll(couplings, -1) + np.roll(couplings, -2)) ** 2
        # A symmetric matrix without diagonal: its eigenvalues add up to 0.
        return np.sqrt((max(first, second) + about * (third**2 + share)) / 3.0)


@dataclass(frozen=True, eq=False)
class FlowBounds:
    """Bounds for all pairs of momenta of a cell, for M cells of a coarse grid at S + 1 equal times from 0."""

    step: float
    alpha: float
    """Largest angular velocity of a unit of n."""
    growth: Array
    """(M, S + 1) W, the angle by which attitudes deviate, per |q|."""
    bend: Array
    """(M, S + 1) C, per |q|²."""
    rate: Array
    """(M, S + 1) alpha K, the derivative of `growth`, from each node to the next."""
    closed: Mask
    """(M,) True where the bounds are near the centre's own values."""

    def at(self, rows: Integers, times: Array) -> tuple[Array, Array]:
        """`growth` and `bend` at the next node after each time."""
        node = np.minimum(np.ceil(times / self.step * (1.0 - SLACK)).astype(np.int64), self.growth.shape[1] - 1)
        return self.growth[rows, node], self.bend[rows, node]

    def momentum_growth(self, rows: Integers, times: Array) -> Array:
        """K at each time, by which momenta n deviate per |q|."""
        node = np.minimum((times / self.step * (1.0 + SLACK)).astype(np.int64), self.growth.shape[1] - 1)
        return self.rate[rows, node] / self.alpha


def flow_bounds(cover: MomentumCover, cells: Cells, count: int) -> FlowBounds:
    """Solve the integral inequalities for the deviations, node by node, in `count` steps.

    Between nodes deviations grow by the factor `between` at most.
    """
    a, couplings = cover.inverse_moments, cover.couplings()
    start, _, _ = cover.chart(cells.azimuth, cells.height)
    radius = cover.radius(cells)
    high = np.abs(start[:, 2]) + radius
    step = cover.duration / count
    between = np.exp(cover.growth_rate(high) * step)
    largest = np.abs(couplings).max()
    linear, square = _CUBIC * largest, 0.5 * _CUBIC * largest
    size = len(cells)
    # Over the cell: |q| of its widest pair, |q| of any pair per |q(0)|, and the rest of second order per |q(0)|².
    tube, first, second = np.empty((size, count + 1)), np.ones((size, count + 1)), np.zeros((size, count + 1))
    growth, bend = np.zeros((size, count + 1)), np.zeros((size, count + 1))
    tube[:, 0] = radius
    momentum, matrices = start * cover.units, np.broadcast_to(np.eye(3), (size, 1, 3, 3))
    scale = cover.units / cover.units[:, None]
    alpha, centre = float((a * cover.units).max()), np.ones(size)
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(1, count + 1):
            momentum, jacobian = momentum_flow(a, momentum, np.full(size, step))
            new = (jacobian * scale)[:, None] @ matrices
            matrices = np.concatenate([new, np.broadcast_to(np.eye(3), (size, 1, 3, 3))], axis=1)
            norms = _norms(matrices)
            centre = norms[:, 0]
            # From the end of each earlier step, with the greatest values in it.
            reach = norms[:, 1:] * (between * step)[:, None]
            widest, any_pair, rest = (between[:, None] * values[:, :k] for values in (tube, first, second))
            tube[:, k] = centre * radius + square * np.sum(reach * widest**2, axis=-1)
            first[:, k] = centre + linear * np.sum(reach * widest * any_pair, axis=-1)
            # Within a step the rest grows from its value at the start of it.
            rest += (between * step * square)[:, None] * any_pair**2
            second[:, k] = np.sum(reach * (linear * widest * rest + square * any_pair**2), axis=-1)
            growth[:, k] = growth[:, k - 1] + alpha * any_pair[:, -1] * step
            bend[:, k] = bend[:, k - 1] + alpha * rest[:, -1] * step
        closed = first[:, -1] < _LOOSE * centre
        rate = alpha * between[:, None] * first
    return FlowBounds(step=step, alpha=alpha, growth=growth, bend=bend, rate=rate, closed=closed)


def _norms(matrices: Array) -> Array:
    """Bounds of the largest singular values, at most 7 % above them: (..., 3, 3) -> (...)."""
    square = np.swapaxes(matrices, -1, -2) @ matrices
    fourth = square @ square
    return np.sqrt(np.sqrt(np.sqrt(np.linalg.norm(fourth @ fourth, axis=(-2, -1)))))


def half_diagonal(first: Array, second: Array) -> Array:
    """Largest length of the combinations of two vectors with factors up to 1 in size."""
    return np.maximum(np.linalg.norm(first + second, axis=-1), np.linalg.norm(first - second, axis=-1))


def coarse_cells(cover: MomentumCover, highest: float, most: int) -> tuple[Cells, FlowBounds, int]:
    """Cells that cover all momenta with |Pi_3| up to `highest`, fine enough for `FlowBounds`, and the rows computed.

    The tables are those of a quarter: half turns about the principal axes give the rest. No cells are returned if they
    would need more than `most` rows.
    """
    if cover.forbidden:
        top = start = highest / cover.units[2]
    else:
        top = float(np.arcsin(min(1.0, highest * np.sqrt(cover.inverse_moments[2]))))
        start = cover.elongation
    fastest = float(cover.growth_rate(np.array([start]))[0])
    count = int(np.clip(np.ceil(fastest * cover.duration / _STEP_GROWTH), _LEAST_STEPS, _MOST_STEPS))
    rows = int(np.ceil(top * cover.elongation / _COARSE))
    half_azimuth, half_height = 0.5 * np.pi / _AZIMUTHS, 0.5 * top / rows
    azimuth, height = np.meshgrid(
        half_azimuth * (2 * np.arange(_AZIMUTHS) + 1), half_height * (2 * np.arange(rows) + 1)
    )
    every = np.ones(azimuth.size)
    open_cells = Cells(
        azimuth=np.asarray(azimuth.ravel(), dtype=float),
        height=np.asarray(height.ravel(), dtype=float),
        half_azimuth=half_azimuth * every,
        half_height=half_height * every,
        time=0.0 * every,
        ancestor=np.zeros(azimuth.size, dtype=np.int64),
    )
    cells, tables, computed = open_cells[:0], [], 0
    while True:
        block, open_cells = open_cells[:_BLOCK], open_cells[_BLOCK:]
        computed += len(block)
        bounds = flow_bounds(cover, block, count)
        cells = cells.joined(block[bounds.closed])
        tables.append([table[bounds.closed] for table in (bounds.growth, bounds.bend, bounds.rate)])
        loose = block[~bounds.closed]
        wide, high = cover.widths(loose)
        open_cells = open_cells.joined(loose.halved(wide > high))
        if not len(open_cells) or computed > most:
            break
    if len(open_cells):
        cells = cells[:0]
    growth, bend, rate = (np.concatenate(columns) for columns in zip(*tables, strict=True))
    bounds = replace(bounds, growth=growth, bend=bend, rate=rate, closed=np.ones(len(growth), dtype=bool))
    cells = replace(cells, ancestor=np.arange(len(cells)))
    cells = cells.joined(replace(cells, azimuth=cells.azimuth + np.pi))
    cells = cells.joined(replace(cells, azimuth=-cells.azimuth, height=-cells.height))
    return cells, bounds, computed
