"""What was found and mended: inputs that crashed, took endless memory, or were taken though they make no sense."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from support.engine_files import ACROBAT, measured

from .array_motions import BOOK
from .pieces import BODY, Trial
from .studies import GOOD_MOTION, RIGID, store_files

_BLOCK = 2**24
"""Zeros of which a packed file is made [bytes]."""
_ROWS = "0,0,0,0\n0.1,0.1,0.2,0.1\n0.2,0.2,0.1,0\n"


@dataclass(frozen=True, kw_only=True)
class Case:
    """An input, and what must come of it: the error's name, or "accepted", and words of its message."""

    make: Callable[[], Trial]
    outcome: str = "TrajectoryError"
    said: str = ""
    slow: bool = False


def _motion(name: str, content: bytes | str, **options: object) -> Trial:
    data = content.encode() if isinstance(content, str) else content
    return Trial(kind="motion", source="find", files={name: data}, main=name, options=options)


def _body(name: str, text: str) -> Trial:
    return Trial(kind="body", source="find", files={name: text.encode()}, main=name)


def _study(text: str) -> Trial:
    return Trial(kind="study", source="find", files={"study.toml": text.encode()}, main="study.toml")


def _store(others: Mapping[str, bytes]) -> Trial:
    return Trial(kind="store", source="find", files={**store_files(), **others}, main="out.zarr")


def _attribute(name: str, value: object) -> bytes:
    said = json.loads(store_files()["out.zarr/zarr.json"])
    said["attributes"][name] = value
    return json.dumps(said).encode()


def _reshaped(name: str, shape: list[int]) -> bytes:
    """The metadata of a store, which has those of its arrays, with another shape of one."""
    said = json.loads(store_files()["out.zarr/zarr.json"])
    said["consolidated_metadata"]["metadata"][name]["shape"] = shape
    return json.dumps(said).encode()


def _matlab(**arrays: object) -> Trial:
    import scipy.io

    stream = io.BytesIO()
    scipy.io.savemat(stream, arrays)
    return Trial(
        kind="motion",
        source="find",
        files={"motion.mat": stream.getvalue()},
        main="motion.mat",
        options={"rest_missing": True, "ignore_extra": True},
    )


def _table(rows: str) -> Trial:
    return _motion("motion.csv", "time,hip,wrist,boom\n" + rows)


