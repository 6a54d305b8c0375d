"""Threads, processes and settings of a process change no bit of a result, and results share no memory with anything."""

from __future__ import annotations

import copy
import dataclasses
import json
import os
import pickle
import random
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import shapephase as sp
from support.places import ROOT
from support.public_calls import as_bytes, calls, digest, digests, digests_of_motions, objects

# Functions of the face that draw, write, serve, compile, search for long, or take what the calls make by other names;
# their own tests call them.
NOT_CALLED = {
    "closed_orbits", "compile_steps", "continued_orbits", "derivatives", "design", "dynamic_phase_from_energy",
    "in_gauge", "holonomy_derivative", "load_motion", "momentum_from_recording",
    "momentum_returns",
    "export_motion", "motion_from_recording", "particles", "plan_reorientation", "prescribed",
    "read_recorded_motion", "read_shape_path", "read_trajectory", "rigid",
    "sampled_uncertainty",
    "stokes_holonomy", "view", "write_shape_path", "base_difference",
}  # fmt: skip


@pytest.fixture(scope="module")
def on():
    return objects()


@pytest.fixture(scope="module")
def results(on):
    """What one thread gets."""
    return {name: call() for name, call in calls(on).items()}


@pytest.fixture(scope="module")
def expected(results):
    """A digest of each, before anything else is done."""
    return {name: digest(lambda found=found: found) for name, found in results.items()}


def test_no_public_function_is_forgotten(on):
    functions = {name for name in sp.__all__ if callable(getattr(sp, name)) and not isinstance(getattr(sp, name), type)}
    assert functions - NOT_CALLED == functions & set(calls(on))


@pytest.mark.parametrize("rounds", [1, pytest.param(10, marks=pytest.mark.full)])
def test_eight_threads_on_the_same_objects_get_what_one_gets(expected, rounds):
    """Of objects that nobody has used before, so that what they keep is made by all threads at once."""
    for turn in range(rounds):
        shared, wrong = objects(), []
        ready = threading.Barrier(8)

        def work(number: int, shared=shared, wrong=wrong, ready=ready, turn=turn) -> None:
            mine = list(calls(shared).items())
            # Two threads have the same order: they meet in every call.
            random.Random(4 * turn + number // 2).shuffle(mine)
            if rounds == 1:
                mine = mine[: len(mine) // 4]
            ready.wait()
            for name, call in mine:
                if digest(call) != expected[name]:
                    wrong.append(name)

        with ThreadPoolExecutor(8) as pool:
            list(pool.map(work, range(8)))
        assert wrong == []


# ---- Settings of a process ------------------------------------------------------------------------------------------

# What a process does before it imports anything of ours.
COMMA = """
import locale
locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
assert locale.localeconv()["decimal_point"] == ","
"""
RAISE = "import numpy; numpy.seterr(all='raise')\n"
BEGIN = """
import json, sys
from support.public_calls import digests, objects
found = digests(objects())
"""
FORK = """
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
on = objects()
with ProcessPoolExecutor(1, mp_context=get_context("fork")) as pool:
    (again,) = pool.map(digests, [on])
assert again == found, "a forked process gets something else"
"""
MOTIONS = "from support.public_calls import digests_of_motions\nfound |= digests_of_motions()\n"
END = "print(json.dumps(found))\n"


@pytest.fixture(scope="module")
def comma_locale(tmp_path_factory):
    """The folder of a locale with decimal commas."""
    folder = tmp_path_factory.mktemp("locales")
    made = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
    try:
        subprocess.run(made, capture_output=True)
    except FileNotFoundError:
        pytest.skip("no localedef on this system")
    if not (folder / "de_DE.UTF-8").is_dir():
        pytest.skip("the sources of locales are not installed")
    return folder


def alone(source, *options, **environment):
    path = os.pathsep.join([str(ROOT / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, *options, "-c", source],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", **environment},
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)


@pytest.mark.full
def test_all_settings_at_once_change_nothing(expected, comma_locale):
    """Floating-point errors raise, decimals have commas, no assertion is compiled, warnings are errors; and a fork."""
    source = COMMA + RAISE + BEGIN + FORK + MOTIONS + END
    assert alone(source, "-OO", "-W", "error", LOCPATH=str(comma_locale)) == expected | digests_of_motions()


@pytest.mark.full
@pytest.mark.parametrize("setting", ["comma", "raise", "optimised", "strict", "fork"])
def test_each_setting_alone_changes_nothing(expected, setting, request):
    before = {"comma": COMMA, "raise": RAISE}.get(setting, "")
    options = {"optimised": ("-OO",), "strict": ("-W", "error")}.get(setting, ())
    environment = {"LOCPATH": str(request.getfixturevalue("comma_locale"))} if setting == "comma" else {}
    source = before + BEGIN + (FORK if setting == "fork" else "") + END
    assert alone(source, *options, **environment) == expected


@pytest.mark.full
def test_threads_and_forks_get_the_same_too():
    """Forked after the compiled steps were loaded; eight threads that find them not loaded yet."""
    threads = """
import json
from concurrent.futures import ThreadPoolExecutor
from support.public_calls import digests, objects
on = objects()
with ThreadPoolExecutor(8) as pool:
    several = list(pool.map(lambda _: digests(on), range(8)))
found = several[0]
assert several == [found] * 8, "a thread gets something else"
"""
    one = alone(BEGIN + FORK + END)
    assert alone(threads + FORK + END) == one


# ---- Other processes ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def travellers(on):
    """One of each kind that people send about."""
    return {
        "Body": on.body,
        "ShapePath": on.path,
        "Deformation": on.deformation,
        "Motion": on.motion,
        "PhaseSplit": sp.split(on.motion),
        "FixedPoints": sp.fixed_points(on.deformation, 0.02),
    }


def turned(thing):
    """What a worker does with one."""
    return as_bytes(sp.reconstruct(thing, (0.01, 0.02, 0.03)) if isinstance(thing, sp.Deformation) else thing)


def test_workers_of_joblib_and_of_concurrent_futures_get_the_same(travellers):
    joblib = pytest.importorskip("joblib")
    things = list(travellers.values())
    here = [turned(thing) for thing in things]
    assert joblib.Parallel(n_jobs=2, prefer="threads")(joblib.delayed(turned)(thing) for thing in things) == here
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(turned, things)) == here


@pytest.mark.full
def test_processes_of_joblib_and_of_concurrent_futures_get_the_same(travellers, monkeypatch):
    joblib = pytest.importorskip("joblib")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]))
    things = list(travellers.values())
    here = [as_bytes(thing) for thing in things]
    assert joblib.Parallel(n_jobs=2)(joblib.delayed(as_bytes)(thing) for thing in things) == here
    for kind in ("spawn", "forkserver"):
        with ProcessPoolExecutor(2, mp_context=get_context(kind)) as pool:
            assert list(pool.map(as_bytes, things)) == here


