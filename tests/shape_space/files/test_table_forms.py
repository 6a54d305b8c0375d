"""One motion as programs write it: every form of a table, each read without a word of option where none is given here.

The body has two wheels with their centres of mass on their axes along y, in one plane with that of the trunk. Its
inertia about y is constant, y a principal axis, and
without angular momentum it turns about y by -(I_a q_a + I_l q_l)/I: the attitude in the files and the turn that is
computed of what was read are compared with that.
"""

from __future__ import annotations

import csv
import gzip
import io
import json
import warnings

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import ShapePhaseError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files import read_recorded_motion, read_table

MASSES, WHEELS = (30.0, 4.0, 6.0), (0.11, 0.23)
PLACES = ((0.0, 0.0, 0.2), (0.1, 0.0, -0.3))
TRUNK = 1.3
URDF = (
    f"""<robot name="two"><link name="torso"><inertial><mass value="{MASSES[0]}"/>
<inertia ixx="1.5" iyy="{TRUNK}" izz="0.4" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
    + "".join(
        f"""<joint name="{name}" type="continuous"><parent link="torso"/><child link="{name}_link"/>
<origin xyz="{" ".join(map(str, place))}"/><axis xyz="0 1 0"/></joint><link name="{name}_link"><inertial>
<mass value="{mass}"/><inertia ixx="0.2" iyy="{wheel}" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
        for name, place, mass, wheel in zip(("arm", "leg"), PLACES, MASSES[1:], WHEELS, strict=True)
    )
    + "</robot>"
)
COUNT = 41
T = np.arange(COUNT) * 0.02
ARM, LEG = 0.8 * np.sin(2.0 * T) + 0.3 * T, 0.5 * np.cos(3.0 * T) - 0.2 * T
JOINTS = np.stack([ARM, LEG], axis=1)
_PLANE = np.array([[0.0, 0.0], *([place[0], place[2]] for place in PLACES)])
_CENTRE = np.average(_PLANE, axis=0, weights=MASSES)
INERTIA = TRUNK + sum(WHEELS) + float(np.sum(MASSES * np.sum((_PLANE - _CENTRE) ** 2, axis=1)))
TURN = -(WHEELS[0] * ARM + WHEELS[1] * LEG) / INERTIA
BASE = Rotation.from_euler("y", TURN[:, None])
XYZW = BASE.as_quat()
WXYZ = np.roll(XYZW, 1, axis=1)
PLACE = np.stack([0.1 * T, 0.2 - 0.05 * T, 1.0 + T - 4.905 * T**2], axis=1)
START = 1_700_000_000
ROWS = np.column_stack([T, JOINTS])
NAMES = ["time", "arm", "leg"]
FRAME = pd.DataFrame(ROWS, columns=NAMES)
RECORDS = FRAME.to_dict(orient="records")
LINES = "\n".join(map(json.dumps, RECORDS))
NESTED_LINES = "\n".join(json.dumps({"time": row.pop("time"), "joints": row}) for row in map(dict, RECORDS)) + "\n\n"
DEG = np.degrees(JOINTS)
NS = START * 10**9 + 20_000_000 * np.arange(COUNT)
STAMPS = pd.to_datetime(NS, unit="ns")


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    file = tmp_path_factory.mktemp("two") / "two.urdf"
    file.write_text(URDF)
    return sp.load_body(file)


def lines(header, columns, mark=",", text=repr):
    rows = [mark.join(text(v) if isinstance(v, float) else str(v) for v in row) for row in zip(*columns, strict=True)]
    return "\n".join(([header] if header is not None else []) + rows) + "\n"


def floats(*columns):
    return [np.asarray(column, dtype=float).tolist() for column in columns]


def table(names, *columns, mark=","):
    return lines(mark.join(names), floats(*columns), mark)


def saved(**options):
    text = io.StringIO()
    np.savetxt(text, ROWS, fmt="%.17g", **options)
    return text.getvalue()


def written(quoting):
    text = io.StringIO()
    writer = csv.writer(text, quoting=quoting)
    writer.writerow(NAMES)
    writer.writerows(ROWS.tolist())
    return text.getvalue()


