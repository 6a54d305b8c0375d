"""Motions in three dimensions: live in a browser or a notebook, or as one HTML file that needs no network."""

from __future__ import annotations

import html
import math
import os
import threading
import warnings
import webbrowser
from collections.abc import Mapping
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_file_name, check_flag, check_keywords, check_object
from ..errors import ShapeError, VisualWarning
from ..files import write_whole
from ..letters import what_came
from ..reconstruction.reconstruction import Motion
from ._letters import printable
from ._moving_scene import MovingScene, moving_scene
from .pages.motion_data import motion_data
from .pages.playing import frame_count, playing_speed
from .pages.templates import SCENE_SCRIPTS, page_html
from .pages.up_axis import up_axis
from .pages.video import FILM_SIZE, check_video, frame_times, write_video

# Ports after the given one that are tried when that is in use.
_PORTS = 100
# The highest port there is.
_LAST_PORT = 65535
# Height of a motion in a notebook [px].
_HEIGHT = 520


def motion_page(
    motion: Motion,
    path: str | os.PathLike[str],
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    up: str | None = None,
    **fall: ArrayLike,
) -> None:
    """Write a motion as one HTML page to play, stop and scrub; it needs no network and no server, and may use none.

    The body moves as reconstructed, with the conserved angular momentum as an arrow from the centre of mass, the axes
    of the base and of space, and the body at the start as a transparent ghost. The clock is the time of the body. Its
    joints can be moved by hand.

    Parameters
    ----------
    path : of the file, written whole or not at all
    speed : seconds of motion in a second of playing; None: 1, or such that playing takes from 4 to 20 s
    frames : None: 30 in a second of playing
    trail : a link whose origin leaves a trail, light at the start and dark at the end
    ghost : whether the body at the start is shown
    up : the inertial axis that is up in the picture: "x", "y", "z", "-x", "-y" or "-z"; None: against gravity if there
        is any, else y for a body whose left and right are mirror images across z and not across y, else z
    fall : start, velocity, gravity of the centre of mass as in `Motion.base_position`; by default it rests at the
        origin, and there is no ground

    Raises
    ------
    ShapeError, UnknownNameError
        As `moving_scene`, for a speed that is not above 0, and for an axis that there is not.

    Warns
    -----
    VisualWarning
        As `visuals`; and, where `frames` is None, if something turns by more than a quarter turn from one frame to the
        next, so that it may seem to turn the other way.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.motion_page(motion, "page.html", frames=5)
    >>> from pathlib import Path
    >>> Path("page.html").stat().st_size > 1000
    True
    """
    check_object(motion, "Motion", "motion")
    check_keywords(fall, motion_page)
    check_file_name(path, "path")
    page = motion_html(motion, speed=speed, frames=frames, trail=trail, ghost=ghost, up=up, **fall)
    write_whole(path, lambda stream: stream.write(page.encode()))


def motion_html(
    motion: Motion,
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    up: str | None = None,
    **fall: ArrayLike,
) -> str:
    """The page that `motion_page` writes, as text: arguments, errors and warnings as there.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plots.motion_html(motion, frames=5)[:15].lower()
    '<!doctype html>'
    """
    check_object(motion, "Motion", "motion")
    check_keywords(fall, motion_html)
    scene, data = scene_and_data(motion, speed=speed, frames=frames, trail=trail, ghost=ghost, up=up, fall=fall)
    return page_html(
        "motion.html",
        title=printable(scene.title),
        scripts=(*SCENE_SCRIPTS, "motion_page"),
        styles=("page", "motion_page"),
        data={"motion": data},
        with_joints=bool(data["joints"]),
    )


def motion_video(
    motion: Motion,
    path: str | os.PathLike[str],
    *,
    pixels: tuple[int, int] = FILM_SIZE,
    speed: float | None = None,
    trail: str | None = None,
    ghost: bool = True,
    up: str | None = None,
    **fall: ArrayLike,
) -> None:
    """Write a motion as a film, or as a strip of six pictures, drawn as `motion_page` draws it.

    A Chromium without a window draws the frames; it is looked for as `shapephase doctor` says, or named in the
    environment variable CHROMIUM. A GIF is made by Pillow alone.

    Parameters
    ----------
    path : of the file, .gif (25 frames a second), .mp4 (30) or .png (the strip); written whole or not at all
    pixels : width and height of a frame [px], even numbers
    speed : seconds of motion in a second of film; None: 1, or such that the film takes from 4 to 20 s
    trail, ghost, up, fall : as in `motion_page`

    Raises
    ------
    MissingExtraError
        Without Playwright and Pillow, for .mp4 imageio-ffmpeg (pip install 'shapephase[video]'), or a Chromium.
    OutputFileError
        If the browser or ffmpeg fails, or the file cannot be written.
    ShapeError, UnknownNameError
        As `motion_page`, for pixels that are none, and for another ending.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> try:
    ...     sp.plots.motion_video(motion, "film.webm")
    ... except sp.errors.UnknownNameError as error:
    ...     print(error)
    unknown kind of film '.webm'. Valid: .gif, .mp4, .png
    """
    check_object(motion, "Motion", "motion")
    check_keywords(fall, motion_video)
    ending = check_video(path, pixels)
    rate = playing_speed(motion.duration, speed)
    page = motion_html(motion, speed=rate, frames=None, trail=trail, ghost=ghost, up=up, **fall)
    write_video(page, path, frame_times(ending, motion.duration, rate), pixels)


