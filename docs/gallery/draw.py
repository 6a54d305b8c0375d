"""Draw the pictures of the gallery by the code that its page shows: `python docs/gallery/draw.py`, or with names.

A row is a file of `rows/`: Python that ends with the axes `ax`, or one command line. Its picture is written beside this
file, 442 pixels wide, in 256 colours; pages and films need Chromium.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from shapephase.cli.main import main
from shapephase.plots.pages.video import chromium

HERE = Path(__file__).parent
ROWS = {file.stem: file for file in sorted((HERE / "rows").iterdir())}
# Pixels: a column of the page, and the window that a page is opened in.
WIDTH = 442
WINDOW = {
    "explore": (1000, 900),
    "rolling_page": (900, 760),
    "plan": (900, 760),
    "split": (900, 1300),
    "audit": (900, 1012),
}
USUAL_WINDOW = (900, 1000)
RESOLUTION = 260  # [dots per inch] that figures are drawn in, before they are made smaller
WIDEST = 4.0  # [height] a film in pictures side by side is cut in two rows
COLOURS = 256
MEANS = 4  # rounds that move the colours to the means of what they stand for; without, smooth maps have steps
CANNOT_TELL = 12  # exit code of an audit
MOMENTS = {"contributions_page": 0.75}  # [s] at which a page that does not play by itself is shown
SHOW = "setTimeout(() => page.clock.show({}), 1000)"
READY = 20_000  # [ms] that a page is given to draw itself
FLAGS = "--headless=new --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars"


def image_of(name: str) -> Image.Image:
    """Run a row in an empty folder, and return what it draws."""
    code, before = ROWS[name].read_text(encoding="utf-8"), Path.cwd()
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            Path("robots").symlink_to(HERE.parent.parent / "robots")
            return _drawn_by_command(name, code) if ROWS[name].suffix == ".sh" else _drawn_by_python(code)
        finally:
            os.chdir(before)


def _drawn_by_python(code: str) -> Image.Image:
    names: dict[str, object] = {}
    exec(compile(code, "row", "exec"), names)
    stream = BytesIO()
    names["ax"].figure.savefig(stream, format="png", dpi=RESOLUTION)  # type: ignore[attr-defined]
    return Image.open(stream)


def _drawn_by_command(name: str, code: str) -> Image.Image:
    words = shlex.split(code.replace("\\\n", ""))
    try:
        main([*words[1:], "--quiet"])
    except SystemExit as end:
        if end.code not in (0, None, CANNOT_TELL):
            raise
    out = Path(words[-1]).resolve()
    if out.suffix == ".html":
        if name in MOMENTS:
            # The policy of a page forbids scripts that are not its own.
            page = out.read_text(encoding="utf-8").replace("Content-Security-Policy", "none")
            out.write_text(f"{page}<script>{SHOW.format(MOMENTS[name])}</script>", encoding="utf-8")
        width, height = WINDOW.get(name, USUAL_WINDOW)
        size = f"--window-size={width},{height} --virtual-time-budget={READY} --screenshot={out}.png"
        subprocess.run([chromium(), *FLAGS.split(), *size.split(), out.as_uri()], check=True, capture_output=True)
        out = Path(f"{out}.png")
    image = Image.open(out)
    image.load()
    return image


def draw(name: str, folder: Path = HERE) -> Path:
    """Write the picture of a row; returns its file."""
    image = image_of(name).convert("RGB")
    if image.width > WIDEST * image.height:
        left = image.crop((0, 0, image.width // 2, image.height))
        both = Image.new("RGB", (left.width, 2 * left.height), "white")
        both.paste(left, (0, 0))
        both.paste(image.crop((left.width, 0, 2 * left.width, image.height)), (0, left.height))
        image = both
    image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    file = folder / f"{name}.png"
    image.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, MEANS, dither=Image.Dither.NONE).save(file, optimize=True)
    return file


if __name__ == "__main__":
    for chosen in sys.argv[1:] or ROWS:
        print(draw(chosen))
