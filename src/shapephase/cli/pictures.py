"""`shapephase view` and `shapephase plot`: a motion in 3-D, and figures of it."""

from __future__ import annotations

from pathlib import Path

from ..errors import unknown_name
from .options import (
    AS_RECORDED,
    AT_REST,
    BodyArgument,
    FigureFile,
    FlightOptions,
    Gauge,
    MotionArgument,
    RecordingOptions,
)
from .outcome import Outcome, check_writable
from .progress import steps


def view_command(
    body: BodyArgument,
    motion: MotionArgument,
    /,
    *,
    flight: FlightOptions = AT_REST,
    html: Path | None = None,
    trail: str | None = None,
    speed: float | None = None,
    recording: RecordingOptions = AS_RECORDED,
) -> Outcome | None:
    """Show a motion in 3-D: in a browser until Ctrl-C, or as one HTML file that opens offline.

    Parameters
    ----------
    html
        write the animation to this HTML file, and serve nothing
    trail
        a link that leaves a trail
    speed
        seconds of motion in a second
    """
    from ..plotting.viewer import motion_page, view
    from . import motion as motions

    check_writable(html, "--html", ".html")
    with steps(2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(body, motion, flight, recording)
        if html is not None:
            work.begin("recording the animation")
            motion_page(flown.motion, html, trail=trail, speed=speed)
            return Outcome(f"wrote {html}", {"html": str(html)})
    live = view(flown.motion, trail=trail, speed=speed, notebook=False)
    if live is not None:
        with live:
            print(f"{live.url}  (Ctrl-C to stop)", flush=True)
            live.wait()
    return None


def plot_command(
    kind: str,
    body: BodyArgument,
    motion: MotionArgument,
    /,
    *,
    out: FigureFile,
    flight: FlightOptions = AT_REST,
    gauge: Gauge = "horizontal",
    recording: RecordingOptions = AS_RECORDED,
) -> Outcome:
    """Draw one figure of a motion, one column wide.

    Parameters
    ----------
    kind
        momentum, phases, attitude, shape, inertia, internal_momentum or energy
    """
    from ..plotting.named_figures import FIGURES, write_figure
    from . import motion as motions

    if kind not in FIGURES:
        raise unknown_name("kind of figure", kind, FIGURES)
    check_writable(out, "--out", ".svg", ".pdf", ".png")
    flown = motions.flight(body, motion, flight, recording)
    write_figure(kind, flown.motion, out, flown.path, gauge)
    return Outcome(f"wrote {out}", {"figure": str(out)})
