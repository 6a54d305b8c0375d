"""The command line: its tables, JSON, files, and one line for every fault."""

import hashlib
import json
import re
import subprocess
import sys

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.body.catalog import robots_folder
from shapephase.cli.main import main
from shapephase.examples import cat_righting

CAT = ["split", "cat", "cat_righting"]


def run(capsys, *arguments):
    main([str(a) for a in arguments])
    return capsys.readouterr().out


def failed(capsys, *arguments):
    with pytest.raises(SystemExit) as stopped:
        main([str(a) for a in arguments])
    said = capsys.readouterr()
    *doubts, _ = said.err.strip().splitlines()
    assert all(doubt.startswith("shapephase: warning: ") for doubt in doubts)
    assert "Traceback" not in said.err
    return stopped.value.code, said.err, said.out


def test_the_cat_s_righting_as_a_table(capsys):
    text = run(capsys, *CAT)
    assert re.search(
        r"total rotation                180\.000000    \d\.\de-1\d   \( 1\.000000  0\.000000  0\.000000\)", text
    )
    assert "no angular momentum" in text
    assert "error estimate" in text


@pytest.mark.usefixtures("interpreted")
def test_json_holds_the_split(capsys):
    data = json.loads(run(capsys, *CAT, "--momentum", 0.01, -2e-2, 0, "--attitude", 0, 0, 1, 0, "--json"))
    start = np.diag([-1.0, -1.0, 1.0])
    motion = sp.reconstruct(sp.articulated(sp.load_body("cat"), cat_righting()), [0.01, -0.02, 0.0], start)
    split = sp.split(motion)
    for name in (
        "total_rotation",
        "holonomy",
        "dynamical_rotation",
        "closing_tilt",
        "montgomery_phase",
        "residual",
        "gauge",
    ):
        assert np.all(np.array(data[name]) == np.array(getattr(split, name)))
    for name, error in data["error_estimates"].items():
        assert error == getattr(split.error_estimates, name)
        assert 0.0 < error < 1e-8 or (error == 0.0 and name == "wheel_rotation")
        assert name in data
    assert data["is_loop"] is True
    assert data["has_phase"] is True
    assert data["momentum_kg_m2_s"] == [0.01, -0.02, 0.0]
    np.testing.assert_allclose(data["final_attitude_quat_xyzw"], motion.quat_xyzw(motion.duration), atol=1e-15, rtol=0)


@pytest.mark.parametrize(
    ("words", "time"),
    [
        (("-0.1", "0.2", "-0.3"), 0.0),
        (("-0.1 0.2 -0.3 rad/s",), 1.5),
        (("-5.729577951308232,11.459155902616464,-17.188733853924695 deg/s",), 0.0),
    ],
)
def test_a_rate_in_place_of_the_momentum(words, time, capsys):
    """The motion has it at its time, in base axes."""
    data = json.loads(run(capsys, *CAT, "--rate", *words, "--rate-time", time, "--json"))
    start = so3.matrix_from_quat(np.array(data["initial_attitude_quat_xyzw"]))
    moving = sp.articulated(sp.load_body("cat"), cat_righting())
    motion = sp.reconstruct(moving, data["momentum_kg_m2_s"], start)
    np.testing.assert_allclose(motion.angular_velocity(time), [-0.1, 0.2, -0.3], atol=1e-8)


def test_gauge_and_tolerance(capsys):
    data = json.loads(run(capsys, *CAT, "--momentum", 0.01, 0, 0, "--gauge", "base", "--tolerance", 1e-6, "--json"))
    assert data["gauge"] == "base"
    assert 1e-13 < data["error_estimate_rad"] <= 1e-6
    table = run(capsys, *CAT, "--momentum", 0.01, 0, 0)
    assert "seen in the horizontal gauge" in table
    assert "Montgomery phase" in table


