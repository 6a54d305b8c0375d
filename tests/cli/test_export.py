"""`shapephase export`: several files of one motion, computed or stored, as the functions write them."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.examples import cat_righting

MOMENTUM = ("--momentum", "0.01", "0", "0.02")


@pytest.fixture(scope="module")
def motion():
    """The cat begins upside down, as the command has it."""
    upside_down = np.diag([1.0, -1.0, -1.0])
    return sp.reconstruct(sp.articulated(sp.load_body("cat"), cat_righting()), [0.01, 0.0, 0.02], upside_down)


def printed(capfd, *arguments):
    main(["export", *map(str, arguments)])
    return capfd.readouterr().out


def numbers_in(file):
    """All decimal fractions of a text file."""
    return np.array(re.findall(r"-?\d+\.\d+(?:e[-+]\d+)?", file.read_text()), dtype=float)


def test_files_of_a_computed_motion_are_those_of_the_functions(capfd, tmp_path, motion):
    names = {"aem": "aem", "csv": "csv", "parquet": "parquet", "mcap": "mcap", "bvh": "bvh", "mot": "sto"}
    files = [word for name, ending in names.items() for word in (f"--{name}", tmp_path / f"fall.{ending}")]
    data = json.loads(
        printed(capfd, "cat", "cat_righting", *MOMENTUM, *files, "--error", 1e-6, "--frequency", 50, "--json")
    )
    assert set(data["files"]) == set(names)
    times = np.arange(101) / 50.0
    message = sp.exports.write_aem(motion, tmp_path / "own.aem", error=1e-6)
    assert data["files"]["aem"] == {
        "file": str(tmp_path / "fall.aem"), "records": message.records, "error_rad": 1e-6,
    }  # fmt: skip
    sp.exports.write_bvh(motion, tmp_path / "own.bvh", rate=50.0)
    sp.export_motion(motion, tmp_path / "own.csv", times)
    for name in ("aem", "bvh", "csv"):
        found, own = (numbers_in(tmp_path / f"{file}.{name}") for file in ("fall", "own"))
        assert found.shape == own.shape
        np.testing.assert_allclose(found, own, rtol=0, atol=1e-9, err_msg=name)
    for name in ("fall.parquet", "fall.mcap", "fall.sto"):
        read = sp.read_shape_path(tmp_path / name, sp.load_body("cat"))
        assert read.duration == pytest.approx(2.0, abs=1e-12)


def test_a_stored_motion_has_attitudes_and_a_table_of_its_base(capfd, tmp_path, motion):
    spiceypy = pytest.importorskip("spiceypy")
    motion.save(tmp_path / "fall.npz")
    kernel, table = tmp_path / "fall.bc", tmp_path / "fall.csv"
    text = printed(capfd, tmp_path / "fall.npz", "--ck", kernel, "--csv", table, "--error", "1e-7", "--mrp")
    assert f"{kernel}: " in text
    assert "records within 1e-07 rad" in text
    for file in (kernel, kernel.with_suffix(".tsc")):
        spiceypy.furnsh(str(file))
    times = np.linspace(0.0, 2.0, 500)
    found = np.array([spiceypy.pxform("SHAPEPHASE_BASE", "J2000", t) for t in times])
    spiceypy.kclear()
    off = sp.so3.angle(sp.so3.transpose(found) @ motion.attitude(times))
    assert off.max() < 1e-7
    assert table.read_text().startswith("time [s],base_mrp_1,")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("cat", "cat_righting"), "give files to write"),
        (("cat", "--csv", "fall.csv"), "cat needs a motion"),
        (("fall.npz", "--csv", "fall.csv", *MOMENTUM), "stored motion"),
        (("fall.npz", "--bvh", "fall.bvh"), "a body with joints"),
        (("fall.npz", "--csv", "fall.txt"), "must end in .csv"),
        (("fall.npz", "--aem", "fall.aem", "--error", "-1"), "--error"),
        (("fall.npz", "--csv", "fall.csv", "--frequency", "0"), "--frequency"),
        (("none.npz", "--csv", "fall.csv"), "none.npz"),
    ],
)
def test_wrong_words_are_refused_and_nothing_is_written(capfd, tmp_path, monkeypatch, motion, words, message):
    monkeypatch.chdir(tmp_path)
    motion.save("fall.npz")
    with pytest.raises(SystemExit):
        main(["export", *words])
    assert message in capfd.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["fall.npz"]
