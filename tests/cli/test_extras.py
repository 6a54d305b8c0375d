"""Extras: few, and every message, page and notebook that names one names one that is there and brings what it says."""

from __future__ import annotations

import re
import tomllib

import pytest

from shapephase.body.engines.formats import FORMATS
from support.places import ROOT

EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
FOR_DEVELOPERS = {"docs", "test", "dev"}
FILES = [
    *(ROOT / "src").rglob("*.py"),
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "notebooks").glob("*.ipynb"),
    *(ROOT / "conda-recipe").glob("*"),
    ROOT / "pyproject.toml",
]


def packages(extra):
    """The packages that an extra brings, by their names in lower case."""
    found = set()
    for requirement in EXTRAS[extra]:
        own = re.match(r"shapephase\[(.*)\]", requirement)
        found |= (
            set().union(*map(packages, own[1].split(","))) if own else {re.match(r"[\w-]+", requirement)[0].lower()}
        )
    return found


def test_extras_are_few_and_all_has_those_of_users():
    assert len(EXTRAS) <= 12
    users = set(EXTRAS) - FOR_DEVELOPERS - {"all"}
    assert packages("all") == set().union(*map(packages, users))
    assert packages("all") <= packages("test")
    for alone in ("opensim", "mjcf"):
        assert len(packages(alone)) == 1


def test_every_extra_that_is_named_is_there():
    named = {}
    for file in FILES:
        for words in re.findall(r"shapephase\[([a-z,]+)\]", file.read_text(encoding="utf-8")):
            named.update(dict.fromkeys(words.split(","), file))
    assert set(named) >= {"plot", "video", "data", "bodies", "study", "all", "docs", "opensim", "mjcf", "biomod"}
    assert not {extra: str(file) for extra, file in named.items() if extra not in EXTRAS}


NEEDS = re.compile(
    r"(?:needs?|needs the|need) ((?:[A-Za-z][\w-]*)(?: and [A-Za-z]\w*)?)(?: package)?"
    r"(?:; install (?:it|them) with)?: (?:\"\s+\")?pip install 'shapephase\[(\w+)\]'"
)
"""A message such as "MATLAB files need pymatreader and h5py; install them with: pip install 'shapephase[data]'"."""


BY_LIBRARY = re.compile(r"by_library\(\w+(?:\(\w+\))?, f?\"[^\"]*\", \"([^\"]+)\"")
"""Packages of readers, whose message names the extra `data`."""


def test_messages_name_the_extra_that_brings_the_package():
    checked = set()
    for file in (ROOT / "src").rglob("*.py"):
        text = re.sub(r"\"\s+f?\"", "", file.read_text(encoding="utf-8"))
        for names, extra in (*NEEDS.findall(text), *((names, "data") for names in BY_LIBRARY.findall(text))):
            for name in names.split(" and "):
                brought = {"zarr": "study", "dask": "study"}.get(name.lower()) or extra
                assert name.lower() in packages(brought), (file, name, extra)
                assert brought == extra
                checked.add(name.lower())
    assert checked >= {"matplotlib", "h5py", "pymatreader", "pyarrow", "rosbags", "spiceypy", "zarr", "openpyxl"}


@pytest.mark.parametrize("name", FORMATS)
def test_an_engine_s_extra_brings_it(name):
    known = FORMATS[name]
    assert known.engine in packages(known.extra)
