"""Very many directions in parts, by threads and processes: the same bits, and those of the whole to the tolerance."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import WrongObjectError
from shapephase.phases import _loop_map
from shapephase.sphere import fibonacci_directions


@pytest.fixture(scope="module")
def deformation():
    return sp.articulated(sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.35, 1.0))


def same(one, other, *names):
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_a_map_in_parts_is_that_of_the_whole(deformation, monkeypatch):
    """Attitudes of both are within 1e-10; how far a direction is off is at most that."""
    directions = fibonacci_directions(50)
    whole = sp.stroboscopic_map(deformation, 0.05, directions)
    monkeypatch.setattr(_loop_map, "_ROWS_AT_ONCE", 20)
    alone = sp.stroboscopic_map(deformation, 0.05, directions)
    with ThreadPoolExecutor(2) as executor:
        found = sp.stroboscopic_map(deformation, 0.05, directions, executor=executor)
    same(found, alone, "end", "derivative", "trace")
    np.testing.assert_allclose(found.end, whole.end, rtol=0.0, atol=2e-10)
    np.testing.assert_allclose(found.derivative, whole.derivative, rtol=0.0, atol=1e-7)
    assert len(found.solution.parts) == 3


@pytest.mark.full
def test_fixed_points_do_not_depend_on_who_computes_them(deformation, monkeypatch):
    whole = sp.fixed_points(deformation, 0.06)
    monkeypatch.setattr(_loop_map, "_ROWS_AT_ONCE", 100)
    monkeypatch.setattr(_loop_map, "_SLOPES_AT_ONCE", 4)
    alone = sp.fixed_points(deformation, 0.06)
    with ThreadPoolExecutor(2) as executor:
        found = sp.fixed_points(deformation, 0.06, executor=executor)
    same(found, alone, "directions", "trace", "index", "gap")
    assert found.complete
    assert found.stability == whole.stability
    np.testing.assert_allclose(found.directions, whole.directions, rtol=0.0, atol=1e-9)


def processes():
    return ProcessPoolExecutor(2, mp_context=get_context("spawn"))


@pytest.mark.full
@pytest.mark.filterwarnings("ignore")
def test_processes_and_a_cluster_give_the_same(deformation):
    from distributed import Client, LocalCluster

    directions = fibonacci_directions(5000)
    alone = sp.stroboscopic_map(deformation, 0.05, directions, tolerance=1e-8)
    with processes() as executor:
        same(sp.stroboscopic_map(deformation, 0.05, directions, tolerance=1e-8, executor=executor), alone, "end")
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        executor = client.get_executor()
        same(sp.stroboscopic_map(deformation, 0.05, directions, tolerance=1e-8, executor=executor), alone, "end")


@pytest.mark.parametrize(("function", "more"), [(sp.fixed_points, ()), (sp.stroboscopic_map, (np.eye(3),))])
def test_what_is_no_executor_is_said(deformation, function, more):
    with pytest.raises(WrongObjectError, match="executor"):
        function(deformation, 0.05, *more, executor=3)
