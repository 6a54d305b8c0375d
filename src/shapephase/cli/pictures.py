"""`shapephase view`, `explore` and `plot`: pages in 3-D, and figures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..errors import ShapeError
from . import options
from .options import option
from .outcome import FIGURE_ENDINGS, Outcome, check_writable
from .progress import steps
from .terminal import write_file

if TYPE_CHECKING:
    from ..plots.pages.page import Page
    from .motion import LoadedMotion


def view_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    start: options.StartOptions = options.START_DEFAULTS,
    html: options.PageFile = None,
    video: options.FilmFile = None,
    trail: Annotated[str | None, option("Link that leaves a trail; for example `--trail head`.")] = None,
    speed: Annotated[
        float | None,
        option(
            "Seconds of motion in a second of playing; default: 1, or such that playing takes 4 to 20 s. For example "
            "`--speed 0.1` for slow motion."
        ),
    ] = None,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Show a motion in 3-D in a browser, or write it as one HTML file that opens offline, or as a film."""
    from ..plots.pages.motion_data import up_axis
    from ..plots.pages.viewer import view
    from . import motion as motions
    from .texts.recording_text import recording_data

    up_axis(recording.up, None)
    if speed is not None and not 0.0 < speed < math.inf:
        raise ShapeError(f"--speed: seconds of motion in a second of playing, above 0, are needed, got {speed:g}")
    aside = check_page_files(html, video)
    with steps(2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(
            body, motion, start, recording, progress=work.watch, trail=trail, floating=floating, wheels=wheels
        )
        work.begin("making the page")
        page = view(flown.motion, trail=trail, speed=speed, up=recording.up or flown.up)
        lines, data = deliver(page, html, video)
    heading = _heading(flown, motion)
    return Outcome(
        "\n".join([*([heading] if heading else []), *lines]),
        data | recording_data(flown.recorded),
        aside=aside,
        made_from=flown.motion.deformation.made_from,
    )


def explore_command(
    body: options.BodyArgument,
    /,
    *,
    joints: Annotated[
        tuple[str, str],
        Parameter(
            negative_iterable="",
            help="Two joints; the others rest at zero. For example `--joints waist_pitch waist_yaw`.",
        ),
    ],
    html: options.PageFile = None,
    up: options.UpAxis = None,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Draw loops of two joints on a map of the curvature, and see what they turn the body by, in a browser or a file.

    The body has no angular momentum, or one that is chosen by sliders.
    """
    from ..plots.pages.explorer import explore
    from .motion import body_argument

    aside = check_page_files(html, None)
    page = explore(body_argument(body, floating), joints, up=up)
    lines, data = deliver(page, html, None)
    error = page.data["plane"]["connection_error"]
    return Outcome(
        "\n".join(lines), data | {"joints": list(joints), "connection_error_rad_per_unit": error}, aside=aside
    )


def check_page_files(html: Path | None, video: Path | None) -> bool:
    """Check that a page and its film can be written; return whether one of them takes standard output."""
    from ..plots.pages.video import FILM_SIZE, VIDEO_ENDINGS, check_video

    aside = any([check_writable(html, "--html", ".html"), check_writable(video, "--video", *VIDEO_ENDINGS)])
    if video is not None:
        check_video(video, FILM_SIZE)
    return aside


def deliver(page: Page, html: Path | None, video: Path | None) -> tuple[list[str], dict[str, str]]:
    """Write a page and its film, or without files show it; return lines and data to print."""
    if html is None and video is None:
        shown = str(page.show())
        return [f"in the browser: {shown}"], {"html": shown}
    write_file(html, page.write)
    write_file(video, page.film)
    return [], {name: str(file) for name, file in (("html", html), ("video", video)) if file is not None}


def plot_command(
    kind: str,
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    out: options.FigureFile,
    start: options.StartOptions = options.START_DEFAULTS,
    gauge: options.Gauge = "horizontal",
    errors: options.ErrorOptions = options.ERROR_DEFAULTS,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Draw one figure of a motion, one column wide; somersault, tilt and twist with error bars of a recording.

    Parameters
    ----------
    kind
        What is drawn: somersault, momentum, phases, attitude, shape, torques, inertia, internal_momentum, energy, loop,
        curvature, reach, contributions or segment_momentum; for example `phases`.
    """
    from ..arguments import check_choice
    from ..plots.named_figures import FIGURES, write_figure
    from . import motion as motions
    from .texts.error_bar_text import input_errors
    from .texts.recording_text import recording_data

    check_choice(kind, "kind of figure", FIGURES)
    check_writable(out, "--out", *FIGURE_ENDINGS)
    if FIGURES[kind].with_momentum and motions.is_without_momentum(motion, start):
        raise _no_momentum(kind)
    with steps(2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(
            body, motion, start, recording, progress=work.watch, gauge=gauge, joint_noise=errors.joint_noise,
            floating=floating, wheels=wheels,
        )  # fmt: skip
        if FIGURES[kind].with_momentum and not flown.motion.momentum.any():
            raise _no_momentum(kind)
        work.begin(f"drawing {kind.replace('_', ' ')}")
        given = {}
        if FIGURES[kind].with_errors or errors != options.ERROR_DEFAULTS:
            given = input_errors(flown.motion, errors, flown.recorded, flown.fitted)
        write_file(out, lambda file: write_figure(kind, flown.motion, file, flown.path, gauge, errors=given))
    data = {"figure": str(out)} | recording_data(flown.recorded)
    return Outcome(_heading(flown, motion), data, made_from=flown.motion.deformation.made_from)


def _no_momentum(kind: str) -> ShapeError:
    return ShapeError(f"the figure {kind!r} needs an angular momentum: give one by --momentum")


def _heading(flown: LoadedMotion, motion: str) -> str:
    """Return the first line about a recording, its momentum and flight, and wheels; of other motions nothing."""
    from .texts.result_text import split_heading

    beginning = flown.beginning
    return beginning and split_heading(flown.body, motion, flown.motion) + beginning
