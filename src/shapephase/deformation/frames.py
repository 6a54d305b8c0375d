"""Frames in time: a gauge as the rotation U(t) and its body rates, wherever they come from.

The frames of the horizontal gauge are those of the lift; the principal ones are in `_principal_frame`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import times_argument
from ..arrays import Array, finite_array
from ..chebyshev import PiecewiseChebyshev
from ..display import short_repr
from ..errors import GaugeError, ShapeError, unknown_name
from ..integrator.integrate import stepped_rotation
from ..integrator.resolved import DEGREE
from ..integrator.sampling import Sampler
from ..integrator.smoothness import Smoothness
from ..integrator.stepped import SteppedRotation
from ..letters import value_text
from ..shape_space.scan.function_scan import ScannedFunction
from ..shape_space.scan.scanning import scanned
from ._principal_frame import Frames, principal_frames
from ._scanned_functions import rates_alone, turns_alone, turns_and_rates
from .deformation import Deformation
from .descriptions import Description, UserFunctions

_LINK = "link:"  # beginning of a gauge named after a link: "link:torso"
LIFT_TOLERANCE = 1e-12  # [rad] tighter than any motion that is seen from these frames
_ROUNDING = 8.0 * float(np.finfo(float).eps)  # of a coefficient of U
_CHECKED = 7  # times of each piece at which a user's rates are compared
_RATE_DOUBT = 1e-9  # of the fastest turn: uncertainty allowed to rates by differentiation


class UserGauge(Protocol):
    """A gauge that a user gives as a function of time."""

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """U(t) and its body rates."""
        ...

    def scanned_function(self) -> ScannedFunction:
        """The user's function, for its scan."""
        ...


@dataclass(frozen=True, eq=False)
class GivenFrames:
    """Frames that a user gives as functions of time.

    frames : U(t) and its body rates
    breaks : (M,) times between which they are smooth, as far as is known [s]
    """

    frames: UserGauge
    breaks: Array

    __repr__ = short_repr

    @property
    def function(self) -> ScannedFunction:
        """The user's function, for its scan."""
        return self.frames.scanned_function()

    @property
    def panel_ends(self) -> Array:
        """Times between which U is a short series, found by its scan: (P + 1,) [s]. Raises and warns like `scanned`."""
        return scanned(self.function, self.breaks).resolved.edges


def frames_argument(u: Callable[[Array], ArrayLike | tuple[ArrayLike, ArrayLike]] | None, breaks: Array) -> GivenFrames:
    """A user's U(t) with its rates, differentiated where it comes without. Raises like `in_gauge`."""
    if not callable(u) or isinstance(u, type):
        raise ShapeError(f"a gauge u is a function of times, got {value_text(u)}")
    if _turns_of(u, breaks[:1])[1] is None:
        return _differentiated(u, breaks)
    frames = _TurnsWithRates(u)
    _check_rates(frames, breaks)
    return GivenFrames(frames, breaks)


def _turns_of(u: Callable[[Array], Any], times: Array) -> tuple[Array, Array | None]:
    """U by a user's function, and its body rates if it returns them. Raises ShapeError."""
    returned = u(times)
    turns, rates = returned if isinstance(returned, tuple) and len(returned) == 2 else (returned, None)
    turned = so3.rotation_argument(turns, "U")
    rate = None if rates is None else finite_array(rates, "body rates of U", unit="rad/s")
    if turned.shape != (len(times), 3, 3) or (rate is not None and rate.shape != (len(times), 3)):
        raise ShapeError(
            f"u must return U ({len(times)}, 3, 3) and body rates ({len(times)}, 3) for these times, got "
            f"{turned.shape}" + ("" if rate is None else f" and {rate.shape}")
        )
    return turned, rate


@dataclass(frozen=True, eq=False)
class _GaugeFunction(UserFunctions):
    """Frames by a user's function."""

    function: Callable[[Array], Any]

    _holder = "a gauge"


@dataclass(frozen=True, eq=False)
class _TurnsWithRates(_GaugeFunction):
    """U and its body rates by the function."""

    def __call__(self, times: Array) -> tuple[Array, Array]:
        turned, rate = _turns_of(self.function, times)
        if rate is None:
            raise ShapeError("u returned body rates at the start, and U alone later on")
        return turned, rate

    def scanned_function(self) -> ScannedFunction:
        return turns_and_rates(self)


@dataclass(frozen=True, eq=False)
class _TurnsAlone(_GaugeFunction):
    """U by the function, and the slopes of a series of U: times (N,) -> (N, 9)."""

    slopes: PiecewiseChebyshev

    __repr__ = short_repr

    def __call__(self, times: Array) -> tuple[Array, Array]:
        turned, _ = _turns_of(self.function, times)
        return turned, so3.vee(so3.transpose(turned) @ self.slopes(times).reshape(-1, 3, 3))

    def scanned_function(self) -> ScannedFunction:
        return _scanned_turns(self.function)


