"""A surface of revolution from its metric F_1(x) dx^2 + F_2(x) d theta^2, given by functions.

x is any coordinate along the meridians, 0 on the equator; with F_1 = 1 it is the latitude phi and F_2 is m. The
stretch D (see `surface_of_revolution`) is tabulated once, by Chebyshev polynomials on panels that are halved until they
hold it to rounding; its derivatives are those of the polynomials. Before a parallel, where D grows without bound,
sqrt(depth - Y) D is tabulated, which does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy.fft import dct

from ...arguments import check_function
from ...arrays import Array
from ...display import short_repr
from ...errors import AccuracyNotReached, ShapeError
from ...roots import safe_newton
from .._arguments import TWELVE_DIGITS, above_zero
from .surface_of_revolution import NEAREST, SurfaceOfRevolution, surface_of_stretch

# x (N,) -> F_2 and dF_2/dx, (N,) each; the derivative with all its digits next to the equator, where it vanishes.
Profile = Callable[[Array], tuple[Array, Array]]
Meridian = Callable[[Array], Array]  # x (N,) -> F_1 > 0 (N,)

_DEGREE = 24  # of a panel's polynomial: for few panels, and derivatives that keep their digits
_EPS = float(np.finfo(float).eps)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True)
class Assumptions:
    """Assumptions that a metric meets. Made by `assumptions`."""

    equator_is_parallel: bool
    """(A1) F_2'(0) = 0."""
    is_symmetric: bool
    """(A2) F_1 and F_2 are even."""
    falls_to_reach: bool
    """F_2 falls all the way from the equator to the reach, so that extremals have one turning point there."""
    end: str
    """What is at the reach: "pole", "parallel" or "boundary"."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class TabulatedStretch:
    """D and its derivatives by Chebyshev series in Y on panels. Made by `surface_of_metric`."""

    edges: Array
    """(P + 1,) ascending depth - Y."""
    series: tuple[Array, ...]
    """P times (3, terms): of the tabulated function and its two derivatives by Y."""
    has_root: bool
    """Whether sqrt(depth - Y) D is tabulated, instead of D."""

    __repr__ = short_repr

    def __call__(self, square: Array, rest: Array) -> tuple[Array, Array, Array]:
        """Y and depth - Y, (N,) each -> D, D', D'', (N,) each."""
        panel = np.clip(np.searchsorted(self.edges, rest, side="right") - 1, 0, len(self.series) - 1)
        table = np.empty((3, *square.shape))
        for number in np.unique(panel):
            here = panel == number
            low, high = self.edges[number], self.edges[number + 1]
            place = ((high - rest[here]) - (rest[here] - low)) / (high - low)
            table[:, here] = chebyshev.chebval(place, self.series[number].T)
        value, slope, second = table[0], table[1], table[2]
        if not self.has_root:
            return value, slope, second
        rest = np.maximum(rest, NEAREST)
        root_rest = np.sqrt(rest)
        return (
            value / root_rest,
            (slope + 0.5 * value / rest) / root_rest,
            (second + slope / rest + 3.0 * value / (4.0 * rest**2)) / root_rest,
        )


def assumptions(profile: Profile, reach: float, meridian: Meridian | None = None) -> Assumptions:
    """Assumptions that the metric F_1 dx^2 + F_2 d theta^2 meets for |x| <= reach, by 257 samples.

    (A3), on the curvature, is `SurfaceOfRevolution.is_greatest_curvature_on_equator`.

    Raises ShapeError if the reach is not positive, or the functions give no finite numbers of the right shape, or F_2
    <= 0 inside.

    Examples
    --------
    >>> def sphere(x):
    ...     return np.cos(x) ** 2, -np.sin(2.0 * x)
    >>> found = sp.rigid_body.geodesics.assumptions(sphere, np.pi / 2.0)
    >>> found.is_symmetric, found.falls_to_reach, found.end
    (True, True, 'pole')
    """
    if meridian is not None:
        check_function(meridian, "meridian", "a function")
    x = above_zero(reach, "reach") * np.linspace(0.0, 1.0, 257)
    north, north_slope = _values(profile, x)
    south, south_slope = _values(profile, -x)
    along, back = _meridian_values(meridian, x), _meridian_values(meridian, -x)
    scale = north[0]
    if not (north[:-1] > 0.0).all() or not (along[:-1] > 0.0).all():
        raise ShapeError("F_1 and F_2 must be positive from the equator to the reach, not counting a pole there")
    steepness = np.abs(north_slope).max()
    end = "boundary"
    if north[-1] <= TWELVE_DIGITS * scale:
        end = "pole"
    elif abs(north_slope[-1]) <= 1e3 * TWELVE_DIGITS * steepness:
        end = "parallel"
    return Assumptions(
        equator_is_parallel=bool(abs(north_slope[0]) <= TWELVE_DIGITS * steepness),
        is_symmetric=bool(
            np.abs(north - south).max() <= TWELVE_DIGITS * scale
            # A caller may have slopes by differences.
            and np.abs(north_slope + south_slope).max() <= 1e2 * TWELVE_DIGITS * steepness
            and np.abs(along - back).max() <= TWELVE_DIGITS * along.max()
        ),
        falls_to_reach=bool((north_slope[1:-1] < 0.0).all()),
        end=end,
    )


