"""Every bound of a motion with the value that it bounds, in one list for tests, tables and figures.

The bounds come from the deformation and the initial momentum alone (`energy_bounds`, `regimes`, `_arc_bounds`,
`_phase_bounds`); the values are computed from the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, SupportsFloat

import numpy as np

from .. import so3, sphere
from ..arguments import check_object, interval_argument
from ..arrays import Array
from ..display import short_repr
from ..errors import ShapeError
from ..reconstruction.reconstruction import Motion
from ._arc_bounds import arc_length_bounds, azimuth_bounds, return_time_bounds
from ._enclosure import RESOLUTION
from ._energy_bounds import EnergyBounds
from ._phase_bounds import dynamic_phase_bounds, dynamic_phase_bounds_by_extremes
from .energy import energy_along, energy_rate, homoclinic_energy
from .regimes import CrownRegion, RegimeCertificate, regime_certificate


@dataclass(frozen=True)
class Bound:
    """Bound of a quantity of a motion, and the quantity itself. Made by `bounds`."""

    name: str
    """Quantity and the bound's name."""
    is_upper: bool
    """Whether the value is at most the bound; else it is at least the bound."""
    limit: float
    """The bound."""
    value: float
    """Value of the motion."""

    __repr__ = short_repr

    @property
    def slack(self) -> float:
        """Distance of the value from the bound, on the right side; below zero if the bound is false."""
        return self.limit - self.value if self.is_upper else self.value - self.limit

    @property
    def tightness(self) -> float:
        """The smaller magnitude of bound and value over the larger: 1 is sharp; 0 where signs differ or one is zero."""
        small, large = sorted((abs(self.limit), abs(self.value)))
        if self.limit == self.value:
            return 1.0
        return small / large if self.limit * self.value > 0.0 else 0.0


def bounds(
    motion: Motion, interval: tuple[float, float] | None = None, *, resolution: float = RESOLUTION
) -> tuple[Bound, ...]:
    """All bounds of one motion over an interval, each with its value.

    Bounds that need a certain axis, or a full turn about it, are listed only where there is one.

    Source: theory.md E3, E6 to E14.
    Raises ShapeError if the motion is a batch, or has no momentum, so that there is nothing to bound.

    Parameters
    ----------
    motion : of one momentum, no batch
    interval : (start, end) [s]; None: [0, duration]
    resolution : least relative change of the channels for which a cell of time is halved; smaller is sharper and slower

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.1, 0.2, 2.0])
    >>> all(bound.slack > -1e-9 for bound in sp.bounds.bounds(motion)), len(sp.bounds.bounds(motion)) > 5
    (True, True)
    """
    check_object(motion, "Motion", "motion")
    if motion.batch:
        raise ShapeError(f"bounds are of one motion, this is a batch of {motion.batch}; reconstruct one of them")
    start, end = interval_argument(interval, motion.duration)
    certificate = regime_certificate(
        motion.deformation, motion.momentum, motion.attitude(start), (start, end), resolution=resolution
    )
    if not certificate.bounds.magnitude:
        raise ShapeError("bounds are of a motion with angular momentum; this one has none")
    track = _track(motion, start, end)
    return (
        *_moments(certificate.bounds, motion, track),
        *_energies(certificate, motion, track),
        *_arcs(certificate.bounds, motion, track),
        *_phases(certificate, motion, track),
        *(_about_axis(certificate, track) if certificate.certain else ()),
    )


class _Track(NamedTuple):
    """Ascending nodes of a quadrature (N,), its weights and the directions of Pi there; both ends have weight zero."""

    times: Array
    weights: Array
    directions: Array


def _track(motion: Motion, start: float, end: float) -> _Track:
    steps = motion.solution.times
    edges = np.concatenate([[start], steps[(steps > start) & (steps < end)], [end]])
    # With a Gauss rule on each quarter of a step integrals are right to rounding, and extremes at the nodes nearly so.
    parts = np.arange(4) / 4.0
    edges = np.append((edges[:-1, None] + np.diff(edges)[:, None] * parts).ravel(), end)
    nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
    times = np.concatenate([[start], nodes.ravel(), [end]])
    momenta = motion.body_momentum(times)
    directions = momenta / np.linalg.norm(momenta, axis=1, keepdims=True)
    return _Track(times=times, weights=np.concatenate([[0.0], weights.ravel(), [0.0]]), directions=directions)


