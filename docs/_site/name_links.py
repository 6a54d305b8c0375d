"""On pages of text, a name of the library in backticks is a link to its place in the reference."""

from __future__ import annotations

import inspect
import re
from functools import cache
from pathlib import Path

from .reference_pages import questions

_FENCE = re.compile(r"^(```|:::)")
# What pages mean otherwise: attributes of a motion, and a folder.
_OTHERWISE = {"angular_velocity", "body_momentum", "rigid_body"}
_CODE = re.compile(r"(?<![`\w}])`(?:sp\.)?([A-Za-z]\w+)(?:\(\))?`(?!`)")


@cache
def places(folder: Path) -> dict[str, str]:
    """Functions and classes of the reference by their last name, where this is enough to tell which is meant."""
    names = [
        name
        for page in questions(folder)
        for name, found in page["objects"].items()
        if inspect.isclass(found) or inspect.isroutine(found)
    ]
    last = [name.rpartition(".")[2] for name in names]
    return {short: name for short, name in zip(last, names) if last.count(short) == 1 and short not in _OTHERWISE}


def with_names(text: str, names: dict[str, str]) -> str:
    """A page with these links, but for its blocks of code and its headings."""
    lines, inside = [], False
    for line in text.split("\n"):
        if _FENCE.match(line):
            inside = not inside
        keeps = inside or line.startswith(("#", "    "))
        lines.append(line if keeps else _CODE.sub(lambda found: _link(found, names), line))
    return "\n".join(lines)


def _link(found: re.Match[str], names: dict[str, str]) -> str:
    shown = found[0].strip("`")
    return f"{{py:obj}}`{shown} <{names[found[1]]}>`" if found[1] in names else found[0]
