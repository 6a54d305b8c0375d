"""In pages of text and in docstrings, a name of the library in backticks is a link to its place in the reference."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from .docstrings import outside_examples
from .reference_pages import questions

_FENCE = re.compile(r"^(```|:::)")
# What pages mean otherwise: attributes of a motion, and a folder.
_OTHERWISE = {"angular_velocity", "body_momentum", "rigid_body"}
_NAME = r"(?:sp\.|shapephase\.)?([A-Za-z]\w+(?:\.\w+)*)(?:\(\))?"
_CODE = re.compile(rf"(?<![`\w}}])`{_NAME}`(?!`)")
_MEMBERS = (property, cached_property, classmethod, staticmethod)
# Of reStructuredText: neither a role's text nor a literal.
_BACKTICKS = re.compile(r"(?<![`:>\w])`([^`]+)`(?![`_\w])")
_WHOLE_NAME = re.compile(_NAME)


@cache
def places(folder: Path) -> dict[str, str]:
    """What the reference has, and members of classes, by each name that is enough to tell which is meant."""
    names = {name: found for page in questions(folder) for name, found in page["objects"].items()}
    members = {f"{name}.{member}": None for name, found in names.items() for member in _documented_members(found)}
    endings: dict[str, list[str]] = {}
    for name, least in [*((name, 1) for name in names), *((name, 2) for name in members)]:
        parts = name.split(".")[1:]
        for count in range(least, len(parts) + 1):
            endings.setdefault(".".join(parts[-count:]), []).append(name)
    return {short: full[0] for short, full in endings.items() if len(full) == 1 and short not in _OTHERWISE}


def _documented_members(found: Any) -> Iterator[str]:
    """Methods and properties that are on the page of a class."""
    ours = (
        [base for base in inspect.getmro(found) if base.__module__.startswith("shapephase")]
        if inspect.isclass(found)
        else []
    )
    for member in sorted({name for base in ours for name in vars(base) if not name.startswith("_")}):
        value = inspect.getattr_static(found, member)
        if (inspect.isfunction(value) or isinstance(value, _MEMBERS)) and inspect.getdoc(getattr(found, member)):
            yield member


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


def with_linked_names(text: str, names: dict[str, str], owner: str, own: set[str]) -> str:
    """A docstring in which what stands in single backticks is code, and a link where it is a name of the reference.

    `own` names, parameters and members of what it documents, are not links, nor is its `owner`. A name that several
    faces have is the one of the owner's face.
    """
    parts = owner.split(".")[1:-1]
    faces = [".".join([*parts[:count], ""]) for count in range(len(parts), -1, -1)]

    def code(found: re.Match[str]) -> str:
        name = _WHOLE_NAME.fullmatch(found[1])
        short = name[1] if name and (name[1] not in own or found[1].startswith("shapephase.")) else ""
        target = next((names[face + short] for face in faces if face + short in names), None)
        return f":py:obj:`{found[1]} <{target}>`" if target and target != owner else f"``{found[1]}``"

    return outside_examples(text, lambda part: _BACKTICKS.sub(code, part))
