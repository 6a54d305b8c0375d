"""`shapephase plan`: what it finds, what it writes, and what it refuses."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.cli import plan as cli_plan
from shapephase.cli.main import main
from shapephase.cli.progress import steps
from shapephase.optimal_control.plan import Progress


def ran(*arguments):
    command = [sys.executable, "-m", "shapephase", "plan", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_a_plan_is_found_written_and_read_again(tmp_path):
    out = tmp_path / "plan.csv"
    done = ran("cat_two_halves", "--rotate", 60, "--about", "x", "--duration", 0.8, "--out", out, "--json")
    assert done.returncode == 0
    assert re.fullmatch(rf"wrote {re.escape(str(out))} \([0-9.]+ kB\)\n", done.stderr)
    data = json.loads(done.stdout)
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
        (("cat_two_halves",), 2, "--rotate"),
        (("cat_two_halves", "--rotate", 90, "--somersaults", 1), 2, "--rotate"),
        (("cat_two_halves", "--rotate", 90, "--about", "w"), 2, "--about"),
        (("cat_two_halves", "--rotate", 90, "--cost", "beauty"), 2, "kinetic, rate"),
        (("cat_two_halves", "--rotate", 90, "--out", "plan.txt"), 2, "--out"),
        (("no_such_cat", "--rotate", 90), 2, "no_such_cat"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_one_line(arguments, code, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["plan", *map(str, arguments)])
    assert ended.value.code == code
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_ctrl_c_keeps_the_best_so_far(tmp_path, monkeypatch, capsys):
    """The signal itself, in the third iteration; the motion written reaches the goal nearly."""
    plain = cli_plan._InterruptibleSearch.report

    def pressed(self, now):
        if (now.stage, now.iteration) == ("search", 3):
            signal.raise_signal(signal.SIGINT)
        return plain(self, now)

    monkeypatch.setattr(cli_plan._InterruptibleSearch, "report", pressed)
    handler = signal.getsignal(signal.SIGINT)
    out = tmp_path / "plan.csv"
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cat_two_halves", "--rotate", "60", "--out", str(out), "--json"])
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


def test_ctrl_c_before_anything_is_found_ends_at_once(monkeypatch, capsys):
    def pressed(*_, **__):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("shapephase.optimal_control.planning.reorientation", pressed)
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cat_two_halves", "--rotate", "60"])
    assert ended.value.code == 130
    assert capsys.readouterr().out == ""


def test_pressed_twice_gives_it_up():
    with steps(1) as work:
        search = cli_plan._InterruptibleSearch(work)
        search.report(Progress(stage="search", start=1, starts=1, iteration=0, cost=1.0, infeasibility=0.0))
        search.interrupted()
        assert search.stopped
        with pytest.raises(KeyboardInterrupt):
            search.interrupted()