def surface_of_metric(profile: Profile, reach: float, meridian: Meridian | None = None) -> SurfaceOfRevolution:
    """The surface with the metric F_1 dx^2 + F_2 d theta^2, |x| <= reach.

    Source: Bonnard et al., sections 2.1 and 2.2; theory.md O1, O4, P1.
    Raises ShapeError if the metric breaks an assumption: its equator is not a geodesic, it is not symmetric, or F_2
    does not fall to the reach; AccuracyNotReached if it is too rough to be tabulated to rounding.

    Parameters
    ----------
    profile : F_2 with its derivative (m with m' where F_1 = 1), see `Profile`
    reach : the largest x: of a pole, where F_2 = 0, of the next parallel, where F_2' = 0, or of the chart's boundary
    meridian : F_1; 1 where not given

    Examples
    --------
    >>> def sphere(x):
    ...     return np.cos(x) ** 2, -np.sin(2.0 * x)
    >>> surface = sp.rigid_body.geodesics.surface_of_metric(sphere, np.pi / 2.0)
    >>> print(f"{sp.rigid_body.geodesics.cut_time(surface, 0.5):.6f} = pi")
    3.141593 = pi
    """
    found = assumptions(profile, reach, meridian)
    if not found.equator_is_parallel:
        raise ShapeError("(A1) fails: the equator x = 0 is no extremal, as F_2'(0) is not 0; count x from the equator")
    if not found.is_symmetric:
        raise ShapeError("(A2) fails: F_1 and F_2 must be even in x")
    if not found.falls_to_reach:
        raise ShapeError(
            "F_2 must fall from the equator to the reach; take the reach no farther than the next parallel, "
            "and x = 0 where F_2 is greatest"
        )
    sampler = _Sampler(profile, meridian, float(reach), found.end)
    return surface_of_stretch(sampler.table(), sampler.equator, sampler.depth, found.end)