def _zeros(size: int, packer: zlib._Compress | None = None, start: bytes = b"") -> bytes:
    """A deflated stream of a start and zeros, made of one block again and again, without an end."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15) if packer is None else packer
    first = packer.compress(start) + packer.flush(zlib.Z_FULL_FLUSH)
    return first + (packer.compress(bytes(_BLOCK)) + packer.flush(zlib.Z_FULL_FLUSH)) * (size // _BLOCK)


def _lying_archive() -> Trial:
    """An NPZ that says it has a hundred bytes, and unpacks to four GiB."""
    packed, name = _zeros(2**32), b"time.npy"
    local = struct.pack("<IHHHHHIIIHH", 0x04034B50, 20, 0, 8, 0, 0, 0, len(packed), 100, len(name), 0) + name + packed
    entry = struct.pack(
        "<IHHHHHHIIIHHHHHII", 0x02014B50, 20, 20, 0, 8, 0, 0, 0, len(packed), 100, len(name), 0, 0, 0, 0, 0, 0
    )
    end = struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, 1, 1, len(entry) + len(name), len(local), 0)
    return _motion("motion.npz", local + entry + name + end)


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def _matrix(kind: int, shape: tuple[int, int], name: bytes) -> bytes:
    return _element(6, struct.pack("<II", kind, 0)) + _element(5, struct.pack("<ii", *shape)) + _element(1, name)


def _large_structure() -> Trial:
    """A `.mat` file of a structure of one entry, which has three GiB of zeros."""
    size = 3 * 2**30
    numbers = _matrix(6, (size // 8, 1), b"")
    field = struct.pack("<II", 14, len(numbers) + 8 + size) + numbers + struct.pack("<II", 9, size)
    inner = _matrix(2, (1, 1), b"s") + struct.pack("<HHI", 5, 4, 8) + _element(1, b"time\0\0\0\0") + field
    start = struct.pack("<II", 14, len(inner) + size) + inner
    packed = _zeros(size, zlib.compressobj(9), start)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return _motion("motion.mat", head + struct.pack("<II", 15, len(packed)) + packed)


def _unknown_element() -> Trial:
    """A `.mat` file of one vector, whose numbers are said to be of type 521."""
    numbers = struct.pack("<II", 0x0209, 24) + bytes(24)
    array = _matrix(6, (1, 3), b"time") + numbers
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return _motion("motion.mat", head + _element(14, array))


def _unknown_class() -> Trial:
    """A `.mat` file whose second vector is of class 99."""
    numbers = _element(9, struct.pack("<3d", 0.0, 1.0, 2.0))
    arrays = [_matrix(kind, (1, 3), name) + numbers for kind, name in ((6, b"time"), (99, b"hip"))]
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    content = head + b"".join(_element(14, array) for array in arrays)
    return _motion("motion.mat", content, rest_missing=True, ignore_extra=True)


def _long_words() -> Trial:
    """A Parquet file of ten kilobytes, one of whose columns is four thousand times a word of a megabyte."""
    import pyarrow
    import pyarrow.parquet

    places = pyarrow.array(np.zeros(4000, dtype=np.int32))
    words = pyarrow.DictionaryArray.from_arrays(places, pyarrow.array(["x" * 2**20]))
    stream = io.BytesIO()
    table = pyarrow.table({"time": np.arange(4000.0), "hip": words})
    pyarrow.parquet.write_table(table, stream, compression="zstd", store_schema=False)
    return _motion("motion.parquet", stream.getvalue())


def _workbook(rows: str) -> Trial:
    stream = io.BytesIO()
    sheet = '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as book:
        for name, text in BOOK.items():
            book.writestr(name, text)
        book.writestr("xl/worksheets/sheet1.xml", f"{sheet}{rows}</sheetData></worksheet>")
    return _motion("motion.xlsx", stream.getvalue())


def _row(number: int, *values: object) -> str:
    cells = "".join(
        f'<c t="inlineStr"><is><t>{value}</t></is></c>' if isinstance(value, str) else f"<c><v>{value}</v></c>"
        for value in values
    )
    return f'<row r="{number}">{cells}</row>'


_HEADER = _row(1, "time", "hip", "wrist", "boom")
_FIRST = _row(2, 0, 0, 0, 0)
_POSE = b"""<mujoco><worldbody><body name="a" axisangle="nan 0 1 30"><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
_STATE = "header: {stamp: 1.0}\n"
_OPENSIM = "Coordinates\nnRows={}\nnColumns=4\ninDegrees=no\nendheader\ntime hip wrist boom\n" + _ROWS.replace(",", " ")

