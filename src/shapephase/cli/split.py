"""`shapephase split`: the rotation of a free body, split into holonomy and phase."""

from __future__ import annotations

from pathlib import Path

from .options import (
    BODY_DEFAULTS,
    ERROR_DEFAULTS,
    PRINT_DEFAULTS,
    RECORDING_DEFAULTS,
    START_DEFAULTS,
    BodyArgument,
    BodyOptions,
    ErrorOptions,
    Gauge,
    MotionArgument,
    PrintOptions,
    RecordingOptions,
    ReportFile,
    StartOptions,
    Tolerance,
)
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import say_written

_ROWS = 201
"""Of a table of phases in time, as of attitudes."""


def split_command(
    body: BodyArgument,
    motion: MotionArgument,
    /,
    *,
    floating: BodyOptions = BODY_DEFAULTS,
    flight: StartOptions = START_DEFAULTS,
    gauge: Gauge = "horizontal",
    tolerance: Tolerance = 1e-9,
    recording: RecordingOptions = RECORDING_DEFAULTS,
    errors: ErrorOptions = ERROR_DEFAULTS,
    out: Path | None = None,
    samples: Path | None = None,
    phases: Path | None = None,
    html: ReportFile = None,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Split the rotation of a free body into shape holonomy and Montgomery phase.

    Parameters
    ----------
    out
        Write the motion to this NPZ file, or to a pipe; without it none is written. For example `--out fall.npz`.
    samples
        Write base and joints at 201 even times to this file (.csv, .parquet, .nc, .mat, .h5), in SI units; without it
        none is written. For example `--samples fall.nc`.
    phases
        Write the phases in time, in degrees and in radians, to this CSV file; its last row is the table's. Without it
        none is written. For example `--phases phases.csv`.
    """
    import numpy as np

    from ..exports.tables import ENDINGS, export_motion
    from ..phases.phases import running_phases, split
    from ..phases.split_text import split_lines, wrapped
    from ..phases.whole_turns import turn_counts
    from ..shape_space.body_path import in_joint_order, path_gap
    from . import motion as motions
    from .texts.error_bar_text import error_bar_data, error_bar_lines, error_bars, joint_noise
    from .texts.recording_text import fit_data, fit_lines, recording_data, recording_lines
    from .texts.result_text import gap_text, recorded_base_text, split_data, split_heading

    aside = check_writable(out, "--out", ".npz")
    aside = check_writable(samples, "--samples", *ENDINGS) or aside
    aside = check_writable(phases, "--phases", ".csv") or aside
    aside = check_writable(html, "--html", ".html") or aside
    if html is not None:
        from ..plots.pages.up_axis import up_axis

        up_axis(recording.up, None)
    with steps(13 if html else 2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(body, motion, flight, recording, tolerance, work.watch, gauge=gauge, floating=floating)
        work.begin("splitting")
        result = split(flown.motion, gauge, progress=work.watch)
        bars = error_bars(flown.motion, errors, flown.recorded, flown.fitted)
        if flown.fitted is None or bars is None:
            lines, data = recorded_base_text(flown.motion, flown.recorded)
        else:
            lines, data = fit_lines(flown.fitted, bars), fit_data(flown.fitted)
        if out is not None:
            flown.motion.save(out)
            say_written(out)
        if samples is not None:
            export_motion(flown.motion, samples)
            say_written(samples)
        if phases is not None:
            times = np.linspace(0.0, flown.motion.duration, _ROWS)
            running_phases(flown.motion, times, gauge).write_csv(phases)
            say_written(phases)
        if html is not None:
            from ..plots.report import write_report

            title = f"{flown.body.name} along {Path(motion).name}"
            write_report(
                flown.motion,
                result,
                html,
                shape_path=flown.path,
                title=title,
                up=recording.up or flown.up,
                error_bars=error_bar_lines(result, bars, flown.recorded, errors),
                recording=[*lines, *recording_lines(flown.body, flown.recorded)],
                noise=joint_noise(flown.body, errors),
                begin=work.begin,
            )
            say_written(html)
    turns = turn_counts(flown.motion, result)
    gap = path_gap(flown.body, in_joint_order(flown.body, flown.path))
    open_by = "" if result.is_loop else f"{gap_text(flown.body, gap)} from its start"
    text = [
        *split_lines(result, split_heading(flown.body, motion, flown.motion), open_by),
        *wrapped(str(turns)),
        *error_bar_lines(result, bars, flown.recorded, errors),
        *lines,
        *recording_lines(flown.body, flown.recorded),
    ]
    text[0] += flown.beginning
    data = split_data(flown.body, motion, flown.motion, result) | error_bar_data(bars) | data
    data |= turns.to_dict() | recording_data(flown.recorded)
    return Outcome("\n".join(text), data, aside=aside, made_from=flown.motion.deformation.made_from)
