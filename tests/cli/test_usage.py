"""What people type wrongly at first: one line that says what is wanted there, what came, and how it is written."""

from __future__ import annotations

import shlex

import pytest

from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode

SPLIT = "Usage: shapephase split [OPTIONS] BODY MOTION; see shapephase split --help"
SHALL = {
    "splt cat cat_righting": ['"splt"', 'Did you mean "split"?', "as in `shapephase split cat cat_righting`"],
    "SPLIT cat cat_righting": ['"SPLIT"', "Available commands: split", "see shapephase --help"],
    "cat cat_righting": ['"cat"', "The command comes first", "see shapephase --help"],
    "help": ["see shapephase --help"],
    "--verison": ['"--verison"', "see shapephase --help"],
    "split": ["parameter BODY requires an argument", SPLIT],
    "split cat": ["parameter MOTION requires an argument", SPLIT],
    "plot cat cat_righting": ["parameter MOTION requires an argument", "KIND BODY MOTION"],
    "conjugate 1 2": [
        "MOMENTS requires 3 positional arguments",
        "Only got 2",
        "shapephase conjugate [OPTIONS] MOMENTS",
    ],
    "rigid 1 2 3": ["--momentum requires 3 positional arguments", "For example `--momentum 0.6 0.9 0.5`"],
    "plan cat_two_halves 90": ["Unused Tokens: ['90']", "shapephase plan [OPTIONS] BODY"],
    "check cat circle kg": ["Unused Tokens: ['kg']", "shapephase check [OPTIONS] BODY"],
    "split cat cat_righting --momentum 0 0": ["--momentum requires 3", "Only got 2", "`--momentum 0 0 0.02`"],
    "split cat cat_righting --momentum 0,0,0.02": ["--momentum requires 3", "Only got 1", "`--momentum 0 0 0.02`"],
    "split cat cat_righting -momentum 0 0 1": ["Unknown option: -momentum", SPLIT],
    "split cat cat_righting --momentun 0 0 1": ["--momentun", "Did you mean --momentum?", SPLIT],
    "split cat cat_righting --html": ["--html requires an argument", "`--html report.html`"],
    "plan cat_two_halves --turn 90": ["--turn: degrees and an axis", "got '90'"],
    "plan cat_two_halves --duration 1s": ["--duration", 'unable to convert "1s" into float', "`--duration 0.8`"],
    "plan cat_two_halves --pieces 1e9": ["--pieces", 'unable to convert "1e9" into int', "`--pieces 12`"],
    "plan cat_two_halves --turn '5 about x' --pieces 9000": ["pieces: a whole number, up to 2000", "got 9000"],
    "plan cat_two_halves --turn '5 about x' --starts 9000": ["starts: a whole number, up to 1000", "got 9000"],
    "explore cat": ["--joints requires 2", "For example `--joints waist_pitch waist_yaw`"],
    "sweep study.toml": ["--store requires an argument", "For example `--store out.zarr`"],
    "plot sweep out.zarr": ["parameter OUTPUT requires an argument", "STORE OUTPUT"],
    "explore cat --joints waist_pitch": ["--joints requires 2", "Only got 1", "`--joints waist_pitch waist_yaw`"],
    "split cat_righting cat": ["cat_righting is a motion; the body comes before it"],
    "check motion.csv body.urdf": ["motion.csv is a motion; the body comes before it"],
    "split diver cat_righting": ["cat_righting is a motion of cat", "of diver there is diver_twist"],
    "split cat motion.csv --trim 0 1": ["Unknown option", "--trim"],
}


@pytest.mark.parametrize("words", SHALL)
def test_what_is_typed_wrongly_is_answered_in_one_line(words, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motion.csv").write_text("time,hip\n0,0\n1,0\n")
    with pytest.raises(SystemExit) as ended:
        main(shlex.split(words))
    ended_with = capsys.readouterr()
    assert ended.value.code == ExitCode.USAGE
    assert ended_with.out == ""
    assert ended_with.err.startswith("shapephase: ")
    assert ended_with.err.count("\n") == 1
    for said in SHALL[words]:
        assert said in ended_with.err


def test_a_name_of_70000_characters_is_not_repeated(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text("x" * 70_000 + " = 1")
    with pytest.raises(SystemExit):
        main(["sweep", "study.toml", "--store", "out.zarr"])
    said = capsys.readouterr().err
    assert f"unknown entry '{'x' * 80}...'. Valid: body" in said
    assert len(said) < 500
