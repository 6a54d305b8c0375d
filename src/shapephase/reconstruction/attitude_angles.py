"""Attitudes in time as three numbers that go on without a jump: rotation vectors and Euler angles.

Each chart has poles: a rotation vector where the attitude comes back after whole turns, Euler angles where the middle
one reaches its end. A few vectors, linear in the quaternion, lose their direction there and nowhere else. So directions
are followed along the motion, ever finer towards a pole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .. import so3
from ..arrays import Array
from ..errors import unknown_name

_AXES = ("x", "y", "z")
_TURN = 2.0 * np.pi
# Of the distance from a pole: how far a vector may move between two times; its direction turns by 30 degrees at most.
_NEAR = 0.5
# Length of such a vector at a pole, where the attitude is not more uncertain: about half the angle from the pole.
_AT_POLE = 1e-10
# Of the duration: what halving leaves of an interval is no shorter.
_SHORTEST = 1e-14


class Chart(Protocol):
    """Three numbers of an attitude, by the directions of vectors that are zero at the poles."""

    def vectors(self, quaternions: Array, /) -> list[Array]:
        """The vectors, linear in the quaternion: (..., 4) -> (..., d) each."""
        ...

    def numbers(self, quaternions: Array, at_pole: float, /) -> Array:
        """The numbers along a continuous curve: (N, 4) -> (N, 3) [rad]."""
        ...


def continued_angles(
    quaternions_at: Callable[[Array], Array], known: Array, times: Array, chart: Chart, uncertainty: float
) -> Array:
    """Three numbers of attitudes, continued along their motion: times (N,) -> (B, N, 3) [rad].

    The motion is followed from its start at times of its own: numbers do not depend on which times are asked for. What
    goes through a pole, to 1e-10 rad or the attitude's uncertainty, goes straight through.

    Parameters
    ----------
    quaternions_at : times (M,) -> (B, M, 4), of any sign
    known : (K,) times between which attitudes move smoothly and by far less than a turn, first 0, last the end [s]
    uncertainty : of the attitudes [rad]
    """
    at_pole = max(_AT_POLE, uncertainty)
    own = _followed(quaternions_at, known, chart, at_pole)
    every = np.union1d(own, times)
    curves = [_continuous(curve) for curve in quaternions_at(every)]
    found = np.array([chart.numbers(curve, at_pole) for curve in curves]).reshape(len(curves), len(every), 3)
    return found[:, np.searchsorted(every, times)]


def _followed(quaternions_at: Callable[[Array], Array], known: Array, chart: Chart, at_pole: float) -> Array:
    """Times between which no vector of a chart turns far."""
    times, quaternions = known, quaternions_at(known)
    while True:
        signs = np.where(np.sum(quaternions[:, 1:] * quaternions[:, :-1], axis=-1) < 0.0, -1.0, 1.0)[..., None]
        coarse = np.zeros(len(times) - 1, dtype=bool)
        for vectors in chart.vectors(quaternions):
            moved = np.linalg.norm(vectors[:, 1:] - signs * vectors[:, :-1], axis=-1)
            length = np.linalg.norm(vectors, axis=-1)
            coarse |= (moved > np.maximum(_NEAR * np.maximum(length[:, 1:], length[:, :-1]), at_pole)).any(axis=0)
        coarse &= np.diff(times) > _SHORTEST * times[-1]
        if not coarse.any():
            return times
        middle = 0.5 * (times[:-1] + times[1:])[coarse]
        order = np.argsort(np.concatenate([times, middle]))
        times = np.concatenate([times, middle])[order]
        quaternions = np.concatenate([quaternions, quaternions_at(middle)], axis=1)[:, order]


def _continuous(quaternions: Array) -> Array:
    """Quaternions in their order, each with the sign that is nearer to the one before: (N, 4) -> (N, 4)."""
    flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0, -1.0, 1.0)
    return quaternions * np.cumprod(np.append(1.0, flips))[:, None]


@dataclass(frozen=True)
class RotationVectors:
    """The rotation vector, whose axis may point either way: those of one rotation are whole turns apart on it."""

    def vectors(self, quaternions: Array) -> list[Array]:
        """The sine part, as `Chart` has it."""
        return [quaternions[..., :3]]

    def numbers(self, quaternions: Array, at_pole: float) -> Array:
        """As `Chart` has them; the first is within a half turn."""
        curve = quaternions if quaternions[0, 3] >= 0.0 else -quaternions
        axes = _directions(curve[:, :3], at_pole)
        flips = np.where(np.sum(axes[1:] * axes[:-1], axis=1) < 0.0, -1.0, 1.0)
        axes *= np.cumprod(np.append(1.0, flips))[:, None]
        halves = np.unwrap(np.arctan2(np.sum(curve[:, :3] * axes, axis=1), curve[:, 3]))
        return 2.0 * halves[:, None] * axes


@dataclass(frozen=True)
class EulerAngles:
    """Euler angles by two complex numbers, whose phases are the half sum and half difference of the outer angles.

    Their sizes are cosine and sine of half the middle angle, or of half of it and a right angle where all axes differ.
    Source: Bernardes and Viollet 2022, PLoS ONE 17, e0276302.

    Attributes
    ----------
    sequence : as for `Motion.euler_angles`
    """

    sequence: str

    def vectors(self, quaternions: Array) -> list[Array]:
        """The complex numbers, as `Chart` has them."""
        i, j, k = self._extrinsic
        w, x, y, z = quaternions[..., 3], *(quaternions[..., axis] for axis in (i, j, 3 - i - j))
        z = self._handedness * z
        if i == k:
            return [np.stack([w, x], axis=-1), np.stack([y, z], axis=-1)]
        return [np.stack([w - y, x + z], axis=-1) / np.sqrt(2.0), np.stack([w + y, z - x], axis=-1) / np.sqrt(2.0)]

    def numbers(self, quaternions: Array, at_pole: float) -> Array:
        """As `Chart` has them; the outer ones begin within a half turn. All along at a pole, the last one is zero."""
        parts = self.vectors(quaternions)
        found = [_directions(part, at_pole) for part in parts]
        phases = [np.unwrap(np.arctan2(part[:, 1], part[:, 0]), period=np.pi) for part in found]
        turning = [part.any() for part in found]
        if not all(turning):
            other = phases[int(np.argmax(turning))]
            phases = [other, other if self.sequence.isupper() else -other]
        sizes = [
            np.sum(part * np.stack([np.cos(phase), np.sin(phase)], axis=-1), axis=-1)
            for part, phase in zip(parts, phases, strict=True)
        ]
        middle = 2.0 * np.unwrap(np.arctan2(sizes[1], sizes[0]))
        first, last = phases[0] - phases[1], phases[0] + phases[1]
        if self._extrinsic[0] != self._extrinsic[2]:
            middle -= 0.5 * np.pi
            last = self._handedness * last
        angles = np.stack([first, middle, last], axis=-1)
        angles[:, ::2] -= _TURN * np.ceil(angles[0, ::2] / _TURN - 0.5)
        return angles[:, ::-1] if self.sequence.isupper() else angles

    @property
    def _extrinsic(self) -> tuple[int, int, int]:
        """The axes of turns about fixed axes; those about axes that are carried along are the same in reverse."""
        i, j, k = (_AXES.index(axis) for axis in self.sequence.lower())
        return (k, j, i) if self.sequence.isupper() else (i, j, k)

    @property
    def _handedness(self) -> float:
        i, j, _ = self._extrinsic
        return 1.0 if (j - i) % 3 == 1 else -1.0


def _directions(vectors: Array, at_pole: float) -> Array:
    """Of unit length: (N, d); at a pole that of the one before, of the one behind at the start; zero without any."""
    length = np.linalg.norm(vectors, axis=-1)
    away = np.flatnonzero(length > at_pole)
    if not len(away):
        return np.zeros_like(vectors)
    source = away[np.maximum(np.searchsorted(away, np.arange(len(vectors)), side="right") - 1, 0)]
    return vectors[source] / length[source, None]


def euler_angles(attitudes: Array, sequence: str) -> Array:
    """Euler angles of attitudes in their order, each the nearest to those before: (N, 3, 3) -> (N, 3) [rad].

    Parameters
    ----------
    sequence : as for `Motion.euler_angles`
    """
    return EulerAngles(sequence).numbers(_continuous(so3.quat_from_matrix(attitudes)), _AT_POLE)


def euler_chart(sequence: str) -> EulerAngles:
    """The chart of a sequence. Raises UnknownNameError for what is no sequence of Euler angles."""
    axes = sequence.lower() if isinstance(sequence, str) else ""
    cased = isinstance(sequence, str) and sequence in (sequence.lower(), sequence.upper())
    valid = cased and len(axes) == 3 and {*axes} <= {*_AXES} and axes[0] != axes[1] != axes[2]
    if not valid:
        kinds = [a + b + c for a in "XYZ" for b in "XYZ" for c in "XYZ" if a != b != c]
        raise unknown_name("sequence of Euler angles", str(sequence), [*kinds, *map(str.lower, kinds)])
    return EulerAngles(sequence)
