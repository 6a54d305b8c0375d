"""One recording in the spellings and formats that people have: the same path from each, or a question by name.

`SPELLINGS` is the table: what the file looks like, what the caller says, and what becomes of it.
"""

from __future__ import annotations

import io
import sys

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import MissingExtraError, ShapePhaseError, TrajectoryError, TrajectoryWarning, UnknownNameError
from shapephase.shape_space.files import read_recorded_motion
from support.motion_writers import write_opensim

pytestmark = pytest.mark.usefixtures("warm_readers")
BODY = sp.load_body("satellite")
JOINTS = BODY.joint_names
TURNS = np.array([unit == "rad" for unit in BODY.joint_units])
COUNT, RATE = 48, 60.0
TIMES = np.arange(COUNT) / RATE
# Within all limits, every joint another wave, and the range of a real motion: some 40 degrees.
SHAPES = np.stack([0.4 + 0.35 * np.sin((3.0 + 0.5 * k) * TIMES + k) for k in range(len(JOINTS))], axis=1)
DEGREES = np.where(TURNS, np.degrees(SHAPES), SHAPES)
MILLI = np.where(TURNS, np.degrees(SHAPES), 1e3 * SHAPES)
SMALL = np.where(TURNS, np.degrees(SHAPES) / 30.0, SHAPES)
"""A motion so small that its degrees are below two pi."""


def text(times, values, labels, delimiter=",", comma=False, more=""):
    def word(value):
        said = repr(float(value))
        return said.replace(".", ",") if comma else said

    lines = [delimiter.join(labels) + "\n" + more]
    lines += [delimiter.join(map(word, [t, *row])) + "\n" for t, row in zip(times, values, strict=True)]
    return "".join(lines)


def labels(time="time", turning="{}", sliding="{}"):
    return [time, *((turning if turn else sliding).format(name) for name, turn in zip(JOINTS, TURNS, strict=True))]


def csv(content):
    return lambda file: file.write_text(content, encoding="utf-8")


def mot(values, names, degrees, **header):
    return lambda file: write_opensim(file, names, TIMES, values, degrees, **header)


def quoted():
    rows = [",".join(f'"{v!r}"'.replace(".", ",") for v in map(float, [t, *r])) for t, r in zip(TIMES, SHAPES)]
    return "\n".join([",".join(labels()), *rows])


def excel(times, values, names, more=()):
    def write(file):
        import openpyxl

        book = openpyxl.Workbook()
        sheet = book.active
        for row in (
            [None],
            names,
            *more,
            *([float(t), *map(float, row)] for t, row in zip(times, values, strict=True)),
        ):
            sheet.append(row)
        book.create_sheet("empty")
        book.save(file)

    return write


def parquet(file):
    frame(TIMES, DEGREES, labels("time_s", "{}_deg", "{}_m")).to_parquet(file)


def frame(times, values, names):
    import pandas

    return pandas.DataFrame(np.column_stack([times, values]), columns=names)


def indexed_frame(_):
    import pandas

    return pandas.DataFrame(SHAPES, columns=JOINTS, index=pandas.to_timedelta(np.arange(COUNT) * 125, unit="ms"))


def dataset(_):
    import xarray

    units = ["rad" if turn else "m" for turn in TURNS]
    variables = {name: ("time", SHAPES[:, k], {"units": units[k]}) for k, name in enumerate(JOINTS)}
    return xarray.Dataset(variables, coords={"time": ("time", 1e3 * TIMES, {"units": "ms"})})


def data_array(_):
    import xarray

    return xarray.DataArray(SHAPES, dims=("time", "joint"), coords={"time": TIMES, "joint": list(JOINTS)})


def mat(file):
    import scipy.io

    scipy.io.savemat(file, {"time": TIMES, "fs": RATE} | {name: SHAPES[:, k] for k, name in enumerate(JOINTS)})


def mat_structure(file):
    import scipy.io

    inner = {"t": TIMES, "data": SHAPES, "colheaders": np.array(JOINTS, dtype=object)}
    scipy.io.savemat(file, {"take1": inner, "note": "after lunch"}, do_compression=True)


