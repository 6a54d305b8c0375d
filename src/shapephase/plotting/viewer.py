"""Motions in three dimensions: live in a browser or a notebook, or as one HTML file that needs no network."""

from __future__ import annotations

import contextlib
import html
import math
import os
import threading
import time
import warnings
import webbrowser
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object
from ..errors import MissingExtraError, ShapeError, VisualWarning
from ..files import write_whole
from ..reconstruction.reconstruction import Motion
from ._letters import printable
from ._moving_scene import MovingScene, moving_scene
from ._page_policy import guarded
from ._scene_drawing import DrawnScene, set_camera
from ._silent_server import silence_thread_of, silenced

if TYPE_CHECKING:
    import viser

# Seconds that a motion is played in, unless a speed is given: long enough to follow it, not so long as to tire.
_MIN_PLAYING = 4.0
_MAX_PLAYING = 20.0
# Frames in a second of playing [1/s]: smooth to the eye.
_FRAME_RATE = 30
# Frames of a page, unless their number is given: keeps its file below some megabytes.
_MAX_FRAMES = 3000
# Seconds that the first and the last frame stand still, so that start and end can be seen before it repeats.
_HOLD_FIRST = 0.5
_HOLD_LAST = 1.0


def motion_page(
    motion: Motion,
    path: str | os.PathLike[str],
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    **fall: ArrayLike,
) -> None:
    """Write a motion as one HTML page to play, stop and scrub; it needs no network and no server, and may use none.

    The body moves as reconstructed, with the conserved angular momentum as an arrow from the centre of mass, and the
    body at the start as a transparent ghost.

    Parameters
    ----------
    path : of the file, written whole or not at all
    speed : seconds of motion in a second of playing; None: 1, or such that playing takes from 4 to 20 s
    frames : None: 30 in a second of playing
    trail : a link whose origin leaves a trail, light at the start and dark at the end
    ghost : whether the body at the start is shown
    fall : start, velocity, gravity of the centre of mass as in `Motion.base_position`; by default it rests at the
        origin

    Raises
    ------
    MissingExtraError
        If viser is not installed.
    ShapeError, UnknownNameError
        As `moving_scene`, and for a speed that is not above 0.

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
    page = motion_html(motion, speed=speed, frames=frames, trail=trail, ghost=ghost, **fall)
    write_whole(path, lambda stream: stream.write(page.encode()))


def motion_html(
    motion: Motion,
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    **fall: ArrayLike,
) -> str:
    """The page that `motion_page` writes, as text: arguments, errors and warnings as there.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plotting.motion_html(motion, frames=5)[:15].lower()
    '<!doctype html>'
    """
    check_object(motion, "Motion", "motion")
    viser_module()
    playing_speed = _playing_speed(motion, speed)
    scene = _scene(motion, playing_speed, frames, trail, fall)
    with _server() as server:
        page = _recording(server, scene, playing_speed, ghost).as_html()
    title = f"<title>{html.escape(printable(scene.title))}</title>"
    return guarded(page.replace("<title>Viser</title>", title, 1))


def view(
    motion: Motion,
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    notebook: bool | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    browser: bool = True,
    **fall: ArrayLike,
) -> LiveView | None:
    """Show a motion, in a browser by a server of this process, or in the cell of a notebook.

    Parameters
    ----------
    speed, frames, trail, ghost, fall : as in `motion_page`
    notebook : whether to show it in a cell, recorded as by `motion_page`; None: if this runs in a notebook
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
    viser_module()
    playing_speed = _playing_speed(motion, speed)
    scene = _scene(motion, playing_speed, frames, trail, fall)
    if _in_notebook() if notebook is None else notebook:
        with _server() as server:
            _recording(server, scene, playing_speed, ghost).show(height=480)
        return None
    running = LiveView(_started(host, port), scene, playing_speed, ghost)
    if browser:
        webbrowser.open(running.url)
    return running


def viser_module() -> Any:
    """The module viser. Raises MissingExtraError."""
    try:
        import viser
    except ImportError:
        raise MissingExtraError("3-D views need viser; install it with: pip install 'shapephase[viz]'") from None
    return viser


