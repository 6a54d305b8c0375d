"""Integrals along extremals of a surface of revolution in their phase, see `surface_of_revolution`.

The integrands are smooth in the phase. They may change fast next to the equator, where D has singularities at negative
Y, and next to the turning point, beyond which it has others. Panels of the Gauss-Legendre rule are graded
geometrically towards both, so that the error is that of one panel, however near a singularity is. Next to the turning
point the complement of the phase is the variable, so that the cosine of the phase keeps its digits.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...arrays import Array, Mask

Triple = tuple[Array, Array, Array]
Stretch = Callable[[Array, Array], Triple]  # Y and depth - Y, (N,) each -> D(Y), D'(Y), D''(Y), (N,) each

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)  # rounding, on panels as long as their distance to a pole


class Arcs(NamedTuple):
    """Integrals from the equator to a phase, any shape. Made by `SurfaceOfRevolution.arcs`."""

    time: Array
    """Arc length."""
    longitude: Array
    """theta [rad]."""
    bend: Array
    """2 integral D'(Y) sin^2(chi) d chi, its end value gives the derivatives by Clairaut's constant."""


def quadrature(
    stretch: Stretch, depth: float, end: str, q: Array, room: Array, chi: Array, splits: int
) -> tuple[Array, Array, Array, Array]:
    """Integrals from 0 to chi of D, D/(1 - Y), 2 D' sin^2 and 2 D'' sin^4: (N,) x 3 -> (N,) x 4.

    With chi in [-pi/2, pi/2], Y = q sin^2(chi), `room` = depth - q. If the reach is a pole the second is of
    (D(Y) - D(1))/(1 - Y); the integral of the rest is elementary.
    """
    pole = stretch(np.ones(1), np.zeros(1)) if end == "pole" else None
    angles = np.abs(chi)
    total = np.zeros((4, angles.size))

    def add(active: Mask, start: Array, stop: Array, from_turning: bool) -> None:
        half = 0.5 * (stop - start)
        angle = 0.5 * (stop + start)[:, None] + half[:, None] * _NODES
        near, far = np.sin(angle) ** 2, np.cos(angle) ** 2
        sine2, cosine2 = (far, near) if from_turning else (near, far)
        rows = _integrands(stretch, depth, pole, q[active, None], room[active, None], sine2, cosine2)
        total[:, active] += (rows @ _WEIGHTS) * half

    quarter = np.pi / 4.0
    equator_levels = 2 * (splits - 1)
    edges = _divided(quarter * 0.5 ** np.arange(equator_levels, -1, -1.0), splits)
    for low, high in pairwise(edges.tolist()):
        active = angles > low
        if active.any():
            start = np.full(int(active.sum()), low)
            add(active, start, np.minimum(angles[active], high), from_turning=False)
    levels = np.full(angles.shape, equator_levels)
    if end != "pole":
        width = np.sqrt(np.maximum(room, 1e-30) / np.maximum(q, 1e-30))
        levels = np.maximum(levels, np.ceil(np.log2(quarter / np.minimum(width, quarter))).astype(int) + 1)
    remaining = np.maximum(0.5 * np.pi - angles, 0.0)
    for level in range(int(levels.max()) + 1):
        last = levels == level
        top = quarter * 0.5**level
        bottom = np.where(last, 0.0, 0.5 * top)
        for part in range(splits):
            upper = top - (top - bottom) * (part / splits)
            lower = top - (top - bottom) * ((part + 1) / splits)
            active = (levels >= level) & (remaining < upper)
            if active.any():
                add(active, np.maximum(lower, remaining)[active], upper[active], from_turning=True)
    time, angle, bend, bend_rate = np.copysign(1.0, chi) * total
    return time, angle, bend, bend_rate


def graded_rule(splits: int) -> tuple[Array, Array]:
    """Nodes and weights (M,) on [0, 1], graded towards 0, as fine as those of `quadrature` with these splits."""
    edges = _divided(0.5 ** np.arange(2 * splits - 1, -1, -1.0), splits)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + _NODES)).ravel(), (half * _WEIGHTS).ravel()


def folded_cosine(angle: Array) -> Array:
    """cos in [-pi/2, pi/2], exactly 0 at the rounded ends, which stand for turning points."""
    return np.where(np.abs(angle) >= 0.5 * np.pi, 0.0, np.cos(angle))


def settled_splits(stretch: Stretch, depth: float, end: str) -> int | None:
    """The least number of parts of each panel at which the integrals have converged; None if there is none."""
    q = depth * 0.5 * (1.0 + _NODES[::3])
    # Rounding of integrals of D, and of its derivatives, which may come from a table of D.
    rounding = np.array([2e-13, 2e-13, 2e-12, 1e-8])
    before = np.full((4, q.size), np.inf)
    for splits in range(1, 8):
        integrals = np.stack(quadrature(stretch, depth, end, q, depth - q, np.full(q.shape, 0.5 * np.pi), splits))
        change = np.abs(integrals - before) / (np.abs(integrals) + np.abs(integrals[0]))
        if np.all(change.max(axis=1) <= rounding):
            return splits - 1
        before = integrals
    return None


def _integrands(
    stretch: Stretch, depth: float, pole: Triple | None, q: Array, room: Array, sine2: Array, cosine2: Array
) -> Array:
    square, rest = q * sine2, room + q * cosine2
    value, slope, second = (a.reshape(square.shape) for a in stretch(square.ravel(), rest.ravel()))
    if pole is None:
        angle = value / ((1.0 - depth) + rest)
    else:
        # Nearer than 1e-4 the difference D(Y) - D(1) loses four digits, and the series by D' and D'' is right to
        # rounding; where D bends sharply at the pole it holds less far, to 1 - Y = 0.005 |D'/D''|.
        bending = 0.02 * abs(float(pole[2][0])) / max(abs(float(pole[1][0])), np.finfo(float).tiny)
        near = rest * max(1.0, bending) < 1e-4
        # Less the mean of D' from here to the pole, by the trapezoidal rule corrected at both ends.
        mean = 0.5 * (slope + pole[1]) + rest / 12.0 * (second - pole[2])
        angle = np.where(near, -mean, (value - pole[0]) / np.where(near, 1.0, rest))
    return np.stack([value, angle, 2.0 * slope * sine2, 2.0 * second * sine2 * sine2])


def _divided(edges: Array, splits: int) -> Array:
    """0 and ascending edges, with every interval between them in equal parts."""
    whole = np.concatenate([[0.0], edges])
    parts = whole[:-1, None] + np.diff(whole)[:, None] * (np.arange(splits) / splits)
    return np.append(parts.ravel(), whole[-1])
