"""Studies as files: what is wrong is one line with the entry's name, before anything is computed; and the command."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys

import numpy as np
import pandas
import pytest
import xarray

import shapephase as sp
from shapephase import study as room
from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from shapephase.errors import InputFileNotFoundError, StudyError
from support.study_functions import bend

GOOD = """
body = "cat_two_halves"
motion = "support.study_functions:bend"
outputs = ["turn", "error_estimate"]
draws = 2
chunk = 3
seed = 4

[over.depth]
unit = "deg"
values = [20, 40]

[over.momentum]
distribution = "normal"
mean = [0, 0, 0.01]
deviation = 0.002

[over.masses]
distribution = "lognormal"
deviation = 0.1

[functions.peak]
call = "support.study_functions:peak_rate"
unit = "rad/s"
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def written(text):
        (tmp_path / "study.toml").write_text(text)
        return "study.toml"

    return written


def test_a_file_is_the_study_that_python_makes(write):
    read = room.read_study(write(GOOD))
    over = {
        "depth": np.radians([20.0, 40.0]),
        "momentum": room.Normal([0.0, 0.0, 0.01], 0.002),
        "masses": room.LogNormal(0.1),
    }
    made = room.Study("cat_two_halves", bend, over, draws=2, chunk=3, seed=4)
    assert read.cases == 4
    for index in range(4):
        ours, theirs = read.case(index), made.case(index)
        assert ours.parameters["depth"] == pytest.approx(theirs.parameters["depth"], rel=1e-15)
        np.testing.assert_array_equal(ours.momentum, theirs.momentum)
        np.testing.assert_array_equal(ours.masses, theirs.masses)
    assert [output.name for output in read.resolved_outputs] == ["turn", "error_estimate", "peak"]


def test_even_grids_rigid_bodies_and_files_beside_the_study(write, tmp_path):
    rigid = "[rigid]\ninertia = [[1, 0, 0], [0, 2, 0], [0, 0, 2.5]]\nduration = 3.0\n"
    read = room.read_study(write(rigid + "[over.momentum_z]\nfrom = 0\nto = 1\ncount = 5\n"))
    assert [case.momentum[2] for case in read.some_cases(np.arange(5))] == [0.0, 0.25, 0.5, 0.75, 1.0]
    (tmp_path / "deep").mkdir()
    sp.write_shape_path(bend(0.5), tmp_path / "deep" / "bend.csv")
    (tmp_path / "deep" / "study.toml").write_text(
        'body = "cat_two_halves"\nmotion = "bend.csv"\n[over.joint_noise]\nunit = "deg"\nvalues = [0.1]\n'
    )
    study = room.read_study(tmp_path / "deep" / "study.toml")
    assert study.case(0).joint_noise == pytest.approx(np.radians(0.1))
    assert study.case(0).motion == str(tmp_path / "deep" / "bend.csv")


WRONG = [
    ("body =", "no TOML"),
    (GOOD.replace("draws", "drwas"), "'drwas'. Did you mean 'draws'"),
    (GOOD.replace('"cat_two_halves"', '"cat_two_halvs"'), "cat_two_halves"),
    (GOOD.replace('body = "cat_two_halves"', ""), "one of body and rigid"),
    (GOOD.replace(":bend", ":bendd"), "bendd"),
    (GOOD.replace("over.momentum", "over.momentun"), "'momentun'. Did you mean 'momentum'"),
    (GOOD.replace('"deg"', '"furlong"'), "furlong"),
    (GOOD.replace('unit = "deg"\nvalues', 'unit = "m"\nvalue'), "value"),
    (GOOD.replace("[0, 0, 0.01]\n", '[0, 0, 0.01]\nunit = "rad"\n'), "kg m^2/s"),
    (GOOD.replace("[0, 0, 0.01]", "[0, 0.01]"), "(3,)"),
    (GOOD.replace('"normal"', '"normall"'), "'normall'. Did you mean 'normal'"),
    (GOOD.replace("deviation = 0.1", ""), "deviation is missing"),
    (GOOD.replace("deviation = 0.1", "deviation = -0.1"), "0 or more"),
    (GOOD.replace("[20, 40]", "[]"), "one value or more"),
    (GOOD.replace("[20, 40]", '["a"]'), "over.depth.values"),
    (GOOD.replace("[20, 40]", "[nan]"), "finite"),
    (GOOD.replace('"turn"', '"trun"'), "'trun'. Did you mean 'turn'"),
    (GOOD.replace("draws = 2", "draws = 2.5"), "draws"),
    (GOOD.replace("draws = 2", "draws = 100_000_000_000"), "draws"),
    (GOOD.replace("chunk = 3", 'chunk = "many"'), "chunk"),
    (GOOD.replace("draws = 2", 'draws = 2\ntolerance = "fine"'), "tolerance"),
    (GOOD.replace("[over.masses]", "[over.joint_noise]").replace("deviation = 0.1", "deviation = 0.1\nx = 1"), "'x'"),
    (GOOD.replace("call =", "cal ="), "'cal'"),
    ("over = 3\nbody = 'cat'\nmotion = 'cat_righting'\n", "over"),
]


