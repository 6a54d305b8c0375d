"""Committed notebooks: outputs without what differs from run to run, light, and compared by the digits that they show.

The build of the site executes them; here is what can be checked without that, and the comparison itself.
"""

from __future__ import annotations

import ast
import importlib
import json
import os
import re
import subprocess
import sys
import tomllib
from copy import deepcopy

import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from support.places import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
REPOSITORY = PROJECT["urls"]["Repository"]
BINDER = re.findall(r"[a-z]+", (ROOT / "binder" / "requirements.txt").read_text("utf-8"))


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


def named(cells):
    """The extras that the first cell says to install."""
    return re.findall(r"pip install '\.\[([a-z,]+)\]'", "".join(cells[0]["source"]))[0]


def installs(cell):
    """True for the cell that installs the library on a machine of Colab."""
    return "colab" in cell["metadata"].get("tags", ())


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_committed_light_and_free_of_what_changes(path, step):
    notebook = step.read(path)
    assert list(step.faults(notebook)) == []
    assert step.cleaned(deepcopy(notebook)) == notebook
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code" and not installs(cell)]
    assert counts == list(range(1, len(counts) + 1))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_holds_stands_in_cells_that_readers_do_not_see(path):
    for cell in contents(path)["cells"]:
        if cell["cell_type"] == "code" and not installs(cell):
            held = any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse("".join(cell["source"]))))
            assert held == ("remove-cell" in cell["metadata"].get("tags", ())), "".join(cell["source"])[:80]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_says_what_to_install_shows_a_picture_at_once_and_where_to_go_on(path):
    cells = contents(path)["cells"]
    (first, *_) = (cell for cell in cells if cell["cell_type"] == "code" and not installs(cell))
    shown = {kind for output in first["outputs"] for kind in output.get("data", {})}
    assert shown & {"image/png", "text/html"}
    assert cells.index(first) <= 2
    assert re.search(r"(Next|What next):.*\]\(", "".join(cells[-1]["source"]))
    assert set(named(cells).split(",")) <= set(BINDER)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_on_colab_a_notebook_installs_the_extras_that_it_names_from_the_repository(path):
    cells = contents(path)["cells"]
    source = "".join(cells[1]["source"])
    assert installs(cells[1])
    assert f"shapephase[{named(cells)}] @ git+{REPOSITORY}" in source
    compile(source, path.name, "exec")


def test_notebooks_are_ten_at_most_and_begin_with_files_that_ship():
    assert len(NOTEBOOKS) <= 10
    assert [path.name[:2] for path in NOTEBOOKS] == [f"{k + 1:02}" for k in range(len(NOTEBOOKS))]
    for path in NOTEBOOKS:
        code = "".join("".join(cell["source"]) for cell in contents(path)["cells"] if cell["cell_type"] == "code")
        assert "robots_folder()" in code or 'load_body("' in code or "Study(" in code, path.name


def test_a_machine_of_binder_installs_what_the_notebooks_need():
    assert set(BINDER) <= set(PROJECT["optional-dependencies"])
    subprocess.run(["bash", "-n", ROOT / "binder" / "postBuild"], check=True)
    assert os.access(ROOT / "binder" / "postBuild", os.X_OK)
    version = (ROOT / "binder" / "runtime.txt").read_text("utf-8")
    least, own = (int(re.findall(r"3\.(\d+)", text)[0]) for text in (PROJECT["requires-python"], version))
    assert own >= least


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
