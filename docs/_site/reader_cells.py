"""A notebook's asserts hold its numbers when it is executed; a reader sees the code without them."""

from __future__ import annotations

import ast

from docutils import nodes
from sphinx.application import Sphinx


def without_asserts(code: str) -> str:
    """The code without its assert statements; code that is not plain Python stays as it is."""
    try:
        tree = ast.parse(code)
    except SyntaxError:
        return code
    lines: list[str | None] = list(code.splitlines())
    for statement in ast.walk(tree):
        if isinstance(statement, ast.Assert) and statement.end_lineno:
            lines[statement.lineno - 1 : statement.end_lineno] = [None] * (statement.end_lineno - statement.lineno + 1)
    return "\n".join(line for line in lines if line is not None)


def hide_asserts(app: Sphinx, doctree: nodes.document) -> None:
    """Only in the tutorials that are made of notebooks."""
    if not app.env.docname.startswith("tutorials/notebooks/"):
        return
    for block in list(doctree.findall(nodes.literal_block)):
        if "cell_input" in block.parent.get("classes", []):
            shown = without_asserts(block.astext())
            block.rawsource = shown
            block.children = []
            block += nodes.Text(shown)
