"""A page: one HTML file that opens offline, to write, to show, or to film."""

from __future__ import annotations

import html
import math
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...arguments import check_file_name
from ...errors import ShapeError
from ...files import write_whole
from ...letters import value_text
from .video import FILM_SIZE, check_video, frame_times, write_video

_CELL_HEIGHT = 520  # [px] in a notebook
_MIN_PLAYING, _MAX_PLAYING = 4.0, 20.0  # [s] of playing unless a speed is given: to follow it, and not to tire
_FRAME_RATE = 30  # [1/s] of playing: smooth to the eye
_MAX_FRAMES = 3000  # keeps a page below some megabytes


@dataclass(frozen=True, repr=False, eq=False)
class Page:
    """A page that needs no network and no server, and may use none.

    Made by `view`, `report`, `explore` and `rolling_ellipsoid`. The last value of a notebook's cell is displayed.

    Attributes
    ----------
    title : of the page
    html : the whole page as text
    data : what its scripts draw, as plain values and arrays
    duration, speed : of the motion to film [s], and its seconds in a second of film; None: the page is not filmed
    """

    title: str
    html: str
    data: Mapping[str, Any]
    duration: float | None = None
    speed: float | None = None

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the page to an HTML file, whole or not at all."""
        check_file_name(path, "path")
        write_whole(path, lambda stream: stream.write(self.html.encode()))

    def show(self) -> Path | None:
        """Show the page in the cell of a notebook, or else open it in a browser.

        Returns
        -------
        the file that was written for the browser, in the system's folder of temporary files; None in a notebook
        """
        if _in_notebook():
            from IPython.display import display

            display(self)
            return None
        import webbrowser

        with tempfile.NamedTemporaryFile("wb", prefix="shapephase-", suffix=".html", delete=False) as file:
            file.write(self.html.encode())
        webbrowser.open(Path(file.name).as_uri())
        return Path(file.name)

    def film(self, path: str | os.PathLike[str], *, pixels: tuple[int, int] = FILM_SIZE) -> None:
        """Write a film of the page, or a strip of six pictures, drawn by a Chromium without a window.

        Parameters
        ----------
        path : of the file, .gif (25 frames a second), .mp4 (30) or .png (the strip); written whole or not at all
        pixels : width and height of a frame [px], even numbers

        Raises
        ------
        MissingExtraError
            Without Playwright and Pillow, for .mp4 imageio-ffmpeg (pip install 'shapephase[video]'), or without a
            Chromium (see `shapephase doctor`; the environment variable CHROMIUM may name it).
        OutputFileError
            If the browser or ffmpeg fails, or the file cannot be written.
        ShapeError, UnknownNameError
            For an invalid frame size, another ending, or a page other than those of `view` and `rolling_ellipsoid`.
        """
        check_file_name(path, "path")
        ending = check_video(path, pixels)
        if self.duration is None or self.speed is None:
            raise ShapeError("films are made of pages by view or rolling_ellipsoid; this page shows more than a motion")
        write_video(self.html, path, frame_times(ending, self.duration, self.speed), pixels)

    def _repr_html_(self) -> str:
        """Return the page in a frame, which lets it run its own scripts and no others."""
        frame = f'<iframe style="width: 100%; height: {_CELL_HEIGHT}px; border: 0" srcdoc="{html.escape(self.html)}">'
        return f"<div>{frame}</iframe></div>"

    def __repr__(self) -> str:
        """Title and size."""
        return f"Page({self.title!r}, {len(self.html.encode()) / 1e3:.0f} kB)"


def playing_speed(duration: float, speed: float | None) -> float:
    """Return seconds of motion in a second of playing: as given, or by default. Raises ShapeError."""
    if speed is None:
        return duration / min(max(duration, _MIN_PLAYING), _MAX_PLAYING)
    if not (isinstance(speed, int | float | np.floating | np.integer) and 0.0 < speed < math.inf):
        raise ShapeError(
            f"speed: seconds of motion in a second of playing, above 0, are needed, got {value_text(speed)}"
        )
    return float(speed)


def frame_count(duration: float, speed: float) -> int:
    """Return the number of frames that are smooth at that speed."""
    return min(max(math.ceil(_FRAME_RATE * duration / speed), 2), _MAX_FRAMES) + 1


def _in_notebook() -> bool:
    try:
        from IPython.core.getipython import get_ipython
    except ImportError:
        return False
    shell = get_ipython()
    return shell is not None and getattr(shell, "kernel", None) is not None
