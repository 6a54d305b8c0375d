"""The first hour of three readers: what they type runs, and the built site is searched for it."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from support.places import ROOT

SATELLITE = ("satellite", "robots/satellite_log.csv", "--rotor-speed", "wheel_spin=wheel_spin", "--smooth", "1e-4")
JUMP = ("robots/formats/jump.bvh", "robots/formats/jump.bvh", "--length-unit", "0.05", "--person-mass", "70")
COMMANDS = {
    "a student draws the loop of a cat": (("loop", "cat", "cat_righting", "--out", "loop.svg"), "180.0000"),
    "an engineer reads a drift with bars": (("split", *SATELLITE), "stored wheel momentum"),
    "an engineer plans the way back": (
        ("plan", "satellite", "--undo", "satellite_sweep", "--joints", "-wheel_spin", "--out", "back.csv"),
        "best: the plan",
    ),
    "a biomechanist reads a twist with bars": (
        ("split", "diver", "robots/diver_dive.mot", "--flight", "auto"),
        "-1.09281 ± 0.00064 turns",
    ),
    "a biomechanist draws the twist in time": (
        ("plot", "somersault", "diver", "robots/diver_dive.mot", "--out", "twist.pdf"),
        "momentum",
    ),
    "a biomechanist asks for the arms' share": (
        ("contributions", "diver", "robots/diver_dive.mot", "--of", "twist"),
        "arms",
    ),
    "a biomechanist splits a jump of motion capture": (("split", *JUMP), "somersaults"),
}


@pytest.mark.parametrize("reader", COMMANDS)
def test_what_a_reader_types_is_looked_for_on_the_built_site(reader, monkeypatch):
    """`_site.built_links` finds it within three clicks, when the site is built."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    sought = importlib.import_module("_site.built_links").SOUGHT
    typed = " ".join(("shapephase", *COMMANDS[reader][0]))
    assert any(typed.startswith(words) for words in sought.values())


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
    assert all((tmp_path / word).stat().st_size for word in words if word in ("loop.svg", "back.csv", "twist.pdf"))
