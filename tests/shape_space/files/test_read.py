"""Motion files: what is written is read back, columns find their joints by name, faults are named with their place.

`ODD_FILES` lists hostile and odd files of every kind with what must become of each.
"""

import inspect
import json
import os

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import InputFileNotFoundError, TrajectoryError, TrajectoryWarning, UnknownNameError
from shapephase.shape_space.files import read_recorded_motion
from support.odd_motion_files import GOOD_ARRAYS, HEADER, LEFT, ODD_FILES, csv_text, npz_bytes, odd_file
from support.reference_load import Effort


@pytest.fixture(scope="module")
def satellite():
    return sp.load_body("satellite")


@pytest.fixture(scope="module")
def diver():
    return sp.load_body("diver")


@pytest.fixture(scope="module")
def effort():
    return Effort()


def recorded(body, seed, closed=False, count=9):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.2, count))
    shapes = rng.uniform(0.0, 0.8, size=(count, body.n_shape))
    if closed:
        shapes[-1] = shapes[0]
    return times, shapes


def test_a_pipe_without_an_ending_gets_csv(tmp_path, satellite):
    times, shapes = recorded(satellite, 1)
    path = sp.ShapePath.spline(times, shapes, joint_names=satellite.joint_names)
    sp.write_shape_path(path, tmp_path / "motion.csv")
    os.mkfifo(tmp_path / "pipe")
    # Open for reading and writing, it waits for nobody, and holds more than this.
    pipe = os.open(tmp_path / "pipe", os.O_RDWR)
    try:
        sp.write_shape_path(path, tmp_path / "pipe")
        assert os.read(pipe, 65536) == (tmp_path / "motion.csv").read_bytes()
    finally:
        os.close(pipe)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".CSV", ".tsv"])
@pytest.mark.parametrize("closed", [False, True])
def test_a_spline_comes_back_as_it_was(tmp_path, satellite, suffix, closed):
    times, shapes = recorded(satellite, 1, closed)
    path = sp.ShapePath.spline(times, shapes, joint_names=satellite.joint_names)
    sp.write_shape_path(path, tmp_path / f"motion{suffix}")
    back = sp.read_shape_path(tmp_path / f"motion{suffix}", satellite)
    assert back.joint_names == satellite.joint_names
    assert back.duration == pytest.approx(times[-1] - times[0], abs=1e-15)
    np.testing.assert_array_equal(back.breaks, path.breaks)
    t = np.linspace(0.0, path.duration, 101)
    # Closed samples with the ends not knotted together are read as a loop: what a closed file means.
    np.testing.assert_allclose(back.shape(t), path.shape(t), atol=1e-14, rtol=0)
    np.testing.assert_allclose(back.rate(t), path.rate(t), atol=1e-12, rtol=0)


@pytest.mark.parametrize("suffix", [".csv", ".tsv"])
def test_comments_stand_above_a_table_and_its_faults_keep_their_rows(tmp_path, satellite, suffix):
    """With quotes and other separators in them; the last of them may be the header."""
    times, shapes = recorded(satellite, 2)
    path, file = sp.ShapePath.spline(times, shapes, joint_names=satellite.joint_names), tmp_path / f"said{suffix}"
    sp.write_shape_path(path, file, comment='half a "word; \tand, more\nsecond line')
    lines = file.read_text().splitlines()
    assert lines[:2] == ['# half a "word; \tand, more', "# second line"]
    assert len(lines) == 3 + len(path.sample_times)
    np.testing.assert_array_equal(
        sp.read_shape_path(file, satellite).shape(times - times[0]), path.shape(times - times[0])
    )
    file.write_text("\n".join([*lines[:6], lines[6].replace("0.", "zero", 1), *lines[7:]]))
    with pytest.raises(TrajectoryError, match="row 7"):
        sp.read_shape_path(file, satellite)
    file.write_text("\n".join([*lines[:2], "# " + lines[2], *lines[3:]]))
    behind = sp.read_shape_path(file, satellite)
    np.testing.assert_array_equal(behind.shape(times - times[0]), path.shape(times - times[0]))


def test_a_comment_of_arrays_is_in_their_provenance(tmp_path, satellite):
    times, shapes = recorded(satellite, 2)
    path = sp.ShapePath.spline(times, shapes, joint_names=satellite.joint_names)
    sp.write_shape_path(path, tmp_path / "said.npz", comment="why not")
    with np.load(tmp_path / "said.npz") as found:
        assert json.loads(str(found["provenance"]))["comment"] == "why not"


