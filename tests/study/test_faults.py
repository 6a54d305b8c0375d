"""A fault of the disk never reads back as a value: the chunk is named, is not done, and is computed again."""

from __future__ import annotations

import contextlib
import json
import os
import shutil

import numpy as np
import pytest
import xarray

import shapephase as sp
from shapephase import study as room
from shapephase.errors import RunStopped, StudyStoreError

TENSOR, DURATION = np.diag([1.0, 2.0, 2.5]), 3.0
MOMENTA = np.linspace([0.1, 0.2, 0.3], [0.5, -0.2, 0.9], 11)
NAMES = ("final_attitude", "turn", "momentum")
FAULTS = int(os.environ.get("STUDY_FAULTS", "12"))
"""Faults of each kind of store; the suite has few."""


def study():
    return room.Study(
        room.RigidBody(TENSOR, DURATION), over={"momentum": MOMENTA}, outputs=("final_attitude", "turn"), chunk=3
    )


@pytest.fixture(scope="module")
def loop():
    """The cases one by one, by plain calls."""
    motions = [sp.reconstruct(sp.rigid(TENSOR, DURATION), one, tolerance=1e-9) for one in MOMENTA]
    turns = [sp.so3.angle(one.final_attitude) for one in motions]
    return {"final_attitude": np.array([one.final_attitude for one in motions]), "turn": turns, "momentum": MOMENTA}


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """One that is finished and one that has two chunks of four."""
    folder = tmp_path_factory.mktemp("stores")
    study().run(folder / "finished", workers=0)
    with pytest.raises(RunStopped):
        study().run(folder / "half", workers=0, progress=lambda share, _: share >= 6 / 11)
    return folder


def chunk_files(place):
    return sorted(file for file in place.rglob("*") if file.is_file() and file.name != "zarr.json")


def broken(place, rng):
    """Do one thing to one file, or to two of an array, and say what."""
    files = sorted(file for file in place.rglob("*") if file.is_file())
    file = files[rng.integers(len(files))]
    content = bytearray(file.read_bytes())
    kind = rng.choice(["flip", "truncate", "empty", "delete", "swap", "older"])
    if kind == "flip":
        content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        file.write_bytes(content)
    elif kind in ("truncate", "empty"):
        file.write_bytes(content[: rng.integers(len(content)) if kind == "truncate" else 0])
    elif kind == "delete":
        file.unlink()
    elif kind == "swap":
        others = [one for one in chunk_files(place) if one.name == file.name or one.parent == file.parent]
        other = others[rng.integers(len(others))] if others else file
        file.write_bytes(other.read_bytes())
        other.write_bytes(content)
    else:
        # A status of before anything was computed.
        (place / "status" / "c" / "0").write_bytes((place / "status" / "c" / "1").read_bytes()[:-4] + bytes(4))
    return kind, str(file.relative_to(place))


def check_values(place, loop):
    """Whatever can be read is the loop's, and whatever is done can be read; else an error says so."""
    with contextlib.suppress(StudyStoreError):
        store = room.open_study(place)
        done = store.statuses() == room.STATUS["done"]
        for name in NAMES:
            values = store.values(name)
            np.testing.assert_array_equal(values[done], np.asarray(loop[name])[done])
            assert np.isnan(values[~done]).all()


@pytest.mark.parametrize("kind", ["finished", "half"])
def test_a_single_fault_is_never_a_value_and_a_resumed_run_mends_it(stores, tmp_path, monkeypatch, loop, kind):
    rng = np.random.default_rng(54)
    monkeypatch.setattr(os, "fsync", lambda _: None)
    recipe = study()
    for number in range(FAULTS):
        place = tmp_path / f"{number}.zarr"
        shutil.copytree(stores / kind, place)
        what = broken(place, rng)
        check_values(place, loop)
        store = recipe.run(place, workers=0, resume=True)
        assert store.counts()["done"] == len(MOMENTA), what
        for name in NAMES:
            np.testing.assert_array_equal(store.values(name), loop[name], err_msg=str(what))
        flat = xarray.open_zarr(place)
        np.testing.assert_array_equal(flat["final_attitude"], loop["final_attitude"], err_msg=str(what))
        shutil.rmtree(place)


def test_every_byte_of_a_chunk_is_guarded_for_other_programs_too(stores, tmp_path):
    """Zarr itself refuses a chunk whose checksum does not fit."""
    place = tmp_path / "out.zarr"
    shutil.copytree(stores / "finished", place)
    file = place / "turn" / "c" / "1"
    whole = file.read_bytes()
    for byte in range(len(whole)):
        file.write_bytes(whole[:byte] + bytes([whole[byte] ^ 16]) + whole[byte + 1 :])
        with pytest.raises(Exception, match=r"(?i)checksum"):
            xarray.open_zarr(place)["turn"].load()
        store = room.open_study(place)
        assert store.damaged_chunks().tolist() == [1]
        assert store.counts() == {"missing": 3, "done": 8, "raised": 0, "timed_out": 0, "died": 0}
        with pytest.raises(StudyStoreError, match="chunk 1"):
            store.values("turn")


@pytest.mark.parametrize("how", [b"", None])
def test_a_status_whose_data_are_lost_is_not_done(stores, tmp_path, loop, how):
    place = tmp_path / "out.zarr"
    shutil.copytree(stores / "finished", place)
    file = place / "final_attitude" / "c" / "2" / "0" / "0"
    file.unlink()
    if how is not None:
        file.write_bytes(how)
    store = room.open_study(place)
    assert (store.statuses() == 0).tolist() == [False] * 6 + [True] * 3 + [False] * 2
    with pytest.raises(StudyStoreError, match="chunk 2"):
        store.dataset()
    np.testing.assert_array_equal(
        study().run(place, workers=0, resume=True).values("final_attitude"), loop["final_attitude"]
    )


def test_data_are_on_the_disk_before_their_seal(tmp_path, monkeypatch):
    """In the order in which the system is asked: all files of a chunk, their folders, then the seal."""
    synced, real = [], os.fsync

    def fsync(handle):
        synced.append(os.path.relpath(os.readlink(f"/proc/self/fd/{handle}"), tmp_path / "out.zarr"))
        real(handle)

    store = room.Study(room.RigidBody(TENSOR, DURATION), over={"momentum": MOMENTA}, outputs=("turn",), chunk=11)
    monkeypatch.setattr(os, "fsync", fsync)
    store.run(tmp_path / "out.zarr", workers=0)
    seal = synced.index("seal/c/0/0")
    for name in ("turn/c/0", "turn/c", "momentum/c/0/0", "momentum/c/0", "momentum/c", "status/c/0", "status/c"):
        assert name in synced[:seal]
    assert {"seal/c/0", "seal/c"} <= set(synced[seal:])


def test_a_store_of_an_earlier_version_is_named(stores, tmp_path):
    place = tmp_path / "out.zarr"
    shutil.copytree(stores / "finished", place)
    whole = json.loads((place / "zarr.json").read_text())
    whole["attributes"]["format"] = "shapephase study 1"
    (place / "zarr.json").write_text(json.dumps(whole))
    with pytest.raises(StudyStoreError, match=r"xarray.open_zarr"):
        room.open_study(place)
