"""The project itself: what a wheel and an editable install find, how fast it imports, what the README says."""

import re
import subprocess
import sys
import tomllib
import zipfile
from operator import attrgetter
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
    assert wheel.stat().st_size < 1_200_000
    code = f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r}); {COUNT}"
    said = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    count, where = said.split(maxsplit=1)
    assert int(count) == len(sp.robot_names()) >= 5
    assert str(tmp_path) in where
    # The README's Python, in a folder that has nothing of the checkout.
    block, output = _readme_s_python()
    (empty := tmp_path / "empty").mkdir()
    code = f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r})\n{block}"
    ran = subprocess.run([sys.executable, "-c", code], cwd=empty, check=True, capture_output=True, text=True)
    assert ran.stdout == output


def test_a_checkout_holds_the_bodies(tmp_path):
    """As an editable install finds them: from the source folder."""
    code = f"import sys; sys.path.insert(0, {str(ROOT / 'src')!r}); {COUNT}"
    said = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    count, where = said.split(maxsplit=1)
    assert int(count) >= 5
    assert str(ROOT / "src") in where


def test_importing_brings_nothing_heavy():
    code = (
        "import sys, shapephase; heavy = {'casadi', 'matplotlib', 'jinja2', 'mujoco', 'scipy.integrate', "
        "'scipy.interpolate', 'cyclopts', 'numba'}; print(sorted(heavy & set(sys.modules)))"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert said.strip() == "[]"


def _readme_s_python() -> tuple[str, str]:
    """Its code, and what it prints."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    ((block, output),) = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, re.DOTALL)
    return block, output


def test_the_readme_s_python_runs_and_prints_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    block, output = _readme_s_python()
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out == output
    assert (tmp_path / "fall.npz").exists()
    assert len((tmp_path / "fall.csv").read_text().splitlines()) == 202


def test_the_readme_s_names_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^\| question \| names \|\n(.*?)\n\n", text, re.MULTILINE | re.DOTALL)
    names = [name for row in table.splitlines()[1:] for name in re.findall(r"`([\w.]+)`", row.split("|")[2])]
    assert len(names) > 30
    # In a list, later names are from where the first one is.
    places = (sp, sp.optimal_control)
    for name in names:
        assert any(hasattr(place, name) for place in places) or attrgetter(name.removeprefix("sp."))(sp)


def test_the_readme_begins_with_the_two_commands():
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) >= 2
    assert all(len(block.strip().splitlines()) == 1 for block in blocks[:2])


@pytest.mark.parametrize("name", sp.robot_names())
def test_bodies_say_where_their_numbers_come_from(name):
    text = (ROOT / "robots" / f"{name}.urdf").read_text()
    assert "<!--" in text
    assert text.count("<visual>") >= text.count("<mass ")


_CODE = r"(?:[CBM]-E\d+|[A-U]\d+[a-z]?)"


def _defined_in_the_theory() -> set[str]:
    text = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    return set(re.findall(rf"^- \*\*({_CODE})\*\*", text, re.MULTILINE)) | set(
        re.findall(r"^### ([A-U])\. ", text, re.MULTILINE)
    )


def _sections(name: str) -> set[str]:
    return set(re.findall(r"^## (\d+)\. ", (ROOT / "docs" / name).read_text(encoding="utf-8"), re.MULTILINE))


def _cited(name: str) -> list[tuple[str, list[str], list[str]]]:
    """Where a page of docs/ is cited, with which sections and codes; line breaks do not end a citation."""
    found = []
    for folder in ("src", "tests", "benchmarks", "notebooks"):
        for file in sorted((ROOT / folder).rglob("*")):
            if file.suffix not in (".py", ".pyi", ".ipynb") or file == Path(__file__):
                continue
            text = re.sub(r"\s*\n[\s#]*", " ", file.read_text(encoding="utf-8"))
            for match in re.finditer(
                rf"{name}((?:[ ,;:(-]|and|to|its|errata|sections?|\d+\b|{_CODE}\b|[A-U]\b)*)", text
            ):
                citation = match[1]
                codes = re.findall(rf"(?<![\w-])({_CODE}|[A-U])(?![\w])", citation)
                sections = re.findall(r"sections? ((?:\d+(?: and |, )?)+)", citation)
                place = f"{file.relative_to(ROOT)}: {name}{citation}"
                found.append((place, [number for one in sections for number in re.findall(r"\d+", one)], codes))
    return found


@pytest.mark.parametrize("name", ["theory.md", "numerics.md"])
def test_what_is_cited_from_the_docs_stands_there(name):
    defined, sections, cited = _defined_in_the_theory(), _sections(name), _cited(name)
    assert len(cited) > {"theory.md": 150, "numerics.md": 5}[name]
    for place, numbers, codes in cited:
        assert set(numbers) <= sections, place
        assert not codes or (name == "theory.md" and set(codes) <= defined), place
        assert numbers or codes, f"{place}: which part of it?"


def test_codes_at_the_end_of_test_names_stand_in_the_theory():
    defined = {code.lower().replace("-", "_") for code in _defined_in_the_theory()}
    for file in sorted((ROOT / "tests").rglob("test_*.py")):
        for name in re.findall(r"def (test_\w+)\(", file.read_text(encoding="utf-8")):
            if ends := re.search(r"_((?:[cbm]_e|[a-z])\d+[a-z]?)$", name):
                # The parts of an exercise, (a), (b), (c), have one entry together.
                assert {ends[1], ends[1].rstrip("abc")} & defined, f"{file.relative_to(ROOT)}: {name}"


def test_the_architecture_page_names_what_there_is():
    """Its files exist, and so does every function with parentheses and every class in it."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    source = ROOT / "src" / "shapephase"
    for file in re.findall(r"`((?:\w+/)+\w+\.py)`", text):
        assert (source / file).exists() or (ROOT / file).exists(), file
    code = "\n".join(file.read_text(encoding="utf-8") for file in source.rglob("*.py"))
    defined = set(re.findall(r"^ *(?:def|class) (\w+)", code, re.MULTILINE))
    named = set(re.findall(r"`(\w+)\(\)`", text)) | set(re.findall(r"`([A-Z][a-z]\w+)`", text))
    assert len(named) > 40
    assert not named - defined


@pytest.mark.parametrize("page", ["docs/architecture.md", "CONTRIBUTING.md"])
def test_the_layers_are_those_of_the_import_contract(page):
    (block,) = re.findall(r"```text\n *(cli\n.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    said = [set(re.findall(r"\w+", re.sub(r"\(.*\)", "", line))) for line in block.strip().splitlines()]
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    assert said == [set(re.findall(r"\w+", layer)) for layer in contracts[0]["layers"] if layer != "__main__"]


def test_nothing_refers_to_a_note_outside_the_repository():
    inside = {"readme.md", "contributing.md", "changelog.md", *(page.name for page in (ROOT / "docs").rglob("*.md"))}
    talk = re.compile(r"\bissues? \d|\bthe issue\b|Must show|\bhazards? \d|\bchecklist\b")
    page = re.compile(r"(?<![\w-])[\w-]+\.md\b")
    files = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "Makefile", "pyproject.toml")]
    for folder in ("src", "tests", "benchmarks", "notebooks", "docs"):
        files += [file for file in (ROOT / folder).rglob("*") if file.suffix in (".py", ".pyi", ".ipynb", ".md")]
    for file in files:
        if file != Path(__file__):
            text = file.read_text(encoding="utf-8")
            assert not (found := talk.search(text)), f"{file.relative_to(ROOT)}: {found[0]}"
            assert {name.lower() for name in page.findall(text)} <= inside, file.relative_to(ROOT)


def test_every_benchmark_can_be_imported():
    names = sorted(path.stem for path in (ROOT / "benchmarks").glob("[a-z]*.py"))
    code = f"from importlib import import_module; print([import_module('benchmarks.' + n).__name__ for n in {names}])"
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT).stdout
    assert said.count("benchmarks.") == len(names) >= 10


def test_the_benchmark_s_opponent_still_stands_on_the_body():
    code = (
        "from benchmarks.cases import cases; from benchmarks.contestants import FloatingModel; "
        "[FloatingModel(case).set(0.1) for case in cases()]; print('set')"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT).stdout
    assert said == "set\n"
