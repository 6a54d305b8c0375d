"""Certificate of the principal axis that a free body's momentum circles, before the motion is computed.

Pi can only get from one side of a plane through the body's centre to the other by crossing it, and there its energy is
at most l^2/2 times the greatest eigenvalue of I^-1 in that plane. So as long as E_t stays above that, Pi stays on its
side; and likewise below the least. For fixed principal axes this compares E_t with the homoclinic energy
l^2/(2 I_2(t)), at each time and not only their extremes; but it holds for any deformation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import body_momentum_argument, made_by
from ..arrays import Array, Mask, finite_array
from ..deformation.deformation import Deformation
from ..display import short_repr
from ._enclosure import RESOLUTION, Enclosure
from ._energy_bounds import EnergyBounds, energy_bounds

_CHUNK = 2_000_000  # directions times cells that are compared at once: some 100 MB of arrays


class Regime(StrEnum):
    """Principal axis that the momentum circles; axis 1 is that of the smallest moment, axis 3 of the largest.

    Examples
    --------
    >>> [regime.name for regime in sp.bounds.Regime]
    ['ABOUT_SMALLEST', 'ABOUT_LARGEST', 'MAY_CROSS']
    """

    ABOUT_SMALLEST = "about axis 1"
    ABOUT_LARGEST = "about axis 3"
    MAY_CROSS = "may cross"


@made_by("bounds.regime_certificate(deformation, momentum)")
@dataclass(frozen=True, eq=False)
class RegimeCertificate:
    """Axis that Pi circles over an interval, if certain before the motion is computed. Made by `regime_certificate`."""

    regime: Regime
    """ "about axis 1" (of the smallest moment), "about axis 3" (of the largest), or "may cross"."""
    axis: Array
    """(3,) unit vector, body axes: Pi . axis > 0 throughout; for "may cross" the one nearest to being certain."""
    margin: float
    """The least distance of E_t above the greatest energy (below the least energy) possible on the plane across the
    axis; negative where the regime is not certain [J]."""
    energy: tuple[float, float]
    """(2,) bounds of E_t over the interval [J]."""
    threshold: tuple[float, float]
    """(2,) bounds of the homoclinic energy l^2/(2 I_2(t)) over the interval [J]."""
    interval: tuple[float, float]
    """(start, end) [s]."""
    start: Array
    """(3,) Pi/l at the start of the interval, zero without momentum."""
    bounds: EnergyBounds
    """Bounds of the energy, cell by cell."""
    plane: Array
    """(K,) on each cell the energy that Pi would need to cross the plane [J]."""
    why: str
    """The reason, as a sentence."""

    __repr__ = short_repr

    @property
    def certain(self) -> bool:
        """True if Pi stays on one side of the plane across the axis."""
        return self.regime != Regime.MAY_CROSS

    @property
    def cosines(self) -> tuple[Array, Array]:
        """Bounds on each cell of Pi . axis / l: (K,), (K,); -1 and 1 where nothing is certain."""
        known = self.bounds.enclosure
        if not self.certain:
            ones = np.ones(len(known.widths))
            return -ones, ones
        sign = 1.0 if self.regime == Regime.ABOUT_SMALLEST else -1.0
        low, high = self.bounds.quotients if sign > 0.0 else (-values for values in self.bounds.quotients[::-1])
        along, across, coupling = known.about(self.axis, sign)
        # e = x along + (1 - x) across + 2 sqrt(x (1 - x)) coupling, x the cosine's square; 2 sqrt(...) <= 1.
        least = _share(low - coupling - across[:, 1], along[:, 1] - across[:, 1], 0.0)
        greatest = _share(high + coupling - across[:, 0], along[:, 0] - across[:, 0], 1.0)
        # Rounding of squared cosines: below 100 eps, and absolute where they vanish.
        wider = 1.0 + 1e-13
        return np.sqrt(np.clip(least / wider, 0.0, 1.0)), np.sqrt(np.clip(greatest * wider + 1e-15, 0.0, 1.0))


@made_by("bounds.crown_region(deformation, momentum)")
@dataclass(frozen=True, eq=False)
class CrownRegion:
    """Part of the momentum sphere that Pi can reach over an interval. Made by `crown_region`.

    The union over time of the level sets of E_t between its bounds at that time; where the regime is certain, only the
    part on the side of the axis. The region R of the paper is wider: it takes the bounds over the whole interval at
    every time, and the connected component of the start (`contains_as_printed`).
    """

    certificate: RegimeCertificate
    """Where the bounds come from."""

    __repr__ = short_repr

    def contains(self, momenta: ArrayLike) -> Mask:
        """True where Pi may be at some time of the interval: (..., 3), of any norm above 0 -> (...)."""
        low, high = self.certificate.bounds.quotients
        axis = self.certificate.axis if self.certificate.certain else None
        return self._between(
            momenta, lambda least, greatest: np.any((greatest >= low) & (least <= high), axis=-1), axis
        )

    def contains_as_printed(self, momenta: ArrayLike) -> Mask:
        """True in the paper's region R: (..., 3), of any norm above 0 -> (...).

        The union over time of the level sets of E_t between E_min and E_max, bounds over the whole interval, of which R
        is the connected component of the start. That is one side of a plane through the centre where E_min or E_max
        keeps the momentum off the plane at all times; for inertias with fixed axes there is no other way to come apart.

        Source: Cabrera 2006, section 4.1.1; theory.md C-E5, E8.
        """
        bounds = self.certificate.bounds
        lowest, highest = float(bounds.quotients[0].min()), float(bounds.quotients[1].max())
        low, high = np.full(len(bounds.lower), lowest), np.full(len(bounds.lower), highest)
        margin, _, axis, _ = _widest_margin(bounds.enclosure, low, high)
        side = np.copysign(1.0, self.certificate.start @ axis) * axis
        return self._between(
            momenta,
            lambda least, greatest: (greatest.max(axis=-1) >= lowest) & (least.min(axis=-1) <= highest),
            side if margin > 0.0 and bounds.magnitude > 0.0 else None,
        )

    def _between(self, momenta: ArrayLike, condition: Callable[[Array, Array], Mask], side: Array | None) -> Mask:
        """True for momenta other than zero whose bounds of e on the cells meet a condition, on one side of a plane."""
        vectors = finite_array(momenta, "momenta", (3,))
        flat = vectors.reshape(-1, 3)
        magnitude = np.linalg.norm(flat, axis=1, keepdims=True)
        directions = np.divide(flat, magnitude, out=np.zeros_like(flat), where=magnitude > 0.0)
        inside = magnitude[:, 0] > 0.0
        known = self.certificate.bounds.enclosure
        step = max(1, _CHUNK // len(known.widths))
        for start in range(0, len(flat), step):
            rows = slice(start, start + step)
            inside[rows] &= condition(*known.quadratic(directions[rows]))
        if side is not None:
            inside &= directions @ side > 0.0
        return inside.reshape(vectors.shape[:-1])[()]

    @property
    def cosines(self) -> tuple[float, float]:
        """Least and greatest Pi . axis / l over the interval."""
        low, high = self.certificate.cosines
        return float(low.min()), float(high.max())


def regime_certificate(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    interval: tuple[float, float] | None = None,
    *,
    resolution: float = RESOLUTION,
) -> RegimeCertificate:
    """Principal axis that the momentum of a deforming body circles over an interval, if that is certain.

    No motion is computed: E_t, and the energy at which Pi could cross to the other side, are bounded over the interval.

    Raises like `energy_bounds`.

    Source: Cabrera 2006, section 4.1.1, cases 1 to 3, with the threshold l^2/(2 I_2) (theory.md C-E5); E9.

    Parameters
    ----------
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    attitude : (3, 3) at the start of the interval; None: the identity
    interval : (start, end) [s]; None: [0, duration]
    resolution : least relative change of the channels for which a cell of time is halved; smaller is sharper and slower

    Examples
    --------
    >>> certificate = sp.bounds.regime_certificate(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.1, 0.2, 2.0])
    >>> certificate.regime.name, certificate.certain, certificate.axis.tolist()
    ('ABOUT_LARGEST', True, [0.0, 0.0, 1.0])
    """
    bounds = energy_bounds(deformation, momentum, attitude, interval, resolution=resolution)
    body = body_momentum_argument(momentum, attitude)
    known = bounds.enclosure
    low, high = bounds.quotients
    half = 0.5 * bounds.magnitude * bounds.magnitude
    margin, sign, axis, plane = _widest_margin(known, low, high)
    if margin <= 0.0 or bounds.magnitude == 0.0:
        regime = Regime.MAY_CROSS
    else:
        regime = Regime.ABOUT_SMALLEST if sign > 0.0 else Regime.ABOUT_LARGEST
    middle_low, middle_high = (values[:, 1] for values in known.eigenvalues)
    return RegimeCertificate(
        regime=regime,
        axis=np.copysign(1.0, body @ axis) * axis,
        margin=half * margin,
        energy=(bounds.least, bounds.greatest),
        threshold=(half * float(middle_low.min()), half * float(middle_high.max())),
        interval=(float(known.edges[0]), float(known.edges[-1])),
        start=body / bounds.magnitude if bounds.magnitude else np.zeros(3),
        bounds=bounds,
        plane=half * plane,
        why=_reason(regime, half * margin, bounds, known, low - plane if sign > 0.0 else plane - high),
    )


def crown_region(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    interval: tuple[float, float] | None = None,
) -> CrownRegion:
    """The part of the momentum sphere that Pi can reach over an interval; arguments and errors of `regime_certificate`.

    Source: Cabrera 2006, section 4.1.1; theory.md E8.

    Examples
    --------
    >>> crown = sp.bounds.crown_region(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.1, 0.2, 2.0])
    >>> crown.contains([[0.1, 0.2, 2.0], [2.0, 0.2, 0.1]]).tolist()
    [True, False]
    """
    return CrownRegion(regime_certificate(deformation, momentum, attitude, interval))


def _widest_margin(known: Enclosure, low: Array, high: Array) -> tuple[float, float, Array, Array]:
    """The axis and the side of the energy with the widest margin of e, from its bounds on the cells.

    Returns
    -------
    margin : the least over the cells [1/(kg m^2)]
    sign : +1 where e must stay above its values on the plane across the axis, -1 below
    axis : (3,) body axes
    plane : (K,) the greatest (least) e on that plane [1/(kg m^2)]
    """
    best = (-np.inf, 1.0, np.array([0.0, 0.0, 1.0]), np.zeros(len(low)))
    for axis in _candidates(known):
        for sign in (1.0, -1.0):
            plane = known.about(axis, sign)[1][:, 1]
            margin = float(((low if sign > 0.0 else -high) - plane).min())
            if margin > best[0]:
                best = (margin, sign, axis, sign * plane)
    return best


def _candidates(known: Enclosure) -> list[Array]:
    """Principal axes at times spread over the interval."""
    # Any axis gives a true certificate; between nine times the axes of a deformation in one regime hardly move.
    picked = known.inverse[np.unique(np.linspace(0, len(known.inverse) - 1, 9).astype(int))]
    axes = list(known.frame.T)
    for frame in np.linalg.eigh(picked)[1]:
        for axis in (known.frame @ frame).T:
            if not any(abs(axis @ other) > 1.0 - 1e-9 for other in axes):
                axes.append(axis)
    return axes


def _share(numerator: Array, whole: Array, otherwise: float) -> Array:
    """numerator/whole where whole > 0, else `otherwise`."""
    known = whole > 0.0
    return np.where(known, numerator / np.where(known, whole, 1.0), otherwise)


def _reason(regime: Regime, margin: float, bounds: EnergyBounds, known: Enclosure, distance: Array) -> str:
    if not bounds.magnitude:
        return "there is no angular momentum that could circle an axis"
    if regime == Regime.MAY_CROSS:
        when = known.edges[int(np.argmin(distance))]
        return (
            f"from t = {when:.6g} s on it is not certain that the energy stays away from the homoclinic energy: the "
            f"bounds of the two overlap there by {-margin:.3g} J"
        )
    side, extreme = ("above", "greatest") if regime == Regime.ABOUT_SMALLEST else ("below", "least")
    slack = 1e-6 * bounds.greatest / float(known.widths.sum())
    falls, rises = np.all(bounds.rate_upper <= slack), np.all(bounds.rate_lower >= -slack)
    change = "stays" if falls == rises else "falls but stays" if falls else "rises but stays"
    return (
        f"the energy {change} {side} the {extreme} value possible on the plane across the axis (l^2/(2 I_2) for a "
        f"principal axis) by at least {margin:.3g} J"
    )
