"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator of the library.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is stepped on
the series, as finely as the rotation needs. Errors are measured: by steps twice and four times as long, and by steps on
series with errors like those they probably have.
"""

from __future__ import annotations

from math import ceil, log2
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers
from ..errors import AccuracyNotReached
from .channels import rates_of
from .constants import (
    ANGLE_OF_STEP,
    EPS,
    MEASURED_ROUNDING,
    ORDER,
    ROUNDED_INERTIA,
    ROUNDING_OF_START,
    ROUNDING_OF_STEP,
    ROUNDING_SHARE,
    SMALL_TERM,
    STEPPING,
    STEPPING_SHARE,
    TERMS_OF_STEP,
    USUAL_TOLERANCE,
)
from .interpolant import Interpolant
from .kernels import spectra_kernel
from .machine_code import plain
from .samples import Samples, rounded_series
from .sampling import Sampler
from .stepped import SteppedRotation
from .stepping import Attempt, attempted, largest_angle, magnitudes_and_directions, stepped_quaternions

_MOST_STEPS = 4_000_000  # of one motion: some ten seconds, and a gigabyte of results
_MOST_ROUNDS = 10  # of samples and steps
_GAINS = 0.9  # ratio to the best estimate so far above which a round has failed; two failures end the run
_QUARTERS = 4  # refinements in each factor of two: few, so that momenta of a batch share them
_LEAST_TOLERANCE = 1e-9  # of the tolerance: samples are not made denser
_EXAGGERATED = 1024.0  # roundings by which samples are changed, so that the effect stands out of the marches' own
_TINY = 1e-300  # keeps quotients defined where marches agree to the last bit
_LOST = 0.1  # [rad] between marches, beyond which their distance does not show how errors fall
_TERMS_A_TIME = 12  # terms of series for each fresh time: 8 % of the evaluations at most
_GOLDEN = 0.6180339887498949  # step of the shares of panels at which neighbours are compared: never a node


class Refinement(NamedTuple):
    """Factors 2^(k/4) by which samples and steps are stricter than at first, as whole numbers k."""

    samples: int = 0
    steps: int = 0

    def sampling_tolerance(self, tolerance: float) -> float:
        """Tolerance of the samples [rad]."""
        return tolerance * 2.0 ** (-self.samples / _QUARTERS)

    @property
    def factor(self) -> float:
        """Factor of the number of steps."""
        return 2.0 ** (self.steps / _QUARTERS)


def stepped_rotation(sampler: Sampler, momentum: Array, tolerance: float) -> SteppedRotation:
    """Integrate the attitude equation to a tolerance, sampling the deformation as far as that needs.

    Parameters
    ----------
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    tolerance : of the attitude over the whole interval [rad]

    Raises
    ------
    AccuracyNotReached
        If the estimate stays above the tolerance.

    Examples
    --------
    >>> def evaluate(t):
    ...     return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), np.zeros((len(t), 3))
    >>> steady = sp.integrator.Sampler(evaluate, sp.integrator.Smoothness(np.array([0.0, 1.0]), oscillations=0.0))
    >>> solution = sp.integrator.stepped_rotation(steady, np.array([[0.0, 0.0, 5.0]]), 1e-9)
    >>> print(f"{sp.so3.angle(solution.rotation(np.array([1.0]))[0, 0]):.9f}")
    2.000000000
    """
    magnitudes, _ = magnitudes_and_directions(momentum)
    ceiling = float(magnitudes.max(initial=0.0))
    progress = Progress()
    while True:
        rotation, level = one_round(sampler, momentum, tolerance, ceiling, progress.refinement)
        if (rotation.error_estimate <= tolerance).all():
            return rotation
        worst = int(np.argmax(rotation.error_estimate))
        progress = progress.after(rotation, worst, tolerance, level)


class Progress(NamedTuple):
    """State of the rounds so far."""

    refinement: Refinement = Refinement()
    best: float = np.inf
    rounds: int = 0
    in_vain: int = 0

    def after(self, rotation: SteppedRotation, row: int, tolerance: float, level: float) -> Progress:
        """Refinement of a row's next round; `level` from `Samples`. Raises AccuracyNotReached if none will help."""
        estimate = float(rotation.error_estimate[row])
        in_vain = self.in_vain + (estimate > _GAINS * self.best)
        refinement = refined(self.refinement, rotation, row, tolerance, level)
        if in_vain >= 2 or self.rounds >= _MOST_ROUNDS or refinement == self.refinement:
            raise AccuracyNotReached(
                f"the tolerance {tolerance:.3g} rad was not reached: the estimate is {estimate:.3g} rad, of which "
                f"sampling {rotation.sampling_error[row]:.3g}, stepping {rotation.stepping_error[row]:.3g} and "
                f"rounding {rotation.rounding_error[row]:.3g}, with errors amplified "
                f"{rotation.amplification[row]:.3g} times; "
                "loosen the tolerance or shorten the motion"
            )
        return Progress(refinement, min(estimate, self.best), self.rounds + 1, in_vain)


