"""Films of pages: frames drawn by a Chromium without a window, as GIF, MP4 or a strip of pictures."""

from __future__ import annotations

import asyncio
import contextlib
import io
import itertools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import Array
from ...errors import MissingExtraError, OutputFileError, ShapeError, unknown_name
from ...files import write_whole

FILM_SIZE = (640, 480)  # [px] width and height of a frame
_RATES = {".gif": 25, ".mp4": 30}  # [1/s] frames; a GIF counts in hundredths of a second
VIDEO_ENDINGS = (".gif", ".mp4", ".png")  # films, and strips of pictures
_PICTURES = 6  # of a strip
_COLOURS = 255  # a GIF has 256
_PALETTE_FRAMES = 5
_QUALITY = 20  # of 51 for MP4: lower is better and larger, at 20 one sees no difference
# Browsers that can draw without a window, in the order in which they are looked for.
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# By software, so that all machines draw the same.
_FLAGS = ("--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars")
_NEVER = 180_000.0  # [ms] the browser hangs
_POLL = 50.0  # [ms] between checks of whether the page is there
_SMALLEST = 64  # [px] MP4 wants even numbers
_LARGEST = 4096


def check_video(path: str | os.PathLike[str], pixels: Sequence[int]) -> str:
    """Return the ending of a film's file, after a check of what is needed to make it.

    Raises
    ------
    UnknownNameError
        For another ending than .gif, .mp4 or .png.
    ShapeError
        For pixels that are not two even numbers from 64 to 4096.
    MissingExtraError
        Without Playwright, Pillow, for .mp4 imageio-ffmpeg (pip install 'shapephase[video]'), or a Chromium.
    """
    ending = Path(path).suffix.lower()
    if ending not in VIDEO_ENDINGS:
        raise unknown_name("kind of film", ending or str(path), VIDEO_ENDINGS)
    whole = len(pixels) == 2 and all(isinstance(n, int | np.integer) and not isinstance(n, bool) for n in pixels)
    if not whole or not all(_SMALLEST <= n <= _LARGEST and n % 2 == 0 for n in pixels):
        raise ShapeError(f"pixels: two even numbers from {_SMALLEST} to {_LARGEST} are needed, got {pixels!r}")
    try:
        import PIL  # noqa: F401
        import playwright  # noqa: F401

        if ending == ".mp4":
            import imageio_ffmpeg  # noqa: F401
    except ImportError as error:
        raise MissingExtraError(
            f"films need {error.name}; install it with: pip install 'shapephase[video]'"
            + ("; a GIF needs no ffmpeg" if error.name == "imageio_ffmpeg" else "")
        ) from None
    chromium()
    return ending


