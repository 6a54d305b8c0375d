"""Stores: what is in them, how they go on, and which are refused."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray
import zarr

import shapephase as sp
from shapephase import provenance
from shapephase import study as room
from shapephase.errors import OutputFileError, RunStopped, StudyError, StudyStoreError, UnknownNameError
from support.study_functions import bend, counted, logged

MOMENTUM = room.Normal([0.0, 0.0, 0.01], 0.004)
RIGID = room.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0)


def rigid(**more):
    return room.Study(RIGID, over={"momentum": room.Directions(1.0)}, **{"draws": 23, "chunk": 5, **more})


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A store that is complete."""
    place = tmp_path_factory.mktemp("store") / "out.zarr"
    over = {"momentum_z": [0.0, 0.01, 0.02], "masses": room.LogNormal(0.1)}
    study = room.Study(
        "cat_two_halves", bend, over, ("final_attitude", "turn"), draws=4, chunk=5, parameters={"depth": 0.5}
    )
    return study, study.run(place, workers=0)


def test_a_store_says_what_it_is(filled):
    study, store = filled
    said = room.open_study(store.path).attributes
    assert said["study_hash"] == study.hash
    assert said["seed"] == 0
    assert said["versions"]["numpy"] == np.__version__
    assert said["inputs"]["body cat_two_halves"] == sp.load_body("cat_two_halves").sha256
    assert said["units"]["turn"] == "rad"
    assert said["processor"]
    assert "command" in said
    assert json.dumps(said)


def test_xarray_reads_it_with_names_and_units(filled):
    _, store = filled
    found = xarray.open_zarr(store.path)
    assert found["final_attitude"].dims == ("case", "row", "column")
    assert found["turn"].attrs["units"] == "rad"
    assert found["masses"].dims == ("case", "part")
    table = store.dataset()
    assert table["turn"].dims == ("momentum_z", "draw")
    assert table.sizes["draw"] == 4
    np.testing.assert_array_equal(table["momentum_z"], [0.0, 0.01, 0.02])
    np.testing.assert_array_equal(table["turn"].values.ravel(), store.values("turn"))


def test_a_chunk_of_cases_is_one_file_of_each_array(filled):
    _, store = filled
    assert sorted(path.name for path in (store.path / "status" / "c").iterdir()) == ["0", "1", "2"]
    assert zarr.open_group(store.path, mode="r")["status"].fill_value == 0
    assert not (store.path / "error_text" / "c").exists()


def test_a_run_computes_only_what_is_missing(tmp_path, monkeypatch):
    log = tmp_path / "log"
    monkeypatch.setenv("STUDY_LOG", str(log))
    study = room.Study(
        "cat_two_halves", bend, {"momentum": MOMENTUM}, (room.Output("turned", counted),),
        draws=11, chunk=3, parameters={"depth": 0.5},
    )  # fmt: skip
    with pytest.raises(RunStopped, match="6 of 11"):
        study.run(tmp_path / "out.zarr", workers=0, progress=lambda share, _: share >= 6 / 11)
    assert len(logged(log)) == 6
    store = study.run(tmp_path / "out.zarr", workers=0, resume=True)
    assert len(logged(log)) == len(set(logged(log))) == 11
    assert store.counts()["done"] == 11
    study.run(tmp_path / "out.zarr", workers=0, resume=True)
    assert len(logged(log)) == 11
    at_once = study.run(tmp_path / "whole.zarr", workers=0)
    np.testing.assert_array_equal(store.values("turned"), at_once.values("turned"))


def test_a_chunk_whose_status_was_not_written_is_missing(tmp_path):
    study = rigid()
    store = study.run(tmp_path / "out.zarr", workers=0)
    expected = store.values("final_attitude")
    (tmp_path / "out.zarr" / "status" / "c" / "2").unlink()
    (tmp_path / "out.zarr" / "final_attitude" / "c" / "2" / "0" / "0").unlink()
    assert room.open_study(store.path).missing_chunks().tolist() == [2]
    study.run(tmp_path / "out.zarr", workers=0, resume=True)
    np.testing.assert_array_equal(room.open_study(store.path).values("final_attitude"), expected)


@pytest.mark.parametrize("change", [{"seed": 1}, {"draws": 24}, {"chunk": 6}, {"tolerance": 1e-8}])
def test_the_store_of_another_study_is_refused(tmp_path, change):
    rigid(draws=5).run(tmp_path / "out.zarr", workers=0)
    with pytest.raises(StudyStoreError, match=f"another study.*{next(iter(change))}"):
        rigid(**{"draws": 5, **change}).run(tmp_path / "out.zarr", workers=0, resume=True)


