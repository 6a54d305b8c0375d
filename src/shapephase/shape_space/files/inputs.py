"""Sources of motions: the kinds of file by their endings, standard input, tables in memory."""

from __future__ import annotations

import gzip
import hashlib
import os
import sys
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...arguments import check_file_name, check_text, positive_argument
from ...body.body import Body
from ...errors import ShapeError, TrajectoryError, unknown_name
from ...files import no_such_file
from ...letters import value_text
from .formats.bvh import read_bvh
from .formats.c3d import INVERSE_KINEMATICS, read_c3d
from .formats.deepmimic import read_deepmimic
from .formats.frames import file_table, is_frame, read_frame
from .formats.motion_arrays import arrays_in_memory, arrays_motion, named_columns, of_numbered_columns, read_arrays
from .formats.named_arrays import read_hdf5, read_matlab
from .formats.opensim import has_header, read_opensim
from .formats.ros_motion_files import read_bag, read_ros_yaml
from .formats.segment_poses import read_mvnx
from .formats.spreadsheets import read_arrow, read_excel, read_json_lines
from .formats.text_tables import read_text
from .recording import Table, digest, file_bytes

if TYPE_CHECKING:
    import pandas as pd

STANDARD_INPUT = "-"  # file name: a text table or an OpenSim motion
JSON_LINES = (".jsonl", ".ndjson")
TABLES: dict[str, Callable[[Path, bytes, str | None], Any]] = {  # ending -> reader of name, bytes and topic
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".log", ".tum"), lambda w, d, part: read_text(w, d, section=part)),
    **dict.fromkeys((".xlsx", ".xlsm"), read_excel),
    **dict.fromkeys((".parquet", ".feather"), lambda where, data, _: read_arrow(where, data)),
    **dict.fromkeys(JSON_LINES, lambda where, data, _: read_json_lines(where, data)),
}
_OTHERS: dict[str, Callable[[Path, bytes, str | None], Table]] = {
    **dict.fromkeys((".mot", ".sto"), lambda where, data, _: read_opensim(where, data)),
    **dict.fromkeys((".yaml", ".yml"), lambda where, data, _: read_ros_yaml(where, data)),
    ".c3d": lambda where, data, _: read_c3d(where, data),
    ".json": lambda where, data, _: read_deepmimic(where, data),
    ".mvnx": lambda where, data, _: read_mvnx(where, data),
    ".mat": read_matlab,
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
}
_WITH_PARTS = (*TABLES, ".mat", ".h5", ".hdf5")
_ARRAYS = (".npz", ".npy")
_BAGS = (".bag", ".mcap", ".db3")
_SIMILAR = {  # files that are not read, and how to turn them into joint motions
    ".trc": INVERSE_KINEMATICS,
    ".mvn": "it is a suit's recording as its own program keeps it; export it there as MVNX, or as BVH",
    ".xls": "Excel's older files are not read; save it as .xlsx or .csv",
    ".ods": "save it as .xlsx or .csv",
    ".numbers": "save it as .xlsx or .csv",
}
PACKED = ".gz"


class Input(NamedTuple):
    """A table, the name of its source for people, and the SHA-256 of its bytes, or None."""

    table: Table
    name: str
    sha256: str | None


