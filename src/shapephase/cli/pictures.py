"""`shapephase view` and `shapephase plot`: a motion in 3-D, and figures of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ShapeError, unknown_name
from .options import (
    BODY_DEFAULTS,
    PRINT_DEFAULTS,
    RECORDING_DEFAULTS,
    START_DEFAULTS,
    BodyArgument,
    BodyOptions,
    FigureFile,
    Gauge,
    MotionArgument,
    PrintOptions,
    RecordingOptions,
    StartOptions,
)
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import put, say_written

if TYPE_CHECKING:
    from .motion import Flight


def view_command(
    body: BodyArgument,
    motion: MotionArgument,
    /,
    *,
    floating: BodyOptions = BODY_DEFAULTS,
    flight: StartOptions = START_DEFAULTS,
    html: Path | None = None,
    video: Path | None = None,
    trail: str | None = None,
    speed: float | None = None,
    recording: RecordingOptions = RECORDING_DEFAULTS,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome | None:
    """Show a motion in 3-D: in a browser until Ctrl-C, or as one HTML file that opens offline.

    Parameters
    ----------
    html
        Write the animation to this HTML file, and serve nothing; without it a browser is opened. For example
        `--html fall.html`.
    video
        Write a film to this GIF or MP4 file, or six pictures side by side to this PNG file, and serve nothing; without
        it none is written. A Chromium draws it (`pip install 'shapephase[video]'`). For example `--video fall.gif`.
    trail
        The link that leaves a trail; without it none does. For example `--trail head`.
    speed
        Seconds of motion in a second of playing; without it 1, or such that playing takes from 4 to 20 s. For example
        `--speed 0.1` for slow motion.
    """
    from ..plots.pages.up_axis import up_axis
    from ..plots.pages.video import FILM_SIZE, VIDEO_ENDINGS, check_video
    from ..plots.viewer import motion_page, motion_video, view
    from . import motion as motions
    from .texts.recording_text import recording_data

    up_axis(recording.up, None)
    if speed is not None and not 0.0 < speed < math.inf:
        raise ShapeError(f"--speed: seconds of motion in a second of playing, above 0, are needed, got {speed:g}")
    aside = check_writable(html, "--html", ".html")
    aside = check_writable(video, "--video", *VIDEO_ENDINGS) or aside
    if video is not None:
        check_video(video, FILM_SIZE)
    with steps(2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(body, motion, flight, recording, progress=work.watch, trail=trail, floating=floating)
        up = recording.up or flown.up
        if html is not None or video is not None:
            work.begin("recording the animation")
            if html is not None:
                motion_page(flown.motion, html, trail=trail, speed=speed, up=up)
                say_written(html)
            if video is not None:
                motion_video(flown.motion, video, trail=trail, speed=speed, up=up)
                say_written(video)
            files = {"html": html, "video": video}
            data = {name: str(file) for name, file in files.items() if file is not None}
            data |= recording_data(flown.recorded)
            return Outcome(_heading(flown, motion), data, aside=aside, made_from=flown.motion.deformation.made_from)
    live = view(flown.motion, trail=trail, speed=speed, up=up, notebook=False)
    if live is not None:
        with live:
            if flown.recorded is not None:
                put(_heading(flown, motion))
            put(f"{live.url}  (Ctrl-C to stop)")
            live.wait()
    return None


def plot_command(
    kind: str,
    body: BodyArgument,
    motion: MotionArgument,
    /,
    *,
    out: FigureFile,
    floating: BodyOptions = BODY_DEFAULTS,
    flight: StartOptions = START_DEFAULTS,
    gauge: Gauge = "horizontal",
    recording: RecordingOptions = RECORDING_DEFAULTS,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Draw one figure of a motion, one column wide.

    Parameters
    ----------
    kind
        What is drawn: momentum, phases, attitude, shape, torques, inertia, internal_momentum or energy; for example
        `phases`.
    """
    from ..plots.named_figures import FIGURES, write_figure
    from . import motion as motions
    from .texts.recording_text import recording_data

    if kind not in FIGURES:
        raise unknown_name("kind of figure", kind, FIGURES)
    check_writable(out, "--out", ".svg", ".pdf", ".png")
    if FIGURES[kind].with_momentum and motions.is_without_momentum(motion, flight):
        raise _no_momentum(kind)
    with steps(2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(body, motion, flight, recording, progress=work.watch, gauge=gauge, floating=floating)
        if FIGURES[kind].with_momentum and not flown.motion.momentum.any():
            raise _no_momentum(kind)
        work.begin(f"drawing {kind.replace('_', ' ')}")
        write_figure(kind, flown.motion, out, flown.path, gauge)
        say_written(out)
    data = {"figure": str(out)} | recording_data(flown.recorded)
    return Outcome(_heading(flown, motion), data, made_from=flown.motion.deformation.made_from)


def _no_momentum(kind: str) -> ShapeError:
    return ShapeError(f"the figure {kind!r} needs an angular momentum: give one by --momentum")


def _heading(flown: Flight, motion: str) -> str:
    """Of a recording, its momentum and its flight; nothing of other motions."""
    from .texts.result_text import split_heading

    return "" if flown.recorded is None else split_heading(flown.body, motion, flown.motion) + flown.beginning
