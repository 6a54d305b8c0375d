"""What people type wrongly at first: one line that says what is wanted there, what came, and how it is written."""

from __future__ import annotations

import shlex

import pytest

from shapephase.cli.exit_codes import ExitCode
from shapephase.cli.main import main

SHALL = {
    "splt cat cat_righting": ["no command 'splt'", "Did you mean 'split'?"],
    "SPLIT cat cat_righting": ["no command 'SPLIT'", "Did you mean 'split'?"],
    "cat cat_righting": ["no command 'cat'", "`shapephase split cat cat_righting`", "robots, compile, doctor"],
    "help": ["`shapephase --help`", "`shapephase COMMAND --help`"],
    "version": ["`shapephase --version`"],
    "list": ["`shapephase robots`"],
    "--verison": ["no option '--verison'", "did you mean --version?"],
    "split": ["BODY is missing", "`shapephase split BODY MOTION [OPTIONS]`"],
    "split cat": ["MOTION is missing", "`shapephase split BODY MOTION [OPTIONS]`"],
    "plot cat cat_righting": ["MOTION is missing", "`shapephase plot KIND BODY MOTION [OPTIONS]`"],
    "conjugate 1 2": ["I3 is missing", "`shapephase conjugate I1 I2 I3 [OPTIONS]`"],
    "rigid 1 2 3": ["--momentum is needed; for example `--momentum 0.6 0.9 0.5`"],
    "plan cat_two_halves 90": ["too many words: '90'", "`shapephase plan BODY [OPTIONS]`"],
    "check cat circle kg": ["too many words: 'kg'", "`shapephase check BODY [MOTION] [OPTIONS]`"],
    "split cat cat_righting --momentum 0 0": ["--momentum: 3 values", "got '0 0'", "`--momentum 0 0 0.02`"],
    "split cat cat_righting --momentum 0,0,0.02": ["with spaces between them", "got '0,0,0.02'"],
    "split cat cat_righting -momentum 0 0 1": ["no option -momentum", "two hyphens", "did you mean --momentum?"],
    "split cat cat_righting --momentun 0 0 1": ["--momentun", "Did you mean --momentum?"],
    "split cat cat_righting --html": ["--html: a value is missing", "`--html report.html`"],
    "plan cat_two_halves --rotate 90deg": ["--rotate: a number", "got '90deg'", "`--rotate 180`"],
    "plan cat_two_halves --rotate 5 --pieces 1e9": ["--pieces: a whole number", "got '1e9'", "`--pieces 12`"],
    "plan cat_two_halves --rotate 5 --pieces 9000": ["pieces: a whole number, up to 2000", "got 9000"],
    "plan cat_two_halves --rotate 5 --starts 9000": ["starts: a whole number, up to 1000", "got 9000"],
    "explore cat": ["--joints is needed; for example `--joints waist_pitch waist_yaw`"],
    "sweep study.toml": ["--store is needed; for example `--store out.zarr`"],
    "plot sweep out.zarr": ["OUTPUT is missing", "`shapephase plot sweep STORE OUTPUT [OPTIONS]`"],
    "explore cat --joints waist_pitch": ["--joints: 2 values", "`--joints waist_pitch waist_yaw`"],
    "split cat_righting cat": ["cat_righting is a motion; the body comes before it"],
    "check motion.csv body.urdf": ["motion.csv is a motion; the body comes before it"],
    "split diver cat_righting": ["cat_righting is a motion of cat", "of diver there is diver_twist"],
}


@pytest.mark.parametrize("words", SHALL)
def test_what_is_typed_wrongly_is_answered_in_one_line(words, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motion.csv").write_text("time,hip\n0,0\n1,0\n")
    with pytest.raises(SystemExit) as ended:
        main(shlex.split(words))
    told = capsys.readouterr()
    assert ended.value.code == ExitCode.USAGE
    assert told.out == ""
    assert told.err.startswith("shapephase: ")
    assert told.err.count("\n") == 1
    for said in SHALL[words]:
        assert said in told.err


def test_a_name_of_70000_characters_is_not_repeated(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text("x" * 70_000 + " = 1")
    with pytest.raises(SystemExit):
        main(["sweep", "study.toml", "--store", "out.zarr"])
    said = capsys.readouterr().err
    assert f"unknown entry '{'x' * 80}...'. Valid: body" in said
    assert len(said) < 500
