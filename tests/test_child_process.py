"""A process of its own: its limits, with and without /proc."""

from __future__ import annotations

import json
import resource
import subprocess
from pathlib import Path

import pytest

from shapephase.child_process import run_alone

LIMITED = """
import json, resource
from pathlib import Path
{before}
from shapephase.child_process import limit_this_process
limit_this_process(2**24)
try:
    bytearray(2**26)
    refused = False
except MemoryError:
    refused = True
print(json.dumps([resource.getrlimit(resource.RLIMIT_CORE)[0], resource.getrlimit(resource.RLIMIT_AS)[0], refused]))
"""
# As where there is no such folder.
WITHOUT_PROC = """
def read_text(self):
    raise FileNotFoundError(self)
Path.read_text = read_text
"""


def limits(before: str) -> str:
    done = run_alone(LIMITED.format(before=before), (), b"", 60.0)
    assert done.returncode == 0, done.stderr
    return done.stdout.decode()


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no /proc on this system")
def test_what_is_mapped_already_does_not_count():
    core, memory, refused = json.loads(limits(""))
    assert core == 0
    assert memory > 2**24
    assert refused


def test_where_it_is_not_known_what_is_mapped_only_core_dumps_are_forbidden():
    core, memory, refused = json.loads(limits(WITHOUT_PROC))
    assert core == 0
    assert memory == resource.getrlimit(resource.RLIMIT_AS)[0]
    assert not refused


def test_it_takes_words_and_input_and_is_stopped():
    source = "import sys; sys.stdout.buffer.write(sys.stdin.buffer.read() + ' '.join(sys.argv[1:]).encode())"
    assert run_alone(source, ("b", "c"), b"a ", 60.0).stdout == b"a b c"
    with pytest.raises(subprocess.TimeoutExpired):
        run_alone("while True: pass", (), b"", 0.2)
