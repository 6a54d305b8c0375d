"""The project itself: what a wheel and an editable install find, how fast it imports, what the README says."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import shapephase as sp

ROOT = Path(__file__).parents[1]
COUNT = "import shapephase as sp; b = [sp.load_body(n) for n in sp.robot_names()]; print(len(b), sp.__file__)"


def test_a_wheel_holds_the_bodies(tmp_path):
    built = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*built, "--wheel-dir", str(tmp_path), str(ROOT)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("shapephase-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
        names = archive.namelist()
    assert {f"shapephase/robots/{n}.urdf" for n in sp.robot_names()} <= set(names)
    assert wheel.stat().st_size < 1_000_000
    code = f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r}); {COUNT}"
    said = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    count, where = said.split(maxsplit=1)
    assert int(count) == len(sp.robot_names()) >= 5
    assert str(tmp_path) in where


def test_a_checkout_holds_the_bodies(tmp_path):
    """As an editable install finds them: from the source folder."""
    code = f"import sys; sys.path.insert(0, {str(ROOT / 'src')!r}); {COUNT}"
    said = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    count, where = said.split(maxsplit=1)
    assert int(count) >= 5
    assert str(ROOT / "src") in where


def test_importing_brings_nothing_heavy():
    code = (
        "import sys, shapephase; heavy = {'casadi', 'matplotlib', 'viser', 'mujoco', 'scipy.integrate', "
        "'scipy.interpolate', 'cyclopts'}; print(sorted(heavy & set(sys.modules)))"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert said.strip() == "[]"


def test_the_readme_s_python_runs_and_prints_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robots").symlink_to(ROOT / "robots")
    ((block, output),) = re.findall(
        r"```python\n(.*?)```\n\n```text\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL
    )
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out == output
    assert (tmp_path / "fall.npz").exists()
    assert len((tmp_path / "fall.csv").read_text().splitlines()) == 202


def test_the_readme_begins_with_the_two_commands():
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) >= 2
    assert all(len(block.strip().splitlines()) == 1 for block in blocks[:2])


@pytest.mark.parametrize("name", sp.robot_names())
def test_bodies_say_where_their_numbers_come_from(name):
    text = (ROOT / "robots" / f"{name}.urdf").read_text()
    assert "<!--" in text
    assert text.count("<visual>") >= text.count("<mass ")


def test_the_benchmark_s_opponent_still_stands_on_the_body():
    code = (
        "from benchmarks.cases import cases; from benchmarks.contestants import FloatingModel; "
        "[FloatingModel(case).set(0.1) for case in cases()]; print('set')"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT).stdout
    assert said == "set\n"
