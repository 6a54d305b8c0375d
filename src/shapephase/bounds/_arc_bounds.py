"""Bounds of the length of Pi's curve, of the rate at which it circles an axis, and of the time until it returns.

All follow from `energy_bounds` and `regime_certificate`, before the motion is computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..letters import value_text
from ._enclosure import ROUND_UP
from ._energy_bounds import EnergyBounds, cross_product_bound
from .regimes import Regime, RegimeCertificate

_ROUND_DOWN = 2.0 - ROUND_UP  # for lower bounds


@dataclass(frozen=True, eq=False)
class ArcLengthBounds:
    """Upper bounds of the length of Pi's curve over an interval [kg m^2/s], ascending in sharpness.

    Made by `arc_length_bounds`.
    """

    general: float
    """l times the integral of (l + |L_o|)/I_1, I_1 the least moment; without L_o it is l^2 times that of 1/I_1."""
    by_drift: float
    """l times the integral of l/I_1 + |I^-1 L_o|."""
    by_energy: float
    """l times the integral of l sqrt((1/I_1 - e)(e - 1/I_3)) + |I^-1 L_o|, e = 2 E/l^2 anywhere in its bounds; zero for
    a body with three equal moments, whose momentum does not move."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class AzimuthBounds:
    """Bounds of the rate at which Pi circles the certified axis, on each of K cells. Made by `azimuth_bounds`."""

    sense: float
    """+1 counterclockwise seen from the tip of the axis ("about axis 3"), -1 clockwise ("about axis 1")."""
    slow: Array  #: (K,) lower bound of sense times the azimuth's rate [rad/s]; -inf where Pi may be on the axis.
    fast: Array
    """(K,) upper bound of sense times the azimuth's rate [rad/s]; infinite where Pi may be on the axis."""
    monotone: bool
    """Whether the azimuth is certain to change in one sense throughout."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class ReturnTimeBounds:
    """Lower bounds of the time after which Pi is first back at its start [s]; 0 where nothing is certain.

    Made by `return_time_bounds`.
    """

    by_latitude: float
    """2 pi |Pi x axis|/(l^2 max 1/I_1)."""
    by_inertia: float
    """2 pi/(l max (1/I_1 - 1/I_3)), at least `by_latitude`."""
    by_azimuth: float
    """When the fastest possible azimuth has gone once round, at least `by_inertia`."""
    within: bool
    """Whether Pi can be back in the interval at all; if not, all three are at most the interval's length."""
    latest: float
    """An upper bound of the time after which Pi has gone once round the axis; infinite where nothing is certain."""

    __repr__ = short_repr


def arc_length_bounds(bounds: EnergyBounds) -> ArcLengthBounds:
    """Bounds of the length of Pi's curve, from those of the energy.

    Source: Cabrera 2006, section 4.1; theory.md E6, E7.

    Examples
    --------
    >>> found = sp.bounds.energy_bounds(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.1, 0.2, 2.0])
    >>> found = sp.bounds.arc_length_bounds(found)
    >>> found.by_energy <= found.by_drift <= found.general
    True
    """
    check_object(bounds, "EnergyBounds", "bounds")
    known, magnitude = bounds.enclosure, bounds.magnitude
    low, high = bounds.quotients
    bottom, top = known.eigenvalues
    spread = [cross_product_bound(*row) for row in zip(bottom[:, 0], top[:, 2], low, high, strict=True)]

    def length(speed: Array) -> float:
        return float(known.widths @ speed) * magnitude * ROUND_UP

    return ArcLengthBounds(
        general=length(top[:, 2] * (magnitude + known.internal_momentum_magnitude)),
        by_drift=length(magnitude * top[:, 2] + known.drift_magnitude),
        by_energy=length(magnitude * np.array(spread) + known.drift_magnitude),
    )


def azimuth_rate(moments: ArrayLike, momentum: ArrayLike, axis: int = 0) -> Array:
    """Rate at which Pi circles a principal axis without internal momentum: (...) [rad/s].

    With axes k, i, j in cyclic order and Pi = l (cos(theta), sin(theta) cos(phi), sin(theta) sin(phi)) in them,

        phi' = l cos(theta) (1/I_i - 1/I_k + (1/I_j - 1/I_i) sin(phi)^2).

    Equation :eq:`azimuth` of the documentation.
    Source: Cabrera 2006, equation (14), with the factor l missing there (theory.md C-E4); E10.
    Raises ShapeError along the axis, where there is no azimuth, and for a moment that is not above zero.

    Parameters
    ----------
    moments : (..., 3) about the three axes [kg m^2]
    momentum : (..., 3) Pi in those axes [kg m^2/s], not along axis k
    axis : k, 0 to 2

    Examples
    --------
    >>> print(f"{sp.bounds.azimuth_rate([1.0, 2.0, 4.0], [0.1, 0.0, 1.0], 2):.6f} rad/s")
    0.750000 rad/s
    """
    values, pi = finite_array(moments, "moments", (3,), unit="kg m^2"), finite_array(momentum, "momentum", (3,))
    if isinstance(axis, bool) or not isinstance(axis, int | np.integer) or axis not in (0, 1, 2):
        raise ShapeError(f"axis: 0, 1 or 2 is needed, got {value_text(axis)}")
    if np.any(values <= 0.0):
        raise ShapeError(f"moments: all must be above 0 [kg m^2], got {values.min():.6g}")
    second, third = (axis + 1) % 3, (axis + 2) % 3
    across = np.hypot(pi[..., second], pi[..., third])
    if np.any(across == 0.0):
        raise ShapeError(f"momentum: along axis {axis} there is no azimuth about it")
    sine = pi[..., third] / across
    first = 1.0 / values[..., second]
    return pi[..., axis] * (first - 1.0 / values[..., axis] + (1.0 / values[..., third] - first) * sine**2)