def test_every_number_of_the_table_has_its_error_beside_it(capsys):
    """And an axis the digits that its error leaves: with a looser tolerance fewer."""
    command = (*CAT, "--momentum", 1e-6, 0, 0)
    data = json.loads(run(capsys, *command, "--tolerance", 1e-5, "--json"))
    lines = {line[:24].strip(): line for line in run(capsys, *command, "--tolerance", 1e-5).splitlines()}
    rows = {
        "total rotation",
        "shape holonomy",
        "dynamical rotation",
        "Montgomery phase",
        "dynamic phase",
        "tilt of the closing",
    }
    for row in rows | {"geometric phase", "momentum gap"}:
        name = row.lower().replace("tilt of the closing", "closing tilt").replace(" ", "_").replace("shape_", "")
        assert lines[row][40:51] == f"{data['error_estimates'][name]:11.1e}"
    turn = so3.angle(np.array(data["dynamical_rotation"]))
    known = data["error_estimates"]["dynamical_rotation"] / turn
    shown = lines["dynamical rotation"][51:].strip(" ()").split()
    assert 1e-12 < known < 1.0
    assert all(10.0 ** -len(entry.partition(".")[2]) >= known for entry in shown)


def test_files_in_and_out(capsys, tmp_path):
    body = sp.load_body("cat")
    path = cat_righting()
    sp.write_shape_path(path, tmp_path / "m.npz", np.linspace(0, path.duration, 801))
    run(capsys, "split", "cat", tmp_path / "m.npz", "--out", tmp_path / "result.npz", "--momentum", 0, 0, 0.02)
    motion = sp.load_motion(tmp_path / "result.npz")
    truth = sp.reconstruct(sp.articulated(body, path), [0, 0, 0.02])
    assert so3.angle(motion.final_attitude.T @ truth.final_attitude) < 1e-8


def test_an_open_path_says_so(capsys):
    text = run(capsys, "split", "satellite", "antenna_deployment", "--momentum", 0, 0, 3)
    assert "shape lift (open)" in text
    assert "shape gap" in text


def test_orbits_are_those_that_close(capsys):
    text = run(capsys, "orbits", "cat", "cat_righting", 0.02)
    assert "all: their indices sum to 2" in text
    assert "shape holonomy (base axes)      180.000000" in text
    data = json.loads(run(capsys, "orbits", "cat", "cat_righting", 0.02, "--gauge", "base", "--json"))
    assert data["complete"]
    assert sum(orbit["index"] for orbit in data["orbits"]) == data["index_sum"] == 2
    deformation = sp.articulated(sp.load_body("cat"), cat_righting())
    for orbit in data["orbits"]:
        up = np.array([0.0, 0.0, 1.0])
        start = so3.transpose(so3.between(up, np.array(orbit["momentum_direction_at_start"])))
        motion = sp.reconstruct(deformation, 0.02 * up, start, tolerance=1e-11)
        about = so3.exp(orbit["montgomery_phase"] * up)
        assert so3.angle(about.T @ motion.final_attitude @ start.T) < 1e-9


def test_check_is_a_card_and_a_verdict(capsys, tmp_path):
    text = run(capsys, "check", "satellite", "antenna_deployment")
    for said in (
        "satellite: 139.5 kg, 16 links, 10 joints",
        "wheel_spin        continuous        none        none rad",
    ):
        assert said in text
    assert "no: boom_extension ends 1.8 m from its start" in text
    assert text.endswith("verdict: OK\n")
    (tmp_path / "swing.csv").write_text(
        "time,left_shoulder_abduction,right_shoulder_abduction,qx,qy,qz,qw\n0,0,0,0,0,0,1\n1,4,1,0,0,0,1\n2,0,0,0,0,0,1\n"
    )
    data = json.loads(run(capsys, "check", "diver", tmp_path / "swing.csv", "--json"))
    assert data["motion"]["beyond"] == ["left_shoulder_abduction"]
    assert data["motion"]["is_loop"]
    assert data["motion"]["samples"] == 3
    assert data["motion"]["base_recorded"]
    assert len(data["warnings"]) == 1
    assert "left_shoulder_abduction" in data["warnings"][0]
    assert data["verdict"] == "OK, 1 warning"
    body = sp.load_body("diver")
    assert data["body"]["mass"] == body.mass
    assert data["body"]["sha256"] == hashlib.sha256((robots_folder() / "diver.urdf").read_bytes()).hexdigest()
    np.testing.assert_allclose(
        data["body"]["principal_moments"], np.linalg.eigvalsh(body.locked_inertia(body.shape())), rtol=1e-12
    )


