"""The panels of a path that is being resolved: their series, and the tree they make."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...arrays import Array, Integers, Mask
from ...chebyshev import inside
from ...integrator.resolved import DEGREE, ResolvedPath

# Samples of the whole path: with the jitter below no gap is above 1/4,000 of the duration.
_SAMPLES = 5200
# Of the distance of two samples: by this much they are moved, so that nothing periodic hides between them.
_JITTER = 0.28
# Of a piece between two breaks, however short.
_LEAST_SAMPLES = 12
# Of a panel, none of them a node: where it is checked when no samples are left in it.
CHECKS = np.array([0.0411, 0.2677, 0.5573, 0.8219])


@dataclass(frozen=True, eq=False)
class Panels:
    """Panels that are being resolved."""

    left: Array
    right: Array
    piece: Integers
    node: Integers  # their rows in the tree of the piece
    before: Array  # (P, 2 n) misfit of what they are halves of

    def of(self, rows: Mask | Integers) -> Panels:
        return Panels(self.left[rows], self.right[rows], self.piece[rows], self.node[rows], self.before[rows])


@dataclass(frozen=True, eq=False)
class Looked:
    """Panels at which was looked."""

    coefficients: Array  # (P, DEGREE + 1, 2 n)
    misfit: Array  # (P, 2 n) how far the path is from the series
    floor: Array  # (P, 2 n) how far rounding and noise may bring it
    noise: Array  # (P,) [rad], where it is noise


class Piece:
    """What is between two breaks: its samples, and the tree of its panels."""

    def __init__(self, left: float, right: float) -> None:
        self.left, self.right = left, right
        first, last = inside(np.array([left]), np.array([right]))
        self.first, self.last = float(first[0]), float(last[0])
        self.ends: list[tuple[float, float]] = []
        self.coefficients: list[Array] = []
        self.misfit: list[tuple[float, float]] = []
        self.noise: list[float] = []
        self.children: list[int] = []
        self.roots: list[int] = []
        self.kinks: list[float] = []

    def added(self, left: float, right: float) -> int:
        self.ends.append((left, right))
        self.misfit.append((0.0, 0.0))
        self.noise.append(0.0)
        self.children.append(-1)
        self.coefficients.append(np.zeros(0))
        return len(self.ends) - 1


def panels_of(rows: list[tuple[float, float, int, int]], before: Array) -> Panels:
    left, right, piece, node = zip(*rows, strict=True) if rows else ((), (), (), ())
    return Panels(
        np.array(left), np.array(right), np.array(piece, dtype=np.int64), np.array(node, dtype=np.int64), before
    )


def resolved_path(pieces: list[Piece], duration: float, defect: float) -> ResolvedPath:
    """The panels of all pieces, whose outermost ends are the breaks themselves."""
    shifts = np.cumsum([0, *(len(piece.ends) for piece in pieces)])
    ends = np.array([end for piece in pieces for end in piece.ends])
    for piece, shift in zip(pieces, shifts, strict=False):
        part = ends[shift : shift + len(piece.ends)]
        part[:, 0][part[:, 0] == piece.first] = piece.left
        part[:, 1][part[:, 1] == piece.last] = piece.right
    numbered = list(zip(pieces, shifts, strict=False))
    children = [row + shift if row >= 0 else -1 for piece, shift in numbered for row in piece.children]
    return ResolvedPath(
        left=ends[:, 0],
        right=ends[:, 1],
        coefficients=np.stack([series for piece in pieces for series in piece.coefficients]),
        misfit=np.array([misfit for piece in pieces for misfit in piece.misfit]),
        noise=np.array([noise for piece in pieces for noise in piece.noise]),
        children=np.array(children, dtype=np.int64),
        roots=np.array([row + shift for piece, shift in numbered for row in piece.roots]),
        duration=duration,
        defect=defect,
    )


def sample_times(first: float, last: float, duration: float) -> Array:
    """Unevenly spaced times of a piece."""
    count = max(_LEAST_SAMPLES, int(np.ceil(_SAMPLES * (last - first) / duration)))
    jitter = np.mod(0.6180339887498949 * np.arange(count), 1.0) - 0.5
    return first + (last - first) * ((np.arange(count) + 0.5 + _JITTER * jitter) / count)


def polynomials(x: Array) -> Array:
    """T_0 ... T_DEGREE by their recurrence, which is faster than cosines: (S,) -> (S, DEGREE + 1)."""
    basis = np.empty((DEGREE + 1, len(x)))
    basis[0], basis[1] = 1.0, x
    twice = 2.0 * x
    for k in range(2, DEGREE + 1):
        np.multiply(twice, basis[k - 1], out=basis[k])
        basis[k] -= basis[k - 2]
    return basis.T


@lru_cache(maxsize=1)
def transform() -> Array:
    """Values at the nodes of a panel -> coefficients, from angles that are multiples of pi/DEGREE to rounding."""
    degrees, nodes = np.arange(DEGREE + 1)[:, None], np.arange(DEGREE + 1)
    matrix = np.cos(np.pi / DEGREE * (degrees * (DEGREE - nodes) % (2 * DEGREE))) * (2.0 / DEGREE)
    matrix[:, [0, -1]] *= 0.5
    matrix[[0, -1], :] *= 0.5
    return matrix


@lru_cache(maxsize=1)
def check_matrix() -> Array:
    """Values at the nodes of a panel -> at its check points."""
    return polynomials(2.0 * CHECKS - 1.0) @ transform()


@lru_cache(maxsize=1)
def integral_matrix() -> Array:
    """Coefficients of a series -> of its integral on [-1, 1]: (DEGREE + 2, DEGREE + 1)."""
    matrix = np.zeros((DEGREE + 2, DEGREE + 1))
    matrix[:] = np.polynomial.chebyshev.chebint(np.eye(DEGREE + 1), axis=0)
    return matrix