def read_input(
    source: Any,
    body: Body,
    topic: str | None,
    timestep: float | None,
    order: str | None,
    names: Mapping[str, str | None] | None = None,
) -> tuple[Input, float | None]:
    """The table of a file, of standard input (`-`), or of objects in memory; and the time step, if it is still needed.

    source : a file's name, a frame of pandas or xarray, a mapping of arrays, `(times, array, names)`, or an `Input`
    """
    if topic is not None and not isinstance(topic, str):
        raise ShapeError(f"topic: a name is needed, got {value_text(topic)}")
    if timestep is not None:
        timestep = positive_argument(timestep, "timestep")
    if isinstance(source, Input):
        return source, timestep

    def in_columns(table: Table, name: str, sha256: str | None) -> tuple[Input, float | None]:
        table = named_columns(table, body, names or {}, order, timestep)
        return Input(of_numbered_columns(table, body, order), name, sha256), timestep

    if is_frame(source):
        _no_topic(topic, "a table in memory")
        table = read_frame(source)
        return in_columns(table, table.where, None)
    if isinstance(source, Mapping | tuple):
        _no_topic(topic, "arrays in memory")
        table, step = arrays_motion(arrays_in_memory(source), "the arrays", body, timestep, order, kind="arrays")
        return Input(table, table.where, None), step
    check_file_name(source, "file")
    if source == STANDARD_INPUT:
        _no_topic(topic, "standard input")
        where = Path("standard input")
        data = sys.stdin.buffer.read()
        table = read_opensim(where, data) if has_header(data) else file_table(read_text(where, data), str(where))
        table = of_numbered_columns(table, body, order)
        return Input(table, str(where), hashlib.sha256(data).hexdigest()), timestep
    where = Path(source)
    suffix = Path(where.stem).suffix.lower() if where.suffix.lower() == PACKED else where.suffix.lower()
    if suffix in _BAGS or os.path.isdir(where):
        if timestep is not None:
            raise TrajectoryError(f"{where}: timestep is for files without times; this one has its times")
        if not os.path.exists(where):
            raise no_such_file(where)
        return Input(read_bag(where, topic), str(source), digest(where)), None
    if suffix in _SIMILAR:
        raise TrajectoryError(f"{where}: {suffix} files are not read: {_SIMILAR[suffix]}")
    kinds = (*TABLES, *_OTHERS, ".bvh", *_ARRAYS)
    if suffix not in kinds:
        raise unknown_name(
            f"ending of the motion file {where}:", where.suffix, dict.fromkeys((".csv", ".npz", *kinds, *_BAGS))
        )
    if topic is not None and suffix not in _WITH_PARTS:
        raise TrajectoryError(
            f"{where}: topic={value_text(topic)} is for bags, workbooks and .mat files; this one has no parts"
        )
    data = file_bytes(where)
    name, sha256 = str(source), hashlib.sha256(data).hexdigest()
    where, data = unpacked(where, data)
    if suffix in TABLES:
        return in_columns(_table(where, data, topic), name, sha256)
    if suffix in _ARRAYS:
        table, step = read_arrays(where, data, body, timestep, order)
        return Input(table, name, sha256), step
    if suffix == ".bvh":
        return Input(read_bvh(where, data, body), name, sha256), timestep
    return Input(of_numbered_columns(_OTHERS[suffix](where, data, topic), body, order), name, sha256), timestep


def _table(where: Path, data: bytes, topic: str | None) -> Table:
    """A table of any kind, a motion of OpenSim that a spreadsheet has saved, or JSON: DeepMimic's files end in .txt."""
    if has_header(data):
        return read_opensim(where, data)
    if data.lstrip().startswith(b"{") and where.suffix.lower() not in JSON_LINES:
        return read_deepmimic(where, data)
    return file_table(TABLES[where.suffix.lower()](where, data, topic), str(where))


def _no_topic(topic: str | None, source: str) -> None:
    if topic is not None:
        raise TrajectoryError(f"topic={value_text(topic)} is for bags, workbooks and .mat files, and this is {source}")


def read_table(file: str | os.PathLike[str], *, topic: str | None = None) -> pd.DataFrame:
    """Read a table of numbers as a frame: text, Excel, Parquet or Feather, by the file's ending, also packed (`.gz`).

    A text may have any separator, decimal commas, comments and a row of units, a header behind `#`, none at all, or
    the five rows of Vicon Nexus. Columns are labelled as the file labels them, or from 1 where it does not; the index
    has the numbers of the rows in the file. Entries that are not numbers stay texts, empty ones are NaN.

    Parameters
    ----------
    topic : which sheet of a workbook, or section of a file of Nexus

    Returns
    -------
    DataFrame
        `attrs` has `units`, column -> unit, from a row of units, and `format`.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    TrajectoryError
        For a row that is longer or shorter than the header, with its number, and for what is not a table.
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