def refined(last: Refinement, rotation: SteppedRotation, row: int, tolerance: float, level: float) -> Refinement:
    """Refinement by the parts of an error: more samples, more steps, or both."""
    sampling, stepping = float(rotation.sampling_error[row]), float(rotation.stepping_error[row])
    samples, steps = last
    spare = max(tolerance - float(rotation.rounding_error[row]), 0.5 * tolerance)
    if sampling > STEPPING_SHARE * spare and level:
        # Below the level at which there would be more samples, by the ratio of spare tolerance to their error.
        needed = min(level, last.sampling_tolerance(tolerance)) * min(0.25 * spare / sampling, 0.5)
        samples = max(samples + 1, ceil(_QUARTERS * log2(tolerance / max(needed, _LEAST_TOLERANCE * tolerance))))
    if stepping > STEPPING_SHARE * spare:
        needed = stepping / (0.5 * STEPPING_SHARE * spare)
        steps += ceil(_QUARTERS * min(max(log2(min(needed, 1e300)) / ORDER, 1.0 / _QUARTERS), 2.0))
    elif rotation.rounding_error[row] > STEPPING_SHARE * tolerance:
        # Marches with finer steps differ by nothing but their rounding, which then is measured.
        steps += _QUARTERS // 2
    return Refinement(samples, steps)


def one_round(
    sampler: Sampler,
    momentum: Array,
    tolerance: float,
    ceiling: float,
    refinement: Refinement,
    threads: int | None = None,
) -> tuple[SteppedRotation, float]:
    """Rotations of momenta (B, 3) up to a ceiling [kg m^2/s] with error estimates, and the level of the samples.

    Rotations within the tolerance have been compared with the body at fresh times.
    """
    needed = refinement.sampling_tolerance(tolerance)
    samples = sampler.samples(ceiling, needed, strict=not refinement.samples)
    steps = planned(samples.interpolant, ceiling, tolerance, refinement.factor)
    attempt = attempted(samples.interpolant, samples.perturbed.coefficients, steps, momentum, threads)
    rotation = rotation_of(samples, attempt, momentum, tolerance)
    done = rotation.error_estimate <= tolerance
    if done.any():
        times, _ = fresh_times(samples.interpolant)
        compare(samples.interpolant, sampler.channels(times), ceiling, tolerance)
    elif samples.too_rough is not None:
        raise samples.too_rough
    return rotation, samples.level


def planned(interpolant: Interpolant, ceiling: float, tolerance: float, factor: float) -> Integers:
    """The coarsest steps on each panel, a fourth of those that count: (P,). Raises AccuracyNotReached."""
    turn, terms = np.empty((2, len(interpolant.widths)))
    least = SMALL_TERM * tolerance
    spectra_kernel.plan(plain(interpolant.coefficients), interpolant.widths, ceiling, least, turn, terms)
    finer = (USUAL_TOLERANCE / tolerance) ** (1.0 / ORDER)
    # However loose the tolerance, only steps that follow the terms show their error.
    steps = np.maximum(max(finer, 1.0) * terms / TERMS_OF_STEP, finer * turn / ANGLE_OF_STEP)
    steps = factor * np.maximum(steps, 1.0)
    total = 4.0 * interpolant.loops * float(steps.sum())
    if total > _MOST_STEPS:
        turns = interpolant.loops * float(turn.sum()) / (2.0 * np.pi)
        raise AccuracyNotReached(
            f"the body turns up to {turns:.3g} times in {interpolant.edges[-1]:.6g} s, which takes some {total:.3g} "
            f"steps; at most {_MOST_STEPS} are taken, enough for about {turns * _MOST_STEPS / total:.3g} turns: "
            "shorten the motion, or lower the momentum"
        )
    return np.ceil(steps).astype(np.int64)


