"""A deformation seen from a turned frame.

A gauge U(t) turns the base frame: the body seen from there is d_here = U d. With hat(omega_U) = U^T U',
    I_here = U I U^T,   L_o,here = U (I omega_U + L_o),   Pi_here = U Pi,   R_here = R U^T
(theory.md B4; Cabrera 2006, remark 2.10, does not print the law).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import inverse_inertia
from ..integrator.integrate import SteppedRotation, stepped_rotation
from ..integrator.lift import lift_along
from ..integrator.resolved import joined
from ..integrator.smoothness import Smoothness
from ..shape_space.scan.function_scan import FunctionScan, ScannedFunction, side_by_side
from ..shape_space.scan.scanning import scanned
from .deformation import Deformation
from .descriptions import Description
from .frames import (
    LIFT_TOLERANCE,
    Frames,
    GivenFrames,
    frames_argument,
    gauge_link,
    integrated_frames,
    link_frames,
    mean_body_frames,
    named_frames,
    principal_frames,
)

_MOST_LOOPS = 100  # for which the scan of the first loop is copied: with more the gauge is checked between its nodes
_MOST_BREAKS = 2001  # of a recorded motion: with more the sampler begins with panels as short as a scan's, without one


def in_gauge(
    deformation: Deformation,
    u: Callable[[Array], ArrayLike | tuple[ArrayLike, ArrayLike]] | None = None,
    *,
    rates: Callable[[Array], ArrayLike] | None = None,
    start: ArrayLike | None = None,
) -> Deformation:
    """The deformation seen from the frame turned by U(t).

    Equation :eq:`gauge` of the documentation.
    Source: theory.md B4.

    Parameters
    ----------
    u : times (N,) -> U (N, 3, 3), body rates of U (N, 3) [rad/s], hat(rate) = U^T U'; or U alone, which is then
        differentiated (to about 1e-11 of its swings)
    rates : in the place of u: times (N,) -> body rates of U (N, 3) [rad/s]; U is integrated to 1e-12 rad
    start : (3, 3) U(0) for `rates`; None: the identity

    Returns
    -------
    a Deformation like any other; its closure is U(T) closure U(0)^T

    Raises
    ------
    ShapeError
        If neither or both of `u` and `rates` are given, or they return other shapes, or matrices that are no
        rotations, or rates that are not those of U.
    GaugeError
        If U alone is given and is too rough to be differentiated.
    TrajectoryError, NoisyPathError, AccuracyNotReached
        If the functions jump, carry noise or are too rough: found by a look at them, at once where U or its rates are
        given alone, else when the deformation is first integrated (`Deformation.scan`).

    Warns
    -----
    UndeclaredBreakWarning
        For kinks that are not breaks of the deformation; they are taken as breaks.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> def frames(t):
    ...     return sp.so3.exp(np.multiply.outer(t, [0.0, 0.0, 1.0]))
    >>> spinning = sp.in_gauge(sp.articulated(cat, loop), frames)
    >>> print(np.linalg.eigvalsh(spinning.inertia(0.3)).round(6))  # of the same body
    [0.005918 0.019082 0.02    ]
    """
    check_object(deformation, "Deformation", "deformation")
    if (u is None) == (rates is None) or (u is not None and start is not None):
        raise ShapeError("a gauge is given either by u, or by its body rates and a start")
    breaks = deformation.breaks
    turning = integrated_frames(breaks, rates, start) if rates is not None else frames_argument(u, breaks)
    return _seen_from(deformation, turning.frames, "turned", turning)


def link_gauge(deformation: Deformation, link: str) -> Deformation:
    """The deformation of an articulated body seen from a link's frame: another base.

    Source: theory.md B4 with U = R_base_link^T.

    Raises
    ------
    UnknownNameError
        If there is no such link.
    GaugeError
        If the deformation is not that of an articulated body.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> seen = sp.link_gauge(sp.articulated(cat, loop), cat.moving_parts[0].links[0])
    >>> print(np.linalg.eigvalsh(seen.inertia(0.3)).round(6))  # of the same body
    [0.005918 0.019082 0.02    ]
    """
    check_object(deformation, "Deformation", "deformation")
    return _seen_from(deformation, link_frames(deformation, link), f"link {link}")


def mean_body_gauge(deformation: Deformation, reference: float = 0.0) -> Deformation:
    """The deformation seen from the frame in which the masses are nearest to where they were at a reference time.

    U(t) = argmin of the integral of |U r(t) - r(reference)|^2 dm, r from the centre of mass: the perturbation of the
    body as a whole is the least. It depends on the shape alone, so it closes with the shape; near the reference
    shape the internal momentum vanishes to first order, as in the horizontal gauge all along.

    Source: Eckart 1935; Canavan and Likins 1977 (mean axes); Travers, Hatton and Choset 2013 (minimum perturbation).

    Raises
    ------
    GaugeError
        If only the inertia is known, or the nearest orientation is not unique somewhere (a shape like a mirror
        image of the reference).

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> seen = sp.mean_body_gauge(sp.articulated(cat, loop))
    >>> print(np.linalg.eigvalsh(seen.inertia(0.3)).round(6))  # of the same body
    [0.005918 0.019082 0.02    ]
    """
    check_object(deformation, "Deformation", "deformation")
    return _seen_from(deformation, mean_body_frames(deformation, reference), "mean body")


def named_gauge(deformation: Deformation, name: str) -> Deformation:
    """The deformation seen from a gauge by its name, or "link:NAME". Raises UnknownNameError and the gauge's errors.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> seen = sp.deformation.named_gauge(sp.articulated(cat, loop), "principal").inertia(0.3)
    >>> print(f"{np.abs(seen - np.diag(seen.diagonal())).max():.9f}")
    0.000000000
    """
    check_object(deformation, "Deformation", "deformation")
    gauge_link(name)
    if name == "base":
        return deformation
    if name == "horizontal":
        return horizontal_gauge(deformation)
    return _seen_from(deformation, named_frames(deformation, name), name)


def horizontal_gauge(deformation: Deformation) -> Deformation:
    """The deformation seen from the frame that the shape motion alone would carry along: L_o vanishes there.

    U(0) is the identity and U' = -U hat(I^-1 L_o). For a loop the closure is the holonomy (base axes at t = 0). What
    wheels store (`Deformation.stored_momentum`) does not count as L_o: it is what is left there.
    Source: Cabrera 2006, section 2.3.1 (a); theory.md B2.

    Equation :eq:`horizontal-gauge` of the documentation.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> seen = sp.horizontal_gauge(sp.articulated(cat, loop))
    >>> print(f"{np.abs(seen.internal_momentum([0.2, 0.7])).max():.9f}")  # it vanishes there
    0.000000000
    """
    check_object(deformation, "Deformation", "deformation")
    rotation = stepped_rotation(deformation.sampler(), np.zeros((1, 3)), LIFT_TOLERANCE)
    lift = lift_along(rotation, deformation.stored_momentum if deformation.has_wheels else None).rotation
    return _seen_from(deformation, _HorizontalFrames(deformation.description, lift), "horizontal")


@dataclass(frozen=True, eq=False)
class _HorizontalFrames:
    description: Description
    lift: SteppedRotation

    __repr__ = short_repr

    def __call__(self, times: Array) -> tuple[Array, Array]:
        inertia, momentum = self.description.sample(times)
        stored = self.description.stored_momentum(times)
        if stored is not None:
            momentum = momentum - stored
        return self.lift.rotation(times)[0], -so3.apply(inverse_inertia(inertia, times), momentum)


def principal_gauge(deformation: Deformation) -> Deformation:
    """The deformation seen from its principal axes of inertia: the tensor is diagonal there, and the frame continuous.

    Moments that cross are followed through; where they only come close the axes turn. Where two are equal over an
    interval, the frame goes on with the distinct axis and does not turn about it. At t = 0 the moments ascend, the
    first two axes point along their largest base components, and the third completes a proper frame. The closure of a
    loop, U(T) closure U(0)^T, is one of the 24 turns of an octahedron: how the axes have changed places.

    Source: Cabrera 2006, section 2.3.1 (b); theory.md B3.

    Raises
    ------
    GaugeError
        If the inertia has no continuous frame of principal axes, or moments part after an interval along axes that
        this frame does not have.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> seen = sp.principal_gauge(sp.articulated(cat, loop)).inertia(0.3)
    >>> print(f"{np.abs(seen - np.diag(seen.diagonal())).max():.9f}")  # diagonal
    0.000000000
    """
    check_object(deformation, "Deformation", "deformation")
    return _seen_from(deformation, principal_frames(deformation), "principal")


def _seen_from(deformation: Deformation, frames: Frames, name: str, turning: GivenFrames | None = None) -> Deformation:
    closure = deformation.closure
    if closure is not None:
        ends, _ = frames(np.array([0.0, deformation.duration]))
        closure = ends[1] @ closure @ ends[0].T
    breaks = deformation.breaks if turning is None else turning.breaks
    description = _Gauged(deformation.description, frames, turning, breaks)
    # U(t) need not come back with the loops.
    return replace(
        deformation,
        description=description,
        declared_breaks=breaks,
        closure=closure,
        loops=1,
        label=f"{deformation.label}, {name} gauge",
    )


@dataclass(frozen=True, eq=False)
class _Gauged:
    """A description seen from frames, a user's (`turning`) or derived ones; smooth between breaks."""

    original: Description
    frames: Frames
    turning: GivenFrames | None
    breaks: Array

    __repr__ = short_repr

    def sample(self, times: Array) -> tuple[Array, Array]:
        inertia, momentum = self.original.sample(times)
        turn, rate = self.frames(times)
        return turn @ inertia @ so3.transpose(turn), so3.apply(turn, so3.apply(inertia, rate) + momentum)

    def channels(self, times: Array) -> Array | None:  # noqa: ARG002
        return None

    def stored_momentum(self, times: Array) -> Array | None:
        stored = self.original.stored_momentum(times)
        return None if stored is None else so3.apply(self.frames(times)[0], stored)

    def inertia_rate(self, times: Array) -> Array:
        inertia, _ = self.original.sample(times)
        turn, rate = self.frames(times)
        spin = so3.hat(rate)
        return turn @ (self.original.inertia_rate(times) + spin @ inertia - inertia @ spin) @ so3.transpose(turn)

    def frame(self, times: Array) -> Array:
        return self.frames(times)[0] @ self.original.frame(times)

    def centre_of_mass(self, times: Array) -> Array:
        return so3.apply(self.frames(times)[0], self.original.centre_of_mass(times))

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:
        correlation, slope = self.original.correlation(times, reference)
        turn, rate = self.frames(times)
        back = self.frames(np.array([reference]))[0][0].T
        return turn @ correlation @ back, turn @ (so3.hat(rate) @ correlation + slope) @ back

    def kinetic_energy(self, times: Array, turning: Array) -> Array:
        turn, rate = self.frames(times)
        return self.original.kinetic_energy(times, so3.apply(so3.transpose(turn), turning) + rate)

    def link_frames(self, times: Array, link: str) -> tuple[Array, Array]:
        turned, turning = self.original.link_frames(times, link)
        turn, rate = self.frames(times)
        return turn @ turned, so3.apply(turn, turning + rate)

    @property
    def scan(self) -> FunctionScan | None:
        """Scan of a user's frame together with what is seen from it; without one that of the original."""
        return self._scan

    @cached_property
    def _scan(self) -> FunctionScan | None:
        if self.turning is None:
            return self.original.scan
        edges = np.union1d(self.original.smoothness(self.breaks).breaks, self.breaks)
        return scanned(self.depends_on(), edges) if len(edges) <= _MOST_BREAKS else None

    def depends_on(self) -> ScannedFunction:
        if self.turning is None:
            return self.original.depends_on()
        return side_by_side([self.original.depends_on(), self.turning.function], "the deformation seen from the gauge")

    def smoothness(self, breaks: Array) -> Smoothness:
        known = self.original.smoothness(breaks)
        edges = np.union1d(breaks, known.breaks)
        if self.turning is not None:
            scan = self.scan
            if scan is None:
                return Smoothness(np.union1d(edges, np.linspace(0.0, breaks[-1], _MOST_BREAKS)))
            return Smoothness(edges, resolved=scan.resolved)
        # A frame that follows from the inertia can turn faster than the shape, unresolved by the scan.
        resolved = known.resolved
        if resolved is not None and known.loops > 1:
            resolved = joined([resolved] * known.loops) if known.loops <= _MOST_LOOPS else None
        return Smoothness(edges, resolved=resolved, checked=True)