@dataclass(frozen=True, eq=False)
class _TurnsOfRates(_GaugeFunction):
    """U from its body rates by the function, and a start."""

    start: Array
    turned: SteppedRotation

    def __call__(self, times: Array) -> tuple[Array, Array]:
        return self.start @ self.turned.rotation(times)[0], _spins_of(self.function, times)

    def scanned_function(self) -> ScannedFunction:
        return _scanned_rates(self.function)


def _scanned_turns(u: Callable[[Array], Any]) -> ScannedFunction:
    return turns_alone(lambda times: _turns_of(u, times)[0])


def _scanned_rates(rates: Callable[[Array], ArrayLike]) -> ScannedFunction:
    return rates_alone(lambda times: _spins_of(rates, times))


def _differentiated(u: Callable[[Array], Any], breaks: Array) -> GivenFrames:
    """Rotations with their rates: the slopes of the series that a scan finds."""
    function = _scanned_turns(u)
    scan = scanned(function, breaks)
    edges = scan.resolved.edges
    count = len(function.columns)
    series = scan.resolved.coefficients[:, :, :count] / function.judge(breaks, np.zeros((1, 2 * count)))[0][0]
    half = 0.5 * np.diff(edges)
    norms = np.linalg.norm(series, axis=-1)
    fastest = max(1.0 / breaks[-1], float(np.max(norms[:, 1] / half)))
    # Coefficients that are rounding would only be magnified: a slope at the end of a series is the sum of its
    # coefficients, each times the square of its degree.
    beyond = np.maximum.accumulate(norms[:, ::-1], axis=1)[:, ::-1]
    degree = np.minimum(np.sum(beyond > _ROUNDING, axis=1), DEGREE)
    series[np.arange(DEGREE + 1) > degree[:, None]] = 0.0
    last = np.take_along_axis(beyond, np.minimum(degree, DEGREE - 2)[:, None], axis=1)[:, 0]
    doubt = degree**2 * last / half
    worst = int(np.argmax(doubt))
    if doubt[worst] > _RATE_DOUBT * fastest:
        where = edges[worst] + half[worst]
        raise GaugeError(
            f"U(t) is too rough near t = {where:.9g} s to be differentiated (its rate is "
            f"uncertain by {doubt[worst]:.3g} rad/s): return its body rates too"
        )
    slopes = PiecewiseChebyshev(edges, series).derivative()
    return GivenFrames(_TurnsAlone(u, slopes), np.union1d(breaks, scan.found_breaks))


def integrated_frames(breaks: Array, rates: Callable[[Array], ArrayLike], start: ArrayLike | None) -> GivenFrames:
    """U(t) from its body rates: the lift of a unit inertia that carries minus the rate. Raises like `in_gauge`."""
    if not callable(rates):
        raise ShapeError(f"the body rates of a gauge are a function of times, got {value_text(rates)}")

    def unit_body(times: Array) -> tuple[Array, Array]:
        return np.broadcast_to(np.eye(3), (len(times), 3, 3)), -_spins_of(rates, times)

    first = np.eye(3) if start is None else so3.rotation_argument(start, "start").copy()
    if first.shape != (3, 3):
        raise ShapeError(f"start: one rotation (3, 3) is needed, got {first.shape}")
    scan = scanned(_scanned_rates(rates), breaks)
    edges = np.union1d(breaks, scan.found_breaks)
    turned = stepped_rotation(
        Sampler(unit_body, Smoothness(edges, resolved=scan.resolved)), np.zeros((1, 3)), LIFT_TOLERANCE
    )
    return GivenFrames(_TurnsOfRates(rates, first, turned), edges)


def _spins_of(rates: Callable[[Array], ArrayLike], times: Array) -> Array:
    """Body rates as a user's function gives them. Raises ShapeError."""
    spin = finite_array(rates(times), "body rates of U", unit="rad/s")
    if spin.shape != (len(times), 3):
        raise ShapeError(f"rates must return ({len(times)}, 3) for these times, got {spin.shape}")
    return spin


