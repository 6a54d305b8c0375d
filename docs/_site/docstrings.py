"""What this library's docstrings and signatures mean, said in reStructuredText."""

from __future__ import annotations

import re

from sphinx.util.inspect import TypeAliasForwardRef

_LITERAL = re.compile(r"(``.+?``|`[^`]+`)", re.DOTALL)
_ENTRY = re.compile(r"([\w*, ]+) : (.*)")
_WITH_ENTRIES = ("Parameters", "Attributes", "Other Parameters")


def bars_are_norms(text: str) -> str:
    """`|Pi|` is the norm of Pi: to reStructuredText it would be a substitution."""
    parts = _LITERAL.split(text)
    return "".join(part if place % 2 else part.replace("|", "\\|") for place, part in enumerate(parts))


def entries_are_descriptions(text: str) -> str:
    """`motion : of an articulated body` describes the parameter: its type stands in the signature."""
    section, kept, lines = "", [], text.split("\n")
    for line, below in zip(lines, [*lines[1:], ""]):
        if line and below and set(below) == {"-"}:
            section = line
        entry = _ENTRY.match(line)
        kept += [entry[1], f"    {entry[2]}"] if section in _WITH_ENTRIES and entry else [line]
    return "\n".join(kept)


def name_aliases() -> None:
    """In signatures and types of attributes, an alias of a type goes by its name."""
    TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # type: ignore[method-assign]
