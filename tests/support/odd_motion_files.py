"""Hostile and odd files of motions, and what must become of each."""

from __future__ import annotations

import io
import os
import warnings
import zipfile

import numpy as np

from shapephase.errors import (
    InputFileNotFoundError,
    TrajectoryError,
    TrajectoryWarning,
    UnknownColumnError,
    UnknownNameError,
)
from support.motion_writers import STATE, states, trajectory, write_bag

HEADER = "time,left_shoulder_abduction,right_shoulder_abduction\n"
LEFT, RIGHT = "left_shoulder_abduction", "right_shoulder_abduction"
BOTH = f"{LEFT},{RIGHT}"
ROWS = "0,0.1,0.2\n1,0.3,0.4\n2,0.5,0.6\n"


def csv_text(rows=ROWS, header=HEADER):
    return header + rows


def opensim(body="0 1 2\n1 2 3\n", header="nRows=2\nnColumns=3\ninDegrees=yes\n", names=f"time {LEFT} {RIGHT}\n"):
    return "motion\nversion=1\n" + header + "endheader\n" + names + body


def points(*rows, names=f"[{LEFT}, {RIGHT}]"):
    lines = [f"joint_names: {names}", "points:"]
    lines += [f"- {{positions: {positions}, time_from_start: {start}}}" for positions, start in rows]
    return "\n".join(lines) + "\n"


def npz_bytes(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def npy_header(text, body=b""):
    line = text.encode() + b" " * 10 + b"\n"
    return b"\x93NUMPY\x01\x00" + len(line).to_bytes(2, "little") + line + body


def doubled_member():
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w") as archive:
        warnings.simplefilter("ignore")
        for _ in range(2):
            archive.writestr("time.npy", b"")
    return stream.getvalue()


GOOD_ARRAYS = {"time": [0.0, 1.0, 2.0], "shapes": np.full((3, 2), 0.1), "joint_names": [LEFT, RIGHT]}
NAN = float("nan")


def bag(storage="mcap", **topics):
    """A function that writes a bag of these topics."""
    return lambda file: write_bag(file, {f"/{name}": topic for name, topic in topics.items()}, storage)


def partial(file):
    def make(m):
        return [m.state(10**9, [LEFT, RIGHT], [0.1, 0.2]), m.state(2 * 10**9, [RIGHT], [0.3])]

    write_bag(file, {"/joint_states": (STATE, make)}, "mcap")


def no_motion(file):
    kind = "std_msgs/msg/String"
    write_bag(file, {"/chatter": (kind, lambda m: [m.types.types[kind](data="hello")])}, "sqlite3")


def cut_bag(file):
    whole = file.with_name("whole.bag")
    bag("rosbag1", js=states([LEFT, RIGHT], [1, 2, 3], np.zeros((3, 2))))(whole)
    file.write_bytes(whole.read_bytes()[:-200])


def without_storage(file):
    bag("sqlite3", js=states([LEFT, RIGHT], [1, 2, 3], np.zeros((3, 2))))(file)
    next(file.glob("*.db3")).unlink()


def other_definition(file):
    """A bag whose JointState is another than the usual one."""
    bag("rosbag1", js=states([LEFT, RIGHT], [1, 2, 3], np.zeros((3, 2))))(file)
    data = file.read_bytes()
    file.write_bytes(data.replace(b"3066dcd76a6cfaef579bd0f34173e9fd", b"4066dcd76a6cfaef579bd0f34173e9fd"))


def nothing(file):
    """No file at all."""


SHEET = [["time", LEFT, RIGHT], [0.0, 0.1, 0.2], [1.0, 0.3, 0.4], [2.0, 0.5, 0.6]]


def workbook(*sheets):
    def write(file):
        import openpyxl

        book = openpyxl.Workbook()
        for k, rows in enumerate(sheets):
            sheet = book.active if k == 0 else book.create_sheet()
            for row in rows:
                sheet.append(row)
        book.save(file)

    return write


def far_cell(file):
    """A sheet whose third row is said to be the millionth, with a cell in the last column there is."""
    whole = file.with_name("whole.xlsx")
    workbook(SHEET)(whole)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename.endswith("sheet1.xml"):
                content = content.replace(b'<row r="4"', b'<row r="1048576"').replace(b'r="C4"', b'r="XFD1048576"')
                rows = b"".join(b'<row r="%d"><c r="XFD%d"><v>1</v></c></row>' % (k, k) for k in range(5, 12))
                content = content.replace(b'<row r="1048576"', rows + b'<row r="1048576"')
            new.writestr(entry, content)


def parquet(columns):
    def write(file):
        import pyarrow
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.table(columns), file)

    return write


