"""Results computed ever finer until they settle."""

from __future__ import annotations

import numpy as np

from shapephase.refinement import halved, settled


def test_the_first_result_near_the_one_before_it():
    assert settled([1.0, 0.5, 0.25, 0.2, 0.19], lambda last, new: abs(new - last), 0.06) == 0.2
    assert settled([1.0, 0.5, 0.25], lambda last, new: abs(new - last), 0.25) == 0.25


def test_results_that_do_not_settle():
    assert settled([1.0, 2.0, 4.0], lambda last, new: abs(new - last), 0.5) is None
    assert settled([1.0], lambda last, new: abs(new - last), 0.5) is None
    assert settled([np.nan, np.nan], lambda last, new: abs(new - last), 0.5) is None


def test_nothing_finer_is_computed_than_needed():
    computed = []

    def results():
        for number in range(10):
            computed.append(number)
            yield 0.5**number

    assert settled(results(), lambda last, new: last - new, 0.25) == 0.25
    assert computed == [0, 1, 2]


def test_edges_are_halved():
    edges = list(halved(np.array([0.0, 1.0, 3.0]), 3))
    assert [len(e) for e in edges] == [3, 5, 9]
    assert edges[1].tolist() == [0.0, 0.5, 1.0, 2.0, 3.0]