def _check_rates(frames: Frames, breaks: Array) -> None:
    """Compare body rates with differences of U at some times of each piece."""
    width = np.repeat(np.diff(breaks), _CHECKED)
    middle = (breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(_CHECKED) + 0.381) / _CHECKED).ravel()
    at, rates = frames(middle)
    speed = np.linalg.norm(rates, axis=-1)
    # So short that a turn at this rate differs from its chord by less than a millionth.
    step = np.minimum(1e-4 * width, 1e-3 / np.maximum(speed, 1e-300))
    before, after = (frames(t)[0] for t in (middle - step, middle + step))
    slope = so3.vee(so3.transpose(at) @ (after - before)) / (2.0 * step[:, None])
    wrong = np.linalg.norm(slope - rates, axis=-1) > 1e-3 * (speed + 1.0 / breaks[-1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ShapeError(
            f"u gives the body rate {rates[row]} rad/s at {middle[row]:.6g} s, but its U turns at {slope[row]}; "
            "the body rate is the vector of U^T U'"
        )


def link_frames(deformation: Deformation, link: str) -> Frames:
    """U(t) and its body rates of the frame of a link. Raises like `link_gauge`."""
    frames = _LinkFrames(deformation.description, link)
    frames(deformation.breaks[:1])
    return frames


@dataclass(frozen=True, eq=False)
class _LinkFrames:
    description: Description
    link: str

    def __call__(self, times: Array) -> tuple[Array, Array]:
        turned, turning = self.description.link_frames(times, self.link)
        return so3.transpose(turned), -turning


def mean_body_frames(deformation: Deformation, reference: float = 0.0) -> Frames:
    """U(t) and its body rates of the mean body. Raises GaugeError.

    With C = integral of r r_reference^T dm, U C = S is symmetric: U is the polar factor, and the antisymmetric part
    of the rate of U C gives (tr(S) - S) U omega.
    """
    time = times_argument(reference, deformation.duration)
    if time.ndim:
        raise ShapeError(f"reference: one time is needed, got an array of shape {time.shape}")
    frames = _MeanBodyFrames(deformation.description, float(time))
    _check_unbroken(frames, deformation, float(time))
    return frames


@dataclass(frozen=True, eq=False)
class _MeanBodyFrames:
    description: Description
    reference: float

    def __call__(self, times: Array) -> tuple[Array, Array]:
        correlation, slope = self.description.correlation(times, self.reference)
        left, singular, right = np.linalg.svd(correlation)
        sign = np.sign(np.linalg.det(left @ right))
        singular[:, 2] *= sign
        unique = singular[:, 1] + singular[:, 2] > 1e-6 * singular[:, 0]
        if not unique.all():
            raise GaugeError(
                f"at t = {times[np.argmin(unique)]:.9g} s no orientation of the body is nearest to that at "
                f"{self.reference:.9g} s; choose another reference time"
            )
        left[:, :, 2] *= sign[:, None]
        turned = so3.transpose(left @ right)
        # U C = V diag(singular) V^T with the rows of `right` for V^T.
        inverse = 1.0 / (singular.sum(axis=-1, keepdims=True) - singular)
        twisted = so3.apply(right, 2.0 * so3.vee(turned @ slope))
        spin = -so3.apply(so3.transpose(right), inverse * twisted)
        return turned, so3.apply(so3.transpose(turned), spin)


def _check_unbroken(frames: Frames, deformation: Deformation, reference: float) -> None:
    """Follow a mean frame through the first loop: where the nearest orientation changes places with another one it
    jumps by half a turn, between any two times however close."""
    edges = deformation.breaks[deformation.breaks <= deformation.duration / deformation.loops * (1.0 + 1e-12)]
    edges = np.union1d(edges, [deformation.duration / deformation.loops])
    times = np.unique(np.concatenate([np.linspace(a, b, 33) for a, b in pairwise(edges)]))
    turned = frames(times)[0]
    while True:
        wide = so3.angle(turned[1:] @ so3.transpose(turned[:-1])) > 0.5
        if not wide.any():
            return
        gaps = np.diff(times)
        if gaps[wide].min() < 1e-9 * deformation.duration:
            at = times[:-1][wide & (gaps < 1e-9 * deformation.duration)][0]
            raise GaugeError(
                f"at t = {at:.9g} s the orientation of the body nearest to that at {reference:.9g} s changes by a "
                "jump; choose another reference time"
            )
        middles = 0.5 * (times[:-1] + times[1:])[wide]
        order = np.argsort(np.concatenate([times, middles]), kind="stable")
        times = np.concatenate([times, middles])[order]
        turned = np.concatenate([turned, frames(middles)[0]])[order]


# Gauges that follow from the deformation alone.
_NAMED: dict[str, Callable[[Deformation], Frames]] = {"principal": principal_frames, "mean_body": mean_body_frames}
GAUGES = ("horizontal", "base", *_NAMED)


def gauge_link(name: str) -> str | None:
    """The link that a gauge is named after, None for another. Raises UnknownNameError if there is no such gauge."""
    if isinstance(name, str) and name.startswith(_LINK):
        return name.removeprefix(_LINK)
    if not isinstance(name, str) or name not in GAUGES:
        raise unknown_name("gauge", name, (*GAUGES, f"{_LINK}NAME"))
    return None


def named_frames(deformation: Deformation, name: str) -> Frames:
    """U(t) and its body rates of a gauge that is neither the base nor the horizontal one. Raises like `named_gauge`."""
    link = gauge_link(name)
    return _NAMED[name](deformation) if link is None else link_frames(deformation, link)