def mat(variables, **options):
    def write(file):
        import scipy.io

        scipy.io.savemat(file, variables, **options)

    return write


def outward_links(file):
    import h5py

    with h5py.File(file, "w") as book:
        book["time"] = h5py.ExternalLink("/etc/hostname", "/time")
        book[LEFT] = h5py.SoftLink("/nowhere")


def circle(file):
    import h5py

    with h5py.File(file, "w") as book:
        book.create_group("a/b")
        book["a/b/c"] = book["a"]


def c3d_header(frames=1, place=2):
    """The first blocks of a C3D file, its parameters in the block `place`."""
    header = bytearray(1024)
    header[0], header[1], header[515] = place, 0x50, 84
    header[514] = 1
    for word, value in ((1, 20), (3, 1), (4, frames), (8, 3)):
        header[2 * word : 2 * word + 2] = value.to_bytes(2, "little")
    header[12:16] = np.float32(-1.0).tobytes()
    return bytes(header)


def cut_off(ending):
    """A good file of this kind without its second half."""

    def write(file):
        whole = file.with_name(f"whole.{ending}")
        columns = {"time": np.arange(9.0), LEFT: np.full(9, 0.1), RIGHT: np.full(9, 0.2)}
        if ending == "h5":
            import h5py

            with h5py.File(whole, "w") as book:
                for name, values in columns.items():
                    book[name] = values
        elif ending == "c3d":
            import ezc3d

            made = ezc3d.c3d()
            made["parameters"]["POINT"]["RATE"]["value"] = [60]
            made["parameters"]["POINT"]["LABELS"]["value"] = ("A",)
            made["data"]["points"] = np.ones((4, 1, 999))
            made.write(str(whole))
        else:
            {"xlsx": workbook(SHEET), "parquet": parquet(columns), "mat": mat(columns)}[ending](whole)
        data = whole.read_bytes()
        file.write_bytes(data[: len(data) // 2])

    return write


E, U, N, W = TrajectoryError, UnknownNameError, InputFileNotFoundError, TrajectoryWarning
C = UnknownColumnError
TAB = HEADER.replace(",", "\t") + ROWS.replace(",", "\t")

# What it is: (name of the file, content: text, bytes or what writes it, outcome, words of its message).
# The outcome None is a path without a warning.
ODD_FILES = {
    "good": ("m.csv", csv_text(), None, ()),
    "byte order mark": ("m.csv", "\ufeff" + csv_text(), None, ()),
    "windows lines": ("m.csv", csv_text().replace("\n", "\r\n"), None, ()),
    "old mac lines": ("m.csv", csv_text().replace("\n", "\r"), None, ()),
    "blank lines and spaces": ("m.csv", "\n\n" + csv_text().replace(",", " , ") + "\n , , \n", None, ()),
    "quoted": ("m.csv", csv_text().replace("0.1", '"0.1"').replace(LEFT, f'"{LEFT}"'), None, ()),
    "exponents": ("m.csv", csv_text(ROWS.replace("0.3", "+3.E-1")), None, ()),
    "two samples": ("m.csv", csv_text("0,0.1,0.2\n1,0.2,0.3\n"), None, ()),
    "empty": ("m.csv", "", E, ["empty"]),
    "only blank lines": ("m.csv", "\n \n\n", E, ["empty"]),
    "header alone": ("m.csv", HEADER, E, ["two samples or more are needed, got 0"]),
    "NUL bytes": ("m.csv", csv_text() + "\0", E, ["NUL", "no text"]),
    "UTF-16": ("m.csv", csv_text().encode("utf-16"), None, ()),
    "latin-1 name": ("m.csv", csv_text().encode() + b"3,0,\xb0\n", E, ["row 5", RIGHT, "'\u00b0'"]),
    "random bytes": ("m.csv", np.random.default_rng(1).bytes(3000), E, ["no text"]),
    "open quote": ("m.csv", csv_text() + '3,"0.1,0.2\n', E, ["row", "unexpected end"]),
    "no header": ("m.csv", ROWS, W, ["no header", LEFT]),
    "unnamed column": ("m.csv", csv_text("0,0,0,1\n", HEADER.strip() + ",\n"), E, ["column 4 has no name"]),
    "time twice": ("m.csv", csv_text("0,0,0,0\n", "time," + HEADER), E, ["column time stands twice"]),
    "joint twice": ("m.csv", csv_text("0,0,0,0\n", f"time,{BOTH},{LEFT}\n"), E, [f"column {LEFT} stands twice"]),
    "joint in two units": (
        "m.csv",
        f"time,{BOTH},{LEFT}_deg\n0,0,0,0\n1,0,0,0\n",
        E,
        [f"{LEFT!r} and '{LEFT}_deg' are the same joint; keep one"],
    ),
    "joint missing": ("m.csv", f"time,{LEFT}\n0,0\n1,0\n", W, [f"no column for {RIGHT}", "rests at zero"]),
    "joint unknown": ("m.csv", csv_text().replace(LEFT, "knee"), C, ["'knee'", LEFT]),
    "joint of a typing error": ("m.csv", csv_text().replace(LEFT, LEFT[:-1]), C, ["Did you mean", LEFT]),
    "a long name": ("m.csv", csv_text().replace(LEFT, "a" * 9999), E, ["name has 9999 characters"]),
    "columns twice, many": ("m.csv", "time" + ",a,b" * 99_999 + "\n", E, ["column a, b stands twice"]),
    "commas and semicolons": ("m.csv", csv_text().replace(",", ";", 1), E, ["commas and semicolons"]),
    "commas and tabs": ("m.csv", csv_text().replace(",", "\t", 1), E, ["commas and tabs"]),
    "commas in a .tsv": ("m.tsv", csv_text(), E, ["separated by tabs"]),
    "tabs": ("m.tsv", TAB, None, ()),
    "tabs in a .csv": ("m.csv", TAB, None, ()),
    "decimal commas": ("m.csv", csv_text().replace(",", ";").replace(".", ","), None, ()),
    "decimal commas and points": (
        "m.csv",
        csv_text().replace(",", ";").replace("0.1", "0,1"),
        E,
        ["row 2", LEFT, "'0,1'", "decimal point"],
    ),
    "thousands": ("m.csv", csv_text().replace("0.1", '"1,234"'), E, ["row 2", "'1,234'", "without marks of thousands"]),
    "degrees with limits at hand": ("m.csv", csv_text(ROWS + "3,0,6\n"), E, [f"{RIGHT} is at 6 rad", "degrees?"]),
    "milliseconds": ("m.csv", csv_text("".join(f"{16 * k},0,0\n" for k in range(30))), E, ["are they in ms?"]),
    "times in two columns": ("m.csv", csv_text("0,0,0,0\n1,1,0,0\n", "timestamp,t," + BOTH + "\n"), E, ["both times"]),
    "a unit of time that is none": (
        "m.csv",
        csv_text(header=HEADER.replace("time", "time [m]")),
        E,
        ["no unit of time"],
    ),
    "nothing but units": ("m.csv", csv_text("s,rad,rad\n"), E, ["two samples or more are needed, got 0"]),
    "too short a row": ("m.csv", csv_text(ROWS + "3,0\n"), E, ["row 5 has 2 entries, the header 3"]),
    "too long a row": ("m.csv", csv_text(ROWS + "3,0,0,0\n"), E, ["row 5 has 4 entries, the header 3"]),
    "empty cell": ("m.csv", csv_text(ROWS + "3,,0\n"), E, ["row 5", LEFT, "no number", "--fill"]),
    "NaN": ("m.csv", csv_text(ROWS + "3,0,NaN\n"), E, ["row 5", RIGHT, "no number", "--fill"]),
    "infinity": ("m.csv", csv_text(ROWS + "3,-inf,0\n"), E, ["row 5", LEFT, "'-inf' is no finite number"]),
    "overflow": ("m.csv", csv_text(ROWS + "3,1e400,0\n"), E, ["row 5", LEFT, "'inf'"]),
    "underscore": ("m.csv", csv_text(ROWS + "3,1_0,0\n"), E, ["row 5", LEFT, "'1_0'"]),
    "hexadecimal": ("m.csv", csv_text(ROWS + "3,0x1,0\n"), E, ["row 5", LEFT, "'0x1'"]),
    "other digits": ("m.csv", csv_text(ROWS + "3,\u0661,0\n"), E, ["row 5", LEFT]),
    "unit in a cell": ("m.csv", csv_text(ROWS + "3,1 rad,0\n"), E, ["row 5", LEFT, "'1 rad'"]),
    "code in a cell": ("m.csv", csv_text(ROWS + "3,__import__('os'),0\n"), E, ["row 5", LEFT]),
    "long cell": ("m.csv", csv_text(ROWS + "3," + "9" * 200_000 + ",0\n"), E, ["row 5", LEFT, "'inf'"]),
    "NaN time": ("m.csv", csv_text(ROWS + "nan,0,0\n"), E, ["row 5", "'time'"]),
    "time back": ("m.csv", csv_text(ROWS + "1.5,0,0\n"), E, ["row 5: time 1.5 s does not come after 2 s", "sort"]),
    "time twice in rows": ("m.csv", csv_text(ROWS + "2,0,0\n"), E, ["row 5: time 2 s", "drop repeated"]),
    "time overflows": ("m.csv", csv_text("-1e308,0,0\n1e308,0,0\n"), E, ["not distinct in double precision"]),
    "times too far": ("m.csv", csv_text("1e16,0,0\n1.0000000000000002e16,0,0\n"), W, ["resolve only", "subtract"]),
    "clock of today": ("m.csv", csv_text("1.7e9,0,0\n1700000000.01,0,0\n"), W, ["resolve only 2.4e-07 s"]),
    "gap": (
        "m.csv",
        csv_text("".join(f"{t},0,0\n" for t in (0, 0.01, 0.02, 0.03, 5))),
        W,
        ["4.97 s between row 5 and row 6", "usual step is 0.01 s", "gap"],
    ),
    "nearly the same time": (
        "m.csv",
        csv_text("".join(f"{t},0,0\n" for t in (0, 1, 2, 2.001, 3, 4))),
        W,
        ["0.001 s between row 4 and row 5", "the same sample twice?"],
    ),
    "limit broken": (
        "m.csv",
        csv_text(ROWS + "3,0,4\n4,0,3.3\n"),
        W,
        [f"row 5: joint {RIGHT} is at 4 rad, outside its limits -3.2 to 3.2", "in 2 of 5 rows"],
    ),
    "degrees": ("m.csv", csv_text(ROWS + "3,0,-90\n"), E, [f"row 5: joint {RIGHT} is at -90 rad", "degrees?"]),
    "huge angle": ("m.csv", csv_text(ROWS + "3,0,1e22\n"), E, ["row 5", RIGHT, "1e+22 rad; up to 1e+06 rad"]),
    "half a quaternion": ("m.csv", f"time,{BOTH},qx,qy,qw\n0,0,0,0,0,1\n1,0,0,0,0,1\n", E, ["without qz"]),
    "zero quaternion": ("m.csv", f"time,{BOTH},qx,qy,qz,qw\n0,0,0,0,0,0,1\n1,0,0,0,0,0,0\n", E, ["row 3", "norm 0"]),
    "huge quaternion": (
        "m.csv",
        f"time,{BOTH},qx,qy,qz,qw\n0,0,0,0,0,0,1\n1,0,0,1e300,0,0,1e300\n",
        E,
        ["row 3", "norm inf"],
    ),
    "two quaternions": (
        "m.csv",
        f"time,{BOTH},qx,qy,qz,qw,base_qx,base_qy,base_qz,base_qw\n" + "0,0,0,0,0,0,1,0,0,0,1\n1,0,0,0,0,0,1,0,0,0,1\n",
        E,
        ["stands twice"],
    ),
    "half a position": ("m.csv", f"time,{BOTH},base_x_m\n0,0,0,1\n1,0,0,1\n", E, ["without base_y, base_z"]),
    "nothing but lines": ("m.csv", b"\n" * 2_000_003, E, ["empty"]),
    "not there": ("m.csv", nothing, N, ["no such file"]),
    "a pipe": ("m.csv", os.mkfifo, N, ["no regular file"]),
    "unknown ending": ("m.docx", csv_text(), U, [".csv, .npz", ".mcap"]),
    "no ending": ("m", csv_text(), U, [".csv"]),
    "a bare folder": ("m", lambda file: file.mkdir(), E, ["without metadata.yaml"]),
    "OpenSim": ("m.mot", opensim(), None, ()),
    "OpenSim in capitals": ("m.sto", opensim().replace("endheader", "EndHeader"), None, ()),
    "SIMM": ("m.mot", opensim(header="datacolumns 3\ndatarows 2\ninDegrees=no\nrange 0 1\n"), None, ()),
    "OpenSim without an end": ("m.mot", opensim().replace("endheader", ""), E, ["no line `endheader`"]),
    "OpenSim of a table": ("m.mot", csv_text(), E, ["no line `endheader`"]),
    "OpenSim without names": ("m.mot", opensim(names="", body=""), E, ["empty", "a header"]),
    "OpenSim without units": ("m.mot", opensim(header=""), E, ["inDegrees=yes or no", "degrees=True or False"]),
    "OpenSim with odd units": ("m.mot", opensim(header="inDegrees=maybe\n"), E, ["inDegrees='maybe'"]),
    "OpenSim with both units": ("m.mot", opensim(header="inDegrees=yes\ninDegrees=no\n"), E, ["line 4", "contradicts"]),
    "OpenSim cut off": (
        "m.mot",
        opensim(body="0 1 2\n1 2 3", header="nRows=3\ninDegrees=no\n"),
        E,
        ["says 3 rows, the table has 2", "cut off"],
    ),
    "OpenSim of fewer columns": ("m.mot", opensim(header="nColumns=4\ninDegrees=no\n"), E, ["says 4 columns"]),
    "OpenSim, rows in words": ("m.mot", opensim(header="nRows=two\ninDegrees=no\n"), E, ["says two rows"]),
    "OpenSim, a cell missing": ("m.mot", opensim(body="0 1\n1 2 3\n"), E, ["line 8 has 2 entries, the header 3"]),
    "OpenSim, an empty cell": ("m.mot", opensim(body="0\t1\t\n1\t2\t3\n"), E, ["line 8 has 2 entries"]),
    "OpenSim quaternions": ("m.sto", opensim(header="DataType=Quaternion\n"), E, ["DataType=Quaternion"]),
    "OpenSim, a muscle": (
        "m.sto",
        opensim(names=f"time {LEFT} /forceset/soleus/activation\n"),
        W,
        ["no column for"],
    ),
    "OpenSim, coordinate twice": (
        "m.sto",
        opensim(names=f"time {LEFT} /jointset/a/{LEFT}/value\n"),
        E,
        [f"two columns are the coordinate {LEFT}"],
    ),
    "YAML": ("m.yaml", points(("[0, 0]", "0"), ("[1, 1]", "{secs: 1, nsecs: 5}")), None, ()),
    "YAML, empty": ("m.yaml", "", E, ["no ROS trajectory"]),
    "YAML, a word": ("m.yaml", "hello", E, ["no ROS trajectory"]),
    "YAML of something else": ("m.yaml", "a: 1\nb: [2]\n", E, ["no ROS trajectory", "joint_names"]),
    "YAML, broken": ("m.yaml", "joint_names: [a\npoints: }", E, ["no YAML", "line 2"]),
    "YAML, deep": ("m.yaml", "[" * 50_000, E, ["no YAML", "nesting depth"]),
    "YAML, deep in lines": ("m.yaml", "".join(" " * k + "a:\n" for k in range(400)), E, ["no ROS trajectory"]),
    "YAML, aliases": ("m.yaml", "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n", E, ["no ROS trajectory"]),
    "YAML, code": ("m.yaml", "!!python/object/apply:os.system ['true']\n", E, ["no YAML", "os.system", "line 1"]),
    "YAML, key twice": ("m.yaml", "joint_names: [a]\njoint_names: [b]\n", E, ["line 2: 'joint_names' stands twice"]),
    "YAML, a list as key": ("m.yaml", "? [a]\n: 1\n", E, ["a key must be a plain word"]),
    "YAML, control bytes": ("m.yaml", "a: \x01\n", E, ["no YAML"]),
    "YAML, points a mapping": ("m.yaml", "joint_names: [a]\npoints: {a: 1}\n", E, ["points: a list is needed"]),
    "YAML, a bare point": ("m.yaml", "joint_names: [a]\npoints: [1, 2]\n", E, ["point 1 has no positions"]),
    "YAML, no time": ("m.yaml", "joint_names: [a]\npoints: [{positions: [1]}]\n", E, ["point 1 has no time_from"]),
    "YAML, one time": ("m.yaml", points(("[0, 0]", "0"), ("[1, 1]", "0")), E, ["point 2: time 0 s does not"]),
    "YAML, odd time": ("m.yaml", points(("[0, 0]", "{days: 1}")), E, ["point 1: time_from_start", "nanosec"]),
    "YAML, half a second": ("m.yaml", points(("[0, 0]", "{sec: 0.5}")), E, ["a whole number is needed, got '0.5'"]),
    "YAML, many digits": ("m.yaml", points(("[0, 0]", "{sec: " + "9" * 9000 + "}")), E, ["a whole number is needed"]),
    "YAML, a late time": ("m.yaml", points(("[0, 0]", "1e300")), E, ["1e+300 s is no time"]),
    "YAML, too few positions": ("m.yaml", points(("[0]", "0"), ("[1]", "1")), E, ["point 1: 1 positions for 2 joints"]),
    "YAML, too many positions": ("m.yaml", points(("[0, 0, 0]", "0")), E, ["point 1: 3 positions for 2 joints"]),
    "YAML, not a number": ("m.yaml", points(("[0, .nan]", "0")), E, ["point 1 (line 3)", RIGHT, "'.nan'"]),
    "YAML, names nested": ("m.yaml", points(("[0, 0]", "0"), names="[[a]]"), E, ["joint_names: a list of joint"]),
    "YAML, joint twice": ("m.yaml", points(("[0, 0]", "0"), names=f"[{LEFT}, {LEFT}]"), E, [f"{LEFT} stands twice"]),
    "YAML, other joints": ("m.yaml", points(("[0, 0]", "0"), ("[0, 0]", "1"), names=f"[{LEFT}, on]"), C, ["'on'"]),
    "YAML, two trajectories": (
        "m.yaml",
        points(("[0, 0]", "0")) + "---\n" + points(("[0, 0]", "1")),
        E,
        ["2 trajectories, and number 1 has no time"],
    ),
    "YAML, mixed messages": ("m.yaml", points(("[0, 0]", "0")) + "---\nname: [a]\nposition: [1]\n", E, ["are mixed"]),
    "YAML, echo cut short": (
        "m.yaml",
        f"header: {{stamp: {{sec: 1, nanosec: 0}}}}\nname: [{LEFT}, {RIGHT}]\nposition: [0.1, '...']\n",
        E,
        ["message 1 (line 3)", RIGHT, "'...'"],
    ),
    "YAML, states without times": ("m.yaml", f"name: [{LEFT}]\nposition: [0.1]\n", E, ["have no times"]),
    "NPZ": ("m.npz", npz_bytes(**GOOD_ARRAYS), None, ()),
    "NPZ, no archive": ("m.npz", b"PK\x03\x04 nothing", E, ["no NPZ file"]),
    "NPZ, cut off": ("m.npz", npz_bytes(**GOOD_ARRAYS)[:-30], E, ["no NPZ file"]),
    "NPZ, an array twice": ("m.npz", doubled_member, E, ["stands twice"]),
    "NPZ of objects": (
        "m.npz",
        npz_bytes(**GOOD_ARRAYS | {"shapes": np.array([{}, []], dtype=object)}),
        E,
        ["Python objects, which can run code"],
    ),
    "NPZ without times": ("m.npz", npz_bytes(shapes=[[0.0]], joint_names=["a"]), E, ["no column `time`", "timestep"]),
    "NPZ, complex": ("m.npz", npz_bytes(**GOOD_ARRAYS | {"shapes": np.ones((3, 2), complex)}), E, [LEFT, "(1+0j)"]),
    "NPZ, true and false": (
        "m.npz",
        npz_bytes(**GOOD_ARRAYS | {"shapes": np.ones((3, 2), bool)}),
        E,
        [LEFT, "'True' is no finite number"],
    ),
    "NPZ, text": ("m.npz", npz_bytes(**GOOD_ARRAYS | {"time": ["a", "b", "c"]}), E, ["no column `time`"]),
    "NPZ, one axis": ("m.npz", npz_bytes(**GOOD_ARRAYS | {"shapes": [1.0, 2.0, 3.0]}), C, ["'shapes'"]),
    "NPZ, three axes": (
        "m.npz",
        npz_bytes(**GOOD_ARRAYS | {"shapes": np.ones((1, 3, 2))}),
        E,
        ["shapes", "(1, 3, 2)", "joint_names"],
    ),
    "NPZ, NaN": (
        "m.npz",
        npz_bytes(**GOOD_ARRAYS | {"shapes": [[0, 0], [0, NAN], [0, 0]]}),
        E,
        [RIGHT, "sample 1"],
    ),
    "NPZ, numbers as names": ("m.npz", npz_bytes(**GOOD_ARRAYS | {"joint_names": [1, 2]}), E, ["joint_names 2"]),
    "NPZ, name twice": ("m.npz", npz_bytes(**GOOD_ARRAYS | {"joint_names": ["a", "a"]}), E, ["stands twice"]),
    "NPZ, big-endian": (
        "m.npz",
        npz_bytes(**{k: np.array(v, dtype=">f8") if k != "joint_names" else v for k, v in GOOD_ARRAYS.items()}),
        None,
        (),
    ),
    "NPZ, base of another length": (
        "m.npz",
        npz_bytes(**GOOD_ARRAYS, base_quat_xyzw=np.ones((2, 4))),
        E,
        ["base_qx 2"],
    ),
    "qpos of another width": (
        "m.npz",
        npz_bytes(qpos=np.zeros((3, 5)), time=[0, 1, 2]),
        E,
        ["shape (3, 5)", "9 numbers", "alone (2)"],
    ),
    "qpos of another length": ("m.npz", npz_bytes(qpos=np.zeros((3, 2)), time=[0, 1]), E, ["2 times"]),
    "qpos without times": ("m.npz", npz_bytes(qpos=np.zeros((3, 2))), E, ["the times of qpos", "none is there"]),
    "qpos of no step": ("m.npz", npz_bytes(qpos=np.zeros((3, 2)), timestep=0.0), E, ["one number above 0"]),
    "qpos and shapes": ("m.npz", npz_bytes(**GOOD_ARRAYS, qpos=np.zeros((3, 2))), E, ["keep one"]),
    "qpos, scalar last": (
        "m.npz",
        npz_bytes(qpos=np.tile([0, 0, 0, 2.0, 0, 0, 1, 0, 0], (3, 1)), timestep=0.1),
        E,
        ["quaternion w x y z of length 1"],
    ),
    "NPY of objects": (
        "m.npy",
        npy_header("{'descr': '|O', 'fortran_order': False, 'shape': ()}"),
        E,
        ["Python objects, which can run code"],
    ),
    "NPY promising too much": (
        "m.npy",
        npy_header("{'descr': '<f8', 'fortran_order': False, 'shape': (900000000000, 2), }"),
        E,
        ["no array that can be read"],
    ),
    "NPY, code as header": ("m.npy", npy_header("__import__('os').getcwd()"), E, ["no array that can be read"]),
    "NPY, nested header": ("m.npy", npy_header("(" * 5000), E, ["no array that can be read"]),
    "NPY, empty": ("m.npy", b"", E, ["no array that can be read"]),
    "markers": ("m.trc", "PathFileType\t4\n", E, [".trc files are not read", "inverse kinematics"]),
    "a skeleton": ("m.bvh", "HIERARCHY\n", E, ["a BVH file moves the skeleton of its own", "table of joint angles"]),
    "an older workbook": ("m.xls", b"\xd0\xcf\x11\xe0", E, ["save it as .xlsx"]),
    **{
        f"{kind}, {how}": (f"m.{ending}", content, E, [name])
        for kind, ending, name in (
            ("workbook", "xlsx", "no workbook that can be read"),
            ("Parquet", "parquet", "no Parquet file that can be read"),
            ("MATLAB", "mat", "no MATLAB file that can be read"),
            ("HDF5", "h5", "no HDF5 file that can be read"),
            ("C3D", "c3d", "file"),
        )
        for how, content in (
            ("empty", b""),
            ("a text", csv_text()),
            ("bytes at random", np.random.default_rng(2).bytes(5000)),
            ("cut off", cut_off(ending)),
        )
    },
    "workbook, empty": ("m.xlsx", workbook(), E, ["empty; a row `time"]),
    "workbook, two sheets": ("m.xlsx", workbook(SHEET, SHEET), E, ["several sheets have cells", "topic=", "Sheet1"]),
    "workbook, a text": ("m.xlsx", workbook([*SHEET, [3, "fell", 0]]), E, ["row 5", LEFT, "'fell' is no finite"]),
    "workbook, a hole": ("m.xlsx", workbook([*SHEET, [3, None, 0]]), E, ["row 5", LEFT, "--fill"]),
    "workbook, a truth": ("m.xlsx", workbook([*SHEET, [3, True, 0]]), E, ["row 5", LEFT, "'True' is no finite"]),
    "workbook, a formula": ("m.xlsx", workbook([*SHEET, [3, "=1/0", 0]]), E, ["row 5", LEFT, "--fill"]),
    "workbook, beside its names": ("m.xlsx", workbook([*SHEET, [3, 0, 0, 1]]), E, ["row 5", "column 4, which has no"]),
    "workbook, a far cell": ("m.xlsx", far_cell, E, ["has no name"]),
    "workbook, a number as name": ("m.xlsx", workbook([["time", 7, RIGHT], [0, 0, 0]]), E, ["two samples"]),
    "workbook": ("m.xlsx", workbook(SHEET), None, ()),
    "Parquet, texts": ("m.parquet", parquet({"time": [0.0, 1.0], LEFT: ["a", "b"], RIGHT: [0.0, 0.0]}), E, ["'a' is"]),
    "Parquet, holes": (
        "m.parquet",
        parquet({"time": [0.0, 1.0], LEFT: [0.0, None], RIGHT: [0.0, 0.0]}),
        E,
        ["sample 1"],
    ),
    "Parquet, lists": ("m.parquet", parquet({"time": [0.0, 1.0], LEFT: [[1.0], []], RIGHT: [0.0, 0.0]}), E, [LEFT]),
    "MATLAB, nothing": ("m.mat", mat({}), E, ["no motion", "there is nothing"]),
    "MATLAB, no times": ("m.mat", mat({LEFT: [0.0, 1.0], RIGHT: [0.0, 1.0]}), E, ["no column `time`", "timestep"]),
    "MATLAB, several lengths": ("m.mat", mat({"time": [0.0, 1.0], LEFT: [0.0, 1.0, 2.0]}), E, ["different lengths"]),
    "MATLAB, complex": ("m.mat", mat({"time": [0.0, 1.0], LEFT: [1j, 1.0], RIGHT: [0.0, 1.0]}), E, ["complex"]),
    "MATLAB, two structures": ("m.mat", mat({"a": {"t": [0.0, 1.0]}, "b": {"t": [0.0, 1.0]}}), E, ["topic=: a, b"]),
    "MATLAB, names of others": (
        "m.mat",
        mat({"data": np.zeros((3, 2)), "names": np.array(["a", "b", "c"], dtype=object)}),
        E,
        ["data has 2 columns, and there are 3 names"],
    ),
    "HDF5, links that lead out": ("m.h5", outward_links, E, ["no motion", "nothing"]),
    "HDF5, a circle": ("m.h5", circle, E, ["no motion"]),
    "C3D, frames that are not there": ("m.c3d", c3d_header(frames=60_000), E, ["promises 60000 frames", "cut off"]),
    "C3D, parameters beyond the end": ("m.c3d", c3d_header(place=200), E, ["its header is damaged"]),
    "bag, no bag": ("m.bag", b"#ROSBAG V2.0\n" + bytes(50), E, ["no bag that can be read"]),
    "bag, empty": ("m.bag", b"", E, ["no bag that can be read"]),
    "bag, cut off": ("m.bag", cut_bag, E, ["no bag that can be read"]),
    "bag, other definition": ("m.bag", other_definition, E, ["not the usual definition of sensor_msgs/msg/JointState"]),
    "MCAP, no MCAP": ("m.mcap", b"\x89MCAP0\r\n" + bytes(50), E, ["no bag that can be read"]),
    "SQLite, no database": ("m.db3", b"SQLite format 3\0" + bytes(50), E, ["no bag that can be read"]),
    "rosbag2, metadata of nothing": (
        "m",
        lambda file: (file.mkdir(), (file / "metadata.yaml").write_text("a: 1")),
        E,
        ["no bag that can be read", "metadata"],
    ),
    "rosbag2 without its storage": ("m", without_storage, E, ["no bag that can be read", "missing"]),
    "bag without motions": ("m", no_motion, E, ["no topic of type", "/chatter (std_msgs/msg/String)"]),
    "bag of no messages": ("m", bag(js=states([], [], [])), E, ["two samples or more are needed, got 0"]),
    "bag, a joint now and then": ("m", partial, E, ["message 2", f"no {LEFT} at this time", "topic="]),
    "bag, a time twice": (
        "m",
        bag(js=states([LEFT, RIGHT], [10**9, 10**9], np.zeros((2, 2)))),
        E,
        [f"message 2: joint {LEFT} stands twice at one time"],
    ),
    "bag, times back": (
        "m",
        bag(js=states([LEFT, RIGHT], [2 * 10**9, 10**9], np.zeros((2, 2)))),
        E,
        ["message 2: time -1 s does not come after 0 s"],
    ),
    "bag, a header without time": (
        "m",
        bag(js=states([LEFT, RIGHT], [10**9, 0, 2 * 10**9], np.zeros((3, 2)))),
        E,
        ["message 2 has no time in its header"],
    ),
    "bag, positions of no names": (
        "m",
        bag(js=states([LEFT], [1, 2], np.zeros((2, 2)))),
        E,
        ["1 joints and 2"],
    ),
    "bag, NaN": (
        "m",
        bag(js=states([LEFT, RIGHT], [1, 2, 3], [[0, 0], [0, NAN], [0, 0]])),
        E,
        [f"message 2: joint {RIGHT} is nan"],
    ),
    "bag, points of another length": ("m", bag(jt=trajectory([LEFT, RIGHT], [0, 1], np.zeros((2, 1)))), E, ["point 1"]),
    "bag, two topics": (
        "m",
        bag(a=states([LEFT, RIGHT], [1, 2], np.zeros((2, 2))), b=states([LEFT, RIGHT], [1, 2], np.zeros((2, 2)))),
        E,
        ["choose one with topic=: /a", "/b"],
    ),
}


def odd_file(case, folder):
    """One of `ODD_FILES`, written."""
    name, content, _, _ = ODD_FILES[case]
    file = folder / name
    if isinstance(content, str):
        file.write_text(content, encoding="utf-8", newline="")
    elif isinstance(content, bytes):
        file.write_bytes(content)
    elif content is doubled_member:
        file.write_bytes(content())
    else:
        content(file)
    return file
