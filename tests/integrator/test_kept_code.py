"""Kept machine code under torture: what is not whole, not this user's or not for this is made anew, never run."""

from __future__ import annotations

import ast
import os
import pickle
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest

from shapephase.integrator import kept_code
from support.keeping_process import KeepingProcess


@pytest.fixture(scope="module")
def process():
    one = KeepingProcess()
    yield one
    one.stop()


@pytest.fixture(scope="module")
def compiled(process, tmp_path_factory):
    """A folder for caches with one function in it."""
    home = tmp_path_factory.mktemp("compiled")
    assert ask(process, home) == (14.0, False, [])
    return home


@pytest.fixture
def home(compiled, tmp_path):
    """A copy of it."""
    shutil.copytree(compiled, tmp_path / "home")
    return tmp_path / "home"


def ask(process, home, **request):
    answer = process.ask(home=str(home), **request)
    assert "died" not in answer, answer
    return answer["value"], answer["found"], answer["said"]


def files(home) -> list[Path]:
    """All that is kept, whatever it is."""
    return list(home.glob("shapephase/kernels-*/*"))


def kept(home) -> Path:
    """The only one."""
    (file,) = files(home)
    return file


def is_made_anew(process, home):
    """The function is right, without the file; and the file is repaired."""
    assert ask(process, home) == (14.0, False, [])
    assert ask(process, home) == (14.0, True, [])


def test_what_is_whole_is_loaded(process, home):
    assert ask(process, home) == (14.0, True, [])
    assert stat.S_IMODE(kept(home).parent.stat().st_mode) == 0o700


def test_a_file_that_is_cut_off_or_has_a_wrong_bit_is_made_anew(process, home):
    """Also a bit within the machine code, which would crash or compute something else."""
    file = kept(home)
    whole = file.read_bytes()
    rng = np.random.default_rng(5)
    for length in [0, 31, len(whole) - 1, int(rng.integers(len(whole)))]:
        file.write_bytes(whole[:length])
        is_made_anew(process, home)
    for place in [0, *rng.integers(len(whole), size=3)]:
        changed = bytearray(whole)
        changed[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(changed)
        is_made_anew(process, home)


class Trap:
    """Something that does harm when it is unpickled."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_what_nobody_of_us_wrote_is_not_even_unpickled(process, home, tmp_path):
    file, mark = kept(home), tmp_path / "mark"
    for before in (b"", file.read_bytes()[:32]):
        file.write_bytes(before + pickle.dumps(Trap(mark)))
        is_made_anew(process, home)
    assert not mark.exists()


def test_the_code_of_another_function_is_not_taken_for_it(process, home, tmp_path):
    shutil.rmtree(tmp_path / "other", ignore_errors=True)
    assert ask(process, tmp_path / "other", function="thrice") == (21.0, False, [])
    shutil.copy(kept(tmp_path / "other"), kept(home))
    is_made_anew(process, home)


def test_a_helper_that_changed_in_another_file_is_not_computed_with_its_old_code(process, tmp_path):
    """Numba keeps the code of what a function calls with it, and looks at the function's own file alone."""
    file = (tmp_path / "changing_helper").with_suffix(".py")
    for factor, found in ((2.0, False), (2.0, True), (3.0, False), (2.0, True)):
        file.write_text(f"def part(x):\n    return {factor} * x\n")
        assert ask(process, tmp_path, source=str(file)) == (7.0 * factor, found, [])
    assert len(files(tmp_path)) == 2


def test_all_that_kernels_import_from_here_names_their_folder():
    """What they take their numbers and parts from: a change of it is a change of their code."""
    root = Path(kept_code.__file__).parents[1]
    known = {file for source in kept_code.SOURCES for file in (source.glob("*.py") if source.is_dir() else [source])}
    kernels = list((root / "integrator" / "kernels").glob("*.py"))
    assert set(kernels) < known
    for file in [*kernels, root / "integrator" / "constants.py"]:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level:
                folder = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
                assert folder.with_suffix(".py") in known, f"{file.name}: {node.module}"


@pytest.mark.parametrize("bits", [0o602, 0o620, 0o666, None])
def test_a_file_that_others_may_write_to_is_made_anew(process, home, bits):
    if bits is not None:
        kept(home).chmod(bits)
    elif os.geteuid() == 0:
        # Only root may give files away.
        os.chown(kept(home), 12345, -1)
    else:
        pytest.skip("needs root")
    is_made_anew(process, home)


@pytest.mark.parametrize("kind", ["folder", "link", "pipe"])
def test_what_is_no_file_is_not_loaded(process, home, kind, tmp_path):
    file = kept(home)
    file.rename(tmp_path / "elsewhere")
    if kind == "folder":
        file.mkdir()
        value, found, (said,) = ask(process, home)
        assert (value, found) == (14.0, False)
        assert said.endswith("it is a folder; name a file in it")
    else:
        file.symlink_to(tmp_path / "elsewhere") if kind == "link" else os.mkfifo(file)
        is_made_anew(process, home)
        assert not file.is_symlink()


def test_a_full_disk_is_told_and_leaves_nothing(process, tmp_path):
    value, found, (said,) = ask(process, tmp_path, limit=1024)
    assert (value, found) == (14.0, False)
    assert said.startswith(f"machine code is not kept in {tmp_path}/shapephase/kernels-")
    assert said.endswith("File too large")
    assert files(tmp_path) == []
    assert ask(process, tmp_path) == (14.0, False, [])


@pytest.mark.full
def test_another_processor_has_a_file_of_its_own(process, home):
    """The same folder, as in a home that two machines share."""
    other = KeepingProcess(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    try:
        assert ask(other, home) == (14.0, False, [])
        assert ask(other, home) == (14.0, True, [])
    finally:
        other.stop()
    assert ask(process, home) == (14.0, True, [])
    assert len(files(home)) == 2
