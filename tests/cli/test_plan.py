"""`shapephase plan`: what it finds, what it writes, and what it refuses."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.cli.main import main
from shapephase.cli.plans import search as cli_search
from shapephase.cli.progress import steps

# A plan on few pieces.
SHORT = ("cat_two_halves", "--turn", "60 about x", "--pieces", "8")


@pytest.mark.usefixtures("few_guesses")
def test_a_plan_is_found_written_and_read_again(tmp_path, capsys):
    out = tmp_path / "plan.csv"
    main(["plan", *SHORT, "--duration", "0.8", "--out", str(out), "--json"])
    said = capsys.readouterr()
    assert re.fullmatch(rf"wrote {re.escape(str(out))} \([0-9.]+ kB\)\n", said.err)
    data = json.loads(said.out)
    assert data["miss_rad"] < 1e-8
    assert data["duration_s"] == 0.8
    goal = so3.exp(np.array([np.pi / 3.0, 0.0, 0.0]))
    assert np.abs(data["final_attitude_quat_xyzw"] - so3.quat_from_matrix(goal)).max() < 1e-8
    body = sp.load_body("cat_two_halves")
    again = sp.reconstruct(sp.articulated(body, sp.read_shape_path(out, body)), np.zeros(3))
    assert so3.angle(again.final_attitude.T @ goal) < 1e-5
    shapes = sp.read_shape_path(out, body).shape(np.linspace(0.0, 0.8, 100))
    assert np.all((shapes >= body.joint_limits[:, 0] - 1e-9) & (shapes <= body.joint_limits[:, 1] + 1e-9))


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("cat_two_halves",), 2, "--turn"),
        (("cat_two_halves", "--turn", "90 about x", "--somersaults", 1), 2, "--turn and --somersaults are two goals"),
        (("cat_two_halves", "--turn", "90 about x", "--cost", "beauty"), 2, "kinetic, rate"),
        (("cat_two_halves", "--turn", "90 about x", "--point", "0 0 1", "0 0 1"), 2, "--turn and --point"),
        (("cat_two_halves", "--turn", "90"), 2, "90 about y"),
        (("cat_two_halves", "--turn", "90 about w"), 2, "--turn"),
        (("cat_two_halves", "--turn", "nan about x"), 2, "--turn"),
        (("cat_two_halves", "--point", "0 0", "0 0 1"), 2, "--point"),
        (("cat_two_halves", "--point", "tail 0 0 1", "0 0 1"), 2, "tail"),
        (("cat_two_halves", "--turn", "9 about x", "--symmetry", "0 about x"), 2, "4 about x"),
        (("cat_two_halves", "--turn", "9 about x", "--symmetry", "w"), 2, "--symmetry"),
        (("cat_two_halves", "--somersaults", 1, "--symmetry", "x"), 2, "--symmetry"),
        (("cat_two_halves", "--turn", "9 about x", "--from", "waist_yaw"), 2, "waist_yaw"),
        (("cat_two_halves", "--turn", "9 about x", "--from", "waist_yaw=1,2"), 2, "JOINT=VALUE"),
        (("cat_two_halves", "--turn", "9 about x", "--to", "waist_yaw=1m"), 2, "--to"),
        (("cat_two_halves", "--turn", "9 about x", "--to", "waist_bend=1"), 2, "waist_bend"),
        (("cat_two_halves", "--turn", "9 about x", "--via", "waist_yaw=1@soon"), 2, "--via"),
        (("cat_two_halves", "--turn", "9 about x", "--via", "there.csv"), 2, "FILE@TIME"),
        (("cat_two_halves", "--turn", "9 about x", "--via", "waist_yaw"), 2, "--via"),
        (("cat_two_halves", "--turn", "9 about x", "--joints", "waist_yaw,-waist_roll"), 2, "not both"),
        (("cat_two_halves", "--turn", "9 about x", "--mirror", "waist_yaw"), 2, "--mirror"),
        (("cat_two_halves", "--turn", "9 about x", "--effort", "strong"), 2, "--effort"),
        (("cat_two_halves", "--turn", "9 about x", "--jerk-limit", -1), 2, "jerk_limits"),
        (("cat_two_halves", "--turn", "9 about x", "--workers", 0), 2, "--workers"),
        (("cat_two_halves", "--turn", "9 about x", "--time-limit", 0), 2, "--time-limit"),
        (("cat_two_halves", "--turn", "90 about x", "--out", "plan.txt"), 2, "--out"),
        (("cat_two_halves", "--undo", "kane_scher", "--turn", "9 about x"), 2, "--turn and --undo are two goals"),
        (("cat_two_halves", "--undo", "kane_scher", "--from", "waist_yaw=1"), 2, "--from: the postures at both ends"),
        (("cat_two_halves", "--undo", "kane_scher", "--rates-at-ends", "free"), 2, "--rates-at-ends"),
        (("cat_two_halves", "--undo", "kane_scher", "--symmetry", "x"), 2, "not with --undo"),
        (("cat_two_halves", "--undo", "kane_scher", "--momentum", 0, 0, 0.01), 2, "--duration"),
        (("cat_two_halves", "--turn", "9 about x", "--flight", "auto"), 2, "--flight: goes with --undo"),
        (("cat_two_halves", "--turn", "9 about x", "--attitude", 1, 0, 0, 0), 2, "--attitude: goes with --undo"),
        (("cat_two_halves", "--match", "kane_scher@9"), 2, "a time from 0 to 1 s is needed, got '9'"),
        (("no_such_cat", "--turn", "90 about x"), 2, "no_such_cat"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_one_line(arguments, code, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["plan", *map(str, arguments)])
    assert ended.value.code == code
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def planned(*arguments, capsys, out):
    """What the command says of a plan on few pieces, and its path's shapes at 101 times."""
    main(["plan", *map(str, arguments), "--pieces", "8", "--out", str(out), "--json"])
    body = sp.load_body(arguments[0])
    path = sp.read_shape_path(out, body)
    return json.loads(capsys.readouterr().out), path.shape(np.linspace(0.0, path.duration, 101)), body


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_link_is_pointed(tmp_path, capsys):
    """By the attitude printed and the link's frame as the body has it at the posture asked for."""
    direction = np.array([0.3, -1.0, 2.5])
    arguments = ("cat_two_halves", "--point", "rear 0 0 1", "0.3 -1.0 2.5", "--to", "waist_pitch=0.4,waist_yaw=20deg")
    data, shapes, body = planned(*arguments, "--joints", "-waist_roll", capsys=capsys, out=tmp_path / "plan.csv")
    end = np.zeros(3)
    end[[body.joint_index("waist_pitch"), body.joint_index("waist_yaw")]] = 0.4, np.radians(20.0)
    assert np.abs(shapes[-1] - end).max() < 1e-9
    attitude = so3.matrix_from_quat(np.array(data["final_attitude_quat_xyzw"]))
    seen = attitude @ body.link_pose(end, "rear")[:3, :3] @ [0.0, 0.0, 1.0]
    assert np.abs(seen - direction / np.linalg.norm(direction)).max() < 1e-8
    assert not shapes[:, body.joint_index("waist_roll")].any()


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_postures_lists_and_mirrors(tmp_path, capsys):
    """A plan ends where another ended, and a joint moves against its leader."""
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    knots = np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.0], [0.0, 0.2, 0.1]])
    times, names = np.array([0.0, 0.5, 1.0]), sp.load_body("cat_two_halves").joint_names
    sp.write_shape_path(sp.ShapePath.spline(times, knots, joint_names=names), first)
    turn = ("cat_two_halves", "--turn", "10 about 0,1,1", "--from", "waist_roll=0.1", "--to", first)
    _, onward, _ = planned(*turn, capsys=capsys, out=second)
    assert np.abs(onward[-1] - knots[-1]).max() < 1e-12
    assert np.abs(onward[0] - [0.0, 0.0, 0.1]).max() < 1e-12
    follow = ("--joints", "waist_pitch,waist_yaw,waist_roll", "--mirror", "waist_yaw=-waist_pitch")
    data, bound, body = planned("cat_two_halves", "--turn", "5 about x", *follow, capsys=capsys, out=second)
    pitch, yaw = body.joint_index("waist_pitch"), body.joint_index("waist_yaw")
    assert np.abs(bound[:, pitch] + bound[:, yaw]).max() < 1e-12
    assert np.ptp(bound[:, pitch]) > 0.01
    assert data["miss_rad"] < 1e-8


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_limits_hold_and_are_told(tmp_path, capsys):
    """Second and third differences of the file's shapes, between which they do not change much."""
    limits = ("--effort", "0.2", "--acceleration-limit", "12", "--jerk-limit", "120", "--cost", "effort")
    data, _, body = planned(
        "cat_two_halves", "--turn", "20 about x", "--duration", 2, *limits, capsys=capsys, out=tmp_path / "plan.csv"
    )
    times = np.linspace(0.0, 2.0, 2001)
    shapes = sp.read_shape_path(tmp_path / "plan.csv", body).shape(times)
    for order, name, most in ((2, "acceleration", 12.0), (3, "jerk", 120.0)):
        share = np.abs(np.diff(shapes, order, axis=0)).max() / 1e-3**order / most
        assert share < 1.0 + 1e-4
        assert data["limit_shares"][name] == pytest.approx(share, abs=0.05)
    assert 0.1 < data["limit_shares"]["effort"] < 1.0 + 1e-6
    assert (data["cost_name"], data["cost_unit"]) == ("effort", "s")


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_time_limit_ends_the_search_with_the_best_so_far(tmp_path, capsys):
    """The time is over after the first iteration, with a file that says so and is read all the same."""
    out = tmp_path / "plan.csv"
    with pytest.raises(SystemExit) as ended:
        main(["plan", *SHORT, "--time-limit", "1e-6", "--out", str(out), "--json"])
    assert ended.value.code == 124
    data = json.loads(capsys.readouterr().out)
    assert data["status"] == "out of time"
    assert "time limit" in data["warnings"][0]
    assert out.read_text().startswith("# shapephase plan, cat_two_halves: out of time; ")
    body = sp.load_body("cat_two_halves")
    assert sp.read_shape_path(out, body).duration == 1.0


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_postures_on_the_way(tmp_path, capsys):
    """One by its joints, one of a motion file at its time; each is where the file has it."""
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    body, knots = sp.load_body("cat_two_halves"), [[0.0, 0.0, 0.0], [0.1, -0.2, 0.1], [0.0, 0.2, 0.1]]
    sp.write_shape_path(sp.ShapePath.spline([0.0, 0.5, 1.0], knots, joint_names=body.joint_names), first)
    via = ("--via", "waist_roll=20deg", "--via", f"{first}@0.6", "--duration", 2)
    data, other, _ = planned("cat_two_halves", "--turn", "10 about z", *via, capsys=capsys, out=second)
    early, late = data["waypoint_times_s"]
    assert 0.0 < early < late == 0.6
    assert np.abs(other[30] - sp.read_shape_path(first, body).shape(0.6)).max() < 1e-8
    passed = sp.read_shape_path(second, body).shape(early)
    assert abs(passed[body.joint_index("waist_roll")] - np.radians(20.0)) < 1e-7
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cat_two_halves", "--turn", "10 about z", "--via", f"{first}@1.5"])
    assert ended.value.code == 2
    assert "ends at 1 s" in capsys.readouterr().err


