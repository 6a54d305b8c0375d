"""Which chunks of a study are computed and stored: lines in files, written by whoever does so.

Loaded by a worker of Dask (`--preload support.counted_chunks`), it has each chunk leave a line in $CHUNKS_BEGUN before
it is computed. Run as a script, it is the command line of the library, of which each chunk leaves a line in
$CHUNKS_STORED after it is in the store.
"""

from __future__ import annotations

import os
import sys
from typing import Any

from shapephase.cli.main import main
from shapephase.study import StudyStore, dask_client


def _note(file: str, number: int) -> None:
    with open(os.environ[file], "a") as log:
        log.write(f"{number}\n")


def dask_setup(_: Any) -> None:
    """Count what this worker computes."""
    compute = dask_client.compute_chunk

    def counted(recipe: bytes, number: int) -> Any:
        _note("CHUNKS_BEGUN", number)
        return compute(recipe, number)

    dask_client.compute_chunk = counted


def _count_what_is_stored() -> None:
    write = StudyStore.write

    def counted(self: StudyStore, number: int, *rest: Any) -> None:
        write(self, number, *rest)
        _note("CHUNKS_STORED", number)

    StudyStore.write = counted  # type: ignore[method-assign]


if __name__ == "__main__":
    _count_what_is_stored()
    main(sys.argv[1:])
