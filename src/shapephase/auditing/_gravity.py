"""The hypothesis that gravity is wrong: the acceleration of the fall against 9.81 m/s^2 along an axis of the world."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..shape_space.free_fall import GRAVITY
from ._observation import Observation
from ._step_drift import step_drift
from .audit_result import RunAudit
from .hypothesis import FittedValue, Hypothesis

_ELSEWHERE = 0.005  # of gravity: on earth it is 9.78 to 9.83 m/s^2
_BARS = 4.0  # standard deviations by which it has to be off
_OF_A_PARABOLA = 720.0  # variance of the acceleration of a parabola over T, of N samples of variance one: 720 / (N T^4)
_SAG = 8.0  # acceleration of a parabola over T whose middle is off its chord by s: 8 s / T^2
_AXES = "xyz"


def wrong_gravity(
    body: Body, seen: Sequence[Observation], runs: Sequence[RunAudit], wander: float, steps: Sequence[float]
) -> Hypothesis | None:
    """None where every fall is that on earth with x, y or z up, of a recording also down, or none, as in orbit.

    Parameters
    ----------
    runs : results of the same trajectories
    wander : of the centre of mass of those that are recordings [m]
    steps : of semi-implicit Euler, whose drift of the centre of mass is taken off [s]
    """
    for sampled, run, step in zip(seen, runs, steps, strict=True):
        if sampled.centre is None or sampled.centre_noise is None or run.fall_off is None:
            continue
        off = max(run.fall_off, wander if run.recorded else 0.0)
        drift = step_drift(body, sampled, None).centre if step else None
        centre = sampled.centre if drift is None else sampled.centre - step * drift
        pull, bar = _fall(sampled.times, centre, sampled.centre_noise, off)
        by_step = pull - _fall(sampled.times, sampled.centre, sampled.centre_noise, off)[0]
        size, axis = float(np.linalg.norm(pull)), int(np.argmax(np.abs(pull)))
        # What a step adds is known as well as the rates are, whose frame may be wrong.
        allowed = _ELSEWHERE * GRAVITY + _BARS * bar + float(np.linalg.norm(by_step))
        expected = np.zeros(3)
        expected[axis] = np.copysign(GRAVITY, pull[axis]) if run.recorded else -GRAVITY
        if size > allowed and np.linalg.norm(pull - expected) > allowed:
            tilt = float(np.degrees(np.arccos(min(abs(pull[axis]) / size, 1.0))))
            return Hypothesis(
                name="gravity",
                kind="gravity",
                square=0.0,
                left_over=0.0,
                parameters=3,
                share=0.0,
                values={
                    "size": FittedValue(value=size, bar=bar, unit="m/s^2"),
                    "tilt": FittedValue(value=tilt, bar=float(np.degrees(bar / size)), unit="deg"),
                },
                remark=f"{run.name} falls towards {'-' if pull[axis] < 0.0 else '+'}{_AXES[axis]}; expected "
                f"{GRAVITY:.4g} m/s^2 along an axis of the world with x, y or z up, or no weight",
            )
    return None


def _fall(times: Array, centres: Array, covariances: Array, off: float) -> tuple[Array, float]:
    """Acceleration (3,), and its standard deviation by noise and by how far the centre of mass may be off [m/s^2]."""
    span = float(times[-1] - times[0])
    pull = 2.0 * np.linalg.lstsq(np.vander((times - times[0]) / span, 3), centres, rcond=None)[0][0]
    variance = float(np.trace(covariances, axis1=1, axis2=2).mean()) / 3.0
    bar = float(np.hypot(np.sqrt(_OF_A_PARABOLA * variance / len(times)), _SAG * off))
    return pull / span**2, bar / span**2