def test_check_names_joints_that_are_too_fast(capsys, tmp_path):
    """By a sine of 31 rad/s, and one of 29; the file of the cat states 30."""
    times = np.linspace(0.0, 0.2, 101)
    frequency = 2.0 * np.pi / 0.2
    for rate, too_fast in ((31.0, ["waist_yaw"]), (29.0, [])):
        rows = [f"{t:.17g},{rate / frequency * np.sin(frequency * t):.17g}" for t in times]
        (tmp_path / "sway.csv").write_text("\n".join(["time,waist_yaw", *rows]))
        data = json.loads(run(capsys, "check", "cat", tmp_path / "sway.csv", "--rest-missing", "--json"))
        assert data["motion"]["too_fast"] == too_fast
        assert data["verdict"] == ("OK, 1 warning" if too_fast else "OK")
        assert all("waist_yaw 31 of 30 rad/s" in warning for warning in data["warnings"])
    assert "beyond their rates" not in run(capsys, "check", "cat", "cat_righting")


def test_a_cat_of_the_library_begins_on_its_back(capsys):
    """Unless an attitude is given; recordings begin at the identity."""
    data = json.loads(run(capsys, "split", "cat", "cat_righting_twist", "--json"))
    assert np.abs(data["initial_attitude_quat_xyzw"]) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-15)
    assert data["final_attitude_quat_xyzw"] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-9)
    assert "attitude at the start (1 0 0 0)" in run(capsys, "split", "cat", "cat_righting")
    data = json.loads(run(capsys, "split", "cat", "cat_righting", "--attitude", 0, 0, 0, 1, "--json"))
    assert data["initial_attitude_quat_xyzw"] == [0.0, 0.0, 0.0, 1.0]
    assert np.abs(data["final_attitude_quat_xyzw"]) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-9)
    data = json.loads(run(capsys, "split", "cat", "cat_righting", "--momentum", 0.01, 0, 0.02, "--json"))
    start = np.diag([1.0, -1.0, -1.0])
    known = sp.reconstruct(sp.articulated(sp.load_body("cat"), cat_righting()), [0.01, 0.0, 0.02], start)
    assert data["final_attitude_quat_xyzw"] == pytest.approx(known.quat_xyzw(2.0), abs=1e-12)


def test_a_recorded_base_is_compared(capsys, tmp_path):
    """The base as it was reconstructed, written down, turned as a whole and read again: no difference."""
    body, path = sp.load_body("cat"), cat_righting()
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.02])
    times = np.linspace(0.0, path.duration, 401)
    turned = so3.exp(np.array([0.3, -0.2, 0.9]))
    base = so3.quat_from_matrix(turned @ motion.attitude(times))
    np.savez(
        tmp_path / "m.npz",
        time=times,
        shapes=path.shape(times),
        joint_names=np.array(path.joint_names),
        base_quat_xyzw=base,
    )
    momentum = (turned @ [0.0, 0.0, 0.02]).tolist()
    data = json.loads(run(capsys, "split", "cat", tmp_path / "m.npz", "--momentum", *momentum, "--json"))
    assert data["recorded_base_difference_rad"] < 1e-7
    final = turned @ motion.final_attitude
    np.testing.assert_allclose(so3.matrix_from_quat(np.array(data["final_attitude_quat_xyzw"])), final, atol=1e-7)
    assert set(data["sha256"]) == {"body", "path"}
    other = json.loads(run(capsys, "split", "cat", tmp_path / "m.npz", "--momentum", 0, 0, 0, "--json"))
    ours = sp.reconstruct(sp.articulated(body, path), np.zeros(3)).attitude(times)
    apart = so3.angle(so3.transpose(ours[0].T @ ours) @ motion.attitude(0.0).T @ motion.attitude(times))
    assert other["recorded_base_difference_rad"] == pytest.approx(apart.max(), abs=1e-6)
    fitted = run(capsys, "split", "cat", tmp_path / "m.npz")
    assert f"all from 0 to {path.duration:g} s" in fitted.splitlines()[0]
    assert "base as recorded" in fitted


