"""Films of motions: frames as the page draws them, files that others read, and what is said when something lacks."""

from __future__ import annotations

import asyncio
import io
import subprocess
import sys

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import MissingExtraError, OutputFileError, ShapeError, UnknownNameError
from shapephase.examples import cat_righting
from shapephase.plots import view
from shapephase.plots.pages import video
from support.browser import furred

Image = pytest.importorskip("PIL.Image")
pytest.importorskip("playwright", reason="films are drawn through Playwright")


@pytest.fixture(scope="module")
def righting():
    """The cat falls upside down without momentum."""
    upside_down = np.diag([1.0, -1.0, -1.0])
    return sp.reconstruct(sp.articulated(sp.load_body("cat"), cat_righting(0.5)), np.zeros(3), upside_down)


@pytest.fixture
def turning():
    return sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.6, 0.9, 0.5])


@pytest.fixture
def any_browser(monkeypatch):
    """Some program where a Chromium is looked for."""
    monkeypatch.setenv("CHROMIUM", "false")


def painted(count):
    """Frames of one grey and one small coloured square each, which moves."""
    colours = [(0, 158, 115), (213, 94, 0), (0, 114, 178)]
    for k in range(count):
        picture = Image.new("RGB", (96, 64), (230, 232, 236))
        picture.paste(colours[k % 3], (4 * k, 8, 4 * k + 6, 14))
        yield picture


def test_a_gif_has_every_frame_for_a_twenty_fifth_of_a_second():
    film = Image.open(io.BytesIO(video._gif(painted(12), 12)))
    assert (film.n_frames, film.size, film.info["loop"]) == (12, (96, 64), 0)
    for k, picture in enumerate(painted(12)):
        film.seek(k)
        assert film.info["duration"] == 40
        shown = np.asarray(film.convert("RGB"), dtype=int)
        assert np.abs(shown - np.asarray(picture, dtype=int)).max() < 24, k


def test_a_strip_has_its_pictures_side_by_side():
    strip = np.asarray(Image.open(io.BytesIO(video._strip(painted(6), 6))))
    np.testing.assert_array_equal(strip, np.concatenate([np.asarray(picture) for picture in painted(6)], axis=1))


@pytest.mark.full
def test_an_mp4_is_read_back_frame_by_frame(tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    pictures = list(painted(9))
    (tmp_path / "film.mp4").write_bytes(video._mp4(iter(pictures), 9))
    read = [ffmpeg, "-i", str(tmp_path / "film.mp4"), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(read, capture_output=True, check=True, timeout=300)
    assert b"30 fps" in done.stderr
    frames = np.frombuffer(done.stdout, np.uint8).reshape(9, 64, 96, 3)
    # Colours go through a code with less of them than of light.
    for frame, picture in zip(frames, pictures, strict=True):
        assert np.abs(frame.astype(int) - np.asarray(picture, dtype=int)).mean() < 4.0


@pytest.mark.full
def test_what_ffmpeg_says_is_said(monkeypatch):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    monkeypatch.setattr(ffmpeg, "get_ffmpeg_exe", lambda: "false")
    with pytest.raises(OutputFileError, match="ffmpeg"):
        video._mp4(painted(3), 3)


def test_frames_are_evenly_in_time_from_start_to_end():
    np.testing.assert_allclose(video.frame_times(".gif", 0.5, 0.125), np.linspace(0.0, 0.5, 101), atol=0.0)
    np.testing.assert_allclose(video.frame_times(".mp4", 2.0, 1.0), np.linspace(0.0, 2.0, 61), atol=0.0)
    np.testing.assert_allclose(video.frame_times(".png", 2.0, 1.0), np.linspace(0.0, 2.0, 6), atol=0.0)


@pytest.mark.usefixtures("any_browser")
def test_what_lacks_is_named(turning, tmp_path, monkeypatch):
    old = tmp_path / "film.gif"
    old.write_text("old")
    for name in ("film.webm", "film"):
        with pytest.raises(UnknownNameError, match="kind"):
            view(turning).film(tmp_path / name)
    for size in ((640, 481), (640,), (0, 480), (640.0, 480), (10_000, 480)):
        with pytest.raises(ShapeError, match="pixels"):
            view(turning).film(old, pixels=size)
    with monkeypatch.context() as changed:
        changed.setenv("CHROMIUM", "no-such-browser")
        with pytest.raises(MissingExtraError, match="no-such-browser"):
            view(turning).film(old)
        changed.delenv("CHROMIUM")
        changed.setenv("PATH", str(tmp_path))
        with pytest.raises(MissingExtraError, match="chromium"):
            view(turning).film(old)
    for lacking, ending in (("playwright", "gif"), ("PIL", "png"), ("imageio_ffmpeg", "mp4")):
        with monkeypatch.context() as changed:
            changed.setitem(sys.modules, lacking, None)
            with pytest.raises(MissingExtraError, match=rf"{lacking}.*shapephase\[video\]"):
                view(turning).film(tmp_path / f"film.{ending}")
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]
    assert old.read_text() == "old"


@pytest.mark.usefixtures("any_browser")
def test_a_gif_needs_no_ffmpeg(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert video.check_video("film.gif", (640, 480)) == ".gif"


@pytest.mark.full
@pytest.mark.usefixtures("any_browser")
def test_a_browser_that_fails_leaves_the_old_film(turning, tmp_path):
    old = tmp_path / "film.gif"
    old.write_text("old")
    with pytest.raises(OutputFileError, match=r"film\.gif"):
        view(turning).film(old)
    assert old.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.full
def test_the_cat_of_a_film_starts_on_its_back_and_ends_on_its_feet(righting, tmp_path):
    """The strip and the film of the motion, by the fur of the cat: thin legs reach further from the thick trunk."""
    try:
        video.chromium()
    except MissingExtraError as error:
        pytest.skip(str(error))
    view(righting).film(tmp_path / "cat.png", pixels=(320, 240))
    with Image.open(tmp_path / "cat.png") as picture:
        strip = np.asarray(picture, dtype=int)
    assert strip.shape == (240, 6 * 320, 3)
    view(righting, speed=0.5).film(tmp_path / "cat.gif", pixels=(320, 240))
    with Image.open(tmp_path / "cat.gif") as film:
        assert (film.n_frames, film.size) == (26, (320, 240))
        film.seek(25)
        last = np.asarray(film.convert("RGB"), dtype=int)
    for picture in (strip[:, -320:], last):
        down = furred(picture)[:, 0]
        assert len(down) > 300
        assert down.max() - np.median(down) > 1.2 * (np.median(down) - down.min())
    up = furred(strip[:, :320])[:, 0]
    assert np.median(up) - up.min() > 1.2 * (up.max() - np.median(up))
    # Where events are handled already, as in a notebook, the browser runs in a thread.
    asyncio.run(in_a_loop(righting, tmp_path / "again.png"))
    with Image.open(tmp_path / "again.png") as picture:
        assert picture.size == (6 * 64, 64)


async def in_a_loop(motion, file):
    view(motion).film(file, pixels=(64, 64))