CASES = {
    "a step of 1e16 s, over which a spline leaves its samples": Case(
        make=lambda: _table(_ROWS + "1e16,0,0,0\n"), said="would swing by some"
    ),
    "samples 1e-15 s apart, after which a spline leaves its samples": Case(
        make=lambda: _table("0,0,0,0\n1e-15,0.1,0,0\n0.002,0,0,0\n"), said="would swing by some"
    ),
    "a list for a mapping": Case(
        make=lambda: Trial(kind="names", source="find", files={"names.json": b"[]"}, main="names.json"),
        outcome="ShapeError",
        said="one object of texts",
    ),
    "a count of rows of which eighteen digits were read": Case(
        make=lambda: _motion("motion.mot", _OPENSIM.format("000000000000000003999")), said="the table has 3"
    ),
    "a count of rows with zeros before it": Case(
        make=lambda: _motion("motion.mot", _OPENSIM.format("000000000000000000003")), outcome="accepted"
    ),
    "a name of 70,000 characters in a message": Case(
        make=lambda: _motion(
            "motion.yaml", f"{_STATE}name: [{'x' * 70_000}]\nposition: [1]\n---\n{_STATE}name: []\nposition: []\n"
        ),
        said="a joint's name has 70000 characters: 'xxx",
    ),
    "the same name beside what is no number": Case(
        make=lambda: _motion("motion.yaml", f"{_STATE}name: [{'x' * 70_000}]\nposition: [x]\n"),
        said="a joint's name has 70000 characters: 'xxx",
    ),
    "a row that openpyxl leaves out": Case(
        make=lambda: _workbook(_HEADER + _FIRST + _row(3, 1, 0.1, 0.1, 0.1) + _row(0, 2, 0, 0, 0)),
        said="row 0 comes after row 3",
    ),
    "a row of a number below zero, which openpyxl leaves out, too": Case(
        make=lambda: _workbook(_HEADER + _FIRST + _row(-1, 1, 0.1, 0.1, 0.1) + _row(4, 2, 0, 0, 0)),
        said="a row has the number b'-1'",
    ),
    "a workbook without styles, of which openpyxl warned": Case(
        make=lambda: _workbook(_HEADER + _FIRST + _row(3, 1, 0.1, 0.1, 0.1)), outcome="accepted"
    ),
    "a whole number of 400 digits": Case(
        make=lambda: _workbook(_HEADER + _FIRST + _row(3, 1, 0.1, int("9" * 400), 0.1)), said="is no finite number"
    ),
    "a pose in the world that is none, of the body that floats": Case(
        make=lambda: Trial(kind="body", source="find", files={"body.xml": _POSE}, main="body.xml"),
        outcome="ModelFileError",
        said="finite numbers are needed",
    ),
    "an archive that lies about its size": Case(make=_lying_archive, said="no NPZ file"),
    "an element of a type that does not exist, which SciPy looks up outside its table": Case(
        make=_unknown_element, said="no MATLAB file that can be read"
    ),
    "a number after the nine of an inertia, which biorbd passes over": Case(
        make=lambda: _body("body.bioMod", ACROBAT.replace("0 0.002 0.15", "0 0.002 0.15 7")),
        outcome="ModelFileError",
        said="inertia has 10 values, not 9",
        slow=True,
    ),
    "a mass of 0.515 kg, which biorbd reads as 5.15 - 1": Case(
        make=lambda: _body("body.bioMod", ACROBAT.replace("mass 0.5", "mass 5.150000E-01", 1)),
        outcome="ModelFileError",
        said="write a small e",
        slow=True,
    ),
    "an array of no class that MATLAB has, which was left out": Case(
        make=_unknown_class, said="is of a class that does not exist"
    ),
    "a joint whose numbers are texts, which was at rest": Case(
        make=lambda: _matlab(time=[0.0, 0.5, 1.0], wrist=["0.1", "0.2", "0.3"]),
        said="no column for joint wrist, and 'wrist' is text, which is not read",
    ),
    "a matrix without names of its columns, whose joints were at rest": Case(
        make=lambda: _matlab(time=[0.0, 0.5, 1.0], shapes=np.eye(3)), said="name its columns in `joint_names`"
    ),
    "six numbers for the nine of an inertia, the rest after a mesh": Case(
        make=lambda: _body("body.bioMod", ACROBAT.replace("0 0.35 0\n", "0 0.35 0\n\tmeshfile none.stl\n", 1)),
        outcome="ModelFileError",
        said="inertia has 6 values, not 9",
        slow=True,
    ),
    "a centre in brackets, which biorbd reads": Case(
        make=lambda: _body("body.bioMod", ACROBAT.replace("com 0 0 0.2", "com (0) 0 0.2", 1)),
        outcome="accepted",
        slow=True,
    ),
    "limits of which the lower is above the upper, in a bioMod file": Case(
        make=lambda: _body("body.bioMod", ACROBAT.replace("rangesQ -0.5 0.9", "rangesQ 0.9 -0.5", 1)),
        outcome="ModelFileError",
        said="the lower limit 0.9 is not below the upper one, -0.5",
        slow=True,
    ),
    "a segment whose name has 70,000 letters": Case(
        make=lambda: _body("body.bioMod", ACROBAT.replace("segment Hand", "segment " + 70_000 * "x", 1)),
        outcome="ModelFileError",
        said="70000 characters; up to 256 are allowed",
        slow=True,
    ),
    "a body whose mass is in one point, of which rounding leaves moments": Case(
        make=lambda: _body(
            "body.bioMod",
            "version 4\nsegment part0\n\trotations x\n\tmass 0.395\n\tinertia\n\t0 0 0\n\t0 0 0\n\t0 0 0\n"
            "\tcom 0 0.01 0.0888\nendsegment\n",
        ),
        outcome="accepted",
        slow=True,
    ),
    "an anchor that stands twice in YAML, which other readers refuse": Case(
        make=lambda: _motion(
            "motion.yaml",
            "joint_names: [hip, wrist, boom]\npoints:\n- {positions: [0, &a 0.1, 0], time_from_start: 0}\n"
            "- {positions: [0, 0, 0], time_from_start: &a 1}\n",
        ),
        said="line 4: the anchor &a stands twice",
    ),
    "a number of full width in a workbook, which openpyxl reads": Case(
        make=lambda: _workbook(_HEADER + _FIRST + _row(3, 1, 7, 0.1, 0.1).replace("7", "\uff11")),
        said="a cell has the number '\uff11'",
    ),
    "a number with an underscore in a workbook": Case(
        make=lambda: _workbook(_HEADER + _FIRST + _row(3, 1, 7, 0.1, 0.1).replace("7", "1_0")),
        said="a cell has the number '1_0'",
    ),
    "a seed of 400 digits, which is one": Case(
        make=lambda: _study(f"seed = {'9' * 400}\n{RIGID}[over.tolerance]\nvalues = [1e-9]\n"), outcome="accepted"
    ),
    "a duration that is true": Case(
        make=lambda: _study(RIGID.replace("3.0", "true")),
        outcome="StudyError",
        said="rigid.duration: true and false",
    ),
    "a time limit that is true": Case(
        make=lambda: _study("time_limit = true\n" + RIGID), outcome="StudyError", said="time_limit: true and false"
    ),
    "momenta that may be drawn larger than any number": Case(
        make=lambda: _study(RIGID + '[over.momentum_z]\ndistribution = "lognormal"\ndeviation = 1e308\n'),
        outcome="StudyError",
        said="no number holds what may be drawn",
    ),
    "a store whose name has 300 letters": Case(
        make=lambda: Trial(kind="store", source="find", main="x" * 300),
        outcome="StudyStoreError",
        said="there is no store",
    ),
    "a bioMod file that is cut off within a number": Case(
        make=lambda: _body("body.bioMod", ACROBAT[: ACROBAT.index("com 0.01 0 -0.02") + len("com 0.01 0 -0.0")]),
        outcome="ModelFileError",
        said="segment 'Hand' has no endsegment",
        slow=True,
    ),
    "a measurement that stands twice": Case(
        make=lambda: _body("body.txt", measured() + "Ls1L: 0.9\n"),
        outcome="ModelFileError",
        said="Ls1L stands twice",
    ),
    "a measurement of 12, which is 10 for YAML": Case(
        make=lambda: _body("body.txt", measured(totalmass="012")), outcome="ModelFileError", said="write 12.0"
    ),
    "a parameter of a motion that a rigid body does not have": Case(
        make=lambda: _study("parameters = {beta = 0.5}\n" + RIGID), outcome="StudyError", said="a rigid body has no"
    ),
    "a mean that is true": Case(
        make=lambda: _study(RIGID + '[over.tolerance]\ndistribution = "normal"\nmean = true\ndeviation = 0.02\n'),
        outcome="StudyError",
        said="over.tolerance.mean: true and false",
    ),
    "a parameter that is a text": Case(
        make=lambda: _study('body = "cat_two_halves"\nmotion = "kane_scher"\nparameters = {alpha = 0, beta = "x"}\n'),
        outcome="StudyError",
        said="parameters.beta",
    ),
    "a chunk of a store that is no chunk": Case(
        make=lambda: _store({"out.zarr/status/c/1": b"x"}),
        outcome="StudyStoreError",
        said="array 'status' cannot be used",
        slow=True,
    ),
    "a store whose status is of more cases": Case(
        make=lambda: _store({"out.zarr/zarr.json": _reshaped("status", [10**10])}),
        outcome="StudyStoreError",
        said="has the shape (10000000000,), where the first axis has 6",
        slow=True,
    ),
    "a store that says another number of cases": Case(
        make=lambda: _store({"out.zarr/zarr.json": _attribute("cases", 7)}),
        outcome="StudyStoreError",
        said="do not give 7 cases",
        slow=True,
    ),
    "a loop whose ends rounding leaves apart, closed by a geodesic": Case(
        make=lambda: Trial(
            kind="command",
            source="find",
            files={"body.urdf": BODY.encode(), "motion.csv": GOOD_MOTION.encode()},
            arguments=("check", "body.urdf", "motion.csv", "--close", "3deg", "--close-by", "geodesic"),
        ),
        outcome="exit 0",
        slow=True,
    ),
    "a structure of three GiB": Case(make=_large_structure, said="no MATLAB file that can be read", slow=True),
    "a column of four GiB of words": Case(make=_long_words, said="no Parquet file that can be read"),
    "a row of 20 million cells": Case(
        make=lambda: _workbook('<row r="1">' + "<c/>" * 20_000_000 + "</row>"),
        said="reading it took more than",
        slow=True,
    ),
}
