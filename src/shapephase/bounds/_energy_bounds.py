"""Bounds of the energy E_t of a motion that has not been computed.

With u = Pi/l and e = u.I^-1 u = 2 E/l^2, equation (9) gives

    de/dt = u.(I^-1)' u + 2 (u x I^-1 u).w,    w = I^-1 L_o,

which depends on the unknown u. On a cell of time all that is known of u is that e is in [e-, e+]; so for every number c

    u.(I^-1)' u  <=  greatest eigenvalue of ((I^-1)' + c I^-1)  -  c e-  (c >= 0)  or  - c e+  (c < 0),

and |u x I^-1 u|^2 <= (a - e)(e - b), a and b the extreme eigenvalues of I^-1. By Brickman's theorem the best c gives
exactly the largest possible rate; the two bounds of e are propagated from cell to cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import body_momentum_argument, check_object, made_by, number_argument
from ..arrays import Array
from ..deformation.deformation import Deformation
from ..display import short_repr
from ._enclosure import RESOLUTION, ROUND_UP, ROUNDING, Enclosure, enclosure


@made_by("bounds.energy_bounds(deformation, momentum)")
@dataclass(frozen=True, eq=False)
class EnergyBounds:
    """Bounds of E_t along every solution from one initial momentum, on each of K cells of time.

    Made by `energy_bounds`.
    """

    enclosure: Enclosure
    """Bounds of the deformation."""
    magnitude: float
    """l, the momentum's norm [kg m^2/s]."""
    initial: Array
    """(2,) bounds of E at the start of the interval, apart by rounding and the error of sampling [J]."""
    lower: Array  #: (K,) lower bound of E on each cell [J].
    upper: Array
    """(K,) upper bound of E on each cell [J]."""
    rate_lower: Array  #: (K,) lower bound of dE/dt on each cell [W].
    rate_upper: Array
    """(K,) upper bound of dE/dt on each cell [W]."""

    __repr__ = short_repr

    @property
    def least(self) -> float:
        """The lower bound of E over the whole interval [J]."""
        return float(self.lower.min())

    @property
    def greatest(self) -> float:
        """The upper bound of E over the whole interval [J]."""
        return float(self.upper.max())

    @property
    def quotients(self) -> tuple[Array, Array]:
        """Bounds of e = 2 E/l^2 on the cells: (K,), (K,) [1/(kg m^2)]; those of the eigenvalues without momentum."""
        if not self.magnitude:
            low, high = self.enclosure.eigenvalues
            return low[:, 0], high[:, 2]
        # Divided twice, because l^2 may underflow or overflow where the quotient does not.
        low, high = (2.0 * energy / self.magnitude / self.magnitude for energy in (self.lower, self.upper))
        return low, high


def energy_bounds(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    interval: tuple[float, float] | None = None,
    *,
    resolution: float = RESOLUTION,
) -> EnergyBounds:
    """Bounds of the energy E_t = Pi.I^-1 Pi/2 over an interval, before any motion is computed.

    Source: Cabrera 2006, section 4.1 (the rate of E_t); theory.md E3, E9.
    Raises ShapeError; AccuracyNotReached if the deformation is too rough between its breaks to be sampled.

    Parameters
    ----------
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    attitude : (3, 3) at the start of the interval; None: the identity
    interval : (start, end) [s]; None: [0, duration]
    resolution : least relative change of the channels for which a cell of time is halved; smaller is sharper and slower

    Examples
    --------
    >>> found = sp.bounds.energy_bounds(sp.rigid(np.diag([1.0, 2.0, 4.0]), 3.0), [0.0, 0.0, 2.0])
    >>> print(f"{found.lower.min():.6f} to {found.upper.max():.6f} J")
    0.500000 to 0.500000 J
    """
    check_object(deformation, "Deformation", "deformation")
    resolution = number_argument(resolution, "resolution")
    body = body_momentum_argument(momentum, attitude)
    magnitude = float(np.linalg.norm(body))
    known = enclosure(deformation, interval, magnitude=magnitude, resolution=resolution)
    if not magnitude:
        zero = np.zeros(len(known.widths))
        return EnergyBounds(known, 0.0, np.zeros(2), zero, zero, zero, zero)
    direction = body / magnitude @ known.frame
    e = float(direction @ known.start @ direction)
    room = known.start_radius * ROUND_UP + ROUNDING * abs(e)
    lower, upper, slow, fast = _propagated(known, e - room, e + room)
    half = 0.5 * magnitude * magnitude
    rounding = ROUNDING * half * np.abs(upper)
    return EnergyBounds(
        enclosure=known,
        magnitude=magnitude,
        initial=half * np.array([e - room, e + room]),
        lower=half * lower - rounding,
        upper=half * upper + rounding,
        rate_lower=half * slow,
        rate_upper=half * fast,
    )


