"""How a deformation is sampled: often enough for a stated attitude error, and no more.

The bandwidth of the shape motion, not the speed of the rotation, sets how often the body must be evaluated. A smooth
loop is sampled at even times; anything else on panels between its breaks. Either way samples are added until the tail
of the spectrum is small enough.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from ..arrays import Array, Integers
from ._last_terms import Perturbed
from ._spectral_error import Channels, Directly, Evaluate, RememberedChannels, SampledChannels
from .even.even_sampling import EvenSampler
from .fast import engine
from .interpolant import Interpolant
from .panels.panel_sampling import NONE_JOINED, PanelSampler
from .recorded.knot_path import KnotPath
from .recorded.knot_sampling import KnotSampler
from .resolved import ResolvedPath

# Panels to begin with for a loop too rough for even samples.
_PANELS_OF_A_ROUGH_LOOP = 32


class Sampler(Protocol):
    """A deformation being sampled.

    Examples
    --------
    >>> sampler = sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0).sampler
    >>> sampler is not None
    True
    """

    def refine(self, momentum: float, tolerance: float) -> None:
        """Sample until the attitude error for momenta up to this magnitude is at most `tolerance` [rad].

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
        """The interpolant of all samples so far."""
        ...

    def perturbed(self, momentum: float) -> Perturbed:
        """The same with errors like those that it probably has for momenta up to this magnitude."""
        ...

    def channels(self, times: Array) -> Array:
        """What is sampled, at times of the first loop that may be no nodes: (N,) -> (N, 9)."""
        ...

    def body_channels(self, times: Array) -> Array:
        """Channels of the deformation itself, at times of the first loop that may be no nodes: (N,) -> (N, 9)."""
        ...

    def joined_panels(self) -> Integers:
        """Panels of the interpolant that have the sample at their right end in common with the next one: (J,)."""
        ...


def sampler(
    evaluate: Evaluate,
    breaks: Array,
    *,
    oscillations: float | None = None,
    loops: int = 1,
    smooth_loop: bool = False,
    sparse: bool = False,
    swing: float | None = None,
    probe: Callable[[Array], Array] | None = None,
    resolved: ResolvedPath | None = None,
    directly: Directly | None = None,
    checked: bool = False,
    knots: KnotPath | None = None,
    known: dict[Any, Any] | None = None,
) -> Sampler:
    """The sampler that suits a deformation.

    Parameters
    ----------
    evaluate : times (N,) -> I (N, 3, 3), L_o (N, 3)
    breaks : (M,) where smoothness ends, first and last the interval's ends [s]
    oscillations : upper bound of the oscillations between two breaks (or in a smooth loop); 0: nothing moves;
        None: unknown, then the interpolant is checked between the nodes
    loops : the interval is its first part, repeated this many times
    smooth_loop : that part ends smoothly where it starts and has no breaks
    sparse : oscillations between none and the fastest are missing
    swing : how far the shape of a smooth loop swings, from which its spectrum is foreseen [rad]; None: unknown
    probe : a cheap stand-in for the deformation to check a black box, times (N,) -> (N, 2 n), shapes and then their
        rates; None: the deformation itself is evaluated
    resolved : all of what the deformation depends on in the first loop, as series: nothing is checked between nodes
    directly : times (N,) -> I^-1 and I^-1 L_o (N, 9) as channels, sooner than by `evaluate`; None, or None as its
        result: `evaluate` is asked
    checked : it depends on more, and is checked between nodes nevertheless
    knots : the first loop of a recorded path, whose knots are the breaks: panels may span several of them
    known : what earlier samplers with the same arguments found out that does not depend on the body

    Examples
    --------
    >>> def evaluate(t):
    ...     return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), np.zeros((len(t), 3))
    >>> steady = sp.integrator.sampler(evaluate, np.array([0.0, 1.0]))
    >>> solution = sp.integrator.stepped_rotation(steady, np.array([[0.0, 0.0, 5.0]]), 1e-9)
    >>> print(solution.error_estimate < 1e-9)
    [ True]
    """
    return _sampler(
        Channels(evaluate, directly),
        breaks,
        knots=knots,
        oscillations=oscillations,
        loops=loops,
        smooth_loop=smooth_loop,
        sparse=sparse,
        swing=swing,
        probe=probe,
        resolved=resolved,
        checked=checked,
        known=known,
    )


def _sampler(
    channels: SampledChannels,
    breaks: Array,
    *,
    knots: KnotPath | None = None,
    oscillations: float | None = None,
    loops: int = 1,
    smooth_loop: bool = False,
    sparse: bool = False,
    swing: float | None = None,
    **further: Any,
) -> Sampler:
    """Arguments as of `sampler`."""
    if knots is not None:
        return KnotSampler(knots, loops, channels)
    # The tail of a Fourier spectrum with gaps tells nothing; a Chebyshev series has none.
    if smooth_loop and oscillations is not None and not sparse:
        return LoopSampler(channels, float(breaks[-1]) / loops, loops, oscillations, swing)
    return _on_panels(channels, breaks, oscillations=oscillations, loops=loops, smooth_loop=smooth_loop, **further)


