"""A parser that fails, crashes, never ends or eats memory ends in an error that names the file."""

import sys
from pathlib import Path

import numpy as np
import pytest

from shapephase.errors import TrajectoryError
from shapephase.shape_space.files.formats import parser_process
from shapephase.shape_space.files.formats.parser_process import parsed

PARSERS = {
    "good": "import numpy as np\ndef parse(data): return {'count': np.array(len(data))}",
    "failing": "def parse(data): raise ValueError('the third byte is odd')",
    "crashing": "import os, signal\ndef parse(data): os.kill(os.getpid(), signal.SIGSEGV)",
    "endless": "def parse(data):\n    while True: pass",
    "hungry": "def parse(data): return {'zeros': bytearray(2**40)}",
}


@pytest.fixture
def parser(tmp_path, monkeypatch):
    """A function that writes one of the parsers and names its module."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])

    def written(kind):
        (tmp_path / f"{kind}_parser.py").write_text(PARSERS[kind])
        return f"{kind}_parser"

    return written


def test_arrays_come_back(parser):
    found = parsed(Path("m.c3d"), b"12345", "C3D", parser("good"))
    assert list(found) == ["count"]
    np.testing.assert_array_equal(found["count"], 5)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("failing", r"m\.c3d: no C3D file that can be read \(ValueError: the third byte is odd\)"),
        ("crashing", r"m\.c3d: no C3D file that can be read \(the parser crashed on it, signal 11\)"),
        ("hungry", r"m\.c3d: no C3D file that can be read \(MemoryError"),
    ],
)
def test_what_goes_wrong_is_named(parser, kind, words):
    with pytest.raises(TrajectoryError, match=words):
        parsed(Path("m.c3d"), b"12345", "C3D", parser(kind))


def test_what_never_ends_is_stopped(parser, monkeypatch):
    monkeypatch.setattr(parser_process, "_SECONDS", 0.5)
    with pytest.raises(TrajectoryError, match="stopped"):
        parsed(Path("m.c3d"), b"12345", "C3D", parser("endless"))
