"""I^-1 and I^-1 L_o of a deformation as piecewise Chebyshev polynomials, resolved to a stated rate error.

The bandwidth of the shape motion, not the speed of the rotation, sets how often Pinocchio must be asked:
each panel between two breaks is sampled at nested Chebyshev points, doubled until the tail of its spectrum is
small enough, or bisected (numerics.md sections 0 and 1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

import numpy as np

from .arrays import Array, Integers
from .errors import AccuracyNotReached, ShapeError
from .inertia_tensor import inverse_inertia

Evaluate = Callable[[Array], tuple[Array, Array]]

_FIRST_DEGREE = 8
_LAST_DEGREE = 64
_MOST_PANELS_A_BREAK = 400
_LEAST_WIDTH = 1e-13
_ROUNDING = 30.0 * np.finfo(float).eps
_VOIGT = np.array([0, 4, 8, 5, 2, 1])
_MATRIX = np.array([0, 5, 4, 5, 1, 3, 4, 3, 2])


@dataclass(frozen=True, eq=False)
class Interpolant:
    """I^-1 (6 numbers) and I^-1 L_o (3) on panels: nine channels as Chebyshev series.

    Attributes
    ----------
    edges : (P + 1,) panel ends [s]
    coefficients : (P, n, 9), padded with zeros to one degree; channels xx yy zz yz xz xy of I^-1, then I^-1 L_o
    inverse_error, drift_error : (P,) error estimates of I^-1 [1/(kg m^2)] and of I^-1 L_o [rad/s]
    evaluations : how many times the deformation was evaluated
    """

    edges: Array
    coefficients: Array
    inverse_error: Array
    drift_error: Array
    evaluations: int

    def panel_of(self, times: Array) -> Integers:
        """The panel of each time: (N,) -> (N,)."""
        return np.clip(np.searchsorted(self.edges, times, side="right") - 1, 0, len(self.edges) - 2)

    def channels(self, times: Array, panel: Integers) -> Array:
        """The nine channels at times of given panels: (N, k), (N,) -> (N, k, 9)."""
        left, right = self.edges[panel, None], self.edges[panel + 1, None]
        local = np.clip((2.0 * times - left - right) / (right - left), -1.0, 1.0)
        values = np.empty((*times.shape, 9))
        chunk = max(1, 2_000_000 // (self.coefficients.shape[1] * (9 + times.shape[1])))
        for start in range(0, len(times), chunk):
            part = slice(start, start + chunk)
            values[part] = chebyshev(local[part], self.coefficients.shape[1]) @ self.coefficients[panel[part]]
        return values

    def inverse_and_drift(self, times: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o: (N,) -> (N, 3, 3) [1/(kg m^2)], (N, 3) [rad/s]."""
        values = self.channels(times[:, None], self.panel_of(times))[:, 0]
        return values[:, _MATRIX].reshape(-1, 3, 3), values[:, 6:]

    def error(self, momentum: float) -> float:
        """Bound of the attitude error due to sampling, without amplification [rad]."""
        rates = momentum * self.inverse_error + self.drift_error
        return float(0.5 * np.diff(self.edges) @ rates)


@dataclass(eq=False)
class _Panel:
    left: float
    right: float
    degree: int = 0
    values: Array = field(default_factory=lambda: np.empty((0, 9)))
    inverse_error: float = np.inf
    drift_error: float = np.inf
    decay: float = 0.0
    at_rounding: bool = False
    vetted: bool = False

    @property
    def width(self) -> float:
        return self.right - self.left

    def error(self, momentum: float) -> float:
        """Bound of the attitude error that the panel's interpolation error feeds in [rad]."""
        return 0.5 * self.width * (momentum * self.inverse_error + self.drift_error)


