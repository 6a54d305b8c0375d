"""Error bars by sampling in other threads and processes: the same numbers."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import shapephase as sp


@pytest.fixture(scope="module")
def motion():
    times = np.linspace(0.0, 1.0, 7)
    path = sp.ShapePath.spline(times, sp.examples.kane_scher(0.0, 0.5).shape(times), True)
    return sp.reconstruct(sp.articulated(sp.load_body("cat_two_halves"), path), [0.0, 0.0, 0.005], tolerance=1e-7)


WORDS = {"joints": 1e-3, "inertias": sp.InertiaErrors(masses=0.05), "momentum": 1e-4, "attitude": 1e-3, "draws": 6}


def pools():
    threads = pytest.param(lambda: ThreadPoolExecutor(2), id="threads")
    processes = lambda: ProcessPoolExecutor(2, mp_context=get_context("spawn"))  # noqa: E731
    return [threads, pytest.param(processes, id="processes", marks=pytest.mark.full)]


@pytest.mark.parametrize("pool", pools())
def test_sampled_error_bars_do_not_depend_on_who_computes_them(motion, pool):
    alone = sp.sampled_uncertainty(motion, **WORDS)
    with pool() as executor:
        found = sp.sampled_uncertainty(motion, **WORDS, executor=executor)
    for name in ("final_attitude", "holonomy", "dynamic_phase", "montgomery_phase", "start"):
        np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))
