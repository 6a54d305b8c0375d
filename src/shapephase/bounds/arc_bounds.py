"""Bounds of how far Pi gets on its sphere, how fast it goes round an axis, and how soon it can be back.

All follow from what `energy_bounds` and `regime_certificate` know before the motion is computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, finite_array
from ..errors import ShapeError
from ._energy_bounds import EnergyBounds, turning
from .regimes import ABOUT_SMALLEST, RegimeCertificate

_ROUND_UP = 1.0 + 1e-12
_ROUND_DOWN = 1.0 - 1e-12


@dataclass(frozen=True, eq=False)
class ArcLengthBounds:
    """Upper bounds of the length of Pi's curve over an interval [kg m^2/s], each sharper than the one before.

    Attributes
    ----------
    general : l times the integral of (l + |L_o|)/I_1, I_1 the least moment; without L_o it is l^2 times that of 1/I_1
    by_drift : l times the integral of l/I_1 + |I^-1 L_o|
    by_energy : l times the integral of l sqrt((1/I_1 - e)(e - 1/I_3)) + |I^-1 L_o|, e = 2 E/l^2 anywhere in its bounds;
        zero for a body with three equal moments, whose momentum stands still
    """

    general: float
    by_drift: float
    by_energy: float


@dataclass(frozen=True, eq=False)
class AzimuthBounds:
    """Bounds of the rate at which Pi goes round the certified axis, on each of K cells.

    Attributes
    ----------
    sense : +1 counterclockwise seen from the tip of the axis ("about axis 3"), -1 clockwise ("about axis 1")
    slow, fast : (K,) of sense times the azimuth's rate [rad/s]; infinite where Pi may be on the axis
    monotone : whether the azimuth is certain to change in one sense throughout
    """

    sense: float
    slow: Array
    fast: Array
    monotone: bool


@dataclass(frozen=True, eq=False)
class ReturnTimeBounds:
    """Lower bounds of the time after which Pi is first back at its start [s]; 0 where nothing is certain.

    Attributes
    ----------
    by_latitude : 2 pi |Pi x axis|/(l^2 max 1/I_1)
    by_inertia : 2 pi/(l max (1/I_1 - 1/I_3)), never less
    by_azimuth : when the fastest azimuth has gone round, never less
    within : whether Pi can be back in the interval at all; if not, all three are at most the interval's length
    latest : an upper bound of the time after which Pi has gone once round the axis; infinite where nothing is certain
    """

    by_latitude: float
    by_inertia: float
    by_azimuth: float
    within: bool
    latest: float


def arc_length_bounds(bounds: EnergyBounds) -> ArcLengthBounds:
    """Bounds of the length of Pi's curve, from those of the energy.

    Source: Cabrera 2006, section 4.1; theory.md E6, E7.
    """
    known, size = bounds.enclosure, bounds.size
    low, high = bounds.quotients
    bottom, top = known.eigenvalues
    spread = [turning(*row) for row in zip(bottom[:, 0], top[:, 2], low, high, strict=True)]
    rates = (
        top[:, 2] * (size + known.internal_momentum_size),
        size * top[:, 2] + known.drift_size,
        size * np.array(spread) + known.drift_size,
    )
    return ArcLengthBounds(*(float(known.widths @ rate) * size * _ROUND_UP for rate in rates))


def azimuth_rate(moments: ArrayLike, momentum: ArrayLike, axis: int = 0) -> Array:
    """How fast Pi goes round a principal axis without internal momentum: (...) [rad/s].

    With axes k, i, j in cyclic order and Pi = l (cos(theta), sin(theta) cos(phi), sin(theta) sin(phi)) in them,

        phi' = l cos(theta) (1/I_i - 1/I_k + (1/I_j - 1/I_i) sin(phi)^2).

    Parameters
    ----------
    moments : (..., 3) about the three axes [kg m^2]
    momentum : (..., 3) Pi in those axes [kg m^2/s], not along axis k
    axis : k, 0 to 2

    Raises
    ------
    ShapeError
        Along the axis, where there is no azimuth, and for a moment that is not above zero.

    Source: Cabrera 2006, equation (14), with the l it lacks (theory.md C-E4); E10.
    """
    values, pi = finite_array(moments, "moments", (3,), unit="kg m^2"), finite_array(momentum, "momentum", (3,))
    if isinstance(axis, bool) or axis not in (0, 1, 2):
        raise ShapeError(f"axis: 0, 1 or 2 is needed, got {axis!r}")
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

    With n the coupling of the axis with the plane across in I^-1, A' the part of I^-1 in it, and w = I^-1 L_o,
    phi' = Pi_k (p.A'p - 1/I_k), p the unit vector across, up to (l |n| + |w|)/sin(theta).

    Raises
    ------
    ShapeError
        If no axis is certain.

    Source: Cabrera 2006, equation (14) with theory.md C-E4; E10, E12.
    """
    if not certificate.certain:
        raise ShapeError(f"certificate: an axis that is certain is needed, and {certificate.why}")
    bounds, axis = certificate.bounds, certificate.axis
    known, size = bounds.enclosure, bounds.size
    sign = 1.0 if certificate.regime == ABOUT_SMALLEST else -1.0
    along, across, coupling = known.about(axis, sign)
    least, greatest = certificate.cosines
    sine = np.sqrt(np.maximum(0.0, 1.0 - greatest**2))
    with np.errstate(divide="ignore"):
        stray = (size * coupling + known.drift_size) / sine
    near, far = along[:, 0] - across[:, 1], along[:, 1] - across[:, 0]
    fast = (size * greatest * far + stray) * _ROUND_UP
    slow = (size * np.where(near > 0.0, least, greatest) * near - stray) - 1e-12 * fast
    return AzimuthBounds(-sign, slow, fast, bool(np.all(slow > 0.0)))


