"""The documentation site, as far as it can be checked without building it: names, equations, ways, and examples."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
import sys
import types
from collections import Counter
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from support.places import ROOT

DOCS = ROOT / "docs"
STUBS = sorted((ROOT / "src" / "shapephase").rglob("__init__.pyi"))
MODULES = ("elliptic", "errors", "inertia_tensor", "so3", "sphere")
FACES = [".".join(stub.parent.relative_to(ROOT / "src").parts) for stub in STUBS] + [f"shapephase.{m}" for m in MODULES]
MOST_LINES = 8
# Examples that take a second, or half a minute where machine code has to be compiled.
LONG = (
    "shapephase.compile_steps",
    "shapephase.examples.closed_orbit",
    "shapephase.optimal_control.Plan",
    "shapephase.plan_reorientation",
    "shapephase.plotting.write_report",
)
PAGES = sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)


@pytest.fixture(scope="module")
def reference() -> types.ModuleType:
    """The step of the site's build that writes the reference."""
    sys.path.insert(0, str(DOCS))
    try:
        return importlib.import_module("_site.reference_pages")
    finally:
        sys.path.remove(str(DOCS))


def exported() -> dict[str, Any]:
    """Functions and classes of all faces, each once, by its shortest name."""
    found: dict[int, tuple[str, Any]] = {}
    for face in sorted(FACES, key=lambda name: (name.count("."), name)):
        module = importlib.import_module(face)
        names = getattr(module, "__all__", None) or [
            name for name, thing in vars(module).items() if getattr(thing, "__module__", None) == face
        ]
        for name in names:
            thing = getattr(module, name)
            if (inspect.isclass(thing) or inspect.isroutine(thing)) and not name.startswith("_"):
                found.setdefault(id(thing), (f"{face}.{name}", thing))
    return dict(found.values())


NAMES = exported()


def test_every_exported_name_stands_on_one_page_of_the_reference(reference):
    placed = Counter(
        id(thing) for page in reference.questions(DOCS / "reference") for thing in page["objects"].values()
    )
    assert not [name for name, thing in NAMES.items() if placed[id(thing)] != 1]
    listed = re.findall(r"^\w+$", (DOCS / "reference" / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == [page["file"] for page in reference.questions(DOCS / "reference")]


def test_equations_have_one_label_each_and_all_that_are_cited_exist():
    texts = {page: page.read_text(encoding="utf-8") for page in PAGES}
    labels = Counter(
        label for text in texts.values() for label in re.findall(r"^\$\$ \(([\w-]+)\)$", text, re.MULTILINE)
    )
    assert len(labels) > 40
    assert set(labels.values()) == {1}
    cited = {label for text in texts.values() for label in re.findall(r"\{eq\}`([\w-]+)`", text)}
    sources = [file.read_text(encoding="utf-8") for file in (ROOT / "src").rglob("*.py")]
    cited |= {label for text in sources for label in re.findall(r":eq:`([\w-]+)`", text)}
    assert cited <= set(labels)


def test_the_front_page_has_three_ways_whose_steps_lead_on():
    """Each step is a link on the page that the step before leads to, or to a page further on in its contents."""
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    ways = re.findall(r"^\*\*You .*?(?=\n\n)", text, re.MULTILINE | re.DOTALL)
    assert len(ways) == 3
    for way in ways:
        assert all(f"({step})" in way for step in (1, 2, 3))
        for target in re.findall(r"\]\(([\w./-]+)\)", way):
            made = "notebooks/" in target or target.endswith(".rst")
            assert made or (DOCS / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_links_between_pages_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([\w./-]+\.md)(?:#[\w-]+)?\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).resolve().exists(), target


def examples(thing: Any) -> list[doctest.Example]:
    return doctest.DocTestParser().get_examples(inspect.getdoc(thing) or "")


def ran(name: str, thing: Any) -> None:
    """The steps of an example, of which at least one prints."""
    steps = examples(thing)
    assert sum(len(step.source.splitlines()) for step in steps) <= MOST_LINES, name
    assert any(step.want for step in steps), name
    said: list[str] = []
    test = doctest.DocTest(steps, {"np": np, "sp": sp}, name, None, None, None)
    assert doctest.DocTestRunner(verbose=False).run(test, out=said.append).failed == 0, "".join(said)


@pytest.mark.parametrize("face", FACES)
def test_examples_in_docstrings_print_what_they_say(face, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name, thing in NAMES.items():
        if name.rpartition(".")[0] == face and name not in LONG and examples(thing):
            ran(name, thing)


@pytest.mark.full
@pytest.mark.parametrize("name", LONG)
def test_long_examples_print_what_they_say(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    ran(name, NAMES[name])


def test_every_exported_function_and_class_has_an_example():
    assert len(NAMES) > 490
    assert not [name for name, thing in NAMES.items() if not examples(thing)]