def chromium() -> str:
    """Return the browser that draws: that of the environment variable CHROMIUM, or the first that is found.

    Raises MissingExtraError if there is none.
    """
    named = os.environ.get("CHROMIUM")
    found = shutil.which(named) if named else next((path for name in _BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        what = f"CHROMIUM names {named!r}, which is no program" if named else f"none of {', '.join(_BROWSERS)} is here"
        raise MissingExtraError(
            f"films are drawn by a Chromium, and {what}; install one, or name it in the environment variable CHROMIUM"
        )
    return found


def frame_times(ending: str, duration: float, speed: float) -> Array:
    """Times at which a film has frames, or a strip its pictures: (F,) [s]."""
    if ending not in _RATES:
        return np.linspace(0.0, duration, _PICTURES)
    return np.linspace(0.0, duration, max(2, round(_RATES[ending] * duration / speed) + 1))


def write_video(page: str, path: str | os.PathLike[str], times: Array, pixels: tuple[int, int]) -> None:
    """Draw a page of a motion at these times, and write the film; whole or not at all.

    Raises OutputFileError if the browser or ffmpeg fails.
    """
    ending = Path(path).suffix.lower()
    write = {".gif": _gif, ".mp4": _mp4, ".png": _strip}[ending]
    found = _outside_a_loop(lambda: write(_frames(page, times, pixels, os.fspath(path)), len(times)))
    write_whole(path, lambda stream: stream.write(found))


def _outside_a_loop(work: Callable[[], bytes]) -> bytes:
    """Run Playwright's work, in a thread where an event loop runs already, as in a notebook."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return work()
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def _frames(page: str, times: Array, pixels: tuple[int, int], path: str) -> Iterator[Any]:
    """Pictures of the page, one for each time, as Pillow has them."""
    from PIL import Image
    from playwright.sync_api import Error, sync_playwright

    # Who is root has no sandbox to give.
    flags = [*_FLAGS, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "page.html"
        file.write_text(page, encoding="utf-8")
        try:
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=chromium(), args=flags)
                context = browser.new_context(offline=True, viewport={"width": pixels[0], "height": pixels[1]})
                context.set_default_timeout(_NEVER)
                shown = context.new_page()
                shown.goto(file.as_uri())
                while not shown.evaluate("window.page !== undefined"):
                    shown.wait_for_timeout(_POLL)
                shown.evaluate("page.film()")
                for t in times.tolist():
                    shown.evaluate("time => { page.clock.show(time); page.scene.draw(); }", t)
                    yield Image.open(io.BytesIO(shown.screenshot(type="png"))).convert("RGB")
                browser.close()
        except Error as error:
            said = str(error).strip().splitlines() or ["without a message"]
            raise OutputFileError(f"{path}: the browser that draws it, {chromium()}, failed: {said[0]}") from error


def _gif(frames: Iterator[Any], _: int) -> bytes:
    from PIL import Image

    pictures = list(frames)
    # One palette for all, so that colours do not flicker.
    chosen = pictures[:: max(1, len(pictures) // _PALETTE_FRAMES)]
    width, height = pictures[0].size
    together = Image.new("RGB", (width, height * len(chosen)))
    for k, picture in enumerate(chosen):
        together.paste(picture, (0, k * height))
    # Small parts of a picture keep their hue by an octree; the median cut spends its colours on large ones.
    palette = together.quantize(_COLOURS, method=Image.Quantize.FASTOCTREE)
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    stream = io.BytesIO()
    first.save(
        stream,
        "GIF",
        save_all=True,
        append_images=others,
        duration=1000 // _RATES[".gif"],
        loop=0,
        disposal=1,
    )
    return stream.getvalue()


def _mp4(frames: Iterator[Any], _: int) -> bytes:
    from imageio_ffmpeg import get_ffmpeg_exe

    first = next(frames)
    width, height = first.size
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.mp4"
        raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(_RATES[".mp4"]), "-i", "-")
        made = ("-an", "-c:v", "libx264", "-crf", str(_QUALITY), "-pix_fmt", "yuv420p", str(file))
        command = [get_ffmpeg_exe(), "-loglevel", "error", *raw, *made]
        with (
            tempfile.TemporaryFile() as said,
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said) as ffmpeg,
        ):
            assert ffmpeg.stdin is not None
            # The error of a process that has ended is reported below.
            with contextlib.suppress(BrokenPipeError):
                for picture in itertools.chain([first], frames):
                    ffmpeg.stdin.write(picture.tobytes())
                ffmpeg.stdin.close()
            if ffmpeg.wait() or not file.exists():
                said.seek(0)
                lines = said.read().decode(errors="replace").strip().splitlines() or ["without a message"]
                raise OutputFileError(f"ffmpeg, which makes the film, failed: {lines[-1]}")
        return file.read_bytes()


def _strip(frames: Iterator[Any], count: int) -> bytes:
    from PIL import Image

    strip = None
    for k, picture in enumerate(frames):
        width, height = picture.size
        strip = strip or Image.new("RGB", (width * count, height))
        strip.paste(picture, (k * width, 0))
    assert strip is not None
    stream = io.BytesIO()
    strip.save(stream, "PNG", optimize=True)
    return stream.getvalue()
