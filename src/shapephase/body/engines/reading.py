"""The reading process: it limits its memory, has an engine read a file, and writes plain numbers as JSON."""

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

BODY = "body"  # request for links and joints
TEXT = "text"  # request for the URDF that a file expands to
SHAPES = "shapes"  # request for what can be drawn, or collides
NO_MEMORY = 3  # exit code: out of memory
MISSING = 4  # exit code: the engine is not installed
REFUSED = 5  # exit code: the file is unusable, for the reason on standard output
MEMORY = 2**30  # [bytes] beyond the imports; the largest public models take a tenth


def read_in_this_process() -> None:
    """Read the file of the first argument in the format of the second, and end the process.

    The third is `BODY`, `TEXT` or `SHAPES`, followed by options as JSON.
    """
    path, name, what, *options = sys.argv[1:]
    known = FORMATS[name]
    if find_spec(known.engine) is None:
        sys.exit(MISSING)
    # Engines print messages, from C++ too: standard output is kept for the result.
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # Some write a log into the current folder when they are imported.
    sys.path[:] = map(os.path.abspath, sys.path)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        code = _write(path, known, what, options, output)
        os.chdir(os.path.sep)
    output.flush()
    sys.exit(code)


def _write(path: str, known: Format, what: str, options: list[str], output: TextIO) -> int:
    """Write the reader's result; return the exit code."""
    reader = import_module(known.drawing if what == SHAPES else known.module, __package__)
    limit_this_process(MEMORY)
    try:
        if what == BODY:
            text = reader.chain_of(path, **json.loads(*options)).to_json()
        else:
            result = reader.text_of if what == TEXT else reader.shapes_of
            text = json.dumps(result(path, **json.loads(*options)))
    except MemoryError:
        return NO_MEMORY
    except UnusableModelError as error:
        output.write(json.dumps({"message": str(error), "line": error.line}))
        return REFUSED
    output.write(text)
    return 0
