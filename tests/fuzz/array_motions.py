"""Grammars of motions in binary files: NumPy, MATLAB, HDF5, Excel, Parquet, C3D, bags of ROS; and of stored motions."""

from __future__ import annotations

import io
import json
import tempfile
import warnings
import zipfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from support.odd_values import ODD_NUMBERS

from .pieces import (
    BODY,
    JOINTS,
    ODD_NAMES,
    Trial,
    amount,
    damaged,
    entry,
    odd_one,
    rarely,
    sometimes_damaged,
)
from .text_motions import joint_labels, options, samples

_TYPES = ("f4", ">f8", "f2", "i4", "u1", "i8", "c16", "?", "S8", "U4", "M8[s]", "m8[ms]", "g")
_HEADERS = (
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '|V0', 'fortran_order': False, 'shape': (1000000000000, 3), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
    "{'descr': '<f8', 'fortran_order': True, 'shape': (3, 3), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (True, 3.0), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 99999999999999999999), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': [('a', '<f8'), ('b', '<i4')], 'fortran_order': False, 'shape': (3,), }",
    "{'descr': ('<f8', (1000000, 1000000)), 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<M8[ns]', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<q', 'shape': (3,)}",
    "{'descr': 7, 'fortran_order': 1, 'shape': [3]}",
    "((((((((((",
    "[" * 3000,
    "",
    "1",
    "'" * 50,
    "{1:2}",
    "__import__('os').abort()",
)


def _arrays(chance: Random) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, times and values of joints, now and then an odd value."""
    labels = joint_labels(chance)
    times, rows = samples(chance, len(labels))
    values = np.array(rows, dtype=float).reshape(len(rows), len(labels))
    if values.size and rarely(chance, 15):
        values.flat[chance.randrange(values.size)] = chance.choice(ODD_NUMBERS)
    return labels, np.array(times, dtype=float), values


def _odd_array(chance: Random, array: np.ndarray) -> np.ndarray:
    """The same in another type or shape, or another array."""
    if not array.ndim:
        return array[None]
    match chance.randrange(6):
        case 0:
            with np.errstate(all="ignore"):
                return np.asarray(
                    array.astype(float, copy=True) if array.dtype.kind == "U" and not array.size else array
                ).astype(chance.choice(_TYPES) if array.dtype.kind != "U" else "U3")
        case 1:
            return array.reshape(array.shape[::-1])
        case 2:
            return array[..., None]
        case 3:
            return array[:-1]
        case 4:
            return np.asarray(array.ravel()[:1].reshape(()) if array.size else 0.0)
        case _:
            return np.zeros((0, 3))


def npy_bytes(chance: Random, array: Any, times: int = 30) -> bytes:
    """An array as NPY, once in so many times with a damaged header."""
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array), allow_pickle=True)
    data = stream.getvalue()
    if not rarely(chance, times):
        return data
    length = int.from_bytes(data[8:10], "little")
    header, body = data[10 : 10 + length], data[10 + length :]
    header = damaged(chance, header) if chance.randrange(2) else chance.choice(_HEADERS).encode() + b"\n"
    version = odd_one(chance, 1, (2, 3, 0, 9), 8)
    count = odd_one(chance, len(header), (0, 65535, len(header) + 1), 8)
    return b"\x93NUMPY" + bytes([version, 0]) + count.to_bytes(2 if version == 1 else 4, "little") + header + body


def archive(chance: Random, members: Mapping[str, bytes]) -> bytes:
    """A ZIP archive, now and then with an odd way of packing or a lie about its sizes."""
    stream = io.BytesIO()
    usual = chance.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    way = odd_one(chance, usual, (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA), 20)
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w") as packed:
        warnings.simplefilter("ignore")
        for name, data in members.items():
            packed.writestr(
                odd_one(chance, name, ("a.npy", "../a.npy", "x", "x.npy/"), 80)[:200],
                data,
                way,
            )
        if packed.filelist and rarely(chance, 25):
            lied = chance.choice(packed.filelist)
            lied.file_size = chance.choice((0, 1, 2**31, 2**32 - 1))
    return sometimes_damaged(chance, stream.getvalue(), 8)


def npz(chance: Random) -> Trial:
    """Our own NPZ, and MuJoCo's qpos as NPZ or NPY."""
    labels, times, values = _arrays(chance)
    said: dict[str, Any] = {"time": times, "shapes": values, "joint_names": np.array(labels, dtype=str)}
    given = options(chance)
    if rarely(chance, 3):
        labels = list(JOINTS)
        values = np.resize(values, (len(times), 3)) if values.size else np.zeros((len(times), 3))
        free = np.tile([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0], (len(times), 1))
        said = {"qpos": np.hstack([free, values]) if chance.randrange(2) else values, "time": times}
        if rarely(chance, 4):
            said["timestep"] = np.array(odd_one(chance, 0.1, (0.0, -1.0, 1e-320, np.nan, [0.1, 0.2], "a"), 3))
            said.pop("time")
        if rarely(chance, 6):
            given["timestep"] = odd_one(chance, 0.1, (0.0, -1.0, float("1e300"), 1e-320), 3)
        if rarely(chance, 5):
            data = sometimes_damaged(chance, npy_bytes(chance, said["qpos"], 3))
            return Trial(
                kind="motion",
                source="NPY",
                files={"motion.npy": data},
                main="motion.npy",
                options=given | {"timestep": 0.1},
            )
    elif rarely(chance, 4):
        said["base_quat_xyzw"] = np.tile(
            [0.0, 0.0, 0.0, odd_one(chance, 1.0, (0.0, 2.0, np.nan, -1.0, 1e200), 4)], (len(times), 1)
        )
        said["base_position"] = np.zeros((len(times), 3))
    for name in list(said):
        if rarely(chance, 25):
            said[name] = _odd_array(chance, np.asarray(said[name]))
        if rarely(chance, 60):
            said[chance.choice(ODD_NAMES).replace("\x00", "") or "a"] = said.pop(name)
    members = {f"{name}.npy": npy_bytes(chance, array) for name, array in said.items()}
    return Trial(
        kind="motion", source="NPZ", files={"motion.npz": archive(chance, members)}, main="motion.npz", options=given
    )


