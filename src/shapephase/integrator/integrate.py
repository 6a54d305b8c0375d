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
    ROUNDING_OF_START,
    ROUNDING_OF_STEP,
    STEPPING,
    STEPPING_SHARE,
    TERMS_OF_STEP,
)
from .fresh_times import compare, fresh_times
from .interpolant import Interpolant
from .marches import Attempt, attempted, magnitudes_and_directions
from .sampling import Sampler, Samples
from .stepped import SteppedRotation

# Steps of one motion: some ten seconds, and a gigabyte of results.
_MOST_STEPS = 4_000_000
# Rounds of samples and steps before a tolerance is given up.
_MOST_ROUNDS = 10
# Of the best estimate so far: a round that gains less was no use; two of them end it.
_GAINS = 0.9
# The tolerance [rad] of the steps that ANGLE_OF_STEP and TERMS_OF_STEP are for.
_USUAL = 1e-9
# Refinements are made stricter by less than this factor, so that momenta of a batch share them.
_QUARTERS = 4
# [rad] Marches farther apart than this tell nothing of how errors fall.
_LOST = 0.1
# Times of a motion at which its rate and inertia are looked at.
_PLACES = 17


class Refinement(NamedTuple):
    """How much stricter samples and steps are than at first: both times 2^(k/4), as whole numbers k."""

    samples: int = 0
    steps: int = 0

    def sampling_tolerance(self, tolerance: float) -> float:
        """Of samples [rad]."""
        return tolerance * 2.0 ** (-self.samples / _QUARTERS)

    @property
    def factor(self) -> float:
        """Of the number of steps."""
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
        rotation = one_round(sampler, momentum, tolerance, ceiling, progress.refinement)
        if (rotation.error_estimate <= tolerance).all():
            return rotation
        worst = int(np.argmax(rotation.error_estimate))
        progress = progress.after(rotation, worst, tolerance)


class Progress(NamedTuple):
    """What rounds have come to."""

    refinement: Refinement = Refinement()
    best: float = np.inf
    rounds: int = 0
    in_vain: int = 0

    def after(self, rotation: SteppedRotation, row: int, tolerance: float) -> Progress:
        """What the next round does for a row. Raises AccuracyNotReached where none will help."""
        estimate = float(rotation.error_estimate[row])
        in_vain = self.in_vain + (estimate > _GAINS * self.best)
        refinement = refined(self.refinement, rotation, row, tolerance)
        if in_vain >= 2 or self.rounds >= _MOST_ROUNDS or refinement == self.refinement:
            raise AccuracyNotReached(
                f"the tolerance {tolerance:.3g} rad was not reached: the estimate is {estimate:.3g} rad, of which "
                f"sampling {rotation.sampling_error[row]:.3g}, stepping {rotation.stepping_error[row]:.3g} and rounding "
                f"{rotation.rounding_error[row]:.3g}, with errors amplified {rotation.amplification[row]:.3g} times; "
                "loosen the tolerance or shorten the motion"
            )
        return Progress(refinement, min(estimate, self.best), self.rounds + 1, in_vain)


def refined(last: Refinement, rotation: SteppedRotation, row: int, tolerance: float) -> Refinement:
    """What the parts of an error ask for: more samples, more steps, or both."""
    sampling, stepping = float(rotation.sampling_error[row]), float(rotation.stepping_error[row])
    samples, steps = last
    spare = max(tolerance - float(rotation.rounding_error[row]), 0.5 * tolerance)
    if sampling > STEPPING_SHARE * spare:
        samples += ceil(_QUARTERS * log2(max(min(4.0 * sampling / spare, 1e6), 2.0)))
    if stepping > STEPPING_SHARE * spare:
        wanted = stepping / (0.5 * STEPPING_SHARE * spare)
        steps += ceil(_QUARTERS * min(max(log2(min(wanted, 1e300)) / ORDER, 1.0 / _QUARTERS), 2.0))
    return Refinement(samples, steps)


def one_round(
    sampler: Sampler,
    momentum: Array,
    tolerance: float,
    ceiling: float,
    refinement: Refinement,
    threads: int | None = None,
) -> SteppedRotation:
    """Sample and step momenta (B, 3) up to a ceiling [kg m^2/s], with error estimates, within the tolerance or not.

    What is within it has been compared with the body at fresh times.
    """
    wanted = refinement.sampling_tolerance(tolerance)
    samples = sampler.samples(ceiling, wanted, strict=not refinement.samples)
    steps = planned(samples.interpolant, ceiling, tolerance, refinement.factor)
    found = attempted(samples.interpolant, samples.perturbed.coefficients, steps, momentum, threads)
    rotation = rotation_of(samples, found, momentum)
    done = rotation.error_estimate <= tolerance
    if done.any():
        times, _ = fresh_times(samples.interpolant)
        compare(samples.interpolant, sampler.channels(times), ceiling, tolerance)
    elif samples.too_rough is not None:
        raise samples.too_rough
    return rotation


