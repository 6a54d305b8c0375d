"""Solvers observed: what is reported of an iterate, and which of them is kept."""

from __future__ import annotations

import signal

import casadi
import numpy as np
import pytest

import shapephase as sp
from shapephase.optimal_control import Search
from shapephase.optimal_control.solver_callback import BestIterate, ipopt_callback


def test_the_cheapest_of_the_nearly_feasible_is_kept():
    best = BestIterate(None, float)
    iterates = [(5.0, 0.5), (1.0, 0.2), (3.0, 1e-5), (2.0, 2e-4), (2.5, 0.0), (0.1, 0.1)]
    for number, (cost, infeasibility) in enumerate(iterates):
        assert not best.report(np.array([float(number)]), cost, infeasibility)
    assert (best.unknowns[0], best.cost, best.infeasibility) == (3.0, 2.0, 2e-4)
    assert best.iterations == 6


def test_the_least_infeasible_is_kept_where_none_is_feasible():
    best = BestIterate(None, float)
    for number, infeasibility in enumerate((0.5, 0.2, 0.4)):
        best.report(np.array([float(number)]), -infeasibility, infeasibility)
    assert best.unknowns[0] == 1.0


def test_an_iterate_is_reported_with_its_largest_violation():
    """x^2 between 4 and 9 and x y = 1 exactly: violated on either side, each reported as it is."""
    low, high = np.array([4.0, 1.0]), np.array([9.0, 1.0])
    reported = []
    best = BestIterate(lambda *now: reported.append(now) or now[0] == 1, lambda unknowns: float(unknowns[1]))
    callback = ipopt_callback(best, 2, low, high)
    nothing = np.zeros(2), np.zeros(2), np.zeros(0)
    for rows, expected in (([3.5, 1.2], 0.5), ([9.25, 0.9], 0.25)):
        stop = callback(np.array([1.0, 2.0]), 7.0, np.array(rows), *nothing)
        assert reported[-1][1:] == (7.0, pytest.approx(expected, abs=1e-15), 2.0)
    assert int(casadi.DM(stop)) == 1
    assert best.stopped


@pytest.mark.usefixtures("heard_ctrl_c")
@pytest.mark.parametrize("iteration", [0, 2])
def test_ctrl_c_in_an_iteration_is_raised_by_the_plan_and_handlers_stay_as_they_are(iteration):
    handlers = []

    def pressed(_, text):
        handlers.append(signal.getsignal(signal.SIGINT))
        if f": iteration {iteration}," in text:
            signal.raise_signal(signal.SIGINT)

    goal = sp.so3.exp(np.array([1.0, 0.0, 0.0]))
    with pytest.raises(KeyboardInterrupt):
        sp.plan_reorientation(sp.load_body("cat_two_halves"), goal, search=Search(pieces=8), progress=pressed)
    assert len(handlers) == iteration + 1
    assert set(handlers) == {signal.default_int_handler}