def _entries(chance: Random) -> dict[str, Any]:
    """Arrays by name as MATLAB and HDF5 have them: vectors, or a matrix with names."""
    labels, times, values = _arrays(chance)
    clean = [(label.replace("\x00", "") or "x")[:31] for label in labels]
    if rarely(chance, 3):
        found: dict[str, Any] = {"time": times, "shapes": values, "joint_names": clean}
    else:
        found = {"time": times} | {name: values[:, k] for k, name in enumerate(clean)}
    for name in list(found):
        if name != "joint_names" and rarely(chance, 30):
            found[name] = _odd_array(chance, np.asarray(found[name]))
    if rarely(chance, 6):
        found = {"motion": found} | ({"other": {"a": np.zeros(2)}} if rarely(chance, 3) else {})
    return found


def matlab(chance: Random) -> Trial:
    """MATLAB's files of version 5, plain and compressed."""
    import scipy.io

    def plain(entries: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in f"v{name}" if name)[1:]
            or "v": plain(value)
            if isinstance(value, dict)
            else np.array(value, dtype=object)
            if isinstance(value, list)
            else value
            for name, value in entries.items()
        }

    stream = io.BytesIO()
    entries = {name: value for name, value in plain(_entries(chance)).items() if name[:1].isalpha()}
    entries = {
        name: value if not isinstance(value, np.ndarray) or value.dtype.kind not in "mM" else value.astype(float)
        for name, value in entries.items()
    }
    try:
        scipy.io.savemat(stream, entries, do_compression=bool(chance.randrange(2)), long_field_names=True)
    except (TypeError, ValueError, AttributeError):
        scipy.io.savemat(stream, {"time": np.arange(3.0), "hip": np.zeros(3)})
    data = sometimes_damaged(chance, stream.getvalue(), 3)
    given = options(chance) | odd_one(chance, {}, ({"topic": "motion"}, {"topic": "none"}), 15)
    return Trial(kind="motion", source="MATLAB", files={"motion.mat": data}, main="motion.mat", options=given)