def planned(interpolant: Interpolant, ceiling: float, tolerance: float, factor: float) -> Integers:
    """The coarsest steps on each panel, a fourth of those that count: (P,). Raises AccuracyNotReached."""
    terms = rates_of(interpolant.coefficients, ceiling) * interpolant.widths[:, None]
    finer = (_USUAL / tolerance) ** (1.0 / ORDER)
    counted = np.arange(terms.shape[1]) * (terms > STEPPING_SHARE * tolerance)
    turn = terms.sum(axis=1)
    steps = finer * np.maximum(counted.max(axis=1) / TERMS_OF_STEP, turn / ANGLE_OF_STEP)
    steps = factor * np.maximum(steps, 1.0)
    total = 4.0 * interpolant.loops * float(steps.sum())
    if total > _MOST_STEPS:
        turns = interpolant.loops * float(turn.sum()) / (2.0 * np.pi)
        raise AccuracyNotReached(
            f"the body turns up to {turns:.3g} times in {interpolant.edges[-1]:.6g} s, which takes some {total:.3g} "
            f"steps; at most {_MOST_STEPS} are taken, enough for about {turns * _MOST_STEPS / total:.3g} turns: shorten "
            "the motion, or lower the momentum"
        )
    return np.ceil(steps).astype(np.int64)


def rotation_of(samples: Samples, found: Attempt, momentum: Array) -> SteppedRotation:
    """Steps with their error estimates."""
    interpolant, growth = samples.interpolant, found.growth
    fell = np.clip(found.fine / np.maximum(found.coarse, 1e-300), 2.0**-ORDER, 1.0)
    stepping = np.where(found.fine < _LOST, STEPPING * fell * found.fine, np.pi)
    committed = _committed(found.dynamics.shape[1], found.turned)
    rounding = np.minimum(growth * committed, committed + MEASURED_ROUNDING * found.fine)
    rounding += rounding_of_body(interpolant, found, momentum)
    sampling = np.maximum(found.sampling, samples.between) + growth * samples.hidden
    return SteppedRotation(
        interpolant=interpolant,
        momentum=momentum,
        steps=found.steps,
        quaternions=found.quaternions,
        directions=found.directions,
        turns=found.turns,
        dynamics=found.dynamics,
        sampling_error=sampling,
        stepping_error=stepping,
        rounding_error=rounding,
        amplification=growth,
        perturbed=samples.perturbed,
    )


def _committed(steps: int, turned: Array) -> Array:
    """What steps round, ungrown: (B,) [rad]."""
    return EPS * (ROUNDING_OF_START + ROUNDING_OF_STEP * np.sqrt(steps) + turned)


def committed_rounding(quaternions: Array) -> Array:
    """The same of attitudes at the ends of steps: (B, K + 1, 4) -> (B,) [rad]."""
    chords = np.diff(quaternions, axis=1)
    turned = 2.0 * np.sqrt((chords * chords).sum(axis=2)).sum(axis=1)
    return _committed(quaternions.shape[1] - 1, turned)


def rounding_of_body(interpolant: Interpolant, found: Attempt, momentum: Array) -> Array:
    """Attitude error because inertia and times are rounded before anything is sampled: (B,) [rad].

    Inertia is off by eps |I| in any direction, which turns a body that spins at omega off by eps |I| |I^-1 omega| a
    second: of a slender body about its long axis that is as many units a radian as its moments differ by. Times are off
    by eps times the duration. No march shows either, since all have them in common.
    """
    magnitudes, _ = magnitudes_and_directions(momentum)
    ends = np.cumsum(found.steps)
    chosen = np.unique(np.linspace(0, interpolant.loops * int(ends[-1]), _PLACES).astype(np.int64))
    of_loop = chosen % ends[-1]
    panel = np.searchsorted(ends, of_loop, side="right")
    share = (of_loop - ends[panel] + found.steps[panel]) / found.steps[panel]
    inverse, drift = interpolant.inverse_and_drift(interpolant.edges[panel] + share * interpolant.widths[panel])
    rates = np.broadcast_to(-drift, (len(magnitudes), *drift.shape))
    if found.directions.shape[1]:
        turning = (found.directions[:, chosen][:, :, None] * inverse).sum(axis=-1)
        rates = rates + magnitudes[:, None, None] * turning
    sizes = 1.0 / np.linalg.eigvalsh(inverse)[:, 0]
    off = sizes * np.sqrt((((rates[:, :, None] * inverse).sum(axis=-1)) ** 2).sum(axis=-1))
    fastest = magnitudes * rates_of(interpolant.coefficients * np.repeat([1.0, 0.0], [6, 3]), 1.0).sum(axis=1).max()
    fastest = fastest + rates_of(interpolant.coefficients, 0.0).sum(axis=1).max()
    return EPS * float(interpolant.edges[-1]) * (off.mean(axis=1) + fastest)
