"""`shapephase explore`: a page to draw loops of two joints on, which shows what they turn the body by."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .options import AS_TEXT, AS_WRITTEN, BodyArgument, BodyOptions, PrintOptions, UpAxis
from .outcome import Outcome, check_writable
from .terminal import put, say_written


def explore_command(
    body: BodyArgument,
    /,
    *,
    floating: BodyOptions = AS_WRITTEN,
    joints: Annotated[tuple[str, str], Parameter(negative_iterable="")],
    html: Path | None = None,
    up: UpAxis = None,
    printing: PrintOptions = AS_TEXT,  # noqa: ARG001
) -> Outcome | None:
    """Draw loops of two joints on a map of the curvature, and see what they turn the body by, in a browser or a file.

    The body has no angular momentum, or one that is chosen by sliders.

    Parameters
    ----------
    joints
        The two joints, by name; the others rest at zero. For example `--joints waist_pitch waist_yaw`.
    html
        Write the page, which opens offline, to this HTML file; without it a browser is opened until Ctrl-C. For example
        `--html explore.html`.
    """
    import webbrowser

    from ..body.loading import load_body
    from ..files import write_whole
    from ..plotting.explorer import explore_html
    from ..plotting.viewer import LiveView

    aside = check_writable(html, "--html", ".html")
    loaded = load_body(body, **floating.loading)
    page, series = explore_html(loaded, joints, up=up)
    if html is not None:
        write_whole(html, lambda stream: stream.write(page.encode()))
        say_written(html)
        data = {"html": str(html), "joints": list(joints), "connection_error_rad_per_unit": series.error}
        return Outcome("", data, aside=aside)
    with LiveView(page, f"loops of {loaded.name}", "127.0.0.1", 8080) as live:
        webbrowser.open(live.url)
        put(f"{live.url}  (Ctrl-C to stop)")
        live.wait()
    return None
