"""`shapephase momentum`: angular momentum in time, whole and by link, and whether flights conserve it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from . import options
from .options import option, rare
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import write_file


def momentum_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    axes: Annotated[
        str,
        option(
            "Axes of the momentum: inertial, athlete (somersault, frontal and longitudinal axis), or three numbers; "
            "default: inertial. For example `--axes athlete` or `--axes 0,1,0`.",
            allow_leading_hyphen=True,  # the first number may be negative
        ),
    ] = "inertial",
    normalise: Annotated[
        str | None,
        option(
            "Divide by m h v (speed), m h sqrt(g h) (gravity) or m h^2 (inertia); default: kg m^2/s. For example "
            "`--normalise gravity`."
        ),
    ] = None,
    fitted: Annotated[
        bool,
        option(
            "Take the motion with one momentum that is fitted to the recording, not the base as it was recorded; for "
            "example `--fitted`.",
            negative="",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        option("Write the momentum of the whole and of each link in time to this CSV file; for example `--out m.csv`."),
    ] = None,
    figure: Annotated[
        Path | None,
        option(
            "Write the momentum, stacked by link or limb, to this .svg, .pdf or .png; for example `--figure m.pdf`."
        ),
    ] = None,
    stature: Annotated[
        float | None,
        rare("Stature h of --normalise, in m; default: as the body is drawn. For example `--stature 1.7`."),
    ] = None,
    speed: Annotated[
        float | None,
        rare(
            "Speed v of --normalise speed, in m/s; default: mean horizontal speed of the centre of mass. For example "
            "`--speed 1.3`."
        ),
    ] = None,
    joint_noise: Annotated[
        str | None,
        rare(
            "Noise of the samples of joints, rms, in rad or m or with units; default: that of --smooth, else by the "
            "samples. For example `--joint-noise 0.3deg`."
        ),
    ] = None,
    attitude_noise: Annotated[
        str | None,
        rare(
            "Noise of the samples of the base's attitude, rms, in rad or with a unit; default: by the samples. For "
            "example `--attitude-noise 0.2deg`."
        ),
    ] = None,
    html: options.PageFile = None,
    start: options.StartOptions = options.START_DEFAULTS,
    tolerance: options.Tolerance = 1e-9,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Find the angular momentum about the centre of mass in time, whole and by link, and its change in each flight.

    A recording with its base is taken as recorded: nothing is presumed to be conserved.
    """
    from ..errors import unknown_name
    from ..segments.momentum import AXES, segment_momentum
    from ..shape_space.files.labels import amounts
    from ..shape_space.free_fall import GRAVITY
    from . import motion as motions
    from .texts.recording_text import recording_data
    from .texts.result_text import split_heading
    from .wheels import with_wheels

    aside = check_writable(out, "--out", ".csv")
    aside = check_writable(figure, "--figure", ".svg", ".pdf", ".png") or aside
    aside = check_writable(html, "--html", ".html") or aside
    try:
        chosen = axes if axes in AXES else [float(word) for word in axes.split(",")]
    except ValueError:
        raise unknown_name("axes", axes, (*AXES, "three numbers such as 0,1,0")) from None
    levels = None if joint_noise is None else amounts(joint_noise, "--joint-noise")
    turn = None if attitude_noise is None else amounts(attitude_noise, "--attitude-noise")["rad"]
    with steps(2) as work:
        work.begin("loading")
        loaded = motions.body_argument(body, floating)
        _, spinning = with_wheels(loaded, wheels)
        path, recorded = motions.joint_motion(motion, loaded, recording, spinning)
        as_recorded = recorded is not None and recorded.base_attitude is not None and not (start.has_momentum or fitted)
        as_recorded = as_recorded and not spinning.names
        made_from: dict[str, object] = {}
        moving = None
        choices = {"axes": chosen, "normalise": normalise, "stature": stature, "speed": speed}
        choices |= {"gravity": recording.gravity or GRAVITY, "up": recording.up}
        choices |= {"joint_noise": None if levels is None else [levels[unit] for unit in loaded.joint_units]}
        choices |= {"attitude_noise": turn}
        if as_recorded:
            work.begin("momenta and their bars")
            found = segment_momentum(recorded, loaded, **choices)
            seconds = float(found.times[-1] - found.times[0])
            heading = (
                f"{loaded.name} along {motion}, as recorded: {seconds:g} s, {path.n_shape} joints, {loaded.mass:.6g} kg"
            )
        else:
            flown = motions.flight(
                body, motion, start, recording, tolerance, work.watch, floating=floating, wheels=wheels
            )
            work.begin("momenta and their bars")
            moving = flown.motion
            found = segment_momentum(moving, **choices)
            made_from = dict(moving.deformation.made_from)
            heading = f"{split_heading(flown.body, motion, moving)}{flown.beginning}"
        write_file(out, found.write_csv)
        if figure is not None:
            from ..plots.plot_style import column_axes, write_axes
            from ..plots.segment_plots import HEIGHT, plot_segment_momentum

            write_file(figure, lambda file: write_axes(plot_segment_momentum(column_axes(HEIGHT), found), file))
        if html is not None:
            from ..plots.pages.segments_page import momentum_page

            write_file(html, momentum_page(found, moving, title=heading.splitlines()[0], up=recording.up).write)
    text = f"{heading}\n{found}"
    data = {"body": loaded.name, "motion": motion, **found.to_dict()} | recording_data(recorded)
    return Outcome(text, data, aside=aside, made_from=made_from)