def return_time_bounds(certificate: RegimeCertificate) -> ReturnTimeBounds:
    """How soon Pi can be back at its start: it must go round the certified axis for that.

    The first two bounds are for principal axes that stay where they are without internal momentum; they are also
    given wherever the azimuth is certain not to go faster than they take it to. About the axis of the largest moment
    they are the same, with the least moment in them.

    Source: Cabrera 2006, remark 4.1, read as theory.md C-E10 says; E12.
    """
    known = certificate.bounds.enclosure
    length = float(known.widths.sum())
    nothing = ReturnTimeBounds(0.0, 0.0, 0.0, True, np.inf)
    if not certificate.certain:
        return nothing
    azimuth = azimuth_bounds(certificate)
    # Standing still on the axis, or going back and forth: then Pi may be back without going round.
    if not azimuth.monotone:
        return nothing
    bottom, top = known.eigenvalues
    size = certificate.bounds.size
    most, spread = size * float(top[:, 2].max()), size * float((top[:, 2] - bottom[:, 0]).max())
    fastest = float(azimuth.fast.max())
    sine = float(np.linalg.norm(np.cross(certificate.start, certificate.axis))) * _ROUND_DOWN
    by_azimuth = _when(azimuth.fast, known.widths, 2.0 * np.pi) * _ROUND_DOWN
    room = max(0.0, fastest - spread)
    by_inertia = 2.0 * np.pi / (spread + room) * _ROUND_DOWN
    by_latitude = 2.0 * np.pi * sine / max(most, fastest) * _ROUND_DOWN
    within = np.isfinite(by_azimuth)
    cap = float(by_azimuth) if within else length
    return ReturnTimeBounds(
        min(by_latitude, cap),
        min(by_inertia, cap),
        cap,
        bool(within),
        _when(azimuth.slow, known.widths, 2.0 * np.pi) * _ROUND_UP,
    )


def _when(rates: Array, widths: Array, goal: float) -> float:
    """When the integral of positive rates reaches a goal; infinite if it does not."""
    turned = np.concatenate([[0.0], np.cumsum(rates * widths)])
    if turned[-1] < goal:
        return np.inf
    cell = int(np.searchsorted(turned, goal)) - 1
    return float(widths[:cell].sum() + (goal - turned[cell]) / rates[cell])