@pytest.mark.parametrize(("text", "said"), WRONG)
def test_what_is_wrong_in_a_file_is_one_line_and_an_exit_code(text, said, write, tmp_path, capfd):
    with pytest.raises(StudyError) as caught:
        room.read_study(write(text))
    assert said in str(caught.value)
    code, _, err = ended(capfd, "sweep", "study.toml", "--store", "out.zarr")
    assert code == ExitCode.STUDY
    assert len(err.splitlines()) == 1, err
    assert "study.toml: " in err
    assert not (tmp_path / "out.zarr").exists()


def ended(capfd, *arguments):
    """Exit code, standard output and standard error of a command in this process."""
    code = 0
    try:
        main(list(arguments))
    except SystemExit as stop:
        code = int(stop.code or 0)
    said = capfd.readouterr()
    return code, said.out, said.err


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputFileNotFoundError, match=r"nowhere\.toml"):
        room.read_study(tmp_path / "nowhere.toml")


def test_the_store_of_another_study_and_an_unreachable_scheduler_have_codes_of_their_own(write, capfd):
    room.read_study(write(GOOD)).run("out.zarr", workers=0)
    code, _, err = ended(capfd, "sweep", "study.toml", "--store", "out.zarr")
    assert (code, "resume" in err, len(err.splitlines())) == (ExitCode.STUDY, True, 1)
    write(GOOD.replace("seed = 4", "seed = 5"))
    code, _, err = ended(capfd, "sweep", "study.toml", "--store", "out.zarr", "--resume")
    assert (code, "another study" in err, len(err.splitlines())) == (ExitCode.STUDY, True, 1)
    code, _, err = ended(capfd, "sweep", "study.toml", "--store", "nowhere/out.zarr")
    assert (code, len(err.splitlines())) == (ExitCode.OUTPUT, 1)
    code, _, err = ended(capfd, "sweep", "status", "nowhere.zarr")
    assert (code, len(err.splitlines())) == (ExitCode.STUDY, 1)


@pytest.mark.full
def test_an_unreachable_scheduler_has_a_code_of_its_own(write):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    write(GOOD)
    command = [sys.executable, "-m", "shapephase", "sweep", "study.toml", "--store", "out.zarr"]
    path = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    for address in (f"tcp://127.0.0.1:{port}", "no address"):
        done = subprocess.run([*command, "--scheduler", address], capture_output=True, text=True, env=path, timeout=300)
        assert done.returncode == ExitCode.CLUSTER, done.stderr
        assert len(done.stderr.splitlines()) == 1, done.stderr


def test_the_command_says_what_is_stored_and_writes_it(write, capfd):
    study = room.read_study(write(GOOD))
    store = study.run("out.zarr", workers=0)
    code, out, _ = ended(capfd, "sweep", "status", "out.zarr", "--json")
    assert code == 0
    said = json.loads(out)
    assert said["counts"]["done"] == said["cases"] == 4
    assert said["study_hash"] == study.hash
    for name in ("out.nc", "out.parquet", "out.csv"):
        assert ended(capfd, "sweep", "export", "out.zarr", "--out", name)[0] == 0
    table = pandas.read_parquet("out.parquet")
    assert list(table["turn"]) == store.values("turn").tolist()
    assert "masses_3" in table.columns
    assert pandas.read_csv("out.csv")["status"].tolist() == ["done"] * 4
    with xarray.open_dataset("out.nc") as found:
        np.testing.assert_array_equal(found["turn"].values.ravel(), store.values("turn"))
        assert found["turn"].dims == ("depth", "draw")
        assert found["turn"].attrs["units"] == "rad"
    code, _, err = ended(capfd, "sweep", "export", "out.zarr", "--out", "out.txt")
    assert (code, len(err.splitlines())) == (ExitCode.USAGE, 1)