def hdf5(chance: Random) -> Trial:
    """HDF5, and MATLAB's files of version 7.3 by their first bytes."""
    import h5py

    stream = io.BytesIO()

    def put(group: Any, entries: Mapping[str, Any]) -> None:
        for name, value in entries.items():
            key = name.replace("/", "_").replace("\x00", "") or "x"
            key = key if key.strip(".") else "x"
            if key in group:
                continue
            if isinstance(value, dict):
                put(group.create_group(key), value)
            elif isinstance(value, list):
                group[key] = [text.encode(errors="replace")[:60].replace(b"\x00", b"") for text in value] or ["x"]
            elif np.asarray(value).dtype.kind not in "UmMg":
                group[key] = value
                if rarely(chance, 6):
                    group[key].attrs["units"] = chance.choice(("deg", "s", "mm", "rad", "furlong", b"\xff", 7))

    with h5py.File(stream, "w") as file:
        put(file, _entries(chance))
    data = sometimes_damaged(chance, stream.getvalue(), 2)
    return Trial(kind="motion", source="HDF5", files={"motion.h5": data}, main="motion.h5", options=options(chance))


_CELLS = (
    *("<c r='{0}' t='s'><v>0</v></c>", "<c r='{0}' t='s'><v>99999</v></c>", "<c r='{0}' t='b'><v>1</v></c>"),
    *("<c r='{0}' t='e'><v>#DIV/0!</v></c>", "<c r='{0}'><f>1/0</f></c>", "<c r='{0}' t='d'><v>2020-01-01</v></c>"),
    *("<c r='{0}' t='n'><v></v></c>", "<c r='ZZZ9'><v>1</v></c>", "<c><v>1</v></c>", "<c r='{0}' s='1'><v>1e9</v></c>"),
    *("<c r='{0}' s='1'><v>-1</v></c>", "<c r='{0}' s='1'><v>43831.5</v></c>", "<c r='{0}' t='x'><v>1</v></c>"),
)
BOOK = {
    "[Content_Types].xml": '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Override PartName="/xl/workbook.xml" '
    'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>'
    '<Override PartName="/xl/worksheets/sheet1.xml" '
    'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>'
    '<Override PartName="/xl/styles.xml" '
    'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.styles+xml"/></Types>',
    "_rels/.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Id="rId1" Target="xl/workbook.xml" '
    'Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/officeDocument"/></Relationships>',
    "xl/workbook.xml": '<workbook xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main" '
    'xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships">'
    '<sheets><sheet name="Sheet1" sheetId="1" r:id="rId1"/></sheets></workbook>',
    "xl/_rels/workbook.xml.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Id="rId1" Target="worksheets/sheet1.xml" '
    'Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet"/>'
    '<Relationship Id="rId2" Target="styles.xml" '
    'Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/styles"/></Relationships>',
    "xl/styles.xml": '<styleSheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">'
    '<fonts count="1"><font><sz val="11"/></font></fonts><fills count="1"><fill><patternFill/></fill></fills>'
    '<borders count="1"><border/></borders>'
    '<cellStyleXfs count="1"><xf/></cellStyleXfs><cellXfs count="2"><xf numFmtId="0"/>'
    '<xf numFmtId="22" applyNumberFormat="1"/></cellXfs></styleSheet>',
}


