"""Files that are well formed and mean no motion: they are refused by name, before they cost memory or time."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ResultFileError, TrajectoryError
from support.bodies import link, urdf

NAMES = ("left_shoulder_abduction", "right_shoulder_abduction")


@pytest.fixture(scope="module")
def diver():
    return sp.load_body("diver")


@pytest.mark.parametrize("exponent", [-320, -310, -300, -200, -150, -100, -61, 61, 100, 150, 200, 300])
def test_times_whose_powers_overflow(tmp_path, diver, exponent):
    file = tmp_path / "m.csv"
    rows = "".join(f"{k}e{exponent},{0.1 * (k % 3)},{0.2 * (k % 2)}\n" for k in range(5))
    file.write_text(f"time,{','.join(NAMES)}\n{rows}")
    with pytest.raises(TrajectoryError, match="times"):
        sp.read_shape_path(file, diver)
    step = float(f"1e{exponent}")
    for make in (sp.ShapePath.spline, sp.ShapePath.waypoints):
        with pytest.raises(TrajectoryError, match="times"):
            make(step * np.arange(4), np.arange(8.0).reshape(4, 2))
    with pytest.raises(TrajectoryError, match="duration"):
        sp.ShapePath.fourier([0.1], [[0.2]], [[0.3]], step)


@pytest.mark.parametrize("exponent", [-59, -20, 20, 58])
def test_any_other_unit_of_time_is_the_same_motion(diver, exponent):
    """The holonomy knows nothing of time."""
    shapes = 0.3 * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    turned = []
    for unit in (1.0, float(f"1e{exponent}")):
        path = sp.ShapePath.spline(unit * np.arange(5), shapes, joint_names=NAMES)
        turned.append(sp.reconstruct(sp.articulated(diver, path), np.zeros(3)).final_attitude)
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-8, rtol=0)


def header(kind: str, shape: str) -> bytes:
    """The header of an NPY file of version 1.0, without the array."""
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}"
    text += " " * (63 - (len(text) + 10) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def test_an_array_that_only_its_header_has(tmp_path, diver):
    """A header that promises 80 GB."""
    for name in ("joint_names", "time", "header"):
        file = tmp_path / f"{name}.npz"
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr(f"{name}.npy", header("<f8", "(10000000000,)"))
        with pytest.raises(TrajectoryError, match="array"):
            sp.read_shape_path(file, diver)
        with pytest.raises(ResultFileError, match="array"):
            sp.load_motion(file)


def yaml_motion(times, more="", first="") -> str:
    points = "".join(
        f"- {{positions: [{k}.1, 0], time_from_start: {{sec: {time}, nanosec: 0}}}}\n" for k, time in enumerate(times)
    )
    return f"{first}joint_names: [{', '.join(NAMES)}]\npoints:\n{points}{more}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (yaml_motion((-2, -1, 0)), "point 1: time_from_start is before the start"),
        (
            yaml_motion((0, 1, 2)).replace("{sec: 0, nanosec: 0}", "-0.5"),
            "point 1: time_from_start is before the start",
        ),
        (yaml_motion((0, 1), first="<<: {a: 1}\n"), "merge keys"),
        (yaml_motion((0, 1), more="- {<<: {time_from_start: {sec: 4}}, positions: [0, 0]}\n"), "line 5: merge keys"),
        (
            "".join(
                f"---\nheader: {{stamp: {{sec: {time}, nanosec: 0}}}}\nname: [{', '.join(NAMES)}]\nposition: [0, 0]\n"
                for time in (-2, -1, 3)
            ),
            "header stamp: no clock",
        ),
    ],
)
def test_yaml_that_means_something_else_than_it_seems(tmp_path, diver, text, words):
    pytest.importorskip("yaml")
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(TrajectoryError, match=words):
        sp.read_shape_path(tmp_path / "m.yaml", diver)


@pytest.mark.parametrize("said", ["UTF-16", "utf-32", "ISO-8859-1", "windows-1252", "idna", "nonsense"])
def test_an_encoding_that_is_said_and_not_used(tmp_path, said):
    text = f"<?xml version='1.0' encoding='{said}'?>\n{urdf(link('ä', 1.0, [0.1, 0.1, 0.1]))}"
    (tmp_path / "b.urdf").write_text(text, encoding="utf-8")
    assert sp.load_body(tmp_path / "b.urdf").link_names == ("ä",)


@pytest.mark.parametrize("said", ["UTF-8", "utf8", "ISO-8859-1", "us-ascii", "Windows-1252"])
def test_an_encoding_that_makes_no_difference(tmp_path, said):
    text = f"<?xml version='1.0' encoding='{said}'?>\n{urdf(link('a', 1.0, [0.1, 0.1, 0.1]))}"
    (tmp_path / "b.urdf").write_text(text, encoding="ascii")
    assert sp.load_body(tmp_path / "b.urdf").mass == 1.0
