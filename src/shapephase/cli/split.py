"""`shapephase split`: the rotation of a free body, split into holonomy and phase."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from . import options
from .options import option, rare
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import write_file

_ROWS = 201  # of the table of phases, as many as of samples


def split_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    start: options.StartOptions = options.START_DEFAULTS,
    gauge: options.Gauge = "horizontal",
    tolerance: options.Tolerance = 1e-9,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    errors: options.ErrorOptions = options.ERROR_DEFAULTS,
    html: options.ReportFile = None,
    out: Annotated[
        Path | None, option("Write the motion to this NPZ file, or to a pipe; for example `--out fall.npz`.")
    ] = None,
    samples: Annotated[
        Path | None,
        rare(
            "Write base and joints at 201 even times to this file (.csv, .parquet, .nc, .mat, .h5, .mcap), in SI "
            "units; for example `--samples fall.nc`.",
        ),
    ] = None,
    link_momenta: Annotated[
        bool,
        rare(
            "Write the angular momentum of each link into --samples, too, in kg m^2/s; for example "
            "`--samples fall.csv --link-momenta`.",
            negative="",
        ),
    ] = False,
    phases: Annotated[
        Path | None,
        rare(
            "Write the phases in time, in degrees and in radians, to this CSV file, whose last row is the table's; for "
            "example `--phases phases.csv`.",
        ),
    ] = None,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Split the rotation of a free body into shape holonomy and Montgomery phase."""
    import numpy as np

    from ..errors import ShapeError
    from ..exports.tables import ENDINGS, export_motion
    from ..phases.phases import running_phases, split
    from ..phases.split_text import split_lines, wrapped
    from ..phases.whole_turns import turn_counts
    from ..shape_space.body_path import in_joint_order, path_gap
    from . import motion as motions
    from .texts.error_bar_text import error_bar_data, error_bar_lines, error_bars, joint_noise
    from .texts.recording_text import fit_data, fit_lines, recording_data, recording_lines
    from .texts.result_text import gap_text, recorded_base_text, split_data, split_heading

    files = {"--out": (out, ".npz"), "--samples": (samples, *ENDINGS), "--phases": (phases, ".csv")}
    files["--html"] = html, ".html"
    aside = True in [check_writable(file, option, *endings) for option, (file, *endings) in files.items()]
    if link_momenta and samples is None:
        raise ShapeError("--link-momenta: the momenta are written into --samples; give its file, too")
    if html is not None:
        from ..plots.pages.motion_data import up_axis

        up_axis(recording.up, None)
    with steps(3 if html else 2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(
            body, motion, start, recording, tolerance, work.watch, gauge=gauge, joint_noise=errors.joint_noise,
            floating=floating, wheels=wheels,
        )  # fmt: skip
        work.begin("splitting")
        result = split(flown.motion, gauge, progress=work.watch)
        bars = error_bars(flown.motion, errors, flown.recorded, flown.fitted)
        if flown.fitted is None or bars is None:
            lines, data = recorded_base_text(flown.motion, flown.recorded)
        else:
            lines, data = fit_lines(flown.fitted, bars), fit_data(flown.fitted)
        turns = turn_counts(flown.motion, result)
        bar_lines = error_bar_lines(result, bars, flown.recorded, errors, turns)
        times = np.linspace(0.0, flown.motion.duration, _ROWS)
        write_file(out, flown.motion.save)
        write_file(samples, lambda file: export_motion(flown.motion, file, links=link_momenta))
        write_file(phases, lambda file: running_phases(flown.motion, times, gauge).write_csv(file))
        if html is not None:
            work.begin("making the report")
            from ..plots.pages.report_page import report

            page = report(
                flown.motion,
                result,
                shape_path=flown.path,
                title=f"{flown.body.name} along {Path(motion).name}",
                up=recording.up or flown.up,
                error_bars=bar_lines,
                recording=[*lines, *recording_lines(flown.body, flown.recorded)],
                noise=joint_noise(flown.body, errors),
                progress=work.watch,
            )
            write_file(html, page.write)
    gap = path_gap(flown.body, in_joint_order(flown.body, flown.path))
    open_by = "" if result.is_loop else f"{gap_text(flown.body, gap)} from its start"
    text = [
        *split_lines(result, split_heading(flown.body, motion, flown.motion), open_by),
        *wrapped(str(turns)),
        *bar_lines,
        *lines,
        *recording_lines(flown.body, flown.recorded),
    ]
    text[0] += flown.beginning
    data = split_data(flown.body, motion, flown.motion, result) | error_bar_data(bars) | data
    data |= turns.to_dict() | recording_data(flown.recorded)
    return Outcome("\n".join(text), data, aside=aside, made_from=flown.motion.deformation.made_from)
