"""Processes that are forked while other threads compute."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

# Children begin while Numba is imported, while kernels are loaded or compiled, and while rows are computed.
FORKING = """
import os, signal, threading, time
import numpy as np
import shapephase as sp

momenta = np.random.default_rng(0).normal(size=(300, 3))

# A child of a process that just then imports a module may wait for it: that is Python's, and these are imported here.
reconstruct, rigid = sp.reconstruct, sp.rigid

def batch():
    return reconstruct(rigid(np.diag([1.0, 2.0, 3.0]), 1.0), momenta).final_attitude

def always():
    while True:
        batch()

for _ in range(2):
    threading.Thread(target=always, daemon=True).start()
children = []
for number in range(4):
    time.sleep(0.08)
    child = os.fork()
    if not child:
        signal.alarm(30)
        found = batch()
        os._exit(0 if np.isfinite(found).all() else 3)
    children.append(child)
print([os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children], flush=True)
os._exit(0)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_children_of_a_process_whose_threads_compute_end():
    run = subprocess.run([sys.executable, "-c", FORKING], capture_output=True, text=True, timeout=120, check=False)
    assert run.stdout.strip() == str([0] * 4), run.stderr