def matlab_73(file):
    """As MATLAB writes it: its own 512 bytes, axes in the opposite order, texts as codes in cells of references."""
    import h5py

    with h5py.File(file, "w", userblock_size=512) as book:
        book["t"] = TIMES[None, :].T.T
        book["t"].attrs["MATLAB_class"] = np.bytes_("double")
        book["data"] = SHAPES.T
        cells = []
        for k, name in enumerate(JOINTS):
            codes = book.create_dataset(f"#refs#/{k}", data=np.array([list(map(ord, name))], dtype=np.uint16).T)
            codes.attrs["MATLAB_class"] = np.bytes_("char")
            cells.append(codes.ref)
        names = book.create_dataset("names", data=np.array([cells], dtype=h5py.ref_dtype).T)
        names.attrs["MATLAB_class"] = np.bytes_("cell")
    with open(file, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def hdf5(file):
    import h5py

    with h5py.File(file, "w") as book:
        book["time"] = 1e3 * TIMES
        book["time"].attrs["units"] = "ms"
        for k, name in enumerate(JOINTS):
            book[name] = DEGREES[:, k]
            book[name].attrs["units"] = "deg" if TURNS[k] else "m"


def c3d(unit="deg", angles=True):
    def write(file):
        import ezc3d

        made = ezc3d.c3d()
        point = made["parameters"]["POINT"]
        names = [f"A{k}" for k in range(4)]
        point["RATE"]["value"], point["LABELS"]["value"] = [RATE], ("LASI", *names)
        values = np.ones((4, 5, COUNT))
        for k in range(len(JOINTS)):
            values[k % 3, 1 + k // 3] = DEGREES[:, k] if TURNS[k] else SHAPES[:, k]
        made["data"]["points"] = values
        if angles:
            made.add_parameter("POINT", "ANGLES", names)
            made.add_parameter("POINT", "ANGLE_UNITS", [unit])
        made.write(str(file))

    return write


C3D_NAMES = {f"A{k // 3}_{'xyz'[k % 3]}": name for k, name in enumerate(JOINTS)}
SLIDES = JOINTS[int(np.flatnonzero(~TURNS)[0])]
LIMITED = next(name for k, name in enumerate(JOINTS) if TURNS[k] and np.isfinite(BODY.joint_limits[k]).all())
C3D_SLIDE = next(column for column, name in C3D_NAMES.items() if name == SLIDES)
GERMAN = labels("Zeit", "{} (Grad)", "{} (m)")
TO_GERMAN = {"Zeit": "time [s]"} | {f"{n} (Grad)": f"{n} [deg]" for n, turn in zip(JOINTS, TURNS, strict=True) if turn}
DEG = labels("time", "{}_deg")
PELVIS = ["pelvis_tilt", "subtalar_angle_r", f"{LIMITED}_beta"]
WITH_PELVIS = np.column_stack([DEGREES, 5.0 * TIMES, np.zeros(COUNT), DEGREES[:, JOINTS.index(LIMITED)]])
STATES = [f"/jointset/some/{name}/value" for name in JOINTS] + ["/jointset/some/elbow/speed"]
SINGLE = 1e-6
"""Of single precision [rad]: 24 bits of some 50 degrees."""

# What it is -> (file, what writes it, or the frame itself; options; words of the question, or how exact the path is).
SPELLINGS = {
    "CSV": ("m.csv", csv(text(TIMES, SHAPES, labels())), {}, 1e-12),
    "CSV, _deg": ("m.csv", csv(text(TIMES, DEGREES, DEG)), {}, 1e-12),
    "CSV, [deg] and Time [s]": ("m.csv", csv(text(TIMES, DEGREES, labels("Time [s]", "{} [deg]"))), {}, 1e-12),
    "CSV, (deg) and (mm)": ("m.csv", csv(text(TIMES, MILLI, labels("t", "{} (deg)", "{} (mm)"))), {}, 1e-12),
    "CSV, degree signs": ("m.csv", csv(text(TIMES, DEGREES, labels("time", "{}°"))), {}, 1e-12),
    "CSV, [ms]": ("m.csv", csv(text(1e3 * TIMES, SHAPES, labels("time [ms]"))), {}, 1e-12),
    "CSV, time_ms": ("m.csv", csv(text(1e3 * TIMES, SHAPES, labels("time_ms"))), {}, 1e-12),
    "CSV, a row of units": (
        "m.csv",
        csv(text(1e3 * TIMES, DEGREES, labels(), more=",".join(["ms", *np.where(TURNS, "deg", "m")]) + "\n")),
        {},
        1e-12,
    ),
    "CSV, decimal commas": ("m.csv", csv(text(TIMES, DEGREES, DEG, ";", comma=True)), {}, 1e-12),
    "CSV, decimal commas and tabs": ("m.txt", csv(text(TIMES, DEGREES, DEG, "\t", comma=True)), {}, 1e-12),
    "CSV, decimal commas in quotes": ("m.csv", csv(quoted()), {}, 1e-12),
    "CSV, in another language": (
        "m.csv",
        csv("\ufeff" + text(TIMES, DEGREES, GERMAN, ";", comma=True).replace("\n", "\r\n")),
        {"names": TO_GERMAN},
        1e-12,
    ),
    "CSV, degrees by the caller": ("m.csv", csv(text(TIMES, DEGREES, labels())), {"degrees": True}, 1e-12),
    "CSV, milliseconds by the caller": (
        "m.csv",
        csv(text(1e3 * TIMES, SHAPES, labels())),
        {"time_unit": "ms"},
        1e-12,
    ),
    "CSV without times": (
        "m.csv",
        csv("\n".join(line.partition(",")[2] for line in text(TIMES, SHAPES, labels()).splitlines())),
        {"timestep": 1.0 / RATE},
        1e-12,
    ),
    "TSV": ("m.tsv", csv(text(TIMES, SHAPES, labels(), "\t")), {}, 1e-12),
    "Excel": ("m.xlsx", excel(TIMES, DEGREES, DEG), {}, 1e-12),
    "Excel, a row of units": (
        "m.xlsx",
        excel(1e3 * TIMES, MILLI, labels(), [["[ms]", *np.where(TURNS, "[deg]", "[mm]").tolist()]]),
        {},
        1e-12,
    ),
    "Parquet": ("m.parquet", parquet, {}, 1e-12),
    "DataFrame": ("", lambda _: frame(TIMES, DEGREES, DEG), {}, 1e-12),
    "DataFrame, its index the time": ("", indexed_frame, {}, 1e-12),
    "Dataset": ("", dataset, {}, 1e-12),
    "DataArray": ("", data_array, {}, 1e-12),
    "MATLAB": ("m.mat", mat, {}, 1e-12),
    "MATLAB, a structure": ("m.mat", mat_structure, {}, 1e-12),
    "MATLAB 7.3": ("m.mat", matlab_73, {}, 1e-12),
    "HDF5": ("m.h5", hdf5, {}, 1e-12),
    "C3D": (
        "m.c3d",
        c3d(),
        {"names": C3D_NAMES | {C3D_SLIDE: None}, "ignore_extra": True, "rest": {SLIDES: 0.25}},
        SINGLE,
    ),
    "OpenSim in degrees": ("m.mot", mot(DEGREES, JOINTS, True), {}, 1e-12),
    "OpenSim 4 of states": (
        "m.sto",
        mot(np.column_stack([SHAPES, 7.0 * TIMES]), STATES, False, version=3, OpenSimVersion="4.5", DataType="double"),
        {},
        1e-12,
    ),
    "OpenSim of inverse kinematics": (
        "m.mot",
        mot(WITH_PELVIS, [*JOINTS, *PELVIS], True),
        {"names": {"pelvis_tilt": None}},
        1e-12,
    ),
    "OpenSim, the pelvis left out": (
        "m.mot",
        mot(WITH_PELVIS, [*JOINTS, *PELVIS], True),
        {"ignore_extra": True},
        1e-12,
    ),
    "NPZ": ("m.npz", lambda file: np.savez(file, time=TIMES, shapes=SHAPES, joint_names=JOINTS), {}, 1e-12),
    "degrees, nobody says": (
        "m.csv",
        csv(text(TIMES, DEGREES, labels())),
        {},
        ["degrees?", "degrees=True", "--degrees"],
    ),
    "few degrees, nobody says": (
        "m.csv",
        csv(text(TIMES, 9.0 * SMALL, labels())),
        {},
        ["degrees?", "degrees=True", "--degrees"],
    ),
    "degrees in a DataFrame": ("", lambda _: frame(TIMES, DEGREES, labels()), {}, ["degrees?", "degrees=True"]),
    "degrees in a .mat": (
        "m.mat",
        lambda file: __import__("scipy.io").io.savemat(
            file, {"time": TIMES} | {name: DEGREES[:, k] for k, name in enumerate(JOINTS)}
        ),
        {},
        ["degrees?"],
    ),
    "milliseconds, nobody says": (
        "m.csv",
        csv(text(1e3 * TIMES, SHAPES, labels())),
        {},
        ["are they in ms?", "--time-unit ms", "time_unit='ms'"],
    ),
    "microseconds in a DataFrame": ("", lambda _: frame(1e6 * TIMES, SHAPES, labels()), {}, ["are they in us?"]),
    "frames as times": ("m.csv", csv(text(np.arange(COUNT), SHAPES, labels())), {}, ["one every 1 s", "time_unit"]),
    "millimetres, nobody says": (
        "m.csv",
        csv(text(TIMES, np.where(TURNS, SHAPES, MILLI), labels())),
        {},
        [SLIDES, "in millimetres", "[mm]"],
    ),
    "a unit that is none": (
        "m.csv",
        csv(text(TIMES, SHAPES, labels("time", "{} [furlong]"))),
        {},
        ["no unit 'furlong' is known", "deg"],
    ),
    "degrees and radians contradict": (
        "m.csv",
        csv(text(TIMES, SHAPES, labels("time", "{} [rad]"))),
        {"degrees": True},
        ["in rad by its name, and degrees=True was given"],
    ),
    "a slide in degrees": (
        "m.csv",
        csv(text(TIMES, SHAPES, labels("time", "{}", "{} [deg]"))),
        {},
        [f"{SLIDES} slides and is in metres"],
    ),
    "commas that may be thousands": (
        "m.csv",
        csv(
            "time;"
            + ";".join(JOINTS)
            + "\n"
            + "".join(f"{k};" + ";".join(["1,234"] * len(JOINTS)) + "\n" for k in (0, 1))
        ),
        {},
        ["row 2", "'1,234' may have a decimal comma or a mark of thousands"],
    ),
    "points among decimal commas": (
        "m.csv",
        csv(text(TIMES, SHAPES, labels(), ";", comma=True).replace("0,4", "0.4", 1)),
        {},
        ["has a decimal point, and other entries have decimal commas"],
    ),
    "decimal commas between commas": (
        "m.csv",
        csv(",".join(labels()) + "\n" + ",".join(["0,5"] * (len(JOINTS) + 1)) + "\n"),
        {},
        ["decimal commas between commas cannot be told apart"],
    ),
    "markers": ("m.c3d", c3d(angles=False), {}, ["no angles among them", "inverse kinematics", ".mot"]),
    "markers as text": ("m.trc", csv("PathFileType 4"), {}, ["inverse kinematics", ".mot"]),
    "no times": (
        "m.csv",
        csv(text(TIMES, SHAPES, labels("frame"))),
        {},
        ["no column `time`", "timestep", "names={column: 'time'}"],
    ),
    "two times": (
        "m.csv",
        csv(text(TIMES, SHAPES, labels("t,timestamp").copy()).replace("\n", "\n0,", 1)),
        {},
        ["row"],
    ),
    "a real .mot": (
        "m.mot",
        mot(WITH_PELVIS, [*JOINTS, *PELVIS], True),
        {},
        ["pelvis_tilt", "--ignore-extra", "names"],
    ),
}


def written(case, folder):
    file, write, options, outcome = SPELLINGS[case]
    made = write(folder / file if file else None)
    return (folder / file if file else made), options, outcome


@pytest.mark.parametrize("case", SPELLINGS)
def test_the_same_path_or_a_question(case, tmp_path):
    source, options, outcome = written(case, tmp_path)
    if isinstance(outcome, list):
        with pytest.raises(ShapePhaseError) as caught:
            read_recorded_motion(source, BODY, **options)
        message = str(caught.value)
        assert [words for words in outcome if words not in message] == [], message
        return
    found = read_recorded_motion(source, BODY, **options)
    times = 0.125 * np.arange(COUNT) if case.endswith("index the time") else TIMES
    resting = {BODY.joint_index(name): value for name, value in options.get("rest", {}).items()}
    shapes = np.stack(
        [np.full(COUNT, resting[k]) if k in resting else SHAPES[:, k] for k in range(len(JOINTS))], axis=1
    )
    truth = sp.ShapePath.spline(times, shapes)
    t = np.linspace(0.0, truth.duration, 301)
    np.testing.assert_allclose(found.path.shape(t), truth.shape(t), rtol=0.0, atol=outcome)
    assert found.path.duration == pytest.approx(truth.duration, rel=1e-14)


@pytest.mark.parametrize("content", [text(TIMES, DEGREES, DEG, ";", comma=True), "mot"])
def test_standard_input(monkeypatch, tmp_path, content):
    if content == "mot":
        write_opensim(tmp_path / "m.mot", JOINTS, TIMES, DEGREES, True)
        content = (tmp_path / "m.mot").read_text()

    class Input:
        buffer = io.BytesIO(content.encode())

    monkeypatch.setattr(sys, "stdin", Input)
    found = read_recorded_motion("-", BODY)
    np.testing.assert_allclose(found.path.shape(TIMES), SHAPES, rtol=0.0, atol=1e-14)
    assert found.record["file"] == "standard input"
    assert len(found.path.sha256) == 64


def test_nothing_is_misread_between_a_motion_and_its_degrees():
    """Whatever the size of a motion, degrees without a unit are a question, or too small to leave the limits."""
    for scale in np.geomspace(0.02, 1.0, 25):
        values = np.where(TURNS, scale * DEGREES, SHAPES)
        lower, upper = BODY.joint_limits.T
        limited = TURNS & np.isfinite(lower)
        room = 0.2 * (upper - lower)
        far = limited & ((values.max(axis=0) > upper + room) | (values.min(axis=0) < lower - room))
        source = frame(TIMES, values, labels())
        if far.any():
            with pytest.raises(TrajectoryError, match="degrees"):
                read_recorded_motion(source, BODY)


def test_a_wheel_that_turns_far_is_asked_about_and_comes_back_as_it_was_written(tmp_path):
    wheel = int(np.flatnonzero(BODY.continuous)[0])
    shapes = SHAPES.copy()
    shapes[:, wheel] = 40.0 * TIMES
    with pytest.raises(TrajectoryError, match="turn"):
        read_recorded_motion(frame(TIMES, shapes, labels()), BODY)
    assert read_recorded_motion(frame(TIMES, shapes, labels()), BODY, degrees=False).path.shape(TIMES)[-1, wheel] > 30.0
    path = sp.ShapePath.spline(600.0 * TIMES, shapes, joint_names=JOINTS)
    sp.write_shape_path(path, tmp_path / "m.csv")
    header = (tmp_path / "m.csv").read_text().splitlines()[0]
    assert header.startswith("time [s],")
    assert f"{JOINTS[wheel]} [SI]" in header
    back = sp.read_shape_path(tmp_path / "m.csv", BODY)
    np.testing.assert_allclose(back.shape(path.breaks), path.shape(path.breaks), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(("body", "joint"), [("diver", "left_shoulder_abduction"), ("satellite", "wheel_spin")])
def test_angles_wrapped_to_one_turn_are_warned_of(body, joint):
    """Limits of ±3.2 rad, or none: a path through the jump turns back through all of the turn within one sample."""
    times, whole = np.linspace(0.0, 1.4, 71), 2.0 * np.pi
    angles = 2.9 + 0.6 * np.sin(np.pi * np.linspace(0.0, 1.0, 71)) ** 2
    wrapped = (angles + np.pi) % whole - np.pi
    with pytest.warns(sp.TrajectoryWarning, match=f"joint {joint} jumps by .*unwrap"):
        read_recorded_motion({"time": times, joint: wrapped}, sp.load_body(body), degrees=False, rest_missing=True)


@pytest.mark.parametrize(
    ("module", "file", "extra"),
    [
        *(("openpyxl", "m.xlsx", "data"), ("pyarrow.parquet", "m.parquet", "data"), ("h5py", "m.h5", "data")),
        *(("ezc3d", "m.c3d", "data"), ("rosbags.rosbag1", "m.bag", "data"), ("yaml", "m.yaml", "data")),
    ],
)
def test_a_missing_extra_is_named(tmp_path, monkeypatch, module, file, extra):
    monkeypatch.setitem(sys.modules, module, None)
    if module in ("ezc3d", "h5py"):
        monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    (tmp_path / file).write_bytes(b"x: 1\n")
    with pytest.raises(MissingExtraError, match=extra):
        read_recorded_motion(tmp_path / file, BODY)


# What is done on the way


def test_joints_without_a_column_rest_where_one_says(tmp_path):
    (tmp_path / "m.csv").write_text(f"time,{JOINTS[0]},comment\n0,0.1,start\n0.5,0.2,\n1,0.1,end\n")
    with pytest.warns(TrajectoryWarning, match="--rest-missing"):
        found = read_recorded_motion(tmp_path / "m.csv", BODY)
    assert found.record["left_out"] == {"comment": "text"}
    np.testing.assert_array_equal(found.path.shape(0.5)[1:], np.clip(0.0, *BODY.joint_limits.T)[1:])
    # A number that nobody explains may be a joint that was misspelt, and no joint at all is no recording of the body.
    (tmp_path / "n.csv").write_text(f"time,{JOINTS[0]},{JOINTS[1]}x\n0,0.1,3\n0.5,0.2,2\n1,0.1,1\n")
    with pytest.raises(UnknownNameError, match="--ignore-extra"):
        read_recorded_motion(tmp_path / "n.csv", BODY)
    with pytest.raises(TrajectoryError, match="--rest-missing"):
        read_recorded_motion(tmp_path / "n.csv", BODY, ignore_extra=True)
    (tmp_path / "n.csv").write_text(f"time,{JOINTS[0]},{JOINTS[1]}_velocity\n0,0.1,3\n0.5,0.2,2\n1,0.1,1\n")
    with pytest.raises(TrajectoryError, match=f"--rest {JOINTS[1]}=0"):
        read_recorded_motion(tmp_path / "n.csv", BODY)
    (tmp_path / "n.csv").write_text("time,comment\n0,a\n0.5,b\n1,c\n")
    with pytest.raises(TrajectoryError, match="--rest-missing"):
        read_recorded_motion(tmp_path / "n.csv", BODY)
    rest = {JOINTS[1]: "30deg", SLIDES: "200 mm", JOINTS[2]: -0.25}
    found = read_recorded_motion(tmp_path / "m.csv", BODY, ignore_extra=True, rest=rest, rest_missing=True)
    shape = dict(zip(JOINTS, found.path.shape(0.5), strict=True))
    assert shape[JOINTS[0]] == pytest.approx(0.2, abs=1e-15)
    assert shape[JOINTS[1]] == pytest.approx(np.pi / 6.0, abs=1e-15)
    assert shape[SLIDES] == pytest.approx(0.2, abs=1e-15)
    assert shape[JOINTS[2]] == -0.25
    assert shape[JOINTS[4]] == 0.0
    assert found.record["at_rest"][JOINTS[1]] == pytest.approx(np.pi / 6.0, abs=1e-15)
    assert list(found.record["columns"]) == [JOINTS[0]]
    for wrong, words in (
        ({JOINTS[0]: 0.0}, "has a column"),
        ({"elbow": 0.0}, "unknown joint"),
        ({JOINTS[1]: "30 furlong"}, "rest of joint"),
        ({JOINTS[1]: "3 m"}, "the joint turns"),
        ({SLIDES: "3deg"}, "the joint slides"),
        ({JOINTS[1]: np.nan}, "a finite number"),
    ):
        with pytest.raises(ShapePhaseError, match=words):
            read_recorded_motion(tmp_path / "m.csv", BODY, ignore_extra=True, rest=rest | wrong, rest_missing=True)


def test_what_rests_without_a_word_rests_within_its_limits(tmp_path):
    (tmp_path / "m.csv").write_text("time\n0\n1\n")
    human = sp.load_body("astronaut")
    found = read_recorded_motion(tmp_path / "m.csv", human, rest_missing=True)
    lower, upper = human.joint_limits.T
    np.testing.assert_array_equal(found.path.shape(0.5), np.clip(0.0, lower, upper))


@pytest.mark.parametrize("base", ["", "base_qx,base_qy,base_qz,base_qw,"])
def test_a_file_of_which_no_column_is_a_joint_is_no_body_at_rest(base, tmp_path):
    turned = "0,0,0,1," if base else ""
    (tmp_path / "m.csv").write_text(f"time,{base}l_hip,r_hip\n0,{turned}0.1,0\n0.5,{turned}0.2,0.1\n1,{turned}0.1,0\n")
    options = {"rest_missing": True, "ignore_extra": True}
    with pytest.raises(TrajectoryError, match="'r_hip'"):
        read_recorded_motion(tmp_path / "m.csv", BODY, **options)
    # One that is a joint is enough, and so is to name what is left out.
    for names in ({"l_hip": JOINTS[0]}, {"l_hip": None, "r_hip": None}):
        found = read_recorded_motion(tmp_path / "m.csv", BODY, names=names, **options)
        assert list(found.record["columns"]) == [joint for joint in names.values() if joint]


def test_a_stretch_is_kept_by_the_file_s_own_times(tmp_path):
    (tmp_path / "m.csv").write_text(text(1e3 * TIMES + 5000.0, SHAPES, labels("time [ms]")))
    found = read_recorded_motion(tmp_path / "m.csv", BODY, trim=(5200.0, 5500.0))
    kept = (TIMES >= 0.2 - 1e-9) & (TIMES <= 0.5 + 1e-9)
    np.testing.assert_allclose(found.path.shape(found.times), SHAPES[kept], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(found.times, TIMES[kept] - TIMES[kept][0], rtol=0.0, atol=1e-12)
    assert found.record["samples"] == kept.sum()
    assert found.record["first_time"] == pytest.approx(5200.0)
    for wrong, words in (
        ((6000.0, 7000.0), "0 samples from 6000 to 7000.*own times go from 5000 to 5783.33"),
        ((5300.0, 5200.0), "the first before the last"),
        ((5300.0,), "trim"),
    ):
        with pytest.raises(ShapePhaseError, match=words):
            read_recorded_motion(tmp_path / "m.csv", BODY, trim=wrong)


def test_a_fault_outside_the_stretch_does_no_harm(tmp_path):
    lines = text(TIMES, SHAPES, labels()).splitlines()
    lines[1] = f"0.0{',' * len(JOINTS)}"
    (tmp_path / "m.csv").write_text("\n".join(lines))
    with pytest.raises(TrajectoryError, match="--fill"):
        read_recorded_motion(tmp_path / "m.csv", BODY)
    found = read_recorded_motion(tmp_path / "m.csv", BODY, trim=(0.01, 9.0))
    np.testing.assert_allclose(found.path.shape(found.times), SHAPES[1:], rtol=0.0, atol=1e-14)


def test_a_path_is_resampled_evenly():
    source = frame(TIMES, SHAPES, labels())
    found = read_recorded_motion(source, BODY, resample=25.0)
    assert len(found.path.breaks) == 21
    assert found.record["resampled_to_hz"] == pytest.approx(20.0 / TIMES[-1])
    whole = read_recorded_motion(source, BODY)
    np.testing.assert_allclose(found.path.shape(found.path.breaks), whole.path.shape(found.path.breaks), atol=1e-14)
    assert 0.0 < found.residual.max() < 1e-3
    for wrong in (0.0, -1.0, np.nan, 1e9):
        with pytest.raises(ShapePhaseError, match="resample"):
            read_recorded_motion(source, BODY, resample=wrong)


def test_names_from_a_file(tmp_path):
    (tmp_path / "m.csv").write_text(text(TIMES, DEGREES, GERMAN))
    pairs = TO_GERMAN | {f"{SLIDES} (m)": SLIDES}
    (tmp_path / "names.txt").write_text("# of our lab\n" + "".join(f"{old} = {new}\n" for old, new in pairs.items()))
    found = read_recorded_motion(tmp_path / "m.csv", BODY, names=tmp_path / "names.txt")
    np.testing.assert_allclose(found.path.shape(TIMES), SHAPES, rtol=0.0, atol=1e-14)
    for file, content, words in (
        ("a.txt", "knee\n", "line 1: COLUMN=JOINT is needed"),
        ("a.txt", "a=b\na=c\n", "line 2: 'a' stands twice"),
        ("b.txt", None, "no such file"),
    ):
        if content is not None:
            (tmp_path / file).write_text(content)
        with pytest.raises(ShapePhaseError, match=words):
            read_recorded_motion(tmp_path / "m.csv", BODY, names=tmp_path / file)


def test_what_opensim_has_more_is_told(tmp_path):
    file, options, _ = written("OpenSim of inverse kinematics", tmp_path)
    record = read_recorded_motion(file, BODY, **options).record
    assert record["left_out"] == {
        "pelvis_tilt": "as told by names",
        "subtalar_angle_r": "locked at 0",
        f"{LIMITED}_beta": f"coupled to {LIMITED}",
    }
    assert set(record["units"].values()) == {"deg", "m"}


@pytest.mark.parametrize("kind", ["mat", "matlab_73", "hdf5"])
@pytest.mark.parametrize("column", [JOINTS[0], "time"])
def test_true_and_false_are_no_numbers_where_numbers_are_meant(kind, column, tmp_path):
    file = truths_written(kind, column, tmp_path)
    with pytest.raises(TrajectoryError, match="'True'"):
        sp.read_shape_path(file, BODY)


@pytest.mark.parametrize("kind", ["mat", "matlab_73", "hdf5"])
def test_true_and_false_that_are_not_used_do_not_disturb(kind, tmp_path):
    found = read_recorded_motion(truths_written(kind, "contact", tmp_path), BODY)
    assert np.array_equal(found.path.shape(TIMES), SHAPES)
    assert found.record["left_out"] == {"contact": "text"}


def truths_written(kind, column, folder):
    """A recording one of whose columns is true and false in turn; MATLAB 7.3 has them as bytes, with an attribute."""
    import h5py
    import scipy.io

    columns = {"time": TIMES} | {name: SHAPES[:, k] for k, name in enumerate(JOINTS)}
    columns[column] = np.arange(COUNT) % 2 == 0
    file = folder / ("m.h5" if kind == "hdf5" else "m.mat")
    if kind == "mat":
        scipy.io.savemat(file, columns)
        return file
    with h5py.File(file, "w", userblock_size=512 if kind == "matlab_73" else 0) as book:
        for name, values in columns.items():
            is_truth = values.dtype == bool
            book[name] = values.astype(np.uint8)[None] if is_truth and kind == "matlab_73" else values
            if kind == "matlab_73":
                book[name].attrs["MATLAB_class"] = np.bytes_("logical" if is_truth else "double")
    if kind == "matlab_73":
        with open(file, "r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return file


@pytest.mark.parametrize("kind", ["m.mat", "m.h5", "m.npz"])
@pytest.mark.parametrize("value", ["text", "one value", "short"])
def test_a_joint_that_is_in_the_file_but_no_column_is_not_silently_at_rest(kind, value, tmp_path):
    entry = {"text": [f"{v}" for v in SHAPES[:, 0]], "one value": 0.2, "short": SHAPES[:3, :2]}[value]
    file = partly_array_file(tmp_path / kind, {JOINTS[0]: entry, "note": "after lunch"})
    options = {"rest_missing": True, "ignore_extra": True}
    with pytest.raises(TrajectoryError, match=JOINTS[0]):
        sp.read_shape_path(file, BODY, **options)
    # Told to, it rests.
    path = sp.read_shape_path(file, BODY, names={JOINTS[0]: None}, **options)
    assert np.array_equal(path.shape(TIMES)[:, 1:], SHAPES[:, 1:])
    assert not path.shape(TIMES)[:, 0].any()
    rested = sp.read_shape_path(file, BODY, rest={JOINTS[0]: 0.2})
    np.testing.assert_allclose(rested.shape(TIMES)[:, 0], 0.2, rtol=4e-16)


@pytest.mark.parametrize("kind", ["m.mat", "m.h5"])
def test_a_matrix_whose_columns_have_no_names_is_no_motion_at_rest(kind, tmp_path):
    file = array_file(tmp_path / kind, {"time": TIMES, "shapes": SHAPES})
    with pytest.raises(TrajectoryError, match="'shapes'"):
        sp.read_shape_path(file, BODY, rest_missing=True, ignore_extra=True)


@pytest.mark.parametrize("kind", ["m.mat", "m.h5"])
def test_a_base_of_another_width_is_not_passed_over(kind, tmp_path):
    file = partly_array_file(tmp_path / kind, {JOINTS[0]: SHAPES[:, 0], "base_position": SHAPES[:, :2]})
    with pytest.raises(TrajectoryError, match="base_position"):
        sp.read_shape_path(file, BODY)


def partly_array_file(file, others):
    """A recording of all joints but the first, and other entries."""
    if file.suffix == ".npz":
        return array_file(file, {"time": TIMES, "shapes": SHAPES[:, 1:], "joint_names": list(JOINTS[1:])} | others)
    return array_file(file, {"time": TIMES} | {name: SHAPES[:, k] for k, name in enumerate(JOINTS) if k} | others)


def array_file(file, entries):
    import h5py
    import scipy.io

    if file.suffix == ".mat":
        scipy.io.savemat(file, entries)
    elif file.suffix == ".npz":
        np.savez(file, **entries)
    else:
        with h5py.File(file, "w") as book:
            for name, value in entries.items():
                book[name] = value
    return file
