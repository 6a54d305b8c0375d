"""The recipe for Basilisk, as it stands in the documentation, by an interpreter that has Basilisk (package `bsk`)."""

from __future__ import annotations

import os
import re
import subprocess

import pytest

from support.places import ROOT

INTERPRETER = os.environ.get("SHAPEPHASE_BASILISK")  # path of a Python that has Basilisk
PAGE = (ROOT / "docs" / "howto" / "export.md").read_text(encoding="utf-8")


@pytest.mark.full
@pytest.mark.skipif(not INTERPRETER, reason="SHAPEPHASE_BASILISK names no interpreter with Basilisk")
def test_basilisk_makes_the_same_motion_of_prescribed_links(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    section = re.search(r"^## Basilisk\n(.*?)^## ", PAGE, re.MULTILINE | re.DOTALL)[1]
    ours, replay, compared = re.findall(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    names = {}
    exec(ours, names)
    subprocess.run([str(INTERPRETER), "-c", replay], check=True, env={}, timeout=600)
    exec(compared, names)
    right, degrees = capsys.readouterr().out.split()[-2:]
    assert right == "True"
    assert 0.0 < float(degrees) < float(re.search(r"less than (\S+) degrees", section)[1])
