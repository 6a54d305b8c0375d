"""Which functions and tests belong to each code of the theory, as tables made from docstrings and tests."""

from __future__ import annotations

import ast
import re
import tomllib
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from .code_links import CODE
from .name_links import places, with_names

_ENTRY = re.compile(rf"^- \*\*({CODE})\*\* (.*(?:\n  .*)*)", re.MULTILINE)
_CITED = re.compile(rf"theory\.md((?:[ ,;:(-]|\n|and\b|to\b|errata\b|{CODE}\b)*)")
_MOST = 4
"""Of tests and functions a row names so many, and counts the rest."""


def _codes(text: str) -> set[str]:
    """What a docstring cites of the theory; `E6 to E9` are all of them."""
    found: set[str] = set()
    for citation in _CITED.findall(text):
        found |= set(re.findall(CODE, citation))
        for first, last in re.findall(r"([A-U]\d+) to ([A-U]\d+)", citation):
            if first[0] == last[0]:
                found |= {f"{first[0]}{number}" for number in range(int(first[1:]), int(last[1:]) + 1)}
    return found


def _definitions(file: Path) -> list[tuple[str, str]]:
    source = file.read_text(encoding="utf-8")
    if "theory.md" not in source:
        return [(name, "") for name in re.findall(r"^ *def (\w+)", source, re.MULTILINE)]
    tree = ast.parse(source)
    kinds = (ast.FunctionDef, ast.ClassDef)
    return [(node.name, ast.get_docstring(node) or "") for node in ast.walk(tree) if isinstance(node, kinds)]


@cache
def coverage(root: Path) -> dict[str, tuple[str, list[str], list[str]]]:
    """Each code with its entry, the functions that cite it, and the tests named after it or citing it."""
    entries = dict(_ENTRY.findall((root / "docs" / "theory.md").read_text(encoding="utf-8")))
    functions, tests = defaultdict(list), defaultdict(list)
    for file in sorted((root / "src").rglob("*.py")):
        for name, text in _definitions(file):
            for code in _codes(text):
                if not name.startswith("_"):
                    functions[code].append(name)
    lower = {code.lower().replace("-", "_"): code for code in entries}
    for file in sorted((root / "tests").rglob("test_*.py")):
        for name, text in _definitions(file):
            if name.startswith("test_"):
                ending = re.search(r"(?:_(?:[cbm]_e|[a-u])\d+[a-z]?)+$", name)
                named = re.findall(r"_((?:[cbm]_e|[a-u])\d+[a-z]?)", ending[0]) if ending else []
                codes = {lower.get(one) or lower.get(one.rstrip("abc")) for one in named} - {None}
                for one in _codes(text) | codes:
                    tests[one].append(f"{file.relative_to(root / 'tests')}: {name}")
    more = _listed(root)
    # Listed names come first: a docstring may cite a code that its function only uses.
    for found, table in ((functions, "functions"), (tests, "tests")):
        for code, names in more[table].items():
            short = {name.rpartition(".")[2] for name in names}
            found[code] = [*names, *(name for name in found[code] if name not in short)]
    return {code: (text, functions[code], tests[code]) for code, text in entries.items()}


@dataclass(frozen=True)
class Statement:
    """What one of the texts says at a place, and what of the library holds it."""

    text: str
    place: str
    says: str
    codes: tuple[str, ...]
    functions: tuple[str, ...]
    tests: tuple[str, ...]
    reason: str


def statements(root: Path) -> list[Statement]:
    """Every statement of the three texts, with the functions and tests of its codes, or why there are none."""
    rows, listed = coverage(root), _listed(root)
    found = []
    for text, place, says, codes, *reason in listed["statements"]:
        its = tuple(codes.split())
        parts = [tuple(dict.fromkeys(name for code in its for name in rows[code][k])) for k in (1, 2)]
        why = "; ".join([*reason, *(listed["reasons"][code] for code in its if code in listed["reasons"])])
        found.append(Statement(text, place, says, its, *parts, why))
    return found


def _listed(root: Path) -> dict[str, Any]:
    return tomllib.loads((root / "docs" / "theory" / "statements.toml").read_text(encoding="utf-8"))


def _some(names: list[str]) -> str:
    unique = list(dict.fromkeys(names))
    shown = "<br>".join(f"`{name}`" for name in unique[:_MOST])
    return shown + (f"<br>and {len(unique) - _MOST} more" if len(unique) > _MOST else "")


def write_tables(root: Path) -> None:
    """Misprints with their tests, and the catalogue with functions and tests."""
    rows = coverage(root)
    folder = root / "docs" / "theory" / "tables"
    folder.mkdir(exist_ok=True)
    for name, misprint in (("misprints", True), ("coverage", False)):
        lines = [
            "| code | misprint, and what holds | tests |" if misprint else "| code | functions | tests |",
            "|---|---|---|",
        ]
        for code, (text, functions, tests) in rows.items():
            if ("-E" in code) == misprint:
                middle = re.sub(r"\s*\n\s*", " ", text).replace("|", "\\|") if misprint else _some(functions)
                lines.append(f"| {_link(code)} | {middle} | {_some(tests)} |")
        _write(folder / f"{name}.inc", lines, root)
    lines = ["| place | what it says | codes | functions | tests |", "|---|---|---|---|---|"]
    for one in statements(root):
        codes = " ".join(map(_link, one.codes))
        held = [_some(list(one.functions)) or one.reason, _some(list(one.tests)) or one.reason]
        lines.append(
            f"| {one.text} {one.place} | {one.says.replace('|', chr(92) + '|')} | {codes} | {held[0]} | {held[1]} |"
        )
    _write(folder / "statements.inc", lines, root)


def _link(code: str) -> str:
    return f"[{code}](../theory.md#code-{code.lower()}){{.text-nowrap}}"


def _write(file: Path, lines: list[str], root: Path) -> None:
    """Write a table whose functions are links, if it changed."""
    text = with_names("\n".join(lines) + "\n", places(root / "docs" / "reference"))
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")
