"""Several starts searched from side by side, by threads, processes and a cluster: the same plans."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import PlanNotFound, WrongObjectError
from shapephase.optimal_control import Limits, Search

GOAL = sp.so3.exp(np.array([1.0, 0.0, 0.0]))
OPTIONS = {"limits": Limits(rate_limits=None)}


def planned(executor=None, *, starts=3, **more):
    search = Search(pieces=8, starts=starts, seed=2)
    return sp.plan_reorientation(
        sp.load_body("cat_two_halves"), GOAL, search=search, executor=executor, **OPTIONS, **more
    )


def same(one, other):
    np.testing.assert_array_equal(one.coefficients, other.coefficients)
    np.testing.assert_array_equal(one.motion.final_attitude, other.motion.final_attitude)
    assert one.cost == other.cost
    for ours, theirs in zip(one.starts, other.starts, strict=True):
        for name in ("status", "converged", "cost", "goal_error", "kkt_residual", "iterations"):
            assert getattr(ours, name) == getattr(theirs, name), name


@pytest.mark.full
def test_plans_do_not_depend_on_who_searches():
    alone = planned()
    with ThreadPoolExecutor(2) as executor:
        same(planned(executor), alone)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        same(planned(executor), alone)


@pytest.mark.full
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_finds_the_same_plan():
    from distributed import Client, LocalCluster

    alone = planned()
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        same(planned(client.get_executor()), alone)


@pytest.mark.full
def test_one_thread_finds_the_same_plan_and_a_callback_hears_of_every_start():
    reported = []
    with ThreadPoolExecutor(1) as executor:
        found = planned(executor, starts=2, progress=lambda *now: reported.append(now))
    same(found, planned(starts=2))
    ends = [text.partition(",")[0] for _, text in reported if text.startswith("search")]
    assert ends == [f"search {k + 1} of 2: iteration {start.iterations}" for k, start in enumerate(found.starts)]
    assert reported[-1] == (1.0, "done")


@pytest.mark.full
def test_a_callback_ends_the_search_after_a_start():
    with ThreadPoolExecutor(1) as executor:
        found = planned(executor, starts=3, progress=lambda _, text: text.startswith("search"))
    assert len(found.starts) == 1


def test_what_is_no_executor_is_said():
    with pytest.raises(WrongObjectError, match="executor"):
        planned(Search)


def test_a_search_that_finds_nothing_says_so_from_there():
    with ThreadPoolExecutor(1) as executor, pytest.raises(PlanNotFound, match="start"):
        sp.plan_reorientation(
            sp.load_body("cat_two_halves"), GOAL, search=Search(pieces=8, starts=2, iterations=1), executor=executor,
            **OPTIONS,
        )  # fmt: skip
