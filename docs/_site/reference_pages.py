"""The pages of the reference, one for each question, written from reference/questions.toml."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
import tomllib
import types
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any


def exported(face: str) -> Iterator[tuple[str, Any]]:
    """Names of a face and what they are, without the folders and modules among them."""
    module = importlib.import_module(face)
    names = getattr(module, "__all__", None) or [
        name for name, found in vars(module).items() if getattr(found, "__module__", None) == face
    ]
    for name in names:
        found = getattr(module, name)
        if not (name.startswith("_") or isinstance(found, types.ModuleType)):
            yield f"{face}.{name}", found


def questions(folder: Path) -> list[dict[str, Any]]:
    """Each page with the names on it: those listed, then what else its faces export, each name on one page only."""
    pages = tomllib.loads((folder / "questions.toml").read_text(encoding="utf-8"))["page"]
    placed: set[int] = set()
    for page in pages:
        page["objects"] = {name: _found(name) for name in page.get("names", ())}
        placed |= {id(found) for found in page["objects"].values()}
    for page in pages:
        for face in page.get("faces", ()):
            for name, found in sorted(exported(face), key=lambda entry: _line(entry[1])):
                if id(found) not in placed:
                    placed.add(id(found))
                    page["objects"][name] = found
    return pages


def _found(name: str) -> Any:
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def _line(found: Any) -> tuple[str, int]:
    """Where something is defined, so that a page has its names in the order of the source."""
    file = getattr(sys.modules.get(getattr(found, "__module__", "")), "__file__", None)
    return (file, _definitions(file).get(found.__name__, 0)) if file and hasattr(found, "__name__") else ("", 0)


@cache
def _definitions(file: str) -> dict[str, int]:
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    return {node.name: node.lineno for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}


def constant_documentation(name: str) -> list[str]:
    """What stands below the definition of a constant in another module than that of its name, where autodoc looks."""
    face, _, short = name.rpartition(".")
    for key, module in sorted(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if key.startswith(f"{face}.") and file and hasattr(module, short):
            for node, below in pairwise(ast.parse(Path(file).read_text(encoding="utf-8")).body):
                if short in _assigned(node) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                    return inspect.cleandoc(str(below.value.value)).split("\n")
    return []


def _assigned(node: ast.stmt) -> list[str]:
    targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
    return [target.id for target in targets if isinstance(target, ast.Name)]


def _directive(found: Any) -> str:
    if inspect.isclass(found):
        return "autoexception" if issubclass(found, BaseException) else "autoclass"
    return "autofunction" if inspect.isroutine(found) else "autodata"


def write_reference(folder: Path) -> None:
    """Write the pages, those that changed only, so that a second build has less to do."""
    for page in questions(folder):
        title = page["title"]
        parts = [title, "=" * len(title), "", page["question"], ""]
        parts += [".. autosummary::", "   :nosignatures:", ""]
        parts += [f"   ~{name}" for name in page["objects"]]
        for name, found in page["objects"].items():
            short = name.removeprefix("shapephase.")
            parts += ["", short, "-" * len(short), "", f".. {_directive(found)}:: {name}"]
            if _directive(found) == "autodata":
                parts += ["   :no-value:"]
        text = "\n".join(parts) + "\n"
        file = folder / f"{page['file']}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