def rotation_of(samples: Samples, attempt: Attempt, momentum: Array, tolerance: float) -> SteppedRotation:
    """Steps with their error estimates."""
    interpolant, growth = samples.interpolant, attempt.amplification
    # A fall twice as fast as by the order, or faster, is not asymptotic: the next may be slower by the same factor.
    ratio = 2.0**ORDER * attempt.fine / np.maximum(attempt.coarse, _TINY)
    fell = 2.0**-ORDER * np.clip(np.maximum(ratio, 0.5 / np.maximum(ratio, _TINY)), 1.0, 2.0**ORDER)
    committed = _committed(attempt.dynamics.shape[1], attempt.turned)
    rounding = growth * committed * samples.condition
    # Marches also differ by their rounding, which is no error of steps.
    apart = np.maximum(attempt.fine - rounding, 0.0)
    stepping = np.where(attempt.fine < _LOST, STEPPING * fell * apart, np.pi)
    large = np.flatnonzero((rounding > ROUNDING_SHARE * tolerance) & (attempt.fine < _LOST))
    if len(large):
        measured = committed[large] + MEASURED_ROUNDING * attempt.fine[large]
        measured += rounding_of_samples(samples, attempt.steps // 4, momentum[large])
        rounding[large] = np.minimum(rounding[large], measured)
    # Times are rounded by eps times the duration, which no march shows.
    inverse, drift = samples.rates
    rounding += EPS * float(interpolant.edges[-1]) * (magnitudes_and_directions(momentum)[0] * inverse + drift)
    sampling = np.maximum(attempt.sampling, samples.between) + growth * samples.hidden
    return SteppedRotation(
        interpolant=interpolant,
        momentum=momentum,
        steps=attempt.steps,
        quaternions=attempt.quaternions,
        directions=attempt.directions,
        turns=attempt.turns,
        dynamics=attempt.dynamics,
        sampling_error=sampling,
        stepping_error=stepping,
        rounding_error=rounding,
        amplification=growth,
        perturbed=samples.perturbed,
    )


def _committed(steps: int, turned: Array) -> Array:
    """Rounding of steps, not amplified: (B,) [rad]."""
    return EPS * (ROUNDING_OF_START + ROUNDING_OF_STEP * np.sqrt(steps) + turned)


def committed_rounding(quaternions: Array) -> Array:
    """Rounding of steps that end at these attitudes, not amplified: (B, K + 1, 4) -> (B,) [rad]."""
    chords = np.diff(quaternions, axis=1)
    turned = 2.0 * np.sqrt((chords * chords).sum(axis=2)).sum(axis=1)
    return _committed(quaternions.shape[1] - 1, turned)


def rounding_of_samples(samples: Samples, steps: Integers, momentum: Array) -> Array:
    """Attitude error because inertias are rounded, amplified along the motion: (B,) [rad]."""
    interpolant, series = samples.interpolant, samples.interpolant.coefficients
    same = stepped_quaternions(interpolant, series, steps, momentum)
    rounded = stepped_quaternions(interpolant, rounded_series(samples, _EXAGGERATED * ROUNDED_INERTIA), steps, momentum)
    return largest_angle(same, rounded) / _EXAGGERATED


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

    `gaps` (..., N, 9) are those of the channels, `coefficients` (..., N, n, 9) those of the series, `widths` (N,) those
    of their panels [s], `momentum` is a magnitude [kg m^2/s].
    """
    is_term = np.abs(coefficients).max(axis=-1) > 0.0
    degrees = is_term.shape[-1] - 1 - np.argmax(is_term[..., ::-1], axis=-1)
    return rates_of(gaps, momentum) * widths / np.maximum(degrees, 1)


def compare(interpolant: Interpolant, body: Array, momentum: float, tolerance: float) -> None:
    """Compare an interpolant with the body's channels (N, 9) at its fresh times.

    Error estimates come from an interpolant's own series; only this comparison shows a fault in how these were put
    together. Series within their estimates are off by swings of at most a third of the tolerance [rad], over all loops
    and for momenta up to a magnitude [kg m^2/s]. Raises AccuracyNotReached for a swing above the tolerance.
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
