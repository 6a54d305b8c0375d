"""The project itself: what a wheel and an editable install find, how fast it imports, what the README says."""

import ast
import datetime
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from functools import cache
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any

import pytest

import shapephase as sp
from shapephase.body.engines.formats import FORMATS
from shapephase.cli.main import main

ROOT = Path(__file__).parents[1]
COUNT = "import shapephase as sp; b = [sp.load_body(n) for n in sp.robot_names()]; print(len(b), sp.__file__)"


def test_a_wheel_made_of_the_sdist_works_in_another_folder(tmp_path):
    built = [sys.executable, "-m", "hatchling", "build", "--target", "sdist", "--directory", str(tmp_path)]
    subprocess.run(built, check=True, capture_output=True, cwd=ROOT)
    (sdist,) = tmp_path.glob("shapephase-*.tar.gz")
    built = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*built, "--wheel-dir", str(tmp_path), str(sdist)], check=True, capture_output=True, cwd=tmp_path)
    (wheel,) = tmp_path.glob("shapephase-*.whl")
    assert wheel.name.split("-")[1] == sp.__version__
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
        names = archive.namelist()
    assert {f"shapephase/robots/{n}.urdf" for n in sp.robot_names()} <= set(names)
    sources = {f"{path.relative_to(ROOT / 'src')}" for path in (ROOT / "src").rglob("*.py*") if path.suffix != ".pyc"}
    assert sources <= set(names)
    assert wheel.stat().st_size < 1_910_000
    # Python's path begins with the wheel: whatever else is installed, the checkout included, comes after it.
    outside = {"cwd": tmp_path / "empty", "env": os.environ | {"PYTHONPATH": str(tmp_path / "site")}, "check": True}
    # The README's Python, too, in a folder that has nothing of the checkout.
    block, output = _readme_s_python()
    (tmp_path / "empty").mkdir()
    ran = subprocess.run([sys.executable, "-c", f"{COUNT}\n{block}"], capture_output=True, text=True, **outside)
    said, printed = ran.stdout.split("\n", 1)
    count, where = said.split(maxsplit=1)
    assert int(count) == len(sp.robot_names()) >= 5
    assert str(tmp_path) in where
    assert printed == output


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


def _readme() -> str:
    return (ROOT / "README.md").read_text(encoding="utf-8")


def _readme_s_python() -> tuple[str, str]:
    """Its code, and what it prints."""
    ((block, output),) = re.findall(r"```python\n(.*?)```\n\nIt prints:\n\n```text\n(.*?)```", _readme(), re.DOTALL)
    return block, output


def test_the_readme_s_python_runs_and_prints_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    block, output = _readme_s_python()
    assert len(block.splitlines()) <= 10
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out == output
    assert len((tmp_path / "attitudes.csv").read_text().splitlines()) == 202


