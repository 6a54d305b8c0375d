"""The command `audit`: its exit codes, its table, its JSON and its figure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode

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
    for words in (["cat_two_halves"], ["cat_two_halves", str(FLOWN), "--step", "0.1", "0.2"]):
        with pytest.raises(SystemExit) as ended:
            main(["audit", *words])
        assert ended.value.code == ExitCode.USAGE
    assert "one trajectory or more" in capsys.readouterr().err
