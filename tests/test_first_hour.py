"""The first hour of three readers: what they type stands three clicks from the front page, and runs."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from support.places import ROOT

DOCS = ROOT / "docs"
FRONT = DOCS / "index.md"
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)|:link: (\S+)|^(\w[\w/]*)$", re.MULTILINE)  # the last in a toctree
SATELLITE = ("satellite", "robots/satellite_log.csv", "--rotor-speed", "wheel_spin=wheel_spin", "--smooth", "1e-4")
COMMANDS = {
    "a student draws the loop of a cat": (("loop", "cat", "cat_righting", "--out", "loop.svg"), "180.0000"),
    "an engineer reads a drift with bars": (("split", *SATELLITE), "stored wheel momentum"),
    "an engineer plans the way back": (
        ("plan", "satellite", "--undo", "satellite_sweep", "--joints", "-wheel_spin", "--out", "back.csv"),
        "best: the plan",
    ),
    "a biomechanist reads a twist with bars": (
        ("split", "diver", "robots/diver_dive.mot", "--flight", "auto"),
        "twists",
    ),
    "a biomechanist asks for the arms' share": (
        ("contributions", "diver", "robots/diver_dive.mot", "--of", "twist"),
        "arms",
    ),
}
# What a reader looks for, and words of the page that has it.
SOUGHT = {
    "how to install": "pip install",
    "explore": "shapephase explore",
    "twist in time": "shapephase plot somersault diver",
    "wheels": "--rotor-speed",
    "error bars": "--joint-noise",
    "an audit": "shapephase audit",
    "a plan": "shapephase plan",
    "how to cite": "CITATION.cff",
}


def pages_within(clicks: int) -> str:
    """Texts of the pages that links lead to from the front page."""
    known, edge = {FRONT}, {FRONT}
    for _ in range(clicks):
        edge = {to for page in edge for to in linked(page)} - known
        known |= edge
    return "\n".join(page.read_text(encoding="utf-8") for page in sorted(known))


def linked(page):
    """Pages of the documentation that a page links to."""
    for names in LINK.findall(page.read_text(encoding="utf-8")):
        place = (page.parent / next(filter(None, names))).resolve()
        place = ROOT / "notebooks" / place.name if "notebooks" in place.parts else place
        for found in (place, place.with_suffix(".md"), place.with_suffix(".ipynb")):
            if found.is_file() and found.suffix in (".md", ".ipynb"):
                yield found


@pytest.mark.parametrize("reader", COMMANDS)
def test_what_a_reader_types_stands_three_clicks_from_the_front(reader):
    words, _ = COMMANDS[reader]
    assert re.search(
        rf"shapephase {' '.join(map(re.escape, words[:3]))}(?!\w)".replace("robots/", "(robots/)?"), pages_within(3)
    )


@pytest.mark.parametrize("thing", SOUGHT)
def test_what_a_reader_seeks_is_three_clicks_from_the_front(thing):
    assert SOUGHT[thing] in pages_within(3)


@pytest.mark.full
@pytest.mark.parametrize("reader", COMMANDS)
def test_what_a_reader_types_runs(reader, tmp_path):
    words, printed = COMMANDS[reader]
    (tmp_path / "robots").symlink_to(ROOT / "robots")
    run = subprocess.run(
        [sys.executable, "-m", "shapephase", *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert printed in run.stdout
    assert all((tmp_path / word).stat().st_size for word in words if word in ("loop.svg", "back.csv"))
