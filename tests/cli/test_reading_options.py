"""The options that say how a recording is read: the same on every command, and what was done is told."""

import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.shape_space.files import read_recorded_motion

# What is computed is the same with and without machine code, which is quicker.

TIMES = np.arange(61) / 60.0
WAVE = np.sin(np.pi * TIMES) ** 2
OPTIONS = (
    *("--names", "L=left_shoulder_abduction", "R=right_shoulder_abduction", "frame="),
    *("--time-unit", "ms", "--degrees", "--flight", "0", "1000", "--resample", "10"),
)


@pytest.fixture
def take(tmp_path):
    rows = [
        f"{1000 * t!r};{40 * w!r};{70 * w * w!r};{k}" for k, (t, w) in enumerate(zip(TIMES.tolist(), WAVE.tolist()))
    ]
    (tmp_path / "take.csv").write_text("\n".join(["t;L;R;frame", *rows]).replace(".", ","))
    return str(tmp_path / "take.csv")


def answer(capsys, *arguments):
    main([*arguments, "--json"])
    return json.loads(capsys.readouterr().out)


def test_all_commands_that_take_a_motion_take_the_same_options(take, tmp_path, capsys):
    picture, page = str(tmp_path / "a.svg"), str(tmp_path / "a.html")
    body = sp.load_body("diver")
    names = {"L": body.joint_names[0], "R": body.joint_names[1], "frame": None}
    same = read_recorded_motion(
        take, body, names=names, time_unit="ms", degrees=True, trim=(0.0, 1000.0), flight=(0.0, 1000.0), resample=10.0
    )
    plain = json.loads(json.dumps(same.record))
    assert plain["units"] == dict.fromkeys(body.joint_names, "deg")
    for command in (
        ["split", "diver", take],
        ["orbits", "diver", take, "5"],
        ["view", "diver", take, "--html", page],
        ["plot", "shape", "diver", take, "--out", picture],
    ):
        assert answer(capsys, *command, *OPTIONS)["recording"] == plain
    assert answer(capsys, "check", "diver", take, *OPTIONS)["motion"]["recording"] == plain


def test_what_was_done_is_on_the_card(take, capsys):
    main(["check", "diver", take, *OPTIONS])
    text = capsys.readouterr().out
    for words in ("times in ms, 2 joints in deg", "left_shoulder_abduction from 'L'", "frame: as told", "resampled"):
        assert words in text
    assert "61 of 61 samples, 0 to 1000 ms" in text


def test_a_cycle_is_closed_for_split_and_orbits(tmp_path, capsys):
    coarse = zip(TIMES[::6].tolist(), WAVE[::6].tolist(), strict=True)
    rows = [f"{t!r},{0.4 * w + 0.01 * t!r},{0.8 * w * w!r}" for t, w in coarse]
    joints = "left_shoulder_abduction,right_shoulder_abduction"
    (tmp_path / "m.csv").write_text("\n".join([f"time,{joints}", *rows]))
    take = str(tmp_path / "m.csv")
    assert answer(capsys, "split", "diver", take)["is_loop"] is False
    found = answer(capsys, "split", "diver", take, "--close", "1deg", "--close-by", "drift")
    assert found["is_loop"] is True
    closing = found["recording"]["closing"]
    assert closing["by"] == "drift"
    assert closing["gap"]["left_shoulder_abduction"] == pytest.approx(0.01)
    assert 0.0 < np.linalg.norm(closing["holonomy_change_rotation_vector_rad"]) < 0.01
    assert len(answer(capsys, "orbits", "diver", take, "5", "--close", "1deg")["orbits"]) >= 2
    main(["check", "diver", take, "--close", "0.02"])
    text = capsys.readouterr().out
    assert "by the drift; left_shoulder_abduction ended 0.573 deg off" in text
    assert "largest rms residual" in text
    assert "change of the holonomy" in text


def test_standard_input_is_a_hyphen(take, capsys, monkeypatch):
    class Input:
        buffer = io.BytesIO(Path(take).read_bytes())

    monkeypatch.setattr(sys, "stdin", Input)
    found = answer(capsys, "check", "diver", "-", *OPTIONS)
    assert found["motion"]["recording"]["file"] == "standard input"


def test_joints_rest_where_one_says(tmp_path, capsys):
    (tmp_path / "m.csv").write_text("time,left_shoulder_abduction\n0,0.1\n1,0.2\n2,0.1\n")
    main(["check", "diver", str(tmp_path / "m.csv"), "--rest", "right_shoulder_abduction=30deg", "--json"])
    held = json.loads(capsys.readouterr().out)["motion"]["recording"]["at_rest"]
    assert held == {"right_shoulder_abduction": pytest.approx(np.pi / 6.0, abs=1e-15)}
    main(["check", "diver", str(tmp_path / "m.csv"), "--rest-missing"])
    assert "right_shoulder_abduction 0 deg" in capsys.readouterr().out


def test_a_stretch_of_joints_alone_is_kept_and_gaps_outside_do_not_matter(tmp_path, capsys):
    rows = ["0,0.1,0", "0.5,,0", "1,0.2,0.1", "1.5,0.3,0.2", "2,0.2,0.1", "2.5,0.1,0"]
    (tmp_path / "m.csv").write_text("time,left_shoulder_abduction,right_shoulder_abduction\n" + "\n".join(rows))
    with pytest.raises(SystemExit):
        main(["split", "diver", str(tmp_path / "m.csv")])
    assert "--flight 1 2.5" in capsys.readouterr().err
    found = answer(capsys, "split", "diver", str(tmp_path / "m.csv"), "--flight", "1", "2.5")
    assert (found["duration_s"], found["recording"]["samples"]) == (1.5, 4)
    assert found["recording"]["trim"] == [1.0, 2.5]
    assert found["momentum_kg_m2_s"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--names", "L"], 2, "there is no such file"),
        (["--names", "L=a", "L=b"], 2, "column 'L' stands twice"),
        (["--names", "Q=left_shoulder_abduction"], 2, "unknown column"),
        (["--rest", "knee"], 2, "--rest: JOINT=VALUE is needed"),
        (["--rest", "knee=1"], 2, "unknown joint of diver 'knee'"),
        (["--time-unit", "h"], 4, "time_unit: one of s, ms"),
        (["--flight", "5", "1"], 2, "--flight: auto, auto:2, all, or a first and a later last time"),
        (["--close", "much"], 4, "close: a number is needed"),
        (["--degrees"], 4, "--time-unit ms"),
        (["--time-unit", "ms"], 4, "unknown column"),
    ],
)
def test_options_that_cannot_be_are_refused(take, capsys, options, code, words):
    with pytest.raises(SystemExit) as ended:
        main(["check", "diver", take, *options])
    assert ended.value.code == code
    assert words in capsys.readouterr().err


def test_a_mistyped_option_is_no_motion(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["check", "diver", "--jsno"])
    assert ended.value.code == 2
    assert "there is no option '--jsno'" in capsys.readouterr().err


def test_a_motion_of_the_library_has_no_columns(capsys):
    for options in (["--degrees"], ["--names", "a=b"], ["--flight", "0", "1"], ["--rest-missing"]):
        with pytest.raises(SystemExit):
            main(["split", "cat", "cat_righting", *options])
        assert f"{options[0]} is for recorded motions" in capsys.readouterr().err