def azimuth_bounds(certificate: RegimeCertificate) -> AzimuthBounds:
    """Bounds of the azimuth's rate about a certified axis, for any deformation.

    With n the part of I^-1 that couples the axis with the plane across, A' the part of I^-1 in that plane, p the
    direction of Pi in it, and w = I^-1 L_o, phi' = Pi_k (p.A'p - 1/I_k) up to (l |n| + |w|)/sin(theta).

    Source: Cabrera 2006, equation (14) with theory.md C-E4; E10, E12.
    Raises ShapeError if no axis is certain.

    Examples
    --------
    >>> certificate = sp.bounds.regime_certificate(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.1, 0.2, 2.0])
    >>> sp.bounds.azimuth_bounds(certificate).monotone
    True
    """
    check_object(certificate, "RegimeCertificate", "certificate")
    if not certificate.certain:
        raise ShapeError(f"certificate: a certain axis is needed, but {certificate.why}")
    bounds, axis = certificate.bounds, certificate.axis
    known, magnitude = bounds.enclosure, bounds.magnitude
    sign = 1.0 if certificate.regime == Regime.ABOUT_SMALLEST else -1.0
    along, across, coupling = known.about(axis, sign)
    least, greatest = certificate.cosines
    sine = np.sqrt(np.maximum(0.0, 1.0 - greatest**2))
    with np.errstate(divide="ignore"):
        stray = (magnitude * coupling + known.drift_magnitude) / sine
    near, far = along[:, 0] - across[:, 1], along[:, 1] - across[:, 0]
    fast = (magnitude * greatest * far + stray) * ROUND_UP
    slow = (magnitude * np.where(near > 0.0, least, greatest) * near - stray) - (ROUND_UP - 1.0) * fast
    return AzimuthBounds(sense=-sign, slow=slow, fast=fast, monotone=bool(np.all(slow > 0.0)))


def return_time_bounds(certificate: RegimeCertificate) -> ReturnTimeBounds:
    """Lower bounds of the time until Pi is back at its start, for which it must go once round the certified axis.

    The formulas of the first two bounds hold for fixed principal axes without internal momentum. For other
    deformations they are lowered where the fastest possible azimuth exceeds the rate they assume. They hold about the
    axis of the largest moment, too, with the least moment in them.

    Source: Cabrera 2006, remark 4.1, as corrected in theory.md C-E10; E12.

    Equation :eq:`return-time` of the documentation.

    Examples
    --------
    >>> body = sp.rigid(np.diag([1.0, 2.0, 4.0]), 30.0)
    >>> found = sp.bounds.return_time_bounds(sp.bounds.regime_certificate(body, [0.1, 0.2, 2.0]))
    >>> top = sp.EulerTop.principal([1.0, 2.0, 4.0], [0.1, 0.2, 2.0])
    >>> print(f"{found.by_latitude:.4f}, {found.by_inertia:.4f}, {found.by_azimuth:.4f} <= {top.period:.4f} s")
    0.3469, 4.1629, 4.1749 <= 7.2522 s
    """
    check_object(certificate, "RegimeCertificate", "certificate")
    known = certificate.bounds.enclosure
    azimuth = azimuth_bounds(certificate) if certificate.certain else None
    # Where the azimuth may stop or turn back, Pi may be back at its start without having gone round the axis.
    if azimuth is None or not azimuth.monotone:
        return ReturnTimeBounds(by_latitude=0.0, by_inertia=0.0, by_azimuth=0.0, within=True, latest=np.inf)
    bottom, top = known.eigenvalues
    magnitude = certificate.bounds.magnitude
    most, spread = magnitude * float(top[:, 2].max()), magnitude * float((top[:, 2] - bottom[:, 0]).max())
    fastest = float(azimuth.fast.max())
    sine = float(np.linalg.norm(np.cross(certificate.start, certificate.axis))) * _ROUND_DOWN
    by_azimuth = _time_of_full_turn(azimuth.fast, known.widths) * _ROUND_DOWN
    by_inertia = 2.0 * np.pi / (spread + max(0.0, fastest - spread)) * _ROUND_DOWN
    by_latitude = 2.0 * np.pi * sine / max(most, fastest) * _ROUND_DOWN
    within = bool(np.isfinite(by_azimuth))
    cap = float(by_azimuth) if within else float(known.widths.sum())
    return ReturnTimeBounds(
        by_latitude=min(by_latitude, cap),
        by_inertia=min(by_inertia, cap),
        by_azimuth=cap,
        within=within,
        latest=_time_of_full_turn(azimuth.slow, known.widths) * ROUND_UP,
    )


def _time_of_full_turn(rates: Array, widths: Array) -> float:
    """Time at which the integral of positive rates reaches 2 pi; infinite if it does not."""
    turned = np.concatenate([[0.0], np.cumsum(rates * widths)])
    if turned[-1] < 2.0 * np.pi:
        return np.inf
    cell = int(np.searchsorted(turned, 2.0 * np.pi)) - 1
    return float(widths[:cell].sum() + (2.0 * np.pi - turned[cell]) / rates[cell])
