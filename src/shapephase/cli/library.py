"""`shapephase robots` and `shapephase compile`: what comes with the library, and its loops in machine code."""

from __future__ import annotations

from .options import AS_TEXT, PrintOptions
from .outcome import Outcome
from .progress import steps


def robots_command(*, printing: PrintOptions = AS_TEXT) -> Outcome:  # noqa: ARG001
    """List the bodies and motions that come with the library."""
    from ..body.catalog import example_names, robot_names
    from ..body.loading import load_body
    from ..examples.scenarios import MOTIONS

    bodies = {name: load_body(name) for name in robot_names()}
    motions = {name: {"body": motion.body, "about": motion.about} for name, motion in MOTIONS.items()}
    examples = list(example_names())
    width = max(map(len, [*bodies, *motions]))
    lines = ["Bodies"]
    lines += [f"  {name:<{width}}  {body.n_shape:3d} joints  {body.mass:9.3f} kg" for name, body in bodies.items()]
    lines += ["", "Motions"]
    lines += [f"  {name:<{width}}  {item['body']}: {item['about']}" for name, item in motions.items()]
    lines += ["", "Bodies of example-robot-data"]
    lines += [f"  example:{name}" for name in examples] or ["  none installed: pip install 'shapephase[robots]'"]
    listed = {
        name: {"joints": list(body.joint_names), "units": list(body.joint_units), "mass": body.mass}
        for name, body in bodies.items()
    }
    return Outcome("\n".join(lines), {"bodies": listed, "motions": motions, "examples": examples})


def compile_command(*, printing: PrintOptions = AS_TEXT) -> Outcome:  # noqa: ARG001
    """Compile the innermost loops with Numba now, not when they are first needed.

    Once is enough for all later sessions: what is compiled is kept in $XDG_CACHE_HOME/shapephase, or
    ~/.cache/shapephase.
    """
    from ..integrator.machine_code import compile_steps

    with steps(1) as work:
        work.begin("compiling")
        written = compile_steps()
    return Outcome(f"compiled: {len(written)} files in {written[0].parent}", {"files": [str(p) for p in written]})
