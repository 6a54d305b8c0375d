"""Which kernels are machine code and when, where it is kept, and what is said when there is none."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.cli.terminal import verbosity_from
from shapephase.errors import CompilerError
from shapephase.integrator import kept_code, machine_code
from shapephase.integrator.machine_code import inline, kernel, plain

SPLIT = ["split", "cat", "cat_righting", "--json"]


@inline
def doubled(x):
    """A part that divides, too."""
    return 2.0 * x, 1.0 / x


@kernel
def fill(numbers, doubles, inverses):
    """Doubles and inverses."""
    for i in range(len(numbers)):
        doubles[i], inverses[i] = doubled(numbers[i])


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A folder for caches that nothing has used yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    kept = kept_code.kernel_folder, kept_code._announce
    for answer in kept:
        answer.cache_clear()
    yield tmp_path
    for answer in kept:
        answer.cache_clear()


@pytest.fixture
def no_numba(monkeypatch):
    """Numba cannot be imported, and nobody has tried yet."""

    def broken():
        raise ImportError("Numba needs NumPy 2.4 or less")

    monkeypatch.setattr(machine_code, "_import_numba", broken)
    machine_code._import_fault.cache_clear()
    yield
    machine_code._import_fault.cache_clear()


@pytest.fixture
def command():
    """This process is a command, until the test ends."""
    with machine_code.as_command():
        yield
    assert machine_code.is_used()


def filled(numbers):
    doubles, inverses = np.empty((2, len(numbers)))
    fill(numbers, doubles, inverses)
    return doubles, inverses


def kernel_folder():
    """The folder, and what is said about it; asked twice, said once."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = kept_code.kernel_folder()
        assert kept_code.kernel_folder() == found
    return found, [str(warning.message) for warning in said]


def mode(folder):
    return folder.stat().st_mode & 0o777


# ---- Compiled or interpreted ----------------------------------------------------------------------------------------


def test_both_give_the_same_bits(monkeypatch, rng):
    numbers = np.append(rng.normal(size=50), [0.0, np.inf, np.nan])
    assert machine_code.is_used()
    compiled = filled(numbers)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert not machine_code.is_used()
    np.testing.assert_array_equal(filled(numbers), compiled)
    assert compiled[1][50] == np.inf


def test_kernels_and_parts_are_found_by_their_names():
    """By tools and readers: a part is a plain function, a kernel has the name and the text of its function."""
    assert doubled(2.0) == (4.0, 0.5)
    assert (fill.__name__, fill.__doc__) == ("fill", "Doubles and inverses.")
    assert fill.__wrapped__ is fill.interpreted


@pytest.mark.usefixtures("command")
@pytest.mark.parametrize(
    ("work", "enough"),
    [
        ({"momenta": 1, "rows": 199, "steps": 400}, False),
        ({"momenta": 20}, True),
        ({"rows": 200}, True),
        ({"steps": 5000}, True),
    ],
)
def test_a_command_waits_for_much_work(work, enough):
    assert not machine_code.is_used()
    machine_code.expect_work(**work)
    assert machine_code.is_used() == enough
    machine_code.expect_work()
    assert machine_code.is_used() == enough


@pytest.mark.usefixtures("no_numba")
def test_without_numba_all_is_interpreted_and_said_once(capsys):
    with pytest.warns(sp.CompiledCodeWarning, match="NumPy"):
        assert not machine_code.is_used()
    assert filled(np.ones(2))[0].tolist() == [2.0, 2.0]
    with pytest.raises(CompilerError, match="NumPy"):
        sp.compile_steps()
    with pytest.raises(SystemExit) as ended:
        main(["compile"])
    assert ended.value.code != 0
    assert capsys.readouterr().err.count("\n") == 1
    main(["doctor", "--json"])
    assert "needs NumPy" in json.loads(capsys.readouterr().out)["machine_code"]


