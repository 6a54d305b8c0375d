"""What every test has: bodies, random numbers, small URDFs, a browser."""

from __future__ import annotations

import gc
import locale
import os
import signal
from functools import lru_cache

# The workers share the cores: threads of their own would get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import numpy as np
import pytest

import shapephase as sp
from support.bodies import BODIES, EVERY_BODY
from support.browser import _browser, chromium  # noqa: F401 (fixtures)


def pytest_configure(config):
    """As many examples as Hypothesis tries where a test does not say how many."""
    hypothesis.settings.register_profile("quick", max_examples=15)
    hypothesis.settings.register_profile("full", max_examples=50)
    hypothesis.settings.load_profile("quick" if config.option.markexpr == "not full" else "full")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect the tests without looking for garbage: millions of new objects, nearly all of which stay.

    Nor are they looked through again while the tests run; what comes then is looked through less often than usual.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 20, 20)
        gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A file's tests go to one worker, which computes what they share once."""
    from xdist.scheduler import LoadFileScheduling

    return LoadFileScheduling(config, log) if config.getvalue("dist") == "load" else None


@lru_cache(maxsize=len(BODIES))
def loaded(name):
    return sp.load_body(name)


@pytest.fixture(scope="session", params=EVERY_BODY)
def body(request):
    return loaded(request.param)


@pytest.fixture
def rng():
    return np.random.default_rng(20060518)


@pytest.fixture
def interpreted(monkeypatch):
    """No machine code, as in a short command, whose bits a program is to have: the body's samples are Pinocchio's."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")


@pytest.fixture
def few_guesses(monkeypatch):
    """Plans from the best of two guesses, not of eight: for tests of what is true of any plan."""
    monkeypatch.setattr("shapephase.optimal_control.planning._RANKED", 2)
    monkeypatch.setattr("shapephase.optimal_control.planning._LEAST_OF_FEW", 2)


@pytest.fixture
def no_pictures(monkeypatch):
    """Reports whose figures are drawn as nothing, for tests of their words."""
    monkeypatch.setattr("shapephase.plots.pages.report_page.figure_image", lambda *_: b"<svg/>")


@pytest.fixture(scope="session")
def _warm_engines():
    from support.warm_engines import WarmEngines

    started = WarmEngines()
    yield started
    started.stop()


@pytest.fixture
def warm_engines(_warm_engines, monkeypatch):
    """Engines without the time of their imports, for tests that load many files."""
    monkeypatch.setattr("shapephase.body.engines.engine_tree.run_alone", _warm_engines)


@pytest.fixture(scope="session")
def _warm_start():
    from support.warm_engines import WarmStart

    started = WarmStart()
    yield started
    started.stop()


@pytest.fixture
def warm_readers(_warm_start, monkeypatch):
    """What is read in a process of its own is read in a forked one, without the time of its imports."""
    monkeypatch.setattr("shapephase.shape_space.files.formats.parser_process.run_alone", _warm_start)


@pytest.fixture
def heard_ctrl_c():
    """Ctrl-C as on a terminal: a process that a script starts in the background is told to ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def kept_locale():
    """For a test of a library that sets the process's locale, and with it the encoding of all pipes."""
    before = locale.setlocale(locale.LC_ALL)
    yield
    locale.setlocale(locale.LC_ALL, before)


@pytest.fixture
def load_urdf(tmp_path):
    """Text of a URDF -> Body, through a file."""

    def load(text, **options):
        path = tmp_path / "body.urdf"
        path.write_text(text, encoding="utf-8")
        return sp.load_body(path, **options)

    return load
