"""Codes of the theory (`theory.md B6`, `numerics.md section 4`) become links, in pages and in docstrings."""

from __future__ import annotations

import re

CODE = r"(?:[CBM]-E\d+|[A-U]\d+[a-z]?)"
_ENTRY = re.compile(rf"^- \*\*({CODE})\*\*", re.MULTILINE)
_SECTION = re.compile(r"^## (\d+)\. ", re.MULTILINE)
_CITATION = re.compile(
    r"\b(theory|numerics)\.md"
    rf"((?:[ ,;:()-]|\n|and\b|to\b|its\b|errata\b|sections?\b|\d+\b|{CODE}\b|[A-U]\b)*)"
)
_PAGE = re.compile(r"\bdocs/(\w+/\w+)\.md")
_SECTIONS_CITED = re.compile(r"(sections?\s+)(\d+(?:(?:,| and)\s+\d+)*)")


def with_targets(page: str, text: str) -> str:
    """The text of a page in which each numbered section and each entry of the catalogue can be linked to."""
    text = _SECTION.sub(rf"(section-{page}-\1)=\n## \1. ", text)
    return _ENTRY.sub(lambda found: f"- [**{found[1]}**]{{#code-{found[1].lower()}}}", text)


def with_links(text: str) -> str:
    """A docstring in which what it cites of the theory, and of the other pages, is a link."""
    return _CITATION.sub(_linked, _PAGE.sub(r":doc:`/\1`", text))


def _linked(found: re.Match[str]) -> str:
    page = found[1]

    def section(number: re.Match[str]) -> str:
        return f":ref:`{number[0]} <section-{page}-{number[0]}>`"

    rest = re.sub(rf"(?<![\w-])({CODE})(?!\w)", lambda code: f":ref:`{code[1]} <code-{code[1].lower()}>`", found[2])
    rest = _SECTIONS_CITED.sub(lambda part: part[1] + re.sub(r"\d+", section, part[2]), rest)
    return f":doc:`{page} </{page}>`{rest}"
