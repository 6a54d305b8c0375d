"""Every bound of a motion beside what it bounds: one enumeration for tests, tables and figures.

The bounds come from the deformation and the initial momentum alone (`energy_bounds`, `regimes`, `arc_bounds`,
`phase_bounds`); the values are measured on the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3, sphere
from ..arguments import interval_argument
from ..arrays import Array
from ..errors import ShapeError
from ..reconstruction.reconstruction import Motion
from ._energy_bounds import EnergyBounds
from .arc_bounds import arc_length_bounds, azimuth_bounds, return_time_bounds
from .energy import energy_along, energy_rate
from .phase_bounds import dynamic_phase_bounds, dynamic_phase_bounds_by_extremes
from .regimes import CrownRegion, RegimeCertificate, regime_certificate

_SAMPLES = 4


@dataclass(frozen=True)
class Bound:
    """A number that a value cannot pass.

    Attributes
    ----------
    name : what is bounded, and by what
    is_upper : whether the value is at most the bound; else at least
    limit : the bound
    value : measured on the motion
    """

    name: str
    is_upper: bool
    limit: float
    value: float

    @property
    def slack(self) -> float:
        """How far the value keeps from the bound; below zero if the bound is false."""
        return self.limit - self.value if self.is_upper else self.value - self.limit

    @property
    def tightness(self) -> float:
        """The smaller of bound and value over the larger: 1 is sharp; 0 where signs differ or one is zero."""
        small, large = sorted((abs(self.limit), abs(self.value)))
        if self.limit == self.value:
            return 1.0
        return small / large if self.limit * self.value > 0.0 else 0.0


def bounds(
    motion: Motion, interval: tuple[float, float] | None = None, *, resolution: float = 5e-3
) -> tuple[Bound, ...]:
    """All bounds of one motion over an interval, each with its value.

    Those that need a certain axis, or a turn about it, are listed where there is one.

    Parameters
    ----------
    motion : of one momentum, no batch
    interval : (start, end) [s]; None: [0, duration]
    resolution : as for `enclosure`

    Raises
    ------
    ShapeError
        If the motion is a batch, or has no momentum: then nothing moves that could be bounded.

    Source: theory.md E3, E6 to E14.
    """
    if motion.batch:
        raise ShapeError(f"bounds are of one motion, this is a batch of {motion.batch}; reconstruct one of them")
    start, end = interval_argument(interval, motion.duration)
    certificate = regime_certificate(
        motion.deformation, motion.momentum, motion.attitude(start), (start, end), resolution=resolution
    )
    if not certificate.bounds.size:
        raise ShapeError("bounds are of a motion with angular momentum; this one has none")
    track = _track(motion, start, end)
    return (
        *_moments(certificate.bounds, motion, track),
        *_energies(certificate, motion, track),
        *_arcs(certificate.bounds, motion, track),
        *_phases(certificate, motion, track),
        *(_about_axis(certificate, track) if certificate.certain else ()),
    )


@dataclass(frozen=True, eq=False)
class _Track:
    """Ascending nodes of a quadrature (N,) and the directions of Pi there; both ends are among them, without weight."""

    times: Array
    weights: Array
    directions: Array


def _track(motion: Motion, start: float, end: float) -> _Track:
    steps = motion.solution.times
    edges = np.concatenate([[start], steps[(steps > start) & (steps < end)], [end]])
    edges = np.append((edges[:-1, None] + np.diff(edges)[:, None] * np.arange(_SAMPLES) / _SAMPLES).ravel(), end)
    nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
    times = np.concatenate([[start], nodes.ravel(), [end]])
    momenta = motion.body_momentum(times)
    directions = momenta / np.linalg.norm(momenta, axis=1, keepdims=True)
    return _Track(times, np.concatenate([[0.0], weights.ravel(), [0.0]]), directions)


def _moments(known: EnergyBounds, motion: Motion, track: _Track) -> list[Bound]:
    least, greatest = known.enclosure.principal_moments
    seen = np.linalg.eigvalsh(motion.deformation.inertia(track.times))
    return [
        *(Bound(f"moment {k + 1}, most", True, float(greatest[:, k].max()), float(seen[:, k].max())) for k in range(3)),
        *(Bound(f"moment {k + 1}, least", False, float(least[:, k].min()), float(seen[:, k].min())) for k in range(3)),
    ]


def _energies(certificate: RegimeCertificate, motion: Motion, track: _Track) -> list[Bound]:
    known = certificate.bounds
    energy, rate = energy_along(motion, track.times), energy_rate(motion, track.times).total
    size = known.size
    inverse_middle = 0.5 * size * size / np.linalg.eigvalsh(motion.deformation.inertia(track.times))[:, 1]
    return [
        Bound("energy, most", True, known.greatest, float(energy.max())),
        Bound("energy, least", False, known.least, float(energy.min())),
        Bound("energy rate, most", True, float(known.rate_upper.max()), float(rate.max())),
        Bound("energy rate, least", False, float(known.rate_lower.min()), float(rate.min())),
        Bound("homoclinic energy, most", True, certificate.threshold[1], float(inverse_middle.max())),
        Bound("homoclinic energy, least", False, certificate.threshold[0], float(inverse_middle.min())),
    ]


def _arcs(known: EnergyBounds, motion: Motion, track: _Track) -> list[Bound]:
    momenta = motion.body_momentum(track.times)
    speed = np.linalg.norm(np.cross(momenta, motion.angular_velocity(track.times)), axis=1)
    length = float(speed @ track.weights)
    most = arc_length_bounds(known)
    farthest = float(so3.angle_between(track.directions[0], track.directions).max()) * known.size
    return [
        Bound("arc length, general", True, most.general, length),
        Bound("arc length, by drift", True, most.by_drift, length),
        Bound("arc length, by energy", True, most.by_energy, length),
        Bound("distance from the start, by energy", True, most.by_energy, farthest),
    ]


def _phases(certificate: RegimeCertificate, motion: Motion, track: _Track) -> list[Bound]:
    known = certificate.bounds
    first, last = motion.dynamic_phase(track.times[[0, -1]])
    value = float(last - first)
    rows = []
    for name, found in (
        ("by extremes", dynamic_phase_bounds_by_extremes(known)),
        ("by energy", dynamic_phase_bounds(known)),
    ):
        rows.append(Bound(f"dynamic phase, most, {name}", True, found.upper, value))
        rows.append(Bound(f"dynamic phase, least, {name}", False, found.lower, value))
    return rows


def _about_axis(certificate: RegimeCertificate, track: _Track) -> list[Bound]:
    """What holds about a certain axis."""
    least, greatest = CrownRegion(certificate).cosines
    cosine = track.directions @ certificate.axis
    rows = [
        Bound("cosine to the axis, least", False, least, float(cosine.min())),
        Bound("cosine to the axis, most", True, greatest, float(cosine.max())),
    ]
    azimuth = azimuth_bounds(certificate)
    if not azimuth.monotone:
        return rows
    widths = certificate.bounds.enclosure.widths
    turned = azimuth.sense * _azimuth(track.directions, certificate.axis)
    rows.append(Bound("azimuth, most", True, float(widths @ azimuth.fast), float(turned[-1])))
    rows.append(Bound("azimuth, least", False, float(widths @ azimuth.slow), float(turned[-1])))
    if turned[-1] < 2.0 * np.pi:
        return rows
    times = return_time_bounds(certificate)
    back = float(np.interp(2.0 * np.pi, turned, track.times) - track.times[0])
    rows.extend(
        Bound(f"return time, {name}", False, limit, back)
        for name, limit in (
            ("by latitude", times.by_latitude),
            ("by inertia", times.by_inertia),
            ("by azimuth", times.by_azimuth),
        )
    )
    if np.isfinite(times.latest):
        rows.append(Bound("return time, latest", True, times.latest, back))
    return rows


def _azimuth(directions: Array, axis: Array) -> Array:
    """The angle that directions have gone round an axis, from zero and without jumps: (N, 3) -> (N,)."""
    first = directions[0] - (directions[0] @ axis) * axis
    first /= np.linalg.norm(first)
    angle = np.unwrap(np.arctan2(directions @ np.cross(axis, first), directions @ first))
    return angle - angle[0]
