"""Docstrings cite the equations of the theory by their labels; here the pages say which docstrings those are."""

from __future__ import annotations

import inspect
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from .reference_pages import questions

_LABEL = re.compile(r"^\$\$ \(([\w-]+)\)$", re.MULTILINE)
_CITED = re.compile(r":eq:`([\w-]+)`")


def _documented(name: str, found: Any) -> Iterator[tuple[str, str]]:
    """Names and docstrings of what the reference has at a name: itself, and the members of a class."""
    yield name, inspect.getdoc(found) or ""
    if inspect.isclass(found):
        for member, value in vars(found).items():
            text = getattr(value, "__doc__", None)
            if not member.startswith("_") and isinstance(text, str):
                yield f"{name}.{member}", text


@cache
def citing(folder: Path) -> dict[str, list[str]]:
    """For each label the names whose docstrings cite it, of those in the reference."""
    names: dict[str, list[str]] = defaultdict(list)
    for page in questions(folder):
        for name, found in page["objects"].items():
            for place, text in _documented(name, found):
                for label in _CITED.findall(text):
                    names[label].append(place)
    return names


def with_citations(text: str, names: dict[str, list[str]]) -> str:
    """A page that ends with the table of its equations and of what computes them."""
    rows = []
    for label in _LABEL.findall(text):
        links = ", ".join(f"{{py:obj}}`{_short(name)} <{name}>`" for name in names.get(label, ()))
        rows += [f"| {{eq}}`{label}` | {links} |"] if links else []
    if not rows:
        return text
    return "\n".join([text.rstrip(), "", "## In the code", "", "| equation | function |", "|---|---|", *rows, ""])


def _short(name: str) -> str:
    """A name as it is written in code: a method with its class."""
    parts = name.split(".")
    return ".".join(parts[-2:] if parts[-2][:1].isupper() else parts[-1:])
