"""The table of moved names in CHANGELOG.md: `python tests/support/moved_names.py REVISION [RENAMES]` prints it.

Public functions, classes, methods, fields and parameters of a revision are looked for in today's sources. What kept its
name is found where it is now, in the face of its room if that shows it; what was renamed stands in the table already,
or in RENAMES, lines of an old and a new dotted name with a tab between. Names that are nowhere go to standard error.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tarfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| `(shapephase[\w.]+(?:\(\w+\))?)` \| `(shapephase[\w.]+(?:\(\w+\))?)` \|$", re.MULTILINE)


@dataclass(frozen=True)
class Definition:
    """A public function or class: what it takes or holds, and its methods with what they take."""

    names: tuple[str, ...]
    methods: dict[str, tuple[str, ...]] = field(default_factory=dict)


def rows_of_changelog() -> list[tuple[str, str]]:
    """Old and new names of the table."""
    return ROW.findall((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))


def sources_at(revision: str) -> dict[str, str]:
    """Dotted module names and their text at a revision."""
    packed = subprocess.run(
        ["git", "archive", revision, "src/shapephase"], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        files = {member.name: archive.extractfile(member) for member in archive if member.name.endswith(".py")}
        return {_module(PurePosixPath(name)): file.read().decode() for name, file in files.items() if file}


def sources_today() -> dict[str, str]:
    """The same of the working tree."""
    paths = (ROOT / "src").rglob("*.py")
    return {_module(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}


def definitions(sources: dict[str, str]) -> dict[tuple[str, str], Definition]:
    """Public functions and classes by module and name."""
    found = {}
    for module, text in sources.items():
        for node in ast.parse(text).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                found[module, node.name] = Definition(_parameters(node))
            elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                fields = (part.target.id for part in node.body if isinstance(part, ast.AnnAssign))
                methods = {
                    part.name: _parameters(part)
                    for part in node.body
                    if isinstance(part, ast.FunctionDef) and (part.name == "__init__" or not part.name.startswith("_"))
                }
                found[module, node.name] = Definition(tuple(n for n in fields if not n.startswith("_")), methods)
    return found


def shown_in() -> dict[tuple[str, str], str]:
    """The room whose face shows a definition, by module and name."""
    found = {}
    for stub in sorted((ROOT / "src").rglob("__init__.pyi"), reverse=True):
        room = _module(stub.relative_to(ROOT))
        for node in ast.parse(stub.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.module and room != "shapephase":
                found.update({(f"{room}.{node.module}", name.name): room for name in node.names})
    return found


def moved(revision: str, renames: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Old and new names of all that moved or changed its name; the new one is empty where there is none."""
    new, faces, by_name = definitions(sources_today()), shown_in(), defaultdict(list)
    for module, name in new:
        by_name[name].append(module)
    for (module, name), old in definitions(sources_at(revision)).items():
        before = f"{module}.{name}"
        renamed = renames.get(before, before)
        name_now = renamed.rsplit(".", 1)[1]
        modules = by_name[name_now]
        if not modules:
            yield before, "" if renamed == before else renamed
            continue
        stem = module.rsplit(".", 1)[1]
        now = next((m for m in modules if m == renamed.rsplit(".", 1)[0]), None) or next(
            (m for m in modules if m.rsplit(".", 1)[1].strip("_") == stem), modules[0]
        )
        after = f"{faces.get((now, name_now), now)}.{name_now}"
        if after != before:
            yield before, after
        today = new[now, name_now]
        is_function = not old.methods and not today.methods and name[0].islower()
        inside = [(n, f"({n})" if is_function else f".{n}") for n in old.names if n not in today.names]
        for method, parameters in old.methods.items():
            if method not in today.methods:
                inside.append((method, f".{method}"))
            else:
                inside += [(p, f".{method}({p})") for p in parameters if p not in today.methods[method]]
        for part, suffix in inside:
            if part not in today.methods and part not in today.names:
                yield before + suffix, renames.get(before + suffix, "")


def main() -> None:
    """Print the table."""
    revision, *files = sys.argv[1:]
    renames = dict(rows_of_changelog())
    for file in files:
        lines = Path(file).read_text(encoding="utf-8").splitlines()
        renames.update(tuple(line.split("\t")[:2]) for line in lines if "\t" in line)
    print("| was | is |\n|---|---|")
    for old, new in sorted(moved(revision, renames)):
        print(f"| `{old}` | `{new}` |" if new else f"no longer there: {old}", file=sys.stdout if new else sys.stderr)


def _parameters(node: ast.FunctionDef) -> tuple[str, ...]:
    arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
    return tuple(a.arg for a in arguments if a.arg not in ("self", "cls") and not a.arg.startswith("_"))


def _module(path: PurePosixPath | Path) -> str:
    parts = path.with_suffix("").parts[1:]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


if __name__ == "__main__":
    main()
