"""The coverage table of the site: nothing of the three texts is missing, and what is named exists."""

from __future__ import annotations

import re
import sys
from functools import reduce
from pathlib import Path

import pytest

import shapephase

ROOT = Path(__file__).parents[1]
# Statements of each text that the table has to have at least: its numbered ones, counted in the texts.
NUMBERED = {
    "C": {"remark": 17, "example": 7, "proposition": 2, "lemma": 1},
    "B": {"remark": 6, "definition": 4, "proposition": 9, "lemma": 7},
    "M": {"exercise": 9, "theorem": 5, "proposition": 1, "corollary": 1, "remark": 5},
}
# How many numbered equations each text has, C and B in one sequence and M by section, and the figures of M.
OF_SECTIONS = (10, 13, 6, 1, 6, 8, 15, 12, 16, 21)
EQUATIONS = {"C": {"": 15}, "B": {"": 20}, "M": {f"15.{k}.": n for k, n in enumerate(OF_SECTIONS, start=2)}}
FIGURES = {"15.3.1", "15.5.1", "15.6.1", "15.8.1"}
# What holds a statement is named first in its row.
HOLDS = {
    ("B", "definition 2.5"): "SurfaceOfRevolution.tameness",
    ("B", "lemma 4.2"): "SerretAndoyerMetric.gauss_curvature",
    ("M", "exercise 15.8-1"): "EulerTop.attitude",
    ("M", "(15.10.8) to (15.10.11)"): "second_variation",
    ("M", "theorem 15.10.1"): "sleeping_top",
    ("M", "figure 15.8.1"): "cones",
    ("M", "theorem 15.5.1"): "Poinsot.ellipsoid",
    ("C", "section 4.1.1, cases 1 to 3"): "regime_certificate",
}


@pytest.fixture(scope="module")
def site():
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from _site import coverage
    finally:
        sys.path.pop(0)
    return coverage


def test_every_statement_has_a_function_and_a_test_or_a_reason(site):
    found = site.statements(ROOT)
    held = [one for one in found if one.functions and one.tests]
    assert [one.place for one in found if one not in held and not one.reason] == []
    assert len(found) >= 160
    assert len(held) == len(found) - 1
    for text, kinds in NUMBERED.items():
        places = " ".join(one.place for one in found if one.text == text)
        for kind, count in kinds.items():
            numbers = set(re.findall(rf"{kind} (\d[\d.-]*)", places))
            assert len(numbers) >= count, (text, kind, sorted(numbers))


def test_every_numbered_equation_and_figure_has_a_row(site):
    found = site.statements(ROOT)
    for text, sections in EQUATIONS.items():
        rows = set()
        for one in found:
            # "(10) to (16)" names all between.
            for first, last in re.findall(r"\(([\d.]+)\)(?: to \(([\d.]+)\))?", one.place if one.text == text else ""):
                stem, _, begin = first.rpartition(".")
                rows |= {
                    f"{stem}.{k}".lstrip(".") for k in range(int(begin), int((last or first).rpartition(".")[2]) + 1)
                }
        assert rows == {f"{section}{k + 1}" for section, count in sections.items() for k in range(count)}, text
    places = " ".join(one.place for one in found if one.text == "M")
    assert set(re.findall(r"figure (\d[\d.]*)", places)) == FIGURES


def test_rows_name_first_what_holds_the_statement(site):
    rows = {(one.text, one.place): one for one in site.statements(ROOT)}
    for place, name in HOLDS.items():
        assert rows[place].functions[0].endswith(name), (place, rows[place].functions)


def test_every_code_has_both_or_a_reason_and_is_used(site):
    rows, found = site.coverage(ROOT), site.statements(ROOT)
    reasons = " ".join(code for one in found if one.reason for code in one.codes)
    used = {code for one in found for code in one.codes}
    for code, (_, functions, tests) in rows.items():
        misprint = "-E" in code
        assert ((functions or misprint) and tests) or code in reasons, code
        # U is how files become results, F10 a dive: the texts do not state them.
        assert code in used or code[0] == "U" or code == "F10", code


def test_listed_functions_and_tests_exist(site):
    listed = site._listed(ROOT)
    for code, names in listed["functions"].items():
        for name in names:
            assert reduce(getattr, name.split("."), shapephase) is not None, (code, name)
    for code, names in listed["tests"].items():
        for name in names:
            file, _, test = name.partition(": ")
            source = (ROOT / "tests" / file).read_text(encoding="utf-8")
            assert re.search(rf"^def {test}\(", source, re.MULTILINE), (code, name)