def test_what_is_there_already_is_not_overwritten(tmp_path):
    rigid(draws=5).run(tmp_path / "out.zarr", workers=0)
    with pytest.raises(StudyStoreError, match="already"):
        rigid(draws=5).run(tmp_path / "out.zarr", workers=0)
    (tmp_path / "text.zarr").write_text("a text")
    for resume in (False, True):
        with pytest.raises(StudyStoreError, match="store"):
            rigid(draws=5).run(tmp_path / "text.zarr", workers=0, resume=resume)
    with pytest.raises(OutputFileError, match="folder"):
        rigid(draws=5).run(tmp_path / "nowhere" / "out.zarr", workers=0)
    with pytest.raises(StudyStoreError, match="store"):
        room.open_study(tmp_path / "nowhere.zarr")


def test_other_versions_are_refused(tmp_path, monkeypatch):
    with monkeypatch.context() as other:
        other.setattr(provenance, "version", lambda _: "1.0")
        rigid(draws=5).run(tmp_path / "out.zarr", workers=0)
    with pytest.raises(StudyStoreError, match="numpy"):
        rigid(draws=5).run(tmp_path / "out.zarr", workers=0, resume=True)


def test_two_runs_do_not_write_to_one_store(tmp_path):
    study = rigid()

    def second(*_):
        with pytest.raises(StudyStoreError, match="writing"):
            study.run(tmp_path / "out.zarr", workers=0, resume=True)

    study.run(tmp_path / "out.zarr", workers=0, progress=second)


def test_a_changed_file_is_another_study(tmp_path):
    file = tmp_path / "bend.csv"
    sp.write_shape_path(bend(0.5), file)
    first = room.Study("cat_two_halves", file, {"momentum": MOMENTUM})
    assert first.inputs[f"motion {file}"] == hashlib.sha256(file.read_bytes()).hexdigest()
    sp.write_shape_path(bend(0.6), file)
    assert room.Study("cat_two_halves", file, {"momentum": MOMENTUM}).hash != first.hash


@pytest.mark.full
def test_a_disk_that_takes_no_more_is_an_error_and_leaves_a_store_that_goes_on(tmp_path):
    """A process may write files of 2 kB only: the chunks of final attitudes are larger."""
    code = (
        "import resource, signal, numpy as np, shapephase as sp\n"
        "from pathlib import Path\n"
        "study = sp.study.Study(sp.study.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0),\n"
        "    over={'momentum': sp.study.Directions(1.0)}, draws=120, chunk=60)\n"
        "def full(*_):\n"
        "    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))\n"
        "try:\n"
        "    study.run('out.zarr', workers=0, progress=full)\n"
        "except sp.errors.OutputFileError as error:\n"
        "    print(error)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "cannot write out.zarr" in said.stdout, said.stderr
    study = room.Study(RIGID, over={"momentum": room.Directions(1.0)}, draws=120, chunk=60)
    assert room.open_study(tmp_path / "out.zarr").missing_chunks().tolist() == [1]
    assert study.run(tmp_path / "out.zarr", workers=0, resume=True).counts()["done"] == 120


def test_a_time_limit_needs_a_process(tmp_path):
    with pytest.raises(StudyError, match="process"):
        rigid(time_limit=1.0).run(tmp_path / "out.zarr", workers=0)
    with pytest.raises(StudyError, match="workers"):
        rigid().run(tmp_path / "out.zarr", workers=-1)


@pytest.mark.parametrize(
    ("file", "content", "said"),
    [
        ("status/c/1", b"x", r"chunk 1 \(cases 5 to 9\)"),
        ("turn/c/0", b"\x28\xb5\x2f\xfd", r"chunk 0 \(cases 0 to 4\)"),
        *(
            ("zarr.json", change, "its zarr.json is not what was written")
            for change in (("study_hash", "0"), ("cases", 13), ("units", {}), ("seed", 8), ("format", "study"))
        ),
    ],
)
def test_a_damaged_store_is_named_as_one_and_mended(filled, tmp_path, file, content, said):
    study, store = filled
    place = tmp_path / "damaged.zarr"
    shutil.copytree(store.path, place)
    if isinstance(content, tuple):
        whole = json.loads((place / file).read_text())
        whole["attributes"][content[0]] = content[1]
        content = json.dumps(whole).encode()
    (place / file).write_bytes(content)
    with pytest.raises(StudyStoreError, match=f"damaged.zarr: the store is damaged: {said}.*--resume"):
        (lambda found: (found.counts(), found.values("turn")))(room.open_study(place))
    mended = study.run(place, workers=0, resume=True)
    np.testing.assert_array_equal(mended.values("turn"), store.values("turn"))


def test_an_array_that_a_store_does_not_have_is_named(filled):
    _, store = filled
    with pytest.raises(UnknownNameError, match="no_such"):
        store.values("no_such")
