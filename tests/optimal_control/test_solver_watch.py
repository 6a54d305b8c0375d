"""Solvers followed: what is told of an iterate, and which of them is kept."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

from shapephase.optimal_control.solver_watch import BestIterate, ipopt_callback


def test_the_cheapest_of_the_nearly_feasible_is_kept():
    followed = BestIterate(None)
    iterates = [(5.0, 0.5), (1.0, 0.2), (3.0, 1e-5), (2.0, 2e-4), (2.5, 0.0), (0.1, 0.1)]
    for number, (cost, infeasibility) in enumerate(iterates):
        assert not followed.stops(np.array([float(number)]), cost, infeasibility)
    assert (followed.unknowns[0], followed.cost, followed.infeasibility) == (3.0, 2.0, 2e-4)
    assert followed.iterations == 6


def test_the_least_infeasible_is_kept_where_none_is_feasible():
    followed = BestIterate(None)
    for number, infeasibility in enumerate((0.5, 0.2, 0.4)):
        followed.stops(np.array([float(number)]), -infeasibility, infeasibility)
    assert followed.unknowns[0] == 1.0


def test_what_is_told_of_an_iterate_is_what_it_violates():
    """x^2 between 4 and 9 and x y = 1 exactly: violated on either side, each told as it is."""
    low, high = np.array([4.0, 1.0]), np.array([9.0, 1.0])
    told = []
    followed = BestIterate(lambda iteration, cost, violated: told.append((iteration, cost, violated)) or iteration == 1)
    heard = ipopt_callback(followed, 2, low, high)
    nothing = np.zeros(2), np.zeros(2), np.zeros(0)
    for rows, wanted in (([3.5, 1.2], 0.5), ([9.25, 0.9], 0.25)):
        stop = heard(np.array([1.0, 2.0]), 7.0, np.array(rows), *nothing)
        assert told[-1][1:] == (7.0, pytest.approx(wanted, abs=1e-15))
    assert int(casadi.DM(stop)) == 1
    assert followed.stopped