def _moments(known: EnergyBounds, motion: Motion, track: _Track) -> list[Bound]:
    least, greatest = known.enclosure.principal_moments
    moments = np.linalg.eigvalsh(motion.deformation.inertia(track.times)).T
    return [
        *(_at_most(f"moment {k + 1}, most", greatest[:, k].max(), moments[k].max()) for k in range(3)),
        *(_at_least(f"moment {k + 1}, least", least[:, k].min(), moments[k].min()) for k in range(3)),
    ]


def _energies(certificate: RegimeCertificate, motion: Motion, track: _Track) -> list[Bound]:
    known = certificate.bounds
    energy, rate = energy_along(motion, track.times), energy_rate(motion, track.times).total
    homoclinic = homoclinic_energy(motion.deformation, track.times, known.magnitude)
    return [
        _at_most("energy, most", known.greatest, energy.max()),
        _at_least("energy, least", known.least, energy.min()),
        _at_most("energy rate, most", known.rate_upper.max(), rate.max()),
        _at_least("energy rate, least", known.rate_lower.min(), rate.min()),
        _at_most("homoclinic energy, most", certificate.threshold[1], homoclinic.max()),
        _at_least("homoclinic energy, least", certificate.threshold[0], homoclinic.min()),
    ]


def _arcs(known: EnergyBounds, motion: Motion, track: _Track) -> list[Bound]:
    momenta = motion.body_momentum(track.times)
    speed = np.linalg.norm(np.cross(momenta, motion.angular_velocity(track.times)), axis=1)
    length = float(speed @ track.weights)
    most = arc_length_bounds(known)
    farthest = float(so3.angle_between(track.directions[0], track.directions).max()) * known.magnitude
    return [
        _at_most("arc length, general", most.general, length),
        _at_most("arc length, by drift", most.by_drift, length),
        _at_most("arc length, by energy", most.by_energy, length),
        _at_most("distance from the start, by energy", most.by_energy, farthest),
    ]


def _phases(certificate: RegimeCertificate, motion: Motion, track: _Track) -> list[Bound]:
    known = certificate.bounds
    first, last = motion.dynamic_phase(track.times[[0, -1]])
    value = float(last - first)
    extremes, energy = dynamic_phase_bounds_by_extremes(known), dynamic_phase_bounds(known)
    return [
        _at_most("dynamic phase, most, by extremes", extremes.upper, value),
        _at_least("dynamic phase, least, by extremes", extremes.lower, value),
        _at_most("dynamic phase, most, by energy", energy.upper, value),
        _at_least("dynamic phase, least, by energy", energy.lower, value),
    ]


def _about_axis(certificate: RegimeCertificate, track: _Track) -> list[Bound]:
    """Bounds that need a certain axis."""
    least, greatest = CrownRegion(certificate).cosines
    cosine = track.directions @ certificate.axis
    rows = [
        _at_least("cosine to the axis, least", least, cosine.min()),
        _at_most("cosine to the axis, most", greatest, cosine.max()),
    ]
    azimuth = azimuth_bounds(certificate)
    if not azimuth.monotone:
        return rows
    widths = certificate.bounds.enclosure.widths
    turned = azimuth.sense * _azimuth(track.directions, certificate.axis)
    rows.append(_at_most("azimuth, most", widths @ azimuth.fast, turned[-1]))
    rows.append(_at_least("azimuth, least", widths @ azimuth.slow, turned[-1]))
    if turned[-1] < 2.0 * np.pi:
        return rows
    times = return_time_bounds(certificate)
    back = float(np.interp(2.0 * np.pi, turned, track.times) - track.times[0])
    limits = {"latitude": times.by_latitude, "inertia": times.by_inertia, "azimuth": times.by_azimuth}
    rows.extend(_at_least(f"return time, by {name}", limit, back) for name, limit in limits.items())
    if np.isfinite(times.latest):
        rows.append(_at_most("return time, latest", times.latest, back))
    return rows


def _at_most(name: str, limit: SupportsFloat, value: SupportsFloat) -> Bound:
    return Bound(name=name, is_upper=True, limit=float(limit), value=float(value))


def _at_least(name: str, limit: SupportsFloat, value: SupportsFloat) -> Bound:
    return Bound(name=name, is_upper=False, limit=float(limit), value=float(value))


def _azimuth(directions: Array, axis: Array) -> Array:
    """The azimuth of directions about an axis, from zero at the first and without jumps: (N, 3) -> (N,)."""
    first = directions[0] - (directions[0] @ axis) * axis
    first /= np.linalg.norm(first)
    angle = np.unwrap(np.arctan2(directions @ np.cross(axis, first), directions @ first))
    return angle - angle[0]
