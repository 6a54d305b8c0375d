"""What readers click on and see in the built site: links lead somewhere, three clicks are enough, figures are drawn."""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_WAYS = "three-ways-from-here"
_CLICKS = 3
SOUGHT = {
    "how to install": "pip install",
    "the loop of a cat": "shapephase loop cat cat_righting --out",
    "explore": "shapephase explore",
    "twist in time": "shapephase plot somersault diver robots/diver_dive.mot",
    "twist with bars": "shapephase split diver robots/diver_dive.mot --flight auto",
    "motion capture": "shapephase split robots/formats/jump.bvh",
    "the arms' share": "shapephase contributions diver robots/diver_dive.mot --of twist",
    "wheels": "shapephase split satellite robots/satellite_log.csv --rotor-speed",
    "error bars": "--joint-noise",
    "an audit": "shapephase audit",
    "a plan": "shapephase plan satellite --undo satellite_sweep",
    "how to cite": "How to cite",
}
"""What a newcomer looks for, and words of a page that has it."""


class _Page(HTMLParser):
    """Words of a page's text, its anchors, and its links: all, those of its text, those of each of the three ways."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.in_text: set[str] = set()
        self.ways: list[list[str]] = []
        self.words = ""
        self.unseen = False
        self._depth: dict[str, int] = defaultdict(int)
        self._sections: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note links and anchors."""
        found = {name: value or "" for name, value in attrs}
        self.anchors |= {found[name] for name in ("id", "name") if name in found}
        self._depth[tag] += 1
        if tag == "section":
            self._sections.append(found.get("id", ""))
        if tag == "p" and _WAYS in self._sections:
            self.ways.append([])
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
            if self._depth["article"]:
                self.in_text.add(found["href"])
            if _WAYS in self._sections and self.ways and "headerlink" not in found.get("class", ""):
                self.ways[-1].append(found["href"])
        if tag in ("img", "script", "iframe", "source") and "src" in found:
            self.links.append(found["src"])

    def handle_data(self, data: str) -> None:
        """Note words of the text, and a figure of which a cell printed the words."""
        if self._depth["article"]:
            self.words += data
        self.unseen |= data.startswith("<Figure size")

    def handle_endtag(self, tag: str) -> None:
        """Note where the text ends."""
        self._depth[tag] -= 1
        if tag == "section":
            self._sections.pop()


def pages(site: Path) -> dict[Path, _Page]:
    """Every page of the site."""
    return {
        path: _Page(path.read_text(encoding="utf-8"))
        for path in sorted(site.rglob("*.html"))
        if "_static" not in path.parts
    }


def _target(page: Path, link: str) -> tuple[Path, str] | None:
    """The file and the anchor that a link leads to; None: out of the site."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return None
    file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    return file, unquote(parts.fragment)


def broken(found: dict[Path, _Page]) -> Iterator[str]:
    """Links to unknown files and anchors, and figures that are words."""
    for page, here in found.items():
        if here.unseen:
            yield f"{page.name}: a cell shows the words for a figure; draw on axes of matplotlib.pyplot"
        for link in here.links:
            target = _target(page, link)
            if target is None:
                continue
            file, anchor = target
            if not file.exists():
                yield f"{page.name}: {link} leads nowhere"
            elif anchor and file in found and anchor not in found[file].anchors:
                yield f"{page.name}: {link} has no such place"


def lost_ways(found: dict[Path, _Page], front: Path) -> Iterator[str]:
    """Ways of the front page that cannot be gone: each click is a link in the text of the page before."""
    ways = found[front].ways
    if len(ways) != _CLICKS:
        yield f"{front.name}: {len(ways)} ways"
    for way in ways:
        page = front
        if len(way) != _CLICKS:
            yield f"{front.name}: a way of {len(way)} clicks: {way}"
        for link in way:
            goal = (_target(front, link) or (front, ""))[0]
            reached = {(_target(page, href) or (None, ""))[0] for href in found[page].in_text}
            if goal not in reached:
                yield f"{page.name}: no link to {goal.name} in its text"
            page = goal


def far_off(found: dict[Path, _Page], front: Path) -> Iterator[str]:
    """What a newcomer looks for and finds on no page within three clicks on links in texts, from the front page."""
    near, newest = {front}, {front}
    for _ in range(_CLICKS):
        targets = (_target(page, link) for page in newest for link in found[page].in_text)
        newest = {target[0] for target in targets if target and target[0] in found} - near
        near |= newest
    for thing, words in SOUGHT.items():
        if not any(words in found[page].words for page in near):
            yield f"{front.name}: {thing} ({words!r}) is more than {_CLICKS} clicks away"


def main(site: Path) -> int:
    """Print what is wrong; returns how much."""
    found = pages(site.resolve())
    front = site.resolve() / "index.html"
    wrong = [*broken(found), *lost_ways(found, front), *far_off(found, front)]
    links = sum(len(page.links) for page in found.values())
    print("\n".join([*wrong, f"{len(found)} pages, {links} links, {len(wrong)} faults"]))
    return len(wrong)


if __name__ == "__main__":
    sys.exit(bool(main(Path(sys.argv[1]))))