class Sampler:
    """Samples one deformation, only ever adding: `refine` brings it to a tolerance, `interpolant` shows it.

    Parameters
    ----------
    evaluate : times (N,) -> I (N, 3, 3), L_o (N, 3)
    breaks : (M,) where smoothness ends, first and last the interval's ends [s]
    oscillations : upper bound of the swings between two breaks; None: unknown
    constant : one sample is enough
    probe : a cheap stand-in for the deformation, times (N,) -> (N, k), to look between the samples of a
        black box; None: the deformation itself is asked
    """

    def __init__(
        self,
        evaluate: Evaluate,
        breaks: Array,
        *,
        oscillations: float | None = None,
        constant: bool = False,
        probe: Callable[[Array], Array] | None = None,
    ) -> None:
        self._evaluate = evaluate
        self._probe = probe
        self._known = oscillations is not None or constant
        self._constant = constant
        self._span = float(breaks[-1] - breaks[0])
        self._most = _MOST_PANELS_A_BREAK + 40 * len(breaks)
        pieces = 1 if constant else 4 if oscillations is None else max(1, int(np.ceil(oscillations / 2.0)))
        ends = [np.linspace(left, right, pieces + 1) for left, right in pairwise(breaks)]
        self._panels = [_Panel(a, b) for e in ends for a, b in pairwise(e)]
        self.evaluations = 0
        self._raise_degree(self._panels)

    def error(self, momentum: float) -> float:
        """Bound of the attitude error due to sampling, without amplification [rad]."""
        return sum(panel.error(momentum) for panel in self._panels)

    def refine(self, momentum: float, tolerance: float) -> None:
        """Sample until the error bound is at most `tolerance` [rad] for momenta up to `momentum` [kg m^2/s].

        Raises
        ------
        AccuracyNotReached
            If panels get narrower than rounding allows, or too many: the motion is rough between its breaks.
        """
        while True:
            total = self.error(momentum)
            if total <= tolerance:
                suspicious = [] if self._known else self._unvetted(momentum, tolerance)
                if not suspicious:
                    return
            else:
                suspicious = [
                    panel
                    for panel in self._panels
                    if panel.error(momentum) > tolerance * panel.width / self._span and not panel.at_rounding
                ]
                if not suspicious:
                    return
            self._sharpen(suspicious, momentum, tolerance)

    def interpolant(self) -> Interpolant:
        """What has been sampled so far."""
        panels = self._panels
        highest = max(panel.degree for panel in panels) + 1
        coefficients = np.zeros((len(panels), highest, 9))
        for degree in {panel.degree for panel in panels}:
            rows = [i for i, panel in enumerate(panels) if panel.degree == degree]
            values = np.stack([panels[i].values for i in rows])
            coefficients[rows, : degree + 1] = values_to_coefficients(degree) @ values
        return Interpolant(
            np.array([panels[0].left, *(panel.right for panel in panels)]),
            coefficients,
            np.array([panel.inverse_error for panel in panels]),
            np.array([panel.drift_error for panel in panels]),
            self.evaluations,
        )

    def _sharpen(self, panels: list[_Panel], momentum: float, tolerance: float) -> None:
        """Double the degree where the spectrum decays fast enough for that to do, else bisect."""
        grow, fresh, halved = [], [], {}
        for panel in panels:
            excess = panel.error(momentum) / (tolerance * panel.width / self._span)
            missing = np.log(max(excess, 1.0)) / panel.decay if panel.decay > 0.0 else np.inf
            if 2 * panel.degree <= _LAST_DEGREE and missing <= 1.5 * panel.degree:
                grow.append(panel)
                continue
            if panel.width < _LEAST_WIDTH * self._span or len(self._panels) + len(fresh) > self._most:
                raise AccuracyNotReached(
                    f"the shape motion is rough near t = {panel.left:.12g} s: an error of {self.error(momentum):.3g} "
                    f"rad is left where {tolerance:.3g} was asked; declare the times of its jumps as breaks, smooth "
                    "the data, or loosen the tolerance"
                )
            middle = 0.5 * (panel.left + panel.right)
            halved[id(panel)] = [_Panel(panel.left, middle), _Panel(middle, panel.right)]
            fresh += halved[id(panel)]
        self._panels = [part for panel in self._panels for part in halved.get(id(panel), [panel])]
        self._raise_degree(grow + fresh)

    def _raise_degree(self, panels: list[_Panel]) -> None:
        """Evaluate all new points of these panels in one call and judge their spectra."""
        new_degree = [0 if self._constant else 2 * panel.degree or _FIRST_DEGREE for panel in panels]
        wanted = []
        for panel, degree in zip(panels, new_degree, strict=True):
            nodes = _nodes_in(panel.left, panel.right, degree)
            wanted.append(nodes if panel.degree == 0 else nodes[1::2])
        values = self._channels_at(np.concatenate(wanted))
        start = 0
        for panel, degree, times in zip(panels, new_degree, wanted, strict=True):
            fresh = values[start : start + len(times)]
            start += len(times)
            if panel.degree == 0:
                panel.values = fresh
            else:
                merged = np.empty((degree + 1, 9))
                merged[::2], merged[1::2] = panel.values, fresh
                panel.values = merged
            panel.degree, panel.vetted = degree, False
            _judge(panel)

    def _channels_at(self, times: Array) -> Array:
        inertia, momentum = self._evaluate(times)
        self.evaluations += len(times)
        inverse = inverse_inertia(inertia, times)
        channels = np.empty((len(times), 9))
        channels[:, :6] = inverse.reshape(-1, 9)[:, _VOIGT]
        channels[:, 6:] = (inverse @ momentum[:, :, None])[:, :, 0]
        if not np.isfinite(channels).all():
            row = int(np.argwhere(~np.isfinite(channels))[0, 0])
            raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
        return channels

    def _unvetted(self, momentum: float, tolerance: float) -> list[_Panel]:
        """Panels of a black box that look resolved at their nodes but miss something between them."""
        panels = [panel for panel in self._panels if not panel.vetted]
        missed = []
        for panel in panels:
            between = panel.left + panel.width * _BETWEEN
            nodes = _nodes_in(panel.left, panel.right, panel.degree)
            to_coefficients = values_to_coefficients(panel.degree)
            there = chebyshev(2.0 * _BETWEEN - 1.0, panel.degree + 1) @ to_coefficients
            if self._probe is None:
                truth = self._channels_at(between[::16])
                gap = np.abs(there[::16] @ panel.values - truth)
                rate = momentum * np.max(gap[:, :6].sum(axis=1)) + np.max(gap[:, 6:].sum(axis=1))
                wrong = 0.5 * panel.width * rate > max(10.0 * panel.error(momentum), 0.1 * tolerance)
            else:
                seen, truth = self._probe(nodes), self._probe(between)
                spread = np.ptp(np.concatenate([seen, truth]), axis=0) + 1e-12
                wrong = bool(np.any(np.abs(there @ seen - truth) > np.sqrt(tolerance) * spread + 1e-10))
            if wrong:
                panel.decay = 0.0
                missed.append(panel)
            panel.vetted = not wrong
        return missed


