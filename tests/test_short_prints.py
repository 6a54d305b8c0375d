"""Every public object prints itself in a few lines: all that the examples of the documentation make are looked at."""

from __future__ import annotations

import doctest
import importlib
import inspect
import warnings
from typing import Any
from xml.etree import ElementTree

import pytest

import shapephase as sp
from support.long_runs import full_but
from test_documentation import LONG, NAMES, examples

FEWER_LINES = 10
FEWER_LETTERS = 1000
EVERY = [name for name in NAMES if name not in LONG]
QUICK = ("shapephase.articulated", "shapephase.split", "shapephase.EulerTop", "shapephase.FixedPoints",
         "shapephase.BodyFamily", "shapephase.uncertainty", "shapephase.OrbitBranch", "shapephase.path_summary",
         "shapephase.rigid_body.lie.LieAlgebra", "shapephase.bounds.bounds",
         "shapephase.optimal_control.Search")  # fmt: skip


def made_by(name: str) -> list[Any]:
    """The objects of ours that an example makes, with all that their attributes show."""
    made: list[Any] = []
    globs: dict[str, Any] = {"np": importlib.import_module("numpy"), "sp": sp}
    test = doctest.DocTest(examples(NAMES[name]), globs, name, None, None, None)
    doctest.DocTestRunner(verbose=False).run(test, out=lambda _: None, clear_globs=False)
    seen: set[int] = set()

    def add(thing: Any, depth: int = 0) -> None:
        if id(thing) in seen or depth > 4:
            return
        seen.add(id(thing))
        if isinstance(thing, tuple | list):
            for one in thing[:20]:
                add(one, depth + 1)
        elif type(thing).__module__.startswith("shapephase") and not isinstance(thing, type):
            # What a motion is inside of it is for its own methods.
            if type(thing).__module__.startswith("shapephase.integrator"):
                return
            made.append(thing)
            for attribute, value in (vars(thing) if hasattr(thing, "__dict__") else {}).items():
                if not attribute.startswith("_"):
                    add(value, depth + 1)

    for thing in test.globs.values():
        add(thing)
    return made


def long_prints(name: str) -> list[str]:
    """What is too long, or no card that can be shown."""
    found = []
    for thing in made_by(name):
        kind, text = type(thing), repr(thing)
        if len(text) >= FEWER_LETTERS or len(text.splitlines()) >= FEWER_LINES:
            found.append(f"{kind.__qualname__}: {len(text.splitlines())} lines, {len(text)} letters")
        if hasattr(thing, "_repr_html_") and kind.__name__ != "Page":  # which shows itself, in a frame
            page = ElementTree.fromstring(thing._repr_html_())
            if not page.findtext(".//strong") or len(page.findall(".//tr")) < 2:
                found.append(f"{kind.__qualname__}: a card without title or rows")
    return found


@pytest.mark.parametrize("name", full_but(EVERY, *QUICK))
def test_what_an_example_makes_prints_itself_in_a_few_lines(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert not long_prints(name)


@pytest.mark.full
def test_more_than_a_hundred_public_classes_are_looked_at(monkeypatch, tmp_path):
    """The others are made by long searches, or inside of functions; how they print is that of these."""
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seen = {type(thing) for name in EVERY for thing in made_by(name)}
    classes = {kind for kind in NAMES.values() if inspect.isclass(kind) and not issubclass(kind, BaseException)}
    assert len(classes & seen) > 100