class _Sampler:
    """D at given Y, by F_1 and F_2; differences of F_2 are integrals of F_2', which keep their digits."""

    def __init__(self, profile: Profile, meridian: Meridian | None, reach: float, end: str) -> None:
        self.profile, self.meridian, self.reach, self.end = profile, meridian, reach, end
        ends, _ = _values(profile, np.array([0.0, reach]))
        self.equator = float(ends[0])
        self.depth = 1.0 if end == "pole" else float(1.0 - ends[1] / ends[0])
        x = reach * np.linspace(0.0, 1.0, 65)
        middle, _ = _values(profile, x)
        truth = 1.0 - middle / self.equator
        change, last = np.inf, np.full_like(x, np.inf)
        self.panels = 1
        while change > 1e-14 and self.panels <= 64:
            finer = self.drop(np.zeros_like(x), x)
            change, last = np.abs(finer - last).max(), finer
            self.panels *= 2
        self.panels //= 2
        if np.abs(last - truth).max() > 1e-11:
            at = x[int(np.abs(last - truth).argmax())]
            raise ShapeError(
                f"profile: the derivative given is not that of F_2, or F_2 is too rough, up to x = {at:.6g}"
            )

    def drop(self, start: Array, stop: Array) -> Array:
        """Y(stop) - Y(start): (N,) x 2 -> (N,)."""
        fraction = (np.arange(self.panels)[:, None] + 0.5 * (1.0 + _NODES)).ravel() / self.panels
        weight = np.tile(0.5 * _WEIGHTS, self.panels) / self.panels
        x = start[:, None] + (stop - start)[:, None] * fraction
        _, slope = _values(self.profile, x.ravel())
        return -(slope.reshape(x.shape) @ weight) * (stop - start) / self.equator

    def tabulated(self, square: Array, rest: Array) -> Array:
        """D, or sqrt(depth - Y) D before a parallel, at Y and depth - Y: (N,) x 2 -> (N,)."""
        near = square <= rest
        zero, far = np.zeros_like(square), np.full_like(square, self.reach)

        def step(x: Array) -> tuple[Array, Array]:
            ahead = np.where(near, zero, far)
            value = self.drop(ahead, x) - np.where(near, square, -rest)
            _, slope = _values(self.profile, x)
            slope = np.where(slope < 0.0, -slope / self.equator, np.inf)
            return value, x - value / slope

        guess = self.reach * np.where(near, np.sqrt(square / self.depth), 1.0 - np.sqrt(rest / self.depth))
        x = safe_newton(step, guess, zero, far)
        _, slope = _values(self.profile, x)
        along = np.sqrt(_meridian_values(self.meridian, x))
        below = (1.0 - self.depth) + rest
        value = along * 2.0 * np.sqrt(square) * np.sqrt(below) * self.equator / -slope
        return value * np.sqrt(rest) if self.end == "parallel" else value

    def table(self) -> TabulatedStretch:
        """Panels from the equator to the reach, each halved until its series has settled."""
        angles = np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1)
        toward = 0.5 * (1.0 - np.cos(angles))
        waiting, edges, series = [(0.0, 1.0)], [0.0], []
        while waiting:
            low, high = waiting.pop()
            square = self.depth * (low + (high - low) * toward)
            rest = self.depth * ((1.0 - high) + (high - low) * (1.0 - toward))
            samples = self.tabulated(square, rest)
            coefficients = np.asarray(dct(samples[::-1], type=2)) / (_DEGREE + 1)
            coefficients[0] *= 0.5
            # Finer panels tolerate more, as the last digit of the functions given may be noise.
            forgiven = 7.0 * _EPS * min((high - low) ** -np.log2(1.5), 20.0)
            if np.abs(coefficients[-3:]).max() > forgiven * np.abs(samples).max():
                if high - low < 0.5**14:
                    raise AccuracyNotReached(
                        f"the metric is too rough near Y = {square[0]:.6g} to be tabulated to rounding; give a smooth "
                        "metric, with a derivative right to rounding"
                    )
                middle = 0.5 * (low + high)
                # The half next to the reach first, so that edges ascend in depth - Y.
                waiting += [(low, middle), (middle, high)]
                continue
            # The last ones are rounding, which every derivative would magnify.
            coefficients = chebyshev.chebtrim(coefficients, 2.0 * _EPS * np.abs(samples).max())
            coefficients = np.pad(coefficients, (0, max(0, 3 - len(coefficients))))
            scale = 2.0 / (self.depth * (high - low))
            first, second = (chebyshev.chebder(coefficients, order) * scale**order for order in (1, 2))
            series.append(np.stack([coefficients, np.pad(first, (0, 1)), np.pad(second, (0, 2))]))
            edges.append(self.depth * (1.0 - low))
        return TabulatedStretch(edges=np.array(edges), series=tuple(series), has_root=self.end == "parallel")


def _values(profile: Profile, x: Array) -> tuple[Array, Array]:
    try:
        value, slope = (np.asarray(a, dtype=float) for a in profile(x))
    except (TypeError, ValueError) as error:
        raise ShapeError(f"profile: expected a function x (N,) -> F_2, F_2', (N,) each ({error})") from None
    return _checked(value, x, "F_2"), _checked(slope, x, "F_2'")


def _meridian_values(meridian: Meridian | None, x: Array) -> Array:
    return np.ones_like(x) if meridian is None else _checked(np.asarray(meridian(x), dtype=float), x, "F_1")


def _checked(value: Array, x: Array, name: str) -> Array:
    if value.shape not in ((), x.shape) or not np.isfinite(value).all():
        raise ShapeError(f"{name}: expected {x.shape} finite numbers for x {x.shape}, got shape {value.shape}")
    return np.broadcast_to(value, x.shape)
