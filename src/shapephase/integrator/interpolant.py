"""I^-1 and I^-1 L_o of a deformation as piecewise Chebyshev polynomials."""

from __future__ import annotations

from dataclasses import field
from functools import cached_property

from ..arrays import Array, Integers, lock_arrays
from ..chebyshev import PiecewiseChebyshev
from ..display import frozen
from ..inertia_tensor import FULL_FROM_SIX


@frozen
class Interpolant:
    """I^-1 (6 numbers) and I^-1 L_o (3) on panels: nine channels as Chebyshev series.

    Attributes
    ----------
    edges : (loops P + 1,) panel ends [s]
    coefficients : (P, n, 9), padded with zeros to one degree; channels xx yy zz yz xz xy of I^-1, then I^-1 L_o;
        the P panels of the first loop serve every loop
    loops : how often the panels are repeated
    evaluations : how many times the deformation was evaluated
    widths : (P,) of the panels of one loop [s]

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 5.0])
    >>> motion.interpolant.edges.tolist(), motion.interpolant.coefficients.shape[-1]
    ([0.0, 1.0], 9)
    """

    edges: Array
    coefficients: Array
    loops: int
    evaluations: int
    widths: Array = field(init=False)

    def __post_init__(self) -> None:
        """Find the widths, and let nobody write to the arrays."""
        ends = self.edges[: len(self.coefficients) + 1]
        object.__setattr__(self, "widths", ends[1:] - ends[:-1])
        lock_arrays(self)

    @cached_property
    def series(self) -> PiecewiseChebyshev:
        """The nine channels as a function of time."""
        return PiecewiseChebyshev(self.edges, self.coefficients)

    def panel_of(self, times: Array) -> Integers:
        """The panel of each time: (N,) -> (N,)."""
        return self.series.panel_of(times)

    def channels(self, times: Array, panel: Integers) -> Array:
        """The nine channels at times of given panels: (N, k), (N,) -> (N, k, 9)."""
        return self.series.on_panels(times, panel)

    def inverse_and_drift(self, times: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o: (N,) -> (N, 3, 3) [1/(kg m^2)], (N, 3) [rad/s]."""
        values = self.series(times)
        return values[:, FULL_FROM_SIX], values[:, 6:]
