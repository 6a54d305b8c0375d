"""Damaged files: each ends in an error that names what is wrong, or in the numbers that still stand in it."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest

import shapephase as sp
from fuzz.samples import BODY, JOINTS, SHAPES, TIMES, WRITERS
from fuzz.trials import damaged_file, fault_of
from shapephase.errors import ShapePhaseError


def cut(share):
    return lambda data: data[: int(share * len(data))]


def swap(old, new):
    """Bytes instead of others, which have to be there."""

    def changed(data):
        assert old in data
        return data.replace(old, new, 1)

    return changed


def flipped(place):
    """One bit of the byte at a share of the file."""

    def changed(data):
        at = int(place * len(data))
        return data[:at] + bytes([data[at] ^ 4]) + data[at + 1 :]

    return changed


def arrays(**changes):
    """The arrays of an NPZ file, some of them others."""

    def changed(_):
        stream = io.BytesIO()
        np.savez(stream, **{"time": TIMES, "shapes": SHAPES, "joint_names": JOINTS} | changes)
        return stream.getvalue()

    return changed


def same_member(data):
    """The archive with its first array twice."""
    stream = io.BytesIO(data)
    with zipfile.ZipFile(stream, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("time.npy", archive.read("time.npy"))
    return stream.getvalue()


def qpos(change):
    places = np.tile([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], (len(TIMES), 1))
    found = {"time": TIMES, "qpos": np.hstack([places, SHAPES[:, [0, 1, 2]]])} | change

    def changed(_):
        stream = io.BytesIO()
        np.savez(stream, **found)
        return stream.getvalue()

    return changed


def turns_in_hdf5(_):
    stream = io.BytesIO()
    with h5py.File(stream, "w") as book:
        for name in ("time", "hip_Zrotation", "hip_Xrotation", "hip_Yrotation"):
            book[name] = TIMES
    return stream.getvalue()


def deepmimic(frames):
    return lambda _: json.dumps({"Frames": frames}).encode()


WRONG = SHAPES.copy()
WRONG[4, 1] = np.inf
# file, change of its bytes, a keyword of the error; or None, where what is read is what was written
CASES = {
    "an NPZ file cut off": ("m.npz", cut(0.7), "no NPZ file"),
    "a bit of a packed NPZ file": ("packed.npz", flipped(0.1), "no NPZ file"),
    "a bit of a plain NPZ file": ("m.npz", flipped(0.3), "CRC"),
    "an array twice": ("m.npz", same_member, "stands twice"),
    "an infinite entry": ("m.npz", arrays(shapes=WRONG), "sample 4"),
    "Python objects": ("m.npz", arrays(note=np.array([{}], dtype=object)), "can run code"),
    "a joint too few": ("m.npz", arrays(joint_names=JOINTS[:2]), "2 names"),
    "a time that stands still": ("m.npz", arrays(time=np.minimum(TIMES, 1.0)), "sample 9"),
    "an empty NPZ file": ("m.npz", lambda _: b"", "no NPZ file"),
    "no NPY header": ("m.npz", lambda _: b"\x93NUMPY\x01", "no NPZ file"),
    "qpos with fewer times": ("m.npz", qpos({"time": TIMES[:5]}), "5 times"),
    "qpos without times": ("m.npz", qpos({"qvel": 1.0}), "joint_names|qvel"),
    "two sets of coordinates": ("m.npz", arrays(qpos=np.zeros((12, 10))), "keep one"),
    "a MATLAB file cut off": ("m.mat", cut(0.6), "no MATLAB file"),
    "a bit of a packed MATLAB file": ("m.mat", flipped(0.5), "no MATLAB file"),
    "a MATLAB file of nothing": ("m.mat", lambda data: data[:128], "no motion"),
    "an HDF5 file cut off": ("m.h5", cut(0.5), "no HDF5 file"),
    "an HDF5 file without its signature": ("m.h5", lambda data: b"x" + data[1:], "no HDF5 file"),
    "turns in HDF5, whose order nothing keeps": ("m.h5", turns_in_hdf5, "keeps no order"),
    "a log of JSON lines cut off": ("m.jsonl", lambda _: b'{"time": 0.0, "hip": 0.1}\n{"time": 0.1, "hi', "jsonl:2"),
    "a Parquet file cut off": ("m.parquet", cut(0.8), "Parquet"),
    "a workbook cut off": ("m.xlsx", cut(0.8), "workbook"),
    "a C3D file cut off": ("m.c3d", cut(0.6), "damaged"),
    "a C3D file without its key": ("m.c3d", lambda data: data[:1] + b"\x51" + data[2:], "header is damaged"),
    "a bag cut off": ("m.bag", cut(0.5), "no bag"),
    "YAML with a key twice": ("m.yaml", swap(b"points:", b"joint_names: []\npoints:"), "stands twice"),
    "YAML with a merge key": ("m.yaml", swap(b"points:", b"<<: {a: 1}\npoints:"), "merge keys"),
    "YAML with a tag": ("m.yaml", swap(b"points:", b"a: !!python/object/apply:os.getcwd []\npoints:"), "no YAML"),
    "YAML with an open bracket": ("m.yaml", swap(b"]", b""), "no YAML"),
    "YAML with a point short": ("m.yaml", swap(b"- positions: [0.0, 0.5, 0.0]", b"- positions: [0.0]"), "point 1"),
    "YAML with a text": ("m.yaml", swap(b"[0.0, 0.5, 0.0]", b"[0.0, off, 0.0]"), "'off'"),
    "YAML with exponents": ("m.yaml", swap(b"[0.0, 0.5, 0.0]", b"[0e-3, 5e-1, 0x0]"), "'0x0'"),
    "YAML with an exponent alone": ("m.yaml", swap(b"[0.0, 0.5, 0.0]", b"[0e-3, 5e-1, 0]"), None),
    "YAML with an anchor": ("m.yaml", swap(b"[0.0, 0.5, 0.0]", b"[&a 0.0, 0.5, *a]"), None),
    "OpenSim with a row too few": ("m.mot", lambda data: data[: data.rindex(b"\n", 0, -1) + 1], "nRows|12"),
    "OpenSim without units": ("m.mot", swap(b"inDegrees=no", b"inDegrees=maybe"), "inDegrees"),
    "JSON of something else": ("m.json", lambda _: b'{"a": 1}', "Frames"),
    "JSON cut off": ("m.json", lambda _: b'{"Frames": [[0', "Frames"),
    "frames of another body": ("m.json", deepmimic([[0.1] * 19] * 3), "44"),
    "frames of several lengths": ("m.json", deepmimic([[0.1] * 44, [0.1] * 43]), "44"),
    "frames that take no time": ("m.json", deepmimic([[0.0] * 44] * 3), "lasts 0 s"),
}


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    file = tmp_path_factory.mktemp("body") / "small.urdf"
    file.write_text(BODY)
    return sp.load_body(file)


@pytest.mark.usefixtures("warm_readers")
@pytest.mark.parametrize("case", CASES)
def test_a_damaged_file_is_refused_by_name_or_read_as_it_stands(case, body, tmp_path):
    name, change, keyword = CASES[case]
    file = tmp_path / name
    if name in WRITERS:
        WRITERS[name](file)
    file.write_bytes(change(file.read_bytes() if file.exists() else b""))
    if keyword is None:
        path = sp.read_shape_path(file, body)
        order = [JOINTS.index(joint) for joint in body.joint_names]
        np.testing.assert_allclose(path.shape(TIMES), SHAPES[:, order], atol=1e-15)
        return
    with pytest.raises(ShapePhaseError, match=keyword) as caught:
        sp.read_shape_path(file, body)
    assert file.name in str(caught.value)


def test_files_damaged_at_random_show_no_fault(tmp_path: Path):
    """A few of those that `make fuzz` tries, and one whose member's name was a thousand bytes of the message."""
    for seed in (*range(12), 5214):
        assert fault_of(damaged_file(seed, tmp_path))[1] == ""
