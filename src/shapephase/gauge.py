"""A deformation seen from a turned frame.

A gauge U(t) turns the base frame: the body seen from there is d_here = U d. With hat(omega_U) = U^T U',
    I_here = U I U^T,   L_o,here = U (I omega_U + L_o),   Pi_here = U Pi,   R_here = R U^T
(theory.md B4; Cabrera 2006, remark 2.10, does not print the law).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from . import so3
from .arrays import Array, finite_array
from .deformation import Deformation, Source
from .errors import GaugeError, ShapeError
from .inertia_tensor import inverse_inertia
from .sampling import Sampler, sampler
from .stepping import SteppedRotation, stepped_rotation

Frames = Callable[[Array], tuple[Array, Array]]

_LIFT_TOLERANCE = 1e-12
_APART = 1e-6


def in_gauge(deformation: Deformation, u: Callable[[Array], tuple[ArrayLike, ArrayLike]]) -> Deformation:
    """The deformation seen from the frame turned by U(t).

    Parameters
    ----------
    u : times (N,) -> U (N, 3, 3), body rates of U (N, 3) [rad/s], hat(rate) = U^T U'; smooth between breaks

    Returns
    -------
    a Deformation like any other; its closure is U(T) closure U(0)^T

    Raises
    ------
    ShapeError
        If `u` returns other shapes, or matrices that are not rotations.

    Source: theory.md B4.
    """

    def frames(times: Array) -> tuple[Array, Array]:
        turns, rates = u(times)
        turned = so3.rotation_argument(turns, "U")
        rate = finite_array(rates, "body rates of U", unit="rad/s")
        if turned.shape != (len(times), 3, 3) or rate.shape != (len(times), 3):
            raise ShapeError(
                f"u must return U ({len(times)}, 3, 3) and body rates ({len(times)}, 3) for these times, got "
                f"{turned.shape} and {rate.shape}"
            )
        return turned, rate

    _check_rates(frames, deformation.breaks)
    return _seen_from(deformation, frames, "turned")


def _check_rates(frames: Frames, breaks: Array) -> None:
    """Compare body rates with differences of U inside the breaks."""
    left, width = breaks[:-1], np.diff(breaks)
    middle, step = left + 0.381 * width, 1e-4 * width
    before, at, after = (frames(t) for t in (middle - step, middle, middle + step))
    slope = so3.vee(so3.transpose(at[0]) @ (after[0] - before[0])) / (2.0 * step[:, None])
    wrong = np.linalg.norm(slope - at[1], axis=-1) > 1e-3 * (np.linalg.norm(at[1], axis=-1) + 1.0 / breaks[-1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ShapeError(
            f"u gives the body rate {at[1][row]} rad/s at {middle[row]:.6g} s, but its U turns at {slope[row]}; "
            "the body rate is the vector of U^T U'"
        )


def horizontal_gauge(deformation: Deformation) -> Deformation:
    """The deformation seen from the frame that the shape motion alone would carry along: L_o vanishes there.

    U(0) is the identity and U' = -U hat(I^-1 L_o). For a loop the closure is the holonomy (base axes at t = 0).
    Source: Cabrera 2006, section 2.3.1 (a); theory.md B2.
    """
    lift = stepped_rotation(deformation.sampler(), np.zeros((1, 3)), _LIFT_TOLERANCE)

    def frames(times: Array) -> tuple[Array, Array]:
        inertia, momentum = deformation.source.sample(times)
        return lift.rotation(times)[0], -so3.apply(inverse_inertia(inertia, times), momentum)

    return _seen_from(deformation, frames, "horizontal")


def lift_frames(lift: SteppedRotation) -> Frames:
    """U(t) and its body rates of the horizontal gauge, from the integrated lift."""

    def frames(times: Array) -> tuple[Array, Array]:
        return lift.rotation(times)[0], -lift.inverse_and_drift(times)[1]

    return frames


def principal_gauge(deformation: Deformation) -> Deformation:
    """The deformation seen from its principal axes of inertia, kept continuous in time.

    At t = 0 the axes are sorted by ascending moments, each points along its largest base component, the third
    completes a proper frame.

    Raises
    ------
    GaugeError
        If two principal moments come within 1e-6 of each other, relative: there the axes are not determined.

    Source: Cabrera 2006, section 2.3.1 (b); theory.md B3.
    """
    return _seen_from(deformation, principal_frames(deformation), "principal")


def principal_frames(deformation: Deformation) -> Frames:
    """U(t) and its body rates of the principal gauge. Raises GaugeError."""
    track_times, track = _principal_track(deformation)

    def frames(times: Array) -> tuple[Array, Array]:
        nearest = np.clip(np.searchsorted(track_times, times), 1, len(track_times) - 1)
        nearest -= times - track_times[nearest - 1] < track_times[nearest] - times
        moments, axes = _following(deformation.inertia(times), track[nearest], times)
        rate = so3.transpose(axes) @ deformation.inertia_rate(times) @ axes
        spin = np.empty((len(times), 3))
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            spin[:, i] = rate[:, j, k] / (moments[:, j] - moments[:, k])
        return so3.transpose(axes), -so3.apply(axes, spin)

    return frames


def _principal_track(deformation: Deformation) -> tuple[Array, Array]:
    """Times and continuous principal frames, close enough that each tells its neighbours' axes apart."""
    count = 32 * deformation.loops + 1
    times = np.unique(np.concatenate([np.linspace(a, b, count) for a, b in pairwise(deformation.breaks)]))
    while True:
        moments, axes = np.linalg.eigh(deformation.inertia(times))
        _check_apart(moments, times)
        overlap = np.abs(np.sum(axes[:-1] * axes[1:], axis=-2))
        clear = np.all(overlap > 0.9, axis=-1)
        if clear.all():
            break
        if len(times) > 100_000:
            raise GaugeError(f"the principal axes turn too fast to be followed near t = {times[:-1][~clear][0]:.9g} s")
        times = np.sort(np.concatenate([times, 0.5 * (times[:-1] + times[1:])[~clear]]))
    frame = axes[0] * np.sign(np.take_along_axis(axes[0], np.argmax(np.abs(axes[0]), axis=0)[None], axis=0))
    frame[:, 2] *= np.linalg.det(frame)
    track = [frame]
    for following in axes[1:]:
        track.append(_signed(following[None], track[-1][None])[0])
    return times, np.array(track)