def r_csv(mark=",", comma=False):
    """`write.csv` and `write.csv2` of R: names and row names in quotation marks."""
    rows = [
        [f'"{k + 1}"', *(repr(v).replace(".", ",") if comma else repr(v) for v in row)]
        for k, row in enumerate(ROWS.tolist())
    ]
    return mark.join(['""', '"time"', '"arm"', '"leg"']) + "\n" + "\n".join(map(mark.join, rows)) + "\n"


def r_table():
    """`write.table` of R: row names have no name above them."""
    rows = [" ".join([f'"{k + 1}"', *map(repr, row)]) for k, row in enumerate(ROWS.tolist())]
    return "\n".join(['"time" "arm" "leg"', *rows]) + "\n"


def nexus(mark):
    """The export of model outputs of Vicon Nexus: kind, rate, names, axes, units."""
    head = ["Model Outputs", "50", mark.join(["", "", "Bob:Arm", "", "", "Bob:Leg", "", ""])]
    head += [mark.join(["Frame", "Sub Frame", *"XYZXYZ"]), mark.join(["", "", *["deg"] * 6])]
    zero = np.zeros(COUNT)
    columns = [list(range(1, COUNT + 1)), [0] * COUNT, *floats(DEG[:, 0], zero, zero, DEG[:, 1], zero, zero)]
    return "\n".join(head) + "\n" + lines(None, columns, mark)


def opensim(mark=" ", tail="", title="Coordinates"):
    head = [title, "version=1", f"nRows={COUNT}", "nColumns=3", "inDegrees=yes", "endheader"]
    return "\n".join(line + tail for line in head) + "\n" + table(NAMES, T, *DEG.T, mark=mark)


def states(*names):
    head = ["states", "version=3", "OpenSimVersion=4.5", "inDegrees=no", "DataType=double", "endheader"]
    active = np.full(COUNT, 0.05)
    return "\n".join(head) + "\n" + table(["time", *names], T, ARM, np.gradient(ARM, T), LEG, active, mark="\t")


def rostopic():
    """`rostopic echo -p /joint_states`."""
    parts = [f"field.{kind}{k}" for kind in ("name", "position", "velocity", "effort") for k in (0, 1)]
    header = ",".join(["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", *parts])
    zero = [0.0] * COUNT
    columns = [NS.tolist(), list(range(COUNT)), NS.tolist(), ["base"] * COUNT, ["leg"] * COUNT, ["arm"] * COUNT]
    return lines(header, [*columns, *floats(LEG, ARM), zero, zero, zero, zero])