def test_a_sweep_of_the_command_line_fills_a_store_and_goes_on(write, capfd):
    write(GOOD)
    code, out, err = ended(capfd, "sweep", "study.toml", "--store", "out.zarr", "--workers", "1", "-v")
    assert code == 0, err
    assert "done       4" in out
    assert "4 of 4 cases" in err
    assert room.open_study("out.zarr").attributes["command"].startswith("shapephase sweep study.toml")
    code, out, _ = ended(capfd, "sweep", "study.toml", "--store", "out.zarr", "--resume", "--json")
    assert (code, json.loads(out)["counts"]["done"]) == (0, 4)


WALKER = """<mujoco><worldbody><body name="torso"><joint name="lift" type="slide" axis="0 0 1"/>
<joint name="pitch" axis="0 1 0"/><geom type="capsule" size="0.05 0.3"/>
<body name="thigh" pos="0 0.05 -0.3"><joint name="hip" axis="1 0.2 0" limited="false"/>
<geom type="capsule" size="0.04" fromto="0 0 0 0 0.1 -0.4"/></body></body>
<body name="ball"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>
"""
WALKS = """
body = "walker.xml"
motion = "hip.csv"
momentum = [0.1, 0.2, 0.3]
"""


@pytest.mark.usefixtures("warm_engines")
def test_what_floats_of_an_mjcf_is_said_in_the_file_or_to_the_command(write, tmp_path, capfd):
    pytest.importorskip("mujoco")
    (tmp_path / "walker.xml").write_text(WALKER)
    times = np.linspace(0.0, 1.0, 11)
    rows = "".join(f"{t},{np.sin(3.0 * t)}\n" for t in times)
    (tmp_path / "hip.csv").write_text("time,hip [rad]\n" + rows)
    body = sp.load_body("walker.xml", root="free", root_body="torso")
    deformation = sp.articulated(body, sp.read_shape_path("hip.csv", body))
    motion = sp.reconstruct(deformation, [0.1, 0.2, 0.3], tolerance=1e-9)
    command = ["sweep", write(WALKS), "--store", "said.zarr", "--workers", "1"]
    assert ended(capfd, *command, "--root", "free", "--root-body", "torso")[0] == 0
    said = room.open_study("said.zarr")
    np.testing.assert_array_equal(said.values("final_attitude")[0], motion.final_attitude)
    written = room.read_study(write('root = "free"\nroot_body = "torso"\n' + WALKS))
    assert written.hash == said.attributes["study_hash"] != room.read_study(write(WALKS)).hash
    store = room.read_study(write(WALKS)).run("bare.zarr", workers=0)
    ((_, name, text),) = store.errors()
    assert (name, "root_body" in text) == ("ModelFileError", True)
    code, _, err = ended(capfd, *command, "--root", "fixed")
    assert (code, "'fixed'" in err, len(err.splitlines())) == (ExitCode.USAGE, True, 1)


def test_a_rigid_body_has_no_root():
    with pytest.raises(StudyError, match="root_body"):
        room.Study(room.RigidBody(np.eye(3), 1.0), root_body="torso")


def test_folders_of_packages_stand_beside_the_study(write, tmp_path, monkeypatch):
    (tmp_path / "ours").mkdir()
    write(
        'body = "cat_two_halves"\nmotion = "kane_scher"\nparameters = {alpha = 0, beta = 0.5}\n'
        'packages = ["ours", "nowhere"]\n'
    )
    monkeypatch.chdir(tmp_path / "ours")
    assert room.read_study(tmp_path / "study.toml").packages == [str(tmp_path / "ours"), "nowhere"]