def _propagated(known: Enclosure, low: float, high: float) -> tuple[Array, Array, Array, Array]:
    """Bounds of e and of its rate on every cell, from those at the start."""
    least, greatest = (values[:, i].tolist() for values, i in zip(known.eigenvalues, (0, 2), strict=True))
    slowest, fastest = known.inverse_rate_range
    rising, falling = _lines(known, fastest), _lines(known, -slowest)
    drift = known.drift_magnitude.tolist()
    rows = []
    for cell, width in enumerate(known.widths.tolist()):
        bottom, top = least[cell], greatest[cell]
        # At first with any direction u, then with those that the last bounds leave; after three passes the change is
        # of third order in the cell's length.
        inner = bottom, top
        slow, fast = 0.0, 0.0
        for _ in range(3):
            by_drift = 2.0 * drift[cell] * cross_product_bound(bottom, top, *inner) if drift[cell] else 0.0
            fast = _lowest(rising[cell], *inner) + by_drift
            slow = -_lowest(falling[cell], *inner) - by_drift
            inner = max(bottom, low + min(0.0, slow * width)), min(top, high + max(0.0, fast * width))
        rows.append((*inner, slow, fast))
        slip = ROUNDING * top
        low, high = max(bottom, low + slow * width - slip), min(top, high + fast * width + slip)
    lower, upper, slow, fast = np.array(rows).T
    return lower - ROUNDING * np.abs(lower), upper + ROUNDING * np.abs(upper), slow, fast


def _lines(known: Enclosure, rate: Array) -> list[list[tuple[float, float]]]:
    """Slopes c and greatest eigenvalues of rate + c I^-1, for the c at which two of its eigenvalues cross.

    Every c gives a true bound; these are the best ones where I^-1 and its rate have common axes.
    """
    lower, upper = known.inverse_range
    values, axes = np.linalg.eigh(known.inverse)
    along = np.einsum("kji,kjl,kli->ki", axes, rate, axes)
    rise, run = along - np.roll(along, 1, axis=1), values - np.roll(values, 1, axis=1)
    # Closer eigenvalues give no slope, a quotient of two small differences; the bound is then less sharp.
    apart = np.abs(run) > 1e-3 * values[:, 2:]
    slopes = np.concatenate([np.zeros((len(rate), 1)), np.where(apart, -rise / np.where(apart, run, 1.0), 0.0)], axis=1)
    cut = slopes[..., None, None]
    tops = np.linalg.eigvalsh(rate[:, None] + np.where(cut >= 0.0, cut * upper[:, None], cut * lower[:, None]))
    room = ROUNDING * np.abs(tops).max(axis=-1)
    return np.stack([slopes, tops[..., 2] + room], axis=-1).tolist()


def _lowest(lines: list[tuple[float, float]], low: float, high: float) -> float:
    """The lowest of the upper bounds of u.(I^-1)' u that the lines give for e in [low, high]."""
    return min(top - slope * (low if slope >= 0.0 else high) for slope, top in lines)


def cross_product_bound(bottom: float, top: float, low: float, high: float) -> float:
    """The largest value of |u x A u| for eigenvalues of A in [bottom, top] and u.Au in [low, high].

    Its square is u.A^2 u - (u.A u)^2, a variance, and at most (top - u.Au)(u.Au - bottom).
    """
    e = min(max(0.5 * (bottom + top), low), high)
    return max(0.0, (top - e) * (e - bottom)) ** 0.5 * (1.0 + ROUNDING)
