"""What a reading process does: it limits itself, has an engine read a file, and writes plain numbers as JSON."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from importlib import import_module
from importlib.util import find_spec
from typing import TextIO

from ...child_process import limit_this_process
from .chain import UnusableModelError
from .formats import FORMATS, Format

BODY = "body"
"""What is asked of a file: its links and joints."""
TEXT = "text"
"""The same: the URDF that it stands for."""
SHAPES = "shapes"
"""The same: what can be drawn."""
MISSING = 4
"""Exit code where the engine is not installed."""
REFUSED = 5
"""Exit code where the file cannot be used; standard output says why."""
NO_MEMORY = 3
"""Exit code of a process that ran out of memory."""
MEMORY = 1024 * 2**20
"""[bytes] that reading a file may take beyond the imports."""


def read_in_this_process() -> None:
    """Read the file of the first argument in the format of the second, and end the process.

    The third is `BODY` or `TEXT`, and then come options as JSON, or it is `SHAPES`.
    """
    path, name, what, *options = sys.argv[1:]
    known = FORMATS[name]
    if find_spec(known.engine) is None:
        sys.exit(MISSING)
    # Engines print what they have to say, from C++ too; standard output is for the answer alone.
    answer = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # Some write a log into the folder that they are imported in.
    sys.path[:] = map(os.path.abspath, sys.path)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        code = _answered(path, known, what, options, answer)
        os.chdir(os.path.sep)
    answer.flush()
    sys.exit(code)


def _answered(path: str, known: Format, what: str, options: list[str], answer: TextIO) -> int:
    """Write what the reader says; the exit code."""
    reader = import_module(known.drawing if what == SHAPES else known.module, __package__)
    limit_this_process(MEMORY)
    try:
        if what == BODY:
            said = reader.chain_of(path, **json.loads(*options)).spoken()
        else:
            said = reader.text_of(path, **json.loads(*options)) if what == TEXT else reader.shapes_of(path)
    except MemoryError:
        return NO_MEMORY
    except UnusableModelError as error:
        answer.write(json.dumps({"message": str(error), "line": error.line}))
        return REFUSED
    answer.write(json.dumps(said))
    return 0