def _following(inertia: Array, frames: Array, times: Array) -> tuple[Array, Array]:
    """Principal moments, ascending, and axes with the signs of nearby frames."""
    moments, axes = np.linalg.eigh(inertia)
    _check_apart(moments, times)
    overlap = np.abs(np.sum(axes * frames, axis=-2)).min(axis=-1)
    if np.any(overlap < 0.5):
        raise GaugeError(
            f"two principal moments change places near t = {times[np.argmin(overlap)]:.9g} s, too briefly to follow: "
            "declare that time as a break, or use the horizontal gauge"
        )
    return moments, _signed(axes, frames)


def _signed(axes: Array, frames: Array) -> Array:
    # Moments that stay apart keep their order, so only the signs of the axes are to be chosen.
    return axes * np.sign(np.sum(axes * frames, axis=-2))[:, None, :]


def _check_apart(moments: Array, times: Array) -> None:
    gap = np.min(np.diff(moments, axis=-1), axis=-1) / moments[:, 2]
    if np.any(gap < _APART):
        row = int(np.argmin(gap))
        raise GaugeError(
            f"two principal moments meet at t = {times[row]:.9g} s ({moments[row]} kg m^2): the principal gauge has no "
            "unique frame there; use the horizontal gauge, or a body without that symmetry"
        )


def _seen_from(deformation: Deformation, frames: Frames, name: str) -> Deformation:
    closure = deformation.closure
    if closure is not None:
        ends, _ = frames(np.array([0.0, deformation.duration]))
        closure = ends[1] @ closure @ ends[0].T
    source = _Gauged(deformation.source, frames)
    return replace(deformation, source=source, closure=closure, label=f"{deformation.label}, {name} gauge")


@dataclass(frozen=True, eq=False)
class _Gauged:
    original: Source
    frames: Frames

    def sample(self, times: Array) -> tuple[Array, Array]:
        inertia, momentum = self.original.sample(times)
        turn, rate = self.frames(times)
        return turn @ inertia @ so3.transpose(turn), so3.apply(turn, so3.apply(inertia, rate) + momentum)

    def inertia_rate(self, times: Array) -> Array:
        inertia, _ = self.original.sample(times)
        turn, rate = self.frames(times)
        spin = so3.hat(rate)
        return turn @ (self.original.inertia_rate(times) + spin @ inertia - inertia @ spin) @ so3.transpose(turn)

    def frame(self, times: Array) -> Array:
        return self.frames(times)[0] @ self.original.frame(times)

    def centre_of_mass(self, times: Array) -> Array:
        return so3.apply(self.frames(times)[0], self.original.centre_of_mass(times))

    def sampler(self, breaks: Array) -> Sampler:
        return sampler(self.sample, breaks)
