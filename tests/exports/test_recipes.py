"""The recipes of the documentation, run as they stand there: each attitude is within the error that is said."""

from __future__ import annotations

import re
from importlib.util import find_spec

import pytest

from support.places import ROOT

PAGE = (ROOT / "docs" / "howto" / "recipes.md").read_text(encoding="utf-8")
RECIPES = {
    title: (words, code)
    for title, words, code in re.findall(r"^## (\w+)\n\n(.*?)^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
}
PACKAGES = {"SciPy": "scipy", "Pinocchio": "pinocchio", "MuJoCo": "mujoco", "Drake": "pydrake", "PyBullet": "pybullet"}
QUICK = ("SciPy", "Pinocchio")


@pytest.fixture(scope="module")
def prepared():
    names = {}
    exec(re.search(r"```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)[1], names)
    return names


def test_every_recipe_is_on_the_page_and_short():
    assert list(RECIPES) == list(PACKAGES)
    for title, (_, code) in RECIPES.items():
        lines = [line for line in code.splitlines() if line.strip() and not line.startswith(("import ", "from "))]
        assert len(lines) <= (18 if title == "PyBullet" else 13), title


@pytest.mark.parametrize(
    "title", [pytest.param(one, marks=() if one in QUICK else pytest.mark.full) for one in PACKAGES]
)
def test_a_recipe_is_within_its_error(prepared, capsys, title):
    """The motion turns the diver by 21 degrees in the end, and much more on the way."""
    if find_spec(PACKAGES[title]) is None:
        pytest.skip(f"{title} is not installed")
    words, code = RECIPES[title]
    exec(code, dict(prepared))
    off = float(capsys.readouterr().out.split()[-1])
    assert off < float(re.search(r"below (\S+) degrees?", words.replace("\n", " "))[1])
