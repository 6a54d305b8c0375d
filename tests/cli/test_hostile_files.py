"""Hostile and odd files, thousands of damaged ones: a body that is right, or an error that says where.

Every file is loaded in a process that may use 1 GiB and `MOST_LOADS` times the work of a reference load; what crashes
it, hangs or eats memory is a failure.
"""

from __future__ import annotations

import re

import pytest

from shapephase.body import catalog
from support.asked_process import AskedProcess, ProcessEnded
from support.hostile_files import GOOD, GOOD_MJCF, Case, cases
from support.loading_process import Worker

CASES = cases()
# File and line, then what people call the element, or what is wrong with the file as a whole.
NAMED = re.compile(
    r":\d+: (link|joint|body|geom|mesh|texture|fixed|robot|<[^>]*>|"
    r"not UTF-8|not well-formed XML|a document type|the body has \d|this is|a zero byte)"
)
QUICK, FULL, BATCH = 600, 20_000, 100
QUICK_OF_AN_ENGINE = 40
"""Files that a process of their own reads are fewer."""
BASES = ("small", "cat", "astronaut", "satellite", "mjcf")


@pytest.fixture(scope="module")
def worker():
    process = Worker()
    yield process
    process.stop()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_hostile_or_odd_file(case: Case, worker: Worker, tmp_path):
    path = tmp_path / case.file
    path.write_bytes(case.content())
    (answer,) = worker.outcomes({"path": str(path), "options": dict(case.options)})
    if case.said is None:
        assert answer["outcome"] == "loads", answer["message"]
        assert bool(answer["message"]) == (case.warned is not None), answer["message"]
        assert re.search(case.warned or "", answer["message"]), answer["message"]
        return
    assert answer["outcome"] == case.error, answer["message"]
    message = answer["message"]
    assert message.startswith(str(path))
    assert re.search(case.said, message), message
    assert len(message) < 1500
    assert NAMED.match(message.removeprefix(str(path))), message
    if case.line is not None:
        assert message.startswith(f"{path}:{case.line}: "), message


def test_hostile_files_with_warnings_about_nothing_else(worker: Worker, tmp_path):
    """The two good files give no warning, and what they are is known."""
    for text, name in ((GOOD, "good.urdf"), (GOOD_MJCF, "good.xml")):
        (tmp_path / name).write_text(text)
        (answer,) = worker.outcomes({"path": str(tmp_path / name)})
        assert answer["message"] == ""
        assert answer["mass"] == pytest.approx(4.5 if name == "good.urdf" else answer["mass"], rel=1e-15)


def test_the_worker_tells_a_crash_from_a_hang():
    """The examiner examined: a process that ends is seen, and one that only waits is not taken for it."""
    process = AskedProcess("-c", "input()")
    try:
        with pytest.raises(TimeoutError):
            process.answer(0.05)
        process.process.kill()
        with pytest.raises(ProcessEnded, match="-9"):
            process.answer(10.0)
    finally:
        process.stop()


def base_file(name, folder):
    """A good file without its drawings, which no reader looks at."""
    path = folder / (f"base_{name}.xml" if name == "mjcf" else f"base_{name}.urdf")
    if name in ("small", "mjcf"):
        path.write_text(GOOD if name == "small" else GOOD_MJCF)
    else:
        text = (catalog.robots_folder() / f"{name}.urdf").read_text()
        path.write_text(re.sub(r"<(visual|collision)>.*?</\1>|<!--.*?-->", "", text, flags=re.DOTALL))
    return path


def damage(worker, folder, name, first, count):
    """Load `count` damaged files; how many of them loaded."""
    base = base_file(name, folder)
    path = folder / f"damaged{base.suffix}"
    loaded = 0
    for start in range(first, first + count, BATCH):
        stop = min(start + BATCH, first + count)
        request = {"path": str(path), "base": str(base), "seeds": [start, stop]}
        for number, answer in enumerate(worker.outcomes(request, stop - start), start):
            here = f"{name}, seed {number}: {answer['message'][:500]}"
            if answer["outcome"] == "loads":
                loaded += 1
                if "written" in answer:
                    assert answer["mass"] == pytest.approx(answer["written"], rel=1e-12), here
            else:
                assert answer["outcome"] in ("ModelFileError", "UnphysicalInertiaError"), f"{answer['outcome']} {here}"
                assert NAMED.match(answer["message"].removeprefix(str(path))), here
    return loaded


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.full] * (name == "mjcf")) for name in BASES])
def test_damaged_files(name, worker, tmp_path):
    count = QUICK_OF_AN_ENGINE if name == "mjcf" else QUICK // len(BASES)
    loaded = damage(worker, tmp_path, name, 0, count)
    assert 0.05 * count < loaded < 0.95 * count, "damage that nothing notices or nothing survives shows little"


@pytest.mark.full
@pytest.mark.parametrize("part", range(4))
@pytest.mark.parametrize("name", BASES)
def test_twenty_thousand_damaged_files(name, part, worker, tmp_path):
    count = FULL // len(BASES) // 4
    damage(worker, tmp_path, name, 1000 + part * count, count)