def test_nothing_is_compiled_for_a_numba_that_interprets(monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    with pytest.raises(CompilerError, match="NUMBA_DISABLE_JIT"):
        sp.compile_steps()


@pytest.mark.usefixtures("heard_ctrl_c")
def test_ctrl_c_leaves_no_numba_half_imported(monkeypatch):
    whole = []

    def imported():
        signal.raise_signal(signal.SIGINT)
        whole.append(True)

    monkeypatch.setattr(machine_code, "_import_numba", imported)
    machine_code._import_fault.cache_clear()
    try:
        with pytest.raises(KeyboardInterrupt):
            machine_code.is_used()
        assert whole == [True]
    finally:
        machine_code._import_fault.cache_clear()


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6.0).reshape(2, 3).T,
        np.arange(6.0)[::2],
        np.broadcast_to(1.0, (2, 3)),
        np.arange(3),
        np.frombuffer(np.arange(3.0).tobytes()),
        np.arange(3.0, dtype=">f8"),
        np.arange(3) * 1j,
    ],
)
def test_plain_arrays_are_of_one_kind(array):
    found = plain(array)
    assert found.flags.c_contiguous
    assert found.flags.writeable
    assert found.flags.aligned
    assert found.dtype == (complex if array.dtype == complex else float)
    np.testing.assert_array_equal(found, array)
    assert plain(found) is found


# ---- Where it is kept -----------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    ("kind", "words"),
    [*((bits, "others may write") for bits in (0o770, 0o707, 0o777)), ("user", "another user"), ("link", "no folder")],
)
def test_a_folder_that_is_not_the_user_s_alone_is_not_used(home, monkeypatch, kind, words):
    """What is loaded from it would be run."""
    folder = home / ("elsewhere" if kind == "link" else "shapephase")
    folder.mkdir(mode=0o700)
    if kind == "link":
        (home / "shapephase").symlink_to(folder)
    elif kind != "user":
        folder.chmod(kind)
    elif os.getuid() == 0:
        os.chown(folder, 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    found, (said,) = kernel_folder()
    assert found is None
    assert words in said
    assert list(folder.iterdir()) == []


@pytest.mark.usefixtures("home")
@pytest.mark.parametrize("value", ["relative/is/ignored", ""])
def test_without_a_home_nothing_is_kept_but_all_is_computed(monkeypatch, value):
    def nowhere():
        raise RuntimeError("no home directory")

    monkeypatch.setenv("XDG_CACHE_HOME", value)
    monkeypatch.setattr(kept_code.Path, "home", nowhere)
    found, (said,) = kernel_folder()
    assert found is None
    assert "XDG_CACHE_HOME" in said
    fresh = kernel(fill.interpreted)
    doubles, inverses = np.empty((2, 2))
    fresh(np.ones(2), doubles, inverses)
    assert doubles.tolist() == [2.0, 2.0]
    with pytest.raises(CompilerError, match="folder"):
        sp.compile_steps()


def test_a_place_that_is_no_folder_cannot_be_compiled_into(home, monkeypatch):
    (home / "file").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / "file"))
    with pytest.raises(CompilerError, match="XDG_CACHE_HOME"):
        sp.compile_steps()


# ---- What is said ---------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("home")
@pytest.mark.parametrize("quiet", [True, False])
def test_the_first_compilation_is_announced_once(capfd, quiet):
    handler = logging.StreamHandler(sys.stderr)
    logging.getLogger("shapephase").addHandler(handler)
    try:
        with verbosity_from(["compile", *(["--quiet"] if quiet else [])]):
            for _ in range(2):
                kernel(fill.interpreted)(np.ones(1), *np.empty((2, 1)))
    finally:
        logging.getLogger("shapephase").removeHandler(handler)
    assert capfd.readouterr().err.count("compiling") == (not quiet)


def run(arguments, home, **environment):
    """A process of its own: what it printed, and whether it imported Numba."""
    code = (
        f"import sys; from shapephase.cli.main import main; main({arguments!r}); "
        "print('numba' in sys.modules, file=sys.stderr)"
    )
    variables = os.environ | {"XDG_CACHE_HOME": str(home), **environment}
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=variables)
    return json.loads(done.stdout), done.stderr.splitlines()[-1] == "True"


def test_a_short_command_does_not_wait_for_numba(home):
    _, imported = run(SPLIT, home)
    assert not imported


@pytest.mark.full
def test_what_is_compiled_is_kept_and_found_again(home):
    compiled, imported = run(["compile", "--json"], home)
    assert imported
    files = [Path(name) for name in compiled["files"]]
    assert files
    before = {file: file.stat().st_mtime_ns for file in files}
    again, _ = run(["compile", "--json"], home)
    assert again["files"] == compiled["files"]
    assert before == {file: file.stat().st_mtime_ns for file in files}