class LiveView:
    """A motion shown by a server of this process, with a time slider, a play button and a speed.

    Made by `view`. It runs until `stop()` or the end of the process; used in a with statement, until the end of that.

    Attributes
    ----------
    server : the viser server, to which other things can be added

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> with sp.view(motion, browser=False, port=0) as shown:
    ...     print(type(shown).__name__)
    LiveView
    """

    def __init__(self, server: viser.ViserServer, scene: MovingScene, speed: float, ghost: bool) -> None:
        self.server = server
        self._scene = scene
        self._drawn = DrawnScene(server.scene, scene, speed, ghost)
        set_camera(server, scene)
        self._stopped = threading.Event()
        end = float(scene.times[-1])
        gui = server.gui
        self._slider = gui.add_slider("time [s]", min=0.0, max=end, step=end / 1000.0, initial_value=0.0)
        self._playing = gui.add_checkbox("play", initial_value=True)
        self._speed = gui.add_number("speed", initial_value=speed, min=0.0)
        self._thread = threading.Thread(target=self._play, daemon=True, name="shapephase view")
        self._thread.start()

    @property
    def url(self) -> str:
        """Address for a browser."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def stop(self) -> None:
        """End the view and its server."""
        self._stopped.set()
        self._thread.join()
        with silenced():
            self.server.stop()

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
        return f"LiveView({self._scene.title!r}, {self.url})"

    def _play(self) -> None:
        end, last = float(self._scene.times[-1]), time.monotonic()
        while not self._stopped.wait(1.0 / _FRAME_RATE):
            now = time.monotonic()
            if self._playing.value:
                moved = self._slider.value + (now - last) * self._speed.value
                self._slider.value = moved if moved <= end else 0.0
            last, self._drawn.speed = now, self._speed.value
            with self.server.atomic():
                self._drawn.show(round(self._slider.value / end * (len(self._scene.times) - 1)))


def _recording(server: viser.ViserServer, scene: MovingScene, speed: float, ghost: bool) -> Any:
    """All frames of a scene as viser records them."""
    drawn = DrawnScene(server.scene, scene, speed, ghost)
    set_camera(server, scene)
    serializer = server.get_scene_serializer()
    serializer.insert_sleep(_HOLD_FIRST)
    step = float(scene.times[1] - scene.times[0]) / speed
    for frame in range(1, len(scene.times)):
        serializer.insert_sleep(step)
        drawn.show(frame)
    serializer.insert_sleep(_HOLD_LAST)
    return serializer


@contextlib.contextmanager
def _server() -> Iterator[viser.ViserServer]:
    """A server while a scene is recorded, on a port that the system chooses."""
    server = _started("127.0.0.1", 0)
    try:
        yield server
    finally:
        with silenced():
            server.stop()


def _started(host: str, port: int) -> viser.ViserServer:
    with silenced():
        server = viser_module().ViserServer(host=host, port=port, verbose=False)
    silence_thread_of(server)
    return server


def _playing_speed(motion: Motion, speed: float | None) -> float:
    """Seconds of motion in a second of playing: as given, or by default. Raises ShapeError."""
    if speed is None:
        return motion.duration / min(max(motion.duration, _MIN_PLAYING), _MAX_PLAYING)
    if not (isinstance(speed, int | float | np.floating | np.integer) and 0.0 < speed < math.inf):
        raise ShapeError(f"speed: seconds of motion in a second of playing, above 0, are needed, got {speed!r}")
    return float(speed)


def _scene(
    motion: Motion, speed: float, frames: int | None, trail: str | None, fall: Mapping[str, ArrayLike]
) -> MovingScene:
    """The scene with the given number of frames, or as many as the speed needs."""
    if frames is not None:
        return moving_scene(motion, frames, trail=trail, **fall)
    count = min(max(math.ceil(_FRAME_RATE * motion.duration / speed), 2), _MAX_FRAMES) + 1
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