def _on_panels(
    channels: SampledChannels,
    breaks: Array,
    *,
    oscillations: float | None = None,
    loops: int = 1,
    smooth_loop: bool = False,
    probe: Callable[[Array], Array] | None = None,
    resolved: ResolvedPath | None = None,
    checked: bool = False,
    known: dict[Any, Any] | None = None,
) -> PanelSampler:
    """Arguments as of `sampler`."""
    period = float(breaks[-1]) / loops
    if smooth_loop and oscillations is not None:
        return PanelSampler(channels, np.array([0.0, period]), loops, oscillations, probe, known=known)
    ends = breaks[breaks <= period * (1.0 + 1e-12)] if loops > 1 else breaks
    return PanelSampler(channels, ends, loops, oscillations, probe, resolved, checked=checked, known=known)


class Samplers:
    """Samplers of one deformation that share what they find out about it; arguments as of `sampler`.

    What is remembered are whole calls: one with other times is made as it would be alone, to the last bit.
    """

    def __init__(
        self, evaluate: Evaluate, breaks: Array, *, directly: Directly | None = None, **smoothness: Any
    ) -> None:
        self._breaks, self._smoothness = breaks, smoothness
        self._channels = Channels(evaluate, directly if engine.is_ready() else None)
        self._known: dict[bytes, Array] = {}
        self._of_knots: list[KnotSampler] = []

    @property
    def evaluations(self) -> int:
        """How many times the deformation was evaluated so far."""
        return self._channels.count + sum(one.evaluations for one in self._of_knots)

    def fresh(self) -> Sampler:
        """A sampler that knows nothing yet."""
        made = _sampler(self._remembered(), self._breaks, **self._smoothness)
        if isinstance(made, KnotSampler):
            self._of_knots.append(made)
        return made

    def on_panels(self) -> PanelSampler:
        """One that knows nothing yet and samples on panels between breaks whatever the deformation is."""
        other = ("sparse", "swing", "knots")
        smoothness = {name: value for name, value in self._smoothness.items() if name not in other}
        return _on_panels(self._remembered(), self._breaks, **smoothness)

    def _remembered(self) -> RememberedChannels:
        return RememberedChannels(self._channels, self._known)


class LoopSampler:
    """Samples a smooth loop at even times, and on panels where that would take too many."""

    def __init__(
        self, channels: SampledChannels, period: float, loops: int, oscillations: float, swing: float | None = None
    ) -> None:
        self._channels, self._period, self._loops, self._oscillations = channels, period, loops, oscillations
        self._sampler: EvenSampler | PanelSampler = EvenSampler(channels, period, loops, oscillations, swing)

    def refine(self, momentum: float, tolerance: float) -> None:
        """As `Sampler.refine`."""
        if isinstance(self._sampler, EvenSampler) and not self._sampler.refine(momentum, tolerance):
            edges = np.linspace(0.0, self._period, _PANELS_OF_A_ROUGH_LOOP + 1)
            self._sampler = PanelSampler(self._channels, edges, self._loops, self._oscillations, None)
        if isinstance(self._sampler, PanelSampler):
            self._sampler.refine(momentum, tolerance)

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        return self._sampler.error(momentum)

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        return self._sampler.interpolant()

    def perturbed(self, momentum: float) -> Perturbed:
        """As `Sampler.perturbed`."""
        return self._sampler.perturbed(momentum)

    def channels(self, times: Array) -> Array:
        """As `Sampler.channels`."""
        return self._channels(times)

    body_channels = channels

    def joined_panels(self) -> Integers:
        """As `Sampler.joined_panels`: none."""
        return NONE_JOINED


class FinishedSampler:
    """A finished interpolant in the place of a sampler: nothing is evaluated again."""

    def __init__(self, interpolant: Interpolant) -> None:
        self._interpolant = interpolant

    def refine(self, momentum: float, tolerance: float) -> None:
        """No refinement: the samples are already as dense as their own tolerance demanded."""

    def error(self, momentum: float) -> float:  # noqa: ARG002
        """Zero: it is part of the error of what the samples were taken for."""
        return 0.0

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        return self._interpolant

    def perturbed(self, momentum: float) -> Perturbed:  # noqa: ARG002
        """The same: its errors count elsewhere."""
        return Perturbed.same(self._interpolant.coefficients, 0.0)

    def channels(self, times: Array) -> Array:
        """As `Sampler.channels`: the interpolant's own."""
        return self._interpolant.series(times)

    body_channels = channels

    def joined_panels(self) -> Integers:
        """As `Sampler.joined_panels`: none."""
        return NONE_JOINED
