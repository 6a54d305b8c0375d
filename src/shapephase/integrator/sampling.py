"""The way a deformation is sampled: often enough for a stated attitude error, and no more.

The bandwidth of the shape motion, not the speed of the rotation, sets how often Pinocchio must be asked
(numerics.md sections 0 and 1). A smooth loop is sampled at even times; anything else on panels between its breaks.
Either way samples are only ever added until the tail of the spectrum is small enough.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ..arrays import Array
from .even_sampling import EvenSampler
from .interpolant import Interpolant
from .panel_sampling import PanelSampler
from .spectral_error import Channels, Evaluate

_PANELS_OF_A_WILD_LOOP = 32


class Sampler(Protocol):
    """A deformation being sampled."""

    def refine(self, momentum: float, tolerance: float) -> None:
        """Sample until the attitude error for momenta up to this size is at most `tolerance` [rad].

        Raises
        ------
        AccuracyNotReached
            If the motion is too rough between its breaks.
        """
        ...

    def error(self, momentum: float) -> float:
        """Estimate of the attitude error due to sampling, without amplification [rad]."""
        ...

    def interpolant(self) -> Interpolant:
        """What has been sampled so far."""
        ...


def sampler(
    evaluate: Evaluate,
    breaks: Array,
    *,
    oscillations: float | None = None,
    loops: int = 1,
    smooth_loop: bool = False,
    probe: Callable[[Array], Array] | None = None,
) -> Sampler:
    """The way of sampling that suits a deformation.

    Parameters
    ----------
    evaluate : times (N,) -> I (N, 3, 3), L_o (N, 3)
    breaks : (M,) where smoothness ends, first and last the interval's ends [s]
    oscillations : upper bound of the swings between two breaks (or in a smooth loop); 0: nothing moves;
        None: unknown, then the samples are vetted between the nodes
    loops : the interval is its first part, this many times
    smooth_loop : that part goes smoothly over into its start and has no breaks
    probe : a cheap stand-in for the deformation to vet a black box, times (N,) -> (N, 2 n), shapes and then their
        rates; None: the deformation itself is asked
    """
    asked = Channels(evaluate)
    ends = breaks[breaks <= breaks[-1] / loops * (1.0 + 1e-12)] if loops > 1 else breaks
    if smooth_loop and oscillations is not None:
        return LoopSampler(asked, float(breaks[-1]) / loops, loops, oscillations)
    return PanelSampler(asked, ends, loops, oscillations, probe)


class LoopSampler:
    """Samples a smooth loop at even times, and on panels where that would take too many."""

    def __init__(self, asked: Channels, period: float, loops: int, oscillations: float) -> None:
        self._asked, self._period, self._loops, self._oscillations = asked, period, loops, oscillations
        self._way: EvenSampler | PanelSampler = EvenSampler(asked, period, loops, oscillations)

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        if isinstance(self._way, EvenSampler) and not self._way.refine(momentum, tolerance):
            edges = np.linspace(0.0, self._period, _PANELS_OF_A_WILD_LOOP + 1)
            self._way = PanelSampler(self._asked, edges, self._loops, self._oscillations, None)
        if isinstance(self._way, PanelSampler):
            self._way.refine(momentum, tolerance)

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        return self._way.error(momentum)

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        return self._way.interpolant()
