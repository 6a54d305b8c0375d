"""`shapephase loop`: the loop of a motion on the curvature, and the parts of the turn that it makes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from . import options
from .options import option
from .outcome import FIGURE_ENDINGS, Outcome, check_writable
from .progress import steps
from .terminal import write_file

if TYPE_CHECKING:
    from ..arrays import Array
    from ..plots.loop_plots import LoopFlux


def loop_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    /,
    *,
    joints: Annotated[
        tuple[str, ...],
        option(
            "Two joints of the drawn plane, three of a space, or principal, the two principal directions of the path; "
            "default: the two whose loop encloses most curvature. For example `--joints waist_pitch,waist_yaw`.",
            several=True,
        ),
    ] = (),
    component: Annotated[
        str | None,
        option(
            "Component of curvature and turn, base axes: x, y, z or norm; default: the largest of the turn. For "
            "example `--component x`."
        ),
    ] = None,
    out: options.OptionalFigureFile = None,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """See a loop of joints on the curvature, and how the flux through it becomes the turn of the body.

    The turn is the flux through the drawn plane, what the other joints add (the flux through the whole cone), and what
    the order of the turns adds. The body has no angular momentum.
    """
    import numpy as np

    from ..arguments import check_choice
    from ..plots.curvature_map import COMPONENTS, component_of
    from ..plots.loop_plots import PRINCIPAL, draw_loop_flux, loop_axes, loop_flux
    from .motion import body_argument, joint_motion
    from .texts.recording_text import recording_data, recording_lines

    aside = check_writable(out, "--out", *FIGURE_ENDINGS)
    if component is not None:
        check_choice(component, "component", COMPONENTS)
    names = [name for word in joints for name in word.split(",") if name]
    with steps(2) as work:
        work.begin("loading")
        loaded = body_argument(body, floating)
        path, recorded = joint_motion(motion, loaded, recording)
        work.begin("integrating the curvature")
        flux = loop_flux(loaded, path, PRINCIPAL if names == [PRINCIPAL] else names or None)
        if out is not None:
            from ..plots.plot_style import write_axes

            ax = loop_axes(flux)
            draw_loop_flux(ax, loaded, path, flux, component)
            write_file(out, lambda file: write_axes(ax, file))
    direction, name = component_of(component, flux.turn)
    heading = f"{loaded.name} along {motion}: {path.duration:g} s, {loaded.n_joints} joints, no momentum"
    data = {
        "body": loaded.name,
        "motion": motion,
        "joints": list(flux.joints),
        "component": name,
        **{f"{key}_deg": float(np.degrees(value)) for key, value in flux.parts(direction).items()},
        "turn_rad": flux.turn.tolist(),
        "flux_in_plane_rad": flux.in_plane.tolist(),
        "flux_of_cone_rad": flux.of_cone.tolist(),
        "error_rad": flux.error,
        "figure": None if out is None else str(out),
    } | recording_data(recorded)
    text = [heading, "", *_lines(flux, direction, name), *recording_lines(loaded, recorded)]
    return Outcome("\n".join(text), data, aside=aside, made_from={"joints": list(loaded.joint_names)})


def _lines(flux: LoopFlux, direction: Array | None, name: str) -> list[str]:
    """Return the table."""
    import numpy as np

    parts = {key: round(float(np.degrees(value)), 4) + 0.0 for key, value in flux.parts(direction).items()}
    about = "angle" if direction is None else f"about {name}"
    rows = [
        (f"turn of one round, {about}", "degrees"),
        ("flux through the loop of " + ", ".join(flux.joints), f"{parts['flux_in_plane']:.4f}"),
        ("by the other joints", f"{parts['other_joints']:+.4f}"),
        ("flux through the cone of all joints", f"{parts['flux_of_cone']:.4f}"),
        ("by the order of the turns", f"{parts['order']:+.4f}"),
        ("turn", f"{parts['turn']:.4f}"),
    ]
    wide = max(len(text) for text, _ in rows)
    return [*(f"{text:<{wide}}{value:>12}" for text, value in rows), f"± {flux.error:.1e} rad each, base axes"]