def ros2(frame, *columns):
    """`ros2 topic echo --csv`: seconds, nanoseconds, frame and the fields, without a header."""
    return lines(None, [(NS // 10**9).tolist(), (NS % 10**9).tolist(), [frame] * COUNT, *columns])


def workbook(*more):
    def write(file):
        import openpyxl

        book = openpyxl.Workbook()
        for row in [NAMES, *more, *ROWS.tolist()]:
            book.active.append(row)
        book.save(file)

    return write


def text(content, encoding="utf-8"):
    return lambda file: file.write_bytes(content.encode(encoding))


EXACT, NINE = 1e-12, 6e-9
UNIX_S = np.round(NS / 1e9, 2)
STEPS = 3e-6
"""Two hundred nanoseconds, what a double has of seconds since 1970, of steps of 20 ms: times 1/s of the joints."""

# What it is -> (file or None, what writes it or makes it, options, how exact the joints are).
TABLES = {
    "pandas to_csv": ("m.csv", text(FRAME.to_csv()), {}, EXACT),
    "pandas to_csv without an index": ("m.csv", text(FRAME.to_csv(index=False)), {}, EXACT),
    "pandas to_csv, the time as index": ("m.csv", text(FRAME.set_index("time").to_csv()), {}, EXACT),
    "pandas to_csv, times as an index without a name": (
        "m.csv",
        text(pd.DataFrame(JOINTS, columns=NAMES[1:], index=T).to_csv()),
        {},
        EXACT,
    ),
    "pandas to_csv, dates as index": (
        "m.csv",
        text(pd.DataFrame(JOINTS, columns=NAMES[1:], index=pd.Index(STAMPS, name="time")).to_csv()),
        {},
        EXACT,
    ),
    "pandas to_csv, German": ("m.csv", text(FRAME.to_csv(index=False, sep=";", decimal=",")), {}, EXACT),
    "pandas to_csv, tabs": ("m.tsv", text(FRAME.to_csv(index=False, sep="\t")), {}, EXACT),
    "pandas to_csv, packed": (
        "m.csv.gz",
        lambda file: file.write_bytes(gzip.compress(FRAME.to_csv(index=False).encode())),
        {},
        EXACT,
    ),
    "pandas to_csv, nine digits": ("m.csv", text(FRAME.to_csv(index=False, float_format="%.9g")), {}, NINE),
    "pandas to_csv of an array": ("m.csv", text(pd.DataFrame(ROWS).to_csv()), {}, EXACT),
    "pandas to_csv of an array, no index": ("m.csv", text(pd.DataFrame(ROWS).to_csv(index=False)), {}, EXACT),
    "NumPy savetxt with a header": ("m.txt", text(saved(header="time arm leg")), {}, EXACT),
    "NumPy savetxt, commas": ("m.csv", text(saved(header="time,arm,leg", delimiter=",")), {}, EXACT),
    "NumPy savetxt, no hash": ("m.csv", text(saved(header="time,arm,leg", delimiter=",", comments="")), {}, EXACT),
    "NumPy savetxt without a header": ("m.txt", text(saved()), {}, EXACT),
    "NumPy savetxt, names in Python": ("m.csv", text(saved(delimiter=",")), {"names": NAMES}, EXACT),
    "NumPy savetxt, numbers named": ("m.csv", text(saved()), {"names": {"1": "time", "2": "arm", "3": "leg"}}, EXACT),
    "csv, all quoted": ("m.csv", text(written(csv.QUOTE_ALL)), {}, EXACT),
    "csv, texts quoted": ("m.csv", text(written(csv.QUOTE_NONNUMERIC)), {}, EXACT),
    "R write.csv": ("m.csv", text(r_csv()), {}, EXACT),
    "R write.csv2": ("m.csv", text(r_csv(";", comma=True)), {}, EXACT),
    "R write.table without row names": (
        "m.txt",
        text(table(['"time"', '"arm"', '"leg"'], *ROWS.T, mark=" ")),
        {},
        EXACT,
    ),
    "R write.table": ("m.txt", text(r_table()), {}, EXACT),
    "pandas to_string": ("m.txt", text(FRAME.to_string(float_format=lambda value: repr(float(value)))), {}, EXACT),
    "MATLAB writematrix": ("m.csv", text(lines(None, floats(*ROWS.T))), {}, EXACT),
    "MATLAB save -ascii": ("m.txt", text(lines(None, floats(*ROWS.T), "   ", "   {:.16e}".format)), {}, EXACT),
    "a header behind %": ("m.txt", text("% " + table(NAMES, *ROWS.T, mark="\t")), {}, EXACT),
    "bars": ("m.csv", text(table(NAMES, *ROWS.T, mark="|")), {}, EXACT),
    "comments above": ("m.csv", text("# made by us\n# at noon, with a pen\n" + table(NAMES, *ROWS.T)), {}, EXACT),
    "a comment, then no header": ("m.csv", text("# 50 Hz\n" + lines(None, floats(*ROWS.T))), {}, EXACT),
    "a separator that is said": ("m.csv", text("sep=;\n" + table(NAMES, *ROWS.T, mark=";")), {}, EXACT),
    "separators at the ends": ("m.csv", text(table(NAMES, *ROWS.T).replace("\n", ",\n")), {}, EXACT),
    "separators at the ends of rows": (
        "m.csv",
        text(table(NAMES, *ROWS.T).replace("\n", ",\n").replace(",\n", "\n", 1)),
        {},
        EXACT,
    ),
    "blank lines and blanks": ("m.csv", text("\n" + table(NAMES, *ROWS.T).replace(",", " , ") + "\n\n"), {}, EXACT),
    "a row of units": ("m.csv", text(table(NAMES, *ROWS.T).replace("leg\n", "leg\n[s],[rad],[rad]\n", 1)), {}, EXACT),
    "units in labels": ("m.csv", text(table(["Time [ms]", "arm (deg)", "leg_deg"], 1e3 * T, *DEG.T)), {}, EXACT),
    "whole milliseconds since 1970": (
        "m.csv",
        text(lines("timestamp,arm,leg", [(NS // 10**6).tolist(), *floats(*JOINTS.T)])),
        {},
        EXACT,
    ),
    "whole microseconds since 1970": (
        "m.csv",
        text(lines("timestamp,arm,leg", [(NS // 10**3).tolist(), *floats(*JOINTS.T)])),
        {},
        EXACT,
    ),
    "whole nanoseconds since 1970": (
        "m.csv",
        text(lines("timestamp,arm,leg", [NS.tolist(), *floats(*JOINTS.T)])),
        {},
        EXACT,
    ),
    "dates with a zone": (
        "m.csv",
        text(lines("time,arm,leg", [[f"{s.isoformat()}Z" for s in STAMPS], *floats(*JOINTS.T)])),
        {},
        EXACT,
    ),
    "dates without one": (
        "m.csv",
        text(lines("Timestamp,arm,leg", [[str(s) for s in STAMPS], *floats(*JOINTS.T)])),
        {},
        EXACT,
    ),
    "times of day": (
        "m.csv",
        text(lines("time,arm,leg", [[s.strftime("%H:%M:%S.%f") for s in STAMPS], *floats(*JOINTS.T)])),
        {},
        EXACT,
    ),
    "UTF-16, as Excel's Unicode text": ("m.txt", text(table(NAMES, *ROWS.T, mark="\t"), "utf-16"), {}, EXACT),
    "Latin-1": ("m.csv", text(table(["time", "arm [°]", "leg [°]"], T, *DEG.T), "latin-1"), {}, EXACT),
    "a byte order mark": ("m.csv", text("\ufeff" + table(NAMES, *ROWS.T)), {}, EXACT),
    "lines of Windows": ("m.csv", text(table(NAMES, *ROWS.T).replace("\n", "\r\n")), {}, EXACT),
    "lines of an old Mac": ("m.csv", text(table(NAMES, *ROWS.T).replace("\n", "\r")), {}, EXACT),
    "Excel": ("m.xlsx", workbook(), {}, EXACT),
    "Excel, units": ("m.xlsx", workbook(["s", "rad", "rad"]), {}, EXACT),
    "Parquet": ("m.parquet", FRAME.to_parquet, {}, EXACT),
    "Parquet, the time as index": ("m.parquet", FRAME.set_index("time").to_parquet, {}, EXACT),
    "Feather": ("m.feather", FRAME.to_feather, {}, EXACT),
    "JSON lines": ("m.jsonl", lambda file: file.write_text(LINES), {}, EXACT),
    "JSON lines, objects within": ("m.ndjson", lambda file: file.write_text(NESTED_LINES), {}, EXACT),
    "a frame": (None, lambda: FRAME, {}, EXACT),
    "a frame, times as index": (None, lambda: pd.DataFrame(JOINTS, columns=NAMES[1:], index=T), {}, EXACT),
    "a frame of two levels": (
        None,
        lambda: pd.DataFrame({("time", ""): T, ("arm", "position"): ARM, ("leg", "position"): LEG}),
        {},
        EXACT,
    ),
    "a frame of read_table": ("m.txt", text(saved(header="time arm leg")), {"by": read_table}, EXACT),
    "a dict of arrays": (None, lambda: {"time": T, "arm": ARM, "leg": LEG}, {}, EXACT),
    "times, array and names": (None, lambda: (T, JOINTS, NAMES[1:]), {}, EXACT),
    "xarray": (None, lambda: xr.Dataset({"arm": ("time", ARM), "leg": ("time", LEG)}, coords={"time": T}), {}, EXACT),
    "Vicon Nexus": (
        "m.csv",
        text(nexus(",")),
        {"names": {"Arm_x": "arm", "Leg_x": "leg"}, "ignore_extra": True},
        EXACT,
    ),
    "Vicon Nexus, tabs": (
        "m.txt",
        text(nexus("\t")),
        {"names": {"Arm_x": "arm", "Leg_x": "leg"}, "ignore_extra": True},
        EXACT,
    ),
    "OpenSim": ("m.mot", text(opensim()), {}, EXACT),
    "OpenSim, saved by a spreadsheet": ("m.csv", text(opensim(",", ",,")), {}, EXACT),
    "OpenSim of states": (
        "m.sto",
        text(
            states(
                "/jointset/a/arm/value", "/jointset/a/arm/speed", "/jointset/a/leg/value", "/forceset/soleus/activation"
            )
        ),
        {},
        EXACT,
    ),
    "OpenSim 3 of states": ("m.sto", text(states("arm", "arm_u", "leg", "soleus.activation")), {}, EXACT),
    "PlotJuggler": (
        "m.csv",
        text(table(["__time", "/joint_states/arm/position", "/joint_states/leg/position"], UNIX_S, *JOINTS.T)),
        {},
        STEPS,
    ),
    "PlotJuggler with velocities": (
        "m.csv",
        text(
            table(
                [
                    "__time",
                    "/joint_states/arm/position",
                    "/joint_states/arm/velocity",
                    "/joint_states/leg/position",
                    "/joint_states/leg/effort",
                ],
                T,
                ARM,
                0 * T,
                LEG,
                0 * T,
            )
        ),
        {},
        EXACT,
    ),
    "rostopic echo -p": ("m.csv", text(rostopic()), {}, EXACT),
    "ros2 topic echo --csv": (
        "m.csv",
        text(ros2("base", ["arm"] * COUNT, ["leg"] * COUNT, *floats(ARM, LEG, *[0 * T] * 4))),
        {},
        EXACT,
    ),
    "seconds and nanoseconds": (
        "m.csv",
        text(
            lines(
                "header.stamp.sec,header.stamp.nanosec,arm,leg",
                [(NS // 10**9).tolist(), (NS % 10**9).tolist(), *floats(ARM, LEG)],
            )
        ),
        {},
        EXACT,
    ),
    "_pos and _vel": (
        "m.csv",
        text(table(["time", "arm_pos", "arm_vel", "leg_pos", "leg_vel"], T, ARM, 0 * T, LEG, 0 * T)),
        {},
        EXACT,
    ),
    "position.arm": (
        "m.csv",
        text(table(["time", "position.arm", "position.leg", "velocity.arm"], T, ARM, LEG, 0 * T)),
        {},
        EXACT,
    ),
    "rates with their units": (
        "m.csv",
        text(table([*NAMES, "gyro [rad/s]", "motor (Nm)"], *ROWS.T, 0 * T, 0 * T)),
        {},
        EXACT,
    ),
    "texts and counters": (
        "m.csv",
        text(lines("Frame,time,arm,leg,phase", [list(range(7, COUNT + 7)), *floats(*ROWS.T), ["flight"] * COUNT])),
        {},
        EXACT,
    ),
}

POSE = ["x", "y", "z"]
MRP = np.tan(TURN / 4.0)[:, None] * [0.0, 1.0, 0.0]
SHADOW = np.where(np.arange(COUNT)[:, None] % 2, -MRP / np.maximum(np.sum(MRP**2, axis=1, keepdims=True), 1e-9), MRP)
EULER = BASE.as_euler("ZYX")[:, ::-1]
EUROC = [
    "#timestamp",
    " p_RS_R_x [m]",
    " p_RS_R_y [m]",
    " p_RS_R_z [m]",
    " q_RS_w []",
    " q_RS_x []",
    " q_RS_y []",
    " q_RS_z []",
    " v_RS_R_x [m s^-1]",
    " b_w_RS_S_x [rad s^-1]",
]
ALONE = {"rest_missing": True}
W_FIRST = {"names": {"5": "base_qw", "6": "base_qx", "7": "base_qy", "8": "base_qz"}}

# What it is -> (file, content, options, whether joints are there, too).
POSES = {
    "TUM": ("m.txt", lines(None, floats(T, *PLACE.T, *XYZW.T), " "), ALONE, False),
    "TUM with its header": (
        "m.tum",
        "# timestamp tx ty tz qx qy qz qw\n" + lines(None, floats(T, *PLACE.T, *XYZW.T), " "),
        ALONE,
        False,
    ),
    "EuRoC": ("m.csv", lines(",".join(EUROC), [NS.tolist(), *floats(*PLACE.T, *WXYZ.T, 0 * T, 0 * T)]), ALONE, False),
    "tx ty tz": (
        "m.csv",
        table([*NAMES, "tx", "ty", "tz", "qx", "qy", "qz", "qw"], *ROWS.T, *PLACE.T, *XYZW.T),
        {},
        True,
    ),
    "x y z": ("m.csv", table([*NAMES, *POSE, "qw", "qx", "qy", "qz"], *ROWS.T, *PLACE.T, *WXYZ.T), {}, True),
    "pose.position.x": (
        "m.csv",
        table(
            [*NAMES, *(f"pose.position.{c}" for c in "xyz"), *(f"pose.orientation.{c}" for c in "xyzw")],
            *ROWS.T,
            *PLACE.T,
            *XYZW.T,
        ),
        {},
        True,
    ),
    "PlotJuggler's odometry": (
        "m.csv",
        table(
            [
                "__time",
                "/joint_states/arm/position",
                "/joint_states/leg/position",
                *(f"/odom/pose/pose/position/{c}" for c in "xyz"),
                *(f"/odom/pose/pose/orientation/{c}" for c in "wxyz"),
            ],
            *ROWS.T,
            *PLACE.T,
            *WXYZ.T,
        ),
        {},
        True,
    ),
    "base_pos_x": (
        "m.csv",
        table(
            [*NAMES, *(f"base_pos_{c}" for c in "xyz"), *(f"base_quat_{c}" for c in "wxyz")], *ROWS.T, *PLACE.T, *WXYZ.T
        ),
        {},
        True,
    ),
    "q0 to q3": ("m.csv", table([*NAMES, *POSE, "q0", "q1", "q2", "q3"], *ROWS.T, *PLACE.T, *WXYZ.T), {}, True),
    "q[0] to q[3]": (
        "m.csv",
        table([*NAMES, *POSE, "q[0]", "q[1]", "q[2]", "q[3]"], *ROWS.T, *PLACE.T, *WXYZ.T),
        {},
        True,
    ),
    "MRPs of Basilisk": (
        "m.csv",
        table(
            [*NAMES, "r_BN_N_1", "r_BN_N_2", "r_BN_N_3", "sigma_BN_1", "sigma_BN_2", "sigma_BN_3"],
            *ROWS.T,
            *PLACE.T,
            *MRP.T,
        ),
        {},
        True,
    ),
    "MRPs, their shadows": (
        "m.csv",
        table([*NAMES, *POSE, "sigma_BN[0]", "sigma_BN[1]", "sigma_BN[2]"], *ROWS.T, *PLACE.T, *SHADOW.T),
        {},
        True,
    ),
    "rotation vectors": (
        "m.csv",
        table([*NAMES, *POSE, "rotvec_x", "rotvec_y", "rotvec_z"], *ROWS.T, *PLACE.T, *BASE.as_rotvec().T),
        {},
        True,
    ),
    "rotation vectors in degrees": (
        "m.csv",
        table(
            [*NAMES, *POSE, "rotvec_x_deg", "rotvec_y_deg", "rotvec_z_deg"],
            *ROWS.T,
            *PLACE.T,
            *BASE.as_rotvec(degrees=True).T,
        ),
        {},
        True,
    ),
    "roll pitch yaw": (
        "m.csv",
        table([*NAMES, *POSE, "roll", "pitch", "yaw"], *ROWS.T, *PLACE.T, *EULER.T),
        {"base_order": "zyx"},
        True,
    ),
    "roll pitch yaw in degrees": (
        "m.csv",
        table([*NAMES, *POSE, "roll [deg]", "pitch [deg]", "yaw [deg]"], *ROWS.T, *PLACE.T, *np.degrees(EULER).T),
        {},
        True,
    ),
    "ros2 topic echo --csv of a pose": ("m.csv", ros2("world", *floats(*PLACE.T, *XYZW.T)), ALONE, False),
    "qpos without a header": ("m.csv", lines(None, floats(T, *PLACE.T, *WXYZ.T, *JOINTS.T)), W_FIRST, True),
}


def turn_of(recorded, body):
    """The turn about y at the end, computed of the path without momentum."""
    motion = sp.reconstruct(sp.articulated(body, recorded.path), [0.0, 0.0, 0.0])
    return Rotation.from_matrix(motion.attitude(motion.duration)).as_rotvec()


def read(source, body, **options):
    by = options.pop("by", None)
    with warnings.catch_warnings():
        # What is taken for granted of such a file is said; test_what_is_taken_for_granted_is_said reads it.
        warnings.simplefilter("ignore", TrajectoryWarning)
        return read_recorded_motion(by(source) if by else source, body, **options)


@pytest.mark.parametrize("case", TABLES)
def test_joints(case, body, tmp_path):
    file, write, options, exact = TABLES[case]
    if file is None:
        source = write()
    else:
        source = tmp_path / file
        write(source)
    found = read(source, body, **options)
    places = [body.joint_index("arm"), body.joint_index("leg")]
    np.testing.assert_allclose(found.path.shape(found.times)[:, places], JOINTS, rtol=0.0, atol=exact)
    assert found.path.duration == pytest.approx(T[-1], abs=max(exact, 1e-12) if exact != STEPS else STEPS)
    turn = turn_of(found, body)
    np.testing.assert_allclose(turn, [0.0, TURN[-1] - TURN[0], 0.0], rtol=0.0, atol=1e-9 + exact)


@pytest.mark.parametrize("case", POSES)
def test_poses_of_the_base(case, body, tmp_path):
    file, content, options, with_joints = POSES[case]
    (tmp_path / file).write_text(content)
    found = read(tmp_path / file, body, **options)
    assert found.base_attitude is not None
    assert found.base_position is not None
    np.testing.assert_allclose(found.base_attitude, BASE.as_matrix(), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.base_position, PLACE, rtol=0.0, atol=1e-12)
    if with_joints:
        turn = turn_of(found, body)
        np.testing.assert_allclose(turn, [0.0, TURN[-1] - TURN[0], 0.0], rtol=0.0, atol=1e-8)


CELLS = [
    "x",
    "1_0",
    "0x1",
    "1 rad",
    "1.2.3",
    "--1",
    "1e",
    "NA",
    "null",
    "None",
    "n/a",
    "#REF!",
    "1,5",
    "inf",
    "-inf",
    "1e400",
    "٣",
    "True",
    "__import__('os')",
    "-",
]


@pytest.mark.parametrize("cell", CELLS)
def test_a_damaged_cell_is_named_by_row_and_column(cell, body, tmp_path):
    rows = table(NAMES, *ROWS.T, mark="\t").split("\n")
    entries = rows[17].split("\t")
    rows[17] = "\t".join([entries[0], cell, entries[2]])
    (tmp_path / "m.csv").write_text("\n".join(rows), encoding="utf-8")
    with pytest.raises(TrajectoryError, match="18"):
        read_recorded_motion(tmp_path / "m.csv", body)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (lines(None, floats(*ROWS.T)), ["no header", "time, arm, leg"]),
        (table(["time", "arm", "leg_id"], *ROWS.T).replace(",leg_id", ",comment", 1).replace("0.5\n", "word\n", 1), []),
    ],
)
def test_what_is_taken_for_granted_is_said(content, words, body, tmp_path):
    (tmp_path / "m.csv").write_text(content)
    if not words:
        with pytest.raises(ShapePhaseError, match="--names"):
            read_recorded_motion(tmp_path / "m.csv", body)
        return
    with pytest.warns(TrajectoryWarning, match=".*".join(words)):
        read_recorded_motion(tmp_path / "m.csv", body)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["time", "arm", "leg", "q1", "q2", "q3", "q4"], "--names 'q1=qw'"),
        (["time", "arm", "leg", "wobble"], r"base_qx.*--names 'wobble=JOINT'"),
        (["time", "arm", "lge"], "--names 'lge=leg'"),
        (["time", "arm", "leg", "t1", "t2", "t3"], "--names 't1="),
        (["1.0", "2.0", "3.0", "4.0"], "--names 1=time"),
    ],
)
def test_what_cannot_be_known_is_asked(names, words, body, tmp_path):
    columns = [T, ARM, LEG, *WXYZ.T][: len(names)]
    (tmp_path / "m.csv").write_text(table(names, *columns))
    with pytest.raises(ShapePhaseError, match=words):
        read_recorded_motion(tmp_path / "m.csv", body)


@pytest.mark.parametrize("title", ["Speeds", "Accelerations", "PositionErrors", "ActuatorForces", "run_1_controls"])
def test_results_of_opensim_that_are_no_coordinates_are_refused(title, body, tmp_path):
    """Their columns have the names of the coordinates."""
    (tmp_path / "m.sto").write_text(opensim(title=title))
    with pytest.raises(TrajectoryError, match=f"{title}.*Kinematics_q"):
        read_recorded_motion(tmp_path / "m.sto", body)


def test_a_first_row_of_whole_numbers_from_zero_may_be_a_sample(body, tmp_path):
    (tmp_path / "m.csv").write_text("0,1,2\n1,2,3\n2,3,4\n")
    with pytest.raises(TrajectoryError, match="names"):
        read_recorded_motion(tmp_path / "m.csv", body)
