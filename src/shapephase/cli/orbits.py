"""`shapephase orbits`: the motions whose shape and momentum close together."""

from __future__ import annotations

from typing import Annotated

from . import options
from .options import option
from .outcome import Outcome
from .progress import steps

_MOMENTA = 1000  # about as many are integrated to search all directions


def orbits_command(
    body: options.BodyArgument,
    motion: options.MotionArgument,
    magnitude: float,
    /,
    *,
    gauge: Annotated[
        str,
        option(
            "Frame in which the momentum closes: horizontal, base, principal, mean_body or link:NAME; for example "
            "`--gauge base`."
        ),
    ] = "horizontal",
    tolerance: Annotated[
        float | None,
        option(
            "Accuracy of the attitude, from 1e-13 to 1e-4, in rad; default: 1e-11, or the tightest of 1e-10 to 1e-8 "
            "that can be met. For example `--tolerance 1e-7`."
        ),
    ] = None,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Find the closed orbits: motions whose shape and momentum close together; and split each.

    Parameters
    ----------
    magnitude
        Angular momentum, in kg m^2/s; for example `0.02`.
    """
    import numpy as np

    from .. import so3
    from ..arguments import magnitude_argument, tolerance_argument
    from ..deformation.frames import gauge_link
    from ..deformation.gauge import named_gauge
    from ..integrator.machine_code import expect_work
    from ..phases.phases import split
    from ..phases.return_map import fixed_points
    from ..phases.split_text import rotation_line
    from ..reconstruction.reconstruction import reconstruct
    from .motion import body_argument, joint_motion
    from .texts.recording_text import recording_data, recording_lines
    from .texts.result_text import orbit_data, orbit_lines
    from .wheels import wheel_lines, with_wheels

    magnitude = magnitude_argument(magnitude)
    goal = None if tolerance is None else tolerance_argument(tolerance)
    link = gauge_link(gauge)
    with steps(3) as work:
        work.begin("loading")
        plain = body_argument(body, floating)
        loaded, spinning = with_wheels(plain, wheels)
        if link is not None:
            loaded.link_pose(loaded.shape(), link)
        path, recorded = joint_motion(motion, plain, recording, spinning, given=True)
        deformation = spinning.deformation(loaded, path, recorded)
        seen = named_gauge(deformation, gauge)
        work.begin("finding what closes")
        expect_work(momenta=_MOMENTA)
        found = fixed_points(seen, magnitude, tolerance=goal, progress=work.watch)
        upright = so3.transpose(so3.between(np.array([0.0, 0.0, 1.0]), found.directions))
        work.begin("splitting")
        moved = [reconstruct(seen, [0.0, 0.0, magnitude], attitude, tolerance=found.tolerance) for attitude in upright]
        splits = [split(orbit, "base") for orbit in moved]
        holonomy = split(reconstruct(deformation, np.zeros(3))).holonomy
    result = (loaded, motion, gauge, found, found.directions @ seen.frame(0.0), splits)
    lines = [
        *orbit_lines(*result),
        "",
        rotation_line("shape holonomy (base axes)", holonomy),
        *wheel_lines(deformation),
        *recording_lines(loaded, recorded),
    ]
    data = orbit_data(*result) | {"holonomy": holonomy.tolist()} | recording_data(recorded)
    return Outcome("\n".join(lines), data, made_from=deformation.made_from)