def excel(chance: Random) -> Trial:
    """A workbook, its sheet written cell by cell."""
    labels = joint_labels(chance)
    times, rows = samples(chance, len(labels))
    lines: list[list[Any]] = [["time", *labels], *([t, *row] for t, row in zip(times, rows, strict=True))]
    if rarely(chance, 8):
        lines.insert(1, [chance.choice(("", "deg", "s", "mm", "px")) for _ in lines[0]])
    written = []
    for r, line in enumerate(lines, start=1):
        cells = []
        for c, value in enumerate(line):
            place = f"{chr(65 + c)}{r}"
            if rarely(chance, 60):
                cells.append(chance.choice(_CELLS).format(place))
            elif isinstance(value, str):
                text = "".join(letter for letter in value if letter.isprintable())[:300]
                text = text.replace("&", "&amp;").replace("<", "&lt;")
                cells.append(f'<c r="{place}" t="inlineStr"><is><t>{text}</t></is></c>')
            else:
                text = entry(chance, value, 80).replace("\x00", "").replace("\x1f", "")
                cells.append(f'<c r="{place}"><v>{text}</v></c>')
        number = odd_one(chance, r, (0, -1, 1048576, 10**9, "x", 1), 80)
        written.append(f'<row r="{number}">{"".join(cells)}</row>')
    sheet = (
        '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
        + "".join(written)
        + "</sheetData></worksheet>"
    )
    parts = {name: text.encode() for name, text in BOOK.items()} | {
        "xl/worksheets/sheet1.xml": sheet.encode(errors="replace")
    }
    if rarely(chance, 5):
        name = chance.choice(sorted(parts))
        parts[name] = damaged(chance, parts[name])
    given = options(chance) | odd_one(chance, {}, ({"topic": "Sheet1"}, {"topic": "none"}), 15)
    return Trial(
        kind="motion", source="Excel", files={"motion.xlsx": archive(chance, parts)}, main="motion.xlsx", options=given
    )


def parquet(chance: Random) -> Trial:
    """Parquet with columns of several types."""
    import pyarrow
    import pyarrow.parquet

    labels, times, values = _arrays(chance)
    table = {"time": times} | {label.encode(errors="replace").decode(): values[:, k] for k, label in enumerate(labels)}
    columns, fields = [], []
    for name, column in table.items():
        kind = odd_one(
            chance, pyarrow.float64(), ("float", "int", "text", "list", "date", "none", "decimal", "words", "bool"), 20
        )
        with np.errstate(all="ignore"):
            made = {
                "float": lambda c: pyarrow.array(c.astype("f4")),
                "int": lambda c: pyarrow.array(np.nan_to_num(c, posinf=0, neginf=0).clip(-9e18, 9e18).astype("i8")),
                "text": lambda c: pyarrow.array([str(v) for v in c]),
                "list": lambda c: pyarrow.array([[v] for v in c], pyarrow.list_(pyarrow.float64())),
                "date": lambda c: pyarrow.array(np.arange(len(c)), pyarrow.timestamp("ns")),
                "none": lambda c: pyarrow.array([None] * len(c), pyarrow.float64()),
                "decimal": lambda c: pyarrow.array(np.arange(len(c)), pyarrow.int64()).cast(pyarrow.decimal128(30, 2)),
                "words": lambda c: pyarrow.array([str(v) for v in c]).dictionary_encode(),
                "bool": lambda c: pyarrow.array([bool(v) for v in c]),
            }.get(kind if isinstance(kind, str) else "", pyarrow.array)(column)
        said = {"unit": chance.choice(("deg", "mm", "s", "furlong", "\xff"))} if rarely(chance, 10) else None
        columns.append(made)
        fields.append(pyarrow.field(name, made.type, metadata=said))
    stream = io.BytesIO()
    packing = chance.choice(("none", "snappy", "gzip", "zstd", "lz4", "brotli"))
    pyarrow.parquet.write_table(pyarrow.table(columns, schema=pyarrow.schema(fields)), stream, compression=packing)
    data = sometimes_damaged(chance, stream.getvalue(), 2)
    return Trial(
        kind="motion", source="Parquet", files={"motion.parquet": data}, main="motion.parquet", options=options(chance)
    )


@cache
def _c3d_seed(unit: str, frames: int) -> bytes:
    import ezc3d

    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    made["parameters"]["POINT"]["LABELS"]["value"] = ["Hip", "Marker"]
    made.add_parameter("POINT", "ANGLES", ["Hip"])
    made.add_parameter("POINT", "ANGLE_UNITS", [unit])
    points = np.zeros((4, 2, frames))
    points[:3] = 0.1 * np.arange(6.0).reshape(3, 2, 1) + 0.01 * np.arange(frames)
    points[3] = 1.0
    made["data"]["points"] = points
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "seed.c3d"
        made.write(str(file))
        return file.read_bytes()


