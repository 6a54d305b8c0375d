"""`shapephase reach`: the table and the JSON say what `reachable` finds."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main


def said(capsys, *words):
    main(["reach", *words])
    return capsys.readouterr().out


def test_the_json_is_what_reachable_finds(capsys):
    data = json.loads(said(capsys, "diver", "--at", "left_shoulder_abduction=0.4", "--json"))
    found = sp.reachable(sp.load_body("diver"), [0.4, 0.0])
    assert (data["rank"], len(data["loops"])) == (found.rank, len(found.loops))
    np.testing.assert_array_equal(data["shape"], [0.4, 0.0])
    np.testing.assert_allclose(data["singular_values"], found.singular_values, rtol=1e-12)
    assert data["pairs"][0]["degrees_per_unit"] == pytest.approx(found.pairs[0].degrees, rel=1e-12)


def test_the_table_names_what_is_reached(capsys):
    text = said(capsys, "diver")
    assert "every rotation (rank 3 of 3)" in text
    assert "left_shoulder_abduction x right_shoulder_abduction" in text
    assert text.count("\norder 3 ") == 2
    assert "more pairs" in said(capsys, "cat_two_halves", "--pairs", "1")


def test_a_figure_is_written(capsys, tmp_path):
    said(capsys, "diver", "--out", str(tmp_path / "reach.svg"))
    assert (tmp_path / "reach.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize("words", [("--at", "left_shoulder_abduction"), ("--at", "nothing=1"), ("--pairs", "-1")])
def test_wrong_words_end_with_one_line(capsys, words):
    with pytest.raises(SystemExit):
        main(["reach", "diver", *words])
    assert capsys.readouterr().err.count("\n") == 1