@pytest.mark.usefixtures("few_guesses")
def test_a_motion_is_undone(tmp_path, capsys):
    """A stored motion is taken back from its end to its start, by the path written, too."""
    stored, out = tmp_path / "motion.npz", tmp_path / "back.csv"
    body, half = sp.load_body("cat_two_halves"), [[0.0, 0.0, 0.1], [0.5, -0.4, 0.3], [0.2, 0.1, -0.1]]
    path = sp.ShapePath.waypoints([0.0, 0.5, 1.0], half, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0], so3.exp(np.array([0.3, -0.2, 0.1])))
    motion.save(stored)
    words = ("plan", "cat_two_halves", "--undo", str(stored), "--pieces", "12", "--mass-error", "0.05")
    main([*words, "--out", str(out), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert data["best"] == "plan"
    assert set(data["ways_back"]) == {"backwards", "plan"}
    for way in data["ways_back"].values():
        assert way["undoes"]
        assert way["keeps_limits"]
        assert way["duration_s"] == 1.0
        assert np.abs(way["final_attitude_quat_xyzw"] - so3.quat_from_matrix(motion.initial_attitude)).max() < 1e-8
    assert data["ways_back"]["plan"]["cost"] < data["ways_back"]["backwards"]["cost"]
    back = sp.read_shape_path(out, body)
    again = sp.reconstruct(sp.articulated(body, back), [0.0, 0.0, 0.0], motion.final_attitude)
    assert so3.angle(again.final_attitude.T @ motion.initial_attitude) < 1e-8
    bars = sp.uncertainty(again, inertias=sp.InertiaErrors(masses=0.05))
    assert np.allclose(data["uncertainty"]["final_attitude"], bars.final_attitude, rtol=1e-5)


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_motion_with_momentum_is_undone_at_a_time(tmp_path, capsys):
    """From a table of the joints alone; the table says that playing backwards does not undo."""
    table = tmp_path / "joints.csv"
    body, knots = sp.load_body("cat_two_halves"), [[0.0, 0.0, 0.0], [0.4, -0.2, 0.1], [0.0, 0.2, 0.1]]
    sp.write_shape_path(sp.ShapePath.spline([0.0, 0.5, 1.0], knots, joint_names=body.joint_names), table)
    words = ("--momentum", "0.002", "0", "0.002", "--duration", "1.4", "--pieces", "12")
    main(["plan", "cat_two_halves", "--undo", str(table), *words, "--attitude-error", "0.01"])
    shown = capsys.readouterr().out
    assert "best: the plan" in shown
    assert re.search(r"Played backwards it ends \d.* deg off: the momentum turns the body on\.", shown)
    assert re.search(r"limits +kept +kept", shown)
    # Attitudes flow without change of volume: some error of the end is no smaller than that of the start.
    worst = float(re.search(r"attitude at the end +± ([0-9.]+) +deg about the worst axis", shown)[1])
    assert worst > np.degrees(0.0099)


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_posture_and_attitude_of_a_motion_are_matched(tmp_path, capsys):
    body, turned, stored = sp.load_body("cat_two_halves"), np.array([0.1, 0.2, 0.0]), tmp_path / "motion.npz"
    knots = [[0.0, 0.0, 0.0], [0.4, -0.2, 0.1], [0.0, 0.2, 0.1]]
    path = sp.ShapePath.spline([0.0, 0.5, 1.0], knots, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0], so3.exp(turned))
    motion.save(stored)
    for at, seconds, start in (("", 1.0, np.zeros(3)), ("@0.4", 0.4, np.array([0.0, -0.1, 0.2]))):
        quat = map(str, so3.quat_from_matrix(so3.exp(start)))
        words = ("--match", f"{stored}{at}", "--attitude", *quat)
        data, shapes, _ = planned("cat_two_halves", *words, capsys=capsys, out=tmp_path / "plan.csv")
        attitude = so3.exp(start) @ so3.matrix_from_quat(np.array(data["final_attitude_quat_xyzw"]))
        assert so3.angle(attitude.T @ motion.attitude(seconds)) < 1e-8
        assert np.abs(shapes[-1] - path.shape(seconds)).max() < 1e-9


def test_what_is_shown_of_a_search_says_how_far_off_it_is_and_how_long_it_may_take(monkeypatch):
    said = []
    monkeypatch.setattr(cli_search.time, "monotonic", iter([100.0, 103.0, 170.0]).__next__)
    search = cli_search.InterruptibleSearch(SimpleNamespace(watch=lambda *now: said.append(now)), 60.0)
    for share in (0.25, 0.5):
        assert not search.report(share, "search 2 of 4: iteration 12")
    assert said == [(0.25, "search 2 of 4: iteration 12, 57 s left"), (0.5, "search 2 of 4: iteration 12, 0 s left")]


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_of_several_turns_the_cheapest_is_made(tmp_path, capsys):
    one, _, _ = planned("cat_two_halves", "--turn", "-8 about 0,1,0", capsys=capsys, out=tmp_path / "one.csv")
    several = ("--turn", "110 about x", "--turn", "-8 about 0,1,0")
    assert planned("cat_two_halves", *several, capsys=capsys, out=tmp_path / "two.csv")[0]["cost"] == one["cost"]


@pytest.mark.full
def test_a_symmetry_on_the_command_line(tmp_path, capsys):
    for arguments, goal in (
        (("--turn", "170 about z", "--symmetry", "2 about z"), [0.0, 0.0, np.radians(-10.0)]),
        (("--point", "-1 0 0", "1 0 0.2", "--symmetry", "2 about z"), [0.0, -np.arctan(0.2), 0.0]),
    ):
        data, _, _ = planned("cat_two_halves", *arguments, capsys=capsys, out=tmp_path / "plan.csv")
        attitude = so3.matrix_from_quat(np.array(data["final_attitude_quat_xyzw"]))
        wanted = so3.exp(np.array(goal))
        assert np.abs(attitude[:, 0] - wanted[:, 0]).max() < 1e-8, arguments


@pytest.mark.full
def test_workers_find_what_one_process_finds(tmp_path, capsys):
    arguments = ("cat_two_halves", "--turn", "70 about x", "--starts", 3)
    alone, shapes, _ = planned(*arguments, capsys=capsys, out=tmp_path / "one.csv")
    beside, same, _ = planned(*arguments, "--workers", 2, capsys=capsys, out=tmp_path / "two.csv")
    assert alone["cost"] == beside["cost"]
    assert np.array_equal(shapes, same)


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_page_says_that_nothing_was_found(tmp_path):
    page = tmp_path / "plan.html"
    with pytest.raises(SystemExit) as ended:
        main(["plan", *SHORT, "--time-limit", "1e-6", "--html", str(page)])
    assert ended.value.code == 124
    assert "The search ended by its time limit; this is the best until then: off the goal by" in page.read_text()


@pytest.mark.usefixtures("few_guesses")
def test_ctrl_c_keeps_the_best_so_far(tmp_path, monkeypatch, capsys):
    """The signal itself, in the third iteration; the motion written reaches the goal nearly."""
    plain = cli_search.InterruptibleSearch.report

    def pressed(self, share, text):
        if text.startswith("search: iteration 3,"):
            signal.raise_signal(signal.SIGINT)
        return plain(self, share, text)

    monkeypatch.setattr(cli_search.InterruptibleSearch, "report", pressed)
    handler = signal.getsignal(signal.SIGINT)
    out = tmp_path / "plan.csv"
    with pytest.raises(SystemExit) as ended:
        main(["plan", *SHORT, "--out", str(out), "--json"])
    assert ended.value.code == 130
    assert signal.getsignal(signal.SIGINT) is handler
    said = capsys.readouterr()
    data = json.loads(said.out)
    assert data["miss_rad"] < 1e-8
    assert "stopped" in data["warnings"][0]
    assert [line.split()[0] for line in said.err.splitlines()] == ["wrote", "shapephase:"]
    body = sp.load_body("cat_two_halves")
    again = sp.reconstruct(sp.articulated(body, sp.read_shape_path(out, body)), np.zeros(3))
    assert so3.angle(again.final_attitude.T @ so3.exp(np.array([np.pi / 3.0, 0.0, 0.0]))) < 1e-5


def hears_of_ctrl_c(process):
    """Whether a process has a handler for it, by the kernel's list."""
    caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{process}/status").read_text())
    return bool(int(caught[1], 16) >> (signal.SIGINT - 1) & 1)


@pytest.mark.full
def test_ctrl_c_ends_what_searches_beside(tmp_path):
    """As soon as they hear of it; they are gone when the command is, and the best of what they had is written."""
    out = tmp_path / "plan.csv"
    words = ("cat", "--turn", "60 about x", "--starts", "40", "--workers", "2", "--out", str(out))
    with subprocess.Popen(
        [sys.executable, "-m", "shapephase", "plan", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as command:
        beside = Path(f"/proc/{command.pid}/task/{command.pid}/children")
        # The first is Python's own tracker of what they share.
        while command.poll() is None and sum(hears_of_ctrl_c(one) for one in beside.read_text().split()[1:]) < 2:
            time.sleep(0.01)
        workers = beside.read_text().split()[1:]
        command.send_signal(signal.SIGINT)
        _, said = command.communicate(timeout=300)
    assert command.returncode == 130
    assert "stopped on request" in said
    assert "Traceback" not in said
    assert out.read_text().startswith("# shapephase plan, cat: stopped; ")
    assert not any(Path(f"/proc/{worker}").exists() for worker in workers)


def test_ctrl_c_before_anything_is_found_ends_at_once(monkeypatch, capsys):
    def pressed(*_, **__):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("shapephase.optimal_control.planning.reorientation", pressed)
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cat_two_halves", "--turn", "60 about x"])
    assert ended.value.code == 130
    assert capsys.readouterr().out == ""


def test_pressed_twice_gives_it_up():
    with steps(1) as work:
        search = cli_search.InterruptibleSearch(work, None)
        search.report(0.3, "search: iteration 0")
        search.interrupted()
        assert search.stopped
        with pytest.raises(KeyboardInterrupt):
            search.interrupted()
