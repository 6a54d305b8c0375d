"""When machine code is used, and that all is as before without Numba."""

from __future__ import annotations

import signal
import sys
from importlib import import_module

import numpy as np
import pytest

import shapephase as sp
from shapephase.examples.scenarios import MOTIONS
from shapephase.integrator.fast import engine, switch


def test_without_numba_all_is_as_before(monkeypatch):
    monkeypatch.setenv("SHAPEPHASE_FAST", "1")
    monkeypatch.setitem(sys.modules, "numba", None)
    switch.is_installed.cache_clear()
    try:
        assert not engine.is_ready()
        motion = sp.reconstruct(_cat_righting(), np.zeros(3))
        assert motion.error_estimate < 1e-9
    finally:
        switch.is_installed.cache_clear()


@pytest.mark.usefixtures("fast")
def test_a_numba_that_interprets_is_not_used(monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert not switch.is_on()


@pytest.mark.usefixtures("fast")
def test_it_does_not_change_within_one_computation(monkeypatch):
    with engine.Decided():
        monkeypatch.setenv("SHAPEPHASE_FAST", "0")
        assert engine.is_ready()
        with engine.Decided():
            assert engine.is_ready()
    assert not engine.is_ready()


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize(("momenta", "samples", "enough"), [(1, 4000, False), (1000, 4000, True), (1, 400_000, True)])
def test_the_command_line_waits_for_large_work(monkeypatch, momenta, samples, enough):
    monkeypatch.delenv("SHAPEPHASE_FAST")
    monkeypatch.setattr(switch, "_is_command", False)
    monkeypatch.setattr(switch, "_is_large", False)
    assert switch.is_on()
    assert switch.may_compile()
    switch.begin_command()
    assert not switch.is_on()
    switch.expect_work(momenta=momenta, samples=samples)
    assert switch.is_on() == enough
    assert not switch.may_compile()
    monkeypatch.setenv("SHAPEPHASE_FAST", "1")
    assert switch.is_on()
    assert switch.may_compile()


@pytest.mark.usefixtures("fast", "heard_ctrl_c")
def test_ctrl_c_leaves_no_numba_half_imported(monkeypatch):
    asked = []

    def imported(name, package):
        asked.append(name)
        signal.raise_signal(signal.SIGINT)
        return import_module(name, package)

    monkeypatch.setattr(engine, "import_module", imported)
    with pytest.raises(KeyboardInterrupt):
        engine._import_kernels()
    assert {f".kernels.{name}_kernel" for name in ("tree", "march", "panel")} < set(asked)
    assert asked[-1] == ".kernels.jit"


def _cat_righting():
    named = MOTIONS["cat_righting"]
    return sp.articulated(sp.load_body(named.body), named.path())
