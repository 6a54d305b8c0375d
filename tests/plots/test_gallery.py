"""The gallery's page shows the code that draws its pictures, which is short and runs, and every row has its picture."""

from __future__ import annotations

import importlib
import re
import sys
import types

import pytest
from PIL import Image

from shapephase import plots
from support.long_runs import full_but
from support.places import ROOT

GALLERY = ROOT / "docs" / "gallery"
ROWS = {file.stem: file for file in sorted((GALLERY / "rows").iterdir())}
PAGE = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
MOST_LINES = 10
LARGEST, LARGEST_OF_ALL = 60_000, 2_000_000  # [bytes]
WIDTH = 442  # [px]
# Cheap ones of each kind: axes, three-dimensional axes, Motion.plot, a command.
QUICK = ("polhodes", "herpolhode", "euler_angles", "pendulum", "potential", "phases", "separatrix", "conjugate")


@pytest.fixture(scope="module")
def draw():
    sys.path.insert(0, str(GALLERY))
    try:
        return importlib.import_module("draw")
    finally:
        sys.path.remove(str(GALLERY))


def test_every_row_stands_once_on_the_page_with_its_picture():
    assert sorted(re.findall(r"^:::\{row\} (\w+)$", PAGE, re.MULTILINE)) == sorted(ROWS)
    pictures = {file.stem: file for file in GALLERY.glob("*.png")}
    assert sorted(pictures) == sorted(ROWS)
    sizes = [file.stat().st_size for file in pictures.values()]
    assert max(sizes) < LARGEST
    assert sum(sizes) < LARGEST_OF_ALL
    for file in pictures.values():
        with Image.open(file) as picture:
            assert picture.width == WIDTH


@pytest.mark.parametrize("name", ROWS)
def test_the_code_of_a_row_is_short_and_can_be_read(name):
    code = ROWS[name].read_text(encoding="utf-8")
    assert sum(bool(line.strip()) for line in code.splitlines()) <= MOST_LINES
    if ROWS[name].suffix == ".py":
        compile(code, name, "exec")
        assert re.search(r"\bax\b", code)
    else:
        assert code.startswith("shapephase ")
        assert len(re.split(r"(?<!\\)\n", code.strip())) == 1


def test_the_page_shows_the_code_of_the_files():
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        rows: types.ModuleType = importlib.import_module("_site.gallery_rows")
    finally:
        sys.path.remove(str(ROOT / "docs"))
    shown = rows.with_rows(PAGE, GALLERY / "rows", {"plot_loop": "shapephase.plots.plot_loop"})
    for name, file in ROWS.items():
        assert f"```{{literalinclude}} gallery/rows/{file.name}\n" in shown
        assert f"```{{image}} gallery/{name}.png\n:alt: " in shown
    assert "{row}" not in shown
    assert "{py:obj}`plot_loop <shapephase.plots.plot_loop>`" in shown


def test_every_figure_is_in_the_gallery():
    code = " ".join([PAGE, *(file.read_text(encoding="utf-8") for file in ROWS.values())])
    assert not [name for name in plots.__all__ if name.startswith("plot_") and name not in code]


@pytest.mark.parametrize("name", full_but(ROWS, *QUICK))
def test_a_row_draws_its_picture(draw, name, tmp_path):
    """As high as the one that is committed, so that its page has not changed; pages and films in the full run."""
    with Image.open(draw.draw(name, tmp_path)) as drawn, Image.open(GALLERY / f"{name}.png") as committed:
        assert drawn.size == committed.size
