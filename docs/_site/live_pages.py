"""Pages of the command line that are shown inside pages of the site, made when it is built."""

from __future__ import annotations

from pathlib import Path

from shapephase.cli.main import main

LIVE = {"explore_cat.html": "explore cat --joints waist_pitch waist_yaw"}


def write_live_pages(folder: Path) -> None:
    """Write each page by its command."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, command in LIVE.items():
        main([*command.split(), "--html", str(folder / name), "--quiet"])
