"""`shapephase contributions`: the share of every limb in a twist, tilt, somersault or other turn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from . import options
from .options import option, rare
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import write_file


def contributions_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    of: Annotated[
        str,
        option(
            "What is explained: twist, somersault, tilt, rotation or phase (Montgomery's); default: twist. For example "
            "`--of tilt`."
        ),
    ] = "twist",
    groups: Annotated[
        tuple[str, ...],
        option(
            "Groups of joints: limbs, joints, or patterns of names; with --baseline FILE also momentum, attitude, "
            "duration and body. Default: limbs. For example `--groups arms=left_*,right_* legs=*hip*,*knee*`.",
            several=True,
        ),
    ] = ("limbs",),
    baseline: Annotated[
        str,
        option(
            "What held joints do: first (their first posture), neutral, mirrored (left and right exchanged), or the "
            "file or name of another motion, whose difference is explained; default: first. For example `--baseline "
            "bad.csv`."
        ),
    ] = "first",
    at: Annotated[
        float | str, rare("Time of the tilt, in s, or mid-twist; default: mid-twist. For example `--at 0.8`.")
    ] = "mid-twist",
    about: Annotated[
        tuple[float, float, float] | None,
        rare(
            "Inertial axis of the rotation; default: the momentum. For example `--about 1 0 0`.",
            negative_iterable="",
        ),
    ] = None,
    link: Annotated[
        str | None, rare("Link whose turn is explained; default: the trunk. For example `--link pelvis`.")
    ] = None,
    lateral: Annotated[
        str | None,
        rare(
            "Axis from the right side to the left, x to -z in axes of the link; default: links named left and right. "
            "For example `--lateral y`.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    longitudinal: Annotated[
        str | None,
        rare(
            "Axis from the feet to the head, x to -z in axes of the link; default: that of least inertia. For example "
            "`--longitudinal z`.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    joint_noise: Annotated[
        str | None,
        rare(
            "Print error bars of twist, tilt and somersault for this noise of the samples, one standard deviation, in "
            "rad or m or with units; default: that of --smooth. For example `--joint-noise 0.3deg`."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        rare("Write the direct shares in time, in rad, to this CSV file; for example `--out shares.csv`."),
    ] = None,
    figure: Annotated[
        Path | None,
        option("Write bars and areas to this file, .svg, .pdf or .png; for example `--figure shares.pdf`."),
    ] = None,
    html: options.PageFile = None,
    start: options.StartOptions = options.START_DEFAULTS,
    tolerance: options.Tolerance = 1e-9,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Find who made a turn: the share of momentum and limbs in a twist, tilt or somersault.

    Direct: what each did along the motion. Held: the motion again with a limb held. Shared: what a limb adds, averaged
    over all orders in which limbs join (Shapley). A recording's noise gives error bars.
    """
    from ..errors import unknown_name
    from ..examples.scenarios import MOTIONS
    from ..segments.direct_shares import ANGLES
    from ..segments.held_motions import BASELINES, POSTURES
    from ..segments.limb_contributions import contributions
    from ..segments.limbs import groups_of_words
    from . import motion as motions
    from .texts.error_bar_text import input_errors
    from .texts.recording_text import recording_data
    from .texts.result_text import split_heading

    aside = check_writable(out, "--out", ".csv")
    aside = check_writable(figure, "--figure", ".svg", ".pdf", ".png") or aside
    aside = check_writable(html, "--html", ".html") or aside
    chosen = groups_of_words(groups)
    if not Path(baseline).suffix and baseline not in (*BASELINES, *MOTIONS, "-") and not Path(baseline).exists():
        raise unknown_name("baseline (no such file either)", baseline, (*BASELINES, *MOTIONS))
    with steps(2) as work:
        work.begin("loading and reconstructing")
        flown = motions.flight(
            body, motion, start, recording, tolerance, work.watch, joint_noise=joint_noise, floating=floating,
            wheels=wheels,
        )  # fmt: skip
        noise = {}
        if joint_noise is not None or (of in ANGLES and baseline in POSTURES):
            noise = input_errors(
                flown.motion, options.ErrorOptions(joint_noise=joint_noise), flown.recorded, flown.fitted
            )
        other = baseline
        if baseline not in BASELINES:
            other = motions.flight(
                body, baseline, start, recording, tolerance, work.watch, floating=floating, wheels=wheels
            ).motion
        work.begin("holding groups")
        shares = contributions(
            flown.motion,
            of,
            groups=chosen,
            baseline=other,
            at=at,
            about=about,
            link=link,
            lateral=lateral,
            longitudinal=longitudinal,
            up=recording.up,
            joints=noise.get("joints"),
            start=noise.get("start"),
        )
        write_file(out, shares.write_csv)
        if figure is not None:
            from ..plots.plot_style import write_axes
            from ..plots.segment_plots import contributions_figure

            write_file(figure, lambda file: write_axes(contributions_figure(shares), file))
        if html is not None:
            from ..plots.pages.segments_page import contributions_page

            page = contributions_page(shares, title=f"{flown.body.name} along {motion}", up=recording.up)
            write_file(html, page.write)
    text = f"{split_heading(flown.body, motion, flown.motion)}{flown.beginning}\n\n{shares}"
    data = shares.to_dict() | recording_data(flown.recorded)
    return Outcome(text, data, aside=aside, made_from=flown.motion.deformation.made_from)
