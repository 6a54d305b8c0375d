"""Whether configurations and velocities belong to each other: the rates that are given against those of the samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array
from ..display import frozen
from ._observation import REACH, difference_weights, differentiated, fewer_neighbours, turn_rates
from ._smooth_part import smooth_part
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise

_ROUNDING = 32.0 * float(np.finfo(np.float64).eps)  # of a rate or coordinate: rounding of 32 operations

_LEAST = 1e-150  # [rad/s or m/s] Noise of what never moves, whose square is a number, too
_HELD = 2.0 / 12.0  # of squared step times jerk: torques held over a step shift rates by half a step


@frozen(kw_only=True)
class RateAgreement:
    """How far the given rates are from those that attitudes, places and joints have.

    Attributes
    ----------
    times : (M,) [s]
    mismatch : the slow part of the differences relative to the rates themselves, of the worst of base and joints
    ratio : the same in units of what noise explains: above 1, noise does not
    late : by how much the rates are late against the configurations [s]
    mismatch_less_late : the mismatch once that is taken off
    colour : mean power of the noise of the worst over that of white noise with its highest frequencies

    Examples
    --------
    >>> agreement = sp.auditing.RateAgreement(
    ...     times=np.zeros(1), mismatch=0.0, ratio=0.0, late=0.0, mismatch_less_late=0.0)
    >>> agreement.late
    0.0
    """

    times: Array
    mismatch: float
    ratio: float
    late: float
    mismatch_less_late: float
    colour: float = 1.0


def rate_agreement(trajectory: FloatingTrajectory, noise: TrajectoryNoise) -> RateAgreement | None:
    """None where no rates are given."""
    found = rate_differences(trajectory, noise)
    if found is None:
        return None
    late = _late(found)
    mismatch, ratio, colour = _slow(found)
    less = replace(found, difference=found.difference - late * found.slope)
    return RateAgreement(
        times=found.times,
        mismatch=mismatch,
        ratio=ratio,
        late=late,
        mismatch_less_late=_slow(less)[0],
        colour=colour,
    )


@dataclass(frozen=True, eq=False)
class RateDifferences:
    """Rates of the samples less those given.

    times : (M,) [s]
    difference : (M, k) of base and joints
    level : (M, k) its noise
    bias : (M, k) of its square, what is no noise and may be alike for all samples
    slope : (M, k) derivative of the given rates
    rates : (M, k) as given
    kinds : (k,) what each column is of
    """

    times: Array
    difference: Array
    level: Array
    bias: Array
    slope: Array
    rates: Array
    kinds: tuple[str, ...]


def rate_differences(trajectory: FloatingTrajectory, noise: TrajectoryNoise) -> RateDifferences | None:
    """None where no rates are given."""
    rate, joint_rates = trajectory.base_rate, trajectory.joint_rates
    if rate is None or joint_rates is None:
        return None
    weights = difference_weights(trajectory.times)
    fewer = fewer_neighbours(trajectory.times)
    inner = slice(REACH, len(trajectory.times) - REACH)
    spread = np.sqrt((weights**2).sum(axis=1))[:, None]
    turns = [turn_rates(trajectory.attitude, each) for each in (weights, fewer)]
    # How it moves, rates by differences and by those of fewer neighbours, as given, noise of both, how far it is.
    pairs: list[tuple[str, Array, Array, Array, float, float, float]] = []
    pairs.append(("base turns", turns[0], turns[1], rate, noise.attitude, noise.rate, 1.0))
    if trajectory.world_velocity is not None and trajectory.position is not None:
        far = float(np.abs(trajectory.position).max(initial=0.0))
        own = [differentiated(trajectory.position, each) for each in (weights, fewer)]
        pairs.append(("base goes", own[0], own[1], trajectory.world_velocity, noise.position, noise.velocity, far))
    found = [differentiated(trajectory.shapes, each) for each in (weights, fewer)]
    for joint, (of_shape, of_rate) in enumerate(zip(noise.joints, noise.joint_rates, strict=True)):
        far = float(np.abs(trajectory.shapes[:, joint]).max(initial=0.0))
        own = [each[:, [joint]] for each in found]
        pairs.append(("joints", own[0], own[1], joint_rates[:, [joint]], of_shape, of_rate, far))
    slopes, differences, levels, biases, kinds = [], [], [], [], []
    held = _HELD * trajectory.assumed_step**2
    again = difference_weights(trajectory.times[inner])
    for kind, own, narrow, given, of_place, of_rate, far in pairs:
        fast = float(np.abs(given).max(initial=0.0))
        rounding = _ROUNDING * (fast + far * spread)
        # What differences cut off is less than what those of fewer neighbours do.
        slope = differentiated(given, weights)
        # Rates of the base in other axes have another jerk than its configurations.
        bend = np.pad(differentiated(own, again), ((REACH, REACH), (0, 0)), mode="edge")
        jerk = np.gradient(slope if kind == "joints" else bend, trajectory.times[inner], axis=0)
        cut = (own - narrow) ** 2 + (held * jerk) ** 2
        known = cut + cut.mean(axis=0)
        level = np.sqrt((spread * of_place) ** 2 + of_rate**2 + rounding**2 + known)
        biases.append(known)
        slopes.append(slope)
        differences.append(own - given[inner])
        levels.append(np.maximum(level, _LEAST))
        kinds += [kind] * own.shape[1]
    return RateDifferences(
        times=trajectory.times[inner],
        difference=np.hstack(differences),
        level=np.hstack(levels),
        bias=np.hstack(biases),
        slope=np.hstack(slopes),
        rates=np.hstack([given[inner] for _, _, _, given, *_ in pairs]),
        kinds=tuple(kinds),
    )


def _late(found: RateDifferences) -> float:
    """The time by which late rates explain the most: given(t) = own(t - late)."""
    weighted = found.slope / found.level**2
    below = float((weighted * found.slope).sum())
    return float((weighted * found.difference).sum()) / below if below > 0.0 else 0.0


def _slow(found: RateDifferences) -> tuple[float, float, float]:
    """The worst slow part over the rates of its kind, the worst over what noise explains, and the colour of noise."""
    mismatch, ratio, colour = 0.0, 0.0, 1.0
    for kind in dict.fromkeys(found.kinds):
        columns = [k for k, other in enumerate(found.kinds) if other == kind]
        # What is alike for all samples counts in the slow part by their number.
        squares = found.level**2 + len(found.times) * found.bias
        whitened = found.difference[:, columns] / np.sqrt(squares[:, columns])
        fast = float(np.sqrt((found.rates[:, columns] ** 2).sum(axis=1).mean()))
        parts = [
            smooth_part(
                found.times,
                found.difference[:, [k]],
                squares[:, [k]][:, :, None],
                0,
                whitened=whitened[:, [place]],
                size=fast,
            )
            for place, k in enumerate(columns)
        ]
        values = np.hstack([part.values for part in parts])
        slow = float(np.sqrt((values**2).sum(axis=1).mean()))
        mismatch = max(mismatch, slow / fast if fast > 0.0 else 0.0)
        ratio = max(ratio, *(part.ratio for part in parts))
        colour = max(colour, *(part.colour for part in parts))
    return mismatch, ratio, colour
