"""Error bars of somersault, tilt and twist at times of a motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import times_argument
from ..arrays import Array, finite_array
from ..errors import ShapeError
from ..reconstruction.attitude_angles import athlete_slopes
from ..reconstruction.reconstruction import Motion
from ._propagation import carried
from .covariance import carried_errors, moved_fit_by_links, moved_fit_by_rotors
from .error_sources import InertiaErrors, Inputs, by_relative_errors, inputs_of
from .recorded_momentum import RecordedMomentum
from .result_derivatives import described_by, fit_by_inertias, fit_by_knots, fit_by_rotors, turns_by_start


def somersault_bars(
    motion: Motion,
    times: ArrayLike,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    start: RecordedMomentum | ArrayLike | None = None,
    rotors: float | Mapping[str, float] | None = None,
    lateral: str | ArrayLike | None = None,
    longitudinal: str | ArrayLike | None = None,
    somersault: str | ArrayLike | None = None,
    up: str | ArrayLike | None = None,
) -> tuple[Array, Array, Array]:
    """Error bars of somersault, tilt and twist in time, to first order: standard deviations, (N,) each [rad].

    The axes, found or given, count as exact.

    Raises like `uncertainty` and `Motion.athlete_axes`, too. Equations :eq:`added-momentum` and :eq:`moved-fit` of the
    documentation, for the attitude at each time.

    Parameters
    ----------
    motion : of an athlete, no batch, of an articulated body
    times : (N,) ascending [s]; memory and time grow with N, and some tens show a curve
    joints, inertias, momentum, attitude, start, rotors : errors of the inputs, as for `uncertainty`
    lateral, longitudinal, somersault, up : as for `Motion.athlete_axes`

    Raises
    ------
    ShapeError
        For times that do not ascend.
    ChartPoleError
        Where the tilt is a right angle, to 1e-6 rad.

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> somersault, _, _ = sp.error_bars.somersault_bars(motion, [0.5, motion.duration], momentum=0.1)
    >>> print(f"{somersault[0]:.4f} {somersault[1]:.4f} rad")
    0.0090 0.0538 rad
    """
    inputs = inputs_of(motion, joints, inertias, momentum, attitude, start, rotors)
    at = times_argument(finite_array(times, "times", (None,), unit="s"), motion.duration)
    if at.ndim != 1 or np.any(np.diff(at) <= 0.0):
        raise ShapeError(f"times: (N,) that ascend are needed, got {at.shape}")
    axes = {"lateral": lateral, "longitudinal": longitudinal, "somersault": somersault, "up": up}
    _, tilt, twist = motion.somersault_tilt_twist(at, **axes)
    slopes = athlete_slopes(tilt, twist) @ motion.athlete_axes(**axes).matrices[1].T
    by_turns = np.zeros((len(at), 3, len(at), 3))
    by_turns[np.arange(len(at)), :, np.arange(len(at))] = slopes
    bars = np.sqrt(_variances(motion, inputs, at, by_turns.reshape(3 * len(at), -1))).reshape(-1, 3).T
    return bars[0], bars[1], bars[2]


def _variances(motion: Motion, inputs: Inputs, times: Array, by_turns: Array) -> Array:
    """Variances of numbers with derivatives (r, 3 N) by turns of the attitude at N times, base axes: (r,)."""
    by_start = by_turns @ turns_by_start(motion, times)
    # A change that turns the attitudes moves a fit to them as their turns backwards do.
    backwards, no_rates = -by_turns, np.zeros_like(by_turns)
    by_knots = np.zeros((len(by_turns), 0))
    if inputs.samples is not None:
        by_knots = fit_by_knots(motion, times, backwards, no_rates)
    covariance = carried_errors(motion, inputs, by_knots, by_start)
    if inputs.links is not None:
        described = described_by(motion)
        by_parameters = fit_by_inertias(motion, times, backwards, no_rates)
        direct = by_relative_errors(described.body, described.rotors, by_parameters)
        covariance += carried(direct + by_start @ moved_fit_by_links(motion, inputs), inputs.links)
    if inputs.rotors is not None:
        direct = fit_by_rotors(motion, times, backwards, no_rates)
        covariance += carried(direct + by_start @ moved_fit_by_rotors(motion, inputs), inputs.rotors)
    return np.maximum(np.diag(covariance), 0.0)