def c3d(chance: Random) -> Trial:
    """C3D: a good file, damaged where its header, its parameters or its data are."""
    data = bytearray(_c3d_seed(chance.choice(("deg", "rad", "")), 4))
    start, end = chance.choice(((0, 512), (512, 1536), (512, len(data)), (len(data) - 128, len(data))))
    if not rarely(chance, 10):
        data[start:end] = damaged(chance, bytes(data[start:end]))
        data = data if chance.randrange(2) else bytearray(data.ljust(len(_c3d_seed("deg", 4)), b"\0"))
    given = {"names": {"Hip_x": "hip", "Hip_y": "wrist", "Hip_z": None}, "rest_missing": True}
    return Trial(kind="motion", source="C3D", files={"motion.c3d": bytes(data)}, main="motion.c3d", options=given)


@cache
def _bag_seed(suffix: str) -> bytes:
    from support.motion_writers import states, trajectory, write_bag

    ns, values = [10**9, 2 * 10**9, 3 * 10**9], 0.1 * np.arange(9.0).reshape(3, 3)
    topic = states(JOINTS, ns, values) if suffix != ".db3" else trajectory(JOINTS, ns, values)
    storage = {".bag": "rosbag1", ".db3": "sqlite3", ".mcap": "mcap"}[suffix]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"seed{suffix if suffix == '.bag' else ''}"
        write_bag(file, {"/joint_states": topic}, storage)
        found = file if file.is_file() else next(file.glob(f"*{suffix}"))
        return found.read_bytes()


def bag(chance: Random) -> Trial:
    """Bags of ROS 1 and 2, damaged."""
    suffix = chance.choice((".bag", ".db3", ".mcap"))
    data = odd_one(chance, damaged(chance, _bag_seed(suffix)), (_bag_seed(suffix),), 10)
    return Trial(
        kind="motion",
        source=f"bag {suffix}",
        files={f"motion{suffix}": data},
        main=f"motion{suffix}",
        options=options(chance),
    )


@cache
def _record_seed(several: bool) -> bytes:
    import shapephase as sp

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "body.urdf"
        file.write_text(BODY)
        body = sp.load_body(file)
        path = sp.ShapePath.fourier(
            np.zeros(3), 0.1 * np.ones((3, 1)), 0.2 * np.ones((3, 1)), 1.0, joint_names=body.joint_names
        )
        momenta = np.array([[0.0, 0.0, 0.1], [30.0, 0.0, 0.1]]) if several else np.array([0.0, 0.1, 0.2])
        sp.reconstruct(sp.articulated(body, path), momenta, tolerance=1e-6).save(Path(folder) / "motion.npz")
        return (Path(folder) / "motion.npz").read_bytes()


_ODD_JSON = (None, -1, 0, 1e400, float("nan"), 10**400, "x", [], {}, True, [1, 2], 2**63, 1.5, {"a": {}}, "9" * 5000)


def record(chance: Random) -> Trial:
    """Stored motions: their header of JSON and their arrays, changed."""
    with np.load(io.BytesIO(_record_seed(bool(chance.randrange(2))))) as loaded:
        arrays = dict(loaded)
    header = json.loads(str(arrays["header"]))
    for _ in range(chance.randrange(3)):
        name = chance.choice(sorted(arrays))
        match chance.randrange(5):
            case 0:
                key = chance.choice(sorted(header))
                header[key] = chance.choice(_ODD_JSON)
            case 1:
                header.pop(chance.choice(sorted(header)), None)
            case 2 if arrays[name].dtype.kind == "f" and arrays[name].size:
                arrays[name] = np.array(arrays[name])
                arrays[name].flat[chance.randrange(arrays[name].size)] = chance.choice(
                    (*ODD_NUMBERS, amount(chance), 0.0)
                )
            case 3:
                arrays[name] = _odd_array(chance, arrays[name])
            case _:
                arrays.pop(name)
    if "header" in arrays and arrays["header"].dtype.kind == "U" and not arrays["header"].ndim:
        arrays["header"] = np.array(
            odd_one(chance, json.dumps(header), ("", "[]", "{}", "[" * 3000, '{"format": 1}', "nan"), 25)
        )
    members = {f"{name}.npy": npy_bytes(chance, array, 100) for name, array in arrays.items()}
    return Trial(
        kind="record", source="stored motion", files={"motion.npz": archive(chance, members)}, main="motion.npz"
    )
