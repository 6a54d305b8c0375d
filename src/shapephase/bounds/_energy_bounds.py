"""Bounds of the energy E_t of a motion that has not been computed.

With u = Pi/l and e = u.I^-1 u = 2 E/l^2, equation (9) gives

    de/dt = u.(I^-1)' u + 2 (u x I^-1 u).w,    w = I^-1 L_o,

which depends on the unknown u. On a cell of time u is only known to satisfy e in [e-, e+]; so for every number c

    u.(I^-1)' u  <=  greatest eigenvalue of ((I^-1)' + c I^-1)  -  c e-  (c >= 0)  or  - c e+  (c < 0),

and |u x I^-1 u|^2 <= (a - e)(e - b), a and b the extreme eigenvalues of I^-1. By Brickman's theorem the best c gives
the largest rate there is; the two bounds of e are followed from cell to cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import body_momentum_argument
from ..arrays import Array
from ..deformation.deformation import Deformation
from ._enclosure import Enclosure, enclosure

_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class EnergyBounds:
    """Bounds of E_t along every solution from one initial momentum, on each of K cells of time.

    Attributes
    ----------
    enclosure : what is known of the deformation
    size : l, the momentum's size [kg m^2/s]
    initial : E at the start of the interval, as far as rounding and sampling go its bounds: (2,) [J]
    lower, upper : (K,) of E on each cell [J]
    rate_lower, rate_upper : (K,) of dE/dt [W]
    """

    enclosure: Enclosure
    size: float
    initial: Array
    lower: Array
    upper: Array
    rate_lower: Array
    rate_upper: Array

    @property
    def least(self) -> float:
        """[J] over the whole interval."""
        return float(self.lower.min())

    @property
    def greatest(self) -> float:
        """[J] over the whole interval."""
        return float(self.upper.max())

    @property
    def quotients(self) -> tuple[Array, Array]:
        """Bounds of e = 2 E/l^2 on the cells: (K,), (K,) [1/(kg m^2)]; those of the eigenvalues without momentum."""
        if not self.size:
            low, high = self.enclosure.eigenvalues
            return low[:, 0], high[:, 2]
        # The ratio l^2/2 may under- or overflow no earlier than E itself.
        return 2.0 * self.lower / self.size / self.size, 2.0 * self.upper / self.size / self.size


def energy_bounds(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    interval: tuple[float, float] | None = None,
    *,
    resolution: float = 5e-3,
) -> EnergyBounds:
    """Bounds of the energy E_t = Pi.I^-1 Pi/2 over an interval, before any motion is computed.

    Parameters
    ----------
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    attitude : (3, 3) at the start of the interval; None: the identity
    interval : (start, end) [s]; None: [0, duration]
    resolution : as for `enclosure`

    Raises
    ------
    ShapeError
        For arguments of the wrong shape, an attitude that is no rotation, or times outside of the deformation.
    AccuracyNotReached
        If the deformation is too rough between its breaks to be sampled.

    Source: Cabrera 2006, section 4.1 (the rate of E_t); theory.md E3, E9.
    """
    body = body_momentum_argument(momentum, attitude)
    size = float(np.linalg.norm(body))
    known = enclosure(deformation, interval, momentum_size=size, resolution=resolution)
    if not size:
        zero = np.zeros(len(known.widths))
        return EnergyBounds(known, size, np.zeros(2), zero, zero, zero, zero)
    direction = body / size @ known.frame
    e = float(direction @ known.start @ direction)
    room = known.start_radius * (1.0 + 1e-12) + 32.0 * _EPS * abs(e)
    lower, upper, slow, fast = _followed(known, e - room, e + room)
    half = 0.5 * size * size
    grow = 8.0 * _EPS * half * np.abs(upper)
    return EnergyBounds(
        known,
        size,
        half * np.array([e - room, e + room]),
        half * lower - grow,
        half * upper + grow,
        half * slow,
        half * fast,
    )


def _followed(known: Enclosure, low: float, high: float) -> tuple[Array, Array, Array, Array]:
    """Bounds of e and of its rate on every cell, from those at the start."""
    least, greatest = (part[:, i].tolist() for part, i in zip(known.eigenvalues, (0, 2), strict=True))
    slowest, fastest = known.inverse_rate_range
    rising = _lines(known, fastest)
    falling = _lines(known, -slowest)
    drift = known.drift_size.tolist()
    rows = []
    for cell, width in enumerate(known.widths.tolist()):
        bottom, top = least[cell], greatest[cell]
        # Where u could be anything; then twice with what that leaves.
        inner = bottom, top
        slow, fast = 0.0, 0.0
        for _ in range(3):
            turn = _turn(drift[cell], bottom, top, *inner)
            fast = _least(rising[cell], *inner) + turn
            slow = -_least(falling[cell], *inner) - turn
            inner = (
                max(bottom, low + min(0.0, slow * width)),
                min(top, high + max(0.0, fast * width)),
            )
        rows.append((*inner, slow, fast))
        slip = 16.0 * _EPS * top
        low, high = max(bottom, low + slow * width - slip), min(top, high + fast * width + slip)
    lower, upper, slow, fast = np.array(rows).T
    return lower - 32.0 * _EPS * np.abs(lower), upper + 32.0 * _EPS * np.abs(upper), slow, fast


def _lines(known: Enclosure, rate: Array) -> list[list[tuple[float, float]]]:
    """Slopes c and greatest eigenvalues of rate + c I^-1, for the c at which two of its eigenvalues change places.

    Every c is right; these are the best where I^-1 and its rate have common axes.
    """
    lower, upper = known.inverse_range
    values, axes = np.linalg.eigh(known.inverse)
    along = np.einsum("kji,kjl,kli->ki", axes, rate, axes)
    rise, run = along - np.roll(along, 1, axis=1), values - np.roll(values, 1, axis=1)
    apart = np.abs(run) > 1e-3 * values[:, 2:]
    slopes = np.concatenate([np.zeros((len(rate), 1)), np.where(apart, -rise / np.where(apart, run, 1.0), 0.0)], axis=1)
    cut = slopes[..., None, None]
    tops = np.linalg.eigvalsh(rate[:, None] + np.where(cut >= 0.0, cut * upper[:, None], cut * lower[:, None]))
    room = 16.0 * _EPS * np.abs(tops).max(axis=-1)
    return np.stack([slopes, tops[..., 2] + room], axis=-1).tolist()


def _least(lines: list[tuple[float, float]], low: float, high: float) -> float:
    return min(top - slope * (low if slope >= 0.0 else high) for slope, top in lines)


def _turn(drift: float, bottom: float, top: float, low: float, high: float) -> float:
    """The most that 2 |u x I^-1 u| |w| can be."""
    if not drift:
        return 0.0
    return 2.0 * drift * turning(bottom, top, low, high)


def turning(bottom: float, top: float, low: float, high: float) -> float:
    """The most that |u x A u| can be for eigenvalues of A in [bottom, top] and u.Au in [low, high].

    Its square is u.A^2 u - (u.A u)^2, a variance, and at most (top - u.Au)(u.Au - bottom).
    """
    e = min(max(0.5 * (bottom + top), low), high)
    return max(0.0, (top - e) * (e - bottom)) ** 0.5 * (1.0 + 8.0 * _EPS)
