"""Where machine code is kept, and what is said when there is none."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.cli.terminal import spoken
from shapephase.errors import CompilerError, MissingExtraError
from shapephase.integrator.fast import cache_folder, engine, switch

SPLIT = ["split", "cat", "cat_righting", "--json"]


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A folder for caches that nothing has used yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    kept = cache_folder.kernel_folder, engine._are_kept
    for answer in kept:
        answer.cache_clear()
    yield tmp_path
    for answer in kept:
        answer.cache_clear()


def kernel_folder():
    """The folder, and what is said about it; asked twice, said once."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = cache_folder.kernel_folder()
        assert cache_folder.kernel_folder() == found
    return found, [str(warning.message) for warning in said]


def mode(folder):
    return folder.stat().st_mode & 0o777


def test_the_folder_is_the_user_s_alone(home):
    found, said = kernel_folder()
    assert not said
    assert found.parent == home / "shapephase"
    assert mode(found) == mode(found.parent) == 0o700


def test_a_folder_that_others_may_read_is_closed_to_them(home):
    (home / "shapephase").mkdir(mode=0o755)
    found, said = kernel_folder()
    assert not said
    assert mode(found.parent) == 0o700


@pytest.mark.parametrize("bits", [0o770, 0o707, 0o777])
def test_a_folder_that_others_may_write_to_is_not_used(home, bits):
    """What is loaded from it would be run."""
    (home / "shapephase").mkdir()
    (home / "shapephase").chmod(bits)
    found, (said,) = kernel_folder()
    assert found is None
    assert "others may write" in said
    assert list((home / "shapephase").iterdir()) == []


def test_another_user_s_folder_is_not_used(home, monkeypatch):
    (home / "shapephase").mkdir(mode=0o700)
    if os.getuid() == 0:
        os.chown(home / "shapephase", 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    found, (said,) = kernel_folder()
    assert found is None
    assert "another user" in said


def test_a_link_to_a_folder_is_not_used(home):
    (home / "elsewhere").mkdir(mode=0o700)
    (home / "shapephase").symlink_to(home / "elsewhere")
    found, (said,) = kernel_folder()
    assert found is None
    assert "no folder" in said


@pytest.mark.usefixtures("home")
@pytest.mark.parametrize("value", ["relative/is/ignored", ""])
def test_without_a_home_nothing_is_kept(monkeypatch, value):
    def nowhere():
        raise RuntimeError("no home directory")

    monkeypatch.setenv("XDG_CACHE_HOME", value)
    monkeypatch.setattr(cache_folder.Path, "home", nowhere)
    found, (said,) = kernel_folder()
    assert found is None
    assert "XDG_CACHE_HOME" in said


@pytest.mark.usefixtures("fast")
def test_a_place_that_is_no_folder_cannot_be_compiled_into(tmp_path, home, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / "file"))
    with pytest.raises(CompilerError, match="XDG_CACHE_HOME"):
        sp.compile_steps()


def test_without_numba_it_says_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "numba", None)
    switch.is_installed.cache_clear()
    try:
        with pytest.raises(MissingExtraError, match=r"pip install 'shapephase\[fast\]'"):
            sp.compile_steps()
        with pytest.raises(SystemExit) as ended:
            main(["compile"])
    finally:
        switch.is_installed.cache_clear()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "pip install 'shapephase[fast]'" in said
    assert said.count("\n") == 1


@pytest.mark.usefixtures("fast")
def test_a_numba_that_does_not_work_is_told_once(monkeypatch):
    def broken(*_):
        raise ImportError("Numba needs NumPy 2.4 or less")

    monkeypatch.setattr(engine, "import_module", broken)
    monkeypatch.setattr(engine, "_is_ready", False)
    monkeypatch.setattr(engine, "_is_broken", False)
    with pytest.warns(sp.CompiledCodeWarning, match="needs NumPy"):
        assert not engine.is_ready()
    assert not engine.is_ready()
    with pytest.raises(CompilerError, match="needs NumPy"):
        sp.compile_steps()


@pytest.mark.usefixtures("fast", "home")
@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("quiet", [True, False])
def test_a_quiet_command_does_not_announce_it(monkeypatch, capfd, terminal, quiet):
    monkeypatch.setattr(engine, "_is_ready", False)
    monkeypatch.setattr(engine, "_warm", lambda: None)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    level = logging.getLogger("shapephase").level
    handler = logging.StreamHandler(sys.stderr)
    logging.getLogger("shapephase").addHandler(handler)
    try:
        with spoken(["compile", *(["--quiet"] if quiet else [])]):
            assert engine.is_ready()
    finally:
        logging.getLogger("shapephase").removeHandler(handler)
    assert logging.getLogger("shapephase").level == level
    assert ("compiling" in capfd.readouterr().err) == (not quiet)


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize("terminal", [True, False])
def test_the_first_compilation_is_announced(home, monkeypatch, capsys, caplog, terminal):
    assert list(home.iterdir()) == []
    monkeypatch.setattr(engine, "_is_ready", False)
    monkeypatch.setattr(engine, "_warm", lambda: None)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    with caplog.at_level(logging.WARNING, "shapephase"):
        assert engine.is_ready()
    said = capsys.readouterr().err
    if terminal:
        assert said.startswith("shapephase: compiling")
        assert said.endswith(" s\n")
    else:
        assert said == ""
        assert "compiling" in caplog.text


def run(arguments, home, **environment):
    """A process of its own: what it printed, and whether it imported Numba."""
    code = (
        f"import sys; from shapephase.cli.main import main; main({arguments!r}); "
        "print('numba' in sys.modules, file=sys.stderr)"
    )
    variables = {key: value for key, value in os.environ.items() if key != switch.VARIABLE}
    variables |= {"XDG_CACHE_HOME": str(home), **environment}
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=variables)
    return json.loads(done.stdout), done.stderr.splitlines()[-1] == "True"


def test_a_short_command_does_not_wait_for_numba(home):
    _, imported = run(SPLIT, home)
    assert not imported


@pytest.mark.full
@pytest.mark.usefixtures("fast")
def test_what_is_compiled_is_kept_and_found_again(home):
    compiled, _ = run(["compile", "--json"], home)
    files = [Path(name) for name in compiled["files"]]
    assert files
    assert all(file.is_file() for file in files)
    before = {file: file.stat().st_mtime_ns for file in files}
    again, _ = run(["compile", "--json"], home)
    assert again["files"] == compiled["files"]
    with_it, imported = run(SPLIT, home, **{switch.VARIABLE: "1"})
    assert imported
    assert before == {file: file.stat().st_mtime_ns for file in files}
    without, imported = run(SPLIT, home, **{switch.VARIABLE: "0"})
    assert not imported
    ends = [one["final_attitude_quat_xyzw"] for one in (with_it, without)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)
