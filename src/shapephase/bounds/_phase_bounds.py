"""Two-sided bounds of the phases from those of the energy.

theta_D = (1/l) integral of 2 E_t - Pi.w dt with w = I^-1 L_o, and theta_M = theta_D - Lambda for the signed solid angle
Lambda, whatever the axis and however large the loop (theory.md C-E6: no rule of signs is needed).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arguments import check_object
from ..display import short_repr
from ..errors import ShapeError
from ._arc_bounds import azimuth_bounds
from ._enclosure import ROUND_UP
from ._energy_bounds import EnergyBounds
from .regimes import RegimeCertificate


@dataclass(frozen=True)
class PhaseBounds:
    """Bounds of a phase, which lies in [lower, upper] [rad]. Made by `dynamic_phase_bounds`."""

    lower: float
    upper: float

    __repr__ = short_repr

    @property
    def width(self) -> float:
        """upper - lower [rad]."""
        return self.upper - self.lower

    @property
    def is_informative(self) -> bool:
        """True if they restrict the phase modulo 2 pi: width < 2 pi. Source: Cabrera 2006, remark 4.2."""
        return self.width < 2.0 * np.pi

    def of_loop(self, solid_angle: float) -> PhaseBounds:
        """Bounds of theta_M = theta_D - solid_angle, the signed one [sr], if these are bounds of theta_D.

        Source: Cabrera 2006, equation (15), with the signed solid angle for its two signs; theory.md E13.
        """
        return PhaseBounds(lower=self.lower - solid_angle, upper=self.upper - solid_angle)


def dynamic_phase_bounds(bounds: EnergyBounds) -> PhaseBounds:
    """Bounds of theta_D from those of the energy at each time, the sharper ones; zero without momentum.

    Source: theory.md E13.

    Examples
    --------
    >>> found = sp.bounds.energy_bounds(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.0, 0.0, 2.0])
    >>> phase = sp.bounds.dynamic_phase_bounds(found)
    >>> print(f"{phase.lower:.6f} to {phase.upper:.6f} rad")  # 2 E t/l = 1.5
    1.500000 to 1.500000 rad
    """
    check_object(bounds, "EnergyBounds", "bounds")
    widths = bounds.enclosure.widths
    return _by_integrals(bounds, float(widths @ bounds.lower), float(widths @ bounds.upper))


def dynamic_phase_bounds_by_extremes(bounds: EnergyBounds) -> PhaseBounds:
    """Bounds of theta_D from the extreme energies: (2/l) E_min dt to (2/l) E_max dt, each wider by the part of L_o.

    Without L_o their width is 2 (E_max - E_min) dt/l. Both are zero without momentum.

    Source: Cabrera 2006, equation (15), remark 4.2; theory.md E14.

    Examples
    --------
    >>> found = sp.bounds.energy_bounds(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.0, 0.0, 2.0])
    >>> phase = sp.bounds.dynamic_phase_bounds_by_extremes(found)
    >>> print(f"{phase.lower:.6f} to {phase.upper:.6f} rad")
    1.500000 to 1.500000 rad
    """
    check_object(bounds, "EnergyBounds", "bounds")
    length = float(bounds.enclosure.widths.sum())
    return _by_integrals(bounds, bounds.least * length, bounds.greatest * length)


def solid_angle_bounds(certificate: RegimeCertificate) -> PhaseBounds:
    """Bounds of the signed solid angle of any closed curve of Pi that goes once round the certified axis [sr].

    2 pi (1 - cos(theta)) for the least and the greatest angle possible between Pi and the axis, negative about the
    axis of the smallest moment.

    Source: theory.md E8, E13.
    Raises ShapeError if no axis is certain, or the sense in which Pi circles it is not.

    Examples
    --------
    >>> certificate = sp.bounds.regime_certificate(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.1, 0.2, 2.0])
    >>> area = sp.bounds.solid_angle_bounds(certificate)
    >>> top = sp.EulerTop.principal([1.0, 2.0, 4.0], [0.1, 0.2, 2.0])
    >>> area.lower <= top.solid_angle <= area.upper
    True
    """
    azimuth = azimuth_bounds(certificate)
    if not azimuth.monotone:
        raise ShapeError("certificate: it is not certain that Pi circles the axis in one sense only")
    least, greatest = certificate.cosines
    narrow, wide = 2.0 * np.pi * (1.0 - float(greatest.max())), 2.0 * np.pi * (1.0 - float(least.min()))
    return _rounded(narrow, wide) if azimuth.sense > 0.0 else _rounded(-wide, -narrow)


def loop_phase_bounds(certificate: RegimeCertificate) -> PhaseBounds:
    """Bounds of theta_M before the motion is computed, if Pi closes once round the axis just at the interval's end.

    Raises like `solid_angle_bounds`. Source: theory.md E13, E8.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 4.0], [0.1, 0.2, 2.0])
    >>> body = sp.rigid(np.diag([1.0, 2.0, 4.0]), top.period)
    >>> phase = sp.bounds.loop_phase_bounds(sp.bounds.regime_certificate(body, [0.1, 0.2, 2.0]))
    >>> phase.lower <= top.montgomery_phase <= phase.upper
    True
    """
    check_object(certificate, "RegimeCertificate", "certificate")
    dynamic, area = dynamic_phase_bounds(certificate.bounds), solid_angle_bounds(certificate)
    return PhaseBounds(lower=dynamic.lower - area.upper, upper=dynamic.upper - area.lower)


def _by_integrals(bounds: EnergyBounds, low: float, high: float) -> PhaseBounds:
    """Bounds of theta_D by those of the integral of E_t [J s]; zero without momentum."""
    if not bounds.magnitude:
        return PhaseBounds(lower=0.0, upper=0.0)
    stray = float(bounds.enclosure.widths @ bounds.enclosure.drift_magnitude)
    return _rounded(2.0 / bounds.magnitude * low - stray, 2.0 / bounds.magnitude * high + stray)


def _rounded(lower: float, upper: float) -> PhaseBounds:
    room = (ROUND_UP - 1.0) * (abs(lower) + abs(upper))
    return PhaseBounds(lower=lower - room, upper=upper + room)