def test_the_readme_s_recording_is_split_as_it_says(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    ((sample, command, table),) = re.findall(
        r"```csv\n(.*?)```\n\n`shapephase (split [^`]*)`[^`]*```text\n(.*?)```", _readme(), re.DOTALL
    )
    assert (ROOT / "robots" / "diver_arms.csv").read_text(encoding="utf-8") == sample
    main(command.split())
    # The estimates are rounding, which differs between processors.
    estimates = re.compile(r" \d\.\de-\d\d ")
    printed = estimates.sub("", capsys.readouterr().out)
    assert printed.startswith(estimates.sub("", table))


@pytest.mark.parametrize("number", [0, *(pytest.param(k, marks=pytest.mark.full) for k in (1, 2, 3, 4))])
def test_the_readme_s_bodies_of_other_formats_are_checked_and_split(number, monkeypatch, capsys):
    """Each by one command, where its extra is installed, without a warning."""
    monkeypatch.chdir(ROOT)
    lines = re.findall(r"^shapephase split (robots/formats/.*?) *# .*\[(\w+)\]$", _readme(), re.MULTILINE)
    assert sorted(extra for _, extra in lines) == sorted(known.extra for known in FORMATS.values())
    words, extra = lines[number]
    if not any(find_spec(known.engine) for known in FORMATS.values() if known.extra == extra):
        pytest.skip(f"needs {extra}")
    for command, said in (("check", "verdict: "), ("split", "total rotation")):
        main([command, *words.split()])
        printed = capsys.readouterr()
        assert said in printed.out
        assert printed.err == ""


def test_the_readme_s_links_lead_to_files_of_the_repository():
    """Files, or folders of them, that read well as they stand: nothing is promised that is published elsewhere."""
    targets = re.findall(r"\]\(\s*([^)\s]+)\s*\)", _readme())
    assert len(targets) > 10
    for target in targets:
        assert (ROOT / target).exists(), target
        assert (ROOT / target).is_dir() or target.endswith((".md", ".cff", ".svg")), target


@pytest.mark.full
def test_what_would_be_uploaded_passes_the_package_index_s_check(tmp_path):
    for needed in ("build", "twine"):
        pytest.importorskip(needed)
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    files = sorted(tmp_path.iterdir())
    assert [file.suffix for file in files] == [".whl", ".gz"]
    checked = [sys.executable, "-m", "twine", "check", "--strict", *map(str, files)]
    said = subprocess.run(checked, check=True, capture_output=True, text=True).stdout
    assert said.count("PASSED") == 2


def test_hosts_build_what_make_docs_builds():
    hosted = (ROOT / ".readthedocs.yaml").read_text(encoding="utf-8")
    assert "  configuration: docs/conf.py\n  fail_on_warning: true\n" in hosted
    assert "extra_requirements: [docs]\n" in hosted
    workflow = (ROOT / ".github" / "workflows" / "pages.yml").read_text(encoding="utf-8")
    assert "pip install --quiet '.[docs]'\n      - run: make docs\n" in workflow
    packed = re.search(r"^\tcd (\S+) .* -c (\S+\.zip) html$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert packed
    assert f"path: {packed[1]}/{packed[2]}\n" in workflow


def test_the_readme_begins_with_the_two_commands():
    blocks = re.findall(r"```sh\n(.*?)```", _readme(), re.DOTALL)
    assert len(blocks) >= 2
    assert all(len(block.strip().splitlines()) == 1 for block in blocks[:2])


def _project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_version_stands_once_and_is_repeated_rightly():
    """In `__init__.py`, which the wheel reads; the newest release of the changelog has the citation's date."""
    assert _project()["dynamic"] == ["version"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    said = dict(re.findall(r"^(version|date-released): \"?([^\"\n]*)", citation, re.MULTILINE))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", changes, re.MULTILINE)
    releases = [heading for heading in headings if heading != "Unreleased"]
    assert "Unreleased" not in headings[1:]
    assert releases[0] == f"{said['version']} ({said['date-released']})"
    dates = [datetime.date.fromisoformat(re.fullmatch(r"[\w.]+ \((.*)\)", release)[1]) for release in releases]
    assert dates == sorted(dates, reverse=True)
    recipe = (ROOT / "conda-recipe" / "recipe.yaml").read_text(encoding="utf-8")
    assert said["version"] == re.search(r"^  version: \"(.*)\"$", recipe, re.MULTILINE)[1] == sp.__version__


def test_the_citation_has_the_three_source_works_with_years():
    listed = re.findall(r"family-names: (\w+)|^    year: (\d+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    words = [name or year for name, year in listed]
    assert words[:8] == ["Cabrera", "2007", "Bonnard", "Cots", "Shcherbakova", "2013", "Marsden", "Ratiu"]
    assert words[8] == "1999"


@pytest.mark.parametrize("name", sp.robot_names())
def test_bodies_say_where_their_numbers_come_from(name):
    text = (ROOT / "robots" / f"{name}.urdf").read_text()
    assert "<!--" in text
    assert text.count("<visual>") >= text.count("<mass ")


@cache
def shipped_texts() -> dict[Path, str]:
    """Texts of the repository, without what is built; of notebooks without pictures and pages among the outputs."""
    names = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "Makefile", "pyproject.toml", ".ci/run")
    files = [ROOT / name for name in names]
    kinds = (".py", ".pyi", ".ipynb", ".md", ".toml", ".urdf", ".js", ".html", ".css", ".bib")
    made = {"_build", "__pycache__", "tables", "mathjax"}
    for folder in ("src", "tests", "benchmarks", "notebooks", "docs", "robots"):
        files += [file for file in (ROOT / folder).rglob("*") if file.suffix in kinds and not made & set(file.parts)]
    files = [file for file in files if file.parts[-3:-1] != ("tutorials", "notebooks")]
    output = re.compile(r'"(?:image/png|text/html)": (?:\[[^\]]*\]|"[^"]*")')
    return {file: output.sub("", file.read_text(encoding="utf-8")) for file in files}


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
    for file, shipped in shipped_texts().items():
        if file.suffix not in (".py", ".pyi", ".ipynb") or "docs" in file.parts or file == Path(__file__):
            continue
        text = re.sub(r"\s*\n[\s#]*", " ", shipped)
        for match in re.finditer(rf"{name}((?:[ ,;:(-]|and|to|its|errata|sections?|\d+\b|{_CODE}\b|[A-U]\b)*)", text):
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
    assert len(named) > 10
    assert not named - defined


def test_the_layers_are_those_of_the_import_contract():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```text\n *(cli\n.*?)```", page, re.DOTALL)
    whole = block.replace("\n    ", " ")  # a long layer goes on in the next line
    said = [set(re.findall(r"\w+", re.sub(r"\(.*\)", "", line))) for line in whole.strip().splitlines()]
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    assert said == [set(re.findall(r"\w+", layer)) for layer in contracts[0]["layers"] if layer != "__main__"]


def test_no_room_imports_what_is_private_to_another():
    """Neither a module nor a name that begins with an underscore; lazy imports and those for types count, too."""
    source, wrong = ROOT / "src", []
    for file in source.rglob("*.py"):
        package = ".".join(file.relative_to(source).parts[:-1])
        for line in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(line, ast.ImportFrom):
                module = resolve_name("." * line.level + (line.module or ""), package)
                names = [f"{module}.{name.name}" for name in line.names]
            else:
                names = [name.name for name in line.names] if isinstance(line, ast.Import) else []
            room = f"{package}.".split(".")[:2]
            for parts in (name.split(".") for name in names):
                if parts[0] == "shapephase" and parts[:2] != room and any(re.match("_[^_]", part) for part in parts):
                    wrong.append(f"{file.relative_to(source)}:{line.lineno} {'.'.join(parts)}")
    assert not wrong


def test_nothing_refers_to_a_note_outside_the_repository():
    inside = {"readme.md", "contributing.md", "changelog.md", *(page.name for page in (ROOT / "docs").rglob("*.md"))}
    talk = re.compile(r"\bissues? \d|\bthe issue\b|Must show|\bhazards? \d|\bchecklist\b")
    page = re.compile(r"(?<![\w-])[\w-]+\.md\b")
    for file, text in shipped_texts().items():
        if file != Path(__file__):
            assert not (found := talk.search(text)), f"{file.relative_to(ROOT)}: {found[0]}"
            assert {name.lower() for name in page.findall(text)} <= inside, file.relative_to(ROOT)


def test_files_that_are_referred_to_are_there():
    """By their path from the root, or by name for Python and notebooks; what is built or written is not meant."""
    texts = shipped_texts()
    there = {file.name for file in texts}
    built = re.compile(r"docs/_build|docs/jupyter_execute|docs/reference/\*")
    path = re.compile(r"(?<![\w./-])(?:\.\./)*((?:docs|notebooks|tests|benchmarks|robots|src|shared|\.ci)/[\w./-]*\w)")
    name = re.compile(r"(?<![\w*{}<./-])([\w-]+\.(?:py|ipynb|pyi))\b(?!\()")
    others = {"numpy.py", "casadi.py", "ipython_kernel_config.py", "shares.py"}
    for file, text in texts.items():
        for found in path.findall(text):
            there_is = (ROOT / found).exists() or any(ROOT.glob(f"{found}.*")) or built.match(found)
            assert there_is, f"{file.relative_to(ROOT)}: {found}"
        assert set(name.findall(text)) <= there | others, file.relative_to(ROOT)


def test_every_benchmark_can_be_imported():
    names = sorted(path.stem for path in (ROOT / "benchmarks").glob("[a-z]*.py"))
    code = f"from importlib import import_module; print([import_module('benchmarks.' + n).__name__ for n in {names}])"
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT).stdout
    assert said.count("benchmarks.") == len(names) >= 10


def test_the_benchmark_s_opponent_still_stands_on_the_body():
    from benchmarks.cases import cases
    from benchmarks.contestants import FloatingModel

    for case in cases():
        FloatingModel(case).set(0.1)
