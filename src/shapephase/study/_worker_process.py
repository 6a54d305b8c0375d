"""The process that computes cases: it gets a recipe once, then ranges of cases, and ends with who started it."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import time
import warnings
from multiprocessing.connection import Connection

import numpy as np

from ..errors import StudyError

# [s] Between looks at whether the process that started this one is still there.
_LOOK = 1.0


def serve(descriptor: int, parent: int) -> None:
    """Answer what comes through a connection until it ends."""
    # Ctrl-C goes to all processes of a terminal; who started this one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    # What cases print is not to wait in a buffer that nobody reads.
    sys.stdout = sys.stderr
    warnings.simplefilter("ignore")
    connection = Connection(descriptor)
    # A child of a case would keep the connection open when this process is gone.
    os.set_inheritable(descriptor, False)
    os.register_at_fork(after_in_child=connection.close)
    try:
        _answer(connection)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def _answer(connection: Connection) -> None:
    from ._evaluate import Evaluator

    _, recipe = pickle.loads(connection.recv_bytes())
    study, inputs = pickle.loads(recipe)
    for name, digest in study.function_inputs.items():
        if inputs.get(name, digest) != digest:
            connection.send(StudyError(f"{name} is another where it is computed than where the study was begun"))
            return
    evaluator = Evaluator(study, inputs)
    connection.send("ready")
    while True:
        way, first, stop = connection.recv()
        if way == "together":
            connection.send(evaluator.together(np.arange(first, stop)))
            continue
        for index in range(first, stop):
            connection.send(evaluator.alone(index))


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(0)