def scene_and_data(
    motion: Motion,
    *,
    speed: float | None,
    frames: int | None,
    trail: str | None,
    ghost: bool,
    up: str | None,
    fall: Mapping[str, ArrayLike],
) -> tuple[MovingScene, dict[str, Any]]:
    """A motion as a scene, and as the data of a page; arguments, errors and warnings as `motion_page`."""
    check_object(motion, "Motion", "motion")
    check_flag(ghost, "ghost")
    rate = playing_speed(motion.duration, speed)
    up_axis(up, None)
    scene = _scene(motion, rate, frames, trail, fall)
    if up is None and scene.falls:
        gravity = np.asarray(fall["gravity"], dtype=float)
        upwards = -gravity / np.linalg.norm(gravity)
    else:
        upwards = up_axis(up, scene.body)
    return scene, motion_data(scene, speed=rate, ghost=ghost, up=upwards)


def view(
    motion: Motion,
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    up: str | None = None,
    notebook: bool | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
    **fall: ArrayLike,
) -> LiveView | None:
    """Show a motion, in a browser by a server of this process, or in the cell of a notebook.

    Parameters
    ----------
    speed, frames, trail, ghost, up, fall : as in `motion_page`
    notebook : whether to show it in a cell; None: if this runs in a notebook
    host, port : where the server listens; if the port is in use, the next free one
    browser : whether to open a browser there

    Returns
    -------
    the running view, with `url` and `stop()`; None in a notebook

    Notes
    -----
    Raises and warns as `motion_page`.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> with sp.view(motion, browser=False, port=0) as shown:
    ...     print(shown is not None)
    True
    """
    check_object(motion, "Motion", "motion")
    check_keywords(fall, view)
    check_flag(browser, "browser")
    check_flag(notebook, "notebook", allow_none=True)
    if not isinstance(host, str):
        raise ShapeError(f"host: the name or the address of this computer is needed, got {what_came(host)}")
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= _LAST_PORT:
        raise ShapeError(f"port: a whole number from 0 to {_LAST_PORT} is needed, got {what_came(port)}")
    page = motion_html(motion, speed=speed, frames=frames, trail=trail, ghost=ghost, up=up, **fall)
    if _in_notebook() if notebook is None else notebook:
        _show_in_cell(page)
        return None
    running = LiveView(page, printable(motion.deformation.label), host, port)
    if browser:
        webbrowser.open(running.url)
    return running


class LiveView:
    """A page shown by a server of this process.

    Made by `view`. It runs until `stop()` or the end of the process; used in a with statement, until the end of that.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> with sp.view(motion, browser=False, port=0) as shown:
    ...     print(type(shown).__name__)
    LiveView
    """

    def __init__(self, page: str, title: str, host: str, port: int) -> None:
        self._title, self._host = title, host
        self._server = _listening(host, port, page.encode())
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True, name="shapephase view")
        self._thread.start()

    @property
    def url(self) -> str:
        """Address for a browser."""
        return f"http://{self._host}:{self._server.server_address[1]}"

    def stop(self) -> None:
        """End the view and its server."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def wait(self) -> None:
        """Return when the view is stopped, by `stop()` or by Ctrl-C: for a script that has nothing else to do."""
        try:
            self._thread.join()
        except KeyboardInterrupt:
            self.stop()

    def __enter__(self) -> LiveView:
        """The view itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop it."""
        self.stop()

    def __repr__(self) -> str:
        """Title and address."""
        return f"LiveView({self._title!r}, {self.url})"


class _PageHandler(BaseHTTPRequestHandler):
    """Answers with the page, and prints nothing."""

    def __init__(self, page: bytes, *arguments: Any) -> None:
        self._page = page
        super().__init__(*arguments)

    def do_GET(self) -> None:
        """The page at its root, nothing elsewhere."""
        found = self.path == "/"
        self.send_response(200 if found else 404)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(self._page) if found else 0))
        self.end_headers()
        if found:
            self.wfile.write(self._page)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is said of requests."""


def _listening(host: str, port: int, page: bytes) -> ThreadingHTTPServer:
    """A server on the port, or the next one that is free. Raises OSError if there is none."""
    last = port + _PORTS if port else port
    while True:
        try:
            return ThreadingHTTPServer((host, port), partial(_PageHandler, page))
        except OSError:
            if port >= last:
                raise
            port += 1


def _show_in_cell(page: str) -> None:
    """The page in a frame of the notebook, which lets it run its own scripts and no others."""
    from IPython.display import HTML, display

    frame = f'<iframe style="width: 100%; height: {_HEIGHT}px; border: 0" srcdoc="{html.escape(page)}"></iframe>'
    # Within another element, for else IPython advises an address.
    display(HTML(f"<div>{frame}</div>"))


def _scene(
    motion: Motion, speed: float, frames: int | None, trail: str | None, fall: Mapping[str, ArrayLike]
) -> MovingScene:
    """The scene with the given number of frames, or as many as the speed needs."""
    if frames is not None:
        return moving_scene(motion, frames, trail=trail, **fall)
    count = frame_count(motion.duration, speed)
    scene = moving_scene(motion, count, trail=trail, **fall)
    if scene.largest_turn > 0.5 * math.pi:
        warnings.warn(
            f"from one frame to the next something turns by {math.degrees(scene.largest_turn):.0f} degrees and may "
            f"seem to turn the other way; choose more than {count} frames, or a lower speed than {speed:.3g}",
            VisualWarning,
            stacklevel=3,
        )
    return scene


def _in_notebook() -> bool:
    try:
        from IPython.core.getipython import get_ipython
    except ImportError:
        return False
    shell = get_ipython()
    return shell is not None and getattr(shell, "kernel", None) is not None
