"""Two-sided bounds of the phases from those of the energy.

theta_D = (1/l) integral of 2 E_t - Pi.w dt with w = I^-1 L_o, and theta_M = theta_D - Lambda for the signed solid angle
Lambda, whatever the axis and the size of the loop (theory.md C-E6: no rule of signs is needed).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ShapeError
from ._energy_bounds import EnergyBounds
from .arc_bounds import azimuth_bounds
from .regimes import RegimeCertificate

_ROOM = 1e-12


@dataclass(frozen=True)
class PhaseBounds:
    """A phase lies in [lower, upper] [rad]."""

    lower: float
    upper: float

    @property
    def width(self) -> float:
        """[rad]."""
        return self.upper - self.lower

    @property
    def is_informative(self) -> bool:
        """Whether they say anything of the phase modulo 2 pi: width < 2 pi. Source: Cabrera 2006, remark 4.2."""
        return self.width < 2.0 * np.pi

    def of_loop(self, solid_angle: float) -> PhaseBounds:
        """With these bounds of theta_D, those of theta_M = theta_D - solid_angle, signed [sr].

        Source: Cabrera 2006, equation (15), with the signed solid angle for its two signs; theory.md E13.
        """
        return PhaseBounds(self.lower - solid_angle, self.upper - solid_angle)


def dynamic_phase_bounds(bounds: EnergyBounds) -> PhaseBounds:
    """Bounds of theta_D from those of the energy at each time: the sharper ones. 0 without momentum.

    Source: theory.md E13.
    """
    if not bounds.size:
        return PhaseBounds(0.0, 0.0)
    known = bounds.enclosure
    stray = float(known.widths @ known.drift_size)
    low, high = (2.0 / bounds.size * float(known.widths @ part) for part in (bounds.lower, bounds.upper))
    return _rounded(low - stray, high + stray)


def dynamic_phase_bounds_by_extremes(bounds: EnergyBounds) -> PhaseBounds:
    """The same from the extreme energies, (2/l) E_min dt to (2/l) E_max dt, with what L_o adds. 0 without momentum.

    Without L_o their width is 2 (E_max - E_min) dt/l. Source: Cabrera 2006, equation (15), remark 4.2; theory.md E14.
    """
    if not bounds.size:
        return PhaseBounds(0.0, 0.0)
    known = bounds.enclosure
    stray, length = float(known.widths @ known.drift_size), float(known.widths.sum())
    low, high = (2.0 / bounds.size * energy * length for energy in (bounds.least, bounds.greatest))
    return _rounded(low - stray, high + stray)


def solid_angle_bounds(certificate: RegimeCertificate) -> PhaseBounds:
    """Bounds of the signed solid angle of any closed curve of Pi that goes once round the certified axis [sr].

    2 pi (1 - cos(theta)) for the least and the greatest angle that Pi can have to the axis, negative about the axis of
    the smallest moment.

    Raises
    ------
    ShapeError
        If no axis is certain, or not that the azimuth changes in one sense.

    Source: theory.md E8, E13.
    """
    azimuth = azimuth_bounds(certificate)
    if not azimuth.monotone:
        raise ShapeError("certificate: it is not certain that Pi goes round the axis in one sense only")
    least, greatest = certificate.cosines
    narrow, wide = 2.0 * np.pi * (1.0 - float(greatest.max())), 2.0 * np.pi * (1.0 - float(least.min()))
    return _rounded(narrow, wide) if azimuth.sense > 0.0 else _rounded(-wide, -narrow)


def loop_phase_bounds(certificate: RegimeCertificate) -> PhaseBounds:
    """Bounds of theta_M before the motion is computed, should Pi close once round the axis just at the interval's end.

    Raises as `solid_angle_bounds`. Source: theory.md E13, E8.
    """
    dynamic, area = dynamic_phase_bounds(certificate.bounds), solid_angle_bounds(certificate)
    return PhaseBounds(dynamic.lower - area.upper, dynamic.upper - area.lower)


def _rounded(lower: float, upper: float) -> PhaseBounds:
    room = _ROOM * (abs(lower) + abs(upper))
    return PhaseBounds(lower - room, upper + room)
