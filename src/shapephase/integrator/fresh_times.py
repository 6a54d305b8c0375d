"""Interpolants compared with the deformation at fresh times.

Error estimates are made from an interpolant's own series; a fault in how these were put together shows only beside
the deformation itself.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Integers
from ..errors import AccuracyNotReached
from .channels import rates_of
from .interpolant import Interpolant

_TERMS_A_TIME = 12  # terms of series for each fresh time: 8 % of the evaluations at most
_GOLDEN = 0.6180339887498949  # step of the shares of panels at which neighbours are compared: never a node


def fresh_times(interpolant: Interpolant) -> tuple[Array, Integers]:
    """One time in each panel of the first loop, or in every few of low degree, and the panels: (N,) [s], (N,)."""
    panels, terms = len(interpolant.coefficients), np.count_nonzero(interpolant.coefficients[:, :, 0])
    chosen = np.arange(0, panels, -(-_TERMS_A_TIME * panels // max(terms, panels)))
    share = np.mod(0.5 + _GOLDEN * (chosen + 1.0), 1.0)
    return interpolant.edges[chosen] + share * interpolant.widths[chosen], chosen


def swings(gaps: Array, coefficients: Array, widths: Array, momentum: float) -> Array:
    """Angles by which gaps between series and body swing the attitude: (..., N) [rad].

    The terms that a series of degree d lacks swing at least d half-times over its panel, so a gap of r rad/s in the
    rate of turning swings the attitude by about r width/d.

    Parameters
    ----------
    gaps : (..., N, 9) of the channels
    coefficients : (..., N, n, 9) of the series
    widths : (N,) of their panels [s]
    momentum : its magnitude [kg m^2/s]
    """
    is_term = np.abs(coefficients).max(axis=-1) > 0.0
    degrees = is_term.shape[-1] - 1 - np.argmax(is_term[..., ::-1], axis=-1)
    return rates_of(gaps, momentum) * widths / np.maximum(degrees, 1)


def compare(interpolant: Interpolant, body: Array, momentum: float, tolerance: float) -> None:
    """Compare an interpolant with the body at its fresh times.

    Series within their estimates are off by swings of at most a third of the tolerance.

    Parameters
    ----------
    body : (N, 9) its channels at `fresh_times`
    momentum : magnitude of the largest [kg m^2/s]
    tolerance : of the attitude over all loops [rad]

    Raises
    ------
    AccuracyNotReached
        If a gap swings the attitude by more than the tolerance.
    """
    times, chosen = fresh_times(interpolant)
    gaps = interpolant.channels(times[:, None], chosen)[:, 0] - body
    angles = interpolant.loops * swings(gaps, interpolant.coefficients[chosen], interpolant.widths[chosen], momentum)
    worst = int(np.argmax(angles))
    if not angles[worst] <= tolerance:
        raise AccuracyNotReached(
            f"the samples near t = {times[worst]:.9g} s do not give the body there: the attitude may be off by "
            f"{angles[worst]:.3g} rad, which no error estimate shows. Either a function of yours gives other values "
            'when it is called again, or this is a fault of shapephase; method="dop853" takes no samples'
        )
