"""Studies over recorded motions: each file with its reading, momentum fitted to its base."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import study as room
from shapephase.errors import ShapeError, StudyError, UnknownNameError, WrongObjectError
from support.study_functions import share_of_the_arms

MOMENTA = {"anna.csv": (1.0, 62.0, 0.5), "berta.csv": (-0.5, 55.0, 0.0)}
OUTPUTS = ("somersaults", "twists", "initial_momentum", room.Output("arms", share_of_the_arms))
FILE = """
body = "diver"
outputs = ["somersaults", "twists", "initial_momentum"]

[over.motion]
values = ["anna.csv", "berta.csv"]

[recording]
flight = "all"

[recording."berta.csv"]
flight = [0.1, 1.1]

[functions.arms]
call = "support.study_functions:share_of_the_arms"
"""


@pytest.fixture
def dives(tmp_path, monkeypatch):
    """Motions of two divers, each also a file with the base's attitude."""
    monkeypatch.chdir(tmp_path)
    diver, motions = sp.load_body("diver"), {}
    for name, momentum in MOMENTA.items():
        moved = [[2.5, -2.5], [0.5, -2.5], [0.5, -2.5], [2.5, -2.5]]
        path = sp.ShapePath.spline([0.0, 0.4, 0.8, 1.2], moved, joint_names=diver.joint_names)
        motions[name] = sp.reconstruct(sp.articulated(diver, path), momentum)
        sp.export_motion(motions[name], name, times=np.linspace(0.0, 1.2, 241))
    return motions


def test_each_file_has_its_momentum_and_outputs(dives):
    """Against the motions that the files were written from."""
    study = room.Study("diver", over={"motion": list(dives)}, motion="anna.csv", outputs=OUTPUTS,
                       recording={"flight": "all"})  # fmt: skip
    store = study.run("out.zarr", workers=0)
    assert store.counts()["done"] == 2
    np.testing.assert_allclose(store.values("initial_momentum"), list(MOMENTA.values()), rtol=0, atol=1e-3)
    for row, motion in enumerate(dives.values()):
        turns = sp.phases.athlete_turns(motion)
        assert store.values("somersaults")[row] == pytest.approx(turns.somersaults, abs=1e-4)
        assert store.values("twists")[row] == pytest.approx(turns.twists, abs=1e-4)
        assert store.values("arms")[row] == pytest.approx(share_of_the_arms(motion), abs=1e-3)


@pytest.mark.full
def test_a_study_file_reads_each_recording_in_its_own_way(dives, tmp_path):
    (tmp_path / "study.toml").write_text(FILE)
    study = room.read_study("study.toml")
    store = study.run("out.zarr", workers=0)
    assert store.counts()["done"] == 2
    np.testing.assert_allclose(store.values("initial_momentum"), list(MOMENTA.values()), rtol=0, atol=1e-3)
    whole, part = dives.values()
    angles = part.somersault_tilt_twist(np.array([0.1, 1.1]))
    assert store.values("twists")[0] == pytest.approx(sp.phases.athlete_turns(whole).twists, abs=1e-4)
    assert abs(store.values("twists")[1]) == pytest.approx(abs(np.diff(angles[2])[0]) / (2.0 * np.pi), abs=1e-4)
    made = room.Study("diver", "anna.csv", {"momentum_z": [1.0]})
    assert "recording" not in made.description


def test_without_a_recorded_base_the_case_has_the_reason(dives, tmp_path):
    path = dives["anna.csv"].deformation.description.path
    sp.write_shape_path(path, tmp_path / "joints.csv")
    store = room.Study("diver", "joints.csv", outputs=("turn",), recording={}).run("out.zarr", workers=0)
    ((_, name, text),) = store.errors()
    assert name == "StudyError"
    assert "nothing of the base is recorded" in text


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"motion": "diver_twist"}, StudyError, "diver_twist"),
        ({"over": {"momentum_z": [1.0]}}, StudyError, "over.momentum_z"),
        ({"recording": {"fligth": "all"}}, UnknownNameError, "Did you mean 'flight'"),
        ({"recording": {"anna.csv": {"fligth": "all"}}}, WrongObjectError, "Did you mean 'flight'"),
        ({"recording": {"anna.csv": 3}}, ShapeError, "read_recorded_motion"),
        ({"recording": ["all"]}, ShapeError, "recording"),
    ],
)
def test_wrong_recordings_are_named(changed, error, words, dives):  # noqa: ARG001
    given = {"motion": "anna.csv", "recording": {}} | changed
    with pytest.raises(error, match=words):
        room.Study("diver", **given)