def test_any_path_is_written_finely(tmp_path, diver):
    loop = sp.ShapePath.fourier(
        [0.1, 0.2], [[0.3, 0.1], [0.2, 0.0]], [[0.0, 0.2], [0.1, 0.3]], 2.0, joint_names=diver.joint_names
    )
    sp.write_shape_path(loop, tmp_path / "loop.csv")
    back = sp.read_shape_path(tmp_path / "loop.csv", diver)
    t = np.linspace(0.0, 2.0, 333)
    np.testing.assert_allclose(back.shape(t), loop.shape(t), atol=1e-8, rtol=0)


GOOD = HEADER + "0,0,0\n1,1,1\n2,0,0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("left_shoulder_abduction,right_shoulder_abduction\n0,0\n1,1\n", "no column `time`"),
        (HEADER + "0,0,0\n", "two samples or more"),
        (HEADER + "0,0,0\n1,nan,1\n", "'left_shoulder_abduction' at the end, row 3"),
        (HEADER + "0,0,0\n1,1,inf\n", "row 3, column 'right_shoulder_abduction': 'inf'"),
        (HEADER + "0,0,0\n1,1,x\n", "'x' is no finite number"),
        (HEADER + "0,0,0\n1,1\n", "row 3 has 2 entries, the header 3"),
        (HEADER + "0,0,0\n2,1,1\n\n1,0,0\n", "row 5: time 1 s does not come after 2 s"),
        (HEADER + "0,0,0\n1,1,1\n1,0,0\n", "row 4: time 1 s does not come after 1 s"),
        ("time,left_shoulder_abduction,right_sholder\n0,0,0\n1,1,1\n", "--names 'right_sholder=right_shoulder_abd"),
        ("time,left_shoulder_abduction,left_shoulder_abduction\n0,0,0\n1,1,1\n", "stands twice"),
        (
            "time,left_shoulder_abduction,left_shoulder_abduction_deg,right_shoulder_abduction\n0,0,0,0\n1,1,1,1\n",
            "are the same joint",
        ),
    ],
)
def test_faults_of_a_csv_are_named(tmp_path, diver, text, message):
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(TrajectoryError, match=r"m\.csv") as caught:
        sp.read_shape_path(tmp_path / "m.csv", diver)
    assert message in str(caught.value)


def test_a_joint_that_does_not_exist_is_named_with_the_valid_ones(tmp_path, diver):
    (tmp_path / "m.csv").write_text(GOOD.replace("left_shoulder_abduction", "left_sholder_abduction"))
    with pytest.raises(UnknownNameError, match="'left_shoulder_abduction'"):
        sp.read_shape_path(tmp_path / "m.csv", diver)


def test_files_that_are_not_there_or_no_motion(tmp_path, diver):
    with pytest.raises(InputFileNotFoundError, match="such"):
        sp.read_shape_path(tmp_path / "m.csv", diver)
    with pytest.raises(UnknownNameError, match="npz"):
        sp.read_shape_path(tmp_path / "m.docx", diver)
    (tmp_path / "m.npz").write_bytes(b"PK nothing")
    with pytest.raises(TrajectoryError, match="NPZ"):
        sp.read_shape_path(tmp_path / "m.npz", diver)
    np.savez(tmp_path / "n.npz", time=[0.0, 1.0], shapes=np.zeros((2, 2)))
    with pytest.raises(TrajectoryError, match="joint_names"):
        sp.read_shape_path(tmp_path / "n.npz", diver)
    (tmp_path / "latin.csv").write_bytes(GOOD.encode() + b"\xe4,0,0\n")
    with pytest.raises(TrajectoryError, match="'ä'"):
        sp.read_shape_path(tmp_path / "latin.csv", diver)


def test_a_path_without_names_cannot_be_written(tmp_path):
    with pytest.raises(TrajectoryError, match="names"):
        sp.write_shape_path(sp.ShapePath.fourier([0.0], [[1.0]], [[0.0]], 1.0), tmp_path / "m.csv")


def test_a_failed_write_leaves_the_old_file(tmp_path, diver, monkeypatch):
    times, shapes = recorded(diver, 2)
    path = sp.ShapePath.spline(times, shapes, joint_names=diver.joint_names)
    target = tmp_path / "m.npz"
    sp.write_shape_path(path, target)
    before = target.read_bytes()

    def broken(stream, **_arrays):
        stream.write(b"half")
        raise OSError("the disk is full")

    monkeypatch.setattr(np, "savez", broken)
    with pytest.raises(OSError, match="full"):
        sp.write_shape_path(path, target)
    assert target.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.npz"]


