"""The momentum's curve in machine code."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Array, Integers
from ._plain import plain

_NO_FRAMES = np.empty((0, 3, 3))


class PiecesOfCurve(NamedTuple):
    """What is found of M pieces of the curves of B momenta."""

    dynamic: Array  # (B, M) integral of the gauge's omega . Pi/|Pi| over each piece [rad]
    slivers: Array  # (B, M) signed area between each piece's arc and its chord [sr]
    corners: Array  # (B, M + 1, 3) directions at the ends of the pieces, gauge axes
    slopes: Array  # (B, M + 1, 3) rates of the directions at the ends of the pieces, in the gauge but body axes [rad/s]
    by_momentum: Array  # (B, M + 1, 3) the part of it that is due to I^-1 Pi
    differences: Array  # (2, 2, B) between three rules for both integrals, sums of their sizes

    @classmethod
    def empty(cls, batch: int, count: int) -> PiecesOfCurve:
        """Room for so many momenta and pieces; differences are zero."""
        dynamic, slivers = np.empty((2, batch, count))
        corners, slopes, by_momentum = np.empty((3, batch, count + 1, 3))
        return cls(dynamic, slivers, corners, slopes, by_momentum, np.zeros((2, 2, batch)))


def curve_pieces(
    terms: Array,
    places: Integers,
    first: int,
    directions: Array,
    frames: Array | None,
    lengths: Array,
    magnitudes: Array,
    rules: Array,
    found: PiecesOfCurve,
) -> None:
    """Fill what is to be found of N pieces `first`, `first` + 1, ..., and add to the differences.

    Parameters
    ----------
    terms : (Q, TERMS, 9) Taylor terms of the channels at the ends of pieces, as of `terms_at_ends`
    places : (N,) where the start of each piece stands among them, which its end follows
    directions : (B, M + 1, 3) of the momentum at the ends of all pieces, body axes
    frames : (M + 1, 3, 3) of the horizontal gauge there, body axes to gauge axes; None: the gauge is the base
    lengths : (M,) [s]
    magnitudes : (B,) of the momenta [kg m^2/s]
    rules : (3, 2 TERMS) from the terms at both ends to integrals
    """
    arrays = directions, _NO_FRAMES if frames is None else frames, lengths, magnitudes, rules
    _kernel().curve_pieces(plain(terms), places, first, *map(plain, arrays), *found)


def warm() -> None:
    """Call the kernel with the least that it takes."""
    terms, directions = np.ones((2, 6, 9)), np.ones((1, 2, 3))
    one, rules = np.ones(1), np.ones((3, 12))
    curve_pieces(terms, np.zeros(1, dtype=np.int64), 0, directions, None, one, one, rules, PiecesOfCurve.empty(1, 1))


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.curve_kernel", __package__)