def test_robots_lists_bodies_and_motions(capsys):
    text = run(capsys, "robots")
    for name in ("astronaut", "cat_two_halves", "antenna_deployment", "kane_scher", "example:human"):
        assert name in text
    data = json.loads(run(capsys, "robots", "--json"))
    assert data["bodies"]["diver"]["joints"] == list(sp.load_body("diver").joint_names)
    assert data["motions"]["cat_righting"]["body"] == "cat"


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["splt"], 2, "split"),
        (["split", "cat"], 2, "MOTION"),
        ([*CAT, "--momentum", "1", "2"], 2, "--momentum"),
        ([*CAT, "--momentum", "1", "2", "x"], 2, "--momentum"),
        ([*CAT, "--momentum", "nan", "0", "0"], 2, "momentum: entry [0] is nan"),
        ([*CAT, "--momentm", "1", "2", "3"], 2, "--momentum"),
        ([*CAT, "--rate", "0 0 1", "--momentum", "0", "0", "1"], 2, "leave one of them out"),
        ([*CAT, "--rate", "0", "1", "furlong/s"], 2, "--rate '0 0 2 deg/s'"),
        ([*CAT, "--rate", "0 0 1 furlong/s"], 2, "--rate '0 0 2 deg/s'"),
        ([*CAT, "--rate", "0 nan 1"], 2, "rate: entry [1] is nan"),
        ([*CAT, "--rate-time", "1"], 2, "--rate-time is the time of --rate"),
        ([*CAT, "--rate", "0 0 1", "--rate-time", "5"], 4, "lies outside the motion"),
        ([*CAT, "--attitude", "0", "0", "0", "0"], 2, "quaternion"),
        ([*CAT, "--gauge", "vertical"], 2, "horizontal, base, principal"),
        ([*CAT, "--tolerance", "1e-20"], 2, "tolerance"),
        ([*CAT, "--out", "result.txt"], 2, ".npz"),
        ([*CAT, "--out", "no/such/folder/r.npz"], 2, "no such folder"),
        (
            ["split", "dog", "cat_righting"],
            2,
            "astronaut, astronaut_female, astronaut_suited, cat, cat_two_halves, cat_untwisted, diver, satellite",
        ),
        (["split", "no/such.urdf", "cat_righting"], 2, "no such file"),
        (["split", "cat", "dancing"], 2, "cat_righting"),
        (["split", "cat", "no/such.csv"], 2, "no such file"),
        (["split", "cat", "kane_scher"], 4, "lacks these joints"),
        (["orbits", "satellite", "antenna_deployment", "1"], 4, "closed orbits need a loop"),
        (["orbits", "cat", "cat_righting", "0"], 2, "magnitude"),
        (["orbits", "cat", "cat_righting", "1", "--gauge", "link:wing"], 2, "link of cat"),
    ],
)
def test_faults_take_one_line_and_an_exit_code(capsys, arguments, code, said):
    got, text, _ = failed(capsys, *arguments)
    assert got == code
    assert said in text


@pytest.mark.usefixtures("warm_readers")
def test_faults_of_files_have_their_codes(capsys, tmp_path):
    (tmp_path / "bad.urdf").write_text("<robot name='r'><link name='a'>")
    assert failed(capsys, "split", tmp_path / "bad.urdf", "cat_righting")[0] == 3
    (tmp_path / "m.csv").write_text("time,left_shoulder_abduction,right_shoulder_abduction\n0,0,0\n0,1,1\n")
    code, text, out = failed(capsys, "split", "diver", tmp_path / "m.csv", "--json")
    assert code == 4
    assert "row 3" in text
    assert json.loads(out)["error"]["type"] == "TrajectoryError"
    (tmp_path / "rod.urdf").write_text(
        "<robot name='rod'><link name='a'><inertial><mass value='1'/>"
        "<inertia ixx='0' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>"
        "<link name='b'/><joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>"
    )
    (tmp_path / "j.csv").write_text("time,j\n0,0\n1,1\n")
    code, text, _ = failed(capsys, "split", tmp_path / "rod.urdf", tmp_path / "j.csv")
    assert code == 5
    assert "not positive definite" in text


def test_as_a_program(capfd):
    done = subprocess.run(
        [sys.executable, "-m", "shapephase", *CAT, "--json"], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout)["body"] == "cat"
    with pytest.raises(SystemExit) as ended:
        main(["split", "dog", "x"])
    assert ended.value.code == 2
    assert capfd.readouterr().out == ""