def _judge(panel: _Panel) -> None:
    """Error estimates and decay of a panel from the tail of its spectrum."""
    degree = panel.degree
    if degree == 0:
        panel.inverse_error = panel.drift_error = 0.0
        return
    size = np.abs(values_to_coefficients(degree) @ panel.values)
    inverse, drift = size[:, :6].sum(axis=1), size[:, 6:].sum(axis=1)
    tails, rates, rounding = [], [], []
    for series in (inverse, drift):
        top = float(series.max())
        late = float(series[-3:].max())
        middle = float(series[degree // 2 - 1 : degree // 2 + 2].max())
        floor = _ROUNDING * top
        decay = 2.0 * np.log(middle / late) / degree if late > 0.0 and middle > late else 0.0
        # What a geometric series with this decay leaves beyond its last term; the factor 2 is for aliasing.
        left_over = 2.0 * late / np.expm1(decay) if decay > 0.0 else late * degree
        tails.append(max(min(left_over, late * degree), 0.02 * floor))
        rates.append(decay if late > floor else np.inf)
        rounding.append(late <= floor)
    panel.inverse_error, panel.drift_error = tails
    panel.decay = min(rates)
    panel.at_rounding = all(rounding)


def chebyshev(x: Array, count: int) -> Array:
    """T_0 ... T_(count-1) at x in [-1, 1]: (...) -> (..., count)."""
    return np.cos(np.arccos(x)[..., None] * np.arange(count))


def _nodes_in(left: float, right: float, degree: int) -> Array:
    """Chebyshev points of a panel, ascending; the ends moved one rounding inwards, to this side of a break."""
    if degree == 0:
        return np.array([0.5 * (left + right)])
    nodes = 0.5 * (left + right) + 0.5 * (right - left) * _unit_nodes(degree)
    nodes[0], nodes[-1] = np.nextafter(left, right), np.nextafter(right, left)
    return nodes


@lru_cache(maxsize=16)
def _unit_nodes(degree: int) -> Array:
    return -np.cos(np.pi * np.arange(degree + 1) / degree)


@lru_cache(maxsize=16)
def values_to_coefficients(degree: int) -> Array:
    """Values at the ascending Chebyshev points of [-1, 1] -> Chebyshev coefficients: (degree + 1, degree + 1)."""
    if degree == 0:
        return np.ones((1, 1))
    matrix = chebyshev(_unit_nodes(degree), degree + 1).T * (2.0 / degree)
    matrix[:, [0, -1]] *= 0.5
    matrix[[0, -1], :] *= 0.5
    return matrix


# Sixty-four points of a panel, none of them a node: a low-discrepancy sequence away from the ends.
_BETWEEN = np.sort(np.mod(0.5 + 0.6180339887498949 * np.arange(64, dtype=np.float64), 1.0))
