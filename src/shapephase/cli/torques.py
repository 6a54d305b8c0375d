"""`shapephase torques`: what the joints of a free body must do for its motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from . import options
from .options import option
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import write_file


def torques_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    start: options.StartOptions = options.START_DEFAULTS,
    tolerance: options.Tolerance = 1e-9,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    out: Annotated[
        Path | None,
        option(
            "Write torque or force, rate and power of each joint in time, in N m, N, rad/s, m/s and W, to this CSV "
            "file; for example `--out torques.csv`."
        ),
    ] = None,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Find the torques of the joints: their peaks against the limits of the body's file, power and work.

    The body floats or falls freely: gravity loads no joint.
    """
    from ..dynamics.torques import joint_torques
    from . import motion as motions
    from .texts.recording_text import recording_data
    from .texts.torque_text import load_bars, torque_data, torque_lines

    aside = check_writable(out, "--out", ".csv")
    with steps(3) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(body, motion, start, recording, tolerance, work.watch, floating=floating, wheels=wheels)
        work.begin("inverse dynamics")
        found = joint_torques(flown.motion)
        write_file(out, found.write_csv)
        work.begin("error bars")
        bars, of_bars = load_bars(flown.motion, found.loads, flown.recorded)
    text = torque_lines(found.loads, flown.motion, flown.body, motion, bars) + ([of_bars] if of_bars else [])
    text[0] += flown.beginning
    data = torque_data(found, flown.motion, flown.body, motion, bars) | recording_data(flown.recorded)
    return Outcome("\n".join(text), data, aside=aside, made_from=flown.motion.deformation.made_from)