@pytest.mark.full
def test_a_plan_pickles_and_copies():
    """With the motion that it is made of."""
    goal = sp.optimal_control.Goal(rotation=sp.so3.exp(np.radians(10.0) * np.array([1.0, 0.0, 0.0])))
    plan = sp.plan_reorientation(sp.load_body("cat_two_halves"), goal, momentum=(0.0, 0.0, 0.0))
    for again in (pickle.loads(pickle.dumps(plan)), copy.deepcopy(plan), copy.copy(plan)):
        assert as_bytes(again.motion) == as_bytes(plan.motion)
        assert as_bytes(again.path) == as_bytes(plan.path)
        assert (again.cost, again.iterations) == (plan.cost, plan.iterations)


# ---- What results share ---------------------------------------------------------------------------------------------


def arrays_of(thing, depth=0):
    """All arrays of a result that can be written to."""
    if isinstance(thing, np.ndarray):
        if thing.flags.writeable and thing.size:
            yield thing
    elif isinstance(thing, tuple | list):
        for part in thing:
            yield from arrays_of(part, depth)
    elif dataclasses.is_dataclass(thing) and depth < 4:
        for field in dataclasses.fields(thing):
            yield from arrays_of(getattr(thing, field.name), depth + 1)


@pytest.mark.full
def test_what_is_written_into_results_and_floating_point_errors_that_raise_change_nothing(expected):
    """Every array of every result that can be written to is filled with nonsense; all calls give what they gave."""
    on = objects()
    written = 0
    with np.errstate(all="raise"):
        for call in calls(on).values():
            for array in arrays_of(call()):
                dtype = array.dtype
                array[...] = np.zeros(1, dtype)[0] if dtype.kind in "USO" else np.array(7).astype(dtype)
                written += 1
        found = digests(on)
    assert written > 30
    assert found == expected


def test_methods_give_arrays_that_can_be_written_to(results):
    """SciPy's `Rotation.from_matrix` once refused what cannot; numbers that are shown stay locked."""
    for name, found in results.items():
        if isinstance(found, np.ndarray):
            assert found.flags.writeable, name
