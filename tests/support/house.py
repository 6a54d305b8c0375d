"""Counts of the source by room, held below the ceilings of house.toml; `--lower` writes the present counts there.

Lines, numeric literals, sentences that begin with words that CONTRIBUTING rules out, modules under 60 lines
and import circles, lazy imports included.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator
from importlib.util import resolve_name
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "shapephase"
CEILINGS = Path(__file__).with_name("house.toml")
SHORT = 60  # lines: a module below is worth a look
ORDINARY = {0, 1, 2, 3, 4, -1, 0.5}  # counts, signs, axes and halves explain themselves
BEGINNING = re.compile(r"(?:^|(?<=[.:] ))(Of|As|The same)\b(?! (?:a consequence|always|far as|long as|soon as)\b)")


def room_of(path: Path) -> str:
    """First folder below the package, or "top" for its own modules."""
    parts = path.relative_to(SOURCE).parts
    return parts[0] if len(parts) > 1 else "top"


def prose(text: str, tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Docstrings, strings that stand alone and comments, with their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            for offset, line in enumerate(node.value.value.splitlines()):
                yield node.lineno + offset, line.strip()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string.lstrip("# ")


def stiff_sentences(path: Path) -> list[str]:
    """Places where a sentence begins with Of, As or The same."""
    text = path.read_text(encoding="utf-8")
    places, ended = [], True
    for number, line in prose(text, ast.parse(text)):
        for match in BEGINNING.finditer(line):
            if match.start() > 0 or ended or line[:1].isupper():
                places.append(f"{path.relative_to(ROOT)}:{number}: {line[:80]}")
        ended = line.endswith((".", ":", "")) and not line.endswith(",")
    return places


def literals(tree: ast.Module) -> int:
    """Numbers other than the ordinary ones, in module constants and functions."""
    return sum(
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
        and node.value not in ORDINARY
        for node in ast.walk(tree)
    )


def circles() -> list[list[str]]:
    """Groups of modules that import one another, by imports at any depth of their code."""
    files = {f"shapephase.{'.'.join(p.relative_to(SOURCE).with_suffix('').parts)}": p for p in SOURCE.rglob("*.py")}
    files = {name.removesuffix(".__init__"): path for name, path in files.items()}
    edges: dict[str, set[str]] = {name: set() for name in files}
    for name, path in files.items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        typing_only = set()
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
                typing_only |= {id(inner) for statement in node.body for inner in ast.walk(statement)}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and id(node) not in typing_only and (node.level or node.module):
                module = resolve_name("." * node.level + (node.module or ""), package) if node.level else node.module
                for alias in node.names:
                    target = f"{module}.{alias.name}" if f"{module}.{alias.name}" in files else module
                    # A face imports nothing: its names are loaded when they are used.
                    if target in files and files[target].name != "__init__.py":
                        edges[name].add(target)
    return components(edges)


def components(edges: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected groups of more than one node (Tarjan 1972)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    groups = []

    def visit(node: str) -> None:
        order[node] = low[node] = len(order)
        stack.append(node)
        for target in edges[node]:
            if target not in order:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], order[target])
        if low[node] == order[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                groups.append(sorted(group))

    sys.setrecursionlimit(10_000)
    for node in edges:
        if node not in order:
            visit(node)
    return groups


def counts() -> dict[str, dict[str, int]]:
    """All counts, by kind and room."""
    lines: Counter[str] = Counter()
    numbers: Counter[str] = Counter()
    stiff: Counter[str] = Counter()
    short = 0
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        room = room_of(path)
        lines[room] += text.count("\n")
        numbers[room] += literals(ast.parse(text))
        stiff[room] += len(stiff_sentences(path))
        short += text.count("\n") < SHORT and path.name != "__init__.py"
    tests = sum(path.read_text(encoding="utf-8").count("\n") for path in (ROOT / "tests").rglob("*.py"))
    whole = {
        "lines of src": lines.total(),
        "lines of tests": tests,
        f"modules under {SHORT} lines": short,
        "modules in circles": sum(map(len, circles())),
    }
    rooms = {"lines": lines, "literals": numbers, "stiff sentences": stiff}
    return {"whole": whole, **{kind: dict(sorted(found.items())) for kind, found in rooms.items()}}


def rounded(name: str, kind: str, number: int) -> int:
    """Lines rounded up to hundreds, so that a small addition needs no new ceilings; other counts as they are."""
    return -(-number // 100) * 100 if "lines" in (name.split()[0], kind) else number


def main() -> int:
    """Compare with the ceilings; 1 where a count is above its own."""
    now = counts()
    if "--lower" in sys.argv:
        tables = [
            "\n".join(
                [f'["{kind}"]', *(f'"{name}" = {rounded(name, kind, number)}' for name, number in numbers.items())]
            )
            for kind, numbers in now.items()
        ]
        CEILINGS.write_text("\n\n".join(tables) + "\n", encoding="utf-8")
        return 0
    if len(sys.argv) > 1:
        for path in sorted((SOURCE / sys.argv[1]).rglob("*.py") if sys.argv[1] != "top" else SOURCE.glob("*.py")):
            print("\n".join(stiff_sentences(path)), end="\n" if stiff_sentences(path) else "")
        print({kind: numbers.get(sys.argv[1]) for kind, numbers in now.items() if kind != "whole"})
        return 0
    ceilings = tomllib.loads(CEILINGS.read_text(encoding="utf-8"))
    above = [
        f"{kind}, {name}: {number}, the ceiling is {ceilings[kind].get(name, 0)}"
        for kind, numbers in now.items()
        for name, number in numbers.items()
        if number > ceilings[kind].get(name, 0)
    ]
    above += [f"circle: {', '.join(group)}" for group in circles()] if any("circles" in line for line in above) else []
    print("\n".join(above) or "The house is within its ceilings.")
    return bool(above)


if __name__ == "__main__":
    sys.exit(main())