@pytest.mark.usefixtures("warm_readers")
@pytest.mark.parametrize("case", ODD_FILES)
def test_an_odd_file_has_the_outcome_of_the_list(tmp_path, diver, effort, case):
    name, _, outcome, words = ODD_FILES[case]
    file = odd_file(case, tmp_path)
    message = ""
    with effort.limited():
        if outcome is None:
            motion = read_recorded_motion(file, diver)
            assert np.isfinite(motion.path.shape(motion.times)).all()
        elif outcome is TrajectoryWarning:
            with pytest.warns(TrajectoryWarning) as seen:
                motion = read_recorded_motion(file, diver)
            assert len(seen) == 1
            message = str(seen[0].message)
            assert np.isfinite(motion.path.shape(motion.times)).all()
        else:
            with pytest.raises(outcome) as caught:
                read_recorded_motion(file, diver)
            assert type(caught.value) is outcome
            message = str(caught.value)
    if outcome is not None:
        assert name in message
        assert [word for word in words if word not in message] == [], message
        assert len(message) < 1000


def test_a_whole_turn_from_one_sample_to_the_next_is_told(tmp_path, satellite):
    shapes = np.full((5, satellite.n_shape), 0.1)
    wheel = satellite.joint_index("wheel_spin")
    shapes[:, wheel] = [2.9, 3.0, 3.1, 3.2 - 2 * np.pi, 3.3 - 2 * np.pi]
    np.savez(tmp_path / "m.npz", time=np.arange(5.0), shapes=shapes, joint_names=satellite.joint_names)
    with pytest.warns(TrajectoryWarning, match="wheel_spin"):
        path = sp.read_shape_path(tmp_path / "m.npz", satellite)
    np.testing.assert_allclose(path.shape(path.breaks), shapes, atol=1e-15, rtol=0)


def test_options_that_do_not_fit_the_file_are_refused(tmp_path, diver):
    (tmp_path / "m.csv").write_text(csv_text())
    (tmp_path / "m.npz").write_bytes(npz_bytes(**GOOD_ARRAYS))
    for file in ("m.csv", "m.npz"):
        with pytest.raises(TrajectoryError, match="topic"):
            read_recorded_motion(tmp_path / file, diver, topic="/a")
        with pytest.raises(TrajectoryError, match="timestep"):
            read_recorded_motion(tmp_path / file, diver, timestep=0.1)
    (tmp_path / "m.csv").write_text(csv_text().replace(LEFT, f"{LEFT}_deg"))
    with pytest.raises(TrajectoryError, match="degrees=False"):
        read_recorded_motion(tmp_path / "m.csv", diver, degrees=False)


@pytest.mark.parametrize("read", [sp.read_recorded_motion, sp.read_shape_path, sp.read_trajectory])
def test_help_shows_every_option_and_an_unknown_one_is_named(read, tmp_path, diver):
    shown = inspect.signature(read).parameters
    defaults = {name: part.default for name, part in shown.items() if part.kind is part.KEYWORD_ONLY}
    assert set(defaults.values()) == {None, False}
    assert {"names", "degrees", "fill", "base_axes"} < set(defaults)
    assert ("trim" in defaults) == (read is not sp.read_trajectory)
    assert not any(part.kind is part.VAR_KEYWORD for part in shown.values())
    (tmp_path / "m.csv").write_text("time\n0\n1\n")
    for name in set(defaults) - {"step"}:
        with pytest.raises(TypeError, match=f"'{name}s'"):
            read(tmp_path / "m.csv", diver, **{f"{name}s": None})


def test_a_table_with_one_row_for_each_joint_is_read_as_one_with_a_column(tmp_path):
    """Loggers of joint states write `time,name,position,velocity,effort`, the joints of a sample below each other."""
    body, times = sp.load_body("diver"), [0.0, 0.5, 1.0, 1.5]
    values = {name: [0.1 * k + 0.2 * place for k in range(4)] for place, name in enumerate(reversed(body.joint_names))}
    rows = [f"{time},{name},{values[name][k]},{0.3 * k},0\n" for k, time in enumerate(times) for name in values]
    file = tmp_path / "joint_states.csv"
    file.write_text("time,name,position,velocity,frame_id\n" + "".join(rows).replace(",0\n", ",\n"))
    recorded = sp.read_recorded_motion(file, body)
    np.testing.assert_allclose(recorded.times, times)
    expected = np.stack([values[name] for name in body.joint_names], axis=1)
    np.testing.assert_allclose(recorded.path.shape(recorded.times), expected, atol=1e-12)
    file.write_text("time,name,position,velocity,frame_id\n" + "".join(rows[:3] + rows[4:]))
    with pytest.raises(TrajectoryError, match="column"):
        sp.read_recorded_motion(file, body)
