"""The command `audit`: its exit codes, its table, its JSON and its figure."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from support.flown_bodies import flown

FLOWN = Path(__file__).parents[1] / "data" / "flown_cat.csv"


def test_a_right_trajectory_ends_with_zero(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    main(["audit", "cat_two_halves", str(FLOWN), "--figure", str(tmp_path / "audit.svg")])
    assert "right within noise or 0.001" in capsys.readouterr().out
    assert (tmp_path / "audit.svg").read_text().rstrip().endswith("</svg>")


def test_a_wrong_one_ends_with_ten_and_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    rows = np.loadtxt(FLOWN, delimiter=",", skiprows=1)
    # w first where x is to be.
    rows[:, 1:5] = np.roll(rows[:, 1:5], 1, axis=1)
    header = FLOWN.read_text().splitlines()[0]
    np.savetxt(tmp_path / "swapped.csv", rows, delimiter=",", header=header, comments="")
    with pytest.raises(SystemExit) as ended:
        main(["audit", "cat_two_halves", str(tmp_path / "swapped.csv"), "--json"])
    assert ended.value.code == ExitCode.WRONG
    found = json.loads(capsys.readouterr().out)
    assert found["cause"] == ["quaternion written w x y z, read with w last"]


def test_faults_of_its_arguments_are_usage(capsys: pytest.CaptureFixture[str]):
    for words in (["cat_two_halves"], ["cat_two_halves", str(FLOWN), "--integrator-step", "0.1", "0.2"]):
        with pytest.raises(SystemExit) as ended:
            main(["audit", *words])
        assert ended.value.code == ExitCode.USAGE
    assert "one trajectory or more" in capsys.readouterr().err


@pytest.mark.full
def test_a_page_says_what_was_audited_and_what_explains_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """MuJoCo's arrays of a body whose joint is read two degrees off, with their rates."""
    motion = flown("diver", seed=1, step=0.001, every=5, duration=0.4)
    qpos = motion.qpos + np.radians(2.0) * (np.arange(motion.qpos.shape[1]) == 7)
    arrays = {"time": motion.times, "qpos": qpos, "qvel": motion.qvel, "joint_names": np.array(motion.joint_names)}
    np.savez(tmp_path / "run.npz", **arrays)
    page = tmp_path / "audit.html"
    with pytest.raises(SystemExit) as ended:
        main(["audit", "diver", str(tmp_path / "run.npz"), "--tolerance", "1e-6", "--html", str(page), "--json"])
    assert ended.value.code == ExitCode.WRONG
    found = json.loads(capsys.readouterr().out)
    assert found["runs"][0]["rates_given"]
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>")
    assert text.rstrip().endswith("</html>")
    assert found["verdict"] in unescape(text)
    assert found["cause"] == [f"offset of joint {motion.joint_names[0]}"]
    rows = re.findall(r"<tr><td>named</td><td>(.*?)</td>", text)
    assert rows == found["cause"]
    # Momentum and fall, and what each of eight hypotheses leaves over.
    assert text.count("data:image/svg+xml;base64,") == 10
    assert "://" not in text


def test_a_page_of_what_cannot_be_a_page_is_usage(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as ended:
        main(["audit", "cat_two_halves", str(FLOWN), "--html", "audit.pdf"])
    assert ended.value.code == ExitCode.USAGE
    assert "must end in .html" in capsys.readouterr().err


@pytest.mark.full
def test_the_steps_between_samples_are_stated(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Every fourth step of MuJoCo's semi-implicit Euler: the step is the cause, with the size that MuJoCo took."""
    motion = flown("diver", seed=3, integrator="euler", step=0.002, every=4, duration=0.8)
    arrays = {"time": motion.times, "qpos": motion.qpos, "qvel": motion.qvel}
    np.savez(tmp_path / "run.npz", **arrays, joint_names=np.array(motion.joint_names))
    with pytest.raises(SystemExit) as ended:
        main(["audit", "diver", str(tmp_path / "run.npz"), "--tolerance", "1e-6", "--every", "4", "--json"])
    assert ended.value.code == ExitCode.WRONG
    found = json.loads(capsys.readouterr().out)
    assert "integration step" in found["cause"]
    (cause,) = (one for one in found["hypotheses"] if one["name"] == "integration step")
    assert abs(cause["values"]["step"]["value"] - 0.002) < 1e-5


def test_samples_that_hide_more_than_the_tolerance_have_a_code_of_their_own(capsys: pytest.CaptureFixture[str]):
    """Digits of a CSV file are noise for a tolerance of 1e-9."""
    with pytest.raises(SystemExit) as ended:
        main(["audit", "cat_two_halves", str(FLOWN), "--tolerance", "1e-9", "--json"])
    assert ended.value.code == ExitCode.UNDECIDED
    found = json.loads(capsys.readouterr().out)
    assert (found["right"], found["wrong"]) == (False, False)
    assert "cannot tell" in found["verdict"]
