"""Every NPZ file, JSON answer and report says when and how it was made, and of what."""

import datetime
import hashlib
import html
import json
import re
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import ResultFileError
from shapephase.provenance import command_line, provenance

HEADER = "t;Left;right_shoulder_abduction"
NAMES = "Left=left_shoulder_abduction [deg]"


@pytest.fixture
def take(tmp_path):
    waves = [(k / 60.0, 20.0 * np.sin(np.pi * k / 60.0) ** 2, 0.3 * np.sin(np.pi * k / 60.0) ** 2) for k in range(61)]
    rows = [";".join(f"{value:.12f}" for value in row) for row in waves]
    (tmp_path / "take.csv").write_text("\n".join([HEADER, *rows]))
    return str(tmp_path / "take.csv")


def checked(found, take, command):
    """What every provenance of this recording says."""
    assert found["command"] == command
    date = datetime.datetime.fromisoformat(found["date"])
    assert date.utcoffset() == datetime.timedelta(0)
    assert found["versions"]["shapephase"] == sp.__version__
    assert found["versions"]["numpy"] == np.__version__
    body = sp.load_body("diver")
    assert found["joints"] == list(body.joint_names)
    assert found["body"] == {"name": "diver", "sha256": body.sha256}
    recording = found["recording"]
    assert recording["file"] == take
    assert recording["sha256"] == hashlib.sha256(Path(take).read_bytes()).hexdigest()
    assert recording["columns"]["left_shoulder_abduction"] == "Left"
    assert recording["units"] == {"left_shoulder_abduction": "deg", "right_shoulder_abduction": "rad"}
    assert set(recording["smooth"].values()) == {0.001}
    assert recording["closing"]["by"] == "smooth"


@pytest.mark.usefixtures("no_pictures")
def test_the_motion_s_file_and_the_answer_and_the_report_say_it(take, tmp_path, capsys):
    out, page = tmp_path / "fall.npz", tmp_path / "fall.html"
    words = [
        "split",
        "diver",
        take,
        "--names",
        NAMES,
        "--smooth",
        "0.001",
        "--close",
        "1deg",
        "--momentum",
        "0",
        "5",
        "1",
    ]
    words += ["--out", str(out), "--html", str(page), "--json"]
    main(words)
    command = "shapephase " + " ".join(f"'{word}'" if " " in word else word for word in words)
    answer = json.loads(capsys.readouterr().out)
    checked(answer["provenance"] | {"recording": answer["recording"]}, take, command)
    with np.load(out) as arrays:
        stored = json.loads(str(arrays["header"]))["provenance"]
    checked(stored, take, command)
    text = html.unescape(page.read_text())
    for part in (
        command,
        stored["recording"]["sha256"],
        "left_shoulder_abduction: Left",
        "Computed by",
        "deg",
        "Joints",
    ):
        assert part in text
    assert re.search(r"Date</th><td[^>]*></td><td>20\d\d-", text)


def test_a_stored_motion_knows_what_it_was_made_from_and_passes_it_on(take, tmp_path):
    body = sp.load_body("diver")
    recorded = sp.read_recorded_motion(take, body, names=dict([NAMES.split("=")]), smooth=0.001, close="1deg")
    motion = sp.reconstruct(sp.articulated(body, recorded.path), [0.0, 5.0, 1.0])
    motion.save(tmp_path / "a.npz")
    back = sp.load_motion(tmp_path / "a.npz")
    checked(back.deformation.made_from | back.deformation.made_from["computed"], take, None)
    back.save(tmp_path / "b.npz")
    again = sp.load_motion(tmp_path / "b.npz").deformation.made_from
    assert again["recording"] == recorded.record
    assert sp.horizontal_gauge(sp.articulated(body, recorded.path)).made_from["recording"] == recorded.record


def test_a_path_s_file_says_what_it_was_read_from(take, tmp_path):
    body = sp.load_body("diver")
    recorded = sp.read_recorded_motion(take, body, names=dict([NAMES.split("=")]))
    sp.write_shape_path(recorded.path.stretched(2.0), tmp_path / "p.npz")
    with np.load(tmp_path / "p.npz") as arrays:
        found = json.loads(str(arrays["provenance"]))
    assert found["recording"] == json.loads(json.dumps(recorded.record))
    assert found["joints"] == list(body.joint_names)
    assert sp.read_shape_path(tmp_path / "p.npz", body).duration == 2.0


@pytest.mark.parametrize(
    "words",
    [
        ["check", "cat", "cat_righting"],
        ["robots"],
        ["plot", "shape", "cat", "cat_righting", "--out", "s.svg"],
        ["doctor"],
    ],
)
def test_every_answer_says_its_command(words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main([*words, "--json"])
    found = json.loads(capsys.readouterr().out)["provenance"]
    assert found["command"] == "shapephase " + " ".join([*words, "--json"])


def test_the_date_can_be_given(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert provenance()["date"] == "1970-01-02T00:00:00+00:00"
    for nonsense in ("-5", "soon", "9" * 30, ""):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", nonsense)
        assert provenance()["date"] > "2020"


def test_a_command_line_ends_with_what_is_inside():
    with command_line(["split", "a body", "x"]):
        assert provenance()["command"] == "shapephase split 'a body' x"
    assert provenance()["command"] is None
    assert provenance({"joints": ["a"]})["joints"] == ["a"]


def test_an_older_motion_is_read_and_a_damaged_one_is_named(tmp_path):
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.1, 1.0, 0.0])
    motion.save(tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz") as arrays:
        stored = dict(arrays)
    for content, outcome in ((None, None), ([1], "not an object"), ("a", "not an object")):
        header = json.loads(str(stored["header"]))
        del header["provenance"], header["digest"]
        if content is not None:
            header["provenance"] = content
        np.savez(tmp_path / "n.npz", **(stored | {"header": np.array(json.dumps(header))}))
        if outcome is None:
            assert sp.load_motion(tmp_path / "n.npz").deformation.made_from == {}
        else:
            with pytest.raises(ResultFileError, match=outcome):
                sp.load_motion(tmp_path / "n.npz")
