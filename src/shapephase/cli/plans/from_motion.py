"""Goals of `shapephase plan` that a recorded motion states: undo it, or match its posture and attitude at a time."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

from ...errors import ShapeError
from ..options import RECORDING_DEFAULTS, START_DEFAULTS, BodyOptions, RecordingOptions, StartOptions
from .constraints import JointOptions
from .goals import GoalOptions

if TYPE_CHECKING:
    from ..motion import LoadedMotion

_TOLERANCE = 1e-11  # [rad] of the recording's attitude: plans reach their goal to 1e-8


def check_needed(goal: GoalOptions, start: StartOptions, recording: RecordingOptions) -> None:
    """Raise ShapeError for options of a recording without one, and of a start that the goal does not take."""
    taken, given = ["up", "momentum"], vars(start)
    if goal.match is not None:
        taken.append("attitude")
    elif goal.undo is None:
        given = given | vars(recording)
    else:
        return
    usual = vars(RECORDING_DEFAULTS) | vars(START_DEFAULTS)
    for name, value in given.items():
        if name not in taken and value != usual[name]:
            raise ShapeError(f"--{name.replace('_', '-')}: goes with --undo, which is not given")


def undone(
    body: str,
    motion: str,
    start: StartOptions,
    recording: RecordingOptions,
    floating: BodyOptions,
    joints: JointOptions,
    rates_at_ends: str,
) -> LoadedMotion:
    """Return the motion of --undo. Raises ShapeError for options that it determines, and as `flight`."""
    from .. import motion as motions

    stated = {"--from": joints.from_, "--to": joints.to, "--via": joints.via}
    for name in [name for name, value in stated.items() if value]:
        raise ShapeError(f"{name}: the postures at both ends of the way back are those of --undo; leave it out")
    if rates_at_ends != "zero":
        raise ShapeError("--rates-at-ends: the way back of --undo is from rest to rest; leave it out")
    return motions.flight(body, motion, start, recording, _TOLERANCE, floating=floating)


def matched(
    body: str, text: str, start: StartOptions, recording: RecordingOptions, floating: BodyOptions
) -> dict[str, Any]:
    """Return the arguments of a plan for --match: goal and momentum in base axes at the start, and the posture."""
    import numpy as np

    from ... import so3
    from ...optimal_control.plan_options import Goal
    from .. import motion as motions

    file, timed, at = (text, "", "") if os.path.exists(text) else text.rpartition("@")
    if not timed:
        file = text
    flown = motions.flight(body, file, START_DEFAULTS, recording, _TOLERANCE, floating=floating)
    time = _time(at, flown.motion.duration) if timed else flown.motion.duration
    attitude = np.eye(3) if start.attitude is None else so3.quat_argument(start.attitude, "attitude")
    momentum = np.zeros(3) if start.momentum is None else np.array(start.momentum)
    back = so3.transpose(attitude)
    goal = Goal(rotation=back @ flown.motion.attitude(time))
    return {
        "goal": goal,
        "end": flown.path.matched(flown.body.joint_names, flown.body.name).shape(time),
        "momentum": so3.apply(back, momentum),
    }


def _time(text: str, duration: float) -> float:
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not 0.0 <= time <= duration:
        raise ShapeError(f"--match: behind @ a time from 0 to {duration:g} s is needed, got {text!r}")
    return time
