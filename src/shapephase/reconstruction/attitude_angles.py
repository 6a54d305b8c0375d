"""Attitudes in time as three continuous numbers: rotation vectors and Euler angles.

Each chart has poles: a rotation vector where the attitude returns to the identity after whole turns, Euler angles at
gimbal lock. Some vectors that are linear in the quaternion vanish there and nowhere else, so their directions are
followed along the motion, with finer steps towards a pole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .. import so3
from ..arrays import Array
from ..errors import ChartPoleError, unknown_name

_AXES = ("x", "y", "z")
_TURN = 2.0 * np.pi
_NEAR = 0.5  # change of a vector between two times over its length: the direction then turns by 30 degrees at most
_AT_POLE = 1e-10  # rad, about twice the length of such a vector at a pole: the default tolerance of attitudes over ten
_NO_RATES = 1e-6  # cosine of the tilt: rates there have no digits left
_SHORTEST = 1e-14  # of the duration: halved intervals are not shorter, or times would coincide


class Chart(Protocol):
    """Three coordinates of an attitude, from the directions of vectors that vanish at the poles."""

    def vectors(self, quaternions: Array, /) -> list[Array]:
        """Return the vectors, linear in the quaternion: (..., 4) -> (..., d) each."""
        ...

    def numbers(self, quaternions: Array, at_pole: float, /) -> Array:
        """Return the coordinates along a continuous curve: (N, 4) -> (N, 3) [rad]."""
        ...


def continued_angles(
    quaternions_at: Callable[[Array], Array],
    curve: tuple[Array, Array],
    times: Array,
    chart: Chart,
    uncertainty: float,
) -> Array:
    """Return chart coordinates of attitudes, continued along their motion: times (N,) -> (B, N, 3) [rad].

    The motion is followed from its start at times of its own, so the coordinates do not depend on the requested times.
    A motion that passes through a pole, to 1e-10 rad or the attitude's uncertainty, continues straight.

    quaternions_at : times (M,) -> (B, M, 4), of any sign
    curve : by `followed`, with this chart and uncertainty
    uncertainty : estimated error of the attitudes [rad]
    """
    at_pole = max(_AT_POLE, uncertainty)
    sampled, quaternions = curve
    further = np.setdiff1d(times, sampled)
    if len(further):
        sampled, quaternions = _merged(sampled, quaternions, further, quaternions_at(further))
    curves = [continuous(curve) for curve in quaternions]
    angles = np.array([chart.numbers(curve, at_pole) for curve in curves]).reshape(len(curves), len(sampled), 3)
    return angles[:, np.searchsorted(sampled, times)]


def followed(
    quaternions_at: Callable[[Array], Array], known: Array, chart: Chart, uncertainty: float
) -> tuple[Array, Array]:
    """Return times between which no vector of the chart turns by more than 30 degrees, and attitudes.

    (M,) [s], (B, M, 4)

    known : (K,) times between which attitudes move smoothly and by far less than a turn, first 0, last the end [s]
    """
    at_pole = max(_AT_POLE, uncertainty)
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
            return times, quaternions
        middle = 0.5 * (times[:-1] + times[1:])[coarse]
        times, quaternions = _merged(times, quaternions, middle, quaternions_at(middle))


def _merged(times: Array, quaternions: Array, further: Array, there: Array) -> tuple[Array, Array]:
    """Attitudes at times and at further ones, in the order of time."""
    both = np.concatenate([times, further])
    order = np.argsort(both)
    return both[order], np.concatenate([quaternions, there], axis=1)[:, order]


def continuous(quaternions: Array) -> Array:
    """Quaternions, each with the sign that is nearer to its predecessor: (N, 4) -> (N, 4)."""
    flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0, -1.0, 1.0)
    return quaternions * np.cumprod(np.append(1.0, flips))[:, None]


@dataclass(frozen=True)
class RotationVectors:
    """Chart of rotation vectors; those of one rotation differ by whole turns along their axis."""

    def vectors(self, quaternions: Array) -> list[Array]:
        """Return the vector part of the quaternion."""
        return [quaternions[..., :3]]

    def numbers(self, quaternions: Array, at_pole: float) -> Array:
        """Return rotation vectors along the curve; the first is within a half turn."""
        curve = quaternions if quaternions[0, 3] >= 0.0 else -quaternions
        axes = _directions(curve[:, :3], at_pole)
        flips = np.where(np.sum(axes[1:] * axes[:-1], axis=1) < 0.0, -1.0, 1.0)
        axes *= np.cumprod(np.append(1.0, flips))[:, None]
        halves = np.unwrap(np.arctan2(np.sum(curve[:, :3] * axes, axis=1), curve[:, 3]))
        return 2.0 * halves[:, None] * axes


@dataclass(frozen=True)
class EulerAngles:
    """Euler angles from two complex numbers, whose phases are the half sum and half difference of the outer angles.

    Their moduli are cosine and sine of half the middle angle, increased by a right angle where all axes differ.
    Source: Bernardes and Viollet 2022, PLoS ONE 17, e0276302.

    sequence : as for `Motion.euler_angles`
    """

    sequence: str

    def vectors(self, quaternions: Array) -> list[Array]:
        """Return the two complex numbers as real pairs."""
        i, j, k = self._extrinsic
        w, x, y, z = quaternions[..., 3], *(quaternions[..., axis] for axis in (i, j, 3 - i - j))
        z = self._handedness * z
        if i == k:
            return [np.stack([w, x], axis=-1), np.stack([y, z], axis=-1)]
        return [np.stack([w - y, x + z], axis=-1) / np.sqrt(2.0), np.stack([w + y, z - x], axis=-1) / np.sqrt(2.0)]

    def numbers(self, quaternions: Array, at_pole: float) -> Array:
        """Return the angles; the outer ones begin within a half turn. Where all are at a pole, the last is zero."""
        parts = self.vectors(quaternions)
        directions = [_directions(part, at_pole) for part in parts]
        phases = [np.unwrap(np.arctan2(part[:, 1], part[:, 0]), period=np.pi) for part in directions]
        turning = [part.any() for part in directions]
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
        """Axes of the equivalent extrinsic sequence: an intrinsic one in reverse."""
        i, j, k = (_AXES.index(axis) for axis in self.sequence.lower())
        return (k, j, i) if self.sequence.isupper() else (i, j, k)

    @property
    def _handedness(self) -> float:
        i, j, _ = self._extrinsic
        return 1.0 if (j - i) % 3 == 1 else -1.0


def _directions(vectors: Array, at_pole: float) -> Array:
    """Unit vectors (N, d); at a pole the preceding one, at the start the next one; zero where all are at a pole."""
    length = np.linalg.norm(vectors, axis=-1)
    away = np.flatnonzero(length > at_pole)
    if not len(away):
        return np.zeros_like(vectors)
    source = away[np.maximum(np.searchsorted(away, np.arange(len(vectors)), side="right") - 1, 0)]
    return vectors[source] / length[source, None]


def euler_angles(attitudes: Array, sequence: str) -> Array:
    """Return Euler angles of consecutive attitudes, continuous in time: (N, 3, 3) -> (N, 3) [rad].

    sequence : as for `Motion.euler_angles`
    """
    return EulerAngles(sequence).numbers(continuous(so3.quat_from_matrix(attitudes)), _AT_POLE)


def athlete_slopes(tilt: Array, twist: Array) -> Array:
    """Return rates of somersault, tilt and twist per rate about the frontal, lateral and longitudinal axis.

    Parameters
    ----------
    tilt, twist : (...) [rad]

    Returns
    -------
    (..., 3, 3)

    Raises
    ------
    ChartPoleError
        Where the tilt is a right angle, to 1e-6 rad.
    """
    if np.any(np.abs(np.cos(tilt)) < _NO_RATES):
        raise ChartPoleError(
            "the tilt passes through 90 degrees, where somersault and twist are about one axis, and their rates "
            "are not defined; take other times, or another longitudinal axis"
        )
    sine, cosine, zero = np.sin(twist), np.cos(twist), np.zeros_like(twist)
    turning = np.stack([sine / np.cos(tilt), cosine / np.cos(tilt), zero], axis=-1)
    along = np.sin(tilt)[..., None] * turning + np.array([0.0, 0.0, 1.0])
    return np.stack([turning, np.stack([cosine, -sine, zero], axis=-1), along], axis=-2)


def tilt_and_twist(seen: Array) -> tuple[Array, Array]:
    """Tilt and twist of attitudes from an athlete's axes in the body to those in space: (..., 3, 3) -> (...) each.

    The tilt is within a quarter of a turn, which leaves what `athlete_slopes` gives for somersault and twist as it is.
    """
    return (
        np.arctan2(-seen[..., 1, 2], np.hypot(seen[..., 1, 0], seen[..., 1, 1])),
        np.arctan2(seen[..., 1, 0], seen[..., 1, 1]),
    )


def euler_chart(sequence: str) -> EulerAngles:
    """Return the chart of a sequence. Raises UnknownNameError for an invalid sequence."""
    axes = sequence.lower() if isinstance(sequence, str) else ""
    cased = isinstance(sequence, str) and sequence in (sequence.lower(), sequence.upper())
    valid = cased and len(axes) == 3 and {*axes} <= {*_AXES} and axes[0] != axes[1] != axes[2]
    if not valid:
        kinds = [a + b + c for a in "XYZ" for b in "XYZ" for c in "XYZ" if a != b != c]
        raise unknown_name("sequence of Euler angles", str(sequence), [*kinds, *map(str.lower, kinds)])
    return EulerAngles(sequence)
