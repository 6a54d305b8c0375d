"""Tables as frames of pandas: what a file says, before anybody asks which column is which joint."""

from __future__ import annotations

import gzip
import os
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...arguments import check_file_name, check_text
from ...errors import TrajectoryError, unknown_name
from .formats.spreadsheets import read_excel, read_feather, read_parquet
from .formats.text_tables import read_text
from .recording import file_bytes

if TYPE_CHECKING:
    import pandas as pd

TABLES: dict[str, Callable[[Path, bytes, str | None], Any]] = {  # ending -> reader of name, bytes and topic
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".log", ".tum"), lambda w, d, part: read_text(w, d, section=part)),
    **dict.fromkeys((".xlsx", ".xlsm"), read_excel),
    ".parquet": lambda where, data, _: read_parquet(where, data),
    ".feather": lambda where, data, _: read_feather(where, data),
}
PACKED = ".gz"


def read_table(file: str | os.PathLike[str], *, topic: str | None = None) -> pd.DataFrame:
    """Read a table of numbers as a frame: text, Excel, Parquet or Feather, by the file's ending, also packed (`.gz`).

    A text may have any separator, decimal commas, comments and a row of units, a header behind `#`, none at all, or
    the five rows of Vicon Nexus. Columns are labelled as the file labels them, or from 1 where it does not; the index
    has the numbers of the rows in the file. Entries that are no numbers stay texts, empty ones are NaN.

    Parameters
    ----------
    topic : which sheet of a workbook, or section of a file of Nexus

    Returns
    -------
    DataFrame
        `attrs` has `units`, column -> unit, as far as a row of units says them, and `format`.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    TrajectoryError
        For a row that is longer or shorter than the header, with its number, and for what is no table.
    UnknownNameError
        For an unknown ending, or a topic that is not there.

    Examples
    --------
    >>> np.savetxt("bend.txt", [[0.0, 0.1], [0.5, 0.2]], header="time knee")
    >>> sp.shape_space.files.read_table("bend.txt")
       time  knee
    2   0.0   0.1
    3   0.5   0.2
    """
    check_file_name(file, "file")
    if topic is not None:
        check_text(topic, "topic", "a name")
    where, data = unpacked(Path(file), file_bytes(Path(file)))
    suffix = where.suffix.lower()
    if suffix not in TABLES:
        raise unknown_name(f"ending of the table {where}:", where.suffix, TABLES)
    frame = TABLES[suffix](where, data, topic)
    frame.attrs["file"] = str(file)
    return frame


def unpacked(where: Path, data: bytes) -> tuple[Path, bytes]:
    """Name and bytes of a file, unpacked where it ends with `.gz`. Raises TrajectoryError."""
    if where.suffix.lower() != PACKED:
        return where, data
    try:
        return where.with_suffix(""), gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as error:
        raise TrajectoryError(f"{where}: cannot be unpacked ({error}); pack it anew, or give it unpacked") from None
