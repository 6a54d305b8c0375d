"""Compiled steps: the same results to the last bit, and never a wrong one."""

from __future__ import annotations

import json
import os
import shutil

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import CompilerError
from shapephase.examples.scenarios import MOTIONS
from shapephase.integrator import _step_loop as step_loop
from shapephase.integrator import compilation
from shapephase.integrator.compiled_steps import forget_functions

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler on this machine")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty place for compiled functions; nothing compiled is left in this process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    forget_functions()
    yield tmp_path / "shapephase"
    forget_functions()


def is_compiled():
    forget_functions()
    return compilation.compiled_or_interpreted(step_loop.rest_step_function()).class_name() == "External"


def computed():
    """Everything that steps: with momentum, without, over many turns, and derivatives."""
    named = MOTIONS["cat_righting"]
    deformation = sp.articulated(sp.load_body(named.body), named.path())
    rng = np.random.default_rng(3)
    some = rng.normal(size=3) * 0.05
    for momentum in (some, np.zeros(3), np.array([0.0, 3.0, 0.5])):
        motion = sp.reconstruct(deformation, momentum, tolerance=1e-9)
        times = np.linspace(0.0, motion.duration, 11)
        yield motion.attitude(times)
        yield np.asarray(motion.error_estimate)
        yield motion.dynamic_phase(times)
    yield sp.reconstruct(deformation, some).sensitivity.by_momentum


def computed_for_many():
    """Steps of many momenta, few and far turns."""
    named = MOTIONS["cat_righting"]
    deformation = sp.articulated(sp.load_body(named.body), named.path())
    momenta = np.random.default_rng(4).normal(size=(50, 3))
    for size in (0.02, 0.2):
        motion = sp.reconstruct(deformation, size * momenta)
        times = np.linspace(0.0, motion.duration, 11)
        yield motion.attitude(times)
        yield motion.dynamic_phase(times)
        yield motion.solid_angle(times)
        yield motion.propagator


def test_compiled_steps_give_the_same_bits(folder, capsys):
    interpreted, of_many = list(computed()), list(computed_for_many())
    assert not is_compiled()
    main(["compile", "--json"])
    written = json.loads(capsys.readouterr().out)["files"]
    assert sorted(map(str, folder.iterdir())) == sorted(written)
    assert is_compiled()
    for before, after in zip(interpreted, computed(), strict=True):
        assert np.array_equal(before, after)
    # On whole arrays NumPy has sines of its own, and what they round otherwise grows.
    for before, after in zip(of_many, computed_for_many(), strict=True):
        assert np.abs(after - before).max() < 1e-12


@pytest.mark.parametrize("options", ["-ffast-math", "-Dsqrt=cbrt"])
def test_a_compiler_that_computes_otherwise_is_refused(folder, monkeypatch, options):
    """The first would also make this whole process take the smallest numbers for zero."""
    monkeypatch.setenv("CC", f"cc {options}")
    with pytest.raises(CompilerError, match="other numbers"):
        compilation.compile_functions([step_loop.rest_step_function()])
    assert list(folder.iterdir()) == []
    assert np.array([5e-324])[0] * 1.0 > 0.0


@pytest.mark.parametrize(
    ("compiler", "words"), [("no_such_compiler", "there is no C compiler"), ("false", "the compiler false failed")]
)
def test_without_a_compiler_that_works_it_is_said(folder, monkeypatch, compiler, words, capsys):
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(SystemExit) as ended:
        main(["compile"])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert "no folder" not in said
    assert not folder.exists() or list(folder.iterdir()) == []


def test_a_folder_that_cannot_be_written_to(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(CompilerError, match="cannot be written to"):
        sp.compile_steps()


def test_a_place_that_cannot_be_looked_at_is_no_obstacle(monkeypatch):
    def refuse(*_, **__):
        raise PermissionError

    monkeypatch.setattr(compilation.Path, "is_dir", refuse)
    assert not is_compiled()


def test_without_a_home_nothing_is_kept(monkeypatch):
    def nowhere():
        raise RuntimeError("no home directory")

    monkeypatch.setenv("XDG_CACHE_HOME", "relative/is/ignored")
    monkeypatch.setattr(compilation.Path, "home", nowhere)
    assert not is_compiled()
    with pytest.raises(CompilerError, match="XDG_CACHE_HOME"):
        sp.compile_steps()


def test_a_library_that_is_none_is_told_and_left_alone(folder):
    function = step_loop.rest_step_function()
    library = compilation._library(function.name(), compilation._source(function))
    folder.mkdir()
    library.write_bytes(b"no machine code")
    with pytest.warns(sp.CompiledCodeWarning, match="shapephase compile"):
        assert compilation.compiled_or_interpreted(function) is function


def test_what_another_user_wrote_is_not_run(folder, monkeypatch):
    function = step_loop.rest_step_function()
    library = compilation._library(function.name(), compilation._source(function))
    folder.mkdir()
    library.write_bytes(b"somebody's machine code")
    if os.getuid() == 0:
        os.chown(library, 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert compilation.compiled_or_interpreted(function) is function
