"""Committed notebooks: outputs without what differs from run to run, light, and compared by the digits that they show.

The build of the site executes them; here is what can be checked without that, and the comparison itself.
"""

from __future__ import annotations

import ast
import importlib
import json
import sys
from copy import deepcopy

import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from support.places import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def step():
    """The step of the site's build that executes and compares."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        return importlib.import_module("_site.executed_notebooks")
    finally:
        sys.path.remove(str(ROOT / "docs"))


def contents(path):
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_committed_light_and_free_of_what_changes(path, step):
    notebook = step.read(path)
    assert list(step.faults(notebook)) == []
    assert step.cleaned(deepcopy(notebook)) == notebook
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_holds_stands_in_cells_that_readers_do_not_see(path):
    for cell in contents(path)["cells"]:
        if cell["cell_type"] == "code":
            held = any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse("".join(cell["source"]))))
            assert held == ("remove-cell" in cell["metadata"].get("tags", ())), "".join(cell["source"])[:80]


def test_the_quick_start_has_a_figure_and_a_page_in_three_dimensions():
    outputs = [output for cell in contents(NOTEBOOKS[0])["cells"] for output in cell.get("outputs", ())]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 3
    assert any("<iframe" in "".join(output.get("data", {}).get("text/html", "")) for output in outputs)


@pytest.mark.parametrize(
    ("before", "after", "same"),
    [
        ("12.345678", "12.345679", True),
        ("12.345678", "12.345681", False),
        ("179.999999", "180.000000", True),
        ("0.47619047619047616", "0.47619047623", True),
        ("0.47619047619047616", "0.4761910", False),
        ("1.3e-11", "0.0e+00", True),
        ("1.3e-11", "2.0e-05", False),
        ("1.2e-05", "1.3e-05", True),
        ("1.2e-05", "1.5e-05", False),
        ("-0.0000", "0.0000", True),
        ("−3.25", "-3.25", True),
        ("3.25", "-3.25", False),
        ("186", "186", True),
        ("186", "187", False),
    ],
)
def test_numbers_agree_by_the_digits_shown(step, before, after, same):
    assert step.agree(before, after) is same
    assert step.agree(after, before) is same


def made(*texts):
    """A notebook of one cell, which prints each text."""
    return new_notebook(cells=[new_code_cell(outputs=[new_output("stream", text=text) for text in texts])])


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ("turned by 180.000 degrees", "turned  by 179.9995 degrees", 0),
        ("turned by 180.000 degrees", "turned by 181.000 degrees", 1),
        ("turned by 180.000 degrees", "turned by 180.000 radians", 1),
        ("[1.0, 2.0]", "[1.0, 2.0, 3.0]", 1),
    ],
)
def test_words_and_numbers_of_outputs_are_compared(step, before, after, found):
    assert len(list(step.disagreements(made(before), made(after)))) == found


def test_an_output_more_or_a_cell_more_is_a_difference(step):
    one, two = made("1.0"), made("1.0", "2.0")
    assert list(step.disagreements(one, one)) == []
    assert len(list(step.disagreements(one, two))) == 1
    assert list(step.disagreements(one, new_notebook(cells=[new_code_cell(), new_code_cell()]))) == ["other cells"]
