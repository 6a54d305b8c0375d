"""What is done over and over in one process takes no more memory than doing it a few times."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

# Of the work each: what is done in one round.
ROUNDS = {
    "reconstructions": """
body, path = sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)
def once(k):
    motion = sp.reconstruct(sp.articulated(body, path), [0.01, 0.02, 1e-5 * k])
    motion.attitude(0.4)
""",
    "loads": """
names = sp.robot_names()
def once(k):
    sp.load_body(names[k % len(names)])
""",
    "reports": """
import tempfile
from pathlib import Path
from shapephase.plots.pages.report_page import report
body, path = sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)
folder = tempfile.TemporaryDirectory()
def once(k):
    motion = sp.reconstruct(sp.articulated(body, path), [0.01, 0.02, 1e-3 * (k + 1)])
    report(motion, sp.split(motion), shape_path=path).write(Path(folder.name) / "report.html")
""",
}
MEASURED = """
import ctypes, gc, json, resource, sys, tracemalloc
import shapephase as sp
from shapephase.examples.scenarios import kane_scher
{round}
def memory():
    gc.collect()
    # What was freed goes back to the system, where the C library can do that.
    getattr(ctypes.CDLL(None), "malloc_trim", lambda _: 0)(0)
    with open("/proc/self/statm") as file:
        resident = int(file.read().split()[1]) * resource.getpagesize()
    return tracemalloc.get_traced_memory()[0], resident
tracemalloc.start()
count, found = int(sys.argv[1]), []
for k in range(count):
    if k == count // 10:
        found.append(memory())
    once(k)
found.append(memory())
print(json.dumps(found))
"""
# Of objects of Python: the interpreter's own tables and caches of a bounded size [bytes].
MOST_OBJECTS = 256 * 1024
# Of all memory: pieces that the C library keeps [bytes]. One small array lost by each of 10,000 would be as much.
MOST_RESIDENT = 6 * 2**20


@pytest.mark.full
@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="no /proc on this system")
@pytest.mark.parametrize(
    ("work", "count"),
    [
        ("reconstructions", 60),
        pytest.param("reconstructions", 10_000, marks=pytest.mark.full),
        pytest.param("loads", 200, marks=pytest.mark.full),
        pytest.param("reports", 50, marks=pytest.mark.full),
    ],
)
def test_after_the_first_tenth_nothing_grows(work, count, record_property):
    command = [sys.executable, "-c", MEASURED.format(round=ROUNDS[work]), str(count)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    (objects, resident), (more_objects, more_resident) = json.loads(done.stdout)
    record_property("grown", (more_objects - objects, more_resident - resident))
    assert more_objects - objects < MOST_OBJECTS
    assert more_resident - resident < MOST_RESIDENT
